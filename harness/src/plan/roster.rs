//! Who takes part: the engines that a command line and a spec choose, each asked for its version once and only if it has work.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use itertools::Itertools;

use super::{Asked, Selection};
use crate::engines::{self, Absent, Engine, EngineError, Job, Site, Unknown, Version};
use crate::procedures::Task;
use crate::record::family;
use crate::spec::{Case, EngineSettings, SpecError, Spot, suggestion};
use crate::system::slots::side_by_side;

/// An engine and why it takes part.
pub(super) type Chosen = (Arc<dyn Engine>, Asked);

/// Engines, each shared by all cases that it takes part in, and what they say of their version.
pub(super) struct Roster {
    ours: Vec<Arc<dyn Engine>>,
    /// Releases of ours that were named.
    releases: Vec<Arc<dyn Engine>>,
    externals: Vec<(Program, Arc<dyn Engine>)>,
    probed: Vec<(Arc<dyn Engine>, Result<Version, Absent>)>,
}

/// Where an engine is named.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Named {
    InSpec,
    OnTheCommandLine,
}

/// A program of a user's: name, settings and the folder that its paths count from.
type Program = (String, EngineSettings, PathBuf);

impl Roster {
    pub(super) fn new() -> Self {
        let ours = engines::all().into_iter().map(Arc::from).collect();
        Self { ours, releases: vec![], externals: vec![], probed: vec![] }
    }

    /// All that is wrong with what a case says of engines, and with the names of engines that were chosen; nothing is started.
    pub(super) fn faults(&mut self, case: &Case, selection: &Selection) -> Vec<SpecError> {
        let (all, mut faults) = self.of_case(case, selection);
        faults.extend(self.faults_of_settings(case));
        faults.extend(unknown_choices(&all, selection));
        faults
    }

    /// Ours, releases that a case or the command line names, and programs of the case's, and what is wrong with these.
    fn of_case(&mut self, case: &Case, selection: &Selection) -> (Vec<Arc<dyn Engine>>, Vec<SpecError>) {
        let (mut all, mut faults) = (self.ours.clone(), vec![]);
        let built_in = names(&all);
        let none = EngineSettings::default();
        let in_spec = case.engines.iter().flatten().map(|(name, settings)| (name, settings, Named::InSpec));
        // Others that the command line names have to be releases: what else there is, is ours or stands in the spec.
        let besides = selection.engines.iter().filter(|name| name.contains('@') && !stands_in(case, name)).unique();
        let named = in_spec.chain(besides.map(|name| (name, &none, Named::OnTheCommandLine)));
        for (name, settings, by) in named.filter(|(name, ..)| !built_in.contains(*name)) {
            match self.release(name) {
                Ok(Some(release)) => all.push(release),
                Ok(None) => match self.program(case, name, settings, by, &built_in) {
                    Ok(program) => all.extend(program),
                    Err(fault) => faults.push(fault),
                },
                Err(Unknown { message, help }) if by == Named::InSpec => {
                    faults.push(case.source.error_at_spot(Spot::Key, &format!("engines.{name}"), message, help));
                }
                Err(Unknown { message, help }) => faults.push(SpecError::of("--engines", message, help)),
            }
        }
        (all, faults)
    }

    /// A program of a case's; `None` where the command line names what this case knows nothing of.
    fn program(
        &mut self,
        case: &Case,
        name: &str,
        settings: &EngineSettings,
        by: Named,
        built_in: &[String],
    ) -> Result<Option<Arc<dyn Engine>>, SpecError> {
        let help = || "give `releases: {\"1.0\": [program, arguments...]}`".to_owned();
        let settings = settings_of_program(case, name, settings).map_err(|e| misset(case, family(name), e, help))?;
        if !settings.0.contains_key("command") {
            if by == Named::OnTheCommandLine {
                return Ok(None);
            }
            let (message, known) = unknown(name, built_in);
            let help = format!("{known} A program of your own needs `command: [...]`");
            return Err(case.source.error_at_spot(Spot::Key, &format!("engines.{name}"), message, help));
        }
        let folder = case.path.parent().unwrap_or(Path::new(""));
        let help = || "give `command: [program, arguments...]`, paths relative to the spec".to_owned();
        self.external(name, &settings, folder).map(Some).map_err(|error| misset(case, name, error, help))
    }

    /// The engines of a case, in the order of reports.
    pub(super) fn chosen(&mut self, case: &Case, selection: &Selection) -> Result<Vec<Chosen>, SpecError> {
        let (all, mut faults) = self.of_case(case, selection);
        faults.extend(unknown_choices(&all, selection));
        if let Some(fault) = faults.into_iter().next() {
            return Err(fault);
        }
        let asked = |engine: &dyn Engine| {
            let id = engine.name();
            if selection.engines.iter().any(|n| id == *n) {
                Some(Asked::ByName)
            } else if engine.is_witness() {
                Some(Asked::AsReference)
            } else if !selection.engines.is_empty() {
                None
            } else if let Some(in_spec) = &case.engines {
                in_spec.contains_key(id.as_str()).then_some(Asked::ByName)
            } else {
                // The same spec asks the same engines on every machine, whatever is installed there.
                (!engines::is_on_request(id.as_str())).then_some(Asked::ByDefault)
            }
        };
        Ok(all.into_iter().filter_map(|engine| asked(engine.as_ref()).map(|asked| (engine, asked))).collect())
    }

    /// Refuses settings of our own engines that they do not know, whichever of them take part.
    pub(super) fn check_settings(&self, case: &Case) -> Result<(), SpecError> {
        self.faults_of_settings(case).into_iter().next().map_or(Ok(()), Err)
    }

    /// Settings tell their faults one by one: each key is looked at as if it stood there alone, and all of them together.
    fn faults_of_settings(&self, case: &Case) -> Vec<SpecError> {
        let mut faults = vec![];
        for engine in self.ours.iter().chain(&self.releases) {
            let name = engine.name();
            if name.release().is_some() && !stands_in(case, &name) {
                continue;
            }
            let settings = case.settings_of(name.as_str());
            let is_program = settings.contains_key("command");
            let keys: Vec<&str> = engine.knobs().iter().map(|k| k.key).collect();
            let known = if keys.is_empty() { "none".to_owned() } else { keys.join(", ") };
            let help = || {
                if is_program {
                    return format!("`{name}` is an engine of luxproof's: give a program of your own another name");
                }
                format!("settings of {name}: {known}")
            };
            let check = |settings| {
                let job = Job::of_settings(case.budget, settings);
                engine.check_settings(&job).err().map(|error| misset(case, name.as_str(), error, help))
            };
            let one_by_one = settings.iter().filter_map(|(key, value)| check([(key.clone(), value.clone())].into()));
            let mut found: Vec<SpecError> = one_by_one.collect();
            if found.is_empty() || is_program {
                found = check(settings.clone()).into_iter().collect();
            }
            faults.extend(found);
        }
        faults
    }

    /// A sentence for each name in the `shares` of a program of a user's that no other engine of the case is or has: it ties nobody.
    pub(super) fn shared_with_nobody(&self, case: &Case, tasks: &[Task]) -> Vec<String> {
        let shares = |settings: &EngineSettings| -> Vec<String> {
            let listed = settings.0.get("shares").and_then(|s| serde_json::from_value(s.clone()).ok());
            listed.unwrap_or_default()
        };
        let ours = self.ours.iter().flat_map(|engine| {
            let job = |task| Job { settings: case.settings_of(engine.name().as_str()), ..Job::of_task(case, task) };
            let parts = tasks.iter().flat_map(move |task| engine.components(&job(task)));
            std::iter::once(engine.name().to_string()).chain(parts)
        });
        let ours: BTreeSet<String> = ours.collect();
        let theirs: Vec<_> = case.engines.iter().flatten().collect();
        let mut told = vec![];
        for (name, settings) in &theirs {
            let others = || theirs.iter().filter(|(other, _)| other != name);
            for share in shares(settings) {
                if !ours.contains(&share)
                    && !others().any(|(other, of)| **other == share || shares(of).contains(&share))
                {
                    let known = ours.iter().join(", ");
                    told.push(format!(
                        "engines.{name}.shares: no other engine is or has `{share}`, so that it ties nobody; ours are and have {known}"
                    ));
                }
            }
        }
        told
    }

    /// A release of ours by its name, one for all cases.
    fn release(&mut self, name: &str) -> Result<Option<Arc<dyn Engine>>, Unknown> {
        if let Some(known) = self.releases.iter().find(|engine| engine.name() == *name) {
            return Ok(Some(Arc::clone(known)));
        }
        let Some(engine) = engines::built_in(name)? else { return Ok(None) };
        let engine: Arc<dyn Engine> = Arc::from(engine);
        self.releases.push(Arc::clone(&engine));
        Ok(Some(engine))
    }

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
        let engine: Arc<dyn Engine> = Arc::from(engines::external(name, &settings.0, folder)?);
        self.externals.push((named, Arc::clone(&engine)));
        Ok(engine)
    }

    /// The versions of those that are asked, side by side, remembered for the next case.
    pub(super) fn probe(
        &mut self,
        asked: &[Option<Arc<dyn Engine>>],
        site: &Site,
    ) -> Vec<Option<Result<Version, Absent>>> {
        let known = |e: &Arc<dyn Engine>| self.probed.iter().find(|(probed, _)| Arc::ptr_eq(probed, e));
        let version = |e: &Arc<dyn Engine>| known(e).map_or_else(|| e.probe(site), |(_, found)| found.clone());
        let found = side_by_side(asked.len(), asked, |e| e.as_ref().map(version));
        let answers = asked.iter().flatten().zip(found.iter().flatten());
        let fresh: Vec<_> = answers.filter(|(e, _)| known(e).is_none()).map(|(e, f)| (e.clone(), f.clone())).collect();
        self.probed.extend(fresh);
        found
    }
}

/// Whether the spec names an engine.
fn stands_in(case: &Case, name: &str) -> bool {
    case.engines.as_ref().is_some_and(|engines| engines.contains_key(name))
}

/// The settings of a program of a user's: its own, or those that the program of which it is a release has for it.
fn settings_of_program(case: &Case, name: &str, settings: &EngineSettings) -> Result<EngineSettings, EngineError> {
    let of_family = case.engines.as_ref().and_then(|all| all.get(family(name))).filter(|_| family(name) != name);
    let of_family = of_family.filter(|_| !settings.0.contains_key("command"));
    let made = of_family.map(|of| engines::of_release(name, &of.0, &settings.0)).transpose()?.flatten();
    Ok(made.map_or_else(|| settings.clone(), EngineSettings))
}

/// Names of engines on the command line that no engine has.
fn unknown_choices(all: &[Arc<dyn Engine>], selection: &Selection) -> Vec<SpecError> {
    let ids = names(all);
    // A release of ours that is none was told already.
    let is_told = |name: &String| engines::built_in(name).is_err();
    let strange = selection.engines.iter().filter(|name| !ids.contains(*name) && !is_told(name));
    let fault = |name: &String| {
        let (message, known) = unknown(name, &ids);
        SpecError::of("--engines", message, known)
    };
    strange.map(fault).collect()
}

/// An error in the settings of an engine, at its place in the spec.
fn misset(case: &Case, name: &str, error: EngineError, help: impl Fn() -> String) -> SpecError {
    match error {
        EngineError::Setting { key, what, .. } => case.source.error_at(&format!("engines.{name}.{key}"), what, help()),
        other => case.source.error_at(&format!("engines.{name}"), other.to_string(), help()),
    }
}

/// What is wrong with a name that no engine has, and what to do.
fn unknown(name: &str, known: &[String]) -> (String, String) {
    (format!("there is no engine `{name}`"), suggestion(name, known.iter().map(String::as_str)))
}

fn names(engines: &[Arc<dyn Engine>]) -> Vec<String> {
    engines.iter().map(|e| e.name().to_string()).collect()
}
