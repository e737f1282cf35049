//! Weighted means of deviations and their scatter.

use luxproof_model::Scatter;
use statrs::distribution::{ContinuousCDF, Gamma};

use crate::error_budget::{MANY, Standard};

/// Values without uncertainty may differ by the rounding of single precision, which renderers compute in.
pub const SINGLE_PRECISION: f64 = 1e-6;
/// Meier's term is the first of a series in 1 / degrees of freedom. In simulations of up to 192 meters it is too small below this.
const MIN_FREEDOM_FOR_WEIGHTS: f64 = 7.0;

/// The weighted mean of values with stated uncertainties, widened where they scatter more than stated.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WeightedMean {
    pub value: f64,
    /// Standard uncertainty.
    pub uncertainty: f64,
    pub degrees_of_freedom: Option<f64>,
    pub scatter: Scatter,
}

impl WeightedMean {
    /// Averages values, given with their positive standard uncertainties and the degrees of freedom of these.
    ///
    /// `None` of fewer than two values, and where weights or scatter are not finite.
    pub fn of(values: &[(f64, f64, Option<f64>)]) -> Option<Self> {
        if values.len() < 2 {
            return None;
        }
        let weights: f64 = values.iter().map(|(_, u, _)| u.powi(-2)).sum();
        let value = values.iter().map(|(d, u, _)| d * u.powi(-2)).sum::<f64>() / weights;
        let squares = values.iter().map(|(d, u, _)| ((d - value) / u).powi(2)).sum::<f64>();
        let scatter = birge_ratio(squares, (values.len() - 1) as f64, values.iter().map(|(_, _, freedom)| *freedom));
        // Each value's share of the mean, with the degrees of freedom of its uncertainty.
        let shares: Vec<(f64, f64)> =
            values.iter().filter_map(|(_, u, freedom)| Some((u.powi(-2) / weights, (*freedom)?))).collect();
        let fewest = shares.iter().map(|(_, freedom)| *freedom).reduce(f64::min);
        // Estimated weights make the mean less certain than their sum suggests.
        let meier = 1.0 + 4.0 * shares.iter().map(|(share, freedom)| share * (1.0 - share) / freedom).sum::<f64>();
        let all = shares.iter().map(|(share, freedom)| share * share / freedom).sum::<f64>().recip();
        let degrees_of_freedom = fewest.map(|fewest| if fewest < MIN_FREEDOM_FOR_WEIGHTS { fewest } else { all });
        let mean = Self {
            value,
            uncertainty: (scatter.ratio.powi(2).max(meier) / weights).sqrt(),
            degrees_of_freedom,
            scatter,
        };
        let is_number = value.is_finite() && mean.uncertainty.is_finite() && mean.uncertainty > 0.0;
        is_number.then_some(mean)
    }

    /// The mean of meters that share noise: it counts as that of `design_effect` times fewer meters.
    ///
    /// Its degrees of freedom fall by the same factor, but not below those of the meter with the `fewest`.
    #[must_use]
    pub fn sharing(self, design_effect: f64, fewest: Option<f64>) -> Self {
        Self {
            uncertainty: design_effect.sqrt() * self.uncertainty,
            degrees_of_freedom: self
                .degrees_of_freedom
                .map(|all| (all / design_effect).max(fewest.unwrap_or(0.0).min(all))),
            ..self
        }
    }

    /// The probability of a mean at least this far from zero if the true mean is zero.
    pub fn p_value(&self) -> f64 {
        if self.value.abs() <= SINGLE_PRECISION {
            1.0
        } else {
            two_sided(self.value / self.uncertainty, self.degrees_of_freedom)
        }
    }
}

/// Probability of a standardised deviation at least this large on either side; 0 of what is not a finite number.
pub fn two_sided(z: f64, degrees_of_freedom: Option<f64>) -> f64 {
    if !z.is_finite() {
        return 0.0;
    }
    2.0 * Standard::of(degrees_of_freedom).tail(z.abs())
}

/// The Birge ratio of a sum of squared deviations, each over its uncertainty, with `free` degrees of freedom.
///
/// Where uncertainties have few degrees of freedom the squares are those of Student's t. Their sum is nearly gamma distributed with
/// the same mean and variance.
pub fn birge_ratio(squares: f64, free: f64, degrees_of_freedom: impl Iterator<Item = Option<f64>>) -> Scatter {
    let (mut mean, mut variance, mut count) = (0.0, 0.0, 0.0);
    for freedom in degrees_of_freedom {
        let n = freedom.unwrap_or(f64::INFINITY).min(MANY);
        mean += n / (n - 2.0);
        // With four degrees of freedom or fewer the squares have no variance, and no p-value follows.
        variance += if n > 4.0 { 2.0 * n * n * (n - 1.0) / ((n - 2.0).powi(2) * (n - 4.0)) } else { f64::NAN };
        count += 1.0;
    }
    let (mean, variance) = (mean * free / count, variance * free / count);
    let gamma = Gamma::new(mean * mean / variance, mean / variance);
    Scatter { ratio: (squares / free).sqrt(), p_value: gamma.ok().map(|g| g.sf(squares)).filter(|p| p.is_finite()) }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Whether two numbers agree to eight digits.
    fn is_close(found: f64, expected: f64) -> bool {
        (found / expected - 1.0).abs() < 1e-8
    }

    #[test]
    fn weights_are_inverse_variances_and_the_birge_ratio_widens_the_error() {
        // By hand: weights 1 and 1/4, mean 2 / 1.25, chi-squared .36 + 1.44.
        let mean = WeightedMean::of(&[(1.0, 1.0, None), (4.0, 2.0, None)]).unwrap();
        assert!(is_close(mean.value, 1.6) && is_close(mean.scatter.ratio, 1.8_f64.sqrt()), "{mean:?}");
        assert!(is_close(mean.uncertainty, (1.8_f64 / 1.25).sqrt()), "{mean:?}");
        assert_eq!(mean.degrees_of_freedom, None);
        // A scatter below the stated errors narrows nothing.
        let calm = WeightedMean::of(&[(-1.0, 1.0, None), (-1.0, 2.0, None)]).unwrap();
        assert!(is_close(calm.value, -1.0) && is_close(calm.uncertainty, 0.8_f64.sqrt()), "{calm:?}");
        assert_eq!(WeightedMean::of(&[(1.0, 1.0, None)]), None);
    }

    #[test]
    fn estimated_weights_widen_the_error_as_meier_says() {
        // Equal values with 10 degrees of freedom each: 1 + 4 * 2 * (1/2 * 1/2) / 10.
        let mean = WeightedMean::of(&[(1.0, 2.0, Some(10.0)), (1.0, 2.0, Some(10.0))]).unwrap();
        assert!(is_close(mean.uncertainty, (1.2_f64 * 4.0 / 2.0).sqrt()), "{mean:?}");
        assert!(is_close(mean.degrees_of_freedom.unwrap(), 20.0), "{mean:?}");
        // Where the values scatter more, that counts instead.
        let wide = WeightedMean::of(&[(-1.0, 1.0, Some(10.0)), (3.0, 1.0, Some(10.0))]).unwrap();
        assert!(is_close(wide.uncertainty, 2.0), "{wide:?}");
        // Below seven degrees of freedom the mean has only those of its worst value.
        let few = WeightedMean::of(&[(1.0, 2.0, Some(6.0)), (1.0, 2.0, Some(20.0))]).unwrap();
        assert_eq!(few.degrees_of_freedom, Some(6.0));
    }

    #[test]
    fn a_mean_has_the_values_of_a_second_implementation() {
        // Of `tests/values.py`.
        let values = [(0.010, 0.002, Some(7.0)), (0.013, 0.001, Some(15.0)), (0.006, 0.002, Some(20.0))];
        let mean = WeightedMean::of(&values).unwrap();
        assert!(is_close(mean.value, 0.0113333333333), "{mean:?}");
        assert!(is_close(mean.uncertainty, 0.00185592145428), "{mean:?}");
        assert!(is_close(mean.degrees_of_freedom.unwrap(), 28.5822306238), "{mean:?}");
        assert!(is_close(mean.scatter.ratio, 2.27303028283), "{mean:?}");
        assert!((mean.scatter.p_value.unwrap() / 0.03054989768 - 1.0).abs() < 1e-5, "{mean:?}");
        assert!((mean.p_value() / 1.2625765e-6 - 1.0).abs() < 1e-3, "{}", mean.p_value());
    }

    #[test]
    fn a_p_value_is_two_sided_and_that_of_students_t() {
        // Tables: 5 % beyond 1.959964 of the normal distribution and beyond 2.228139 of t with 10 degrees of freedom.
        for (z, freedom) in [(1.959964, None), (-1.959964, None), (2.228139, Some(10.0))] {
            assert!((two_sided(z, freedom) - 0.05).abs() < 1e-6, "{z} {freedom:?}");
        }
        assert_eq!([f64::NAN, f64::INFINITY].map(|z| two_sided(z, None)), [0.0; 2]);
        // Renderers compute in single precision: a smaller mean shows nothing.
        let tiny = WeightedMean::of(&[(9e-7, 1e-9, None), (9e-7, 1e-9, None)]).unwrap();
        assert_eq!(tiny.p_value(), 1.0);
        let small = WeightedMean::of(&[(1.1e-6, 1e-9, None), (1.1e-6, 1e-9, None)]).unwrap();
        assert!(small.p_value() < 1e-12);
    }

    #[test]
    fn the_scatter_of_exactly_known_errors_is_chi_squared() {
        // Tables: 5 % beyond 18.307 with 10 degrees of freedom.
        let found = birge_ratio(18.307, 10.0, std::iter::repeat_n(None, 11));
        assert!((found.p_value.unwrap() - 0.05).abs() < 1e-5 && is_close(found.ratio, 1.8307_f64.sqrt()), "{found:?}");
        // The square of t with four degrees of freedom has no variance.
        assert_eq!(birge_ratio(18.307, 10.0, std::iter::repeat_n(Some(4.0), 11)).p_value, None);
    }

    #[test]
    fn noise_that_meters_share_makes_them_count_as_fewer() {
        let mean = WeightedMean::of(&[(1.0, 2.0, Some(10.0)), (1.0, 2.0, Some(10.0))]).unwrap();
        let shared = mean.sharing(1.44, Some(5.0));
        assert!(is_close(shared.uncertainty, 1.2 * mean.uncertainty), "{shared:?}");
        assert!(is_close(shared.degrees_of_freedom.unwrap(), 20.0 / 1.44), "{shared:?}");
        // The meter with the fewest keeps its own.
        let fewest = mean.sharing(4.0, Some(10.0)).degrees_of_freedom.unwrap();
        assert!(is_close(fewest, 10.0), "{fewest}");
        assert_eq!(shared.value, mean.value);
    }
}
