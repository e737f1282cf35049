//! Trust statements: a sentence about each renderer, and the claims behind it.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::{EngineName, ProcedureId};

/// A trust statement about one renderer.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Sentence {
    pub engine: EngineName,
    pub text: String,
    /// Its claims, by procedure.
    pub claims: Vec<ProcedureClaim>,
}

/// A claim about an engine's readings in one procedure, over all cases of a run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ProcedureClaim {
    pub procedure: ProcedureId,
    /// The number of judged readings.
    pub readings: usize,
    /// Readings that pass are within this of their references, with their intervals. It is relative except for ratings; null where none
    /// passes.
    pub within: Option<f64>,
    pub failed: usize,
    pub undecided: usize,
    pub known_deviations: usize,
    pub missing: usize,
    /// The mean deviation, relative, where chance does not explain it.
    pub bias: Option<f64>,
}

impl ProcedureClaim {
    /// Whether no reading failed, is undecided or missing.
    pub fn is_sound(&self) -> bool {
        self.failed + self.undecided + self.missing == 0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    #[test]
    fn a_claim_is_sound_without_failed_undecided_and_missing_readings() {
        let claim = ProcedureClaim {
            procedure: ProcedureId::DirectIlluminance,
            readings: 9,
            within: Some(0.01),
            failed: 0,
            undecided: 0,
            known_deviations: 3,
            missing: 0,
            bias: None,
        };
        assert!(claim.is_sound());
        for (failed, undecided, missing) in
            [(1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 1, 0), (0, 1, 1), (2, 1, 1), (1, 1, 2)]
        {
            let unsound = ProcedureClaim { failed, undecided, missing, ..claim.clone() };
            assert!(!unsound.is_sound(), "{unsound:?}");
        }
    }
}
