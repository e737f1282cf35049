//! Polynomials of degree 3 along both sides of the unit square, by their values at Gauss's nodes.

use glam::DVec2;

use crate::simulator::quadrature::Gauss;

/// Nodes along each side.
pub(super) const ORDER: usize = 4;
/// Nodes in all.
pub(super) const NODES: usize = ORDER * ORDER;
/// Legendre's terms of the highest degrees, whose size tells what a polynomial leaves out: those of a smooth function fall
/// from degree to degree.
const LAST_TERMS: usize = 2 * ORDER - 1;
/// Standard deviations of chance, beyond which a rectangle's last terms are its own and not its neighbours'.
const OWN: f64 = 3.0;
/// A polynomial's error where it matters most, in its root mean square over the rectangle.
const WORST: f64 = 2.0;

/// The same of one without noise, in the root mean square of its last terms: where it is most, and on the whole. Through Gauss's nodes
/// these are 4.6 and .6 for x ln x, 7.8 and 1.3 for x / sqrt(x² + .01), 7.4 and 1.2 for 1 / (1 + (x / .3)²), of a side of 1.
const EVERYWHERE: f64 = 10.0;
const BESIDE: f64 = 2.0;
/// A kink in the middle, which is even, has no terms of degree 3, leaves out a third of those of degree 2 on the whole and all of them
/// where it is.
const OF_EVEN: f64 = 1.0 / 6.0;
/// How much more a cubic may be at an end than in its root mean square.
const AT_AN_END: f64 = 4.0;

/// The nodes with what Lagrange's polynomials through them need.
#[derive(Clone, Copy, Debug)]
pub(super) struct Bicubic {
    pub(super) nodes: [f64; ORDER],
    weights: [f64; ORDER],
    /// Reciprocals of the products of the distances to the other nodes.
    scale: [f64; ORDER],
    /// Legendre's polynomials at each node, of a mean square of 1.
    legendre: [[f64; ORDER]; ORDER],
}

impl Bicubic {
    pub(super) fn new() -> Self {
        let rule = Gauss::new(ORDER);
        let [nodes, weights, scale] =
            [&rule.nodes, &rule.weights, &rule.barycentric].map(|values| std::array::from_fn(|k| values[k]));
        let legendre = nodes.map(|t| {
            let x = 2.0 * t - 1.0;
            let all = [1.0, x, 1.5 * x * x - 0.5, 2.5 * x * x * x - 1.5 * x];
            std::array::from_fn(|degree| ((2 * degree + 1) as f64).sqrt() * all[degree])
        });
        Self { nodes, weights, scale, legendre }
    }

    /// Where a node lies.
    pub(super) fn node(&self, k: usize) -> DVec2 {
        DVec2::new(self.nodes[k / ORDER], self.nodes[k % ORDER])
    }

    /// A node's part of the mean over the square.
    pub(super) fn weight(&self, k: usize) -> f64 {
        self.weights[k / ORDER] * self.weights[k % ORDER]
    }

    /// Lagrange's polynomials at a place.
    pub(super) fn lagrange(&self, t: f64) -> [f64; ORDER] {
        let [a, b, c, d] = self.nodes.map(|node| t - node);
        let (low, high) = (a * b, c * d);
        let others = [b * high, a * high, low * d, low * c];
        std::array::from_fn(|k| self.scale[k] * others[k])
    }

    /// Lagrange's polynomials of all nodes at a place.
    pub(super) fn basis(&self, t: DVec2) -> [f64; NODES] {
        let (a, b) = (self.lagrange(t.x), self.lagrange(t.y));
        std::array::from_fn(|k| a[k / ORDER] * b[k % ORDER])
    }

    /// The polynomial that comes closest to those on parts of the square, and how far off it is in its root mean square; each part with
    /// its corner and size, values at its nodes and its own error. Moments up to degree 3 stay as they are, since products of two
    /// such polynomials are summed exactly by Gauss's rule.
    pub(super) fn joined<'a>(
        &self,
        parts: impl Iterator<Item = (DVec2, DVec2, &'a [f64; NODES], f64)>,
    ) -> ([f64; NODES], f64) {
        let (mut joined, mut square) = ([0.0; NODES], 0.0);
        for (corner, size, values, error) in parts {
            let area = size.element_product();
            square += area * error * error;
            for (k, value) in values.iter().enumerate() {
                let weight = area * self.weight(k);
                square += weight * value * value;
                let basis = self.basis(corner + size * self.node(k));
                for (joined, basis) in joined.iter_mut().zip(basis) {
                    *joined += weight * value * basis;
                }
            }
        }
        for (k, joined) in joined.iter_mut().enumerate() {
            *joined /= self.weight(k);
            square -= self.weight(k) * *joined * *joined;
        }
        (joined, square.max(0.0).sqrt())
    }

    /// The value at a place by those at the nodes.
    pub(super) fn at(&self, values: &[f64; NODES], t: DVec2) -> f64 {
        let (a, b) = (self.lagrange(t.x), self.lagrange(t.y));
        let row = |i: usize| (0..ORDER).map(|j| b[j] * values[ORDER * i + j]).sum::<f64>();
        (0..ORDER).map(|i| a[i] * row(i)).sum()
    }

    /// How far off the polynomials of rectangles may be, whose `values` are those of independent solutions.
    ///
    /// The square of the last terms holds their noise, too. Where it is more than noise it is the rectangle's own; of the others
    /// the mean over all of them tells what no single one can.
    pub(super) fn tails(&self, rectangles: &[Vec<[f64; NODES]>]) -> Vec<f64> {
        let found: Vec<(f64, f64)> = rectangles.iter().map(|values| self.last_terms(values)).collect();
        let by_chance = 1.0 + OWN * (2.0 / LAST_TERMS as f64).sqrt();
        let is_own = |(square, noise): &(f64, f64)| *square > by_chance * noise;
        let others: Vec<f64> = found.iter().filter(|f| !is_own(f) && f.1 > 0.0).map(|(s, n)| s - n).collect();
        let shared = others.iter().sum::<f64>().max(0.0) / others.len().max(1) as f64;
        let error = |f: &(f64, f64)| WORST * if is_own(f) { (f.0 - f.1).max(shared) } else { shared }.sqrt();
        found.iter().map(error).collect()
    }

    /// Mean square over a rectangle of the last terms of the solutions' mean, and how much noise is in it on the mean.
    fn last_terms(&self, values: &[[f64; NODES]]) -> (f64, f64) {
        let count = values.len() as f64;
        let last = (0..NODES).map(|k| (k / ORDER, k % ORDER)).filter(|(i, j)| *i.max(j) + 1 == ORDER);
        let one = |(i, j)| {
            let terms: Vec<f64> = values.iter().map(|v| self.term(v, i, j)).collect();
            let mean = terms.iter().sum::<f64>() / count;
            (mean * mean, terms.iter().map(|t| (t - mean).powi(2)).sum::<f64>() / (count * (count - 1.0)))
        };
        last.map(one).fold((0.0, 0.0), |a, b| (a.0 + b.0, a.1 + b.1))
    }

    /// What a polynomial without noise leaves out along both sides, where it matters most.
    ///
    /// It is told by the last terms; those vanish in the middle of what is symmetric, where even ones tell it.
    pub(super) fn left_out(&self, values: &[f64; NODES]) -> DVec2 {
        let of_degree = |degree: usize, axis: usize| {
            let term = |other: usize| {
                let (i, j) = if axis == 0 { (degree, other) } else { (other, degree) };
                self.term(values, i, j).powi(2)
            };
            (0..ORDER).map(term).sum::<f64>().sqrt()
        };
        let along = |axis: usize| of_degree(3, axis).max(OF_EVEN * of_degree(2, axis));
        DVec2::new(along(0), along(1))
    }

    /// What is left of what polynomials leave out where it is weighed like this: by Schwarz's inequality the root of the sum of squares of
    /// the weights' own terms of higher degree, which go on as those of degree 3, or as from degree 0 to 2. And the same of what
    /// leaves out nothing but the mean.
    pub(super) fn left_of(&self, weights: &[f64; NODES]) -> [f64; 2] {
        let legendre = &self.legendre;
        let mut squares = [0.0; ORDER];
        let rows: [[f64; ORDER]; ORDER] = std::array::from_fn(|i| {
            std::array::from_fn(|b| (0..ORDER).map(|j| weights[ORDER * i + j] * legendre[j][b]).sum())
        });
        for a in 0..ORDER {
            for b in 0..ORDER {
                let term: f64 = (0..ORDER).map(|i| rows[i][b] * legendre[i][a]).sum();
                squares[a.max(b)] += term * term;
            }
        }
        let factor = squares[0].sqrt();
        let last = squares[3].sqrt().max(squares[2] / factor.max(f64::MIN_POSITIVE));
        [
            (BESIDE * last).min(EVERYWHERE * factor),
            (squares[1] + squares[2] + squares[3]).sqrt().min(AT_AN_END * factor),
        ]
    }

    /// Legendre's term of degree `i` and `j`, as its root mean square.
    fn term(&self, values: &[f64; NODES], i: usize, j: usize) -> f64 {
        let at = |k: usize| self.weight(k) * self.legendre[k / ORDER][i] * self.legendre[k % ORDER][j] * values[k];
        (0..NODES).map(at).sum()
    }
}

#[cfg(test)]
mod tests {
    use approx::assert_relative_eq;

    use super::*;
    use crate::simulator::sampler::{mix, unit};

    fn values(f: impl Fn(DVec2) -> f64) -> [f64; NODES] {
        let bicubic = Bicubic::new();
        std::array::from_fn(|k| f(bicubic.node(k)))
    }

    #[test]
    fn cubics_are_met_everywhere() {
        let f = |t: DVec2| 1.0 + 2.0 * t.x - t.y * t.y * t.y + 3.0 * t.x * t.x * t.x * t.y;
        for t in [DVec2::new(0.1, 0.9), DVec2::new(1.0, 0.0), DVec2::new(0.37, 0.52)] {
            assert_relative_eq!(Bicubic::new().at(&values(f), t), f(t), max_relative = 1e-13);
        }
    }

    #[test]
    fn what_is_left_out_is_told_beneath_noise_and_noise_alone_is_not() {
        let noise = |k: u64| (0..12).map(|j| unit(mix(12 * k + j + 1))).sum::<f64>() - 6.0;
        // Last terms of root mean square .05 each beside noise of 1 at every node, in 16 solutions of 400 rectangles.
        let rectangles = |cubic: f64| -> Vec<Vec<[f64; NODES]>> {
            let one = |k: u64| {
                let smooth = values(|t| {
                    let x = 2.0 * t - 1.0;
                    cubic * 7.0_f64.sqrt() * (2.5 * x.x.powi(3) - 1.5 * x.x)
                });
                std::array::from_fn(|j| smooth[j] + noise(16 * k + j as u64))
            };
            (0..400).map(|k| (0..16).map(|r| one(16 * k + r)).collect()).collect()
        };
        let mean = |found: Vec<f64>| found.iter().sum::<f64>() / found.len() as f64;
        let (with, without) =
            (mean(Bicubic::new().tails(&rectangles(0.2))), mean(Bicubic::new().tails(&rectangles(0.0))));
        assert!((0.3..0.6).contains(&with), "{with}");
        assert!(without < 0.12, "{without}");
    }
}
