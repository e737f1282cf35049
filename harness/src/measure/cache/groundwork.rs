//! What an engine found that other jobs need, too: kept beside its readings, so that another meter or number of reflections need not find it again.

use std::time::SystemTime;

use super::{Cache, Key};
use crate::system::envelope::{self, Schema};
use crate::system::files;

const SCHEMA: Schema = Schema { of: "cache groundwork", version: 1 };

/// How the names of such files end.
pub(super) const EXTENSION: &str = "groundwork";

/// More take too much room.
const MOST: usize = 1_000_000;

pub fn is_worth_keeping(numbers: &[f64]) -> bool {
    numbers.len() < MOST && numbers.iter().all(|number| number.is_finite())
}

impl Cache {
    pub fn groundwork(&self, key: &Key) -> Option<Vec<f64>> {
        let path = self.path(key).with_extension(EXTENSION);
        let text = files::read_bounded(&path, files::MAX_BYTES).ok()?;
        let numbers = envelope::open::<Vec<f64>>(SCHEMA, &text).and_then(|sealed| sealed.about(&key.digits)).ok()?;
        // As for entries: only pruning asks.
        std::fs::File::open(&path).and_then(|f| f.set_modified(SystemTime::now())).ok();
        Some(numbers)
    }

    pub fn keep_groundwork(&self, key: &Key, numbers: &[f64]) -> std::io::Result<()> {
        if !is_worth_keeping(numbers) {
            return Ok(());
        }
        let text = envelope::seal(SCHEMA, &key.digits, numbers)? + "\n";
        files::replace(&self.path(key).with_extension(EXTENSION), text.as_bytes())
    }
}
