//! The placement of meters' patches: their size, their directions and the space about them.

use glam::DVec3;
use itertools::Itertools;
use luxproof_scene::geometry::Surface;
use luxproof_scene::{LuminaireModel, Scene, Shape};

use crate::Job;
use crate::float_error::EPSILON;
use crate::frame::Frame;
use crate::settings::Preset;

/// Side of a meter's patch, in parts of the largest coordinate: at least forty times what 32-bit floats resolve there.
const PATCH: f64 = 5e-6;
/// Smallest side in scene units with a renderer's stock settings. There rays begin at a fixed distance off a surface, 1e-5 in LuxCore,
/// and a camera stands one side before its patch. With a smaller side it would see through the patch.
const STOCK_PATCH: f64 = 5e-5;
/// Distance in sides below which a surface is too near a meter.
const NEAR_SIDES: f64 = 4.0;
/// A patch with enough space is this many times as wide, as in `luxcore_read.py`: the rounding of its corners then tilts it less.
const WIDE: f64 = 64.0;
/// Largest tilt of a patch that is not wide, by the rounding of its corners: the sine of its plane to its normal.
const TILT: f64 = 4.0 * EPSILON / PATCH;

/// The space about a meter's patch.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Space {
    /// A surface is near, and the patch must stand off it.
    Tight,
    /// The patch may lie at the meter's exact point.
    Free,
    /// There is space for a wide patch.
    Wide,
}

impl Space {
    /// Returns the space about each meter of an exported job, for patches of this side in metres.
    pub(crate) fn of(job: &Job, side_m: f64) -> Vec<Self> {
        let is_tight = beside_a_surface(job, side_m);
        let is_narrow = beside_a_surface(job, WIDE * side_m);
        is_tight
            .into_iter()
            .zip(is_narrow)
            .map(|meter| match meter {
                (true, _) => Self::Tight,
                (false, true) => Self::Free,
                (false, false) => Self::Wide,
            })
            .collect()
    }

    /// Returns how much the rounding of its corners may tilt a patch.
    pub(super) const fn tilt(self) -> f64 {
        match self {
            Self::Tight | Self::Free => TILT,
            Self::Wide => TILT / WIDE,
        }
    }
}

/// Returns the side of a meter's patch in scene units.
pub(crate) fn patch(job: &Job, frame: &Frame, preset: Preset) -> f64 {
    let room = job.scene.room.iter().flat_map(|r| [DVec3::ZERO, r.size_m]);
    let points = room.chain(job.scene.luminaires.iter().map(|l| l.position_m));
    let points = points.chain(job.sensors.iter().map(|s| s.meter.position_m));
    let largest = points.map(|p| frame.to_scene(p).abs().max_element()).fold(0.0, f64::max);
    let side = PATCH * if largest > 0.0 { largest } else { 1.0 };
    if preset == Preset::Default { side.max(STOCK_PATCH) } else { side }
}

/// Returns the directions of a patch's sides, as in `Patches` of `cycles_read.py`.
pub(super) fn sides(normal: DVec3) -> [DVec3; 2] {
    let aside = if normal.x.abs() > 0.5 { DVec3::Y } else { DVec3::X };
    let along = aside.cross(normal).normalize_or_zero();
    [along, normal.cross(along)]
}

/// Returns for each meter whether a patch of this side must stand off a surface: of the room, a body, or a possible opening.
fn beside_a_surface(job: &Job, side_m: f64) -> Vec<bool> {
    let reach_m = NEAR_SIDES * side_m;
    let positions_m: Vec<DVec3> = job.sensors.iter().map(|s| s.meter.position_m).collect();
    let mut is_near: Vec<bool> = positions_m
        .iter()
        .map(|at| {
            is_near_the_room(&job.scene, *at, reach_m)
                || is_near_a_box(&job.scene, *at, reach_m)
                || is_near_an_opening(&job.scene, *at, reach_m)
        })
        .collect();
    // There may be a million triangles and many meters. So each triangle looks up the meters within its reach along x.
    let along_x: Vec<usize> =
        (0..is_near.len()).sorted_by(|a, b| positions_m[*a].x.total_cmp(&positions_m[*b].x)).collect();
    for obstacle in &job.scene.obstacles {
        let Shape::Mesh { vertices_m, triangles } = &obstacle.shape else { continue };
        for triangle in triangles {
            let [a, b, c] = triangle.map(|v| vertices_m[v as usize]);
            let (low, high) = (a.min(b).min(c), a.max(b).max(c));
            let first = along_x.partition_point(|k| positions_m[*k].x < low.x - reach_m);
            let near = along_x[first..].iter().take_while(|k| positions_m[**k].x <= high.x + reach_m);
            for k in near {
                is_near[*k] |= is_within(positions_m[*k], low, high, reach_m);
            }
        }
    }
    is_near
}

/// Returns whether a point is near a surface of the room.
fn is_near_the_room(scene: &Scene, at: DVec3, reach_m: f64) -> bool {
    scene.room.is_some_and(|room| {
        Surface::ALL.iter().any(|s| (at - room.corners(*s)[0]).dot(s.inward_normal()).abs() < reach_m)
    })
}

/// Returns whether a point is near the surface of a box, on either side.
fn is_near_a_box(scene: &Scene, at: DVec3, reach_m: f64) -> bool {
    scene.obstacles.iter().any(|o| match o.shape {
        Shape::Box { min_m, max_m } => is_within(at, min_m, max_m, reach_m) && !is_within(at, min_m, max_m, -reach_m),
        Shape::Mesh { .. } => false,
    })
}

/// Returns whether a point is near the sphere about a luminaire's opening.
fn is_near_an_opening(scene: &Scene, at: DVec3, reach_m: f64) -> bool {
    scene.luminaires.iter().filter(|l| l.model != LuminaireModel::Point).any(|l| {
        let half_m = DVec3::from(l.photometry.opening.bounding_box_m()).length() / 2.0;
        l.position_m.distance(at) < half_m + reach_m
    })
}

/// Returns whether a point is in a box that is enlarged by a margin.
fn is_within(at: DVec3, low: DVec3, high: DVec3, margin: f64) -> bool {
    at.cmpge(low - margin).all() && at.cmple(high + margin).all()
}

#[cfg(test)]
mod tests {
    use luxproof_photometry::LuminousOpening;

    use super::*;
    use crate::fixtures::with_opening;
    use crate::shared_tests::furnished;

    /// Returns for each place whether a meter there is near a surface of the job.
    fn are_beside(job: &Job, places: &[DVec3]) -> Vec<bool> {
        let mut job = job.clone();
        let sensor = job.sensors[0].clone();
        job.sensors = vec![sensor; places.len()];
        for (sensor, at) in job.sensors.iter_mut().zip(places) {
            sensor.meter.position_m = *at;
        }
        beside_a_surface(&job, 1e-4)
    }

    #[test]
    fn a_patch_stands_off_only_surfaces_near_it() {
        let mut job = furnished();
        let room_m = job.scene.room.unwrap().size_m;
        job.scene.luminaires[0] =
            with_opening(job.scene.luminaires[0].clone(), LuminousOpening::Box { x_m: 0.6, y_m: 0.3, height_m: 0.0 });
        let opening_m = job.scene.luminaires[0].position_m;
        let beside = [
            DVec3::new(3.0, 3.0, 0.0),
            DVec3::new(3.0, 3.0, 3e-4),
            DVec3::new(3.0, room_m.y, 1.0),
            DVec3::new(1.5, 1.5, 0.75),
            DVec3::new(1.5, 1.5, 0.7503),
            DVec3::new(1.0003, 1.5, 0.4),
            DVec3::new(5.5, 1.0002, 0.5),
            opening_m + DVec3::new(0.1, 0.0, 0.0),
        ];
        let free = [
            DVec3::new(3.0, 3.0, 6e-4),
            DVec3::new(1.5, 1.5, 0.7506),
            DVec3::new(1.5, 1.5, 0.4),
            DVec3::new(5.5, 1.0006, 0.5),
            opening_m + DVec3::new(0.5, 0.0, 0.0),
        ];
        assert_eq!(are_beside(&job, &beside), [true; 8]);
        assert_eq!(are_beside(&job, &free), [false; 5]);
    }
}
