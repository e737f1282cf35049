//! rtrace's blocks: one is an estimate at every sensor with a fixed number of ambient divisions.
//!
//! rtrace draws anew for each row, so that the repetitions of a row in one process are independent; each process has a
//! seed of its own.

use std::ops::Range;
use std::time::Instant;

use luxproof_scene::Transport;

use super::export::Light;
use super::grazing;
use super::options::{AUDIT_DIVISIONS, Ambient, FAST_DIVISIONS, Options, Sources, bounces};
use super::settings::Settings;
use super::tools::Tools;
use crate::blocks::{
    BELIEVED_BLOCKS, Blocks, DIRECT_SHARE, MIN_BLOCKS, Sampled, Sampling, WORST_OF_FEW, counted, longest_block_s,
};
use crate::effort;
use crate::settings::Preset;
use crate::{Budget, EngineError, Job, JobDir};
use luxproof_process::random::seed;
use luxproof_process::slots::side_by_side;

/// Ambient divisions of a first trial from which effort is planned, which are the fewest, and of a second, made where so many times its
/// divisions are planned by the first.
const FEWEST_DIVISIONS: u32 = 64;
const MORE_DIVISIONS: u32 = 256;
const FINER_TRIAL: f64 = 8.0;
/// The power of divisions by which the variance falls: strata gain more while they are few and what they see is even (docs/decisions/0017-sampling-plans.md).
const POWER_OF_FEW: f64 = 1.25;
const POWER: f64 = 1.05;
/// A division sees uneven light where its relative standard deviation at the worst meter is larger than this.
const UNEVEN: f64 = 0.7;
/// Blocks that effort is planned for: where a trial showed more than twice the variance that there is, two fifths of them are enough.
const PLANNED_BLOCKS: usize = 5 * BELIEVED_BLOCKS / 2;
const MAX_PARALLEL: usize = 8;
/// Seconds, as they are counted, that a process of several blocks may take, and how many of them at most, so that all threads have some.
const SHORT_S: f64 = 0.25;
const MOST_TOGETHER: usize = 16;

/// Seconds that are counted for a ray to a surface or a luminaire, and for a row where rtrace keeps its cache: on two cores of a
/// usual server, half as much again as was measured there (2.6e-6 s of one core a ray, from 1.9 to 3.6 over the cases of reference/).
const RAY_S: f64 = 2e-6;
const CACHED_ROW_S: f64 = 5.0;

/// Seconds for a shadow ray where direct light alone is read, whose rays are much alike.
const SHADOW_RAY_S: f64 = 1.5e-6;
/// Parts of an opening that are distinguished: within reflected light, and at most, as where direct light alone is read.
const PARTS: f64 = 4.0;
const MAX_PARTS: f64 = 64.0;
/// Of the weight that a surface reflects, what rtrace parts.
const KEPT_WEIGHT: f64 = 0.8;

/// Which of a job's random numbers.
#[derive(Clone, Copy)]
pub(super) enum Stream {
    Direct,
    Trial,
    Total,
}

pub(super) struct Sampler<'a> {
    pub(super) job: &'a Job,
    pub(super) settings: &'a Settings,
    pub(super) tools: &'a Tools,
    pub(super) workbench: &'a JobDir,
    pub(super) rows: Vec<[f64; 6]>,
    /// How many scenes there are, whose light adds up, and what is read of them but the direct light.
    pub(super) scenes: usize,
    pub(super) light: Light,
    /// When no more samples are begun.
    pub(super) until: Instant,
}

/// What a trial tells: the worst error of its mean, and how long a block may take, as they are counted, on a machine as slow as it was for it.
#[derive(Clone, Copy)]
struct Trial {
    error: f64,
    longest_s: f64,
}

/// Direct light that is subtracted should add little to the error.
const DIRECT_ERROR: f64 = 0.3;

impl Sampler<'_> {
    /// Direct light of openings, whose samples are jittered, each meter's with the division of the sources that is its own; in one process a
    /// wave and a division.
    pub(super) fn direct(&self, ratios: &[f64]) -> Result<Sampled, EngineError> {
        let (error, share) = if self.job.reflections().is_none() { (1.0, 1.0) } else { (DIRECT_ERROR, DIRECT_SHARE) };
        let budget = counted(self.job.budget, share);
        let budget = Budget { relative_error: error * budget.relative_error, ..budget };
        let rays = self.rows.len() as f64 * effort::shadow_rays(self.job, MAX_PARTS);
        let rule = Sampling::within(budget, SHADOW_RAY_S * rays * effort::a_ray(self.job), self.until);
        rule.run(|numbers| {
            let mut blocks = vec![vec![0.0; self.rows.len()]; numbers.len()];
            for ratio in grazing::RATIOS {
                let sensors: Vec<usize> = (0..ratios.len()).filter(|k| ratios[*k] == ratio).collect();
                let rows: Vec<[f64; 6]> = sensors.iter().map(|k| self.rows[*k]).collect();
                let options = Sources::Openings.direct(ratio);
                let read = self.process(&options, Stream::Direct, &numbers, &rows)?;
                for (block, read) in blocks.iter_mut().zip(read) {
                    sensors.iter().zip(read).for_each(|(k, lx)| block[*k] = lx);
                }
            }
            Ok(blocks)
        })
    }

    /// Blocks of all light or reflected, as the preset asks for; `known_lx` is direct light that does not count for the error asked, less what
    /// is not in them and does.
    pub(super) fn total(&self, known_lx: &[f64]) -> Result<(Sampled, Ambient), EngineError> {
        let given = self.settings.ambient_divisions;
        let fixed = |block_s| Sampling::fixed(MIN_BLOCKS, self.budget(), block_s, self.until);
        let ambient = |divisions| Ambient { divisions, risk: Ambient::LOW_RISK };
        let (ambient, rule) = match self.settings.preset {
            // Of rtrace's own cache a few blocks do where time is short.
            Preset::Default => {
                let rule = fixed(CACHED_ROW_S * self.rows.len() as f64);
                (ambient(FAST_DIVISIONS), Sampling { min_blocks: 2, ..rule })
            }
            Preset::Fast => {
                let ambient = ambient(given.unwrap_or(FAST_DIVISIONS));
                (ambient, fixed(self.block_s(ambient)))
            }
            Preset::Audit => self.planned(known_lx)?,
        };
        Ok((rule.run(|numbers| self.side_by_side(ambient, Stream::Total, numbers))?, ambient))
    }

    /// What a block is, from trials, and how many blocks.
    fn planned<'k>(&self, known_lx: &'k [f64]) -> Result<(Ambient, Sampling<'k>), EngineError> {
        let ambient = match self.settings.ambient_divisions {
            Some(divisions) => Ambient { divisions, risk: self.least_risk() },
            None => self.ambient(known_lx)?,
        };
        let within = Sampling::within(self.budget(), self.block_s(ambient), self.until);
        // Of the fewest divisions blocks cost little beside another look, which too few of them may cause.
        let is_least = ambient.divisions == FEWEST_DIVISIONS;
        let enough_blocks = if is_least { 2 * MIN_BLOCKS } else { BELIEVED_BLOCKS };
        Ok((ambient, Sampling { known_lx, enough_blocks, ..within }))
    }

    /// Of several luminaires the light is uneven from the start.
    fn least_risk(&self) -> f64 {
        if self.job.scene.luminaires.len() > 1 { Ambient::HIGH_RISK } else { Ambient::LOW_RISK }
    }

    /// Divisions a block so that the fewest blocks about meet the budget.
    fn ambient(&self, known_lx: &[f64]) -> Result<Ambient, EngineError> {
        let mut ambient = Ambient { divisions: FEWEST_DIVISIONS, risk: self.least_risk() };
        let mut trial = self.trial(ambient, known_lx)?;
        let of_a_division = trial.error * f64::from(MIN_BLOCKS as u32 * FEWEST_DIVISIONS).sqrt();
        if ambient.risk < Ambient::HIGH_RISK && of_a_division > UNEVEN {
            ambient.risk = Ambient::HIGH_RISK;
            trial = self.trial(ambient, known_lx)?;
        }
        let power = if ambient.risk < Ambient::HIGH_RISK { POWER_OF_FEW } else { POWER };
        let mut planned = self.needed(ambient, trial, power);
        if planned >= FINER_TRIAL * f64::from(FEWEST_DIVISIONS) {
            ambient.divisions = MORE_DIVISIONS;
            planned = self.needed(ambient, self.trial(ambient, known_lx)?, POWER);
        }
        let divisions = planned.clamp(f64::from(FEWEST_DIVISIONS), f64::from(AUDIT_DIVISIONS));
        // rtrace takes a square number of them.
        Ok(Ambient { divisions: (divisions.sqrt().ceil() as u32).pow(2), ..ambient })
    }

    fn trial(&self, ambient: Ambient, known_lx: &[f64]) -> Result<Trial, EngineError> {
        let begun = Instant::now();
        let blocks = self.side_by_side(ambient, Stream::Trial, 0..MIN_BLOCKS)?;
        let counted_s = MIN_BLOCKS as f64 * self.block_s(ambient);
        let longest_s = longest_block_s(begun.elapsed(), counted_s, self.until);
        Ok(Trial { error: Blocks::new(blocks).worst_error(known_lx), longest_s })
    }

    /// Divisions with which as many blocks as are planned reach the error, or take the time.
    fn needed(&self, ambient: Ambient, trial: Trial, power: f64) -> f64 {
        let excess = trial.error / self.job.budget.relative_error;
        let blocks = MIN_BLOCKS as f64 / PLANNED_BLOCKS as f64;
        // Where time is short, fewer and larger blocks tell more.
        let longest_s = (0.5 * self.budget().seconds / BELIEVED_BLOCKS as f64).min(trial.longest_s);
        let affordable = longest_s / self.block_s(Ambient { divisions: 1, ..ambient });
        (f64::from(ambient.divisions) * (blocks * excess * excess / WORST_OF_FEW).powf(power.recip())).min(affordable)
    }

    /// What direct light leaves of the budget, where that is sampled, too.
    fn budget(&self) -> Budget {
        let share = if matches!(self.job.transport, Transport::Total(_)) { 1.0 - DIRECT_SHARE } else { 1.0 };
        counted(self.job.budget, share)
    }

    fn block_s(&self, ambient: Ambient) -> f64 {
        let (hits, reflecting) = self.hits(ambient.risk);
        let rays = hits * self.scenes as f64 + reflecting * effort::shadow_rays(self.job, PARTS);
        RAY_S * f64::from(ambient.divisions) * self.rows.len() as f64 * rays * effort::a_ray(self.job)
    }

    /// Surfaces that rays meet for each division in the mean, and those among them that are not black, which cast shadow rays: at
    /// each, rtrace parts a ray of so much weight that its parts pass the roulette in as many (`doambient` in its ambient.c).
    fn hits(&self, risk: f64) -> (f64, f64) {
        let Some(room) = self.job.scene.room else { return (1.0, 0.0) };
        let share = effort::reflecting_share(&room);
        let reflectance = effort::mean_reflectance(&room) / share.max(f64::MIN_POSITIVE);
        let (mut hits, mut rays, mut weight) = (0.0, 1.0, 1.0);
        for _ in 0..bounces(self.job) {
            hits += rays;
            let parts = (KEPT_WEIGHT * reflectance * weight / risk).sqrt().round().max(1.0).powi(2);
            let of_each = reflectance * weight / parts;
            rays *= share * parts * (of_each / risk).min(1.0);
            weight = of_each.max(risk);
        }
        (hits, share * hits)
    }

    /// A process for a few blocks that take less than its start, else one a block; where rtrace keeps its cache, blocks of one process would be alike.
    fn side_by_side(
        &self,
        ambient: Ambient,
        stream: Stream,
        numbers: Range<usize>,
    ) -> Result<Vec<Vec<f64>>, EngineError> {
        let options = self.options(ambient);
        let together = match self.settings.preset {
            Preset::Default => 1,
            Preset::Fast | Preset::Audit => ((SHORT_S / self.block_s(ambient)) as usize).clamp(1, MOST_TOGETHER),
        };
        let ends = numbers.clone().step_by(together).map(|start| start..(start + together).min(numbers.end));
        let processes: Vec<Range<usize>> = ends.collect();
        let read = side_by_side(self.workbench.jobs.clamp(1, MAX_PARALLEL), &processes, |numbers| {
            self.process(&options, stream, numbers, &self.rows)
        });
        Ok(read.into_iter().collect::<Result<Vec<_>, _>>()?.concat())
    }

    /// Blocks of some rows that follow one another in one process; none of no rows.
    fn process(
        &self,
        options: &[String],
        stream: Stream,
        numbers: &Range<usize>,
        rows: &[[f64; 6]],
    ) -> Result<Vec<Vec<f64>>, EngineError> {
        let Some(first) = rows.first() else { return Ok(vec![]) };
        let all: Vec<[f64; 6]> = std::iter::repeat_n(rows, numbers.len()).flatten().copied().collect();
        // Rows that are read apart draw other numbers.
        let place = self.rows.iter().position(|row| row == first).unwrap_or(0);
        let own = (place > 0).then_some(place as u64);
        let light = match stream {
            Stream::Direct => Light::All,
            Stream::Trial | Stream::Total => self.light,
        };
        let stream: Vec<u64> = [self.job.seed, stream as u64, numbers.start as u64].into_iter().chain(own).collect();
        let read = self.all_scenes(options, light, &stream, &all)?;
        Ok(read.chunks(rows.len()).map(<[f64]>::to_vec).collect())
    }

    /// Light that rtrace finds anew each time to the last digit.
    pub(super) fn determined(&self, options: &[String]) -> Result<Vec<f64>, EngineError> {
        self.all_scenes(options, Light::All, &[self.job.seed], &self.rows)
    }

    /// What all scenes give together, each with random numbers of its own.
    fn all_scenes(
        &self,
        options: &[String],
        light: Light,
        stream: &[u64],
        rows: &[[f64; 6]],
    ) -> Result<Vec<f64>, EngineError> {
        let mut sum = vec![0.0; rows.len()];
        for scene in 0..self.scenes {
            let own: Vec<u64> = stream.iter().copied().chain((scene > 0).then_some(u64::MAX - scene as u64)).collect();
            let octree = light.octree(scene, self.scenes);
            let read = self.tools.rtrace(self.workbench, options, &octree, seed(&own), rows)?;
            sum.iter_mut().zip(read).for_each(|(sum, lx)| *sum += lx);
        }
        Ok(sum)
    }

    pub(super) fn options(&self, ambient: Ambient) -> Vec<String> {
        Options::total(self.job, self.settings, ambient)
    }
}
