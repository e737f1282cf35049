//! Numbers as all views write them.

/// A number with six significant digits.
pub fn significant(value: f64) -> String {
    if value == 0.0 {
        return "0".to_owned();
    }
    let decimals = (5.0 - value.abs().log10().floor()).clamp(0.0, 9.0) as usize;
    format!("{value:.decimals$}")
}

/// A number rounded to so many significant digits; `None` where it is not finite.
pub fn rounded(value: f64, digits: usize) -> Option<f64> {
    format!("{value:.*e}", digits - 1).parse().ok().filter(|v: &f64| v.is_finite())
}

/// The next of 1, 2, 2.5, 5, 10 times a power of ten.
pub fn round_step(raw: f64) -> f64 {
    let decade = 10f64.powf(raw.log10().floor());
    [1.0, 2.0, 2.5, 5.0].map(|d| d * decade).into_iter().find(|s| *s >= raw * 0.999).unwrap_or(10.0 * decade)
}

/// A number with at most so many decimals, without trailing zeros.
pub fn trimmed(value: f64, decimals: usize) -> String {
    let text = format!("{value:.decimals$}");
    let text = if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.') } else { &text };
    if text == "-0" { "0".to_owned() } else { text.to_owned() }
}

/// A count with its noun.
pub fn plural(count: usize, noun: &str) -> String {
    if count == 1 { format!("1 {noun}") } else { format!("{count} {noun}s") }
}

#[cfg(test)]
mod tests {
    use super::*;
    #[test]
    fn six_digits_are_significant() {
        let all = [
            (0.0, "0"),
            (1.0, "1.00000"),
            (9.999_994, "9.99999"),
            (-12.345_678_9, "-12.3457"),
            (123_456.7, "123457"),
            (98_765_432.1, "98765432"),
            (0.001_234_567, "0.00123457"),
            // At most nine decimals.
            (1.234_567e-6, "0.000001235"),
        ];
        for (value, text) in all {
            assert_eq!(significant(value), text);
        }
    }

    #[test]
    fn rounding_keeps_digits_and_refuses_what_is_no_number() {
        for (value, digits, expected) in [(1234.5, 2, 1200.0), (1250.1, 2, 1300.0), (-0.0457, 1, -0.05), (0.0, 3, 0.0)]
        {
            assert_eq!(rounded(value, digits), Some(expected), "{value} {digits}");
        }
        assert_eq!([f64::NAN, f64::INFINITY].map(|value| rounded(value, 3)), [None, None]);
    }

    #[test]
    fn a_step_is_the_next_round_number() {
        let all = [
            (1.0, 1.0),
            // A thousandth above a round number is rounding.
            (1.0009, 1.0),
            (1.1, 2.0),
            (2.1, 2.5),
            (2.6, 5.0),
            (5.1, 10.0),
            (9.999, 10.0),
            (0.03, 0.05),
            (700.0, 1000.0),
        ];
        for (raw, step) in all {
            assert!((round_step(raw) / step - 1.0).abs() < 1e-12, "{raw}: {}", round_step(raw));
        }
    }

    #[test]
    fn trailing_zeros_are_trimmed_and_zero_has_no_sign() {
        let all = [(1.5, 3, "1.5"), (2.0, 3, "2"), (100.0, 0, "100"), (-0.0004, 3, "0"), (-0.25, 2, "-0.25")];
        for (value, decimals, text) in all {
            assert_eq!(trimmed(value, decimals), text);
        }
    }

    #[test]
    fn one_is_singular() {
        assert_eq!([0, 1, 2].map(|count| plural(count, "meter")), ["0 meters", "1 meter", "2 meters"]);
    }
}
