//! Rectangular patches of a furnished box room: cut where bodies stand, lean or come close, halved alike everywhere.

use std::f64::consts::PI;

use glam::DVec3;

use crate::geometry::{Room, Surface};
use crate::scene::{Obstacle, Shape};
use crate::simulator::visibility::Occluder;

/// Distances below this fraction of the room count as contact.
const CONTACT: f64 = 1e-9;
/// A body nearer to a surface than this fraction of the room leaves its outline in the surface's patches.
const NEARBY: f64 = 0.1;

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
    /// How the exitance changes along the patch's two sides, from its own panel's patches.
    pub(super) slopes: [Slope; 2],
}

impl Patch {
    /// The corners of a part by its centre and half side, in coordinates of -1..=1.
    pub(super) fn part_m(&self, a: f64, b: f64, half: f64) -> [DVec3; 4] {
        let at = |x: f64, y: f64| self.centre_m + 0.5 * (x * self.side_m(0) + y * self.side_m(1));
        [at(a - half, b - half), at(a + half, b - half), at(a + half, b + half), at(a - half, b + half)]
    }

    /// The first or the second side as a vector.
    pub(super) fn side_m(&self, side: usize) -> DVec3 {
        let [a, b, _, d] = self.corners_m;
        if side == 0 { b - a } else { d - a }
    }
}

/// A difference quotient: up to three patches of a row and their weights, summing to zero, per metre.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Slope {
    pub(super) patches: [u32; 3],
    pub(super) weights: [f64; 3],
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

/// Every patch that can be seen; `size_m` is the longest side before it is divided by `multiple`.
pub(super) fn patches(room: &Room, bodies: &[Body], size_m: f64, multiple: usize) -> Vec<Patch> {
    let scale = room.size_m.max_element();
    let mut patches = vec![];
    for panel in panels(room, bodies) {
        let (u, v) = ((panel.axis + 1) % 3, (panel.axis + 2) % 3);
        let (us, vs) = [u, v].map(|along| cuts(&panel, along, bodies, scale, size_m, multiple)).into();
        let mut places = vec![];
        for su in us.windows(2) {
            for sv in vs.windows(2) {
                let patch = panel.patch((su[0], su[1]), (sv[0], sv[1]));
                let seen = !is_covered(&panel, &patch, bodies, scale);
                places.push(seen.then_some(patches.len()));
                patches.extend(seen.then_some(patch));
            }
        }
        let count = vs.len() - 1;
        for (k, place) in places.iter().enumerate() {
            let Some(own) = *place else { continue };
            let rows = [(u, us.len() - 1, k / count, count), (v, count, k % count, 1)];
            let slopes = rows.map(|(along, length, at, stride)| {
                let other = |i: usize| places[k + i * stride - at * stride].map(|p| (p, patches[p].centre_m[along]));
                slope(at, length, other)
            });
            patches[own].slopes = slopes;
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

/// The derivative at place `at` of the parabola through the nearest three patches of a row without gaps.
fn slope(at: usize, length: usize, patch: impl Fn(usize) -> Option<(usize, f64)>) -> Slope {
    let unbroken =
        |run: &std::ops::RangeInclusive<usize>| *run.end() < length && run.clone().all(|i| patch(i).is_some());
    let around = [(at >= 1).then(|| at - 1..=at + 1), Some(at..=at + 2), (at >= 2).then(|| at - 2..=at)];
    let pairs = [Some(at..=at + 1), (at >= 1).then(|| at - 1..=at)];
    let Some(run) = around.into_iter().chain(pairs).flatten().find(unbroken) else { return Slope::default() };
    let points: Vec<_> = run.filter_map(&patch).collect();
    let here = patch(at).map_or(0.0, |p| p.1);
    let mut slope = Slope::default();
    for (k, (index, x)) in points.iter().enumerate() {
        // The derivative of a Lagrange polynomial: the sum over its factors, each left out once.
        let others: Vec<f64> = points.iter().enumerate().filter(|(j, _)| *j != k).map(|(_, p)| p.1).collect();
        let scale: f64 = others.iter().map(|o| x - o).product();
        let sum = match others.as_slice() {
            [a, b] => (here - a) + (here - b),
            _ => 1.0,
        };
        slope.patches[k] = *index as u32;
        slope.weights[k] = sum / scale;
    }
    slope
}

/// Coordinates along an axis at which a panel is cut.
fn cuts(panel: &Panel, along: usize, bodies: &[Body], scale: f64, size_m: f64, multiple: usize) -> Vec<f64> {
    let (low, high) = (panel.low_m[along], panel.high_m[along]);
    let mut marks = vec![low, high];
    for (k, body) in bodies.iter().enumerate() {
        let shape = &body.shape;
        let gap = (shape.min_m[panel.axis] - panel.coordinate_m).max(panel.coordinate_m - shape.max_m[panel.axis]);
        if panel.owner != Some(k) && gap <= NEARBY * scale {
            marks.extend([shape.min_m[along], shape.max_m[along]]);
        }
    }
    marks.retain(|x| *x >= low && *x <= high);
    marks.sort_by(f64::total_cmp);
    marks.dedup_by(|a, b| *a - *b <= CONTACT * scale);
    let mut cuts = vec![marks[0]];
    for w in marks.windows(2) {
        let parts = ((w[1] - w[0]) / size_m).round().max(1.0) as usize * multiple;
        // Irradiance runs like powers of the distance to where surfaces meet: patches shrink towards it.
        let graded = |k: usize| (0.5 * PI * k as f64 / parts as f64).sin().powi(2);
        cuts.extend((1..=parts).map(|k| {
            if k == parts { w[1] } else { w[0] + (w[1] - w[0]) * (0.5 * graded(k) + 0.5 * k as f64 / parts as f64) }
        }));
    }
    cuts
}

/// Whether a body stands on a patch.
fn is_covered(panel: &Panel, patch: &Patch, bodies: &[Body], scale: f64) -> bool {
    let slack = DVec3::splat(CONTACT * scale);
    let before = patch.centre_m + patch.normal * (2.0 * CONTACT * scale);
    bodies.iter().enumerate().any(|(k, body)| {
        let (low, high) = (body.shape.min_m, body.shape.max_m);
        let holds = |p: DVec3| p.cmpge(low - slack).all() && p.cmple(high + slack).all();
        let plate = high[panel.axis] == low[panel.axis];
        panel.owner != Some(k) && (holds(before) || plate && holds(patch.centre_m))
    })
}

impl Panel {
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
            normal: DVec3::AXES[self.axis] * if self.far { 1.0 } else { -1.0 },
            radius_m: 0.5 * corners_m[0].distance(corners_m[2]),
            area_m2: (su.1 - su.0) * (sv.1 - sv.0),
            reflectance: self.reflectance,
            slopes: [Slope::default(); 2],
        }
    }
}
