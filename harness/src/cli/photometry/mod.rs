//! `luxproof photometry FILE...`: what a photometric file says, what is doubtful in it, its diagram, its conversion; and
//! `luxproof photometry report | diff | orient`: all its figures, how two files differ, which way a luminaire faces.

mod convert;
mod diff;
mod figures;
mod orient;
mod polar;
mod report;
mod sarif;
mod summary;
mod web;

#[cfg(test)]
mod tests;

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use clap::{Args, Subcommand, ValueEnum};
use luminaire::calculators::zonal_cavity::{UtilizationTable, ZonalFlux};
use luminaire::photometry::{self, FORGIVEN, Lint, Photometry, ReadError, Severity, Tolerance};
use miette::{IntoDiagnostic, Report as Diagnostic, WrapErr, miette};

use crate::cli::diagnostic::diagnose;
use crate::report::Exit;
use crate::spec::{SpecError, Trust};
use crate::system::files;

use summary::Summary;

/// Arguments of `luxproof photometry`.
#[derive(Debug, Args)]
#[command(args_conflicts_with_subcommands = true, subcommand_negates_reqs = true)]
pub(crate) struct PhotometryArgs {
    #[command(subcommand)]
    action: Option<Action>,
    /// Photometric files: LM-63 (.ies), EULUMDAT (.ldt), TM-33 (.xml), GLDF (.gldf). Of several in one file, name one: lamp.gldf#NAME
    #[arg(required = true, value_name = "FILE")]
    files: Vec<PathBuf>,
    /// Print JSON, short for --format json
    #[arg(long, conflicts_with = "format")]
    json: bool,
    /// Print what was tolerated or is doubtful instead of the summary
    #[arg(long)]
    lint: bool,
    /// Print what was tolerated or is doubtful instead of the summary, and exit with 1 where there is anything
    #[arg(long, value_enum, value_name = "WHAT", conflicts_with = "utilization")]
    deny: Option<Deny>,
    /// Print coefficients of utilization over room cavity ratios and reflectances instead of the summary
    #[arg(long, conflicts_with_all = ["lint", "json", "format"])]
    utilization: bool,
    /// How to print
    #[arg(long, value_enum, value_name = "FORMAT", default_value_t = Format::Terminal)]
    format: Format,
    /// Draw the polar intensity diagram of the one FILE
    #[arg(long, value_name = "SVG")]
    polar: Option<PathBuf>,
    #[command(flatten)]
    reading: ReadingArgs,
    #[command(flatten)]
    conversion: convert::ConversionArgs,
}

/// How files are read.
#[derive(Debug, Args)]
struct ReadingArgs {
    /// Read files with harmless damage, too: watts of -1, negative fields that nothing depends on, numbers too many or too few where the
    /// rest tells which. What was forgiven is told
    #[arg(long)]
    tolerant: bool,
}

impl ReadingArgs {
    fn tolerance(&self) -> Tolerance {
        if self.tolerant { Tolerance::Harmless } else { Tolerance::Strict }
    }
}

#[derive(Debug, Subcommand)]
enum Action {
    /// Every figure of a luminaire: zonal lumens, beam, NEMA, BUG, flux code, spacing, luminances, UGR; diagrams
    Report(report::ReportArgs),
    /// How two files differ, direction by direction; exits with 1 where rounding does not explain it
    Diff(diff::DiffArgs),
    /// Which way a luminaire faces, by its format and by its light; writes it turned
    Orient(orient::OrientArgs),
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Format {
    Terminal,
    Json,
    /// Static analysis results for code-review tools; with --lint
    Sarif,
}

/// What of a file is not let pass.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Deny {
    /// Whatever was tolerated or is doubtful
    Warnings,
}

struct Reading {
    file: PathBuf,
    read: Result<Photometry, ReadError>,
}

/// Reads the files, prints to stdout, writes what was asked for; a refused file makes the exit code 2.
pub(crate) fn run(args: &PhotometryArgs, trust: Trust) -> Result<Exit, Diagnostic> {
    match &args.action {
        Some(Action::Report(args)) => return report::run(args, trust),
        Some(Action::Diff(args)) => return diff::run(args, trust),
        Some(Action::Orient(args)) => return orient::run(args, trust),
        None => {}
    }
    let format = if args.json { Format::Json } else { args.format };
    if format == Format::Sarif && !args.lint {
        return Err(miette!(help = "add --lint", "--format sarif prints lints only"));
    }
    if args.files.len() > 1 && (args.polar.is_some() || args.conversion.is_asked()) {
        return Err(miette!(help = "give one FILE", "--polar and --convert write one file"));
    }
    let tolerance = args.reading.tolerance();
    let readings: Vec<Reading> = args.files.iter().map(|file| Reading::of(file, trust, tolerance)).collect();
    let text = match format {
        Format::Json => json(&readings)?,
        Format::Sarif => sarif::log(&readings)?,
        Format::Terminal if args.lint || args.deny.is_some() => lints(&readings),
        Format::Terminal if args.utilization => utilization(&readings)?,
        Format::Terminal => summaries(&readings),
    };
    super::print(&text)?;
    // Where lints are printed they say it themselves.
    let forgiven = |reading: &&Reading| !args.lint && args.deny.is_none() && reading.read.is_ok();
    for reading in readings.iter().filter(forgiven) {
        let lints = reading.read.iter().flat_map(|photometry| &photometry.lints);
        for lint in lints.filter(|lint| lint.code.starts_with(FORGIVEN)) {
            super::complain(&told(&reading.file.display().to_string(), lint));
        }
    }
    let mut turns = vec![];
    for reading in &readings {
        if let Ok(photometry) = &reading.read {
            turns.extend(write_files(args, &reading.file, photometry)?);
        }
    }
    let is_warning = |lint: &Lint| lint.severity == Severity::Warning;
    let is_doubtful = readings.iter().any(Reading::is_doubtful) || turns.iter().any(is_warning);
    let denied = args.deny == Some(Deny::Warnings) && is_doubtful;
    let exit = if denied { Exit::Failed } else { Exit::Passed };
    Ok(if Reading::all_sound(readings).is_some() { exit } else { Exit::Usage })
}

fn json(readings: &[Reading]) -> Result<String, Diagnostic> {
    let records: Vec<serde_json::Value> = readings.iter().map(Reading::record).collect::<Result<_, _>>()?;
    super::json(&records)
}

impl Reading {
    fn of(file: &Path, trust: Trust, tolerance: Tolerance) -> Self {
        let open = |path: &Path| trust.read_named(file.parent().unwrap_or(Path::new("")), path);
        Self { file: file.to_path_buf(), read: photometry::read_tolerantly_by(file, &open, tolerance) }
    }

    /// Whether it has warnings.
    fn is_doubtful(&self) -> bool {
        let is_warning = |lint: &Lint| lint.severity == Severity::Warning;
        self.read.as_ref().is_ok_and(|photometry| photometry.lints.iter().any(is_warning))
    }

    /// What was read, in order; `None`, and every refusal told on standard error, where anything was refused.
    fn all_sound(readings: Vec<Self>) -> Option<Vec<Photometry>> {
        let told = |error: &ReadError| super::complain(&format!("{:?}", diagnose(spec_error(error))));
        let sound: Vec<Option<Photometry>> = readings.into_iter().map(|r| r.read.inspect_err(told).ok()).collect();
        sound.into_iter().collect()
    }

    fn record(&self) -> Result<serde_json::Value, Diagnostic> {
        match &self.read {
            Ok(photometry) => serde_json::to_value(Summary::of(&self.file, photometry)).into_diagnostic(),
            Err(error) => Ok(serde_json::json!({
                "file": self.file.display().to_string(),
                "error": {"line": error.line, "column": error.column, "message": error.message(), "help": error.help()},
            })),
        }
    }
}

/// Reads the files of a subcommand; `None` where one was refused. What is denied is told on standard error.
fn read_all<const N: usize>(files: [&Path; N], deny: Option<Deny>, trust: Trust) -> Option<([Photometry; N], Exit)> {
    let readings = files.map(|file| Reading::of(file, trust, Tolerance::Strict));
    let denied = deny == Some(Deny::Warnings) && readings.iter().any(Reading::is_doubtful);
    if denied {
        super::complain(lints(&readings).trim_end());
    }
    let sound: Vec<Photometry> = Reading::all_sound(readings.into())?;
    let exit = if denied { Exit::Failed } else { Exit::Passed };
    sound.try_into().ok().map(|sound| (sound, exit))
}

/// One line a lint, as compilers print them.
fn lints(readings: &[Reading]) -> String {
    let mut text = String::new();
    for reading in readings {
        let file = reading.file.display();
        for lint in reading.read.iter().flat_map(|photometry| &photometry.lints) {
            // Writing to a string cannot fail.
            writeln!(text, "{}", told(&file.to_string(), lint)).ok();
        }
    }
    text
}

fn told(file: &str, lint: &Lint) -> String {
    let place = if lint.line > 0 { format!("{file}:{}", lint.line) } else { file.to_owned() };
    let severity = if lint.severity == Severity::Warning { "warning" } else { "note" };
    format!("{place}: {severity}: {} [{}]", lint.message, lint.code)
}

fn summaries(readings: &[Reading]) -> String {
    let read = |reading: &Reading| reading.read.as_ref().ok().map(|p| Summary::of(&reading.file, p).to_string());
    readings.iter().filter_map(read).collect::<Vec<String>>().join("\n")
}

/// The customary table of each file, by its lamps' flux or, in absolute photometry, its own.
fn utilization(readings: &[Reading]) -> Result<String, Diagnostic> {
    let mut tables = vec![];
    for reading in readings {
        let Ok(photometry) = &reading.read else { continue };
        let distribution = &photometry.distribution;
        let (lumens, whose) = match photometry.lamp_lumens {
            Some(lumens) => (lumens, "of lamp flux"),
            None => (distribution.flux().value(), "of luminaire flux (absolute photometry)"),
        };
        let table = UtilizationTable::customary(&ZonalFlux::of(distribution), lumens)
            .into_diagnostic()
            .wrap_err_with(|| reading.file.display().to_string())?;
        tables.push(format!("{}: {whose}, {lumens:.1} lm\n{table}", reading.file.display()));
    }
    Ok(tables.join("\n"))
}

fn write_files(args: &PhotometryArgs, file: &Path, photometry: &Photometry) -> Result<Option<Lint>, Diagnostic> {
    if let Some(out) = &args.polar {
        let name = file.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned());
        save(out, &polar::diagram(&name, photometry))?;
    }
    args.conversion.run(photometry)
}

fn save(path: &Path, text: &str) -> Result<(), Diagnostic> {
    files::keep_shared(path, text.as_bytes()).into_diagnostic()
}

pub(super) fn spec_error(error: &ReadError) -> SpecError {
    let known = |n: usize| (n > 0).then_some(n);
    SpecError {
        file: error.file.clone(),
        line: known(error.line),
        column: known(error.column),
        message: error.message(),
        help: Some(error.help().into()),
    }
}
