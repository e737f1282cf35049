//! Writer of TM-33-23 files: one emitter, the multiplier 1, the table in its native type.
//!
//! A keyword without a header element becomes a comment, `[KEYWORD] text`, which the reader takes back as that keyword.

use std::fmt::Write as _;

use super::header::{COMMENTS, KEYWORDS};
use super::parse;
use crate::file_table::FileTable;
use crate::text::harmless;
use crate::write::{number, write_in_type_c};
use crate::{FileFormat, Goniometer, Photometry, Symmetry, Written};

/// Writes ANSI/IES TM-33-23.
pub fn write(photometry: &Photometry) -> Written {
    let symmetry = photometry.distribution.symmetry();
    let text = match FileTable::from_distribution(&photometry.distribution) {
        Some(table) => format_file(photometry, symmetry, &table),
        None => write_in_type_c(photometry, 1.0, |distribution| {
            format_file(photometry, distribution.symmetry(), &FileTable::from_type_c(distribution))
        }),
    };
    Written::checked(photometry, text, FileFormat::Tm33, parse)
}

/// Adds an element with a value that needs no escapes.
fn push_element(text: &mut String, name: &str, value: &str) {
    text.push_str(&format!("<{name}>{value}</{name}>\r\n"));
}

/// Formats the whole file.
fn format_file(photometry: &Photometry, symmetry: Symmetry, table: &FileTable) -> String {
    let mut text =
        String::from("<?xml version=\"1.0\" encoding=\"UTF-8\"?>\r\n<IESTM33-22>\r\n<Version>1.1</Version>\r\n");
    push_header(photometry, &mut text);
    text.push_str("<Emitter>\r\n<Quantity>1</Quantity>\r\n");
    if let Some(lumens) = photometry.lamp_lumens {
        push_element(&mut text, "RatedLumens", &number(lumens));
    }
    if let Some(watts) = photometry.input_watts {
        push_element(&mut text, "InputWattage", &number(watts));
    }
    let (kind, is_native) = (table.goniometer, table.goniometer != Goniometer::C);
    text.push_str(&format!(
        "<LuminousData>\r\n<PhotometryType>CIE-{kind:?}</PhotometryType>\r\n<Metric>Luminous</Metric>\r\n"
    ));
    let symmetry = match symmetry {
        // Tables of other types contain all planes.
        _ if is_native => "Symm_None",
        Symmetry::Axial => "Symm_Full",
        Symmetry::Quadrant => "Symm_Quad",
        Symmetry::BilateralC0 => "Symm_Bi0",
        Symmetry::BilateralC90 => "Symm_Bi90",
        Symmetry::None => "Symm_None",
    };
    text.push_str(&format!("<SymmType>{symmetry}</SymmType>\r\n<LuminousIntensity>\r\n"));
    push_element(&mut text, "AbsolutePhotometry", &photometry.lamp_lumens.is_none().to_string());
    push_element(&mut text, "Multiplier", &number(1.0));
    push_element(&mut text, "NumberHorz", &table.horizontal_deg.len().to_string());
    push_element(&mut text, "NumberVert", &table.vertical_deg.len().to_string());
    for (h, row) in table.horizontal_deg.iter().zip(&table.candela) {
        let h = number(*h);
        for (v, candela) in table.vertical_deg.iter().zip(row) {
            // Writing to a string cannot fail.
            write!(text, "<IntData h=\"{h}\" v=\"{}\">{}</IntData>\r\n", number(*v), number(*candela)).ok();
        }
    }
    text.push_str("</LuminousIntensity>\r\n</LuminousData>\r\n</Emitter>\r\n</IESTM33-22>\r\n");
    text
}

/// Adds the header: its defined elements in their order, then all other keywords as comments.
fn push_header(photometry: &Photometry, text: &mut String) {
    let mut rest: Vec<&(String, String)> = photometry.keywords.iter().collect();
    text.push_str("<Header>\r\n");
    for (element, keyword) in KEYWORDS {
        if let Some(k) = rest.iter().position(|(key, value)| key == keyword && !value.trim().is_empty()) {
            let (_, value) = rest.remove(k);
            text.push_str(&format!("<{element}>{}</{element}>\r\n", escaped(value)));
        }
    }
    for (key, value) in rest {
        let comment = if key == COMMENTS { value.clone() } else { format!("[{key}] {value}") };
        text.push_str(&format!("<Comments>{}</Comments>\r\n", escaped(comment.trim())));
    }
    text.push_str("</Header>\r\n");
}

/// Escapes a text for XML and replaces characters that XML does not allow.
fn escaped(text: &str) -> String {
    let text = harmless(text);
    let legal =
        text.chars().map(|c| if matches!(c, '\u{fffe}' | '\u{ffff}') { char::REPLACEMENT_CHARACTER } else { c });
    let legal: String = legal.collect();
    legal.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}
