//! Tables of type C that stand for those of types A and B, for whoever reads no others, as fine as it takes or may be.
//!
//! About a vertical axis the planes are kept and but for the ends of the sector nothing is lost. The cells of type B lie askew
//! to those of type C: planes and angles are put where most light would be misled without them, until the error asked for is
//! met or the table is as large as it may be.

use glam::{DMat3, DVec3};

use super::{LuminousIntensityDistribution, Symmetry, angles_deg, direction, lerp};
use crate::photometry::goniometer::Goniometer;

/// Over how many degrees a table of type C falls to zero where a sector of planes ends in light: renderers keep angles in 32 bits.
const EDGE_DEG: f64 = 1e-3;
/// No interval of a stand-in is halved that is narrower, in degrees: where light ends at once, none is narrow enough.
const NARROWEST_DEG: f64 = 0.02;
/// A table of fewer values begins with fewer.
const SMALL: usize = 1000;
/// How much a table grows before its errors are looked at anew.
const GROWTH: f64 = 1.2;

/// What a table of type C may be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TypeCLimits {
    /// The error that is enough, in parts of the largest intensity.
    pub relative_error: f64,
    /// Planes over the full circle at most.
    pub most_planes: usize,
    /// Stored values at most.
    pub most_values: usize,
}

impl Default for TypeCLimits {
    fn default() -> Self {
        Self { relative_error: 1e-4, most_planes: 720, most_values: 60_000 }
    }
}

/// A table of type C that stands for another, and how far it is from it.
#[derive(Clone, Debug, PartialEq)]
pub struct TypeC {
    /// The table.
    pub distribution: LuminousIntensityDistribution,
    /// The largest difference at the nodes and in the middle of the cells of both tables, in candela; beside the end of a sector of
    /// planes it may be as much as the light there.
    pub largest_error_cd: f64,
    /// The flux that goes elsewhere, is added or lost, in parts of all.
    pub misled_share: f64,
}

impl LuminousIntensityDistribution {
    /// The table in type C as finely as is mostly enough; one of type C is itself.
    pub fn in_type_c(&self) -> TypeC {
        self.in_type_c_within(TypeCLimits::default())
    }

    /// The table in type C within limits; one of type C is itself.
    pub fn in_type_c_within(&self, limits: TypeCLimits) -> TypeC {
        let kept = match self.goniometer {
            Goniometer::C => Some(self.clone()),
            Goniometer::A => Some(self.planes_kept()).filter(|table| {
                let planes = table.full_circle().c_deg.len();
                planes <= limits.most_planes && table.candela.len() <= limits.most_values
            }),
            Goniometer::B => None,
        };
        match kept {
            Some(distribution) => TypeC { distribution, largest_error_cd: 0.0, misled_share: 0.0 },
            None => Refined::of(self, limits).finished(),
        }
    }

    /// Planes about the vertical as planes of type C; beyond a lit one at an end of the sector an edge falls to zero.
    fn planes_kept(&self) -> Self {
        let (count, last) = (self.c_deg.len(), self.c_deg[self.c_deg.len() - 1]);
        let ends = [(0, self.c_deg[0] - EDGE_DEG), (count - 1, last + EDGE_DEG)];
        let is_lit = |plane: usize| self.plane(plane).iter().any(|i| *i > 0.0);
        let gap = 360.0 - (last - self.c_deg[0]);
        let mut c_deg = self.c_deg.clone();
        if gap > 2.0 * EDGE_DEG {
            c_deg.extend(ends.into_iter().filter(|(plane, _)| is_lit(*plane)).map(|(_, edge)| edge));
        }
        let mut c_deg: Vec<f64> = if self.symmetry == Symmetry::BilateralC0 {
            c_deg.into_iter().filter(|c| (0.0..=180.0).contains(c)).chain([0.0, 180.0]).collect()
        } else {
            c_deg.into_iter().map(|c| c.rem_euclid(360.0)).chain([0.0, 360.0]).collect()
        };
        sort(&mut c_deg);
        let symmetry = if self.symmetry == Symmetry::BilateralC0 { Symmetry::BilateralC0 } else { Symmetry::None };
        self.on_grid(symmetry, c_deg, self.gamma_deg.clone())
    }

    /// What it says at the nodes of a grid of type C.
    fn on_grid(&self, symmetry: Symmetry, c_deg: Vec<f64>, gamma_deg: Vec<f64>) -> Self {
        let turn = |c: f64| if symmetry == Symmetry::None { c % 360.0 } else { c };
        let along = |&c: &f64| gamma_deg.iter().map(move |&g| self.intensity(turn(c), g).value());
        let candela = c_deg.iter().flat_map(along).collect();
        Self { goniometer: Goniometer::C, symmetry, c_deg, gamma_deg, candela }
    }

    /// From the nadir or later to where the last light of any direction is, in degrees of gamma, or a little further.
    fn lit_gamma_deg(&self) -> [f64; 2] {
        // Between nodes that are less than a step apart, and within a step of one that is lit.
        let step = 0.25;
        let fine = |angles: &[f64]| {
            let between = |w: &[f64]| {
                let (from, to) = (w[0], w[1]);
                let parts = ((to - from) / step).ceil().clamp(1.0, 1e3);
                (0..parts as usize).map(move |k| from + (to - from) * k as f64 / parts)
            };
            angles.windows(2).flat_map(between).chain([angles[angles.len() - 1]]).collect::<Vec<f64>>()
        };
        let (mut low, mut high) = (180.0_f64, 0.0_f64);
        let gammas = fine(&self.gamma_deg);
        for c in fine(&self.c_deg) {
            for &g in &gammas {
                if self.at(c, g).value() > 0.0 {
                    let gamma = angles_deg(self.own_direction(c, g)).1;
                    (low, high) = (low.min(gamma), high.max(gamma));
                }
            }
        }
        let rounded = |edge: f64, end: f64| if (edge - end).abs() < 1e-9 { end } else { edge };
        let (low, high) = (rounded(low, 90.0), rounded(high, 90.0));
        let (low, high) = (if low == 90.0 { 90.0 } else { low - step }, if high == 90.0 { 90.0 } else { high + step });
        if low >= high { [0.0, 180.0] } else { [low.max(0.0), high.min(180.0)] }
    }
}

/// A grid that is being refined.
struct Refined<'a> {
    of: &'a LuminousIntensityDistribution,
    limits: TypeCLimits,
    symmetry: Symmetry,
    c_deg: Vec<f64>,
    gamma_deg: Vec<f64>,
}

/// What the middle of an interval is off from the straight line between its ends.
#[derive(Clone, Copy)]
struct Off {
    /// Over all of the other angle, as flux, and a value that is spent on it.
    gain: f64,
    largest_cd: f64,
    at_deg: f64,
    is_c: bool,
}

impl<'a> Refined<'a> {
    fn of(of: &'a LuminousIntensityDistribution, limits: TypeCLimits) -> Self {
        let symmetry = of.symmetry;
        let [first_c, last_c] = match symmetry {
            Symmetry::Quadrant => [0.0, 90.0],
            Symmetry::BilateralC0 => [0.0, 180.0],
            Symmetry::BilateralC90 => [90.0, 270.0],
            Symmetry::None | Symmetry::Axial => [0.0, 360.0],
        };
        let [low, high] = of.lit_gamma_deg();
        let is_small = limits.most_values < SMALL;
        let (step, rows) = if is_small { (90.0, 4) } else { (22.5, 16) };
        let planes = ((last_c - first_c) / step) as u32;
        let mut c_deg: Vec<f64> = (0..=planes).map(|k| first_c + step * f64::from(k)).collect();
        let mut gamma_deg: Vec<f64> = (0..=rows).map(|k| low + (high - low) * f64::from(k) / f64::from(rows)).collect();
        // A beam between those would not be seen.
        for (c, gamma) in of.about_peak(if is_small { 1 } else { 4 }) {
            c_deg.push(symmetry.fold(c));
            gamma_deg.push(gamma.clamp(low, high));
        }
        // Half a space that ends in light does so at planes of type C.
        for (end, beyond) in [(of.c_deg[0], 1.0), (of.c_deg[of.c_deg.len() - 1], -1.0)] {
            if of.goniometer == Goniometer::B && (end == 0.0 || end.abs() == 180.0) {
                let beyond = if end == 0.0 { beyond } else { -beyond };
                c_deg.extend([90.0 + beyond * EDGE_DEG, 270.0 - beyond * EDGE_DEG]);
            }
        }
        c_deg.retain(|c| (first_c..=last_c).contains(c));
        sort(&mut c_deg);
        sort(&mut gamma_deg);
        let symmetry = if symmetry == Symmetry::Axial { Symmetry::None } else { symmetry };
        Self { of, limits, symmetry, c_deg, gamma_deg }
    }

    /// Planes that are stored of so many over the full circle.
    fn most_planes(&self) -> usize {
        let most = self.limits.most_planes;
        match self.symmetry {
            Symmetry::Quadrant => most.saturating_sub(1) / 4 + 1,
            Symmetry::BilateralC0 => most.saturating_sub(1) / 2 + 1,
            Symmetry::BilateralC90 => most.saturating_sub(2) / 2 + 1,
            Symmetry::None | Symmetry::Axial => most,
        }
    }

    fn finished(mut self) -> TypeC {
        let enough_cd = self.limits.relative_error * self.of.max_intensity().value();
        loop {
            let mut offs = self.offs(true);
            offs.extend(self.offs(false));
            let worst = |is_c: bool| offs.iter().filter(|o| o.is_c == is_c).map(|o| o.largest_cd).fold(0.0, f64::max);
            if worst(true) + worst(false) <= enough_cd {
                break;
            }
            offs.retain(|o| o.gain > 0.0);
            offs.sort_by(|a, b| b.gain.total_cmp(&a.gain));
            let grown = (self.c_deg.len() + self.gamma_deg.len()) as f64 * (GROWTH - 1.0);
            let mut added = 0;
            for off in offs.into_iter().take(grown.ceil() as usize) {
                let (c, gamma) = (self.c_deg.len(), self.gamma_deg.len());
                let more = if off.is_c { gamma } else { c };
                if c * gamma + more <= self.limits.most_values && !(off.is_c && c >= self.most_planes()) {
                    let angles = if off.is_c { &mut self.c_deg } else { &mut self.gamma_deg };
                    let place = angles.partition_point(|a| *a < off.at_deg);
                    angles.insert(place, off.at_deg);
                    added += 1;
                }
            }
            if added == 0 {
                break;
            }
        }
        let distribution = self.of.on_grid(self.symmetry, self.c_deg, self.gamma_deg);
        let (largest_error_cd, misled_share) = self.of.difference_from(&distribution);
        TypeC { distribution, largest_error_cd, misled_share }
    }

    /// Where an interval is divided: at a node of the table where that has its angles, else in the middle.
    fn division_deg(&self, is_c: bool, from: f64, to: f64) -> f64 {
        let middle = 0.5 * (from + to);
        let nodes = if is_c { &self.of.c_deg } else { &self.of.gamma_deg };
        let own = |node: &f64| if is_c { [*node, node + 360.0] } else { [*node; 2] };
        let within = nodes.iter().flat_map(own).filter(|n| *n > from + 1e-9 && *n < to - 1e-9);
        let nearest = within.min_by(|a, b| (a - middle).abs().total_cmp(&(b - middle).abs()));
        nearest.filter(|_| self.of.goniometer == Goniometer::A).unwrap_or(middle)
    }

    /// Of all intervals along C or along gamma that may be halved.
    fn offs(&self, is_c: bool) -> Vec<Off> {
        let (along, across) = if is_c { (&self.c_deg, &self.gamma_deg) } else { (&self.gamma_deg, &self.c_deg) };
        let at = |along: f64, across: f64| {
            let (c, gamma) = if is_c { (along, across) } else { (across, along) };
            self.of.intensity(c, gamma).value()
        };
        let sine = |gamma: f64| gamma.to_radians().sin();
        let mut gain = vec![0.0; along.len() - 1];
        let mut largest = vec![0.0_f64; along.len() - 1];
        for pair in across.windows(2) {
            // Off the middle: where the cells of the table meet in the middle, what is between is not seen.
            let other = pair[0] + 0.45 * (pair[1] - pair[0]);
            let mut before = at(along[0], other);
            for (k, ends) in along.windows(2).enumerate() {
                let middle = 0.5 * (ends[0] + ends[1]);
                let after = at(ends[1], other);
                let off = (at(middle, other) - 0.5 * (before + after)).abs();
                let solid = (ends[1] - ends[0]) * (pair[1] - pair[0]) * sine(if is_c { other } else { middle });
                gain[k] += off * solid;
                largest[k] = largest[k].max(off);
                before = after;
            }
        }
        let cost = across.len() as f64;
        let of_interval = |(k, ends): (usize, &[f64])| {
            let at_deg = self.division_deg(is_c, ends[0], ends[1]);
            let is_wide = ends[1] - ends[0] > NARROWEST_DEG;
            is_wide.then(|| Off { gain: gain[k] / cost, largest_cd: largest[k], at_deg, is_c })
        };
        along.windows(2).enumerate().filter_map(of_interval).collect()
    }
}

impl LuminousIntensityDistribution {
    /// (C, gamma) of the nodes about the brightest, so many to either side.
    fn about_peak(&self, near: usize) -> Vec<(f64, f64)> {
        let peak = (0..self.candela.len()).max_by(|a, b| self.candela[*a].total_cmp(&self.candela[*b])).unwrap_or(0);
        let gammas = self.gamma_deg.len();
        let about = |k: usize, count: usize| k.saturating_sub(near)..(k + near + 1).min(count);
        let (c, g) = (peak / gammas, peak % gammas);
        let along_c = about(c, self.c_deg.len()).map(|c| (c, g));
        let nodes = along_c.chain(about(g, gammas).map(|g| (c, g)));
        nodes.map(|(c, g)| angles_deg(self.own_direction(self.c_deg[c], self.gamma_deg[g]))).collect()
    }

    /// The largest difference from a table of type C at the nodes and in the cells of both, in candela, and in how much of the flux they
    /// differ.
    pub(in crate::photometry) fn difference_from(&self, other: &Self) -> (f64, f64) {
        let off = |d: DVec3| (self.intensity_towards(d) - other.intensity_towards(d)).value().abs();
        let largest = [self, other].into_iter().flat_map(Self::node_directions).map(off).fold(0.0, f64::max);
        let flux = self.flux().value();
        (largest, if flux > 0.0 { self.misled_by(other, DMat3::IDENTITY) / flux } else { 0.0 })
    }

    /// The flux in lumens that a table of type C sends elsewhere, adds or loses that stands for this one; `turn` takes directions of this
    /// one's frame to the other's.
    pub fn misled_by(&self, other: &Self, turn: DMat3) -> f64 {
        // Of each cell a point that is in the middle of nothing.
        let (full, back) = (other.own_planes(), turn.transpose());
        let mut misled = 0.0;
        for c in full.c_deg.windows(2) {
            for g in full.gamma_deg.windows(2) {
                let there = direction(lerp(c[0], c[1], 0.381_966), lerp(g[0], g[1], 0.618_034));
                let off = (self.intensity_towards(back * there) - full.intensity_towards(there)).value().abs();
                misled += off * (c[1] - c[0]) * (g[0].to_radians().cos() - g[1].to_radians().cos());
            }
        }
        misled.to_radians()
    }

    /// The same with every intensity rounded to so many decimals of a unit.
    pub(in crate::photometry) fn rounded(self, unit_cd: f64, decimals: i32) -> Self {
        let scale = 10f64.powi(decimals);
        let round = |i: &f64| (i / unit_cd * scale).round() / scale * unit_cd;
        Self { candela: self.candela.iter().map(round).collect(), ..self }
    }
}

/// Rising, with angles that are the same to rounding made one.
fn sort(angles: &mut Vec<f64>) {
    angles.sort_by(f64::total_cmp);
    let last = angles[angles.len() - 1];
    angles.dedup_by(|b, a| *b - *a < 1e-9);
    // The ends of the range keep their exact value.
    if let Some(end) = angles.last_mut() {
        *end = last;
    }
}
