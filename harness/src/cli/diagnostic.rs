//! Errors for people: each message with the line that it is about, underlined; of several every one, by file and place.

use std::fmt;

use miette::{Diagnostic, LabeledSpan, NamedSource, Report, Severity, SourceCode, SourceSpan};

use super::complain;
use crate::audit::AuditError;
use crate::spec::{Faults, SpecError};
use crate::system::files::{MAX_BYTES, read_bounded};
use crate::system::printable::{self, is_unprintable};

/// One fault as it is drawn.
#[derive(Debug)]
struct Fault {
    message: String,
    help: Option<String>,
    severity: Severity,
    shown: Option<(NamedSource<String>, SourceSpan)>,
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.message)
    }
}

impl std::error::Error for Fault {}

impl Diagnostic for Fault {
    fn severity(&self) -> Option<Severity> {
        Some(self.severity)
    }

    fn help<'a>(&'a self) -> Option<Box<dyn fmt::Display + 'a>> {
        self.help.as_ref().map(|help| Box::new(help) as Box<dyn fmt::Display>)
    }

    fn source_code(&self) -> Option<&dyn SourceCode> {
        self.shown.as_ref().map(|(text, _)| text as &dyn SourceCode)
    }

    fn labels(&self) -> Option<Box<dyn Iterator<Item = LabeledSpan> + '_>> {
        let (_, span) = self.shown.as_ref()?;
        Some(Box::new(std::iter::once(LabeledSpan::new_with_span(Some("here".to_owned()), *span))))
    }
}

/// Several, each drawn by itself.
#[derive(Debug)]
struct Several {
    drawn: Vec<Fault>,
    may_be_more: bool,
}

impl fmt::Display for Several {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let rest = if self.may_be_more { ", and no more are told" } else { "" };
        write!(f, "{} faults{rest}", self.drawn.len())
    }
}

impl std::error::Error for Several {}

impl Diagnostic for Several {
    fn severity(&self) -> Option<Severity> {
        Some(Severity::Error)
    }

    fn related<'a>(&'a self) -> Option<Box<dyn Iterator<Item = &'a dyn Diagnostic> + 'a>> {
        Some(Box::new(self.drawn.iter().map(|fault| fault as &dyn Diagnostic)))
    }
}

pub(crate) fn diagnose(faults: impl Into<Faults>) -> Report {
    let faults = faults.into();
    let mut drawn: Vec<Fault> = faults.all().iter().map(|fault| Fault::of(fault, Severity::Error)).collect();
    match drawn.pop() {
        Some(one) if drawn.is_empty() => Report::new(one),
        last => {
            drawn.extend(last);
            Report::new(Several { drawn, may_be_more: faults.may_be_more() })
        }
    }
}

/// What is hardly meant, told on standard error.
pub(super) fn warn(doubts: &[SpecError]) {
    for doubt in doubts {
        complain(&format!("{:?}", Report::new(Fault::of(doubt, Severity::Warning))));
    }
}

impl Fault {
    fn of(error: &SpecError, severity: Severity) -> Self {
        let name = error.file.display().to_string();
        let bytes = error.line.and_then(|_| read_bounded(&error.file, MAX_BYTES).ok());
        // A character stays a character, so that places stay what they are.
        let inert = |c: char| if is_unprintable(c) && c != '\n' && c != '\t' { char::REPLACEMENT_CHARACTER } else { c };
        let text = bytes.map(|bytes| {
            let text = String::from_utf8_lossy(&bytes);
            text.trim_start_matches('\u{feff}').replace("\r\n", "\n").chars().map(inert).collect::<String>()
        });
        // What no terminal shows says nothing, and the printer cannot lay it out.
        let text = text.filter(|text| text.lines().all(|line| line.len() <= MAX_LINE));
        let place = match (error.line, error.column) {
            (Some(line), Some(column)) => format!("{name}:{line}:{column}"),
            (Some(line), None) => format!("{name}:{line}"),
            _ => name.clone(),
        };
        let shown = text.and_then(|text| {
            let span = span(&text, error.line?, error.column.unwrap_or(1))?;
            Some((NamedSource::new(name, text), span))
        });
        let help = error.help.as_deref().filter(|help| !help.is_empty()).map(shortened);
        Self { message: format!("{place}: {}", shortened(&error.message)), help, severity, shown }
    }
}

/// The longest line that is shown of a file, in bytes, and the longest message in characters.
const MAX_LINE: usize = 2000;
const MAX_MESSAGE: usize = 2000;

fn shortened(text: &str) -> String {
    let text = printable::lines(text);
    match text.char_indices().nth(MAX_MESSAGE) {
        Some((end, _)) => format!("{} ...", &text[..end]),
        None => text,
    }
}

/// The word at a line and column (from 1), as a byte range.
fn span(text: &str, line: usize, column: usize) -> Option<SourceSpan> {
    let start_of_line = text.split_inclusive('\n').take(line.checked_sub(1)?).map(str::len).sum::<usize>();
    let rest = text.get(start_of_line..)?.lines().next()?;
    let (offset, _) = rest.char_indices().nth(column.checked_sub(1)?).unwrap_or((rest.len(), ' '));
    let word = rest[offset..].find([' ', ',', ']', '}', ':']).unwrap_or(rest.len() - offset).max(1);
    Some((start_of_line + offset, word.min((rest.len() - offset).max(1))).into())
}

pub(super) fn not_audited(error: AuditError) -> Report {
    match error {
        AuditError::Spec(faults) => diagnose(faults),
        other => Report::from_err(other),
    }
}
