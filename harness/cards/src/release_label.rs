//! The label of a release in the columns of a renderer.

use std::cmp::Ordering;
use std::fmt;

use luxproof_model::{EngineName, EngineStatus, Release};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The release of an engine: that of its name, as of `mitsuba@3.5.2`, that of its installation, or else its version.
///
/// Sorts by release.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize, Deserialize, JsonSchema)]
#[serde(transparent)]
pub struct ReleaseLabel(String);

impl ReleaseLabel {
    /// The label of an engine of a run.
    pub fn of(status: &EngineStatus) -> Self {
        Self::new(&status.id, status.release.as_deref(), status.version.as_deref())
    }

    fn new(engine: &EngineName, release: Option<&str>, version: Option<&str>) -> Self {
        let named = engine.release().map(|release| release.to_string()).or_else(|| release.map(str::to_owned));
        let version = version.map(|version| number(version).map_or_else(|| version.to_owned(), |n| n.to_string()));
        Self(named.or(version).unwrap_or_else(|| "unknown".to_owned()))
    }

    pub fn as_str(&self) -> &str {
        &self.0
    }

    fn release(&self) -> Option<Release> {
        self.0.parse().ok()
    }
}

/// The first word of a version that is a release number: `3.9.1` of `mitsuba 3.9.1 (scalar_rgb)`.
fn number(version: &str) -> Option<Release> {
    let mut words = version.split(|c: char| c.is_whitespace() || matches!(c, ',' | ';' | '(' | ')'));
    words.find(|word| word.contains('.') && word.contains(|c: char| c.is_ascii_digit())).and_then(|word| {
        let word = word.strip_prefix(['v', 'V']).unwrap_or(word);
        word.parse().ok()
    })
}

impl Ord for ReleaseLabel {
    fn cmp(&self, other: &Self) -> Ordering {
        // What is no release sorts first: nothing says when it was made.
        self.release().cmp(&other.release()).then_with(|| self.0.cmp(&other.0))
    }
}

impl PartialOrd for ReleaseLabel {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl fmt::Display for ReleaseLabel {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn label(engine: &str, version: &str) -> ReleaseLabel {
        ReleaseLabel::new(&EngineName::from(engine), None, Some(version))
    }

    #[test]
    fn the_name_comes_before_the_version_and_both_give_one_label() {
        assert_eq!(label("mitsuba@3.5.2", "mitsuba 3.5.2").as_str(), "3.5.2");
        assert_eq!(label("mitsuba", "mitsuba 3.9.1 (scalar_rgb)"), label("mitsuba@3.9.1", "3.9.1"));
        assert_eq!(label("iray", "recorded, 2016").as_str(), "recorded, 2016");
        assert_eq!(ReleaseLabel::new(&EngineName::from("x"), None, None).as_str(), "unknown");
        let installed = ReleaseLabel::new(&EngineName::from("radiance"), Some("1.3.1"), Some("6.0a"));
        assert_eq!(installed, label("radiance@1.3.1", "6.0a"));
    }

    #[test]
    fn labels_stand_in_the_order_of_releases() {
        let labels = ["unknown version", "3.5.2", "3.9.1", "3.10.0"].map(|v| label("m", v));
        assert!(labels.is_sorted(), "{labels:?}");
    }
}
