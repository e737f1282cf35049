//! Cycles (Blender): its own lights, IES textures and path tracer, read by baking small white patches.
//!
//! Blender is GPL: it stays a program of its own behind our driver (`drivers/cycles_read.py`), and nothing of it is linked or kept here.

mod export;
mod ies;
#[cfg(test)]
pub(super) mod tests;

use self::ies::LookedUp;
use super::cost::DirectCost;
use super::libraries::X11;
use super::patches::settings::{self, Settings};
use super::patches::{self, Package};
use super::{
    Absent, Component, Engine, EngineError, EngineRoot, Entry, Job, JobDir, Measurement, SceneFile, Setting, Support,
    Version,
};
use luxproof_model::EngineName;

const ID: EngineName = EngineName::new("cycles");

pub(super) static ENTRY: Entry = Entry {
    name: ID,
    display_name: "Cycles",
    installs: &[Component::Blender, Component::Libraries(&X11)],
    is_on_request: true,
    models: &[luxproof_scene::LuminaireModel::Point, luxproof_scene::LuminaireModel::Area],
    fits_coordinates: Some("recentre"),
    make: || Box::new(Cycles),
};

const PACKAGE: Package = Package {
    engine: ID,
    name: "Blender",
    module: "bpy",
    site: EngineRoot::blender,
    libraries: &X11,
    probe: include_str!("../drivers/cycles_probe.py"),
    driver: "cycles_read.py",
    remedy: "run `luxproof engines install cycles`",
    python: "python3.11",
    ray_s: 1e-6,
    patch_offset: 0.25,
    is_cut_by_its_plane: false,
    apart: 10.0,
};

/// What becomes of light in a scene without settings.
const STOCK: &str = "as installed, Cycles mirrors the C planes of IES files, bends between their angles, is up to an eighth off where \
                     planes begin and end, clamps reflected light and follows four reflections";

pub(super) struct Cycles;

impl Engine for Cycles {
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
        patches::supports(&ENTRY, job, (STOCK, None))
    }

    fn export(&self, job: &Job) -> Result<Vec<SceneFile>, EngineError> {
        export::files(job, Settings::of(job, &ID)?)
    }

    fn command_by_hand(&self, _job: &Job, site: &EngineRoot) -> Option<String> {
        Some(PACKAGE.command_by_hand(site))
    }

    fn expected_s(&self, job: &Job) -> Option<f64> {
        DirectCost { start: 0.75, a_point: 6e-4, an_opening: None }.of(job)
    }

    fn settings(&self) -> &'static [Setting] {
        settings::SETTINGS
    }

    fn check_settings(&self, job: &Job) -> Result<(), EngineError> {
        Settings::of(job, &ID).map(drop)
    }

    /// One process, whatever its threads.
    fn memory_mib(&self, job: &Job, _threads: usize) -> u64 {
        768 + super::geometry_mib(job)
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
    PACKAGE.read(files, job, settings, workbench, LookedUp::of, ies::EDGE_DEG)
}
