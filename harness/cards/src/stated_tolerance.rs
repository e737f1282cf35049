//! Tolerances: how far a point may be from its reference.

use std::fmt;

use itertools::Itertools;
use luxproof_model::Comparison;
use luxproof_model::numbers::trimmed;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Digits after the point of a tolerance in percent or in a unit.
const DECIMALS: usize = 4;

/// How far a point may be from its reference: the larger of both parts. The deviation counts with its expanded uncertainty.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct StatedTolerance {
    /// Relative to the reference.
    pub relative: f64,
    /// In the unit.
    pub absolute: f64,
    pub unit: String,
}

impl StatedTolerance {
    pub(crate) fn of(c: &Comparison) -> Self {
        let unit = c.quantity.unit().to_owned();
        Self { relative: c.tolerance.relative, absolute: c.tolerance.absolute, unit }
    }

    /// The tolerances of comparisons, each once, the narrowest first.
    pub(crate) fn all_of(tolerances: impl IntoIterator<Item = Self>) -> Vec<Self> {
        let sorted = tolerances.into_iter().sorted_by(|a, b| {
            a.relative.total_cmp(&b.relative).then(a.absolute.total_cmp(&b.absolute)).then(a.unit.cmp(&b.unit))
        });
        sorted.dedup().collect()
    }
}

/// `1 % or 0.001 lx`.
impl fmt::Display for StatedTolerance {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let relative = (self.relative > 0.0).then(|| format!("{} %", trimmed(100.0 * self.relative, DECIMALS)));
        let absolute = (self.absolute > 0.0)
            .then(|| format!("{} {}", trimmed(self.absolute, DECIMALS), self.unit).trim().to_owned());
        let parts: Vec<String> = relative.into_iter().chain(absolute).collect();
        f.write_str(if parts.is_empty() { "0" } else { "" })?;
        f.write_str(&parts.join(" or "))
    }
}

/// The relative tolerances in a few words, `1 %` or `1 to 2 %`; of ratings the absolute ones. `None` without any.
pub(crate) fn summary(tolerances: &[StatedTolerance]) -> Option<String> {
    let relative: Vec<f64> =
        tolerances.iter().map(|tolerance| 100.0 * tolerance.relative).filter(|tolerance| *tolerance > 0.0).collect();
    if relative.is_empty() {
        let tolerance = tolerances.first()?;
        return Some(range(tolerances.iter().map(|tolerance| tolerance.absolute), &tolerance.unit));
    }
    Some(range(relative, "%"))
}

/// The widest relative part, and the widest absolute one without any.
pub(crate) fn widest(tolerances: &[StatedTolerance]) -> f64 {
    let relative = tolerances.iter().map(|tolerance| tolerance.relative).fold(0.0, f64::max);
    if relative > 0.0 { relative } else { tolerances.iter().map(|tolerance| tolerance.absolute).fold(0.0, f64::max) }
}

fn range(tolerances: impl IntoIterator<Item = f64>, unit: &str) -> String {
    let (low, high) = tolerances.into_iter().fold((f64::INFINITY, 0.0_f64), |(low, high), x| (low.min(x), high.max(x)));
    let [from, to] = [low, high].map(|tolerance| trimmed(tolerance, DECIMALS));
    let text = if from == to { format!("{from} {unit}") } else { format!("{from} to {to} {unit}") };
    text.trim().to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tolerance(relative: f64, absolute: f64, unit: &str) -> StatedTolerance {
        StatedTolerance { relative, absolute, unit: unit.to_owned() }
    }

    #[test]
    fn a_tolerance_reads_as_a_reader_needs_it() {
        assert_eq!(tolerance(0.01, 0.001, "lx").to_string(), "1 % or 0.001 lx");
        assert_eq!(tolerance(0.005, 0.0, "cd").to_string(), "0.5 %");
        assert_eq!(tolerance(0.0, 0.5, "UGR").to_string(), "0.5 UGR");
        assert_eq!(tolerance(0.0, 0.0, "lx").to_string(), "0");
    }

    #[test]
    fn tolerances_are_summed_up_by_their_range() {
        let all = StatedTolerance::all_of([
            tolerance(0.02, 0.0, "lx"),
            tolerance(0.01, 0.001, "lx"),
            tolerance(0.02, 0.0, "lx"),
        ]);
        assert_eq!(all.len(), 2);
        assert_eq!(summary(&all).as_deref(), Some("1 to 2 %"));
        assert_eq!(summary(&all[..1]).as_deref(), Some("1 %"));
        assert_eq!(summary(&[tolerance(0.0, 0.5, "UGR")]).as_deref(), Some("0.5 UGR"));
        assert_eq!(summary(&[]), None);
    }
}
