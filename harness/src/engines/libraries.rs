//! Shared libraries of the system that Python packages take for granted, and a machine with little more than Python lacks.

use std::path::PathBuf;

use super::Site;
use crate::system::process::Invocation;

#[derive(Debug, PartialEq, Eq)]
pub struct Libraries {
    pub(super) name: &'static str,
    /// What programs are linked with, and the package of Debian that has it.
    files: &'static [(&'static str, &'static str)],
}

/// Of Mitsuba and LuxCore.
pub(super) const ATOMIC: Libraries = Libraries { name: "libatomic", files: &[("libatomic.so.1", "libatomic1")] };

/// Of Blender, which is linked with them and opens no window.
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
    /// The packages that are wanted, by the name of the file that is missing.
    pub(super) fn missing(&self, site: &Site) -> impl Iterator<Item = &(&'static str, &'static str)> {
        self.files.iter().filter(|(file, _)| site.library(file).is_none())
    }

    /// Where the first is, where none is missing.
    pub(super) fn found(&self, site: &Site) -> Option<PathBuf> {
        if self.missing(site).next().is_some() { None } else { site.library(self.files[0].0) }
    }

    pub(super) fn packages(&self) -> Vec<&'static str> {
        self.files.iter().map(|(_, package)| *package).collect()
    }

    /// An invocation that finds those that were unpacked into the site.
    pub(super) fn beside(&self, invocation: Invocation, site: &Site) -> Invocation {
        let is_ours = |file: &str| site.library(file).is_some_and(|path| path.starts_with(site.debian()));
        if self.files.iter().any(|(file, _)| is_ours(file)) { with_unpacked(invocation, site) } else { invocation }
    }
}

/// An invocation that finds all libraries that were unpacked into the site.
pub(super) fn with_unpacked(invocation: Invocation, site: &Site) -> Invocation {
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
        let site = Site::at(folder.path().to_owned());
        let none = Libraries { name: "none", files: &[("libluxproof-none.so.1", "none")] };
        let told = |libraries: &Libraries| {
            let run =
                Invocation::new("true", folder.path(), std::time::Duration::from_secs(1), folder.path().join("log"));
            libraries.beside(run, &site).command_line_with_env()
        };
        assert_eq!((none.missing(&site).count(), none.found(&site)), (1, None));
        assert!(!told(&none).contains("LD_LIBRARY_PATH"));
        let unpacked = site.debian().join("usr/lib");
        std::fs::create_dir_all(&unpacked).unwrap();
        std::fs::write(unpacked.join("libluxproof-none.so.1"), "").unwrap();
        assert_eq!(none.found(&site), Some(unpacked.join("libluxproof-none.so.1")));
        assert!(told(&none).contains("LD_LIBRARY_PATH"), "{}", told(&none));
        let c = Libraries { name: "C", files: &[("libc.so.6", "libc6")] };
        assert!(c.found(&site).is_some() && !told(&c).contains("LD_LIBRARY_PATH"));
    }
}
