//! Approximation of type A and B tables by tables of type C, for engines and formats that read no other type.
//!
//! Type A has a vertical axis: its planes stay, and only the ends of the sector change. The cells of type B are oblique
//! to those of type C. The grid grows where it misdirects most light, until it meets the allowed error or a size limit.

use glam::DMat3;

use super::{LuminousIntensityDistribution, Symmetry, angles_deg, direction, lerp, tabulate};
use crate::goniometer::Goniometer;

/// Width in degrees of the fall to zero where a sector of planes ends in light. Renderers store angles in 32 bits.
const EDGE_DEG: f64 = 1e-3;
/// The narrowest interval in degrees that is divided. At a step of the intensity, no interval is narrow enough.
const MIN_DIVIDED_DEG: f64 = 0.02;
/// Below this limit of values, the initial grid is coarser.
const SMALL_TABLE_VALUES: usize = 1000;
/// Growth of the grid, as a factor, between two evaluations of its errors.
const GROWTH_FACTOR: f64 = 1.2;
/// Step in degrees in which the table is searched for light.
const LIT_SEARCH_STEP_DEG: f64 = 0.25;

/// Limits of a table of type C.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TypeCLimits {
    /// The allowed error as a fraction of the largest intensity.
    pub relative_error: f64,
    /// The largest number of planes over the full circle.
    pub most_planes: usize,
    /// The largest number of stored values.
    pub most_values: usize,
}

impl Default for TypeCLimits {
    fn default() -> Self {
        Self { relative_error: 1e-4, most_planes: 720, most_values: 60_000 }
    }
}

/// A table of type C that approximates another table, and its errors.
#[derive(Clone, Debug, PartialEq)]
pub struct TypeC {
    /// The table.
    pub distribution: LuminousIntensityDistribution,
    /// The largest difference at the nodes and cell centres of both tables, in candela.
    ///
    /// Next to the end of a sector it can reach the intensity at that end.
    pub largest_error_cd: f64,
    /// The flux that changes direction, is added or is lost, as a fraction of the total flux.
    pub misled_share: f64,
}

impl LuminousIntensityDistribution {
    /// The table in type C within the default limits. A type C table is returned unchanged.
    pub fn in_type_c(&self) -> TypeC {
        self.in_type_c_within(TypeCLimits::default())
    }

    /// The table in type C within limits. A type C table is returned unchanged.
    pub fn in_type_c_within(&self, limits: TypeCLimits) -> TypeC {
        let exact = match self.goniometer {
            Goniometer::C => Some(self.clone()),
            Goniometer::A => Some(self.with_planes_of_type_c()).filter(|table| {
                let planes = table.full_circle().c_deg.len();
                planes <= limits.most_planes && table.candela.len() <= limits.most_values
            }),
            Goniometer::B => None,
        };
        match exact {
            Some(distribution) => TypeC { distribution, largest_error_cd: 0.0, misled_share: 0.0 },
            None => GridRefinement::new(self, limits).run(),
        }
    }

    /// Planes about the vertical as planes of type C. A lit end of the sector gets an edge that falls to zero.
    fn with_planes_of_type_c(&self) -> Self {
        let (count, last) = (self.c_deg.len(), self.c_deg[self.c_deg.len() - 1]);
        let ends = [(0, self.c_deg[0] - EDGE_DEG), (count - 1, last + EDGE_DEG)];
        let gap = 360.0 - (last - self.c_deg[0]);
        let mut c_deg = self.c_deg.clone();
        if gap > 2.0 * EDGE_DEG {
            let lit_ends = ends.into_iter().filter(|(plane, _)| self.plane(*plane).iter().any(|i| *i > 0.0));
            c_deg.extend(lit_ends.map(|(_, edge)| edge));
        }
        let mut c_deg: Vec<f64> = if self.symmetry == Symmetry::BilateralC0 {
            c_deg.into_iter().filter(|c| (0.0..=180.0).contains(c)).chain([0.0, 180.0]).collect()
        } else {
            c_deg.into_iter().map(|c| c.rem_euclid(360.0)).chain([0.0, 360.0]).collect()
        };
        sort_angles(&mut c_deg);
        let symmetry = if self.symmetry == Symmetry::BilateralC0 { Symmetry::BilateralC0 } else { Symmetry::None };
        self.on_grid(symmetry, c_deg, self.gamma_deg.clone())
    }

    /// The intensities at the nodes of a grid of type C.
    fn on_grid(&self, symmetry: Symmetry, c_deg: Vec<f64>, gamma_deg: Vec<f64>) -> Self {
        let candela = tabulate(&c_deg, &gamma_deg, |c, g| {
            // The planes 0 and 360 of a full circle are one: both get the same value.
            let c = if symmetry == Symmetry::None { c % 360.0 } else { c };
            self.intensity(c, g).value()
        });
        Self { goniometer: Goniometer::C, symmetry, c_deg, gamma_deg, candela }
    }

    /// The range of gamma in degrees that contains all light, with a margin of a search step.
    fn lit_gamma_deg(&self) -> [f64; 2] {
        let (mut low, mut high) = (180.0_f64, 0.0_f64);
        let gammas = subdivide(&self.gamma_deg);
        for c in subdivide(&self.c_deg) {
            for &g in &gammas {
                if self.own_intensity(c, g).value() > 0.0 {
                    let gamma = angles_deg(self.own_direction(c, g)).1;
                    (low, high) = (low.min(gamma), high.max(gamma));
                }
            }
        }
        // Light that ends at the horizon ends there exactly: a margin would carry it beyond.
        let low = if (low - 90.0).abs() < 1e-9 { 90.0 } else { low - LIT_SEARCH_STEP_DEG };
        let high = if (high - 90.0).abs() < 1e-9 { 90.0 } else { high + LIT_SEARCH_STEP_DEG };
        if low >= high { [0.0, 180.0] } else { [low.max(0.0), high.min(180.0)] }
    }
}

/// Angles with intermediate ones at most a search step apart, where that takes no more than a thousand parts.
fn subdivide(angles: &[f64]) -> Vec<f64> {
    let mut fine = vec![];
    for pair in angles.windows(2) {
        let (from, to) = (pair[0], pair[1]);
        let parts = ((to - from) / LIT_SEARCH_STEP_DEG).ceil().clamp(1.0, 1e3);
        fine.extend((0..parts as usize).map(|k| from + (to - from) * k as f64 / parts));
    }
    fine.push(angles[angles.len() - 1]);
    fine
}

/// A grid of type C under refinement.
struct GridRefinement<'a> {
    source: &'a LuminousIntensityDistribution,
    limits: TypeCLimits,
    symmetry: Symmetry,
    c_deg: Vec<f64>,
    gamma_deg: Vec<f64>,
}

/// The error of linear interpolation in the middle of a grid interval.
#[derive(Clone, Copy)]
struct IntervalError {
    /// The misdirected flux, summed over the other angle, per value that a division of the interval adds.
    gain: f64,
    largest_cd: f64,
    /// The angle at which the interval is divided.
    division_deg: f64,
    is_c: bool,
}

impl<'a> GridRefinement<'a> {
    /// The initial grid: even steps, the nodes about the peak, and the edges of a lit half space.
    fn new(source: &'a LuminousIntensityDistribution, limits: TypeCLimits) -> Self {
        let symmetry = source.symmetry;
        let [first_c, last_c] = match symmetry {
            Symmetry::Quadrant => [0.0, 90.0],
            Symmetry::BilateralC0 => [0.0, 180.0],
            Symmetry::BilateralC90 => [90.0, 270.0],
            Symmetry::None | Symmetry::Axial => [0.0, 360.0],
        };
        let [low, high] = source.lit_gamma_deg();
        let is_small = limits.most_values < SMALL_TABLE_VALUES;
        let (step, rows) = if is_small { (90.0, 4) } else { (22.5, 16) };
        let planes = ((last_c - first_c) / step) as u32;
        let mut c_deg: Vec<f64> = (0..=planes).map(|k| first_c + step * f64::from(k)).collect();
        let mut gamma_deg: Vec<f64> = (0..=rows).map(|k| low + (high - low) * f64::from(k) / f64::from(rows)).collect();
        // Even steps alone miss a beam that is narrower than a step.
        for (c, gamma) in source.angles_about_peak(if is_small { 1 } else { 4 }) {
            c_deg.push(symmetry.fold(c));
            gamma_deg.push(gamma.clamp(low, high));
        }
        // A half space of type B ends at the planes C 90 and C 270.
        for (end, beyond) in [(source.c_deg[0], 1.0), (source.c_deg[source.c_deg.len() - 1], -1.0)] {
            if source.goniometer == Goniometer::B && (end == 0.0 || end.abs() == 180.0) {
                let beyond = if end == 0.0 { beyond } else { -beyond };
                c_deg.extend([90.0 + beyond * EDGE_DEG, 270.0 - beyond * EDGE_DEG]);
            }
        }
        c_deg.retain(|c| (first_c..=last_c).contains(c));
        sort_angles(&mut c_deg);
        sort_angles(&mut gamma_deg);
        let symmetry = if symmetry == Symmetry::Axial { Symmetry::None } else { symmetry };
        Self { source, limits, symmetry, c_deg, gamma_deg }
    }

    /// The largest number of stored planes, given the limit for the full circle.
    fn most_stored_planes(&self) -> usize {
        let most = self.limits.most_planes;
        match self.symmetry {
            Symmetry::Quadrant => most.saturating_sub(1) / 4 + 1,
            Symmetry::BilateralC0 => most.saturating_sub(1) / 2 + 1,
            Symmetry::BilateralC90 => most.saturating_sub(2) / 2 + 1,
            Symmetry::None | Symmetry::Axial => most,
        }
    }

    /// Refines the grid to the allowed error or to its limits, and computes the table on it.
    fn run(mut self) -> TypeC {
        let allowed_cd = self.limits.relative_error * self.source.max_intensity().value();
        loop {
            let mut errors = self.interval_errors(true);
            let worst_along_c = largest_error_cd(&errors);
            let along_gamma = self.interval_errors(false);
            let worst_along_gamma = largest_error_cd(&along_gamma);
            if worst_along_c + worst_along_gamma <= allowed_cd {
                break;
            }
            errors.extend(along_gamma);
            if self.divide_worst(errors) == 0 {
                break;
            }
        }
        let distribution = self.source.on_grid(self.symmetry, self.c_deg, self.gamma_deg);
        let (largest_error_cd, misled_share) = self.source.difference_from(&distribution);
        TypeC { distribution, largest_error_cd, misled_share }
    }

    /// Divides the intervals with the largest gain, as far as the limits allow, and returns their number.
    fn divide_worst(&mut self, mut errors: Vec<IntervalError>) -> usize {
        errors.retain(|error| error.gain > 0.0);
        errors.sort_by(|a, b| b.gain.total_cmp(&a.gain));
        let growth = (self.c_deg.len() + self.gamma_deg.len()) as f64 * (GROWTH_FACTOR - 1.0);
        let mut divided = 0;
        for error in errors.into_iter().take(growth.ceil() as usize) {
            let (planes, gammas) = (self.c_deg.len(), self.gamma_deg.len());
            let added_values = if error.is_c { gammas } else { planes };
            let has_room = planes * gammas + added_values <= self.limits.most_values;
            if has_room && !(error.is_c && planes >= self.most_stored_planes()) {
                let angles = if error.is_c { &mut self.c_deg } else { &mut self.gamma_deg };
                let place = angles.partition_point(|a| *a < error.division_deg);
                angles.insert(place, error.division_deg);
                divided += 1;
            }
        }
        divided
    }

    /// The angle at which an interval is divided: the nearest node of a type A table, else the middle.
    fn division_deg(&self, is_c: bool, from: f64, to: f64) -> f64 {
        let middle = 0.5 * (from + to);
        // The nodes of type B are no nodes of type C.
        if self.source.goniometer != Goniometer::A {
            return middle;
        }
        let nodes = if is_c { &self.source.c_deg } else { &self.source.gamma_deg };
        // Native planes begin at -180, grid planes at 0.
        let turn = if is_c { 360.0 } else { 0.0 };
        let within = nodes.iter().flat_map(|n| [*n, n + turn]).filter(|n| *n > from + 1e-9 && *n < to - 1e-9);
        let nearest = within.min_by(|a, b| (a - middle).abs().total_cmp(&(b - middle).abs()));
        nearest.unwrap_or(middle)
    }

    /// The intensity of the source at an angle along the intervals and one across them.
    fn source_intensity(&self, is_c: bool, along: f64, across: f64) -> f64 {
        let (c, gamma) = if is_c { (along, across) } else { (across, along) };
        self.source.intensity(c, gamma).value()
    }

    /// The errors of all intervals along C or along gamma that are wide enough to be divided.
    fn interval_errors(&self, is_c: bool) -> Vec<IntervalError> {
        let (along, across) = if is_c { (&self.c_deg, &self.gamma_deg) } else { (&self.gamma_deg, &self.c_deg) };
        let mut gain = vec![0.0; along.len() - 1];
        let mut largest = vec![0.0_f64; along.len() - 1];
        for pair in across.windows(2) {
            // Not the middle: where cells of the source meet in the middle, the error there is zero.
            let other = pair[0] + 0.45 * (pair[1] - pair[0]);
            let mut before = self.source_intensity(is_c, along[0], other);
            for (k, ends) in along.windows(2).enumerate() {
                let middle = 0.5 * (ends[0] + ends[1]);
                let after = self.source_intensity(is_c, ends[1], other);
                let error = (self.source_intensity(is_c, middle, other) - 0.5 * (before + after)).abs();
                let gamma = if is_c { other } else { middle };
                let solid = (ends[1] - ends[0]) * (pair[1] - pair[0]) * gamma.to_radians().sin();
                gain[k] += error * solid;
                largest[k] = largest[k].max(error);
                before = after;
            }
        }
        let added_values = across.len() as f64;
        let mut errors = vec![];
        for (k, ends) in along.windows(2).enumerate() {
            if ends[1] - ends[0] > MIN_DIVIDED_DEG {
                let division_deg = self.division_deg(is_c, ends[0], ends[1]);
                errors.push(IntervalError { gain: gain[k] / added_values, largest_cd: largest[k], division_deg, is_c });
            }
        }
        errors
    }
}

/// The largest error of some intervals in candela.
fn largest_error_cd(errors: &[IntervalError]) -> f64 {
    errors.iter().map(|error| error.largest_cd).fold(0.0, f64::max)
}

/// The indices from `near` below `k` to `near` above it, of `count`.
fn neighbourhood(k: usize, near: usize, count: usize) -> std::ops::Range<usize> {
    k.saturating_sub(near)..(k + near + 1).min(count)
}

impl LuminousIntensityDistribution {
    /// (C, gamma) of the brightest node and of `near` nodes on either side of it.
    fn angles_about_peak(&self, near: usize) -> Vec<(f64, f64)> {
        let peak = (0..self.candela.len()).max_by(|a, b| self.candela[*a].total_cmp(&self.candela[*b])).unwrap_or(0);
        let gammas = self.gamma_deg.len();
        let (c, g) = (peak / gammas, peak % gammas);
        let along_c = neighbourhood(c, near, self.c_deg.len()).map(|c| (c, g));
        let nodes = along_c.chain(neighbourhood(g, near, gammas).map(|g| (c, g)));
        nodes.map(|(c, g)| angles_deg(self.own_direction(self.c_deg[c], self.gamma_deg[g]))).collect()
    }

    /// The difference from a type C table: the largest in candela, at nodes and in cells of both, and the misdirected share of the flux.
    pub(crate) fn difference_from(&self, other: &Self) -> (f64, f64) {
        let directions = [self, other].into_iter().flat_map(Self::node_directions);
        let differences = directions.map(|d| (self.intensity_towards(d) - other.intensity_towards(d)).value().abs());
        let largest = differences.fold(0.0, f64::max);
        let flux = self.flux().value();
        (largest, if flux > 0.0 { self.misled_by(other, DMat3::IDENTITY) / flux } else { 0.0 })
    }

    /// The flux in lumens that a type C approximation of this table misdirects, adds or loses.
    ///
    /// `turn` takes directions from the frame of this table to the frame of the other.
    pub fn misled_by(&self, other: &Self, turn: DMat3) -> f64 {
        let (full, back) = (other.own_planes(), turn.transpose());
        let mut misled = 0.0;
        for c in full.c_deg.windows(2) {
            for g in full.gamma_deg.windows(2) {
                // One point in each cell, at golden sections: it avoids the symmetry lines of both tables.
                let there = direction(lerp(c[0], c[1], 0.381_966), lerp(g[0], g[1], 0.618_034));
                let error = (self.intensity_towards(back * there) - full.intensity_towards(there)).value().abs();
                misled += error * (c[1] - c[0]) * (g[0].to_radians().cos() - g[1].to_radians().cos());
            }
        }
        misled.to_radians()
    }

    /// The table with every intensity rounded to this number of decimals of a unit.
    pub(crate) fn rounded(self, unit_cd: f64, decimals: i32) -> Self {
        let scale = 10f64.powi(decimals);
        let candela = self.candela.iter().map(|i| (i / unit_cd * scale).round() / scale * unit_cd).collect();
        Self { candela, ..self }
    }
}

/// Sorts angles and merges those that are equal to rounding.
fn sort_angles(angles: &mut Vec<f64>) {
    angles.sort_by(f64::total_cmp);
    let last = angles[angles.len() - 1];
    angles.dedup_by(|b, a| *b - *a < 1e-9);
    // The ends of the range stay exact.
    if let Some(end) = angles.last_mut() {
        *end = last;
    }
}
