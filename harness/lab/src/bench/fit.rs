//! Slope and floor of error over time, the time to an error, and the interval of a root mean
//! square.

use itertools::Itertools;
use statrs::distribution::{ChiSquared, ContinuousCDF};

/// A power law above a floor: error squared = (a t^slope)^2 + floor^2.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Fit {
    pub(super) slope: f64,
    /// `None` where the points follow their slope to the end.
    pub(super) floor: Option<f64>,
}

/// The least ratio by which a floor must reduce the sum of squares.
const MIN_FLOOR_GAIN: f64 = 3.0;
/// The number of floors that are tried between a hundredth of the least error and that error.
const TRIED_FLOORS: usize = 120;
/// The scatter of ln(error) below which a straight line needs no floor.
const SCATTER_LN: f64 = 0.05;

/// Fits a power law with and without a floor to points (time, error). It needs three points, and
/// times that differ by half.
pub(super) fn fit_power_law(points: &[(f64, f64)]) -> Option<Fit> {
    let points: Vec<(f64, f64)> = points.iter().copied().filter(|(t, e)| *t > 0.0 && *e > 0.0).collect();
    let first = points.iter().map(|p| p.0).fold(f64::INFINITY, f64::min);
    let last = points.iter().map(|p| p.0).fold(0.0, f64::max);
    if points.len() < 3 || last < 1.5 * first {
        return None;
    }
    let (slope, straight) = fit_line(&points, 0.0)?;
    let least = points.iter().map(|p| p.1).fold(f64::INFINITY, f64::min);
    let floors = (0..TRIED_FLOORS).map(|k| least * 10f64.powf(-2.0 + 2.0 * (k as f64 + 0.5) / TRIED_FLOORS as f64));
    let tried = floors.filter_map(|floor| fit_line(&points, floor).map(|(slope, rest)| (slope, rest, floor)));
    let best = tried.min_by(|a, b| a.1.total_cmp(&b.1));
    let noise = SCATTER_LN * SCATTER_LN * points.len() as f64;
    match best {
        // Three points determine all three parameters, so a floor would explain anything.
        Some((slope, rest, floor))
            if points.len() > 3 && straight > MIN_FLOOR_GAIN * rest.max(noise) && slope < 0.0 =>
        {
            Some(Fit { slope, floor: Some(floor) })
        }
        _ => Some(Fit { slope, floor: None }),
    }
}

/// The error above a floor, where both add up in squares.
fn error_above(error: f64, floor: f64) -> f64 {
    (error * error - floor * floor).max(0.0).sqrt()
}

/// A point of the regression: ln(time), ln(error above the floor), weight.
struct LogPoint {
    x: f64,
    y: f64,
    weight: f64,
}

/// The slope of the errors above a floor by weighted linear regression, and the sum of squared
/// residuals in ln.
fn fit_line(points: &[(f64, f64)], floor: f64) -> Option<(f64, f64)> {
    let mut logs: Vec<LogPoint> = vec![];
    for (t, e) in points {
        let above = error_above(*e, floor);
        // Close to the floor the rest is uncertain, so it has a small weight.
        if above > 0.0 {
            logs.push(LogPoint { x: t.ln(), y: above.ln(), weight: (above / e).powi(4) });
        }
    }
    let weight: f64 = logs.iter().map(|l| l.weight).sum();
    let x = logs.iter().map(|l| l.weight * l.x).sum::<f64>() / weight;
    let y = logs.iter().map(|l| l.weight * l.y).sum::<f64>() / weight;
    let xx = logs.iter().map(|l| l.weight * (l.x - x).powi(2)).sum::<f64>() / weight;
    let xy = logs.iter().map(|l| l.weight * ((l.x - x) * (l.y - y))).sum::<f64>() / weight;
    let slope = xy / xx;
    let residuals = points.iter().map(|(t, e)| (e / (y + slope * (t.ln() - x)).exp().hypot(floor)).ln().powi(2));
    let rest = residuals.sum::<f64>();
    (slope.is_finite() && rest.is_finite()).then_some((slope, rest))
}

/// The time at which the error first reaches a target, log-log between the points and never beyond
/// them.
pub(super) fn time_to(points: &[(f64, f64)], target: f64) -> Option<f64> {
    let points = points.iter().copied().sorted_by(|a, b| a.0.total_cmp(&b.0)).collect_vec();
    let k = points.iter().position(|(_, e)| *e <= target)?;
    let (t1, e1) = points[k];
    if k == 0 || e1 <= 0.0 {
        return Some(t1);
    }
    let (t0, e0) = points[k - 1];
    let part = (e0 / target).ln() / (e0 / e1).ln();
    Some((t0.ln() + part * (t1 / t0).ln()).exp())
}

/// The factors from a root mean square over `n` repetitions to the ends of its 95 % interval
/// (chi-squared, n degrees of freedom).
pub(super) fn interval_of_rms(n: usize) -> (f64, f64) {
    let n = n as f64;
    [0.975, 0.025].map(|p| ChiSquared::new(n).map_or(1.0, |chi_squared| (n / chi_squared.inverse_cdf(p)).sqrt())).into()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Points of a square-root law with a floor.
    fn square_root_law(floor: f64, times: &[f64]) -> Vec<(f64, f64)> {
        times.iter().map(|t| (*t, (0.01 / t.sqrt()).hypot(floor))).collect()
    }

    const TIMES: [f64; 7] = [0.25, 1.0, 4.0, 16.0, 64.0, 256.0, 1024.0];

    #[test]
    fn a_square_root_law_has_slope_minus_a_half_and_its_floor_is_found_where_it_has_one() {
        let found = fit_power_law(&square_root_law(0.0, &TIMES)).unwrap();
        assert!((found.slope + 0.5).abs() < 1e-9 && found.floor.is_none(), "{found:?}");
        let found = fit_power_law(&square_root_law(2e-3, &TIMES)).unwrap();
        assert!((found.slope + 0.5).abs() < 0.03, "{found:?}");
        assert!((found.floor.unwrap() / 2e-3 - 1.0).abs() < 0.05, "{found:?}");
    }

    #[test]
    fn scatter_alone_makes_no_floor() {
        let mut points = square_root_law(0.0, &TIMES);
        for (k, point) in points.iter_mut().enumerate() {
            point.1 *= [1.03, 0.97, 1.02, 0.96, 1.04, 0.98, 1.01][k];
        }
        assert!(fit_power_law(&points).unwrap().floor.is_none());
    }

    #[test]
    fn the_time_to_an_error_lies_between_the_points_and_never_beyond() {
        let points = square_root_law(0.0, &TIMES);
        assert!((time_to(&points, 1e-3).unwrap() - 100.0).abs() < 1e-6);
        assert_eq!(time_to(&points, 0.5), Some(0.25));
        assert_eq!(time_to(&points, 1e-5), None);
    }

    #[test]
    fn intervals_of_a_root_mean_square_are_those_of_chi_squared() {
        // Tables: chi-squared with 10 degrees of freedom, 3.247 and 20.483.
        let (low, high) = interval_of_rms(10);
        assert!((low - (10.0_f64 / 20.483).sqrt()).abs() < 1e-4 && (high - (10.0_f64 / 3.247).sqrt()).abs() < 1e-3);
    }
}
