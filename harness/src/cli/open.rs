//! `luxproof open`: a run's page in a browser, made anew where it is not there or older than the report.

use std::path::PathBuf;

use clap::Args;
use miette::Report as Diagnostic;

use super::views::{keep_page, read_report, report_file};
use super::{complain, print};
use crate::report::{self, Exit};

#[derive(Debug, Args)]
pub(super) struct OpenArgs {
    /// Folder of a run, or its report.json
    run: PathBuf,
    /// Print where the page is, and open nothing
    #[arg(long)]
    no_browser: bool,
}

pub(super) fn open(args: &OpenArgs) -> Result<Exit, Diagnostic> {
    let file = report_file(&args.run);
    let page = file.with_file_name(report::PAGE);
    let written = |path: &PathBuf| path.metadata().and_then(|m| m.modified()).ok();
    if written(&page).is_none_or(|page| written(&file).is_none_or(|report| page < report)) {
        let report = read_report(&args.run)?;
        let folder = file.parent().unwrap_or(&file);
        if keep_page(&report, folder).is_none() {
            return Err(miette::miette!("{} cannot be written", page.display()));
        }
    }
    print(&format!("{}\n", page.display()))?;
    if !args.no_browser
        && let Err(error) = open::that_detached(&page)
    {
        complain(&format!("no browser could be started ({error}): open the file above in one"));
    }
    Ok(Exit::Passed)
}
