//! The numbers of an LM-63 file: a stream of tokens separated by blanks, line ends and commas.

use std::fmt;

use crate::error::{Problem, ReadError};
use crate::lint::Lints;
use crate::text::{Text, quote};

/// Reads numbers one by one, each with its place.
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

/// The substitute for an invalid number that affects no intensity.
#[derive(Clone, Copy)]
pub(super) struct Repair {
    /// The code of the lint.
    pub(super) code: &'static str,
    pub(super) substitute: f64,
    /// Whether an invalid number may be replaced.
    pub(super) is_harmless: fn(f64) -> bool,
}

impl Numbers<'_, '_> {
    /// The next token, if any, and its offset.
    fn token(&mut self) -> Option<(usize, &[u8])> {
        let bytes = self.text.bytes;
        let start = self.at + bytes[self.at..].iter().position(|b| !is_separator(*b))?;
        if bytes[self.at..start].contains(&b',') && !self.lints.count_repetition("lm63/commas") {
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
        if dotted && !self.lints.count_repetition("lm63/bare-point") {
            let line = text.line_of(at);
            self.lints.note(
                "lm63/bare-point",
                line,
                "numbers begin or end with their decimal point, as in `.5` or `5.`",
            );
        }
        Ok(Number { value, at })
    }

    /// The next number, refused unless `is_valid`.
    pub(super) fn checked(
        &mut self,
        what: fmt::Arguments,
        expected: &'static str,
        is_valid: impl FnOnce(f64) -> bool,
    ) -> Result<Number, ReadError> {
        let number = self.number(what)?;
        if is_valid(number.value) {
            return Ok(number);
        }
        let problem = Problem::OutOfRange { what: what.to_string(), found: number.value, expected };
        Err(self.text.error(number.at, problem))
    }

    /// The next number, refused unless `is_valid` or repaired by a tolerant reader.
    pub(super) fn checked_or(
        &mut self,
        what: fmt::Arguments,
        expected: &'static str,
        is_valid: impl FnOnce(f64) -> bool,
        repair: Repair,
    ) -> Result<Number, ReadError> {
        let Number { value, at } = self.number(what)?;
        if is_valid(value) {
            return Ok(Number { value, at });
        }
        let substitute = repair.substitute;
        let message = format!("{what} is {value}, and must be {expected}; it was read as {substitute}");
        if (repair.is_harmless)(value) && self.lints.accept_damage(repair.code, self.text.line_of(at), message) {
            return Ok(Number { value: substitute, at });
        }
        Err(self.text.error(at, Problem::OutOfRange { what: what.to_string(), found: value, expected }))
    }

    /// A count of numbers that follow. A count is refused where the rest of the file is too short.
    pub(super) fn count(&mut self, what: fmt::Arguments, least: f64) -> Result<Number, ReadError> {
        let number = self.checked(what, "a whole number, one at least", |n| n.fract() == 0.0 && n >= 1.0)?;
        if number.value < least {
            let problem = Problem::OutOfRange { what: what.to_string(), found: number.value, expected: "at least 2" };
            return Err(self.text.error(number.at, problem));
        }
        self.check_room(what, number)?;
        Ok(number)
    }

    /// Refuses a count of numbers for which the rest of the file is too short: two bytes each and one for the last.
    pub(super) fn check_room(&self, what: fmt::Arguments, claimed: Number) -> Result<(), ReadError> {
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

    /// The number of tokens up to the end.
    pub(super) fn remaining(&self) -> usize {
        self.text.bytes[self.at..].split(|b| is_separator(*b)).filter(|token| !token.is_empty()).count()
    }

    /// The offset of the next token after an offset.
    pub(super) fn next_at(&self, at: usize) -> usize {
        let rest = &self.text.bytes[at..];
        at + rest.iter().position(|b| !is_separator(*b)).unwrap_or(rest.len())
    }

    /// Whether only separators precede an offset in its line.
    pub(super) fn begins_line(&self, at: usize) -> bool {
        let before = self.text.bytes[..at].iter().rev().take_while(|b| !matches!(b, b'\n' | b'\r'));
        before.copied().all(is_separator)
    }

    /// Refuses further numbers and notes further text.
    ///
    /// A tolerant reader accepts fewer than `harmless_below` numbers: a wrong count of angles leaves more.
    pub(super) fn finish(mut self, counted: &str, expected: usize, harmless_below: usize) -> Result<(), ReadError> {
        let text = self.text;
        let Some((at, token)) = self.token() else { return Ok(()) };
        if is_number(token) {
            let mut surplus = 1;
            while surplus < harmless_below
                && let Some((_, token)) = self.token()
                && is_number(token)
            {
                surplus += 1;
            }
            let message = format!("surplus numbers behind the last of the {counted} were ignored: {surplus}");
            if surplus < harmless_below && self.lints.accept_damage("forgiven/surplus", text.line_of(at), message) {
                return Ok(());
            }
            return Err(text.error(at, Problem::TooMany { what: counted.into(), expected }));
        }
        let message = format!("text behind the last number was ignored: `{}`", quote(token));
        self.lints.note("lm63/trailing-text", text.line_of(at), message);
        Ok(())
    }
}

/// Whether a token is a number.
fn is_number(token: &[u8]) -> bool {
    std::str::from_utf8(token).is_ok_and(|t| t.parse::<f64>().is_ok())
}

/// Blanks, line ends and commas, and NUL and Ctrl-Z, with which old editors fill the last block.
fn is_separator(byte: u8) -> bool {
    byte.is_ascii_whitespace() || matches!(byte, b',' | 0 | 0x1a | 0x0b)
}
