//! Reading a report: its version and its checksum are checked.

use luxproof_model::REPORT_VERSION;
use std::borrow::Cow;
use std::io::{self, BufRead, BufReader, BufWriter, Read, Write};
use std::path::Path;

use serde::Deserialize;

use luxproof_model::{Report, Summary};
use luxproof_process::envelope;
use luxproof_process::files::{self, FileError};
use luxproof_process::printable::{JsonTexts, Quoted, quoted};

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
    #[error("is no report of luxproof: {}", quoted(&.0.to_string()))]
    Foreign(serde_json::Error),
    #[error("is damaged or was edited: {}; run its spec again, finished readings are in the cache", quoted(&.0.to_string()))]
    Damaged(serde_json::Error),
    #[error(
        "was edited, or is by a luxproof that wrote no checksums: its checksum is not that of what it says; run its spec again, finished \
         readings are in the cache"
    )]
    Edited,
    #[error(
        "is a report of version {found}, written by luxproof {}; this luxproof reads version {REPORT_VERSION}: view it with the luxproof \
         that wrote it, or run its spec again", Quoted(.by)
    )]
    Version { found: u32, by: String },
}

/// The first fields of a report of any version.
#[derive(Deserialize)]
struct Head {
    luxproof: u32,
    #[serde(default)]
    tool_version: String,
}

/// Reads a report from its text.
pub fn from_json(text: &str) -> Result<Report, ReportError> {
    from_text(text.as_bytes(), || Ok(text.as_bytes()))
}

/// Reads a report from a file, line by line: the text of a million comparisons is a GB.
pub fn read(path: &Path) -> Result<Report, ReadError> {
    let file = files::open_stored(path).map_err(|source| FileError::of(path, source))?;
    from_text(file, || files::open_stored(path)).map_err(|error| match error {
        ReportError::Foreign(source) | ReportError::Damaged(source) if source.is_io() => {
            FileError::of(path, io::Error::from(source)).into()
        }
        why => ReadError::Report { file: path.display().to_string(), why },
    })
}

/// Reads a report; `reopen` gives the same text again, to find out what was wrong with it.
fn from_text<R: BufRead>(text: R, reopen: impl FnOnce() -> io::Result<R>) -> Result<Report, ReportError> {
    let mut checksum = ContentChecksum::default();
    let texts = JsonTexts::new(&KEYS_OF_LINES);
    let lines = PrintableLines { text, checksum: &mut checksum, texts, line: vec![], read_bytes: 0 };
    // The reader is passed by value: through a reference every byte would cost a call.
    let mut report: Report = match serde_json::from_reader(BufReader::new(lines)) {
        Ok(report) => report,
        Err(source) if source.is_io() => return Err(ReportError::Damaged(source)),
        Err(source) => return Err(refusal(reopen, source)),
    };
    if report.luxproof != REPORT_VERSION {
        return Err(ReportError::Version { found: report.luxproof, by: report.tool_version });
    }
    if checksum.sum.finish() != report.checksum {
        return Err(ReportError::Edited);
    }
    report.summary = Summary::of(&report);
    Ok(report)
}

/// Sets the checksum of a report to that of its content.
pub(super) fn seal(report: &mut Report) -> io::Result<()> {
    report.checksum.clear();
    let mut checksum = BufWriter::new(ContentChecksum::default());
    serde_json::to_writer(&mut checksum, report)?;
    report.checksum = checksum.into_inner().map_err(io::IntoInnerError::into_error)?.sum.finish();
    Ok(())
}

/// Why a text that does not parse is no report: it is something else, damaged, or of another version.
fn refusal<R: BufRead>(reopen: impl FnOnce() -> io::Result<R>, source: serde_json::Error) -> ReportError {
    match reopen().map_err(serde_json::Error::io).and_then(serde_json::from_reader) {
        Err(foreign) => ReportError::Foreign(foreign),
        Ok(Head { luxproof: REPORT_VERSION, .. }) => ReportError::Damaged(source),
        Ok(Head { luxproof: found, tool_version: by }) => ReportError::Version { found, by },
    }
}

/// Reads a text line by line, adds each line to a checksum, and replaces what must not be printed.
///
/// A line is always complete JSON text, because no string contains a line feed.
struct PrintableLines<'a, R> {
    text: R,
    checksum: &'a mut ContentChecksum,
    texts: JsonTexts,
    line: Vec<u8>,
    /// Bytes of the line that were read.
    read_bytes: usize,
}

impl<R: BufRead> Read for PrintableLines<'_, R> {
    fn read(&mut self, into: &mut [u8]) -> io::Result<usize> {
        if self.read_bytes == self.line.len() {
            self.line.clear();
            self.read_bytes = 0;
            self.text.read_until(b'\n', &mut self.line)?;
            self.checksum.write_all(&self.line)?;
            let line = str::from_utf8(&self.line).map_err(|e| io::Error::new(io::ErrorKind::InvalidData, e))?;
            if let Cow::Owned(line) = self.texts.printable(line) {
                self.line = line.into_bytes();
            }
        }
        let read = (&self.line[self.read_bytes..]).read(into)?;
        self.read_bytes += read;
        Ok(read)
    }
}

/// The fields with texts of several lines: messages of programs. Names, titles and all else are one line.
const KEYS_OF_LINES: [&str; 4] = ["failure", "reason", "notes", "details"];

/// Fields with values that the checksum ignores, so that a repeated run has the same checksum.
const IGNORED_FIELDS: [&[u8]; 3] = [b"checksum", b"started", b"wall_s"];
/// The length of the longest of them.
const MAX_FIELD_LENGTH: usize = 8;

/// The checksum of a report's text without the values of [`IGNORED_FIELDS`].
#[derive(Default)]
struct ContentChecksum {
    sum: envelope::Checksum,
    /// The text since the last quotation mark, as far as it may be the name of an ignored field.
    word: Vec<u8>,
    is_quoted: bool,
    /// Whether the current bytes belong to the value of an ignored field.
    is_ignoring: bool,
}

impl Write for ContentChecksum {
    fn write(&mut self, text: &[u8]) -> io::Result<usize> {
        let mut start = 0;
        for (at, byte) in text.iter().enumerate() {
            match byte {
                b',' | b'}' if self.is_ignoring => {
                    self.is_ignoring = false;
                    start = at;
                }
                _ if self.is_ignoring => {}
                b'"' => {
                    if self.is_quoted && IGNORED_FIELDS.contains(&&*self.word) {
                        self.sum.update(&text[start..=at]);
                        self.is_ignoring = true;
                    }
                    self.is_quoted = !self.is_ignoring;
                    self.word.clear();
                }
                _ if self.word.len() <= MAX_FIELD_LENGTH => self.word.push(*byte),
                _ => {}
            }
        }
        if !self.is_ignoring {
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
        seal(&mut report).unwrap();
        serde_json::to_string(&report).unwrap()
    }

    #[test]
    fn a_report_comes_back_and_one_of_another_version_is_refused() {
        assert_eq!(from_json(&text(REPORT_VERSION)).unwrap().tool_version, "9.1");
        for version in [1, 3] {
            let expected =
                format!("is a report of version {version}, written by luxproof 9.1; this luxproof reads version 2");
            let error = error_of(&text(version));
            assert!(error.starts_with(&expected), "{error}");
        }
    }

    /// The checksum of a text that is written in these pieces.
    fn checksum_of(pieces: &[&str]) -> String {
        let mut checksum = ContentChecksum::default();
        for piece in pieces {
            checksum.write_all(piece.as_bytes()).unwrap();
        }
        checksum.sum.finish()
    }

    #[test]
    fn ignored_fields_are_ignored_wherever_the_text_is_cut() {
        let text = r#"{"checksum":"ab","a":[{"wall_s":1.5,"b":"started"}], "started" : "x","wall_s":2}"#;
        let kept = envelope::checksum(r#"{"checksum","a":[{"wall_s","b":"started"}],"started","wall_s"}"#);
        for at in 0..text.len() {
            assert_eq!(checksum_of(&[&text[..at], &text[at..]]), kept, "cut at {at}");
        }
        assert_ne!(checksum_of(&[&text.replace("\"b\"", "\"c\"")]), kept);
    }

    #[test]
    fn an_edited_report_is_refused_and_a_reformatted_one_is_not() {
        let sound = text(REPORT_VERSION);
        let value: serde_json::Value = serde_json::from_str(&sound).unwrap();
        assert!(from_json(&sound.replace("\":", "\" :\n  ")).is_ok());
        for edited in [
            sound.replace("\"9.1\"", "\"9.2\""),
            sound.replace("\"fail\":0", "\"fail\":3"),
            sound.replace(value["checksum"].as_str().unwrap(), ""),
        ] {
            assert_ne!(edited, sound);
            assert!(matches!(from_json(&edited), Err(ReportError::Edited)), "{edited}");
        }
    }

    fn error_of(text: &str) -> String {
        from_json(text).unwrap_err().to_string()
    }

    #[test]
    fn a_text_that_does_not_parse_is_refused_with_its_version() {
        let other = error_of(&text(1).replace("\"readings\"", "\"values\""));
        assert!(other.starts_with("is a report of version 1, written by luxproof 9.1;"), "{other}");
        assert!(error_of(&text(REPORT_VERSION).replace("\"readings\"", "\"values\"")).starts_with("is damaged"));
        assert!(error_of("{\"curves\": []}").starts_with("is no report of luxproof: missing field `luxproof`"));
        assert!(error_of(&text(REPORT_VERSION)[..40]).starts_with("is no report"));
    }
}
