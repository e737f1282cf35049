//! Shared libraries of the system that Python packages expect, and that a minimal machine lacks.

use std::path::PathBuf;

use super::EngineRoot;
use luxproof_process::process::Invocation;

#[derive(Debug, PartialEq, Eq)]
pub struct Libraries {
    pub(super) name: &'static str,
    /// Files of libraries, each with the Debian package that contains it.
    files: &'static [(&'static str, &'static str)],
}

/// The libraries of Mitsuba and LuxCore.
pub(super) const ATOMIC: Libraries = Libraries { name: "libatomic", files: &[("libatomic.so.1", "libatomic1")] };

/// The libraries that Blender is linked with, although it opens no window.
pub(super) const X11: Libraries = Libraries {
    name: "libraries of X11",
    files: &[
        ("libX11.so.6", "libx11-6"),
        ("libXext.so.6", "libxext6"),
        ("libXfixes.so.3", "libxfixes3"),
        ("libXi.so.6", "libxi6"),
        ("libXrender.so.1", "libxrender1"),
        ("libxkbcommon.so.0", "libxkbcommon0"),
        ("libSM.so.6", "libsm6"),
        ("libICE.so.6", "libice6"),
        ("libGL.so.1", "libgl1"),
    ],
};

impl Libraries {
    /// Returns the missing files with their packages.
    pub(super) fn missing(&self, site: &EngineRoot) -> impl Iterator<Item = &(&'static str, &'static str)> {
        self.files.iter().filter(|(file, _)| site.library(file).is_none())
    }

    /// Returns the path of the first library if none is missing.
    pub(super) fn found(&self, site: &EngineRoot) -> Option<PathBuf> {
        if self.missing(site).next().is_some() { None } else { site.library(self.files[0].0) }
    }

    pub(super) fn packages(&self) -> Vec<&'static str> {
        self.files.iter().map(|(_, package)| *package).collect()
    }

    /// Lets an invocation find these libraries if they were unpacked into the site.
    pub(super) fn add_to(&self, invocation: Invocation, site: &EngineRoot) -> Invocation {
        let mut files = self.files.iter();
        let is_unpacked = files.any(|(file, _)| site.library(file).is_some_and(|path| path.starts_with(site.debian())));
        if is_unpacked { with_unpacked(invocation, site) } else { invocation }
    }
}

/// Lets an invocation find all libraries that were unpacked into the site.
pub(super) fn with_unpacked(invocation: Invocation, site: &EngineRoot) -> Invocation {
    match site.library_path() {
        Some(path) => invocation.env("LD_LIBRARY_PATH", path),
        None => invocation,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_unpacked_is_found_and_handed_on_and_the_systems_own_is_left_alone() {
        let folder = tempfile::tempdir().unwrap();
        let site = EngineRoot::at(folder.path().to_owned());
        let none = Libraries { name: "none", files: &[("libluxproof-none.so.1", "none")] };
        let (limit, log) = (std::time::Duration::from_secs(1), folder.path().join("log"));
        let run = Invocation::new("true", folder.path(), limit, log);
        let reported = |libraries: &Libraries| libraries.add_to(run.clone(), &site).command_line_with_env();
        assert_eq!((none.missing(&site).count(), none.found(&site)), (1, None));
        assert!(!reported(&none).contains("LD_LIBRARY_PATH"));
        let unpacked = site.debian().join("usr/lib");
        std::fs::create_dir_all(&unpacked).unwrap();
        std::fs::write(unpacked.join("libluxproof-none.so.1"), "").unwrap();
        assert_eq!(none.found(&site), Some(unpacked.join("libluxproof-none.so.1")));
        assert!(reported(&none).contains("LD_LIBRARY_PATH"), "{}", reported(&none));
        let c = Libraries { name: "C", files: &[("libc.so.6", "libc6")] };
        assert!(c.found(&site).is_some() && !reported(&c).contains("LD_LIBRARY_PATH"));
    }
}
