//! The one envelope of everything that is kept between runs: what kind of file it is, what it is about, and a checksum.
//!
//! `{"schema": "luxproof baseline 2", "key": "office", "checksum": "<SHA-256>", "body": ...}`, a file or, where a file only grows, a
//! line. The checksum is that of the body's text without the white space between its parts, so that a formatter may lay it
//! out anew. What was torn, edited, moved to another name or written in another form is refused, each with what it is. The
//! checksum finds accidents and slips of the hand; it is no signature.

use std::borrow::Cow;
use std::fmt;

use serde::{Deserialize, Serialize};
use serde_json::value::RawValue;
use sha2::{Digest, Sha256};

use super::digest::hexadecimal;

/// A kind of file and the version of its form.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Schema {
    pub of: &'static str,
    pub version: u32,
}

impl fmt::Display for Schema {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "luxproof {} {}", self.of, self.version)
    }
}

/// Why something that was kept is not what it should be; continues a sentence that starts with the file's name.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Refusal {
    #[error("is cut short or nothing that luxproof keeps: {0}")]
    Form(String),
    #[error("is a `{found}` where this luxproof reads `{known}`")]
    Schema { found: String, known: String },
    #[error("is about `{found}` where `{wanted}` was asked for: it was moved or renamed")]
    Key { found: String, wanted: String },
    #[error("is damaged or was edited: its checksum does not match")]
    Checksum,
    #[error("has a whole body of another form: {0}")]
    Body(String),
}

#[derive(Serialize, Deserialize)]
struct Envelope<'a> {
    schema: Cow<'a, str>,
    key: Cow<'a, str>,
    checksum: Cow<'a, str>,
    #[serde(borrow)]
    body: &'a RawValue,
}

/// Whole and of its schema; it is opened by saying what it should be about.
#[derive(Debug)]
#[must_use]
pub struct Sealed<T> {
    key: String,
    body: T,
}

impl<T> Sealed<T> {
    /// The body, which must be about this.
    pub fn about(self, key: &str) -> Result<T, Refusal> {
        self.about_what(|_| key.to_owned())
    }

    /// The body, which must be about what it says itself.
    pub fn about_what(self, key: impl FnOnce(&T) -> String) -> Result<T, Refusal> {
        let wanted = key(&self.body);
        if self.key == wanted { Ok(self.body) } else { Err(Refusal::Key { found: self.key, wanted }) }
    }
}

/// A body in its envelope, on one line without its end.
pub fn seal<T: Serialize + ?Sized>(schema: Schema, key: &str, body: &T) -> serde_json::Result<String> {
    seal_text(schema, key, serde_json::to_string(body)?)
}

/// The same with a body that is JSON already, laid out for people.
pub fn seal_text(schema: Schema, key: &str, body: String) -> serde_json::Result<String> {
    let checksum = checksum(&body);
    let body = RawValue::from_string(body)?;
    serde_json::to_string(&Envelope {
        schema: schema.to_string().into(),
        key: key.into(),
        checksum: checksum.into(),
        body: &body,
    })
}

/// How every envelope of this schema and key begins, as it was written.
pub fn head(schema: Schema, key: &str) -> String {
    let [schema, key] = [&schema.to_string(), key].map(serde_json::Value::from);
    format!("{{\"schema\":{schema},\"key\":{key},")
}

/// What an envelope of this schema holds, if it is whole.
pub fn open<'a, T: Deserialize<'a>>(schema: Schema, text: &'a [u8]) -> Result<Sealed<T>, Refusal> {
    let envelope: Envelope<'a> = serde_json::from_slice(text).map_err(|e| Refusal::Form(e.to_string()))?;
    if envelope.schema != schema.to_string() {
        return Err(Refusal::Schema { found: envelope.schema.into_owned(), known: schema.to_string() });
    }
    let body = envelope.body.get();
    if checksum(body) != envelope.checksum {
        return Err(Refusal::Checksum);
    }
    let read = serde_json::from_str(body).map_err(|e| Refusal::Body(e.to_string()))?;
    Ok(Sealed { key: envelope.key.into_owned(), body: read })
}

/// SHA-256 over JSON less the white space outside its strings.
pub fn checksum(json: &str) -> String {
    let mut sum = Checksum::default();
    sum.update(json.as_bytes());
    sum.finish()
}

/// The same of a text that comes in pieces.
#[derive(Default)]
pub struct Checksum {
    hash: Sha256,
    is_string: bool,
    is_escaped: bool,
}

impl Checksum {
    pub fn update(&mut self, json: &[u8]) {
        let mut start = 0;
        for (at, byte) in json.iter().enumerate() {
            if !self.is_string && byte.is_ascii_whitespace() {
                self.hash.update(&json[start..at]);
                start = at + 1;
            }
            self.is_string ^= *byte == b'"' && !self.is_escaped;
            self.is_escaped = self.is_string && *byte == b'\\' && !self.is_escaped;
        }
        self.hash.update(&json[start..]);
    }

    pub fn finish(self) -> String {
        hexadecimal(&self.hash.finalize())
    }
}

/// Every single bit of a text flipped, and the text cut at every place but its end.
pub fn damaged(sound: &[u8]) -> impl Iterator<Item = Vec<u8>> {
    let flipped = (0..8 * sound.len()).map(|k| {
        let mut bytes = sound.to_vec();
        bytes[k / 8] ^= 1 << (k % 8);
        bytes
    });
    flipped.chain((0..sound.len()).map(|end| sound[..end].to_vec()))
}

#[cfg(test)]
pub mod tests {
    use super::*;

    const SCHEMA: Schema = Schema { of: "note", version: 3 };

    fn opened(text: &[u8], key: &str) -> Result<Vec<String>, Refusal> {
        open(SCHEMA, text)?.about(key)
    }

    #[test]
    fn what_is_laid_out_anew_is_the_same_and_white_space_in_strings_is_not() {
        let body = vec!["a \" b\\".to_owned(), "\t".to_owned()];
        let text = seal(SCHEMA, "mine", &body).unwrap();
        let start = r#"{"schema":"luxproof note 3","key":"mine","checksum":""#;
        assert!(text.starts_with(start) && start.starts_with(&head(SCHEMA, "mine")), "{text}");
        assert_eq!(opened(text.as_bytes(), "mine").unwrap(), body);
        let value: serde_json::Value = serde_json::from_str(&text).unwrap();
        let pretty = serde_json::to_vec_pretty(&value).unwrap();
        assert_eq!(opened(&pretty, "mine").unwrap(), body);
        assert_eq!(opened(text.replace("a \\\"", "a  \\\"").as_bytes(), "mine"), Err(Refusal::Checksum));
    }

    #[test]
    fn no_flipped_bit_and_no_cut_is_ever_taken_for_what_was_kept() {
        let body = vec!["one".to_owned(), "two".to_owned()];
        let text = seal(SCHEMA, "mine", &body).unwrap();
        for bytes in damaged(text.as_bytes()) {
            assert!(opened(&bytes, "mine").is_err(), "{}", String::from_utf8_lossy(&bytes));
        }
    }

    #[test]
    fn each_refusal_says_what_it_is() {
        let text = |version, key| seal(Schema { version, ..SCHEMA }, key, &["x"]).unwrap();
        let says = |text: &str| opened(text.as_bytes(), "mine").unwrap_err().to_string();
        assert_eq!(says(&text(4, "mine")), "is a `luxproof note 4` where this luxproof reads `luxproof note 3`");
        assert!(says(&text(3, "other")).starts_with("is about `other` where `mine` was asked for"));
        assert!(says(&text(3, "mine").replace("\"x\"", "\"y\"")).contains("was edited"));
        assert!(says("{}").contains("missing field"));
        assert!(says(&seal(SCHEMA, "mine", &1).unwrap()).contains("another form"));
        // What a later form adds is reported as another schema, not as damage.
        let later = text(4, "mine").replacen('{', "{\"more\":1,", 1);
        assert!(says(&later).starts_with("is a `luxproof note 4`"));
    }
}
