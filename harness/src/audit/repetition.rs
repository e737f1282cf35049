//! Readings again with other seeds, of engines whose errors nobody else vouches for: do they scatter as is stated of them?
//!
//! Our own drivers state how their blocks scatter, which they have seen. A user's program says whatever it says. What it sampled is
//! read three times more at a quarter of the effort; of what it claims without any chance a random twentieth is read again, and
//! all of it where that is another value.

use super::jobs::{Found, Outcome, Running};
use super::sampling::{seed_of_look, stations_of};
use crate::engines::Job;
use crate::judge::{Comparison, Judge, LOOKS, SINGLE_PRECISION};
use crate::measure::Question;
use crate::plan::Run;
use crate::procedures::Task;
use crate::record::{
    Doubt, EngineName, Estimate, Reading, ReadingKey, Recording, StatedErrors, Uncertainty, Variation,
};
use crate::spec::Budget;
use crate::system::process;

const REPETITIONS: u32 = 3;
/// Effort of each against that of the first look.
const EFFORT: f64 = 0.25;
/// The part of what is claimed that is read again, one reading of a task at least.
const PART: f64 = 0.05;

/// What a run read again.
struct Again<'a> {
    task: &'a Task,
    was_asked: bool,
    /// Target by target, what was sampled and what was claimed to be determined and is not; `None` where it did not answer.
    sampled: Option<Vec<Vec<Estimate>>>,
    claims: Option<Vec<Vec<Estimate>>>,
}

/// Reads again, tells in the recordings what is found, and gives readings the errors that they have: by engine and procedure, of what
/// it sampled and of what it claims.
pub(super) fn examine(running: &Running<'_>, judge: &Judge<'_>, outcome: &mut Outcome) -> Found {
    let mut found = Found::new();
    for (e, planned) in running.plan.engines.iter().enumerate().filter(|(_, p)| !p.engine.is_vouched_for()) {
        let name = planned.engine.name();
        let runs = running.plan.runs.iter().filter(|run| run.engine == e);
        let all: Vec<Again<'_>> = runs.map(|run| again(running, run, &name, outcome)).collect();
        let of_engine: Variation = all.iter().filter_map(|a| a.sampled.as_deref()).map(Variation::of).sum();
        for Again { task, was_asked, sampled, claims } in all {
            // What states no error of sampling any more does not read again what did.
            let is_lost = sampled.as_deref().is_some_and(is_withdrawn);
            let doubts = [
                sampled.as_deref().and_then(|meters| StatedErrors::of_sampled(meters, &of_engine)),
                claims.as_deref().and_then(StatedErrors::of_claims),
                (was_asked && (is_lost || sampled.is_none() || claims.is_none()))
                    .then_some(StatedErrors::doubted(Doubt::NotReadAgain)),
                is_beyond_tolerance(judge, task, outcome, &name)
                    .then_some(StatedErrors::doubted(Doubt::BeyondTolerance)),
            ];
            found.insert((name.clone(), task.procedure), doubts.into_iter().flatten().collect());
        }
    }
    for recording in &mut outcome.recordings {
        let ReadingKey { engine, procedure, .. } = &recording.key;
        let Some(of_engine) = found.get(&(engine.clone(), *procedure)) else { continue };
        recording.stated_errors.clone_from(of_engine);
        recording.design_effect =
            of_engine.iter().filter(|s| s.ratio.is_some()).map(|s| s.design_effect).reduce(f64::max);
        for reading in &mut recording.readings {
            reading.uncertainty = StatedErrors::corrected(of_engine, estimate(reading)).uncertainty;
        }
    }
    found
}

fn again<'a>(running: &'a Running<'_>, run: &Run, engine: &EngineName, outcome: &Outcome) -> Again<'a> {
    let task = &running.plan.tasks[run.task];
    let mine = outcome.recordings.iter().find(|r| r.key.engine == *engine && r.key.procedure == task.procedure);
    let readings = mine.map_or(&[][..], |r| &r.readings);
    let of = |is_sampled: bool| -> Vec<usize> {
        (0..readings.len()).filter(|k| readings[*k].uncertainty.is_sampled() == is_sampled).collect()
    };
    let (of_samples, of_claims) = (of(true), rendered(running, run, of(false)));
    let sampled = repeated(running, run, readings, &of_samples, EFFORT);
    let claims = contradicted(running, run, readings, &of_claims);
    let was_asked = !(process::is_interrupted() || of_samples.is_empty() && of_claims.is_empty());
    Again { task, was_asked, sampled, claims }
}

/// Whether at most meters whose error was stated no other seed states one.
fn is_withdrawn(meters: &[Vec<Estimate>]) -> bool {
    let states = |e: &Estimate| e.uncertainty.standard_error().is_some_and(|e| e > 0.0);
    let first = |readings: &&Vec<Estimate>| readings.len() > 1 && readings.last().is_some_and(states);
    let stated: Vec<&Vec<Estimate>> = meters.iter().filter(first).collect();
    let kept = stated.iter().filter(|readings| readings[..readings.len() - 1].iter().any(states)).count();
    2 * kept < stated.len()
}

/// Whether the bounds that an engine states leave room for any reading within the tolerance and beyond, at most meters.
fn is_beyond_tolerance(judge: &Judge<'_>, task: &Task, outcome: &Outcome, engine: &EngineName) -> bool {
    let of_task: Vec<&Recording> = outcome.recordings.iter().filter(|r| r.key.procedure == task.procedure).collect();
    let compared = judge.compare(task, &of_task);
    let mine = compared.iter().filter(|c| c.key.engine == *engine);
    let is_wide =
        |c: &Comparison| c.reference.as_ref().is_some_and(|r| c.uncertainty.bound() >= c.tolerance.around(r.value));
    let wide: Vec<bool> = mine.map(is_wide).collect();
    2 * wide.iter().filter(|w| **w).count() > wide.len()
}

fn estimate(reading: &Reading) -> Estimate {
    Estimate { value: reading.value, uncertainty: reading.uncertainty }
}

/// The targets among these that were rendered: what follows from others is the spot check's to look at.
fn rendered(running: &Running<'_>, run: &Run, targets: Vec<usize>) -> Vec<usize> {
    let (task, unseen) = (&running.plan.tasks[run.task], run.shortcut.unseen(&run.job));
    targets.into_iter().filter(|k| !unseen.iter().any(|s| task.stations_of(*k).contains(s))).collect()
}

/// What is claimed to be determined, where another seed reads otherwise: every such reading, several times. Nothing where nothing is
/// claimed or contradicted, `None` where the engine does not answer again.
fn contradicted(
    running: &Running<'_>,
    run: &Run,
    readings: &[Reading],
    claimed: &[usize],
) -> Option<Vec<Vec<Estimate>>> {
    let mut drawn = claimed.to_vec();
    fastrand::Rng::with_seed(run.job.seed).shuffle(&mut drawn);
    drawn.truncate((PART * claimed.len() as f64).ceil() as usize);
    if drawn.is_empty() {
        return Some(vec![]);
    }
    let again = read(running, run, &drawn, 1, 1.0)?;
    let brightest = readings.iter().map(|r| r.value).fold(0.0, f64::max);
    let differs = |(k, now): (&usize, &Estimate)| {
        let bound = readings[*k].uncertainty.bound() + now.uncertainty.bound();
        (now.value - readings[*k].value).abs() > bound + SINGLE_PRECISION * now.value.max(brightest)
    };
    if drawn.iter().zip(&again).any(differs) { repeated(running, run, readings, claimed, 1.0) } else { Some(vec![]) }
}

/// The readings of targets with those of other seeds; `None` where the engine does not answer again.
fn repeated(
    running: &Running<'_>,
    run: &Run,
    readings: &[Reading],
    targets: &[usize],
    effort: f64,
) -> Option<Vec<Vec<Estimate>>> {
    if targets.is_empty() {
        return Some(vec![]);
    }
    let again: Vec<Vec<Estimate>> =
        (1..=REPETITIONS).filter_map(|number| read(running, run, targets, number, effort)).collect();
    let of = |(k, target): (usize, &usize)| {
        let seen = again.iter().map(|estimates| estimates[k]);
        seen.chain([estimate(&readings[*target])]).filter(|e| e.uncertainty != Uncertainty::NotSeen).collect()
    };
    (!again.is_empty()).then(|| targets.iter().enumerate().map(of).collect())
}

fn read(running: &Running<'_>, run: &Run, targets: &[usize], number: u32, effort: f64) -> Option<Vec<Estimate>> {
    let (planned, task) = (&running.plan.engines[run.engine], &running.plan.tasks[run.task]);
    let Budget { relative_error, seconds } = run.job.budget;
    let job = Job {
        stations: stations_of(run, task, targets),
        budget: Budget { relative_error: relative_error / effort.sqrt(), seconds: effort * seconds },
        // Beyond those of all looks.
        seed: seed_of_look(run.job.seed, LOOKS + number),
        ..run.job.clone()
    };
    let folder = format!("{}/repetition-{number}", task.procedure);
    let taken = running.reader.read(&Question::new(&planned.instrument()?, &job, &folder));
    let taken = taken.inspect_err(|error| tracing::warn!("{}: not read again: {error}", planned.engine.name())).ok()?;
    Some(taken.measurement.readings(targets.iter().map(|k| &task.targets[*k])))
}
