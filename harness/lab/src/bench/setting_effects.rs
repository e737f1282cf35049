//! The effect of settings: which setting changes the result, which changes only the effort, and
//! which does nothing.

use serde::Serialize;

use super::{CurveRunner, Settings};
use crate::deviation::compare;
use luxproof_audit::measure::{CostedMeasurement, Failure, Instrument};
use luxproof_engines::{Engine, Job, SceneFile};
use luxproof_model::ReadingKey;
use luxproof_spec::Budget;

/// What a value of a setting does.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SettingEffect {
    #[serde(flatten)]
    pub key: ReadingKey,
    pub setting: String,
    pub value: String,
    pub effect: Effect,
    /// The largest relative deviation beyond noise from the reading with the default.
    pub deviation: Option<f64>,
    pub noise: Option<f64>,
    /// The time over the time with the default.
    pub time_ratio: Option<f64>,
}

/// What kind of change a value makes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Effect {
    Result,
    Effort,
    Nothing,
    Fails,
}

impl Effect {
    /// The text for it in a table.
    pub const fn label(self) -> &'static str {
        match self {
            Self::Result => "changes the result",
            Self::Effort => "changes the effort or the scene, not the result",
            Self::Nothing => "does nothing here",
            Self::Fails => "fails here",
        }
    }
}

/// The budget of a reading for a setting.
const KNOB_BUDGET: Budget = Budget { relative_error: 0.005, seconds: 1.5 };
/// The ratio from which two times count as different.
const MIN_TIME_RATIO: f64 = 1.5;
/// Times below this are too short to compare.
const MIN_COMPARED_S: f64 = 0.02;

impl CurveRunner<'_> {
    /// Measures the effect of every value of every setting except the defaults and the settings of
    /// the spec.
    pub(super) fn measure_setting_effects(&self, subject: &Instrument, job: &Job) -> Vec<SettingEffect> {
        let (case, engine) = (self.trials.case, subject.engine.as_ref());
        let defaults = case.settings_of(&engine.name());
        let settings: Vec<_> = engine.settings().iter().filter(|k| !defaults.contains_key(k.key)).collect();
        // Without a setting to try, the reading with the defaults has no use.
        if settings.is_empty() {
            return vec![];
        }
        let Some(Ok(before)) = self.read_with(subject, job, &defaults) else { return vec![] };
        let mut effects = vec![];
        for (setting, value) in settings.iter().flat_map(|k| k.values.iter().skip(1).map(|v| (k.key, *v))) {
            let mut settings = defaults.clone();
            settings.insert(setting.to_owned(), parse_scalar(value));
            let Some(after) = self.read_with(subject, job, &settings) else { continue };
            let key = ReadingKey::new(&case.name, job.procedure, engine.name());
            let is_same_scene = export_scene(engine, job, &defaults) == export_scene(engine, job, &settings);
            effects.push(SettingEffect::from_readings(key, (setting, value), &before, &after, is_same_scene));
        }
        effects
    }

    /// Reads a job with settings; `None` where the time is up.
    fn read_with(
        &self,
        subject: &Instrument,
        job: &Job,
        settings: &Settings,
    ) -> Option<Result<CostedMeasurement, Failure>> {
        self.trials.take(subject, job, settings, self.effort(KNOB_BUDGET, 0), (None, 0))
    }
}

/// The scene files of an engine with settings; `None` where it has none.
fn export_scene(engine: &dyn Engine, job: &Job, settings: &Settings) -> Option<Vec<SceneFile>> {
    engine.export(&Job { settings: settings.clone(), budget: KNOB_BUDGET, ..job.clone() }).ok()
}

impl SettingEffect {
    /// Compares the readings with the default and with another value.
    fn from_readings(
        key: ReadingKey,
        (setting, value): (&str, &str),
        before: &CostedMeasurement,
        after: &Result<CostedMeasurement, Failure>,
        is_same_scene: bool,
    ) -> Self {
        let (setting, value) = (setting.to_owned(), value.to_owned());
        let Ok(after) = after else {
            return Self { key, setting, value, effect: Effect::Fails, deviation: None, noise: None, time_ratio: None };
        };
        let (a, b) = (&after.measurement.estimates, &before.measurement.estimates);
        let found = compare(a, b, 0.0);
        let (after_s, before_s) = (after.cost.wall_s, before.cost.wall_s);
        let time_ratio = after_s / before_s.max(1e-9);
        let is_same_time =
            (1.0 / MIN_TIME_RATIO..MIN_TIME_RATIO).contains(&time_ratio) || after_s.max(before_s) < MIN_COMPARED_S;
        // A setting that changes the number of samples changes the noise, even if time does not
        // show it.
        let noise_ratio = compare(b, b, 0.0).noise / compare(a, a, 0.0).noise.max(f64::MIN_POSITIVE);
        let effect = if found.beyond > 0.0 {
            Effect::Result
        } else if is_same_scene && is_same_time && (0.5..2.0).contains(&noise_ratio) {
            Effect::Nothing
        } else {
            Effect::Effort
        };
        let (deviation, noise, time_ratio) = (Some(found.beyond), Some(found.noise), Some(time_ratio));
        Self { key, setting, value, effect, deviation, noise, time_ratio }
    }
}

/// A value as JSON where it is a number or a truth value, else as text.
fn parse_scalar(text: &str) -> serde_json::Value {
    serde_json::from_str(text).unwrap_or_else(|_| text.into())
}
