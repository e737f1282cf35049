//! Precomputed data of a scene, which later jobs with other meters or numbers of reflections reuse.

use std::time::SystemTime;

use super::{Cache, Key};
use luxproof_process::envelope::{self, Schema};
use luxproof_process::files;

const SCHEMA: Schema = Schema { of: "cache precompute", version: 1 };

/// The extension of such files.
pub(super) const EXTENSION: &str = "precompute";

/// The largest size, in numbers; larger data takes too much room.
const MAX_NUMBERS: usize = 1_000_000;

/// Whether the cache accepts the numbers.
pub fn is_worth_keeping(numbers: &[f64]) -> bool {
    numbers.len() < MAX_NUMBERS && numbers.iter().all(|number| number.is_finite())
}

impl Cache {
    /// The precomputed data of a key.
    pub fn shared_precompute(&self, key: &Key) -> Option<Vec<f64>> {
        let path = self.path(key).with_extension(EXTENSION);
        let text = files::read_bounded(&path, files::MAX_BYTES).ok()?;
        let numbers = envelope::open::<Vec<f64>>(SCHEMA, &text).and_then(|sealed| sealed.about(&key.digits)).ok()?;
        // Marks the file as used today; only pruning needs the date, so an error does not matter.
        std::fs::File::open(&path).and_then(|f| f.set_modified(SystemTime::now())).ok();
        Some(numbers)
    }

    /// Stores precomputed data under a key.
    pub fn store_precompute(&self, key: &Key, numbers: &[f64]) -> std::io::Result<()> {
        if !is_worth_keeping(numbers) {
            return Ok(());
        }
        let text = envelope::seal(SCHEMA, &key.digits, numbers)? + "\n";
        files::replace(&self.path(key).with_extension(EXTENSION), text.as_bytes())
    }
}
