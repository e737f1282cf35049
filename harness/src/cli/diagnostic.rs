//! Errors for people: the message with the line it is about, underlined.

use miette::{LabeledSpan, NamedSource, Report, Severity, SourceSpan};

use crate::audit::AuditError;
use crate::spec::SpecError;
use crate::system::files::{MAX_BYTES, read_bounded};
use crate::system::printable::{self, is_unprintable};

pub(crate) fn diagnose(error: SpecError) -> Report {
    let name = error.file.display().to_string();
    let bytes = error.line.and_then(|_| read_bounded(&error.file, MAX_BYTES).ok());
    // A character stays a character, so that places stay what they are.
    let shown = |c: char| if is_unprintable(c) && c != '\n' && c != '\t' { char::REPLACEMENT_CHARACTER } else { c };
    let text =
        bytes.map(|bytes| String::from_utf8_lossy(&bytes).replace("\r\n", "\n").chars().map(shown).collect::<String>());
    // What no terminal shows says nothing, and the printer cannot lay it out.
    let text = text.filter(|text| text.lines().all(|line| line.len() <= MAX_LINE));
    let span = text.as_ref().and_then(|t| span(t, error.line?, error.column.unwrap_or(1)));
    let place = match (error.line, error.column) {
        (Some(line), Some(column)) => format!("{name}:{line}:{column}"),
        (Some(line), None) => format!("{name}:{line}"),
        _ => name.clone(),
    };
    let mut diagnostic =
        miette::MietteDiagnostic::new(format!("{place}: {}", shortened(&error.message))).with_severity(Severity::Error);
    diagnostic.help = error.help.map(|help| shortened(&help));
    match (text, span) {
        (Some(text), Some(span)) => {
            let diagnostic = diagnostic.with_label(LabeledSpan::new_with_span(Some("here".to_owned()), span));
            Report::new(diagnostic).with_source_code(NamedSource::new(name, text))
        }
        _ => Report::new(diagnostic),
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
        AuditError::Spec(error) => diagnose(error),
        other => Report::from_err(other),
    }
}
