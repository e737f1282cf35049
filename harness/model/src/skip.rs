//! Skips: jobs or parts of jobs that were not run, and why.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::{EngineName, ReadingKey};

/// A job or a part of it that is not run, with its reason.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct Skip {
    #[serde(flatten)]
    pub key: ReadingKey,
    /// How much is skipped.
    pub scope: Scope,
    pub reason: String,
    /// The saving, where there is one.
    pub saved: Option<String>,
    /// The kind of reason; `other` in older reports.
    #[serde(default, skip_serializing_if = "SkipCause::is_other")]
    pub cause: SkipCause,
}

/// The kind of a skip's reason.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum SkipCause {
    /// The engine cannot do such a job.
    Unsupported,
    /// The engine is not installed.
    Absent,
    #[default]
    Other,
}

impl SkipCause {
    #[allow(clippy::trivially_copy_pass_by_ref, reason = "serde asks for it")]
    fn is_other(&self) -> bool {
        *self == Self::Other
    }
}

impl Skip {
    /// A skip that saves nothing.
    pub fn new(key: ReadingKey, scope: Scope, reason: impl Into<String>) -> Self {
        Self { key, scope, reason: reason.into(), saved: None, cause: SkipCause::Other }
    }

    /// The skip with the kind of its reason.
    #[must_use]
    pub fn because(self, cause: SkipCause) -> Self {
        Self { cause, ..self }
    }

    /// The skip with its saving.
    #[must_use]
    pub fn saving(self, saved: impl Into<String>) -> Self {
        Self { saved: Some(saved.into()), ..self }
    }
}

/// How much is skipped.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Scope {
    Engine,
    /// One procedure of an engine.
    Procedure,
    Meter,
    /// One kind of light path.
    LightPath,
}

impl Scope {
    /// Whether nothing is read. Skipped meters and light paths have readings that follow from others.
    pub const fn leaves_no_reading(self) -> bool {
        matches!(self, Self::Engine | Self::Procedure)
    }
}

/// The name for all engines in skips that concern every engine.
pub const EVERYONE: EngineName = EngineName::new("all");

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ProcedureId;

    #[test]
    fn a_skip_has_its_cause_and_its_saving() {
        let key = ReadingKey::new("room", ProcedureId::DirectIlluminance, "radiance");
        let plain = Skip::new(key, Scope::Meter, "by symmetry");
        assert_eq!((plain.saved.as_deref(), plain.cause), (None, SkipCause::Other));
        let saving = plain.clone().saving("4 of 12 points");
        assert_eq!((saving.saved.as_deref(), saving.reason.as_str()), (Some("4 of 12 points"), "by symmetry"));
        let absent = plain.clone().because(SkipCause::Absent);
        assert_eq!((absent.cause, &absent.key), (SkipCause::Absent, &plain.key));
        // The usual cause is not written.
        let [plain, absent] = [plain, absent].map(|skip| serde_json::to_string(&skip).unwrap());
        assert!(!plain.contains("cause") && absent.contains(r#""cause":"absent""#), "{plain} {absent}");
    }

    #[test]
    fn meters_and_light_paths_have_readings_that_follow_from_others() {
        let all = [Scope::Engine, Scope::Procedure, Scope::Meter, Scope::LightPath];
        assert_eq!(all.map(Scope::leaves_no_reading), [true, true, false, false]);
    }
}
