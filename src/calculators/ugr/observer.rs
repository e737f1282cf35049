//! The rating of an observer in a scene: what the luminous openings in view make of a background that something else tells.
//!
//! CIE 117-1995, equation 1, for any room, place and line of sight. An opening has its mean luminance towards the eye, as in the table,
//! and the position of its centre. It counts where that is in the table of positions (above the line of sight, or on it) and no obstacle
//! hides it.

use std::f64::consts::PI;

use glam::DVec3;

use super::position_index;
use crate::calculators::inverse_square::blocks;
use crate::photometry::{NoLuminance, angles_deg};
use crate::scene::{Luminaire, Meter, Scene};
use crate::units::Lux;

/// Openings no smaller and no larger than this, in steradians, are what the rating is of (CIE 117-1995).
pub const SOLID_ANGLES_SR: std::ops::RangeInclusive<f64> = 3e-4..=1e-1;

/// Nearer to the line of sight's plane than this, in parts of the distance along it, a centre is in it.
const LEVEL: f64 = 1e-9;
/// The sine of the least angle between a line of sight and the vertical.
const UPRIGHT: f64 = 1e-6;

/// What openings in view add to a rating.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Glare {
    /// Sum of L^2 w / p^2, in (cd/m2)^2 sr.
    pub sum: f64,
    /// How many openings count.
    pub openings: usize,
    /// The smallest and the largest of them, in steradians.
    pub solid_angles_sr: [f64; 2],
}

/// Why there is nothing to rate.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum NoGlare {
    /// Nothing is above or beside such a line of sight.
    #[error("looks straight up or down, and positions are told by what is above and beside the line of sight")]
    Upright,
    /// No opening counts.
    #[error("sees no luminous opening: none shines on it from before it, from the line of sight's height or above")]
    NothingSeen,
    /// A point has no luminance.
    #[error("sees `{0}`, whose photometric file gives no luminous area")]
    NoArea(String),
}

impl Glare {
    /// What an eye sees that looks as its meter does.
    pub fn seen(scene: &Scene, eye: &Meter) -> Result<Self, NoGlare> {
        let ahead = eye.normal;
        let above = DVec3::Z.reject_from_normalized(ahead);
        if above.length() < UPRIGHT {
            return Err(NoGlare::Upright);
        }
        let above = above.normalize();
        let mut found = Self { sum: 0.0, openings: 0, solid_angles_sr: [f64::INFINITY, 0.0] };
        for luminaire in &scene.luminaires {
            let from_eye = luminaire.position_m - eye.position_m;
            let Some(index) = index(from_eye, ahead, above) else { continue };
            if scene.obstacles.iter().any(|obstacle| blocks(obstacle, eye.position_m, luminaire.position_m)) {
                continue;
            }
            let Some((luminance, solid_angle_sr)) = opening(luminaire, -from_eye)? else { continue };
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

/// The position index of a place before an eye.
fn index(from_eye_m: DVec3, ahead: DVec3, above: DVec3) -> Option<f64> {
    let along_m = from_eye_m.dot(ahead);
    if along_m <= 0.0 {
        return None;
    }
    let [aside, up] = [ahead.cross(above), above].map(|way| from_eye_m.dot(way) / along_m);
    position_index(aside, if up.abs() < LEVEL { 0.0 } else { up })
}

/// Mean luminance in cd/m2 and solid angle of an opening towards a place this far from its centre; `None` where it is dark or edge on.
fn opening(luminaire: &Luminaire, towards_m: DVec3) -> Result<Option<(f64, f64)>, NoGlare> {
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
