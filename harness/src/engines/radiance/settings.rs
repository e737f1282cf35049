//! The engine's settings in a spec: `engines: {radiance: {preset: ..., photometry: ...}}` and more.

use serde::Deserialize;

use super::ID;
use crate::engines::{EngineError, Job, Knob};

/// What a spec may set, with values worth trying.
pub(super) const KNOBS: &[Knob] = &[
    Knob { key: "preset", values: &["audit", "fast", "default"] },
    Knob { key: "ambient_divisions", values: &["16384", "1024"] },
    Knob { key: "photometry", values: &["exporter", "ies2rad"] },
    Knob { key: "impostor_height_m", values: &["0.057", "0.2"] },
    Knob { key: "rescale", values: &["true", "false"] },
];

/// Settings with their defaults.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Settings {
    /// How much trouble is taken.
    pub(super) preset: Preset,
    /// Ambient divisions of one block (`-ad`); `None`: as the budget asks for.
    pub(super) ambient_divisions: Option<u32>,
    /// Who reads the photometric file.
    pub(super) photometrist: Photometrist,
    /// Height given to a flat opening that is modelled as an impostor, in metres.
    pub(super) impostor_height_m: f64,
    /// Whether tiny and huge scenes are scaled for Radiance's absolute tolerances.
    pub(super) scaling: Scaling,
}

/// How much trouble is taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum Preset {
    /// No cache, no cut-offs, as many samples as the budget asks for.
    Audit,
    /// The same with a fixed, small number of samples.
    Fast,
    /// rtrace's own defaults, but for the number of bounces, which is 0 there.
    Default,
}

/// Who turns photometry into Radiance's sources.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum Photometrist {
    /// We do, at full precision.
    Exporter,
    /// Radiance's own ies2rad, as its users do.
    Ies2rad,
}

/// The box of the published impostor, "lum2" of *Simulation of Luminaires in Radiance: Verification Method*, is 57 mm high.
const IMPOSTOR_HEIGHT_M: f64 = 0.057;

/// Which coordinates the renderer gets.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Scaling {
    /// Scaled by a power of ten where Radiance's absolute tolerances ask for it.
    Fitted,
    /// The spec's own metres.
    Raw,
}

impl Settings {
    /// The settings of a job, checked.
    pub(super) fn of(job: &Job) -> Result<Self, EngineError> {
        let mut settings = Self {
            preset: Preset::Audit,
            ambient_divisions: None,
            photometrist: Photometrist::Exporter,
            impostor_height_m: IMPOSTOR_HEIGHT_M,
            scaling: Scaling::Fitted,
        };
        for (key, value) in &job.settings {
            match key.as_str() {
                "preset" => settings.preset = parsed(key, value, "audit, fast or default")?,
                "ambient_divisions" => settings.ambient_divisions = Some(divisions(key, value)?),
                "photometry" => settings.photometrist = parsed(key, value, "exporter or ies2rad")?,
                "impostor_height_m" => settings.impostor_height_m = height(key, value)?,
                "rescale" => {
                    let rescale: bool = parsed(key, value, "true or false")?;
                    settings.scaling = if rescale { Scaling::Fitted } else { Scaling::Raw };
                }
                _ => {
                    let known = "preset, ambient_divisions, photometry, impostor_height_m and rescale";
                    return Err(error(key, format!("no such setting; there are {known}")));
                }
            }
        }
        Ok(settings)
    }
}

fn divisions(key: &str, value: &serde_json::Value) -> Result<u32, EngineError> {
    let expected = "a whole number from 1 to 1000000";
    let divisions: u32 = parsed(key, value, expected)?;
    if (1..=1_000_000).contains(&divisions) {
        return Ok(divisions);
    }
    Err(error(key, format!("{divisions} must be {expected}")))
}

fn height(key: &str, value: &serde_json::Value) -> Result<f64, EngineError> {
    let expected = "a height in metres, more than 0.001";
    let height_m: f64 = parsed(key, value, expected)?;
    // Up to 1 mm ies2rad makes a flat source of it.
    if height_m > 1e-3 && height_m.is_finite() {
        return Ok(height_m);
    }
    Err(error(key, format!("{height_m} must be {expected}")))
}

fn parsed<T: serde::de::DeserializeOwned>(
    key: &str,
    value: &serde_json::Value,
    expected: &str,
) -> Result<T, EngineError> {
    serde_json::from_value(value.clone()).map_err(|_| error(key, format!("{value} must be {expected}")))
}

fn error(key: &str, what: String) -> EngineError {
    EngineError::Setting { engine: ID, key: key.to_owned(), what }
}
