//! The readings of an experiment on a case. A reading comes from the cache where it has the same
//! settings; new ones are taken within a time.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::{Duration, Instant};

use luxproof_audit::measure::{CostedMeasurement, Failure, Instrument, Question, Reader, Trial};
use luxproof_engines::simulator::Simulator;
use luxproof_engines::{Job, Version};
use luxproof_laws::Place;
use luxproof_model::FailureKind;
use luxproof_spec::{Budget, Case};

/// The settings of an engine by name.
pub(super) type Settings = BTreeMap<String, serde_json::Value>;

/// Takes the readings of an experiment on a case.
pub(super) struct Trials<'a> {
    pub(super) case: &'a Case,
    reader: Reader,
}

/// How much effort a reading may take.
#[derive(Clone, Copy)]
pub(super) struct Effort {
    pub(super) budget: Budget,
    pub(super) seed: u64,
    /// A reading that takes longer hangs.
    pub(super) limit: Duration,
    pub(super) threads: usize,
}

impl<'a> Trials<'a> {
    /// Starts now; no reading starts after the time.
    pub(super) fn new(case: &'a Case, reader: &Reader, time: Duration) -> Self {
        Self { case, reader: Reader { until: Some(Instant::now() + time), ..reader.clone() } }
    }

    /// Whether the time is up.
    pub(super) fn is_over(&self) -> bool {
        self.reader.until.is_some_and(|until| Instant::now() >= until)
    }

    /// Takes one reading; `None` where the time is up or the user interrupted.
    pub(super) fn take(
        &self,
        instrument: &Instrument,
        job: &Job,
        settings: &Settings,
        effort: Effort,
        (variant, repetition): (Option<Place>, usize),
    ) -> Option<Result<CostedMeasurement, Failure>> {
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

/// The exact simulation, with which readings are compared.
pub(super) fn simulator() -> Instrument {
    Instrument { engine: Arc::new(Simulator), version: Version::own() }
}
