//! The diffing layer: readings against references that carry their own uncertainty; it sees nothing but readings.

mod bias;
mod comparison;
mod consensus;
mod extreme;
mod family;
mod known;
mod papers;
mod policy;
mod ratios;
mod spending;
mod split;
mod statistics;
#[cfg(test)]
pub(crate) mod tests;
mod tolerance;
mod uncertainty;
mod verdict;

use std::collections::BTreeMap;

use luminaire::calculators::inverse_square;
use luminaire::scene::Transport;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::procedures::{self, Aspect, Target, Task};
use crate::record::{
    EngineName, MeterId, ProcedureId, Quantity, Reading, ReadingKey, Recording, Role, StatedErrors, Uncertainty,
};
use crate::spec::ToleranceOverride;

use papers::Input;

pub use crate::record::Basis;
pub use bias::{Bias, SINGLE_PRECISION, WeightedMean, two_sided};
pub use consensus::{Consensus, Witness};
pub use family::rejected;
pub use known::{Glob, How, KnownBreak, KnownDeviation, KnownDeviations, OnRecord, State};
pub use papers::{
    Misfit, PHOTOMETRY, Published, PublishedColumn, PublishedError, PublishedFlux, PublishedRow, PublishedTable,
};
pub use papers::{PaperSplit, Share, Stages, shares};
pub use policy::{POLICY_FILE, Policy, PolicyChoice, PolicyRecord, Profile, ProfileBudget, ProjectPolicy, Sampling};
pub use ratios::{Measured, MeterRatio, Ratio, Ratios};
pub use spending::{LOOKS, SHARE_OF_A_LOOK};
pub use split::Split;
pub use statistics::{FigureAgreement, Statistics, StatisticsAgreement};
pub use tolerance::{Rule, Tolerance, ToleranceClass, Tolerances};
pub use uncertainty::{Component, ErrorBudget, Shape, Source};
pub use verdict::{Verdict, judge};

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Reference {
    pub value: f64,
    /// Its standard uncertainty, likewise.
    pub uncertainty: f64,
    /// Of a sampled reference's standard error.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub degrees_of_freedom: Option<f64>,
    /// Its expanded over its standard uncertainty, at the coverage of verdicts; null where it has none.
    #[serde(default)]
    pub coverage_factor: Option<f64>,
    pub basis: Basis,
    /// Formula, solver or paper.
    pub source: String,
    /// Why it is not to be believed, of a printed cell: then no engine answers for what departs from it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub doubt: Option<String>,
}

impl Reference {
    fn of(value: f64, stated: &Uncertainty, basis: Basis, source: String) -> Self {
        let (uncertainty, degrees_of_freedom) = (stated.standard(), stated.degrees_of_freedom());
        Self { value, uncertainty, degrees_of_freedom, coverage_factor: None, basis, source, doubt: None }
    }
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Comparison {
    #[serde(flatten)]
    pub key: ReadingKey,
    pub model: String,
    pub meter: MeterId,
    pub at_m: [f64; 3],
    pub normal: [f64; 3],
    /// Direction seen from the luminaire, for procedure 1.
    pub gamma_deg: Option<f64>,
    pub c_deg: Option<f64>,
    pub quantity: Quantity,
    /// The reading; null where it is missing.
    pub value: Option<f64>,
    #[serde(flatten)]
    pub uncertainty: Uncertainty,
    /// What it is held against; null where there is nothing.
    pub reference: Option<Reference>,
    /// Reading minus reference.
    pub deviation: Option<f64>,
    /// Deviation over reference.
    pub relative_deviation: Option<f64>,
    pub tolerance: Tolerance,
    /// File and source of the tolerance, where it is a project's.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tolerance_source: Option<String>,
    pub verdict: Verdict,
    pub diagnosis: Option<String>,
    /// What the deviation may owe to chance and ignorance; null where there is no deviation.
    #[serde(default)]
    pub budget: Option<ErrorBudget>,
    /// How probable a deviation this large would be, were the engine just within the tolerance; chance counts for as much more as it
    /// takes to look several times, where that is planned.
    #[serde(default)]
    pub p_value: Option<f64>,
}

pub struct Judge<'a> {
    pub tolerances: &'a Tolerances,
    pub known: &'a KnownDeviations,
    /// The spec's own tolerances.
    pub overrides: &'a BTreeMap<ProcedureId, ToleranceOverride>,
    pub published: Option<&'a Published>,
}

impl Judge<'_> {
    /// What of each deviation of an approximate method from a renderer is whose; `recordings` as for [`Self::compare`].
    pub fn split(&self, task: &Task, recordings: &[&Recording]) -> Vec<Split> {
        split::splits(task, recordings, self.tolerances.coverage_factor())
    }

    /// What an engine is held to in a task, by what others are judged by there.
    pub fn tolerance(&self, task: &Task, engine: &str) -> Tolerance {
        self.held_to(task, task.reference().basis(), engine).0
    }

    /// What every entry on record came to that is about comparisons of a task; `recordings` as for [`Self::compare`].
    pub fn on_record(&self, comparisons: &[Comparison], recordings: &[&Recording]) -> Vec<OnRecord> {
        let one = |recording: &&Recording| {
            let mine: Vec<&Comparison> = comparisons.iter().filter(|c| c.key == recording.key).collect();
            self.known.on_record(&mine, &recording.content_sha256)
        };
        recordings.iter().flat_map(one).collect()
    }

    fn held_to(&self, task: &Task, basis: Basis, engine: &str) -> (Tolerance, Option<String>) {
        self.tolerances.of(task.procedure, basis, engine, task.quantity, self.overrides)
    }

    /// Holds every reading of one task against every reference there is for it.
    ///
    /// `recordings` are those of this task, one an engine. An engine that failed is `missing` at every meter. What fails, fails
    /// at the family-wise level of all comparisons of its engine here.
    pub fn compare(&self, task: &Task, recordings: &[&Recording]) -> Vec<Comparison> {
        self.compare_those(task, recordings, recordings)
    }

    /// The same of one recording alone: of many engines, asked for one after the other, all would be compared as often as there are engines.
    pub fn compare_one(&self, task: &Task, recording: &Recording, others: &[&Recording]) -> Vec<Comparison> {
        self.compare_those(task, &[recording], others)
    }

    fn compare_those(&self, task: &Task, those: &[&Recording], recordings: &[&Recording]) -> Vec<Comparison> {
        let input = self.published.map(|_| Input::of(task));
        let misfits = self.published.map_or_else(Vec::new, |p| p.misfits(task));
        let mut comparisons = vec![];
        for recording in those {
            // In place: a million comparisons are not moved about.
            let family = comparisons.len();
            let largest = largest_portion(recording);
            for (k, target) in task.targets.iter().enumerate() {
                let reading = recording.reading(k, &target.id);
                let engine = &recording.key.engine;
                let printed = self.published.iter().flat_map(|p| p.references(task, target, engine, &misfits));
                let printed =
                    printed.map(|reference| ScoredReference::published(reference, input.as_ref(), target, reading));
                let references: Vec<ScoredReference> =
                    reference_of_task(task, recordings, k, engine).into_iter().chain(printed).collect();
                if references.is_empty() && (reading.is_none() || recording.role == Role::Renderer) {
                    // Nothing to hold it against, or nothing to hold: that is said, never passed over.
                    comparisons.push(self.comparison(task, (recording, k), largest, None));
                }
                let compared = |held| self.comparison(task, (recording, k), largest, Some(held));
                comparisons.extend(references.into_iter().map(compared));
            }
            self.decide(&mut comparisons[family..], &recording.content_sha256);
        }
        comparisons
    }

    /// Verdicts of all comparisons of one engine in one procedure of one case, which is known by its content.
    fn decide(&self, family: &mut [Comparison], content: &str) {
        let tested: Vec<usize> = (0..family.len()).filter(|k| family[*k].p_value.is_some()).collect();
        let p_values: Vec<f64> = tested.iter().filter_map(|k| family[*k].p_value).collect();
        let rejected = family::rejected(&p_values, self.tolerances.family_wise_error());
        for (k, rejected) in tested.into_iter().zip(rejected) {
            let of_one = &mut family[k].verdict;
            if *of_one == Verdict::Fail && !rejected {
                *of_one = Verdict::Inconclusive;
            }
        }
        for comparison in family {
            self.known.revise(comparison, content, self.tolerances.coverage_factor());
            let Some(basis) = comparison.basis() else { continue };
            let ReadingKey { procedure, engine, .. } = &comparison.key;
            if !matches!(comparison.verdict, Verdict::Fail | Verdict::Inconclusive) {
                continue;
            }
            if let Some(doubt) = comparison.reference.as_ref().and_then(|r| r.doubt.clone()) {
                comparison.diagnosis = Some(doubt);
                comparison.verdict = Verdict::KnownDeviation;
            } else if let Some(why) = self.tolerances.not_claimed(*procedure, basis, engine) {
                comparison.diagnosis = Some(why.to_owned());
                comparison.verdict = Verdict::NotJudged;
            }
        }
    }

    /// One reading against one reference; `largest_portion` is that of its recording.
    fn comparison(
        &self,
        task: &Task,
        (recording, k): (&Recording, usize),
        largest_portion: Option<f64>,
        held: Option<ScoredReference>,
    ) -> Comparison {
        let (target, reading) = (&task.targets[k], recording.reading(k, &task.targets[k].id));
        let truth = held.as_ref().map(|h| h.reference.value);
        let uncertain_by = |r: &Reading| {
            let stated = StatedErrors::of_looks(&recording.stated_errors, &r.meter, r.uncertainty);
            let believed = believed(stated, largest_portion, truth.map(|truth| (truth - r.value).abs()));
            let to_come = truth.and_then(|truth| StatedErrors::to_come(&recording.stated_errors, r.value, truth));
            to_come.map_or(believed, |error| believed.at_least(error))
        };
        let uncertainty = reading.map_or(Uncertainty::Unstated, uncertain_by);
        let basis = held.as_ref().map(|h| h.reference.basis);
        let (tolerance, tolerance_source) =
            basis.map(|basis| self.held_to(task, basis, &recording.key.engine)).unwrap_or_default();
        let pair = reading.zip(held.as_ref());
        let difference = pair.map(|(a, b)| a.value - b.reference.value);
        let tail = uncertainty::upper_tail_of_normal(self.tolerances.coverage_factor());
        let budget = pair.map(|(_, held)| {
            let components = of_reading(&uncertainty).into_iter().chain(held.components.iter().copied());
            ErrorBudget::spending(components.collect(), tail, share_of_reading(recording, k))
        });
        let missing = match (reading, &held) {
            (None, _) => recording.failure.clone().or_else(|| Some("no reading".to_owned())),
            (_, None) => Some("no reference".to_owned()),
            _ => None,
        };
        let held = held.map(|held| held.covered(tail));
        let mut comparison = Comparison {
            key: recording.key.clone(),
            model: recording.model.clone(),
            meter: target.id.clone(),
            at_m: target.meter.position_m.to_array(),
            normal: target.meter.normal.to_array(),
            gamma_deg: target.direction.map(|d| d.gamma_deg),
            c_deg: target.direction.map(|d| d.c_deg),
            quantity: task.quantity,
            value: reading.map(|r| r.value),
            uncertainty,
            reference: held.map(|h| h.reference),
            deviation: difference.filter(|d| d.is_finite()),
            relative_deviation: None,
            tolerance,
            tolerance_source,
            verdict: Verdict::Missing,
            diagnosis: missing,
            budget,
            p_value: None,
        };
        let (Some(value), Some(reference), Some(budget)) =
            (comparison.value, &comparison.reference, &comparison.budget)
        else {
            return comparison;
        };
        let has_zero = task.quantity.has_zero();
        comparison.relative_deviation =
            Some((value - reference.value) / reference.value).filter(|d| d.is_finite() && has_zero);
        let deviation = if reference.value >= 0.0 || !has_zero { value - reference.value } else { f64::NAN };
        let allowed = tolerance.around(reference.value);
        comparison.verdict = judge(deviation, budget.expanded, allowed);
        let p_value = budget.p_value(deviation, allowed);
        let is_heavy_tailed = is_heavy_tailed(recording, &comparison, deviation, p_value);
        // Asked where it fails alone, which few do.
        let waits = || {
            unbelievable(comparison.uncertainty, value, is_heavy_tailed)
                .or_else(|| is_within_a_jump(task, k, deviation, allowed).then_some(AT_A_JUMP))
        };
        if let Some(why) = (comparison.verdict == Verdict::Fail).then(waits).flatten() {
            comparison.verdict = Verdict::Inconclusive;
            comparison.diagnosis = Some(why.to_owned());
        } else if comparison.verdict != Verdict::Missing {
            comparison.p_value = Some(p_value);
        }
        comparison
    }
}

/// The largest relative standard error of a mean that is about normal: light is not negative, and what scatters more is skewed, so
/// that most means of few samples lie far below what they estimate.
const MAX_RELATIVE_ERROR: f64 = 0.25;

/// Normal deviates of the skewness of blocks beyond which their mean is not normal either: one in a hundred of normal blocks.
const MAX_SKEWNESS: f64 = 2.33;

/// Standard errors that a mean of few samples of a heavy tail may lie off: eight of a lognormal distribution of sigma 2 lie 89 off in one
/// of 1,000 draws, 32 of them 24. Blocks that only say that they are skewed hide nothing farther off.
const FAR: f64 = 100.0;

/// A heavy tail fails what is less probable than this by Student's t with the degrees of freedom that its errors vary by: that is wider
/// there than any of the heavy tails tried, and not always so for more probable deviations.
const WELL_COVERED: f64 = 1e-3;

/// Whether its blocks tell so, or how its errors vary from seed to seed, and it is near enough for a heavy tail to have done it.
fn is_heavy_tailed(recording: &Recording, comparison: &Comparison, deviation: f64, p_value: f64) -> bool {
    let Comparison { meter, uncertainty, .. } = comparison;
    let is_near = || uncertainty.standard_error().is_some_and(|error| deviation.abs() < FAR * error);
    recording.skewness.is_some_and(|s| s > MAX_SKEWNESS) && is_near()
        || StatedErrors::heavy_tail(&recording.stated_errors, meter).is_some() && p_value > WELL_COVERED
}

/// Why a sampled value fails nothing, whatever its distance: its interval is not one.
fn unbelievable(uncertainty: Uncertainty, value: f64, is_heavy_tailed: bool) -> Option<&'static str> {
    match uncertainty {
        Uncertainty::StandardError { value: error, .. } if error > 0.0 && is_heavy_tailed => Some(
            "a heavy tail: a few of its samples hold much of the light, others are still to come; it fails nothing yet",
        ),
        Uncertainty::NotSeen => Some("not seen: no sample met here what samples met elsewhere"),
        Uncertainty::StandardError { value: error, .. } if value > 0.0 && error > MAX_RELATIVE_ERROR * value => {
            Some("too few samples: they scatter so much that their mean is not normal, and fails nothing yet")
        }
        _ => None,
    }
}

/// Why a reading fails nothing that another rounding would have passed.
pub(crate) const AT_A_JUMP: &str =
    "at the edge of a jump: the table ends here with light, or its planes disagree at a pole, and rounding decides";

/// Whether a target lies in the direction of a jump of a point's table, and its reading between the values on either side.
fn is_within_a_jump(task: &Task, k: usize, deviation: f64, allowed: f64) -> bool {
    let jump = |aspect: &Aspect| aspect.weight * inverse_square::jump(&task.scene, &aspect.meter).value();
    let jump: f64 = task.targets[k].aspects.iter().map(jump).sum();
    jump > 0.0 && !matches!(task.transport, Transport::Indirect(_)) && deviation.abs() <= jump + allowed
}

/// Where a sample is met that rarely, it may carry so many times the light of those elsewhere. Sampled alike, portions differ as cosines
/// and squared distances do, by which light is weighted; a renderer that meets its luminaires by chance alone meets them so everywhere.
const BRIGHTER: f64 = 100.0;

/// The largest portion that light comes in to an engine's meters: the variance of a reading over its value.
fn largest_portion(recording: &Recording) -> Option<f64> {
    let portion = |r: &Reading| Some(r.uncertainty.standard_error()?.powi(2) / r.value).filter(|p| p.is_finite());
    recording.readings.iter().filter_map(portion).reduce(f64::max).filter(|p| *p > 0.0)
}

/// The error that a reading has where no sample met what is missing: were the reference right, and light to come here in portions many
/// times as large as anywhere else, so much would be missing by chance. Where that is not far below what is missing, it stays not seen.
fn believed(stated: Uncertainty, largest_portion: Option<f64>, missing: Option<f64>) -> Uncertainty {
    match (stated, largest_portion, missing) {
        (Uncertainty::NotSeen, Some(portion), Some(missing)) => {
            let error = (BRIGHTER * portion * missing).sqrt();
            if error < MAX_RELATIVE_ERROR * missing { Uncertainty::sampled(error, None) } else { stated }
        }
        _ => stated,
    }
}

/// Rounding of a closed form in `f64`, relative: a few operations and two arctangents a luminaire.
const ROUNDING: f64 = 1e-13;

struct ScoredReference {
    reference: Reference,
    components: Vec<Component>,
}

impl ScoredReference {
    /// Tells the coverage factor of the reference alone, for an error beyond it with the probability `tail` on either side.
    fn covered(mut self, tail: f64) -> Self {
        let alone = ErrorBudget::new(self.components.clone(), tail);
        self.reference.coverage_factor = Some(alone.coverage_factor).filter(|_| alone.combined > 0.0);
        self
    }

    fn reading(reading: &Reading, basis: Basis, source: String) -> Self {
        let reference = Reference::of(reading.value, &reading.uncertainty, basis, source);
        let components = of_reading(&reading.uncertainty).into_iter();
        let components = components.map(|component| Component { source: Source::Reference, ..component });
        Self { reference, components: components.collect() }
    }

    fn formula(value: f64, source: &str) -> Self {
        let bound = ROUNDING * value.abs();
        let reference = Reference::of(value, &Uncertainty::Bound(bound), Basis::ClosedForm, source.to_owned());
        Self { reference, components: vec![Component::within(Source::Reference, bound)] }
    }

    /// A printed or derived value, which does not rest on the photometric file.
    fn published(reference: Reference, input: Option<&Input<'_>>, target: &Target, reading: Option<&Reading>) -> Self {
        let rounding = Component { uncertainty: reference.uncertainty, ..Component::within(Source::Rounding, 0.0) };
        let input = input.zip(reading).map(|(i, r)| Component::within(Source::Input, i.bound(target, r.value)));
        Self { reference, components: std::iter::once(rounding).chain(input).collect() }
    }
}

/// The share of its error that a decision about a reading may spend: all of it where only one look was planned.
fn share_of_reading(recording: &Recording, k: usize) -> f64 {
    let is_sampled = recording.readings.get(k).is_some_and(|r| r.uncertainty.is_sampled());
    recording.looks.get(k).filter(|_| is_sampled).map_or(1.0, |_| SHARE_OF_A_LOOK)
}

/// What is uncertain of a reading.
fn of_reading(uncertainty: &Uncertainty) -> Vec<Component> {
    let chance = uncertainty.standard_error().unwrap_or(0.0);
    vec![
        Component::normal(Source::MonteCarlo, chance, uncertainty.degrees_of_freedom()),
        Component::within(Source::Discretisation, uncertainty.bound()),
    ]
}

/// What a task's own reference holds for a reading of an engine; the reference itself has none.
fn reference_of_task(task: &Task, recordings: &[&Recording], k: usize, engine: &EngineName) -> Option<ScoredReference> {
    let (witness, basis, source) = match task.reference() {
        procedures::Reference::Witness { engine, basis, source } => (engine, basis, source),
        procedures::Reference::Formula { of, source } => {
            return Some(ScoredReference::formula(of(&task.scene, &task.targets[k]), source));
        }
    };
    if *engine == witness {
        return None;
    }
    let recording = recordings.iter().find(|r| r.key.engine == witness)?;
    let reading = recording.reading(k, &task.targets[k].id)?;
    let source = match recording.method.get("solver") {
        Some(solver) if basis == Basis::Exact => format!("{source}: {solver}"),
        _ => source.to_owned(),
    };
    Some(ScoredReference::reading(reading, basis, source))
}
