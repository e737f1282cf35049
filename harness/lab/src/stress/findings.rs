//! What stress found: a finding for each point, and a report for each engine and law.

use std::collections::BTreeMap;

use serde::Serialize;

use crate::deviation::Deviation;
use luxproof_audit::measure::{Failure, Instrument};
use luxproof_laws::Law;
use luxproof_model::{EngineName, FailureKind, LawBreach, ProcedureId};
use luxproof_spec::Case;
use luxproof_verdict::KnownBreak;

/// The relative deviations for which the first magnitude is reported.
pub(super) const DEVIATION_THRESHOLDS: [f64; 3] = [1e-3, 1e-2, 0.1];

/// The largest ratio of a deviation to the one on record at which it still counts as known.
const MAX_RECORD_RATIO: f64 = 1.25;

/// What a point shows.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub(super) struct Finding {
    /// The largest relative deviation beyond noise; `None` where there is no reading.
    pub(super) deviation: Option<f64>,
    pub(super) noise: Option<f64>,
    pub(super) how: Option<LawBreach>,
    /// Whether the engine itself refused the job.
    #[serde(rename = "refused")]
    pub(super) is_refused: bool,
    /// Why there is no reading or no comparison.
    pub(super) text: Option<String>,
    /// Whether neither side of the comparison is random.
    #[serde(skip)]
    pub(super) is_exact: bool,
}

impl Finding {
    /// The finding for a deviation of the changed job.
    pub(super) fn from_deviation(found: &Deviation) -> Self {
        let is_off = found.beyond >= DEVIATION_THRESHOLDS[0];
        let how = if found.beyond.is_infinite() {
            Some(LawBreach::Nan)
        } else if is_off && found.is_lost {
            Some(LawBreach::SilentLoss)
        } else {
            is_off.then_some(LawBreach::Drift)
        };
        let deviation = Some(found.beyond).filter(|d| d.is_finite());
        Self { deviation, noise: Some(found.noise), how, is_exact: found.is_exact, ..Self::default() }
    }

    /// The finding where the engine gave no reading of the changed job.
    pub(super) fn from_failure(failure: &Failure) -> Self {
        let how = match failure.kind {
            FailureKind::Declined
            | FailureKind::Refused
            | FailureKind::Interrupted
            | FailureKind::TimeUp
            | FailureKind::Unread => None,
            FailureKind::Nan => Some(LawBreach::Nan),
            FailureKind::ErrorExit | FailureKind::Crash => Some(LawBreach::Crash),
            FailureKind::Hang => Some(LawBreach::Hang),
            FailureKind::SilentLoss | FailureKind::Garbled => Some(LawBreach::SilentLoss),
        };
        let text = Some(failure.text.clone());
        let is_refused = matches!(failure.kind, FailureKind::Declined | FailureKind::Refused);
        Self { how, is_refused, text, ..Self::default() }
    }

    /// The finding where the changed job was read, but not the reading to compare it with. Nothing
    /// is known then.
    pub(super) fn without_reference(failure: &Failure) -> Self {
        let text = Some(format!("nothing to compare it with: {}", failure.text));
        Self { is_refused: true, text, ..Self::default() }
    }

    /// Whether the deviation exceeds a threshold, or something worse than a deviation happened.
    fn exceeds(&self, threshold: f64) -> bool {
        self.deviation.map_or(self.how.is_some_and(|h| h != LawBreach::Drift), |d| d >= threshold)
    }
}

/// What all laws show in a case.
#[derive(Clone, Debug, Serialize)]
pub struct StressReport {
    pub case: String,
    pub engines: BTreeMap<EngineName, String>,
    pub laws: Vec<LawReport>,
}

/// What a law shows on an engine.
#[derive(Clone, Debug, Serialize)]
pub struct LawReport {
    pub engine: EngineName,
    pub law: String,
    pub what: &'static str,
    pub unit: &'static str,
    /// The largest relative deviation beyond the stated noise; null where there is no reading.
    pub worst_deviation: Option<f64>,
    /// The largest noise; smaller deviations may be hidden by it.
    pub resolution: Option<f64>,
    /// The first magnitude at which the deviation exceeds .1, 1 and 10 %, or at which the law
    /// breaks in another way.
    pub breaks_at: BTreeMap<String, f64>,
    pub how: Option<LawBreach>,
    pub refused_at: Option<f64>,
    /// The number of points that were skipped because time was up or because a milder one hung.
    pub untried: usize,
    /// All points, from mild to extreme.
    pub points: Vec<PointReport>,
    /// The causes on record, where they explain everything that breaks.
    pub known: Vec<String>,
    /// The causes on record of which nothing breaks any more.
    pub gone: Vec<String>,
}

/// What a law shows at a magnitude.
#[derive(Clone, Debug, Serialize)]
pub struct PointReport {
    pub procedure: ProcedureId,
    pub magnitude: f64,
    pub tried: bool,
    #[serde(flatten)]
    pub(super) finding: Finding,
}

impl PointReport {
    /// How the law is broken there, where it is.
    pub fn how(&self) -> Option<LawBreach> {
        self.finding.how
    }
}

/// A point that was tried or skipped.
pub(super) struct PointResult {
    /// The index of the engine.
    pub(super) subject: usize,
    pub(super) law: &'static Law,
    pub(super) report: PointReport,
}

impl StressReport {
    /// Builds the report. Results must be sorted by engine and law.
    pub(super) fn new(case: &Case, subjects: &[Instrument], results: &[PointResult], record: &[KnownBreak]) -> Self {
        let mut laws = vec![];
        for of_law in results.chunk_by(|a, b| (a.subject, a.law.id) == (b.subject, b.law.id)) {
            let (engine, law) = (subjects[of_law[0].subject].engine.name(), of_law[0].law);
            let known: Vec<&KnownBreak> =
                record.iter().filter(|k| k.case == case.name && k.engine == engine && k.law == law.id).collect();
            let points = of_law.iter().map(|result| result.report.clone()).collect();
            laws.push(LawReport::new(engine, law, points, &known));
        }
        let engines = subjects.iter().map(|s| (s.engine.name(), s.version.text.clone())).collect();
        Self { case: case.name.clone(), engines, laws }
    }

    /// The laws that an engine breaks.
    pub fn broken_by<'a>(&'a self, engine: &'a str) -> impl Iterator<Item = &'a LawReport> {
        self.laws.iter().filter(move |l| l.engine == engine && l.how.is_some())
    }
}

/// The index of a magnitude in a law, from mild to extreme.
fn magnitude_index(law: &Law, magnitude: f64) -> usize {
    law.magnitudes.iter().position(|m| *m == magnitude).unwrap_or(0)
}

/// Whether an entry on record explains what a point shows: it breaks in the same way, no earlier,
/// and by no more than a margin.
fn explains(known: &KnownBreak, law: &Law, point: &PointReport) -> bool {
    point.finding.how == Some(known.how)
        && magnitude_index(law, point.magnitude) >= magnitude_index(law, known.from)
        && point.finding.deviation.is_none_or(|d| known.relative.is_some_and(|most| d <= MAX_RECORD_RATIO * most))
}

/// Whether an entry on record no longer breaks at its first magnitude. Noise as large as the entry
/// would hide that it does.
fn is_gone(known: &KnownBreak, points: &[PointReport]) -> bool {
    let mut at_first = points.iter().filter(|p| p.magnitude == known.from && p.tried).peekable();
    at_first.peek().is_some()
        && at_first.all(|point| {
            let Finding { how, is_refused, noise, .. } = point.finding;
            let is_visible = noise.is_none_or(|noise| known.relative.is_none_or(|most| noise < most));
            how.is_none() && !is_refused && is_visible
        })
}

impl LawReport {
    fn new(engine: EngineName, law: &'static Law, mut points: Vec<PointReport>, record: &[&KnownBreak]) -> Self {
        // Points are sorted by procedure; the first magnitude is the mildest of all procedures.
        points.sort_by_key(|p| magnitude_index(law, p.magnitude));
        let mut breaks_at = BTreeMap::new();
        for threshold in DEVIATION_THRESHOLDS {
            if let Some(first) = points.iter().find(|p| p.finding.exceeds(threshold)) {
                breaks_at.insert(threshold.to_string(), first.magnitude);
            }
        }
        let broken: Vec<&PointReport> = points.iter().filter(|p| p.finding.how.is_some()).collect();
        let is_known = broken.iter().all(|p| record.iter().any(|k| explains(k, law, p)));
        let known = record.iter().filter(|k| is_known && broken.iter().any(|p| explains(k, law, p)));
        let gone = record.iter().filter(|k| is_gone(k, &points));
        Self {
            engine,
            law: law.id.to_owned(),
            what: law.what,
            unit: law.unit,
            worst_deviation: points.iter().filter_map(|p| p.finding.deviation).reduce(f64::max),
            resolution: points.iter().filter_map(|p| p.finding.noise).reduce(f64::max),
            breaks_at,
            how: points.iter().filter_map(|p| p.finding.how).max(),
            refused_at: points.iter().find(|p| p.finding.is_refused).map(|p| p.magnitude),
            untried: points.iter().filter(|p| !p.tried).count(),
            known: known.map(|k| k.cause.clone()).collect(),
            gone: gone.map(|k| k.cause.clone()).collect(),
            points,
        }
    }
}
