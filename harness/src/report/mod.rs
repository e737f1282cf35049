//! The report: one record of a run, and views of it; the JSON form is the truth.

mod accepted;
mod budget;
mod claims;
mod csv;
mod curve;
pub(crate) mod earlier;
mod exit;
mod html;
mod junit;
mod lines;
mod markdown;
mod matrix;
mod notes;
mod papers;
mod read;
mod request;
mod sentences;
pub(crate) mod svg;
mod terminal;
pub(crate) mod words;

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::time::SystemTime;

use luminaire::scene::flush;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::judge::{
    Bias, Comparison, Consensus, OnRecord, PaperSplit, Policy, PolicyRecord, PublishedTable, Ratios, Split, Statistics,
    Verdict,
};
use crate::plan::Skip;
use crate::record::{EngineName, EngineStatus, ProcedureId, Reading, ReadingKey, Recording, Role, Status};
use crate::spec::Case;
use crate::system::files::{self, Care, FileError};
use crate::system::tool::Tool;

pub use accepted::{BaselineCheck, BaselineLine};
pub use budget::budgets;
pub use claims::{Claim, Sentence};
pub use csv::csv;
pub use curve::{Curve, curves};
pub use exit::{Exit, Summary};
pub(crate) use html::table;
pub use html::{Beside, BesideError, keep as keep_page, page};
pub use junit::junit;
pub use markdown::markdown;
pub use papers::{Cell, Standing, cells};
pub use read::{ReadError, ReadReport, ReportError};
pub use request::Request;
pub use terminal::{Detail, Screen, Style, terminal};

/// A report of more comparisons than this is laid out in rows, and has them line by line and page by page beside it: a page of all would take seconds
/// to open.
const LONG: usize = 10_000;
/// What it is called in the folder of a run, and its page.
pub(crate) const FILE: &str = "report.json";
pub(crate) const PAGE: &str = "report.html";

#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Report {
    /// Version of the format: 1.
    pub luxproof: u32,
    /// SHA-256 of the rest as it was written, times, white space between its parts and this value left out: what was edited is refused.
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
    /// What was asked besides the specs; null in reports of before it was noted.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub request: Option<Request>,
    /// What each renderer can be trusted for, by what follows.
    #[serde(default)]
    pub sentences: Vec<Sentence>,
    pub engines: Vec<EngineStatus>,
    /// Every reading against every reference.
    pub comparisons: Vec<Comparison>,
    /// Every reading of every engine, once.
    pub readings: Vec<ReadingRecord>,
    /// What sets of meters come to, engine by engine, and how that agrees with their references.
    #[serde(default)]
    pub statistics: Vec<Statistics>,
    /// What cases that a spec compares are to each other, engine by engine.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub ratios: Vec<Ratios>,
    /// How each engine was run on each procedure.
    pub recordings: Vec<Recording>,
    /// What was not run, and why.
    pub skips: Vec<Skip>,
    /// Where an approximate method differs from a renderer: what of it is the method's and what the renderer's.
    #[serde(default)]
    pub splits: Vec<Split>,
    /// What of the distance between a paper's calculation and its renderings is whose.
    #[serde(default)]
    pub paper_splits: Vec<PaperSplit>,
    /// Whether readings lie off together, below any tolerance: one a case, procedure, engine and kind of reference.
    #[serde(default)]
    pub bias: Vec<Bias>,
    /// What each known deviation on record came to, where it is about something that was read.
    #[serde(default)]
    pub known_deviations: Vec<OnRecord>,
    /// What the witnesses of each case and procedure say of each other: who departs.
    #[serde(default)]
    pub consensus: Vec<Consensus>,
    /// The published tables that the cases are held against, as they are printed.
    #[serde(default)]
    pub published: Vec<PublishedTable>,
    /// What of them stands for nothing here, or not for what was copied: rows at no meter, control totals that do not fit.
    #[serde(default)]
    pub published_findings: Vec<String>,
    /// What the photometric files say where their luminous intensity is read back.
    #[serde(default)]
    pub curves: Vec<Curve>,
    #[serde(default)]
    pub cases: Vec<CaseRecord>,
    /// How the run compares with its baseline, where it was held against one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub baseline: Option<BaselineCheck>,
    pub summary: Summary,
}

#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct CaseRecord {
    pub name: String,
    pub spec: SpecRecord,
    /// The project's policy that it is judged by, where there is one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub policy: Option<PolicyRecord>,
    /// What its verdicts are for and how often they are wrong.
    #[serde(default)]
    pub decision_rule: String,
    /// Whether it holds scenes of known answer, for which no spec asks.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub is_known: bool,
    /// Whether anything stands in its room.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub has_bodies: bool,
}

/// What was run.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct SpecRecord {
    /// The spec's path as given.
    pub path: String,
    /// SHA-256 of the spec and of every file that it names.
    pub sha256: String,
    pub title: String,
}

impl SpecRecord {
    pub fn of(case: &Case) -> Self {
        Self { path: case.path.display().to_string(), sha256: case.sha256.clone(), title: case.title.clone() }
    }
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ReadingRecord {
    #[serde(flatten)]
    pub key: ReadingKey,
    pub model: String,
    #[serde(flatten)]
    pub reading: Reading,
}

impl Report {
    /// What readings and skips of a case say by themselves; what else is known of the run the caller adds.
    pub fn new(
        case: &Case,
        policy: &Policy,
        started: SystemTime,
        recordings: &[Recording],
        comparisons: Vec<Comparison>,
        skips: Vec<Skip>,
    ) -> Self {
        let spec = SpecRecord::of(case);
        Self {
            luxproof: read::VERSION,
            tool_version: env!("CARGO_PKG_VERSION").to_owned(),
            tool: Tool::this(),
            started: humantime::format_rfc3339_seconds(started).to_string(),
            cases: vec![CaseRecord {
                name: case.name.clone(),
                spec: spec.clone(),
                policy: policy.record.clone(),
                decision_rule: policy.tolerances.decision_rule(),
                is_known: case.is_known(),
                has_bodies: case.scene.obstacles.iter().any(|o| !flush::is_plate(o)),
            }],
            spec,
            readings: recordings.iter().flat_map(readings).collect(),
            recordings: recordings.iter().map(|r| Recording { readings: vec![], ..r.clone() }).collect(),
            summary: Summary::of(&comparisons, &skips),
            comparisons,
            skips,
            ..Self::default()
        }
    }

    /// What an engine says of itself, where that is why a reading of it fails: no more than that is missing.
    pub fn declared(&self, comparison: &Comparison) -> Option<&str> {
        let recording = self.recordings.iter().find(|r| r.key == comparison.key)?;
        let (reference, budget) = (comparison.reference.as_ref()?.value, comparison.budget.as_ref()?);
        let margin = comparison.tolerance.around(reference) + budget.expanded;
        let is_within = comparison.deviation?.abs() <= recording.declared_error? * reference.abs() + margin;
        recording.approximation.as_deref().filter(|_| is_within)
    }

    /// Says so of each that nothing else explains.
    pub(crate) fn tell_declared(&mut self) {
        let is_open = |c: &Comparison| c.verdict == Verdict::Fail && c.diagnosis.is_none();
        let open = (0..self.comparisons.len()).filter(|k| is_open(&self.comparisons[*k]));
        let told = |k: usize| Some((k, self.declared(&self.comparisons[k])?.to_owned()));
        for (k, why) in open.filter_map(told).collect::<Vec<_>>() {
            self.comparisons[k].diagnosis = Some(format!("as it declares: {why}"));
        }
    }

    /// One report of several cases, of which there is one at least.
    pub fn joined(spec: SpecRecord, reports: Vec<Self>) -> Self {
        let joined = reports.into_iter().reduce(|mut all, one| {
            all.wall_s += one.wall_s;
            all.comparisons.extend(one.comparisons);
            all.readings.extend(one.readings);
            all.recordings.extend(one.recordings);
            all.skips.extend(one.skips);
            all.splits.extend(one.splits);
            all.bias.extend(one.bias);
            all.statistics.extend(one.statistics);
            all.known_deviations.extend(one.known_deviations);
            all.consensus.extend(one.consensus);
            all.curves.extend(one.curves);
            all.cases.extend(one.cases);
            for table in one.published {
                match all.published.iter_mut().find(|t| t.is_the_same(&table)) {
                    Some(same) => same.cases.extend(table.cases),
                    None => all.published.push(table),
                }
            }
            for engine in one.engines {
                match all.engines.iter_mut().find(|e| e.id == engine.id) {
                    Some(same) => same.join(engine),
                    None => all.engines.push(engine),
                }
            }
            all
        });
        let Some(mut joined) = joined else { unreachable!("a suite without cases is refused") };
        let summary = Summary::of(&joined.comparisons, &joined.skips);
        joined.engines.sort_by_key(|e| crate::engines::place(&e.id));
        let joined = Self { spec, summary, ..joined };
        Self { paper_splits: papers::splits(&joined), ..joined }
    }

    /// Writes it to a file with its checksum; the file is seen whole or not at all.
    pub fn keep(&mut self, path: &Path) -> Result<(), FileError> {
        self.keep_with(Care::Lasting, path)
    }

    /// Writes it to `report.json` of a folder. A report there that says more, of engines, procedures or cases that were left out this time,
    /// or speaks of another spec, stays beside it, by a name that is returned.
    pub(crate) fn keep_in(&mut self, folder: &Path, care: Care) -> Result<Option<PathBuf>, FileError> {
        let path = folder.join(FILE);
        let aside = earlier::put_aside(self, &path).map_err(|e| FileError::of(&path, e))?;
        self.keep_again(folder, care)?;
        Ok(aside)
    }

    /// Writes it into the folder of its run, in place of the report there.
    pub fn keep_anew(&mut self, folder: &Path) -> Result<(), FileError> {
        self.keep_again(folder, Care::Lasting)
    }

    /// The same with so much care.
    pub(crate) fn keep_again(&mut self, folder: &Path, care: Care) -> Result<(), FileError> {
        self.keep_with(care, &folder.join(FILE))?;
        lines::keep(self, folder, care)
    }

    fn keep_with(&mut self, care: Care, path: &Path) -> Result<(), FileError> {
        let fail = |e| FileError::of(path, e);
        self.sentences = sentences::sentences(self);
        self.seal().map_err(fail)?;
        let kept =
            if self.is_long() { files::replace_rows(path, self, care) } else { files::replace_json(path, self, care) };
        kept.map_err(fail)
    }

    fn is_long(&self) -> bool {
        self.comparisons.len().max(self.readings.len()) > LONG
    }

    /// How many cases specs ask for.
    fn asked(&self) -> usize {
        self.cases.iter().filter(|c| !c.is_known).count()
    }

    fn is_suite(&self) -> bool {
        self.asked() > 1
    }

    /// The case and what parts it from what follows; nothing where there is but one case.
    fn of_suite(&self, case: &str, after: &str) -> String {
        if self.is_suite() { format!("{case}{after}") } else { String::new() }
    }

    /// The exit code of a run.
    pub fn exit(&self) -> Exit {
        let is_whole = self.has_audited() && self.lacking().is_empty();
        if is_whole { self.worst() } else { Exit::Engine.max(self.worst()) }
    }

    /// The project policies of the run, each once.
    pub(crate) fn policies(&self) -> BTreeSet<&PolicyRecord> {
        self.cases.iter().filter_map(|c| c.policy.as_ref()).collect()
    }

    /// The engines that a policy requires and that gave no reading in any of its cases.
    pub(crate) fn lacking(&self) -> Vec<(&PolicyRecord, &EngineName)> {
        let is_of = |case: &str, policy| {
            self.cases.iter().any(|c| c.name == case && c.policy.as_ref() == Some(policy) && !c.is_known)
        };
        let has_read = |policy, engine: &EngineName| {
            let mut read = self.recordings.iter().filter(|r| r.key.engine == *engine && r.failure.is_none());
            read.any(|r| is_of(&r.key.case, policy))
        };
        // An examination by scenes of known answer alone is no audit.
        let policies = self.policies().into_iter().filter(|_| self.asked() > 0);
        let required = policies.flat_map(|policy| policy.required_engines.iter().map(move |engine| (policy, engine)));
        required.filter(|(policy, engine)| !has_read(policy, engine)).collect()
    }

    /// The worst that happened to anything.
    pub(crate) fn worst(&self) -> Exit {
        let engine = |e: &EngineStatus| match e.status {
            Status::Failed => Exit::Engine,
            Status::Absent if e.is_required => Exit::Engine,
            _ => Exit::Passed,
        };
        let baseline = |b: &BaselineCheck| if b.is_as_accepted() { Exit::Passed } else { Exit::Failed };
        let readings = self.comparisons.iter().map(|c| Exit::of(c.verdict));
        let all = self.engines.iter().map(engine).chain(readings).chain(self.baseline.iter().map(baseline));
        all.fold(Exit::Passed, Ord::max)
    }

    /// Whether any renderer gave a reading of what specs ask for, where any was wanted: a run that audits nothing must not look like
    /// success. An examination asks for scenes of known answer alone.
    fn has_audited(&self) -> bool {
        let wanted = self.engines.iter().any(|e| e.role == Role::Renderer);
        let counts = |case: &str| self.asked() == 0 || self.cases.iter().any(|c| c.name == case && !c.is_known);
        let mut readings = self.recordings.iter().filter(|r| r.role == Role::Renderer && r.failure.is_none());
        !wanted || readings.any(|r| counts(&r.key.case))
    }

    fn procedures(&self) -> BTreeSet<ProcedureId> {
        let recorded = self.recordings.iter().map(|r| r.key.procedure);
        recorded.chain(self.skips.iter().map(|s| s.key.procedure)).collect()
    }
}

fn readings(recording: &Recording) -> impl Iterator<Item = ReadingRecord> {
    recording.readings.iter().map(|reading| ReadingRecord {
        key: recording.key.clone(),
        model: recording.model.clone(),
        reading: reading.clone(),
    })
}
