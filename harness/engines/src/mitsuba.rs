//! Mitsuba 3 (Jakob et al. 2022): its own emitter sampling and path integrator, read without meters in the scene.

mod backend;
mod export;
mod settings;
#[cfg(test)]
pub(super) mod tests;

use std::path::Path;

use glam::DVec3;
use luxproof_scene::contact;
use luxproof_scene::geometry::{Room, Surface};
use luxproof_scene::{Luminaire, LuminaireModel, Shape, Transport, flush};
use parking_lot::Mutex;

use self::backend::Backend;
use self::settings::{Integrator, Settings};
use super::cost::DirectCost;
use super::dialogue::{Cost, Dialogue};
use super::float_error::{FloatError, Instrument};
use super::frame::Frame;
use super::libraries::ATOMIC;
use super::settings::Preset;
use super::{
    Absent, Component, Engine, EngineError, EngineRoot, Entry, Job, JobDir, Measurement, SceneFile, Sensor, Setting,
    Support, Version,
};
use luxproof_model::EngineName;

const ID: EngineName = EngineName::new("mitsuba");

pub(super) static ENTRY: Entry = Entry {
    name: ID,
    display_name: "Mitsuba",
    installs: &[Component::PythonPackages, Component::LibLlvm, Component::Libraries(&ATOMIC)],
    is_on_request: false,
    models: &[LuminaireModel::Point, LuminaireModel::Area],
    fits_coordinates: Some("recentre"),
    make: || Box::new(Mitsuba::default()),
};

/// Nearer than this to a surface, a point luminaire's spot is too small for paths to find, in parts of the scene's size.
const CLOSE: f64 = 2.5e-3;

/// What every machine with a usable NVIDIA GPU has.
const NVIDIA_DEVICE: &str = "/dev/nvidiactl";

/// Nearer than this to a surface that it faces, in parts of the scene's size, a meter gets its light from few particles.
const CLOSE_FACING: f64 = 0.02;

/// So far outside a table's range our emitter takes a direction for its last angle (`EDGE_DEG` of `mitsuba_goniometric.py`).
const EDGE_DEG: f64 = 5e-5;

/// Seconds that are counted for a ray: on two cores of a usual server, half as much again as was measured there. Where no kernels
/// are compiled a path costs much.
fn cost(variant: &str) -> Cost {
    if variant.starts_with("scalar") {
        Cost { ray_s: 1e-4, trial_side: Some(2) }
    } else {
        Cost { ray_s: 2e-7, trial_side: None }
    }
}

/// The engine; remembers which variant works, so that it is tried out once.
#[derive(Debug, Default)]
pub(super) struct Mitsuba {
    backend: Mutex<Option<Backend>>,
}

impl Engine for Mitsuba {
    fn name(&self) -> EngineName {
        ID
    }

    fn reads_meters_independently(&self) -> bool {
        true
    }

    fn probe(&self, site: &EngineRoot) -> Result<Version, Absent> {
        self.backend(site).map(|backend| backend.version())
    }

    fn supports(&self, job: &Job) -> Support {
        let stock = Settings::of(job).is_ok_and(|s| s.preset == Preset::Default);
        let objection = ENTRY.objection(job).or_else(|| export::obstacle_to_stock(job).filter(|_| stock));
        if let Some(why) = objection {
            return Support::No(why);
        }
        let settings = Settings::of(job).ok();
        if settings.is_some_and(|settings| settings.is_on_gpu()) && !Path::new(NVIDIA_DEVICE).exists() {
            return Support::No(format!("a variant for NVIDIA GPUs, and this machine has none ({NVIDIA_DEVICE})"));
        }
        if job.transport == Transport::Direct {
            return Support::Yes;
        }
        if settings.is_some_and(|settings| settings.integrator == Integrator::Particles) {
            return match meter_close_to_what_it_faces(job) {
                Some(id) => {
                    let why =
                        format!("single particles next to `{id}`, which faces a surface close by, outweigh all others");
                    Support::Approximate { why, size: None }
                }
                None => Support::Yes,
            };
        }
        if let Some(id) = luminaire_close_to_a_surface(job) {
            let why = format!("paths seldom find the bright spot that `{id}` throws on a surface close by");
            return Support::Approximate { why, size: None };
        }
        Support::Yes
    }

    fn export(&self, job: &Job) -> Result<Vec<SceneFile>, EngineError> {
        export::files(job, &Settings::of(job)?)
    }

    fn command_by_hand(&self, _job: &Job, site: &EngineRoot) -> Option<String> {
        let plain = "python3 mitsuba_read.py job.json".to_owned();
        Some(self.backend(site).map_or(plain, |backend| backend.command_by_hand(site)))
    }

    fn expected_s(&self, job: &Job) -> Option<f64> {
        DirectCost { start: 0.45, a_point: 1e-4, an_opening: Some(2e-3) }.of(job)
    }

    fn settings(&self) -> &'static [Setting] {
        settings::SETTINGS
    }

    fn check_settings(&self, job: &Job) -> Result<(), EngineError> {
        Settings::of(job).map(drop)
    }

    /// One process, whatever its threads: Python, LLVM, and a wavefront of paths.
    fn memory_mib(&self, job: &Job, _threads: usize) -> u64 {
        1024 + super::geometry_mib(job)
    }

    fn read(&self, job: &Job, workbench: &JobDir) -> Result<Measurement, EngineError> {
        let settings = Settings::of(job)?;
        self.read_files(&export::files(job, &settings)?, job, &settings, workbench)
    }
}

impl Mitsuba {
    fn read_files(
        &self,
        files: &[SceneFile],
        job: &Job,
        settings: &Settings,
        workbench: &JobDir,
    ) -> Result<Measurement, EngineError> {
        workbench.write(files)?;
        let backend = self.backend(&workbench.site).map_err(|absent| EngineError::output(ID, absent.to_string()))?;
        let (run, fallback) = backend.invocation(workbench, settings);
        let instrument = Instrument { edge_deg: EDGE_DEG, ..Instrument::default() };
        let error = FloatError::of(job, Frame::of(job, settings.coordinates), instrument);
        let dialogue = Dialogue {
            engine: ID,
            job,
            workbench,
            conversation: run.converse(workbench.idle.as_ref())?,
            until: workbench.until(),
            fixed: (settings.preset != Preset::Audit).then_some((settings::FIXED_BLOCKS, settings::FIXED_SIDE)),
            cost: &cost,
            bound_lx: &|k, _| error.at_lx(k),
            relative_bound: 0.0,
            misled: 0.0,
        };
        let mut measurement = dialogue.measurement()?;
        measurement.notes.extend(fallback);
        measurement.effort.insert("command".into(), run.command_line());
        super::checked(&ID, job, measurement)
    }

    fn backend(&self, site: &EngineRoot) -> Result<Backend, Absent> {
        let mut known = self.backend.lock();
        match known.as_ref().filter(|b| b.is_of(site)) {
            Some(backend) => Ok(backend.clone()),
            None => Ok(known.insert(Backend::find(site)?).clone()),
        }
    }
}

/// A meter that faces a wall, floor or ceiling at a distance that is small against the scene.
fn meter_close_to_what_it_faces(job: &Job) -> Option<&str> {
    let room = job.scene.room?;
    let close_m = CLOSE_FACING * room.size_m.max_element();
    let faces_close_by = |sensor: &&Sensor| {
        Surface::ALL.into_iter().any(|s| {
            let inward = s.inward_normal();
            let distance_m = (sensor.meter.position_m - room.corners(s)[0]).dot(inward);
            sensor.meter.normal.dot(inward) < -1e-6 && distance_m < close_m
        })
    };
    job.sensors.iter().find(faces_close_by).map(|sensor| sensor.id.0.as_str())
}

/// A luminaire that lights a surface at a distance that is tiny against the scene.
pub(super) fn luminaire_close_to_a_surface(job: &Job) -> Option<&str> {
    let room = job.scene.room?;
    let close_m = CLOSE * room.size_m.max_element();
    let mut luminaires = job.scene.luminaires.iter();
    let found = luminaires.find(|l| lights_room_close_by(l, &room, close_m) || lights_body_close_by(l, job, close_m));
    found.map(|l| l.id.as_str())
}

/// Whether a luminaire sends light to the nearest point of a surface of the room that is close by. What one in the plane of
/// a surface sends into it is lost.
fn lights_room_close_by(luminaire: &Luminaire, room: &Room, close_m: f64) -> bool {
    let own = flush::surface_of(room, luminaire);
    Surface::ALL.into_iter().filter(|s| own != Some(*s)).any(|s| {
        let distance_m = (luminaire.position_m - room.corners(s)[0]).dot(s.inward_normal());
        lights(luminaire, -s.inward_normal() * distance_m, close_m)
    })
}

/// The same for boxes in the room. What one that lies on a body sends into that is lost.
fn lights_body_close_by(luminaire: &Luminaire, job: &Job, close_m: f64) -> bool {
    let at_m = luminaire.position_m;
    let has_box_close_by = job.scene.obstacles.iter().any(|o| match o.shape {
        Shape::Box { min_m, max_m } => lights(luminaire, at_m.clamp(min_m, max_m) - at_m, close_m),
        Shape::Mesh { .. } => false,
    });
    has_box_close_by && contact::normal_of(&job.scene.obstacles, luminaire).is_none()
}

/// Whether a luminaire sends light along a path that is short.
fn lights(luminaire: &Luminaire, path: DVec3, close_m: f64) -> bool {
    path.length() < close_m && luminaire.intensity_towards(path).value() > 0.0
}
