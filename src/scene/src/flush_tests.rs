//! Tests of flush openings: where their plates lie, what area they have, which overlap.

use std::sync::Arc;

use approx::assert_relative_eq;

use super::*;
use crate::geometry::Reflectances;
use crate::orientation;
use luxproof_photometry::{LuminousIntensityDistribution, LuminousOpening, Photometry};

pub(crate) fn room() -> Room {
    Room { size_m: DVec3::new(6.0, 4.0, 3.0), reflectance: Reflectances::with_equal_walls(0.2, 0.5, 0.8) }
}

pub(crate) fn panel(at_m: [f64; 3], opening: LuminousOpening, [azimuth, tilt]: [f64; 2]) -> Luminaire {
    let down = LuminousIntensityDistribution::axial(vec![0.0, 60.0, 90.0], vec![100.0, 80.0, 0.0]).unwrap();
    Luminaire {
        id: "panel".into(),
        photometry: Arc::new(Photometry { opening, ..Photometry::of(down) }),
        position_m: DVec3::from(at_m),
        orientation: orientation(azimuth, tilt, 0.0),
        flux_scale: 1.0,
        model: LuminaireModel::Area,
    }
}

const SQUARE: LuminousOpening = LuminousOpening::Box { x_m: 0.6, y_m: 1.2, height_m: 0.0 };
const DISC: LuminousOpening = LuminousOpening::Ellipse { x_m: 0.6, y_m: 0.6, height_m: 0.0 };

#[test]
fn a_plate_lies_on_its_surface_faces_inwards_and_has_the_openings_area() {
    for (at_m, turn, surface) in [
        ([3.0, 2.0, 3.0], [0.0, 0.0], Surface::Ceiling),
        ([3.1, 2.3, 3.0], [90.0, 0.0], Surface::Ceiling),
        ([3.0, 2.0, 3.0 - 1e-10], [33.0, 0.0], Surface::Ceiling),
        ([3.0, 2.0, 0.0], [0.0, 180.0], Surface::Floor),
        ([6.0, 2.0, 1.5], [0.0, 90.0], Surface::WallXMax),
        ([3.0, 0.0, 1.5], [270.0, 90.0], Surface::WallYMin),
    ] {
        for (opening, area_m2) in [(SQUARE, 0.72), (DISC, std::f64::consts::PI * 0.09)] {
            let lamp = panel(at_m, opening, turn);
            assert_eq!(surface_of(&room(), &lamp), Some(surface), "{at_m:?}");
            assert!(shines_from(surface, &lamp), "{at_m:?}");
            let plate = plate(&room(), &lamp).unwrap();
            assert!(lies_on(&room(), &plate) == Some(surface) && is_plate(&plate));
            assert_relative_eq!(plate.shape.area_m2(), area_m2, max_relative = 1e-12);
            let Shape::Mesh { vertices_m: v, .. } = &plate.shape else { panic!("no mesh") };
            assert!((v[1] - v[0]).cross(v[2] - v[1]).dot(surface.inward_normal()) > 0.0, "{at_m:?}");
            let scene = Scene { room: Some(room()), obstacles: vec![plate.clone()], luminaires: vec![] };
            assert_eq!(recess_of(&scene, &lamp), Some(surface));
        }
    }
}

#[test]
fn a_quarter_turn_leaves_the_corners_of_a_rectangle_on_its_axes() {
    let plate = plate(&room(), &panel([3.1, 2.3, 3.0], SQUARE, [90.0, 0.0])).unwrap();
    let Shape::Mesh { vertices_m, .. } = plate.shape else { panic!("no mesh") };
    let [low, high] = extent(&vertices_m);
    assert!(vertices_m.iter().all(|p| (p.cmpeq(low) | p.cmpeq(high)).all()), "{vertices_m:?}");
}

#[test]
fn what_is_off_the_plane_tilted_or_a_point_has_no_plate() {
    let boxed = LuminousOpening::Box { x_m: 0.6, y_m: 0.6, height_m: 0.1 };
    let point = Luminaire { model: LuminaireModel::Point, ..panel([3.0, 2.0, 3.0], SQUARE, [0.0, 0.0]) };
    assert_eq!(surface_of(&room(), &point), Some(Surface::Ceiling));
    for lamp in [
        panel([3.0, 2.0, 2.999], SQUARE, [0.0, 0.0]),
        panel([3.0, 2.0, 3.0], SQUARE, [0.0, 10.0]),
        panel([3.0, 2.0, 2.95], boxed, [0.0, 0.0]),
        point,
    ] {
        assert!(plate(&room(), &lamp).is_none(), "{:?}", lamp.position_m);
    }
}

#[test]
fn plates_overlap_where_they_share_an_area_and_not_where_they_touch() {
    let at = |x: f64, opening, azimuth| plate(&room(), &panel([x, 2.0, 3.0], opening, [azimuth, 0.0])).unwrap();
    let first = at(2.0, SQUARE, 0.0);
    for (other, overlaps) in [
        (at(2.59, SQUARE, 0.0), true),
        (at(2.6, SQUARE, 0.0), false),
        (at(2.85, SQUARE, 90.0), true),
        (at(2.9, SQUARE, 90.0), false),
        (at(2.59, DISC, 0.0), true),
        (at(2.61, DISC, 0.0), false),
        // A corner that points at an edge: the boxes around them overlap, and they do not.
        (plate(&room(), &panel([2.62, 2.95, 3.0], SQUARE, [45.0, 0.0])).unwrap(), false),
        (plate(&room(), &panel([2.0, 2.0, 0.0], SQUARE, [0.0, 180.0])).unwrap(), false),
    ] {
        assert_eq!(overlap(&first, &other), overlaps, "{other:?}");
        assert_eq!(overlap(&other, &first), overlaps, "{other:?}");
    }
}

#[test]
fn what_faces_out_of_the_room_sends_nothing_into_it() {
    assert!(!shines_from(Surface::Ceiling, &panel([3.0, 2.0, 3.0], SQUARE, [0.0, 180.0])));
    assert!(!shines_from(Surface::Floor, &panel([3.0, 2.0, 0.0], SQUARE, [0.0, 0.0])));
    assert!(!shines_from(Surface::WallXMin, &panel([0.0, 2.0, 1.0], SQUARE, [0.0, 90.0])));
}

#[test]
fn decimals_that_were_rounded_are_put_on_the_surface() {
    let near = DVec3::new(1.0, 4.0 - 3e-7, 3.0 + 1e-6);
    assert_eq!(snapped(&room(), near), DVec3::new(1.0, 4.0, 3.0));
    assert_eq!(snapped(&room(), near - 3e-6), near - 3e-6);
}
