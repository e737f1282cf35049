//! Luminaires on surfaces of every kind: what they cover, and that it does not depend on how they are written down.

use approx::assert_relative_eq;

use super::*;
use crate::enclosure::Enclosure;
use crate::flush::tests::{panel, room};
use luxproof_photometry::LuminousOpening;

const PANEL: LuminousOpening = LuminousOpening::Box { x_m: 0.6, y_m: 0.3, height_m: 0.0 };

fn cuboid() -> Obstacle {
    let shape = Shape::Box { min_m: DVec3::new(1.0, 1.0, 0.0), max_m: DVec3::new(3.0, 2.0, 1.5) };
    Obstacle { shape, reflectance: 0.5 }
}

fn as_mesh(body: &Obstacle) -> Obstacle {
    let Shape::Box { min_m, max_m } = body.shape else { panic!("no box") };
    let Mesh { vertices_m, triangles } = Mesh::cuboid(min_m, max_m);
    Obstacle { shape: Shape::Mesh { vertices_m, triangles }, reflectance: body.reflectance }
}

fn corners(plate: &Obstacle) -> &[DVec3] {
    let Shape::Mesh { vertices_m, .. } = &plate.shape else { panic!("no mesh") };
    vertices_m
}

fn front(luminaire: &Luminaire) -> DVec3 {
    luminaire.orientation * DVec3::NEG_Z
}

#[test]
fn an_opening_on_any_face_of_a_body_lies_before_a_plate_before_that_face() {
    for body in [cuboid(), as_mesh(&cuboid())] {
        for (at_m, turn, normal, plane_m) in [
            ([2.0, 1.5, 1.5], [0.0, 180.0], DVec3::Z, 1.5),
            ([2.0, 1.0, 0.7], [90.0, 90.0], DVec3::NEG_Y, -1.0),
            ([2.0, 2.0, 0.7], [270.0, 90.0], DVec3::Y, 2.0),
            ([1.0, 1.5, 0.7], [0.0, 90.0], DVec3::NEG_X, -1.0),
            ([3.0, 1.5, 0.7], [180.0, 90.0], DVec3::X, 3.0),
        ] {
            for off_m in [0.0, 1e-6, -1e-6] {
                let mut lamp = panel(at_m, PANEL, turn);
                lamp.position_m += off_m * normal;
                let placed = Surfaces::new(Some(room()), [&body]).place(&lamp);
                let [plate] = &placed.plates[..] else { panic!("{at_m:?} {off_m}: {placed:?}") };
                assert!(flush::is_plate(plate) && plate.reflectance == 0.0);
                assert_relative_eq!(plate.shape.area_m2(), 0.18, max_relative = 1e-9);
                for corner in corners(plate) {
                    assert_relative_eq!(corner.dot(normal), plane_m + GAP_M, epsilon = 1e-12);
                }
                assert_relative_eq!(placed.luminaire.position_m.dot(normal), plane_m + 2.0 * GAP_M, epsilon = 1e-12);
                assert!(front(&placed.luminaire).abs_diff_eq(normal, 1e-15), "{at_m:?}");
                assert_eq!(normal_of(&placed.plates, &placed.luminaire), Some(normal));
            }
            let mut lamp = panel(at_m, PANEL, turn);
            lamp.position_m += 3e-6 * normal;
            let placed = Surfaces::new(Some(room()), [&body]).place(&lamp);
            assert!(placed.plates.is_empty() && placed.luminaire.position_m == lamp.position_m);
        }
    }
}

#[test]
fn the_notation_of_angles_changes_nothing() {
    let body = cuboid();
    let place = |turn| Surfaces::new(Some(room()), [&body]).place(&panel([2.0, 1.0, 0.7], PANEL, turn));
    let one = place([90.0, 90.0]);
    for turn in [[-270.0, 90.0], [450.0, -270.0], [90.0 + 1e-5, 90.0 - 1e-5], [-90.0, -90.0], [270.0, 270.0]] {
        let other = place(turn);
        assert_eq!(other.luminaire.position_m, one.luminaire.position_m, "{turn:?}");
        assert!(front(&other.luminaire).abs_diff_eq(front(&one.luminaire), 1e-15), "{turn:?}");
        let [mine, its] = [&one, &other].map(|placed| placed.plates[0].shape.area_m2());
        assert_relative_eq!(mine, its, max_relative = 1e-9);
    }
}

#[test]
fn inner_walls_of_polygon_rooms_are_surfaces_straight_or_slanted() {
    let straight = [[0.0, 0.0], [6.0, 0.0], [6.0, 2.0], [3.0, 2.0], [3.0, 5.0], [0.0, 5.0]];
    let slanted = [[0.0, 0.0], [6.0, 0.0], [6.0, 3.0], [4.0, 5.0], [0.0, 5.0]];
    for (floor, walls, at_m, turn) in [
        (&straight[..], vec![0.5; 6], [4.5, 2.0, 1.5], [90.0, 90.0]),
        (&straight, vec![0.1, 0.2, 0.3, 0.4, 0.5, 0.6], [3.0, 3.5, 1.5], [180.0, -90.0]),
        (&slanted, vec![0.5; 5], [5.0, 4.0, 1.5], [45.0, 90.0]),
    ] {
        let floor: Vec<DVec2> = floor.iter().map(|p| DVec2::from(*p)).collect();
        let room = Enclosure::prism(&floor, 3.0, [0.2, 0.7], &walls).unwrap();
        let placed = Surfaces::new(Some(room.room), &room.walls).place(&panel(at_m, PANEL, turn));
        let [plate] = &placed.plates[..] else { panic!("{at_m:?}: {placed:?}") };
        assert_relative_eq!(plate.shape.area_m2(), 0.18, max_relative = 1e-9);
        let off_m = (placed.luminaire.position_m - DVec3::from(at_m)).dot(front(&placed.luminaire));
        assert_relative_eq!(off_m, 2.0 * GAP_M, epsilon = 1e-12);
    }
}

#[test]
fn what_reaches_beyond_a_face_covers_what_it_lies_on() {
    for body in [cuboid(), as_mesh(&cuboid())] {
        // A third of the panel reaches over the edge at x = 3.
        let placed = Surfaces::new(Some(room()), [&body]).place(&panel([2.9, 1.5, 1.5], PANEL, [0.0, 180.0]));
        let covered: f64 = placed.plates.iter().map(|plate| plate.shape.area_m2()).sum();
        assert_relative_eq!(covered, 0.4 * 0.3, max_relative = 1e-9);
        assert!(placed.plates.iter().all(flush::is_plate));
        assert!(placed.plates.iter().all(|plate| corners(plate).iter().all(|p| p.x <= 3.0 + 1e-12)));
        assert_eq!(plates_of(&placed.plates, &placed.luminaire).len(), placed.plates.len());
    }
}

#[test]
fn a_sheet_is_covered_on_the_side_that_is_lit() {
    let sheet = Obstacle {
        shape: Shape::Mesh {
            vertices_m: [[1.0, 1.0, 1.0], [3.0, 1.0, 1.0], [3.0, 3.0, 1.0], [1.0, 3.0, 1.0]].map(DVec3::from).to_vec(),
            triangles: vec![[0, 1, 2], [0, 2, 3]],
        },
        reflectance: 0.5,
    };
    for (tilt, normal) in [(0.0, DVec3::NEG_Z), (180.0, DVec3::Z)] {
        let placed = Surfaces::new(Some(room()), [&sheet]).place(&panel([2.0, 2.0, 1.0], PANEL, [30.0, tilt]));
        assert_eq!(placed.plates.len(), 1);
        assert_relative_eq!(placed.luminaire.position_m.z, 1.0 + 2.0 * GAP_M * normal.z, epsilon = 1e-12);
    }
}

#[test]
fn drums_and_boxes_cover_what_they_stand_on() {
    let drum = LuminousOpening::Ellipse { x_m: 0.4, y_m: 0.4, height_m: 0.25 };
    let body = cuboid();
    let placed = Surfaces::new(Some(room()), [&body]).place(&panel([2.0, 1.5, 1.625], drum, [0.0, 0.0]));
    let [plate] = &placed.plates[..] else { panic!("{placed:?}") };
    assert_relative_eq!(plate.shape.area_m2(), std::f64::consts::PI * 0.04, max_relative = 1e-9);
    assert_relative_eq!(placed.luminaire.position_m.z, 1.625 + 2.0 * GAP_M, epsilon = 1e-12);
    let hung = LuminousOpening::Box { x_m: 0.6, y_m: 0.6, height_m: 0.1 };
    let placed = Surfaces::new(Some(room()), [&body]).place(&panel([4.0, 2.0, 2.95], hung, [0.0, 0.0]));
    let [plate] = &placed.plates[..] else { panic!("{placed:?}") };
    assert!(corners(plate).iter().all(|p| p.z == 3.0));
    assert_relative_eq!(placed.luminaire.position_m.z, 2.95, epsilon = 1e-15);
}

#[test]
fn walls_of_the_room_are_covered_in_their_plane_as_before() {
    for (at_m, turn) in
        [([3.0, 2.0, 3.0], [0.0, 0.0]), ([3.0, 2.0, 3.0 - 1e-6], [33.0, 0.0]), ([0.0, 2.0, 1.5], [0.0, -90.0])]
    {
        let lamp = panel(at_m, PANEL, turn);
        let placed = Surfaces::new(Some(room()), []).place(&lamp);
        let [own] = &placed.plates[..] else { panic!("{at_m:?}") };
        let surface = flush::lies_on(&room(), own).unwrap();
        assert_eq!(flush::surface_of(&room(), &placed.luminaire), Some(surface));
        let before = flush::plate(&room(), &placed.luminaire).unwrap();
        let mut both = [own, &before].map(|plate| corners(plate).to_vec());
        for all in &mut both {
            all.sort_by(|a, b| (a.x, a.y, a.z).partial_cmp(&(b.x, b.y, b.z)).unwrap());
        }
        assert!(both[0].iter().zip(&both[1]).all(|(a, b)| a.abs_diff_eq(*b, 1e-12)), "{both:?}");
    }
}

#[test]
fn what_is_near_no_surface_or_stands_off_one_covers_nothing() {
    let body = cuboid();
    for (at_m, turn) in [
        ([2.0, 1.5, 1.6], [0.0, 180.0]),
        ([4.0, 1.5, 1.5], [0.0, 180.0]),
        ([2.0, 1.5, 1.5], [0.0, 150.0]),
        ([3.3, 1.5, 1.5], [0.0, 180.0]),
    ] {
        let lamp = panel(at_m, PANEL, turn);
        let placed = Surfaces::new(Some(room()), [&body]).place(&lamp);
        assert!(placed.plates.is_empty(), "{at_m:?}");
        assert_eq!(placed.luminaire.position_m, lamp.position_m);
    }
    let point = Luminaire { model: LuminaireModel::Point, ..panel([2.0, 1.0 - 9e-7, 0.7], PANEL, [0.0, 0.0]) };
    let placed = Surfaces::new(Some(room()), [&body]).place(&point);
    assert!(placed.plates.is_empty() && placed.luminaire.position_m == DVec3::new(2.0, 1.0, 0.7));
}
