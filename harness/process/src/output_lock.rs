//! A folder that one run at a time writes.

use std::fs::{File, OpenOptions, TryLockError};
use std::io::{self, Read, Write};
use std::os::unix::fs::OpenOptionsExt;
use std::path::Path;
use std::time::SystemTime;

use rustix::fs::OFlags;

use super::clock::timestamp;
use super::files::{self, FileError, UNFINISHED, UnsafeEntry};

/// The file that is locked; it stays, since a process that removes it removes the lock of another.
const NAME: &str = ".luxproof.lock";

/// Longest note of who holds a folder.
const NOTE: u64 = 1000;

/// Whoever has it writes the folder, nobody else; it ends with this, or with the process, however that ends.
#[derive(Debug)]
pub struct OutputLock {
    _lock: File,
}

#[derive(Debug, thiserror::Error)]
pub enum OutputLockError {
    #[error("{folder} is in use by {holder}: wait until that has ended, or name another folder with --out")]
    Taken { folder: String, holder: String },
    #[error("cannot write there: {0}")]
    File(FileError),
}

impl OutputLock {
    /// The same for a run of a stranger's specs, who may have written the folder: it holds no links and pipes, and no
    /// link leads to it.
    pub fn of_plain_folder(folder: &Path) -> Result<Self, OutputLockError> {
        match UnsafeEntry::in_or_below(folder) {
            None => Self::of(folder),
            Some(UnsafeEntry { path, what }) => {
                let message = format!("it is {what}, and the specs are not trusted");
                let error = io::Error::new(io::ErrorKind::InvalidInput, message);
                Err(OutputLockError::File(FileError::of(&path, error)))
            }
        }
    }

    /// Makes the folder if need be, and sees that it can be written.
    pub fn of(folder: &Path) -> Result<Self, OutputLockError> {
        let fail = |source: io::Error| OutputLockError::File(FileError::of(folder, source));
        std::fs::create_dir_all(folder).map_err(fail)?;
        let file = folder.join(NAME);
        // What is no file of ours, a link say, is not written.
        let mut options = OpenOptions::new();
        options.create(true).truncate(false).read(true).write(true).custom_flags(OFlags::NOFOLLOW.bits().cast_signed());
        let mut lock = options.open(&file).map_err(fail)?;
        match lock.try_lock() {
            Ok(()) => {}
            Err(TryLockError::WouldBlock) => {
                let mut holder = String::new();
                lock.take(NOTE).read_to_string(&mut holder).ok();
                let folder = folder.display().to_string();
                return Err(OutputLockError::Taken { folder, holder: holder.trim().to_owned() });
            }
            // Some file systems know no locks.
            Err(TryLockError::Error(error)) => {
                tracing::warn!(folder = %folder.display(), %error, "it cannot be locked");
            }
        }
        // What a run that was killed left: nobody else writes here.
        files::sweep(folder);
        // That an old lock is there does not say that new files can be.
        tempfile::Builder::new().prefix(UNFINISHED).tempfile_in(folder).map_err(fail)?;
        let now = timestamp(SystemTime::now());
        lock.set_len(0).map_err(fail)?;
        lock.write_all(format!("process {} since {now}\n", std::process::id()).as_bytes()).map_err(fail)?;
        Ok(Self { _lock: lock })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_folder_has_one_holder_at_a_time_and_says_who() {
        let kept = tempfile::tempdir().unwrap();
        let folder = kept.path().join("new/out");
        let claim = OutputLock::of(&folder).unwrap();
        let refused = OutputLock::of(&folder).unwrap_err().to_string();
        assert!(refused.contains(&format!("in use by process {} since 2", std::process::id())), "{refused}");
        assert!(refused.contains("--out"), "{refused}");
        drop(claim);
        drop(OutputLock::of(&folder).unwrap());
        assert!(matches!(OutputLock::of(&folder.join(NAME).join("below")), Err(OutputLockError::File(_))));
    }
}
