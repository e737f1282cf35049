//! The coordinates that a renderer of 32-bit floats gets: the spec's own, or moved and scaled where these need that.

use glam::{DMat3, DVec3};
use luxproof_scene::Shape;

use super::Job;
use super::settings::Coordinates;

/// Farther from the origin than this, in scene sizes, a scene is moved there.
const FAR: f64 = 2.0;
/// Smaller than this, a scene is scaled up: Mitsuba starts secondary rays 9e-5 x (1 + coordinate) off a surface.
const SMALL_M: f64 = 2.0;
/// To at least this size.
const ENOUGH: f64 = 8.0;

/// scene = (world - origin) x scale. Intensities then grow by the square of the scale, so that lux stay lux.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Frame {
    /// The world point, in metres, that becomes the scene's origin.
    pub(super) origin_m: DVec3,
    /// Scene units a metre; a power of two, which loses no digit.
    pub(super) scale: f64,
}

impl Frame {
    pub(super) fn of(job: &Job, coordinates: Coordinates) -> Self {
        let raw = Self { origin_m: DVec3::ZERO, scale: 1.0 };
        let (Some((min_m, max_m)), Coordinates::Fitted) = (bounds_m(job), coordinates) else { return raw };
        let (centre_m, size_m) = (0.5 * (min_m + max_m), (max_m - min_m).max_element());
        let far = centre_m.abs().max_element() > FAR * size_m;
        let origin_m = if far { centre_m } else { DVec3::ZERO };
        let small = size_m > 0.0 && size_m < SMALL_M;
        let scale = if small { (ENOUGH / size_m).log2().ceil().exp2() } else { 1.0 };
        Self { origin_m, scale }
    }

    pub(super) fn to_scene(self, point_m: DVec3) -> DVec3 {
        (point_m - self.origin_m) * self.scale
    }

    /// What a scene file should say of coordinates that are not the spec's.
    pub(super) fn remark(self) -> Option<String> {
        let [x, y, z] = self.origin_m.to_array();
        let Self { scale, .. } = self;
        (self != Self { origin_m: DVec3::ZERO, scale: 1.0 }).then(|| {
            format!(
                "Here ({x}, {y}, {z}) m is the origin and a metre is {scale} units long, so that 32-bit floats resolve the scene;\n\
                 intensities carry the factor {}.",
                scale * scale
            )
        })
    }

    /// The rows of a rotation followed by a translation to `position_m`.
    pub(super) fn placed(&self, position_m: DVec3, orientation: DMat3) -> [[f64; 4]; 4] {
        let p = self.to_scene(position_m);
        let [x, y, z] = [0, 1, 2].map(|k| {
            let r = orientation.row(k);
            [plain(r.x), plain(r.y), plain(r.z), plain(p[k])]
        });
        [x, y, z, [0.0, 0.0, 0.0, 1.0]]
    }
}

/// A number whose rounding remainder of zero, and zero's sign, are left out.
pub(super) fn plain(x: f64) -> f64 {
    if x.abs() < 1e-15 { 0.0 } else { x }
}

fn bounds_m(job: &Job) -> Option<(DVec3, DVec3)> {
    let scene = &job.scene;
    let room = scene.room.iter().flat_map(|r| [DVec3::ZERO, r.size_m]);
    let obstacles = scene.obstacles.iter().flat_map(|o| match &o.shape {
        Shape::Box { min_m, max_m } => vec![*min_m, *max_m],
        Shape::Mesh { vertices_m, .. } => vertices_m.clone(),
    });
    let points = room.chain(obstacles).chain(scene.luminaires.iter().map(|l| l.position_m));
    let points = points.chain(job.sensors.iter().map(|s| s.meter.position_m));
    points.map(|p| (p, p)).reduce(|(low, high), (p, _)| (low.min(p), high.max(p)))
}
