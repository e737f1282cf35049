//! Bench: run time against error, for every engine, solver and preset along a ladder of effort.
//!
//! Every reading is taken afresh or from this measurement's own folder, never from those of runs.

mod curve;
mod fit;
mod knobs;
mod ladder;
mod plot;
mod report;
#[cfg(test)]
mod tests;

use std::collections::BTreeMap;
use std::time::Duration;

use luminaire::scene::{LuminaireModel, Transport};
use serde::Serialize;

pub use self::curve::{BenchPoint, Curve, Pareto};
pub use self::knobs::KnobEffect;
use self::ladder::ladder;
use super::trials::{Effort, Settings, Trials, simulator};
use super::{Progress, deviation};
use crate::engines::Job;
use crate::measure::{Failure, Instrument, Reader, Taken};
use crate::record::{EngineName, Estimate, ProcedureId, ReadingKey};
use crate::spec::{Budget, Case};
use crate::system::process;

pub struct Options<'a> {
    /// Who takes readings, each on all slots of its machine.
    pub reader: Reader,
    /// Readings a rung, each with a seed of its own.
    pub repetitions: usize,
    /// No reading starts after this.
    pub time: Duration,
    /// Seconds of the rungs of renderers whose light is sampled.
    pub seconds: &'a [f64],
    /// Procedures by name; empty for all of the spec but intensities.
    pub procedures: &'a [ProcedureId],
    pub seed: u64,
    pub knobs: Knobs,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Knobs {
    Tried,
    Left,
}

#[derive(Clone, Debug, Default, Serialize)]
pub struct BenchReport {
    pub machine: String,
    pub engines: BTreeMap<EngineName, String>,
    pub curves: Vec<Curve>,
    /// One a case and procedure: what errors are told against, and the error below which they are not told.
    pub references: Vec<Reference>,
    pub pareto: Vec<Pareto>,
    pub knobs: Vec<KnobEffect>,
    pub left_out: Vec<String>,
}

#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Reference {
    pub case: String,
    pub procedure: ProcedureId,
    pub solver: String,
    /// Root mean square over meters of how far off it may be, relative: errors below are not told from none.
    pub floor: f64,
    pub wall_s: f64,
}

pub fn bench(
    case: &Case,
    subjects: &[Instrument],
    options: &Options<'_>,
    progress: &dyn Progress,
    report: &mut BenchReport,
) {
    let bench = Bench { trials: Trials::new(case, &options.reader, options.time), options, progress };
    report.machine = machine();
    for subject in subjects {
        report.engines.insert(subject.engine.name(), subject.version.text.clone());
    }
    let asked = |procedure: ProcedureId| match options.procedures {
        [] => procedure != ProcedureId::LuminousIntensity,
        chosen => chosen.contains(&procedure),
    };
    for task in case.tasks().filter(|task| asked(task.procedure)) {
        let job = Job::of_task(case, &task);
        let Some(truth) = bench.truth(&job) else {
            report.left_out.push(format!("{}, {}: there is no exact reference in time", case.name, task.procedure));
            continue;
        };
        for subject in subjects {
            match bench.curves(subject, &job, &truth) {
                Ok(curves) => report.curves.extend(curves),
                Err(why) => {
                    let engine = subject.engine.name();
                    report.left_out.push(format!("{}, {}, {engine}: {why}", case.name, task.procedure));
                }
            }
            if options.knobs == Knobs::Tried {
                report.knobs.extend(bench.knob_effects(subject, &job));
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
    if bench.trials.is_over() && !options.time.is_zero() {
        let what = "time was up before all was tried; the same command goes on from there";
        report.left_out.push(format!("{}: {what}", case.name));
    }
}

struct Truth {
    values_lx: Vec<f64>,
    uncertainty_lx: Vec<f64>,
    solver: String,
    wall_s: f64,
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
const LIMIT: Duration = Duration::from_secs(300);

struct Bench<'a> {
    trials: Trials<'a>,
    options: &'a Options<'a>,
    progress: &'a dyn Progress,
}

impl Bench<'_> {
    fn truth(&self, job: &Job) -> Option<Truth> {
        let accuracies = if is_furnished(job) { FURNISHED } else { EMPTY };
        // Something is better than nothing: coarser where the finest takes too long.
        accuracies.into_iter().find_map(|accuracy| {
            let settings = Settings::from([("relative_error".to_owned(), accuracy.into())]);
            let effort = Effort { limit: REFERENCE_LIMIT, ..self.effort(job.budget, 0) };
            self.trials.take(&simulator(), job, &settings, effort, (None, 0))?.ok().map(|taken| Truth::of(&taken))
        })
    }

    fn effort(&self, budget: Budget, repetition: usize) -> Effort {
        let threads = self.options.reader.machine.slots.threads();
        Effort { budget, seed: self.options.seed + repetition as u64, limit: LIMIT, threads }
    }

    fn curves(&self, subject: &Instrument, job: &Job, truth: &Truth) -> Result<Vec<Curve>, String> {
        let (case, name) = (self.trials.case, subject.engine.name());
        let own = case.settings_of(&name);
        let rungs = ladder(subject.engine.as_ref(), job, is_furnished(job), &own, self.options.seconds);
        let repetitions = self.options.repetitions.max(1);
        self.progress.planned(rungs.iter().map(|r| r.expected_steps() * repetitions as u64).sum());
        let times_s = (self.start_up(subject, job, &own), self.set_up(subject, job, &own));
        let mut curves: Vec<((String, String), Vec<BenchPoint>)> = vec![];
        let (mut last_wall_s, mut last_preset, mut refusal) = (0.0, "", None);
        for rung in &rungs {
            // A rung below what the last one took anyway would only repeat it.
            let repeats = rung.preset == last_preset && rung.budget.seconds < 0.8 * last_wall_s && rung.is_timed;
            let mut taken = vec![];
            for k in 0..repetitions {
                if !repeats {
                    let settings = rung.settings(&own);
                    match self.trials.take(subject, job, &settings, self.effort(rung.budget, k), (None, 0)) {
                        Some(Ok(one)) => taken.push(one),
                        Some(Err(failure)) => refusal = refusal.or(Some(failure)),
                        None => {}
                    }
                }
                let what = format!("{name}: {} {} {:e}", job.procedure, rung.preset, rung.effort);
                self.progress.ended(what, rung.expected_steps());
            }
            let Some(first) = taken.first() else { continue };
            (last_wall_s, last_preset) = (first.cost.wall_s, rung.preset.as_str());
            let solver = ladder::solver(&first.measurement);
            let point = BenchPoint::of(rung.effort, &taken, truth);
            match curves.iter_mut().find(|(of, _)| *of == (solver.clone(), rung.preset.clone())) {
                Some((_, points)) => points.push(point),
                None => curves.push(((solver, rung.preset.clone()), vec![point])),
            }
        }
        let key = ReadingKey::new(&case.name, job.procedure, name);
        let curve = |(of, points)| Curve::of(key.clone(), of, times_s, truth.floor(), points);
        match refusal {
            Some(Failure { text, .. }) if curves.is_empty() => Err(text.lines().next().unwrap_or_default().to_owned()),
            _ => Ok(curves.into_iter().map(curve).collect()),
        }
    }

    /// Seconds of a job with next to no work: direct light at one meter.
    fn start_up(&self, subject: &Instrument, job: &Job, settings: &Settings) -> f64 {
        let stations = job.stations.first().cloned().into_iter().collect();
        self.set_up(subject, &Job { transport: Transport::Direct, stations, ..job.clone() }, settings)
    }

    /// Seconds of a job with as little effort as the engine can do with. Our own solvers have no start-up.
    fn set_up(&self, subject: &Instrument, job: &Job, settings: &Settings) -> f64 {
        if subject.engine.is_witness() {
            return 0.0;
        }
        let effort = self.effort(Budget { relative_error: 1e3, seconds: 0.0 }, 0);
        let take = |repetition| self.trials.take(subject, job, settings, effort, (None, repetition))?.ok();
        (0..2).filter_map(take).map(|taken| taken.cost.wall_s).reduce(f64::min).unwrap_or(0.0)
    }
}

fn is_furnished(job: &Job) -> bool {
    let points = job.scene.luminaires.iter().all(|l| l.model == LuminaireModel::Point);
    (!points || !job.scene.obstacles.is_empty()) && job.transport != Transport::Direct
}

impl Truth {
    fn of(taken: &Taken) -> Self {
        let estimates = &taken.measurement.estimates;
        let error = |e: &Estimate| 2.0 * e.uncertainty.standard_error().unwrap_or(0.0) + e.uncertainty.bound();
        Self {
            values_lx: estimates.iter().map(|e| e.value).collect(),
            uncertainty_lx: estimates.iter().map(error).collect(),
            solver: taken.measurement.method.get("solver").cloned().unwrap_or_default(),
            wall_s: taken.cost.wall_s,
        }
    }

    fn brightest_lx(&self) -> f64 {
        self.values_lx.iter().copied().fold(0.0, f64::max)
    }

    /// Root mean square over meters of how far off it may be, relative as errors are.
    fn floor(&self) -> f64 {
        let brightest_lx = self.brightest_lx();
        let relative = |(u, v): (&f64, &f64)| (u / deviation::scale(*v, brightest_lx)).powi(2);
        let parts = self.uncertainty_lx.iter().zip(&self.values_lx).map(relative);
        (parts.sum::<f64>() / self.values_lx.len().max(1) as f64).sqrt()
    }
}

fn machine() -> String {
    let processors = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let model = processors.lines().find_map(|l| l.strip_prefix("model name"));
    let load = std::fs::read_to_string("/proc/loadavg").unwrap_or_default();
    let load = load.split(' ').next().unwrap_or("?").to_owned();
    let build = if cfg!(debug_assertions) { "a development build, which is slow" } else { "a release build" };
    let model = model.map_or(std::env::consts::ARCH, |l| l.trim_start_matches([' ', '\t', ':']));
    format!("{model}, {} cores, load average {load} at the end; {build}", process::cores())
}
