//! Sampling until comparisons are decided: which budget first looks get, and further looks through the run's reader.

use clap::ValueEnum;

use super::jobs::{self, Options, Outcome};
use super::sequential::{self, Ask, Sampler};
use crate::engines::Measurement;
use crate::judge::Judge;
use crate::measure::{Question, Reader, Source};
use crate::plan::{Plan, Planned, Run};
use crate::procedures::Task;
use crate::record::Recording;
use crate::spec::Case;
use crate::system::files::FileError;

/// When sampling stops.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum Sampling {
    /// At the relative error of the spec's budget; beyond it only what is undecided
    #[default]
    Accurate,
    /// As soon as every comparison is decided, which is much earlier where readings agree
    Decided,
}

impl Sampling {
    /// Gives the jobs of a plan the budget of their first look.
    pub(super) fn grant(self, judge: &Judge<'_>, plan: &mut Plan) {
        if self == Self::Accurate {
            return;
        }
        for run in &mut plan.runs {
            let engine = plan.engines[run.engine].engine.name();
            if !plan.engines[run.engine].engine.is_witness() {
                let tolerance = judge.tolerance(&plan.tasks[run.task], engine.as_str());
                run.job.budget = sequential::first_look(run.job.budget, tolerance.relative);
                run.shortcut.job.budget = run.job.budget;
            }
        }
    }
}

/// Takes further looks wherever a comparison is undecided; `told` hears of each.
pub(super) fn sample_on(
    case: &Case,
    plan: &Plan,
    judge: &Judge<'_>,
    options: &Options,
    outcome: &mut Outcome,
    told: &dyn Fn(&str),
) -> Result<(), FileError> {
    let reader = options.reader();
    for run in &plan.runs {
        let (planned, task) = (&plan.engines[run.engine], &plan.tasks[run.task]);
        let engine = planned.engine.name();
        let is_mine = |r: &Recording| r.key.engine == engine.as_str() && r.key.procedure == task.procedure;
        if planned.engine.is_witness() {
            continue;
        }
        let Some(mine) = outcome.recordings.iter().position(is_mine) else { continue };
        let mut subject = outcome.recordings[mine].clone();
        let others =
            outcome.recordings.iter().filter(|r| r.key.procedure == task.procedure && r.key.engine != engine.as_str());
        let others: Vec<&Recording> = others.collect();
        let mut looks = Looks { planned, run, task, reader: &reader, told, from_cache: 0 };
        let before_s = subject.wall_s;
        sequential::refine(judge, task, &others, &mut subject, (run.job.budget, case.budget), &mut looks);
        if run.job.budget != case.budget {
            subject.notes.extend(sequential::saved(&subject, case.budget));
        }
        outcome.from_cache += looks.from_cache;
        if let Some(status) = outcome.engines.iter_mut().find(|e| e.id == engine.as_str()) {
            status.wall_s += subject.wall_s - before_s;
        }
        outcome.recordings[mine] = subject;
        let of_engine: Vec<&Recording> =
            outcome.recordings.iter().filter(|r| r.key.engine == engine.as_str()).collect();
        jobs::keep(&options.out.join("readings"), &engine, &of_engine)?;
    }
    Ok(())
}

/// Further looks of one engine at one task: jobs of the undecided stations alone, each with a seed of its own.
struct Looks<'a> {
    planned: &'a Planned,
    run: &'a Run,
    task: &'a Task,
    reader: &'a Reader,
    told: &'a dyn Fn(&str),
    from_cache: usize,
}

impl Sampler for Looks<'_> {
    fn sample(&mut self, ask: &Ask) -> Result<(Measurement, f64), String> {
        let (Run { job, .. }, task) = (self.run, self.task);
        (self.told)(&format!(
            "{}: {} of {} meters of {} are undecided: look {}, {:.0} s at most",
            self.planned.engine.name(),
            ask.targets.len(),
            task.targets.len(),
            job.procedure,
            ask.look,
            ask.budget.seconds
        ));
        let further = crate::engines::Job {
            stations: ask.targets.iter().flat_map(|k| job.stations[task.stations_of(*k)].to_vec()).collect(),
            budget: ask.budget,
            seed: seed_of_look(job.seed, ask.look),
            ..job.clone()
        };
        let place = format!("{}/look-{}", job.procedure, ask.look);
        let instrument = self.planned.instrument().ok_or("the engine is not there")?;
        let taken = self.reader.read(&Question::new(&instrument, &further, &place)).map_err(|e| e.to_string())?;
        self.from_cache += usize::from(taken.source == Source::Cache);
        Ok((taken.measurement, taken.cost.wall_s))
    }
}

/// Seeds of further looks lie far from those that people choose, and differ modulo any small number.
fn seed_of_look(seed: u64, look: u32) -> u64 {
    const APART: u64 = 0x1_0000_0001;
    seed.wrapping_add(APART.wrapping_mul(u64::from(look - 1)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_look_has_a_seed_of_its_own() {
        let seeds: std::collections::BTreeSet<u64> = (1..=4).map(|look| seed_of_look(1, look)).collect();
        let small: std::collections::BTreeSet<u64> = seeds.iter().map(|s| s % 16).collect();
        assert_eq!((seeds.len(), small.len(), seed_of_look(7, 1)), (4, 4, 7));
    }
}
