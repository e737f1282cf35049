//! Error budgets: the part of a deviation that chance and limited knowledge may cause, by component.
//!
//! After JCGM 100:2008 (GUM): standard uncertainties add in quadrature (5.1.2). Bounds and rounding are rectangular distributions
//! (4.3.7). Few blocks widen the interval by Student's t with the effective degrees of freedom of Welch and Satterthwaite (G.4.1).
//! The coverage factor is that of the resulting distribution (G.1.3). The widest rectangular component is convolved with the rest
//! exactly, because a budget of bounds alone is not normal.

use luxproof_model::{Component, ErrorBudget, Shape, Source};
use statrs::distribution::{Continuous, ContinuousCDF, Normal, StudentsT};

/// With more degrees of freedom Student's t equals the normal distribution to six digits and is numerically unstable.
pub const MANY: f64 = 1e6;
/// Components below this share of the widest one do not change any displayed quantile.
const NEGLIGIBLE_SHARE: f64 = 1e-4;

/// Adds components up; an error beyond the interval has the probability `tail` on either side.
pub fn budget(components: Vec<Component>, tail: f64) -> ErrorBudget {
    budget_of_stage(components, tail, 1.0)
}

/// Adds components up at a stage where chance may spend only a `share` of its error probability.
///
/// A later stage may sample again, so the chance component is widened by as much as its share demands. Components that no stage
/// can reduce spend their whole error probability.
pub fn budget_of_stage(mut components: Vec<Component>, tail: f64, share: f64) -> ErrorBudget {
    components.retain(|c| c.uncertainty != 0.0);
    let combined = components.iter().map(|c| c.uncertainty.powi(2)).sum::<f64>().sqrt();
    let mut counted = components.clone();
    for chance in counted.iter_mut().filter(|c| c.source == Source::MonteCarlo && share < 1.0) {
        let single = Spread::from_components(&[*chance]);
        chance.uncertainty *= single.quantile(tail * share) / single.quantile(tail);
    }
    let expanded = Spread::from_components(&counted).quantile(tail);
    ErrorBudget {
        combined,
        degrees_of_freedom: Spread::from_components(&components).degrees_of_freedom,
        coverage_factor: if combined > 0.0 { expanded / combined } else { 0.0 },
        expanded,
        components,
        counted,
    }
}

/// The half width of the interval without the components of one source.
///
/// An error beyond it has the probability of `coverage` standard deviations of a normal distribution.
pub fn expanded_without(of: &ErrorBudget, source: Source, coverage: f64) -> f64 {
    let others = of.components.iter().filter(|c| c.source != source).copied().collect();
    budget(others, upper_tail_of_normal(coverage)).expanded
}

/// The largest probability of a deviation at least this large, over all true values within the tolerance.
///
/// The maximum is at the edge of the tolerance, where the truth is `allowed` away from the reference.
pub fn p_value(of: &ErrorBudget, deviation: f64, allowed: f64) -> f64 {
    // A budget that was read from a file has no counted components.
    let counted = if of.counted.is_empty() { &of.components } else { &of.counted };
    let (spread, distance) = (Spread::from_components(counted), deviation.abs());
    if of.combined == 0.0 {
        return if distance > allowed { 0.0 } else { 1.0 };
    }
    (spread.tail(distance - allowed) + spread.tail(distance + allowed)).clamp(0.0, 1.0)
}

/// A normal or Student's t distribution, convolved with a rectangular one.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Spread {
    sigma: f64,
    degrees_of_freedom: Option<f64>,
    half_width: f64,
}

impl Spread {
    fn from_components(components: &[Component]) -> Self {
        let rectangular = components.iter().filter(|c| c.shape == Shape::Rectangular);
        let widest = rectangular.map(|c| c.uncertainty).fold(0.0, f64::max);
        // The other rectangular components are many or small, and their sum is nearly normal (GUM G.2.1).
        let variance = components.iter().map(|c| c.uncertainty.powi(2)).sum::<f64>() - widest.powi(2);
        let sigma = variance.max(0.0).sqrt();
        // Welch and Satterthwaite: JCGM 100:2008, G.2b.
        let fourth: f64 =
            components.iter().filter_map(|c| c.degrees_of_freedom.map(|freedom| c.uncertainty.powi(4) / freedom)).sum();
        let degrees_of_freedom = (fourth > 0.0 && sigma > 0.0).then(|| sigma.powi(4) / fourth);
        // The half width of a rectangular distribution is sqrt(3) standard uncertainties (GUM 4.3.7).
        Self { sigma, degrees_of_freedom, half_width: widest * 3f64.sqrt() }
    }

    /// The probability that an error is at least `x`.
    fn tail(&self, x: f64) -> f64 {
        let (sigma, half) = (self.sigma, self.half_width);
        if half <= NEGLIGIBLE_SHARE * sigma {
            return self.standard().tail(x / sigma);
        }
        if sigma <= NEGLIGIBLE_SHARE * half {
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
            // The ends are neighbouring numbers, so no further step is possible.
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

/// The distribution of an error in units of its standard uncertainty.
pub enum Standard {
    Normal(Normal),
    Student(StudentsT),
}

impl Standard {
    /// Student's t with so many degrees of freedom; the normal distribution without any.
    pub fn of(degrees_of_freedom: Option<f64>) -> Self {
        let student = degrees_of_freedom.filter(|f| *f < MANY).and_then(|f| StudentsT::new(0.0, 1.0, f).ok());
        student.map_or(Self::Normal(Normal::standard()), Self::Student)
    }

    /// The probability of an error of at least `z` standard uncertainties.
    pub fn tail(&self, z: f64) -> f64 {
        match self {
            Self::Normal(n) => n.sf(z),
            Self::Student(t) => t.sf(z),
        }
    }

    /// The integral of the tail probability from `low` to `high`.
    fn tail_between(&self, low: f64, high: f64) -> f64 {
        self.tail_integral(low) - self.tail_integral(high)
    }

    /// The integral of the tail probability from `z` to infinity, except for a constant.
    fn tail_integral(&self, z: f64) -> f64 {
        match self {
            // From d/dz (phi - z (1 - Phi)) = -(1 - Phi).
            Self::Normal(n) => n.pdf(z) - z * n.sf(z),
            // Likewise, with d/dz ((v + z^2) / (v - 1) f) = -z f; at v = 1 that is -ln(1 + z^2) / 2 pi.
            Self::Student(t) => {
                let freedom = t.freedom();
                let moment = if (freedom - 1.0).abs() < 1e-6 {
                    -(z * z).ln_1p() / std::f64::consts::TAU
                } else {
                    (freedom + z * z) / (freedom - 1.0) * t.pdf(z)
                };
                moment - z * t.sf(z)
            }
        }
    }
}

/// The probability beyond so many standard deviations of a normal distribution, on one side.
pub fn upper_tail_of_normal(standard_deviations: f64) -> f64 {
    Normal::standard().sf(standard_deviations)
}

#[cfg(test)]
mod tests {
    use super::*;
    use luxproof_process::random::normal;

    fn of(components: &[Component]) -> ErrorBudget {
        budget(components.to_vec(), upper_tail_of_normal(2.0))
    }

    #[test]
    fn components_add_in_quadrature_and_a_normal_budget_is_covered_by_the_factor_asked_for() {
        let found =
            of(&[Component::normal(Source::MonteCarlo, 3.0, None), Component::normal(Source::Reference, 4.0, None)]);
        assert!((found.combined - 5.0).abs() < 1e-15);
        assert!((found.coverage_factor - 2.0).abs() < 1e-9, "{found:?}");
        assert_eq!(found.degrees_of_freedom, None);
    }

    #[test]
    fn few_blocks_widen_the_interval_as_the_table_of_students_t_says() {
        // GUM table G.2, p = 95.45 %: 2.43 for 7 degrees of freedom, 13.97 for 1, 2 for many.
        for (freedom, factor) in [(7.0, 2.43), (1.0, 13.97), (1e5, 2.0), (1e18, 2.0), (1e300, 2.0)] {
            let found = of(&[Component::normal(Source::MonteCarlo, 1.0, Some(freedom))]);
            assert!((found.coverage_factor - factor).abs() < 5e-3, "{found:?}");
        }
    }

    #[test]
    fn a_bound_alone_is_covered_within_itself() {
        let found = of(&[Component::within(Source::Discretisation, 1.0)]);
        assert!((found.expanded - 0.9545).abs() < 1e-4, "{found:?}");
        assert!((found.combined - 1.0 / 3f64.sqrt()).abs() < 1e-15);
    }

    #[test]
    fn a_convolution_is_what_numbers_drawn_from_it_say() {
        const RUNS: usize = 20_000;
        let mut random = fastrand::Rng::with_seed(3);
        for freedom in [None, Some(1.0), Some(5.0)] {
            let spread = Spread { sigma: 0.7, degrees_of_freedom: freedom, half_width: 1.3 };
            let student = StudentsT::new(0.0, 1.0, freedom.unwrap_or(1e7)).unwrap();
            let mut drawn: Vec<f64> = vec![];
            for _ in 0..RUNS {
                let t = student.inverse_cdf(random.f64().clamp(1e-9, 1.0 - 1e-9));
                drawn.push(0.7 * t + 1.3 * (2.0 * random.f64() - 1.0));
            }
            for x in [-2.0, 0.0, 0.5, 1.5, 2.5] {
                let share = drawn.iter().filter(|d| **d >= x).count() as f64 / drawn.len() as f64;
                assert!((share - spread.tail(x)).abs() < 0.015, "{freedom:?} {x}: {share} {}", spread.tail(x));
            }
            assert!((spread.tail(spread.quantile(0.01)) - 0.01).abs() < 1e-9);
        }
    }

    fn chance(uncertainty: f64) -> Component {
        Component::normal(Source::MonteCarlo, uncertainty, Some(7.0))
    }

    #[test]
    fn a_component_that_no_stage_reduces_spends_its_whole_error_at_any_stage() {
        let tail = upper_tail_of_normal(2.0);
        let rounding = Component::within(Source::Rounding, 1.0);
        for share in [0.5, 0.125] {
            // Chance spends its share, and a bound is unchanged.
            let single = budget_of_stage(vec![chance(1.0)], tail, share);
            assert!((single.expanded - budget(vec![chance(1.0)], tail * share).expanded).abs() < 1e-9);
            assert_eq!(budget_of_stage(vec![rounding], tail, share).expanded, of(&[rounding]).expanded);
            // A small chance component makes little difference.
            let both = budget_of_stage(vec![chance(0.01), rounding], tail, share);
            assert!((both.expanded / of(&[chance(0.01), rounding]).expanded - 1.0).abs() < 2e-3, "{both:?}");
            assert_eq!(both.components, [chance(0.01), rounding]);
        }
    }

    #[test]
    fn without_uncertainty_the_distance_decides() {
        let none = of(&[]);
        assert_eq!((p_value(&none, 0.5, 1.0), p_value(&none, 1.5, 1.0), none.expanded), (1.0, 0.0, 0.0));
    }

    #[test]
    fn a_deviation_at_the_tolerance_has_even_odds_and_a_far_one_none() {
        let found = of(&[Component::normal(Source::MonteCarlo, 0.1, None)]);
        assert!((p_value(&found, 1.0, 1.0) - 0.5).abs() < 1e-12);
        assert!(p_value(&found, 2.0, 1.0) < 1e-20);
        // With no tolerance it is the usual test on both sides.
        assert!((p_value(&found, 0.196, 0.0) - 0.05).abs() < 1e-3);
    }

    // Values of `tests/values.py`, which integrates densities.

    #[test]
    fn the_end_gauge_of_the_gum_has_its_degrees_of_freedom_and_its_interval() {
        // JCGM 100:2008, H.1, in nanometres: comparator, standard, differences of expansion and of temperature.
        let parts = [(25.0, 18.0), (9.7, 25.6), (2.9, 50.0), (16.6, 2.0)];
        let parts = parts.map(|(u, freedom)| Component::normal(Source::Reference, u, Some(freedom)));
        let found = budget(parts.to_vec(), 0.005);
        assert_eq!(found.combined.round(), 32.0, "{found:?}");
        assert!((16.7..16.8).contains(&found.degrees_of_freedom.unwrap()), "{found:?}");
        // Table G.2 has 2.92 for 16 and 2.90 for 17 degrees of freedom.
        assert!((2.90..2.92).contains(&found.coverage_factor), "{found:?}");
        assert!((found.expanded - 91.94986).abs() < 1e-4, "{found:?}");
    }

    #[test]
    fn degrees_of_freedom_are_those_of_the_part_that_is_not_rectangular() {
        let rectangular = |bound| Component::within(Source::Discretisation, bound);
        let found = of(&[chance(1.0), rectangular(3.0)]);
        assert!((found.degrees_of_freedom.unwrap() - 7.0).abs() < 1e-12, "{found:?}");
        // A second, narrower bound joins the normal part: (1 + 4 / 3)^2 / (1 / 7).
        let found = of(&[chance(1.0), rectangular(3.0), rectangular(2.0)]);
        assert!((found.degrees_of_freedom.unwrap() - 7.0 * (7.0_f64 / 3.0).powi(2)).abs() < 1e-9, "{found:?}");
        assert!((found.combined - (1.0_f64 + 13.0 / 3.0).sqrt()).abs() < 1e-12, "{found:?}");
    }

    #[test]
    fn the_share_of_a_stage_changes_no_degrees_of_freedom() {
        // By hand: (3^2 + 4^2)^2 / (3^4 / 7).
        let parts = [chance(3.0), Component::normal(Source::Reference, 4.0, None)];
        for share in [1.0, 0.125] {
            let found = budget_of_stage(parts.to_vec(), upper_tail_of_normal(2.0), share);
            assert!((found.degrees_of_freedom.unwrap() - 7.0 * 625.0 / 81.0).abs() < 1e-9, "{share}: {found:?}");
        }
    }

    #[test]
    fn a_bound_is_convolved_with_chance_at_its_own_width() {
        for (freedom, bound, expanded) in [(None, 1.0, 2.298967156), (Some(5.0), 2.0, 3.376284182)] {
            let parts =
                [Component::normal(Source::MonteCarlo, 1.0, freedom), Component::within(Source::Discretisation, bound)];
            let found = of(&parts);
            assert!((found.expanded / expanded - 1.0).abs() < 1e-7, "{found:?}");
            let without = expanded_without(&found, Source::MonteCarlo, 2.0);
            assert!((without - 0.954499736 * bound).abs() < 1e-7, "{without}");
        }
    }

    #[test]
    fn a_p_value_spends_the_share_of_its_stage() {
        let chance = Component::normal(Source::MonteCarlo, 1.0, None);
        let tail = upper_tail_of_normal(2.0);
        for (share, expected) in [(1.0, 0.022781803), (0.5, 0.039746483)] {
            let stage = budget_of_stage(vec![chance], tail, share);
            let found = p_value(&stage, 3.0, 1.0);
            assert!((found - expected).abs() < 1e-8, "{share}: {found}");
            assert_eq!(p_value(&stage, -3.0, 1.0), found);
            // A file has only the plain components.
            let from_file = ErrorBudget { counted: vec![], ..stage };
            assert!((p_value(&from_file, 3.0, 1.0) - 0.022781803).abs() < 1e-8);
        }
    }

    #[test]
    fn both_tails_beyond_the_tolerance_count() {
        // Phi(-.5) + Phi(-1.5), from any table of the normal distribution.
        let found = p_value(&of(&[Component::normal(Source::MonteCarlo, 0.1, None)]), 0.1, 0.05);
        assert!((found - (0.308538 + 0.066807)).abs() < 1e-6, "{found}");
    }

    #[test]
    fn a_speed_limit_is_exceeded_for_sure_from_107_km_per_hour() {
        // JCGM 106:2012, guarded rejection: limit 100 km/h, standard uncertainty 2 %, 99.9 % sure from 100 / (1 - 3.09 * .02).
        for (speed, is_sure) in [(106.5, false), (106.7, true)] {
            let radar = of(&[Component::normal(Source::MonteCarlo, 0.02 * speed, None)]);
            // The limit as a tolerance of 60 km/h about 40 km/h.
            assert_eq!(p_value(&radar, speed - 40.0, 60.0) < 0.001, is_sure, "{speed}");
        }
    }

    /// How many of 40,000 errors lie outside their intervals.
    fn count_outside(mut draw: impl FnMut(&mut fastrand::Rng) -> (f64, Vec<Component>)) -> usize {
        let mut random = fastrand::Rng::with_seed(17);
        let is_outside = |(error, parts): (f64, Vec<Component>)| error.abs() > of(&parts).expanded;
        (0..40_000).filter(|_| is_outside(draw(&mut random))).count()
    }

    #[test]
    fn intervals_cover_the_truth_as_often_as_stated() {
        // 4.55 % of 40,000 are 1,820, with a standard deviation of 42.
        let of_chance_and_bound = count_outside(|random| {
            let error = normal(random) + 2.0 * (2.0 * random.f64() - 1.0);
            let chance = Component::normal(Source::MonteCarlo, 1.0, None);
            (error, vec![chance, Component::within(Source::Discretisation, 2.0)])
        });
        let of_three_samples = count_outside(|random| {
            let samples = [0; 3].map(|_| normal(random));
            let mean = samples.iter().sum::<f64>() / 3.0;
            let variance = samples.iter().map(|s| (s - mean).powi(2)).sum::<f64>() / 2.0;
            (mean, vec![Component::normal(Source::MonteCarlo, (variance / 3.0).sqrt(), Some(2.0))])
        });
        for count in [of_chance_and_bound, of_three_samples] {
            assert!((1_690..=1_950).contains(&count), "{of_chance_and_bound} {of_three_samples}");
        }
    }
}
