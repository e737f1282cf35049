//! Splits the deviation of an approximate method from a renderer into the method's share and the renderer's.

use std::fmt;

use crate::units::Lux;

/// Deviation of a method from a renderer, every part relative to the renderer's value; the shares add up to the whole.
///
/// With the exact value x between them, (a - r) / r = (a - x) / r + (x - r) / r.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DeviationSplit {
    /// Method over renderer, less 1.
    pub whole: f64,
    /// What the method's own error makes of it.
    pub method: f64,
    /// What the renderer's error makes of it.
    pub renderer: f64,
    /// Half width of the interval of both shares: uncertainty of the exact value and of the renderer's, added in quadrature.
    pub uncertainty: f64,
}

/// A value and the half width of the interval it stands for.
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
        let share = |from: Lux, to: Lux| (from - to).value() / rendered;
        Some(Self {
            whole: share(method, renderer.value),
            method: share(method, exact.value),
            renderer: share(exact.value, renderer.value),
            uncertainty: exact.half_width.value().hypot(renderer.half_width.value()) / rendered,
        })
    }
}

/// The words after "IP-ED differs from Radiance by ".
impl fmt::Display for DeviationSplit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        // What rounds to nothing has no sign.
        let percent = |share: f64| (1000.0 * share).round() / 10.0 + 0.0;
        write!(
            f,
            "{:+.1} %: {:+.1} % is the method's, {:+.1} % the renderer's, +-{:.1} %",
            percent(self.whole),
            percent(self.method),
            percent(self.renderer),
            percent(self.uncertainty)
        )
    }
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
