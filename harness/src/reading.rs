//! Readings: what one engine says at one meter, with its uncertainty.

use std::collections::BTreeMap;
use std::fmt;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Identifies a meter within a case: `<set>[k]`, or `<luminaire>[k]` for readings of luminous intensity.
#[derive(Clone, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
#[serde(transparent)]
pub struct MeterId(pub String);

impl MeterId {
    /// The `k`-th meter of a set.
    pub fn new(set: &str, k: usize) -> Self {
        Self(format!("{set}[{k}]"))
    }
}

impl fmt::Display for MeterId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(&self.0)
    }
}

/// The physical quantity of a reading and its unit.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
pub enum Quantity {
    /// Illuminance in lux.
    #[serde(rename = "illuminance_lx")]
    Illuminance,
    /// Luminous intensity in candela.
    #[serde(rename = "luminous_intensity_cd")]
    LuminousIntensity,
}

impl Quantity {
    /// The unit's symbol.
    pub const fn unit(self) -> &'static str {
        match self {
            Self::Illuminance => "lx",
            Self::LuminousIntensity => "cd",
        }
    }
}

/// One value at one meter. At most one of `std_error` and `error_bound` is set by an honest engine; both may be absent
/// where an engine is deterministic and knows nothing better.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Reading {
    /// Where.
    pub meter: MeterId,
    /// What.
    pub quantity: Quantity,
    /// How much, in the quantity's unit.
    pub value: f64,
    /// Standard error of a Monte Carlo mean.
    pub std_error: Option<f64>,
    /// Distance within which the true value lies, for deterministic methods.
    pub error_bound: Option<f64>,
}

/// Everything one engine said of one procedure of one case, with what is needed to say it again.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Recording {
    /// The case.
    pub case: String,
    /// The procedure.
    pub procedure: String,
    /// The engine.
    pub engine: String,
    /// The engine's version, as it names itself.
    pub version: String,
    /// The luminaire model: point, area, impostor, or mixed.
    pub model: String,
    /// Which light counted, e.g. `indirect, 7 bounces`.
    #[serde(default)]
    pub light: String,
    /// SHA-256 of the spec and of every file that it names.
    pub input_sha256: String,
    /// Seed of every random choice.
    pub seed: u64,
    /// What the engine set: arguments, samples, seeds, variant.
    pub settings: BTreeMap<String, String>,
    /// Where the engine only approximates what was asked.
    pub approximation: Option<String>,
    /// What the reader of a report should know.
    pub notes: Vec<String>,
    /// Wall-clock seconds.
    pub wall_s: f64,
    /// Relative standard uncertainty of the engine as an instrument, from its calibration; 0 for our own solvers.
    #[serde(default)]
    pub instrument_uncertainty: f64,
    /// What it shares with other engines: witnesses that share a component count once.
    #[serde(default)]
    pub components: Vec<String>,
    /// At which of several planned looks each reading was last sampled, counted from 1; empty where one look was planned.
    #[serde(default)]
    pub looks: Vec<u32>,
    /// Why there are no readings, if there are none.
    pub failure: Option<String>,
    /// The readings, one a meter.
    pub readings: Vec<Reading>,
}

impl Recording {
    /// Degrees of freedom of the standard errors: one less than the independent blocks that they were estimated from, where
    /// the engine's settings tell them as `blocks` or `<part>_blocks`; the fewest, where several parts do.
    pub fn degrees_of_freedom(&self) -> Option<f64> {
        let counts = self.settings.iter().filter(|(key, _)| *key == "blocks" || key.ends_with("_blocks"));
        let blocks = counts.filter_map(|(_, count)| count.parse::<u32>().ok()).filter(|count| *count >= 2).min()?;
        Some(f64::from(blocks - 1))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_fewest_blocks_tell_the_degrees_of_freedom() {
        let of = |settings: &[(&str, &str)]| {
            let settings = settings.iter().map(|(k, v)| ((*k).to_owned(), (*v).to_owned())).collect();
            Recording { settings, ..Recording::default() }.degrees_of_freedom()
        };
        assert_eq!(of(&[("blocks", "8"), ("seed", "1")]), Some(7.0));
        assert_eq!(of(&[("direct_blocks", "64"), ("indirect_blocks", "16")]), Some(15.0));
        assert_eq!(of(&[("samples", "8")]), None);
    }
}
