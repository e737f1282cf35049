//! Paths that a file of unknown origin names.

use std::path::{Path, PathBuf};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize, Serializer};

/// A path out of a file of unknown origin: a bundle, a plan, a job, a report.
///
/// Nothing opens it: `Resolve` of luxproof-spec gives the path that a `Trust` allows.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(transparent)]
pub struct ForeignPath(#[serde(serialize_with = "as_text")] PathBuf);

/// JSON is UTF-8, and names of files need not be: what is none is replaced, and found again where it is resolved.
fn as_text<S: Serializer>(path: &Path, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_str(&path.to_string_lossy())
}

impl From<PathBuf> for ForeignPath {
    fn from(path: PathBuf) -> Self {
        Self(path)
    }
}

impl ForeignPath {
    /// The same, counted from a folder.
    #[must_use]
    pub fn in_folder(&self, folder: &Path) -> Self {
        Self(folder.join(&self.0))
    }

    /// As it is written, for messages.
    pub fn shown(&self) -> String {
        self.0.display().to_string()
    }

    /// The path as it is written: only the code that resolves it may open what this names.
    pub fn unchecked(&self) -> &Path {
        &self.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    #[test]
    fn a_foreign_path_is_written_and_read_as_it_stands() {
        let path = ForeignPath::from(PathBuf::from("a/b.yaml"));
        assert_eq!((path.shown().as_str(), path.unchecked()), ("a/b.yaml", Path::new("a/b.yaml")));
        assert_eq!(path.in_folder(Path::new("/bundle")).unchecked(), Path::new("/bundle/a/b.yaml"));
        let text = serde_json::to_string(&path).unwrap();
        assert_eq!(text, "\"a/b.yaml\"");
        assert_eq!(serde_json::from_str::<ForeignPath>(&text).unwrap(), path);
    }
}
