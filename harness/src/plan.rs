//! The plan: which engine runs which procedure of a case, what is skipped, and why.

use std::collections::BTreeMap;
use std::path::Path;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::engines::{Absent, Engine, EngineId, Job, Site, Station, Support, Version};
use crate::procedures::{self, Task};
use crate::reading::MeterId;
use crate::spec::{Case, SpecError, nearest};

/// What is to be done for one case. Runs + skips = procedures x engines, always.
pub struct Plan {
    /// The procedures' tasks, in order.
    pub tasks: Vec<Task>,
    /// The engines that take part, in order.
    pub engines: Vec<Planned>,
    /// What will run.
    pub runs: Vec<Run>,
    /// What will not, and why.
    pub skips: Vec<Skip>,
}

/// An engine of the plan.
pub struct Planned {
    /// The engine.
    pub engine: Box<dyn Engine>,
    /// Whether it is there.
    pub found: Result<Version, Absent>,
    /// Why it takes part.
    pub asked: Asked,
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

/// One engine on one procedure.
pub struct Run {
    /// Index into [`Plan::engines`].
    pub engine: usize,
    /// Index into [`Plan::tasks`].
    pub task: usize,
    /// What the engine is asked.
    pub job: Job,
    /// Where the engine only approximates what is asked.
    pub approximation: Option<String>,
}

/// Something that is not run, with its reason.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct Skip {
    /// The case.
    pub case: String,
    /// The procedure.
    pub procedure: String,
    /// The engine.
    pub engine: String,
    /// How much is skipped.
    pub scope: Scope,
    /// Why.
    pub reason: String,
    /// What that saves, where it saves something.
    pub saved: Option<String>,
}

/// How much is skipped.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Scope {
    /// All of an engine.
    Engine,
    /// One procedure of an engine.
    Procedure,
    /// One meter.
    Meter,
    /// One kind of light path.
    LightPath,
}

/// What the user chose on the command line.
#[derive(Clone, Debug, Default)]
pub struct Selection {
    /// Engines by name; empty for what the spec says.
    pub engines: Vec<String>,
    /// Procedures by name; empty for all of the spec.
    pub procedures: Vec<String>,
    /// Seed of every random choice.
    pub seed: u64,
}

/// The engines that the others are judged by: they always run, they cost next to nothing.
pub const REFERENCES: [&str; 2] = ["simulator", "iesna"];

impl Plan {
    /// What an engine of the plan is asked for a task, whether it is there or not.
    pub fn job(&self, case: &Case, engine: usize, task: &Task, seed: u64) -> Job {
        job(case, &self.engines[engine].engine.id(), task, seed)
    }
}

/// Plans a case.
pub fn plan(case: &Case, selection: &Selection, site: &Site) -> Result<Plan, SpecError> {
    let tasks = tasks(case, selection)?;
    let engines = engines(case, selection, site)?;
    let (mut runs, mut skips) = (vec![], vec![]);
    for (e, planned) in engines.iter().enumerate() {
        for (t, task) in tasks.iter().enumerate() {
            let job = job(case, &planned.engine.id(), task, selection.seed);
            let skip = |scope, reason: String, saved: Option<&str>| Skip {
                case: case.name.clone(),
                procedure: task.procedure.to_owned(),
                engine: planned.engine.id().name().to_owned(),
                scope,
                reason,
                saved: saved.map(str::to_owned),
            };
            if let Err(absent) = &planned.found {
                skips.push(skip(Scope::Engine, absent.to_string(), None));
                continue;
            }
            if case.only_engines.as_ref().is_some_and(|own| !own.iter().any(|o| o == planned.engine.id().name()))
                && !REFERENCES.contains(&planned.engine.id().name())
            {
                skips.push(skip(Scope::Engine, "the case is not for this engine".into(), Some("the whole run")));
                continue;
            }
            match planned.engine.supports(&job) {
                Support::Yes => runs.push(Run { engine: e, task: t, job, approximation: None }),
                Support::Approximate { why, size } => {
                    let size = size.map(|s| format!(" (about {:.1} %)", 100.0 * s)).unwrap_or_default();
                    runs.push(Run { engine: e, task: t, job, approximation: Some(format!("{why}{size}")) });
                }
                Support::No(reason) => skips.push(skip(Scope::Procedure, reason, Some("the whole run"))),
            }
        }
    }
    Ok(Plan { tasks, engines, runs, skips })
}

impl Selection {
    /// Whether a case holds any of the chosen procedures.
    pub fn concerns(&self, case: &Case) -> bool {
        procedures::ALL.iter().any(|p| self.wants(p.name()) && p.task(case).is_some())
    }

    fn wants(&self, procedure: &str) -> bool {
        self.procedures.is_empty() || self.procedures.iter().any(|p| p == procedure)
    }
}

fn tasks(case: &Case, selection: &Selection) -> Result<Vec<Task>, SpecError> {
    let known = || procedures::ALL.iter().map(|p| p.name());
    for name in &selection.procedures {
        if !known().any(|k| k == name) {
            return Err(unknown("procedure", name, known(), "--procedures"));
        }
    }
    let tasks: Vec<Task> =
        procedures::ALL.iter().filter(|p| selection.wants(p.name())).filter_map(|p| p.task(case)).collect();
    if tasks.is_empty() {
        let message = "none of the procedures chosen with --procedures is in this spec";
        return Err(case.source.error_at("procedures", message, "choose one that is, or leave the option out"));
    }
    Ok(tasks)
}

fn engines(case: &Case, selection: &Selection, site: &Site) -> Result<Vec<Planned>, SpecError> {
    let mut all = crate::engines::all();
    let built_in = names(&all);
    let in_spec: Vec<&String> = case.engines.iter().flat_map(BTreeMap::keys).collect();
    for (name, settings) in case.engines.iter().flatten().filter(|(name, _)| !built_in.contains(*name)) {
        if !settings.0.contains_key("command") {
            let mut error = unknown("engine", name, built_in.iter().map(String::as_str), "");
            let place = case.source.error_at(&format!("engines.{name}"), "", "");
            error = SpecError { file: place.file, line: place.line, column: place.column, ..error };
            error.help = error.help.map(|h| format!("{h} A program of your own needs `command: [...]`"));
            return Err(error);
        }
        // The parent of a bare file name is empty, which is no folder.
        let folder = case.path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
        let engine = crate::engines::external(name, &settings.0, folder).map_err(|error| {
            let help = "give `command: [program, arguments...]`, paths relative to the spec";
            case.source.error_at(&format!("engines.{name}"), error.to_string(), help)
        })?;
        all.push(engine);
    }
    let ids = names(&all);
    for name in &selection.engines {
        if !ids.contains(name) {
            return Err(unknown("engine", name, ids.iter().map(String::as_str), "--engines"));
        }
    }
    let asked = |id: &str| {
        if selection.engines.iter().any(|n| n == id) {
            Some(Asked::ByName)
        } else if REFERENCES.contains(&id) {
            Some(Asked::AsReference)
        } else if !selection.engines.is_empty() {
            None
        } else if case.engines.is_none() {
            Some(Asked::ByDefault)
        } else {
            in_spec.iter().any(|n| *n == id).then_some(Asked::ByName)
        }
    };
    let chosen = all.into_iter().filter_map(|engine| asked(engine.id().name()).map(|asked| (engine, asked)));
    Ok(chosen.map(|(engine, asked)| Planned { found: engine.probe(site), engine, asked }).collect())
}

fn names(engines: &[Box<dyn Engine>]) -> Vec<String> {
    engines.iter().map(|e| e.id().name().to_owned()).collect()
}

fn job(case: &Case, engine: &EngineId, task: &Task, seed: u64) -> Job {
    let settings = case.engines.as_ref().and_then(|e| e.get(engine.name())).map(|s| s.0.clone()).unwrap_or_default();
    let station = |target: &procedures::Target| Station {
        id: MeterId(target.id.0.clone()),
        meter: target.meter,
        expected_lx: None,
    };
    Job {
        case: case.name.clone(),
        procedure: task.procedure.to_owned(),
        scene: task.scene.clone(),
        stations: task.targets.iter().map(station).collect(),
        transport: task.transport,
        budget: case.budget,
        seed,
        settings,
    }
}

fn unknown<'a>(kind: &str, name: &str, known: impl Iterator<Item = &'a str> + Clone, option: &str) -> SpecError {
    let help = match nearest(name, known.clone()) {
        Some(k) => format!("did you mean `{k}`?"),
        None => format!("known: {}", known.collect::<Vec<_>>().join(", ")),
    };
    let message = format!("there is no {kind} `{name}`");
    SpecError { file: option.into(), line: None, column: None, message, help: Some(help) }
}
