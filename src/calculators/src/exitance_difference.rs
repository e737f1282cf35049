//! Infinite plane - exitance difference (IP-ED): indirect illuminance of points on a work plane.
//!
//! `E(P) = M_w + C(P) (M_cc - M_w)`: an infinite plane of the walls' exitance, plus the exitance difference times the
//! configuration factor of the ceiling cavity's opening seen from P. Exitances come from the zonal cavity method with
//! the cavity planes at the luminaires and at the point's own height. After the IES Lighting Handbook's indirect point
//! method; the form was identified from a published table that it reproduces (reference/published/cachet.yaml).

use glam::DVec3;

use super::layers::refuse;
pub use super::layers::{Exitances, Layers};
pub use super::room_flux::{RoomFluxes, zonal_flux};
use super::{Calculated, NotApplicable, Validity, inverse_square};
use luxproof_photometry::units::Lux;
use luxproof_scene::geometry::Room;
use luxproof_scene::geometry::configuration_factor::element_to_parallel_rectangle;
use luxproof_scene::{Meter, Scene};

/// Indirect illuminance, all reflections, of a meter that faces up. For many meters of a scene, make [`Layers`] once.
pub fn indirect_illuminance(scene: &Scene, meter: &Meter) -> Result<Calculated, NotApplicable> {
    Layers::of(scene)?.indirect_illuminance(meter)
}

/// Direct by inverse square plus indirect by IP-ED.
pub fn total_illuminance(scene: &Scene, meter: &Meter) -> Result<Calculated, NotApplicable> {
    Layers::of(scene)?.total_illuminance(scene, meter)
}

impl Layers {
    /// Indirect illuminance, all reflections, of a meter that faces up.
    pub fn indirect_illuminance(&self, meter: &Meter) -> Result<Calculated, NotApplicable> {
        if meter.normal.dot(DVec3::Z) < 1.0 - 1e-9 {
            return Err(refuse("the meter does not face straight up; the method knows work planes only"));
        }
        if !self.room.contains(meter.position_m, 0.0) {
            return Err(refuse("the meter lies outside the room"));
        }
        let work_plane_m = meter.position_m.z;
        let exitances = self.exitances(work_plane_m)?;
        let illuminance = Lux(exitances.iter().map(|solved| self.illuminance_of_layer(solved, meter)).sum());
        let mut objections = self.objections.clone();
        objections.extend(self.unevenness(work_plane_m));
        Ok(Calculated { illuminance, validity: Validity::from_objections(&objections) })
    }

    /// The indirect illuminance of a meter by the luminaires at one height.
    fn illuminance_of_layer(&self, solved: &Exitances, meter: &Meter) -> f64 {
        let factor = ceiling_factor(&self.room, solved.luminaire_height_m, meter.position_m);
        let walls = solved.walls.value();
        walls + factor * (solved.ceiling_cavity.value() - walls)
    }

    /// Direct by inverse square plus indirect by IP-ED, in the scene of these layers.
    pub fn total_illuminance(&self, scene: &Scene, meter: &Meter) -> Result<Calculated, NotApplicable> {
        let indirect = self.indirect_illuminance(meter)?;
        let direct = inverse_square::direct_illuminance(scene, meter)?;
        let mut objections = vec![];
        for part in [&direct, &indirect] {
            if let Validity::Approximate(why) = &part.validity {
                objections.push(why.clone());
            }
        }
        let illuminance = direct.illuminance + indirect.illuminance;
        Ok(Calculated { illuminance, validity: Validity::from_objections(&objections) })
    }
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
