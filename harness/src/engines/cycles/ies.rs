//! Tables as Cycles' IES texture looks them up: with values between the table's cells where nobody looks, so that its cubic curves are our straight lines.
//!
//! Between angles Cycles lays a cubic through four neighbours by their numbers (`kernel/util/ies.h`), whatever the angles between them: straight
//! where the neighbours' values are in line. So every cell of a table is divided into steps and has neighbours of its own, in line with its ends,
//! and where two cells meet those lie within a hair's breadth, a hair beside the angle itself. Beyond the first plane and the last one Cycles takes
//! all for dark, and it is dark at the last angle itself: planes begin and end with cells of a hair's breadth, turned away from C 0, and a row lies
//! behind gamma 180. What is left is computed and stated, never taken off.

use itertools::Itertools;
use luminaire::photometry::LuminousIntensityDistribution;

use crate::engines::patches::ies_file;
use crate::engines::patches::resampled::{Resampled, Spread};

/// Between neighbours where two cells meet, in degrees: as narrow as 32-bit floats tell apart.
const HAIR_DEG: f64 = 1e-4;
/// So far beyond its end a row of cells goes on, in degrees: further than a patch is wide, seen from a luminaire.
const ROW_BESIDE_DEG: f64 = 5e-3;
/// And a plane, which near the poles is wider.
const PLANE_BESIDE_DEG: f64 = SEAM_DEG - 3.0 * HAIR_DEG;
/// Beyond a table's range a direction that is so near counts as its last angle.
pub(super) const EDGE_DEG: f64 = ROW_BESIDE_DEG + 3.0 * HAIR_DEG;
/// How far planes are turned (`SEAM_DEG` of `cycles_scene.py`), so that no direction that anyone asks for lies where they begin.
const SEAM_DEG: f64 = 0.03;
/// The row behind gamma 180, and the one beside nadir. Nothing is looked up between the latter and nadir: an arc cosine of 32-bit floats is 0 or
/// .0198 degrees at least.
const BEHIND_DEG: f64 = 180.5;
const NADIR_DEG: f64 = 1e-2;
/// Into so many steps a cell is divided, as many as make a file of no more than so many values: what is off where cells meet is a few
/// of these, not of cells.
const STEPS: [usize; 2] = [4, 16];
const VALUES: usize = 40_000;
/// Over so many points of its patch a meter is read (`EXACT_SIDE` of `cycles_read.py`, squared).
const POINTS: f64 = 256.0;
/// On so many lines of 32-bit coordinates across the patch they lie, at least (`PATCH`).
const LINES: f64 = 40.0;

/// Where in a piece it is looked at for what is off most.
const PARTS: [f64; 4] = [0.05, 0.35, 0.65, 0.95];

/// A straight piece of a table along one of its angles, and up to where it is handed over.
#[derive(Clone, Copy, Debug)]
struct Cell {
    /// Where the table knows it, in degrees.
    own: [f64; 2],
    /// Whether it is the darkness below or above a table's range.
    is_dark: bool,
    handed: [f64; 2],
}

/// A row or a plane: part of the value at one end of a cell, and of that at the other.
#[derive(Clone, Copy, Debug)]
struct Node {
    deg: f64,
    cell: Cell,
    weights: [f64; 2],
}

impl Cell {
    /// The nodes of its steps, and their neighbours in line with them.
    fn nodes(self, count: usize, [before, after]: [f64; 2]) -> impl Iterator<Item = Node> {
        let [low, high] = self.handed;
        let step = (high - low) / count as f64;
        let steps = (0..count).map(move |k| low + step * k as f64).chain([high]).map(|at| (at, at));
        // Neighbours count one step, wherever they lie.
        let all = [(before, low - step)].into_iter().chain(steps).chain([(after, high + step)]);
        all.map(move |(deg, at)| self.node(deg, at))
    }

    /// With the value that its line has at an angle.
    fn node(self, deg: f64, at: f64) -> Node {
        let part = (at - self.own[0]) / (self.own[1] - self.own[0]);
        Node { deg, cell: self, weights: if self.is_dark { [0.0; 2] } else { [1.0 - part, part] } }
    }
}

impl Node {
    fn value(&self, of: impl Fn(f64) -> f64) -> f64 {
        // Angles where nothing is taken may lie outside the table.
        let part = |k: usize| if self.weights[k] == 0.0 { 0.0 } else { self.weights[k] * of(self.cell.own[k]) };
        part(0) + part(1)
    }
}

/// A table as it is handed over, with the look-up of Cycles.
pub(super) struct LookedUp {
    of: LuminousIntensityDistribution,
    /// Angles of planes as Cycles has them: C and `SEAM_DEG`.
    h_deg: Vec<f64>,
    v_deg: Vec<f64>,
    /// Plane by plane.
    candela: Vec<Vec<f64>>,
    /// Between the angles of either table, of which most are straight.
    pieces: [Pieces; 2],
}

/// Intervals of an angle, in order.
struct Pieces(Vec<[f64; 2]>);

impl Pieces {
    fn between(nodes: &[f64], own: impl Iterator<Item = f64>, last: f64) -> Self {
        let mut all: Vec<f64> = nodes.iter().copied().chain(own).filter(|a| (0.0..=last).contains(a)).collect();
        all.sort_by(f64::total_cmp);
        all.dedup();
        Self(all.windows(2).map(|ends| [ends[0], ends[1]]).collect())
    }

    /// Those parts of a window that lie in one piece each.
    fn within(&self, [low, high]: [f64; 2]) -> impl Iterator<Item = [f64; 2]> {
        let first = self.0.partition_point(move |[_, end]| *end <= low);
        let inside = self.0[first..].iter().take_while(move |[begin, _]| *begin < high);
        inside.map(move |[begin, end]| [begin.max(low), end.min(high)])
    }
}

impl LookedUp {
    pub(super) fn of(distribution: &LuminousIntensityDistribution) -> Self {
        let c_deg = planes_deg(distribution);
        let steps = steps(c_deg.len() * distribution.gamma_deg().len());
        let (v, h) = (rows(distribution.gamma_deg(), steps), planes(&c_deg, steps));
        let along_gamma = |c: f64, v: &Node| v.value(|gamma| distribution.intensity(c, gamma).value());
        let candela = h.iter().map(|h| v.iter().map(|v| h.value(|c| along_gamma(c, v))).collect()).collect();
        let degrees = |nodes: Vec<Node>| nodes.into_iter().map(|n| n.deg).collect::<Vec<f64>>();
        let (h_deg, v_deg) = (degrees(h), degrees(v));
        let along_c = Pieces::between(&h_deg, c_deg.iter().map(|c| c + SEAM_DEG), 360.0);
        let along_gamma = Pieces::between(&v_deg, distribution.gamma_deg().iter().copied(), 180.0);
        Self { of: distribution.clone(), h_deg, v_deg, candela, pieces: [along_c, along_gamma] }
    }

    /// As an LM-63 file.
    pub(super) fn file(&self, about: &str) -> String {
        let keywords = ["[MANUFAC] luxproof", about, &format!("[MORE] planes are turned by {SEAM_DEG} degrees")];
        ies_file::text(&keywords, &self.v_deg, &self.h_deg, self.candela.iter().map(Vec::as_slice))
    }
}

impl Resampled for LookedUp {
    fn table(&self) -> &LuminousIntensityDistribution {
        &self.of
    }

    fn intensity_cd(&self, c_deg: f64, gamma_deg: f64) -> f64 {
        let h = (c_deg + SEAM_DEG).rem_euclid(360.0);
        let (Some((k, x)), Some((j, y))) = (cell(&self.h_deg, h), cell(&self.v_deg, gamma_deg)) else { return 0.0 };
        let along_gamma = |plane: &Vec<f64>| {
            // Beyond nadir it takes the other side for the same.
            let before = if j == 0 { plane[1] } else { plane[j - 1] };
            cubic([before, plane[j], plane[j + 1], plane.get(j + 2).copied().unwrap_or(0.0)], y)
        };
        let of = |k: Option<usize>| k.and_then(|k| self.candela.get(k)).map_or(0.0, along_gamma);
        cubic([of(k.checked_sub(1)), of(Some(k)), of(Some(k + 1)), of(Some(k + 2))], x).max(0.0)
    }

    fn off_about_cd(&self, c_deg: f64, gamma_deg: f64, spread: Spread) -> f64 {
        let [by_c, by_gamma] = [spread.reach_deg[0].clamp(1e-9, 180.0), spread.reach_deg[1].max(1e-9)];
        // No more of a patch than this sees a piece so wide, wherever the patch lies.
        let share = |of: usize, [begin, end]: [f64; 2]| {
            let patch = spread.patch_deg[of];
            if end - begin < patch { (end - begin) / patch } else { 1.0 }
        };
        let largest_cd = |columns: [f64; 2], rows: [f64; 2]| {
            let at = |[begin, end]: [f64; 2], part: f64| begin + part * (end - begin);
            let all = PARTS.into_iter().cartesian_product(PARTS);
            all.map(|(x, y)| self.off_cd(at(columns, x) - SEAM_DEG, at(rows, y))).fold(0.0, f64::max)
        };
        let h = (c_deg + SEAM_DEG).rem_euclid(360.0);
        let (rows, columns) = (
            [(gamma_deg - by_gamma).max(NADIR_DEG), (gamma_deg + by_gamma).clamp(2.0 * NADIR_DEG, 180.0)],
            [h - by_c, h + by_c],
        );
        let rows: Vec<_> = self.pieces[1].within(rows).collect();
        // All that a patch sees of a column is no more than its share, nor of a row, nor of where they cross than that of either.
        let (mut of_columns, mut of_both, mut of_row) = (0.0, 0.0, vec![0.0_f64; rows.len()]);
        // A window over the seam is two.
        for columns in [-360.0, 0.0, 360.0].map(|turn| columns.map(|h| h + turn)) {
            for column in self.pieces[0].within(columns) {
                let mut of_column = 0.0_f64;
                for (row, of_row) in rows.iter().zip(&mut of_row) {
                    let off = largest_cd(column, *row);
                    (of_column, *of_row) = (of_column.max(off), of_row.max(off));
                    of_both += share(0, column).min(share(1, *row)) * off;
                }
                of_columns += share(0, column) * of_column;
            }
        }
        let of_rows: f64 = rows.iter().zip(&of_row).map(|(row, off)| share(1, *row) * off).sum();
        let worst = of_row.into_iter().fold(0.0, f64::max);
        // One line of points may lie in what is narrow; about a pole, where that is no straight line, one point.
        let one = if by_c < 90.0 { LINES } else { POINTS };
        // What evenly spread points would see, and that; three times, for angles are rounded and points are not spread evenly.
        3.0 * (of_columns.min(of_rows).min(of_both) + worst / one)
    }

    /// From the middle of every piece: those where cells meet are too narrow for any grid.
    fn misled_share(&self) -> f64 {
        let (mut off, mut all) = (0.0, f64::MIN_POSITIVE);
        let middle = |[begin, end]: [f64; 2]| (0.5 * (begin + end), end - begin);
        for (gamma, high) in self.pieces[1].within([0.0, 180.0]).map(middle) {
            for (h, wide) in self.pieces[0].within([0.0, 360.0]).map(middle) {
                let weight = wide * high * gamma.to_radians().sin();
                off += weight * self.off_cd(h - SEAM_DEG, gamma);
                all += weight * self.of.intensity(h - SEAM_DEG, gamma).value();
            }
        }
        off / all
    }
}

/// Into how many steps cells are divided, of so many.
fn steps(cells: usize) -> usize {
    let most = (VALUES as f64 / cells as f64).sqrt() as usize;
    // A cell has three nodes more.
    most.saturating_sub(3).clamp(STEPS[0], STEPS[1])
}

/// The table's planes over the full circle, but for those that lie where planes end.
fn planes_deg(distribution: &LuminousIntensityDistribution) -> Vec<f64> {
    let at_end = 360.0 - 10.0 * SEAM_DEG;
    distribution.full_circle().c_deg().iter().copied().filter(|c| *c <= at_end || *c == 360.0).collect()
}

/// Rows from nadir to what lies behind the zenith.
fn rows(gamma_deg: &[f64], steps: usize) -> Vec<Node> {
    let ends = [gamma_deg[0], gamma_deg[gamma_deg.len() - 1]];
    let mut cells = cells(gamma_deg);
    let dark = |own: [f64; 2]| (own[0] < own[1]).then_some(Cell { own, is_dark: true, handed: own });
    cells.splice(0..0, dark([0.0, ends[0]]));
    cells.extend(dark([ends[1], 180.0]));
    let nadir = NADIR_DEG.min(cells[0].own[1] / 8.0);
    cells[0].handed[0] = nadir;
    let nodes = joined(cells, steps, ROW_BESIDE_DEG, [nadir / 2.0, BEHIND_DEG]);
    [nodes[0].cell.node(0.0, 0.0)].into_iter().chain(nodes).collect()
}

/// Planes of the full circle, turned.
fn planes(c_deg: &[f64], steps: usize) -> Vec<Node> {
    let mut cells = cells(c_deg);
    let last = cells.len() - 1;
    let (begin, end) = (-SEAM_DEG, 360.0 - SEAM_DEG);
    (cells[0].handed[0], cells[last].handed[1]) = (begin + 3.0 * HAIR_DEG, end - 3.0 * HAIR_DEG);
    let nodes = joined(cells, steps, PLANE_BESIDE_DEG, [begin + 2.0 * HAIR_DEG, end - 2.0 * HAIR_DEG]);
    let (first, behind) = (nodes[0].cell, nodes[nodes.len() - 1].cell);
    let begins = [begin, begin + HAIR_DEG].map(|c| first.node(c, first.handed[0]));
    let ends = [end - HAIR_DEG, end].map(|c| behind.node(c, behind.handed[1]));
    let turned = |node: Node| Node { deg: node.deg + SEAM_DEG, ..node };
    begins.into_iter().chain(nodes).chain(ends).map(turned).collect()
}

fn cells(angles: &[f64]) -> Vec<Cell> {
    angles.windows(2).map(|ends| Cell { own: [ends[0], ends[1]], is_dark: false, handed: [ends[0], ends[1]] }).collect()
}

/// The nodes of cells of which each begins where the one before ends, between neighbours at two angles.
fn joined(mut cells: Vec<Cell>, steps: usize, beside_deg: f64, ends: [f64; 2]) -> Vec<Node> {
    let mut neighbours = vec![ends; cells.len()];
    for k in 1..cells.len() {
        let at = cells[k].own[0];
        // Beside light the dark side gives way, else the one behind; a narrow cell gives no more than a quarter.
        let into_before = cells[k - 1].is_dark;
        let gives = cells[if into_before { k - 1 } else { k }].own;
        let scale = ((gives[1] - gives[0]) / (4.0 * (beside_deg + 3.0 * HAIR_DEG))).min(1.0);
        let step = |n: f64| (beside_deg + n * HAIR_DEG) * scale;
        let place = |n: f64| if into_before { at - step(3.0 - n) } else { at + step(n) };
        (cells[k - 1].handed[1], neighbours[k - 1][1]) = (place(0.0), place(1.0));
        (neighbours[k][0], cells[k].handed[0]) = (place(2.0), place(3.0));
    }
    cells.into_iter().zip(neighbours).flat_map(|(cell, beside)| cell.nodes(steps, beside)).collect()
}

/// The cell that an angle lies in, and where in it; the last angle lies in none.
fn cell(angles: &[f64], angle: f64) -> Option<(usize, f64)> {
    let after = angles.partition_point(|a| *a <= angle);
    let k = after.checked_sub(1).filter(|_| after < angles.len())?;
    Some((k, (angle - angles[k]) / (angles[k + 1] - angles[k])))
}

/// Cycles' cubic (Catmull & Rom 1974) between the second and the third of four values.
fn cubic([a, b, c, d]: [f64; 4], x: f64) -> f64 {
    0.5 * (((d + 3.0 * (b - c) - a) * x + (2.0 * a - 5.0 * b + 4.0 * c - d)) * x + (c - a)) * x + b
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::engines::fixtures::{axial_uplight, lambertian, lopsided, quadrant, random_table};
    use crate::engines::patches::tests::is_the_table_but_for_little;

    #[test]
    fn the_drivers_turn_planes_and_sample_patches_as_is_counted_on() {
        let (scene, read) =
            (include_str!("../../../drivers/cycles_scene.py"), include_str!("../../../drivers/cycles_read.py"));
        assert!(scene.contains(&format!("\nSEAM_DEG = {SEAM_DEG} ")));
        assert!(read.contains(&format!("\nEXACT_SIDE = {} ", POINTS.sqrt())));
    }

    #[test]
    fn what_cycles_looks_up_is_the_table_but_for_little() {
        for distribution in [axial_uplight(), lopsided(), quadrant(), lambertian()] {
            is_the_table_but_for_little(&LookedUp::of(&distribution));
        }
    }

    #[test]
    fn what_cycles_looks_up_is_the_table_but_where_cells_meet() {
        let mut random = fastrand::Rng::with_seed(5);
        let known = [axial_uplight(), lopsided(), quadrant(), lambertian()];
        for distribution in known.into_iter().chain((0..8).map(|_| random_table(&mut random))) {
            let table = LookedUp::of(&distribution);
            let largest = distribution.max_intensity().value();
            let at = |c, gamma| (table.intensity_cd(c, gamma) - distribution.intensity(c, gamma).value()).abs();
            for k in (0..360).step_by(5) {
                for j in 0..=180 {
                    // At the table's own angles, and as far beside them as 32-bit floats may miss them.
                    for beside in [0.0, 1e-5, -1e-5] {
                        let (c, gamma) = (f64::from(k) + beside, (f64::from(j) + beside).clamp(0.0, 180.0));
                        let meet = |angles: &[f64], at: f64| angles.iter().any(|a| a + 1e-4 < at && at < a + 0.04);
                        let at_end = distribution.gamma_deg().iter().any(|g| (g - gamma).abs() < 1e-4);
                        let (off, edge) = (at(c, gamma), largest * beside.abs());
                        let is_known =
                            at_end || meet(distribution.gamma_deg(), gamma) || meet(&planes_deg(&distribution), c);
                        assert!(off < 1e-12 * largest + edge || is_known, "{off} of {largest} at C {c}, gamma {gamma}");
                    }
                }
            }
            assert!(table.misled_share() < 3e-4, "{}", table.misled_share());
        }
    }

    #[test]
    fn any_table_is_a_file_of_bounded_size() {
        let mut random = fastrand::Rng::with_seed(4);
        for _ in 0..20 {
            let table = LookedUp::of(&random_table(&mut random));
            let (c, gamma) = (planes_deg(&table.of).len(), table.of.gamma_deg().len());
            let nodes = steps(c * gamma) + 3;
            assert!(table.h_deg.len() <= nodes * c + 4 && table.v_deg.len() <= nodes * (gamma + 1) + 1);
            assert!(table.misled_share() < 0.01);
            assert!(table.h_deg.windows(2).chain(table.v_deg.windows(2)).all(|ends| ends[0] < ends[1]));
            assert_eq!((table.h_deg[0], table.v_deg[0], table.h_deg.last()), (0.0, 0.0, Some(&360.0)));
        }
    }
}
