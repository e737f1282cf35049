//! Views of finished reports: which are printed after a run, and `luxproof report`.

use std::io::IsTerminal;
use std::path::{Path, PathBuf};

use clap::{ArgGroup, Args, ValueEnum};
use miette::{IntoDiagnostic, Report as Diagnostic, WrapErr};
use terminal_size::terminal_size_of;

use super::last_run::named_or_last;
use super::{Audited, Choice, Extent, Selected};
use luxproof_console::{json, print, print_styled};
use luxproof_model::{Exit, Report};
use luxproof_process::files;
use luxproof_report::{AttachedReport, Detail, Letters, Screen, Style};

/// Which views of a report are printed, and how.
#[derive(Debug, Args)]
pub(super) struct Views {
    /// Formats to print
    ///
    /// The option may be given several times.
    #[arg(long, value_enum, value_name = "FORMAT", default_values_t = [Format::Terminal])]
    format: Vec<Format>,
    /// Print everything on the terminal, not one screen
    #[arg(long)]
    pub(super) all: bool,
    /// Address of the published report, for a link in Markdown
    #[arg(long, hide_short_help = true, value_name = "URL")]
    link: Option<String>,
    /// Results of `bench` or `stress` (JSON) to include in HTML
    #[arg(long, hide_short_help = true, value_name = "FILE")]
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
    /// A single self-contained page; redirect it to a file with >
    Html,
}

#[derive(Debug, Args)]
#[command(group = ArgGroup::new("of specs").multiple(true).requires("from").args([
    "filter", "seed", "no_skips", "out", "file", "profile", "tolerance_class", "sampling", "no_calibration",
]))]
pub(super) struct ReportArgs {
    /// A run: folder or report.json [default: the last run]
    ///
    /// With --from: the specs.
    #[arg(value_name = "RUN|SPEC")]
    results: Vec<PathBuf>,
    /// Report what this cache has for the specs
    #[arg(long, value_name = "CACHE")]
    pub(super) from: Option<PathBuf>,
    #[command(flatten)]
    choice: Choice,
    #[command(flatten)]
    extent: Extent,
    /// Print only the error budget of every deviation
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

/// Reads a file of results that a report shows next to its own.
fn read_beside(path: &Path) -> Result<AttachedReport, Diagnostic> {
    let text = read_text(path);
    let read = text.and_then(|text| AttachedReport::from_json(&text).into_diagnostic());
    read.wrap_err_with(|| path.display().to_string())
}

pub(super) fn print_report(report: &Report, folder: &Path, views: &Views) -> Result<(), Diagnostic> {
    let beside = views.beside.iter().map(|path| read_beside(path)).collect::<Result<Vec<_>, _>>()?;
    let detail = if views.all { Detail::All } else { Detail::Brief };
    let style = if std::io::stdout().is_terminal() && std::env::var_os("NO_COLOR").is_none_or(|v| v.is_empty()) {
        Style::Colour
    } else {
        Style::Plain
    };
    for format in &views.format {
        let text = match format {
            Format::Terminal => {
                luxproof_report::terminal(report, screen(style, detail), Some(&folder.display().to_string()))
            }
            Format::Json => json(report)?,
            Format::Markdown => luxproof_report::markdown(report, views.link.as_deref()),
            Format::Junit => luxproof_report::junit(report),
            Format::Csv => luxproof_report::csv(report),
            Format::Html => page(report, folder, &beside),
        };
        let text = format!("{}\n", text.trim_end());
        if *format == Format::Terminal && style == Style::Colour { print_styled(&text)? } else { print(&text)? }
    }
    Ok(())
}

/// The screen that is printed on: as wide as COLUMNS says, or else as the terminal.
pub(super) fn screen(style: Style, detail: Detail) -> Screen {
    let given = std::env::var("COLUMNS").ok().and_then(|columns| columns.parse().ok()).filter(|n| *n > 0);
    let width = given.or_else(|| terminal_size_of(std::io::stdout()).map(|(width, _)| usize::from(width.0)));
    Screen::new(style, detail, letters(), width)
}

/// The letters of standard output: those of the locale on a terminal, Unicode in a file.
fn letters() -> Letters {
    let variables = ["LC_ALL", "LC_CTYPE", "LANG"].into_iter().filter_map(|name| std::env::var(name).ok());
    let locale = variables.into_iter().find(|value| !value.is_empty()).unwrap_or_default().to_lowercase();
    if std::io::stdout().is_terminal() && !locale.ends_with("utf-8") && !locale.ends_with("utf8") {
        Letters::Ascii
    } else {
        Letters::Unicode
    }
}

/// The page, which lies in the run's folder, too; on a terminal only its place is printed.
fn page(report: &Report, folder: &Path, beside: &[AttachedReport]) -> String {
    let page = luxproof_report::page(report, beside);
    match write_page(report, &page, folder) {
        Some(file) if std::io::stdout().is_terminal() => file.display().to_string(),
        _ => page,
    }
}

/// Keeps the page of a report in its run's folder.
pub(super) fn keep_page(report: &Report, folder: &Path) -> Option<PathBuf> {
    write_page(report, &luxproof_report::page(report, &[]), folder)
}

/// The path of a written page. A failure is only a message, because the report itself is already written.
fn write_page(report: &Report, page: &str, folder: &Path) -> Option<PathBuf> {
    match luxproof_report::keep_page(report, page, folder) {
        Ok(file) => Some(file),
        Err(error) => {
            tracing::warn!(folder = %folder.display(), %error, "the page is not kept");
            None
        }
    }
}

pub(super) fn view(args: &ReportArgs) -> Result<Exit, Diagnostic> {
    if args.results.len() > 1 {
        return Err(miette::miette!(
            help = "give one run, or `--from CACHE` and the specs",
            "`report` prints one run, and {} are given",
            args.results.len()
        ));
    }
    let narrowed = !args.choice.narrowed.procedures.is_empty() || !args.choice.engines.is_empty();
    if narrowed && !args.budget {
        return Err(miette::miette!(
            help = "add `--budget`, or `--from CACHE` and the specs",
            "`--procedures` and `--engines` choose what `--budget` prints of a run"
        ));
    }
    let run = named_or_last(args.results.first().map(PathBuf::as_path))?;
    let file = report_file(&run);
    let mut report = read_report(&run)?;
    let exit = report.exit();
    if args.budget {
        report.comparisons.retain(|c| args.choice.asks_for(&c.key));
        print(&luxproof_report::budgets(&report))?;
    } else {
        print_report(&report, file.parent().unwrap_or(Path::new("")), &args.views)?;
    }
    Ok(exit)
}

fn read_text(file: &Path) -> Result<String, Diagnostic> {
    let bytes = files::read_stored(file).into_diagnostic()?;
    String::from_utf8(bytes).into_diagnostic().wrap_err_with(|| file.display().to_string())
}

/// The report of a run that is named by its file or its folder.
pub(super) fn report_file(of: &Path) -> PathBuf {
    if of.is_dir() { of.join(luxproof_model::REPORT_FILE) } else { of.to_owned() }
}

pub(super) fn read_report(of: &Path) -> Result<Report, Diagnostic> {
    let file = &report_file(of);
    if of.is_dir() && !file.exists() {
        return Err(miette::miette!(
            help = "give the folder of a run, or its report.json",
            "{} contains no {}",
            of.display(),
            luxproof_model::REPORT_FILE
        ));
    }
    luxproof_report_file::read(file).into_diagnostic()
}
