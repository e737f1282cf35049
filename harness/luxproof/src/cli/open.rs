//! `luxproof open`: a run's page in a browser, drawn of its report.

use luxproof_process::files::clean;
use luxproof_spec::BUNDLE_FILE;
use std::path::{Path, PathBuf};

use clap::Args;
use miette::{IntoDiagnostic, Report as Diagnostic};

use super::last_run::named_or_last;
use super::views::{keep_page, read_report, report_file};
use luxproof_console::{complain, print};
use luxproof_model::Exit;

#[derive(Debug, Args)]
pub(super) struct OpenArgs {
    /// Folder of a run or its report.json [default: the last run]
    run: Option<PathBuf>,
    /// Print the path of the page and open no browser
    #[arg(long)]
    no_browser: bool,
}

pub(super) fn open(args: &OpenArgs) -> Result<Exit, Diagnostic> {
    // A page that lies there may be anybody's: it is drawn of the report, and never opened as it is.
    let run = named_or_last(args.run.as_deref())?;
    let report = read_report(&run)?;
    let file = report_file(&run);
    let folder = file.parent().unwrap_or(&file);
    let own = if is_in_bundle(folder) { Some(elsewhere()?) } else { None };
    let folder = own.as_deref().unwrap_or(folder);
    let page = folder.join(luxproof_report::PAGE);
    if keep_page(&report, folder).is_none() {
        return Err(miette::miette!("{} cannot be written", page.display()));
    }
    print(&format!("{}\n", page.display()))?;
    if !args.no_browser
        && let Err(error) = open::that_detached(&page)
    {
        complain(&format!("no browser could be started ({error}): open the file above in one"));
    }
    Ok(Exit::Passed)
}

/// Whether a folder lies in a bundle, in which nothing is written: it would be whole no more.
fn is_in_bundle(folder: &Path) -> bool {
    clean(folder).ancestors().any(|above| above.join(BUNDLE_FILE).is_file())
}

/// A folder for a page, which stays until temporary files are cleared.
fn elsewhere() -> Result<PathBuf, Diagnostic> {
    tempfile::Builder::new().prefix("luxproof-page-").tempdir().map(tempfile::TempDir::keep).into_diagnostic()
}
