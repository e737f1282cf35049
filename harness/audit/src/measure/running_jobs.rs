//! The jobs that engines work on now, for progress displays.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Instant;

use parking_lot::Mutex;

use super::question::Question;
use luxproof_model::ReadingKey;

/// The jobs that run now, and the time that finished ones took.
#[derive(Debug, Default)]
pub struct RunningJobs {
    state: Mutex<State>,
}

#[derive(Debug, Default)]
struct State {
    next_id: u64,
    running: BTreeMap<u64, RunningJob>,
    spent_s: BTreeMap<ReadingKey, f64>,
}

/// A job that has its slots and runs.
#[derive(Clone, Debug)]
pub struct RunningJob {
    /// The case, the procedure and the engine.
    pub key: ReadingKey,
    /// What it adds to the first reading, such as `stage 2`; empty for the first reading itself.
    pub detail: String,
    pub start: Instant,
}

/// Keeps a job among those that run until it is dropped.
#[derive(Debug)]
pub(super) struct RunningGuard {
    jobs: Arc<RunningJobs>,
    id: u64,
}

impl RunningJobs {
    /// The jobs that run now, the oldest first.
    pub fn list(&self) -> Vec<RunningJob> {
        self.state.lock().running.values().cloned().collect()
    }

    /// The seconds that finished jobs of a reading took, further stages included. Answers of the cache take none.
    pub fn spent_s(&self, key: &ReadingKey) -> f64 {
        self.state.lock().spent_s.get(key).copied().unwrap_or(0.0)
    }

    /// Adds the job of a question.
    pub(super) fn begin(self: &Arc<Self>, question: &Question<'_>) -> RunningGuard {
        let job = question.job;
        let key = ReadingKey::new(&job.case, job.procedure, question.instrument.engine.name());
        self.add(RunningJob {
            detail: detail_of_folder(question.folder, job.procedure.name()),
            key,
            start: Instant::now(),
        })
    }

    fn add(self: &Arc<Self>, job: RunningJob) -> RunningGuard {
        let mut state = self.state.lock();
        let id = state.next_id;
        state.next_id += 1;
        state.running.insert(id, job);
        RunningGuard { jobs: Arc::clone(self), id }
    }
}

impl Drop for RunningGuard {
    fn drop(&mut self) {
        let mut state = self.jobs.state.lock();
        if let Some(job) = state.running.remove(&self.id) {
            *state.spent_s.entry(job.key).or_default() += job.start.elapsed().as_secs_f64();
        }
    }
}

/// What a job adds to the first reading, by the name of its folder: `stage 2` of `direct_illuminance/stage-2`.
fn detail_of_folder(folder: &str, procedure: &str) -> String {
    let rest = folder.strip_prefix(procedure).unwrap_or("");
    rest.trim_start_matches(['/', '-']).replace(['/', '-'], " ")
}

#[cfg(test)]
mod tests {
    use super::*;
    use luxproof_model::ProcedureId;

    #[test]
    fn a_job_is_listed_while_it_runs_and_its_time_counts_afterwards() {
        let jobs = Arc::new(RunningJobs::default());
        let key = ReadingKey::new("office", ProcedureId::DirectIlluminance, "mitsuba");
        let job = |detail: &str| RunningJob { key: key.clone(), detail: detail.to_owned(), start: Instant::now() };
        let first = jobs.add(job(""));
        let second = jobs.add(job("stage 2"));
        let details: Vec<String> = jobs.list().into_iter().map(|job| job.detail).collect();
        assert_eq!(details, ["", "stage 2"]);
        drop(first);
        assert_eq!(jobs.list().len(), 1);
        let spent_s = jobs.spent_s(&key);
        assert!(spent_s > 0.0);
        drop(second);
        assert!(jobs.list().is_empty() && jobs.spent_s(&key) > spent_s);
    }

    #[test]
    fn the_folder_of_a_job_says_what_it_adds() {
        let name = "direct_illuminance";
        let details = ["", "/stage-2", "-spot-check", "/repetition-3"].map(|end| format!("{name}{end}"));
        assert_eq!(
            details.map(|folder| detail_of_folder(&folder, name)),
            ["", "stage 2", "spot check", "repetition 3"]
        );
        assert_eq!(detail_of_folder("together", name), "");
    }
}
