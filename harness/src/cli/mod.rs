//! The command line: arguments, what each command does with them, and its exit code.

mod accept;
mod bench;
mod bisect;
mod bundle;
mod cache;
mod check;
pub(crate) mod diagnostic;
mod diff;
mod engines;
mod export;
mod first;
mod history;
mod hunt;
mod import;
mod init;
mod measuring;
mod open;
pub(crate) mod photometry;
mod plan;
mod progress;
mod repetitions;
mod reproduce;
mod run;
mod selftest;
mod shell;
mod stress;
mod views;

use std::io::Write;
use std::path::{Path, PathBuf};

use clap::builder::FalseyValueParser;
use clap::{Args, CommandFactory, Parser, Subcommand, ValueEnum};
use miette::{IntoDiagnostic, Report as Diagnostic};
use serde::{Deserialize, Serialize};

use self::photometry::PhotometryArgs;
use crate::audit::{Calibration, Options, Sampling};
use crate::engines::{ExternalAnswers, ExternalJob, ExternalProbe, ExternalReadings, ExternalRequest, Site};
use crate::judge::{PolicyChoice, ProjectPolicy};
use crate::plan::{Selection, Skipping};
use crate::record::ProcedureId;
use crate::report::{Exit, Report};
use crate::spec::{Spec, Trust};
use crate::system::files::FileError;
use crate::system::printable;
use crate::system::process;

use views::Views;

/// Cross-validates renderers on luminaires: does a renderer put the right number of lux where a luminaire should?
#[derive(Debug, Parser)]
#[command(name = "luxproof", version = env!("LUXPROOF_VERSION"), about)]
pub struct Cli {
    /// Where engines are installed [default: the user's data folder]
    #[arg(long, global = true, env = "LUXPROOF_ENGINES", value_name = "DIR")]
    engines_dir: Option<PathBuf>,
    /// Where readings are kept between runs [default: the user's cache folder]
    #[arg(long, global = true, env = "LUXPROOF_CACHE", value_name = "DIR")]
    cache_dir: Option<PathBuf>,
    /// Take specs for those of a stranger: they name files below their own folders alone, start no program, and are of bounded size
    #[arg(long, global = true, env = "LUXPROOF_UNTRUSTED", value_parser = FalseyValueParser::new())]
    untrusted: bool,
    /// Print more of what happens to stderr
    #[arg(short, long, global = true, action = clap::ArgAction::Count)]
    verbose: u8,
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Write a first spec that runs, with a photometric file beside it
    Init(init::InitArgs),
    /// Make a spec folder of a scene's geometry: Radiance, Wavefront OBJ or glTF
    Import(import::ImportArgs),
    /// Run every procedure of a spec on every engine, compare and report
    Run(RunArgs),
    /// Validate specs and print the plan: what would run, what is skipped and why
    Check(Selected),
    /// Print the readings that specs ask for, as jobs that other processes and machines may take
    Plan(plan::PlanArgs),
    /// Take readings of a plan into the cache; exits with 0 when they are read, whatever the verdict
    Read(plan::ReadArgs),
    /// Write an engine's scenes, runnable by hand
    Export(export::ExportArgs),
    /// List, install or examine engines
    Engines {
        #[command(subcommand)]
        action: Option<engines::EnginesAction>,
    },
    /// What photometric files say: flux, symmetry, lint, polar diagram, conversion
    Photometry(PhotometryArgs),
    /// View a finished run again, or report what has been read of a plan
    Report(views::ReportArgs),
    /// Open a run's page in a browser
    Open(open::OpenArgs),
    /// Pack a finished run with all that it takes to make it again
    Bundle(bundle::BundleArgs),
    /// Verify a bundle and make its run again, or a paper's tables, and say what comes out the same
    Reproduce(reproduce::ReproduceArgs),
    /// Keep a history of nightly runs and draw it
    #[command(subcommand)]
    History(history::Action),
    /// What changed between two runs, a mean shift told apart from noise
    Diff(diff::DiffArgs),
    /// Find the release of an engine at which a verdict changed
    Bisect(bisect::BisectArgs),
    /// Make the readings of a run a baseline, under review and for a reason
    Accept(accept::AcceptArgs),
    /// Put known faults into right readings and see whether the harness catches and names them
    Selftest(selftest::SelftestArgs),
    /// What the cache of readings holds; take out what is damaged or long unused
    Cache {
        #[command(subcommand)]
        action: Option<cache::Action>,
    },
    /// Run time against error, for every engine, solver and preset
    Bench(bench::BenchArgs),
    /// Random specs until engines, witnesses or laws disagree; each finding shrunk, in a folder to hand over
    Hunt(hunt::HuntArgs),
    /// The smallest spec in which an engine still fails the same way
    Shrink(hunt::ShrinkArgs),
    /// Numerical stability: laws that must hold whatever the scene, driven until something breaks
    Stress(stress::StressArgs),
    /// Print what a shell needs to complete commands and options
    Completions(shell::CompletionsArgs),
    /// Write manual pages, one a command
    Man(shell::ManArgs),
    /// Take one reading for another process of this program
    #[command(name = crate::measure::READ_ONE, hide = true)]
    ReadOne,
    /// Print the JSON Schema of the spec, the project policy, the report, or what external adapters read and print
    Schema {
        /// Which schema
        #[arg(value_enum, default_value_t = SchemaOf::Spec)]
        of: SchemaOf,
    },
}

#[derive(Clone, Debug, Args, Serialize, Deserialize)]
struct Selected {
    /// Spec files, folders of them or patterns
    #[arg(required = true, value_name = "SPEC")]
    specs: Vec<PathBuf>,
    #[command(flatten)]
    #[serde(flatten)]
    choice: Choice,
}

/// What of specs is asked, whoever is.
#[derive(Clone, Debug, Args, Serialize, Deserialize)]
struct Narrowed {
    /// Procedures to run, by name [default: all of the spec]
    #[arg(long, value_delimiter = ',', value_name = "NAMES")]
    procedures: Vec<ProcedureId>,
    /// Only cases whose name matches: a glob, or a part of the name; may be given several times [default: all]
    #[arg(long, value_name = "PATTERN")]
    filter: Vec<String>,
    /// Seed of every random choice
    #[arg(long, default_value_t = 1)]
    seed: u64,
}

impl Narrowed {
    fn selection(&self, engines: &[String]) -> Selection {
        Selection { engines: engines.to_vec(), procedures: self.procedures.clone(), seed: self.seed }
    }
}

/// What of specs is asked, of whom and by whose rules.
#[derive(Clone, Debug, Args, Serialize, Deserialize)]
struct Choice {
    /// Engines to run, by name [default: those of the spec, else all that are there]
    #[arg(long, value_delimiter = ',', value_name = "NAMES")]
    engines: Vec<String>,
    #[command(flatten)]
    #[serde(flatten)]
    narrowed: Narrowed,
    /// Render everything, also what follows from other readings
    #[arg(long)]
    no_skips: bool,
    /// Folder of the run's files [default: luxproof-out/<spec name>]
    #[arg(long, value_name = "DIR")]
    #[serde(skip)]
    out: Option<PathBuf>,
    #[command(flatten)]
    policy: PolicyChoice,
}

/// How far an audit goes.
#[derive(Clone, Debug, Args, Serialize, Deserialize)]
struct Extent {
    /// When sampling stops [default: as the policy's profile says, else decided]
    #[arg(long, value_enum, value_name = "WHEN")]
    sampling: Option<Sampling>,
    /// Leave out the scenes of known answer, which tell a wrong engine from a difficult room
    #[arg(long)]
    no_calibration: bool,
}

/// What is audited and how: where that is the same, every process asks for the same readings.
#[derive(Clone, Debug, Args, Serialize, Deserialize)]
struct Audited {
    #[command(flatten)]
    #[serde(flatten)]
    selected: Selected,
    #[command(flatten)]
    #[serde(flatten)]
    extent: Extent,
}

impl Audited {
    fn options(&self, site: &Site, trust: Trust, out: PathBuf) -> Options<'static> {
        let Choice { narrowed: Narrowed { filter, .. }, policy, .. } = &self.selected.choice;
        Options {
            selection: self.selected.choice.selection(),
            filter: filter.clone(),
            skipping: self.selected.choice.skipping(),
            trust,
            policy: policy.clone(),
            sampling: self.extent.sampling,
            calibration: if self.extent.no_calibration { Calibration::LeftOut } else { Calibration::Judged },
            ..Options::new(site.clone(), out)
        }
    }
}

impl Choice {
    fn skipping(&self) -> Skipping {
        if self.no_skips { Skipping::Nothing } else { Skipping::Allowed }
    }

    fn selection(&self) -> Selection {
        self.narrowed.selection(&self.engines)
    }
}

#[derive(Debug, Args)]
#[allow(clippy::struct_excessive_bools, reason = "switches of a command line")]
struct RunArgs {
    #[command(flatten)]
    audited: Audited,
    /// Install missing engines first
    #[arg(long)]
    install: bool,
    /// Hold the readings against a baseline of `luxproof accept`: a .json file, or a folder that holds one a spec
    #[arg(long, value_name = "FILE|DIR")]
    baseline: Option<PathBuf>,
    #[command(flatten)]
    views: Views,
    /// Stop after the first case that fails; the cases left are reported as skipped
    #[arg(long)]
    fail_fast: bool,
    /// Threads or processes at a time [default: one a core]
    #[arg(long, value_name = "N", value_parser = at_least_one)]
    jobs: Option<usize>,
    /// Take every reading anew, and keep none
    #[arg(long)]
    no_cache: bool,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum TextOrJson {
    Terminal,
    Json,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum SchemaOf {
    Spec,
    /// `luxproof.yaml`
    Policy,
    Report,
    /// What an external adapter of version 1 reads on its standard input
    Job,
    /// What an external adapter of version 1 prints on its standard output
    Readings,
    /// What an external adapter of protocol 2 reads on its standard input
    Request,
    /// What one of protocol 2 answers to a probe
    Probe,
    /// What one of protocol 2 answers to jobs
    Answers,
}

impl Cli {
    /// Does what the command line asks; the error, if any, is a usage or input error.
    pub fn run(self) -> Result<Exit, Diagnostic> {
        let site = match &self.engines_dir {
            Some(folder) => Site::at(std::path::absolute(folder).into_diagnostic()?),
            None => Site::of_user().into_diagnostic()?,
        };
        let trust = if self.untrusted { Trust::Stranger } else { Trust::Own };
        // These end in order from their first line; an audit does so once it is planned.
        let measures = matches!(
            self.command,
            Command::Selftest(_)
                | Command::Bench(_)
                | Command::Bisect(_)
                | Command::Hunt(_)
                | Command::Shrink(_)
                | Command::Stress(_)
                | Command::Engines { .. }
        );
        let _under_way = measures.then(process::UnderWay::begin);
        match self.command {
            Command::Run(mut args) => {
                args.views.all |= self.verbose > 0;
                run::run(&args, &site, &cache::folder(self.cache_dir)?, trust)
            }
            Command::Cache { action } => cache::manage(action, &cache::folder(self.cache_dir)?),
            Command::Check(args) => check::check(&args, &site, trust),
            Command::Plan(args) => plan::plan(&args, &site, &cache::folder(self.cache_dir)?, trust),
            Command::Read(args) => plan::read(&args, &site, &cache::folder(self.cache_dir)?, trust),
            Command::Export(args) => export::export(&args, &site, trust),
            Command::Engines { action } => engines::manage_engines(action, &site, trust),
            Command::Photometry(args) => photometry::run(&args, trust),
            Command::Report(mut args) => {
                args.views.all |= self.verbose > 0;
                match &args.from {
                    Some(cache) => run::report_from(cache, &args, &site, trust),
                    None => views::view(&args),
                }
            }
            Command::Init(args) => init::init(&args),
            Command::Import(args) => import::run(&args, trust),
            Command::Completions(args) => shell::completions(&args, Self::command()),
            Command::Man(args) => shell::man(&args, Self::command()),
            Command::Open(args) => open::open(&args),
            Command::Bundle(args) => bundle::bundle(&args),
            Command::Reproduce(args) => reproduce::reproduce(&args, &site, || cache::folder(self.cache_dir), trust),
            Command::History(action) => history::history(&action),
            Command::Diff(args) => diff::diff(&args),
            Command::Bisect(args) => bisect::run(&args, &site, &cache::folder(self.cache_dir)?, trust),
            Command::Accept(args) => accept::accept(&args),
            Command::Selftest(_) | Command::Hunt(_) | Command::Shrink(_) if trust == Trust::Stranger => {
                Err(miette::miette!(
                    help = "check and run take such specs",
                    "this command works on specs of the user's own alone, and --untrusted or LUXPROOF_UNTRUSTED says that these are not"
                ))
            }
            Command::Selftest(args) => selftest::run_selftest(&args, &site, || cache::folder(self.cache_dir)),
            Command::Bench(args) => bench::run(&args, &site, trust),
            Command::Hunt(args) => hunt::run(&args, &site),
            Command::Shrink(args) => hunt::shrink(&args, &site),
            Command::Stress(args) => stress::run(&args, &site, trust),
            Command::ReadOne => measuring::read_one(&site),
            Command::Schema { of } => schema(of),
        }
    }

    pub fn verbosity(&self) -> u8 {
        self.verbose
    }
}

/// A number of things to do at a time.
fn at_least_one(text: &str) -> Result<usize, String> {
    match text.parse::<usize>() {
        Ok(0) => Err("nothing is done with none: give 1 or more, or leave the option out".to_owned()),
        Ok(n) => Ok(n),
        Err(error) => Err(error.to_string()),
    }
}

/// Whatever it quotes, a terminal obeys none of it.
fn print(text: &str) -> Result<(), Diagnostic> {
    match std::io::stdout().lock().write_all(printable::styled(text).as_bytes()) {
        // Whoever reads has seen enough (`| head`): that is no error of ours.
        Err(error) if error.kind() == std::io::ErrorKind::BrokenPipe => Ok(()),
        written => written.map_err(|e| FileError::of(Path::new("standard output"), e)).into_diagnostic(),
    }
}

/// Tells something on standard error; that nobody reads it is no reason to stop.
pub fn complain(text: &str) {
    writeln!(std::io::stderr().lock(), "{}", printable::styled(text)).ok();
}

fn json(value: &(impl Serialize + ?Sized)) -> Result<String, Diagnostic> {
    Ok(serde_json::to_string_pretty(value).into_diagnostic()? + "\n")
}

fn schema(of: SchemaOf) -> Result<Exit, Diagnostic> {
    let schema = match of {
        SchemaOf::Spec => schemars::schema_for!(Spec),
        SchemaOf::Policy => schemars::schema_for!(ProjectPolicy),
        SchemaOf::Report => schemars::schema_for!(Report),
        SchemaOf::Job => schemars::schema_for!(ExternalJob),
        SchemaOf::Readings => schemars::schema_for!(ExternalReadings),
        SchemaOf::Request => schemars::schema_for!(ExternalRequest),
        SchemaOf::Probe => schemars::schema_for!(ExternalProbe),
        SchemaOf::Answers => schemars::schema_for!(ExternalAnswers),
    };
    print(&json(&schema)?)?;
    Ok(Exit::Passed)
}
