//! Parts of what a luminaire lights on one face of the room, each with the points that stand for its reflected flux.
//!
//! A product Gauss rule sees a kernel whose pole lies `z` half-lengths away from its centre with an error that falls like
//! `(z + sqrt(z² - 1))^(-2n)` in its points n a direction (Trefethen, *Approximation Theory and Approximation Practice*
//! (2013), theorem 19.3), so that patches far away need few points, and near ones are halved.

#![expect(clippy::inline_always, reason = "compiled for what the processor has")]

use std::sync::OnceLock;

use glam::DVec3;
use pulp::{Arch, Simd, WithSimd};

use super::cells::{Cell, Line, LuminaireFrame, Padded, Row};
use super::grid::{Face, MOST};
use super::kernel::{LANES, View};
use crate::quadrature::Gauss;
use luxproof_scene::geometry::Room;

/// A cell whose halves differ more than this in length is halved: its map is too uneven for a product rule.
const UNEVEN: f64 = 3.0123;
/// Which of two lengths is longer: no 1, because equal ones are frequent and rounding would decide.
const TIE: f64 = 1.000_123;
/// How many rules of different size a patch may use.
const RULES: usize = 3;

/// The rules of every size up to the one for near patches, and from where on each serves.
#[derive(Debug)]
pub(super) struct Rules {
    gauss: Vec<Gauss>,
    /// Squared distances in half-lengths beyond which the rule of each size serves.
    beyond2: Vec<f64>,
    /// The largest angle in radians whose sines and cosines the rule of each size integrates.
    widest_rad: Vec<f64>,
}

/// A part of a cell, on its face.
#[derive(Debug)]
pub(super) struct Patch {
    cell: Cell,
    /// Parameter ranges within the cell.
    s: (f64, f64),
    t: (f64, f64),
    /// Lines at its start, middle and end along s.
    rows: [Row; 3],
    /// Where the start, middle and end of each of them along t meet the face.
    hits_m: [[DVec3; 3]; 3],
    pub(super) centre_m: DVec3,
    pub(super) half_m: DVec3,
    pub(super) half_length_m: f64,
    split: Split,
    /// Points a direction of the rules for near, for middling and for far receivers.
    sizes: [u8; RULES],
    halves: OnceLock<Box<[Patch; 2]>>,
    points: [OnceLock<Points>; RULES],
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Split {
    AlongS,
    AlongT,
    /// Needed for the map's own sake, at any distance.
    UnevenS,
    UnevenT,
}

/// What patches are made on: a luminaire and the face that it lights.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ground<'a> {
    pub(super) frame: &'a LuminaireFrame,
    pub(super) room: &'a Room,
    pub(super) face: Face,
    pub(super) rules: &'a Rules,
}

/// Points on a face and the flux that falls there: all u, all v, all fluxes, some of which may be 0.
#[derive(Clone, Debug)]
pub(super) struct Points(Box<[f64]>);

impl Rules {
    /// Rules of up to `count` points a direction, of which the largest serves from `reach` half-lengths on.
    pub(super) fn new(count: usize, reach: f64, tolerance: f64) -> Self {
        // The rate at which the error falls in the nearest patches, kept by smaller rules farther away.
        let nearest = 1.0 + reach;
        let rate = count as f64 * (nearest + (nearest * nearest - 1.0).sqrt()).ln();
        let from = |n: usize| {
            let radius = (rate / n as f64).exp();
            (0.5 * (radius + 1.0 / radius) - 1.0).powi(2)
        };
        // The Gauss rule of n points errs by about x^(2n) / (2n)! for the cosine of x on either side.
        let widest = |n: usize| {
            let factorial: f64 = (1..=2 * n).map(|k| k as f64).product();
            (tolerance * factorial).powf(0.5 / n as f64)
        };
        Self {
            gauss: (1..=count).map(Gauss::new).collect(),
            beyond2: (1..=count).map(from).collect(),
            widest_rad: (1..=count).map(widest).collect(),
        }
    }
}

impl Patch {
    /// A cell as a whole.
    pub(super) fn new(cell: Cell, ground: Ground) -> Self {
        let parts = [0.0, 0.5, 1.0];
        let rows = parts.map(|s| ground.frame.row(&cell, s));
        let hits_m = rows.map(|row| parts.map(|t| ground.hit(row.direction(t).0)));
        Self::of_hits(cell, ((0.0, 1.0), (0.0, 1.0)), &rows, hits_m, ground.rules)
    }

    fn of_hits(
        cell: Cell,
        (s, t): ((f64, f64), (f64, f64)),
        rows: &[Row; 3],
        hits_m: [[DVec3; 3]; 3],
        rules: &Rules,
    ) -> Self {
        let p = &hits_m;
        let all = || p.iter().flatten();
        let low = all().fold(DVec3::INFINITY, |m, q| m.min(*q));
        let high = all().fold(DVec3::NEG_INFINITY, |m, q| m.max(*q));
        let along_s = [0, 1, 2].map(|j| (p[0][j].distance(p[1][j]), p[1][j].distance(p[2][j])));
        let along_t = [0, 1, 2].map(|i| (p[i][0].distance(p[i][1]), p[i][1].distance(p[i][2])));
        let length = |rows: &[(f64, f64)]| rows.iter().map(|(a, b)| a + b).fold(0.0, f64::max);
        let (length_s, length_t) = (length(&along_s), length(&along_t));
        let longest = length_s.max(length_t);
        let uneven =
            |rows: &[(f64, f64)]| rows.iter().any(|(a, b)| a.max(*b) > UNEVEN * a.min(*b) && a + b > 0.05 * longest);
        let split = match (uneven(&along_s), uneven(&along_t)) {
            (_, true) => Split::UnevenT,
            (true, false) => Split::UnevenS,
            _ if length_s > TIE * length_t => Split::AlongS,
            _ => Split::AlongT,
        };
        let (centre_m, half_m) = (0.5 * (low + high), 0.52 * (high - low));
        let near = rules.gauss.len();
        let along_gamma = rows.iter().map(|row| row.gamma_rad() * (t.1 - t.0)).fold(0.0, f64::max);
        let angle = cell.turn_rad(s).max(along_gamma);
        let far = 1 + rules.widest_rad.iter().position(|widest| angle <= *widest).unwrap_or(near - 1);
        let sizes = [near, usize::midpoint(near, far), far].map(|n| n as u8);
        let (halves, points) = (OnceLock::new(), [const { OnceLock::new() }; RULES]);
        Self {
            cell,
            s,
            t,
            rows: *rows,
            hits_m,
            centre_m,
            half_m,
            half_length_m: 0.5 * longest,
            split,
            sizes,
            halves,
            points,
        }
    }

    /// The piece of the luminaire's table that the patch is lit by.
    pub(super) fn piece(&self) -> (usize, usize) {
        self.cell.piece()
    }

    /// Whether the map is too uneven for any rule.
    pub(super) fn is_uneven(&self) -> bool {
        matches!(self.split, Split::UnevenS | Split::UnevenT)
    }

    /// The smallest rule that serves at a squared distance; `None` where the patch must be halved.
    pub(super) fn rule_at(&self, distance2: f64, rules: &Rules) -> Option<usize> {
        let h2 = self.half_length_m * self.half_length_m;
        (0..RULES).rev().find(|k| rules.beyond2[usize::from(self.sizes[*k]) - 1] * h2 <= distance2)
    }

    pub(super) const RULES: usize = RULES;
    /// The rule for receivers far away.
    pub(super) const FAR: usize = RULES - 1;
    /// The rule for receivers neither far nor near.
    pub(super) const MIDDLING: usize = 1;
    /// The rule for the nearest receivers.
    pub(super) const NEAR: usize = 0;

    /// How many points a rule of the patch has.
    pub(super) fn count(&self, rule: usize) -> usize {
        usize::from(self.sizes[rule]).pow(2)
    }

    pub(super) fn kept_halves(&self) -> &OnceLock<Box<[Self; 2]>> {
        &self.halves
    }

    pub(super) fn kept_points(&self, rule: usize) -> &OnceLock<Points> {
        &self.points[rule]
    }

    /// Two halves, which meet the face where the whole does but for the lines in their own middles.
    pub(super) fn halve(&self, ground: Ground) -> Box<[Patch; 2]> {
        let middle = |(a, b): (f64, f64)| 0.5 * (a + b);
        let (of_s, of_t) = ((self.s.0, middle(self.s), self.s.1), (self.t.0, middle(self.t), self.t.1));
        Box::new(match self.split {
            Split::AlongS | Split::UnevenS => [(0, of_s.0, of_s.1), (1, of_s.1, of_s.2)].map(|(k, low, high)| {
                let row = ground.frame.row(&self.cell, middle((low, high)));
                let hits_m = [of_t.0, of_t.1, of_t.2].map(|t| ground.hit(row.direction(t).0));
                let rows = [self.rows[k], row, self.rows[k + 1]];
                let hits_m = [self.hits_m[k], hits_m, self.hits_m[k + 1]];
                Self::of_hits(self.cell, ((low, high), self.t), &rows, hits_m, ground.rules)
            }),
            Split::AlongT | Split::UnevenT => [(0, of_t.0, of_t.1), (1, of_t.1, of_t.2)].map(|(k, low, high)| {
                let t = middle((low, high));
                let hits_m = [0, 1, 2].map(|i| {
                    let ends = &self.hits_m[i];
                    [ends[k], ground.hit(self.rows[i].direction(t).0), ends[k + 1]]
                });
                Self::of_hits(self.cell, (self.s, (low, high)), &self.rows, hits_m, ground.rules)
            }),
        })
    }

    pub(super) fn sample(&self, rule: usize, ground: Ground) -> Points {
        let gauss = &ground.rules.gauss[usize::from(self.sizes[rule]) - 1];
        Arch::new().dispatch(Sampling { patch: self, gauss, ground })
    }
}

struct Sampling<'a> {
    patch: &'a Patch,
    gauss: &'a Gauss,
    ground: Ground<'a>,
}

impl WithSimd for Sampling<'_> {
    type Output = Points;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> Points {
        match self.gauss.nodes.len() {
            ..=4 => self.points::<4>(),
            5..=8 => self.points::<8>(),
            _ => self.points::<MOST>(),
        }
    }
}

impl Sampling<'_> {
    #[inline(always)]
    fn points<const N: usize>(&self) -> Points {
        let Self { patch, gauss, ground } = self;
        let order = gauss.nodes.len();
        let count = (order * order).next_multiple_of(LANES);
        let mut numbers = vec![0.0; 3 * count].into_boxed_slice();
        let (s, t) = ((patch.s.0, patch.s.1 - patch.s.0), (patch.t.0, patch.t.1 - patch.t.0));
        let rule = Padded::<N>::new(gauss);
        let rows = ground.frame.rows(&patch.cell, s, t, &rule);
        for k in 0..order {
            let line = rows.line(k, &rule);
            let [u, v] = ground.places(&line);
            for (part, values) in [u, v, line.flux].iter().enumerate() {
                numbers[part * count + k * order..][..order].copy_from_slice(&values[..order]);
            }
        }
        Points(numbers)
    }
}

impl Ground<'_> {
    /// Where the directions of a line meet the face, along u and along v, kept within it against rounding.
    #[inline(always)]
    fn places<const N: usize>(&self, line: &Line<N>) -> [[f64; N]; 2] {
        let (n, u, v) = self.face.axes();
        let from_m = self.frame.position_m;
        let depth = self.face.plane(self.room.size_m) - from_m[n];
        let mut distance = [0.0; N];
        for (k, distance) in distance.iter_mut().enumerate() {
            *distance = (depth / (line.sin[k] * line.across[n] - line.cos[k] * line.axis[n])).abs();
        }
        let mut places = [[0.0; N]; 2];
        for (places, axis) in places.iter_mut().zip([u, v]) {
            let (from, most) = (from_m[axis], self.room.size_m[axis]);
            let (across, along) = (line.across[axis], line.axis[axis]);
            for k in 0..N {
                let place = from + (line.sin[k] * across - line.cos[k] * along) * distance[k];
                places[k] = place.clamp(0.0, most);
            }
        }
        places
    }

    /// Where a direction from the luminaire meets the face, kept within the face against rounding.
    fn hit(&self, direction: DVec3) -> DVec3 {
        let n = self.face.axes().0;
        let plane = self.face.plane(self.room.size_m);
        let from_m = self.frame.position_m;
        let mut p = from_m + direction * ((plane - from_m[n]) / direction[n]).abs();
        p[n] = plane;
        p.clamp(DVec3::ZERO, self.room.size_m)
    }
}

impl Points {
    /// Flux at all points.
    pub(super) fn flux(&self) -> f64 {
        self.0[self.0.len() / 3 * 2..].iter().sum()
    }

    /// Each point along u and v, and its flux.
    pub(super) fn each(&self) -> impl Iterator<Item = ([f64; 2], f64)> {
        let count = self.0.len() / 3;
        (0..count).map(move |k| ([self.0[k], self.0[count + k]], self.0[2 * count + k]))
    }

    pub(super) fn irradiance(&self, view: &View) -> f64 {
        view.irradiance(&self.0)
    }
}
