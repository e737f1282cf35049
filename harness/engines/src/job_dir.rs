//! Where an engine works: folders, logs and limits of a job; what its files are and why they may give no reading.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, Instant};

use parking_lot::Mutex;

use super::EngineRoot;
use luxproof_model::{Effort, EngineName, Estimate, MeterId, Method, Uncertainty};
use luxproof_process::files::remedy;
use luxproof_process::printable;
use luxproof_process::process::{Invocation, PeakMemory, ProcessError, ProcessPool};

#[derive(Clone, Debug, PartialEq)]
pub struct SceneFile {
    pub name: String,
    pub bytes: Vec<u8>,
}

impl SceneFile {
    pub fn text(name: &str, text: impl Into<String>) -> Self {
        Self { name: name.to_owned(), bytes: text.into().into_bytes() }
    }

    /// Writes it below a folder, with the folders that its name names; says where.
    pub fn write_below(&self, folder: &Path) -> Result<PathBuf, EngineError> {
        let path = folder.join(&self.name);
        let above = path.parent().map_or(Ok(()), std::fs::create_dir_all);
        above.and_then(|()| std::fs::write(&path, &self.bytes)).map_err(|source| EngineError::io(&path, source))?;
        Ok(path)
    }
}

#[derive(Clone, Debug)]
pub struct JobDir {
    pub site: EngineRoot,
    /// The folder of this job's scene files; exists, belongs to this job alone.
    pub scene_dir: PathBuf,
    /// The log that every process of this job appends its messages to.
    pub log: PathBuf,
    /// Threads or processes at a time.
    pub jobs: usize,
    /// By the clock, how long sampling may go on from when the engine begins.
    pub patience: Duration,
    /// Past this the job is killed.
    pub limit: Duration,
    pub peak: PeakMemory,
    pub shared_precompute: SharedPrecompute,
    /// Where drivers wait for the next job; they end with theirs without it.
    pub idle: Option<ProcessPool>,
    /// Folders with results of the run, which a program of the user's must not read.
    pub hidden: Arc<[PathBuf]>,
}

/// What an engine finds that other jobs need, too, in numbers that it alone understands: of an earlier job, and of this one.
#[derive(Clone, Debug, Default)]
pub struct SharedPrecompute {
    pub earlier: Option<Arc<Vec<f64>>>,
    pub precomputed: Arc<Mutex<Option<Vec<f64>>>>,
}

impl JobDir {
    pub fn invoke(&self, program: impl Into<PathBuf>) -> Invocation {
        Invocation { peak: self.peak.clone(), ..Invocation::new(program, &self.scene_dir, self.limit, &self.log) }
    }

    /// When no more samples are begun, of a job that begins now.
    pub(super) fn until(&self) -> Instant {
        Instant::now() + self.patience
    }

    pub fn write(&self, files: &[SceneFile]) -> Result<(), EngineError> {
        for file in files {
            file.write_below(&self.scene_dir)?;
        }
        Ok(())
    }
}

/// An invocation only to be printed, for a person in the scene's folder.
pub(super) fn by_hand(program: impl Into<PathBuf>) -> Invocation {
    Invocation::new(program, Path::new("."), Duration::ZERO, "")
}

#[derive(Debug, thiserror::Error)]
pub enum EngineError {
    #[error(transparent)]
    Process(#[from] ProcessError),
    #[error("{path}: {source}{}", remedy(.source))]
    Io { path: String, source: std::io::Error },
    #[error("{engine} exited without an error, but {what}")]
    Output { engine: EngineName, what: String },
    /// What it printed is no answer to what it was asked.
    #[error("{engine} exited without an error, but {what}")]
    Garbled { engine: EngineName, what: String },
    #[error("{engine} exited without an error, but read {value} lx ({uncertainty:?}) at {meter}")]
    NotFinite { engine: EngineName, meter: MeterId, value: f64, uncertainty: Uncertainty },
    /// At some meters; the readings of the others stand in the rest, what is NaN there is lost.
    #[error("{first}{}; the readings of the other meters are kept", and_more(*.others))]
    AtMeters { first: Box<EngineError>, others: usize, rest: Box<PartialMeasurement> },
    #[error("engines.{engine}.{key}: {what}")]
    Setting { engine: EngineName, key: String, what: String },
    /// It cannot do what was asked, as it says itself once it has seen the job: a skip, no failure.
    #[error("{engine} declines: {why}")]
    Declined { engine: EngineName, why: String },
    #[error("{engine}: {what}")]
    Solver { engine: EngineName, what: String },
}

/// What is left of a measurement that lost single meters: NaN stands where nothing was read.
#[derive(Clone, Debug)]
pub struct PartialMeasurement {
    pub estimates: Vec<Estimate>,
    pub method: Method,
    pub effort: Effort,
    pub notes: Vec<String>,
}

fn and_more(meters: usize) -> String {
    if meters == 0 { String::new() } else { format!(" (and the like at {meters} more)") }
}

impl EngineError {
    pub fn io(path: &Path, source: std::io::Error) -> Self {
        Self::Io { path: path.display().to_string(), source }
    }

    /// What should have been JSON, by its start.
    pub(super) fn no_readings(engine: EngineName, answer: &str, error: &serde_json::Error) -> Self {
        let start: String = answer.chars().take(200).collect();
        Self::garbled(engine, format!("its answer is no JSON of readings ({error}): `{start}`"))
    }

    /// The same, reported by this engine.
    pub(super) fn of_engine(self, name: &EngineName) -> Self {
        let engine = name.clone();
        match self {
            Self::Output { what, .. } => Self::Output { engine, what },
            Self::Garbled { what, .. } => Self::Garbled { engine, what },
            Self::NotFinite { meter, value, uncertainty, .. } => Self::NotFinite { engine, meter, value, uncertainty },
            Self::AtMeters { first, others, rest } => {
                Self::AtMeters { first: Box::new(first.of_engine(name)), others, rest }
            }
            Self::Setting { key, what, .. } => Self::Setting { engine, key, what },
            Self::Declined { why, .. } => Self::Declined { engine, why },
            Self::Solver { what, .. } => Self::Solver { engine, what },
            Self::Process(_) | Self::Io { .. } => self,
        }
    }

    pub(super) fn garbled(engine: EngineName, what: impl Into<String>) -> Self {
        Self::Garbled { engine, what: printable::lines(&what.into()) }
    }

    pub fn output(engine: EngineName, what: impl Into<String>) -> Self {
        Self::Output { engine, what: printable::lines(&what.into()) }
    }
}
