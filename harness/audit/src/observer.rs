//! The events of an audit, for progress displays.

use std::fmt;
use std::sync::Arc;
use std::time::Duration;

use crate::measure::Machine;
use crate::plan::Plan;
use luxproof_engines::Engine;
use luxproof_model::{EngineName, ProcedureId};
use luxproof_spec::{Case, SpecError};

/// Receives the events of an audit; every method does nothing by default.
pub trait Observer: Sync {
    /// Valid but suspicious input was found in the specs.
    fn linted(&self, _lints: &[SpecError]) {}
    /// All cases are planned; the plans are in the order of the cases, and their jobs run on the machine.
    fn planned(&self, _cases: &[Case], _plans: &[Plan], _machine: &Arc<Machine>) {}
    /// The first reading of a procedure ended; `failure` says why it failed. Further stages may follow.
    fn ended(
        &self,
        _case: &Case,
        _engine: &dyn Engine,
        _procedure: ProcedureId,
        _wall: Duration,
        _failure: Option<&str>,
    ) {
    }
    /// A further stage of a reading starts.
    fn sampled_again(&self, _case: &Case, _stage: &FurtherStage<'_>) {}
    /// All readings of a case are there, further stages included.
    fn case_ended(&self, _case: &Case) {}
    /// A remark for a user who watches the run.
    fn remarked(&self, _case: &Case, _text: &str) {}
}

/// A further stage of a reading.
#[derive(Clone, Copy, Debug)]
pub struct FurtherStage<'a> {
    pub engine: &'a EngineName,
    pub procedure: ProcedureId,
    /// The number of the stage, counted from 1, and the largest one.
    pub stage: u32,
    pub last_stage: u32,
    /// How many points it samples again, of how many.
    pub points: usize,
    pub all_points: usize,
    /// How long it may take.
    pub seconds: f64,
}

impl fmt::Display for FurtherStage<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { engine, procedure, stage, last_stage, points, all_points, seconds } = self;
        write!(
            f,
            "{engine}: sampling {points} of {all_points} points of {procedure} again \
             (stage {stage} of {last_stage}, up to {seconds:.0} s)"
        )
    }
}

/// Ignores all events.
pub struct SilentObserver;

impl Observer for SilentObserver {}
