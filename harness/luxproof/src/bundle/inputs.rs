//! The layout of a run's inputs in its bundle: relative paths stay the same, so that specs find their files.

use luxproof_process::files::clean;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Component, Path, PathBuf};

use super::{BundleError, INPUTS};
use luxproof_process::printable::is_unprintable;
use luxproof_verdict::POLICY_FILE;

/// A spec with what it takes.
#[derive(Clone, Debug, Default)]
pub(super) struct Sources {
    pub(super) spec: PathBuf,
    /// Those that it names, however deep, and its programs' own.
    pub(super) files: BTreeSet<PathBuf>,
    /// Those of them that are its programs' own.
    pub(super) programs: BTreeSet<PathBuf>,
    /// The policy that it was judged by.
    pub(super) policy: Option<PathBuf>,
}

/// What inputs are called in the bundle, and where each comes from.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct Layout {
    pub(super) places: BTreeMap<String, PathBuf>,
    /// The specs' own places, in their order.
    pub(super) specs: Vec<String>,
}

impl Layout {
    /// Specs that share a folder, through the files that they name, keep it; others get folders of their own. A policy from above counts from the
    /// top of each, where it is found as it was.
    pub(super) fn of(all: &[Sources]) -> Result<Self, BundleError> {
        let mut roots: Vec<PathBuf> = vec![];
        for sources in all {
            roots.push(common(std::iter::once(&sources.spec).chain(&sources.files)));
        }
        let mut tops: Vec<PathBuf> = roots.clone();
        tops.retain(|root| !roots.iter().any(|other| other != root && root.starts_with(other)));
        tops.sort();
        tops.dedup();
        let mut layout = Self::default();
        for (sources, root) in all.iter().zip(&roots) {
            let Some((k, top)) = tops.iter().enumerate().find(|(_, top)| root.starts_with(top)) else { continue };
            let folder = if tops.len() == 1 { INPUTS.to_owned() } else { format!("{INPUTS}/{}", k + 1) };
            let spec = layout.add(&folder, top, &sources.spec)?;
            layout.specs.push(spec);
            for path in &sources.files {
                layout.add(&folder, top, path)?;
            }
            if let Some(policy) = &sources.policy {
                let is_found = policy.file_name().is_some_and(|name| name == POLICY_FILE);
                if is_found && clean(policy).starts_with(top) {
                    layout.add(&folder, top, policy)?;
                } else {
                    layout.places.insert(format!("{folder}/{POLICY_FILE}"), policy.clone());
                }
            }
        }
        Ok(layout)
    }

    /// Gives a file its place in a folder of the bundle, as it lies below `top`; its name there.
    fn add(&mut self, folder: &str, top: &Path, path: &Path) -> Result<String, BundleError> {
        let whole = clean(path);
        let below = whole.strip_prefix(top).map_err(|_| BundleError::Name(path.to_owned()))?;
        // A spec names its files in UTF-8. Only the spec's own name may be something else, and nothing refers to it.
        let readable = PathBuf::from(below.to_string_lossy().into_owned());
        let name = name(&readable).ok_or_else(|| BundleError::Name(path.to_owned()))?;
        let name = format!("{folder}/{name}");
        let other = self.places.insert(name.clone(), path.to_owned());
        if other.is_some_and(|other| clean(&other) != whole) {
            return Err(BundleError::Name(path.to_owned()));
        }
        Ok(name)
    }
}

/// The folder of a file.
fn parent_folder(file: &Path) -> PathBuf {
    clean(file).parent().map(Path::to_owned).unwrap_or_default()
}

/// The nearest folder above all files.
fn common<'a>(mut files: impl Iterator<Item = &'a PathBuf>) -> PathBuf {
    let first = files.next().map(|file| parent_folder(file)).unwrap_or_default();
    files.map(|file| parent_folder(file)).fold(first, |common, folder| {
        common.ancestors().find(|above| folder.starts_with(above)).map(Path::to_owned).unwrap_or_default()
    })
}

/// A part of a path, if a bundle's list can hold it.
fn plain_part(part: Component<'_>) -> Option<String> {
    let Component::Normal(part) = part else { return None };
    let part = part.to_str()?;
    let is_plain = !part.contains('\\') && !part.chars().any(is_unprintable);
    is_plain.then(|| part.to_owned())
}

/// A relative path as the bundle's lists have it; `None` where a list could not hold it.
pub(super) fn name(path: &Path) -> Option<String> {
    let parts = path.components().map(plain_part).collect::<Option<Vec<_>>>()?;
    (!parts.is_empty()).then(|| parts.join("/"))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sources(spec: &str, files: &[&str], policy: Option<&str>) -> Sources {
        let files = files.iter().map(PathBuf::from).collect();
        Sources { spec: spec.into(), files, policy: policy.map(PathBuf::from), ..Sources::default() }
    }

    fn names(all: &[Sources]) -> Vec<String> {
        Layout::of(all).unwrap().places.into_keys().collect()
    }

    #[test]
    fn inputs_keep_their_relative_places_and_no_folder_above_them_appears() {
        let one = sources("/home/me/p/specs/a.yaml", &["/home/me/p/specs/../lamps/x.ies"], None);
        assert_eq!(names(std::slice::from_ref(&one)), ["inputs/lamps/x.ies", "inputs/specs/a.yaml"]);
        // One below the other is one; what has nothing in common is apart.
        let below = sources("/home/me/p/specs/b.yaml", &[], None);
        let apart = sources("/srv/c.yaml", &["/srv/x.ies"], None);
        let layout = Layout::of(&[apart, below, one]).unwrap();
        assert_eq!(layout.specs, ["inputs/2/c.yaml", "inputs/1/specs/b.yaml", "inputs/1/specs/a.yaml"]);
        assert_eq!(layout.places["inputs/2/x.ies"], Path::new("/srv/x.ies"));
    }

    #[test]
    fn a_policy_is_found_as_it_was() {
        let above = sources("/p/q/a.yaml", &[], Some("/p/luxproof.yaml"));
        let beside = sources("/p/q/a.yaml", &["/p/x.ies"], Some("/p/q/luxproof.yaml"));
        let named = sources("/p/q/a.yaml", &[], Some("/elsewhere/strict.yaml"));
        assert_eq!(names(&[above]), ["inputs/a.yaml", "inputs/luxproof.yaml"]);
        assert_eq!(names(&[beside]), ["inputs/q/a.yaml", "inputs/q/luxproof.yaml", "inputs/x.ies"]);
        assert_eq!(names(&[named]), ["inputs/a.yaml", "inputs/luxproof.yaml"]);
    }

    #[test]
    fn what_no_list_can_hold_is_refused() {
        assert!(Layout::of(&[sources("/p/a\nb.yaml", &[], None)]).is_err());
        assert!(Layout::of(&[sources("/p/a\\b.yaml", &[], None)]).is_err());
    }
    #[test]
    fn a_spec_whose_name_is_no_utf_8_is_bundled_and_two_never_take_one_place() {
        use std::os::unix::ffi::OsStringExt;
        let odd = |bytes: &[u8]| PathBuf::from(std::ffi::OsString::from_vec(bytes.to_vec()));
        let of = |path: PathBuf| Sources { spec: path, ..Sources::default() };
        let one = of(odd(b"/p/a\xe9.yaml"));
        assert_eq!(names(std::slice::from_ref(&one)), ["inputs/a\u{fffd}.yaml"]);
        assert!(Layout::of(&[one, of(odd(b"/p/a\xe8.yaml"))]).is_err());
    }
}
