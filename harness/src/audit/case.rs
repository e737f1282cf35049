//! One case of an audit: its plan is run, undecided comparisons get further looks, and what was read is judged.

use std::path::Path;
use std::time::{Instant, SystemTime};

use super::jobs::{self, Outcome, Running};
use super::repetition::Examination;
use super::{AuditError, Options, StatedErrors, repetition, sampling, sequential};
use crate::judge::{Comparison, Judge, Policy, Published};
use crate::measure::{Asked, Reader};
use crate::plan::{Plan, Skip};
use crate::procedures::Task;
use crate::record::{Recording, Status};
use crate::report::{self, Report};
use crate::spec::Case;
use crate::system::files::{self, FileError};
use crate::system::process;

/// What all cases of an audit share.
pub(super) struct Audit<'a> {
    pub(super) options: &'a Options<'a>,
    pub(super) reader: Reader,
}

/// Why the cases that are left are not run, and how their engines have fared: an interruption must not look like success.
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
        let outcome = match stop {
            Some(stop) => jobs::not_run(case, plan, stop.status, &stop.why),
            None => self.readings(case, plan, &judge, Some(folder))?,
        };
        let of = |task: &Task| -> Vec<&Recording> {
            outcome.recordings.iter().filter(|r| r.key.procedure == task.procedure).collect()
        };
        let tasks = || plan.tasks.iter();
        let mut comparisons: Vec<Comparison> = tasks().flat_map(|task| judge.compare(task, &of(task))).collect();
        let known = tasks().flat_map(|task| judge.on_record(&comparisons, &of(task))).collect();
        sequential::estimate_remaining_cost(&mut comparisons);
        // What follows from other readings follows from nothing where the case was never begun, or where it does not.
        let is_contradicted = |s: &Skip| outcome.contradicted.contains(&(s.key.engine.clone(), s.key.procedure));
        let holds = |s: &&Skip| s.scope.leaves_no_reading() || stop.is_none() && !is_contradicted(s);
        let skips = plan.skips.iter().filter(holds).cloned().chain(outcome.skips).collect();
        Ok(Report {
            engines: outcome.engines,
            known_deviations: known,
            bias: judge.bias(&comparisons, &outcome.recordings),
            statistics: judge.statistics(&comparisons, &outcome.recordings),
            splits: tasks().flat_map(|task| judge.split(task, &of(task))).collect(),
            consensus: tasks()
                .filter(|task| !task.procedure.is_known())
                .filter_map(|task| judge.consensus(task, &of(task)))
                .collect(),
            published: tasks().filter_map(|task| judge.published?.table(task, &case.name)).collect(),
            curves: tasks().flat_map(|task| report::curves(&case.name, task)).collect(),
            wall_s: clock.elapsed().as_secs_f64(),
            ..Report::new(case, policy, started, &outcome.recordings, comparisons, skips)
        })
    }

    /// Takes the readings of a case; their files stay in the folder, where there is one.
    pub(super) fn readings(
        &self,
        case: &Case,
        plan: &Plan,
        judge: &Judge<'_>,
        folder: Option<&Path>,
    ) -> Result<Outcome, FileError> {
        // What a run that was killed left.
        for place in folder.into_iter().flat_map(|folder| [folder.to_owned(), folder.join("readings")]) {
            files::sweep(&place);
        }
        let asked = Asked::default();
        let reader = Reader { out: folder.map(Path::to_owned), asked: asked.clone(), ..self.reader.clone() };
        let observer = self.options.observer;
        let running = Running { case, plan, folder, reader, observer };
        let mut outcome = running.run()?;
        // What further looks are worth is known when every first one is there.
        if !process::is_interrupted() && !asked.leaves_open() {
            let examination = match self.options.stated_errors {
                StatedErrors::LookedInto => repetition::examine(&running, judge, &mut outcome),
                StatedErrors::Believed => Examination::default(),
            };
            if !asked.leaves_open() {
                sampling::sample_on(&running, judge, &examination.found, &mut outcome)?;
            }
            if !asked.leaves_open() {
                examination.examine_looks(&running, judge, &mut outcome);
            }
        }
        self.reader.asked.join(&case.name, &asked);
        if outcome.from_cache > 0 {
            let count = outcome.from_cache;
            observer.remarked(case, &format!("{count} answer(s) of engines from the cache (--no-cache asks anew)"));
        }
        Ok(outcome)
    }
}
