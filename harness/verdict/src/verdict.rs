//! The verdict: an equivalence test of a deviation, with its uncertainty, against a tolerance.

use luxproof_model::Verdict;

/// Judges a deviation of a reading from its reference; `expanded` is k times the combined standard uncertainty.
///
/// Anything that is not a finite number is missing: nothing compares as equal by accident.
pub fn judge(deviation: f64, expanded: f64, allowed: f64) -> Verdict {
    if !(deviation.is_finite() && expanded.is_finite() && allowed.is_finite() && expanded >= 0.0) {
        return Verdict::Missing;
    }
    let distance = deviation.abs();
    if distance + expanded <= allowed {
        Verdict::Pass
    } else if distance - expanded > allowed {
        Verdict::Fail
    } else {
        Verdict::Undecided
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_interval_decides_and_nothing_compares_as_equal_by_accident() {
        const NAN: f64 = f64::NAN;
        for (deviation, expanded, allowed, verdict) in [
            (0.5, 0.4, 1.0, Verdict::Pass),
            (-0.5, 0.6, 1.0, Verdict::Undecided),
            (1.5, 0.6, 1.0, Verdict::Undecided),
            (-1.5, 0.4, 1.0, Verdict::Fail),
            // Zero tolerance passes only equality.
            (0.0, 0.0, 0.0, Verdict::Pass),
            (1e-300, 0.0, 0.0, Verdict::Fail),
            (NAN, 0.0, 1.0, Verdict::Missing),
            (0.0, NAN, 1.0, Verdict::Missing),
            (0.0, 0.0, NAN, Verdict::Missing),
            (f64::INFINITY, 0.0, 1.0, Verdict::Missing),
        ] {
            assert_eq!(judge(deviation, expanded, allowed), verdict, "{deviation} {expanded} {allowed}");
        }
    }
}
