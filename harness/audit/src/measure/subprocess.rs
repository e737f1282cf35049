//! Runs a built-in solver in a child process of this program, which isolates crashes and measures its memory.
//!
//! Renderers run in separate processes already.

use luxproof_model::ForeignPath;
use luxproof_spec::Trust;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::outcome::{CostedMeasurement, Failure};
use super::question::{Question, Trial};
use luxproof_engines::{EngineError, JobDir};
use luxproof_laws::Place;
use luxproof_model::{FailureKind, ReadingKey};
use luxproof_process::process::Invocation;
use luxproof_spec::Budget;

/// Where built-in solvers run.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Isolation {
    InProcess,
    /// In a child process of the program at this path; for trials only, which the child can find in the spec.
    Subprocess(PathBuf),
}

/// The argument that makes this program take one reading for its parent process.
pub const READ_ONE: &str = "read-one";

/// A reading to take, in terms that the child process can look up in the spec.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Request {
    pub(super) spec: ForeignPath,
    /// Whose spec it is.
    pub(super) trust: Trust,
    /// SHA-256 of the spec and of all files that it names.
    pub(super) spec_sha256: String,
    #[serde(flatten)]
    pub(super) key: ReadingKey,
    pub(super) variant: Option<Place>,
    pub(super) settings: BTreeMap<String, serde_json::Value>,
    pub(super) budget: Budget,
    pub(super) seed: u64,
    pub(super) threads: usize,
}

impl Request {
    pub(super) fn from_question(question: &Question<'_>, trial: &Trial<'_>) -> Self {
        let (job, case) = (question.job, trial.case);
        Self {
            spec: case.path.clone().into(),
            trust: case.source.trust,
            spec_sha256: case.sha256.clone(),
            key: ReadingKey::new(&case.name, job.procedure, question.instrument.engine.name()),
            variant: trial.variant.clone(),
            settings: job.settings.clone(),
            budget: job.budget,
            seed: job.seed,
            threads: trial.threads,
        }
    }
}

/// Takes a reading in a child process.
pub(super) fn read(program: &Path, request: &Request, bench: &JobDir) -> Result<CostedMeasurement, Failure> {
    let input = serde_json::to_vec(request).map_err(|e| json_failure("request", &e))?;
    // The spec's path is relative to the folder of this process.
    let run = Invocation::new(program, Path::new("."), bench.limit, &bench.log).of_user();
    let run = run.args([READ_ONE]).stdin(input);
    let done = run.run().map_err(EngineError::from)?;
    serde_json::from_slice::<Result<CostedMeasurement, Failure>>(&done.stdout)
        .map_err(|e| json_failure("reading of the child process", &e))?
}

/// The failure of a message between the two processes.
fn json_failure(what: &str, error: &serde_json::Error) -> Failure {
    Failure::new(FailureKind::Crash, format!("the {what} is no JSON: {error}"))
}
