//! `luxproof selftest --repetitions`: which engines read which specs again and again, and how accurately.

use std::path::PathBuf;

use clap::Args;
use miette::Report as Diagnostic;

use super::diagnostic::diagnose;
use super::measuring::Bar;
use crate::engines::Site;
use crate::experiments::selftest::repetitions::{Honesty, Options, repetitions};
use crate::measure::cache::Cache;
use crate::measure::{Machine, Reader};
use crate::plan::Selection;
use crate::record::ProcedureId;
use crate::spec::{Trust, filtered, suite};
use crate::system::process;

#[derive(Debug, Args)]
pub(super) struct RepetitionArgs {
    /// Let renderers read the specs with so many seeds: are their standard errors what they say?
    #[arg(
        long, value_name = "N", requires = "specs", conflicts_with_all = ["calibration", "naming"],
        value_parser = clap::value_parser!(u32).range(2..)
    )]
    pub(super) repetitions: Option<u32>,
    /// Of --repetitions: spec files, folders of them or patterns
    #[arg(value_name = "SPEC", requires = "repetitions")]
    specs: Vec<PathBuf>,
    /// Of --repetitions: engines by name [default: those of the spec, else all that are there]
    #[arg(long, value_delimiter = ',', value_name = "NAMES", requires = "repetitions")]
    engines: Vec<String>,
    /// Of --repetitions: procedures by name [default: all of the spec]
    #[arg(long, value_delimiter = ',', value_name = "NAMES", requires = "repetitions")]
    procedures: Vec<ProcedureId>,
    /// Of --repetitions: only cases whose name matches, a glob or a part of it; may be given several times
    #[arg(long, value_name = "PATTERN", requires = "repetitions")]
    filter: Vec<String>,
    /// Of --repetitions: relative standard error of a reading [default: the spec's]
    #[arg(long, value_name = "E", requires = "repetitions")]
    relative_error: Option<f64>,
    /// Of --repetitions: seconds of a reading [default: the spec's]
    #[arg(long, value_name = "SECONDS", requires = "repetitions")]
    seconds: Option<f64>,
    /// Of --repetitions: threads or processes at a time [default: one a core]
    #[arg(long, value_name = "N", requires = "repetitions")]
    jobs: Option<usize>,
}

/// Reads anew what the cache does not hold of the same seed, so that more seeds, or a test that was interrupted, go on from there.
pub(super) fn repeat(
    args: &RepetitionArgs,
    seeds: u32,
    seed: u64,
    site: &Site,
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
