//! Axes: round ticks, and a scale of deviations that is linear near zero and logarithmic beyond.

use itertools::Itertools;

use crate::words::round_step;

/// Round values from `low` to `high`, about `count` of them.
pub(super) fn ticks(low: f64, high: f64, count: usize) -> Vec<f64> {
    let step = round_step((high - low) / count.max(1) as f64);
    if !(step.is_finite() && step > 0.0) {
        return vec![low];
    }
    let (first, last) = ((low / step - 1e-9).ceil() as i64, (high / step + 1e-9).floor() as i64);
    (first..=last).map(|k| k as f64 * step).collect()
}

/// Relative deviations in percent on a horizontal line: linear up to [`LINEAR_PERCENT`], logarithmic beyond.
pub(super) struct DeviationScale {
    most: f64,
    left: f64,
    width: f64,
}

/// Below this, in percent, the scale is linear: such differences come from rounding and single precision.
const LINEAR_PERCENT: f64 = 0.01;
/// The scale shows no larger deviation, in percent.
const MAX_PERCENT: f64 = 300.0;

impl DeviationScale {
    /// A scale that holds `most` percent on either side, between `left` and `left + width`.
    pub(super) fn new(most: f64, left: f64, width: f64) -> Self {
        // The next 1 or 3 of a decade leaves room between the marks and the edge.
        let decade = 10f64.powf(most.max(0.1).log10().floor());
        let most = [1.0, 3.0, 10.0].map(|d| d * decade).into_iter().find(|m| *m >= most).unwrap_or(10.0 * decade);
        Self { most: most.min(MAX_PERCENT), left, width }
    }

    /// The place of a deviation; one beyond the scale lies at its end.
    pub(super) fn x(&self, percent: f64) -> f64 {
        let part = (compress(percent) / compress(self.most)).clamp(-1.0, 1.0);
        self.left + 0.5 * self.width * (1.0 + part)
    }

    pub(super) fn ticks(&self) -> Vec<f64> {
        let decades = [0.1, 1.0, 10.0, 100.0].into_iter().filter(|d| *d <= self.most);
        decades.flat_map(|d| [-d, d]).chain([0.0]).sorted_by(f64::total_cmp).collect()
    }
}

/// A deviation on the compressed scale.
fn compress(percent: f64) -> f64 {
    (percent.abs() / LINEAR_PERCENT).ln_1p().copysign(percent)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_round_and_within_the_axis() {
        assert_eq!(ticks(0.0, 10.0, 5), [0.0, 2.0, 4.0, 6.0, 8.0, 10.0]);
        assert_eq!(ticks(0.5, 3.2, 3), [1.0, 2.0, 3.0]);
        assert_eq!(ticks(1.0, 1.0, 3), [1.0]);
    }

    #[test]
    fn the_scale_of_deviations_is_odd_and_rising() {
        let scale = DeviationScale::new(5.0, 10.0, 200.0);
        assert!((scale.x(0.0) - 110.0).abs() < 1e-12);
        for (a, b) in [(-300.0, -10.0), (-0.5, -0.05), (0.0, 1e-4), (0.02, 0.1), (1.0, 5.0)] {
            assert!(scale.x(a) <= scale.x(b), "{a} {b}");
            assert!((scale.x(a) + scale.x(-a) - 220.0).abs() < 1e-9);
        }
        assert!((scale.x(1e6) - 210.0).abs() < 1e-9, "what is beyond lies at the end");
    }
}
