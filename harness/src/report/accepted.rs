//! What holding a run against its baseline said, as every view tells it.

use itertools::Itertools;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::record::ReadingKey;

#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct BaselineCheck {
    pub file: String,
    /// One a case, procedure and engine of either side.
    pub entries: Vec<BaselineLine>,
}

/// How one engine in one procedure of one case compares with what was accepted.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct BaselineLine {
    #[serde(flatten)]
    pub key: ReadingKey,
    /// `unchanged`, `SHIFTED`, `CHANGED`, `VANISHED`, `new` or `REFUSED`.
    pub state: String,
    /// Whether it repeats what was accepted; what nobody accepted does not.
    pub is_as_accepted: bool,
    /// The mean shift, what moved, or why it is refused.
    pub details: Vec<String>,
}

impl BaselineCheck {
    pub fn is_as_accepted(&self) -> bool {
        self.entries.iter().all(|e| e.is_as_accepted)
    }

    pub(super) fn departures(&self) -> impl Iterator<Item = &BaselineLine> {
        self.entries.iter().filter(|e| !e.is_as_accepted)
    }

    /// How many entries are in which state: `4 unchanged, 1 REFUSED`.
    pub(super) fn counts(&self) -> String {
        let of = |state: &String| self.entries.iter().filter(|e| e.state == *state).count();
        let states = self.entries.iter().map(|e| &e.state).unique();
        let counts = states.map(|state| format!("{} {state}", of(state))).join(", ");
        if counts.is_empty() { "nothing to compare".to_owned() } else { counts }
    }
}
