//! How far a run is: a bar with the running jobs on a terminal, elsewhere a line per finished case and engine.

mod display;
mod remaining_time;

use std::collections::{BTreeMap, BTreeSet};
use std::fmt;
use std::io::IsTerminal;
use std::sync::Arc;
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressState, ProgressStyle};
use parking_lot::Mutex;
use terminal_size::{Height, Width, terminal_size_of};

use luxproof_audit::measure::{Machine, RunningJob};
use luxproof_audit::plan::Plan;
use luxproof_audit::{FurtherStage, Observer};
use luxproof_engines::Engine;
use luxproof_model::numbers::plural;
use luxproof_model::{EngineName, ProcedureId, ReadingKey};
use luxproof_report::words::wrapped;
use luxproof_spec::{Case, SpecError};

use display::{Snapshot, Space, name_of_job};
use remaining_time::PaidReadings;

/// The size of a terminal that does not tell its size.
const USUAL_TERMINAL: (Width, Height) = (Width(80), Height(24));
/// How often the display is drawn.
const REDRAW_INTERVAL: Duration = Duration::from_millis(200);
/// A line lists at most so many procedures by name.
const MAX_LISTED_PROCEDURES: usize = 3;

pub(super) struct Progress {
    bar: ProgressBar,
    is_terminal: bool,
    work: Arc<Mutex<Work>>,
}

/// What there is to do and what is done.
#[derive(Default)]
struct Work {
    /// The machine that runs the jobs, once they are planned.
    machine: Option<Arc<Machine>>,
    paid: PaidReadings,
    /// Readings that are done, and all that are known so far: further stages are added when they start.
    done: usize,
    all: usize,
    /// The readings of one case and engine that are still to come, and what those that are there took.
    groups: BTreeMap<(String, EngineName), ReadingGroup>,
    /// The latest further stage of each reading.
    stages: BTreeMap<ReadingKey, String>,
}

/// The readings of one engine in one case.
#[derive(Default)]
struct ReadingGroup {
    planned: usize,
    procedures: Vec<&'static str>,
    wall: Duration,
}

impl Progress {
    pub(super) fn new() -> Self {
        let (start, work) = (Instant::now(), Arc::<Mutex<Work>>::default());
        let is_terminal = std::io::stderr().is_terminal();
        let target = if is_terminal { ProgressDrawTarget::stderr() } else { ProgressDrawTarget::hidden() };
        let bar = ProgressBar::with_draw_target(None, target);
        if let Ok(style) = ProgressStyle::with_template("{display}") {
            let work = Arc::clone(&work);
            bar.set_style(style.with_key("display", move |_: &ProgressState, out: &mut dyn fmt::Write| {
                out.write_str(&work.lock().display(start)).ok();
            }));
        }
        Self { bar, is_terminal, work }
    }

    /// Prints a line above the bar, wrapped between words on a terminal.
    fn line(&self, text: &str) {
        let text = if self.is_terminal { wrapped(text, terminal_space().0, "    ") } else { text.to_owned() };
        self.bar.suspend(|| super::complain(&text));
    }
}

/// The columns that a line on standard error may fill, and the lines of the terminal.
fn terminal_space() -> (usize, usize) {
    let (Width(width), Height(height)) = terminal_size_of(std::io::stderr()).unwrap_or(USUAL_TERMINAL);
    // Some terminals wrap a line that fills their last column.
    (usize::from(width).saturating_sub(1).max(1), usize::from(height))
}

impl Work {
    /// The text of the display: the bar, and the running jobs up to the number of slots.
    fn display(&self, start: Instant) -> String {
        let Some(machine) = &self.machine else { return String::new() };
        let (width, height) = terminal_space();
        let snapshot = Snapshot {
            elapsed: start.elapsed(),
            done: self.done,
            all: self.all,
            left: self.paid.time_left(&machine.running).to_string(),
            running: machine.running.list().iter().map(|job| (job.start.elapsed(), self.job_line(job))).collect(),
        };
        let jobs = machine.slots.threads().min((height / 2).max(1));
        snapshot.lines(Space { width, jobs }).join("\n")
    }

    /// The line of a running job; that of a further stage counts its points.
    fn job_line(&self, job: &RunningJob) -> String {
        let stage = self.stages.get(&job.key).filter(|_| job.detail.starts_with("stage"));
        name_of_job(job, stage.map_or(&job.detail, |stage| stage))
    }

    /// Adds the readings of a case.
    fn add(&mut self, case: &Case, plan: &Plan, machine: &Machine) {
        self.paid.add(case, plan, &machine.slots);
        self.all += plan.runs.len();
        for run in &plan.runs {
            let engine = plan.engines[run.engine].engine.name();
            self.groups.entry((case.name.clone(), engine)).or_default().planned += 1;
        }
    }

    /// Ends a first reading. Returns the group's line if it was the last one of its case and engine.
    fn end_first(&mut self, key: &ReadingKey, wall: Duration) -> Option<String> {
        if let Some(machine) = &self.machine {
            self.paid.end_first(key, &machine.running);
        }
        self.done += 1;
        let group = self.groups.get_mut(&(key.case.clone(), key.engine.clone()))?;
        group.procedures.push(key.procedure.name());
        group.wall += wall;
        (group.procedures.len() == group.planned).then(|| {
            let (done, all) = (self.done, self.all);
            format!("[{done}/{all}] {}: {}: {}", key.case, key.engine, group.text())
        })
    }

    /// Starts a further stage of a reading; the previous one has ended.
    fn begin_stage(&mut self, key: ReadingKey, text: String) {
        self.all += 1;
        if self.stages.insert(key, text).is_some() {
            self.done += 1;
        }
    }

    /// Ends a case, and with it the last further stages of its readings.
    fn end_case(&mut self, case: &str) {
        self.paid.end_case(case);
        let before = self.stages.len();
        self.stages.retain(|key, _| key.case != case);
        self.done += before - self.stages.len();
    }
}

impl ReadingGroup {
    /// Its procedures and the time that they took.
    fn text(&self) -> String {
        let procedures = match &self.procedures[..] {
            few if few.len() <= MAX_LISTED_PROCEDURES => few.join(", "),
            many => plural(many.len(), "procedure"),
        };
        format!("{procedures} {:.1} s", self.wall.as_secs_f64())
    }
}

/// The programs that specs have us run, each once.
fn programs(cases: &[Case], plans: &[Plan]) -> BTreeSet<String> {
    let planned = cases.iter().zip(plans).flat_map(|(case, plan)| plan.engines.iter().map(move |of| (case, of)));
    planned.filter_map(|(case, planned)| program_line(case, &planned.engine.name())).collect()
}

/// A line on the program that a case's settings name as an engine.
fn program_line(case: &Case, engine: &EngineName) -> Option<String> {
    let words = case.settings_of(engine.as_str()).remove("command")?;
    let words: Vec<&str> = words.as_array()?.iter().map(|word| word.as_str().unwrap_or("?")).collect();
    Some(format!("{}: engines.{engine} runs `{}`", case.path.display(), words.join(" ")))
}

impl Observer for Progress {
    fn linted(&self, lints: &[SpecError]) {
        self.bar.suspend(|| luxproof_console::warn(lints));
    }

    fn planned(&self, cases: &[Case], plans: &[Plan], machine: &Arc<Machine>) {
        for program in programs(cases, plans) {
            self.line(&program);
        }
        let mut work = self.work.lock();
        for (case, plan) in cases.iter().zip(plans) {
            work.add(case, plan, machine);
        }
        work.machine = Some(Arc::clone(machine));
        drop(work);
        self.bar.enable_steady_tick(REDRAW_INTERVAL);
    }

    fn ended(&self, case: &Case, engine: &dyn Engine, procedure: ProcedureId, wall: Duration, failure: Option<&str>) {
        let key = ReadingKey::new(&case.name, procedure, engine.name());
        let name = format!("{}: {}: {procedure}", key.case, key.engine);
        tracing::info!(wall_s = wall.as_secs_f64(), "{name} is done");
        // The display needs the lock to draw, so it is free before a line is printed.
        let finished = self.work.lock().end_first(&key, wall);
        if let Some(failure) = failure {
            self.line(&format!("{name} failed: {failure}"));
        }
        if let Some(finished) = finished.filter(|_| !self.is_terminal) {
            self.line(&finished);
        }
    }

    fn sampled_again(&self, case: &Case, stage: &FurtherStage<'_>) {
        let FurtherStage { stage: number, last_stage, points, all_points, .. } = stage;
        let text = format!("stage {number} of {last_stage}, {points} of {all_points} points");
        let key = ReadingKey::new(&case.name, stage.procedure, stage.engine.clone());
        self.work.lock().begin_stage(key, text);
        if !self.is_terminal {
            self.line(&format!("{}: {stage}", case.name));
        }
    }

    fn case_ended(&self, case: &Case) {
        self.work.lock().end_case(&case.name);
    }

    fn remarked(&self, case: &Case, text: &str) {
        self.line(&format!("{}: {text}", case.name));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn key(engine: &str, procedure: ProcedureId) -> ReadingKey {
        ReadingKey::new("office", procedure, engine)
    }

    #[test]
    fn a_case_and_engine_have_one_line_when_their_last_reading_ended() {
        let mut work = Work { all: 3, ..Work::default() };
        work.groups.insert(("office".to_owned(), "x".into()), ReadingGroup { planned: 2, ..ReadingGroup::default() });
        let second = Duration::from_secs(1);
        assert_eq!(work.end_first(&key("x", ProcedureId::DirectIlluminance), second), None);
        let line = work.end_first(&key("x", ProcedureId::TotalIlluminance), second);
        assert_eq!(line.as_deref(), Some("[2/3] office: x: direct_illuminance, total_illuminance 2.0 s"));
        let many = ReadingGroup { planned: 4, procedures: vec!["a"; 4], wall: second };
        assert_eq!(many.text(), "4 procedures 1.0 s");
    }

    #[test]
    fn further_stages_add_to_the_work_and_are_done_with_the_next_one_or_the_case() {
        let mut work = Work { done: 2, all: 2, ..Work::default() };
        let direct = key("x", ProcedureId::DirectIlluminance);
        work.begin_stage(direct.clone(), "stage 2 of 4, 3 of 12 points".to_owned());
        assert_eq!((work.done, work.all), (2, 3));
        let job = |detail: &str| RunningJob { key: direct.clone(), detail: detail.to_owned(), start: Instant::now() };
        let line = work.job_line(&job("stage 2"));
        assert_eq!(line, "office: x direct_illuminance, stage 2 of 4, 3 of 12 points");
        assert_eq!(work.job_line(&job("repetition 1")), "office: x direct_illuminance, repetition 1");
        work.begin_stage(direct, "stage 3 of 4, 1 of 12 points".to_owned());
        assert_eq!((work.done, work.all), (3, 4));
        work.end_case("office");
        assert_eq!((work.done, work.all), (4, 4));
    }
}
