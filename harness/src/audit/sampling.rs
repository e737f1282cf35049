//! Sampling until comparisons are decided: which budget first looks get, and further looks through the run's reader.

use std::collections::BTreeSet;

use super::jobs::{Found, Outcome, Running};
use super::sequential::{self, Ask};
use crate::engines::{Job, Measurement, Station};
use crate::judge::{Judge, Sampling, Tolerance};
use crate::measure::{Question, Source, Taken};
use crate::plan::{Plan, Run};
use crate::procedures::Task;
use crate::record::{EngineName, Recording, StatedErrors};
use crate::spec::Budget;
use crate::system::files::FileError;

/// Gives the jobs of a plan the budget of their first look.
///
/// A witness that has to sample itself works as finely as the narrowest tolerance asks that is judged by it, and no finer.
pub(super) fn grant(sampling: Sampling, judge: &Judge<'_>, plan: &mut Plan) {
    let tolerance = |run: &Run| {
        let engines = || plan.engines.iter().map(|e| &e.engine);
        let relative = |engine: EngineName| of_light(&plan.tasks[run.task], judge, engine.as_str());
        let subjects = engines().filter(|engine| !engine.is_witness()).map(|engine| relative(engine.name()));
        // Where nobody is judged, what would be.
        subjects.chain([relative(EngineName::from("subject"))]).fold(f64::INFINITY, f64::min)
    };
    let wide: Vec<f64> = plan.runs.iter().map(tolerance).collect();
    for (run, tolerance) in plan.runs.iter_mut().zip(wide) {
        let engine = &plan.engines[run.engine].engine;
        if engine.is_witness() && engine.samples(&run.job) {
            let relative_error = run.job.budget.relative_error.max(tolerance);
            run.grant(Budget { relative_error, ..run.job.budget });
        }
    }
    if sampling == Sampling::Accurate {
        return;
    }
    for run in &mut plan.runs {
        let engine = &plan.engines[run.engine].engine;
        // A program of a user's is judged at the budget that the spec gives: who knows what it makes of another.
        if !engine.is_witness() && engine.is_vouched_for() {
            let tolerance = of_light(&plan.tasks[run.task], judge, engine.name().as_str());
            run.grant(sequential::first_look(run.job.budget, tolerance));
        }
    }
}

/// The tolerance of the light that an engine reads, relative: of a rating the part of the background that moves it so much,
/// dUGR = 8 / ln 10 dE / E.
fn of_light(task: &Task, judge: &Judge<'_>, engine: &str) -> f64 {
    let Tolerance { relative, absolute } = judge.tolerance(task, engine);
    if task.quantity.has_zero() { relative } else { absolute * std::f64::consts::LN_10 / 8.0 }
}

/// How much finer a sampled reference is asked again where its own error leaves a comparison undecided: to a tenth of the tolerance, after
/// the quarter of its first look, so that it adds half a percent to a combined uncertainty (JCGM 100:2008, 5.1.2).
const FINER: f64 = 0.4;

/// Takes further looks wherever a comparison is undecided; the observer hears of each.
///
/// References come first, since no sample of a subject makes up for what its reference does not know, and last, where
/// what subjects were sampled to lies closer to the tolerance than their first looks did. What follows from readings that are still open
/// waits for them.
pub(super) fn sample_on(
    running: &Running<'_>,
    judge: &Judge<'_>,
    stated: &Found,
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

/// Asks sampled references more finely, once at each target that they leave undecided.
fn refine_references(
    running: &Running<'_>,
    judge: &Judge<'_>,
    outcome: &mut Outcome,
    refined: &mut BTreeSet<(usize, usize)>,
) -> Result<(), FileError> {
    for (index, run) in running.plan.runs.iter().enumerate() {
        let (planned, task) = (&running.plan.engines[run.engine], &running.plan.tasks[run.task]);
        let engine = planned.engine.name();
        if !planned.engine.is_witness() || !planned.engine.samples(&run.job) {
            continue;
        }
        let of_task: Vec<&Recording> =
            outcome.recordings.iter().filter(|r| r.key.procedure == task.procedure).collect();
        let ask = finer(judge, task, &of_task, run.job.budget, |target| refined.insert((index, target)));
        let mine = outcome.recordings.iter().position(|r| r.key.engine == engine && r.key.procedure == task.procedure);
        let Some((mine, mut ask)) = mine.zip(ask) else { continue };
        let recording = &mut outcome.recordings[mine];
        if recording.failure.is_some() {
            continue;
        }
        ask.patience = sequential::patience_left(recording, ask.budget);
        // What is finer takes longer.
        if ask.patience.as_secs_f64() < recording.wall_s {
            let count = ask.targets.len();
            recording.notes.push(format!(
                "{count} meters that it leaves undecided were not read more finely: its seconds are over"
            ));
            continue;
        }
        match look(running, run, &ask) {
            Ok(taken) => {
                outcome.from_cache += usize::from(taken.source == Source::Cache);
                recording.wall_s += taken.cost.wall_s;
                take_over(recording, task, &ask, &taken.measurement);
                if let Some(status) = outcome.engines.iter_mut().find(|e| e.id == engine) {
                    status.wall_s += taken.cost.wall_s;
                }
            }
            Err(why) => {
                recording.notes.push(format!("reading {} meters more finely gave nothing: {why}", ask.targets.len()));
            }
        }
        running.keep(&engine, &outcome.recordings)?;
    }
    Ok(())
}

/// What a reference is asked more finely: the targets that it leaves undecided and that `is_new` admits, each of them once in a run, so that
/// no reference that cannot do better is asked for ever.
fn finer(
    judge: &Judge<'_>,
    task: &Task,
    recordings: &[&Recording],
    budget: Budget,
    is_new: impl FnMut(usize) -> bool,
) -> Option<Ask> {
    let mut is_new = is_new;
    let mut targets = sequential::undecided_by_reference(judge, task, recordings);
    targets.retain(|target| is_new(*target));
    let budget = Budget { relative_error: FINER * budget.relative_error, ..budget };
    (!targets.is_empty()).then_some(Ask { look: 2, targets, budget, patience: budget.patience() })
}

/// Readings become what was read more finely, where that says less uncertainty of itself.
fn take_over(recording: &mut Recording, task: &Task, ask: &Ask, measurement: &Measurement) {
    let estimates = measurement.readings(ask.targets.iter().map(|k| &task.targets[*k]));
    for (k, estimate) in ask.targets.iter().zip(estimates) {
        let reading = &mut recording.readings[*k];
        if estimate.uncertainty.standard() < reading.uncertainty.standard() {
            (reading.value, reading.uncertainty) = (estimate.value, estimate.uncertainty);
        }
    }
    let count = ask.targets.len();
    recording.notes.push(format!("read more finely at {count} meters, whose comparisons it left undecided"));
}

fn sample_subjects(
    running: &Running<'_>,
    judge: &Judge<'_>,
    stated: &Found,
    outcome: &mut Outcome,
) -> Result<(), FileError> {
    for run in &running.plan.runs {
        let (planned, task) = (&running.plan.engines[run.engine], &running.plan.tasks[run.task]);
        let engine = planned.engine.name();
        if planned.engine.is_witness() {
            continue;
        }
        let of_task = |r: &&Recording| r.key.procedure == task.procedure;
        let is_mine = |r: &Recording| r.key.engine == engine && of_task(&r);
        let Some(mine) = outcome.recordings.iter().position(is_mine) else { continue };
        let mut subject = outcome.recordings[mine].clone();
        let others: Vec<&Recording> =
            outcome.recordings.iter().filter(of_task).filter(|r| r.key.engine != engine).collect();
        let found = stated.get(&(engine.clone(), task.procedure)).map_or(&[][..], Vec::as_slice);
        let mut sample = |ask: &Ask| {
            let mut taken = look(running, run, ask)?;
            let meter = |k: &usize| std::iter::repeat_n(&task.targets[*k].id, task.stations_of(*k).len());
            for (estimate, meter) in taken.measurement.estimates.iter_mut().zip(ask.targets.iter().flat_map(meter)) {
                *estimate = StatedErrors::corrected(found, meter, *estimate);
            }
            outcome.from_cache += usize::from(taken.source == Source::Cache);
            Ok((taken.measurement, taken.cost))
        };
        let (before_s, whole) = (subject.wall_s, running.case.budget);
        sequential::refine(judge, task, &others, &mut subject, (run.job.budget, whole), &mut sample);
        if run.job.budget != whole {
            subject.notes.extend(sequential::saved(&subject, whole));
        }
        if let Some(status) = outcome.engines.iter_mut().find(|e| e.id == engine) {
            status.wall_s += subject.wall_s - before_s;
        }
        outcome.recordings[mine] = subject;
        running.keep(&engine, &outcome.recordings)?;
    }
    Ok(())
}

/// A further look of one engine at one task: a job of the undecided stations alone, with a seed of its own.
fn look(running: &Running<'_>, run: &Run, ask: &Ask) -> Result<Taken, String> {
    let (planned, task) = (&running.plan.engines[run.engine], &running.plan.tasks[run.task]);
    let procedure = task.procedure;
    let told = format!(
        "{}: {} of {} meters of {procedure} are undecided: look {}, {:.0} s at most",
        planned.engine.name(),
        ask.targets.len(),
        task.targets.len(),
        ask.look,
        ask.budget.seconds
    );
    running.observer.remarked(running.case, &told);
    let further = Job {
        stations: stations_of(run, task, &ask.targets),
        budget: ask.budget,
        seed: seed_of_look(run.job.seed, ask.look),
        ..run.job.clone()
    };
    let instrument = planned.instrument().ok_or("the engine is not there")?;
    let place = format!("{procedure}/look-{}", ask.look);
    let question = Question { patience: ask.patience, may_join: true, ..Question::new(&instrument, &further, &place) };
    running.reader.read(&question).map_err(|e| e.to_string())
}

/// The stations of some targets of a run's task.
pub(super) fn stations_of(run: &Run, task: &Task, targets: &[usize]) -> Vec<Station> {
    targets.iter().flat_map(|k| run.job.stations[task.stations_of(*k)].to_vec()).collect()
}

/// Seeds of further looks lie far from those that people choose, and differ modulo any small number.
pub(super) fn seed_of_look(seed: u64, look: u32) -> u64 {
    const APART: u64 = 0x1_0000_0001;
    seed.wrapping_add(APART.wrapping_mul(u64::from(look - 1)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::judge::Verdict;
    use crate::judge::tests::{built_in, recording, task};
    use crate::record::{Estimate, Uncertainty};

    const BUDGET: Budget = Budget { relative_error: 0.02, seconds: 60.0 };

    fn within(value: f64, bound: f64) -> Estimate {
        Estimate { value, uncertainty: Uncertainty::Bound(bound) }
    }

    fn noisy(value: f64, error: f64) -> Estimate {
        Estimate { value, uncertainty: Uncertainty::sampled(error, None) }
    }

    /// Meters of indirect light, a tolerance of 2 %: within by far, at its edge behind a bound and behind noise, beyond by far.
    fn subject() -> Recording {
        recording("radiance", &[noisy(1.0, 1e-4), noisy(1.018, 1e-4), noisy(1.018, 5e-3), noisy(1.2, 1e-4)])
    }

    fn asked(reference: &Recording, refined: &mut BTreeSet<usize>) -> Option<Ask> {
        let of_task = [reference, &subject()];
        finer(&built_in(), &task(4), &of_task, BUDGET, |target| refined.insert(target))
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
        assert_eq!(verdict(&reference), Some(Verdict::Inconclusive));
        // As wide as before at the one, narrower at the other: only what is narrower counts, and neither is asked again.
        let finer = Measurement { estimates: vec![within(1.0005, 5e-4), within(1.1, 6e-3)], ..Measurement::default() };
        take_over(&mut reference, &task, &ask, &finer);
        assert_eq!((reference.readings[1].value, reference.readings[2].value), (1.0005, 1.0));
        assert_eq!(verdict(&reference), Some(Verdict::Pass));
        assert_eq!(asked(&reference, &mut refined), None);
        assert!(sequential::undecided_by_reference(&judge, &task, &[&reference, &subject()]).contains(&2));
    }

    #[test]
    fn every_look_has_a_seed_of_its_own() {
        let seeds: std::collections::BTreeSet<u64> = (1..=4).map(|look| seed_of_look(1, look)).collect();
        let small: std::collections::BTreeSet<u64> = seeds.iter().map(|s| s % 16).collect();
        assert_eq!((seeds.len(), small.len(), seed_of_look(7, 1)), (4, 4, 7));
    }
}
