//! The command line: arguments, what each command does with them, and its exit code.

mod accept;
mod bench;
mod bisect;
mod bundle;
mod cache;
mod cards;
mod check;
mod definition;
pub mod diff;
mod engines;
mod export;
mod history;
mod hunt;
mod import;
mod init;
mod last_run;
mod measuring;
mod open;
pub mod plan;
mod progress;
mod repetitions;
mod reproduce;
mod run;
mod selftest;
mod shell;
mod spec_template;
mod stress;
mod views;

use std::path::{Path, PathBuf};

use clap::builder::FalseyValueParser;
use clap::{Args, FromArgMatches as _, Parser, Subcommand, ValueEnum};
use miette::{IntoDiagnostic, Report as Diagnostic};

use luxproof_audit::plan::{Selection, Skipping};
use luxproof_audit::{Calibration, Options};
use luxproof_cards::{Capabilities, Cards, CellEvidence};
use luxproof_conformance::ConformanceArgs;
use luxproof_console::{complain, json, print};
use luxproof_engines::{EngineRoot, ExternalAnswers, ExternalProbe, ExternalRequest};
use luxproof_model::Sampling;
use luxproof_model::{Exit, Report};
use luxproof_model::{ProcedureId, ReadingKey};
use luxproof_photometry_tool::PhotometryArgs;
use luxproof_process::files::UnsafeEntry;
use luxproof_process::process;
use luxproof_spec::{Spec, Trust};
use luxproof_verdict::{PolicyChoice, ProjectPolicy};

use definition::definition;
use views::Views;

/// Checks whether a renderer computes the right illuminance
#[derive(Debug, Parser)]
#[command(name = "luxproof", version = env!("LUXPROOF_VERSION"))]
pub struct Cli {
    /// Folder of installed engines [default: in the user's data folder]
    #[arg(long, global = true, env = "LUXPROOF_ENGINES", value_name = "DIR", hide_short_help = true)]
    engines_dir: Option<PathBuf>,
    /// Folder of the cache of values [default: in the user's cache folder]
    #[arg(long, global = true, env = "LUXPROOF_CACHE", value_name = "DIR", hide_short_help = true)]
    cache_dir: Option<PathBuf>,
    /// Treat specs as untrusted: no external programs, no files outside the spec's folder, size limits
    #[arg(long, global = true, env = "LUXPROOF_UNTRUSTED", value_parser = FalseyValueParser::new(), hide_short_help = true)]
    untrusted: bool,
    /// Print more messages to stderr; repeat for more
    #[arg(short, long, global = true, action = clap::ArgAction::Count, hide_short_help = true)]
    verbose: u8,
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Write a first spec for your room and your photometric file
    Init(init::InitArgs),
    /// Make a spec from a Radiance, OBJ or glTF scene
    Import(import::ImportArgs),
    /// Run renderers on specs, compare every value, and report
    Run(RunArgs),
    /// List errors and suspicious values, and print what would run
    Check(Selected),
    /// Split a run into jobs for several processes or machines
    Plan(plan::PlanArgs),
    /// Run jobs of a plan and store their values in the cache
    ///
    /// The exit code is 0 if the values are stored, whatever their verdict.
    Read(plan::ReadArgs),
    /// Write the scene files of an engine, to run them by hand
    Export(export::ExportArgs),
    /// List, install, repair or examine engines
    Engines {
        #[command(subcommand)]
        action: Option<engines::EnginesAction>,
    },
    /// Show, check and convert photometric files
    Photometry(PhotometryArgs),
    /// Write the conformance pack of photometric files, or judge a reader's answers
    Conformance(ConformanceArgs),
    /// Print a finished run again, in any format
    Report(views::ReportArgs),
    /// Open the report of a run in a browser
    Open(open::OpenArgs),
    /// Pack a finished run with all its inputs
    Bundle(bundle::BundleArgs),
    /// Repeat a bundle's run, judge printed tables, or explain a study
    Reproduce(reproduce::ReproduceArgs),
    /// Draw score cards: what each renderer can be trusted for
    Cards(cards::CardsArgs),
    /// Collect nightly runs, draw trends and detect changes
    #[command(subcommand)]
    History(history::Action),
    /// Show what changed between two runs, beyond noise
    Diff(diff::DiffArgs),
    /// Find the release of an engine that changed a verdict
    Bisect(bisect::BisectArgs),
    /// Save a run as the expected result, after your review
    Accept(accept::AcceptArgs),
    /// Inject known faults and check that luxproof detects them
    Selftest(selftest::SelftestArgs),
    /// Show or clean the cache of values
    Cache {
        #[command(subcommand)]
        action: Option<cache::Action>,
    },
    /// Measure time against error for engines, solvers and presets
    Bench(bench::BenchArgs),
    /// Generate random specs until engines disagree
    ///
    /// Each finding is shrunk to a small spec and stored in a folder.
    Hunt(hunt::HuntArgs),
    /// Find the smallest spec in which an engine still fails
    Shrink(hunt::ShrinkArgs),
    /// Check physical laws at extreme scales
    ///
    /// For example: half the flux gives half the illuminance.
    Stress(stress::StressArgs),
    /// Print completions for a shell
    Completions(shell::CompletionsArgs),
    /// Write manual pages
    Man(shell::ManArgs),
    /// Compute one value for another process of this program
    #[command(name = luxproof_audit::measure::READ_ONE, hide = true)]
    ReadOne,
    /// Print a JSON Schema: spec, policy, report, cards, adapter protocol
    Schema {
        /// Which schema
        #[arg(value_enum, default_value_t = SchemaOf::Spec)]
        of: SchemaOf,
    },
}

#[derive(Clone, Debug, Args)]
struct Selected {
    /// Spec files, folders of specs, or patterns
    #[arg(required = true, value_name = "SPEC")]
    specs: Vec<PathBuf>,
    #[command(flatten)]
    choice: Choice,
}

/// Which part of specs is run.
#[derive(Clone, Debug, Args)]
struct Narrowed {
    /// Run only these procedures
    #[arg(long, value_delimiter = ',', value_name = "NAMES")]
    procedures: Vec<ProcedureId>,
    /// Run only cases that match this text or glob
    ///
    /// The option may be given several times.
    #[arg(long, value_name = "PATTERN")]
    filter: Vec<String>,
    /// Seed of all random choices
    #[arg(long, default_value_t = 1, hide_short_help = true)]
    seed: u64,
}

impl Narrowed {
    fn selection(&self, engines: &[String]) -> Selection {
        Selection { engines: engines.to_vec(), procedures: self.procedures.clone(), seed: self.seed }
    }
}

/// Which part of specs is run, on which engines, judged by which policy.
#[derive(Clone, Debug, Args)]
struct Choice {
    /// Run only these engines [default: as in the spec]
    ///
    /// A spec without `engines` runs mitsuba, radiance and povray. The simulator and the hand calculation always run.
    #[arg(long, value_delimiter = ',', value_name = "NAMES")]
    engines: Vec<String>,
    #[command(flatten)]
    narrowed: Narrowed,
    /// Render everything, also symmetric points
    #[arg(long)]
    no_skips: bool,
    /// Folder to write [default: luxproof-out/<spec name>]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    #[command(flatten)]
    policy: PolicyChoice,
}

/// How far an audit goes.
#[derive(Clone, Debug, Args)]
struct Extent {
    /// When sampling stops [default: by the profile, else decided]
    #[arg(long, value_enum, value_name = "WHEN", hide_short_help = true)]
    sampling: Option<Sampling>,
    /// Skip the built-in test scenes with known results
    #[arg(long, hide_short_help = true)]
    no_calibration: bool,
}

/// What is audited and how. Equal values request equal jobs in every process.
#[derive(Clone, Debug, Args)]
struct Audited {
    #[command(flatten)]
    selected: Selected,
    #[command(flatten)]
    extent: Extent,
}

impl Audited {
    fn options(&self, site: &EngineRoot, trust: Trust, out: PathBuf) -> Options<'static> {
        let Choice { narrowed: Narrowed { filter, .. }, policy, .. } = &self.selected.choice;
        Options {
            selection: self.selected.choice.selection(),
            filter: filter.clone(),
            skipping: self.selected.choice.skipping(),
            trust,
            policy: policy.clone(),
            sampling: self.extent.sampling,
            calibration: if self.extent.no_calibration { Calibration::LeftOut } else { Calibration::Judged },
            ..audit_options(site.clone(), out)
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

    /// Whether its engines and procedures have this reading among them; none named means all.
    fn asks_for(&self, key: &ReadingKey) -> bool {
        let procedures = &self.narrowed.procedures;
        (procedures.is_empty() || procedures.contains(&key.procedure))
            && (self.engines.is_empty() || self.engines.iter().any(|engine| key.engine == engine.as_str()))
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
    /// Compare with a baseline of `luxproof accept`
    ///
    /// It is a .json file, or a folder with one file per spec.
    #[arg(long, value_name = "FILE|DIR")]
    baseline: Option<PathBuf>,
    #[command(flatten)]
    views: Views,
    /// Stop after the first case that fails
    ///
    /// The other cases are reported as skipped.
    #[arg(long)]
    fail_fast: bool,
    /// Threads or processes [default: one per core]
    #[arg(long, value_name = "N", value_parser = at_least_one)]
    jobs: Option<usize>,
    /// Ignore the cache and do not write to it
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
    /// `cards.json` of a site of score cards
    Cards,
    /// The evidence behind a page of score cards
    CardEvidence,
    /// Capabilities of score cards
    Capabilities,
    /// Input of an adapter
    Request,
    /// Answer of an adapter to a probe
    Probe,
    /// Answers of an adapter to jobs
    Answers,
}

impl Cli {
    /// Parses the command line. Ends the process with help, or with a usage error and exit code 2.
    pub fn from_command_line() -> Self {
        let matches = definition().get_matches();
        Self::from_arg_matches(&matches).unwrap_or_else(|error| error.exit())
    }

    /// Does what the command line asks; the error, if any, is a usage or input error.
    pub fn run(self) -> Result<Exit, Diagnostic> {
        let site = match &self.engines_dir {
            Some(folder) => EngineRoot::at(std::path::absolute(folder).into_diagnostic()?),
            None => EngineRoot::of_user().into_diagnostic()?,
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
            Command::Photometry(args) => luxproof_photometry_tool::run(&args, trust),
            Command::Conformance(args) => luxproof_conformance::run(&args, env!("LUXPROOF_VERSION")),
            Command::Report(mut args) => {
                args.views.all |= self.verbose > 0;
                match &args.from {
                    Some(cache) => run::report_from(cache, &args, &site, trust),
                    None => views::view(&args),
                }
            }
            Command::Init(args) => init::init(&args),
            Command::Import(args) => import::run(&args, trust),
            Command::Completions(args) => shell::completions(&args, definition()),
            Command::Man(args) => shell::man(&args, definition()),
            Command::Open(args) => open::open(&args),
            Command::Bundle(args) => bundle::bundle(&args, trust),
            Command::Reproduce(args) => reproduce::reproduce(&args, &site, || cache::folder(self.cache_dir), trust),
            Command::Cards(args) => cards::cards(&args, &site, trust),
            Command::History(action) => history::history(&action),
            Command::Diff(args) => diff::diff(&args),
            Command::Bisect(args) => bisect::run(&args, &site, &cache::folder(self.cache_dir)?, trust),
            Command::Accept(args) => accept::accept(&args),
            Command::Selftest(_) | Command::Hunt(_) | Command::Shrink(_) if trust == Trust::Stranger => {
                Err(miette::miette!(
                    help = "leave out --untrusted and LUXPROOF_UNTRUSTED if the specs are your own; `check` and `run` accept untrusted ones",
                    "this command does not run untrusted specs"
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

/// A number of things to do at the same time.
fn at_least_one(text: &str) -> Result<usize, String> {
    match text.parse::<usize>() {
        Ok(0) => Err("0 is not allowed: give 1 or more, or leave the option out".to_owned()),
        Ok(n) => Ok(n),
        Err(error) => Err(error.to_string()),
    }
}

fn schema(of: SchemaOf) -> Result<Exit, Diagnostic> {
    let schema = match of {
        SchemaOf::Spec => schemars::schema_for!(Spec),
        SchemaOf::Policy => schemars::schema_for!(ProjectPolicy),
        SchemaOf::Report => schemars::schema_for!(Report),
        SchemaOf::Cards => schemars::schema_for!(Cards),
        SchemaOf::CardEvidence => schemars::schema_for!(CellEvidence),
        SchemaOf::Capabilities => schemars::schema_for!(Capabilities),
        SchemaOf::Request => schemars::schema_for!(ExternalRequest),
        SchemaOf::Probe => schemars::schema_for!(ExternalProbe),
        SchemaOf::Answers => schemars::schema_for!(ExternalAnswers),
    };
    print(&json(&schema)?)?;
    Ok(Exit::Passed)
}

/// Refuses to write where links of a stranger may lead elsewhere.
fn refuse_links(folder: &Path, trust: Trust) -> Result<(), Diagnostic> {
    match UnsafeEntry::in_or_below(folder).filter(|_| trust != Trust::Own) {
        Some(UnsafeEntry { path, what }) => Err(miette::miette!(
            help = "name another folder with --out",
            "{} is {what}, and what is to be written there is not trusted",
            path.display()
        )),
        None => Ok(()),
    }
}

/// The message for an audit that did not start.
fn not_audited(error: luxproof_audit::AuditError) -> Diagnostic {
    match error {
        luxproof_audit::AuditError::Spec(faults) => luxproof_console::diagnose(faults),
        other => Diagnostic::from_err(other),
    }
}

/// The options of an audit by this program.
fn audit_options<'a>(site: EngineRoot, out: PathBuf) -> Options<'a> {
    Options { tool: crate::running_tool(), ..Options::new(site, out) }
}
