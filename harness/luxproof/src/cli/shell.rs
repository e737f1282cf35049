//! The command line for shells and `man`: `luxproof completions`, `luxproof man`.

use std::path::PathBuf;

use clap::{Args, Command};
use clap_complete::Shell;
use miette::{IntoDiagnostic, Report as Diagnostic};

use luxproof_console::print;
use luxproof_model::Exit;
use luxproof_process::files::FileError;

#[derive(Debug, Args)]
pub(super) struct CompletionsArgs {
    /// The shell
    #[arg(value_enum)]
    shell: Shell,
}

#[derive(Debug, Args)]
pub(super) struct ManArgs {
    /// Folder to write to; it gets one page per command
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
}

pub(super) fn completions(args: &CompletionsArgs, mut program: Command) -> Result<Exit, Diagnostic> {
    let mut script = vec![];
    clap_complete::generate(args.shell, &mut program, "luxproof", &mut script);
    print(&String::from_utf8(script).into_diagnostic()?)?;
    Ok(Exit::Passed)
}

pub(super) fn man(args: &ManArgs, program: Command) -> Result<Exit, Diagnostic> {
    let fail = |error| FileError::of(&args.out, error);
    std::fs::create_dir_all(&args.out).map_err(fail).into_diagnostic()?;
    clap_mangen::generate_to(program, &args.out).map_err(fail).into_diagnostic()?;
    print(&format!("{}\n", args.out.display()))?;
    Ok(Exit::Passed)
}
