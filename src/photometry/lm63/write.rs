//! Writer of LM-63 files of any edition: metres, all multipliers one, tables in the type that they are of.

use super::header::missing_keywords;
use super::opening::to_dimensions;
use super::{Edition, Lm63Details, ThirdNumber, Tilt, is_edition_line, is_tilt_line, parse};
use crate::photometry::filed::Filed;
use crate::photometry::write::{in_type_c, lines, number, one_line};
use crate::photometry::{Details, FileFormat, Goniometer, Photometry, Written};

/// Writes ANSI/IESNA LM-63-02.
pub fn write_2002(photometry: &Photometry) -> Written {
    write(photometry, Edition::Lm63_2002)
}

/// Writes ANSI/IES LM-63-19.
pub fn write_2019(photometry: &Photometry) -> Written {
    write(photometry, Edition::Lm63_2019)
}

/// Writes LM-63 of an edition.
///
/// Of the ballast factor and what multiplies beside it nothing is left: every intensity has them in it.
pub fn write(photometry: &Photometry, edition: Edition) -> Written {
    let text = match Filed::of(&photometry.distribution) {
        Some(table) => text(photometry, edition, &table.halved()),
        None => in_type_c(photometry, 1.0, |distribution| text(photometry, edition, &Filed::of_type_c(distribution))),
    };
    let mut written = Written::checked(photometry, text, FileFormat::Lm63(edition), parse);
    if let Some(missing) = missing_keywords(edition, &photometry.keywords) {
        written.notes.push(format!("{missing}, of which nothing is known"));
    }
    written
}

fn text(photometry: &Photometry, edition: Edition, table: &Filed) -> String {
    let mut text = String::new();
    if let Some(first) = edition.first_line() {
        text.push_str(first);
        text.push_str("\r\n");
    }
    keywords(photometry, edition, &mut text);
    let details = details(photometry, edition);
    match &details.tilt {
        None => text.push_str("TILT=NONE\r\n"),
        Some(tilt) => tilt_records(tilt, &mut text),
    }
    // A shape that the edition lacks becomes its bounding box; the check of what is written says so.
    let [width, length, height] =
        to_dimensions(edition, &photometry.opening).unwrap_or_else(|| photometry.opening.bounding_box_m()).map(number);
    let (lamps, lumens) = (details.lamps.to_string(), number(details.lumens_per_lamp));
    let (verticals, horizontals) = (table.vertical_deg.len().to_string(), table.horizontal_deg.len().to_string());
    // Multiplier, metres.
    let kind = match table.goniometer {
        Goniometer::C => "1",
        Goniometer::B => "2",
        Goniometer::A => "3",
    };
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

fn keywords(photometry: &Photometry, edition: Edition, text: &mut String) {
    for (key, value) in &photometry.keywords {
        if edition == Edition::Lm63_1986 && key.is_empty() && is_label(value) {
            text.push_str(&format!("{value}\r\n"));
        } else {
            keyword(&name_in(edition, key, photometry), value, edition, text);
        }
    }
    if let Details::Eulumdat(details) = &photometry.details
        && let Some(set) = details.lamp_sets.first()
        && !set.kind.is_empty()
        && photometry.keyword("LAMP").is_none()
    {
        keyword("LAMP", &set.kind, edition, text);
    }
}

/// A keyword with its text, whose further lines are [MORE].
fn keyword(key: &str, value: &str, edition: Edition, text: &mut String) {
    let key = one_line(key).replace(['[', ']'], "");
    let mut key = if key.is_empty() { "OTHER" } else { &key };
    let room = edition.line_limit().saturating_sub(key.len() + 3).max(1);
    for part in value.split('\n').flat_map(|part| broken(&one_line(part), room)) {
        text.push_str(format!("[{key}] {part}").trim_end());
        text.push_str("\r\n");
        key = "MORE";
    }
}

/// Whether a line of LM-63-1986 is read as the label that it is.
fn is_label(line: &str) -> bool {
    let is_other = is_edition_line(line.as_bytes()) || is_tilt_line(line.as_bytes()) || line.starts_with('[');
    !is_other && !line.is_empty() && line == one_line(line) && line.chars().count() <= Edition::Lm63_1986.line_limit()
}

/// Keywords that came with LM-63-2002 and 2019; before, what the standard does not define begins with an underscore.
const SINCE_2002: [&str; 4] = ["TESTLAB", "ISSUEDATE", "NEARFIELD", "FILEGENINFO"];

/// What an edition calls a keyword.
fn name_in(edition: Edition, key: &str, photometry: &Photometry) -> String {
    if edition > Edition::Lm63_1995 || !SINCE_2002.contains(&key) {
        return key.into();
    }
    // The editions before have one date, without saying of what.
    if key == "ISSUEDATE" && photometry.keyword("DATE").is_none() { "DATE".into() } else { format!("_{key}") }
}

/// A text in parts of at most so many characters, parted at blanks where there are any.
fn broken(text: &str, most: usize) -> Vec<String> {
    let mut parts = vec![];
    let mut rest = text;
    while let Some((limit, _)) = rest.char_indices().nth(most) {
        let at = rest[..limit].rfind(' ').filter(|at| *at > 0).unwrap_or(limit);
        parts.push(rest[..at].trim_end().to_string());
        rest = rest[at..].trim_start();
    }
    parts.push(rest.to_string());
    parts
}

/// The file's own details where they still agree with the rest, else the plainest ones.
fn details(photometry: &Photometry, edition: Edition) -> Lm63Details {
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

fn tilt_records(tilt: &Tilt, text: &mut String) {
    text.push_str("TILT=INCLUDE\r\n");
    text.push_str(&lines([f64::from(tilt.geometry)]));
    text.push_str(&lines([tilt.angles_deg.len() as f64]));
    text.push_str(&lines(tilt.angles_deg.iter().copied()));
    text.push_str(&lines(tilt.factors.iter().copied()));
}
