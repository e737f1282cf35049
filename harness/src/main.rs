//! The `luxproof` program, which supervises what it runs by processes of its own: parses the command line, keeps Ctrl-C orderly, prints errors with their place, sets the exit code.

use std::process::ExitCode;

use clap::Parser;
use luxproof::cli::{Cli, complain};
use luxproof::report::Exit;
use luxproof::system::process;
use tracing::Level;
use tracing_subscriber::filter::Targets;
use tracing_subscriber::prelude::*;

fn main() -> ExitCode {
    if let Some(exit) = process::supervise() {
        return exit;
    }
    // clap itself exits with 2 on a usage error, as the exit codes want it.
    let cli = Cli::parse();
    let level = [Level::WARN, Level::INFO, Level::DEBUG, Level::TRACE][usize::from(cli.verbosity()).min(3)];
    let told = tracing_subscriber::fmt::layer().with_writer(std::io::stderr).log_internal_errors(false).without_time();
    tracing_subscriber::registry().with(told).with(Targets::new().with_target("luxproof", level)).init();
    if let Err(error) = ctrlc::set_handler(process::interrupt) {
        tracing::warn!(%error, "Ctrl-C will not stop renderers in order");
    }
    let exit = cli.run().unwrap_or_else(|error| {
        complain(&format!("{error:?}"));
        Exit::Usage
    });
    ExitCode::from(exit.code())
}
