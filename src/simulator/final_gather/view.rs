//! What a meter sees of rectangles on which light is known: weights of the values at their nodes, integrated over what
//! bodies leave of each, so that chance has no part in it.
//!
//! All is cut in the plane of the rectangle, about the meter's foot on it: a box hides the shadow that its outline casts
//! from the meter, which is convex, bounded by six lines at most.

use std::f64::consts::{PI, TAU};

use glam::{DVec2, DVec3};

use super::bicubic::{Bicubic, NODES, ORDER};
use super::face::Face;
use crate::geometry::configuration_factor::edge;
use crate::geometry::polygon::area;
use crate::scene::Meter;
use crate::simulator::visibility::Occluder;

/// Times its own size that a part is away where Gauss's rule serves.
const FAR: f64 = 1.5;
/// Times its own size that a rectangle is away where the rule misses nothing to speak of, and what it misses of its factor:
/// a singularity k half sides away leaves (k + sqrt(k² - 1))^-8.
const AFAR: f64 = 4.0;
const MISSED_AFAR: f64 = 1e-7;
/// Halvings of what is nearer; then its exact factor counts for its middle.
const DEEPEST: u32 = 9;
/// What the rule misses of a polynomial, in what it misses of a constant, which is known exactly.
const OF_A_CONSTANT: f64 = 4.0;
/// Lengths below this fraction of what is cut count as zero.
const ROUNDING: f64 = 1e-12;

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

/// A place on a face's plane, from the meter's foot.
type Polygon = Vec<DVec2>;

/// A side of a line on a face's plane.
#[derive(Clone, Copy, Debug)]
struct Side {
    /// Into it.
    normal: DVec2,
    /// What a place has in excess at the origin.
    excess: f64,
}

impl Side {
    fn of(&self, at_m: DVec2) -> f64 {
        self.normal.dot(at_m) + self.excess
    }

    /// The same about another origin.
    fn about(&self, origin: DVec2) -> Self {
        Self { normal: self.normal, excess: self.of(origin) }
    }
}

/// A meter as it stands before a face.
#[derive(Clone, Copy, Debug)]
struct Stand<'a> {
    face: &'a Face,
    position_m: DVec3,
    normal: DVec3,
    foot_m: DVec2,
    before_m: f64,
    /// The meter's horizon: how far above it a place lies.
    horizon: Side,
}

impl<'a> Stand<'a> {
    fn new(meter: &Meter, face: &'a Face) -> Option<Self> {
        let Meter { position_m, normal } = *meter;
        let before_m = face.is_before_m(position_m);
        if before_m <= 0.0 {
            return None;
        }
        let horizon = Side { normal: face.on(normal), excess: -before_m * face.normal.dot(normal) };
        Some(Self { face, position_m, normal, foot_m: face.on(position_m), before_m, horizon })
    }

    /// The kernel of irradiance, cos cos / (pi r²), per square metre.
    fn kernel(&self, at_m: DVec2) -> f64 {
        let square = at_m.length_squared() + self.before_m * self.before_m;
        self.horizon.of(at_m).max(0.0) * self.before_m / (PI * square * square)
    }

    /// The way to a place.
    fn way(&self, at_m: DVec2) -> DVec3 {
        self.face.off(at_m + self.foot_m) - self.position_m
    }

    /// The factor of a polygon above the horizon.
    fn factor(&self, polygon: &[DVec2]) -> f64 {
        let Some(last) = polygon.last() else { return 0.0 };
        let (mut sum, mut from) = (0.0, self.way(*last));
        for at_m in polygon {
            let to = self.way(*at_m);
            sum += edge(from, to, self.normal);
            from = to;
        }
        sum.abs() / TAU
    }
}

/// What of a rectangle shows.
pub(super) struct Shown<'a> {
    stand: Stand<'a>,
    bicubic: &'a Bicubic,
    /// From the meter's foot.
    corner_m: DVec2,
    size_m: DVec2,
    /// Nothing where it is whole.
    pieces: Vec<Polygon>,
    is_whole: bool,
    is_afar: bool,
    distance_m: f64,
    /// Its configuration factor; where it is far away, about.
    pub(super) factor: f64,
}

/// What luminaires light of what shows of a rectangle.
pub(super) struct LitPart {
    pub(super) weights: Weights,
    pub(super) factor: f64,
    /// As of [`Shown::left`].
    pub(super) left: f64,
}

/// The weights of the values at a rectangle's nodes in the illuminance of a meter.
#[derive(Clone, Copy)]
pub(super) struct Weights {
    pub(super) of_nodes: [f64; NODES],
    /// How far off their sum with values of at most 1 may be.
    pub(super) error: f64,
}

/// A meter before a face, with the shadows that bodies cast on that from it.
pub(super) struct Before<'a> {
    stand: Stand<'a>,
    bicubic: &'a Bicubic,
    shadows: Vec<Shadow>,
}

impl View<'_> {
    /// The meter before a face; nothing where it lies behind that.
    pub(super) fn before<'a>(&'a self, face: &'a Face) -> Option<Before<'a>> {
        let stand = Stand::new(self.meter, face)?;
        let shadows = self.occluders.iter().filter_map(|occluder| Shadow::new(&stand, occluder)).collect();
        Some(Before { stand, bicubic: self.bicubic, shadows })
    }
}

impl Before<'_> {
    /// What shows of a rectangle of the face; nothing where it lies behind the meter, or all of it is hidden.
    pub(super) fn of(&self, corner_m: DVec2, size_m: DVec2) -> Option<Shown<'_>> {
        let Self { stand, bicubic, shadows } = self;
        let low = corner_m - stand.foot_m;
        let high = low + size_m;
        let corners = corners(low, size_m);
        let heights = corners.map(|p| stand.horizon.of(p));
        if heights.iter().all(|h| *h <= 0.0) {
            return None;
        }
        let mut pieces: Vec<Polygon> = vec![];
        if heights.iter().any(|h| *h < 0.0) {
            pieces.push(clipped(&corners, &stand.horizon));
        }
        for [from, to] in &stand.face.holes {
            let (from, to) = (*from - stand.foot_m, *to - stand.foot_m);
            if from.cmplt(high).all() && to.cmpgt(low).all() {
                let sides = [
                    Side { normal: DVec2::X, excess: -from.x },
                    Side { normal: DVec2::NEG_X, excess: to.x },
                    Side { normal: DVec2::Y, excess: -from.y },
                    Side { normal: DVec2::NEG_Y, excess: to.y },
                ];
                if !leave_outside(&mut pieces, &corners, &sides) {
                    return None;
                }
            }
        }
        for shadow in shadows.iter().filter(|shadow| shadow.may_meet(low, high, &corners)) {
            if !leave_outside(&mut pieces, &corners, shadow.sides()) {
                return None;
            }
        }
        Shown::new(stand, bicubic, [low, size_m], pieces)
    }
}

/// The shadows that bodies cast on a face from a point before it.
#[derive(Debug)]
pub(super) struct Cast {
    foot_m: DVec2,
    shadows: Vec<Shadow>,
}

impl Cast {
    pub(super) fn shadows(&self) -> usize {
        self.shadows.len()
    }

    /// Nothing where the point lies behind the face.
    pub(super) fn new(from_m: DVec3, face: &Face, occluders: &[Occluder]) -> Option<Self> {
        let stand = Stand::new(&Meter { position_m: from_m, normal: -face.normal }, face)?;
        let shadows = occluders.iter().filter_map(|occluder| Shadow::new(&stand, occluder)).collect();
        Some(Self { foot_m: stand.foot_m, shadows })
    }

    /// Which shadows meet a rectangle of the face; nothing where one of them covers it.
    pub(super) fn on(&self, corner_m: DVec2, size_m: DVec2) -> Option<Vec<u32>> {
        let low = corner_m - self.foot_m;
        let corners = corners(low, size_m);
        let all = self.shadows.iter().enumerate();
        let meeting = all.filter(|(_, shadow)| shadow.may_meet(low, low + size_m, &corners));
        let mut which = vec![];
        for (k, shadow) in meeting {
            if shadow.covers(&corners) {
                return None;
            }
            which.push(k as u32);
        }
        Some(which)
    }
}

fn corners(low: DVec2, size_m: DVec2) -> [DVec2; 4] {
    [DVec2::ZERO, DVec2::X, DVec2::ONE, DVec2::Y].map(|t| low + t * size_m)
}

/// Leaves of pieces, or of what is whole so far, what does not lie within all of some sides; whether that is anything.
fn leave_outside(pieces: &mut Vec<Polygon>, corners: &[DVec2; 4], sides: &[Side]) -> bool {
    if pieces.is_empty() {
        pieces.push(corners.to_vec());
    }
    let mut left = Vec::with_capacity(pieces.len() + 3);
    for piece in pieces.drain(..) {
        outside(piece, sides, &mut left);
    }
    *pieces = left;
    !pieces.is_empty()
}

/// What a box hides of a face: all that lies within its sides.
#[derive(Clone, Copy, Debug)]
struct Shadow {
    /// Corners of what the box covers and the meter's foot.
    low: DVec2,
    high: DVec2,
    sides: [Side; 12],
    count: usize,
}

impl Shadow {
    /// `None` where it plainly hides nothing.
    fn new(stand: &Stand, occluder: &Occluder) -> Option<Self> {
        let face = stand.face;
        // Only what stands between the face's plane and the meter hides any of it.
        let Occluder { min_m, max_m } = face.before(*occluder)?;
        let [near_m, far_m] = [min_m, max_m].map(|p| face.is_before_m(p));
        let slack_m = ROUNDING * stand.before_m;
        if near_m.max(far_m) <= slack_m || near_m.min(far_m) >= stand.before_m - slack_m {
            return None;
        }
        let away = [min_m, max_m].map(|p| p - stand.position_m);
        // At which end of each axis a face looks at the meter.
        let is_seen = |axis: usize, end: usize| if end == 0 { away[0][axis] > 0.0 } else { away[1][axis] < 0.0 };
        let centre = 0.5 * (away[0] + away[1]);
        let mut sides = [Side { normal: DVec2::ZERO, excess: 0.0 }; 12];
        let mut count = 0;
        for axis in 0..3 {
            let (b, c) = ((axis + 1) % 3, (axis + 2) % 3);
            if away[1][axis] == away[0][axis] {
                continue;
            }
            for (at_b, at_c) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
                if is_seen(b, at_b) == is_seen(c, at_c) {
                    continue;
                }
                // The plane through the meter and an edge of the outline.
                let mut normal = DVec3::ZERO;
                (normal[b], normal[c]) = (away[at_c][c], -away[at_b][b]);
                let length = normal.length();
                if length == 0.0 {
                    continue;
                }
                normal /= if normal.dot(centre) < 0.0 { -length } else { length };
                sides[count] = Side { normal: face.on(normal), excess: -stand.before_m * face.normal.dot(normal) };
                count += 1;
            }
        }
        let (box_low, box_high) = (face.on(min_m) - stand.foot_m, face.on(max_m) - stand.foot_m);
        (count > 2).then_some(Self { low: box_low, high: box_high, sides, count })
    }

    fn sides(&self) -> &[Side] {
        &self.sides[..self.count]
    }

    /// Whether it holds all of a rectangle.
    fn covers(&self, corners: &[DVec2; 4]) -> bool {
        self.sides().iter().all(|side| corners.iter().all(|p| side.of(*p) >= 0.0))
    }

    fn may_meet(&self, low: DVec2, high: DVec2, corners: &[DVec2; 4]) -> bool {
        // What lies between the meter and a rectangle lies between the meter's foot and that on its plane, too.
        let is_beyond = self.low.cmpge(high.max(DVec2::ZERO)).any() || self.high.cmple(low.min(DVec2::ZERO)).any();
        let parts = |side: &Side| corners.iter().all(|p| side.of(*p) <= ROUNDING);
        !(is_beyond || self.sides().iter().any(parts))
    }
}

/// The part of a convex polygon on one side of a line.
fn clipped(polygon: &[DVec2], side: &Side) -> Polygon {
    let mut kept = Vec::with_capacity(polygon.len() + 1);
    let Some(last) = polygon.last() else { return kept };
    let (mut p, mut a) = (*last, side.of(*last));
    for &q in polygon {
        let b = side.of(q);
        if (a < 0.0 && b > 0.0) || (a > 0.0 && b < 0.0) {
            kept.push(p.lerp(q, a / (a - b)));
        }
        if b >= 0.0 {
            kept.push(q);
        }
        (p, a) = (q, b);
    }
    kept
}

/// Adds the pieces of a convex polygon that do not lie within all of some sides; what does is left.
fn outside(piece: Polygon, sides: &[Side], left: &mut Vec<Polygon>) -> Option<Polygon> {
    if sides.iter().any(|side| piece.iter().all(|p| side.of(*p) <= ROUNDING)) {
        left.push(piece);
        return None;
    }
    let mut inside = piece;
    for side in sides {
        if inside.iter().all(|p| side.of(*p) >= 0.0) {
            continue;
        }
        let part = clipped(&inside, &Side { normal: -side.normal, excess: -side.excess });
        if is_solid(&part) {
            left.push(part);
            inside = clipped(&inside, side);
            if !is_solid(&inside) {
                return None;
            }
        }
    }
    Some(inside)
}

fn middle(polygon: &[DVec2]) -> DVec2 {
    polygon.iter().sum::<DVec2>() / polygon.len() as f64
}

/// Whether a polygon has an area to speak of.
fn is_solid(polygon: &[DVec2]) -> bool {
    polygon.len() >= 3
        && (2..polygon.len()).any(|k| {
            let (a, b) = (polygon[k - 1] - polygon[0], polygon[k] - polygon[0]);
            a.perp_dot(b).abs() > ROUNDING * ROUNDING * (a.length_squared() + b.length_squared())
        })
}

impl<'a> Shown<'a> {
    /// Nothing where no part of it shows.
    fn new(
        stand: &Stand<'a>,
        bicubic: &'a Bicubic,
        [corner_m, size_m]: [DVec2; 2],
        pieces: Vec<Polygon>,
    ) -> Option<Self> {
        let middle_m = corner_m + 0.5 * size_m;
        let distance_m = (middle_m.length_squared() + stand.before_m * stand.before_m).sqrt();
        let is_whole = pieces.is_empty();
        let is_afar = distance_m >= AFAR * size_m.max_element();
        let factor = if is_afar && is_whole {
            size_m.element_product() * stand.kernel(middle_m)
        } else if is_afar {
            pieces.iter().map(|piece| area(piece).abs() * stand.kernel(middle(piece))).sum()
        } else if is_whole {
            stand.factor(&corners(corner_m, size_m))
        } else {
            pieces.iter().map(|piece| stand.factor(piece)).sum()
        };
        (factor > 0.0).then_some(Self {
            stand: *stand,
            bicubic,
            corner_m,
            size_m,
            pieces,
            is_whole,
            is_afar,
            distance_m,
            factor,
        })
    }

    /// What of it some of the shadows from another point leave lit, from the weights of all of it; nothing where that is nothing.
    ///
    /// Shadows are taken off where they are simpler than what they leave.
    pub(super) fn lit(&self, all: &Weights, cast: &Cast, which: &[u32]) -> Option<LitPart> {
        let corners = corners(self.corner_m, self.size_m);
        let mut lit = if self.pieces.is_empty() { vec![corners.to_vec()] } else { self.pieces.clone() };
        let origin_m = self.stand.foot_m - cast.foot_m;
        let mut shadowed = vec![];
        for k in which {
            let shadow = &cast.shadows[*k as usize];
            let sides = shadow.sides.map(|side| side.about(origin_m));
            let mut left = Vec::with_capacity(lit.len() + 3);
            for piece in lit.drain(..) {
                shadowed.extend(outside(piece, &sides[..shadow.count], &mut left));
            }
            lit = left;
        }
        if shadowed.is_empty() {
            return Some(LitPart { weights: *all, factor: self.factor, left: self.left() });
        }
        let corners_of = |pieces: &[Polygon]| pieces.iter().map(Vec::len).sum::<usize>();
        let is_simpler = corners_of(&shadowed) < corners_of(&lit);
        let part = |pieces| Self::new(&self.stand, self.bicubic, [self.corner_m, self.size_m], pieces);
        if lit.is_empty() {
            return None;
        }
        if !is_simpler {
            return part(lit).map(|part| LitPart { weights: part.weights(), factor: part.factor, left: 1.0 });
        }
        let Some(part) = part(shadowed) else {
            return Some(LitPart { weights: *all, factor: self.factor, left: 1.0 });
        };
        let hidden = part.weights();
        let of_nodes: [f64; NODES] = std::array::from_fn(|k| all.of_nodes[k] - hidden.of_nodes[k]);
        let weights = Weights { of_nodes, error: all.error + hidden.error };
        // Of what is far away factors are known less well than weights.
        Some(LitPart { weights, factor: of_nodes.iter().sum::<f64>().max(0.0), left: 1.0 })
    }

    /// The part of what a polynomial leaves out that is left, were all of it seen as it is: of what has neither mean nor slope nor
    /// curvature nor cube nothing but the kernel's own terms of degree 4 is seen from afar.
    pub(super) fn left(&self) -> f64 {
        if self.is_whole { (self.size_m.max_element() / self.distance_m).powi(4).min(1.0) } else { 1.0 }
    }

    pub(super) fn weights(&self) -> Weights {
        let mut of_nodes = [0.0; NODES];
        if self.is_whole {
            self.add_rectangle(self.corner_m, self.size_m, 0, &mut of_nodes);
        }
        for piece in &self.pieces {
            for k in (2..piece.len()).step_by(2) {
                match piece.get(k + 1) {
                    Some(last) => self.add_quadrangle([piece[0], piece[k - 1], piece[k], *last], &mut of_nodes),
                    None => self.add_triangle([piece[0], piece[k - 1], piece[k]], 0, &mut of_nodes),
                }
            }
        }
        if self.is_afar {
            let factor: f64 = of_nodes.iter().sum();
            return Weights { of_nodes, error: OF_A_CONSTANT * MISSED_AFAR * factor + 1e-13 };
        }
        let missed = (of_nodes.iter().sum::<f64>() - self.factor).abs();
        Weights { of_nodes, error: OF_A_CONSTANT * missed + 1e-13 }
    }

    fn distance_m(&self, at_m: DVec2) -> f64 {
        (at_m.length_squared() + self.stand.before_m * self.stand.before_m).sqrt()
    }

    fn add_rectangle(&self, corner_m: DVec2, size_m: DVec2, depth: u32, sums: &mut [f64; NODES]) {
        let bicubic = self.bicubic;
        let middle_m = corner_m + 0.5 * size_m;
        if self.distance_m(middle_m) >= FAR * size_m.max_element() {
            let area_m2 = size_m.element_product();
            let kernel: [f64; NODES] = std::array::from_fn(|k| {
                bicubic.weight(k) * area_m2 * self.stand.kernel(corner_m + bicubic.node(k) * size_m)
            });
            if depth == 0 {
                *sums = kernel;
                return;
            }
            // Along one side after the other, since the basis is a product.
            let (from, part) = ((corner_m - self.corner_m) / self.size_m, size_m / self.size_m);
            let along = |axis: usize| -> [[f64; ORDER]; ORDER] {
                std::array::from_fn(|k| bicubic.lagrange(from[axis] + part[axis] * bicubic.nodes[k]))
            };
            let (x, y) = (along(0), along(1));
            for i in 0..ORDER {
                let mut row = [0.0; ORDER];
                for j in 0..ORDER {
                    for (row, y) in row.iter_mut().zip(y[j]) {
                        *row += kernel[ORDER * i + j] * y;
                    }
                }
                for (a, x) in x[i].iter().enumerate() {
                    for (b, row) in row.iter().enumerate() {
                        sums[ORDER * a + b] += x * row;
                    }
                }
            }
        } else if depth == DEEPEST {
            self.add(middle_m, self.stand.factor(&corners(corner_m, size_m)), sums);
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

    /// A convex one.
    fn add_quadrangle(&self, [a, b, c, d]: [DVec2; 4], sums: &mut [f64; NODES]) {
        let bicubic = self.bicubic;
        let longest_m = (c - a).length().max((d - b).length());
        if self.distance_m(0.25 * (a + b + c + d)) < FAR * longest_m {
            self.add_triangle([a, b, c], 0, sums);
            self.add_triangle([a, c, d], 0, sums);
            return;
        }
        for k in 0..NODES {
            let DVec2 { x, y } = bicubic.node(k);
            let (low, high) = (a.lerp(b, x), d.lerp(c, x));
            let at_m = low.lerp(high, y);
            let area_m2 = (b - a).lerp(c - d, y).perp_dot(high - low).abs();
            self.add(at_m, bicubic.weight(k) * area_m2 * self.stand.kernel(at_m), sums);
        }
    }

    fn add_triangle(&self, t: [DVec2; 3], depth: u32, sums: &mut [f64; NODES]) {
        let bicubic = self.bicubic;
        let middle_m = (t[0] + t[1] + t[2]) / 3.0;
        let longest_m = (t[1] - t[0]).length().max((t[2] - t[1]).length()).max((t[0] - t[2]).length());
        if self.distance_m(middle_m) >= FAR * longest_m {
            let area_m2 = (t[1] - t[0]).perp_dot(t[2] - t[0]).abs();
            for k in 0..NODES {
                let DVec2 { x, y } = bicubic.node(k);
                let at_m = t[0] + x * (t[1].lerp(t[2], y) - t[0]);
                self.add(at_m, bicubic.weight(k) * x * area_m2 * self.stand.kernel(at_m), sums);
            }
        } else if depth == DEEPEST {
            self.add(middle_m, self.stand.factor(&t), sums);
        } else {
            let [ab, bc, ca] = [(t[0], t[1]), (t[1], t[2]), (t[2], t[0])].map(|(p, q)| 0.5 * (p + q));
            for quarter in [[t[0], ab, ca], [ab, t[1], bc], [ca, bc, t[2]], [ab, bc, ca]] {
                self.add_triangle(quarter, depth + 1, sums);
            }
        }
    }

    fn add(&self, at_m: DVec2, weight: f64, sums: &mut [f64; NODES]) {
        let t = (at_m - self.corner_m) / self.size_m;
        let (a, b) = (self.bicubic.lagrange(t.x), self.bicubic.lagrange(t.y));
        for (k, sum) in sums.iter_mut().enumerate() {
            *sum += weight * a[k / ORDER] * b[k % ORDER];
        }
    }
}

#[cfg(test)]
mod tests {
    use approx::assert_relative_eq;

    use super::*;
    use crate::geometry::configuration_factor::element_to_polygon;
    use crate::geometry::{Reflectances, Room};
    use crate::simulator::sampler::{self, mix};
    use crate::simulator::visibility::{candidates, visible_pieces};

    fn unit(k: u64) -> f64 {
        sampler::unit(mix(k))
    }

    /// Rectangles behind random boxes: as much shows of them as the cutter of luminaires says, which goes by other planes.
    #[test]
    fn what_shows_is_what_another_cutter_leaves() {
        let room =
            Room { size_m: DVec3::new(5.0, 4.0, 3.0), reflectance: Reflectances::with_equal_walls(0.5, 0.5, 0.5) };
        let mut partly = 0;
        for k in 0..4000_u64 {
            let at = |j: u64| room.size_m * DVec3::new(unit(100 * k + j), unit(100 * k + j + 1), unit(100 * k + j + 2));
            let boxes: Vec<Occluder> = (0..3)
                .map(|j| {
                    let (a, b) = (at(10 * j + 1), at(10 * j + 4));
                    Occluder { min_m: a.min(b), max_m: a.max(b) }
                })
                .collect();
            let (position_m, to) = (at(50), at(60) - at(70));
            if boxes.iter().any(|b| position_m.cmpge(b.min_m).all() && position_m.cmple(b.max_m).all()) {
                continue;
            }
            let meter = Meter { position_m, normal: to.normalize() };
            let face = &Face::walls(&room)[(k % 6) as usize];
            let corner_m = face.size_m() * DVec2::new(unit(100 * k + 80), unit(100 * k + 81));
            let size_m = (face.size_m() - corner_m) * DVec2::new(unit(100 * k + 82), unit(100 * k + 83));
            let corners = [DVec2::ZERO, DVec2::X, DVec2::ONE, DVec2::Y].map(|t| face.off(corner_m + t * size_m));
            let hiding = candidates(position_m, &corners, &boxes);
            let pieces = visible_pieces(position_m, &corners, &hiding);
            let exact: f64 = pieces.iter().map(|p| element_to_polygon(position_m, meter.normal, p)).sum();
            let bicubic = Bicubic::new();
            let view = View { meter: &meter, occluders: &boxes, bicubic: &bicubic };
            let before = view.before(face);
            let weights = before.as_ref().and_then(|before| before.of(corner_m, size_m)).map(|shown| shown.weights());
            let (found, error) = weights.map_or((0.0, 0.0), |w| (w.of_nodes.iter().sum::<f64>(), w.error));
            assert!((found - exact).abs() <= error + 1e-10, "{k}: {found} +- {error} for {exact}");
            partly += u32::from(pieces.len() > 1);
        }
        assert!(partly > 200, "{partly}");
    }

    #[test]
    fn weights_integrate_cubics_over_what_shows() {
        let room =
            Room { size_m: DVec3::new(4.0, 4.0, 3.0), reflectance: Reflectances::with_equal_walls(0.5, 0.5, 0.5) };
        let boxes = [Occluder { min_m: DVec3::new(1.0, 1.0, 1.0), max_m: DVec3::new(2.2, 1.7, 1.6) }];
        let meter = Meter { position_m: DVec3::new(1.3, 2.1, 0.4), normal: DVec3::Z };
        let face = &Face::walls(&room)[5];
        let (corner_m, size_m) = (DVec2::new(0.2, 0.1), DVec2::new(3.0, 2.5));
        let f = |t: DVec2| 1.0 + t.x * t.x * t.x - 2.0 * t.x * t.y * t.y;
        let bicubic = Bicubic::new();
        let view = View { meter: &meter, occluders: &boxes, bicubic: &bicubic };
        let before = view.before(face).unwrap();
        let weights = before.of(corner_m, size_m).unwrap().weights();
        let found: f64 = (0..NODES).map(|k| weights.of_nodes[k] * f(bicubic.node(k))).sum();
        let (n, mut counted) = (1500, 0.0);
        for i in 0..n {
            for j in 0..n {
                let t = DVec2::new((f64::from(i) + 0.5) / f64::from(n), (f64::from(j) + 0.5) / f64::from(n));
                let p = face.off(corner_m + t * size_m);
                let way = p - meter.position_m;
                if !boxes[0].blocks(meter.position_m, p) {
                    counted += f(t) * way.z * way.z / (PI * way.length_squared().powi(2));
                }
            }
        }
        counted *= size_m.element_product() / f64::from(n).powi(2);
        assert_relative_eq!(found, counted, max_relative = 1e-4);
    }
}
