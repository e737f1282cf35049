//! How far a run is: one bar with the time left on a terminal, a line a job elsewhere.

use std::io::IsTerminal;
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

use super::engines::calibration_line;
use crate::audit::run;
use crate::calibration::Calibrated;
use crate::engines::Engine;
use crate::plan::{Plan, Run};
use crate::record::ProcedureId;

/// The progress of all cases of a run together, on stderr.
pub(super) struct Progress {
    bar: ProgressBar,
    is_terminal: bool,
    start: Instant,
    work: Mutex<Work>,
}

pub(super) struct CaseProgress<'a> {
    of: &'a Progress,
    case: String,
    /// What a renderer may take for one of its jobs, in seconds.
    budget_s: f64,
}

/// What there is to do and what is done. Renderers cost; our own solvers take next to nothing and are only counted.
#[derive(Clone, Copy, Debug, Default)]
struct Work {
    jobs: usize,
    jobs_done: usize,
    budget_s: f64,
    budget_done_s: f64,
}

impl Work {
    /// How long the rest takes: by the share of the budget that finished renderers used, at most the budget before that.
    fn left(&self, elapsed: Duration) -> Left {
        let rest_s = (self.budget_s - self.budget_done_s).max(0.0);
        if self.budget_done_s > 0.0 {
            Left::About(seconds(rest_s * elapsed.as_secs_f64() / self.budget_done_s))
        } else {
            Left::AtMost(seconds(rest_s))
        }
    }
}

/// An estimate of the time left.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Left {
    About(Duration),
    AtMost(Duration),
}

impl std::fmt::Display for Left {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let (word, time) = match self {
            Self::About(time) => ("about", time),
            Self::AtMost(time) => ("at most", time),
        };
        write!(f, "{word} {} left", indicatif::HumanDuration(*time))
    }
}

/// Whole seconds; budgets may be as large as a user likes.
fn seconds(s: f64) -> Duration {
    Duration::from_secs(s.min(1e9).round() as u64)
}

impl Progress {
    /// Of all plans, with the seconds that each allows a renderer's job.
    pub(super) fn of<'a>(plans: impl Iterator<Item = (&'a Plan, f64)>) -> Self {
        let mut work = Work::default();
        for (plan, budget_s) in plans {
            work.jobs += plan.runs.len();
            let costs = |r: &&Run| !plan.engines[r.engine].engine.is_witness();
            work.budget_s += budget_s * plan.runs.iter().filter(costs).count() as f64;
        }
        let is_terminal = std::io::stderr().is_terminal();
        let target = if is_terminal { ProgressDrawTarget::stderr() } else { ProgressDrawTarget::hidden() };
        let bar = ProgressBar::with_draw_target(Some(work.jobs as u64), target);
        if let Ok(style) = ProgressStyle::with_template("{spinner} [{bar:24}] {pos}/{len} {msg} [{elapsed}]") {
            bar.set_style(style.progress_chars("=> "));
        }
        bar.enable_steady_tick(Duration::from_millis(100));
        Self { bar, is_terminal, start: Instant::now(), work: Mutex::new(work) }
    }

    /// Of one of its cases, with the seconds that it allows a renderer's job.
    pub(super) fn case(&self, name: &str, budget_s: f64) -> CaseProgress<'_> {
        CaseProgress { of: self, case: name.to_owned(), budget_s }
    }

    /// Prints a line above the bar.
    pub(super) fn line(&self, text: &str) {
        self.bar.suspend(|| eprintln!("{text}"));
    }

    fn work(&self) -> Work {
        *self.work.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn done(&self, budget_s: f64) -> Work {
        let mut work = self.work.lock().unwrap_or_else(PoisonError::into_inner);
        work.jobs_done += 1;
        work.budget_done_s += budget_s;
        *work
    }
}

impl run::Progress for CaseProgress<'_> {
    fn started(&self, engine: &str, procedure: &str) {
        let left = self.of.work().left(self.of.start.elapsed());
        self.of.bar.set_message(format!("{}: {engine}: {procedure}, {left}", self.case));
    }

    fn calibrated(&self, engine: &str, found: &Calibrated) {
        self.of.line(&format!("{engine}: calibrated before its first use: {}", calibration_line(found)));
    }

    fn ended(&self, engine: &dyn Engine, procedure: ProcedureId, wall: Duration, failure: Option<&str>) {
        let name = format!("{}: {}: {procedure}", self.case, engine.name());
        tracing::info!(wall_s = wall.as_secs_f64(), "{name} is done");
        let work = self.of.done(if engine.is_witness() { 0.0 } else { self.budget_s });
        self.of.bar.inc(1);
        match failure {
            Some(failure) => self.of.line(&format!("{name} failed: {failure}")),
            None if self.of.is_terminal => (),
            None => self.of.line(&format!("[{}/{}] {name} {:.1} s", work.jobs_done, work.jobs, wall.as_secs_f64())),
        }
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        self.bar.finish_and_clear();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_time_left_is_the_budget_at_first_and_then_what_renderers_really_took_of_theirs() {
        let work = |done| Work { jobs: 9, jobs_done: 3, budget_s: 240.0, budget_done_s: done };
        assert_eq!(work(0.0).left(seconds(5.0)), Left::AtMost(seconds(240.0)));
        // A quarter of the budget gone in 15 s: three more of these.
        assert_eq!(work(60.0).left(seconds(15.0)), Left::About(seconds(45.0)));
        assert_eq!(work(240.0).left(seconds(15.0)).to_string(), "about 0 seconds left");
        assert_eq!(Work { budget_s: f64::INFINITY, ..Work::default() }.left(seconds(1.0)), Left::AtMost(seconds(1e9)));
    }
}
