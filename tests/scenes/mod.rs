//! Scenes at random for tests of the library: rooms, bodies, luminaires of every form in mid-air and on surfaces.

#![allow(dead_code, reason = "each test takes what it needs")]

use std::sync::Arc;

use glam::{DVec2, DVec3};
use luxproof_photometry::{HorizontalAxis, LuminousIntensityDistribution, LuminousOpening, Photometry};
use luxproof_scene::contact::Surfaces;
use luxproof_scene::enclosure::Enclosure;
use luxproof_scene::geometry::{Mesh, Reflectances, Room};
use luxproof_scene::{Luminaire, LuminaireModel, Meter, Obstacle, Scene, Shape, orientation};
use luxproof_simulator::{Estimate, Uncertainty};

pub(crate) const PANEL: LuminousOpening = LuminousOpening::Box { x_m: 0.6, y_m: 0.6, height_m: 0.0 };
pub(crate) const EVEN_PANEL: LuminousOpening = LuminousOpening::Ellipse { x_m: 0.6, y_m: 0.6, height_m: 0.0 };

/// Standard errors by which readings of few replicates may differ.
const STANDARD_ERRORS: f64 = 6.0;

/// What a study takes where `LUXPROOF_NIGHTLY` is set, and what it takes in every test run.
pub(crate) fn by_night(night: u64, day: u64) -> u64 {
    if std::env::var_os("LUXPROOF_NIGHTLY").is_some() { night } else { day }
}

/// Numbers at random (G. Steele, D. Lea, C. Flood, "Fast splittable pseudorandom number generators", OOPSLA 2014).
pub(crate) struct Random(pub(crate) u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    pub(crate) fn within(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * (self.next() >> 11) as f64 / (1_u64 << 53) as f64
    }

    pub(crate) fn below(&mut self, count: usize) -> usize {
        (self.next() % count as u64) as usize
    }
}

/// How far a reading may be off, in lux.
pub(crate) fn margin_lx(estimate: &Estimate) -> f64 {
    match estimate.uncertainty {
        Uncertainty::Bound(bound) => bound,
        Uncertainty::StandardError { value, .. } => STANDARD_ERRORS * value,
    }
}

pub(crate) fn room(size_m: DVec3) -> Room {
    Room { size_m, reflectance: Reflectances::with_equal_walls(0.2, 0.5, 0.7) }
}

/// A luminaire that shines downwards, or to all sides where its opening is round.
pub(crate) fn lamp(opening: LuminousOpening, position_m: DVec3) -> Luminaire {
    let gamma_deg: Vec<f64> = (0..=36).map(|k| 5.0 * f64::from(k)).collect();
    let is_round = !matches!(opening, LuminousOpening::Box { .. });
    let candela = |gamma: &f64| {
        let down = 300.0 * gamma.to_radians().cos().max(0.0).powf(1.5);
        if is_round { 100.0 + 0.5 * down } else { down }
    };
    let table = LuminousIntensityDistribution::axial(gamma_deg.clone(), gamma_deg.iter().map(candela).collect());
    Luminaire {
        id: "lamp".into(),
        photometry: Arc::new(Photometry { opening, ..Photometry::of(table.unwrap()) }),
        position_m,
        orientation: orientation(0.0, 0.0, 0.0),
        flux_scale: 1.0,
        model: LuminaireModel::Area,
    }
}

/// An opening of any form, of some decimetres.
pub(crate) fn opening(random: &mut Random) -> LuminousOpening {
    let mut side = || random.within(0.1, 0.6);
    let (x_m, y_m, z_m) = (side(), side(), side());
    match random.below(8) {
        0 | 1 => LuminousOpening::Box { x_m, y_m, height_m: 0.0 },
        2 => LuminousOpening::Ellipse { x_m, y_m, height_m: 0.0 },
        3 => LuminousOpening::Box { x_m, y_m, height_m: z_m },
        4 => LuminousOpening::Ellipse { x_m, y_m, height_m: z_m },
        5 => LuminousOpening::Ellipsoid { x_m, y_m: x_m, z_m },
        6 => LuminousOpening::LyingCylinder { axis: HorizontalAxis::X, length_m: x_m, diameter_m: 0.5 * y_m },
        _ => LuminousOpening::LyingCylinder { axis: HorizontalAxis::Y, length_m: x_m, diameter_m: 0.5 * y_m },
    }
}

/// A body as a box or as a mesh.
fn body(random: &mut Random, min_m: DVec3, max_m: DVec3) -> Obstacle {
    let Mesh { vertices_m, triangles } = Mesh::cuboid(min_m, max_m);
    let shape = match random.below(2) {
        0 => Shape::Box { min_m, max_m },
        _ => Shape::Mesh { vertices_m, triangles },
    };
    Obstacle { shape, reflectance: random.within(0.2, 0.8) }
}

/// Azimuth and tilt, in one of many notations, of what shines along a horizontal or vertical vector.
fn angles(random: &mut Random, normal: DVec3) -> [f64; 2] {
    let turns = 360.0 * (random.below(3) as f64 - 1.0);
    if normal.z.abs() > 0.5 {
        let azimuth = if random.below(2) == 0 { 0.0 } else { random.within(0.0, 360.0) };
        return [azimuth, if normal.z < 0.0 { turns } else { 180.0 + turns }];
    }
    let azimuth = normal.y.atan2(normal.x).to_degrees();
    if random.below(2) == 0 { [azimuth + 180.0 + turns, 90.0] } else { [azimuth + turns, -90.0] }
}

/// A luminaire on a wall, an inner wall, a box or a mesh.
pub(crate) fn contact(random: &mut Random) -> Scene {
    let walls = [[0.0, 0.0], [6.0, 0.0], [6.0, 2.0], [3.0, 2.0], [3.0, 5.0], [0.0, 5.0]];
    let slanted = [[0.0, 0.0], [6.0, 0.0], [6.0, 3.0], [4.0, 5.0], [0.0, 5.0]];
    let prism = |floor: &[[f64; 2]], rho: &[f64]| {
        let floor: Vec<DVec2> = floor.iter().map(|p| DVec2::from(*p)).collect();
        Enclosure::prism(&floor, 3.0, [0.25, 0.65], rho).unwrap()
    };
    let (min_m, max_m) = (DVec3::new(0.9, 0.8, 0.6 * random.below(2) as f64), DVec3::new(2.1, 1.7, 1.4));
    let mut bodies = vec![body(random, min_m, max_m)];
    let middle = 0.5 * (min_m + max_m);
    let r = 0.5_f64.sqrt();
    // The enclosure, a place on a surface and where that faces.
    let (enclosure, at_m, normal) = match random.below(8) {
        0 => (prism(&walls, &[0.5; 6]), DVec3::new(4.5, 2.0, 1.5), DVec3::NEG_Y),
        1 => (prism(&walls, &[0.1, 0.2, 0.3, 0.4, 0.5, 0.6]), DVec3::new(3.0, 3.5, 1.5), DVec3::NEG_X),
        2 => (prism(&slanted, &[0.5; 5]), DVec3::new(5.0, 4.0, 1.5), DVec3::new(-r, -r, 0.0)),
        3 => (prism(&walls, &[0.5; 6]), DVec3::new(4.5, 1.0, 3.0), DVec3::NEG_Z),
        4 => (Enclosure::cuboid(room(DVec3::new(6.0, 5.0, 3.0))), middle.with_x(max_m.x), DVec3::X),
        5 => (prism(&walls, &[0.5; 6]), middle.with_y(min_m.y), DVec3::NEG_Y),
        _ => (Enclosure::cuboid(room(DVec3::new(6.0, 5.0, 3.0))), middle.with_z(max_m.z), DVec3::Z),
    };
    let [azimuth, tilt] = angles(random, normal);
    // A flat opening, or a body that stands on its lower face, upside down.
    let opening = match random.below(4) {
        0 => LuminousOpening::Ellipse { x_m: 0.5, y_m: 0.3, height_m: 0.0 },
        1 => LuminousOpening::Ellipse { x_m: 0.3, y_m: 0.3, height_m: 0.2 },
        2 => LuminousOpening::Box { x_m: 0.6, y_m: 0.3, height_m: 0.0 },
        _ => LuminousOpening::Box { x_m: 0.4, y_m: 0.3, height_m: 0.2 },
    };
    let mut lamp = lamp(opening, at_m);
    lamp.orientation = orientation(azimuth, tilt, 90.0 * random.below(4) as f64);
    lamp.position_m += (opening.reach_m(DVec3::Z) + 1e-6 * random.within(-1.0, 1.0)) * normal;
    bodies.extend(enclosure.walls.iter().cloned());
    let placed = Surfaces::new(Some(enclosure.room), &bodies).place(&lamp);
    assert!(!placed.plates.is_empty(), "{at_m} {normal}: {:?}", placed.luminaire);
    bodies.splice(0..0, placed.plates);
    Scene { room: Some(enclosure.room), obstacles: bodies, luminaires: vec![placed.luminaire] }
}

/// Meters that stand clear of everything, in a corner that belongs to all rooms.
pub(crate) fn meters(random: &mut Random, scene: &Scene, count: usize) -> Vec<Meter> {
    let is_clear = |p: DVec3| {
        let of_bodies = scene.obstacles.iter().all(|o| match &o.shape {
            Shape::Box { min_m, max_m } => p.distance(p.clamp(*min_m, *max_m)) > 0.1,
            Shape::Mesh { vertices_m, .. } => {
                let low = vertices_m.iter().copied().fold(DVec3::INFINITY, DVec3::min);
                let high = vertices_m.iter().copied().fold(DVec3::NEG_INFINITY, DVec3::max);
                let is_wall = (high - low).max_element() > 2.5;
                is_wall || p.distance(p.clamp(low, high)) > 0.1
            }
        });
        of_bodies && scene.luminaires.iter().all(|l| l.position_m.distance(p) > 0.6)
    };
    let mut meters = vec![];
    while meters.len() < count {
        let position_m = DVec3::new(random.within(0.2, 2.8), random.within(0.2, 4.6), random.within(0.2, 2.6));
        let normal = [DVec3::Z, DVec3::NEG_Z, DVec3::X, DVec3::NEG_X, DVec3::Y, DVec3::NEG_Y][random.below(6)];
        if is_clear(position_m) {
            meters.push(Meter { position_m, normal });
        }
    }
    meters
}
