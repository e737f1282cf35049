//! The report: one record of a run, and views of it; the JSON form is the truth.

mod accepted;
mod budget;
mod consensus;
mod csv;
mod curve;
mod html;
mod junit;
mod markdown;
mod paper;
mod paper_split;
mod split;
mod terminal;

use std::collections::BTreeSet;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::judge::{Comparison, Consensus, PaperSplit, PublishedTable, Split, Verdict};
use crate::plan::Skip;
use crate::record::{EngineStatus, ProcedureId, Reading, ReadingKey, Recording, Status};

use crate::spec::Case;

pub use accepted::{BaselineCheck, BaselineLine};
pub use budget::budgets;
pub use csv::csv;
pub use curve::{Curve, curves};
pub use html::{Beside, BesideError, page};
pub use junit::junit;
pub use markdown::markdown;
pub use terminal::{Detail, Style, terminal};

/// Everything that is known of a run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Report {
    /// Version of the format: 1.
    pub luxproof: u32,
    /// Version of the program.
    pub tool_version: String,
    /// When the run started (RFC 3339, UTC).
    pub started: String,
    /// Wall-clock seconds of the run.
    pub wall_s: f64,
    /// What was run.
    pub spec: SpecRecord,
    /// How each engine fared.
    pub engines: Vec<EngineStatus>,
    /// Every reading against every reference.
    pub comparisons: Vec<Comparison>,
    /// Every reading of every engine, once.
    pub readings: Vec<ReadingRecord>,
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
    /// What the witnesses of each case and procedure say of each other: who departs.
    #[serde(default)]
    pub consensus: Vec<Consensus>,
    /// The published tables that the cases are held against, as they are printed.
    #[serde(default)]
    pub published: Vec<PublishedTable>,
    /// What the photometric files say where their luminous intensity is read back.
    #[serde(default)]
    pub curves: Vec<Curve>,
    /// The cases, in their order.
    #[serde(default)]
    pub cases: Vec<CaseRecord>,
    /// How the run compares with its baseline, where it was held against one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub baseline: Option<BaselineCheck>,
    /// Comparisons by verdict.
    pub summary: Summary,
}

/// One case of a run.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct CaseRecord {
    /// Its name.
    pub name: String,
    /// What was run.
    pub spec: SpecRecord,
}

/// What was run.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct SpecRecord {
    /// The spec's path as given.
    pub path: String,
    /// SHA-256 of the spec and of every file that it names.
    pub sha256: String,
    pub title: String,
}

impl SpecRecord {
    /// That of one case.
    pub fn of(case: &Case) -> Self {
        Self { path: case.path.display().to_string(), sha256: case.sha256.clone(), title: case.title.clone() }
    }
}

/// One reading of one engine.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ReadingRecord {
    #[serde(flatten)]
    pub key: ReadingKey,
    /// The luminaire model.
    pub model: String,
    #[serde(flatten)]
    pub reading: Reading,
}

/// Comparisons by verdict, and skips.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct Summary {
    /// Passed.
    pub pass: usize,
    pub fail: usize,
    /// Undecided within the budget.
    pub inconclusive: usize,
    /// Deviations on record.
    pub known_deviation: usize,
    /// Deviations on record that are gone.
    pub unexpected_pass: usize,
    /// Without reading or reference.
    pub missing: usize,
    /// Procedures of engines without a reading; what was read without rendering is among the skips, but not here.
    pub skipped: usize,
}

/// The exit code of a run, by the worst that happened.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Exit {
    /// 0: everything passed, known deviations included.
    Passed,
    /// 4: undecided within the budget.
    Undecided,
    /// 1: a tolerance failed.
    Failed,
    /// 3: an engine that was asked for failed or is absent.
    Engine,
    /// 2: usage or input error.
    Usage,
}

impl Exit {
    /// The process exit code.
    pub const fn code(self) -> u8 {
        match self {
            Self::Passed => 0,
            Self::Failed => 1,
            Self::Usage => 2,
            Self::Engine => 3,
            Self::Undecided => 4,
        }
    }

    /// How bad it is: the worst of several wins (2 before 3 before 1 before 4).
    const fn badness(self) -> u8 {
        match self {
            Self::Passed => 0,
            Self::Undecided => 1,
            Self::Failed => 2,
            Self::Engine => 3,
            Self::Usage => 4,
        }
    }

    /// The worse of two.
    #[must_use]
    pub const fn worse(self, other: Self) -> Self {
        if self.badness() >= other.badness() { self } else { other }
    }
}

impl Summary {
    fn of(comparisons: &[Comparison], skips: &[Skip]) -> Self {
        let count = |verdict| comparisons.iter().filter(|c| c.verdict == verdict).count();
        Self {
            pass: count(Verdict::Pass),
            fail: count(Verdict::Fail),
            inconclusive: count(Verdict::Inconclusive),
            known_deviation: count(Verdict::KnownDeviation),
            unexpected_pass: count(Verdict::UnexpectedPass),
            missing: count(Verdict::Missing),
            skipped: skips.iter().filter(|s| s.scope.leaves_no_reading()).count(),
        }
    }
}

/// What a report is made of, besides the comparisons.
pub struct Ingredients<'a> {
    pub case: String,
    /// What was run.
    pub spec: SpecRecord,
    /// When the run started.
    pub started: std::time::SystemTime,
    /// How long it took.
    pub wall_s: f64,
    /// How each engine fared.
    pub engines: Vec<EngineStatus>,
    /// What they said.
    pub recordings: &'a [Recording],
    /// What was not run.
    pub skips: Vec<Skip>,
    /// What of a deviation is whose.
    pub splits: Vec<Split>,
    /// What the witnesses say of each other.
    pub consensus: Vec<Consensus>,
    /// Published tables.
    pub published: Vec<PublishedTable>,
    /// Curves of the photometric files.
    pub curves: Vec<Curve>,
}

impl Report {
    /// Puts a report together.
    pub fn new(ingredients: Ingredients<'_>, comparisons: Vec<Comparison>) -> Self {
        let Ingredients {
            case,
            spec,
            started,
            wall_s,
            engines,
            recordings,
            skips,
            splits,
            consensus,
            published,
            curves,
        } = ingredients;
        Self {
            luxproof: 1,
            tool_version: env!("CARGO_PKG_VERSION").to_owned(),
            started: humantime::format_rfc3339_seconds(started).to_string(),
            wall_s,
            cases: vec![CaseRecord { name: case, spec: spec.clone() }],
            spec,
            engines,
            readings: recordings.iter().flat_map(readings).collect(),
            recordings: recordings.iter().map(|r| Recording { readings: vec![], ..r.clone() }).collect(),
            summary: Summary::of(&comparisons, &skips),
            comparisons,
            skips,
            splits,
            paper_splits: vec![],
            consensus,
            published,
            curves,
            baseline: None,
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
        let Some(joined) = joined else { unreachable!("a suite without cases is refused") };
        let summary = Summary::of(&joined.comparisons, &joined.skips);
        let order = |e: &EngineStatus| crate::engines::all().iter().position(|known| known.name() == e.id);
        let mut engines = joined.engines;
        engines.sort_by_key(order);
        let joined = Self { spec, engines, summary, ..joined };
        Self { paper_splits: paper_split::splits(&joined), ..joined }
    }

    /// Whether more than one case was run.
    fn is_suite(&self) -> bool {
        self.cases.len() > 1
    }

    /// The exit code that the run deserves.
    pub fn exit(&self) -> Exit {
        let engine = |e: &EngineStatus| match e.status {
            Status::Failed => Exit::Engine,
            Status::Absent if e.is_required => Exit::Engine,
            _ => Exit::Passed,
        };
        let verdict = |c: &Comparison| match c.verdict {
            Verdict::Pass | Verdict::KnownDeviation => Exit::Passed,
            Verdict::Inconclusive => Exit::Undecided,
            Verdict::Fail | Verdict::UnexpectedPass | Verdict::Missing => Exit::Failed,
        };
        let baseline = |b: &BaselineCheck| if b.is_as_accepted() { Exit::Passed } else { Exit::Failed };
        let readings = self.engines.iter().map(engine).chain(self.comparisons.iter().map(verdict));
        readings.chain(self.baseline.iter().map(baseline)).fold(Exit::Passed, Exit::worse)
    }

    /// The procedures of the comparisons and readings, in their order.
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_worst_exit_wins() {
        assert_eq!(Exit::Failed.worse(Exit::Undecided), Exit::Failed);
        assert_eq!(Exit::Failed.worse(Exit::Engine), Exit::Engine);
        assert_eq!(Exit::Usage.worse(Exit::Engine).code(), 2);
        assert_eq!(
            [Exit::Passed, Exit::Failed, Exit::Usage, Exit::Engine, Exit::Undecided].map(Exit::code),
            [0, 1, 2, 3, 4]
        );
    }
}
