//! Bench: run time against error, for every engine, solver and preset along a ladder of effort.
//!
//! Every reading is taken afresh or from this measurement's own shelf, never from a cache of results.

mod curve;
mod fit;
mod knobs;
mod ladder;
mod plot;
mod report;
#[cfg(test)]
mod tests;

use std::collections::BTreeMap;
use std::time::{Duration, Instant};

use luminaire::scene::{LuminaireModel, Transport};
use serde::Serialize;

pub use self::curve::{BenchPoint, Curve, Pareto};
pub use self::knobs::KnobEffect;
use self::ladder::ladder;
use crate::engines::{self, Job};
use crate::laws::Place;
use crate::measure::{FailureKind, Laboratory, Outcome, Request, Shelf, Subject};
use crate::procedures::Task;
use crate::record::{EngineName, Estimate, ProcedureId, ReadingKey};
use crate::spec::{Budget, Case};
use crate::system::process;

/// How to bench.
pub struct Options<'a> {
    /// Where readings are taken.
    pub laboratory: Laboratory,
    /// Where finished readings are kept.
    pub shelf: Shelf,
    /// Readings a rung, each with a seed of its own.
    pub repetitions: usize,
    /// Threads or processes that a reading may use.
    pub jobs: usize,
    /// No reading starts after this.
    pub time: Duration,
    /// Seconds of the rungs of renderers whose light is sampled.
    pub seconds: &'a [f64],
    /// Procedures by name; empty for all of the spec but intensities.
    pub procedures: &'a [ProcedureId],
    /// First seed.
    pub seed: u64,
    /// Whether settings are tried one by one.
    pub knobs: Knobs,
}

/// Whether settings are tried one by one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Knobs {
    /// Each is.
    Tried,
    /// None is.
    Left,
}

/// Told of every reading as it ends.
pub trait Progress {
    /// That many seconds more are expected.
    fn planned(&self, seconds: f64);
    /// A reading ended that was expected to take so long.
    fn ended(&self, what: &str, seconds: f64);
}

/// What the bench found with some cases.
#[derive(Clone, Debug, Default, Serialize)]
pub struct BenchReport {
    pub machine: String,
    /// Engines with their versions.
    pub engines: BTreeMap<EngineName, String>,
    /// One an engine, solver, preset and procedure.
    pub curves: Vec<Curve>,
    /// One a case and procedure: what errors are told against, and the error below which they are not told.
    pub references: Vec<Reference>,
    /// One a case and procedure: what no other engine beats in both time and error.
    pub pareto: Vec<Pareto>,
    /// What each setting does, where they were tried.
    pub knobs: Vec<KnobEffect>,
    /// What could not be measured, and why.
    pub left_out: Vec<String>,
}

/// The exact values of a case and procedure.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Reference {
    pub case: String,
    pub procedure: ProcedureId,
    /// What solved it, in full.
    pub solver: String,
    /// Root mean square over meters of how far off it may be, relative: errors below are not told from none.
    pub floor: f64,
    /// Wall-clock seconds that it took.
    pub wall_s: f64,
}

/// Benches engines with one case and adds what it finds to a report.
pub fn bench(
    case: &Case,
    subjects: &[Subject],
    options: &Options<'_>,
    progress: &dyn Progress,
    report: &mut BenchReport,
) {
    let bench = Bench { case, options, progress, until: Instant::now() + options.time };
    report.machine = machine();
    for subject in subjects {
        report.engines.insert(subject.engine.name(), subject.version.clone());
    }
    let asked = |procedure: ProcedureId| match options.procedures {
        [] => procedure != ProcedureId::LuminousIntensity,
        chosen => chosen.contains(&procedure),
    };
    for task in case.tasks().filter(|task| asked(task.procedure)) {
        let job = Job::of_task(case, &task);
        let Some(truth) = bench.truth(&task, &job) else {
            report.left_out.push(format!("{}, {}: there is no exact reference in time", case.name, task.procedure));
            continue;
        };
        for subject in subjects {
            match bench.curves(subject, &task, &job, &truth) {
                Ok(curves) => report.curves.extend(curves),
                Err(why) => {
                    report.left_out.push(format!(
                        "{}, {}, {}: {why}",
                        case.name,
                        task.procedure,
                        subject.engine.name()
                    ));
                }
            }
            if options.knobs == Knobs::Tried {
                report.knobs.extend(bench.knob_effects(subject, &task, &job));
            }
        }
        report.pareto.push(Pareto::of(&case.name, task.procedure, &report.curves, truth.floor()));
        report.references.push(Reference {
            case: case.name.clone(),
            procedure: task.procedure,
            solver: truth.solver.clone(),
            floor: truth.floor(),
            wall_s: truth.wall_s,
        });
    }
    if Instant::now() >= bench.until && !options.time.is_zero() {
        report
            .left_out
            .push(format!("{}: time was up before all was tried; the same command goes on from there", case.name));
    }
}

/// The exact values and how far off they may be.
pub(crate) struct Truth {
    pub(crate) values_lx: Vec<f64>,
    pub(crate) uncertainty_lx: Vec<f64>,
    pub(crate) solver: String,
    pub(crate) wall_s: f64,
}

/// Accuracies of the exact reference, from what is tried first to what has to do: where bodies and openings allow no
/// closed solution, and where there are none.
///
/// The first of furnished rooms is met by path tracing, which confers with no radiosity that is benched; the rest by
/// radiosity with its own bound, in seconds.
const FURNISHED: [f64; 2] = [1e-3, 1e-2];
const EMPTY: [f64; 2] = [1e-7, 5e-7];
/// Past this a try at a reference is not waited for.
const REFERENCE_LIMIT: Duration = Duration::from_secs(90);
/// Past this a reading is not waited for.
const LIMIT: Duration = Duration::from_secs(300);

/// What one reading may take.
#[derive(Clone, Copy)]
struct Effort {
    budget: Budget,
    seed: u64,
    limit: Duration,
}

struct Bench<'a> {
    case: &'a Case,
    options: &'a Options<'a>,
    progress: &'a dyn Progress,
    until: Instant,
}

impl Bench<'_> {
    /// The exact simulation, as finely as it goes.
    fn truth(&self, task: &Task, job: &Job) -> Option<Truth> {
        let engine = (engines::entry(&EngineName::SIMULATOR)?.make)();
        let subject = Subject { engine, version: env!("CARGO_PKG_VERSION").to_owned() };
        let accuracies = if is_furnished(job) { FURNISHED } else { EMPTY };
        // Something is better than nothing: coarser where the finest takes too long.
        accuracies.into_iter().find_map(|accuracy| {
            let settings = BTreeMap::from([("relative_error".to_owned(), accuracy.into())]);
            let effort = Effort { budget: job.budget, seed: self.options.seed, limit: REFERENCE_LIMIT };
            let outcome = self.take(&subject, task.procedure, job, &settings, effort, None)?;
            outcome.failure.is_none().then(|| Truth::of(&outcome))
        })
    }

    fn curves(&self, subject: &Subject, task: &Task, job: &Job, truth: &Truth) -> Result<Vec<Curve>, String> {
        let settings = self.case.settings_of(&subject.engine.name());
        let rungs = ladder(subject.engine.as_ref(), job, is_furnished(job), &settings, self.options.seconds);
        let repetitions = self.options.repetitions.max(1);
        self.progress.planned(rungs.iter().map(|r| r.expected_s() * repetitions as f64).sum());
        let start_up_s = self.start_up(subject, task, job, &settings);
        let set_up_s = self.set_up(subject, task, job, &settings);
        let mut curves: Vec<Curve> = vec![];
        let (mut last_wall_s, mut last_preset, mut refusal) = (0.0, "", None);
        for rung in &rungs {
            // A rung below what the last one took anyway would only repeat it.
            let repeats = rung.preset == last_preset && rung.budget.seconds < 0.8 * last_wall_s && rung.is_timed;
            let mut outcomes = vec![];
            for k in 0..repetitions {
                if !repeats {
                    let settings = rung.settings(&settings);
                    let effort = Effort { budget: rung.budget, seed: self.options.seed + k as u64, limit: LIMIT };
                    outcomes.extend(self.take(subject, task.procedure, job, &settings, effort, None));
                }
                let what = format!("{}: {} {} {:e}", subject.engine.name(), task.procedure, rung.preset, rung.effort);
                self.progress.ended(&what, rung.expected_s());
            }
            refusal = refusal.or(outcomes.iter().find_map(|o| o.failure.as_ref()).map(|f| f.text.clone()));
            outcomes.retain(|o| o.failure.is_none());
            let Some(first) = outcomes.first() else { continue };
            (last_wall_s, last_preset) = (first.wall_s, rung.preset.as_str());
            let solver = ladder::solver(first);
            let point = BenchPoint::of(rung.effort, &outcomes, truth);
            let known = curves.iter_mut().find(|c| c.solver == solver && c.preset == rung.preset);
            match known {
                Some(curve) => curve.points.push(point),
                None => curves.push(Curve {
                    solver,
                    preset: rung.preset.clone(),
                    start_up_s,
                    set_up_s,
                    reference_floor: truth.floor(),
                    points: vec![point],
                    ..Curve::of(ReadingKey::new(&self.case.name, task.procedure, subject.engine.name()))
                }),
            }
        }
        curves.iter_mut().for_each(Curve::conclude);
        match refusal {
            Some(why) if curves.is_empty() => Err(why.lines().next().unwrap_or_default().to_owned()),
            _ => Ok(curves),
        }
    }

    /// Seconds of a job with next to no work: direct light at one meter. Our own solvers have no start-up.
    fn start_up(&self, subject: &Subject, task: &Task, job: &Job, settings: &Settings) -> f64 {
        let mut least = job.clone();
        least.transport = Transport::Direct;
        least.stations.truncate(1);
        self.least(subject, task, &least, settings, "start_up")
    }

    /// Seconds of the job itself with as little effort as the engine can do with.
    fn set_up(&self, subject: &Subject, task: &Task, job: &Job, settings: &Settings) -> f64 {
        self.least(subject, task, job, settings, "set_up")
    }

    fn least(&self, subject: &Subject, task: &Task, job: &Job, settings: &Settings, name: &str) -> f64 {
        if subject.engine.is_witness() {
            return 0.0;
        }
        let budget = Budget { relative_error: 1e3, seconds: 0.0 };
        let place = |k: usize| Some(Place { law: name.to_owned(), magnitude: 0.0, part: k });
        let times = (0..2).filter_map(|k| {
            let effort = Effort { budget, seed: self.options.seed, limit: LIMIT };
            let taken = self.take(subject, task.procedure, job, settings, effort, place(k))?;
            taken.failure.is_none().then_some(taken.wall_s)
        });
        times.reduce(f64::min).unwrap_or(0.0)
    }

    fn take(
        &self,
        subject: &Subject,
        procedure: ProcedureId,
        job: &Job,
        settings: &Settings,
        effort: Effort,
        place: Option<Place>,
    ) -> Option<Outcome> {
        let Effort { budget, seed, limit } = effort;
        let request = Request {
            spec: self.case.path.clone(),
            spec_sha256: self.case.sha256.clone(),
            key: ReadingKey::new(&self.case.name, procedure, subject.engine.name()),
            version: subject.version.clone(),
            place,
            settings: settings.clone(),
            budget,
            seed,
            jobs: self.options.jobs,
            limit_s: limit.as_secs_f64(),
        };
        if let Some(kept) = self.options.shelf.find(&request) {
            return Some(kept);
        }
        if Instant::now() >= self.until || process::is_interrupted() {
            return None;
        }
        let job = Job { settings: settings.clone(), budget, seed, ..job.clone() };
        let outcome = self.options.laboratory.read(subject.engine.as_ref(), &job, &request);
        if let Err(error) = self.options.shelf.keep(&request, &outcome) {
            tracing::warn!(%error, "a finished reading could not be kept");
        }
        (outcome.failure_kind() != Some(FailureKind::Interrupted)).then_some(outcome)
    }
}

type Settings = BTreeMap<String, serde_json::Value>;

fn is_furnished(job: &Job) -> bool {
    let points = job.scene.luminaires.iter().all(|l| l.model == LuminaireModel::Point);
    (!points || !job.scene.obstacles.is_empty()) && job.transport != Transport::Direct
}

impl Truth {
    fn of(outcome: &Outcome) -> Self {
        let error = |e: &Estimate| 2.0 * e.uncertainty.standard_error().unwrap_or(0.0) + e.uncertainty.bound();
        Self {
            values_lx: outcome.estimates.iter().map(|e| e.value).collect(),
            uncertainty_lx: outcome.estimates.iter().map(error).collect(),
            solver: outcome.settings.get("solver").cloned().unwrap_or_default(),
            wall_s: outcome.wall_s,
        }
    }

    /// Root mean square over meters of how far off it may be, relative as errors are.
    pub(crate) fn floor(&self) -> f64 {
        let parts = self
            .uncertainty_lx
            .iter()
            .zip(&self.values_lx)
            .map(|(u, v)| (u / curve::scale(*v, &self.values_lx)).powi(2));
        (parts.sum::<f64>() / self.values_lx.len().max(1) as f64).sqrt()
    }
}

/// The processor, its cores, the system's load and how this program was built.
fn machine() -> String {
    let processors = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let model =
        processors.lines().find_map(|l| l.strip_prefix("model name")).map(|l| l.trim_start_matches([' ', '\t', ':']));
    let load = std::fs::read_to_string("/proc/loadavg").unwrap_or_default();
    let load = load.split(' ').next().unwrap_or("?").to_owned();
    let build = if cfg!(debug_assertions) { "a development build, which is slow" } else { "a release build" };
    let model = model.unwrap_or(std::env::consts::ARCH);
    format!("{model}, {} cores, load average {load} at the end; {build}", process::cores())
}
