//! What writing a photometric file yields: its text, and in words whatever the format could not hold.

use std::fmt::Write as _;

use super::losses::losses;
use super::{FileFormat, LuminousIntensityDistribution, Photometry, ReadError, TypeCLimits};

/// A photometric file as text, and what is lost in it.
#[derive(Clone, Debug, PartialEq)]
pub struct Written {
    /// The file, lines ended by CR LF.
    pub text: String,
    /// What reading the text again does not give back, one sentence each; empty where it gives back everything.
    pub losses: Vec<String>,
    /// What the format asks for that was computed, or is not known, one sentence each.
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
            Ok(again) => losses(original, &again, format),
            Err(error) => vec![format!("the written file cannot be read: {error}")],
        };
        Self { text, losses, notes: vec![] }
    }
}

/// A file may be so many times as long as the one that it was made of.
const MOST_GROWTH: f64 = 20.0;
/// Digits of the largest intensity that a table made here has.
const DIGITS: i32 = 6;
/// Characters that a value takes in a file at least, and values of the smallest table that is tried.
const VALUE_CHARACTERS: f64 = 7.0;
const FEWEST_VALUES: usize = 30;

/// The text of a format that holds type C alone, in numbers of so many candela: of other types a table that stands for theirs, as fine as
/// the file may grow.
pub(super) fn in_type_c(
    photometry: &Photometry,
    unit_cd: f64,
    text: impl Fn(&LuminousIntensityDistribution) -> String,
) -> String {
    let table = &photometry.distribution;
    if !table.is_native() {
        return text(table);
    }
    // What no file says would be of so many characters.
    let made = || VALUE_CHARACTERS as usize * table.c_deg().len() * table.gamma_deg().len();
    let read = photometry.source.first().map_or_else(made, |s| s.bytes.len());
    let most = MOST_GROWTH * read as f64;
    let decimals = DIGITS - 1 - (table.max_intensity().value() / unit_cd).log10().floor().clamp(-300.0, 300.0) as i32;
    let mut most_values = (most / VALUE_CHARACTERS) as usize;
    loop {
        let limits = TypeCLimits { most_planes: 361, most_values, ..TypeCLimits::default() };
        let written = text(&table.in_type_c_within(limits).distribution.rounded(unit_cd, decimals));
        if written.len() as f64 <= most || most_values <= FEWEST_VALUES {
            return written;
        }
        most_values = (0.95 * most_values as f64 * most / written.len() as f64) as usize;
    }
}

/// A number in the shortest decimal form that reads back as itself.
pub(super) fn number(value: f64) -> String {
    // Minus zero would survive, and surprise.
    if value == 0.0 { "0".into() } else { value.to_string() }
}

/// A number `x`, as short in decimals as may be, that `forward` takes exactly to `target`; else the nearest.
pub(super) fn inverse(target: f64, estimate: f64, forward: impl Fn(f64) -> f64) -> f64 {
    let rounded = (0..17).filter_map(|digits| {
        let mut text = String::new();
        write!(text, "{estimate:.digits$e}").ok()?;
        text.parse::<f64>().ok()
    });
    let neighbours =
        [estimate.next_up(), estimate.next_down(), estimate.next_up().next_up(), estimate.next_down().next_down()];
    rounded.chain(neighbours).find(|x| forward(*x) == target).unwrap_or(estimate)
}

/// Numbers in lines of at most 128 characters, which every edition and reader allows.
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

/// Text that fits one line.
pub(super) fn one_line(text: &str) -> String {
    text.split(['\r', '\n']).map(str::trim).collect::<Vec<_>>().join(" ").trim().to_string()
}
