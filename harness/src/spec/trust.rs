//! Whose specs are read, and what those of a stranger may not.

use std::io;
use std::path::Path;

use super::MAX_SPEC_BYTES;
use crate::system::files::{MAX_BYTES, read_below, read_bounded};

/// The file at the root of a bundle, a world of its own: what lies above it counts for nothing in it.
pub const BUNDLE_FILE: &str = "ro-crate-metadata.json";

/// Whose specs are read.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Trust {
    /// The user's own: they name files anywhere, and programs to run as engines.
    #[default]
    Own,
    /// A stranger's: they name files below their own folder alone, start nothing, and are bounded in size (SECURITY.md has the numbers).
    Stranger,
    /// A stranger's in a bundle: likewise, but that they name files anywhere in it.
    Bundled,
}

/// How much specs may ask for, all cases of a file together.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Limits {
    pub(super) spec_bytes: u64,
    /// Of a file that it names.
    pub(super) file_bytes: u64,
    /// Of all files that it names, as often as its cases do.
    pub(super) bytes: usize,
    pub(super) cases: usize,
    /// Values of the text, as often as there are cases of it.
    pub(super) values: usize,
    pub(super) luminaires: usize,
    pub(super) meters: usize,
    pub(super) triangles: usize,
    /// Pairs of luminaires as meters see them: whether one stands in the other's light.
    pub(super) sights: usize,
}

impl Trust {
    /// What a stranger's spec asks for is planned within a second and 200 MB.
    pub(super) const fn limits(self) -> Limits {
        match self {
            Self::Own => Limits {
                spec_bytes: MAX_SPEC_BYTES,
                file_bytes: MAX_BYTES,
                bytes: usize::MAX,
                cases: 10_000,
                values: usize::MAX,
                luminaires: usize::MAX,
                meters: usize::MAX,
                triangles: usize::MAX,
                sights: usize::MAX,
            },
            Self::Stranger | Self::Bundled => Limits {
                spec_bytes: 1 << 20,
                file_bytes: 2 << 20,
                bytes: 2 << 20,
                cases: 100,
                values: 2_000_000,
                luminaires: 500,
                meters: 10_000,
                triangles: 50_000,
                sights: 20_000_000,
            },
        }
    }

    /// The bytes of a spec or policy; a stranger's is no link to somewhere else.
    pub(super) fn read_spec(self, path: &Path) -> io::Result<Vec<u8>> {
        if self != Self::Own && std::fs::symlink_metadata(path)?.is_symlink() {
            return Err(io::Error::new(io::ErrorKind::PermissionDenied, "it is a link"));
        }
        read_bounded(path, self.limits().spec_bytes)
    }

    /// The bytes of a file that a spec in this folder names.
    pub(crate) fn read_named(self, folder: &Path, path: &Path) -> io::Result<Vec<u8>> {
        let most = self.limits().file_bytes;
        match self {
            Self::Own => read_bounded(path, most),
            Self::Stranger => read_below(folder, path, most),
            Self::Bundled => read_below(bundle_of(folder).unwrap_or(folder), path, most),
        }
    }
}

/// The root of the bundle that a folder lies in.
fn bundle_of(folder: &Path) -> Option<&Path> {
    folder.ancestors().find(|above| above.join(BUNDLE_FILE).is_file())
}
