//! Reads files within bounds, and replaces files so that readers see the old or the new one whole.

use std::ffi::OsString;
use std::fs::{File, Metadata, Permissions};
use std::io::{self, BufReader, BufWriter, Read, Take, Write};
use std::os::unix::fs::{OpenOptionsExt, PermissionsExt};
use std::path::{Component, Path, PathBuf};
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

/// The remedy for an error, where one is known; it ends a sentence.
pub fn remedy(error: &io::Error) -> &'static str {
    // Errors of temporary files and writers wrap the system's error and keep its kind.
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
    pub fn of(path: &Path, source: impl Into<io::Error>) -> Self {
        Self { path: path.display().to_string(), source: source.into() }
    }
}

/// The most bytes of a spec, or of a file that one names: the largest photometric files have some MB, a mesh of a million triangles 60.
pub const MAX_BYTES: u64 = 256 << 20;

/// The most bytes of a file that reports size 0.
const MAX_UNSIZED_BYTES: u64 = 1 << 20;

/// Opens a regular file for reading.
///
/// Pipes and devices are refused, since a pipe may wait for ever and a device may never end.
pub fn open_regular(path: &Path) -> io::Result<(File, Metadata)> {
    // The first check comes before opening: opening some devices has an effect.
    std::fs::metadata(path).and_then(require_regular)?;
    // NONBLOCK: some files of the system claim to be regular, and reading them would wait.
    let nonblocking = OFlags::NONBLOCK.bits().cast_signed();
    let file = File::options().read(true).custom_flags(nonblocking).open(path)?;
    // The second check comes after opening: a pipe may have replaced the file.
    let metadata = file.metadata().and_then(require_regular)?;
    Ok((file, metadata))
}

/// Opens a regular file of at most `most` bytes, and limits reading to one byte more.
fn open_bounded(path: &Path, most: u64) -> io::Result<(Take<File>, u64)> {
    let (file, metadata) = open_regular(path)?;
    // Files of the system report size 0 and may have no end.
    let most = if metadata.len() == 0 { most.min(MAX_UNSIZED_BYTES) } else { most };
    if metadata.len() > most {
        return Err(too_large(most));
    }
    Ok((file.take(most + 1), most))
}

/// Refuses anything but a regular file.
fn require_regular(metadata: Metadata) -> io::Result<Metadata> {
    if metadata.is_file() {
        Ok(metadata)
    } else {
        Err(io::Error::new(io::ErrorKind::InvalidInput, "it is no regular file"))
    }
}

/// The error for a file of more bytes than allowed.
fn too_large(most: u64) -> io::Error {
    io::Error::new(io::ErrorKind::InvalidInput, format!("it has more than {} MB", most >> 20))
}

/// The bytes of a regular file of at most so many.
pub fn read_bounded(path: &Path, most: u64) -> io::Result<Vec<u8>> {
    let (mut file, most) = open_bounded(path, most)?;
    let mut bytes = vec![];
    file.read_to_end(&mut bytes)?;
    if bytes.len() as u64 <= most { Ok(bytes) } else { Err(too_large(most)) }
}

/// The most bytes of what luxproof wrote itself: a report of a million comparisons has 1.2 GB.
pub const MAX_KEPT_BYTES: u64 = 2 << 30;

/// What luxproof keeps for its user, or shows with it: reports, histories, baselines.
pub fn read_stored(path: &Path) -> Result<Vec<u8>, FileError> {
    read_bounded(path, MAX_KEPT_BYTES).map_err(|source| FileError::of(path, source))
}

/// The same, read as it is used: of a long report the text alone is a GB.
pub fn open_stored(path: &Path) -> io::Result<BufReader<Take<File>>> {
    Ok(BufReader::with_capacity(BUFFER, open_bounded(path, MAX_KEPT_BYTES)?.0))
}

/// Reads what a path stands for, wherever links lead, if that lies below a folder.
pub fn read_below(folder: &Path, path: &Path, most: u64) -> io::Result<Vec<u8>> {
    let Some(real) = real_below(folder, path)? else {
        return Err(io::Error::new(io::ErrorKind::PermissionDenied, "it does not lie below the spec's folder"));
    };
    read_bounded(&real, most)
}

/// What a path stands for, wherever links lead; `None` where that does not lie below a folder.
pub fn real_below(folder: &Path, path: &Path) -> io::Result<Option<PathBuf>> {
    let folder = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
    let real = path.canonicalize()?;
    Ok(real.starts_with(folder.canonicalize()?).then_some(real))
}

/// A path from the root of the file system as it is written, without `.` and `..`.
pub fn clean(path: &Path) -> PathBuf {
    // `absolute` refuses an empty path, which stands for the current folder.
    let whole = std::path::absolute(path).unwrap_or_else(|_| std::env::current_dir().unwrap_or_default().join(path));
    whole.components().fold(PathBuf::new(), |mut clean, part| {
        match part {
            Component::ParentDir => drop(clean.pop()),
            Component::CurDir => {}
            part => clean.push(part),
        }
        clean
    })
}

/// The file that a path names in which what is no UTF-8 was replaced, as a report has it: the path itself where that is there or no other is.
pub fn found_again(path: &Path) -> PathBuf {
    let is_replaced = path.to_str().is_some_and(|text| text.contains(char::REPLACEMENT_CHARACTER));
    if !is_replaced || path.exists() {
        return path.to_owned();
    }
    let mut found = PathBuf::new();
    for part in path.components() {
        let next = found.join(part);
        let folder = if found.as_os_str().is_empty() { Path::new(".") } else { &found };
        found = match next.symlink_metadata() {
            Err(_) => entry_shown_as(folder, part).map_or(next, |name| found.join(name)),
            Ok(_) => next,
        };
    }
    found
}

/// The name of a folder's entry that a report shows as this part of a path.
fn entry_shown_as(folder: &Path, part: Component<'_>) -> Option<OsString> {
    let shown = part.as_os_str().to_string_lossy();
    let names = folder.read_dir().into_iter().flatten().flatten().map(|entry| entry.file_name());
    names.into_iter().find(|name| name.to_string_lossy() == shown)
}

/// The name of a file without its ending, for a folder's name: `None` where that would lead elsewhere, as of `...rad`.
pub fn stem(path: &Path) -> Option<&Path> {
    let stem = Path::new(path.file_stem()?);
    matches!(stem.components().collect::<Vec<_>>()[..], [Component::Normal(_)]).then_some(stem)
}

/// The first part of a path that is a link. A path from here is looked at behind its leading `..`, another from the current folder on where it
/// lies below that, else its file and the folder of that alone.
pub fn link_in(path: &Path) -> Option<PathBuf> {
    let (whole, here) = (clean(path), std::env::current_dir().unwrap_or_default());
    let up = path.components().take_while(|part| matches!(part, Component::ParentDir | Component::CurDir));
    let top = match path.is_relative() {
        true => clean(&up.collect::<PathBuf>()),
        false if whole.starts_with(&here) => here,
        false => whole.parent().and_then(Path::parent).map(Path::to_owned).unwrap_or_default(),
    };
    let below = whole.strip_prefix(&top).ok()?;
    let mut parts: Vec<PathBuf> =
        below.ancestors().filter(|part| !part.as_os_str().is_empty()).map(|part| top.join(part)).collect();
    parts.reverse();
    parts.into_iter().find(|part| std::fs::symlink_metadata(part).is_ok_and(|metadata| metadata.is_symlink()))
}

/// An entry of a folder that a writer must not touch: a link leads elsewhere, a pipe may wait for ever.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct UnsafeEntry {
    pub path: PathBuf,
    /// What it is: `a link`, or `no regular file`.
    pub what: &'static str,
}

impl UnsafeEntry {
    /// The first one on the way to a folder or anywhere below it, where a stranger may have written.
    pub fn in_or_below(folder: &Path) -> Option<Self> {
        link_in(folder).map(Self::link).or_else(|| Self::below(folder))
    }

    fn below(folder: &Path) -> Option<Self> {
        let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
        entries.into_iter().find_map(|entry| match entry.file_type() {
            Ok(kind) if kind.is_symlink() => Some(Self::link(entry.path())),
            Ok(kind) if kind.is_dir() => Self::below(&entry.path()),
            Ok(kind) if !kind.is_file() => Some(Self { path: entry.path(), what: "no regular file" }),
            _ => None,
        })
    }

    const fn link(path: PathBuf) -> Self {
        Self { path, what: "a link" }
    }
}

/// How the names of files begin that are not finished.
pub const UNFINISHED: &str = ".unfinished-";

/// The time within which a writer locks its new file.
const LOCK_GRACE: Duration = Duration::from_millis(50);

/// Bytes that are written at a time.
const BUFFER: usize = 1 << 16;

/// What a machine that stops at once may take with it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Durability {
    /// The file: what it holds can be had again.
    Usual,
    /// Nothing: it is on the disk before it takes the place of what was there.
    Lasting,
}

/// Puts a file with these bytes into the place of what is there; its folder is made if need be.
pub fn replace(path: &Path, bytes: &[u8]) -> io::Result<()> {
    replace_by(&mut tempfile::Builder::new(), path, Durability::Usual, |file| file.write_all(bytes))
}

/// The same for what cannot be had again.
pub fn replace_lastingly(path: &Path, bytes: &[u8]) -> io::Result<()> {
    replace_by(&mut tempfile::Builder::new(), path, Durability::Lasting, |file| file.write_all(bytes))
}

/// The same for a file that others are to read: with the permissions that the user gives to new files.
pub fn replace_shared(path: &Path, bytes: &[u8]) -> io::Result<()> {
    // The system takes off what the user's mask forbids.
    let mut shared = tempfile::Builder::new();
    shared.permissions(Permissions::from_mode(0o666));
    replace_by(&mut shared, path, Durability::Lasting, |file| file.write_all(bytes))
}

/// The same, the error with its path. What is no regular file, standard output say, is written as it is.
pub fn keep_shared(path: &Path, bytes: &[u8]) -> Result<(), FileError> {
    let is_special = std::fs::metadata(path).is_ok_and(|metadata| !metadata.is_file());
    let kept = if is_special { std::fs::write(path, bytes) } else { replace_shared(path, bytes) };
    kept.map_err(|source| FileError::of(path, source))
}

fn replace_by(
    builder: &mut tempfile::Builder<'_, '_>,
    path: &Path,
    care: Durability,
    write: impl FnOnce(&mut tempfile::NamedTempFile) -> io::Result<()>,
) -> io::Result<()> {
    let folder = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    std::fs::create_dir_all(folder)?;
    let mut file = builder.prefix(UNFINISHED).tempfile_in(folder)?;
    // The lock shows `sweep` that a writer lives. Where a file system has no locks, `sweep` removes nothing.
    file.as_file().try_lock().ok();
    write(&mut file)?;
    if care == Durability::Lasting {
        file.as_file().sync_all()?;
    }
    file.persist(path).map_err(|e| e.error)?;
    if care == Durability::Lasting {
        File::open(folder)?.sync_all()?;
        sweep(folder);
    }
    Ok(())
}

/// Puts a folder that is filled by this into the place of what is there. One that is there is moved away first, so that a writer that is killed
/// may leave none, but never a part.
pub fn replace_folder(path: &Path, fill: impl FnOnce(&Path) -> io::Result<()>) -> io::Result<()> {
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
pub fn ignore_absence(error: io::Error) -> io::Result<()> {
    if error.kind() == io::ErrorKind::NotFound { Ok(()) } else { Err(error) }
}

/// Takes away what killed writers left in a folder: files and folders that nobody has locked any more.
pub fn sweep(folder: &Path) {
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    for entry in entries.filter(|entry| entry.file_name().to_string_lossy().starts_with(UNFINISHED)) {
        match entry.file_type() {
            Ok(kind) if kind.is_file() && is_left(&entry.path()) => std::fs::remove_file(entry.path()).ok(),
            Ok(kind) if kind.is_dir() && is_left(&entry.path()) => std::fs::remove_dir_all(entry.path()).ok(),
            // Pipes and links are not even opened: a pipe may wait for ever.
            _ => None,
        };
    }
}

/// Whether the writer of an unfinished file or folder has ended.
fn is_left(path: &Path) -> bool {
    File::open(path).is_ok_and(|file| is_old(&file) && file.try_lock().is_ok())
}

/// Whether it is there long enough for its writer to have locked it.
fn is_old(file: &File) -> bool {
    let age = file.metadata().and_then(|metadata| metadata.created().or_else(|_| metadata.modified()));
    age.is_ok_and(|then| then.elapsed().is_ok_and(|age| age >= LOCK_GRACE))
}

/// The same by a writer that may go back in the file.
pub fn replace_through(
    path: &Path,
    care: Durability,
    write: impl FnOnce(&mut File) -> io::Result<()>,
) -> io::Result<()> {
    replace_by(&mut tempfile::Builder::new(), path, care, |file| write(file.as_file_mut()))
}

/// The same with a value as JSON for people, a line feed at its end.
pub fn replace_json<T: Serialize>(path: &Path, value: &T, care: Durability) -> io::Result<()> {
    replace_by(&mut tempfile::Builder::new(), path, care, |file| written(file, value, PrettyFormatter::new()))
}

/// The same, the error with its path.
pub fn keep_json<T: Serialize>(path: &Path, value: &T) -> Result<(), FileError> {
    replace_json(path, value, Durability::Usual).map_err(|source| FileError::of(path, source))
}

/// The same with an item of a list a line, for what is too long to be read.
pub fn replace_rows<T: Serialize>(path: &Path, value: &T, care: Durability) -> io::Result<()> {
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
        std::thread::sleep(2 * LOCK_GRACE);
        sweep(folder.path());
        assert_eq!([&left, &held, &other].map(|path| path.exists()), [false, true, true]);
    }

    fn names(folder: &Path) -> Vec<String> {
        std::fs::read_dir(folder).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap()).collect()
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
        assert_eq!(names(&path), ["a"]);
        replace_folder(&path, fill("c")).unwrap();
        assert_eq!((names(&path), names(path.parent().unwrap())), (vec!["c".to_owned()], vec!["new".to_owned()]));
        // What a writer left that was killed.
        let left = path.with_file_name(format!("{UNFINISHED}left"));
        std::fs::create_dir(&left).unwrap();
        fill("d")(&left).unwrap();
        std::thread::sleep(2 * LOCK_GRACE);
        sweep(path.parent().unwrap());
        assert_eq!(names(path.parent().unwrap()), ["new"]);
    }

    #[test]
    fn a_name_that_is_no_utf_8_is_found_by_what_a_report_has_of_it() {
        use std::os::unix::ffi::OsStrExt;
        let root = tempfile::tempdir().unwrap();
        let folder = root.path().join(std::ffi::OsStr::from_bytes(b"caf\xe9"));
        std::fs::create_dir(&folder).unwrap();
        let file = folder.join("spec.yaml");
        std::fs::write(&file, "").unwrap();
        let lossy = |path: &Path| PathBuf::from(path.to_string_lossy().into_owned());
        assert!(!lossy(&file).exists());
        assert_eq!(found_again(&lossy(&file)), file);
        assert_eq!(found_again(&lossy(&folder.join("gone"))), folder.join("gone"));
        assert_eq!(found_again(Path::new("a/b")), Path::new("a/b"));
    }

    #[test]
    fn a_folder_that_is_called_like_a_file_lies_below_this_one() {
        for (path, name) in
            [("a/room.rad", Some("room")), ("...rad", None), ("a/..", None), ("..rad", None), ("/", None)]
        {
            let found = stem(Path::new(path));
            assert!(found.is_none_or(|stem| stem != Path::new("..") && stem != Path::new(".")), "{path}");
            if let Some(name) = name {
                assert_eq!(found, Some(Path::new(name)));
            }
        }
        assert_eq!(stem(Path::new("...rad")), None);
    }

    #[test]
    fn what_is_no_file_or_too_large_is_refused_and_not_read() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("large");
        // It takes no room, and would be read into memory.
        File::create(&path).unwrap().set_len(MAX_KEPT_BYTES + 1).unwrap();
        assert!(read_stored(&path).unwrap_err().to_string().contains("it has more than 2048 MB"));
        for path in ["/dev/zero", "/"] {
            assert!(read_stored(Path::new(path)).unwrap_err().to_string().contains("no regular file"), "{path}");
        }
        // These call themselves regular files of no size; the one has no end, and the other waits for the next message of the kernel.
        for path in ["/proc/self/pagemap", "/proc/kmsg"].map(Path::new).iter().filter(|path| path.exists()) {
            let (send, receive) = std::sync::mpsc::channel();
            let path = path.to_path_buf();
            std::thread::spawn(move || send.send(read_stored(&path).map(|bytes| bytes.len())));
            let read = receive.recv_timeout(Duration::from_secs(20)).expect("it is not waited for");
            assert!(read.is_err() || read.is_ok_and(|bytes| bytes <= MAX_UNSIZED_BYTES as usize));
        }
    }

    #[test]
    fn a_full_or_broken_disk_is_an_error_that_says_what_to_do() {
        use rustix::io::Errno;
        for (errno, says) in [(Errno::NOSPC, "make room"), (Errno::IO, "another disk"), (Errno::ROFS, "another folder")]
        {
            let error = io::Error::from_raw_os_error(errno.raw_os_error());
            let wrapped = io::Error::new(error.kind(), error.to_string());
            for error in [error, wrapped] {
                let reported = FileError::of(Path::new("out/report.json"), error).to_string();
                assert!(reported.starts_with("out/report.json: ") && reported.contains(says), "{reported}");
            }
        }
    }
}
