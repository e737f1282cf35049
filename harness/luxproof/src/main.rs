//! The `luxproof` program, which supervises what it runs by processes of its own: parses the command line, keeps Ctrl-C orderly, prints errors with their place, sets the exit code.

use std::io::{self, IsTerminal};
use std::process::ExitCode;

use luxproof::cli::Cli;
use luxproof_console::{complain_of, complain_styled};
use luxproof_model::Exit;
use luxproof_process::process;
use tracing::Level;
use tracing_subscriber::filter::Targets;
use tracing_subscriber::prelude::*;

fn main() -> ExitCode {
    if let Some(exit) = process::supervise() {
        return exit;
    }
    // clap itself exits with 2 on a usage error, as the exit codes want it.
    let cli = Cli::from_command_line();
    let level = [Level::WARN, Level::INFO, Level::DEBUG, Level::TRACE][usize::from(cli.verbosity()).min(3)];
    // In a file of a workflow colours are noise.
    let is_colourful = std::io::stderr().is_terminal();
    let reported = tracing_subscriber::fmt::layer().with_writer(|| LogWriter).with_ansi(is_colourful);
    let reported = reported.log_internal_errors(false).without_time();
    tracing_subscriber::registry().with(reported).with(Targets::new().with_target("luxproof", level)).init();
    if let Err(error) = ctrlc::set_handler(process::interrupt) {
        tracing::warn!(%error, "Ctrl-C will not stop renderers in order");
    }
    if let Err(error) = process::take_file_limit_as_error() {
        tracing::warn!(%error, "a file that grows beyond `ulimit -f` will end luxproof");
    }
    let exit = cli.run().unwrap_or_else(|error| {
        complain_of(error);
        Exit::Usage
    });
    ExitCode::from(exit.code())
}

/// Standard error for events of the program, which may name files and engines of strangers.
struct LogWriter;

impl io::Write for LogWriter {
    /// An event is written at once.
    fn write(&mut self, event: &[u8]) -> io::Result<usize> {
        complain_styled(String::from_utf8_lossy(event).trim_end_matches('\n'));
        Ok(event.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}
