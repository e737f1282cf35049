//! Recessed luminaires for programs that cannot tell surfaces in one plane apart: plate and opening come a hair into the room.

use std::borrow::Cow;

use glam::DVec3;
use luminaire::geometry::Surface;
use luminaire::scene::{Luminaire, Shape, flush};

use super::Job;

/// How far a plate comes into the room, in parts of its largest extent: .03 mm in 6 m, a hundred times what 32-bit floats resolve
/// there. Openings come twice as far; at two metres below one that moves 3e-5 of its light.
pub(super) const APART: f64 = 5e-6;

/// The job with its flush plates before their surfaces and recessed openings before their plates; the job itself without them.
pub(super) fn apart(job: &Job) -> Cow<'_, Job> {
    let Some(room) =
        job.scene.room.filter(|room| job.scene.obstacles.iter().any(|o| flush::lies_on(room, o).is_some()))
    else {
        return Cow::Borrowed(job);
    };
    let inwards = |surface: Surface| APART * room.size_m.max_element() * surface.inward_normal();
    let luminaire = |l: &Luminaire| {
        let moved_m = flush::recess_of(&job.scene, l).map_or(DVec3::ZERO, |s| 2.0 * inwards(s));
        Luminaire { position_m: l.position_m + moved_m, ..l.clone() }
    };
    let mut moved = job.clone();
    moved.scene.luminaires = job.scene.luminaires.iter().map(luminaire).collect();
    for obstacle in &mut moved.scene.obstacles {
        let surface = flush::lies_on(&room, obstacle);
        if let (Some(surface), Shape::Mesh { vertices_m, .. }) = (surface, &mut obstacle.shape) {
            vertices_m.iter_mut().for_each(|p| *p += inwards(surface));
        }
    }
    Cow::Owned(moved)
}

/// Whether bodies stand in the room, recessed openings apart: those hide nothing.
pub(super) fn has_bodies(job: &Job) -> bool {
    let lies = |o| job.scene.room.is_some_and(|room| flush::lies_on(&room, o).is_some());
    job.scene.obstacles.iter().any(|o| !lies(o))
}
