//! The one sampler of all renderers: independent blocks of samples until the error or the time of a budget is met.
//!
//! A block is one estimate of the illuminance at every station, independent of every other block. The spread of the
//! blocks is the standard error of their mean, and, since stations are sampled together, of any weighted sum of stations.

use std::ops::Range;
use std::time::{Duration, Instant};

use serde::{Deserialize, Serialize};

use super::EngineError;
use crate::record::Estimate;
use crate::spec::Budget;

/// Fewer blocks make no honest standard error.
pub(super) const MIN_BLOCKS: usize = 8;
/// Blocks asked for at a time at most, in parts of those that are there: their error is itself an estimate.
const MAX_GROWTH: usize = 3;

/// Blocks of one part of the light: `blocks[block][station]` in lux.
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

    /// The mean at each station, with as many degrees of freedom as there are blocks less one.
    pub fn estimates(&self) -> Vec<Estimate> {
        let mut all: Vec<Estimate> = self.stations().map(|k| self.weighted(&[(k, 1.0)])).collect();
        Estimate::mark_unseen(&mut all);
        all
    }

    fn stations(&self) -> Range<usize> {
        0..self.0.first().map_or(0, Vec::len)
    }

    /// The weighted sum over stations, with the error that their joint sampling gives it.
    pub fn weighted(&self, weights: &[(usize, f64)]) -> Estimate {
        let sum = |block: &Vec<f64>| weights.iter().map(|(k, weight)| weight * block[*k]).sum();
        Estimate::of_samples(&self.0.iter().map(sum).collect::<Vec<f64>>())
    }

    /// How skewed the blocks are: the normal deviate of their skewness (D'Agostino, Biometrika 57 (1970) 679), in the mean over stations,
    /// so that stations that vary together count as one. `None` for fewer blocks than that holds for, or where nothing varies.
    pub fn skewness(&self) -> Option<f64> {
        let n = self.count() as f64;
        if self.count() < MIN_BLOCKS {
            return None;
        }
        let of = |k: usize| {
            let mean = self.0.iter().map(|b| b[k]).sum::<f64>() / n;
            let moment = |power| self.0.iter().map(|b| (b[k] - mean).powi(power)).sum::<f64>() / n;
            Some(moment(3) / moment(2).powf(1.5)).filter(|g| g.is_finite())
        };
        let y = ((n + 1.0) * (n + 3.0) / (6.0 * (n - 2.0))).sqrt();
        let kurtosis =
            3.0 * (n * n + 27.0 * n - 70.0) * (n + 1.0) * (n + 3.0) / ((n - 2.0) * (n + 5.0) * (n + 7.0) * (n + 9.0));
        let w = ((2.0 * (kurtosis - 1.0)).sqrt() - 1.0).sqrt();
        let deviate = |g: f64| (y * g / (2.0 / (w * w - 1.0)).sqrt()).asinh() / w.ln().sqrt();
        let all: Vec<f64> = self.stations().filter_map(of).map(deviate).collect();
        (!all.is_empty()).then(|| all.iter().sum::<f64>() / all.len() as f64)
    }

    /// Blocks of other stations, each a factor times one of these, or dark.
    #[must_use]
    pub fn rearranged(&self, stations: &[Option<(usize, f64)>]) -> Self {
        let of = |block: &Vec<f64>| stations.iter().map(|s| s.map_or(0.0, |(k, factor)| factor * block[k])).collect();
        Self(self.0.iter().map(of).collect())
    }

    /// The largest standard error relative to its reading, which is the mean less `known_lx`, light that is not sampled.
    pub fn worst_error(&self, known_lx: &[f64]) -> f64 {
        let relative = |k: usize| {
            let mean = self.weighted(&[(k, 1.0)]);
            let error = mean.uncertainty.standard_error().unwrap_or(f64::INFINITY);
            let reading = mean.value - known_lx.get(k).unwrap_or(&0.0);
            if error == 0.0 { 0.0 } else { error / reading.max(f64::MIN_POSITIVE) }
        };
        self.stations().map(relative).fold(0.0, f64::max)
    }
}

/// When to stop, and how many blocks come at a time.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sampling<'a> {
    /// The largest standard error relative to a reading that is small enough.
    pub(super) relative_error: f64,
    /// What the mean holds that is no part of the reading, at each station; empty where there is nothing.
    pub(super) known_lx: &'a [f64],
    /// Blocks that would probably end later are not begun.
    pub(super) until: Instant,
    /// Blocks that are made whatever the time.
    pub(super) min_blocks: usize,
    /// Before there are so many, an error that is small enough is not believed.
    pub(super) enough_blocks: usize,
    pub(super) max_blocks: usize,
    /// The last wave is asked for all that is missing.
    pub(super) max_waves: usize,
    /// So many take as long as one.
    pub(super) side_by_side: usize,
    /// How long one takes, if a trial told; if none did, the first wave is the fewest blocks.
    pub(super) block_s: Option<f64>,
}

impl Sampling<'static> {
    /// As many blocks as a budget asks for.
    pub(super) fn within(budget: Budget, started: Instant) -> Self {
        // A budget of more than a century has no end.
        let seconds = Duration::from_secs_f64(budget.seconds.clamp(0.0, 3e9));
        Self {
            relative_error: budget.relative_error,
            known_lx: &[],
            until: started + seconds,
            min_blocks: MIN_BLOCKS,
            enough_blocks: MIN_BLOCKS,
            max_blocks: usize::MAX,
            max_waves: usize::MAX,
            side_by_side: 1,
            block_s: None,
        }
    }

    /// A fixed number of blocks, whatever their error.
    pub(super) fn fixed(blocks: usize, budget: Budget, started: Instant) -> Self {
        let (relative_error, min_blocks) = (f64::INFINITY, MIN_BLOCKS.min(blocks));
        let within = Self::within(budget, started);
        Self { relative_error, min_blocks, enough_blocks: blocks, max_blocks: blocks, ..within }
    }
}

impl Sampling<'_> {
    /// Calls `wave` for blocks by their numbers, from 0 on, until there are enough.
    pub(super) fn run(
        &self,
        mut wave: impl FnMut(Range<usize>) -> Result<Vec<Vec<f64>>, EngineError>,
    ) -> Result<Blocks, EngineError> {
        let mut blocks = Blocks::default();
        let mut turn_s = self.block_s;
        for waves_left in (0..self.max_waves).rev() {
            let have = blocks.count();
            let count = self.next(&blocks, turn_s, waves_left);
            if count == 0 {
                break;
            }
            let started = Instant::now();
            blocks.0.extend(wave(have..have + count)?);
            let took_s = started.elapsed().as_secs_f64() / count.div_ceil(self.side_by_side) as f64;
            // The slowest so far is what the next may take.
            turn_s = turn_s.filter(|_| have > 0).map(|s| s.max(took_s)).or(Some(took_s));
        }
        Ok(blocks)
    }

    pub(super) fn shortfall(&self, blocks: &Blocks) -> Option<String> {
        let worst = blocks.worst_error(self.known_lx);
        (worst > self.relative_error).then(|| format!("out of time at a relative standard error of {worst:.1e}"))
    }

    /// How many blocks come next; 0 for no more.
    fn next(&self, blocks: &Blocks, turn_s: Option<f64>, waves_left: usize) -> usize {
        let have = blocks.count();
        let missing = if have < self.enough_blocks {
            self.enough_blocks - have
        } else {
            let excess = blocks.worst_error(self.known_lx) / self.relative_error;
            let missing = (have as f64 * (excess * excess - 1.0)).ceil() as usize;
            if waves_left == 0 { missing } else { missing.min(MAX_GROWTH * have) }
        };
        let left_s = self.until.saturating_duration_since(Instant::now()).as_secs_f64();
        let turns = turn_s.map_or(0, |turn_s| (left_s / turn_s) as usize);
        let count = missing.min(turns.saturating_mul(self.side_by_side)).max(self.min_blocks.saturating_sub(have));
        count.next_multiple_of(self.side_by_side).min(self.max_blocks - have)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::engines::Measurement;
    use crate::record::Uncertainty;

    /// Blocks of two stations with mean 100 and a relative standard deviation of `spread`, from their numbers alone.
    fn block(number: usize, spread: f64) -> Vec<f64> {
        let mut random = fastrand::Rng::with_seed(number as u64);
        let uniform = |random: &mut fastrand::Rng| 12f64.sqrt() * (random.f64() - 0.5);
        (0..2).map(|_| 100.0 * (1.0 + spread * uniform(&mut random))).collect()
    }

    fn sampled(rule: &Sampling<'_>, spread: f64) -> (Blocks, Vec<Range<usize>>) {
        let mut waves = vec![];
        let wave = |numbers: Range<usize>| {
            waves.push(numbers.clone());
            Ok(numbers.map(|k| block(k, spread)).collect())
        };
        let blocks = rule.run(wave).unwrap();
        (blocks, waves)
    }

    fn budget(relative_error: f64, seconds: f64) -> Budget {
        Budget { relative_error, seconds }
    }

    #[test]
    fn blocks_are_made_until_the_error_asked_for_and_not_many_more() {
        let rule = Sampling { side_by_side: 3, ..Sampling::within(budget(1e-3, 60.0), Instant::now()) };
        let (blocks, waves) = sampled(&rule, 0.02);
        assert!(blocks.worst_error(&[]) <= 1e-3 && rule.shortfall(&blocks).is_none());
        // (20 / 1)^2 = 400 blocks, as far as 8 blocks can tell.
        assert!((300..700).contains(&blocks.count()), "{waves:?}");
        assert!(waves.iter().all(|w| w.len() % 3 == 0 && w.len() <= MAX_GROWTH * w.start.max(3)), "{waves:?}");
        // Every block once and in order, so that its number can seed it.
        assert!(waves.windows(2).all(|w| w[0].end == w[1].start) && waves[0].start == 0);
    }

    #[test]
    fn without_time_there_are_the_fewest_blocks_and_a_remark() {
        let rule = Sampling { enough_blocks: 32, ..Sampling::within(budget(1e-6, 0.0), Instant::now()) };
        let (blocks, _) = sampled(&rule, 0.02);
        assert_eq!(blocks.count(), MIN_BLOCKS);
        assert!(rule.shortfall(&blocks).unwrap().starts_with("out of time"));
        assert_eq!(
            sampled(&Sampling { block_s: Some(1e-9), until: Instant::now() + Duration::from_secs(9), ..rule }, 0.0)
                .0
                .count(),
            32
        );
    }

    #[test]
    fn a_fixed_number_of_blocks_is_just_that() {
        let rule = Sampling::fixed(8, budget(1e-6, 60.0), Instant::now());
        for side_by_side in [1, 3] {
            assert_eq!(sampled(&Sampling { side_by_side, ..rule }, 0.5).0.count(), 8);
        }
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
            let mut drawn = |of: fn(f64) -> f64| {
                let mut block = || (0..6).map(|_| of(crate::system::random::normal(&mut random))).collect();
                Blocks::new((0..blocks).map(|_| block()).collect()).skewness().unwrap()
            };
            let normal: Vec<f64> = (0..2000).map(|_| drawn(|z| 10.0 + z)).collect();
            let variance = normal.iter().map(|z| z * z).sum::<f64>() / 2000.0;
            assert!((6.0 * variance - 1.0).abs() < 0.12, "{blocks}: {variance}");
            let heavy = (0..200).filter(|_| drawn(|z| (2.0 * z).exp()) > 2.0).count();
            assert!(heavy > 170, "{blocks}: {heavy}");
        }
        assert_eq!(Blocks::new(vec![vec![1.0]; 8]).skewness(), None);
        assert_eq!(Blocks::new(vec![vec![1.0], vec![2.0]]).skewness(), None);
    }

    #[test]
    fn what_no_sample_met_is_not_seen_unless_nothing_was() {
        let of = |second: f64| Blocks::new(vec![vec![1.0, 0.0], vec![2.0, second]]).estimates()[1].uncertainty;
        assert_eq!(of(0.0), Uncertainty::NotSeen);
        // A meter that faces away is dark however long it is sampled.
        assert_eq!(Blocks::new(vec![vec![1.0, 0.0]; 2]).worst_error(&[]), 0.0);
        assert!(of(0.1).standard_error().unwrap() > 0.0);
        // A dark room is dark, and says so.
        assert_eq!(Blocks::new(vec![vec![0.0]; 8]).estimates()[0].uncertainty.standard_error(), Some(0.0));
    }

    #[test]
    fn weighted_sums_know_what_stations_have_in_common() {
        // The second station reads too little by what the first reads too much.
        let part = Blocks::new([0.3, -0.1, 0.2, -0.4].map(|e| vec![10.0 + e, 20.0 - e]).to_vec());
        let mut found = Measurement { estimates: part.estimates(), ..Measurement::default() };
        let apart = found.weighted(&[(0, 1.0), (1, 1.0)]).uncertainty;
        let one = found.estimates[0].uncertainty.standard_error().unwrap();
        // Not knowing the samples, the errors may be all one.
        assert!((apart.standard_error().unwrap() - 2.0 * one).abs() < 1e-15);
        found.samples.push(part);
        let sum = found.weighted(&[(0, 1.0), (1, 1.0)]);
        assert!((sum.value - 30.0).abs() < 1e-13 && sum.uncertainty.standard_error().unwrap() < 1e-15);
        let difference = found.weighted(&[(0, 1.0), (1, -1.0)]).uncertainty;
        assert!((difference.standard_error().unwrap() - 2.0 * one).abs() < 1e-15);
        assert_eq!(difference.degrees_of_freedom(), Some(3.0));
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
