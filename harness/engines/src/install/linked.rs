//! Folders that are made beside the one in use and put in its place by one rename: `venv` is a link to `venv-<hash of the lock>`.
//!
//! The link is made last, so what is half made is never used.

use std::fs;
use std::path::{Path, PathBuf};

use sha2::{Digest, Sha256};

use super::InstallError;
use luxproof_process::digest::hexadecimal;

/// The folder that a link of this name leads to, for what a lock pins.
pub(super) fn folder_name(link: &str, lock: &str) -> String {
    format!("{link}-{}", &hexadecimal(&Sha256::digest(lock))[..16])
}

/// Points the link at the folder beside it in one rename, then removes those of earlier locks.
pub(super) fn put_in_place(link: &Path, folder: &Path) -> Result<(), InstallError> {
    let (Some(root), Some(name), Some(target)) = (link.parent(), link.file_name(), folder.file_name()) else {
        return Ok(());
    };
    let name = name.to_string_lossy();
    let new = root.join(format!("{name}.new"));
    remove(&new)?;
    std::os::unix::fs::symlink(target, &new).map_err(|e| InstallError::io(&new, e))?;
    if link.symlink_metadata().is_ok_and(|m| m.is_dir()) {
        remove(link)?;
    }
    fs::rename(&new, link).map_err(|e| InstallError::io(link, e))?;
    for old in earlier(root, &format!("{name}-"), folder) {
        remove(&old)?;
    }
    Ok(())
}

fn earlier(root: &Path, prefix: &str, current: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(root).into_iter().flatten().flatten().map(|e| e.path());
    let ours = entries.filter(|p| p.file_name().is_some_and(|n| n.to_string_lossy().starts_with(prefix)));
    ours.filter(|p| p != current).collect()
}

/// Removes a file, a link (never what it points to) or a folder; fine if there is none.
pub(super) fn remove(path: &Path) -> Result<(), InstallError> {
    let removed = match path.symlink_metadata() {
        Err(_) => return Ok(()),
        Ok(m) if m.is_dir() => fs::remove_dir_all(path),
        Ok(_) => fs::remove_file(path),
    };
    removed.map_err(|e| InstallError::io(path, e))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn made(root: &Path, lock: &str) -> PathBuf {
        let folder = root.join(folder_name("packages", lock));
        fs::create_dir_all(&folder).unwrap();
        fs::write(folder.join("lock"), lock).unwrap();
        put_in_place(&root.join("packages"), &folder).unwrap();
        folder
    }

    #[test]
    fn what_is_new_takes_the_place_of_what_was_and_nothing_else_goes() {
        let (root, elsewhere) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
        fs::write(elsewhere.path().join("kept"), "").unwrap();
        fs::create_dir_all(root.path().join("venv-old")).unwrap();
        std::os::unix::fs::symlink(elsewhere.path(), root.path().join("packages")).unwrap();
        let old = made(root.path(), "1");
        fs::create_dir_all(root.path().join("packages.new")).unwrap();
        let new = made(root.path(), "2");
        assert_eq!(fs::read_to_string(root.path().join("packages/lock")).unwrap(), "2");
        assert!(new.exists() && !old.exists() && !root.path().join("packages.new").exists());
        assert!(elsewhere.path().join("kept").exists() && root.path().join("venv-old").exists());
    }
}
