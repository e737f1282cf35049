//! Reading a report back: its version is looked at, whatever else it holds, and its checksum.

use std::borrow::Cow;
use std::io::{self, BufRead, BufReader, BufWriter, Read, Write};
use std::path::Path;

use serde::Deserialize;

use super::{Report, Summary};
use crate::system::files::{self, FileError};
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

/// Why a file gives no report.
#[derive(Debug, thiserror::Error)]
pub enum ReadError {
    #[error(transparent)]
    File(#[from] FileError),
    #[error("{file} {why}")]
    Report { file: String, why: ReportError },
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
        Self::from_text(text.as_bytes(), || Ok(text.as_bytes()))
    }

    /// That of a file, which is never held as a text: of a million comparisons that is a GB.
    pub fn read(path: &Path) -> Result<ReadReport, ReadError> {
        let fail = |error: io::Error| FileError::of(path, error);
        let file = files::open_kept(path).map_err(fail)?;
        Self::from_text(file, || files::open_kept(path)).map_err(|source| match source {
            ReportError::Foreign(error) | ReportError::Damaged(error) if error.is_io() => fail(error.into()).into(),
            why => ReadError::Report { file: path.display().to_string(), why },
        })
    }

    /// `again` gives the same text, from which it is told what was wrong.
    fn from_text<R: BufRead>(text: R, again: impl FnOnce() -> io::Result<R>) -> Result<ReadReport, ReportError> {
        let mut said = Said::default();
        let lines = Lines { text, said: &mut said, shown: vec![], at: 0 };
        // By value: read through a reference, every byte costs a call.
        let mut report: Self = match serde_json::from_reader(BufReader::new(lines)) {
            Ok(report) => report,
            Err(source) if source.is_io() => return Err(ReportError::Damaged(source)),
            Err(source) => return Err(Self::refusal(again, source)),
        };
        let found = report.luxproof;
        if found == VERSION && said.sum.finish() != report.checksum {
            return Err(ReportError::Edited);
        }
        report.summary = Summary::of(&report.comparisons, &report.skips);
        let doubt = (found != VERSION).then(|| {
            format!("is a report of version {found} where this luxproof reads version {VERSION}: what it does not know it passes over")
        });
        Ok(ReadReport { report, doubt })
    }

    /// Gives it the checksum of what it says now.
    pub(super) fn seal(&mut self) -> io::Result<()> {
        self.checksum.clear();
        let mut said = BufWriter::new(Said::default());
        serde_json::to_writer(&mut said, self)?;
        self.checksum = said.into_inner().map_err(io::IntoInnerError::into_error)?.sum.finish();
        Ok(())
    }

    fn refusal<R: BufRead>(again: impl FnOnce() -> io::Result<R>, source: serde_json::Error) -> ReportError {
        match again().map_err(serde_json::Error::io).and_then(serde_json::from_reader) {
            Err(foreign) => ReportError::Foreign(foreign),
            Ok(Head { luxproof: VERSION, .. }) => ReportError::Damaged(source),
            Ok(Head { luxproof: found, tool_version: by }) => ReportError::Version { found, by, source },
        }
    }
}

/// The lines of a text as they may be shown, summed up as they stand there. No line ends within a string of JSON.
struct Lines<'a, R> {
    text: R,
    said: &'a mut Said,
    shown: Vec<u8>,
    /// What of them was given out.
    at: usize,
}

impl<R: BufRead> Read for Lines<'_, R> {
    fn read(&mut self, into: &mut [u8]) -> io::Result<usize> {
        if self.at == self.shown.len() {
            self.shown.clear();
            self.at = 0;
            self.text.read_until(b'\n', &mut self.shown)?;
            self.said.write_all(&self.shown)?;
            let line = str::from_utf8(&self.shown).map_err(|e| io::Error::new(io::ErrorKind::InvalidData, e))?;
            if let Cow::Owned(line) = printable::json(line) {
                self.shown = line.into_bytes();
            }
        }
        let read = (&self.shown[self.at..]).read(into)?;
        self.at += read;
        Ok(read)
    }
}

/// What no checksum of a report is about: the same run says the same tomorrow.
const LEFT_OUT: [&[u8]; 3] = [b"checksum", b"started", b"wall_s"];
/// As long as the longest of them.
const LONGEST: usize = 8;

/// The checksum of a report's text but for times and the checksum that it names.
#[derive(Default)]
struct Said {
    sum: envelope::Checksum,
    /// What stands since the last quotation mark, as far as it may be one of those names.
    word: Vec<u8>,
    is_quoted: bool,
    /// Whether a value of such a name is under way.
    is_left_out: bool,
}

impl Write for Said {
    fn write(&mut self, text: &[u8]) -> io::Result<usize> {
        let mut start = 0;
        for (at, byte) in text.iter().enumerate() {
            match byte {
                b',' | b'}' if self.is_left_out => {
                    self.is_left_out = false;
                    start = at;
                }
                _ if self.is_left_out => {}
                b'"' => {
                    if self.is_quoted && LEFT_OUT.contains(&&*self.word) {
                        self.sum.update(&text[start..=at]);
                        self.is_left_out = true;
                    }
                    self.is_quoted = !self.is_left_out;
                    self.word.clear();
                }
                _ if self.word.len() <= LONGEST => self.word.push(*byte),
                _ => {}
            }
        }
        if !self.is_left_out {
            self.sum.update(&text[start..]);
        }
        Ok(text.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
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
    fn what_a_checksum_leaves_out_is_left_out_wherever_the_text_is_cut() {
        let sum = |pieces: &[&str]| {
            let mut said = Said::default();
            for piece in pieces {
                said.write_all(piece.as_bytes()).unwrap();
            }
            said.sum.finish()
        };
        let text = r#"{"checksum":"ab","a":[{"wall_s":1.5,"b":"started"}], "started" : "x","wall_s":2}"#;
        let kept = envelope::checksum(r#"{"checksum","a":[{"wall_s","b":"started"}],"started","wall_s"}"#);
        for at in 0..text.len() {
            assert_eq!(sum(&[&text[..at], &text[at..]]), kept, "cut at {at}");
        }
        assert_ne!(sum(&[&text.replace("\"b\"", "\"c\"")]), kept);
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
