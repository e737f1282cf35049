//! Reading a report back: its version is looked at, whatever else it holds.

use serde::Deserialize;

use super::{Report, Summary};

/// The version of the format that this program writes.
pub(super) const VERSION: u32 = 1;

/// A report as it was read.
#[derive(Clone, Debug, PartialEq)]
pub struct ReadReport {
    pub report: Report,
    /// What the user should know of it: another version, of which only what both have is seen, or counts that are not those of its
    /// verdicts, which are counted anew.
    pub doubt: Option<String>,
}

/// Why a text is no report; continues a sentence that starts with the file's name.
#[derive(Debug, thiserror::Error)]
pub enum ReportError {
    #[error("is no report of luxproof: {0}")]
    Foreign(serde_json::Error),
    #[error("is damaged or was edited: {0}; run its spec again, finished readings are in the cache")]
    Damaged(serde_json::Error),
    #[error(
        "is a report of version {found}, by luxproof {by}, where this one reads version {VERSION} ({source}); \
         view it with the luxproof that wrote it, or run its spec again"
    )]
    Version { found: u32, by: String, source: serde_json::Error },
}

/// What a report of any version says first.
#[derive(Deserialize)]
struct Head {
    luxproof: u32,
    #[serde(default)]
    tool_version: String,
}

impl Report {
    pub fn from_json(text: &str) -> Result<ReadReport, ReportError> {
        let mut report: Self = serde_json::from_str(text).map_err(|source| Self::refusal(text, source))?;
        let (found, told) = (report.luxproof, report.summary);
        report.summary = Summary::of(&report.comparisons, &report.skips);
        let doubt = if found != VERSION {
            Some(format!(
                "is a report of version {found} where this luxproof reads version {VERSION}: what it does not know it passes over"
            ))
        } else if told != report.summary {
            Some("was edited: its summary is not that of its verdicts, which are counted anew".to_owned())
        } else {
            None
        };
        Ok(ReadReport { report, doubt })
    }

    fn refusal(text: &str, source: serde_json::Error) -> ReportError {
        match serde_json::from_str(text) {
            Err(foreign) => ReportError::Foreign(foreign),
            Ok(Head { luxproof: VERSION, .. }) => ReportError::Damaged(source),
            Ok(Head { luxproof: found, tool_version: by }) => ReportError::Version { found, by, source },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn text(version: u32) -> String {
        serde_json::to_string(&Report { luxproof: version, tool_version: "9.1".into(), ..Report::default() }).unwrap()
    }

    #[test]
    fn a_report_comes_back_and_one_of_another_version_with_a_doubt() {
        let read = Report::from_json(&text(VERSION)).unwrap();
        assert_eq!((read.report.luxproof, read.doubt), (VERSION, None));
        let doubt = Report::from_json(&text(2)).unwrap().doubt.unwrap();
        assert!(doubt.starts_with("is a report of version 2 where this luxproof reads version 1"), "{doubt}");
    }

    #[test]
    fn verdicts_are_counted_anew() {
        let edited =
            Report { summary: Summary { fail: 3, ..Summary::default() }, luxproof: VERSION, ..Report::default() };
        let read = Report::from_json(&serde_json::to_string(&edited).unwrap()).unwrap();
        assert_eq!(read.report.summary, Summary::default());
        assert!(read.doubt.unwrap().starts_with("was edited"));
    }

    #[test]
    fn what_does_not_fit_is_refused_with_its_version() {
        let says = |text: &str| Report::from_json(text).unwrap_err().to_string();
        let other = says(&text(2).replace("\"readings\"", "\"values\""));
        assert!(other.starts_with("is a report of version 2, by luxproof 9.1, where"), "{other}");
        assert!(other.contains("missing field `readings`"), "{other}");
        assert!(says(&text(VERSION).replace("\"readings\"", "\"values\"")).starts_with("is damaged"));
        assert!(says("{\"curves\": []}").starts_with("is no report of luxproof: missing field `luxproof`"));
        assert!(says(&text(VERSION)[..40]).starts_with("is no report"));
    }
}
