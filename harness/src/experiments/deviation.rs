//! How far changed readings are from what they must be, beyond the noise that both state; pure.

use crate::record::{Estimate, Uncertainty};

/// Standard errors that count as noise.
const COVERAGE: f64 = 3.0;
/// Relative rounding of readings in double precision, whatever an engine states.
const ROUNDING: f64 = 1e-12;
/// Readings darker than this part of the brightest are held against that instead of themselves.
const FAINT: f64 = 0.01;
/// Below this part of what is right, light is lost.
const LOST: f64 = 0.5;

#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Compared {
    /// The largest deviation beyond noise.
    pub(super) beyond: f64,
    /// The largest noise: what could not have been seen.
    pub(super) noise: f64,
    /// Whether most of the light was gone somewhere.
    pub(super) is_lost: bool,
    /// Whether neither side is random.
    pub(super) is_exact: bool,
}

/// What an error at a station of that value counts against, in lx.
pub(super) fn scale(value_lx: f64, brightest_lx: f64) -> f64 {
    value_lx.max(FAINT * brightest_lx).max(f64::MIN_POSITIVE)
}

/// Compares station by station; `brightest_lx` is the scale where all that is right is dark.
pub(super) fn compare(read: &[Estimate], right: &[Estimate], brightest_lx: f64) -> Compared {
    let brightest = right.iter().map(|r| r.value).fold(0.0, f64::max);
    let least = if brightest > 0.0 { FAINT * brightest } else { brightest_lx.max(f64::MIN_POSITIVE) };
    // Of nothing no noise is a part.
    let is_dark = brightest.max(brightest_lx) == 0.0;
    let mut found = Compared { beyond: 0.0, noise: 0.0, is_lost: false, is_exact: true };
    for (a, b) in read.iter().zip(right) {
        let scale = b.value.max(least);
        let apart = Uncertainty::of_sum([(1.0, a.uncertainty), (-1.0, b.uncertainty)]);
        let noise = COVERAGE * apart.standard_error().unwrap_or(0.0) + apart.bound() + ROUNDING * scale;
        // Written so that what is no number counts as infinitely far off.
        let beyond = (a.value - b.value).abs() - noise;
        let beyond = if beyond.is_nan() { f64::INFINITY } else { beyond.max(0.0) };
        found.beyond = found.beyond.max(beyond / scale);
        found.noise = found.noise.max(if is_dark { 0.0 } else { noise / scale });
        found.is_lost |= beyond > 0.0 && b.value >= least && a.value < LOST * b.value;
        found.is_exact &= !apart.is_sampled();
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    fn noisy(value: f64, std_error: f64) -> Estimate {
        Estimate { value, uncertainty: Uncertainty::sampled(std_error, None) }
    }

    #[test]
    fn only_what_noise_does_not_explain_counts() {
        let within = compare(&[noisy(1.02, 0.01)], &[noisy(1.0, 0.0)], 1.0);
        assert_eq!(within.beyond, 0.0);
        assert!((within.noise - 0.03).abs() < 1e-9);
        let beyond = compare(&[noisy(1.10, 0.01)], &[noisy(1.0, 0.0)], 1.0);
        assert!((beyond.beyond - 0.07).abs() < 1e-9 && !beyond.is_lost);
    }

    #[test]
    fn lost_light_is_told_from_drift_and_nan_is_infinitely_far() {
        assert!(compare(&[noisy(0.01, 0.0)], &[noisy(1.0, 0.0)], 1.0).is_lost);
        assert_eq!(compare(&[noisy(f64::NAN, 0.0)], &[noisy(1.0, 0.0)], 1.0).beyond, f64::INFINITY);
    }

    #[test]
    fn darkness_is_held_against_the_scene_as_it_was() {
        assert!((compare(&[noisy(0.1, 0.0)], &[noisy(0.0, 0.0)], 10.0).beyond - 0.01).abs() < 1e-9);
        // And of a scene that was dark noise is no part.
        let dark = compare(&[noisy(0.0, 1e-3)], &[noisy(0.0, 0.0)], 0.0);
        assert_eq!((dark.beyond, dark.noise), (0.0, 0.0));
    }
}
