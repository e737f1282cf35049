//! Tolerances: how far a reading may lie from its reference.

use clap::ValueEnum;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// How far a reading may lie from its reference: the larger of the two.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Tolerance {
    /// Relative to the reference.
    pub relative: f64,
    /// In the quantity's unit.
    pub absolute: f64,
}

impl Tolerance {
    /// The allowed distance from a reference, in its unit.
    pub fn around(&self, reference: f64) -> f64 {
        (self.relative * reference.abs()).max(self.absolute)
    }

    /// The narrower of both in either part.
    #[must_use]
    pub fn narrowed(self, other: Self) -> Self {
        Self { relative: self.relative.min(other.relative), absolute: self.absolute.min(other.absolute) }
    }
}

/// The purpose of verdicts, which sets the tolerances.
#[derive(
    Clone,
    Copy,
    Debug,
    Default,
    PartialEq,
    Eq,
    PartialOrd,
    Ord,
    ValueEnum,
    Serialize,
    Deserialize,
    JsonSchema,
    strum::Display,
)]
#[serde(rename_all = "snake_case")]
#[strum(serialize_all = "snake_case")]
pub enum ToleranceClass {
    /// Values that serve as references
    Reference,
    /// Renderers that are audited or compared
    #[default]
    Verification,
    /// Lighting design
    Design,
    /// Estimates
    Survey,
}

#[cfg(test)]
mod tests {
    use super::*;
    #[test]
    fn the_larger_of_both_parts_is_allowed_and_the_smaller_of_two_tolerances_is_narrower() {
        let tolerance = Tolerance { relative: 0.02, absolute: 0.5 };
        for (reference, allowed) in [(100.0, 2.0), (-100.0, 2.0), (25.0, 0.5), (10.0, 0.5), (0.0, 0.5)] {
            assert!((tolerance.around(reference) - allowed).abs() < 1e-15, "{reference}");
        }
        let other = Tolerance { relative: 0.01, absolute: 0.7 };
        let narrower = Tolerance { relative: 0.01, absolute: 0.5 };
        assert_eq!((tolerance.narrowed(other), other.narrowed(tolerance)), (narrower, narrower));
    }
}
