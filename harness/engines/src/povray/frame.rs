//! Scene coordinates for POV-Ray: near the origin and of a suitable size, so that its absolute tolerances do no harm.
//!
//! POV-Ray ignores hits nearer than 1e-4 to a ray's start, and nearer than 1e-3 for shadow rays (`MIN_ISECT_DEPTH`,
//! `SHADOW_TOLERANCE`). Its radiosity measures distances from the camera.

use std::collections::HashMap;

use glam::{DVec3, I64Vec3};
use luxproof_scene::geometry::Surface;
use luxproof_scene::{Luminaire, LuminaireModel, Shape};

use super::settings::Settings;
use crate::Job;
use crate::settings::Coordinates;

/// The map from metres of the spec to units of the scene: (p - centre) scale.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Frame {
    /// The spec's point that becomes the origin.
    pub(super) centre_m: DVec3,
    /// Scene units per metre. Intensities grow with its square, so that lux stay lux.
    pub(super) scale: f64,
    /// Units of the scene's light per lux: 1 unless POV-Ray would cut off such bright or dim light.
    pub(super) light: f64,
}

impl Frame {
    pub(super) fn of(job: &Job, coordinates: Coordinates) -> Self {
        if coordinates == Coordinates::Raw {
            return Self { centre_m: DVec3::ZERO, scale: 1.0, light: 1.0 };
        }
        let (low, high) = match job.scene.room {
            Some(room) => (DVec3::ZERO, room.size_m),
            None => extent_m(job),
        };
        let size_m = (high - low).max_element();
        let centre_m = low.midpoint(high);
        let light = light(job, size_m);
        let metres = Self { centre_m, scale: 1.0, light };
        let is_suitable = (1.0..=200.0).contains(&size_m) || size_m <= 0.0;
        // If discs need more space, the whole scene is scaled up.
        let discs_are_free = disc_positions(job, metres)
            .iter()
            .zip(&job.sensors)
            .all(|(disc, s)| *disc == metres.point(s.meter.position_m));
        // Filters about the lights of an opening would absorb each other's light towards its plane.
        let has_only_points = job.scene.luminaires.iter().all(|l| l.model == LuminaireModel::Point);
        if is_suitable && discs_are_free && has_only_points {
            metres
        } else {
            Self { centre_m, scale: SCALED_EXTENT / size_m.max(f64::MIN_POSITIVE), light }
        }
    }

    pub(super) fn point(self, p_m: DVec3) -> DVec3 {
        (p_m - self.centre_m) * self.scale
    }

    pub(super) fn metres(self, point: DVec3) -> DVec3 {
        point / self.scale + self.centre_m
    }
}

/// Extent in units of a scaled scene. It is so large that POV-Ray's absolute tolerances and ours are negligible.
const SCALED_EXTENT: f64 = 1000.0;

/// Illuminances in lux that POV-Ray's limits of brightness do not affect.
const SUITABLE_LX: std::ops::RangeInclusive<f64> = 1e-3..=1e6;

/// Returns a power of ten that brings the expected illuminance across a scene near 1, or 1 if it is suitable already.
///
/// POV-Ray drops light that is dimmer than `adc_bailout` and loses reflected light of 1e9 lx.
fn light(job: &Job, size_m: f64) -> f64 {
    let candela: f64 = job.scene.luminaires.iter().map(candela).sum();
    let expected_lx = candela / (size_m * size_m);
    let is_suitable = SUITABLE_LX.contains(&expected_lx) || !(expected_lx.is_normal());
    if is_suitable { 1.0 } else { 10_f64.powi(-(expected_lx.log10().round() as i32)) }
}

/// Returns the largest intensity of a luminaire, with its flux scale.
pub(super) fn candela(luminaire: &Luminaire) -> f64 {
    luminaire.photometry.distribution.max_intensity().value() * luminaire.flux_scale
}

/// Returns the corners of the box about all meters and luminaires.
fn extent_m(job: &Job) -> (DVec3, DVec3) {
    let meters = job.sensors.iter().map(|s| s.meter.position_m);
    let luminaires = job.scene.luminaires.iter().map(|l| l.position_m);
    let start = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    let (low, high) = meters.chain(luminaires).fold(start, |(low, high), p| (low.min(p), high.max(p)));
    if low.is_finite() { (low, high) } else { (DVec3::ZERO, DVec3::ZERO) }
}

/// Returns each disc's position in scene units: at its meter, but off a surface that the meter lies on and clear of discs that cross it.
pub(super) fn disc_positions(job: &Job, frame: Frame) -> Vec<DVec3> {
    let points: Vec<DVec3> = job.sensors.iter().map(|s| frame.point(s.meter.position_m)).collect();
    let (mut crosses, mut behind) = (vec![false; points.len()], 0.0_f64);
    // Two crossing discs both lie a little behind their meters, by the same distance. A ray then meets the other's front after its
    // own disc. It meets the other's back before, but a back is transparent and further off than POV-Ray's least distance of hits.
    for (j, k, sine) in crossings(job, frame) {
        (crosses[j], crosses[k]) = (true, true);
        behind = behind.max(4.0 * AIM / sine);
    }
    let mut disc_positions = vec![];
    for ((point, sensor), crosses) in points.into_iter().zip(&job.sensors).zip(crosses) {
        let normal = sensor.meter.normal;
        disc_positions.push(if on_a_surface(job, frame, point) {
            point + CLEAR * normal
        } else if crosses {
            point - behind * normal
        } else {
            point
        });
    }
    disc_positions
}

/// Distance of a disc from the surface that its meter lies on.
const CLEAR: f64 = 2e-5;
/// Largest distance between a ray and a disc's centre. POV-Ray stores the camera's triangles in single precision, here up to 500 units
/// from the origin. A front turned by t seems nearer by t `AIM`, while it lies t^2/2 of the distance behind further off.
const AIM: f64 = 3e-5;
/// Half the spacing of 32-bit floats at 1.
const EPSILON: f64 = 5.960_464_477_539_063e-8;
/// Sine of the angle below which two discs count as parallel.
const PARALLEL: f64 = 1e-9;
/// Sine of the angle below which crossing discs would have to lie further behind their meters than they may.
const NARROW: f64 = 0.05;
/// Discs nearer than this to each other may cross.
const REACH: f64 = 5e-3;

/// Returns how far from the centre of a disc at a point of the scene its ray may hit it.
pub(super) fn aim(point: DVec3) -> f64 {
    3f64.sqrt() * EPSILON * (point.abs().max_element() + 1.0)
}

/// Returns the pairs of meters with discs that may hide each other, and the sine of the angle between them.
///
/// The sine is 1 for meters that face away from each other: a back hides nothing, but must keep the distance of hits like a front.
fn crossings(job: &Job, frame: Frame) -> impl Iterator<Item = (usize, usize, f64)> {
    let mut cells: HashMap<I64Vec3, Vec<usize>> = HashMap::new();
    (0..job.sensors.len()).flat_map(move |k| {
        let cell = (frame.point(job.sensors[k].meter.position_m) / REACH).floor().as_i64vec3();
        // Discs that cross are in the same cell or in one of its 26 neighbours.
        let neighbours = (0..27).map(|n| cell.saturating_add(I64Vec3::new(n % 3, n / 3 % 3, n / 9) - 1));
        let candidates = neighbours.flat_map(|c| cells.get(&c).into_iter().flatten());
        let found: Vec<_> = candidates.filter_map(|j| Some((*j, k, crossing_sine(job, frame, *j, k)?))).collect();
        cells.entry(cell).or_default().push(k);
        found
    })
}

/// Returns the sine of the angle between two meters' discs if they may cross.
fn crossing_sine(job: &Job, frame: Frame, j: usize, k: usize) -> Option<f64> {
    let [one, other] = [k, j].map(|k| job.sensors[k].meter);
    let sine = if other.normal.dot(one.normal) < 0.0 { 1.0 } else { other.normal.cross(one.normal).length() };
    let distance = frame.point(other.position_m).distance(frame.point(one.position_m));
    (sine > PARALLEL && distance < REACH).then_some(sine)
}

/// Returns an objection if two meters are at one point and nearly parallel: a ray to one disc would hit the other.
pub(super) fn narrow(job: &Job) -> Option<String> {
    let coordinates = Settings::of(job).map_or(Coordinates::Fitted, |s| s.coordinates);
    let (j, k, _) = crossings(job, Frame::of(job, coordinates)).find(|(.., sine)| *sine < NARROW)?;
    let why = "are at one point and nearly parallel, where POV-Ray's discs would hide one another";
    Some(format!("{} and {} {why}", job.sensors[j].id, job.sensors[k].id))
}

/// Returns whether a point in scene units lies on a surface of the room or on a box.
fn on_a_surface(job: &Job, frame: Frame, point: DVec3) -> bool {
    let is_on_room = job.scene.room.is_some_and(|room| {
        let (low, high) = (frame.point(DVec3::ZERO), frame.point(room.size_m));
        Surface::ALL.iter().any(|s| touches(point[s.axis()] - if s.is_far() { high } else { low }[s.axis()]))
    });
    is_on_room || job.scene.obstacles.iter().any(|o| on_a_box(&o.shape, frame, point))
}

/// Returns whether a point in scene units lies on a box.
fn on_a_box(shape: &Shape, frame: Frame, point: DVec3) -> bool {
    match shape {
        Shape::Box { min_m, max_m } => {
            let (low, high) = (frame.point(*min_m), frame.point(*max_m));
            let is_inside = point.cmpge(low - CLEAR).all() && point.cmple(high + CLEAR).all();
            is_inside && (0..3).any(|axis| touches(point[axis] - low[axis]) || touches(point[axis] - high[axis]))
        }
        Shape::Mesh { .. } => false,
    }
}

/// Returns whether a distance to a surface is small enough for contact.
fn touches(distance: f64) -> bool {
    distance.abs() < CLEAR / 2.0
}
