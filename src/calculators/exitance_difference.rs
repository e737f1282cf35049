//! Infinite plane - exitance difference (IP-ED): indirect illuminance of points on a work plane.
//!
//! `E(P) = M_w + C(P) (M_cc - M_w)`: an infinite plane of the walls' exitance, plus the exitance difference times the
//! configuration factor of the ceiling cavity's opening seen from P. Exitances come from the zonal cavity method with
//! the cavity planes at the luminaires and at the point's own height. After the IES Lighting Handbook's indirect point
//! method; the form was identified from a published table that it reproduces (reference/published/cachet.yaml).

use glam::DVec3;

pub use super::layers::Layers;
pub use super::room_flux::zonal_flux;
use super::zonal_cavity::{CavityReflectances, Coefficients};
use super::{Calculated, NotApplicable};
use crate::geometry::Room;
use crate::geometry::configuration_factor::element_to_parallel_rectangle;
use crate::scene::{Meter, Scene};
use crate::units::{Lumen, LumenPerSquareMetre, Lux};

/// Indirect illuminance, all reflections, of a meter that faces up; for many meters of a scene keep its [`Layers`].
pub fn indirect_illuminance(scene: &Scene, meter: &Meter) -> Result<Calculated, NotApplicable> {
    Layers::of(scene)?.indirect_illuminance(meter)
}

/// Direct by inverse square plus indirect by IP-ED.
pub fn total_illuminance(scene: &Scene, meter: &Meter) -> Result<Calculated, NotApplicable> {
    Layers::of(scene)?.total_illuminance(scene, meter)
}

const METHOD: &str = "infinite plane - exitance difference method";

pub(super) fn refuse(reason: impl Into<String>) -> NotApplicable {
    NotApplicable { method: METHOD, reason: reason.into() }
}

/// The zonal cavity solution that IP-ED rests on, for luminaires at one height and one height of work plane.
#[derive(Clone, Debug, PartialEq)]
pub struct Exitances {
    /// Mean exitance of the ceiling cavity's opening, `M_cc`.
    pub ceiling_cavity: LumenPerSquareMetre,
    /// Mean exitance of the walls, `M_w`.
    pub walls: LumenPerSquareMetre,
    /// Mean illuminance of the work plane, direct and indirect.
    pub work_plane: Lux,
    /// Room, ceiling and floor cavity ratio: RCR, CCR, FCR.
    pub cavity_ratios: [f64; 3],
    /// Effective reflectances.
    pub reflectances: CavityReflectances,
    /// Coefficients by which flux over floor area is multiplied.
    pub coefficients: Coefficients,
    /// Flux of the luminaires.
    pub flux: Lumen,
    /// Their height in metres, where the ceiling cavity begins.
    pub luminaire_height_m: f64,
}

/// Configuration factor of the room's plan at `height_m`, seen from a point below that faces up.
pub fn ceiling_factor(room: &Room, height_m: f64, point_m: DVec3) -> f64 {
    let mut sum = 0.0;
    for a in [point_m.x, room.size_m.x - point_m.x] {
        for b in [point_m.y, room.size_m.y - point_m.y] {
            sum += element_to_parallel_rectangle(a, b, height_m - point_m.z);
        }
    }
    sum
}

#[cfg(test)]
#[path = "exitance_difference_tests.rs"]
pub(crate) mod tests;
