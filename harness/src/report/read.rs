//! Reading a report back: its version is looked at, whatever else it holds, and its checksum.

use serde::Deserialize;

use super::{Report, Summary};
use crate::system::{envelope, printable};

/// The version of the format that this program writes.
pub(super) const VERSION: u32 = 1;

/// A report as it was read.
#[derive(Clone, Debug, PartialEq)]
pub struct ReadReport {
    pub report: Report,
    /// What the user should know of it: another version, of which only what both have is seen.
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
        "was edited, or is by a luxproof that wrote no checksums: its checksum is not that of what it says; run its spec again, finished \
         readings are in the cache"
    )]
    Edited,
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
        let mut report: Self =
            serde_json::from_str(&printable::json(text)).map_err(|source| Self::refusal(text, source))?;
        let found = report.luxproof;
        if found == VERSION && checksum(text) != report.checksum {
            return Err(ReportError::Edited);
        }
        report.summary = Summary::of(&report.comparisons, &report.skips);
        let doubt = (found != VERSION).then(|| {
            format!("is a report of version {found} where this luxproof reads version {VERSION}: what it does not know it passes over")
        });
        Ok(ReadReport { report, doubt })
    }

    /// Gives it the checksum of what it says now.
    pub(super) fn seal(&mut self) -> serde_json::Result<()> {
        self.checksum.clear();
        self.checksum = checksum(&serde_json::to_string(self)?);
        Ok(())
    }

    fn refusal(text: &str, source: serde_json::Error) -> ReportError {
        match serde_json::from_str(text) {
            Err(foreign) => ReportError::Foreign(foreign),
            Ok(Head { luxproof: VERSION, .. }) => ReportError::Damaged(source),
            Ok(Head { luxproof: found, tool_version: by }) => ReportError::Version { found, by, source },
        }
    }
}

/// That of a report's text but for times and the checksum that it names: the same run says the same tomorrow.
fn checksum(text: &str) -> String {
    const LEFT_OUT: [&str; 3] = ["\"checksum\"", "\"started\"", "\"wall_s\""];
    let without = |text: String, name: &&str| -> String {
        let mut parts = text.split(name);
        let first = parts.next().unwrap_or_default().to_owned();
        parts.fold(first, |kept, part| kept + name + &part[part.find([',', '}']).unwrap_or(part.len())..])
    };
    envelope::checksum(&LEFT_OUT.iter().fold(text.to_owned(), without))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn text(version: u32) -> String {
        let mut report = Report { luxproof: version, tool_version: "9.1".into(), ..Report::default() };
        report.seal().unwrap();
        serde_json::to_string(&report).unwrap()
    }

    #[test]
    fn a_report_comes_back_and_one_of_another_version_with_a_doubt() {
        let read = Report::from_json(&text(VERSION)).unwrap();
        assert_eq!((read.report.luxproof, read.doubt), (VERSION, None));
        let doubt = Report::from_json(&text(2)).unwrap().doubt.unwrap();
        assert!(doubt.starts_with("is a report of version 2 where this luxproof reads version 1"), "{doubt}");
    }

    #[test]
    fn what_was_edited_is_refused_and_what_is_laid_out_anew_is_not() {
        let sound = text(VERSION);
        let value: serde_json::Value = serde_json::from_str(&sound).unwrap();
        assert!(Report::from_json(&sound.replace("\":", "\" :\n  ")).is_ok());
        for edited in [
            sound.replace("\"9.1\"", "\"9.2\""),
            sound.replace("\"fail\":0", "\"fail\":3"),
            sound.replace(value["checksum"].as_str().unwrap(), ""),
        ] {
            assert_ne!(edited, sound);
            assert!(matches!(Report::from_json(&edited), Err(ReportError::Edited)), "{edited}");
        }
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
