//! Repeated readings of every procedure with other seeds, which show whether standard errors are
//! honest.

mod group;
mod honesty;
mod view;

use crate::Progress;
use luxproof_audit::measure::{Failure, Question, Reader};
use luxproof_audit::plan::{Plan, Planner, Run, Selection, SelectionReason, Skipping};
use luxproof_engines::Job;
use luxproof_model::{EngineName, Estimate, MeterId, ReadingKey, Skip};
use luxproof_process::random::seed;
use luxproof_process::slots::side_by_side;
use luxproof_spec::{Budget, Case, SpecError};
use luxproof_statistics::design_effect_of_squares;

pub use group::{Finding, Group, WorstMeter};
pub use honesty::{EngineHonesty, Honesty};

/// The input of [`repetitions`].
pub struct Options<'a> {
    pub reader: Reader,
    /// The engines, the procedures, and the seed from which all others are derived.
    pub selection: Selection,
    pub seeds: usize,
    pub relative_error: Option<f64>,
    pub seconds: Option<f64>,
    pub progress: &'a dyn Progress,
}

/// The readings of one engine in one procedure of one case.
struct RepeatedReadings {
    key: ReadingKey,
    version: String,
    meters: Vec<MeterId>,
    /// For each meter, the reading with each seed.
    readings: Vec<Vec<Estimate>>,
    /// For each sampled part of the light and each block, the deviations of the meters from their
    /// means.
    deviates: Vec<Vec<Vec<f64>>>,
    failure: Option<Failure>,
}

impl RepeatedReadings {
    /// How much noise the meters share ([`design_effect_of_squares`]), in the part of the light
    /// with the largest value.
    fn shared_noise(&self) -> Option<f64> {
        self.deviates.iter().map(|part| design_effect_of_squares(part)).reduce(f64::max)
    }
}

/// Reads every procedure of the cases with a number of seeds by every renderer, and compares the
/// scatter with the stated errors. Our own solvers do not take part, because they sample nothing.
pub fn repetitions(cases: &mut [Case], options: &Options<'_>) -> Result<Honesty, SpecError> {
    let mut planner = Planner::new(&options.selection, &options.reader.site, Skipping::Nothing);
    let mut plans = vec![];
    for case in cases.iter_mut() {
        let Budget { relative_error, seconds } = case.budget;
        case.budget = Budget {
            relative_error: options.relative_error.unwrap_or(relative_error),
            seconds: options.seconds.unwrap_or(seconds),
        };
        plans.push(planner.plan(case)?);
    }
    // A reference engine is one of our own solvers.
    let all = plans.iter().flat_map(|plan| plan.runs.iter().map(move |run| (plan, run)));
    let runs: Vec<(&Plan, &Run)> =
        all.filter(|(plan, run)| !plan.engines[run.engine].engine.is_reference_engine()).collect();
    options.progress.planned((runs.len() * options.seeds) as u64);
    let threads = options.reader.machine.slots.threads();
    let found = side_by_side(threads, &runs, |(plan, run)| read_repeatedly(plan, run, options));
    let mut honesty = Honesty::from_readings(options.seeds, &found);
    let skips = plans.iter().flat_map(|plan| &plan.skips);
    honesty.skips.extend(skips.filter(|skip| skips_renderer(skip)).cloned());
    honesty.is_missed =
        plans.iter().flat_map(|plan| &plan.engines).any(|p| p.asked == SelectionReason::ByName && p.is_absent());
    Ok(honesty)
}

/// Whether a skip leaves a renderer without a reading.
fn skips_renderer(skip: &Skip) -> bool {
    skip.scope.leaves_no_reading() && ![EngineName::SIMULATOR, EngineName::IESNA].contains(&skip.key.engine)
}

/// Reads a procedure with all seeds. A deterministic engine is read twice, which shows that it is
/// deterministic.
fn read_repeatedly(plan: &Plan, run: &Run, options: &Options<'_>) -> RepeatedReadings {
    let (planned, task) = (&plan.engines[run.engine], &plan.tasks[run.task]);
    let mut found = RepeatedReadings {
        key: ReadingKey::new(&run.job.case, task.procedure, planned.engine.name()),
        version: planned.version().unwrap_or_default(),
        meters: task.targets.iter().map(|t| t.id.clone()).collect(),
        readings: vec![vec![]; task.targets.len()],
        deviates: vec![],
        failure: None,
    };
    let Some(instrument) = planned.instrument() else { return found };
    for number in 0..options.seeds {
        let is_sampled = found.readings.iter().flatten().any(|e| e.uncertainty.is_sampled());
        let is_determined = number == 2 && !is_sampled;
        if is_determined || found.failure.is_some() {
            options.progress.ended(found.key.to_string(), (options.seeds - number) as u64);
            break;
        }
        let job_seed = u64::from(seed(&[options.selection.seed, number as u64]));
        let job = Job { seed: job_seed, ..run.job.clone() };
        match options.reader.read(&Question::new(&instrument, &job, task.procedure.name())) {
            Ok(taken) => {
                let estimates = taken.measurement.readings(&task.targets);
                let parts = taken.measurement.deviates(&task.targets);
                // Another solver may sample other parts with another seed.
                found.deviates.resize(parts.len().max(found.deviates.len()), vec![]);
                found.deviates.iter_mut().zip(parts).for_each(|(all, part)| all.extend(part));
                found.readings.iter_mut().zip(estimates).for_each(|(all, estimate)| all.push(estimate));
            }
            Err(failure) => found.failure = Some(failure),
        }
        options.progress.ended(format!("{}, seed {} of {}", found.key, number + 1, options.seeds), 1);
    }
    found
}
