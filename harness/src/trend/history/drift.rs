//! Drifts: a line with a kink told apart from a step by the likelihood of either, and watched until it ends.
//!
//! Each has three parameters, two of level or slope and one of date, and two more for a second step, so that the difference of
//! their Bayesian information criteria is N ln(RSS of the step / RSS of the kink) over N nights, plus 2 ln N (Schwarz, Estimating the dimension of a model, Ann. Statist. 6
//! (1978)); 10 is very strong evidence (Raftery, Bayesian model selection in social research, Sociol. Methodol. 25 (1995)). The
//! interval of a slope is that of a line through the nights since the kink alone, whose date is estimated with it.

use std::ops::Range;

use statrs::distribution::{ContinuousCDF, StudentsT};
use statrs::statistics::{Data, OrderStatistics};

use super::innovation::{Innovation, MAX_SPREADS, MIN_ERROR, MIN_SPREAD, Spread};
use super::series::Series;

/// By how much the criterion of a drift must be better than that of what a change is taken for first, a step.
const EVIDENCE: f64 = 10.0;
/// Of normal noise, 1.4826 median deviations are one standard deviation.
const OF_MEDIAN_DEVIATION: f64 = 1.4826;
/// What an interval leaves out on either side: it covers what two standard deviations of a normal distribution cover.
const BEYOND: f64 = 0.022_750_131_948_179;

/// The deviations of a group as one number a night, in standard errors of that number, less their mean before a change.
pub(super) struct Trend {
    values: Vec<f64>,
    /// The first night that counts, and the first that is not taken for one before the change.
    pub(super) start: usize,
    change: usize,
    /// What one of `values` is relative to the reference, and in standard errors of a reading, in the mean over the group.
    pub(super) relative: f64,
    pub(super) standard_errors: f64,
}

/// A line that leaves a level.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Kink {
    /// The last night on the level.
    pub(super) night: usize,
    /// A night, in units of the trend.
    pub(super) slope: f64,
    pub(super) half_width: f64,
    residual: f64,
}

impl Trend {
    pub(super) fn of(members: &[&Series], start: usize, change: usize, nights: usize) -> Self {
        let mean = |values: &mut dyn Iterator<Item = f64>| {
            let there = values.filter(|v| v.is_finite());
            let (sum, count) = there.fold((0.0, 0.0), |(sum, count), v| (sum + v, count + 1.0));
            sum / count
        };
        let (mut sums, mut weight, mut count) = (vec![(0.0, 0.0_f64); nights], 0.0, 0.0_f64);
        for series in members {
            let there = || (start..nights).filter(|n| series.deviation[*n].is_finite());
            let before = mean(&mut there().filter(|n| *n < change).map(|n| series.deviation[n]));
            let reference = mean(&mut there().map(|n| series.reference[n])).abs();
            let error = mean(&mut there().map(|n| series.std_error[n].powi(2))).sqrt();
            let error = error.max(MIN_ERROR * reference).max(f64::MIN_POSITIVE);
            if before.is_finite() {
                for night in there() {
                    sums[night].0 += (series.deviation[night] - before) / error;
                    sums[night].1 += 1.0;
                }
                weight += reference / error;
                count += 1.0;
            }
        }
        // Without any there is no number: 0 / 0.
        let values = sums.into_iter().map(|(sum, count)| sum / count.sqrt()).collect();
        let relative = if weight > 0.0 { count.sqrt() / weight } else { 0.0 };
        Self { values, start, change, relative, standard_errors: count.sqrt().recip() }
    }

    /// How far the level of some nights lies from that before the change.
    pub(super) fn step(&self, nights: Range<usize>) -> f64 {
        let points: Vec<_> = self.points(nights).collect();
        points.iter().map(|(_, value)| value).sum::<f64>() / points.len() as f64
    }

    /// Nights as numbers, with their values.
    fn points(&self, nights: Range<usize>) -> impl Iterator<Item = (f64, f64)> {
        nights.map(|n| (n as f64, self.values[n])).filter(|(_, value)| value.is_finite())
    }

    /// The points of all nights up to one; single wild nights before the change are drawn in.
    fn tame(&self, end: usize) -> Vec<(f64, f64)> {
        let before: Vec<f64> = self.points(self.start..self.change).map(|(_, value)| value).collect();
        let middle = Data::new(before.clone()).median();
        let apart: Vec<f64> = before.iter().map(|v| (v - middle).abs()).collect();
        let spread = OF_MEDIAN_DEVIATION * Data::new(apart).median();
        let most = MAX_SPREADS * spread.max(MIN_SPREAD);
        let tame = |(night, value): (f64, f64)| {
            let is_before = night < self.change as f64;
            (night, if is_before { value.clamp(middle - most, middle + most) } else { value })
        };
        self.points(self.start..end).map(tame).collect()
    }

    /// The drift that the nights before `end` show by more than so many steps.
    pub(super) fn drift(&self, end: usize, steps: usize) -> Option<Kink> {
        let points = self.tame(end);
        let kink = kink(&points, self.start).filter(|kink| kink.slope.abs() > kink.half_width)?;
        let count = points.len() as f64;
        let least = count * MIN_SPREAD.powi(2);
        let likelier = count * (residual_of_steps(&points, steps).max(least) / kink.residual.max(least)).ln();
        let more_parameters = 2.0 * (steps - 1) as f64;
        (likelier + more_parameters * count.ln() > EVIDENCE).then_some(kink)
    }

    /// The line of a drift that is known to be one, by the nights before `end`.
    pub(super) fn line(&self, end: usize) -> Option<Kink> {
        kink(&self.tame(end), self.start)
    }

    /// What the nights from `from` on bring that the line of a drift through those before each did not predict.
    pub(super) fn off_the_line(&self, drift: &Kink, from: usize) -> impl Iterator<Item = (usize, f64)> {
        let known = self.points(self.start..from).count().saturating_sub(3);
        let least = known as f64 * MIN_SPREAD.powi(2);
        let mut spread = Spread::known(drift.residual.max(least), known);
        let mut on_it: Vec<(f64, f64)> = self.points(drift.night..from).collect();
        let rest: Vec<(f64, f64)> = self.points(from..self.values.len()).collect();
        rest.into_iter().filter_map(move |point @ (night, value)| {
            let line = Line::through(&on_it)?;
            let expected = line.mean + line.slope * (night - line.middle);
            let error = (1.0 + 1.0 / on_it.len() as f64 + (night - line.middle).powi(2) / line.squares).sqrt();
            let innovation = Innovation((value - expected) / error);
            let deviate = spread.deviate(innovation);
            spread.update(innovation);
            on_it.push(point);
            Some((night as usize, deviate))
        })
    }
}

/// A straight line by least squares.
pub(super) struct Line {
    middle: f64,
    mean: f64,
    pub(super) slope: f64,
    /// Of the nights' distances from their middle.
    squares: f64,
}

impl Line {
    /// `None` of fewer than two points.
    pub(super) fn through(points: &[(f64, f64)]) -> Option<Self> {
        let count = points.len() as f64;
        let (nights, values) = points.iter().fold((0.0, 0.0), |(x, y), point| (x + point.0, y + point.1));
        let (middle, mean) = (nights / count, values / count);
        let squares: f64 = points.iter().map(|(x, _)| (x - middle).powi(2)).sum();
        let products: f64 = points.iter().map(|(x, y)| (x - middle) * (y - mean)).sum();
        (squares > 0.0).then(|| Self { middle, mean, slope: products / squares, squares })
    }
}

/// The likeliest line that leaves a level on some night from the first on; `None` of fewer than five points.
fn kink(points: &[(f64, f64)], first: usize) -> Option<Kink> {
    let last = points.last()?.0 as usize;
    let freedom = points.len().checked_sub(4).filter(|n| *n > 0)? as f64;
    let all: f64 = points.iter().map(|(_, y)| y * y).sum();
    let at = |night: usize| {
        let gone: Vec<(f64, f64)> = points.iter().map(|(x, y)| ((x - night as f64).max(0.0), *y)).collect();
        let line = Line::through(&gone)?;
        let explained = points.len() as f64 * line.mean.powi(2) + line.slope.powi(2) * line.squares;
        Some((night, line.slope, (all - explained).max(0.0)))
    };
    let fits = (first..last).filter_map(at);
    let (night, slope, residual) = fits.min_by(|a, b| a.2.total_cmp(&b.2))?;
    let since: Vec<(f64, f64)> = points.iter().copied().filter(|(x, _)| *x >= night as f64).collect();
    let least = MIN_SPREAD.powi(2);
    let error = ((residual / freedom).max(least) / Line::through(&since)?.squares).sqrt();
    let quantile = StudentsT::new(0.0, 1.0, freedom).ok()?.inverse_cdf(1.0 - BEYOND);
    Some(Kink { night, slope, half_width: quantile * error, residual })
}

/// What the likeliest levels with so many steps between them leave unexplained.
fn residual_of_steps(points: &[(f64, f64)], steps: usize) -> f64 {
    if steps == 0 {
        let sum: f64 = points.iter().map(|(_, y)| y).sum();
        let squares: f64 = points.iter().map(|(_, y)| y * y).sum();
        return (squares - sum * sum / points.len().max(1) as f64).max(0.0);
    }
    let split = |k| residual_of_steps(&points[..k], steps - 1) + residual_of_steps(&points[k..], 0);
    (1..points.len()).map(split).fold(f64::INFINITY, f64::min)
}
