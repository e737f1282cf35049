//! Readings of every procedure again and again, each time with another seed: what honesty of standard errors is told by.

mod group;
mod honesty;
mod view;

use crate::engines::Job;
use crate::experiments::Progress;
use crate::measure::{Failure, Question, Reader};
use crate::plan::{Asked, Plan, Planner, Run, Selection, Skip, Skipping};
use crate::record::{EngineName, Estimate, MeterId, ReadingKey, design_effect_of_squares};
use crate::spec::{Budget, Case, SpecError};
use crate::system::random::seed;
use crate::system::slots::side_by_side;

pub use group::{Finding, Group, Worst};
pub use honesty::{Honesty, OfEngine};

pub struct Options<'a> {
    pub reader: Reader,
    /// Engines, procedures, and the seed that all others come from.
    pub selection: Selection,
    pub seeds: usize,
    pub relative_error: Option<f64>,
    pub seconds: Option<f64>,
    pub progress: &'a dyn Progress,
}

/// What one engine read of one procedure of one case.
struct Repeated {
    key: ReadingKey,
    version: String,
    meters: Vec<MeterId>,
    /// Meter by meter, seed by seed.
    readings: Vec<Vec<Estimate>>,
    /// By part of the light that was sampled, block by block, how far meters are from their means.
    deviates: Vec<Vec<Vec<f64>>>,
    failure: Option<Failure>,
}

impl Repeated {
    /// How much of their noise meters share, see [`design_effect_of_squares`], in the part of the light that shares the most.
    fn shared(&self) -> Option<f64> {
        self.deviates.iter().map(|part| design_effect_of_squares(part)).reduce(f64::max)
    }
}

/// Lets renderers read every procedure of the cases with so many seeds, and holds the scatter against what they state. Our own
/// solvers do not take part, for nothing is held against them.
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
    let is_renderer = |plan: &Plan, run: &Run| !plan.engines[run.engine].engine.is_witness();
    let all = plans.iter().flat_map(|plan| plan.runs.iter().map(move |run| (plan, run)));
    let runs: Vec<(&Plan, &Run)> = all.filter(|(plan, run)| is_renderer(plan, run)).collect();
    options.progress.planned((runs.len() * options.seeds) as u64);
    let found = side_by_side(options.reader.machine.slots.threads(), &runs, |(plan, run)| read(plan, run, options));
    let is_whole =
        |s: &&Skip| s.scope.leaves_no_reading() && ![EngineName::SIMULATOR, EngineName::IESNA].contains(&s.key.engine);
    let skips = plans.iter().flat_map(|plan| &plan.skips).filter(is_whole).cloned();
    let is_missed = |plan: &Plan| plan.engines.iter().any(|p| p.asked == Asked::ByName && p.is_absent());
    let mut honesty = Honesty::of(options.seeds, &found);
    honesty.skips.extend(skips);
    honesty.is_missed = plans.iter().any(is_missed);
    Ok(honesty)
}

/// Engines that are determined are asked twice, which shows that they are.
fn read(plan: &Plan, run: &Run, options: &Options<'_>) -> Repeated {
    let (planned, task) = (&plan.engines[run.engine], &plan.tasks[run.task]);
    let mut found = Repeated {
        key: ReadingKey::new(&run.job.case, task.procedure, planned.engine.name()),
        version: planned.version().unwrap_or_default(),
        meters: task.targets.iter().map(|t| t.id.clone()).collect(),
        readings: vec![vec![]; task.targets.len()],
        deviates: vec![],
        failure: None,
    };
    let Some(instrument) = planned.instrument() else { return found };
    for number in 0..options.seeds {
        let is_determined = number == 2 && !found.readings.iter().flatten().any(|e| e.uncertainty.is_sampled());
        if is_determined || found.failure.is_some() {
            options.progress.ended(found.key.to_string(), (options.seeds - number) as u64);
            break;
        }
        let own = u64::from(seed(&[options.selection.seed, number as u64]));
        let job = Job { seed: own, ..run.job.clone() };
        match options.reader.read(&Question::new(&instrument, &job, task.procedure.name())) {
            Ok(taken) => {
                let again = taken.measurement.readings(&task.targets);
                let parts = taken.measurement.deviates(&task.targets);
                found.deviates.resize(parts.len().max(found.deviates.len()), vec![]);
                found.deviates.iter_mut().zip(parts).for_each(|(all, part)| all.extend(part));
                found.readings.iter_mut().zip(again).for_each(|(readings, one)| readings.push(one));
            }
            Err(failure) => found.failure = Some(failure),
        }
        options.progress.ended(format!("{}, seed {} of {}", found.key, number + 1, options.seeds), 1);
    }
    found
}
