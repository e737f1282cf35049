//! Reflected light by independent blocks, more of them until the standard error or the time of the budget is met.
//!
//! A block is one estimate at every station with a fixed number of ambient divisions. rtrace draws anew for each row,
//! so that the repetitions of a row in one process are independent. It seeds itself from the clock, in seconds: processes
//! that start together start from different places of one random sequence, reached by rows outside the scene.

use std::thread;
use std::time::Instant;

use glam::DVec3;

use super::options::{AUDIT_DIVISIONS, FAST_DIVISIONS, Options};
use super::settings::{Preset, Settings};
use super::tools::Tools;
use super::{export, output};
use crate::engines::{EngineError, Job, Workbench};
use crate::record::Estimate;

/// Blocks that every reading rests on, at least.
const FEWEST_BLOCKS: usize = 8;
/// Ambient divisions of the trial from which effort is planned.
const TRIAL_DIVISIONS: u32 = 64;
/// Planned beyond what the trial's own, uncertain, error suggests.
const PLAN_MARGIN: f64 = 1.5;
/// Starting places of the random sequence that differ by the job's seed, for jobs that start within one second.
const SEEDS: u64 = 16;
/// Starting places reserved for the processes of one job.
const PROCESSES_A_SEED: usize = 16;

/// What the blocks gave.
pub(super) struct Blocks {
    /// `values[block][station]`: illuminance by direct and reflected light in lux.
    values: Vec<Vec<f64>>,
    /// Ambient divisions of every block.
    pub(super) divisions: u32,
    /// The arguments of rtrace.
    pub(super) options: Vec<String>,
}

/// One job on its bench.
pub(super) struct Sampler<'a> {
    pub(super) job: &'a Job,
    pub(super) settings: &'a Settings,
    pub(super) tools: &'a Tools,
    pub(super) workbench: &'a Workbench,
    pub(super) rows: Vec<[f64; 6]>,
    pub(super) started: Instant,
}

impl Blocks {
    /// Mean and standard error at each station.
    pub(super) fn estimates(&self) -> Vec<Estimate> {
        let stations = self.values.first().map_or(0, Vec::len);
        let of = |s: usize| self.values.iter().map(|block| block[s]).collect::<Vec<_>>();
        (0..stations).map(|s| Estimate::of_samples(&of(s))).collect()
    }

    /// The largest standard error relative to the reading it belongs to.
    fn worst_error(&self, subtract_lx: &[f64]) -> f64 {
        let relative = |(all, subtract): (Estimate, &f64)| {
            let error = all.uncertainty.standard_error().unwrap_or(f64::INFINITY);
            if error == 0.0 { 0.0 } else { error / (all.value - subtract).max(f64::MIN_POSITIVE) }
        };
        self.estimates().into_iter().zip(subtract_lx).map(relative).fold(0.0, f64::max)
    }

    pub(super) fn count(&self) -> usize {
        self.values.len()
    }
}

/// Where sampling may stop, whether or not the error is small enough.
const DIRECT_SHARE: f64 = 0.3;
/// Direct light that is subtracted or is all that is asked for should add little to the error.
const DIRECT_ERROR: f64 = 0.3;

impl Sampler<'_> {
    /// Direct light of openings, whose samples are jittered: blocks in one process, doubled until they are good enough.
    pub(super) fn direct(&self, options: &Options) -> Result<Blocks, EngineError> {
        let mut blocks = Blocks { values: vec![], divisions: 0, options: options.direct.clone() };
        let until_s = DIRECT_SHARE * self.job.budget.seconds;
        let nothing = vec![0.0; self.rows.len()];
        for start in 0..PROCESSES_A_SEED {
            let round_started = Instant::now();
            let more = self.process(&blocks.options, start, blocks.count().max(FEWEST_BLOCKS))?;
            blocks.values.extend(more);
            let enough = blocks.worst_error(&nothing) <= DIRECT_ERROR * self.job.budget.relative_error;
            let spent_s = self.started.elapsed().as_secs_f64();
            if enough || spent_s + 2.0 * round_started.elapsed().as_secs_f64() > until_s {
                break;
            }
        }
        Ok(blocks)
    }

    /// Blocks of all light as the preset asks for; `subtract_lx` is direct light that does not count for the error asked.
    pub(super) fn total(&self, subtract_lx: &[f64]) -> Result<Blocks, EngineError> {
        match self.settings.preset {
            // The cache of a process makes its blocks alike: one process a block.
            Preset::Default => self.fixed(FAST_DIVISIONS, 1),
            Preset::Fast => self.fixed(self.settings.ambient_divisions.unwrap_or(FAST_DIVISIONS), FEWEST_BLOCKS),
            Preset::Audit => self.within_budget(subtract_lx),
        }
    }

    /// The fewest blocks in processes of `repeats` each; where time runs out before, as many as there are, but two.
    fn fixed(&self, divisions: u32, repeats: usize) -> Result<Blocks, EngineError> {
        let mut blocks = self.empty(divisions);
        let processes = FEWEST_BLOCKS / repeats;
        for first in (0..processes).step_by(self.parallel()) {
            let round_started = Instant::now();
            let starts: Vec<usize> = (first..processes.min(first + self.parallel())).collect();
            blocks.values.extend(self.round(&blocks.options, &starts, repeats)?);
            if blocks.count() >= 2 && round_started.elapsed().as_secs_f64() > self.seconds_left() {
                break;
            }
        }
        Ok(blocks)
    }

    fn within_budget(&self, subtract_lx: &[f64]) -> Result<Blocks, EngineError> {
        let trial_started = Instant::now();
        let mut trial = self.empty(TRIAL_DIVISIONS);
        trial.values = self.round(&trial.options, &[0], FEWEST_BLOCKS)?;
        let division_s = trial_started.elapsed().as_secs_f64() / (FEWEST_BLOCKS as f64 * f64::from(TRIAL_DIVISIONS));
        let divisions = self.settings.ambient_divisions.unwrap_or_else(|| self.plan(&trial, division_s, subtract_lx));
        let mut block_s = division_s * f64::from(divisions);

        let mut blocks = self.empty(divisions);
        let parallel = self.parallel();
        let mut wanted = 2 * FEWEST_BLOCKS;
        let mut process = 1;
        loop {
            let affordable = (self.seconds_left() * parallel as f64 / block_s) as usize;
            // Fewer than the fewest blocks make no honest error, so those are made whatever the budget says.
            let count = wanted.min(affordable).max(FEWEST_BLOCKS.saturating_sub(blocks.count()));
            let repeats = count.div_ceil(parallel);
            if count == 0 {
                return Ok(blocks);
            }
            let round_started = Instant::now();
            let starts: Vec<usize> = (process..process + parallel).collect();
            blocks.values.extend(self.round(&blocks.options, &starts, repeats)?);
            process += parallel;
            block_s = round_started.elapsed().as_secs_f64() / repeats as f64;
            let excess = blocks.worst_error(subtract_lx) / self.job.budget.relative_error;
            if excess <= 1.0 || process + parallel > PROCESSES_A_SEED {
                return Ok(blocks);
            }
            let missing = (blocks.count() as f64 * (PLAN_MARGIN * (excess * excess - 1.0))).ceil();
            // With the last starting places, all that is missing at once; before that, twice as many at most.
            let last = process + 2 * parallel > PROCESSES_A_SEED;
            wanted = if last { missing as usize } else { (missing as usize).min(3 * blocks.count()) };
        }
    }

    /// Divisions a block so that the fewest blocks about meet the budget.
    fn plan(&self, trial: &Blocks, division_s: f64, subtract_lx: &[f64]) -> u32 {
        let excess = trial.worst_error(subtract_lx) / self.job.budget.relative_error;
        let needed = f64::from(TRIAL_DIVISIONS) * PLAN_MARGIN * excess * excess / 2.0;
        let affordable = 0.5 * self.seconds_left() * self.parallel() as f64 / (2.0 * FEWEST_BLOCKS as f64 * division_s);
        let divisions = needed.min(affordable).clamp(f64::from(TRIAL_DIVISIONS), f64::from(AUDIT_DIVISIONS));
        // rtrace takes a square number of them.
        (divisions.sqrt().ceil() as u32).pow(2)
    }

    /// One process a starting place side by side, each with `repeats` blocks.
    fn round(&self, options: &[String], starts: &[usize], repeats: usize) -> Result<Vec<Vec<f64>>, EngineError> {
        let results: Vec<_> = thread::scope(|scope| {
            let start = |&start: &usize| scope.spawn(move || self.process(options, start, repeats));
            let running: Vec<_> = starts.iter().map(start).collect();
            running.into_iter().map(thread::ScopedJoinHandle::join).collect()
        });
        let mut blocks = vec![];
        for result in results {
            blocks.extend(result.map_err(|_| output("a thread that talked to rtrace panicked".into()))??);
        }
        Ok(blocks)
    }

    fn process(&self, options: &[String], start: usize, repeats: usize) -> Result<Vec<Vec<f64>>, EngineError> {
        let skip = start + PROCESSES_A_SEED * (self.job.seed % SEEDS) as usize;
        let mut rows = vec![self.row_outside(); skip];
        rows.extend(std::iter::repeat_n(&self.rows, repeats).flatten());
        let read = self.tools.rtrace(self.workbench, options, &rows)?;
        Ok(read[skip..].chunks(self.rows.len()).map(<[f64]>::to_vec).collect())
    }

    /// A meter beyond everything that looks away: costs next to nothing and moves the random sequence on.
    fn row_outside(&self) -> [f64; 6] {
        let size = self.job.scene.room.map_or(1.0, |r| r.size_m.max_element());
        let p = DVec3::splat(-10.0 * size * export::scale(self.job, self.settings.scaling));
        [p.x, p.y, p.z, 0.0, 0.0, -1.0]
    }

    fn empty(&self, divisions: u32) -> Blocks {
        Blocks { values: vec![], divisions, options: Options::of(self.job, self.settings, divisions).total }
    }

    fn parallel(&self) -> usize {
        self.workbench.jobs.clamp(1, PROCESSES_A_SEED / 2)
    }

    fn seconds_left(&self) -> f64 {
        (self.job.budget.seconds - self.started.elapsed().as_secs_f64()).max(0.0)
    }
}
