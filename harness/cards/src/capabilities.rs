//! Capabilities: what a renderer is asked for, and which cases show it. They are data: `reference/capabilities.yaml`.

use std::collections::{BTreeSet, HashMap};
use std::fmt;
use std::path::{Path, PathBuf};

use luxproof_model::{EngineName, ProcedureId};
use luxproof_spec::{Source, SpecError, Trust};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

const BUILT_IN: &str = include_str!("../data/capabilities.yaml");
/// The file of the built-in capabilities in the repository.
pub const EXAMPLE_FILE: &str = "reference/capabilities.yaml";
/// The most capabilities of a file that is not trusted: each has pages for every renderer.
const MAX_FOREIGN_CAPABILITIES: usize = 100;
/// The longest id.
const MAX_ID: usize = 60;

/// The capabilities of score cards, in the order of rows.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Capabilities {
    /// Version of the format: 1.
    pub version: u32,
    pub capabilities: Vec<Capability>,
}

/// What a renderer is asked for, and the cases that show it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Capability {
    pub id: CapabilityId,
    /// The heading that it stands below.
    pub group: String,
    /// Its name in the matrix.
    pub title: String,
    /// The question that its cell answers.
    pub question: String,
    /// Whether only engines count that parse the photometric file themselves.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub reads_files: bool,
    /// Engines that get from luxproof what the capability asks for: their right values show nothing, and their faults count.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub not_shown_by: Vec<NotShown>,
    /// All count: the worst decides.
    pub cases: Vec<CaseSelector>,
    /// With fewer public cases that have values, a cell says `not tested`, unless one of them is wrong.
    pub minimum_cases: usize,
}

/// An engine, and why its right values do not show a capability.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct NotShown {
    /// Without a release.
    pub engine: String,
    pub why: String,
}

/// Procedures of a case.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct CaseSelector {
    /// The name of the case, as `5.8-interreflection/rho-90`; `calibration` for the scenes of known answer.
    pub case: String,
    pub procedures: Vec<ProcedureId>,
}

/// The id of a capability: the name of its page. Lower-case letters, digits and single hyphens.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, JsonSchema)]
#[serde(try_from = "String", into = "String")]
#[schemars(with = "String")]
pub struct CapabilityId(String);

impl TryFrom<String> for CapabilityId {
    type Error = String;

    fn try_from(text: String) -> Result<Self, String> {
        let is_part =
            |part: &str| !part.is_empty() && part.bytes().all(|b| b.is_ascii_lowercase() || b.is_ascii_digit());
        if text.len() <= MAX_ID && text.split('-').all(is_part) {
            Ok(Self(text))
        } else {
            Err(format!("`{text}` is no id: give lower-case letters and digits with single hyphens, {MAX_ID} at most"))
        }
    }
}

impl From<CapabilityId> for String {
    fn from(id: CapabilityId) -> Self {
        id.0
    }
}

impl CapabilityId {
    pub fn as_str(&self) -> &str {
        &self.0
    }
}

impl fmt::Display for CapabilityId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl CaseSelector {
    /// Whether it selects a procedure of a case.
    pub fn selects(&self, case: &str, procedure: ProcedureId) -> bool {
        self.case == case && self.procedures.contains(&procedure)
    }
}

impl Capability {
    /// Whether a procedure of a case shows it.
    pub fn is_shown_by(&self, case: &str, procedure: ProcedureId) -> bool {
        self.cases.iter().any(|selector| selector.selects(case, procedure))
    }

    /// Why right values of an engine do not show it; `None` if they do.
    pub fn why_not_shown_by(&self, engine: &EngineName) -> Option<&str> {
        self.not_shown_by.iter().find(|not| not.engine == engine.family()).map(|not| not.why.as_str())
    }

    /// The number of cases, each once.
    pub fn case_count(&self) -> usize {
        self.cases.iter().map(|selector| &selector.case).collect::<BTreeSet<_>>().len()
    }
}

impl Capabilities {
    /// Those of `reference/capabilities.yaml`.
    pub fn built_in() -> Result<Self, SpecError> {
        Self::parse(&Source::new(PathBuf::from(EXAMPLE_FILE), BUILT_IN.to_owned()))
    }

    /// Reads a file.
    pub fn read(path: &Path, trust: Trust) -> Result<Self, SpecError> {
        Self::parse(&Source::read(path, trust)?)
    }

    /// The capabilities that each procedure of a case shows, each once.
    pub(crate) fn by_procedure(&self) -> HashMap<(&str, ProcedureId), Vec<&Capability>> {
        let mut shown: HashMap<(&str, ProcedureId), Vec<&Capability>> = HashMap::new();
        for capability in &self.capabilities {
            for selector in &capability.cases {
                for procedure in &selector.procedures {
                    let all = shown.entry((&selector.case, *procedure)).or_default();
                    // Those of one capability come one after the other.
                    if all.last().is_none_or(|last| last.id != capability.id) {
                        all.push(capability);
                    }
                }
            }
        }
        shown
    }

    fn parse(source: &Source) -> Result<Self, SpecError> {
        let read: Self = source.parse()?;
        let help = "this luxproof reads version 1";
        source.require(read.version == 1, "version", format!("version {} is not known", read.version), help)?;
        source.require(!read.capabilities.is_empty(), "capabilities", "there are none", "give at least one")?;
        let is_few = source.trust == Trust::Own || read.capabilities.len() <= MAX_FOREIGN_CAPABILITIES;
        let message = format!("{} capabilities, and the file is not trusted", read.capabilities.len());
        let help = format!("give at most {MAX_FOREIGN_CAPABILITIES}, or leave out --untrusted if the file is yours");
        source.require(is_few, "capabilities", message, help)?;
        let mut ids = BTreeSet::new();
        for (k, capability) in read.capabilities.iter().enumerate() {
            let place = format!("capabilities[{k}]");
            let is_new = ids.insert(&capability.id);
            let message = format!("two capabilities are named `{}`", capability.id);
            source.require(is_new, &format!("{place}.id"), message, "give each a different id")?;
            capability.check(source, &place)?;
        }
        Ok(read)
    }
}

impl Capability {
    fn check(&self, source: &Source, place: &str) -> Result<(), SpecError> {
        let texts = [&self.group, &self.title, &self.question];
        let has_texts = texts.iter().all(|text| !text.trim().is_empty());
        source.require(has_texts, place, "a text is empty", "give group, title and question")?;
        let is_possible = (1..=self.case_count()).contains(&self.minimum_cases);
        let message = format!("{} of {} cases are needed", self.minimum_cases, self.case_count());
        source.require(is_possible, &format!("{place}.minimum_cases"), message, "give 1 to the number of cases")?;
        let procedures: Vec<ProcedureId> = self.cases.iter().flat_map(|selector| selector.procedures.clone()).collect();
        let at = format!("{place}.cases");
        source.require(!procedures.is_empty(), &at, "no procedure is selected", "name at least one procedure")?;
        // A relative deviation and one of a rating have no common worst case.
        let has_zero = procedures[0].quantity().has_zero();
        let is_one_measure = procedures.iter().all(|procedure| procedure.quantity().has_zero() == has_zero);
        source.require(
            is_one_measure,
            &at,
            "glare ratings and other quantities have no common worst case",
            "make two capabilities of it",
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(text: &str) -> Result<Capabilities, SpecError> {
        Capabilities::parse(&Source::new("c.yaml".into(), text.to_owned()))
    }

    const ONE: &str = "version: 1
capabilities:
  - id: direct
    group: light
    title: direct light
    question: is it right?
    cases: [{case: a, procedures: [direct_illuminance]}, {case: b, procedures: [direct_illuminance, point]}]
    minimum_cases: 2
";

    #[test]
    fn the_built_in_capabilities_are_sound_and_name_cases_of_the_repository() {
        let built_in = Capabilities::built_in().unwrap();
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../reference");
        let specs = ["analytic", "cie171", "readers", "specs"].map(|folder| root.join(folder));
        let cases = luxproof_spec::suite(&specs, Trust::Own).unwrap();
        for selector in built_in.capabilities.iter().flat_map(|c| &c.cases).filter(|s| s.case != "calibration") {
            let case = cases.iter().find(|case| case.name == selector.case);
            let case = case.unwrap_or_else(|| panic!("no case {}", selector.case));
            for procedure in &selector.procedures {
                assert!(case.task(*procedure).is_some(), "{} measures no {procedure}", selector.case);
            }
        }
    }

    #[test]
    fn a_selector_names_whole_cases_and_their_procedures() {
        let all = parse(ONE).unwrap();
        let one = &all.capabilities[0];
        assert_eq!(one.case_count(), 2);
        assert!(one.is_shown_by("b", ProcedureId::Point) && !one.is_shown_by("a", ProcedureId::Point));
        assert!(!one.is_shown_by("b/c", ProcedureId::Point));
    }

    #[test]
    fn what_no_rule_could_apply_is_refused_with_its_place() {
        for (from, to, message) in [
            ("version: 1", "version: 2", "version 2 is not known"),
            ("minimum_cases: 2", "minimum_cases: 3", "3 of 2 cases are needed"),
            ("minimum_cases: 2", "minimum_cases: 0", "0 of 2 cases are needed"),
            ("id: direct", "id: ../up", "is no id"),
            ("direct_illuminance, point", "unified_glare_rating", "no common worst case"),
            ("title: direct light", "title: ''", "a text is empty"),
            ("direct_illuminance, point", "lux", "unknown variant"),
        ] {
            let error = parse(&ONE.replace(from, to)).unwrap_err().to_string();
            assert!(error.contains(message), "{error}");
        }
        let twice = ONE.to_owned() + ONE.split_once("capabilities:\n").unwrap().1;
        assert!(parse(&twice).unwrap_err().to_string().contains("two capabilities are named `direct`"));
    }
}
