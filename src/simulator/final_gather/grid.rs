//! Where reflected light is known on the walls: polynomials on rectangles that are narrow along the room's edges, where
//! it changes like x ln x.

use glam::{DVec2, DVec3};

use super::surroundings::{Surroundings, WALLS, off_wall, on_wall};
use crate::geometry::Room;
use crate::simulator::quadrature::Gauss;

/// Nodes of a rectangle along each side.
pub(super) const ORDER: usize = 4;
/// Nodes of a rectangle.
pub(super) const NODES: usize = ORDER * ORDER;
/// Width of the strips along a room's edges, of the shorter side of a wall.
const STRIP: f64 = 1.0 / 16.0;
/// Sides of rectangles between the strips at most, of the room's mean wall.
const SIDE: f64 = 0.3;
/// Cuts that bodies on a wall add at most; beyond, rectangles stay partly covered.
const MOST_CUTS: usize = 10;
/// Cuts closer than this to another, of the wall, are left out.
const APART: f64 = 0.02;

/// The rectangles of all walls.
#[derive(Debug)]
pub(super) struct Grid {
    room: Room,
    cuts: Vec<[Vec<f64>; 2]>,
    /// Number of the first rectangle of each wall.
    first: Vec<usize>,
    pub(super) rule: Gauss,
    /// Bodies that stand on each wall, as rectangles.
    covers: Vec<Vec<[DVec2; 2]>>,
}

/// A place in a rectangle.
#[derive(Clone, Copy, Debug)]
pub(super) struct Spot {
    pub(super) rectangle: u32,
    /// In 0..1 along both sides.
    pub(super) t: [f32; 2],
}

impl Grid {
    pub(super) fn new(room: Room, surroundings: &Surroundings) -> Self {
        let s = room.size_m;
        let side = SIDE * ((s.x * s.y + s.y * s.z + s.z * s.x) / 3.0).sqrt();
        let covers: Vec<Vec<[DVec2; 2]>> = (0..WALLS.len())
            .map(|wall| {
                let (axis, far) = (wall / 2, wall % 2 == 1);
                let plane = if far { s[axis] } else { 0.0 };
                let touches = |b: &&[DVec3; 2]| if far { b[1][axis] >= plane } else { b[0][axis] <= plane };
                surroundings.bodies().filter(touches).map(|b| b.map(|p| on_wall(wall, p))).collect()
            })
            .collect();
        let cut = |wall: usize, k: usize| {
            let length = on_wall(wall, s)[k];
            let strip = STRIP * on_wall(wall, s).min_element();
            let inner = ((length - 2.0 * strip) / side).ceil().max(1.0);
            let mut cuts = vec![0.0];
            cuts.extend((0..=inner as usize).map(|j| strip + (length - 2.0 * strip) * j as f64 / inner));
            cuts.push(length);
            let before = cuts.len();
            for edge in covers[wall].iter().flatten().map(|p| p[k]) {
                let is_apart = cuts.iter().all(|c| (c - edge).abs() > APART * length);
                if edge > 0.0 && edge < length && is_apart && cuts.len() < before + MOST_CUTS {
                    cuts.push(edge);
                }
            }
            cuts.sort_by(f64::total_cmp);
            cuts
        };
        let cuts: Vec<[Vec<f64>; 2]> = (0..WALLS.len()).map(|wall| [cut(wall, 0), cut(wall, 1)]).collect();
        let mut first = vec![0];
        for [a, b] in &cuts {
            first.push(first[first.len() - 1] + (a.len() - 1) * (b.len() - 1));
        }
        Self { room, cuts, first, rule: Gauss::new(ORDER), covers }
    }

    /// Rectangles of all walls.
    pub(super) fn len(&self) -> usize {
        self.first[WALLS.len()]
    }

    /// The place in its rectangle of a point on a wall.
    pub(super) fn spot(&self, wall: usize, point_m: DVec3) -> Spot {
        let at_m = on_wall(wall, point_m);
        let place = |k: usize| {
            let cuts = &self.cuts[wall][k];
            let j = cuts.partition_point(|c| *c <= at_m[k]).clamp(1, cuts.len() - 1) - 1;
            (j, ((at_m[k] - cuts[j]) / (cuts[j + 1] - cuts[j])) as f32)
        };
        let ((i, u), (j, v)) = (place(0), place(1));
        let rectangle = self.first[wall] + i * (self.cuts[wall][1].len() - 1) + j;
        Spot { rectangle: rectangle as u32, t: [u, v] }
    }

    /// Wall, corner and size of a rectangle.
    fn rectangle(&self, index: usize) -> (usize, DVec2, DVec2) {
        let wall = self.first.partition_point(|f| *f <= index) - 1;
        let across = self.cuts[wall][1].len() - 1;
        let (i, j) = ((index - self.first[wall]) / across, (index - self.first[wall]) % across);
        let [a, b] = &self.cuts[wall];
        let corner = DVec2::new(a[i], b[j]);
        (wall, corner, DVec2::new(a[i + 1], b[j + 1]) - corner)
    }

    /// Longer side of a rectangle.
    pub(super) fn side_m(&self, index: usize) -> f64 {
        self.rectangle(index).2.max_element()
    }

    /// The nodes of a rectangle, each with its wall.
    pub(super) fn nodes(&self, index: usize) -> [(DVec3, usize); NODES] {
        let (wall, corner, size) = self.rectangle(index);
        let n = &self.rule.nodes;
        std::array::from_fn(|k| {
            let t = DVec2::new(n[k / ORDER], n[k % ORDER]);
            (off_wall(&self.room, wall, corner + t * size), wall)
        })
    }

    /// How much of a rectangle bodies cover: nothing, something, or all of it.
    pub(super) fn cover(&self, index: usize) -> Cover {
        let (wall, low, size) = self.rectangle(index);
        let slack = 1e-9 * size;
        let (low, high) = (low + slack, low + size - slack);
        let over = |c: &&[DVec2; 2]| c[0].cmplt(high).all() && c[1].cmpgt(low).all();
        let all = |c: &[DVec2; 2]| c[0].cmple(low).all() && c[1].cmpge(high).all();
        if self.covers[wall].iter().any(all) {
            Cover::Whole
        } else if self.covers[wall].iter().any(|c| over(&c)) {
            Cover::Part
        } else {
            Cover::None
        }
    }
}

/// How much of a rectangle bodies cover.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Cover {
    None,
    Part,
    Whole,
}

/// A polynomial by its values at the nodes.
pub(super) fn polynomial(rule: &Gauss, values: &[f64], t: DVec2) -> f64 {
    let (mut a, mut b) = ([0.0; ORDER], [0.0; ORDER]);
    rule.lagrange(t.x, &mut a);
    rule.lagrange(t.y, &mut b);
    let row = |i: usize| (0..ORDER).map(|j| b[j] * values[ORDER * i + j]).sum::<f64>();
    (0..ORDER).map(|i| a[i] * row(i)).sum()
}

/// What a polynomial of a rectangle may leave out: its terms of the highest degree, beyond their own noise.
///
/// `values` are those of independent solutions; Legendre's terms of a smooth function fall from degree to degree.
pub(super) fn tail(rule: &Gauss, values: &[[f64; NODES]]) -> f64 {
    let count = values.len() as f64;
    let mut sum = 0.0;
    for i in 0..ORDER {
        for j in 0..ORDER {
            if i + 1 < ORDER && j + 1 < ORDER {
                continue;
            }
            let terms: Vec<f64> = values.iter().map(|v| term(rule, v, i, j)).collect();
            let mean = terms.iter().sum::<f64>() / count;
            let noise = terms.iter().map(|t| (t - mean).powi(2)).sum::<f64>() / (count * (count - 1.0));
            sum += (mean * mean - 2.0 * noise).max(0.0).sqrt();
        }
    }
    sum
}

/// The coefficient of Legendre's polynomials of degree `i` and `j`, on 0..1.
fn term(rule: &Gauss, values: &[f64; NODES], i: usize, j: usize) -> f64 {
    let legendre = |degree: usize, t: f64| {
        let x = 2.0 * t - 1.0;
        [1.0, x, 1.5 * x * x - 0.5, 2.5 * x * x * x - 1.5 * x][degree]
    };
    let norm = ((2 * i + 1) * (2 * j + 1)) as f64;
    let at = |k: usize| {
        let (a, b) = (k / ORDER, k % ORDER);
        rule.weights[a] * rule.weights[b] * legendre(i, rule.nodes[a]) * legendre(j, rule.nodes[b]) * values[k]
    };
    norm * (0..NODES).map(at).sum::<f64>()
}
