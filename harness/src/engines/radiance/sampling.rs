//! rtrace's blocks: one is an estimate at every station with a fixed number of ambient divisions.
//!
//! rtrace draws anew for each row, so that the repetitions of a row in one process are independent. It seeds itself from the
//! clock, in seconds: processes that start together start from different places of one random sequence, reached by rows
//! outside the scene.

use std::time::Instant;

use glam::DVec3;

use super::export;
use super::options::{AUDIT_DIVISIONS, FAST_DIVISIONS, Options};
use super::settings::Settings;
use super::tools::Tools;
use crate::engines::blocks::{Blocks, MIN_BLOCKS, Sampling};
use crate::engines::settings::Preset;
use crate::engines::{Budget, EngineError, Job, Workbench};
use crate::system::slots::side_by_side;

/// Ambient divisions of the trial from which effort is planned.
const TRIAL_DIVISIONS: u32 = 64;
/// Planned beyond what the trial's own, uncertain, error suggests.
const PLAN_MARGIN: f64 = 1.5;
/// Blocks that effort is planned for.
const PLANNED_BLOCKS: usize = 2 * MIN_BLOCKS;
/// Starting places of the random sequence that differ by the job's seed, for jobs that start within one second.
const SEEDS: u64 = 8;
/// Starting places reserved for the processes of one job.
const PROCESSES_A_SEED: usize = 32;
const MAX_PARALLEL: usize = 8;

pub(super) struct Sampler<'a> {
    pub(super) job: &'a Job,
    pub(super) settings: &'a Settings,
    pub(super) tools: &'a Tools,
    pub(super) workbench: &'a Workbench,
    pub(super) rows: Vec<[f64; 6]>,
    pub(super) started: Instant,
}

pub(super) struct Sampled {
    pub(super) blocks: Blocks,
    pub(super) divisions: u32,
    pub(super) options: Vec<String>,
    pub(super) shortfall: Option<String>,
}

/// Share of the time after which direct light is no longer sampled, whether or not its error is small enough.
const DIRECT_SHARE: f64 = 0.3;
/// Direct light that is subtracted or is all that is asked for should add little to the error.
const DIRECT_ERROR: f64 = 0.3;

impl Sampler<'_> {
    /// Direct light of openings, whose samples are jittered; in one process a wave.
    pub(super) fn direct(&self, options: &Options) -> Result<Blocks, EngineError> {
        let mut places = 0..PROCESSES_A_SEED;
        let Budget { relative_error, seconds } = self.job.budget;
        let budget = Budget { relative_error: DIRECT_ERROR * relative_error, seconds: DIRECT_SHARE * seconds };
        let rule = Sampling { max_waves: places.len(), ..Sampling::within(budget, self.started) };
        rule.run(|numbers| self.side_by_side(&options.direct, &[numbers.len()], &mut places))
    }

    /// Blocks of all light as the preset asks for; `known_lx` is direct light that does not count for the error asked.
    pub(super) fn total(&self, known_lx: &[f64]) -> Result<Sampled, EngineError> {
        let mut places = 0..PROCESSES_A_SEED;
        let fixed =
            Sampling { side_by_side: self.parallel(), ..Sampling::fixed(MIN_BLOCKS, self.job.budget, self.started) };
        let given = self.settings.ambient_divisions;
        let (divisions, rule) = match self.settings.preset {
            // Of rtrace's own cache a few blocks do where time is short.
            Preset::Default => (FAST_DIVISIONS, Sampling { min_blocks: 2, ..fixed }),
            Preset::Fast => (given.unwrap_or(FAST_DIVISIONS), fixed),
            Preset::Audit => self.planned(known_lx, &mut places)?,
        };
        let options = self.options(divisions);
        let blocks = rule.run(|numbers| match self.settings.preset {
            // The cache of a process makes its blocks alike: one process a block.
            Preset::Default => self.side_by_side(&options, &vec![1; numbers.len()], &mut places),
            _ => self.side_by_side(&options, &shares(numbers.len(), self.parallel()), &mut places),
        })?;
        Ok(Sampled { shortfall: rule.shortfall(&blocks), blocks, divisions, options })
    }

    /// Divisions a block, from a trial, and how many blocks.
    fn planned<'k>(
        &self,
        known_lx: &'k [f64],
        places: &mut impl Iterator<Item = usize>,
    ) -> Result<(u32, Sampling<'k>), EngineError> {
        let trial_started = Instant::now();
        let trial = Blocks::new(self.side_by_side(&self.options(TRIAL_DIVISIONS), &[MIN_BLOCKS], places)?);
        let division_s = trial_started.elapsed().as_secs_f64() / (MIN_BLOCKS as f64 * f64::from(TRIAL_DIVISIONS));
        let excess = trial.worst_error(known_lx) / self.job.budget.relative_error;
        let divisions = self.settings.ambient_divisions.unwrap_or_else(|| self.divisions(excess, division_s));
        let parallel = self.parallel();
        let rule = Sampling {
            known_lx,
            enough_blocks: PLANNED_BLOCKS,
            max_waves: (PROCESSES_A_SEED - 1) / parallel,
            side_by_side: parallel,
            block_s: Some(division_s * f64::from(divisions)),
            ..Sampling::within(self.job.budget, self.started)
        };
        Ok((divisions, rule))
    }

    /// Divisions a block so that the fewest blocks about meet the budget.
    fn divisions(&self, excess: f64, division_s: f64) -> u32 {
        let left_s = self.job.budget.seconds - self.started.elapsed().as_secs_f64();
        let needed = f64::from(TRIAL_DIVISIONS) * PLAN_MARGIN * excess * excess / 2.0;
        let affordable = 0.5 * left_s.max(0.0) * self.parallel() as f64 / (PLANNED_BLOCKS as f64 * division_s);
        let divisions = needed.min(affordable).clamp(f64::from(TRIAL_DIVISIONS), f64::from(AUDIT_DIVISIONS));
        // rtrace takes a square number of them.
        (divisions.sqrt().ceil() as u32).pow(2)
    }

    /// Processes of so many blocks each, side by side, each from a starting place of its own.
    fn side_by_side(
        &self,
        options: &[String],
        blocks: &[usize],
        places: &mut impl Iterator<Item = usize>,
    ) -> Result<Vec<Vec<f64>>, EngineError> {
        let mut read = vec![];
        for some in blocks.chunks(self.parallel()) {
            let some: Vec<(usize, usize)> = some.iter().copied().zip(&mut *places).collect();
            for read_by_one in side_by_side(some.len(), &some, |(count, place)| self.process(options, *place, *count)) {
                read.extend(read_by_one?);
            }
        }
        Ok(read)
    }

    fn process(&self, options: &[String], place: usize, blocks: usize) -> Result<Vec<Vec<f64>>, EngineError> {
        let skip = place + PROCESSES_A_SEED * (self.job.seed % SEEDS) as usize;
        let mut rows = vec![self.row_outside(); skip];
        rows.extend(std::iter::repeat_n(&self.rows, blocks).flatten());
        let read = self.tools.rtrace(self.workbench, options, &rows)?;
        Ok(read[skip..].chunks(self.rows.len()).map(<[f64]>::to_vec).collect())
    }

    /// A meter beyond everything that looks away: costs next to nothing and moves the random sequence on.
    fn row_outside(&self) -> [f64; 6] {
        let size = self.job.scene.room.map_or(1.0, |r| r.size_m.max_element());
        let p = DVec3::splat(-10.0 * size * export::scale(self.job, self.settings.coordinates));
        [p.x, p.y, p.z, 0.0, 0.0, -1.0]
    }

    fn options(&self, divisions: u32) -> Vec<String> {
        Options::of(self.job, self.settings, divisions).total
    }

    fn parallel(&self) -> usize {
        self.workbench.jobs.clamp(1, MAX_PARALLEL)
    }
}

/// A number in so many nearly equal parts, none of them 0.
fn shares(whole: usize, parts: usize) -> Vec<usize> {
    (0..parts).map(|k| (whole + k) / parts).filter(|share| *share > 0).collect()
}
