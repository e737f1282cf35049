//! Flat lights of `UsdLux` for a flat luminous opening, and the profiles that give them its candela.
//!
//! Source: `OpenUSD` 26.11, `UsdLux`: a profile scales the luminance of a light. A flat light of luminance L and area A has
//! the luminous intensity A L cos(gamma), and shines to one side. So a profile here is the intensity divided by the cosine,
//! and an opening that shines up and down becomes two lights.

use glam::{DMat3, DVec3};
use itertools::Itertools as _;
use luxproof_photometry::{LuminousIntensityDistribution, LuminousOpening, Photometry, Symmetry, lm63};
use luxproof_scene::{Luminaire, LuminaireModel};

/// The last angle where the intensity is divided by the cosine; at 90 degrees the light has none, whatever its profile says.
const LAST_GAMMA_DEG: f64 = 89.9;
/// The widest step in gamma. The importer multiplies a profile by the cosine in the same steps.
const GAMMA_STEP_DEG: f64 = 1.0;
/// How far the product of a cosine and a straight line between two nodes may be from the intensity, relative.
const MAX_BEND: f64 = 2e-4;
/// A loss of flux below this share is rounding.
const NO_LOSS: f64 = 1e-9;

/// The shape of a flat light, in metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum FlatShape {
    Rectangle { x_m: f64, y_m: f64 },
    Disk { radius_m: f64 },
}

impl FlatShape {
    /// The shape of a luminaire that is a flat area.
    pub(crate) fn of(luminaire: &Luminaire) -> Option<Self> {
        match luminaire.photometry.opening {
            _ if luminaire.model == LuminaireModel::Point => None,
            LuminousOpening::Box { x_m, y_m, height_m: 0.0 } if x_m > 0.0 && y_m > 0.0 => {
                Some(Self::Rectangle { x_m, y_m })
            }
            LuminousOpening::Ellipse { x_m, y_m, height_m: 0.0 } if x_m == y_m && x_m > 0.0 => {
                Some(Self::Disk { radius_m: 0.5 * x_m })
            }
            _ => None,
        }
    }
}

/// The half space that a light shines to, in the luminaire's frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Side {
    Down,
    Up,
}

impl Side {
    /// What turns a light that shines along -z to this side.
    pub(crate) fn turn(self) -> DMat3 {
        match self {
            Self::Down => DMat3::IDENTITY,
            Self::Up => DMat3::from_diagonal(DVec3::new(1.0, -1.0, -1.0)),
        }
    }

    /// A direction of the light in the luminaire's angles. Half a turn about x mirrors both of them.
    fn luminaire_angles_deg(self, c_deg: f64, gamma_deg: f64) -> (f64, f64) {
        match self {
            Self::Down => (c_deg, gamma_deg),
            Self::Up => (360.0 - c_deg, 180.0 - gamma_deg),
        }
    }
}

/// The flat lights of a luminaire.
pub(crate) struct FlatLights {
    /// The sides that shine, each with its LM-63 file. The lower side is there if none shines.
    pub(crate) profiles: Vec<(Side, Vec<u8>)>,
    /// What they lose, one sentence each.
    pub(crate) losses: Vec<String>,
}

/// Divides the intensities of a luminaire by the cosine of gamma, for each side that shines.
pub(crate) fn flat_lights(photometry: &Photometry) -> FlatLights {
    let in_type_c = photometry.distribution.in_type_c();
    let (table, full_lm) = (&in_type_c.distribution, photometry.distribution.flux().value());
    let mut lights = FlatLights { profiles: vec![], losses: vec![] };
    if in_type_c.largest_error_cd > 0.0 {
        let (error_cd, share) = (in_type_c.largest_error_cd, 100.0 * in_type_c.misled_share);
        lights.losses.push(format!(
            "its table becomes one of type C: an intensity differs by up to {error_cd:.3} cd, and {share:.3} % of the flux \
             are misdirected"
        ));
    }
    let mut kept_lm = 0.0;
    for side in [Side::Down, Side::Up] {
        let nodes = Nodes::of(table, side);
        // What a reader makes of the profile: the intensity at each node, and none at 90 degrees.
        let Some(seen) = nodes.tabulate(|c, gamma| {
            let (c, own_gamma) = side.luminaire_angles_deg(c, gamma);
            if gamma < 90.0 { table.intensity(c, own_gamma).value() } else { 0.0 }
        }) else {
            continue;
        };
        let flux_lm = seen.flux().value();
        if flux_lm > 0.0 || (side == Side::Down && full_lm == 0.0) {
            kept_lm += flux_lm;
            lights.profiles.extend(nodes.profile(table, side, photometry).map(|bytes| (side, bytes)));
        }
    }
    let lost_lm = table.flux().value() - kept_lm;
    if lost_lm > NO_LOSS * full_lm {
        let level = table.full_circle().c_deg().iter().map(|c| table.intensity(*c, 90.0).value()).fold(0.0, f64::max);
        lights.losses.push(format!(
            "a flat light of UsdLux has no light at gamma 90: the intensity there, up to {level:.4} cd, becomes 0, and \
             falls to it from {LAST_GAMMA_DEG} degrees on: {lost_lm:.3e} of {full_lm:.6} lm"
        ));
    }
    lights
}

/// The angles of a profile.
struct Nodes {
    c_deg: Vec<f64>,
    gamma_deg: Vec<f64>,
}

impl Nodes {
    fn of(table: &LuminousIntensityDistribution, side: Side) -> Self {
        let is_mirrored = matches!(table.symmetry(), Symmetry::Axial | Symmetry::Quadrant | Symmetry::BilateralC0);
        let c_deg: Vec<f64> = match side {
            Side::Up if !is_mirrored => table.c_deg().iter().map(|c| 360.0 - c).rev().collect(),
            Side::Up | Side::Down => table.c_deg().to_vec(),
        };
        let own_gamma = table.gamma_deg().iter().map(|gamma| side.luminaire_angles_deg(0.0, *gamma).1);
        let mut gamma_deg: Vec<f64> = own_gamma.collect();
        // Beyond its ends a table is dark at once.
        let low = gamma_deg.iter().copied().fold(f64::INFINITY, f64::min);
        let high = gamma_deg.iter().copied().fold(0.0, f64::max);
        gamma_deg.retain(|gamma| *gamma < LAST_GAMMA_DEG);
        gamma_deg.extend(gamma_steps_deg().into_iter().filter(|gamma| (low..=high).contains(gamma)));
        gamma_deg.sort_by(f64::total_cmp);
        gamma_deg.dedup();
        Self { c_deg, gamma_deg }
    }

    fn tabulate(&self, candela: impl Fn(f64, f64) -> f64) -> Option<LuminousIntensityDistribution> {
        let pairs = self.c_deg.iter().cartesian_product(&self.gamma_deg);
        let values = pairs.map(|(c, gamma)| candela(*c, *gamma)).collect();
        LuminousIntensityDistribution::new(self.c_deg.clone(), self.gamma_deg.clone(), values).ok()
    }

    /// The LM-63 file of a side.
    fn profile(&self, table: &LuminousIntensityDistribution, side: Side, photometry: &Photometry) -> Option<Vec<u8>> {
        let distribution = self.tabulate(|c, gamma| {
            // The value at 90 counts for nothing: the last one goes on, so that a reader which smooths sees no step.
            let gamma = gamma.min(LAST_GAMMA_DEG);
            let (c, own_gamma) = side.luminaire_angles_deg(c, gamma);
            table.intensity(c, own_gamma).value() / gamma.to_radians().cos()
        })?;
        let about = "Profile of a flat UsdLux light: candela divided by the cosine of gamma. By luxproof.";
        let keywords = vec![("OTHER".to_owned(), about.to_owned())];
        let profile = Photometry { opening: photometry.opening, keywords, ..Photometry::of(distribution) };
        Some(lm63::write_2002(&profile).text.into_bytes())
    }
}

/// Whole degrees, and between them finer steps where the inverse of the cosine bends: it bends by (1 + sin^2) / cos^2 of
/// itself, and a straight line misses an eighth of that times the square of the step. Then the last angle, and 90.
fn gamma_steps_deg() -> Vec<f64> {
    let mut all = vec![];
    for k in 0..90 {
        let from_deg = GAMMA_STEP_DEG * f64::from(k);
        let to_deg = (from_deg + GAMMA_STEP_DEG).min(LAST_GAMMA_DEG);
        let (sin, cos) = to_deg.to_radians().sin_cos();
        let step_deg = (cos * (8.0 * MAX_BEND / (1.0 + sin * sin)).sqrt()).to_degrees();
        let parts = ((to_deg - from_deg) / step_deg).ceil().max(1.0) as u32;
        all.extend((0..parts).map(|part| from_deg + (to_deg - from_deg) * f64::from(part) / f64::from(parts)));
    }
    all.extend([LAST_GAMMA_DEG, 90.0]);
    all
}
