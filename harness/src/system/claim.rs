//! A folder that one run at a time writes.

use std::fs::{File, OpenOptions, TryLockError};
use std::io::{self, Read, Write};
use std::path::Path;
use std::time::SystemTime;

use super::files::{self, FileError, UNFINISHED};

/// The file that is locked; it stays, since whoever takes it away takes the lock of another with it.
const NAME: &str = ".luxproof.lock";

/// Longest note of who holds a folder.
const NOTE: u64 = 1000;

/// Whoever has it writes the folder, nobody else; it ends with this, or with the process, however that ends.
#[derive(Debug)]
pub struct Claim {
    _lock: File,
}

#[derive(Debug, thiserror::Error)]
pub enum ClaimError {
    #[error("{folder} is in use by {holder}: wait until that has ended, or name another folder with --out")]
    Taken { folder: String, holder: String },
    #[error("cannot write there: {0}")]
    File(FileError),
}

impl Claim {
    /// Makes the folder if need be, and sees that it can be written.
    pub fn of(folder: &Path) -> Result<Self, ClaimError> {
        let fail = |source: io::Error| ClaimError::File(FileError::of(folder, source));
        std::fs::create_dir_all(folder).map_err(fail)?;
        let file = folder.join(NAME);
        let mut lock =
            OpenOptions::new().create(true).truncate(false).read(true).write(true).open(&file).map_err(fail)?;
        match lock.try_lock() {
            Ok(()) => {}
            Err(TryLockError::WouldBlock) => {
                let mut holder = String::new();
                lock.take(NOTE).read_to_string(&mut holder).ok();
                let folder = folder.display().to_string();
                return Err(ClaimError::Taken { folder, holder: holder.trim().to_owned() });
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
        let now = humantime::format_rfc3339_seconds(SystemTime::now());
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
        let claim = Claim::of(&folder).unwrap();
        let refused = Claim::of(&folder).unwrap_err().to_string();
        assert!(refused.contains(&format!("in use by process {} since 2", std::process::id())), "{refused}");
        assert!(refused.contains("--out"), "{refused}");
        drop(claim);
        drop(Claim::of(&folder).unwrap());
        assert!(matches!(Claim::of(&folder.join(NAME).join("below")), Err(ClaimError::File(_))));
    }
}
