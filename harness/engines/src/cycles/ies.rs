//! Candela tables resampled for Cycles' IES texture, so that its cubic curves equal our straight lines wherever a meter looks.
//!
//! Cycles interpolates with a cubic through four neighbours by index (`kernel/util/ies.h`), whatever the angles between them. The
//! cubic is straight if the four values are in line. So the writer divides every cell of a table into steps and gives it
//! neighbours in line with its ends. Where two cells meet, these neighbours lie a hair's breadth beside the angle itself.
//!
//! Cycles takes everything beyond the first and the last plane for dark, and the last angle itself, too. So planes begin and end
//! with cells of a hair's breadth, turned away from C 0, and a row lies behind gamma 180. The remaining error is computed and
//! stated, never subtracted.

use itertools::Itertools;
use luxproof_photometry::LuminousIntensityDistribution;

use crate::patches::ies_file;
use crate::patches::resampled::{Resampled, Spread};

/// Width in degrees between neighbours where two cells meet: the least that 32-bit floats resolve.
const HAIR_DEG: f64 = 1e-4;
/// How far a row of cells goes on beyond its end, in degrees: further than the width of a patch, seen from a luminaire.
const ROW_BESIDE_DEG: f64 = 5e-3;
/// The same for a plane, which is wider near the poles.
const PLANE_BESIDE_DEG: f64 = SEAM_DEG - 3.0 * HAIR_DEG;
/// A direction this near beyond a table's range counts as its last angle.
pub(super) const EDGE_DEG: f64 = ROW_BESIDE_DEG + 3.0 * HAIR_DEG;
/// How far planes are turned (`SEAM_DEG` of `cycles_scene.py`), so that no requested direction lies where they begin.
const SEAM_DEG: f64 = 0.03;
/// Angle of the row behind gamma 180.
const BEHIND_DEG: f64 = 180.5;
/// Angle of the row next to nadir. Cycles looks nothing up between it and nadir: its arc cosine is 0 or at least 0.0198 degrees.
const NADIR_DEG: f64 = 1e-2;
/// Fewest and most steps of a cell. The error where cells meet covers a few steps, not a few cells.
const STEPS: [usize; 2] = [4, 16];
/// Largest number of values of a file, which limits the steps.
const MAX_VALUES: usize = 40_000;
/// Number of points of its patch over which a meter is read (`EXACT_SIDE` of `cycles_read.py`, squared).
const POINTS: f64 = 256.0;
/// Fewest lines of 32-bit coordinates across the patch on which they lie (`PATCH`).
const LINES: f64 = 40.0;

/// Relative positions in a piece at which its largest error is sought.
const PROBE_PARTS: [f64; 4] = [0.05, 0.35, 0.65, 0.95];

/// A straight piece of a table along one of its angles.
#[derive(Clone, Copy, Debug)]
struct Cell {
    /// Ends of the cell in the table, in degrees.
    own: [f64; 2],
    /// Whether it is the darkness below or above a table's range.
    is_dark: bool,
    /// Ends of the cell in the file, in degrees.
    handed: [f64; 2],
}

/// A row or a plane of the file: a weighted sum of the values at both ends of a cell.
#[derive(Clone, Copy, Debug)]
struct Node {
    deg: f64,
    cell: Cell,
    weights: [f64; 2],
}

impl Cell {
    /// Returns the nodes of the cell's steps, and one neighbour in line with them at each end.
    fn nodes(self, count: usize, [before, after]: [f64; 2]) -> impl Iterator<Item = Node> {
        let [low, high] = self.handed;
        let step = (high - low) / count as f64;
        let steps = (0..count).map(move |k| low + step * k as f64).chain([high]).map(|at| (at, at));
        // Cycles interpolates by index, so a neighbour counts as one step away, wherever it lies.
        let all = [(before, low - step)].into_iter().chain(steps).chain([(after, high + step)]);
        all.map(move |(deg, at)| self.node(deg, at))
    }

    /// Returns a node at `deg` with the value that the cell's line has at `at`.
    fn node(self, deg: f64, at: f64) -> Node {
        let part = (at - self.own[0]) / (self.own[1] - self.own[0]);
        Node { deg, cell: self, weights: if self.is_dark { [0.0; 2] } else { [1.0 - part, part] } }
    }
}

impl Node {
    /// Returns the node's value, from the table's value at an angle.
    fn value(&self, table_value: impl Fn(f64) -> f64) -> f64 {
        self.weighted_end(0, &table_value) + self.weighted_end(1, &table_value)
    }

    fn weighted_end(&self, k: usize, table_value: impl Fn(f64) -> f64) -> f64 {
        // An end without weight may lie outside the table.
        if self.weights[k] == 0.0 { 0.0 } else { self.weights[k] * table_value(self.cell.own[k]) }
    }
}

/// A resampled table with the look-up of Cycles.
pub(super) struct LookedUp {
    original: LuminousIntensityDistribution,
    /// Angles of planes in the file: C plus `SEAM_DEG`.
    h_deg: Vec<f64>,
    v_deg: Vec<f64>,
    /// Values by plane, then by row.
    candela: Vec<Vec<f64>>,
    /// Intervals between the angles of either table, along C and gamma. Most of them are straight.
    pieces: [Pieces; 2],
}

/// Intervals of an angle in ascending order.
struct Pieces(Vec<[f64; 2]>);

impl Pieces {
    fn between(nodes: &[f64], own: impl Iterator<Item = f64>, last: f64) -> Self {
        let mut all: Vec<f64> = nodes.iter().copied().chain(own).filter(|a| (0.0..=last).contains(a)).collect();
        all.sort_by(f64::total_cmp);
        all.dedup();
        Self(all.windows(2).map(|ends| [ends[0], ends[1]]).collect())
    }

    /// Divides a window into parts that lie in one piece each.
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
        let table_value = |h: &Node, v: &Node| h.value(|c| v.value(|gamma| distribution.intensity(c, gamma).value()));
        let candela = h.iter().map(|h| v.iter().map(|v| table_value(h, v)).collect()).collect();
        let h_deg: Vec<f64> = h.into_iter().map(|node| node.deg).collect();
        let v_deg: Vec<f64> = v.into_iter().map(|node| node.deg).collect();
        let along_c = Pieces::between(&h_deg, c_deg.iter().map(|c| c + SEAM_DEG), 360.0);
        let along_gamma = Pieces::between(&v_deg, distribution.gamma_deg().iter().copied(), 180.0);
        Self { original: distribution.clone(), h_deg, v_deg, candela, pieces: [along_c, along_gamma] }
    }

    /// Writes the resampled table as an LM-63 file.
    pub(super) fn file(&self, about: &str) -> String {
        let keywords = ["[MANUFAC] luxproof", about, &format!("[MORE] planes are turned by {SEAM_DEG} degrees")];
        ies_file::text(&keywords, &self.v_deg, &self.h_deg, self.candela.iter().map(Vec::as_slice))
    }
}

impl LookedUp {
    /// Returns the value of a plane of the file between rows `j` and `j + 1`, at the part `y`; 0 if there is no such plane.
    fn along_gamma_cd(&self, plane: Option<usize>, j: usize, y: f64) -> f64 {
        let Some(plane) = plane.and_then(|k| self.candela.get(k)) else { return 0.0 };
        // Beyond nadir Cycles takes the other side to have the same values.
        let before = if j == 0 { plane[1] } else { plane[j - 1] };
        cubic([before, plane[j], plane[j + 1], plane.get(j + 2).copied().unwrap_or(0.0)], y)
    }

    /// Returns the largest error found in the rectangle of a column and a row of pieces.
    fn largest_error_cd(&self, column: [f64; 2], row: [f64; 2]) -> f64 {
        PROBE_PARTS
            .into_iter()
            .cartesian_product(PROBE_PARTS)
            .map(|(x, y)| self.off_cd(interpolate(column, x) - SEAM_DEG, interpolate(row, y)))
            .fold(0.0, f64::max)
    }
}

impl Resampled for LookedUp {
    fn table(&self) -> &LuminousIntensityDistribution {
        &self.original
    }

    fn intensity_cd(&self, c_deg: f64, gamma_deg: f64) -> f64 {
        let h = (c_deg + SEAM_DEG).rem_euclid(360.0);
        let (Some((k, x)), Some((j, y))) = (cell(&self.h_deg, h), cell(&self.v_deg, gamma_deg)) else { return 0.0 };
        let planes = [k.checked_sub(1), Some(k), Some(k + 1), Some(k + 2)];
        cubic(planes.map(|plane| self.along_gamma_cd(plane, j, y)), x).max(0.0)
    }

    fn off_about_cd(&self, c_deg: f64, gamma_deg: f64, spread: Spread) -> f64 {
        let [by_c, by_gamma] = [spread.reach_deg[0].clamp(1e-9, 180.0), spread.reach_deg[1].max(1e-9)];
        let h = (c_deg + SEAM_DEG).rem_euclid(360.0);
        let row_window = [(gamma_deg - by_gamma).max(NADIR_DEG), (gamma_deg + by_gamma).clamp(2.0 * NADIR_DEG, 180.0)];
        let column_window = [h - by_c, h + by_c];
        let rows: Vec<_> = self.pieces[1].within(row_window).collect();
        // A column bounds the part of a patch that sees it, and so does a row. The smaller of both bounds where they cross.
        let (mut by_columns, mut by_crossings, mut row_errors) = (0.0, 0.0, vec![0.0_f64; rows.len()]);
        // A window over the seam has parts at both ends of the file.
        for window in [-360.0, 0.0, 360.0].map(|turn| column_window.map(|h| h + turn)) {
            for column in self.pieces[0].within(window) {
                let column_share = patch_share(column, spread.patch_deg[0]);
                let mut column_error = 0.0_f64;
                for (row, row_error) in rows.iter().zip(&mut row_errors) {
                    let error = self.largest_error_cd(column, *row);
                    column_error = column_error.max(error);
                    *row_error = row_error.max(error);
                    by_crossings += column_share.min(patch_share(*row, spread.patch_deg[1])) * error;
                }
                by_columns += column_share * column_error;
            }
        }
        let by_rows: f64 =
            rows.iter().zip(&row_errors).map(|(row, error)| patch_share(*row, spread.patch_deg[1]) * error).sum();
        let worst = row_errors.into_iter().fold(0.0, f64::max);
        // One line of points may lie in a narrow piece. About a pole such a piece is no straight line, so only one point may.
        let aligned_points = if by_c < 90.0 { LINES } else { POINTS };
        // The first term holds for evenly spread points. The factor 3 covers rounded angles and points that are not evenly spread.
        3.0 * (by_columns.min(by_rows).min(by_crossings) + worst / aligned_points)
    }

    /// Samples the middle of every piece: those where cells meet are too narrow for a regular grid.
    fn misled_share(&self) -> f64 {
        let (mut off, mut all) = (0.0, f64::MIN_POSITIVE);
        for row in self.pieces[1].within([0.0, 180.0]) {
            let (gamma, high) = (middle(row), row[1] - row[0]);
            for column in self.pieces[0].within([0.0, 360.0]) {
                let (h, wide) = (middle(column), column[1] - column[0]);
                let weight = wide * high * gamma.to_radians().sin();
                off += weight * self.off_cd(h - SEAM_DEG, gamma);
                all += weight * self.original.intensity(h - SEAM_DEG, gamma).value();
            }
        }
        off / all
    }
}

/// Returns the largest part of a patch that sees a piece, wherever the patch lies.
fn patch_share([begin, end]: [f64; 2], patch_deg: f64) -> f64 {
    if end - begin < patch_deg { (end - begin) / patch_deg } else { 1.0 }
}

/// Returns the angle at a part of an interval.
fn interpolate([begin, end]: [f64; 2], part: f64) -> f64 {
    begin + part * (end - begin)
}

/// Returns the middle of an interval.
fn middle([begin, end]: [f64; 2]) -> f64 {
    0.5 * (begin + end)
}

/// Returns into how many steps each of this many cells is divided.
fn steps(cells: usize) -> usize {
    let most = (MAX_VALUES as f64 / cells as f64).sqrt() as usize;
    // A cell has three nodes more than steps.
    most.saturating_sub(3).clamp(STEPS[0], STEPS[1])
}

/// Returns the table's planes over the full circle, without those just before its end, where the turned planes end.
fn planes_deg(distribution: &LuminousIntensityDistribution) -> Vec<f64> {
    let at_end = 360.0 - 10.0 * SEAM_DEG;
    distribution.full_circle().c_deg().iter().copied().filter(|c| *c <= at_end || *c == 360.0).collect()
}

/// Returns the rows from nadir to the one behind the zenith.
fn rows(gamma_deg: &[f64], steps: usize) -> Vec<Node> {
    let ends = [gamma_deg[0], gamma_deg[gamma_deg.len() - 1]];
    let mut cells = cells(gamma_deg);
    cells.splice(0..0, dark_cell([0.0, ends[0]]));
    cells.extend(dark_cell([ends[1], 180.0]));
    let nadir = NADIR_DEG.min(cells[0].own[1] / 8.0);
    cells[0].handed[0] = nadir;
    let nodes = joined(cells, steps, ROW_BESIDE_DEG, [nadir / 2.0, BEHIND_DEG]);
    [nodes[0].cell.node(0.0, 0.0)].into_iter().chain(nodes).collect()
}

/// Returns a dark cell between two angles; `None` if there is no space between them.
fn dark_cell(own: [f64; 2]) -> Option<Cell> {
    (own[0] < own[1]).then_some(Cell { own, is_dark: true, handed: own })
}

/// Returns the planes of the full circle, turned by `SEAM_DEG`.
fn planes(c_deg: &[f64], steps: usize) -> Vec<Node> {
    let mut cells = cells(c_deg);
    let last = cells.len() - 1;
    let (begin, end) = (-SEAM_DEG, 360.0 - SEAM_DEG);
    (cells[0].handed[0], cells[last].handed[1]) = (begin + 3.0 * HAIR_DEG, end - 3.0 * HAIR_DEG);
    let nodes = joined(cells, steps, PLANE_BESIDE_DEG, [begin + 2.0 * HAIR_DEG, end - 2.0 * HAIR_DEG]);
    let (first, behind) = (nodes[0].cell, nodes[nodes.len() - 1].cell);
    let begins = [begin, begin + HAIR_DEG].map(|c| first.node(c, first.handed[0]));
    let ends = [end - HAIR_DEG, end].map(|c| behind.node(c, behind.handed[1]));
    let nodes = begins.into_iter().chain(nodes).chain(ends);
    nodes.map(|node| Node { deg: node.deg + SEAM_DEG, ..node }).collect()
}

/// Returns the cells between neighbouring angles of a table.
fn cells(angles: &[f64]) -> Vec<Cell> {
    angles.windows(2).map(|ends| Cell { own: [ends[0], ends[1]], is_dark: false, handed: [ends[0], ends[1]] }).collect()
}

/// Joins adjacent cells: returns all their nodes, with the outermost neighbours at the angles `ends`.
fn joined(mut cells: Vec<Cell>, steps: usize, beside_deg: f64, ends: [f64; 2]) -> Vec<Node> {
    let mut neighbours = vec![ends; cells.len()];
    for k in 1..cells.len() {
        let boundary = Boundary::between(&cells[k - 1], &cells[k], beside_deg);
        cells[k - 1].handed[1] = boundary.place_deg(0.0);
        neighbours[k - 1][1] = boundary.place_deg(1.0);
        neighbours[k][0] = boundary.place_deg(2.0);
        cells[k].handed[0] = boundary.place_deg(3.0);
    }
    cells.into_iter().zip(neighbours).flat_map(|(cell, outer)| cell.nodes(steps, outer)).collect()
}

/// The place where two cells meet, whose four nodes lie in one of the two cells.
struct Boundary {
    at_deg: f64,
    beside_deg: f64,
    /// Shrinks the distances where the cell that gives way is narrow.
    scale: f64,
    /// Whether the nodes lie in the cell before the boundary.
    is_in_first: bool,
}

impl Boundary {
    fn between(first: &Cell, second: &Cell, beside_deg: f64) -> Self {
        // Next to light the dark cell gives way, else the second one. A narrow cell gives at most a quarter of its width.
        let is_in_first = first.is_dark;
        let [begin, end] = if is_in_first { first.own } else { second.own };
        let scale = ((end - begin) / (4.0 * (beside_deg + 3.0 * HAIR_DEG))).min(1.0);
        Self { at_deg: second.own[0], beside_deg, scale, is_in_first }
    }

    /// Returns the angle of the boundary's node `n` of 0 to 3, in ascending order.
    fn place_deg(&self, n: f64) -> f64 {
        if self.is_in_first { self.at_deg - self.step_deg(3.0 - n) } else { self.at_deg + self.step_deg(n) }
    }

    fn step_deg(&self, n: f64) -> f64 {
        (self.beside_deg + n * HAIR_DEG) * self.scale
    }
}

/// Returns the cell that an angle lies in and its relative position there. The last angle lies in none, as in Cycles.
fn cell(angles: &[f64], angle: f64) -> Option<(usize, f64)> {
    let after = angles.partition_point(|a| *a <= angle);
    let k = after.checked_sub(1).filter(|_| after < angles.len())?;
    Some((k, (angle - angles[k]) / (angles[k + 1] - angles[k])))
}

/// Returns Cycles' cubic (Catmull & Rom 1974) between the second and the third of four values.
fn cubic([a, b, c, d]: [f64; 4], x: f64) -> f64 {
    0.5 * (((d + 3.0 * (b - c) - a) * x + (2.0 * a - 5.0 * b + 4.0 * c - d)) * x + (c - a)) * x + b
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::{axial_uplight, lambertian, lopsided, quadrant, random_table};
    use crate::patches::tests::is_the_table_but_for_little;

    #[test]
    fn the_drivers_turn_planes_and_sample_patches_as_is_counted_on() {
        let (scene, read) =
            (include_str!("../../drivers/cycles_scene.py"), include_str!("../../drivers/cycles_read.py"));
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
            for k in (0..360).step_by(5) {
                for j in 0..=180 {
                    // The table's own angles, and the error that 32-bit floats may make of them.
                    for beside in [0.0, 1e-5, -1e-5] {
                        let (c, gamma) = (f64::from(k) + beside, (f64::from(j) + beside).clamp(0.0, 180.0));
                        let at_end = distribution.gamma_deg().iter().any(|g| (g - gamma).abs() < 1e-4);
                        let off = (table.intensity_cd(c, gamma) - distribution.intensity(c, gamma).value()).abs();
                        let edge = largest * beside.abs();
                        let is_known = at_end
                            || is_where_cells_meet(distribution.gamma_deg(), gamma)
                            || is_where_cells_meet(&planes_deg(&distribution), c);
                        assert!(off < 1e-12 * largest + edge || is_known, "{off} of {largest} at C {c}, gamma {gamma}");
                    }
                }
            }
            assert!(table.misled_share() < 3e-4, "{}", table.misled_share());
        }
    }

    /// Returns whether an angle lies in the narrow strip just after one of a table's angles.
    fn is_where_cells_meet(angles: &[f64], at: f64) -> bool {
        angles.iter().any(|a| a + 1e-4 < at && at < a + 0.04)
    }

    #[test]
    fn any_table_is_a_file_of_bounded_size() {
        let mut random = fastrand::Rng::with_seed(4);
        for _ in 0..20 {
            let table = LookedUp::of(&random_table(&mut random));
            let (c, gamma) = (planes_deg(&table.original).len(), table.original.gamma_deg().len());
            let nodes = steps(c * gamma) + 3;
            assert!(table.h_deg.len() <= nodes * c + 4 && table.v_deg.len() <= nodes * (gamma + 1) + 1);
            assert!(table.misled_share() < 0.01);
            assert!(table.h_deg.windows(2).chain(table.v_deg.windows(2)).all(|ends| ends[0] < ends[1]));
            assert_eq!((table.h_deg[0], table.v_deg[0], table.h_deg.last()), (0.0, 0.0, Some(&360.0)));
        }
    }
}
