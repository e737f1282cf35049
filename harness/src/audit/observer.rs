//! Who is told of what happens in an audit.

use std::time::Duration;

use crate::engines::Engine;
use crate::plan::Plan;
use crate::record::ProcedureId;
use crate::spec::{Case, SpecError};

/// Told of what happens in an audit; nothing is asked of it.
pub trait Observer: Sync {
    /// What is allowed in a case and hardly meant.
    fn doubted(&self, _doubts: &[SpecError]) {}
    /// All cases are planned; their plans lie beside them.
    fn planned(&self, _cases: &[Case], _plans: &[Plan]) {}
    fn started(&self, _case: &Case, _engine: &dyn Engine, _what: &str) {}
    /// A job ended, with its failure if it failed.
    fn ended(
        &self,
        _case: &Case,
        _engine: &dyn Engine,
        _procedure: ProcedureId,
        _wall: Duration,
        _failure: Option<&str>,
    ) {
    }
    /// Something that a person who watches wants to know.
    fn remarked(&self, _case: &Case, _text: &str) {}
}

/// Whom nobody needs to tell.
pub struct Silent;

impl Observer for Silent {}
