//! Random numbers with the ranges that rooms take them from.

use fastrand::Rng;

/// Of one more than another surface, a meter lies this much at least off any, as a power of ten in metres.
const CLOSEST_LOG10: f64 = -3.0;
/// Meters nearer to a surface than that lie close to it.
const CLOSE_LOG10: f64 = -1.3;

pub(super) struct Draw(pub(super) Rng);

impl Draw {
    pub(super) fn within(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.0.f64()
    }

    pub(super) fn one_in(&mut self, count: usize) -> bool {
        self.0.usize(0..count) == 0
    }

    pub(super) fn close_m(&mut self) -> f64 {
        10_f64.powf(self.within(CLOSEST_LOG10, CLOSE_LOG10))
    }

    /// Evenly in the logarithm.
    pub(super) fn magnitude(&mut self, low: f64, high: f64) -> f64 {
        10_f64.powf(self.within(low.log10(), high.log10()))
    }

    /// One of several, each as probable.
    pub(super) fn one_of<T: Copy>(&mut self, all: &[T]) -> T {
        all[self.0.usize(0..all.len())]
    }
}
