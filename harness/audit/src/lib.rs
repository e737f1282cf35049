//! Runs an audit, from specs to one report, as a library call that prints nothing.
//!
//! An audit plans its cases, lets engines render them, samples undecided points again and judges the readings.
//!
//! ```no_run
//! use std::path::PathBuf;
//!
//! use luxproof_audit::Options;
//! use luxproof_engines::EngineRoot;
//!
//! fn main() -> Result<(), Box<dyn std::error::Error>> {
//!     let options = Options::new(EngineRoot::of_user()?, PathBuf::from("out"));
//!     let report = luxproof_audit::run(&[PathBuf::from("office.yaml")], &options)?;
//!     for c in report.comparisons.iter().filter(|c| c.verdict.is_bad()) {
//!         println!("{} at {}: {:?}", c.key, c.meter, c.relative_deviation);
//!     }
//!     std::process::exit(report.exit().code().into())
//! }
//! ```

mod case;
mod conformance;
mod curves;
pub mod jobs;
pub mod measure;
mod observer;
pub mod plan;
mod preflight;
mod recorded;
mod repetition;
mod report;
mod sampling;
pub mod sequential;
mod undecided;

use crate::plan::skip_of;
use crate::report::{explain_by_declared_errors, join_reports, spec_record};
use luxproof_model::ForeignPath;
use luxproof_model::LintRecord;
use luxproof_model::Tool;
use luxproof_verdict::overruled;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;

use itertools::{Itertools, izip};
use parking_lot::Mutex;
use sha2::{Digest, Sha256};

use crate::measure::cache::Cache;
use crate::measure::{CacheMissPolicy, Machine, Reader, RequestedReadings};
use crate::plan::{Plan, Planner, Run, Selection, Skipping};
use luxproof_engines::EngineRoot;
use luxproof_model::Ratios;
use luxproof_model::Scope;
use luxproof_model::{EVERYONE, EngineName, Skip};
use luxproof_model::{EngineStatus, Status};
use luxproof_model::{Exit, Report, Request, SpecRecord};
use luxproof_process::digest::hexadecimal;
use luxproof_process::files::{Durability, FileError};
use luxproof_process::output_lock::{OutputLock, OutputLockError};
use luxproof_process::process;
use luxproof_process::slots::side_by_side;
use luxproof_spec::procedures::Task;
use luxproof_spec::{Case, Faults, SpecError, Trust, find_lints};
use luxproof_verdict::diagnosis::{self, Examined};
use luxproof_verdict::{Measured, Policy, PolicyChoice, ProfileBudget, Published};

use case::{Audit, Stop};
pub use conformance::{Conformance, Section, Standing, Topic, examine_adapter};
pub use luxproof_model::Sampling;
pub use observer::{FurtherStage, Observer, SilentObserver};
pub use preflight::chosen;

/// The options of an audit.
pub struct Options<'a> {
    pub site: EngineRoot,
    /// The output folder: report, readings, scenes and logs.
    pub out: PathBuf,
    /// The store of earlier readings. Without one, engines take every reading again and nothing is stored.
    pub cache: Option<Cache>,
    /// Number of threads or processes that run at a time.
    pub jobs: usize,
    /// Engines, procedures and seed.
    pub selection: Selection,
    /// Only cases that match one of these globs or parts of names run; empty for all.
    pub filter: Vec<String>,
    /// Whether the plan leaves out readings that follow from others.
    pub skipping: Skipping,
    /// Who wrote the specs, which decides what they may do.
    pub trust: Trust,
    /// The project policies that judge, and the profile that is chosen from them.
    pub policy: PolicyChoice,
    /// When sampling stops; without a value the profile decides.
    pub sampling: Option<Sampling>,
    /// Replaces the budgets of specs and profile.
    pub budget: ProfileBudget,
    /// What happens to later cases when one fails.
    pub after_failure: AfterFailure,
    /// Whether engines also read the scenes of known answer.
    pub calibration: Calibration,
    /// Whether the audit looks for the causes of failures.
    pub diagnosis: Diagnosis,
    pub stated_errors: Repetition,
    /// Who reads what the cache does not have.
    pub asking: CacheMissPolicy,
    /// Collects the readings that the audit requests, for a caller that distributes them.
    pub asked: RequestedReadings,
    /// The names of the cases to read and judge; without it, all of them.
    /// All cases are planned in any event, since equal jobs are rendered once.
    pub only: Option<BTreeSet<String>>,
    /// The program that reports name as their writer.
    pub tool: Tool,
    pub observer: &'a dyn Observer,
}

/// Whether engines also read scenes of known answer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Calibration {
    /// Engines read them, and they are judged like any other case.
    Judged,
    /// Engines skip them, and the report lists the skips.
    LeftOut,
}

/// Whether the audit looks for the causes of failures.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Diagnosis {
    Sought,
    /// The search takes longer than many cases, and some callers only need verdicts.
    LeftOut,
}

/// Whether the audit checks the errors that user programs state.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Repetition {
    /// The programs read again with other seeds.
    Examined,
    /// No reading is repeated. Callers that plan several runs check only the last one.
    LeftOut,
}

/// What happens to later cases when one fails.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AfterFailure {
    GoOn,
    /// The report lists later cases as skipped.
    Stop,
}

impl Options<'_> {
    /// Runs everything that the specs request, on all cores, without a cache.
    pub fn new(site: EngineRoot, out: PathBuf) -> Self {
        Self {
            site,
            out,
            cache: None,
            jobs: process::cores(),
            selection: Selection { seed: 1, ..Selection::default() },
            filter: vec![],
            skipping: Skipping::Allowed,
            trust: Trust::Own,
            policy: PolicyChoice::default(),
            sampling: None,
            budget: ProfileBudget::default(),
            after_failure: AfterFailure::GoOn,
            calibration: Calibration::Judged,
            diagnosis: Diagnosis::Sought,
            stated_errors: Repetition::Examined,
            asking: CacheMissPolicy::AskEngine,
            asked: RequestedReadings::default(),
            only: None,
            tool: Tool { version: env!("CARGO_PKG_VERSION").to_owned(), ..Tool::default() },
            observer: &SilentObserver,
        }
    }

    /// The options that readings and verdicts depend on, as the report stores them.
    pub fn request(&self) -> Request {
        let Selection { engines, procedures, seed } = self.selection.clone();
        let PolicyChoice { file, profile, tolerance_class, .. } = self.policy.clone();
        Request {
            engines,
            procedures,
            filter: self.filter.clone(),
            seed,
            no_skips: self.skipping == Skipping::Nothing,
            sampling: self.sampling,
            no_calibration: self.calibration == Calibration::LeftOut,
            fail_fast: self.after_failure == AfterFailure::Stop,
            policy: file.map(ForeignPath::from),
            profile,
            tolerance_class,
            relative_error: self.budget.relative_error,
        }
    }

    /// Replaces the options that readings and verdicts depend on by those of a stored request, except for its policy: the caller
    /// decides by its trust which policy judges.
    #[must_use]
    pub fn with_request(self, request: &Request) -> Self {
        let Request { engines, procedures, filter, seed, policy: _, profile, tolerance_class, .. } = request.clone();
        Self {
            selection: Selection { engines, procedures, seed },
            filter,
            skipping: if request.no_skips { Skipping::Nothing } else { Skipping::Allowed },
            policy: PolicyChoice { profile, tolerance_class, ..self.policy },
            sampling: request.sampling,
            budget: ProfileBudget { relative_error: request.relative_error, seconds: None },
            calibration: if request.no_calibration { Calibration::LeftOut } else { Calibration::Judged },
            after_failure: if request.fail_fast { AfterFailure::Stop } else { AfterFailure::GoOn },
            ..self
        }
    }

    /// The reader that all cases of the audit share.
    fn reader(&self) -> Reader {
        let machine = match self.skipping {
            Skipping::Allowed => Machine::new(self.jobs),
            Skipping::Nothing => Machine::rendering_everything(self.jobs),
        };
        let (cache, asking, asked) = (self.cache.clone(), self.asking.clone(), self.asked.clone());
        let results = [Some(self.out.as_path()), self.cache.as_ref().map(Cache::root)];
        let hidden = results.into_iter().flatten().filter_map(|folder| std::path::absolute(folder).ok()).collect();
        Reader { cache, asking, asked, hidden, ..Reader::bare(&self.site, machine) }
    }
}

/// Why an audit could not start or finish.
#[derive(Debug, thiserror::Error)]
pub enum AuditError {
    #[error(transparent)]
    Spec(#[from] Faults),
    #[error(transparent)]
    File(#[from] FileError),
    #[error(transparent)]
    OutputLock(#[from] OutputLockError),
}

impl From<SpecError> for AuditError {
    fn from(fault: SpecError) -> Self {
        Self::Spec(fault.into())
    }
}

/// Above this number, further cases would only wait for the machine's slots, each on its own threads.
const MAX_CONCURRENT_CASES: usize = 8;

/// The number of cases that run at a time.
///
/// It is one more than the threads: while one case samples its points stage by stage, another uses the free slots.
fn concurrent_cases(options: &Options<'_>) -> usize {
    let waiting = usize::from(options.jobs > 1);
    options.jobs.clamp(1, MAX_CONCURRENT_CASES) + waiting
}

impl Options<'_> {
    /// Locks the output folder.
    pub fn claim(&self) -> Result<OutputLock, OutputLockError> {
        let claim = if self.trust == Trust::Own { OutputLock::of } else { OutputLock::of_plain_folder };
        claim(&self.out)
    }
}

/// Runs every case of specs, folders and patterns and judges the readings of the engines.
///
/// The run writes files below [`Options::out`] only, and locks that folder while it lasts.
pub fn run(specs: &[PathBuf], options: &Options<'_>) -> Result<Report, AuditError> {
    run_and_hold(specs, options).map(|(report, _)| report)
}

/// Runs an audit as [`run`] does, and passes the lock on the output folder to the caller.
pub fn run_and_hold(specs: &[PathBuf], options: &Options<'_>) -> Result<(Report, OutputLock), AuditError> {
    let prepared = PreparedAudit::from_specs(specs, options)?;
    // The lock comes second, so that a refused spec leaves no files behind.
    let claim = options.claim()?;
    prepared.run(options).map(|report| (report, claim))
}

/// Takes the readings that [`Options::asking`] admits and records in [`Options::asked`] every reading that the run
/// requests.
///
/// It writes nothing but the cache, and returns the status of each engine.
pub fn survey(specs: &[PathBuf], options: &Options<'_>) -> Result<Vec<EngineStatus>, AuditError> {
    let mut prepared = PreparedAudit::from_specs(specs, options)?;
    let (_under_way, published) = (process::UnderWay::begin(), published(&prepared.cases)?);
    options.cache.iter().for_each(Cache::sweep);
    prepared.grant_budgets(&published, options);
    let audit = Audit { options, reader: options.reader() };
    let indices: Vec<usize> = (0..prepared.cases.len()).collect();
    let statuses =
        side_by_side(concurrent_cases(options), &indices, |&k| prepared.survey_case(&audit, k, published[k].as_ref()));
    statuses.into_iter().flatten_ok().collect()
}

/// An audit before its engines start. Cases, plans and policies have one entry per case, in the same order.
struct PreparedAudit {
    spec: SpecRecord,
    cases: Vec<Case>,
    plans: Vec<Plan>,
    policies: Vec<Arc<Policy>>,
    lints: Vec<LintRecord>,
}

impl PreparedAudit {
    /// Reads and plans the cases that specs, folders and patterns name, and the scenes of known answer.
    fn from_specs(specs: &[PathBuf], options: &Options<'_>) -> Result<Self, AuditError> {
        let (mut cases, mut policies) = chosen(specs, options)?;
        let lints = find_lints(&cases);
        options.observer.linted(&lints);
        options.observer.linted(&overruled(&cases, &policies, &options.policy));
        let mut planner = Planner::new(&options.selection, &options.site, options.skipping);
        let mut plans = cases.iter().map(|case| planner.plan(case)).collect::<Result<Vec<Plan>, _>>()?;
        let spec = subject(specs, &cases);
        let calibrations = planner.calibrations(&cases, &plans)?;
        match options.calibration {
            Calibration::Judged => {
                let policy = common_policy(&policies)?;
                for (case, plan) in calibrations {
                    cases.push(case);
                    plans.push(plan);
                    policies.push(Arc::clone(&policy));
                }
            }
            Calibration::LeftOut => plans[0].skips.extend(skip_calibrations(&calibrations)),
        }
        if let Some(only) = &options.only {
            let all = izip!(cases, plans, policies);
            (cases, plans, policies) = all.filter(|(case, ..)| only.contains(&case.name)).multiunzip();
        }
        Ok(Self { spec, cases, plans, policies, lints: lints.iter().map(lint_record).collect() })
    }

    /// Sets the budget of the first stage in the jobs of all plans.
    fn grant_budgets(&mut self, published: &[Option<Published>], options: &Options<'_>) {
        for (case, plan, published, policy) in izip!(&self.cases, &mut self.plans, published, &self.policies) {
            let sampling = options.sampling.or(policy.profile.sampling).unwrap_or_default();
            grant(sampling, policy, case, published.as_ref(), plan);
        }
    }

    /// Takes the readings of one case and returns the status of its engines; an interrupted run has none.
    fn survey_case(
        &self,
        audit: &Audit<'_>,
        k: usize,
        published: Option<&Published>,
    ) -> Result<Vec<EngineStatus>, AuditError> {
        if process::is_interrupted() {
            return Ok(vec![]);
        }
        let judge = self.policies[k].judge(&self.cases[k], published);
        Ok(audit.readings(&self.cases[k], &self.plans[k], &judge, None)?.engines)
    }

    /// Runs all cases and joins their reports.
    fn run(mut self, options: &Options<'_>) -> Result<Report, AuditError> {
        let (clock, _under_way) = (Instant::now(), process::UnderWay::begin());
        options.cache.iter().for_each(Cache::sweep);
        let published = published(&self.cases)?;
        self.grant_budgets(&published, options);
        let reader = options.reader();
        options.observer.planned(&self.cases, &self.plans, &reader.machine);
        let runner = CaseRunner {
            audit: Audit { options, reader },
            prepared: &self,
            published: &published,
            is_single: self.cases.iter().filter(|case| !case.is_calibration()).count() == 1,
            // Planning many meters takes long enough for an interruption to arrive before the first case.
            stop: Mutex::new(process::is_interrupted().then(Stop::interrupted)),
        };
        let mut reports = runner.run_all()?;
        if options.diagnosis == Diagnosis::Sought {
            diagnose(&self.plans, &mut reports);
        }
        for (case, report) in self.cases.iter().zip(&mut reports) {
            let folder = runner.folder(case);
            if folder != options.out && report.comparisons.iter().any(|c| c.diagnosis.is_some()) {
                luxproof_report_file::keep_again(&mut *report, &folder, Durability::Usual)?;
            }
        }
        let ratios = self.compute_ratios(&reports, options.observer);
        let findings = published_findings(&self.cases, &self.plans, &published);
        let mut report = join_reports(self.spec, reports);
        report.ratios = ratios;
        report.lints = self.lints;
        report.request = Some(options.request());
        report.published_findings = findings;
        // Cases run concurrently, so the sum of their seconds is not the duration of the run.
        report.wall_s = clock.elapsed().as_secs_f64();
        write_report(&mut report, &options.out, Durability::Lasting)?;
        Ok(report)
    }

    /// The ratios between cases that a spec compares, engine by engine.
    fn compute_ratios(&self, reports: &[Report], observer: &dyn Observer) -> Vec<Ratios> {
        let mut ratios = vec![];
        for (k, case) in self.cases.iter().enumerate() {
            for name in &case.before {
                let Some(before) = self.cases.iter().position(|other| other.name == *name) else {
                    observer.remarked(case, &format!("it is not compared with {name}, which was not run"));
                    continue;
                };
                let (before, after) = (self.measured(before, reports), self.measured(k, reports));
                ratios.extend(self.policies[k].judge(case, None).ratios(&before, &after));
            }
        }
        ratios
    }

    /// What one case contributes to a ratio.
    fn measured<'a>(&'a self, k: usize, reports: &'a [Report]) -> Measured<'a> {
        Measured {
            case: &self.cases[k].name,
            tasks: &self.plans[k].tasks,
            readings: reports[k].readings.iter().map(|r| (&r.key, &r.reading)).collect(),
            comparisons: &reports[k].comparisons,
            recordings: &reports[k].recordings,
        }
    }
}

fn lint_record(lint: &SpecError) -> LintRecord {
    let SpecError { file, line, message, help, .. } = lint.clone();
    LintRecord { file: file.display().to_string(), line, message, help }
}

/// Skips every scene of known answer for every engine.
fn skip_calibrations(calibrations: &[(Case, Plan)]) -> Vec<Skip> {
    const REASON: &str = "no engine reads this scene of known answer: --no-calibration";
    let scenes = calibrations.iter().flat_map(|(case, plan)| plan.tasks.iter().map(move |task| (case, task)));
    scenes.map(|(case, task)| skip_of(case, task, EVERYONE, Scope::Procedure, REASON)).collect()
}

/// Runs the cases of an audit concurrently and remembers why later ones must not start.
struct CaseRunner<'a> {
    audit: Audit<'a>,
    prepared: &'a PreparedAudit,
    published: &'a [Option<Published>],
    /// Whether the specs have one case only, which then uses the output folder itself.
    is_single: bool,
    stop: Mutex<Option<Stop>>,
}

impl CaseRunner<'_> {
    /// Runs all cases; the reports are in the order of the cases.
    fn run_all(&self) -> Result<Vec<Report>, AuditError> {
        let (options, cases) = (self.audit.options, &self.prepared.cases);
        // With --fail-fast a case must not start before the previous one has passed.
        let width = if options.after_failure == AfterFailure::Stop { 1 } else { concurrent_cases(options) };
        let is_calibration: Vec<bool> = cases.iter().map(Case::is_calibration).collect();
        let order = if width == 1 { (0..cases.len()).collect() } else { start_order(&is_calibration) };
        let reports = side_by_side(width, &order, |&k| self.run_case(k));
        order.iter().zip(reports).sorted_by_key(|(k, _)| **k).map(|(_, report)| report).collect()
    }

    /// Runs and judges one case and writes its report into its folder.
    fn run_case(&self, k: usize) -> Result<Report, AuditError> {
        let PreparedAudit { cases, plans, policies, .. } = self.prepared;
        let (case, options) = (&cases[k], self.audit.options);
        let folder = self.folder(case);
        let stopped = self.stop.lock().clone();
        let published = self.published[k].as_ref();
        let mut report = self.audit.case(case, &plans[k], &policies[k], published, stopped.as_ref(), &folder)?;
        report.tool = options.tool.clone();
        if folder != options.out {
            write_report(&mut report, &folder, Durability::Usual)?;
        }
        self.update_stop(case, &report);
        Ok(report)
    }

    /// Stops later cases after an interruption, and after a failure where the caller requests that.
    fn update_stop(&self, case: &Case, report: &Report) {
        let mut stop = self.stop.lock();
        if process::is_interrupted() {
            *stop = Some(Stop::interrupted());
        } else if self.audit.options.after_failure == AfterFailure::Stop
            && stop.is_none()
            && matches!(report.worst(), Exit::Failed | Exit::Engine)
        {
            let why = format!("not run: {} failed, and --fail-fast was asked for", case.name);
            *stop = Some(Stop { why, status: Status::Skipped });
        }
    }

    /// The folder of a case: the output folder itself for a single case, else one below it.
    fn folder(&self, case: &Case) -> PathBuf {
        let out = &self.audit.options.out;
        if case.is_calibration() {
            out.join(&case.name)
        } else if self.is_single {
            out.clone()
        } else {
            out.join(case_subfolder(out, case))
        }
    }
}

/// The order in which cases start; `is_calibration` marks the scenes of known answer.
///
/// The first requested case starts first, since the user waits for its verdicts. Scenes of known answer follow:
/// renderers sleep between their frames there, so they take longest and compute least. All others run meanwhile.
fn start_order(is_calibration: &[bool]) -> Vec<usize> {
    let (known, asked): (Vec<usize>, Vec<usize>) = (0..is_calibration.len()).partition(|k| is_calibration[*k]);
    let (first, others) = asked.split_at(asked.len().min(1));
    [first, &known, others].concat()
}

/// The engines to examine, in addition to the built-in ones.
pub enum Subjects<'a> {
    /// No others.
    Ours,
    /// Those of a spec.
    OfSpec(&'a Path),
    /// Those of a case.
    Of(Box<Case>),
}

/// Lets engines read the scenes of known answer and judges their readings.
pub fn examine(subjects: Subjects<'_>, options: &Options<'_>) -> Result<Report, AuditError> {
    let (subjects, policy) = match subjects {
        Subjects::OfSpec(path) => {
            let (cases, policies) = chosen(&[path.to_owned()], options)?;
            (cases, common_policy(&policies)?)
        }
        Subjects::Ours => (vec![Case::default()], user_policy(options)?),
        Subjects::Of(case) => (vec![*case], user_policy(options)?),
    };
    let planned = Planner::new(&options.selection, &options.site, options.skipping).examinations(&subjects)?;
    let (cases, plans): (Vec<_>, Vec<_>) = planned.into_iter().unzip();
    let (spec, policies) = (cases.first().map(spec_record).unwrap_or_default(), vec![policy; cases.len()]);
    PreparedAudit { spec, cases, plans, policies, lints: vec![] }.run(options)
}

/// The policy that the command line names, for cases that no spec describes.
fn user_policy(options: &Options<'_>) -> Result<Arc<Policy>, Faults> {
    options.policy.read(options.policy.file.as_deref(), Trust::Own, &BTreeSet::new()).map(Arc::new)
}

/// The policy of the scenes of known answer: that of the specs where they share one, else the built-in one.
fn common_policy(policies: &[Arc<Policy>]) -> Result<Arc<Policy>, SpecError> {
    match policies {
        [first, rest @ ..] if rest.iter().all(|other| Arc::ptr_eq(first, other)) => Ok(Arc::clone(first)),
        _ => Policy::built_in().map(Arc::new),
    }
}

/// Sets the budget of the first stage in the jobs of a case's plan.
pub fn grant(sampling: Sampling, policy: &Policy, case: &Case, published: Option<&Published>, plan: &mut Plan) {
    sampling::grant(sampling, &policy.judge(case, published), plan);
}

/// Writes a report into a folder; a report of other readings that is already there moves to another name.
fn write_report(report: &mut Report, folder: &Path, care: Durability) -> Result<(), FileError> {
    report.sentences = luxproof_verdict::sentences(report);
    if let Some(moved_to) = luxproof_report_file::keep_in(report, folder, care)? {
        let aside = moved_to.display();
        tracing::warn!(
            "an earlier report has readings that were not asked for this time, or is of another seed or spec: it stays as {aside}"
        );
    }
    Ok(())
}

/// Explains failures by all readings of the run; what remains open is explained by declared errors.
fn diagnose(plans: &[Plan], reports: &mut [Report]) {
    // The search for causes takes seconds, and an interrupted user does not wait.
    if process::is_interrupted() {
        return;
    }
    diagnosis::diagnose(&mut examined_cases(plans, reports));
    reports.iter_mut().for_each(explain_by_declared_errors);
    diagnosis::describe_unexplained(&mut examined_cases(plans, reports));
}

/// All cases at once, since a cause usually shows in several of them.
fn examined_cases<'a>(plans: &'a [Plan], reports: &'a mut [Report]) -> Vec<Examined<'a>> {
    let mut cases = vec![];
    for (plan, report) in plans.iter().zip(reports) {
        let heavy = report.recordings.iter().filter(|r| r.states_heavy_tail());
        let silent = heavy.map(|r| r.key.engine.clone()).collect();
        let design_effects = report.recordings.iter().filter_map(|r| Some((r.key.clone(), r.design_effect?))).collect();
        let settings = plan.runs.iter().map(|run| settings_of_run(plan, run)).collect();
        let failing_biases = report.failed_biases().map(|bias| (bias.key.clone(), bias.basis)).collect();
        let comparisons = &mut report.comparisons;
        let tasks = &plan.tasks;
        cases.push(Examined {
            tasks,
            settings,
            silent,
            is_lenient: false,
            design_effects,
            failing_biases,
            comparisons,
        });
    }
    cases
}

/// An engine with the text of its settings, by which a diagnosis distinguishes its runs.
fn settings_of_run(plan: &Plan, run: &Run) -> (EngineName, String) {
    (plan.engines[run.engine].engine.name(), format!("{:?}", run.job.settings))
}

/// The published tables of each case, or every fault in them.
pub fn published(cases: &[Case]) -> Result<Vec<Option<Published>>, Faults> {
    let (tables, faults): (Vec<_>, Vec<_>) = cases.iter().map(read_published).partition_result();
    Faults::of(faults).map_or(Ok(tables), Err)
}

/// Reads the published table of a case, where the case names one.
fn read_published(case: &Case) -> Result<Option<Published>, SpecError> {
    let Some(path) = case.published.as_deref() else { return Ok(None) };
    let trust = case.source.trust;
    let published = Published::read(path).map_err(|error| error.fault(path, trust))?;
    let cells = published.count_cells();
    if trust != Trust::Own && cells > MAX_FOREIGN_CELLS {
        let message =
            format!("the tables have {cells} cells, and those of a spec that is not trusted {MAX_FOREIGN_CELLS}");
        return Err(SpecError::of(path, message, "leave out what no meter measures"));
    }
    Ok(Some(published.for_case(&case.name)))
}

/// The most cells of the tables that a spec that is not trusted names: each is compared with all others.
const MAX_FOREIGN_CELLS: usize = 5_000;

/// Entries of published files that correspond to nothing in any of the cases that name the file.
fn published_findings(cases: &[Case], plans: &[Plan], published: &[Option<Published>]) -> Vec<String> {
    let mut files: BTreeMap<&Path, (&Published, Vec<&Task>)> = BTreeMap::new();
    for ((case, plan), published) in cases.iter().zip(plans).zip(published) {
        let Some((path, published)) = case.published.as_deref().zip(published.as_ref()) else { continue };
        files.entry(path).or_insert((published, vec![])).1.extend(&plan.tasks);
    }
    files.values().flat_map(|(published, tasks)| published.findings(tasks)).collect()
}

/// The folder of one of several cases, below `root`. The spec's name does not appear twice in the path.
fn case_subfolder(root: &Path, case: &Case) -> PathBuf {
    let prefix = root.file_name().and_then(|n| n.to_str()).map(|n| format!("{n}/"));
    let shortened = prefix.and_then(|prefix| case.name.strip_prefix(&prefix));
    PathBuf::from(shortened.unwrap_or(&case.name))
}

/// The record of what runs: the spec of a single case, else one record for all cases together.
pub fn subject(specs: &[PathBuf], cases: &[Case]) -> SpecRecord {
    if let [case] = cases {
        return spec_record(case);
    }
    let paths: Vec<String> = specs.iter().map(|p| p.display().to_string()).collect();
    let mut hash = Sha256::new();
    for case in cases {
        hash.update(&case.sha256);
    }
    let title = match cases {
        [first, ..] if cases.iter().all(|c| c.path == first.path) => first.title.clone(),
        _ => format!("{} cases of {}", cases.len(), paths.join(", ")),
    };
    SpecRecord { path: paths.join(" "), sha256: hexadecimal(&hash.finalize()), title }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scenes_of_known_answer_are_begun_after_the_first_case_and_before_all_others() {
        assert_eq!(start_order(&[false, false, false, true, true]), [0, 3, 4, 1, 2]);
        assert_eq!(start_order(&[true, false]), [1, 0]);
        assert_eq!(start_order(&[true; 2]), [0, 1]);
        assert_eq!(start_order(&[false; 2]), [0, 1]);
        assert!(start_order(&[]).is_empty());
    }
}
