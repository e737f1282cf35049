//! Comparison of readings with references, both with their uncertainty. No engine is asked for a value here.

mod bias;
mod claims;
mod consensus;
#[cfg(test)]
mod consensus_odds_tests;
pub mod diagnosis;
#[doc(hidden)]
pub mod fixtures;
mod known;
mod papers;
mod policy;
mod ratios;
mod sentences;
mod spending;
mod split;
mod statistics;
#[cfg(test)]
mod step_tests;
#[cfg(test)]
mod tests;
mod tolerance;
mod verdict;

use luxproof_model::Basis;
use luxproof_model::Comparison;
use luxproof_model::Component;
use luxproof_model::KnownDeviationOutcome;
use luxproof_model::Reference;
use luxproof_model::Source;
use luxproof_model::Split;
use luxproof_model::Tolerance;
use luxproof_model::Verdict;
use luxproof_spec::Trust;
use luxproof_statistics::error_budget;
use luxproof_statistics::rejected;
use luxproof_statistics::stated_errors;
use luxproof_statistics::upper_tail_of_normal;
use std::collections::BTreeMap;

use luxproof_calculators::inverse_square;
use luxproof_scene::Transport;

use luxproof_model::{EngineName, ProcedureId, Reading, ReadingKey, Recording, Uncertainty};
use luxproof_spec::ToleranceOverride;
use luxproof_spec::procedures::{self, Target, Task};

use papers::Input;

pub use known::{KnownBreak, KnownDeviations};
pub use papers::{Cell, PHOTOMETRY, Published, PublishedError, Stages, Standing, cells, paper_splits, shares};
pub use policy::{POLICY_FILE, Policy, PolicyChoice, PolicySearch, Profile, ProfileBudget, ProjectPolicy, overruled};
pub use ratios::Measured;
pub use sentences::sentences;
pub use spending::{ERROR_SHARE_PER_STAGE, MAX_STAGES};
pub use tolerance::{Rule, Tolerances};
pub use verdict::judge;

/// Judges readings by the tolerances, the record and the papers of a case.
pub struct Judge<'a> {
    pub tolerances: &'a Tolerances,
    pub known: &'a KnownDeviations,
    /// The spec's own tolerances.
    pub overrides: &'a BTreeMap<ProcedureId, ToleranceOverride>,
    /// Whose spec it is: a stranger's tolerances only narrow.
    pub trust: Trust,
    pub published: Option<&'a Published>,
}

impl Judge<'_> {
    /// Splits each deviation of an approximate method from a renderer; `recordings` as for [`Self::compare`].
    pub fn split(&self, task: &Task, recordings: &[&Recording]) -> Vec<Split> {
        split::split_deviations(task, recordings, self.tolerances.coverage_factor())
    }

    /// The tolerance of an engine in a task, against the task's own reference.
    pub fn tolerance(&self, task: &Task, engine: &str) -> Tolerance {
        self.tolerance_with_source(task, task.reference().basis(), engine).0
    }

    /// The state of every entry on record about comparisons of a task; `recordings` as for [`Self::compare`].
    pub fn on_record(&self, comparisons: &[Comparison], recordings: &[&Recording]) -> Vec<KnownDeviationOutcome> {
        let mut all = vec![];
        for recording in recordings {
            let of_engine: Vec<&Comparison> = comparisons.iter().filter(|c| c.key == recording.key).collect();
            all.extend(self.known.on_record(&of_engine, &recording.content_sha256));
        }
        all
    }

    /// The tolerance of an engine against a kind of reference, and where it comes from.
    fn tolerance_with_source(&self, task: &Task, basis: Basis, engine: &str) -> (Tolerance, Option<String>) {
        let (procedure, quantity) = (task.procedure, task.quantity);
        match self.trust {
            Trust::Stranger => self.tolerances.narrowed_for(procedure, basis, engine, quantity, self.overrides),
            // A bundle is judged as it was.
            Trust::Own | Trust::Bundled => self.tolerances.of(procedure, basis, engine, quantity, self.overrides),
        }
    }

    /// Compares every reading of one task with every reference for it.
    ///
    /// `recordings` are those of this task, one an engine. An engine that failed is `missing` at every meter. A
    /// failure holds at the family-wise level of all comparisons of its engine here.
    pub fn compare(&self, task: &Task, recordings: &[&Recording]) -> Vec<Comparison> {
        self.compare_selected(task, recordings, recordings)
    }

    /// Compares one recording alone, so that callers who ask engine by engine do not repeat the others' comparisons.
    pub fn compare_one(&self, task: &Task, recording: &Recording, others: &[&Recording]) -> Vec<Comparison> {
        self.compare_selected(task, &[recording], others)
    }

    fn compare_selected(&self, task: &Task, selected: &[&Recording], recordings: &[&Recording]) -> Vec<Comparison> {
        let input = self.published.map(|_| Input::of(task));
        let misfits = self.published.map_or_else(Vec::new, |p| p.misfits(task));
        let mut comparisons = vec![];
        for recording in selected {
            // The family is a slice of all comparisons: there may be a million, too many to move about.
            let family = comparisons.len();
            let largest = largest_portion(recording);
            let mut without_tolerance = vec![];
            for (k, target) in task.targets.iter().enumerate() {
                let reading = recording.reading(k, &target.id);
                let engine = &recording.key.engine;
                let mut references: Vec<ScoredReference> =
                    reference_of_task(task, recordings, k, engine).into_iter().collect();
                for printed in self.published.iter().flat_map(|p| p.references(task, target, engine, &misfits)) {
                    references.push(ScoredReference::from_published(printed, input.as_ref(), target, reading));
                }
                // A missing reading or reference shows as a comparison, and is never passed over.
                if references.is_empty() && (reading.is_none() || recording.role.is_judged()) {
                    comparisons.push(self.comparison(task, (recording, k), largest, None));
                }
                for reference in references {
                    let comparison = self.comparison(task, (recording, k), largest, Some(reference));
                    let is_dark = comparison.reference.as_ref().is_some_and(|r| r.value == 0.0);
                    if is_dark && comparison.value.is_some() && comparison.allowed() == 0.0 {
                        without_tolerance.push((comparisons.len(), k));
                    }
                    comparisons.push(comparison);
                }
            }
            let brightest = comparisons[family..].iter().filter_map(|c| Some(c.reference.as_ref()?.value));
            let rounding = ROUNDING_SHARE * brightest.fold(0.0, f64::max);
            for (place, k) in without_tolerance {
                let comparison = &mut comparisons[place];
                comparison.tolerance.absolute = rounding;
                comparison.diagnosis = None;
                test_comparison(comparison, task, (recording, k));
            }
            self.decide_family(&mut comparisons[family..], &recording.content_sha256);
        }
        comparisons
    }

    /// Decides the comparisons of one engine in one procedure of one case, which `content` identifies.
    fn decide_family(&self, family: &mut [Comparison], content: &str) {
        let tested: Vec<usize> = (0..family.len()).filter(|k| family[*k].p_value.is_some()).collect();
        let p_values: Vec<f64> = tested.iter().filter_map(|k| family[*k].p_value).collect();
        let rejected = rejected(&p_values, self.tolerances.family_wise_error());
        for (k, rejected) in tested.into_iter().zip(rejected) {
            let verdict = &mut family[k].verdict;
            if *verdict == Verdict::Fail && !rejected {
                *verdict = Verdict::Undecided;
            }
        }
        for comparison in family {
            self.known.revise(comparison, content, self.tolerances.coverage_factor());
            self.excuse(comparison);
        }
    }

    /// Replaces a verdict that rests on a doubtful reference, or on what the engine does not claim.
    fn excuse(&self, comparison: &mut Comparison) {
        let Some(basis) = comparison.basis() else { return };
        let ReadingKey { procedure, engine, .. } = &comparison.key;
        if !matches!(comparison.verdict, Verdict::Fail | Verdict::Undecided) {
            return;
        }
        if let Some(caveat) = comparison.reference.as_ref().and_then(|r| r.caveat.clone()) {
            comparison.diagnosis = Some(caveat);
            comparison.verdict = Verdict::KnownDeviation;
        } else if let Some(why) = self.tolerances.not_claimed(*procedure, basis, engine) {
            comparison.diagnosis = Some(why.to_owned());
            comparison.verdict = Verdict::NotJudged;
        }
    }

    /// Compares one reading with one reference; `largest_portion` is that of its recording.
    fn comparison(
        &self,
        task: &Task,
        (recording, k): (&Recording, usize),
        largest_portion: Option<f64>,
        scored: Option<ScoredReference>,
    ) -> Comparison {
        let (target, reading) = (&task.targets[k], recording.reading(k, &task.targets[k].id));
        let truth = scored.as_ref().map(|s| s.reference.value);
        let uncertainty = reading
            .map_or(Uncertainty::Unstated, |reading| effective_uncertainty(recording, reading, largest_portion, truth));
        let (tolerance, tolerance_source) = scored
            .as_ref()
            .map(|s| self.tolerance_with_source(task, s.reference.basis, &recording.key.engine))
            .unwrap_or_default();
        let tail = upper_tail_of_normal(self.tolerances.coverage_factor());
        let budget = reading.zip(scored.as_ref()).map(|(reading, scored)| {
            let mut components = uncertainty_components(&uncertainty);
            components.extend(scored.components.iter().copied());
            // The same planes have the same error, which is not in their difference.
            let quadrature = (reading.quadrature - scored.quadrature).abs();
            components.extend((quadrature > 0.0).then(|| Component::within(Source::Discretisation, quadrature)));
            error_budget::budget_of_stage(components, tail, share_of_reading(recording, k))
        });
        let missing = match (reading, &scored) {
            (None, _) => recording.failure.clone().or_else(|| Some("no reading".to_owned())),
            (_, None) => Some("no reference".to_owned()),
            _ => None,
        };
        let difference = reading.zip(truth).map(|(reading, truth)| reading.value - truth);
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
            reference: scored.map(|s| s.with_coverage_factor(tail)),
            deviation: difference.filter(|d| d.is_finite()),
            relative_deviation: None,
            tolerance,
            tolerance_source,
            verdict: Verdict::Missing,
            diagnosis: missing,
            budget,
            p_value: None,
        };
        test_comparison(&mut comparison, task, (recording, k));
        comparison
    }
}

/// Rounding that darkness may show where no tolerance is given for it, as a part of the brightest reference.
const ROUNDING_SHARE: f64 = 1e-12;

/// Tests the deviation of a comparison that has a reading and a reference.
fn test_comparison(comparison: &mut Comparison, task: &Task, (recording, k): (&Recording, usize)) {
    let (Some(value), Some(reference), Some(budget)) = (comparison.value, &comparison.reference, &comparison.budget)
    else {
        return;
    };
    let has_zero = task.quantity.has_zero();
    comparison.relative_deviation =
        Some((value - reference.value) / reference.value).filter(|d| d.is_finite() && has_zero);
    let deviation = if reference.value >= 0.0 || !has_zero { value - reference.value } else { f64::NAN };
    let allowed = comparison.tolerance.around(reference.value);
    comparison.verdict = judge(deviation, budget.expanded, allowed);
    let p_value = error_budget::p_value(budget, deviation, allowed);
    // The reasons take time, and few comparisons fail: only these are asked for one.
    if comparison.verdict == Verdict::Fail {
        let is_heavy_tailed = is_heavy_tailed(recording, comparison, deviation, p_value);
        let why = why_unreliable(comparison.uncertainty, value, is_heavy_tailed)
            .or_else(|| is_within_jump(task, k, deviation, allowed).then_some(AT_A_JUMP));
        if let Some(why) = why {
            comparison.verdict = Verdict::Undecided;
            comparison.diagnosis = Some(why.to_owned());
            return;
        }
    }
    if comparison.verdict != Verdict::Missing {
        comparison.p_value = Some(p_value);
    }
}

/// The largest relative standard error of a mean that is about normal.
///
/// Light is not negative, so what scatters more is skewed: most means of few samples then lie far below the truth.
const MAX_RELATIVE_ERROR: f64 = 0.25;

/// Skewness of blocks, in normal deviates, beyond which their mean is not normal: one in a hundred of normal blocks.
const MAX_SKEWNESS_SIGMAS: f64 = 2.33;

/// Standard errors by which the mean of few samples of a heavy tail may deviate.
///
/// Eight samples of a lognormal distribution of sigma 2 deviate by 89 in one of 1,000 draws, 32 samples by 24. Blocks
/// that are only known to be skewed explain nothing farther off.
const MAX_TAIL_SIGMAS: f64 = 100.0;

/// A heavy tail fails what is less probable than this by Student's t with the degrees of freedom of its errors.
///
/// That far out, t is wider than any of the heavy tails tried; nearer it is not always so.
const HEAVY_TAIL_P: f64 = 1e-3;

/// Whether a heavy tail may explain a deviation: by the skewness of blocks, or by errors that vary between seeds.
fn is_heavy_tailed(recording: &Recording, comparison: &Comparison, deviation: f64, p_value: f64) -> bool {
    let is_skewed = recording.skewness.is_some_and(|s| s > MAX_SKEWNESS_SIGMAS);
    let error = comparison.uncertainty.standard_error();
    let is_near = error.is_some_and(|error| deviation.abs() < MAX_TAIL_SIGMAS * error);
    is_skewed && is_near
        || stated_errors::heavy_tail(&recording.stated_errors, &comparison.meter).is_some() && p_value > HEAVY_TAIL_P
}

/// Why a sampled value fails nothing, whatever its distance: its interval is not reliable.
fn why_unreliable(uncertainty: Uncertainty, value: f64, is_heavy_tailed: bool) -> Option<&'static str> {
    match uncertainty {
        Uncertainty::StandardError { value: error, .. } if error > 0.0 && is_heavy_tailed => Some(
            "a heavy tail: a few of its samples hold much of the light, others are still to come; it fails nothing yet: raise `seconds`",
        ),
        Uncertainty::NotSeen => Some("not seen: no sample met here what samples met elsewhere: raise `seconds`"),
        Uncertainty::StandardError { value: error, .. } if value > 0.0 && error > MAX_RELATIVE_ERROR * value => Some(
            "too few samples: they scatter so much that their mean is not normal, and fails nothing yet: raise `seconds`",
        ),
        _ => None,
    }
}

/// Why a reading fails nothing that another rounding would have passed.
pub const AT_A_JUMP: &str = "at the edge of a jump: the table ends here with light, or its planes disagree at a pole, and rounding decides: move the meter by a millimetre";

/// Whether a target lies at a jump of a point's table, and its reading between the values on either side.
fn is_within_jump(task: &Task, k: usize, deviation: f64, allowed: f64) -> bool {
    let aspects = task.targets[k].aspects.iter();
    let jump: f64 = aspects.map(|a| a.weight.abs() * inverse_square::jump(&task.scene, &a.meter).value()).sum();
    jump > 0.0 && !matches!(task.transport, Transport::Indirect(_)) && deviation.abs() <= jump + allowed
}

/// How many times brighter a rarely met sample may be than those at other meters.
///
/// With the same sampling, portions differ as cosines and squared distances do, which weight the light. A renderer
/// that meets its luminaires by chance alone does so at every meter.
const MAX_PORTION_RATIO: f64 = 100.0;

/// The largest portion in which light comes to an engine's meters: the variance of a reading over its value.
fn largest_portion(recording: &Recording) -> Option<f64> {
    let mut largest = None;
    for reading in &recording.readings {
        let Some(error) = reading.uncertainty.standard_error() else { continue };
        let portion = error.powi(2) / reading.value;
        if portion.is_finite() {
            largest = Some(largest.map_or(portion, |largest| f64::max(largest, portion)));
        }
    }
    largest.filter(|portion| *portion > 0.0)
}

/// The uncertainty by which a reading is judged, were the reference the truth.
///
/// It is at least the stated one of all stages. It adds light that no sample has met yet.
fn effective_uncertainty(
    recording: &Recording,
    reading: &Reading,
    largest_portion: Option<f64>,
    truth: Option<f64>,
) -> Uncertainty {
    let stated = stated_errors::of_stages(&recording.stated_errors, &reading.meter, reading.uncertainty);
    let missing = truth.map(|truth| (truth - reading.value).abs());
    let uncertainty = with_unseen_light(stated, largest_portion, missing);
    let to_come = truth.and_then(|truth| stated_errors::to_come(&recording.stated_errors, reading.value, truth));
    to_come.map_or(uncertainty, |error| uncertainty.at_least(error))
}

/// The error of a reading where no sample met the missing light.
///
/// If light comes here in portions many times as large as anywhere else, so much may be missing by chance. Where that
/// error is not far below what is missing, the reading stays not seen.
fn with_unseen_light(stated: Uncertainty, largest_portion: Option<f64>, missing: Option<f64>) -> Uncertainty {
    match (stated, largest_portion, missing) {
        (Uncertainty::NotSeen, Some(portion), Some(missing)) => {
            let error = (MAX_PORTION_RATIO * portion * missing).sqrt();
            if error < MAX_RELATIVE_ERROR * missing { Uncertainty::sampled(error, None) } else { stated }
        }
        _ => stated,
    }
}

/// Relative rounding of a closed form in `f64`: a few operations and two arctangents a luminaire.
const ROUNDING: f64 = 1e-13;

/// A reference with the components of its uncertainty.
struct ScoredReference {
    reference: Reference,
    components: Vec<Component>,
    /// As in [`Reading::quadrature`].
    quadrature: f64,
}

impl ScoredReference {
    /// The reference with its coverage factor, for an error beyond it with probability `tail` on either side.
    fn with_coverage_factor(mut self, tail: f64) -> Reference {
        let budget = error_budget::budget(self.components, tail);
        self.reference.coverage_factor = Some(budget.coverage_factor).filter(|_| budget.combined > 0.0);
        self.reference
    }

    fn from_reading(reading: &Reading, basis: Basis, source: String) -> Self {
        let reference = Reference::of(reading.value, &reading.uncertainty, basis, source);
        let mut components = uncertainty_components(&reading.uncertainty);
        for component in &mut components {
            component.source = Source::Reference;
        }
        Self { reference, components, quadrature: reading.quadrature }
    }

    fn from_formula(value: f64, source: &str) -> Self {
        let bound = ROUNDING * value.abs();
        let reference = Reference::of(value, &Uncertainty::Bound(bound), Basis::ClosedForm, source.to_owned());
        Self { reference, components: vec![Component::within(Source::Reference, bound)], quadrature: 0.0 }
    }

    /// A printed or derived value, which does not rest on the photometric file.
    fn from_published(
        reference: Reference,
        input: Option<&Input<'_>>,
        target: &Target,
        reading: Option<&Reading>,
    ) -> Self {
        let rounding = Component { uncertainty: reference.uncertainty, ..Component::within(Source::Rounding, 0.0) };
        let mut components = vec![rounding];
        if let Some((input, reading)) = input.zip(reading) {
            components.push(Component::within(Source::Input, input.bound(target, reading.value)));
        }
        Self { reference, components, quadrature: 0.0 }
    }
}

/// The part of its error that a decision about a reading may spend: all of it where only one stage was planned.
fn share_of_reading(recording: &Recording, k: usize) -> f64 {
    let is_sampled = recording.readings.get(k).is_some_and(|r| r.uncertainty.is_sampled());
    recording.stages.get(k).filter(|_| is_sampled).map_or(1.0, |_| ERROR_SHARE_PER_STAGE)
}

/// The components of a reading's uncertainty.
fn uncertainty_components(uncertainty: &Uncertainty) -> Vec<Component> {
    let chance = uncertainty.standard_error().unwrap_or(0.0);
    vec![
        Component::normal(Source::MonteCarlo, chance, uncertainty.degrees_of_freedom()),
        Component::within(Source::Discretisation, uncertainty.bound()),
    ]
}

/// The task's own reference for a reading of an engine; the reference engine itself has none.
fn reference_of_task(task: &Task, recordings: &[&Recording], k: usize, engine: &EngineName) -> Option<ScoredReference> {
    let (witness, basis, source) = match task.reference() {
        procedures::Reference::Engine { engine, basis, source } => (engine, basis, source),
        procedures::Reference::Formula { of, source } => {
            return Some(ScoredReference::from_formula(of(&task.scene, &task.targets[k]), source));
        }
    };
    if *engine == witness {
        return None;
    }
    let recording = recordings.iter().find(|r| r.key.engine == witness)?;
    let reading = recording.reading(k, &task.targets[k].id)?;
    let source = match recording.method.get("solver") {
        Some(solver) if basis == Basis::Simulator => format!("{source}: {solver}"),
        _ => source.to_owned(),
    };
    Some(ScoredReference::from_reading(reading, basis, source))
}
