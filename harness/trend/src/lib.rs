//! Readings over time: baselines of accepted readings, and the history of nightly runs.

pub mod baseline;
pub mod history;
