//! Error budgets: what a deviation of reading and reference may owe to chance and ignorance, component by component.
//!
//! After JCGM 100:2008 (GUM): standard uncertainties add in quadrature (5.1.2), bounds and rounding are rectangular
//! distributions (4.3.7), few blocks widen by Student's t with the effective degrees of freedom of Welch and Satterthwaite
//! (G.4.1). The coverage factor is that of the distribution which results: the widest rectangular component is convolved with
//! the rest exactly, so that a budget of bounds alone is not taken for a normal one (G.1.3).

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use statrs::distribution::{Continuous, ContinuousCDF, Normal, StudentsT};

/// Degrees of freedom from which on Student's t is the normal distribution to six digits, and no longer computed well.
pub(super) const MANY: f64 = 1e6;
/// Components below this share of the widest one change no quantile that anybody reads.
const NEGLIGIBLE: f64 = 1e-4;

/// What an error comes from, in the order of reports.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
#[derive(strum::IntoStaticStr, strum::VariantArray)]
#[strum(serialize_all = "snake_case", const_into_str)]
pub enum Source {
    /// Chance in the reading: the standard error of sampled light.
    #[strum(to_string = "Monte Carlo")]
    MonteCarlo,
    /// The error bound of a deterministic reading: discretisation and read-out. Older reports tell an `instrument` apart.
    #[serde(alias = "instrument")]
    Discretisation,
    /// The reference's own error.
    Reference,
    /// Rounding of a printed reference.
    Rounding,
    /// The last digit of the photometric file's candela table, where the reference does not rest on that file.
    Input,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Shape {
    /// Normal, or Student's t where degrees of freedom are known.
    Normal,
    /// Even between two bounds.
    Rectangular,
}

/// One component of an error budget.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Component {
    pub source: Source,
    /// Standard uncertainty, in the quantity's unit.
    pub uncertainty: f64,
    pub shape: Shape,
    /// Degrees of freedom of the standard uncertainty, where it is itself estimated from few values.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub degrees_of_freedom: Option<f64>,
}

impl Component {
    /// A normal component; `None` degrees of freedom stand for many.
    pub const fn normal(source: Source, uncertainty: f64, degrees_of_freedom: Option<f64>) -> Self {
        Self { source, uncertainty, shape: Shape::Normal, degrees_of_freedom }
    }

    /// A component that lies evenly within a bound (GUM 4.3.7).
    pub fn within(source: Source, bound: f64) -> Self {
        Self { source, uncertainty: bound / 3f64.sqrt(), shape: Shape::Rectangular, degrees_of_freedom: None }
    }
}

/// What a deviation may owe to chance and ignorance.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ErrorBudget {
    /// What it is made of, zero components left out.
    pub components: Vec<Component>,
    /// Combined standard uncertainty, in the quantity's unit.
    pub combined: f64,
    /// Effective degrees of freedom, where they are few.
    pub degrees_of_freedom: Option<f64>,
    /// Expanded over combined standard uncertainty.
    pub coverage_factor: f64,
    /// Half width of the interval of the deviation that a verdict is about.
    pub expanded: f64,
    /// The components with chance as wide as it counts here; as above where all of its error may be spent.
    #[serde(skip)]
    counted: Vec<Component>,
}

impl ErrorBudget {
    /// Adds components up; an error beyond the interval has the probability `tail` on either side.
    pub fn new(components: Vec<Component>, tail: f64) -> Self {
        Self::spending(components, tail, 1.0)
    }

    /// The same where chance may spend only a `share` of its error, since it may be looked at again: it counts for as much more as
    /// that takes. What no look makes smaller spends all of its own.
    pub fn spending(mut components: Vec<Component>, tail: f64, share: f64) -> Self {
        components.retain(|c| c.uncertainty != 0.0);
        let combined = components.iter().map(|c| c.uncertainty.powi(2)).sum::<f64>().sqrt();
        let mut counted = components.clone();
        for chance in counted.iter_mut().filter(|c| c.source == Source::MonteCarlo && share < 1.0) {
            let alone = Spread::of(&[*chance]);
            chance.uncertainty *= alone.quantile(tail * share) / alone.quantile(tail);
        }
        let expanded = Spread::of(&counted).quantile(tail);
        Self {
            combined,
            degrees_of_freedom: Spread::of(&components).degrees_of_freedom,
            coverage_factor: if combined > 0.0 { expanded / combined } else { 0.0 },
            expanded,
            components,
            counted,
        }
    }

    /// The half width of the interval without what comes from one source; an error beyond it has the probability of `coverage` standard
    /// deviations of a normal distribution.
    pub fn expanded_without(&self, source: Source, coverage: f64) -> f64 {
        let others = self.components.iter().filter(|c| c.source != source).copied().collect();
        Self::new(others, upper_tail_of_normal(coverage)).expanded
    }

    /// The probability of a deviation at least this far from nothing, were the truth just `allowed` away: the largest over all
    /// truths within the tolerance.
    pub fn p_value(&self, deviation: f64, allowed: f64) -> f64 {
        // A budget that was read from a file counts as it stands.
        let counted = if self.counted.is_empty() { &self.components } else { &self.counted };
        let (spread, distance) = (Spread::of(counted), deviation.abs());
        if self.combined == 0.0 {
            return if distance > allowed { 0.0 } else { 1.0 };
        }
        (spread.tail(distance - allowed) + spread.tail(distance + allowed)).clamp(0.0, 1.0)
    }
}

/// A normal or Student's t distribution, convolved with a rectangular one.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Spread {
    sigma: f64,
    degrees_of_freedom: Option<f64>,
    half_width: f64,
}

impl Spread {
    fn of(components: &[Component]) -> Self {
        let is_rectangular = |c: &&Component| c.shape == Shape::Rectangular;
        let widest = components.iter().filter(is_rectangular).map(|c| c.uncertainty).fold(0.0, f64::max);
        // The other rectangular components are many or small, and their sum is nearly normal (GUM G.2.1).
        let variance = components.iter().map(|c| c.uncertainty.powi(2)).sum::<f64>() - widest.powi(2);
        let sigma = variance.max(0.0).sqrt();
        // Welch and Satterthwaite: JCGM 100:2008, G.2b.
        let of_few = |c: &Component| c.degrees_of_freedom.map(|freedom| c.uncertainty.powi(4) / freedom);
        let fourth: f64 = components.iter().filter_map(of_few).sum();
        let degrees_of_freedom = (fourth > 0.0 && sigma > 0.0).then(|| sigma.powi(4) / fourth);
        Self { sigma, degrees_of_freedom, half_width: widest * 3f64.sqrt() }
    }

    /// The probability that an error is at least `x`.
    fn tail(&self, x: f64) -> f64 {
        let (sigma, half) = (self.sigma, self.half_width);
        if half <= NEGLIGIBLE * sigma {
            return self.standard().tail(x / sigma);
        }
        if sigma <= NEGLIGIBLE * half {
            return ((half - x) / (2.0 * half)).clamp(0.0, 1.0);
        }
        let (low, high) = ((x - half) / sigma, (x + half) / sigma);
        (self.standard().tail_between(low, high) * sigma / (2.0 * half)).clamp(0.0, 1.0)
    }

    /// The error that is exceeded with this probability, by bisection; `probability` is below one half.
    fn quantile(&self, probability: f64) -> f64 {
        if self.sigma == 0.0 && self.half_width == 0.0 {
            return 0.0;
        }
        let (mut low, mut high) = (0.0, self.sigma + self.half_width);
        while self.tail(high) > probability {
            (low, high) = (high, 2.0 * high);
        }
        while high - low > 1e-12 * high {
            let middle = 0.5 * (low + high);
            if middle <= low || middle >= high {
                break;
            }
            if self.tail(middle) > probability { low = middle } else { high = middle }
        }
        high
    }

    fn standard(&self) -> Standard {
        Standard::of(self.degrees_of_freedom)
    }
}

/// The distribution of an error over its standard uncertainty.
pub(super) enum Standard {
    Normal(Normal),
    Student(StudentsT),
}

impl Standard {
    pub(super) fn of(degrees_of_freedom: Option<f64>) -> Self {
        let student = degrees_of_freedom.filter(|f| *f < MANY).and_then(|f| StudentsT::new(0.0, 1.0, f).ok());
        student.map_or(Self::Normal(Normal::standard()), Self::Student)
    }

    pub(super) fn tail(&self, z: f64) -> f64 {
        match self {
            Self::Normal(n) => n.sf(z),
            Self::Student(t) => t.sf(z),
        }
    }

    /// The integral of the tail probability from `low` to `high`.
    fn tail_between(&self, low: f64, high: f64) -> f64 {
        match self {
            // From d/dz (phi - z (1 - Phi)) = -(1 - Phi).
            Self::Normal(n) => {
                let beyond = |z: f64| n.pdf(z) - z * n.sf(z);
                beyond(low) - beyond(high)
            }
            // Likewise, with d/dz ((v + z^2) / (v - 1) f) = -z f; at v = 1 that is -ln(1 + z^2) / 2 pi.
            Self::Student(t) => {
                let freedom = t.freedom();
                let beyond = |z: f64| {
                    let moment = if (freedom - 1.0).abs() < 1e-6 {
                        -(z * z).ln_1p() / std::f64::consts::TAU
                    } else {
                        (freedom + z * z) / (freedom - 1.0) * t.pdf(z)
                    };
                    moment - z * t.sf(z)
                };
                beyond(low) - beyond(high)
            }
        }
    }
}

/// The probability beyond so many standard deviations of a normal distribution, on one side.
pub(super) fn upper_tail_of_normal(standard_deviations: f64) -> f64 {
    Normal::standard().sf(standard_deviations)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn budget(components: &[Component]) -> ErrorBudget {
        ErrorBudget::new(components.to_vec(), upper_tail_of_normal(2.0))
    }

    #[test]
    fn components_add_in_quadrature_and_a_normal_budget_is_covered_by_the_factor_asked_for() {
        let found = budget(&[
            Component::normal(Source::MonteCarlo, 3.0, None),
            Component::normal(Source::Reference, 4.0, None),
        ]);
        assert!((found.combined - 5.0).abs() < 1e-15);
        assert!((found.coverage_factor - 2.0).abs() < 1e-9, "{found:?}");
        assert_eq!(found.degrees_of_freedom, None);
    }

    #[test]
    fn few_blocks_widen_the_interval_as_the_table_of_students_t_says() {
        // GUM table G.2, p = 95.45 %: 2.43 for 7 degrees of freedom, 13.97 for 1, 2 for many.
        for (freedom, factor) in [(7.0, 2.43), (1.0, 13.97), (1e5, 2.0), (1e18, 2.0), (1e300, 2.0)] {
            let found = budget(&[Component::normal(Source::MonteCarlo, 1.0, Some(freedom))]);
            assert!((found.coverage_factor - factor).abs() < 5e-3, "{found:?}");
        }
    }

    #[test]
    fn a_bound_alone_is_covered_within_itself() {
        let found = budget(&[Component::within(Source::Discretisation, 1.0)]);
        assert!((found.expanded - 0.9545).abs() < 1e-4, "{found:?}");
        assert!((found.combined - 1.0 / 3f64.sqrt()).abs() < 1e-15);
    }

    #[test]
    fn a_convolution_is_what_numbers_drawn_from_it_say() {
        let mut random = fastrand::Rng::with_seed(3);
        for freedom in [None, Some(1.0), Some(5.0)] {
            let spread = Spread { sigma: 0.7, degrees_of_freedom: freedom, half_width: 1.3 };
            let runs = 200_000;
            let student = StudentsT::new(0.0, 1.0, freedom.unwrap_or(1e7)).unwrap();
            let draw = |random: &mut fastrand::Rng| {
                0.7 * student.inverse_cdf(random.f64().clamp(1e-9, 1.0 - 1e-9)) + 1.3 * (2.0 * random.f64() - 1.0)
            };
            let drawn: Vec<f64> = (0..runs / 10).map(|_| draw(&mut random)).collect();
            for x in [-2.0, 0.0, 0.5, 1.5, 2.5] {
                let share = drawn.iter().filter(|d| **d >= x).count() as f64 / drawn.len() as f64;
                assert!((share - spread.tail(x)).abs() < 0.015, "{freedom:?} {x}: {share} {}", spread.tail(x));
            }
            assert!((spread.tail(spread.quantile(0.01)) - 0.01).abs() < 1e-9);
        }
    }

    #[test]
    fn what_no_look_makes_smaller_spends_all_of_its_error_at_any_look() {
        let tail = upper_tail_of_normal(2.0);
        let chance = |u| Component::normal(Source::MonteCarlo, u, Some(7.0));
        let rounding = Component::within(Source::Rounding, 1.0);
        for share in [0.5, 0.125] {
            // Chance alone spends its share, and bounds alone nothing.
            let alone = ErrorBudget::spending(vec![chance(1.0)], tail, share);
            assert!((alone.expanded - ErrorBudget::new(vec![chance(1.0)], tail * share).expanded).abs() < 1e-9);
            assert_eq!(ErrorBudget::spending(vec![rounding], tail, share).expanded, budget(&[rounding]).expanded);
            // What is left of chance makes hardly a difference.
            let both = ErrorBudget::spending(vec![chance(0.01), rounding], tail, share);
            assert!((both.expanded / budget(&[chance(0.01), rounding]).expanded - 1.0).abs() < 2e-3, "{both:?}");
            assert_eq!(both.components, [chance(0.01), rounding]);
        }
    }

    #[test]
    fn without_uncertainty_the_distance_decides() {
        let none = budget(&[]);
        assert_eq!((none.p_value(0.5, 1.0), none.p_value(1.5, 1.0), none.expanded), (1.0, 0.0, 0.0));
    }

    #[test]
    fn a_deviation_at_the_tolerance_has_even_odds_and_a_far_one_none() {
        let found = budget(&[Component::normal(Source::MonteCarlo, 0.1, None)]);
        assert!((found.p_value(1.0, 1.0) - 0.5).abs() < 1e-12);
        assert!(found.p_value(2.0, 1.0) < 1e-20);
        // With no tolerance it is the usual test on both sides.
        assert!((found.p_value(0.196, 0.0) - 0.05).abs() < 1e-3);
    }
}
