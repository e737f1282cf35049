//! How a comparison that may be looked at several times spends its error: alpha spending over planned looks.
//!
//! Lan and Demets (Biometrika 70, 1983) let each look spend a part of the error that is fixed in advance; the parts add up to the
//! whole, so that by Bonferroni's inequality the chance of a wrong decision at any look is no larger than that of one test. Equal parts, since
//! a first look that may spend little leaves most to a second one, and a last one that may spend all decides hardly more at an edge.

/// Looks at a sampled reading at most: each asks the engine for more.
pub const LOOKS: u32 = 4;

/// The part of its error that a decision may spend at each look.
pub const SHARE_OF_A_LOOK: f64 = 1.0 / LOOKS as f64;
