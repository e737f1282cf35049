//! The policy of a run, as its report records it.

use clap::ValueEnum;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::EngineName;

/// When sampling stops.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum, Serialize, Deserialize, JsonSchema, strum::Display)]
#[serde(rename_all = "snake_case")]
#[strum(serialize_all = "snake_case")]
pub enum Sampling {
    /// At the relative error of the spec's budget; later for undecided points
    Accurate,
    /// As soon as every comparison is decided
    #[default]
    Decided,
}

/// The project policy that set the tolerances.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
pub struct PolicyRecord {
    pub file: String,
    pub sha256: String,
    /// The selected profile.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub profile: Option<String>,
    /// Engines of which the run needs readings to be an audit.
    pub required_engines: Vec<EngineName>,
}
