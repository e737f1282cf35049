//! The lines of a EULUMDAT file, one value each, with the deviations that the reader tolerates.

use crate::error::{Problem, ReadError, in_candela};
use crate::lint::Lints;
use crate::text::{Line, Text, decode, quote};

/// Reads the values line by line.
pub(super) struct Fields<'a, 'l> {
    text: &'a Text<'a>,
    lines: Box<dyn Iterator<Item = Line<'a>> + 'a>,
    /// The line read last.
    last: Line<'a>,
    lints: &'l mut Lints,
}

/// Whether the bytes look like EULUMDAT: lines 2, 3, 4 and 6 are small whole numbers.
pub(crate) fn looks_like(text: &Text) -> bool {
    let lines: Vec<Line> = text.lines().take(6).collect();
    [(1, 3.0), (2, 4.0), (3, 1e6), (5, 1e6)].iter().all(|(k, most)| {
        let number = lines.get(*k).and_then(|line| decode(unquote(line.bytes)).parse::<f64>().ok());
        number.is_some_and(|n| n.fract() == 0.0 && (0.0..=*most).contains(&n))
    })
}

impl<'a, 'l> Fields<'a, 'l> {
    pub(super) fn new(text: &'a Text<'a>, lints: &'l mut Lints) -> Self {
        let last = Line { at: 0, number: 1, bytes: b"" };
        Self { text, lines: Box::new(text.lines()), last, lints }
    }

    /// The lints of the file.
    pub(super) fn lints(&mut self) -> &mut Lints {
        self.lints
    }

    /// The number of the line read last.
    pub(super) fn line(&self) -> usize {
        self.last.number
    }

    /// Adds a warning about the line read last.
    pub(super) fn warn(&mut self, code: &'static str, message: String) {
        let line = self.last.number;
        self.lints.warn(code, line, message);
    }

    /// A problem with the line read last.
    pub(super) fn error_here(&self, problem: Problem) -> ReadError {
        self.text.error(self.last.at, problem)
    }

    /// A problem with another line.
    pub(super) fn error_at_line(&self, line: usize, problem: Problem) -> ReadError {
        ReadError { line, column: 1, ..self.error_here(problem) }
    }

    /// The next line without quotation marks.
    fn next(&mut self, what: &str) -> Result<&'a [u8], ReadError> {
        let Some(line) = self.lines.next() else {
            return Err(self.text.error(self.text.bytes.len(), Problem::UnexpectedEnd { expected: what.into() }));
        };
        self.last = line;
        let value = unquote(line.bytes);
        if value.len() != line.bytes.trim_ascii().len() {
            self.lints.note("ldt/quoted", line.number, "a field stands in quotation marks");
        }
        Ok(value)
    }

    /// The next line as text.
    pub(super) fn text(&mut self, what: &str) -> Result<String, ReadError> {
        let value = decode(self.next(what)?).into_owned();
        if !value.is_ascii() {
            let utf8 = std::str::from_utf8(self.last.bytes).is_ok();
            let encoding = if utf8 { "UTF-8" } else { "Latin-1" };
            let message = format!("a text holds characters beyond ASCII; it was read as {encoding}");
            self.lints.note("ldt/not-ascii", self.last.number, message);
        }
        Ok(value)
    }

    /// The next line's number, `None` where it is blank.
    fn optional(&mut self, what: &str) -> Result<Option<f64>, ReadError> {
        let value = self.next(what)?;
        if value.is_empty() {
            self.lints.note("ldt/blank", self.last.number, "a number is left blank");
            return Ok(None);
        }
        if let Some(number) = std::str::from_utf8(value).ok().and_then(|v| v.parse::<f64>().ok()) {
            if number.is_finite() {
                return Ok(Some(number));
            }
            return Err(self.error_here(Problem::NotFinite { what: what.into(), found: quote(value) }));
        }
        // Only the first comma is replaced: a second one makes the line invalid.
        let dotted = decode(value).replacen(',', ".", 1);
        match dotted.parse::<f64>() {
            Ok(number) if number.is_finite() => {
                self.lints.note("ldt/decimal-comma", self.last.number, "numbers have a decimal comma");
                Ok(Some(number))
            }
            _ => Err(self.error_here(Problem::NotANumber { what: what.into(), found: quote(value) })),
        }
    }

    /// The next line's number, which must not be blank.
    fn number(&mut self, what: &str) -> Result<f64, ReadError> {
        let number = self.optional(what)?;
        number.ok_or_else(|| self.error_here(Problem::NotANumber { what: what.into(), found: String::new() }))
    }

    /// The next line's number, or `blank` for a blank line.
    pub(super) fn number_or(&mut self, what: &str, blank: f64) -> Result<f64, ReadError> {
        Ok(self.optional(what)?.unwrap_or(blank))
    }

    /// A number of the line read last outside its range.
    fn out_of_range(&self, what: &str, found: f64, expected: &'static str) -> ReadError {
        self.error_here(Problem::OutOfRange { what: what.into(), found, expected })
    }

    /// Numbers that are zero or more; blank counts as zero.
    pub(super) fn not_negative<const N: usize>(&mut self, what: [&str; N]) -> Result<[f64; N], ReadError> {
        let mut numbers = [0.0; N];
        for (number, what) in numbers.iter_mut().zip(what) {
            *number = self.number_or(what, 0.0)?;
            if *number < 0.0 {
                return Err(self.out_of_range(what, *number, "zero or more"));
            }
        }
        Ok(numbers)
    }

    /// Numbers that affect neither light nor opening. Blank counts as zero; a tolerant reader takes negative as zero too.
    pub(super) fn zero_if_negative<const N: usize>(&mut self, what: [&str; N]) -> Result<[f64; N], ReadError> {
        let mut numbers = [0.0; N];
        for (number, what) in numbers.iter_mut().zip(what) {
            *number = self.number_or(what, 0.0)?;
            if *number < 0.0 {
                let message = format!("{what} is {number}; it was read as 0");
                if !self.lints.accept_damage("forgiven/negative-field", self.last.number, message) {
                    return Err(self.out_of_range(what, *number, "zero or more"));
                }
                *number = 0.0;
            }
        }
        Ok(numbers)
    }

    /// A number above zero.
    pub(super) fn positive(&mut self, what: &str) -> Result<f64, ReadError> {
        let number = self.number(what)?;
        if number > 0.0 { Ok(number) } else { Err(self.out_of_range(what, number, "positive")) }
    }

    /// A whole number within limits.
    pub(super) fn whole(&mut self, what: &str, least: i32, most: i32) -> Result<i32, ReadError> {
        let number = self.number(what)?;
        if number.fract() == 0.0 && (f64::from(least)..=f64::from(most)).contains(&number) {
            return Ok(number as i32);
        }
        Err(self.out_of_range(what, number, "one of the whole numbers that the format defines"))
    }

    /// Number of lamps, negative for absolute photometry; a blank or zero counts as one.
    pub(super) fn lamps(&mut self) -> Result<i32, ReadError> {
        let what = "the number of lamps";
        let lamps = self.number_or(what, 1.0)?;
        if lamps.fract() != 0.0 || lamps.abs() > f64::from(i32::MAX) {
            return Err(self.out_of_range(what, lamps, "a whole number, negative for absolute photometry"));
        }
        if lamps == 0.0 {
            self.warn("ldt/lamps", "the number of lamps is 0 and was read as 1".into());
            return Ok(1);
        }
        Ok(lamps as i32)
    }

    /// The conversion factor for intensities; blank or zero counts as one.
    pub(super) fn conversion_factor(&mut self) -> Result<f64, ReadError> {
        let [factor] = self.not_negative(["the conversion factor for luminous intensities"])?;
        if factor == 0.0 {
            self.warn("ldt/conversion-factor", "the conversion factor is 0 or blank and was read as 1".into());
            return Ok(1.0);
        }
        if factor != 1.0 {
            self.warn(
                "ldt/conversion-factor",
                format!("every intensity was multiplied by the conversion factor {factor}"),
            );
        }
        Ok(factor)
    }

    /// A count of lines that follow. A count is refused where the rest of the file is too short.
    pub(super) fn count(&mut self, what: &str, least: usize) -> Result<usize, ReadError> {
        let number = self.number(what)?;
        if number.fract() != 0.0 || number < least as f64 {
            return Err(self.out_of_range(what, number, "a whole number, one at least, two of gamma angles"));
        }
        if number > self.room() as f64 {
            let problem = Problem::Implausible { what: what.into(), claimed: number, room: self.room() };
            return Err(self.error_here(problem));
        }
        Ok(number as usize)
    }

    /// Refuses a number of lines for which the rest of the file is too short: two bytes each and one for the last.
    pub(super) fn room_for(&self, what: &str, lines: usize) -> Result<(), ReadError> {
        let room = self.room();
        if lines.saturating_mul(2) <= room.saturating_add(1) {
            return Ok(());
        }
        Err(self.error_here(Problem::Implausible { what: what.into(), claimed: lines as f64, room }))
    }

    /// Bytes behind the line read last.
    fn room(&self) -> usize {
        self.text.bytes.len().saturating_sub(self.last.at + self.last.bytes.len())
    }

    /// `count` angles that rise strictly.
    pub(super) fn angles(&mut self, axis: &'static str, count: usize) -> Result<Vec<f64>, ReadError> {
        self.room_for(axis, count)?;
        let mut angles: Vec<f64> = Vec::with_capacity(count);
        let what = format!("a {axis} angle");
        for _ in 0..count {
            let after = self.number(&what)?;
            if let Some(&before) = angles.last()
                && after <= before
            {
                return Err(self.error_here(Problem::NotRising { axis, before, after }));
            }
            angles.push(after);
        }
        Ok(angles)
    }

    /// The next intensity, in candela.
    pub(super) fn intensity(&mut self, c_deg: f64, gamma_deg: f64, scale: f64) -> Result<f64, ReadError> {
        let value = self.number("a luminous intensity").map_err(|error| {
            let what = format!("the intensity at C {c_deg} gamma {gamma_deg}");
            ReadError { problem: with_subject(error.problem, what), ..error }
        })?;
        if value < 0.0 {
            return Err(self.out_of_range("a luminous intensity", value, "zero or more"));
        }
        in_candela("a luminous intensity", value, scale).map_err(|problem| self.error_here(problem))
    }

    /// Refuses further numbers and notes further text.
    ///
    /// `only_plane` is the plane of Isym 1 in candela. A tolerant reader accepts repetitions of it, and fewer zeros than
    /// a plane has.
    pub(super) fn finish(
        &mut self,
        gamma_deg: &[f64],
        only_plane: Option<&[f64]>,
        scale: f64,
    ) -> Result<(), ReadError> {
        let Some(line) = self.lines.find(|line| !is_blank(line.bytes)) else { return Ok(()) };
        self.last = line;
        let value = decode(unquote(line.bytes));
        if value.parse::<f64>().is_ok() {
            let rest = std::iter::once(line).chain(self.lines.by_ref().filter(|line| !is_blank(line.bytes)));
            let numbers = rest.map_while(|line| decode(unquote(line.bytes)).parse::<f64>().ok());
            let surplus: Vec<f64> = numbers.collect();
            if let Some(message) = describe_harmless_surplus(&surplus, gamma_deg, only_plane, scale)
                && self.lints.accept_damage("forgiven/surplus", line.number, message)
            {
                return Ok(());
            }
            let problem = Problem::TooMany { what: "lines".into(), expected: line.number - 1 };
            return Err(self.error_here(problem));
        }
        let message = format!("text behind the last intensity was ignored: `{}`", quote(value.as_bytes()));
        self.lints.note("ldt/trailing-text", line.number, message);
        Ok(())
    }
}

/// The same problem with a more precise subject.
fn with_subject(problem: Problem, what: String) -> Problem {
    match problem {
        Problem::UnexpectedEnd { .. } => Problem::UnexpectedEnd { expected: what },
        Problem::NotANumber { found, .. } => Problem::NotANumber { what, found },
        Problem::NotFinite { found, .. } => Problem::NotFinite { what, found },
        other => other,
    }
}

/// Whether a line is empty or has only blanks, NUL and Ctrl-Z, with which old editors fill the end of a file.
fn is_blank(line: &[u8]) -> bool {
    line.iter().all(|b| b.is_ascii_whitespace() || matches!(b, 0 | 0x1a))
}

/// Describes surplus numbers that affect no intensity; `None` for others.
fn describe_harmless_surplus(
    surplus: &[f64],
    gamma_deg: &[f64],
    only_plane: Option<&[f64]>,
    scale: f64,
) -> Option<String> {
    let gammas = gamma_deg.len();
    if only_plane.is_some_and(|plane| repeats_plane(surplus, plane, scale)) {
        return Some("planes behind the only one of Isym 1 repeat it; they were ignored".to_owned());
    }
    // With a wrong count of angles all values shift, and the last gamma is an arbitrary number.
    let is_in_step = [90.0, 180.0].contains(&gamma_deg[gammas - 1]);
    if is_in_step && surplus.len() < gammas && surplus.iter().all(|value| *value == 0.0) {
        return Some(format!("surplus zeros behind the last intensity were ignored: {}", surplus.len()));
    }
    None
}

/// Whether numbers are whole repetitions of a plane in candela.
fn repeats_plane(numbers: &[f64], candela: &[f64], scale: f64) -> bool {
    let mut planes = numbers.chunks(candela.len());
    numbers.len().is_multiple_of(candela.len())
        && planes.all(|plane| plane.iter().zip(candela).all(|(value, candela)| value * scale == *candela))
}

/// The line without blanks at its ends and without the quotation marks around it.
fn unquote(line: &[u8]) -> &[u8] {
    let line = line.trim_ascii();
    match line {
        [b'"', inner @ .., b'"'] => inner.trim_ascii(),
        _ => line,
    }
}
