//! The numbers of an LM-63 file: a stream of tokens divided by blanks, line ends and commas.

use std::fmt;

use crate::photometry::error::{Problem, ReadError};
use crate::photometry::lint::Lints;
use crate::photometry::text::{Text, quote};

/// Reads numbers one after the other, each with its place.
pub(super) struct Numbers<'a, 'l> {
    pub(super) text: &'a Text<'a>,
    pub(super) at: usize,
    pub(super) lints: &'l mut Lints,
}

/// A number and the offset of its first byte.
#[derive(Clone, Copy)]
pub(super) struct Number {
    pub(super) value: f64,
    pub(super) at: usize,
}

impl Numbers<'_, '_> {
    /// The next token, if any, and its offset.
    fn token(&mut self) -> Option<(usize, &[u8])> {
        let bytes = self.text.bytes;
        let start = self.at + bytes[self.at..].iter().position(|b| !is_separator(*b))?;
        if bytes[self.at..start].contains(&b',') && !self.lints.again("lm63/commas") {
            let line = self.text.line_of(start);
            self.lints.note("lm63/commas", line, "commas divide the numbers");
        }
        let length = bytes[start..].iter().position(|b| is_separator(*b)).unwrap_or(bytes.len() - start);
        self.at = start + length;
        Some((start, &bytes[start..self.at]))
    }

    /// The next number, which must be finite.
    pub(super) fn number(&mut self, what: fmt::Arguments) -> Result<Number, ReadError> {
        let text = self.text;
        let Some((at, token)) = self.token() else {
            return Err(text.error(text.bytes.len(), Problem::UnexpectedEnd { expected: what.to_string() }));
        };
        let dotted = token.first() == Some(&b'.') || token.last() == Some(&b'.');
        let parsed = std::str::from_utf8(token).ok().and_then(|t| t.parse::<f64>().ok());
        let Some(value) = parsed else {
            let problem = Problem::NotANumber { what: what.to_string(), found: quote(token) };
            return Err(text.error(at, problem));
        };
        if !value.is_finite() {
            return Err(text.error(at, Problem::NotFinite { what: what.to_string(), found: quote(token) }));
        }
        if dotted && !self.lints.again("lm63/bare-point") {
            let line = text.line_of(at);
            self.lints.note(
                "lm63/bare-point",
                line,
                "numbers begin or end with their decimal point, as in `.5` or `5.`",
            );
        }
        Ok(Number { value, at })
    }

    /// The next number, refused unless `legal`.
    pub(super) fn checked(
        &mut self,
        what: fmt::Arguments,
        expected: &'static str,
        legal: impl FnOnce(f64) -> bool,
    ) -> Result<Number, ReadError> {
        let number = self.number(what)?;
        if legal(number.value) {
            return Ok(number);
        }
        let problem = Problem::OutOfRange { what: what.to_string(), found: number.value, expected };
        Err(self.text.error(number.at, problem))
    }

    /// The next number or, in its place, another one where that harms nothing: the lint's code, the other number, and of which
    /// numbers it may take the place.
    pub(super) fn checked_or(
        &mut self,
        what: fmt::Arguments,
        expected: &'static str,
        legal: impl FnOnce(f64) -> bool,
        (code, instead, harmless): (&'static str, f64, impl FnOnce(f64) -> bool),
    ) -> Result<Number, ReadError> {
        let Number { value, at } = self.number(what)?;
        if legal(value) {
            return Ok(Number { value, at });
        }
        let message = format!("{what} is {value}, and must be {expected}; it was read as {instead}");
        if harmless(value) && self.lints.forgives(code, self.text.line_of(at), message) {
            return Ok(Number { value: instead, at });
        }
        Err(self.text.error(at, Problem::OutOfRange { what: what.to_string(), found: value, expected }))
    }

    /// A count of numbers that follow; refused where the rest of the file has no room for them.
    pub(super) fn count(&mut self, what: fmt::Arguments, least: f64) -> Result<Number, ReadError> {
        let number = self.checked(what, "a whole number, one at least", |n| n.fract() == 0.0 && n >= 1.0)?;
        if number.value < least {
            let problem = Problem::OutOfRange { what: what.to_string(), found: number.value, expected: "at least 2" };
            return Err(self.text.error(number.at, problem));
        }
        self.fits(what, number)?;
        Ok(number)
    }

    /// Refuses a count of numbers for which the rest of the file has no room: two bytes each, the last one.
    pub(super) fn fits(&self, what: fmt::Arguments, claimed: Number) -> Result<(), ReadError> {
        let room = self.text.bytes.len() - self.at;
        if 2.0 * claimed.value - 1.0 <= room as f64 {
            return Ok(());
        }
        let problem = Problem::Implausible { what: what.to_string(), claimed: claimed.value, room };
        Err(self.text.error(claimed.at, problem))
    }

    /// `count` angles that rise strictly, and the offset of the first.
    pub(super) fn angles(&mut self, axis: &'static str, count: Number) -> Result<(Vec<f64>, usize), ReadError> {
        let count = count.value as usize;
        let mut angles: Vec<f64> = Vec::with_capacity(count);
        let mut first_at = self.at;
        for k in 1..=count {
            let number = self.number(format_args!("{axis} angle {k} of {count}"))?;
            if k == 1 {
                first_at = number.at;
            }
            if let Some(&before) = angles.last()
                && number.value <= before
            {
                let problem = Problem::NotRising { axis, before, after: number.value };
                return Err(self.text.error(number.at, problem));
            }
            angles.push(number.value);
        }
        Ok((angles, first_at))
    }

    /// Where the token begins that follows an offset.
    pub(super) fn next_at(&self, at: usize) -> usize {
        let rest = &self.text.bytes[at..];
        at + rest.iter().position(|b| !is_separator(*b)).unwrap_or(rest.len())
    }

    /// Whether nothing but blanks stands before an offset in its line.
    pub(super) fn begins_line(&self, at: usize) -> bool {
        let before = self.text.bytes[..at].iter().rev().take_while(|b| !matches!(b, b'\n' | b'\r'));
        before.copied().all(is_separator)
    }

    /// Refuses further numbers, remarks on further text. Fewer than `tellable` numbers may be forgiven: counts that are wrong leave more.
    pub(super) fn finish(mut self, counted: &str, expected: usize, tellable: usize) -> Result<(), ReadError> {
        let text = self.text;
        let Some((at, token)) = self.token() else { return Ok(()) };
        let is_number = |token: &[u8]| std::str::from_utf8(token).is_ok_and(|t| t.parse::<f64>().is_ok());
        if is_number(token) {
            let mut surplus = 1;
            while surplus < tellable
                && let Some((_, token)) = self.token()
                && is_number(token)
            {
                surplus += 1;
            }
            let message = format!("surplus numbers behind the last of the {counted} were ignored: {surplus}");
            if surplus < tellable && self.lints.forgives("forgiven/surplus", text.line_of(at), message) {
                return Ok(());
            }
            return Err(text.error(at, Problem::TooMany { what: counted.into(), expected }));
        }
        let message = format!("text behind the last number was ignored: `{}`", quote(token));
        self.lints.note("lm63/trailing-text", text.line_of(at), message);
        Ok(())
    }
}

/// Blanks, line ends and commas; NUL and Ctrl-Z are what old editors filled the last block with.
fn is_separator(byte: u8) -> bool {
    byte.is_ascii_whitespace() || matches!(byte, b',' | 0 | 0x1a | 0x0b)
}
