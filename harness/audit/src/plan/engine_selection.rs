//! Selects the engines of a case from the command line and the spec, and probes the version of each at most once.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use itertools::Itertools;
use serde_json::Value;

use super::{Selection, SelectionReason};
use luxproof_engines::{Absent, Engine, EngineError, EngineRoot, Job, Unknown, Version};
use luxproof_model::family;
use luxproof_process::slots::side_by_side;
use luxproof_spec::procedures::Task;
use luxproof_spec::{Case, EngineSettings, PlacePart, READINGS, SpecError, Trust, suggestion};

/// An engine and why it was selected.
pub(super) type Chosen = (Arc<dyn Engine>, SelectionReason);

/// The engines of a run, which all cases share, and their versions so far.
pub(super) struct EngineSelection {
    built_in: Vec<Arc<dyn Engine>>,
    /// Releases of built-in engines that a spec or the command line names.
    releases: Vec<Arc<dyn Engine>>,
    /// Programs of users.
    externals: Vec<(Program, Arc<dyn Engine>)>,
    /// The versions of the engines that have been probed.
    probed: Vec<(Arc<dyn Engine>, Result<Version, Absent>)>,
}

/// Where an engine is named.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Named {
    InSpec,
    OnTheCommandLine,
}

/// A user's program: its name, its settings, and the folder to which its paths are relative.
type Program = (String, EngineSettings, PathBuf);

impl EngineSelection {
    /// The built-in engines.
    pub(super) fn new() -> Self {
        let built_in = luxproof_engines::all().into_iter().map(Arc::from).collect();
        Self { built_in, releases: vec![], externals: vec![], probed: vec![] }
    }

    /// The faults in the engine settings of a case and in the chosen engine names; starts no engine.
    pub(super) fn faults(&mut self, case: &Case, selection: &Selection) -> Vec<SpecError> {
        let (all, mut faults) = self.engines_of_case(case, selection);
        faults.extend(self.faults_of_settings(case));
        faults.extend(unknown_choices(case, &all, selection));
        faults
    }

    /// The built-in engines, the named releases and the programs of a case, and the faults of these.
    fn engines_of_case(&mut self, case: &Case, selection: &Selection) -> (Vec<Arc<dyn Engine>>, Vec<SpecError>) {
        let (mut all, mut faults) = (self.built_in.clone(), vec![]);
        let built_in = engine_names(&all);
        let none = EngineSettings::default();
        let in_spec = case.engines.iter().flatten().map(|(name, settings)| (name, settings, Named::InSpec));
        // Other names on the command line have to be releases: all other engines are built in or in the spec.
        let besides = selection.engines.iter().filter(|name| name.contains('@') && !is_in_spec(case, name)).unique();
        let named = in_spec.chain(besides.map(|name| (name, &none, Named::OnTheCommandLine)));
        faults.extend(faults_of_recorded(case));
        // Recorded readings start nothing: they are added to what engines read.
        let started = named.filter(|(name, settings, _)| !built_in.contains(*name) && !is_recorded(settings));
        for (name, settings, by) in started {
            match self.release(name) {
                Ok(Some(release)) => all.push(release),
                Ok(None) => match self.program(case, name, settings, by, &built_in) {
                    Ok(program) => all.extend(program),
                    Err(fault) => faults.push(fault),
                },
                Err(Unknown { message, help }) if by == Named::InSpec => {
                    faults.push(case.source.error_at_part(PlacePart::Key, &format!("engines.{name}"), message, help));
                }
                Err(Unknown { message, help }) => faults.push(SpecError::of("--engines", message, help)),
            }
        }
        (all, faults)
    }

    /// A user's program; `None` where the command line names one that this case does not define.
    fn program(
        &mut self,
        case: &Case,
        name: &str,
        settings: &EngineSettings,
        by: Named,
        built_in: &[String],
    ) -> Result<Option<Arc<dyn Engine>>, SpecError> {
        const RELEASES_HELP: &str = "give `releases: {\"1.0\": [program, arguments...]}`";
        const COMMAND_HELP: &str = "give `command: [program, arguments...]`, paths relative to the spec";
        let settings = settings_of_program(case, name, settings)
            .map_err(|e| settings_error(case, family(name), e, RELEASES_HELP.to_owned()))?;
        if !settings.0.contains_key("command") {
            if by == Named::OnTheCommandLine {
                return Ok(None);
            }
            let (message, known) = unknown_engine(name, built_in);
            let help = format!("{known} A program of your own needs `command: [...]`");
            return Err(case.source.error_at_part(PlacePart::Key, &format!("engines.{name}"), message, help));
        }
        let folder = case.path.parent().unwrap_or(Path::new(""));
        let program = self.external(name, &settings, folder);
        program.map(Some).map_err(|error| settings_error(case, name, error, COMMAND_HELP.to_owned()))
    }

    /// The engines of a case, in the order of reports.
    pub(super) fn chosen(&mut self, case: &Case, selection: &Selection) -> Result<Vec<Chosen>, SpecError> {
        let (all, mut faults) = self.engines_of_case(case, selection);
        faults.extend(unknown_choices(case, &all, selection));
        if let Some(fault) = faults.into_iter().next() {
            return Err(fault);
        }
        let mut chosen = vec![];
        for engine in all {
            if let Some(asked) = why_asked(engine.as_ref(), case, selection) {
                chosen.push((engine, asked));
            }
        }
        Ok(chosen)
    }

    /// Refuses unknown settings of built-in engines, whether they are selected or not.
    pub(super) fn check_settings(&self, case: &Case) -> Result<(), SpecError> {
        self.faults_of_settings(case).into_iter().next().map_or(Ok(()), Err)
    }

    /// The faults in the settings of built-in engines.
    ///
    /// Engines report one fault at a time, so each key is checked alone, and then all of them together.
    fn faults_of_settings(&self, case: &Case) -> Vec<SpecError> {
        let mut faults = vec![];
        for engine in self.built_in.iter().chain(&self.releases) {
            let name = engine.name();
            if name.release().is_some() && !is_in_spec(case, &name) {
                continue;
            }
            let settings = case.settings_of(name.as_str());
            let is_program = settings.contains_key("command");
            let one_by_one = settings.iter().filter_map(|(key, value)| {
                settings_fault(case, engine.as_ref(), [(key.clone(), value.clone())].into())
            });
            let mut found: Vec<SpecError> = one_by_one.collect();
            if found.is_empty() || is_program {
                found = settings_fault(case, engine.as_ref(), settings.clone()).into_iter().collect();
            }
            faults.extend(found);
        }
        faults
    }

    /// A warning for each name in the `shares` of a user's program that no other engine of the case is or has.
    pub(super) fn unknown_shares(&self, case: &Case, tasks: &[Task]) -> Vec<String> {
        let mut built_in = BTreeSet::new();
        for engine in &self.built_in {
            built_in.insert(engine.name().to_string());
            for task in tasks {
                let job = Job { settings: case.settings_of(engine.name().as_str()), ..Job::of_task(case, task) };
                built_in.extend(engine.components(&job));
            }
        }
        let programs: Vec<_> = case.engines.iter().flatten().collect();
        let mut warnings = vec![];
        for (name, settings) in &programs {
            for share in shares_of(settings) {
                let is_of_other = programs
                    .iter()
                    .filter(|(other, _)| other != name)
                    .any(|(other, settings)| **other == share || shares_of(settings).contains(&share));
                if !built_in.contains(&share) && !is_of_other {
                    let known = built_in.iter().join(", ");
                    warnings.push(format!(
                        "engines.{name}.shares: no other engine is or has `{share}`, so it has no effect; built-in engines are and have {known}"
                    ));
                }
            }
        }
        warnings
    }

    /// A release of a built-in engine by its name; all cases share it.
    fn release(&mut self, name: &str) -> Result<Option<Arc<dyn Engine>>, Unknown> {
        if let Some(known) = self.releases.iter().find(|engine| engine.name() == *name) {
            return Ok(Some(Arc::clone(known)));
        }
        let Some(engine) = luxproof_engines::built_in(name)? else { return Ok(None) };
        let engine: Arc<dyn Engine> = Arc::from(engine);
        self.releases.push(Arc::clone(&engine));
        Ok(Some(engine))
    }

    /// A user's program; all cases with the same settings share it.
    fn external(
        &mut self,
        name: &str,
        settings: &EngineSettings,
        folder: &Path,
    ) -> Result<Arc<dyn Engine>, EngineError> {
        let named = (name.to_owned(), settings.clone(), folder.to_owned());
        if let Some((_, engine)) = self.externals.iter().find(|(known, _)| *known == named) {
            return Ok(Arc::clone(engine));
        }
        let engine: Arc<dyn Engine> = Arc::from(luxproof_engines::external(name, &settings.0, folder)?);
        self.externals.push((named, Arc::clone(&engine)));
        Ok(engine)
    }

    /// Probes the versions of engines concurrently and remembers them for the next case.
    pub(super) fn probe(
        &mut self,
        asked: &[Option<Arc<dyn Engine>>],
        site: &EngineRoot,
    ) -> Vec<Option<Result<Version, Absent>>> {
        let found = side_by_side(asked.len(), asked, |engine| {
            let engine = engine.as_ref()?;
            Some(self.known_version(engine).unwrap_or_else(|| engine.probe(site)))
        });
        let mut new = vec![];
        for (engine, version) in asked.iter().flatten().zip(found.iter().flatten()) {
            if self.known_version(engine).is_none() {
                new.push((Arc::clone(engine), version.clone()));
            }
        }
        self.probed.extend(new);
        found
    }

    /// The result of an earlier probe.
    fn known_version(&self, engine: &Arc<dyn Engine>) -> Option<Result<Version, Absent>> {
        let (_, version) = self.probed.iter().find(|(probed, _)| Arc::ptr_eq(probed, engine))?;
        Some(version.clone())
    }
}

/// Why an engine is selected for a case; `None` where it is not.
fn why_asked(engine: &dyn Engine, case: &Case, selection: &Selection) -> Option<SelectionReason> {
    let name = engine.name();
    if selection.engines.iter().any(|n| name == *n) {
        Some(SelectionReason::ByName)
    } else if engine.is_reference_engine() {
        Some(SelectionReason::AsReference)
    } else if !selection.engines.is_empty() {
        None
    } else if let Some(in_spec) = &case.engines {
        in_spec.contains_key(name.as_str()).then_some(SelectionReason::ByName)
    } else {
        // A spec selects the same engines on every machine, whatever is installed there.
        (!luxproof_engines::is_on_request(name.as_str())).then_some(SelectionReason::ByDefault)
    }
}

/// The first fault that an engine finds in settings.
fn settings_fault(case: &Case, engine: &dyn Engine, settings: BTreeMap<String, Value>) -> Option<SpecError> {
    let error = engine.check_settings(&Job::of_settings(case.budget, settings)).err()?;
    Some(settings_error(case, engine.name().as_str(), error, settings_help(case, engine)))
}

/// The help for a fault in an engine's settings.
fn settings_help(case: &Case, engine: &dyn Engine) -> String {
    let name = engine.name();
    if case.settings_of(name.as_str()).contains_key("command") {
        return format!("`{name}` is an engine of luxproof's: give a program of your own another name");
    }
    let keys: Vec<&str> = engine.settings().iter().map(|k| k.key).collect();
    let known = if keys.is_empty() { "none".to_owned() } else { keys.join(", ") };
    format!("settings of {name}: {known}")
}

/// Whether an entry of a spec's engines holds recorded readings.
fn is_recorded(settings: &EngineSettings) -> bool {
    settings.0.contains_key(READINGS)
}

/// The faults of the recorded readings of a case: they have the name of another engine, or lie where nothing is measured.
fn faults_of_recorded(case: &Case) -> Vec<SpecError> {
    let recorded = case.engines.iter().flatten().filter(|(_, settings)| is_recorded(settings)).map(|(name, _)| name);
    let mut faults = vec![];
    for name in recorded {
        if luxproof_engines::entry(name).is_some() {
            let message = format!("`{name}` is an engine of luxproof's, and recorded readings never stand for it");
            let help = "give recorded readings a name of another engine, like `{name}-2016`".replace("{name}", name);
            faults.push(case.source.error_at_part(PlacePart::Key, &format!("engines.{name}"), message, help));
        }
        let message = if let Some(entry) = luxproof_engines::look_alike(name) {
            format!("`{name}` looks like `{}`, an engine of luxproof's", entry.name)
        } else if case.source.trust != Trust::Own && !name.is_ascii() {
            format!("`{name}` has letters that may look like others, and the spec is not trusted")
        } else {
            continue;
        };
        let help = "give recorded readings a name of their own in plain letters, like `iray-2016`";
        faults.push(case.source.error_at_part(PlacePart::Key, &format!("engines.{name}"), message, help));
    }
    let known = case.tasks().flat_map(|task| task.targets.into_iter().map(move |t| (task.procedure, t.id))).collect();
    for (name, readings) in &case.recorded {
        if let Some((procedure, meter)) = readings.unknown_meter(&case.name, &known) {
            let message = format!("there is a value of {procedure} at `{meter}`, where the spec measures nothing");
            let message = case.source.trust.shown(&message);
            let help = "name points as reports do, like `plane[0]`, and procedures that the spec has".to_owned();
            faults.push(case.source.error_at(&format!("engines.{name}.{READINGS}"), message, help));
        }
    }
    faults
}

/// The names of engines and components that a program declares to share.
fn shares_of(settings: &EngineSettings) -> Vec<String> {
    let listed = settings.0.get("shares").and_then(|s| serde_json::from_value(s.clone()).ok());
    listed.unwrap_or_default()
}

/// Whether the spec names an engine.
fn is_in_spec(case: &Case, name: &str) -> bool {
    case.engines.as_ref().is_some_and(|engines| engines.contains_key(name))
}

/// The settings of a user's program: those of its entry, or for a release those that its program's entry gives.
fn settings_of_program(case: &Case, name: &str, settings: &EngineSettings) -> Result<EngineSettings, EngineError> {
    let of_family = case.engines.as_ref().and_then(|all| all.get(family(name))).filter(|_| family(name) != name);
    let of_family = of_family.filter(|_| !settings.0.contains_key("command"));
    let made = of_family.map(|of| luxproof_engines::of_release(name, &of.0, &settings.0)).transpose()?.flatten();
    Ok(made.map_or_else(|| settings.clone(), EngineSettings))
}

/// The faults of engine names on the command line that no engine has.
fn unknown_choices(case: &Case, all: &[Arc<dyn Engine>], selection: &Selection) -> Vec<SpecError> {
    let mut ids = engine_names(all);
    ids.extend(case.recorded.keys().cloned());
    let mut faults = vec![];
    for name in selection.engines.iter().filter(|name| !ids.contains(*name)) {
        // An invalid release of a built-in engine has a fault already.
        if luxproof_engines::built_in(name).is_err() {
            continue;
        }
        let (message, known) = unknown_engine(name, &ids);
        faults.push(SpecError::of("--engines", message, known));
    }
    faults
}

/// An error in the settings of an engine, at its place in the spec.
fn settings_error(case: &Case, name: &str, error: EngineError, help: String) -> SpecError {
    match error {
        EngineError::Setting { key, what, .. } => case.source.error_at(&format!("engines.{name}.{key}"), what, help),
        other => case.source.error_at(&format!("engines.{name}"), other.to_string(), help),
    }
}

/// What is wrong with a name that no engine has, and what to do.
fn unknown_engine(name: &str, known: &[String]) -> (String, String) {
    (format!("there is no engine `{name}`"), suggestion(name, known.iter().map(String::as_str)))
}

/// The names of engines.
fn engine_names(engines: &[Arc<dyn Engine>]) -> Vec<String> {
    engines.iter().map(|e| e.name().to_string()).collect()
}
