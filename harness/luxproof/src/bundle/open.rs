//! Opens a bundle that may come from a stranger.
//!
//! Every byte is verified before any of it is used, and files are written below a temporary folder only.

use luxproof_model::ForeignPath;
use std::cell::{Cell, LazyCell};
use std::collections::{BTreeSet, HashSet};
use std::fs::{self, File};
use std::io::{self, BufReader, Read, Seek, SeekFrom};
use std::os::unix::fs::{OpenOptionsExt, PermissionsExt};
use std::path::{Path, PathBuf};
use std::rc::Rc;

use serde::Deserialize;
use tempfile::TempDir;
use walkdir::WalkDir;
use zip::{CompressionMethod, ZipArchive};

use super::inputs::name;
use super::pack::{is_program, pack};
use super::sums::{self, Sums};
use super::{BundleError, LOCK, Lock, RUN, SUMS};
use luxproof_model::REPORT_FILE;
use luxproof_model::Report;
use luxproof_process::digest;
use luxproof_process::files::{self, Durability, FileError, MAX_KEPT_BYTES, read_bounded};
use luxproof_process::foreign_json;
use luxproof_process::printable;
use luxproof_spec::{BUNDLE_FILE, Trust};

/// How many files, folders and bytes a bundle may have, and how many bytes the files that are parsed.
#[derive(Clone, Copy)]
struct BundleLimits {
    /// The most files, and the most folders.
    files: usize,
    bytes: u64,
    /// Of the list of files in an archive.
    list_bytes: u64,
    lock_bytes: u64,
    report_bytes: u64,
}

impl BundleLimits {
    /// Of what a stranger gives, a copy is made and hashed before anything is believed: that takes about a second.
    const fn of(trust: Trust) -> Self {
        match trust {
            Trust::Own => Self {
                files: 100_000,
                bytes: 2 * MAX_KEPT_BYTES,
                list_bytes: MAX_KEPT_BYTES,
                lock_bytes: MAX_TEXT,
                report_bytes: MAX_KEPT_BYTES,
            },
            Trust::Stranger | Trust::Bundled => Self {
                files: 10_000,
                bytes: 256 << 20,
                list_bytes: 4 << 20,
                lock_bytes: 1 << 20,
                report_bytes: MAX_FOREIGN_REPORT_BYTES,
            },
        }
    }
}

/// The most bytes of an archive's files, as a multiple of the archive's size.
const MAX_EXPANSION: u64 = 10;
/// The most bytes of a stranger's report: it is parsed in about a second.
pub const MAX_FOREIGN_REPORT_BYTES: u64 = 32 << 20;
/// The most bytes of the list of hashes, the lock and the description.
const MAX_TEXT: u64 = 16 << 20;

/// A verified bundle, copied to a folder that no other process writes.
#[derive(Debug)]
pub struct Opened {
    pub lock: Lock,
    pub report: Report,
    /// SHA-256 of its list of hashes.
    pub sha256: String,
    pub files: usize,
    stage: TempDir,
}

/// Whether a path may stand for a bundle: a folder, a zip, or the file that describes one.
pub fn is_bundle(path: &Path) -> bool {
    let is_named = path.file_name().is_some_and(|name| name == BUNDLE_FILE);
    path.is_dir() || is_named || path.extension().is_some_and(|extension| extension == "zip")
}

impl Opened {
    pub fn read(path: &Path, trust: Trust) -> Result<Self, BundleError> {
        let path = if path.is_file() && path.file_name().is_some_and(|name| name == BUNDLE_FILE) {
            path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
        } else {
            path
        };
        let shown = path.display().to_string();
        let stage = tempfile::tempdir().map_err(|e| FileError::of(&std::env::temp_dir(), e))?;
        let limits = BundleLimits::of(trust);
        let mut copy = Copy { stage: stage.path(), found: Sums::new(), faults: vec![], bytes: 0, limits };
        if path.is_dir() {
            copy.folder(path)?;
        } else {
            copy.archive(path)?;
        }
        let Copy { mut found, mut faults, .. } = copy;
        let of_sums = found.remove(SUMS);
        let broken = |faults| BundleError::Broken { bundle: shown.clone(), faults };
        let Some(sha256) = of_sums else {
            return Err(if faults.is_empty() { BundleError::NoBundle(shown) } else { broken(faults) });
        };
        let listed = read_bounded(&stage.path().join(SUMS), MAX_TEXT).map_err(|e| FileError::of(path, e))?;
        let listed = String::from_utf8(listed).ok().and_then(|text| sums::parse(&text));
        let Some(listed) = listed else {
            faults.push(format!("{SUMS} has changed: it is not as luxproof writes it"));
            return Err(broken(faults));
        };
        faults.extend(differences(&listed, &found, stage.path()));
        let needed = [BUNDLE_FILE.to_owned(), LOCK.to_owned(), format!("{RUN}/{REPORT_FILE}")];
        faults
            .extend(needed.iter().filter(|name| !listed.contains_key(*name)).map(|name| format!("{name} is missing")));
        if faults.is_empty() && path.is_file() && !is_as_packed(path, stage.path(), &listed)? {
            faults.push(
                "the archive has changed between its files, which are whole: unpack it, and give its folder".to_owned(),
            );
        }
        if !faults.is_empty() {
            return Err(broken(faults));
        }
        let lock = read_bounded(&stage.path().join(LOCK), limits.lock_bytes)
            .map_err(|e| FileError::of(&path.join(LOCK), e))?;
        let lock: Lock = foreign_json::from_slice(&lock).map_err(|source| BundleError::Json {
            bundle: shown.clone(),
            file: LOCK.to_owned(),
            source,
        })?;
        if lock.luxproof != 1 {
            return Err(BundleError::Version(shown));
        }
        let strange = lock.specs.iter().filter(|spec| !listed.contains_key(*spec));
        let strange = strange.map(|spec| format!("{LOCK} names a spec that is not there: {spec}"));
        // `luxproof bundle` names none: a bundle's policy is found among its inputs.
        let policy = lock.request.policy.as_ref().map(ForeignPath::shown);
        let outside = policy.map(|file| format!("{LOCK} names a policy, and no bundle does: {file}"));
        let excess = super::excess_of_lock(&lock).filter(|_| trust != Trust::Own);
        let excess = excess.map(|message| format!("{LOCK} {message}"));
        let faults: Vec<String> =
            strange.chain(outside).chain(excess).map(|fault| printable::line(&fault, 300)).collect();
        if !faults.is_empty() {
            return Err(broken(faults));
        }
        let report_file = stage.path().join(RUN).join(REPORT_FILE);
        let report_bytes = fs::metadata(&report_file).map_err(|e| FileError::of(path, e))?.len();
        if report_bytes > limits.report_bytes {
            let most = limits.report_bytes >> 20;
            return Err(broken(vec![format!("{RUN}/{REPORT_FILE} has more than {most} MB, and is not trusted")]));
        }
        let report = luxproof_report_file::read(&report_file)?;
        if let Some(excess) = super::excess_of_report(&report).filter(|_| trust != Trust::Own) {
            return Err(broken(vec![format!("{RUN}/{REPORT_FILE} {excess}")]));
        }
        Ok(Self { lock, report, sha256, files: listed.len() + 1, stage })
    }

    /// Its report's file, in the copy.
    pub fn report_file(&self) -> PathBuf {
        self.stage.path().join(RUN).join(REPORT_FILE)
    }

    /// Writes it as a zip, whatever it was read from.
    pub fn write_zip(&self, out: &Path) -> Result<(), BundleError> {
        let failed = |e: io::Error| FileError::of(out, e);
        let listed = read_bounded(&self.stage.path().join(SUMS), MAX_TEXT).map_err(failed)?;
        let sums = String::from_utf8(listed).ok().and_then(|text| sums::parse(&text));
        let sums = sums.ok_or_else(|| BundleError::NoBundle(out.display().to_string()))?;
        files::replace_through(out, Durability::Lasting, |file: &mut File| {
            pack(self.stage.path(), &sums, file).map_err(io::Error::other)
        })
        .map_err(failed)?;
        Ok(())
    }

    /// The specs, where they may be run.
    pub fn specs(&self) -> Vec<PathBuf> {
        self.lock.specs.iter().map(|spec| self.stage.path().join(spec)).collect()
    }
}

/// What is being copied of a bundle, and what is wrong with it.
struct Copy<'a> {
    stage: &'a Path,
    found: Sums,
    faults: Vec<String>,
    bytes: u64,
    limits: BundleLimits,
}

impl Copy<'_> {
    fn folder(&mut self, folder: &Path) -> Result<(), BundleError> {
        let mut folders = 0;
        for entry in WalkDir::new(folder).min_depth(1).sort_by_file_name() {
            let entry = entry.map_err(|e| FileError::of(folder, e))?;
            folders += usize::from(entry.file_type().is_dir());
            if folders > self.limits.files {
                return Err(FileError::of(folder, self.too_many_folders()).into());
            }
            let below = entry.path().strip_prefix(folder).unwrap_or(entry.path());
            let shown = printable::line(&below.display().to_string(), usize::MAX);
            match name(below) {
                _ if entry.file_type().is_dir() => {}
                _ if !entry.file_type().is_file() => {
                    self.faults.push(format!("{shown} was added: it is no regular file"));
                }
                None => self.faults.push(format!("{shown} was added: no bundle holds such a name")),
                Some(name) => {
                    let opened = File::open(entry.path()).and_then(|file| Ok((file.metadata()?, file)));
                    let copied = opened.and_then(|(of, file)| {
                        // Before it is copied: zeros take no room where they lie.
                        if self.bytes.saturating_add(of.len()) > self.limits.bytes {
                            return Err(self.too_many_bytes());
                        }
                        self.file(&name, file, is_program(of.permissions().mode()))
                    });
                    copied.map_err(|e| FileError::of(entry.path(), e))?;
                }
            }
        }
        Ok(())
    }

    fn archive(&mut self, path: &Path) -> Result<(), BundleError> {
        let broken = |e| BundleError::Zip(path.display().to_string(), e);
        let (file, metadata) = files::open_regular(path).map_err(|e| FileError::of(path, e))?;
        let whole = metadata.len();
        // The list of an archive's files takes ten times its size in memory.
        let allowance = Rc::new(Cell::new(self.limits.list_bytes));
        let file = AllowedReader { from: file, allowance: Rc::clone(&allowance) };
        let mut archive = ZipArchive::new(BufReader::new(file)).map_err(broken)?;
        allowance.set(u64::MAX);
        // Before any name is read: an entry costs its archive 100 bytes, and a file on the disk much more.
        if archive.len() > self.limits.files {
            return Err(FileError::of(path, self.too_many_files()).into());
        }
        let entries = self.entries(&mut archive, whole).map_err(broken)?;
        // Of an archive that is not as luxproof packs it nothing is written.
        if !self.faults.is_empty() {
            return Ok(());
        }
        if has_more_folders_than(self.limits.files, &entries) {
            return Err(FileError::of(path, self.too_many_folders()).into());
        }
        for (k, name) in entries.iter().enumerate() {
            // Where its bytes are compressed they are not read.
            let entry = archive.by_index_raw(k).map_err(broken)?;
            let is_program = entry.unix_mode().is_some_and(is_program);
            self.file(name, entry.take(whole), is_program).map_err(|e| FileError::of(path, e))?;
        }
        Ok(())
    }

    /// The places of an archive's files in their order, before any is unpacked; what no bundle holds is a fault.
    fn entries(
        &mut self,
        archive: &mut ZipArchive<impl Read + Seek>,
        whole: u64,
    ) -> zip::result::ZipResult<Vec<String>> {
        let (mut places, mut names, mut ranges, mut bytes) = (vec![], BTreeSet::new(), vec![], 0_u64);
        for k in 0..archive.len() {
            let entry = archive.by_index_raw(k)?;
            let called = entry.name()?.into_owned();
            let shown = printable::line(&called, 200);
            let place = name(Path::new(&called)).filter(|name| *name == called);
            let is_plain = entry.compression() == CompressionMethod::Stored && !entry.encrypted();
            bytes = bytes.saturating_add(entry.size().max(entry.compressed_size()));
            ranges.push((entry.header_start(), entry.compressed_size()));
            match place {
                _ if entry.is_dir() || entry.is_symlink() => {
                    self.faults.push(format!("{shown} was added: it is no regular file"));
                }
                None => self.faults.push(format!("{shown} was added: it lies outside of the bundle")),
                Some(name) if !names.insert(name.clone()) => self.faults.push(format!("{shown} stands there twice")),
                Some(_) if !is_plain => {
                    self.faults.push(format!("{shown} was packed by another program: unpack it, and give the folder"));
                }
                Some(name) => places.push(name),
            }
        }
        if bytes > MAX_EXPANSION.saturating_mul(whole) {
            self.faults.push(format!("its files have {bytes} bytes and the archive {whole}: it is not unpacked"));
        }
        ranges.sort_unstable();
        if ranges.windows(2).any(|pair| pair[1].0 - pair[0].0 < pair[0].1) {
            self.faults.push("files of the archive overlap: it is not unpacked".to_owned());
        }
        Ok(places)
    }

    fn too_many_files(&self) -> io::Error {
        io::Error::new(io::ErrorKind::InvalidInput, format!("it holds more than {} files", self.limits.files))
    }

    fn too_many_folders(&self) -> io::Error {
        io::Error::new(io::ErrorKind::InvalidInput, format!("it holds more than {} folders", self.limits.files))
    }

    fn too_many_bytes(&self) -> io::Error {
        io::Error::new(io::ErrorKind::InvalidInput, format!("it holds more than {} MB", self.limits.bytes >> 20))
    }

    fn file(&mut self, name: &str, from: impl Read, is_program: bool) -> io::Result<()> {
        if self.found.len() >= self.limits.files {
            return Err(self.too_many_files());
        }
        let to = self.stage.join(name);
        to.parent().map_or(Ok(()), fs::create_dir_all)?;
        let mode = if is_program { 0o700 } else { 0o600 };
        let mut file = File::options().write(true).create_new(true).mode(mode).open(to)?;
        let (hash, bytes) = digest::copy(&mut from.take(self.limits.bytes - self.bytes + 1), &mut file)?;
        self.bytes += bytes;
        if self.bytes > self.limits.bytes {
            return Err(self.too_many_bytes());
        }
        self.found.insert(name.to_owned(), hash);
        Ok(())
    }
}

/// A file of which only so many bytes are read.
struct AllowedReader {
    from: File,
    allowance: Rc<Cell<u64>>,
}

impl Read for AllowedReader {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let count = self.from.read(buffer)?;
        let left = self.allowance.get().checked_sub(count as u64);
        let left = left.ok_or_else(|| io::Error::new(io::ErrorKind::InvalidInput, "its list of files is too long"))?;
        self.allowance.set(left);
        Ok(count)
    }
}

impl Seek for AllowedReader {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        self.from.seek(to)
    }
}

/// Whether places lie in more than so many folders: each is made where an archive is unpacked.
fn has_more_folders_than(most: usize, places: &[String]) -> bool {
    let mut folders = HashSet::new();
    let all = places.iter().flat_map(|place| place.match_indices('/').map(|(at, _)| &place[..at]));
    all.into_iter().any(|folder| folders.insert(folder) && folders.len() > most)
}

/// What is there besides or in place of what is listed, and what is not there.
fn differences(listed: &Sums, found: &Sums, stage: &Path) -> Vec<String> {
    let described = LazyCell::new(|| described(stage).unwrap_or_default());
    let of_listed = listed.iter().filter_map(|(name, hash)| match found.get(name) {
        None if !described.is_empty() && !described.contains_key(name) && name != BUNDLE_FILE => {
            Some(format!("{SUMS} has changed: it lists {name}, which never was there"))
        }
        None => Some(format!("{name} is missing")),
        Some(now) if now == hash => None,
        // Its description says what the file has: then it is the list that does not.
        Some(now) if described.get(name) == Some(now) => Some(format!("{SUMS} has changed where it lists {name}")),
        Some(now) if name == BUNDLE_FILE => {
            Some(format!("{name} has changed, or its line in {SUMS}: its SHA-256 is {now}, in place of {hash}"))
        }
        Some(now) => Some(format!("{name} has changed: its SHA-256 is {now}, in place of {hash}")),
    });
    let added =
        found.iter().filter(|(name, _)| !listed.contains_key(*name)).map(|(name, hash)| match described.get(name) {
            Some(then) if then == hash => format!("{SUMS} has changed: it does not list {name}"),
            _ => format!("{name} was added"),
        });
    of_listed.chain(added).collect()
}

/// The hashes that the bundle's description gives.
fn described(stage: &Path) -> Option<Sums> {
    let bytes = read_bounded(&stage.join(BUNDLE_FILE), MAX_TEXT).ok()?;
    let read: Description = foreign_json::from_slice(&bytes).ok()?;
    Some(read.graph.into_iter().filter_map(|entity| Some((entity.name?, entity.sha256?))).collect())
}

/// What of a bundle's description is read. It is not read as any JSON, which may take forty times its size in memory.
#[derive(Deserialize)]
struct Description {
    #[serde(rename = "@graph")]
    graph: Vec<DescribedFile>,
}

#[derive(Deserialize)]
struct DescribedFile {
    name: Option<String>,
    sha256: Option<String>,
}

/// The hash of a file's bytes from its position on.
fn hash_rest(file: &mut File) -> io::Result<String> {
    digest::copy(file, &mut io::sink()).map(|(hash, _)| hash)
}

/// Whether an archive is what its files make.
fn is_as_packed(archive: &Path, stage: &Path, sums: &Sums) -> Result<bool, BundleError> {
    let failed = |e: io::Error| FileError::of(archive, e);
    let mut repacked = tempfile::tempfile().map_err(failed)?;
    pack(stage, sums, &mut repacked).map_err(|e| BundleError::Zip(archive.display().to_string(), e))?;
    repacked.rewind().map_err(failed)?;
    let now = hash_rest(&mut File::open(archive).map_err(failed)?).map_err(failed)?;
    Ok(now == hash_rest(&mut repacked).map_err(failed)?)
}
