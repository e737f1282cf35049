//! Rectangles that cover faces, none of them under a body: halved where reflected light changes, towards the edges where it changes
//! like x ln x.

use glam::DVec2;

use super::bicubic::{Bicubic, NODES};
use super::face::Face;
use super::surroundings::Surroundings;
use crate::scene::Meter;

/// Parts of a side by which edges of bodies are told from those of a rectangle.
const SAME: f64 = 1e-9;
/// Where a rectangle is cut that ends at an edge between faces: light is the less smooth the nearer it is.
const TOWARDS_EDGE: f64 = 0.25;
/// Parts of their own extent within which bodies are close to a face, and parts of a rectangle that their edges must be off its own.
const NEAR: f64 = 0.5;
const APART: f64 = 0.05;

/// A rectangle of a face.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Patch {
    pub(super) face: usize,
    pub(super) corner_m: DVec2,
    pub(super) size_m: DVec2,
}

impl Patch {
    pub(super) fn area_m2(&self) -> f64 {
        self.size_m.element_product()
    }

    /// Meters at its nodes.
    pub(super) fn nodes(&self, faces: &[Face], bicubic: &Bicubic) -> [Meter; NODES] {
        let face = &faces[self.face];
        let at = |k| face.off(self.corner_m + bicubic.node(k) * self.size_m);
        std::array::from_fn(|k| Meter { position_m: at(k), normal: face.normal })
    }

    fn end_m(&self) -> DVec2 {
        self.corner_m + self.size_m
    }

    /// Both parts beside a cut across an axis.
    fn cut(&self, axis: usize, at_m: f64) -> [Self; 2] {
        let (mut low, mut high) = (*self, *self);
        low.size_m[axis] = at_m - self.corner_m[axis];
        high.corner_m[axis] = at_m;
        high.size_m[axis] = self.end_m()[axis] - at_m;
        [low, high]
    }
}

/// What covers each face.
#[derive(Debug)]
pub(super) struct Cover {
    covers: Vec<Vec<[DVec2; 2]>>,
    /// The room's far ends on each face.
    ends_m: Vec<DVec2>,
}

impl Cover {
    pub(super) fn new(surroundings: &Surroundings) -> Self {
        let of = |face: &Face| [surroundings.covers(face), face.holes.clone()].concat();
        let end = |face: &Face| surroundings.room.map_or(DVec2::INFINITY, |room| face.on(room.size_m));
        let faces = &surroundings.faces;
        Self { covers: faces.iter().map(of).collect(), ends_m: faces.iter().map(end).collect() }
    }

    /// Rectangles of all that reflects, cut where bodies begin.
    pub(super) fn patches(&self, surroundings: &Surroundings) -> Vec<Patch> {
        let mut found = vec![];
        for (index, face) in surroundings.faces.iter().enumerate().filter(|(_, face)| face.reflectance > 0.0) {
            let near: Vec<[DVec2; 2]> = surroundings
                .bodies()
                .filter(|b| face.gap_m(**b, NEAR).is_some())
                .map(|corners| corners.map(|p| face.on(p)))
                .collect();
            let mut open = vec![Patch { face: index, corner_m: face.corners_m[0], size_m: face.size_m() }];
            while let Some(patch) = open.pop() {
                let covers = &self.covers[index];
                let (low, high) = (patch.corner_m + SAME * patch.size_m, patch.end_m() - SAME * patch.size_m);
                if covers.iter().any(|c| c[0].cmple(low).all() && c[1].cmpge(high).all()) {
                    continue;
                }
                let inside = |slack: f64, rectangles: &[[DVec2; 2]]| {
                    let (low, high) = (patch.corner_m + slack * patch.size_m, patch.end_m() - slack * patch.size_m);
                    let over = |c: &&[DVec2; 2]| c[0].cmplt(high).all() && c[1].cmpgt(low).all();
                    let ends = |c: &[DVec2; 2]| [(0, c[0].x), (1, c[0].y), (0, c[1].x), (1, c[1].y)];
                    let mut all = rectangles.iter().filter(over).flat_map(ends);
                    all.find(|(axis, at_m)| *at_m > low[*axis] && *at_m < high[*axis])
                };
                match inside(SAME, covers).or_else(|| inside(APART, &near)) {
                    Some((axis, at_m)) => open.extend(patch.cut(axis, at_m)),
                    None => found.push(patch),
                }
            }
        }
        found
    }

    /// Both parts of a rectangle that is halved across an axis.
    pub(super) fn halves(&self, patch: &Patch, axis: usize) -> [Patch; 2] {
        let part = match [false, true].map(|far| self.is_edge(patch, axis, far)) {
            [true, false] => TOWARDS_EDGE,
            [false, true] => 1.0 - TOWARDS_EDGE,
            _ => 0.5,
        };
        patch.cut(axis, patch.corner_m[axis] + part * patch.size_m[axis])
    }

    /// Whether another face rises at an end of a rectangle.
    fn is_edge(&self, patch: &Patch, axis: usize, far: bool) -> bool {
        let at_m = if far { patch.end_m()[axis] } else { patch.corner_m[axis] };
        let slack_m = SAME * patch.size_m[axis];
        let is_same = |m: f64| (m - at_m).abs() <= slack_m;
        let along = 1 - axis;
        let beside = |c: &[DVec2; 2]| {
            is_same(c[usize::from(!far)][axis])
                && c[0][along] < patch.end_m()[along] - SAME * patch.size_m[along]
                && c[1][along] > patch.corner_m[along] + SAME * patch.size_m[along]
        };
        is_same(if far { self.ends_m[patch.face][axis] } else { 0.0 }) || self.covers[patch.face].iter().any(beside)
    }
}
