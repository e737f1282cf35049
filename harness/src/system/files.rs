//! Files that are seen whole or not at all, whoever reads or is killed meanwhile.

use std::fs::{File, Permissions};
use std::io::{self, BufWriter, Read, Write};
use std::os::unix::fs::PermissionsExt;
use std::path::Path;

use serde::Serialize;
use serde_json::Serializer;
use serde_json::ser::{Formatter, PrettyFormatter};

use super::rows::Rows;

#[derive(Debug, thiserror::Error)]
#[error("{path}: {source}")]
pub struct FileError {
    pub path: String,
    pub source: io::Error,
}

impl FileError {
    pub(crate) fn of(path: &Path, source: impl Into<io::Error>) -> Self {
        Self { path: path.display().to_string(), source: source.into() }
    }
}

/// The most bytes of a spec, or of a file that one names: the largest photometric files have some MB, a mesh of a million triangles 60.
pub(crate) const MAX_BYTES: u64 = 256 << 20;

/// The bytes of a regular file of at most so many: nothing else is opened, since a pipe waits for ever and a device never ends.
pub(crate) fn read_bounded(path: &Path, most: u64) -> io::Result<Vec<u8>> {
    let refused = |why: String| io::Error::new(io::ErrorKind::InvalidInput, why);
    if !std::fs::metadata(path)?.is_file() {
        return Err(refused("it is no regular file".to_owned()));
    }
    let mut bytes = vec![];
    // Some files tell no size: what is read counts.
    File::open(path)?.take(most + 1).read_to_end(&mut bytes)?;
    let is_whole = bytes.len() as u64 <= most;
    is_whole.then_some(bytes).ok_or_else(|| refused(format!("it has more than {} MB", most >> 20)))
}

/// Reads what a path stands for, wherever links lead, if that lies below a folder.
pub(crate) fn read_below(folder: &Path, path: &Path, most: u64) -> io::Result<Vec<u8>> {
    let folder = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
    let real = path.canonicalize()?;
    if !real.starts_with(folder.canonicalize()?) {
        return Err(io::Error::new(io::ErrorKind::PermissionDenied, "it does not lie below the spec's folder"));
    }
    read_bounded(&real, most)
}

/// How the names of files begin that are not finished.
pub(crate) const UNFINISHED: &str = ".unfinished-";

/// Bytes that are written at a time.
const BUFFER: usize = 1 << 16;

/// What a machine that stops at once may take with it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Care {
    /// The file: what it holds can be had again.
    Usual,
    /// Nothing: it is on the disk before it takes the place of what was there.
    Lasting,
}

/// Puts a file with these bytes into the place of what is there; its folder is made if need be.
pub(crate) fn replace(path: &Path, bytes: &[u8]) -> io::Result<()> {
    replace_by(&mut tempfile::Builder::new(), path, Care::Usual, |file| file.write_all(bytes))
}

/// The same for what cannot be had again.
pub(crate) fn replace_lastingly(path: &Path, bytes: &[u8]) -> io::Result<()> {
    replace_by(&mut tempfile::Builder::new(), path, Care::Lasting, |file| file.write_all(bytes))
}

/// The same for a file that others are to read: with the permissions that the user gives to new files.
pub(crate) fn replace_shared(path: &Path, bytes: &[u8]) -> io::Result<()> {
    // The system takes off what the user's mask forbids.
    let mut shared = tempfile::Builder::new();
    shared.permissions(Permissions::from_mode(0o666));
    replace_by(&mut shared, path, Care::Lasting, |file| file.write_all(bytes))
}

fn replace_by(
    builder: &mut tempfile::Builder<'_, '_>,
    path: &Path,
    care: Care,
    write: impl FnOnce(&mut tempfile::NamedTempFile) -> io::Result<()>,
) -> io::Result<()> {
    let folder = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    std::fs::create_dir_all(folder)?;
    let mut file = builder.prefix(UNFINISHED).tempfile_in(folder)?;
    write(&mut file)?;
    if care == Care::Usual {
        return file.persist(path).map(drop).map_err(|e| e.error);
    }
    file.as_file().sync_all()?;
    file.persist(path).map_err(|e| e.error)?;
    File::open(folder)?.sync_all()
}

/// The same with a value as JSON for people, a line feed at its end.
pub(crate) fn replace_json<T: Serialize>(path: &Path, value: &T, care: Care) -> io::Result<()> {
    replace_by(&mut tempfile::Builder::new(), path, care, |file| written(file, value, PrettyFormatter::new()))
}

/// The same, the error with its path.
pub(crate) fn keep_json<T: Serialize>(path: &Path, value: &T) -> Result<(), FileError> {
    replace_json(path, value, Care::Usual).map_err(|source| FileError::of(path, source))
}

/// The same with an item of a list a line, for what is too long to be read.
pub(crate) fn replace_rows<T: Serialize>(path: &Path, value: &T, care: Care) -> io::Result<()> {
    replace_by(&mut tempfile::Builder::new(), path, care, |file| written(file, value, Rows::new()))
}

/// As it is made: a report of 1e5 meters is some 100 MB.
fn written(file: &mut tempfile::NamedTempFile, value: &impl Serialize, layout: impl Formatter) -> io::Result<()> {
    let mut writer = BufWriter::with_capacity(BUFFER, file);
    value.serialize(&mut Serializer::with_formatter(&mut writer, layout))?;
    writer.write_all(b"\n")?;
    writer.flush()
}
