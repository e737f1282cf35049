//! POV-Ray, libLLVM, libfaketime and libraries of the system from Debian or Ubuntu: installed as root, otherwise downloaded by apt and unpacked into the site.
//!
//! Without root, apt works on lists and caches of our own below the site; what the system already has is not fetched.

use std::fs;
use std::path::{Path, PathBuf};

use itertools::Itertools;

use super::{InstallError, step};
use crate::EngineRoot;
use crate::libraries::{Libraries, with_unpacked};
use luxproof_process::files;

pub(super) const POVRAY_PACKAGES: [&str; 1] = ["povray"];
pub(super) const LIBFAKETIME_PACKAGES: [&str; 1] = ["libfaketime"];
pub(super) const CHROMIUM_PACKAGES: [&str; 2] = ["chromium", "chromium-browser"];
/// The libLLVM packages that Mitsuba works with, the best known first.
pub(super) const LLVM_PACKAGES: [&str; 5] = ["libllvm19", "libllvm20", "libllvm18", "libllvm17t64", "libllvm17"];

pub(super) fn install_povray(site: &EngineRoot, progress: &mut dyn FnMut(&str)) -> Result<String, InstallError> {
    let remedy = "install POV-Ray 3.7 so that `povray` is on PATH (macOS: `brew install povray`)";
    let found = fetched(site, ("POV-Ray", &POVRAY_PACKAGES), |site| site.program("povray"), remedy, progress)?;
    // Seen to start, with the libraries that were unpacked beside it.
    with_unpacked(step(site, &found).args(["--version"]), site).run()?;
    Ok(found)
}

pub(super) fn install_llvm(site: &EngineRoot, progress: &mut dyn FnMut(&str)) -> Result<String, InstallError> {
    let remedy = "install LLVM 17 or later (macOS: `brew install llvm`)";
    fetched(site, ("libLLVM", &LLVM_PACKAGES), EngineRoot::llvm, remedy, progress)
}

pub(super) fn install_libfaketime(site: &EngineRoot, progress: &mut dyn FnMut(&str)) -> Result<String, InstallError> {
    let remedy = "install libfaketime, with which rtrace's random numbers can be repeated";
    fetched(site, ("libfaketime", &LIBFAKETIME_PACKAGES), EngineRoot::libfaketime, remedy, progress)
}

pub(super) fn install_libraries(
    libraries: &Libraries,
    site: &EngineRoot,
    progress: &mut dyn FnMut(&str),
) -> Result<String, InstallError> {
    let all: Vec<_> = libraries.missing(site).collect();
    for (file, package) in all {
        // One may have come with another.
        if site.library(file).is_none() {
            let remedy = format!("install the package that has {file}");
            fetched(site, (file, &[*package]), |site| site.library(file), &remedy, progress)?;
        }
    }
    Ok(libraries.found(site).ok_or_else(|| not_there(libraries.name, "see install.log"))?.display().to_string())
}

pub(super) fn install_chromium(site: &EngineRoot, progress: &mut dyn FnMut(&str)) -> Result<String, InstallError> {
    let remedy = "install Chromium or Chrome so that it is on PATH, or name it in CHROMIUM";
    fetched(site, ("Chromium", &CHROMIUM_PACKAGES), EngineRoot::chromium, remedy, progress)
}

/// Where the file is that the first of these packages brings.
fn fetched(
    site: &EngineRoot,
    (what, packages): (&str, &[&str]),
    find: impl Fn(&EngineRoot) -> Option<PathBuf>,
    remedy: &str,
    progress: &mut dyn FnMut(&str),
) -> Result<String, InstallError> {
    DebianInstaller::find(site, what, remedy)?.install(packages, progress)?;
    Ok(find(site).ok_or_else(|| not_there(what, remedy))?.display().to_string())
}

fn not_there(what: &str, remedy: &str) -> InstallError {
    let what = format!("apt-get ended well, but {what} is still not found");
    InstallError::Missing { what, remedy: remedy.to_owned() }
}

struct DebianInstaller<'a> {
    site: &'a EngineRoot,
    program: PathBuf,
    system_wide: bool,
}

impl<'a> DebianInstaller<'a> {
    fn find(site: &'a EngineRoot, what: &str, remedy: &str) -> Result<Self, InstallError> {
        let missing = |what: String| InstallError::Missing { what, remedy: remedy.to_owned() };
        let program = site.program("apt-get").ok_or_else(|| missing(format!("no apt-get to get {what} with")))?;
        let system_wide = rustix::process::geteuid().is_root();
        if !system_wide && site.program("dpkg").is_none() {
            return Err(missing(format!("no dpkg to unpack {what} with")));
        }
        Ok(Self { site, program, system_wide })
    }

    /// Installs the first of `packages` that the archive has; refreshes the lists once if it seems to have none.
    fn install(&self, packages: &[&str], progress: &mut dyn FnMut(&str)) -> Result<(), InstallError> {
        if self.first_of(packages, progress).is_ok() {
            return Ok(());
        }
        progress("refreshing the lists of Debian packages");
        // Old lists may serve even where they cannot be refreshed: the last word is the installation's.
        if let Err(error) = self.apt(&["update"]) {
            progress(&format!("the lists could not be refreshed: {error}"));
        }
        self.first_of(packages, progress)
    }

    fn first_of(&self, packages: &[&str], progress: &mut dyn FnMut(&str)) -> Result<(), InstallError> {
        let mut first_error = None;
        for package in packages {
            progress(&format!("installing {package}"));
            match self.install_one(package) {
                Ok(()) => return Ok(()),
                Err(error) => first_error = first_error.or(Some(error)),
            }
        }
        Err(first_error.unwrap_or_else(|| not_there("nothing", "name a package")))
    }

    fn install_one(&self, package: &str) -> Result<(), InstallError> {
        let install = ["install", "-y", "-q", "--no-install-recommends"];
        if self.system_wide {
            // What is there and broken is fetched again, too.
            return self.apt(&[&install[..], &["--reinstall", package]].concat());
        }
        // --reinstall: it may be installed where PATH does not lead; its dependencies then are there as well.
        self.apt(&[&install[..], &["--download-only", "--reinstall", package]].concat())?;
        self.unpack()
    }

    fn unpack(&self) -> Result<(), InstallError> {
        let archives = self.state().join("cache/archives");
        let entries = fs::read_dir(&archives).map_err(|e| InstallError::io(&archives, e))?;
        let packages: Vec<PathBuf> = entries.flatten().map(|e| e.path()).filter(|p| is_package(p)).sorted().collect();
        if packages.is_empty() {
            // Without lists apt-get ends well, having fetched nothing of a package that is installed elsewhere.
            return Err(not_there("any package to unpack", "see install.log in the folder of the engines"));
        }
        let root = self.site.debian();
        fs::create_dir_all(&root).map_err(|e| InstallError::io(&root, e))?;
        for package in &packages {
            self.keep_sums(package)?;
            step(self.site, "dpkg").args(["-x".as_ref(), package.as_os_str(), root.as_os_str()]).run()?;
            fs::remove_file(package).map_err(|e| InstallError::io(package, e))?;
        }
        Ok(())
    }

    /// Keeps what a package says of its files, which unpacking leaves behind.
    fn keep_sums(&self, package: &Path) -> Result<(), InstallError> {
        let kept = sums(self.site).join(package.with_extension("md5sums").file_name().unwrap_or_default());
        match step(self.site, "dpkg-deb").args(["--info".as_ref(), package.as_os_str(), "md5sums".as_ref()]).run() {
            Ok(said) => files::replace(&kept, &said.stdout).map_err(|e| InstallError::io(&kept, e)),
            // Not every package has sums.
            Err(_) => Ok(()),
        }
    }

    /// Runs apt-get, on our own lists and cache where the system's are not ours to change.
    fn apt(&self, args: &[&str]) -> Result<(), InstallError> {
        let run = step(self.site, &self.program).env("DEBIAN_FRONTEND", "noninteractive").env("LC_ALL", "C");
        if self.system_wide {
            run.args(["-o", "DPkg::Lock::Timeout=600"]).args(args).run()?;
            return Ok(());
        }
        let state = self.state();
        for folder in ["state/lists/partial", "cache/archives/partial"].map(|f| state.join(f)) {
            fs::create_dir_all(&folder).map_err(|e| InstallError::io(&folder, e))?;
        }
        let options = [
            "Debug::NoLocking=true".to_owned(),
            format!("Dir::State={}", state.join("state").display()),
            format!("Dir::Cache={}", state.join("cache").display()),
        ];
        run.args(options.into_iter().flat_map(|o| ["-o".to_owned(), o])).args(args).run()?;
        Ok(())
    }

    fn state(&self) -> PathBuf {
        self.site.root().join("apt")
    }
}

/// The folder of what unpacked packages say of their files.
pub(super) fn sums(site: &EngineRoot) -> PathBuf {
    site.root().join("debian-sums")
}

fn is_package(path: &Path) -> bool {
    path.extension().is_some_and(|e| e == "deb")
}
