//! What readings are held to: tolerances, and deviations that are on record.

use super::{Judge, KnownDeviationError, KnownDeviations, Published, ToleranceError, Tolerances};
use crate::spec::Case;

#[derive(Clone, Debug)]
pub struct Policy {
    pub tolerances: Tolerances,
    pub known: KnownDeviations,
}

#[derive(Debug, thiserror::Error)]
pub enum PolicyError {
    #[error(transparent)]
    Tolerance(#[from] ToleranceError),
    #[error(transparent)]
    KnownDeviation(#[from] KnownDeviationError),
}

impl Policy {
    pub fn built_in() -> Result<Self, PolicyError> {
        Ok(Self { tolerances: Tolerances::built_in()?, known: KnownDeviations::built_in()? })
    }

    /// Who judges by it the readings of a case, which may loosen or tighten tolerances.
    pub fn judge<'a>(&'a self, case: &'a Case, published: Option<&'a Published>) -> Judge<'a> {
        Judge { tolerances: &self.tolerances, known: &self.known, overrides: &case.tolerances, published }
    }
}
