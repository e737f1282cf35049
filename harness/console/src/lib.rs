//! Output of the command line: text, JSON, messages and diagnostics.

mod diagnostic;

use std::io::Write;
use std::path::Path;

use luxproof_process::files::FileError;
use luxproof_process::printable;
use miette::{IntoDiagnostic, Report as Diagnostic};
use serde::Serialize;

pub use diagnostic::*;

/// Prints a text on standard output, without control sequences that a quoted file may contain.
pub fn print(text: &str) -> Result<(), Diagnostic> {
    match std::io::stdout().lock().write_all(printable::styled(text).as_bytes()) {
        // The reading program has closed the pipe, as `head` does: that is no error.
        Err(error) if error.kind() == std::io::ErrorKind::BrokenPipe => Ok(()),
        written => written.map_err(|e| FileError::of(Path::new("standard output"), e)).into_diagnostic(),
    }
}

/// Prints a message on standard error, and ignores errors of writing.
pub fn complain(text: &str) {
    writeln!(std::io::stderr().lock(), "{}", printable::styled(text)).ok();
}

/// The indented JSON text of a value.
pub fn json(value: &(impl Serialize + ?Sized)) -> Result<String, Diagnostic> {
    Ok(serde_json::to_string_pretty(value).into_diagnostic()? + "\n")
}
