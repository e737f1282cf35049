//! How repeated readings scatter, over what is stated of their errors, which itself is estimated from few samples.

use statrs::distribution::{Binomial, ChiSquared, ContinuousCDF, DiscreteCDF, StudentsT};

use super::{Estimate, ROUNDING};

/// Degrees of freedom of stated errors that are put together before readings are held against them: a ratio of variances with fewer below
/// has hardly a mean.
const ENOUGH: f64 = 20.0;
/// Fewer than these have no variance of such a ratio at all.
const LEAST: f64 = 6.0;
/// Scatters are put together where it is no less probable that they are of one size.
const ALIKE: f64 = 0.05;
/// How often a meter whose readings are normal has one that is called an outlier.
const OUTLIER: f64 = 0.05;
/// So many of them are less probable than this: their tails are heavy.
const TOO_MANY: f64 = 0.005;
/// So many are no less probable than this: their tails are normal.
const ENOUGH_BY_CHANCE: f64 = 0.1;
/// The fewest meters that show normal tails: a heavy one that matters would have told itself in one of five.
const TELLING: u64 = 20;
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
    /// Over the geometric mean of what is stated; infinite where nothing is.
    pub(super) ratio: f64,
    /// The probability of so little, were the stated errors right.
    pub(super) p_value: f64,
}

impl Alone {
    /// Over this relative standard error, where its readings state none.
    pub(super) fn against(self, counts: Option<f64>) -> Self {
        let Some(counts) = counts.filter(|_| self.ratio.is_infinite()) else { return self };
        let ratio = self.relative / counts;
        let p_value = ChiSquared::new(self.freedom).map_or(1.0, |chance| chance.cdf(self.freedom * ratio * ratio));
        Self { ratio, p_value, ..self }
    }
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
    let over =
        if logs.is_empty() { f64::INFINITY } else { squares / (logs.iter().sum::<f64>() / logs.len() as f64).exp() };
    let p_value = if over.is_finite() { ChiSquared::new(freedom).ok()?.cdf(over) } else { 1.0 };
    let relative = (squares / freedom).sqrt() / mean.abs();
    let alone = Alone { relative, freedom, ratio: (over / freedom).sqrt(), p_value };
    (relative.is_finite() && !over.is_nan()).then_some(alone)
}

/// Of what readings with other seeds scatter by, over what is stated of each meter: together, where they are alike by M. S. Bartlett's test
/// (Proc. R. Soc. Lond. A 160 (1937)); with the degrees of freedom of all.
pub(super) fn alike(ratios: &[(f64, f64)]) -> Option<(f64, f64)> {
    let freedom: f64 = ratios.iter().map(|(_, f)| f).sum();
    let square = ratios.iter().map(|(r, f)| f * r * r).sum::<f64>() / freedom;
    let apart = freedom * square.ln() - ratios.iter().map(|(r, f)| f * (r * r).ln()).sum::<f64>();
    let others = ratios.len() as f64 - 1.0;
    let correction = 1.0 + (ratios.iter().map(|(_, f)| f.recip()).sum::<f64>() - freedom.recip()) / (3.0 * others);
    let chance = ChiSquared::new(others).ok()?;
    (chance.sf(apart / correction) > ALIKE).then_some((square.sqrt(), freedom))
}

/// What readings with other seeds show of the tails that they are from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Tails {
    /// As few lie far from the others of their meter as of a normal distribution.
    Normal,
    /// More do: a few samples hold much of the light.
    Heavy,
    /// They are too few to tell.
    Unknown,
}

impl Tails {
    /// Of readings of meters, one list a meter: how many have one that F. E. Grubbs would call an outlier (Technometrics 11 (1969)), and how
    /// many are skewed to the one side: noise of a few samples that hold much of the light is, towards more.
    pub fn of(meters: &[Vec<Estimate>]) -> Self {
        let judged: Vec<Spread> = meters.iter().filter_map(|readings| spread(readings)).collect();
        let n = judged.len() as u64;
        let count = |is: fn(&Spread) -> bool| judged.iter().filter(|one| is(one)).count() as u64;
        let at_least = |of: f64, k: u64| {
            let chance = Binomial::new(of, n).ok();
            k.checked_sub(1).zip(chance).map_or(1.0, |(fewer, chance)| chance.sf(fewer))
        };
        let outliers = at_least(OUTLIER, count(|one| one.has_outlier));
        let skewed = at_least(0.5, count(|one| one.is_skewed));
        if outliers < TOO_MANY {
            Self::Heavy
        } else if outliers.min(skewed) < ENOUGH_BY_CHANCE || n < TELLING {
            Self::Unknown
        } else {
            Self::Normal
        }
    }
}

/// How the readings of a meter lie about their mean.
struct Spread {
    /// One of them lies far from the others.
    has_outlier: bool,
    /// The third powers of their deviations have a positive sum.
    is_skewed: bool,
}

/// Nothing where readings are too few, or all one but for rounding.
fn spread(readings: &[Estimate]) -> Option<Spread> {
    let n = readings.len() as f64;
    let mean = readings.iter().map(|e| e.value).sum::<f64>() / n;
    let off = || readings.iter().map(|e| e.value - mean);
    let deviation = (off().map(|d| d * d).sum::<f64>() / (n - 1.0)).sqrt();
    if readings.len() < 4 || deviation <= ROUNDING * mean.abs() {
        return None;
    }
    let t = StudentsT::new(0.0, 1.0, n - 2.0).ok()?.inverse_cdf(1.0 - OUTLIER / (2.0 * n));
    let critical = (n - 1.0) / n.sqrt() * (t * t / (n - 2.0 + t * t)).sqrt();
    let farthest = off().map(f64::abs).fold(0.0, f64::max);
    Some(Spread {
        has_outlier: farthest > critical * deviation,
        is_skewed: off().map(|d| (d / deviation).powi(3)).sum::<f64>() > 0.0,
    })
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::system::random::normal;

    /// How often of 300 engines that read 24 meters with four seeds the tails are called each: normal, heavy.
    fn called(reading: impl Fn(&mut fastrand::Rng) -> f64) -> (usize, usize) {
        let tails = |seed: u64| {
            let mut random = fastrand::Rng::with_seed(seed);
            let meter = |_| (0..4).map(|_| Estimate::exact(reading(&mut random))).collect();
            Tails::of(&(0..24).map(meter).collect::<Vec<Vec<Estimate>>>())
        };
        let all: Vec<Tails> = (0..300).map(tails).collect();
        let count = |wanted| all.iter().filter(|t| **t == wanted).count();
        (count(Tails::Normal), count(Tails::Heavy))
    }

    #[test]
    fn normal_readings_have_normal_tails_and_a_few_large_samples_a_heavy_one() {
        let (normal_tails, heavy) = called(|random| 100.0 + normal(random));
        assert!(heavy <= 6 && normal_tails > 200, "{normal_tails}, {heavy} of 300");
        let hits = |random: &mut fastrand::Rng| if random.f64() < 0.1 { 50.0 } else { 0.0 };
        let (normal_tails, _) = called(|random| 95.0 + 0.5 * normal(random) + hits(random));
        assert!(normal_tails <= 12, "{normal_tails} of 300");
        // Means of eight samples whose logarithms have a standard deviation of 2.
        let (normal_tails, _) = called(|random| (0..8).map(|_| (2.0 * normal(random)).exp()).sum());
        assert!(normal_tails <= 20, "{normal_tails} of 300");
        let few: Vec<Vec<Estimate>> =
            (0..5).map(|k| (0..4).map(|n| Estimate::exact(f64::from(k * n))).collect()).collect();
        assert_eq!(Tails::of(&few), Tails::Unknown);
    }

    #[test]
    fn scatters_of_one_size_are_put_together() {
        let (ratio, freedom) = alike(&[(1.0, 6.0), (1.2, 6.0), (0.8, 6.0)]).unwrap();
        assert!((ratio - (3.08_f64 / 3.0).sqrt()).abs() < 1e-12 && freedom == 18.0);
        assert_eq!(alike(&[(1.0, 6.0), (100.0, 6.0)]), None);
        assert_eq!(alike(&[(1.0, 6.0)]), None);
        assert_eq!(alike(&[(1.0, 6.0), (0.0, 6.0)]), None);
    }
}
