//! The cache: readings under the hash of everything that they depend on, so that nothing is rendered twice.
//!
//! An entry is one file, and its name is the key. It is written under another name and renamed, so that a reader sees
//! all of it or nothing, even when the writer is killed. Its envelope reveals later damage, and the engine then reads
//! again. Any number of runs may share a cache: the last one replaces an entry by an equivalent one.

mod entry;
mod key;
mod meter_list;
mod shared_precompute;
mod upkeep;

#[cfg(test)]
mod tests;

use std::path::{Path, PathBuf};

use super::outcome::{Cost, Failure};
use luxproof_process::files;

pub use entry::Entry;
pub(super) use key::key_without_meters;
pub use key::{Key, key};
pub(super) use meter_list::bits;
pub use shared_precompute::is_worth_keeping;
pub use upkeep::{Contents, Pruned};

/// A folder of readings.
#[derive(Clone, Debug)]
pub struct Cache {
    root: PathBuf,
}

/// The result of a look-up.
#[derive(Clone, Debug, PartialEq)]
pub enum Lookup {
    Found(Box<Entry>),
    Unknown,
    /// A file that is no valid entry of this key, and what is wrong with it.
    Damaged(String),
}

impl Cache {
    /// The cache in a given folder, which need not exist yet.
    pub fn at(root: impl Into<PathBuf>) -> Self {
        Self { root: root.into() }
    }

    pub fn root(&self) -> &Path {
        &self.root
    }

    pub fn path(&self, key: &Key) -> PathBuf {
        self.root.join(&key.engine).join(&key.digits).with_extension("json")
    }

    /// Looks up a key and marks its entry as used today.
    pub fn find(&self, key: &Key) -> Lookup {
        let path = self.path(key);
        let text = match files::read_bounded(&path, files::MAX_BYTES) {
            Ok(text) => text,
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Lookup::Unknown,
            Err(error) => return Lookup::Damaged(format!("{} cannot be read: {error}", path.display())),
        };
        match entry::parse(&text, &key.digits) {
            Ok(entry) => {
                // Only pruning needs the date, so an error does not matter.
                std::fs::File::open(&path).and_then(|f| f.set_modified(std::time::SystemTime::now())).ok();
                Lookup::Found(Box::new(entry))
            }
            Err(why) => Lookup::Damaged(format!("{} {why}", path.display())),
        }
    }

    /// The cost of a reading, or the failure that was stored as its answer.
    pub fn outcome(&self, key: &Key) -> Option<Result<Cost, Failure>> {
        self.stored_outcome(key).or_else(|| self.stored_outcome(&key.of_failure()))
    }

    /// The cost or the failure of the entry under exactly this key.
    fn stored_outcome(&self, key: &Key) -> Option<Result<Cost, Failure>> {
        match self.find(key) {
            Lookup::Found(entry) => Some(entry.answer.map(|_| entry.cost)),
            Lookup::Unknown | Lookup::Damaged(_) => None,
        }
    }

    /// Deletes the unfinished files of writers that were killed.
    pub fn sweep(&self) {
        for folder in std::fs::read_dir(&self.root).into_iter().flatten().flatten() {
            files::sweep(&folder.path());
        }
    }

    /// Stores an entry under a key.
    pub fn keep(&self, key: &Key, entry: &Entry) -> std::io::Result<()> {
        files::replace(&self.path(key), entry::text(entry, &key.digits)?.as_bytes())
    }
}
