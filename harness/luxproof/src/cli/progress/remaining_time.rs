//! How long a run still takes: at least the first readings that are missing, at most all that budgets allow.

use std::collections::BTreeSet;
use std::fmt;

use luxproof_audit::measure::RunningJobs;
use luxproof_audit::plan::{Plan, Run};
use luxproof_engines::{CpuUse, share};
use luxproof_model::ReadingKey;
use luxproof_process::slots::Slots;
use luxproof_spec::Case;

/// A user's program repeats its first reading three times, at a quarter of the effort.
const EFFORT_OF_REPETITIONS: f64 = 0.75;

/// A reading of the plan that takes time.
#[derive(Clone, Debug)]
struct PaidReading {
    key: ReadingKey,
    /// The seconds that its budget allows for the first stage.
    first_s: f64,
    /// The seconds that its budget allows for all stages together.
    all_s: f64,
    /// The share of the machine that it takes.
    share: f64,
    /// The seconds that the first stage took, once it has ended.
    first_spent_s: Option<f64>,
}

/// The readings of a run that take time, and what is known of them.
#[derive(Debug, Default)]
pub(super) struct PaidReadings {
    readings: Vec<PaidReading>,
    ended_cases: BTreeSet<String>,
}

/// The least and the largest time that is left, in seconds; without a least one, nothing has been measured yet.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct TimeLeft {
    least_s: Option<f64>,
    most_s: f64,
}

impl PaidReadings {
    /// Adds the readings of a case. Built-in solvers that do not sample take next to nothing.
    pub(super) fn add(&mut self, case: &Case, plan: &Plan, slots: &Slots) {
        let paid = plan.runs.iter().filter(|run| {
            let engine = &plan.engines[run.engine].engine;
            !engine.is_reference_engine() || engine.samples(&run.job)
        });
        self.readings.extend(paid.map(|run| paid_reading(case, plan, run, slots)));
    }

    /// Marks a reading after its first stage.
    pub(super) fn end_first(&mut self, key: &ReadingKey, jobs: &RunningJobs) {
        for reading in self.readings.iter_mut().filter(|reading| reading.key == *key) {
            reading.first_spent_s = Some(jobs.spent_s(key));
        }
    }

    /// Marks a case with all its readings.
    pub(super) fn end_case(&mut self, case: &str) {
        self.ended_cases.insert(case.to_owned());
    }

    /// The time that is left, by the jobs that ran and that run now.
    pub(super) fn time_left(&self, jobs: &RunningJobs) -> TimeLeft {
        let running = jobs.list();
        self.time_left_after(|key| {
            let now = running.iter().filter(|job| job.key == *key).map(|job| job.start.elapsed().as_secs_f64());
            jobs.spent_s(key) + now.sum::<f64>()
        })
    }

    /// The same, where `spent_s` gives the seconds that the jobs of a reading took so far.
    fn time_left_after(&self, spent_s: impl Fn(&ReadingKey) -> f64) -> TimeLeft {
        let used = self.used_share();
        let (mut first, mut all) = (MachineTime::default(), MachineTime::default());
        for case in self.readings.chunk_by(|a, b| a.key.case == b.key.case) {
            if self.ended_cases.contains(&case[0].key.case) {
                continue;
            }
            let (mut longest_first_s, mut further_s) = (0.0_f64, 0.0);
            for reading in case {
                let spent_s = spent_s(&reading.key);
                let first_rest_s = match reading.first_spent_s {
                    Some(_) => 0.0,
                    None => (reading.first_s - spent_s).max(0.0),
                };
                let all_rest_s = (reading.all_s - spent_s).max(first_rest_s);
                first.busy_s += reading.share * first_rest_s;
                all.busy_s += reading.share * all_rest_s;
                longest_first_s = longest_first_s.max(first_rest_s);
                further_s += all_rest_s - first_rest_s;
            }
            first.longest_s = first.longest_s.max(longest_first_s);
            // Further stages of a case follow each other.
            all.longest_s = all.longest_s.max(longest_first_s + further_s);
        }
        TimeLeft {
            least_s: used.map(|used| used * first.total_s()),
            // Where readings took longer than their budget, those to come will, too.
            most_s: used.unwrap_or(1.0).max(1.0) * all.total_s(),
        }
    }

    /// The share of their first budget that ended readings used; those out of the cache used none and do not count.
    fn used_share(&self) -> Option<f64> {
        let (mut spent_s, mut granted_s) = (0.0, 0.0);
        for reading in &self.readings {
            if let Some(first_spent_s) = reading.first_spent_s.filter(|s| *s > 0.0) {
                spent_s += first_spent_s;
                granted_s += reading.first_s;
            }
        }
        (granted_s > 0.0).then(|| spent_s / granted_s)
    }
}

/// The time that jobs need of a machine.
#[derive(Clone, Copy, Debug, Default)]
struct MachineTime {
    /// With all slots busy.
    busy_s: f64,
    /// Of the longest chain of jobs that follow each other.
    longest_s: f64,
}

impl MachineTime {
    fn total_s(self) -> f64 {
        self.busy_s.max(self.longest_s)
    }
}

/// What a run of a plan may take.
fn paid_reading(case: &Case, plan: &Plan, run: &Run, slots: &Slots) -> PaidReading {
    let engine = plan.engines[run.engine].engine.as_ref();
    let first_s = run.job.budget.seconds;
    let whole_s = if engine.is_reference_engine() { first_s } else { case.budget.seconds.max(first_s) };
    let repeated_s = if engine.has_trusted_error() { 0.0 } else { EFFORT_OF_REPETITIONS * first_s };
    let threads = if engine.cpu_use(&run.job) == CpuUse::Idle { 0 } else { share(engine, &run.job, slots).threads };
    PaidReading {
        key: ReadingKey::new(&case.name, plan.tasks[run.task].procedure, engine.name()),
        first_s,
        all_s: whole_s + repeated_s,
        share: threads as f64 / slots.threads() as f64,
        first_spent_s: None,
    }
}

impl fmt::Display for TimeLeft {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let most = rounded_duration(self.most_s);
        match self.least_s.map(rounded_duration) {
            Some(least) if least == most => write!(f, "about {most} left"),
            Some(least) if self.least_s.is_some_and(|s| s >= 1.0) => write!(f, "{least} to {most} left"),
            _ => write!(f, "up to {most} left"),
        }
    }
}

/// A duration in one unit, or in hours and minutes.
pub(super) fn rounded_duration(s: f64) -> String {
    // Budgets may be as large as a user likes.
    let s = s.clamp(0.0, 1e9).round() as u64;
    match s {
        0..90 => format!("{s} s"),
        90..5400 => format!("{} min", (s + 30) / 60),
        _ => format!("{} h {} min", (s + 30) / 3600, (s + 30) % 3600 / 60),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use luxproof_model::ProcedureId;

    fn reading(case: &str, engine: &str, first_spent_s: Option<f64>) -> PaidReading {
        let key = ReadingKey::new(case, ProcedureId::DirectIlluminance, engine);
        PaidReading { key, first_s: 30.0, all_s: 60.0, share: 0.5, first_spent_s }
    }

    fn left(readings: Vec<PaidReading>, spent: &[(&str, f64)]) -> String {
        let paid = PaidReadings { readings, ended_cases: BTreeSet::from(["done".to_owned()]) };
        let spent_s = |key: &ReadingKey| spent.iter().find(|(name, _)| key.engine == **name).map_or(0.0, |(_, s)| *s);
        paid.time_left_after(spent_s).to_string()
    }

    #[test]
    fn before_anything_is_measured_budgets_limit_the_time() {
        // Each needs half of the machine; further stages of a case follow each other.
        assert_eq!(left(vec![reading("a", "x", None)], &[]), "up to 60 s left");
        assert_eq!(left(vec![reading("a", "x", None), reading("b", "y", None)], &[]), "up to 60 s left");
        assert_eq!(left(vec![reading("a", "x", None), reading("a", "y", None)], &[]), "up to 2 min left");
    }

    #[test]
    fn ended_readings_tell_the_least_and_further_stages_the_most() {
        // A third of the budget was used: the other needs 10 s for its first reading, and both may need all.
        let readings = vec![reading("a", "x", Some(10.0)), reading("a", "y", None)];
        assert_eq!(left(readings.clone(), &[("x", 10.0)]), "10 s to 2 min left");
        // It has run for 15 s already.
        assert_eq!(left(readings, &[("x", 10.0), ("y", 15.0)]), "5 s to 2 min left");
        // First readings are all there: only further stages can follow.
        let readings = vec![reading("a", "x", Some(10.0)), reading("a", "y", Some(10.0))];
        assert_eq!(left(readings.clone(), &[("x", 10.0), ("y", 10.0)]), "up to 2 min left");
        assert_eq!(left(readings, &[("x", 60.0), ("y", 45.0)]), "up to 15 s left");
    }

    #[test]
    fn readings_that_took_longer_than_their_budget_lengthen_those_to_come() {
        let readings = vec![reading("done", "x", Some(60.0)), reading("a", "y", None)];
        assert_eq!(left(readings, &[("x", 60.0)]), "60 s to 2 min left");
    }

    #[test]
    fn cases_that_ended_and_answers_of_the_cache_leave_nothing() {
        assert_eq!(left(vec![reading("done", "x", Some(10.0))], &[("x", 10.0)]), "about 0 s left");
        // An answer of the cache took no time and says nothing about the others.
        assert_eq!(left(vec![reading("done", "x", Some(0.0)), reading("a", "y", None)], &[]), "up to 60 s left");
    }

    #[test]
    fn durations_have_one_unit_until_they_are_hours() {
        let texts = [0.4, 89.4, 90.0, 150.0, 5400.0, 9000.0, f64::INFINITY].map(rounded_duration);
        assert_eq!(texts[..6], ["0 s", "89 s", "2 min", "3 min", "1 h 30 min", "2 h 30 min"]);
        assert!(texts[6].ends_with(" min"));
    }
}
