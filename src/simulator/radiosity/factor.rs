//! What an element sees of a patch: its configuration factor, the factor's moments, and the light of a varying exitance.
//!
//! Parts of the patch that nothing hides are quartered until they are far and integrated by a rule; parts that
//! something hides, or the horizon crosses, are quartered twice and then clipped exactly.

use glam::DVec3;

use super::exitance::{Exitance, Nine, QUARTERS, RULE, basis};
use super::patches::Patch;
use crate::geometry::configuration_factor::element_to_polygon;
use crate::simulator::visibility::{Occluder, candidates, clip, visible_pieces};

/// A part this many radii away is integrated by the nine-point rule: 2e-5 of its factor.
const FAR: f64 = 5.0;
/// Quarterings of a patch before what is still near is taken as uniform.
const DEEPEST: u32 = 5;
/// Quarterings before what is clipped is taken as uniform, piece by piece.
const DEEPEST_CLIPPED: u32 = 2;
/// Heights below this fraction of a part count as on the horizon.
const ON_HORIZON: f64 = 1e-9;
/// Radon's rule of degree 5 on a triangle: weights and barycentric coordinates.
const TRIANGLE_RULE: [(f64, [f64; 3]); 7] = {
    const A: f64 = 0.470_142_064_105_115_1;
    const B: f64 = 0.101_286_507_323_456_34;
    const WA: f64 = 0.132_394_152_788_506_2;
    const WB: f64 = 0.125_939_180_544_827_15;
    const T: f64 = 1.0 / 3.0;
    [
        (0.225, [T, T, T]),
        (WA, [A, A, 1.0 - 2.0 * A]),
        (WA, [A, 1.0 - 2.0 * A, A]),
        (WA, [1.0 - 2.0 * A, A, A]),
        (WB, [B, B, 1.0 - 2.0 * B]),
        (WB, [B, 1.0 - 2.0 * B, B]),
        (WB, [1.0 - 2.0 * B, B, B]),
    ]
};

/// A configuration factor and what goes with it.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Factor {
    /// For biquadratic exitance of 1 at one of the patch's nodes and 0 at the others, in their order.
    pub(super) by_node: Nine,
    /// Weighted with the patch's own exitance.
    pub(super) weighted: f64,
}

impl Factor {
    fn add(&mut self, seen: f64, a: f64, b: f64, exitance: f64) {
        let (u, v) = (basis(a), basis(b));
        for (k, sum) in self.by_node.iter_mut().enumerate() {
            *sum += seen * u[k / 3] * v[k % 3];
        }
        self.weighted += seen * exitance;
    }

    fn add_scaled(&mut self, other: &Self, by: f64) {
        for (sum, more) in self.by_node.iter_mut().zip(&other.by_node) {
            *sum += by * more;
        }
        self.weighted += by * other.weighted;
    }
}

/// A part of a patch, in coordinates of -1..=1 along both sides.
#[derive(Clone, Copy)]
struct Part<'a> {
    a: f64,
    b: f64,
    half: f64,
    depth: u32,
    /// The smallest part with an exitance of its own that holds it.
    exitance: &'a Exitance,
    /// Centre and half side of that part.
    within: (f64, f64, f64),
}

impl<'a> Part<'a> {
    fn whole(exitance: &'a Exitance) -> Self {
        Self { a: 0.0, b: 0.0, half: 1.0, depth: 0, exitance, within: (0.0, 0.0, 1.0) }
    }

    fn quarters(self) -> [Self; 4] {
        std::array::from_fn(|k| {
            let (a, b) = (self.a + QUARTERS[k].0 * self.half, self.b + QUARTERS[k].1 * self.half);
            let part = Self { a, b, half: 0.5 * self.half, depth: self.depth + 1, ..self };
            match self.exitance.quarters() {
                Some(quarters) => Self { exitance: &quarters[k], within: (a, b, part.half), ..part },
                None => part,
            }
        })
    }

    fn exitance_at(&self, a: f64, b: f64) -> f64 {
        let (centre_a, centre_b, half) = self.within;
        self.exitance.at((a - centre_a) / half, (b - centre_b) / half)
    }
}

/// An element that looks at a patch.
struct View<'a> {
    position_m: DVec3,
    normal: DVec3,
    patch: &'a Patch,
    /// Half the patch's sides.
    u: DVec3,
    v: DVec3,
}

/// What an element sees of a patch with a given exitance.
pub(super) fn factor(
    position_m: DVec3,
    normal: DVec3,
    patch: &Patch,
    exitance: &Exitance,
    occluders: &[Occluder],
) -> Factor {
    let mut factor = Factor::default();
    let away = patch.centre_m - position_m;
    if away.dot(patch.normal) >= 0.0 || away.dot(normal) <= -patch.radius_m {
        return factor;
    }
    let (u, v) = (0.5 * patch.side_m(0), 0.5 * patch.side_m(1));
    let view = View { position_m, normal, patch, u, v };
    let hiding = candidates(position_m, &patch.corners_m, occluders);
    if view.is_hidden(&patch.corners_m, &hiding) {
        return factor;
    }
    view.add(Part::whole(exitance), &hiding, &mut factor);
    factor
}

impl View<'_> {
    fn add(&self, part: Part, hiding: &[&Occluder], factor: &mut Factor) {
        let centre = self.patch.centre_m + self.u * part.a + self.v * part.b;
        let radius = self.patch.radius_m * part.half;
        let away = centre - self.position_m;
        let height = away.dot(self.normal);
        if height <= -radius {
            return;
        }
        let far = away.length_squared() > (FAR * radius).powi(2);
        // The least height of a corner above the element's horizon.
        let lowest = height - part.half * (self.u.dot(self.normal).abs() + self.v.dot(self.normal).abs());
        if hiding.is_empty() && far && lowest >= -ON_HORIZON * radius {
            return self.add_far(part, away, factor);
        }
        let deepest = if hiding.is_empty() { DEEPEST } else { DEEPEST_CLIPPED };
        if part.depth >= deepest || (far && part.depth > 0) {
            return self.add_clipped(part, hiding, factor);
        }
        for quarter in part.quarters() {
            if hiding.is_empty() {
                self.add(quarter, hiding, factor);
                continue;
            }
            let outline = self.corners(quarter);
            if self.is_hidden(&outline, hiding) {
                continue;
            }
            let centre = 0.5 * (outline[0] + outline[2]);
            let still: Vec<_> =
                hiding.iter().copied().filter(|o| o.may_hide(self.position_m, &outline, centre)).collect();
            self.add(quarter, &still, factor);
        }
    }

    /// Whether one body, being convex, hides all of an outline.
    fn is_hidden(&self, outline: &[DVec3; 4], hiding: &[&Occluder]) -> bool {
        hiding.iter().any(|o| outline.iter().all(|corner| o.blocks(self.position_m, *corner)))
    }

    fn corners(&self, part: Part) -> [DVec3; 4] {
        let h = part.half;
        [(-h, -h), (h, -h), (h, h), (-h, h)]
            .map(|(a, b)| self.patch.centre_m + self.u * (part.a + a) + self.v * (part.b + b))
    }

    fn add_far(&self, part: Part, away: DVec3, factor: &mut Factor) {
        let scale = -away.dot(self.patch.normal) * self.patch.area_m2 * part.half * part.half / std::f64::consts::PI;
        let (u, v) = (self.u * part.half, self.v * part.half);
        for (i, (x, wx)) in RULE.into_iter().enumerate() {
            for (j, (y, wy)) in RULE.into_iter().enumerate() {
                let d = away + x * u + y * v;
                let r2 = d.length_squared();
                let seen = scale * wx * wy * d.dot(self.normal) / (r2 * r2);
                let (a, b) = (part.a + part.half * x, part.b + part.half * y);
                let own = part.half == part.within.2;
                let exitance = if own { part.exitance.at_node(3 * i + j) } else { part.exitance_at(a, b) };
                factor.add(seen, a, b, exitance);
            }
        }
    }

    fn add_clipped(&self, part: Part, hiding: &[&Occluder], factor: &mut Factor) {
        let above = clip(&self.corners(part), self.normal, self.position_m);
        if above.len() < 3 {
            return;
        }
        if hiding.is_empty() {
            return self.add_piece(part, &above, factor);
        }
        for piece in visible_pieces(self.position_m, &above, hiding) {
            self.add_piece(part, &piece, factor);
        }
    }

    /// A piece: its factor exact, shared out over the patch by a rule on its triangles.
    fn add_piece(&self, part: Part, piece: &[DVec3], factor: &mut Factor) {
        let (mut own, mut sum) = (Factor::default(), 0.0);
        for k in 2..piece.len() {
            let t = [piece[0], piece[k - 1], piece[k]];
            let area = (t[1] - t[0]).cross(t[2] - t[0]).length();
            for (weight, [a, b, c]) in TRIANGLE_RULE {
                let p = a * t[0] + b * t[1] + c * t[2];
                let away = p - self.position_m;
                let seen = weight * area * away.dot(self.normal).max(0.0) / away.length_squared().powi(2);
                let from_centre = p - self.patch.centre_m;
                let a = from_centre.dot(self.u) / self.u.length_squared();
                let b = from_centre.dot(self.v) / self.v.length_squared();
                own.add(seen, a, b, part.exitance_at(a, b));
                sum += seen;
            }
        }
        if sum > 0.0 {
            factor.add_scaled(&own, element_to_polygon(self.position_m, self.normal, piece) / sum);
        }
    }
}
