//! Symmetries of a box and of the light in it: rows of the operator and first bounces are computed once an orbit.
//!
//! A box always has three mirrors and, with a square plan, the exchange of x and y. The geometry keeps all of them,
//! whatever the light does; the first bounce keeps those that also leave luminaires and reflectances as they are.

use glam::{DMat3, DVec3};

use super::grid::{Face, Grid};
use crate::geometry::{Room, Surface};
use crate::photometry::direction;
use crate::scene::Luminaire;

/// A symmetry of a box: mirrors, then perhaps x and y exchanged.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Operation {
    /// Bit k turns axis k round.
    pub(super) mirrors: u8,
    pub(super) exchange: Exchange,
}

/// Whether x and y change places.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Exchange {
    Nothing,
    XAndY,
}

impl Operation {
    pub(super) const fn turns(self, axis: usize) -> bool {
        self.mirrors >> axis & 1 == 1
    }

    /// The image of a direction.
    fn of_direction(self, d: DVec3) -> DVec3 {
        let sign = |axis| if self.turns(axis) { -1.0 } else { 1.0 };
        let d = d * DVec3::new(sign(0), sign(1), sign(2));
        if self.exchange == Exchange::XAndY { DVec3::new(d.y, d.x, d.z) } else { d }
    }

    fn of_point(self, p: DVec3, size_m: DVec3) -> DVec3 {
        0.5 * size_m + self.of_direction(p - 0.5 * size_m)
    }

    fn of_face(self, face: Face) -> Face {
        let normal = self.of_direction(face.inward_normal());
        let axis = if normal.z == 0.0 { usize::from(normal.y != 0.0) } else { 2 };
        Face(2 * axis + usize::from(normal[axis] < 0.0))
    }
}

/// The symmetries of the room's shape.
pub(super) fn of_geometry(size_m: DVec3) -> Vec<Operation> {
    let exchanges: &[_] =
        if size_m.x == size_m.y { &[Exchange::Nothing, Exchange::XAndY] } else { &[Exchange::Nothing] };
    exchanges.iter().flat_map(|&exchange| (0..8).map(move |mirrors| Operation { mirrors, exchange })).collect()
}

/// Which of the room's symmetries its reflectances and its luminaires share.
pub(super) fn of_light(geometry: &[Operation], room: &Room, luminaires: &[Luminaire]) -> Vec<Operation> {
    geometry
        .iter()
        .copied()
        .filter(|op| keeps_reflectances(*op, room) && keeps_luminaires(*op, room, luminaires))
        .collect()
}

/// The reflectance of a face.
pub(super) fn reflectance(room: &Room, face: Face) -> f64 {
    let is_it = |s: &Surface| s.axis() == face.0 / 2 && s.is_far() == (face.0 % 2 == 1);
    Surface::ALL.into_iter().find(is_it).map_or(0.0, |s| room.reflectance.of(s))
}

fn keeps_reflectances(op: Operation, room: &Room) -> bool {
    Face::ALL.into_iter().all(|face| reflectance(room, face) == reflectance(room, op.of_face(face)))
}

fn keeps_luminaires(op: Operation, room: &Room, luminaires: &[Luminaire]) -> bool {
    if op == (Operation { mirrors: 0, exchange: Exchange::Nothing }) {
        return true;
    }
    let mut free: Vec<_> = luminaires.iter().collect();
    luminaires.iter().all(|luminaire| {
        let image = op.of_point(luminaire.position_m, room.size_m);
        let close = |other: &&Luminaire| (other.position_m - image).length() <= 1e-13 * room.size_m.max_element();
        let partner = free.iter().position(|other| close(other) && is_image(op, luminaire, other));
        partner.map(|k| free.swap_remove(k)).is_some()
    })
}

/// Whether `other` shines as the image of `luminaire` does: at every node and inside every cell of both tables.
fn is_image(op: Operation, luminaire: &Luminaire, other: &Luminaire) -> bool {
    let peak = luminaire.photometry.distribution.max_intensity().value() * luminaire.flux_scale;
    let same = |d: DVec3| {
        let (a, b) = (luminaire.intensity_towards(d).value(), other.intensity_towards(op.of_direction(d)).value());
        (a - b).abs() <= 1e-12 * peak
    };
    let back = |d: DVec3| {
        // The inverse of a signed permutation is its transpose.
        let columns = DVec3::AXES.map(|axis| op.of_direction(axis));
        DMat3::from_cols(columns[0], columns[1], columns[2]).transpose() * d
    };
    probes(luminaire).into_iter().all(same) && probes(other).into_iter().all(|d| same(back(d)))
}

/// World directions to every interior point of a table that its bilinear pieces are known by.
fn probes(luminaire: &Luminaire) -> Vec<DVec3> {
    let full = luminaire.photometry.distribution.full_circle();
    let fill = |angles: &[f64]| -> Vec<f64> {
        // A little off the nodes, where a table that starts with a step is not at the mercy of rounding.
        angles.windows(2).flat_map(|w| [0.001, 0.35, 0.5, 0.8, 0.999].map(|t| w[0] + t * (w[1] - w[0]))).collect()
    };
    let (cs, gammas) = (fill(full.c_deg()), fill(full.gamma_deg()));
    let at = |c: &f64, g: &f64| luminaire.orientation * direction(*c, *g);
    cs.iter().flat_map(|c| gammas.iter().map(move |g| at(c, g))).collect()
}

/// Node images under a group, and which nodes stand for their orbits.
#[derive(Clone, Debug)]
pub(super) struct Orbits {
    /// `images[operation][node]`.
    pub(super) images: Vec<Vec<u32>>,
    /// One node an orbit, rising.
    pub(super) representatives: Vec<usize>,
}

impl Orbits {
    pub(super) fn new(grid: &Grid, group: &[Operation]) -> Self {
        let count = grid.len();
        let images: Vec<Vec<u32>> =
            group.iter().map(|op| (0..count).map(|node| grid.image(node, *op) as u32).collect()).collect();
        let is_first = |node: &usize| images.iter().all(|image| image[*node] as usize >= *node);
        let representatives = (0..count).filter(is_first).collect();
        Self { images, representatives }
    }
}
