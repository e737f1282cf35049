//! A question to an engine: an instrument, a job and the conditions of the reading.

use std::sync::Arc;
use std::time::Duration;

use super::cache::{Entry, Key, key, key_without_meters};
use luxproof_engines::{Engine, EngineError, Job, Version};
use luxproof_laws::Place;
use luxproof_model::FailureKind;
use luxproof_spec::Case;

/// An engine in an installed version.
#[derive(Clone)]
pub struct Instrument {
    pub engine: Arc<dyn Engine>,
    pub version: Version,
}

/// A job for an instrument, and the conditions of the reading.
#[derive(Clone, Copy)]
pub struct Question<'a> {
    pub instrument: &'a Instrument,
    pub job: &'a Job,
    /// The folder of scene files and log: the procedure's name, or a folder below it.
    pub folder: &'a str,
    /// How long the engine may sample, by the clock.
    pub patience: Duration,
    /// When the engine is killed, by the clock.
    pub limit: Duration,
    pub trial: Option<&'a Trial<'a>>,
    /// Whether cached readings of some of its meters may be a part of the answer.
    pub may_join: bool,
}

/// A reading in an experiment, where the time and a failure are results, too.
#[derive(Clone, Debug)]
pub struct Trial<'a> {
    pub case: &'a Case,
    /// The variant of the procedure's job; `None` for the job itself.
    pub variant: Option<Place>,
    pub repetition: usize,
    pub threads: usize,
}

impl<'a> Question<'a> {
    /// A question with the limits of its budget.
    ///
    /// Engines stop by themselves, so the limit lies far beyond the budget and only ends those that hang. Built-in
    /// engines count their work instead of seconds, and a machine may be slow, so their limit lies further out.
    pub fn new(instrument: &'a Instrument, job: &'a Job, folder: &'a str) -> Self {
        let factor = if instrument.engine.has_trusted_error() { 10.0 } else { 2.0 };
        let limit_s = factor * job.budget.seconds + instrument.engine.start_s();
        let limit = Duration::from_secs_f64(limit_s.clamp(0.0, 1e9));
        Self { instrument, job, folder, patience: job.budget.patience(), limit, trial: None, may_join: false }
    }

    /// The key of the reading. The time and a failure of a trial also depend on threads and limit.
    pub(super) fn key(&self) -> Result<Key, EngineError> {
        let key = key(self.instrument.engine.as_ref(), &self.instrument.version, self.job)?;
        let Some(trial) = self.trial else { return Ok(key) };
        Ok(key.under(&format!("{} threads, {:?}, {}", trial.threads, self.limit, trial.repetition)))
    }

    /// The key of the question without its meters, where cached parts may be joined.
    pub(super) fn key_without_meters(&self) -> Option<Key> {
        let engine = self.instrument.engine.as_ref();
        let may_join = self.may_join && self.trial.is_none() && engine.reads_meters_independently();
        may_join.then(|| key_without_meters(engine, &self.instrument.version, self.job).ok()).flatten()
    }

    /// The key of the engine's precomputed data; `None` in a trial, which measures the time without such help.
    pub(super) fn precompute_key(&self) -> Option<Key> {
        let engine = self.instrument.engine.as_ref();
        let job = engine.shared_precompute(self.job).filter(|_| self.trial.is_none())?;
        Some(key(engine, &self.instrument.version, &job).ok()?.under("shared_precompute"))
    }

    /// Whether an entry also answers later questions. A failure is tried again, but in a trial it is a result.
    pub(super) fn is_final(&self, entry: &Entry) -> bool {
        match entry.answer.as_ref().map_err(|failure| failure.kind) {
            Ok(_) | Err(FailureKind::Declined) => true,
            Err(kind) => kind.is_an_answer() && self.trial.is_some(),
        }
    }
}
