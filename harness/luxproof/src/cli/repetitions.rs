//! `luxproof selftest --repetitions`: which engines read which specs again and again, and how accurately.

use std::path::PathBuf;

use clap::Args;
use miette::Report as Diagnostic;

use super::measuring::Bar;
use luxproof_audit::measure::cache::Cache;
use luxproof_audit::measure::{Machine, Reader};
use luxproof_audit::plan::Selection;
use luxproof_console::diagnose;
use luxproof_engines::EngineRoot;
use luxproof_lab::selftest::repetitions::{Honesty, Options, repetitions};
use luxproof_model::ProcedureId;
use luxproof_process::process;
use luxproof_spec::{Trust, filtered, suite};

#[derive(Debug, Args)]
pub(super) struct RepetitionArgs {
    /// Check the standard errors of renderers with N seeds
    #[arg(
        long, value_name = "N", requires = "specs", conflicts_with_all = ["calibration", "naming"],
        value_parser = clap::value_parser!(u32).range(2..)
    )]
    pub(super) repetitions: Option<u32>,
    /// With --repetitions: spec files, folders of specs, or patterns
    #[arg(value_name = "SPEC", requires = "repetitions")]
    specs: Vec<PathBuf>,
    /// With --repetitions: engines [default: those of the spec, else all]
    #[arg(long, value_delimiter = ',', value_name = "NAMES", requires = "repetitions", hide_short_help = true)]
    engines: Vec<String>,
    /// With --repetitions: procedures [default: all]
    #[arg(long, value_delimiter = ',', value_name = "NAMES", requires = "repetitions", hide_short_help = true)]
    procedures: Vec<ProcedureId>,
    /// With --repetitions: only cases that match a glob or contain this text
    #[arg(long, value_name = "PATTERN", requires = "repetitions", hide_short_help = true)]
    filter: Vec<String>,
    /// With --repetitions: relative standard error to reach [default: that of the spec]
    #[arg(long, value_name = "E", requires = "repetitions", hide_short_help = true)]
    relative_error: Option<f64>,
    /// With --repetitions: time limit of a job [default: that of the spec]
    #[arg(long, value_name = "SECONDS", requires = "repetitions", hide_short_help = true)]
    seconds: Option<f64>,
    /// With --repetitions: threads or processes at the same time [default: one per core]
    #[arg(long, value_name = "N", requires = "repetitions", hide_short_help = true)]
    jobs: Option<usize>,
}

/// Reads anew what the cache does not hold of the same seed, so that more seeds, or a test that was interrupted, go on from there.
pub(super) fn repeat(
    args: &RepetitionArgs,
    seeds: u32,
    seed: u64,
    site: &EngineRoot,
    cache: Cache,
) -> Result<Honesty, Diagnostic> {
    if ![args.relative_error, args.seconds].into_iter().flatten().all(|x| x.is_finite() && x > 0.0) {
        return Err(miette::miette!("--relative-error and --seconds must be numbers above 0"));
    }
    let selection = Selection { engines: args.engines.clone(), procedures: args.procedures.clone(), seed };
    let mut cases =
        suite(&args.specs, Trust::Own).and_then(|all| Ok(filtered(all, &args.filter)?)).map_err(diagnose)?;
    // A choice of procedures that concerns no case is refused by the planner.
    if cases.iter().any(|case| selection.concerns(case)) {
        cases.retain(|case| selection.concerns(case));
    }
    let machine = Machine::new(args.jobs.unwrap_or_else(process::cores));
    let options = Options {
        reader: Reader { cache: Some(cache), ..Reader::bare(site, machine) },
        selection,
        seeds: seeds as usize,
        relative_error: args.relative_error,
        seconds: args.seconds,
        progress: &Bar::new(),
    };
    repetitions(&mut cases, &options).map_err(diagnose)
}
