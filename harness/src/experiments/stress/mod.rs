//! Stress: every law at every magnitude on every engine, within a time, resumable; what breaks where.

mod findings;
pub(crate) mod judge;

mod report;
#[cfg(test)]
mod tests;

use std::collections::BTreeMap;
use std::sync::Mutex;
use std::thread;
use std::time::{Duration, Instant};

use luminaire::scene::LuminaireModel;

use self::findings::{Finding, How};
pub use self::findings::{LawReport, PointReport, StressReport};
use crate::engines::{self, Job};
use crate::judge::KnownBreak;
use crate::laws::{self, Against, Law, Place, Variant};
use crate::measure::{FailureKind, Laboratory, Outcome, Request, Shelf, Subject, task};
use crate::record::{EngineName, Estimate, ProcedureId, ReadingKey, Uncertainty};
use crate::spec::{Budget, Case};
use crate::system::process;

/// How to stress.
pub struct Options<'a> {
    /// Where readings are taken.
    pub laboratory: Laboratory,
    /// Where finished readings are kept.
    pub shelf: Shelf,
    /// Readings at a time.
    pub jobs: usize,
    /// No reading starts after this.
    pub time: Duration,
    /// What one reading may take.
    pub budget: Budget,
    /// Past this one hangs.
    pub limit: Duration,
    /// The laws by name; empty for all.
    pub laws: &'a [String],
    /// Seed of every random choice.
    pub seed: u64,
    /// Which coordinates renderers get.
    pub coordinates: Coordinates,
    /// What is on record of engines as luxproof drives them.
    pub known: &'a [KnownBreak],
}

/// Which coordinates renderers get.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Coordinates {
    /// As luxproof exports them: moved and scaled where that helps.
    Fitted,
    /// Those of the scene, to see how a renderer itself bears them.
    Raw,
}

/// Told of every point as it ends.
pub trait Progress: Sync {
    /// So many points there are.
    fn planned(&self, points: usize);
    /// A point ended.
    fn ended(&self, engine: &str, law: &str, magnitude: f64);
}

/// One law at one magnitude on one engine's reading of one procedure.
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

    /// Extremes first: where the last magnitude holds, the others matter less.
    fn rank(&self) -> usize {
        let last = self.law.magnitudes.len() - 1;
        if self.step == last { 0 } else { 1 + if self.step == 0 { 0 } else { last - self.step } }
    }
}

/// Stresses engines with a case.
pub fn stress(case: &Case, subjects: &[Subject], options: &Options<'_>, progress: &dyn Progress) -> StressReport {
    let points = points(case, subjects, options);
    progress.planned(points.len());
    let bench = Bench { case, subjects, options, until: Instant::now() + options.time };
    let queue = Mutex::new(Queue::new(points.len(), subjects.len()));
    thread::scope(|scope| {
        for _ in 0..options.jobs.max(1) {
            scope.spawn(|| {
                loop {
                    // The lock is let go of at the end of the statement.
                    let next = lock(&queue).next(&points);
                    let Some(k) = next else { break };
                    let clock = Instant::now();
                    let finding = bench.finding(&points[k]);
                    progress.ended(&bench.id(points[k].subject), points[k].law.id, points[k].magnitude());
                    lock(&queue).ended(&points, k, finding, clock.elapsed());
                }
            });
        }
    });
    let findings = lock(&queue).findings.clone();
    let of = |k: usize| (points[k].subject, points[k].law, points[k].procedure, points[k].step, findings[k].clone());
    StressReport::new(case, subjects, (0..points.len()).map(of).collect(), options.known)
}

fn lock<T>(mutex: &Mutex<T>) -> std::sync::MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(std::sync::PoisonError::into_inner)
}

fn points(case: &Case, subjects: &[Subject], options: &Options<'_>) -> Vec<Point> {
    let mut points = vec![];
    let chosen = |law: &&&'static Law| options.laws.is_empty() || options.laws.iter().any(|l| l == law.id);
    for subject in 0..subjects.len() {
        for law in laws::ALL.iter().filter(chosen) {
            // Intensities are direct light in free field, whose laws direct illuminance keeps as well.
            let tasks = case.tasks().filter(|task| task.procedure != ProcedureId::LuminousIntensity);
            for task in tasks.filter(|t| law.light.concerns(t.transport)) {
                let base = Job::of_task(case, &task);
                let says = |step: &usize| (law.variant)(&base, law.magnitudes[*step]).is_some();
                let steps = (0..law.magnitudes.len()).filter(says);
                let point = |step| Point { subject, law, step, procedure: task.procedure, base: base.clone() };
                points.extend(steps.map(point));
            }
        }
    }
    points
}

/// What is under way and what is done.
struct Queue {
    findings: Vec<Option<Finding>>,
    taken: Vec<bool>,
    spent: Vec<Duration>,
}

impl Queue {
    fn new(points: usize, subjects: usize) -> Self {
        Self { findings: vec![None; points], taken: vec![false; points], spent: vec![Duration::ZERO; subjects] }
    }

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

    fn ended(&mut self, points: &[Point], k: usize, finding: Option<Finding>, took: Duration) {
        self.spent[points[k].subject] += took;
        self.findings[k] = finding;
    }
}

/// Takes the readings of points and judges them.
struct Bench<'a> {
    case: &'a Case,
    subjects: &'a [Subject],
    options: &'a Options<'a>,
    until: Instant,
}

/// Beyond this a deviation of noisy readings has to show again with another seed.
const DOUBTFUL: f64 = 1e-3;
/// Added to a seed for that.
const OTHER_SEED: u64 = 1000;

impl Bench<'_> {
    fn id(&self, subject: usize) -> EngineName {
        self.subjects[subject].engine.name()
    }

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
        let changed = self.read(point, &variant.job, of_law(0), own_seed)?;
        if let Some(failure) = &changed.failure {
            return if failure.kind == FailureKind::Interrupted { None } else { Some(Finding::failed(failure)) };
        }
        // What the engine reads of the job as it is: the scale on which darkness counts.
        let base = self.read(point, &point.base, None, seed)?;
        let brightest_lx = base.estimates.iter().map(|e| e.value).fold(0.0, f64::max);
        let read = &changed.estimates;
        let right = match &variant.against {
            Against::Base(factor) => match &base.failure {
                None => base.estimates.iter().map(|e| e.times(*factor)).collect(),
                Some(failure) => return Some(Finding::without_base(failure)),
            },
            Against::Sum(parts) => {
                let mut sum = vec![Estimate::exact(0.0); read.len()];
                for (k, part) in parts.iter().enumerate() {
                    let part = self.read(point, part, of_law(k + 1), seed)?;
                    if let Some(failure) = &part.failure {
                        return Some(Finding::without_base(failure));
                    }
                    judge::add(&mut sum, &part.estimates);
                }
                sum
            }
            Against::Known(values) => values.iter().map(|v| Estimate::exact(*v)).collect(),
            Against::Mean { weights, value_lx, quadrature } => {
                let right = Estimate { value: *value_lx, uncertainty: Uncertainty::Bound(quadrature * value_lx) };
                let found = judge::compare(&[Estimate::of_one_run(weights, read)], &[right], brightest_lx);
                return Some(Finding::of(&found));
            }
            Against::Witness => {
                let witness = self.witness(point, &variant.job, of_law(0))?;
                if let Some(failure) = &witness.failure {
                    return Some(Finding::without_base(failure));
                }
                witness.estimates
            }
        };
        Some(Finding::of(&judge::compare(read, &right, brightest_lx)))
    }

    /// One reading by the point's engine, from the shelf or fresh; `None` where the time is up.
    fn read(&self, point: &Point, job: &Job, place: Option<Place>, seed: u64) -> Option<Outcome> {
        let subject = &self.subjects[point.subject];
        let id = subject.engine.name();
        let mut settings = self.case.settings_of(id.as_str());
        match (id.as_str(), self.options.coordinates) {
            (name, _) if name == EngineName::SIMULATOR.as_str() => {
                settings.insert("relative_error".into(), Self::own_accuracy(job).into());
            }
            (_, Coordinates::Fitted) => {}
            (name, Coordinates::Raw) => {
                let key = engines::entry(name).and_then(|entry| entry.fits_coordinates);
                settings.extend(key.map(|key| (key.to_owned(), false.into())));
            }
        }
        self.take(subject, point, job, place, (settings, seed))
    }

    /// The exact simulation of a changed job, finer than the simulator is asked for as an engine.
    fn witness(&self, point: &Point, job: &Job, place: Option<Place>) -> Option<Outcome> {
        let engine = (engines::entry(&EngineName::SIMULATOR)?.make)();
        let subject = Subject { engine, version: env!("CARGO_PKG_VERSION").to_owned() };
        let settings = BTreeMap::from([("relative_error".to_owned(), (0.1 * Self::own_accuracy(job)).into())]);
        self.take(&subject, point, job, place, (settings, self.options.seed))
    }

    /// How fine the simulator works: much finer than what is looked for, where its fast solvers reach that.
    fn own_accuracy(job: &Job) -> f64 {
        let points = job.scene.luminaires.iter().all(|l| l.model == LuminaireModel::Point);
        if points && job.scene.obstacles.is_empty() { 1e-4 } else { 5e-3 }
    }

    fn take(
        &self,
        subject: &Subject,
        point: &Point,
        job: &Job,
        place: Option<Place>,
        (settings, seed): (BTreeMap<String, serde_json::Value>, u64),
    ) -> Option<Outcome> {
        let request = Request {
            spec: self.case.path.clone(),
            spec_sha256: self.case.sha256.clone(),
            key: ReadingKey::new(&self.case.name, point.procedure, subject.engine.name()),
            version: subject.version.clone(),
            place,
            settings: settings.clone(),
            budget: self.options.budget,
            seed,
            jobs: 1,
            limit_s: self.options.limit.as_secs_f64(),
        };
        if let Some(kept) = self.options.shelf.find(&request) {
            return Some(kept);
        }
        if Instant::now() >= self.until || process::is_interrupted() {
            return None;
        }
        let job = Job { settings, budget: self.options.budget, seed, ..job.clone() };
        let outcome = self.options.laboratory.read(subject.engine.as_ref(), &job, &request);
        if let Err(error) = self.options.shelf.keep(&request, &outcome) {
            tracing::warn!(%error, "a finished reading could not be kept");
        }
        (outcome.failure_kind() != Some(FailureKind::Interrupted)).then_some(outcome)
    }
}

/// Whether a case holds anything to stress.
pub fn concerns(case: &Case) -> bool {
    [ProcedureId::DirectIlluminance, ProcedureId::IndirectIlluminance].into_iter().any(|p| task(case, p).is_some())
}
