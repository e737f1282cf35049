//! `luxproof selftest`: the scorecard of faults, how good intervals and p-values are, and whether stated errors are honest.

use clap::Args;
use miette::{IntoDiagnostic, Report as Diagnostic};

use super::TextOrJson;
use super::repetitions::{RepetitionArgs, repeat};
use luxproof_audit::measure::cache::Cache;
use luxproof_console::{json, print};
use luxproof_engines::EngineRoot;
use luxproof_lab::selftest::{calibrations, coverage, naming, selftest};
use luxproof_model::Exit;

#[derive(Debug, Args)]
pub(super) struct SelftestArgs {
    /// Noisy runs per fault
    #[arg(long, default_value_t = 20, value_name = "N")]
    runs: usize,
    /// Noisy runs without a fault, per case
    #[arg(long, default_value_t = 100, value_name = "N")]
    clean_runs: usize,
    /// Seed of the noise
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Only check the intervals and p-values of verdicts
    #[arg(long)]
    calibration: bool,
    /// Inject N random faults of each kind
    ///
    /// Counts right, wrong and missing names.
    #[arg(long, value_name = "N", conflicts_with = "calibration")]
    naming: Option<usize>,
    /// Check the simulator's stated errors by path tracing
    #[arg(long, value_name = "ROOMS", conflicts_with_all = ["calibration", "naming"])]
    coverage: Option<usize>,
    /// With --coverage: relative error of the simulator
    #[arg(long, value_name = "E", default_value_t = 0.02, requires = "coverage")]
    coverage_error: f64,
    #[command(flatten)]
    repeated: RepetitionArgs,
    /// Format to print
    #[arg(long, value_enum, value_name = "FORMAT", default_value_t = TextOrJson::Terminal)]
    format: TextOrJson,
}

pub(super) fn run_selftest(
    args: &SelftestArgs,
    site: &EngineRoot,
    cache: impl FnOnce() -> Result<Cache, Diagnostic>,
) -> Result<Exit, Diagnostic> {
    if let Some(seeds) = args.repeated.repetitions {
        let found = repeat(&args.repeated, seeds, args.seed, site, cache()?)?;
        print(&match args.format {
            TextOrJson::Terminal => found.to_string(),
            TextOrJson::Json => json(&found)?,
        })?;
        return Ok(match (found.is_complete(), found.is_good()) {
            (false, _) => Exit::Engine,
            (true, false) => Exit::Failed,
            (true, true) => Exit::Passed,
        });
    }
    if args.calibration {
        let found = calibrations(args.seed);
        print(&match args.format {
            TextOrJson::Terminal => found.to_string(),
            TextOrJson::Json => serde_json::to_string(&found).into_diagnostic()? + "\n",
        })?;
        return Ok(if found.is_good() { Exit::Passed } else { Exit::Failed });
    }
    if let Some(rooms) = args.coverage {
        let found = coverage(rooms, args.coverage_error, args.seed);
        print(&match args.format {
            TextOrJson::Terminal => found.to_string(),
            TextOrJson::Json => json(&found)?,
        })?;
        return Ok(if found.is_good() { Exit::Passed } else { Exit::Failed });
    }
    if let Some(faults) = args.naming {
        let found = naming(faults, args.seed).into_diagnostic()?;
        print(&match args.format {
            TextOrJson::Terminal => found.to_string(),
            TextOrJson::Json => json(&found)?,
        })?;
        return Ok(Exit::Passed);
    }
    let card = selftest(args.runs.max(1), args.clean_runs, args.seed).into_diagnostic()?;
    print(&match args.format {
        TextOrJson::Terminal => card.to_string(),
        TextOrJson::Json => json(&card)?,
    })?;
    Ok(if card.is_good() { Exit::Passed } else { Exit::Failed })
}
