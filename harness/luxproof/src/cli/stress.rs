//! `luxproof stress`: metamorphic laws on every engine, and a matrix of what breaks where.

use std::time::Duration;

use clap::{Args, ValueEnum};
use miette::{IntoDiagnostic, Report as Diagnostic};

use super::measuring::{Bar, MeasuringArgs};
use luxproof_console::diagnose;
use luxproof_console::{json, print};
use luxproof_engines::{Coordinates, EngineRoot};
use luxproof_lab::stress::{self, Magnitudes, Options, StressReport};
use luxproof_model::EngineName;
use luxproof_model::Exit;
use luxproof_process::files;
use luxproof_spec::{Budget, Case, Trust, suggestion, suite};
use luxproof_verdict::KnownDeviations;

#[derive(Debug, Args)]
pub(super) struct StressArgs {
    #[command(flatten)]
    measuring: MeasuringArgs,
    /// Check only these laws
    #[arg(long, value_delimiter = ',', value_name = "NAMES")]
    laws: Vec<String>,
    /// Do not scale coordinates for 32-bit floats
    #[arg(long)]
    raw: bool,
    /// Start no job after this time, per spec
    ///
    /// Run the command again to continue.
    #[arg(long, default_value_t = 15.0, value_name = "MINUTES")]
    minutes: f64,
    /// Time limit of one sampled job
    #[arg(long, default_value_t = 3.0, value_name = "SECONDS")]
    seconds: f64,
    /// Time after which a job hangs
    #[arg(long, default_value_t = 60.0, value_name = "SECONDS")]
    limit: f64,
    /// Format to print
    #[arg(long, value_enum, value_name = "FORMAT", default_value_t = StressFormat::Terminal)]
    format: StressFormat,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum StressFormat {
    Terminal,
    Json,
    Markdown,
}

/// Stresses every case; the exit code tells whether our own exact solver broke a law.
pub(super) fn run(args: &StressArgs, site: &EngineRoot, trust: Trust) -> Result<Exit, Diagnostic> {
    for law in &args.laws {
        if luxproof_laws::find(law).is_none() {
            let help = suggestion(law, luxproof_laws::all().map(|l| l.id));
            return Err(miette::miette!(help = help, "there is no law `{law}`"));
        }
    }
    if ![args.minutes, args.seconds, args.limit].into_iter().all(|x: f64| x.is_finite() && x >= 0.0) {
        return Err(miette::miette!("--minutes, --seconds and --limit must be numbers from 0"));
    }
    let cases: Vec<Case> =
        suite(&args.measuring.specs, trust).map_err(diagnose)?.into_iter().filter(stress::concerns).collect();
    if cases.is_empty() {
        return Err(miette::miette!("there is neither direct nor indirect illuminance to stress in these specs"));
    }
    let subjects = args.measuring.subjects(site)?;
    let record = KnownDeviations::built_in().into_diagnostic()?;
    let mut reports = vec![];
    for case in &cases {
        let folder = args.measuring.folder("stress", &case.path);
        let _claim = MeasuringArgs::claim(&folder, trust)?;
        let options = Options {
            reader: args.measuring.reader(site, &folder)?,
            time: Duration::from_secs_f64((60.0 * args.minutes).min(1e9)),
            budget: Budget { relative_error: 1e-3, seconds: args.seconds },
            limit: Duration::from_secs_f64(args.limit.clamp(1.0, 1e9)),
            laws: &args.laws,
            magnitudes: Magnitudes::All,
            seed: args.measuring.seed,
            coordinates: if args.raw { Coordinates::Raw } else { Coordinates::Fitted },
            known: if args.raw { &[] } else { record.breaks() },
        };
        let report = stress::stress(case, &subjects, &options, &Bar::new());
        let which = if cases.len() == 1 { String::new() } else { format!("-{}", case.name.replace('/', "-")) };
        files::keep_json(&folder.join(format!("stress{which}.json")), &report).into_diagnostic()?;
        reports.push(report);
    }
    print(&view(&reports, args.format)?)?;
    let broken = reports.iter().any(|r| r.broken_by(&EngineName::SIMULATOR).next().is_some());
    Ok(if broken { Exit::Failed } else { Exit::Passed })
}

/// The texts of reports, one after the other.
fn joined(reports: &[StressReport], text: fn(&StressReport) -> String) -> String {
    reports.iter().map(text).collect::<Vec<_>>().join("\n")
}

fn view(reports: &[StressReport], format: StressFormat) -> Result<String, Diagnostic> {
    Ok(match (format, reports) {
        (StressFormat::Terminal, _) => joined(reports, StressReport::terminal),
        (StressFormat::Markdown, _) => joined(reports, StressReport::markdown),
        (StressFormat::Json, [one]) => json(one)?,
        (StressFormat::Json, all) => json(all)?,
    })
}
