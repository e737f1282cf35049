//! What a meter sees of rectangles on which light is known: weights of the values at their nodes, integrated over what
//! bodies leave of each, so that chance has no part in it.

use std::f64::consts::PI;

use glam::{DVec2, DVec3};

use super::bicubic::{Bicubic, NODES};
use super::face::Face;
use crate::geometry::configuration_factor::element_to_polygon;
use crate::scene::Meter;
use crate::simulator::visibility::{Occluder, Polygon, candidates, clip, visible_pieces};

/// Times its own size that a part is away where Gauss's rule serves.
const FAR: f64 = 2.0;
/// Halvings of what is nearer; then its exact factor counts for its middle.
const DEEPEST: u32 = 9;
/// What the rule misses of a polynomial, in what it misses of a constant, which is known exactly.
const OF_A_CONSTANT: f64 = 4.0;

/// Standard deviations within which the sum of many errors of either sign lies.
const APART: f64 = 4.0;

/// What many rectangles leave out together.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Left {
    /// Were it all of one sign.
    pub(super) sum: f64,
    square: f64,
}

impl Left {
    pub(super) fn add(&mut self, left_lux: f64) {
        self.sum += left_lux;
        self.square += left_lux * left_lux;
    }

    /// Were it of either sign, one as the other.
    pub(super) fn by_chance(&self) -> f64 {
        self.sum.min(APART * self.square.sqrt())
    }
}

/// A meter among bodies that are all boxes.
pub(super) struct View<'a> {
    pub(super) meter: &'a Meter,
    pub(super) occluders: &'a [Occluder],
    pub(super) bicubic: &'a Bicubic,
}

/// What of a rectangle shows.
pub(super) struct Shown<'a> {
    view: &'a View<'a>,
    face: &'a Face,
    corner_m: DVec2,
    size_m: DVec2,
    pieces: Vec<Polygon>,
    is_whole: bool,
    /// Its configuration factor.
    pub(super) factor: f64,
}

/// The weights of the values at a rectangle's nodes in the illuminance of a meter.
pub(super) struct Weights {
    pub(super) of_nodes: [f64; NODES],
    /// How far off their sum with values of at most 1 may be.
    pub(super) error: f64,
}

impl View<'_> {
    /// What shows of a rectangle on a face; nothing where it lies behind the meter, or the meter behind it, or all is hidden.
    pub(super) fn of<'a>(&'a self, face: &'a Face, corner_m: DVec2, size_m: DVec2) -> Option<Shown<'a>> {
        let Meter { position_m, normal } = *self.meter;
        if (position_m - face.off(corner_m)).dot(face.normal) <= 0.0 {
            return None;
        }
        let corners = [DVec2::ZERO, DVec2::X, DVec2::ONE, DVec2::Y].map(|t| face.off(corner_m + t * size_m));
        let heights = corners.map(|p| (p - position_m).dot(normal));
        if heights.iter().all(|h| *h <= 0.0) {
            return None;
        }
        let is_above = heights.iter().all(|h| *h >= 0.0);
        let above = if is_above { corners.to_vec() } else { clip(&corners, normal, position_m) };
        if above.len() < 3 {
            return None;
        }
        let hiding = candidates(position_m, &above, self.occluders);
        let is_whole = is_above && hiding.is_empty();
        let pieces = if hiding.is_empty() { vec![above] } else { visible_pieces(position_m, &above, &hiding) };
        let factor: f64 = pieces.iter().map(|piece| element_to_polygon(position_m, normal, piece).max(0.0)).sum();
        (factor > 0.0).then_some(Shown { view: self, face, corner_m, size_m, pieces, is_whole, factor })
    }
}

impl Shown<'_> {
    /// The part of what a polynomial leaves out that is left: it has no mean and no slope, which tells where all of it is seen from afar.
    pub(super) fn left(&self) -> f64 {
        if !self.is_whole {
            return 1.0;
        }
        let middle_m = self.face.off(self.corner_m + 0.5 * self.size_m);
        let distance_m = (middle_m - self.view.meter.position_m).length();
        (self.size_m.max_element() / distance_m).powi(2).min(1.0)
    }

    pub(super) fn weights(&self) -> Weights {
        let mut of_nodes = [0.0; NODES];
        if self.is_whole {
            self.add_rectangle(self.corner_m, self.size_m, 0, &mut of_nodes);
        } else {
            for piece in &self.pieces {
                for k in 2..piece.len() {
                    self.add_triangle([piece[0], piece[k - 1], piece[k]], 0, &mut of_nodes);
                }
            }
        }
        let missed = (of_nodes.iter().sum::<f64>() - self.factor).abs();
        Weights { of_nodes, error: OF_A_CONSTANT * missed + 1e-13 }
    }

    fn distance_m(&self, point_m: DVec3) -> f64 {
        (point_m - self.view.meter.position_m).length()
    }

    fn add_rectangle(&self, corner_m: DVec2, size_m: DVec2, depth: u32, sums: &mut [f64; NODES]) {
        let bicubic = self.view.bicubic;
        let middle_m = self.face.off(corner_m + 0.5 * size_m);
        if self.distance_m(middle_m) >= FAR * size_m.max_element() {
            let area_m2 = size_m.element_product();
            for k in 0..NODES {
                let at_m = corner_m + bicubic.node(k) * size_m;
                let weight = bicubic.weight(k) * area_m2 * self.kernel(self.face.off(at_m));
                if depth == 0 { sums[k] += weight } else { self.add(at_m, weight, sums) }
            }
        } else if depth == DEEPEST {
            let corners = [DVec2::ZERO, DVec2::X, DVec2::ONE, DVec2::Y].map(|t| self.face.off(corner_m + t * size_m));
            let factor = element_to_polygon(self.view.meter.position_m, self.view.meter.normal, &corners);
            self.add(corner_m + 0.5 * size_m, factor, sums);
        } else {
            // The longer side is halved first, so that parts become square.
            let long = size_m.cmpge(DVec2::splat(0.6 * size_m.max_element()));
            let half_m = DVec2::select(long, 0.5 * size_m, size_m);
            for x in 0..=u8::from(long.x) {
                for y in 0..=u8::from(long.y) {
                    let at_m = corner_m + half_m * DVec2::new(f64::from(x), f64::from(y));
                    self.add_rectangle(at_m, half_m, depth + 1, sums);
                }
            }
        }
    }

    fn add_triangle(&self, t: [DVec3; 3], depth: u32, sums: &mut [f64; NODES]) {
        let bicubic = self.view.bicubic;
        let middle_m = (t[0] + t[1] + t[2]) / 3.0;
        let longest_m = (t[1] - t[0]).length().max((t[2] - t[1]).length()).max((t[0] - t[2]).length());
        if self.distance_m(middle_m) >= FAR * longest_m {
            let area_m2 = (t[1] - t[0]).cross(t[2] - t[0]).length();
            for k in 0..NODES {
                let DVec2 { x, y } = bicubic.node(k);
                let point_m = t[0] + x * (t[1].lerp(t[2], y) - t[0]);
                let weight = bicubic.weight(k) * x * area_m2 * self.kernel(point_m);
                self.add(self.face.on(point_m), weight, sums);
            }
        } else if depth == DEEPEST {
            let factor = element_to_polygon(self.view.meter.position_m, self.view.meter.normal, &t);
            self.add(self.face.on(middle_m), factor.abs(), sums);
        } else {
            let [ab, bc, ca] = [(t[0], t[1]), (t[1], t[2]), (t[2], t[0])].map(|(p, q)| 0.5 * (p + q));
            for quarter in [[t[0], ab, ca], [ab, t[1], bc], [ca, bc, t[2]], [ab, bc, ca]] {
                self.add_triangle(quarter, depth + 1, sums);
            }
        }
    }

    fn add(&self, at_m: DVec2, weight: f64, sums: &mut [f64; NODES]) {
        let basis = self.view.bicubic.basis((at_m - self.corner_m) / self.size_m);
        for (sum, basis) in sums.iter_mut().zip(basis) {
            *sum += weight * basis;
        }
    }

    /// The kernel of irradiance, cos cos / (pi r²), per square metre.
    fn kernel(&self, point_m: DVec3) -> f64 {
        let way = point_m - self.view.meter.position_m;
        let square = way.length_squared();
        way.dot(self.view.meter.normal).max(0.0) * (-way.dot(self.face.normal)).max(0.0) / (PI * square * square)
    }
}
