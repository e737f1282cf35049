//! How far a run is: one bar with the time left on a terminal, a line a job elsewhere.

use std::collections::BTreeSet;
use std::io::IsTerminal;
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use parking_lot::Mutex;

use crate::audit::Observer;
use crate::engines::Engine;
use crate::plan::{Plan, Run};
use crate::record::{EngineName, ProcedureId};
use crate::spec::{Case, SpecError};

pub(super) struct Progress {
    bar: ProgressBar,
    is_terminal: bool,
    start: Instant,
    work: Mutex<Work>,
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
    fn left(&self, elapsed: Duration) -> String {
        let rest_s = (self.budget_s - self.budget_done_s).max(0.0);
        let (word, s) = if self.budget_done_s > 0.0 {
            ("about", rest_s * elapsed.as_secs_f64() / self.budget_done_s)
        } else {
            ("at most", rest_s)
        };
        format!("{word} {} left", indicatif::HumanDuration(seconds(s)))
    }
}

/// Whole seconds; budgets may be as large as a user likes.
fn seconds(s: f64) -> Duration {
    Duration::from_secs(s.min(1e9).round() as u64)
}

impl Progress {
    pub(super) fn new() -> Self {
        let is_terminal = std::io::stderr().is_terminal();
        let target = if is_terminal { ProgressDrawTarget::stderr() } else { ProgressDrawTarget::hidden() };
        let bar = ProgressBar::with_draw_target(None, target);
        if let Ok(style) = ProgressStyle::with_template("{spinner} [{bar:24}] {pos}/{len} {msg} [{elapsed}]") {
            bar.set_style(style.progress_chars("=> "));
        }
        Self { bar, is_terminal, start: Instant::now(), work: Mutex::default() }
    }

    fn line(&self, text: &str) {
        self.bar.suspend(|| super::complain(text));
    }
}

/// The programs that specs have us run, each told once.
fn programs(cases: &[Case], plans: &[Plan]) -> BTreeSet<String> {
    let of_case = |(case, plan): (&Case, &Plan)| -> Vec<String> {
        let command = |engine: EngineName| {
            let words = case.settings_of(engine.as_str()).remove("command")?;
            let words: Vec<String> =
                words.as_array()?.iter().map(|word| word.as_str().unwrap_or("?").to_owned()).collect();
            Some(format!("{}: engines.{engine} runs `{}`", case.path.display(), words.join(" ")))
        };
        plan.engines.iter().filter_map(|planned| command(planned.engine.name())).collect()
    };
    cases.iter().zip(plans).flat_map(of_case).collect()
}

impl Observer for Progress {
    fn doubted(&self, doubts: &[SpecError]) {
        self.bar.suspend(|| super::diagnostic::warn(doubts));
    }

    fn planned(&self, cases: &[Case], plans: &[Plan]) {
        for program in programs(cases, plans) {
            self.line(&program);
        }
        let mut work = self.work.lock();
        for (case, plan) in cases.iter().zip(plans) {
            let costs = |r: &&Run| !plan.engines[r.engine].engine.is_witness();
            work.jobs += plan.runs.len();
            work.budget_s += case.budget.seconds * plan.runs.iter().filter(costs).count() as f64;
        }
        self.bar.set_length(work.jobs as u64);
        self.bar.enable_steady_tick(Duration::from_millis(100));
    }

    fn started(&self, case: &Case, engine: &dyn Engine, what: &str) {
        let left = self.work.lock().left(self.start.elapsed());
        self.bar.set_message(format!("{}: {}: {what}, {left}", case.name, engine.name()));
    }

    fn ended(&self, case: &Case, engine: &dyn Engine, procedure: ProcedureId, wall: Duration, failure: Option<&str>) {
        let name = format!("{}: {}: {procedure}", case.name, engine.name());
        tracing::info!(wall_s = wall.as_secs_f64(), "{name} is done");
        let mut work = self.work.lock();
        work.jobs_done += 1;
        work.budget_done_s += if engine.is_witness() { 0.0 } else { case.budget.seconds };
        self.bar.inc(1);
        match failure {
            Some(failure) => self.line(&format!("{name} failed: {failure}")),
            None if self.is_terminal => (),
            None => self.line(&format!("[{}/{}] {name} {:.1} s", work.jobs_done, work.jobs, wall.as_secs_f64())),
        }
    }

    fn remarked(&self, case: &Case, text: &str) {
        self.line(&format!("{}: {text}", case.name));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_time_left_is_the_budget_at_first_and_then_what_renderers_really_took_of_theirs() {
        let work = |done| Work { jobs: 9, jobs_done: 3, budget_s: 240.0, budget_done_s: done };
        assert_eq!(work(0.0).left(seconds(5.0)), "at most 4 minutes left");
        // A quarter of the budget gone in 15 s: three more of these.
        assert_eq!(work(60.0).left(seconds(15.0)), "about 45 seconds left");
        assert_eq!(work(240.0).left(seconds(15.0)), "about 0 seconds left");
        let endless = Work { budget_s: f64::INFINITY, ..Work::default() };
        assert_eq!(endless.left(seconds(1.0)), format!("at most {} left", indicatif::HumanDuration(seconds(1e9))));
    }
}
