//! Baselines: readings that somebody accepted for a reason, kept in a file that reads well in a review of changes.
//!
//! A baseline holds for one spec, engine, version, luminaire model, light and method; anything else is refused, never
//! silently reused. It lies in an envelope: what was edited by hand is nothing that anybody accepted. Reading tests after Mitsuba 3's `test_renders.py`: a missing reference fails and leaves a candidate.

mod changes;
mod review;

use std::collections::{BTreeSet, HashSet};
use std::path::{Path, PathBuf};

use itertools::Itertools;
use serde::{Deserialize, Serialize};

use crate::record::{Light, MeterId, Method, Reading, ReadingKey, Recording};
use crate::report::{Report, SpecRecord};
use crate::system::envelope::{self, Refusal, Schema};
use crate::system::files::{self, FileError};

pub use changes::{Changes, Comparability, EntryChange, MeanShift, MeterChange, State, compare};
pub use review::{Decision, review};

const SCHEMA: Schema = Schema { of: "baseline", version: 2 };

#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Baseline {
    /// Sorted by key.
    pub entries: Vec<Entry>,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Entry {
    #[serde(flatten)]
    pub key: ReadingKey,
    pub version: String,
    pub model: String,
    pub light: Light,
    /// SHA-256 of the spec and of every file that it names.
    pub input_sha256: String,
    /// What the engine did: another run of the same instrument does the same.
    pub method: Method,
    /// When it was accepted (RFC 3339, UTC); empty in a candidate.
    pub accepted: String,
    /// Why it was accepted; empty in a candidate, which is refused as a baseline.
    pub reason: String,
    pub readings: Vec<Reading>,
}

#[derive(Debug, thiserror::Error)]
pub enum BaselineError {
    #[error(transparent)]
    File(#[from] FileError),
    #[error("{path} {why}; {ANEW}")]
    Refused { path: String, why: Refusal },
    #[error("{path}: {key}: a negative or infinite reading, or none at all, is no baseline; {ANEW}")]
    Unsound { path: String, key: ReadingKey },
    #[error("{path}: {key}{} stands there twice; {ANEW}", meter.as_ref().map(|m| format!(" at {m}")).unwrap_or_default())]
    Twice { path: String, key: ReadingKey, meter: Option<MeterId> },
    #[error("{path}: {key} was accepted for no reason; review it with `luxproof accept`")]
    NotAccepted { path: String, key: ReadingKey },
    #[error("{path} is about {found}, and this run about {wanted}; name the baseline of this spec")]
    Elsewhere { path: String, found: String, wanted: String },
}

/// What to do about a file that is none.
const ANEW: &str = "restore it, or review a run anew with `luxproof accept`, which replaces it";

impl Entry {
    fn of(report: &Report, recording: &Recording) -> Self {
        let mine = report.readings.iter().filter(|r| r.key == recording.key);
        Self {
            key: recording.key.clone(),
            version: recording.version.clone(),
            model: recording.model.clone(),
            light: recording.light,
            input_sha256: recording.input_sha256.clone(),
            method: recording.method.clone(),
            accepted: String::new(),
            reason: String::new(),
            // What is left of an engine that failed is not to be expected again.
            readings: mine.filter(|_| recording.failure.is_none()).map(|r| r.reading.clone()).collect(),
        }
    }

    /// What it says of a setting that makes readings comparable.
    fn said(&self, key: &str) -> Option<&str> {
        self.method.get(key).map(String::as_str)
    }

    /// Whether it may become a baseline: there are readings, and all of them are measurements.
    pub fn is_sound(&self) -> bool {
        !self.readings.is_empty() && self.readings.iter().all(|r| r.value.is_finite() && r.value >= 0.0)
    }
}

impl Baseline {
    pub fn candidate(report: &Report) -> Self {
        // Scenes of known answer need nobody's acceptance.
        let entries = Self::whole(report).entries.into_iter().filter(|e| !e.key.procedure.is_known()).collect();
        Self { entries }
    }

    /// The same with scenes of known answer.
    pub fn whole(report: &Report) -> Self {
        let all = report.recordings.iter().map(|r| Entry::of(report, r));
        Self { entries: all.sorted_by(|a, b| a.key.cmp(&b.key)).collect() }
    }

    pub fn read(path: &Path) -> Result<Self, BaselineError> {
        let name = || path.display().to_string();
        let text = files::read_kept(path)?;
        let opened = envelope::open(SCHEMA, &text).and_then(|sealed| sealed.about_what(Self::subject));
        let baseline: Self = opened.map_err(|why| BaselineError::Refused { path: name(), why })?;
        baseline.check(&name())?;
        Ok(baseline)
    }

    fn check(&self, path: &str) -> Result<(), BaselineError> {
        let mut keys = HashSet::new();
        for entry in &self.entries {
            let (path, key) = (path.to_owned(), entry.key.clone());
            if entry.reason.trim().is_empty() {
                return Err(BaselineError::NotAccepted { path, key });
            }
            if !entry.is_sound() {
                return Err(BaselineError::Unsound { path, key });
            }
            if !keys.insert(&entry.key) {
                return Err(BaselineError::Twice { path, key, meter: None });
            }
            let mut read = HashSet::new();
            if let Some(again) = entry.readings.iter().find(|r| !read.insert((&r.meter, r.quantity))) {
                return Err(BaselineError::Twice { path, key, meter: Some(again.meter.clone()) });
            }
        }
        Ok(())
    }

    /// The baseline of a run of these cases: one about none of their specs is another's.
    pub fn of_run<'a>(path: &Path, cases: impl IntoIterator<Item = &'a str>) -> Result<Self, BaselineError> {
        let baseline = Self::read(path)?;
        let wanted: BTreeSet<&str> = cases.into_iter().map(spec).collect();
        if baseline.entries.is_empty() || baseline.specs().any(|spec| wanted.contains(spec)) {
            return Ok(baseline);
        }
        let (found, wanted) = (baseline.subject(), wanted.into_iter().join(", "));
        Err(BaselineError::Elsewhere { path: path.display().to_string(), found, wanted })
    }

    fn specs(&self) -> impl Iterator<Item = &str> {
        self.entries.iter().map(|entry| spec(&entry.key.case)).sorted_unstable().dedup()
    }

    /// What it is about: its specs.
    fn subject(&self) -> String {
        self.specs().join(", ")
    }

    pub fn write(&self, path: &Path) -> Result<(), BaselineError> {
        let fail = |source| FileError::of(path, source);
        let text = self.text().map_err(|e| fail(e.into()))?;
        Ok(files::replace_shared(path, text.as_bytes()).map_err(fail)?)
    }

    fn text(&self) -> Result<String, serde_json::Error> {
        let mut entries = vec![];
        for entry in &self.entries {
            let mut lines = vec![];
            let value = serde_json::to_value(entry)?;
            for (key, value) in value.as_object().into_iter().flatten().filter(|(key, _)| *key != "readings") {
                lines.push(format!("      {}: {value}", serde_json::Value::from(key.as_str())));
            }
            let reading = |r| serde_json::to_string(r).map(|r| format!("        {r}"));
            let readings: Vec<String> = entry.readings.iter().map(reading).collect::<Result<_, _>>()?;
            lines.push(format!("      \"readings\": [\n{}\n      ]", readings.join(",\n")));
            entries.push(format!("    {{\n{}\n    }}", lines.join(",\n")));
        }
        let body = format!("{{\n  \"entries\": [\n{}\n  ]\n}}", entries.join(",\n"));
        Ok(envelope::seal_text(SCHEMA, &self.subject(), body)? + "\n")
    }

    pub fn accept(&mut self, accepted: Vec<Entry>) {
        for entry in accepted {
            self.entries.retain(|old| old.key != entry.key);
            self.entries.push(entry);
        }
        self.entries.sort_by(|a, b| a.key.cmp(&b.key));
    }

    /// The file that a path names: itself, or in a folder the one of what was run.
    pub fn place(path: &Path, run: &SpecRecord) -> PathBuf {
        if path.extension().is_some_and(|e| e == "json") && !path.is_dir() {
            return path.to_owned();
        }
        let spec = run.path.split_whitespace().next().map(Path::new);
        let stem = spec.and_then(Path::file_stem).and_then(|s| s.to_str()).unwrap_or("suite");
        path.join(format!("{stem}.json"))
    }
}

/// The spec that a case is of.
fn spec(case: &str) -> &str {
    case.split('/').next().unwrap_or(case)
}

#[cfg(test)]
mod tests;
