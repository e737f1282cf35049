//! The rating of an observer in a scene, from the luminous openings in view and a given background.
//!
//! CIE 117-1995, equation 1, for any room, place and line of sight. An opening has its mean luminance towards the eye,
//! as in the table, and the position of its center. It counts where the table of positions has that position, on the
//! line of sight or above it, and where no obstacle hides it.

use std::f64::consts::PI;

use glam::DVec3;

use super::position_index;
use crate::inverse_square::blocks;
use luxproof_photometry::units::Lux;
use luxproof_photometry::{NoLuminance, angles_deg};
use luxproof_scene::{Luminaire, Meter, Scene};

/// The solid angles of openings for which the rating is valid, in steradians (CIE 117-1995).
pub const SOLID_ANGLES_SR: std::ops::RangeInclusive<f64> = 3e-4..=1e-1;

/// The largest height of a center over its distance at which it counts as level with the line of sight.
const MAX_LEVEL_SLOPE: f64 = 1e-9;
/// The sine of the smallest angle between a line of sight and the vertical.
const MIN_SINE_TO_VERTICAL: f64 = 1e-6;

/// The contribution of the openings in view to a rating.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Glare {
    /// Sum of L^2 w / p^2, in (cd/m2)^2 sr.
    pub sum: f64,
    /// The number of openings that count.
    pub openings: usize,
    /// The smallest and the largest of them, in steradians.
    pub solid_angles_sr: [f64; 2],
}

/// Why there is nothing to rate.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum NoGlare {
    /// The line of sight is vertical, so that no position is above it or to its side.
    #[error("looks straight up or down, and positions are defined above the line of sight and to its side")]
    Upright,
    /// No opening counts.
    #[error("sees no luminous opening: none shines on it from before it, from the line of sight's height or above")]
    NothingSeen,
    /// A point has no luminance.
    #[error("sees `{0}`, whose photometric file gives no luminous area")]
    NoArea(String),
}

impl Glare {
    /// The glare of an eye that looks along its meter's normal.
    pub fn seen(scene: &Scene, eye: &Meter) -> Result<Self, NoGlare> {
        let ahead = eye.normal;
        let above = DVec3::Z.reject_from_normalized(ahead);
        if above.length() < MIN_SINE_TO_VERTICAL {
            return Err(NoGlare::Upright);
        }
        let above = above.normalize();
        let mut found = Self { sum: 0.0, openings: 0, solid_angles_sr: [f64::INFINITY, 0.0] };
        for luminaire in &scene.luminaires {
            let from_eye = luminaire.position_m - eye.position_m;
            let Some(index) = index_at(from_eye, ahead, above) else { continue };
            if scene.obstacles.iter().any(|obstacle| blocks(obstacle, eye.position_m, luminaire.position_m)) {
                continue;
            }
            let Some((luminance, solid_angle_sr)) = opening_towards(luminaire, -from_eye)? else { continue };
            found.sum += (luminance / index).powi(2) * solid_angle_sr;
            found.openings += 1;
            let [least, most] = found.solid_angles_sr;
            found.solid_angles_sr = [least.min(solid_angle_sr), most.max(solid_angle_sr)];
        }
        if found.sum > 0.0 && found.sum.is_finite() { Ok(found) } else { Err(NoGlare::NothingSeen) }
    }
}

/// `UGR = 8 lg (.25 / L_b sum L^2 w / p^2)` with `L_b = E / pi`, by that sum and the indirect illuminance E of the eye.
pub fn rating(sum: f64, indirect: Lux) -> f64 {
    8.0 * (0.25 * PI * sum / indirect.value()).log10()
}

/// The position index of a place in front of an eye.
fn index_at(from_eye_m: DVec3, ahead: DVec3, above: DVec3) -> Option<f64> {
    let along_m = from_eye_m.dot(ahead);
    if along_m <= 0.0 {
        return None;
    }
    let [aside, up] = [ahead.cross(above), above].map(|way| from_eye_m.dot(way) / along_m);
    position_index(aside, if up.abs() < MAX_LEVEL_SLOPE { 0.0 } else { up })
}

/// Mean luminance in cd/m2 and solid angle of an opening, seen along this vector from its center.
///
/// `None` where the opening is dark or edge-on.
fn opening_towards(luminaire: &Luminaire, towards_m: DVec3) -> Result<Option<(f64, f64)>, NoGlare> {
    let intensity = luminaire.intensity_towards(towards_m).value();
    if intensity <= 0.0 {
        return Ok(None);
    }
    let (c_deg, gamma_deg) = angles_deg(luminaire.orientation.transpose() * towards_m);
    match luminaire.photometry.luminance_cd_per_m2(c_deg, gamma_deg) {
        Err(NoLuminance::Point) => Err(NoGlare::NoArea(luminaire.id.clone())),
        Err(NoLuminance::EdgeOn) => Ok(None),
        Ok(_) => {
            let area_m2 = luminaire.photometry.projected_area_m2(c_deg, gamma_deg);
            Ok(Some((intensity / area_m2, area_m2 / towards_m.length_squared())))
        }
    }
}
