//! Tables as maps of directions, which LuxCore looks up straight between the middles of texels and normalises.
//!
//! An emission map spans azimuth and polar angle (`slg/core/sphericalfunction/sphericalfunction.cpp`). Columns lie at whole multiples of
//! their width, for which its axes are turned by half a column, so that planes of most files keep their place. What texels bend, first at
//! kinks and at the ends of a table, is computed and stated, never taken off.
//!
//! Directions are drawn from a grid of cells, each as likely as its middle is bright, and what is never drawn is dark for meters, too
//! (`funcPdf == 0` in `MapPointLight::Illuminate`, 2.11: a cell of .7 degrees that begins to shine past its middle reads 0). So texels
//! beside light are never quite dark.

use itertools::Itertools;
use luminaire::photometry::{LuminousIntensityDistribution, Symmetry};

use crate::engines::SceneFile;
use crate::engines::patches::resampled::Resampled;

/// What straight lines between texels may be off, in parts of the intensity there.
const WANTED: f64 = 5e-5;
/// Where it is darker than this part of the largest intensity, in parts of so much.
const DIM: f64 = 1e-2;
/// The share of directions in which they may be off by more.
const LOST: f64 = 1e-4;
/// So much of all directions a table's own angles count as: intensities are read there, too.
const OWN: f64 = 0.01;
const HEIGHTS: [usize; 7] = [512, 1024, 2048, 4096, 8192, 16384, 32768];
const WIDTHS: [usize; 5] = [360, 720, 1440, 2880, 5760];
/// Texels at most, 24 MB of them.
const TEXELS: usize = 1440 * 4096;
/// Columns of an axial table.
const AXIAL: usize = 8;
/// The grid that LuxCore takes a map's mean over, and draws directions from.
const CELLS: [usize; 2] = [512, 256];
/// What dark texels beside light get, in parts of the largest intensity.
const FAINT: f64 = 1e-9;
/// What its 131,072 sums in 32-bit floats leave of that mean that is not foreseen here.
const MEAN_OFF: f64 = 5e-6;

pub(super) struct Map {
    of: LuminousIntensityDistribution,
    width: usize,
    height: usize,
    /// Where its columns begin, in degrees of C: behind that it is not closed.
    first_deg: f64,
    /// Row by row, the zenith's first.
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
        let mut map = Self { of: distribution.clone(), width, height, first_deg, texels };
        map.light_up((FAINT * largest) as f32);
        map
    }

    /// Dark texels as far from light as one of LuxCore's cells reaches become faint.
    fn light_up(&mut self, faint: f32) {
        let (width, height) = (self.width, self.height);
        let [across, along] = [width.div_ceil(CELLS[0]) + 1, height.div_ceil(CELLS[1]) + 1];
        let lit: Vec<bool> = self.texels.iter().map(|texel| *texel > 0.0).collect();
        if lit.iter().all(|is| *is) {
            return;
        }
        let mut near = lit.clone();
        for x in 0..width {
            spread(&lit, &mut near, x, [width, height], along, false);
        }
        let lit = near.clone();
        for y in 0..height {
            spread(&lit, &mut near, y * width, [1, width], across, true);
        }
        for (texel, _) in self.texels.iter_mut().zip(near).filter(|(texel, is_near)| **texel == 0.0 && *is_near) {
            *texel = faint;
        }
    }

    /// How far its axes are turned about the luminaire's own, so that columns lie in planes.
    pub(super) fn turned_deg(&self) -> f64 {
        self.first_deg - 180.0 / self.width as f64
    }

    /// As a portable float map, the lowest row first.
    pub(super) fn file(&self, name: &str) -> SceneFile {
        let mut bytes = format!("Pf\n{} {}\n-1.0\n", self.width, self.height).into_bytes();
        for row in self.texels.chunks(self.width).rev() {
            bytes.extend(row.iter().flat_map(|texel| texel.to_le_bytes()));
        }
        SceneFile { name: name.to_owned(), bytes }
    }

    /// The flux that LuxCore divides intensities by: 4 pi times its own mean of the map, a sum in 32-bit floats, one after the other.
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

    /// As LuxCore interpolates, in its floats; `u` and `v` run from 0 to 1.
    fn look_up(&self, u: f32, v: f32) -> f32 {
        let (s, t) = (u * self.width as f32 - 0.5, v * self.height as f32 - 0.5);
        let (left, ds) = (s.floor(), s - s.floor());
        let (above, dt) = (t.floor(), t - t.floor());
        let clamped = |i: f32, count: usize| (i.max(0.0) as usize).min(count - 1);
        let at = |y: f32, x: f32| self.texels[clamped(y, self.height) * self.width + clamped(x, self.width)];
        let (ids, idt) = (1.0 - ds, 1.0 - dt);
        ids * idt * at(above, left)
            + ids * dt * at(above + 1.0, left)
            + ds * idt * at(above, left + 1.0)
            + ds * dt * at(above + 1.0, left + 1.0)
    }
}

impl Resampled for Map {
    fn table(&self) -> &LuminousIntensityDistribution {
        &self.of
    }

    fn intensity_cd(&self, c_deg: f64, gamma_deg: f64) -> f64 {
        let u = (c_deg - self.turned_deg()).rem_euclid(360.0) / 360.0;
        f64::from(self.look_up(u as f32, (1.0 - gamma_deg / 180.0) as f32))
    }

    fn off_cd(&self, c_deg: f64, gamma_deg: f64) -> f64 {
        let right = self.of.intensity(c_deg, gamma_deg).value();
        let read = self.intensity_cd(c_deg, gamma_deg);
        (read - right).abs() + MEAN_OFF * read.max(right)
    }
}

/// What lies on one line of texels within reach of a lit one is near, too; `along` is the step from one to the next, and how many there are.
fn spread(lit: &[bool], near: &mut [bool], first: usize, along: [usize; 2], reach: usize, closes: bool) {
    let [step, count] = along;
    let at = |k: usize| first + step * (k % count);
    let rounds = if closes { count + reach } else { count };
    for order in [false, true] {
        let mut since = usize::MAX;
        for k in 0..rounds {
            let place = at(if order { rounds - 1 - k } else { k });
            since = if lit[place] { 0 } else { since.saturating_add(1) };
            near[place] |= since <= reach;
        }
    }
}

/// Where a table bends, a degree, in parts of the intensity there.
struct Kinks {
    /// Along gamma, of all planes alike.
    gamma: Vec<f64>,
    planes: usize,
    /// Across planes, gamma by gamma, and where these lie.
    c: Vec<(f64, Vec<f64>)>,
    /// Slopes between the two planes between which it is flattest, gamma by gamma.
    flattest: Vec<f64>,
    /// The middle between them.
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
        let between = |c: usize| -> Vec<f64> {
            slopes.iter().zip(&rows).map(|(s, row)| s[c].abs() / row[c].min(row[c + 1]).max(dim)).collect()
        };
        let between: Vec<Vec<f64>> = (0..c_deg.len().saturating_sub(1)).map(between).collect();
        let largest = |c: &usize| between[*c].iter().copied().fold(0.0, f64::max);
        let flattest = (0..between.len()).min_by(|a, b| largest(a).total_cmp(&largest(b)));
        let at = |c: usize| -> (f64, Vec<f64>) {
            let bends = slopes.iter().zip(&rows).map(|(s, row)| (s[c] - s[c - 1]).abs() / row[c].max(dim));
            (c_deg[c], bends.collect())
        };
        Self {
            gamma: planes.iter().flat_map(|plane| bends(gamma_deg, plane, dim)).collect(),
            planes: planes.len(),
            c: (1..between.len()).map(at).collect(),
            flattest_deg: flattest.map_or(0.0, |c| f64::midpoint(c_deg[c], c_deg[c + 1])),
            flattest: flattest.map(|c| between[c].clone()).unwrap_or_default(),
        }
    }

    /// Columns and rows of the smallest map that is off in few directions, else of that which is so in the fewest.
    fn size(&self, symmetry: Symmetry) -> [usize; 2] {
        let widths: &[usize] = if symmetry == Symmetry::Axial { &[AXIAL] } else { &WIDTHS };
        let sizes = widths.iter().flat_map(|w| HEIGHTS.map(|h| [*w, h]));
        let sizes = sizes.filter(|[w, h]| w * h <= TEXELS).sorted_by_key(|[w, h]| w * h);
        let lost = |size: &[usize; 2]| (self.lost(*size) / LOST).max(1.0);
        sizes.min_by(|a, b| lost(a).total_cmp(&lost(b))).unwrap_or([WIDTHS[0], HEIGHTS[0]])
    }

    /// The share of directions in which straight lines between texels are off by more than is wanted: across bends, but for those in a
    /// column, and for half a column on either side of the seam.
    fn lost(&self, [width, height]: [usize; 2]) -> f64 {
        let rows = self.flattest.len().max(1) as f64;
        let (c_deg, gamma_deg) = (360.0 / width as f64, 180.0 / height as f64);
        // Across a bend a straight line a texel long is off by a quarter of it.
        let beyond = |bend: f64, texel_deg: f64| 1.0 - (WANTED / (0.25 * bend * texel_deg)).min(1.0);
        let along = self.gamma.iter().map(|bend| beyond(*bend, gamma_deg)).sum::<f64>();
        let own = OWN * along / self.gamma.len().max(1) as f64;
        let along = along / self.planes as f64;
        let outside = self.c.iter().filter(|(at, _)| (at / c_deg).fract() != 0.0).flat_map(|(_, bends)| bends);
        let seam = self.flattest.iter().map(|slope| beyond(2.0 * slope, c_deg)).sum::<f64>();
        let across = outside.map(|bend| beyond(*bend, c_deg)).sum::<f64>() + seam;
        own + along / height as f64 + across / rows / width as f64
    }
}

/// Changes of slope along gamma, a degree, in parts of the intensity there; beyond a table's ends it is dark.
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

fn slopes(angles: &[f64], values: &[f64]) -> Vec<f64> {
    let slope = |k: usize| (values[k + 1] - values[k]) / (angles[k + 1] - angles[k]);
    (0..angles.len().saturating_sub(1)).map(slope).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::engines::fixtures::{axial_uplight, by_night, lambertian, lopsided, quadrant, random_table};
    use crate::engines::patches::tests::is_the_table_but_for_little;

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
        let lit = |c: usize, g: usize| if [0, 6].contains(&c) && g == 2 { 1000.0 } else { 0.0 };
        let candela = (0..c.len()).flat_map(|c| (0..gamma.len()).map(move |g| lit(c, g))).collect();
        let map = Map::of(&LuminousIntensityDistribution::new(c, gamma, candela).unwrap());
        let at = |c: f64, gamma: f64| map.intensity_cd(c, gamma);
        let faint = |cd: f64| cd > 0.0 && cd < 1e-5;
        for (c, gamma) in [(0.0, 91.3), (0.0, 88.6), (10.5, 90.0), (349.3, 90.0), (5.0, 91.4), (10.6, 91.4)] {
            assert!(faint(at(c, gamma)), "{} at {c}, {gamma}", at(c, gamma));
        }
        for (c, gamma) in [(0.0, 93.0), (0.0, 87.0), (14.0, 90.0), (346.0, 90.0), (180.0, 90.0)] {
            assert_eq!(at(c, gamma), 0.0, "{c}, {gamma}");
        }
    }

    #[test]
    fn any_table_is_a_map_of_bounded_size_that_keeps_most_of_its_flux() {
        let mut random = fastrand::Rng::with_seed(4);
        for _ in 0..by_night(10, 4) {
            let distribution = random_table(&mut random);
            let map = Map::of(&distribution);
            assert!(map.texels.len() <= TEXELS && map.misled_share() < 0.01);
            let file = map.file("a");
            assert_eq!(
                file.bytes.len(),
                format!("Pf\n{} {}\n-1.0\n", map.width, map.height).len() + 4 * map.texels.len()
            );
        }
    }
}
