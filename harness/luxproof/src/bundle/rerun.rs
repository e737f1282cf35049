//! Making a bundle's run again, and what of it comes out the same: reading by reading and verdict by verdict.

use std::collections::{HashMap, HashSet};
use std::path::PathBuf;

use schemars::JsonSchema;
use serde::Serialize;

use super::Opened;
use luxproof_audit::{AuditError, Options};
use luxproof_model::Tool;
use luxproof_model::{Basis, Comparison, MeterId, Quantity, Verdict};
use luxproof_model::{EngineName, EngineStatus, ReadingKey, Status};
use luxproof_model::{Exit, Report, Request};
use luxproof_trend::baseline::{Baseline, Entry, EntryChange, References, State, compare};

/// What came of making a run again.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Reproduction {
    pub title: String,
    /// SHA-256 of the bundle's list of hashes.
    pub bundle_sha256: String,
    pub files: usize,
    pub tool_then: Tool,
    pub tool_now: Tool,
    pub engines: Vec<EngineThen>,
    /// A row a case, procedure and engine that gave readings then.
    pub rows: Vec<Row>,
}

/// An engine of the bundle, and what is here by its name.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, JsonSchema)]
pub struct EngineThen {
    pub id: EngineName,
    pub version_then: Option<String>,
    pub version_now: Option<String>,
    /// Whether program, packages and libraries are the same to the byte.
    pub is_the_same: bool,
    /// Why it did not run.
    pub reason: Option<String>,
}

/// How the readings of an engine come out again.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Outcome {
    /// Every value and what is stated of its error, and every verdict.
    SameBytes,
    /// Other digits, which uncertainties leave open, and the same verdicts.
    Within,
    Differs,
    /// There are no readings now.
    NotRead,
}

#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Row {
    #[serde(flatten)]
    pub key: ReadingKey,
    pub outcome: Outcome,
    /// How many comparisons there were.
    pub comparisons: usize,
    /// Those that come out otherwise.
    pub differences: Vec<Difference>,
    /// What else is to be said: settings and versions that differ, a mean that moved.
    pub notes: Vec<String>,
}

/// A comparison that comes out otherwise.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Difference {
    pub meter: String,
    /// What it is held against.
    pub against: String,
    pub then: Option<f64>,
    pub now: Option<f64>,
    pub unit: &'static str,
    pub verdict_then: Verdict,
    /// Null where there is none.
    pub verdict_now: Option<Verdict>,
}

impl Opened {
    /// Runs the specs as they were run, and compares.
    pub fn again(&self, options: Options<'_>) -> Result<(Reproduction, Report), AuditError> {
        let request = Request { engines: self.engines(), ..self.lock.request.clone() };
        let specs: Vec<PathBuf> = self.specs();
        let report = luxproof_audit::run(&specs, &options.with_request(&request))?;
        Ok((self.against(&report), report))
    }

    /// Those that were named, or else those that gave readings: what was not there then is not asked now.
    fn engines(&self) -> Vec<String> {
        let named = &self.lock.request.engines;
        if !named.is_empty() {
            return named.clone();
        }
        let engines = self.lock.engines.iter();
        let with_run = engines.filter(|engine| matches!(engine.status, Status::Ran | Status::Failed));
        with_run.map(|engine| engine.id.to_string()).collect()
    }

    fn against(&self, now: &Report) -> Reproduction {
        let [before, after] = [&self.report, now].map(|report| Baseline::whole(report).entries);
        let changes = compare(&before, &after, &References::of_report(now)).entries;
        let comparisons = Paired::of(&self.report, now);
        let changes: HashMap<&ReadingKey, &EntryChange> = changes.iter().map(|change| (&change.key, change)).collect();
        let after: HashMap<&ReadingKey, &Entry> = after.iter().map(|entry| (&entry.key, entry)).collect();
        let failures: HashMap<&ReadingKey, &String> =
            now.recordings.iter().filter_map(|r| Some((&r.key, r.failure.as_ref()?))).collect();
        let rows = before.iter().filter(|entry| !entry.readings.is_empty()).map(|then| {
            let (now, change) = (after.get(&then.key).copied(), changes.get(&then.key).copied());
            row(then, now, change, failures.get(&then.key).copied().cloned(), &comparisons)
        });
        Reproduction {
            title: self.report.spec.title.clone(),
            bundle_sha256: self.sha256.clone(),
            files: self.files,
            tool_then: self.lock.tool.clone(),
            tool_now: crate::running_tool(),
            engines: self
                .lock
                .engines
                .iter()
                .filter(|then| then.version.is_some())
                .map(|then| engine(then, now))
                .collect(),
            rows: rows.collect(),
        }
    }
}

fn engine(then: &EngineStatus, now: &Report) -> EngineThen {
    let found = now.engines.iter().find(|engine| engine.id == then.id);
    let fingerprint = found.and_then(|engine| engine.fingerprint.as_ref());
    EngineThen {
        id: then.id.clone(),
        version_then: then.version.clone(),
        version_now: found.and_then(|engine| engine.version.clone()),
        is_the_same: found.is_some_and(|engine| engine.version == then.version)
            && fingerprint == then.fingerprint.as_ref(),
        reason: found.map_or_else(|| Some("not asked".to_owned()), |engine| engine.reason.clone()),
    }
}

/// The comparisons of then, by what was read, each with the one of now.
struct Paired<'a>(HashMap<&'a ReadingKey, Vec<(&'a Comparison, Option<&'a Comparison>)>>);

/// What makes two comparisons of different runs the same one.
fn place(c: &Comparison) -> (&ReadingKey, &MeterId, Quantity, Option<(Basis, &str)>) {
    (&c.key, &c.meter, c.quantity, c.reference.as_ref().map(|r| (r.basis, r.source.as_str())))
}

impl<'a> Paired<'a> {
    fn of(then: &'a Report, now: &'a Report) -> Self {
        let now: HashMap<_, &Comparison> = now.comparisons.iter().map(|c| (place(c), c)).collect();
        let mut pairs: HashMap<&ReadingKey, Vec<_>> = HashMap::new();
        for c in &then.comparisons {
            pairs.entry(&c.key).or_default().push((c, now.get(&place(c)).copied()));
        }
        Self(pairs)
    }
}

fn row(
    then: &Entry,
    now: Option<&Entry>,
    change: Option<&EntryChange>,
    failure: Option<String>,
    comparisons: &Paired<'_>,
) -> Row {
    let pairs = comparisons.0.get(&then.key).map_or(&[][..], Vec::as_slice);
    let row = Row {
        key: then.key.clone(),
        outcome: Outcome::NotRead,
        comparisons: pairs.len(),
        differences: vec![],
        notes: vec![],
    };
    let (Some(now), Some(change)) = (now.filter(|entry| !entry.readings.is_empty()), change) else {
        return Row { notes: failure.into_iter().collect(), ..row };
    };
    let moved: HashSet<(&MeterId, Quantity)> =
        change.meters.iter().filter(|m| m.significant).map(|m| (&m.meter, m.quantity)).collect();
    let differing = pairs
        .iter()
        .filter(|(then, now)| moved.contains(&(&then.meter, then.quantity)) || !has_same_verdict(then, *now));
    let differences: Vec<Difference> = differing.map(|(then, now)| Difference::of(then, *now)).collect();
    let is_same =
        then.readings == now.readings && pairs.iter().all(|(c, now)| now.is_some_and(|now| now.verdict == c.verdict));
    let outcome = match change.state {
        State::Unchanged | State::New if !differences.is_empty() => Outcome::Differs,
        State::Unchanged | State::New if is_same => Outcome::SameBytes,
        State::Unchanged | State::New => Outcome::Within,
        State::Shifted | State::Changed | State::Improved | State::Vanished | State::Refused => Outcome::Differs,
    };
    let mean = change.mean.filter(|_| change.state == State::Shifted).map(|mean| format!("mean {mean}"));
    Row { outcome, differences, notes: mean.into_iter().chain(change.notes.iter().cloned()).collect(), ..row }
}

/// Whether two comparisons have one verdict; an undecided one fits every other.
fn has_same_verdict(then: &Comparison, now: Option<&Comparison>) -> bool {
    now.is_some_and(|now| now.verdict == then.verdict || [now.verdict, then.verdict].contains(&Verdict::Undecided))
}

impl Difference {
    fn of(then: &Comparison, now: Option<&Comparison>) -> Self {
        Self {
            meter: then.meter.to_string(),
            against: then.reference.as_ref().map_or_else(|| "nothing".to_owned(), |r| r.source.clone()),
            then: then.value,
            now: now.and_then(|c| c.value),
            unit: then.quantity.unit(),
            verdict_then: then.verdict,
            verdict_now: now.map(|c| c.verdict),
        }
    }
}

impl Reproduction {
    pub fn count(&self, outcome: Outcome) -> usize {
        self.rows.iter().filter(|row| row.outcome == outcome).count()
    }

    /// 0 where everything is reproduced, 1 where something differs, 3 where an engine gave no reading.
    pub fn exit(&self) -> Exit {
        let worst = self.rows.iter().map(|row| row.outcome).max();
        match worst {
            None | Some(Outcome::NotRead) => Exit::Engine,
            Some(Outcome::Differs) => Exit::Failed,
            Some(Outcome::Within | Outcome::SameBytes) => Exit::Passed,
        }
    }
}
