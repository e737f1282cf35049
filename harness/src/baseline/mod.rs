//! Baselines: readings that somebody accepted for a reason, kept in a file that reads well in a review of changes.
//!
//! A baseline holds for one spec, engine, version, luminaire model, light and method; anything else is refused, never
//! silently reused. Reading tests after Mitsuba 3's `test_renders.py`: a missing reference fails and leaves a candidate.

mod changes;
mod review;

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use crate::files;
use crate::reading::{MeterId, Quantity, Recording};
use crate::report::{RecordingSummary, Report};

pub use changes::{Changes, Comparability, EntryChange, MeanShift, MeterChange, State, compare};
pub use review::{Decision, review};

/// Accepted readings.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Baseline {
    /// Version of the format: 1.
    pub luxproof_baseline: u32,
    /// One a case, procedure and engine, sorted so.
    pub entries: Vec<Entry>,
}

/// What one engine read in one procedure of one case, and why that was accepted.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Entry {
    /// The case.
    pub case: String,
    /// The procedure.
    pub procedure: String,
    /// The engine.
    pub engine: String,
    /// The engine's version.
    pub version: String,
    /// The luminaire model.
    pub model: String,
    /// Which light counted.
    pub light: String,
    /// SHA-256 of the spec and of every file that it names.
    pub input_sha256: String,
    /// What the engine set, its effort left out: another run of the same instrument has the same.
    pub settings: BTreeMap<String, String>,
    /// Degrees of freedom of the standard errors, where they are few.
    pub degrees_of_freedom: Option<f64>,
    /// When it was accepted (RFC 3339, UTC); empty in a candidate.
    pub accepted: String,
    /// Why it was accepted; empty in a candidate, which is refused as a baseline.
    pub reason: String,
    /// The readings, one a meter.
    pub readings: Vec<Accepted>,
}

/// An accepted reading.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Accepted {
    /// Where.
    pub meter: MeterId,
    /// What.
    pub quantity: Quantity,
    /// How much, in the quantity's unit.
    pub value: f64,
    /// Standard error, likewise.
    pub std_error: Option<f64>,
    /// Distance within which the true value lies, likewise.
    pub error_bound: Option<f64>,
}

/// Why a baseline or a run cannot be read or written.
#[derive(Debug, thiserror::Error)]
pub enum BaselineError {
    /// The file cannot be read or written.
    #[error("{path}: {source}")]
    Io {
        /// The file.
        path: String,
        /// The system's reason.
        source: std::io::Error,
    },
    /// It is no baseline.
    #[error("{path}: {source}; a baseline is written by `luxproof accept`")]
    Format {
        /// The file.
        path: String,
        /// What is wrong where.
        source: serde_json::Error,
    },
    /// It is of another version of the format.
    #[error("{path}: format {found} of a baseline; this luxproof reads format 1")]
    Version {
        /// The file.
        path: String,
        /// Its version.
        found: u32,
    },
    /// It holds a reading that is no measurement.
    #[error("{path}: {engine} {procedure} of {case}: a negative or infinite reading is no baseline")]
    Unsound {
        /// The file.
        path: String,
        /// The case.
        case: String,
        /// The procedure.
        procedure: String,
        /// The engine.
        engine: String,
    },
    /// Nobody accepted it.
    #[error("{path}: {engine} {procedure} of {case} was accepted for no reason; review it with `luxproof accept`")]
    NotAccepted {
        /// The file.
        path: String,
        /// The case.
        case: String,
        /// The procedure.
        procedure: String,
        /// The engine.
        engine: String,
    },
}

/// Settings that tell of effort, chance and paths: they differ between runs of one instrument with one method. Whatever an
/// engine sets besides counts, so that a setting nobody thought of is refused rather than overlooked.
const EFFORT: [&str; 11] = [
    "ambient_divisions",
    "arguments",
    "blocks",
    "calibration",
    "command",
    "count_first_reflection",
    "looks",
    "rounds",
    "rtrace",
    "seed",
    "seeds",
];

/// Whether a setting tells of effort: blocks and samples are counted under several names.
fn is_effort(key: &str) -> bool {
    EFFORT.contains(&key) || key.ends_with("_blocks") || key.contains("samples")
}

impl Entry {
    fn of(report: &Report, recording: &RecordingSummary) -> Self {
        let mine = |r: &&crate::report::ReadingRecord| {
            r.case == recording.case && r.procedure == recording.procedure && r.engine == recording.engine
        };
        let settings = recording.settings.iter().filter(|(key, _)| !is_effort(key));
        let whole = Recording { settings: recording.settings.clone(), ..Recording::default() };
        Self {
            case: recording.case.clone(),
            procedure: recording.procedure.clone(),
            engine: recording.engine.clone(),
            version: recording.version.clone(),
            model: recording.model.clone(),
            light: recording.light.clone(),
            input_sha256: recording.input_sha256.clone(),
            settings: settings.map(|(k, v)| (k.clone(), v.clone())).collect(),
            degrees_of_freedom: whole.degrees_of_freedom(),
            accepted: String::new(),
            reason: String::new(),
            readings: report.readings.iter().filter(mine).map(Accepted::of).collect(),
        }
    }

    /// What two entries must share to be about the same thing.
    pub fn key(&self) -> (&str, &str, &str) {
        (&self.case, &self.procedure, &self.engine)
    }
}

impl Accepted {
    fn of(r: &crate::report::ReadingRecord) -> Self {
        Self {
            meter: r.meter.clone(),
            quantity: r.quantity,
            value: r.value,
            std_error: r.std_error,
            error_bound: r.error_bound,
        }
    }
}

impl Baseline {
    /// The readings of a run as a candidate: accepted by nobody yet.
    pub fn candidate(report: &Report) -> Self {
        let mut entries: Vec<Entry> = report.recordings.iter().map(|r| Entry::of(report, r)).collect();
        entries.sort_by(|a, b| a.key().cmp(&b.key()));
        Self { luxproof_baseline: 1, entries }
    }

    /// Reads a baseline; a candidate that nobody accepted is refused.
    pub fn read(path: &Path) -> Result<Self, BaselineError> {
        let name = || path.display().to_string();
        let text = fs::read_to_string(path).map_err(|source| BaselineError::Io { path: name(), source })?;
        let baseline: Self =
            serde_json::from_str(&text).map_err(|source| BaselineError::Format { path: name(), source })?;
        if baseline.luxproof_baseline != 1 {
            return Err(BaselineError::Version { path: name(), found: baseline.luxproof_baseline });
        }
        for entry in &baseline.entries {
            let (case, procedure, engine) = (entry.case.clone(), entry.procedure.clone(), entry.engine.clone());
            if entry.reason.trim().is_empty() {
                return Err(BaselineError::NotAccepted { path: name(), case, procedure, engine });
            }
            if entry.readings.iter().any(|r| !(r.value.is_finite() && r.value >= 0.0)) {
                return Err(BaselineError::Unsound { path: name(), case, procedure, engine });
            }
        }
        Ok(baseline)
    }

    /// Writes it, one reading a line.
    pub fn write(&self, path: &Path) -> Result<(), BaselineError> {
        let fail = |source| BaselineError::Io { path: path.display().to_string(), source };
        let text = self.text().map_err(|e| fail(e.into()))?;
        files::replace_shared(path, text.as_bytes()).map_err(fail)
    }

    fn text(&self) -> Result<String, serde_json::Error> {
        let mut entries = vec![];
        for entry in &self.entries {
            let mut lines = vec![];
            let value = serde_json::to_value(entry)?;
            for (key, value) in value.as_object().into_iter().flatten().filter(|(key, _)| *key != "readings") {
                lines.push(format!("      {}: {value}", serde_json::Value::from(key.as_str())));
            }
            let readings: Result<Vec<String>, _> =
                entry.readings.iter().map(|r| serde_json::to_string(r).map(|r| format!("        {r}"))).collect();
            lines.push(format!("      \"readings\": [\n{}\n      ]", readings?.join(",\n")));
            entries.push(format!("    {{\n{}\n    }}", lines.join(",\n")));
        }
        Ok(format!(
            "{{\n  \"luxproof_baseline\": {},\n  \"entries\": [\n{}\n  ]\n}}\n",
            self.luxproof_baseline,
            entries.join(",\n")
        ))
    }

    /// Puts accepted entries in the place of those that they replace.
    pub fn accept(&mut self, accepted: Vec<Entry>) {
        for entry in accepted {
            self.entries.retain(|old| old.key() != entry.key());
            self.entries.push(entry);
        }
        self.entries.sort_by(|a, b| a.key().cmp(&b.key()));
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
