//! What a spec sets of an engine, `engines: {radiance: {preset: fast}}`, read by one rule: a key is one of the engine's knobs.

use std::fmt::Display;
use std::ops::RangeInclusive;

use serde_json::Value;

use super::contract::{Job, Setting, list, only_known};
use super::job_dir::EngineError;
use luxproof_model::EngineName;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Preset {
    /// No short cut that costs accuracy, and as many samples as the budget asks for.
    Audit,
    /// A quick look: a fixed, small number of samples.
    Fast,
    /// What the renderer's users get who change none of its defaults.
    Default,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Coordinates {
    /// Moved and scaled where its absolute tolerances or its 32-bit floats need that.
    Fitted,
    /// Those of the spec, to see how the renderer itself bears them.
    Raw,
}

impl Preset {
    pub(super) const KNOB: Setting = Setting { key: "preset", values: &["audit", "fast", "default"] };

    pub(super) const fn name(self) -> &'static str {
        Self::KNOB.values[self as usize]
    }
}

/// The settings of a job, of which every key is known.
pub(super) struct JobSettings<'a> {
    engine: EngineName,
    job: &'a Job,
}

impl<'a> JobSettings<'a> {
    pub(super) fn of(job: &'a Job, engine: EngineName, settings: &[Setting]) -> Result<Self, EngineError> {
        only_known(&engine, job, settings)?;
        Ok(Self { engine, job })
    }

    pub(super) fn preset(&self) -> Result<Preset, EngineError> {
        let presets = [Preset::Audit, Preset::Fast, Preset::Default].map(|p| (p.name(), p));
        Ok(self.one_of(Preset::KNOB.key, &presets)?.unwrap_or(Preset::Audit))
    }

    /// Coordinates that `key: false` leaves as they are.
    pub(super) fn coordinates(&self, key: &str) -> Result<Coordinates, EngineError> {
        match self.job.settings.get(key) {
            None | Some(Value::Bool(true)) => Ok(Coordinates::Fitted),
            Some(Value::Bool(false)) => Ok(Coordinates::Raw),
            Some(other) => Err(self.must_be(key, other, "true or false")),
        }
    }

    pub(super) fn one_of<T: Copy>(&self, key: &str, words: &[(&str, T)]) -> Result<Option<T>, EngineError> {
        let Some(value) = self.job.settings.get(key) else { return Ok(None) };
        match words.iter().find(|(word, _)| value.as_str() == Some(*word)) {
            Some((_, meaning)) => Ok(Some(*meaning)),
            None => Err(self.must_be(key, value, list(words.iter().map(|(word, _)| *word), "or"))),
        }
    }

    pub(super) fn number(&self, key: &str, range: RangeInclusive<f64>) -> Result<Option<f64>, EngineError> {
        let Some(value) = self.job.settings.get(key) else { return Ok(None) };
        match value.as_f64().filter(|v| range.contains(v)) {
            Some(number) => Ok(Some(number)),
            None => Err(self.must_be(key, value, format!("a number from {} to {}", range.start(), range.end()))),
        }
    }

    pub(super) fn whole_number(&self, key: &str, range: RangeInclusive<u32>) -> Result<Option<u32>, EngineError> {
        let Some(value) = self.job.settings.get(key) else { return Ok(None) };
        let whole = value.as_f64().filter(|v| v.fract() == 0.0).map(|v| v as u32);
        match whole.filter(|v| range.contains(v)) {
            Some(number) => Ok(Some(number)),
            None => Err(self.must_be(key, value, format!("a whole number from {} to {}", range.start(), range.end()))),
        }
    }

    fn must_be(&self, key: &str, value: &Value, what: impl Display) -> EngineError {
        self.error(key, format!("{value} must be {what}"))
    }

    fn error(&self, key: &str, what: String) -> EngineError {
        EngineError::Setting { engine: self.engine.clone(), key: key.to_owned(), what }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{all, fixtures};
    use serde_json::json;

    fn export_with(engine: &str, key: &str, value: &Value) -> Result<(), String> {
        let engine = all().into_iter().find(|e| e.name() == *engine).unwrap();
        let mut job = fixtures::s1(fixtures::CONVERGED);
        job.settings.insert(key.to_owned(), value.clone());
        engine.export(&job).map(|_| ()).map_err(|e| e.to_string())
    }

    #[test]
    fn senseless_settings_are_errors_that_name_key_and_remedy() {
        for (engine, key, value, says) in [
            ("povray", "cuont", json!(3), "preset, count, error_bound, recursion_limit and recentre"),
            ("povray", "count", json!("many"), "a whole number from 5 to 100000"),
            ("povray", "error_bound", json!(-1), "-1 must be a number from 0.001 to 10"),
            ("povray", "recursion_limit", json!(21), "1 to 20"),
            ("povray", "preset", json!("best"), "audit, fast or default"),
            ("povray", "recentre", json!(1), "true or false"),
            ("radiance", "preset", json!("best"), "audit, fast or default"),
            ("radiance", "ambient_divisions", json!(0), "from 1 to 1000000"),
            ("radiance", "ambient_divisions", json!(2.5), "a whole number"),
            ("radiance", "impostor_height_m", json!(0), "0.002 to 10"),
            ("radiance", "speed", json!(1), "no such setting"),
            ("mitsuba", "variant", json!("llvm_ad_spectral"), "llvm_ad_mono"),
            ("mitsuba", "variant", json!("cycles"), "llvm_ad_rgb"),
            ("mitsuba", "preset", json!("best"), "audit, fast or default"),
            ("cycles", "samples", json!(9), "no such setting; there are preset, photometry and recentre"),
            ("luxcore", "preset", json!("best"), "audit, fast or default"),
            ("mitsuba", "samples", json!("9"), "no such setting; there are preset, variant, integrator and recentre"),
        ] {
            let text = export_with(engine, key, &value).unwrap_err();
            assert!(text.starts_with(&format!("engines.{engine}.{key}: ")) && text.contains(says), "{text}");
        }
    }

    #[test]
    fn every_value_that_a_knob_lists_is_taken() {
        for engine in all() {
            for setting in engine.settings() {
                for value in setting.values {
                    let value = serde_json::from_str(value).unwrap_or_else(|_| json!(value));
                    assert_eq!(
                        export_with(&engine.name(), setting.key, &value),
                        Ok(()),
                        "{} {}",
                        engine.name(),
                        setting.key
                    );
                }
            }
        }
    }
}
