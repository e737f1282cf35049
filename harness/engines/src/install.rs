//! Installs the engines into the site: pinned Python packages, POV-Ray, a libLLVM and libfaketime; does nothing where all is there.
//!
//! As root, Debian packages are installed system-wide; otherwise they are downloaded and unpacked into the site.

mod debian;
mod linked;
mod venv;
mod verify;
mod web;

use std::fs::File;
use std::path::PathBuf;
use std::time::Duration;

use itertools::Itertools;
use luxproof_process::process::{Invocation, ProcessError};

use super::EngineRoot;
use super::catalogue::{ALL, entry, is_chosen};
use super::contract::{Component, Entry};
use super::libraries::{self, Libraries};
use super::releases::{self, KnownRelease};
use luxproof_model::EngineName;
use venv::Environment;
pub use verify::Soundness;

#[derive(Clone, Debug, PartialEq, Eq)]
pub struct InstallOutcome {
    pub component: &'static str,
    pub state: InstallState,
    /// One line for the user: where it is, or what is wrong and what to do.
    pub detail: String,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum InstallState {
    Present,
    Installed,
    /// It is not there, but the engines work without it, more slowly.
    Optional,
    Failed,
}

/// The locks of the Python packages that engines are installed from, by name.
pub const fn locks() -> [(&'static str, &'static str); 4] {
    [
        ("engines.lock", venv::SHARED.lock()),
        ("blender.lock", venv::BLENDER.lock()),
        ("luxcore.lock", venv::LUXCORE.lock()),
        ("node.lock", venv::NODE.lock()),
    ]
}

#[derive(Debug, thiserror::Error)]
pub(super) enum InstallError {
    #[error(transparent)]
    Process(#[from] ProcessError),
    #[error("{path}: {source}")]
    Io { path: String, source: std::io::Error },
    #[error("{what}; {remedy}")]
    Missing { what: String, remedy: String },
}

/// Longest time for one step: a download of some 150 MB over a slow line.
const LIMIT: Duration = Duration::from_secs(3600);

/// Installs what the named engines need (all engines but those on request if `engines` is empty), and says per component what was done.
///
/// `progress` gets each step before it starts. Another installation into the same site is waited for.
pub fn install(site: &EngineRoot, engines: &[EngineName], mut progress: impl FnMut(&str)) -> Vec<InstallOutcome> {
    let components = components(engines);
    // Held to the end, so that two installations never write the same folder.
    let lock = match lock(site) {
        Ok(lock) => lock,
        Err(error) => return components.iter().map(|c| c.failed(&error)).collect(),
    };
    let outcomes = components.iter().map(|c| c.install(site, &mut progress)).collect();
    drop(lock);
    outcomes
}

/// Whether what the named engines need (all engines but those on request if `engines` is empty) is what was installed, component by component.
pub fn verify(site: &EngineRoot, engines: &[EngineName]) -> Vec<(&'static str, Soundness)> {
    components(engines).into_iter().map(|component| (component.name(), component.soundness(site))).collect()
}

/// Installs anew what of it is broken or absent, and says per component what was done.
pub fn repair(site: &EngineRoot, engines: &[EngineName], mut progress: impl FnMut(&str)) -> Vec<InstallOutcome> {
    let components = components(engines);
    let lock = match lock(site) {
        Ok(lock) => lock,
        Err(error) => return components.iter().map(|c| c.failed(&error)).collect(),
    };
    let outcomes = components.iter().map(|c| c.repair(site, &mut progress)).collect();
    drop(lock);
    outcomes
}

fn components(engines: &[EngineName]) -> Vec<Component> {
    use Component::{Blender, Chromium, LibFaketime, LibLlvm, LuxCore, PovRay, PythonPackages, WebPackages};
    let small = [PythonPackages, PovRay, LibLlvm, LibFaketime, Component::Libraries(&libraries::ATOMIC)];
    let large = [Component::Libraries(&libraries::X11), Blender, LuxCore, WebPackages, Chromium];
    let named = ALL.iter().filter(|entry| is_chosen(&entry.name, engines));
    let known = engines.iter().filter_map(|name| releases::known(name));
    let releases = known.filter_map(|known| Some(of_release(known, entry(known.name)?))).flatten().collect_vec();
    let wanted = named.flat_map(|entry| entry.installs.iter().copied()).chain(releases.iter().copied()).collect_vec();
    let own = releases.into_iter().filter(|c| matches!(c, Component::Release(_)));
    small.into_iter().chain(large).filter(|c| wanted.contains(c)).chain(own).collect()
}

/// What a release needs: where it has packages of its own, these in place of its engine's.
fn of_release(known: &'static KnownRelease, entry: &Entry) -> impl Iterator<Item = Component> {
    let has_own = known.lock().is_some();
    entry.installs.iter().map(move |c| if has_own && c.is_python() { Component::Release(known) } else { *c })
}

fn lock(site: &EngineRoot) -> Result<File, InstallError> {
    std::fs::create_dir_all(site.root()).map_err(|e| InstallError::io(site.root(), e))?;
    let path = site.root().join("install.lock");
    let file = File::create(&path).map_err(|e| InstallError::io(&path, e))?;
    file.lock().map_err(|e| InstallError::io(&path, e))?;
    Ok(file)
}

fn step(site: &EngineRoot, program: impl Into<PathBuf>) -> Invocation {
    Invocation::new(program, site.root(), LIMIT, site.root().join("install.log")).of_user()
}

/// Installs into a site, telling each step before it starts, and says where.
type Installer = fn(&EngineRoot, &mut dyn FnMut(&str)) -> Result<String, InstallError>;

/// How a component comes to be there.
enum Recipe {
    /// Packages of Python, and the site that they have for themselves.
    Python(Environment, EngineRoot),
    /// Node.js and packages of npm.
    Npm,
    /// Packages of Debian, the program or library of theirs that engines use, and what installs them.
    Debian { packages: &'static [&'static str], found: fn(&EngineRoot) -> Option<PathBuf>, install: Installer },
    /// Libraries of the system.
    Libraries(&'static Libraries),
}

impl Recipe {
    /// Where it is, unless something of it is missing or not what was installed.
    fn present(&self, site: &EngineRoot) -> Option<PathBuf> {
        match self {
            Self::Python(environment, own) => Some(own.venv()).filter(|_| environment.is_current(own)),
            Self::Npm => site.web_packages().filter(|_| web::is_current(site)),
            Self::Debian { found, .. } => found(site),
            Self::Libraries(libraries) => libraries.found(site),
        }
    }
}

impl Component {
    const fn name(self) -> &'static str {
        match self {
            Self::PythonPackages => "Python packages",
            Self::PovRay => "POV-Ray",
            Self::LibLlvm => "libLLVM",
            Self::LibFaketime => "libfaketime",
            Self::Libraries(libraries) => libraries.name,
            Self::Blender => "Blender",
            Self::LuxCore => "LuxCore",
            Self::WebPackages => "renderers of the web",
            Self::Chromium => "Chromium",
            Self::Release(known) => known.name,
        }
    }

    fn install(self, site: &EngineRoot, progress: &mut dyn FnMut(&str)) -> InstallOutcome {
        match self.recipe(site).present(site) {
            Some(path) => self.outcome(InstallState::Present, path.display().to_string()),
            None => self.install_anew(site, progress),
        }
    }

    fn repair(self, site: &EngineRoot, progress: &mut dyn FnMut(&str)) -> InstallOutcome {
        match self.soundness(site) {
            Soundness::Sound(files) => self.outcome(InstallState::Present, format!("{files} files are as installed")),
            Soundness::Unknown(why) => self.outcome(InstallState::Present, why),
            Soundness::Broken(_) | Soundness::Absent => self.install_anew(site, progress),
        }
    }

    fn recipe(self, site: &EngineRoot) -> Recipe {
        let debian = |packages, found, install| Recipe::Debian { packages, found, install };
        match self {
            Self::PythonPackages => Recipe::Python(venv::SHARED, site.clone()),
            Self::Blender => Recipe::Python(venv::BLENDER, site.blender()),
            Self::LuxCore => Recipe::Python(venv::LUXCORE, site.luxcore()),
            Self::Release(known) => {
                let (environment, own) = venv::of_release(known, site);
                Recipe::Python(environment, own)
            }
            Self::PovRay => debian(&debian::POVRAY_PACKAGES, |site| site.program("povray"), debian::install_povray),
            Self::LibLlvm => debian(&debian::LLVM_PACKAGES, EngineRoot::llvm, debian::install_llvm),
            Self::WebPackages => Recipe::Npm,
            Self::Chromium => debian(&debian::CHROMIUM_PACKAGES, EngineRoot::chromium, debian::install_chromium),
            Self::Libraries(libraries) => Recipe::Libraries(libraries),
            Self::LibFaketime => {
                debian(&debian::LIBFAKETIME_PACKAGES, EngineRoot::libfaketime, debian::install_libfaketime)
            }
        }
    }

    fn soundness(self, site: &EngineRoot) -> Soundness {
        match self.recipe(site) {
            Recipe::Python(environment, own) => environment.soundness(&own),
            Recipe::Npm => web::soundness(site),
            Recipe::Debian { packages, found, .. } => verify::debian(site, found(site), packages),
            Recipe::Libraries(libraries) => verify::debian(site, libraries.found(site), &libraries.packages()),
        }
    }

    fn install_anew(self, site: &EngineRoot, progress: &mut dyn FnMut(&str)) -> InstallOutcome {
        let installed = match self.recipe(site) {
            Recipe::Python(environment, own) => environment.install(&own, progress),
            Recipe::Npm => web::install(site, progress),
            Recipe::Debian { install, .. } => install(site, progress),
            Recipe::Libraries(libraries) => debian::install_libraries(libraries, site, progress),
        };
        match installed {
            Ok(detail) => self.outcome(InstallState::Installed, detail),
            Err(error) if self == Self::LibLlvm => {
                let detail = format!("Mitsuba will run its scalar_rgb variant, about 10x slower: {error}");
                self.outcome(InstallState::Optional, detail)
            }
            // They may lie where the system knows and we do not; an engine that lacks them says so itself.
            Err(error) if matches!(self, Self::Libraries(_)) => {
                self.outcome(InstallState::Optional, format!("programs that want them will not start: {error}"))
            }
            Err(error) => self.failed(&error),
        }
    }

    fn failed(self, error: &InstallError) -> InstallOutcome {
        self.outcome(InstallState::Failed, error.to_string())
    }

    fn outcome(self, state: InstallState, detail: String) -> InstallOutcome {
        InstallOutcome { component: self.name(), state, detail }
    }
}

impl InstallError {
    fn io(path: &std::path::Path, source: std::io::Error) -> Self {
        Self::Io { path: path.display().to_string(), source }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ATOMIC: Component = Component::Libraries(&libraries::ATOMIC);
    const X11: Component = Component::Libraries(&libraries::X11);

    #[test]
    fn every_engine_gets_what_it_needs_and_no_more() {
        use Component::{LibFaketime, LibLlvm, PovRay, PythonPackages};
        assert_eq!(components(&[]), [PythonPackages, PovRay, LibLlvm, LibFaketime, ATOMIC]);
        assert_eq!(components(&[EngineName::new("radiance")]), [PythonPackages, LibFaketime]);
        let two = [EngineName::new("povray"), EngineName::new("radiance")];
        assert_eq!(components(&two), [PythonPackages, PovRay, LibFaketime]);
        assert_eq!(components(&[EngineName::new("mitsuba")]), [PythonPackages, LibLlvm, ATOMIC]);
        assert_eq!(components(&[EngineName::new("cycles")]), [X11, Component::Blender]);
        assert_eq!(components(&[EngineName::new("luxcore")]), [ATOMIC, Component::LuxCore]);
        for name in ["three", "babylon", "three-gpu-pathtracer"] {
            assert_eq!(components(&[EngineName::new(name)]), [Component::WebPackages, Component::Chromium]);
        }
        let release = releases::known("mitsuba@3.5.2").unwrap();
        assert_eq!(components(&[EngineName::new("mitsuba@3.5.2")]), [LibLlvm, ATOMIC, Component::Release(release)]);
        // The release that the engine is, is where it is.
        assert_eq!(components(&[EngineName::new("mitsuba@3.9.1")]), [PythonPackages, LibLlvm, ATOMIC]);
        assert_eq!(components(&[EngineName::new("simulator"), EngineName::new("iesna")]), []);
    }

    #[test]
    fn a_site_that_cannot_be_written_fails_each_component_with_its_path() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("file");
        std::fs::write(&file, "").unwrap();
        let outcomes = install(&EngineRoot::at(file.join("site")), &[EngineName::new("radiance")], |_| {});
        assert_eq!(outcomes.len(), 2);
        assert_eq!(outcomes[0].state, InstallState::Failed);
        assert!(outcomes[0].detail.contains("site"), "{}", outcomes[0].detail);
    }
}
