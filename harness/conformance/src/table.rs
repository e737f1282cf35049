//! Tables of intensities by angles, and the directions of their angles.

use glam::DVec3;
use luxproof_photometry::{Goniometer, angles_deg};

use crate::closed_form::ClosedForm;

/// Angles within this distance are equal, in degrees: sines and cosines round them.
pub(crate) const SAME_DEG: f64 = 1e-7;
/// Decimals of the numbers of a table.
const DECIMALS: i32 = 3;

/// A table as a file contains it.
#[derive(Clone, Debug)]
pub(crate) struct Table {
    pub(crate) goniometer: Goniometer,
    pub(crate) vertical_deg: Vec<f64>,
    pub(crate) horizontal_deg: Vec<f64>,
    /// The numbers of the file, `[horizontal][vertical]`, before any factor.
    pub(crate) numbers: Vec<f64>,
}

/// How the stored planes stand for all azimuths.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum PlaneLayout {
    /// One plane for every azimuth.
    Single,
    /// From 0 to 90, mirrored twice.
    Quadrant,
    /// From 0 to 180, mirrored in C 0 - C 180.
    Half,
    /// From `first` over 180 degrees, mirrored in C 90 - C 270: 90 to 270, or -90 to 90.
    HalfAboutC90,
    /// From 0 to 360.
    Full,
    /// A sector of types A and B; dark beyond.
    Sector,
    /// The half from 0 on of a sector of types A and B, mirrored in H 0.
    MirroredSector,
}

impl Table {
    /// Tabulates a function; a number times `factor` is an intensity in candela.
    pub(crate) fn tabulate(
        goniometer: Goniometer,
        horizontal_deg: &[f64],
        vertical_deg: &[f64],
        form: ClosedForm,
        factor: f64,
    ) -> Self {
        let mut numbers = vec![];
        for h in horizontal_deg {
            let row = vertical_deg.iter().map(|v| form.intensity_cd(direction_of(goniometer, *h, *v)));
            numbers.extend(row.map(|candela| round_to(candela / factor, DECIMALS)));
        }
        Self { goniometer, vertical_deg: vertical_deg.to_vec(), horizontal_deg: horizontal_deg.to_vec(), numbers }
    }

    /// How its planes stand for all azimuths.
    pub(crate) fn layout(&self) -> PlaneLayout {
        let (first, last) = (self.horizontal_deg[0], self.horizontal_deg[self.horizontal_deg.len() - 1]);
        match (self.goniometer, first, last) {
            (Goniometer::A | Goniometer::B, 0.0, _) => PlaneLayout::MirroredSector,
            (Goniometer::A | Goniometer::B, ..) => PlaneLayout::Sector,
            (Goniometer::C, ..) => Self::layout_of_type_c(first, last),
        }
    }

    /// The layout that a reader of type C takes these ends for.
    pub(crate) fn layout_of_type_c(first: f64, last: f64) -> PlaneLayout {
        match (first, last) {
            (0.0, 0.0) => PlaneLayout::Single,
            (0.0, 90.0) => PlaneLayout::Quadrant,
            (0.0, 180.0) => PlaneLayout::Half,
            (90.0, 270.0) | (-90.0, 90.0) => PlaneLayout::HalfAboutC90,
            _ => PlaneLayout::Full,
        }
    }

    /// The rows of the file: one a horizontal angle.
    pub(crate) fn rows(&self) -> impl Iterator<Item = &[f64]> {
        self.numbers.chunks(self.vertical_deg.len())
    }

    /// The largest number of the file.
    pub(crate) fn max(&self) -> f64 {
        self.numbers.iter().copied().fold(0.0, f64::max)
    }

    /// The part of a type C table up to gamma 90, which is a node or beyond its end.
    pub(crate) fn below_horizon(&self) -> Self {
        let below = self.vertical_deg.iter().take_while(|gamma| **gamma <= 90.0).count();
        let numbers = self.rows().flat_map(|row| row[..below].iter().copied()).collect();
        Self { vertical_deg: self.vertical_deg[..below].to_vec(), numbers, ..self.clone() }
    }

    /// Fluxes per unit of the numbers, in steradians times the unit: least, bilinear and most of what an interpolation
    /// can make of the nodes, over the stored planes alone and over all directions.
    pub(crate) fn solid_integral(&self) -> SolidIntegral {
        let (planes, verticals) = (self.horizontal_deg.len(), self.vertical_deg.len());
        let mut stored = SolidIntegral::default();
        let layout = self.layout();
        // The polar angle, in which the solid angle is not even, lies along V of types C and A and along H of type B.
        let polar_of = |h: f64, v: f64| match self.goniometer {
            Goniometer::C => (h, v),
            Goniometer::A => (h, v + 90.0),
            Goniometer::B => (v, h + 90.0),
        };
        let spans = if layout == PlaneLayout::Single { 1 } else { planes - 1 };
        for h in 0..spans {
            let next = if layout == PlaneLayout::Single { h } else { h + 1 };
            let ends_h = if layout == PlaneLayout::Single {
                [0.0, 360.0]
            } else {
                [self.horizontal_deg[h], self.horizontal_deg[next]]
            };
            for v in 0..verticals - 1 {
                let corner = |h: usize, v: usize| self.numbers[h * verticals + v];
                let corners = [corner(h, v), corner(h, v + 1), corner(next, v), corner(next, v + 1)];
                let (a, p) = polar_of(ends_h[0], self.vertical_deg[v]);
                let (b, q) = polar_of(ends_h[1], self.vertical_deg[v + 1]);
                let [low, high] = if self.goniometer == Goniometer::B {
                    [0.5 * (corners[0] + corners[1]), 0.5 * (corners[2] + corners[3])]
                } else {
                    [0.5 * (corners[0] + corners[2]), 0.5 * (corners[1] + corners[3])]
                };
                let width = (b - a).to_radians();
                let solid = width * (p.to_radians().cos() - q.to_radians().cos());
                stored.linear += width * integrate_linear(p.to_radians(), q.to_radians(), low, high);
                stored.least += solid * corners.into_iter().fold(f64::INFINITY, f64::min);
                stored.most += solid * corners.into_iter().fold(0.0, f64::max);
            }
        }
        stored.copies = match layout {
            PlaneLayout::Single | PlaneLayout::Full | PlaneLayout::Sector => 1.0,
            PlaneLayout::Half | PlaneLayout::HalfAboutC90 | PlaneLayout::MirroredSector => 2.0,
            PlaneLayout::Quadrant => 4.0,
        };
        stored
    }
}

/// Integrals over the stored planes, and how often these fit into all directions.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct SolidIntegral {
    pub(crate) least: f64,
    pub(crate) linear: f64,
    pub(crate) most: f64,
    pub(crate) copies: f64,
}

/// The integral of a linear function, `low` at `a` and `high` at `b`, times the sine, from `a` to `b` in radians.
fn integrate_linear(a: f64, b: f64, low: f64, high: f64) -> f64 {
    let slope = (high - low) / (b - a);
    low * a.cos() - high * b.cos() + slope * (b.sin() - a.sin())
}

/// The direction of a table's own angles in the frame of the luminaire: x at C 0, y at C 90, z up.
///
/// LM-63-2002, section 3: H of types A and B runs clockwise seen from above; H 0 V 0 of type A is the horizon at C 0, and
/// of type B the nadir.
pub(crate) fn direction_of(goniometer: Goniometer, h_deg: f64, v_deg: f64) -> DVec3 {
    match goniometer {
        Goniometer::C => luxproof_photometry::direction(h_deg, v_deg),
        Goniometer::A => luxproof_photometry::direction(-h_deg, 90.0 + v_deg),
        Goniometer::B => {
            let ((sin_h, cos_h), (sin_v, cos_v)) = (h_deg.to_radians().sin_cos(), v_deg.to_radians().sin_cos());
            DVec3::new(cos_h * sin_v, -sin_h, -cos_h * cos_v)
        }
    }
}

/// The table's own angles H and V of a direction; C and gamma of type C.
pub(crate) fn own_angles_deg(goniometer: Goniometer, direction: DVec3) -> (f64, f64) {
    let (c, gamma) = angles_deg(direction);
    match goniometer {
        Goniometer::C => (c, gamma),
        Goniometer::A => (if c > 180.0 + SAME_DEG { 360.0 - c } else { -c }, gamma - 90.0),
        Goniometer::B => {
            let across = direction.x.hypot(direction.z);
            // At the ends of the axis every V is the same direction.
            let v = if across < 1e-12 { 0.0 } else { direction.x.atan2(-direction.z).to_degrees() };
            ((-direction.y).atan2(across).to_degrees(), v)
        }
    }
}

/// A number rounded to decimals.
pub(crate) fn round_to(value: f64, decimals: i32) -> f64 {
    let scale = 10f64.powi(decimals);
    // Adding zero turns minus zero into zero.
    (value * scale).round() / scale + 0.0
}
