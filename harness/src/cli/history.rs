//! `luxproof history`: adds the reports of a night, draws the site.

use std::path::{Path, PathBuf};

use clap::{Subcommand, ValueEnum};
use miette::{IntoDiagnostic, Report as Diagnostic};

use super::views::read_report;
use super::{complain, print};
use crate::report::Exit;
use crate::system::files;
use crate::trend::history::{Change, Course, History, Line, add, changes, in_words, lines, site};

#[derive(Debug, Subcommand)]
pub(super) enum Action {
    /// Add the comparisons of reports; a night that is added again takes the place of its lines
    Add {
        /// report.json of a run
        #[arg(required = true, value_name = "REPORT")]
        reports: Vec<PathBuf>,
        /// The history, made if there is none
        #[arg(long, value_name = "FILE")]
        history: PathBuf,
        /// The night [default: the day on which each run started]
        #[arg(long, value_name = "YYYY-MM-DD")]
        night: Option<String>,
    },
    /// Draw the site: last night, changes, trends
    Site {
        /// The history
        #[arg(long, value_name = "FILE")]
        history: PathBuf,
        /// Folder to write index.html to
        #[arg(long, value_name = "DIR")]
        out: PathBuf,
        /// A report to link to, relative to the site: NAME=PATH; may be given several times
        #[arg(long, value_name = "NAME=PATH", value_parser = link)]
        report: Vec<(String, String)>,
        /// Exit with 1 where one was noticed on the last night: a change of level, a drift, or either
        #[arg(long, value_enum, value_name = "WHAT")]
        deny: Option<Deny>,
        /// So many of the last nights count for --deny
        #[arg(long, value_name = "NIGHTS", requires = "deny", default_value_t = 1)]
        since: usize,
    },
}

/// What the last nights may not bring.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(super) enum Deny {
    Change,
    Drift,
    Any,
}

impl Deny {
    const fn holds(self, course: Course) -> bool {
        match course {
            Course::Step { .. } => !matches!(self, Self::Drift),
            Course::Drift { .. } => !matches!(self, Self::Change),
        }
    }
}

fn link(text: &str) -> Result<(String, String), String> {
    let (name, path) = text.split_once('=').ok_or("give a name and a path, NAME=PATH")?;
    Ok((name.to_owned(), path.to_owned()))
}

pub(super) fn history(action: &Action) -> Result<Exit, Diagnostic> {
    match action {
        Action::Add { reports, history, night } => {
            reports.iter().try_for_each(|path| add_report(path, history, night.as_deref()))?;
        }
        Action::Site { history, out, report, deny, since } => {
            let (history, changes) = draw(history, out, report)?;
            let first = history.nights.len().saturating_sub(*since);
            let is_denied = |c: &&Change| c.noticed >= first && deny.is_some_and(|deny| deny.holds(c.course));
            let denied: Vec<&Change> = changes.iter().filter(is_denied).collect();
            for change in &denied {
                print(&format!("{}\n", in_words(&history, change)))?;
            }
            if !denied.is_empty() {
                return Ok(Exit::Failed);
            }
        }
    }
    Ok(Exit::Passed)
}

fn add_report(path: &Path, history: &Path, night: Option<&str>) -> Result<(), Diagnostic> {
    let report = read_report(path)?;
    let lines = lines(&report, night).into_diagnostic()?;
    let added = add(history, &lines).into_diagnostic()?;
    tell_of_cut(history, added.cut_short);
    let count: usize = lines.iter().map(Line::count).sum();
    let instead = if added.replaced > 0 { format!(" in place of {} lines", added.replaced) } else { String::new() };
    print(&format!("{}: {count} comparisons added{instead}\n", history.display()))
}

fn tell_of_cut(history: &Path, line: Option<usize>) {
    if let Some(line) = line {
        complain(&format!("{}:{line}: the last line is cut short and left out", history.display()));
    }
}

fn draw(path: &Path, out: &Path, reports: &[(String, String)]) -> Result<(History, Vec<Change>), Diagnostic> {
    let history = History::read(path).into_diagnostic()?;
    tell_of_cut(path, history.cut_short);
    let page = out.join("index.html");
    let changes = changes(&history);
    files::keep_shared(&page, site(&history, &changes, reports).as_bytes()).into_diagnostic()?;
    let (nights, series) = (history.nights.len(), history.series.len());
    print(&format!("{}: {nights} nights, {series} series, {} changes\n", page.display(), changes.len()))?;
    Ok((history, changes))
}
