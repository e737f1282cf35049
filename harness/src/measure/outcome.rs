//! What came of a reading: estimates and their cost, or why it came to nothing; a file and another process can carry both.

use serde::{Deserialize, Serialize};

use crate::engines::{EngineError, Measurement};
use crate::record::FailureKind;
use crate::system::process::ProcessError;

/// What a reading took the engine, now or when it was asked first.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Cost {
    pub wall_s: f64,
    /// Processor seconds of this process and its children meanwhile; beside other readings theirs are among them.
    pub cpu_s: f64,
    /// Resident memory of the largest process, in MiB.
    pub peak_mib: Option<f64>,
}

impl Cost {
    /// That of both, one after the other.
    #[must_use]
    pub fn plus(self, other: Self) -> Self {
        let peak_mib = [self.peak_mib, other.peak_mib].into_iter().flatten().reduce(f64::max);
        Self { wall_s: self.wall_s + other.wall_s, cpu_s: self.cpu_s + other.cpu_s, peak_mib }
    }
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Taken {
    pub measurement: Measurement,
    pub cost: Cost,
    pub source: Source,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Source {
    Engine,
    /// The cache or this run, from an earlier answer of the engine.
    Cache,
    /// Nobody had to be asked.
    Nobody,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, thiserror::Error)]
#[error("{text}")]
pub struct Failure {
    pub kind: FailureKind,
    pub text: String,
    /// What was read all the same; NaN where nothing was.
    #[serde(skip)]
    pub rest: Option<Box<Measurement>>,
}

impl Failure {
    pub fn new(kind: FailureKind, text: impl Into<String>) -> Self {
        Self { kind, text: text.into(), rest: None }
    }

    /// The same, what was read all the same made something else.
    #[must_use]
    pub fn with_rest(self, made: impl FnOnce(Measurement) -> Option<Measurement>) -> Self {
        Self { rest: self.rest.and_then(|rest| made(*rest)).map(Box::new), ..self }
    }
}

impl From<EngineError> for Failure {
    fn from(error: EngineError) -> Self {
        let text = error.to_string();
        let kind = match error {
            EngineError::Process(ProcessError::TimedOut { .. }) => FailureKind::Hang,
            EngineError::Process(ProcessError::Interrupted { .. }) => FailureKind::Interrupted,
            EngineError::Process(_) | EngineError::Io { .. } => FailureKind::Crash,
            EngineError::NotFinite { .. } => FailureKind::Nan,
            EngineError::Output { .. } => FailureKind::SilentLoss,
            EngineError::Garbled { .. } => FailureKind::Garbled,
            EngineError::Setting { .. } | EngineError::Solver { .. } => FailureKind::Refused,
            EngineError::Declined { why, .. } => return Self::new(FailureKind::Declined, why),
            EngineError::AtMeters { first, rest, .. } => {
                return Self { text, rest: Some(Box::new((*rest).into())), ..Self::from(*first) };
            }
        };
        Self::new(kind, text)
    }
}
