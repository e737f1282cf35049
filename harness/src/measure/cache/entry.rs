//! An entry of the cache as text, in its envelope; pure.

use serde::{Deserialize, Serialize};

use crate::engines::Measurement;
use crate::measure::outcome::{Cost, Failure};
use crate::record::ReadingKey;
use crate::system::envelope::{self, Refusal, Schema};

const SCHEMA: Schema = Schema { of: "cache entry", version: 3 };

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

pub(super) fn text(entry: &Entry, key: &str) -> std::io::Result<String> {
    Ok(envelope::seal(SCHEMA, key, entry)? + "\n")
}

/// The entry of a text, which must be that of the key.
pub(super) fn parse(text: &[u8], key: &str) -> Result<Entry, Refusal> {
    envelope::open(SCHEMA, text)?.about(key)
}
