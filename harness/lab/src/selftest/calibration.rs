//! Checks that the verdicts' intervals and p-values are right: errors are drawn as each kind of
//! uncertainty has them and judged like readings.
//!
//! Without a fault, p-values are uniform between 0 and 1 (Kolmogorov's test; Stephens, J. Roy.
//! Statist. Soc. B 32, 1970), and an interval of 95 % contains the truth in 95 of 100 cases. That
//! is checked for each component of an error budget and for all of them together.

use std::fmt;

use itertools::Itertools;
use serde::{Deserialize, Serialize};

use luxproof_model::{Component, Estimate, Source};
use luxproof_process::random::normal;
use luxproof_statistics::error_budget;

/// The number of p-values for Kolmogorov's test.
const P_VALUES: usize = 500;
/// The number of intervals for each coverage.
const INTERVALS: usize = 10_000;
/// The coverages that are checked; verdicts use that of two standard deviations of a normal
/// distribution.
const NOMINAL_COVERAGES: [f64; 5] = [0.5, 0.8, 0.9, 0.9545, 0.99];
/// The least probability by chance of the distance from a uniform distribution.
const MIN_KS_P: f64 = 0.01;
/// The largest difference between found and nominal coverage.
const MAX_COVERAGE_ERROR: f64 = 0.02;
/// The number of independent blocks of an engine that has few.
const FEW_BLOCKS: usize = 8;

/// The result of the check for all kinds of uncertainty.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Calibrations {
    pub intervals: Vec<Interval>,
}

/// The result of the check for one kind of uncertainty.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Interval {
    pub kind: String,
    /// The p-values without a fault, sorted; plotted against rank over count they lie on the
    /// diagonal.
    pub p_values: Vec<f64>,
    /// Kolmogorov's statistic: the largest distance of the p-values from the diagonal.
    pub ks_statistic: f64,
    /// The probability of a larger distance by chance.
    pub ks_p: f64,
    pub coverage: Vec<Coverage>,
}

/// The part of intervals that contain the truth, with the part that should.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Coverage {
    pub nominal: f64,
    pub found: f64,
}

impl Calibrations {
    /// Whether all kinds of uncertainty are right.
    pub fn is_good(&self) -> bool {
        self.intervals.iter().all(Interval::is_good)
    }
}

impl Interval {
    /// Whether p-values are uniform and all coverages are near their nominal values.
    pub fn is_good(&self) -> bool {
        let are_covered = self.coverage.iter().all(|c| (c.found - c.nominal).abs() <= MAX_COVERAGE_ERROR);
        self.ks_p > MIN_KS_P && are_covered
    }
}

/// Draws an error with the components that its budget states.
type ErrorSampler = fn(&mut fastrand::Rng) -> (f64, Vec<Component>);

/// The kinds of uncertainty.
const KINDS: [(&str, ErrorSampler); 7] = [
    ("Monte Carlo, many blocks", |random| {
        (0.003 * normal(random), vec![Component::normal(Source::MonteCarlo, 0.003, None)])
    }),
    ("Monte Carlo, 8 blocks", |random| draw_block_mean(random, FEW_BLOCKS)),
    ("Monte Carlo, 3 blocks", |random| draw_block_mean(random, 3)),
    ("discretisation", |random| (draw_within(random, 0.002), vec![Component::within(Source::Discretisation, 0.002)])),
    ("reference, rounding", |random| draw_rounding_error(random)),
    ("input: last digit of the table", |random| {
        (draw_within(random, 5e-4), vec![Component::within(Source::Input, 5e-4)])
    }),
    ("all together", |random| {
        let (chance, mut components) = draw_block_mean(random, 2 * FEW_BLOCKS);
        let (rounding, rounding_components) = draw_rounding_error(random);
        components.extend(rounding_components);
        components.push(Component::within(Source::Input, 5e-4));
        components.push(Component::within(Source::Discretisation, 0.002));
        (chance + rounding + draw_within(random, 5e-4) + draw_within(random, 0.002), components)
    }),
];

/// Draws the mean of a few noisy blocks, with the standard error that the blocks state themselves.
fn draw_block_mean(random: &mut fastrand::Rng, blocks: usize) -> (f64, Vec<Component>) {
    let values: Vec<f64> = (0..blocks).map(|_| 0.008 * normal(random)).collect();
    let Estimate { value, uncertainty } = Estimate::of_samples(&values);
    let error = uncertainty.standard_error().unwrap_or(0.0);
    (value, vec![Component::normal(Source::MonteCarlo, error, uncertainty.degrees_of_freedom())])
}

/// Draws the error of rounding a value to two decimals.
fn draw_rounding_error(random: &mut fastrand::Rng) -> (f64, Vec<Component>) {
    let value = 2.0 + random.f64();
    let printed = (100.0 * value).round() / 100.0;
    (value - printed, vec![Component::within(Source::Rounding, 0.005)])
}

/// Draws a number evenly within a bound of either sign.
fn draw_within(random: &mut fastrand::Rng, bound: f64) -> f64 {
    bound * (2.0 * random.f64() - 1.0)
}

/// Checks every kind of uncertainty.
pub fn calibrations(seed: u64) -> Calibrations {
    let mut intervals = vec![];
    for (k, (kind, sampler)) in KINDS.iter().enumerate() {
        // Each kind has its own sequence, so that a new kind does not change the others.
        let random = fastrand::Rng::with_seed(seed.wrapping_add(k as u64));
        intervals.push(check_kind(kind, *sampler, random));
    }
    Calibrations { intervals }
}

/// Checks one kind of uncertainty.
fn check_kind(kind: &str, sampler: ErrorSampler, mut random: fastrand::Rng) -> Interval {
    let mut p_values = vec![];
    for _ in 0..P_VALUES {
        let (error, components) = sampler(&mut random);
        p_values.push(error_budget::p_value(&error_budget::budget(components, 0.02), error, 0.0));
    }
    p_values.sort_by(f64::total_cmp);
    let ks_statistic = distance_from_uniform(&p_values);
    Interval {
        kind: kind.to_owned(),
        ks_p: kolmogorov_p(ks_statistic, P_VALUES),
        ks_statistic,
        coverage: NOMINAL_COVERAGES.map(|nominal| measure_coverage(sampler, nominal, &mut random)).to_vec(),
        p_values: p_values.into_iter().map(|p| (1e6 * p).round() / 1e6).collect(),
    }
}

/// Counts the intervals that contain the truth.
fn measure_coverage(sampler: ErrorSampler, nominal: f64, random: &mut fastrand::Rng) -> Coverage {
    let mut covered = 0;
    for _ in 0..INTERVALS {
        let (error, components) = sampler(random);
        let budget = error_budget::budget(components, 0.5 * (1.0 - nominal));
        covered += usize::from(error.abs() <= budget.expanded);
    }
    Coverage { nominal, found: covered as f64 / INTERVALS as f64 }
}

/// Kolmogorov's statistic: the largest distance of sorted values from a uniform distribution.
fn distance_from_uniform(sorted: &[f64]) -> f64 {
    let n = sorted.len() as f64;
    // The empirical distribution jumps at each value, so both of its sides count.
    let distances = sorted.iter().enumerate().map(|(k, p)| ((k + 1) as f64 / n - p).max(p - k as f64 / n));
    distances.fold(0.0, f64::max)
}

/// The probability of a larger distance from a uniform distribution by chance (Stephens 1970).
fn kolmogorov_p(distance: f64, count: usize) -> f64 {
    let root = (count as f64).sqrt();
    let x = (root + 0.12 + 0.11 / root) * distance;
    // Below this the series converges slowly, and its value is 1.
    if x < 0.2 {
        return 1.0;
    }
    let terms = (1..=100).map(|k: i32| {
        let sign = if k % 2 == 1 { 2.0 } else { -2.0 };
        sign * (-2.0 * f64::from(k * k) * x * x).exp()
    });
    terms.sum::<f64>().clamp(0.0, 1.0)
}

/// Parts in percent as cells of a Markdown table.
fn format_parts(parts: impl Iterator<Item = f64>) -> String {
    parts.map(|part| format!("{:.2} %", 100.0 * part)).join(" | ")
}

impl fmt::Display for Calibrations {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let heads = format_parts(NOMINAL_COVERAGES.into_iter());
        writeln!(f, "| uncertainty | | p-values uniform: Kolmogorov's p | {heads} |")?;
        writeln!(f, "|---|---|---|{}", "---|".repeat(NOMINAL_COVERAGES.len()))?;
        for interval in &self.intervals {
            let found = format_parts(interval.coverage.iter().map(|c| c.found));
            let mark = if interval.is_good() { "ok" } else { "OFF" };
            writeln!(f, "| {} | {mark} | {:.2} | {found} |", interval.kind, interval.ks_p)?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const COMMITTED: &str = include_str!("../../../../benchmarks/calibration.json");

    #[test]
    fn p_values_are_uniform_and_intervals_cover_what_they_say_as_the_committed_data_do() {
        let found = calibrations(1);
        assert!(found.is_good(), "{found}");
        let committed: Calibrations = serde_json::from_str(COMMITTED).unwrap();
        assert_eq!(found.intervals.len(), committed.intervals.len());
        assert!(
            found.intervals.iter().zip(&committed.intervals).all(|(a, b)| is_same(a, b)),
            "benchmarks/calibration.json is out of date: luxproof selftest --calibration --format json > benchmarks/calibration.json"
        );
    }

    /// Whether two results differ only by rounding.
    fn is_same(a: &Interval, b: &Interval) -> bool {
        a.kind == b.kind
            && (a.ks_p - b.ks_p).abs() < 1e-6
            && a.coverage.iter().zip(&b.coverage).all(|(x, y)| (x.found - y.found).abs() < 1e-3)
    }

    #[test]
    fn wrong_p_values_are_detected() {
        let uniform: Vec<f64> = (0..P_VALUES).map(|k| (k as f64 + 0.5) / P_VALUES as f64).collect();
        assert!(kolmogorov_p(distance_from_uniform(&uniform), P_VALUES) > 0.99);
        // These standard errors are a fifth too small.
        let mut random = fastrand::Rng::with_seed(1);
        let budget = error_budget::budget(vec![Component::normal(Source::MonteCarlo, 0.8, None)], 0.02);
        let wrong = (0..P_VALUES)
            .map(|_| error_budget::p_value(&budget, normal(&mut random), 0.0))
            .sorted_by(f64::total_cmp)
            .collect_vec();
        assert!(kolmogorov_p(distance_from_uniform(&wrong), P_VALUES) < MIN_KS_P);
    }

    #[test]
    fn kolmogorovs_distribution_has_its_tabled_quantiles() {
        // 1.358 at 5 % and 1.628 at 1 %, for large samples.
        for (x, p) in [(1.358, 0.05), (1.628, 0.01)] {
            let count = 1_000_000;
            assert!((kolmogorov_p(x / (count as f64).sqrt(), count) - p).abs() < 5e-4);
        }
    }
}
