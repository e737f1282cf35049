//! Whether what is installed is still what was installed: Python packages by the hashes that wheels bring along (`RECORD`), Debian
//! packages by their `md5sums`.

use std::fs;
use std::path::{Path, PathBuf};

use base64::Engine as _;
use base64::prelude::BASE64_URL_SAFE_NO_PAD;
use md5::Md5;
use rayon::prelude::*;
use sha2::{Digest, Sha256};

use super::debian;
use crate::engines::Site;
use crate::system::digest::hexadecimal;

/// What an examination came to.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Soundness {
    /// So many files are what they were.
    Sound(usize),
    /// What is wrong, a line a file.
    Broken(Vec<String>),
    /// It is not there.
    Absent,
    /// Nothing says what it should be.
    Unknown(String),
}

/// A file and the digest that it should have.
struct Entry {
    path: PathBuf,
    digest: Expected,
}

#[derive(Clone, Debug, PartialEq, Eq)]
enum Expected {
    Sha256(Vec<u8>),
    Md5(String),
}

impl Entry {
    fn fault(&self) -> Option<String> {
        let is_same = |bytes: Vec<u8>| match &self.digest {
            Expected::Sha256(digest) => Sha256::digest(bytes)[..] == digest[..],
            Expected::Md5(digest) => hexadecimal(&Md5::digest(bytes)) == *digest,
        };
        match fs::read(&self.path).map(is_same) {
            Ok(true) => None,
            Ok(false) => Some(format!("{} is not what was installed", self.path.display())),
            Err(error) => Some(format!("{}: {error}", self.path.display())),
        }
    }
}

fn examined(entries: &[Entry]) -> Soundness {
    let faults: Vec<String> = entries.par_iter().filter_map(Entry::fault).collect();
    if faults.is_empty() { Soundness::Sound(entries.len()) } else { Soundness::Broken(faults) }
}

/// The packages of the virtual environment; `pinned` are the names with versions that it should have.
pub(super) fn python(site: &Site, pinned: &[String]) -> Soundness {
    if !site.venv().exists() {
        return Soundness::Absent;
    }
    let broken = |what: String| Soundness::Broken(vec![what]);
    if site.python().is_none() {
        return broken(format!("{}: there is no Python", site.venv().display()));
    }
    let records: Vec<PathBuf> = site.python_folders().iter().flat_map(|folder| records(folder)).collect();
    let has = |package: &&String| records.iter().any(|record| is_of(record, package));
    if let Some(package) = pinned.iter().find(|package| !has(package)) {
        return broken(format!("{package} is not there"));
    }
    match records.iter().map(|record| recorded(record)).collect::<Result<Vec<_>, _>>() {
        Ok(entries) => examined(&entries.into_iter().flatten().collect::<Vec<_>>()),
        Err(what) => broken(what),
    }
}

/// The `RECORD`s of a folder of packages.
fn records(folder: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).into_iter().flatten().flatten().map(|entry| entry.path());
    entries.filter(|path| path.extension().is_some_and(|e| e == "dist-info")).map(|path| path.join("RECORD")).collect()
}

/// Whether a record is of a package such as `mitsuba==3.9.1`.
fn is_of(record: &Path, package: &str) -> bool {
    let plain = |name: &str| name.to_lowercase().replace(['-', '.'], "_");
    let folder = record.parent().and_then(Path::file_name).unwrap_or_default().to_string_lossy().into_owned();
    package.split_once("==").is_some_and(|(name, version)| {
        let named = folder.strip_suffix(".dist-info").and_then(|folder| folder.split_once('-'));
        named.is_some_and(|(n, v)| plain(n) == plain(name) && v == version)
    })
}

/// What a record says of files, less what Python compiles: that has no hash, or one that does not last.
fn recorded(record: &Path) -> Result<Vec<Entry>, String> {
    let unreadable = |why: String| format!("{}: {why}", record.display());
    let mut rows =
        csv::ReaderBuilder::new().has_headers(false).from_path(record).map_err(|e| unreadable(e.to_string()))?;
    let packages = record.parent().and_then(Path::parent).unwrap_or(Path::new("/"));
    let mut entries = vec![];
    for row in rows.records() {
        let row = row.map_err(|e| unreadable(e.to_string()))?;
        let hash = row.get(1).filter(|_| !row[0].contains("__pycache__/")).unwrap_or_default();
        if let Some(hash) = hash.strip_prefix("sha256=") {
            let digest = BASE64_URL_SAFE_NO_PAD.decode(hash).map_err(|e| unreadable(format!("`{hash}`: {e}")))?;
            entries.push(Entry { path: packages.join(&row[0]), digest: Expected::Sha256(digest) });
        }
    }
    Ok(entries)
}

/// The packages that brought a program or library from Debian: system-wide those of these names, or what was unpacked into the site.
pub(super) fn debian(site: &Site, found: Option<PathBuf>, packages: &[&str]) -> Soundness {
    let Some(found) = found else { return Soundness::Absent };
    let (root, sums) = if found.starts_with(site.debian()) {
        (site.debian(), files_of(&debian::sums(site), |_| true))
    } else {
        let is_named = |stem: &str| packages.contains(&stem.split(':').next().unwrap_or_default());
        (PathBuf::from("/"), files_of(Path::new("/var/lib/dpkg/info"), is_named))
    };
    let entries: Vec<Entry> = sums.iter().flat_map(|file| summed(&root, file)).collect();
    // What is found may be another's, or have been there before.
    let real = found.canonicalize().unwrap_or(found);
    if entries.iter().any(|entry| entry.path.canonicalize().is_ok_and(|path| path == real) || entry.path == real) {
        examined(&entries)
    } else {
        Soundness::Unknown(format!("no Debian package says what {} should be", real.display()))
    }
}

fn files_of(folder: &Path, is_wanted: impl Fn(&str) -> bool) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).into_iter().flatten().flatten().map(|entry| entry.path());
    let stem = |path: &PathBuf| path.file_name()?.to_str()?.strip_suffix(".md5sums").map(str::to_owned);
    entries.filter(|path| stem(path).is_some_and(|stem| is_wanted(&stem))).collect()
}

/// The lines of a file of sums: a digest, two spaces, a path without its first slash.
fn summed(root: &Path, sums: &Path) -> Vec<Entry> {
    let text = fs::read_to_string(sums).unwrap_or_default();
    let entry = |line: &str| {
        let (digest, path) = line.split_once("  ")?;
        Some(Entry { path: root.join(path), digest: Expected::Md5(digest.to_owned()) })
    };
    text.lines().filter_map(entry).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A site with one package of one file, and one compiled.
    fn site(root: &Path) -> Site {
        let packages = root.join("venv/lib/python3.12/site-packages");
        fs::create_dir_all(packages.join("lamp-1.0.dist-info")).unwrap();
        fs::create_dir_all(root.join("venv/bin")).unwrap();
        fs::write(root.join("venv/bin/python"), "").unwrap();
        fs::write(packages.join("lamp.py"), "lux").unwrap();
        let digest = BASE64_URL_SAFE_NO_PAD.encode(Sha256::digest("lux"));
        let record = format!(
            "lamp.py,sha256={digest},3\n__pycache__/lamp.pyc,,\n__pycache__/old.pyc,sha256={digest},3\nlamp-1.0.dist-info/RECORD,,\n"
        );
        fs::write(packages.join("lamp-1.0.dist-info/RECORD"), record).unwrap();
        Site::at(root)
    }

    #[test]
    fn a_python_package_is_sound_until_a_file_of_it_changes_or_is_gone() {
        let root = tempfile::tempdir().unwrap();
        let pinned = ["Lamp==1.0".to_owned()];
        assert_eq!(python(&Site::at(root.path()), &pinned), Soundness::Absent);
        let site = site(root.path());
        assert_eq!(python(&site, &pinned), Soundness::Sound(1));
        let broken = |of: &[String]| match python(&site, of) {
            Soundness::Broken(faults) => faults.join("; "),
            other => panic!("{other:?}"),
        };
        assert!(broken(&["Lamp==1.1".to_owned()]).contains("Lamp==1.1 is not there"));
        let file = root.path().join("venv/lib/python3.12/site-packages/lamp.py");
        fs::write(&file, "luy").unwrap();
        assert!(broken(&pinned).contains("lamp.py is not what was installed"));
        fs::remove_file(&file).unwrap();
        assert!(broken(&pinned).contains("lamp.py: No such file"));
    }

    #[test]
    fn what_was_unpacked_is_held_against_its_sums_and_what_is_not_ours_is_not_known() {
        let root = tempfile::tempdir().unwrap();
        let site = Site::at(root.path());
        let program = site.debian().join("usr/bin/povray");
        fs::create_dir_all(program.parent().unwrap()).unwrap();
        fs::create_dir_all(debian::sums(&site)).unwrap();
        fs::write(&program, "light").unwrap();
        let examine = || debian(&site, Some(program.clone()), &["povray"]);
        assert!(matches!(examine(), Soundness::Unknown(_)));
        let sum = format!("{}  usr/bin/povray\n", hexadecimal(&Md5::digest("light")));
        fs::write(debian::sums(&site).join("povray.md5sums"), sum).unwrap();
        assert_eq!(examine(), Soundness::Sound(1));
        fs::write(&program, "dark").unwrap();
        assert!(matches!(examine(), Soundness::Broken(_)));
        assert!(matches!(debian(&site, Some(root.path().join("other")), &["povray"]), Soundness::Unknown(_)));
    }
}
