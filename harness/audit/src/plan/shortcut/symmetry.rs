//! Symmetric scenes: of meters that a symmetry of room, bodies and luminaires maps to one another, one is rendered.

use std::collections::{BTreeMap, BTreeSet};

use glam::{DMat3, DVec3};
use luxproof_photometry::{LuminousOpening, direction};
use luxproof_scene::geometry::{Room, Surface};
use luxproof_scene::{Luminaire, LuminaireModel, Meter, Obstacle, Scene, Shape, flush};

use super::{Fill, Shortcut};
use luxproof_engines::{Job, Sensor};
use luxproof_model::Scope;

/// The largest distance of two positions that count as one, relative to the room's largest extent.
const MAX_RELATIVE_DISTANCE: f64 = 1e-7;
/// The largest difference of two intensities that count as equal, relative to the largest intensity.
const MAX_INTENSITY_DIFFERENCE: f64 = 1e-9;
/// The offset from a table's nodes, where intensity may jump.
const NODE_OFFSET_DEG: f64 = 1e-6;

/// Leaves out meters that mirror others. The identity counts as a symmetry, for two meters at one place.
pub(super) fn shorten(shortcut: &mut Shortcut, asked: &Job) {
    let sensors = &shortcut.job.sensors;
    let size_m = asked.scene.room.map_or(DVec3::ONE, |r| r.size_m);
    let places: BTreeMap<[i64; 6], usize> =
        sensors.iter().enumerate().rev().map(|(k, s)| (place(&s.meter, size_m), k)).collect();
    let mut motions = Motion::all(size_m);
    // The meters are checked first, since that costs less than a comparison of the scenes.
    motions.retain(|m| m.is_identity() || moves_meters(m, sensors, &places) && is_symmetric(&asked.scene, m));
    let mut images: Vec<Option<(usize, String)>> = vec![];
    let mut from: BTreeMap<[i64; 6], (usize, String)> = BTreeMap::new();
    for (k, sensor) in sensors.iter().enumerate() {
        let known = from.get(&place(&sensor.meter, size_m)).cloned();
        if known.is_none() {
            for motion in &motions {
                from.entry(place(&motion.meter(&sensor.meter), size_m)).or_insert_with(|| (k, motion.name()));
            }
        }
        images.push(known);
    }
    let (left_out, all) = (images.iter().flatten().count(), images.len());
    if left_out == 0 {
        return;
    }
    let names: BTreeSet<&str> = images.iter().flatten().map(|(_, by)| by.as_str()).collect();
    let names = Vec::from_iter(names).join(" or ");
    let rendered = all - left_out;
    let reason =
        format!("by symmetry ({names}) only {rendered} of {all} points are rendered; `--no-skips` renders all of them");
    let wanted: Vec<bool> = images.iter().map(Option::is_none).collect();
    shortcut.render_only(&wanted, |k| match images[k].clone() {
        Some((sensor, by)) => Fill::Mirrors { sensor, by },
        None => Fill::Rendered(k),
    });
    shortcut.omit(Scope::Meter, left_out as f64 / all as f64, reason);
}

/// Whether a motion maps any meter to another one; `places` has the first sensor at each place.
fn moves_meters(motion: &Motion, sensors: &[Sensor], places: &BTreeMap<[i64; 6], usize>) -> bool {
    sensors.iter().enumerate().any(|(k, sensor)| {
        let image = place(&motion.meter(&sensor.meter), motion.size_m);
        places.get(&image).is_some_and(|j| *j != k)
    })
}

/// A symmetry of a box: it permutes the axes and then mirrors them, about the box's center.
#[derive(Clone, Copy, Debug)]
struct Motion {
    matrix: DMat3,
    size_m: DVec3,
}

impl Motion {
    /// The symmetries of a box of this size; the identity is the first.
    fn all(size_m: DVec3) -> Vec<Self> {
        let axes = [DVec3::X, DVec3::Y, DVec3::Z];
        let orders = [[0, 1, 2], [1, 0, 2], [0, 2, 1], [2, 1, 0], [1, 2, 0], [2, 0, 1]];
        let mut all = vec![];
        for order in orders {
            // Permuted axes must be equally long.
            if (0..3).any(|a| (size_m[a] - size_m[order[a]]).abs() > 1e-12 * size_m.max_element()) {
                continue;
            }
            for signs in 0..8 {
                let [x, y, z] = order.map(|axis| axes[axis] * if signs >> axis & 1 == 1 { -1.0 } else { 1.0 });
                all.push(Self { matrix: DMat3::from_cols(x, y, z), size_m });
            }
        }
        all
    }

    /// Whether every point stays at its place.
    fn is_identity(&self) -> bool {
        self.matrix == DMat3::IDENTITY
    }

    /// The image of a point.
    fn point(&self, point_m: DVec3) -> DVec3 {
        self.matrix * (point_m - 0.5 * self.size_m) + 0.5 * self.size_m
    }

    /// The image of a meter.
    fn meter(&self, meter: &Meter) -> Meter {
        Meter { position_m: self.point(meter.position_m), normal: self.matrix * meter.normal }
    }

    /// The motion in words, such as `x -> y, y -> -x`.
    fn name(&self) -> String {
        if self.is_identity() {
            return "no motion (one place)".to_owned();
        }
        let names = ["x", "y", "z"];
        let mut changes = vec![];
        for a in 0..3 {
            let image = self.matrix.col(a);
            let (axis, sign) = (0..3).map(|b| (b, image[b])).find(|(_, s)| *s != 0.0).unwrap_or((a, 1.0));
            if axis != a || sign < 0.0 {
                changes.push(format!("{} -> {}{}", names[a], if sign < 0.0 { "-" } else { "" }, names[axis]));
            }
        }
        changes.join(", ")
    }
}

/// A meter's position and normal as integers, in steps far below the resolution of any reading.
fn place(meter: &Meter, size_m: DVec3) -> [i64; 6] {
    let step_m = MAX_RELATIVE_DISTANCE * size_m.max_element();
    let p = (meter.position_m / step_m).round();
    let n = (meter.normal / MAX_RELATIVE_DISTANCE).round();
    [p.x as i64, p.y as i64, p.z as i64, n.x as i64, n.y as i64, n.z as i64]
}

/// Whether a motion leaves reflectances, bodies and luminaires as they are.
fn is_symmetric(scene: &Scene, motion: &Motion) -> bool {
    let near_m = MAX_RELATIVE_DISTANCE * motion.size_m.max_element();
    let room = scene.room.is_some_and(|room| preserves_reflectances(&room, motion));
    let bodies = scene.obstacles.iter().all(|o| scene.obstacles.iter().any(|other| is_image(o, other, motion, near_m)));
    room && bodies && scene.luminaires.iter().all(|l| has_luminaire_image(scene, l, motion, near_m))
}

/// Whether a luminaire of the scene is the image of this one.
fn has_luminaire_image(scene: &Scene, luminaire: &Luminaire, motion: &Motion, near_m: f64) -> bool {
    let image_m = motion.point(luminaire.position_m);
    let at_image = scene.luminaires.iter().filter(|other| other.position_m.distance(image_m) < near_m);
    // Several luminaires at one place would have to be paired; they are rare, and count as asymmetric.
    match at_image.collect::<Vec<_>>()[..] {
        [only] => is_same_light(luminaire, only, motion.matrix),
        _ => false,
    }
}

/// Whether a motion maps each surface of a room to one of the same reflectance.
fn preserves_reflectances(room: &Room, motion: &Motion) -> bool {
    Surface::ALL.into_iter().all(|surface| {
        let normal = motion.matrix * surface.inward_normal();
        let image = Surface::ALL.into_iter().find(|other| other.inward_normal().dot(normal) > 0.5);
        image.is_some_and(|image| room.reflectance.of(image) == room.reflectance.of(surface))
    })
}

/// Whether a motion maps one box to another, or one recessed opening to another. Other meshes count as different.
fn is_image(body: &Obstacle, other: &Obstacle, motion: &Motion, near_m: f64) -> bool {
    let is_same_shape = match (&body.shape, &other.shape) {
        (Shape::Box { min_m, max_m }, Shape::Box { min_m: low, max_m: high }) => {
            let (a, b) = (motion.point(*min_m), motion.point(*max_m));
            a.min(b).distance(*low) < near_m && a.max(b).distance(*high) < near_m
        }
        // Plates are convex, so their corners determine them.
        (Shape::Mesh { vertices_m, .. }, Shape::Mesh { vertices_m: others, .. }) => {
            let has_image = |p: &DVec3| others.iter().any(|q| motion.point(*p).distance(*q) < near_m);
            flush::is_plate(body)
                && flush::is_plate(other)
                && vertices_m.len() == others.len()
                && vertices_m.iter().all(has_image)
        }
        _ => false,
    };
    body.reflectance == other.reflectance && is_same_shape
}

/// Whether the light of luminaire `b` is the image of that of luminaire `a`, and likewise its opening.
///
/// Looks at the directions of the table of `a` alone: every luminaire is `a` once, so that no node of any table is missed.
fn is_same_light(a: &Luminaire, b: &Luminaire, matrix: DMat3) -> bool {
    let allowed_cd = MAX_INTENSITY_DIFFERENCE * (a.photometry.distribution.max_intensity().value() * a.flux_scale);
    let turn = b.orientation.transpose() * matrix * a.orientation;
    a.model == b.model
        && (a.model == LuminaireModel::Point || is_same_opening(&a.photometry.opening, &b.photometry.opening, turn))
        && has_same_intensities(a, b, matrix, allowed_cd)
}

/// Whether `b` emits as much as `a` in the image of each direction of the table of `a`.
fn has_same_intensities(a: &Luminaire, b: &Luminaire, matrix: DMat3, allowed_cd: f64) -> bool {
    directions(a).all(|direction| {
        let direction = a.orientation * direction;
        let difference_cd = a.intensity_towards(direction).value() - b.intensity_towards(matrix * direction).value();
        difference_cd.abs() <= allowed_cd
    })
}

/// Directions between the nodes of a luminaire's table and on both sides of them, in the luminaire's frame.
fn directions(luminaire: &Luminaire) -> impl Iterator<Item = DVec3> + use<> {
    let table = luminaire.photometry.distribution.own_planes();
    let mut gamma = midpoints(table.gamma_deg());
    gamma.extend(
        table
            .gamma_deg()
            .iter()
            .flat_map(|g| [g - NODE_OFFSET_DEG, g + NODE_OFFSET_DEG])
            .filter(|g| (0.0..=180.0).contains(g)),
    );
    let mut c = midpoints(table.c_deg());
    if table.is_native() {
        c.extend(table.c_deg().iter().flat_map(|c| [c - NODE_OFFSET_DEG, c + NODE_OFFSET_DEG]));
    }
    // An axial table has a single plane, and then any plane has the same values.
    c.extend(table.c_deg().iter().copied().chain([0.0, 33.0, 90.0, 180.0, 270.0]));
    let frame = table.own_frame();
    c.into_iter().flat_map(move |c| gamma.clone().into_iter().map(move |g| frame * direction(c, g)))
}

/// The midpoints between neighboring nodes.
fn midpoints(nodes: &[f64]) -> Vec<f64> {
    nodes.windows(2).map(|w| 0.5 * (w[0] + w[1])).collect()
}

/// Whether an opening, turned from one luminaire's frame to the other's, is the other's.
fn is_same_opening(a: &LuminousOpening, b: &LuminousOpening, turn: DMat3) -> bool {
    let is_permutation = turn.to_cols_array().iter().all(|v| v.abs() < 1e-9 || (v.abs() - 1.0).abs() < 1e-9);
    let absolute = DMat3::from_cols(turn.x_axis.abs(), turn.y_axis.abs(), turn.z_axis.abs());
    let same_size = (absolute * opening_size_m(a) - opening_size_m(b)).abs().max_element() < 1e-9;
    let upright = turn.z_axis.z.abs() > 0.5;
    let kind = match (a, b) {
        (LuminousOpening::Ellipse { .. }, LuminousOpening::Ellipse { .. }) => upright,
        (LuminousOpening::LyingCylinder { axis: m, .. }, LuminousOpening::LyingCylinder { axis: n, .. }) => {
            m == n && upright && turn.x_axis.x.abs() > 0.5
        }
        (a, b) => std::mem::discriminant(a) == std::mem::discriminant(b),
    };
    is_permutation && same_size && kind
}

/// The extent of an opening's bounding box along x, y and z.
fn opening_size_m(opening: &LuminousOpening) -> DVec3 {
    let [y, x, z] = opening.bounding_box_m();
    DVec3::new(x, y, z)
}
