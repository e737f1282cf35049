//! The head of an LM-63 file: edition, keywords, and the TILT line that ends it.

use std::path::PathBuf;

use super::Edition;
use crate::error::{Problem, ReadError};
use crate::lint::Lints;
use crate::text::{Line, Text, decode, quote};

/// The part of a file before the numbers.
pub(super) struct Head {
    pub(super) edition: Edition,
    /// In file order; a label line has an empty keyword.
    pub(super) keywords: Vec<(String, String)>,
    /// The line of each keyword.
    pub(super) keyword_lines: Vec<usize>,
    pub(super) tilt: TiltLine,
    /// Offset of the line after the TILT line.
    pub(super) numbers_at: usize,
}

/// The value of the TILT line.
pub(super) enum TiltLine {
    None,
    Include,
    File { name: String, at: usize },
}

/// Whether a line is the TILT line; blanks before it and around the `=` are tolerated.
pub(crate) fn is_tilt_line(line: &[u8]) -> bool {
    let line = line.trim_ascii();
    line.len() > 4 && line[..4].eq_ignore_ascii_case(b"TILT") && line[4..].trim_ascii_start().starts_with(b"=")
}

/// Whether a first line names an edition of LM-63.
pub(crate) fn is_edition_line(line: &[u8]) -> bool {
    let line = line.trim_ascii();
    let words: [&[u8]; 3] = [b"IESNA", b"IES:", b"IES LM"];
    words.iter().any(|word| line.len() >= word.len() && line[..word.len()].eq_ignore_ascii_case(word))
}

/// Reads all lines up to the TILT line.
pub(super) fn read_head(text: &Text, lints: &mut Lints) -> Result<Head, ReadError> {
    let mut head = Head {
        edition: Edition::Lm63_1986,
        keywords: vec![],
        keyword_lines: vec![],
        tilt: TiltLine::None,
        numbers_at: text.bytes.len(),
    };
    let mut lines = text.lines();
    let tilt = loop {
        let Some(line) = lines.next() else {
            return Err(text.error(text.bytes.len(), Problem::MissingTilt));
        };
        if is_tilt_line(line.bytes) {
            break line;
        }
        note_odd_characters(&line, lints);
        if line.number == 1 && is_edition_line(line.bytes) {
            head.edition = parse_edition(&line, lints);
        } else {
            read_keyword(&line, &mut head, lints);
        }
    };
    head.numbers_at = lines.next().map_or(text.bytes.len(), |next| next.at);
    head.tilt = parse_tilt_line(&tilt, lints);
    if let Some(message) = missing_keywords(head.edition, &head.keywords) {
        lints.note("lm63/keywords", 0, message);
    }
    Ok(head)
}

/// Notes leading blanks and characters beyond ASCII.
fn note_odd_characters(line: &Line, lints: &mut Lints) {
    if line.bytes.first().is_some_and(u8::is_ascii_whitespace) && !line.bytes.trim_ascii().is_empty() {
        lints.note("lm63/leading-blanks", line.number, "blanks before the text of a header line were skipped");
    }
    if !line.bytes.is_ascii() {
        let encoding = if std::str::from_utf8(line.bytes).is_ok() { "UTF-8" } else { "Latin-1" };
        let message = format!("a header line holds characters beyond ASCII; it was read as {encoding}");
        lints.note("lm63/not-ascii", line.number, message);
    }
}

/// Parses the edition of a first line, with a lint unless the spelling is that of the standard.
fn parse_edition(line: &Line, lints: &mut Lints) -> Edition {
    let spelt = line.trimmed();
    if let Some(edition) = Edition::ALL.into_iter().find(|e| e.first_line() == Some(spelt.as_ref())) {
        return edition;
    }
    let digits: String =
        spelt.chars().rev().skip_while(|c| !c.is_ascii_digit()).take_while(char::is_ascii_digit).collect();
    let year: String = digits.chars().rev().collect();
    let named = Edition::ALL.into_iter().find(|e| !year.is_empty() && (year == e.year() || year == e.year()[2..]));
    let (edition, how) = match named {
        Some(edition) => (edition, "was read as"),
        None => (Edition::Lm63_2002, "names no edition of LM-63 and was read as"),
    };
    let message = format!("the first line `{}` {how} {}", quote(line.bytes.trim_ascii()), edition.name());
    if named.is_some() {
        lints.note("lm63/edition", line.number, message);
    } else {
        lints.warn("lm63/edition", line.number, message);
    }
    edition
}

/// Adds the keyword or label of a line to the head.
fn read_keyword(line: &Line, head: &mut Head, lints: &mut Lints) {
    let text = line.trimmed();
    let bracketed = text.strip_prefix('[').and_then(|rest| rest.split_once(']'));
    let Some((key, value)) = bracketed else {
        if head.edition != Edition::Lm63_1986 && !text.is_empty() {
            lints.note("lm63/label", line.number, "a line without [KEYWORD] was kept as a label");
        }
        if !text.is_empty() {
            head.keywords.push((String::new(), text.into_owned()));
            head.keyword_lines.push(line.number);
        }
        return;
    };
    let (key, value) = (key.trim(), value.trim());
    if key.contains(char::is_whitespace) {
        lints.note("lm63/keyword-blank", line.number, format!("the keyword [{}] holds a blank", quote(key.as_bytes())));
    }
    if key.eq_ignore_ascii_case("MORE") {
        if let Some((_, earlier)) = head.keywords.last_mut() {
            earlier.push('\n');
            earlier.push_str(value);
            lints.note("lm63/more", line.number, "[MORE] was joined to the keyword before it");
        } else {
            lints.note("lm63/more", line.number, "[MORE] follows no keyword and was kept as [OTHER]");
            head.keywords.push(("OTHER".into(), value.into()));
            head.keyword_lines.push(line.number);
        }
        return;
    }
    if key.is_empty() {
        lints.note("lm63/label", line.number, "an empty keyword [] was kept as a label");
    }
    head.keywords.push((key.into(), value.into()));
    head.keyword_lines.push(line.number);
}

/// Parses the TILT line.
fn parse_tilt_line(line: &Line, lints: &mut Lints) -> TiltLine {
    let text = line.trimmed();
    if !line.bytes.starts_with(b"TILT=") {
        lints.note("lm63/tilt-spelling", line.number, "the TILT line is not spelt `TILT=` from its first column");
    }
    let equals = line.bytes.iter().position(|b| *b == b'=').map_or(0, |k| k + 1);
    let rest = line.bytes[equals..].trim_ascii();
    let name = text.split_once('=').map_or("", |(_, name)| name.trim());
    if name.eq_ignore_ascii_case("NONE") {
        TiltLine::None
    } else if name.eq_ignore_ascii_case("INCLUDE") {
        TiltLine::Include
    } else if PathBuf::from(name).as_os_str().is_empty() {
        lints.warn("lm63/tilt-empty", line.number, "nothing follows TILT=; it was read as TILT=NONE");
        TiltLine::None
    } else {
        TiltLine::File { name: decode(rest).into_owned(), at: line.at + equals }
    }
}

/// Lists the missing ones of the keywords that LM-63-1995 and later require, as a sentence.
pub(super) fn missing_keywords(edition: Edition, keywords: &[(String, String)]) -> Option<String> {
    let required = edition.required_keywords().iter();
    let missing = required.filter(|word| !keywords.iter().any(|(key, _)| key == **word));
    let missing: Vec<String> = missing.map(|word| format!("[{word}]")).collect();
    (!missing.is_empty()).then(|| format!("{} asks for the keywords {}", edition.name(), missing.join(" ")))
}
