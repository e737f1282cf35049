//! Numbers and words as every view writes them.

use unicode_width::{UnicodeWidthChar as _, UnicodeWidthStr as _};

use crate::judge::{Comparison, Verdict};
use crate::record::{Estimate, Reading};

pub(super) fn value(reading: &Reading) -> String {
    estimate(&Estimate { value: reading.value, uncertainty: reading.uncertainty })
}

/// Six significant digits, and the standard error in the last two digits that it reaches: `0.9431(12)`.
pub(super) fn estimate(of: &Estimate) -> String {
    match of.uncertainty.standard_error() {
        Some(e) if e > 0.0 && of.value > 0.0 => {
            let decimals = (1.0 - e.log10().floor()).clamp(0.0, 9.0) as usize;
            let in_units = (e * 10f64.powf(decimals as f64)).round();
            format!("{:.decimals$}({in_units})", of.value)
        }
        _ => significant(of.value),
    }
}

/// A text in lines of so many columns; lines after the first are indented, no number loses its `%`, and a word that is longer goes on below.
pub(super) fn wrapped(text: &str, width: usize, indent: &str) -> String {
    let mut lines = vec![String::new()];
    let whole = text.replace(" %", "\u{a0}%");
    for mut word in whole.split(' ') {
        let mut last = lines.pop().unwrap_or_default();
        let is_first = last.trim().is_empty();
        if !is_first && last.width() + 1 + word.width() > width {
            lines.push(std::mem::replace(&mut last, indent.to_owned()));
        } else if !is_first {
            last.push(' ');
        }
        while last.width() + word.width() > width && last.width() < width {
            let (head, rest) = word.split_at(fitting(word, width - last.width()));
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

/// How many bytes of a text have so many columns.
fn fitting(text: &str, columns: usize) -> usize {
    let mut used = 0;
    let mut outside = |letter: char| {
        used += letter.width().unwrap_or(0);
        used > columns
    };
    text.char_indices().find_map(|(k, letter)| outside(letter).then_some(k)).unwrap_or(text.len())
}

/// A text of so many columns at most, its end left out.
pub(super) fn cut(text: &str, columns: usize) -> String {
    if text.width() <= columns {
        return text.to_owned();
    }
    format!("{}…", &text[..fitting(text, columns.saturating_sub(1))])
}

/// A name of so many columns at most: its middle is left out, for names of a kind begin alike and end with their number.
pub(super) fn abridged(name: &str, columns: usize) -> String {
    if name.width() <= columns {
        return name.to_owned();
    }
    let head = cut(name, columns / 2);
    let tail: String = name.chars().rev().collect();
    let tail = &tail[..fitting(&tail, columns - head.width())];
    head + &tail.chars().rev().collect::<String>()
}

/// A value with the half width of its interval in two digits, `2.0123 +- 0.0021`; six significant digits where that is below them.
pub(crate) fn interval(value: f64, half_width: f64) -> String {
    let digits = (1.0 - half_width.log10().floor()).clamp(0.0, 9.0);
    if half_width.is_finite() && half_width > 1e-6 * value.abs() {
        let decimals = digits as usize;
        format!("{value:.decimals$} +- {half_width:.decimals$}")
    } else {
        significant(value)
    }
}

/// A relative deviation with the half width of its interval in two digits, `+0.12 +- 0.31 %`.
pub(super) fn interval_in_percent(deviation: f64, half_width: f64) -> String {
    let percents = [100.0 * deviation, 100.0 * half_width];
    if percents.iter().all(|p| p.abs() < 5e-8) {
        return "0 %".to_owned();
    }
    let scale = if percents[1] > 1e-6 { percents[1] } else { percents[0].abs() };
    let decimals = (1.0 - scale.log10().floor()).clamp(0.0, 7.0) as usize;
    format!("{:+.decimals$} +- {:.decimals$} %", percents[0], percents[1])
}

/// Six significant digits.
pub(crate) fn significant(value: f64) -> String {
    if value == 0.0 {
        return "0".to_owned();
    }
    let decimals = (5.0 - value.abs().log10().floor()).clamp(0.0, 9.0) as usize;
    format!("{value:.decimals$}")
}

/// Rounded to so many significant digits; `None` for what is no finite number.
pub(crate) fn rounded(value: f64, digits: usize) -> Option<f64> {
    format!("{value:.*e}", digits - 1).parse().ok().filter(|v: &f64| v.is_finite())
}

/// The next of 1, 2, 2.5, 5, 10 times a power of ten.
pub(crate) fn round_step(raw: f64) -> f64 {
    let decade = 10f64.powf(raw.log10().floor());
    [1.0, 2.0, 2.5, 5.0, 10.0].map(|d| d * decade).into_iter().find(|s| *s >= raw * 0.999).unwrap_or(10.0 * decade)
}

/// So many decimals at most, none that is needless.
pub(crate) fn trimmed(value: f64, decimals: usize) -> String {
    let text = format!("{value:.decimals$}");
    let text = if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.') } else { &text };
    if text == "-0" { "0".to_owned() } else { text.to_owned() }
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

pub(super) fn plural(count: usize, noun: &str) -> String {
    if count == 1 { format!("1 {noun}") } else { format!("{count} {noun}s") }
}

/// A verdict where only text tells it: what asks for attention is written large.
pub(super) fn mark(verdict: Verdict) -> String {
    if verdict.is_bad() { verdict.name().to_uppercase() } else { verdict.name().to_owned() }
}

/// How far off its reference a reading is: in per cent, a rating in its own unit.
pub(super) fn off(c: &Comparison, percent: fn(f64) -> String) -> Option<String> {
    let of_rating = || c.deviation.filter(|_| !c.quantity.has_zero()).map(|d| format!("{d:+.3} {}", c.quantity.unit()));
    c.relative_deviation.map(percent).or_else(of_rating)
}

/// The deviation of the largest magnitude.
pub(super) fn largest(deviations: impl Iterator<Item = f64>) -> Option<f64> {
    deviations.max_by(|a, b| a.abs().total_cmp(&b.abs()))
}

/// The column's name within a published source, "TITLE, TABLE, COLUMN: MEANING"; titles may hold colons.
pub(super) fn published_column(source: &str) -> &str {
    let (head, _) = source.rsplit_once(": ").unwrap_or((source, ""));
    head.rsplit(", ").next().unwrap_or(head)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::record::{MeterId, Quantity, Uncertainty};

    #[test]
    fn values_show_the_digits_they_deserve() {
        let written = |number, uncertainty| {
            value(&Reading { meter: MeterId::new("m", 0), quantity: Quantity::Illuminance, value: number, uncertainty })
        };
        assert_eq!(written(0.943_147, Uncertainty::sampled(0.001_2, None)), "0.9431(12)");
        assert_eq!(written(1234.5678, Uncertainty::sampled(0.0, None)), "1234.57");
        assert_eq!(written(0.0, Uncertainty::Exact), "0");
    }

    #[test]
    fn the_published_column_is_found_behind_a_title_with_a_colon() {
        let source = "Simulation of Luminaires in Radiance: Verification Method, Table 2, lum1: Flat polygon, of light";
        assert_eq!(published_column(source), "lum1");
    }
}
