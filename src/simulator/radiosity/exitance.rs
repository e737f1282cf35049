//! Exitance that varies across a patch: quartered where shadows and steep light need it, each part projected on biquadratics.
//!
//! The nine values of a part are its projection at the nodes of the three-point Gauss rule squared, so that the rule
//! integrates them against anything biquadratic exactly, however rough the exitance is further down.

/// Nodes and weights of the three-point Gauss rule on -1..1.
pub(super) const RULE: [(f64, f64); 3] =
    [(-0.774_596_669_241_483_4, 5.0 / 18.0), (0.0, 8.0 / 18.0), (0.774_596_669_241_483_4, 5.0 / 18.0)];

/// Quarterings at most.
const DEEPEST: u32 = 4;

/// Values at the nodes of the rule squared, second side fastest.
pub(super) type Nine = [f64; 9];

/// The exitance of a part of a patch.
#[derive(Clone, Debug)]
pub(super) struct Exitance {
    nine: Nine,
    /// By quarter: low a low b, high a low b, high a high b, low a high b.
    quarters: Option<Box<[Exitance; 4]>>,
}

/// The centres of the quarters of -1..=1 squared, in their order.
pub(super) const QUARTERS: [(f64, f64); 4] = [(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)];

impl Exitance {
    /// Projects `sample`, which gives the nine values of a square part by its centre and half side.
    pub(super) fn project(sample: &impl Fn(f64, f64, f64) -> Nine, tolerance: f64) -> Self {
        Self::refine(sample(0.0, 0.0, 1.0), (0.0, 0.0, 1.0), sample, tolerance, 0)
    }

    fn refine(
        nine: Nine,
        (a, b, half): (f64, f64, f64),
        sample: &impl Fn(f64, f64, f64) -> Nine,
        tolerance: f64,
        depth: u32,
    ) -> Self {
        let parts = QUARTERS.map(|(da, db)| (a + da * half, b + db * half, 0.5 * half));
        let values = parts.map(|(a, b, half)| sample(a, b, half));
        let better = gather([&values[0], &values[1], &values[2], &values[3]]);
        let worst = nine.iter().zip(&better).map(|(x, y)| (x - y).abs()).fold(0.0, f64::max);
        // A smaller part may err more: it counts for less.
        if worst * half <= tolerance || depth == DEEPEST {
            return Self { nine: better, quarters: None };
        }
        let quarters: [Self; 4] =
            std::array::from_fn(|k| Self::refine(values[k], parts[k], sample, tolerance, depth + 1));
        let nine = gather([&quarters[0].nine, &quarters[1].nine, &quarters[2].nine, &quarters[3].nine]);
        Self { nine, quarters: Some(Box::new(quarters)) }
    }

    /// The value at a node of the rule.
    pub(super) fn at_node(&self, node: usize) -> f64 {
        self.nine[node]
    }

    /// The value at coordinates within -1..=1.
    pub(super) fn at(&self, a: f64, b: f64) -> f64 {
        let (u, v) = (basis(a), basis(b));
        (0..3).map(|i| u[i] * (0..3).map(|j| v[j] * self.nine[3 * i + j]).sum::<f64>()).sum()
    }

    pub(super) fn quarters(&self) -> Option<&[Self; 4]> {
        self.quarters.as_deref()
    }
}

/// The projection of four quarters.
fn gather(quarters: [&Nine; 4]) -> Nine {
    let mut sums = [0.0; 9];
    for (nine, (da, db)) in quarters.into_iter().zip(QUARTERS) {
        for (i, (x, wx)) in RULE.into_iter().enumerate() {
            for (j, (y, wy)) in RULE.into_iter().enumerate() {
                let (u, v) = (basis(da + 0.5 * x), basis(db + 0.5 * y));
                let share = 0.25 * wx * wy * nine[3 * i + j];
                for (k, sum) in sums.iter_mut().enumerate() {
                    *sum += share * u[k / 3] * v[k % 3];
                }
            }
        }
    }
    std::array::from_fn(|k| sums[k] / (RULE[k / 3].1 * RULE[k % 3].1))
}

/// The parabolas through the three nodes.
pub(super) fn basis(x: f64) -> [f64; 3] {
    let s = x / RULE[2].0;
    [0.5 * s * (s - 1.0), 1.0 - s * s, 0.5 * s * (s + 1.0)]
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    #[test]
    fn a_step_keeps_its_integral_and_a_parabola_every_value() {
        let nodes = |a: f64, b: f64, h: f64, f: &dyn Fn(f64, f64) -> f64| -> Nine {
            std::array::from_fn(|k| f(a + h * RULE[k / 3].0, b + h * RULE[k % 3].0))
        };
        let parabola = |a: f64, b: f64| 1.0 + a - 2.0 * b * b + 0.3 * a * a * b;
        let smooth = Exitance::project(&|a, b, h| nodes(a, b, h, &parabola), 1e-9);
        assert!(smooth.quarters().is_none());
        assert_relative_eq!(smooth.at(0.3, -0.8), parabola(0.3, -0.8), epsilon = 1e-14);
        let step = |a: f64, b: f64| f64::from(a + 0.4 * b > 0.1);
        let rough = Exitance::project(&|a, b, h| nodes(a, b, h, &step), 1e-4);
        let mean: f64 = (0..9).map(|k| RULE[k / 3].1 * RULE[k % 3].1 * rough.at_node(k)).sum();
        assert_relative_eq!(mean, 0.45, epsilon = 5e-3);
    }
}
