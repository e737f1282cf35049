//! Upkeep of the cache: lists its contents, and deletes damaged, unfinished and unused files.

use std::collections::BTreeMap;
use std::io;
use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime};

use super::{Cache, entry, meter_list, shared_precompute};
use luxproof_process::files::{MAX_BYTES, UNFINISHED, read_bounded};

/// An unfinished file older than this has no writer any more.
const MAX_WRITER_AGE: Duration = Duration::from_secs(3600);

/// The contents of a cache.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Contents {
    /// The number of valid entries and their bytes, by engine.
    pub engines: BTreeMap<String, (usize, u64)>,
    pub damaged: Vec<String>,
    /// The number of unfinished files; those of killed writers stay until they are pruned.
    pub unfinished: usize,
}

/// How many files a pruning deleted, and their bytes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Pruned {
    /// Entries that were unused for longer than requested.
    pub unused: usize,
    pub damaged: usize,
    pub unfinished: usize,
    pub bytes: u64,
}

/// The kind of a file in the cache.
enum Kind {
    Entry,
    /// A list of meters or precomputed data, which is deleted when it is unused for as long as an entry.
    Auxiliary,
    Damaged(String),
    Unfinished,
}

impl Cache {
    /// Lists the contents of the cache and checks every entry.
    pub fn contents(&self) -> io::Result<Contents> {
        let mut contents = Contents::default();
        for file in self.files()? {
            match kind(&file) {
                Kind::Entry => {
                    let engine = file.parent().and_then(Path::file_name).unwrap_or_default().to_string_lossy();
                    let (entries, bytes) = contents.engines.entry(engine.into_owned()).or_default();
                    *entries += 1;
                    *bytes += file.metadata().map_or(0, |m| m.len());
                }
                Kind::Damaged(why) => contents.damaged.push(format!("{} {why}", file.display())),
                Kind::Unfinished => contents.unfinished += 1,
                Kind::Auxiliary => {}
            }
        }
        Ok(contents)
    }

    /// Deletes damaged files, abandoned unfinished ones, and those that were unused for this long.
    pub fn prune(&self, unused_for: Duration) -> io::Result<Pruned> {
        let now = SystemTime::now();
        let mut pruned = Pruned::default();
        for file in self.files()? {
            let Ok(metadata) = file.metadata() else { continue };
            let idle = metadata.modified().ok().and_then(|then| now.duration_since(then).ok()).unwrap_or_default();
            let (mut auxiliary, kind) = (0, kind(&file));
            let count = match kind {
                Kind::Entry if idle >= unused_for => &mut pruned.unused,
                Kind::Auxiliary if idle >= unused_for => &mut auxiliary,
                Kind::Damaged(_) => &mut pruned.damaged,
                Kind::Unfinished if idle >= MAX_WRITER_AGE => &mut pruned.unfinished,
                Kind::Entry | Kind::Auxiliary | Kind::Unfinished => continue,
            };
            match std::fs::remove_file(&file) {
                Ok(()) => {
                    *count += 1;
                    pruned.bytes += metadata.len();
                }
                // Another process has deleted the file.
                Err(error) if error.kind() == io::ErrorKind::NotFound => {}
                Err(error) => return Err(error),
            }
        }
        Ok(pruned)
    }

    /// Every file of the engines' folders, sorted; none where there is no cache yet.
    fn files(&self) -> io::Result<Vec<PathBuf>> {
        let mut files = vec![];
        for folder in list(self.root())?.into_iter().filter(|f| f.is_dir()) {
            files.extend(list(&folder)?.into_iter().filter(|f| f.is_file()));
        }
        files.sort();
        Ok(files)
    }
}

/// The paths in a folder; none where the folder does not exist.
fn list(folder: &Path) -> io::Result<Vec<PathBuf>> {
    match folder.read_dir() {
        Ok(entries) => entries.map(|e| Ok(e?.path())).collect(),
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(vec![]),
        Err(error) => Err(error),
    }
}

/// The kind of a file, by its name and its contents.
fn kind(file: &Path) -> Kind {
    let name = file.file_name().unwrap_or_default().to_string_lossy();
    if name.starts_with(UNFINISHED) {
        return Kind::Unfinished;
    }
    if file.extension().is_some_and(|extension| {
        [meter_list::EXTENSION, shared_precompute::EXTENSION].iter().any(|known| extension == *known)
    }) {
        return Kind::Auxiliary;
    }
    let key = name.trim_end_matches(".json");
    let checked = read_bounded(file, MAX_BYTES).map_err(|e| format!("cannot be read: {e}"));
    match checked.and_then(|text| entry::parse(&text, key).map_err(|why| why.to_string())) {
        Ok(_) => Kind::Entry,
        Err(why) => Kind::Damaged(why),
    }
}
