//! A cache entry and its text form.

use serde::{Deserialize, Serialize};

use crate::measure::outcome::{Cost, Failure};
use luxproof_engines::Measurement;
use luxproof_model::ReadingKey;
use luxproof_process::envelope::{self, Refusal, Schema};

const SCHEMA: Schema = Schema { of: "cache entry", version: 3 };

/// An answer of an engine, as the cache stores it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Entry {
    /// The reading that was first requested; other cases may have the same job.
    #[serde(flatten)]
    pub key: ReadingKey,
    pub version: String,
    #[serde(flatten)]
    pub cost: Cost,
    pub answer: Result<Measurement, Failure>,
}

/// The text of an entry, in an envelope with its key.
pub(super) fn text(entry: &Entry, key: &str) -> std::io::Result<String> {
    Ok(envelope::seal(SCHEMA, key, entry)? + "\n")
}

/// Parses an entry and checks that it belongs to the key.
pub(super) fn parse(text: &[u8], key: &str) -> Result<Entry, Refusal> {
    envelope::open(SCHEMA, text)?.about(key)
}
