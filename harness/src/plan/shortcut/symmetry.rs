//! Symmetric scenes: of meters that a symmetry of room, bodies and luminaires takes to one another, one is rendered; pure.

use std::collections::{BTreeMap, BTreeSet};

use glam::{DMat3, DVec3};
use luminaire::geometry::{Room, Surface};
use luminaire::photometry::{LuminousOpening, direction};
use luminaire::scene::{Luminaire, LuminaireModel, Meter, Obstacle, Scene, Shape, flush};

use super::{Fill, Shortcut};
use crate::engines::Job;
use crate::plan::Scope;

/// Positions that are nearer than this are one, relative to the room's largest extent.
const SAME_PLACE: f64 = 1e-7;
/// Intensities that differ by less than this are one, relative to the largest.
const SAME_INTENSITY: f64 = 1e-9;
/// Beside nodes of a table, where intensity may jump.
const BESIDE_DEG: f64 = 1e-6;

/// Leaves out meters that a symmetry takes from others; the identity, too, where two meters are at one place.
pub(super) fn shorten(shortcut: &mut Shortcut, asked: &Job) {
    let stations = &shortcut.job.stations;
    let size_m = asked.scene.room.map_or(DVec3::ONE, |r| r.size_m);
    // Motions that take no meter to another are not worth a look at the scene.
    let places: BTreeMap<[i64; 6], usize> =
        stations.iter().enumerate().rev().map(|(k, s)| (place(&s.meter, size_m), k)).collect();
    let image = |m: &Motion, meter: &Meter| place(&m.meter(meter), size_m);
    let moves =
        |m: &Motion| stations.iter().enumerate().any(|(k, s)| places.get(&image(m, &s.meter)).is_some_and(|j| *j != k));
    let mut motions = Motion::all(size_m);
    motions.retain(|m| m.is_identity() || moves(m) && is_symmetric(&asked.scene, m));
    let mut images: Vec<Option<(usize, String)>> = vec![];
    let mut from: BTreeMap<[i64; 6], (usize, String)> = BTreeMap::new();
    for (k, station) in stations.iter().enumerate() {
        let known = from.get(&place(&station.meter, size_m)).cloned();
        if known.is_none() {
            for motion in &motions {
                from.entry(image(motion, &station.meter)).or_insert_with(|| (k, motion.name()));
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
    let reason = format!("room and luminaires are the same after {names}: {left_out} of {all} meters mirror others");
    let wanted: Vec<bool> = images.iter().map(Option::is_none).collect();
    let image = |k: usize| images[k].clone().map_or(Fill::Rendered(k), |(station, by)| Fill::Mirrors { station, by });
    shortcut.render_only(&wanted, image);
    shortcut.omit(Scope::Meter, left_out as f64 / all as f64, reason);
}

/// A symmetry of a box: axes exchanged, then mirrored, about the box's centre.
#[derive(Clone, Copy, Debug)]
struct Motion {
    matrix: DMat3,
    size_m: DVec3,
}

impl Motion {
    /// Those of a box of this size; the identity is the first.
    fn all(size_m: DVec3) -> Vec<Self> {
        let axes = [DVec3::X, DVec3::Y, DVec3::Z];
        let orders = [[0, 1, 2], [1, 0, 2], [0, 2, 1], [2, 1, 0], [1, 2, 0], [2, 0, 1]];
        let mut all = vec![];
        for order in orders {
            // Exchanged axes must be equally long.
            if (0..3).any(|a| (size_m[a] - size_m[order[a]]).abs() > 1e-12 * size_m.max_element()) {
                continue;
            }
            for signs in 0..8 {
                let column = |a: usize| axes[order[a]] * if signs >> order[a] & 1 == 1 { -1.0 } else { 1.0 };
                all.push(Self { matrix: DMat3::from_cols(column(0), column(1), column(2)), size_m });
            }
        }
        all
    }

    fn is_identity(&self) -> bool {
        self.matrix == DMat3::IDENTITY
    }

    fn point(&self, point_m: DVec3) -> DVec3 {
        self.matrix * (point_m - 0.5 * self.size_m) + 0.5 * self.size_m
    }

    fn meter(&self, meter: &Meter) -> Meter {
        Meter { position_m: self.point(meter.position_m), normal: self.matrix * meter.normal }
    }

    /// In words: `x -> y, y -> -x`.
    fn name(&self) -> String {
        if self.is_identity() {
            return "no motion (one place)".to_owned();
        }
        let names = ["x", "y", "z"];
        let one = |a: usize| {
            let to = self.matrix.col(a);
            let (axis, sign) = (0..3).map(|b| (b, to[b])).find(|(_, s)| *s != 0.0).unwrap_or((a, 1.0));
            let changed = axis != a || sign < 0.0;
            changed.then(|| format!("{} -> {}{}", names[a], if sign < 0.0 { "-" } else { "" }, names[axis]))
        };
        (0..3).filter_map(one).collect::<Vec<_>>().join(", ")
    }
}

/// A meter's place, in steps that are far below what any reading shows.
fn place(meter: &Meter, size_m: DVec3) -> [i64; 6] {
    let step_m = SAME_PLACE * size_m.max_element();
    let p = (meter.position_m / step_m).round();
    let n = (meter.normal / SAME_PLACE).round();
    [p.x as i64, p.y as i64, p.z as i64, n.x as i64, n.y as i64, n.z as i64]
}

/// Whether a motion leaves reflectances, bodies and luminaires as they are.
fn is_symmetric(scene: &Scene, motion: &Motion) -> bool {
    let near_m = SAME_PLACE * motion.size_m.max_element();
    let room = scene.room.is_some_and(|room| keeps_reflectances(&room, motion));
    let bodies = scene.obstacles.iter().all(|o| scene.obstacles.iter().any(|other| is_image(o, other, motion, near_m)));
    let luminaire = |l: &Luminaire| {
        let at = motion.point(l.position_m);
        let there = scene.luminaires.iter().filter(|o| o.position_m.distance(at) < near_m);
        // Several at one place would have to be paired: that is not worth the trouble.
        let there: Vec<&Luminaire> = there.collect();
        matches!(there[..], [one] if same_light(l, one, motion.matrix))
    };
    room && bodies && scene.luminaires.iter().all(luminaire)
}

fn keeps_reflectances(room: &Room, motion: &Motion) -> bool {
    let image = |s: Surface| {
        let normal = motion.matrix * s.inward_normal();
        Surface::ALL.into_iter().find(|other| other.inward_normal().dot(normal) > 0.5)
    };
    Surface::ALL.into_iter().all(|s| image(s).is_some_and(|i| room.reflectance.of(i) == room.reflectance.of(s)))
}

/// Whether a motion takes one box to another, or one recessed opening. Of other meshes that is not asked.
fn is_image(body: &Obstacle, other: &Obstacle, motion: &Motion, near_m: f64) -> bool {
    let near = |p: DVec3, q: DVec3| p.distance(q) < near_m;
    let is_same_shape = match (&body.shape, &other.shape) {
        (Shape::Box { min_m, max_m }, Shape::Box { min_m: low, max_m: high }) => {
            let (a, b) = (motion.point(*min_m), motion.point(*max_m));
            near(a.min(b), *low) && near(a.max(b), *high)
        }
        // Convex, so that their corners say it all.
        (Shape::Mesh { vertices_m, .. }, Shape::Mesh { vertices_m: others, .. }) => {
            let is_there = |p: &DVec3| others.iter().any(|q| near(motion.point(*p), *q));
            flush::is_plate(body)
                && flush::is_plate(other)
                && vertices_m.len() == others.len()
                && vertices_m.iter().all(is_there)
        }
        _ => false,
    };
    body.reflectance == other.reflectance && is_same_shape
}

/// Whether what one luminaire sends somewhere the other sends to the image of that, from an opening that is its image.
fn same_light(a: &Luminaire, b: &Luminaire, matrix: DMat3) -> bool {
    let most = a.photometry.distribution.max_intensity().value() * a.flux_scale;
    let agree = |from: &Luminaire, there: DMat3, to: &Luminaire| {
        directions(from).all(|d| {
            let d = from.orientation * d;
            let difference = from.intensity_towards(d).value() - to.intensity_towards(there * d).value();
            difference.abs() <= SAME_INTENSITY * most
        })
    };
    let turn = b.orientation.transpose() * matrix * a.orientation;
    a.model == b.model
        && (a.model == LuminaireModel::Point || same_opening(&a.photometry.opening, &b.photometry.opening, turn))
        && agree(a, matrix, b)
        && agree(b, matrix.transpose(), a)
}

/// Directions between the nodes of a luminaire's table and on either side of them, in its own frame.
fn directions(luminaire: &Luminaire) -> impl Iterator<Item = DVec3> + use<> {
    let table = luminaire.photometry.distribution.own_planes();
    let middles = |nodes: &[f64]| nodes.windows(2).map(|w| 0.5 * (w[0] + w[1])).collect::<Vec<f64>>();
    let mut gamma = middles(table.gamma_deg());
    gamma.extend(
        table.gamma_deg().iter().flat_map(|g| [g - BESIDE_DEG, g + BESIDE_DEG]).filter(|g| (0.0..=180.0).contains(g)),
    );
    let mut c = middles(table.c_deg());
    if table.is_native() {
        c.extend(table.c_deg().iter().flat_map(|c| [c - BESIDE_DEG, c + BESIDE_DEG]));
    }
    // An axial table may have a single plane: then any will do.
    c.extend(table.c_deg().iter().copied().chain([0.0, 33.0, 90.0, 180.0, 270.0]));
    let frame = table.own_frame();
    c.into_iter().flat_map(move |c| gamma.clone().into_iter().map(move |g| frame * direction(c, g)))
}

/// Whether an opening, turned from one luminaire's frame to the other's, is the other's.
fn same_opening(a: &LuminousOpening, b: &LuminousOpening, turn: DMat3) -> bool {
    let size = |o: &LuminousOpening| {
        let [y, x, z] = o.bounding_box_m();
        DVec3::new(x, y, z)
    };
    let is_permutation = turn.to_cols_array().iter().all(|v| v.abs() < 1e-9 || (v.abs() - 1.0).abs() < 1e-9);
    let absolute = DMat3::from_cols(turn.x_axis.abs(), turn.y_axis.abs(), turn.z_axis.abs());
    let same_size = (absolute * size(a) - size(b)).abs().max_element() < 1e-9;
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
