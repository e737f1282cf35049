//! Numbers and words as every view writes them.

use unicode_width::{UnicodeWidthChar as _, UnicodeWidthStr as _};

pub use luxproof_model::numbers::{plural, round_step, rounded, significant, trimmed};
use luxproof_model::{Comparison, Verdict};
use luxproof_model::{Estimate, Reading};

/// Standard errors in the intervals that views print (JCGM 100:2008, 6.3.3).
const COVERAGE_FACTOR: f64 = 2.0;
/// Significant digits of a value that is shown with its uncertainty.
const MAX_DIGITS: f64 = 5.0;
/// Over what the largest errors go that views print.
pub(super) const LARGEST_ERROR_RULE: &str = "the largest error is that of the largest size among all points of an engine and a procedure, whatever their verdicts";
/// The heading of the trust statements.
pub(super) const HEADING: &str = "What each renderer can be trusted for, by this run";

pub(super) fn value(reading: &Reading) -> String {
    estimate(&reading.estimate())
}

/// A value with its uncertainty, both with the unit: `181.4 lx ± 1.2 lx`.
pub(super) fn value_with_unit(reading: &Reading) -> String {
    estimate_with_unit(&reading.estimate(), reading.quantity.unit())
}

/// An estimate with its expanded uncertainty in two digits: `181.4 ± 1.2`; six significant digits where none is stated.
pub(super) fn estimate(of: &Estimate) -> String {
    let half_width = expanded_uncertainty(of);
    let most_decimals = (MAX_DIGITS - 1.0 - of.value.abs().max(half_width).log10().floor()).clamp(0.0, 9.0);
    let decimals = two_digit_decimals(half_width, most_decimals);
    if !half_width.is_finite() || half_width < 0.5 * 10f64.powf(-most_decimals) {
        return significant(of.value);
    }
    format!("{:.decimals$} ± {half_width:.decimals$}", of.value)
}

/// An estimate and its expanded uncertainty, each with the unit, if any.
pub(super) fn estimate_with_unit(of: &Estimate, unit: &str) -> String {
    let space = if unit.is_empty() { "" } else { " " };
    format!("{}{space}{unit}", estimate(of).replace(" ± ", &format!("{space}{unit} ± ")))
}

/// Two standard errors (coverage of about 95 %) and the bound.
fn expanded_uncertainty(of: &Estimate) -> f64 {
    COVERAGE_FACTOR * of.uncertainty.standard_error().unwrap_or(0.0) + of.uncertainty.bound()
}

/// How many decimals show two significant digits of a number, up to `most`.
fn two_digit_decimals(number: f64, most: f64) -> usize {
    (1.0 - number.log10().floor()).clamp(0.0, most) as usize
}

/// Wraps a text to lines of at most `width` columns and indents all lines but the first.
///
/// A number and its `%` stay together. A word that is longer than a line continues on the next.
pub fn wrapped(text: &str, width: usize, indent: &str) -> String {
    let mut lines = vec![String::new()];
    // A no-break space binds the sign to its number until all lines are made.
    let bound = text.replace(" %", "\u{a0}%");
    for mut word in bound.split(' ') {
        let mut last = lines.pop().unwrap_or_default();
        let is_first = last.trim().is_empty();
        if !is_first && last.width() + 1 + word.width() > width {
            lines.push(std::mem::replace(&mut last, indent.to_owned()));
        } else if !is_first {
            last.push(' ');
        }
        while last.width() + word.width() > width && last.width() < width {
            let (head, rest) = word.split_at(bytes_that_fit(word, width - last.width()));
            if head.is_empty() {
                break;
            }
            lines.push(last + head);
            (last, word) = (indent.to_owned(), rest);
        }
        lines.push(last + word);
    }
    lines.join("\n").replace('\u{a0}', " ")
}

/// How many bytes of a text fit into so many columns.
fn bytes_that_fit(text: &str, columns: usize) -> usize {
    let mut used = 0;
    for (k, letter) in text.char_indices() {
        used += letter.width().unwrap_or(0);
        if used > columns {
            return k;
        }
    }
    text.len()
}

/// Cuts a text to at most so many columns at its end.
pub(super) fn cut(text: &str, columns: usize) -> String {
    if text.width() <= columns {
        return text.to_owned();
    }
    format!("{}…", &text[..bytes_that_fit(text, columns.saturating_sub(1))])
}

/// Cuts a name to at most so many columns in its middle: related names share their beginning and differ at the end.
pub(super) fn abridged(name: &str, columns: usize) -> String {
    if name.width() <= columns {
        return name.to_owned();
    }
    let head = cut(name, columns / 2);
    let tail: String = name.chars().rev().collect();
    let tail = &tail[..bytes_that_fit(&tail, columns - head.width())];
    head + &tail.chars().rev().collect::<String>()
}

/// A value with the half width of its interval in two digits: `2.0123 ± 0.0021`. A negligible half width is not shown.
pub fn interval(value: f64, half_width: f64) -> String {
    if half_width.is_finite() && half_width > 1e-6 * value.abs() {
        let decimals = two_digit_decimals(half_width, 9.0);
        format!("{value:.decimals$} ± {half_width:.decimals$}")
    } else {
        significant(value)
    }
}

/// A relative deviation with the half width of its interval in two digits: `+0.12 ± 0.31 %`.
pub(super) fn interval_in_percent(deviation: f64, half_width: f64) -> String {
    let percents = [100.0 * deviation, 100.0 * half_width];
    if percents.iter().all(|p| p.abs() < 5e-8) {
        return "0 %".to_owned();
    }
    let scale = if percents[1] > 1e-6 { percents[1] } else { percents[0].abs() };
    let decimals = two_digit_decimals(scale, 7.0);
    format!("{:+.decimals$} ± {:.decimals$} %", percents[0], percents[1])
}

/// A relative deviation with a sign and two significant digits; rounding noise is shown as zero.
pub(super) fn percent(deviation: f64) -> String {
    let percent = 100.0 * deviation;
    match percent.abs() {
        p if p < 5e-8 => "0 %".to_owned(),
        p if p < 0.001 => format!("{percent:+.0e} %"),
        p if p < 1.0 => format!("{percent:+.3} %"),
        _ => format!("{percent:+.1} %"),
    }
}

/// A verdict in plain text, in capitals where it needs attention.
pub(super) fn mark(verdict: Verdict) -> String {
    if verdict.is_bad() { verdict.name().to_uppercase() } else { verdict.name().to_owned() }
}

/// The deviation of a reading from its reference: in percent, or in its unit for a rating.
pub(super) fn off(c: &Comparison, percent: fn(f64) -> String) -> Option<String> {
    // A scale without a zero has no relative deviations.
    match c.relative_deviation {
        Some(deviation) => Some(percent(deviation)),
        None if c.quantity.has_zero() => None,
        None => c.deviation.map(|deviation| format!("{deviation:+.3} {}", c.quantity.unit())),
    }
}

/// The deviation of the largest magnitude.
pub(super) fn largest(deviations: impl Iterator<Item = f64>) -> Option<f64> {
    deviations.max_by(|a, b| a.abs().total_cmp(&b.abs()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use luxproof_model::{MeterId, Quantity, Uncertainty};

    #[test]
    fn a_value_and_its_uncertainty_have_the_same_unit() {
        let of = Estimate { value: 181.4012, uncertainty: Uncertainty::sampled(0.6, None) };
        assert_eq!(estimate_with_unit(&of, "lx"), "181.4 lx ± 1.2 lx");
        let of = Estimate { value: 181.4012, uncertainty: Uncertainty::Bound(0.012) };
        assert_eq!(estimate_with_unit(&of, "lx"), "181.40 lx ± 0.01 lx");
        assert_eq!(estimate_with_unit(&Estimate { value: 0.5, uncertainty: Uncertainty::Exact }, ""), "0.500000");
    }

    #[test]
    fn values_show_the_digits_they_deserve() {
        for (number, uncertainty, expected) in [
            (0.943_147, Uncertainty::sampled(0.001_2, None), "0.9431 ± 0.0024"),
            (1234.5678, Uncertainty::sampled(0.0, None), "1234.57"),
            (0.0, Uncertainty::Exact, "0"),
        ] {
            let (meter, quantity) = (MeterId::new("m", 0), Quantity::Illuminance);
            assert_eq!(value(&Reading::new(meter, quantity, Estimate { value: number, uncertainty })), expected);
        }
    }
}
