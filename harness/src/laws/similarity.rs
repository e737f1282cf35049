//! Laws of similarity: a scene that is scaled, moved, turned or mirrored as a whole reads the same, but for the square of the scale.

use std::sync::Arc;

use glam::{DMat3, DVec3};
use luminaire::geometry::{Reflectances, Room, Surface};
use luminaire::photometry::{Goniometer, LuminousOpening, Photometry};
use luminaire::scene::{Luminaire, LuminaireModel, Obstacle, Scene, Shape, Transport};

use super::{Against, Law, Light, Variant};
use crate::engines::{Job, Station};

const SCALE_UP: Law = Law {
    id: "scale_up",
    what: "all lengths times s: illuminance divided by the square of s",
    unit: "s",
    magnitudes: &[10.0, 1e2, 1e3, 1e4, 1e5, 1e6],
    light: Light::Either,
    variant: scaled,
};

/// In the order of reports.
pub(super) const LAWS: &[Law] = &[
    SCALE_UP,
    Law { id: "scale_down", magnitudes: &[0.1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6], ..SCALE_UP },
    Law {
        id: "translation",
        what: "everything moved along each axis, in free field: the same direct light",
        unit: "m",
        magnitudes: &[10.0, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7],
        light: Light::Direct,
        variant: translated,
    },
    // A spec's room has a corner at the origin, so that it is moved as a room of plates in a black room as much larger.
    Law {
        id: "translated_room",
        what: "the room built of plates, far off in a large black room: the same reflected light",
        unit: "m",
        magnitudes: &[1.0, 10.0, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7],
        light: Light::Reflected,
        variant: translated_room,
    },
    Law {
        id: "turned_room",
        what: "everything turned about the vertical: the same light",
        unit: "quarter turns",
        magnitudes: &[1.0, 2.0, 3.0],
        light: Light::Either,
        variant: |job, quarters| {
            let quarter = DMat3::from_cols(DVec3::Y, DVec3::NEG_X, DVec3::Z);
            Some(same(mapped(job, (1..quarters as u32).fold(quarter, |turn, _| quarter * turn), 1.0)?))
        },
    },
    Law {
        id: "room_on_its_side",
        what: "everything turned about the room's diagonal, so that a wall becomes the floor: the same light",
        unit: "third turns",
        magnitudes: &[1.0, 2.0],
        light: Light::Either,
        variant: |job, thirds| {
            let third = DMat3::from_cols(DVec3::Y, DVec3::Z, DVec3::X);
            Some(same(mapped(job, if thirds < 2.0 { third } else { third * third }, 1.0)?))
        },
    },
    Law {
        id: "turned_luminaire",
        what: "luminaires turned about their axes and their tables turned back: the same light",
        unit: "deg",
        magnitudes: &[7.0, 45.0, 123.4],
        light: Light::Either,
        variant: turned_luminaire,
    },
    Law {
        id: "mirror",
        what: "everything mirrored, tables too: the same light",
        unit: "axis, x = 1",
        magnitudes: &[1.0, 2.0, 3.0],
        light: Light::Either,
        variant: |job, axis| {
            let mut flip = DVec3::ONE;
            flip[axis as usize - 1] = -1.0;
            Some(same(mapped(job, DMat3::from_diagonal(flip), 1.0)?))
        },
    },
];

fn same(job: Job) -> Variant {
    Variant { job, against: Against::Base(1.0) }
}

fn scaled(job: &Job, scale: f64) -> Option<Variant> {
    Some(Variant { job: mapped(job, DMat3::IDENTITY, scale)?, against: Against::Base(1.0 / (scale * scale)) })
}

/// The whole job scaled and turned or mirrored by a signed permutation of the axes, its room back at the origin.
fn mapped(job: &Job, linear: DMat3, scale: f64) -> Option<Job> {
    let room = job.scene.room?;
    let size_m = scale * (linear * room.size_m);
    let offset_m = -size_m.min(DVec3::ZERO);
    let place = |p: DVec3| scale * (linear * p) + offset_m;
    let room = Room { size_m: size_m.abs(), reflectance: reflectances(&room, linear) };
    let scene = Scene {
        room: Some(room),
        obstacles: job.scene.obstacles.iter().map(|o| obstacle(o, &place, linear.determinant())).collect(),
        luminaires: job.scene.luminaires.iter().map(|l| luminaire(l, place(l.position_m), linear, scale)).collect(),
    };
    let moved = |s: &Station| {
        let mut station = s.clone();
        station.meter.position_m = place(s.meter.position_m);
        station.meter.normal = linear * s.meter.normal;
        station
    };
    Some(Job { scene, stations: job.stations.iter().map(moved).collect(), ..job.clone() })
}

fn reflectances(room: &Room, linear: DMat3) -> Reflectances {
    let of = |new: Surface| {
        let old = Surface::ALL.into_iter().find(|old| (linear * old.inward_normal()).dot(new.inward_normal()) > 0.5);
        old.map_or(0.0, |old| room.reflectance.of(old))
    };
    let [floor, ceiling] = [Surface::Floor, Surface::Ceiling].map(of);
    let [wall_x_min, wall_x_max] = [Surface::WallXMin, Surface::WallXMax].map(of);
    let [wall_y_min, wall_y_max] = [Surface::WallYMin, Surface::WallYMax].map(of);
    Reflectances { floor, ceiling, wall_x_min, wall_x_max, wall_y_min, wall_y_max }
}

fn obstacle(obstacle: &Obstacle, place: &impl Fn(DVec3) -> DVec3, determinant: f64) -> Obstacle {
    let shape = match &obstacle.shape {
        Shape::Box { min_m, max_m } => {
            let (a, b) = (place(*min_m), place(*max_m));
            Shape::Box { min_m: a.min(b), max_m: a.max(b) }
        }
        Shape::Mesh { vertices_m, triangles } => Shape::Mesh {
            vertices_m: vertices_m.iter().map(|v| place(*v)).collect(),
            // Mirrored, the other way round is counter-clockwise.
            triangles: triangles
                .iter()
                .map(|&[a, b, c]| if determinant < 0.0 { [a, c, b] } else { [a, b, c] })
                .collect(),
        },
    };
    Obstacle { shape, reflectance: obstacle.reflectance }
}

fn luminaire(luminaire: &Luminaire, position_m: DVec3, linear: DMat3, scale: f64) -> Luminaire {
    let mut photometry = Photometry::clone(&luminaire.photometry);
    photometry.opening = opening(photometry.opening, scale);
    let mut orientation = linear * luminaire.orientation;
    if linear.determinant() < 0.0 {
        // A mirror is no rotation: it goes into the table, and with another mirror into the orientation.
        photometry.distribution = photometry.distribution.mirrored();
        orientation *= DMat3::from_diagonal(DVec3::new(-1.0, 1.0, 1.0));
    }
    Luminaire { position_m, orientation, photometry: Arc::new(photometry), ..luminaire.clone() }
}

fn opening(mut opening: LuminousOpening, scale: f64) -> LuminousOpening {
    match &mut opening {
        LuminousOpening::Point => {}
        LuminousOpening::Box { x_m: x, y_m: y, height_m: z }
        | LuminousOpening::Ellipse { x_m: x, y_m: y, height_m: z }
        | LuminousOpening::Ellipsoid { x_m: x, y_m: y, z_m: z } => [x, y, z].into_iter().for_each(|m| *m *= scale),
        LuminousOpening::LyingCylinder { length_m, diameter_m, .. } => {
            *length_m *= scale;
            *diameter_m *= scale;
        }
    }
    opening
}

fn moved(job: &Job, by_m: DVec3) -> Job {
    let mut moved = job.clone();
    for luminaire in &mut moved.scene.luminaires {
        luminaire.position_m += by_m;
    }
    for station in &mut moved.stations {
        station.meter.position_m += by_m;
    }
    moved.scene.obstacles = job.scene.obstacles.iter().map(|o| obstacle(o, &|p| p + by_m, 1.0)).collect();
    moved
}

/// An empty convex room stands in the way of no direct light: without it, everything can be moved.
fn translated(job: &Job, distance_m: f64) -> Option<Variant> {
    let mut moved = moved(job, DVec3::splat(distance_m));
    moved.scene.room.take()?;
    Some(same(moved))
}

/// Thickness of the plates, in parts of the room's largest extent.
const PLATE: f64 = 0.05;

fn translated_room(job: &Job, distance_m: f64) -> Option<Variant> {
    let room = job.scene.room?;
    let thick = PLATE * room.size_m.max_element();
    let low = DVec3::splat(distance_m + thick);
    let high = low + room.size_m;
    let mut far = moved(job, low);
    let plate = |surface: Surface| {
        let axis = surface.axis();
        // Floor and ceiling cover the walls' edges, walls along x those of walls along y: nothing overlaps, nothing gapes.
        let beyond = |k: usize| if k < axis { thick } else { 0.0 };
        let (mut min_m, mut max_m) = (low, high);
        for k in 0..3 {
            min_m[k] -= beyond(k);
            max_m[k] += beyond(k);
        }
        if surface.is_far() {
            (min_m[axis], max_m[axis]) = (high[axis], high[axis] + thick);
        } else {
            (min_m[axis], max_m[axis]) = (low[axis] - thick, low[axis]);
        }
        Obstacle { shape: Shape::Box { min_m, max_m }, reflectance: room.reflectance.of(surface) }
    };
    far.scene.obstacles.extend(Surface::ALL.map(plate));
    let size_m = high + DVec3::splat(2.0 * thick);
    far.scene.room = Some(Room { size_m, reflectance: Reflectances::with_equal_walls(0.0, 0.0, 0.0) });
    matches!(job.transport, Transport::Indirect(_)).then(|| same(far))
}

fn turned_luminaire(job: &Job, turn_deg: f64) -> Option<Variant> {
    let mut turned = job.clone();
    for luminaire in &mut turned.scene.luminaires {
        // A table of type B, turned about the vertical, is none.
        let has_axis = luminaire.photometry.distribution.goniometer() != Goniometer::B;
        if luminaire.model != LuminaireModel::Point || !has_axis {
            return None;
        }
        let distribution = luminaire.photometry.distribution.turned(-turn_deg);
        luminaire.photometry = Arc::new(luminaire.photometry.with_distribution(distribution));
        luminaire.orientation *= DMat3::from_rotation_z(turn_deg.to_radians());
    }
    Some(same(turned))
}
