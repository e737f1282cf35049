//! Light straight from the luminaires at meters: integrated where shadows can be cut exactly, sampled elsewhere.

use glam::DVec3;
use rayon::prelude::*;

use super::SampledRoom;
use super::replicates::{REPLICATES, Reading, Replicates, mean_and_error};
use crate::Bounded;
use crate::emission::Precision;
use crate::sampler::{Sampler, mix};
use crate::stop::Stop;
use luxproof_scene::Meter;

/// The part of the error asked for that an integral may have.
const INTEGRAL_PART: f64 = 0.2;
/// Samples of each replicate, as powers of two.
const SAMPLES_LOG2: std::ops::RangeInclusive<u32> = 6..=16;
/// Light below this part of what unhidden luminaires would give need not be known better.
const DARK_PART: f64 = 1e-3;
/// Light that none of n samples found is less than this over n of the whole, with 95 % probability.
const RULE_OF_THREE: f64 = 3.0;
/// Samples after which one looks whether it is time to stop.
const SAMPLES_PER_LOOK: u32 = 256;

impl SampledRoom {
    /// Direct illuminance at the meters, as far as it comes before it is stopped.
    pub(crate) fn direct(&self, meters: &[Meter], relative_error: f64, seed: u64, stop: &Stop) -> Vec<Reading> {
        let error = relative_error.clamp(1e-10, 0.1);
        let seeds: Vec<u64> = (0..meters.len() as u64).map(|k| mix(mix(seed ^ 0xd1).wrapping_add(k))).collect();
        meters.par_iter().zip(seeds).map(|(meter, seed)| self.direct_at(meter, error, seed, stop)).collect()
    }

    /// Direct illuminance at one meter.
    fn direct_at(&self, meter: &Meter, error: f64, seed: u64, stop: &Stop) -> Reading {
        let seen = (0..self.emitters.len()).filter(|k| !self.is_all_hidden(*k, meter));
        let (sampled, exact): (Vec<usize>, Vec<usize>) = seen.partition(|k| self.must_sample(*k, meter));
        let known = exact.iter().fold(Bounded::NONE, |sum, k| sum + self.integrate_direct(*k, meter, error, stop));
        if sampled.is_empty() || !known.is_read() {
            return known.into();
        }
        Reading::from(known) + self.sample_direct(meter, &sampled, known.value, error, seed, stop)
    }

    fn integrate_direct(&self, k: usize, meter: &Meter, error: f64, stop: &Stop) -> Bounded {
        if stop.is_due() {
            return Bounded::UNREAD;
        }
        let emitter = &self.emitters[k];
        let precision = Precision::relative(INTEGRAL_PART * error);
        if !emitter.is_point() {
            return emitter.illuminance(meter, self.surroundings.occluders.as_deref().unwrap_or(&[]), precision);
        }
        let is_hidden = self.surroundings.is_hidden(self.lifted_m(meter), emitter.centre_m());
        if is_hidden { Bounded::NONE } else { emitter.illuminance(meter, &[], precision) }
    }

    /// Whether something may hide a luminaire that cannot be cut out exactly.
    fn must_sample(&self, k: usize, meter: &Meter) -> bool {
        let emitter = &self.emitters[k];
        let is_cut = emitter.is_point() || emitter.is_polygonal() && self.surroundings.occluders.is_some();
        !is_cut && self.surroundings.may_hide(meter.position_m, emitter.bounds_m())
    }

    /// Whether one box hides all of a luminaire: what a convex body hides from a point is convex.
    fn is_all_hidden(&self, k: usize, meter: &Meter) -> bool {
        let ends_m = self.emitters[k].bounds_m();
        let from_m = self.lifted_m(meter);
        let corners_m = [0, 1, 2, 3, 4, 5, 6, 7].map(|c| DVec3::from_array([0, 1, 2].map(|k| ends_m[c >> k & 1][k])));
        self.surroundings
            .occluders
            .iter()
            .flatten()
            .any(|o| corners_m.iter().all(|corner_m| o.blocks(from_m, *corner_m)))
    }

    /// Light of one part of a luminaire, where nothing hides it from the start of rays.
    fn sample_seen(&self, k: usize, meter: &Meter, start_m: DVec3, parts: [f64; 2]) -> f64 {
        let (lux, from_m) = self.emitters[k].sample(meter, parts);
        if lux > 0.0 && !self.surroundings.is_hidden(start_m, from_m) { lux } else { 0.0 }
    }

    fn sample_direct(&self, meter: &Meter, which: &[usize], known: f64, error: f64, seed: u64, stop: &Stop) -> Reading {
        let start_m = self.lifted_m(meter);
        let unhidden: f64 =
            which.iter().map(|k| self.emitters[*k].illuminance(meter, &[], Precision::relative(1e-2)).value).sum();
        let mut sums: Replicates = [0.0; REPLICATES];
        let mut found: Option<Reading> = None;
        let mut error_before = f64::INFINITY;
        for log2 in SAMPLES_LOG2 {
            let from = if log2 == *SAMPLES_LOG2.start() { 0 } else { 1 << (log2 - 1) };
            let mut more = [0.0; REPLICATES];
            for (replicate, more) in more.iter_mut().enumerate() {
                for index in (from..1_u32 << log2).take_while(|k| !(k % SAMPLES_PER_LOOK == 0 && stop.is_due())) {
                    let mut sampler = Sampler::new(mix(seed.wrapping_add(replicate as u64 + 1)), index);
                    let parts = sampler.next_pair();
                    let parts = sampler.moved(parts);
                    *more += which.iter().map(|k| self.sample_seen(*k, meter, start_m, parts)).sum::<f64>();
                }
            }
            if stop.is_due() {
                break;
            }
            sums.iter_mut().zip(&more).for_each(|(sum, more)| *sum += more);
            let count = f64::from(1_u32 << log2);
            let sampled = sums.map(|sum| sum / count);
            let (mean, u) = mean_and_error(&sampled);
            // What no sample met has a size all the same.
            let unseen = if mean == 0.0 { RULE_OF_THREE * unhidden / (count * REPLICATES as f64) } else { 0.0 };
            found = Some(Reading { known: Bounded { value: 0.0, bound: unseen }, sampled });
            let allowed = (0.5 * error * (known + mean)).max(DARK_PART * error * unhidden);
            if u.max(0.5 * error_before).max(unseen) <= allowed {
                break;
            }
            error_before = u;
        }
        found.unwrap_or(Bounded::UNREAD.into())
    }
}
