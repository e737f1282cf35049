//! Experiments on engines and on this program itself: laws under stress, run time against error, faults put in on purpose.

pub mod bench;
mod deviation;
pub mod selftest;
pub mod stress;
mod tables;
mod trials;
