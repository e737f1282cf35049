//! The knob-effect check: which setting changes the result, which only the effort, and which does nothing.

use serde::Serialize;

use super::{Bench, Settings};
use crate::engines::Job;
use crate::experiments::deviation::compare;
use crate::measure::{Failure, Instrument, Taken};
use crate::record::ReadingKey;
use crate::spec::Budget;

#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct KnobEffect {
    #[serde(flatten)]
    pub key: ReadingKey,
    pub knob: String,
    pub value: String,
    pub effect: Effect,
    /// Largest deviation beyond noise from the reading by default, relative.
    pub deviation: Option<f64>,
    pub noise: Option<f64>,
    /// Time over the time by default.
    pub time_ratio: Option<f64>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Effect {
    Result,
    Effort,
    Nothing,
    Fails,
}

impl Effect {
    pub const fn words(self) -> &'static str {
        match self {
            Self::Result => "changes the result",
            Self::Effort => "changes the effort or the scene, not the result",
            Self::Nothing => "does nothing here",
            Self::Fails => "fails here",
        }
    }
}

const BUDGET: Budget = Budget { relative_error: 0.005, seconds: 1.5 };
/// Times differ that differ by this factor.
const SLOWER: f64 = 1.5;

impl Bench<'_> {
    /// Every value of every setting of an engine but its default.
    pub(super) fn knob_effects(&self, subject: &Instrument, job: &Job) -> Vec<KnobEffect> {
        let (case, engine) = (self.trials.case, subject.engine.as_ref());
        let own = case.settings_of(&engine.name());
        let read = |settings: &Settings| self.trials.take(subject, job, settings, self.effort(BUDGET, 0), (None, 0));
        let knobs: Vec<_> = engine.knobs().iter().filter(|k| !own.contains_key(k.key)).collect();
        let tries = knobs.iter().flat_map(|k| k.values.iter().skip(1).map(move |v| (k.key, *v)));
        let Some(Ok(before)) = (!knobs.is_empty()).then(|| read(&own)).flatten() else { return vec![] };
        let exported = |s: &Settings| engine.export(&Job { settings: s.clone(), budget: BUDGET, ..job.clone() }).ok();
        let effect = |(knob, value): (&str, &str)| {
            let mut settings = own.clone();
            settings.insert(knob.to_owned(), scalar(value));
            let after = read(&settings)?;
            let key = ReadingKey::new(&case.name, job.procedure, engine.name());
            let same_scene = exported(&own) == exported(&settings);
            Some(KnobEffect::of(key, (knob, value), &before, &after, same_scene))
        };
        tries.filter_map(effect).collect()
    }
}

impl KnobEffect {
    fn of(
        key: ReadingKey,
        (knob, value): (&str, &str),
        before: &Taken,
        after: &Result<Taken, Failure>,
        same_scene: bool,
    ) -> Self {
        let (knob, value) = (knob.to_owned(), value.to_owned());
        let Ok(after) = after else {
            return Self { key, knob, value, effect: Effect::Fails, deviation: None, noise: None, time_ratio: None };
        };
        let (a, b) = (&after.measurement.estimates, &before.measurement.estimates);
        let found = compare(a, b, 0.0);
        let (after_s, before_s) = (after.cost.wall_s, before.cost.wall_s);
        let time_ratio = after_s / before_s.max(1e-9);
        let same_time = (1.0 / SLOWER..SLOWER).contains(&time_ratio) || after_s.max(before_s) < 0.02;
        let noise_ratio = compare(b, b, 0.0).noise / compare(a, a, 0.0).noise.max(f64::MIN_POSITIVE);
        let effect = if found.beyond > 0.0 {
            Effect::Result
        } else if same_scene && same_time && (0.5..2.0).contains(&noise_ratio) {
            Effect::Nothing
        } else {
            Effect::Effort
        };
        let (deviation, noise, time_ratio) = (Some(found.beyond), Some(found.noise), Some(time_ratio));
        Self { key, knob, value, effect, deviation, noise, time_ratio }
    }
}

fn scalar(text: &str) -> serde_json::Value {
    serde_json::from_str(text).unwrap_or_else(|_| text.into())
}
