//! Laws of similarity: scaling, moving, turning or mirroring a whole scene changes readings only by the squared scale.

use std::sync::Arc;

use glam::{DMat3, DVec3};
use luxproof_photometry::{Goniometer, LuminousOpening, Photometry};
use luxproof_scene::geometry::{Reflectances, Room, Surface};
use luxproof_scene::{Luminaire, LuminaireModel, Obstacle, Scene, Shape, Transport};

use super::{Against, Law, Light, Variant};
use luxproof_engines::Job;

/// The law of larger scenes; that of smaller ones differs in its magnitudes.
const SCALE_UP: Law = Law {
    id: "scale_up",
    what: "all lengths times s: illuminance divided by the square of s",
    unit: "s",
    magnitudes: &[10.0, 1e2, 1e3, 1e4, 1e5, 1e6],
    light: Light::Either,
    variant: scale_job,
};

/// The laws, in the order of reports.
pub(super) const LAWS: &[Law] = &[
    SCALE_UP,
    Law { id: "scale_down", magnitudes: &[0.1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6], ..SCALE_UP },
    Law {
        id: "translation",
        what: "everything moved along each axis, in free field: the same direct light",
        unit: "m",
        magnitudes: &[10.0, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7],
        light: Light::Direct,
        variant: translate_job,
    },
    // A room always has a corner at the origin, so the moved one is built of plates within a larger black room.
    Law {
        id: "translated_room",
        what: "the room built of plates, far off in a large black room: the same reflected light",
        unit: "m",
        magnitudes: &[1.0, 10.0, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7],
        light: Light::Reflected,
        variant: translate_room,
    },
    Law {
        id: "turned_room",
        what: "everything turned about the vertical: the same light",
        unit: "quarter turns",
        magnitudes: &[1.0, 2.0, 3.0],
        light: Light::Either,
        variant: |job, quarters| {
            let quarter = DMat3::from_cols(DVec3::Y, DVec3::NEG_X, DVec3::Z);
            Some(same_readings(map_job(job, (1..quarters as u32).fold(quarter, |turn, _| quarter * turn), 1.0)?))
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
            Some(same_readings(map_job(job, if thirds < 2.0 { third } else { third * third }, 1.0)?))
        },
    },
    Law {
        id: "turned_luminaire",
        what: "luminaires turned about their axes and their tables turned back: the same light",
        unit: "deg",
        magnitudes: &[7.0, 45.0, 123.4],
        light: Light::Either,
        variant: turn_luminaires,
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
            Some(same_readings(map_job(job, DMat3::from_diagonal(flip), 1.0)?))
        },
    },
];

/// A job that must read the same as the unchanged one.
fn same_readings(job: Job) -> Variant {
    Variant { job, against: Against::Base(1.0) }
}

/// The whole job scaled; illuminance falls with the square of the scale.
fn scale_job(job: &Job, scale: f64) -> Option<Variant> {
    Some(Variant { job: map_job(job, DMat3::IDENTITY, scale)?, against: Against::Base(1.0 / (scale * scale)) })
}

/// A similarity of space: a signed permutation of the axes, a scale and an offset.
#[derive(Clone, Copy)]
struct Similarity {
    linear: DMat3,
    scale: f64,
    offset_m: DVec3,
}

impl Similarity {
    /// The image of a point.
    fn point(&self, point_m: DVec3) -> DVec3 {
        self.scale * (self.linear * point_m) + self.offset_m
    }

    fn is_mirror(&self) -> bool {
        self.linear.determinant() < 0.0
    }
}

/// The whole job scaled and turned or mirrored by a signed permutation of the axes, with its room at the origin.
fn map_job(job: &Job, linear: DMat3, scale: f64) -> Option<Job> {
    let room = job.scene.room?;
    let size_m = scale * (linear * room.size_m);
    let map = Similarity { linear, scale, offset_m: -size_m.min(DVec3::ZERO) };
    let room = Room { size_m: size_m.abs(), reflectance: map_reflectances(&room, linear) };
    let scene = Scene {
        room: Some(room),
        obstacles: job.scene.obstacles.iter().map(|o| map_obstacle(o, map)).collect(),
        luminaires: job.scene.luminaires.iter().map(|l| map_luminaire(l, map)).collect(),
    };
    let mut sensors = job.sensors.clone();
    for sensor in &mut sensors {
        sensor.meter.position_m = map.point(sensor.meter.position_m);
        sensor.meter.normal = linear * sensor.meter.normal;
    }
    Some(Job { scene, sensors, ..job.clone() })
}

/// The reflectances of the room's surfaces in their new places.
fn map_reflectances(room: &Room, linear: DMat3) -> Reflectances {
    let [floor, ceiling, wall_x_min, wall_x_max, wall_y_min, wall_y_max] =
        [Surface::Floor, Surface::Ceiling, Surface::WallXMin, Surface::WallXMax, Surface::WallYMin, Surface::WallYMax]
            .map(|new| {
                let old =
                    Surface::ALL.into_iter().find(|old| (linear * old.inward_normal()).dot(new.inward_normal()) > 0.5);
                old.map_or(0.0, |old| room.reflectance.of(old))
            });
    Reflectances { floor, ceiling, wall_x_min, wall_x_max, wall_y_min, wall_y_max }
}

/// The image of a body.
fn map_obstacle(obstacle: &Obstacle, map: Similarity) -> Obstacle {
    let shape = match &obstacle.shape {
        Shape::Box { min_m, max_m } => {
            let (a, b) = (map.point(*min_m), map.point(*max_m));
            Shape::Box { min_m: a.min(b), max_m: a.max(b) }
        }
        Shape::Mesh { vertices_m, triangles } => Shape::Mesh {
            vertices_m: vertices_m.iter().map(|v| map.point(*v)).collect(),
            // A mirror turns counter-clockwise triangles into clockwise ones.
            triangles: triangles.iter().map(|&[a, b, c]| if map.is_mirror() { [a, c, b] } else { [a, b, c] }).collect(),
        },
    };
    Obstacle { shape, reflectance: obstacle.reflectance }
}

/// The image of a luminaire.
fn map_luminaire(luminaire: &Luminaire, map: Similarity) -> Luminaire {
    let position_m = map.point(luminaire.position_m);
    let mut photometry = Photometry::clone(&luminaire.photometry);
    photometry.opening = scale_opening(photometry.opening, map.scale);
    let mut orientation = map.linear * luminaire.orientation;
    if map.is_mirror() {
        // A mirror is no rotation. The table takes it, and the orientation takes a second one that makes it a rotation.
        photometry.distribution = photometry.distribution.mirrored();
        orientation *= DMat3::from_diagonal(DVec3::new(-1.0, 1.0, 1.0));
    }
    Luminaire { position_m, orientation, photometry: Arc::new(photometry), ..luminaire.clone() }
}

/// An opening with scaled lengths.
fn scale_opening(mut opening: LuminousOpening, scale: f64) -> LuminousOpening {
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

/// The job with its luminaires, meters and bodies moved; its room stays.
fn move_contents(job: &Job, by_m: DVec3) -> Job {
    let map = Similarity { linear: DMat3::IDENTITY, scale: 1.0, offset_m: by_m };
    let mut moved = job.clone();
    for luminaire in &mut moved.scene.luminaires {
        luminaire.position_m += by_m;
    }
    for sensor in &mut moved.sensors {
        sensor.meter.position_m += by_m;
    }
    moved.scene.obstacles = job.scene.obstacles.iter().map(|o| map_obstacle(o, map)).collect();
    moved
}

/// Everything moved, without the room: a convex room hides no direct light.
fn translate_job(job: &Job, distance_m: f64) -> Option<Variant> {
    let mut moved = move_contents(job, DVec3::splat(distance_m));
    moved.scene.room.take()?;
    Some(same_readings(moved))
}

/// The thickness of the plates, relative to the room's largest extent.
const PLATE_THICKNESS: f64 = 0.05;

/// The room built of plates, far from the origin of a black room.
fn translate_room(job: &Job, distance_m: f64) -> Option<Variant> {
    let room = job.scene.room?;
    let thick = PLATE_THICKNESS * room.size_m.max_element();
    let low = DVec3::splat(distance_m + thick);
    let high = low + room.size_m;
    let mut far = move_contents(job, low);
    for surface in Surface::ALL {
        let shape = plate(surface, low, high, thick);
        far.scene.obstacles.push(Obstacle { shape, reflectance: room.reflectance.of(surface) });
    }
    let size_m = high + DVec3::splat(2.0 * thick);
    far.scene.room = Some(Room { size_m, reflectance: Reflectances::with_equal_walls(0.0, 0.0, 0.0) });
    matches!(job.transport, Transport::Indirect(_)).then(|| same_readings(far))
}

/// The plate outside a surface of the box from `low` to `high`.
///
/// Floor and ceiling cover the edges of the walls, and walls along x those of walls along y. Plates thus neither
/// overlap nor leave gaps.
fn plate(surface: Surface, low: DVec3, high: DVec3, thick: f64) -> Shape {
    let axis = surface.axis();
    let (mut min_m, mut max_m) = (low, high);
    for k in 0..axis {
        min_m[k] -= thick;
        max_m[k] += thick;
    }
    if surface.is_far() {
        (min_m[axis], max_m[axis]) = (high[axis], high[axis] + thick);
    } else {
        (min_m[axis], max_m[axis]) = (low[axis] - thick, low[axis]);
    }
    Shape::Box { min_m, max_m }
}

/// Luminaires turned about their axes, with tables that are turned back.
fn turn_luminaires(job: &Job, turn_deg: f64) -> Option<Variant> {
    let mut turned = job.clone();
    for luminaire in &mut turned.scene.luminaires {
        // A table of type B has another axis, so that its turned values are no such table.
        let has_axis = luminaire.photometry.distribution.goniometer() != Goniometer::B;
        if luminaire.model != LuminaireModel::Point || !has_axis {
            return None;
        }
        let distribution = luminaire.photometry.distribution.turned(-turn_deg);
        luminaire.photometry = Arc::new(luminaire.photometry.with_distribution(distribution));
        luminaire.orientation *= DMat3::from_rotation_z(turn_deg.to_radians());
    }
    Some(same_readings(turned))
}
