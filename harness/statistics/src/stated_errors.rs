//! Compares the errors that an engine states with how its readings scatter over seeds.

use std::collections::BTreeMap;
use std::iter::Sum;

use statrs::distribution::{ChiSquared, ContinuousCDF};

use crate::design_effect;
use crate::scatter::{
    MeterScatter, PooledScatter, Tails, UNSTATED_FREEDOM, ignores_seed, mean_value, pool_repeated, pool_scatters,
};
use luxproof_model::{ErrorFinding, Estimate, MeterId, ROUNDING, StatedErrors, Uncertainty};

/// Stated errors have a heavy tail if their variation is less probable than this. The level is low because the chi-squared
/// distribution only approximates how they vary.
const HEAVY_TAIL_P: f64 = 1e-4;
/// A scatter less probable than this, if the stated errors are right, is reported.
const REPORTED_P: f64 = 0.005;
/// A scatter less probable than this widens verdicts, whether reported or not: a Birge ratio (R. T. Birge, Phys. Rev. 40 (1932)).
const COUNTED_P: f64 = 0.05;
/// Degrees of freedom assumed for a standard error that states none. More would underestimate how much it may vary.
const MIN_UNSTATED_FREEDOM: f64 = 3.0;
/// Errors that vary as with fewer degrees of freedom come from samples that are not nearly normal. Eight blocks of exponential noise
/// vary as with three.
const MIN_NORMAL_FREEDOM: f64 = 3.0;
/// The fewest degrees of freedom that a standard error gets.
const MIN_FREEDOM: f64 = 0.5;
/// A procedure's errors are steadier than the engine's others where an equal variation is less probable than this.
const STEADIER_P: f64 = 0.003;
/// An error up to this many times too large is caution, and is not reported.
const MIN_EXCESS_RATIO: f64 = 3.0;

/// A meter where only a large error prevents a failure.
pub struct MeterPassingByErrorOnly {
    pub meter: MeterId,
    /// Readings with different seeds, including the judged one.
    pub readings: Vec<Estimate>,
    /// The relative standard error that prevents the failure; `None` where no sample met anything.
    pub counts: Option<f64>,
}

/// A meter with a stated error and its scatter.
struct StatedMeter<'a> {
    meter: &'a MeterPassingByErrorOnly,
    scatter: &'a MeterScatter,
    /// The stated relative standard error.
    counts: f64,
}

/// The scatter that counts for a meter.
struct ObservedScatter {
    relative: f64,
    freedom: f64,
}

impl ObservedScatter {
    /// The scatter of the meter's readings alone.
    const fn of_meter(scatter: &MeterScatter) -> Self {
        Self { relative: scatter.relative, freedom: scatter.freedom }
    }
}

/// The scatter of each reading of a meter, in units of the meter's scatter.
fn relative_deviates(stated: &StatedMeter<'_>) -> Vec<f64> {
    let mean = mean_value(&stated.meter.readings);
    stated.meter.readings.iter().map(|e| (e.value / mean - 1.0) / stated.scatter.relative).collect()
}

/// Pools the scatter of meters where it has the same ratio to the stated errors; `None` otherwise.
fn pool_meters(meters: &[StatedMeter<'_>]) -> Option<Vec<ObservedScatter>> {
    let ratios: Vec<(f64, f64)> = meters.iter().map(|m| (m.scatter.relative / m.counts, m.scatter.freedom)).collect();
    let (ratio, freedom) = pool_scatters(&ratios)?;
    let of_meters: Vec<Vec<f64>> = meters.iter().map(relative_deviates).collect();
    let draws = of_meters.iter().map(Vec::len).min()?;
    let by_draw: Vec<Vec<f64>> = (0..draws).map(|k| of_meters.iter().map(|z| z[k]).collect()).collect();
    // Meters that share their noise say less together than their number suggests.
    let freedom = freedom / design_effect(&by_draw);
    Some(meters.iter().map(|m| ObservedScatter { relative: ratio * m.counts, freedom }).collect())
}

/// Whether the scatter of one of so many meters is far below its stated error.
fn is_contradicted(scatter: &MeterScatter, meters: usize) -> bool {
    scatter.ratio < 1.0 / MIN_EXCESS_RATIO && scatter.p_value < REPORTED_P / meters as f64
}

/// Finds the meters with readings that scatter less than the error that prevents their failure.
///
/// Meters are pooled if their scatter has the same ratio to the stated errors. Under unknown tails only clearly contradicted errors are
/// reduced; under heavy tails none is.
pub fn of_sheltered(meters: &[MeterPassingByErrorOnly], tails: Tails) -> Vec<StatedErrors> {
    let scatters: Vec<(&MeterPassingByErrorOnly, MeterScatter)> =
        meters.iter().filter_map(|m| Some((m, MeterScatter::from_readings(&m.readings)?.against(m.counts)))).collect();
    // Meters where no sample met anything: equal readings with every seed are not sampled at all.
    let unseen = scatters.iter().filter(|(m, _)| m.counts.is_none() && tails != Tails::Heavy);
    let (constant, varying): (Vec<_>, Vec<_>) = unseen.partition(|(_, scatter)| scatter.relative <= ROUNDING);
    let stated: Vec<StatedMeter<'_>> = scatters
        .iter()
        .filter_map(|(meter, scatter)| Some(StatedMeter { meter, scatter, counts: meter.counts? }))
        .filter(|m| match tails {
            Tails::Normal => true,
            Tails::Unknown => is_contradicted(m.scatter, meters.len()),
            Tails::Heavy => false,
        })
        .collect();
    let is_reported = !stated.is_empty() && stated.iter().all(|m| is_contradicted(m.scatter, meters.len()));
    let observed =
        pool_meters(&stated).unwrap_or_else(|| stated.iter().map(|m| ObservedScatter::of_meter(m.scatter)).collect());
    let mut reduced: Vec<(&MeterPassingByErrorOnly, ObservedScatter)> = stated
        .iter()
        .zip(observed)
        .filter(|(m, observed)| observed.relative < m.counts)
        .map(|(m, observed)| (m.meter, observed))
        .collect();
    reduced.extend(varying.into_iter().map(|(meter, scatter)| (*meter, ObservedScatter::of_meter(scatter))));
    let degrees_of_freedom = reduced.iter().map(|(_, observed)| observed.freedom).fold(f64::INFINITY, f64::min);
    let at = reduced.into_iter().map(|(meter, observed)| (meter.meter.clone(), observed.relative)).collect();
    let narrower = StatedErrors::from_finding_at(ErrorFinding::TooLarge, at).map(|found| StatedErrors {
        degrees_of_freedom,
        finding: found.finding.filter(|_| is_reported),
        ..found
    });
    let constant = constant.into_iter().map(|(meter, _)| (meter.meter.clone(), 0.0)).collect();
    StatedErrors::from_finding_at(ErrorFinding::SameForEverySeed, constant).into_iter().chain(narrower).collect()
}

/// The share of the light that one sample of a reading holds, as its error states it.
fn largest_sample_portion(reading: &Estimate) -> Option<f64> {
    Some((reading.uncertainty.standard_error()? / reading.value).powi(2)).filter(|portion| portion.is_finite())
}

/// Finds a heavy tail in all readings of an engine: a few samples hold much of the light.
pub fn of_tails(meters: &[Vec<Estimate>], tails: Tails) -> Option<StatedErrors> {
    let largest_portion = meters.iter().flatten().filter_map(largest_sample_portion).reduce(f64::max)?;
    let found =
        StatedErrors { largest_portion: Some(largest_portion), ..StatedErrors::from_finding(ErrorFinding::HeavyTail) };
    (tails == Tails::Heavy).then_some(found)
}

/// The error of a reading below the truth that missed the few samples with much of the light.
///
/// The number of these samples that are still missing follows Poisson's law.
pub fn to_come(found: &[StatedErrors], value: f64, truth: f64) -> Option<f64> {
    let portion = found.iter().filter_map(|f| f.largest_portion).reduce(f64::max)?;
    (value < truth).then(|| (portion * truth * (truth - value)).sqrt())
}

/// Whether a reading claims no error: zero is stated, or no sample met anything.
fn claims_no_error(reading: &Estimate) -> bool {
    reading.uncertainty == Uncertainty::NotSeen || reading.uncertainty.standard_error() == Some(0.0)
}

/// Whether at least three readings all differ from one another by more than rounding.
fn are_all_different(readings: &[Estimate], mean: f64) -> bool {
    let mut earlier_pairs = readings.iter().enumerate().flat_map(|(k, e)| readings[..k].iter().map(move |f| (e, f)));
    readings.len() > 2 && earlier_pairs.all(|(a, b)| (a.value - b.value).abs() > ROUNDING * mean.abs())
}

/// The relative scatter of readings that claim no error and yet differ with every seed.
fn unstated_scatter(readings: &[Estimate]) -> Option<f64> {
    let mean = mean_value(readings);
    let square = readings.iter().map(|e| (e.value / mean - 1.0).powi(2)).sum::<f64>() / (readings.len() as f64 - 1.0);
    (are_all_different(readings, mean) && readings.iter().all(claims_no_error)).then(|| square.sqrt())
}

/// Finds sampled meters that claim no error with any seed and yet differ with every seed.
///
/// A value that is known exactly does not scatter, and a meter that no sample met always reads the same.
pub fn of_unstated(meters: &[(MeterId, Vec<Estimate>)]) -> Option<StatedErrors> {
    let at: BTreeMap<MeterId, f64> =
        meters.iter().filter_map(|(meter, readings)| Some((meter.clone(), unstated_scatter(readings)?))).collect();
    let relative = at.values().copied().fold(0.0, f64::max);
    let freedom = meters.iter().map(|(_, readings)| readings.len() as f64 - 1.0).fold(f64::INFINITY, f64::min);
    let found = StatedErrors::from_finding_at(ErrorFinding::Scatters, at)?;
    Some(StatedErrors { claim_scatter: Some(relative), degrees_of_freedom: freedom, ..found })
}

/// Whether a finding is about the scatter of readings at this meter.
fn is_about_scatter_at(found: &StatedErrors, meter: &MeterId) -> bool {
    found.at.contains_key(meter)
        && matches!(found.finding, None | Some(ErrorFinding::TooLarge | ErrorFinding::SameForEverySeed))
}

/// Compares readings that state sampling errors with their scatter, one list of readings a meter.
///
/// Meters without a sampling error are ignored; `None` where too few remain. `of_engine` is how all errors of the engine vary.
pub fn of_sampled(meters: &[Vec<Estimate>], of_engine: &Variation) -> Option<StatedErrors> {
    let PooledScatter { sum, freedom, deviates, .. } = pool_repeated(meters)?;
    let design_effect = design_effect(&deviates);
    let ratio = (sum / freedom).sqrt();
    let degrees_of_freedom = freedom / design_effect;
    let chance = ChiSquared::new(degrees_of_freedom).ok()?;
    let (below, above) = (chance.cdf(sum / design_effect), chance.sf(sum / design_effect));
    let variation = Variation::of(meters);
    let (varies, varies_beyond) = variation.with(of_engine);
    let steady = variation.steadier_than_stated().filter(|_| ratio >= ROUNDING);
    let mut sampled = meters.iter().filter(|m| m.iter().any(|e| e.uncertainty.standard_error() > Some(0.0)));
    let finding = match ratio {
        r if r < ROUNDING || sampled.all(|m| ignores_seed(m)) => Some(ErrorFinding::SameForEverySeed),
        // This precedes the heavy tail: samples of a heavy tail scatter by what they state, too.
        r if below < REPORTED_P && r < 1.0 / MIN_EXCESS_RATIO => Some(ErrorFinding::TooLarge),
        _ if varies_beyond && varies.is_some_and(|freedom| freedom < MIN_NORMAL_FREEDOM) => {
            Some(ErrorFinding::HeavyTail)
        }
        _ if above < REPORTED_P => Some(ErrorFinding::TooSmall),
        _ if varies_beyond => Some(ErrorFinding::FewerSamples),
        _ => steady.map(|_| ErrorFinding::MoreSamples),
    };
    // Far too large errors say nothing about the readings, so the readings' scatter replaces them.
    let is_replaced = matches!(finding, Some(ErrorFinding::TooLarge | ErrorFinding::SameForEverySeed));
    let scatter = check_claims(meters).filter(|_| is_replaced);
    Some(StatedErrors {
        ratio: Some(ratio),
        degrees_of_freedom: scatter
            .as_ref()
            .map_or(degrees_of_freedom, |s| s.degrees_of_freedom.min(degrees_of_freedom)),
        design_effect,
        observed_degrees_of_freedom: varies.or(steady),
        p_value: Some(2.0 * below.min(above)),
        claim_scatter: scatter.and_then(|s| s.claim_scatter),
        finding,
        ..StatedErrors::from_finding(ErrorFinding::TooSmall)
    })
}

/// Whether all readings but the last are equal except for rounding; the last is the one that the run took first.
fn are_later_readings_equal(readings: &[Estimate], brightest: f64) -> bool {
    let others = &readings[..readings.len().saturating_sub(1)];
    others.len() > 1 && others.iter().all(|e| (e.value - others[0].value).abs() <= ROUNDING * brightest)
}

/// Measures the scatter of readings that claim to be exact; `None` where they do not scatter.
///
/// Meters that are dark relative to the brightest one are ignored: they scatter by rounding.
pub fn check_claims(meters: &[Vec<Estimate>]) -> Option<StatedErrors> {
    let brightest = meters.iter().map(|readings| mean_value(readings)).fold(0.0, f64::max);
    let (mut sum, mut freedom, mut of_meters) = (0.0, 0.0, vec![]);
    for readings in meters {
        let mean = mean_value(readings);
        if mean > ROUNDING * brightest {
            let squares = readings.iter().map(|e| (e.value / mean - 1.0).powi(2)).sum::<f64>();
            let meter_freedom = readings.len().saturating_sub(1) as f64;
            sum += squares;
            freedom += meter_freedom;
            let uncertainty = Uncertainty::sampled((squares / meter_freedom).sqrt(), Some(meter_freedom));
            of_meters.push(Estimate { value: mean, uncertainty });
        }
    }
    let relative = (sum / freedom).sqrt();
    // Where the scatter differs from meter to meter, the pooled scatter means little for a single one.
    let across = Variation::across(&of_meters).with(&Variation::default()).0.unwrap_or(freedom);
    let degrees_of_freedom = freedom.min(across.max(MIN_FREEDOM));
    let found = StatedErrors {
        degrees_of_freedom,
        claim_scatter: Some(relative),
        only_first_differs: meters.iter().all(|readings| are_later_readings_equal(readings, brightest)),
        ..StatedErrors::from_finding(ErrorFinding::Scatters)
    };
    (relative > 0.0 && relative.is_finite()).then_some(found)
}

/// A reading at a meter with its error corrected by everything that was found of its engine.
#[must_use]
pub fn corrected(found: &[StatedErrors], meter: &MeterId, estimate: Estimate) -> Estimate {
    found.iter().fold(estimate, |estimate, stated| match stated.at.get(meter) {
        Some(relative) => {
            Estimate { uncertainty: limit_error(stated, relative * estimate.value.abs(), estimate), ..estimate }
        }
        None if stated.at.is_empty() => correct(stated, estimate),
        None => estimate,
    })
}

/// The uncertainty of a reading when at most `most` counts.
fn limit_error(found: &StatedErrors, most: f64, estimate: Estimate) -> Uncertainty {
    match (found.finding, estimate.uncertainty) {
        (Some(ErrorFinding::BeyondTolerance | ErrorFinding::Refuted), Uncertainty::Bound(_)) => {
            Uncertainty::Bound(most)
        }
        (
            Some(ErrorFinding::BeyondTolerance | ErrorFinding::Refuted),
            Uncertainty::StandardError { value, degrees_of_freedom, .. },
        ) => Uncertainty::StandardError { value, degrees_of_freedom, bound: most },
        // No further samples exist that could show a larger error than stated.
        (Some(ErrorFinding::NotRepeated), Uncertainty::StandardError { value, bound, .. }) => {
            Uncertainty::StandardError { value: value.min(most), degrees_of_freedom: None, bound }
        }
        (None | Some(ErrorFinding::TooLarge), Uncertainty::StandardError { bound, .. }) => {
            Uncertainty::StandardError { value: most, degrees_of_freedom: Some(found.degrees_of_freedom), bound }
        }
        (None, Uncertainty::NotSeen) => Uncertainty::sampled(most, Some(found.degrees_of_freedom)),
        (Some(ErrorFinding::Scatters), stated) if !stated.is_sampled() || stated == Uncertainty::NotSeen => {
            Uncertainty::sampled(most, Some(found.degrees_of_freedom))
        }
        (Some(ErrorFinding::SameForEverySeed), Uncertainty::NotSeen) => Uncertainty::Exact,
        (_, stated) => stated,
    }
}

/// The degrees of freedom of a heavy tail at a meter; `None` where there is none.
///
/// A heavy tail does not excuse errors that readings with other seeds contradict.
pub fn heavy_tail(found: &[StatedErrors], meter: &MeterId) -> Option<f64> {
    let is_contradicted = found.iter().any(|f| is_about_scatter_at(f, meter));
    let heavy = found.iter().filter(|f| f.finding == Some(ErrorFinding::HeavyTail) && !is_contradicted);
    heavy.filter_map(|f| f.observed_degrees_of_freedom).reduce(f64::min)
}

/// A reading with its error corrected by the scatter of all readings.
///
/// A standard error states how readings scatter and nothing else, so one that is far too large is as wrong as one that is too small.
/// A bound covers what is the same in every reading, so it stays.
#[must_use]
fn correct(found: &StatedErrors, estimate: Estimate) -> Estimate {
    let freedom = found.degrees_of_freedom;
    let uncertainty = match (estimate.uncertainty, found.ratio, found.claim_scatter) {
        (Uncertainty::StandardError { value, bound, .. }, Some(_), Some(relative)) if value > 0.0 => {
            let value = relative * estimate.value.abs();
            Uncertainty::StandardError { value, degrees_of_freedom: Some(freedom), bound }
        }
        (Uncertainty::StandardError { value, degrees_of_freedom, bound }, Some(ratio), _) if value > 0.0 => {
            let stated = stated_freedom(found, degrees_of_freedom);
            let (factor, degrees_of_freedom) = if widens_verdicts(found, ratio) {
                // The relative variances of the two standard errors add.
                let combined = stated.map_or(freedom, |stated| (stated.recip() + freedom.recip()).recip());
                (ratio, Some(combined.max(MIN_FREEDOM)))
            } else {
                (1.0, stated)
            };
            Uncertainty::StandardError { value: factor * value, degrees_of_freedom, bound }
        }
        (stated, None, Some(relative)) => Uncertainty::StandardError {
            value: relative * estimate.value.abs(),
            degrees_of_freedom: Some(freedom),
            bound: stated.bound(),
        },
        (stated, ..) => stated,
    };
    Estimate { uncertainty, ..estimate }
}

/// The degrees of freedom of a stated error, corrected by how such errors vary.
fn stated_freedom(found: &StatedErrors, stated: Option<f64>) -> Option<f64> {
    let observed = found.observed_degrees_of_freedom.map(|freedom| freedom.max(MIN_FREEDOM));
    match found.finding {
        Some(ErrorFinding::MoreSamples) => observed,
        _ => [stated, observed].into_iter().flatten().reduce(f64::min),
    }
}

/// The uncertainty of several stages together, with as few degrees of freedom as one stage where its tail is heavy.
///
/// The mean of more samples with a heavy tail is not much closer to normal.
#[must_use]
pub fn of_stages(found: &[StatedErrors], meter: &MeterId, together: Uncertainty) -> Uncertainty {
    match (together, heavy_tail(found, meter)) {
        (Uncertainty::StandardError { value, degrees_of_freedom, bound }, Some(freedom)) => {
            let fewest = degrees_of_freedom.map_or(freedom, |all| all.min(freedom)).max(MIN_FREEDOM);
            Uncertainty::StandardError { value, degrees_of_freedom: Some(fewest), bound }
        }
        _ => together,
    }
}

/// Whether the ratio of scatter to stated error scales the error in verdicts.
fn widens_verdicts(found: &StatedErrors, ratio: f64) -> bool {
    match found.finding {
        Some(
            ErrorFinding::TooSmall | ErrorFinding::TooLarge | ErrorFinding::SameForEverySeed | ErrorFinding::Scatters,
        ) => true,
        // Here nothing was measured that could scale the error.
        Some(ErrorFinding::NotRepeated | ErrorFinding::BeyondTolerance | ErrorFinding::Refuted) => false,
        Some(ErrorFinding::HeavyTail | ErrorFinding::FewerSamples | ErrorFinding::MoreSamples) | None => {
            ratio > 1.0 && found.p_value.is_some_and(|p| p < 2.0 * COUNTED_P)
        }
    }
}

/// How the standard errors of readings with one effort vary from seed to seed.
///
/// The logarithm of a variance with n degrees of freedom has the variance psi'(n / 2) (Bartlett and Kendall, Suppl. J. Roy. Statist.
/// Soc. 8 (1946)).
///
/// Student's t with the observed n also covers means of skewed samples. Simulated were 2 million means of 8 and of 32 samples:
/// exponential, Pareto (1.5 to 3) and lognormal (sigma .5 to 2). The two-sided quantiles of .01 and .001 are at least .85 of the
/// simulated ones, and most are far wider.
#[derive(Clone, Copy, Debug, Default)]
pub struct Variation {
    squares: f64,
    freedom: f64,
    /// The squares over those expected for the stated degrees of freedom; where none are stated, for as few as possible.
    over_few: f64,
    /// The same, but for many where none are stated.
    over_many: f64,
    /// The most degrees of freedom that are stated.
    most: f64,
}

impl Variation {
    /// Measures readings of one effort: all but the last of each meter.
    pub fn of(meters: &[Vec<Estimate>]) -> Self {
        meters.iter().map(|readings| Self::across(&readings[..readings.len().saturating_sub(1)])).sum()
    }

    /// Measures estimates that should have about the same standard error.
    fn across(estimates: &[Estimate]) -> Self {
        let stated = estimates.iter().filter_map(|e| Some((e.uncertainty.standard_error()?, e.uncertainty)));
        let logs: Vec<(f64, Option<f64>)> =
            stated.filter(|(e, _)| *e > 0.0).map(|(e, u)| (2.0 * e.ln(), u.degrees_of_freedom())).collect();
        let mean = logs.iter().map(|(log, _)| log).sum::<f64>() / logs.len() as f64;
        let mut all = Self { freedom: logs.len().saturating_sub(1) as f64, ..Self::default() };
        for (log, stated) in &logs {
            all.most = all.most.max(stated.unwrap_or(UNSTATED_FREEDOM));
            let square = (log - mean).powi(2);
            all.squares += square;
            all.over_few += square / trigamma(stated.unwrap_or(MIN_UNSTATED_FREEDOM) / 2.0);
            all.over_many += square / trigamma(stated.unwrap_or(UNSTATED_FREEDOM) / 2.0);
        }
        all
    }

    /// The observed degrees of freedom where errors vary less than the few stated ones allow.
    ///
    /// So few stated degrees of freedom would excuse almost any deviation.
    fn steadier_than_stated(&self) -> Option<f64> {
        let is_steadier = ChiSquared::new(self.freedom).is_ok_and(|c| c.cdf(self.over_many) < HEAVY_TAIL_P);
        (self.most < MIN_NORMAL_FREEDOM && is_steadier).then(|| self.degrees_of_freedom())
    }

    fn degrees_of_freedom(&self) -> f64 {
        2.0 * inverse_trigamma(self.squares / self.freedom)
    }

    fn is_less_probable_than(&self, probability: f64, over: f64) -> bool {
        ChiSquared::new(self.freedom).is_ok_and(|chance| chance.sf(over) < probability)
    }

    /// The observed degrees of freedom where a procedure's errors vary more than the stated ones allow, and whether that is extreme.
    ///
    /// All errors of the engine count too, unless the procedure's errors are clearly steadier than these.
    fn with(&self, of_engine: &Self) -> (Option<f64>, bool) {
        let variance = of_engine.squares / of_engine.freedom;
        let is_steadier = ChiSquared::new(self.freedom).is_ok_and(|c| c.cdf(self.squares / variance) < STEADIER_P);
        let counted: Vec<&Self> = if is_steadier { vec![self] } else { vec![self, of_engine] };
        let freedom = counted
            .iter()
            .filter(|v| v.is_less_probable_than(COUNTED_P, v.over_many))
            .map(|v| v.degrees_of_freedom())
            .reduce(f64::min);
        (freedom, counted.iter().any(|v| v.is_less_probable_than(HEAVY_TAIL_P, v.over_few)))
    }
}

impl Sum for Variation {
    fn sum<I: Iterator<Item = Self>>(all: I) -> Self {
        all.fold(Self::default(), |a, b| Self {
            squares: a.squares + b.squares,
            freedom: a.freedom + b.freedom,
            over_few: a.over_few + b.over_few,
            over_many: a.over_many + b.over_many,
            most: a.most.max(b.most),
        })
    }
}

/// The argument at which the trigamma function has this value, by bisection: it falls.
fn inverse_trigamma(value: f64) -> f64 {
    let (mut low, mut high) = (1e-6_f64, 1e6_f64);
    for _ in 0..100 {
        let middle = (low * high).sqrt();
        if trigamma(middle) > value { low = middle } else { high = middle }
    }
    high
}

/// The second derivative of the logarithm of the gamma function (Abramowitz and Stegun 6.4.6 and 6.4.12).
fn trigamma(x: f64) -> f64 {
    if x < 6.0 {
        return trigamma(x + 1.0) + x.powi(-2);
    }
    x.recip() + 0.5 * x.powi(-2) + x.powi(-3) / 6.0 - x.powi(-5) / 30.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use fastrand::Rng;
    use luxproof_process::random::normal;

    /// Readings of so many meters with so many seeds each.
    fn meters_of(meters: usize, seeds: usize, mut reading: impl FnMut() -> Estimate) -> Vec<Vec<Estimate>> {
        (0..meters).map(|_| (0..seeds).map(|_| reading()).collect()).collect()
    }

    /// A reading of 100 with this scatter and this stated standard error.
    fn reading(random: &mut Rng, scatter: f64, stated: f64) -> Estimate {
        Estimate { value: 100.0 + scatter * normal(random), uncertainty: Uncertainty::sampled(stated, Some(7.0)) }
    }

    /// The mean of so many samples with its standard error.
    fn mean_of(samples: usize, mut sample: impl FnMut() -> f64) -> Estimate {
        Estimate::of_samples(&(0..samples).map(|_| sample()).collect::<Vec<f64>>())
    }

    /// Four meters with four seeds each.
    fn readings(seed: u64, scatter: f64, stated: f64) -> Vec<Vec<Estimate>> {
        let mut random = Rng::with_seed(seed);
        meters_of(4, 4, || reading(&mut random, scatter, stated))
    }

    fn find(meters: &[Vec<Estimate>]) -> StatedErrors {
        find_any(meters).unwrap()
    }

    fn find_any(meters: &[Vec<Estimate>]) -> Option<StatedErrors> {
        of_sampled(meters, &Variation::of(meters))
    }

    /// For how many of 1000 seeds this fault is found.
    fn count_found(scatter: f64, stated: f64, finding: ErrorFinding) -> usize {
        (0..1000).filter(|seed| find(&readings(*seed, scatter, stated)).finding == Some(finding)).count()
    }

    #[test]
    fn errors_three_times_too_small_or_ten_times_too_large_are_found_and_right_ones_are_not() {
        assert!(
            count_found(3.0, 1.0, ErrorFinding::TooSmall) > 980,
            "{}",
            count_found(3.0, 1.0, ErrorFinding::TooSmall)
        );
        assert!(count_found(0.1, 1.0, ErrorFinding::TooLarge) > 980);
        assert!(count_found(1.0, 1.0, ErrorFinding::TooSmall) <= 12);
        assert_eq!(count_found(1.0, 1.0, ErrorFinding::TooLarge), 0);
        assert_eq!(count_found(0.0, 1.0, ErrorFinding::SameForEverySeed), 1000);
    }

    /// For how many of 1000 seeds samples of this heaviness have a heavy tail; samples of heaviness 0 are normal.
    fn count_heavy_tails(heaviness: f64, meters: usize) -> usize {
        let mut count = 0;
        for seed in 0..1000 {
            let mut random = Rng::with_seed(seed);
            let all = meters_of(meters, 4, || {
                mean_of(8, || {
                    if heaviness > 0.0 { (heaviness * normal(&mut random)).exp() } else { 9.0 + normal(&mut random) }
                })
            });
            count += usize::from(find(&all).finding == Some(ErrorFinding::HeavyTail));
        }
        count
    }

    #[test]
    fn a_heavy_tail_is_found_by_errors_that_vary_and_normal_samples_have_none() {
        assert!(count_heavy_tails(2.0, 6) > 990, "{}", count_heavy_tails(2.0, 6));
        for meters in [6, 40] {
            assert!(count_heavy_tails(0.0, meters) <= 2, "{}", count_heavy_tails(0.0, meters));
        }
        assert!((trigamma(1.0) - std::f64::consts::PI.powi(2) / 6.0).abs() < 1e-5);
    }

    /// Means of so many blocks of normal noise with their standard errors, as an adapter should state them.
    fn block_means(seed: u64, meters: usize, blocks: usize, noise: f64) -> Vec<Vec<Estimate>> {
        let mut random = Rng::with_seed(seed);
        meters_of(meters, 4, || mean_of(blocks, || 100.0 + noise * normal(&mut random)))
    }

    #[test]
    fn right_errors_of_few_blocks_are_not_called_too_small() {
        for (meters, blocks) in [(20, 2), (60, 2), (20, 4), (20, 8), (220, 8)] {
            let mut count = 0;
            for seed in 0..600 {
                let found = find_any(&block_means(seed, meters, blocks, 0.3));
                let finding = found.and_then(|found| found.finding);
                count += usize::from(matches!(finding, Some(ErrorFinding::TooSmall | ErrorFinding::TooLarge)));
            }
            assert!(count <= 12, "{count} of 600 with {meters} meters of {blocks} blocks");
        }
    }

    #[test]
    fn a_third_of_the_right_error_of_few_blocks_is_called_too_small() {
        let mut count = 0;
        for seed in 0..100 {
            let mut meters = block_means(seed, 12, 4, 0.3);
            for estimate in meters.iter_mut().flatten() {
                estimate.uncertainty = estimate.uncertainty.times(1.0 / 3.0);
            }
            count += usize::from(find(&meters).finding == Some(ErrorFinding::TooSmall));
        }
        assert!(count > 90, "{count}");
    }

    /// The probability of so little scatter at a meter if its error is far too large; 1 otherwise.
    fn too_large_p(readings: &[Estimate]) -> f64 {
        let scatter = MeterScatter::from_readings(readings);
        scatter.filter(|s| s.ratio < 1.0 / MIN_EXCESS_RATIO).map_or(1.0, |s| s.p_value)
    }

    /// How many of 300 procedures with 24 meters of seven readings have a meter with a contradicted error.
    fn count_contradicted(reading: impl Fn(&mut Rng) -> Estimate) -> usize {
        let mut count = 0;
        for seed in 0..300 {
            let mut random = Rng::with_seed(seed);
            count += usize::from((0..24).any(|_| {
                let meter: Vec<Estimate> = (0..7).map(|_| reading(&mut random)).collect();
                too_large_p(&meter) < REPORTED_P / 24.0
            }));
        }
        count
    }

    #[test]
    fn scatter_does_not_contradict_right_errors_of_a_meter_whatever_the_noise() {
        type Sample = fn(&mut Rng) -> f64;
        let samples: [(&str, Sample); 4] = [
            ("normal", |random| 100.0 + 0.3 * normal(random)),
            ("lognormal 1", |random| normal(random).exp()),
            ("lognormal 2", |random| (2.0 * normal(random)).exp()),
            ("Pareto 1.5", |random| random.f64().max(1e-12).powf(-1.0 / 1.5)),
        ];
        for (name, sample) in samples {
            for blocks in [2, 4, 8] {
                let count = count_contradicted(|random| mean_of(blocks, || sample(random)));
                assert!(count <= 4, "{count} of 300, {blocks} blocks of {name}");
            }
        }
    }

    /// A reading with a tenth of the light in one sample of a thousand; nothing is stated where no sample met it.
    fn rare_light(random: &mut Rng) -> Estimate {
        let hits = f64::from(u32::try_from((0..1000).filter(|_| random.f64() < 1e-3).count()).unwrap());
        Estimate { value: 0.9 + 0.1 * hits, uncertainty: Uncertainty::sampled(0.1 * hits.sqrt(), Some(999.0)) }
    }

    #[test]
    fn scatter_does_not_contradict_right_errors_of_rare_light() {
        // Seven readings are equal by chance at one of 1,000 such meters.
        let count = count_contradicted(rare_light);
        assert!(count <= 15, "{count}");
    }

    #[test]
    fn scatter_contradicts_a_wide_error_of_a_meter_however_the_error_varies() {
        for (scatter, stated, varies) in [(0.2, 30.0, 0.0), (0.2, 6.0, 0.0), (0.2, 5.0, 2.0), (0.0, 1.0, 0.0)] {
            let mut count = 0;
            for seed in 0..200 {
                let mut random = Rng::with_seed(seed);
                let meter = meters_of(1, 7, || Estimate {
                    value: 100.0 + scatter * normal(&mut random),
                    uncertainty: Uncertainty::sampled(stated * (varies * normal(&mut random)).exp(), Some(7.0)),
                });
                count += usize::from(too_large_p(&meter[0]) < REPORTED_P / 24.0);
            }
            assert!(count > 170, "{scatter} {stated} {varies}: {count} of 200");
        }
    }

    fn wide(value: f64) -> Estimate {
        Estimate { value, uncertainty: Uncertainty::sampled(30.0, Some(7.0)) }
    }

    #[test]
    fn a_finding_at_a_meter_counts_only_there() {
        let [here, there] = ["desk[0]", "desk[1]"].map(|id| MeterId(id.to_owned()));
        let readings = [99.0, 100.0, 101.0].map(wide);
        let meter = MeterPassingByErrorOnly { meter: here.clone(), readings: readings.to_vec(), counts: Some(0.3) };
        let found = of_sheltered(&[meter], Tails::Unknown);
        assert_eq!(found[0].finding, Some(ErrorFinding::TooLarge), "{found:?}");
        let error = corrected(&found, &here, wide(200.0)).uncertainty;
        assert!((error.standard_error().unwrap() - 2.0).abs() < 1e-12, "{error:?}");
        assert_eq!(error.degrees_of_freedom(), Some(2.0));
        assert_eq!(corrected(&found, &there, wide(200.0)), wide(200.0));
    }

    #[test]
    fn errors_that_were_not_checked_and_bounds_beyond_the_tolerance_are_limited() {
        let here = MeterId::new("desk", 0);
        let at = BTreeMap::from([(here.clone(), 0.01)]);
        let unchecked = StatedErrors::from_finding_at(ErrorFinding::NotRepeated, at.clone()).unwrap();
        let limited = corrected(&[unchecked], &here, wide(200.0)).uncertainty;
        assert_eq!(limited, Uncertainty::sampled(2.0, None));
        let beyond = StatedErrors::from_finding_at(ErrorFinding::BeyondTolerance, at).unwrap();
        let bounded = Estimate { value: 200.0, uncertainty: Uncertainty::Bound(50.0) };
        assert_eq!(corrected(&[beyond], &here, bounded).uncertainty, Uncertainty::Bound(2.0));
    }

    /// The root of a chi-squared variable over its seven degrees of freedom.
    fn chi(random: &mut Rng) -> f64 {
        ((0..7).map(|_| normal(random).powi(2)).sum::<f64>() / 7.0).sqrt()
    }

    /// Meters of seven readings with these scatters and stated errors; honest errors vary as estimates of seven degrees of freedom.
    fn sheltered(
        random: &mut Rng,
        scatters_and_errors: &[(f64, f64)],
        is_honest: bool,
    ) -> Vec<MeterPassingByErrorOnly> {
        let mut meters = vec![];
        for (k, (scatter, stated)) in scatters_and_errors.iter().enumerate() {
            let mut readings = vec![];
            for _ in 0..7 {
                let factor = if is_honest { chi(random) } else { 1.0 };
                readings.push(reading(random, *scatter, stated * factor));
            }
            let counts = readings[3].uncertainty.standard_error().map(|e| e / 100.0).filter(|e| *e > 0.0);
            meters.push(MeterPassingByErrorOnly { meter: MeterId::new("desk", k), readings, counts });
        }
        meters
    }

    #[test]
    fn under_normal_tails_no_error_counts_that_is_larger_than_the_scatter() {
        let mut random = Rng::with_seed(11);
        let similar = sheltered(&mut random, &[(0.5, 1.45); 24], false);
        let found = of_sheltered(&similar, Tails::Normal);
        assert!(found.len() == 1 && found[0].at.len() == 24 && found[0].degrees_of_freedom > 100.0, "{found:?}");
        assert!(found[0].at.values().all(|scatter| (0.0044..0.0056).contains(scatter)), "{found:?}");
        assert_eq!(of_sheltered(&similar, Tails::Unknown), []);
        // A single meter with a larger scatter does not affect the others.
        let mut mixed = vec![(0.1, 5.0); 23];
        mixed.push((5.0, 5.0));
        let found = of_sheltered(&sheltered(&mut random, &mixed, false), Tails::Normal);
        assert!(found[0].at.values().filter(|scatter| **scatter < 0.003).count() == 23, "{found:?}");
        assert_eq!(found[0].degrees_of_freedom, 6.0);
    }

    #[test]
    fn fewer_samples_of_the_same_stream_are_the_same_with_every_seed_and_no_heavy_tail() {
        let mut random = Rng::with_seed(5);
        let mut meters = vec![];
        for _ in 0..40 {
            let [fewer, whole] = [0.2, 0.1].map(|error| {
                let value = 100.0 + error * normal(&mut random);
                Estimate { value, uncertainty: Uncertainty::sampled(error, Some(15.0)) }
            });
            meters.push(vec![fewer, fewer, fewer, whole]);
        }
        assert_ne!(Tails::of(&meters), Tails::Heavy);
        let found = of_sampled(&meters, &Variation::of(&meters)).unwrap();
        assert_eq!(found.finding, Some(ErrorFinding::SameForEverySeed));
    }

    #[test]
    fn equal_readings_of_samples_that_met_nothing_are_exact() {
        let mut unseen = sheltered(&mut Rng::with_seed(11), &[(0.0, 1.0)], false);
        unseen[0].counts = None;
        let found = of_sheltered(&unseen, Tails::Unknown);
        assert_eq!(found[0].finding, Some(ErrorFinding::SameForEverySeed));
        let dark = Estimate { value: 5.0, uncertainty: Uncertainty::NotSeen };
        assert_eq!(corrected(&found, &unseen[0].meter, dark).uncertainty, Uncertainty::Exact);
        assert_eq!(of_sheltered(&unseen, Tails::Heavy), []);
    }

    #[test]
    fn honest_readings_lie_within_the_corrected_errors_as_often_as_stated() {
        // Two intervals are tried, so twice as many readings may lie outside.
        const LEVEL: f64 = 0.01;
        let mut count = 0;
        for seed in 0..600 {
            let scatters_and_errors: Vec<(f64, f64)> =
                (0..24).map(|k| 0.1 * f64::from(1 + k % 5)).map(|s| (s, s)).collect();
            let meters = sheltered(&mut Rng::with_seed(seed), &scatters_and_errors, true);
            let found = of_sheltered(&meters, Tails::Normal);
            count += usize::from(meters.iter().any(|m| {
                let judged = corrected(&found, &m.meter, m.readings[3]);
                let error = judged.uncertainty.standard_error().unwrap();
                let freedom = judged.uncertainty.degrees_of_freedom().unwrap();
                let chance = statrs::distribution::StudentsT::new(0.0, 1.0, freedom).unwrap();
                2.0 * chance.sf((judged.value - 100.0).abs() / error) < LEVEL / 24.0
            }));
        }
        assert!(count <= 18, "{count} of 600");
    }

    #[test]
    fn no_tail_excuses_errors_that_readings_contradict() {
        let mut random = Rng::with_seed(4);
        let meters = meters_of(24, 4, || Estimate {
            value: 100.0 + 0.1 * normal(&mut random),
            uncertainty: Uncertainty::sampled(0.2 * (2.0 * normal(&mut random)).exp(), Some(7.0)),
        });
        let found = find(&meters);
        assert_eq!(found.finding, Some(ErrorFinding::TooLarge), "{found}");
        let error = correct(&found, meters[0][0]).uncertainty;
        assert!(error.standard_error().unwrap() < 0.2 && error.degrees_of_freedom().unwrap() > 3.0, "{error:?}");
    }

    #[test]
    fn a_steady_error_has_more_degrees_of_freedom_than_one() {
        let mut random = Rng::with_seed(3);
        let meters = meters_of(30, 4, || Estimate {
            value: 100.0 + 5.0 * normal(&mut random),
            uncertainty: Uncertainty::sampled(5.0, Some(1.0)),
        });
        let found = find(&meters);
        assert_eq!(found.finding, Some(ErrorFinding::MoreSamples), "{found}");
        assert!(correct(&found, meters[0][0]).uncertainty.degrees_of_freedom().unwrap() > 1e3);
        // Two blocks have one degree of freedom, and their errors show it.
        let steady =
            (0..300).filter(|seed| find(&block_means(*seed, 30, 2, 0.3)).finding == Some(ErrorFinding::MoreSamples));
        assert!(steady.count() <= 1);
    }

    /// Readings that claim to be exact, with this relative noise at each meter.
    fn exact_claims(random: &mut Rng, noise: impl Fn(usize) -> f64) -> Vec<Vec<Estimate>> {
        let mut meters = vec![];
        for meter in 0..20 {
            let noise = noise(meter);
            meters.push((0..4).map(|_| Estimate::exact(100.0 * (1.0 + noise * normal(random)))).collect());
        }
        meters
    }

    #[test]
    fn claims_with_different_scatters_say_little_about_a_single_meter() {
        let mut random = Rng::with_seed(8);
        let similar = check_claims(&exact_claims(&mut random, |_| 0.01)).unwrap();
        let different = check_claims(&exact_claims(&mut random, |meter| if meter < 3 { 0.03 } else { 3e-4 })).unwrap();
        assert!(similar.degrees_of_freedom > 10.0, "{similar}");
        assert!(different.degrees_of_freedom < 1.5, "{different}");
    }

    #[test]
    fn more_stated_samples_than_there_are_change_no_verdict() {
        // Eight blocks each, stated as 4096 samples.
        let mut random = Rng::with_seed(5);
        let all = meters_of(24, 4, || {
            let mean = mean_of(8, || 100.0 + normal(&mut random));
            let error = mean.uncertainty.standard_error().unwrap();
            Estimate { uncertainty: Uncertainty::sampled(error, Some(4095.0)), ..mean }
        });
        let found = find(&all);
        assert_eq!(found.finding, Some(ErrorFinding::FewerSamples), "{found}");
        let freedom = correct(&found, all[0][0]).uncertainty.degrees_of_freedom().unwrap();
        assert!((4.5..11.0).contains(&freedom), "{freedom}");
    }

    #[test]
    fn noise_that_meters_share_says_little_about_stated_errors() {
        let mut count = 0;
        for seed in 0..1000 {
            let mut random = Rng::with_seed(seed);
            let shared: Vec<Estimate> = (0..4).map(|_| reading(&mut random, 1.0, 1.0)).collect();
            count += usize::from(find(&vec![shared; 24]).finding.is_some());
        }
        // .5 % on either side.
        assert!(count <= 20, "{count} of 1000");
    }

    #[test]
    fn rounding_in_the_dark_is_no_scatter() {
        let bright = [100.0; 4].map(Estimate::exact).to_vec();
        let dark = [1e-12, 3e-12, 2e-12, 1e-13].map(Estimate::exact).to_vec();
        assert_eq!(check_claims(&[bright, dark]), None);
    }

    #[test]
    fn a_corrected_reading_has_the_error_of_its_scatter() {
        let first = readings(1, 3.0, 1.0)[0][0];
        let found = find(&readings(1, 3.0, 1.0));
        let error = correct(&found, first).uncertainty;
        assert!((2.0..4.5).contains(&error.standard_error().unwrap()), "{error:?}");
        // Seven degrees of freedom are stated; those of the scatter combine with them.
        let combined = (7f64.recip() + found.degrees_of_freedom.recip()).recip();
        assert!((error.degrees_of_freedom().unwrap() - combined).abs() < 1e-12);
        let fine = StatedErrors { p_value: Some(0.7), finding: None, ratio: Some(1.1), ..found.clone() };
        assert_eq!(correct(&fine, first), first);
        // A bound states nothing about scatter.
        let bounded = Estimate { value: 1.0, uncertainty: Uncertainty::Bound(0.1) };
        assert_eq!(correct(&found, bounded), bounded);
    }

    #[test]
    fn a_claim_that_scatters_has_the_error_of_its_scatter() {
        let found = check_claims(&[[9.9, 10.1].map(Estimate::exact).to_vec(), vec![Estimate::exact(0.0); 2]]).unwrap();
        let error = correct(&found, Estimate::exact(20.0)).uncertainty;
        assert!((error.standard_error().unwrap() - 20.0 * 0.01 * 2f64.sqrt()).abs() < 1e-12, "{error:?}");
        assert_eq!(error.degrees_of_freedom(), Some(1.0));
        // A negative reading has the same error, and no report contains a negative error.
        let negative = corrected(std::slice::from_ref(&found), &MeterId::new("m", 0), Estimate::exact(-5.0));
        assert!(negative.uncertainty.is_sound() && negative.uncertainty.standard() > 0.0, "{negative:?}");
        assert!(check_claims(&[vec![Estimate::exact(10.0); 4]]).is_none());
    }

    /// Readings that state an error of zero.
    fn without_error(values: &[f64]) -> Vec<Estimate> {
        values.iter().map(|value| Estimate { value: *value, uncertainty: Uncertainty::sampled(0.0, None) }).collect()
    }

    #[test]
    fn readings_that_claim_no_error_have_that_of_their_scatter() {
        // By hand: 9, 10 and 11 have the standard deviation 1, with two degrees of freedom. The fewest of all meters count.
        let meters = [
            (MeterId::new("m", 0), without_error(&[9.0, 10.0, 11.0])),
            (MeterId::new("m", 1), without_error(&[10.0; 4])),
        ];
        let found = of_unstated(&meters).unwrap();
        assert!((found.claim_scatter.unwrap() - 0.1).abs() < 1e-12, "{found:?}");
        assert!((found.at[&MeterId::new("m", 0)] - 0.1).abs() < 1e-12 && found.at.len() == 1, "{found:?}");
        assert_eq!(found.degrees_of_freedom, 2.0);
    }

    /// A finding with these degrees of freedom of errors that vary.
    fn heavy_tailed(freedom: f64) -> StatedErrors {
        StatedErrors {
            observed_degrees_of_freedom: Some(freedom),
            ..StatedErrors::from_finding(ErrorFinding::HeavyTail)
        }
    }

    #[test]
    fn a_heavy_tail_does_not_excuse_a_meter_that_readings_contradict() {
        let [here, there] = ["desk[0]", "desk[1]"].map(|id| MeterId(id.to_owned()));
        let at = BTreeMap::from([(here.clone(), 0.01)]);
        for finding in [ErrorFinding::TooLarge, ErrorFinding::SameForEverySeed] {
            let found = [heavy_tailed(1.5), StatedErrors::from_finding_at(finding, at.clone()).unwrap()];
            assert_eq!((heavy_tail(&found, &here), heavy_tail(&found, &there)), (None, Some(1.5)), "{finding:?}");
        }
        // Scatter below what is reported contradicts the error, too.
        let unreported =
            StatedErrors { finding: None, ..StatedErrors::from_finding_at(ErrorFinding::TooLarge, at).unwrap() };
        assert_eq!(heavy_tail(&[heavy_tailed(1.5), unreported], &here), None);
        // Of several tails the heaviest counts, and stages together have no more degrees of freedom.
        let two = [heavy_tailed(2.5), heavy_tailed(1.5)];
        assert_eq!(heavy_tail(&two, &here), Some(1.5));
        let together = of_stages(&two, &here, Uncertainty::sampled(0.1, Some(14.0)));
        assert_eq!(together, Uncertainty::sampled(0.1, Some(1.5)));
        assert_eq!(of_stages(&[], &here, Uncertainty::sampled(0.1, Some(14.0))), Uncertainty::sampled(0.1, Some(14.0)));
    }

    #[test]
    fn a_reading_may_miss_the_samples_that_hold_much_of_the_light() {
        // A sample holds a hundredth of the light, so the missing tenth is ten samples: sqrt(10) of them by Poisson's law.
        let found =
            [StatedErrors { largest_portion: Some(0.01), ..StatedErrors::from_finding(ErrorFinding::HeavyTail) }];
        let error = to_come(&found, 90.0, 100.0).unwrap();
        assert!((error - 10.0_f64.sqrt()).abs() < 1e-12, "{error}");
        assert_eq!(to_come(&found, 110.0, 100.0), None);
    }

    #[test]
    fn errors_vary_as_the_trigamma_function_says() {
        // Abramowitz and Stegun, 6.4: psi'(1) = pi^2 / 6, psi'(1/2) = pi^2 / 2, psi'(2) = pi^2 / 6 - 1.
        let sixth = std::f64::consts::PI.powi(2) / 6.0;
        for (x, expected) in [(1.0, sixth), (0.5, 3.0 * sixth), (2.0, sixth - 1.0)] {
            assert!((trigamma(x) - expected).abs() < 1e-6, "{x}: {}", trigamma(x));
            assert!((inverse_trigamma(expected) / x - 1.0).abs() < 1e-5);
        }
        // Errors of exponential noise: log-variances scatter by psi'(n / 2), n degrees of freedom.
        let variation = Variation { squares: 10.0 * sixth, freedom: 10.0, ..Variation::default() };
        assert!((variation.degrees_of_freedom() - 2.0).abs() < 1e-4);
    }
}
