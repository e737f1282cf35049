//! Rectangular patches of a furnished box room: cut where bodies stand, lean or come close, halved alike everywhere.

use glam::DVec3;

use super::exitance::RULE;
use crate::geometry::{Room, Surface};
use crate::scene::{Obstacle, Shape};
use crate::simulator::visibility::Occluder;

/// Distances below this fraction of the room count as contact.
const CONTACT: f64 = 1e-9;
/// A body nearer to a surface than this fraction of the room leaves its outline in the surface's patches.
const NEARBY: f64 = 0.1;

/// Patches before a narrow gap are at most so many times as long as it is wide.
const GAPS_LONG: f64 = 1.0;
/// Parts of an edge at most, however narrow the gap before it: what a gap of no width would need ends nowhere.
const MAX_PARTS: f64 = 24.0;
/// Where surfaces meet, the last patch is cut at this part of its side.
const GRADE: f64 = 0.25;
/// Patches shorter than this part of the mesh's side are not.
const GRADED_FROM: f64 = 0.2;
/// The reflectance that the mesh's side is meant for.
const TYPICAL_REFLECTANCE: f64 = 0.5;

/// A rectangle of uniform reflectance.
#[derive(Clone, Copy, Debug)]
pub(super) struct Patch {
    pub(super) corners_m: [DVec3; 4],
    pub(super) centre_m: DVec3,
    pub(super) normal: DVec3,
    /// Half its diagonal.
    pub(super) radius_m: f64,
    pub(super) area_m2: f64,
    pub(super) reflectance: f64,
}

impl Patch {
    /// The corners of a part by its centre and half side, in coordinates of -1..=1.
    pub(super) fn part_m(&self, a: f64, b: f64, half: f64) -> [DVec3; 4] {
        let at = |x: f64, y: f64| self.centre_m + 0.5 * (x * self.side_m(0) + y * self.side_m(1));
        [at(a - half, b - half), at(a + half, b - half), at(a + half, b + half), at(a - half, b + half)]
    }

    /// The nine nodes of biquadratic exitance, second side fastest.
    pub(super) fn nodes_m(&self) -> [DVec3; 9] {
        std::array::from_fn(|k| self.centre_m + 0.5 * (RULE[k / 3].0 * self.side_m(0) + RULE[k % 3].0 * self.side_m(1)))
    }

    /// The first or the second side as a vector.
    pub(super) fn side_m(&self, side: usize) -> DVec3 {
        let [a, b, _, d] = self.corners_m;
        if side == 0 { b - a } else { d - a }
    }
}

/// A body with its reflectance.
#[derive(Clone, Copy, Debug)]
pub(super) struct Body {
    pub(super) shape: Occluder,
    pub(super) reflectance: f64,
}

/// An axis-aligned rectangle that is to be cut into patches.
struct Panel {
    axis: usize,
    far: bool,
    coordinate_m: f64,
    low_m: DVec3,
    high_m: DVec3,
    reflectance: f64,
    /// The body it belongs to.
    owner: Option<usize>,
}

/// The bodies of a scene, or `None` where one of them is no box and no plate, leaves the room or enters another one.
pub(super) fn bodies(room: &Room, obstacles: &[Obstacle]) -> Option<Vec<Body>> {
    let body = |o: &Obstacle| Some(Body { shape: aligned(&o.shape)?, reflectance: o.reflectance });
    let bodies: Vec<Body> = obstacles.iter().map(body).collect::<Option<_>>()?;
    let slack = DVec3::splat(CONTACT * room.size_m.max_element());
    let inside = |b: &Body| b.shape.min_m.cmpge(-slack).all() && b.shape.max_m.cmple(room.size_m + slack).all();
    let apart = |a: &Body, b: &Body| {
        let overlap = a.shape.max_m.min(b.shape.max_m) - a.shape.min_m.max(b.shape.min_m);
        overlap.cmple(slack).any()
    };
    let all_apart = bodies.iter().enumerate().all(|(k, a)| bodies[..k].iter().all(|b| apart(a, b)));
    (bodies.iter().all(inside) && all_apart).then_some(bodies)
}

/// Whether a body is a plate upon a surface of the room.
pub(super) fn lies_flat(room: &Room, shape: &Occluder) -> bool {
    let slack = CONTACT * room.size_m.max_element();
    let flat = |axis: usize| {
        let (low, high) = (shape.min_m[axis], shape.max_m[axis]);
        low == high && (low <= slack || high >= room.size_m[axis] - slack)
    };
    (0..3).any(flat)
}

/// A box, or a mesh of two triangles that is an axis-aligned plate.
fn aligned(shape: &Shape) -> Option<Occluder> {
    match shape {
        Shape::Box { min_m, max_m } => Some(Occluder { min_m: *min_m, max_m: *max_m }),
        Shape::Mesh { vertices_m, triangles } => {
            let [a, b] = triangles.as_slice() else { return None };
            let corner = |i: &u32| vertices_m[*i as usize];
            let all: Vec<DVec3> = a.iter().chain(b).map(corner).collect();
            let min_m = all.iter().fold(DVec3::INFINITY, |m, p| m.min(*p));
            let max_m = all.iter().fold(DVec3::NEG_INFINITY, |m, p| m.max(*p));
            let extent = max_m - min_m;
            let area =
                |t: &[u32; 3]| 0.5 * (corner(&t[1]) - corner(&t[0])).cross(corner(&t[2]) - corner(&t[0])).length();
            let whole = extent.x * extent.y + extent.y * extent.z + extent.z * extent.x;
            let at_corner = |p: &DVec3| p.cmpeq(min_m) | p.cmpeq(max_m);
            let shared = a.iter().filter(|i| b.contains(i)).map(corner).collect::<Vec<_>>();
            let [p, q] = shared.as_slice() else { return None };
            let diagonal = (*p - *q).length() >= (1.0 - CONTACT) * extent.length();
            let flat = extent.min_element() == 0.0 && all.iter().all(|p| at_corner(p).all());
            let halves = [a, b].iter().all(|t| (area(t) - 0.5 * whole).abs() <= CONTACT * whole);
            (flat && diagonal && halves && whole > 0.0).then_some(Occluder { min_m, max_m })
        }
    }
}

/// How long patches are: as a rule, and how often shorter than that and than what the gap before them allows.
#[derive(Clone, Copy, Debug)]
pub(super) struct Fineness {
    pub(super) side_m: f64,
    pub(super) divisor: f64,
}

/// Every patch that can be seen.
pub(super) fn patches(room: &Room, bodies: &[Body], fineness: Fineness) -> Vec<Patch> {
    let scale = room.size_m.max_element();
    let mut patches = vec![];
    for panel in panels(room, bodies) {
        let others = bodies.iter().enumerate().filter(|(k, _)| panel.owner != Some(*k));
        let near: Vec<(f64, Occluder)> = others
            .map(|(_, body)| (panel.gap_m(&body.shape), body.shape))
            .filter(|(gap, _)| *gap <= NEARBY * scale)
            .collect();
        let [us, vs] = [1, 2].map(|k| marks(&panel, (panel.axis + k) % 3, &near, scale));
        for su in us.windows(2) {
            for sv in vs.windows(2) {
                let cell = panel.patch((su[0], su[1]), (sv[0], sv[1]));
                if !is_covered(&panel, cell.centre_m, bodies, scale) {
                    patches.extend(panel.divided(&cell, room, bodies, &near, fineness));
                }
            }
        }
    }
    patches
}

fn panels(room: &Room, bodies: &[Body]) -> Vec<Panel> {
    let slack = CONTACT * room.size_m.max_element();
    let walls = Surface::ALL.into_iter().map(|s| Panel {
        axis: s.axis(),
        far: !s.is_far(),
        coordinate_m: if s.is_far() { room.size_m[s.axis()] } else { 0.0 },
        low_m: DVec3::ZERO,
        high_m: room.size_m,
        reflectance: room.reflectance.of(s),
        owner: None,
    });
    let mut panels: Vec<Panel> = walls.collect();
    for (k, body) in bodies.iter().enumerate() {
        for (axis, far) in [0, 1, 2].into_iter().flat_map(|axis| [(axis, false), (axis, true)]) {
            let (low_m, high_m) = (body.shape.min_m, body.shape.max_m);
            let coordinate_m = if far { high_m[axis] } else { low_m[axis] };
            let flush = if far { coordinate_m >= room.size_m[axis] - slack } else { coordinate_m <= slack };
            let extent = high_m - low_m;
            let empty = extent[(axis + 1) % 3] * extent[(axis + 2) % 3] == 0.0;
            if !flush && !empty {
                let (reflectance, owner) = (body.reflectance, Some(k));
                panels.push(Panel { axis, far, coordinate_m, low_m, high_m, reflectance, owner });
            }
        }
    }
    panels.retain(|panel| panel.reflectance > 0.0);
    panels
}

/// Coordinates along an axis at which bodies that touch a panel or come close to it cut it.
fn marks(panel: &Panel, along: usize, near: &[(f64, Occluder)], scale: f64) -> Vec<f64> {
    let (low, high) = (panel.low_m[along], panel.high_m[along]);
    let mut marks = vec![low, high];
    marks.extend(near.iter().flat_map(|(_, shape)| [shape.min_m[along], shape.max_m[along]]));
    marks.retain(|x| *x >= low && *x <= high);
    marks.sort_by(f64::total_cmp);
    marks.dedup_by(|a, b| *a - *b <= CONTACT * scale);
    marks
}

/// Where one side of a cell is cut: evenly, and once more next to corners.
///
/// Irradiance runs like x ln x where surfaces meet at a right angle.
fn cuts(low: f64, high: f64, side_m: f64, corners: [bool; 2]) -> Vec<f64> {
    let parts = ((high - low) / side_m).round().clamp(1.0, MAX_PARTS);
    let part_m = (high - low) / parts;
    let graded = part_m > GRADED_FROM * side_m;
    let mut cuts = vec![low];
    cuts.extend((graded && corners[0]).then_some(low + GRADE * part_m));
    cuts.extend((1..parts as usize).map(|k| low + part_m * k as f64));
    cuts.extend((graded && corners[1]).then_some(high - GRADE * part_m));
    cuts.push(high);
    cuts
}

/// Whether a body stands on a point of a panel.
fn is_covered(panel: &Panel, point_m: DVec3, bodies: &[Body], scale: f64) -> bool {
    let slack = DVec3::splat(CONTACT * scale);
    let before = point_m + panel.normal() * (2.0 * CONTACT * scale);
    bodies.iter().enumerate().any(|(k, body)| {
        let (low, high) = (body.shape.min_m, body.shape.max_m);
        let holds = |p: DVec3| p.cmpge(low - slack).all() && p.cmple(high + slack).all();
        let plate = high[panel.axis] == low[panel.axis];
        panel.owner != Some(k) && (holds(before) || plate && holds(point_m))
    })
}

impl Panel {
    /// The distance to a body before or behind it.
    fn gap_m(&self, shape: &Occluder) -> f64 {
        (shape.min_m[self.axis] - self.coordinate_m).max(self.coordinate_m - shape.max_m[self.axis])
    }

    /// The distance to the surface of the room that a side of a body looks at; none for the room's own surfaces.
    fn gap_to_room_m(&self, room: &Room) -> f64 {
        match (self.owner, self.far) {
            (None, _) => f64::INFINITY,
            (_, true) => room.size_m[self.axis] - self.coordinate_m,
            (_, false) => self.coordinate_m,
        }
    }

    fn normal(&self) -> DVec3 {
        DVec3::AXES[self.axis] * if self.far { 1.0 } else { -1.0 }
    }

    /// The patches of a cell that no mark cuts.
    fn divided(
        &self,
        cell: &Patch,
        room: &Room,
        bodies: &[Body],
        near: &[(f64, Occluder)],
        fineness: Fineness,
    ) -> Vec<Patch> {
        let scale = room.size_m.max_element();
        let axes = [(self.axis + 1) % 3, (self.axis + 2) % 3];
        let low = cell.corners_m[0];
        let high = cell.corners_m[2];
        // Before a body and around its corners light changes within the distance to it.
        let distance_m = |s: &Occluder| (cell.centre_m - cell.centre_m.clamp(s.min_m, s.max_m)).length();
        let gaps = near.iter().filter(|(gap, _)| *gap > CONTACT * scale).map(|(_, shape)| distance_m(shape));
        let gap = gaps.fold(self.gap_to_room_m(room), f64::min);
        // What reflects little may be known less well.
        let lively = (TYPICAL_REFLECTANCE / self.reflectance).sqrt().clamp(0.5, 2.0);
        let side_m = (lively * fineness.side_m).min(GAPS_LONG * gap) / fineness.divisor;
        let is_corner = |axis: usize, far: bool| {
            let end = if far { high[axis] } else { low[axis] };
            let mut beyond = cell.centre_m;
            beyond[axis] = end + if far { 4.0 } else { -4.0 } * CONTACT * scale;
            let slack = CONTACT * scale;
            beyond[axis] < -slack || beyond[axis] > room.size_m[axis] + slack || self.meets(beyond, bodies, scale)
        };
        let [us, vs] = axes.map(|k| cuts(low[k], high[k], side_m, [is_corner(k, false), is_corner(k, true)]));
        let pairs = us.windows(2).flat_map(|su| vs.windows(2).map(move |sv| (su, sv)));
        pairs.map(|(su, sv)| self.patch((su[0], su[1]), (sv[0], sv[1]))).collect()
    }

    /// Whether a body rises from a point in the panel's plane.
    fn meets(&self, point_m: DVec3, bodies: &[Body], scale: f64) -> bool {
        let before = point_m + self.normal() * (4.0 * CONTACT * scale);
        let holds = |s: &Occluder| before.cmpgt(s.min_m).all() && before.cmplt(s.max_m).all();
        bodies.iter().enumerate().any(|(k, body)| self.owner != Some(k) && holds(&body.shape))
    }

    fn patch(&self, su: (f64, f64), sv: (f64, f64)) -> Patch {
        let (u, v) = ((self.axis + 1) % 3, (self.axis + 2) % 3);
        let at = |a: f64, b: f64| {
            let mut p = DVec3::ZERO;
            p[self.axis] = self.coordinate_m;
            p[u] = a;
            p[v] = b;
            p
        };
        let corners_m = [at(su.0, sv.0), at(su.1, sv.0), at(su.1, sv.1), at(su.0, sv.1)];
        Patch {
            corners_m,
            centre_m: 0.5 * (corners_m[0] + corners_m[2]),
            normal: self.normal(),
            radius_m: 0.5 * corners_m[0].distance(corners_m[2]),
            area_m2: (su.1 - su.0) * (sv.1 - sv.0),
            reflectance: self.reflectance,
        }
    }
}
