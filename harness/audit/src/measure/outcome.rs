//! The outcome of a reading: estimates and their cost, or a failure. Both can be stored and sent to another process.

use serde::{Deserialize, Serialize};

use luxproof_engines::{EngineError, Measurement};
use luxproof_model::FailureKind;
use luxproof_process::process::ProcessError;

/// The cost of a reading, at the time when the engine took it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Cost {
    pub wall_s: f64,
    /// Processor seconds of this process and its children; they include concurrent readings.
    pub cpu_s: f64,
    /// Resident memory of the largest process, in MiB.
    pub peak_mib: Option<f64>,
}

impl Cost {
    /// The cost of two readings, one after the other.
    #[must_use]
    pub fn plus(self, other: Self) -> Self {
        let peak_mib = [self.peak_mib, other.peak_mib].into_iter().flatten().reduce(f64::max);
        Self { wall_s: self.wall_s + other.wall_s, cpu_s: self.cpu_s + other.cpu_s, peak_mib }
    }
}

/// A reading, its cost and its source.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CostedMeasurement {
    pub measurement: Measurement,
    pub cost: Cost,
    pub source: AnswerSource,
}

/// Where a reading comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum AnswerSource {
    Engine,
    /// The cache or this run, from an earlier answer of the engine.
    Cache,
    /// It follows without rendering.
    Shortcut,
}

/// Why a reading failed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, thiserror::Error)]
#[error("{text}")]
pub struct Failure {
    pub kind: FailureKind,
    pub text: String,
    /// The readings of the other meters, where only some failed; NaN at those that failed.
    #[serde(skip)]
    pub rest: Option<Box<Measurement>>,
}

impl Failure {
    pub fn new(kind: FailureKind, text: impl Into<String>) -> Self {
        Self { kind, text: text.into(), rest: None }
    }

    /// Transforms the readings of the meters that did not fail.
    #[must_use]
    pub fn with_rest(self, transform: impl FnOnce(Measurement) -> Option<Measurement>) -> Self {
        Self { rest: self.rest.and_then(|rest| transform(*rest)).map(Box::new), ..self }
    }
}

impl From<EngineError> for Failure {
    fn from(error: EngineError) -> Self {
        let text = error.to_string();
        let kind = match error {
            EngineError::Process(ProcessError::TimedOut { .. }) => FailureKind::Hang,
            EngineError::Process(ProcessError::Interrupted { .. }) => FailureKind::Interrupted,
            EngineError::Process(error) if error.has_stated_reason() => FailureKind::ErrorExit,
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
