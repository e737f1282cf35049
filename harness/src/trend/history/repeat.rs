//! A line that says what a line of the night before said, with other numbers: it is read without parsing the rest anew.
//!
//! What is written otherwise than `history add` writes it is no repetition; a JSON parser reads that.

use std::borrow::Cow;

use crate::judge::Verdict;

/// What a line of one key says before its numbers, and what of that may differ from night to night.
pub(super) struct Head<'a> {
    /// From behind the night up to the numbers.
    text: &'a [u8],
    pub(super) engine: Cow<'a, str>,
    pub(super) version: Cow<'a, str>,
}

/// The numbers that trends need.
pub(super) struct Numbers {
    pub(super) deviation: f64,
    pub(super) std_error: f64,
    pub(super) reference: f64,
    pub(super) verdict: Verdict,
}

const NIGHT: &[u8] = b"{\"night\":\"";
const VALUE: &[u8] = b",\"value\":";

impl<'a> Head<'a> {
    /// The head of a line that was parsed. No text within the line can hold what ends it: its quotes would be escaped.
    pub(super) fn of(line: &'a [u8], night: &str, engine: Cow<'a, str>, version: Cow<'a, str>) -> Option<Self> {
        let rest = line.strip_prefix(NIGHT)?.strip_prefix(night.as_bytes())?;
        let end = rest.windows(VALUE.len()).position(|w| w == VALUE)?;
        Some(Self { text: &rest[..end], engine, version })
    }

    /// The numbers of a line of this head on a night.
    pub(super) fn numbers(&self, line: &[u8], night: &str) -> Option<Numbers> {
        let rest = line.strip_prefix(NIGHT)?.strip_prefix(night.as_bytes())?.strip_prefix(self.text)?;
        let mut fields = rest.strip_prefix(b",")?.strip_suffix(b"}")?.split(|b| *b == b',');
        let mut next = |name: &[u8]| fields.next()?.strip_prefix(name);
        number(next(b"\"value\":")?, f64::NAN)?;
        let std_error = number(next(b"\"std_error\":")?, 0.0)?;
        let reference = number(next(b"\"reference\":")?, f64::NAN)?;
        let deviation = number(next(b"\"deviation\":")?, f64::NAN)?;
        number(next(b"\"u\":")?, f64::NAN)?;
        let verdict = serde_json::from_slice(next(b"\"verdict\":")?).ok()?;
        fields.next().is_none().then_some(Numbers { deviation, std_error, reference, verdict })
    }
}

/// A number of JSON, or what null stands for.
fn number(text: &[u8], null: f64) -> Option<f64> {
    if text == b"null" {
        return Some(null);
    }
    // Rust reads more than JSON allows: what could differ is left to the parser.
    let is_plain = text.iter().all(|b| matches!(b, b'0'..=b'9' | b'.' | b'-' | b'e'))
        && text.first().is_some_and(|b| *b != b'.')
        && text.last().is_some_and(u8::is_ascii_digit);
    is_plain.then(|| std::str::from_utf8(text).ok()?.parse().ok()).flatten()
}

#[cfg(test)]
mod tests {
    use super::*;

    const FIRST: &str = r#"{"night":"2026-01-01","case":"a,\"value\":","engine":"e","version":"1","source":"s","value":1.0,"std_error":null,"reference":2,"deviation":-1e-3,"u":0.5,"verdict":"known_deviation"}"#;

    fn numbers(line: &str, night: &str) -> Option<Numbers> {
        let head = Head::of(FIRST.as_bytes(), "2026-01-01", "e".into(), "1".into()).unwrap();
        head.numbers(line.as_bytes(), night)
    }

    #[test]
    fn a_repetition_gives_its_own_numbers() {
        let again = FIRST.replace("01-01", "01-02").replace("-1e-3", "0.25").replace("null", "0.1");
        let read = numbers(&again, "2026-01-02").unwrap();
        assert_eq!((read.deviation, read.std_error, read.reference), (0.25, 0.1, 2.0));
        assert_eq!(read.verdict, Verdict::KnownDeviation);
        assert_eq!(numbers(FIRST, "2026-01-01").unwrap().deviation, -1e-3);
    }

    #[test]
    fn what_differs_in_anything_but_its_numbers_is_no_repetition() {
        for (from, to) in [
            ("\"version\":\"1\"", "\"version\":\"2\""),
            ("2026-01-01", "2026-01-02"),
            ("\"source\":\"s\"", "\"source\":\"t\""),
            ("1.0,", "inf,"),
            ("1.0,", "1.,"),
            ("1.0,", "\"x\","),
            ("\"u\":0.5", "\"u\": 0.5"),
            ("known_deviation", "unknown"),
            ("\"}", "\",\"more\":1}"),
            ("\"}", "\""),
        ] {
            assert!(numbers(&FIRST.replace(from, to), "2026-01-01").is_none(), "{to}");
        }
    }
}
