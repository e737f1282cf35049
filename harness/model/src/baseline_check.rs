//! The comparison of a run with its baseline, as every view shows it.

use itertools::Itertools;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::ReadingKey;

/// The comparison of a run with its baseline.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct BaselineCheck {
    pub file: String,
    /// One entry for each case, procedure and engine of either side.
    pub entries: Vec<BaselineLine>,
}

/// The comparison of one engine in one procedure of one case with its accepted readings.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct BaselineLine {
    #[serde(flatten)]
    pub key: ReadingKey,
    /// `unchanged`, `SHIFTED`, `CHANGED`, `IMPROVED`, `VANISHED`, `new` or `REFUSED`.
    pub state: String,
    /// Whether it repeats accepted readings; false where none were accepted.
    pub is_as_accepted: bool,
    /// The mean shift, its cause, the meters that changed, or why the comparison is refused.
    pub details: Vec<String>,
    /// The version and settings of the engine that differ: `version: 1.0 before, 1.1 now`.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub instrument: Vec<String>,
}

impl BaselineLine {
    /// Everything that a view shows of the entry.
    pub fn lines(&self) -> impl Iterator<Item = &str> {
        self.details.iter().chain(&self.instrument).map(String::as_str)
    }
}

impl BaselineCheck {
    pub fn is_as_accepted(&self) -> bool {
        self.entries.iter().all(|e| e.is_as_accepted)
    }

    /// The entries that differ from the accepted readings.
    pub fn differences(&self) -> impl Iterator<Item = &BaselineLine> {
        self.entries.iter().filter(|e| !e.is_as_accepted)
    }

    /// The number of entries in each state: `4 unchanged, 1 REFUSED`.
    pub fn counts(&self) -> String {
        let states = self.entries.iter().map(|entry| &entry.state);
        let numbers = states.clone().counts();
        let counts = states.unique().map(|state| format!("{} {state}", numbers[state])).join(", ");
        if counts.is_empty() { "nothing to compare".to_owned() } else { counts }
    }

    /// Versions and settings that differ without effect on the readings, each once: `mine version: 1.0 before, 1.1 now`.
    pub fn differences_within_noise(&self) -> Vec<String> {
        let unchanged = self.entries.iter().filter(|e| e.is_as_accepted);
        unchanged
            .flat_map(|e| e.instrument.iter().map(move |other| format!("{} {other}", e.key.engine)))
            .unique()
            .collect()
    }

    /// Why the baseline fails a run: the states, and the first departure with its size and cause.
    pub fn reason(&self) -> Option<String> {
        let first = self.differences().next()?;
        let details = first.details.iter().take(2).join("; ");
        let (key, counts) = (&first.key, self.counts());
        let place = format!("{} {} {}", key.case, key.procedure, key.engine);
        Some(format!("the run differs from its baseline {}: {counts} (first {place}: {details})", self.file))
    }
}
