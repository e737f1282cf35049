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
    /// It ends with an error.
    Crash,
    /// It does not end.
    Hang,
}

impl How {
    /// Its name in reports.
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

/// What one point shows.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Finding {
    /// The largest deviation beyond noise, relative; `None` where nothing was read.
    pub(super) deviation: Option<f64>,
    /// The noise beside it.
    pub(super) noise: Option<f64>,
    /// How it breaks, if it does.
    pub(super) how: Option<How>,
    /// Why nothing was read or compared.
    pub(super) text: Option<String>,
    /// Whether the engine said itself that it cannot.
    pub(super) is_refused: bool,
    /// Whether neither side is random.
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
        let is_exact = found.is_exact;
        Self { deviation, noise: Some(found.noise), how, text: None, is_refused: false, is_exact }
    }

    pub(super) fn failed(failure: &Failure) -> Self {
        let how = match failure.kind {
            FailureKind::Declined | FailureKind::Refused | FailureKind::Interrupted | FailureKind::TimeUp => None,
            FailureKind::Nan => Some(How::Nan),
            FailureKind::Crash => Some(How::Crash),
            FailureKind::Hang => Some(How::Hang),
            FailureKind::SilentLoss => Some(How::SilentLoss),
        };
        let text = Some(failure.text.clone());
        let is_refused = matches!(failure.kind, FailureKind::Declined | FailureKind::Refused);
        Self { deviation: None, noise: None, how, text, is_refused, is_exact: true }
    }

    /// The changed job was read, what it is held against was not: nothing is known.
    pub(super) fn without_base(failure: &Failure) -> Self {
        let text = Some(format!("nothing to hold it against: {}", failure.text));
        Self { deviation: None, noise: None, how: None, text, is_refused: true, is_exact: true }
    }
}

/// Everything that stress found with one case.
#[derive(Clone, Debug, Serialize)]
pub struct StressReport {
    pub case: String,
    /// Engines with their versions.
    pub engines: BTreeMap<EngineName, String>,
    /// One an engine and law.
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
    /// Every point, from mild to extreme.
    pub points: Vec<PointReport>,
    /// The causes on record, where all that breaks is known.
    pub known: Vec<String>,
    /// The causes on record of what does not break any more.
    pub gone: Vec<String>,
}

/// What one point shows.
#[derive(Clone, Debug, Serialize)]
pub struct PointReport {
    pub procedure: ProcedureId,
    pub magnitude: f64,
    pub tried: bool,
    /// Deviation beyond noise, relative.
    pub deviation: Option<f64>,
    /// Noise, relative.
    pub noise: Option<f64>,
    /// How it breaks, if it does.
    pub how: Option<How>,
    /// Whether the engine refuses.
    pub refused: bool,
    /// Why nothing was read.
    pub text: Option<String>,
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
            laws[k].points.push(PointReport::new(procedure, law.magnitudes[step], finding));
        }
        laws.iter_mut().for_each(LawReport::conclude);
        for law in &mut laws {
            let of_law = record.iter().filter(|k| k.case == case.name && k.engine == law.engine && k.law == law.law);
            law.look_up(&of_law.collect::<Vec<_>>());
        }
        Self { case: case.name.clone(), engines, laws }
    }

    /// Laws that an engine breaks.
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
            self.worst_deviation = [self.worst_deviation, point.deviation].into_iter().flatten().reduce(f64::max);
            self.resolution = [self.resolution, point.noise].into_iter().flatten().reduce(f64::max);
            self.how = self.how.max(point.how);
            self.untried += usize::from(!point.tried);
            if point.refused && self.refused_at.is_none() {
                self.refused_at = Some(point.magnitude);
            }
            for threshold in THRESHOLDS {
                let fails = point.how.is_some_and(|h| h != How::Drift && point.deviation.is_none());
                if fails || point.deviation.is_some_and(|d| d >= threshold) {
                    self.breaks_at.entry(threshold.to_string()).or_insert(point.magnitude);
                }
            }
        }
    }
}

impl LawReport {
    /// Holds what breaks against what is on record of this law.
    fn look_up(&mut self, record: &[&KnownBreak]) {
        let explains = |k: &&KnownBreak, p: &PointReport| {
            p.how.is_some_and(|how| how.name() == k.how)
                && find_step(&self.law, p.magnitude) >= find_step(&self.law, k.from)
                && p.deviation.is_none_or(|d| k.relative.is_some_and(|most| d <= MARGIN * most))
        };
        let broken = || self.points.iter().filter(|p| p.how.is_some());
        let cause = |k: &&&KnownBreak| k.cause.clone();
        if broken().all(|p| record.iter().any(|k| explains(k, p))) {
            self.known = record.iter().filter(|k| broken().any(|p| explains(k, p))).map(|k| cause(&k)).collect();
        }
        let is_gone = |k: &&&KnownBreak| {
            // Noise as large as what is on record hides it.
            let is_fine = |p: &PointReport| {
                p.how.is_none() && !p.refused && p.noise.is_none_or(|noise| k.relative.is_none_or(|most| noise < most))
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

impl PointReport {
    fn new(procedure: ProcedureId, magnitude: f64, finding: Option<Finding>) -> Self {
        let tried = finding.is_some();
        let f = finding.unwrap_or(Finding {
            deviation: None,
            noise: None,
            how: None,
            text: None,
            is_refused: false,
            is_exact: true,
        });
        Self {
            procedure,
            magnitude,
            tried,
            deviation: f.deviation,
            noise: f.noise,
            how: f.how,
            refused: f.is_refused,
            text: f.text,
        }
    }
}
