//! Text files with any line ending, in UTF-8, UTF-16 or Latin-1: their lines, places and printable texts.

use std::borrow::Cow;
use std::path::PathBuf;

use super::error::{Problem, ReadError};

/// The bytes of a text file, without byte order mark.
#[derive(Clone, Copy)]
pub(crate) struct Text<'a> {
    pub(crate) bytes: &'a [u8],
    pub(crate) has_byte_order_mark: bool,
}

/// One line without its ending.
#[derive(Clone, Copy)]
pub(crate) struct Line<'a> {
    /// Offset of its first byte.
    pub(crate) at: usize,
    /// From 1.
    pub(crate) number: usize,
    pub(crate) bytes: &'a [u8],
}

impl<'a> Text<'a> {
    pub(crate) fn new(bytes: &'a [u8]) -> Self {
        match bytes.strip_prefix(b"\xef\xbb\xbf") {
            Some(rest) => Self { bytes: rest, has_byte_order_mark: true },
            None => Self { bytes, has_byte_order_mark: false },
        }
    }

    /// The lines; LF, CR LF and a lone CR each end one.
    pub(crate) fn lines(self) -> impl Iterator<Item = Line<'a>> {
        let (mut at, mut number) = (0, 0);
        std::iter::from_fn(move || {
            let rest = self.bytes.get(at..).filter(|rest| !rest.is_empty())?;
            let length = rest.iter().position(|b| matches!(b, b'\n' | b'\r')).unwrap_or(rest.len());
            let ending = if rest[length..].starts_with(b"\r\n") { 2 } else { 1 };
            let line = Line { at, number: number + 1, bytes: &rest[..length] };
            (at, number) = (at + length + ending, number + 1);
            Some(line)
        })
    }

    /// Line and column, from 1, of a byte; the column counts characters.
    pub(crate) fn place(&self, at: usize) -> (usize, usize) {
        let before = &self.bytes[..at.min(self.bytes.len())];
        let ends = (0..before.len()).filter(|&k| self.is_line_end(k));
        let (count, start) = ends.fold((0, 0), |(count, _), k| (count + 1, k + 1));
        (count + 1, decode(&before[start..]).chars().count() + 1)
    }

    /// Whether a line ends with the byte at this offset. CR LF ends one with its LF.
    fn is_line_end(&self, at: usize) -> bool {
        match self.bytes[at] {
            b'\n' => true,
            b'\r' => self.bytes.get(at + 1) != Some(&b'\n'),
            _ => false,
        }
    }

    /// The line of a byte, from 1.
    pub(crate) fn line_of(&self, at: usize) -> usize {
        self.place(at).0
    }

    /// A refusal at a byte.
    pub(crate) fn error(&self, at: usize, problem: Problem) -> ReadError {
        let (line, column) = self.place(at);
        ReadError { file: PathBuf::new(), line, column, problem }
    }
}

impl<'a> Line<'a> {
    /// The line as text, without blanks at its ends.
    pub(crate) fn trimmed(&self) -> Cow<'a, str> {
        decode(self.bytes.trim_ascii())
    }
}

/// Whether a character has an effect instead of a glyph, or none of both: controls, line breaks, marks of writing direction, and
/// characters without a glyph, which make two names look the same.
///
/// The joiners of Arabic and Indic scripts (U+200C, U+200D) and the soft hyphen are printable: words need them.
pub fn is_unprintable(c: char) -> bool {
    let breaks_or_turns = matches!(c, '\u{2028}' | '\u{2029}' | '\u{61c}' | '\u{200e}' | '\u{200f}' | '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}');
    let is_invisible = matches!(
        c,
        '\u{34f}' | '\u{180e}' | '\u{200b}' | '\u{2060}'..='\u{2065}' | '\u{206a}'..='\u{206f}' | '\u{3164}' | '\u{feff}' | '\u{ffa0}'
            | '\u{fff0}'..='\u{fffb}' | '\u{e0000}'..='\u{e0fff}'
    );
    c.is_control() || breaks_or_turns || is_invisible
}

/// Decodes UTF-8 or else Latin-1, in which every byte is a character.
///
/// Each character that would affect a terminal is replaced by one other: reports and messages print the texts of files.
pub(crate) fn decode(bytes: &[u8]) -> Cow<'_, str> {
    match std::str::from_utf8(bytes) {
        Ok(text) => harmless(text),
        Err(_) => Cow::Owned(bytes.iter().map(|&b| replace_unprintable(char::from(b))).collect()),
    }
}

/// Replaces unprintable characters of a text except tabs and line ends.
pub(crate) fn harmless(text: &str) -> Cow<'_, str> {
    if text.chars().all(|c| replace_unprintable(c) == c) {
        return text.into();
    }
    text.chars().map(replace_unprintable).collect()
}

/// Replaces an unprintable character except a tab or line end.
fn replace_unprintable(c: char) -> char {
    if is_unprintable(c) && !matches!(c, '\t' | '\n' | '\r') { char::REPLACEMENT_CHARACTER } else { c }
}

/// Converts UTF-16, which a byte order mark announces, to UTF-8; other bytes stay. Unpaired surrogates become U+FFFD.
pub(crate) fn without_utf16(bytes: &[u8]) -> Cow<'_, [u8]> {
    let (rest, number): (_, fn([u8; 2]) -> u16) = match bytes {
        [0xff, 0xfe, rest @ ..] => (rest, u16::from_le_bytes),
        [0xfe, 0xff, rest @ ..] => (rest, u16::from_be_bytes),
        _ => return bytes.into(),
    };
    let units = rest.chunks_exact(2).map(|pair| number([pair[0], pair[1]]));
    let text: String = char::decode_utf16(units).map(|c| c.unwrap_or(char::REPLACEMENT_CHARACTER)).collect();
    text.into_bytes().into()
}

/// A short quotation of bytes for a message.
pub(crate) fn quote(bytes: &[u8]) -> String {
    let text = decode(bytes);
    let mut short: String = text.chars().take(24).map(|c| if is_unprintable(c) { '?' } else { c }).collect();
    if text.chars().nth(24).is_some() {
        short.push('…');
    }
    short
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_line_ending_ends_one_line_and_places_agree() {
        let text = Text::new(b"\xef\xbb\xbfone\r\ntwo\rthree\n\nfive");
        assert!(text.has_byte_order_mark);
        let lines: Vec<_> = text.lines().map(|l| (l.number, decode(l.bytes).into_owned(), text.place(l.at))).collect();
        let expected = ["one", "two", "three", "", "five"];
        assert_eq!(lines.len(), expected.len());
        for (k, (number, words, place)) in lines.iter().enumerate() {
            assert_eq!((*number, words.as_str(), *place), (k + 1, expected[k], (k + 1, 1)));
        }
    }

    #[test]
    fn utf16_of_either_order_is_the_same_text() {
        let text = "f\u{fc}r \u{1f4a1}\r\n1";
        let little: Vec<u8> = [0xfeff].into_iter().chain(text.encode_utf16()).flat_map(u16::to_le_bytes).collect();
        let big: Vec<u8> = [0xfeff].into_iter().chain(text.encode_utf16()).flat_map(u16::to_be_bytes).collect();
        assert_eq!((&*without_utf16(&little), &*without_utf16(&big)), (text.as_bytes(), text.as_bytes()));
        assert_eq!(&*without_utf16(b"\xff\xfe\x00\xd8a"), "\u{fffd}".as_bytes());
        assert!(matches!(without_utf16(b"\xef\xbb\xbfa"), Cow::Borrowed(b"\xef\xbb\xbfa")));
    }

    #[test]
    fn texts_of_a_file_are_printable_and_places_stay_the_same() {
        for (bytes, shown) in [
            ("a\u{1b}]0;x\u{7}\tb".as_bytes(), "a\u{fffd}]0;x\u{fffd}\tb"),
            ("\u{202e}für".as_bytes(), "\u{fffd}für"),
            (b"f\xfcr \x9b31m", "für \u{fffd}31m"),
            (b"two\r\nlines", "two\r\nlines"),
        ] {
            assert_eq!(decode(bytes), shown);
        }
        assert_eq!(Text::new(b"a\x1b[31m x").place(7), (1, 8));
    }

    #[test]
    fn columns_count_characters_in_either_encoding() {
        assert_eq!(Text::new("für x".as_bytes()).place(5), (1, 5));
        assert_eq!(Text::new(b"f\xfcr x").place(4), (1, 5));
    }
}
