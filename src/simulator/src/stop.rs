//! When to stop before the work is done: a flag that somebody else raises, or a time.

#[cfg(test)]
use std::sync::atomic::AtomicI64;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

/// What ends a solution early; what is known by then comes with its larger bound.
///
/// Rays are counted beforehand, so that the same count gives the same values on an idle and on a busy machine; a flag or a
/// deadline ends where it happens to be.
#[derive(Clone, Copy, Debug, Default)]
pub struct Stop {
    /// Rays that may be cast in all, as far as first samples of every meter allow.
    pub rays: Option<u64>,
    /// Raised from outside, by a signal say.
    pub flag: Option<&'static AtomicBool>,
    /// When time is up.
    pub deadline: Option<Instant>,
    /// Looks after which it is time, for tests, which no clock may decide.
    #[cfg(test)]
    pub(super) looks: Option<&'static AtomicI64>,
}

impl Stop {
    /// Never.
    pub const NEVER: Self = Self {
        rays: None,
        flag: None,
        deadline: None,
        #[cfg(test)]
        looks: None,
    };

    /// Whether it is time.
    pub fn is_due(&self) -> bool {
        #[cfg(test)]
        if self.looks.is_some_and(|left| left.fetch_sub(1, Ordering::Relaxed) <= 0) {
            return true;
        }
        self.flag.is_some_and(|flag| flag.load(Ordering::Relaxed)) || self.deadline.is_some_and(|d| Instant::now() >= d)
    }
}
