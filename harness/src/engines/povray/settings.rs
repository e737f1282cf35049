//! POV-Ray's settings: three presets of its radiosity, any part of which a spec may override.

use luminaire::scene::Bounces;

use super::ID;
use crate::engines::settings::{Coordinates, Given, Preset};
use crate::engines::{EngineError, Job, Knob};

/// The deepest recursion that POV-Ray 3.7 accepts (`RadiosityFunction::DEPTH_MAX`).
pub(super) const MAX_RECURSION: u32 = 20;

/// Rays a sample of the audit preset, in full.
const AUDIT_RAYS: f64 = 200.0;
/// Relative standard error that the fewest blocks of so many rays about reach at the worst meter (case S1: .13 % in the mean of meters).
const AUDIT_ERROR: f64 = 0.0015;
/// Rays a sample at least where less is asked for: the bias of the cache was measured with 50, and grows as they get fewer.
pub(super) const MIN_AUDIT_RAYS: u32 = 70;

pub(super) const KNOBS: &[Knob] = &[
    Preset::KNOB,
    Knob { key: "count", values: &["200", "50"] },
    Knob { key: "error_bound", values: &["0.1", "0.5"] },
    Knob { key: "recursion_limit", values: &["20", "4"] },
    Knob { key: "recentre", values: &["true", "false"] },
];

#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Settings {
    /// `default` is `radiosity {}`.
    pub(super) preset: Preset,
    pub(super) count: u32,
    pub(super) error_bound: f64,
    /// Factor between what the scene holds and what POV-Ray gathers: see `export`.
    pub(super) brightness: f64,
    /// Diffuse reflections, where the job does not say.
    pub(super) recursion_limit: u32,
    pub(super) coordinates: Coordinates,
}

impl Settings {
    pub(super) fn of(job: &Job) -> Result<Self, EngineError> {
        let given = Given::of(job, ID, KNOBS)?;
        let preset = given.preset()?;
        let (count, error_bound, brightness, recursion_limit) = match preset {
            Preset::Audit => (audit_rays(job.budget.relative_error), 0.1, 8.0, MAX_RECURSION),
            Preset::Fast => (100, 0.5, 1.0, 6),
            // The numbers of POV-Ray 3.7's own `radiosity {}`, which is what is written.
            Preset::Default => (35, 1.8, 1.0, 2),
        };
        Ok(Self {
            preset,
            count: given.whole_number("count", 5..=100_000)?.unwrap_or(count),
            error_bound: given.number("error_bound", 1e-3..=10.0)?.unwrap_or(error_bound),
            brightness,
            recursion_limit: given.whole_number("recursion_limit", 1..=MAX_RECURSION)?.unwrap_or(recursion_limit),
            coordinates: given.coordinates("recentre")?,
        })
    }

    pub(super) fn radiosity(&self, bounces: Bounces) -> String {
        if self.preset == Preset::Default {
            return match bounces {
                Bounces::Converged => "radiosity { }".to_owned(),
                Bounces::AtMost(n) => format!("radiosity {{ recursion_limit {} }}", n.min(MAX_RECURSION)),
            };
        }
        // The pool is a Halton sequence (the classic table ends at 1600); a prime length keeps samples from meeting again.
        format!(
            "radiosity {{\n    count Count,Pool error_bound {} recursion_limit Limit nearest_count 1 low_error_factor 0.5\n    \
             pretrace_start 1 pretrace_end 1 always_sample on adc_bailout 1e-9 gray_threshold 0 brightness Brightness }}",
            self.error_bound
        )
    }

    pub(super) fn recursion_limit(&self, bounces: Bounces) -> u32 {
        match bounces {
            Bounces::Converged => self.recursion_limit.clamp(1, MAX_RECURSION),
            Bounces::AtMost(n) => n.clamp(1, MAX_RECURSION),
        }
    }
}

/// Length of the pool of sample directions, a prime; every level of recursion copies the pool, which takes its time.
pub(super) const POOL: u32 = 20_011;
/// The same for the first reflection alone, which has one level.
pub(super) const LONG_POOL: u32 = 200_003;
/// How many times as many rays the first reflection alone gets: at 16 its share of the spread is below a fifth.
pub(super) const FIRST_REFLECTION_RAYS: u32 = 16;

/// Rays a sample that the fewest blocks need for an error: noise and bias fall with their number (case S1, a block: 1.1 % with 50, .71 %
/// with 100, .37 % with 200), what they take grows a little faster.
fn audit_rays(relative_error: f64) -> u32 {
    (AUDIT_RAYS * AUDIT_ERROR / relative_error).clamp(f64::from(MIN_AUDIT_RAYS), AUDIT_RAYS) as u32
}
