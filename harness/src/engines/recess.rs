//! Recessed luminaires for programs that cannot tell surfaces in one plane apart: plate and opening come a hair into the room.

use std::borrow::Cow;

use glam::DVec3;
use luminaire::geometry::Surface;
use luminaire::scene::{Luminaire, LuminaireModel, Shape, flush};

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
            for corner in vertices_m {
                *corner += inwards(surface);
            }
        }
    }
    Cow::Owned(moved)
}

/// The same for renderers whose shadow rays meet a surface and a point in its plane at once: points in planes of surfaces come off them,
/// too, so many times as far as plates.
pub(super) fn with_points_apart(job: &Job, times: f64) -> Cow<'_, Job> {
    let moves_m: Vec<DVec3> = job.scene.luminaires.iter().map(|l| times * off_surfaces_m(job, l)).collect();
    let moved = apart(job);
    if moves_m.iter().all(|m| *m == DVec3::ZERO) {
        return moved;
    }
    let mut moved = moved.into_owned();
    for (luminaire, move_m) in moved.scene.luminaires.iter_mut().zip(moves_m) {
        luminaire.position_m += move_m;
    }
    Cow::Owned(moved)
}

/// The way that a point goes off the surfaces of the room and of boxes that it is on, as far as a plate.
pub(super) fn off_surfaces_m(job: &Job, luminaire: &Luminaire) -> DVec3 {
    let Some(room) = job.scene.room.filter(|_| luminaire.model == LuminaireModel::Point) else { return DVec3::ZERO };
    let largest_m = room.size_m.max_element();
    let (at, near_m) = (luminaire.position_m, flush::IN_PLANE * largest_m);
    let is_on = |depth_m: f64| depth_m.abs() <= near_m;
    let of_room = Surface::ALL
        .into_iter()
        .filter(|s| is_on((at - room.corners(*s)[0]).dot(s.inward_normal())))
        .map(Surface::inward_normal);
    let of_bodies = job.scene.obstacles.iter().filter_map(|o| match o.shape {
        Shape::Box { min_m, max_m } => Some([min_m, max_m]),
        Shape::Mesh { .. } => None,
    });
    let of_bodies = of_bodies
        .filter(|[low, high]| at.cmpge(low - near_m).all() && at.cmple(high + near_m).all())
        .flat_map(|[low, high]| DVec3::AXES.into_iter().flat_map(move |axis| [(low, -axis), (high, axis)]))
        .filter(|(face, outward)| is_on((at - face).dot(*outward)))
        .map(|(_, outward)| outward);
    APART * largest_m * of_room.chain(of_bodies).sum::<DVec3>()
}

#[cfg(test)]
mod tests {
    use luminaire::photometry::LuminousOpening;
    use luminaire::scene::{Obstacle, Transport};

    use super::*;
    use crate::engines::fixtures;

    fn office() -> Job {
        let opening = LuminousOpening::Box { x_m: 0.6, y_m: 0.6, height_m: 0.0 };
        let size_m = DVec3::new(6.0, 4.0, 3.0);
        let room = fixtures::room(size_m, 0.2, 0.5, 0.8);
        let lamp = |id, x| fixtures::luminaire(id, DVec3::new(x, 2.0, 3.0), fixtures::lambertian());
        let mut job = fixtures::s1(Transport::Direct);
        let panel = fixtures::with_opening(lamp("panel", 2.0), opening);
        job.scene.obstacles = vec![flush::plate(&room, &panel).unwrap()];
        (job.scene.room, job.scene.luminaires) = (Some(room), vec![panel, lamp("point", 4.0)]);
        job
    }

    #[test]
    fn a_plate_comes_before_its_surface_the_opening_before_it_and_a_point_stays() {
        let job = office();
        let moved = apart(&job);
        let plate = |o: &Obstacle| match &o.shape {
            Shape::Mesh { vertices_m, .. } => vertices_m[0].z,
            Shape::Box { .. } => f64::NAN,
        };
        let [panel, point] = &moved.scene.luminaires[..] else { panic!("luminaires are lost") };
        assert_eq!((plate(&moved.scene.obstacles[0]), panel.position_m.z, point.position_m.z), (2.99997, 2.99994, 3.0));
        assert_eq!(moved.scene.luminaires[0].model, LuminaireModel::Area);
    }

    #[test]
    fn points_come_off_the_surfaces_that_they_are_on() {
        let mut job = office();
        job.scene.obstacles.push(fixtures::cuboid([1.0, 1.0, 0.0], [2.0, 2.0, 0.75], 0.5));
        let mut moved_from = |at: [f64; 3]| {
            job.scene.luminaires[1].position_m = DVec3::from(at);
            let moved = with_points_apart(&job, 1.0);
            (moved.scene.luminaires[1].position_m - DVec3::from(at)) / (APART * 6.0)
        };
        for (at, by) in [
            ([4.0, 2.0, 3.0], [0.0, 0.0, -1.0]),
            ([0.0, 4.0, 1.0], [1.0, -1.0, 0.0]),
            ([1.5, 1.5, 0.75], [0.0, 0.0, 1.0]),
            ([2.0, 1.5, 0.3], [1.0, 0.0, 0.0]),
            ([4.0, 2.0, 2.999], [0.0; 3]),
            ([2.1, 1.5, 0.75], [0.0; 3]),
        ] {
            let moved = moved_from(at);
            assert!(moved.distance(DVec3::from(by)) < 1e-6, "{at:?} {moved}");
        }
        assert_eq!(with_points_apart(&job, 1.0).scene.luminaires[0].position_m.z, 2.99994);
    }

    #[test]
    fn what_is_not_recessed_is_exported_as_it_is() {
        let mut job = office();
        job.scene.obstacles = vec![fixtures::cuboid([0.0, 0.0, 2.0], [1.0, 1.0, 3.0], 0.5)];
        assert!(matches!(apart(&job), Cow::Borrowed(_)));
    }
}
