//! Which luxproof this is: its version, and the commit that it was built from where that is known.

use std::fmt;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct Tool {
    pub version: String,
    /// Null where the sources told none, as those of an archive without its notes.
    pub commit: Option<String>,
    /// Whether sources of the program differed from the commit; null where there is none.
    pub dirty: Option<bool>,
}

impl Tool {
    /// The running program, as `build.rs` found its sources.
    pub fn this() -> Self {
        let commit = Some(env!("LUXPROOF_COMMIT")).filter(|commit| !commit.is_empty());
        Self {
            version: env!("CARGO_PKG_VERSION").to_owned(),
            commit: commit.map(str::to_owned),
            dirty: commit.map(|_| env!("LUXPROOF_DIRTY") == "true"),
        }
    }
}

/// `0.1.0 (1a2b3c4d5e6f, with changes)`.
impl fmt::Display for Tool {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.version)?;
        let Some(commit) = &self.commit else { return Ok(()) };
        let short: String = commit.chars().take(12).collect();
        let changes = if self.dirty == Some(true) { ", with changes" } else { "" };
        write!(f, " ({short}{changes})")
    }
}
