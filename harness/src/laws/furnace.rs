//! A closed room of one reflectance, whose mean of reflected light is known, and how well a few meters tell that mean.

use std::f64::consts::PI;

use glam::DVec3;
use itertools::Itertools;
use luminaire::geometry::configuration_factor::element_to_polygon;
use luminaire::geometry::{Reflectances, Room, Surface};
use luminaire::photometry::direction;
use luminaire::scene::{Bounces, Luminaire, Meter, Transport};
use luminaire::simulator::quadrature::Gauss;

use super::{Against, Variant};
use crate::engines::{Job, Station};
use crate::record::MeterId;

/// How far off the surfaces a furnace is read, in parts of the room.
const OFF: f64 = 1e-4;
/// Nodes along each side of a surface.
const NODES: usize = 6;
/// Patches along each side of a surface on which light straight from the luminaires is put.
const PATCHES: usize = 20;
/// Steps in C and gamma in which that light is sent out, in degrees.
const STEP_DEG: [f64; 2] = [6.0, 1.5];
/// A room less deep than so many patches keeps its light where it falls, finer than patches tell.
const DEEP: f64 = 1.5;
/// The quadrature's error is known to this factor, and no better than to a part of the reading: patches are coarser than light.
const FACTOR: f64 = 2.0;
const LEAST: f64 = 1.5e-3;

/// The job in its room painted alike all over, read on all six surfaces.
///
/// All that is emitted is absorbed in the end: the mean over the area of reflected light is flux x rho / (area x (1 - rho)), of n reflections
/// the first n terms of that series. Each reflection evens light out, so that the quadrature is as good for all as for the first at least.
/// Nothing is said of a room too flat for it.
pub(super) fn furnace(mut job: Job, rho: f64) -> Option<Variant> {
    let size_m = job.scene.room?.size_m;
    if size_m.min_element() < DEEP * size_m.max_element() / PATCHES as f64 {
        return None;
    }
    let room = Room { size_m, reflectance: Reflectances::with_equal_walls(rho, rho, rho) };
    job.scene.room = Some(room);
    let Transport::Indirect(bounces) = job.transport else { return None };
    // Of all reflections, so much by those that count.
    let counted = match bounces {
        Bounces::Converged => 1.0,
        Bounces::AtMost(n) => 1.0 - rho.powf(f64::from(n)),
    };
    let area_m2 = room.whole_area_m2();
    let (rule, mut stations, mut weights) = (Gauss::new(NODES), vec![], vec![]);
    for surface in Surface::ALL {
        let (corners, normal) = (room.corners(surface), surface.inward_normal());
        let (u, v) = (corners[1] - corners[0], corners[3] - corners[0]);
        for (x, wx) in rule.points().map(crowded) {
            for (y, wy) in rule.points().map(crowded) {
                let at = corners[0] + x * u + y * v;
                let meter = Meter { position_m: at + OFF * size_m.min_element() * normal, normal };
                stations.push(Station { id: MeterId::new(surface.name(), stations.len()), meter });
                weights.push(wx * wy * room.area_m2(surface) / area_m2);
            }
        }
    }
    let flux = |l: &Luminaire| l.photometry.distribution.flux().value() * l.flux_scale;
    let flux_lm: f64 = job.scene.luminaires.iter().map(flux).sum();
    job.stations = stations;
    let value_lx = flux_lm * rho / (area_m2 * (1.0 - rho)) * counted;
    Some(Variant { job, against: Against::Mean { weights, value_lx } })
}

/// How far off the weighted mean over a furnace's stations may be of the mean over its surfaces, relative.
pub fn error_of_mean(job: &Job, weights: &[f64]) -> f64 {
    let once = job.scene.room.map(|room| error_of_once_reflected(&room, &job.scene.luminaires, &job.stations, weights));
    FACTOR * once.unwrap_or(0.0) + LEAST
}

/// A node moved towards the nearer edge, where reflected light is least smooth: x becomes 3 x^2 - 2 x^3.
fn crowded((x, weight): (f64, f64)) -> (f64, f64) {
    (x * x * (3.0 - 2.0 * x), 6.0 * x * (1.0 - x) * weight)
}

/// How far off the weighted mean over the stations is for light that was reflected once, relative: every patch of the room is as bright as
/// the luminaires make it on the mean, and what stations see of patches is exact.
fn error_of_once_reflected(room: &Room, luminaires: &[Luminaire], stations: &[Station], weights: &[f64]) -> f64 {
    let mut flux_lm = vec![[[0.0; PATCHES]; PATCHES]; Surface::ALL.len()];
    for luminaire in luminaires {
        for (way, lm) in rays(luminaire) {
            let (surface, [u, v]) = landing(room, luminaire.position_m, way);
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
    let per_surface = stations.len() / Surface::ALL.len();
    let mut mean = 0.0;
    for (of, (stations, weights)) in
        Surface::ALL.iter().zip(stations.chunks(per_surface).zip(weights.chunks(per_surface)))
    {
        for ((station, weight), (_, exitance, patch)) in
            stations.iter().zip(weights).cartesian_product(patches.iter().filter(|(surface, ..)| surface != of))
        {
            mean += weight * exitance * element_to_polygon(station.meter.position_m, station.meter.normal, patch);
        }
    }
    (mean * room.whole_area_m2() / total_lm - 1.0).abs()
}

/// Directions in the room and the flux in lumens that a luminaire sends about each.
fn rays(luminaire: &Luminaire) -> Vec<(DVec3, f64)> {
    let table = &luminaire.photometry.distribution;
    let [c_step, gamma_step] = STEP_DEG;
    let even = (0..=(180.0 / gamma_step) as u32).map(|k| f64::from(k) * gamma_step);
    // A narrow beam lies between the table's own angles.
    let zones: Vec<f64> = even.chain(table.gamma_deg().iter().copied()).sorted_by(f64::total_cmp).dedup().collect();
    let count = (360.0 / c_step) as u32;
    let mut all = vec![];
    for (from, to) in zones.into_iter().tuple_windows().filter(|(from, to)| *from >= 0.0 && *to <= 180.0) {
        let zone_sr = 2.0 * PI * (from.to_radians().cos() - to.to_radians().cos()) / f64::from(count);
        for k in 0..count {
            let way = luminaire.orientation * direction((f64::from(k) + 0.5) * c_step, 0.5 * (from + to));
            let lm = luminaire.intensity_towards(way).value() * zone_sr;
            if lm > 0.0 {
                all.push((way, lm));
            }
        }
    }
    all
}

/// The surface, by its place among all, and the patch on it where a ray ends that starts in a room.
fn landing(room: &Room, from_m: DVec3, way: DVec3) -> (usize, [usize; 2]) {
    let reach = |surface: &Surface| {
        let axis = surface.axis();
        let plane = if surface.is_far() { room.size_m[axis] } else { 0.0 };
        let reach = (plane - from_m[axis]) / way[axis];
        if way.dot(surface.inward_normal()) < 0.0 { reach.max(0.0) } else { f64::INFINITY }
    };
    let nearest = Surface::ALL.iter().position_min_by(|a, b| reach(a).total_cmp(&reach(b))).unwrap_or(0);
    let surface = Surface::ALL[nearest];
    let corners = room.corners(surface);
    let at = from_m + reach(&surface) * way - corners[0];
    let along = |edge: DVec3| {
        let part = at.dot(edge) / edge.length_squared();
        ((part * PATCHES as f64) as usize).min(PATCHES - 1)
    };
    (nearest, [corners[1] - corners[0], corners[3] - corners[0]].map(along))
}
