//! Upkeep of the cache: what is in it, and taking out what is damaged, unfinished or long unused.

use std::collections::BTreeMap;
use std::io;
use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime};

use super::{Cache, entry, groundwork, listed};
use crate::system::files::{MAX_BYTES, UNFINISHED, read_bounded};

/// A file that was begun longer ago than this has no writer any more.
const WRITERS_LIVE: Duration = Duration::from_secs(3600);

#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Contents {
    /// Sound entries and their bytes, by engine.
    pub engines: BTreeMap<String, (usize, u64)>,
    pub damaged: Vec<String>,
    /// Files that a writer began; those of writers that were killed stay until they are pruned.
    pub unfinished: usize,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Pruned {
    /// Entries not used for longer than asked.
    pub unused: usize,
    pub damaged: usize,
    pub unfinished: usize,
    pub bytes: u64,
}

enum Kind {
    Entry,
    /// What is kept beside entries, and goes when nobody asked for it as long.
    Beside,
    Damaged(String),
    Unfinished,
}

impl Cache {
    /// What is in the cache; checks every entry.
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
                Kind::Beside => {}
            }
        }
        Ok(contents)
    }

    pub fn prune(&self, unused_for: Duration) -> io::Result<Pruned> {
        let now = SystemTime::now();
        let mut pruned = Pruned::default();
        for file in self.files()? {
            let Ok(metadata) = file.metadata() else { continue };
            let idle = metadata.modified().ok().and_then(|then| now.duration_since(then).ok()).unwrap_or_default();
            let (mut beside, kind) = (0, kind(&file));
            let count = match kind {
                Kind::Entry if idle >= unused_for => &mut pruned.unused,
                Kind::Beside if idle >= unused_for => &mut beside,
                Kind::Damaged(_) => &mut pruned.damaged,
                Kind::Unfinished if idle >= WRITERS_LIVE => &mut pruned.unfinished,
                Kind::Entry | Kind::Beside | Kind::Unfinished => continue,
            };
            match std::fs::remove_file(&file) {
                Ok(()) => {
                    *count += 1;
                    pruned.bytes += metadata.len();
                }
                // Another pruning was quicker.
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

fn list(folder: &Path) -> io::Result<Vec<PathBuf>> {
    match folder.read_dir() {
        Ok(entries) => entries.map(|e| Ok(e?.path())).collect(),
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(vec![]),
        Err(error) => Err(error),
    }
}

fn kind(file: &Path) -> Kind {
    let name = file.file_name().unwrap_or_default().to_string_lossy();
    if name.starts_with(UNFINISHED) {
        return Kind::Unfinished;
    }
    if file
        .extension()
        .is_some_and(|extension| [listed::EXTENSION, groundwork::EXTENSION].iter().any(|known| extension == *known))
    {
        return Kind::Beside;
    }
    let key = name.trim_end_matches(".json");
    let checked = read_bounded(file, MAX_BYTES).map_err(|e| format!("cannot be read: {e}"));
    match checked.and_then(|text| entry::parse(&text, key).map_err(|why| why.to_string())) {
        Ok(_) => Kind::Entry,
        Err(why) => Kind::Damaged(why),
    }
}
