//! Grants the budgets of first stages and requests further stages through the reader of the run.

use luxproof_statistics::stated_errors;
use std::collections::BTreeSet;

use super::jobs::{ErrorFindings, Outcome, Running};
use super::observer::FurtherStage;
use super::sequential::{self, StageRequest};
use crate::measure::{AnswerSource, CostedMeasurement, Question};
use crate::plan::{Plan, Run};
use luxproof_engines::{Job, Measurement, Sensor};
use luxproof_model::{EngineName, Recording, StatedErrors};
use luxproof_model::{Sampling, Tolerance};
use luxproof_process::files::FileError;
use luxproof_spec::Budget;
use luxproof_spec::procedures::Task;
use luxproof_verdict::{Judge, MAX_STAGES};

/// Sets the budget of the first stage in the jobs of a plan.
///
/// A reference that samples works as finely as the narrowest tolerance that it serves, and no finer.
pub(super) fn grant(sampling: Sampling, judge: &Judge<'_>, plan: &mut Plan) {
    let tolerances: Vec<f64> = plan.runs.iter().map(|run| narrowest_tolerance(run, plan, judge)).collect();
    for (run, tolerance) in plan.runs.iter_mut().zip(tolerances) {
        let engine = &plan.engines[run.engine].engine;
        if engine.is_reference_engine() && engine.samples(&run.job) {
            let relative_error = run.job.budget.relative_error.max(tolerance);
            run.grant(Budget { relative_error, ..run.job.budget });
        }
    }
    if sampling == Sampling::Accurate {
        return;
    }
    for run in &mut plan.runs {
        let engine = &plan.engines[run.engine].engine;
        // A user's program is judged at the spec's own budget: nothing is known about how it uses another.
        if !engine.is_reference_engine() && engine.has_trusted_error() {
            let tolerance = light_tolerance(&plan.tasks[run.task], judge, engine.name().as_str());
            run.grant(sequential::first_stage_budget(run.job.budget, tolerance));
        }
    }
}

/// The narrowest tolerance of the engines that are judged in the task of a run.
fn narrowest_tolerance(run: &Run, plan: &Plan, judge: &Judge<'_>) -> f64 {
    let subjects = plan.engines.iter().map(|planned| &planned.engine).filter(|engine| !engine.is_reference_engine());
    let names = subjects.map(|engine| engine.name());
    // Without subjects it is the tolerance of any other engine.
    let names = names.chain([EngineName::from("subject")]);
    let tolerances = names.map(|name| light_tolerance(&plan.tasks[run.task], judge, name.as_str()));
    tolerances.fold(f64::INFINITY, f64::min)
}

/// The relative tolerance of the light that an engine reads.
///
/// For a UGR it is the relative change of the background that moves the rating by the tolerance: dUGR = 8 / ln 10 dE /
/// E.
fn light_tolerance(task: &Task, judge: &Judge<'_>, engine: &str) -> f64 {
    let Tolerance { relative, absolute } = judge.tolerance(task, engine);
    if task.quantity.has_zero() { relative } else { absolute * std::f64::consts::LN_10 / 8.0 }
}

/// The error requested of a sampled reference whose own error leaves a comparison undecided, relative to its first
/// error.
///
/// It is a tenth of the tolerance, after a quarter in the first stage. It thus adds half a percent to a combined
/// uncertainty (JCGM 100:2008, 5.1.2).
const FINER_ERROR_FACTOR: f64 = 0.4;

/// Requests further stages wherever a comparison is undecided, and reports each to the observer.
///
/// References come first, since no sample of a subject makes up for their errors. They also come last, since the
/// subjects may then be closer to the tolerance. Stops early while other processes still have to take readings.
pub(super) fn sample_on(
    running: &Running<'_>,
    judge: &Judge<'_>,
    stated: &ErrorFindings,
    outcome: &mut Outcome,
) -> Result<(), FileError> {
    let mut refined = BTreeSet::new();
    refine_references(running, judge, outcome, &mut refined)?;
    if running.reader.asked.leaves_open() {
        return Ok(());
    }
    sample_subjects(running, judge, stated, outcome)?;
    if running.reader.asked.leaves_open() {
        return Ok(());
    }
    refine_references(running, judge, outcome, &mut refined)
}

/// Requests finer readings of sampled references, once at each target that they leave undecided.
///
/// `refined` holds the run and the target of every such request.
fn refine_references(
    running: &Running<'_>,
    judge: &Judge<'_>,
    outcome: &mut Outcome,
    refined: &mut BTreeSet<(usize, usize)>,
) -> Result<(), FileError> {
    for (index, run) in running.plan.runs.iter().enumerate() {
        let (planned, task) = (&running.plan.engines[run.engine], &running.plan.tasks[run.task]);
        let engine = planned.engine.name();
        if !planned.engine.is_reference_engine() || !planned.engine.samples(&run.job) {
            continue;
        }
        let of_task: Vec<&Recording> =
            outcome.recordings.iter().filter(|r| r.key.procedure == task.procedure).collect();
        let request = finer_request(judge, task, &of_task, run.job.budget, |target| refined.insert((index, target)));
        let mine = outcome.recordings.iter().position(|r| r.key.engine == engine && r.key.procedure == task.procedure);
        let Some((mine, mut request)) = mine.zip(request) else { continue };
        let recording = &mut outcome.recordings[mine];
        if recording.failure.is_some() {
            continue;
        }
        request.patience = sequential::patience_left(recording, request.budget);
        // A finer reading takes longer than the present one.
        if request.patience.as_secs_f64() < recording.wall_s {
            let count = request.targets.len();
            recording.cut_to.get_or_insert(FINER_ERROR_FACTOR.powi(2));
            recording
                .notes
                .push(format!("time limit: {count} meters that it leaves undecided were not read more finely"));
            continue;
        }
        match take_stage(running, run, &request) {
            Ok(taken) => {
                outcome.from_cache += usize::from(taken.source == AnswerSource::Cache);
                recording.wall_s += taken.cost.wall_s;
                recording.cut_to = [recording.cut_to, taken.measurement.cut_to].into_iter().flatten().reduce(f64::min);
                adopt_finer(recording, task, &request, &taken.measurement);
                if let Some(status) = outcome.engines.iter_mut().find(|e| e.id == engine) {
                    status.wall_s += taken.cost.wall_s;
                }
            }
            Err(why) => {
                let count = request.targets.len();
                recording.notes.push(format!("reading {count} meters more finely gave nothing: {why}"));
            }
        }
        running.keep(&engine, &outcome.recordings)?;
    }
    Ok(())
}

/// The request for finer readings at the targets that a reference leaves undecided and that `is_new` admits.
///
/// Each target is requested once in a run: a reference that cannot do better must not be asked forever.
fn finer_request(
    judge: &Judge<'_>,
    task: &Task,
    recordings: &[&Recording],
    budget: Budget,
    mut is_new: impl FnMut(usize) -> bool,
) -> Option<StageRequest> {
    let mut targets = sequential::undecided_by_reference(judge, task, recordings);
    targets.retain(|target| is_new(*target));
    let budget = Budget { relative_error: FINER_ERROR_FACTOR * budget.relative_error, ..budget };
    (!targets.is_empty()).then_some(StageRequest { stage: 2, targets, budget, patience: budget.patience() })
}

/// Replaces readings by finer ones where those have the smaller uncertainty.
fn adopt_finer(recording: &mut Recording, task: &Task, request: &StageRequest, measurement: &Measurement) {
    let estimates = measurement.readings(request.targets.iter().map(|k| &task.targets[*k]));
    for (k, estimate) in request.targets.iter().zip(estimates) {
        let reading = &mut recording.readings[*k];
        if estimate.uncertainty.standard() < reading.uncertainty.standard() {
            (reading.value, reading.uncertainty) = (estimate.value, estimate.uncertainty);
        }
    }
    let count = request.targets.len();
    recording.notes.push(format!("read more finely at {count} meters, where it left comparisons undecided"));
}

/// Requests further stages of every engine that is judged, until its comparisons are decided.
fn sample_subjects(
    running: &Running<'_>,
    judge: &Judge<'_>,
    stated: &ErrorFindings,
    outcome: &mut Outcome,
) -> Result<(), FileError> {
    for run in &running.plan.runs {
        let (planned, task) = (&running.plan.engines[run.engine], &running.plan.tasks[run.task]);
        let engine = planned.engine.name();
        if planned.engine.is_reference_engine() {
            continue;
        }
        let mine = outcome.recordings.iter().position(|r| r.key.engine == engine && r.key.procedure == task.procedure);
        let Some(mine) = mine else { continue };
        let mut subject = outcome.recordings[mine].clone();
        let of_task = outcome.recordings.iter().filter(|r| r.key.procedure == task.procedure);
        let others: Vec<&Recording> = of_task.filter(|r| r.key.engine != engine).collect();
        let found = stated.get(&(engine.clone(), task.procedure)).map_or(&[][..], Vec::as_slice);
        let (before_s, whole, mut from_cache) = (subject.wall_s, running.case.budget, 0);
        let budgets = (run.job.budget, whole);
        sequential::sample_until_decided(judge, task, &others, &mut subject, budgets, &mut |request| {
            let mut taken = take_stage(running, run, request)?;
            correct_stage(&mut taken.measurement, task, request, found);
            from_cache += usize::from(taken.source == AnswerSource::Cache);
            Ok((taken.measurement, taken.cost))
        });
        if run.job.budget != whole && sequential::is_decided(judge, task, &others, &subject) {
            subject.notes.extend(sequential::describe_savings(&subject, whole));
        }
        if let Some(status) = outcome.engines.iter_mut().find(|e| e.id == engine) {
            status.wall_s += subject.wall_s - before_s;
        }
        outcome.from_cache += from_cache;
        outcome.recordings[mine] = subject;
        running.keep(&engine, &outcome.recordings)?;
    }
    Ok(())
}

/// Corrects the stated errors of a stage by the findings on its engine.
fn correct_stage(measurement: &mut Measurement, task: &Task, request: &StageRequest, found: &[StatedErrors]) {
    let targets = request.targets.iter();
    let meters = targets.flat_map(|k| std::iter::repeat_n(&task.targets[*k].id, task.stations_of(*k).len()));
    for (estimate, meter) in measurement.estimates.iter_mut().zip(meters) {
        *estimate = stated_errors::corrected(found, meter, *estimate);
    }
}

/// Takes one further stage: a job of the undecided sensors alone, with another seed.
fn take_stage(running: &Running<'_>, run: &Run, request: &StageRequest) -> Result<CostedMeasurement, String> {
    let (planned, task) = (&running.plan.engines[run.engine], &running.plan.tasks[run.task]);
    let procedure = task.procedure;
    let further_stage = FurtherStage {
        engine: &planned.engine.name(),
        procedure,
        stage: request.stage,
        last_stage: MAX_STAGES,
        points: request.targets.len(),
        all_points: task.targets.len(),
        seconds: request.budget.seconds,
    };
    running.observer.sampled_again(running.case, &further_stage);
    let further = Job {
        sensors: stations_of(run, task, &request.targets),
        budget: request.budget,
        seed: seed_of_stage(run.job.seed, request.stage),
        ..run.job.clone()
    };
    let instrument = planned.instrument().ok_or("the engine is not there")?;
    let folder = format!("{procedure}/stage-{}", request.stage);
    let question = Question::new(&instrument, &further, &folder);
    let question = Question { patience: request.patience, may_join: true, ..question };
    running.reader.read(&question).map_err(|e| e.to_string())
}

/// The sensors of some targets of a run's task.
pub(super) fn stations_of(run: &Run, task: &Task, targets: &[usize]) -> Vec<Sensor> {
    targets.iter().flat_map(|k| run.job.sensors[task.stations_of(*k)].to_vec()).collect()
}

/// The seed of a stage. Seeds lie far from those that people choose, and differ modulo any small number.
pub(super) fn seed_of_stage(seed: u64, stage: u32) -> u64 {
    const STEP: u64 = 0x1_0000_0001;
    seed.wrapping_add(STEP.wrapping_mul(u64::from(stage - 1)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use luxproof_model::Verdict;
    use luxproof_model::{Estimate, Uncertainty};
    use luxproof_verdict::fixtures::{built_in, recording, task};

    const BUDGET: Budget = Budget { relative_error: 0.02, seconds: 60.0 };

    fn within(value: f64, bound: f64) -> Estimate {
        Estimate { value, uncertainty: Uncertainty::Bound(bound) }
    }

    fn noisy(value: f64, error: f64) -> Estimate {
        Estimate { value, uncertainty: Uncertainty::sampled(error, None) }
    }

    /// Meters of indirect light, a tolerance of 2 %: within by far, at its edge behind a bound and behind noise, beyond
    /// by far.
    fn subject() -> Recording {
        recording("radiance", &[noisy(1.0, 1e-4), noisy(1.018, 1e-4), noisy(1.018, 5e-3), noisy(1.2, 1e-4)])
    }

    fn asked(reference: &Recording, refined: &mut BTreeSet<usize>) -> Option<StageRequest> {
        let recordings = [reference, &subject()];
        finer_request(&built_in(), &task(4), &recordings, BUDGET, |target| refined.insert(target))
    }

    #[test]
    fn a_reference_is_asked_where_its_bound_leaves_something_open_and_nowhere_else() {
        let coarse = recording("simulator", &[within(1.0, 5e-3); 4]);
        let ask = asked(&coarse, &mut BTreeSet::new()).unwrap();
        assert_eq!(ask.targets, [1, 2]);
        assert!((ask.budget.relative_error - 0.008).abs() < 1e-15 && ask.budget.seconds == BUDGET.seconds);
        // What is exact leaves nothing open: noise is the subject's own.
        let exact = recording("simulator", &[Estimate::exact(1.0); 4]);
        assert_eq!(asked(&exact, &mut BTreeSet::new()), None);
    }

    #[test]
    fn a_finer_reference_decides_and_one_that_cannot_do_better_is_not_asked_again() {
        let (judge, task, mut refined) = (built_in(), task(4), BTreeSet::new());
        let mut reference = recording("simulator", &[within(1.0, 5e-3); 4]);
        let ask = asked(&reference, &mut refined).unwrap();
        let verdict = |reference: &Recording| {
            let compared = judge.compare(&task, &[reference, &subject()]);
            compared.iter().filter(|c| c.key.engine == "radiance").map(|c| c.verdict).nth(1)
        };
        assert_eq!(verdict(&reference), Some(Verdict::Undecided));
        // As wide as before at the one, narrower at the other: only what is narrower counts, and neither is asked
        // again.
        let finer = Measurement { estimates: vec![within(1.0005, 5e-4), within(1.1, 6e-3)], ..Measurement::default() };
        adopt_finer(&mut reference, &task, &ask, &finer);
        assert_eq!((reference.readings[1].value, reference.readings[2].value), (1.0005, 1.0));
        assert_eq!(verdict(&reference), Some(Verdict::Pass));
        assert_eq!(asked(&reference, &mut refined), None);
        assert!(sequential::undecided_by_reference(&judge, &task, &[&reference, &subject()]).contains(&2));
    }

    #[test]
    fn every_stage_has_a_seed_of_its_own() {
        let seeds: std::collections::BTreeSet<u64> = (1..=4).map(|stage| seed_of_stage(1, stage)).collect();
        let small: std::collections::BTreeSet<u64> = seeds.iter().map(|s| s % 16).collect();
        assert_eq!((seeds.len(), small.len(), seed_of_stage(7, 1)), (4, 4, 7));
    }
}
