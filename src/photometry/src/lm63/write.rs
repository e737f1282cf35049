//! Writer of LM-63 files of any edition: metres, all multipliers 1, the table in its native type.

use super::header::missing_keywords;
use super::opening::to_dimensions;
use super::{Edition, Lm63Details, ThirdNumber, Tilt, is_edition_line, is_tilt_line, parse};
use crate::file_table::FileTable;
use crate::write::{lines, number, one_line, write_in_type_c};
use crate::{Details, FileFormat, Goniometer, Photometry, Written};

/// Writes ANSI/IESNA LM-63-02.
pub fn write_2002(photometry: &Photometry) -> Written {
    write(photometry, Edition::Lm63_2002)
}

/// Writes ANSI/IES LM-63-19.
pub fn write_2019(photometry: &Photometry) -> Written {
    write(photometry, Edition::Lm63_2019)
}

/// Writes an edition of LM-63.
///
/// The ballast factor and the other multipliers become 1: the intensities contain them.
pub fn write(photometry: &Photometry, edition: Edition) -> Written {
    let text = match FileTable::from_distribution(&photometry.distribution) {
        Some(table) => format_file(photometry, edition, &table.without_mirrored_half()),
        None => write_in_type_c(photometry, 1.0, |distribution| {
            format_file(photometry, edition, &FileTable::from_type_c(distribution))
        }),
    };
    let mut written = Written::checked(photometry, text, FileFormat::Lm63(edition), parse);
    if let Some(missing) = missing_keywords(edition, &photometry.keywords) {
        written.notes.push(format!("{missing}, of which nothing is known"));
    }
    written
}

/// Formats the whole file.
fn format_file(photometry: &Photometry, edition: Edition, table: &FileTable) -> String {
    let mut text = String::new();
    if let Some(first) = edition.first_line() {
        text.push_str(first);
        text.push_str("\r\n");
    }
    push_keywords(photometry, edition, &mut text);
    let details = choose_details(photometry, edition);
    match &details.tilt {
        None => text.push_str("TILT=NONE\r\n"),
        Some(tilt) => push_tilt(tilt, &mut text),
    }
    // A shape that the edition lacks becomes its bounding box. The check of the written file reports it.
    let [width, length, height] =
        to_dimensions(edition, &photometry.opening).unwrap_or_else(|| photometry.opening.bounding_box_m()).map(number);
    let (lamps, lumens) = (details.lamps.to_string(), number(details.lumens_per_lamp));
    let (verticals, horizontals) = (table.vertical_deg.len().to_string(), table.horizontal_deg.len().to_string());
    let kind = match table.goniometer {
        Goniometer::C => "1",
        Goniometer::B => "2",
        Goniometer::A => "3",
    };
    // The units type 2 is metres.
    let (multiplier, kind, units) = ("1".into(), kind.into(), "2".into());
    text.push_str(&[lamps, lumens, multiplier, verticals, horizontals, kind, units, width, length, height].join(" "));
    text.push_str("\r\n");
    text.push_str(&lines([1.0, details.third_number.value(), photometry.input_watts.unwrap_or(0.0)]));
    text.push_str(&lines(table.vertical_deg.iter().copied()));
    text.push_str(&lines(table.horizontal_deg.iter().copied()));
    for row in &table.candela {
        text.push_str(&lines(row.iter().copied()));
    }
    text
}

/// Adds all keywords, and the lamp type of a EULUMDAT file as one.
fn push_keywords(photometry: &Photometry, edition: Edition, text: &mut String) {
    for (key, value) in &photometry.keywords {
        if edition == Edition::Lm63_1986 && key.is_empty() && is_label(value) {
            text.push_str(&format!("{value}\r\n"));
        } else {
            push_keyword(&name_in_edition(edition, key, photometry), value, edition, text);
        }
    }
    if let Details::Eulumdat(details) = &photometry.details
        && let Some(set) = details.lamp_sets.first()
        && !set.kind.is_empty()
        && photometry.keyword("LAMP").is_none()
    {
        push_keyword("LAMP", &set.kind, edition, text);
    }
}

/// Adds a keyword with its text; further lines follow as [MORE].
fn push_keyword(key: &str, value: &str, edition: Edition, text: &mut String) {
    let key = one_line(key).replace(['[', ']'], "");
    let mut key = if key.is_empty() { "OTHER" } else { &key };
    let room = edition.line_limit().saturating_sub(key.len() + 3).max(1);
    for part in value.split('\n').flat_map(|part| break_line(&one_line(part), room)) {
        text.push_str(format!("[{key}] {part}").trim_end());
        text.push_str("\r\n");
        key = "MORE";
    }
}

/// Whether the reader takes a line of LM-63-1986 as a label.
fn is_label(line: &str) -> bool {
    let is_other = is_edition_line(line.as_bytes()) || is_tilt_line(line.as_bytes()) || line.starts_with('[');
    !is_other && !line.is_empty() && line == one_line(line) && line.chars().count() <= Edition::Lm63_1986.line_limit()
}

/// Keywords that LM-63-2002 and 2019 introduced. In earlier editions an undefined keyword begins with an underscore.
const KEYWORDS_SINCE_2002: [&str; 4] = ["TESTLAB", "ISSUEDATE", "NEARFIELD", "FILEGENINFO"];

/// The name of a keyword in an edition.
fn name_in_edition(edition: Edition, key: &str, photometry: &Photometry) -> String {
    if edition > Edition::Lm63_1995 || !KEYWORDS_SINCE_2002.contains(&key) {
        return key.into();
    }
    // Earlier editions have one date of unspecified meaning.
    if key == "ISSUEDATE" && photometry.keyword("DATE").is_none() { "DATE".into() } else { format!("_{key}") }
}

/// Breaks a text into parts of at most `max_chars` characters, at blanks where possible.
fn break_line(text: &str, max_chars: usize) -> Vec<String> {
    let mut parts = vec![];
    let mut rest = text;
    while let Some((limit, _)) = rest.char_indices().nth(max_chars) {
        let at = rest[..limit].rfind(' ').filter(|at| *at > 0).unwrap_or(limit);
        parts.push(rest[..at].trim_end().to_string());
        rest = rest[at..].trim_start();
    }
    parts.push(rest.to_string());
    parts
}

/// The details of the source file where they still agree with the photometry, else the simplest ones.
fn choose_details(photometry: &Photometry, edition: Edition) -> Lm63Details {
    let plain = Lm63Details {
        edition,
        goniometer: super::Goniometer::C,
        lamps: 1,
        lumens_per_lamp: photometry.lamp_lumens.unwrap_or(-1.0),
        third_number: ThirdNumber::FileGeneration(1.0).in_edition(edition),
        tilt: None,
    };
    match &photometry.details {
        Details::Lm63(details) => {
            let lumens = f64::from(details.lamps) * details.lumens_per_lamp;
            let agrees = match photometry.lamp_lumens {
                Some(lamp_lumens) => lumens == lamp_lumens,
                None => details.lumens_per_lamp < 0.0,
            };
            let third_number = details.third_number.in_edition(edition);
            let tilt = details.tilt.clone();
            if agrees {
                Lm63Details { edition, third_number, ..details.clone() }
            } else {
                Lm63Details { third_number, tilt, ..plain }
            }
        }
        Details::Eulumdat(details) => {
            let lamps = details.lamp_sets.first().map_or(1, |set| set.lamps.unsigned_abs().max(1));
            match photometry.lamp_lumens {
                Some(lumens) if f64::from(lamps) * (lumens / f64::from(lamps)) == lumens => {
                    Lm63Details { lamps, lumens_per_lamp: lumens / f64::from(lamps), ..plain }
                }
                Some(_) => plain,
                None => Lm63Details { lamps, ..plain },
            }
        }
        Details::None => plain,
    }
}

/// Adds the four records of TILT=INCLUDE.
fn push_tilt(tilt: &Tilt, text: &mut String) {
    text.push_str("TILT=INCLUDE\r\n");
    text.push_str(&lines([f64::from(tilt.geometry)]));
    text.push_str(&lines([tilt.angles_deg.len() as f64]));
    text.push_str(&lines(tilt.angles_deg.iter().copied()));
    text.push_str(&lines(tilt.factors.iter().copied()));
}
