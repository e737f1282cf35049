//! The stated error of a value: a bound, a standard error with its degrees of freedom, exactness, or nothing.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The error of a value, in the value's unit. Files have it next to the value, as `uncertainty`, `std_error` and `error_bound`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(try_from = "WrittenUncertainty", into = "WrittenUncertainty")]
pub enum Uncertainty {
    /// No error is stated.
    #[default]
    Unstated,
    /// The value is claimed to be exact for the method, to the last digit.
    Exact,
    /// It was sampled, but no sample met what the samples of other values met. So the error is unknown.
    NotSeen,
    /// The value of the method lies within this distance.
    Bound(f64),
    /// The value is a mean of independent samples.
    StandardError {
        /// One standard error of the mean.
        value: f64,
        /// Degrees of freedom of the standard error, which is estimated from few samples; `None` where they are not stated.
        degrees_of_freedom: Option<f64>,
        /// A bound on the bias of the mean, which no number of samples shows; mostly 0.
        bound: f64,
    },
}

impl Uncertainty {
    /// A standard error without a bound.
    pub const fn sampled(value: f64, degrees_of_freedom: Option<f64>) -> Self {
        Self::StandardError { value, degrees_of_freedom, bound: 0.0 }
    }

    /// One standard error, where the value was sampled.
    pub const fn standard_error(&self) -> Option<f64> {
        match self {
            Self::StandardError { value, .. } => Some(*value),
            _ => None,
        }
    }

    /// Degrees of freedom of the standard error, where they are stated.
    pub const fn degrees_of_freedom(&self) -> Option<f64> {
        match self {
            Self::StandardError { degrees_of_freedom, .. } => *degrees_of_freedom,
            _ => None,
        }
    }

    /// The distance that does not shrink with further samples; 0 where none is stated.
    pub const fn bound(&self) -> f64 {
        match self {
            Self::Bound(bound) | Self::StandardError { bound, .. } => *bound,
            Self::Unstated | Self::Exact | Self::NotSeen => 0.0,
        }
    }

    /// Whether further samples would reduce it.
    pub fn is_sampled(&self) -> bool {
        *self == Self::NotSeen || self.standard_error().is_some_and(|e| e > 0.0)
    }

    /// Standard uncertainty; a bound counts as a rectangular distribution (JCGM 100:2008, 4.3.7).
    pub fn standard(&self) -> f64 {
        self.standard_error().unwrap_or(0.0).hypot(self.bound() / 3f64.sqrt())
    }

    /// The uncertainty of the value times a factor.
    #[must_use]
    pub fn times(&self, factor: f64) -> Self {
        Self::of_sum([(factor, *self)])
    }

    /// The uncertainty with a further bound.
    #[must_use]
    pub fn within(&self, further: f64) -> Self {
        Self::of_sum([(1.0, *self), (1.0, Self::Bound(further))])
    }

    /// The uncertainty of a weighted sum of values with independent samples.
    ///
    /// Standard errors add in quadrature, with the degrees of freedom of Welch and Satterthwaite (JCGM 100:2008, G.4.1). Bounds add up,
    /// because they may have the same sign.
    pub fn of_sum(terms: impl IntoIterator<Item = (f64, Self)>) -> Self {
        let (mut variance, mut fourth) = (0.0, 0.0);
        let all = Self::of_dependent_sum(terms.into_iter().inspect(|(weight, term)| {
            let square = (weight * term.standard_error().unwrap_or(0.0)).powi(2);
            variance += square;
            fourth += term.degrees_of_freedom().map_or(0.0, |freedom| square * square / freedom);
        }));
        match all {
            Self::StandardError { bound, degrees_of_freedom, .. } => {
                // Fourth powers may overflow or vanish; then the fewest degrees of freedom of any term count.
                let effective = Some(variance * variance / fourth).filter(|f| f.is_normal() && fourth > 0.0);
                let degrees_of_freedom = effective.or(degrees_of_freedom);
                Self::StandardError { value: variance.sqrt(), degrees_of_freedom, bound }
            }
            other => other,
        }
    }

    /// The uncertainty of a weighted sum of values with dependent samples.
    ///
    /// Standard errors add up, which is the most that they can be, with the fewest degrees of freedom of any term.
    pub fn of_dependent_sum(terms: impl IntoIterator<Item = (f64, Self)>) -> Self {
        let (mut value, mut bound, mut degrees_of_freedom) = (0.0, 0.0, None::<f64>);
        let (mut is_sampled, mut is_bounded, mut is_exact, mut is_unseen) = (false, false, false, false);
        for (weight, term) in terms {
            is_exact |= term == Self::Exact;
            is_unseen |= term == Self::NotSeen && weight != 0.0;
            is_bounded |= matches!(term, Self::Bound(_));
            is_sampled |= matches!(term, Self::StandardError { .. });
            value += weight.abs() * term.standard_error().unwrap_or(0.0);
            bound += weight.abs() * term.bound();
            degrees_of_freedom = [degrees_of_freedom, term.degrees_of_freedom()].into_iter().flatten().reduce(f64::min);
        }
        match (is_sampled, is_bounded, is_exact) {
            (true, ..) => Self::StandardError { value, degrees_of_freedom, bound },
            // Without samples elsewhere in the sum nothing shows how much these would scatter.
            _ if is_unseen => Self::NotSeen,
            (_, true, _) => Self::Bound(bound),
            (_, _, true) => Self::Exact,
            _ => Self::Unstated,
        }
    }

    /// The uncertainty of a weighted sum of values whose samples have this mean correlation, from 0 to 1.
    ///
    /// The variance is that of independent samples and that of dependent ones, in these parts. The fewest degrees of freedom of any
    /// term count, because the same samples show the correlation.
    pub fn of_correlated_sum(terms: impl IntoIterator<Item = (f64, Self)> + Clone, correlation: f64) -> Self {
        let independent = Self::of_sum(terms.clone()).standard_error().unwrap_or(0.0);
        match Self::of_dependent_sum(terms) {
            Self::StandardError { value, degrees_of_freedom, bound } => {
                let [own, common] = [(1.0 - correlation).sqrt() * independent, correlation.sqrt() * value];
                Self::StandardError { value: own.hypot(common), degrees_of_freedom, bound }
            }
            other => other,
        }
    }

    /// The uncertainty of the mean of two stages, weighted by their effort.
    ///
    /// A stage that met nothing is assumed to scatter like the other, scaled by its effort.
    pub fn of_stages(stages: [(f64, Self); 2]) -> Self {
        let total = stages[0].0 + stages[1].0;
        match stages {
            // A stage for this value alone states an error of 0 where it meets nothing.
            [(_, Self::NotSeen), (_, other)] | [(_, other), (_, Self::NotSeen)] if other.standard() <= 0.0 => {
                Self::NotSeen
            }
            [(_, Self::NotSeen), (effort, other)] | [(effort, other), (_, Self::NotSeen)] => {
                other.times((effort / total).sqrt())
            }
            stages => Self::of_sum(stages.map(|(effort, stage)| (effort / total, stage))),
        }
    }

    /// The uncertainty with at least this standard error.
    #[must_use]
    pub fn at_least(&self, error: f64) -> Self {
        match *self {
            Self::StandardError { value, degrees_of_freedom, bound } if value > 0.0 => {
                Self::StandardError { value: value.max(error), degrees_of_freedom, bound }
            }
            other => other,
        }
    }

    /// Whether all that is stated is finite.
    pub fn is_finite(&self) -> bool {
        self.standard_error().is_none_or(f64::is_finite) && self.bound().is_finite()
    }

    /// Whether it is a valid error: finite and not negative.
    pub fn is_sound(&self) -> bool {
        self.is_finite()
            && self.standard_error().is_none_or(|e| e >= 0.0)
            && self.bound() >= 0.0
            && self.degrees_of_freedom().is_none_or(|f| f > 0.0)
    }
}

/// The form in files. Older files have only the last two fields.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize, JsonSchema)]
struct WrittenUncertainty {
    /// The stated error; null where none is stated.
    #[serde(default)]
    uncertainty: Option<StatedError>,
    /// Standard error of a Monte Carlo mean.
    #[serde(default)]
    std_error: Option<f64>,
    /// A bound on the error, for deterministic methods.
    #[serde(default)]
    error_bound: Option<f64>,
}

#[derive(Clone, Copy, Debug, Serialize, Deserialize, JsonSchema)]
struct StatedError {
    kind: Kind,
    /// The bound or the standard error; 0 where the value is exact.
    value: f64,
    /// Degrees of freedom of a standard error, where they are stated.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    degrees_of_freedom: Option<f64>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
enum Kind {
    Bound,
    StandardError,
    Exact,
    NotSeen,
}

impl From<Uncertainty> for WrittenUncertainty {
    fn from(uncertainty: Uncertainty) -> Self {
        let (std_error, bound) = (uncertainty.standard_error(), uncertainty.bound());
        let kind = match uncertainty {
            Uncertainty::Unstated => None,
            Uncertainty::Exact => Some(Kind::Exact),
            Uncertainty::NotSeen => Some(Kind::NotSeen),
            Uncertainty::Bound(_) => Some(Kind::Bound),
            Uncertainty::StandardError { .. } => Some(Kind::StandardError),
        };
        let value = std_error.unwrap_or(bound);
        let degrees_of_freedom = uncertainty.degrees_of_freedom();
        let stated = kind.map(|kind| StatedError { kind, value, degrees_of_freedom });
        let is_bound = matches!(uncertainty, Uncertainty::Bound(_)) || bound > 0.0;
        Self { uncertainty: stated, std_error, error_bound: is_bound.then_some(bound) }
    }
}

/// A stated error that cannot be one.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("an uncertainty must be a finite number, not negative, with positive degrees of freedom")]
struct Unsound;

impl TryFrom<WrittenUncertainty> for Uncertainty {
    type Error = Unsound;

    fn try_from(written: WrittenUncertainty) -> Result<Self, Unsound> {
        let bound = written.error_bound.unwrap_or(0.0);
        let read = match (written.uncertainty, written.std_error, written.error_bound) {
            (Some(StatedError { kind: Kind::Exact, .. }), ..) => Self::Exact,
            (Some(StatedError { kind: Kind::NotSeen, .. }), ..) => Self::NotSeen,
            (Some(StatedError { kind: Kind::Bound, value, .. }), ..) => Self::Bound(value),
            (Some(StatedError { kind: Kind::StandardError, value, degrees_of_freedom }), ..) => {
                Self::StandardError { value, degrees_of_freedom, bound }
            }
            (None, Some(value), _) => Self::StandardError { value, degrees_of_freedom: None, bound },
            (None, None, Some(bound)) => Self::Bound(bound),
            (None, None, None) => Self::Unstated,
        };
        if read.is_sound() { Ok(read) } else { Err(Unsound) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SAMPLED: Uncertainty = Uncertainty::sampled(3.0, Some(7.0));

    #[test]
    fn files_keep_what_is_stated_and_old_ones_are_read() {
        let both = Uncertainty::StandardError { value: 3.0, degrees_of_freedom: Some(7.0), bound: 0.5 };
        let bare = [Uncertainty::Unstated, Uncertainty::Exact, Uncertainty::NotSeen];
        for stated in bare.into_iter().chain([Uncertainty::Bound(0.1), SAMPLED, both]) {
            let text = serde_json::to_string(&stated).unwrap();
            assert_eq!(serde_json::from_str::<Uncertainty>(&text).unwrap(), stated, "{text}");
        }
        let old = |text: &str| serde_json::from_str::<Uncertainty>(text).unwrap();
        assert_eq!(old(r#"{"std_error": 3.0, "error_bound": null}"#), Uncertainty::sampled(3.0, None));
        assert_eq!(old(r#"{"std_error": null, "error_bound": 0.1}"#), Uncertainty::Bound(0.1));
        assert_eq!(old("{}"), Uncertainty::Unstated);
        for senseless in [
            r#"{"std_error": -1.0}"#,
            r#"{"uncertainty": {"kind": "standard_error", "value": 1, "degrees_of_freedom": 0}}"#,
        ] {
            assert!(serde_json::from_str::<Uncertainty>(senseless).is_err(), "{senseless}");
        }
    }

    #[test]
    fn independent_errors_add_in_quadrature_and_bounds_add_up() {
        let sum = Uncertainty::of_sum([
            (1.0, SAMPLED),
            (-2.0, Uncertainty::sampled(2.0, Some(3.0))),
            (1.0, Uncertainty::Bound(0.1)),
        ]);
        // GUM G.2b: 25^2 / (81 / 7 + 256 / 3).
        let freedom = 625.0 / (81.0 / 7.0 + 256.0 / 3.0);
        assert_eq!(sum.standard_error(), Some(5.0));
        assert!((sum.degrees_of_freedom().unwrap() - freedom).abs() < 1e-12);
        assert_eq!(sum.bound(), 0.1);
        assert_eq!(Uncertainty::Exact.times(3.0), Uncertainty::Exact);
        assert_eq!(SAMPLED.times(2.0), Uncertainty::sampled(6.0, Some(7.0)));
    }

    #[test]
    fn what_was_not_seen_has_no_error_of_its_own_and_that_of_other_samples_beside_them() {
        let unseen = Uncertainty::NotSeen;
        assert_eq!(Uncertainty::of_sum([(1.0, Uncertainty::Bound(0.1)), (1.0, unseen)]), unseen);
        assert_eq!(Uncertainty::of_sum([(1.0, SAMPLED), (1.0, unseen)]), SAMPLED);
        assert_eq!(Uncertainty::of_stages([(1.0, unseen), (3.0, unseen)]), unseen);
        assert_eq!(Uncertainty::of_stages([(1.0, unseen), (3.0, Uncertainty::sampled(0.0, None))]), unseen);
        // As good as four units of effort, where three had an error of 3.
        let both = Uncertainty::of_stages([(1.0, unseen), (3.0, SAMPLED)]);
        assert!((both.standard() - 3.0 * 0.75_f64.sqrt()).abs() < 1e-15, "{both:?}");
    }

    const BOUNDED: Uncertainty = Uncertainty::StandardError { value: 3.0, degrees_of_freedom: Some(7.0), bound: 0.6 };
    const ALL: [Uncertainty; 6] =
        [Uncertainty::Unstated, Uncertainty::Exact, Uncertainty::NotSeen, Uncertainty::Bound(0.6), SAMPLED, BOUNDED];

    #[test]
    fn each_kind_states_what_it_has() {
        assert_eq!(ALL.map(|u| u.standard_error()), [None, None, None, None, Some(3.0), Some(3.0)]);
        assert_eq!(ALL.map(|u| u.degrees_of_freedom()), [None, None, None, None, Some(7.0), Some(7.0)]);
        assert_eq!(ALL.map(|u| u.bound()), [0.0, 0.0, 0.0, 0.6, 0.0, 0.6]);
        assert_eq!(ALL.map(|u| u.is_sampled()), [false, false, true, false, true, true]);
        assert!(!Uncertainty::sampled(0.0, None).is_sampled() && !Uncertainty::sampled(-1.0, None).is_sampled());
        // GUM 4.3.7 and 5.1.2: 9 + .36 / 3.
        let squares = [0.0, 0.0, 0.0, 0.12, 9.0, 9.12];
        for (stated, square) in ALL.into_iter().zip(squares) {
            assert!((stated.standard().powi(2) - square).abs() < 1e-12, "{stated:?}");
        }
    }

    #[test]
    fn a_factor_scales_errors_and_bounds_and_a_further_bound_adds_up() {
        let scaled = BOUNDED.times(-2.0);
        assert_eq!((scaled.standard_error(), scaled.bound(), scaled.degrees_of_freedom()), (Some(6.0), 1.2, Some(7.0)));
        assert_eq!(Uncertainty::Bound(0.6).within(0.2).bound(), 0.8);
        let wider = SAMPLED.within(0.2);
        assert_eq!((wider.standard_error(), wider.bound(), wider.degrees_of_freedom()), (Some(3.0), 0.2, Some(7.0)));
        assert_eq!(Uncertainty::Exact.within(0.2), Uncertainty::Bound(0.2));
    }

    #[test]
    fn dependent_errors_add_up_with_the_fewest_degrees_of_freedom() {
        let other = Uncertainty::sampled(2.0, Some(3.0));
        let sum = Uncertainty::of_dependent_sum([(1.0, BOUNDED), (-2.0, other), (-1.0, Uncertainty::Bound(0.1))]);
        assert_eq!((sum.standard_error(), sum.bound(), sum.degrees_of_freedom()), (Some(7.0), 0.7, Some(3.0)));
        let unstated = Uncertainty::of_dependent_sum([(1.0, SAMPLED), (1.0, Uncertainty::sampled(1.0, None))]);
        assert_eq!(unstated.degrees_of_freedom(), Some(7.0));
        assert_eq!(Uncertainty::of_dependent_sum([]), Uncertainty::Unstated);
        let kinds = [(1.0, Uncertainty::Unstated), (1.0, Uncertainty::Exact)];
        assert_eq!(Uncertainty::of_dependent_sum(kinds), Uncertainty::Exact);
        // What was not seen does not count with a weight of zero.
        let unseen = [(0.0, Uncertainty::NotSeen), (1.0, Uncertainty::Bound(0.1))];
        assert_eq!(Uncertainty::of_dependent_sum(unseen), Uncertainty::Bound(0.1));
    }

    #[test]
    fn fourth_powers_that_vanish_or_overflow_leave_the_fewest_degrees_of_freedom() {
        for size in [1e-100, 1e100] {
            let terms = [7.0, 3.0].map(|freedom| (1.0, Uncertainty::sampled(size, Some(freedom))));
            let sum = Uncertainty::of_sum(terms);
            assert_eq!(sum.degrees_of_freedom(), Some(3.0), "{sum:?}");
            assert!((sum.standard_error().unwrap() / size - 2f64.sqrt()).abs() < 1e-12, "{sum:?}");
        }
        let unstated =
            Uncertainty::of_sum([(1.0, Uncertainty::sampled(3.0, None)), (1.0, Uncertainty::sampled(4.0, None))]);
        assert_eq!(unstated, Uncertainty::sampled(5.0, None));
    }

    #[test]
    fn a_correlation_is_between_independent_and_dependent_errors() {
        // Errors of 3 and 4: 25 of independent ones, 49 of dependent ones, 25 + r 24 in between (GUM 5.2.2).
        let terms = [(1.0, BOUNDED), (1.0, Uncertainty::sampled(4.0, Some(20.0)))];
        for (correlation, square) in [(0.0, 25.0), (0.25, 31.0), (1.0, 49.0)] {
            let sum = Uncertainty::of_correlated_sum(terms, correlation);
            assert!((sum.standard_error().unwrap().powi(2) - square).abs() < 1e-12, "{sum:?}");
            assert_eq!((sum.bound(), sum.degrees_of_freedom()), (0.6, Some(7.0)));
        }
        let bounds = [(1.0, Uncertainty::Bound(0.1)), (1.0, Uncertainty::Bound(0.2))];
        assert!((Uncertainty::of_correlated_sum(bounds, 0.5).bound() - 0.3).abs() < 1e-15);
    }

    #[test]
    fn stages_count_by_their_effort() {
        // A quarter of 4 and three quarters of 3: sqrt(1 + 81 / 16).
        let both =
            Uncertainty::of_stages([(1.0, Uncertainty::sampled(4.0, None)), (3.0, Uncertainty::sampled(3.0, None))]);
        assert!((both.standard_error().unwrap().powi(2) - (1.0 + 81.0 / 16.0)).abs() < 1e-12, "{both:?}");
        let turned = Uncertainty::of_stages([(3.0, SAMPLED), (1.0, Uncertainty::NotSeen)]);
        assert!((turned.standard() - 3.0 * 0.75_f64.sqrt()).abs() < 1e-15, "{turned:?}");
        let exact = Uncertainty::of_stages([(3.0, Uncertainty::sampled(0.0, None)), (1.0, Uncertainty::NotSeen)]);
        assert_eq!(exact, Uncertainty::NotSeen);
    }

    #[test]
    fn an_error_may_have_a_least_value_where_one_is_stated() {
        assert_eq!(
            BOUNDED.at_least(4.0),
            Uncertainty::StandardError { value: 4.0, degrees_of_freedom: Some(7.0), bound: 0.6 }
        );
        assert_eq!(SAMPLED.at_least(2.0), SAMPLED);
        let zero = Uncertainty::sampled(0.0, None);
        assert_eq!([zero.at_least(1.0), Uncertainty::Exact.at_least(1.0)], [zero, Uncertainty::Exact]);
    }

    /// A standard error of 1 with this bound.
    fn of_bound(bound: f64) -> Uncertainty {
        Uncertainty::StandardError { value: 1.0, degrees_of_freedom: None, bound }
    }

    #[test]
    fn a_sound_error_is_finite_and_not_negative_with_positive_degrees_of_freedom() {
        for stated in ALL.into_iter().chain([Uncertainty::sampled(0.0, None), Uncertainty::Bound(0.0)]) {
            assert!(stated.is_sound() && stated.is_finite(), "{stated:?}");
        }
        for (stated, is_finite) in [
            (Uncertainty::sampled(f64::NAN, None), false),
            (Uncertainty::Bound(f64::INFINITY), false),
            (of_bound(f64::NAN), false),
            (of_bound(-1.0), true),
            (Uncertainty::sampled(-1.0, None), true),
            (Uncertainty::Bound(-1.0), true),
            (Uncertainty::sampled(1.0, Some(0.0)), true),
            (Uncertainty::sampled(1.0, Some(-1.0)), true),
        ] {
            assert_eq!((stated.is_sound(), stated.is_finite()), (false, is_finite), "{stated:?}");
        }
    }

    #[test]
    fn files_have_the_fields_of_old_readers_too() {
        for (stated, text) in [
            (Uncertainty::Exact, r#"{"uncertainty":{"kind":"exact","value":0.0},"std_error":null,"error_bound":null}"#),
            (
                Uncertainty::Bound(0.5),
                r#"{"uncertainty":{"kind":"bound","value":0.5},"std_error":null,"error_bound":0.5}"#,
            ),
            (
                Uncertainty::Bound(0.0),
                r#"{"uncertainty":{"kind":"bound","value":0.0},"std_error":null,"error_bound":0.0}"#,
            ),
            (
                SAMPLED,
                r#"{"uncertainty":{"kind":"standard_error","value":3.0,"degrees_of_freedom":7.0},"std_error":3.0,"error_bound":null}"#,
            ),
        ] {
            assert_eq!(serde_json::to_string(&stated).unwrap(), text);
        }
        let old = serde_json::from_str::<Uncertainty>(r#"{"std_error": 3.0, "error_bound": 0.5}"#).unwrap();
        assert_eq!(old, Uncertainty::StandardError { value: 3.0, degrees_of_freedom: None, bound: 0.5 });
    }
}
