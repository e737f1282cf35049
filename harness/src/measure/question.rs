//! What is asked: a job of an instrument, and under which conditions.

use std::sync::Arc;
use std::time::Duration;

use super::cache::{Entry, Key, key, key_without_meters};
use crate::engines::{Engine, EngineError, Job, Version};
use crate::laws::Place;
use crate::record::FailureKind;
use crate::spec::Case;

#[derive(Clone)]
pub struct Instrument {
    pub engine: Arc<dyn Engine>,
    pub version: Version,
}

#[derive(Clone, Copy)]
pub struct Question<'a> {
    pub instrument: &'a Instrument,
    pub job: &'a Job,
    /// Where scene files and log go: the procedure's name, or a folder below it.
    pub folder: &'a str,
    /// By the clock, how long it may sample.
    pub patience: Duration,
    /// Past this it is killed.
    pub limit: Duration,
    pub trial: Option<&'a Trial<'a>>,
    /// Whether what is kept of some of its meters may be a part of the answer.
    pub may_join: bool,
}

/// What makes a reading one of an experiment: its time and its failure are results too.
#[derive(Clone, Debug)]
pub struct Trial<'a> {
    pub case: &'a Case,
    /// Which variant of the procedure's job; `None` for the job itself.
    pub variant: Option<Place>,
    pub repetition: usize,
    pub threads: usize,
}

impl<'a> Question<'a> {
    /// One that is killed far beyond its budget, which engines keep by themselves: that is for those that hang. Ours count their
    /// seconds, and a machine may be slow.
    pub fn new(instrument: &'a Instrument, job: &'a Job, folder: &'a str) -> Self {
        let beyond = if instrument.engine.is_vouched_for() { 10.0 } else { 2.0 };
        let limit_s = beyond * job.budget.seconds + instrument.engine.start_s();
        let limit = Duration::from_secs_f64(limit_s.clamp(0.0, 1e9));
        Self { instrument, job, folder, patience: job.budget.patience(), limit, trial: None, may_join: false }
    }

    /// Of a trial, time and failure depend on threads and limit as well.
    pub(super) fn key(&self) -> Result<Key, EngineError> {
        let key = key(self.instrument.engine.as_ref(), &self.instrument.version, self.job)?;
        let Some(trial) = self.trial else { return Ok(key) };
        Ok(key.under(&format!("{} threads, {:?}, {}", trial.threads, self.limit, trial.repetition)))
    }

    /// What names it whatever its meters, where answers for some of these may be parts of an answer.
    pub(super) fn key_without_meters(&self) -> Option<Key> {
        let engine = self.instrument.engine.as_ref();
        let may_join = self.may_join && self.trial.is_none() && engine.reads_meters_apart();
        may_join.then(|| key_without_meters(engine, &self.instrument.version, self.job).ok()).flatten()
    }

    /// What names what its engine finds for other jobs, too; nothing in a trial, whose time is what is asked.
    pub(super) fn key_of_groundwork(&self) -> Option<Key> {
        let engine = self.instrument.engine.as_ref();
        let job = engine.groundwork(self.job).filter(|_| self.trial.is_none())?;
        Some(key(engine, &self.instrument.version, &job).ok()?.under("groundwork"))
    }

    /// What answers the key as well another time. A failure is tried again, but that of a trial is what it found.
    pub(super) fn is_final(&self, entry: &Entry) -> bool {
        match entry.answer.as_ref().map_err(|failure| failure.kind) {
            Ok(_) | Err(FailureKind::Declined) => true,
            Err(kind) => kind.is_an_answer() && self.trial.is_some(),
        }
    }
}
