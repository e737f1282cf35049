//! From specs to a report, as a library call that prints nothing: plans, runs, further looks, verdicts, one report.
//!
//! ```no_run
//! use std::path::PathBuf;
//!
//! use luxproof::audit::{self, Options};
//! use luxproof::engines::Site;
//!
//! fn main() -> Result<(), Box<dyn std::error::Error>> {
//!     let options = Options::new(Site::of_user()?, PathBuf::from("out"));
//!     let report = audit::run(&[PathBuf::from("office.yaml")], &options)?;
//!     for c in report.comparisons.iter().filter(|c| c.verdict.is_bad()) {
//!         println!("{} at {}: {:?}", c.key, c.meter, c.relative_deviation);
//!     }
//!     std::process::exit(report.exit().code().into())
//! }
//! ```

mod case;
mod conformance;
pub mod jobs;
mod observer;
mod preflight;
mod repetition;
mod sampling;
pub mod sequential;

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;

use itertools::{Itertools, izip};
use parking_lot::Mutex;
use sha2::{Digest, Sha256};

use crate::diagnosis::{self, Examined};
use crate::engines::Site;
use crate::judge::{Measured, Policy, PolicyChoice, ProfileBudget, Published, PublishedError, Ratios};
use crate::measure::cache::Cache;
use crate::measure::{Asked, Asking, Machine, Reader};
use crate::plan::{EVERYONE, Plan, Planner, Run, Scope, Selection, Skip, Skipping};
use crate::procedures::Task;
use crate::record::{EngineStatus, Status};
use crate::report::{Exit, Report, Request, SpecRecord};
use crate::spec::{Case, Faults, SpecError, Trust, doubts};
use crate::system::claim::{Claim, ClaimError};
use crate::system::digest::hexadecimal;
use crate::system::files::{Care, FileError};
use crate::system::process;
use crate::system::slots::side_by_side;

pub use crate::judge::Sampling;
use case::{Audit, Stop};
pub use conformance::{Conformance, Section, Standing, Topic, examine_adapter};
pub use observer::{Observer, Silent};
pub use preflight::chosen;

pub struct Options<'a> {
    pub site: Site,
    /// The folder of the run's files: the report, readings, scenes and logs.
    pub out: PathBuf,
    /// Where readings are kept between runs; `None`: every reading is taken anew, and none is kept.
    pub cache: Option<Cache>,
    /// Threads or processes at a time.
    pub jobs: usize,
    /// Engines, procedures and seed.
    pub selection: Selection,
    /// Only cases whose name matches any of these, globs or parts of names; empty for all.
    pub filter: Vec<String>,
    /// Whether readings may be left out that follow from others.
    pub skipping: Skipping,
    /// Whose specs they are.
    pub trust: Trust,
    /// Which project policies judge, and by which of their profiles.
    pub policy: PolicyChoice,
    /// When sampling stops; `None`: as the profile says.
    pub sampling: Option<Sampling>,
    /// In place of what specs and profile say of budgets.
    pub budget: ProfileBudget,
    /// What a failed case means to those after it.
    pub after_failure: AfterFailure,
    /// Whether engines read scenes of known answer besides.
    pub calibration: Calibration,
    /// Whether it is asked why what fails does.
    pub diagnosis: Diagnosis,
    pub stated_errors: StatedErrors,
    /// Whom it asks for what the cache does not hold.
    pub asking: Asking,
    /// What was asked for, where others are to read it.
    pub asked: Asked,
    /// The cases that are read and judged, by name, where not all are; the others are planned, since equal jobs are read once.
    pub only: Option<BTreeSet<String>>,
    pub observer: &'a dyn Observer,
}

/// Whether engines read scenes of known answer besides those of the specs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Calibration {
    /// They do, and are judged by them like by any other case.
    Judged,
    /// They do not, and the report says so.
    LeftOut,
}

/// Whether it is asked why what fails does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Diagnosis {
    Sought,
    /// It takes longer than many a case, and who asks for verdicts alone has no use for it.
    LeftOut,
}

/// Whether what programs of users' state of their errors is looked into.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StatedErrors {
    /// They read again with other seeds.
    LookedInto,
    /// Nothing is read again: for many looks at once, of which the last is made with open eyes.
    Believed,
}

/// What a failed case means to those after it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AfterFailure {
    GoOn,
    /// They are reported as skipped.
    Stop,
}

impl Options<'_> {
    /// Everything that the specs ask for, on all cores, without a cache.
    pub fn new(site: Site, out: PathBuf) -> Self {
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
            stated_errors: StatedErrors::LookedInto,
            asking: Asking::Engines,
            asked: Asked::default(),
            only: None,
            observer: &Silent,
        }
    }

    /// What readings and verdicts depend on.
    fn request(&self) -> Request {
        let Selection { engines, procedures, seed } = self.selection.clone();
        let PolicyChoice { file, profile, tolerance_class } = self.policy.clone();
        Request {
            engines,
            procedures,
            filter: self.filter.clone(),
            seed,
            no_skips: self.skipping == Skipping::Nothing,
            sampling: self.sampling,
            no_calibration: self.calibration == Calibration::LeftOut,
            fail_fast: self.after_failure == AfterFailure::Stop,
            policy: file,
            profile,
            tolerance_class,
            relative_error: self.budget.relative_error,
        }
    }

    /// Has the same asked.
    #[must_use]
    pub fn asking(self, request: &Request) -> Self {
        let Request { engines, procedures, filter, seed, policy, profile, tolerance_class, .. } = request.clone();
        Self {
            selection: Selection { engines, procedures, seed },
            filter,
            skipping: if request.no_skips { Skipping::Nothing } else { Skipping::Allowed },
            policy: PolicyChoice { file: policy, profile, tolerance_class },
            sampling: request.sampling,
            budget: ProfileBudget { relative_error: request.relative_error, seconds: None },
            calibration: if request.no_calibration { Calibration::LeftOut } else { Calibration::Judged },
            after_failure: if request.fail_fast { AfterFailure::Stop } else { AfterFailure::GoOn },
            ..self
        }
    }

    fn reader(&self) -> Reader {
        let machine = match self.skipping {
            Skipping::Allowed => Machine::new(self.jobs),
            Skipping::Nothing => Machine::rendering_everything(self.jobs),
        };
        let (cache, asking, asked) = (self.cache.clone(), self.asking.clone(), self.asked.clone());
        Reader { cache, asking, asked, ..Reader::bare(&self.site, machine) }
    }
}

/// Why an audit could not be made at all.
#[derive(Debug, thiserror::Error)]
pub enum AuditError {
    #[error(transparent)]
    Spec(#[from] Faults),
    #[error(transparent)]
    File(#[from] FileError),
    #[error(transparent)]
    Claim(#[from] ClaimError),
}

impl From<SpecError> for AuditError {
    fn from(fault: SpecError) -> Self {
        Self::Spec(fault.into())
    }
}

/// More cases at a time would only wait for the machine's slots, each on threads of its own.
const MAX_CASES_AT_A_TIME: usize = 8;

/// One more than threads, so that some case waits for the machine while others take further looks, one after the other.
fn cases_at_a_time(options: &Options<'_>) -> usize {
    let waiting = usize::from(options.jobs > 1);
    options.jobs.clamp(1, MAX_CASES_AT_A_TIME) + waiting
}

/// Runs every case of specs, folders and patterns and judges what engines read; files are written below [`Options::out`] alone, by one
/// run at a time.
pub fn run(specs: &[PathBuf], options: &Options<'_>) -> Result<Report, AuditError> {
    run_and_hold(specs, options).map(|(report, _)| report)
}

/// The same; as long as the claim is kept the folder is the caller's.
pub fn run_and_hold(specs: &[PathBuf], options: &Options<'_>) -> Result<(Report, Claim), AuditError> {
    let prepared = Prepared::of(specs, options)?;
    // What is refused leaves nothing behind.
    let claim = Claim::of(&options.out)?;
    prepared.audited(options).map(|report| (report, claim))
}

/// Takes what readings of a run [`Options::asking`] admits, notes in [`Options::asked`] all that the run asks for by now, and keeps nothing but
/// the cache: how its engines fared.
pub fn survey(specs: &[PathBuf], options: &Options<'_>) -> Result<Vec<EngineStatus>, AuditError> {
    let mut prepared = Prepared::of(specs, options)?;
    let (_under_way, published) = (process::UnderWay::begin(), published(&prepared.cases)?);
    options.cache.iter().for_each(Cache::sweep);
    prepared.grant(&published, options);
    let Prepared { cases, plans, policies, .. } = &prepared;
    let audit = Audit { options, reader: options.reader() };
    let one = |&k: &usize| -> Result<Vec<EngineStatus>, AuditError> {
        if process::is_interrupted() {
            return Ok(vec![]);
        }
        let judge = policies[k].judge(&cases[k], published[k].as_ref());
        Ok(audit.readings(&cases[k], &plans[k], &judge, None)?.engines)
    };
    let side = cases_at_a_time(options);
    side_by_side(side, &(0..cases.len()).collect::<Vec<_>>(), one).into_iter().flatten_ok().collect()
}

/// What is asked of engines, and by which policies it is judged; each of the lists has one entry a case.
struct Prepared {
    spec: SpecRecord,
    cases: Vec<Case>,
    plans: Vec<Plan>,
    policies: Vec<Arc<Policy>>,
}

impl Prepared {
    /// The cases that specs, folders and patterns name, and the scenes of known answer besides.
    fn of(specs: &[PathBuf], options: &Options<'_>) -> Result<Self, AuditError> {
        let (mut cases, mut policies) = chosen(specs, options)?;
        options.observer.doubted(&doubts(&cases));
        let mut planner = Planner::new(&options.selection, &options.site, options.skipping);
        let mut plans = cases.iter().map(|case| planner.plan(case)).collect::<Result<Vec<Plan>, _>>()?;
        let spec = subject(specs, &cases);
        let known = planner.calibrations(&cases, &plans)?;
        match options.calibration {
            Calibration::Judged => {
                let policy = common(&policies)?;
                for (case, plan) in known {
                    cases.push(case);
                    plans.push(plan);
                    policies.push(Arc::clone(&policy));
                }
            }
            Calibration::LeftOut => {
                let why = "no engine reads this scene of known answer: --no-calibration";
                let skip = |(case, task)| Skip::of(case, task, EVERYONE, Scope::Procedure, why);
                let scenes = known.iter().flat_map(|(case, plan)| plan.tasks.iter().map(move |task| (case, task)));
                plans[0].skips.extend(scenes.map(skip));
            }
        }
        if let Some(only) = &options.only {
            let all = izip!(cases, plans, policies);
            (cases, plans, policies) = all.filter(|(case, ..)| only.contains(&case.name)).multiunzip();
        }
        Ok(Self { spec, cases, plans, policies })
    }

    /// Gives the jobs of all plans the budget of their first look.
    fn grant(&mut self, published: &[Option<Published>], options: &Options<'_>) {
        for (case, plan, published, policy) in izip!(&self.cases, &mut self.plans, published, &self.policies) {
            let sampling = options.sampling.or(policy.profile.sampling).unwrap_or_default();
            grant(sampling, policy, case, published.as_ref(), plan);
        }
    }

    /// One report of what is planned for cases.
    fn audited(mut self, options: &Options<'_>) -> Result<Report, AuditError> {
        let (clock, _under_way) = (Instant::now(), process::UnderWay::begin());
        options.cache.iter().for_each(Cache::sweep);
        let published = published(&self.cases)?;
        self.grant(&published, options);
        let Self { spec, cases, plans, policies } = self;
        options.observer.planned(&cases, &plans);
        let audit = Audit { options, reader: options.reader() };
        let is_alone = cases.iter().filter(|case| !case.is_known()).count() == 1;
        // Planning many meters takes its time, too.
        let stop: Mutex<Option<Stop>> = Mutex::new(process::is_interrupted().then(Stop::interrupted));
        let folder_of = |case: &Case| match case.is_known() {
            true => options.out.join(&case.name),
            false if is_alone => options.out.clone(),
            false => options.out.join(within(&options.out, case)),
        };
        let one = |&k: &usize| -> Result<Report, AuditError> {
            let (case, plan) = (&cases[k], &plans[k]);
            let folder = folder_of(case);
            let stopped = stop.lock().clone();
            let mut report = audit.case(case, plan, &policies[k], published[k].as_ref(), stopped.as_ref(), &folder)?;
            if folder != options.out {
                keep(&mut report, &folder, Care::Usual)?;
            }
            let mut stop = stop.lock();
            if process::is_interrupted() {
                *stop = Some(Stop::interrupted());
            } else if options.after_failure == AfterFailure::Stop
                && stop.is_none()
                && matches!(report.worst(), Exit::Failed | Exit::Engine)
            {
                let why = format!("not run: {} failed, and --fail-fast was asked for", case.name);
                *stop = Some(Stop { why, status: Status::Skipped });
            }
            Ok(report)
        };
        // What comes after a failure must not have begun before it.
        let side = if options.after_failure == AfterFailure::Stop { 1 } else { cases_at_a_time(options) };
        let is_known: Vec<bool> = cases.iter().map(Case::is_known).collect();
        let order = if side == 1 { (0..cases.len()).collect() } else { order_of(&is_known) };
        let done = order.iter().zip(side_by_side(side, &order, one)).sorted_by_key(|(k, _)| **k);
        let mut reports = done.map(|(_, report)| report).collect::<Result<Vec<_>, _>>()?;
        if options.diagnosis == Diagnosis::Sought {
            diagnose(&plans, &mut reports);
        }
        for (case, report) in cases.iter().zip(&mut reports) {
            let folder = folder_of(case);
            if folder != options.out && report.comparisons.iter().any(|c| c.diagnosis.is_some()) {
                report.keep_again(&folder, Care::Usual)?;
            }
        }
        let ratios = ratios(&cases, &plans, &policies, &reports, options.observer);
        let mut report = Report::joined(spec, reports);
        report.ratios = ratios;
        report.request = Some(options.request());
        report.published_findings = published_findings(&cases, &plans, &published);
        // Cases ran side by side: their seconds do not add up.
        report.wall_s = clock.elapsed().as_secs_f64();
        keep(&mut report, &options.out, Care::Lasting)?;
        Ok(report)
    }
}

/// Places of cases as they are begun, by whether they are scenes of known answer: the first that was asked for, since one waits for its verdicts;
/// scenes of known answer, where renderers that sleep between their frames take longest and compute least; all others meanwhile.
fn order_of(is_known: &[bool]) -> Vec<usize> {
    let (known, asked): (Vec<usize>, Vec<usize>) = (0..is_known.len()).partition(|k| is_known[*k]);
    let (first, others) = asked.split_at(asked.len().min(1));
    [first, &known, others].concat()
}

/// Whose engines are examined besides ours.
pub enum Subjects<'a> {
    /// Nobody's.
    Ours,
    /// Those of a spec.
    OfSpec(&'a Path),
    /// Those of a case.
    Of(Box<Case>),
}

/// Lets engines read the scenes of known answer, and judges what they read.
pub fn examine(subjects: Subjects<'_>, options: &Options<'_>) -> Result<Report, AuditError> {
    let own = || options.policy.read(options.policy.file.as_deref(), Trust::Own, &BTreeSet::new()).map(Arc::new);
    let (of, policy) = match subjects {
        Subjects::OfSpec(path) => {
            let (cases, policies) = chosen(&[path.to_owned()], options)?;
            (cases, common(&policies)?)
        }
        Subjects::Ours => (vec![Case::default()], own()?),
        Subjects::Of(case) => (vec![*case], own()?),
    };
    let known = Planner::new(&options.selection, &options.site, options.skipping).examinations(&of)?;
    let (cases, plans): (Vec<_>, Vec<_>) = known.into_iter().unzip();
    let (spec, policies) = (cases.first().map(SpecRecord::of).unwrap_or_default(), vec![policy; cases.len()]);
    Prepared { spec, cases, plans, policies }.audited(options)
}

/// The policy of the scenes of known answer: that of the specs where they have one in common, else ours alone.
fn common(policies: &[Arc<Policy>]) -> Result<Arc<Policy>, SpecError> {
    match policies {
        [first, rest @ ..] if rest.iter().all(|other| Arc::ptr_eq(first, other)) => Ok(Arc::clone(first)),
        _ => Policy::built_in().map(Arc::new),
    }
}

/// Gives the jobs of a case's plan the budget of their first look.
pub fn grant(sampling: Sampling, policy: &Policy, case: &Case, published: Option<&Published>, plan: &mut Plan) {
    sampling::grant(sampling, &policy.judge(case, published), plan);
}

fn keep(report: &mut Report, folder: &Path, care: Care) -> Result<(), FileError> {
    if let Some(aside) = report.keep_in(folder, care)? {
        let aside = aside.display();
        tracing::warn!(
            "an earlier report has readings that were not asked for this time, or is of another spec: it stays as {aside}"
        );
    }
    Ok(())
}

/// Says why what fails does, by all that an engine read in the run.
fn diagnose(plans: &[Plan], reports: &mut [Report]) {
    if process::is_interrupted() {
        return;
    }
    diagnose_together(plans, reports);
    reports.iter_mut().for_each(Report::tell_declared);
}

fn diagnose_together(plans: &[Plan], reports: &mut [Report]) {
    let settings = |plan: &Plan| {
        let of_run = |run: &Run| (plan.engines[run.engine].engine.name(), format!("{:?}", run.job.settings));
        plan.runs.iter().map(of_run).collect()
    };
    let mut cases = vec![];
    for (plan, report) in plans.iter().zip(reports) {
        let heavy = report.recordings.iter().filter(|r| r.states_heavy_tail());
        let silent = heavy.map(|r| r.key.engine.clone()).collect();
        let design_effects = report.recordings.iter().filter_map(|r| Some((r.key.clone(), r.design_effect?))).collect();
        let comparisons = &mut report.comparisons;
        cases.push(Examined {
            tasks: &plan.tasks,
            settings: settings(plan),
            silent,
            is_lenient: false,
            design_effects,
            comparisons,
        });
    }
    diagnosis::diagnose(&mut cases);
}

/// What the cases that a spec compares are to each other, engine by engine.
fn ratios(
    cases: &[Case],
    plans: &[Plan],
    policies: &[Arc<Policy>],
    reports: &[Report],
    observer: &dyn Observer,
) -> Vec<Ratios> {
    let measured = |k: usize| Measured {
        case: &cases[k].name,
        tasks: &plans[k].tasks,
        readings: reports[k].readings.iter().map(|r| (&r.key, &r.reading)).collect(),
        comparisons: &reports[k].comparisons,
        recordings: &reports[k].recordings,
    };
    let mut found = vec![];
    for (k, case) in cases.iter().enumerate() {
        for name in &case.before {
            match cases.iter().position(|other| other.name == *name) {
                Some(before) => {
                    found.extend(policies[k].judge(case, None).ratios(&measured(before), &measured(k)));
                }
                None => observer.remarked(case, &format!("it is not compared with {name}, which was not run")),
            }
        }
    }
    found
}

/// The published tables of each case, or all that is wrong with them.
pub fn published(cases: &[Case]) -> Result<Vec<Option<Published>>, Faults> {
    let fault = |path: &Path, error: PublishedError| {
        let help = "correct the table, or leave `published` out";
        // The reader of YAML ends its message with the place.
        let place = error.message.rsplit_once(" at line ").and_then(|(message, place)| {
            let (line, column) = place.split_once(" column ")?;
            Some((message.to_owned(), line.parse().ok(), column.parse().ok()))
        });
        let (message, line, column) = place.unwrap_or((error.message, None, None));
        SpecError { line, column, ..SpecError::of(path, message, help) }
    };
    let read = |case: &Case| {
        let path = case.published.as_deref();
        path.map(|path| Published::read(path).map_err(|error| fault(path, error))).transpose()
    };
    let (sound, wrong): (Vec<_>, Vec<_>) = cases.iter().map(read).partition_result();
    Faults::of(wrong).map_or(Ok(sound), Err)
}

/// What of the published files stands for nothing in all cases that are held against each.
fn published_findings(cases: &[Case], plans: &[Plan], published: &[Option<Published>]) -> Vec<String> {
    let mut files: BTreeMap<&Path, (&Published, Vec<&Task>)> = BTreeMap::new();
    for ((case, plan), published) in cases.iter().zip(plans).zip(published) {
        let Some((path, published)) = case.published.as_deref().zip(published.as_ref()) else { continue };
        files.entry(path).or_insert((published, vec![])).1.extend(&plan.tasks);
    }
    files.values().flat_map(|(published, tasks)| published.findings(tasks)).collect()
}

/// The folder of one case of several, a spec's own name not twice.
fn within(root: &Path, case: &Case) -> PathBuf {
    let spec = root.file_name().and_then(|n| n.to_str()).map(|n| format!("{n}/"));
    let own = spec.and_then(|prefix| case.name.strip_prefix(&prefix));
    PathBuf::from(own.unwrap_or(&case.name))
}

/// What is run, all cases together.
pub fn subject(specs: &[PathBuf], cases: &[Case]) -> SpecRecord {
    if let [case] = cases {
        return SpecRecord::of(case);
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
        assert_eq!(order_of(&[false, false, false, true, true]), [0, 3, 4, 1, 2]);
        assert_eq!(order_of(&[true, false]), [1, 0]);
        assert_eq!(order_of(&[true; 2]), [0, 1]);
        assert_eq!(order_of(&[false; 2]), [0, 1]);
        assert!(order_of(&[]).is_empty());
    }
}
