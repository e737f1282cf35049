//! How repeated readings scatter, over what is stated of their errors, which itself is estimated from few samples.

use statrs::distribution::{ChiSquared, ContinuousCDF};

use super::Estimate;

/// Degrees of freedom of stated errors that are put together before readings are held against them: a ratio of variances with fewer below
/// has hardly a mean.
const ENOUGH: f64 = 20.0;
/// Fewer than these have no variance of such a ratio at all.
const LEAST: f64 = 6.0;
/// Of a stated error that tells none.
pub(super) const MANY: f64 = 1e6;

/// A sum that would be chi-squared with `freedom` degrees of freedom, were the stated errors right.
pub(super) struct Scatter {
    pub(super) sum: f64,
    pub(super) freedom: f64,
    /// Degrees of freedom of the readings alone, were the stated errors known for certain.
    pub(super) of_readings: f64,
    /// By draw, of every meter that has them all: deviations from the meter's mean, in its standard errors.
    pub(super) deviates: Vec<Vec<f64>>,
}

/// How the readings of a meter scatter.
struct Meter {
    /// The sum of their squared deviations over their squared mean.
    squares: f64,
    /// What that would be, were the stated errors right.
    expected: f64,
    /// Degrees of freedom of both by Welch and Satterthwaite.
    freedom: f64,
    of_expected: f64,
}

/// Of readings of meters, one list a meter; nothing where none was read twice with a stated error.
///
/// The variance of readings over the mean of stated variances is F: its denominator has the degrees of freedom that are stated, all
/// readings' together. Meters whose own are few are put together. The F of all groups are added, less their bias, and their sum is held
/// against the chi-squared distribution of the same mean and variance.
pub(super) fn of_repeated(meters: &[Vec<Estimate>]) -> Option<Scatter> {
    let draws = meters.iter().map(Vec::len).max()?;
    let mut deviates = vec![vec![]; draws];
    let mut groups: Vec<Vec<Meter>> = vec![vec![]];
    for readings in meters {
        let error = |e: &Estimate| e.uncertainty.standard_error().filter(|e| *e > 0.0);
        let stated: Vec<(f64, f64, f64)> = readings
            .iter()
            .filter_map(|e| Some((e.value, error(e)?.powi(2), e.uncertainty.degrees_of_freedom().unwrap_or(MANY))))
            .collect();
        let Some((meter, of_each)) = of_meter(&stated) else { continue };
        if of_each.len() == draws {
            deviates.iter_mut().zip(of_each).for_each(|(draw, z)| draw.push(z));
        }
        if groups.last().is_some_and(|last| of_expected(last) >= ENOUGH) {
            groups.push(vec![]);
        }
        groups.last_mut()?.push(meter);
    }
    // The last ones may be too few for a group of their own.
    if groups.len() > 1 && groups.last().is_some_and(|last| of_expected(last) < ENOUGH) {
        let rest = groups.pop()?;
        groups.last_mut()?.extend(rest);
    }
    let (mut sum, mut freedom, mut variance) = (0.0, 0.0, 0.0);
    for group in &groups {
        let (above, below) = (of(group, |m| m.freedom), of_expected(group));
        if below <= LEAST {
            return None;
        }
        let ratio = group.iter().map(|m| m.squares).sum::<f64>() / group.iter().map(|m| m.expected).sum::<f64>();
        // Mean and variance of F: M. Abramowitz and I. Stegun, 26.6.
        sum += above * ratio * (below - 2.0) / below;
        freedom += above;
        variance += 2.0 * above * (above + below - 2.0) / (below - 4.0);
    }
    let effective = 2.0 * freedom * freedom / variance;
    let scatter = Scatter { sum: sum * effective / freedom, freedom: effective, of_readings: freedom, deviates };
    (scatter.sum.is_finite() && effective > 0.0).then_some(scatter)
}

/// How the readings of a single meter scatter.
pub(super) struct Alone {
    /// Relative to their mean.
    pub(super) relative: f64,
    pub(super) freedom: f64,
    /// Over the geometric mean of what is stated.
    pub(super) ratio: f64,
    /// The probability of so little, were the stated errors right.
    pub(super) p_value: f64,
}

/// Of three readings of one meter with other seeds, or more.
///
/// Normal readings come close together no more often than those of one variance do, the geometric mean of theirs: the density of each near
/// the mean goes by its standard error. Few degrees of freedom, and errors that vary as a heavy tail has it, make that mean smaller than
/// what is estimated. The probability is so never too small, and no single large error excuses anything.
pub(super) fn of_one(readings: &[Estimate]) -> Option<Alone> {
    let stated = readings.iter().filter_map(|e| e.uncertainty.standard_error()).filter(|e| *e > 0.0);
    let logs: Vec<f64> = stated.map(|e| 2.0 * e.ln()).collect();
    let (n, freedom) = (readings.len() as f64, readings.len().checked_sub(1).filter(|n| *n > 1)? as f64);
    // What met nothing states nothing, and scatters all the same.
    let mean = readings.iter().map(|e| e.value).sum::<f64>() / n;
    let squares: f64 = readings.iter().map(|e| (e.value - mean).powi(2)).sum();
    let over = squares / (logs.iter().sum::<f64>() / logs.len() as f64).exp();
    let p_value = ChiSquared::new(freedom).ok()?.cdf(over);
    let relative = (squares / freedom).sqrt() / mean.abs();
    let alone = Alone { relative, freedom, ratio: (over / freedom).sqrt(), p_value };
    (relative.is_finite() && over.is_finite()).then_some(alone)
}

/// Of readings with their stated variances and degrees of freedom.
fn of_meter(stated: &[(f64, f64, f64)]) -> Option<(Meter, Vec<f64>)> {
    let n = stated.len() as f64;
    if stated.len() < 2 {
        return None;
    }
    let mean = stated.iter().map(|(x, ..)| x).sum::<f64>() / n;
    let squares: f64 = stated.iter().map(|(x, ..)| (x - mean).powi(2)).sum();
    let all: f64 = stated.iter().map(|(_, v, _)| v).sum();
    let expected = (1.0 - 1.0 / n) * all;
    let fourth: f64 = stated.iter().map(|(_, v, _)| v * v).sum();
    let freedom = expected.powi(2) / (fourth * (1.0 - 2.0 / n) + (all / n).powi(2));
    let of_expected = all.powi(2) / stated.iter().map(|(_, v, n)| v * v / n).sum::<f64>();
    let of_each = stated.iter().map(|(x, ..)| (x - mean) / (expected / (n - 1.0)).sqrt()).collect();
    let (squares, expected) = (squares / mean.powi(2), expected / mean.powi(2));
    let meter = Meter { squares, expected, freedom, of_expected };
    (squares.is_finite() && expected.is_normal() && freedom.is_finite()).then_some((meter, of_each))
}

fn of_expected(group: &[Meter]) -> f64 {
    of(group, |m| m.of_expected)
}

/// Degrees of freedom of a sum by those of its parts.
fn of(group: &[Meter], freedom: impl Fn(&Meter) -> f64) -> f64 {
    let all: f64 = group.iter().map(|m| m.expected).sum();
    all.powi(2) / group.iter().map(|m| m.expected.powi(2) / freedom(m)).sum::<f64>()
}
