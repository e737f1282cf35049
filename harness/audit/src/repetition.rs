//! Checks the errors that user programs state: they read again with other seeds, and the scatter is compared.
//!
//! Built-in drivers state how their blocks scatter, which they measure. A user's program may state anything.
//! It repeats what it sampled three times, at a quarter of the effort. Of the readings that it claims to be free of
//! chance it repeats a random twentieth, and all of them where one has another value.

use luxproof_statistics::stated_errors;
use std::collections::BTreeMap;
use std::ops::RangeInclusive;

use super::jobs::{ErrorFindings, Outcome, Running};
use super::sampling::{seed_of_stage, stations_of};
use crate::measure::{Failure, Question};
use crate::plan::{Fill, Run};
use luxproof_engines::{Job, Measurement};
use luxproof_model::{Comparison, Source, Verdict};
use luxproof_model::{
    EngineName, ErrorFinding, Estimate, FailureKind, MeterId, Reading, ReadingKey, Recording, StatedErrors, Uncertainty,
};
use luxproof_process::process;
use luxproof_spec::Budget;
use luxproof_spec::procedures::Task;
use luxproof_statistics::SINGLE_PRECISION;
use luxproof_statistics::{MeterPassingByErrorOnly, Tails, Variation};
use luxproof_verdict::{Judge, MAX_STAGES};

/// Numbers of the repetitions that every such program makes.
const REPETITIONS: RangeInclusive<u32> = 1..=3;
/// Numbers of the repetitions that follow where only a stated error prevents a failure.
const FURTHER_REPETITIONS: RangeInclusive<u32> = 4..=6;
/// The effort of a repetition relative to that of the first stage.
const REPETITION_EFFORT: f64 = 0.25;
/// The share of the claimed readings that is repeated, at least one reading per task.
const REPEATED_CLAIMS_SHARE: f64 = 0.05;
/// The largest share of the tolerance that an unchecked error may take.
///
/// It is also limited to the requested error. Deviations above twice the tolerance thus fail.
const MAX_UNCHECKED_SHARE: f64 = 0.5;

/// Standard uncertainties that contain nearly all of an error.
const NEARLY_ALL_SIGMAS: f64 = 3.0;

/// The readings of several seeds, one list per target.
type Repeated = Vec<Vec<Estimate>>;

/// What a program read again of one run.
struct RepeatedReadings<'a> {
    run: &'a Run,
    task: &'a Task,
    engine: EngineName,
    was_asked: bool,
    /// Whether the engine rendered every sensor, whatever the plan's shortcut.
    is_whole: bool,
    /// The targets that were sampled.
    sampled_targets: Vec<usize>,
    /// The targets that it claims to be free of chance.
    claimed_targets: Vec<usize>,
    /// The readings of the sampled targets; `None` where the program did not answer.
    sampled: Option<Repeated>,
    /// The readings of the claimed targets where a claim is wrong, else empty; `None` where it did not answer.
    claims: Option<Repeated>,
}

/// The findings on stated errors, and the repeated readings behind them.
#[derive(Default)]
pub(super) struct Examination<'a> {
    pub(super) found: ErrorFindings,
    /// Each with the tails that all repeated readings of its engine show.
    repeated: Vec<(RepeatedReadings<'a>, Tails)>,
}

/// Repeats readings, records the findings and corrects the errors of the readings.
///
/// There is one finding per engine and procedure, for what it sampled and for what it claims.
pub(super) fn examine<'a>(running: &'a Running<'_>, judge: &Judge<'_>, outcome: &mut Outcome) -> Examination<'a> {
    let mut examination = Examination::default();
    for (e, planned) in running.plan.engines.iter().enumerate().filter(|(_, p)| !p.engine.has_trusted_error()) {
        let name = planned.engine.name();
        let runs = running.plan.runs.iter().filter(|run| run.engine == e);
        let all: Vec<RepeatedReadings<'_>> = runs.map(|run| repeat_run(running, run, &name, outcome)).collect();
        let rendered = all.iter().filter_map(RepeatedReadings::rendered);
        let variation: Variation = rendered.map(|meters| Variation::of(&meters)).sum();
        // Tails need many readings, so those of all runs of the engine count together.
        let scattered: Repeated = all.iter().flat_map(RepeatedReadings::scattered).collect();
        let tails = Tails::of(&scattered);
        let heavy_tails = stated_errors::of_tails(&scattered, tails);
        for repeated in &all {
            let mut found = repeated.errors_found(&variation, &repeated.compare(judge, outcome, Some(&[])));
            found.extend(heavy_tails.clone());
            let compared = repeated.compare(judge, outcome, Some(&found));
            found.extend(refuted(&compared));
            found.extend(repeated.examine_passing_by_error_only(running, &compared, tails));
            examination.found.insert((name.clone(), repeated.task.procedure), found);
        }
        examination.repeated.extend(all.into_iter().map(|repeated| (repeated, tails)));
    }
    for recording in &mut outcome.recordings {
        let ReadingKey { engine, procedure, .. } = &recording.key;
        let Some(found) = examination.found.get(&(engine.clone(), *procedure)) else { continue };
        correct(recording, found);
    }
    examination
}

impl Examination<'_> {
    /// Checks stated errors again after all stages, where now only such an error prevents a verdict.
    pub(super) fn examine_stages(&self, running: &Running<'_>, judge: &Judge<'_>, outcome: &mut Outcome) {
        for (repeated, tails) in &self.repeated {
            let compared = repeated.compare(judge, outcome, None);
            let mut found: Vec<StatedErrors> =
                [beyond_tolerance(&compared), refuted(&compared)].into_iter().flatten().collect();
            found.extend(repeated.examine_passing_by_error_only(running, &compared, *tails));
            for recording in outcome.recordings.iter_mut().filter(|r| repeated.is_of(r)) {
                correct_readings(recording, &found);
                recording.stated_errors.extend(found.iter().cloned());
            }
        }
    }
}

impl RepeatedReadings<'_> {
    /// Whether a recording is the one that was repeated.
    fn is_of(&self, recording: &Recording) -> bool {
        recording.key.engine == self.engine && recording.key.procedure == self.task.procedure
    }

    /// Whether the engine rendered a target; mirrored targets add no information.
    fn is_rendered(&self, target: usize) -> bool {
        let fills = &self.run.shortcut.fill[self.task.stations_of(target)];
        self.is_whole || fills.iter().any(|fill| matches!(fill, Fill::Rendered(_)))
    }

    /// The sampled readings of rendered targets.
    fn rendered(&self) -> Option<Repeated> {
        let meters = self.sampled_targets.iter().zip(self.sampled.as_ref()?).filter(|(k, _)| self.is_rendered(**k));
        Some(meters.map(|(_, readings)| readings.clone()).collect())
    }

    /// All readings that scatter: those that were sampled, and those of wrong claims.
    fn scattered(&self) -> Repeated {
        self.rendered().into_iter().chain(self.claims.clone()).flatten().collect()
    }

    /// The readings of sampled targets with their meters.
    fn with_meters(&self, readings: &[Vec<Estimate>]) -> Vec<(MeterId, Vec<Estimate>)> {
        let meters = self.sampled_targets.iter().map(|k| self.task.targets[*k].id.clone());
        meters.zip(readings.iter().cloned()).collect()
    }

    /// What the repeated readings show about the stated errors.
    fn errors_found(&self, variation: &Variation, compared: &[Comparison]) -> Vec<StatedErrors> {
        let (sampled, rendered) = (self.sampled.as_deref(), self.rendered());
        let of_sampled = rendered.as_deref().and_then(|meters| stated_errors::of_sampled(meters, variation));
        let effort_exponent = rendered.as_deref().and_then(error_exponent);
        [
            of_sampled.map(|found| StatedErrors { effort_exponent, ..found }),
            self.claims.as_deref().and_then(stated_errors::check_claims),
            sampled.and_then(|meters| stated_errors::of_unstated(&self.with_meters(meters))),
            self.refusal(compared),
            beyond_tolerance(compared),
        ]
        .into_iter()
        .flatten()
        .collect()
    }

    /// The finding on a program that does not read again what it was asked to.
    fn refusal(&self, compared: &[Comparison]) -> Option<StatedErrors> {
        // A program that states no sampling error any more does not repeat the reading that had one.
        let sampled = self.sampled.as_deref();
        let refuses_sampled = sampled.is_none_or(is_withdrawn);
        if !self.was_asked || !(refuses_sampled || self.claims.is_none()) {
            return None;
        }
        // Samples that meet nothing with other seeds state no error either: they scatter, and are not limited.
        let is_steady = sampled.is_none_or(|meters| meters.iter().all(|readings| is_same(readings)));
        let at_meters = if refuses_sampled && is_steady { self.limit_unchecked(compared) } else { None };
        Some(at_meters.unwrap_or_else(|| StatedErrors::from_finding(ErrorFinding::NotRepeated)))
    }

    /// Limits the sampled errors that nothing could check.
    fn limit_unchecked(&self, compared: &[Comparison]) -> Option<StatedErrors> {
        let limits =
            error_limits(compared, |c, allowed| c.uncertainty.is_sampled().then(|| self.unchecked_error(c, allowed)));
        StatedErrors::from_finding_at(ErrorFinding::NotRepeated, limits)
    }

    /// The error that an unchecked statement may have at most.
    fn unchecked_error(&self, comparison: &Comparison, allowed: f64) -> f64 {
        let requested = self.run.job.budget.relative_error * comparison.value.unwrap_or(0.0).abs();
        requested.min(MAX_UNCHECKED_SHARE * allowed)
    }

    /// Repeats readings further where only a stated error prevents a failure, and checks the scatter at those meters.
    fn examine_passing_by_error_only(
        &self,
        running: &Running<'_>,
        compared: &[Comparison],
        tails: Tails,
    ) -> Vec<StatedErrors> {
        let limits = error_limits(compared, |c, allowed| {
            passes_by_error_only(c, allowed).then(|| self.unchecked_error(c, allowed))
        });
        let is_sheltered = |k: usize| limits.contains_key(&self.task.targets[k].id);
        let kinds = [(&self.sampled_targets, &self.sampled, true), (&self.claimed_targets, &self.claims, false)];
        let mut meters = vec![];
        for (targets, readings, is_sampled) in kinds {
            let Some(readings) = readings.as_ref().filter(|readings| !readings.is_empty()) else { continue };
            if process::is_interrupted() || !targets.iter().any(|k| is_sheltered(*k)) {
                continue;
            }
            let further: Repeated = FURTHER_REPETITIONS
                .filter_map(|number| self.repeat_again(running, targets, is_sampled, number))
                .collect();
            if further.is_empty() {
                return StatedErrors::from_finding_at(ErrorFinding::NotRepeated, limits).into_iter().collect();
            }
            for (n, (k, readings)) in targets.iter().zip(readings).enumerate() {
                if !is_sheltered(*k) {
                    continue;
                }
                let meter = self.task.targets[*k].id.clone();
                let readings = readings.iter().copied().chain(further.iter().map(|all| all[n])).collect();
                meters.push(MeterPassingByErrorOnly { counts: effective_error(compared, &meter), meter, readings });
            }
        }
        stated_errors::of_sheltered(&meters, tails)
    }

    /// One further repetition of sampled or claimed targets.
    fn repeat_again(
        &self,
        running: &Running<'_>,
        targets: &[usize],
        is_sampled: bool,
        number: u32,
    ) -> Option<Vec<Estimate>> {
        if is_sampled {
            repeat_sampled(running, self.run, self.is_whole, targets, number)
        } else {
            repeat_claimed(running, self.run, targets, number)
        }
    }

    /// Compares the engine's readings of the task with corrected errors; `None` compares them as they are.
    fn compare(&self, judge: &Judge<'_>, outcome: &Outcome, found: Option<&[StatedErrors]>) -> Vec<Comparison> {
        let of_task = outcome.recordings.iter().filter(|r| r.key.procedure == self.task.procedure);
        let (mine, others): (Vec<_>, Vec<_>) = of_task.partition(|r| r.key.engine == self.engine);
        let mut compared = vec![];
        for recording in mine {
            let mut recording = recording.clone();
            if let Some(found) = found {
                correct(&mut recording, found);
            }
            compared.extend(judge.compare_one(self.task, &recording, &others));
        }
        compared
    }
}

/// Whether only a sampled error prevents a comparison from failing.
fn passes_by_error_only(comparison: &Comparison, allowed: f64) -> bool {
    comparison.verdict == Verdict::Undecided
        && comparison.uncertainty.is_sampled()
        && comparison.deviation.is_some_and(|deviation| deviation.abs() > allowed)
}

/// The relative standard error in effect at a meter; `None` where no sample met anything.
fn effective_error(compared: &[Comparison], meter: &MeterId) -> Option<f64> {
    let here = compared.iter().find(|c| c.meter == *meter)?;
    Some(here.uncertainty.standard_error()? / here.value?.abs()).filter(|relative| relative.is_finite())
}

/// Repeats the readings of a run, those that were sampled and those that are claimed.
fn repeat_run<'a>(
    running: &'a Running<'_>,
    run: &'a Run,
    engine: &EngineName,
    outcome: &Outcome,
) -> RepeatedReadings<'a> {
    let task = &running.plan.tasks[run.task];
    let mine = outcome.recordings.iter().find(|r| r.key.engine == *engine && r.key.procedure == task.procedure);
    let readings = mine.filter(|r| r.failure.is_none()).map_or(&[][..], |r| &r.readings);
    let (sampled_targets, claimed_targets): (Vec<usize>, Vec<usize>) =
        (0..readings.len()).partition(|k| readings[*k].uncertainty.is_sampled());
    let claimed_targets = rendered_targets(running, run, claimed_targets);
    let is_whole =
        run.shortcut.job.sensors.is_empty() || outcome.contradicted.contains(&(engine.clone(), task.procedure));
    let sampled = repeat_targets(readings, &sampled_targets, |number| {
        repeat_sampled(running, run, is_whole, &sampled_targets, number)
    });
    let claims = contradicted_claims(running, run, readings, &claimed_targets);
    let was_asked = !(process::is_interrupted() || sampled_targets.is_empty() && claimed_targets.is_empty());
    RepeatedReadings {
        run,
        task,
        engine: engine.clone(),
        was_asked,
        is_whole,
        sampled_targets,
        claimed_targets,
        sampled,
        claims,
    }
}

/// Records the findings on a recording and corrects the errors of its readings.
fn correct(recording: &mut Recording, found: &[StatedErrors]) {
    recording.stated_errors = found.to_vec();
    recording.design_effect = found.iter().filter(|s| s.ratio.is_some()).map(|s| s.design_effect).reduce(f64::max);
    correct_readings(recording, found);
}

/// Corrects the errors of readings by the findings.
fn correct_readings(recording: &mut Recording, found: &[StatedErrors]) {
    for reading in &mut recording.readings {
        reading.uncertainty = stated_errors::corrected(found, &reading.meter, estimate(reading)).uncertainty;
    }
}

/// For each meter the smallest relative error that `error` computes from its comparisons and what they allow.
fn error_limits(compared: &[Comparison], error: impl Fn(&Comparison, f64) -> Option<f64>) -> BTreeMap<MeterId, f64> {
    let mut limits = BTreeMap::new();
    for c in compared {
        let (Some(value), Some(reference)) = (c.value, &c.reference) else { continue };
        let Some(error) = error(c, c.tolerance.around(reference.value)) else { continue };
        let relative = if value == 0.0 { 0.0 } else { error / value.abs() };
        limits.entry(c.meter.clone()).and_modify(|least: &mut f64| *least = least.min(relative)).or_insert(relative);
    }
    limits
}

/// How stated errors fall with effort: 1 where they fall by its square root, 0 where they do not fall.
fn error_exponent(meters: &[Vec<Estimate>]) -> Option<f64> {
    let increases: Vec<f64> = meters.iter().filter_map(|readings| log_variance_increase(readings)).collect();
    let mean = increases.iter().sum::<f64>() / increases.len() as f64;
    (!increases.is_empty()).then(|| mean / REPETITION_EFFORT.recip().ln())
}

/// By how much the logarithm of the variance is larger in the repetitions than in the first reading, which is the last.
fn log_variance_increase(readings: &[Estimate]) -> Option<f64> {
    let (first, others) = readings.split_last()?;
    let others: Vec<f64> = others.iter().filter_map(log_variance).collect();
    let mean = others.iter().sum::<f64>() / others.len() as f64;
    Some(mean - log_variance(first)?).filter(|increase| increase.is_finite())
}

/// The logarithm of the squared standard error, where that is positive.
fn log_variance(estimate: &Estimate) -> Option<f64> {
    estimate.uncertainty.standard_error().filter(|error| *error > 0.0).map(|error| 2.0 * error.ln())
}

/// Whether readings of different seeds agree up to rounding.
fn is_same(readings: &[Estimate]) -> bool {
    let low = readings.iter().map(|e| e.value).fold(f64::INFINITY, f64::min);
    let high = readings.iter().map(|e| e.value).fold(f64::NEG_INFINITY, f64::max);
    high - low <= SINGLE_PRECISION * high.abs()
}

/// Whether a program states no error with other seeds at most of the meters where it first stated one.
fn is_withdrawn(meters: &[Vec<Estimate>]) -> bool {
    let (mut stated, mut restated) = (0, 0);
    for readings in meters {
        let Some((first, others)) = readings.split_last() else { continue };
        if others.is_empty() || !states_error(first) {
            continue;
        }
        stated += 1;
        restated += usize::from(others.iter().any(states_error));
    }
    2 * restated < stated
}

/// Whether an estimate comes with a positive standard error.
fn states_error(estimate: &Estimate) -> bool {
    estimate.uncertainty.standard_error().is_some_and(|error| error > 0.0)
}

/// Rejects bounds so wide that any reading could lie within the tolerance and beyond it.
fn beyond_tolerance(compared: &[Comparison]) -> Option<StatedErrors> {
    let brightest = compared.iter().filter_map(|c| c.value).fold(0.0, f64::max);
    let limits = error_limits(compared, |c, allowed| {
        let bound = c.uncertainty.bound();
        (bound >= allowed && bound > SINGLE_PRECISION * brightest).then_some(0.0)
    });
    StatedErrors::from_finding_at(ErrorFinding::BeyondTolerance, limits)
}

/// Rejects bounds that the readings refute: the deviation is larger than the bound and all other errors explain.
///
/// Only bounds that prevent a failure matter here, since a wrong claim must not protect a reading.
fn refuted(compared: &[Comparison]) -> Option<StatedErrors> {
    let limits = error_limits(compared, |c, allowed| is_refuted(c, allowed).unwrap_or(false).then_some(0.0));
    StatedErrors::from_finding_at(ErrorFinding::Refuted, limits)
}

/// Whether a bound keeps a comparison undecided although the deviation lies beyond everything that could explain it.
fn is_refuted(c: &Comparison, allowed: f64) -> Option<bool> {
    let (bound, deviation, budget) = (c.uncertainty.bound(), c.deviation?.abs(), c.budget.as_ref()?);
    let others = budget.components.iter().filter(|part| part.source != Source::Discretisation);
    let others = others.map(|part| part.uncertainty.powi(2)).sum::<f64>().sqrt();
    let reach = bound.max(allowed) + budget.coverage_factor.max(NEARLY_ALL_SIGMAS) * others;
    let is_sheltered = c.verdict == Verdict::Undecided && bound > 0.0 && bound < allowed;
    Some(is_sheltered && deviation > reach)
}

/// A reading without its meter.
fn estimate(reading: &Reading) -> Estimate {
    Estimate { value: reading.value, uncertainty: reading.uncertainty }
}

/// Those of the targets that were rendered; the spot check covers what follows from others.
fn rendered_targets(running: &Running<'_>, run: &Run, targets: Vec<usize>) -> Vec<usize> {
    let (task, unseen) = (&running.plan.tasks[run.task], run.shortcut.unseen(&run.job));
    targets.into_iter().filter(|k| !unseen.iter().any(|s| task.stations_of(*k).contains(s))).collect()
}

/// All claimed readings with several repetitions, where another seed contradicts a claim.
///
/// The list is empty without a claim or a contradiction, and `None` where the engine does not answer again.
fn contradicted_claims(running: &Running<'_>, run: &Run, readings: &[Reading], claimed: &[usize]) -> Option<Repeated> {
    let mut drawn = claimed.to_vec();
    fastrand::Rng::with_seed(run.job.seed).shuffle(&mut drawn);
    drawn.truncate((REPEATED_CLAIMS_SHARE * claimed.len() as f64).ceil() as usize);
    if drawn.is_empty() {
        return Some(vec![]);
    }
    let repeated = repeat_claimed(running, run, &drawn, 1)?;
    let brightest = readings.iter().map(|r| r.value).fold(0.0, f64::max);
    if !drawn.iter().zip(&repeated).any(|(k, now)| differs(&readings[*k], now, brightest)) {
        return Some(vec![]);
    }
    let mut all = repeat_targets(readings, claimed, |number| repeat_claimed(running, run, claimed, number))?;
    for estimates in &mut all {
        estimates.retain(|e| e.uncertainty != Uncertainty::NotSeen);
    }
    Some(all)
}

/// Whether a repeated reading differs by more than both bounds and rounding explain.
fn differs(reading: &Reading, repeated: &Estimate, brightest: f64) -> bool {
    let bound = reading.uncertainty.bound() + repeated.uncertainty.bound();
    (repeated.value - reading.value).abs() > bound + SINGLE_PRECISION * repeated.value.max(brightest)
}

/// The repeated readings of each target, then the first one; `None` where the engine does not answer again.
fn repeat_targets(
    readings: &[Reading],
    targets: &[usize],
    repeat: impl Fn(u32) -> Option<Vec<Estimate>>,
) -> Option<Repeated> {
    if targets.is_empty() {
        return Some(vec![]);
    }
    let repetitions: Repeated = REPETITIONS.filter_map(repeat).collect();
    if repetitions.is_empty() {
        return None;
    }
    let by_target = targets.iter().enumerate().map(|(k, target)| {
        let repeated = repetitions.iter().map(|estimates| estimates[k]);
        repeated.chain([estimate(&readings[*target])]).collect()
    });
    Some(by_target.collect())
}

/// Repeats sampled targets by the very job of the run: a reading that depends on the other meters does so again.
fn repeat_sampled(
    running: &Running<'_>,
    run: &Run,
    is_whole: bool,
    targets: &[usize],
    number: u32,
) -> Option<Vec<Estimate>> {
    let task = &running.plan.tasks[run.task];
    let job = if is_whole { &run.job } else { &run.shortcut.job };
    let measurement = repeat_job(running, run, job.clone(), number, REPETITION_EFFORT)?;
    let whole = if is_whole { measurement } else { run.shortcut.complete(measurement, &run.job) };
    let all = whole.readings(&task.targets);
    Some(targets.iter().map(|k| all[*k]).collect())
}

/// Repeats claimed targets alone, at the whole effort.
fn repeat_claimed(running: &Running<'_>, run: &Run, targets: &[usize], number: u32) -> Option<Vec<Estimate>> {
    let task = &running.plan.tasks[run.task];
    let job = Job { sensors: stations_of(run, task, targets), ..run.job.clone() };
    let measurement = repeat_job(running, run, job, number, 1.0)?;
    Some(measurement.readings(targets.iter().map(|k| &task.targets[*k])))
}

/// An engine's answer to a job with another seed and this share of the effort.
fn repeat_job(running: &Running<'_>, run: &Run, job: Job, number: u32, effort: f64) -> Option<Measurement> {
    let (planned, task) = (&running.plan.engines[run.engine], &running.plan.tasks[run.task]);
    let Budget { relative_error, seconds } = job.budget;
    let job = Job {
        budget: Budget { relative_error: relative_error / effort.sqrt(), seconds: effort * seconds },
        // The seeds of repetitions follow those of all stages.
        seed: seed_of_stage(job.seed, MAX_STAGES + number),
        ..job
    };
    let folder = format!("{}/repetition-{number}", task.procedure);
    match running.reader.read(&Question::new(&planned.instrument()?, &job, &folder)) {
        Ok(taken) => Some(taken.measurement),
        Err(failure) => {
            warn_not_repeated(&planned.engine.name(), &failure);
            None
        }
    }
}

/// Warns that an engine did not read again, unless another process is still to take the reading.
fn warn_not_repeated(engine: &EngineName, failure: &Failure) {
    if failure.kind != FailureKind::Unread {
        tracing::warn!("{engine}: not read again: {failure}");
    }
}
