//! The cache: readings under the hash of everything that they depend on, so that nothing is rendered twice.
//!
//! An entry is one file whose name is its key. It is written beside its place and renamed into it, so that a reader sees all
//! of it or nothing whenever the writer is killed, and lies in an envelope, so that what was damaged since is found out and read anew. Any number of runs may share a cache: whoever comes last replaces an entry by an equally good one.

mod entry;
mod groundwork;
mod key;
mod listed;
mod upkeep;

#[cfg(test)]
mod tests;

use std::path::{Path, PathBuf};

use super::outcome::{Cost, Failure};
use crate::system::files;

pub use entry::Entry;
pub use groundwork::is_worth_keeping;
pub(super) use key::key_without_meters;
pub use key::{Key, key};
pub(super) use listed::bits;
pub use upkeep::{Contents, Pruned};

#[derive(Clone, Debug)]
pub struct Cache {
    root: PathBuf,
}

#[derive(Clone, Debug, PartialEq)]
pub enum Lookup {
    Found(Box<Entry>),
    Unknown,
    /// A file that is no sound entry of this key, and what is wrong with it.
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

    /// Looks a key up; an entry that was found counts as used today.
    pub fn find(&self, key: &Key) -> Lookup {
        let path = self.path(key);
        let text = match files::read_bounded(&path, files::MAX_BYTES) {
            Ok(text) => text,
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Lookup::Unknown,
            Err(error) => return Lookup::Damaged(format!("{} cannot be read: {error}", path.display())),
        };
        match entry::parse(&text, &key.digits) {
            Ok(entry) => {
                // Only pruning asks when an entry was used last: not to know is no reason to fail.
                std::fs::File::open(&path).and_then(|f| f.set_modified(std::time::SystemTime::now())).ok();
                Lookup::Found(Box::new(entry))
            }
            Err(why) => Lookup::Damaged(format!("{} {why}", path.display())),
        }
    }

    /// What came of a key, be it a failure that was taken for the answer.
    pub fn outcome(&self, key: &Key) -> Option<Result<Cost, Failure>> {
        let found = |key: &Key| match self.find(key) {
            Lookup::Found(entry) => Some(entry.answer.map(|_| entry.cost)),
            Lookup::Unknown | Lookup::Damaged(_) => None,
        };
        found(key).or_else(|| found(&key.of_failure()))
    }

    /// Takes away what writers left that were killed.
    pub fn sweep(&self) {
        for folder in std::fs::read_dir(&self.root).into_iter().flatten().flatten() {
            files::sweep(&folder.path());
        }
    }

    pub fn keep(&self, key: &Key, entry: &Entry) -> std::io::Result<()> {
        files::replace(&self.path(key), entry::text(entry, &key.digits)?.as_bytes())
    }
}
