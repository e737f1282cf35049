//! `luxproof bench`: run time against error, tables and plots.

use std::path::PathBuf;
use std::time::Duration;

use clap::{Args, ValueEnum};
use miette::{IntoDiagnostic, Report as Diagnostic};

use super::measuring::{Bar, MeasuringArgs};
use luxproof_console::diagnose;
use luxproof_console::{json, print};
use luxproof_engines::EngineRoot;
use luxproof_lab::bench::{self, BenchReport, Options, SettingEffects};
use luxproof_model::Exit;
use luxproof_model::ProcedureId;
use luxproof_process::files;
use luxproof_spec::{Trust, suite};

#[derive(Debug, Args)]
pub(super) struct BenchArgs {
    #[command(flatten)]
    measuring: MeasuringArgs,
    /// Measure only these procedures
    ///
    /// The default is all but luminous intensity.
    #[arg(long, value_delimiter = ',', value_name = "NAMES")]
    procedures: Vec<ProcedureId>,
    /// Repetitions with different seeds
    #[arg(long, default_value_t = 3, value_name = "N")]
    repetitions: usize,
    /// Time limits to measure
    #[arg(long, value_delimiter = ',', value_name = "SECONDS", default_values_t = [0.25, 1.0, 4.0, 12.0])]
    seconds: Vec<f64>,
    /// Also vary each setting of the engines alone
    #[arg(long)]
    settings: bool,
    /// Start no job after this time, per case
    ///
    /// Run the command again to continue.
    #[arg(long, default_value_t = 7.0, value_name = "MINUTES")]
    minutes: f64,
    /// Formats to print
    ///
    /// The option may be given several times.
    #[arg(long, value_enum, value_name = "FORMAT", default_values_t = [BenchFormat::Terminal])]
    format: Vec<BenchFormat>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum BenchFormat {
    Terminal,
    Json,
    Markdown,
    Csv,
    Svg,
}

pub(super) fn run(args: &BenchArgs, site: &EngineRoot, trust: Trust) -> Result<Exit, Diagnostic> {
    if !args.seconds.iter().chain([&args.minutes]).all(|s| s.is_finite() && *s >= 0.0) || args.seconds.is_empty() {
        return Err(miette::miette!("--seconds and --minutes must be numbers from 0"));
    }
    let cases = suite(&args.measuring.specs, trust).map_err(diagnose)?;
    let subjects = args.measuring.subjects(site)?;
    let first = args.measuring.specs.first().map_or(std::path::Path::new("suite"), PathBuf::as_path);
    let folder = args.measuring.folder("bench", first);
    let _claim = MeasuringArgs::claim(&folder, trust)?;
    let options = Options {
        reader: args.measuring.reader(site, &folder)?,
        repetitions: args.repetitions.max(1),
        time: Duration::from_secs_f64((60.0 * args.minutes).min(1e9)),
        seconds: &args.seconds,
        procedures: &args.procedures,
        seed: args.measuring.seed,
        settings: if args.settings { SettingEffects::Measured } else { SettingEffects::Omitted },
    };
    let (mut report, bar) = (BenchReport::default(), Bar::new());
    for case in &cases {
        bench::bench(case, &subjects, &options, &bar, &mut report);
    }
    drop(bar);
    files::keep_json(&folder.join("bench.json"), &report).into_diagnostic()?;
    for format in &args.format {
        print(&match format {
            BenchFormat::Terminal => report.terminal(),
            BenchFormat::Json => json(&report)?,
            BenchFormat::Markdown => report.markdown(),
            BenchFormat::Csv => report.csv(),
            BenchFormat::Svg => report.svg(),
        })?;
    }
    Ok(Exit::Passed)
}
