//! The plan of a case: which engine runs which procedure, which ones are skipped, and why.

mod calibration;
mod engine_selection;
mod groups;
mod shortcut;
mod spot_check;

use luxproof_model::EVERYONE;
use luxproof_model::Scope;
use luxproof_model::Skip;
use luxproof_model::SkipCause;
use std::collections::BTreeSet;
use std::sync::Arc;

use crate::measure::Instrument;
use luxproof_engines::{Absent, Engine, EngineError, EngineRoot, Job, SceneFile, Support, Version};
use luxproof_model::{EngineName, ProcedureId, ReadingKey};
use luxproof_scene::Transport;
use luxproof_spec::procedures::Task;
use luxproof_spec::{Case, MAX_FAULTS, SpecError};

use engine_selection::{Chosen, EngineSelection};
pub use groups::{Group, groups};
use shortcut::PlannedJobs;
pub use shortcut::{Fill, Omission, Shortcut};

/// The runs and skips of one case.
///
/// Runs plus skips of whole procedures or engines always equal procedures times engines.
pub struct Plan {
    /// The procedures' tasks, in order.
    pub tasks: Vec<Task>,
    /// The selected engines, in order.
    pub engines: Vec<Planned>,
    pub runs: Vec<Run>,
    /// What does not run, and why.
    pub skips: Vec<Skip>,
}

/// A selected engine.
pub struct Planned {
    /// The engine, which all cases share.
    pub engine: Arc<dyn Engine>,
    /// Its version, or why it is absent; `None` where it has no run here, so that nothing looked for it.
    pub found: Option<Result<Version, Absent>>,
    /// Why it was selected.
    pub asked: SelectionReason,
}

impl Planned {
    /// The engine's version, where it is installed.
    pub fn version(&self) -> Option<String> {
        Some(self.instrument()?.version.text)
    }

    /// The engine in its installed version.
    pub fn instrument(&self) -> Option<Instrument> {
        let version = self.found.as_ref()?.as_ref().ok()?.clone();
        Some(Instrument { engine: Arc::clone(&self.engine), version })
    }

    /// Whether it has runs but is not installed.
    pub fn is_absent(&self) -> bool {
        matches!(self.found, Some(Err(_)))
    }
}

/// Why an engine was selected.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SelectionReason {
    /// The command line or the spec names it: its absence is an error.
    ByName,
    /// Nothing names an engine: all installed ones run.
    ByDefault,
    /// It is the reference that judges the others.
    AsReference,
}

/// One procedure of a case on one engine.
pub struct Run {
    /// Index into [`Plan::engines`].
    pub engine: usize,
    /// Index into [`Plan::tasks`].
    pub task: usize,
    pub job: Job,
    /// How the engine approximates the job, where it does.
    pub approximation: Option<String>,
    /// The relative error of the approximation, where it is known.
    pub declared: f64,
    /// The least that has to be rendered.
    pub shortcut: Shortcut,
    /// Sensors that are rendered in addition, to check the shortcut.
    pub spot_check: Vec<usize>,
}

/// The choices on the command line.
#[derive(Clone, Debug, Default)]
pub struct Selection {
    /// Engines by name; empty for those of the spec.
    pub engines: Vec<String>,
    /// Empty for all of the spec.
    pub procedures: Vec<ProcedureId>,
    /// Seed of every random choice.
    pub seed: u64,
}

impl Plan {
    /// The job of an engine for a task, whether the engine is installed or not.
    pub fn job(&self, case: &Case, engine: usize, task: &Task, seed: u64) -> Job {
        job(case, &self.engines[engine].engine.name(), task, seed)
    }
}

/// A task as an engine's native files, with the command that runs them by hand where there is one.
pub struct Export {
    pub files: Vec<SceneFile>,
    pub command: Option<String>,
}

/// Why a task cannot be exported.
#[derive(Debug, thiserror::Error)]
pub enum NotExported {
    #[error("{0}")]
    Unsupported(String),
    #[error(transparent)]
    Engine(#[from] EngineError),
}

impl Plan {
    /// Exports a task. The engine need not be installed.
    pub fn export(
        &self,
        case: &Case,
        engine: usize,
        task: &Task,
        seed: u64,
        site: &EngineRoot,
    ) -> Result<Export, NotExported> {
        let (job, engine) = (self.job(case, engine, task, seed), &self.engines[engine].engine);
        if let Support::No(reason) = engine.supports(&job) {
            return Err(NotExported::Unsupported(reason));
        }
        Ok(Export { files: engine.export(&job)?, command: engine.command_by_hand(&job, site) })
    }
}

/// Plans a single case, with all shortcuts.
pub fn plan(case: &Case, selection: &Selection, site: &EngineRoot) -> Result<Plan, SpecError> {
    Planner::new(selection, site, Skipping::Allowed).plan(case)
}

/// The faults in the engine settings of cases and in the engine names of the command line; starts no engine.
pub fn faults(cases: &[Case], selection: &Selection) -> Vec<SpecError> {
    let mut roster = EngineSelection::new();
    cases.iter().flat_map(|case| roster.faults(case, selection).into_iter().take(MAX_FAULTS)).collect()
}

/// Whether the plan leaves out readings that follow from others.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Skipping {
    Allowed,
    /// Everything is rendered.
    Nothing,
}

/// Plans the cases of a run in turn, and remembers the installed engines and the jobs so far.
pub struct Planner<'a> {
    selection: &'a Selection,
    site: &'a EngineRoot,
    skipping: Skipping,
    roster: EngineSelection,
    planned_jobs: PlannedJobs,
    /// The warnings so far, each of which appears once in a run.
    warnings: BTreeSet<String>,
}

impl<'a> Planner<'a> {
    pub fn new(selection: &'a Selection, site: &'a EngineRoot, skipping: Skipping) -> Self {
        let (roster, planned_jobs, warnings) = (EngineSelection::new(), PlannedJobs::default(), BTreeSet::new());
        Self { selection, site, skipping, roster, planned_jobs, warnings }
    }

    /// Plans a case.
    pub fn plan(&mut self, case: &Case) -> Result<Plan, SpecError> {
        let tasks = tasks(case, self.selection)?;
        self.roster.check_settings(case)?;
        let chosen = self.roster.chosen(case, self.selection)?;
        for warning in self.roster.unknown_shares(case, &tasks) {
            if !self.warnings.contains(&warning) {
                tracing::warn!("{warning}");
                self.warnings.insert(warning);
            }
        }
        let mut plan = self.plan_all(case, tasks, chosen);
        if self.skipping == Skipping::Allowed {
            self.shorten(case, &mut plan);
        }
        Ok(plan)
    }

    /// Plans every task that an engine supports, without shortcuts.
    fn plan_all(&mut self, case: &Case, tasks: Vec<Task>, chosen: Vec<Chosen>) -> Plan {
        let offers: Vec<Vec<Offer>> =
            chosen.iter().map(|(engine, _)| self.offers(case, engine.as_ref(), &tasks)).collect();
        // An engine without runs is not even asked for its version.
        let busy: Vec<Option<Arc<dyn Engine>>> = chosen
            .iter()
            .zip(&offers)
            .map(|((engine, _), offers)| offers.iter().any(|o| matches!(o, Offer::Run(_))).then(|| Arc::clone(engine)))
            .collect();
        let found = self.roster.probe(&busy, self.site);
        let mut plan = Plan { tasks, engines: vec![], runs: vec![], skips: vec![] };
        for (e, ((engine, asked), (found, offers))) in chosen.into_iter().zip(found.into_iter().zip(offers)).enumerate()
        {
            let absence = found.as_ref().and_then(|f| f.as_ref().err()).map(ToString::to_string);
            for (task, offer) in plan.tasks.iter().zip(offers) {
                if let Some(absent) = &absence {
                    let skip = skip_of(case, task, engine.name(), Scope::Engine, absent.clone());
                    plan.skips.push(skip.because(SkipCause::Absent));
                    continue;
                }
                let (cause, reason) = match offer {
                    Offer::Skip(cause, reason) => (cause, reason),
                    // After the version probe an engine may support less.
                    Offer::Run(run) => match engine.supports(&run.job) {
                        Support::No(reason) => (SkipCause::Unsupported, reason),
                        Support::Yes | Support::Approximate { .. } => {
                            plan.runs.push(Run { engine: e, ..*run });
                            continue;
                        }
                    },
                };
                let scope = if cause == SkipCause::Unsupported { Scope::Procedure } else { Scope::Engine };
                let skip = skip_of(case, task, engine.name(), scope, reason).because(cause);
                plan.skips.push(skip.saving("the whole run"));
            }
            plan.engines.push(Planned { engine, found, asked });
        }
        plan
    }

    /// Whether an engine can run each task, from the job alone.
    fn offers(&self, case: &Case, engine: &dyn Engine, tasks: &[Task]) -> Vec<Offer> {
        if is_excluded(case, engine) {
            let reason = "the case is not for this engine";
            return tasks.iter().map(|_| Offer::Skip(SkipCause::Other, reason.into())).collect();
        }
        tasks.iter().enumerate().map(|(t, task)| self.offer(case, engine, t, task)).collect()
    }

    /// Whether an engine can run a task, which is the plan's `t`-th.
    fn offer(&self, case: &Case, engine: &dyn Engine, t: usize, task: &Task) -> Offer {
        let job = job(case, &engine.name(), task, self.selection.seed);
        let (approximation, declared) = match engine.supports(&job) {
            Support::Yes => (None, 0.0),
            Support::Approximate { why, size } => {
                let text = size.map(|s| format!(" (about {:.1} %)", 100.0 * s)).unwrap_or_default();
                (Some(format!("{why}{text}")), size.unwrap_or(0.0))
            }
            Support::No(reason) => return Offer::Skip(SkipCause::Unsupported, reason),
        };
        let shortcut = Shortcut::none(&job);
        Offer::Run(Box::new(Run { engine: 0, task: t, job, approximation, declared, shortcut, spot_check: vec![] }))
    }

    /// Finds the shortcuts of built-in engines, lists them as skips and draws the spot checks.
    fn shorten(&mut self, case: &Case, plan: &mut Plan) {
        for run in &mut plan.runs {
            let planned = &plan.engines[run.engine];
            // A shortcut computes light from the tables of our own reader. Readings of a user's program must not rest
            // on that, nor those of an engine that reads the photometric files itself.
            if !planned.engine.has_trusted_error() || planned.engine.reads_files(&run.job) {
                continue;
            }
            if planned.asked != SelectionReason::AsReference && !planned.engine.is_reference_engine() {
                run.shortcut = Shortcut::of(&run.job);
            }
            self.planned_jobs.shorten(&mut run.shortcut, planned.engine.as_ref());
            let all_s = cost_s(planned.engine.as_ref(), &run.job);
            for omission in &run.shortcut.omissions {
                let (task, engine) = (&plan.tasks[run.task], planned.engine.name());
                let (percent, seconds) = (100.0 * omission.share, omission.share * all_s);
                let saved = format!("{percent:.0} % of the run, at most about {seconds:.0} s");
                plan.skips.push(skip_of(case, task, engine, omission.scope, &omission.reason).saving(saved));
            }
        }
        plan.skips.extend(direct_light_skips(case, &plan.tasks));
        let engines = &plan.engines;
        spot_check::draw(&mut plan.runs, |run| engines[run.engine].engine.is_reference_engine(), self.selection.seed);
    }
}

/// Whether a case is for other engines only; references are never excluded.
fn is_excluded(case: &Case, engine: &dyn Engine) -> bool {
    let Some(only) = &case.only_engines else { return false };
    let name = engine.name();
    !engine.is_reference_engine() && !only.iter().any(|other| *other == *name || *other == *name.family())
}

/// The light paths that tasks of direct light skip on every engine.
fn direct_light_skips(case: &Case, tasks: &[Task]) -> Vec<Skip> {
    let mut skips = vec![];
    for task in tasks.iter().filter(|t| t.transport == Transport::Direct && t.scene.room.is_some()) {
        let reason = "direct light only: no reflection is followed";
        skips.push(skip_of(case, task, EVERYONE, Scope::LightPath, reason));
        if task.scene.obstacles.is_empty() {
            let reason = "the room is empty and convex, nothing hides a luminaire: no visibility is tested";
            skips.push(skip_of(case, task, EngineName::SIMULATOR, Scope::LightPath, reason));
        }
    }
    skips
}

/// Whether an engine can run a task.
enum Offer {
    Run(Box<Run>),
    Skip(SkipCause, String),
}

/// The largest cost of a whole job in seconds: its budget, or little for built-in solvers that do not sample.
fn cost_s(engine: &dyn Engine, job: &Job) -> f64 {
    let is_quick = engine.is_reference_engine() && !engine.samples(job);
    if is_quick { job.budget.seconds.min(1.0) } else { job.budget.seconds }
}

impl Selection {
    /// Whether a case has any of the chosen procedures.
    pub fn concerns(&self, case: &Case) -> bool {
        case.tasks().any(|task| self.wants(task.procedure))
    }

    /// Whether a procedure is chosen.
    fn wants(&self, procedure: ProcedureId) -> bool {
        self.procedures.is_empty() || self.procedures.contains(&procedure)
    }
}

/// The chosen tasks of a case; it is an error where there is none.
fn tasks(case: &Case, selection: &Selection) -> Result<Vec<Task>, SpecError> {
    let tasks: Vec<Task> = case.tasks().filter(|task| selection.wants(task.procedure)).collect();
    if tasks.is_empty() {
        let message = "none of the procedures chosen with --procedures is in this spec";
        return Err(case.source.error_at("procedures", message, "choose one that is, or leave the option out"));
    }
    Ok(tasks)
}

/// The job of an engine for a task, with its settings in the case.
fn job(case: &Case, engine: &EngineName, task: &Task, seed: u64) -> Job {
    Job { seed, settings: case.settings_of(engine.as_str()), ..Job::of_task(case, task) }
}

/// A skip of an engine on a task of a case, without a statement of what it saves.
pub fn skip_of(case: &Case, task: &Task, engine: EngineName, scope: Scope, reason: impl Into<String>) -> Skip {
    Skip::new(ReadingKey::new(&case.name, task.procedure, engine), scope, reason)
}
