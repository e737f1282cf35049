//! POV-Ray's settings: three presets of its radiosity, any number of which a spec may override.

use std::collections::BTreeMap;

use luminaire::scene::Bounces;

use crate::engines::{EngineError, Job, Knob};

use super::ID;

/// The deepest recursion that POV-Ray 3.7 accepts (`RadiosityFunction::DEPTH_MAX`).
pub(super) const DEEPEST: u32 = 20;

/// Rays a sample of the audit preset, in full.
const AUDIT_RAYS: f64 = 200.0;
/// Relative standard error that the fewest blocks of so many rays about reach (.22 % in case S1).
const AUDIT_ERROR: f64 = 0.002;
/// Rays a sample at least where less is asked for: the bias of the cache was measured with as few.
const LEAST_AUDIT_RAYS: f64 = 50.0;

/// What a spec may set, with values worth trying.
pub(super) const KNOBS: &[Knob] = &[
    Knob { key: "preset", values: &["audit", "fast", "default"] },
    Knob { key: "count", values: &["200", "50"] },
    Knob { key: "error_bound", values: &["0.1", "0.5"] },
    Knob { key: "recursion_limit", values: &["20", "4"] },
    Knob { key: "recentre", values: &["true", "false"] },
];

/// How POV-Ray is set up for a job.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Settings {
    pub(super) preset: Preset,
    /// Rays a radiosity sample.
    pub(super) count: u32,
    /// Radiosity's `error_bound`.
    pub(super) error_bound: f64,
    /// Factor between what the scene holds and what POV-Ray gathers: see `export`.
    pub(super) brightness: f64,
    /// Diffuse reflections, where the job does not say.
    pub(super) recursion_limit: u32,
    /// Whether the scene is moved to the origin and scaled to a handy size before it is written.
    pub(super) recentre: Recentring,
}

/// Named sets of radiosity settings.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Preset {
    /// What the instrument is capable of.
    Audit,
    /// What its users get: `radiosity {}`.
    Default,
    /// A quick look.
    Fast,
}

/// Whether coordinates are made handy before they are written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Recentring {
    /// Moved to the origin and, if tiny or huge, scaled.
    On,
    /// As the spec has them, to see how the renderer itself bears them.
    Off,
}

impl Settings {
    /// The job's settings, checked.
    pub(super) fn of(job: &Job) -> Result<Self, EngineError> {
        let known = ["preset", "count", "error_bound", "recursion_limit", "recentre"];
        if let Some(key) = job.settings.keys().find(|k| !known.contains(&k.as_str())) {
            return Err(wrong(key, &format!("no such setting; there are {}", known.join(", "))));
        }
        let mut settings = Self::preset(&job.settings)?;
        if let Some(count) = number(&job.settings, "count", 5.0..=100_000.0)? {
            settings.count = count as u32;
        } else if settings.preset == Preset::Audit {
            settings.count = audit_rays(job.budget.relative_error);
        }
        if let Some(bound) = number(&job.settings, "error_bound", 1e-3..=10.0)? {
            settings.error_bound = bound;
        }
        if let Some(limit) = number(&job.settings, "recursion_limit", 1.0..=f64::from(DEEPEST))? {
            settings.recursion_limit = limit as u32;
        }
        settings.recentre = match job.settings.get("recentre").map(serde_json::Value::as_bool) {
            None | Some(Some(true)) => Recentring::On,
            Some(Some(false)) => Recentring::Off,
            Some(None) => return Err(wrong("recentre", "must be true or false")),
        };
        Ok(settings)
    }

    fn preset(settings: &BTreeMap<String, serde_json::Value>) -> Result<Self, EngineError> {
        let recentre = Recentring::On;
        match settings.get("preset").map_or(Some("audit"), serde_json::Value::as_str) {
            Some("audit") => Ok(Self {
                preset: Preset::Audit,
                count: AUDIT_RAYS as u32,
                error_bound: 0.1,
                brightness: 8.0,
                recursion_limit: DEEPEST,
                recentre,
            }),
            // The numbers of POV-Ray 3.7's own `radiosity {}`, which is what is written.
            Some("default") => Ok(Self {
                preset: Preset::Default,
                count: 35,
                error_bound: 1.8,
                brightness: 1.0,
                recursion_limit: 2,
                recentre,
            }),
            Some("fast") => Ok(Self {
                preset: Preset::Fast,
                count: 100,
                error_bound: 0.5,
                brightness: 1.0,
                recursion_limit: 6,
                recentre,
            }),
            _ => Err(wrong("preset", "must be audit, default or fast")),
        }
    }

    /// The `radiosity` block for a number of diffuse reflections.
    pub(super) fn radiosity(&self, bounces: Bounces) -> String {
        if self.preset == Preset::Default {
            return match bounces {
                Bounces::Converged => "radiosity { }".to_owned(),
                Bounces::AtMost(n) => format!("radiosity {{ recursion_limit {} }}", n.min(DEEPEST)),
            };
        }
        // The pool is a Halton sequence (the classic table ends at 1600); a prime length keeps samples from meeting again.
        format!(
            "radiosity {{\n    count Count,Pool error_bound {} recursion_limit Limit nearest_count 1 low_error_factor 0.5\n    \
             pretrace_start 1 pretrace_end 1 always_sample on adc_bailout 1e-9 gray_threshold 0 brightness Brightness }}",
            self.error_bound
        )
    }

    /// `recursion_limit` for a number of diffuse reflections.
    pub(super) fn recursion_limit(&self, bounces: Bounces) -> u32 {
        match bounces {
            Bounces::Converged => self.recursion_limit.clamp(1, DEEPEST),
            Bounces::AtMost(n) => n.clamp(1, DEEPEST),
        }
    }
}

/// Length of the pool of sample directions, a prime; every level of recursion copies the pool, which takes its time.
pub(super) const POOL: u32 = 20_011;
/// The same for the first reflection alone, which has one level.
pub(super) const LONG_POOL: u32 = 200_003;
/// How many times as many rays the first reflection alone gets: at 16 its share of the spread is below a fifth.
pub(super) const FIRST_REFLECTION_RAYS: u32 = 16;

impl Preset {
    /// Its name in specs.
    pub(super) const fn name(self) -> &'static str {
        match self {
            Self::Audit => "audit",
            Self::Default => "default",
            Self::Fast => "fast",
        }
    }
}

fn number(
    settings: &BTreeMap<String, serde_json::Value>,
    key: &str,
    range: std::ops::RangeInclusive<f64>,
) -> Result<Option<f64>, EngineError> {
    let Some(value) = settings.get(key) else { return Ok(None) };
    match value.as_f64().filter(|v| range.contains(v)) {
        Some(value) => Ok(Some(value)),
        None => Err(wrong(key, &format!("must be a number within {} and {}", range.start(), range.end()))),
    }
}

fn wrong(key: &str, what: &str) -> EngineError {
    EngineError::Setting { engine: ID, key: key.to_owned(), what: what.to_owned() }
}

/// Rays a sample that the fewest blocks need for an error; the noise falls with their square root, and the bias with their number.
fn audit_rays(relative_error: f64) -> u32 {
    (AUDIT_RAYS * AUDIT_ERROR / relative_error).clamp(LEAST_AUDIT_RAYS, AUDIT_RAYS) as u32
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::engines::fixtures;

    #[test]
    fn unknown_settings_and_senseless_values_are_errors_that_name_the_key() {
        for (key, value) in [
            ("cuont", serde_json::json!(3)),
            ("count", serde_json::json!("many")),
            ("error_bound", serde_json::json!(-1)),
            ("recursion_limit", serde_json::json!(21)),
            ("preset", serde_json::json!("best")),
            ("recentre", serde_json::json!(1)),
        ] {
            let mut job = fixtures::s1(fixtures::CONVERGED);
            job.settings.insert(key.to_owned(), value);
            let text = Settings::of(&job).unwrap_err().to_string();
            assert!(text.starts_with(&format!("engines.povray.{key}: ")), "{text}");
        }
    }
}
