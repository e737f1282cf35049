//! The collocation grid: tensor-product elements on the six surfaces of a room, graded towards the edges.
//!
//! Irradiance in a box behaves like powers of the distance to the edges, so the outermost elements of each axis map
//! their parameter s by x = s² and the unknowns are polynomials in s: in x, convergence stalls at 3e-5.

use glam::DVec3;

use super::Effort;
use crate::quadrature::Gauss;

/// Dyadic intervals whose interpolation matrices are kept.
const KEPT_INTERVALS: usize = 128;

/// What the element at an edge has of the two that were one before.
///
/// Light has its singularities at the edges: there, a smaller element brings more than halves do.
const SHARE: f64 = 0.4;

/// As many nodes or points along an element as any effort asks for.
pub(super) const MOST: usize = 12;

/// A surface of the room, numbered by axis and end: `2 * axis + 1` lies at the far end.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Face(pub(super) usize);

impl Face {
    pub(super) const ALL: [Self; 6] = [Self(0), Self(1), Self(2), Self(3), Self(4), Self(5)];

    /// The axes normal to the face, along u and along v.
    pub(super) const fn axes(self) -> (usize, usize, usize) {
        let normal = self.0 / 2;
        (normal, (normal + 1) % 3, (normal + 2) % 3)
    }

    /// The coordinate of the face along its normal.
    pub(super) fn plane(self, size_m: DVec3) -> f64 {
        if self.0 % 2 == 1 { size_m[self.0 / 2] } else { 0.0 }
    }

    /// +1 where the inward normal points along its axis, -1 where against it.
    pub(super) const fn sign(self) -> f64 {
        if self.0 % 2 == 1 { -1.0 } else { 1.0 }
    }

    /// The unit normal that points into the room.
    pub(super) fn inward_normal(self) -> DVec3 {
        DVec3::AXES[self.0 / 2] * self.sign()
    }
}

/// The elements along one axis.
#[derive(Clone, Debug)]
pub(super) struct Axis {
    pub(super) elements: Vec<Element>,
    /// Node coordinates in metres, element by element, rising.
    pub(super) nodes_m: Vec<f64>,
    /// Quadrature weights of the nodes in metres.
    pub(super) weights_m: Vec<f64>,
}

/// An interval along an axis.
#[derive(Clone, Copy, Debug)]
pub(super) struct Element {
    pub(super) start_m: f64,
    pub(super) end_m: f64,
    grading: Grading,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Grading {
    TowardsStart,
    TowardsEnd,
    Even,
}

impl Element {
    /// Coordinate at parameter `s` in 0..=1, and its derivative.
    pub(super) fn at(&self, s: f64) -> (f64, f64) {
        let h = self.end_m - self.start_m;
        match self.grading {
            Grading::TowardsStart => (self.start_m + h * s * s, 2.0 * h * s),
            Grading::TowardsEnd => {
                let t = 1.0 - s;
                (self.end_m - h * t * t, 2.0 * h * t)
            }
            Grading::Even => (self.start_m + h * s, h),
        }
    }

    /// The parameter at a coordinate.
    pub(super) fn parameter(&self, x_m: f64) -> f64 {
        let h = self.end_m - self.start_m;
        let s = match self.grading {
            Grading::TowardsStart => ((x_m - self.start_m) / h).max(0.0).sqrt(),
            Grading::TowardsEnd => 1.0 - ((self.end_m - x_m) / h).max(0.0).sqrt(),
            Grading::Even => (x_m - self.start_m) / h,
        };
        s.clamp(0.0, 1.0)
    }
}

/// All nodes of the room, numbered face by face, u major.
#[derive(Clone, Debug)]
pub(super) struct Grid {
    pub(super) size_m: DVec3,
    /// Nodes in an element along one axis.
    pub(super) order: usize,
    pub(super) axes: [Axis; 3],
    /// First node of each face, and the count of all.
    pub(super) offsets: [usize; 7],
    /// The rule of near elements.
    pub(super) near: Gauss,
    nodal: Gauss,
    /// `[interval][point][node]` for intervals numbered as a heap.
    kept: Vec<Vec<f64>>,
}

impl Grid {
    pub(super) fn new(size_m: DVec3, effort: &Effort) -> Self {
        let nodal = Gauss::new(effort.order);
        let axes = [0, 1, 2].map(|k| Axis::new(size_m[k], halves(size_m, k), effort.at_edge, &nodal));
        let mut offsets = [0; 7];
        for face in Face::ALL {
            let (_, u, v) = face.axes();
            offsets[face.0 + 1] = offsets[face.0] + axes[u].nodes_m.len() * axes[v].nodes_m.len();
        }
        let near = Gauss::new(effort.near_points);
        let mut grid = Self { size_m, order: effort.order, axes, offsets, near, nodal, kept: vec![] };
        grid.kept = (0..KEPT_INTERVALS)
            .map(|i| {
                let (start, length) = dyadic(i.max(1));
                let mut matrix = vec![];
                grid.interpolation(start, length, &mut matrix);
                matrix
            })
            .collect();
        grid
    }

    /// How many nodes a grid would have.
    pub(super) fn count(size_m: DVec3, effort: &Effort) -> usize {
        let nodes = |k| effort.order * elements(halves(size_m, k), effort.at_edge);
        2 * (nodes(0) * nodes(1) + nodes(1) * nodes(2) + nodes(2) * nodes(0))
    }

    /// How many nodes there are.
    pub(super) fn len(&self) -> usize {
        self.offsets[6]
    }

    /// Nodes along u and v of a face.
    pub(super) fn counts(&self, face: Face) -> (usize, usize) {
        let (_, u, v) = face.axes();
        (self.axes[u].nodes_m.len(), self.axes[v].nodes_m.len())
    }

    /// The face of a node and its place along u and v.
    pub(super) fn place(&self, node: usize) -> (Face, usize, usize) {
        let face = Face((1..6).rev().find(|f| self.offsets[*f] <= node).unwrap_or(0));
        let (_, count_v) = self.counts(face);
        let k = node - self.offsets[face.0];
        (face, k / count_v, k % count_v)
    }

    /// The position of a node and the area that it stands for.
    pub(super) fn node(&self, node: usize) -> (DVec3, f64) {
        let (face, i, j) = self.place(node);
        let (n, u, v) = face.axes();
        let mut x = DVec3::ZERO;
        x[n] = face.plane(self.size_m);
        x[u] = self.axes[u].nodes_m[i];
        x[v] = self.axes[v].nodes_m[j];
        (x, self.axes[u].weights_m[i] * self.axes[v].weights_m[j])
    }

    /// Shares flux at a point of a face out among the nodes of the element there, as their polynomials weigh it.
    pub(super) fn deposit(&self, face: Face, point_m: [f64; 2], flux: f64, at_nodes: &mut [f64]) {
        let (_, u, v) = face.axes();
        let mut values = [[0.0; MOST]; 2];
        let [first_u, first_v] = [0, 1].map(|k| {
            let axis = [u, v][k];
            let number = self.axes[axis].element_at(point_m[k]);
            let s = self.axes[axis].elements[number].parameter(point_m[k]);
            self.basis(s, &mut values[k][..self.order]);
            number * self.order
        });
        let count_v = self.counts(face).1;
        for (i, along_u) in values[0][..self.order].iter().enumerate() {
            let start = self.offsets[face.0] + (first_u + i) * count_v + first_v;
            for (node, along_v) in at_nodes[start..start + self.order].iter_mut().zip(&values[1]) {
                *node += flux * along_u * along_v;
            }
        }
    }

    /// The longer side of a part of a face against the element in its middle, and whether it lies within that.
    pub(super) fn extent(&self, face: Face, centre_m: DVec3, half_m: DVec3) -> (f64, bool) {
        let (_, u, v) = face.axes();
        let sides = [u, v].map(|axis| {
            let (low, high) = (centre_m[axis] - half_m[axis], centre_m[axis] + half_m[axis]);
            let Element { start_m, end_m, .. } = self.axes[axis].elements[self.axes[axis].element_at(centre_m[axis])];
            // Boxes round patches are a little too large.
            let margin = 0.05 * (high - low);
            ((high - low) / (end_m - start_m), low >= start_m - margin && high <= end_m + margin)
        });
        (sides[0].0.max(sides[1].0), sides[0].1 && sides[1].1)
    }

    /// The interpolation matrix `[point][node]` of a dyadic interval, if it is kept.
    pub(super) fn cached(&self, interval: usize) -> Option<&[f64]> {
        self.kept.get(interval).map(Vec::as_slice)
    }

    /// Values `[point][node]` of the nodal polynomials at the near rule's points within an interval of s.
    pub(super) fn interpolation(&self, start: f64, length: f64, matrix: &mut Vec<f64>) {
        matrix.clear();
        matrix.resize(self.order * self.near.nodes.len(), 0.0);
        for (x, values) in self.near.nodes.iter().zip(matrix.chunks_exact_mut(self.order)) {
            self.nodal.lagrange(start + length * x, values);
        }
    }

    /// The nodal polynomials at one parameter.
    pub(super) fn basis(&self, s: f64, out: &mut [f64]) {
        self.nodal.lagrange(s, out);
    }
}

impl Axis {
    /// Nodes of an element and their weights, in metres.
    pub(super) fn of(&self, element: usize) -> (&[f64], &[f64]) {
        let order = self.nodes_m.len() / self.elements.len();
        let own = element * order..(element + 1) * order;
        (&self.nodes_m[own.clone()], &self.weights_m[own])
    }

    /// The element at a coordinate.
    fn element_at(&self, x_m: f64) -> usize {
        self.elements.partition_point(|e| e.end_m < x_m).min(self.elements.len() - 1)
    }

    fn new(length_m: f64, halves: usize, at_edge: usize, nodal: &Gauss) -> Self {
        let count = elements(halves, at_edge);
        let boundary = |k: usize| {
            let from_edge = k.min(count - k);
            let steps = match (from_edge + 1).checked_sub(at_edge) {
                _ if from_edge == 0 => 0.0,
                Some(whole @ 1..) => whole as f64,
                _ => SHARE.powi((at_edge - from_edge) as i32),
            };
            let from_edge_m = 0.5 * length_m * steps / halves as f64;
            if 2 * k > count { length_m - from_edge_m } else { from_edge_m }
        };
        let elements: Vec<_> = (0..count)
            .map(|k| {
                let grading = match k {
                    0 => Grading::TowardsStart,
                    _ if k + 1 == count => Grading::TowardsEnd,
                    _ => Grading::Even,
                };
                Element { start_m: boundary(k), end_m: boundary(k + 1), grading }
            })
            .collect();
        let points = |e: &Element| nodal.nodes.iter().map(|s| e.at(*s)).collect::<Vec<_>>();
        let nodes_m = elements.iter().flat_map(|e| points(e).into_iter().map(|(x, _)| x)).collect();
        let weights_m = elements
            .iter()
            .flat_map(|e| points(e).into_iter().zip(&nodal.weights).map(|((_, dx), w)| dx * w).collect::<Vec<_>>())
            .collect();
        Self { elements, nodes_m, weights_m }
    }
}

/// Elements along half an axis before those at the edge are divided: about as long as the shortest side, or half of it.
fn halves(size_m: DVec3, axis: usize) -> usize {
    (size_m[axis] / (2.0 * size_m.min_element())).round().clamp(1.0, 6.0) as usize
}

/// How many elements an axis has, evenly many, so that the grid has mirrors.
fn elements(halves: usize, at_edge: usize) -> usize {
    2 * (halves + at_edge - 1)
}

/// Start and length of a dyadic interval of 0..1 by its number in a heap that begins with 1.
pub(super) fn dyadic(interval: usize) -> (f64, f64) {
    let depth = interval.ilog2();
    let length = 1.0 / (1_usize << depth) as f64;
    ((interval - (1 << depth)) as f64 * length, length)
}
