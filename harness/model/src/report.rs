//! The report: the record of a run.

use std::collections::BTreeSet;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::{
    BaselineCheck, Bias, Comparison, Consensus, Curve, EngineName, EngineStatus, Exit, FloorPlan, HiddenVariant,
    KnownDeviationOutcome, LuminaireModelChoice, MeterId, PaperSplit, PolicyRecord, ProcedureId, PublishedTable,
    Ratios, Reading, ReadingKey, Recording, Request, Role, Sentence, Skip, Split, StatedErrors, Statistics, Summary,
    Tool, Verdict,
};

/// The version of the format that this program writes.
pub const REPORT_VERSION: u32 = 2;
/// A report with more comparisons or readings than this is long.
///
/// Its JSON has one row on each line, and its comparisons are also in further files. One page with all of them would open slowly.
pub const MAX_ON_ONE_PAGE: usize = 10_000;
/// The name of a report in the folder of its run.
pub const REPORT_FILE: &str = "report.json";

/// The record of a run: `report.json`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Report {
    /// Version of the format: 2.
    pub luxproof: u32,
    /// SHA-256 of the rest, without times and white space. A report that was edited is refused.
    #[serde(default)]
    pub checksum: String,
    pub tool_version: String,
    /// The program that wrote it.
    #[serde(default)]
    pub tool: Tool,
    /// When the run started (RFC 3339, UTC).
    pub started: String,
    pub wall_s: f64,
    pub spec: SpecRecord,
    /// The options of the run; null in older reports.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub request: Option<Request>,
    /// The trust statement about each renderer.
    #[serde(default)]
    pub sentences: Vec<Sentence>,
    pub engines: Vec<EngineStatus>,
    /// Every reading with every reference.
    pub comparisons: Vec<Comparison>,
    /// Every reading of every engine, once.
    pub readings: Vec<ReadingRecord>,
    /// Statistics of sets of meters for each engine, and their agreement with the references.
    #[serde(default)]
    pub statistics: Vec<Statistics>,
    /// Ratios of compared cases for each engine.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub ratios: Vec<Ratios>,
    /// How each engine was run on each procedure.
    pub recordings: Vec<Recording>,
    /// Jobs that were not run, and why.
    pub skips: Vec<Skip>,
    /// Differences of an approximate method from a renderer, with the share of each.
    #[serde(default)]
    pub splits: Vec<Split>,
    /// Differences of a paper's calculation from its renderings, with the share of each cause.
    #[serde(default)]
    pub paper_splits: Vec<PaperSplit>,
    /// The mean deviation for each case, procedure, engine and basis of references.
    #[serde(default)]
    pub bias: Vec<Bias>,
    /// The state of each known deviation that applies to a reading.
    #[serde(default)]
    pub known_deviations: Vec<KnownDeviationOutcome>,
    /// How the engines and references of each case and procedure agree, with the outliers.
    #[serde(default)]
    pub consensus: Vec<Consensus>,
    /// The published tables that the cases are compared with, as they are printed.
    #[serde(default)]
    pub published: Vec<PublishedTable>,
    /// Problems of these tables: rows without a meter, control totals that do not fit.
    #[serde(default)]
    pub published_findings: Vec<String>,
    /// The curves of photometric files, where luminous intensity is measured.
    #[serde(default)]
    pub curves: Vec<Curve>,
    #[serde(default)]
    pub cases: Vec<CaseRecord>,
    /// Valid but suspicious input of the specs.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub lints: Vec<LintRecord>,
    /// The comparison with a baseline, where there is one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub baseline: Option<BaselineCheck>,
    pub summary: Summary,
}

/// A case of the run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct CaseRecord {
    pub name: String,
    pub spec: SpecRecord,
    /// The project's policy that judges it, where there is one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub policy: Option<PolicyRecord>,
    /// What its verdicts claim and how often they are wrong.
    #[serde(default)]
    pub decision_rule: String,
    /// Whether it holds calibration scenes, which no spec requests.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub is_calibration: bool,
    /// The public case that it is a hidden variant of, with the seed; null for a public case.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub hidden_variant: Option<HiddenVariant>,
    /// Whether its room has obstacles.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub has_bodies: bool,
    /// How the extent of its luminaires is modelled, and why.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub luminaire_models: Vec<LuminaireModelChoice>,
    /// The case seen from above; null for calibration scenes, for scenes with very many parts, and in older reports.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub plan: Option<FloorPlan>,
}

/// Valid but suspicious input.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct LintRecord {
    /// The file's path as given.
    pub file: String,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub line: Option<usize>,
    pub message: String,
    /// What to do about it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub help: Option<String>,
}

impl std::fmt::Display for LintRecord {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let line = self.line.map(|line| format!(":{line}")).unwrap_or_default();
        write!(f, "{}{line}: {}", self.file, self.message)?;
        self.help.as_ref().map_or(Ok(()), |help| write!(f, "; {help}"))
    }
}

/// The spec of a run or a case.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct SpecRecord {
    /// The spec's path as given.
    pub path: String,
    /// SHA-256 of the spec and of every file that it names.
    pub sha256: String,
    pub title: String,
}

/// A reading with its key and luminaire model.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ReadingRecord {
    #[serde(flatten)]
    pub key: ReadingKey,
    pub model: String,
    #[serde(flatten)]
    pub reading: Reading,
}

impl Report {
    /// The approximation that an engine declares, where its declared error explains a failed comparison.
    pub fn declared(&self, comparison: &Comparison) -> Option<&str> {
        self.recordings.iter().find(|r| r.key == comparison.key)?.declared(comparison)
    }

    /// The exit code of a run.
    pub fn exit(&self) -> Exit {
        let is_whole = self.has_audited() && self.lacking().is_empty();
        if is_whole { self.worst() } else { Exit::Engine.max(self.worst()) }
    }

    /// The project policies of the run, each once.
    pub fn policies(&self) -> BTreeSet<&PolicyRecord> {
        self.cases.iter().filter_map(|c| c.policy.as_ref()).collect()
    }

    /// The engines that a policy requires and that have no reading in any of its cases.
    pub fn lacking(&self) -> Vec<(&PolicyRecord, &EngineName)> {
        // A run of calibration scenes alone is no audit.
        if self.asked() == 0 {
            return vec![];
        }
        let mut lacking = vec![];
        for policy in self.policies() {
            let required = policy.required_engines.iter();
            lacking.extend(required.filter(|engine| !self.has_read(policy, engine)).map(|engine| (policy, engine)));
        }
        lacking
    }

    /// Whether an engine has readings in any case of a policy. Recorded readings show no program that ran.
    fn has_read(&self, policy: &PolicyRecord, engine: &EngineName) -> bool {
        let cases: BTreeSet<&str> = self
            .cases
            .iter()
            .filter(|case| case.policy.as_ref() == Some(policy) && !case.is_calibration)
            .map(|case| case.name.as_str())
            .collect();
        let ran = self.recordings.iter().filter(|r| r.failure.is_none() && r.role != Role::Recorded);
        let mut read = ran.filter(|r| r.key.engine == *engine);
        read.any(|recording| cases.contains(recording.key.case.as_str()))
    }

    /// The procedures of engines that fail by their bias, where no single reading fails.
    pub fn failed_biases(&self) -> impl Iterator<Item = &Bias> {
        self.bias.iter().filter(|bias| bias.fails && !self.has_failure(bias))
    }

    fn has_failure(&self, bias: &Bias) -> bool {
        let mut failing = self.comparisons.iter().filter(|c| c.verdict == Verdict::Fail);
        failing.any(|c| c.key == bias.key && c.basis() == Some(bias.basis))
    }

    /// The stated errors that repeated readings refute, with the recordings that state them.
    pub fn failed_claims(&self) -> impl Iterator<Item = (&Recording, &StatedErrors)> {
        let stated = self.recordings.iter().flat_map(|r| r.stated_errors.iter().map(move |stated| (r, stated)));
        stated.filter(|(_, stated)| stated.is_failed_claim())
    }

    /// The exit code of the worst engine, comparison, bias, claim or baseline.
    pub fn worst(&self) -> Exit {
        let engines = self.engines.iter().map(EngineStatus::exit);
        let comparisons = self.comparisons.iter().map(|c| Exit::of(c.verdict));
        let worst = engines.chain(comparisons).fold(Exit::Passed, Ord::max);
        let is_accepted = self.baseline.as_ref().is_none_or(BaselineCheck::is_as_accepted);
        let has_failed = self.failed_biases().next().is_some() || self.failed_claims().next().is_some();
        if is_accepted && !has_failed { worst } else { worst.max(Exit::Failed) }
    }

    /// Whether any renderer has readings of a spec, or no renderer was requested.
    ///
    /// A run that audits nothing must not look like success. Where specs request nothing, calibration scenes count.
    pub fn has_audited(&self) -> bool {
        if !self.engines.iter().any(|e| e.role.is_judged()) {
            return true;
        }
        let mut read = self.recordings.iter().filter(|r| r.role.is_judged() && r.failure.is_none());
        read.any(|r| self.asked() == 0 || self.cases.iter().any(|c| c.name == r.key.case && !c.is_calibration))
    }

    /// The number of cases of specs, without calibration scenes.
    pub fn asked(&self) -> usize {
        self.cases.iter().filter(|c| !c.is_calibration).count()
    }

    /// Whether specs request several cases.
    pub fn is_suite(&self) -> bool {
        self.asked() > 1
    }

    /// The name of a case with a separator; empty where there is only one case.
    pub fn of_suite(&self, case: &str, after: &str) -> String {
        if self.is_suite() { format!("{case}{after}") } else { String::new() }
    }

    /// The procedures that were run or skipped.
    pub fn procedures(&self) -> BTreeSet<ProcedureId> {
        let recorded = self.recordings.iter().map(|r| r.key.procedure);
        recorded.chain(self.skips.iter().map(|s| s.key.procedure)).collect()
    }

    /// The reading of an engine at a meter in a procedure of a case.
    pub fn reading(&self, key: &ReadingKey, meter: &MeterId) -> Option<&Reading> {
        self.readings.iter().find(|r| r.key == *key && r.reading.meter == *meter).map(|r| &r.reading)
    }

    /// Whether it is too long for one page.
    pub fn is_long(&self) -> bool {
        self.comparisons.len().max(self.readings.len()) > MAX_ON_ONE_PAGE
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::{comparison, engine, recording};
    use crate::{Basis, ErrorFinding, Estimate, Quantity, Scope, Status};

    fn case(name: &str) -> CaseRecord {
        CaseRecord {
            name: name.to_owned(),
            spec: SpecRecord::default(),
            policy: None,
            decision_rule: String::new(),
            is_calibration: false,
            hidden_variant: None,
            has_bodies: false,
            luminaire_models: vec![],
            plan: None,
        }
    }

    /// A policy that requires these engines.
    fn policy(file: &str, required: &[&str]) -> PolicyRecord {
        let required_engines = required.iter().map(|name| EngineName::from(*name)).collect();
        PolicyRecord { file: file.to_owned(), sha256: String::new(), profile: None, required_engines }
    }

    /// The case with a policy that requires these engines.
    fn of_policy(required: &[&str]) -> CaseRecord {
        CaseRecord { policy: Some(policy("p", required)), ..case("suite/room") }
    }

    /// A run of Radiance in one case, with one comparison that passes.
    fn report() -> Report {
        Report {
            engines: vec![engine("radiance", Status::Ran)],
            cases: vec![case("suite/room")],
            recordings: vec![recording()],
            comparisons: vec![Comparison { verdict: Verdict::Pass, ..comparison() }],
            ..Report::default()
        }
    }

    #[test]
    fn the_worst_of_engines_comparisons_biases_claims_and_baseline_is_the_exit() {
        assert_eq!((report().worst(), report().exit()), (Exit::Passed, Exit::Passed));
        let undecided = Comparison { verdict: Verdict::Undecided, ..comparison() };
        assert_eq!(Report { comparisons: vec![undecided.clone()], ..report() }.exit(), Exit::Undecided);
        let failed = Report { comparisons: vec![undecided.clone(), comparison()], ..report() };
        assert_eq!(failed.exit(), Exit::Failed);
        let crashed = Report { engines: vec![engine("radiance", Status::Failed)], ..failed };
        assert_eq!(crashed.exit(), Exit::Engine);
        // What a baseline does not accept fails a run, and does not hide a worse error.
        let entries = vec![];
        let equal = Some(BaselineCheck { file: "b.json".to_owned(), entries });
        assert_eq!(Report { baseline: equal, ..report() }.exit(), Exit::Passed);
        let line = crate::BaselineLine {
            key: comparison().key,
            state: "SHIFTED".to_owned(),
            is_as_accepted: false,
            details: vec![],
            instrument: vec![],
        };
        let shifted = Some(BaselineCheck { file: "b.json".to_owned(), entries: vec![line] });
        assert_eq!(Report { baseline: shifted.clone(), ..report() }.exit(), Exit::Failed);
        let both = Report { baseline: shifted.clone(), comparisons: vec![undecided], ..report() };
        assert_eq!(both.exit(), Exit::Failed);
        assert_eq!(Report { baseline: shifted, ..crashed }.exit(), Exit::Engine);
    }

    /// A bias of Radiance against the simulator that fails.
    fn bias() -> Bias {
        Bias {
            key: comparison().key,
            basis: Basis::Simulator,
            readings: 9,
            mean: 0.05,
            low: 0.04,
            high: 0.06,
            p_value: None,
            fails: true,
            scatter: None,
        }
    }

    #[test]
    fn a_bias_fails_a_run_where_no_reading_of_the_same_comparison_does() {
        let alone = Report { bias: vec![bias()], ..report() };
        assert_eq!((alone.failed_biases().count(), alone.worst()), (1, Exit::Failed));
        let allowed = Report { bias: vec![Bias { fails: false, ..bias() }], ..report() };
        assert_eq!((allowed.failed_biases().count(), allowed.worst()), (0, Exit::Passed));
        let with_failure = Report { comparisons: vec![comparison()], ..alone.clone() };
        assert_eq!(with_failure.failed_biases().count(), 0);
        // A failure of another key or against another kind of reference is another one.
        let mut of_other_case = comparison();
        of_other_case.key.case = "suite/hall".to_owned();
        assert_eq!(Report { comparisons: vec![of_other_case], ..alone.clone() }.failed_biases().count(), 1);
        let mut of_paper = comparison();
        of_paper.reference.as_mut().unwrap().basis = Basis::Published;
        assert_eq!(Report { comparisons: vec![of_paper], ..alone }.failed_biases().count(), 1);
    }

    #[test]
    fn a_refuted_claim_fails_a_run() {
        let [large, refuted] = [ErrorFinding::TooLarge, ErrorFinding::Refuted].map(StatedErrors::from_finding);
        let stated_errors = vec![large, refuted.clone()];
        let found = Report { recordings: vec![Recording { stated_errors, ..recording() }], ..report() };
        assert_eq!(found.failed_claims().map(|(_, stated)| stated).collect::<Vec<_>>(), [&refuted]);
        assert_eq!((found.worst(), report().failed_claims().count()), (Exit::Failed, 0));
    }

    #[test]
    fn a_run_lacks_the_engines_that_a_policy_requires_and_that_read_nothing_in_its_cases() {
        let whole = Report { cases: vec![of_policy(&["radiance"])], ..report() };
        assert!(whole.lacking().is_empty() && whole.exit() == Exit::Passed);
        let asks_more = Report { cases: vec![of_policy(&["radiance", "mitsuba"])], ..report() };
        let (named, missing) = (policy("p", &["radiance", "mitsuba"]), EngineName::from("mitsuba"));
        assert_eq!(asks_more.lacking(), [(&named, &missing)]);
        assert_eq!(asks_more.exit(), Exit::Engine);
        // Neither what failed nor what was recorded nor what another case read counts.
        for recording in [
            Recording { failure: Some("a crash".to_owned()), ..recording() },
            Recording { role: Role::Recorded, ..recording() },
            Recording { key: ReadingKey { case: "other".to_owned(), ..recording().key }, ..recording() },
        ] {
            let without = Report { recordings: vec![recording], ..whole.clone() };
            assert_eq!(without.lacking().len(), 1, "{:?}", without.recordings);
        }
        // A calibration scene does not count, and a run of such scenes alone lacks nothing.
        let calibration = CaseRecord { is_calibration: true, ..of_policy(&["radiance"]) };
        let beside = CaseRecord { name: "suite/hall".to_owned(), ..of_policy(&["radiance"]) };
        let without = Report { cases: vec![calibration.clone(), beside], ..report() };
        assert_eq!(without.lacking().len(), 1);
        let alone = Report { cases: vec![calibration], recordings: vec![], ..report() };
        assert!(alone.lacking().is_empty());
        // Each policy is asked by its own cases, and counted once.
        let other = CaseRecord { policy: Some(policy("q", &["radiance"])), ..case("suite/hall") };
        let two = Report { cases: vec![of_policy(&["radiance"]), of_policy(&["radiance"]), other], ..report() };
        assert_eq!(two.policies().len(), 2);
        assert_eq!(two.lacking(), [(&policy("q", &["radiance"]), &EngineName::from("radiance"))]);
    }

    #[test]
    fn a_run_without_readings_of_a_renderer_has_audited_nothing() {
        assert!(report().has_audited());
        let mut of_reference = engine("simulator", Status::Ran);
        of_reference.role = Role::Reference;
        let recordings = vec![Recording { role: Role::Reference, ..recording() }];
        let references = Report { engines: vec![of_reference], recordings: recordings.clone(), ..report() };
        assert!(references.has_audited());
        for recordings in [
            vec![],
            recordings,
            vec![Recording { failure: Some("a crash".to_owned()), ..recording() }],
            vec![Recording { key: ReadingKey { case: "other".to_owned(), ..recording().key }, ..recording() }],
        ] {
            let nothing = Report { recordings, ..report() };
            assert!(!nothing.has_audited() && nothing.exit() == Exit::Engine, "{:?}", nothing.recordings);
        }
        // Calibration scenes count where specs request nothing else.
        let calibration = CaseRecord { is_calibration: true, ..case("suite/room") };
        assert!(Report { cases: vec![calibration.clone()], ..report() }.has_audited());
        let with_other = Report { cases: vec![calibration, case("suite/hall")], ..report() };
        assert!(!with_other.has_audited());
    }

    #[test]
    fn a_suite_has_several_cases_of_specs() {
        let calibration = CaseRecord { is_calibration: true, ..case("point") };
        let one = Report { cases: vec![case("suite/room"), calibration], ..report() };
        assert_eq!((one.asked(), one.is_suite(), one.of_suite("suite/room", ": ").as_str()), (1, false, ""));
        let two = Report { cases: vec![case("suite/room"), case("suite/hall")], ..report() };
        assert_eq!((two.asked(), two.is_suite()), (2, true));
        assert_eq!(two.of_suite("suite/room", ": "), "suite/room: ");
    }

    #[test]
    fn a_report_has_its_procedures_and_its_readings_by_key_and_meter() {
        let mut found = report();
        let skipped = ReadingKey::new("suite/room", ProcedureId::TotalIlluminance, "radiance");
        found.skips.push(Skip::new(skipped.clone(), Scope::Procedure, "absent"));
        let both = BTreeSet::from([ProcedureId::DirectIlluminance, ProcedureId::TotalIlluminance]);
        assert_eq!(found.procedures(), both);
        let key = comparison().key;
        for (k, value) in [(0, 1.0), (1, 2.0)] {
            let reading = Reading::new(MeterId::new("desk", k), Quantity::Illuminance, Estimate::exact(value));
            found.readings.push(ReadingRecord { key: key.clone(), model: "point".to_owned(), reading });
        }
        let second = MeterId::new("desk", 1);
        assert_eq!(found.reading(&key, &second).map(|r| r.value), Some(2.0));
        assert!(found.reading(&skipped, &second).is_none());
        assert!(found.reading(&key, &MeterId::new("desk", 2)).is_none());
    }

    #[test]
    fn more_than_ten_thousand_comparisons_or_readings_are_long() {
        let reading = Reading::new(MeterId::new("desk", 0), Quantity::Illuminance, Estimate::exact(1.0));
        let record = ReadingRecord { key: comparison().key, model: String::new(), reading };
        for (count, is_long) in [(MAX_ON_ONE_PAGE, false), (MAX_ON_ONE_PAGE + 1, true)] {
            assert_eq!(Report { comparisons: vec![comparison(); count], ..report() }.is_long(), is_long);
            assert_eq!(Report { readings: vec![record.clone(); count], ..report() }.is_long(), is_long);
        }
    }

    #[test]
    fn a_lint_names_its_line_and_its_help_where_it_has_them() {
        let lint = LintRecord { file: "a.yaml".to_owned(), line: None, message: "is odd".to_owned(), help: None };
        assert_eq!(lint.to_string(), "a.yaml: is odd");
        let placed = LintRecord { line: Some(7), help: Some("change it".to_owned()), ..lint };
        assert_eq!(placed.to_string(), "a.yaml:7: is odd; change it");
    }
}
