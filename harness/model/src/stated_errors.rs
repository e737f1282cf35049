//! What repeated readings show of the errors that an engine states.

use std::collections::BTreeMap;
use std::fmt;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::MeterId;

/// With a larger ratio of scatter to stated error only its power of ten is shown: such a stated error is rounding.
const MAX_EXACT_RATIO: f64 = 1e4;

/// How the readings of one engine in one case scatter from seed to seed, relative to their stated errors.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct StatedErrors {
    /// Scatter over stated standard error, root of the mean square; null where no error was stated.
    pub ratio: Option<f64>,
    /// Degrees of freedom of the scatter: repeated readings minus meters, fewer where meters share their noise.
    pub degrees_of_freedom: f64,
    /// The design effect: the variance of the meters' mean over that of independent meters.
    pub design_effect: f64,
    /// Degrees of freedom that match how standard errors vary from seed to seed, where that is more than stated, or clearly less.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub observed_degrees_of_freedom: Option<f64>,
    /// The probability of a ratio as far from 1 if the stated errors are right.
    pub p_value: Option<f64>,
    /// Relative scatter of readings that claim none, or far more than they have; root of the mean square.
    pub claim_scatter: Option<f64>,
    /// The exponent by which squared standard errors fall with effort: 1 for independent samples, 0 where they do not fall.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub effort_exponent: Option<f64>,
    /// Whether only the run's first reading differs: the readings of other seeds, requested separately, are equal.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub only_first_differs: bool,
    /// The largest part of a meter's light in one sample, where some samples lie far from all others.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub largest_portion: Option<f64>,
    /// The meters concerned, with the relative error that counts there; empty for all meters.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub at: BTreeMap<MeterId, f64>,
    pub finding: Option<ErrorFinding>,
}

/// A fault of stated errors, which is reported whatever the verdicts are.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum ErrorFinding {
    TooSmall,
    TooLarge,
    /// They vary more from seed to seed than those of normal samples: a few samples hold much of the light.
    HeavyTail,
    /// They vary as those of fewer samples than are stated.
    FewerSamples,
    /// They vary less than those of as few samples as are stated.
    MoreSamples,
    /// Readings that are claimed to be exact scatter.
    Scatters,
    /// Every seed gives the same reading, although sampling errors are stated.
    SameForEverySeed,
    /// The engine did not repeat its readings.
    NotRepeated,
    /// A bound is beyond the tolerance without a declared reason, so no reading could fail there.
    BeyondTolerance,
    /// The true value is outside the bound, and the reading is beyond the tolerance.
    Refuted,
}

/// Repetition refutes a stated error where right errors scatter so much in fewer than one of a thousand runs.
const MAX_P_OF_CLAIM: f64 = 1e-3;

impl StatedErrors {
    /// Whether repeated readings refute what the engine states: exact readings that scatter, a bound that does not hold, or a standard
    /// error that is too small.
    pub fn is_failed_claim(&self) -> bool {
        match self.finding {
            Some(ErrorFinding::Scatters | ErrorFinding::Refuted) => true,
            // The probability is of both sides, and a scatter above the stated one is one of them.
            Some(ErrorFinding::TooSmall) => self.p_value.is_some_and(|p| p < 2.0 * MAX_P_OF_CLAIM),
            _ => false,
        }
    }

    /// A finding with only its kind.
    pub const fn from_finding(finding: ErrorFinding) -> Self {
        Self {
            ratio: None,
            degrees_of_freedom: 0.0,
            design_effect: 1.0,
            observed_degrees_of_freedom: None,
            p_value: None,
            claim_scatter: None,
            effort_exponent: None,
            only_first_differs: false,
            largest_portion: None,
            at: BTreeMap::new(),
            finding: Some(finding),
        }
    }

    /// A finding at some meters, with the relative errors that count there; `None` without meters.
    pub fn from_finding_at(finding: ErrorFinding, at: BTreeMap<MeterId, f64>) -> Option<Self> {
        (!at.is_empty()).then(|| Self { at, ..Self::from_finding(finding) })
    }
}

impl fmt::Display for StatedErrors {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (ratio, freedom) = (self.ratio.unwrap_or(0.0), self.degrees_of_freedom);
        let at = match self.at.first_key_value() {
            Some((meter, _)) if self.at.len() == 1 => format!("at {meter}"),
            Some((meter, _)) => format!("at {} meters ({meter} first)", self.at.len()),
            None => String::new(),
        };
        match self.finding {
            Some(ErrorFinding::TooLarge) if !at.is_empty() => write!(
                f,
                "its standard errors {at} are far too large: its readings of other seeds scatter by at most {:.2e} \
                 there ({freedom:.0} degrees of freedom); verdicts use the scatter of each meter",
                self.at.values().copied().fold(0.0, f64::max)
            ),
            Some(ErrorFinding::TooSmall) => write!(
                f,
                "its standard errors are {} times too small for the scatter of its readings of other seeds ({freedom:.0} \
                 degrees of freedom); verdicts use the scatter",
                if ratio < MAX_EXACT_RATIO { format!("{ratio:.1}") } else { format!("{ratio:.0e}") }
            ),
            Some(ErrorFinding::TooLarge) => write!(
                f,
                "its standard errors are {:.1} times too large for the scatter of its readings of other seeds ({freedom:.0} \
                 degrees of freedom); verdicts use the scatter",
                ratio.recip()
            ),
            Some(ErrorFinding::HeavyTail) if self.largest_portion.is_some() => write!(
                f,
                "a heavy tail: at more meters than by chance one seed reads far from all others, so that a few of its samples hold much of \
                 the light and others are still to come; what is missing fails nothing that a few of them would bring"
            ),
            Some(ErrorFinding::HeavyTail) => write!(
                f,
                "a heavy tail: its standard errors vary from seed to seed as those of {:.1} degrees of freedom do, so that a few of its \
                 samples hold much of the light and others are still to come; verdicts wait for what lies beyond that",
                self.observed_degrees_of_freedom.unwrap_or(0.5)
            ),
            Some(ErrorFinding::FewerSamples) => write!(
                f,
                "its standard errors vary from seed to seed as those of {:.1} degrees of freedom do, fewer than it states; verdicts go \
                 by these",
                self.observed_degrees_of_freedom.unwrap_or(0.5)
            ),
            Some(ErrorFinding::MoreSamples) => write!(
                f,
                "its standard errors vary less from seed to seed than those of as few degrees of freedom as it states: as those of {:.3e}; \
                 verdicts go by these",
                self.observed_degrees_of_freedom.unwrap_or(f64::INFINITY)
            ),
            Some(ErrorFinding::Scatters) if !at.is_empty() => write!(
                f,
                "it states an error of zero {at} with every seed, and other readings: they scatter by up to {:.2e}; verdicts go by the \
                 scatter",
                self.claim_scatter.unwrap_or(0.0)
            ),
            Some(ErrorFinding::Scatters) if self.only_first_differs => write!(
                f,
                "asked again, each job by itself, it reads the same with every seed, and otherwise than at first, by {:.2e}: its readings \
                 depend on what else it is asked, as where jobs of a batch are mixed up; verdicts go by the scatter",
                self.claim_scatter.unwrap_or(0.0)
            ),
            Some(ErrorFinding::Scatters) => write!(
                f,
                "it claims readings without any scatter, but those of other seeds scatter by {:.2e} ({freedom:.0} degrees of \
                 freedom); verdicts use the scatter",
                self.claim_scatter.unwrap_or(0.0)
            ),
            Some(ErrorFinding::SameForEverySeed) => {
                write!(
                    f,
                    "it states sampling errors but gives the same readings with every seed: its readings are not random, so no chance counts"
                )
            }
            Some(ErrorFinding::NotRepeated) => {
                write!(
                    f,
                    "it did not read again with another seed: its stated errors could not be checked, and count up to half the \
                     tolerance"
                )
            }
            Some(ErrorFinding::Refuted) => write!(
                f,
                "the bounds that it states {at} do not hold: the true values lie outside; its readings are judged without them"
            ),
            Some(ErrorFinding::BeyondTolerance) => write!(
                f,
                "the bounds that it states {at} are beyond the tolerance: nothing that it reads there could ever fail; its readings \
                 are judged as they stand"
            ),
            None if !at.is_empty() => {
                write!(f, "verdicts {at} go by how readings of other seeds scatter, which is less than what it states")
            }
            None => write!(
                f,
                "readings of other seeds scatter by {ratio:.2} of what it states ({freedom:.0} degrees of freedom)"
            ),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    #[test]
    fn repetition_refutes_what_right_errors_do_in_one_of_a_thousand_runs() {
        for (finding, p_value, is_failed) in [
            (ErrorFinding::Scatters, None, true),
            (ErrorFinding::Refuted, None, true),
            // On both sides, one in a thousand above is two in a thousand.
            (ErrorFinding::TooSmall, Some(0.0019), true),
            (ErrorFinding::TooSmall, Some(0.002), false),
            (ErrorFinding::TooSmall, Some(0.0021), false),
            (ErrorFinding::TooSmall, None, false),
            (ErrorFinding::TooLarge, Some(1e-9), false),
            (ErrorFinding::HeavyTail, Some(1e-9), false),
        ] {
            let found = StatedErrors { p_value, ..StatedErrors::from_finding(finding) };
            assert_eq!(found.is_failed_claim(), is_failed, "{finding:?} {p_value:?}");
        }
    }

    fn at(meters: &[(&str, f64)]) -> BTreeMap<MeterId, f64> {
        meters.iter().map(|(meter, error)| (MeterId((*meter).to_owned()), *error)).collect()
    }

    #[test]
    fn a_finding_at_meters_names_one_or_counts_them() {
        assert_eq!(StatedErrors::from_finding_at(ErrorFinding::TooLarge, BTreeMap::new()), None);
        let one = at(&[("desk[0]", 0.01)]);
        let two = at(&[("desk[0]", 0.01), ("desk[1]", 0.02)]);
        for (finding, begins) in [
            (ErrorFinding::TooLarge, "its standard errors {} are far too large: its readings"),
            (ErrorFinding::Scatters, "it states an error of zero {} with every seed"),
            (ErrorFinding::Refuted, "the bounds that it states {} do not hold"),
            (ErrorFinding::BeyondTolerance, "the bounds that it states {} are beyond the tolerance"),
        ] {
            for (meters, place) in [(&one, "at desk[0]"), (&two, "at 2 meters (desk[0] first)")] {
                let found = StatedErrors::from_finding_at(finding, meters.clone()).unwrap();
                assert_eq!((&found.at, found.finding, found.design_effect), (meters, Some(finding), 1.0));
                let text = found.to_string();
                assert!(text.starts_with(&begins.replace("{}", place)), "{text}");
            }
        }
        let wide = StatedErrors::from_finding_at(ErrorFinding::TooLarge, two.clone()).unwrap();
        assert!(wide.to_string().contains("scatter by at most 2.00e-2 there"), "{wide}");
        let none = StatedErrors { finding: None, ..wide };
        assert!(none.to_string().starts_with("verdicts at 2 meters (desk[0] first) go by"), "{none}");
    }

    #[test]
    fn each_finding_has_its_words_and_its_number() {
        let plain = StatedErrors { degrees_of_freedom: 12.0, ..StatedErrors::from_finding(ErrorFinding::TooSmall) };
        let small = StatedErrors { ratio: Some(9999.0), ..plain.clone() };
        assert!(small.to_string().starts_with("its standard errors are 9999.0 times too small"), "{small}");
        assert!(small.to_string().contains("(12 degrees of freedom)"), "{small}");
        let rounding = StatedErrors { ratio: Some(1e4), ..plain.clone() };
        assert!(rounding.to_string().starts_with("its standard errors are 1e4 times too small"), "{rounding}");
        let large = StatedErrors { ratio: Some(0.2), finding: Some(ErrorFinding::TooLarge), ..plain.clone() };
        assert!(large.to_string().starts_with("its standard errors are 5.0 times too large"), "{large}");
        let none = StatedErrors { ratio: Some(1.125), finding: None, ..plain.clone() };
        assert!(none.to_string().starts_with("readings of other seeds scatter by 1.12 of what it states"), "{none}");
        let heavy = StatedErrors {
            finding: Some(ErrorFinding::HeavyTail),
            observed_degrees_of_freedom: Some(1.5),
            ..plain.clone()
        };
        assert!(heavy.to_string().contains("vary from seed to seed as those of 1.5 degrees of freedom"), "{heavy}");
        let portion = StatedErrors { largest_portion: Some(0.1), ..heavy };
        assert!(portion.to_string().contains("one seed reads far from all others"), "{portion}");
        let claim = StatedErrors { finding: Some(ErrorFinding::Scatters), claim_scatter: Some(0.0123), ..plain };
        let text = claim.to_string();
        assert!(text.starts_with("it claims readings without any scatter") && text.contains("1.23e-2"), "{text}");
        let first = StatedErrors { only_first_differs: true, ..claim };
        assert!(first.to_string().starts_with("asked again, each job by itself"), "{first}");
    }
}
