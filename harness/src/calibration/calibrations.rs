//! The calibrations of a run: each is made once, by the first case that asks for it.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

use super::{Calibrated, Earlier, calibrate};
use crate::engines::Job;
use crate::measure::{Instrument, Reader};

#[derive(Debug, Default)]
pub struct Calibrations(Mutex<BTreeMap<String, Arc<Calibrating>>>);

type Calibrating = OnceLock<Result<Calibrated, String>>;

impl Calibrations {
    /// The calibration of an instrument with the settings of a job, kept or made now; `made` gets one that a first case asks for,
    /// where other cases find it or wait for it.
    pub fn of(
        &self,
        instrument: &Instrument,
        job: &Job,
        reader: &Reader,
        made: impl Fn(&Calibrated),
    ) -> Result<Calibrated, String> {
        let name = format!("{} {} {:?}", instrument.engine.name(), instrument.version.0, job.settings);
        let cell = {
            let mut all = self.0.lock().unwrap_or_else(PoisonError::into_inner);
            Arc::clone(all.entry(name).or_default())
        };
        let calibrate = || {
            let found = calibrate(instrument, &job.settings, reader, Earlier::Counts);
            found.inspect(|calibrated| made(calibrated)).map_err(|error| error.to_string())
        };
        cell.get_or_init(calibrate).clone()
    }
}
