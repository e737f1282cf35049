//! Candela tables as maps of directions for LuxCore, which interpolates linearly between the centres of texels and normalises.
//!
//! An emission map spans azimuth and polar angle (`slg/core/sphericalfunction/sphericalfunction.cpp`). Columns lie at whole multiples of
//! their width, for which the map's axes turn by half a column, so that the planes of most files keep their place. The error at kinks
//! and at the ends of a table is computed and stated, never subtracted.
//!
//! LuxCore draws directions from a grid of cells, each as likely as its centre is bright. A direction that it never draws is dark for
//! meters, too (`funcPdf == 0` in `MapPointLight::Illuminate`, 2.11): a cell of 0.7 degrees reads 0 if it shines only past its centre.
//! So texels next to light are never completely dark.

use itertools::Itertools;
use luxproof_photometry::{LuminousIntensityDistribution, Symmetry};

use crate::SceneFile;
use crate::patches::resampled::Resampled;

/// Wanted error of linear interpolation between texels, in parts of the intensity there.
const WANTED_ERROR: f64 = 5e-5;
/// Below this part of the largest intensity, the error counts in parts of this intensity instead.
const DIM: f64 = 1e-2;
/// The share of directions that may have a larger error.
const LOST_SHARE: f64 = 1e-4;
/// Weight of the table's own angles, as a share of all directions: jobs read intensities there, too.
const OWN_ANGLES_SHARE: f64 = 0.01;
const HEIGHTS: [usize; 7] = [512, 1024, 2048, 4096, 8192, 16384, 32768];
const WIDTHS: [usize; 5] = [360, 720, 1440, 2880, 5760];
/// Largest number of texels, 24 MB of them.
const MAX_TEXELS: usize = 1440 * 4096;
/// Columns of an axial table.
const AXIAL_COLUMNS: usize = 8;
/// Columns and rows of the grid from which LuxCore takes a map's mean and draws directions.
const CELLS: [usize; 2] = [512, 256];
/// Value of dark texels next to light, in parts of the largest intensity.
const FAINT: f64 = 1e-9;
/// Relative error of LuxCore's mean by its 131,072 sums in 32-bit floats, beyond what this file computes.
const MEAN_ERROR: f64 = 5e-6;

/// A candela table as a map of directions.
pub(super) struct Map {
    original: LuminousIntensityDistribution,
    width: usize,
    height: usize,
    /// Where the columns begin, in degrees of C. The map does not interpolate across this seam.
    first_deg: f64,
    /// Values row by row, from the zenith on.
    texels: Vec<f32>,
}

impl Map {
    pub(super) fn of(distribution: &LuminousIntensityDistribution) -> Self {
        let largest = distribution.max_intensity().value();
        let kinks = Kinks::of(distribution);
        let [width, height] = kinks.size(distribution.symmetry());
        let (c_deg, gamma_deg) = (360.0 / width as f64, 180.0 / height as f64);
        let first_deg = (kinks.flattest_deg / c_deg).ceil() * c_deg;
        let columns: Vec<f64> = (0..width).map(|x| (first_deg + x as f64 * c_deg).rem_euclid(360.0)).collect();
        let rows: Vec<f64> = (0..height).map(|y| 180.0 - (y as f64 + 0.5) * gamma_deg).collect();
        let texels = distribution.intensities(&columns, &rows).into_iter().map(|cd| cd as f32).collect();
        let mut map = Self { original: distribution.clone(), width, height, first_deg, texels };
        map.light_up((FAINT * largest) as f32);
        map
    }

    /// Makes dark texels faint if they are within the width of one of LuxCore's cells of a lit one.
    fn light_up(&mut self, faint: f32) {
        let (width, height) = (self.width, self.height);
        let [across, along] = [width.div_ceil(CELLS[0]) + 1, height.div_ceil(CELLS[1]) + 1];
        let lit: Vec<bool> = self.texels.iter().map(|texel| *texel > 0.0).collect();
        if lit.iter().all(|is| *is) {
            return;
        }
        let mut near = lit.clone();
        for x in 0..width {
            let column = Line { first: x, step: width, count: height, is_closed: false };
            column.mark_near(&lit, &mut near, along);
        }
        let lit = near.clone();
        for y in 0..height {
            let row = Line { first: y * width, step: 1, count: width, is_closed: true };
            row.mark_near(&lit, &mut near, across);
        }
        for (texel, _) in self.texels.iter_mut().zip(near).filter(|(texel, is_near)| **texel == 0.0 && *is_near) {
            *texel = faint;
        }
    }

    /// Returns how far the map's axes turn from the luminaire's, so that columns lie in planes.
    pub(super) fn turned_deg(&self) -> f64 {
        self.first_deg - 180.0 / self.width as f64
    }

    /// Writes the map as a portable float map, which begins with the lowest row.
    pub(super) fn file(&self, name: &str) -> SceneFile {
        let mut bytes = format!("Pf\n{} {}\n-1.0\n", self.width, self.height).into_bytes();
        for row in self.texels.chunks(self.width).rev() {
            bytes.extend(row.iter().flat_map(|texel| texel.to_le_bytes()));
        }
        SceneFile { name: name.to_owned(), bytes }
    }

    /// Returns the flux that LuxCore divides intensities by: 4 pi times its own mean of the map.
    ///
    /// LuxCore adds the values in 32-bit floats, so this function does the same in the same order.
    pub(super) fn flux_lm(&self) -> f64 {
        let [columns, rows] = CELLS;
        let (mut sum, mut weights) = (0.0_f32, 0.0_f32);
        for y in 0..rows {
            let v = (y as f32 + 0.5) / rows as f32;
            let weight = (std::f32::consts::PI * v).sin();
            weights += columns as f32 * weight;
            for x in 0..columns {
                sum += self.look_up((x as f32 + 0.5) / columns as f32, v) * weight;
            }
        }
        4.0 * std::f64::consts::PI * f64::from(sum) / f64::from(weights)
    }

    /// Interpolates as LuxCore does, in 32-bit floats. `u` and `v` range from 0 to 1.
    fn look_up(&self, u: f32, v: f32) -> f32 {
        let (s, t) = (u * self.width as f32 - 0.5, v * self.height as f32 - 0.5);
        let (left, ds) = (s.floor(), s - s.floor());
        let (above, dt) = (t.floor(), t - t.floor());
        let (ids, idt) = (1.0 - ds, 1.0 - dt);
        ids * idt * self.texel(above, left)
            + ids * dt * self.texel(above + 1.0, left)
            + ds * idt * self.texel(above, left + 1.0)
            + ds * dt * self.texel(above + 1.0, left + 1.0)
    }

    /// Returns the texel of a row and a column, or the nearest one if they are outside the map.
    fn texel(&self, row: f32, column: f32) -> f32 {
        self.texels[clamped(row, self.height) * self.width + clamped(column, self.width)]
    }
}

impl Resampled for Map {
    fn table(&self) -> &LuminousIntensityDistribution {
        &self.original
    }

    fn intensity_cd(&self, c_deg: f64, gamma_deg: f64) -> f64 {
        let u = (c_deg - self.turned_deg()).rem_euclid(360.0) / 360.0;
        f64::from(self.look_up(u as f32, (1.0 - gamma_deg / 180.0) as f32))
    }

    fn off_cd(&self, c_deg: f64, gamma_deg: f64) -> f64 {
        let right = self.original.intensity(c_deg, gamma_deg).value();
        let read = self.intensity_cd(c_deg, gamma_deg);
        (read - right).abs() + MEAN_ERROR * read.max(right)
    }
}

/// Returns the index nearest to `i` below `count`.
fn clamped(i: f32, count: usize) -> usize {
    (i.max(0.0) as usize).min(count - 1)
}

/// A row or a column of texels.
struct Line {
    first: usize,
    /// Distance between neighbours in the list of texels.
    step: usize,
    count: usize,
    /// Whether the last texel is a neighbour of the first.
    is_closed: bool,
}

impl Line {
    /// Marks all texels of the line that are within `reach` of a lit one.
    fn mark_near(&self, lit: &[bool], near: &mut [bool], reach: usize) {
        // A closed line continues beyond its end, so that light at one end reaches the other.
        let visits = if self.is_closed { self.count + reach } else { self.count };
        for is_backward in [false, true] {
            let mut distance = usize::MAX;
            for k in 0..visits {
                let position = if is_backward { visits - 1 - k } else { k };
                let texel = self.first + self.step * (position % self.count);
                distance = if lit[texel] { 0 } else { distance.saturating_add(1) };
                near[texel] |= distance <= reach;
            }
        }
    }
}

/// Changes of slope of a table, per degree, in parts of the intensity there.
struct Kinks {
    /// Kinks along gamma, of all planes.
    gamma: Vec<f64>,
    planes: usize,
    /// Angles of planes, with the kinks across each plane by gamma.
    c: Vec<(f64, Vec<f64>)>,
    /// Slopes by gamma between the two planes with the least slope.
    flattest: Vec<f64>,
    /// The middle between these planes.
    flattest_deg: f64,
}

impl Kinks {
    fn of(distribution: &LuminousIntensityDistribution) -> Self {
        let full = distribution.full_circle();
        let (c_deg, gamma_deg) = (full.c_deg(), full.gamma_deg());
        let dim = DIM * distribution.max_intensity().value();
        let planes: Vec<&[f64]> = (0..c_deg.len()).map(|c| full.plane(c)).collect();
        let rows: Vec<Vec<f64>> = (0..gamma_deg.len()).map(|g| planes.iter().map(|plane| plane[g]).collect()).collect();
        let slopes: Vec<Vec<f64>> = rows.iter().map(|row| slopes(c_deg, row)).collect();
        let between_planes: Vec<Vec<f64>> = (0..c_deg.len().saturating_sub(1))
            .map(|c| slopes.iter().zip(&rows).map(|(s, row)| s[c].abs() / row[c].min(row[c + 1]).max(dim)).collect())
            .collect();
        let across_planes = (1..between_planes.len()).map(|c| {
            let bends = slopes.iter().zip(&rows).map(|(s, row)| (s[c] - s[c - 1]).abs() / row[c].max(dim));
            (c_deg[c], bends.collect())
        });
        let flattest = (0..between_planes.len())
            .min_by(|a, b| largest(&between_planes[*a]).total_cmp(&largest(&between_planes[*b])));
        Self {
            gamma: planes.iter().flat_map(|plane| bends(gamma_deg, plane, dim)).collect(),
            planes: planes.len(),
            c: across_planes.collect(),
            flattest_deg: flattest.map_or(0.0, |c| f64::midpoint(c_deg[c], c_deg[c + 1])),
            flattest: flattest.map(|c| between_planes[c].clone()).unwrap_or_default(),
        }
    }

    /// Returns columns and rows of the smallest map with few directions of a larger error, else of the map with the fewest.
    fn size(&self, symmetry: Symmetry) -> [usize; 2] {
        let widths: &[usize] = if symmetry == Symmetry::Axial { &[AXIAL_COLUMNS] } else { &WIDTHS };
        let sizes = widths.iter().flat_map(|w| HEIGHTS.map(|h| [*w, h]));
        let sizes = sizes.filter(|[w, h]| w * h <= MAX_TEXELS).sorted_by_key(|[w, h]| w * h);
        // All sizes that lose few enough directions are equal, and `min_by` returns the first of them.
        let excess = |size: &[usize; 2]| (self.lost_share(*size) / LOST_SHARE).max(1.0);
        sizes.min_by(|a, b| excess(a).total_cmp(&excess(b))).unwrap_or([WIDTHS[0], HEIGHTS[0]])
    }

    /// Returns the share of directions in which linear interpolation between texels has a larger error than wanted.
    ///
    /// Such directions lie across kinks, except those in a column, and within half a column of the seam.
    fn lost_share(&self, [width, height]: [usize; 2]) -> f64 {
        let rows = self.flattest.len().max(1) as f64;
        let (c_deg, gamma_deg) = (360.0 / width as f64, 180.0 / height as f64);
        let along = self.gamma.iter().map(|bend| lost_part(*bend, gamma_deg)).sum::<f64>();
        let at_own_angles = OWN_ANGLES_SHARE * along / self.gamma.len().max(1) as f64;
        let along = along / self.planes as f64;
        let outside_columns = self.c.iter().filter(|(at, _)| (at / c_deg).fract() != 0.0).flat_map(|(_, bends)| bends);
        let seam = self.flattest.iter().map(|slope| lost_part(2.0 * slope, c_deg)).sum::<f64>();
        let across = outside_columns.map(|bend| lost_part(*bend, c_deg)).sum::<f64>() + seam;
        at_own_angles + along / height as f64 + across / rows / width as f64
    }
}

/// Returns the part of a texel across a kink in which the error is larger than wanted.
fn lost_part(bend: f64, texel_deg: f64) -> f64 {
    // A straight line across a kink has an error of a quarter of the kink times the texel's length.
    1.0 - (WANTED_ERROR / (0.25 * bend * texel_deg)).min(1.0)
}

/// Returns the largest of non-negative values.
fn largest(values: &[f64]) -> f64 {
    values.iter().copied().fold(0.0, f64::max)
}

/// Returns the changes of slope along gamma, per degree, in parts of the intensity there. Beyond its ends a table is dark.
fn bends(angles: &[f64], values: &[f64], dim: f64) -> Vec<f64> {
    let (first, last) = (angles[0], angles[angles.len() - 1]);
    let (mut angles, mut values) = (angles.to_vec(), values.to_vec());
    if first > 0.0 {
        angles.splice(0..0, [first - 2.0, first - 1.0]);
        values.splice(0..0, [0.0, 0.0]);
    }
    if last < 180.0 {
        angles.extend([last + 1.0, last + 2.0]);
        values.extend([0.0, 0.0]);
    }
    let slopes = slopes(&angles, &values);
    slopes.windows(2).zip(&values[1..]).map(|(s, value)| (s[1] - s[0]).abs() / value.max(dim)).collect()
}

/// Returns the slopes between neighbouring angles.
fn slopes(angles: &[f64], values: &[f64]) -> Vec<f64> {
    (0..angles.len().saturating_sub(1)).map(|k| (values[k + 1] - values[k]) / (angles[k + 1] - angles[k])).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::{axial_uplight, by_night, lambertian, lopsided, quadrant, random_table};
    use crate::patches::tests::is_the_table_but_for_little;

    #[test]
    fn what_luxcore_looks_up_is_the_table_but_for_little() {
        for distribution in [axial_uplight(), lopsided(), quadrant(), lambertian()] {
            let map = Map::of(&distribution);
            is_the_table_but_for_little(&map);
            assert!(map.misled_share() < 1e-4, "{}", map.misled_share());
            let flux = distribution.flux().value();
            assert!((map.flux_lm() / flux - 1.0).abs() < 1e-4, "{} {flux}", map.flux_lm());
        }
    }

    #[test]
    fn dark_texels_are_faint_as_far_as_a_cell_reaches_and_dark_beyond() {
        let (c, gamma) = (vec![0.0, 10.0, 20.0, 180.0, 340.0, 350.0, 360.0], vec![0.0, 89.0, 90.0, 91.0, 180.0]);
        let nodes = (0..c.len()).cartesian_product(0..gamma.len());
        let candela = nodes.map(|(c, g)| if [0, 6].contains(&c) && g == 2 { 1000.0 } else { 0.0 }).collect();
        let map = Map::of(&LuminousIntensityDistribution::new(c, gamma, candela).unwrap());
        for (c, gamma) in [(0.0, 91.3), (0.0, 88.6), (10.5, 90.0), (349.3, 90.0), (5.0, 91.4), (10.6, 91.4)] {
            let cd = map.intensity_cd(c, gamma);
            assert!(cd > 0.0 && cd < 1e-5, "{cd} at {c}, {gamma}");
        }
        for (c, gamma) in [(0.0, 93.0), (0.0, 87.0), (14.0, 90.0), (346.0, 90.0), (180.0, 90.0)] {
            assert_eq!(map.intensity_cd(c, gamma), 0.0, "{c}, {gamma}");
        }
    }

    #[test]
    fn any_table_is_a_map_of_bounded_size_that_keeps_most_of_its_flux() {
        let mut random = fastrand::Rng::with_seed(4);
        for _ in 0..by_night(10, 4) {
            let distribution = random_table(&mut random);
            let map = Map::of(&distribution);
            assert!(map.texels.len() <= MAX_TEXELS && map.misled_share() < 0.01);
            let file = map.file("a");
            assert_eq!(
                file.bytes.len(),
                format!("Pf\n{} {}\n-1.0\n", map.width, map.height).len() + 4 * map.texels.len()
            );
        }
    }
}
