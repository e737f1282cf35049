//! Experiments on engines and on this program itself: laws under stress, run time against error, faults put in on purpose.

pub mod bench;
pub mod bisect;
mod deviation;
mod draw;
pub mod hunt;
pub mod selftest;
pub mod stress;
mod tables;
mod trials;

use itertools::Itertools;

/// As many values are below it as above.
fn median(values: impl Iterator<Item = f64>) -> Option<f64> {
    let all = values.sorted_by(f64::total_cmp).collect_vec();
    Some(0.5 * (all.get((all.len().checked_sub(1)?) / 2)? + all.get(all.len() / 2)?))
}

/// Who is told how far an experiment is.
pub trait Progress: Sync {
    /// So many steps more are expected.
    fn planned(&self, steps: u64);
    /// Something ended that so many of them were expected for.
    fn ended(&self, what: String, steps: u64);
}

#[cfg(test)]
impl Progress for () {
    fn planned(&self, _steps: u64) {}
    fn ended(&self, _what: String, _steps: u64) {}
}
