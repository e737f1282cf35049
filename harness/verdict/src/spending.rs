//! Alpha spending: how a comparison with several planned stages spends its error.
//!
//! Lan and Demets (Biometrika 70, 1983) let each stage spend a part of the error that is fixed in advance. The parts add
//! up to the whole. By Bonferroni's inequality, a wrong decision at any stage is then no more probable than in one test.
//! The parts are equal. A small first part would leave most decisions to the second stage, and a large last part would
//! decide little more at an edge.

/// Stages of a sampled reading at most: each asks the engine for more samples.
pub const MAX_STAGES: u32 = 4;

/// The part of its error that a decision may spend at each stage.
pub const ERROR_SHARE_PER_STAGE: f64 = 1.0 / MAX_STAGES as f64;
