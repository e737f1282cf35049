//! Who takes part: the engines that a command line and a spec choose, each asked for its version once and only if it has work.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

use super::{Asked, Selection};
use crate::engines::{self, Absent, Engine, Site, Version};
use crate::record::EngineName;
use crate::spec::{Case, SpecError, suggestion};
use crate::system::slots::side_by_side;

/// An engine and why it takes part.
pub(super) type Chosen = (Arc<dyn Engine>, Asked);

/// Our own engines, shared by all cases, and what they say of their version.
pub(super) struct Roster {
    engines: Vec<Arc<dyn Engine>>,
    probed: BTreeMap<EngineName, Result<Version, Absent>>,
}

impl Roster {
    pub(super) fn new() -> Self {
        Self { engines: engines::all().into_iter().map(Arc::from).collect(), probed: BTreeMap::new() }
    }

    /// The engines of a case, in the order of reports.
    pub(super) fn chosen(&self, case: &Case, selection: &Selection) -> Result<Vec<Chosen>, SpecError> {
        let mut all = self.engines.clone();
        let built_in = names(&all);
        for (name, settings) in case.engines.iter().flatten().filter(|(name, _)| !built_in.contains(*name)) {
            if !settings.0.contains_key("command") {
                let place = case.source.error_at(&format!("engines.{name}"), "", "");
                let (message, known) = unknown(name, &built_in);
                let help = Some(format!("{known} A program of your own needs `command: [...]`"));
                return Err(SpecError { message, help, ..place });
            }
            let folder = case.path.parent().unwrap_or(Path::new(""));
            let engine = engines::external(name, &settings.0, folder).map_err(|error| {
                let help = "give `command: [program, arguments...]`, paths relative to the spec";
                case.source.error_at(&format!("engines.{name}"), error.to_string(), help)
            })?;
            all.push(Arc::from(engine));
        }
        let ids = names(&all);
        if let Some(name) = selection.engines.iter().find(|name| !ids.contains(*name)) {
            let (message, known) = unknown(name, &ids);
            return Err(SpecError::of("--engines", message, known));
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
                Some(Asked::ByDefault)
            }
        };
        Ok(all.into_iter().filter_map(|engine| asked(engine.as_ref()).map(|asked| (engine, asked))).collect())
    }

    /// The versions of those that are asked, side by side; those of our own list are remembered for the next case.
    pub(super) fn probe(
        &mut self,
        asked: &[Option<Arc<dyn Engine>>],
        site: &Site,
    ) -> Vec<Option<Result<Version, Absent>>> {
        let is_ours = |e: &Arc<dyn Engine>| self.engines.iter().any(|ours| Arc::ptr_eq(ours, e));
        let known = |e: &Arc<dyn Engine>| self.probed.get(&e.name()).filter(|_| is_ours(e)).cloned();
        let version = |e: &Arc<dyn Engine>| known(e).unwrap_or_else(|| e.probe(site));
        let found = side_by_side(asked.len(), asked, |e| e.as_ref().map(version));
        let answers = asked.iter().zip(&found).filter_map(|(e, found)| Some((e.as_ref()?, found.clone()?)));
        let ours: Vec<_> = answers.filter(|(e, _)| is_ours(e)).map(|(e, found)| (e.name(), found)).collect();
        self.probed.extend(ours);
        found
    }
}

/// What is wrong with a name that no engine has, and what to do.
fn unknown(name: &str, known: &[String]) -> (String, String) {
    (format!("there is no engine `{name}`"), suggestion(name, known.iter().map(String::as_str)))
}

fn names(engines: &[Arc<dyn Engine>]) -> Vec<String> {
    engines.iter().map(|e| e.name().to_string()).collect()
}
