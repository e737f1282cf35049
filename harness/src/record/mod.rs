//! Readings: what one engine says at one meter, with its uncertainty.

mod agreement;
mod basis;
mod design_effect;
mod key;
mod light;
mod method;
mod release;
mod scatter;
mod stated_errors;
mod status;
mod uncertainty;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

pub use agreement::Agreement;
pub use basis::Basis;
pub use design_effect::{design_effect, design_effect_of_squares};
pub use key::{EngineName, MeterId, ProcedureId, ReadingKey, UnknownProcedure, family};
pub use light::{Light, UnknownLight};
pub use method::{Effort, Method};
pub use release::{NoRelease, Release};
pub use scatter::Tails;
pub use stated_errors::{Doubt, Sheltered, StatedErrors, Variation};
pub use status::{EngineStatus, FailureKind, Role, Status};
pub use uncertainty::Uncertainty;

/// The physical quantity of a reading and its unit.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
pub enum Quantity {
    /// Illuminance in lux.
    #[serde(rename = "illuminance_lx")]
    Illuminance,
    /// Luminous intensity in candela.
    #[serde(rename = "luminous_intensity_cd")]
    LuminousIntensity,
    /// Luminance in candela per square metre.
    #[serde(rename = "luminance_cd_m2")]
    Luminance,
    /// Unified glare rating, a logarithm.
    #[serde(rename = "unified_glare_rating")]
    GlareRating,
}

impl Quantity {
    /// The unit's symbol.
    pub const fn unit(self) -> &'static str {
        match self {
            Self::Illuminance => "lx",
            Self::LuminousIntensity => "cd",
            Self::Luminance => "cd/m²",
            Self::GlareRating => "UGR",
        }
    }

    /// Whether zero of it is nothing, so that parts of it mean something; a rating is a logarithm, of any sign.
    pub const fn has_zero(self) -> bool {
        !matches!(self, Self::GlareRating)
    }
}

/// A scatter that rounding makes, relative.
const ROUNDING: f64 = 1e-6;

/// A value with what is stated of its error, both in one unit.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Estimate {
    pub value: f64,
    #[serde(flatten)]
    pub uncertainty: Uncertainty,
}

impl Estimate {
    /// Darkness, for certain.
    pub const DARK: Self = Self { value: 0.0, uncertainty: Uncertainty::Bound(0.0) };

    /// The mean of independent samples; of a single one nothing is known.
    pub fn of_samples(samples: &[f64]) -> Self {
        let n = samples.len() as f64;
        let value = samples.iter().sum::<f64>() / n;
        if samples.len() < 2 {
            return Self { value, uncertainty: Uncertainty::Unstated };
        }
        let sum_of_squares: f64 = samples.iter().map(|s| (s - value).powi(2)).sum();
        let std_error = (sum_of_squares / (n - 1.0) / n).sqrt();
        Self { value, uncertainty: Uncertainty::sampled(std_error, Some(n - 1.0)) }
    }

    /// Tells those that no sample met, where samples met others: zero hits are no standard error of zero.
    pub fn mark_unseen(all: &mut [Self]) {
        let is_sampled = |e: &Self| e.uncertainty.standard_error().is_some();
        if all.iter().any(|e| is_sampled(e) && e.value > 0.0) {
            let dark = |e: &&mut Self| e.value == 0.0 && e.uncertainty.standard_error() == Some(0.0);
            all.iter_mut().filter(dark).for_each(|e| e.uncertainty = Uncertainty::NotSeen);
        }
    }

    /// Tells those whose samples all agree but for rounding, where those of others do not: what the others met may still be to come there.
    pub fn mark_agreeing(all: &mut [Self]) {
        // What is no error, NaN say, agrees with nothing.
        let error = |e: &Self| e.uncertainty.standard_error().filter(|_| e.uncertainty.is_sound());
        let scatters = |e: &Self| Some(error(e)? > ROUNDING * e.value.abs());
        if all.iter().any(|e| scatters(e) == Some(true)) {
            let agree = |e: &&mut Self| scatters(e) == Some(false) && e.uncertainty.bound() == 0.0;
            all.iter_mut().filter(agree).for_each(|e| e.uncertainty = Uncertainty::NotSeen);
        }
    }

    /// A value without error.
    pub const fn exact(value: f64) -> Self {
        Self { value, uncertainty: Uncertainty::Exact }
    }

    /// The weighted sum of estimates of one run, whose errors may be all one: they add up.
    pub fn of_one_run(weights: &[f64], estimates: &[Self]) -> Self {
        let pairs = || weights.iter().zip(estimates);
        let uncertainty = Uncertainty::of_dependent_sum(pairs().map(|(w, e)| (*w, e.uncertainty)));
        Self { value: pairs().map(|(w, e)| w * e.value).sum(), uncertainty }
    }

    /// The sum with an independent one.
    #[must_use]
    pub fn plus(&self, other: &Self) -> Self {
        let uncertainty = Uncertainty::of_sum([(1.0, self.uncertainty), (1.0, other.uncertainty)]);
        Self { value: self.value + other.value, uncertainty }
    }

    /// That of the value times a factor.
    #[must_use]
    pub fn times(&self, factor: f64) -> Self {
        Self { value: factor * self.value, uncertainty: self.uncertainty.times(factor) }
    }
}

/// One value at one meter.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Reading {
    pub meter: MeterId,
    pub quantity: Quantity,
    /// How much, in the quantity's unit.
    pub value: f64,
    #[serde(flatten)]
    pub uncertainty: Uncertainty,
}

/// Everything one engine said of one procedure of one case, with what is needed to say it again.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Recording {
    #[serde(flatten)]
    pub key: ReadingKey,
    /// The engine's version, as it names itself.
    pub version: String,
    /// What the engine takes part for.
    #[serde(default)]
    pub role: Role,
    /// The luminaire model: point, area, impostor, or mixed.
    #[serde(default)]
    pub model: String,
    /// Which light counted.
    pub light: Light,
    /// SHA-256 of the spec and of every file that it names.
    pub input_sha256: String,
    /// SHA-256 of what was measured, whatever its files are called: known deviations of one case are on record under it.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub content_sha256: String,
    /// Seed of every random choice.
    pub seed: u64,
    /// What the engine did. Files of before effort was told apart have both under `settings`.
    #[serde(alias = "settings")]
    pub method: Method,
    /// How much of it, by which random numbers and where.
    #[serde(default)]
    pub effort: Effort,
    /// Where the engine only approximates what was asked.
    pub approximation: Option<String>,
    /// How far off it says that leaves its readings, relative to them.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub declared_error: Option<f64>,
    /// What the reader of a report should know.
    pub notes: Vec<String>,
    /// Wall-clock seconds.
    pub wall_s: f64,
    /// Seconds that its sampling takes at the rate that the engine counts with, on any machine; none for one that keeps to the clock.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub work_s: Option<f64>,
    /// What it shares with other engines: witnesses that share a component count once.
    #[serde(default)]
    pub components: Vec<String>,
    /// At which of several planned looks each reading was last sampled, counted from 1; empty where one look was planned.
    #[serde(default)]
    pub looks: Vec<u32>,
    /// How skewed the blocks of its samples are, in standard deviations of what normal blocks would be: a heavy tail.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub skewness: Option<f64>,
    /// How much of their noise its meters share: the variance of their mean over that of independent meters; null where it is not known.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub design_effect: Option<f64>,
    /// How its stated errors agree with how readings of other seeds scatter, where that was looked at: of what was sampled, and of
    /// what is claimed to be determined.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub stated_errors: Vec<StatedErrors>,
    /// The command that repeats it by hand in the folder that `luxproof export` makes, where there is one.
    #[serde(default)]
    pub command: Option<String>,
    /// Why there are no readings, if there are none.
    pub failure: Option<String>,
    /// How they came to be none; files of before it was told have a text alone.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub failure_kind: Option<FailureKind>,
    /// The readings, one a meter; a report lists them by themselves.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub readings: Vec<Reading>,
}

impl Recording {
    /// Whether its standard errors vary from seed to seed as a heavy tail makes them.
    pub fn states_heavy_tail(&self) -> bool {
        self.stated_errors.iter().any(|s| s.doubt == Some(Doubt::HeavyTail))
    }

    /// One without readings yet.
    pub fn of(key: ReadingKey, light: Light) -> Self {
        Self {
            key,
            version: String::new(),
            role: Role::Renderer,
            model: String::new(),
            light,
            input_sha256: String::new(),
            content_sha256: String::new(),
            seed: 1,
            method: Method::default(),
            effort: Effort::default(),
            approximation: None,
            declared_error: None,
            notes: vec![],
            wall_s: 0.0,
            work_s: None,
            components: vec![],
            looks: vec![],
            skewness: None,
            design_effect: None,
            stated_errors: vec![],
            command: None,
            failure: None,
            failure_kind: None,
            readings: vec![],
        }
    }

    /// The reading of the target with this number, whose meter is this; one that failed may lack some.
    pub fn reading(&self, k: usize, meter: &MeterId) -> Option<&Reading> {
        let known = &self.readings[..self.readings.len().min(k + 1)];
        match &self.failure {
            None => self.readings.get(k),
            Some(_) => known.iter().rev().find(|reading| reading.meter == *meter),
        }
    }

    /// What sampling has taken of a budget, in seconds: counted where the engine counts, by the clock where not.
    pub fn work_s(&self) -> f64 {
        self.work_s.unwrap_or(self.wall_s)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn standard_error_is_that_of_the_mean() {
        let estimate = |value, uncertainty| Estimate { value, uncertainty };
        assert_eq!(Estimate::of_samples(&[1.0, 3.0]), estimate(2.0, Uncertainty::sampled(1.0, Some(1.0))));
        assert_eq!(Estimate::of_samples(&[5.0]), estimate(5.0, Uncertainty::Unstated));
    }
}
