//! GMRES for second-kind equations u = g + K u, whose operator is compact: a dozen steps, even with reflectances near 1.
//!
//! Saad and Schultz, *GMRES: a generalized minimal residual algorithm*, SIAM J. Sci. Stat. Comput. 7 (1986). A Neumann
//! series needs log(tolerance) / log(reflectance) steps instead and never ends at .999999.

#![expect(clippy::inline_always, reason = "compiled for what the processor has")]

use pulp::{Arch, Simd, WithSimd};

/// Steps after which the basis is thrown away and the iteration starts again from where it stands.
const STEPS: usize = 48;
/// Restarts after which the residual has reached what rounding allows.
const RESTARTS: usize = 4;

/// Solves u - `operator`(u) = `known`, from a first guess of u, to a residual of `tolerance` relative to `known`.
pub(crate) fn solve(operator: impl Fn(&[f64]) -> Vec<f64>, known: &[f64], mut u: Vec<f64>, tolerance: f64) -> Vec<f64> {
    let target = tolerance * norm(known);
    for _ in 0..RESTARTS {
        let image = operator(&u);
        let residual: Vec<f64> = known.iter().zip(&u).zip(&image).map(|((g, u), k)| g - (u - k)).collect();
        if norm(&residual) <= target {
            break;
        }
        let correction = cycle(&operator, residual, target);
        for (u, c) in u.iter_mut().zip(&correction) {
            *u += c;
        }
    }
    u
}

/// One unrestarted run: the correction that minimises the residual over the Krylov space.
fn cycle(operator: &impl Fn(&[f64]) -> Vec<f64>, residual: Vec<f64>, target: f64) -> Vec<f64> {
    let beta = norm(&residual);
    let mut basis = vec![scaled(residual, 1.0 / beta)];
    let mut columns: Vec<Vec<f64>> = vec![];
    let mut rotations: Vec<(f64, f64)> = vec![];
    let mut right = vec![beta];
    for step in 0..STEPS {
        let image = operator(&basis[step]);
        let mut next: Vec<f64> = basis[step].iter().zip(&image).map(|(v, k)| v - k).collect();
        let mut column = vec![];
        for v in &basis {
            let h = dot(v, &next);
            for (n, v) in next.iter_mut().zip(v) {
                *n -= h * v;
            }
            column.push(h);
        }
        let length = norm(&next);
        for (k, (c, s)) in rotations.iter().enumerate() {
            let (a, b) = (column[k], column[k + 1]);
            (column[k], column[k + 1]) = (c * a + s * b, c * b - s * a);
        }
        let radius = column[step].hypot(length);
        if radius == 0.0 {
            break;
        }
        let (c, s) = (column[step] / radius, length / radius);
        column[step] = radius;
        rotations.push((c, s));
        let last = right[step];
        right[step] = c * last;
        right.push(-s * last);
        columns.push(column);
        if (s * last).abs() <= target || length <= 1e-15 * radius {
            break;
        }
        basis.push(scaled(next, 1.0 / length));
    }
    combine(&basis, &columns, &right)
}

/// Back substitution, then the combination of the basis.
fn combine(basis: &[Vec<f64>], columns: &[Vec<f64>], right: &[f64]) -> Vec<f64> {
    let mut y = vec![0.0; columns.len()];
    for k in (0..columns.len()).rev() {
        let known: f64 = (k + 1..columns.len()).map(|j| columns[j][k] * y[j]).sum();
        y[k] = (right[k] - known) / columns[k][k];
    }
    let mut sum = vec![0.0; basis[0].len()];
    for (y, v) in y.iter().zip(basis) {
        for (s, v) in sum.iter_mut().zip(v) {
            *s += y * v;
        }
    }
    sum
}

fn scaled(mut v: Vec<f64>, factor: f64) -> Vec<f64> {
    for x in &mut v {
        *x *= factor;
    }
    v
}

fn norm(v: &[f64]) -> f64 {
    dot(v, v).sqrt()
}

/// A dot product in eight lanes, whose order of summation never depends on the machine or on its load.
pub(crate) fn dot(a: &[f64], b: &[f64]) -> f64 {
    Arch::new().dispatch(Dot(a, b))
}

struct Dot<'a>(&'a [f64], &'a [f64]);

impl WithSimd for Dot<'_> {
    type Output = f64;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> f64 {
        let ((a, rest_a), (b, rest_b)) = (self.0.as_chunks::<8>(), self.1.as_chunks::<8>());
        let mut lanes = [0.0; 8];
        for (x, y) in a.iter().zip(b) {
            for k in 0..8 {
                lanes[k] += x[k] * y[k];
            }
        }
        let tail: f64 = rest_a.iter().zip(rest_b).map(|(x, y)| x * y).sum();
        lanes.iter().sum::<f64>() + tail
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    #[test]
    fn two_facing_planes_balance_even_at_reflectance_almost_one() {
        for rho in [0.5, 0.999, 1.0 - 1e-9] {
            let u = solve(|v| vec![rho * v[1], rho * v[0]], &[1.0, 0.0], vec![1.0, 0.0], 1e-15);
            assert_relative_eq!(u[0], 1.0 / (1.0 - rho * rho), max_relative = 1e-6);
            assert_relative_eq!(u[1], rho * u[0], max_relative = 1e-12);
        }
    }
}
