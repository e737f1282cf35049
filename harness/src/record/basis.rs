//! What a reference rests on.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// What a reference rests on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Basis {
    /// A formula in closed form.
    ClosedForm,
    /// The simulator, with its error bound.
    Exact,
    /// An IESNA calculation method.
    Iesna,
    /// Printed values.
    Published,
    /// Another engine.
    Engine,
}

impl Basis {
    /// The name used in reports.
    pub const fn name(self) -> &'static str {
        match self {
            Self::ClosedForm => "closed form",
            Self::Exact => "exact",
            Self::Iesna => "IESNA",
            Self::Published => "published",
            Self::Engine => "engine",
        }
    }
}
