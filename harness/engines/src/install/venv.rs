//! The virtual environments of the pinned Python packages.

use std::fs;
use std::path::{Path, PathBuf};

use super::verify::{self, Soundness};
use super::{InstallError, linked, step};
use crate::EngineRoot;
use crate::releases::KnownRelease;
use luxproof_model::family;

/// What an environment holds, and which Python it takes.
#[derive(Clone, Copy)]
pub(super) struct Environment {
    lock: &'static str,
    what: &'static str,
    /// Its names, the first that fits is taken.
    python: &'static [&'static str],
    fits: fn([u32; 2]) -> bool,
    remedy: &'static str,
}

pub(super) const SHARED: Environment = Environment {
    lock: include_str!("../../engines.lock"),
    what: "Mitsuba, Radiance and OpenImageIO, about 150 MB",
    python: &["python3"],
    fits: |version| version >= [3, 10],
    remedy: "put Python 3.10 or later first on PATH",
};

pub(super) const BLENDER: Environment = Environment {
    lock: include_str!("../../blender.lock"),
    what: "Blender, about 350 MB (950 MB on disk)",
    python: &["python3.11", "python3"],
    fits: |version| version == [3, 11],
    remedy: "put a python3.11 on PATH, the only one that Blender 4.5 is made for; without root, `pip install uv` and `uv python install 3.11` bring one",
};

pub(super) const LUXCORE: Environment = Environment {
    lock: include_str!("../../luxcore.lock"),
    what: "LuxCore, about 100 MB (250 MB on disk)",
    python: BLENDER.python,
    fits: BLENDER.fits,
    remedy: "put a python3.11 on PATH; without root, `pip install uv` and `uv python install 3.11` bring one",
};

pub(super) const NODE: Environment = Environment {
    lock: include_str!("../../web/node.lock"),
    what: "Node.js, about 60 MB",
    python: &["python3"],
    fits: |version| version >= [3, 10],
    remedy: "put Python 3.10 or later first on PATH",
};

/// The environment of a release, and the site that it has for itself.
pub(super) fn of_release(known: &KnownRelease, site: &EngineRoot) -> (Environment, EngineRoot) {
    let (own, like) = match family(known.name) {
        "cycles" => (known.site(site).blender(), BLENDER),
        "luxcore" => (known.site(site).luxcore(), LUXCORE),
        _ => (
            known.site(site),
            Environment { python: LUXCORE.python, fits: LUXCORE.fits, remedy: LUXCORE.remedy, ..SHARED },
        ),
    };
    (Environment { lock: known.lock().unwrap_or(like.lock), what: known.name, ..like }, own)
}

impl Environment {
    pub(super) const fn lock(&self) -> &'static str {
        self.lock
    }

    pub(super) fn is_current(&self, site: &EngineRoot) -> bool {
        let linked = fs::read_link(site.venv()).is_ok_and(|target| target == Path::new(&self.folder_name()));
        linked && matches!(self.soundness(site), Soundness::Sound(_))
    }

    /// Whether the packages are what the lock pins and what was installed.
    pub(super) fn soundness(&self, site: &EngineRoot) -> Soundness {
        verify::python(site, &self.pinned())
    }

    /// The packages that every Python gets, as the lock names them: `mitsuba==3.9.1`.
    fn pinned(&self) -> Vec<String> {
        let lines = self.lock.lines().filter_map(|line| line.strip_suffix(" \\"));
        lines.filter(|line| line.contains("==") && !line.contains(';')).map(str::to_owned).collect()
    }

    fn folder_name(&self) -> String {
        linked::folder_name("venv", self.lock)
    }

    pub(super) fn install(&self, site: &EngineRoot, progress: &mut dyn FnMut(&str)) -> Result<String, InstallError> {
        fs::create_dir_all(site.root()).map_err(|e| InstallError::io(site.root(), e))?;
        let folder = site.root().join(self.folder_name());
        linked::remove(&folder)?;
        progress("making a Python environment");
        self.make(site, &folder)?;
        progress(&format!("downloading and installing {}", self.what));
        let lock = folder.join("engines.lock");
        fs::write(&lock, self.lock).map_err(|e| InstallError::io(&lock, e))?;
        let pip = ["-m", "pip", "install", "--no-input", "--disable-pip-version-check", "--no-cache-dir"];
        // The lock is whole: what a package asks for besides is left out on purpose.
        let pinned = ["--require-hashes", "--no-deps", "--only-binary", ":all:", "--requirement"];
        step(site, folder.join("bin/python")).args(pip).args(pinned).args([lock]).run()?;
        linked::put_in_place(&site.venv(), &folder)?;
        Ok(site.venv().display().to_string())
    }

    fn make(&self, site: &EngineRoot, folder: &Path) -> Result<(), InstallError> {
        let python = self.python(site)?;
        // Without ensurepip `python3 -m venv` fails, which Debian's python3 does until python3-venv is there.
        let made = step(site, &python).args(["-m", "venv"]).args([folder]).run();
        made.map(|_| ()).map_err(|error| InstallError::Missing {
            what: format!("`python3 -m venv` does not work: {error}"),
            remedy: "on Debian and Ubuntu `apt-get install python3-venv` provides what it needs".into(),
        })
    }

    fn python(&self, site: &EngineRoot) -> Result<PathBuf, InstallError> {
        let mut what = format!("there is no {}", self.python[0]);
        for python in self.python.iter().filter_map(|name| site.program(name)) {
            // A program of this name may be a stand-in for none.
            let asked = step(site, &python).args(["-c", "import sys; print('%d %d' % sys.version_info[:2])"]).run();
            let reported =
                asked.map(|done| String::from_utf8_lossy(&done.stdout).trim().to_owned()).unwrap_or_default();
            let numbers: Vec<u32> = reported.split(' ').filter_map(|n| n.parse().ok()).collect();
            match numbers[..] {
                [major, minor] if (self.fits)([major, minor]) => return Ok(python),
                [major, minor] => what = format!("{} is Python {major}.{minor}", python.display()),
                _ => what = format!("{} does not tell its version", python.display()),
            }
        }
        Err(InstallError::Missing { what, remedy: self.remedy.to_owned() })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A site whose environment was made by an installation of this lock.
    fn made(root: &Path) -> EngineRoot {
        let folder = root.join(SHARED.folder_name());
        fs::create_dir_all(folder.join("bin")).unwrap();
        fs::write(folder.join("bin/python"), "").unwrap();
        for package in SHARED.pinned() {
            let named = folder.join("lib/python3/site-packages").join(package.replace("==", "-") + ".dist-info");
            fs::create_dir_all(&named).unwrap();
            fs::write(named.join("RECORD"), "").unwrap();
        }
        let site = EngineRoot::at(root);
        linked::put_in_place(&site.venv(), &folder).unwrap();
        site
    }

    #[test]
    fn the_lock_pins_every_package_with_hashes() {
        for package in ["mitsuba==3.9.1", "drjit==1.5.0", "pyradiance==1.3.1", "openimageio==3.2.2.0", "numpy==2.4.6"] {
            let at = SHARED.lock.find(&format!("\n{package}")).unwrap_or_else(|| panic!("{package}"));
            assert!(SHARED.lock[at + 1..].lines().nth(1).is_some_and(|l| l.contains("--hash=sha256:")), "{package}");
        }
    }

    #[test]
    fn an_environment_is_current_only_for_the_lock_it_was_made_from() {
        let root = tempfile::tempdir().unwrap();
        assert!(!SHARED.is_current(&EngineRoot::at(root.path())));
        assert!(SHARED.is_current(&made(root.path())));
        fs::remove_file(root.path().join("venv")).unwrap();
        std::os::unix::fs::symlink("venv-0123", root.path().join("venv")).unwrap();
        assert!(!SHARED.is_current(&EngineRoot::at(root.path())));
    }

    #[test]
    fn a_half_made_environment_is_not_current_and_a_link_elsewhere_loses_only_the_link() {
        let root = tempfile::tempdir().unwrap();
        fs::create_dir_all(root.path().join(SHARED.folder_name())).unwrap();
        assert!(!SHARED.is_current(&EngineRoot::at(root.path())));
        let elsewhere = tempfile::tempdir().unwrap();
        fs::write(elsewhere.path().join("kept"), "").unwrap();
        std::os::unix::fs::symlink(elsewhere.path(), root.path().join("venv")).unwrap();
        assert!(SHARED.is_current(&made(root.path())));
        assert!(elsewhere.path().join("kept").exists());
    }

    #[test]
    fn environments_of_earlier_locks_and_real_folders_in_the_way_are_removed() {
        let root = tempfile::tempdir().unwrap();
        fs::create_dir_all(root.path().join("venv-old/bin")).unwrap();
        fs::create_dir_all(root.path().join("venv/bin")).unwrap();
        assert!(SHARED.is_current(&made(root.path())));
        assert!(!root.path().join("venv-old").exists());
    }
}
