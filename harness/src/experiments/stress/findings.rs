//! What stress found: a finding a point, a line an engine and law.

use std::collections::BTreeMap;

use serde::Serialize;

use crate::experiments::deviation::Compared;
use crate::judge::{How, KnownBreak};
use crate::laws::Law;
use crate::measure::{Failure, Instrument};
use crate::record::{EngineName, FailureKind, ProcedureId};
use crate::spec::Case;

/// The deviations whose first magnitude is told.
pub(super) const THRESHOLDS: [f64; 3] = [1e-3, 1e-2, 0.1];

/// How much larger than on record a deviation may be and still be the known one.
const MARGIN: f64 = 1.25;

#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub(super) struct Finding {
    /// The largest deviation beyond noise, relative; `None` where nothing was read.
    pub(super) deviation: Option<f64>,
    pub(super) noise: Option<f64>,
    pub(super) how: Option<How>,
    /// Whether the engine said itself that it cannot.
    #[serde(rename = "refused")]
    pub(super) is_refused: bool,
    /// Why nothing was read or compared.
    pub(super) text: Option<String>,
    /// Whether neither side is random.
    #[serde(skip)]
    pub(super) is_exact: bool,
}

impl Finding {
    pub(super) fn of(found: &Compared) -> Self {
        let off = found.beyond >= THRESHOLDS[0];
        let how = if found.beyond.is_infinite() {
            Some(How::Nan)
        } else if off && found.is_lost {
            Some(How::SilentLoss)
        } else {
            off.then_some(How::Drift)
        };
        let deviation = Some(found.beyond).filter(|d| d.is_finite());
        Self { deviation, noise: Some(found.noise), how, is_exact: found.is_exact, ..Self::default() }
    }

    pub(super) fn failed(failure: &Failure) -> Self {
        let how = match failure.kind {
            FailureKind::Declined
            | FailureKind::Refused
            | FailureKind::Interrupted
            | FailureKind::TimeUp
            | FailureKind::Unread => None,
            FailureKind::Nan => Some(How::Nan),
            FailureKind::Crash => Some(How::Crash),
            FailureKind::Hang => Some(How::Hang),
            FailureKind::SilentLoss | FailureKind::Garbled => Some(How::SilentLoss),
        };
        let text = Some(failure.text.clone());
        let is_refused = matches!(failure.kind, FailureKind::Declined | FailureKind::Refused);
        Self { how, is_refused, text, ..Self::default() }
    }

    /// The changed job was read, what it is held against was not: nothing is known.
    pub(super) fn without_base(failure: &Failure) -> Self {
        let text = Some(format!("nothing to hold it against: {}", failure.text));
        Self { is_refused: true, text, ..Self::default() }
    }

    fn exceeds(&self, threshold: f64) -> bool {
        self.deviation.map_or(self.how.is_some_and(|h| h != How::Drift), |d| d >= threshold)
    }
}

#[derive(Clone, Debug, Serialize)]
pub struct StressReport {
    pub case: String,
    pub engines: BTreeMap<EngineName, String>,
    pub laws: Vec<LawReport>,
}

#[derive(Clone, Debug, Serialize)]
pub struct LawReport {
    pub engine: EngineName,
    pub law: String,
    pub what: &'static str,
    pub unit: &'static str,
    /// The largest deviation beyond the noise stated, relative; null where nothing was read.
    pub worst_deviation: Option<f64>,
    /// The largest noise: smaller deviations could not be seen everywhere.
    pub resolution: Option<f64>,
    /// The first magnitude tried at which the deviation exceeds .1, 1 and 10 %, or at which it breaks.
    pub breaks_at: BTreeMap<String, f64>,
    pub how: Option<How>,
    pub refused_at: Option<f64>,
    /// Points that time did not suffice for, or that lie beyond one that hung.
    pub untried: usize,
    /// Every point, from mild to extreme.
    pub points: Vec<PointReport>,
    /// The causes on record, where all that breaks is known.
    pub known: Vec<String>,
    /// The causes on record of what does not break any more.
    pub gone: Vec<String>,
}

#[derive(Clone, Debug, Serialize)]
pub struct PointReport {
    pub procedure: ProcedureId,
    pub magnitude: f64,
    pub tried: bool,
    #[serde(flatten)]
    pub(super) finding: Finding,
}

impl PointReport {
    /// How the law is broken there, if it is.
    pub fn how(&self) -> Option<How> {
        self.finding.how
    }
}

pub(super) type Found = (usize, &'static Law, PointReport);

impl StressReport {
    /// Points come engine by engine, and law by law.
    pub(super) fn new(case: &Case, subjects: &[Instrument], found: &[Found], record: &[KnownBreak]) -> Self {
        let report = |of_law: &[Found]| {
            let (engine, law) = (subjects[of_law[0].0].engine.name(), of_law[0].1);
            let known = record.iter().filter(|k| k.case == case.name && k.engine == engine && k.law == law.id);
            let points = of_law.iter().map(|(.., point)| point.clone()).collect();
            LawReport::new(engine.clone(), law, points, &known.collect::<Vec<_>>())
        };
        let alike = |a: &Found, b: &Found| (a.0, a.1.id) == (b.0, b.1.id);
        let engines = subjects.iter().map(|s| (s.engine.name(), s.version.text.clone())).collect();
        Self { case: case.name.clone(), engines, laws: found.chunk_by(alike).map(report).collect() }
    }

    pub fn broken_by<'a>(&'a self, engine: &'a str) -> impl Iterator<Item = &'a LawReport> {
        self.laws.iter().filter(move |l| l.engine == engine && l.how.is_some())
    }
}

impl LawReport {
    fn new(engine: EngineName, law: &'static Law, mut points: Vec<PointReport>, record: &[&KnownBreak]) -> Self {
        let step = |magnitude: f64| law.magnitudes.iter().position(|m| *m == magnitude).unwrap_or(0);
        // Points come procedure by procedure; the first magnitude is the mildest over all of them.
        points.sort_by_key(|p| step(p.magnitude));
        let findings = || points.iter().map(|p| &p.finding);
        let breaks = |threshold: f64| {
            let at = points.iter().find(|p| p.finding.exceeds(threshold))?;
            Some((threshold.to_string(), at.magnitude))
        };
        let explains = |k: &KnownBreak, p: &PointReport| {
            p.finding.how == Some(k.how)
                && step(p.magnitude) >= step(k.from)
                && p.finding.deviation.is_none_or(|d| k.relative.is_some_and(|most| d <= MARGIN * most))
        };
        let broken = || points.iter().filter(|p| p.finding.how.is_some());
        let is_known = broken().all(|p| record.iter().any(|k| explains(k, p)));
        let is_gone = |k: &KnownBreak| {
            // Noise as large as what is on record hides it.
            let is_fine = |p: &PointReport| {
                let Finding { how, is_refused, noise, .. } = p.finding;
                how.is_none() && !is_refused && noise.is_none_or(|noise| k.relative.is_none_or(|most| noise < most))
            };
            let mut there = points.iter().filter(|p| p.magnitude == k.from && p.tried).peekable();
            there.peek().is_some() && there.all(is_fine)
        };
        let causes = |is_meant: &dyn Fn(&KnownBreak) -> bool| {
            record.iter().filter(|k| is_meant(k)).map(|k| k.cause.clone()).collect::<Vec<_>>()
        };
        Self {
            engine,
            law: law.id.to_owned(),
            what: law.what,
            unit: law.unit,
            worst_deviation: findings().filter_map(|f| f.deviation).reduce(f64::max),
            resolution: findings().filter_map(|f| f.noise).reduce(f64::max),
            breaks_at: THRESHOLDS.into_iter().filter_map(breaks).collect(),
            how: findings().filter_map(|f| f.how).max(),
            refused_at: points.iter().find(|p| p.finding.is_refused).map(|p| p.magnitude),
            untried: points.iter().filter(|p| !p.tried).count(),
            known: causes(&|k| is_known && broken().any(|p| explains(k, p))),
            gone: causes(&is_gone),
            points,
        }
    }
}
