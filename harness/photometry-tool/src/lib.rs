//! The command `luxproof photometry FILE...`: summary, lints, diagram and conversion of photometric files.
//!
//! Its subcommands are `report` (all figures), `diff` (the difference of two files) and `orient` (the orientation).

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
use luxproof_calculators::zonal_cavity::{UtilizationTable, ZonalFlux};
use luxproof_photometry::{FORGIVEN, Lint, Photometry, ReadError, Severity, Tolerance};
use miette::{IntoDiagnostic, Report as Diagnostic, WrapErr, miette};

use luxproof_console::diagnose;
use luxproof_model::Exit;
use luxproof_process::files;
use luxproof_spec::{SpecError, Trust};

use summary::Summary;

/// Arguments of `luxproof photometry`.
#[derive(Debug, Args)]
#[command(args_conflicts_with_subcommands = true, subcommand_negates_reqs = true)]
pub struct PhotometryArgs {
    #[command(subcommand)]
    action: Option<Action>,
    /// Photometric files: .ies, .ldt, .xml (TM-33) or .gldf
    ///
    /// For one of several luminaires in a GLDF file write lamp.gldf#NAME.
    #[arg(required = true, value_name = "FILE")]
    files: Vec<PathBuf>,
    /// Short for --format json
    #[arg(long, conflicts_with = "format")]
    json: bool,
    /// Print warnings instead of the summary
    #[arg(long)]
    lint: bool,
    /// Exit with 1 if there are warnings, and print them
    #[arg(long, value_enum, value_name = "WHAT", conflicts_with = "utilization")]
    deny: Option<Deny>,
    /// Print coefficients of utilization instead of the summary
    #[arg(long, conflicts_with_all = ["lint", "json", "format"], hide_short_help = true)]
    utilization: bool,
    /// Format of the output
    #[arg(long, value_enum, value_name = "FORMAT", default_value_t = Format::Terminal)]
    format: Format,
    /// Draw the polar diagram of one file
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
    /// Also read files with harmless damage, and print what was ignored
    ///
    /// Harmless are watts of -1, negative fields without effect, and surplus or missing numbers that the rest determines.
    #[arg(long, hide_short_help = true)]
    tolerant: bool,
}

impl ReadingArgs {
    /// The tolerance of the readers.
    fn tolerance(&self) -> Tolerance {
        if self.tolerant { Tolerance::Harmless } else { Tolerance::Strict }
    }
}

#[derive(Debug, Subcommand)]
enum Action {
    /// Print all figures: lumens, beam, BUG, flux code, UGR and more
    Report(report::ReportArgs),
    /// Compare two files; exit with 1 if they differ beyond rounding
    Diff(diff::DiffArgs),
    /// Show which way a luminaire faces, and turn it
    Orient(orient::OrientArgs),
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Format {
    Terminal,
    Json,
    /// For code-review tools; needs --lint
    Sarif,
}

/// The findings that make a command fail.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Deny {
    /// All warnings
    Warnings,
}

/// The most intensities of a file that is not trusted, to be written in another format: in TM-33 each takes some 500 bytes of memory.
const MAX_CONVERTED_VALUES: usize = 250_000;

/// A file and its photometry, or the error of its reader.
struct Reading {
    file: PathBuf,
    result: Result<Photometry, SpecError>,
}

/// Reads the files, prints to stdout and writes the requested files. A refused file makes the exit code 2.
pub fn run(args: &PhotometryArgs, trust: Trust) -> Result<Exit, Diagnostic> {
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
    if args.files.len() > 1 && (args.polar.is_some() || args.conversion.is_requested()) {
        return Err(miette!(help = "give one FILE", "--polar and --convert write one file"));
    }
    let tolerance = args.reading.tolerance();
    let readings: Vec<Reading> = args.files.iter().map(|file| Reading::load(file, trust, tolerance)).collect();
    let prints_lints = args.lint || args.deny.is_some();
    let text = match format {
        Format::Json => format_json(&readings)?,
        Format::Sarif => sarif::format_log(&readings)?,
        Format::Terminal if prints_lints => format_lints(&readings),
        Format::Terminal if args.utilization => format_utilization(&readings)?,
        Format::Terminal => format_summaries(&readings),
    };
    luxproof_console::print(&text)?;
    // The list of lints contains the accepted damage already.
    if !prints_lints {
        complain_of_damage(&readings);
    }
    let mut turns = vec![];
    for reading in &readings {
        if let Ok(photometry) = &reading.result {
            let values = photometry.distribution.nodes_deg().len();
            if trust != Trust::Own && args.conversion.is_requested() && values > MAX_CONVERTED_VALUES {
                let help = "convert it without --untrusted if it is yours";
                return Err(miette!(help = help, "{values} intensities are more than {MAX_CONVERTED_VALUES}"));
            }
            turns.extend(write_files(args, &reading.file, photometry, trust)?);
        }
    }
    let has_warnings = readings.iter().any(Reading::has_warnings) || turns.iter().any(is_warning);
    let is_denied = args.deny == Some(Deny::Warnings) && has_warnings;
    let exit = if is_denied { Exit::Failed } else { Exit::Passed };
    Ok(if Reading::accept_all(readings).is_some() { exit } else { Exit::Usage })
}

/// Prints the damage that the readers accepted to stderr.
fn complain_of_damage(readings: &[Reading]) {
    for reading in readings {
        let lints = reading.result.iter().flat_map(|photometry| &photometry.lints);
        for lint in lints.filter(|lint| lint.code.starts_with(FORGIVEN)) {
            luxproof_console::complain(&format_lint(&reading.file.display().to_string(), lint));
        }
    }
}

/// Whether a lint is a warning.
fn is_warning(lint: &Lint) -> bool {
    lint.severity == Severity::Warning
}

/// All files as JSON.
fn format_json(readings: &[Reading]) -> Result<String, Diagnostic> {
    let records: Vec<serde_json::Value> = readings.iter().map(Reading::record).collect::<Result<_, _>>()?;
    luxproof_console::json(&records)
}

impl Reading {
    /// Reads a file.
    fn load(file: &Path, trust: Trust, tolerance: Tolerance) -> Self {
        let folder = file.parent().unwrap_or(Path::new(""));
        let result = luxproof_photometry::read_tolerantly_by(
            file,
            &|path| trust.check_given(file).and_then(|()| trust.read_named(folder, path)),
            tolerance,
        );
        // Here, so that no view of it forgets what may not be shown.
        let result = result.map_err(|error| spec_error(&error).withheld(trust));
        Self { file: file.to_path_buf(), result }
    }

    /// Whether the file was read with warnings.
    fn has_warnings(&self) -> bool {
        self.result.as_ref().is_ok_and(|photometry| photometry.lints.iter().any(is_warning))
    }

    /// All photometries in order; `None` where a file was refused. Prints every refusal to stderr.
    fn accept_all(readings: Vec<Self>) -> Option<Vec<Photometry>> {
        let mut accepted = vec![];
        let mut is_complete = true;
        for reading in readings {
            match reading.result {
                Ok(photometry) => accepted.push(photometry),
                Err(error) => {
                    luxproof_console::complain_of(diagnose(error));
                    is_complete = false;
                }
            }
        }
        is_complete.then_some(accepted)
    }

    /// The summary or the refusal as JSON.
    fn record(&self) -> Result<serde_json::Value, Diagnostic> {
        match &self.result {
            Ok(photometry) => serde_json::to_value(Summary::of(&self.file, photometry)).into_diagnostic(),
            Err(error) => {
                let SpecError { line, column, message, help, .. } = error;
                let (line, column) = (line.unwrap_or(0), column.unwrap_or(0));
                Ok(serde_json::json!({
                    "file": self.file.display().to_string(),
                    "error": {"line": line, "column": column, "message": message, "help": help},
                }))
            }
        }
    }
}

/// Reads the files of a subcommand; `None` where one was refused. Prints denied findings to stderr.
fn read_all<const N: usize>(files: [&Path; N], deny: Option<Deny>, trust: Trust) -> Option<([Photometry; N], Exit)> {
    let readings = files.map(|file| Reading::load(file, trust, Tolerance::Strict));
    let is_denied = deny == Some(Deny::Warnings) && readings.iter().any(Reading::has_warnings);
    if is_denied {
        luxproof_console::complain(format_lints(&readings).trim_end());
    }
    let accepted: Vec<Photometry> = Reading::accept_all(readings.into())?;
    let exit = if is_denied { Exit::Failed } else { Exit::Passed };
    accepted.try_into().ok().map(|photometries| (photometries, exit))
}

/// One line for each lint, in the style of compilers.
fn format_lints(readings: &[Reading]) -> String {
    let mut text = String::new();
    for reading in readings {
        let file = reading.file.display();
        for lint in reading.result.iter().flat_map(|photometry| &photometry.lints) {
            // Writing to a string cannot fail.
            writeln!(text, "{}", format_lint(&file.to_string(), lint)).ok();
        }
    }
    text
}

/// One lint with its place and severity.
fn format_lint(file: &str, lint: &Lint) -> String {
    let place = if lint.line > 0 { format!("{file}:{}", lint.line) } else { file.to_owned() };
    let severity = severity_name(lint.severity);
    format!("{place}: {severity}: {} [{}]", lint.message, lint.code)
}

/// The name of a severity.
const fn severity_name(severity: Severity) -> &'static str {
    match severity {
        Severity::Warning => "warning",
        Severity::Note => "note",
    }
}

/// The summaries of all accepted files.
fn format_summaries(readings: &[Reading]) -> String {
    let mut summaries = vec![];
    for reading in readings {
        if let Ok(photometry) = &reading.result {
            summaries.push(Summary::of(&reading.file, photometry).to_string());
        }
    }
    summaries.join("\n")
}

/// The customary table of each file, relative to the lamp flux or, for absolute photometry, the luminaire flux.
fn format_utilization(readings: &[Reading]) -> Result<String, Diagnostic> {
    let mut tables = vec![];
    for reading in readings {
        let Ok(photometry) = &reading.result else { continue };
        let distribution = &photometry.distribution;
        let (lumens, reference) = match photometry.lamp_lumens {
            Some(lumens) => (lumens, "of lamp flux"),
            None => (distribution.flux().value(), "of luminaire flux (absolute photometry)"),
        };
        let table = UtilizationTable::customary(&ZonalFlux::of(distribution), lumens)
            .into_diagnostic()
            .wrap_err_with(|| reading.file.display().to_string())?;
        tables.push(format!("{}: {reference}, {lumens:.1} lm\n{table}", reading.file.display()));
    }
    Ok(tables.join("\n"))
}

/// Writes the diagram and the conversion of a file, and returns the lint of the conversion.
fn write_files(
    args: &PhotometryArgs,
    file: &Path,
    photometry: &Photometry,
    trust: Trust,
) -> Result<Option<Lint>, Diagnostic> {
    if let Some(out) = &args.polar {
        let name = file.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned());
        save(out, &polar::diagram(&name, photometry), trust)?;
    }
    args.conversion.run(photometry, trust)
}

/// A title and rows of names and values.
fn format_table(title: &str, rows: &[(&str, String)]) -> String {
    let mut text = format!("{title}\n");
    for (name, value) in rows {
        text.push_str(&format!("  {name:<20} {value}\n"));
    }
    text
}

/// Writes an output file. For files of a stranger it goes through no link.
fn save(path: &Path, text: &str, trust: Trust) -> Result<(), Diagnostic> {
    trust.check_given(path).map_err(|error| files::FileError::of(path, error)).into_diagnostic()?;
    files::keep_shared(path, text.as_bytes()).into_diagnostic()
}

/// The error of a reader as an error of a spec, with a place where there is one.
pub fn spec_error(error: &ReadError) -> SpecError {
    let fault = SpecError::of(&error.file, error.message(), error.help());
    SpecError {
        line: (error.line > 0).then_some(error.line),
        column: (error.column > 0).then_some(error.column),
        ..fault
    }
}
