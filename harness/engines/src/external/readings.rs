//! Parses and checks the answers of an adapter: readings with their errors, one answer per job. Nothing here starts a program.

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::{Deserialize, Deserializer};
use statrs::distribution::{ChiSquared, ContinuousCDF};

use super::json::{chatter, from_json};
use crate::contract::same_meters;
use crate::{Answer, Blocks, EngineError, Job, Measurement, checked};
use luxproof_model::{EngineName, Estimate, Uncertainty};
use luxproof_process::printable;

/// A stated error is not that of blocks which scatter so much more that chance does it with a smaller probability.
const NO_CHANCE: f64 = 1e-6;
/// How far the mean of blocks may be from the reading, in parts of the brightest: both may be written with few digits.
const ROUNDED: f64 = 1e-5;

/// What an adapter prints on its standard output: one answer per job.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ExternalAnswers {
    /// One per job, in any order.
    answers: Vec<AnswerForm>,
}

/// The answer to one job: one reading per meter in the job's order, or the reason why there are none.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct AnswerForm {
    /// The name of the job that it answers.
    job: String,
    /// One reading per meter.
    #[serde(default)]
    readings: Vec<ReadingForm>,
    /// Instead of readings: why it cannot do this job, which is then skipped for this reason.
    #[serde(default)]
    declined: Option<String>,
    /// Instead of readings: why it failed at this job. The other jobs of the request keep their readings.
    #[serde(default)]
    failed: Option<String>,
    /// What was done, for repetitions: versions, solver, options.
    #[serde(default)]
    settings: BTreeMap<String, String>,
    /// How much was done: samples, seeds, seconds. A baseline does not require the same.
    #[serde(default)]
    effort: BTreeMap<String, String>,
    /// What the reader of the report should know.
    #[serde(default)]
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
    Stated(f64),
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
            Number::Stated(value) => value,
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

impl ExternalAnswers {
    /// Parses what an adapter printed for some jobs. Returns one checked measurement or error per job.
    ///
    /// # Errors
    ///
    /// Fails if the text is no JSON of answers, or if it lacks a job or answers another one.
    pub fn measurements(text: &[u8], jobs: &[&Job], engine: &EngineName) -> Result<Vec<Answer>, EngineError> {
        let parsed: Self = from_json(text).map_err(|error| match chatter(text) {
            Some(why) => EngineError::garbled(engine.clone(), why),
            None => EngineError::no_readings(engine.clone(), &String::from_utf8_lossy(text), &error),
        })?;
        let mut forms = parsed.answers;
        let mut measurements = vec![];
        for (place, job) in jobs.iter().enumerate() {
            let name = job_name(job, place);
            let Some(found) = forms.iter().position(|answer| answer.job == name) else {
                return Err(EngineError::garbled(engine.clone(), format!("gave no answer to the job `{name}`")));
            };
            let form = forms.swap_remove(found);
            // Every meter must be there once, in order.
            let measurement = measurement(form, job, engine);
            measurements.push(measurement.and_then(|measurement| checked(engine, job, measurement)));
        }
        match forms.first().filter(|_| measurements.iter().all(Result::is_ok)) {
            None => Ok(measurements),
            Some(other) => {
                let what = format!("answered a job `{}` that it was not asked, or twice", other.job);
                Err(EngineError::garbled(engine.clone(), what))
            }
        }
    }
}

/// Returns the name of a job in a request. `place` counts from 0.
pub(super) fn job_name(job: &Job, place: usize) -> String {
    format!("{}/{}/{}", job.case, job.procedure, place + 1)
}

impl ReadingForm {
    /// Returns the uncertainty by its blocks.
    fn of_blocks(&self) -> Option<Uncertainty> {
        let blocks = Blocks::new(self.blocks_lx.iter().map(|block| vec![*block]).collect());
        (blocks.count() > 1).then(|| blocks.weighted(&[(0, 1.0)]).uncertainty)
    }

    /// Returns whether its blocks scatter by more than its stated standard error allows.
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

    /// Returns what is wrong with its stated error, or `None`.
    fn senseless(&self) -> Option<String> {
        let meter = &self.meter;
        if let Some(freedom) = self.degrees_of_freedom.filter(|f| *f < 1.0) {
            let why = "two samples have one, fewer tell no error";
            return Some(format!("gave `degrees_of_freedom: {freedom}` at {meter}: {why}"));
        }
        let is_sampled = self.std_error_lx.is_some() || !self.blocks_lx.is_empty();
        if self.exact && (is_sampled || self.error_bound_lx.is_some()) {
            return Some(format!("gave `exact: true` and an error at {meter}: what is exact has none"));
        }
        if self.degrees_of_freedom.is_some() && !is_sampled {
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

/// Raises a tiny error to one with finite weights and fourth powers. The difference does not matter to any verdict.
fn no_smaller_than_counts(error_lx: f64) -> f64 {
    if error_lx > 0.0 { error_lx.max(1e-30) } else { error_lx }
}

fn measurement(answer: AnswerForm, job: &Job, engine: &EngineName) -> Result<Measurement, EngineError> {
    if let Some(why) = &answer.failed {
        return Err(EngineError::output(engine.clone(), format!("failed at this job: {why}")));
    }
    match answer.declined {
        Some(why) if why.trim().is_empty() => {
            let what = "declined for no reason: `declined` says what it cannot do";
            return Err(EngineError::output(engine.clone(), what));
        }
        Some(_) if !answer.readings.is_empty() => {
            let what = "declined and gave readings: give either `declined` or `readings`";
            return Err(EngineError::output(engine.clone(), what));
        }
        Some(why) => return Err(EngineError::Declined { engine: engine.clone(), why: printable::lines(&why) }),
        None => {}
    }
    if let Some(what) = answer.readings.iter().find_map(ReadingForm::senseless) {
        return Err(EngineError::output(engine.clone(), what));
    }
    same_meters(engine, job, answer.readings.iter().map(|reading| reading.meter.as_str()))?;
    let mut estimates: Vec<Estimate> =
        answer.readings.iter().map(|r| Estimate { value: r.illuminance_lx, uncertainty: r.uncertainty() }).collect();
    Estimate::mark_agreeing(&mut estimates);
    Estimate::mark_unseen(&mut estimates);
    let notes = answer.notes.iter().map(|note| printable::lines(note)).chain(belied(&answer.readings));
    Ok(Measurement {
        estimates,
        samples: samples(&answer.readings).into_iter().collect(),
        method: printable_map(answer.settings).into_iter().collect(),
        effort: printable_map(answer.effort).into_iter().collect(),
        notes: notes.collect(),
        ..Measurement::default()
    })
}

/// Replaces characters that a terminal would interpret, in keys and values.
fn printable_map(map: BTreeMap<String, String>) -> BTreeMap<String, String> {
    map.into_iter().map(|(key, value)| (printable::lines(&key), printable::lines(&value))).collect()
}

/// Returns the blocks of all readings, or `None` if some readings have no blocks or a different number of them.
fn samples(readings: &[ReadingForm]) -> Option<Blocks> {
    let count = readings.first().map(|r| r.blocks_lx.len()).filter(|count| *count > 1)?;
    if readings.iter().any(|r| r.blocks_lx.len() != count || r.exact) {
        return None;
    }
    Some(Blocks::new((0..count).map(|k| readings.iter().map(|r| r.blocks_lx[k]).collect()).collect()))
}

/// Returns a note about readings with blocks that scatter by more than their stated error.
fn belied(readings: &[ReadingForm]) -> Option<String> {
    let mut belied = readings.iter().filter(|reading| reading.is_belied());
    let (first, more) = (belied.next()?, belied.count());
    let more = if more == 0 { String::new() } else { format!(" and {more} more") };
    Some(format!(
        "`std_error_lx` says less than `blocks_lx` scatter by at {}{more}: the blocks count there",
        printable::lines(&first.meter)
    ))
}
