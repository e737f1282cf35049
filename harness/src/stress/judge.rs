//! How far changed readings are from what they must be, beyond the noise that both state; pure.

use crate::measure::Outcome;

/// Standard errors that count as noise.
const COVERAGE: f64 = 3.0;
/// Relative rounding of readings in double precision, whatever an engine states.
const ROUNDING: f64 = 1e-12;
/// Readings darker than this part of the brightest are held against that instead of themselves.
const FAINT: f64 = 0.01;
/// Below this part of what is right, light is lost.
const LOST: f64 = 0.5;

/// A value with what is stated of its error, in lux.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Reading {
    pub(crate) value: f64,
    pub(crate) std_error: f64,
    pub(crate) bound: f64,
}

impl Reading {
    pub(crate) fn exact(value: f64) -> Self {
        Self { value, std_error: 0.0, bound: 0.0 }
    }
}

/// What a comparison found, relative.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Compared {
    /// The largest deviation beyond noise.
    pub(crate) beyond: f64,
    /// The largest noise: what could not have been seen.
    pub(crate) noise: f64,
    /// Whether most of the light was gone somewhere.
    pub(crate) is_lost: bool,
    /// Whether neither side is random.
    pub(crate) is_exact: bool,
}

pub(crate) fn readings(outcome: &Outcome) -> Vec<Reading> {
    let reading = |e: &crate::engines::Estimate| Reading {
        value: e.value_lx,
        std_error: e.std_error_lx.unwrap_or(0.0),
        bound: e.error_bound_lx.unwrap_or(0.0),
    };
    outcome.estimates.iter().map(reading).collect()
}

pub(crate) fn times(readings: &[Reading], factor: f64) -> Vec<Reading> {
    let of =
        |r: &Reading| Reading { value: factor * r.value, std_error: factor * r.std_error, bound: factor * r.bound };
    readings.iter().map(of).collect()
}

pub(crate) fn add(sum: &mut [Reading], part: &[Reading]) {
    for (s, p) in sum.iter_mut().zip(part) {
        *s = Reading { value: s.value + p.value, std_error: s.std_error.hypot(p.std_error), bound: s.bound + p.bound };
    }
}

/// The weighted mean; errors add up as if they were all one, since those of one run may be.
pub(crate) fn mean(readings: &[Reading], weights: &[f64]) -> Reading {
    let over = |f: &dyn Fn(&Reading) -> f64| readings.iter().zip(weights).map(|(r, w)| w * f(r)).sum();
    Reading { value: over(&|r| r.value), std_error: over(&|r| r.std_error), bound: over(&|r| r.bound) }
}

/// Compares station by station; `brightest_lx` is the scale where all that is right is dark.
pub(crate) fn compare(read: &[Reading], right: &[Reading], brightest_lx: f64) -> Compared {
    let brightest = right.iter().map(|r| r.value).fold(0.0, f64::max);
    let least = if brightest > 0.0 { FAINT * brightest } else { brightest_lx.max(f64::MIN_POSITIVE) };
    let mut found = Compared { beyond: 0.0, noise: 0.0, is_lost: false, is_exact: true };
    for (a, b) in read.iter().zip(right) {
        let scale = b.value.max(least);
        let noise = COVERAGE * a.std_error.hypot(b.std_error) + a.bound + b.bound + ROUNDING * scale;
        // Written so that what is no number counts as infinitely far off.
        let beyond = (a.value - b.value).abs() - noise;
        let beyond = if beyond.is_nan() { f64::INFINITY } else { beyond.max(0.0) };
        found.beyond = found.beyond.max(beyond / scale);
        found.noise = found.noise.max(noise / scale);
        found.is_lost |= beyond > 0.0 && b.value >= least && a.value < LOST * b.value;
        found.is_exact &= a.std_error == 0.0 && b.std_error == 0.0;
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    fn noisy(value: f64, std_error: f64) -> Reading {
        Reading { value, std_error, bound: 0.0 }
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
    }
}
