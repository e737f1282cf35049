//! `luxproof run`: every case of the specs, folders and patterns given, one report over all.

use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Instant, SystemTime};

use miette::{IntoDiagnostic, Report as Diagnostic};
use sha2::{Digest, Sha256};

use super::RunArgs;
use super::diagnostic::diagnose;
use super::engines::report_installation;
use super::progress::Progress;
use super::sampling::sample_on;
use super::views::print_reports;
use crate::audit::run;
use crate::audit::sequential;
use crate::diagnosis;
use crate::engines::{self, Site};
use crate::judge::{Comparison, Consensus, Judge, KnownDeviations, Published, PublishedTable, Split, Tolerances};
use crate::measure::Machine;
use crate::measure::cache::Cache;
use crate::plan::{Asked, Plan, Planner, Scope, Skip};
use crate::procedures::Task;
use crate::record::Status;
use crate::record::{EngineName, Recording};
use crate::report::{self, BaselineCheck, Exit, Report, ReportInputs, SpecRecord};
use crate::spec::{Case, filtered, suite};
use crate::system::files;
use crate::system::process;
use crate::system::slots::side_by_side;
use crate::trend::baseline::{self, Baseline, Comparability, Entry};

/// Runs all cases, judges and prints.
pub(super) fn run_specs(args: &RunArgs, site: &Site, cache: &Cache) -> Result<Exit, Diagnostic> {
    let clock = Instant::now();
    // Every spec is read and checked before any engine starts.
    let mut cases = suite(&args.specs).and_then(|all| filtered(all, &args.selected.filter)).map_err(diagnose)?;
    let selection = args.selected.selection();
    // Of a suite, the cases that the chosen procedures concern; a choice that concerns none is refused below.
    if cases.iter().any(|case| selection.concerns(case)) {
        cases.retain(|case| selection.concerns(case));
    }
    let planned = || {
        let mut planner = Planner::new(&selection, site, args.selected.skipping());
        cases.iter().map(|case| planner.plan(case)).collect::<Result<Vec<Plan>, _>>()
    };
    let mut plans = planned().map_err(diagnose)?;
    if args.install {
        let names: Vec<EngineName> = engines::all().iter().map(|e| e.name()).collect();
        let wanted = names
            .into_iter()
            .filter(|n| args.selected.engines.is_empty() || args.selected.engines.iter().any(|w| n == w));
        report_installation(site, &wanted.collect::<Vec<_>>());
        // With what is there now.
        plans = planned().map_err(diagnose)?;
    }
    let tables = Tables::read(&cases)?;
    for ((case, plan), published) in cases.iter().zip(&mut plans).zip(&tables.published) {
        args.sampling.grant(&tables.judge(case, published.as_ref()), plan);
    }
    let root = out_folder(args);
    let cache = Some(cache).filter(|_| !args.no_cache);
    let progress = Progress::of(plans.iter().zip(&cases).map(|(plan, case)| (plan, case.budget.seconds)));
    let threads = args.jobs.unwrap_or_else(process::cores).max(1);
    let machine = if args.selected.no_skips { Machine::rendering_everything(threads) } else { Machine::new(threads) };
    let suite = Suite { tables: &tables, site, cache, progress: &progress, machine };
    let stop: Mutex<Option<Stop>> = Mutex::new(None);
    let one = |&k: &usize| -> Result<(Report, Exit), Diagnostic> {
        let (case, plan) = (&cases[k], &plans[k]);
        let folder = if cases.len() == 1 { root.clone() } else { root.join(within(&root, case)) };
        let stopped = stop.lock().unwrap_or_else(PoisonError::into_inner).clone();
        let report = run_case(case, plan, tables.published[k].as_ref(), &suite, stopped.as_ref(), &folder)?;
        let named = |id: &str| plan.engines.iter().any(|p| p.engine.name() == id && p.asked == Asked::ByName);
        let exit = report.exit(named);
        let mut stop = stop.lock().unwrap_or_else(PoisonError::into_inner);
        if process::is_interrupted() {
            *stop = Some(Stop::Interrupted);
        } else if args.fail_fast && stop.is_none() && matches!(exit, Exit::Failed | Exit::Engine) {
            *stop = Some(Stop::Failed { case: case.name.clone() });
        }
        Ok((report, exit))
    };
    // What comes after a failure must not have begun before it.
    let side = if args.fail_fast { 1 } else { threads.min(CASES_AT_A_TIME) };
    let done = side_by_side(side, &(0..cases.len()).collect::<Vec<_>>(), one);
    let (reports, exits): (Vec<Report>, Vec<Exit>) =
        done.into_iter().collect::<Result<Vec<_>, _>>()?.into_iter().unzip();
    let mut exit = exits.into_iter().fold(Exit::Passed, Exit::worse);
    drop(progress);
    let Some(report) = Report::joined(record(args, &cases), reports) else { return Ok(exit) };
    // Cases ran side by side: their seconds do not add up.
    let mut report = if cases.len() > 1 { Report { wall_s: clock.elapsed().as_secs_f64(), ..report } } else { report };
    if let Some(path) = &args.baseline {
        let check = hold_against_baseline(&report, path, &root)?;
        exit = exit.worse(if check.is_as_accepted() { Exit::Passed } else { Exit::Failed });
        report.baseline = Some(check);
    }
    if cases.len() > 1 || report.baseline.is_some() {
        files::keep_json(&root.join("report.json"), &report).into_diagnostic()?;
    }
    print_reports(&[(report, root)], &args.views)?;
    Ok(exit)
}

/// Holds a run against its baseline; what does not match it fails and is left as a candidate in the run's folder.
fn hold_against_baseline(report: &Report, path: &Path, root: &Path) -> Result<BaselineCheck, Diagnostic> {
    let place = Baseline::place(path, report);
    let kept = if place.exists() { Baseline::read(&place).into_diagnostic()?.entries } else { vec![] };
    let candidate = Baseline::candidate(report);
    // What was not asked of this run is not missed in it.
    let skipped = report.skips.iter().map(|s| &s.key);
    let asked: Vec<_> = candidate.entries.iter().map(|e| &e.key).chain(skipped).collect();
    let kept: Vec<Entry> = kept.into_iter().filter(|e| asked.contains(&&e.key)).collect();
    let changes = baseline::compare(&kept, &candidate.entries, Comparability::SameInstrument);
    files::keep_json(&root.join("baseline-changes.json"), &changes).into_diagnostic()?;
    let check = super::diff::check(&changes, &place);
    if !check.is_as_accepted() {
        let file = root.join("baseline-candidate.json");
        candidate.write(&file).into_diagnostic()?;
        let accept = format!("luxproof accept {} --baseline {}", root.display(), path.display());
        eprintln!("baseline: left as a candidate: {}; to review it: {accept}", file.display());
    }
    Ok(check)
}

/// The folder of the run: by default that of the one spec or folder, or one for all where there are several.
fn out_folder(args: &RunArgs) -> PathBuf {
    let of_one = |path: &PathBuf| path.file_stem().map(|stem| Path::new("luxproof-out").join(stem));
    match (&args.out, &args.specs[..]) {
        (Some(folder), _) => folder.clone(),
        (None, [one]) if !one.display().to_string().contains('*') => {
            of_one(one).unwrap_or_else(|| "luxproof-out/suite".into())
        }
        _ => "luxproof-out/suite".into(),
    }
}

/// The folder of one case of several, a spec's own name not twice.
fn within(root: &Path, case: &Case) -> PathBuf {
    let spec = root.file_name().and_then(|n| n.to_str()).map(|n| format!("{n}/"));
    let own = spec.and_then(|prefix| case.name.strip_prefix(&prefix));
    PathBuf::from(own.unwrap_or(&case.name))
}

/// What was run, all cases together.
fn record(args: &RunArgs, cases: &[Case]) -> SpecRecord {
    if let [case] = cases {
        return record_of(case);
    }
    let paths: Vec<String> = args.specs.iter().map(|p| p.display().to_string()).collect();
    let mut hash = Sha256::new();
    for case in cases {
        hash.update(&case.sha256);
    }
    let sha256 = crate::spec::hexadecimal(&hash.finalize());
    let of_one_spec = cases.iter().all(|c| c.path == cases[0].path);
    let title = match cases {
        [first, ..] if of_one_spec => first.title.clone(),
        _ => format!("{} cases of {}", cases.len(), paths.join(", ")),
    };
    SpecRecord { path: paths.join(" "), sha256, title }
}

fn record_of(case: &Case) -> SpecRecord {
    SpecRecord { path: case.path.display().to_string(), sha256: case.sha256.clone(), title: case.title.clone() }
}

/// Tables that judging needs, read before any engine starts.
pub(super) struct Tables {
    tolerances: Tolerances,
    known: KnownDeviations,
    published: Vec<Option<Published>>,
}

impl Tables {
    pub(super) fn read(cases: &[Case]) -> Result<Self, Diagnostic> {
        let read = |case: &Case| case.published.as_deref().map(Published::read).transpose();
        Ok(Self {
            tolerances: Tolerances::built_in().into_diagnostic()?,
            known: KnownDeviations::built_in().into_diagnostic()?,
            published: cases.iter().map(read).collect::<Result<_, _>>().into_diagnostic()?,
        })
    }
}

impl Tables {
    fn judge<'a>(&'a self, case: &'a Case, published: Option<&'a Published>) -> Judge<'a> {
        Judge { tolerances: &self.tolerances, known: &self.known, overrides: &case.tolerances, published }
    }
}

/// Why the cases that are left are not run.
#[derive(Clone, Debug, thiserror::Error)]
enum Stop {
    #[error("not run: the run was interrupted")]
    Interrupted,
    #[error("not run: {case} failed, and --fail-fast was asked for")]
    Failed { case: String },
}

impl Stop {
    /// How the engines of a case that is left have fared: an interruption must not look like success.
    fn status(&self) -> Status {
        match self {
            Self::Interrupted => Status::Failed,
            Self::Failed { .. } => Status::Skipped,
        }
    }
}

/// What all cases of a run share.
struct Suite<'a> {
    tables: &'a Tables,
    site: &'a Site,
    /// Where readings are kept between runs, unless they are not to be.
    cache: Option<&'a Cache>,
    progress: &'a Progress,
    machine: Arc<Machine>,
}

/// More cases at a time would only wait for the machine's slots, each on threads of its own.
const CASES_AT_A_TIME: usize = 8;

fn run_case(
    case: &Case,
    plan: &Plan,
    published: Option<&Published>,
    suite: &Suite<'_>,
    stop: Option<&Stop>,
    folder: &Path,
) -> Result<Report, Diagnostic> {
    let (started, clock) = (SystemTime::now(), Instant::now());
    let options = run::Options {
        site: suite.site.clone(),
        out: folder.to_owned(),
        machine: Arc::clone(&suite.machine),
        cache: suite.cache.cloned(),
    };
    let mut outcome = match stop {
        Some(stop) => run::not_run(case, plan, stop.status(), &stop.to_string()),
        None => {
            run::run(case, plan, &options, &suite.progress.case(&case.name, case.budget.seconds)).into_diagnostic()?
        }
    };
    let judge = suite.tables.judge(case, published);
    if stop.is_none() && !process::is_interrupted() {
        let told = |text: &str| suite.progress.line(&format!("{}: {text}", case.name));
        sample_on(case, plan, &judge, &options.reader(), &mut outcome, &told).into_diagnostic()?;
    }
    if outcome.from_cache > 0 {
        let count = outcome.from_cache;
        suite
            .progress
            .line(&format!("{}: {count} answer(s) of engines from the cache (--no-cache asks anew)", case.name));
    }
    let Judged { comparisons, splits, consensus, tables } = judged(case, plan, &outcome.recordings, &judge);
    // What follows from other readings follows from nothing where the case was never begun.
    let holds = |s: &&Skip| stop.is_none() || matches!(s.scope, Scope::Engine | Scope::Procedure);
    let planned_skips = plan.skips.iter().filter(holds);
    let inputs = ReportInputs {
        case: case.name.clone(),
        spec: record_of(case),
        started,
        wall_s: clock.elapsed().as_secs_f64(),
        engines: outcome.engines,
        recordings: &outcome.recordings,
        skips: planned_skips.cloned().chain(outcome.skips).collect(),
        splits,
        consensus,
        published: tables,
        curves: plan.tasks.iter().flat_map(|task| report::curves(&case.name, task)).collect(),
    };
    let report = Report::new(inputs, comparisons);
    files::keep_json(&folder.join("report.json"), &report).into_diagnostic()?;
    Ok(report)
}

/// What follows from the recordings of a case.
#[derive(Default)]
struct Judged {
    comparisons: Vec<Comparison>,
    splits: Vec<Split>,
    consensus: Vec<Consensus>,
    tables: Vec<PublishedTable>,
}

/// Holds the recordings of a case against their references.
fn judged(case: &Case, plan: &Plan, recordings: &[Recording], judge: &Judge<'_>) -> Judged {
    let mut judged = Judged::default();
    for task in &plan.tasks {
        let task: &Task = task;
        let mine: Vec<&Recording> = recordings.iter().filter(|r| r.key.procedure == task.procedure).collect();
        let mut comparisons = judge.compare(task, &mine);
        diagnosis::diagnose(task, &mut comparisons);
        sequential::tell_the_price(&mut comparisons, &mine);
        judged.comparisons.extend(comparisons);
        judged.splits.extend(judge.split(task, &mine));
        judged.consensus.extend(judge.consensus(task, &mine));
        judged.tables.extend(judge.published.and_then(|p| p.table(task, &case.name)));
    }
    judged
}
