//! What an engine takes part for, and how it fared in a run.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::EngineName;

/// How an engine fared.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct EngineStatus {
    /// The engine.
    pub id: EngineName,
    /// Its version, where it is there.
    pub version: Option<String>,
    /// What it takes part for.
    #[serde(default)]
    pub role: Role,
    /// Hash of what really runs: programs, libraries, packages, sources.
    #[serde(default)]
    pub fingerprint: Option<String>,
    /// How it fared.
    pub status: Status,
    /// Whether it was named, so that its absence is an error.
    #[serde(default)]
    pub is_required: bool,
    /// Why it did not run.
    pub reason: Option<String>,
    /// Wall-clock seconds over all procedures.
    pub wall_s: f64,
}

impl EngineStatus {
    /// Takes in how the same engine fared in another case: a failure outlasts everything, and one run counts as ran.
    pub fn join(&mut self, other: Self) {
        let weight = |s: Status| match s {
            Status::Skipped => 0,
            Status::Absent => 1,
            Status::Ran => 2,
            Status::Failed => 3,
        };
        self.wall_s += other.wall_s;
        if weight(other.status) > weight(self.status) {
            *self = Self { wall_s: self.wall_s, ..other };
        } else if other.status == Status::Failed {
            let reasons: Vec<String> = [self.reason.take(), other.reason].into_iter().flatten().collect();
            self.reason = Some(reasons.join("; "));
        }
    }
}

/// How an engine fared.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Status {
    /// Every job gave readings.
    Ran,
    /// It is not there.
    Absent,
    /// At least one job failed.
    Failed,
    /// It can do nothing that was asked.
    Skipped,
}

/// What an engine takes part for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Role {
    /// Others are judged by it: one of our own solvers. It always runs, and costs next to nothing.
    Witness,
    /// It is judged.
    #[default]
    Renderer,
}

/// How a reading came to nothing.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema, strum::Display)]
#[serde(rename_all = "snake_case")]
#[strum(serialize_all = "snake_case")]
pub enum FailureKind {
    /// The engine says that it cannot do such a job: a skip.
    Declined,
    /// It cannot do this one: a setting makes no sense to it, or its solver gave up.
    Refused,
    Nan,
    /// It ended with an error or was killed.
    Crash,
    Hang,
    /// It ended well and readings were missing.
    SilentLoss,
    /// It ended well, and what it printed is no answer.
    Garbled,
    Interrupted,
    /// It was not begun: the time for beginning was over.
    TimeUp,
    /// It was not asked for here: another process or machine is to read it.
    Unread,
}

impl FailureKind {
    /// Whether the engine was asked and has had its chance.
    pub const fn is_an_answer(self) -> bool {
        !matches!(self, Self::Interrupted | Self::TimeUp | Self::Unread)
    }
}
