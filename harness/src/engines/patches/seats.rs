//! Where a meter's patch sits.

use glam::DVec3;
use itertools::Itertools;
use luminaire::geometry::Surface;
use luminaire::scene::{LuminaireModel, Shape};

use crate::engines::Job;
use crate::engines::float_error::EPSILON;
use crate::engines::frame::Frame;
use crate::engines::settings::Preset;

/// Side of a meter's patch, in parts of the largest coordinate: forty times what 32-bit floats resolve there at least.
const PATCH: f64 = 5e-6;
/// And where a renderer's own settings say how far off a surface rays begin, 1e-5 in LuxCore, so many units of the scene at least: a camera
/// stands a side before its patch, and looks through it where it begins to see farther off.
const STOCK_PATCH: f64 = 5e-5;
/// A surface so many sides from a meter is beside it.
const BESIDE: f64 = 4.0;
/// So many times as wide a patch may be that has more space about it, as in `luxcore_read.py`: what its corners are rounded by tilts it less.
const WIDE: f64 = 64.0;
/// How far the corners of a patch that is not wide may be rounded, in parts of its side: its plane's sine to its normal.
const TILT: f64 = 4.0 * EPSILON / PATCH;

/// What a meter's patch has about it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Space {
    /// A surface beside it, off which it must stand.
    Tight,
    /// Enough to lie at the meter's very point.
    Free,
    /// Enough for a wide patch.
    Wide,
}

impl Space {
    /// Of each meter of a job as exported, whose patches have such a side in metres.
    pub(super) fn of(job: &Job, side_m: f64) -> Vec<Self> {
        let [tight, narrow] = [1.0, WIDE].map(|times| beside_a_surface(job, times * side_m));
        let space = |(tight, narrow)| match (tight, narrow) {
            (true, _) => Self::Tight,
            (false, true) => Self::Free,
            (false, false) => Self::Wide,
        };
        tight.into_iter().zip(narrow).map(space).collect()
    }

    /// By how much the rounding of its corners may tilt a patch.
    pub(super) const fn tilt(self) -> f64 {
        match self {
            Self::Tight | Self::Free => TILT,
            Self::Wide => TILT / WIDE,
        }
    }
}

/// Side of a meter's patch in scene units.
pub(in crate::engines) fn patch(job: &Job, frame: &Frame, preset: Preset) -> f64 {
    let room = job.scene.room.iter().flat_map(|r| [DVec3::ZERO, r.size_m]);
    let points = room.chain(job.scene.luminaires.iter().map(|l| l.position_m));
    let points = points.chain(job.stations.iter().map(|s| s.meter.position_m));
    let largest = points.map(|p| frame.to_scene(p).abs().max_element()).fold(0.0, f64::max);
    let side = PATCH * if largest > 0.0 { largest } else { 1.0 };
    if preset == Preset::Default { side.max(STOCK_PATCH) } else { side }
}

/// Along which directions the sides of a patch lie, as in `Patches` of `cycles_read.py`.
pub(super) fn sides(normal: DVec3) -> [DVec3; 2] {
    let aside = if normal.x.abs() > 0.5 { DVec3::Y } else { DVec3::X };
    let along = aside.cross(normal).normalize_or_zero();
    [along, normal.cross(along)]
}

/// Which meters' patches of such a side must stand off a surface: of the room, of a body, or of an opening that may be there.
fn beside_a_surface(job: &Job, side_m: f64) -> Vec<bool> {
    let (scene, reach_m) = (&job.scene, BESIDE * side_m);
    let by_the_room = |at: DVec3| {
        scene.room.is_some_and(|room| {
            Surface::ALL.iter().any(|s| (at - room.corners(*s)[0]).dot(s.inward_normal()).abs() < reach_m)
        })
    };
    let by_a_box = |at: DVec3| {
        scene.obstacles.iter().any(|o| match o.shape {
            Shape::Box { min_m, max_m } => {
                is_within(at, min_m, max_m, reach_m) && !is_within(at, min_m, max_m, -reach_m)
            }
            Shape::Mesh { .. } => false,
        })
    };
    let by_an_opening = |at: DVec3| {
        scene.luminaires.iter().filter(|l| l.model != LuminaireModel::Point).any(|l| {
            let half_m = DVec3::from(l.photometry.opening.bounding_box_m()).length() / 2.0;
            l.position_m.distance(at) < half_m + reach_m
        })
    };
    let at = |k: usize| job.stations[k].meter.position_m;
    let mut beside: Vec<bool> =
        (0..job.stations.len()).map(|k| by_the_room(at(k)) || by_a_box(at(k)) || by_an_opening(at(k))).collect();
    // There may be a million triangles and many meters: those within a triangle's reach along x are looked up.
    let along_x: Vec<usize> = (0..beside.len()).sorted_by(|a, b| at(*a).x.total_cmp(&at(*b).x)).collect();
    for obstacle in &scene.obstacles {
        let Shape::Mesh { vertices_m, triangles } = &obstacle.shape else { continue };
        for triangle in triangles {
            let [a, b, c] = triangle.map(|v| vertices_m[v as usize]);
            let (low, high) = (a.min(b).min(c), a.max(b).max(c));
            let first = along_x.partition_point(|k| at(*k).x < low.x - reach_m);
            let near = along_x[first..].iter().take_while(|k| at(**k).x <= high.x + reach_m);
            for k in near {
                beside[*k] |= is_within(at(*k), low, high, reach_m);
            }
        }
    }
    beside
}

fn is_within(at: DVec3, low: DVec3, high: DVec3, margin: f64) -> bool {
    at.cmpge(low - margin).all() && at.cmple(high + margin).all()
}

#[cfg(test)]
mod tests {
    use luminaire::photometry::LuminousOpening;

    use super::*;
    use crate::engines::fixtures::with_opening;
    use crate::engines::shared_tests::furnished;

    #[test]
    fn a_patch_stands_off_surfaces_beside_it_alone() {
        let mut job = furnished();
        let room_m = job.scene.room.unwrap().size_m;
        job.scene.luminaires[0] =
            with_opening(job.scene.luminaires[0].clone(), LuminousOpening::Box { x_m: 0.6, y_m: 0.3, height_m: 0.0 });
        let opening_m = job.scene.luminaires[0].position_m;
        let station = job.stations[0].clone();
        let mut are_beside = |places: &[DVec3]| {
            let placed = |at: &DVec3| {
                let mut station = station.clone();
                station.meter.position_m = *at;
                station
            };
            job.stations = places.iter().map(placed).collect();
            beside_a_surface(&job, 1e-4)
        };
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
        assert_eq!(are_beside(&beside), [true; 8]);
        assert_eq!(are_beside(&free), [false; 5]);
    }
}
