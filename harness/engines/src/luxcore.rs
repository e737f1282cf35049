//! LuxCore: its own point lights, emission maps and path tracer, read by looking at small white patches.

mod export;
mod map;
#[cfg(test)]
pub(super) mod tests;

use self::map::Map;
use super::cost::DirectCost;
use super::libraries::ATOMIC;
use super::patches::settings::{self, Settings};
use super::patches::{self, Package};
use super::settings::Preset;
use super::{
    Absent, Component, Engine, EngineError, EngineRoot, Entry, Job, JobDir, Measurement, SceneFile, Setting, Support,
    Version,
};
use luxproof_model::EngineName;

const ID: EngineName = EngineName::new("luxcore");

pub(super) static ENTRY: Entry = Entry {
    name: ID,
    display_name: "LuxCore",
    installs: &[Component::LuxCore, Component::Libraries(&ATOMIC)],
    is_on_request: true,
    models: &[luxproof_scene::LuminaireModel::Point, luxproof_scene::LuminaireModel::Area],
    fits_coordinates: Some("recentre"),
    make: || Box::new(LuxCore),
};

const PACKAGE: Package = Package {
    engine: ID,
    name: "LuxCore",
    module: "pyluxcore",
    site: EngineRoot::luxcore,
    libraries: &ATOMIC,
    probe: include_str!("../drivers/luxcore_probe.py"),
    driver: "luxcore_read.py",
    remedy: "run `luxproof engines install luxcore`",
    python: "python3.11",
    ray_s: 1e-6,
    patch_offset: 0.1,
    is_cut_by_its_plane: true,
    apart: 2.0,
};

/// What becomes of light in a scene without settings.
const STOCK: &str = "as installed, LuxCore drops the candela of IES files: a point light of P lm sends out P / 4 pi. It joins zenith to \
                     nadir, where half of either is lost, looks tables up by .7 degrees in C and gamma, and follows few reflections";
/// What is lost by the first of these.
const STOCK_LOSS: f64 = 1.0 - 0.25 / std::f64::consts::PI;

/// What is done for its reader of IES files, so that there is something to be judged.
const OWN_READER: &str = "LuxCore's reader of IES files drops the candela: it got the flux that luxproof reads in the file, so that \
                          factors of a whole file cannot show";

pub(super) struct LuxCore;

impl Engine for LuxCore {
    fn name(&self) -> EngineName {
        ID
    }

    fn reads_files(&self, job: &Job) -> bool {
        Settings::of(job, &ID).is_ok_and(Settings::is_native)
    }

    fn probe(&self, site: &EngineRoot) -> Result<Version, Absent> {
        PACKAGE.probe(site)
    }

    fn supports(&self, job: &Job) -> Support {
        patches::supports(&ENTRY, job, (STOCK, Some(STOCK_LOSS)))
    }

    fn export(&self, job: &Job) -> Result<Vec<SceneFile>, EngineError> {
        export::files(job, Settings::of(job, &ID)?)
    }

    fn command_by_hand(&self, _job: &Job, site: &EngineRoot) -> Option<String> {
        Some(PACKAGE.command_by_hand(site))
    }

    fn expected_s(&self, job: &Job) -> Option<f64> {
        DirectCost { start: 0.2, a_point: 6.5e-3, an_opening: None }.of(job)
    }

    fn settings(&self) -> &'static [Setting] {
        settings::SETTINGS
    }

    fn check_settings(&self, job: &Job) -> Result<(), EngineError> {
        Settings::of(job, &ID).map(drop)
    }

    /// One process with a scene a thread.
    fn memory_mib(&self, job: &Job, threads: usize) -> u64 {
        512 + threads as u64 * (128 + super::geometry_mib(job))
    }

    fn read(&self, job: &Job, workbench: &JobDir) -> Result<Measurement, EngineError> {
        let settings = Settings::of(job, &ID)?;
        read_files(&export::files(job, settings)?, job, settings, workbench)
    }
}

fn read_files(
    files: &[SceneFile],
    job: &Job,
    settings: Settings,
    workbench: &JobDir,
) -> Result<Measurement, EngineError> {
    let mut measurement = PACKAGE.read(files, job, settings, workbench, Map::of, 0.0)?;
    if settings.is_native() && settings.preset != Preset::Default {
        measurement.notes.push(OWN_READER.to_owned());
    }
    Ok(measurement)
}
