//! Engines: everything that yields readings, renderers and our own solvers alike, behind one seam.
//!
//! Adding one: write `engines/<name>.rs` with a type that implements [`Engine`], and add its line to [`all`]; or leave this
//! program as it is and name a program of your own in a spec, see [`external`]. `docs/adding-an-engine.md` walks through both.

mod external;
#[cfg(test)]
pub(crate) mod fixtures;
mod iesna;
mod image;
mod install;
mod mitsuba;
mod povray;
mod radiance;
#[cfg(test)]
mod repetition_tests;
pub(crate) mod simulator;
mod site;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::time::Duration;

use luminaire::scene::{Meter, Obstacle, Scene, Shape, Transport};
use serde::{Deserialize, Serialize};

use crate::procedures::Task;
use crate::record::{EngineName, Estimate, MeterId, ProcedureId, Role, Uncertainty};
use crate::spec::Case;
use crate::system::process::{Invocation, PeakMemory, ProcessError};
use crate::system::slots::{Share, Slots};

pub use crate::spec::Budget;
pub use external::{ExternalJob, ExternalReadings};
pub use install::{InstallOutcome, InstallState, install};
pub use site::{Site, SiteError};

/// Every engine that luxproof knows, in the order of reports.
pub fn all() -> Vec<Box<dyn Engine>> {
    vec![
        Box::new(simulator::Simulator), // our own witnesses first
        Box::new(iesna::Iesna),
        Box::new(mitsuba::Mitsuba::default()),
        Box::new(radiance::Radiance),
        Box::new(povray::PovRay),
    ]
}

/// A program that a spec names as an engine of its own, `engines: {<name>: {command: [...]}}`; paths are relative to `folder`.
///
/// The error tells which setting is wrong, and how.
pub fn external(
    name: &str,
    settings: &BTreeMap<String, serde_json::Value>,
    folder: &Path,
) -> Result<Box<dyn Engine>, EngineError> {
    Ok(Box::new(external::External::new(name, settings, folder)?))
}

/// The component of every engine that gets its candela table from our own reader of photometric files.
pub const FILE_READER: &str = "luxproof's reader of photometric files";

/// The component of our own solvers, which look intensities up alike.
const OWN_LOOKUP: &str = "luminaire's interpolation of candela tables";

/// Something that reads illuminance at meters of a scene.
pub trait Engine: Send + Sync {
    /// Its name.
    fn name(&self) -> EngineName;

    /// What it takes part for.
    fn role(&self) -> Role {
        Role::Renderer
    }

    /// Whether others are judged by it.
    fn is_witness(&self) -> bool {
        self.role() == Role::Witness
    }

    /// Whether it can run here, and its version.
    fn probe(&self, site: &Site) -> Result<Version, Absent>;

    /// Whether it can do this job, exactly or nearly; decided from the job alone, before anything starts.
    fn supports(&self, job: &Job) -> Support;

    /// What it shares with other engines, by name: what one error would put off for all who have it. Witnesses that share a
    /// component count once; their own code need not be named.
    fn components(&self, _job: &Job) -> Vec<&'static str> {
        vec![FILE_READER]
    }

    /// The job as native files, runnable by hand; pure. Our own solvers have none.
    fn export(&self, job: &Job) -> Result<Vec<SceneFile>, EngineError>;

    /// The command that runs an exported scene, as a person would type it in the scene's folder; it names the engine that is
    /// installed at the site, or else relies on one on PATH.
    fn command_by_hand(&self, _job: &Job, _site: &Site) -> Option<String> {
        None
    }

    /// The settings whose effect on time and result is worth knowing, with values to try; `preset` first where there is one.
    fn knobs(&self) -> &'static [Knob] {
        &[]
    }

    /// Memory that a job takes on so many threads or processes, in MiB; an estimate on the safe side, of which as much runs side
    /// by side as there is room for. Twice what case S2 took and more, a process each.
    fn memory_mib(&self, job: &Job, threads: usize) -> u64 {
        threads as u64 * (256 + geometry_mib(job))
    }

    /// The job without what makes no difference to this engine's readings: two jobs that are equal then are one to it. For
    /// most, the names of case and procedure are comments.
    fn essence(&self, job: &Job) -> Job {
        Job { case: String::new(), ..job.clone() }
    }

    /// Runs the job in `workbench` and gives one estimate a station, in the stations' order.
    fn read(&self, job: &Job, workbench: &Workbench) -> Result<Measurement, EngineError>;
}

/// A setting of an engine with values worth trying.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Knob {
    /// Its key in a spec.
    pub key: &'static str,
    /// Values as YAML flow scalars, the default first.
    pub values: &'static [&'static str],
}

/// What of the machine an engine is given for a job: one thread for what is determined or quick, many for reflected light, whose
/// readings are as good as the seconds of the budget allow.
pub fn share(engine: &dyn Engine, job: &Job, slots: &Slots) -> Share {
    let threads = if job.transport == Transport::Direct { 1 } else { slots.threads_a_reading() };
    Share { threads, memory_mib: engine.memory_mib(job, threads) }
}

/// What meshes take in a renderer, about 1 KiB a triangle with its hierarchy, and meters in their read-out.
pub fn geometry_mib(job: &Job) -> u64 {
    let triangles = |o: &Obstacle| match &o.shape {
        Shape::Box { .. } => 12,
        Shape::Mesh { triangles, .. } => triangles.len(),
    };
    let triangles: usize = job.scene.obstacles.iter().map(triangles).sum();
    ((triangles + job.stations.len()) / 1024) as u64
}

/// One procedure of one case, as an engine is asked for it.
#[derive(Clone, Debug)]
pub struct Job {
    /// The case, for comments in exported scenes.
    pub case: String,
    pub procedure: ProcedureId,
    /// Room, obstacles and the luminaires that are on. No room means free field.
    pub scene: Scene,
    /// Where illuminance is read.
    pub stations: Vec<Station>,
    /// Which light counts.
    pub transport: Transport,
    /// When to stop.
    pub budget: Budget,
    /// Seed of every random choice.
    pub seed: u64,
    /// The engine's own settings from the spec, e.g. `variant: llvm_ad_mono`.
    pub settings: BTreeMap<String, serde_json::Value>,
}

impl Job {
    /// What an engine without settings is asked for a task of a case.
    pub fn of_task(case: &Case, task: &Task) -> Self {
        let station = |(id, meter)| Station { id, meter, expected_lx: None };
        Self {
            case: case.name.clone(),
            procedure: task.procedure,
            scene: task.scene.clone(),
            stations: task.stations().map(station).collect(),
            transport: task.transport,
            budget: case.budget,
            seed: 1,
            settings: BTreeMap::new(),
        }
    }
}

/// A meter with its name.
#[derive(Clone, Debug, PartialEq)]
pub struct Station {
    pub id: MeterId,
    /// Where it is and which way it looks.
    pub meter: Meter,
    /// What it is expected to read at most, in lux, if known: lets engines choose a read-out scale. Never copied to a result.
    pub expected_lx: Option<f64>,
}

/// An engine's version, as it names itself.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
#[serde(transparent)]
pub struct Version(pub String);

/// Why an engine is not there, and how to get it.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{reason}; {remedy}")]
pub struct Absent {
    pub reason: String,
    pub remedy: String,
}

/// Whether an engine can do a job.
#[derive(Clone, Debug, PartialEq)]
pub enum Support {
    /// To its full accuracy.
    Yes,
    /// With a known approximation.
    Approximate {
        /// What is approximated.
        why: String,
        /// Its size, relative.
        size: Option<f64>,
    },
    No(String),
}

/// A file of an exported scene.
#[derive(Clone, Debug, PartialEq)]
pub struct SceneFile {
    /// Its name within the scene's folder.
    pub name: String,
    pub bytes: Vec<u8>,
}

impl SceneFile {
    /// A text file.
    pub fn text(name: &str, text: impl Into<String>) -> Self {
        Self { name: name.to_owned(), bytes: text.into().into_bytes() }
    }
}

/// Where an engine works: its installation, its folders and what it may use.
#[derive(Clone, Debug)]
pub struct Workbench {
    /// Where engines are installed.
    pub site: Site,
    /// The folder of this job's scene files; exists, belongs to this job alone.
    pub scene_dir: PathBuf,
    /// The log that every process of this job appends its messages to.
    pub log: PathBuf,
    /// Threads or processes at a time.
    pub jobs: usize,
    /// Past this the job is killed.
    pub limit: Duration,
    /// Told of the memory that the job's processes took.
    pub peak: PeakMemory,
}

impl Workbench {
    /// An invocation in the scene's folder with this job's log and limit.
    pub fn invoke(&self, program: impl Into<PathBuf>) -> Invocation {
        Invocation { peak: self.peak.clone(), ..Invocation::new(program, &self.scene_dir, self.limit, &self.log) }
    }

    /// Writes exported files into the scene's folder.
    pub fn write(&self, files: &[SceneFile]) -> Result<(), EngineError> {
        for file in files {
            let path = self.scene_dir.join(&file.name);
            std::fs::write(&path, &file.bytes).map_err(|source| EngineError::io(&path, source))?;
        }
        Ok(())
    }
}

/// What an engine gives for a job.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Measurement {
    /// Illuminance in lux, one a station, in the stations' order.
    pub estimates: Vec<Estimate>,
    /// What was set, for whoever repeats it: samples, seeds, arguments, variant.
    pub settings: BTreeMap<String, String>,
    /// What the reader of the report should know of this run.
    pub notes: Vec<String>,
}

/// Why an engine that was there gave no reading.
#[derive(Debug, thiserror::Error)]
pub enum EngineError {
    /// A process failed.
    #[error(transparent)]
    Process(#[from] ProcessError),
    /// A file could not be written or read.
    #[error("{path}: {source}")]
    Io {
        /// The file.
        path: String,
        source: std::io::Error,
    },
    /// The program ended well but what it gave is not a result.
    #[error("{engine} exited without an error, but {what}")]
    Output { engine: EngineName, what: String },
    /// What it read is no number.
    #[error("{engine} exited without an error, but read {value} lx ({uncertainty:?}) at {meter}")]
    NotFinite { engine: EngineName, meter: MeterId, value: f64, uncertainty: Uncertainty },
    /// A setting from the spec makes no sense to the engine.
    #[error("engines.{engine}.{key}: {what}")]
    Setting {
        engine: EngineName,
        /// The setting.
        key: String,
        what: String,
    },
    /// It cannot do what was asked, as it says itself once it has seen the job: a skip, no failure.
    #[error("{engine} declines: {why}")]
    Declined { engine: EngineName, why: String },
    /// Our own solver gave up.
    #[error("{engine}: {what}")]
    Solver { engine: EngineName, what: String },
}

impl EngineError {
    /// A file error with its path.
    pub fn io(path: &Path, source: std::io::Error) -> Self {
        Self::Io { path: path.display().to_string(), source }
    }
}

/// Checks what every engine must hold: one finite, non-negative value a station.
pub fn checked(engine: &EngineName, job: &Job, measurement: Measurement) -> Result<Measurement, EngineError> {
    let (found, wanted) = (measurement.estimates.len(), job.stations.len());
    if found != wanted {
        return Err(EngineError::Output {
            engine: engine.clone(),
            what: format!("gave {found} readings for {wanted} meters"),
        });
    }
    for (estimate, station) in measurement.estimates.iter().zip(&job.stations) {
        let Estimate { value, uncertainty } = *estimate;
        let (engine, meter) = (engine.clone(), station.id.clone());
        if !value.is_finite() || !uncertainty.is_finite() {
            return Err(EngineError::NotFinite { engine, meter, value, uncertainty });
        }
        if value < 0.0 || !uncertainty.is_sound() {
            let what = format!("read {value} lx ({uncertainty:?}) at {meter}");
            return Err(EngineError::Output { engine, what });
        }
    }
    Ok(measurement)
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;
    use luminaire::scene::Scene;

    const ENGINE: EngineName = EngineName::new("test");

    fn job(stations: usize) -> Job {
        let meter = Meter { position_m: DVec3::ONE, normal: DVec3::Z };
        let station = |k| Station { id: MeterId::new("m", k), meter, expected_lx: None };
        Job {
            case: "case".into(),
            procedure: ProcedureId::DirectIlluminance,
            scene: Scene::default(),
            stations: (0..stations).map(station).collect(),
            transport: Transport::Direct,
            budget: Budget::default(),
            seed: 1,
            settings: BTreeMap::new(),
        }
    }

    fn measurement(values: &[f64]) -> Measurement {
        let estimate = |&value| Estimate { value, uncertainty: Uncertainty::sampled(0.0, None) };
        Measurement { estimates: values.iter().map(estimate).collect(), ..Measurement::default() }
    }

    #[test]
    fn missing_rows_nan_infinity_and_negative_readings_are_errors() {
        assert!(checked(&ENGINE, &job(2), measurement(&[1.0, 0.0])).is_ok());
        for bad in [&[1.0][..], &[1.0, f64::NAN], &[1.0, f64::INFINITY], &[-1e-9, 1.0], &[1.0, 1.0, 1.0]] {
            assert!(checked(&ENGINE, &job(2), measurement(bad)).is_err(), "{bad:?}");
        }
        let mut odd = measurement(&[1.0]);
        odd.estimates[0].uncertainty = Uncertainty::sampled(f64::NAN, None);
        assert!(checked(&ENGINE, &job(1), odd).is_err());
    }
}
