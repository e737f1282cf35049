//! `luxproof accept`: the readings of a run become a baseline, under review and for a reason.

use luxproof_process::clock::timestamp;
use std::io::IsTerminal;
use std::path::{Path, PathBuf};

use clap::Args;
use miette::{IntoDiagnostic, Report as Diagnostic, WrapErr};

use super::views::read_report;
use luxproof_console::{complain, print};
use luxproof_model::{Exit, Report};
use luxproof_trend::baseline::{Baseline, BaselineError, Entry, References, Review, State, compare};

#[derive(Debug, Args)]
pub(super) struct AcceptArgs {
    /// Folder of a run or its report.json
    run: PathBuf,
    /// The baseline: a .json file, or a folder with one file per spec [default: baselines]
    #[arg(long, value_name = "FILE|DIR")]
    baseline: Option<PathBuf>,
    /// Accept all changes without questions; needs --reason
    #[arg(long, requires = "reason")]
    all: bool,
    /// Why the changes are right; stored in the baseline
    #[arg(long, value_name = "TEXT", requires = "all")]
    reason: Option<String>,
}

pub(super) fn accept(args: &AcceptArgs) -> Result<Exit, Diagnostic> {
    let report = read_report(&args.run)?;
    let path = Baseline::place(args.baseline.as_deref().unwrap_or(Path::new("baselines")), &report.spec);
    let ExistingBaseline { mut baseline, is_refused } = load_existing(&path, &report)?;
    let mut candidates = Baseline::candidate(&report).entries;
    candidates.retain(may_be_accepted);
    let changes = compare(&baseline.entries, &candidates, &References::of_report(&report));
    let now = timestamp(std::time::SystemTime::now());
    let open = Review { changes: &changes, accepted: &baseline.entries, candidates: &candidates };
    let decision = match &args.reason {
        Some(reason) if reason.trim().is_empty() => {
            return Err(miette::miette!(help = "say why these readings are right", "an empty reason"));
        }
        Some(reason) => {
            let mut text = vec![];
            let decision = open.accept_all(reason.trim(), &now, &mut text).into_diagnostic()?;
            print(&String::from_utf8_lossy(&text))?;
            decision
        }
        None if std::io::stdin().is_terminal() => {
            let (mut input, mut output) = (std::io::stdin().lock(), std::io::stderr().lock());
            open.ask(&now, &mut input, &mut output).into_diagnostic()?
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
struct ExistingBaseline {
    baseline: Baseline,
    is_refused: bool,
}

/// A file that is no sound baseline counts as none, with a message: everything is reviewed again.
fn load_existing(path: &Path, report: &Report) -> Result<ExistingBaseline, Diagnostic> {
    if !path.exists() {
        return Ok(ExistingBaseline { baseline: Baseline::default(), is_refused: false });
    }
    match Baseline::of_run(path, report.cases.iter().map(|c| c.name.as_str())) {
        Ok(baseline) => Ok(ExistingBaseline { baseline, is_refused: false }),
        // To put aside the sound baseline of another spec is nothing that anybody would want.
        Err(error @ (BaselineError::File(_) | BaselineError::Elsewhere { .. })) => Err(error).into_diagnostic(),
        Err(error) => {
            complain(&format!("{error}: all of this run is reviewed as new"));
            Ok(ExistingBaseline { baseline: Baseline::default(), is_refused: true })
        }
    }
}

fn may_be_accepted(entry: &Entry) -> bool {
    if !entry.is_sound() {
        complain(&format!("{}: without sound readings, never accepted", entry.key));
    }
    entry.is_sound()
}
