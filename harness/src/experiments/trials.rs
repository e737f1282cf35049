//! The readings of an experiment on a case: those of earlier on where they were taken as asked, others while there is time.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::{Duration, Instant};

use crate::engines::simulator::Simulator;
use crate::engines::{Job, Version};
use crate::laws::Place;
use crate::measure::{Failure, Instrument, Question, Reader, Taken, Trial};
use crate::record::FailureKind;
use crate::spec::{Budget, Case};

pub(super) type Settings = BTreeMap<String, serde_json::Value>;

pub(super) struct Trials<'a> {
    pub(super) case: &'a Case,
    reader: Reader,
}

#[derive(Clone, Copy)]
pub(super) struct Effort {
    pub(super) budget: Budget,
    pub(super) seed: u64,
    /// Past this it hangs.
    pub(super) limit: Duration,
    pub(super) threads: usize,
}

impl<'a> Trials<'a> {
    /// From now on; no reading starts once the time is over.
    pub(super) fn new(case: &'a Case, reader: &Reader, time: Duration) -> Self {
        Self { case, reader: Reader { until: Some(Instant::now() + time), ..reader.clone() } }
    }

    pub(super) fn is_over(&self) -> bool {
        self.reader.until.is_some_and(|until| Instant::now() >= until)
    }

    /// One reading; `None` where the time is over or the user stopped.
    pub(super) fn take(
        &self,
        instrument: &Instrument,
        job: &Job,
        settings: &Settings,
        effort: Effort,
        (variant, repetition): (Option<Place>, usize),
    ) -> Option<Result<Taken, Failure>> {
        let Effort { budget, seed, limit, threads } = effort;
        let job = Job { settings: settings.clone(), budget, seed, ..job.clone() };
        let trial = Trial { case: self.case, variant, repetition, threads };
        let folder = job.procedure.name();
        let question = Question { limit, trial: Some(&trial), ..Question::new(instrument, &job, folder) };
        match self.reader.try_read(&question) {
            Err(Failure { kind: FailureKind::Interrupted | FailureKind::TimeUp, .. }) => None,
            taken => Some(taken),
        }
    }
}

/// The exact simulation, which others are held against.
pub(super) fn simulator() -> Instrument {
    Instrument { engine: Arc::new(Simulator), version: Version::own() }
}
