//! What is stated of errors, held against how readings of other seeds scatter.

use std::fmt;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use statrs::distribution::{ChiSquared, ContinuousCDF};

use super::{Estimate, Uncertainty};

/// Stated errors that vary as they do with a smaller probability are a heavy tail: the chi-squared distribution is only nearly theirs.
const UNHEARD_OF: f64 = 1e-4;
/// A scatter that is less probable than this, were the stated errors right, is told.
const TOLD: f64 = 0.005;
/// One that is less probable than this counts in verdicts, told or not: a Birge ratio (R. T. Birge, Phys. Rev. 40 (1932)).
const COUNTED: f64 = 0.05;
/// Degrees of freedom of a standard error that tells none: more than that would make little of how it may vary.
const FEW: f64 = 3.0;
/// What readings that are the same differ by, in what is stated of them: rounding.
const SAME: f64 = 1e-6;
/// How many times too large a stated error is before that is told: some care is nobody's fault.
const MIN_EXCESS: f64 = 3.0;

/// How the readings of one engine in one case scatter from seed to seed, over what it states of their errors.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct StatedErrors {
    /// Scatter over stated standard error, root of the mean square; null where no error was stated.
    pub ratio: Option<f64>,
    /// Of the scatter: repeated readings less the meters that they were taken at.
    pub degrees_of_freedom: f64,
    /// The probability of a ratio as far from 1, were the stated errors right.
    pub p_value: Option<f64>,
    /// Relative scatter of readings that are claimed to have none, root of the mean square.
    pub of_claims: Option<f64>,
    pub doubt: Option<Doubt>,
}

/// What is wrong with stated errors: a finding of its own, whatever the verdicts.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Doubt {
    TooSmall,
    TooLarge,
    /// They vary from seed to seed by more than their degrees of freedom have it: a few samples hold much of the light.
    HeavyTail,
    /// What is claimed to be determined scatters.
    Scatters,
    /// Every seed reads the same, although errors of sampling are stated.
    SameForEverySeed,
}

impl StatedErrors {
    /// Of readings whose errors are stated, one list a meter; meters whose error is not of sampling say nothing.
    pub fn of_sampled(meters: &[Vec<Estimate>]) -> Option<Self> {
        let (mut sum, mut degrees_of_freedom) = (0.0, 0.0);
        for readings in meters {
            let error = |e: &Estimate| e.uncertainty.standard_error().filter(|e| *e > 0.0);
            let stated: Vec<(f64, f64)> = readings.iter().filter_map(|e| Some((e.value, error(e)?.powi(-2)))).collect();
            let weights: f64 = stated.iter().map(|(_, w)| w).sum();
            let mean = stated.iter().map(|(x, w)| x * w).sum::<f64>() / weights;
            sum += stated.iter().map(|(x, w)| w * (x - mean).powi(2)).sum::<f64>();
            degrees_of_freedom += stated.len().saturating_sub(1) as f64;
        }
        if !sum.is_finite() {
            return None;
        }
        let chance = ChiSquared::new(degrees_of_freedom).ok()?;
        let (below, above) = (chance.cdf(sum), chance.sf(sum));
        let ratio = (sum / degrees_of_freedom).sqrt();
        let doubt = match ratio {
            r if r < SAME => Some(Doubt::SameForEverySeed),
            _ if heavy_tailed(meters) => Some(Doubt::HeavyTail),
            _ if above < TOLD => Some(Doubt::TooSmall),
            r if below < TOLD && r < 1.0 / MIN_EXCESS => Some(Doubt::TooLarge),
            _ => None,
        };
        let p_value = Some(2.0 * below.min(above));
        Some(Self { ratio: Some(ratio), degrees_of_freedom, p_value, of_claims: None, doubt })
    }

    /// Of readings that are claimed to be determined and are not.
    pub fn of_claims(meters: &[Vec<Estimate>]) -> Option<Self> {
        let (mut sum, mut degrees_of_freedom) = (0.0, 0.0);
        for readings in meters {
            let mean = readings.iter().map(|e| e.value).sum::<f64>() / readings.len() as f64;
            if mean > 0.0 {
                sum += readings.iter().map(|e| (e.value / mean - 1.0).powi(2)).sum::<f64>();
                degrees_of_freedom += readings.len().saturating_sub(1) as f64;
            }
        }
        let relative = (sum / degrees_of_freedom).sqrt();
        let doubted = Self {
            ratio: None,
            degrees_of_freedom,
            p_value: None,
            of_claims: Some(relative),
            doubt: Some(Doubt::Scatters),
        };
        (relative > 0.0 && relative.is_finite()).then_some(doubted)
    }

    /// A reading with the error that it has by all that was found of its engine.
    #[must_use]
    pub fn corrected(found: &[Self], estimate: Estimate) -> Estimate {
        found.iter().fold(estimate, |estimate, stated| stated.correct(estimate))
    }

    /// What a reading's error is, by how such readings scatter.
    ///
    /// A standard error says how readings scatter, and nothing else: one that is far too large is as wrong as one that is too
    /// small. What may be off in every reading alike is a bound.
    #[must_use]
    fn correct(&self, estimate: Estimate) -> Estimate {
        let freedom = self.degrees_of_freedom;
        let uncertainty = match (estimate.uncertainty, self.ratio, self.of_claims) {
            (Uncertainty::StandardError { value, degrees_of_freedom, bound }, Some(ratio), _)
                if value > 0.0 && self.counts(ratio) =>
            {
                let degrees_of_freedom = degrees_of_freedom.map_or(freedom, |of_stated| {
                    // Relative variances of the two standard errors add up.
                    (of_stated.recip() + freedom.recip()).recip()
                });
                Uncertainty::StandardError { value: ratio * value, degrees_of_freedom: Some(degrees_of_freedom), bound }
            }
            (stated, None, Some(relative)) => Uncertainty::StandardError {
                value: relative * estimate.value,
                degrees_of_freedom: Some(freedom),
                bound: stated.bound(),
            },
            (stated, ..) => stated,
        };
        Estimate { uncertainty, ..estimate }
    }

    fn counts(&self, ratio: f64) -> bool {
        match self.doubt {
            Some(Doubt::TooSmall | Doubt::TooLarge | Doubt::Scatters) => true,
            Some(Doubt::SameForEverySeed) => false,
            Some(Doubt::HeavyTail) | None => ratio > 1.0 && self.p_value.is_some_and(|p| p < 2.0 * COUNTED),
        }
    }
}

/// Whether standard errors stated for readings of one effort, all but the last of each meter, vary more than those of normal samples:
/// the logarithm of a variance with n degrees of freedom has the variance psi'(n / 2) (Bartlett and Kendall, Suppl. J. Roy. Statist.
/// Soc. 8 (1946)).
fn heavy_tailed(meters: &[Vec<Estimate>]) -> bool {
    let (mut sum, mut freedom) = (0.0, 0.0);
    for readings in meters {
        let repeated = readings.iter().take(readings.len().saturating_sub(1)).map(|e| e.uncertainty);
        let stated = repeated.filter_map(|u| Some((u.standard_error()?, u.degrees_of_freedom().unwrap_or(FEW))));
        let logs: Vec<(f64, f64)> = stated.filter(|(e, _)| *e > 0.0).map(|(e, n)| (2.0 * e.ln(), n)).collect();
        let mean = logs.iter().map(|(log, _)| log).sum::<f64>() / logs.len() as f64;
        sum += logs.iter().map(|(log, n)| (log - mean).powi(2) / trigamma(n / 2.0)).sum::<f64>();
        freedom += logs.len().saturating_sub(1) as f64;
    }
    ChiSquared::new(freedom).is_ok_and(|chance| chance.sf(sum) < UNHEARD_OF)
}

/// The second derivative of the logarithm of the gamma function (Abramowitz and Stegun 6.4.6 and 6.4.12).
fn trigamma(x: f64) -> f64 {
    if x < 6.0 {
        return trigamma(x + 1.0) + x.powi(-2);
    }
    x.recip() + 0.5 * x.powi(-2) + x.powi(-3) / 6.0 - x.powi(-5) / 30.0
}

impl fmt::Display for StatedErrors {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (ratio, freedom) = (self.ratio.unwrap_or(0.0), self.degrees_of_freedom);
        match self.doubt {
            Some(Doubt::TooSmall) => write!(
                f,
                "its standard errors are {ratio:.1} times too small: that is how its readings of other seeds scatter ({freedom} \
                 degrees of freedom); verdicts go by the scatter"
            ),
            Some(Doubt::TooLarge) => write!(
                f,
                "its standard errors are {:.1} times too large: its readings of other seeds scatter by as much less ({freedom} \
                 degrees of freedom); verdicts go by the scatter",
                ratio.recip()
            ),
            Some(Doubt::HeavyTail) => write!(
                f,
                "a heavy tail: its standard errors vary from seed to seed by much more than they should, so that a few of its samples \
                 hold much of the light and others are still to come; it fails nothing yet"
            ),
            Some(Doubt::Scatters) => write!(
                f,
                "it claims readings without any scatter, and those of other seeds scatter by {:.2e} ({freedom} degrees of \
                 freedom); verdicts go by the scatter",
                self.of_claims.unwrap_or(0.0)
            ),
            Some(Doubt::SameForEverySeed) => {
                write!(f, "it states errors of sampling and reads the same with every seed: they cannot be checked")
            }
            None => write!(
                f,
                "readings of other seeds scatter by {ratio:.2} of what it states ({freedom} degrees of freedom)"
            ),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::system::random::normal;

    const METERS: usize = 4;

    /// Readings of a meter each, four seeds, with the given scatter and what is stated of it.
    fn readings(seed: u64, scatter: f64, stated: f64) -> Vec<Vec<Estimate>> {
        let mut random = fastrand::Rng::with_seed(seed);
        let mut one = || Estimate {
            value: 100.0 + scatter * normal(&mut random),
            uncertainty: Uncertainty::sampled(stated, Some(7.0)),
        };
        (0..METERS).map(|_| (0..4).map(|_| one()).collect()).collect()
    }

    fn told(scatter: f64, stated: f64, doubt: Doubt) -> usize {
        let is_told = |seed: &u64| {
            let found = StatedErrors::of_sampled(&readings(*seed, scatter, stated)).unwrap();
            found.doubt == Some(doubt)
        };
        (0..1000).filter(is_told).count()
    }

    #[test]
    fn errors_three_times_too_small_or_ten_times_too_large_are_told_and_right_ones_are_not() {
        assert!(told(3.0, 1.0, Doubt::TooSmall) > 980);
        assert!(told(0.1, 1.0, Doubt::TooLarge) > 980);
        assert!(told(1.0, 1.0, Doubt::TooSmall) <= 12);
        assert_eq!(told(1.0, 1.0, Doubt::TooLarge), 0);
        assert_eq!(told(0.0, 1.0, Doubt::SameForEverySeed), 1000);
    }

    #[test]
    fn a_heavy_tail_is_told_by_errors_that_vary_and_normal_samples_have_none() {
        let told = |seed: u64, heaviness: f64, meters: usize| {
            let mut random = fastrand::Rng::with_seed(seed);
            let mut sample =
                || if heaviness > 0.0 { (heaviness * normal(&mut random)).exp() } else { 9.0 + normal(&mut random) };
            let mut reading = || Estimate::of_samples(&(0..8).map(|_| sample()).collect::<Vec<f64>>());
            let all: Vec<Vec<Estimate>> = (0..meters).map(|_| (0..4).map(|_| reading()).collect()).collect();
            StatedErrors::of_sampled(&all).unwrap().doubt == Some(Doubt::HeavyTail)
        };
        let count = |heaviness, meters| (0..1000).filter(|seed| told(*seed, heaviness, meters)).count();
        assert!(count(2.0, 6) > 990, "{}", count(2.0, 6));
        assert!(count(0.0, 6) <= 2 && count(0.0, 40) <= 2, "{} {}", count(0.0, 6), count(0.0, 40));
        assert!((trigamma(1.0) - std::f64::consts::PI.powi(2) / 6.0).abs() < 1e-5);
    }

    #[test]
    fn what_is_corrected_has_the_error_that_is_there() {
        let found = StatedErrors::of_sampled(&readings(1, 3.0, 1.0)).unwrap();
        let corrected = found.correct(readings(1, 3.0, 1.0)[0][0]).uncertainty;
        assert!((2.0..4.5).contains(&corrected.standard_error().unwrap()), "{corrected:?}");
        // 7 and 12.
        assert!((corrected.degrees_of_freedom().unwrap() - 84.0 / 19.0).abs() < 1e-12);
        let fine = StatedErrors { p_value: Some(0.7), doubt: None, ratio: Some(1.1), ..found.clone() };
        assert_eq!(fine.correct(readings(1, 3.0, 1.0)[0][0]), readings(1, 3.0, 1.0)[0][0]);
        // A bound is no statement about scatter.
        let bounded = Estimate { value: 1.0, uncertainty: Uncertainty::Bound(0.1) };
        assert_eq!(found.correct(bounded), bounded);
    }

    #[test]
    fn a_claim_that_scatters_has_the_error_of_its_scatter() {
        let claimed = |value| Estimate::exact(value);
        let found = StatedErrors::of_claims(&[vec![claimed(9.9), claimed(10.1)], vec![claimed(0.0); 2]]).unwrap();
        let corrected = found.correct(claimed(20.0)).uncertainty;
        assert!((corrected.standard_error().unwrap() - 20.0 * 0.01 * 2f64.sqrt()).abs() < 1e-12, "{corrected:?}");
        assert_eq!(corrected.degrees_of_freedom(), Some(1.0));
        assert!(StatedErrors::of_claims(&[vec![claimed(10.0); 4]]).is_none());
    }
}
