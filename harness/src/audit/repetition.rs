//! Readings again with other seeds, of engines whose errors nobody else vouches for: do they scatter as is stated of them?
//!
//! Our own drivers state how their blocks scatter, which they have seen. A user's program says whatever it says. What it sampled is
//! read three times more at a quarter of the effort; of what it claims without any chance a random twentieth is read again, and
//! all of it where that is another value.

use std::collections::BTreeMap;
use std::ops::RangeInclusive;

use super::jobs::{Found, Outcome, Running};
use super::sampling::{seed_of_look, stations_of};
use crate::engines::{Job, Measurement};
use crate::judge::{Comparison, Judge, LOOKS, SINGLE_PRECISION, Source, Verdict};
use crate::measure::{Failure, Question};
use crate::plan::{Fill, Run};
use crate::procedures::Task;
use crate::record::{
    Doubt, EngineName, Estimate, FailureKind, MeterId, Reading, ReadingKey, Recording, Sheltered, StatedErrors, Tails,
    Uncertainty, Variation,
};
use crate::spec::Budget;
use crate::system::process;

const REPETITIONS: RangeInclusive<u32> = 1..=3;
/// Those that follow where a stated error alone keeps a reading from failing.
const FURTHER: RangeInclusive<u32> = 4..=6;
/// Effort of each against that of the first look.
const EFFORT: f64 = 0.25;
/// The part of what is claimed that is read again, one reading of a task at least.
const PART: f64 = 0.05;
/// An error that nobody could check counts up to this part of the tolerance, and up to what was asked for: with it, what lies twice as far
/// off as is allowed fails.
const UNCHECKED: f64 = 0.5;

/// Standard uncertainties that hold nearly all of an error.
const NEARLY_ALL: f64 = 3.0;

/// What a run read again.
struct Again<'a> {
    run: &'a Run,
    task: &'a Task,
    engine: EngineName,
    was_asked: bool,
    /// Whether everything was rendered, whatever the plan's shortcut.
    is_whole: bool,
    /// The targets that were sampled.
    targets: Vec<usize>,
    /// Those of claims without chance.
    claimed: Vec<usize>,
    /// Target by target, what was sampled and what was claimed to be determined and is not; `None` where it did not answer.
    sampled: Option<Vec<Vec<Estimate>>>,
    claims: Option<Vec<Vec<Estimate>>>,
}

/// What was found of stated errors, and what it was found by.
#[derive(Default)]
pub(super) struct Examination<'a> {
    pub(super) found: Found,
    /// With the tails that all shows that its engine read again.
    again: Vec<(Again<'a>, Tails)>,
}

/// Reads again, tells in the recordings what is found, and gives readings the errors that they have: by engine and procedure, of what
/// it sampled and of what it claims.
pub(super) fn examine<'a>(running: &'a Running<'_>, judge: &Judge<'_>, outcome: &mut Outcome) -> Examination<'a> {
    let mut examination = Examination::default();
    for (e, planned) in running.plan.engines.iter().enumerate().filter(|(_, p)| !p.engine.is_vouched_for()) {
        let name = planned.engine.name();
        let runs = running.plan.runs.iter().filter(|run| run.engine == e);
        let all: Vec<Again<'_>> = runs.map(|run| again(running, run, &name, outcome)).collect();
        let of_engine: Variation = all.iter().filter_map(Again::rendered).map(|meters| Variation::of(&meters)).sum();
        let scatters = |again: &Again<'_>| again.rendered().into_iter().chain(again.claims.clone()).flatten().collect();
        let of_all: Vec<Vec<Estimate>> = all.iter().flat_map(|again| -> Vec<_> { scatters(again) }).collect();
        let tails = Tails::of(&of_all);
        let of_tails = StatedErrors::of_tails(&of_all, tails);
        for again in &all {
            let compared = |found: &[StatedErrors]| again.compared(judge, outcome, Some(found));
            let mut doubts = again.doubts(&of_engine, &compared(&[]));
            doubts.extend(of_tails.clone());
            let now = compared(&doubts);
            doubts.extend(refuted(&now));
            doubts.extend(again.of_sheltered(running, &now, tails));
            examination.found.insert((name.clone(), again.task.procedure), doubts);
        }
        examination.again.extend(all.into_iter().map(|again| (again, tails)));
    }
    for recording in &mut outcome.recordings {
        let ReadingKey { engine, procedure, .. } = &recording.key;
        let Some(of_engine) = examination.found.get(&(engine.clone(), *procedure)) else { continue };
        correct(recording, of_engine);
    }
    examination
}

impl Examination<'_> {
    /// The same where further looks left nothing but what they state between readings and a verdict.
    pub(super) fn examine_looks(&self, running: &Running<'_>, judge: &Judge<'_>, outcome: &mut Outcome) {
        for (again, tails) in &self.again {
            let now = again.compared(judge, outcome, None);
            let doubts = [beyond_tolerance(&now), refuted(&now)].into_iter().flatten();
            let doubts: Vec<StatedErrors> = doubts.chain(again.of_sheltered(running, &now, *tails)).collect();
            let is_mine = |r: &&mut Recording| r.key.engine == again.engine && r.key.procedure == again.task.procedure;
            for recording in outcome.recordings.iter_mut().filter(is_mine) {
                apply(recording, &doubts);
                recording.stated_errors.extend(doubts.iter().cloned());
            }
        }
    }
}

impl Again<'_> {
    /// What was sampled at meters that were rendered: what mirrors them tells nothing more of it.
    fn rendered(&self) -> Option<Vec<Vec<Estimate>>> {
        let is_rendered = |k: usize| {
            let stations = &self.run.shortcut.fill[self.task.stations_of(k)];
            self.is_whole || stations.iter().any(|fill| matches!(fill, Fill::Rendered(_)))
        };
        let meters = self.targets.iter().zip(self.sampled.as_ref()?).filter(|(k, _)| is_rendered(**k));
        Some(meters.map(|(_, readings)| readings.clone()).collect())
    }

    /// The readings of sampled targets with their meters.
    fn named(&self, meters: &[Vec<Estimate>]) -> Vec<(MeterId, Vec<Estimate>)> {
        let id = |k: &usize| self.task.targets[*k].id.clone();
        self.targets.iter().map(id).zip(meters.iter().cloned()).collect()
    }

    fn doubts(&self, of_engine: &Variation, compared: &[Comparison]) -> Vec<StatedErrors> {
        let (sampled, rendered) = (self.sampled.as_deref(), self.rendered());
        let of_sampled = rendered.as_deref().and_then(|meters| StatedErrors::of_sampled(meters, of_engine));
        let falls_with_effort = rendered.as_deref().and_then(falls_with_effort);
        // What states no error of sampling any more does not read again what did.
        let is_refused = sampled.is_none_or(is_withdrawn);
        let unchecked = || {
            let at = limits(compared, |c, allowed| c.uncertainty.is_sampled().then(|| self.unchecked(c, allowed)));
            StatedErrors::doubted_at(Doubt::NotReadAgain, at)
        };
        // Samples that meet nothing with other seeds state nothing either: they scatter, and are not capped.
        let is_steady = sampled.is_none_or(|meters| meters.iter().all(|readings| is_same(readings)));
        let not_read_again = if is_refused && is_steady { unchecked() } else { None };
        [
            of_sampled.map(|found| StatedErrors { falls_with_effort, ..found }),
            self.claims.as_deref().and_then(StatedErrors::of_claims),
            sampled.and_then(|meters| StatedErrors::of_unstated(&self.named(meters))),
            (self.was_asked && (is_refused || self.claims.is_none()))
                .then(|| not_read_again.unwrap_or_else(|| StatedErrors::doubted(Doubt::NotReadAgain))),
            beyond_tolerance(compared),
        ]
        .into_iter()
        .flatten()
        .collect()
    }

    /// What an error counts that nobody could check.
    fn unchecked(&self, comparison: &Comparison, allowed: f64) -> f64 {
        let asked = self.run.job.budget.relative_error * comparison.value.unwrap_or(0.0).abs();
        asked.min(UNCHECKED * allowed)
    }

    /// Where nothing but a stated error keeps readings from failing, all that was sampled is read again: how do those meters, by themselves,
    /// scatter?
    fn of_sheltered(&self, running: &Running<'_>, now: &[Comparison], tails: Tails) -> Vec<StatedErrors> {
        let is_beyond = |c: &Comparison, allowed: f64| c.deviation.is_some_and(|d| d.abs() > allowed);
        let is_kept = |c: &Comparison| c.verdict == Verdict::Inconclusive && c.uncertainty.is_sampled();
        let at = limits(now, |c, allowed| (is_kept(c) && is_beyond(c, allowed)).then(|| self.unchecked(c, allowed)));
        let is_sheltered = |k: usize| at.contains_key(&self.task.targets[k].id);
        let (run, is_whole) = (self.run, self.is_whole);
        let kinds = [(&self.targets, &self.sampled, true), (&self.claimed, &self.claims, false)];
        let mut meters = vec![];
        for (targets, read, is_sampled) in kinds {
            let Some(read) = read.as_ref().filter(|read| !read.is_empty()) else { continue };
            if process::is_interrupted() || !targets.iter().any(|k| is_sheltered(*k)) {
                continue;
            }
            let ask = |number| {
                if is_sampled {
                    sampled(running, run, is_whole, targets, number)
                } else {
                    claimed_again(running, run, targets, number)
                }
            };
            let further: Vec<Vec<Estimate>> = FURTHER.filter_map(ask).collect();
            if further.is_empty() {
                return StatedErrors::doubted_at(Doubt::NotReadAgain, at).into_iter().collect();
            }
            for (n, (k, read)) in targets.iter().zip(read).enumerate().filter(|(_, (k, _))| is_sheltered(**k)) {
                let meter = self.task.targets[*k].id.clone();
                let readings: Vec<Estimate> = read.iter().copied().chain(further.iter().map(|all| all[n])).collect();
                meters.push(Sheltered { counts: counts(now, &meter), meter, readings });
            }
        }
        StatedErrors::of_sheltered(&meters, tails)
    }

    /// How the engine's readings of the task compare, were this found of what it states; `None`: as they are.
    fn compared(&self, judge: &Judge<'_>, outcome: &Outcome, found: Option<&[StatedErrors]>) -> Vec<Comparison> {
        let of_task = outcome.recordings.iter().filter(|r| r.key.procedure == self.task.procedure);
        let (mine, others): (Vec<_>, Vec<_>) = of_task.partition(|r| r.key.engine == self.engine);
        let compared = mine.into_iter().map(|mine| {
            let mut mine = mine.clone();
            if let Some(found) = found {
                correct(&mut mine, found);
            }
            judge.compare_one(self.task, &mine, &others)
        });
        compared.flatten().collect()
    }
}

/// The relative standard error that counts at a meter; nothing where no sample met anything.
fn counts(compared: &[Comparison], meter: &MeterId) -> Option<f64> {
    let here = compared.iter().find(|c| c.meter == *meter)?;
    Some(here.uncertainty.standard_error()? / here.value?.abs()).filter(|relative| relative.is_finite())
}

fn again<'a>(running: &'a Running<'_>, run: &'a Run, engine: &EngineName, outcome: &Outcome) -> Again<'a> {
    let task = &running.plan.tasks[run.task];
    let mine = outcome.recordings.iter().find(|r| r.key.engine == *engine && r.key.procedure == task.procedure);
    let readings = mine.filter(|r| r.failure.is_none()).map_or(&[][..], |r| &r.readings);
    let of = |is_sampled: bool| -> Vec<usize> {
        (0..readings.len()).filter(|k| readings[*k].uncertainty.is_sampled() == is_sampled).collect()
    };
    let (targets, of_claims) = (of(true), rendered(running, run, of(false)));
    let is_whole =
        run.shortcut.job.stations.is_empty() || outcome.contradicted.contains(&(engine.clone(), task.procedure));
    let sampled = repeated(readings, &targets, |number| sampled(running, run, is_whole, &targets, number));
    let claims = contradicted(running, run, readings, &of_claims);
    let was_asked = !(process::is_interrupted() || targets.is_empty() && of_claims.is_empty());
    Again { run, task, engine: engine.clone(), was_asked, is_whole, targets, claimed: of_claims, sampled, claims }
}

/// Tells in a recording what is found of it, and gives its readings the errors that they have.
fn correct(recording: &mut Recording, found: &[StatedErrors]) {
    recording.stated_errors = found.to_vec();
    recording.design_effect = found.iter().filter(|s| s.ratio.is_some()).map(|s| s.design_effect).reduce(f64::max);
    apply(recording, found);
}

/// Gives readings the errors that they have by what is found.
fn apply(recording: &mut Recording, found: &[StatedErrors]) {
    for reading in &mut recording.readings {
        reading.uncertainty = StatedErrors::corrected(found, &reading.meter, estimate(reading)).uncertainty;
    }
}

/// By meter, over its readings, the least error that this makes of a comparison and what is allowed there.
fn limits(compared: &[Comparison], error: impl Fn(&Comparison, f64) -> Option<f64>) -> BTreeMap<MeterId, f64> {
    let mut at = BTreeMap::new();
    for c in compared {
        let (Some(value), Some(reference)) = (c.value, &c.reference) else { continue };
        let Some(error) = error(c, c.tolerance.around(reference.value)) else { continue };
        let relative = if value == 0.0 { 0.0 } else { error / value.abs() };
        at.entry(c.meter.clone()).and_modify(|least: &mut f64| *least = least.min(relative)).or_insert(relative);
    }
    at
}

/// How errors that are stated for this part of the effort are larger than those for all of it: 1 by its square root, 0 not at all.
fn falls_with_effort(meters: &[Vec<Estimate>]) -> Option<f64> {
    let log = |e: &Estimate| e.uncertainty.standard_error().filter(|e| *e > 0.0).map(|e| 2.0 * e.ln());
    let of_meter = |readings: &Vec<Estimate>| {
        let (first, others) = readings.split_last()?;
        let others: Vec<f64> = others.iter().filter_map(log).collect();
        Some(others.iter().sum::<f64>() / others.len() as f64 - log(first)?).filter(|more| more.is_finite())
    };
    let more: Vec<f64> = meters.iter().filter_map(of_meter).collect();
    (!more.is_empty()).then(|| more.iter().sum::<f64>() / more.len() as f64 / EFFORT.recip().ln())
}

/// Whether readings of other seeds are one but for rounding.
fn is_same(readings: &[Estimate]) -> bool {
    let values = || readings.iter().map(|e| e.value);
    let (low, high) = (values().fold(f64::INFINITY, f64::min), values().fold(f64::NEG_INFINITY, f64::max));
    high - low <= SINGLE_PRECISION * high.abs()
}

/// Whether at most meters whose error was stated no other seed states one.
fn is_withdrawn(meters: &[Vec<Estimate>]) -> bool {
    let states = |e: &Estimate| e.uncertainty.standard_error().is_some_and(|e| e > 0.0);
    let first = |readings: &&Vec<Estimate>| readings.len() > 1 && readings.last().is_some_and(states);
    let stated: Vec<&Vec<Estimate>> = meters.iter().filter(first).collect();
    let kept = stated.iter().filter(|readings| readings[..readings.len() - 1].iter().any(states)).count();
    2 * kept < stated.len()
}

/// Where the bounds that an engine states leave room for any reading within the tolerance and beyond: there none counts.
fn beyond_tolerance(compared: &[Comparison]) -> Option<StatedErrors> {
    let brightest = compared.iter().filter_map(|c| c.value).fold(0.0, f64::max);
    let at = limits(compared, |c, allowed| {
        let bound = c.uncertainty.bound();
        (bound >= allowed && bound > SINGLE_PRECISION * brightest).then_some(0.0)
    });
    StatedErrors::doubted_at(Doubt::BeyondTolerance, at)
}

/// Where bounds that an engine states keep readings from failing that lie beyond the tolerance, and farther off than the bounds and everything
/// else explain: a claim that does not hold shelters nothing.
fn refuted(compared: &[Comparison]) -> Option<StatedErrors> {
    let at = limits(compared, |c, allowed| {
        let (bound, deviation, budget) = (c.uncertainty.bound(), c.deviation?.abs(), c.budget.as_ref()?);
        let others = budget.components.iter().filter(|part| part.source != Source::Discretisation);
        let others = others.map(|part| part.uncertainty.powi(2)).sum::<f64>().sqrt();
        let reach = bound.max(allowed) + budget.coverage_factor.max(NEARLY_ALL) * others;
        let is_sheltered = c.verdict == Verdict::Inconclusive && bound > 0.0 && bound < allowed;
        (is_sheltered && deviation > reach).then_some(0.0)
    });
    StatedErrors::doubted_at(Doubt::Refuted, at)
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
    let again = claimed_again(running, run, &drawn, 1)?;
    let brightest = readings.iter().map(|r| r.value).fold(0.0, f64::max);
    let differs = |(k, now): (&usize, &Estimate)| {
        let bound = readings[*k].uncertainty.bound() + now.uncertainty.bound();
        (now.value - readings[*k].value).abs() > bound + SINGLE_PRECISION * now.value.max(brightest)
    };
    if drawn.iter().zip(&again).any(differs) {
        let mut all = repeated(readings, claimed, |number| claimed_again(running, run, claimed, number))?;
        for seen in &mut all {
            seen.retain(|e| e.uncertainty != Uncertainty::NotSeen);
        }
        Some(all)
    } else {
        Some(vec![])
    }
}

/// The readings of targets with those of other seeds; `None` where the engine does not answer again.
fn repeated(
    readings: &[Reading],
    targets: &[usize],
    ask: impl Fn(u32) -> Option<Vec<Estimate>>,
) -> Option<Vec<Vec<Estimate>>> {
    if targets.is_empty() {
        return Some(vec![]);
    }
    let again: Vec<Vec<Estimate>> = REPETITIONS.filter_map(ask).collect();
    let of = |(k, target): (usize, &usize)| {
        let seen = again.iter().map(|estimates| estimates[k]);
        seen.chain([estimate(&readings[*target])]).collect()
    };
    (!again.is_empty()).then(|| targets.iter().enumerate().map(of).collect())
}

/// What was sampled, by the very job that was: what depends on which meters are asked does so again.
fn sampled(running: &Running<'_>, run: &Run, is_whole: bool, targets: &[usize], number: u32) -> Option<Vec<Estimate>> {
    let task = &running.plan.tasks[run.task];
    let asked = if is_whole { &run.job } else { &run.shortcut.job };
    let taken = answer(running, run, asked.clone(), number, EFFORT)?;
    let whole = if is_whole { taken } else { run.shortcut.complete(taken, &run.job) };
    let all = whole.readings(&task.targets);
    Some(targets.iter().map(|k| all[*k]).collect())
}

fn claimed_again(running: &Running<'_>, run: &Run, targets: &[usize], number: u32) -> Option<Vec<Estimate>> {
    let task = &running.plan.tasks[run.task];
    let job = Job { stations: stations_of(run, task, targets), ..run.job.clone() };
    let taken = answer(running, run, job, number, 1.0)?;
    Some(taken.readings(targets.iter().map(|k| &task.targets[*k])))
}

/// An engine's answer to a job with a seed of its own and this part of the effort.
fn answer(running: &Running<'_>, run: &Run, job: Job, number: u32, effort: f64) -> Option<Measurement> {
    let (planned, task) = (&running.plan.engines[run.engine], &running.plan.tasks[run.task]);
    let Budget { relative_error, seconds } = job.budget;
    let job = Job {
        budget: Budget { relative_error: relative_error / effort.sqrt(), seconds: effort * seconds },
        // Beyond those of all looks.
        seed: seed_of_look(job.seed, LOOKS + number),
        ..job
    };
    let folder = format!("{}/repetition-{number}", task.procedure);
    let taken = running.reader.read(&Question::new(&planned.instrument()?, &job, &folder));
    let told = |error: &Failure| {
        if error.kind != FailureKind::Unread {
            tracing::warn!("{}: not read again: {error}", planned.engine.name());
        }
    };
    let taken = taken.inspect_err(told).ok()?;
    Some(taken.measurement)
}
