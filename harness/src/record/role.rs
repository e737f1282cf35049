//! What an engine takes part for.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// What an engine takes part for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Role {
    /// Others are judged by it: one of our own solvers. It always runs, and costs next to nothing.
    Witness,
    /// It is judged.
    #[default]
    Renderer,
}
