//! The least of several values of which each is uncertain, with an uncertainty that holds for the least of what they stand for.
//!
//! The least of noisy values is too low: of a hundred equal meters it lies some 2.5 standard errors below all of them, while the error of
//! the meter that happens to be lowest says nothing of it. What holds is an interval: the least true value lies above the lowest of all lower
//! limits, since it lies above that of its own meter, and below the lowest of all upper limits, if all of them hold together (Bonferroni, which
//! asks nothing of what meters share). Only meters that may be the lowest count in the latter.

use super::uncertainty::{Component, ErrorBudget, Source};
use crate::record::{Estimate, Uncertainty};

/// The least of values; an error beyond the interval of one value has the probability `tail` on either side. `None` of no values.
pub(super) fn least(values: &[Estimate], tail: f64) -> Option<Estimate> {
    let value = values.iter().map(|e| e.value).min_by(f64::total_cmp)?;
    let together = Limits::of(values.iter(), tail / values.len() as f64);
    let edge = values.iter().map(|e| together.above(e)).fold(f64::INFINITY, f64::min);
    let candidates: Vec<&Estimate> = values.iter().filter(|e| together.below(e) <= edge || e.value <= value).collect();
    let of = |limits: &Limits| {
        let lowest = candidates.iter().map(|e| limits.below(e)).fold(f64::INFINITY, f64::min);
        let highest = candidates.iter().map(|e| limits.above(e)).fold(f64::INFINITY, f64::min);
        (value - lowest, highest - value)
    };
    let (single, all) = (
        Limits::of(candidates.iter().copied(), tail),
        Limits::of(candidates.iter().copied(), tail / candidates.len() as f64),
    );
    let half_width = of(&single).0.max(of(&all).1);
    let (down, up) = of(&Limits { factor: 0.0 });
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
pub(super) fn greatest(values: &[Estimate], tail: f64) -> Option<Estimate> {
    let negative = |e: &Estimate| Estimate { value: -e.value, uncertainty: e.uncertainty };
    least(&values.iter().map(negative).collect::<Vec<_>>(), tail).map(|e| negative(&e))
}

/// Limits of single values: so many standard errors, and all of their bounds besides.
struct Limits {
    factor: f64,
}

impl Limits {
    /// Such that one is beyond its value with this probability, by the fewest degrees of freedom of any: one factor for all of a grid.
    fn of<'a>(values: impl Iterator<Item = &'a Estimate>, tail: f64) -> Self {
        let fewest = values.filter_map(|e| e.uncertainty.degrees_of_freedom()).reduce(f64::min);
        let one = Component::normal(Source::MonteCarlo, 1.0, fewest);
        Self { factor: ErrorBudget::new(vec![one], tail).expanded }
    }

    fn reach(&self, of: &Estimate) -> f64 {
        self.factor * of.uncertainty.standard_error().unwrap_or(0.0) + of.uncertainty.bound()
    }

    fn below(&self, of: &Estimate) -> f64 {
        of.value - self.reach(of)
    }

    fn above(&self, of: &Estimate) -> f64 {
        of.value + self.reach(of)
    }
}
