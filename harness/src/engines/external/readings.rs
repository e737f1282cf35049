//! What an external adapter answers: readings with their errors, of one job or of several; pure.

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::{Deserialize, Deserializer};
use statrs::distribution::{ChiSquared, ContinuousCDF};

use super::json::{Protocol, chatter, from_json};
use crate::engines::contract::same_meters;
use crate::engines::{Blocks, EngineError, Job, Measurement, checked};
use crate::record::{EngineName, Estimate, Uncertainty};
use crate::system::printable;

/// A stated error is not that of blocks which scatter so much more that chance does it with a smaller probability.
const NO_CHANCE: f64 = 1e-6;
/// How far the mean of blocks may be from the reading, in parts of the brightest: both may be written with few digits.
const ROUNDED: f64 = 1e-5;

/// What an adapter answers to several jobs at once (protocol 2).
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ExternalAnswers {
    /// One a job, in any order.
    pub(super) answers: Vec<ExternalReadings>,
}

/// What an adapter prints on its standard output: one reading a meter in the job's order, or why it declines.
#[derive(Clone, Debug, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ExternalReadings {
    /// Which job it answers (protocol 2).
    pub(super) job: Option<String>,
    /// One a meter.
    readings: Vec<ReadingForm>,
    /// Instead of readings: why it cannot do this job, which is then skipped for this reason.
    declined: Option<String>,
    /// Instead of readings: why it failed at this job; other jobs of the batch keep theirs.
    failed: Option<String>,
    /// What was done, for whoever repeats it: versions, solver, options.
    settings: BTreeMap<String, String>,
    /// How much of it: samples, seeds, seconds; a baseline does not ask for the same.
    effort: BTreeMap<String, String>,
    /// What the reader of the report should know.
    notes: Vec<String>,
}

/// One reading.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct ReadingForm {
    /// The meter's name.
    meter: String,
    /// Illuminance, finite; what is negative is judged like any other. Null or `NaN`: this meter has none, which fails the engine, and those
    /// of the others are kept.
    #[serde(deserialize_with = "number")]
    illuminance_lx: f64,
    /// Standard error of a Monte Carlo mean.
    #[serde(default, deserialize_with = "some_number")]
    std_error_lx: Option<f64>,
    /// Distance within which the true value lies, for deterministic methods.
    #[serde(default, deserialize_with = "some_number")]
    error_bound_lx: Option<f64>,
    /// Of the standard error: one less than the independent samples that it was estimated from.
    #[serde(default, deserialize_with = "some_number")]
    degrees_of_freedom: Option<f64>,
    /// Whether the value is claimed to be right to its last digit.
    #[serde(default)]
    exact: bool,
    /// Independent estimates whose mean the reading is, the same number at every meter, the n-th of all of one origin: they tell the standard
    /// error, and how much of it meters share.
    #[serde(default, deserialize_with = "numbers")]
    blocks_lx: Vec<f64>,
}

/// A number, or what programs write in its place that have none.
#[derive(Deserialize)]
#[serde(untagged, expecting = "no number, where one belongs")]
enum Number {
    Told(f64),
    Word(NoNumber),
    Null(()),
}

/// As Python writes them, in quotes.
#[derive(Deserialize)]
enum NoNumber {
    #[serde(rename = "NaN", alias = "Infinity", alias = "-Infinity")]
    NotFinite,
}

impl From<Number> for f64 {
    fn from(number: Number) -> Self {
        match number {
            Number::Told(value) => value,
            Number::Word(NoNumber::NotFinite) | Number::Null(()) => Self::NAN,
        }
    }
}

fn number<'de, D: Deserializer<'de>>(from: D) -> Result<f64, D::Error> {
    Number::deserialize(from).map(f64::from)
}

fn some_number<'de, D: Deserializer<'de>>(from: D) -> Result<Option<f64>, D::Error> {
    Option::<Number>::deserialize(from).map(|number| number.map(f64::from))
}

fn numbers<'de, D: Deserializer<'de>>(from: D) -> Result<Vec<f64>, D::Error> {
    Vec::<Number>::deserialize(from).map(|numbers| numbers.into_iter().map(f64::from).collect())
}

impl ExternalReadings {
    /// What an adapter printed.
    pub fn from_json(text: &[u8]) -> Result<Self, serde_json::Error> {
        from_json(text)
    }

    /// The measurement that an adapter printed for a job, checked like every engine's.
    pub fn measured(text: &[u8], job: &Job, engine: &EngineName) -> Result<Measurement, EngineError> {
        let no_readings = |e| match chatter(text) {
            Some(why) => EngineError::garbled(engine.clone(), why),
            None => EngineError::no_readings(engine.clone(), &String::from_utf8_lossy(text), &e),
        };
        let answer = Self::from_json(text).map_err(no_readings)?;
        answer.measurement(job, engine, Protocol::One)
    }

    /// The same of an answer that was read already; every meter must be there once, in order.
    pub(super) fn measurement(
        self,
        job: &Job,
        engine: &EngineName,
        protocol: Protocol,
    ) -> Result<Measurement, EngineError> {
        checked(engine, job, measurement(self, job, engine, protocol)?)
    }
}

impl ReadingForm {
    /// What its blocks say of its error.
    fn of_blocks(&self) -> Option<Uncertainty> {
        let blocks = Blocks::new(self.blocks_lx.iter().map(|block| vec![*block]).collect());
        (blocks.count() > 1).then(|| blocks.weighted(&[(0, 1.0)]).uncertainty)
    }

    /// Whether it states a standard error that its blocks belie.
    fn is_belied(&self) -> bool {
        let (Some(stated), Some(of_blocks)) = (self.std_error_lx, self.of_blocks().and_then(|u| u.standard_error()))
        else {
            return false;
        };
        let freedom = self.blocks_lx.len() as f64 - 1.0;
        let chance = ChiSquared::new(freedom).map_or(1.0, |chi| chi.sf(freedom * (of_blocks / stated).powi(2)));
        chance < NO_CHANCE || stated == 0.0 && of_blocks > 0.0
    }

    fn uncertainty(&self) -> Uncertainty {
        let [error, bound] = [self.std_error_lx, self.error_bound_lx].map(|e| e.map(no_smaller_than_counts));
        let error = error.filter(|_| !self.is_belied());
        match (self.exact, error, self.of_blocks(), bound) {
            (true, ..) => Uncertainty::Exact,
            (_, Some(value), _, bound) => Uncertainty::StandardError {
                value,
                degrees_of_freedom: self.degrees_of_freedom.or_else(|| self.of_blocks()?.degrees_of_freedom()),
                bound: bound.unwrap_or(0.0),
            },
            (_, None, Some(of_blocks), bound) => of_blocks.within(bound.unwrap_or(0.0)),
            (_, None, None, Some(bound)) => Uncertainty::Bound(bound),
            (_, None, None, None) => Uncertainty::Unstated,
        }
    }

    /// What is wrong with what it states of its error, if anything is.
    fn senseless(&self, protocol: Protocol) -> Option<String> {
        let meter = &self.meter;
        if let Some(freedom) = self.degrees_of_freedom.filter(|f| *f < 1.0) {
            let why = "two samples have one, fewer tell no error";
            return Some(format!("gave `degrees_of_freedom: {freedom}` at {meter}: {why}"));
        }
        let is_sampled = self.std_error_lx.is_some() || !self.blocks_lx.is_empty();
        if protocol == Protocol::Two && self.exact && (is_sampled || self.error_bound_lx.is_some()) {
            return Some(format!("gave `exact: true` and an error at {meter}: what is exact has none"));
        }
        if protocol == Protocol::Two && self.degrees_of_freedom.is_some() && !is_sampled {
            return Some(format!("gave `degrees_of_freedom` without `std_error_lx` at {meter}: of what?"));
        }
        let count = self.blocks_lx.len();
        if count == 1 {
            return Some(format!("gave one number in `blocks_lx` at {meter}: one tells no error, give two at least"));
        }
        let mean = self.blocks_lx.iter().sum::<f64>() / count as f64;
        let brightest = self.blocks_lx.iter().fold(self.illuminance_lx.abs(), |most, block| most.max(block.abs()));
        let lux = self.illuminance_lx;
        (count > 1 && (mean - lux).abs() > ROUNDED * brightest)
            .then(|| format!("gave {lux} lx at {meter}, where the mean of `blocks_lx` is {mean}"))
    }
}

/// An error that is smaller is as good as this one, of which weights and fourth powers are numbers still.
fn no_smaller_than_counts(error_lx: f64) -> f64 {
    if error_lx > 0.0 { error_lx.max(1e-30) } else { error_lx }
}

fn measurement(
    answer: ExternalReadings,
    job: &Job,
    engine: &EngineName,
    protocol: Protocol,
) -> Result<Measurement, EngineError> {
    let output = |what: &str| EngineError::output(engine.clone(), what);
    if let Some(why) = &answer.failed {
        return Err(output(&format!("failed at this job: {why}")));
    }
    match answer.declined {
        Some(why) if why.trim().is_empty() => {
            return Err(output("declined for no reason: `declined` says what it cannot do"));
        }
        Some(_) if !answer.readings.is_empty() => {
            return Err(output("declined and gave readings: give either `declined` or `readings`"));
        }
        Some(why) => return Err(EngineError::Declined { engine: engine.clone(), why: printable::lines(&why) }),
        None => {}
    }
    if let Some(what) = answer.readings.iter().find_map(|reading| reading.senseless(protocol)) {
        return Err(output(&what));
    }
    same_meters(engine, job, answer.readings.iter().map(|reading| reading.meter.as_str()))?;
    let estimate = |r: &ReadingForm| Estimate { value: r.illuminance_lx, uncertainty: r.uncertainty() };
    let mut estimates: Vec<Estimate> = answer.readings.iter().map(estimate).collect();
    Estimate::mark_agreeing(&mut estimates);
    Estimate::mark_unseen(&mut estimates);
    let shown = |said: BTreeMap<String, String>| -> BTreeMap<String, String> {
        said.into_iter().map(|(key, value)| (printable::lines(&key), printable::lines(&value))).collect()
    };
    let notes = answer.notes.iter().map(|note| printable::lines(note)).chain(belied(&answer.readings));
    Ok(Measurement {
        estimates,
        samples: samples(&answer.readings).into_iter().collect(),
        method: shown(answer.settings).into_iter().collect(),
        effort: shown(answer.effort).into_iter().collect(),
        notes: notes.collect(),
        ..Measurement::default()
    })
}

/// The independent parts of all readings; nothing where some have none, or not as many as others.
fn samples(readings: &[ReadingForm]) -> Option<Blocks> {
    let count = readings.first().map(|r| r.blocks_lx.len()).filter(|count| *count > 1)?;
    let is_alike = readings.iter().all(|r| r.blocks_lx.len() == count && !r.exact);
    let block = |k: usize| readings.iter().map(|r| r.blocks_lx[k]).collect();
    is_alike.then(|| Blocks::new((0..count).map(block).collect()))
}

/// Where blocks scatter by more than the error that is stated beside them.
fn belied(readings: &[ReadingForm]) -> Option<String> {
    let mut belied = readings.iter().filter(|reading| reading.is_belied());
    let (first, more) = (belied.next()?, belied.count());
    let more = if more == 0 { String::new() } else { format!(" and {more} more") };
    Some(format!(
        "`std_error_lx` says less than `blocks_lx` scatter by at {}{more}: the blocks count there",
        printable::lines(&first.meter)
    ))
}
