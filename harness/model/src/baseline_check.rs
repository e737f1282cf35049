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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ProcedureId;

    fn line(engine: &str, state: &str, is_as_accepted: bool, details: &[&str], instrument: &[&str]) -> BaselineLine {
        BaselineLine {
            key: ReadingKey::new("room", ProcedureId::DirectIlluminance, engine),
            state: state.to_owned(),
            is_as_accepted,
            details: details.iter().map(|text| (*text).to_owned()).collect(),
            instrument: instrument.iter().map(|text| (*text).to_owned()).collect(),
        }
    }

    fn check(entries: Vec<BaselineLine>) -> BaselineCheck {
        BaselineCheck { file: "baseline.json".to_owned(), entries }
    }

    #[test]
    fn a_check_is_as_accepted_if_every_entry_is_and_else_names_the_first_departure() {
        let version = "version: 1.0 before, 1.1 now";
        let quiet = line("mine", "unchanged", true, &[], &[version]);
        let moved =
            line("radiance", "SHIFTED", false, &["by 3 %", "at desk[0]", "and at desk[1]"], &["version: 6 before"]);
        assert_eq!(moved.lines().collect_vec(), ["by 3 %", "at desk[0]", "and at desk[1]", "version: 6 before"]);
        let sound = check(vec![quiet.clone(), quiet.clone()]);
        assert!(sound.is_as_accepted() && sound.reason().is_none() && sound.differences().next().is_none());
        assert_eq!(sound.counts(), "2 unchanged");
        assert_eq!(sound.differences_within_noise(), [format!("mine {version}")]);
        let mixed = check(vec![quiet.clone(), moved.clone(), quiet]);
        assert!(!mixed.is_as_accepted());
        assert_eq!(mixed.differences().collect_vec(), [&moved]);
        assert_eq!(mixed.counts(), "2 unchanged, 1 SHIFTED");
        // What differs beyond the noise is no difference within it.
        assert_eq!(mixed.differences_within_noise(), [format!("mine {version}")]);
        let reason = mixed.reason().unwrap();
        assert_eq!(
            reason,
            "the run differs from its baseline baseline.json: 2 unchanged, 1 SHIFTED (first room direct_illuminance radiance: by 3 %; at desk[0])"
        );
        assert_eq!(check(vec![]).counts(), "nothing to compare");
    }
}
