//! Bench: run time against error, for every engine, solver and preset along a ladder of effort.
//!
//! Readings are new or from this measurement's own folder; the cache of runs is not used, because
//! it would hide their time.

mod curve;
mod fit;
mod ladder;
mod plot;
mod report;
mod setting_effects;
#[cfg(test)]
mod tests;

use std::collections::BTreeMap;
use std::time::Duration;

use luxproof_scene::{LuminaireModel, Transport};
use serde::Serialize;

pub use self::curve::{BenchPoint, Curve, Pareto};
use self::ladder::make_ladder;
pub use self::setting_effects::SettingEffect;
use super::trials::{Effort, Settings, Trials, simulator};
use super::{Progress, deviation};
use luxproof_audit::measure::{CostedMeasurement, Failure, Instrument, Reader};
use luxproof_engines::Job;
use luxproof_model::{EngineName, Estimate, ProcedureId, ReadingKey};
use luxproof_process::process;
use luxproof_spec::{Budget, Case};

/// The input of [`bench()`].
pub struct Options<'a> {
    /// Takes the readings, each on all slots of its machine.
    pub reader: Reader,
    /// The number of readings for each rung, each with another seed.
    pub repetitions: usize,
    /// No reading starts after this time.
    pub time: Duration,
    /// The budgets in seconds of renderers that sample light.
    pub seconds: &'a [f64],
    /// The procedures; empty for all of the spec except intensities.
    pub procedures: &'a [ProcedureId],
    pub seed: u64,
    pub settings: SettingEffects,
}

/// Whether the effect of each setting is measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SettingEffects {
    Measured,
    Omitted,
}

/// The result of a bench.
#[derive(Clone, Debug, Default, Serialize)]
pub struct BenchReport {
    pub machine: String,
    pub engines: BTreeMap<EngineName, String>,
    pub curves: Vec<Curve>,
    /// For each case and procedure, what errors are relative to, and the error below which they are
    /// not reported.
    pub references: Vec<Reference>,
    pub pareto: Vec<Pareto>,
    pub settings: Vec<SettingEffect>,
    pub left_out: Vec<String>,
}

/// What errors are relative to.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Reference {
    pub case: String,
    pub procedure: ProcedureId,
    pub solver: String,
    /// The root mean square over meters of its relative uncertainty. Smaller errors are not
    /// reported.
    pub floor: f64,
    pub wall_s: f64,
}

/// Measures the curves of all engines in a case and adds them to a report.
pub fn bench(
    case: &Case,
    subjects: &[Instrument],
    options: &Options<'_>,
    progress: &dyn Progress,
    report: &mut BenchReport,
) {
    let runner = CurveRunner { trials: Trials::new(case, &options.reader, options.time), options, progress };
    report.machine = describe_machine();
    for subject in subjects {
        report.engines.insert(subject.engine.name(), subject.version.text.clone());
    }
    for task in case.tasks().filter(|task| is_selected(task.procedure, options.procedures)) {
        let job = Job::of_task(case, &task);
        let Some(truth) = runner.read_reference(&job) else {
            report.left_out.push(format!("{}, {}: there is no exact reference in time", case.name, task.procedure));
            continue;
        };
        for subject in subjects {
            match runner.measure_curves(subject, &job, &truth) {
                Ok(curves) => report.curves.extend(curves),
                Err(why) => {
                    let engine = subject.engine.name();
                    report.left_out.push(format!("{}, {}, {engine}: {why}", case.name, task.procedure));
                }
            }
            if options.settings == SettingEffects::Measured {
                report.settings.extend(runner.measure_setting_effects(subject, &job));
            }
        }
        report.pareto.push(Pareto::from_curves(&case.name, task.procedure, &report.curves, truth.floor()));
        report.references.push(Reference {
            case: case.name.clone(),
            procedure: task.procedure,
            solver: truth.solver.clone(),
            floor: truth.floor(),
            wall_s: truth.wall_s,
        });
    }
    if runner.trials.is_over() && !options.time.is_zero() {
        let what = "time was up before all was tried; the same command goes on from there";
        report.left_out.push(format!("{}: {what}", case.name));
    }
}

/// Whether a procedure is measured: a chosen one, or any but intensities where none is chosen.
fn is_selected(procedure: ProcedureId, chosen: &[ProcedureId]) -> bool {
    if chosen.is_empty() { procedure != ProcedureId::LuminousIntensity } else { chosen.contains(&procedure) }
}

/// The reference readings of a job.
struct Truth {
    values_lx: Vec<f64>,
    uncertainty_lx: Vec<f64>,
    solver: String,
    wall_s: f64,
}

/// The relative errors of the exact reference, from the first that is tried to the last resort.
///
/// Rooms are furnished where bodies or openings allow no closed solution. The first accuracy of
/// furnished rooms is reached by path tracing, which is independent of the radiosity under test.
/// The second is reached by radiosity with its own bound, in seconds.
const FURNISHED_ACCURACIES: [f64; 2] = [1e-3, 1e-2];
const EMPTY_ACCURACIES: [f64; 2] = [1e-7, 5e-7];
/// The longest time of one attempt at a reference.
const REFERENCE_TIME_LIMIT: Duration = Duration::from_secs(90);
/// The longest time of a reading.
const READING_TIME_LIMIT: Duration = Duration::from_secs(300);

/// Measures curves in a case.
struct CurveRunner<'a> {
    trials: Trials<'a>,
    options: &'a Options<'a>,
    progress: &'a dyn Progress,
}

impl CurveRunner<'_> {
    /// Reads the exact reference of a job; `None` where it cannot be reached in time.
    fn read_reference(&self, job: &Job) -> Option<Truth> {
        let accuracies = if is_furnished(job) { FURNISHED_ACCURACIES } else { EMPTY_ACCURACIES };
        // A coarse reference is better than none where the fine one takes too long.
        accuracies.into_iter().find_map(|accuracy| {
            let settings = Settings::from([("relative_error".to_owned(), accuracy.into())]);
            let effort = Effort { limit: REFERENCE_TIME_LIMIT, ..self.effort(job.budget, 0) };
            let taken = self.trials.take(&simulator(), job, &settings, effort, (None, 0))?.ok()?;
            Some(Truth::from_reading(&taken))
        })
    }

    /// The effort of a repetition: all threads, and a seed of its number.
    fn effort(&self, budget: Budget, repetition: usize) -> Effort {
        let threads = self.options.reader.machine.slots.threads();
        Effort { budget, seed: self.options.seed + repetition as u64, limit: READING_TIME_LIMIT, threads }
    }

    /// Measures the curves of an engine in a job: one for each solver and preset.
    fn measure_curves(&self, subject: &Instrument, job: &Job, truth: &Truth) -> Result<Vec<Curve>, String> {
        let (case, name) = (self.trials.case, subject.engine.name());
        let settings = case.settings_of(&name);
        let rungs = make_ladder(subject.engine.as_ref(), job, is_furnished(job), &settings, self.options.seconds);
        let repetitions = self.options.repetitions.max(1);
        self.progress.planned(rungs.iter().map(|r| r.expected_steps() * repetitions as u64).sum());
        let times_s = (self.measure_start_up(subject, job, &settings), self.measure_set_up(subject, job, &settings));
        let mut curves: Vec<((String, String), Vec<BenchPoint>)> = vec![];
        let (mut last_wall_s, mut last_preset, mut refusal) = (0.0, "", None);
        for rung in &rungs {
            // A rung with less time than the last one took anyway would only repeat it.
            let repeats = rung.preset == last_preset && rung.budget.seconds < 0.8 * last_wall_s && rung.is_timed;
            let mut taken = vec![];
            for k in 0..repetitions {
                if !repeats {
                    let settings = rung.settings(&settings);
                    let effort = self.effort(rung.budget, k);
                    match self.trials.take(subject, job, &settings, effort, (None, 0)) {
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
            let solver = ladder::solver_name(&first.measurement);
            let point = BenchPoint::from_readings(rung.effort, &taken, truth);
            match curves.iter_mut().find(|(of, _)| *of == (solver.clone(), rung.preset.clone())) {
                Some((_, points)) => points.push(point),
                None => curves.push(((solver, rung.preset.clone()), vec![point])),
            }
        }
        let key = ReadingKey::new(&case.name, job.procedure, name);
        let curves: Vec<Curve> = curves
            .into_iter()
            .map(|(names, points)| Curve::new(key.clone(), names, times_s, truth.floor(), points))
            .collect();
        match refusal {
            Some(Failure { text, .. }) if curves.is_empty() => Err(text.lines().next().unwrap_or_default().to_owned()),
            _ => Ok(curves),
        }
    }

    /// Measures the seconds of a job with almost no work: direct light at one meter.
    fn measure_start_up(&self, subject: &Instrument, job: &Job, settings: &Settings) -> f64 {
        let sensors = job.sensors.first().cloned().into_iter().collect();
        self.measure_set_up(subject, &Job { transport: Transport::Direct, sensors, ..job.clone() }, settings)
    }

    /// Measures the seconds of a job with the least effort of the engine. Our own solvers have no
    /// start-up.
    fn measure_set_up(&self, subject: &Instrument, job: &Job, settings: &Settings) -> f64 {
        if subject.engine.is_reference_engine() {
            return 0.0;
        }
        let effort = self.effort(Budget { relative_error: 1e3, seconds: 0.0 }, 0);
        // The first reading may include loading files from disk, so the faster of two counts.
        let readings = (0..2).filter_map(|k| self.trials.take(subject, job, settings, effort, (None, k))?.ok());
        readings.map(|taken| taken.cost.wall_s).reduce(f64::min).unwrap_or(0.0)
    }
}

/// Whether a job has no closed solution: reflected light with bodies or openings.
fn is_furnished(job: &Job) -> bool {
    let points = job.scene.luminaires.iter().all(|l| l.model == LuminaireModel::Point);
    (!points || !job.scene.obstacles.is_empty()) && job.transport != Transport::Direct
}

impl Truth {
    fn from_reading(taken: &CostedMeasurement) -> Self {
        let estimates = &taken.measurement.estimates;
        Self {
            values_lx: estimates.iter().map(|e| e.value).collect(),
            uncertainty_lx: estimates.iter().map(expanded_error).collect(),
            solver: taken.measurement.method.get("solver").cloned().unwrap_or_default(),
            wall_s: taken.cost.wall_s,
        }
    }

    fn brightest_lx(&self) -> f64 {
        self.values_lx.iter().copied().fold(0.0, f64::max)
    }

    /// The root mean square over meters of the relative uncertainty, on the scale of errors.
    fn floor(&self) -> f64 {
        let brightest_lx = self.brightest_lx();
        let pairs = self.uncertainty_lx.iter().zip(&self.values_lx);
        let squares: f64 = pairs.map(|(u, v)| (u / deviation::scale(*v, brightest_lx)).powi(2)).sum();
        (squares / self.values_lx.len().max(1) as f64).sqrt()
    }
}

/// Twice the standard error plus the bound of an estimate.
fn expanded_error(estimate: &Estimate) -> f64 {
    2.0 * estimate.uncertainty.standard_error().unwrap_or(0.0) + estimate.uncertainty.bound()
}

/// Describes the processor, its load and the build, without which times cannot be compared.
fn describe_machine() -> String {
    let processors = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let model = processors.lines().find_map(|l| l.strip_prefix("model name"));
    let load = std::fs::read_to_string("/proc/loadavg").unwrap_or_default();
    let load = load.split(' ').next().unwrap_or("?").to_owned();
    let build = if cfg!(debug_assertions) { "a development build, which is slow" } else { "a release build" };
    let model = model.map_or(std::env::consts::ARCH, |l| l.trim_start_matches([' ', '\t', ':']));
    format!("{model}, {} cores, load average {load} at the end; {build}", process::cores())
}
