//! The block sampler of all renderers: it adds independent blocks until the error or the time of a budget is reached.
//!
//! A block is one estimate of the illuminance at every sensor. Blocks are independent of each other, so their spread gives the
//! standard error of their mean. One block samples all sensors together, so the same holds for weighted sums of sensors.

use std::ops::Range;
use std::time::{Duration, Instant};

use serde::{Deserialize, Serialize};
use statrs::distribution::{ContinuousCDF, StudentsT};

use super::EngineError;
use luxproof_model::{Estimate, Uncertainty};
use luxproof_spec::Budget;
use luxproof_statistics::design_effect;

/// The fewest blocks that give a usable standard error.
pub(super) const MIN_BLOCKS: usize = 8;
/// From this count on, the standard error alone may stop the sampling. Fewer blocks stop it only if their wider interval is narrow
/// enough, because a wide interval decides less.
pub(super) const BELIEVED_BLOCKS: usize = 3 * MIN_BLOCKS / 2;
/// The largest variance of several meters, from so few blocks, is larger than its true value by about this factor.
pub(super) const WORST_OF_FEW: f64 = 1.3;
/// The sampler makes this many blocks whatever the clock shows: fewer show almost nothing of their error.
const MIN_BLOCKS_WITHOUT_TIME: usize = 4;
/// The part of the remaining time that a wave may take by the clock. The rest covers other programs on the machine.
const WAVE_TIME_SHARE: f64 = 0.5;
/// The same part for the first wave, of which only the engine's own count is known.
const FIRST_WAVE_TIME_SHARE: f64 = 0.25;
/// A busy machine may slow a wave down by this factor: a wave begins only if there is time for that.
const MAX_SLOWDOWN: f64 = 1.5;
/// Seconds of a trial that engines do not count: compiling kernels, sleeping processes.
const UNCOUNTED_S: f64 = 2.0;
/// The largest next wave, as a multiple of the blocks that exist. Their error is itself only an estimate.
const MAX_GROWTH: usize = 3;
/// The smallest next wave, as a part of the blocks that exist: each wave waits for its slowest block.
const MIN_GROWTH: f64 = 0.25;
/// A wave is sized by the variance less this multiple of the variance's own standard error. A later stage adds what is still missing.
const VARIANCE_MARGIN_SIGMAS: f64 = 0.5;

/// Assumed excess kurtosis of blocks: light arrives in portions, and a few blocks do not show how skewed that makes them.
const EXCESS_KURTOSIS: f64 = 2.0;

/// Returns the degrees of freedom of the standard error of this many blocks.
///
/// They follow from the relative variance of the sample variance: 2 / (n - 1) for normal blocks, plus the excess kurtosis over n.
fn degrees_of_freedom(blocks: usize) -> f64 {
    let n = blocks as f64;
    2.0 / (2.0 / (n - 1.0) + EXCESS_KURTOSIS / n)
}

/// Returns how many times wider Student's t makes an interval that excludes 0.1 % on each side.
fn widening(blocks: usize) -> f64 {
    let quantile = StudentsT::new(0.0, 1.0, degrees_of_freedom(blocks)).map(|t| t.inverse_cdf(0.999));
    quantile.map_or(f64::INFINITY, |quantile| quantile / NORMAL_QUANTILE)
}

/// The 99.9 % quantile of the standard normal distribution.
const NORMAL_QUANTILE: f64 = 3.0902;

/// Blocks of one part of the light: `blocks[block][sensor]` in lux.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Blocks(Vec<Vec<f64>>);

impl Blocks {
    pub fn new(blocks: Vec<Vec<f64>>) -> Self {
        Self(blocks)
    }

    pub fn count(&self) -> usize {
        self.0.len()
    }

    /// Returns the mean at each sensor with its uncertainty.
    pub fn estimates(&self) -> Vec<Estimate> {
        let mut all: Vec<Estimate> = self.sensors().map(|k| self.weighted(&[(k, 1.0)])).collect();
        Estimate::mark_unseen(&mut all);
        all
    }

    /// Returns whether no block met any light at any sensor.
    fn are_dark(&self) -> bool {
        self.0.iter().flatten().all(|lx| *lx == 0.0)
    }

    fn sensors(&self) -> Range<usize> {
        0..self.0.first().map_or(0, Vec::len)
    }

    /// Returns the weighted sum over sensors, with the error that their joint sampling gives it.
    pub fn weighted(&self, weights: &[(usize, f64)]) -> Estimate {
        let sums: Vec<f64> = self.0.iter().map(|block| weighted_sum(block, weights)).collect();
        let estimate = Estimate::of_samples(&sums);
        let uncertainty = match estimate.uncertainty {
            Uncertainty::StandardError { value, .. } => {
                Uncertainty::sampled(value, Some(degrees_of_freedom(self.count())))
            }
            other => other,
        };
        Estimate { uncertainty, ..estimate }
    }

    /// Returns the normal deviate of the skewness of the blocks (D'Agostino, Biometrika 57 (1970) 679).
    ///
    /// It is the mean over sensors, so that sensors that vary together count as one. It is `None` for fewer blocks than the
    /// formula holds for, or if no sensor varies.
    pub fn skewness(&self) -> Option<f64> {
        if self.count() < MIN_BLOCKS {
            return None;
        }
        let all: Vec<f64> = self
            .sensors()
            .filter_map(|k| self.station_skewness(k))
            .map(|skewness| skewness_deviate(skewness, self.count()))
            .collect();
        (!all.is_empty()).then(|| all.iter().sum::<f64>() / all.len() as f64)
    }

    /// Returns the sample skewness of one sensor, or `None` if the sensor does not vary.
    fn station_skewness(&self, sensor: usize) -> Option<f64> {
        let mean = self.0.iter().map(|b| b[sensor]).sum::<f64>() / self.count() as f64;
        Some(self.central_moment(sensor, mean, 3) / self.central_moment(sensor, mean, 2).powf(1.5))
            .filter(|g| g.is_finite())
    }

    /// Returns the central moment of the given order of one sensor about its mean.
    fn central_moment(&self, sensor: usize, mean: f64, order: i32) -> f64 {
        self.0.iter().map(|b| (b[sensor] - mean).powi(order)).sum::<f64>() / self.count() as f64
    }

    /// Returns how much of their noise sensors share, or `None` for fewer blocks than `MIN_BLOCKS`.
    pub fn design_effect(&self) -> Option<f64> {
        let single_stations: Vec<Vec<(usize, f64)>> = self.sensors().map(|k| vec![(k, 1.0)]).collect();
        let all = self.deviates(&single_stations);
        let is_sampled = all.iter().flatten().any(|z| *z != 0.0);
        (self.count() >= MIN_BLOCKS && is_sampled).then(|| design_effect(&all))
    }

    /// Returns by block how far weighted sums over sensors are from their means, in standard deviations; 0 for a constant sum.
    pub fn deviates(&self, sums: &[Vec<(usize, f64)>]) -> Vec<Vec<f64>> {
        let n = self.count() as f64;
        let mut all = vec![vec![]; self.count()];
        let by_block = self.weighted_sums(sums);
        for k in 0..sums.len() {
            let block_sums: Vec<f64> = by_block.iter().map(|sums| sums[k]).collect();
            let mean = block_sums.iter().sum::<f64>() / n;
            let deviation = (block_sums.iter().map(|b| (b - mean).powi(2)).sum::<f64>() / (n - 1.0)).sqrt();
            for (deviates, sum) in all.iter_mut().zip(block_sums) {
                deviates.push(if deviation > 0.0 { (sum - mean) / deviation } else { 0.0 });
            }
        }
        all
    }

    /// Returns weighted sums over sensors by block.
    pub(super) fn weighted_sums(&self, sums: &[Vec<(usize, f64)>]) -> Vec<Vec<f64>> {
        self.0.iter().map(|block| sums.iter().map(|weights| weighted_sum(block, weights)).collect()).collect()
    }

    pub(super) fn is_of(&self, sensors: usize) -> bool {
        self.0.iter().all(|block| block.len() == sensors)
    }

    /// Merges the blocks into at most as many groups and returns the mean of each.
    ///
    /// A group has an equal part of the blocks, or one more. So the spread of the groups does not make the standard error smaller.
    pub(super) fn in_groups(&self, groups: usize) -> Self {
        Self((0..groups).map(|g| self.group_mean(g * self.count() / groups..(g + 1) * self.count() / groups)).collect())
    }

    /// Returns the mean of a range of blocks at each sensor.
    fn group_mean(&self, range: Range<usize>) -> Vec<f64> {
        let blocks = &self.0[range];
        self.sensors().map(|k| blocks.iter().map(|b| b[k]).sum::<f64>() / blocks.len() as f64).collect()
    }

    /// Joins sensors of several sets of blocks. A sensor is a set and a place in it; a set that is `None` does not vary.
    pub(super) fn side_by_side(sets: &[Option<Self>], sensors: &[(usize, usize)]) -> Self {
        let count = sets.iter().flatten().map(Self::count).min().unwrap_or(0);
        let joined = (0..count).map(|block| {
            let values = sensors.iter().map(|(set, k)| sets[*set].as_ref().map_or(0.0, |blocks| blocks.0[block][*k]));
            values.collect()
        });
        Self(joined.collect())
    }

    /// Returns blocks of other sensors: each is a factor times one of these sensors, or dark.
    #[must_use]
    pub fn rearranged(&self, sensors: &[Option<(usize, f64)>]) -> Self {
        let rearranged = self.0.iter().map(|block| {
            let values = sensors.iter().map(|sensor| sensor.map_or(0.0, |(k, factor)| factor * block[k]));
            values.collect()
        });
        Self(rearranged.collect())
    }

    /// Returns the largest standard error relative to its reading. The reading is the mean less `known_lx`, the light that is not
    /// sampled.
    pub fn worst_error(&self, known_lx: &[f64]) -> f64 {
        self.sensors().map(|k| self.relative_error(k, *known_lx.get(k).unwrap_or(&0.0))).fold(0.0, f64::max)
    }

    /// Returns the standard error of one sensor relative to its mean less `known_lx`.
    fn relative_error(&self, sensor: usize, known_lx: f64) -> f64 {
        let mean = self.weighted(&[(sensor, 1.0)]);
        let error = mean.uncertainty.standard_error().unwrap_or(f64::INFINITY);
        let reading = mean.value - known_lx;
        if error == 0.0 { 0.0 } else { error / reading.max(f64::MIN_POSITIVE) }
    }
}

/// Returns the weighted sum over the sensors of one block.
fn weighted_sum(block: &[f64], weights: &[(usize, f64)]) -> f64 {
    weights.iter().map(|(k, weight)| weight * block[*k]).sum()
}

/// Returns the normal deviate of the sample skewness of so many normal values (D'Agostino, Biometrika 57 (1970) 679).
fn skewness_deviate(skewness: f64, count: usize) -> f64 {
    let n = count as f64;
    let y = ((n + 1.0) * (n + 3.0) / (6.0 * (n - 2.0))).sqrt();
    let kurtosis =
        3.0 * (n * n + 27.0 * n - 70.0) * (n + 1.0) * (n + 3.0) / ((n - 2.0) * (n + 5.0) * (n + 7.0) * (n + 9.0));
    let w = ((2.0 * (kurtosis - 1.0)).sqrt() - 1.0).sqrt();
    (y * skewness / (2.0 / (w * w - 1.0)).sqrt()).asinh() / w.ln().sqrt()
}

/// The part of a budget's seconds that engines plan with, as they count them. The rest covers their start and a slow machine; the
/// clock decides only if that is not enough.
const PLANNED_TIME_SHARE: f64 = 0.6;

/// The part of the seconds that blocks may take, and how many there may be, as long as none met any light. A sensor that sees a
/// sliver of a large opening meets it in one sample of a few hundred, and eight without light say nothing.
const DARK_TIME_SHARE: f64 = 0.1;
const MAX_DARK_BLOCKS: usize = 1024;

/// The part of the seconds for direct light if both parts of the light are sampled: reflected light takes longer.
pub(super) const DIRECT_SHARE: f64 = 0.3;

/// Returns the budget that engines plan with, for a part of the light that has this share of it.
pub(super) fn counted(budget: Budget, share: f64) -> Budget {
    Budget { seconds: PLANNED_TIME_SHARE * share * budget.seconds, ..budget }
}

/// Returns the longest block, in counted seconds, of which [`MIN_BLOCKS`] end in time on this machine.
///
/// Fewer and larger blocks would show almost nothing of their error. The trial shows how slow the machine is: it took the given
/// time and was counted for `counted_s`. The result is infinite if the machine is as fast as counted, so that no clock decides there.
pub(super) fn longest_block_s(trial: Duration, counted_s: f64, until: Instant) -> f64 {
    let slowness = (trial.as_secs_f64() - UNCOUNTED_S).max(0.0) / counted_s.max(f64::MIN_POSITIVE);
    let left = until.saturating_duration_since(Instant::now()).as_secs_f64();
    if slowness <= 1.0 { f64::INFINITY } else { WAVE_TIME_SHARE * left / (MIN_BLOCKS as f64 * slowness) }
}

/// When to stop, and how many blocks a wave has.
///
/// The error and the counted seconds decide. The clock decides only if the machine is slower than counted, so that one seed makes
/// the same blocks on every machine that keeps up.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sampling<'a> {
    /// The largest allowed standard error relative to a reading.
    pub(super) relative_error: f64,
    /// Light at each sensor that is in the mean but not in the reading; empty if there is none.
    pub(super) known_lx: &'a [f64],
    /// Seconds that all blocks may take, as the engine counts them.
    pub(super) seconds: f64,
    /// Seconds that one block takes, as the engine counts them.
    pub(super) block_s: f64,
    /// Blocks that the sampler makes whatever they take, as the engine counts.
    pub(super) min_blocks: usize,
    /// With fewer blocks, an error is small enough only if the wider interval of so few blocks is narrow enough, too.
    pub(super) enough_blocks: usize,
    pub(super) max_blocks: usize,
    /// No wave begins that would end after this time, judged by the waves before it. Nothing else depends on a clock.
    pub(super) until: Instant,
}

impl Sampling<'static> {
    /// Returns the rule for a budget from [`counted`], for blocks of `block_s` counted seconds each.
    pub(super) fn within(budget: Budget, block_s: f64, until: Instant) -> Self {
        Self {
            relative_error: budget.relative_error,
            known_lx: &[],
            seconds: budget.seconds,
            block_s,
            min_blocks: MIN_BLOCKS,
            enough_blocks: MIN_BLOCKS,
            max_blocks: usize::MAX,
            until,
        }
    }

    /// Returns the rule for a fixed number of blocks, whatever their error.
    pub(super) fn fixed(blocks: usize, budget: Budget, block_s: f64, until: Instant) -> Self {
        let (relative_error, min_blocks) = (f64::INFINITY, MIN_BLOCKS.min(blocks));
        let within = Self::within(budget, block_s, until);
        Self { relative_error, min_blocks, enough_blocks: blocks, max_blocks: blocks, ..within }
    }
}

impl Sampling<'_> {
    /// Calls `wave` for blocks by their numbers, from 0 on, until there are enough.
    pub(super) fn run(
        &self,
        mut wave: impl FnMut(Range<usize>) -> Result<Vec<Vec<f64>>, EngineError>,
    ) -> Result<Sampled, EngineError> {
        let mut blocks = Blocks::default();
        let mut waves = Waves::default();
        loop {
            let have = blocks.count();
            let wanted = self.next_wave_blocks(&blocks);
            let count = wanted.min(self.blocks_in_time(have, waves));
            if count == 0 {
                let remark = self.remark(&blocks, wanted > 0);
                let cut_to = (wanted > 0).then(|| have as f64 / self.all_blocks(&blocks, wanted) as f64);
                return Ok(Sampled { work_s: have as f64 * self.block_s, blocks, cut_to, remark });
            }
            let begun = Instant::now();
            blocks.0.extend(wave(have..have + count)?);
            waves.add(begun.elapsed().as_secs_f64());
        }
    }

    /// Returns how many blocks there would be in all without the clock, which cuts the sampling before a wave of `wanted` blocks.
    ///
    /// The next wave alone says little: its size is limited by the blocks that exist.
    fn all_blocks(&self, blocks: &Blocks, wanted: usize) -> usize {
        let have = blocks.count();
        let excess = blocks.worst_error(self.known_lx) / self.relative_error;
        let needed = (have as f64 * excess * excess).ceil() as usize;
        needed.min(self.affordable_blocks()).max(have + wanted)
    }

    /// Returns how many blocks the counted seconds allow.
    fn affordable_blocks(&self) -> usize {
        ((self.seconds / self.block_s) as usize).min(self.max_blocks).max(self.min_blocks)
    }

    /// Returns how many blocks may go on searching for light where none has met any.
    fn dark_blocks(&self) -> usize {
        ((DARK_TIME_SHARE * self.seconds / self.block_s) as usize)
            .clamp(self.enough_blocks, MAX_DARK_BLOCKS.max(self.enough_blocks))
    }

    /// Returns how many blocks the next wave may have by the clock.
    fn blocks_in_time(&self, have: usize, waves: Waves) -> usize {
        let left = self.until.saturating_duration_since(Instant::now()).as_secs_f64();
        let (share, block_s) = match have {
            0 => (FIRST_WAVE_TIME_SHARE, self.block_s),
            _ => (WAVE_TIME_SHARE, waves.all_s / have as f64),
        };
        // The lower limit keeps a time that is too short to measure from being a rate.
        let blocks = left / block_s.max(1e-6);
        // One block may take as long as a wave, because a wave's blocks run in parallel.
        let is_late = blocks < MAX_SLOWDOWN || left < MAX_SLOWDOWN * waves.shortest_s;
        let affordable = if is_late { 0 } else { (share * blocks).ceil() as usize };
        affordable.max(MIN_BLOCKS_WITHOUT_TIME.min(self.min_blocks).saturating_sub(have))
    }

    /// Returns the remark for the report if the error is larger than requested.
    fn remark(&self, blocks: &Blocks, is_late: bool) -> Option<String> {
        let worst = blocks.worst_error(self.known_lx);
        if is_late {
            return Some(format!(
                "time limit: cut short by the clock at a relative standard error of {worst:.1e}: the machine is slower than is counted \
                 on, and another run may read otherwise"
            ));
        }
        (worst > self.relative_error).then(|| format!("out of time at a relative standard error of {worst:.1e}"))
    }

    /// Returns how many blocks the next wave has by the error and the counted seconds; 0 ends the sampling.
    fn next_wave_blocks(&self, blocks: &Blocks) -> usize {
        let (have, first_wave) = (blocks.count(), self.min_blocks.min(self.enough_blocks));
        if have < first_wave {
            return first_wave - have;
        }
        let excess = blocks.worst_error(self.known_lx) / self.relative_error;
        let missing = if blocks.are_dark() {
            self.dark_blocks().saturating_sub(have)
        } else if have < self.enough_blocks {
            let sufficient = (have..self.enough_blocks).find(|n| is_narrow_with(*n, have, excess));
            match sufficient {
                Some(sufficient) if sufficient == have => 0,
                // The first wave's estimate may be too low. One extra block avoids another wave, which waits for its slowest block.
                Some(sufficient) if have == first_wave => sufficient + 1 - have,
                _ => self.enough_blocks - have,
            }
        } else {
            missing_blocks(have, excess)
        };
        missing.min(self.affordable_blocks().saturating_sub(have))
    }
}

/// Returns whether `count` blocks would have a narrow enough interval, if `have` blocks have an error `excess` times the allowed one.
fn is_narrow_with(count: usize, have: usize, excess: f64) -> bool {
    // An excess of 0 means that no block varied, which may be because no sample met any light.
    excess > 0.0 && excess * (have as f64 / count as f64).sqrt() * widening(count) <= 1.0
}

/// Returns how many more blocks are needed if the error of those that exist is `excess` times the requested one.
///
/// It is at least a quarter of the existing blocks, but no more than this error shows to be missing.
fn missing_blocks(have: usize, excess: f64) -> usize {
    let variance = excess * excess;
    let variance_error = (2.0 / degrees_of_freedom(have)).sqrt();
    let lower_bound = extra_blocks(have, variance * (1.0 - VARIANCE_MARGIN_SIGMAS * variance_error))
        .max(extra_blocks(have, 1.0 + MIN_GROWTH));
    lower_bound.min(extra_blocks(have, variance)).min(MAX_GROWTH * have)
}

/// Returns how many blocks to add so that there are `factor` times as many.
fn extra_blocks(have: usize, factor: f64) -> usize {
    (have as f64 * (factor - 1.0)).ceil() as usize
}

/// Clock times of waves: the sum and the shortest. Parallel blocks take as long when they are fewer.
#[derive(Clone, Copy, Default)]
struct Waves {
    all_s: f64,
    shortest_s: f64,
}

impl Waves {
    fn add(&mut self, wave_s: f64) {
        self.shortest_s = if self.all_s == 0.0 { wave_s } else { self.shortest_s.min(wave_s) };
        self.all_s += wave_s;
    }
}

/// The blocks of one part of the light.
#[derive(Clone, Debug)]
pub(super) struct Sampled {
    pub(super) blocks: Blocks,
    /// Seconds that the blocks take, as the engine counts them.
    pub(super) work_s: f64,
    /// The part of the existing and next wanted blocks that the clock left; `None` if it left all.
    pub(super) cut_to: Option<f64>,
    /// Why there are no more blocks although the error is larger than requested.
    pub(super) remark: Option<String>,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Measurement;

    /// Blocks of two sensors with mean 100 and a relative standard deviation of `spread`, from their numbers alone.
    fn block(number: usize, spread: f64) -> Vec<f64> {
        let mut random = fastrand::Rng::with_seed(number as u64);
        (0..2).map(|_| 100.0 * (1.0 + spread * (12f64.sqrt() * (random.f64() - 0.5)))).collect()
    }

    fn sampled(rule: &Sampling<'_>, spread: f64) -> (Sampled, Vec<Range<usize>>) {
        let mut waves = vec![];
        let found = rule.run(|numbers| {
            waves.push(numbers.clone());
            Ok(numbers.map(|k| block(k, spread)).collect())
        });
        (found.unwrap(), waves)
    }

    /// Returns a time after the end of every test.
    fn later() -> Instant {
        Instant::now() + std::time::Duration::from_secs(3600)
    }

    fn budget(relative_error: f64, seconds: f64) -> Budget {
        Budget { relative_error, seconds }
    }

    #[test]
    fn blocks_are_made_until_the_error_asked_for_and_not_many_more() {
        let (found, waves) = sampled(&Sampling::within(budget(1e-3, 60.0), 0.01, later()), 0.02);
        assert!(found.blocks.worst_error(&[]) <= 1e-3 && found.remark.is_none());
        // (20 / 1)^2 = 400 blocks, as far as 8 blocks can tell.
        assert!((300..700).contains(&found.blocks.count()), "{waves:?}");
        assert!(waves.iter().all(|w| w.len() <= MAX_GROWTH * w.start.max(3)), "{waves:?}");
        // Every block once and in order, so that its number can seed it.
        assert!(waves.windows(2).all(|w| w[0].end == w[1].start) && waves[0].start == 0);
        assert!((found.work_s - 0.01 * found.blocks.count() as f64).abs() < 1e-12);
    }

    #[test]
    fn noise_in_the_error_of_few_blocks_costs_few_blocks_and_leaves_the_error_of_the_mean_as_it_is_stated() {
        let mut random = fastrand::Rng::with_seed(7);
        let asked = 0.02 / 24f64.sqrt();
        let (mut costly, mut blocks, mut deviates) = (0, 0, vec![]);
        for _ in 0..3000 {
            let rule =
                Sampling { enough_blocks: BELIEVED_BLOCKS, ..Sampling::within(budget(asked, 60.0), 0.01, later()) };
            let found = rule.run(|numbers| Ok(numbers.map(|_| normal_block(&mut random)).collect())).unwrap().blocks;
            blocks += found.count();
            costly += usize::from((asked / found.worst_error(&[])).powi(2) > 1.5);
            for estimate in found.estimates() {
                deviates.push((estimate.value - 1.0) / estimate.uncertainty.standard_error().unwrap());
            }
        }
        // The values are 353 and 32.0 if one wave adds all that seems to be missing.
        assert!(costly < 60 && (27.0..30.0).contains(&(blocks as f64 / 3000.0)), "{costly} {blocks}");
        // Stopping at a low error estimate does not widen the distribution beyond Student's t with the stated degrees of freedom.
        let variance = deviates.iter().map(|z| z * z).sum::<f64>() / deviates.len() as f64;
        let stated = degrees_of_freedom(24);
        assert!(variance > 1.0 && variance < stated / (stated - 2.0), "{variance}");
    }

    /// Returns a block of two sensors that are normal about 1 with a standard deviation of 0.02.
    fn normal_block(random: &mut fastrand::Rng) -> Vec<f64> {
        (0..2).map(|_| 1.0 + 0.02 * luxproof_process::random::normal(random)).collect()
    }

    /// One block in forty meets light, 1 lx in the mean.
    fn sliver_block(number: usize) -> Vec<f64> {
        vec![if number % 40 == 39 { 40.0 } else { 0.0 }]
    }

    /// The number of blocks of one second each in a dark room.
    fn dark_blocks(seconds: f64) -> usize {
        let rule = Sampling::within(budget(0.1, seconds), 1.0, later());
        rule.run(|numbers| Ok(numbers.map(|_| vec![0.0]).collect())).unwrap().blocks.count()
    }

    #[test]
    fn light_that_few_blocks_meet_is_searched_for_within_a_share_of_the_time() {
        let rule = Sampling::within(budget(0.1, 1e4), 1.0, later());
        let found = rule.run(|numbers| Ok(numbers.map(sliver_block).collect())).unwrap();
        assert!(found.blocks.count() > 40 && found.blocks.estimates()[0].value > 0.5, "{}", found.blocks.count());
        assert_eq!([dark_blocks(1e4), dark_blocks(1e6), dark_blocks(10.0)], [1000, 1024, MIN_BLOCKS]);
    }

    #[test]
    fn without_time_there_are_the_fewest_blocks_and_a_remark() {
        let rule = Sampling { enough_blocks: 32, ..Sampling::within(budget(1e-6, 0.0), 1.0, later()) };
        let found = sampled(&rule, 0.02).0;
        assert_eq!(found.blocks.count(), MIN_BLOCKS);
        assert!(found.remark.unwrap().starts_with("out of time"));
        for (seconds, blocks) in [(20.5, 20), (9e9, 32)] {
            assert_eq!(sampled(&Sampling { seconds, ..rule }, 0.0).0.blocks.count(), blocks);
        }
    }

    #[test]
    fn few_blocks_do_where_even_their_wide_interval_is_narrow_enough() {
        // 2 % / sqrt(8), and 2.5 times that.
        assert!((2.4..2.6).contains(&widening(8)) && widening(16) < 1.6, "{} {}", widening(8), widening(16));
        assert_eq!([blocks_for(0.1), blocks_for(0.006)], [8, 16]);
        // The sampler stops at the first count with a narrow enough interval.
        assert!((9..16).contains(&blocks_for(0.012)), "{}", blocks_for(0.012));
        assert!(blocks_for(0.002) > 50);
    }

    /// Returns how many blocks a relative error takes where 16 blocks are enough to trust it.
    fn blocks_for(relative_error: f64) -> usize {
        let rule = Sampling { enough_blocks: 16, ..Sampling::within(budget(relative_error, 60.0), 0.01, later()) };
        sampled(&rule, 0.02).0.blocks.count()
    }

    #[test]
    fn a_clock_that_ran_out_is_reported_and_changes_nothing_else() {
        let rule = Sampling::within(budget(1e-3, 60.0), 0.01, later());
        let (late, _) = sampled(&Sampling { until: Instant::now(), ..rule }, 0.02);
        let (whole, _) = sampled(&rule, 0.02);
        assert!(late.remark.unwrap().starts_with("time limit: cut short by the clock"));
        assert_eq!(late.blocks.0, whole.blocks.0[..MIN_BLOCKS_WITHOUT_TIME]);
        // The part is that of all blocks, not of the next wave.
        let part = late.blocks.count() as f64 / whole.blocks.count() as f64;
        assert!(
            late.cut_to.is_some_and(|cut_to| (0.2 * part..5.0 * part).contains(&cut_to)),
            "{:?} {part}",
            late.cut_to
        );
        assert_eq!(whole.cut_to, None);
    }

    #[test]
    fn fewer_blocks_are_not_begun_where_they_may_take_as_long_as_those_before() {
        let rule = Sampling::within(budget(1e-3, 60.0), 0.01, Instant::now() + Duration::from_millis(300));
        let rule = Sampling { min_blocks: MIN_BLOCKS_WITHOUT_TIME, ..rule };
        let mut waves = vec![];
        // Blocks run in parallel: a wave takes 200 ms, however many it has.
        let found = rule.run(|numbers| {
            waves.push(numbers.len());
            std::thread::sleep(Duration::from_millis(200));
            Ok(numbers.map(|k| block(k, 0.02)).collect())
        });
        assert!(found.unwrap().remark.unwrap().starts_with("time limit: cut short by the clock"));
        assert_eq!(waves.len(), 1, "{waves:?}");
    }

    #[test]
    fn a_machine_that_was_slow_for_a_trial_gets_blocks_of_which_the_fewest_end_in_time() {
        let longest = |trial_s| longest_block_s(Duration::from_secs_f64(trial_s), 1.0, later());
        assert_eq!(longest(2.9), f64::INFINITY);
        // Ten times slower than is counted: eight blocks take half of an hour.
        assert!((longest(12.0) - 22.5).abs() < 0.1, "{}", longest(12.0));
    }

    #[test]
    fn no_wave_is_begun_that_would_end_too_late() {
        let (begun, limit) = (Instant::now(), std::time::Duration::from_millis(400));
        let rule = Sampling::within(budget(1e-6, 60.0), 1e-3, begun + limit);
        let found = rule.run(|numbers| {
            std::thread::sleep(std::time::Duration::from_millis(10 * numbers.len() as u64));
            Ok(numbers.map(|k| block(k, 0.02)).collect())
        });
        let found = found.unwrap();
        // The count allows ten times as many; a slow machine costs blocks, not time.
        assert!((MIN_BLOCKS_WITHOUT_TIME..=40).contains(&found.blocks.count()), "{}", found.blocks.count());
        assert!(found.remark.unwrap().starts_with("time limit: cut short by the clock"));
    }

    #[test]
    fn a_machine_that_is_four_times_slower_than_counted_on_costs_blocks_and_not_time() {
        let begun = Instant::now();
        let rule = Sampling::within(budget(1e-6, 60.0), 0.05, begun + std::time::Duration::from_secs(1));
        let mut waves = vec![];
        let found = rule.run(|numbers| {
            waves.push(numbers.len());
            std::thread::sleep(std::time::Duration::from_millis(200 * numbers.len() as u64));
            Ok(numbers.map(|k| block(k, 0.02)).collect())
        });
        let found = found.unwrap();
        // Eight at once would take 1.6 s.
        assert!(waves[0] <= 5 && found.blocks.count() <= 5, "{waves:?}");
        assert!(found.remark.unwrap().starts_with("time limit: cut short by the clock"));
    }

    #[test]
    fn a_fixed_number_of_blocks_is_just_that() {
        assert_eq!(sampled(&Sampling::fixed(8, budget(1e-6, 60.0), 0.1, later()), 0.5).0.blocks.count(), 8);
    }

    #[test]
    fn light_that_is_subtracted_leaves_a_larger_relative_error() {
        let blocks = Blocks::new((0..8).map(|k| block(k, 0.02)).collect());
        let ratio = blocks.worst_error(&[50.0, 50.0]) / blocks.worst_error(&[]);
        assert!((ratio - 2.0).abs() < 0.1, "{ratio}");
        assert_eq!(Blocks::new(vec![vec![0.0]; 8]).worst_error(&[]), 0.0);
    }

    #[test]
    fn the_skewness_of_normal_blocks_is_a_normal_deviate_and_a_heavy_tail_is_far_from_it() {
        let mut random = fastrand::Rng::with_seed(1);
        for blocks in [8, 16, 64] {
            let normal: Vec<f64> = (0..2000).map(|_| drawn_skewness(&mut random, blocks, |z| 10.0 + z)).collect();
            let variance = normal.iter().map(|z| z * z).sum::<f64>() / 2000.0;
            assert!((6.0 * variance - 1.0).abs() < 0.12, "{blocks}: {variance}");
            let heavy = (0..200).filter(|_| drawn_skewness(&mut random, blocks, |z| (2.0 * z).exp()) > 2.0).count();
            assert!(heavy > 170, "{blocks}: {heavy}");
        }
        assert_eq!(Blocks::new(vec![vec![1.0]; 8]).skewness(), None);
        assert_eq!(Blocks::new(vec![vec![1.0], vec![2.0]]).skewness(), None);
    }

    /// Draws blocks of six sensors, each a function of a normal value, and returns their skewness.
    fn drawn_skewness(random: &mut fastrand::Rng, blocks: usize, value: fn(f64) -> f64) -> f64 {
        let blocks = (0..blocks).map(|_| (0..6).map(|_| value(luxproof_process::random::normal(random))).collect());
        Blocks::new(blocks.collect()).skewness().unwrap()
    }

    #[test]
    fn meters_that_mirror_each_other_share_their_noise_and_that_outlives_the_samples() {
        let one = Blocks::new((0..16).map(|k| block(k, 0.02)[..1].to_vec()).collect());
        let twelve = one.rearranged(&[Some((0, 1.0)); 12]);
        let mut found = Measurement { samples: vec![twelve], ..Measurement::default() };
        assert!((found.design_effect().unwrap() - 12.0).abs() < 1e-9);
        found.drop_samples();
        assert!(found.samples.is_empty() && (found.design_effect().unwrap() - 12.0).abs() < 1e-9);
    }

    #[test]
    fn what_no_sample_met_is_not_seen_unless_nothing_was() {
        let [never, once] = [0.0, 0.1].map(|lx| Blocks::new(vec![vec![1.0, 0.0], vec![2.0, lx]]).estimates()[1]);
        assert_eq!(never.uncertainty, Uncertainty::NotSeen);
        // A meter that faces away is dark however long it is sampled.
        assert_eq!(Blocks::new(vec![vec![1.0, 0.0]; 2]).worst_error(&[]), 0.0);
        assert!(once.uncertainty.standard_error().unwrap() > 0.0);
        // A dark room is dark, and says so.
        assert_eq!(Blocks::new(vec![vec![0.0]; 8]).estimates()[0].uncertainty.standard_error(), Some(0.0));
    }

    #[test]
    fn blocks_have_about_half_the_degrees_of_freedom_of_normal_ones_as_mildly_skewed_ones_do() {
        let found = [8, 16, 200].map(|n| degrees_of_freedom(n) / (n as f64 - 1.0));
        assert!((found[0] - 0.533).abs() < 1e-3 && (found[2] - 0.501).abs() < 1e-3, "{found:?}");
        let mut random = fastrand::Rng::with_seed(3);
        let all: Vec<f64> = (0..40_000).map(|_| skewed_variance(&mut random)).collect();
        let mean = all.iter().sum::<f64>() / all.len() as f64;
        let spread = all.iter().map(|v| (v / mean - 1.0).powi(2)).sum::<f64>() / all.len() as f64;
        assert!((2.0 / spread / degrees_of_freedom(8) - 1.0).abs() < 0.1, "{}", 2.0 / spread);
    }

    /// Returns the sample variance of eight values of a mildly skewed distribution.
    ///
    /// It is exponential noise times 0.7598 plus normal noise, which leaves a third of the excess kurtosis of 6.
    fn skewed_variance(random: &mut fastrand::Rng) -> f64 {
        let samples: Vec<f64> = (0..8)
            .map(|_| -(random.f64().max(1e-300).ln()) * 0.7598 + 0.6501 * luxproof_process::random::normal(random))
            .collect();
        Estimate::of_samples(&samples).uncertainty.standard_error().map_or(0.0, |e| 8.0 * e * e)
    }

    #[test]
    fn weighted_sums_know_what_stations_have_in_common() {
        // The second sensor reads too little by what the first reads too much.
        let part = Blocks::new([0.3, -0.1, 0.2, -0.4].map(|e| vec![10.0 + e, 20.0 - e]).to_vec());
        let mut found = Measurement { estimates: part.estimates(), ..Measurement::default() };
        let without_samples = found.weighted(&[(0, 1.0), (1, 1.0)]).uncertainty;
        let one = found.estimates[0].uncertainty.standard_error().unwrap();
        // Without the samples, the errors may be fully correlated.
        assert!((without_samples.standard_error().unwrap() - 2.0 * one).abs() < 1e-15);
        found.samples.push(part);
        let sum = found.weighted(&[(0, 1.0), (1, 1.0)]);
        assert!((sum.value - 30.0).abs() < 1e-13 && sum.uncertainty.standard_error().unwrap() < 1e-15);
        let difference = found.weighted(&[(0, 1.0), (1, -1.0)]).uncertainty;
        assert!((difference.standard_error().unwrap() - 2.0 * one).abs() < 1e-15);
        assert_eq!(difference.degrees_of_freedom(), Some(degrees_of_freedom(4)));
    }

    #[test]
    fn independent_parts_add_in_quadrature_and_bounds_add_up() {
        let parts = [0.1, 0.2].map(|e| Blocks::new([e, -e, e, -e].map(|e| vec![5.0 + e]).to_vec()));
        let [direct, reflected] = parts.each_ref().map(|p| p.estimates()[0]);
        let estimate = direct.plus(&reflected);
        let estimate = Estimate { uncertainty: estimate.uncertainty.within(0.25), ..estimate };
        let found = Measurement { estimates: vec![estimate], samples: parts.to_vec(), ..Measurement::default() };
        let half = found.weighted(&[(0, -0.5)]);
        assert_eq!((half.value, half.uncertainty.bound()), (-5.0, 0.125));
        let (found, right) = (half.uncertainty, estimate.uncertainty);
        assert!((found.standard_error().unwrap() - 0.5 * right.standard_error().unwrap()).abs() < 1e-15);
        assert!((found.degrees_of_freedom().unwrap() - right.degrees_of_freedom().unwrap()).abs() < 1e-12);
        let bounded = Measurement { estimates: vec![Estimate::DARK], ..Measurement::default() };
        assert_eq!(bounded.weighted(&[(0, 2.0)]).uncertainty, Uncertainty::Bound(0.0));
    }
}
