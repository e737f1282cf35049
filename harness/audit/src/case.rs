//! Runs one case of an audit: its plan, further stages for undecided comparisons, and the judgement of its readings.

use crate::Repetition;
use crate::report::report_of_case;
use std::path::Path;
use std::time::{Instant, SystemTime};

use super::jobs::{self, Outcome, Running};
use super::repetition::Examination;
use super::undecided::explain_undecided;
use super::{AuditError, Options, repetition, sampling};
use crate::measure::{Reader, RequestedReadings};
use crate::plan::Plan;
use crate::recorded::add_recorded;
use luxproof_model::Comparison;
use luxproof_model::Report;
use luxproof_model::numbers::plural;
use luxproof_model::{Recording, Status};
use luxproof_model::{Skip, Summary};
use luxproof_process::files::{self, FileError};
use luxproof_process::process;
use luxproof_spec::Case;
use luxproof_spec::procedures::Task;
use luxproof_verdict::{Judge, Policy, Published};

/// The options and the reader that all cases of an audit share.
pub(super) struct Audit<'a> {
    pub(super) options: &'a Options<'a>,
    pub(super) reader: Reader,
}

/// Why the remaining cases do not run, and the status of their engines: an interruption must not look like success.
#[derive(Clone, Debug)]
pub(super) struct Stop {
    pub(super) why: String,
    pub(super) status: Status,
}

impl Stop {
    pub(super) fn interrupted() -> Self {
        Self { why: "not run: the run was interrupted".to_owned(), status: Status::Failed }
    }
}

impl Audit<'_> {
    /// Runs and judges one case, unless the audit has stopped before it.
    pub(super) fn case(
        &self,
        case: &Case,
        plan: &Plan,
        policy: &Policy,
        published: Option<&Published>,
        stop: Option<&Stop>,
        folder: &Path,
    ) -> Result<Report, AuditError> {
        let (started, clock) = (SystemTime::now(), Instant::now());
        let judge = policy.judge(case, published);
        let mut outcome = match stop {
            Some(stop) => jobs::not_run(case, plan, stop.status, &stop.why),
            None => self.readings(case, plan, &judge, Some(folder))?,
        };
        add_recorded(case, plan, &self.options.selection, &mut outcome);
        let tasks: Vec<(&Task, Vec<&Recording>)> =
            plan.tasks.iter().map(|task| (task, recordings_of(task, &outcome))).collect();
        let mut comparisons: Vec<Comparison> =
            tasks.iter().flat_map(|(task, recordings)| judge.compare(task, recordings)).collect();
        let known = tasks.iter().flat_map(|(_, recordings)| judge.on_record(&comparisons, recordings)).collect();
        let bias = judge.bias(&comparisons, &outcome.recordings);
        explain_undecided(&mut comparisons, &bias, &outcome.recordings, case.budget);
        let valid = plan.skips.iter().filter(|skip| is_valid_skip(skip, &outcome, stop.is_some()));
        let skips = valid.chain(&outcome.skips).cloned().collect();
        let mut report = Report {
            known_deviations: known,
            bias,
            statistics: judge.statistics(&comparisons, &outcome.recordings),
            splits: tasks.iter().flat_map(|(task, recordings)| judge.split(task, recordings)).collect(),
            consensus: tasks
                .iter()
                .filter(|(task, _)| !task.procedure.is_calibration())
                .filter_map(|(task, recordings)| judge.consensus(task, recordings))
                .collect(),
            published: plan.tasks.iter().filter_map(|task| judge.published?.table(task, &case.name)).collect(),
            curves: plan.tasks.iter().flat_map(|task| crate::curves::curves(&case.name, task)).collect(),
            engines: outcome.engines.clone(),
            wall_s: clock.elapsed().as_secs_f64(),
            ..report_of_case(case, policy, started, &outcome.recordings, comparisons, skips)
        };
        report.summary = Summary::of(&report);
        Ok(report)
    }

    /// Takes the readings of a case and writes their files into the folder, where there is one.
    pub(super) fn readings(
        &self,
        case: &Case,
        plan: &Plan,
        judge: &Judge<'_>,
        folder: Option<&Path>,
    ) -> Result<Outcome, FileError> {
        // Removes the unfinished files of a run that was killed.
        for place in folder.into_iter().flat_map(|folder| [folder.to_owned(), folder.join("readings")]) {
            files::sweep(&place);
        }
        let asked = RequestedReadings::default();
        let reader = Reader { out: folder.map(Path::to_owned), asked: asked.clone(), ..self.reader.clone() };
        let observer = self.options.observer;
        let running = Running { case, plan, folder, reader, observer };
        let mut outcome = running.run()?;
        // Further stages depend on all first ones: another process may still have to take some of them.
        if !process::is_interrupted() && !asked.leaves_open() {
            let examination = match self.options.stated_errors {
                Repetition::Examined => repetition::examine(&running, judge, &mut outcome),
                Repetition::LeftOut => Examination::default(),
            };
            if !asked.leaves_open() {
                sampling::sample_on(&running, judge, &examination.found, &mut outcome)?;
            }
            if !asked.leaves_open() {
                examination.examine_stages(&running, judge, &mut outcome);
            }
        }
        observer.case_ended(case);
        self.reader.asked.join(&case.name, &asked);
        if outcome.from_cache > 0 {
            let answers = plural(outcome.from_cache, "answer");
            observer.remarked(case, &format!("{answers} of engines from the cache (--no-cache asks again)"));
        }
        Ok(outcome)
    }
}

/// The recordings of a task, of all engines.
fn recordings_of<'a>(task: &Task, outcome: &'a Outcome) -> Vec<&'a Recording> {
    outcome.recordings.iter().filter(|r| r.key.procedure == task.procedure).collect()
}

/// Whether a planned skip also holds for the outcome.
///
/// A reading that follows from others does not follow where the case never started, or where a spot check contradicts
/// it.
fn is_valid_skip(skip: &Skip, outcome: &Outcome, is_stopped: bool) -> bool {
    let is_contradicted = outcome.contradicted.contains(&(skip.key.engine.clone(), skip.key.procedure));
    skip.scope.leaves_no_reading() || !is_stopped && !is_contradicted
}
