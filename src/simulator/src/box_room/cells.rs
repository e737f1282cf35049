//! Cells of a luminaire's directions: one bilinear piece of its table, within one convex polygon that it lights.

#![expect(clippy::inline_always, reason = "compiled for what the processor has")]

use std::f64::consts::{FRAC_PI_2, FRAC_PI_4, PI, TAU};

use glam::{DMat3, DVec3};

use crate::quadrature::Gauss;
use luxproof_photometry::LuminousIntensityDistribution;
use luxproof_scene::Luminaire;

/// Angles closer than this are one, in radians.
const SAME_ANGLE: f64 = 1e-12;

/// The frame of a luminaire's table, upright but for type B, and its planes in radians, written out over all that they cover.
#[derive(Clone, Debug)]
pub(super) struct LuminaireFrame {
    pub(super) position_m: DVec3,
    orientation: DMat3,
    c_rad: Vec<f64>,
    gamma_rad: Vec<f64>,
    /// `[c][gamma]` in candela, flux scale included.
    candela: Vec<f64>,
}

/// A piece of the table between two C and two curves of gamma.
#[derive(Clone, Copy, Debug)]
pub(super) struct Cell {
    c: (f64, f64),
    lower: Curve,
    upper: Curve,
    /// Interval of the table along C and along gamma.
    piece: (usize, usize),
}

/// A bound of gamma as a function of C.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Curve {
    Constant(f64),
    /// The great circle in the plane of this normal.
    GreatCircle(DVec3),
}

impl Curve {
    fn at(self, c: f64) -> f64 {
        self.at_turn(c.sin_cos())
    }

    /// At the C of each sine and cosine.
    #[inline(always)]
    fn at_turns<const N: usize>(self, sin_c: &[f64; N], cos_c: &[f64; N]) -> [f64; N] {
        let mut gamma = [0.0; N];
        match self {
            Self::Constant(value) => gamma = [value; N],
            Self::GreatCircle(m) => {
                let m = if m.z >= 0.0 { m } else { -m };
                for k in 0..N {
                    gamma[k] = angle(m.z, m.x * cos_c[k] + m.y * sin_c[k]);
                }
            }
        }
        gamma
    }

    /// At the C of this sine and cosine.
    fn at_turn(self, (sin_c, cos_c): (f64, f64)) -> f64 {
        match self {
            Self::Constant(gamma) => gamma,
            Self::GreatCircle(m) => {
                let across = m.x * cos_c + m.y * sin_c;
                if m.z >= 0.0 { m.z.atan2(across) } else { (-m.z).atan2(-across) }
            }
        }
    }
}

/// A line of constant C through a cell.
#[derive(Clone, Copy, Debug)]
pub(super) struct Row {
    low: f64,
    high: f64,
    /// World direction at gamma 90.
    across: DVec3,
    /// World direction of the zenith.
    axis: DVec3,
    /// Intensity at the gamma that it starts from, and what it gains a radian.
    candela: f64,
    from: f64,
    slope: f64,
    measure: f64,
}

impl Row {
    /// The angle along gamma from end to end.
    pub(super) fn gamma_rad(&self) -> f64 {
        self.high - self.low
    }

    /// The world direction at a parameter from 0 to 1, and the flux in lumens that a unit of both parameters carries there.
    pub(super) fn direction(&self, t: f64) -> (DVec3, f64) {
        let gamma = self.low + t * (self.high - self.low);
        let (sin_g, cos_g) = gamma.sin_cos();
        let candela = self.candela + (gamma - self.from) * self.slope;
        (sin_g * self.across - cos_g * self.axis, candela * sin_g * self.measure)
    }
}

/// A rule of no more than N points, made up to N by points of no weight; nodes from -1 to 1.
#[derive(Clone, Copy, Debug)]
pub(super) struct Padded<const N: usize> {
    pub(super) nodes: [f64; N],
    pub(super) weights: [f64; N],
}

impl<const N: usize> Padded<N> {
    pub(super) fn new(rule: &Gauss) -> Self {
        let (mut nodes, mut weights) = ([0.0; N], [0.0; N]);
        for (k, (x, weight)) in rule.points().enumerate() {
            (nodes[k], weights[k]) = (2.0 * x - 1.0, weight);
        }
        Self { nodes, weights }
    }
}

/// Lines of constant C through a cell at the nodes of a rule, of each the part that a patch has of it.
///
/// All that is computed for one is computed for several at once, without the system's library: the same on every machine.
#[derive(Clone, Copy, Debug)]
pub(super) struct Rows<const N: usize> {
    /// Half the angle along gamma, and sine and cosine of its middle.
    half: [f64; N],
    sin: [f64; N],
    cos: [f64; N],
    /// Sine and cosine of C.
    sin_c: [f64; N],
    cos_c: [f64; N],
    /// Intensity in the middle and what it gains a radian, both by what a unit of both parameters weighs.
    flux: [f64; N],
    slope: [f64; N],
    /// World directions at gamma 90 and C 0 or 90, and of the zenith.
    orientation: DMat3,
}

/// Points of a rule along one of them: sines and cosines of gamma, and flux in lumens.
#[derive(Clone, Copy, Debug)]
pub(super) struct Line<const N: usize> {
    pub(super) sin: [f64; N],
    pub(super) cos: [f64; N],
    pub(super) flux: [f64; N],
    pub(super) across: DVec3,
    pub(super) axis: DVec3,
}

impl<const N: usize> Rows<N> {
    #[inline(always)]
    pub(super) fn line(&self, k: usize, rule: &Padded<N>) -> Line<N> {
        let (sin, cos, half) = (self.sin[k], self.cos[k], self.half[k]);
        let (flux, slope, weight) = (self.flux[k], self.slope[k], rule.weights[k]);
        let mut line = Line {
            sin: [0.0; N],
            cos: [0.0; N],
            flux: [0.0; N],
            across: self.orientation.x_axis * self.cos_c[k] + self.orientation.y_axis * self.sin_c[k],
            axis: self.orientation.z_axis,
        };
        for i in 0..N {
            let x = half * rule.nodes[i];
            let (sin_x, cos_x) = series(x);
            line.sin[i] = sin * cos_x + cos * sin_x;
            line.cos[i] = cos * cos_x - sin * sin_x;
            line.flux[i] = weight * rule.weights[i] * (flux + x * slope) * line.sin[i];
        }
        line
    }
}

/// Sine and cosine of an angle of a right angle at most.
#[inline(always)]
fn series(x: f64) -> (f64, f64) {
    let z = x * x;
    let (mut sin, mut cos) = (1.0, 1.0);
    for [of_sin, of_cos] in SERIES {
        sin = 1.0 - z * of_sin * sin;
        cos = 1.0 - z * of_cos * cos;
    }
    (x * sin, cos)
}

/// Quotients of the terms of sine and cosine, the last first; further ones would be 2e-19 at a right angle.
const SERIES: [[f64; 2]; 11] = {
    let mut quotients = [[0.0; 2]; 11];
    let mut k = 0;
    while k < 11 {
        let even = 2.0 * (11 - k) as f64;
        quotients[k] = [1.0 / (even * (even + 1.0)), 1.0 / (even * (even - 1.0))];
        k += 1;
    }
    quotients
};

/// The angle of a point above the x axis, from 0 to π.
#[inline(always)]
fn angle(y: f64, x: f64) -> f64 {
    let (long, short) = (y.max(x.abs()), y.min(x.abs()));
    // An eighth of a turn is taken off where that leaves less, so that the series converges.
    let is_turned = short > 0.414 * long;
    let (over, under) = if is_turned { (short - long, short + long) } else { (short, long) };
    let t = over / under;
    let z = -t * t;
    let mut sum = 0.0;
    for odd in ODD {
        sum = sum * z + odd;
    }
    let angle = t * sum + if is_turned { FRAC_PI_4 } else { 0.0 };
    let angle = if y > x.abs() { FRAC_PI_2 - angle } else { angle };
    if x < 0.0 { PI - angle } else { angle }
}

/// Reciprocals of the odd numbers, the last first; a further term would be 1e-17 of the first.
const ODD: [f64; 21] = {
    let mut odd = [0.0; 21];
    let mut k = 0;
    while k < 21 {
        odd[k] = 1.0 / (41 - 2 * k) as f64;
        k += 1;
    }
    odd
};

impl Cell {
    /// The piece of the table that it belongs to.
    pub(super) fn piece(&self) -> (usize, usize) {
        self.piece
    }

    /// The angle along C from the first parameter to the second.
    pub(super) fn turn_rad(&self, s: (f64, f64)) -> f64 {
        (s.1 - s.0) * (self.c.1 - self.c.0)
    }

    /// Whether it goes on where another one ends, under the same bounds.
    fn continues(&self, before: &Self) -> bool {
        self.piece == before.piece && self.lower == before.lower && self.upper == before.upper && self.c.0 == before.c.1
    }
}

impl LuminaireFrame {
    pub(super) fn new(luminaire: &Luminaire) -> Self {
        let full = luminaire.photometry.distribution.own_planes();
        let full = if full.is_native() { quartered(full) } else { full };
        let candela: Vec<f64> =
            (0..full.c_deg().len()).flat_map(|c| full.plane(c)).map(|i| i * luminaire.flux_scale).collect();
        // A sector of planes is counted from its first.
        let first_deg = full.c_deg()[0];
        let radians = |angles: &[f64], from: f64| angles.iter().map(|a| (a - from).to_radians()).collect::<Vec<_>>();
        let (mut c_rad, gamma_rad) = (radians(full.c_deg(), first_deg), radians(full.gamma_deg(), 0.0));
        let mut planes: Vec<&[f64]> = candela.chunks(gamma_rad.len()).collect();
        if c_rad.len() == 2 && !full.is_native() {
            // An axial table has one plane: quarter turns keep its cells from wrapping round a pole.
            c_rad = (0..=4).map(|k| f64::from(k) * FRAC_PI_2).collect();
            planes = vec![planes[0]; 5];
        }
        let candela = planes.concat();
        let own_frame = full.own_frame() * DMat3::from_rotation_z(first_deg.to_radians());
        let (position_m, orientation) = (luminaire.position_m, luminaire.orientation * own_frame);
        Self { position_m, orientation, c_rad, gamma_rad, candela }
    }

    /// A line of constant C through a cell, at a parameter from 0 to 1.
    pub(super) fn row(&self, cell: &Cell, s: f64) -> Row {
        let c = cell.c.0 + s * (cell.c.1 - cell.c.0);
        let (sin_c, cos_c) = c.sin_cos();
        let (low, high) = (cell.lower.at_turn((sin_c, cos_c)), cell.upper.at_turn((sin_c, cos_c)));
        let (i, j) = cell.piece;
        let (c0, c1) = (self.c_rad[i], self.c_rad[i + 1]);
        let (g0, g1) = (self.gamma_rad[j], self.gamma_rad[j + 1]);
        let along_c = (c - c0) / (c1 - c0);
        let candela = [0, 1].map(|dj| {
            let at = |di: usize| self.candela[(i + di) * self.gamma_rad.len() + j + dj];
            at(0) + along_c * (at(1) - at(0))
        });
        let slope = (candela[1] - candela[0]) / (g1 - g0);
        let measure = (cell.c.1 - cell.c.0) * (high - low);
        let across = self.orientation * DVec3::new(cos_c, sin_c, 0.0);
        Row { low, high, across, axis: self.orientation.z_axis, candela: candela[0], from: g0, slope, measure }
    }

    /// Lines through a cell at the nodes of a rule in two ranges of its parameters, each a start and a length.
    #[inline(always)]
    pub(super) fn rows<const N: usize>(&self, cell: &Cell, s: (f64, f64), t: (f64, f64), rule: &Padded<N>) -> Rows<N> {
        let none = [0.0; N];
        let mut rows = Rows {
            half: none,
            sin: none,
            cos: none,
            sin_c: none,
            cos_c: none,
            flux: none,
            slope: none,
            orientation: self.orientation,
        };
        let turn = cell.c.1 - cell.c.0;
        let half_c = 0.5 * s.1 * turn;
        let middle_c = cell.c.0 + s.0 * turn + half_c;
        let (sin, cos) = middle_c.sin_cos();
        for k in 0..N {
            let (sin_x, cos_x) = series(half_c * rule.nodes[k]);
            rows.sin_c[k] = sin * cos_x + cos * sin_x;
            rows.cos_c[k] = cos * cos_x - sin * sin_x;
        }
        let [low, high] = [cell.lower, cell.upper].map(|curve| curve.at_turns(&rows.sin_c, &rows.cos_c));
        let (i, j) = cell.piece;
        let (c0, c1) = (self.c_rad[i], self.c_rad[i + 1]);
        let (g0, g1) = (self.gamma_rad[j], self.gamma_rad[j + 1]);
        let at = |di: usize, dj: usize| self.candela[(i + di) * self.gamma_rad.len() + j + dj];
        let (from, gain) = ([at(0, 0), at(0, 1)], [at(1, 0) - at(0, 0), at(1, 1) - at(0, 1)]);
        for k in 0..N {
            let along_c = (middle_c - c0 + half_c * rule.nodes[k]) / (c1 - c0);
            let candela = [from[0] + along_c * gain[0], from[1] + along_c * gain[1]];
            let slope = (candela[1] - candela[0]) / (g1 - g0);
            let length = high[k] - low[k];
            let half = 0.5 * t.1 * length;
            let middle = low[k] + t.0 * length + half;
            let weight = turn * length * s.1 * t.1;
            rows.half[k] = half;
            rows.flux[k] = weight * (candela[0] + (middle - g0) * slope);
            rows.slope[k] = weight * slope;
            let (sin, cos) = series(middle - FRAC_PI_2);
            (rows.sin[k], rows.cos[k]) = (cos, -sin);
        }
        rows
    }

    /// The pieces of the table that carry light.
    pub(super) fn lit_pieces(&self) -> Vec<(usize, usize)> {
        let all = (0..self.gamma_rad.len() - 1).flat_map(|j| (0..self.c_rad.len() - 1).map(move |i| (i, j)));
        all.filter(|piece| !self.is_dark(*piece)).collect()
    }

    /// The cells, out of some pieces of the table by rising gamma, that make up a convex polygon as the luminaire sees it.
    pub(super) fn cells(&self, polygon_m: &[DVec3], pieces: &[(usize, usize)]) -> Vec<Cell> {
        let outline = Outline::new(self, polygon_m);
        let mut cells: Vec<Cell> = vec![];
        for of_band in pieces.chunk_by(|a, b| a.1 == b.1) {
            let j = of_band[0].1;
            let band = (self.gamma_rad[j], self.gamma_rad[j + 1]);
            let breaks = outline.breaks(band);
            for &(i, _) in of_band {
                let turn = (self.c_rad[i], self.c_rad[i + 1]);
                let mut cuts = vec![turn.0];
                cuts.extend(breaks.iter().copied().filter(|c| *c > turn.0 + SAME_ANGLE && *c < turn.1 - SAME_ANGLE));
                cuts.push(turn.1);
                for c in cuts.windows(2) {
                    let Some((lower, upper)) = outline.bounds(0.5 * (c[0] + c[1]), band) else { continue };
                    let cell = Cell { c: (c[0], c[1]), lower, upper, piece: (i, j) };
                    match cells.last_mut() {
                        Some(last) if cell.continues(last) => last.c.1 = c[1],
                        _ => cells.push(cell),
                    }
                }
            }
        }
        cells
    }

    fn is_dark(&self, (i, j): (usize, usize)) -> bool {
        let gammas = self.gamma_rad.len();
        [i, i + 1].iter().all(|i| self.candela[i * gammas + j..=i * gammas + j + 1].iter().all(|v| *v == 0.0))
    }
}

/// The same table with no more than a quarter turn between its planes, which keeps its cells from wrapping round a pole.
fn quartered(table: LuminousIntensityDistribution) -> LuminousIntensityDistribution {
    let between = |c: &[f64]| {
        let (from, to) = (c[0], c[1]);
        let parts = ((to - from) / 90.0 - SAME_ANGLE).ceil().max(1.0);
        (0..parts as usize).map(move |k| from + (to - from) * k as f64 / parts)
    };
    let planes = table.c_deg();
    let c_deg: Vec<f64> = planes.windows(2).flat_map(between).chain(planes.last().copied()).collect();
    // Planes between those of a table change nothing in it.
    table.resampled(c_deg, table.gamma_deg().to_vec()).map_or(table, |same| same.distribution)
}

/// A convex polygon seen from a luminaire: great circles in the luminaire's frame, normals pointing inwards.
struct Outline {
    normals: Vec<DVec3>,
    /// Azimuths of the corners.
    corners: Vec<f64>,
}

impl Outline {
    fn new(frame: &LuminaireFrame, polygon_m: &[DVec3]) -> Self {
        let to_local = frame.orientation.transpose();
        let local: Vec<DVec3> = polygon_m.iter().map(|p| to_local * (p - frame.position_m)).collect();
        let centre = local.iter().sum::<DVec3>();
        let mut normals = vec![];
        for (k, a) in local.iter().enumerate() {
            let b = local[(k + 1) % local.len()];
            let Some(m) = a.cross(b).try_normalize() else { continue };
            let mut m = if m.dot(centre) < 0.0 { -m } else { m };
            // A plane through the poles, but for rounding.
            if m.z.abs() < 1e-14 {
                m.z = 0.0;
            }
            normals.push(m);
        }
        let corners = local.iter().map(|p| wrap(p.y.atan2(p.x))).collect();
        Self { normals, corners }
    }

    /// Azimuths where the gamma bounds of a band change their formula, sorted.
    fn breaks(&self, band: (f64, f64)) -> Vec<f64> {
        let mut breaks = self.corners.clone();
        for m in &self.normals {
            let (foot, radius) = (m.y.atan2(m.x), m.x.hypot(m.y));
            // Where the circle comes closest to a pole, then where it crosses either gamma.
            breaks.extend([wrap(foot), wrap(foot + PI)]);
            if m.z == 0.0 {
                breaks.extend([wrap(foot + FRAC_PI_2), wrap(foot - FRAC_PI_2)]);
                continue;
            }
            for gamma in [band.0, band.1] {
                let cosine = m.z * gamma.cos() / (gamma.sin() * radius);
                if cosine.abs() <= 1.0 {
                    breaks.extend([wrap(foot + cosine.acos()), wrap(foot - cosine.acos())]);
                }
            }
        }
        breaks.sort_by(f64::total_cmp);
        breaks.dedup_by(|a, b| *a - *b < SAME_ANGLE);
        breaks
    }

    /// The curves that bound gamma at an azimuth, within a band; `None` where nothing is left.
    fn bounds(&self, c: f64, band: (f64, f64)) -> Option<(Curve, Curve)> {
        let (mut lower, mut upper) = ((band.0, Curve::Constant(band.0)), (band.1, Curve::Constant(band.1)));
        for &m in &self.normals {
            let curve = Curve::GreatCircle(m);
            if m.z == 0.0 {
                if m.x * c.cos() + m.y * c.sin() < 0.0 {
                    return None;
                }
                continue;
            }
            let gamma = curve.at(c);
            if m.z > 0.0 && gamma > lower.0 {
                lower = (gamma, curve);
            } else if m.z < 0.0 && gamma < upper.0 {
                upper = (gamma, curve);
            }
        }
        (upper.0 - lower.0 > SAME_ANGLE).then_some((lower.1, upper.1))
    }
}

/// An azimuth within 0..2π.
fn wrap(c: f64) -> f64 {
    let c = c.rem_euclid(TAU);
    if c >= TAU { 0.0 } else { c }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn series_are_sine_cosine_and_arc_tangent_to_the_last_digits() {
        for k in 0..=1000 {
            let x = FRAC_PI_2 * (f64::from(k) / 500.0 - 1.0);
            let (sin, cos) = series(x);
            assert!((sin - x.sin()).abs() < 4e-16 && (cos - x.cos()).abs() < 4e-16, "{x}: {sin} {cos}");
            let (y, x) = (PI * f64::from(k) / 1000.0).sin_cos();
            assert!((angle(y, x) - y.atan2(x)).abs() < 1e-15, "{y} {x}: {}", angle(y, x));
        }
    }
}
