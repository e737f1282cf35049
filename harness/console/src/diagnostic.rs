//! Draws errors of specs: each message with its place, and the line of the file with a mark.

use std::fmt;

use miette::{Diagnostic, LabeledSpan, NamedSource, Report, Severity, SourceCode, SourceSpan};

use crate::complain_of;
use luxproof_process::files::{MAX_BYTES, read_bounded};
use luxproof_process::printable::{is_unprintable, line, message};
use luxproof_spec::{Faults, SpecError};

/// Any error in the form that miette draws: printable, and of a length that a person can read.
#[derive(Debug)]
pub(crate) struct DrawnError {
    message: String,
    cause: Option<Box<DrawnCause>>,
    help: Option<String>,
    /// The error itself: of its excerpts and parts each is made printable where it is made.
    error: Report,
}

/// A cause of an error, and its own cause.
#[derive(Debug)]
struct DrawnCause {
    message: String,
    cause: Option<Box<Self>>,
}

impl From<Report> for DrawnError {
    fn from(error: Report) -> Self {
        let causes: Vec<String> =
            error.chain().skip(1).take(MAX_CAUSES).map(|cause| message(&cause.to_string())).collect();
        let cause = causes.into_iter().rfold(None, |cause, message| Some(Box::new(DrawnCause { message, cause })));
        let help = error.help().map(|help| message(&help.to_string()));
        Self { message: message(&error.to_string()), cause, help, error }
    }
}

/// The most causes of an error that are shown.
const MAX_CAUSES: usize = 20;

impl fmt::Display for DrawnError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.message)
    }
}

impl std::error::Error for DrawnError {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        self.cause.as_deref().map(|cause| cause as _)
    }
}

impl fmt::Display for DrawnCause {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.message)
    }
}

impl std::error::Error for DrawnCause {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        self.cause.as_deref().map(|cause| cause as _)
    }
}

impl Diagnostic for DrawnError {
    fn severity(&self) -> Option<Severity> {
        self.error.severity()
    }

    fn help<'a>(&'a self) -> Option<Box<dyn fmt::Display + 'a>> {
        self.help.as_ref().map(|help| Box::new(help) as Box<dyn fmt::Display>)
    }

    fn source_code(&self) -> Option<&dyn SourceCode> {
        self.error.source_code()
    }

    fn labels(&self) -> Option<Box<dyn Iterator<Item = LabeledSpan> + '_>> {
        self.error.labels()
    }

    fn related<'a>(&'a self) -> Option<Box<dyn Iterator<Item = &'a dyn Diagnostic> + 'a>> {
        self.error.related()
    }
}

/// A fault in the form that miette draws.
#[derive(Debug)]
struct DrawnFault {
    message: String,
    help: Option<String>,
    severity: Severity,
    /// The text of the file and the marked word in it.
    excerpt: Option<(NamedSource<String>, SourceSpan)>,
}

impl fmt::Display for DrawnFault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.message)
    }
}

impl std::error::Error for DrawnFault {}

impl Diagnostic for DrawnFault {
    fn severity(&self) -> Option<Severity> {
        Some(self.severity)
    }

    fn help<'a>(&'a self) -> Option<Box<dyn fmt::Display + 'a>> {
        self.help.as_ref().map(|help| Box::new(help) as Box<dyn fmt::Display>)
    }

    fn source_code(&self) -> Option<&dyn SourceCode> {
        self.excerpt.as_ref().map(|(text, _)| text as &dyn SourceCode)
    }

    fn labels(&self) -> Option<Box<dyn Iterator<Item = LabeledSpan> + '_>> {
        let (_, span) = self.excerpt.as_ref()?;
        Some(Box::new(std::iter::once(LabeledSpan::new_with_span(Some("here".to_owned()), *span))))
    }
}

/// Several faults, each with its excerpt.
#[derive(Debug)]
struct DrawnFaults {
    faults: Vec<DrawnFault>,
    may_be_more: bool,
}

impl fmt::Display for DrawnFaults {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let rest = if self.may_be_more { ", and no more are listed" } else { "" };
        write!(f, "{} faults{rest}", self.faults.len())
    }
}

impl std::error::Error for DrawnFaults {}

impl Diagnostic for DrawnFaults {
    fn severity(&self) -> Option<Severity> {
        Some(Severity::Error)
    }

    fn related<'a>(&'a self) -> Option<Box<dyn Iterator<Item = &'a dyn Diagnostic> + 'a>> {
        Some(Box::new(self.faults.iter().map(|fault| fault as &dyn Diagnostic)))
    }
}

/// The report of one fault or of several.
pub fn diagnose(faults: impl Into<Faults>) -> Report {
    let faults = faults.into();
    let mut drawn: Vec<DrawnFault> =
        faults.all().iter().map(|fault| DrawnFault::from_error(fault, Severity::Error)).collect();
    match drawn.pop() {
        Some(only) if drawn.is_empty() => Report::new(only),
        last => {
            drawn.extend(last);
            Report::new(DrawnFaults { faults: drawn, may_be_more: faults.may_be_more() })
        }
    }
}

/// Prints the lints of specs on standard error.
pub fn warn(lints: &[SpecError]) {
    for lint in lints {
        complain_of(Report::new(DrawnFault::from_error(lint, Severity::Warning)));
    }
}

impl DrawnFault {
    /// Reads the line of an error from its file.
    fn from_error(error: &SpecError, severity: Severity) -> Self {
        let name = one_line(&error.file.display().to_string());
        let is_shown = error.line.is_some() && !error.is_withheld;
        let bytes = is_shown.then(|| read_bounded(&error.file, MAX_BYTES).ok()).flatten();
        let text = bytes.map(|bytes| printable_text(&bytes));
        // A very long line does not fit any terminal, and miette cannot lay it out.
        let text = text.filter(|text| text.lines().all(|line| line.len() <= MAX_LINE_BYTES));
        let place = match (error.line, error.column) {
            (Some(line), Some(column)) => format!("{name}:{line}:{column}"),
            (Some(line), None) => format!("{name}:{line}"),
            _ => name.clone(),
        };
        let excerpt = text.and_then(|text| {
            let span = span(&text, error.line?, error.column.unwrap_or(1))?;
            Some((NamedSource::new(name, text), span))
        });
        let help = error.help.as_deref().filter(|help| !help.is_empty()).map(one_line);
        Self { message: format!("{place}: {}", one_line(&error.message)), help, severity, excerpt }
    }
}

/// The longest line of a file that is drawn, in bytes.
const MAX_LINE_BYTES: usize = 2000;
/// The text of a file with replacements for unprintable characters.
fn printable_text(bytes: &[u8]) -> String {
    let text = String::from_utf8_lossy(bytes);
    let text = text.trim_start_matches('\u{feff}').replace("\r\n", "\n");
    // Each character is replaced by one, so that columns stay valid.
    let is_replaced = |c: char| is_unprintable(c) && c != '\n' && c != '\t';
    text.replace(is_replaced, &char::REPLACEMENT_CHARACTER.to_string())
}

/// A message about a spec, which quotes it: one printable line of limited length.
fn one_line(text: &str) -> String {
    message(&line(text, usize::MAX))
}

/// The byte range of the word at a line and a column, both counted from 1.
fn span(text: &str, line: usize, column: usize) -> Option<SourceSpan> {
    let start_of_line = text.split_inclusive('\n').take(line.checked_sub(1)?).map(str::len).sum::<usize>();
    let rest = text.get(start_of_line..)?.lines().next()?;
    let (offset, _) = rest.char_indices().nth(column.checked_sub(1)?).unwrap_or((rest.len(), ' '));
    let word = rest[offset..].find([' ', ',', ']', '}', ':']).unwrap_or(rest.len() - offset).max(1);
    Some((start_of_line + offset, word.min((rest.len() - offset).max(1))).into())
}
