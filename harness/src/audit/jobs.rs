//! Runs a plan: one reading a job, readings kept on disk as each job finishes, one engine's failure stops no other.

use std::collections::BTreeMap;
use std::ops::Add;
use std::path::Path;

use std::time::{Duration, Instant};

use super::observer::Observer;
use parking_lot::Mutex;

use crate::engines::{EngineError, Measurement};
use crate::measure::{Cost, Failure, FailureKind, Question, Reader, Source, Taken};
use crate::plan::{Asked, Plan, Planned, Run, Scope, Skip};
use crate::record::{EngineName, EngineStatus, Reading, ReadingKey, Recording, Status};
use crate::spec::{Case, content};
use crate::system::files::{self, FileError};
use crate::system::slots::side_by_side;

pub struct Running<'a> {
    pub case: &'a Case,
    pub plan: &'a Plan,
    /// The folder of the case's files, which is the reader's, too.
    pub folder: &'a Path,
    /// Who takes readings; cases that run side by side share its machine.
    pub reader: Reader,
    pub observer: &'a dyn Observer,
}

/// What a run gave.
#[derive(Clone, Debug)]
pub struct Outcome {
    /// One a run of the plan, failures included, in the plan's order.
    pub recordings: Vec<Recording>,
    /// One an engine of the plan, in its order.
    pub engines: Vec<EngineStatus>,
    /// What an engine declined once it had seen the job.
    pub skips: Vec<Skip>,
    /// How many answers of engines came out of the cache.
    pub from_cache: usize,
}

enum Done {
    Recorded(Box<Recording>, Option<Source>),
    Declined(Skip),
}

impl Running<'_> {
    /// Runs every job of the plan, as many side by side as the machine has room for; what it gives is in the plan's order, whoever ends first.
    pub fn run(&self) -> Result<Outcome, FileError> {
        let threads = self.reader.machine.slots.threads();
        // By place in the plan.
        let kept: Mutex<BTreeMap<usize, Recording>> = Mutex::default();
        let runs: Vec<(usize, &Run)> = self.plan.runs.iter().enumerate().collect();
        let one = |&(k, run): &(usize, &Run)| -> Result<Done, FileError> {
            let done = self.measure(run);
            if let Done::Recorded(recording, _) = &done {
                let mut kept = kept.lock();
                kept.insert(k, (**recording).clone());
                // Written as each job finishes, so that an interruption loses only what was under way.
                keep(self.folder, &recording.key.engine, kept.values())?;
            }
            Ok(done)
        };
        let (mut recordings, mut skips, mut from_cache) = (vec![], vec![], 0);
        for done in side_by_side(threads, &runs, one) {
            match done? {
                Done::Recorded(recording, source) => {
                    from_cache += usize::from(source == Some(Source::Cache));
                    recordings.push(*recording);
                }
                Done::Declined(skip) => skips.push(skip),
            }
        }
        let engines = self.plan.engines.iter().map(|planned| status(planned, &recordings)).collect();
        Ok(Outcome { recordings, engines, skips, from_cache })
    }

    /// One run of the plan: the one place where a recording is made of what engines answer.
    fn measure(&self, run: &Run) -> Done {
        let (planned, task) = (&self.plan.engines[run.engine], &self.plan.tasks[run.task]);
        let engine = planned.engine.as_ref();
        self.observer.started(self.case, engine, task.procedure.name());
        let start = Instant::now();
        let taken = answer(planned, run, &self.reader, task.procedure.name());
        if let Err(Failure { kind: FailureKind::Declined, text: why }) = &taken {
            self.observer.ended(self.case, engine, task.procedure, start.elapsed(), None);
            let reason = format!("it declines: {why}");
            return Done::Declined(Skip::of(self.case, task, engine.name(), Scope::Procedure, reason));
        }
        let source = taken.as_ref().ok().map(|taken| taken.source);
        let recording = self.record(run, taken, start.elapsed());
        let wall = Duration::try_from_secs_f64(recording.wall_s).unwrap_or_default();
        self.observer.ended(self.case, engine, task.procedure, wall, recording.failure.as_deref());
        Done::Recorded(Box::new(recording), source)
    }

    fn record(&self, run: &Run, taken: Result<Taken, Failure>, wall: Duration) -> Recording {
        let (planned, task) = (&self.plan.engines[run.engine], &self.plan.tasks[run.task]);
        let engine = planned.engine.name();
        let (measurement, wall_s, failure) = match taken {
            Ok(taken) => (taken.measurement, taken.cost.wall_s, None),
            Err(error) => {
                tracing::error!(%engine, procedure = %task.procedure, "{error}");
                (Measurement::default(), wall.as_secs_f64(), Some(error.to_string()))
            }
        };
        let estimates = if failure.is_none() { measurement.readings(&task.targets) } else { vec![] };
        let readings = estimates.iter().zip(&task.targets).map(|(estimate, target)| Reading {
            meter: target.id.clone(),
            quantity: task.quantity,
            value: estimate.value,
            uncertainty: estimate.uncertainty,
        });
        Recording {
            version: planned.version().unwrap_or_default(),
            model: task.model(),
            input_sha256: self.case.sha256.clone(),
            content_sha256: content(task),
            seed: run.job.seed,
            skewness: measurement.skewness(),
            work_s: measurement.work_s,
            method: measurement.method,
            effort: measurement.effort,
            role: planned.engine.role(),
            approximation: run.approximation.clone(),
            notes: measurement.notes,
            wall_s,
            components: planned.engine.components(&run.job),
            command: planned.engine.command_by_hand(&run.job, &self.reader.site),
            failure,
            readings: readings.collect(),
            ..Recording::of(ReadingKey::new(&self.case.name, task.procedure, engine), task.light())
        }
    }
}

/// What an engine answers to a run: it renders what the shortcut leaves, the rest follows, and the spot check must agree.
fn answer(planned: &Planned, run: &Run, reader: &Reader, folder: &str) -> Result<Taken, Failure> {
    let failed = |what: String| Failure::from(EngineError::Solver { engine: planned.engine.name(), what });
    let instrument = planned.instrument().ok_or_else(|| failed("it is not there".to_owned()))?;
    let shortcut = &run.shortcut;
    let rendered = if shortcut.job.stations.is_empty() {
        Taken { measurement: Measurement::default(), cost: Cost::default(), source: Source::Nobody }
    } else {
        reader.read(&Question::new(&instrument, &shortcut.job, folder))?
    };
    let mut taken = Taken { measurement: shortcut.complete(rendered.measurement, &run.job), ..rendered };
    if let Some(job) = run.spot_check_job() {
        let seen = reader.read(&Question::new(&instrument, &job, &format!("{folder}-spot-check")))?;
        run.hold(&taken.measurement, &seen.measurement).map_err(failed)?;
        taken.cost.wall_s += seen.cost.wall_s;
        let work_s = [taken.measurement.work_s, seen.measurement.work_s];
        taken.measurement.work_s = work_s.into_iter().flatten().reduce(f64::add);
        // What was rendered stands; samples of another job do not tell how it varies with the rest.
        taken.measurement.samples.clear();
        for (&station, estimate) in run.spot_check.iter().zip(seen.measurement.estimates) {
            taken.measurement.estimates[station] = estimate;
        }
        let names: Vec<String> = job.stations.iter().map(|s| s.id.to_string()).collect();
        taken.measurement.effort.insert("spot_checked".to_owned(), names.join(", "));
        if taken.source == Source::Nobody {
            taken.source = seen.source;
        }
    }
    Ok(taken)
}

/// Writes the file of an engine's readings, those among all that are its own.
pub(super) fn keep<'a>(
    folder: &Path,
    engine: &EngineName,
    all: impl IntoIterator<Item = &'a Recording>,
) -> Result<(), FileError> {
    let mine: Vec<&Recording> = all.into_iter().filter(|r| r.key.engine == *engine).collect();
    files::keep_json(&folder.join("readings").join(format!("{engine}.json")), &mine)
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
    Outcome { recordings: vec![], engines, skips: plan.runs.iter().map(skip).collect(), from_cache: 0 }
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
