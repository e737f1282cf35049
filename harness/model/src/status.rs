//! The role of an engine and its status in a run.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{EngineName, Exit};

/// An engine in a run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct EngineStatus {
    /// The engine's name.
    pub id: EngineName,
    /// Its version, where it is installed.
    pub version: Option<String>,
    /// The release of a default installation, such as `1.3.1` of `radiance`; a release in the name is not repeated.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub release: Option<String>,
    /// The package that it was installed from, such as `pyradiance 1.3.1`: the program's own version may be another.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub package: Option<String>,
    /// Whether it is judged or a reference.
    #[serde(default)]
    pub role: Role,
    /// Hash of all that it runs: programs, libraries, packages, sources.
    #[serde(default)]
    pub fingerprint: Option<String>,
    pub status: Status,
    /// Whether it was requested by name, so that its absence is an error.
    #[serde(default)]
    pub is_required: bool,
    /// Why it did not run.
    pub reason: Option<String>,
    /// Wall-clock seconds over all procedures.
    pub wall_s: f64,
    /// The number of its colour and mark in plots, which is fixed for a built-in engine.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub mark: Option<usize>,
}

impl EngineStatus {
    /// Adds the status of the same engine in another case. A failure outweighs everything, and a single run counts as ran.
    pub fn join(&mut self, other: Self) {
        self.wall_s += other.wall_s;
        if other.status.weight() > self.status.weight() {
            *self = Self { wall_s: self.wall_s, ..other };
        } else if other.status == Status::Failed {
            let reasons: Vec<String> = [self.reason.take(), other.reason].into_iter().flatten().collect();
            self.reason = Some(reasons.join("; "));
        }
    }
}

impl EngineStatus {
    /// The exit code for this engine alone.
    pub(crate) const fn exit(&self) -> Exit {
        match self.status {
            Status::Failed => Exit::Engine,
            Status::Absent if self.is_required => Exit::Engine,
            _ => Exit::Passed,
        }
    }
}

/// The status of an engine in a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Status {
    /// Every job gave readings.
    Ran,
    /// It is not installed.
    Absent,
    /// At least one job failed.
    Failed,
    /// It supports nothing that was requested.
    Skipped,
}

impl Status {
    /// The status with the larger weight counts for several cases.
    const fn weight(self) -> u8 {
        match self {
            Self::Skipped => 0,
            Self::Absent => 1,
            Self::Ran => 2,
            Self::Failed => 3,
        }
    }
}

/// The role of an engine.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Role {
    /// A reference: one of our solvers. It always runs, and costs little.
    Reference,
    /// It is judged.
    #[default]
    Renderer,
    /// Values that somebody published or measured: judged, never run, and never a reference, a witness or a baseline.
    Recorded,
}

impl Role {
    /// Whether its readings are judged. A run without a judged reading audits nothing.
    pub const fn is_judged(self) -> bool {
        matches!(self, Self::Renderer | Self::Recorded)
    }
}

/// Why there is no reading.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema, strum::Display)]
#[serde(rename_all = "snake_case")]
#[strum(serialize_all = "snake_case")]
pub enum FailureKind {
    /// The engine does not support such a job: a skip.
    Declined,
    /// It rejects this job: a setting is invalid for it, or its solver gave up.
    Refused,
    Nan,
    /// It ended with an error code and a message.
    ErrorExit,
    /// It was killed, or ended with an error and no message.
    Crash,
    Hang,
    /// It ended normally without all readings.
    SilentLoss,
    /// It ended normally, and its output is not readable.
    Garbled,
    Interrupted,
    /// It was not started, because the time limit had passed.
    TimeUp,
    /// It was not requested here: another process or machine will read it.
    Unread,
}

impl FailureKind {
    /// Whether the engine had the chance to answer.
    pub const fn is_an_answer(self) -> bool {
        !matches!(self, Self::Interrupted | Self::TimeUp | Self::Unread)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::engine;

    fn because(status: Status, reason: &str) -> EngineStatus {
        EngineStatus { reason: Some(reason.to_owned()), ..engine("radiance", status) }
    }

    #[test]
    fn of_several_cases_the_gravest_status_counts_and_times_add_up() {
        let by_weight = [Status::Skipped, Status::Absent, Status::Ran, Status::Failed];
        for (k, one) in by_weight.into_iter().enumerate() {
            for (n, other) in by_weight.into_iter().enumerate().filter(|(n, _)| *n != k) {
                let mut all = because(one, "one");
                all.join(EngineStatus { wall_s: 4.0, ..because(other, "other") });
                let (status, reason) = if n > k { (other, "other") } else { (one, "one") };
                assert_eq!((all.status, all.reason.as_deref(), all.wall_s), (status, Some(reason), 5.0));
            }
        }
        // Of two failures both reasons are named; otherwise the first stays.
        let mut all = because(Status::Failed, "a crash");
        all.join(because(Status::Failed, "a hang"));
        assert_eq!(all.reason.as_deref(), Some("a crash; a hang"));
        let mut all = because(Status::Skipped, "one");
        all.join(because(Status::Skipped, "other"));
        assert_eq!(all.reason.as_deref(), Some("one"));
    }

    #[test]
    fn an_engine_that_failed_or_is_required_and_absent_is_an_error() {
        for (status, is_required, exit) in [
            (Status::Failed, false, Exit::Engine),
            (Status::Absent, true, Exit::Engine),
            (Status::Absent, false, Exit::Passed),
            (Status::Ran, true, Exit::Passed),
            (Status::Skipped, true, Exit::Passed),
        ] {
            assert_eq!(EngineStatus { is_required, ..engine("radiance", status) }.exit(), exit, "{status:?}");
        }
    }

    #[test]
    fn references_are_not_judged_and_an_interruption_is_no_answer() {
        assert_eq!([Role::Reference, Role::Renderer, Role::Recorded].map(Role::is_judged), [false, true, true]);
        let silent = [FailureKind::Interrupted, FailureKind::TimeUp, FailureKind::Unread];
        assert!(silent.iter().all(|kind| !kind.is_an_answer()));
        assert!(FailureKind::Declined.is_an_answer() && FailureKind::Hang.is_an_answer());
    }
}
