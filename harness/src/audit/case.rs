//! One case of an audit: its plan is run, undecided comparisons get further looks, and what was read is judged.

use std::path::Path;
use std::time::{Instant, SystemTime};

use super::jobs::{self, Outcome, Running};
use super::{AuditError, Options, sampling, sequential};
use crate::diagnosis;
use crate::judge::{Comparison, Consensus, Judge, Policy, Published, PublishedTable, Split};
use crate::measure::Reader;
use crate::plan::{Plan, Scope, Skip};
use crate::record::{Recording, Status};
use crate::report::{self, Report};
use crate::spec::Case;
use crate::system::files;
use crate::system::process;

/// What all cases of an audit share.
pub(super) struct Audit<'a> {
    pub(super) policy: &'a Policy,
    pub(super) options: &'a Options<'a>,
    pub(super) reader: Reader,
}

/// Why the cases that are left are not run.
#[derive(Clone, Debug, thiserror::Error)]
pub(super) enum Stop {
    #[error("not run: the run was interrupted")]
    Interrupted,
    #[error("not run: {case} failed, and --fail-fast was asked for")]
    Failed { case: String },
}

impl Stop {
    /// How the engines of a case that is left have fared: an interruption must not look like success.
    const fn status(&self) -> Status {
        match self {
            Self::Interrupted => Status::Failed,
            Self::Failed { .. } => Status::Skipped,
        }
    }
}

impl Audit<'_> {
    /// Runs and judges one case, unless the audit has stopped before it; its report is kept in the folder.
    pub(super) fn case(
        &self,
        case: &Case,
        plan: &Plan,
        published: Option<&Published>,
        stop: Option<&Stop>,
        folder: &Path,
    ) -> Result<Report, AuditError> {
        let (started, clock) = (SystemTime::now(), Instant::now());
        let judge = self.policy.judge(case, published);
        let outcome = match stop {
            Some(stop) => jobs::not_run(case, plan, stop.status(), &stop.to_string()),
            None => self.readings(case, plan, &judge, folder)?,
        };
        let Judged { comparisons, splits, consensus, tables } = judged(case, plan, &outcome.recordings, &judge);
        // What follows from other readings follows from nothing where the case was never begun.
        let holds = |s: &&Skip| stop.is_none() || matches!(s.scope, Scope::Engine | Scope::Procedure);
        let skips = plan.skips.iter().filter(holds).cloned().chain(outcome.skips).collect();
        let report = Report {
            wall_s: clock.elapsed().as_secs_f64(),
            engines: outcome.engines,
            splits,
            consensus,
            published: tables,
            curves: plan.tasks.iter().flat_map(|task| report::curves(&case.name, task)).collect(),
            ..Report::new(case, started, &outcome.recordings, comparisons, skips)
        };
        files::keep_json(&folder.join("report.json"), &report)?;
        Ok(report)
    }

    fn readings(&self, case: &Case, plan: &Plan, judge: &Judge<'_>, folder: &Path) -> Result<Outcome, AuditError> {
        let reader = Reader { out: Some(folder.to_owned()), ..self.reader.clone() };
        let observer = self.options.observer;
        let running = Running { case, plan, folder, reader, observer };
        let mut outcome = running.run()?;
        if !process::is_interrupted() {
            sampling::sample_on(&running, judge, &mut outcome)?;
        }
        if outcome.from_cache > 0 {
            let count = outcome.from_cache;
            observer.remarked(case, &format!("{count} answer(s) of engines from the cache (--no-cache asks anew)"));
        }
        Ok(outcome)
    }
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
