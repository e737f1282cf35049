//! An entry of the cache as text: JSON that carries its key and the SHA-256 of its content; pure.

use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use crate::engines::Measurement;
use crate::measure::outcome::{Cost, Failure};
use crate::record::ReadingKey;
use crate::spec::hexadecimal;

const FORM: u32 = 2;

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Entry {
    /// What it was first asked for; other cases may have the same job.
    #[serde(flatten)]
    pub key: ReadingKey,
    pub version: String,
    #[serde(flatten)]
    pub cost: Cost,
    pub answer: Result<Measurement, Failure>,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Form {
    luxproof_cache: u32,
    key: String,
    sha256: String,
    entry: Entry,
}

pub(super) fn text(entry: &Entry, key: &str) -> std::io::Result<String> {
    let form = Form { luxproof_cache: FORM, key: key.to_owned(), sha256: checksum(entry)?, entry: entry.clone() };
    Ok(serde_json::to_string_pretty(&form)? + "\n")
}

/// The entry of a text, which must be that of the key; the error continues a sentence that starts with the file's name.
pub(super) fn parse(text: &str, key: &str) -> Result<Entry, String> {
    let form: Form = serde_json::from_str(text).map_err(|e| format!("is cut short or no entry: {e}"))?;
    if form.luxproof_cache != FORM {
        return Err(format!("has form {} where this program knows form {FORM}", form.luxproof_cache));
    }
    if form.key != key {
        return Err(format!("is the entry of another key, {}", form.key));
    }
    let found = checksum(&form.entry).map_err(|e| e.to_string())?;
    if found != form.sha256 {
        return Err("is damaged: its checksum does not match".to_owned());
    }
    Ok(form.entry)
}

/// SHA-256 over the entry's compact JSON, in which every number has the shortest digits that give it back.
fn checksum(entry: &Entry) -> serde_json::Result<String> {
    Ok(hexadecimal(&Sha256::digest(serde_json::to_vec(entry)?)))
}
