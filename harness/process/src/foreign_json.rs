//! JSON from outside: every text in it becomes one printable line before anything uses it.

use std::borrow::Cow;

use serde::de::DeserializeOwned;

use crate::printable;

/// Reads a value from JSON. Errors quote what they refuse: show them by [`printable::quoted`].
pub fn from_slice<T: DeserializeOwned>(json: &[u8]) -> serde_json::Result<T> {
    match str::from_utf8(json).map(printable::json) {
        Ok(Cow::Owned(cleaned)) => serde_json::from_str(&cleaned),
        // What is no UTF-8 is refused where a text is read.
        Ok(Cow::Borrowed(_)) | Err(_) => serde_json::from_slice(json),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn texts_from_outside_colour_nothing_and_begin_no_line() {
        let read: Vec<String> = from_slice(br#"["a\u001b[31mb", "c\nd", "e\r\tf", "g"]"#).unwrap();
        assert_eq!(read, ["a\u{fffd}[31mb", "c\u{fffd}d", "e\u{fffd}\u{fffd}f", "g"]);
        assert!(from_slice::<Vec<String>>(b"[\"\xff\"]").is_err());
    }
}
