//! Stress: every law at every magnitude on every engine within a time. An interrupted run continues
//! from its readings.

mod findings;
mod report;
#[cfg(test)]
mod tests;

use std::thread;
use std::time::{Duration, Instant};

use luxproof_calculators::inverse_square;
use luxproof_scene::LuminaireModel;
use parking_lot::Mutex;

use self::findings::{Finding, PointResult};
pub use self::findings::{LawReport, PointReport, StressReport};
use super::trials::{Effort, Settings, Trials, simulator};
use super::{Progress, deviation};
use luxproof_audit::measure::{CostedMeasurement, Failure, Instrument, Reader};
use luxproof_engines::{Coordinates, Job};
use luxproof_laws::{Against, Law, Place, Variant};
use luxproof_model::{EngineName, Estimate, LawBreach, ProcedureId, Uncertainty};
use luxproof_spec::{Budget, Case};
use luxproof_verdict::KnownBreak;

/// The input of [`stress`].
pub struct Options<'a> {
    /// Takes the readings, as many at a time as its machine has slots.
    pub reader: Reader,
    /// No reading starts after this time.
    pub time: Duration,
    pub budget: Budget,
    /// A reading that takes longer hangs.
    pub limit: Duration,
    /// The laws by name; empty for all.
    pub laws: &'a [String],
    pub magnitudes: Magnitudes,
    pub seed: u64,
    /// The coordinates that renderers get.
    pub coordinates: Coordinates,
    /// The breaks on record, for engines as luxproof drives them.
    pub known: &'a [KnownBreak],
}

/// Which magnitudes of the laws are tried.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Magnitudes {
    /// All of them, until something breaks.
    All,
    /// Only the one that every engine must pass.
    Mild,
}

/// A law at a magnitude, on an engine and a procedure.
struct Point {
    subject: usize,
    law: &'static Law,
    step: usize,
    procedure: ProcedureId,
    base: Job,
}

impl Point {
    fn magnitude(&self) -> f64 {
        self.law.magnitudes[self.step]
    }

    /// The report of a point; a finding of `None` stands for a point that was not tried.
    fn report(&self, finding: Option<Finding>) -> PointReport {
        let (tried, finding) = (finding.is_some(), finding.unwrap_or_default());
        PointReport { procedure: self.procedure, magnitude: self.magnitude(), tried, finding }
    }

    /// The rank of the magnitude in the queue: first the most extreme, then the mildest, then from
    /// extreme to mild. Where the most extreme passes, the others matter less.
    fn rank(&self) -> usize {
        let last = self.law.magnitudes.len() - 1;
        match self.step {
            step if step == last => 0,
            0 => 1,
            step => 1 + last - step,
        }
    }
}

/// Tries all points within the time and reports what breaks.
pub fn stress(case: &Case, subjects: &[Instrument], options: &Options<'_>, progress: &dyn Progress) -> StressReport {
    let points = list_points(case, subjects, options);
    progress.planned(points.len() as u64);
    let runner = PointRunner { trials: Trials::new(case, &options.reader, options.time), subjects, options };
    let queue = Mutex::new(Queue {
        findings: vec![None; points.len()],
        taken: vec![false; points.len()],
        spent: vec![Duration::ZERO; subjects.len()],
    });
    thread::scope(|scope| {
        for _ in 0..options.reader.machine.slots.threads() {
            scope.spawn(|| {
                loop {
                    // The lock ends with the statement, so that other threads can take points
                    // meanwhile.
                    let next = queue.lock().next(&points);
                    let Some(k) = next else { break };
                    let clock = Instant::now();
                    let finding = runner.run_point(&points[k]);
                    let engine = subjects[points[k].subject].engine.name();
                    progress.ended(format!("{engine}: {} {:e}", points[k].law.id, points[k].magnitude()), 1);
                    let mut queue = queue.lock();
                    queue.spent[points[k].subject] += clock.elapsed();
                    queue.findings[k] = finding;
                }
            });
        }
    });
    let findings = queue.into_inner().findings;
    let results = points.iter().zip(findings).map(|(point, finding)| PointResult {
        subject: point.subject,
        law: point.law,
        report: point.report(finding),
    });
    StressReport::new(case, subjects, &results.collect::<Vec<_>>(), options.known)
}

/// Lists all points that apply to a case.
fn list_points(case: &Case, subjects: &[Instrument], options: &Options<'_>) -> Vec<Point> {
    let mut points = vec![];
    for subject in 0..subjects.len() {
        for law in luxproof_laws::all() {
            if !options.laws.is_empty() && !options.laws.iter().any(|name| name == law.id) {
                continue;
            }
            // A free-field quantity, for example intensity, is direct light, whose laws direct
            // illuminance obeys, too.
            let tasks = case.tasks().filter(|task| task.scene.room.is_some());
            for task in tasks.filter(|t| law.light.concerns(t.transport)) {
                let mut base = Job::of_task(case, &task);
                // At a jump, rounding decides between two values, so a changed scene may read the
                // other one.
                base.sensors.retain(|s| inverse_square::jump(&base.scene, &s.meter).value() == 0.0);
                for step in 0..law.magnitudes.len() {
                    let is_tried = options.magnitudes == Magnitudes::All || step == law.mild();
                    // A law without a variant says nothing about this job.
                    if is_tried && !base.sensors.is_empty() && (law.variant)(&base, law.magnitudes[step]).is_some() {
                        points.push(Point { subject, law, step, procedure: task.procedure, base: base.clone() });
                    }
                }
            }
        }
    }
    points
}

/// Which points were taken, and what they showed.
struct Queue {
    findings: Vec<Option<Finding>>,
    taken: Vec<bool>,
    /// The time that each engine took so far.
    spent: Vec<Duration>,
}

impl Queue {
    /// Takes the next point: the one of the least rank of the engine that took the least time.
    fn next(&mut self, points: &[Point]) -> Option<usize> {
        let open = (0..points.len()).filter(|k| !self.taken[*k] && !self.is_hopeless(points, *k));
        let next = open.min_by_key(|&k| (self.spent[points[k].subject], points[k].rank()))?;
        self.taken[next] = true;
        Some(next)
    }

    /// Whether a milder magnitude of the same law hung. The next one would hang, too, and cost as
    /// much.
    fn is_hopeless(&self, points: &[Point], k: usize) -> bool {
        let point = &points[k];
        let mut milder = points.iter().zip(&self.findings).filter(|(p, _)| {
            p.subject == point.subject
                && p.law.id == point.law.id
                && p.procedure == point.procedure
                && p.step < point.step
        });
        milder.any(|(_, finding)| finding.as_ref().is_some_and(|f| f.how == Some(LawBreach::Hang)))
    }
}

/// Reads points and compares them with what the laws demand.
struct PointRunner<'a> {
    trials: Trials<'a>,
    subjects: &'a [Instrument],
    options: &'a Options<'a>,
}

/// A larger relative deviation of noisy readings has to show again with another seed.
const REPEATED_DEVIATION: f64 = 1e-3;
/// The distance of that other seed.
const SEED_STEP: u64 = 1000;

/// The place of a part of a point's changed job.
fn place_of(point: &Point, part: usize) -> Place {
    Place { law: point.law.id.to_owned(), magnitude: point.magnitude(), part }
}

impl PointRunner<'_> {
    /// The finding of a point; `None` where the time is up.
    fn run_point(&self, point: &Point) -> Option<Finding> {
        let variant = (point.law.variant)(&point.base, point.magnitude())?;
        let first = self.compare_once(point, &variant, self.options.seed)?;
        let is_small = first.deviation.is_none_or(|d| d < REPEATED_DEVIATION);
        if first.how != Some(LawBreach::Drift) || is_small || first.is_exact {
            return Some(first);
        }
        // Of many noisy readings some deviate by more than three standard errors by chance, but
        // rarely twice.
        let repeated = self.compare_once(point, &variant, self.options.seed + SEED_STEP)?;
        Some(if repeated.deviation < first.deviation { repeated } else { first })
    }

    /// Reads a changed job and compares it with the right reading, with one seed.
    fn compare_once(&self, point: &Point, variant: &Variant, seed: u64) -> Option<Finding> {
        // The law of seeds changes nothing else.
        let variant_seed = if point.law.id == "seeds" { seed + point.magnitude() as u64 } else { seed };
        let read = match self.read(point, &variant.job, Some(place_of(point, 0)), variant_seed)? {
            Ok(changed) => changed.measurement.estimates,
            Err(failure) => return Some(Finding::from_failure(&failure)),
        };
        // The reading of the unchanged job is the scale in darkness.
        let base = self.read(point, &point.base, None, seed)?.map(|taken| taken.measurement.estimates);
        let brightest_lx = base.iter().flatten().map(|e| e.value).fold(0.0, f64::max);
        let right = match &variant.against {
            Against::Base(factor) => base.map(|base| base.iter().map(|e| e.times(*factor)).collect()),
            Against::Sum(parts) => self.read_sum(point, parts, seed, read.len())?,
            Against::Known(values) => Ok(values.iter().map(|v| Estimate::exact(*v)).collect()),
            Against::Mean { weights, value_lx } => {
                let quadrature = luxproof_laws::error_of_mean(&variant.job, weights);
                let right = Estimate { value: *value_lx, uncertainty: Uncertainty::Bound(quadrature * value_lx) };
                let found = deviation::compare(&[Estimate::of_one_run(weights, &read)], &[right], brightest_lx);
                return Some(Finding::from_deviation(&found));
            }
            Against::Witness => {
                let taken = self.read_exactly(&variant.job, Some(place_of(point, 0)))?;
                taken.map(|taken| taken.measurement.estimates)
            }
        };
        Some(match right {
            Ok(right) => Finding::from_deviation(&deviation::compare(&read, &right, brightest_lx)),
            Err(failure) => Finding::without_reference(&failure),
        })
    }

    /// Reads several jobs and adds their readings at each of a number of sensors; `None` where the
    /// time is up.
    fn read_sum(
        &self,
        point: &Point,
        parts: &[Job],
        seed: u64,
        sensors: usize,
    ) -> Option<Result<Vec<Estimate>, Failure>> {
        let mut sum = vec![Estimate::exact(0.0); sensors];
        for (k, part) in parts.iter().enumerate() {
            match self.read(point, part, Some(place_of(point, k + 1)), seed)? {
                Ok(part) => sum = sum.iter().zip(&part.measurement.estimates).map(|(a, b)| a.plus(b)).collect(),
                Err(failure) => return Some(Err(failure)),
            }
        }
        Some(Ok(sum))
    }

    /// Reads a job of a point by the engine under test; `None` where the time is up.
    fn read(
        &self,
        point: &Point,
        job: &Job,
        variant: Option<Place>,
        seed: u64,
    ) -> Option<Result<CostedMeasurement, Failure>> {
        let subject = &self.subjects[point.subject];
        let name = subject.engine.name();
        let mut settings = self.trials.case.settings_of(&name);
        if name == EngineName::SIMULATOR {
            settings.insert("relative_error".into(), simulator_accuracy(job).into());
        } else if self.options.coordinates == Coordinates::Raw {
            let key = luxproof_engines::entry(&name).and_then(|entry| entry.fits_coordinates);
            settings.extend(key.map(|key| (key.into(), false.into())));
        }
        self.trials.take(subject, job, &settings, self.effort(seed), (variant, 0))
    }

    /// Reads a changed job by the exact simulation, ten times finer than the simulator as an engine
    /// under test.
    fn read_exactly(&self, job: &Job, variant: Option<Place>) -> Option<Result<CostedMeasurement, Failure>> {
        let settings = Settings::from([("relative_error".to_owned(), (0.1 * simulator_accuracy(job)).into())]);
        self.trials.take(&simulator(), job, &settings, self.effort(self.options.seed), (variant, 0))
    }

    fn effort(&self, seed: u64) -> Effort {
        Effort { budget: self.options.budget, seed, limit: self.options.limit, threads: 1 }
    }
}

/// The relative error of the simulator: much finer than the thresholds where its fast solvers reach
/// that.
fn simulator_accuracy(job: &Job) -> f64 {
    let points = job.scene.luminaires.iter().all(|l| l.model == LuminaireModel::Point);
    if points && job.scene.obstacles.is_empty() { 1e-4 } else { 5e-3 }
}

/// Whether a case has a procedure that laws apply to.
pub fn concerns(case: &Case) -> bool {
    [ProcedureId::DirectIlluminance, ProcedureId::IndirectIlluminance].into_iter().any(|p| case.task(p).is_some())
}
