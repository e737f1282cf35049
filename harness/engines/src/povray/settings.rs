//! POV-Ray's settings: three presets of its radiosity, any part of which a spec may override.

use luxproof_scene::Bounces;
use luxproof_scene::geometry::Room;

use super::ID;
use crate::effort;
use crate::settings::{Coordinates, JobSettings, Preset};
use crate::{EngineError, Job, Setting};

/// The deepest recursion that POV-Ray 3.7 accepts (`RadiosityFunction::DEPTH_MAX`).
pub(super) const MAX_RECURSION: u32 = 20;

/// Rays a sample of the audit preset for a relative standard error, which some twelve blocks about reach (cachet's cases). The variance falls as fast as
/// work grows, about with their square, so that blocks of fewer rays take as much work for it, and the error of many is known better.
const AUDIT_RAYS: f64 = 50.0;
const AUDIT_ERROR: f64 = 0.002;
/// Rays a sample at least and at most, whatever error is asked for: the bias of the cache was measured with as few, and is no smaller with more.
const FEWEST_RAYS: f64 = 35.0;
const MOST_RAYS: f64 = 140.0;

pub(super) const SETTINGS: &[Setting] = &[
    Preset::KNOB,
    Setting { key: "count", values: &["50", "35"] },
    Setting { key: "error_bound", values: &["0.05", "0.5"] },
    Setting { key: "recursion_limit", values: &["20", "4"] },
    Setting { key: "recentre", values: &["true", "false"] },
];

#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Settings {
    /// `default` is `radiosity {}`.
    pub(super) preset: Preset,
    pub(super) count: u32,
    pub(super) error_bound: f64,
    /// The same for what is reflected more than twice.
    pub(super) error_bound_of_rest: f64,
    /// Factor between what the scene holds and what POV-Ray gathers: see `export`.
    pub(super) brightness: f64,
    /// Diffuse reflections, where the job does not say.
    pub(super) recursion_limit: u32,
    pub(super) coordinates: Coordinates,
}

impl Settings {
    pub(super) fn of(job: &Job) -> Result<Self, EngineError> {
        let given = JobSettings::of(job, ID, SETTINGS)?;
        let preset = given.preset()?;
        let (count, error_bound, brightness, recursion_limit) = match preset {
            Preset::Audit => (audit_rays(job.budget.relative_error), 0.05, 8.0, audit_recursion(job)),
            Preset::Fast => (100, 0.5, 1.0, 6),
            // The numbers of POV-Ray 3.7's own `radiosity {}`, which is what is written.
            Preset::Default => (35, 1.8, 1.0, 2),
        };
        let given_bound = given.number("error_bound", 1e-3..=10.0)?;
        let finer = if preset == Preset::Audit { job.scene.room.map_or(1.0, |room| rest_finer(&room)) } else { 1.0 };
        Ok(Self {
            preset,
            count: given.whole_number("count", 5..=100_000)?.unwrap_or(count),
            error_bound: given_bound.unwrap_or(error_bound),
            error_bound_of_rest: given_bound.unwrap_or(finer * error_bound),
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
             minimum_reuse 0.001 pretrace_start 1 pretrace_end 1 always_sample on adc_bailout 1e-9 gray_threshold 0\n    \
             brightness Brightness }}",
            if self.is_finer_for_rest() { "ErrorBound".to_owned() } else { self.error_bound.to_string() }
        )
    }

    /// The terms that a block adds up: light that is reflected n times and n - 1 times at most, read with the same rays, tells the nth reflection
    /// apart. The first, most of the noise and next to no work, is read with many rays, the second with some, and the rest with few.
    pub(super) fn terms(&self, bounces: Bounces) -> Vec<Term> {
        let all = Term { sign: 1.0, times: 1, limit: None, is_rest: true };
        if self.preset == Preset::Default {
            return vec![all];
        }
        let term = |sign, times, limit| Term { sign, times, limit: Some(limit), is_rest: false };
        let mut terms = vec![term(1.0, FIRST_REFLECTION_RAYS, 1)];
        let most = self.recursion_limit(bounces);
        if most > 1 {
            terms.extend([term(1.0, SECOND_REFLECTION_RAYS, 2), term(-1.0, SECOND_REFLECTION_RAYS, 1)]);
        }
        if most > 2 {
            terms.extend([all, Term { is_rest: true, ..term(-1.0, 1, 2) }]);
        }
        terms
    }

    pub(super) fn is_finer_for_rest(&self) -> bool {
        self.error_bound_of_rest < self.error_bound
    }

    pub(super) fn recursion_limit(&self, bounces: Bounces) -> u32 {
        match bounces {
            Bounces::Converged => self.recursion_limit.clamp(1, MAX_RECURSION),
            Bounces::AtMost(n) => n.clamp(1, MAX_RECURSION),
        }
    }
}

/// The error bound of the rest against that of the rest of the block, by the room. POV-Ray doubles the bound with every reflection, until one sample
/// serves for all of a room. That biases what is far from the light in a slender room (12 x 3 x 2.7 m, usual reflectances, 9 m from the only
/// luminaire: .05 reads +10 %, .01 +2 % within 1 %), and makes the noise of a bright one (mean reflectance .7: a thirteenth of the variance with .01,
/// for three times the work).
fn rest_finer(room: &Room) -> f64 {
    let bright = ((1.0 - effort::mean_reflectance(room)) / (1.0 - USUAL)).min(1.0).powi(3);
    let narrow = (COMPACT / slenderness(room)).powf(1.5);
    (bright.max(FINER) * narrow.max(FINER)).max(FINEST)
}

/// The longest side of a room against the shortest, at least that of a compact one.
pub(super) fn slenderness(room: &Room) -> f64 {
    (room.size_m.max_element() / room.size_m.min_element()).max(COMPACT)
}

/// Rooms so slender are as good as a cube, so bright as any that are darker.
pub(super) const COMPACT: f64 = 1.5;
pub(super) const USUAL: f64 = 0.5;
/// For one reason, and for both.
const FINER: f64 = 0.2;
const FINEST: f64 = 0.1;

/// Reflections that the audit preset follows, by how bright the room is on the mean, or the brightest body where that is brighter.
pub(super) fn audit_recursion(job: &Job) -> u32 {
    let Some(room) = &job.scene.room else { return MAX_RECURSION };
    let bodies = job.scene.obstacles.iter().map(|o| o.reflectance);
    let reflectance = bodies.fold(effort::mean_reflectance(room), f64::max);
    if reflectance.powi(SHARED_RECURSION as i32) <= LEFT_OUT { SHARED_RECURSION } else { MAX_RECURSION }
}

/// Reflections whose samples serve for many rays. From there on every ray takes one of its own, of five rays, so that the twentieth reflection takes
/// 12,500 to 15,000 rays a scene, as long as all that one meter takes else (35 to 140 rays a sample).
const SHARED_RECURSION: u32 = 17;
/// What is left out that is not worth that, relative.
const LEFT_OUT: f64 = 2e-5;

fn audit_rays(relative_error: f64) -> u32 {
    (AUDIT_RAYS * AUDIT_ERROR / relative_error).clamp(FEWEST_RAYS, MOST_RAYS) as u32
}

/// The length of the pool of directions, from which samples take as many as they have rays, one part after the other, and a block begins with one
/// of its first [`MAX_BLANKS`] parts. A pool of more parts has directions that none begins with, which was a bias of .5 % with 35 rays; one
/// of whole parts would give samples the same directions again. Every reflection copies it, which takes its time, but where only the first two are followed.
pub(super) fn pool(rays: u32) -> u32 {
    let parts = MAX_BLANKS * rays + 1;
    if rays <= MANY_RAYS { parts.min(POOL) } else { LONG_POOL }
}

/// How to say that in a scene.
pub(super) fn declared_pool() -> String {
    format!("#declare Pool = #if (Count > {MANY_RAYS}) {LONG_POOL}; #else min({MAX_BLANKS}*Count + 1, {POOL}); #end\n")
}

/// Blank pixels before the meters' at most, so that POV-Ray's least cell stays shorter than their spacing.
pub(super) const MAX_BLANKS: u32 = 200;
/// Primes.
const POOL: u32 = 20_011;
const LONG_POOL: u32 = 200_003;
const MANY_RAYS: u32 = POOL / 10;

/// The term that follows all reflections, where there are others beside it, which are the same however many these are.
pub(super) fn own_term(terms: &[Term]) -> Option<usize> {
    terms.iter().position(|term| term.limit.is_none()).filter(|_| terms.len() > 1)
}

/// How many times as many rays the first two reflections get: with so many, each has less of the spread than all further ones.
const FIRST_REFLECTION_RAYS: u32 = 48;
const SECOND_REFLECTION_RAYS: u32 = 3;

/// A term of a block: what has so many times the rays of the block, and so many reflections at most where not all that are asked for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Term {
    pub(super) sign: f64,
    pub(super) times: u32,
    pub(super) limit: Option<u32>,
    /// Whether it tells what is reflected more than twice.
    pub(super) is_rest: bool,
}
