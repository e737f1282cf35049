//! The site: the folder where luxproof keeps the engines it installed, and where else it looks for them.

use std::env;
use std::path::{Path, PathBuf};

use etcetera::BaseStrategy;

/// Where engines are found. Layout of the folder: `venv/` (Python packages), `debian/` (unpacked Debian packages).
#[derive(Clone, Debug)]
pub struct Site {
    root: PathBuf,
}

/// Why there is no place for engines.
#[derive(Debug, thiserror::Error)]
#[error("no folder for engines: {0}; name one with --engines-dir")]
pub struct SiteError(String);

impl Site {
    /// The site in a given folder.
    pub fn at(root: impl Into<PathBuf>) -> Self {
        Self { root: root.into() }
    }

    /// The site in the user's data folder, e.g. `~/.local/share/luxproof/engines`.
    pub fn of_user() -> Result<Self, SiteError> {
        let strategy = etcetera::choose_base_strategy().map_err(|e| SiteError(e.to_string()))?;
        Ok(Self::at(strategy.data_dir().join("luxproof").join("engines")))
    }

    /// The folder itself.
    pub fn root(&self) -> &Path {
        &self.root
    }

    /// The virtual environment of the pinned Python packages.
    pub fn venv(&self) -> PathBuf {
        self.root.join("venv")
    }

    /// The virtual environment's interpreter, if it is there.
    pub fn python(&self) -> Option<PathBuf> {
        Some(self.venv().join("bin/python")).filter(|p| p.exists())
    }

    /// The folder of an installed Python package, if it is there.
    pub fn python_package(&self, name: &str) -> Option<PathBuf> {
        let versions = std::fs::read_dir(self.venv().join("lib")).ok()?;
        let package = |v: std::fs::DirEntry| v.path().join("site-packages").join(name);
        versions.flatten().map(package).find(|p| p.is_dir())
    }

    /// The root of unpacked Debian packages.
    pub fn debian(&self) -> PathBuf {
        self.root.join("debian")
    }

    /// A program: first among our unpacked packages, then on PATH.
    pub fn program(&self, name: &str) -> Option<PathBuf> {
        let ours = self.debian().join("usr/bin").join(name);
        let on_path = env::var_os("PATH").into_iter().flat_map(|p| env::split_paths(&p).collect::<Vec<_>>());
        std::iter::once(ours).chain(on_path.map(|folder| folder.join(name))).find(|p| p.is_file())
    }

    /// Shared libraries whose file name starts with `prefix`, ours first, then the system's.
    pub fn libraries(&self, prefix: &str) -> Vec<PathBuf> {
        let triple = format!("{}-linux-gnu", env::consts::ARCH);
        let ours = ["usr/lib", "lib"].map(|l| self.debian().join(l));
        let roots = ours.into_iter().chain(["/usr/lib", "/usr/lib64", "/usr/local/lib"].map(PathBuf::from));
        let folders = roots.flat_map(|r| [r.join(&triple), r]);
        let files = folders.filter_map(|f| std::fs::read_dir(f).ok()).flat_map(Iterator::flatten);
        files.map(|f| f.path()).filter(|p| file_name_starts_with(p, prefix)).collect()
    }
}

fn file_name_starts_with(path: &Path, prefix: &str) -> bool {
    path.file_name().is_some_and(|n| n.to_string_lossy().starts_with(prefix))
}
