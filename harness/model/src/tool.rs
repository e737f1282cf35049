//! The version of luxproof, and the commit that it was built from where that is known.

use std::fmt;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The program that wrote a report.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct Tool {
    pub version: String,
    /// Null where the sources name none, as in an archive without its notes.
    pub commit: Option<String>,
    /// Whether sources of the program differed from the commit; null where there is none.
    pub dirty: Option<bool>,
}

/// Digits of a commit that are shown.
const SHORT_COMMIT_DIGITS: usize = 12;

/// `0.1.0 (1a2b3c4d5e6f, with changes)`.
impl fmt::Display for Tool {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.version)?;
        let Some(commit) = &self.commit else { return Ok(()) };
        let short: String = commit.chars().take(SHORT_COMMIT_DIGITS).collect();
        let changes = if self.dirty == Some(true) { ", with changes" } else { "" };
        write!(f, " ({short}{changes})")
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    #[test]
    fn a_version_has_the_first_digits_of_its_commit() {
        let plain = Tool { version: "0.1.0".to_owned(), ..Tool::default() };
        assert_eq!(plain.to_string(), "0.1.0");
        let built = Tool { commit: Some("1a2b3c4d5e6f7a8b".to_owned()), dirty: Some(false), ..plain };
        assert_eq!(built.to_string(), "0.1.0 (1a2b3c4d5e6f)");
        assert_eq!(Tool { dirty: Some(true), ..built.clone() }.to_string(), "0.1.0 (1a2b3c4d5e6f, with changes)");
        assert_eq!(Tool { dirty: None, ..built }.to_string(), "0.1.0 (1a2b3c4d5e6f)");
    }
}
