//! `luxproof history`: adds the reports of a night, draws the site.

use std::path::{Path, PathBuf};

use clap::{Subcommand, ValueEnum};
use miette::{IntoDiagnostic, Report as Diagnostic};

use super::views::read_report;
use luxproof_console::{complain, print};
use luxproof_model::Exit;
use luxproof_model::numbers::plural;
use luxproof_process::files;
use luxproof_trend::history::{Change, Course, History, Line, add, changes, in_words, lines, site};

#[derive(Debug, Subcommand)]
pub(super) enum Action {
    /// Add the comparisons of reports; a night replaces its earlier lines
    Add {
        /// report.json of a run
        #[arg(required = true, value_name = "REPORT")]
        reports: Vec<PathBuf>,
        /// The history; created if missing
        #[arg(long, value_name = "FILE")]
        history: PathBuf,
        /// The night [default: the day on which the run started]
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
        /// Link to a report, by its path from the site; may be given several times
        #[arg(long, value_name = "NAME=PATH", value_parser = link)]
        report: Vec<(String, String)>,
        /// Exit with 1 if the last night has it
        #[arg(long, value_enum, value_name = "WHAT", default_value_t = Deny::Failure)]
        deny: Deny,
        /// Number of last nights that count for --deny
        #[arg(long, value_name = "NIGHTS", default_value_t = 1)]
        since: usize,
    },
}

/// What the last nights may not bring.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(super) enum Deny {
    /// Nothing
    None,
    /// A failed verdict
    Failure,
    /// A failed verdict or a change of level
    Change,
    /// A failed verdict or a drift
    Drift,
    /// A failed verdict, a change of level or a drift
    Any,
}

impl Deny {
    const fn denies(self, course: Course) -> bool {
        match course {
            Course::Step { .. } => matches!(self, Self::Change | Self::Any),
            Course::Drift { .. } => matches!(self, Self::Drift | Self::Any),
            Course::Outlier { .. } => false,
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
            let denied = denied_lines(&history, &changes, *deny, *since);
            for line in &denied {
                print(&format!("{line}\n"))?;
            }
            for line in outlier_lines(&history, &changes, *since) {
                print(&format!("{line}\n"))?;
            }
            if !denied.is_empty() {
                return Ok(Exit::Failed);
            }
        }
    }
    Ok(Exit::Passed)
}

/// What the last nights have that is denied, in one line each.
fn denied_lines(history: &History, changes: &[Change], deny: Deny, since: usize) -> Vec<String> {
    if deny == Deny::None {
        return vec![];
    }
    let first = history.nights.len().saturating_sub(since);
    let recent = changes.iter().filter(|change| change.noticed >= first && deny.denies(change.course));
    history.failures(first).into_iter().chain(recent.map(|change| in_words(history, change))).collect()
}

/// The outliers of the last nights, which deny nothing.
fn outlier_lines(history: &History, changes: &[Change], since: usize) -> Vec<String> {
    let first = history.nights.len().saturating_sub(since);
    let is_recent = |change: &&Change| change.noticed >= first && matches!(change.course, Course::Outlier { .. });
    changes.iter().filter(is_recent).map(|change| in_words(history, change)).collect()
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
    let outliers = changes.iter().filter(|change| matches!(change.course, Course::Outlier { .. })).count();
    let counts = [
        plural(history.nights.len(), "night"),
        format!("{} series", history.series.len()),
        plural(changes.len() - outliers, "change"),
        plural(outliers, "outlier"),
    ];
    print(&format!("{}: {}\n", page.display(), counts.join(", ")))?;
    Ok((history, changes))
}
