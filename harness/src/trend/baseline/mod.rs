//! Baselines: readings that somebody accepted for a reason, kept in a file that reads well in a review of changes.
//!
//! A baseline holds for one spec, engine, version, luminaire model, light and method; anything else is refused, never
//! silently reused. Reading tests after Mitsuba 3's `test_renders.py`: a missing reference fails and leaves a candidate.

mod changes;
mod review;

use std::fs;
use std::path::{Path, PathBuf};

use itertools::Itertools;
use serde::{Deserialize, Serialize};

use crate::record::{Light, Method, Reading, ReadingKey, Recording};
use crate::report::Report;
use crate::system::files::{self, FileError};

pub use changes::{Changes, Comparability, EntryChange, MeanShift, MeterChange, State, compare};
pub use review::{Decision, review};

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Baseline {
    pub luxproof_baseline: u32,
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
    #[serde(default)]
    pub method: Method,
    /// Method and effort in one, of files that are older than the difference.
    #[serde(default, skip_serializing)]
    settings: Method,
    /// Of all standard errors, where the file is older than the readings' own.
    #[serde(default, skip_serializing)]
    degrees_of_freedom: Option<f64>,
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
    #[error("{path}: {source}; a baseline is written by `luxproof accept`")]
    Format { path: String, source: serde_json::Error },
    #[error("{path}: format {found} of a baseline; this luxproof reads format 1")]
    Version { path: String, found: u32 },
    #[error("{path}: {key}: a negative or infinite reading is no baseline")]
    Unsound { path: String, key: ReadingKey },
    #[error("{path}: {key} was accepted for no reason; review it with `luxproof accept`")]
    NotAccepted { path: String, key: ReadingKey },
}

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
            settings: Method::default(),
            degrees_of_freedom: None,
            accepted: String::new(),
            reason: String::new(),
            readings: mine.map(|r| r.reading.clone()).collect(),
        }
    }

    /// What it says of a setting that makes readings comparable.
    fn said(&self, key: &str) -> Option<&str> {
        self.method.get(key).or_else(|| self.settings.get(key)).map(String::as_str)
    }

    fn has_sound_values(&self) -> bool {
        self.readings.iter().all(|r| r.value.is_finite() && r.value >= 0.0)
    }

    /// Whether it may become a baseline: there are readings, and all of them are measurements.
    pub fn is_sound(&self) -> bool {
        !self.readings.is_empty() && self.has_sound_values()
    }
}

impl Baseline {
    pub fn candidate(report: &Report) -> Self {
        // Scenes of known answer need nobody's acceptance.
        let asked = report.recordings.iter().filter(|r| !r.key.procedure.is_known());
        let entries = asked.map(|r| Entry::of(report, r)).sorted_by(|a, b| a.key.cmp(&b.key)).collect();
        Self { luxproof_baseline: 1, entries }
    }

    pub fn read(path: &Path) -> Result<Self, BaselineError> {
        let name = || path.display().to_string();
        let text = fs::read_to_string(path).map_err(|source| FileError { path: name(), source })?;
        let mut baseline: Self =
            serde_json::from_str(&text).map_err(|source| BaselineError::Format { path: name(), source })?;
        if baseline.luxproof_baseline != 1 {
            return Err(BaselineError::Version { path: name(), found: baseline.luxproof_baseline });
        }
        for entry in &mut baseline.entries {
            for reading in &mut entry.readings {
                reading.uncertainty.grant(entry.degrees_of_freedom);
            }
            let key = entry.key.clone();
            if entry.reason.trim().is_empty() {
                return Err(BaselineError::NotAccepted { path: name(), key });
            }
            if !entry.has_sound_values() {
                return Err(BaselineError::Unsound { path: name(), key });
            }
        }
        Ok(baseline)
    }

    pub fn write(&self, path: &Path) -> Result<(), BaselineError> {
        let fail = |source| FileError { path: path.display().to_string(), source };
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
        let (version, entries) = (self.luxproof_baseline, entries.join(",\n"));
        Ok(format!("{{\n  \"luxproof_baseline\": {version},\n  \"entries\": [\n{entries}\n  ]\n}}\n"))
    }

    pub fn accept(&mut self, accepted: Vec<Entry>) {
        for entry in accepted {
            self.entries.retain(|old| old.key != entry.key);
            self.entries.push(entry);
        }
        self.entries.sort_by(|a, b| a.key.cmp(&b.key));
    }

    /// The file that a path names: itself, or in a folder the one of this run's spec.
    pub fn place(path: &Path, report: &Report) -> PathBuf {
        if path.extension().is_some_and(|e| e == "json") && !path.is_dir() {
            return path.to_owned();
        }
        let spec = report.spec.path.split_whitespace().next().map(Path::new);
        let stem = spec.and_then(Path::file_stem).and_then(|s| s.to_str()).unwrap_or("suite");
        path.join(format!("{stem}.json"))
    }
}

#[cfg(test)]
mod tests;
