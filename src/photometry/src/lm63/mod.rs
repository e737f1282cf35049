//! Reader of IES LM-63 files, editions 1986 to 2019.
//!
//! Sources: IESNA LM-63-1986/1991/1995, ANSI/IESNA LM-63-02, ANSI/IES LM-63-19. Every candela value is multiplied by
//! the candela multiplier and the ballast factor, up to 1995 also by the ballast-lamp photometric factor (that field
//! is "future use" in 2002 and "file generation type" in 2019).

mod header;
mod numbers;
mod opening;
mod write;

use std::borrow::Cow;
use std::path::Path;

use self::header::TiltLine;
use self::numbers::{Number, Numbers, Repair};
use super::error::{Problem, ReadError, in_candela};
use super::goniometer::{Goniometer, Table};
use super::header_lints::{self, Header, LampNumbers};
use super::lint::Lints;
use super::planes;
use super::text::{Text, without_utf16};
use super::{Details, Photometry, Tolerance};

#[cfg(test)]
mod tests;

pub(crate) use self::header::{is_edition_line, is_tilt_line};
pub use self::write::{write, write_2002, write_2019};
pub use super::details::{Edition, Lm63Details, ThirdNumber, Tilt};

/// Metres in a foot, exactly.
const METRES_PER_FOOT: f64 = 0.3048;

/// Reads an LM-63 file. `TILT=<file>` is refused, since bytes have no folder.
pub fn parse(bytes: &[u8]) -> Result<Photometry, ReadError> {
    parse_with(bytes, |_| Err("the bytes come without a folder in which to look for it".into()))
}

/// Reads an LM-63 file. `tilt_file` opens a separate file of tilt factors by its name.
pub fn parse_with(
    bytes: &[u8],
    tilt_file: impl FnOnce(&str) -> Result<Vec<u8>, String>,
) -> Result<Photometry, ReadError> {
    read(bytes, tilt_file, Tolerance::Strict)
}

/// Reads an LM-63 file with a tolerance for damage.
pub(super) fn read(
    bytes: &[u8],
    tilt_file: impl FnOnce(&str) -> Result<Vec<u8>, String>,
    tolerance: Tolerance,
) -> Result<Photometry, ReadError> {
    let unicode = without_utf16(bytes);
    let text = Text::new(&unicode);
    let mut lints = Lints::new(tolerance);
    if matches!(unicode, Cow::Owned(_)) {
        lints.note("lm63/utf-16", 1, "the file is UTF-16; the standard has ASCII");
    }
    if text.has_byte_order_mark {
        lints.note("lm63/byte-order-mark", 1, "the file begins with a byte order mark");
    }
    let head = header::read_head(&text, &mut lints)?;
    let mut numbers = Numbers { text: &text, at: head.numbers_at, lints: &mut lints };
    let tilt = match head.tilt {
        TiltLine::None => None,
        TiltLine::Include => Some(read_tilt(&mut numbers)?),
        TiltLine::File { name, at } => {
            let tilt = tilt_file(&name).and_then(|bytes| parse_tilt(&bytes));
            Some(tilt.map_err(|reason| text.error(at, Problem::Tilt { name, reason }))?)
        }
    };
    let lamps = read_lamps(&mut numbers, head.edition)?;
    let table = read_table(numbers, &lamps)?;
    let distribution = planes::build_distribution(&text, lamps.goniometer, table, &mut lints)?;
    let (width_m, length_m, height_m) = lamps.dimensions_m;
    let (opening, remark) = opening::from_dimensions(head.edition, width_m, length_m, height_m);
    if let Some(message) = remark {
        lints.warn("lm63/opening", lamps.opening_line, message);
    }
    let is_absolute = lamps.lumens_per_lamp < 0.0;
    let texts = head.keywords.iter().zip(&head.keyword_lines).map(|((key, text), line)| (&key[..], &text[..], *line));
    let header = Header {
        texts: texts.collect(),
        distribution: &distribution,
        lamp_lumens: (!is_absolute).then_some(f64::from(lamps.count) * lamps.lumens_per_lamp),
        watts: (lamps.input_watts > 0.0).then_some(lamps.input_watts),
        records: Some(lamps.numbers),
        lamp_line: lamps.line,
    };
    header_lints::check(&header, &mut lints);
    let photometry = Photometry {
        format: head.edition.name().into(),
        distribution,
        lamp_lumens: (!is_absolute).then_some(f64::from(lamps.count) * lamps.lumens_per_lamp),
        opening,
        input_watts: (lamps.input_watts > 0.0).then_some(lamps.input_watts),
        keywords: head.keywords,
        details: Details::Lm63(Lm63Details {
            edition: head.edition,
            goniometer: lamps.goniometer,
            lamps: lamps.count,
            lumens_per_lamp: lamps.lumens_per_lamp,
            third_number: lamps.third_number,
            tilt,
        }),
        lints: vec![],
        source: vec![],
    };
    Ok(photometry.with_lints(lints))
}

/// The two records before the angles.
struct LampRecords {
    count: u32,
    lumens_per_lamp: f64,
    /// The product of all multipliers of the candela values.
    factor: f64,
    vertical: Number,
    horizontal: Number,
    goniometer: Goniometer,
    /// Width, length, height, signed.
    dimensions_m: (f64, f64, f64),
    opening_line: usize,
    third_number: ThirdNumber,
    input_watts: f64,
    line: usize,
    numbers: LampNumbers,
}

/// Whether a number is a count of lamps.
fn is_lamp_count(n: f64) -> bool {
    n.fract() == 0.0 && (1.0..=f64::from(u32::MAX)).contains(&n)
}

/// Whether a number is 1, 2 or 3, as several codes of the format.
fn is_one_to_three(n: f64) -> bool {
    [1.0, 2.0, 3.0].contains(&n)
}

/// Reads the ten numbers of the lamp record and the three numbers after it.
fn read_lamps(numbers: &mut Numbers, edition: Edition) -> Result<LampRecords, ReadError> {
    let text = numbers.text;
    let (what, expected) = (format_args!("the number of lamps"), "a whole number, one at least");
    let repair = Repair { code: "forgiven/lamps", substitute: 1.0, is_harmless: |n| n <= 0.0 };
    let first = numbers.checked_or(what, expected, is_lamp_count, repair)?;
    let (what, expected) = (format_args!("the lumens per lamp"), "positive, or -1 for absolute photometry");
    let repair = Repair { code: "forgiven/lumens", substitute: -1.0, is_harmless: |n| n <= 0.0 };
    let lumens = numbers.checked_or(what, expected, |n| n > 0.0 || n == -1.0, repair)?;
    if !(first.value * lumens.value).is_finite() {
        let (what, found) = ("the lumens of all lamps together".into(), f64::INFINITY);
        return Err(text.error(lumens.at, Problem::OutOfRange { what, found, expected: "finite" }));
    }
    let multiplier = numbers.checked(format_args!("the candela multiplier"), "positive", |n| n > 0.0)?;
    let vertical = numbers.count(format_args!("the number of vertical angles"), 2.0)?;
    let horizontal = numbers.count(format_args!("the number of horizontal angles"), 1.0)?;
    let claimed = Number { value: vertical.value * horizontal.value, at: vertical.at };
    numbers.check_room(format_args!("the number of vertical times horizontal angles"), claimed)?;
    let kind = numbers.checked(format_args!("the photometric type"), "1 (C), 2 (B) or 3 (A)", is_one_to_three)?;
    let goniometer = [Goniometer::C, Goniometer::B, Goniometer::A][kind.value as usize - 1];
    let units = numbers.checked(format_args!("the units type"), "1 (feet) or 2 (metres)", |n| n == 1.0 || n == 2.0)?;
    let metres = if units.value == 1.0 { METRES_PER_FOOT } else { 1.0 };
    let width = numbers.number(format_args!("the width of the luminous opening"))?;
    let length = numbers.number(format_args!("the length of the luminous opening"))?;
    let height = numbers.number(format_args!("the height of the luminous opening"))?;
    if text.bytes[first.at..height.at].contains(&b'\n') {
        let line = text.line_of(first.at);
        numbers.lints.note(
            "lm63/broken-record",
            line,
            "the ten numbers of the lamp record are spread over several lines",
        );
    }
    let ballast = numbers.number(format_args!("the ballast factor"))?;
    let values = vertical.value + horizontal.value + vertical.value * horizontal.value;
    // The first number of the vertical angles stands in place of the ballast factor.
    if !header_lints::BALLAST_FACTORS.contains(&ballast.value) && numbers.remaining() as f64 + 1.0 == values {
        return Err(text.error(ballast.at, Problem::MissingBallastRecord));
    }
    if ballast.value <= 0.0 {
        let (what, found) = ("the ballast factor".into(), ballast.value);
        return Err(text.error(ballast.at, Problem::OutOfRange { what, found, expected: "positive" }));
    }
    let third = numbers.number(format_args!("the number behind the ballast factor"))?;
    let what = format_args!("the input watts");
    let repair = Repair { code: "forgiven/watts", substitute: 0.0, is_harmless: |n| n < 0.0 };
    let watts = numbers.checked_or(what, "zero or more", |n| n >= 0.0, repair)?;
    let third_number = interpret_third_number(numbers, edition, third)?;
    let ballast_lamp = if let ThirdNumber::BallastLampFactor(factor) = third_number { factor } else { 1.0 };
    let factor = multiplier.value * ballast.value * ballast_lamp;
    if !factor.is_finite() || factor <= 0.0 {
        let (what, found) = ("the product of the multipliers".into(), factor);
        return Err(text.error(multiplier.at, Problem::OutOfRange { what, found, expected: "finite and positive" }));
    }
    Ok(LampRecords {
        count: first.value as u32,
        lumens_per_lamp: lumens.value,
        factor,
        vertical,
        horizontal,
        goniometer,
        dimensions_m: (width.value * metres, length.value * metres, height.value * metres),
        opening_line: text.line_of(width.at),
        third_number,
        input_watts: watts.value,
        line: text.line_of(first.at),
        numbers: LampNumbers {
            lamps: first.value as u32,
            lumens_per_lamp: lumens.value,
            multiplier: multiplier.value,
            ballast_factor: ballast.value,
            ballast_line: text.line_of(ballast.at),
        },
    })
}

/// Interprets the number behind the ballast factor by the edition.
fn interpret_third_number(numbers: &mut Numbers, edition: Edition, third: Number) -> Result<ThirdNumber, ReadError> {
    let line = numbers.text.line_of(third.at);
    let value = third.value;
    match edition {
        Edition::Lm63_1986 | Edition::Lm63_1991 if value > 0.0 => Ok(ThirdNumber::BallastLampFactor(value)),
        Edition::Lm63_1986 | Edition::Lm63_1991 => {
            let (what, expected) = ("the ballast-lamp photometric factor".into(), "positive");
            Err(numbers.text.error(third.at, Problem::OutOfRange { what, found: value, expected }))
        }
        Edition::Lm63_1995 if value > 0.0 => {
            if value != 1.0 {
                let message = format!(
                    "the number behind the ballast factor, {value}, was read as a ballast-lamp factor as in LM-63-1991 \
                     and multiplies every intensity; LM-63-1995 reserves it"
                );
                numbers.lints.warn("lm63/ballast-lamp-factor", line, message);
            }
            Ok(ThirdNumber::BallastLampFactor(value))
        }
        Edition::Lm63_1995 | Edition::Lm63_2002 => {
            if value != 1.0 {
                let message =
                    format!("the number behind the ballast factor is reserved and must be 1; {value} was ignored");
                numbers.lints.warn("lm63/ballast-lamp-factor", line, message);
            }
            Ok(ThirdNumber::Reserved(value))
        }
        Edition::Lm63_2019 => Ok(ThirdNumber::FileGeneration(value)),
    }
}

/// Reads angles and intensities.
fn read_table(mut numbers: Numbers, lamps: &LampRecords) -> Result<Table, ReadError> {
    let (vertical_deg, vertical_at) = numbers.angles("vertical", lamps.vertical)?;
    let (horizontal_deg, horizontal_at) = numbers.angles("horizontal", lamps.horizontal)?;
    let (vertical, expected) = (vertical_deg.len(), vertical_deg.len() * horizontal_deg.len());
    let claimed = Number { value: expected as f64, at: lamps.vertical.at };
    numbers.check_room(format_args!("the number of candela values"), claimed)?;
    let mut candela: Vec<f64> = Vec::with_capacity(expected);
    let candela_at = numbers.at;
    let mut least = Number { value: 0.0, at: candela_at };
    let is_full_circle = (horizontal_deg[0], horizontal_deg[horizontal_deg.len() - 1]) == (0.0, 360.0);
    for (h, &angle) in horizontal_deg.iter().enumerate() {
        let before = numbers.at;
        for v in 0..vertical {
            let what = format_args!("candela value {} of {vertical} at horizontal angle {angle}", v + 1);
            let is_last = h + 1 == horizontal_deg.len();
            let number = match numbers.number(what) {
                Err(error) if is_last && is_full_circle && is_cut_in_last_plane(&error, &candela, vertical) => {
                    let line = numbers.text.line_of(numbers.text.bytes.len());
                    let message =
                        format!("the last plane ends after {v} values; it was completed from plane 0, which it is");
                    if !numbers.lints.accept_damage("forgiven/cut", line, message) {
                        return Err(error);
                    }
                    candela.extend_from_within(v..vertical);
                    break;
                }
                number => number?,
            };
            if number.value < 0.0 && !numbers.lints.is_tolerant() {
                return Err(negative_candela(numbers.text, number));
            }
            if number.value < least.value {
                least = number;
            }
            let skipped = &numbers.text.bytes[before..number.at];
            let begins_row = v == 0 && h > 0;
            if begins_row
                && !skipped.iter().any(|b| matches!(b, b'\n' | b'\r'))
                && !numbers.lints.count_repetition("lm63/broken-record")
            {
                let line = numbers.text.line_of(number.at);
                numbers.lints.note("lm63/broken-record", line, "the values of a horizontal angle do not begin a line");
            }
            let scaled = in_candela(what, number.value, lamps.factor);
            candela.push(scaled.map_err(|problem| numbers.text.error(number.at, problem))?.max(0.0));
        }
    }
    let most = candela.iter().copied().fold(0.0, f64::max);
    if least.value < 0.0 {
        let message = format!("negative intensities, of {} at least, were read as zero", least.value);
        // The dark reading of a photometer is at most a thousandth of its largest reading.
        let is_noise = -least.value * lamps.factor <= 1e-3 * most;
        if !is_noise || !numbers.lints.accept_damage("forgiven/negative", numbers.text.line_of(least.at), message) {
            return Err(negative_candela(numbers.text, least));
        }
    }
    // With a wrong count of angles, the next record begins in the middle of a line.
    let first_candela_at = numbers.next_at(candela_at);
    let is_in_step = [horizontal_at, first_candela_at].into_iter().all(|at| numbers.begins_line(at));
    numbers.finish("candela values", expected, if is_in_step { vertical } else { 0 })?;
    Ok(Table { vertical_deg, vertical_at, horizontal_deg, horizontal_at, candela, candela_at })
}

/// The refusal of a negative intensity.
fn negative_candela(text: &Text, candela: Number) -> ReadError {
    let (what, found, expected) = ("a candela value".into(), candela.value, "zero or more");
    text.error(candela.at, Problem::OutOfRange { what, found, expected })
}

/// Whether a file ends within its last plane, and that plane begins with the values of the first plane.
fn is_cut_in_last_plane(error: &ReadError, candela: &[f64], vertical: usize) -> bool {
    let last = candela.chunks(vertical).next_back().filter(|last| last.len() < vertical).unwrap_or_default();
    matches!(error.problem, Problem::UnexpectedEnd { .. }) && candela.len() > vertical && candela.starts_with(last)
}

/// Reads the four records of TILT=INCLUDE.
fn read_tilt(numbers: &mut Numbers) -> Result<Tilt, ReadError> {
    let what = format_args!("the lamp-to-luminaire geometry");
    let geometry = numbers.checked(what, "1, 2 or 3", is_one_to_three)?.value as u8;
    let pairs = numbers.count(format_args!("the number of tilt angles"), 1.0)?;
    let (angles_deg, at) = numbers.angles("tilt", pairs)?;
    let pairs = angles_deg.len();
    let mut factors = Vec::with_capacity(pairs);
    for k in 1..=pairs {
        let factor = numbers.checked(format_args!("tilt factor {k} of {pairs}"), "zero or more", |n| n >= 0.0)?;
        factors.push(factor.value);
    }
    let line = numbers.text.line_of(at);
    numbers.lints.note("lm63/tilt", line, "the tilt factors were kept but are not applied to the intensities");
    Ok(Tilt { geometry, angles_deg, factors })
}

/// Reads a file of tilt factors: the four records of TILT=INCLUDE.
fn parse_tilt(bytes: &[u8]) -> Result<Tilt, String> {
    let unicode = without_utf16(bytes);
    let text = Text::new(&unicode);
    let mut lints = Lints::default();
    let mut numbers = Numbers { text: &text, at: 0, lints: &mut lints };
    let tilt =
        read_tilt(&mut numbers).and_then(|tilt| numbers.finish("tilt factors", tilt.factors.len(), 0).map(|()| tilt));
    tilt.map_err(|error| format!("in it, {error}"))
}

/// Opens the tilt file that an LM-63 file names, in the same folder and nowhere else.
pub(super) fn tilt_file_opener(
    path: &Path,
    open: &dyn Fn(&Path) -> std::io::Result<Vec<u8>>,
) -> impl FnOnce(&str) -> Result<Vec<u8>, String> {
    move |name| {
        let is_plain_name = Path::new(name).file_name().is_some_and(|last| last == name);
        if !is_plain_name {
            return Err("only a file in the same folder is looked for".into());
        }
        let tilt_path = path.with_file_name(name);
        open(&tilt_path).map_err(|error| format!("`{}`: {error}", tilt_path.display()))
    }
}
