//! The least or greatest of several uncertain values, with an uncertainty that holds for the true extreme.
//!
//! The least of noisy values is too low: of a hundred equal meters it lies some 2.5 standard errors below the true value. The error
//! of the meter that happens to be lowest does not show that, so an interval is computed instead. The least true value lies above
//! the lowest of all lower limits. It lies below the lowest of all upper limits if all of these hold at once. Bonferroni's correction
//! ensures that, whatever noise meters share. Only meters that may be the lowest count in the correction.

use crate::error_budget::budget;
use luxproof_model::{Component, Source};
use luxproof_model::{Estimate, Uncertainty};

/// The least of values; an error beyond the interval of one value has the probability `tail` on either side. `None` of no values.
pub fn least(values: &[Estimate], tail: f64) -> Option<Estimate> {
    let value = values.iter().map(|e| e.value).min_by(f64::total_cmp)?;
    let all_limits = Limits::new(values.iter(), tail / values.len() as f64);
    let edge = values.iter().map(|e| all_limits.upper(e)).fold(f64::INFINITY, f64::min);
    let candidates: Vec<&Estimate> =
        values.iter().filter(|e| all_limits.lower(e) <= edge || e.value <= value).collect();
    let single = Limits::new(candidates.iter().copied(), tail);
    let corrected = Limits::new(candidates.iter().copied(), tail / candidates.len() as f64);
    let half_width = single.least_interval(&candidates, value).0.max(corrected.least_interval(&candidates, value).1);
    // With a factor of zero only the bounds remain.
    let (down, up) = Limits { factor: 0.0 }.least_interval(&candidates, value);
    let bound = down.max(up).max(0.0);
    let kind = Uncertainty::of_dependent_sum(candidates.iter().map(|e| (1.0, e.uncertainty)));
    let uncertainty = match kind {
        _ if candidates.iter().any(|e| e.uncertainty == Uncertainty::NotSeen) => Uncertainty::NotSeen,
        Uncertainty::StandardError { degrees_of_freedom, .. } if single.factor > 0.0 => Uncertainty::StandardError {
            value: (half_width - bound).max(0.0) / single.factor,
            degrees_of_freedom,
            bound,
        },
        Uncertainty::Bound(_) => Uncertainty::Bound(bound),
        other => other,
    };
    Some(Estimate { value, uncertainty })
}

/// The greatest of values, likewise.
pub fn greatest(values: &[Estimate], tail: f64) -> Option<Estimate> {
    let negative: Vec<Estimate> = values.iter().map(negate).collect();
    least(&negative, tail).map(|e| negate(&e))
}

/// The estimate with the opposite sign.
fn negate(estimate: &Estimate) -> Estimate {
    Estimate { value: -estimate.value, uncertainty: estimate.uncertainty }
}

/// Limits of single values: a number of standard errors plus the whole bound.
struct Limits {
    /// The number of standard errors.
    factor: f64,
}

impl Limits {
    /// A value lies beyond its limit with this probability, by the fewest degrees of freedom of any: one factor for a whole grid.
    fn new<'a>(values: impl Iterator<Item = &'a Estimate>, tail: f64) -> Self {
        let fewest = values.filter_map(|e| e.uncertainty.degrees_of_freedom()).reduce(f64::min);
        let unit = Component::normal(Source::MonteCarlo, 1.0, fewest);
        Self { factor: budget(vec![unit], tail).expanded }
    }

    fn half_width(&self, of: &Estimate) -> f64 {
        self.factor * of.uncertainty.standard_error().unwrap_or(0.0) + of.uncertainty.bound()
    }

    fn lower(&self, of: &Estimate) -> f64 {
        of.value - self.half_width(of)
    }

    fn upper(&self, of: &Estimate) -> f64 {
        of.value + self.half_width(of)
    }

    /// How far the least true value may lie below and above `value`.
    fn least_interval(&self, candidates: &[&Estimate], value: f64) -> (f64, f64) {
        let lowest = candidates.iter().map(|e| self.lower(e)).fold(f64::INFINITY, f64::min);
        let highest = candidates.iter().map(|e| self.upper(e)).fold(f64::INFINITY, f64::min);
        (value - lowest, highest - value)
    }
}
