//! What is stated of errors, held against how readings of other seeds scatter.

use std::collections::BTreeMap;
use std::fmt;
use std::iter::Sum;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use statrs::distribution::{ChiSquared, ContinuousCDF};

use super::scatter::{Alone, MANY, Scatter, Tails, alike, of_one, of_repeated};
use super::{Estimate, MeterId, ROUNDING, Uncertainty, design_effect};

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
/// How many times too small a stated error is that is none but for rounding: digits tell nothing then.
const FAR_TOO_SMALL: f64 = 1e4;
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
    /// Whether all that scatters of a claim is its first reading: those of other seeds, asked by themselves, are one.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub is_first_alone: bool,
    /// The largest part of the light of a meter that one sample holds, where some do that lie far from all others.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub largest_portion: Option<f64>,
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
    /// The true value does not lie within a bound, and what is read lies beyond the tolerance.
    Refuted,
}

/// A meter where nothing but an error keeps a reading from failing.
pub struct Sheltered {
    pub meter: MeterId,
    /// With other seeds, the one that is judged among them.
    pub readings: Vec<Estimate>,
    /// The relative standard error that keeps it; `None` where no sample met anything.
    pub counts: Option<f64>,
}

/// How readings of a meter are seen to scatter.
struct Seen {
    relative: f64,
    freedom: f64,
}

/// How meters scatter together, where that is alike over what counts of each; they show less where they share their noise.
fn together(meters: &[(&Sheltered, &Alone, f64)]) -> Option<Vec<Seen>> {
    let ratios: Vec<(f64, f64)> = meters.iter().map(|(_, one, counts)| (one.relative / counts, one.freedom)).collect();
    let (ratio, freedom) = alike(&ratios)?;
    let deviates = |(m, one, _): &(&Sheltered, &Alone, f64)| -> Vec<f64> {
        let mean = m.readings.iter().map(|e| e.value).sum::<f64>() / m.readings.len() as f64;
        m.readings.iter().map(|e| (e.value / mean - 1.0) / one.relative).collect()
    };
    let of_meters: Vec<Vec<f64>> = meters.iter().map(deviates).collect();
    let draws = of_meters.iter().map(Vec::len).min()?;
    let by_draw: Vec<Vec<f64>> = (0..draws).map(|k| of_meters.iter().map(|z| z[k]).collect()).collect();
    let freedom = freedom / design_effect(&by_draw);
    Some(meters.iter().map(|(_, _, counts)| Seen { relative: ratio * counts, freedom }).collect())
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
            is_first_alone: false,
            largest_portion: None,
            at: BTreeMap::new(),
            doubt: Some(doubt),
        }
    }

    /// Found at some meters, with the relative errors that count there; nothing where there are none.
    pub fn doubted_at(doubt: Doubt, at: BTreeMap<MeterId, f64>) -> Option<Self> {
        (!at.is_empty()).then(|| Self { at, ..Self::doubted(doubt) })
    }

    /// What counts where nothing but an error keeps readings from failing: how they scatter with other seeds, where that is less, together
    /// where they scatter alike over what is stated. Of tails that are not known to be normal only what is plainly contradicted counts less,
    /// and where they are heavy, nothing does.
    pub fn of_sheltered<'a>(meters: &'a [Sheltered], tails: Tails) -> Vec<Self> {
        let alone = |m: &'a Sheltered| Some((m, of_one(&m.readings)?.against(m.counts)));
        let alone: Vec<(&Sheltered, Alone)> = meters.iter().filter_map(alone).collect();
        let is_contradicted = |one: &Alone| one.ratio < 1.0 / MIN_EXCESS && one.p_value < TOLD / meters.len() as f64;
        let unseen = alone.iter().filter(|(m, _)| m.counts.is_none() && tails != Tails::Heavy);
        let (same, others): (Vec<_>, Vec<_>) = unseen.partition(|(_, one)| one.relative <= ROUNDING);
        let stated = alone.iter().filter_map(|(m, one)| Some((*m, one, m.counts?)));
        let stated: Vec<(&Sheltered, &Alone, f64)> = stated
            .filter(|(_, one, _)| tails == Tails::Normal || tails == Tails::Unknown && is_contradicted(one))
            .collect();
        let is_told = !stated.is_empty() && stated.iter().all(|(_, one, _)| is_contradicted(one));
        let own = |one: &Alone| Seen { relative: one.relative, freedom: one.freedom };
        let of_stated = together(&stated).unwrap_or_else(|| stated.iter().map(|(_, one, _)| own(one)).collect());
        let less = stated.iter().zip(of_stated).filter(|((_, _, counts), seen)| seen.relative < *counts);
        let less: Vec<(&Sheltered, Seen)> =
            less.map(|((m, ..), seen)| (*m, seen)).chain(others.into_iter().map(|(m, one)| (*m, own(one)))).collect();
        let degrees_of_freedom = less.iter().map(|(_, seen)| seen.freedom).fold(f64::INFINITY, f64::min);
        let at = less.into_iter().map(|(m, seen)| (m.meter.clone(), seen.relative)).collect();
        let narrower = Self::doubted_at(Doubt::TooLarge, at);
        let narrower =
            narrower.map(|found| Self { degrees_of_freedom, doubt: found.doubt.filter(|_| is_told), ..found });
        let same = same.into_iter().map(|(m, _)| (m.meter.clone(), 0.0)).collect();
        Self::doubted_at(Doubt::SameForEverySeed, same).into_iter().chain(narrower).collect()
    }

    /// What is found of an engine by all readings with other seeds: a few samples hold much of the light.
    pub fn of_tails(meters: &[Vec<Estimate>], tails: Tails) -> Option<Self> {
        let portion =
            |e: &Estimate| Some((e.uncertainty.standard_error()? / e.value).powi(2)).filter(|p| p.is_finite());
        let largest_portion = meters.iter().flatten().filter_map(portion).reduce(f64::max)?;
        let found = Self { largest_portion: Some(largest_portion), ..Self::doubted(Doubt::HeavyTail) };
        (tails == Tails::Heavy).then_some(found)
    }

    /// The error of a reading below the truth where samples met light, but none of the few that hold much: were they still to come, how many of
    /// them has Poisson's law.
    pub fn to_come(found: &[Self], value: f64, truth: f64) -> Option<f64> {
        let portion = found.iter().filter_map(|f| f.largest_portion).reduce(f64::max)?;
        (value < truth).then(|| (portion * truth * (truth - value)).sqrt())
    }

    /// Of sampled meters whose readings state no error with any seed, and are other ones with every seed: what is known for certain does not
    /// scatter, and what no sample met reads the same.
    pub fn of_unstated(meters: &[(MeterId, Vec<Estimate>)]) -> Option<Self> {
        let claims =
            |e: &Estimate| e.uncertainty == Uncertainty::NotSeen || e.uncertainty.standard_error() == Some(0.0);
        let scatter = |(meter, readings): &(MeterId, Vec<Estimate>)| {
            let mean = readings.iter().map(|e| e.value).sum::<f64>() / readings.len() as f64;
            let is_other = |(k, e): (usize, &Estimate)| {
                readings[..k].iter().all(|before| (before.value - e.value).abs() > ROUNDING * mean.abs())
            };
            let are_others = readings.len() > 2 && readings.iter().enumerate().all(is_other);
            let square =
                readings.iter().map(|e| (e.value / mean - 1.0).powi(2)).sum::<f64>() / (readings.len() as f64 - 1.0);
            (are_others && readings.iter().all(claims)).then(|| (meter.clone(), square.sqrt()))
        };
        let at: BTreeMap<MeterId, f64> = meters.iter().filter_map(scatter).collect();
        let relative = at.values().copied().fold(0.0, f64::max);
        let freedom = meters.iter().map(|(_, readings)| readings.len() as f64 - 1.0).fold(f64::INFINITY, f64::min);
        let found = Self::doubted_at(Doubt::Scatters, at)?;
        Some(Self { of_claims: Some(relative), degrees_of_freedom: freedom, ..found })
    }

    /// Whether it is about how readings scatter at single meters.
    fn is_of_scatter_at(&self, meter: &MeterId) -> bool {
        self.at.contains_key(meter) && matches!(self.doubt, None | Some(Doubt::TooLarge | Doubt::SameForEverySeed))
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
        let steady = own.steadier_than_stated().filter(|_| ratio >= ROUNDING);
        let doubt = match ratio {
            r if r < ROUNDING => Some(Doubt::SameForEverySeed),
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
            if mean > ROUNDING * brightest {
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
        let others_agree = |readings: &Vec<Estimate>| {
            let others = &readings[..readings.len().saturating_sub(1)];
            others.len() > 1 && others.iter().all(|e| (e.value - others[0].value).abs() <= ROUNDING * brightest)
        };
        let is_first_alone = meters.iter().all(others_agree);
        let of_claims = Some(relative);
        let found = Self { degrees_of_freedom, of_claims, is_first_alone, ..Self::doubted(Doubt::Scatters) };
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
            (Some(Doubt::BeyondTolerance | Doubt::Refuted), Uncertainty::Bound(_)) => Uncertainty::Bound(most),
            (
                Some(Doubt::BeyondTolerance | Doubt::Refuted),
                Uncertainty::StandardError { value, degrees_of_freedom, .. },
            ) => Uncertainty::StandardError { value, degrees_of_freedom, bound: most },
            // Nobody has seen the samples that would make it less certain than it is said to be.
            (Some(Doubt::NotReadAgain), Uncertainty::StandardError { value, bound, .. }) => {
                Uncertainty::StandardError { value: value.min(most), degrees_of_freedom: None, bound }
            }
            (None | Some(Doubt::TooLarge), Uncertainty::StandardError { bound, .. }) => {
                Uncertainty::StandardError { value: most, degrees_of_freedom: Some(self.degrees_of_freedom), bound }
            }
            (None, Uncertainty::NotSeen) => Uncertainty::sampled(most, Some(self.degrees_of_freedom)),
            (Some(Doubt::Scatters), stated) if !stated.is_sampled() || stated == Uncertainty::NotSeen => {
                Uncertainty::sampled(most, Some(self.degrees_of_freedom))
            }
            (Some(Doubt::SameForEverySeed), Uncertainty::NotSeen) => Uncertainty::Exact,
            (_, stated) => stated,
        }
    }

    /// The degrees of freedom of a heavy tail at a meter, where there is one; where readings of other seeds contradict what is stated, no
    /// tail excuses it.
    pub fn heavy_tail(found: &[Self], meter: &MeterId) -> Option<f64> {
        let is_contradicted = found.iter().any(|f| f.is_of_scatter_at(meter));
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
                value: relative * estimate.value.abs(),
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
            Some(Doubt::NotReadAgain | Doubt::BeyondTolerance | Doubt::Refuted) => false,
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
                "its standard errors are {} times too small: that is how its readings of other seeds scatter ({freedom:.0} \
                 degrees of freedom); verdicts go by the scatter",
                if ratio < FAR_TOO_SMALL { format!("{ratio:.1}") } else { format!("{ratio:.0e}") }
            ),
            Some(Doubt::TooLarge) => write!(
                f,
                "its standard errors are {:.1} times too large: its readings of other seeds scatter by as much less ({freedom:.0} \
                 degrees of freedom); verdicts go by the scatter",
                ratio.recip()
            ),
            Some(Doubt::HeavyTail) if self.largest_portion.is_some() => write!(
                f,
                "a heavy tail: at more meters than by chance one seed reads far from all others, so that a few of its samples hold much of \
                 the light and others are still to come; what is missing fails nothing that a few of them would bring"
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
            Some(Doubt::Scatters) if !at.is_empty() => write!(
                f,
                "it states an error of zero {at} with every seed, and other readings: they scatter by up to {:.2e}; verdicts go by the \
                 scatter",
                self.of_claims.unwrap_or(0.0)
            ),
            Some(Doubt::Scatters) if self.is_first_alone => write!(
                f,
                "asked again, each job by itself, it reads the same with every seed, and otherwise than at first, by {:.2e}: its readings \
                 depend on what else it is asked, as where jobs of a batch are mixed up; verdicts go by the scatter",
                self.of_claims.unwrap_or(0.0)
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
            Some(Doubt::Refuted) => write!(
                f,
                "the bounds that it states {at} do not hold: the true values lie outside; its readings are judged as they stand"
            ),
            Some(Doubt::BeyondTolerance) => write!(
                f,
                "the bounds that it states {at} are beyond the tolerance: nothing that it reads there could ever fail; its readings \
                 are judged as they stand"
            ),
            None if !at.is_empty() => {
                write!(f, "verdicts {at} go by how readings of other seeds scatter, which is less than what it states")
            }
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

    fn too_large_alone(readings: &[Estimate]) -> f64 {
        of_one(readings).filter(|one| one.ratio < 1.0 / MIN_EXCESS).map_or(1.0, |one| one.p_value)
    }

    /// How many of 300 procedures of 24 honest meters, seven readings each, have one whose stated error seems contradicted by itself.
    fn contradicted(reading: impl Fn(&mut fastrand::Rng) -> Estimate) -> usize {
        let is_found = |seed: &u64| {
            let mut random = fastrand::Rng::with_seed(*seed);
            let mut meter = || (0..7).map(|_| reading(&mut random)).collect::<Vec<Estimate>>();
            (0..24).any(|_| too_large_alone(&meter()) < TOLD / 24.0)
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
                too_large_alone(&(0..7).map(|_| one()).collect::<Vec<Estimate>>()) < TOLD / 24.0
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
        let meter = Sheltered { meter: here.clone(), readings: readings.to_vec(), counts: Some(0.3) };
        let found = StatedErrors::of_sheltered(&[meter], Tails::Unknown);
        assert_eq!(found[0].doubt, Some(Doubt::TooLarge), "{found:?}");
        let corrected = StatedErrors::corrected(&found, &here, wide(200.0)).uncertainty;
        assert!((corrected.standard_error().unwrap() - 2.0).abs() < 1e-12, "{corrected:?}");
        assert_eq!(corrected.degrees_of_freedom(), Some(2.0));
        assert_eq!(StatedErrors::corrected(&found, &there, wide(200.0)), wide(200.0));
        let limit = |doubt| StatedErrors::doubted_at(doubt, [(here.clone(), 0.01)].into()).unwrap();
        let unchecked = StatedErrors::corrected(&[limit(Doubt::NotReadAgain)], &here, wide(200.0));
        assert_eq!(unchecked.uncertainty, Uncertainty::sampled(2.0, None));
        let bounded = Estimate { value: 200.0, uncertainty: Uncertainty::Bound(50.0) };
        let judged = StatedErrors::corrected(&[limit(Doubt::BeyondTolerance)], &here, bounded);
        assert_eq!(judged.uncertainty, Uncertainty::Bound(2.0));
    }

    /// Meters whose readings of seven seeds scatter by a hundredth of these and state these.
    fn sheltered(random: &mut fastrand::Rng, of_meters: &[(f64, f64)], is_honest: bool) -> Vec<Sheltered> {
        let chi = |random: &mut fastrand::Rng| ((0..7).map(|_| normal(random).powi(2)).sum::<f64>() / 7.0).sqrt();
        let reading = |random: &mut fastrand::Rng, (scatter, stated): (f64, f64)| {
            let varies = if is_honest { chi(random) } else { 1.0 };
            let uncertainty = Uncertainty::sampled(stated * varies, Some(7.0));
            Estimate { value: 100.0 + scatter * normal(random), uncertainty }
        };
        let one = |(k, of_meter): (usize, &(f64, f64))| {
            let readings: Vec<Estimate> = (0..7).map(|_| reading(random, *of_meter)).collect();
            let counts = readings[3].uncertainty.standard_error().map(|e| e / 100.0).filter(|e| *e > 0.0);
            Sheltered { meter: MeterId::new("desk", k), readings, counts }
        };
        of_meters.iter().enumerate().map(one).collect()
    }

    #[test]
    fn where_tails_are_normal_no_error_counts_that_is_larger_than_readings_scatter() {
        let mut random = fastrand::Rng::with_seed(11);
        let alike = sheltered(&mut random, &[(0.5, 1.45); 24], false);
        let found = StatedErrors::of_sheltered(&alike, Tails::Normal);
        assert!(found.len() == 1 && found[0].at.len() == 24 && found[0].degrees_of_freedom > 100.0, "{found:?}");
        assert!(found[0].at.values().all(|seen| (0.0044..0.0056).contains(seen)), "{found:?}");
        assert_eq!(StatedErrors::of_sheltered(&alike, Tails::Unknown), []);
        // One bad apple does not spoil the others.
        let mut unlike = vec![(0.1, 5.0); 23];
        unlike.push((5.0, 5.0));
        let found = StatedErrors::of_sheltered(&sheltered(&mut random, &unlike, false), Tails::Normal);
        assert!(found[0].at.values().filter(|seen| **seen < 0.003).count() == 23, "{found:?}");
        assert_eq!(found[0].degrees_of_freedom, 6.0);
        // Every seed reads the same, although samples are said to have met nothing.
        let mut unseen = sheltered(&mut random, &[(0.0, 1.0)], false);
        unseen[0].counts = None;
        let found = StatedErrors::of_sheltered(&unseen, Tails::Unknown);
        assert_eq!(found[0].doubt, Some(Doubt::SameForEverySeed));
        let there = Estimate { value: 5.0, uncertainty: Uncertainty::NotSeen };
        assert_eq!(StatedErrors::corrected(&found, &unseen[0].meter, there).uncertainty, Uncertainty::Exact);
        assert_eq!(StatedErrors::of_sheltered(&unseen, Tails::Heavy), []);
    }

    #[test]
    fn honest_readings_lie_within_what_counts_as_often_as_is_said() {
        // Two intervals are tried, so that twice as many may lie outside.
        const LEVEL: f64 = 0.01;
        let beyond = |seed: &u64| {
            let mut random = fastrand::Rng::with_seed(*seed);
            let of_meters: Vec<(f64, f64)> = (0..24).map(|k| 0.1 * f64::from(1 + k % 5)).map(|s| (s, s)).collect();
            let meters = sheltered(&mut random, &of_meters, true);
            let found = StatedErrors::of_sheltered(&meters, Tails::Normal);
            meters.iter().any(|m| {
                let judged = StatedErrors::corrected(&found, &m.meter, m.readings[3]);
                let (error, freedom) =
                    (judged.uncertainty.standard_error().unwrap(), judged.uncertainty.degrees_of_freedom().unwrap());
                let chance = statrs::distribution::StudentsT::new(0.0, 1.0, freedom).unwrap();
                2.0 * chance.sf((judged.value - 100.0).abs() / error) < LEVEL / 24.0
            })
        };
        let count = (0..600).filter(beyond).count();
        assert!(count <= 18, "{count} of 600");
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
        // Negative light errs as much, and no report holds a negative error.
        let negative = StatedErrors::corrected(std::slice::from_ref(&found), &MeterId::new("m", 0), claimed(-5.0));
        assert!(negative.uncertainty.is_sound() && negative.uncertainty.standard() > 0.0, "{negative:?}");
        assert!(StatedErrors::of_claims(&[vec![claimed(10.0); 4]]).is_none());
    }
}
