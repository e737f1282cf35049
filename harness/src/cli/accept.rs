//! `luxproof accept`: the readings of a run become a baseline, under review and for a reason.

use std::io::IsTerminal;
use std::path::{Path, PathBuf};

use clap::Args;
use miette::{IntoDiagnostic, Report as Diagnostic, WrapErr};

use super::views::read_report;
use super::{complain, print};
use crate::report::{Exit, Report};
use crate::trend::baseline::{Baseline, BaselineError, Comparability, Decision, Entry, State, compare, review};

#[derive(Debug, Args)]
pub(super) struct AcceptArgs {
    /// Folder of a run, or its report.json
    run: PathBuf,
    /// The baseline: a .json file, or a folder that holds one a spec [default: baselines]
    #[arg(long, value_name = "FILE|DIR")]
    baseline: Option<PathBuf>,
    /// Accept everything that is new or changed without asking; needs --reason
    #[arg(long, requires = "reason")]
    all: bool,
    /// Why it is right, kept with what --all accepts
    #[arg(long, value_name = "TEXT", requires = "all")]
    reason: Option<String>,
}

pub(super) fn accept(args: &AcceptArgs) -> Result<Exit, Diagnostic> {
    let report = read_report(&args.run)?;
    let path = Baseline::place(args.baseline.as_deref().unwrap_or(Path::new("baselines")), &report.spec);
    let Kept { mut baseline, is_refused } = kept(&path, &report)?;
    let mut candidates = Baseline::candidate(&report).entries;
    candidates.retain(may_be_accepted);
    let changes = compare(&baseline.entries, &candidates, Comparability::SameInstrument);
    let now = humantime::format_rfc3339_seconds(std::time::SystemTime::now()).to_string();
    let decision = match &args.reason {
        Some(reason) if reason.trim().is_empty() => {
            return Err(miette::miette!(help = "say why these readings are right", "an empty reason"));
        }
        Some(reason) => {
            let open = |e: &&Entry| !changes.entries.iter().any(|c| e.key == c.key && c.state == State::Unchanged);
            let accepted = candidates.iter().filter(open).map(|e| e.accepted_for(reason.trim(), &now)).collect();
            Decision { accepted, declined: 0 }
        }
        None if std::io::stdin().is_terminal() => {
            let (mut input, mut output) = (std::io::stdin().lock(), std::io::stderr().lock());
            review(&changes, &candidates, &now, &mut input, &mut output).into_diagnostic()?
        }
        None => {
            let help = "run it on a terminal, or accept everything with --all --reason TEXT";
            return Err(miette::miette!(help = help, "there is no terminal to review on"));
        }
    };
    let (accepted, declined) = (decision.accepted.len(), decision.declined);
    let unchanged = changes.entries.iter().filter(|c| c.state == State::Unchanged).count();
    if accepted > 0 {
        baseline.accept(decision.accepted);
        if is_refused {
            let aside = path.with_extension("json.refused");
            std::fs::rename(&path, &aside).into_diagnostic().wrap_err_with(|| path.display().to_string())?;
            complain(&format!("what was refused now lies in {}", aside.display()));
        }
        baseline.write(&path).into_diagnostic()?;
    }
    print(&format!("{accepted} accepted, {declined} declined, {unchanged} unchanged: {}\n", path.display()))?;
    Ok(Exit::Passed)
}

/// What was accepted before, and whether there is a file that cannot be trusted to say so.
struct Kept {
    baseline: Baseline,
    is_refused: bool,
}

/// A file that is no sound baseline counts as none, which is told: everything is reviewed anew.
fn kept(path: &Path, report: &Report) -> Result<Kept, Diagnostic> {
    if !path.exists() {
        return Ok(Kept { baseline: Baseline::default(), is_refused: false });
    }
    match Baseline::of_run(path, report.cases.iter().map(|c| c.name.as_str())) {
        Ok(baseline) => Ok(Kept { baseline, is_refused: false }),
        // To put aside the sound baseline of another spec is nothing that anybody would want.
        Err(error @ (BaselineError::File(_) | BaselineError::Elsewhere { .. })) => Err(error).into_diagnostic(),
        Err(error) => {
            complain(&format!("{error}: all of this run is reviewed as new"));
            Ok(Kept { baseline: Baseline::default(), is_refused: true })
        }
    }
}

fn may_be_accepted(entry: &Entry) -> bool {
    if !entry.is_sound() {
        complain(&format!("{}: without sound readings, never accepted", entry.key));
    }
    entry.is_sound()
}
