//! Mitsuba 3 (Jakob et al. 2022): its own emitter sampling and path integrator, read without meters in the scene.

mod backend;
mod export;
mod parse;
mod precision;
mod settings;
#[cfg(test)]
mod tests;

use std::sync::Mutex;

use luminaire::scene::{LuminaireModel, Shape, Transport};

use self::backend::Backend;
use self::settings::Settings;
use super::{Absent, Engine, EngineError, EngineId, Job, Measurement, SceneFile, Site, Support, Version, Workbench};

const ID: EngineId = EngineId("mitsuba");

/// Nearer than this to a surface, a point luminaire's spot is too small for paths to find, in parts of the scene's size.
const CLOSE: f64 = 2.5e-3;

/// The engine; remembers which variant works, so that it is tried out once.
#[derive(Debug, Default)]
pub(super) struct Mitsuba {
    backend: Mutex<Option<Backend>>,
}

impl Engine for Mitsuba {
    fn id(&self) -> EngineId {
        ID
    }

    fn probe(&self, site: &Site) -> Result<Version, Absent> {
        self.backend(site).map(|backend| backend.version())
    }

    fn supports(&self, job: &Job) -> Support {
        let has = |model| job.scene.luminaires.iter().any(|l| l.model == model);
        if has(LuminaireModel::Impostor) {
            return Support::No("Mitsuba has no impostor sources; use the model `point` or `area`".into());
        }
        if let (Some(id), Transport::Indirect(_) | Transport::Total(_)) =
            (luminaire_close_to_a_surface(job), job.transport)
        {
            let why = format!("paths seldom find the bright spot that `{id}` throws on a surface close by");
            return Support::Approximate { why, size: None };
        }
        Support::Yes
    }

    fn export(&self, job: &Job) -> Result<Vec<SceneFile>, EngineError> {
        export::files(job, &Settings::of(job)?)
    }

    fn read(&self, job: &Job, workbench: &Workbench) -> Result<Measurement, EngineError> {
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
        workbench: &Workbench,
    ) -> Result<Measurement, EngineError> {
        workbench.write(files)?;
        let backend = self.backend(&workbench.site).map_err(|absent| output(absent.to_string()))?;
        let (run, fallback) = backend.invocation(workbench, settings);
        let finished = run.run()?;
        let mut measurement = parse::measurement(&finished.stdout, job, settings)?;
        measurement.notes.extend(fallback);
        measurement.settings.insert("command".into(), run.command_line());
        super::checked(ID, job, measurement)
    }

    fn backend(&self, site: &Site) -> Result<Backend, Absent> {
        let mut known = self.backend.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
        match known.as_ref().filter(|b| b.is_of(site)) {
            Some(backend) => Ok(backend.clone()),
            None => Ok(known.insert(Backend::find(site)?).clone()),
        }
    }
}

fn output(what: String) -> EngineError {
    EngineError::Output { engine: ID, what }
}

/// A luminaire whose light a surface receives at a distance that is tiny against the scene.
fn luminaire_close_to_a_surface(job: &Job) -> Option<&str> {
    let room = job.scene.room?;
    let close_m = CLOSE * room.size_m.max_element();
    let near = |l: &&luminaire::scene::Luminaire| {
        let in_box = |shape: &Shape| match shape {
            Shape::Box { min_m, max_m } => l.position_m.clamp(*min_m, *max_m).distance(l.position_m) < close_m,
            Shape::Mesh { .. } => false,
        };
        !room.contains(l.position_m, close_m) || job.scene.obstacles.iter().any(|o| in_box(&o.shape))
    };
    job.scene.luminaires.iter().find(near).map(|l| l.id.as_str())
}
