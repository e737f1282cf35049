//! Views of finished reports: which are printed after a run, and `luxproof report`.

use std::io::IsTerminal;
use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};
use miette::{IntoDiagnostic, Report as Diagnostic, WrapErr};

use super::{complain, json, print};
use crate::report::{self, Beside, Detail, Exit, Report, Style};
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
pub(super) struct ReportArgs {
    /// report.json of a run, or the run's folder
    result: PathBuf,
    /// Print the error budget of every deviation, and nothing else
    #[arg(long)]
    budget: bool,
    #[command(flatten)]
    pub(super) views: Views,
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
            Format::Terminal => report::terminal(report, style, detail, Some(&folder.display().to_string())),
            Format::Json => json(report)?,
            Format::Markdown => report::markdown(report, views.link.as_deref()),
            Format::Junit => report::junit(report),
            Format::Csv => report::csv(report),
            Format::Html => keep_page(report, folder, &beside),
        };
        print(&format!("{}\n", text.trim_end()))?;
    }
    Ok(())
}

/// The page, also kept in the run's folder; on a terminal only its place is printed.
fn keep_page(report: &Report, folder: &Path, beside: &[Beside]) -> String {
    let (page, file) = (report::page(report, beside), folder.join("report.html"));
    if let Err(error) = files::keep_shared(&file, page.as_bytes()) {
        tracing::warn!(file = %file.display(), %error, "the page is printed, not kept");
    } else if std::io::stdout().is_terminal() {
        return file.display().to_string();
    }
    page
}

pub(super) fn view(args: &ReportArgs) -> Result<Exit, Diagnostic> {
    let file = report_file(&args.result);
    let report = read_report(&args.result)?;
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
    let text = read_text(file)?;
    let read = Report::from_json(&text).map_err(|why| miette::miette!("{} {why}", file.display()))?;
    if let Some(doubt) = read.doubt {
        complain(&format!("{} {doubt}", file.display()));
    }
    Ok(read.report)
}
