//! Views of finished reports: which are printed after a run, and `luxproof report`.

use std::io::IsTerminal;
use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};
use miette::{IntoDiagnostic, Report as Diagnostic, WrapErr};

use super::print;
use crate::report::{self, Beside, Detail, Exit, Report, Style};

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
    /// report.json of a run
    result: PathBuf,
    /// Print the error budget of every deviation, and nothing else
    #[arg(long)]
    budget: bool,
    #[command(flatten)]
    pub(super) views: Views,
}

pub(super) fn print_reports(reports: &[(Report, PathBuf)], views: &Views) -> Result<(), Diagnostic> {
    let beside = |path: &PathBuf| read(path, |text| Beside::from_json(text).into_diagnostic());
    let beside = views.beside.iter().map(beside).collect::<Result<Vec<_>, _>>()?;
    let detail = if views.all { Detail::All } else { Detail::Brief };
    let style = if std::io::stdout().is_terminal() && std::env::var_os("NO_COLOR").is_none_or(|v| v.is_empty()) {
        Style::Colour
    } else {
        Style::Plain
    };
    for format in &views.format {
        let text = match format {
            Format::Json => {
                let all: Vec<&Report> = reports.iter().map(|(r, _)| r).collect();
                // One spec gives its report; several give a list of reports.
                match all[..] {
                    [one] => serde_json::to_string_pretty(one),
                    _ => serde_json::to_string_pretty(&all),
                }
                .into_diagnostic()?
            }
            Format::Html => print_page(reports, &beside),
            view => {
                let one = |(report, folder): &(Report, PathBuf)| match view {
                    Format::Markdown => report::markdown(report, views.link.as_deref()),
                    Format::Csv => report::csv(report),
                    Format::Junit => report::junit(report),
                    _ => report::terminal(report, style, detail, Some(&folder.display().to_string())),
                };
                reports.iter().map(one).collect::<Vec<_>>().join("\n")
            }
        };
        print(&format!("{}\n", text.trim_end()))?;
    }
    Ok(())
}

/// The page, also kept in the run's folder; on a terminal only its place is printed.
fn print_page(reports: &[(Report, PathBuf)], beside: &[Beside]) -> String {
    let mut pages = vec![];
    for (report, folder) in reports {
        let (page, file) = (report::page(report, beside), folder.join("report.html"));
        let kept = std::fs::write(&file, &page);
        if let Err(error) = &kept {
            tracing::warn!(file = %file.display(), %error, "the page is printed, not kept");
        }
        pages.push(if kept.is_ok() && std::io::stdout().is_terminal() { file.display().to_string() } else { page });
    }
    pages.join("\n")
}

pub(super) fn view(args: &ReportArgs) -> Result<Exit, Diagnostic> {
    let report = read_report(&args.result)?;
    let folder = args.result.parent().map_or_else(PathBuf::new, Path::to_owned);
    let exit = report.exit();
    if args.budget {
        print(&report::budgets(&report))?;
    } else {
        print_reports(&[(report, folder)], &args.views)?;
    }
    Ok(exit)
}

pub(super) fn read_report(file: &Path) -> Result<Report, Diagnostic> {
    read(file, |text| serde_json::from_str(text).into_diagnostic())
}

fn read<T>(file: &Path, parse: impl Fn(&str) -> Result<T, Diagnostic>) -> Result<T, Diagnostic> {
    let text = std::fs::read_to_string(file).into_diagnostic();
    text.and_then(|text| parse(&text)).wrap_err_with(|| file.display().to_string())
}
