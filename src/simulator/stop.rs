//! When to stop before the work is done: a flag that somebody else raises, or a time.

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

/// What ends a solution early; what is known by then comes with its larger bound.
#[derive(Clone, Copy, Debug, Default)]
pub struct Stop {
    /// Raised from outside, by a signal say.
    pub flag: Option<&'static AtomicBool>,
    /// When time is up.
    pub deadline: Option<Instant>,
}

impl Stop {
    /// Never.
    pub const NEVER: Self = Self { flag: None, deadline: None };

    /// Whether it is time.
    pub fn is_due(&self) -> bool {
        self.flag.is_some_and(|flag| flag.load(Ordering::Relaxed)) || self.deadline.is_some_and(|d| Instant::now() >= d)
    }
}
