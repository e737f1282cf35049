//! Engines: everything that yields readings, renderers and our own solvers alike, behind one seam.
//!
//! Adding one: write `engines/<name>.rs` with a type that implements [`Engine`] and its [`Entry`], and add its line to
//! `catalogue`; or leave this program as it is and name a program of your own in a spec, see `external`.
//! `docs/adding-an-engine.md` walks through both.

mod blocks;
mod catalogue;
mod cells;
mod comment;
mod contract;
mod cost;
mod cycles;
mod dialogue;
mod effort;
mod external;
mod fingerprint;
#[cfg(test)]
pub(crate) mod fixtures;
mod float_error;
mod frame;
mod iesna;
mod image;
mod install;
mod joined;
mod libraries;
mod luxcore;
mod meshes;
mod mitsuba;
mod openings;
mod patches;
mod povray;
mod radiance;
mod recess;
mod released;
mod releases;
#[cfg(test)]
mod repetition_tests;
mod settings;
#[cfg(test)]
mod shared_tests;
pub(crate) mod simulator;
mod site;
mod tables;
mod type_c;
mod web;
mod workbench;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

pub use crate::spec::Budget;
pub use blocks::Blocks;
pub use catalogue::{ALL, all, display_name, entry, is_chosen, is_on_request, place};
pub use contract::{
    Absent, Answer, Component, Engine, Entry, FILE_READER, Forgotten, Job, Knob, Measurement, Station, Support,
    Version, Waits, checked, hold, share,
};
use contract::{OWN_LOOKUP, geometry_mib};
pub use external::{ExternalAnswers, ExternalJob, ExternalProbe, ExternalReadings, ExternalRequest, Introduction};
pub(crate) use external::{RUN_IN, of_release, releases as releases_of_program};
pub(crate) use iesna::method as method_of_iesna;
pub use install::{InstallOutcome, InstallState, Soundness, install, locks, repair, verify};
pub use released::{Unknown, all_built_in, built_in};
pub use releases::{Known, releases_of};
pub use settings::Coordinates;
pub use site::{Site, SiteError};
pub use workbench::{EngineError, Groundwork, Rest, SceneFile, Workbench};

/// The engine that everybody has by this name, or else a program of the user's.
pub fn named(
    name: &str,
    settings: &BTreeMap<String, serde_json::Value>,
    folder: &Path,
) -> Result<Box<dyn Engine>, EngineError> {
    let unknown = |unknown: Unknown| EngineError::Solver { engine: name.into(), what: unknown.to_string() };
    built_in(name).map_err(unknown)?.map_or_else(|| external(name, settings, folder), Ok)
}

/// What a program says of itself that would be such an engine.
pub fn introduction(
    name: &str,
    settings: &BTreeMap<String, serde_json::Value>,
    folder: &Path,
    site: &Site,
) -> Result<Introduction, EngineError> {
    Ok(external::External::new(name, settings, folder)?.introduction(site))
}

/// The files of a program that a spec names, its interpreter and what is installed left out.
pub fn files_of_program(
    name: &str,
    settings: &BTreeMap<String, serde_json::Value>,
    folder: &Path,
) -> Result<Vec<PathBuf>, EngineError> {
    Ok(external::External::new(name, settings, folder)?.own_files())
}

/// A program that a spec names as an engine of its own, `engines: {<name>: {command: [...]}}`; paths are relative to `folder`.
pub fn external(
    name: &str,
    settings: &BTreeMap<String, serde_json::Value>,
    folder: &Path,
) -> Result<Box<dyn Engine>, EngineError> {
    Ok(type_c::InTypeC::program(Box::new(external::External::new(name, settings, folder)?)))
}
