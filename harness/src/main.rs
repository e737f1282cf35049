//! The `luxproof` program, which supervises what it runs by processes of its own: parses the command line, keeps Ctrl-C orderly, prints errors with their place, sets the exit code.

use std::io::IsTerminal;
use std::process::ExitCode;

use clap::Parser;
use luxproof::cli::{Cli, complain};
use luxproof::report::Exit;
use luxproof::system::process;
use tracing_subscriber::EnvFilter;

fn main() -> ExitCode {
    if let Some(exit) = process::supervise() {
        return exit;
    }
    // clap itself exits with 2 on a usage error, as the exit codes want it.
    let cli = Cli::parse();
    let level = ["warn", "info", "debug", "trace"][usize::from(cli.verbosity()).min(3)];
    let filter = EnvFilter::new(format!("luxproof={level}"));
    tracing_subscriber::fmt()
        .with_env_filter(filter)
        .with_writer(std::io::stderr)
        // In a file of a workflow colours are noise.
        .with_ansi(std::io::stderr().is_terminal())
        .log_internal_errors(false)
        .without_time()
        .init();
    if let Err(error) = ctrlc::set_handler(process::interrupt) {
        tracing::warn!(%error, "Ctrl-C will not stop renderers in order");
    }
    let exit = cli.run().unwrap_or_else(|error| {
        complain(&format!("{error:?}"));
        Exit::Usage
    });
    ExitCode::from(exit.code())
}
