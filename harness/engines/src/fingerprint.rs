//! What really runs: a hash of the files of an engine, whatever version it tells.

use std::collections::{BTreeMap, BTreeSet};
use std::io;
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use walkdir::WalkDir;

use super::EngineRoot;
use luxproof_model::EngineName;
use luxproof_process::digest::{self, hexadecimal};
use luxproof_process::envelope::{self, Schema};
use luxproof_process::files;

/// Of more files than this only the number counts.
const MAX_FILES: usize = 20_000;

/// Hashes of files that have not changed since, by path.
type Memo = BTreeMap<PathBuf, HashedFile>;

const SCHEMA: Schema = Schema { of: "hashes of engine files", version: 2 };

#[derive(Clone, PartialEq, Serialize, Deserialize)]
struct HashedFile {
    /// Before it was read.
    state: State,
    #[serde(skip, default = "settled")]
    is_settled: bool,
    sha256: String,
}

/// Nothing else is kept.
const fn settled() -> bool {
    true
}

/// What tells that a file is as it was: besides its size and the time of its contents, which anyone may set, the time of the system's
/// own when any of it was last changed, and which file it is.
#[derive(Clone, PartialEq, Serialize, Deserialize)]
struct State {
    size: u64,
    modified: (i64, i64),
    changed: (i64, i64),
    file: (u64, u64),
}

/// Clocks of file systems go by ticks: what was changed less than this before it was read may change once more and look the same.
const TICK: Duration = Duration::from_millis(20);

impl State {
    fn of(path: &Path) -> io::Result<Self> {
        let data = path.metadata()?;
        Ok(Self {
            size: data.size(),
            modified: (data.mtime(), data.mtime_nsec()),
            changed: (data.ctime(), data.ctime_nsec()),
            file: (data.dev(), data.ino()),
        })
    }

    /// Whether whatever changes the file from now on changes this.
    fn is_settled(&self) -> bool {
        let nanoseconds = i128::from(self.changed.0) * 1_000_000_000 + i128::from(self.changed.1);
        let now = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default().saturating_sub(TICK);
        i128::try_from(now.as_nanos()).is_ok_and(|settled| nanoseconds < settled)
    }
}

/// SHA-256 of the names and contents of an engine's files and folders, 16 hexadecimal digits of it; what cannot be read is
/// part of it as just that.
pub(super) fn of(engine: &EngineName, site: &EngineRoot, roots: impl IntoIterator<Item = PathBuf>) -> String {
    of_files(engine, site, listed(roots))
}

/// The files at or below some files and folders, each with its name from there.
pub(super) fn listed(roots: impl IntoIterator<Item = PathBuf>) -> Vec<(PathBuf, PathBuf)> {
    let roots: BTreeSet<PathBuf> = roots.into_iter().collect();
    roots.iter().flat_map(|root| below(root)).collect()
}

/// The same of files with their names, in this order.
pub(super) fn of_files(engine: &EngineName, site: &EngineRoot, files: Vec<(PathBuf, PathBuf)>) -> String {
    // An engine each, so that probes side by side do not overwrite one another's.
    let place = site.root().join("fingerprints").join(format!("{engine}.json"));
    let memo = load_memo(&place, engine);
    let (mut now, mut hash) = (Memo::default(), Sha256::new_with_prefix(files.len().to_le_bytes()));
    for (name, path) in files.into_iter().take(MAX_FILES) {
        let known = seen(&path, memo.get(&path));
        let content = known.as_ref().map_or_else(ToString::to_string, |k| k.sha256.clone());
        hash.update(format!("{}\0{content}\n", name.display()));
        now.extend(known.ok().filter(|known| known.is_settled).map(|known| (path, known)));
    }
    if now != memo {
        // Where it cannot be kept, files are read again next time.
        let text = envelope::seal(SCHEMA, engine.as_str(), &now).map_err(io::Error::from);
        text.and_then(|text| files::replace(&place, text.as_bytes())).ok();
    }
    hexadecimal(&hash.finalize())[..16].to_owned()
}

/// What an earlier run saw; a damaged file is reported and replaced.
fn load_memo(place: &Path, engine: &EngineName) -> Memo {
    let Ok(text) = files::read_stored(place) else { return Memo::default() };
    envelope::open(SCHEMA, &text).and_then(|sealed| sealed.about(engine.as_str())).unwrap_or_else(|why| {
        tracing::warn!("{engine}: {} {why}; its files are hashed anew", place.display());
        Memo::default()
    })
}

fn seen(path: &Path, earlier: Option<&HashedFile>) -> io::Result<HashedFile> {
    let state = State::of(path)?;
    match earlier.filter(|known| known.state == state) {
        Some(known) => Ok(known.clone()),
        None => Ok(HashedFile { is_settled: state.is_settled(), state, sha256: digest::of_file(path)? }),
    }
}

/// The files at or below a path, in order, each with its name from there; what compilers leave beside sources is none.
fn below(root: &Path) -> impl Iterator<Item = (PathBuf, PathBuf)> {
    let walk = WalkDir::new(root).sort_by_file_name().into_iter().filter_entry(|e| e.file_name() != "__pycache__");
    let files = walk.filter_map(|entry| match entry {
        Ok(entry) => Some(entry.into_path()).filter(|path| path.is_file()),
        Err(error) => error.path().map(Path::to_owned),
    });
    // With the root's own name, which tells files that are named each by itself.
    let above = root.parent().unwrap_or(root);
    files.map(move |path| (path.strip_prefix(above).unwrap_or(&path).to_owned(), path))
}

#[cfg(test)]
mod tests {
    use std::fs::File;
    use std::time::SystemTime;

    use super::*;

    fn set_modified(path: &Path, time: SystemTime) {
        File::options().write(true).open(path).unwrap().set_modified(time).unwrap();
    }

    #[test]
    fn contents_names_and_numbers_of_files_count_and_folders_that_are_linked_do_not() {
        let folder = tempfile::tempdir().unwrap();
        let (root, site) = (folder.path().join("engine"), EngineRoot::at(folder.path().join("site")));
        std::fs::create_dir_all(root.join("part")).unwrap();
        std::fs::write(root.join("part/a"), "one").unwrap();
        std::os::unix::fs::symlink(&root, root.join("part/circle")).unwrap();
        std::thread::sleep(2 * TICK);
        let now = || of(&EngineName::new("mine"), &site, [root.clone(), root.clone()]);
        let mut seen = vec![now()];
        assert_eq!(now(), seen[0]);
        std::fs::rename(root.join("part/a"), root.join("part/b")).unwrap();
        seen.push(now());
        std::fs::rename(root.join("part/b"), root.join("b")).unwrap();
        seen.push(now());
        std::fs::write(root.join("b"), "other").unwrap();
        seen.push(now());
        std::fs::write(root.join("c"), "").unwrap();
        seen.push(now());
        assert_eq!(seen.iter().collect::<BTreeSet<_>>().len(), 5, "{seen:?}");
        let kept: Vec<_> =
            site.root().join("fingerprints").read_dir().unwrap().map(|e| e.unwrap().file_name()).collect();
        assert_eq!(kept, ["mine.json"]);
    }

    #[test]
    fn a_change_that_keeps_size_and_time_is_noticed_and_so_is_another_file_in_place_of_one() {
        let folder = tempfile::tempdir().unwrap();
        let (file, site) = (folder.path().join("rtrace"), EngineRoot::at(folder.path().join("site")));
        std::fs::write(&file, "one").unwrap();
        std::thread::sleep(2 * TICK);
        let time = file.metadata().unwrap().modified().unwrap();
        let now = || of(&EngineName::new("mine"), &site, [file.clone()]);
        let before = now();
        std::fs::write(&file, "two").unwrap();
        set_modified(&file, time);
        let edited = now();
        assert_ne!(before, edited);
        let other = folder.path().join("other");
        std::fs::write(&other, "six").unwrap();
        set_modified(&other, time);
        std::fs::rename(&other, &file).unwrap();
        assert_ne!(edited, now());
    }

    #[test]
    fn hashes_that_were_edited_cut_or_moved_are_never_believed() {
        let folder = tempfile::tempdir().unwrap();
        let (root, site) = (folder.path().join("engine"), EngineRoot::at(folder.path().join("site")));
        std::fs::create_dir_all(&root).unwrap();
        std::fs::write(root.join("a"), "one").unwrap();
        let (engine, other) = (EngineName::new("mine"), EngineName::new("other"));
        std::thread::sleep(2 * TICK);
        let right = of(&engine, &site, [root.clone()]);
        let place = |name: &str| site.root().join("fingerprints").join(name);
        let sound = std::fs::read_to_string(place("mine.json")).unwrap();
        let at = sound.find("sha256\":\"").unwrap() + 9;
        let digit = if sound[at..].starts_with('0') { "1" } else { "0" };
        let edited = format!("{}{digit}{}", &sound[..at], &sound[at + 1..]);
        for (name, text) in [
            ("mine.json", edited.as_str()),
            ("mine.json", &sound[..sound.len() / 2]),
            ("mine.json", &sound.replace("files 2", "files 0")),
            ("mine.json", ""),
            ("other.json", &sound),
        ] {
            std::fs::write(place(name), text).unwrap();
            let asked = if name == "mine.json" { &engine } else { &other };
            assert!(load_memo(&place(name), asked).is_empty(), "{text}");
            assert_eq!(of(asked, &site, [root.clone()]), right);
            assert!(!load_memo(&place(name), asked).is_empty(), "it was not replaced");
        }
    }
}
