//! What all cases of a run share: the machine's slots, and each engine's calibration, which is made once.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

use crate::calibration::{Calibrated, Earlier, calibrate};
use crate::engines::{Engine, Job, Site, Version};
use crate::measure::cache::{Entry, Key};
use crate::system::slots::Slots;

/// Slots and instruments of a run.
#[derive(Debug)]
pub struct Machine {
    /// How much runs at a time.
    pub slots: Slots,
    calibrations: Mutex<BTreeMap<String, Arc<Calibrating>>>,
    /// What engines answered in this run; `None`: equal jobs are rendered as often as they are asked.
    answers: Option<Mutex<BTreeMap<Key, Arc<Answered>>>>,
}

/// An answer of this run, locked while it is being found.
pub(super) type Answered = Mutex<Option<Entry>>;

type Calibrating = OnceLock<Result<Calibrated, String>>;

impl Machine {
    /// So many threads or processes at a time.
    pub fn new(threads: usize) -> Arc<Self> {
        Arc::new(Self { slots: Slots::new(threads), calibrations: Mutex::default(), answers: Some(Mutex::default()) })
    }

    /// The same, where every job is rendered as often as it is asked.
    pub fn rendering_everything(threads: usize) -> Arc<Self> {
        Arc::new(Self { slots: Slots::new(threads), calibrations: Mutex::default(), answers: None })
    }

    /// Where the answer to an equal job of this run is, or will be.
    pub(super) fn answered(&self, key: &Key) -> Option<Arc<Answered>> {
        let mut all = self.answers.as_ref()?.lock().unwrap_or_else(PoisonError::into_inner);
        Some(Arc::clone(all.entry(key.clone()).or_default()))
    }

    /// The calibration of an engine with the settings of a job, kept or made now; `made` is told of one that a first case
    /// asks for, where other cases find it or wait for it.
    pub(crate) fn calibration(
        &self,
        engine: &dyn Engine,
        version: &Version,
        job: &Job,
        site: &Site,
        made: impl Fn(&Calibrated),
    ) -> Result<Calibrated, String> {
        let name = format!("{} {} {:?}", engine.name(), version.0, job.settings);
        let cell = {
            let mut all = self.calibrations.lock().unwrap_or_else(PoisonError::into_inner);
            Arc::clone(all.entry(name).or_default())
        };
        let calibrate = || {
            let found = calibrate(engine, version, &job.settings, site, &self.slots, Earlier::Counts);
            found.inspect(|calibrated| made(calibrated)).map_err(|error| error.to_string())
        };
        cell.get_or_init(calibrate).clone()
    }
}
