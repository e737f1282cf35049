//! Why there are no cards.

use luxproof_process::printable::Quoted;
use luxproof_spec::{Faults, SpecError};

/// Why reports give no cards.
#[derive(Debug, thiserror::Error)]
pub enum CardsError {
    #[error(transparent)]
    Capabilities(#[from] Faults),
    #[error(
        "{} judges case {} by the policy {}; cards need luxproof's own tolerances: run it again where no policy is found, or \
         with a tolerance class of `verification`", Quoted(.run), Quoted(.case), Quoted(.policy)
    )]
    Policy { run: String, case: String, policy: String },
    #[error(
        "{} was judged for the tolerance class {class}; cards need `verification`: run it again without --tolerance-class", Quoted(.run)
    )]
    Class { run: String, class: String },
    #[error("{} has no case of a capability; docs/score-cards.md lists the specs that have", Quoted(.run))]
    NoCase { run: String },
    #[error("a file of the site cannot be written as JSON: {0}")]
    Json(#[from] serde_json::Error),
}

impl From<SpecError> for CardsError {
    fn from(error: SpecError) -> Self {
        Self::Capabilities(error.into())
    }
}
