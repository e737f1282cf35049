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
mod engine_root;
mod external;
mod fingerprint;
/// Jobs with known answers, for tests here and in the crates above: a feature of its own would compile this crate twice.
#[doc(hidden)]
pub mod fixtures;
mod float_error;
mod frame;
mod iesna;
mod image;
mod install;
mod job_dir;
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
pub mod simulator;
mod tables;
mod type_c;
mod web;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

pub use blocks::Blocks;
pub use catalogue::{ALL, all, display_name, entry, is_chosen, is_on_request, look_alike, place};
pub use contract::{
    Absent, Answer, Component, CpuUse, Engine, Entry, FILE_READER, Job, Measurement, NoiseSummary, READ_OUT, Sensor,
    Setting, Support, Version, checked, hold, share,
};
use contract::{OWN_LOOKUP, geometry_mib};
pub use engine_root::{EngineRoot, EngineRootError};
pub use external::{ExternalAnswers, ExternalJob, ExternalProbe, ExternalRequest, Introduction};
pub use external::{RUN_IN, of_release, releases as releases_of_program};
pub use iesna::method as method_of_iesna;
pub use install::{InstallOutcome, InstallState, Soundness, install, locks, repair, verify};
pub use job_dir::{EngineError, JobDir, PartialMeasurement, SceneFile, SharedPrecompute};
pub use luxproof_spec::Budget;
pub use released::{Unknown, all_built_in, built_in};
pub use releases::{KnownRelease, installed_package, installed_release, releases_of};
pub use settings::Coordinates;

/// The engine that everybody has by this name, or else a program of the user's.
pub fn named(
    name: &str,
    settings: &BTreeMap<String, serde_json::Value>,
    folder: &Path,
) -> Result<Box<dyn Engine>, EngineError> {
    match built_in(name) {
        Ok(Some(engine)) => Ok(engine),
        Ok(None) => external(name, settings, folder),
        Err(unknown) => Err(EngineError::Solver { engine: name.into(), what: unknown.to_string() }),
    }
}

/// What a program says of itself that would be such an engine.
pub fn introduction(
    name: &str,
    settings: &BTreeMap<String, serde_json::Value>,
    folder: &Path,
    site: &EngineRoot,
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
