//! Where scene coordinates lie: near the origin and of a handy size, so that POV-Ray's absolute tolerances do no harm.
//!
//! POV-Ray ignores what is nearer than 1e-4 to a ray's start and takes 1e-3 for nothing near a shadow ray's
//! (`MIN_ISECT_DEPTH`, `SHADOW_TOLERANCE`); its radiosity measures distances from the camera.

use std::collections::HashMap;

use glam::{DVec3, I64Vec3};
use luminaire::geometry::Surface;
use luminaire::scene::{Luminaire, LuminaireModel, Shape};

use super::settings::Settings;
use crate::engines::Job;
use crate::engines::settings::Coordinates;

/// From metres of the spec to units of the scene: (p - centre) scale.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Frame {
    /// The spec's point that becomes the origin.
    pub(super) centre_m: DVec3,
    /// Scene units a metre; intensities grow with its square, so that lux stay lux.
    pub(super) scale: f64,
    /// Units of the scene's light a lux: 1 unless lux are so many or so few that POV-Ray would cut them off.
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
        let handy = (1.0..=200.0).contains(&size_m) || size_m <= 0.0;
        // Meters that need room for their discs get it by the scale of everything else.
        let free =
            seats(job, metres).iter().zip(&job.stations).all(|(seat, s)| *seat == metres.point(s.meter.position_m));
        // The filters round the lights of an opening would stand in each other's light towards its plane.
        let is_sparse = job.scene.luminaires.iter().all(|l| l.model == LuminaireModel::Point);
        if handy && free && is_sparse {
            metres
        } else {
            Self { centre_m, scale: LARGE / size_m.max(f64::MIN_POSITIVE), light }
        }
    }

    pub(super) fn point(self, p_m: DVec3) -> DVec3 {
        (p_m - self.centre_m) * self.scale
    }

    pub(super) fn metres(self, point: DVec3) -> DVec3 {
        point / self.scale + self.centre_m
    }
}

/// Extent in units of a scene that is scaled, so large that POV-Ray's absolute tolerances and ours vanish in it.
const LARGE: f64 = 1000.0;

/// Illuminances that POV-Ray's bounds of brightness do no harm to, in lux.
const HANDY_LX: std::ops::RangeInclusive<f64> = 1e-3..=1e6;

/// A power of ten that brings the illuminance to be expected across a scene near 1; 1 where it is handy as it is.
///
/// POV-Ray drops what is dimmer than `adc_bailout` and loses reflected light of 1e9 lx.
fn light(job: &Job, size_m: f64) -> f64 {
    let candela: f64 = job.scene.luminaires.iter().map(candela).sum();
    let expected_lx = candela / (size_m * size_m);
    let handy = HANDY_LX.contains(&expected_lx) || !(expected_lx.is_normal());
    if handy { 1.0 } else { 10_f64.powi(-(expected_lx.log10().round() as i32)) }
}

/// The largest intensity, flux scale included.
pub(super) fn candela(luminaire: &Luminaire) -> f64 {
    luminaire.photometry.distribution.max_intensity().value() * luminaire.flux_scale
}

fn extent_m(job: &Job) -> (DVec3, DVec3) {
    let meters = job.stations.iter().map(|s| s.meter.position_m);
    let luminaires = job.scene.luminaires.iter().map(|l| l.position_m);
    let start = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    let (low, high) = meters.chain(luminaires).fold(start, |(low, high), p| (low.min(p), high.max(p)));
    if low.is_finite() { (low, high) } else { (DVec3::ZERO, DVec3::ZERO) }
}

/// Where each disc sits, in scene units: at its meter, but clear of a surface that the meter lies on and of discs that
/// cross it.
pub(super) fn seats(job: &Job, frame: Frame) -> Vec<DVec3> {
    let points: Vec<DVec3> = job.stations.iter().map(|s| frame.point(s.meter.position_m)).collect();
    let normal = |k: usize| job.stations[k].meter.normal;
    let (mut crosses, mut behind) = (vec![false; points.len()], 0.0_f64);
    // Each of two crossing discs lies a little behind its own meter, all equally: another's front comes after it, and
    // another's back, which is transparent, before it, by more than POV-Ray's least distance between hits.
    for (j, k, sine) in crossings(job, frame) {
        (crosses[j], crosses[k]) = (true, true);
        behind = behind.max(4.0 * AIM / sine);
    }
    let seat = |k: usize| match crosses[k] {
        _ if on_a_surface(job, frame, points[k]) => points[k] + CLEAR * normal(k),
        true => points[k] - behind * normal(k),
        false => points[k],
    };
    (0..points.len()).map(seat).collect()
}

/// How far a disc is lifted off a surface.
const CLEAR: f64 = 2e-5;
/// How far a ray may pass a disc's centre: the aim's triangles are kept in single precision, here up to 500 units from
/// the origin. A front turned by t then seems nearer by t `AIM`, while it lies t^2/2 of the distance behind further off.
const AIM: f64 = 3e-5;
/// Sine of the angle below which two discs are one.
const PARALLEL: f64 = 1e-9;
/// Sine of the angle below which crossing discs would have to lie further behind their meters than they may.
const NARROW: f64 = 0.05;
/// Discs nearer than this to each other may cross.
const REACH: f64 = 5e-3;

/// The pairs of meters whose discs may hide one another, and the sine of the angle between them: 1 where they face away from
/// each other, as a back hides nothing, but stands off from a front like any other.
fn crossings(job: &Job, frame: Frame) -> impl Iterator<Item = (usize, usize, f64)> {
    let mut cells: HashMap<I64Vec3, Vec<usize>> = HashMap::new();
    (0..job.stations.len()).flat_map(move |k| {
        let seat = |k: usize| (frame.point(job.stations[k].meter.position_m), job.stations[k].meter.normal);
        let (point, normal) = seat(k);
        let crossing = |&j: &usize| {
            let (other, facing) = seat(j);
            let sine = if facing.dot(normal) < 0.0 { 1.0 } else { facing.cross(normal).length() };
            (sine > PARALLEL && other.distance(point) < REACH).then_some((j, k, sine))
        };
        let cell = (point / REACH).floor().as_i64vec3();
        let around = (0..27).map(|n| cell.saturating_add(I64Vec3::new(n % 3, n / 3 % 3, n / 9) - 1));
        let found: Vec<_> = around.flat_map(|c| cells.get(&c).into_iter().flatten()).filter_map(crossing).collect();
        cells.entry(cell).or_default().push(k);
        found
    })
}

/// Two meters at one point that look nearly the same way: one's disc would be seen for the other's.
pub(super) fn narrow(job: &Job) -> Option<String> {
    let coordinates = Settings::of(job).map_or(Coordinates::Fitted, |s| s.coordinates);
    let (j, k, _) = crossings(job, Frame::of(job, coordinates)).find(|(.., sine)| *sine < NARROW)?;
    let why = "are at one point and nearly parallel, where POV-Ray's discs would hide one another";
    Some(format!("{} and {} {why}", job.stations[j].id, job.stations[k].id))
}

fn on_a_surface(job: &Job, frame: Frame, point: DVec3) -> bool {
    let near = |distance: f64| distance.abs() < CLEAR / 2.0;
    let on_room = job.scene.room.is_some_and(|room| {
        let (low, high) = (frame.point(DVec3::ZERO), frame.point(room.size_m));
        Surface::ALL.iter().any(|s| near(point[s.axis()] - if s.is_far() { high } else { low }[s.axis()]))
    });
    let on_box = |shape: &Shape| match shape {
        Shape::Box { min_m, max_m } => {
            let (low, high) = (frame.point(*min_m), frame.point(*max_m));
            let inside = point.cmpge(low - CLEAR).all() && point.cmple(high + CLEAR).all();
            inside && (0..3).any(|axis| near(point[axis] - low[axis]) || near(point[axis] - high[axis]))
        }
        Shape::Mesh { .. } => false,
    };
    on_room || job.scene.obstacles.iter().any(|o| on_box(&o.shape))
}
