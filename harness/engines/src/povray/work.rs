//! What blocks take, as it is counted.

use std::iter::Sum;
use std::ops::Add;

/// Seconds that are counted for a block: of what follows one reflection, which grow with the rays a sample, and of what follows more, which grow with
/// their square, as more samples shoot more rays each (11 rooms, 25 to 140 rays: powers of 1.00 and of 1.5 to 2.1).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Work {
    pub(super) first_s: f64,
    pub(super) further_s: f64,
}

impl Add for Work {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self { first_s: self.first_s + other.first_s, further_s: self.further_s + other.further_s }
    }
}

impl Sum for Work {
    fn sum<I: Iterator<Item = Self>>(all: I) -> Self {
        all.fold(Self::default(), Self::add)
    }
}

impl Work {
    /// With so many times the rays.
    pub(super) fn seconds(self, times: f64) -> f64 {
        times * (self.first_s + times * self.further_s)
    }

    /// So many times the rays take so many seconds.
    pub(super) fn times_in(self, seconds: f64) -> f64 {
        if seconds.is_infinite() {
            return f64::INFINITY;
        }
        // The positive root of seconds(t) = seconds, in which nothing cancels.
        let first = self.first_s;
        2.0 * seconds / (first + (first * first + 4.0 * self.further_s * seconds).sqrt()).max(f64::MIN_POSITIVE)
    }
}
