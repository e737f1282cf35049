//! Our own solvers in a process apart, by this very program: one that hangs or dies takes nothing with it, and its memory is
//! its own. Renderers have processes of their own already.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::outcome::{Failure, Taken};
use super::question::{Question, Trial};
use crate::engines::{EngineError, Workbench};
use crate::laws::Place;
use crate::record::{FailureKind, ReadingKey};
use crate::spec::Budget;
use crate::system::process::Invocation;

#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Isolation {
    InProcess,
    /// In another process of this program, which lies there; for trials, whose jobs another process can find.
    Subprocess(PathBuf),
}

/// The argument that makes this program take one reading for another process of its own.
pub const READ_ONE: &str = "read-one";

/// A reading to take, as another process finds it again.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Request {
    pub(super) spec: PathBuf,
    /// SHA-256 of the spec and all that it names.
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
    pub(super) fn of(question: &Question<'_>, trial: &Trial<'_>) -> Self {
        let (job, case) = (question.job, trial.case);
        Self {
            spec: case.path.clone(),
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

pub(super) fn read(program: &Path, request: &Request, bench: &Workbench) -> Result<Taken, Failure> {
    let no_json = |what, e| Failure::new(FailureKind::Crash, format!("the {what} is no JSON: {e}"));
    let input = serde_json::to_vec(request).map_err(|e| no_json("request", e))?;
    // The spec's path counts from where this process is.
    let run = Invocation::new(program, Path::new("."), bench.limit, &bench.log).of_user();
    let run = run.args([READ_ONE]).stdin(input);
    let done = run.run().map_err(EngineError::from)?;
    serde_json::from_slice::<Result<Taken, Failure>>(&done.stdout).map_err(|e| no_json("reading apart", e))?
}
