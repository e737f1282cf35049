//! `luxproof hunt` and `luxproof shrink`: random specs until something disagrees, and the smallest spec that still does.

use luxproof_process::files;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::time::Duration;

use clap::Args;
use itertools::Itertools;
use miette::{IntoDiagnostic, Report as Diagnostic};

use super::TextOrJson;
use super::not_audited;
use luxproof_console::diagnose;
use luxproof_console::{complain, json, print};
use luxproof_engines::EngineRoot;
use luxproof_lab::hunt::{self, Finding, Hunt, HuntError, Options, ShrinkOptions, Shrinking};
use luxproof_model::Exit;
use luxproof_model::{EngineName, ProcedureId};
use luxproof_process::output_lock::OutputLock;
use luxproof_process::process;
use luxproof_spec::{Budget, EngineSettings, specs, suggestion};

#[derive(Debug, Args)]
pub(super) struct HuntArgs {
    /// Start no specs after this time
    ///
    /// Run the command again to continue.
    #[arg(long, default_value_t = 10.0, value_name = "M")]
    minutes: f64,
    /// Seed of the specs and of all random choices
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Test only these engines [default: all installed]
    #[arg(long, value_delimiter = ',', value_name = "NAMES")]
    engines: Vec<String>,
    /// A spec with your programs and settings
    #[arg(long, value_name = "FILE")]
    spec: Option<PathBuf>,
    /// Use only these procedures
    #[arg(long, value_delimiter = ',', value_name = "NAMES")]
    procedures: Vec<ProcedureId>,
    /// Stop after this many specs
    #[arg(long, value_name = "N")]
    specs: Option<u64>,
    /// Stop after this many new findings
    #[arg(long, value_name = "N")]
    findings: Option<usize>,
    /// Time limit of one job
    #[arg(long, default_value_t = 2.0, value_name = "SECONDS")]
    seconds: f64,
    /// Time limit to shrink one finding
    #[arg(long, default_value_t = 3.0, value_name = "M")]
    shrink_minutes: f64,
    /// Threads or processes [default: one per core]
    #[arg(long, value_name = "N", value_parser = super::at_least_one)]
    jobs: Option<usize>,
    /// Folder of the findings; index.md lists them
    #[arg(long, value_name = "DIR", default_value = "luxproof-out/hunt")]
    out: PathBuf,
    /// Format to print
    #[arg(long, value_enum, value_name = "FORMAT", default_value_t = TextOrJson::Terminal)]
    format: TextOrJson,
}

#[derive(Debug, Args)]
pub(super) struct ShrinkArgs {
    /// Spec file in which an engine fails
    spec: PathBuf,
    /// The engine that fails
    #[arg(long)]
    engine: String,
    /// The case of the spec [default: the first that fails]
    #[arg(long, value_name = "NAME")]
    case: Option<String>,
    /// Use only these procedures
    #[arg(long, value_delimiter = ',', value_name = "NAMES")]
    procedures: Vec<ProcedureId>,
    /// Stop after this time
    #[arg(long, default_value_t = 10.0, value_name = "M")]
    minutes: f64,
    /// Seed of all random choices
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Threads or processes [default: one per core]
    #[arg(long, value_name = "N", value_parser = super::at_least_one)]
    jobs: Option<usize>,
    /// Folder of the minimal spec [default: luxproof-out/shrink/<spec name>]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Format to print
    #[arg(long, value_enum, value_name = "FORMAT", default_value_t = TextOrJson::Terminal)]
    format: TextOrJson,
}

/// A sensible span of time out of minutes or seconds.
fn span(name: &str, seconds: f64) -> Result<Duration, Diagnostic> {
    let sound = seconds.is_finite() && seconds >= 0.0;
    sound
        .then(|| Duration::from_secs_f64(seconds.min(1e9)))
        .ok_or_else(|| miette::miette!("{name} must be a number from 0"))
}

pub(super) fn run(args: &HuntArgs, site: &EngineRoot) -> Result<Exit, Diagnostic> {
    let time = span("--minutes", 60.0 * args.minutes)?;
    if !(args.seconds.is_finite() && args.seconds > 0.0) {
        return Err(miette::miette!("--seconds must be a positive number"));
    }
    let engines = match hunted(args, site)? {
        Ok(engines) => engines,
        Err(absent) => {
            complain(&absent);
            return Ok(Exit::Engine);
        }
    };
    let options = Options {
        site: site.clone(),
        engines,
        procedures: args.procedures.clone(),
        seed: args.seed,
        time,
        specs: args.specs,
        findings: args.findings,
        shrink: span("--shrink-minutes", 60.0 * args.shrink_minutes)?,
        jobs: args.jobs.unwrap_or_else(process::cores),
        budget: Budget { seconds: args.seconds, ..Budget::default() },
        out: args.out.clone(),
        log: &complain,
    };
    let _claim = OutputLock::of(&args.out).into_diagnostic()?;
    let found = hunt::hunt(&options).map_err(not_hunted)?;
    print(&match args.format {
        TextOrJson::Json => json(&found)?,
        TextOrJson::Terminal => summary(&found, &args.out),
    })?;
    Ok(match (found.new_findings().next(), found.is_interrupted) {
        (Some(_), _) => Exit::Failed,
        // A hunt that was stopped must not look like one that found nothing.
        (None, true) => Exit::Undecided,
        (None, false) => Exit::Passed,
    })
}

fn summary(hunt: &Hunt, out: &Path) -> String {
    let [met, all] = hunt.coverage.pairs();
    let mut text = String::new();
    for finding in &hunt.findings {
        text += &line(finding);
    }
    text += &format!(
        "{} new findings in {} specs ({} comparisons, {} undecided); {met} of {all} pairs of features met\n{}\n",
        hunt.new_findings().count(),
        hunt.specs,
        hunt.comparisons,
        hunt.undecided,
        out.join("index.md").display()
    );
    text
}

fn line(finding: &Finding) -> String {
    let [planes, gammas] = finding.table;
    let off = finding.deviation.map(|d| format!(" by {:+.3} %", 100.0 * d)).unwrap_or_default();
    let known = finding.known.as_ref().map(|k| format!("; known: {k}")).unwrap_or_default();
    let cause = finding.diagnosis.as_deref().unwrap_or("unexplained");
    let (id, symptom, lines, seen) = (&finding.id, &finding.symptom, finding.lines, finding.seen);
    format!("{id}: {symptom}{off}; {lines} lines, table {planes} x {gammas}, in {seen} specs; {cause}{known}\n")
}

/// Who is hunted, or who was named and is not there.
type Hunted = Result<BTreeMap<EngineName, EngineSettings>, String>;

fn hunted(args: &HuntArgs, site: &EngineRoot) -> Result<Hunted, Diagnostic> {
    let mut declared: BTreeMap<EngineName, EngineSettings> = BTreeMap::new();
    let is_missing = args.engines.iter().any(|name| luxproof_engines::entry(name).is_none());
    let files = match &args.spec {
        Some(file) => vec![file.clone()],
        None if is_missing => specs_here(),
        None => vec![],
    };
    for file in files {
        let read = specs(&file);
        let named = args.spec.is_some();
        for (_, spec) in if named { read.map_err(diagnose)? } else { read.unwrap_or_default() } {
            for (name, mut settings) in spec.engines.into_iter().flatten() {
                hunt::run_in(&mut settings, file.parent().unwrap_or(Path::new("")));
                declared.entry(EngineName::from(name)).or_insert(settings);
            }
        }
    }
    let ours = luxproof_engines::all().into_iter().map(|e| e.name());
    let known: Vec<EngineName> = ours.chain(declared.keys().cloned()).unique().collect();
    if let Some(name) = args.engines.iter().find(|name| !known.iter().any(|k| k == *name)) {
        let help = suggestion(name, known.iter().map(EngineName::as_str));
        return Err(miette::miette!(
            help = format!("{help} A program of your own is named in a spec: --spec FILE"),
            "there is no engine `{name}`"
        ));
    }
    let mut chosen = BTreeMap::new();
    for name in known {
        let is_declared = args.engines.is_empty() && declared.contains_key(&name);
        if !is_declared && !luxproof_engines::is_chosen(&name, &args.engines) {
            continue;
        }
        let settings = declared.get(&name).cloned().unwrap_or_default();
        let engine = luxproof_engines::named(&name, &settings.0, Path::new("")).into_diagnostic()?;
        match engine.probe(site) {
            Ok(_) => drop(chosen.insert(name, settings)),
            Err(absent) if !args.engines.is_empty() => return Ok(Err(format!("{name}: {absent}"))),
            Err(absent) => complain(&format!("{name}: {absent}")),
        }
    }
    Ok(Ok(chosen))
}

/// The specs of the working directory, by name.
fn specs_here() -> Vec<PathBuf> {
    let entries = std::fs::read_dir(".").into_iter().flatten().flatten().map(|entry| entry.path());
    entries.filter(|p| p.extension().is_some_and(|e| e == "yaml" || e == "yml")).sorted().collect()
}

pub(super) fn shrink(args: &ShrinkArgs, site: &EngineRoot) -> Result<Exit, Diagnostic> {
    let stem = files::stem(&args.spec).unwrap_or(Path::new("spec"));
    let out = args.out.clone().unwrap_or_else(|| Path::new("luxproof-out/shrink").join(stem));
    let options = ShrinkOptions {
        site: site.clone(),
        spec: &args.spec,
        case: args.case.as_deref(),
        engine: EngineName::from(args.engine.clone()),
        procedures: args.procedures.clone(),
        seed: args.seed,
        time: span("--minutes", 60.0 * args.minutes)?,
        jobs: args.jobs.unwrap_or_else(process::cores),
        out: out.clone(),
    };
    let _claim = OutputLock::of(&out).into_diagnostic()?;
    match hunt::shrink(&options).map_err(not_hunted)? {
        Shrinking::Found(finding) => {
            print(&match args.format {
                TextOrJson::Json => json(&finding)?,
                TextOrJson::Terminal => format!("{}{}\n", line(&finding), out.join("issue.md").display()),
            })?;
            Ok(Exit::Failed)
        }
        Shrinking::Sound => {
            complain(&format!("{}: nothing is wrong with {} there", args.spec.display(), args.engine));
            Ok(Exit::Passed)
        }
    }
}

fn not_hunted(error: HuntError) -> Diagnostic {
    match error {
        HuntError::Audit(error) => not_audited(error),
        HuntError::Spec(error) => diagnose(error),
        other => Diagnostic::from_err(other),
    }
}
