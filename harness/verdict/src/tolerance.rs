//! Tolerances from `reference/tolerances.yaml`, overridden by projects and specs; zero where no rule applies.

use luxproof_model::Tolerance;
use luxproof_model::ToleranceClass;
use std::collections::BTreeMap;
use std::path::PathBuf;

use clap::ValueEnum;
use schemars::JsonSchema;
use serde::Deserialize;

use luxproof_model::Basis;
use luxproof_model::{EngineName, ProcedureId, Quantity};
use luxproof_spec::{Source, SpecError, ToleranceOverride};
use luxproof_statistics::upper_tail_of_normal;

const DEFAULTS: &str = include_str!("../data/tolerances.yaml");

#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Class {
    /// Factor on our relative tolerances.
    factor: f64,
    #[serde(rename = "use")]
    purpose: String,
    source: String,
}

impl Class {
    fn is_complete(&self) -> bool {
        let has_texts = !self.purpose.is_empty() && !self.source.is_empty();
        self.factor.is_finite() && self.factor > 0.0 && has_texts
    }
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
    /// Of a policy that is not trusted: they narrow what the others allow, and widen nothing.
    #[serde(skip)]
    narrowing: Vec<Rule>,
    not_claimed: Vec<NotClaimed>,
}

#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Sourced {
    value: f64,
    source: String,
}

/// How far readings may deviate from their references, with the source of the limit.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(rename = "ToleranceRule")]
pub struct Rule {
    procedure: ProcedureId,
    /// The basis of references that the rule covers; all without one.
    #[serde(default)]
    basis: Option<Basis>,
    /// The engine that the rule covers; all without one.
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
    /// The file of a rule that is not ours.
    #[serde(skip)]
    file: Option<String>,
}

/// Where a method claims nothing: a reading beyond its tolerance is reported and not judged.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct NotClaimed {
    engine: EngineName,
    /// The procedure; all without one.
    #[serde(default)]
    procedure: Option<ProcedureId>,
    basis: Basis,
    why: String,
    source: String,
}

impl NotClaimed {
    fn is_complete(&self) -> bool {
        !self.why.trim().is_empty() && !self.source.trim().is_empty()
    }
}

/// Finds rules with an invalid number or without a source.
pub(super) fn faults(source: &Source, rules: &[Rule]) -> Vec<SpecError> {
    let mut faults = vec![];
    for (k, rule) in rules.iter().enumerate() {
        for (field, value) in [
            ("relative", rule.relative),
            ("absolute_lx", rule.absolute_lx),
            ("absolute_cd", rule.absolute_cd),
            ("absolute_cd_m2", rule.absolute_cd_m2),
            ("absolute_ugr", rule.absolute_ugr),
        ] {
            let is_valid = value.is_finite() && value >= 0.0;
            let place = format!("tolerances[{k}].{field}");
            let what = "a tolerance is a number from 0";
            faults.extend(source.require(is_valid, &place, what, "give a positive number").err());
        }
        let has_source = !rule.source.trim().is_empty();
        let help = "say which standard, paper or decision it is from";
        let place = format!("tolerances[{k}].source");
        faults.extend(source.require(has_source, &place, "the tolerance has no source", help).err());
    }
    faults
}

impl Rule {
    pub(super) const fn engine(&self) -> Option<&EngineName> {
        self.engine.as_ref()
    }

    fn applies(&self, procedure: ProcedureId, basis: Basis, engine: &str) -> bool {
        self.procedure == procedure
            && self.basis.is_none_or(|b| b == basis)
            && self.engine.as_ref().is_none_or(|e| e == engine)
    }

    /// How specific a rule is: an engine counts more than a basis.
    fn specificity(&self) -> usize {
        usize::from(self.basis.is_some()) + 2 * usize::from(self.engine.is_some())
    }

    /// The absolute tolerance of a quantity.
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
        let is_valid = factor.value.is_finite() && factor.value > 0.0 && !factor.source.trim().is_empty();
        source.require(is_valid, "coverage_factor", "no factor", "give a positive value and a source")?;
        let level = &all.family_wise_error;
        let is_valid = level.value > 0.0 && level.value < 0.5 && !level.source.trim().is_empty();
        source.require(is_valid, "family_wise_error", "no level", "give a value between 0 and .5 and a source")?;
        let are_complete =
            ToleranceClass::value_variants().iter().all(|c| all.classes.get(c).is_some_and(Class::is_complete));
        source.require(are_complete, "classes", "one lacks factor, use or source", "give all of them")?;
        let are_complete = all.not_claimed.iter().all(NotClaimed::is_complete);
        source.require(are_complete, "not_claimed", "one lacks why or source", "give both")?;
        Ok(all)
    }

    /// Adds the rules of a project's file, which go before ours of the same kind.
    #[must_use]
    pub(super) fn with(mut self, rules: &[Rule], file: &str) -> Self {
        self.rules.extend(rules.iter().map(|rule| Rule { file: Some(file.to_owned()), ..rule.clone() }));
        self
    }

    /// The same with the rules of a file that is not trusted: each narrows what is allowed without it.
    #[must_use]
    pub(super) fn narrowed_by(mut self, rules: &[Rule], file: &str) -> Self {
        self.narrowing.extend(rules.iter().map(|rule| Rule { file: Some(file.to_owned()), ..rule.clone() }));
        self
    }

    /// Sets the class of our tolerances; those of specs and projects stay as they are.
    #[must_use]
    pub fn of_class(mut self, class: ToleranceClass) -> Self {
        self.class = class;
        self
    }

    /// The purpose of the verdicts and how often they are wrong, in one line.
    pub fn decision_rule(&self) -> String {
        let wrong_pass = 100.0 * upper_tail_of_normal(self.coverage_factor());
        let wrong_fail = 100.0 * self.family_wise_error();
        format!(
            "A wrong value passes in at most {wrong_pass:.1} % of comparisons; a correct engine fails in at most \
             {wrong_fail:.1} % of procedures (tolerance class {}; docs/verdicts.md)",
            self.class
        )
    }

    /// Why a reading beyond its tolerance is not judged, by the first entry about it; `None` where it is.
    pub(super) fn not_claimed(&self, procedure: ProcedureId, basis: Basis, engine: &str) -> Option<&str> {
        let mut entries = self.not_claimed.iter();
        let is_about =
            |n: &&NotClaimed| n.procedure.is_none_or(|p| p == procedure) && n.basis == basis && n.engine == *engine;
        let entry = entries.find(is_about)?;
        Some(&entry.why)
    }

    /// Standard deviations of a normal distribution in the interval of a verdict.
    pub fn coverage_factor(&self) -> f64 {
        self.coverage_factor.value
    }

    /// The allowed probability of any false failure among all comparisons of an engine in a procedure.
    pub fn family_wise_error(&self) -> f64 {
        self.family_wise_error.value
    }

    /// The tolerance of a comparison: the spec's override, else the most specific rule, else zero.
    ///
    /// It comes with its origin where that is a project or a class other than the default.
    pub fn of(
        &self,
        procedure: ProcedureId,
        basis: Basis,
        engine: &str,
        quantity: Quantity,
        overrides: &BTreeMap<ProcedureId, ToleranceOverride>,
    ) -> (Tolerance, Option<String>) {
        match overrides.get(&procedure) {
            Some(o) => (tolerance_of_override(o, quantity), None),
            None => self.without_overrides(procedure, basis, engine, quantity),
        }
    }

    /// The same for a spec that is not trusted: its override narrows the tolerance, and widens nothing.
    pub(super) fn narrowed_for(
        &self,
        procedure: ProcedureId,
        basis: Basis,
        engine: &str,
        quantity: Quantity,
        overrides: &BTreeMap<ProcedureId, ToleranceOverride>,
    ) -> (Tolerance, Option<String>) {
        let (allowed, source) = self.without_overrides(procedure, basis, engine, quantity);
        let Some(o) = overrides.get(&procedure) else { return (allowed, source) };
        let narrowed = allowed.narrowed(tolerance_of_override(o, quantity));
        (narrowed, source.filter(|_| narrowed == allowed))
    }

    /// Whether a spec's override would widen what any rule allows in a procedure.
    pub(super) fn is_widened_by(&self, procedure: ProcedureId, o: &ToleranceOverride) -> bool {
        let parts = |relative, lx, cd, cd_m2, ugr| [relative, lx, cd, cd_m2, ugr];
        let asked = parts(o.relative, o.absolute_lx, o.absolute_cd, o.absolute_cd_m2, o.absolute_ugr);
        let widens = |rule: &Rule| {
            let factor = self.class_of(rule).map_or(1.0, |class| class.factor);
            let relative = rule.relative * factor;
            let allowed = parts(relative, rule.absolute_lx, rule.absolute_cd, rule.absolute_cd_m2, rule.absolute_ugr);
            asked.iter().zip(allowed).any(|(asked, allowed)| *asked > allowed)
        };
        let rules: Vec<&Rule> =
            self.rules.iter().chain(&self.narrowing).filter(|rule| rule.procedure == procedure).collect();
        rules.iter().any(|rule| widens(rule)) || (rules.is_empty() && asked.iter().any(|part| *part > 0.0))
    }

    fn without_overrides(
        &self,
        procedure: ProcedureId,
        basis: Basis,
        engine: &str,
        quantity: Quantity,
    ) -> (Tolerance, Option<String>) {
        let (allowed, source) = match most_specific(&self.rules, procedure, basis, engine) {
            Some(rule) => self.of_rule(rule, quantity),
            None => Default::default(),
        };
        let Some(rule) = most_specific(&self.narrowing, procedure, basis, engine) else { return (allowed, source) };
        let (narrower, its_source) = self.of_rule(rule, quantity);
        let narrowed = allowed.narrowed(narrower);
        (narrowed, if narrowed == allowed { source } else { its_source })
    }

    fn of_rule(&self, rule: &Rule, quantity: Quantity) -> (Tolerance, Option<String>) {
        let class = self.class_of(rule);
        let relative = rule.relative * class.map_or(1.0, |c| c.factor);
        let tolerance = Tolerance { relative, absolute: rule.absolute(quantity) };
        let of_class = class.filter(|_| self.class != ToleranceClass::default());
        let of_class = of_class.map(|c| format!("class {}, {}", self.class, c.purpose));
        (tolerance, rule.file.as_ref().map(|file| format!("{file}: {}", rule.source)).or(of_class))
    }

    /// The class that widens a rule; those of projects are as they are.
    fn class_of(&self, rule: &Rule) -> Option<&Class> {
        self.classes.get(&self.class).filter(|_| rule.file.is_none())
    }
}

/// The rule that names most of what applies.
fn most_specific<'a>(rules: &'a [Rule], procedure: ProcedureId, basis: Basis, engine: &str) -> Option<&'a Rule> {
    rules.iter().filter(|rule| rule.applies(procedure, basis, engine)).max_by_key(|rule| rule.specificity())
}

/// What an override allows of a quantity.
const fn tolerance_of_override(o: &ToleranceOverride, quantity: Quantity) -> Tolerance {
    let absolute = match quantity {
        Quantity::Illuminance => o.absolute_lx,
        Quantity::LuminousIntensity => o.absolute_cd,
        Quantity::Luminance => o.absolute_cd_m2,
        Quantity::GlareRating => o.absolute_ugr,
    };
    Tolerance { relative: o.relative, absolute }
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
        assert_eq!(table.of(INDIRECT, Basis::Simulator, "iesna", UNIT, &none).0.relative, 0.10);
        assert_eq!(table.of(INDIRECT, Basis::Simulator, "radiance", UNIT, &none).0.relative, 0.02);
        assert_eq!(table.of(INDIRECT, Basis::Published, "iesna", UNIT, &none).0.absolute, 0.03);
        let strict = ToleranceOverride { relative: 1e-4, absolute_lx: 1e-3, ..ToleranceOverride::default() };
        let found = table.of(DIRECT, Basis::ClosedForm, "povray", UNIT, &BTreeMap::from([(DIRECT, strict)]));
        assert_eq!(found, (Tolerance { relative: 1e-4, absolute: 1e-3 }, None));
        let design = table.clone().of_class(ToleranceClass::Design);
        let (found, origin) = design.of(INDIRECT, Basis::Simulator, "radiance", UNIT, &none);
        assert_eq!((found, origin.is_some()), (Tolerance { relative: 0.1, absolute: 1e-3 }, true));
        assert_eq!(
            design.of(DIRECT, Basis::ClosedForm, "povray", UNIT, &BTreeMap::from([(DIRECT, strict)])).0.relative,
            1e-4
        );
        let rule = design.decision_rule();
        assert!(
            rule.contains("class design") && rule.contains("in at most 2.3 % of") && rule.contains("at most 0.1 % of"),
            "{rule}"
        );
        let bare = Tolerances { rules: vec![], ..table };
        assert_eq!(bare.of(DIRECT, Basis::Simulator, "radiance", UNIT, &none), Default::default());
    }
    #[test]
    fn what_is_not_trusted_narrows_tolerances_and_widens_none() {
        let (table, none) = (Tolerances::built_in().unwrap(), BTreeMap::new());
        let allowed = |table: &Tolerances, of: &BTreeMap<_, _>| {
            table.narrowed_for(INDIRECT, Basis::Simulator, "radiance", UNIT, of).0
        };
        let usual = allowed(&table, &none);
        let of_spec = |relative| BTreeMap::from([(INDIRECT, ToleranceOverride { relative, ..Default::default() })]);
        assert_eq!(allowed(&table, &of_spec(1000.0)).relative, usual.relative);
        assert_eq!(allowed(&table, &of_spec(1e-4)), Tolerance { relative: 1e-4, absolute: 0.0 });
        let rule = |relative| Rule {
            procedure: INDIRECT,
            basis: None,
            engine: Some("radiance".into()),
            relative,
            absolute_lx: usual.absolute,
            absolute_cd: 0.0,
            absolute_cd_m2: 0.0,
            absolute_ugr: 0.0,
            source: "decided".to_owned(),
            file: None,
        };
        let [wide, narrow] = [1000.0, 1e-4].map(|relative| table.clone().narrowed_by(&[rule(relative)], "stranger"));
        assert_eq!((allowed(&wide, &none), allowed(&narrow, &none).relative), (usual, 1e-4));
        assert!(table.is_widened_by(INDIRECT, &of_spec(1000.0)[&INDIRECT]));
        assert!(!table.is_widened_by(INDIRECT, &of_spec(1e-6)[&INDIRECT]));
    }

    /// A rule for indirect illuminance with another number for each quantity.
    fn rule(basis: Option<Basis>, engine: Option<&str>, relative: f64) -> Rule {
        Rule {
            procedure: INDIRECT,
            basis,
            engine: engine.map(EngineName::from),
            relative,
            absolute_lx: 1.0,
            absolute_cd: 2.0,
            absolute_cd_m2: 3.0,
            absolute_ugr: 4.0,
            source: "decided".to_owned(),
            file: None,
        }
    }

    /// Our table with only these rules.
    fn table_of(rules: Vec<Rule>) -> Tolerances {
        Tolerances { rules, ..Tolerances::built_in().unwrap() }
    }

    const QUANTITIES: [(Quantity, f64); 4] = [
        (Quantity::Illuminance, 1.0),
        (Quantity::LuminousIntensity, 2.0),
        (Quantity::Luminance, 3.0),
        (Quantity::GlareRating, 4.0),
    ];

    #[test]
    fn each_quantity_has_its_own_absolute_tolerance() {
        let (table, none) = (table_of(vec![rule(None, None, 0.02)]), BTreeMap::new());
        let of_spec = ToleranceOverride {
            relative: 0.01,
            absolute_lx: 0.5,
            absolute_cd: 1.0,
            absolute_cd_m2: 1.5,
            absolute_ugr: 2.0,
        };
        let overrides = BTreeMap::from([(INDIRECT, of_spec)]);
        for (quantity, absolute) in QUANTITIES {
            let of_rule = table.of(INDIRECT, Basis::Simulator, "radiance", quantity, &none).0;
            assert_eq!(of_rule, Tolerance { relative: 0.02, absolute }, "{quantity:?}");
            let of_spec = table.of(INDIRECT, Basis::Simulator, "radiance", quantity, &overrides).0;
            assert_eq!(of_spec, Tolerance { relative: 0.01, absolute: 0.5 * absolute }, "{quantity:?}");
            let narrowed = table.narrowed_for(INDIRECT, Basis::Simulator, "radiance", quantity, &overrides).0;
            assert_eq!(narrowed, of_spec, "{quantity:?}");
        }
    }

    #[test]
    fn any_number_of_a_spec_above_that_of_every_rule_widens_a_tolerance() {
        let table = table_of(vec![rule(None, None, 0.02)]);
        let equal = ToleranceOverride {
            relative: 0.02,
            absolute_lx: 1.0,
            absolute_cd: 2.0,
            absolute_cd_m2: 3.0,
            absolute_ugr: 4.0,
        };
        assert!(!table.is_widened_by(INDIRECT, &equal));
        for wider in [
            ToleranceOverride { relative: 0.021, ..equal },
            ToleranceOverride { absolute_lx: 1.1, ..equal },
            ToleranceOverride { absolute_cd: 2.1, ..equal },
            ToleranceOverride { absolute_cd_m2: 3.1, ..equal },
            ToleranceOverride { absolute_ugr: 4.1, ..equal },
        ] {
            assert!(table.is_widened_by(INDIRECT, &wider), "{wider:?}");
        }
        // Where no rule allows anything, any number widens.
        assert!(table.is_widened_by(DIRECT, &ToleranceOverride { absolute_cd: 1e-9, ..Default::default() }));
        assert!(!table.is_widened_by(DIRECT, &ToleranceOverride::default()));
    }

    #[test]
    fn of_two_rules_that_apply_an_engine_precedes_a_basis() {
        let [plain, of_basis, of_engine, of_both] = [
            rule(None, None, 0.01),
            rule(Some(Basis::Simulator), None, 0.02),
            rule(None, Some("radiance"), 0.03),
            rule(Some(Basis::Simulator), Some("radiance"), 0.04),
        ];
        let none = BTreeMap::new();
        for (rules, relative) in [
            (vec![&plain, &of_basis], 0.02),
            (vec![&plain, &of_engine], 0.03),
            (vec![&of_basis, &of_engine], 0.03),
            (vec![&of_engine, &of_both], 0.04),
            (vec![&of_basis, &of_both], 0.04),
        ] {
            for rules in [rules.clone(), rules.into_iter().rev().collect()] {
                let table = table_of(rules.into_iter().cloned().collect());
                let found = table.of(INDIRECT, Basis::Simulator, "radiance", UNIT, &none).0;
                assert_eq!(found.relative, relative);
                // What is about another basis or another engine does not apply.
                let other = table.of(INDIRECT, Basis::Published, "mitsuba", UNIT, &none).0.relative;
                assert!(other == 0.0 || other == 0.01, "{other}");
            }
        }
        // Of two that name as much, the project's applies, which no class widens.
        let table = table_of(vec![plain.clone()]).with(&[rule(None, None, 0.005)], "luxproof.yaml");
        let (found, source) =
            table.of_class(ToleranceClass::Design).of(INDIRECT, Basis::Simulator, "radiance", UNIT, &none);
        assert_eq!((found.relative, source.as_deref()), (0.005, Some("luxproof.yaml: decided")));
    }

    #[test]
    fn a_rule_has_numbers_from_zero_and_a_source() {
        let source = Source::new("luxproof.yaml".into(), "tolerances: []".to_owned());
        let count = |rule: Rule| faults(&source, &[rule]).len();
        let sound = || rule(None, None, 0.0);
        assert_eq!(count(sound()), 0);
        for (wrong, faults) in [
            (Rule { relative: -0.01, ..sound() }, 1),
            (Rule { absolute_lx: f64::NAN, ..sound() }, 1),
            (Rule { absolute_cd: f64::INFINITY, ..sound() }, 1),
            (Rule { absolute_cd_m2: -1.0, ..sound() }, 1),
            (Rule { absolute_ugr: -1.0, ..sound() }, 1),
            (Rule { source: " ".to_owned(), ..sound() }, 1),
            (Rule { relative: -0.01, source: String::new(), ..sound() }, 2),
        ] {
            assert_eq!(count(wrong.clone()), faults, "{wrong:?}");
        }
    }

    #[test]
    fn a_class_is_complete_with_a_positive_factor_its_purpose_and_its_source() {
        let class = |factor, purpose: &str, source: &str| {
            Class { factor, purpose: purpose.to_owned(), source: source.to_owned() }.is_complete()
        };
        assert!(class(0.1, "design", "a standard"));
        for (factor, purpose, source) in [
            (0.0, "design", "a standard"),
            (-1.0, "design", "a standard"),
            (f64::INFINITY, "design", "a standard"),
            (0.1, "", "a standard"),
            (0.1, "design", ""),
        ] {
            assert!(!class(factor, purpose, source), "{factor} {purpose} {source}");
        }
        let entry = |why: &str, source: &str| NotClaimed { why: why.to_owned(), source: source.to_owned(), ..entry() };
        assert!(entry("a hand method", "a book").is_complete());
        assert!(!entry(" ", "a book").is_complete() && !entry("a hand method", "").is_complete());
    }

    /// An entry about what `mine` does not claim.
    fn entry() -> NotClaimed {
        NotClaimed {
            engine: "mine".into(),
            procedure: None,
            basis: Basis::Simulator,
            why: "of all".to_owned(),
            source: "us".to_owned(),
        }
    }

    #[test]
    fn the_first_entry_about_a_procedure_a_basis_and_an_engine_says_what_is_not_claimed() {
        let of_indirect = NotClaimed { procedure: Some(INDIRECT), why: "of this".to_owned(), ..entry() };
        let not_claimed = vec![of_indirect, entry()];
        let table = Tolerances { not_claimed, ..Tolerances::built_in().unwrap() };
        assert_eq!(table.not_claimed(INDIRECT, Basis::Simulator, "mine"), Some("of this"));
        assert_eq!(table.not_claimed(DIRECT, Basis::Simulator, "mine"), Some("of all"));
        assert_eq!(table.not_claimed(INDIRECT, Basis::Published, "mine"), None);
        assert_eq!(table.not_claimed(INDIRECT, Basis::Simulator, "radiance"), None);
    }

    #[test]
    fn a_rule_applies_where_all_that_it_names_does() {
        let of_both = rule(Some(Basis::Simulator), Some("radiance"), 0.02);
        assert!(of_both.applies(INDIRECT, Basis::Simulator, "radiance"));
        assert!(!of_both.applies(DIRECT, Basis::Simulator, "radiance"));
        assert!(!of_both.applies(INDIRECT, Basis::Published, "radiance"));
        assert!(!of_both.applies(INDIRECT, Basis::Simulator, "mitsuba"));
        assert!(rule(None, None, 0.02).applies(INDIRECT, Basis::Published, "mitsuba"));
        let specificities = [(None, None), (Some(Basis::Simulator), None), (None, Some("a"))]
            .map(|(basis, engine)| rule(basis, engine, 0.0).specificity());
        assert_eq!((specificities, of_both.specificity()), ([0, 1, 2], 3));
    }

    #[test]
    fn a_class_widens_what_our_rules_allow_relative_to_a_reference() {
        // The class `design` is five times as wide as ours, `reference` a tenth.
        let table = table_of(vec![rule(None, None, 0.02)]);
        let none = BTreeMap::new();
        for (class, relative, source) in [
            (ToleranceClass::Verification, 0.02, None),
            (ToleranceClass::Design, 0.1, Some("class design, lighting design")),
            (ToleranceClass::Reference, 0.002, Some("class reference, values that others are held to")),
        ] {
            let table = table.clone().of_class(class);
            let (found, origin) = table.of(INDIRECT, Basis::Simulator, "radiance", UNIT, &none);
            assert!((found.relative - relative).abs() < 1e-15 && found.absolute == 1.0, "{class} {found:?}");
            assert_eq!(origin.is_some(), source.is_some(), "{class}");
            assert!(source.is_none_or(|source| origin.unwrap().starts_with(source)), "{class}");
            // A spec widens where it is above the class.
            for (asked, widens) in [(0.999 * relative, false), (1.001 * relative, true)] {
                let asked = ToleranceOverride { relative: asked, ..Default::default() };
                assert_eq!(table.is_widened_by(INDIRECT, &asked), widens, "{class} {asked:?}");
            }
        }
    }

    #[test]
    fn a_tolerance_has_the_source_of_the_rule_that_decides_it() {
        let none = BTreeMap::new();
        let project = table_of(vec![]).with(&[rule(None, None, 0.02)], "ours.yaml");
        for (relative, found, source) in [
            (0.01, 0.01, "theirs.yaml: decided"),
            (0.02, 0.02, "ours.yaml: decided"),
            (0.03, 0.02, "ours.yaml: decided"),
        ] {
            let table = project.clone().narrowed_by(&[rule(None, None, relative)], "theirs.yaml");
            let (tolerance, origin) = table.of(INDIRECT, Basis::Simulator, "radiance", UNIT, &none);
            assert_eq!((tolerance.relative, origin.as_deref()), (found, Some(source)), "{relative}");
        }
        // A spec that narrows takes the place of the source.
        for (relative, source) in [(0.01, None), (0.02, Some("ours.yaml: decided")), (0.03, Some("ours.yaml: decided"))]
        {
            let of_spec = ToleranceOverride { relative, absolute_lx: 9.0, ..Default::default() };
            let overrides = BTreeMap::from([(INDIRECT, of_spec)]);
            let (_, origin) = project.narrowed_for(INDIRECT, Basis::Simulator, "radiance", UNIT, &overrides);
            assert_eq!(origin.as_deref(), source, "{relative}");
        }
    }
}
