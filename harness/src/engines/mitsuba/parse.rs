//! What the driver printed, as a measurement; pure.

use std::collections::BTreeMap;

use luminaire::scene::Transport;
use serde::Deserialize;

use super::output;
use super::precision::float_error_lx;
use super::settings::{Preset, Settings};
use crate::engines::{EngineError, Job, Measurement};
use crate::record::{Estimate, Uncertainty};

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Answer {
    versions: BTreeMap<String, String>,
    readings: Vec<Row>,
    settings: BTreeMap<String, String>,
    notes: Vec<String>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Row {
    id: String,
    value: f64,
    std_error: f64,
    degrees_of_freedom: Option<f64>,
}

/// Reads the driver's answer; every meter must be there once, in order.
pub(super) fn measurement(stdout: &[u8], job: &Job, settings: &Settings) -> Result<Measurement, EngineError> {
    let answer: Answer = serde_json::from_slice(stdout).map_err(|e| {
        let start: String = String::from_utf8_lossy(stdout).chars().take(200).collect();
        output(format!("its answer is no JSON of readings ({e}): `{start}`"))
    })?;
    let expected = job.stations.len();
    if answer.readings.len() != expected {
        return Err(output(format!("gave {} readings for {expected} meters", answer.readings.len())));
    }
    let mut estimates = Vec::with_capacity(expected);
    for (k, (row, station)) in answer.readings.iter().zip(&job.stations).enumerate() {
        if row.id != station.id.0 {
            return Err(output(format!("gave `{}` where `{}` was asked for", row.id, station.id)));
        }
        // Direct light of points is deterministic: what is left is the rounding of 32-bit floats.
        let exact = settings.preset != Preset::Default && job.transport == Transport::Direct;
        let uncertainty = if row.std_error > 0.0 || !exact {
            Uncertainty::sampled(row.std_error, row.degrees_of_freedom)
        } else {
            Uncertainty::Bound(float_error_lx(job, settings, k))
        };
        estimates.push(Estimate { value: row.value, uncertainty });
    }
    let versions = answer.versions.into_iter().map(|(k, v)| (format!("version_{k}"), v));
    Ok(Measurement { estimates, settings: answer.settings.into_iter().chain(versions).collect(), notes: answer.notes })
}
