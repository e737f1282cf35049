//! Comparisons: one reading against one reference.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::{Basis, ErrorBudget, MeterId, Quantity, ReadingKey, Tolerance, Uncertainty, Verdict};

/// The value that a reading is compared with.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Reference {
    /// In the quantity's unit.
    pub value: f64,
    /// Standard uncertainty, likewise.
    pub uncertainty: f64,
    /// Degrees of freedom of a sampled reference's standard error.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub degrees_of_freedom: Option<f64>,
    /// Expanded over standard uncertainty, at the coverage of verdicts; null where there is no uncertainty.
    #[serde(default)]
    pub coverage_factor: Option<f64>,
    pub basis: Basis,
    /// Formula, solver or paper.
    pub source: String,
    /// Why a printed cell is unreliable: then a deviation from it is no engine's fault.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub caveat: Option<String>,
}

impl Reference {
    /// A reference with the stated uncertainty, without a coverage factor.
    pub fn of(value: f64, stated: &Uncertainty, basis: Basis, source: String) -> Self {
        let (uncertainty, degrees_of_freedom) = (stated.standard(), stated.degrees_of_freedom());
        Self { value, uncertainty, degrees_of_freedom, coverage_factor: None, basis, source, caveat: None }
    }
}

/// One reading compared with one reference.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Comparison {
    #[serde(flatten)]
    pub key: ReadingKey,
    /// The luminaire model: point, area, impostor, or mixed.
    pub model: String,
    pub meter: MeterId,
    /// The meter's position in meters.
    pub at_m: [f64; 3],
    /// The unit vector in which the meter looks.
    pub normal: [f64; 3],
    /// Direction of the meter from the luminaire, for luminous intensity.
    pub gamma_deg: Option<f64>,
    pub c_deg: Option<f64>,
    pub quantity: Quantity,
    /// The reading; null where it is missing.
    pub value: Option<f64>,
    #[serde(flatten)]
    pub uncertainty: Uncertainty,
    /// The reference; null where there is none.
    pub reference: Option<Reference>,
    /// Reading minus reference.
    pub deviation: Option<f64>,
    /// Deviation over reference.
    pub relative_deviation: Option<f64>,
    pub tolerance: Tolerance,
    /// File and source of the tolerance, where a project sets it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tolerance_source: Option<String>,
    pub verdict: Verdict,
    pub diagnosis: Option<String>,
    /// The uncertainty of the deviation by component; null where there is no deviation.
    #[serde(default)]
    pub budget: Option<ErrorBudget>,
    /// The probability of a deviation this large if the engine is just within the tolerance. Where several stages are planned, chance
    /// counts for more.
    #[serde(default)]
    pub p_value: Option<f64>,
}

impl Comparison {
    /// The basis of the reference, where there is one.
    pub fn basis(&self) -> Option<Basis> {
        self.reference.as_ref().map(|r| r.basis)
    }

    /// The name of the basis; `none` without a reference.
    pub fn basis_name(&self) -> &'static str {
        self.basis().map_or("none", Basis::name)
    }

    /// The allowed deviation, in the quantity's unit.
    pub fn allowed(&self) -> f64 {
        self.reference.as_ref().map_or(0.0, |r| self.tolerance.around(r.value))
    }

    /// The deviation over the allowed one; `None` where there is no deviation, or where none is allowed.
    pub fn normalized_error(&self) -> Option<f64> {
        match self.deviation? {
            0.0 => Some(0.0),
            deviation => Some(deviation / self.allowed()).filter(|e| e.is_finite()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::comparison;

    #[test]
    fn a_reference_has_the_standard_uncertainty_of_what_is_stated() {
        let bounded = Reference::of(100.0, &Uncertainty::Bound(0.3), Basis::Iesna, "a formula".to_owned());
        assert!((bounded.uncertainty - 0.3 / 3f64.sqrt()).abs() < 1e-15);
        let sampled = Reference::of(100.0, &Uncertainty::sampled(0.2, Some(7.0)), Basis::Engine, "it".to_owned());
        assert_eq!((sampled.value, sampled.uncertainty, sampled.degrees_of_freedom), (100.0, 0.2, Some(7.0)));
        assert_eq!((sampled.basis, sampled.source.as_str(), sampled.coverage_factor), (Basis::Engine, "it", None));
    }

    #[test]
    fn a_deviation_is_normalized_by_what_is_allowed() {
        // 1 % of 100 lx is more than .5 lx.
        let c = comparison();
        assert_eq!((c.basis(), c.basis_name(), c.allowed()), (Some(Basis::Simulator), "simulator", 1.0));
        assert_eq!(c.normalized_error(), Some(2.0));
        let low = Comparison { deviation: Some(-0.5), ..comparison() };
        assert_eq!(low.normalized_error(), Some(-0.5));
        let equal = Comparison { deviation: Some(0.0), tolerance: Tolerance::default(), ..comparison() };
        assert_eq!(equal.normalized_error(), Some(0.0));
        let none_allowed = Comparison { tolerance: Tolerance::default(), ..comparison() };
        assert_eq!(none_allowed.normalized_error(), None);
        assert_eq!(Comparison { deviation: None, ..comparison() }.normalized_error(), None);
        let without = Comparison { reference: None, ..comparison() };
        assert_eq!((without.basis(), without.basis_name(), without.allowed()), (None, "none", 0.0));
    }
}
