//! Bytes of a text file as lines and places: any line ending, UTF-8 or Latin-1, with or without byte order mark; and which characters do something.

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
        let is_end = |k: usize| match before[k] {
            b'\n' => true,
            b'\r' => self.bytes.get(k + 1) != Some(&b'\n'),
            _ => false,
        };
        let ends = (0..before.len()).filter(|&k| is_end(k));
        let (count, start) = ends.fold((0, 0), |(count, _), k| (count + 1, k + 1));
        (count + 1, decode(&before[start..]).chars().count() + 1)
    }

    pub(crate) fn line_of(&self, at: usize) -> usize {
        self.place(at).0
    }

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

/// Whether a character shows nothing and does something: controls, and what breaks lines or turns their direction.
pub fn is_unprintable(c: char) -> bool {
    let breaks_or_turns = matches!(c, '\u{2028}' | '\u{2029}' | '\u{200e}' | '\u{200f}' | '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}');
    c.is_control() || breaks_or_turns || c == '\u{feff}'
}

/// UTF-8 where it is that, else Latin-1, in which every byte is a character. What would do something to a terminal is replaced, one
/// character by one: a file's texts are shown wherever it is used.
pub(crate) fn decode(bytes: &[u8]) -> Cow<'_, str> {
    match std::str::from_utf8(bytes) {
        Ok(text) => harmless(text),
        Err(_) => Cow::Owned(bytes.iter().map(|&b| replaced(char::from(b))).collect()),
    }
}

/// A text without characters that do something, but for tabs and ends of lines.
pub(crate) fn harmless(text: &str) -> Cow<'_, str> {
    if text.chars().all(|c| replaced(c) == c) { text.into() } else { text.chars().map(replaced).collect() }
}

fn replaced(c: char) -> char {
    if is_unprintable(c) && !matches!(c, '\t' | '\n' | '\r') { char::REPLACEMENT_CHARACTER } else { c }
}

/// Bytes of UTF-16, which begins with its byte order mark, as UTF-8; all else as it is. Halves of pairs become U+FFFD.
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
    fn no_text_of_a_file_does_anything_and_places_stay_the_same() {
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
