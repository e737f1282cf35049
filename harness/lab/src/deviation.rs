//! How far changed readings deviate from what they must be, beyond the noise that both sides state.

use luxproof_model::{Estimate, Uncertainty};

/// The number of standard errors that count as noise.
const NOISE_STD_ERRORS: f64 = 3.0;
/// The relative rounding of readings in double precision, which counts as noise of every engine.
const ROUNDING_REL: f64 = 1e-12;
/// Readings darker than this part of the brightest are compared relative to it instead of relative
/// to themselves.
const FAINT_PART: f64 = 0.01;
/// Light is lost where a reading is below this part of the right one.
const LOST_PART: f64 = 0.5;

/// The comparison of readings with what they must be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Deviation {
    /// The largest relative deviation beyond noise.
    pub(super) beyond: f64,
    /// The largest relative noise; smaller deviations are invisible.
    pub(super) noise: f64,
    /// Whether most of the light is lost at a sensor.
    pub(super) is_lost: bool,
    /// Whether neither side is random.
    pub(super) is_exact: bool,
}

/// The illuminance in lx to which an error at a sensor is relative.
pub(super) fn scale(value_lx: f64, brightest_lx: f64) -> f64 {
    value_lx.max(FAINT_PART * brightest_lx).max(f64::MIN_POSITIVE)
}

/// Compares readings sensor by sensor; `brightest_lx` is the scale where all right readings are
/// zero.
pub(super) fn compare(read: &[Estimate], right: &[Estimate], brightest_lx: f64) -> Deviation {
    let brightest = right.iter().map(|r| r.value).fold(0.0, f64::max);
    let least = if brightest > 0.0 { FAINT_PART * brightest } else { brightest_lx.max(f64::MIN_POSITIVE) };
    // Noise has no relative value in a dark scene.
    let is_dark = brightest.max(brightest_lx) == 0.0;
    let mut found = Deviation { beyond: 0.0, noise: 0.0, is_lost: false, is_exact: true };
    for (a, b) in read.iter().zip(right) {
        let scale = b.value.max(least);
        let difference = Uncertainty::of_sum([(1.0, a.uncertainty), (-1.0, b.uncertainty)]);
        let noise =
            NOISE_STD_ERRORS * difference.standard_error().unwrap_or(0.0) + difference.bound() + ROUNDING_REL * scale;
        // A reading that is not a number deviates infinitely; `max` alone would drop it.
        let beyond = (a.value - b.value).abs() - noise;
        let beyond = if beyond.is_nan() { f64::INFINITY } else { beyond.max(0.0) };
        found.beyond = found.beyond.max(beyond / scale);
        found.noise = found.noise.max(if is_dark { 0.0 } else { noise / scale });
        found.is_lost |= beyond > 0.0 && b.value >= least && a.value < LOST_PART * b.value;
        found.is_exact &= !difference.is_sampled();
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
    fn only_a_deviation_that_noise_does_not_explain_counts() {
        let within = compare(&[noisy(1.02, 0.01)], &[noisy(1.0, 0.0)], 1.0);
        assert_eq!(within.beyond, 0.0);
        assert!((within.noise - 0.03).abs() < 1e-9);
        let beyond = compare(&[noisy(1.10, 0.01)], &[noisy(1.0, 0.0)], 1.0);
        assert!((beyond.beyond - 0.07).abs() < 1e-9 && !beyond.is_lost);
    }

    #[test]
    fn lost_light_differs_from_drift_and_nan_deviates_infinitely() {
        assert!(compare(&[noisy(0.01, 0.0)], &[noisy(1.0, 0.0)], 1.0).is_lost);
        assert_eq!(compare(&[noisy(f64::NAN, 0.0)], &[noisy(1.0, 0.0)], 1.0).beyond, f64::INFINITY);
    }

    #[test]
    fn darkness_is_compared_with_the_unchanged_scene() {
        assert!((compare(&[noisy(0.1, 0.0)], &[noisy(0.0, 0.0)], 10.0).beyond - 0.01).abs() < 1e-9);
        // A dark scene has no scale, so its noise does not count.
        let dark = compare(&[noisy(0.0, 1e-3)], &[noisy(0.0, 0.0)], 0.0);
        assert_eq!((dark.beyond, dark.noise), (0.0, 0.0));
    }
}
