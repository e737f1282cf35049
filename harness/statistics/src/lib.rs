//! Statistics of readings: error budgets after the GUM, scatter over repetitions, tests of several claims together.
//!
//! Everything here is a function of numbers. The types that reports write are in [`luxproof_model`].

mod agreement;
mod design_effect;
pub mod error_budget;
mod extreme;
mod family;
mod scatter;
pub mod stated_errors;
mod weighted_mean;

pub use agreement::Agreement;
pub use design_effect::{design_effect, design_effect_of_squares, mean_correlation};
pub use error_budget::upper_tail_of_normal;
pub use extreme::{greatest, least};
pub use family::rejected;
pub use scatter::Tails;
pub use stated_errors::{MeterPassingByErrorOnly, Variation};
pub use weighted_mean::{SINGLE_PRECISION, WeightedMean, birge_ratio, two_sided};
