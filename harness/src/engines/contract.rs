//! The contract between the program and an engine: what an engine is asked, what it gives, and what is known of it.

use std::collections::BTreeMap;
use std::path::PathBuf;

use glam::DVec3;
use luminaire::scene::{Bounces, LuminaireModel, Meter, Scene, Shape, Transport};
use serde::{Deserialize, Serialize};

use super::blocks::{Blocks, Sampled};
use super::libraries::Libraries;
use super::releases::Known;
use super::workbench::{EngineError, Rest, SceneFile, Workbench};
use super::{Site, fingerprint};
use crate::procedures::{Target, Task};
use crate::record::{Effort, EngineName, Estimate, Light, MeterId, Method, ProcedureId, Role, Uncertainty};
use crate::spec::{Budget, Case};
use crate::system::slots::{Held, Share, Slots};

/// The component of every engine that gets its candela table from our own reader of photometric files.
pub const FILE_READER: &str = "luxproof's reader of photometric files";

/// The component of our own solvers, which look intensities up alike.
pub(super) const OWN_LOOKUP: &str = "luminaire's interpolation of candela tables";

/// What an engine answers to one of several jobs.
pub type Answer = Result<Measurement, EngineError>;

/// How much of its time a job sleeps: others compute while it does, and what sleeps most is begun first.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Waits {
    /// It holds no thread.
    Mostly,
    /// It holds half of its threads.
    Often,
    Little,
}

pub trait Engine: Send + Sync {
    fn name(&self) -> EngineName;

    fn role(&self) -> Role {
        Role::Renderer
    }

    fn is_witness(&self) -> bool {
        self.role() == Role::Witness
    }

    /// Whether a witness has to sample what the job asks, so that it should be no finer than its use.
    fn samples(&self, _job: &Job) -> bool {
        false
    }

    /// Whether its driver is ours, which has seen how its blocks scatter: what others state of their errors is looked into.
    fn is_vouched_for(&self) -> bool {
        true
    }

    /// Whether its own reader gets the user's files, so that nothing of what our reader says of a table follows for it.
    fn reads_files(&self, _job: &Job) -> bool {
        false
    }

    /// Whether what it reads of a job may be put together of jobs for some of its meters each, with seeds of their own: every reading and its
    /// error hold whichever other meters are asked. Of a user's program nobody knows that, and what it reads is what is audited.
    fn reads_meters_apart(&self) -> bool {
        false
    }

    fn probe(&self, site: &Site) -> Result<Version, Absent>;

    /// Whether it can do this job, exactly or nearly; decided from the job alone, before anything starts.
    fn supports(&self, job: &Job) -> Support;

    /// What it shares with other engines, by name: what one error would put off for all who have it. Witnesses that share a
    /// component count once; their own code need not be named.
    fn components(&self, _job: &Job) -> Vec<String> {
        vec![FILE_READER.to_owned()]
    }

    /// The job as native files, runnable by hand; pure. Our own solvers have none.
    fn export(&self, _job: &Job) -> Result<Vec<SceneFile>, EngineError> {
        Ok(vec![])
    }

    /// Planes over the full circle that a table of its scenes holds at most; `None` where there is no limit.
    fn most_planes(&self) -> Option<usize> {
        None
    }

    /// The command that runs an exported scene, as a person would type it in the scene's folder; it names the engine that is
    /// installed at the site, or else relies on one on PATH.
    fn command_by_hand(&self, _job: &Job, _site: &Site) -> Option<String> {
        None
    }

    /// The settings whose effect on time and result is worth knowing, with values to try; `preset` first where there is one.
    fn knobs(&self) -> &'static [Knob] {
        &[]
    }

    /// What is wrong with its settings, from the job alone, before anything starts.
    fn check_settings(&self, job: &Job) -> Result<(), EngineError> {
        only_known(&self.name(), job, self.knobs())
    }

    /// Processor seconds that a job is expected to take, further looks among them, with the budget of its first look; `None` where nobody
    /// knows, as of a program of a user's.
    fn expected_s(&self, _job: &Job) -> Option<f64> {
        None
    }

    /// How much of its time a job sleeps.
    fn waits(&self, _job: &Job) -> Waits {
        Waits::Little
    }

    /// Memory that a job takes on so many threads or processes, in MiB; an estimate on the safe side, of which as much runs side
    /// by side as there is room for. Twice what case S2 took and more, a process each.
    fn memory_mib(&self, job: &Job, threads: usize) -> u64 {
        threads as u64 * (256 + geometry_mib(job))
    }

    /// The job without what makes no difference to this engine's readings: two jobs that are equal then are one to it. For
    /// most, the names of case and procedure are comments.
    fn cache_identity(&self, job: &Job) -> Job {
        job.without_names()
    }

    /// The job without what makes no difference to a part of the work that other jobs share: what is found of its scene before any meter is
    /// read, or of its meters however often light is reflected. It is the same whoever finds it.
    fn groundwork(&self, _job: &Job) -> Option<Job> {
        None
    }

    /// Runs the job in `workbench` and gives one estimate a station, in the stations' order.
    fn read(&self, job: &Job, workbench: &Workbench) -> Result<Measurement, EngineError>;

    /// Whether it is better asked for several jobs at once.
    fn takes_batches(&self) -> bool {
        false
    }

    /// Runs several jobs, each with a workbench for its files, in one that is of all; one answer a job, in their order, or one error for all.
    fn read_all(&self, jobs: &[(&Job, &Workbench)], _together: &Workbench) -> Result<Vec<Answer>, EngineError> {
        Ok(jobs.iter().map(|(job, workbench)| self.read(job, workbench)).collect())
    }

    /// Threads or processes that it makes use of at most.
    fn max_threads(&self) -> usize {
        usize::MAX
    }

    /// Seconds that it may take before it begins to work, on a busy machine.
    fn start_s(&self) -> f64 {
        120.0
    }
}

/// What one engine that stands before another leaves to it.
macro_rules! left_to_inner {
    () => {
        fn role(&self) -> Role {
            self.inner.role()
        }

        fn samples(&self, job: &Job) -> bool {
            self.inner.samples(job)
        }

        fn is_vouched_for(&self) -> bool {
            self.inner.is_vouched_for()
        }

        fn reads_files(&self, job: &Job) -> bool {
            self.inner.reads_files(job)
        }

        fn reads_meters_apart(&self) -> bool {
            self.inner.reads_meters_apart()
        }

        fn most_planes(&self) -> Option<usize> {
            self.inner.most_planes()
        }

        fn knobs(&self) -> &'static [Knob] {
            self.inner.knobs()
        }

        fn cache_identity(&self, job: &Job) -> Job {
            self.inner.cache_identity(job)
        }

        fn groundwork(&self, job: &Job) -> Option<Job> {
            self.inner.groundwork(job)
        }

        fn waits(&self, job: &Job) -> crate::engines::Waits {
            self.inner.waits(job)
        }

        fn takes_batches(&self) -> bool {
            self.inner.takes_batches()
        }

        fn max_threads(&self) -> usize {
            self.inner.max_threads()
        }

        fn start_s(&self) -> f64 {
            self.inner.start_s()
        }
    };
}
pub(super) use left_to_inner;

/// What is known of an engine of our own before it is asked anything; `super::catalogue` lists them.
pub struct Entry {
    pub name: EngineName,
    /// As its makers write it.
    pub display_name: &'static str,
    /// Of its mark in plots: on paper and on black.
    pub colour: (&'static str, &'static str),
    /// What `luxproof engines install` fetches for it.
    pub installs: &'static [Component],
    /// Whether it takes part, and is installed, only where it is named: it is large.
    pub is_on_request: bool,
    pub models: &'static [LuminaireModel],
    /// The setting that, `false`, leaves it the coordinates of the spec, where it would get handier ones.
    pub fits_coordinates: Option<&'static str>,
    pub make: fn() -> Box<dyn Engine>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Component {
    /// Mitsuba, Radiance and what reads POV-Ray's images, as `engines.lock` pins them.
    PythonPackages,
    PovRay,
    LibLlvm,
    /// Of the system, which Python packages take for granted.
    Libraries(&'static Libraries),
    /// It gives rtrace's random numbers a seed.
    LibFaketime,
    /// Node.js, the renderers of the web and what drives a browser, as `web/` pins them.
    WebPackages,
    /// A browser that runs without a screen.
    Chromium,
    /// Blender as a Python package, as `blender.lock` pins it, in an environment of its own.
    Blender,
    /// LuxCore as a Python package, as `luxcore.lock` pins it, in an environment of its own.
    LuxCore,
    /// The Python packages of a release, in an environment of its own.
    Release(&'static Known),
}

impl Component {
    /// Whether it is the environment that an engine's Python packages are in.
    pub(super) const fn is_python(self) -> bool {
        matches!(self, Self::PythonPackages | Self::Blender | Self::LuxCore)
    }
}

impl Entry {
    pub fn objection(&self, job: &Job) -> Option<String> {
        let other = job.scene.luminaires.iter().find(|l| !self.models.contains(&l.model))?;
        let known = self.models.iter().map(|m| format!("`{}`", m.name())).collect::<Vec<_>>().join(" or ");
        let (name, model) = (self.display_name, other.model.name());
        Some(format!("{}: {name} has no source of the model `{model}`; use {known}", other.id))
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Knob {
    pub key: &'static str,
    /// Values as YAML flow scalars, the default first.
    pub values: &'static [&'static str],
}

/// What of the machine an engine is given for a job: none for what sleeps, one thread for what is determined or quick, many for reflected
/// light, whose readings are as good as the seconds of the budget allow.
pub fn share(engine: &dyn Engine, job: &Job, slots: &Slots) -> Share {
    let threads = match job.transport {
        _ if engine.waits(job) == Waits::Mostly => 0,
        Transport::Direct => 1,
        Transport::Indirect(_) | Transport::Total(_) => slots.threads_a_reading().min(engine.max_threads()),
    };
    Share { threads, memory_mib: engine.memory_mib(job, threads.max(1)) }
}

/// What it holds of its share: renderers wait for much of their time, at their start and for the last of their processes, so that two readings
/// of reflected light work with the same threads. They count their seconds with room for that; a program of a user's, which goes by the clock,
/// has its share for itself.
pub fn hold<'s>(engine: &dyn Engine, job: &Job, share: Share, slots: &'s Slots) -> Held<'s> {
    let threads = if engine.is_vouched_for() { share.threads.div_ceil(2) } else { share.threads };
    let share = Share { threads, ..share };
    if engine.waits(job) == Waits::Often { slots.take_half(share) } else { slots.take(share) }
}

/// What meshes take in a renderer, about 1 KiB a triangle with its hierarchy, and meters in their read-out.
pub(super) fn geometry_mib(job: &Job) -> u64 {
    let triangles: usize = job.scene.obstacles.iter().map(|o| o.shape.triangles()).sum();
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
    pub stations: Vec<Station>,
    pub transport: Transport,
    pub budget: Budget,
    pub seed: u64,
    /// The engine's own settings from the spec, e.g. `variant: llvm_ad_mono`.
    pub settings: BTreeMap<String, serde_json::Value>,
}

impl Job {
    /// What an engine without settings is asked for a task of a case.
    pub fn of_task(case: &Case, task: &Task) -> Self {
        let station = |(id, meter)| Station { id, meter };
        Self {
            case: case.name.clone(),
            procedure: task.as_asked(),
            scene: task.scene.clone(),
            stations: task.stations().map(station).collect(),
            transport: task.transport,
            budget: case.budget,
            seed: 1,
            settings: BTreeMap::new(),
        }
    }

    /// Settings alone, of whatever job: what is wrong with them does not depend on what is measured.
    pub fn of_settings(budget: Budget, settings: BTreeMap<String, serde_json::Value>) -> Self {
        Self {
            case: String::new(),
            procedure: ProcedureId::DirectIlluminance,
            scene: Scene::default(),
            stations: vec![],
            transport: Transport::Direct,
            budget,
            seed: 1,
            settings,
        }
    }

    /// What is to be told where an engine's own reader gets the user's files, and some are not of the one format that these readers know.
    pub(super) fn written_for_its_reader(&self) -> Option<String> {
        let others = self.scene.luminaires.iter().filter(|l| l.photometry.lm63_file().is_none());
        let written: Vec<&str> = others.map(|l| l.id.as_str()).collect();
        let text = format!("its own reader got an LM-63-2002 file that luxproof wrote of {}", written.join(", "));
        (!written.is_empty()).then_some(text)
    }

    /// The same whatever case and procedure are called.
    pub(super) fn without_names(&self) -> Self {
        Self { case: String::new(), procedure: ProcedureId::DirectIlluminance, ..self.clone() }
    }

    /// The limit on reflections, if reflected light is asked for.
    pub(super) const fn reflections(&self) -> Option<Bounces> {
        Light(self.transport).bounces()
    }

    /// How far all that a ray may meet is from a point: meters, the room's surfaces, boxes.
    pub(super) fn distances_m(&self, at: DVec3) -> impl Iterator<Item = f64> {
        let stations = self.stations.iter().map(move |s| s.meter.position_m.distance(at));
        let room = self.scene.room.iter().flat_map(move |r| [at.to_array(), (r.size_m - at).to_array()].concat());
        let boxes = self.scene.obstacles.iter().filter_map(move |o| match &o.shape {
            Shape::Box { min_m, max_m } => Some(at.clamp(*min_m, *max_m).distance(at)),
            Shape::Mesh { .. } => None,
        });
        stations.chain(room).chain(boxes)
    }
}

#[derive(Clone, Debug, PartialEq)]
pub struct Station {
    pub id: MeterId,
    pub meter: Meter,
}

/// What an engine is: what it says of itself, and what really runs.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Version {
    pub text: String,
    /// Hash of its files: programs, libraries, packages.
    pub fingerprint: String,
}

impl Version {
    /// An engine that tells `text`, of these files and folders.
    pub fn of(
        engine: &EngineName,
        text: impl Into<String>,
        site: &Site,
        files: impl IntoIterator<Item = PathBuf>,
    ) -> Self {
        Self { text: text.into(), fingerprint: fingerprint::of(engine, site, files) }
    }

    /// One of our own solvers, which this program's sources make.
    pub(crate) fn own() -> Self {
        Self { text: env!("CARGO_PKG_VERSION").to_owned(), fingerprint: env!("LUXPROOF_READ_OUT").to_owned() }
    }

    #[cfg(test)]
    pub(crate) fn told(text: &str) -> Self {
        Self { text: text.to_owned(), fingerprint: String::new() }
    }
}

#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{reason}; {remedy}")]
pub struct Absent {
    pub reason: String,
    pub remedy: String,
}

#[derive(Clone, Debug, PartialEq)]
pub enum Support {
    Yes,
    Approximate {
        why: String,
        /// Its size, relative.
        size: Option<f64>,
    },
    No(String),
}

#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Measurement {
    /// Illuminance in lux, one a station, in the stations' order.
    pub estimates: Vec<Estimate>,
    /// What was done: solver, preset, variant.
    pub method: Method,
    /// How much of it, by which random numbers and where: samples, seeds, commands.
    pub effort: Effort,
    pub notes: Vec<String>,
    /// The independent parts of the readings that were sampled, in the stations' order: their spread is the estimates'
    /// standard error. Empty where nothing was sampled or nobody says.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub samples: Vec<Blocks>,
    /// What samples told that are forgotten.
    #[serde(skip)]
    pub forgotten: Forgotten,
    /// Seconds that its sampling takes at the rate that the engine counts with; `None` for one that keeps to the clock.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub work_s: Option<f64>,
    /// The part of the samples that the clock left of those that it took; `None` where it left all.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub cut_to: Option<f64>,
}

/// What is known of the noise of samples that are not kept.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Forgotten {
    design_effect: Option<f64>,
    skewness: Option<f64>,
}

/// The stations of targets with what each counts for, the first target's first.
fn weights(targets: &[&Target]) -> Vec<Vec<(usize, f64)>> {
    let mut first = 0;
    let of = |target: &&Target| {
        let weights: Vec<_> = target.aspects.iter().enumerate().map(|(k, a)| (first + k, a.weight)).collect();
        first += weights.len();
        weights
    };
    targets.iter().map(of).collect()
}

impl Measurement {
    /// The readings of targets, whose stations these are, target by target.
    pub fn readings<'a>(&self, targets: impl IntoIterator<Item = &'a Target>) -> Vec<Estimate> {
        let targets: Vec<&Target> = targets.into_iter().collect();
        let reading = |(target, weights): (&&Target, Vec<(usize, f64)>)| target.reading(self.weighted(&weights));
        targets.iter().zip(weights(&targets)).map(reading).collect()
    }

    /// Of each part that was sampled, block by block, how far the readings of targets are from their means, see [`Blocks::deviates`].
    pub fn deviates<'a>(&self, targets: impl IntoIterator<Item = &'a Target>) -> Vec<Vec<Vec<f64>>> {
        let targets: Vec<&Target> = targets.into_iter().collect();
        let of_target = |(target, weights): (&&Target, Vec<(usize, f64)>)| {
            let slope = target.made.slope(self.weighted(&weights).value);
            weights.into_iter().map(|(k, weight)| (k, slope * weight)).collect()
        };
        let weights: Vec<Vec<(usize, f64)>> = targets.iter().zip(weights(&targets)).map(of_target).collect();
        self.samples.iter().map(|part| part.deviates(&weights)).collect()
    }

    /// Takes the blocks of a part of the light, and gives its estimates.
    pub(super) fn take(&mut self, part: Sampled) -> Vec<Estimate> {
        let estimates = part.blocks.estimates();
        *self.work_s.get_or_insert(0.0) += part.work_s;
        self.cut_to = [self.cut_to, part.cut_to].into_iter().flatten().reduce(f64::min);
        self.notes.extend(part.remark);
        self.samples.push(part.blocks);
        estimates
    }

    /// Of the part of the light whose blocks are the most skewed, see [`Blocks::skewness`].
    pub fn skewness(&self) -> Option<f64> {
        self.forgotten.skewness.or_else(|| self.samples.iter().filter_map(Blocks::skewness).reduce(f64::max))
    }

    /// Forgets the samples, but not what they told of the noise.
    pub fn forget_samples(&mut self) {
        self.forgotten = Forgotten { design_effect: self.design_effect(), skewness: self.skewness() };
        self.samples.clear();
    }

    /// Of the part of the light whose meters share the most of their noise.
    pub fn design_effect(&self) -> Option<f64> {
        self.forgotten.design_effect.or_else(|| self.samples.iter().filter_map(Blocks::design_effect).reduce(f64::max))
    }

    /// The weighted sum of stations' estimates, with the standard error that their joint sampling gives it; where the samples
    /// are not known, the errors of stations may be all one.
    pub fn weighted(&self, weights: &[(usize, f64)]) -> Estimate {
        // One station's error is what its engine states.
        if let [(station, weight)] = *weights {
            return self.estimates[station].times(weight);
        }
        let terms = || weights.iter().map(|&(k, weight)| (weight, self.estimates[k]));
        let apart = Uncertainty::of_dependent_sum(terms().map(|(weight, e)| (weight, e.uncertainty)));
        let sampled = !self.samples.is_empty() && self.samples.iter().all(|part| part.count() > 1);
        let uncertainty = match apart {
            Uncertainty::StandardError { bound, .. } if sampled => {
                let parts = self.samples.iter().map(|part| (1.0, part.weighted(weights).uncertainty));
                Uncertainty::of_sum(parts).within(bound)
            }
            apart => apart,
        };
        Estimate { value: terms().map(|(weight, e)| weight * e.value).sum(), uncertainty }
    }
}

/// Refuses a setting that an engine does not know, naming those that it does.
pub(super) fn only_known(engine: &EngineName, job: &Job, knobs: &[Knob]) -> Result<(), EngineError> {
    let Some(key) = job.settings.keys().find(|key| knobs.iter().all(|k| k.key != *key)) else { return Ok(()) };
    let known = if knobs.is_empty() { "none at all".to_owned() } else { list(knobs.iter().map(|k| k.key), "and") };
    let what = format!("no such setting; there are {known}");
    Err(EngineError::Setting { engine: engine.clone(), key: key.clone(), what })
}

/// `a, b or c`.
pub(super) fn list<'a>(words: impl Iterator<Item = &'a str>, last: &str) -> String {
    let words: Vec<&str> = words.collect();
    match words.split_last() {
        Some((end, start)) if !start.is_empty() => format!("{} {last} {end}", start.join(", ")),
        _ => words.concat(),
    }
}

/// Checks that what was read is named as the meters, in their order.
pub(super) fn same_meters<'a>(
    engine: &EngineName,
    job: &Job,
    found: impl ExactSizeIterator<Item = &'a str>,
) -> Result<(), EngineError> {
    count_readings(engine, job, found.len())?;
    match found.zip(&job.stations).find(|(found, wanted)| *found != wanted.id.0) {
        Some((found, wanted)) => {
            Err(EngineError::output(engine.clone(), format!("gave `{found}` where `{}` was asked for", wanted.id)))
        }
        None => Ok(()),
    }
}

fn count_readings(engine: &EngineName, job: &Job, found: usize) -> Result<(), EngineError> {
    let wanted = job.stations.len();
    let wrong = || EngineError::output(engine.clone(), format!("gave {found} readings for {wanted} meters"));
    (found == wanted).then_some(()).ok_or_else(wrong)
}

/// No light is so bright: the sun's surface gives 1e10 lx. What is made of readings, fourth powers among it, stays a number below this.
const BRIGHTEST_LX: f64 = 1e30;

/// Checks what every engine must hold: one finite value a station, no brighter than light can be. What is negative is no light, but a number
/// to be judged like any other. Where some meters have none, the error holds the readings of the others.
pub fn checked(engine: &EngineName, job: &Job, measurement: Measurement) -> Result<Measurement, EngineError> {
    count_readings(engine, job, measurement.estimates.len())?;
    let pairs = measurement.estimates.iter().zip(&job.stations).enumerate();
    let wrong = pairs.filter_map(|(k, (estimate, station))| Some((k, unsound(engine, estimate, station)?)));
    let (lost, errors): (Vec<usize>, Vec<EngineError>) = wrong.unzip();
    let all = measurement.estimates.len();
    let Some(first) = errors.into_iter().next() else { return Ok(measurement) };
    if lost.len() == all {
        return Err(first);
    }
    let Measurement { mut estimates, method, effort, notes, .. } = measurement;
    let others = lost.len() - 1;
    for k in lost {
        estimates[k] = Estimate { value: f64::NAN, uncertainty: Uncertainty::Unstated };
    }
    let rest = Rest { estimates, method, effort, notes };
    Err(EngineError::AtMeters { first: first.into(), others, rest: rest.into() })
}

impl From<Rest> for Measurement {
    fn from(Rest { estimates, method, effort, notes }: Rest) -> Self {
        Self { estimates, method, effort, notes, ..Self::default() }
    }
}

/// Why a number cannot be a reading.
fn unsound(engine: &EngineName, estimate: &Estimate, station: &Station) -> Option<EngineError> {
    let Estimate { value, uncertainty } = *estimate;
    let (engine, meter) = (engine.clone(), station.id.clone());
    if !value.is_finite() || !uncertainty.is_finite() {
        return Some(EngineError::NotFinite { engine, meter, value, uncertainty });
    }
    let told = || format!("read {value:e} lx ({uncertainty:?}) at {meter}");
    if !uncertainty.is_sound() {
        let what = format!("{}: an error below zero is none", told());
        return Some(EngineError::Output { what, engine });
    }
    let all = [value.abs(), uncertainty.standard_error().unwrap_or(0.0), uncertainty.bound()];
    let what = || format!("{}: beyond {BRIGHTEST_LX:e} lx nothing is light", told());
    all.iter().any(|v| *v > BRIGHTEST_LX).then(|| EngineError::Output { what: what(), engine })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::engines::fixtures;

    const ENGINE: EngineName = EngineName::new("test");

    fn job(stations: usize) -> Job {
        fixtures::job(Scene::default(), fixtures::stations(&vec![[1.0; 3]; stations], DVec3::Z), Transport::Direct)
    }

    fn measurement(values: &[f64]) -> Measurement {
        let estimate = |&value| Estimate { value, uncertainty: Uncertainty::sampled(0.0, None) };
        Measurement { estimates: values.iter().map(estimate).collect(), ..Measurement::default() }
    }

    #[test]
    fn missing_rows_nan_and_infinity_are_errors_and_negative_readings_are_none() {
        for judged in [[1.0, 0.0], [1.0, -1.0]] {
            assert!(checked(&ENGINE, &job(2), measurement(&judged)).is_ok());
        }
        for bad in
            [&[1.0][..], &[1.0, 1e308], &[1.0, -1e308], &[1.0, f64::NAN], &[1.0, f64::INFINITY], &[1.0, 1.0, 1.0]]
        {
            assert!(checked(&ENGINE, &job(2), measurement(bad)).is_err(), "{bad:?}");
        }
        let Err(EngineError::AtMeters { rest, others: 0, .. }) =
            checked(&ENGINE, &job(3), measurement(&[1.0, f64::NAN, 2.0]))
        else {
            panic!("one meter is lost, and two are not")
        };
        assert_eq!(rest.estimates.iter().map(|e| e.value.is_nan()).collect::<Vec<_>>(), [false, true, false]);
        let mut odd = measurement(&[1.0]);
        odd.estimates[0].uncertainty = Uncertainty::sampled(f64::NAN, None);
        assert!(checked(&ENGINE, &job(1), odd).is_err());
    }
}
