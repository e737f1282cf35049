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
    Absent, Component, Engine, EngineError, Entry, Job, Knob, Measurement, SceneFile, Site, Support, Version, Workbench,
};
use crate::record::EngineName;

const ID: EngineName = EngineName::new("cycles");

pub(super) static ENTRY: Entry = Entry {
    name: ID,
    display_name: "Cycles",
    colour: ("#b4540a", "#f0995a"),
    installs: &[Component::Blender, Component::Libraries(&X11)],
    is_on_request: true,
    models: &[luminaire::scene::LuminaireModel::Point, luminaire::scene::LuminaireModel::Area],
    fits_coordinates: Some("recentre"),
    make: || Box::new(Cycles),
};

const PACKAGE: Package = Package {
    engine: ID,
    name: "Blender",
    module: "bpy",
    site: Site::blender,
    libraries: &X11,
    probe: include_str!("../../drivers/cycles_probe.py"),
    driver: "cycles_read.py",
    remedy: "run `luxproof engines install cycles`",
    python: "python3.11",
    ray_s: 1e-6,
    seat: 0.25,
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

    fn probe(&self, site: &Site) -> Result<Version, Absent> {
        PACKAGE.probe(site)
    }

    fn supports(&self, job: &Job) -> Support {
        patches::supports(&ENTRY, job, (STOCK, None))
    }

    fn export(&self, job: &Job) -> Result<Vec<SceneFile>, EngineError> {
        export::files(job, Settings::of(job, &ID)?)
    }

    fn command_by_hand(&self, _job: &Job, site: &Site) -> Option<String> {
        Some(PACKAGE.command_by_hand(site))
    }

    fn expected_s(&self, job: &Job) -> Option<f64> {
        DirectCost { start: 0.75, a_point: 6e-4, an_opening: None }.of(job)
    }

    fn knobs(&self) -> &'static [Knob] {
        settings::KNOBS
    }

    fn check_settings(&self, job: &Job) -> Result<(), EngineError> {
        Settings::of(job, &ID).map(drop)
    }

    /// One process, whatever its threads.
    fn memory_mib(&self, job: &Job, _threads: usize) -> u64 {
        768 + super::geometry_mib(job)
    }

    fn read(&self, job: &Job, workbench: &Workbench) -> Result<Measurement, EngineError> {
        let settings = Settings::of(job, &ID)?;
        read_files(&export::files(job, settings)?, job, settings, workbench)
    }
}

fn read_files(
    files: &[SceneFile],
    job: &Job,
    settings: Settings,
    workbench: &Workbench,
) -> Result<Measurement, EngineError> {
    PACKAGE.read(files, job, settings, workbench, LookedUp::of, ies::EDGE_DEG)
}
