//! Opening a bundle of anybody's: every byte is verified before any of it is believed, and nothing is written but below a folder of ours.

use std::cell::LazyCell;
use std::collections::BTreeSet;
use std::fs::{self, File};
use std::io::{self, BufReader, Read};
use std::path::{Path, PathBuf};

use tempfile::TempDir;
use walkdir::WalkDir;
use zip::{CompressionMethod, ZipArchive};

use super::inputs::name;
use super::pack::pack;
use super::sums::{self, Sums};
use super::{BundleError, LOCK, Lock, RUN, SUMS};
use crate::report::{FILE, Report};
use crate::spec::BUNDLE_FILE;
use crate::system::digest;
use crate::system::files::{FileError, MAX_KEPT_BYTES, read_bounded};
use crate::system::printable;

/// More files are no bundle.
const MAX_FILES: usize = 100_000;
/// Nor are more bytes.
const MAX_BYTES: u64 = 2 * MAX_KEPT_BYTES;
/// Of a list of hashes, or of what is read to tell what a fault is.
const MAX_TEXT: u64 = 64 << 20;

/// A bundle whose every byte is what was bundled, copied to where nobody else writes.
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
    pub fn read(path: &Path) -> Result<Self, BundleError> {
        let path = if path.is_file() && path.file_name().is_some_and(|name| name == BUNDLE_FILE) {
            path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
        } else {
            path
        };
        let shown = path.display().to_string();
        let stage = tempfile::tempdir().map_err(|e| FileError::of(&std::env::temp_dir(), e))?;
        let mut copy = Copy { stage: stage.path(), found: Sums::new(), faults: vec![], bytes: 0 };
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
        let needed = [BUNDLE_FILE.to_owned(), LOCK.to_owned(), format!("{RUN}/{FILE}")];
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
        let unread = |e: io::Error| FileError::of(&path.join(LOCK), e);
        let lock = read_bounded(&stage.path().join(LOCK), MAX_TEXT).map_err(unread)?;
        let no_json = |source| BundleError::Json { bundle: shown.clone(), file: LOCK.to_owned(), source };
        let lock: Lock = serde_json::from_slice(&lock).map_err(no_json)?;
        if lock.luxproof != 1 {
            return Err(BundleError::Version(shown));
        }
        let strange = lock.specs.iter().filter(|spec| !listed.contains_key(*spec));
        let faults: Vec<String> =
            strange.map(|spec| format!("{LOCK} names a spec that is not there: {spec}")).collect();
        if !faults.is_empty() {
            return Err(broken(faults));
        }
        let report = Report::read(&stage.path().join(RUN).join(FILE))?.report;
        Ok(Self { lock, report, sha256, files: listed.len() + 1, stage })
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
}

impl Copy<'_> {
    fn folder(&mut self, folder: &Path) -> Result<(), BundleError> {
        for entry in WalkDir::new(folder).min_depth(1).sort_by_file_name() {
            let entry = entry.map_err(|e| FileError::of(folder, e))?;
            let below = entry.path().strip_prefix(folder).unwrap_or(entry.path());
            let shown = printable::line(&below.display().to_string(), usize::MAX);
            match name(below) {
                _ if entry.file_type().is_dir() => {}
                _ if !entry.file_type().is_file() => {
                    self.faults.push(format!("{shown} was added: it is no regular file"));
                }
                None => self.faults.push(format!("{shown} was added: no bundle holds such a name")),
                Some(name) => {
                    let copied = File::open(entry.path()).and_then(|file| self.file(&name, file));
                    copied.map_err(|e| FileError::of(entry.path(), e))?;
                }
            }
        }
        Ok(())
    }

    fn archive(&mut self, path: &Path) -> Result<(), BundleError> {
        let broken = |e| BundleError::Zip(path.display().to_string(), e);
        let file = File::open(path).map_err(|e| FileError::of(path, e))?;
        let whole = file.metadata().map_err(|e| FileError::of(path, e))?.len();
        let mut archive = ZipArchive::new(BufReader::new(file)).map_err(broken)?;
        let mut names = BTreeSet::new();
        for k in 0..archive.len() {
            // Where its bytes are compressed they are not read.
            let entry = archive.by_index_raw(k).map_err(broken)?;
            let called = entry.name().map_err(broken)?.into_owned();
            let shown = printable::line(&called, 200);
            let place = name(Path::new(&called)).filter(|name| *name == called);
            let is_plain = entry.compression() == CompressionMethod::Stored && !entry.encrypted();
            match place {
                _ if entry.is_dir() || entry.is_symlink() => {
                    self.faults.push(format!("{shown} was added: it is no regular file"));
                }
                None => self.faults.push(format!("{shown} was added: it lies outside of the bundle")),
                Some(name) if !names.insert(name.clone()) => self.faults.push(format!("{shown} stands there twice")),
                Some(_) if !is_plain => {
                    self.faults.push(format!("{shown} was packed by another program: unpack it, and give the folder"));
                }
                // What is not compressed is no longer than the archive.
                Some(name) => self.file(&name, entry.take(whole)).map_err(|e| FileError::of(path, e))?,
            }
        }
        Ok(())
    }

    fn file(&mut self, name: &str, from: impl Read) -> io::Result<()> {
        let refused = |why: &str| Err(io::Error::new(io::ErrorKind::InvalidInput, why.to_owned()));
        if self.found.len() >= MAX_FILES {
            return refused("a bundle does not hold so many files");
        }
        let to = self.stage.join(name);
        to.parent().map_or(Ok(()), fs::create_dir_all)?;
        let mut file = File::options().write(true).create_new(true).open(to)?;
        let (hash, bytes) = digest::copy(&mut from.take(MAX_BYTES - self.bytes + 1), &mut file)?;
        self.bytes += bytes;
        if self.bytes > MAX_BYTES {
            return refused("a bundle does not hold so many bytes");
        }
        self.found.insert(name.to_owned(), hash);
        Ok(())
    }
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
    let read: serde_json::Value = serde_json::from_slice(&bytes).ok()?;
    let entities = read.get("@graph")?.as_array()?.iter();
    let hash =
        |entity: &serde_json::Value| Some((entity["name"].as_str()?.to_owned(), entity["sha256"].as_str()?.to_owned()));
    Some(entities.filter_map(hash).collect())
}

/// Whether an archive is what its files make.
fn is_as_packed(archive: &Path, stage: &Path, sums: &Sums) -> Result<bool, BundleError> {
    let of = |file: &mut File| -> io::Result<String> { digest::copy(file, &mut io::sink()).map(|(hash, _)| hash) };
    let failed = |e: io::Error| FileError::of(archive, e);
    let mut again = tempfile::tempfile().map_err(failed)?;
    pack(stage, sums, &mut again).map_err(|e| BundleError::Zip(archive.display().to_string(), e))?;
    io::Seek::rewind(&mut again).map_err(failed)?;
    let now = of(&mut File::open(archive).map_err(failed)?).map_err(failed)?;
    Ok(now == of(&mut again).map_err(failed)?)
}
