//! Slope and floor of error over time, time to an error, and the interval of a root mean square; pure.

use itertools::Itertools;
use statrs::distribution::{ChiSquared, ContinuousCDF};

/// A power law above a floor: error squared = (a t^slope)^2 + floor^2.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Fit {
    pub(super) slope: f64,
    /// `None` where the points keep to their slope.
    pub(super) floor: Option<f64>,
}

/// A floor has to make the points fit that many times better in squares to be believed.
const BETTER: f64 = 3.0;
/// Floors tried between a hundredth of the least error and that error.
const FLOORS: usize = 120;
/// Scatter of a point in ln, below which a straight line needs no floor to be good.
const SCATTER: f64 = 0.05;

/// Fits a power law with and without a floor to points (time, error); needs three, and times that differ by half.
pub(super) fn fit(points: &[(f64, f64)]) -> Option<Fit> {
    let points: Vec<(f64, f64)> = points.iter().copied().filter(|(t, e)| *t > 0.0 && *e > 0.0).collect();
    let times = || points.iter().map(|p| p.0);
    let (first, last) = (times().fold(f64::INFINITY, f64::min), times().fold(0.0, f64::max));
    if points.len() < 3 || last < 1.5 * first {
        return None;
    }
    let (slope, straight) = line(&points, 0.0)?;
    let least = points.iter().map(|p| p.1).fold(f64::INFINITY, f64::min);
    let floors = (0..FLOORS).map(|k| least * 10f64.powf(-2.0 + 2.0 * (k as f64 + 0.5) / FLOORS as f64));
    let tried = floors.filter_map(|floor| line(&points, floor).map(|(slope, rest)| (slope, rest, floor)));
    let best = tried.min_by(|a, b| a.1.total_cmp(&b.1));
    let noise = SCATTER * SCATTER * points.len() as f64;
    match best {
        // Three points determine all three parameters: a floor would explain anything.
        Some((slope, rest, floor)) if points.len() > 3 && straight > BETTER * rest.max(noise) && slope < 0.0 => {
            Some(Fit { slope, floor: Some(floor) })
        }
        _ => Some(Fit { slope, floor: None }),
    }
}

/// Slope of the errors above a floor, and the sum of squares in ln of what is left.
fn line(points: &[(f64, f64)], floor: f64) -> Option<(f64, f64)> {
    let above = |e: f64| (e * e - floor * floor).max(0.0).sqrt();
    let logs: Vec<(f64, f64, f64)> = points
        .iter()
        .filter(|(_, e)| above(*e) > 0.0)
        // Near the floor little is left above it, which counts as little as it is.
        .map(|(t, e)| (t.ln(), above(*e).ln(), (above(*e) / e).powi(4)))
        .collect();
    let weight: f64 = logs.iter().map(|l| l.2).sum();
    let mean = |f: &dyn Fn(&(f64, f64, f64)) -> f64| logs.iter().map(|l| l.2 * f(l)).sum::<f64>() / weight;
    let (x, y) = (mean(&|l| l.0), mean(&|l| l.1));
    let (xx, xy) = (mean(&|l| (l.0 - x).powi(2)), mean(&|l| (l.0 - x) * (l.1 - y)));
    let slope = xy / xx;
    let predicted = |t: f64| (y + slope * (t.ln() - x)).exp().hypot(floor);
    let rest = points.iter().map(|(t, e)| (e / predicted(*t)).ln().powi(2)).sum::<f64>();
    (slope.is_finite() && rest.is_finite()).then_some((slope, rest))
}

/// Time at which the error first comes down to a target, log-log between the points; never beyond them.
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

/// Factors from a root mean square over `n` repetitions to the ends of its 95 % interval, n degrees of freedom.
pub(super) fn interval_of_rms(n: usize) -> (f64, f64) {
    let n = n as f64;
    let end = |p| ChiSquared::new(n).map_or(1.0, |chi_squared| (n / chi_squared.inverse_cdf(p)).sqrt());
    (end(0.975), end(0.025))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn law(floor: f64, times: &[f64]) -> Vec<(f64, f64)> {
        times.iter().map(|t| (*t, (0.01 / t.sqrt()).hypot(floor))).collect()
    }

    const TIMES: [f64; 7] = [0.25, 1.0, 4.0, 16.0, 64.0, 256.0, 1024.0];

    #[test]
    fn a_square_root_law_has_slope_minus_a_half_and_its_floor_is_found_where_it_has_one() {
        let found = fit(&law(0.0, &TIMES)).unwrap();
        assert!((found.slope + 0.5).abs() < 1e-9 && found.floor.is_none(), "{found:?}");
        let found = fit(&law(2e-3, &TIMES)).unwrap();
        assert!((found.slope + 0.5).abs() < 0.03, "{found:?}");
        assert!((found.floor.unwrap() / 2e-3 - 1.0).abs() < 0.05, "{found:?}");
    }

    #[test]
    fn scatter_alone_makes_no_floor() {
        let mut points = law(0.0, &TIMES);
        for (k, point) in points.iter_mut().enumerate() {
            point.1 *= [1.03, 0.97, 1.02, 0.96, 1.04, 0.98, 1.01][k];
        }
        assert!(fit(&points).unwrap().floor.is_none());
    }

    #[test]
    fn the_time_to_an_error_lies_between_the_points_and_never_beyond() {
        let points = law(0.0, &TIMES);
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
