//! Output of the command line: text, JSON, messages and diagnostics.

mod diagnostic;

use std::io::Write;
use std::path::Path;

use luxproof_process::files::FileError;
use luxproof_process::printable::{Styles, inert, short_lines};
use miette::{IntoDiagnostic, Report as Diagnostic};
use serde::Serialize;

pub use diagnostic::*;

/// Prints a text on standard output, without control sequences that a quoted file may contain.
pub fn print(text: &str) -> Result<(), Diagnostic> {
    write_out(&inert(text, Styles::None))
}

/// Prints a view that sets colours. Everything that it quotes is printable.
pub fn print_styled(text: &str) -> Result<(), Diagnostic> {
    write_out(&inert(text, Styles::Own))
}

fn write_out(text: &str) -> Result<(), Diagnostic> {
    match std::io::stdout().lock().write_all(text.as_bytes()) {
        // The reading program has closed the pipe, as `head` does: that is no error.
        Err(error) if error.kind() == std::io::ErrorKind::BrokenPipe => Ok(()),
        written => written.map_err(|e| FileError::of(Path::new("standard output"), e)).into_diagnostic(),
    }
}

/// Prints a message on standard error, and ignores errors of writing.
pub fn complain(text: &str) {
    writeln!(std::io::stderr().lock(), "{}", inert(&short_lines(text), Styles::None)).ok();
}

/// Prints an event of the program's log. The log sets colours and escapes fields.
pub fn complain_styled(text: &str) {
    writeln!(std::io::stderr().lock(), "{}", inert(text, Styles::Own)).ok();
}

/// Prints an error with its causes and its help, whatever these quote.
pub fn complain_of(error: Diagnostic) {
    complain_styled(&format!("{:?}", Diagnostic::new(DrawnError::from(error))));
}

/// The indented JSON text of a value.
pub fn json(value: &(impl Serialize + ?Sized)) -> Result<String, Diagnostic> {
    Ok(serde_json::to_string_pretty(value).into_diagnostic()? + "\n")
}
