//! Checks whether installed files have changed. Python packages have hashes in the `RECORD` of their wheel, Debian packages have
//! `md5sums`.

use std::fs;
use std::path::{Path, PathBuf};

use base64::Engine as _;
use base64::prelude::BASE64_URL_SAFE_NO_PAD;
use md5::Md5;
use rayon::prelude::*;
use sha2::{Digest as _, Sha256};

use super::debian;
use crate::EngineRoot;
use luxproof_process::digest::hexadecimal;

/// The result of a check.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Soundness {
    /// This many files are unchanged.
    Sound(usize),
    /// The faults, one line per file.
    Broken(Vec<String>),
    /// The package is not installed.
    Absent,
    /// There are no checksums, for the given reason.
    Unknown(String),
}

/// A file and its expected digest.
struct Entry {
    path: PathBuf,
    digest: Digest,
}

/// The digest of a file as its package states it.
#[derive(Clone, Debug, PartialEq, Eq)]
enum Digest {
    Sha256(Vec<u8>),
    Md5(String),
}

impl Digest {
    fn matches(&self, bytes: &[u8]) -> bool {
        match self {
            Self::Sha256(digest) => Sha256::digest(bytes)[..] == digest[..],
            Self::Md5(digest) => hexadecimal(&Md5::digest(bytes)) == *digest,
        }
    }
}

impl Entry {
    /// Returns what is wrong with the file, or `None` if it is unchanged.
    fn fault(&self) -> Option<String> {
        match fs::read(&self.path) {
            Ok(bytes) if self.digest.matches(&bytes) => None,
            Ok(_) => Some(format!("{} is not what was installed", self.path.display())),
            Err(error) => Some(format!("{}: {error}", self.path.display())),
        }
    }
}

/// Checks all files in parallel.
fn check_files(entries: &[Entry]) -> Soundness {
    let faults: Vec<String> = entries.par_iter().filter_map(Entry::fault).collect();
    if faults.is_empty() { Soundness::Sound(entries.len()) } else { Soundness::Broken(faults) }
}

/// Checks the packages of the virtual environment. `pinned` lists the required names with versions.
pub(super) fn python(site: &EngineRoot, pinned: &[String]) -> Soundness {
    if !site.venv().exists() {
        return Soundness::Absent;
    }
    if site.python().is_none() {
        return Soundness::Broken(vec![format!("{}: there is no Python", site.venv().display())]);
    }
    let records: Vec<PathBuf> = site.python_folders().iter().flat_map(|folder| records(folder)).collect();
    let mut packages = pinned.iter();
    if let Some(package) = packages.find(|package| !records.iter().any(|record| belongs_to(record, package))) {
        return Soundness::Broken(vec![format!("{package} is not there")]);
    }
    match records.iter().map(|record| parse_record(record)).collect::<Result<Vec<_>, _>>() {
        Ok(entries) => check_files(&entries.into_iter().flatten().collect::<Vec<_>>()),
        Err(what) => Soundness::Broken(vec![what]),
    }
}

/// Lists the `RECORD` files in a folder of packages.
fn records(folder: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).into_iter().flatten().flatten().map(|entry| entry.path());
    entries.filter(|path| path.extension().is_some_and(|e| e == "dist-info")).map(|path| path.join("RECORD")).collect()
}

/// Returns whether a record belongs to a package such as `mitsuba==3.9.1`.
fn belongs_to(record: &Path, package: &str) -> bool {
    let folder = record.parent().and_then(Path::file_name).unwrap_or_default().to_string_lossy().into_owned();
    let installed = folder.strip_suffix(".dist-info").and_then(|folder| folder.split_once('-'));
    match (package.split_once("=="), installed) {
        (Some((name, version)), Some((installed_name, installed_version))) => {
            normalized(installed_name) == normalized(name) && installed_version == version
        }
        _ => false,
    }
}

/// Returns a package's name as wheels spell it in folder names.
fn normalized(name: &str) -> String {
    name.to_lowercase().replace(['-', '.'], "_")
}

/// Reads the digests of a record. It skips compiled files, which have no hash or one that does not last.
fn parse_record(record: &Path) -> Result<Vec<Entry>, String> {
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
            entries.push(Entry { path: packages.join(&row[0]), digest: Digest::Sha256(digest) });
        }
    }
    Ok(entries)
}

/// Checks the Debian packages that contain a program or library: the system's `packages`, or those unpacked into the site.
pub(super) fn debian(site: &EngineRoot, found: Option<PathBuf>, packages: &[&str]) -> Soundness {
    let Some(found) = found else { return Soundness::Absent };
    let (root, sums) = if found.starts_with(site.debian()) {
        (site.debian(), sum_files(&debian::sums(site), |_| true))
    } else {
        // dpkg names the file of sums after the package, or after package:architecture.
        let sums = sum_files(Path::new("/var/lib/dpkg/info"), |stem| {
            packages.contains(&stem.split(':').next().unwrap_or_default())
        });
        (PathBuf::from("/"), sums)
    };
    let entries: Vec<Entry> = sums.iter().flat_map(|file| parse_sums(&root, file)).collect();
    // The file found may come from another package, or from no package at all.
    let real = found.canonicalize().unwrap_or(found);
    if entries.iter().any(|entry| entry.path.canonicalize().is_ok_and(|path| path == real) || entry.path == real) {
        check_files(&entries)
    } else {
        Soundness::Unknown(format!("no Debian package says what {} should be", real.display()))
    }
}

/// Lists the files of sums in a folder that belong to a wanted package.
fn sum_files(folder: &Path, is_wanted: impl Fn(&str) -> bool) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).into_iter().flatten().flatten().map(|entry| entry.path());
    entries.filter(|path| package_of_sums(path).is_some_and(&is_wanted)).collect()
}

/// Returns the package that a file of sums is named after.
fn package_of_sums(path: &Path) -> Option<&str> {
    path.file_name()?.to_str()?.strip_suffix(".md5sums")
}

/// Reads a file of sums. Each line has a digest, two spaces, and a path without its first slash.
fn parse_sums(root: &Path, sums: &Path) -> Vec<Entry> {
    let text = fs::read_to_string(sums).unwrap_or_default();
    let lines = text.lines().filter_map(|line| line.split_once("  "));
    lines.map(|(digest, path)| Entry { path: root.join(path), digest: Digest::Md5(digest.to_owned()) }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Makes a site with one package, which has one source file and one compiled file.
    fn site(root: &Path) -> EngineRoot {
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
        EngineRoot::at(root)
    }

    #[test]
    fn a_python_package_is_sound_until_a_file_of_it_changes_or_is_gone() {
        let root = tempfile::tempdir().unwrap();
        let pinned = ["Lamp==1.0".to_owned()];
        assert_eq!(python(&EngineRoot::at(root.path()), &pinned), Soundness::Absent);
        let site = site(root.path());
        assert_eq!(python(&site, &pinned), Soundness::Sound(1));
        assert!(faults(&site, &["Lamp==1.1".to_owned()]).contains("Lamp==1.1 is not there"));
        let file = root.path().join("venv/lib/python3.12/site-packages/lamp.py");
        fs::write(&file, "luy").unwrap();
        assert!(faults(&site, &pinned).contains("lamp.py is not what was installed"));
        fs::remove_file(&file).unwrap();
        assert!(faults(&site, &pinned).contains("lamp.py: No such file"));
    }

    /// Returns the faults of a site's Python packages.
    fn faults(site: &EngineRoot, pinned: &[String]) -> String {
        match python(site, pinned) {
            Soundness::Broken(faults) => faults.join("; "),
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn what_was_unpacked_is_compared_with_its_sums_and_what_is_not_ours_is_not_known() {
        let root = tempfile::tempdir().unwrap();
        let site = EngineRoot::at(root.path());
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
