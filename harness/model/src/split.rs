//! The shares of a deviation: of a method and a renderer, or between a paper and its renderer.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::{EngineName, MeterId, ProcedureId};

/// One method against one renderer at one meter. All shares are relative to the renderer's value, and they add up.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Split {
    pub case: String,
    pub procedure: ProcedureId,
    pub method: String,
    pub engine: EngineName,
    pub model: String,
    pub meter: MeterId,
    /// Method over renderer, minus 1.
    pub whole: f64,
    /// The share of the method's error.
    pub method_share: f64,
    /// The share of the renderer's error.
    pub renderer_share: f64,
    /// Half width of the interval of both shares.
    pub uncertainty: f64,
    /// The same in a sentence.
    pub text: String,
}

/// The shares of the deviation between a paper's rendering and its calculation.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct PaperSplit {
    pub table: String,
    pub meter: MeterId,
    pub place: String,
    /// The column that is compared with the calculation.
    pub column: String,
    /// Printed rendering over printed calculation, minus 1.
    pub whole: Share,
    /// The error of the method on our file, by the exact solution with all reflections.
    pub method: Share,
    /// The luminaire: a flux in the printed calculation that differs from our file's, and its model instead of a point.
    pub photometry: Share,
    /// The renderer: the reflections that it ignores by its settings, and its error.
    pub renderer: Share,
    /// The rest: printed digits that our run of the renderer does not reproduce.
    pub remainder: Share,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Share {
    /// Relative to the printed calculation.
    pub value: f64,
    /// Half width of its interval.
    pub uncertainty: f64,
}
