//! Luminous intensity curves of photometric files, which views draw below the readings.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::ProcedureId;

/// The curve of a file in one half plane, at the angles of its table; linear in between.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Curve {
    pub case: String,
    pub procedure: ProcedureId,
    pub luminaire: String,
    pub c_deg: f64,
    pub gamma_deg: Vec<f64>,
    /// Luminous intensity at these angles in candela, with the luminaire's flux scale.
    pub intensity_cd: Vec<f64>,
}
