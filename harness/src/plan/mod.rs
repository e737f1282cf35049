//! The plan: which engine runs which procedure of a case, what is skipped, and why.

mod calibration;
mod groups;
mod roster;
mod shortcut;
mod spot_check;

use std::collections::BTreeSet;
use std::sync::Arc;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::engines::{Absent, Engine, EngineError, Job, SceneFile, Site, Support, Version};
use crate::measure::Instrument;
use crate::procedures::Task;
use crate::record::{EngineName, ProcedureId, ReadingKey};
use crate::spec::{Case, MAX_FAULTS, SpecError};
use luminaire::scene::Transport;

pub use groups::{Group, groups};
use roster::{Chosen, Roster};
use shortcut::Repeated;
pub use shortcut::{Fill, Omission, Shortcut};

/// What is to be done for one case. Runs + skips of whole procedures or engines = procedures x engines, always.
pub struct Plan {
    /// The procedures' tasks, in order.
    pub tasks: Vec<Task>,
    /// The engines that take part, in order.
    pub engines: Vec<Planned>,
    pub runs: Vec<Run>,
    /// What will not, and why.
    pub skips: Vec<Skip>,
}

pub struct Planned {
    /// The engine; one that knows itself by now is shared by all cases.
    pub engine: Arc<dyn Engine>,
    /// Whether it is there; `None`: it has nothing to do here and was not asked.
    pub found: Option<Result<Version, Absent>>,
    /// Why it takes part.
    pub asked: Asked,
}

impl Planned {
    /// The engine's version, where it is there.
    pub fn version(&self) -> Option<String> {
        Some(self.instrument()?.version.text)
    }

    /// What readings are taken with, where it is there.
    pub fn instrument(&self) -> Option<Instrument> {
        let version = self.found.as_ref()?.as_ref().ok()?.clone();
        Some(Instrument { engine: Arc::clone(&self.engine), version })
    }

    /// Whether it was looked for in vain.
    pub fn is_absent(&self) -> bool {
        matches!(self.found, Some(Err(_)))
    }
}

/// Why an engine takes part.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Asked {
    /// It was named, on the command line or in the spec: its absence is an error.
    ByName,
    /// No engine was named: all that are there take part.
    ByDefault,
    /// Others are judged by it.
    AsReference,
}

pub struct Run {
    /// Index into [`Plan::engines`].
    pub engine: usize,
    /// Index into [`Plan::tasks`].
    pub task: usize,
    pub job: Job,
    /// Where the engine only approximates what is asked.
    pub approximation: Option<String>,
    /// How much that is, relative, where it is known.
    pub declared: f64,
    /// The least that has to be rendered for it.
    pub shortcut: Shortcut,
    /// Stations that are rendered all the same, to be held against what the shortcut says.
    pub spot_check: Vec<usize>,
}

/// Something that is not run, with its reason.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct Skip {
    #[serde(flatten)]
    pub key: ReadingKey,
    /// How much is skipped.
    pub scope: Scope,
    pub reason: String,
    /// What that saves, where it saves something.
    pub saved: Option<String>,
}

impl Skip {
    /// Of an engine on a task of a case, where that saves nothing.
    pub fn of(case: &Case, task: &Task, engine: EngineName, scope: Scope, reason: impl Into<String>) -> Self {
        Self { key: ReadingKey::new(&case.name, task.procedure, engine), scope, reason: reason.into(), saved: None }
    }

    /// The same where it saves something.
    #[must_use]
    pub fn saving(self, saved: impl Into<String>) -> Self {
        Self { saved: Some(saved.into()), ..self }
    }
}

/// How much is skipped.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Scope {
    Engine,
    /// One procedure of an engine.
    Procedure,
    Meter,
    /// One kind of light path.
    LightPath,
}

impl Scope {
    /// Whether nothing is read; where single meters or light paths are left out, their readings follow from others.
    pub const fn leaves_no_reading(self) -> bool {
        matches!(self, Self::Engine | Self::Procedure)
    }
}

/// What the user chose on the command line.
#[derive(Clone, Debug, Default)]
pub struct Selection {
    /// Engines by name; empty for what the spec says.
    pub engines: Vec<String>,
    /// Empty for all of the spec.
    pub procedures: Vec<ProcedureId>,
    /// Seed of every random choice.
    pub seed: u64,
}

impl Plan {
    /// What an engine of the plan is asked for a task, whether it is there or not.
    pub fn job(&self, case: &Case, engine: usize, task: &Task, seed: u64) -> Job {
        job(case, &self.engines[engine].engine.name(), task, seed)
    }
}

/// A task as an engine's native files, with the command that runs them by hand where there is one.
pub struct Export {
    pub files: Vec<SceneFile>,
    pub command: Option<String>,
}

/// Why there is none.
#[derive(Debug, thiserror::Error)]
pub enum NotExported {
    #[error("{0}")]
    Unsupported(String),
    #[error(transparent)]
    Engine(#[from] EngineError),
}

impl Plan {
    /// An export needs no installed engine: what is skipped for absence is exported all the same.
    pub fn export(
        &self,
        case: &Case,
        engine: usize,
        task: &Task,
        seed: u64,
        site: &Site,
    ) -> Result<Export, NotExported> {
        let (job, engine) = (self.job(case, engine, task, seed), &self.engines[engine].engine);
        if let Support::No(reason) = engine.supports(&job) {
            return Err(NotExported::Unsupported(reason));
        }
        Ok(Export { files: engine.export(&job)?, command: engine.command_by_hand(&job, site) })
    }
}

/// Plans one case by itself, with all shortcuts.
pub fn plan(case: &Case, selection: &Selection, site: &Site) -> Result<Plan, SpecError> {
    Planner::new(selection, site, Skipping::Allowed).plan(case)
}

/// What is wrong with what cases and a command line say of engines, of each case as much as is told; nothing is started.
pub fn faults(cases: &[Case], selection: &Selection) -> Vec<SpecError> {
    let mut roster = Roster::new();
    cases.iter().flat_map(|case| roster.faults(case, selection).into_iter().take(MAX_FAULTS)).collect()
}

/// Whether readings may be left out that follow from others.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Skipping {
    Allowed,
    /// Everything is rendered.
    Nothing,
}

/// Plans the cases of a run one after the other: it remembers which engines are there and which jobs there were.
pub struct Planner<'a> {
    selection: &'a Selection,
    site: &'a Site,
    skipping: Skipping,
    roster: Roster,
    repeated: Repeated,
    /// What was said of what engines say that they share, once a run.
    told: BTreeSet<String>,
}

impl<'a> Planner<'a> {
    pub fn new(selection: &'a Selection, site: &'a Site, skipping: Skipping) -> Self {
        Self { selection, site, skipping, roster: Roster::new(), repeated: Repeated::default(), told: BTreeSet::new() }
    }

    pub fn plan(&mut self, case: &Case) -> Result<Plan, SpecError> {
        let tasks = tasks(case, self.selection)?;
        self.roster.check_settings(case)?;
        let chosen = self.roster.chosen(case, self.selection)?;
        for told in self.roster.shared_with_nobody(case, &tasks) {
            if !self.told.contains(&told) {
                tracing::warn!("{told}");
                self.told.insert(told);
            }
        }
        let mut plan = self.whole(case, tasks, chosen);
        if self.skipping == Skipping::Allowed {
            self.shorten(case, &mut plan);
        }
        Ok(plan)
    }

    /// Every task for every engine, as far as it can.
    fn whole(&mut self, case: &Case, tasks: Vec<Task>, chosen: Vec<Chosen>) -> Plan {
        let offers: Vec<Vec<Offer>> =
            chosen.iter().map(|(engine, _)| self.offers(case, engine.as_ref(), &tasks)).collect();
        // Who has nothing to do is not even asked for a version.
        let is_busy = |e: usize| offers[e].iter().any(|o| matches!(o, Offer::Run(_)));
        let busy: Vec<_> = (0..chosen.len()).map(|e| is_busy(e).then(|| Arc::clone(&chosen[e].0))).collect();
        let found = self.roster.probe(&busy, self.site);
        let mut plan = Plan { tasks, engines: vec![], runs: vec![], skips: vec![] };
        for (e, ((engine, asked), (found, offers))) in chosen.into_iter().zip(found.into_iter().zip(offers)).enumerate()
        {
            let absence = found.as_ref().and_then(|f| f.as_ref().err()).map(ToString::to_string);
            for (task, offer) in plan.tasks.iter().zip(offers) {
                let skip = |scope, reason| Skip::of(case, task, engine.name(), scope, reason);
                match (&absence, offer) {
                    (Some(absent), _) => plan.skips.push(skip(Scope::Engine, absent.clone())),
                    (None, Offer::Skip(scope, reason)) => plan.skips.push(skip(scope, reason).saving("the whole run")),
                    // What it says of itself once it is asked may rule out more.
                    (None, Offer::Run(run)) => match engine.supports(&run.job) {
                        Support::No(reason) => plan.skips.push(skip(Scope::Procedure, reason).saving("the whole run")),
                        Support::Yes | Support::Approximate { .. } => plan.runs.push(Run { engine: e, ..*run }),
                    },
                }
            }
            plan.engines.push(Planned { engine, found, asked });
        }
        plan
    }

    /// What an engine makes of each task, from the job alone.
    fn offers(&self, case: &Case, engine: &dyn Engine, tasks: &[Task]) -> Vec<Offer> {
        let id = engine.name();
        let is_left_out =
            case.only_engines.as_ref().is_some_and(|own| !own.iter().any(|o| *o == *id || *o == *id.family()))
                && !engine.is_witness();
        let offer = |(t, task): (usize, &Task)| {
            if is_left_out {
                return Offer::Skip(Scope::Engine, "the case is not for this engine".into());
            }
            let job = job(case, &id, task, self.selection.seed);
            let (approximation, declared) = match engine.supports(&job) {
                Support::Yes => (None, 0.0),
                Support::Approximate { why, size } => {
                    let text = size.map(|s| format!(" (about {:.1} %)", 100.0 * s)).unwrap_or_default();
                    (Some(format!("{why}{text}")), size.unwrap_or(0.0))
                }
                Support::No(reason) => return Offer::Skip(Scope::Procedure, reason),
            };
            let shortcut = Shortcut::none(&job);
            Offer::Run(Box::new(Run { engine: 0, task: t, job, approximation, declared, shortcut, spot_check: vec![] }))
        };
        tasks.iter().enumerate().map(offer).collect()
    }

    /// Finds the shortcuts of the engines that somebody vouches for, writes them among its skips and draws what is rendered all the same.
    fn shorten(&mut self, case: &Case, plan: &mut Plan) {
        for run in &mut plan.runs {
            let planned = &plan.engines[run.engine];
            // A shortcut tells what light does, which is the very thing that a program of a user's is asked, and by tables as our reader has
            // them, which is what a reader of files is asked.
            if !planned.engine.is_vouched_for() || planned.engine.reads_files(&run.job) {
                continue;
            }
            if planned.asked != Asked::AsReference && !planned.engine.is_witness() {
                run.shortcut = Shortcut::of(&run.job);
            }
            self.repeated.shorten(&mut run.shortcut, planned.engine.as_ref());
            let all_s = cost_s(planned.engine.as_ref(), &run.job);
            for omission in &run.shortcut.omissions {
                let (task, engine) = (&plan.tasks[run.task], planned.engine.name());
                let (percent, seconds) = (100.0 * omission.share, omission.share * all_s);
                let saved = format!("{percent:.0} % of the run, at most about {seconds:.0} s");
                plan.skips.push(Skip::of(case, task, engine, omission.scope, &omission.reason).saving(saved));
            }
        }
        plan.skips.extend(facts(case, &plan.tasks));
        let engines = &plan.engines;
        let is_witness = |run: &Run| engines[run.engine].engine.is_witness();
        spot_check::draw(&mut plan.runs, is_witness, self.selection.seed);
    }
}

/// What no engine does in a case, whatever its shortcuts.
fn facts(case: &Case, tasks: &[Task]) -> Vec<Skip> {
    let fact = |task: &Task, engine, reason: &str| Skip::of(case, task, engine, Scope::LightPath, reason);
    let direct = tasks.iter().filter(|t| t.transport == Transport::Direct && t.scene.room.is_some());
    let of = |task: &Task| {
        let mut found = vec![fact(task, EVERYONE, "direct light only: no reflection is followed")];
        if task.scene.obstacles.is_empty() {
            let reason = "the room is empty and convex, nothing hides a luminaire: no visibility is tested";
            found.push(fact(task, EngineName::SIMULATOR, reason));
        }
        found
    };
    direct.flat_map(of).collect()
}

/// Stands for all engines in what is skipped by definition.
pub(crate) const EVERYONE: EngineName = EngineName::new("all");

/// What an engine makes of a task.
enum Offer {
    Run(Box<Run>),
    Skip(Scope, String),
}

/// What a run of a whole job may cost, in seconds: the budget for whatever samples, next to nothing for our own solvers where they do not.
fn cost_s(engine: &dyn Engine, job: &Job) -> f64 {
    let is_quick = engine.is_witness() && !engine.samples(job);
    if is_quick { job.budget.seconds.min(1.0) } else { job.budget.seconds }
}

impl Selection {
    /// Whether a case holds any of the chosen procedures.
    pub fn concerns(&self, case: &Case) -> bool {
        case.tasks().any(|task| self.wants(task.procedure))
    }

    fn wants(&self, procedure: ProcedureId) -> bool {
        self.procedures.is_empty() || self.procedures.contains(&procedure)
    }
}

fn tasks(case: &Case, selection: &Selection) -> Result<Vec<Task>, SpecError> {
    let tasks: Vec<Task> = case.tasks().filter(|task| selection.wants(task.procedure)).collect();
    if tasks.is_empty() {
        let message = "none of the procedures chosen with --procedures is in this spec";
        return Err(case.source.error_at("procedures", message, "choose one that is, or leave the option out"));
    }
    Ok(tasks)
}

fn job(case: &Case, engine: &EngineName, task: &Task, seed: u64) -> Job {
    Job { seed, settings: case.settings_of(engine.as_str()), ..Job::of_task(case, task) }
}
