//! Splits the deviation of an approximate method from a renderer into the shares of the method and the renderer.

use std::fmt;

use luxproof_photometry::units::Lux;

/// The deviation of a method from a renderer. All parts are relative to the renderer's value, and the shares add up.
///
/// With method a, renderer r and exact value x it is (a - r) / r = (a - x) / r + (x - r) / r.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DeviationSplit {
    /// Method over renderer, less 1.
    pub whole: f64,
    /// The share of the method's error.
    pub method: f64,
    /// The share of the renderer's error.
    pub renderer: f64,
    /// Half width of the interval of both shares: the uncertainties of exact value and renderer, added in quadrature.
    pub uncertainty: f64,
}

/// A value and the half width of its interval.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Uncertain {
    /// The value.
    pub value: Lux,
    /// Half width of its interval.
    pub half_width: Lux,
}

impl DeviationSplit {
    /// Splits the deviation of `method` from `renderer` at the `exact` value; `None` where the renderer reads no light.
    pub fn new(method: Lux, exact: Uncertain, renderer: Uncertain) -> Option<Self> {
        let rendered = renderer.value.value();
        if !(rendered.is_finite() && rendered > 0.0) {
            return None;
        }
        Some(Self {
            whole: (method - renderer.value).value() / rendered,
            method: (method - exact.value).value() / rendered,
            renderer: (exact.value - renderer.value).value() / rendered,
            uncertainty: exact.half_width.value().hypot(renderer.half_width.value()) / rendered,
        })
    }
}

/// The words after "IP-ED differs from Radiance by ".
impl fmt::Display for DeviationSplit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [whole, method, renderer, uncertainty] =
            [self.whole, self.method, self.renderer, self.uncertainty].map(rounded_percent);
        write!(
            f,
            "{whole:+.1} %: {method:+.1} % is the method's, {renderer:+.1} % the renderer's, +-{uncertainty:.1} %"
        )
    }
}

/// A share in percent with one decimal; adding 0 removes the sign of a negative zero.
fn rounded_percent(share: f64) -> f64 {
    (1000.0 * share).round() / 10.0 + 0.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    fn within(value: f64, half_width: f64) -> Uncertain {
        Uncertain { value: Lux(value), half_width: Lux(half_width) }
    }

    #[test]
    fn the_shares_add_up_and_read_as_a_sentence() {
        let split = DeviationSplit::new(Lux(1.089), within(1.002, 0.0006), within(1.0, 0.0008)).unwrap();
        assert_relative_eq!(split.whole, split.method + split.renderer, epsilon = 1e-15);
        assert_eq!(split.to_string(), "+8.9 %: +8.7 % is the method's, +0.2 % the renderer's, +-0.1 %");
    }

    #[test]
    fn shares_and_their_interval_are_relative_to_the_renderer() {
        // By hand: 30, 10 and 20 lx of 80 lx, and intervals of 3 and 4 lx in quadrature.
        let split = DeviationSplit::new(Lux(110.0), within(100.0, 3.0), within(80.0, 4.0)).unwrap();
        let expected = DeviationSplit { whole: 0.375, method: 0.125, renderer: 0.25, uncertainty: 0.0625 };
        assert_eq!(split, expected);
    }

    #[test]
    fn what_rounds_to_nothing_has_no_sign() {
        let split = DeviationSplit::new(Lux(1.03), within(0.9999, 0.0), within(1.0, 0.0)).unwrap();
        assert_eq!(split.to_string(), "+3.0 %: +3.0 % is the method's, +0.0 % the renderer's, +-0.0 %");
    }

    #[test]
    fn a_renderer_at_fault_is_not_laid_on_the_method() {
        let split = DeviationSplit::new(Lux(1.0), within(1.0, 0.0), within(0.9, 0.0)).unwrap();
        assert_eq!(split.method, 0.0);
        assert_relative_eq!(split.renderer, 1.0 / 9.0, epsilon = 1e-15);
        for dark in [0.0, -1.0, f64::NAN] {
            assert_eq!(DeviationSplit::new(Lux(1.0), within(1.0, 0.0), within(dark, 0.0)), None);
        }
    }
}
