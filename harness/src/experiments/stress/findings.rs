//! What stress found: a finding a point, a line an engine and law.

use std::collections::BTreeMap;

use serde::Serialize;

use crate::experiments::deviation::Compared;
use crate::judge::KnownBreak;
use crate::laws::Law;
use crate::measure::{Failure, FailureKind, Instrument};
use crate::record::{EngineName, ProcedureId};
use crate::spec::Case;

/// The deviations whose first magnitude is told.
pub(super) const THRESHOLDS: [f64; 3] = [1e-3, 1e-2, 0.1];

/// How much larger than on record a deviation may be and still be the known one.
const MARGIN: f64 = 1.25;

/// How a law breaks.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum How {
    /// The readings are off.
    Drift,
    /// More than half of the light is gone, or readings are, without an error.
    SilentLoss,
    /// What is read is no number.
    Nan,
    Crash,
    Hang,
}

impl How {
    pub const fn name(self) -> &'static str {
        match self {
            Self::Drift => "drift",
            Self::SilentLoss => "silent_loss",
            Self::Nan => "nan",
            Self::Crash => "crash",
            Self::Hang => "hang",
        }
    }
}

/// What one point shows; nothing where it was not tried.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Finding {
    /// The largest deviation beyond noise, relative; `None` where nothing was read.
    pub deviation: Option<f64>,
    pub noise: Option<f64>,
    pub how: Option<How>,
    /// Whether the engine said itself that it cannot.
    #[serde(rename = "refused")]
    pub is_refused: bool,
    /// Why nothing was read or compared.
    pub text: Option<String>,
    /// Whether neither side is random.
    #[serde(skip)]
    pub is_exact: bool,
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
            FailureKind::Declined | FailureKind::Refused | FailureKind::Interrupted | FailureKind::TimeUp => None,
            FailureKind::Nan => Some(How::Nan),
            FailureKind::Crash => Some(How::Crash),
            FailureKind::Hang => Some(How::Hang),
            FailureKind::SilentLoss => Some(How::SilentLoss),
        };
        let is_refused = matches!(failure.kind, FailureKind::Declined | FailureKind::Refused);
        Self { how, text: Some(failure.text.clone()), is_refused, ..Self::default() }
    }

    /// The changed job was read, what it is held against was not: nothing is known.
    pub(super) fn without_base(failure: &Failure) -> Self {
        let text = Some(format!("nothing to hold it against: {}", failure.text));
        Self { text, is_refused: true, ..Self::default() }
    }
}

#[derive(Clone, Debug, Serialize)]
pub struct StressReport {
    pub case: String,
    pub engines: BTreeMap<EngineName, String>,
    pub laws: Vec<LawReport>,
}

/// How one engine keeps one law.
#[derive(Clone, Debug, Serialize)]
pub struct LawReport {
    pub engine: EngineName,
    pub law: String,
    pub what: &'static str,
    /// What the magnitudes are.
    pub unit: &'static str,
    /// The largest deviation beyond the noise stated, relative; null where nothing was read.
    pub worst_deviation: Option<f64>,
    /// The largest noise: smaller deviations could not be seen everywhere.
    pub resolution: Option<f64>,
    /// The first magnitude tried at which the deviation exceeds .1, 1 and 10 %, or at which it breaks.
    pub breaks_at: BTreeMap<String, f64>,
    /// The worst way in which it breaks.
    pub how: Option<How>,
    /// The first magnitude that the engine refuses.
    pub refused_at: Option<f64>,
    /// Points that time did not suffice for, or that lie beyond one that hung.
    pub untried: usize,
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
    pub found: Finding,
}

/// A point's engine, law, procedure, step and finding.
pub(super) type Found = (usize, &'static Law, ProcedureId, usize, Option<Finding>);

impl StressReport {
    pub(super) fn new(case: &Case, subjects: &[Instrument], found: Vec<Found>, record: &[KnownBreak]) -> Self {
        let engines = subjects.iter().map(|s| (s.engine.name(), s.version.0.clone())).collect();
        let mut laws: Vec<LawReport> = vec![];
        for (subject, law, procedure, step, finding) in found {
            let engine = subjects[subject].engine.name();
            let same = laws.iter().position(|l| l.engine == engine && l.law == law.id);
            let k = same.unwrap_or_else(|| {
                laws.push(LawReport::empty(engine, law));
                laws.len() - 1
            });
            let (magnitude, tried) = (law.magnitudes[step], finding.is_some());
            laws[k].points.push(PointReport { procedure, magnitude, tried, found: finding.unwrap_or_default() });
        }
        laws.iter_mut().for_each(LawReport::conclude);
        for law in &mut laws {
            let of_law = record.iter().filter(|k| k.case == case.name && k.engine == law.engine && k.law == law.law);
            law.look_up(&of_law.collect::<Vec<_>>());
        }
        Self { case: case.name.clone(), engines, laws }
    }

    pub fn broken_by<'a>(&'a self, engine: &'a str) -> impl Iterator<Item = &'a LawReport> {
        self.laws.iter().filter(move |l| l.engine == engine && l.how.is_some())
    }
}

impl LawReport {
    fn empty(engine: EngineName, law: &'static Law) -> Self {
        Self {
            engine,
            law: law.id.to_owned(),
            what: law.what,
            unit: law.unit,
            worst_deviation: None,
            resolution: None,
            breaks_at: BTreeMap::new(),
            how: None,
            refused_at: None,
            untried: 0,
            points: vec![],
            known: vec![],
            gone: vec![],
        }
    }

    fn conclude(&mut self) {
        // Points come procedure by procedure; the first magnitude is the mildest over all of them.
        let rising = |p: &PointReport| find_step(&self.law, p.magnitude);
        self.points.sort_by_key(rising);
        for point in &self.points {
            self.worst_deviation = [self.worst_deviation, point.found.deviation].into_iter().flatten().reduce(f64::max);
            self.resolution = [self.resolution, point.found.noise].into_iter().flatten().reduce(f64::max);
            self.how = self.how.max(point.found.how);
            self.untried += usize::from(!point.tried);
            if point.found.is_refused && self.refused_at.is_none() {
                self.refused_at = Some(point.magnitude);
            }
            for threshold in THRESHOLDS {
                let fails = point.found.how.is_some_and(|h| h != How::Drift && point.found.deviation.is_none());
                if fails || point.found.deviation.is_some_and(|d| d >= threshold) {
                    self.breaks_at.entry(threshold.to_string()).or_insert(point.magnitude);
                }
            }
        }
    }

    /// Holds what breaks against what is on record of this law.
    fn look_up(&mut self, record: &[&KnownBreak]) {
        let explains = |k: &&KnownBreak, p: &PointReport| {
            p.found.how.is_some_and(|how| how.name() == k.how)
                && find_step(&self.law, p.magnitude) >= find_step(&self.law, k.from)
                && p.found.deviation.is_none_or(|d| k.relative.is_some_and(|most| d <= MARGIN * most))
        };
        let broken = || self.points.iter().filter(|p| p.found.how.is_some());
        let cause = |k: &&&KnownBreak| k.cause.clone();
        if broken().all(|p| record.iter().any(|k| explains(k, p))) {
            self.known = record.iter().filter(|k| broken().any(|p| explains(k, p))).map(|k| cause(&k)).collect();
        }
        let is_gone = |k: &&&KnownBreak| {
            // Noise as large as what is on record hides it.
            let is_fine = |p: &PointReport| {
                p.found.how.is_none()
                    && !p.found.is_refused
                    && p.found.noise.is_none_or(|noise| k.relative.is_none_or(|most| noise < most))
            };
            let mut there = self.points.iter().filter(|p| p.magnitude == k.from && p.tried).peekable();
            there.peek().is_some() && there.all(is_fine)
        };
        self.gone = record.iter().filter(is_gone).map(|k| cause(&k)).collect();
    }
}

fn find_step(law: &str, magnitude: f64) -> usize {
    let law = crate::laws::find(law);
    law.and_then(|l| l.magnitudes.iter().position(|m| *m == magnitude)).unwrap_or(0)
}
