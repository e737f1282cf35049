//! Random numbers in the ranges that random rooms use.

use fastrand::Rng;

/// The least distance of a meter from a surface in meters, as a power of ten.
const MIN_GAP_LOG10_M: f64 = -3.0;
/// The largest distance that counts as close to a surface in meters, as a power of ten.
const MAX_GAP_LOG10_M: f64 = -1.3;

/// A sequence of random numbers.
pub(super) struct Draw(pub(super) Rng);

impl Draw {
    /// A number between two bounds.
    pub(super) fn within(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.0.f64()
    }

    /// True one time in `count`.
    pub(super) fn one_in(&mut self, count: usize) -> bool {
        self.0.usize(0..count) == 0
    }

    /// A small distance from a surface in meters.
    pub(super) fn close_m(&mut self) -> f64 {
        10_f64.powf(self.within(MIN_GAP_LOG10_M, MAX_GAP_LOG10_M))
    }

    /// A number between two bounds with a uniform logarithm.
    pub(super) fn magnitude(&mut self, low: f64, high: f64) -> f64 {
        10_f64.powf(self.within(low.log10(), high.log10()))
    }

    /// One of several values with equal probability.
    pub(super) fn one_of<T: Copy>(&mut self, all: &[T]) -> T {
        all[self.0.usize(0..all.len())]
    }
}
