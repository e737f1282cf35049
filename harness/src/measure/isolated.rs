//! One reading with what it took: time, processor time, memory, and how it failed where it failed; finished ones are kept.
//!
//! Renderers run in processes of their own already. Our own solvers are run in a process apart, by this very program, so
//! that one that hangs or dies takes nothing with it and its memory is its own.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use crate::engines::{Engine, EngineError, Job, Site, Support, Workbench, checked};
use crate::laws::{self, Place};
use crate::procedures::Task;
use crate::record::{Estimate, ProcedureId, ReadingKey};
use crate::spec::{Budget, Case, hexadecimal};
use crate::system::files::{self, FileError};
use crate::system::process::{self, Invocation, PeakMemory, ProcessError};

/// A reading to take, as another process or a later run finds it again.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Request {
    pub spec: PathBuf,
    /// SHA-256 of the spec and all that it names.
    pub spec_sha256: String,
    #[serde(flatten)]
    pub key: ReadingKey,
    pub version: String,
    /// Which variant of the procedure's job; `None` for the job itself.
    pub place: Option<Place>,
    /// The engine's settings.
    pub settings: BTreeMap<String, serde_json::Value>,
    /// When to stop.
    pub budget: Budget,
    /// Seed of every random choice.
    pub seed: u64,
    /// Threads or processes at a time.
    pub jobs: usize,
    /// Past this it hangs, in seconds.
    pub limit_s: f64,
}

/// What came of it.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Outcome {
    /// Wall-clock seconds.
    pub wall_s: f64,
    /// Processor seconds of all processes together.
    pub cpu_s: f64,
    /// Resident memory of the largest process, in MiB.
    pub peak_mib: Option<f64>,
    /// One a station; empty where it failed.
    pub estimates: Vec<Estimate>,
    /// What the engine set.
    pub settings: BTreeMap<String, String>,
    /// What the engine says beforehand that it only approximates.
    pub declared: Option<String>,
    /// Why there are no estimates.
    pub failure: Option<Failure>,
}

/// Why a reading came to nothing.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Failure {
    pub kind: FailureKind,
    pub text: String,
}

/// Kinds of failure.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum FailureKind {
    /// The engine says that it cannot: that is right of it.
    Refused,
    /// It gave something that is no number.
    Nan,
    /// It ended with an error or was killed.
    Crash,
    /// It did not end in time.
    Hang,
    /// It ended well and readings were missing.
    SilentLoss,
    /// The user asked to stop.
    Interrupted,
}

/// An engine that is measured.
pub struct Subject {
    pub engine: Box<dyn Engine>,
    pub version: String,
}

/// Where readings are taken.
#[derive(Clone, Debug)]
pub struct Laboratory {
    /// Where engines are installed.
    pub site: Site,
    /// Whether our own solvers get a process apart.
    pub own_solvers: OwnSolvers,
}

/// Where our own solvers run.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum OwnSolvers {
    /// In this process.
    Here,
    /// In another process of this program, which lies there.
    Apart(PathBuf),
}

impl Laboratory {
    /// Takes one reading of a job, which is the one that the request names.
    pub fn read(&self, engine: &dyn Engine, job: &Job, request: &Request) -> Outcome {
        match &self.own_solvers {
            OwnSolvers::Apart(program) if engine.is_witness() => apart(program, request),
            _ => here(engine, job, &self.site, request.jobs, Duration::from_secs_f64(request.limit_s)),
        }
    }
}

/// Takes a reading in this process.
pub fn here(engine: &dyn Engine, job: &Job, site: &Site, jobs: usize, limit: Duration) -> Outcome {
    let declared = match engine.supports(job) {
        Support::Yes => None,
        Support::Approximate { why, .. } => Some(why),
        Support::No(why) => return Outcome::failed(FailureKind::Refused, why),
    };
    let folder = match tempfile::tempdir() {
        Ok(folder) => folder,
        Err(error) => return Outcome::failed(FailureKind::Crash, format!("no folder to work in: {error}")),
    };
    let scene_dir = folder.path().join("scene");
    if let Err(error) = std::fs::create_dir(&scene_dir) {
        return Outcome::failed(FailureKind::Crash, format!("{}: {error}", scene_dir.display()));
    }
    let (log, peak) = (folder.path().join("log"), PeakMemory::default());
    let workbench = Workbench { site: site.clone(), scene_dir, log, jobs, limit, peak: peak.clone() };
    let (clock, cpu) = (Instant::now(), process::cpu_time());
    let measured = engine.read(job, &workbench).and_then(|m| checked(&engine.name(), job, m));
    let (wall_s, cpu_s) = (clock.elapsed().as_secs_f64(), process::cpu_time().saturating_sub(cpu).as_secs_f64());
    if peak.mib().is_none() {
        peak.look_at("self");
    }
    let taken = Outcome { wall_s, cpu_s, peak_mib: peak.mib(), declared, ..Outcome::default() };
    match measured {
        Ok(measurement) => Outcome { estimates: measurement.estimates, settings: measurement.settings, ..taken },
        Err(error) => Outcome { failure: Some(Failure { kind: kind(&error), text: error.to_string() }), ..taken },
    }
}

fn kind(error: &EngineError) -> FailureKind {
    match error {
        EngineError::Process(ProcessError::TimedOut { .. }) => FailureKind::Hang,
        EngineError::Process(ProcessError::Interrupted { .. }) => FailureKind::Interrupted,
        EngineError::Process(_) | EngineError::Io { .. } => FailureKind::Crash,
        EngineError::NotFinite { .. } => FailureKind::Nan,
        EngineError::Output { .. } => FailureKind::SilentLoss,
        EngineError::Setting { .. } | EngineError::Declined { .. } | EngineError::Solver { .. } => FailureKind::Refused,
    }
}

/// The argument that makes this program take one reading for another process of its own.
pub const READ_ONE: &str = "read-one";

/// Takes a reading in another process of this program.
fn apart(program: &Path, request: &Request) -> Outcome {
    let crash = |text: String| Outcome::failed(FailureKind::Crash, text);
    let (folder, input) = match (tempfile::tempdir(), serde_json::to_vec(request)) {
        (Ok(folder), Ok(input)) => (folder, input),
        (Err(error), _) => return crash(format!("no folder to work in: {error}")),
        (_, Err(error)) => return crash(format!("the request is no JSON: {error}")),
    };
    let (limit, log) = (Duration::from_secs_f64(request.limit_s), folder.path().join("log"));
    let clock = Instant::now();
    // Where the spec's path counts from.
    let run = Invocation::new(program, Path::new("."), limit, log).args([READ_ONE]).stdin(input);
    let outcome = match run.run() {
        Ok(done) => match serde_json::from_slice(&done.stdout) {
            Ok(outcome) => return outcome,
            Err(error) => crash(format!("the reading apart is no JSON: {error}")),
        },
        Err(error @ ProcessError::TimedOut { .. }) => Outcome::failed(FailureKind::Hang, error.to_string()),
        Err(error @ ProcessError::Interrupted { .. }) => Outcome::failed(FailureKind::Interrupted, error.to_string()),
        Err(error) => crash(error.to_string()),
    };
    Outcome { wall_s: clock.elapsed().as_secs_f64(), ..outcome }
}

/// What the process apart does: the reading that the request on its standard input names.
pub fn answer(request: &Request, site: &Site) -> Result<Outcome, String> {
    let cases = Case::load_all(&request.spec).map_err(|e| e.to_string())?;
    let case = cases.into_iter().find(|c| c.name == request.key.case).ok_or("the case is gone")?;
    if case.sha256 != request.spec_sha256 {
        return Err("the spec has changed meanwhile".into());
    }
    let engine = crate::engines::all().into_iter().find(|e| e.name() == request.key.engine);
    let engine = engine.ok_or_else(|| format!("no engine {}", request.key.engine))?;
    let job = request.job(&case).ok_or("the job is gone")?;
    Ok(here(engine.as_ref(), &job, site, request.jobs, Duration::from_secs_f64(request.limit_s)))
}

impl Outcome {
    /// A reading that failed.
    pub fn failed(kind: FailureKind, text: String) -> Self {
        Self { failure: Some(Failure { kind, text }), ..Self::default() }
    }

    /// How it failed, if it did.
    pub fn failure_kind(&self) -> Option<FailureKind> {
        self.failure.as_ref().map(|f| f.kind)
    }
}

impl Request {
    pub fn job(&self, case: &Case) -> Option<Job> {
        let base = Job::of_task(case, &task(case, self.key.procedure)?);
        let job = match &self.place {
            None => base,
            Some(place) => laws::job(&base, place)?,
        };
        Some(Job { settings: self.settings.clone(), budget: self.budget, seed: self.seed, ..job })
    }

    /// Its name on the shelf.
    fn key(&self) -> String {
        let mut hash = Sha256::new();
        hash.update(env!("CARGO_PKG_VERSION"));
        hash.update(serde_json::to_vec(self).unwrap_or_default());
        hexadecimal(&hash.finalize())[..24].to_owned()
    }
}

pub fn task(case: &Case, procedure: ProcedureId) -> Option<Task> {
    case.task(procedure)
}

/// Finished readings on disk, so that an interrupted measurement goes on where it stopped.
#[derive(Clone, Debug)]
pub struct Shelf {
    folder: PathBuf,
}

impl Shelf {
    /// The shelf in a folder.
    pub fn new(folder: PathBuf) -> Self {
        Self { folder }
    }

    /// A finished reading; one that cannot be read is taken again.
    pub fn find(&self, request: &Request) -> Option<Outcome> {
        let text = std::fs::read(self.path(request)).ok()?;
        let (_, outcome): (Request, Outcome) = serde_json::from_slice(&text).ok()?;
        Some(outcome)
    }

    /// Keeps a finished reading.
    pub fn keep(&self, request: &Request, outcome: &Outcome) -> Result<(), FileError> {
        if outcome.failure_kind() == Some(FailureKind::Interrupted) {
            return Ok(());
        }
        files::keep_json(&self.path(request), &(request, outcome))
    }

    fn path(&self, request: &Request) -> PathBuf {
        self.folder.join(format!("{}.json", request.key()))
    }
}
