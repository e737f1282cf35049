//! Parses what adapters print: JSON, or almost JSON.

use serde::Deserialize;

use luxproof_process::printable;

/// JSON as programs write it, which may hold what JSON has not.
pub(super) fn from_json<T: for<'de> Deserialize<'de>>(text: &[u8]) -> Result<T, serde_json::Error> {
    serde_json::from_slice(text).or_else(|error| {
        let quoted = quoted(&String::from_utf8_lossy(text));
        let mut document = serde_json::Deserializer::from_str(&quoted);
        match serde_path_to_error::deserialize(&mut document) {
            Ok(read) => document.end().map(|()| read),
            Err(at) if at.path().iter().len() == 0 => Err(error),
            Err(at) => Err(serde::de::Error::custom(format!("`{}`: {error}", at.path()))),
        }
    })
}

/// What is printed besides JSON, if that is all that is wrong with it: messages of the program's, or of a library's.
pub(super) fn chatter(text: &[u8]) -> Option<String> {
    let (words, place) = match printed_before(text) {
        Some(words) => (words, "before"),
        None => (printed_after(text)?, "after"),
    };
    let words = printable::line(words.trim(), MAX_WORDS);
    Some(format!("it prints `{words}` {place} its answer: what is no JSON belongs on standard error"))
}

fn printed_after(text: &[u8]) -> Option<String> {
    let text = quoted(&String::from_utf8_lossy(text));
    let mut documents = serde_json::Deserializer::from_str(&text).into_iter::<serde::de::IgnoredAny>();
    let is_read = documents.next().is_some_and(|first| first.is_ok());
    let rest = text[documents.byte_offset()..].trim();
    (is_read && text.trim_start().starts_with(['{', '[']) && !rest.is_empty()).then(|| rest.to_owned())
}

fn printed_before(text: &[u8]) -> Option<String> {
    let text = String::from_utf8_lossy(text);
    let starts = text.match_indices(['{', '[']).map(|(at, _)| at).filter(|at| *at > 0).take(MOST_STARTS);
    let mut answers = starts.filter(|at| from_json::<serde::de::IgnoredAny>(text[*at..].as_bytes()).is_ok());
    answers.next().map(|at| text[..at].trim().to_owned())
}

/// As much as is shown of them.
const MAX_WORDS: usize = 60;
/// Places that are looked at for the beginning of an answer.
const MOST_STARTS: usize = 20;

/// JSON with `NaN` and infinities, which Python writes and JSON has not, made words in quotes.
fn quoted(text: &str) -> String {
    let (mut quoted, mut is_string, mut is_escaped) = (String::with_capacity(text.len()), false, false);
    let mut rest = text;
    while let Some(c) = rest.chars().next() {
        let word = ["NaN", "Infinity", "-Infinity"].into_iter().find(|word| !is_string && rest.starts_with(word));
        if let Some(word) = word {
            quoted.extend(["\"", word, "\""]);
        } else {
            quoted.push(c);
        }
        is_string ^= c == '"' && !is_escaped;
        is_escaped = is_string && c == '\\' && !is_escaped;
        rest = &rest[word.map_or(c.len_utf8(), str::len)..];
    }
    quoted
}
