//! Cells of a luminaire's directions: one bilinear piece of its table, within one convex polygon that it lights.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use glam::{DMat3, DVec3};

use crate::scene::Luminaire;

/// Angles closer than this are one, in radians.
const SAME_ANGLE: f64 = 1e-12;

/// A luminaire's frame and table in radians, written out over the full circle.
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
        match self {
            Self::Constant(gamma) => gamma,
            Self::GreatCircle(m) => {
                let across = m.x * c.cos() + m.y * c.sin();
                if m.z >= 0.0 { m.z.atan2(across) } else { (-m.z).atan2(-across) }
            }
        }
    }
}

impl Cell {
    /// Whether it goes on where another one ends, under the same bounds.
    fn continues(&self, before: &Self) -> bool {
        self.piece == before.piece && self.lower == before.lower && self.upper == before.upper && self.c.0 == before.c.1
    }
}

impl LuminaireFrame {
    pub(super) fn new(luminaire: &Luminaire) -> Self {
        let full = luminaire.photometry.distribution.full_circle();
        let candela: Vec<f64> =
            (0..full.c_deg().len()).flat_map(|c| full.plane(c)).map(|i| i * luminaire.flux_scale).collect();
        let radians = |angles: &[f64]| angles.iter().map(|a| a.to_radians()).collect::<Vec<_>>();
        let (mut c_rad, gamma_rad) = (radians(full.c_deg()), radians(full.gamma_deg()));
        let mut planes: Vec<&[f64]> = candela.chunks(gamma_rad.len()).collect();
        if c_rad.len() == 2 {
            // An axial table has one plane: quarter turns keep its cells from wrapping round a pole.
            c_rad = (0..=4).map(|k| f64::from(k) * FRAC_PI_2).collect();
            planes = vec![planes[0]; 5];
        }
        let candela = planes.concat();
        let (position_m, orientation) = (luminaire.position_m, luminaire.orientation);
        Self { position_m, orientation, c_rad, gamma_rad, candela }
    }

    /// The world direction at (s, t) of a cell, and the flux in lumens that a unit of s and t carries there.
    pub(super) fn direction(&self, cell: &Cell, s: f64, t: f64) -> (DVec3, f64) {
        let c = cell.c.0 + s * (cell.c.1 - cell.c.0);
        let (low, high) = (cell.lower.at(c), cell.upper.at(c));
        let gamma = low + t * (high - low);
        let ((sin_c, cos_c), (sin_g, cos_g)) = (c.sin_cos(), gamma.sin_cos());
        let local = DVec3::new(sin_g * cos_c, sin_g * sin_c, -cos_g);
        let flux = self.intensity(cell.piece, c, gamma) * sin_g * (cell.c.1 - cell.c.0) * (high - low);
        (self.orientation * local, flux)
    }

    fn intensity(&self, (i, j): (usize, usize), c: f64, gamma: f64) -> f64 {
        let (c0, c1) = (self.c_rad[i], self.c_rad[i + 1]);
        let (g0, g1) = (self.gamma_rad[j], self.gamma_rad[j + 1]);
        let (s, t) = ((c - c0) / (c1 - c0), (gamma - g0) / (g1 - g0));
        let at = |di: usize, dj: usize| self.candela[(i + di) * self.gamma_rad.len() + j + dj];
        let along = |di: usize| at(di, 0) + t * (at(di, 1) - at(di, 0));
        along(0) + s * (along(1) - along(0))
    }

    /// The cells that together make up a convex polygon as the luminaire sees it, without those that carry no light.
    pub(super) fn cells(&self, polygon_m: &[DVec3]) -> Vec<Cell> {
        let outline = Outline::new(self, polygon_m);
        let mut cells: Vec<Cell> = vec![];
        for j in 0..self.gamma_rad.len() - 1 {
            let band = (self.gamma_rad[j], self.gamma_rad[j + 1]);
            let breaks = outline.breaks(band);
            for i in 0..self.c_rad.len() - 1 {
                if self.is_dark((i, j)) {
                    continue;
                }
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
