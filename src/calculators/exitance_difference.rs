//! Infinite plane - exitance difference (IP-ED): indirect illuminance of points on a work plane.
//!
//! `E(P) = M_w + C(P) (M_cc - M_w)`: an infinite plane of the walls' exitance, plus the exitance difference times the
//! configuration factor of the ceiling cavity's opening seen from P. Exitances come from the zonal cavity method with
//! the cavity planes at the luminaires and at the point's own height. After the IES Lighting Handbook's indirect point
//! method; the form was identified from a published table that it reproduces (reference/published/cachet.yaml).

use glam::DVec3;

use super::inverse_square;
use super::zonal_cavity::{Cavity, CavityReflectances, Coefficients, ZonalFlux, coefficients};
use super::zonal_multiplier::ZonalMultipliers;
use super::{Calculated, NotApplicable, Validity};
use crate::geometry::configuration_factor::element_to_parallel_rectangle;
use crate::geometry::{Room, Surface};
use crate::photometry::direction;
use crate::scene::{Luminaire, Meter, Scene};
use crate::units::{Lumen, LumenPerSquareMetre, Lux};

/// Indirect illuminance, all reflections, of a meter that faces up.
pub fn indirect_illuminance(scene: &Scene, meter: &Meter) -> Result<Calculated, NotApplicable> {
    if meter.normal.dot(DVec3::Z) < 1.0 - 1e-9 {
        return Err(refuse("the meter does not face straight up; the method knows work planes only"));
    }
    let exitances = Exitances::of(scene, meter.position_m.z)?;
    let room = exitances.room;
    if !room.contains(meter.position_m, 0.0) {
        return Err(refuse("the meter lies outside the room"));
    }
    let factor = ceiling_factor(&room, exitances.luminaire_height_m, meter.position_m);
    let walls = exitances.walls.value();
    let illuminance = Lux(walls + factor * (exitances.ceiling_cavity.value() - walls));
    Ok(Calculated { illuminance, validity: Validity::from_objections(&exitances.objections) })
}

/// Direct by inverse square plus indirect by IP-ED.
pub fn total_illuminance(scene: &Scene, meter: &Meter) -> Result<Calculated, NotApplicable> {
    let indirect = indirect_illuminance(scene, meter)?;
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

const METHOD: &str = "infinite plane - exitance difference method";

fn refuse(reason: impl Into<String>) -> NotApplicable {
    NotApplicable { method: METHOD, reason: reason.into() }
}

/// The zonal cavity solution that IP-ED rests on, for one height of work plane.
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
    /// Flux of all luminaires.
    pub flux: Lumen,
    /// Mean height of the luminaires in metres, where the ceiling cavity begins.
    pub luminaire_height_m: f64,
    /// Assumptions of the method that this scene does not meet.
    pub objections: Vec<String>,
    room: Room,
}

impl Exitances {
    /// Zonal cavity solution for a work plane at `work_plane_m` above the floor.
    pub fn of(scene: &Scene, work_plane_m: f64) -> Result<Self, NotApplicable> {
        let room = scene.room.ok_or_else(|| refuse("the scene has no room"))?;
        if Surface::ALL.iter().all(|s| room.reflectance.of(*s) == 0.0)
            && scene.obstacles.iter().any(|o| o.reflectance > 0.0)
        {
            return Err(refuse("only bodies reflect, the room does not; the method knows surfaces of the room alone"));
        }
        let height = luminaire_height(scene, work_plane_m, &room)?;
        let zonal = scene.luminaires.iter().map(zonal_flux).fold(ZonalFlux([0.0; 18]), |sum, one| sum.plus(&one));
        let flux = zonal.down_lm() + zonal.up_lm();
        let (width, length) = (room.size_m.x, room.size_m.y);
        let walls = mean_wall_reflectance(&room);
        let cavity = |depth_m: f64| Cavity::lm57(super::zonal_cavity::cavity_ratio(width, length, depth_m));
        let (room_cavity, ceiling, floor) =
            (cavity(height - work_plane_m), cavity(room.size_m.z - height), cavity(work_plane_m));
        let reflectances = CavityReflectances {
            ceiling_cavity: ceiling.effective_reflectance(room.reflectance.ceiling, walls),
            walls,
            floor_cavity: floor.effective_reflectance(room.reflectance.floor, walls),
        };
        let coefficients = coefficients(&zonal, flux, &room_cavity, &reflectances, &ZonalMultipliers::LM57)
            .map_err(|error| refuse(error.to_string()))?;
        let per_area = flux / (width * length);
        Ok(Self {
            ceiling_cavity: LumenPerSquareMetre(coefficients.ceiling_cavity_exitance * per_area),
            walls: LumenPerSquareMetre(coefficients.wall_exitance * per_area),
            work_plane: Lux(coefficients.utilization * per_area),
            cavity_ratios: [room_cavity.ratio, ceiling.ratio, floor.ratio],
            reflectances,
            coefficients,
            flux: Lumen(flux),
            luminaire_height_m: height,
            objections: objections(scene, &room, height, work_plane_m),
            room,
        })
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

/// Mean height of the luminaires, all of which must hang above the work plane and inside the room.
fn luminaire_height(scene: &Scene, work_plane_m: f64, room: &Room) -> Result<f64, NotApplicable> {
    if scene.luminaires.is_empty() {
        return Err(refuse("the scene has no luminaire"));
    }
    for luminaire in &scene.luminaires {
        if !room.contains(luminaire.position_m, 0.0) {
            return Err(refuse(format!("`{}` lies outside the room", luminaire.id)));
        }
        if luminaire.position_m.z <= work_plane_m {
            return Err(refuse(format!(
                "`{}` hangs at {} m, not above the meter at {work_plane_m} m: there is no room cavity between them",
                luminaire.id, luminaire.position_m.z
            )));
        }
    }
    let heights = scene.luminaires.iter().map(|luminaire| luminaire.position_m.z);
    Ok(heights.sum::<f64>() / scene.luminaires.len() as f64)
}

/// Zonal flux of a luminaire as it hangs, flux scale included.
pub fn zonal_flux(luminaire: &Luminaire) -> ZonalFlux {
    let distribution = &luminaire.photometry.distribution;
    if (luminaire.orientation * DVec3::Z).dot(DVec3::Z) > 1.0 - 1e-12 {
        return ZonalFlux::of(distribution).scaled(luminaire.flux_scale);
    }
    // Tilted: the luminaire's planes no longer fit the room's zones. Sum over directions of the room.
    let (planes, bands_a_zone) = (360, 40);
    ZonalFlux(std::array::from_fn(|zone| {
        let step = 10.0 / f64::from(bands_a_zone);
        (0..bands_a_zone)
            .map(|band| {
                let low = 10.0 * zone as f64 + step * f64::from(band);
                let solid = low.to_radians().cos() - (low + step).to_radians().cos();
                let around = (0..planes).map(|plane| {
                    let towards = direction(f64::from(plane) + 0.5, low + 0.5 * step);
                    luminaire.intensity_towards(towards).value()
                });
                std::f64::consts::TAU * solid * around.sum::<f64>() / f64::from(planes)
            })
            .sum()
    }))
}

/// Mean of the wall reflectances, each weighted with its length.
fn mean_wall_reflectance(room: &Room) -> f64 {
    let r = &room.reflectance;
    let (x, y) = (room.size_m.x, room.size_m.y);
    ((r.wall_x_min + r.wall_x_max) * y + (r.wall_y_min + r.wall_y_max) * x) / (2.0 * (x + y))
}

/// Luminaires further apart than this times their height above the work plane do not light it evenly.
///
/// The usual upper end of spacing criteria (IES Lighting Handbook: 1.5 for wide distributions).
const SPACING_CRITERION: f64 = 1.5;

fn objections(scene: &Scene, room: &Room, height_m: f64, work_plane_m: f64) -> Vec<String> {
    let mut found = vec![];
    let count = scene.luminaires.len();
    let spacing_m = (room.size_m.x * room.size_m.y / count as f64).sqrt();
    let allowed_m = SPACING_CRITERION * (height_m - work_plane_m);
    if spacing_m > allowed_m {
        found.push(format!(
            "{count} luminaire(s) for {spacing_m:.1} m of spacing where even light needs at most {allowed_m:.1} m: \
             the method spreads their flux evenly"
        ));
    }
    let spread = scene.luminaires.iter().map(|l| (l.position_m.z - height_m).abs()).fold(0.0, f64::max);
    if spread > 1e-9 {
        found.push(format!("luminaires hang up to {spread:.2} m from their mean height, where the method puts them"));
    }
    let r = &room.reflectance;
    let walls = [r.wall_x_min, r.wall_x_max, r.wall_y_min, r.wall_y_max];
    if walls.iter().any(|wall| *wall != walls[0]) {
        found.push("the walls differ in reflectance; the method takes their mean".into());
    }
    if !scene.obstacles.is_empty() {
        found.push(format!("{} obstacle(s) are left out", scene.obstacles.len()));
    }
    found
}

#[cfg(test)]
#[path = "exitance_difference_tests.rs"]
pub(crate) mod tests;
