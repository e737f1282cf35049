//! Experiments on engines and on luxproof itself: hunts for faults, laws under stress, run time
//! against error, and injected faults.

pub mod bench;
pub mod bisect;
mod deviation;
mod draw;
pub mod hunt;
pub mod selftest;
pub mod stress;
mod tables;
mod trials;
pub mod variants;

use itertools::Itertools;

/// The median of values; `None` where there are none.
fn median(values: impl Iterator<Item = f64>) -> Option<f64> {
    let all = values.sorted_by(f64::total_cmp).collect_vec();
    // An even number of values has two middle ones, an odd number has one that counts twice.
    Some(0.5 * (all.get((all.len().checked_sub(1)?) / 2)? + all.get(all.len() / 2)?))
}

/// Receives the progress of an experiment.
pub trait Progress: Sync {
    /// Adds a number of expected steps.
    fn planned(&self, steps: u64);
    /// Reports the end of work that a number of steps were expected for.
    fn ended(&self, what: String, steps: u64);
}

#[cfg(test)]
impl Progress for () {
    fn planned(&self, _steps: u64) {}
    fn ended(&self, _what: String, _steps: u64) {}
}
