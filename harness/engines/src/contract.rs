//! The contract between the program and an engine: jobs, measurements, and the properties of an engine.

use std::collections::BTreeMap;
use std::path::PathBuf;

use glam::DVec3;
use luxproof_scene::{Bounces, LuminaireModel, Meter, Scene, Shape, Transport};
use serde::{Deserialize, Serialize};

use super::blocks::{Blocks, MIN_BLOCKS, Sampled};
use super::job_dir::{EngineError, JobDir, PartialMeasurement, SceneFile};
use super::libraries::Libraries;
use super::releases::KnownRelease;
use super::{EngineRoot, fingerprint};
use luxproof_model::{Effort, EngineName, Estimate, Light, MeterId, Method, ProcedureId, Role, Uncertainty};
use luxproof_process::slots::{Share, SlotGuard, Slots};
use luxproof_spec::procedures::{Target, Task};
use luxproof_spec::{Budget, Case};
use luxproof_statistics::mean_correlation;

/// The component of every engine that gets its candela table from luxproof's reader of photometric files.
pub const FILE_READER: &str = "luxproof's reader of photometric files";

/// The component of our own solvers, which share one look-up of intensities.
pub(super) const OWN_LOOKUP: &str = "luminaire's interpolation of candela tables";

/// An engine's answer to one of several jobs.
pub type Answer = Result<Measurement, EngineError>;

/// How much of its time a job sleeps. Other jobs compute in that time, and the job that sleeps most begins first.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum CpuUse {
    /// The job takes no thread.
    Idle,
    /// The job takes half of its threads.
    Partial,
    /// The job takes all of its threads.
    Full,
}

pub trait Engine: Send + Sync {
    fn name(&self) -> EngineName;

    fn role(&self) -> Role {
        Role::Renderer
    }

    fn is_reference_engine(&self) -> bool {
        self.role() == Role::Reference
    }

    /// Whether a witness has to sample this job. Then it should be no finer than its use requires.
    fn samples(&self, _job: &Job) -> bool {
        false
    }

    /// Whether its driver is ours and measures the scatter of its blocks. The errors that other engines state are checked.
    fn has_trusted_error(&self) -> bool {
        true
    }

    /// Whether its own reader gets the user's files. Then nothing that our reader finds in a table applies to it.
    fn reads_files(&self, _job: &Job) -> bool {
        false
    }

    /// Whether a job may be divided into jobs for some of its meters each, with separate seeds.
    ///
    /// This requires that every reading and its error hold whatever other meters the job has. That is unknown of a user's program,
    /// which is the subject of the audit.
    fn reads_meters_independently(&self) -> bool {
        false
    }

    fn probe(&self, site: &EngineRoot) -> Result<Version, Absent>;

    /// Returns whether it supports this job, exactly or approximately. It decides from the job alone, before anything starts.
    fn supports(&self, job: &Job) -> Support;

    /// Returns the names of components that it shares with other engines. One error in a component affects all engines that have it.
    ///
    /// Witnesses that share a component count once. The list need not name their own code.
    fn components(&self, _job: &Job) -> Vec<String> {
        vec![FILE_READER.to_owned()]
    }

    /// Returns the job as native files that a user can run by hand. It is a pure function. Our own solvers have no files.
    fn export(&self, _job: &Job) -> Result<Vec<SceneFile>, EngineError> {
        Ok(vec![])
    }

    /// Returns the largest number of planes over the full circle in a table of its scenes; `None` if there is no limit.
    fn most_planes(&self) -> Option<usize> {
        None
    }

    /// Returns the command that runs an exported scene from the scene's folder. It names the engine that is installed at the site,
    /// or else relies on one on PATH.
    fn command_by_hand(&self, _job: &Job, _site: &EngineRoot) -> Option<String> {
        None
    }

    /// Returns the settings that affect time and result, with values to try. `preset` is the first if there is one.
    fn settings(&self) -> &'static [Setting] {
        &[]
    }

    /// Checks its settings from the job alone, before anything starts.
    fn check_settings(&self, job: &Job) -> Result<(), EngineError> {
        only_known(&self.name(), job, self.settings())
    }

    /// Returns the processor seconds that a job is expected to take over all stages, with the budget of its first stage. It is `None`
    /// if they are unknown, as for a user's program.
    fn expected_s(&self, _job: &Job) -> Option<f64> {
        None
    }

    /// Returns how much of its threads a job uses.
    fn cpu_use(&self, _job: &Job) -> CpuUse {
        CpuUse::Full
    }

    /// Returns the memory in MiB that a job takes on this many threads or processes. The estimate is high on purpose, because it
    /// limits how many jobs run in parallel. The default is more than twice the memory of case S2, for each process.
    fn memory_mib(&self, job: &Job, threads: usize) -> u64 {
        threads as u64 * (256 + geometry_mib(job))
    }

    /// Returns the job without everything that does not affect this engine's readings. Jobs that are then equal share a cache entry.
    /// For most engines, the names of case and procedure are only comments.
    fn cache_identity(&self, job: &Job) -> Job {
        job.without_names()
    }

    /// Returns the job of a part of the work that other jobs share, or `None`.
    ///
    /// The part may be what precedes any reading of the scene, or what holds for its meters with any number of reflections. Its
    /// result does not depend on which of the jobs computes it.
    fn shared_precompute(&self, _job: &Job) -> Option<Job> {
        None
    }

    /// Runs the job in `workbench` and returns one estimate per sensor, in the sensors' order.
    fn read(&self, job: &Job, workbench: &JobDir) -> Result<Measurement, EngineError>;

    /// Whether several jobs at once cost less than one after the other.
    fn takes_batches(&self) -> bool {
        false
    }

    /// Runs several jobs at once in the workbench `together`; each also has a workbench for its own files. It returns one answer per
    /// job, in their order, or one error for all.
    fn read_all(&self, jobs: &[(&Job, &JobDir)], _together: &JobDir) -> Result<Vec<Answer>, EngineError> {
        Ok(jobs.iter().map(|(job, workbench)| self.read(job, workbench)).collect())
    }

    /// Returns the largest number of threads or processes that it uses.
    fn max_threads(&self) -> usize {
        usize::MAX
    }

    /// Returns the seconds that its start may take on a busy machine.
    fn start_s(&self) -> f64 {
        120.0
    }
}

/// The methods that an engine wrapped around another one forwards to it.
macro_rules! left_to_inner {
    () => {
        fn role(&self) -> Role {
            self.inner.role()
        }

        fn samples(&self, job: &Job) -> bool {
            self.inner.samples(job)
        }

        fn has_trusted_error(&self) -> bool {
            self.inner.has_trusted_error()
        }

        fn reads_files(&self, job: &Job) -> bool {
            self.inner.reads_files(job)
        }

        fn reads_meters_independently(&self) -> bool {
            self.inner.reads_meters_independently()
        }

        fn most_planes(&self) -> Option<usize> {
            self.inner.most_planes()
        }

        fn settings(&self) -> &'static [Setting] {
            self.inner.settings()
        }

        fn cache_identity(&self, job: &Job) -> Job {
            self.inner.cache_identity(job)
        }

        fn shared_precompute(&self, job: &Job) -> Option<Job> {
            self.inner.shared_precompute(job)
        }

        fn cpu_use(&self, job: &Job) -> crate::CpuUse {
            self.inner.cpu_use(job)
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

/// The fingerprint of everything in luxproof that turns a scene into a reading: exporters, drivers, solvers.
pub const READ_OUT: &str = env!("LUXPROOF_READ_OUT");

/// The fixed properties of a built-in engine; `super::catalogue` lists them.
pub struct Entry {
    pub name: EngineName,
    /// The name as its makers write it.
    pub display_name: &'static str,
    /// The components that `luxproof engines install` fetches for it.
    pub installs: &'static [Component],
    /// Whether runs and installations include it only by name, because it is large.
    pub is_on_request: bool,
    pub models: &'static [LuminaireModel],
    /// The setting that keeps the spec's coordinates if it is `false`. Otherwise the export may move the scene.
    pub fits_coordinates: Option<&'static str>,
    pub make: fn() -> Box<dyn Engine>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Component {
    /// Mitsuba, Radiance and the reader of POV-Ray's images, as `engines.lock` pins them.
    PythonPackages,
    PovRay,
    LibLlvm,
    /// Libraries of the system that Python packages expect.
    Libraries(&'static Libraries),
    /// The library that gives rtrace's random numbers a seed.
    LibFaketime,
    /// Node.js, the renderers of the web and the driver of a browser, as `web/` pins them.
    WebPackages,
    /// A headless browser.
    Chromium,
    /// Blender as a Python package in a separate environment, as `blender.lock` pins it.
    Blender,
    /// LuxCore as a Python package in a separate environment, as `luxcore.lock` pins it.
    LuxCore,
    /// The Python packages of a release in a separate environment.
    Release(&'static KnownRelease),
}

impl Component {
    /// Whether it is an environment of Python packages.
    pub(super) const fn is_python(self) -> bool {
        matches!(self, Self::PythonPackages | Self::Blender | Self::LuxCore)
    }
}

impl Entry {
    /// Returns why the engine has no source for a luminaire of the job, if so.
    pub fn objection(&self, job: &Job) -> Option<String> {
        let other = job.scene.luminaires.iter().find(|l| !self.models.contains(&l.model))?;
        let known = self.models.iter().map(|m| format!("`{}`", m.name())).collect::<Vec<_>>().join(" or ");
        let (name, model) = (self.display_name, other.model.name());
        Some(format!("{}: {name} has no source of the model `{model}`; use {known}", other.id))
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Setting {
    pub key: &'static str,
    /// Values as YAML flow scalars, the default first.
    pub values: &'static [&'static str],
}

/// Returns the share of the machine that an engine gets for a job.
///
/// A job that mostly sleeps gets no thread, and direct light gets one, because it is exact or quick. Reflected light gets many: its
/// accuracy depends on the seconds of the budget.
pub fn share(engine: &dyn Engine, job: &Job, slots: &Slots) -> Share {
    let threads = match job.transport {
        _ if engine.cpu_use(job) == CpuUse::Idle => 0,
        Transport::Direct => 1,
        Transport::Indirect(_) | Transport::Total(_) => slots.threads_a_reading().min(engine.max_threads()),
    };
    Share { threads, memory_mib: engine.memory_mib(job, threads.max(1)) }
}

/// Takes an engine's share of the machine until the result is dropped.
///
/// Renderers wait at their start and for the last of their processes, so two readings of reflected light use the same threads.
/// Renderers count their seconds with a margin for that. A user's program goes by the clock, so it gets its share exclusively.
pub fn hold<'s>(engine: &dyn Engine, job: &Job, share: Share, slots: &'s Slots) -> SlotGuard<'s> {
    let threads = if engine.has_trusted_error() { share.threads.div_ceil(2) } else { share.threads };
    let share = Share { threads, ..share };
    if engine.cpu_use(job) == CpuUse::Partial { slots.take_half(share) } else { slots.take(share) }
}

/// Returns the memory of meshes and meters in a renderer: about 1 KiB for each triangle with its hierarchy, and for each meter.
pub(super) fn geometry_mib(job: &Job) -> u64 {
    let triangles: usize = job.scene.obstacles.iter().map(|o| o.shape.triangles()).sum();
    ((triangles + job.sensors.len()) / 1024) as u64
}

/// One procedure of one case, as an engine gets it.
#[derive(Clone, Debug)]
pub struct Job {
    /// The case, for comments in exported scenes.
    pub case: String,
    pub procedure: ProcedureId,
    /// Room, obstacles and the luminaires that are on. No room means free field.
    pub scene: Scene,
    pub sensors: Vec<Sensor>,
    pub transport: Transport,
    pub budget: Budget,
    pub seed: u64,
    /// The engine's own settings from the spec, e.g. `variant: llvm_ad_mono`.
    pub settings: BTreeMap<String, serde_json::Value>,
}

impl Job {
    /// Returns the job of a task of a case, for an engine without settings.
    pub fn of_task(case: &Case, task: &Task) -> Self {
        Self {
            case: case.name.clone(),
            procedure: task.as_asked(),
            scene: task.scene.clone(),
            sensors: task.sensors().map(|(id, meter)| Sensor { id, meter }).collect(),
            transport: task.transport,
            budget: case.budget,
            seed: 1,
            settings: BTreeMap::new(),
        }
    }

    /// Returns an empty job with settings, to check them: their validity does not depend on what is measured.
    pub fn of_settings(budget: Budget, settings: BTreeMap<String, serde_json::Value>) -> Self {
        Self {
            case: String::new(),
            procedure: ProcedureId::DirectIlluminance,
            scene: Scene::default(),
            sensors: vec![],
            transport: Transport::Direct,
            budget,
            seed: 1,
            settings,
        }
    }

    /// Returns a note about luminaires without an LM-63 file, which is the only format that engines' own readers know.
    pub(super) fn written_for_its_reader(&self) -> Option<String> {
        let others = self.scene.luminaires.iter().filter(|l| l.photometry.lm63_file().is_none());
        let written: Vec<&str> = others.map(|l| l.id.as_str()).collect();
        let text = format!("its own reader got an LM-63-2002 file that luxproof wrote of {}", written.join(", "));
        (!written.is_empty()).then_some(text)
    }

    /// Returns the job without the names of case and procedure.
    pub(super) fn without_names(&self) -> Self {
        Self { case: String::new(), procedure: ProcedureId::DirectIlluminance, ..self.clone() }
    }

    /// Returns the limit on reflections, or `None` if the job reads only direct light.
    pub(super) const fn reflections(&self) -> Option<Bounces> {
        Light(self.transport).bounces()
    }

    /// Returns the distances of a point from everything that a ray may meet: meters, the room's surfaces, boxes.
    pub(super) fn distances_m(&self, at: DVec3) -> impl Iterator<Item = f64> {
        let sensors = self.sensors.iter().map(move |s| s.meter.position_m.distance(at));
        let room = self.scene.room.iter().flat_map(move |r| [at.to_array(), (r.size_m - at).to_array()].concat());
        let boxes = self.scene.obstacles.iter().filter_map(move |o| match &o.shape {
            Shape::Box { min_m, max_m } => Some(at.clamp(*min_m, *max_m).distance(at)),
            Shape::Mesh { .. } => None,
        });
        sensors.chain(room).chain(boxes)
    }
}

#[derive(Clone, Debug, PartialEq)]
pub struct Sensor {
    pub id: MeterId,
    pub meter: Meter,
}

/// An engine's version: its own text and the fingerprint of the files that run.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Version {
    pub text: String,
    /// The hash of its files: programs, libraries, packages.
    pub fingerprint: String,
}

impl Version {
    /// Returns the version of an engine that reports `text` and consists of these files and folders.
    pub fn of(
        engine: &EngineName,
        text: impl Into<String>,
        site: &EngineRoot,
        files: impl IntoIterator<Item = PathBuf>,
    ) -> Self {
        Self { text: text.into(), fingerprint: fingerprint::of(engine, site, files) }
    }

    /// Returns the version of our own solvers, which are part of this program.
    pub fn own() -> Self {
        Self { text: env!("CARGO_PKG_VERSION").to_owned(), fingerprint: READ_OUT.to_owned() }
    }

    /// Returns a version without a hash of its programs.
    pub fn without_fingerprint(text: &str) -> Self {
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
        /// The relative size of the approximation, if known.
        size: Option<f64>,
    },
    No(String),
}

#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Measurement {
    /// Illuminance in lux, one value per sensor, in the sensors' order.
    pub estimates: Vec<Estimate>,
    /// The method: solver, preset, variant.
    pub method: Method,
    /// The effort: samples, seeds, commands.
    pub effort: Effort,
    pub notes: Vec<String>,
    /// The sampled independent parts of the readings, in the sensors' order. Their spread is the estimates' standard error. It is
    /// empty if nothing was sampled or the engine does not report samples.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub samples: Vec<Blocks>,
    /// Summary of the noise of dropped samples.
    #[serde(skip)]
    pub forgotten: NoiseSummary,
    /// Seconds that the sampling takes at the rate that the engine counts with; `None` for an engine that goes by the clock.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub work_s: Option<f64>,
    /// The part of the required samples that the clock left; `None` if it left all.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub cut_to: Option<f64>,
}

/// Summary of the noise of samples that are no longer stored.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct NoiseSummary {
    design_effect: Option<f64>,
    skewness: Option<f64>,
}

/// Returns the sensors of each target with their weights. Sensors are numbered from the first target on.
fn weights(targets: &[&Target]) -> Vec<Vec<(usize, f64)>> {
    let mut first = 0;
    let mut all = vec![];
    for target in targets {
        let weights: Vec<_> = target.aspects.iter().enumerate().map(|(k, a)| (first + k, a.weight)).collect();
        first += weights.len();
        all.push(weights);
    }
    all
}

impl Measurement {
    /// Returns the readings of the targets that these sensors belong to.
    pub fn readings<'a>(&self, targets: impl IntoIterator<Item = &'a Target>) -> Vec<Estimate> {
        let targets: Vec<&Target> = targets.into_iter().collect();
        let weighted = targets.iter().zip(weights(&targets));
        weighted.map(|(target, weights)| target.reading(self.weighted(&weights))).collect()
    }

    /// Returns the largest error that the sum of each target has as the quantity that it stands for: 0 of a single plane.
    ///
    /// It is relative to the sum of the absolute values of the terms.
    pub fn quadratures<'a>(&self, targets: impl IntoIterator<Item = &'a Target>) -> Vec<f64> {
        let targets: Vec<&Target> = targets.into_iter().collect();
        let mut bounds = vec![];
        for (target, weights) in targets.iter().zip(weights(&targets)) {
            let terms = weights.iter().map(|&(k, weight)| (weight * self.estimates[k].value).abs());
            bounds.push(if target.quadrature > 0.0 { target.quadrature * terms.sum::<f64>() } else { 0.0 });
        }
        bounds
    }

    /// Returns for each sampled part and block how far the readings of targets are from their means, see [`Blocks::deviates`].
    pub fn deviates<'a>(&self, targets: impl IntoIterator<Item = &'a Target>) -> Vec<Vec<Vec<f64>>> {
        let weights = self.weights_of_readings(targets);
        self.samples.iter().map(|part| part.deviates(&weights)).collect()
    }

    /// Returns the sensors of each target with the weights by which small deviations of theirs change its reading.
    fn weights_of_readings<'a>(&self, targets: impl IntoIterator<Item = &'a Target>) -> Vec<Vec<(usize, f64)>> {
        let targets: Vec<&Target> = targets.into_iter().collect();
        let mut weights = weights(&targets);
        for (target, weights) in targets.iter().zip(&mut weights) {
            // The reading is a function of the weighted sum, and its slope converts small deviations.
            let slope = target.made.slope(self.weighted(weights).value);
            for (_, weight) in weights {
                *weight *= slope;
            }
        }
        weights
    }

    /// Returns by set of targets the mean correlation of their readings' noise, for sets that samples show it of.
    pub fn correlations(&self, targets: &[Target]) -> BTreeMap<String, f64> {
        if self.samples.is_empty() || self.samples.iter().any(|part| part.count() < MIN_BLOCKS) {
            return BTreeMap::new();
        }
        let weights = self.weights_of_readings(targets);
        let mut sets: BTreeMap<&str, Vec<Vec<(usize, f64)>>> = BTreeMap::new();
        for (target, weights) in targets.iter().zip(weights) {
            sets.entry(target.id.set_name()).or_default().push(weights);
        }
        let found = sets.into_iter().filter_map(|(set, weights)| {
            let parts: Vec<_> = self.samples.iter().map(|part| part.weighted_sums(&weights)).collect();
            Some((set.to_owned(), mean_correlation(&parts)?))
        });
        found.collect()
    }

    /// Adds the blocks of a part of the light and returns their estimates.
    pub(super) fn take(&mut self, part: Sampled) -> Vec<Estimate> {
        let estimates = part.blocks.estimates();
        *self.work_s.get_or_insert(0.0) += part.work_s;
        self.cut_to = [self.cut_to, part.cut_to].into_iter().flatten().reduce(f64::min);
        self.notes.extend(part.remark);
        self.samples.push(part.blocks);
        estimates
    }

    /// Returns the skewness of the part of the light with the most skewed blocks, see [`Blocks::skewness`].
    pub fn skewness(&self) -> Option<f64> {
        self.forgotten.skewness.or_else(|| self.samples.iter().filter_map(Blocks::skewness).reduce(f64::max))
    }

    /// Drops the samples, but not their summary of the noise.
    pub fn drop_samples(&mut self) {
        self.forgotten = NoiseSummary { design_effect: self.design_effect(), skewness: self.skewness() };
        self.samples.clear();
    }

    /// Returns the design effect of the part of the light in which meters share the most noise.
    pub fn design_effect(&self) -> Option<f64> {
        self.forgotten.design_effect.or_else(|| self.samples.iter().filter_map(Blocks::design_effect).reduce(f64::max))
    }

    /// Returns the weighted sum of sensors' estimates with the standard error of their joint sampling. Without samples, it takes the
    /// errors of sensors as fully correlated.
    pub fn weighted(&self, weights: &[(usize, f64)]) -> Estimate {
        // For one sensor, the engine's own statement of the error holds.
        if let [(sensor, weight)] = *weights {
            return self.estimates[sensor].times(weight);
        }
        let terms = weights.iter().map(|&(k, weight)| (weight, self.estimates[k]));
        let dependent = Uncertainty::of_dependent_sum(terms.clone().map(|(weight, e)| (weight, e.uncertainty)));
        let has_samples = !self.samples.is_empty() && self.samples.iter().all(|part| part.count() > 1);
        let uncertainty = match dependent {
            Uncertainty::StandardError { bound, .. } if has_samples => {
                let parts = self.samples.iter().map(|part| (1.0, part.weighted(weights).uncertainty));
                Uncertainty::of_sum(parts).within(bound)
            }
            dependent => dependent,
        };
        Estimate { value: terms.map(|(weight, e)| weight * e.value).sum(), uncertainty }
    }
}

/// Rejects a setting that an engine does not have. The error lists the settings that it has.
pub(super) fn only_known(engine: &EngineName, job: &Job, settings: &[Setting]) -> Result<(), EngineError> {
    let Some(key) = job.settings.keys().find(|key| settings.iter().all(|k| k.key != *key)) else { return Ok(()) };
    let known =
        if settings.is_empty() { "none at all".to_owned() } else { list(settings.iter().map(|k| k.key), "and") };
    let what = format!("no such setting; there are {known}");
    Err(EngineError::Setting { engine: engine.clone(), key: key.clone(), what })
}

/// Joins words with commas and `last` before the final one, such as `a, b or c`.
pub(super) fn list<'a>(words: impl Iterator<Item = &'a str>, last: &str) -> String {
    let words: Vec<&str> = words.collect();
    match words.split_last() {
        Some((end, start)) if !start.is_empty() => format!("{} {last} {end}", start.join(", ")),
        _ => words.concat(),
    }
}

/// Checks that readings have the names of the meters, in their order.
pub(super) fn same_meters<'a>(
    engine: &EngineName,
    job: &Job,
    found: impl ExactSizeIterator<Item = &'a str>,
) -> Result<(), EngineError> {
    count_readings(engine, job, found.len())?;
    match found.zip(&job.sensors).find(|(found, wanted)| *found != wanted.id.0) {
        Some((found, wanted)) => {
            Err(EngineError::output(engine.clone(), format!("gave `{found}` where `{}` was asked for", wanted.id)))
        }
        None => Ok(()),
    }
}

/// Checks that there is one reading for each meter.
fn count_readings(engine: &EngineName, job: &Job, found: usize) -> Result<(), EngineError> {
    let wanted = job.sensors.len();
    if found == wanted {
        return Ok(());
    }
    Err(EngineError::output(engine.clone(), format!("gave {found} readings for {wanted} meters")))
}

/// The largest plausible illuminance. The sun's surface gives 1e10 lx, and the fourth power of a reading must stay finite.
const BRIGHTEST_LX: f64 = 1e30;

/// Checks every engine's readings: one finite value per sensor, no brighter than `BRIGHTEST_LX`.
///
/// A negative value is not possible light, but it is a number that the verdict judges like any other. If only some meters have no
/// valid reading, the error contains the readings of the others.
pub fn checked(engine: &EngineName, job: &Job, measurement: Measurement) -> Result<Measurement, EngineError> {
    count_readings(engine, job, measurement.estimates.len())?;
    let pairs = measurement.estimates.iter().zip(&job.sensors).enumerate();
    let wrong = pairs.filter_map(|(k, (estimate, sensor))| Some((k, unsound(engine, estimate, sensor)?)));
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
    let rest = PartialMeasurement { estimates, method, effort, notes };
    Err(EngineError::AtMeters { first: first.into(), others, rest: rest.into() })
}

impl From<PartialMeasurement> for Measurement {
    fn from(PartialMeasurement { estimates, method, effort, notes }: PartialMeasurement) -> Self {
        Self { estimates, method, effort, notes, ..Self::default() }
    }
}

/// Returns why a number cannot be a reading, or `None` if it can.
fn unsound(engine: &EngineName, estimate: &Estimate, sensor: &Sensor) -> Option<EngineError> {
    let Estimate { value, uncertainty } = *estimate;
    let (engine, meter) = (engine.clone(), sensor.id.clone());
    if !value.is_finite() || !uncertainty.is_finite() {
        return Some(EngineError::NotFinite { engine, meter, value, uncertainty });
    }
    let reading = format!("read {value:e} lx ({uncertainty:?}) at {meter}");
    if !uncertainty.is_sound() {
        let what = format!("{reading}: an error below zero is none");
        return Some(EngineError::Output { what, engine });
    }
    let magnitudes = [value.abs(), uncertainty.standard_error().unwrap_or(0.0), uncertainty.bound()];
    if magnitudes.iter().any(|v| *v > BRIGHTEST_LX) {
        let what = format!("{reading}: beyond {BRIGHTEST_LX:e} lx nothing is light");
        return Some(EngineError::Output { what, engine });
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures;

    const ENGINE: EngineName = EngineName::new("test");

    fn job(sensors: usize) -> Job {
        fixtures::job(Scene::default(), fixtures::sensors(&vec![[1.0; 3]; sensors], DVec3::Z), Transport::Direct)
    }

    fn measurement(values: &[f64]) -> Measurement {
        let uncertainty = Uncertainty::sampled(0.0, None);
        let estimates = values.iter().map(|value| Estimate { value: *value, uncertainty }).collect();
        Measurement { estimates, ..Measurement::default() }
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
