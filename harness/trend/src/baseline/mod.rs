//! Baselines: readings that were accepted for a reason, in a file that is easy to review.
//!
//! A baseline compares the readings of one task over versions and settings of an engine; another task is refused. Its envelope
//! reveals edits by hand, which nothing has accepted. As in Mitsuba 3's `test_renders.py`, a missing reference fails and leaves a
//! candidate.

mod changes;
mod review;

use std::collections::{BTreeSet, HashMap, HashSet};
use std::path::{Path, PathBuf};

use itertools::Itertools;
use serde::{Deserialize, Serialize};

use luxproof_model::{Light, MeterId, Method, Reading, ReadingKey, Recording, Role};
use luxproof_model::{Report, SpecRecord};
use luxproof_process::envelope::{self, Refusal, Schema};
use luxproof_process::files::{self, FileError};

pub use changes::{Changes, EntryChange, MeanShift, MeterChange, References, State, compare};
pub use review::{Decision, Review};

const SCHEMA: Schema = Schema { of: "baseline", version: 3 };

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
    /// SHA-256 of the task: scene, light and points, whatever they are called.
    pub content_sha256: String,
    /// The engine's settings and steps.
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
    #[error("{path} {why}; {REMEDY}")]
    Refused { path: String, why: Refusal },
    #[error("{path}: {key}: a negative or infinite reading, or none at all, is no baseline; {REMEDY}")]
    Unsound { path: String, key: ReadingKey },
    #[error("{path}: {key}{} stands there twice; {REMEDY}", meter.as_ref().map(|m| format!(" at {m}")).unwrap_or_default())]
    Twice { path: String, key: ReadingKey, meter: Option<MeterId> },
    #[error("{path}: {key} was accepted for no reason; review it with `luxproof accept`")]
    NotAccepted { path: String, key: ReadingKey },
    #[error("{path} is about {found}, and this run about {wanted}; name the baseline of this spec")]
    Elsewhere { path: String, found: String, wanted: String },
}

/// How to replace a file that is no baseline.
const REMEDY: &str = "restore it, or review a run anew with `luxproof accept`, which replaces it";

impl Entry {
    /// The entry of a recording with its readings, which nothing has accepted yet.
    fn candidate(recording: &Recording, readings: Vec<Reading>) -> Self {
        Self {
            key: recording.key.clone(),
            version: recording.version.clone(),
            model: recording.model.clone(),
            light: recording.light,
            content_sha256: recording.content_sha256.clone(),
            method: recording.method.clone(),
            accepted: String::new(),
            reason: String::new(),
            readings,
        }
    }

    /// A setting of the engine.
    fn setting(&self, key: &str) -> Option<&str> {
        self.method.get(key).map(String::as_str)
    }

    /// Whether it may become a baseline: it has readings, and all of them are finite and not negative.
    pub fn is_sound(&self) -> bool {
        !self.readings.is_empty() && self.readings.iter().all(|r| r.value.is_finite() && r.value >= 0.0)
    }
}

impl Baseline {
    /// The readings of a run that may be accepted.
    pub fn candidate(report: &Report) -> Self {
        // The answer of a calibration scene is known, so its readings need no acceptance.
        let entries = Self::whole(report).entries.into_iter().filter(|e| !e.key.procedure.is_calibration()).collect();
        Self { entries }
    }

    /// All readings of a run, with those of calibration scenes.
    pub fn whole(report: &Report) -> Self {
        // Recorded readings change with their file alone.
        let taken = report.recordings.iter().filter(|r| r.role != Role::Recorded);
        let mut readings: HashMap<&ReadingKey, Vec<Reading>> = HashMap::new();
        for record in &report.readings {
            readings.entry(&record.key).or_default().push(record.reading.clone());
        }
        let all = taken.map(|recording| {
            // The remaining readings of an engine that failed are no expectation.
            let of_recording = readings.remove(&recording.key).filter(|_| recording.failure.is_none());
            Entry::candidate(recording, of_recording.unwrap_or_default())
        });
        Self { entries: all.sorted_by(|a, b| a.key.cmp(&b.key)).collect() }
    }

    pub fn read(path: &Path) -> Result<Self, BaselineError> {
        let name = path.display().to_string();
        let text = files::read_stored(path)?;
        let opened = envelope::open(SCHEMA, &text).and_then(|sealed| sealed.about_what(Self::subject));
        let baseline: Self = opened.map_err(|why| BaselineError::Refused { path: name.clone(), why })?;
        baseline.check(&name)?;
        Ok(baseline)
    }

    /// Checks that every entry was accepted, is sound, and is there once.
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
            let mut meters = HashSet::new();
            if let Some(repeated) = entry.readings.iter().find(|r| !meters.insert((&r.meter, r.quantity))) {
                return Err(BaselineError::Twice { path, key, meter: Some(repeated.meter.clone()) });
            }
        }
        Ok(())
    }

    /// Reads the baseline of a run of these cases; a baseline of other specs is refused.
    pub fn of_run<'a>(path: &Path, cases: impl IntoIterator<Item = &'a str>) -> Result<Self, BaselineError> {
        let baseline = Self::read(path)?;
        let wanted: BTreeSet<&str> = cases.into_iter().map(spec_name).collect();
        if baseline.entries.is_empty() || baseline.specs().any(|spec| wanted.contains(spec)) {
            return Ok(baseline);
        }
        let (found, wanted) = (baseline.subject(), wanted.into_iter().join(", "));
        Err(BaselineError::Elsewhere { path: path.display().to_string(), found, wanted })
    }

    fn specs(&self) -> impl Iterator<Item = &str> {
        self.entries.iter().map(|entry| spec_name(&entry.key.case)).sorted_unstable().dedup()
    }

    /// The key in its envelope: its specs.
    fn subject(&self) -> String {
        self.specs().join(", ")
    }

    pub fn write(&self, path: &Path) -> Result<(), BaselineError> {
        let text = self.text().map_err(|e| FileError::of(path, std::io::Error::from(e)))?;
        Ok(files::replace_shared(path, text.as_bytes()).map_err(|source| FileError::of(path, source))?)
    }

    /// The text of the file, with one line for each property and each reading.
    fn text(&self) -> Result<String, serde_json::Error> {
        let mut entries = vec![];
        for entry in &self.entries {
            let mut lines = vec![];
            let value = serde_json::to_value(entry)?;
            for (key, value) in value.as_object().into_iter().flatten().filter(|(key, _)| *key != "readings") {
                lines.push(format!("      {}: {value}", serde_json::Value::from(key.as_str())));
            }
            let mut readings: Vec<String> = vec![];
            for reading in &entry.readings {
                readings.push(format!("        {}", serde_json::to_string(reading)?));
            }
            lines.push(format!("      \"readings\": [\n{}\n      ]", readings.join(",\n")));
            entries.push(format!("    {{\n{}\n    }}", lines.join(",\n")));
        }
        let body = format!("{{\n  \"entries\": [\n{}\n  ]\n}}", entries.join(",\n"));
        Ok(envelope::seal_text(SCHEMA, &self.subject(), body)? + "\n")
    }

    /// Adds accepted entries; each replaces the one with its key.
    pub fn accept(&mut self, accepted: Vec<Entry>) {
        for entry in accepted {
            self.entries.retain(|old| old.key != entry.key);
            self.entries.push(entry);
        }
        self.entries.sort_by(|a, b| a.key.cmp(&b.key));
    }

    /// The file that a path names: the path, or in a folder the file named after the spec.
    pub fn place(path: &Path, run: &SpecRecord) -> PathBuf {
        if path.extension().is_some_and(|e| e == "json") && !path.is_dir() {
            return path.to_owned();
        }
        let spec = run.path.split_whitespace().next().map(Path::new);
        let stem = spec.and_then(Path::file_stem).and_then(|s| s.to_str()).unwrap_or("suite");
        path.join(format!("{stem}.json"))
    }
}

/// The spec of a case: the first part of its name.
fn spec_name(case: &str) -> &str {
    case.split('/').next().unwrap_or(case)
}

#[cfg(test)]
mod tests;
