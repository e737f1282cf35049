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
