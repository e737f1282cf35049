//! The engine's settings in a spec: `engines: {mitsuba: {variant: ..., preset: ..., recentre: ...}}`.

use serde::Deserialize;

use super::ID;
use crate::engines::{EngineError, Job, Knob};

/// Variants whose single sample is a luminance; the spectral and polarised ones are not.
const VARIANTS: [&str; 5] = ["llvm_ad_mono", "llvm_ad_rgb", "scalar_rgb", "cuda_ad_mono", "cuda_ad_rgb"];

/// What a spec may set, with values worth trying.
pub(super) const KNOBS: &[Knob] = &[
    Knob { key: "preset", values: &["audit", "fast", "default"] },
    Knob { key: "variant", values: &["llvm_ad_mono", "llvm_ad_rgb", "scalar_rgb"] },
    Knob { key: "recentre", values: &["true", "false"] },
];

/// Settings with their defaults.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Settings {
    /// The Mitsuba variant asked for.
    pub(super) variant: String,
    /// How much trouble is taken.
    pub(super) preset: Preset,
    /// Whether coordinates may be moved and scaled for 32-bit floats.
    pub(super) frame: FrameChoice,
}

/// How much trouble is taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum Preset {
    /// Goniometric emitter, no meters in the scene, as many samples as the budget asks for.
    Audit,
    /// The same with a fixed, small number of samples.
    Fast,
    /// The stock scene with Mitsuba's own defaults: what somebody gets who writes no Python.
    Default,
}

/// Which coordinates the renderer gets.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum FrameChoice {
    /// Moved and scaled where 32-bit floats need it.
    Recentred,
    /// The spec's own.
    Raw,
}

impl Settings {
    /// The settings of a job, checked.
    pub(super) fn of(job: &Job) -> Result<Self, EngineError> {
        let mut settings = Self { variant: VARIANTS[0].into(), preset: Preset::Audit, frame: FrameChoice::Recentred };
        for (key, value) in &job.settings {
            match key.as_str() {
                "variant" => settings.variant = variant(value)?,
                "preset" => settings.preset = parsed(key, value, "audit, fast or default")?,
                "recentre" => {
                    let recentre: bool = parsed(key, value, "true or false")?;
                    settings.frame = if recentre { FrameChoice::Recentred } else { FrameChoice::Raw };
                }
                _ => return Err(error(key, "no such setting; there are variant, preset and recentre".into())),
            }
        }
        Ok(settings)
    }
}

fn variant(value: &serde_json::Value) -> Result<String, EngineError> {
    let name: String = parsed("variant", value, "the name of a Mitsuba variant")?;
    if VARIANTS.contains(&name.as_str()) {
        return Ok(name);
    }
    Err(error("variant", format!("`{name}` does not read luminance; use one of {}", VARIANTS.join(", "))))
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
