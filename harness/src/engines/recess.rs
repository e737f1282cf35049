//! Recessed luminaires for programs that cannot tell surfaces in one plane apart: plate and opening come a hair into the room.

use std::borrow::Cow;

use glam::DVec3;
use luminaire::geometry::{Room, Surface};
use luminaire::scene::{Luminaire, LuminaireModel, Shape, flush};

use super::Job;

/// How far a plate comes into the room, in parts of its largest extent: .03 mm in 6 m, a hundred times what 32-bit floats resolve
/// there. Openings come twice as far; at two metres below one that moves 3e-5 of its light.
pub(super) const APART: f64 = 5e-6;

/// The job with its flush plates before their surfaces and recessed openings before their plates; the job itself without them.
pub(super) fn apart(job: &Job) -> Cow<'_, Job> {
    moved(job, 2.0, |_| 1.0)
}

/// The job with recessed openings and flush plates so many times `APART` into the room.
fn moved(job: &Job, opening: f64, plate_on: impl Fn(Surface) -> f64) -> Cow<'_, Job> {
    let Some(room) =
        job.scene.room.filter(|room| job.scene.obstacles.iter().any(|o| flush::lies_on(room, o).is_some()))
    else {
        return Cow::Borrowed(job);
    };
    let inwards = |surface: Surface| APART * room.size_m.max_element() * surface.inward_normal();
    let luminaire = |l: &Luminaire| {
        let moved_m = flush::recess_of(&job.scene, l).map_or(DVec3::ZERO, |s| opening * inwards(s));
        Luminaire { position_m: l.position_m + moved_m, ..l.clone() }
    };
    let mut moved = job.clone();
    moved.scene.luminaires = job.scene.luminaires.iter().map(luminaire).collect();
    for obstacle in &mut moved.scene.obstacles {
        let surface = flush::lies_on(&room, obstacle);
        if let (Some(surface), Shape::Mesh { vertices_m, .. }) = (surface, &mut obstacle.shape) {
            for corner in vertices_m {
                *corner += plate_on(surface) * inwards(surface);
            }
        }
    }
    Cow::Owned(moved)
}

/// The same for renderers whose rays meet what shines and a surface close behind it at once: surfaces step back from points
/// on them and from recessed openings, so many times as far as plates come forward elsewhere; plates stay `APART` before them.
///
/// Cycles goes on 256 units in the last place behind a surface, 3e-5 of its coordinate at most: an opening that is
/// nearer than that to what lies behind it loses the light of rays that find it by chance, up to 2.5 %.
pub(super) fn behind_luminaires(job: &Job, times: f64) -> Cow<'_, Job> {
    let is_recessed = |s: Surface| job.scene.luminaires.iter().any(|l| flush::recess_of(&job.scene, l) == Some(s));
    let moved = moved(job, 0.0, |surface| if is_recessed(surface) { 1.0 - times } else { 1.0 });
    if !job.scene.luminaires.iter().any(|l| surfaces_of(job, l).next().is_some()) {
        return moved;
    }
    let (mut moved, back_m) = (moved.into_owned(), times * back_m(job));
    for (face, inwards) in job.scene.luminaires.iter().flat_map(|l| surfaces_of(job, l)) {
        let Face::OfBox(k) = face else { continue };
        // From where it was, whoever else is on it.
        let Shape::Box { min_m: low_m, max_m: high_m } = job.scene.obstacles[k].shape else { continue };
        let step_m = back_m.min(0.25 * (high_m - low_m).dot(inwards.abs())) * inwards;
        if let Shape::Box { min_m, max_m } = &mut moved.scene.obstacles[k].shape {
            *min_m = min_m.max(low_m - step_m);
            *max_m = max_m.min(high_m - step_m);
        }
    }
    Cow::Owned(moved)
}

/// The corners of a surface of the room, whose surfaces step back from luminaires in them likewise.
pub(super) fn corners_m(job: &Job, room: &Room, surface: Surface, times: f64) -> [DVec3; 4] {
    let (mut low_m, mut high_m) = (DVec3::ZERO, room.size_m);
    for luminaire in &job.scene.luminaires {
        let of_points =
            surfaces_of(job, luminaire).filter(|(face, _)| *face == Face::OfRoom).map(|(_, inwards)| inwards);
        let is_opening = luminaire.model != LuminaireModel::Point;
        let of_opening = flush::surface_of(room, luminaire).filter(|_| is_opening).map(Surface::inward_normal);
        for inwards in of_points.chain(of_opening) {
            let step_m = -times * back_m(job) * inwards;
            low_m = low_m.min(step_m);
            high_m = high_m.max(room.size_m + step_m);
        }
    }
    room.corners(surface).map(|c| DVec3::select(c.cmpgt(DVec3::ZERO), high_m, low_m))
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Face {
    OfRoom,
    OfBox(usize),
}

fn back_m(job: &Job) -> f64 {
    job.scene.room.map_or(0.0, |room| APART * room.size_m.max_element())
}

/// The surfaces that a point is on, and where each lets its light go.
fn surfaces_of(job: &Job, luminaire: &Luminaire) -> impl Iterator<Item = (Face, DVec3)> {
    let room = job.scene.room.filter(|_| luminaire.model == LuminaireModel::Point);
    let at = luminaire.position_m;
    room.into_iter().flat_map(move |room| {
        let near_m = flush::IN_PLANE * room.size_m.max_element();
        let is_on = move |face_m: DVec3, normal: DVec3| (at - face_m).dot(normal).abs() <= near_m;
        let of_room = Surface::ALL.into_iter().filter(move |s| is_on(room.corners(*s)[0], s.inward_normal()));
        let of_boxes = job.scene.obstacles.iter().enumerate().filter_map(move |(k, o)| match o.shape {
            Shape::Box { min_m, max_m } => {
                let is_at = at.cmpge(min_m - near_m).all() && at.cmple(max_m + near_m).all();
                is_at.then_some((k, min_m, max_m))
            }
            Shape::Mesh { .. } => None,
        });
        let of_boxes = of_boxes.flat_map(move |(k, low_m, high_m)| {
            let faces = DVec3::AXES.into_iter().flat_map(move |axis| [(low_m, -axis), (high_m, axis)]);
            let on = faces.filter(move |(face_m, normal)| is_on(*face_m, *normal));
            on.map(move |(_, normal)| (Face::OfBox(k), normal))
        });
        of_room.map(|s| (Face::OfRoom, s.inward_normal())).chain(of_boxes)
    })
}

/// The sides to which the surfaces that a point is on let its light go.
pub(super) fn inwards(job: &Job, luminaire: &Luminaire) -> DVec3 {
    surfaces_of(job, luminaire).map(|(_, inwards)| inwards).sum()
}

/// Whether a point on a surface lights it where that steps back.
pub(super) fn shines_behind(job: &Job, luminaire: &Luminaire) -> bool {
    surfaces_of(job, luminaire).any(|(_, inwards)| luminaire.intensity_towards(-inwards).value() > 0.0)
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
    fn an_opening_stays_where_its_plate_and_its_surface_step_back() {
        let job = office();
        let moved = behind_luminaires(&job, 10.0);
        let Shape::Mesh { vertices_m, .. } = &moved.scene.obstacles[0].shape else { panic!("no plate") };
        let ceiling = corners_m(&moved, &job.scene.room.unwrap(), Surface::Ceiling, 10.0)[0].z;
        let behind = [moved.scene.luminaires[0].position_m.z, vertices_m[0].z, ceiling].map(|z| (z - 3.0) / 6.0);
        for (found, times) in behind.into_iter().zip([0.0, 9.0, 10.0]) {
            assert!((found - times * APART).abs() < 1e-12, "{behind:?}");
        }
        // Farther than 256 units in the last place of a 32-bit float, which are a part of 2^-15 at most.
        assert!(behind[1] > 2_f64.powi(-15));
        // A plate on a surface without an opening comes before it as elsewhere.
        let mut other = job.clone();
        other.scene.luminaires.remove(0);
        let moved = behind_luminaires(&other, 10.0);
        let Shape::Mesh { vertices_m, .. } = &moved.scene.obstacles[0].shape else { panic!("no plate") };
        assert!((vertices_m[0].z - 2.99997).abs() < 1e-12, "{vertices_m:?}");
    }

    #[test]
    fn surfaces_step_back_from_points_on_them() {
        let mut job = office();
        job.scene.obstacles = vec![fixtures::cuboid([1.0, 1.0, 0.0], [2.0, 2.0, 0.75], 0.5)];
        job.scene.luminaires.remove(0);
        let room = job.scene.room.unwrap();
        let mut bounds_from = |at: [f64; 3]| {
            job.scene.luminaires[0].position_m = DVec3::from(at);
            let ends = [Surface::Floor, Surface::Ceiling].map(|s| corners_m(&job, &room, s, 2.0));
            let low = ends.as_flattened().iter().copied().reduce(DVec3::min).unwrap();
            let high = ends.as_flattened().iter().copied().reduce(DVec3::max).unwrap();
            let Shape::Box { min_m, max_m } = behind_luminaires(&job, 2.0).scene.obstacles[0].shape else {
                panic!("no box")
            };
            let back = 2.0 * APART * 6.0;
            let steps =
                [low, high - room.size_m, min_m - DVec3::new(1.0, 1.0, 0.0), max_m - DVec3::new(2.0, 2.0, 0.75)];
            steps.map(|step| (step / back).round().to_array())
        };
        let none = [0.0; 3];
        for (at, steps) in [
            ([4.0, 2.0, 3.0], [none, [0.0, 0.0, 1.0], none, none]),
            ([0.0, 4.0, 1.0], [[-1.0, 0.0, 0.0], [0.0, 1.0, 0.0], none, none]),
            ([1.5, 1.5, 0.75], [none, none, none, [0.0, 0.0, -1.0]]),
            ([1.0, 1.5, 0.3], [none, none, [1.0, 0.0, 0.0], none]),
            ([4.0, 2.0, 2.999], [none; 4]),
            ([2.1, 1.5, 0.75], [none; 4]),
        ] {
            assert_eq!(bounds_from(at), steps, "{at:?}");
        }
    }

    #[test]
    fn a_face_steps_back_once_however_many_points_are_on_it() {
        let mut job = office();
        job.scene.obstacles = vec![fixtures::cuboid([1.0, 1.0, 0.0], [2.0, 2.0, 0.75], 0.5)];
        let lamp = |x| fixtures::luminaire("on it", DVec3::new(x, 1.5, 0.75), fixtures::lambertian());
        let top = |job: &Job| match behind_luminaires(job, 2.0).scene.obstacles[0].shape {
            Shape::Box { max_m, .. } => max_m.z,
            Shape::Mesh { .. } => f64::NAN,
        };
        job.scene.luminaires = vec![lamp(1.2)];
        let by_one = top(&job);
        job.scene.luminaires.extend([1.4, 1.6, 1.8].map(lamp));
        assert!(by_one < 0.75 && top(&job) == by_one, "{by_one} {}", top(&job));
    }

    #[test]
    fn what_is_not_recessed_is_exported_as_it_is() {
        let mut job = office();
        job.scene.obstacles = vec![fixtures::cuboid([0.0, 0.0, 2.0], [1.0, 1.0, 3.0], 0.5)];
        assert!(matches!(apart(&job), Cow::Borrowed(_)));
    }
}
