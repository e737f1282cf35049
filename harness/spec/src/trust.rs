//! Which specs are trusted, and what untrusted ones may not do.

use std::io;
use std::path::{Component, Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::{MAX_SPEC_BYTES, SpecError};
use luxproof_model::ForeignPath;
use luxproof_process::files::{MAX_BYTES, found_again, link_in, read_below, read_bounded, real_below};
use luxproof_process::printable::{is_unprintable, without_quotes};

/// The file at the root of a bundle, a world of its own: what lies above it counts for nothing in it.
pub const BUNDLE_FILE: &str = "ro-crate-metadata.json";

/// Whose specs are read.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
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
    /// Recorded readings among the engines of a spec.
    pub(super) recorded: usize,
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
                recorded: usize::MAX,
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
                recorded: 50,
                values: 2_000_000,
                luminaires: 500,
                meters: 10_000,
                triangles: 50_000,
                sights: 20_000_000,
            },
        }
    }

    /// The bytes of a spec or policy; a stranger's is no link to somewhere else, nor does it lie in a linked folder.
    pub fn read_spec(self, path: &Path) -> io::Result<Vec<u8>> {
        self.check_given(path)?;
        read_bounded(path, self.limits().spec_bytes)
    }

    /// Refuses a file that the command line names, of a stranger, if it is a link, lies in a linked folder, or has a
    /// name that does not print.
    pub fn check_given(self, path: &Path) -> io::Result<()> {
        self.check_name(path)?;
        let Some(link) = link_in(path).filter(|_| self != Self::Own) else { return Ok(()) };
        let is_file = std::path::absolute(path).is_ok_and(|whole| whole == link);
        let what = if is_file { "it is a link".to_owned() } else { format!("{} is a link", link.display()) };
        Err(io::Error::new(io::ErrorKind::PermissionDenied, what))
    }

    /// Refuses a stranger's name of a file that would begin a line of a log, or be a command to a terminal.
    fn check_name(self, path: &Path) -> io::Result<()> {
        if self != Self::Own && path.to_string_lossy().contains(is_unprintable) {
            return Err(io::Error::new(io::ErrorKind::InvalidInput, "its name has characters that do not print"));
        }
        Ok(())
    }

    /// The most triangles of all meshes together.
    pub const fn max_triangles(self) -> usize {
        self.limits().triangles
    }

    /// The most luminaires of a scene.
    pub const fn max_luminaires(self) -> usize {
        self.limits().luminaires
    }

    /// The most bytes of the files that a spec or scene names, all together.
    pub const fn max_named_bytes(self) -> usize {
        self.limits().bytes
    }

    /// A message about a file that a spec names: of a stranger's without what it quotes.
    pub fn shown(self, message: &str) -> String {
        if self == Self::Own { message.to_owned() } else { without_quotes(message) }
    }

    /// The bytes of a file that a spec in this folder names.
    pub fn read_named(self, folder: &Path, path: &Path) -> io::Result<Vec<u8>> {
        self.check_name(path)?;
        let most = self.limits().file_bytes;
        match self {
            Self::Own => read_bounded(path, most),
            Self::Stranger => read_below(folder, path, most),
            Self::Bundled => read_below(bundle_of(folder).unwrap_or(folder), path, most),
        }
    }
}

/// What a [`Trust`] makes of a path out of a file of unknown origin.
pub trait Resolve {
    /// The path, which counts from the current folder. Without trust it must lead below `folder`, links followed.
    fn resolve(&self, trust: Trust, folder: &Path) -> Result<PathBuf, SpecError>;
}

impl Resolve for ForeignPath {
    fn resolve(&self, trust: Trust, folder: &Path) -> Result<PathBuf, SpecError> {
        let path = self.unchecked();
        match trust {
            Trust::Own => Ok(found_again(path)),
            Trust::Stranger | Trust::Bundled => {
                let (fixed, pattern) = fixed_part(path);
                let message = if pattern.components().any(|part| part == Component::ParentDir) {
                    "is not used: a pattern leads up again".to_owned()
                } else {
                    match real_below(folder, &fixed) {
                        Ok(Some(_)) => return Ok(path.to_owned()),
                        Ok(None) => format!("is not used: it does not lie below {}", printable_folder(folder)),
                        Err(error) => format!("is not used: {error}"),
                    }
                };
                Err(SpecError::of(path, message, NAME_ITS_FOLDER))
            }
        }
    }
}

/// The folder that a pattern begins with, and the rest of it. A path of a file that is there is no pattern.
pub(super) fn fixed_part(path: &Path) -> (PathBuf, PathBuf) {
    if path.exists() {
        return (path.to_owned(), PathBuf::new());
    }
    let fixed: PathBuf = path.components().take_while(is_fixed).collect();
    let pattern = path.components().skip_while(is_fixed).collect();
    if fixed.as_os_str().is_empty() { (PathBuf::from("."), pattern) } else { (fixed, pattern) }
}

/// Whether a part of a path has no wildcard.
fn is_fixed(part: &Component<'_>) -> bool {
    !part.as_os_str().to_string_lossy().contains(['*', '?', '['])
}

/// A folder as messages show it.
fn printable_folder(folder: &Path) -> String {
    if folder.as_os_str().is_empty() { ".".to_owned() } else { folder.display().to_string() }
}

const NAME_ITS_FOLDER: &str =
    "of what is not trusted only files below the current folder are used, and of a plan below the folder of --below";

/// The root of the bundle that a folder lies in.
fn bundle_of(folder: &Path) -> Option<&Path> {
    folder.ancestors().find(|above| above.join(BUNDLE_FILE).is_file())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_foreign_path_leads_below_its_folder_or_nowhere_unless_it_is_trusted() {
        let root = tempfile::tempdir().unwrap();
        let folder = root.path().join("inner");
        std::fs::create_dir(&folder).unwrap();
        for file in [root.path().join("outer.yaml"), folder.join("a.yaml")] {
            std::fs::write(file, "").unwrap();
        }
        std::os::unix::fs::symlink(root.path().join("outer.yaml"), folder.join("link.yaml")).unwrap();
        for (path, is_below) in [
            (folder.join("a.yaml"), true),
            (folder.join("*.yaml"), true),
            (folder.join("link.yaml"), false),
            (folder.join("../outer.yaml"), false),
            (folder.join("../*.yaml"), false),
            (root.path().join("outer.yaml"), false),
            (PathBuf::from("/etc/passwd"), false),
        ] {
            let foreign = ForeignPath::from(path.clone());
            for trust in [Trust::Stranger, Trust::Bundled] {
                assert_eq!(foreign.resolve(trust, &folder).is_ok(), is_below, "{}", path.display());
            }
            assert_eq!(foreign.resolve(Trust::Own, &folder), Ok(path));
        }
    }
}
