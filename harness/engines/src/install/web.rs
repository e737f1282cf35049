//! The renderers of the web: Node.js in an environment of its own, and npm's packages as the lock pins them, by their hashes.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

use sha2::{Digest, Sha256};

use super::verify::Soundness;
use super::{InstallError, linked, step, venv};
use crate::EngineRoot;
use luxproof_process::digest::hexadecimal;

const MANIFEST: &str = include_str!("../../web/package.json");
const LOCK: &str = include_str!("../../web/package-lock.json");
/// What every file had when it was installed, beside `node_modules`.
const SUMS: &str = "sums.txt";

/// `packages` is a link to this folder.
fn folder(site: &EngineRoot) -> PathBuf {
    site.web().root().join(linked::folder_name("packages", LOCK))
}

pub(super) fn is_current(site: &EngineRoot) -> bool {
    let is_linked = site.web_packages().and_then(|link| link.canonicalize().ok()) == folder(site).canonicalize().ok();
    is_linked && venv::NODE.is_current(&site.web()) && matches!(sums_hold(&folder(site)), Soundness::Sound(_))
}

pub(super) fn soundness(site: &EngineRoot) -> Soundness {
    if site.web_packages().is_none() {
        return Soundness::Absent;
    }
    match (venv::NODE.soundness(&site.web()), sums_hold(&folder(site))) {
        (Soundness::Sound(a), Soundness::Sound(b)) => Soundness::Sound(a + b),
        (Soundness::Sound(_), broken) | (broken, _) => broken,
    }
}

pub(super) fn install(site: &EngineRoot, progress: &mut dyn FnMut(&str)) -> Result<String, InstallError> {
    let web = site.web();
    if !venv::NODE.is_current(&web) {
        venv::NODE.install(&web, progress)?;
    }
    let node = site.node().ok_or_else(|| InstallError::Missing {
        what: "Node.js is not there".into(),
        remedy: "see install.log".into(),
    })?;
    let npm = node.with_file_name("../lib/node_modules/npm/bin/npm-cli.js");
    let folder = folder(site);
    linked::remove(&folder)?;
    fs::create_dir_all(&folder).map_err(|e| InstallError::io(&folder, e))?;
    for (name, text) in [("package.json", MANIFEST), ("package-lock.json", LOCK)] {
        let path = folder.join(name);
        fs::write(&path, text).map_err(|e| InstallError::io(&path, e))?;
    }
    progress("downloading and installing the renderers of the web, about 30 MB (180 MB on disk)");
    // No package runs anything while it is installed, and npm keeps nothing elsewhere.
    let cache = folder.join("cache");
    let quiet = ["ci", "--ignore-scripts", "--no-audit", "--no-fund", "--no-update-notifier", "--cache"];
    step(&web, node).args([npm]).args(quiet).args([&cache]).args(["--prefix".into(), folder.clone()]).run()?;
    linked::remove(&cache)?;
    let sums = folder.join(SUMS);
    fs::write(&sums, sums_of(&folder)).map_err(|e| InstallError::io(&sums, e))?;
    let link = web.root().join("packages");
    linked::put_in_place(&link, &folder)?;
    Ok(link.display().to_string())
}

/// A line a file, as sha256sum prints it.
fn sums_of(folder: &Path) -> String {
    let files = walkdir::WalkDir::new(folder.join("node_modules")).sort_by_file_name().into_iter().flatten();
    let files = files.map(walkdir::DirEntry::into_path).filter(|path| path.is_file());
    files.map(|path| sum_line(folder, &path)).collect()
}

fn sum_line(folder: &Path, file: &Path) -> String {
    let name = file.strip_prefix(folder).unwrap_or(file).display();
    match fs::read(file) {
        Ok(bytes) => format!("{}  {name}\n", hexadecimal(&Sha256::digest(bytes))),
        Err(error) => format!("{error}  {name}\n"),
    }
}

fn sums_hold(folder: &Path) -> Soundness {
    let Ok(installed) = fs::read_to_string(folder.join(SUMS)) else {
        return Soundness::Broken(vec![format!("{} has no {SUMS}", folder.display())]);
    };
    let now = sums_of(folder);
    let now: BTreeSet<&str> = now.lines().collect();
    let faults: Vec<String> = installed
        .lines()
        .filter(|line| !now.contains(line))
        .filter_map(|line| line.split("  ").nth(1))
        .map(|name| format!("{} is not what was installed", folder.join(name).display()))
        .collect();
    if faults.is_empty() { Soundness::Sound(installed.lines().count()) } else { Soundness::Broken(faults) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_lock_pins_every_package_with_hashes_and_names_no_host() {
        let lock: serde_json::Value = serde_json::from_str(LOCK).unwrap();
        let packages = lock["packages"].as_object().unwrap().iter().filter(|(name, _)| !name.is_empty());
        let all: Vec<_> = packages.collect();
        assert!(all.len() >= 4 && all.iter().all(|(_, p)| p["integrity"].as_str().unwrap().starts_with("sha512-")));
        assert!(!LOCK.contains("http"), "a registry is named");
    }

    #[test]
    fn a_changed_file_is_reported_and_half_an_installation_is_none() {
        let root = tempfile::tempdir().unwrap();
        let modules = root.path().join("node_modules/three");
        fs::create_dir_all(&modules).unwrap();
        fs::write(modules.join("a.js"), "1").unwrap();
        assert!(matches!(sums_hold(root.path()), Soundness::Broken(_)));
        fs::write(root.path().join(SUMS), sums_of(root.path())).unwrap();
        assert_eq!(sums_hold(root.path()), Soundness::Sound(1));
        fs::write(modules.join("a.js"), "2").unwrap();
        let Soundness::Broken(faults) = sums_hold(root.path()) else { panic!("it was not noticed") };
        assert!(faults[0].contains("a.js"), "{faults:?}");
    }
}
