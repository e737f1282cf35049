//! The folder of a site: which files in it luxproof wrote. Only those are ever replaced or removed.

use std::collections::BTreeSet;
use std::fs::{self, File};
use std::io::{self, ErrorKind};
use std::path::{Component, Path, PathBuf};

use luxproof_process::files::{self, FileError};
use luxproof_process::foreign_json;
use luxproof_process::printable::{quoted, quoted_path};
use serde::{Deserialize, Serialize};
use walkdir::WalkDir;

/// The file that marks a site and lists its files.
pub const SITE_FILE: &str = "luxproof-site.json";
/// The version of its format.
const SITE_VERSION: u32 = 1;
/// The most bytes of it.
const MAX_SITE_FILE_BYTES: u64 = 64 << 20;

/// `luxproof-site.json`: a site and its files.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct SiteList {
    /// Version of the format: 1.
    luxproof_site: u32,
    /// The files of the site, relative to its root, with `/` between their parts; this file is not one of them.
    files: BTreeSet<SitePath>,
}

/// A path of a file below the root of a site.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
struct SitePath(String);

impl TryFrom<String> for SitePath {
    type Error = String;

    fn try_from(text: String) -> Result<Self, String> {
        let is_below = !text.is_empty() && text.split('/').all(|part| !matches!(part, "" | "." | ".."));
        if is_below { Ok(Self(text)) } else { Err(format!("`{}` is no path of a file of a site", quoted(&text))) }
    }
}

impl From<SitePath> for String {
    fn from(path: SitePath) -> Self {
        path.0
    }
}

impl SitePath {
    fn below(root: &Path, file: &Path) -> Option<Self> {
        let parts = file.strip_prefix(root).ok()?.components().map(|part| match part {
            Component::Normal(name) => name.to_str(),
            _ => None,
        });
        let parts: Vec<&str> = parts.collect::<Option<_>>()?;
        Self::try_from(parts.join("/")).ok()
    }

    fn under(&self, root: &Path) -> PathBuf {
        root.join(&self.0)
    }
}

/// Why a folder takes no site.
#[derive(Debug, thiserror::Error)]
pub enum SiteFolderError {
    #[error(transparent)]
    File(#[from] FileError),
    #[error("{folder} holds files and no site of score cards: name another folder")]
    Occupied { folder: String },
    #[error("{file} lists no files of a site: {why}; name another folder")]
    List { file: String, why: String },
    #[error(
        "{file} is no file of the site that luxproof wrote there, and the new site has one of that name: move it away"
    )]
    Foreign { file: String },
    #[error("{link} is a link, through which luxproof removes and writes nothing: name another folder")]
    Link { link: String },
}

/// A folder for a site: new, empty, or with a site that luxproof wrote.
#[derive(Debug)]
pub struct SiteFolder {
    root: PathBuf,
    /// The files of the site that is there.
    files: BTreeSet<SitePath>,
}

impl SiteFolder {
    /// Looks at a folder. One with other files than those of a site is refused.
    pub fn open(root: &Path) -> Result<Self, SiteFolderError> {
        let file = root.join(SITE_FILE);
        let files = if fs::symlink_metadata(&file).is_ok() {
            let bytes = files::read_bounded(&file, MAX_SITE_FILE_BYTES).map_err(|e| FileError::of(&file, e))?;
            let refused = |why: String| SiteFolderError::List { file: quoted_path(&file), why };
            let list: SiteList = foreign_json::from_slice(&bytes).map_err(|e| refused(quoted(&e.to_string())))?;
            if list.luxproof_site != SITE_VERSION {
                return Err(refused(format!("it is of version {}", list.luxproof_site)));
            }
            list.files
        } else if root.read_dir().is_ok_and(|mut entries| entries.next().is_some()) {
            return Err(SiteFolderError::Occupied { folder: quoted_path(root) });
        } else {
            BTreeSet::new()
        };
        Ok(Self { root: root.to_owned(), files })
    }

    /// Puts the files that `fill` writes in the place of the site. Other files in the folder stay.
    ///
    /// A killed process leaves a mixture of both. All its files are listed, so the next call replaces them.
    pub fn replace(&self, fill: impl FnOnce(&Path) -> io::Result<()>) -> Result<(), SiteFolderError> {
        let failed = |e: io::Error| FileError::of(&self.root, e);
        fs::create_dir_all(&self.root).map_err(failed)?;
        files::sweep(&self.root);
        let stage = tempfile::Builder::new().prefix(files::UNFINISHED).tempdir_in(&self.root).map_err(failed)?;
        // The lock shows `sweep` that a writer lives.
        let lock = File::open(stage.path()).map_err(failed)?;
        lock.try_lock().ok();
        fill(stage.path()).map_err(failed)?;
        let new = files_below(stage.path())?;
        for path in self.files.union(&new) {
            self.check(path)?;
        }
        self.write_list(self.files.union(&new).cloned().collect())?;
        for path in &new {
            let (from, to) = (path.under(stage.path()), path.under(&self.root));
            let folder = to.parent().unwrap_or(&self.root);
            fs::create_dir_all(folder).and_then(|()| fs::rename(&from, &to)).map_err(|e| FileError::of(&to, e))?;
        }
        for path in self.files.difference(&new) {
            self.remove(path)?;
        }
        self.write_list(new)
    }

    /// Refuses what luxproof did not write, and ways through links.
    fn check(&self, path: &SitePath) -> Result<(), SiteFolderError> {
        let mut place = self.root.clone();
        for part in path.0.split('/') {
            place.push(part);
            if fs::symlink_metadata(&place).is_ok_and(|metadata| metadata.is_symlink()) {
                return Err(SiteFolderError::Link { link: quoted_path(&place) });
            }
        }
        if place.exists() && !self.files.contains(path) {
            return Err(SiteFolderError::Foreign { file: quoted_path(&place) });
        }
        Ok(())
    }

    fn write_list(&self, files: BTreeSet<SitePath>) -> Result<(), SiteFolderError> {
        let list = SiteList { luxproof_site: SITE_VERSION, files };
        let text =
            serde_json::to_string_pretty(&list).map_err(io::Error::from).map_err(|e| FileError::of(&self.root, e))?;
        Ok(files::keep_shared(&self.root.join(SITE_FILE), (text + "\n").as_bytes())?)
    }

    /// Removes a file of the site, and the folders that are empty without it.
    fn remove(&self, path: &SitePath) -> Result<(), SiteFolderError> {
        let file = path.under(&self.root);
        match fs::symlink_metadata(&file) {
            // What became a folder is not what luxproof wrote.
            Ok(metadata) if !metadata.is_file() => return Ok(()),
            Ok(_) => fs::remove_file(&file).map_err(|e| FileError::of(&file, e))?,
            Err(error) if error.kind() == ErrorKind::NotFound => {}
            Err(error) => return Err(FileError::of(&file, error).into()),
        }
        let folders = file.ancestors().skip(1).take_while(|folder| *folder != self.root);
        for folder in folders {
            // This fails, as it should, while other files are in the folder.
            if fs::remove_dir(folder).is_err() {
                break;
            }
        }
        Ok(())
    }
}

/// The files below a folder.
fn files_below(root: &Path) -> Result<BTreeSet<SitePath>, SiteFolderError> {
    let mut found = BTreeSet::new();
    for entry in WalkDir::new(root).min_depth(1) {
        let entry = entry.map_err(|e| FileError::of(root, e))?;
        if entry.file_type().is_file() {
            found.extend(SitePath::below(root, entry.path()));
        }
    }
    Ok(found)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Writes a site of these files.
    fn write(root: &Path, files: &[&str]) -> Result<(), SiteFolderError> {
        SiteFolder::open(root)?.replace(|folder| {
            for file in files {
                let place = folder.join(file);
                fs::create_dir_all(place.parent().unwrap())?;
                fs::write(place, *file)?;
            }
            Ok(())
        })
    }

    fn names(root: &Path) -> Vec<String> {
        let all = files_below(root).unwrap();
        all.into_iter().map(String::from).collect()
    }

    #[test]
    fn a_site_is_replaced_and_every_other_file_stays() {
        let folder = tempfile::tempdir().unwrap();
        let root = folder.path().join("site");
        write(&root, &["index.html", "runs/a/report.json"]).unwrap();
        fs::write(root.join("CNAME"), "mine").unwrap();
        fs::write(root.join("runs/a/notes.txt"), "mine").unwrap();
        write(&root, &["index.html", "runs/b/report.json"]).unwrap();
        assert_eq!(names(&root), ["CNAME", "index.html", SITE_FILE, "runs/a/notes.txt", "runs/b/report.json"]);
        assert_eq!(fs::read_to_string(root.join("runs/a/notes.txt")).unwrap(), "mine");
        // A file that the user put where a page goes.
        fs::write(root.join("new.html"), "mine").unwrap();
        let error = write(&root, &["new.html"]).unwrap_err().to_string();
        assert!(error.contains("new.html") && error.contains("move it away"), "{error}");
        assert_eq!(fs::read_to_string(root.join("new.html")).unwrap(), "mine");
        assert!(root.join("index.html").is_file(), "a refusal removes nothing");
    }

    #[test]
    fn a_folder_that_luxproof_did_not_write_is_no_site() {
        let folder = tempfile::tempdir().unwrap();
        let root = folder.path();
        fs::write(root.join("cards.json"), "{}").unwrap();
        assert!(matches!(write(root, &["index.html"]), Err(SiteFolderError::Occupied { .. })));
        for list in [
            "{}",
            "{\"luxproof_site\": 2, \"files\": []}",
            "{\"luxproof_site\": 1, \"files\": [\"../outside\"]}",
            "{\"luxproof_site\": 1, \"files\": [\"/etc/passwd\"]}",
            "{\"luxproof_site\": 1, \"files\": [\"a//b\"]}",
        ] {
            fs::write(root.join(SITE_FILE), list).unwrap();
            assert!(matches!(write(root, &["index.html"]), Err(SiteFolderError::List { .. })), "{list}");
        }
        assert_eq!(names(root), ["cards.json", SITE_FILE]);
    }

    #[test]
    fn no_link_in_a_site_leads_what_is_removed_or_written_elsewhere() {
        let folder = tempfile::tempdir().unwrap();
        let (root, outside) = (folder.path().join("site"), folder.path().join("outside"));
        fs::create_dir(&outside).unwrap();
        fs::write(outside.join("a.html"), "mine").unwrap();
        fs::create_dir(&root).unwrap();
        std::os::unix::fs::symlink(&outside, root.join("runs")).unwrap();
        fs::write(root.join(SITE_FILE), "{\"luxproof_site\": 1, \"files\": [\"runs/a.html\"]}").unwrap();
        for files in [&["index.html"][..], &["runs/a.html"]] {
            assert!(matches!(write(&root, files), Err(SiteFolderError::Link { .. })));
        }
        assert_eq!(fs::read_to_string(outside.join("a.html")).unwrap(), "mine");
    }
}
