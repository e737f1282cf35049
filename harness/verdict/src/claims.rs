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
