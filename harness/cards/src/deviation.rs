//! Deviations with their uncertainty, relative or of a rating.

use std::fmt;

use luxproof_model::{Comparison, Quantity};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// What a deviation is measured in.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Measure {
    /// Parts of the reference.
    Relative,
    /// Units of a glare rating.
    Rating,
}

impl Measure {
    const fn of(quantity: Quantity) -> Self {
        if quantity.has_zero() { Self::Relative } else { Self::Rating }
    }
}

/// A deviation from a reference with its expanded uncertainty (coverage factor 2), that of the reference included.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Deviation {
    pub value: f64,
    pub expanded: f64,
    pub measure: Measure,
}

impl Deviation {
    /// The deviation of a comparison; `None` without a value, a reference or a scale.
    ///
    /// Near zero a relative deviation means nothing. There the scale is the reference at which the relative tolerance begins to
    /// count: absolute over relative tolerance.
    pub fn of(c: &Comparison) -> Option<Self> {
        let (deviation, reference) = (c.deviation?, c.reference.as_ref()?);
        let coverage = reference.coverage_factor.unwrap_or(2.0);
        let of_reference = coverage * reference.uncertainty;
        // The budget contains the reference's part; an older report may lack it.
        let expanded = c.budget.as_ref().map_or(of_reference, |budget| budget.expanded.max(of_reference));
        let measure = Measure::of(c.quantity);
        let scale = match measure {
            Measure::Rating => 1.0,
            Measure::Relative if c.tolerance.relative > 0.0 => {
                reference.value.abs().max(c.tolerance.absolute / c.tolerance.relative)
            }
            Measure::Relative => reference.value.abs(),
        };
        let found = Self { value: deviation / scale, expanded: expanded / scale, measure };
        found.bound().is_finite().then_some(found)
    }

    /// The largest error that the value may have: its size plus the expanded uncertainty.
    pub fn bound(&self) -> f64 {
        self.value.abs() + self.expanded
    }

    /// The bound with two digits, rounded up: a card never claims more than was measured.
    pub fn bound_text(&self) -> String {
        match self.measure {
            Measure::Relative => format!("{} %", rounded_up(100.0 * self.bound())),
            Measure::Rating => format!("{} UGR", rounded_up(self.bound())),
        }
    }
}

/// A number above zero in plain digits, two of them significant, rounded up.
fn rounded_up(value: f64) -> String {
    const SMALLEST: f64 = 1e-4;
    if value < SMALLEST {
        return "0.0001".to_owned();
    }
    let decimals = (1.0 - value.log10().floor()).max(0.0);
    let scale = 10f64.powf(decimals);
    // Rounding noise of the product must not add a digit.
    let up = (value * scale * (1.0 - 1e-12)).ceil() / scale;
    format!("{up:.*}", decimals as usize)
}

/// `+0.61 % ± 0.23 %`, or `+0.12 ± 0.05 UGR`.
impl fmt::Display for Deviation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (scale, unit) = match self.measure {
            Measure::Relative => (100.0, "%"),
            Measure::Rating => (1.0, "UGR"),
        };
        let [value, expanded] = [scale * self.value, scale * self.expanded];
        let leading = if expanded > 1e-4 { expanded } else { value.abs().max(1e-4) };
        let decimals = (1.0 - leading.log10().floor()).clamp(0.0, 4.0) as usize;
        // A real minus sign, and no negative zero.
        let number = format!("{:.decimals$}", value.abs());
        let is_zero = number.bytes().all(|b| matches!(b, b'0' | b'.'));
        let sign = if is_zero {
            ""
        } else if value < 0.0 {
            "−"
        } else {
            "+"
        };
        write!(f, "{sign}{number} ± {expanded:.decimals$} {unit}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn deviation(value: f64, expanded: f64) -> Deviation {
        Deviation { value, expanded, measure: Measure::Relative }
    }

    #[test]
    fn a_bound_is_rounded_up_and_never_down() {
        for (value, expected) in [
            (0.0, "0.0001"),
            (0.0012, "0.0012"),
            (0.00121, "0.0013"),
            (0.84, "0.84"),
            (0.841, "0.85"),
            (1.0, "1.0"),
            (9.96, "10.0"),
            (12.3, "13"),
            (1689.3, "1690"),
        ] {
            assert_eq!(rounded_up(value), expected, "{value}");
        }
        assert_eq!(deviation(-0.006, 0.0024).bound_text(), "0.84 %");
    }

    #[test]
    fn a_deviation_has_its_uncertainty_and_a_real_minus_sign() {
        assert_eq!(deviation(-0.0061, 0.0023).to_string(), "−0.61 ± 0.23 %");
        assert_eq!(deviation(0.0, 0.00001).to_string(), "0.0000 ± 0.0010 %");
        let glare = Deviation { value: 0.12, expanded: 0.05, measure: Measure::Rating };
        assert_eq!(glare.to_string(), "+0.120 ± 0.050 UGR");
    }
}
