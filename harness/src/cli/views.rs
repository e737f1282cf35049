//! Views of finished reports: which are printed after a run, and `luxproof report`.

use std::io::IsTerminal;
use std::path::{Path, PathBuf};

use clap::{ArgGroup, Args, ValueEnum};
use miette::{IntoDiagnostic, Report as Diagnostic, WrapErr};
use terminal_size::terminal_size_of;

use super::{Audited, Choice, Extent, Selected, complain, json, print};
use crate::report::{self, Beside, Detail, Exit, Report, Screen, Style};
use crate::system::files;

/// Which views of a report are printed, and how.
#[derive(Debug, Args)]
pub(super) struct Views {
    /// Views of the report to print
    #[arg(long, value_enum, value_name = "FORMAT", default_values_t = [Format::Terminal])]
    format: Vec<Format>,
    /// Tell everything on the terminal: papers' tables, methods apart from renderers, notes (as -v)
    #[arg(long)]
    pub(super) all: bool,
    /// Where the whole report is published, for Markdown to lead to
    #[arg(long, value_name = "URL")]
    link: Option<String>,
    /// JSON of `luxproof bench` or `luxproof stress` to show with it in HTML
    #[arg(long, value_name = "FILE")]
    beside: Vec<PathBuf>,
}

impl Views {
    /// Whether the page is one of them, which is kept where it is printed.
    pub(super) fn has_page(&self) -> bool {
        self.format.contains(&Format::Html)
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(super) enum Format {
    Terminal,
    Json,
    Markdown,
    Junit,
    Csv,
    /// One self-contained file; best sent to one with `>`
    Html,
}

#[derive(Debug, Args)]
#[command(group = ArgGroup::new("of specs").multiple(true).requires("from").args([
    "engines", "procedures", "filter", "seed", "no_skips", "out", "file", "profile", "tolerance_class", "sampling", "no_calibration",
]))]
pub(super) struct ReportArgs {
    /// report.json of a run, or the run's folder; with --from the specs that were read
    #[arg(required = true, value_name = "RESULT|SPEC")]
    results: Vec<PathBuf>,
    /// Report what this cache holds of the readings that specs ask for, and read nothing
    #[arg(long, value_name = "CACHE")]
    pub(super) from: Option<PathBuf>,
    #[command(flatten)]
    choice: Choice,
    #[command(flatten)]
    extent: Extent,
    /// Print the error budget of every deviation, and nothing else
    #[arg(long)]
    budget: bool,
    #[command(flatten)]
    pub(super) views: Views,
}

impl ReportArgs {
    /// What was to be read.
    pub(super) fn audited(&self) -> Audited {
        let selected = Selected { specs: self.results.clone(), choice: self.choice.clone() };
        Audited { selected, extent: self.extent.clone() }
    }
}

pub(super) fn print_report(report: &Report, folder: &Path, views: &Views) -> Result<(), Diagnostic> {
    let beside = |path: &PathBuf| {
        let text = read_text(path);
        let read = text.and_then(|text| Beside::from_json(&text).into_diagnostic());
        read.wrap_err_with(|| path.display().to_string())
    };
    let beside = views.beside.iter().map(beside).collect::<Result<Vec<_>, _>>()?;
    let detail = if views.all { Detail::All } else { Detail::Brief };
    let style = if std::io::stdout().is_terminal() && std::env::var_os("NO_COLOR").is_none_or(|v| v.is_empty()) {
        Style::Colour
    } else {
        Style::Plain
    };
    for format in &views.format {
        let text = match format {
            Format::Terminal => report::terminal(report, screen(style, detail), Some(&folder.display().to_string())),
            Format::Json => json(report)?,
            Format::Markdown => report::markdown(report, views.link.as_deref()),
            Format::Junit => report::junit(report),
            Format::Csv => report::csv(report),
            Format::Html => page(report, folder, &beside),
        };
        print(&format!("{}\n", text.trim_end()))?;
    }
    Ok(())
}

/// As wide as COLUMNS says, or else the terminal that is printed on.
pub(super) fn screen(style: Style, detail: Detail) -> Screen {
    let told = std::env::var("COLUMNS").ok().and_then(|columns| columns.parse().ok()).filter(|n| *n > 0);
    let found = || terminal_size_of(std::io::stdout()).map(|(width, _)| usize::from(width.0));
    Screen::new(style, detail, told.or_else(found))
}

/// The page, which lies in the run's folder, too; on a terminal only its place is printed.
fn page(report: &Report, folder: &Path, beside: &[Beside]) -> String {
    let page = report::page(report, beside);
    match kept(report, &page, folder) {
        Some(file) if std::io::stdout().is_terminal() => file.display().to_string(),
        _ => page,
    }
}

/// Keeps the page of a report in its run's folder.
pub(super) fn keep_page(report: &Report, folder: &Path) -> Option<PathBuf> {
    kept(report, &report::page(report, &[]), folder)
}

/// Where a page is kept; that it cannot be is told, since the report itself is kept already.
fn kept(report: &Report, page: &str, folder: &Path) -> Option<PathBuf> {
    match report::keep_page(report, page, folder) {
        Ok(file) => Some(file),
        Err(error) => {
            tracing::warn!(folder = %folder.display(), %error, "the page is not kept");
            None
        }
    }
}

pub(super) fn view(args: &ReportArgs) -> Result<Exit, Diagnostic> {
    let [result] = &args.results[..] else {
        return Err(miette::miette!(help = "name one, or the specs with --from CACHE", "a view is one of one run"));
    };
    let file = report_file(result);
    let report = read_report(result)?;
    if args.budget {
        print(&report::budgets(&report))?;
    } else {
        print_report(&report, file.parent().unwrap_or(Path::new("")), &args.views)?;
    }
    Ok(report.exit())
}

fn read_text(file: &Path) -> Result<String, Diagnostic> {
    let bytes = files::read_kept(file).into_diagnostic()?;
    String::from_utf8(bytes).into_diagnostic().wrap_err_with(|| file.display().to_string())
}

/// The report of a run that is named by its file or its folder.
pub(super) fn report_file(of: &Path) -> PathBuf {
    if of.is_dir() { of.join(report::FILE) } else { of.to_owned() }
}

pub(super) fn read_report(of: &Path) -> Result<Report, Diagnostic> {
    let file = &report_file(of);
    if of.is_dir() && !file.exists() {
        return Err(miette::miette!(
            help = "give the folder of a run, or its report.json",
            "{} holds no {}",
            of.display(),
            report::FILE
        ));
    }
    let read = Report::read(file).into_diagnostic()?;
    if let Some(doubt) = read.doubt {
        complain(&format!("{} {doubt}", file.display()));
    }
    Ok(read.report)
}
