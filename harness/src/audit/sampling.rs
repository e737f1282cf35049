//! Sampling until comparisons are decided: which budget first looks get, and further looks through the run's reader.

use std::collections::BTreeSet;

use super::jobs::{self, Found, Outcome, Running};
use super::sequential::{self, Ask};
use crate::engines::{Job, Station};
use crate::judge::{Judge, Sampling};
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
        let relative = |engine: EngineName| judge.tolerance(&plan.tasks[run.task], engine.as_str()).relative;
        let subjects = engines().filter(|engine| !engine.is_witness()).map(|engine| relative(engine.name()));
        // Where nobody is judged, what would be.
        subjects.chain([relative(EngineName::from("subject"))]).fold(f64::INFINITY, f64::min)
    };
    let wide: Vec<f64> = plan.runs.iter().map(tolerance).collect();
    for (run, tolerance) in plan.runs.iter_mut().zip(wide) {
        let engine = &plan.engines[run.engine].engine;
        if engine.is_witness() && engine.samples(&run.job) {
            let relative_error = run.job.budget.relative_error.max(tolerance);
            run.job.budget.relative_error = relative_error;
            run.shortcut.job.budget.relative_error = relative_error;
        }
    }
    if sampling == Sampling::Accurate {
        return;
    }
    for run in &mut plan.runs {
        let engine = &plan.engines[run.engine].engine;
        // A program of a user's is judged at the budget that the spec gives: who knows what it makes of another.
        if !engine.is_witness() && engine.is_vouched_for() {
            let tolerance = judge.tolerance(&plan.tasks[run.task], engine.name().as_str());
            run.job.budget = sequential::first_look(run.job.budget, tolerance.relative);
            run.shortcut.job.budget = run.job.budget;
        }
    }
}

/// How much finer a sampled reference is asked again where its own error leaves a comparison undecided: to a tenth of the tolerance, after
/// the quarter of its first look, so that it adds half a percent to a combined uncertainty (JCGM 100:2008, 5.1.2).
const FINER: f64 = 0.4;

/// Takes further looks wherever a comparison is undecided; the observer hears of each.
///
/// References come first, since no sample of a subject makes up for what its reference does not know, and last, where
/// what subjects were sampled to lies closer to the tolerance than their first looks did.
pub(super) fn sample_on(
    running: &Running<'_>,
    judge: &Judge<'_>,
    stated: &Found,
    outcome: &mut Outcome,
) -> Result<(), FileError> {
    let mut refined = BTreeSet::new();
    refine_references(running, judge, outcome, &mut refined)?;
    sample_subjects(running, judge, stated, outcome)?;
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
        let mut targets = sequential::undecided_by_reference(judge, task, &of_task);
        targets.retain(|k| refined.insert((index, *k)));
        let mine = outcome.recordings.iter().position(|r| r.key.engine == engine && r.key.procedure == task.procedure);
        let Some(mine) = mine.filter(|_| !targets.is_empty()) else { continue };
        let relative_error = FINER * run.job.budget.relative_error;
        let ask = Ask { look: 2, targets, budget: Budget { relative_error, ..run.job.budget } };
        let recording = &mut outcome.recordings[mine];
        match look(running, run, &ask) {
            Ok(taken) => {
                outcome.from_cache += usize::from(taken.source == Source::Cache);
                recording.wall_s += taken.cost.wall_s;
                let estimates = taken.measurement.readings(ask.targets.iter().map(|k| &task.targets[*k]));
                for (k, estimate) in ask.targets.iter().zip(estimates) {
                    let reading = &mut recording.readings[*k];
                    if estimate.uncertainty.standard() < reading.uncertainty.standard() {
                        (reading.value, reading.uncertainty) = (estimate.value, estimate.uncertainty);
                    }
                }
                let count = ask.targets.len();
                recording
                    .notes
                    .push(format!("read more finely at {count} meters, whose comparisons it left undecided"));
                if let Some(status) = outcome.engines.iter_mut().find(|e| e.id == engine) {
                    status.wall_s += taken.cost.wall_s;
                }
            }
            Err(why) => {
                recording.notes.push(format!("reading {} meters more finely gave nothing: {why}", ask.targets.len()));
            }
        }
        jobs::keep(running.folder, &engine, &outcome.recordings)?;
    }
    Ok(())
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
        jobs::keep(running.folder, &engine, &outcome.recordings)?;
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
    running.reader.read(&Question::new(&instrument, &further, &place)).map_err(|e| e.to_string())
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

    #[test]
    fn every_look_has_a_seed_of_its_own() {
        let seeds: std::collections::BTreeSet<u64> = (1..=4).map(|look| seed_of_look(1, look)).collect();
        let small: std::collections::BTreeSet<u64> = seeds.iter().map(|s| s % 16).collect();
        assert_eq!((seeds.len(), small.len(), seed_of_look(7, 1)), (4, 4, 7));
    }
}
