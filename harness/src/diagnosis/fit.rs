//! Least squares of a few parameters: Levenberg's and Marquardt's steps, with differences for derivatives.

use super::fault::Parameter;

/// Steps of a fit at most.
const STEPS: usize = 10;
/// Tries of a step, each ten times shorter or so.
const TRIES: usize = 5;
/// A step that lessens chi-squared by less, or by less than this share of it, is the last.
const ENOUGH: f64 = 1e-2;

#[derive(Clone, Debug, PartialEq)]
pub(super) struct Fitted {
    /// Each with its standard error.
    pub(super) parameters: Vec<(f64, f64)>,
    pub(super) chi_squared: f64,
}

impl Fitted {
    pub(super) fn values(&self) -> Vec<f64> {
        self.parameters.iter().map(|(value, _)| *value).collect()
    }
}

/// The parameters near `start` with the least sum of squared residuals; nothing where there are no residuals, or
/// where they leave a parameter open.
pub(super) fn fit(
    parameters: &[Parameter],
    start: &[f64],
    residuals: &mut dyn FnMut(&[f64]) -> Option<Vec<f64>>,
) -> Option<Fitted> {
    let mut at = start.to_vec();
    let mut left = residuals(&at)?;
    let (mut damping, mut slopes) = (1e-3, slopes_at(parameters, &at, &left, residuals)?);
    for _ in 0..STEPS {
        let before = sum_of_squares(&left);
        let mut is_better = false;
        for _ in 0..TRIES {
            let Some(step) = step(&slopes, &left, damping) else { break };
            let moved = |k: usize| (at[k] + step[k]).clamp(parameters[k].range.0, parameters[k].range.1);
            let tried: Vec<f64> = (0..at.len()).map(moved).collect();
            match residuals(&tried).filter(|found| sum_of_squares(found) < before) {
                Some(found) => {
                    (at, left, is_better) = (tried, found, true);
                    damping *= 0.1;
                    break;
                }
                None => damping = 10.0 * damping.max(1e-3),
            }
        }
        let gained = before - sum_of_squares(&left);
        if !is_better || gained < ENOUGH.max(ENOUGH * before) {
            break;
        }
        slopes = slopes_at(parameters, &at, &left, residuals)?;
    }
    let errors = errors(&slopes)?;
    Some(Fitted { chi_squared: sum_of_squares(&left), parameters: at.into_iter().zip(errors).collect() })
}

pub(super) fn sum_of_squares(values: &[f64]) -> f64 {
    values.iter().map(|v| v * v).sum()
}

/// Derivatives of the residuals, one list a parameter.
fn slopes_at(
    parameters: &[Parameter],
    at: &[f64],
    left: &[f64],
    residuals: &mut dyn FnMut(&[f64]) -> Option<Vec<f64>>,
) -> Option<Vec<Vec<f64>>> {
    let mut slope = |k: usize| {
        let mut one_sided = |step: f64| {
            let mut beside = at.to_vec();
            beside[k] += step;
            let inside = (parameters[k].range.0..=parameters[k].range.1).contains(&beside[k]);
            let found = residuals(&beside).filter(|found| inside && found.len() == left.len())?;
            Some(found.iter().zip(left).map(|(a, b)| (a - b) / step).collect::<Vec<f64>>())
        };
        one_sided(parameters[k].step).or_else(|| one_sided(-parameters[k].step))
    };
    (0..at.len()).map(&mut slope).collect()
}

/// The normal equations with a damped diagonal.
fn step(slopes: &[Vec<f64>], left: &[f64], damping: f64) -> Option<Vec<f64>> {
    let mut matrix = normal_matrix(slopes);
    for (k, row) in matrix.iter_mut().enumerate() {
        row[k] *= 1.0 + damping;
    }
    let towards = slopes.iter().map(|slope| -slope.iter().zip(left).map(|(s, r)| s * r).sum::<f64>()).collect();
    solved(matrix, towards)
}

fn normal_matrix(slopes: &[Vec<f64>]) -> Vec<Vec<f64>> {
    let product = |a: &Vec<f64>, b: &Vec<f64>| a.iter().zip(b).map(|(x, y)| x * y).sum::<f64>();
    slopes.iter().map(|a| slopes.iter().map(|b| product(a, b)).collect()).collect()
}

/// Standard errors of parameters: roots of the diagonal of the inverse.
fn errors(slopes: &[Vec<f64>]) -> Option<Vec<f64>> {
    let unit = |k: usize| (0..slopes.len()).map(|i| if i == k { 1.0 } else { 0.0 }).collect();
    let error = |k: usize| solved(normal_matrix(slopes), unit(k)).map(|column| column[k].max(0.0).sqrt());
    (0..slopes.len()).map(error).collect()
}

/// Gauss's elimination with pivots; nothing where equations say the same or nothing.
fn solved(mut matrix: Vec<Vec<f64>>, mut right: Vec<f64>) -> Option<Vec<f64>> {
    let count = right.len();
    let scale: Vec<f64> = (0..count).map(|k| matrix[k][k]).collect();
    for k in 0..count {
        let pivot = (k..count).max_by(|a, b| matrix[*a][k].abs().total_cmp(&matrix[*b][k].abs()))?;
        matrix.swap(k, pivot);
        right.swap(k, pivot);
        let is_sound = matrix[k][k].abs() > 1e-10 * scale[k];
        if !is_sound {
            return None;
        }
        for below in k + 1..count {
            let share = matrix[below][k] / matrix[k][k];
            let above = matrix[k].clone();
            matrix[below].iter_mut().zip(&above).for_each(|(b, a)| *b -= share * a);
            right[below] -= share * right[k];
        }
    }
    for k in (0..count).rev() {
        let known: f64 = (k + 1..count).map(|j| matrix[k][j] * right[j]).sum();
        right[k] = (right[k] - known) / matrix[k][k];
    }
    right.iter().all(|x| x.is_finite()).then_some(right)
}
