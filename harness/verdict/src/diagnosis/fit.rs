//! Least squares of a few parameters: Levenberg and Marquardt's steps, with difference quotients for derivatives.

use super::fault::Parameter;

/// Steps of a fit at most.
const MAX_STEPS: usize = 10;
/// Tries of a step, each about ten times shorter than the last.
const MAX_TRIES: usize = 5;
/// A step is the last where it reduces chi-squared by less than this, or by less than this part.
const MIN_GAIN: f64 = 1e-2;
const FIRST_DAMPING: f64 = 1e-3;
const DAMPING_FACTOR: f64 = 10.0;
/// A pivot below this part of its diagonal makes equations singular.
const MIN_PIVOT: f64 = 1e-10;

#[derive(Clone, Debug, PartialEq)]
pub(super) struct Fitted {
    /// Each parameter with its standard error.
    pub(super) parameters: Vec<(f64, f64)>,
    pub(super) chi_squared: f64,
}

impl Fitted {
    pub(super) fn values(&self) -> Vec<f64> {
        self.parameters.iter().map(|(value, _)| *value).collect()
    }
}

/// The residuals at given parameters; `None` where there are none.
type Residuals<'a> = dyn FnMut(&[f64]) -> Option<Vec<f64>> + 'a;

/// Finds the parameters near `start` with the least sum of squared residuals.
///
/// `None` where there are no residuals, or where they leave a parameter open.
pub(super) fn fit(parameters: &[Parameter], start: &[f64], residuals: &mut Residuals<'_>) -> Option<Fitted> {
    let mut values = start.to_vec();
    let mut left = residuals(&values)?;
    let mut damping = FIRST_DAMPING;
    let mut slopes = derivatives(parameters, &values, &left, residuals)?;
    for _ in 0..MAX_STEPS {
        let before = sum_of_squares(&left);
        let mut is_better = false;
        for _ in 0..MAX_TRIES {
            let Some(step) = damped_step(&slopes, &left, damping) else { break };
            let mut tried = values.clone();
            for ((value, step), parameter) in tried.iter_mut().zip(&step).zip(parameters) {
                *value = (*value + step).clamp(parameter.range.0, parameter.range.1);
            }
            match residuals(&tried).filter(|found| sum_of_squares(found) < before) {
                Some(found) => {
                    (values, left, is_better) = (tried, found, true);
                    damping *= 0.1;
                    break;
                }
                // The last step may have reduced the damping below what has any effect.
                None => damping = DAMPING_FACTOR * damping.max(FIRST_DAMPING),
            }
        }
        let gain = before - sum_of_squares(&left);
        if !is_better || gain < MIN_GAIN.max(MIN_GAIN * before) {
            break;
        }
        slopes = derivatives(parameters, &values, &left, residuals)?;
    }
    let errors = standard_errors(&slopes)?;
    Some(Fitted { chi_squared: sum_of_squares(&left), parameters: values.into_iter().zip(errors).collect() })
}

pub(super) fn sum_of_squares(values: &[f64]) -> f64 {
    values.iter().map(|v| v * v).sum()
}

/// Derivatives of the residuals, one list a parameter.
fn derivatives(
    parameters: &[Parameter],
    values: &[f64],
    left: &[f64],
    residuals: &mut Residuals<'_>,
) -> Option<Vec<Vec<f64>>> {
    let mut slopes = vec![];
    for (k, parameter) in parameters.iter().enumerate().take(values.len()) {
        let mut slope = None;
        // At the end of a range, or where a step hides the fault, the other direction serves.
        for step in [parameter.step, -parameter.step] {
            let mut moved = values.to_vec();
            moved[k] += step;
            let is_inside = (parameter.range.0..=parameter.range.1).contains(&moved[k]);
            let found = residuals(&moved).filter(|found| is_inside && found.len() == left.len());
            if let Some(found) = found {
                slope = Some(found.iter().zip(left).map(|(a, b)| (a - b) / step).collect::<Vec<f64>>());
                break;
            }
        }
        slopes.push(slope?);
    }
    Some(slopes)
}

/// Solves the normal equations with a damped diagonal.
fn damped_step(slopes: &[Vec<f64>], left: &[f64], damping: f64) -> Option<Vec<f64>> {
    let mut matrix = normal_matrix(slopes);
    for (k, row) in matrix.iter_mut().enumerate() {
        row[k] *= 1.0 + damping;
    }
    let right = slopes.iter().map(|slope| -dot(slope, left)).collect();
    solve(matrix, right)
}

fn normal_matrix(slopes: &[Vec<f64>]) -> Vec<Vec<f64>> {
    slopes.iter().map(|a| slopes.iter().map(|b| dot(a, b)).collect()).collect()
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(x, y)| x * y).sum()
}

/// Standard errors of parameters: roots of the diagonal of the inverse matrix.
fn standard_errors(slopes: &[Vec<f64>]) -> Option<Vec<f64>> {
    let mut errors = vec![];
    for k in 0..slopes.len() {
        let mut unit = vec![0.0; slopes.len()];
        unit[k] = 1.0;
        errors.push(solve(normal_matrix(slopes), unit)?[k].max(0.0).sqrt());
    }
    Some(errors)
}

/// Gaussian elimination with pivots; `None` where equations are singular.
fn solve(mut matrix: Vec<Vec<f64>>, mut right: Vec<f64>) -> Option<Vec<f64>> {
    let count = right.len();
    let scale: Vec<f64> = (0..count).map(|k| matrix[k][k]).collect();
    for k in 0..count {
        let pivot = (k..count).max_by(|a, b| matrix[*a][k].abs().total_cmp(&matrix[*b][k].abs()))?;
        matrix.swap(k, pivot);
        right.swap(k, pivot);
        let is_regular = matrix[k][k].abs() > MIN_PIVOT * scale[k];
        if !is_regular {
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

#[cfg(test)]
mod tests {
    use super::*;
    const X: [f64; 4] = [0.0, 1.0, 2.0, 3.0];
    const Y: [f64; 4] = [0.0, 1.0, 1.0, 2.0];

    /// Two parameters from 0 that may be anything up to a limit.
    fn parameters(most: f64) -> [Parameter; 2] {
        [Parameter::new("", 0.0, 0.01, (-10.0, 10.0)), Parameter::new("", 0.0, 0.01, (-10.0, most))]
    }

    /// The residuals of a straight line.
    fn line(p: &[f64]) -> Vec<f64> {
        X.iter().zip(Y).map(|(x, y)| p[0] + p[1] * x - y).collect()
    }

    #[test]
    fn a_straight_line_is_fitted_with_its_errors_and_its_residual() {
        // By hand: slope 3 / 5 and level .1, residuals of .1, .3, .3 and .1; the inverse of (4, 6; 6, 14) is (14, -6; -6, 4) / 20.
        let found = fit(&parameters(10.0), &[5.0, -3.0], &mut |p| Some(line(p))).unwrap();
        let [(level, of_level), (slope, of_slope)] = found.parameters[..] else { panic!("{found:?}") };
        assert!((level - 0.1).abs() < 1e-4 && (slope - 0.6).abs() < 1e-4, "{found:?}");
        assert!((of_level - 0.7_f64.sqrt()).abs() < 1e-6 && (of_slope - 0.2_f64.sqrt()).abs() < 1e-6, "{found:?}");
        assert!((found.chi_squared - 0.2).abs() < 1e-6, "{found:?}");
        assert_eq!(found.values(), [level, slope]);
    }

    #[test]
    fn a_fit_stays_within_its_ranges_and_needs_residuals() {
        let bounded = fit(&parameters(0.5), &[0.0, 0.5], &mut |p| Some(line(p))).unwrap();
        assert!(bounded.values()[1] <= 0.5 && bounded.chi_squared >= 0.2, "{bounded:?}");
        assert_eq!(fit(&parameters(10.0), &[0.0, 0.0], &mut |_| None), None);
        // Readings that do not depend on a parameter leave it open.
        assert_eq!(fit(&parameters(10.0), &[0.0, 0.0], &mut |p| Some(vec![p[0] - 1.0, p[0]])), None);
    }

    #[test]
    fn a_power_is_found_step_by_step() {
        let one = [Parameter::new("", 1.0, 0.02, (0.1, 10.0))];
        let readings = [0.1_f64, 0.4, 0.7].map(|x| x.powf(2.2));
        let mut residuals = |p: &[f64]| {
            Some([0.1_f64, 0.4, 0.7].iter().zip(readings).map(|(x, y)| (x.powf(p[0]) - y) / 1e-3).collect())
        };
        let found = fit(&one, &[1.0], &mut residuals).unwrap();
        assert!((found.values()[0] - 2.2).abs() < 1e-3 && found.chi_squared < 0.1, "{found:?}");
    }

    #[test]
    fn a_slope_at_the_end_of_a_range_is_that_of_the_other_side() {
        let one = [Parameter::new("", 1.0, 0.25, (0.0, 1.0))];
        let mut squares = |p: &[f64]| Some(vec![p[0] * p[0], 3.0 * p[0]]);
        // (1 - .75^2) / .25 and 3.
        assert_eq!(derivatives(&one, &[1.0], &[1.0, 3.0], &mut squares), Some(vec![vec![1.75, 3.0]]));
        // Forwards within it: (.75^2 - .5^2) / .25.
        assert_eq!(derivatives(&one, &[0.5], &[0.25, 1.5], &mut squares), Some(vec![vec![1.25, 3.0]]));
    }

    #[test]
    fn linear_equations_are_solved_with_pivots() {
        let matrix = vec![vec![2.0, 1.0, 0.0], vec![1.0, 3.0, 1.0], vec![0.0, 1.0, 2.0]];
        let found = solve(matrix, vec![4.0, 10.0, 8.0]).unwrap();
        assert!(found.iter().zip([1.0, 2.0, 3.0]).all(|(x, e)| (x - e).abs() < 1e-12), "{found:?}");
        assert_eq!(solve(vec![vec![0.0, 2.0], vec![4.0, 0.0]], vec![6.0, 8.0]), Some(vec![2.0, 3.0]));
        assert_eq!(solve(vec![vec![1.0, 2.0], vec![2.0, 4.0]], vec![1.0, 2.0]), None);
        assert_eq!(standard_errors(&[vec![3.0, 4.0], vec![0.0, 2.0]]).map(|e| e.len()), Some(2));
        assert_eq!(sum_of_squares(&[3.0, -4.0]), 25.0);
    }
}
