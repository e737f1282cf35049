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
