//! The command line: arguments, what each command does with them, and its exit code.

mod accept;
mod bench;
mod cache;
pub(crate) mod diagnostic;
mod diff;
mod history;
mod measuring;
mod progress;
mod run_specs;
mod sampling;
mod stress;

use std::collections::BTreeMap;
use std::io::{IsTerminal, Write};
use std::path::{Path, PathBuf};

use clap::{Args, Parser, Subcommand, ValueEnum};
use miette::{IntoDiagnostic, Report as Diagnostic, WrapErr};

use crate::diff::Tolerances;
use crate::doctor;
use crate::engines::calibration::{self, Calibrated, Earlier};
use crate::engines::{self, EngineId, InstallState, Site};
use crate::photometry_command::{self, PhotometryArgs};
use crate::plan::{Asked, Planner, Selection, Skipping, cost_s, plan};
use crate::process;
use crate::report::{self, Beside, Detail, Exit, Report, Style};
use crate::selftest::{calibrations, selftest};
use crate::slots::Slots;
use crate::spec::{Case, Spec, filtered, suite};

use diagnostic::diagnose;
use run_specs::{Tables, run_specs};

/// Cross-validates renderers on luminaires: does a renderer put the right number of lux where a luminaire should?
#[derive(Debug, Parser)]
#[command(name = "luxproof", version, about)]
pub struct Cli {
    /// Where engines are installed [default: the user's data folder]
    #[arg(long, global = true, env = "LUXPROOF_ENGINES", value_name = "DIR")]
    engines_dir: Option<PathBuf>,
    /// Where readings are kept between runs [default: the user's cache folder]
    #[arg(long, global = true, env = "LUXPROOF_CACHE", value_name = "DIR")]
    cache_dir: Option<PathBuf>,
    /// Print more of what happens to stderr
    #[arg(short, long, global = true, action = clap::ArgAction::Count)]
    verbose: u8,
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Run every procedure of a spec on every engine, compare and report
    Run(RunArgs),
    /// Validate specs and print the plan: what would run, what is skipped and why
    Check(CheckArgs),
    /// Write an engine's scenes, runnable by hand
    Export(ExportArgs),
    /// List, install or examine engines
    Engines(EnginesArgs),
    /// What photometric files say: flux, symmetry, lint, polar diagram, conversion
    Photometry(PhotometryArgs),
    /// View a finished run again
    Report(ReportArgs),
    /// Keep a history of nightly runs and draw it
    History(history::HistoryArgs),
    /// What changed between two runs, a mean shift told apart from noise
    Diff(diff::DiffArgs),
    /// Make the readings of a run a baseline, under review and for a reason
    Accept(accept::AcceptArgs),
    /// Put known faults into right readings and see whether the harness catches and names them
    Selftest(SelftestArgs),
    /// What the cache of readings holds; take out what is damaged or long unused
    Cache(cache::CacheArgs),
    /// Run time against error, for every engine, solver and preset
    Bench(bench::BenchArgs),
    /// Numerical stability: laws that must hold whatever the scene, driven until something breaks
    Stress(stress::StressArgs),
    /// Take one reading for another process of this program
    #[command(name = crate::measure::READ_ONE, hide = true)]
    ReadOne,
    /// Print the JSON Schema of the spec, the report, or what external adapters read and print
    Schema(SchemaArgs),
}

#[derive(Debug, Args)]
struct Selected {
    /// Engines to run, by name [default: those of the spec, else all that are there]
    #[arg(long, value_delimiter = ',', value_name = "NAMES")]
    engines: Vec<String>,
    /// Procedures to run, by name [default: all of the spec]
    #[arg(long, value_delimiter = ',', value_name = "NAMES")]
    procedures: Vec<String>,
    /// Only cases whose name matches: a glob, or a part of the name; may be given several times [default: all]
    #[arg(long, value_name = "PATTERN")]
    filter: Vec<String>,
    /// Seed of every random choice
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Render everything, also what follows from other readings
    #[arg(long)]
    no_skips: bool,
}

impl Selected {
    fn skipping(&self) -> Skipping {
        if self.no_skips { Skipping::Nothing } else { Skipping::Allowed }
    }

    fn selection(&self) -> Selection {
        Selection { engines: self.engines.clone(), procedures: self.procedures.clone(), seed: self.seed }
    }
}

/// Which views of a report are printed, and how.
#[derive(Debug, Args)]
struct Views {
    /// Views of the report to print
    #[arg(long, value_enum, value_name = "FORMAT", default_values_t = [Format::Terminal])]
    format: Vec<Format>,
    /// Tell everything on the terminal: papers' tables, methods apart from renderers, notes (as -v)
    #[arg(long)]
    all: bool,
    /// Where the whole report is published, for Markdown to lead to
    #[arg(long, value_name = "URL")]
    link: Option<String>,
    /// JSON of `luxproof bench` or `luxproof stress` to show with it in HTML
    #[arg(long, value_name = "FILE")]
    beside: Vec<PathBuf>,
}

#[derive(Debug, Args)]
struct RunArgs {
    /// Spec files, folders of them or patterns
    #[arg(required = true, value_name = "SPEC")]
    specs: Vec<PathBuf>,
    #[command(flatten)]
    selected: Selected,
    /// Install missing engines first
    #[arg(long)]
    install: bool,
    /// Folder of the run's files [default: luxproof-out/<spec name>]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Hold the readings against a baseline of `luxproof accept`: a .json file, or a folder that holds one a spec
    #[arg(long, value_name = "FILE|DIR")]
    baseline: Option<PathBuf>,
    #[command(flatten)]
    views: Views,
    /// Stop after the first case that fails; the cases left are reported as skipped
    #[arg(long)]
    fail_fast: bool,
    /// Threads or processes at a time [default: one a core]
    #[arg(long, value_name = "N")]
    jobs: Option<usize>,
    /// Take every reading anew, and keep none
    #[arg(long)]
    no_cache: bool,
    /// When sampling stops
    #[arg(long, value_enum, value_name = "WHEN", default_value_t)]
    sampling: sampling::Sampling,
}

#[derive(Debug, Args)]
struct CheckArgs {
    /// Spec files, folders of them or patterns
    #[arg(required = true, value_name = "SPEC")]
    specs: Vec<PathBuf>,
    #[command(flatten)]
    selected: Selected,
}

#[derive(Debug, Args)]
struct ExportArgs {
    /// Spec file
    spec: PathBuf,
    /// The engine whose scenes to write
    #[arg(long)]
    engine: String,
    /// Folder to write to; one folder a procedure is made in it
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Procedures to export, by name [default: all of the spec]
    #[arg(long, value_delimiter = ',', value_name = "NAMES")]
    procedures: Vec<String>,
}

#[derive(Debug, Args)]
struct EnginesArgs {
    #[command(subcommand)]
    action: Option<EnginesAction>,
}

#[derive(Clone, Debug, Subcommand)]
enum EnginesAction {
    /// Which engines there are, and their versions
    List,
    /// Fetch missing engines into a folder of our own
    Install {
        /// Engines by name [default: all]
        names: Vec<String>,
    },
    /// Let every engine read a scene of known answer
    Doctor {
        /// Engines by name [default: all]
        names: Vec<String>,
    },
}

#[derive(Debug, Args)]
struct ReportArgs {
    /// report.json of a run
    result: PathBuf,
    /// Print the error budget of every deviation, and nothing else
    #[arg(long)]
    budget: bool,
    #[command(flatten)]
    views: Views,
}

#[derive(Debug, Args)]
struct SelftestArgs {
    /// Noisy runs a fault
    #[arg(long, default_value_t = 20, value_name = "N")]
    runs: usize,
    /// Noisy runs without a fault, in each case
    #[arg(long, default_value_t = 100, value_name = "N")]
    clean_runs: usize,
    /// Seed of the noise
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Show how good the verdicts' intervals and p-values are, and nothing else
    #[arg(long)]
    calibration: bool,
    /// View of the scorecard to print
    #[arg(long, value_enum, value_name = "FORMAT", default_value_t = CardFormat::Terminal)]
    format: CardFormat,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum CardFormat {
    Terminal,
    Json,
}

#[derive(Debug, Args)]
struct SchemaArgs {
    /// Which schema
    #[arg(value_enum, default_value_t = SchemaOf::Spec)]
    of: SchemaOf,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum SchemaOf {
    Spec,
    Report,
    /// What an external adapter reads on its standard input
    Job,
    /// What an external adapter prints on its standard output
    Readings,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Format {
    Terminal,
    Json,
    Markdown,
    Junit,
    Csv,
    /// One self-contained file; best sent to one with `>`
    Html,
}

impl Cli {
    /// Does what the command line asks; the error, if any, is a usage or input error.
    pub fn run(self) -> Result<Exit, Diagnostic> {
        let site = match &self.engines_dir {
            Some(folder) => Site::at(std::path::absolute(folder).into_diagnostic()?),
            None => Site::of_user().into_diagnostic()?,
        };
        match self.command {
            Command::Run(mut args) => {
                args.views.all |= self.verbose > 0;
                run_specs(&args, &site, &cache::folder(self.cache_dir)?)
            }
            Command::Cache(args) => cache::manage(&args, &cache::folder(self.cache_dir)?),
            Command::Check(args) => check(&args, &site),
            Command::Export(args) => export(&args, &site),
            Command::Engines(args) => manage_engines(&args, &site),
            Command::Photometry(args) => photometry_command::run(&args),
            Command::Report(mut args) => {
                args.views.all |= self.verbose > 0;
                view(&args)
            }
            Command::History(args) => history::history(&args),
            Command::Diff(args) => diff::diff(&args),
            Command::Accept(args) => accept::accept(&args),
            Command::Selftest(args) => test_oneself(&args),
            Command::Bench(args) => bench::run(&args, &site),
            Command::Stress(args) => stress::run(&args, &site),
            Command::ReadOne => measuring::read_one(&site),
            Command::Schema(args) => schema(&args),
        }
    }

    /// How much to log.
    pub fn verbosity(&self) -> u8 {
        self.verbose
    }
}

fn test_oneself(args: &SelftestArgs) -> Result<Exit, Diagnostic> {
    if args.calibration {
        let found = calibrations(args.seed);
        print(&match args.format {
            CardFormat::Terminal => found.to_string(),
            CardFormat::Json => serde_json::to_string(&found).into_diagnostic()? + "\n",
        })?;
        return Ok(if found.is_good() { Exit::Passed } else { Exit::Failed });
    }
    let card = selftest(args.runs.max(1), args.clean_runs, args.seed).into_diagnostic()?;
    let text = match args.format {
        CardFormat::Terminal => card.to_string(),
        CardFormat::Json => serde_json::to_string_pretty(&card).into_diagnostic()? + "\n",
    };
    print(&text)?;
    Ok(if card.is_good() { Exit::Passed } else { Exit::Failed })
}

fn print(text: &str) -> Result<(), Diagnostic> {
    match std::io::stdout().lock().write_all(text.as_bytes()) {
        // Whoever reads has seen enough (`| head`): that is no error of ours.
        Err(error) if error.kind() == std::io::ErrorKind::BrokenPipe => Ok(()),
        written => written.into_diagnostic(),
    }
}

fn print_reports(reports: &[(Report, PathBuf)], views: &Views) -> Result<(), Diagnostic> {
    let beside = views.beside.iter().map(|path| read_beside(path)).collect::<Result<Vec<_>, _>>()?;
    let detail = if views.all { Detail::All } else { Detail::Brief };
    let mut out = std::io::stdout().lock();
    let style = if std::io::stdout().is_terminal() && std::env::var_os("NO_COLOR").is_none_or(|v| v.is_empty()) {
        Style::Colour
    } else {
        Style::Plain
    };
    for format in &views.format {
        let text = match format {
            Format::Json => {
                let all: Vec<&Report> = reports.iter().map(|(r, _)| r).collect();
                // One spec gives its report; several give a list of reports.
                match all[..] {
                    [one] => serde_json::to_string_pretty(one),
                    _ => serde_json::to_string_pretty(&all),
                }
                .into_diagnostic()?
            }
            Format::Html => print_page(reports, &beside),
            view => {
                let one = |(report, folder): &(Report, PathBuf)| match view {
                    Format::Markdown => report::markdown(report, views.link.as_deref()),
                    Format::Csv => report::csv(report),
                    Format::Junit => report::junit(report),
                    _ => report::terminal(report, style, detail, Some(&folder.display().to_string())),
                };
                reports.iter().map(one).collect::<Vec<_>>().join("\n")
            }
        };
        match writeln!(out, "{}", text.trim_end()) {
            // Whoever reads has seen enough (`| head`): that is no error of ours.
            Err(error) if error.kind() == std::io::ErrorKind::BrokenPipe => return Ok(()),
            written => written.into_diagnostic()?,
        }
    }
    Ok(())
}

/// The page, also kept in the run's folder; on a terminal only its place is printed.
fn print_page(reports: &[(Report, PathBuf)], beside: &[Beside]) -> String {
    let mut pages = vec![];
    for (report, folder) in reports {
        let (page, file) = (report::page(report, beside), folder.join("report.html"));
        let kept = std::fs::write(&file, &page);
        if let Err(error) = &kept {
            tracing::warn!(file = %file.display(), %error, "the page is printed, not kept");
        }
        pages.push(if kept.is_ok() && std::io::stdout().is_terminal() { file.display().to_string() } else { page });
    }
    pages.join("\n")
}

fn check(args: &CheckArgs, site: &Site) -> Result<Exit, Diagnostic> {
    let cases = suite(&args.specs).and_then(|all| filtered(all, &args.selected.filter)).map_err(diagnose)?;
    Tables::read(&cases)?;
    let mut out = std::io::stdout().lock();
    let mut exit = Exit::Passed;
    let selection = args.selected.selection();
    let mut planner = Planner::new(&selection, site, args.selected.skipping());
    for case in &cases {
        let plan = planner.plan(case).map_err(diagnose)?;
        writeln!(out, "{} ({}): {}", case.name, case.path.display(), case.title).into_diagnostic()?;
        for task in &plan.tasks {
            writeln!(out, "  {} at {} meters", task.procedure, task.targets.len()).into_diagnostic()?;
            for run in plan.runs.iter().filter(|r| plan.tasks[r.task].procedure == task.procedure) {
                let engine = &plan.engines[run.engine];
                let note = run.approximation.as_ref().map(|a| format!(", approximate: {a}")).unwrap_or_default();
                writeln!(
                    out,
                    "    run  {:<10} at most about {:.0} s{note}",
                    engine.engine.id(),
                    left(run) * cost_s(engine.engine.as_ref(), case.budget)
                )
                .into_diagnostic()?;
            }
            for skip in plan.skips.iter().filter(|s| s.procedure == task.procedure) {
                let saved = skip.saved.as_ref().map(|s| format!(" (saves {s})")).unwrap_or_default();
                writeln!(out, "    skip {:<10} {}{saved}", skip.engine, skip.reason).into_diagnostic()?;
            }
        }
        let absent = plan.engines.iter().any(|p| p.asked == Asked::ByName && p.is_absent());
        exit = exit.worse(if absent { Exit::Engine } else { Exit::Passed });
    }
    Ok(exit)
}

/// The part of a run's work that no shortcut saves.
fn left(run: &crate::plan::Run) -> f64 {
    run.shortcut.omissions.iter().map(|o| 1.0 - o.share).product()
}

fn export(args: &ExportArgs, site: &Site) -> Result<Exit, Diagnostic> {
    let cases = suite(std::slice::from_ref(&args.spec)).map_err(diagnose)?;
    let mut exported = 0;
    for case in &cases {
        // One folder a case, where there are several.
        let folder = if cases.len() == 1 { args.out.clone() } else { args.out.join(&case.name) };
        exported += export_case(case, args, site, &folder)?;
    }
    if exported == 0 {
        eprintln!("{} writes no scenes", args.engine);
    }
    Ok(Exit::Passed)
}

/// Exports one case; how many files that made.
fn export_case(case: &Case, args: &ExportArgs, site: &Site, out: &Path) -> Result<usize, Diagnostic> {
    let selection =
        Selection { engines: vec![args.engine.clone()], procedures: args.procedures.clone(), ..Selection::default() };
    let plan = plan(case, &selection, site).map_err(diagnose)?;
    let chosen = |e: usize| plan.engines[e].engine.id().name() == args.engine;
    let mut exported = 0;
    // An export needs no installed engine: what is skipped for absence is exported all the same.
    for (e, planned) in plan.engines.iter().enumerate().filter(|(e, _)| chosen(*e)) {
        for task in &plan.tasks {
            let job = plan.job(case, e, task, selection.seed);
            if let engines::Support::No(reason) = planned.engine.supports(&job) {
                eprintln!("{}: {reason}", task.procedure);
                continue;
            }
            let files = planned.engine.export(&job).into_diagnostic()?;
            let folder = out.join(task.procedure);
            std::fs::create_dir_all(&folder).into_diagnostic()?;
            for file in &files {
                let path = folder.join(&file.name);
                std::fs::write(&path, &file.bytes).into_diagnostic().wrap_err_with(|| path.display().to_string())?;
                println!("{}", path.display());
            }
            if let Some(command) = planned.engine.command_by_hand(&job, site) {
                println!("  cd {} && {command}", folder.display());
            }
            exported += files.len();
        }
    }
    Ok(exported)
}

fn manage_engines(args: &EnginesArgs, site: &Site) -> Result<Exit, Diagnostic> {
    match args.action.clone().unwrap_or(EnginesAction::List) {
        EnginesAction::List => {
            for engine in engines::all() {
                match engine.probe(site) {
                    Ok(version) => println!("{:<10} {}", engine.id(), version.0),
                    Err(absent) => println!("{:<10} absent: {absent}", engine.id()),
                }
            }
            println!("engines are kept in {}", site.root().display());
            Ok(Exit::Passed)
        }
        EnginesAction::Install { names } => {
            known_engines(&names)?;
            let wanted = engines::all().into_iter().map(|e| e.id());
            let wanted = wanted.filter(|e| names.is_empty() || names.iter().any(|n| n == e.name()));
            Ok(report_installation(site, &wanted.collect::<Vec<_>>()))
        }
        EnginesAction::Doctor { names } => {
            known_engines(&names)?;
            examine(site, &names)
        }
    }
}

fn examine(site: &Site, names: &[String]) -> Result<Exit, Diagnostic> {
    let tolerances = Tolerances::built_in().into_diagnostic()?;
    let mut exit = Exit::Passed;
    for engine in engines::all() {
        if names.is_empty() || names.iter().any(|n| n == engine.id().name()) {
            let finding = doctor::examine(engine.as_ref(), site, &tolerances);
            println!("{} {:<10} {}", if finding.healthy { "ok  " } else { "FAIL" }, finding.engine, finding.text);
            exit = exit.worse(if finding.healthy { Exit::Passed } else { Exit::Engine });
            exit = exit.worse(calibrate_anew(engine.as_ref(), site));
        }
    }
    Ok(exit)
}

/// Measures an engine's calibration again, keeps it and prints it.
fn calibrate_anew(engine: &dyn engines::Engine, site: &Site) -> Exit {
    let Ok(version) = engine.probe(site) else { return Exit::Passed };
    if crate::plan::REFERENCES.contains(&engine.id().name()) {
        return Exit::Passed;
    }
    match calibration::calibrate(
        engine,
        &version,
        &BTreeMap::new(),
        site,
        &Slots::new(process::cores()),
        Earlier::Ignored,
    ) {
        Ok(found) => {
            println!("     {:<10} {}", engine.id(), calibration_line(&found));
            Exit::Passed
        }
        Err(error) => {
            println!("FAIL {:<10} {error}", engine.id());
            Exit::Engine
        }
    }
}

fn known_engines(names: &[String]) -> Result<(), Diagnostic> {
    let known: Vec<EngineId> = engines::all().iter().map(|e| e.id()).collect();
    let known: Vec<&str> = known.iter().map(EngineId::name).collect();
    for name in names {
        if !known.contains(&name.as_str()) {
            let help = crate::spec::nearest(name, known.iter().copied())
                .map_or(format!("known: {}", known.join(", ")), |k| format!("did you mean `{k}`?"));
            return Err(miette::miette!(help = help, "there is no engine `{name}`"));
        }
    }
    Ok(())
}

fn report_installation(site: &Site, wanted: &[EngineId]) -> Exit {
    let outcomes = engines::install(site, wanted, |step| eprintln!("{step}"));
    for outcome in &outcomes {
        eprintln!("{}: {}", outcome.component, outcome.detail);
    }
    let failed = outcomes.iter().any(|o| o.state == InstallState::Failed);
    if failed { Exit::Engine } else { Exit::Passed }
}

fn view(args: &ReportArgs) -> Result<Exit, Diagnostic> {
    let place = || args.result.display().to_string();
    let text = std::fs::read_to_string(&args.result).into_diagnostic().wrap_err_with(place)?;
    let report: Report = serde_json::from_str(&text).into_diagnostic().wrap_err_with(place)?;
    let folder = args.result.parent().map_or_else(PathBuf::new, Path::to_owned);
    let exit = report.exit(|_| false);
    if args.budget {
        print(&report::budgets(&report))?;
    } else {
        print_reports(&[(report, folder)], &args.views)?;
    }
    Ok(exit)
}

fn read_beside(path: &Path) -> Result<Beside, Diagnostic> {
    let place = || path.display().to_string();
    let text = std::fs::read_to_string(path).into_diagnostic().wrap_err_with(place)?;
    Beside::from_json(&text).into_diagnostic().wrap_err_with(place)
}

fn schema(args: &SchemaArgs) -> Result<Exit, Diagnostic> {
    let schema = match args.of {
        SchemaOf::Spec => schemars::schema_for!(Spec),
        SchemaOf::Report => schemars::schema_for!(Report),
        SchemaOf::Job => schemars::schema_for!(engines::ExternalJob),
        SchemaOf::Readings => schemars::schema_for!(engines::ExternalReadings),
    };
    println!("{}", serde_json::to_string_pretty(&schema).into_diagnostic()?);
    Ok(Exit::Passed)
}

fn calibration_line(found: &Calibrated) -> String {
    let kept = match &found.kept {
        Ok(file) => format!("kept in {file}"),
        Err(why) => format!("not kept, so that it is measured again next time: {why}"),
    };
    format!("{}; {kept}", found.calibration.summary())
}
