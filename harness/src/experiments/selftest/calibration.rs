//! Are the verdicts' intervals and p-values what they say? Errors drawn as each kind of uncertainty has them, judged like readings.
//!
//! With no fault a p-value is as likely to lie anywhere between 0 and 1 (Kolmogorov's test; Stephens, J. Roy. Statist. Soc. B 32, 1970),
//! and an interval of 95 % holds the truth in 95 of 100 cases. That is shown for every component of an error budget alone, as it
//! comes, and for all of them together.

use std::fmt;

use itertools::Itertools;
use serde::{Deserialize, Serialize};

use crate::judge::{Component, ErrorBudget, Source};
use crate::record::Estimate;
use crate::system::random::normal;

const RUNS: usize = 500;
const INTERVALS: usize = 10_000;
/// Coverages that are looked at; the one of the verdicts is that of two standard deviations of a normal distribution.
const NOMINAL: [f64; 5] = [0.5, 0.8, 0.9, 0.9545, 0.99];
const MIN_KS_P: f64 = 0.01;
/// How far coverage may lie from what it is said to be.
const COVERAGE_WITHIN: f64 = 0.02;
/// Independent blocks of an engine that has few.
const FEW: usize = 8;

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Calibrations {
    pub intervals: Vec<Interval>,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Interval {
    pub kind: String,
    /// P-values under no fault, in rising order: against rank over count they lie on the diagonal.
    pub p_values: Vec<f64>,
    /// Kolmogorov's statistic: their largest distance from the diagonal.
    pub ks_statistic: f64,
    /// The probability of a larger one by chance.
    pub ks_p: f64,
    pub coverage: Vec<Coverage>,
}

#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Coverage {
    pub nominal: f64,
    pub found: f64,
}

impl Calibrations {
    pub fn is_good(&self) -> bool {
        self.intervals.iter().all(Interval::is_good)
    }
}

impl Interval {
    pub fn is_good(&self) -> bool {
        let covers = |c: &Coverage| (c.found - c.nominal).abs() <= COVERAGE_WITHIN;
        self.ks_p > MIN_KS_P && self.coverage.iter().all(covers)
    }
}

/// Draws an error with the components that a budget would state of it.
type Draw = fn(&mut fastrand::Rng) -> (f64, Vec<Component>);

const KINDS: [(&str, Draw); 7] = [
    ("Monte Carlo, many blocks", |random| {
        (0.003 * normal(random), vec![Component::normal(Source::MonteCarlo, 0.003, None)])
    }),
    ("Monte Carlo, 8 blocks", |random| few_blocks(random, FEW)),
    ("Monte Carlo, 3 blocks", |random| few_blocks(random, 3)),
    ("discretisation", |random| (even(random, 0.002), vec![Component::within(Source::Discretisation, 0.002)])),
    ("reference, rounding", |random| rounded(random)),
    ("input: last digit of the table", |random| (even(random, 5e-4), vec![Component::within(Source::Input, 5e-4)])),
    ("all together", |random| {
        let (chance, mut components) = few_blocks(random, 2 * FEW);
        let (rounding, of_reference) = rounded(random);
        components.extend(of_reference);
        components.push(Component::within(Source::Input, 5e-4));
        components.push(Component::within(Source::Discretisation, 0.002));
        (chance + rounding + even(random, 5e-4) + even(random, 0.002), components)
    }),
];

/// The mean of a few noisy blocks, with the standard error that they themselves tell.
fn few_blocks(random: &mut fastrand::Rng, blocks: usize) -> (f64, Vec<Component>) {
    let values: Vec<f64> = (0..blocks).map(|_| 0.008 * normal(random)).collect();
    let Estimate { value, uncertainty } = Estimate::of_samples(&values);
    let error = uncertainty.standard_error().unwrap_or(0.0);
    (value, vec![Component::normal(Source::MonteCarlo, error, uncertainty.degrees_of_freedom())])
}

/// What rounding to two decimals does to a value of no special digits.
fn rounded(random: &mut fastrand::Rng) -> (f64, Vec<Component>) {
    let value = 2.0 + random.f64();
    let printed = (100.0 * value).round() / 100.0;
    (value - printed, vec![Component::within(Source::Rounding, 0.005)])
}

fn even(random: &mut fastrand::Rng, bound: f64) -> f64 {
    bound * (2.0 * random.f64() - 1.0)
}

pub fn calibrations(seed: u64) -> Calibrations {
    let of_kind = |(k, (kind, draw)): (usize, &(&str, Draw))| {
        let mut random = fastrand::Rng::with_seed(seed.wrapping_add(k as u64));
        let mut p_value = || {
            let (error, components) = draw(&mut random);
            ErrorBudget::new(components, 0.02).p_value(error, 0.0)
        };
        let p_values: Vec<f64> = (0..RUNS).map(|_| p_value()).sorted_by(f64::total_cmp).collect();
        let ks_statistic = distance_from_uniform(&p_values);
        Interval {
            kind: (*kind).to_owned(),
            ks_p: kolmogorov(ks_statistic, RUNS),
            ks_statistic,
            coverage: NOMINAL.iter().map(|nominal| coverage(*draw, *nominal, &mut random)).collect(),
            p_values: p_values.into_iter().map(|p| (1e6 * p).round() / 1e6).collect(),
        }
    };
    Calibrations { intervals: KINDS.iter().enumerate().map(of_kind).collect() }
}

fn coverage(draw: Draw, nominal: f64, random: &mut fastrand::Rng) -> Coverage {
    let holds = |_: &usize| {
        let (error, components) = draw(random);
        error.abs() <= ErrorBudget::new(components, 0.5 * (1.0 - nominal)).expanded
    };
    let held = (0..INTERVALS).filter(holds).count();
    Coverage { nominal, found: held as f64 / INTERVALS as f64 }
}

fn distance_from_uniform(sorted: &[f64]) -> f64 {
    let n = sorted.len() as f64;
    let at = |(k, p): (usize, &f64)| ((k + 1) as f64 / n - p).max(p - k as f64 / n);
    sorted.iter().enumerate().map(at).fold(0.0, f64::max)
}

fn kolmogorov(distance: f64, count: usize) -> f64 {
    let root = (count as f64).sqrt();
    let x = (root + 0.12 + 0.11 / root) * distance;
    // Below this the series converges slowly, to 1.
    if x < 0.2 {
        return 1.0;
    }
    let term = |k: i32| (if k % 2 == 1 { 2.0 } else { -2.0 }) * (-2.0 * f64::from(k * k) * x * x).exp();
    (1..=100).map(term).sum::<f64>().clamp(0.0, 1.0)
}

impl fmt::Display for Calibrations {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let cells = |shares: &mut dyn Iterator<Item = f64>| {
            shares.map(|share| format!("{:.2} %", 100.0 * share)).collect::<Vec<_>>().join(" | ")
        };
        let heads = cells(&mut NOMINAL.into_iter());
        writeln!(f, "| uncertainty | | p-values uniform: Kolmogorov's p | {heads} |")?;
        writeln!(f, "|---|---|---|{}", "---|".repeat(NOMINAL.len()))?;
        for interval in &self.intervals {
            let found = cells(&mut interval.coverage.iter().map(|c| c.found));
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
        let same = |a: &Interval, b: &Interval| {
            a.kind == b.kind
                && (a.ks_p - b.ks_p).abs() < 1e-6
                && a.coverage.iter().zip(&b.coverage).all(|(x, y)| (x.found - y.found).abs() < 1e-3)
        };
        assert_eq!(found.intervals.len(), committed.intervals.len());
        assert!(
            found.intervals.iter().zip(&committed.intervals).all(|(a, b)| same(a, b)),
            "benchmarks/calibration.json is out of date: luxproof selftest --calibration --format json > benchmarks/calibration.json"
        );
    }

    #[test]
    fn wrong_p_values_are_seen() {
        let uniform: Vec<f64> = (0..RUNS).map(|k| (k as f64 + 0.5) / RUNS as f64).collect();
        assert!(kolmogorov(distance_from_uniform(&uniform), RUNS) > 0.99);
        // Standard errors that are a fifth too small.
        let mut random = fastrand::Rng::with_seed(1);
        let budget = ErrorBudget::new(vec![Component::normal(Source::MonteCarlo, 0.8, None)], 0.02);
        let wrong = (0..RUNS).map(|_| budget.p_value(normal(&mut random), 0.0)).sorted_by(f64::total_cmp).collect_vec();
        assert!(kolmogorov(distance_from_uniform(&wrong), RUNS) < MIN_KS_P);
    }

    #[test]
    fn kolmogorovs_distribution_has_its_tabled_quantiles() {
        // 1.358 at 5 % and 1.628 at 1 %, for large samples.
        for (x, p) in [(1.358, 0.05), (1.628, 0.01)] {
            let count = 1_000_000;
            assert!((kolmogorov(x / (count as f64).sqrt(), count) - p).abs() < 5e-4);
        }
    }
}
