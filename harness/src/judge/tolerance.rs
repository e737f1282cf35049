//! Tolerances: read from `reference/tolerances.yaml`, overridden by a spec; zero where nothing is said.

use std::collections::BTreeMap;
use std::path::PathBuf;

use clap::ValueEnum;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::Basis;
use super::uncertainty::upper_tail_of_normal;
use crate::record::{EngineName, ProcedureId, Quantity};
use crate::spec::{Source, SpecError, ToleranceOverride};

const DEFAULTS: &str = include_str!("../../data/tolerances.yaml");

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

/// What verdicts are for, which says how far readings may lie from their references.
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
    /// Values that others are held to
    Reference,
    /// Renderers that are audited or compared
    #[default]
    Verification,
    /// Lighting design
    Design,
    /// Estimates
    Survey,
}

#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Class {
    /// Relative tolerances of ours are so many times as wide.
    factor: f64,
    #[serde(rename = "use")]
    purpose: String,
    source: String,
}

#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Tolerances {
    coverage_factor: Sourced,
    family_wise_error: Sourced,
    classes: BTreeMap<ToleranceClass, Class>,
    #[serde(skip)]
    class: ToleranceClass,
    #[serde(rename = "tolerances")]
    rules: Vec<Rule>,
    not_claimed: Vec<NotClaimed>,
}

#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Sourced {
    value: f64,
    source: String,
}

/// How far readings may lie from their references, and how that is known.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(rename = "ToleranceRule")]
pub struct Rule {
    procedure: ProcedureId,
    /// From which references; from all where none is named.
    #[serde(default)]
    basis: Option<Basis>,
    /// Whose readings; anybody's where nobody is named.
    #[serde(default)]
    engine: Option<EngineName>,
    /// Relative to the reference.
    #[serde(default)]
    relative: f64,
    /// In lux.
    #[serde(default)]
    absolute_lx: f64,
    /// In candela.
    #[serde(default)]
    absolute_cd: f64,
    /// In candela per square metre.
    #[serde(default)]
    absolute_cd_m2: f64,
    /// Of a glare rating.
    #[serde(default)]
    absolute_ugr: f64,
    /// A standard, a paper, a decision of the project.
    source: String,
    /// Whose rule it is, where not ours.
    #[serde(skip)]
    file: Option<String>,
}

/// Where a method claims nothing: beyond its tolerance a reading is told and not judged.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct NotClaimed {
    engine: EngineName,
    procedure: ProcedureId,
    basis: Basis,
    why: String,
    source: String,
}

/// What of rules is no number or has no source.
pub(super) fn faults(source: &Source, rules: &[Rule]) -> Vec<SpecError> {
    let of_rule = |(k, rule): (usize, &Rule)| {
        let at = |field: &str| format!("tolerances[{k}].{field}");
        let values = [
            ("relative", rule.relative),
            ("absolute_lx", rule.absolute_lx),
            ("absolute_cd", rule.absolute_cd),
            ("absolute_cd_m2", rule.absolute_cd_m2),
            ("absolute_ugr", rule.absolute_ugr),
        ];
        let of_values = values.map(|(field, value)| {
            let sound = value.is_finite() && value >= 0.0;
            source.require(sound, &at(field), "a tolerance is a number from 0", "give a positive number")
        });
        let help = "say which standard, paper or decision it is from";
        let of_source =
            source.require(!rule.source.trim().is_empty(), &at("source"), "the tolerance has no source", help);
        of_values.into_iter().chain([of_source]).filter_map(Result::err).collect::<Vec<_>>()
    };
    rules.iter().enumerate().flat_map(of_rule).collect()
}

impl Rule {
    pub(super) const fn engine(&self) -> Option<&EngineName> {
        self.engine.as_ref()
    }

    const fn absolute(&self, quantity: Quantity) -> f64 {
        match quantity {
            Quantity::Illuminance => self.absolute_lx,
            Quantity::LuminousIntensity => self.absolute_cd,
            Quantity::Luminance => self.absolute_cd_m2,
            Quantity::GlareRating => self.absolute_ugr,
        }
    }
}

impl Tolerances {
    pub fn built_in() -> Result<Self, SpecError> {
        let source = Source::new(PathBuf::from("reference/tolerances.yaml"), DEFAULTS.to_owned());
        let all: Self = source.parse()?;
        faults(&source, &all.rules).into_iter().next().map_or(Ok(()), Err)?;
        let factor = &all.coverage_factor;
        let sound = factor.value.is_finite() && factor.value > 0.0 && !factor.source.trim().is_empty();
        source.require(sound, "coverage_factor", "no factor", "give a positive value and a source")?;
        let level = &all.family_wise_error;
        let sound = level.value > 0.0 && level.value < 0.5 && !level.source.trim().is_empty();
        source.require(sound, "family_wise_error", "no level", "give a value between 0 and .5 and a source")?;
        let is_sound = |class: &Class| {
            class.factor.is_finite() && class.factor > 0.0 && !(class.purpose.is_empty() || class.source.is_empty())
        };
        let all_there = ToleranceClass::value_variants().iter().all(|c| all.classes.get(c).is_some_and(is_sound));
        source.require(all_there, "classes", "one lacks factor, use or source", "give all of them")?;
        let is_told = |n: &NotClaimed| !(n.why.trim().is_empty() || n.source.trim().is_empty());
        source.require(all.not_claimed.iter().all(is_told), "not_claimed", "one lacks why or source", "give both")?;
        Ok(all)
    }

    /// The same with the rules of a project's file besides, which go before ours of the same kind.
    #[must_use]
    pub(super) fn with(mut self, rules: &[Rule], file: &str) -> Self {
        self.rules.extend(rules.iter().map(|rule| Rule { file: Some(file.to_owned()), ..rule.clone() }));
        self
    }

    /// The same for another use; tolerances of specs and projects stay as they are.
    #[must_use]
    pub fn of_class(mut self, class: ToleranceClass) -> Self {
        self.class = class;
        self
    }

    /// What verdicts are for and how often they are wrong, in a line.
    pub fn decision_rule(&self) -> String {
        let class = self.classes.get(&self.class);
        let purpose = class.map(|c| format!(" ({}; {})", c.purpose, c.source)).unwrap_or_default();
        let wrong_pass = 100.0 * upper_tail_of_normal(self.coverage_factor());
        let wrong_fail = 100.0 * self.family_wise_error();
        format!(
            "tolerances of class {}{purpose}: a pass is wrong in {wrong_pass:.1} % of comparisons at most, any fail of an engine in \
             a procedure in {wrong_fail:.1} % (JCGM 106:2012, guarded acceptance; Holm 1979)",
            self.class
        )
    }

    /// Why a reading beyond its tolerance is not judged; `None` where it is.
    pub(super) fn not_claimed(&self, procedure: ProcedureId, basis: Basis, engine: &str) -> Option<&str> {
        let applies = |n: &&NotClaimed| n.procedure == procedure && n.basis == basis && n.engine == *engine;
        self.not_claimed.iter().find(applies).map(|n| n.why.as_str())
    }

    /// How many standard deviations of a normal distribution the interval of a verdict covers.
    pub fn coverage_factor(&self) -> f64 {
        self.coverage_factor.value
    }

    /// How probable any false failure may be among all comparisons of an engine in a procedure.
    pub fn family_wise_error(&self) -> f64 {
        self.family_wise_error.value
    }

    /// The tolerance of a comparison: the spec's override, else the rule that names most, else zero; and whose it is, with its
    /// source, where it is a project's or of another class than usual.
    pub fn of(
        &self,
        procedure: ProcedureId,
        basis: Basis,
        engine: &str,
        quantity: Quantity,
        overrides: &BTreeMap<ProcedureId, ToleranceOverride>,
    ) -> (Tolerance, Option<String>) {
        if let Some(o) = overrides.get(&procedure) {
            let absolute = match quantity {
                Quantity::Illuminance => o.absolute_lx,
                Quantity::LuminousIntensity => o.absolute_cd,
                Quantity::Luminance => o.absolute_cd_m2,
                Quantity::GlareRating => o.absolute_ugr,
            };
            return (Tolerance { relative: o.relative, absolute }, None);
        }
        let applies = |rule: &&Rule| {
            rule.procedure == procedure
                && rule.basis.is_none_or(|b| b == basis)
                && rule.engine.as_ref().is_none_or(|e| e == engine)
        };
        let names = |rule: &&Rule| usize::from(rule.basis.is_some()) + 2 * usize::from(rule.engine.is_some());
        let Some(rule) = self.rules.iter().filter(applies).max_by_key(names) else { return Default::default() };
        let class = self.classes.get(&self.class).filter(|_| rule.file.is_none());
        let relative = rule.relative * class.map_or(1.0, |c| c.factor);
        let tolerance = Tolerance { relative, absolute: rule.absolute(quantity) };
        let of_class = class.filter(|_| self.class != ToleranceClass::default());
        let of_class = of_class.map(|c| format!("class {}, {}", self.class, c.purpose));
        (tolerance, rule.file.as_ref().map(|file| format!("{file}: {}", rule.source)).or(of_class))
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
        assert_eq!(table.of(INDIRECT, Basis::Exact, "iesna", UNIT, &none).0.relative, 0.10);
        assert_eq!(table.of(INDIRECT, Basis::Exact, "radiance", UNIT, &none).0.relative, 0.02);
        assert_eq!(table.of(INDIRECT, Basis::Published, "iesna", UNIT, &none).0.absolute, 0.03);
        let strict = ToleranceOverride { relative: 1e-4, absolute_lx: 1e-3, ..ToleranceOverride::default() };
        let found = table.of(DIRECT, Basis::ClosedForm, "povray", UNIT, &BTreeMap::from([(DIRECT, strict)]));
        assert_eq!(found, (Tolerance { relative: 1e-4, absolute: 1e-3 }, None));
        let design = table.clone().of_class(ToleranceClass::Design);
        let (found, whose) = design.of(INDIRECT, Basis::Exact, "radiance", UNIT, &none);
        assert_eq!((found, whose.is_some()), (Tolerance { relative: 0.1, absolute: 1e-3 }, true));
        assert_eq!(
            design.of(DIRECT, Basis::ClosedForm, "povray", UNIT, &BTreeMap::from([(DIRECT, strict)])).0.relative,
            1e-4
        );
        let rule = design.decision_rule();
        assert!(
            rule.contains("class design") && rule.contains("in 2.3 % of") && rule.contains("in 0.1 % (JCGM"),
            "{rule}"
        );
        let bare = Tolerances { rules: vec![], ..table };
        assert_eq!(bare.of(DIRECT, Basis::Exact, "radiance", UNIT, &none), Default::default());
    }
}
