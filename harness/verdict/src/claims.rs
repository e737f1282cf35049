//! Words for a renderer's readings of one procedure.

use luxproof_model::ProcedureClaim;

use luxproof_model::ProcedureId;
use luxproof_model::numbers::{rounded, trimmed};

/// A sentence reports a bias from this part of the largest deviation on.
const MIN_BIAS_SHARE: f64 = 0.25;

/// The short name of a claim's procedure.
pub(super) fn claim_name(claim: &ProcedureClaim) -> String {
    let short = claim.procedure.short().to_lowercase();
    // Readers without a background in rendering know no bounces.
    if claim.procedure == ProcedureId::IndirectIlluminance { "reflected".to_owned() } else { short }
}

/// The largest deviation in words: in percent, or in units of a rating.
pub(super) fn describe_reach(claim: &ProcedureClaim, within: f64) -> String {
    let quantity = claim.procedure.quantity();
    if quantity.has_zero() {
        return round_up(within);
    }
    let shown = round_up(0.01 * within);
    format!("{} {}", shown.trim_end_matches(" %"), quantity.unit())
}

/// Describes a claim without failures: `direct within 0.01 %`.
pub(super) fn describe_sound(claim: &ProcedureClaim) -> String {
    let name = claim_name(claim);
    let mut text = match claim.within {
        Some(within) => format!("{name} within {}", describe_reach(claim, within)),
        None => format!("{name} only as is on record"),
    };
    let bias = claim.bias.filter(|b| claim.within.is_some_and(|w| b.abs() > MIN_BIAS_SHARE * w));
    if let Some(bias) = bias {
        text += &format!(" ({} on the whole)", describe_range(bias, bias));
    }
    if claim.known_deviations > 0 && claim.within.is_some() {
        text += &format!(" but for {} of {} known to deviate", claim.known_deviations, claim.readings);
    }
    text
}

/// A range of relative deviations in words.
pub(super) fn describe_range(from: f64, to: f64) -> String {
    match (from < 0.0, to > 0.0) {
        (true, false) => format!("{} low", describe_sizes(to, from)),
        (false, true) => format!("{} high", describe_sizes(from, to)),
        _ => format!("{} % low to {} % high", percent(from), percent(to)),
    }
}

/// Two deviations by their sizes, the nearer first.
fn describe_sizes(near: f64, far: f64) -> String {
    let (near, far) = (percent(near), percent(far));
    if near == far { format!("{far} %") } else { format!("{near} to {far} %") }
}

/// The size of a deviation in percent, with two digits.
fn percent(deviation: f64) -> String {
    trimmed(100.0 * rounded(deviation.abs(), 2).unwrap_or(deviation.abs()), 6)
}

/// A bound in percent, rounded up to two digits.
pub(super) fn round_up(within: f64) -> String {
    let percent = (100.0 * within).max(1e-4);
    let step = 10f64.powf(percent.log10().floor() - 1.0);
    format!("{} %", trimmed((percent / step - 1e-9).ceil() * step, 6))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn claim(procedure: ProcedureId, within: Option<f64>, bias: Option<f64>) -> ProcedureClaim {
        ProcedureClaim {
            procedure,
            readings: 9,
            within,
            failed: 0,
            undecided: 0,
            known_deviations: 0,
            missing: 0,
            bias,
        }
    }

    const DIRECT: ProcedureId = ProcedureId::DirectIlluminance;

    #[test]
    fn a_bound_is_rounded_up_to_two_digits() {
        for (within, shown) in [
            (0.0101, "1.1 %"),
            (0.01, "1 %"),
            (0.0111, "1.2 %"),
            (0.125, "13 %"),
            (0.12, "12 %"),
            (1.21, "130 %"),
            (1.01e-4, "0.011 %"),
            // The least that is shown is 1e-4 %.
            (1e-9, "0.0001 %"),
            (0.0, "0.0001 %"),
            (1.21e-6, "0.00013 %"),
        ] {
            assert_eq!(round_up(within), shown, "{within}");
        }
    }

    #[test]
    fn a_range_has_the_nearer_deviation_first_and_names_its_side() {
        for (from, to, shown) in [
            (-0.05, -0.02, "2 to 5 % low"),
            (0.02, 0.05, "2 to 5 % high"),
            (-0.02, 0.05, "2 % low to 5 % high"),
            (0.0, 0.0, "0 % low to 0 % high"),
            (-0.05, 0.0, "0 to 5 % low"),
            (0.0, 0.05, "0 to 5 % high"),
            (-0.0301, -0.03, "3 % low"),
            (0.03, 0.0301, "3 % high"),
            (0.0314, 0.0314, "3.1 % high"),
        ] {
            assert_eq!(describe_range(from, to), shown, "{from} {to}");
        }
    }

    #[test]
    fn a_reach_is_in_percent_or_in_the_unit_of_a_rating() {
        assert_eq!(describe_reach(&claim(DIRECT, None, None), 0.0101), "1.1 %");
        assert_eq!(describe_reach(&claim(ProcedureId::UnifiedGlareRating, None, None), 1.21), "1.3 UGR");
        assert_eq!(claim_name(&claim(ProcedureId::IndirectIlluminance, None, None)), "reflected");
        assert_eq!(claim_name(&claim(DIRECT, None, None)), "direct");
    }

    #[test]
    fn a_bias_is_reported_beyond_a_quarter_of_the_largest_deviation() {
        for (within, bias, shown) in [
            (Some(0.04), Some(0.0101), "direct within 4 % (1 % high on the whole)"),
            (Some(0.04), Some(-0.0101), "direct within 4 % (1 % low on the whole)"),
            (Some(0.04), Some(0.01), "direct within 4 %"),
            (Some(0.04), None, "direct within 4 %"),
            (None, Some(0.03), "direct only as is on record"),
        ] {
            assert_eq!(describe_sound(&claim(DIRECT, within, bias)), shown, "{within:?} {bias:?}");
        }
    }

    #[test]
    fn known_deviations_are_counted_where_something_passes() {
        let known = |within| ProcedureClaim { known_deviations: 2, ..claim(DIRECT, within, None) };
        assert_eq!(describe_sound(&known(Some(0.04))), "direct within 4 % but for 2 of 9 known to deviate");
        assert_eq!(describe_sound(&known(None)), "direct only as is on record");
    }
}
