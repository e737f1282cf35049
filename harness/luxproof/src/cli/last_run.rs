//! The runs in `luxproof-out`, for commands that name none.

use std::cmp::Reverse;
use std::path::{Path, PathBuf};
use std::time::SystemTime;

use miette::{Report as Diagnostic, miette};

use luxproof_model::REPORT_FILE;
use luxproof_report_file::subject_at;

/// The folder of runs below the current folder.
pub(super) const RUNS: &str = "luxproof-out";

/// The run that a command names, or else the last one.
pub(super) fn named_or_last(run: Option<&Path>) -> Result<PathBuf, Diagnostic> {
    run.map(Path::to_owned).or_else(|| runs().into_iter().next()).ok_or_else(no_run)
}

/// The two runs that are compared: those that are named, or else the last run and the one of the same spec before it.
pub(super) fn pair(old: Option<&Path>, new: Option<&Path>) -> Result<[PathBuf; 2], Diagnostic> {
    let new = named_or_last(new)?;
    if let Some(old) = old {
        return Ok([old.to_owned(), new]);
    }
    let subject = subject_at(&new.join(REPORT_FILE));
    let earlier = runs().into_iter().skip_while(|run| *run != new).skip(1);
    let old = earlier.into_iter().find(|run| subject_at(&run.join(REPORT_FILE)) == subject);
    let old = old.ok_or_else(|| {
        miette!(
            help = "name both: luxproof diff OLD NEW; `run --out DIR` stores a run in a folder of that name",
            "{RUNS} has no earlier run of the spec of {}",
            new.display()
        )
    })?;
    Ok([old, new])
}

/// Folders of runs, the newest first.
fn runs() -> Vec<PathBuf> {
    let folders = std::fs::read_dir(RUNS).into_iter().flatten().flatten();
    let mut runs: Vec<(SystemTime, PathBuf)> = vec![];
    for folder in folders.map(|entry| entry.path()) {
        if let Ok(time) = std::fs::metadata(folder.join(REPORT_FILE)).and_then(|metadata| metadata.modified()) {
            runs.push((time, folder));
        }
    }
    runs.sort_by_key(|(time, folder)| (Reverse(*time), folder.clone()));
    runs.into_iter().map(|(_, folder)| folder).collect()
}

fn no_run() -> Diagnostic {
    miette!(help = "run a spec first: luxproof run SPEC; or name the folder of a run", "there is no run in {RUNS}")
}
