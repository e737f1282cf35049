//! Gauss-Legendre rules on the unit interval and Lagrange interpolation through their nodes.
//!
//! Nodes by Newton's method on the three-term recurrence (Press et al., *Numerical Recipes*, 4.6); interpolation after
//! Berrut and Trefethen, *Barycentric Lagrange interpolation*, SIAM Review 46 (2004).

/// A Gauss-Legendre rule on 0..1 with the weights of Lagrange's polynomials through its nodes.
#[derive(Clone, Debug)]
pub struct Gauss {
    /// Nodes, rising.
    pub nodes: Vec<f64>,
    /// Weights, summing to 1.
    pub weights: Vec<f64>,
    /// Reciprocals of what the product of distances to all other nodes is at each.
    pub(crate) barycentric: Vec<f64>,
}

impl Gauss {
    /// The rule with `count` nodes, exact for polynomials up to degree `2 count - 1`.
    pub fn new(count: usize) -> Self {
        let (mut nodes, mut weights) = (vec![0.0; count], vec![0.0; count]);
        for i in 0..count {
            let mut z = (std::f64::consts::PI * (i as f64 + 0.75) / (count as f64 + 0.5)).cos();
            let mut slope = 1.0;
            for _ in 0..100 {
                let (value, derivative) = legendre(count, z);
                slope = derivative;
                let step = value / derivative;
                z -= step;
                if step.abs() < 1e-15 {
                    slope = legendre(count, z).1;
                    break;
                }
            }
            nodes[count - 1 - i] = 0.5 * (1.0 + z);
            weights[count - 1 - i] = 1.0 / ((1.0 - z * z) * slope * slope);
        }
        let weight = |i: usize| 1.0 / (0..count).filter(|j| *j != i).map(|j| nodes[i] - nodes[j]).product::<f64>();
        let barycentric = (0..count).map(weight).collect();
        Self { nodes, weights, barycentric }
    }

    /// The nodes, rising, each with its weight.
    pub fn points(&self) -> impl Iterator<Item = (f64, f64)> + Clone {
        self.nodes.iter().copied().zip(self.weights.iter().copied())
    }

    /// The values at `t` of the Lagrange polynomials through the nodes, as products: no division, no node to step around.
    pub(crate) fn lagrange(&self, t: f64, out: &mut [f64]) {
        let mut below = 1.0;
        for ((value, x), w) in out.iter_mut().zip(&self.nodes).zip(&self.barycentric) {
            *value = w * below;
            below *= t - x;
        }
        let mut above = 1.0;
        for (value, x) in out.iter_mut().zip(&self.nodes).rev() {
            *value *= above;
            above *= t - x;
        }
    }
}

/// The Legendre polynomial of degree `n` at `z` and its derivative.
fn legendre(n: usize, z: f64) -> (f64, f64) {
    let (mut p, mut before) = (1.0, 0.0);
    for j in 0..n {
        let older = before;
        before = p;
        p = ((2 * j + 1) as f64 * z * before - j as f64 * older) / (j + 1) as f64;
    }
    (p, n as f64 * (z * p - before) / (z * z - 1.0))
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    #[test]
    fn a_rule_of_n_nodes_integrates_degree_2n_minus_1_exactly() {
        for n in [1, 2, 5, 8, 16, 24] {
            let rule = Gauss::new(n);
            let degree = 2 * i32::try_from(n).unwrap() - 1;
            let sum: f64 = rule.nodes.iter().zip(&rule.weights).map(|(x, w)| w * x.powi(degree)).sum();
            assert_relative_eq!(sum, 1.0 / f64::from(degree + 1), max_relative = 1e-13);
        }
    }

    #[test]
    fn interpolation_reproduces_polynomials_through_the_nodes() {
        let rule = Gauss::new(6);
        let mut l = [0.0; 6];
        rule.lagrange(0.37, &mut l);
        let value: f64 = l.iter().zip(&rule.nodes).map(|(l, x)| l * x.powi(5)).sum();
        assert_relative_eq!(value, 0.37_f64.powi(5), max_relative = 1e-13);
    }
}
