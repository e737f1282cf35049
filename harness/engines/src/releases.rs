//! The releases of our engines that can be installed side by side: `mitsuba@3.5.2` is Mitsuba 3.5.2, in an environment of its own
//! beside the one that `mitsuba` is.

use super::EngineRoot;
use luxproof_model::{EngineName, Release, family};

/// A release that we know how to install.
#[derive(Debug, PartialEq, Eq)]
pub struct KnownRelease {
    /// As it is named: `mitsuba@3.5.2`.
    pub name: &'static str,
    /// The package that is of this release.
    pub(super) package: &'static str,
    home: Home,
    /// What it cannot do that its engine can, as running it showed.
    pub(super) cannot: Option<Cannot>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Cannot {
    /// Light that rtrace samples: its program is linked statically, so that libfaketime does not reach the clock that seeds it. Blocks of one
    /// second are then one block, whose scatter says nothing.
    HaveASeed,
    /// Look a table up as the release that our bound of its look-up was made for (`engines/cycles/ies.rs`): from 5.0 on a neighbour that is
    /// missing has the value of the one beside it, where it was dark.
    LookUpAsBefore,
    /// Load several scenes in one process: values are then 100 % too small to nine times too large in some runs. The cause is not known.
    LoadSeveralScenes,
}

#[derive(Debug, PartialEq, Eq)]
enum Home {
    /// Where `mitsuba` is.
    Shared,
    /// An environment of its own, made of what this pins.
    Own { lock: &'static str },
}

macro_rules! own {
    ($engine:literal, $release:literal, $package:literal) => {
        own!($engine, $release, $package, None)
    };
    ($engine:literal, $release:literal, $package:literal, $cannot:expr) => {
        KnownRelease {
            name: concat!($engine, "@", $release),
            package: concat!($package, "-", $release),
            home: Home::Own { lock: include_str!(concat!("../releases/", $engine, "-", $release, ".lock")) },
            cannot: $cannot,
        }
    };
}

const fn shared(name: &'static str, package: &'static str) -> KnownRelease {
    KnownRelease { name, package, home: Home::Shared, cannot: None }
}

/// By engine, oldest first. Locks are made by `ci/releases`; each was installed and run (`benchmarks/releases.md`).
static KNOWN: &[KnownRelease] = &[
    own!("mitsuba", "3.5.2", "mitsuba", Some(Cannot::LoadSeveralScenes)),
    own!("mitsuba", "3.6.4", "mitsuba"),
    own!("mitsuba", "3.7.1", "mitsuba"),
    own!("mitsuba", "3.8.0", "mitsuba"),
    own!("mitsuba", "3.9.0", "mitsuba"),
    shared("mitsuba@3.9.1", "mitsuba-3.9.1"),
    own!("radiance", "0.5.3", "pyradiance"),
    own!("radiance", "1.0.0", "pyradiance", Some(Cannot::HaveASeed)),
    own!("radiance", "1.0.4", "pyradiance", Some(Cannot::HaveASeed)),
    own!("radiance", "1.1.5", "pyradiance"),
    own!("radiance", "1.2.0", "pyradiance"),
    own!("radiance", "1.2.5", "pyradiance"),
    shared("radiance@1.3.1", "pyradiance-1.3.1"),
    own!("cycles", "4.2.0", "bpy"),
    own!("cycles", "4.4.0", "bpy"),
    shared("cycles@4.5.15", "bpy-4.5.15"),
    own!("cycles", "5.0.1", "bpy", Some(Cannot::LookUpAsBefore)),
    own!("luxcore", "2.10.0", "pyluxcore"),
    own!("luxcore", "2.10.1", "pyluxcore"),
    own!("luxcore", "2.11.0", "pyluxcore"),
    own!("luxcore", "2.11.1", "pyluxcore"),
    shared("luxcore@2.11.2", "pyluxcore-2.11.2"),
];

impl KnownRelease {
    fn release(&self) -> Option<Release> {
        EngineName::new(self.name).release()
    }

    /// The environment that has to be made for it; `None` where it is the engine's own.
    pub(super) const fn lock(&self) -> Option<&'static str> {
        match self.home {
            Home::Shared => None,
            Home::Own { lock } => Some(lock),
        }
    }

    /// Where it lives, which is a site like that of all engines.
    pub(super) fn site(&self, site: &EngineRoot) -> EngineRoot {
        match self.home {
            Home::Shared => site.clone(),
            Home::Own { .. } => site.release(&self.name.replace('@', "-")),
        }
    }

    /// Whether the environment holds the package of this release, whatever a link there leads to.
    pub(super) fn is_in(&self, site: &EngineRoot) -> bool {
        let named = format!("{}.dist-info", self.package);
        [site.clone(), site.blender(), site.luxcore()].iter().any(|s| s.python_package(&named).is_some())
    }
}

/// The releases of an engine of ours that can be installed, oldest first; none where nobody knows any.
pub(super) fn of(engine: &str) -> impl Iterator<Item = &'static KnownRelease> {
    KNOWN.iter().filter(move |known| family(known.name) == engine)
}

/// Their numbers.
pub fn releases_of(engine: &str) -> Vec<Release> {
    of(engine).filter_map(KnownRelease::release).collect()
}

/// The release of an engine's default installation, where that is one that we know.
pub fn installed_release(engine: &str, site: &EngineRoot) -> Option<Release> {
    of(engine).find(|known| known.home == Home::Shared && known.is_in(site)).and_then(KnownRelease::release)
}

/// The package of an engine with its release, such as `pyradiance 1.3.1`, where it is one that we know.
pub fn installed_package(engine: &EngineName, site: &EngineRoot) -> Option<String> {
    let of_default = || of(engine.as_str()).find(|release| release.home == Home::Shared && release.is_in(site));
    let found = known(engine.as_str()).or_else(of_default)?;
    Some(found.package.replacen('-', " ", 1))
}

/// A release by its name.
pub(super) fn known(name: &str) -> Option<&'static KnownRelease> {
    KNOWN.iter().find(|known| known.name == name)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn locks_pin_the_release_that_they_are_named_after_with_hashes_and_stand_oldest_first() {
        for known in KNOWN {
            let pinned = known
                .package
                .rsplit_once('-')
                .map(|(name, release)| format!("\n{name}=={release} \\\n    --hash=sha256:"));
            let defaults = ["engines", "blender", "luxcore"].map(|name| {
                let path = format!("{}/{name}.lock", env!("CARGO_MANIFEST_DIR"));
                std::fs::read_to_string(path).unwrap()
            });
            let is_pinned = |lock: &str| lock.contains(pinned.as_deref().unwrap());
            match known.lock() {
                Some(lock) => assert!(is_pinned(lock), "{}", known.name),
                None => assert!(defaults.iter().any(|lock| is_pinned(lock)), "{}", known.name),
            }
        }
        for engine in ["mitsuba", "radiance", "cycles", "luxcore"] {
            let releases: Vec<Release> = of(engine).map(|known| known.release().unwrap()).collect();
            assert!(releases.is_sorted() && releases.len() > 3, "{releases:?}");
            assert_eq!(of(engine).filter(|known| known.lock().is_none()).count(), 1, "{engine}");
        }
    }

    #[test]
    fn an_environment_with_another_release_is_not_taken_for_this_one() {
        let root = tempfile::tempdir().unwrap();
        let known = known("mitsuba@3.5.2").unwrap();
        let site = known.site(&EngineRoot::at(root.path()));
        assert_eq!(site.root(), root.path().join("releases/mitsuba-3.5.2"));
        assert_eq!(site.debian(), root.path().join("debian"));
        let packages = site.venv().join("lib/python3.11/site-packages");
        std::fs::create_dir_all(packages.join("mitsuba-3.6.4.dist-info")).unwrap();
        assert!(!known.is_in(&site));
        std::fs::create_dir_all(packages.join("mitsuba-3.5.2.dist-info")).unwrap();
        assert!(known.is_in(&site));
        let of_name = |name| installed_package(&EngineName::new(name), &EngineRoot::at(root.path()));
        assert_eq!(of_name("mitsuba@3.5.2"), Some("mitsuba 3.5.2".to_owned()));
        // No default installation is there.
        assert_eq!(of_name("radiance"), None);
    }
}
