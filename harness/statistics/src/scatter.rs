//! How repeated readings scatter, relative to their stated errors.
//!
//! The stated errors are estimates from few samples themselves, so both sides of each ratio vary.

use statrs::distribution::{Binomial, ChiSquared, ContinuousCDF, DiscreteCDF, StudentsT};

use luxproof_model::{Estimate, ROUNDING};

/// Degrees of freedom of stated errors that a group of meters needs. With fewer in the denominator a ratio of variances has no
/// useful mean.
const MIN_GROUP_FREEDOM: f64 = 20.0;
/// With no more degrees of freedom than this a ratio of variances has no useful variance.
const MIN_RATIO_FREEDOM: f64 = 6.0;
/// Scatters are pooled where a common size is at least this probable.
const COMMON_SIZE_P: f64 = 0.05;
/// How often a meter with normal readings has one that counts as an outlier.
const OUTLIER_P: f64 = 0.05;
/// Tails are heavy where as many outliers have a smaller probability than this.
const HEAVY_TAILS_P: f64 = 0.005;
/// Tails are normal where as many outliers have at least this probability.
const NORMAL_TAILS_P: f64 = 0.1;
/// The fewest meters that can show normal tails. A heavy tail that matters shows in one of five meters.
const MIN_METERS_FOR_NORMAL: u64 = 20;
/// Degrees of freedom of a stated error that names none.
pub(crate) const UNSTATED_FREEDOM: f64 = 1e6;

/// The scatter of many meters: a sum that is chi-squared with `freedom` degrees of freedom if the stated errors are right.
pub(crate) struct PooledScatter {
    pub sum: f64,
    pub freedom: f64,
    /// Degrees of freedom of the readings, as if the stated errors were known exactly.
    pub readings_freedom: f64,
    /// Deviations from the meter's mean in units of its standard error, by draw. Only meters with every draw are included.
    pub deviates: Vec<Vec<f64>>,
}

/// One reading with a stated error.
struct StatedReading {
    value: f64,
    variance: f64,
    /// Degrees of freedom of the stated variance.
    freedom: f64,
}

impl StatedReading {
    /// `None` where no standard error is stated, or zero.
    fn from_estimate(estimate: &Estimate) -> Option<Self> {
        let error = estimate.uncertainty.standard_error().filter(|e| *e > 0.0)?;
        let freedom = estimate.uncertainty.degrees_of_freedom().unwrap_or(UNSTATED_FREEDOM);
        Some(Self { value: estimate.value, variance: error.powi(2), freedom })
    }
}

/// The squared deviations of one meter's readings.
struct MeterSquares {
    /// Their sum over the squared mean of the readings.
    squares: f64,
    /// What the stated errors predict for `squares`.
    expected: f64,
    /// Degrees of freedom of `squares`, after Welch and Satterthwaite.
    freedom: f64,
    /// Degrees of freedom of `expected`, likewise.
    expected_freedom: f64,
    /// The deviation of each reading, in standard errors.
    deviates: Vec<f64>,
}

impl MeterSquares {
    /// `None` of fewer than two readings, and where a figure is not finite.
    fn from_readings(stated: &[StatedReading]) -> Option<Self> {
        let n = stated.len() as f64;
        if stated.len() < 2 {
            return None;
        }
        let mean = stated.iter().map(|r| r.value).sum::<f64>() / n;
        let squares: f64 = stated.iter().map(|r| (r.value - mean).powi(2)).sum();
        let all: f64 = stated.iter().map(|r| r.variance).sum();
        let expected = (1.0 - 1.0 / n) * all;
        let fourth: f64 = stated.iter().map(|r| r.variance * r.variance).sum();
        let freedom = expected.powi(2) / (fourth * (1.0 - 2.0 / n) + (all / n).powi(2));
        let expected_freedom = all.powi(2) / stated.iter().map(|r| r.variance * r.variance / r.freedom).sum::<f64>();
        let deviates = stated.iter().map(|r| (r.value - mean) / (expected / (n - 1.0)).sqrt()).collect();
        // Relative to the mean, so that bright meters do not outweigh dark ones.
        let (squares, expected) = (squares / mean.powi(2), expected / mean.powi(2));
        let is_sound = squares.is_finite() && expected.is_normal() && freedom.is_finite();
        is_sound.then_some(Self { squares, expected, freedom, expected_freedom, deviates })
    }
}

/// The mean value of readings.
pub(crate) fn mean_value(readings: &[Estimate]) -> f64 {
    readings.iter().map(|e| e.value).sum::<f64>() / readings.len() as f64
}

/// Pools the scatter of meters, one list of readings a meter. `None` where no meter has two readings with stated errors.
///
/// The variance of readings over the mean of stated variances is F. Its denominator has the stated degrees of freedom of all
/// readings. Meters with few of them are grouped. The F of all groups are added, less their bias. Their sum is compared with the
/// chi-squared distribution of the same mean and variance.
pub(crate) fn pool_repeated(meters: &[Vec<Estimate>]) -> Option<PooledScatter> {
    let draws = meters.iter().map(Vec::len).max()?;
    let mut deviates = vec![vec![]; draws];
    let mut groups: Vec<Vec<MeterSquares>> = vec![vec![]];
    for readings in meters {
        let stated: Vec<StatedReading> = readings.iter().filter_map(StatedReading::from_estimate).collect();
        let Some(meter) = MeterSquares::from_readings(&stated) else { continue };
        if meter.deviates.len() == draws {
            deviates.iter_mut().zip(&meter.deviates).for_each(|(draw, z)| draw.push(*z));
        }
        if groups.last().is_some_and(|last| group_freedom(last, |m| m.expected_freedom) >= MIN_GROUP_FREEDOM) {
            groups.push(vec![]);
        }
        groups.last_mut()?.push(meter);
    }
    // The last meters may be too few for a group, so they join the one before.
    let is_last_small =
        groups.last().is_some_and(|last| group_freedom(last, |m| m.expected_freedom) < MIN_GROUP_FREEDOM);
    if groups.len() > 1 && is_last_small {
        let rest = groups.pop()?;
        groups.last_mut()?.extend(rest);
    }
    let (mut sum, mut freedom, mut variance) = (0.0, 0.0, 0.0);
    for group in &groups {
        let above = group_freedom(group, |m| m.freedom);
        let below = group_freedom(group, |m| m.expected_freedom);
        if below <= MIN_RATIO_FREEDOM {
            return None;
        }
        let ratio = group.iter().map(|m| m.squares).sum::<f64>() / group.iter().map(|m| m.expected).sum::<f64>();
        // Mean and variance of F: M. Abramowitz and I. Stegun, 26.6.
        sum += above * ratio * (below - 2.0) / below;
        freedom += above;
        variance += 2.0 * above * (above + below - 2.0) / (below - 4.0);
    }
    // Match mean and variance of a scaled chi-squared distribution.
    let effective = 2.0 * freedom * freedom / variance;
    let scatter =
        PooledScatter { sum: sum * effective / freedom, freedom: effective, readings_freedom: freedom, deviates };
    (scatter.sum.is_finite() && effective > 0.0).then_some(scatter)
}

/// Degrees of freedom of a group's sum, from those of its meters (Welch and Satterthwaite).
fn group_freedom(group: &[MeterSquares], freedom: impl Fn(&MeterSquares) -> f64) -> f64 {
    let all: f64 = group.iter().map(|m| m.expected).sum();
    all.powi(2) / group.iter().map(|m| m.expected.powi(2) / freedom(m)).sum::<f64>()
}

/// How the readings of a single meter scatter.
pub(crate) struct MeterScatter {
    /// Standard deviation relative to the mean.
    pub relative: f64,
    pub freedom: f64,
    /// Scatter over the geometric mean of the stated errors; infinite where none is stated.
    pub ratio: f64,
    /// The probability of so little scatter if the stated errors are right.
    pub p_value: f64,
}

impl MeterScatter {
    /// Measures the scatter of at least three readings of one meter with different seeds.
    ///
    /// The reference is the geometric mean of the stated variances. The density of a normal reading near the mean varies
    /// inversely with its standard error, so readings come no closer together than those of that one variance.
    /// Few degrees of freedom and heavy tails make the geometric mean too small. So the probability is never too small, and one
    /// large error excuses nothing.
    pub(crate) fn from_readings(readings: &[Estimate]) -> Option<Self> {
        let stated = readings.iter().filter_map(|e| e.uncertainty.standard_error()).filter(|e| *e > 0.0);
        let logs: Vec<f64> = stated.map(|e| 2.0 * e.ln()).collect();
        let freedom = readings.len().checked_sub(1).filter(|n| *n > 1)? as f64;
        // Readings without a stated error count here: samples that met nothing scatter too.
        let mean = mean_value(readings);
        let squares: f64 = readings.iter().map(|e| (e.value - mean).powi(2)).sum();
        let over = if logs.is_empty() {
            f64::INFINITY
        } else {
            squares / (logs.iter().sum::<f64>() / logs.len() as f64).exp()
        };
        let p_value = if over.is_finite() { ChiSquared::new(freedom).ok()?.cdf(over) } else { 1.0 };
        let relative = (squares / freedom).sqrt() / mean.abs();
        let scatter = Self { relative, freedom, ratio: (over / freedom).sqrt(), p_value };
        (relative.is_finite() && !over.is_nan()).then_some(scatter)
    }

    /// Compares with this relative standard error where the readings state none.
    pub(crate) fn against(self, counts: Option<f64>) -> Self {
        let Some(counts) = counts.filter(|_| self.ratio.is_infinite()) else { return self };
        let ratio = self.relative / counts;
        let p_value = ChiSquared::new(self.freedom).map_or(1.0, |chance| chance.cdf(self.freedom * ratio * ratio));
        Self { ratio, p_value, ..self }
    }
}

/// Pools ratios of scatter to stated error, given with their degrees of freedom; the result has the freedom of all.
///
/// `None` where M. S. Bartlett's test finds them of different size (Proc. R. Soc. Lond. A 160 (1937)).
pub(crate) fn pool_scatters(ratios: &[(f64, f64)]) -> Option<(f64, f64)> {
    let freedom: f64 = ratios.iter().map(|(_, f)| f).sum();
    let square = ratios.iter().map(|(r, f)| f * r * r).sum::<f64>() / freedom;
    let difference = freedom * square.ln() - ratios.iter().map(|(r, f)| f * (r * r).ln()).sum::<f64>();
    let others = ratios.len() as f64 - 1.0;
    let correction = 1.0 + (ratios.iter().map(|(_, f)| f.recip()).sum::<f64>() - freedom.recip()) / (3.0 * others);
    let chance = ChiSquared::new(others).ok()?;
    (chance.sf(difference / correction) > COMMON_SIZE_P).then_some((square.sqrt(), freedom))
}

/// Whether repeated readings are equal, whatever the first one is, which stands last and had more samples.
pub(crate) fn ignores_seed(readings: &[Estimate]) -> bool {
    let Some((_, repeated)) = readings.split_last() else { return false };
    repeated.len() > 1 && repeated.windows(2).all(|pair| pair[0].value == pair[1].value)
}

/// What readings with different seeds show of the tails of their distribution.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Tails {
    /// Outliers are as rare as those of a normal distribution.
    Normal,
    /// Outliers are more frequent: a few samples hold much of the light.
    Heavy,
    /// There are too few readings to decide.
    Unknown,
}

impl Tails {
    /// Classifies the readings of meters, one list a meter.
    ///
    /// It counts the meters with an outlier by F. E. Grubbs' test (Technometrics 11 (1969)), and those skewed to the bright
    /// side. The noise of a few samples that hold much of the light is skewed to that side.
    pub fn of(meters: &[Vec<Estimate>]) -> Self {
        let random = meters.iter().filter(|m| !ignores_seed(m));
        let judged: Vec<ReadingShape> = random.filter_map(|m| ReadingShape::from_readings(m)).collect();
        let n = judged.len() as u64;
        let with_outlier = judged.iter().filter(|shape| shape.has_outlier).count() as u64;
        let skewed = judged.iter().filter(|shape| shape.is_skewed).count() as u64;
        let outliers_p = binomial_at_least(OUTLIER_P, n, with_outlier);
        let skewed_p = binomial_at_least(0.5, n, skewed);
        if outliers_p < HEAVY_TAILS_P {
            Self::Heavy
        } else if outliers_p.min(skewed_p) < NORMAL_TAILS_P || n < MIN_METERS_FOR_NORMAL {
            Self::Unknown
        } else {
            Self::Normal
        }
    }
}

/// The probability of at least `k` successes in `n` trials.
fn binomial_at_least(success: f64, n: u64, k: u64) -> f64 {
    let chance = Binomial::new(success, n).ok();
    k.checked_sub(1).zip(chance).map_or(1.0, |(fewer, chance)| chance.sf(fewer))
}

/// The shape of a meter's readings about their mean.
struct ReadingShape {
    /// One reading lies far from the others.
    has_outlier: bool,
    /// The third powers of the deviations have a positive sum.
    is_skewed: bool,
}

impl ReadingShape {
    /// `None` where readings are too few, or equal except for rounding.
    fn from_readings(readings: &[Estimate]) -> Option<Self> {
        let n = readings.len() as f64;
        let mean = mean_value(readings);
        let deviations: Vec<f64> = readings.iter().map(|e| e.value - mean).collect();
        let deviation = (deviations.iter().map(|d| d * d).sum::<f64>() / (n - 1.0)).sqrt();
        if readings.len() < 4 || deviation <= ROUNDING * mean.abs() {
            return None;
        }
        // Grubbs' critical value for the largest deviation on either side.
        let t = StudentsT::new(0.0, 1.0, n - 2.0).ok()?.inverse_cdf(1.0 - OUTLIER_P / (2.0 * n));
        let critical = (n - 1.0) / n.sqrt() * (t * t / (n - 2.0 + t * t)).sqrt();
        let farthest = deviations.iter().map(|d| d.abs()).fold(0.0, f64::max);
        Some(Self {
            has_outlier: farthest > critical * deviation,
            is_skewed: deviations.iter().map(|d| (d / deviation).powi(3)).sum::<f64>() > 0.0,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use luxproof_process::random::normal;

    /// How often of 300 engines that read 24 meters with four seeds the tails are normal, and heavy.
    fn count_tails(reading: impl Fn(&mut fastrand::Rng) -> f64) -> (usize, usize) {
        let (mut normal_tails, mut heavy) = (0, 0);
        for seed in 0..300 {
            let mut random = fastrand::Rng::with_seed(seed);
            let mut meters = vec![];
            for _ in 0..24 {
                meters.push((0..4).map(|_| Estimate::exact(reading(&mut random))).collect::<Vec<Estimate>>());
            }
            match Tails::of(&meters) {
                Tails::Normal => normal_tails += 1,
                Tails::Heavy => heavy += 1,
                Tails::Unknown => {}
            }
        }
        (normal_tails, heavy)
    }

    /// A tenth of the readings have 50 more.
    fn rare_hit(random: &mut fastrand::Rng) -> f64 {
        if random.f64() < 0.1 { 50.0 } else { 0.0 }
    }

    #[test]
    fn normal_readings_have_normal_tails_and_a_few_large_samples_a_heavy_one() {
        let (normal_tails, heavy) = count_tails(|random| 100.0 + normal(random));
        assert!(heavy <= 6 && normal_tails > 200, "{normal_tails}, {heavy} of 300");
        let (normal_tails, _) = count_tails(|random| 95.0 + 0.5 * normal(random) + rare_hit(random));
        assert!(normal_tails <= 12, "{normal_tails} of 300");
        // Means of eight lognormal samples with sigma 2.
        let (normal_tails, _) = count_tails(|random| (0..8).map(|_| (2.0 * normal(random)).exp()).sum());
        assert!(normal_tails <= 20, "{normal_tails} of 300");
        let few: Vec<Vec<Estimate>> =
            (0..5).map(|k| (0..4).map(|n| Estimate::exact(f64::from(k * n))).collect()).collect();
        assert_eq!(Tails::of(&few), Tails::Unknown);
    }

    #[test]
    fn scatters_of_one_size_are_pooled() {
        let (ratio, freedom) = pool_scatters(&[(1.0, 6.0), (1.2, 6.0), (0.8, 6.0)]).unwrap();
        assert!((ratio - (3.08_f64 / 3.0).sqrt()).abs() < 1e-12 && freedom == 18.0);
        assert_eq!(pool_scatters(&[(1.0, 6.0), (100.0, 6.0)]), None);
        assert_eq!(pool_scatters(&[(1.0, 6.0)]), None);
        assert_eq!(pool_scatters(&[(1.0, 6.0), (0.0, 6.0)]), None);
    }

    #[test]
    fn bartletts_test_has_its_correction_for_few_degrees_of_freedom() {
        // By `tests/values.py` the probabilities are .054 and .046; without the correction .036 and .030.
        assert!(pool_scatters(&[(1.0, 3.0), (2.0, 3.0), (4.6, 4.0)]).is_some());
        assert!(pool_scatters(&[(1.0, 3.0), (2.0, 3.0), (4.8, 4.0)]).is_none());
    }

    #[test]
    fn squares_of_readings_with_unequal_errors_have_fewer_degrees_of_freedom() {
        // Variances of 1, 1 and 4: the squares about the mean are X + 3 Y, both chi-squared with one degree of freedom. Their mean
        // is 4 and their variance 20, so that they have 2 * 4^2 / 20 degrees of freedom.
        let readings = [(9.0, 1.0), (10.0, 1.0), (11.0, 4.0)];
        let stated = readings.map(|(value, variance)| StatedReading { value, variance, freedom: 7.0 });
        let found = MeterSquares::from_readings(&stated).unwrap();
        assert!((found.freedom - 1.6).abs() < 1e-12 && (found.expected - 0.04).abs() < 1e-12, "{}", found.freedom);
        // The stated variances have 7 degrees of freedom each: 7 * 6^2 / 18.
        assert!((found.expected_freedom - 14.0).abs() < 1e-12, "{}", found.expected_freedom);
    }

    #[test]
    fn the_scatter_of_a_meter_is_chi_squared_over_the_stated_variance() {
        // Deviations of .1, -.3 and .2 have squares of .14; with 2 degrees of freedom chi-squared is exponential.
        let uncertainty = luxproof_model::Uncertainty::sampled(2.0, None);
        let readings = [10.1, 9.7, 10.2].map(|value| Estimate { value, uncertainty });
        let found = MeterScatter::from_readings(&readings).unwrap();
        assert!((found.p_value - (1.0 - (-0.14_f64 / 4.0 / 2.0).exp())).abs() < 1e-9);
        assert!((found.ratio - (0.14_f64 / 4.0 / 2.0).sqrt()).abs() < 1e-12);
        assert!((found.relative - 0.07_f64.sqrt() / 10.0).abs() < 1e-12 && found.freedom == 2.0);
        assert!(MeterScatter::from_readings(&readings[..2]).is_none());
        // Without a stated error the scatter is compared with the relative error that counts.
        let bare = readings.map(|r| Estimate::exact(r.value));
        let against = MeterScatter::from_readings(&bare).unwrap().against(Some(0.2));
        assert!((against.ratio - found.ratio).abs() < 1e-12 && (against.p_value - found.p_value).abs() < 1e-9);
    }

    #[test]
    fn an_outlier_is_one_by_the_table_of_grubbs() {
        // Critical value at 5 % (two-sided) of four readings: 1.481 (F. E. Grubbs and G. Beck, Technometrics 14 (1972)).
        // Of -e, 0, e and x = 1 the largest deviation is .75 over the root of (2 e^2 + .75) / 3.
        for (e, has_outlier) in [(0.05, true), (0.15, false)] {
            let g = 0.75 / f64::sqrt((2.0 * e * e + 0.75) / 3.0);
            assert_eq!(g > 1.481, has_outlier, "{g}");
            let readings = [10.0 - e, 10.0, 10.0 + e, 11.0].map(Estimate::exact);
            let shape = ReadingShape::from_readings(&readings).unwrap();
            assert!(shape.has_outlier == has_outlier && shape.is_skewed, "{e}");
        }
        let dark_side = [10.0, 10.0, 10.0, 9.0].map(Estimate::exact);
        assert!(!ReadingShape::from_readings(&dark_side).unwrap().is_skewed);
    }
}
