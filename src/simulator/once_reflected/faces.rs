//! The faces of a furnished box room as rectangles, those under bodies left out.

use glam::DVec3;

use crate::geometry::{Room, Surface};
use crate::scene::Obstacle;
use crate::simulator::visibility::Occluder;

/// Distances below this fraction of the room count as contact.
const CONTACT: f64 = 1e-9;

/// A rectangle of uniform reflectance.
#[derive(Clone, Copy, Debug)]
pub(super) struct Face {
    pub(super) corners_m: [DVec3; 4],
    pub(super) normal: DVec3,
    pub(super) reflectance: f64,
}

/// A body with its reflectance.
#[derive(Clone, Copy, Debug)]
pub(super) struct Body {
    pub(super) shape: Occluder,
    pub(super) reflectance: f64,
}

/// An axis-aligned rectangle that bodies may cover in part.
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
    let body = |o: &Obstacle| Some(Body { shape: Occluder::aligned(&o.shape)?, reflectance: o.reflectance });
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

/// Every face that can be seen and reflects.
pub(super) fn faces(room: &Room, bodies: &[Body]) -> Vec<Face> {
    let scale = room.size_m.max_element();
    let mut faces = vec![];
    for panel in panels(room, bodies) {
        let touching = |(k, body): (usize, &Body)| {
            let touches = panel.owner != Some(k) && panel.gap_m(&body.shape) <= CONTACT * scale;
            touches.then_some(body.shape)
        };
        let near: Vec<Occluder> = bodies.iter().enumerate().filter_map(touching).collect();
        let [us, vs] = [1, 2].map(|k| marks(&panel, (panel.axis + k) % 3, &near, scale));
        for su in us.windows(2) {
            for sv in vs.windows(2) {
                let face = panel.face((su[0], su[1]), (sv[0], sv[1]));
                if !is_covered(&panel, 0.5 * (face.corners_m[0] + face.corners_m[2]), bodies, scale) {
                    faces.push(face);
                }
            }
        }
    }
    faces
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

/// Coordinates along an axis at which bodies that touch a panel cut it.
fn marks(panel: &Panel, along: usize, near: &[Occluder], scale: f64) -> Vec<f64> {
    let (low, high) = (panel.low_m[along], panel.high_m[along]);
    let mut marks = vec![low, high];
    marks.extend(near.iter().flat_map(|shape| [shape.min_m[along], shape.max_m[along]]));
    marks.retain(|x| *x >= low && *x <= high);
    marks.sort_by(f64::total_cmp);
    marks.dedup_by(|a, b| *a - *b <= CONTACT * scale);
    marks
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

    fn normal(&self) -> DVec3 {
        DVec3::AXES[self.axis] * if self.far { 1.0 } else { -1.0 }
    }

    fn face(&self, su: (f64, f64), sv: (f64, f64)) -> Face {
        let (u, v) = ((self.axis + 1) % 3, (self.axis + 2) % 3);
        let at = |a: f64, b: f64| {
            let mut p = DVec3::ZERO;
            p[self.axis] = self.coordinate_m;
            p[u] = a;
            p[v] = b;
            p
        };
        let corners_m = [at(su.0, sv.0), at(su.1, sv.0), at(su.1, sv.1), at(su.0, sv.1)];
        Face { corners_m, normal: self.normal(), reflectance: self.reflectance }
    }
}
