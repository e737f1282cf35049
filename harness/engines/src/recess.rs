//! Luminaires on surfaces for programs that cannot tell surfaces in one plane apart: plate and opening come a hair before the surface.

use luxproof_scene::Obstacle;
use luxproof_scene::contact;
use std::borrow::Cow;
use std::collections::BTreeMap;

use glam::DVec3;
use luxproof_scene::geometry::{Room, Surface};
use luxproof_scene::{Luminaire, LuminaireModel, Shape, flush};

use super::Job;

/// How far a plate comes into the room, in parts of its largest extent: .03 mm in 6 m, a hundred times what 32-bit floats resolve
/// there. Openings come twice as far; at two metres below one that moves 3e-5 of its light.
pub(super) const APART: f64 = 5e-6;

/// The job with its plates before their surfaces and openings before their plates; the job itself without plates.
pub(super) fn separate(job: &Job) -> Cow<'_, Job> {
    moved(job, 2.0, 2.0, |_| 1.0)
}

/// The job with openings and plates so many times `APART` before their surfaces: openings in walls of the room's box, those on other
/// surfaces, and plates on those walls. Other plates are once as far before their surfaces.
fn moved(job: &Job, in_wall: f64, on_body: f64, plate_on: impl Fn(Surface) -> f64) -> Cow<'_, Job> {
    let obstacles = &job.scene.obstacles;
    if !obstacles.iter().any(|o| flush::is_plate(o) || wall_under(job, o).is_some()) {
        return Cow::Borrowed(job);
    }
    let apart_m = apart_m(job);
    let mut moved = job.clone();
    let mut plates: BTreeMap<usize, DVec3> = BTreeMap::new();
    for luminaire in &mut moved.scene.luminaires {
        let mut step = DVec3::ZERO;
        for (k, normal) in contact::plates_of(obstacles, luminaire) {
            let times = if wall_under(job, &obstacles[k]).is_some() { in_wall } else { on_body };
            // Pieces of one plane move an opening once.
            if step.dot(normal) < 0.5 * times {
                step += times * normal;
            }
            plates.insert(k, normal);
        }
        luminaire.position_m += apart_m * step;
    }
    for (k, obstacle) in moved.scene.obstacles.iter_mut().enumerate() {
        let step = match (wall_under(job, obstacle), plates.get(&k)) {
            (Some(surface), _) => plate_on(surface) * surface.inward_normal(),
            (None, Some(normal)) => *normal,
            (None, None) => continue,
        };
        if let Shape::Mesh { vertices_m, .. } = &mut obstacle.shape {
            for corner in vertices_m {
                *corner += apart_m * step;
            }
        }
    }
    Cow::Owned(moved)
}

/// The surface of the room's box that a plate lies on.
fn wall_under(job: &Job, plate: &Obstacle) -> Option<Surface> {
    job.scene.room.and_then(|room| flush::lies_on(&room, plate))
}

/// As [`apart`], with points on faces of bodies as far before these, for renderers that may find such a point behind its face.
pub(super) fn points_apart(job: &Job) -> Cow<'_, Job> {
    let mut moved = separate(job);
    let surfaces = contact::Surfaces::new(job.scene.room, &job.scene.obstacles);
    for (k, luminaire) in job.scene.luminaires.iter().enumerate().filter(|(_, l)| l.model == LuminaireModel::Point) {
        let normals = surfaces.normals_at(luminaire);
        if !normals.is_empty() {
            moved.to_mut().scene.luminaires[k].position_m += apart_m(job) * normals.iter().sum::<DVec3>();
        }
    }
    moved
}

/// `APART` in metres, by the extent of the room or, in free field, of all that stands there.
fn apart_m(job: &Job) -> f64 {
    let extent_m = job.scene.room.map_or_else(
        || job.scene.luminaires.iter().map(|l| l.position_m.abs().max_element()).fold(1.0, f64::max),
        |room| room.size_m.max_element(),
    );
    APART * extent_m
}

/// The same for renderers whose rays meet what shines and a surface close behind it at once: surfaces step back from points
/// on them and from recessed openings, so many times as far as plates come forward elsewhere; plates stay `APART` before them.
/// Openings on bodies and inner walls come forward instead, since a mesh cannot step back.
///
/// Cycles goes on 256 units in the last place behind a surface, 3e-5 of its coordinate at most: an opening that is
/// nearer than that to what lies behind it loses the light of rays that find it by chance, up to 2.5 %.
pub(super) fn behind_luminaires(job: &Job, times: f64) -> Cow<'_, Job> {
    let is_recessed = |s: Surface| job.scene.luminaires.iter().any(|l| flush::recess_of(&job.scene, l) == Some(s));
    let moved = moved(job, 0.0, times, |surface| if is_recessed(surface) { 1.0 - times } else { 1.0 });
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
    use luxproof_photometry::{LuminousIntensityDistribution, LuminousOpening};
    use luxproof_scene::contact;
    use luxproof_scene::{Obstacle, Transport};

    use super::*;
    use crate::fixtures;

    const PANEL: LuminousOpening = LuminousOpening::Box { x_m: 0.6, y_m: 0.6, height_m: 0.0 };

    fn office() -> Job {
        let size_m = DVec3::new(6.0, 4.0, 3.0);
        let room = fixtures::room(size_m, 0.2, 0.5, 0.8);
        let lamp = |id, x| fixtures::luminaire(id, DVec3::new(x, 2.0, 3.0), fixtures::lambertian());
        let mut job = fixtures::s1(Transport::Direct);
        let panel = fixtures::with_opening(lamp("panel", 2.0), PANEL);
        job.scene.obstacles = vec![flush::plate(&room, &panel).unwrap()];
        (job.scene.room, job.scene.luminaires) = (Some(room), vec![panel, lamp("point", 4.0)]);
        job
    }

    #[test]
    fn a_plate_comes_before_its_surface_the_opening_before_it_and_a_point_stays() {
        let job = office();
        let moved = separate(&job);
        let Shape::Mesh { vertices_m, .. } = &moved.scene.obstacles[0].shape else { panic!("no plate") };
        let [panel, point] = &moved.scene.luminaires[..] else { panic!("luminaires are lost") };
        assert_eq!((vertices_m[0].z, panel.position_m.z, point.position_m.z), (2.99997, 2.99994, 3.0));
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
        let none = [0.0; 3];
        for (at, steps) in [
            ([4.0, 2.0, 3.0], [none, [0.0, 0.0, 1.0], none, none]),
            ([0.0, 4.0, 1.0], [[-1.0, 0.0, 0.0], [0.0, 1.0, 0.0], none, none]),
            ([1.5, 1.5, 0.75], [none, none, none, [0.0, 0.0, -1.0]]),
            ([1.0, 1.5, 0.3], [none, none, [1.0, 0.0, 0.0], none]),
            ([4.0, 2.0, 2.999], [none; 4]),
            ([2.1, 1.5, 0.75], [none; 4]),
        ] {
            job.scene.luminaires[0].position_m = DVec3::from(at);
            let ends = [Surface::Floor, Surface::Ceiling].map(|s| corners_m(&job, &room, s, 2.0));
            let low = ends.as_flattened().iter().copied().reduce(DVec3::min).unwrap();
            let high = ends.as_flattened().iter().copied().reduce(DVec3::max).unwrap() - room.size_m;
            let Shape::Box { min_m, max_m } = behind_luminaires(&job, 2.0).scene.obstacles[0].shape else {
                panic!("no box")
            };
            let found = [low, high, min_m - DVec3::new(1.0, 1.0, 0.0), max_m - DVec3::new(2.0, 2.0, 0.75)];
            assert_eq!(found.map(|step| (step / (2.0 * APART * 6.0)).round().to_array()), steps, "{at:?}");
        }
    }

    #[test]
    fn a_face_steps_back_once_however_many_points_are_on_it() {
        let mut job = office();
        job.scene.obstacles = vec![fixtures::cuboid([1.0, 1.0, 0.0], [2.0, 2.0, 0.75], 0.5)];
        let lamps = [1.2, 1.4, 1.6, 1.8]
            .map(|x| fixtures::luminaire("on it", DVec3::new(x, 1.5, 0.75), fixtures::lambertian()));
        let tops = [&lamps[..1], &lamps].map(|lamps| {
            job.scene.luminaires = lamps.to_vec();
            match behind_luminaires(&job, 2.0).scene.obstacles[0].shape {
                Shape::Box { max_m, .. } => max_m.z,
                Shape::Mesh { .. } => f64::NAN,
            }
        });
        assert!(tops[0] < 0.75 && tops[1] == tops[0], "{tops:?}");
    }

    /// How far a box's top, the plate on it and the opening on that are above .75 m, in parts of `APART`.
    fn heights(job: &Job) -> [f64; 3] {
        let Shape::Mesh { vertices_m, .. } = &job.scene.obstacles[0].shape else { panic!("no plate") };
        let Shape::Box { max_m, .. } = &job.scene.obstacles[1].shape else { panic!("no box") };
        [max_m.z, vertices_m[0].z, job.scene.luminaires[0].position_m.z].map(|z| (z - 0.75) / (6.0 * APART))
    }

    #[test]
    fn an_opening_on_a_box_comes_before_its_plate_and_that_before_the_box() {
        let mut job = office();
        let body = fixtures::cuboid([1.0, 1.0, 0.0], [2.0, 2.0, 0.75], 0.5);
        let up = fixtures::luminaire("up", DVec3::new(1.5, 1.5, 0.75), fixtures::lambertian());
        let up = fixtures::with_opening(up, PANEL);
        let up = Luminaire { orientation: luxproof_scene::orientation(0.0, 180.0, 0.0), ..up };
        let placed = contact::Surfaces::new(job.scene.room, [&body]).place(&up);
        job.scene.obstacles = placed.plates.iter().cloned().chain([body]).collect();
        job.scene.luminaires = vec![placed.luminaire];
        let off = contact::GAP_M / (6.0 * APART);
        for (moved, times) in [(separate(&job), [0.0, 1.0, 2.0]), (behind_luminaires(&job, 10.0), [0.0, 1.0, 10.0])] {
            for ((found, times), gaps) in heights(&moved).into_iter().zip(times).zip([0.0, 1.0, 2.0]) {
                assert!((found - times - gaps * off).abs() < 1e-6, "{:?}", heights(&moved));
            }
        }
    }

    #[test]
    fn a_point_on_the_face_of_a_body_comes_before_it() {
        let mut job = office();
        let even = LuminousIntensityDistribution::axial(vec![0.0, 180.0], vec![1.0, 1.0]).unwrap();
        let body = fixtures::cuboid([1.0, 1.0, 0.0], [2.0, 2.0, 0.75], 0.5);
        let mesh = luxproof_scene::geometry::Mesh::cuboid(DVec3::new(1.0, 1.0, 0.0), DVec3::new(2.0, 2.0, 0.75));
        let shape = Shape::from(mesh);
        for body in [body, Obstacle { shape, reflectance: 0.5 }] {
            job.scene.obstacles = vec![body];
            for (at, step) in [
                ([1.3, 1.5, 0.75], DVec3::Z),
                ([1.0, 1.5, 0.4], DVec3::NEG_X),
                ([1.0, 1.5, 0.75], DVec3::new(-1.0, 0.0, 1.0)),
                ([1.3, 1.5, 0.8], DVec3::ZERO),
                ([4.0, 2.0, 3.0], DVec3::ZERO),
            ] {
                job.scene.luminaires = vec![fixtures::luminaire("on it", DVec3::from(at), even.clone())];
                let moved_m = points_apart(&job).scene.luminaires[0].position_m - DVec3::from(at);
                assert!((moved_m / (6.0 * APART)).abs_diff_eq(step, 1e-6), "{at:?}: {moved_m}");
            }
        }
    }

    #[test]
    fn what_is_not_recessed_is_exported_as_it_is() {
        let mut job = office();
        job.scene.obstacles = vec![fixtures::cuboid([0.0, 0.0, 2.0], [1.0, 1.0, 3.0], 0.5)];
        assert!(matches!(separate(&job), Cow::Borrowed(_)));
    }
}
