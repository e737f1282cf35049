//! The basis of a reference value.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The basis of a reference value, the firmest first.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Basis {
    /// A formula in closed form.
    ClosedForm,
    /// Our simulator, with its error bound; or a value that was derived as strictly.
    Simulator,
    /// An IESNA calculation method.
    Iesna,
    /// Values printed in a paper.
    Published,
    /// Another engine.
    Engine,
}

impl Basis {
    /// Its name in views.
    pub const fn name(self) -> &'static str {
        match self {
            Self::ClosedForm => "closed form",
            Self::Simulator => "simulator",
            Self::Iesna => "IESNA",
            Self::Published => "published",
            Self::Engine => "engine",
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    #[test]
    fn every_basis_has_its_name() {
        let all = [Basis::ClosedForm, Basis::Simulator, Basis::Iesna, Basis::Published, Basis::Engine];
        assert_eq!(all.map(Basis::name), ["closed form", "simulator", "IESNA", "published", "engine"]);
        assert!(all.is_sorted());
    }
}
