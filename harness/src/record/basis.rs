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
    /// As views call it: the exact solutions are those of our own simulator.
    pub const fn name(self) -> &'static str {
        match self {
            Self::ClosedForm => "closed form",
            Self::Exact => "simulator",
            Self::Iesna => "IESNA",
            Self::Published => "published",
            Self::Engine => "engine",
        }
    }
}
