//! What is stated of errors, held against how readings of other seeds scatter.

use std::collections::BTreeMap;
use std::fmt;
use std::iter::Sum;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use statrs::distribution::{ChiSquared, ContinuousCDF};

use super::scatter::{MANY, Scatter, of_one, of_repeated};
use super::{Estimate, MeterId, Uncertainty, design_effect};

/// Stated errors that vary as they do with a smaller probability are a heavy tail: the chi-squared distribution is only nearly theirs.
const UNHEARD_OF: f64 = 1e-4;
/// A scatter that is less probable than this, were the stated errors right, is told.
const TOLD: f64 = 0.005;
/// One that is less probable than this counts in verdicts, told or not: a Birge ratio (R. T. Birge, Phys. Rev. 40 (1932)).
const COUNTED: f64 = 0.05;
/// Degrees of freedom of a standard error that tells none, were they as few as may be: more would make little of how it may vary.
const FEW: f64 = 3.0;
/// Standard errors that vary as those of fewer degrees of freedom are not of samples that are about normal: blocks of exponential
/// noise, eight of them, vary as those of three.
const NORMAL: f64 = 3.0;
/// The fewest degrees of freedom that a standard error is taken to have.
const FEWEST: f64 = 0.5;
/// A procedure's standard errors vary less than the engine's others where it is less probable than this that they vary alike.
const STEADIER: f64 = 0.003;
/// What readings that are the same differ by, in what is stated of them: rounding.
const SAME: f64 = 1e-6;
/// How many times too large a stated error is before that is told: some care is nobody's fault.
const MIN_EXCESS: f64 = 3.0;

/// How the readings of one engine in one case scatter from seed to seed, over what it states of their errors.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct StatedErrors {
    /// Scatter over stated standard error, root of the mean square; null where no error was stated.
    pub ratio: Option<f64>,
    /// Of the scatter: repeated readings less the meters that they were taken at, fewer where meters share their noise.
    pub degrees_of_freedom: f64,
    /// How much of their noise the meters share: the variance of their mean over that of independent meters.
    pub design_effect: f64,
    /// Degrees of freedom by which standard errors vary from seed to seed, where they vary more than those that are stated have it, or
    /// plainly less.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub degrees_of_freedom_seen: Option<f64>,
    /// The probability of a ratio as far from 1, were the stated errors right.
    pub p_value: Option<f64>,
    /// Relative scatter of readings that are claimed to have none, or far more than they do, root of the mean square.
    pub of_claims: Option<f64>,
    /// How its standard errors fall with effort: 1 where their squares do in inverse proportion, 0 where they stay.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub falls_with_effort: Option<f64>,
    /// The meters that this is about, and the relative error that counts there; empty where it is about all.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub at: BTreeMap<MeterId, f64>,
    pub doubt: Option<Doubt>,
}

/// What is wrong with stated errors: a finding of its own, whatever the verdicts.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Doubt {
    TooSmall,
    TooLarge,
    /// They vary from seed to seed by more than those of normal samples: a few samples hold much of the light.
    HeavyTail,
    /// They vary as those of fewer samples than are stated.
    FewerSamples,
    /// They vary less than those of as few samples as are stated: more of them would be needed to excuse as much.
    MoreSamples,
    /// What is claimed to be determined scatters.
    Scatters,
    /// Every seed reads the same, although errors of sampling are stated.
    SameForEverySeed,
    /// The engine did not read again.
    NotReadAgain,
    /// A bound is beyond the tolerance, and nothing shows that it is meant: nothing could ever fail there.
    BeyondTolerance,
}

impl StatedErrors {
    /// Nothing found but a doubt.
    pub const fn doubted(doubt: Doubt) -> Self {
        Self {
            ratio: None,
            degrees_of_freedom: 0.0,
            design_effect: 1.0,
            degrees_of_freedom_seen: None,
            p_value: None,
            of_claims: None,
            falls_with_effort: None,
            at: BTreeMap::new(),
            doubt: Some(doubt),
        }
    }

    /// Found at some meters, with the relative errors that count there; nothing where there are none.
    pub fn doubted_at(doubt: Doubt, at: BTreeMap<MeterId, f64>) -> Option<Self> {
        (!at.is_empty()).then(|| Self { at, ..Self::doubted(doubt) })
    }

    /// Meters by themselves: of each, how probable it is that its readings scatter by so little, were the errors right that are stated
    /// there; 1 where these are not far too large.
    pub fn too_large_alone(meter: &[Estimate]) -> f64 {
        of_one(meter).filter(|one| one.ratio < 1.0 / MIN_EXCESS).map_or(1.0, |one| one.p_value)
    }

    /// What counts at meters whose stated errors their readings of other seeds contradict: how these scatter.
    pub fn too_large_at<'a>(meters: impl IntoIterator<Item = (MeterId, &'a [Estimate])>) -> Option<Self> {
        let (mut at, mut fewest) = (BTreeMap::new(), f64::INFINITY);
        for (meter, readings) in meters {
            if let Some(one) = of_one(readings) {
                at.insert(meter, one.relative);
                fewest = fewest.min(one.freedom);
            }
        }
        Some(Self { degrees_of_freedom: fewest, ..Self::doubted_at(Doubt::TooLarge, at)? })
    }

    /// Of readings whose errors are stated, one list a meter; meters whose error is not of sampling say nothing, and all of them too
    /// little where there are too few. `of_engine` is how the errors of all that the engine read vary.
    pub fn of_sampled(meters: &[Vec<Estimate>], of_engine: &Variation) -> Option<Self> {
        let Scatter { sum, freedom, deviates, .. } = of_repeated(meters)?;
        let design_effect = design_effect(&deviates);
        let ratio = (sum / freedom).sqrt();
        let degrees_of_freedom = freedom / design_effect;
        let chance = ChiSquared::new(degrees_of_freedom).ok()?;
        let (below, above) = (chance.cdf(sum / design_effect), chance.sf(sum / design_effect));
        let own = Variation::of(meters);
        let (varies, varies_beyond) = own.with(of_engine);
        let steady = own.steadier_than_stated().filter(|_| ratio >= SAME);
        let doubt = match ratio {
            r if r < SAME => Some(Doubt::SameForEverySeed),
            // Samples of a heavy tail scatter by what they state, too.
            r if below < TOLD && r < 1.0 / MIN_EXCESS => Some(Doubt::TooLarge),
            _ if varies_beyond && varies.is_some_and(|seen| seen < NORMAL) => Some(Doubt::HeavyTail),
            _ if above < TOLD => Some(Doubt::TooSmall),
            _ if varies_beyond => Some(Doubt::FewerSamples),
            _ => steady.map(|_| Doubt::MoreSamples),
        };
        // Where what is stated is far too large, how it varies tells nothing of the readings either: their own scatter counts.
        let is_contradicted = matches!(doubt, Some(Doubt::TooLarge | Doubt::SameForEverySeed));
        let of_scatter = Self::of_claims(meters).filter(|_| is_contradicted);
        Some(Self {
            ratio: Some(ratio),
            degrees_of_freedom: of_scatter
                .as_ref()
                .map_or(degrees_of_freedom, |s| s.degrees_of_freedom.min(degrees_of_freedom)),
            design_effect,
            degrees_of_freedom_seen: varies.or(steady),
            p_value: Some(2.0 * below.min(above)),
            of_claims: of_scatter.and_then(|s| s.of_claims),
            doubt,
            ..Self::doubted(Doubt::TooSmall)
        })
    }

    /// Of readings that are claimed to be determined and are not. What is next to nothing beside the brightest meter scatters by
    /// rounding.
    pub fn of_claims(meters: &[Vec<Estimate>]) -> Option<Self> {
        let mean = |readings: &[Estimate]| readings.iter().map(|e| e.value).sum::<f64>() / readings.len() as f64;
        let brightest = meters.iter().map(|readings| mean(readings)).fold(0.0, f64::max);
        let (mut sum, mut freedom, mut of_meters) = (0.0, 0.0, vec![]);
        for readings in meters {
            let mean = mean(readings);
            if mean > SAME * brightest {
                let of_meter = readings.iter().map(|e| (e.value / mean - 1.0).powi(2)).sum::<f64>();
                let own = readings.len().saturating_sub(1) as f64;
                sum += of_meter;
                freedom += own;
                of_meters.push(Estimate {
                    value: mean,
                    uncertainty: Uncertainty::sampled((of_meter / own).sqrt(), Some(own)),
                });
            }
        }
        let relative = (sum / freedom).sqrt();
        // Where meters scatter unlike one another, what they scatter by together says little of any one.
        let across = Variation::across(&of_meters).with(&Variation::default()).0.unwrap_or(freedom);
        let degrees_of_freedom = freedom.min(across.max(FEWEST));
        let found = Self { degrees_of_freedom, of_claims: Some(relative), ..Self::doubted(Doubt::Scatters) };
        (relative > 0.0 && relative.is_finite()).then_some(found)
    }

    /// A reading at a meter with the error that it has by all that was found of its engine.
    #[must_use]
    pub fn corrected(found: &[Self], meter: &MeterId, estimate: Estimate) -> Estimate {
        found.iter().fold(estimate, |estimate, stated| match stated.at.get(meter) {
            Some(relative) => {
                Estimate { uncertainty: stated.allow(relative * estimate.value.abs(), estimate), ..estimate }
            }
            None if stated.at.is_empty() => stated.correct(estimate),
            None => estimate,
        })
    }

    /// What a reading's error is where no more than this counts.
    fn allow(&self, most: f64, estimate: Estimate) -> Uncertainty {
        match (self.doubt, estimate.uncertainty) {
            (Some(Doubt::BeyondTolerance), Uncertainty::Bound(_)) => Uncertainty::Bound(most),
            (Some(Doubt::BeyondTolerance), Uncertainty::StandardError { value, degrees_of_freedom, .. }) => {
                Uncertainty::StandardError { value, degrees_of_freedom, bound: most }
            }
            (Some(Doubt::NotReadAgain), Uncertainty::StandardError { value, degrees_of_freedom, bound }) => {
                let degrees_of_freedom = degrees_of_freedom.map(|few| few.max(FEW));
                Uncertainty::StandardError { value: value.min(most), degrees_of_freedom, bound }
            }
            (Some(Doubt::TooLarge), Uncertainty::StandardError { bound, .. }) => {
                Uncertainty::StandardError { value: most, degrees_of_freedom: Some(self.degrees_of_freedom), bound }
            }
            (_, stated) => stated,
        }
    }

    /// The degrees of freedom of a heavy tail at a meter, where there is one; where readings of other seeds contradict what is stated, no
    /// tail excuses it.
    pub fn heavy_tail(found: &[Self], meter: &MeterId) -> Option<f64> {
        let is_contradicted = found.iter().any(|f| f.doubt == Some(Doubt::TooLarge) && f.at.contains_key(meter));
        let heavy = found.iter().filter(|f| f.doubt == Some(Doubt::HeavyTail) && !is_contradicted);
        heavy.filter_map(|f| f.degrees_of_freedom_seen).reduce(f64::min)
    }

    /// What a reading's error is, by how such readings scatter.
    ///
    /// A standard error says how readings scatter, and nothing else: one that is far too large is as wrong as one that is too
    /// small. What may be off in every reading alike is a bound.
    #[must_use]
    fn correct(&self, estimate: Estimate) -> Estimate {
        let freedom = self.degrees_of_freedom;
        let uncertainty = match (estimate.uncertainty, self.ratio, self.of_claims) {
            (Uncertainty::StandardError { value, bound, .. }, Some(_), Some(relative)) if value > 0.0 => {
                let value = relative * estimate.value.abs();
                Uncertainty::StandardError { value, degrees_of_freedom: Some(freedom), bound }
            }
            (Uncertainty::StandardError { value, degrees_of_freedom, bound }, Some(ratio), _) if value > 0.0 => {
                let seen = self.degrees_of_freedom_seen.map(|seen| seen.max(FEWEST));
                let stated = match self.doubt {
                    Some(Doubt::MoreSamples) => seen,
                    _ => [degrees_of_freedom, seen].into_iter().flatten().reduce(f64::min),
                };
                let (by, degrees_of_freedom) = if self.counts(ratio) {
                    // Relative variances of the two standard errors add up.
                    let of_both = stated.map_or(freedom, |stated| (stated.recip() + freedom.recip()).recip());
                    (ratio, Some(of_both.max(FEWEST)))
                } else {
                    (1.0, stated)
                };
                Uncertainty::StandardError { value: by * value, degrees_of_freedom, bound }
            }
            (stated, None, Some(relative)) => Uncertainty::StandardError {
                value: relative * estimate.value,
                degrees_of_freedom: Some(freedom),
                bound: stated.bound(),
            },
            (stated, ..) => stated,
        };
        Estimate { uncertainty, ..estimate }
    }

    /// What several looks together are uncertain by: as little as one of them where their tail is heavy, since the mean of more such samples
    /// is hardly more normal.
    #[must_use]
    pub fn of_looks(found: &[Self], meter: &MeterId, together: Uncertainty) -> Uncertainty {
        match (together, Self::heavy_tail(found, meter)) {
            (Uncertainty::StandardError { value, degrees_of_freedom, bound }, Some(seen)) => {
                let few = degrees_of_freedom.map_or(seen, |all| all.min(seen)).max(FEWEST);
                Uncertainty::StandardError { value, degrees_of_freedom: Some(few), bound }
            }
            _ => together,
        }
    }

    fn counts(&self, ratio: f64) -> bool {
        match self.doubt {
            // What is the same for every seed owes nothing to chance.
            Some(Doubt::TooSmall | Doubt::TooLarge | Doubt::SameForEverySeed | Doubt::Scatters) => true,
            Some(Doubt::NotReadAgain | Doubt::BeyondTolerance) => false,
            Some(Doubt::HeavyTail | Doubt::FewerSamples | Doubt::MoreSamples) | None => {
                ratio > 1.0 && self.p_value.is_some_and(|p| p < 2.0 * COUNTED)
            }
        }
    }
}

/// How standard errors of one effort vary from seed to seed: the logarithm of a variance with n degrees of freedom has the variance
/// psi'(n / 2) (Bartlett and Kendall, Suppl. J. Roy. Statist. Soc. 8 (1946)).
///
/// Student's t with the n that is seen covers means of skewed samples, too: its two-sided quantiles of .01 and .001 are at least .85 of
/// those of 2 million means of 8 and of 32 samples, exponential, Pareto (1.5 to 3) or lognormal (sigma .5 to 2), and most are far wider.
#[derive(Clone, Copy, Debug, Default)]
pub struct Variation {
    squares: f64,
    freedom: f64,
    /// The squares over those of as many degrees of freedom as are stated; where none are, of as few as may be, and of many.
    over_few: f64,
    over_many: f64,
    /// The most degrees of freedom that are stated.
    most: f64,
}

impl Variation {
    /// Of readings of one effort, all but the last of each meter.
    pub fn of(meters: &[Vec<Estimate>]) -> Self {
        meters.iter().map(|readings| Self::across(&readings[..readings.len().saturating_sub(1)])).sum()
    }

    /// Of estimates whose standard errors would be about the same.
    fn across(estimates: &[Estimate]) -> Self {
        let stated = estimates.iter().filter_map(|e| Some((e.uncertainty.standard_error()?, e.uncertainty)));
        let logs: Vec<(f64, Option<f64>)> =
            stated.filter(|(e, _)| *e > 0.0).map(|(e, u)| (2.0 * e.ln(), u.degrees_of_freedom())).collect();
        let mean = logs.iter().map(|(log, _)| log).sum::<f64>() / logs.len() as f64;
        let mut all = Self { freedom: logs.len().saturating_sub(1) as f64, ..Self::default() };
        for (log, stated) in &logs {
            all.most = all.most.max(stated.unwrap_or(MANY));
            let square = (log - mean).powi(2);
            all.squares += square;
            all.over_few += square / trigamma(stated.unwrap_or(FEW) / 2.0);
            all.over_many += square / trigamma(stated.unwrap_or(MANY) / 2.0);
        }
        all
    }

    /// The degrees of freedom of standard errors that vary less than it is thought possible of those with as few as are stated: few
    /// enough to excuse almost anything.
    fn steadier_than_stated(&self) -> Option<f64> {
        let is_steadier = || ChiSquared::new(self.freedom).is_ok_and(|c| c.cdf(self.over_many) < UNHEARD_OF);
        (self.most < NORMAL && is_steadier()).then(|| self.degrees_of_freedom())
    }

    fn degrees_of_freedom(&self) -> f64 {
        2.0 * of_trigamma(self.squares / self.freedom)
    }

    fn is_less_probable_than(&self, probability: f64, over: f64) -> bool {
        ChiSquared::new(self.freedom).is_ok_and(|chance| chance.sf(over) < probability)
    }

    /// The degrees of freedom of a procedure's standard errors, where these vary more than those that are stated have it, by itself or by
    /// all that its engine read; and whether that is unheard of. What is plainly steadier than its engine's other errors stands alone.
    fn with(&self, of_engine: &Self) -> (Option<f64>, bool) {
        let variance = of_engine.squares / of_engine.freedom;
        let is_steadier = ChiSquared::new(self.freedom).is_ok_and(|c| c.cdf(self.squares / variance) < STEADIER);
        let heard = [Some(self), Some(of_engine).filter(|_| !is_steadier)];
        let heard = || heard.into_iter().flatten();
        let varying = heard().filter(|v| v.is_less_probable_than(COUNTED, v.over_many));
        (
            varying.map(Self::degrees_of_freedom).reduce(f64::min),
            heard().any(|v| v.is_less_probable_than(UNHEARD_OF, v.over_few)),
        )
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

/// The number of which this is the trigamma: it falls.
fn of_trigamma(value: f64) -> f64 {
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

impl fmt::Display for StatedErrors {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (ratio, freedom) = (self.ratio.unwrap_or(0.0), self.degrees_of_freedom);
        let at = match self.at.first_key_value() {
            Some((meter, _)) if self.at.len() == 1 => format!("at {meter}"),
            Some((meter, _)) => format!("at {} meters ({meter} first)", self.at.len()),
            None => String::new(),
        };
        match self.doubt {
            Some(Doubt::TooLarge) if !at.is_empty() => write!(
                f,
                "its standard errors {at} are far too large: its readings of other seeds scatter by {:.2e} at most \
                 there ({freedom:.0} degrees of freedom); verdicts go by the scatter of each",
                self.at.values().copied().fold(0.0, f64::max)
            ),
            Some(Doubt::TooSmall) => write!(
                f,
                "its standard errors are {ratio:.1} times too small: that is how its readings of other seeds scatter ({freedom:.0} \
                 degrees of freedom); verdicts go by the scatter"
            ),
            Some(Doubt::TooLarge) => write!(
                f,
                "its standard errors are {:.1} times too large: its readings of other seeds scatter by as much less ({freedom:.0} \
                 degrees of freedom); verdicts go by the scatter",
                ratio.recip()
            ),
            Some(Doubt::HeavyTail) => write!(
                f,
                "a heavy tail: its standard errors vary from seed to seed as those of {:.1} degrees of freedom do, so that a few of its \
                 samples hold much of the light and others are still to come; verdicts wait for what lies beyond that",
                self.degrees_of_freedom_seen.unwrap_or(FEWEST)
            ),
            Some(Doubt::FewerSamples) => write!(
                f,
                "its standard errors vary from seed to seed as those of {:.1} degrees of freedom do, fewer than it states; verdicts go \
                 by these",
                self.degrees_of_freedom_seen.unwrap_or(FEWEST)
            ),
            Some(Doubt::MoreSamples) => write!(
                f,
                "its standard errors vary less from seed to seed than those of as few degrees of freedom as it states: as those of {:.3e}; \
                 verdicts go by these",
                self.degrees_of_freedom_seen.unwrap_or(MANY)
            ),
            Some(Doubt::Scatters) => write!(
                f,
                "it claims readings without any scatter, and those of other seeds scatter by {:.2e} ({freedom:.0} degrees of \
                 freedom); verdicts go by the scatter",
                self.of_claims.unwrap_or(0.0)
            ),
            Some(Doubt::SameForEverySeed) => {
                write!(
                    f,
                    "it states errors of sampling and reads the same with every seed: there is no chance in its readings, and none counts"
                )
            }
            Some(Doubt::NotReadAgain) => {
                write!(
                    f,
                    "it did not read again with another seed: what it states of its errors could not be checked, and counts up to \
                     half the tolerance"
                )
            }
            Some(Doubt::BeyondTolerance) => write!(
                f,
                "the bounds that it states {at} are beyond the tolerance: nothing that it reads there could ever fail; its readings \
                 are judged as they stand"
            ),
            None => write!(
                f,
                "readings of other seeds scatter by {ratio:.2} of what it states ({freedom:.0} degrees of freedom)"
            ),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::system::random::normal;

    const METERS: usize = 4;

    /// Readings of a meter each, four seeds, with the given scatter and what is stated of it.
    fn readings(seed: u64, scatter: f64, stated: f64) -> Vec<Vec<Estimate>> {
        let mut random = fastrand::Rng::with_seed(seed);
        let mut one = || Estimate {
            value: 100.0 + scatter * normal(&mut random),
            uncertainty: Uncertainty::sampled(stated, Some(7.0)),
        };
        (0..METERS).map(|_| (0..4).map(|_| one()).collect()).collect()
    }

    fn of(meters: &[Vec<Estimate>]) -> StatedErrors {
        of_sampled(meters).unwrap()
    }

    fn of_sampled(meters: &[Vec<Estimate>]) -> Option<StatedErrors> {
        StatedErrors::of_sampled(meters, &Variation::of(meters))
    }

    fn told(scatter: f64, stated: f64, doubt: Doubt) -> usize {
        let is_told = |seed: &u64| {
            let found = of(&readings(*seed, scatter, stated));
            found.doubt == Some(doubt)
        };
        (0..1000).filter(is_told).count()
    }

    #[test]
    fn errors_three_times_too_small_or_ten_times_too_large_are_told_and_right_ones_are_not() {
        assert!(told(3.0, 1.0, Doubt::TooSmall) > 980, "{}", told(3.0, 1.0, Doubt::TooSmall));
        assert!(told(0.1, 1.0, Doubt::TooLarge) > 980);
        assert!(told(1.0, 1.0, Doubt::TooSmall) <= 12);
        assert_eq!(told(1.0, 1.0, Doubt::TooLarge), 0);
        assert_eq!(told(0.0, 1.0, Doubt::SameForEverySeed), 1000);
    }

    #[test]
    fn a_heavy_tail_is_told_by_errors_that_vary_and_normal_samples_have_none() {
        let told = |seed: u64, heaviness: f64, meters: usize| {
            let mut random = fastrand::Rng::with_seed(seed);
            let mut sample =
                || if heaviness > 0.0 { (heaviness * normal(&mut random)).exp() } else { 9.0 + normal(&mut random) };
            let mut reading = || Estimate::of_samples(&(0..8).map(|_| sample()).collect::<Vec<f64>>());
            let all: Vec<Vec<Estimate>> = (0..meters).map(|_| (0..4).map(|_| reading()).collect()).collect();
            of(&all).doubt == Some(Doubt::HeavyTail)
        };
        let count = |heaviness, meters| (0..1000).filter(|seed| told(*seed, heaviness, meters)).count();
        assert!(count(2.0, 6) > 990, "{}", count(2.0, 6));
        assert!(count(0.0, 6) <= 2 && count(0.0, 40) <= 2, "{} {}", count(0.0, 6), count(0.0, 40));
        assert!((trigamma(1.0) - std::f64::consts::PI.powi(2) / 6.0).abs() < 1e-5);
    }

    /// Means of so many blocks of normal noise with their own standard errors, as an adapter that follows the docs gives them.
    fn of_blocks(seed: u64, meters: usize, blocks: usize, noise: f64) -> Vec<Vec<Estimate>> {
        let mut random = fastrand::Rng::with_seed(seed);
        let mut reading =
            || Estimate::of_samples(&(0..blocks).map(|_| 100.0 + noise * normal(&mut random)).collect::<Vec<f64>>());
        (0..meters).map(|_| (0..4).map(|_| reading()).collect()).collect()
    }

    #[test]
    fn right_errors_of_few_blocks_are_not_called_too_small() {
        for (meters, blocks) in [(20, 2), (60, 2), (20, 4), (20, 8), (220, 8)] {
            let told = |seed: &u64| {
                let found = of_sampled(&of_blocks(*seed, meters, blocks, 0.3));
                found.is_some_and(|found| matches!(found.doubt, Some(Doubt::TooSmall | Doubt::TooLarge)))
            };
            let count = (0..600).filter(told).count();
            assert!(count <= 12, "{count} of 600 with {meters} meters of {blocks} blocks");
        }
        // A third of what is stated for so many blocks is plainly too small.
        let shrunk = |e: &Estimate| Estimate { uncertainty: e.uncertainty.times(1.0 / 3.0), ..*e };
        let told = |seed: &u64| {
            let meters = of_blocks(*seed, 12, 4, 0.3);
            let meters: Vec<Vec<Estimate>> = meters.iter().map(|m| m.iter().map(shrunk).collect()).collect();
            of(&meters).doubt == Some(Doubt::TooSmall)
        };
        assert!((0..100).filter(told).count() > 90);
    }

    /// How many of 300 procedures of 24 honest meters, seven readings each, have one whose stated error seems contradicted by itself.
    fn contradicted(reading: impl Fn(&mut fastrand::Rng) -> Estimate) -> usize {
        let is_found = |seed: &u64| {
            let mut random = fastrand::Rng::with_seed(*seed);
            let mut meter = || (0..7).map(|_| reading(&mut random)).collect::<Vec<Estimate>>();
            (0..24).any(|_| StatedErrors::too_large_alone(&meter()) < TOLD / 24.0)
        };
        (0..300).filter(is_found).count()
    }

    #[test]
    fn right_errors_of_a_meter_are_not_contradicted_by_itself_whatever_the_noise() {
        type Sample = fn(&mut fastrand::Rng) -> f64;
        let samples: [(&str, Sample); 4] = [
            ("normal", |random| 100.0 + 0.3 * normal(random)),
            ("lognormal 1", |random| normal(random).exp()),
            ("lognormal 2", |random| (2.0 * normal(random)).exp()),
            ("Pareto 1.5", |random| random.f64().max(1e-12).powf(-1.0 / 1.5)),
        ];
        for (name, sample) in samples {
            for blocks in [2, 4, 8] {
                let count = contradicted(|random| {
                    Estimate::of_samples(&(0..blocks).map(|_| sample(random)).collect::<Vec<f64>>())
                });
                assert!(count <= 4, "{count} of 300, {blocks} blocks of {name}");
            }
        }
        // A tenth of the light in one sample of a thousand; where none is met, nothing is stated.
        let rare = |random: &mut fastrand::Rng| {
            let hits = f64::from(u32::try_from((0..1000).filter(|_| random.f64() < 1e-3).count()).unwrap());
            Estimate { value: 0.9 + 0.1 * hits, uncertainty: Uncertainty::sampled(0.1 * hits.sqrt(), Some(999.0)) }
        };
        // Seven readings are the same by chance in one of 1,000 such meters.
        assert!(contradicted(rare) <= 15, "{}", contradicted(rare));
    }

    #[test]
    fn a_wide_error_at_a_meter_is_contradicted_by_its_own_scatter_whatever_it_varies_like() {
        for (scatter, stated, varies) in [(0.2, 30.0, 0.0), (0.2, 6.0, 0.0), (0.2, 5.0, 2.0), (0.0, 1.0, 0.0)] {
            let found = (0..200).filter(|seed| {
                let mut random = fastrand::Rng::with_seed(*seed);
                let mut one = || Estimate {
                    value: 100.0 + scatter * normal(&mut random),
                    uncertainty: Uncertainty::sampled(stated * (varies * normal(&mut random)).exp(), Some(7.0)),
                };
                StatedErrors::too_large_alone(&(0..7).map(|_| one()).collect::<Vec<Estimate>>()) < TOLD / 24.0
            });
            let count = found.count();
            assert!(count > 170, "{scatter} {stated} {varies}: {count} of 200");
        }
    }

    #[test]
    fn what_is_found_at_a_meter_counts_there_alone() {
        let [here, there] = ["desk[0]", "desk[1]"].map(|id| MeterId(id.to_owned()));
        let wide = |value| Estimate { value, uncertainty: Uncertainty::sampled(30.0, Some(7.0)) };
        let readings = [99.0, 100.0, 101.0].map(wide);
        let found = [StatedErrors::too_large_at([(here.clone(), &readings[..])]).unwrap()];
        let corrected = StatedErrors::corrected(&found, &here, wide(200.0)).uncertainty;
        assert!((corrected.standard_error().unwrap() - 2.0).abs() < 1e-12, "{corrected:?}");
        assert_eq!(corrected.degrees_of_freedom(), Some(2.0));
        assert_eq!(StatedErrors::corrected(&found, &there, wide(200.0)), wide(200.0));
        let limit = |doubt| StatedErrors::doubted_at(doubt, [(here.clone(), 0.01)].into()).unwrap();
        let unchecked = StatedErrors::corrected(&[limit(Doubt::NotReadAgain)], &here, wide(200.0));
        assert_eq!(unchecked.uncertainty, Uncertainty::sampled(2.0, Some(7.0)));
        let bounded = Estimate { value: 200.0, uncertainty: Uncertainty::Bound(50.0) };
        let judged = StatedErrors::corrected(&[limit(Doubt::BeyondTolerance)], &here, bounded);
        assert_eq!(judged.uncertainty, Uncertainty::Bound(2.0));
    }

    #[test]
    fn no_tail_excuses_errors_that_readings_contradict() {
        let mut random = fastrand::Rng::with_seed(4);
        let mut one = || Estimate {
            value: 100.0 + 0.1 * normal(&mut random),
            uncertainty: Uncertainty::sampled(0.2 * (2.0 * normal(&mut random)).exp(), Some(7.0)),
        };
        let meters: Vec<Vec<Estimate>> = (0..24).map(|_| (0..4).map(|_| one()).collect()).collect();
        let found = of(&meters);
        assert_eq!(found.doubt, Some(Doubt::TooLarge), "{found}");
        let error = found.correct(meters[0][0]).uncertainty;
        assert!(error.standard_error().unwrap() < 0.2 && error.degrees_of_freedom().unwrap() > 3.0, "{error:?}");
    }

    #[test]
    fn a_steady_error_has_more_degrees_of_freedom_than_one() {
        let mut random = fastrand::Rng::with_seed(3);
        let mut one =
            || Estimate { value: 100.0 + 5.0 * normal(&mut random), uncertainty: Uncertainty::sampled(5.0, Some(1.0)) };
        let meters: Vec<Vec<Estimate>> = (0..30).map(|_| (0..4).map(|_| one()).collect()).collect();
        let found = of(&meters);
        assert_eq!(found.doubt, Some(Doubt::MoreSamples), "{found}");
        assert!(found.correct(meters[0][0]).uncertainty.degrees_of_freedom().unwrap() > 1e3);
        // Two blocks have one, and their errors show it.
        let honest = |seed: &u64| of_sampled(&of_blocks(*seed, 30, 2, 0.3)).unwrap().doubt == Some(Doubt::MoreSamples);
        assert!((0..300).filter(honest).count() <= 1);
    }

    #[test]
    fn claims_that_scatter_unlike_one_another_say_little_of_any_one() {
        let mut random = fastrand::Rng::with_seed(8);
        let mut claims = |noise: &dyn Fn(usize) -> f64| -> Vec<Vec<Estimate>> {
            let mut one = |meter| Estimate::exact(100.0 * (1.0 + noise(meter) * normal(&mut random)));
            (0..20).map(|meter| (0..4).map(|_| one(meter)).collect()).collect()
        };
        let alike = StatedErrors::of_claims(&claims(&|_| 0.01)).unwrap();
        let unlike = StatedErrors::of_claims(&claims(&|meter| if meter < 3 { 0.03 } else { 3e-4 })).unwrap();
        assert!(alike.degrees_of_freedom > 10.0, "{alike}");
        assert!(unlike.degrees_of_freedom < 1.5, "{unlike}");
    }

    #[test]
    fn more_samples_than_there_are_change_no_verdict() {
        // Eight blocks each, stated as 4096 samples.
        let mut random = fastrand::Rng::with_seed(5);
        let mut reading = || {
            let of_blocks = Estimate::of_samples(&(0..8).map(|_| 100.0 + normal(&mut random)).collect::<Vec<f64>>());
            let error = of_blocks.uncertainty.standard_error().unwrap();
            Estimate { uncertainty: Uncertainty::sampled(error, Some(4095.0)), ..of_blocks }
        };
        let all: Vec<Vec<Estimate>> = (0..24).map(|_| (0..4).map(|_| reading()).collect()).collect();
        let found = of(&all);
        assert_eq!(found.doubt, Some(Doubt::FewerSamples), "{found}");
        let freedom = found.correct(all[0][0]).uncertainty.degrees_of_freedom().unwrap();
        assert!((4.5..11.0).contains(&freedom), "{freedom}");
    }

    #[test]
    fn noise_that_meters_share_says_little_of_stated_errors() {
        let told = |seed: &u64| {
            let mut random = fastrand::Rng::with_seed(*seed);
            let drawn: Vec<f64> = (0..4).map(|_| 100.0 + normal(&mut random)).collect();
            let one = |value: &f64| Estimate { value: *value, uncertainty: Uncertainty::sampled(1.0, Some(7.0)) };
            let found = of(&vec![drawn.iter().map(one).collect(); 24]);
            found.doubt.is_some()
        };
        let count = (0..1000).filter(told).count();
        // .5 % either way.
        assert!(count <= 20, "{count} of 1000");
    }

    #[test]
    fn rounding_in_the_dark_is_no_scatter() {
        let readings = |values: [f64; 4]| values.map(Estimate::exact).to_vec();
        let dark = readings([1e-12, 3e-12, 2e-12, 1e-13]);
        assert_eq!(StatedErrors::of_claims(&[readings([100.0; 4]), dark]), None);
    }

    #[test]
    fn what_is_corrected_has_the_error_that_is_there() {
        let found = of(&readings(1, 3.0, 1.0));
        let corrected = found.correct(readings(1, 3.0, 1.0)[0][0]).uncertainty;
        assert!((2.0..4.5).contains(&corrected.standard_error().unwrap()), "{corrected:?}");
        // Seven that are stated, and those of the scatter.
        let both = (7f64.recip() + found.degrees_of_freedom.recip()).recip();
        assert!((corrected.degrees_of_freedom().unwrap() - both).abs() < 1e-12);
        let fine = StatedErrors { p_value: Some(0.7), doubt: None, ratio: Some(1.1), ..found.clone() };
        assert_eq!(fine.correct(readings(1, 3.0, 1.0)[0][0]), readings(1, 3.0, 1.0)[0][0]);
        // A bound is no statement about scatter.
        let bounded = Estimate { value: 1.0, uncertainty: Uncertainty::Bound(0.1) };
        assert_eq!(found.correct(bounded), bounded);
    }

    #[test]
    fn a_claim_that_scatters_has_the_error_of_its_scatter() {
        let claimed = |value| Estimate::exact(value);
        let found = StatedErrors::of_claims(&[vec![claimed(9.9), claimed(10.1)], vec![claimed(0.0); 2]]).unwrap();
        let corrected = found.correct(claimed(20.0)).uncertainty;
        assert!((corrected.standard_error().unwrap() - 20.0 * 0.01 * 2f64.sqrt()).abs() < 1e-12, "{corrected:?}");
        assert_eq!(corrected.degrees_of_freedom(), Some(1.0));
        assert!(StatedErrors::of_claims(&[vec![claimed(10.0); 4]]).is_none());
    }
}
