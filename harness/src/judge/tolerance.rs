//! Tolerances: read from `reference/tolerances.yaml`, overridden by a spec; zero where nothing is said.

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::Basis;
use crate::record::{ProcedureId, Quantity};
use crate::spec::ToleranceOverride;

const DEFAULTS: &str = include_str!("../../../reference/tolerances.yaml");

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
}

#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Tolerances {
    coverage_factor: Sourced,
    family_wise_error: Sourced,
    #[serde(rename = "tolerances")]
    rules: Vec<Rule>,
}

#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Sourced {
    value: f64,
    source: String,
}

#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Rule {
    procedure: ProcedureId,
    #[serde(default)]
    basis: Option<Basis>,
    #[serde(default)]
    engine: Option<String>,
    #[serde(default)]
    relative: f64,
    #[serde(default)]
    absolute_lx: f64,
    #[serde(default)]
    absolute_cd: f64,
    source: String,
}

#[derive(Debug, thiserror::Error)]
#[error("reference/tolerances.yaml: {0}")]
pub struct ToleranceError(String);

impl Tolerances {
    pub fn built_in() -> Result<Self, ToleranceError> {
        crate::spec::from_yaml::<Self>(DEFAULTS).map_err(ToleranceError)?.checked()
    }

    fn checked(self) -> Result<Self, ToleranceError> {
        if let Some(rule) = self.rules.iter().find(|r| r.source.trim().is_empty()) {
            return Err(ToleranceError(format!("a tolerance of {} has no source", rule.procedure)));
        }
        let sound = self.coverage_factor.value.is_finite() && self.coverage_factor.value > 0.0;
        if !sound || self.coverage_factor.source.trim().is_empty() {
            return Err(ToleranceError("the coverage factor needs a positive value and a source".into()));
        }
        let level = &self.family_wise_error;
        if !(level.value > 0.0 && level.value < 0.5) || level.source.trim().is_empty() {
            return Err(ToleranceError("the family-wise error needs a value between 0 and .5 and a source".into()));
        }
        Ok(self)
    }

    /// How many standard deviations of a normal distribution the interval of a verdict covers.
    pub fn coverage_factor(&self) -> f64 {
        self.coverage_factor.value
    }

    /// How probable any false failure may be among all comparisons of an engine in a procedure.
    pub fn family_wise_error(&self) -> f64 {
        self.family_wise_error.value
    }

    /// The tolerance of a comparison: the spec's override, else the rule that names most, else zero.
    pub fn of(
        &self,
        procedure: ProcedureId,
        basis: Basis,
        engine: &str,
        quantity: Quantity,
        overrides: &BTreeMap<ProcedureId, ToleranceOverride>,
    ) -> Tolerance {
        let absolute = |lx: f64, cd: f64| match quantity {
            Quantity::Illuminance => lx,
            Quantity::LuminousIntensity => cd,
        };
        if let Some(o) = overrides.get(&procedure) {
            return Tolerance { relative: o.relative, absolute: absolute(o.absolute_lx, o.absolute_cd) };
        }
        let applies = |rule: &&Rule| {
            rule.procedure == procedure
                && rule.basis.is_none_or(|b| b == basis)
                && rule.engine.as_deref().is_none_or(|e| e == engine)
        };
        let names = |rule: &&Rule| usize::from(rule.basis.is_some()) + 2 * usize::from(rule.engine.is_some());
        let rule = self.rules.iter().filter(applies).max_by_key(names);
        rule.map(|r| Tolerance { relative: r.relative, absolute: absolute(r.absolute_lx, r.absolute_cd) })
            .unwrap_or_default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const INDIRECT: ProcedureId = ProcedureId::IndirectIlluminance;
    const DIRECT: ProcedureId = ProcedureId::DirectIlluminance;
    const UNIT: Quantity = Quantity::Illuminance;

    #[test]
    fn the_rule_that_names_most_applies_a_spec_overrides_it_and_what_is_not_loosened_is_zero() {
        let (table, none) = (Tolerances::built_in().unwrap(), BTreeMap::new());
        assert_eq!(table.of(INDIRECT, Basis::Exact, "iesna", UNIT, &none).relative, 0.10);
        assert_eq!(table.of(INDIRECT, Basis::Exact, "radiance", UNIT, &none).relative, 0.02);
        assert_eq!(table.of(INDIRECT, Basis::Published, "iesna", UNIT, &none).absolute, 0.03);
        let strict = ToleranceOverride { relative: 1e-4, absolute_lx: 1e-3, absolute_cd: 0.0 };
        let found = table.of(DIRECT, Basis::ClosedForm, "povray", UNIT, &BTreeMap::from([(DIRECT, strict)]));
        assert_eq!(found, Tolerance { relative: 1e-4, absolute: 1e-3 });
        let bare = Tolerances { rules: vec![], ..table };
        assert_eq!(bare.of(DIRECT, Basis::Exact, "radiance", UNIT, &none), Tolerance::default());
    }
}
