//! Limits that give a false alarm every so many nights.

use statrs::distribution::{Continuous, ContinuousCDF, Normal};

/// Half the shift that the sums are designed for, in standard errors.
pub(super) const REFERENCE_VALUE: f64 = 1.0;
/// Nights of the moving sum.
pub(super) const WINDOW_NIGHTS: usize = 5;
/// The share of the false alarms for the moving sum; the cumulative sums and single nights have the rest.
const SHARE_OF_WINDOW: f64 = 0.75;
/// The share of the false alarms for single nights.
const SHARE_OF_NIGHTS: f64 = 0.05;

#[derive(Clone, Copy, Debug)]
pub(super) struct Limits {
    /// The limit of either cumulative sum.
    pub(super) sum: f64,
    /// The limit of the moving sum over the square root of its number of nights, on either side.
    pub(super) window: f64,
    /// The limit of one night on either side.
    pub(super) night: f64,
}

impl Limits {
    /// Limits that give a group one false alarm in so many nights.
    pub(super) fn for_nights(nights: f64) -> Self {
        Self {
            sum: root(|limit| nights_of_sums(limit) - nights / (1.0 - SHARE_OF_WINDOW - SHARE_OF_NIGHTS)),
            window: root(|limit| nights_of_window(limit) - nights / SHARE_OF_WINDOW),
            night: root(|limit| 0.5 / Normal::standard().sf(limit) - nights / SHARE_OF_NIGHTS),
        }
    }

    /// Whether the moving sum of the last nights exceeds its limit.
    pub(super) fn are_exceeded_by(self, last: impl ExactSizeIterator<Item = f64>) -> bool {
        last.len() == WINDOW_NIGHTS && last.sum::<f64>().abs() > self.window * (WINDOW_NIGHTS as f64).sqrt()
    }
}

/// Nights between alarms of both cumulative sums together (Siegmund, Sequential Analysis (1985), section 2.6).
fn nights_of_sums(limit: f64) -> f64 {
    // For one sum; both together alarm twice as often. 1.166 is the overshoot of normal steps.
    let b = 2.0 * REFERENCE_VALUE * (limit + 1.166);
    (b.exp() - 1.0 - b) / (2.0 * REFERENCE_VALUE * REFERENCE_VALUE) / 2.0
}

/// Nights between alarms of a moving sum on either side.
///
/// After Siegmund and Venkatraman (Using the generalized likelihood ratio statistic for sequential detection of a change-point, Ann.
/// Statist. 23 (1995)), with a fixed window.
fn nights_of_window(limit: f64) -> f64 {
    let normal = Normal::standard();
    let y = limit * (2.0 / WINDOW_NIGHTS as f64).sqrt();
    // The overshoot of the discrete steps, in its closed approximation.
    let nu = 2.0 / y * (normal.cdf(0.5 * y) - 0.5) / (0.5 * y * normal.cdf(0.5 * y) + normal.pdf(0.5 * y));
    1.0 / (2.0 * normal.pdf(limit) * limit / WINDOW_NIGHTS as f64 * nu)
}

/// The zero of a function that grows with its argument, by bisection.
fn root(function: impl Fn(f64) -> f64) -> f64 {
    let (mut low, mut high) = (0.5, 40.0);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if function(middle) < 0.0 { low = middle } else { high = middle }
    }
    high
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sums_alarm_as_often_as_the_tables_say() {
        // Two sums with reference value 1 and limit 2.52: 370 steps between false alarms (Hawkins and Olwell 1998, table 3.1).
        let limit = root(|limit| nights_of_sums(limit) - 370.4);
        assert!((limit - 2.52).abs() < 0.05, "{limit}");
    }

    #[test]
    fn the_last_nights_alarm_as_often_as_white_noise_shows() {
        let limits = Limits::for_nights(200.0);
        let mut random = fastrand::Rng::with_seed(1);
        let (mut alarms, nights) = (0, 400_000);
        let mut last = std::collections::VecDeque::new();
        for _ in 0..nights {
            last.push_back(luxproof_process::random::normal(&mut random));
            last.drain(..last.len().saturating_sub(WINDOW_NIGHTS));
            if limits.are_exceeded_by(last.iter().copied()) {
                alarms += 1;
                last.clear();
            }
        }
        let ratio = f64::from(nights) * SHARE_OF_WINDOW / 200.0 / f64::from(alarms);
        assert!((ratio - 1.0).abs() < 0.12, "{ratio}");
    }

    /// The mean number of steps until a sum of normal numbers, less the reference value, exceeds a limit: by a Markov chain of its
    /// values (D. Brook and D. A. Evans, Biometrika 59 (1972)).
    fn steps_of_one_sum(limit: f64) -> f64 {
        const STATES: usize = 60;
        let (normal, width) = (Normal::standard(), 2.0 * limit / (2.0 * STATES as f64 - 1.0));
        let mut transitions = vec![];
        for from in 0..STATES {
            let upto = (0..=STATES).map(|to| {
                let edge = (to as f64 - 0.5 - from as f64) * width + REFERENCE_VALUE;
                if to == 0 { 0.0 } else { normal.cdf(edge) }
            });
            let upto: Vec<f64> = upto.collect();
            transitions.push(upto.windows(2).map(|pair| pair[1] - pair[0]).collect::<Vec<f64>>());
        }
        let mut steps = vec![0.0; STATES];
        for _ in 0..40_000 {
            let next = transitions.iter().map(|row| 1.0 + row.iter().zip(&steps).map(|(p, s)| p * s).sum::<f64>());
            steps = next.collect();
        }
        steps[0]
    }

    #[test]
    fn each_limit_has_its_share_of_the_false_alarms() {
        let limits = Limits::for_nights(100.0);
        // Sums have a fifth: one alarm of either in 500 nights, and of one of them in 1000.
        let steps = steps_of_one_sum(limits.sum);
        // The approximation promises six per cent more.
        assert!((930.0..1000.0).contains(&steps), "{} {steps}", limits.sum);
        // Single nights have a twentieth: one in 2000 beyond 3.4808 on either side.
        assert!((limits.night - 3.4808).abs() < 1e-4, "{}", limits.night);
    }

    #[test]
    fn nights_between_alarms_are_those_of_the_published_formulas() {
        // Siegmund: b = 2 (2 + 1.166) = 6.332, and (exp(6.332) - 7.332) / 4. With 1: b = 4.332.
        assert!((nights_of_sums(2.0) / 138.737_007_5 - 1.0).abs() < 1e-9, "{}", nights_of_sums(2.0));
        assert!((nights_of_sums(1.0) / 17.691_081_8 - 1.0).abs() < 1e-8, "{}", nights_of_sums(1.0));
        // Siegmund and Venkatraman: y = 3 at 3 sqrt(5/2). nu = 2/3 (.9331928 - .5) / (1.5 * .9331928 + .1295176) = .1888406, and
        // the rate 2 * 5.189148e-6 * 4.743416 / 5 * nu.
        let found = nights_of_window(3.0 * 2.5_f64.sqrt());
        assert!((found / 537_844.0 - 1.0).abs() < 1e-5, "{found}");
        assert!((nights_of_window(2.0) / 49.069_887_16 - 1.0).abs() < 1e-6, "{}", nights_of_window(2.0));
    }

    #[test]
    fn a_root_is_found_between_a_half_and_forty() {
        for zero in [0.625, 3.0, 39.5] {
            assert!((root(|x| x - zero) - zero).abs() < 1e-12, "{zero}");
        }
        // The moving sum has three quarters: one alarm in 400 nights of 300.
        let limits = Limits::for_nights(300.0);
        assert!((nights_of_window(limits.window) / 400.0 - 1.0).abs() < 1e-9, "{}", limits.window);
    }

    #[test]
    fn five_nights_exceed_their_limit_together_on_either_side() {
        let limits = Limits { sum: 1.0, window: 2.0, night: 3.0 };
        // 2 sqrt(5) = 4.4721.
        for (last, is_exceeded) in [
            (&[0.9; 5][..], true),
            (&[-0.9; 5], true),
            (&[0.89; 5], false),
            (&[-0.89; 5], false),
            (&[9.0; 4], false),
            (&[5.0, 5.0, 0.0, -5.0, 0.0], true),
            (&[5.0, 5.0, -5.0, -5.0, 0.0], false),
        ] {
            assert_eq!(limits.are_exceeded_by(last.iter().copied()), is_exceeded, "{last:?}");
        }
        // A sum at the limit does not exceed it.
        assert!(!Limits { window: 0.0, ..limits }.are_exceeded_by([0.0; 5].into_iter()));
    }
}
