//! The furnace: a closed room of one reflectance, with a known mean of reflected light, and the error of that mean.

use std::f64::consts::PI;

use glam::DVec3;
use itertools::Itertools;
use luxproof_photometry::direction;
use luxproof_scene::geometry::configuration_factor::element_to_polygon;
use luxproof_scene::geometry::{Reflectances, Room, Surface};
use luxproof_scene::{Bounces, Luminaire, Meter, Transport};
use luxproof_simulator::quadrature::Gauss;

use super::{Against, Variant};
use luxproof_engines::{Job, Sensor};
use luxproof_model::MeterId;

/// The distance of meters from the surfaces, relative to the room's smallest extent.
const METER_OFFSET: f64 = 1e-4;
/// Quadrature nodes along each side of a surface.
const NODES: usize = 6;
/// Patches along each side of a surface, which collect the direct light.
const PATCHES: usize = 20;
/// Steps of the rays in C and gamma, in degrees.
const STEP_DEG: [f64; 2] = [6.0, 1.5];
/// The smallest depth of a room, in patches: in a flatter one light varies within a patch.
const MIN_DEPTH_PATCHES: f64 = 1.5;
/// The safety factor of the quadrature's estimated error.
const ERROR_FACTOR: f64 = 2.0;
/// The smallest relative error, since patches are coarser than the light.
const MIN_RELATIVE_ERROR: f64 = 1.5e-3;

/// The job in a room of one reflectance, with meters on all six surfaces; `None` for a room that is too flat.
///
/// The surfaces absorb all emitted light. The mean of reflected light over the area is thus flux x rho / (area x (1 -
/// rho)), and that of n reflections the first n terms of the series. Each reflection makes light more even, so the
/// quadrature is at least as good for all reflections as for the first.
pub(super) fn furnace(mut job: Job, rho: f64) -> Option<Variant> {
    let size_m = job.scene.room?.size_m;
    if size_m.min_element() < MIN_DEPTH_PATCHES * size_m.max_element() / PATCHES as f64 {
        return None;
    }
    let room = Room { size_m, reflectance: Reflectances::with_equal_walls(rho, rho, rho) };
    job.scene.room = Some(room);
    let Transport::Indirect(bounces) = job.transport else { return None };
    // The share of the reflections that the job follows.
    let followed = match bounces {
        Bounces::Converged => 1.0,
        Bounces::AtMost(n) => 1.0 - rho.powf(f64::from(n)),
    };
    let area_m2 = room.whole_area_m2();
    let (rule, mut sensors, mut weights) = (Gauss::new(NODES), vec![], vec![]);
    for surface in Surface::ALL {
        let (corners, normal) = (room.corners(surface), surface.inward_normal());
        let (u, v) = (corners[1] - corners[0], corners[3] - corners[0]);
        for (x, wx) in rule.points().map(towards_edge) {
            for (y, wy) in rule.points().map(towards_edge) {
                let at = corners[0] + x * u + y * v;
                let meter = Meter { position_m: at + METER_OFFSET * size_m.min_element() * normal, normal };
                sensors.push(Sensor { id: MeterId::new(surface.name(), sensors.len()), meter });
                weights.push(wx * wy * room.area_m2(surface) / area_m2);
            }
        }
    }
    let luminaires = job.scene.luminaires.iter();
    let flux_lm: f64 = luminaires.map(|l| l.photometry.distribution.flux().value() * l.flux_scale).sum();
    job.sensors = sensors;
    let value_lx = flux_lm * rho / (area_m2 * (1.0 - rho)) * followed;
    Some(Variant { job, against: Against::Mean { weights, value_lx } })
}

/// The relative error of the weighted mean over a furnace's sensors, against the mean over its surfaces.
pub fn error_of_mean(job: &Job, weights: &[f64]) -> f64 {
    let once = job.scene.room.map(|room| error_of_once_reflected(&room, &job.scene.luminaires, &job.sensors, weights));
    ERROR_FACTOR * once.unwrap_or(0.0) + MIN_RELATIVE_ERROR
}

/// Moves a node towards the nearer edge, where reflected light is least smooth: x becomes 3 x^2 - 2 x^3.
fn towards_edge((x, weight): (f64, f64)) -> (f64, f64) {
    (x * x * (3.0 - 2.0 * x), 6.0 * x * (1.0 - x) * weight)
}

/// The relative error of the weighted mean over the sensors, for light that is reflected once.
///
/// Every patch has the mean illuminance by the luminaires, and the light from patches to sensors is exact.
fn error_of_once_reflected(room: &Room, luminaires: &[Luminaire], sensors: &[Sensor], weights: &[f64]) -> f64 {
    let mut flux_lm = vec![[[0.0; PATCHES]; PATCHES]; Surface::ALL.len()];
    for luminaire in luminaires {
        for (direction, lm) in rays(luminaire) {
            let (surface, [u, v]) = first_patch(room, luminaire.position_m, direction);
            flux_lm[surface][v][u] += lm;
        }
    }
    let total_lm: f64 = flux_lm.as_flattened().as_flattened().iter().sum();
    if total_lm <= 0.0 {
        return 0.0;
    }
    let mut patches = vec![];
    for (surface, flux_lm) in Surface::ALL.iter().zip(&flux_lm) {
        let corners = room.corners(*surface);
        let [u, v] = [corners[1] - corners[0], corners[3] - corners[0]].map(|edge| edge / PATCHES as f64);
        let patch_m2 = room.area_m2(*surface) / (PATCHES * PATCHES) as f64;
        for (k, row) in flux_lm.iter().enumerate() {
            for (j, lm) in row.iter().enumerate().filter(|(_, lm)| **lm > 0.0) {
                let at = corners[0] + j as f64 * u + k as f64 * v;
                patches.push((*surface, lm / patch_m2, [at, at + u, at + u + v, at + v]));
            }
        }
    }
    let per_surface = sensors.len() / Surface::ALL.len();
    let mut mean = 0.0;
    for (own_surface, (sensors, weights)) in
        Surface::ALL.iter().zip(sensors.chunks(per_surface).zip(weights.chunks(per_surface)))
    {
        for ((sensor, weight), (_, exitance, patch)) in
            sensors.iter().zip(weights).cartesian_product(patches.iter().filter(|(surface, ..)| surface != own_surface))
        {
            mean += weight * exitance * element_to_polygon(sensor.meter.position_m, sensor.meter.normal, patch);
        }
    }
    (mean * room.whole_area_m2() / total_lm - 1.0).abs()
}

/// Directions in the room, each with the flux that a luminaire emits around it, in lumens.
fn rays(luminaire: &Luminaire) -> Vec<(DVec3, f64)> {
    let table = &luminaire.photometry.distribution;
    let [c_step, gamma_step] = STEP_DEG;
    let even = (0..=(180.0 / gamma_step) as u32).map(|k| f64::from(k) * gamma_step);
    // The table's angles are zone limits, too, so that a narrow beam between them is not missed.
    let zones: Vec<f64> = even.chain(table.gamma_deg().iter().copied()).sorted_by(f64::total_cmp).dedup().collect();
    let count = (360.0 / c_step) as u32;
    let mut all = vec![];
    for (from, to) in zones.into_iter().tuple_windows().filter(|(from, to)| *from >= 0.0 && *to <= 180.0) {
        let zone_sr = 2.0 * PI * (from.to_radians().cos() - to.to_radians().cos()) / f64::from(count);
        for k in 0..count {
            let towards = luminaire.orientation * direction((f64::from(k) + 0.5) * c_step, 0.5 * (from + to));
            let lm = luminaire.intensity_towards(towards).value() * zone_sr;
            if lm > 0.0 {
                all.push((towards, lm));
            }
        }
    }
    all
}

/// The index of the surface that a ray from inside a room meets first, and the patch on it.
fn first_patch(room: &Room, from_m: DVec3, towards: DVec3) -> (usize, [usize; 2]) {
    let distances = Surface::ALL.map(|surface| distance_to(room, surface, from_m, towards));
    let nearest = distances.iter().position_min_by(|a, b| a.total_cmp(b)).unwrap_or(0);
    let corners = room.corners(Surface::ALL[nearest]);
    let hit = from_m + distances[nearest] * towards - corners[0];
    let patch = [corners[1] - corners[0], corners[3] - corners[0]].map(|edge| {
        let position = hit.dot(edge) / edge.length_squared();
        ((position * PATCHES as f64) as usize).min(PATCHES - 1)
    });
    (nearest, patch)
}

/// The distance of a surface along a ray; infinite where the ray leaves from it.
fn distance_to(room: &Room, surface: Surface, from_m: DVec3, towards: DVec3) -> f64 {
    let axis = surface.axis();
    let plane = if surface.is_far() { room.size_m[axis] } else { 0.0 };
    let distance = (plane - from_m[axis]) / towards[axis];
    if towards.dot(surface.inward_normal()) < 0.0 { distance.max(0.0) } else { f64::INFINITY }
}
