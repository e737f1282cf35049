//! The engine's settings in a spec: `engines: {radiance: {preset: ..., ambient_divisions: ..., rescale: ...}}`.

use serde::Deserialize;

use super::ID;
use crate::engines::{EngineError, Job};

/// Settings with their defaults.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Settings {
    /// How much trouble is taken.
    pub(super) preset: Preset,
    /// Ambient divisions of one block (`-ad`); `None`: as the budget asks for.
    pub(super) ambient_divisions: Option<u32>,
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
        let mut settings = Self { preset: Preset::Audit, ambient_divisions: None, scaling: Scaling::Fitted };
        for (key, value) in &job.settings {
            match key.as_str() {
                "preset" => settings.preset = parsed(key, value, "audit, fast or default")?,
                "ambient_divisions" => settings.ambient_divisions = Some(divisions(key, value)?),
                "rescale" => {
                    let rescale: bool = parsed(key, value, "true or false")?;
                    settings.scaling = if rescale { Scaling::Fitted } else { Scaling::Raw };
                }
                _ => {
                    let known = "preset, ambient_divisions and rescale";
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
