//! Drifts: a line with a kink is distinguished from a step by the likelihood of each, and followed until it ends.
//!
//! Each model has three parameters: two of level or slope and one of date. A second step has two more. The difference of their
//! Bayesian information criteria over N nights is N ln(RSS of the step / RSS of the kink), plus 2 ln N for a second step (Schwarz,
//! Estimating the dimension of a model, Ann. Statist. 6 (1978)). A difference of 10 is very strong evidence (Raftery, Bayesian
//! model selection in social research, Sociol. Methodol. 25 (1995)). The interval of a slope is that of a line through the nights
//! since the kink alone, because the date of the kink is estimated with it.

use std::ops::Range;

use statrs::distribution::{ContinuousCDF, StudentsT};
use statrs::statistics::{Data, OrderStatistics};

use super::innovation::{Innovation, MAX_SPREADS, MIN_SPREAD, Spread, least_error};
use super::series::Series;

/// How much better than that of a step the criterion of a drift must be.
const MIN_EVIDENCE: f64 = 10.0;
/// With fewer nights a line looks like a step.
const MIN_NIGHTS: usize = 10;
/// Median deviations to a standard deviation, for normal noise.
const SIGMA_PER_MEDIAN_DEVIATION: f64 = 1.4826;
/// The probability beyond an interval on either side: that of two standard deviations of a normal distribution.
const INTERVAL_TAIL_P: f64 = 0.022_750_131_948_179;

/// A night with a value.
type Point = (f64, f64);

/// The deviations of a group as one number a night, in standard errors of that number, less their mean before a change.
pub(super) struct Trend {
    values: Vec<f64>,
    /// The first night that counts.
    pub(super) start: usize,
    /// The first night after the change.
    change: usize,
    /// One unit of `values` relative to the reference, in the mean over the group.
    pub(super) relative: f64,
    /// One unit of `values` in standard errors of a reading, likewise.
    pub(super) standard_errors: f64,
}

/// A line that leaves a level.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Kink {
    /// The last night on the level.
    pub(super) night: usize,
    /// Units of the trend a night.
    pub(super) slope: f64,
    pub(super) half_width: f64,
    residual: f64,
}

/// The mean of the finite values; no number where there are none.
fn mean_of_finite(values: impl Iterator<Item = f64>) -> f64 {
    let (mut sum, mut count) = (0.0, 0.0);
    for value in values.filter(|value| value.is_finite()) {
        sum += value;
        count += 1.0;
    }
    sum / count
}

impl Trend {
    pub(super) fn new(members: &[&Series], start: usize, change: usize, nights: usize) -> Self {
        let (mut sums, mut weight, mut count) = (vec![(0.0, 0.0_f64); nights], 0.0, 0.0_f64);
        for series in members {
            let read: Vec<usize> = (start..nights).filter(|night| series.deviation[*night].is_finite()).collect();
            let before = read.iter().filter(|night| **night < change);
            let level = mean_of_finite(before.map(|night| series.deviation[*night]));
            let reference = mean_of_finite(read.iter().map(|night| series.reference[*night])).abs();
            let error = mean_of_finite(read.iter().map(|night| series.std_error[*night].powi(2))).sqrt();
            let error = read.iter().map(|night| least_error(series, *night)).fold(error, f64::max);
            if level.is_finite() {
                for night in read {
                    sums[night].0 += (series.deviation[night] - level) / error;
                    sums[night].1 += 1.0;
                }
                weight += reference / error;
                count += 1.0;
            }
        }
        // A night without readings has no number: 0 / 0.
        let values = sums.into_iter().map(|(sum, count)| sum / count.sqrt()).collect();
        let relative = if weight > 0.0 { count.sqrt() / weight } else { 0.0 };
        Self { values, start, change, relative, standard_errors: count.sqrt().recip() }
    }

    /// How far the level of these nights is from that before the change.
    pub(super) fn step(&self, nights: Range<usize>) -> f64 {
        let points: Vec<Point> = self.points(nights).collect();
        points.iter().map(|(_, value)| value).sum::<f64>() / points.len() as f64
    }

    /// The nights that have a value.
    fn points(&self, nights: Range<usize>) -> impl Iterator<Item = Point> {
        nights.map(|n| (n as f64, self.values[n])).filter(|(_, value)| value.is_finite())
    }

    /// The points of all nights before `end`, with outliers before the change moved towards the median.
    fn points_without_outliers(&self, end: usize) -> Vec<Point> {
        let before: Vec<f64> = self.points(self.start..self.change).map(|(_, value)| value).collect();
        let middle = Data::new(before.clone()).median();
        let distances: Vec<f64> = before.iter().map(|v| (v - middle).abs()).collect();
        let spread = SIGMA_PER_MEDIAN_DEVIATION * Data::new(distances).median();
        let most = MAX_SPREADS * spread.max(MIN_SPREAD);
        let mut points: Vec<Point> = self.points(self.start..end).collect();
        for (night, value) in &mut points {
            if *night < self.change as f64 {
                *value = value.clamp(middle - most, middle + most);
            }
        }
        points
    }

    /// The drift that the nights before `end` show, if it explains them better than so many steps.
    pub(super) fn drift(&self, end: usize, steps: usize) -> Option<Kink> {
        let points = self.points_without_outliers(end);
        if points.len() < MIN_NIGHTS {
            return None;
        }
        let kink = kink(&points, self.start).filter(|kink| kink.slope.abs() > kink.half_width)?;
        let count = points.len() as f64;
        let least = count * MIN_SPREAD.powi(2);
        let evidence = count * (residual_of_steps(&points, steps).max(least) / kink.residual.max(least)).ln();
        let more_parameters = 2.0 * (steps - 1) as f64;
        (evidence + more_parameters * count.ln() > MIN_EVIDENCE).then_some(kink)
    }

    /// The line of a known drift, fitted to the nights before `end`.
    pub(super) fn line(&self, end: usize) -> Option<Kink> {
        kink(&self.points_without_outliers(end), self.start)
    }

    /// The normal deviates of the nights since `from` from the line of a drift through the nights before each.
    pub(super) fn line_deviates(&self, drift: &Kink, from: usize) -> impl Iterator<Item = (usize, f64)> {
        // A kink has three parameters.
        let freedom = self.points(self.start..from).count().saturating_sub(3);
        let least = freedom as f64 * MIN_SPREAD.powi(2);
        let mut spread = Spread::known(drift.residual.max(least), freedom);
        let mut on_line: Vec<Point> = self.points(drift.night..from).collect();
        let rest: Vec<Point> = self.points(from..self.values.len()).collect();
        rest.into_iter().filter_map(move |point @ (night, value)| {
            let line = StraightLine::through(&on_line)?;
            let expected = line.mean + line.slope * (night - line.middle);
            // The variance of a prediction: of the new value, the mean and the slope.
            let error = (1.0 + 1.0 / on_line.len() as f64 + (night - line.middle).powi(2) / line.squares).sqrt();
            let innovation = Innovation((value - expected) / error);
            let deviate = spread.deviate(innovation);
            spread.update(innovation);
            on_line.push(point);
            Some((night as usize, deviate))
        })
    }
}

/// A straight line by least squares.
pub(super) struct StraightLine {
    middle: f64,
    mean: f64,
    pub(super) slope: f64,
    /// The sum of the squared distances of the nights from their middle.
    squares: f64,
}

impl StraightLine {
    /// `None` of fewer than two different nights.
    pub(super) fn through(points: &[Point]) -> Option<Self> {
        let count = points.len() as f64;
        let (nights, values) = points.iter().fold((0.0, 0.0), |(x, y), point| (x + point.0, y + point.1));
        let (middle, mean) = (nights / count, values / count);
        let squares: f64 = points.iter().map(|(x, _)| (x - middle).powi(2)).sum();
        let products: f64 = points.iter().map(|(x, y)| (x - middle) * (y - mean)).sum();
        (squares > 0.0).then(|| Self { middle, mean, slope: products / squares, squares })
    }
}

/// A fit of a kink on a given night.
struct KinkFit {
    night: usize,
    slope: f64,
    residual: f64,
}

/// Fits a line that leaves a level on this night; `squares` is the sum of the squared values.
fn fit_kink(points: &[Point], squares: f64, night: usize) -> Option<KinkFit> {
    let bent: Vec<Point> = points.iter().map(|(x, y)| ((x - night as f64).max(0.0), *y)).collect();
    let line = StraightLine::through(&bent)?;
    let explained = points.len() as f64 * line.mean.powi(2) + line.slope.powi(2) * line.squares;
    Some(KinkFit { night, slope: line.slope, residual: (squares - explained).max(0.0) })
}

/// The likeliest line that leaves a level on some night from `first` on; `None` of fewer than five points.
fn kink(points: &[Point], first: usize) -> Option<Kink> {
    let last = points.last()?.0 as usize;
    let freedom = points.len().checked_sub(4).filter(|n| *n > 0)? as f64;
    let squares: f64 = points.iter().map(|(_, y)| y * y).sum();
    let fits = (first..last).filter_map(|night| fit_kink(points, squares, night));
    let KinkFit { night, slope, residual } = fits.min_by(|a, b| a.residual.total_cmp(&b.residual))?;
    let since: Vec<Point> = points.iter().copied().filter(|(x, _)| *x >= night as f64).collect();
    let least = MIN_SPREAD.powi(2);
    let error = ((residual / freedom).max(least) / StraightLine::through(&since)?.squares).sqrt();
    let quantile = StudentsT::new(0.0, 1.0, freedom).ok()?.inverse_cdf(1.0 - INTERVAL_TAIL_P);
    Some(Kink { night, slope, half_width: quantile * error, residual })
}

/// The residual sum of squares of the likeliest levels with so many steps between them.
fn residual_of_steps(points: &[Point], steps: usize) -> f64 {
    if steps == 0 {
        let sum: f64 = points.iter().map(|(_, y)| y).sum();
        let squares: f64 = points.iter().map(|(_, y)| y * y).sum();
        return (squares - sum * sum / points.len().max(1) as f64).max(0.0);
    }
    (1..points.len())
        .map(|k| residual_of_steps(&points[..k], steps - 1) + residual_of_steps(&points[k..], 0))
        .fold(f64::INFINITY, f64::min)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::history::synthetic::{is_near, series};
    use luxproof_process::random::normal;

    #[test]
    fn a_trend_adds_deviations_in_standard_errors_and_gives_steps_their_relative_size() {
        // Errors of 2 (the root of the mean of 1, 1, 1, 1 and 16) and 1: shifts of 2 are one error and two.
        let one = series(100.0, &[1.0, 1.0, 1.0, 1.0, 4.0], &[1.0, 1.0, 1.0, 3.0, 3.0]);
        let other = series(-50.0, &[1.0; 5], &[0.0, 0.0, 0.0, 2.0, 2.0]);
        let trend = Trend::new(&[&one, &other], 0, 3, 5);
        assert!(is_near(trend.step(0..3), 0.0) && is_near(trend.step(3..5), 3.0 / 2f64.sqrt()));
        assert!(is_near(trend.relative * trend.step(3..5), (50.0 * 0.02 + 50.0 * 0.04) / 100.0));
        assert!(is_near(trend.standard_errors * trend.step(3..5), 1.5));
        // A night without a reading has no value, and the level is that before the change alone.
        let mut sparse = one.clone();
        (sparse.deviation[1], sparse.deviation[3]) = (f64::NAN, f64::NAN);
        let alone = Trend::new(&[&sparse], 0, 3, 5);
        assert!(alone.values[1].is_nan() && alone.values[3].is_nan());
        // The errors of the nights that were read: (1 + 1 + 16) / 3 = 6.
        assert!(is_near(alone.step(3..5), 2.0 / 6f64.sqrt()) && is_near(alone.relative, 6f64.sqrt() / 100.0));
        let both = Trend::new(&[&sparse, &other], 0, 3, 5);
        assert!(is_near(both.values[3], 2.0), "{:?}", both.values);
        // A series without nights before the change shows none.
        let later = Trend::new(&[&one], 3, 3, 5);
        assert!(later.values.iter().all(|v| v.is_nan()) && later.relative == 0.0);
        // Without errors a millionth of the value is one; nights before the start do not count.
        let exact = series(100.0, &[0.0; 5], &[900.0, 0.0, 0.0, 1e-3, 1e-3]);
        let from_second = Trend::new(&[&exact], 1, 3, 5);
        assert!(from_second.values[0].is_nan() && (from_second.step(3..5) - 10.0).abs() < 1e-3);
    }

    fn trend(values: &[f64], change: usize) -> Trend {
        Trend { values: values.to_vec(), start: 0, change, relative: 1.0, standard_errors: 1.0 }
    }

    #[test]
    fn outliers_before_a_change_are_moved_to_four_spreads_from_the_median() {
        // Of the first six the median is .25, and that of the distances .75: 4 * 1.4826 * .75 = 4.4478.
        let found = trend(&[-1.0, -0.5, 0.0, 0.5, 1.0, 100.0, 50.0], 6).points_without_outliers(7);
        let values: Vec<f64> = found.iter().map(|(_, value)| *value).collect();
        let expected = [-1.0, -0.5, 0.0, 0.5, 1.0, 4.6978, 50.0];
        assert!(values.iter().zip(expected).all(|(v, e)| is_near(*v, e)), "{values:?}");
        assert_eq!(found.iter().map(|(night, _)| *night).collect::<Vec<_>>(), [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0]);
        // The least spread is a tenth of a standard error.
        let exact = trend(&[0.0, 0.0, 0.0, 7.0, 0.0, 9.0, 1.0], 6).points_without_outliers(6);
        assert_eq!(exact.iter().map(|(_, value)| *value).collect::<Vec<_>>(), [0.0, 0.0, 0.0, 0.4, 0.0, 0.4]);
    }

    #[test]
    fn a_straight_line_is_that_of_least_squares() {
        // By hand: means 1.5 and 3.75, sums 5 and 8.5.
        let line = StraightLine::through(&[(0.0, 1.0), (1.0, 3.0), (2.0, 5.0), (3.0, 6.0)]).unwrap();
        assert_eq!((line.middle, line.mean, line.squares), (1.5, 3.75, 5.0));
        assert!(is_near(line.slope, 1.7));
        assert!(StraightLine::through(&[(2.0, 1.0), (2.0, 3.0)]).is_none() && StraightLine::through(&[]).is_none());
    }

    /// The residual of the best level and slope after a night, by the normal equations and a sum over the points.
    fn residual_by_hand(points: &[Point], night: f64) -> (f64, f64) {
        let (mut n, mut x, mut xx, mut y, mut xy) = (0.0, 0.0, 0.0, 0.0, 0.0);
        for (time, value) in points {
            let since = if *time > night { time - night } else { 0.0 };
            (n, x, xx, y, xy) = (n + 1.0, x + since, xx + since * since, y + value, xy + since * value);
        }
        let slope = (n * xy - x * y) / (n * xx - x * x);
        let level = (y - slope * x) / n;
        let mut residual = 0.0;
        for (time, value) in points {
            residual += (value - level - slope * if *time > night { time - night } else { 0.0 }).powi(2);
        }
        (residual, slope)
    }

    #[test]
    fn a_kink_is_where_a_level_and_a_line_fit_best() {
        let mut random = fastrand::Rng::with_seed(5);
        for start in [4, 9, 13] {
            let points: Vec<Point> =
                (0..20).map(|n| (f64::from(n), f64::from((n - start).max(0)) + 0.5 * normal(&mut random))).collect();
            let found = kink(&points, 0).unwrap();
            let best = (0..19).map(|night| residual_by_hand(&points, f64::from(night)));
            let (residual, slope) = best.min_by(|a, b| a.0.total_cmp(&b.0)).unwrap();
            assert!((found.residual - residual).abs() < 1e-9 && (found.slope - slope).abs() < 1e-9, "{found:?}");
            assert_eq!(residual_by_hand(&points, found.night as f64).0, residual);
            // The interval is that of a line through the nights since: t of 16 degrees of freedom is 2.17 (GUM table G.2).
            let since: Vec<f64> = (found.night..20).map(|n| n as f64).collect();
            let middle = since.iter().sum::<f64>() / since.len() as f64;
            let squares: f64 = since.iter().map(|n| (n - middle).powi(2)).sum();
            let expected = 2.17 * (residual / 16.0 / squares).sqrt();
            assert!((found.half_width / expected - 1.0).abs() < 3e-3, "{found:?} {expected}");
        }
        // Exact points have the least spread, .1: t of 6 degrees of freedom is 2.52, and nights 3 to 9 have squares of 28.
        let exact: Vec<Point> = (0..10).map(|n| (f64::from(n), 1.0 + 2.0 * f64::from((n - 3).max(0)))).collect();
        let found = kink(&exact, 0).unwrap();
        assert!(found.night == 3 && is_near(found.slope, 2.0), "{found:?}");
        assert!((found.half_width / (2.52 * (0.01_f64 / 28.0).sqrt()) - 1.0).abs() < 3e-3, "{found:?}");
        assert_eq!(kink(&exact, 5).unwrap().night, 5);
        assert!(kink(&exact[..4], 0).is_none() && kink(&exact[..5], 0).is_some() && kink(&[], 0).is_none());
    }

    fn points(values: &[f64]) -> Vec<Point> {
        values.iter().map(|v| (0.0, *v)).collect()
    }

    #[test]
    fn steps_explain_levels() {
        // 9 + 9 - 6^2 / 5; of 0, 1, 1 it is 2 - 2^2 / 3.
        let one_step = points(&[0.0, 0.0, 0.0, 3.0, 3.0]);
        assert!(is_near(residual_of_steps(&one_step, 0), 10.8) && residual_of_steps(&one_step, 1) == 0.0);
        let two_steps = points(&[0.0, 1.0, 1.0, 5.0, 5.0]);
        assert!(is_near(residual_of_steps(&two_steps, 1), 2.0 / 3.0) && residual_of_steps(&two_steps, 2) == 0.0);
        assert_eq!(residual_of_steps(&[], 0), 0.0);
    }

    /// A level of ten nights and a line of so many, with noise of a tenth.
    fn drifting(nights: u32, slope: f64) -> Trend {
        let mut random = fastrand::Rng::with_seed(3);
        let values = (0..10 + nights).map(|n| slope * (f64::from(n) - 9.0).max(0.0) + 0.1 * normal(&mut random));
        trend(&values.collect::<Vec<f64>>(), 10)
    }

    #[test]
    fn a_line_is_a_drift_where_steps_explain_clearly_less() {
        let found = drifting(10, 1.0).drift(20, 1).unwrap();
        assert!(found.night.abs_diff(9) <= 1 && (found.slope - 1.0).abs() < found.half_width, "{found:?}");
        assert!(drifting(10, 1.0).drift(9, 1).is_none() && drifting(10, 0.0).drift(20, 1).is_none());
        let step: Vec<f64> = (0..20).map(|n| if n < 10 { 0.0 } else { 5.0 }).collect();
        assert_eq!(trend(&step, 10).drift(20, 1), None);
    }

    #[test]
    fn ten_nights_are_the_fewest_of_a_drift() {
        let steep: Vec<f64> = (0..10).map(|n| 5.0 * (f64::from(n) - 4.0).max(0.0)).collect();
        let found = trend(&steep, 5);
        assert_eq!(found.drift(10, 1).map(|kink| kink.night), Some(4));
        assert!(found.drift(9, 1).is_none());
        // A night without a reading does not count.
        let mut sparse = steep.clone();
        sparse.insert(2, f64::NAN);
        assert!(trend(&sparse, 6).drift(11, 1).is_some() && trend(&sparse, 6).drift(10, 1).is_none());
    }

    /// The residual of one level.
    fn of_level(values: &[f64]) -> f64 {
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        values.iter().map(|value| (value - mean).powi(2)).sum()
    }

    /// The least residual of two levels, or of three, by sums over all dates.
    fn residual_of_levels(values: &[f64], steps: usize) -> f64 {
        let mut least = f64::INFINITY;
        for first in 1..values.len() {
            for second in first + 1..=values.len() {
                if steps == 2 && second < values.len() {
                    let parts = [&values[..first], &values[first..second], &values[second..]];
                    least = least.min(parts.map(of_level).iter().sum());
                } else if steps == 1 {
                    least = least.min(of_level(&values[..first]) + of_level(&values[first..]));
                }
            }
        }
        least
    }

    #[test]
    fn the_evidence_of_a_drift_is_that_of_schwarz_and_must_exceed_ten() {
        // Twelve nights on a level, and ten on a line.
        const NOISE: [f64; 4] = [1.0, -1.0, -1.0, 1.0];
        let mut counts = [[0; 2]; 2];
        for (steps, k) in (0..40).map(|k| (1, k)).chain((0..40).map(|k| (2, k))) {
            // Two steps explain a line better than one does, so that a drift has to be steeper.
            let slope = [0.25, 0.9][steps - 1] + 0.02 * f64::from(k);
            let values: Vec<f64> = (0..22).map(|n| NOISE[n % 4] + slope * (n as f64 - 11.0).max(0.0)).collect();
            let points: Vec<Point> = values.iter().enumerate().map(|(n, value)| (n as f64, *value)).collect();
            let residuals = (0..21).map(|night| residual_by_hand(&points, f64::from(night)).0);
            let residual = residuals.fold(f64::INFINITY, f64::min);
            // A second step has two parameters more: 2 ln 22 = 6.182.
            let penalty = if steps == 2 { 6.182 } else { 0.0 };
            let evidence = 22.0 * (residual_of_levels(&values, steps) / residual).ln() + penalty;
            if (evidence - 10.0).abs() > 0.01 {
                let is_drift = trend(&values, 12).drift(22, steps).is_some();
                assert_eq!(is_drift, evidence > 10.0, "{steps} {slope} {evidence}");
                counts[steps - 1][usize::from(is_drift)] += 1;
            }
        }
        assert!(counts.as_flattened().iter().all(|count| *count >= 10), "{counts:?}");
    }

    #[test]
    fn a_slope_within_its_interval_is_no_drift() {
        // Two levels explain little, but so does a line through noise that is larger than its rise.
        let values: Vec<f64> = (0..24).map(|n| [3.0, -3.0][n % 2] + 0.05 * n as f64).collect();
        let flat = trend(&values, 12);
        let line = flat.line(24).unwrap();
        assert!(line.slope.abs() <= line.half_width && flat.drift(24, 1).is_none(), "{line:?}");
    }

    #[test]
    fn a_night_on_a_line_is_judged_by_the_error_of_its_prediction() {
        // Nights 3 to 9 on a line: the error of night 10 is the root of 1 + 1/7 + 4^2 / 28. A value .5 above is 3.819 spreads of .1.
        let mut values: Vec<f64> = (0..10).map(|n| 1.0 + 2.0 * (f64::from(n) - 3.0).max(0.0)).collect();
        values.push(15.5);
        let on_line = trend(&values, 4);
        let drift = on_line.line(10).unwrap();
        let found: Vec<(usize, f64)> = on_line.line_deviates(&drift, 10).collect();
        // Student's t of 7 degrees of freedom exceeds 3.819 on either side with .00655: 2.7184 of a normal distribution.
        assert!(found.len() == 1 && found[0].0 == 10 && (found[0].1 - 2.7184).abs() < 0.02, "{found:?}");
        values[10] = 14.5;
        let below: Vec<(usize, f64)> = trend(&values, 4).line_deviates(&drift, 10).collect();
        assert!((below[0].1 + found[0].1).abs() < 1e-6, "{below:?}");
    }
}
