//! Ratios of one case to another.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::{Basis, EngineName, Estimate, FigureAgreement, MeterId, ProcedureId};

/// The readings of an engine at one set of meters in a case, divided by those in another case.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Ratios {
    pub before: String,
    pub after: String,
    pub procedure: ProcedureId,
    pub engine: EngineName,
    /// The set of meters.
    pub set: String,
    /// The basis of the references, where they have the same.
    pub basis: Option<Basis>,
    /// The ratio of the means over the meters.
    pub mean: Ratio,
    /// The ratio at each meter that is at the same place in both cases.
    pub meters: Vec<MeterRatio>,
}

/// A value over the value before.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Ratio {
    /// Null where there was no light before, or where it is unknown.
    pub ratio: Option<Estimate>,
    /// Its agreement with the ratio of the references; null where one is missing.
    pub agreement: Option<FigureAgreement>,
    /// Whether the errors of both cases cancel, because only the flux of all luminaires was scaled.
    pub errors_cancel: bool,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct MeterRatio {
    pub meter: MeterId,
    #[serde(flatten)]
    pub of: Ratio,
}
