//! The result of writing a photometric file, and the steps that the writers of all formats share.

use std::fmt::Write as _;

use super::losses::find_losses;
use super::{FileFormat, LuminousIntensityDistribution, Photometry, ReadError, TypeCLimits};

/// A photometric file as text, with a list of losses.
#[derive(Clone, Debug, PartialEq)]
pub struct Written {
    /// The file, lines ended by CR LF.
    pub text: String,
    /// The differences between the photometry and what a reader of the text gets, one sentence each.
    pub losses: Vec<String>,
    /// Fields of the format that were computed or are unknown, one sentence each.
    pub notes: Vec<String>,
}

impl Written {
    /// Reads the text back and states every difference with its cause.
    pub(super) fn checked(
        original: &Photometry,
        text: String,
        format: FileFormat,
        read: impl FnOnce(&[u8]) -> Result<Photometry, ReadError>,
    ) -> Self {
        let losses = match read(text.as_bytes()) {
            Ok(again) => find_losses(original, &again, format),
            Err(error) => vec![format!("the written file cannot be read: {error}")],
        };
        Self { text, losses, notes: vec![] }
    }
}

/// A converted file has at most this many times the length of its source.
const MAX_FILE_GROWTH: f64 = 20.0;
/// Significant digits of the largest intensity in a computed table.
const SIGNIFICANT_DIGITS: i32 = 6;
/// The typical number of characters of a value in a file.
const CHARACTERS_PER_VALUE: f64 = 7.0;
/// The number of values of the smallest table that the writer tries.
const MIN_VALUES: usize = 30;

/// Formats a file that can only hold a type C table, in units of `unit_cd` candela.
///
/// For types A and B the file holds an approximation, as fine as the length of the file allows.
pub(super) fn write_in_type_c(
    photometry: &Photometry,
    unit_cd: f64,
    format_file: impl Fn(&LuminousIntensityDistribution) -> String,
) -> String {
    let table = &photometry.distribution;
    if !table.is_native() {
        return format_file(table);
    }
    let source_length = match photometry.source.first() {
        Some(file) => file.bytes.len(),
        None => CHARACTERS_PER_VALUE as usize * table.c_deg().len() * table.gamma_deg().len(),
    };
    let max_length = MAX_FILE_GROWTH * source_length as f64;
    let magnitude = (table.max_intensity().value() / unit_cd).log10().floor().clamp(-300.0, 300.0) as i32;
    let decimals = SIGNIFICANT_DIGITS - 1 - magnitude;
    let mut most_values = (max_length / CHARACTERS_PER_VALUE) as usize;
    loop {
        let limits = TypeCLimits { most_planes: 361, most_values, ..TypeCLimits::default() };
        let written = format_file(&table.in_type_c_within(limits).distribution.rounded(unit_cd, decimals));
        if written.len() as f64 <= max_length || most_values <= MIN_VALUES {
            return written;
        }
        // Aim 5 % below the limit: the length is not quite proportional to the number of values.
        most_values = (0.95 * most_values as f64 * max_length / written.len() as f64) as usize;
    }
}

/// A number in the shortest decimal form that parses to the same value.
pub(super) fn number(value: f64) -> String {
    // Minus zero would print a sign that means nothing.
    if value == 0.0 { "0".into() } else { value.to_string() }
}

/// The shortest decimal number `x` near `estimate` that `forward` takes exactly to `target`, else `estimate`.
pub(super) fn invert(target: f64, estimate: f64, forward: impl Fn(f64) -> f64) -> f64 {
    let rounded = (0..17).filter_map(|digits| {
        let mut text = String::new();
        write!(text, "{estimate:.digits$e}").ok()?;
        text.parse::<f64>().ok()
    });
    let neighbours =
        [estimate.next_up(), estimate.next_down(), estimate.next_up().next_up(), estimate.next_down().next_down()];
    rounded.chain(neighbours).find(|x| forward(*x) == target).unwrap_or(estimate)
}

/// Formats numbers in lines of at most 128 characters, which every edition and reader allows.
pub(super) fn lines(values: impl IntoIterator<Item = f64>) -> String {
    let mut text = String::new();
    let mut width = 0;
    for value in values {
        let number = number(value);
        if width > 0 && width + 1 + number.len() > 128 {
            text.push_str("\r\n");
            width = 0;
        }
        if width > 0 {
            text.push(' ');
            width += 1;
        }
        width += number.len();
        text.push_str(&number);
    }
    text.push_str("\r\n");
    text
}

/// Joins the lines of a text to one line.
pub(super) fn one_line(text: &str) -> String {
    text.split(['\r', '\n']).map(str::trim).collect::<Vec<_>>().join(" ").trim().to_string()
}
