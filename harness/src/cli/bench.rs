//! `luxproof bench`: run time against error, tables and plots.

use std::path::PathBuf;
use std::time::Duration;

use clap::{Args, ValueEnum};
use miette::{IntoDiagnostic, Report as Diagnostic};

use super::diagnostic::diagnose;
use super::measuring::{Bar, MeasuringArgs};
use super::{json, print};
use crate::engines::Site;
use crate::experiments::bench::{self, BenchReport, Knobs, Options};
use crate::record::ProcedureId;
use crate::report::Exit;
use crate::spec::{Trust, suite};
use crate::system::claim::Claim;
use crate::system::files;

#[derive(Debug, Args)]
pub(super) struct BenchArgs {
    #[command(flatten)]
    measuring: MeasuringArgs,
    /// Procedures to bench, by name [default: all of the spec but luminous intensity]
    #[arg(long, value_delimiter = ',', value_name = "NAMES")]
    procedures: Vec<ProcedureId>,
    /// Readings a rung, each with a seed of its own
    #[arg(long, default_value_t = 3, value_name = "N")]
    repetitions: usize,
    /// Seconds of the rungs of renderers' sampled light
    #[arg(long, value_delimiter = ',', value_name = "SECONDS", default_values_t = [0.25, 1.0, 4.0, 12.0])]
    seconds: Vec<f64>,
    /// Also try the engines' settings one by one: which changes the result, and which does nothing
    #[arg(long)]
    knobs: bool,
    /// Minutes after which no reading starts, for each case; run again to go on from there
    #[arg(long, default_value_t = 7.0, value_name = "MINUTES")]
    minutes: f64,
    /// Views to print
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

pub(super) fn run(args: &BenchArgs, site: &Site, trust: Trust) -> Result<Exit, Diagnostic> {
    if !args.seconds.iter().chain([&args.minutes]).all(|s| s.is_finite() && *s >= 0.0) || args.seconds.is_empty() {
        return Err(miette::miette!("--seconds and --minutes must be numbers from 0"));
    }
    let cases = suite(&args.measuring.specs, trust).map_err(diagnose)?;
    let subjects = args.measuring.subjects(site)?;
    let first = args.measuring.specs.first().map_or(std::path::Path::new("suite"), PathBuf::as_path);
    let folder = args.measuring.folder("bench", first);
    let _claim = Claim::of(&folder).into_diagnostic()?;
    let options = Options {
        reader: args.measuring.reader(site, &folder)?,
        repetitions: args.repetitions.max(1),
        time: Duration::from_secs_f64((60.0 * args.minutes).min(1e9)),
        seconds: &args.seconds,
        procedures: &args.procedures,
        seed: args.measuring.seed,
        knobs: if args.knobs { Knobs::Tried } else { Knobs::Left },
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
