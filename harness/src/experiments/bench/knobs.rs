//! The knob-effect check: which setting changes the result, which only the effort, and which does nothing.

use serde::Serialize;

use super::{Bench, Effort, LIMIT, Settings, Subject};
use crate::engines::{Engine, Job};
use crate::experiments::stress::judge;
use crate::measure::Outcome;
use crate::procedures::Task;
use crate::record::ReadingKey;
use crate::spec::Budget;

/// What a value of a setting does, against the default.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct KnobEffect {
    #[serde(flatten)]
    pub key: ReadingKey,
    /// The setting.
    pub knob: String,
    /// The value.
    pub value: String,
    pub effect: Effect,
    /// Largest deviation beyond noise from the reading by default, relative.
    pub deviation: Option<f64>,
    /// The noise beside it.
    pub noise: Option<f64>,
    /// Time over the time by default.
    pub time_ratio: Option<f64>,
}

/// What a setting does.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Effect {
    /// The readings differ beyond their noise.
    Result,
    /// The readings agree; scene, time or noise differ.
    Effort,
    /// What the engine gets, what it takes and what it reads are the same.
    Nothing,
    /// The engine refuses it, or fails with it.
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

/// What one reading of the check may take.
const BUDGET: Budget = Budget { relative_error: 0.005, seconds: 1.5 };
/// Times differ that differ by this factor.
const SLOWER: f64 = 1.5;

impl Bench<'_> {
    /// Every value of every setting of an engine but its default.
    pub(super) fn knob_effects(&self, subject: &Subject, task: &Task, job: &Job) -> Vec<KnobEffect> {
        let own = self.case.settings_of(&subject.engine.name());
        let effort = Effort { budget: BUDGET, seed: self.options.seed, limit: LIMIT };
        let read = |settings: &Settings| self.take(subject, task.procedure, job, settings, effort, None);
        let knobs: Vec<_> = subject.engine.knobs().iter().filter(|k| !own.contains_key(k.key)).collect();
        let tries = knobs.iter().flat_map(|k| k.values.iter().skip(1).map(move |v| (k.key, *v)));
        let Some(before) = (!knobs.is_empty()).then(|| read(&own)).flatten() else { return vec![] };
        if before.failure.is_some() {
            return vec![];
        }
        let effect = |(key, value): (&str, &str)| {
            let mut settings = own.clone();
            settings.insert(key.to_owned(), scalar(value));
            let after = read(&settings)?;
            let exported = |s: &Settings| {
                let job = Job { settings: s.clone(), budget: BUDGET, ..job.clone() };
                subject.engine.export(&job).ok()
            };
            let same_scene = exported(&own) == exported(&settings);
            Some(self.effect(subject.engine.as_ref(), task, (key, value), &before, &after, same_scene))
        };
        tries.filter_map(effect).collect()
    }

    fn effect(
        &self,
        engine: &dyn Engine,
        task: &Task,
        (knob, value): (&str, &str),
        before: &Outcome,
        after: &Outcome,
        same_scene: bool,
    ) -> KnobEffect {
        let (a, b) = (&after.estimates, &before.estimates);
        let found = judge::compare(a, b, 0.0);
        let time_ratio = after.wall_s / before.wall_s.max(1e-9);
        let same_time = (1.0 / SLOWER..SLOWER).contains(&time_ratio) || after.wall_s.max(before.wall_s) < 0.02;
        let same_noise = judge::compare(b, b, 0.0).noise / judge::compare(a, a, 0.0).noise.max(f64::MIN_POSITIVE);
        let effect = if after.failure.is_some() {
            Effect::Fails
        } else if found.beyond > 0.0 {
            Effect::Result
        } else if same_scene && same_time && (0.5..2.0).contains(&same_noise) {
            Effect::Nothing
        } else {
            Effect::Effort
        };
        let read = after.failure.is_none();
        KnobEffect {
            key: ReadingKey::new(&self.case.name, task.procedure, engine.name()),
            knob: knob.to_owned(),
            value: value.to_owned(),
            effect,
            deviation: read.then_some(found.beyond),
            noise: read.then_some(found.noise),
            time_ratio: read.then_some(time_ratio),
        }
    }
}

/// A number or truth value where it is one, else a word.
fn scalar(text: &str) -> serde_json::Value {
    serde_json::from_str(text).unwrap_or_else(|_| text.into())
}
