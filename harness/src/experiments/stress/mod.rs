//! Stress: every law at every magnitude on every engine, within a time, resumable; what breaks where.

mod findings;
mod report;
#[cfg(test)]
mod tests;

use std::thread;
use std::time::{Duration, Instant};

use luminaire::calculators::inverse_square;
use luminaire::scene::LuminaireModel;
use parking_lot::Mutex;

use self::findings::Finding;
pub use self::findings::{LawReport, PointReport, StressReport};
use super::trials::{Effort, Settings, Trials, simulator};
use super::{Progress, deviation};
use crate::engines::{self, Coordinates, Job};
use crate::judge::{How, KnownBreak};
use crate::laws::{self, Against, Law, Place, Variant};
use crate::measure::{Failure, Instrument, Reader, Taken};
use crate::record::{EngineName, Estimate, ProcedureId, Uncertainty};
use crate::spec::{Budget, Case};

pub struct Options<'a> {
    /// Who takes readings, as many at a time as its machine has slots.
    pub reader: Reader,
    /// No reading starts after this.
    pub time: Duration,
    pub budget: Budget,
    /// Past this one hangs.
    pub limit: Duration,
    /// The laws by name; empty for all.
    pub laws: &'a [String],
    pub magnitudes: Magnitudes,
    pub seed: u64,
    /// Which coordinates renderers get.
    pub coordinates: Coordinates,
    /// What is on record of engines as luxproof drives them.
    pub known: &'a [KnownBreak],
}

/// How far laws are driven.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Magnitudes {
    /// Until something breaks.
    All,
    /// No further than every engine must go.
    Mild,
}

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

    fn report(&self, finding: Option<Finding>) -> PointReport {
        let (tried, finding) = (finding.is_some(), finding.unwrap_or_default());
        PointReport { procedure: self.procedure, magnitude: self.magnitude(), tried, finding }
    }

    /// Extremes first: where the last magnitude holds, the others matter less.
    fn rank(&self) -> usize {
        let last = self.law.magnitudes.len() - 1;
        if self.step == last { 0 } else { 1 + if self.step == 0 { 0 } else { last - self.step } }
    }
}

pub fn stress(case: &Case, subjects: &[Instrument], options: &Options<'_>, progress: &dyn Progress) -> StressReport {
    let points = points(case, subjects, options);
    progress.planned(points.len() as u64);
    let bench = Bench { trials: Trials::new(case, &options.reader, options.time), subjects, options };
    let queue = Mutex::new(Queue {
        findings: vec![None; points.len()],
        taken: vec![false; points.len()],
        spent: vec![Duration::ZERO; subjects.len()],
    });
    thread::scope(|scope| {
        for _ in 0..options.reader.machine.slots.threads() {
            scope.spawn(|| {
                loop {
                    // The lock is let go of at the end of the statement.
                    let next = queue.lock().next(&points);
                    let Some(k) = next else { break };
                    let clock = Instant::now();
                    let finding = bench.finding(&points[k]);
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
    let found = points.iter().zip(findings).map(|(point, finding)| (point.subject, point.law, point.report(finding)));
    StressReport::new(case, subjects, &found.collect::<Vec<_>>(), options.known)
}

fn points(case: &Case, subjects: &[Instrument], options: &Options<'_>) -> Vec<Point> {
    let mut points = vec![];
    let chosen = |law: &&'static Law| options.laws.is_empty() || options.laws.iter().any(|l| l == law.id);
    for subject in 0..subjects.len() {
        for law in laws::all().filter(chosen) {
            // What is read in free field, an intensity say, is direct light, whose laws direct illuminance keeps as well.
            let tasks = case.tasks().filter(|task| task.scene.room.is_some());
            for task in tasks.filter(|t| law.light.concerns(t.transport)) {
                let mut base = Job::of_task(case, &task);
                // Where rounding decides between two values, a changed scene may read the other.
                base.stations.retain(|s| inverse_square::jump(&base.scene, &s.meter).value() == 0.0);
                let says =
                    |step: &usize| !base.stations.is_empty() && (law.variant)(&base, law.magnitudes[*step]).is_some();
                let tried = |step: &usize| options.magnitudes == Magnitudes::All || *step == law.mild();
                let steps = (0..law.magnitudes.len()).filter(tried).filter(says);
                let point = |step| Point { subject, law, step, procedure: task.procedure, base: base.clone() };
                points.extend(steps.map(point));
            }
        }
    }
    points
}

struct Queue {
    findings: Vec<Option<Finding>>,
    taken: Vec<bool>,
    spent: Vec<Duration>,
}

impl Queue {
    /// The next point: of the engine that had the least time, the most telling one; none twice.
    fn next(&mut self, points: &[Point]) -> Option<usize> {
        let open = (0..points.len()).filter(|k| !self.taken[*k] && !self.hopeless(points, *k));
        let next = open.min_by_key(|&k| (self.spent[points[k].subject], points[k].rank()))?;
        self.taken[next] = true;
        Some(next)
    }

    /// Whether a milder magnitude of the same law hung already: the next would hang as well, and cost as much.
    fn hopeless(&self, points: &[Point], k: usize) -> bool {
        let point = &points[k];
        let alike =
            |p: &Point| p.subject == point.subject && p.law.id == point.law.id && p.procedure == point.procedure;
        let hung = |j: usize| self.findings[j].as_ref().is_some_and(|f| f.how == Some(How::Hang));
        (0..points.len()).any(|j| hung(j) && points[j].step < point.step && alike(&points[j]))
    }
}

struct Bench<'a> {
    trials: Trials<'a>,
    subjects: &'a [Instrument],
    options: &'a Options<'a>,
}

/// Beyond this a deviation of noisy readings has to show again with another seed.
const DOUBTFUL: f64 = 1e-3;
/// Added to a seed for that.
const OTHER_SEED: u64 = 1000;

impl Bench<'_> {
    /// What a point shows; `None` where the time is up.
    fn finding(&self, point: &Point) -> Option<Finding> {
        let variant = (point.law.variant)(&point.base, point.magnitude())?;
        let first = self.once(point, &variant, self.options.seed)?;
        if first.how != Some(How::Drift) || first.deviation.is_none_or(|d| d < DOUBTFUL) || first.is_exact {
            return Some(first);
        }
        // Of many noisy readings some are off by more than three standard errors: once, not twice.
        let again = self.once(point, &variant, self.options.seed + OTHER_SEED)?;
        Some(if again.deviation < first.deviation { again } else { first })
    }

    fn once(&self, point: &Point, variant: &Variant, seed: u64) -> Option<Finding> {
        let of_law = |part| Some(Place { law: point.law.id.to_owned(), magnitude: point.magnitude(), part });
        let own_seed = if point.law.id == "seeds" { seed + point.magnitude() as u64 } else { seed };
        let read = match self.read(point, &variant.job, of_law(0), own_seed)? {
            Ok(changed) => changed.measurement.estimates,
            Err(failure) => return Some(Finding::failed(&failure)),
        };
        // What the engine reads of the job as it is: the scale on which darkness counts.
        let base = self.read(point, &point.base, None, seed)?.map(|taken| taken.measurement.estimates);
        let brightest_lx = base.iter().flatten().map(|e| e.value).fold(0.0, f64::max);
        let right = match &variant.against {
            Against::Base(factor) => base.map(|base| base.iter().map(|e| e.times(*factor)).collect()),
            Against::Sum(parts) => {
                let mut sum = vec![Estimate::exact(0.0); read.len()];
                for (k, part) in parts.iter().enumerate() {
                    match self.read(point, part, of_law(k + 1), seed)? {
                        Ok(part) => sum = sum.iter().zip(&part.measurement.estimates).map(|(a, b)| a.plus(b)).collect(),
                        Err(failure) => return Some(Finding::without_base(&failure)),
                    }
                }
                Ok(sum)
            }
            Against::Known(values) => Ok(values.iter().map(|v| Estimate::exact(*v)).collect()),
            Against::Mean { weights, value_lx } => {
                let quadrature = laws::error_of_mean(&variant.job, weights);
                let right = Estimate { value: *value_lx, uncertainty: Uncertainty::Bound(quadrature * value_lx) };
                let found = deviation::compare(&[Estimate::of_one_run(weights, &read)], &[right], brightest_lx);
                return Some(Finding::of(&found));
            }
            Against::Witness => self.witness(&variant.job, of_law(0))?.map(|taken| taken.measurement.estimates),
        };
        Some(match right {
            Ok(right) => Finding::of(&deviation::compare(&read, &right, brightest_lx)),
            Err(failure) => Finding::without_base(&failure),
        })
    }

    fn read(&self, point: &Point, job: &Job, variant: Option<Place>, seed: u64) -> Option<Result<Taken, Failure>> {
        let subject = &self.subjects[point.subject];
        let name = subject.engine.name();
        let mut settings = self.trials.case.settings_of(&name);
        if name == EngineName::SIMULATOR {
            settings.insert("relative_error".into(), own_accuracy(job).into());
        } else if self.options.coordinates == Coordinates::Raw {
            let key = engines::entry(&name).and_then(|entry| entry.fits_coordinates);
            settings.extend(key.map(|key| (key.into(), false.into())));
        }
        self.trials.take(subject, job, &settings, self.effort(seed), (variant, 0))
    }

    /// The exact simulation of a changed job, finer than the simulator is asked for as an engine.
    fn witness(&self, job: &Job, variant: Option<Place>) -> Option<Result<Taken, Failure>> {
        let settings = Settings::from([("relative_error".to_owned(), (0.1 * own_accuracy(job)).into())]);
        self.trials.take(&simulator(), job, &settings, self.effort(self.options.seed), (variant, 0))
    }

    fn effort(&self, seed: u64) -> Effort {
        Effort { budget: self.options.budget, seed, limit: self.options.limit, threads: 1 }
    }
}

/// How fine the simulator works: much finer than what is looked for, where its fast solvers reach that.
fn own_accuracy(job: &Job) -> f64 {
    let points = job.scene.luminaires.iter().all(|l| l.model == LuminaireModel::Point);
    if points && job.scene.obstacles.is_empty() { 1e-4 } else { 5e-3 }
}

pub fn concerns(case: &Case) -> bool {
    [ProcedureId::DirectIlluminance, ProcedureId::IndirectIlluminance].into_iter().any(|p| case.task(p).is_some())
}
