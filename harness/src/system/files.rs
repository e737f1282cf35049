//! Files that are seen whole or not at all, whoever reads or is killed meanwhile.

use std::fs::{File, Metadata, Permissions};
use std::io::{self, BufReader, BufWriter, Read, Take, Write};
use std::os::unix::fs::{OpenOptionsExt, PermissionsExt};
use std::path::Path;
use std::time::Duration;

use rustix::fs::OFlags;
use serde::Serialize;
use serde_json::Serializer;
use serde_json::ser::{Formatter, PrettyFormatter};

use super::rows::Rows;

#[derive(Debug, thiserror::Error)]
#[error("{path}: {source}{}", remedy(.source))]
pub struct FileError {
    pub path: String,
    pub source: io::Error,
}

/// What can be done about it, where that is known; ends a sentence.
pub(crate) fn remedy(error: &io::Error) -> &'static str {
    // What comes out of a temporary file or a writer wraps the system's own error, and keeps its kind.
    match error.kind() {
        io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded => {
            "; make room there, and run it again: finished readings are kept"
        }
        io::ErrorKind::FileTooLarge => "; the limit of a file's size (`ulimit -f`) is too low",
        io::ErrorKind::ReadOnlyFilesystem => "; nothing can be written there: name another folder",
        io::ErrorKind::PermissionDenied => "; ask for the right to it, or name another",
        _ if is_of_device(error) => "; the disk fails: look at the system's log, or name a folder on another disk",
        _ => "",
    }
}

/// Whether a device failed (EIO), which the standard library has no name for.
fn is_of_device(error: &io::Error) -> bool {
    let eio = rustix::io::Errno::IO;
    error.raw_os_error().map_or_else(|| error.to_string().contains(&eio.to_string()), |code| code == eio.raw_os_error())
}

impl FileError {
    pub(crate) fn of(path: &Path, source: impl Into<io::Error>) -> Self {
        Self { path: path.display().to_string(), source: source.into() }
    }
}

/// The most bytes of a spec, or of a file that one names: the largest photometric files have some MB, a mesh of a million triangles 60.
pub(crate) const MAX_BYTES: u64 = 256 << 20;

/// The most bytes of a file that tells no size.
const MAX_UNTOLD_BYTES: u64 = 1 << 20;

/// A regular file of at most so many bytes, and no more than one byte beyond them of it: nothing else is opened, since a pipe waits for ever and
/// a device never ends.
fn open_bounded(path: &Path, most: u64) -> io::Result<(Take<File>, u64)> {
    let refused = |why: String| io::Error::new(io::ErrorKind::InvalidInput, why);
    let regular = |metadata: Metadata| {
        if metadata.is_file() { Ok(metadata) } else { Err(refused("it is no regular file".to_owned())) }
    };
    // Before it is opened, since that alone does something to some devices.
    std::fs::metadata(path).and_then(regular)?;
    // And after it, since a pipe may have taken its place. Nor are those files of the system waited for that say they are regular ones.
    let wait_for_none = OFlags::NONBLOCK.bits().cast_signed();
    let file = File::options().read(true).custom_flags(wait_for_none).open(path)?;
    let metadata = file.metadata().and_then(regular)?;
    // Some files tell no size: what is read counts. Those of the system have no end, so that little is read of them.
    let most = if metadata.len() == 0 { most.min(MAX_UNTOLD_BYTES) } else { most };
    if metadata.len() > most {
        return Err(too_large(most));
    }
    Ok((file.take(most + 1), most))
}

fn too_large(most: u64) -> io::Error {
    io::Error::new(io::ErrorKind::InvalidInput, format!("it has more than {} MB", most >> 20))
}

/// The bytes of a regular file of at most so many.
pub(crate) fn read_bounded(path: &Path, most: u64) -> io::Result<Vec<u8>> {
    let (mut file, most) = open_bounded(path, most)?;
    let mut bytes = vec![];
    file.read_to_end(&mut bytes)?;
    if bytes.len() as u64 <= most { Ok(bytes) } else { Err(too_large(most)) }
}

/// The most bytes of what luxproof wrote itself: a report of a million comparisons has 1.2 GB.
pub(crate) const MAX_KEPT_BYTES: u64 = 2 << 30;

/// What luxproof keeps for its user, or shows with it: reports, histories, baselines.
pub(crate) fn read_kept(path: &Path) -> Result<Vec<u8>, FileError> {
    read_bounded(path, MAX_KEPT_BYTES).map_err(|source| FileError::of(path, source))
}

/// The same, read as it is used: of a long report the text alone is a GB.
pub(crate) fn open_kept(path: &Path) -> io::Result<BufReader<Take<File>>> {
    Ok(BufReader::with_capacity(BUFFER, open_bounded(path, MAX_KEPT_BYTES)?.0))
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

/// A writer has locked its file by then.
const UNTIL_LOCKED: Duration = Duration::from_millis(50);

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

/// The same, the error with its path. What is no regular file, standard output say, is written as it is.
pub(crate) fn keep_shared(path: &Path, bytes: &[u8]) -> Result<(), FileError> {
    let is_special = std::fs::metadata(path).is_ok_and(|metadata| !metadata.is_file());
    let kept = if is_special { std::fs::write(path, bytes) } else { replace_shared(path, bytes) };
    kept.map_err(|source| FileError::of(path, source))
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
    // As long as it is locked it has a writer. That some file systems know no locks does no harm: nobody sweeps there.
    file.as_file().try_lock().ok();
    write(&mut file)?;
    if care == Care::Lasting {
        file.as_file().sync_all()?;
    }
    file.persist(path).map_err(|e| e.error)?;
    if care == Care::Lasting {
        File::open(folder)?.sync_all()?;
        sweep(folder);
    }
    Ok(())
}

/// Puts a folder that is filled by this into the place of what is there. One that is there is moved away first, so that a writer that is killed
/// may leave none, but never a part.
pub(crate) fn replace_folder(path: &Path, fill: impl FnOnce(&Path) -> io::Result<()>) -> io::Result<()> {
    let parent = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    std::fs::create_dir_all(parent)?;
    let mut shared = tempfile::Builder::new();
    shared.prefix(UNFINISHED).permissions(Permissions::from_mode(0o777));
    let new = shared.tempdir_in(parent)?;
    let lock = File::open(new.path())?;
    lock.try_lock().ok();
    fill(new.path())?;
    let old = shared.tempdir_in(parent)?;
    std::fs::rename(path, old.path().join("old")).or_else(ignore_absence)?;
    std::fs::rename(new.keep(), path)
}

/// What is not there need not go.
pub(crate) fn ignore_absence(error: io::Error) -> io::Result<()> {
    if error.kind() == io::ErrorKind::NotFound { Ok(()) } else { Err(error) }
}

/// Takes away what killed writers left in a folder: files and folders that nobody has locked any more.
pub(crate) fn sweep(folder: &Path) {
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    for entry in entries.filter(|entry| entry.file_name().to_string_lossy().starts_with(UNFINISHED)) {
        let is_left = File::open(entry.path()).is_ok_and(|file| is_old(&file) && file.try_lock().is_ok());
        match entry.file_type() {
            Ok(kind) if is_left && kind.is_file() => std::fs::remove_file(entry.path()).ok(),
            Ok(kind) if is_left && kind.is_dir() => std::fs::remove_dir_all(entry.path()).ok(),
            _ => None,
        };
    }
}

/// Whether it is there long enough for its writer to have locked it.
fn is_old(file: &File) -> bool {
    let age = file.metadata().and_then(|metadata| metadata.created().or_else(|_| metadata.modified()));
    age.is_ok_and(|then| then.elapsed().is_ok_and(|age| age >= UNTIL_LOCKED))
}

/// The same by a writer that may go back in the file.
pub(crate) fn replace_through(
    path: &Path,
    care: Care,
    write: impl FnOnce(&mut File) -> io::Result<()>,
) -> io::Result<()> {
    replace_by(&mut tempfile::Builder::new(), path, care, |file| write(file.as_file_mut()))
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_killed_writers_left_goes_and_what_is_being_written_stays() {
        let folder = tempfile::tempdir().unwrap();
        let [left, held, other] = ["left", "held", "other"].map(|name| {
            let name = if name == "other" { name.to_owned() } else { format!("{UNFINISHED}{name}") };
            folder.path().join(name)
        });
        std::fs::write(&left, "a").unwrap();
        std::fs::write(&other, "b").unwrap();
        let writer = File::create(&held).unwrap();
        writer.try_lock().unwrap();
        std::thread::sleep(2 * UNTIL_LOCKED);
        sweep(folder.path());
        assert_eq!([&left, &held, &other].map(|path| path.exists()), [false, true, true]);
    }

    #[test]
    fn a_folder_is_put_in_place_whole_or_not_at_all() {
        let root = tempfile::tempdir().unwrap();
        let path = root.path().join("pages/new");
        let fill = |text: &'static str| move |folder: &Path| std::fs::write(folder.join(text), text);
        replace_folder(&path, fill("a")).unwrap();
        let broken = replace_folder(&path, |folder| {
            fill("b")(folder)?;
            Err(io::Error::other("the disk is full"))
        });
        assert_eq!(broken.unwrap_err().to_string(), "the disk is full");
        let names = |folder: &Path| {
            let names = std::fs::read_dir(folder).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap());
            names.collect::<Vec<_>>()
        };
        assert_eq!(names(&path), ["a"]);
        replace_folder(&path, fill("c")).unwrap();
        assert_eq!((names(&path), names(path.parent().unwrap())), (vec!["c".to_owned()], vec!["new".to_owned()]));
        // What a writer left that was killed.
        let left = path.with_file_name(format!("{UNFINISHED}left"));
        std::fs::create_dir(&left).unwrap();
        fill("d")(&left).unwrap();
        std::thread::sleep(2 * UNTIL_LOCKED);
        sweep(path.parent().unwrap());
        assert_eq!(names(path.parent().unwrap()), ["new"]);
    }

    #[test]
    fn what_is_no_file_or_too_large_is_refused_and_not_read() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("large");
        // It takes no room, and would be read into memory.
        File::create(&path).unwrap().set_len(MAX_KEPT_BYTES + 1).unwrap();
        assert!(read_kept(&path).unwrap_err().to_string().contains("it has more than 2048 MB"));
        for path in ["/dev/zero", "/"] {
            assert!(read_kept(Path::new(path)).unwrap_err().to_string().contains("no regular file"), "{path}");
        }
        // These call themselves regular files of no size; the one has no end, and the other waits for the next message of the kernel.
        for path in ["/proc/self/pagemap", "/proc/kmsg"].map(Path::new).iter().filter(|path| path.exists()) {
            let (send, receive) = std::sync::mpsc::channel();
            let path = path.to_path_buf();
            std::thread::spawn(move || send.send(read_kept(&path).map(|bytes| bytes.len())));
            let read = receive.recv_timeout(Duration::from_secs(20)).expect("it is not waited for");
            assert!(read.is_err() || read.is_ok_and(|bytes| bytes <= MAX_UNTOLD_BYTES as usize));
        }
    }

    #[test]
    fn a_full_or_broken_disk_is_told_with_what_to_do() {
        use rustix::io::Errno;
        for (errno, says) in [(Errno::NOSPC, "make room"), (Errno::IO, "another disk"), (Errno::ROFS, "another folder")]
        {
            let error = io::Error::from_raw_os_error(errno.raw_os_error());
            let wrapped = io::Error::new(error.kind(), error.to_string());
            for error in [error, wrapped] {
                let told = FileError::of(Path::new("out/report.json"), error).to_string();
                assert!(told.starts_with("out/report.json: ") && told.contains(says), "{told}");
            }
        }
    }
}
