//! Hidden variants: cases that a seed draws anew from public ones.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// What a hidden variant was drawn from.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct HiddenVariant {
    /// The name of the public case.
    pub of: String,
    /// The seed of the draw.
    pub seed: u64,
}
