//! Files that are seen whole or not at all, whoever reads or is killed meanwhile.

use std::io::{self, Write};
use std::path::Path;

use serde::Serialize;

/// How the names of files begin that are not finished.
pub(crate) const UNFINISHED: &str = ".unfinished-";

/// Puts a file with these bytes into the place of what is there; its folder is made if need be.
pub(crate) fn replace(path: &Path, bytes: &[u8]) -> io::Result<()> {
    let folder = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    std::fs::create_dir_all(folder)?;
    let mut file = tempfile::Builder::new().prefix(UNFINISHED).tempfile_in(folder)?;
    file.write_all(bytes)?;
    file.persist(path).map_err(|e| e.error)?;
    Ok(())
}

/// The same with a value as JSON for people, a line feed at its end.
pub(crate) fn replace_json<T: Serialize>(path: &Path, value: &T) -> io::Result<()> {
    let mut bytes = serde_json::to_vec_pretty(value)?;
    bytes.push(b'\n');
    replace(path, &bytes)
}
