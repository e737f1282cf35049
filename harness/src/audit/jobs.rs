//! Runs a plan: one reading a job, readings kept on disk as each job finishes, one engine's failure stops no other.

use std::collections::{BTreeMap, BTreeSet};
use std::ops::Add;
use std::path::Path;

use std::time::{Duration, Instant};

use super::observer::Observer;
use itertools::Itertools;
use parking_lot::Mutex;

use crate::engines::{EngineError, Measurement, Waits};
use crate::measure::{Cost, Failure, Question, Reader, Source, Taken};
use crate::plan::{Asked, Plan, Planned, Run, Scope, Skip};
use crate::record::{
    EngineName, EngineStatus, FailureKind, ProcedureId, Reading, ReadingKey, Recording, StatedErrors, Status,
};
use crate::spec::{Case, SHORTEST_PATIENCE, content};
use crate::system::files::{self, FileError};
use crate::system::slots::side_by_side;

/// Jobs that sleep side by side at most, beside those that compute.
const MAX_SLEEPING: usize = 8;

pub struct Running<'a> {
    pub case: &'a Case,
    pub plan: &'a Plan,
    /// The folder of the case's files, which is the reader's, too; `None`: nothing stays but what the cache keeps.
    pub folder: Option<&'a Path>,
    /// Who takes readings; cases that run side by side share its machine.
    pub reader: Reader,
    pub observer: &'a dyn Observer,
}

/// What is found of what an engine states of its errors in a procedure.
pub(super) type Found = BTreeMap<(EngineName, ProcedureId), Vec<StatedErrors>>;

/// What a run gave.
#[derive(Clone, Debug)]
pub struct Outcome {
    /// One a run of the plan, failures included, in the plan's order.
    pub recordings: Vec<Recording>,
    /// One an engine of the plan, in its order.
    pub engines: Vec<EngineStatus>,
    /// What an engine declined once it had seen the job.
    pub skips: Vec<Skip>,
    /// Where a spot check contradicted what was to follow from other readings, so that nothing of the run was left out.
    pub contradicted: BTreeSet<(EngineName, ProcedureId)>,
    /// How many answers of engines came out of the cache.
    pub from_cache: usize,
}

enum Done {
    Recorded { recording: Box<Recording>, source: Option<Source>, was_contradicted: bool },
    Declined(Skip),
}

impl Running<'_> {
    /// Runs every job of the plan, as many side by side as the machine has room for; what it gives is in the plan's order, whoever ends first.
    pub fn run(&self) -> Result<Outcome, FileError> {
        let count = |waits| self.plan.runs.iter().filter(|run| self.waits(run) == waits).count();
        let slots = self.reader.machine.slots.threads();
        let sleeping = count(Waits::Mostly).min(MAX_SLEEPING) + count(Waits::Often).div_ceil(2).min(slots);
        let threads = slots + sleeping;
        // By place in the plan.
        let kept: Mutex<BTreeMap<usize, Recording>> = Mutex::default();
        let one = |places: &Vec<usize>| -> Result<Vec<(usize, Done)>, FileError> {
            let runs: Vec<&Run> = places.iter().map(|k| &self.plan.runs[*k]).collect();
            let done: Vec<(usize, Done)> = places.iter().copied().zip(self.measure(&runs)).collect();
            for (k, done) in &done {
                let Done::Recorded { recording, .. } = done else { continue };
                let mut kept = kept.lock();
                kept.insert(*k, (**recording).clone());
                // Written as each job finishes, so that an interruption loses only what was under way.
                self.keep(&recording.key.engine, kept.values())?;
            }
            Ok(done)
        };
        let (mut recordings, mut skips, mut from_cache, mut contradicted) = (vec![], vec![], 0, BTreeSet::new());
        let mut all = vec![];
        for done in side_by_side(threads, &self.together(), one) {
            all.extend(done?);
        }
        all.sort_by_key(|(place, _)| *place);
        for (_, done) in all {
            match done {
                Done::Recorded { recording, source, was_contradicted } => {
                    from_cache += usize::from(source == Some(Source::Cache));
                    let ReadingKey { engine, procedure, .. } = &recording.key;
                    contradicted.extend(was_contradicted.then(|| (engine.clone(), *procedure)));
                    recordings.push(*recording);
                }
                Done::Declined(skip) => skips.push(skip),
            }
        }
        let engines = self.plan.engines.iter().map(|planned| status(planned, &recordings)).collect();
        Ok(Outcome { recordings, engines, skips, contradicted, from_cache })
    }

    /// Writes the file of an engine's readings, those among all that are its own, where files stay.
    pub(super) fn keep<'r>(
        &self,
        engine: &EngineName,
        all: impl IntoIterator<Item = &'r Recording>,
    ) -> Result<(), FileError> {
        let Some(folder) = self.folder else { return Ok(()) };
        let mine: Vec<&Recording> = all.into_iter().filter(|r| r.key.engine == *engine).collect();
        files::keep_json(&folder.join("readings").join(format!("{engine}.json")), &mine)
    }

    fn waits(&self, run: &Run) -> Waits {
        self.plan.engines[run.engine].engine.waits(&run.job)
    }

    /// The runs of the plan by place, as they are begun: alone, or those of an engine that takes several at once.
    fn together(&self) -> Vec<Vec<usize>> {
        let mut units: Vec<Vec<usize>> = vec![];
        for (k, run) in self.plan.runs.iter().enumerate() {
            let is_mate = |unit: &&mut Vec<usize>| self.plan.runs[unit[0]].engine == run.engine;
            match units.iter_mut().find(is_mate).filter(|_| self.plan.engines[run.engine].engine.takes_batches()) {
                Some(unit) => unit.push(k),
                None => units.push(vec![k]),
            }
        }
        units.sort_by_key(|unit| self.waits(&self.plan.runs[unit[0]]));
        units
    }

    /// Runs of the plan, of one engine: the one place where a recording is made of what engines answer.
    fn measure(&self, runs: &[&Run]) -> Vec<Done> {
        let of = |run: &Run| (&self.plan.engines[run.engine], self.plan.tasks[run.task].procedure);
        for run in runs {
            let (planned, procedure) = of(run);
            self.observer.started(self.case, planned.engine.as_ref(), procedure.name());
        }
        let start = Instant::now();
        let answers = match runs {
            [run] => vec![answer(of(run).0, run, &self.reader, of(run).1.name())],
            _ => self.answers(runs),
        };
        runs.iter().zip(answers).map(|(run, answer)| self.done(run, answer, start)).collect()
    }

    /// What an engine answers that takes several jobs at once, and no shortcut.
    fn answers(&self, runs: &[&Run]) -> Vec<Result<Answer, Failure>> {
        let Some(instrument) = runs.first().and_then(|run| self.plan.engines[run.engine].instrument()) else {
            return vec![];
        };
        let folder = |run: &Run| self.plan.tasks[run.task].procedure.name();
        let questions: Vec<Question<'_>> =
            runs.iter().map(|run| Question::new(&instrument, &run.job, folder(run))).collect();
        let taken = self.reader.read_all(&questions).into_iter();
        taken.map(|taken| taken.map(|taken| Answer { taken, was_contradicted: false })).collect()
    }

    fn done(&self, run: &Run, answer: Result<Answer, Failure>, start: Instant) -> Done {
        let (planned, task) = (&self.plan.engines[run.engine], &self.plan.tasks[run.task]);
        let engine = planned.engine.as_ref();
        let (taken, was_contradicted) = match answer {
            Ok(Answer { taken, was_contradicted }) => (Ok(taken), was_contradicted),
            Err(failure) => (Err(failure), false),
        };
        if let Err(Failure { kind: FailureKind::Declined, text: why, .. }) = &taken {
            self.observer.ended(self.case, engine, task.procedure, start.elapsed(), None);
            let reason = format!("it declines: {why}");
            return Done::Declined(Skip::of(self.case, task, engine.name(), Scope::Procedure, reason));
        }
        let source = taken.as_ref().ok().map(|taken| taken.source);
        let recording = self.record(run, taken, start.elapsed());
        let wall = Duration::try_from_secs_f64(recording.wall_s).unwrap_or_default();
        self.observer.ended(self.case, engine, task.procedure, wall, recording.failure.as_deref());
        Done::Recorded { recording: Box::new(recording), source, was_contradicted }
    }

    fn record(&self, run: &Run, taken: Result<Taken, Failure>, wall: Duration) -> Recording {
        let (planned, task) = (&self.plan.engines[run.engine], &self.plan.tasks[run.task]);
        let engine = planned.engine.name();
        let failure_kind = taken.as_ref().err().map(|failure| failure.kind);
        let (measurement, wall_s, failure) = match taken {
            Ok(taken) => (taken.measurement, taken.cost.wall_s, None),
            Err(error) => {
                if error.kind != FailureKind::Unread {
                    tracing::error!(%engine, procedure = %task.procedure, "{error}");
                }
                (error.rest.map_or_else(Measurement::default, |rest| *rest), wall.as_secs_f64(), Some(error.text))
            }
        };
        let was_read = failure.is_none() || !measurement.estimates.is_empty();
        let estimates = if was_read { measurement.readings(&task.targets) } else { vec![] };
        let readings = estimates.iter().zip(&task.targets).map(|(estimate, target)| Reading {
            meter: target.id.clone(),
            quantity: task.quantity,
            value: estimate.value,
            uncertainty: estimate.uncertainty,
        });
        // Where a failed engine lost single meters.
        let readings = readings.filter(|reading| failure.is_none() || reading.value.is_finite());
        Recording {
            version: planned.version().unwrap_or_default(),
            model: task.model(),
            input_sha256: self.case.sha256.clone(),
            content_sha256: content(task),
            seed: run.job.seed,
            skewness: measurement.skewness(),
            design_effect: measurement.design_effect(),
            work_s: measurement.work_s,
            method: measurement.method,
            effort: measurement.effort,
            role: planned.engine.role(),
            approximation: run.approximation.clone(),
            declared_error: Some(run.declared).filter(|error| *error > 0.0),
            notes: measurement.notes,
            wall_s,
            components: planned.engine.components(&run.job),
            command: planned.engine.command_by_hand(&run.job, &self.reader.site),
            readings: readings.collect(),
            failure,
            failure_kind,
            ..Recording::of(ReadingKey::new(&self.case.name, task.procedure, engine), task.light())
        }
    }
}

struct Answer {
    taken: Taken,
    was_contradicted: bool,
}

/// What an engine answers to a run: it renders what the shortcut leaves, and the rest follows. Where its spot check contradicts that, it
/// renders everything.
fn answer(planned: &Planned, run: &Run, reader: &Reader, folder: &str) -> Result<Answer, Failure> {
    let failed = |what: String| Failure::from(EngineError::Solver { engine: planned.engine.name(), what });
    let instrument = planned.instrument().ok_or_else(|| failed("it is not there".to_owned()))?;
    let (shortcut, spot_check) = (&run.shortcut, format!("{folder}-spot-check"));
    let [patience, patience_of_spot_check] = run.patience();
    let rendered = if shortcut.job.stations.is_empty() {
        Taken { measurement: Measurement::default(), cost: Cost::default(), source: Source::Nobody }
    } else {
        let question = Question { may_join: true, patience, ..Question::new(&instrument, &shortcut.job, folder) };
        let read = reader.read(&question);
        if let (Err(Failure { kind: FailureKind::Unread, .. }), Some(job)) = (&read, run.spot_check_job()) {
            // Whoever takes the one may take the other beside it.
            reader.read(&Question::new(&instrument, &job, &spot_check)).ok();
        }
        read.map_err(|failure| failure.with_rest(|rest| Some(shortcut.complete(rest, &run.job))))?
    };
    let mut taken = Taken { measurement: shortcut.complete(rendered.measurement, &run.job), ..rendered };
    if let Some(job) = run.spot_check_job() {
        let question = Question::new(&instrument, &job, &spot_check);
        let seen = reader.read(&Question { patience: patience_of_spot_check, ..question });
        let seen = seen.map_err(|failure| failure.with_rest(|_| None))?;
        if let Err(contradiction) = run.hold(&taken.measurement, &seen.measurement) {
            let name = planned.engine.name();
            tracing::warn!("{name}: {contradiction}");
            let spent_s = taken.cost.wall_s + seen.cost.wall_s;
            let question = Question::new(&instrument, &run.job, folder);
            let patience = question.patience.saturating_sub(Duration::try_from_secs_f64(spent_s).unwrap_or_default());
            let mut whole = reader.read(&Question { patience: patience.max(SHORTEST_PATIENCE), ..question })?;
            whole.cost.wall_s += spent_s;
            whole.measurement.notes.push(contradiction);
            return Ok(Answer { taken: whole, was_contradicted: true });
        }
        taken.cost.wall_s += seen.cost.wall_s;
        let work_s = [taken.measurement.work_s, seen.measurement.work_s];
        taken.measurement.work_s = work_s.into_iter().flatten().reduce(f64::add);
        // What was rendered stands; samples of another job do not tell how it varies with the rest.
        taken.measurement.forget_samples();
        for (&station, estimate) in run.spot_check.iter().zip(seen.measurement.estimates) {
            taken.measurement.estimates[station] = estimate;
        }
        let names = job.stations.iter().map(|s| s.id.to_string()).join(", ");
        let Measurement { notes, effort, .. } = &mut taken.measurement;
        let told: Vec<String> = seen.measurement.notes.into_iter().filter(|note| !notes.contains(note)).collect();
        notes.extend(told.iter().map(|note| format!("spot check of {names}: {note}")));
        effort.extend(seen.measurement.effort.iter().map(|(key, value)| (format!("spot_check_{key}"), value.clone())));
        effort.insert("spot_checked".to_owned(), names);
        if taken.source == Source::Nobody {
            taken.source = seen.source;
        }
    }
    Ok(Answer { taken, was_contradicted: false })
}

/// What a case gives that is not run at all: a skip for every run of its plan, and engines of the given status.
pub fn not_run(case: &Case, plan: &Plan, status: Status, reason: &str) -> Outcome {
    let skip = |run: &Run| {
        let (task, engine) = (&plan.tasks[run.task], plan.engines[run.engine].engine.name());
        Skip::of(case, task, engine, Scope::Procedure, reason).saving("the whole run")
    };
    let engine = |(e, planned): (usize, &Planned)| {
        let engine = self::status(planned, &[]);
        if plan.runs.iter().any(|run| run.engine == e) {
            EngineStatus { status, reason: Some(reason.to_owned()), ..engine }
        } else {
            engine
        }
    };
    let engines = plan.engines.iter().enumerate().map(engine).collect();
    let skips = plan.runs.iter().map(skip).collect();
    Outcome { recordings: vec![], engines, skips, contradicted: BTreeSet::new(), from_cache: 0 }
}

fn status(planned: &Planned, recordings: &[Recording]) -> EngineStatus {
    let id = planned.engine.name();
    let mine: Vec<&Recording> = recordings.iter().filter(|r| r.key.engine == id.as_str()).collect();
    let failures: Vec<&str> = mine.iter().filter_map(|r| r.failure.as_deref()).collect();
    let (status, reason) = match &planned.found {
        Some(Err(absent)) => (Status::Absent, Some(absent.to_string())),
        Some(Ok(_)) if !failures.is_empty() => (Status::Failed, Some(failures.join("; "))),
        None => (Status::Skipped, Some("it supports nothing that was asked: not started".to_owned())),
        Some(Ok(_)) if mine.is_empty() => (Status::Skipped, Some("it declined all that was asked".to_owned())),
        Some(Ok(_)) => (Status::Ran, None),
    };
    let wall_s = mine.iter().map(|r| r.wall_s).sum();
    let is_required = planned.asked == Asked::ByName;
    let fingerprint = planned.instrument().map(|i| i.version.fingerprint);
    let role = planned.engine.role();
    EngineStatus { id, version: planned.version(), role, fingerprint, status, is_required, reason, wall_s }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use luminaire::scene::Transport;

    use super::*;
    use crate::engines::fixtures::{Fake, s1};
    use crate::engines::{Job, Site, Version};
    use crate::measure::Machine;
    use crate::plan::{Fill, Shortcut};
    use crate::record::{Estimate, Uncertainty};

    /// An engine that reads `slope` lx more a metre along x, asked by a shortcut that says that all meters read the same.
    fn answered(slope: f64) -> Measurement {
        let estimate = move |at_m: f64| Estimate { value: 1.0 + slope * at_m, uncertainty: Uncertainty::Bound(1e-9) };
        let read = move |job: &Job| {
            let estimates = job.stations.iter().map(|s| estimate(s.meter.position_m.x)).collect();
            let is_cut = job.stations.len() == 1 && job.stations[0].id.to_string() == "m[2]";
            Ok(Measurement {
                estimates,
                work_s: Some(job.stations.len() as f64),
                effort: [("blocks", if is_cut { "4" } else { "8" })].into(),
                notes: is_cut.then(|| "cut short".to_owned()).into_iter().collect(),
                ..Measurement::default()
            })
        };
        let job = s1(Transport::Direct);
        let mut shortcut = Shortcut::none(&job);
        shortcut.job.stations.truncate(1);
        for fill in &mut shortcut.fill[1..] {
            *fill = Fill::Mirrors { station: 0, by: "a false claim".into() };
        }
        let run = Run { engine: 0, task: 0, job, approximation: None, declared: 0.0, shortcut, spot_check: vec![2] };
        let found = Some(Ok(Version::told("1")));
        let planned = Planned { engine: Arc::new(Fake::new("fake", read)), found, asked: Asked::ByName };
        let folder = tempfile::tempdir().unwrap();
        let reader = Reader::bare(&Site::at(folder.path()), Machine::new(1));
        answer(&planned, &run, &reader, "direct_illuminance").unwrap().taken.measurement
    }

    fn values(measurement: &Measurement) -> Vec<f64> {
        measurement.estimates.iter().map(|e| e.value).collect()
    }

    #[test]
    fn what_a_spot_check_contradicts_is_rendered_whole_and_says_so() {
        let right = answered(0.0);
        assert_eq!((values(&right), right.notes), (vec![1.0; 4], vec!["spot check of m[2]: cut short".to_owned()]));
        let effort = ["spot_checked", "blocks", "spot_check_blocks"].map(|key| right.effort[key].as_str());
        assert_eq!(effort, ["m[2]", "8", "4"]);
        // Of the one that is rendered and the one that is looked at.
        assert_eq!(right.work_s, Some(2.0));
        let lopsided = answered(0.5);
        assert_eq!(values(&lopsided), [2.0, 2.0, 6.0, 6.0]);
        let [note] = &lopsided.notes[..] else { panic!("{:?}", lopsided.notes) };
        assert!(
            note.contains("m[2] reads 6 lx where 2 lx follow") && note.contains("everything was rendered"),
            "{note}"
        );
        assert!(!lopsided.effort.contains_key("mirrored_meters"), "{:?}", lopsided.effort);
        assert_eq!(lopsided.work_s, Some(4.0));
    }
}
