//! What readings are held to: our tolerances and known deviations, and a project's besides, in a file beside its specs.
//!
//! A policy decides verdicts and what a run must hold; no key of a kept reading knows of it.

use luxproof_model::PolicyRecord;
use luxproof_model::Sampling;
use luxproof_process::files::clean;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use clap::Args;
use itertools::Itertools;
use schemars::JsonSchema;
use serde::Deserialize;
use sha2::{Digest, Sha256};

use super::tolerance::Rule;
use super::{Judge, KnownDeviations, Published, Tolerances, known, tolerance};
use luxproof_model::EngineName;
use luxproof_model::KnownDeviation;
use luxproof_model::ToleranceClass;
use luxproof_process::digest::hexadecimal;
use luxproof_spec::{BUNDLE_FILE, Budget, Case, Faults, Source, SpecError, Trust, misspelt, suggestion};

/// The name of a project's policy, beside a spec or in a folder above it.
pub const POLICY_FILE: &str = "luxproof.yaml";

/// What a project holds its specs to, besides what luxproof does.
#[derive(Clone, Debug, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ProjectPolicy {
    /// Engines without whose readings a run is no audit: exit 3.
    pub required_engines: Vec<EngineName>,
    /// What verdicts are for: the class of our tolerances.
    pub tolerance_class: Option<ToleranceClass>,
    /// Tolerances that go before ours; the rule that names most applies.
    pub tolerances: Vec<Rule>,
    /// Where engines are known to differ, by how much and why.
    pub known_deviations: Vec<KnownDeviation>,
    /// How runs differ by occasion; one is chosen by `--profile`.
    pub profiles: BTreeMap<String, Profile>,
}

impl ProjectPolicy {
    /// Names of engines that are hardly any but those of ours, with a slip of the pen; others are programs of other specs.
    fn misspelt(&self, source: &Source, declared: &BTreeSet<&str>) -> Vec<SpecError> {
        let of_rule = |(k, rule): (usize, &Rule)| Some((format!("tolerances[{k}].engine"), rule.engine()?.clone()));
        let of_entry =
            |(k, entry): (usize, &KnownDeviation)| (format!("known_deviations[{k}].engine"), entry.engine.clone());
        let required = self.required_engines.iter().enumerate();
        let named = required
            .map(|(k, engine)| (format!("required_engines[{k}]"), engine.clone()))
            .chain(self.tolerances.iter().enumerate().filter_map(of_rule))
            .chain(self.known_deviations.iter().enumerate().map(of_entry));
        let ours: Vec<EngineName> = luxproof_engines::all().iter().map(|e| e.name()).collect();
        let fault = |(at, name): (String, EngineName)| {
            let plain = name.split('@').next().unwrap_or_default();
            let is_known = declared.contains(plain) || ours.iter().any(|known| *known == *plain);
            let meant = misspelt(plain, ours.iter().map(EngineName::as_str)).filter(|_| !is_known)?;
            Some(source.error_at(&at, format!("there is no engine `{name}`"), format!("did you mean `{meant}`?")))
        };
        named.filter_map(fault).collect()
    }
}

/// How runs of one occasion differ from what specs say.
#[derive(Clone, Copy, Debug, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Profile {
    /// In place of the specs' own.
    pub budget: ProfileBudget,
    /// When sampling stops.
    pub sampling: Option<Sampling>,
    /// What verdicts are for, in place of the policy's own.
    pub tolerance_class: Option<ToleranceClass>,
}

/// When an engine may stop; what is left out stays as a spec says.
#[derive(Clone, Copy, Debug, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ProfileBudget {
    /// Standard error relative to the reading.
    pub relative_error: Option<f64>,
    /// Seconds an engine and procedure, as the engine counts them.
    pub seconds: Option<f64>,
}

impl ProfileBudget {
    /// The budget of a spec under this profile.
    pub fn over(self, spec: Budget) -> Budget {
        Budget {
            relative_error: self.relative_error.unwrap_or(spec.relative_error),
            seconds: self.seconds.unwrap_or(spec.seconds),
        }
    }
}

/// Which project policy judges specs.
#[derive(Clone, Debug, Default, Args)]
pub struct PolicyChoice {
    /// The project's policy [default: the nearest luxproof.yaml]
    ///
    /// luxproof searches the folder of each spec and the folders above it.
    #[arg(long = "policy", hide_short_help = true, value_name = "FILE")]
    pub file: Option<PathBuf>,
    /// A profile of the policy
    #[arg(long, value_name = "NAME", hide_short_help = true)]
    pub profile: Option<String>,
    /// Purpose of the verdicts, which sets the tolerances [default: verification]
    #[arg(long, hide_short_help = true, value_name = "CLASS")]
    pub tolerance_class: Option<ToleranceClass>,
    /// Where a policy is searched that is not named.
    #[arg(skip)]
    pub search: PolicySearch,
}

/// Where policies are searched that are not named.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum PolicySearch {
    /// In the folder of each spec and the folders above it.
    #[default]
    AroundSpecs,
    /// Nowhere: luxproof's own tolerances judge specs that it wrote itself, wherever they lie.
    Nowhere,
}

impl PolicySearch {
    /// The policy that is found for a case.
    fn find(self, case: &Case) -> Option<PathBuf> {
        match self {
            Self::AroundSpecs => nearest(case),
            Self::Nowhere => None,
        }
    }
}

impl PolicyChoice {
    /// The policy of each case; cases of one file share one.
    pub fn of_cases(&self, cases: &[Case]) -> Result<Vec<Arc<Policy>>, Faults> {
        let mut read: BTreeMap<Option<PathBuf>, Arc<Policy>> = BTreeMap::new();
        let (mut policies, mut faults) = (vec![], vec![]);
        let mut refused: BTreeSet<Option<PathBuf>> = BTreeSet::new();
        let declared: BTreeSet<&str> =
            cases.iter().flat_map(|c| c.engines.iter().flat_map(|e| e.keys().map(String::as_str))).collect();
        for case in cases {
            let file = self.file.clone().or_else(|| self.search.find(case));
            if let Some(policy) = read.get(&file) {
                policies.push(Arc::clone(policy));
                continue;
            }
            // A file that the user named is the user's own.
            let trust = if self.file.is_some() { Trust::Own } else { case.source.trust };
            match self.read(file.as_deref(), trust, &declared) {
                Ok(policy) => {
                    let policy = Arc::new(policy);
                    read.insert(file, Arc::clone(&policy));
                    policies.push(policy);
                }
                Err(of_file) if refused.insert(file) => faults.extend(of_file.all().iter().cloned()),
                Err(_) => {}
            }
        }
        Faults::of(faults).map_or(Ok(policies), Err)
    }

    /// Ours, with that of a file where there is one; `declared` are engines that specs bring with them.
    pub fn read(&self, file: Option<&Path>, trust: Trust, declared: &BTreeSet<&str>) -> Result<Policy, Faults> {
        let Some(file) = file else {
            let help = format!("write a {POLICY_FILE} beside the spec, or name one with --policy");
            if let Some(name) = &self.profile {
                return Err(SpecError::of("--profile", format!("no policy has a profile `{name}`"), help).into());
            }
            let policy = Policy::built_in()?;
            let class = self.tolerance_class.unwrap_or_default();
            return Ok(Policy { tolerances: policy.tolerances.of_class(class), ..policy });
        };
        let source = Source::read(file, trust)?;
        let project: ProjectPolicy = source.parse_whole()?;
        let mut faults = tolerance::faults(&source, &project.tolerances);
        faults.extend(known::faults(&source, &project.known_deviations));
        faults.extend(project.misspelt(&source, declared));
        if project.required_engines.len() > MAX_REQUIRED_ENGINES {
            let message = format!("requires more than {MAX_REQUIRED_ENGINES} engines");
            faults.push(source.error_at("required_engines", message, "name those that every run must have"));
        }
        for (name, ProfileBudget { relative_error, seconds }) in project.profiles.iter().map(|(n, p)| (n, p.budget)) {
            for (field, value) in [("relative_error", relative_error), ("seconds", seconds)] {
                let (at, sound) =
                    (format!("profiles.{name}.budget.{field}"), value.is_none_or(|v| v.is_finite() && v > 0.0));
                faults.extend(source.require(sound, &at, "this is no budget", "give a positive number").err());
            }
        }
        let profile = self.profile.as_ref().map(|name| {
            project.profiles.get(name).copied().ok_or_else(|| {
                let help = suggestion(name, project.profiles.keys().map(String::as_str));
                source.error_at("profiles", format!("there is no profile `{name}`"), help)
            })
        });
        faults.extend(profile.iter().filter_map(|p| p.as_ref().err()).cloned());
        if let Some(faults) = Faults::of(faults) {
            return Err(faults);
        }
        let profile = profile.and_then(Result::ok).unwrap_or_default();
        let here = std::env::current_dir().unwrap_or_default();
        let shown = file.strip_prefix(here).unwrap_or(file).display().to_string();
        let of_file = profile.tolerance_class.or(project.tolerance_class);
        let (tolerances, known) = (Tolerances::built_in()?, KnownDeviations::built_in()?);
        let (tolerances, known) = match trust {
            // Nobody vouches for it: it makes verdicts stricter, and excuses nothing.
            Trust::Stranger => {
                let narrower = of_file.unwrap_or_default().min(ToleranceClass::default());
                let class = self.tolerance_class.unwrap_or(narrower);
                (tolerances.of_class(class).narrowed_by(&project.tolerances, &shown), known)
            }
            Trust::Own | Trust::Bundled => {
                let class = self.tolerance_class.or(of_file).unwrap_or_default();
                (tolerances.of_class(class).with(&project.tolerances, &shown), known.with(&project.known_deviations))
            }
        };
        Ok(Policy {
            tolerances,
            known,
            profile,
            record: Some(PolicyRecord {
                file: shown,
                sha256: hexadecimal(&Sha256::digest(source.text.as_bytes())),
                profile: self.profile.clone(),
                required_engines: project.required_engines,
            }),
        })
    }
}

/// What cases that are not trusted say of verdicts and is not followed, each where it stands: policies in their own folders, and what would
/// widen a tolerance.
pub fn overruled(cases: &[Case], policies: &[Arc<Policy>], choice: &PolicyChoice) -> Vec<SpecError> {
    let mut found: Vec<SpecError> = vec![];
    let mut seen: BTreeSet<(PathBuf, String)> = BTreeSet::new();
    let mut tell = |fault: SpecError| {
        if found.len() < MAX_OVERRULED && seen.insert((fault.file.clone(), fault.message.clone())) {
            found.push(fault);
        }
    };
    for (case, policy) in cases.iter().zip(policies).filter(|(case, _)| case.source.trust == Trust::Stranger) {
        candidates(&case.path).filter(|(_, place)| *place == Place::Proposed).for_each(|(file, _)| {
            let message = "is ignored: it lies below the folder that is not trusted";
            tell(SpecError::of(as_from_here(file), message, VOUCH));
        });
        if let Some(record) = policy.record.as_ref().filter(|_| choice.file.is_none()) {
            let message = "only narrows tolerances: a policy that may also widen them or excuse deviations is named";
            tell(SpecError::of(&record.file, message, VOUCH));
        }
        for (procedure, wider) in &case.tolerances {
            if policy.tolerances.is_widened_by(*procedure, wider) {
                let message = "it counts only where it is narrower: the spec is not trusted";
                tell(case.source.error_at(&format!("tolerances.{procedure}"), message, VOUCH));
            }
        }
    }
    found
}

/// The most engines that a policy requires: reports name each one that is missing.
const MAX_REQUIRED_ENGINES: usize = 100;

const VOUCH: &str = "say what verdicts are held to in a policy of yours, and name it with --policy";

/// More are not reported: a stranger may have any number.
const MAX_OVERRULED: usize = 20;

/// Whose a policy is by its place.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Place {
    /// In the current folder or above it.
    Surrounding,
    /// Elsewhere, which is where the specs come from.
    Proposed,
}

/// The policies beside a spec and in the folders above it, the nearest first, up to the root of its bundle or of the file system.
fn candidates(spec: &Path) -> impl Iterator<Item = (PathBuf, Place)> {
    let here = std::env::current_dir().unwrap_or_default();
    let folders: Vec<PathBuf> = clean(spec).ancestors().skip(1).map(Path::to_owned).collect();
    let folders = folders.into_iter().take_while_inclusive(|folder| !folder.join(BUNDLE_FILE).is_file());
    let place = move |folder: PathBuf| {
        let place = if here.starts_with(&folder) { Place::Surrounding } else { Place::Proposed };
        (folder.join(POLICY_FILE), place)
    };
    folders.map(place).filter(|(file, _)| file.is_file())
}

/// The policy that is found for a case: the nearest, of a spec that is not trusted the nearest around the current folder.
fn nearest(case: &Case) -> Option<PathBuf> {
    let is_followed = |place| case.source.trust != Trust::Stranger || place == Place::Surrounding;
    let (found, _) = candidates(&case.path).find(|(_, place)| is_followed(*place))?;
    Some(as_from_here(found))
}

/// A path as a person would write it in the current folder.
fn as_from_here(path: PathBuf) -> PathBuf {
    let here = std::env::current_dir().unwrap_or_default();
    path.strip_prefix(here).map(Path::to_owned).unwrap_or(path)
}

/// What the readings of a case are held to.
#[derive(Clone, Debug)]
pub struct Policy {
    pub tolerances: Tolerances,
    pub known: KnownDeviations,
    pub profile: Profile,
    /// The project's part of it; `None` where there is none.
    pub record: Option<PolicyRecord>,
}

impl Policy {
    /// Ours alone.
    pub fn built_in() -> Result<Self, SpecError> {
        let (tolerances, known) = (Tolerances::built_in()?, KnownDeviations::built_in()?);
        Ok(Self { tolerances, known, profile: Profile::default(), record: None })
    }

    /// Who judges by it the readings of a case, which may loosen or tighten tolerances.
    pub fn judge<'a>(&'a self, case: &'a Case, published: Option<&'a Published>) -> Judge<'a> {
        Judge {
            tolerances: &self.tolerances,
            known: &self.known,
            overrides: &case.tolerances,
            trust: case.source.trust,
            published,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use luxproof_model::Basis;
    use luxproof_model::{ProcedureId, Quantity};

    const FILE: &str = "required_engines: [radiance, mitsuba]
tolerances: [{procedure: direct_illuminance, engine: povray, relative: 0.005, source: \"decided in May\"}]
known_deviations:
  - {engine: radiance, case: \"office/*\", procedure: direct_illuminance, meter: \"desk[3]\", expected: -0.012, uncertainty: 0.002,
     cause: \"a cache\", source: \"measured\", owner: lighting-team, issue: \"RAD-41\", expires: 2027-06-30}
profiles: {ci: {budget: {relative_error: 0.005}, sampling: decided}, audit: {}}
";

    /// A policy in a folder, below which a spec lies.
    fn read(text: &str, profile: Option<&str>) -> Result<Policy, Faults> {
        let folder = tempfile::tempdir().unwrap();
        std::fs::create_dir(folder.path().join("specs")).unwrap();
        std::fs::write(folder.path().join(POLICY_FILE), text).unwrap();
        let case = Case { path: folder.path().join("specs/office.yaml"), ..Case::default() };
        let choice = PolicyChoice { profile: profile.map(str::to_owned), ..PolicyChoice::default() };
        choice.of_cases(&[case]).map(|found| (*found[0]).clone())
    }

    #[test]
    fn a_policy_is_found_above_a_spec_and_goes_before_ours_where_it_names_as_much() {
        let policy = read(FILE, Some("ci")).unwrap();
        let record = policy.record.as_ref().unwrap();
        assert!(record.file.ends_with(POLICY_FILE) && record.required_engines.len() == 2, "{record:?}");
        assert_eq!(record.sha256, hexadecimal(&Sha256::digest(FILE)));
        let spec = Budget { relative_error: 0.002, seconds: 7.0 };
        assert_eq!(policy.profile.budget.over(spec), Budget { relative_error: 0.005, seconds: 7.0 });
        assert_eq!(policy.profile.sampling, Some(Sampling::Decided));
        let of = |engine| {
            let (procedure, none) = (ProcedureId::DirectIlluminance, BTreeMap::new());
            policy.tolerances.of(procedure, Basis::Published, engine, Quantity::Illuminance, &none)
        };
        let (tolerance, source) = of("povray");
        assert!(source.unwrap().ends_with("luxproof.yaml: decided in May"));
        assert_eq!((tolerance.relative, of("radiance").0.relative, of("radiance").1), (0.005, 0.01, None));
    }

    #[test]
    fn what_is_wrong_is_refused_at_its_place() {
        for (right, wrong, line, says) in [
            ("required_engines", "requierd_engines", 1, "did you mean `required_engines`?"),
            ("0.005, source", "-0.005, source", 2, "a tolerance is a number from 0"),
            ("\"decided in May\"", "\" \"", 2, "has no source"),
            ("direct_illuminance, engine", "direct, engine", 2, "unknown variant"),
            ("\"office/*\"", "[office]", 4, "a name"),
            ("\"desk[3]\"", "\"desk***\"", 4, "is no pattern"),
            ("uncertainty: 0.002", "uncertainty: 0.006", 4, "no uncertainty of a known deviation"),
            ("expected: -0.012", "expected: 0", 4, "this is no deviation"),
            ("2027-06-30", "2027-06-31", 5, "day"),
            ("relative_error: 0.005", "relative_error: 0", 6, "this is no budget"),
            ("sampling: decided", "sampling: quick", 6, "unknown variant"),
        ] {
            assert!(FILE.contains(right), "{right}");
            let error = read(&FILE.replacen(right, wrong, 1), None).unwrap_err().first();
            assert!(error.line == Some(line) && error.to_string().contains(says), "{wrong}: {error}");
        }
        let error = read(FILE, Some("audi")).unwrap_err();
        assert!(error.to_string().contains("did you mean `audit`?"), "{error}");
        assert!(read("profiles: {}\n", None).is_ok());
    }

    /// What the reader says of a policy, of specs that bring these engines with them.
    fn message(text: &str, declared: &[&str]) -> Option<String> {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join(POLICY_FILE);
        std::fs::write(&file, text).unwrap();
        let declared = declared.iter().copied().collect();
        let read = PolicyChoice::default().read(Some(&file), Trust::Own, &declared);
        read.err().map(|faults| faults.all().iter().join(" "))
    }

    #[test]
    fn an_engine_that_is_nearly_one_of_ours_and_not_a_specs_own_is_misspelt() {
        let says = |text: &str, declared: &[&str]| message(text, declared).is_some_and(|m| m.contains("did you mean"));
        assert!(says("required_engines: [radianse]", &[]) && says("required_engines: [radianse@5]", &[]));
        assert!(!says("required_engines: [radianse]", &["radianse"]) && !says("required_engines: [radiance]", &[]));
        assert!(!says("required_engines: [quite_another]", &[]));
        let rule = "tolerances: [{procedure: direct_illuminance, engine: radianse, relative: 0.01, source: us}]";
        assert!(says(rule, &[]));
    }

    #[test]
    fn a_policy_requires_a_hundred_engines_at_most() {
        let requiring = |count| format!("required_engines: [{}]", vec!["radiance"; count].join(", "));
        assert_eq!(message(&requiring(100), &[]), None);
        assert!(message(&requiring(101), &[]).is_some_and(|m| m.contains("more than 100 engines")));
    }

    #[test]
    fn a_budget_is_a_positive_number() {
        for (budget, is_one) in [
            ("relative_error: 0.01", true),
            ("seconds: 1", true),
            ("seconds: 0", false),
            ("seconds: -1", false),
            ("seconds: .inf", false),
            ("relative_error: .nan", false),
        ] {
            let found = message(&format!("profiles: {{ci: {{budget: {{{budget}}}}}}}"), &[]);
            assert_eq!(found.is_none(), is_one, "{budget}: {found:?}");
        }
    }

    #[test]
    fn without_a_policy_there_is_a_class_and_no_profile() {
        let design = Some(ToleranceClass::Design);
        let choice = PolicyChoice { tolerance_class: design, ..PolicyChoice::default() };
        let policy = choice.read(None, Trust::Own, &BTreeSet::new()).unwrap();
        assert!(policy.tolerances.decision_rule().contains("class design") && policy.record.is_none());
        let choice = PolicyChoice { profile: Some("ci".to_owned()), ..choice };
        assert!(choice.read(None, Trust::Own, &BTreeSet::new()).unwrap_err().to_string().contains("`ci`"));
    }

    /// A case below a folder, whose spec is trusted so far.
    fn case_in(folder: &Path, name: &str, trust: Trust) -> Case {
        let path = folder.join(name);
        let mut source = Source::new(path.clone(), String::new());
        source.trust = trust;
        Case { path, source, ..Case::default() }
    }

    #[test]
    fn the_nearest_policy_is_followed_up_to_the_root_of_a_bundle_unless_a_stranger_proposes_it() {
        let folder = tempfile::tempdir().unwrap();
        let inner = folder.path().join("inner");
        std::fs::create_dir(&inner).unwrap();
        std::fs::write(folder.path().join(POLICY_FILE), "").unwrap();
        let find = |trust| PolicySearch::AroundSpecs.find(&case_in(&inner, "a.yaml", trust));
        assert_eq!(find(Trust::Own), Some(folder.path().join(POLICY_FILE)));
        assert_eq!((find(Trust::Bundled), find(Trust::Stranger)), (find(Trust::Own), None));
        assert_eq!(PolicySearch::Nowhere.find(&case_in(&inner, "a.yaml", Trust::Own)), None);
        std::fs::write(inner.join(BUNDLE_FILE), "").unwrap();
        assert_eq!(find(Trust::Own), None);
        std::fs::write(inner.join(POLICY_FILE), "").unwrap();
        assert_eq!(find(Trust::Own), Some(inner.join(POLICY_FILE)));
    }

    #[test]
    fn a_faulty_policy_is_reported_once_for_all_of_its_cases() {
        let folders = [tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap()];
        let mut cases = vec![];
        for folder in &folders {
            std::fs::write(folder.path().join(POLICY_FILE), "profiles: {ci: {budget: {seconds: 0}}}").unwrap();
            cases.extend(["a.yaml", "b.yaml"].map(|name| case_in(folder.path(), name, Trust::Own)));
        }
        let faults = PolicyChoice::default().of_cases(&cases).unwrap_err();
        assert_eq!(faults.all().len(), 2, "{faults}");
        let policies = PolicyChoice { search: PolicySearch::Nowhere, ..PolicyChoice::default() }.of_cases(&cases);
        assert_eq!(policies.unwrap().len(), 4);
    }

    #[test]
    fn what_a_stranger_proposes_beyond_narrower_tolerances_is_overruled() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join(POLICY_FILE), "").unwrap();
        let choice = PolicyChoice::default();
        let ours = Arc::new(Policy::built_in().unwrap());
        let count = |case: &Case, policy: &Arc<Policy>, choice: &PolicyChoice| {
            overruled(std::slice::from_ref(case), std::slice::from_ref(policy), choice).len()
        };
        let [own, mut stranger] = [Trust::Own, Trust::Stranger].map(|trust| case_in(folder.path(), "a.yaml", trust));
        assert_eq!((count(&own, &ours, &choice), count(&stranger, &ours, &choice)), (0, 1));
        // A policy that was found around the current folder only narrows; one that the user names is the user's own.
        let record = PolicyRecord {
            file: "luxproof.yaml".to_owned(),
            sha256: String::new(),
            profile: None,
            required_engines: vec![],
        };
        let found = Arc::new(Policy { record: Some(record), ..Policy::built_in().unwrap() });
        let named = PolicyChoice { file: Some("luxproof.yaml".into()), ..PolicyChoice::default() };
        assert_eq!((count(&stranger, &found, &choice), count(&stranger, &found, &named)), (2, 1));
        let relative = |relative| luxproof_spec::ToleranceOverride { relative, ..Default::default() };
        stranger.tolerances.insert(ProcedureId::DirectIlluminance, relative(1e-6));
        assert_eq!(count(&stranger, &ours, &choice), 1);
        stranger.tolerances.insert(ProcedureId::DirectIlluminance, relative(9.0));
        assert_eq!(count(&stranger, &ours, &choice), 2);
    }

    #[test]
    fn no_more_than_twenty_things_that_were_overruled_are_reported_and_each_once() {
        let folder = tempfile::tempdir().unwrap();
        let mut cases = vec![];
        for k in 0..21 {
            let inner = folder.path().join(format!("{k}"));
            std::fs::create_dir(&inner).unwrap();
            std::fs::write(inner.join(POLICY_FILE), "").unwrap();
            cases.extend(["a.yaml", "b.yaml"].map(|name| case_in(&inner, name, Trust::Stranger)));
        }
        let ours = Arc::new(Policy::built_in().unwrap());
        let policies = vec![ours; cases.len()];
        for (asked, reported) in [(2, 1), (38, 19), (40, 20), (42, 20)] {
            let found = overruled(&cases[..asked], &policies[..asked], &PolicyChoice::default());
            assert_eq!(found.len(), reported, "{asked}");
        }
    }
}
