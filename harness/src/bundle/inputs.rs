//! Where the inputs of a run come to lie in its bundle: as they lie to one another, so that specs find their files as they are written.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Component, Path, PathBuf};

use super::{BundleError, INPUTS};
use crate::judge::POLICY_FILE;
use crate::system::printable::is_unprintable;

/// A spec with what it takes.
#[derive(Clone, Debug, Default)]
pub(super) struct Sources {
    pub(super) spec: PathBuf,
    /// Those that it names, however deep, and its programs' own.
    pub(super) files: BTreeSet<PathBuf>,
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
            let mut put = |path: &Path| -> Result<String, BundleError> {
                let whole = clean(path);
                let below = whole.strip_prefix(top).map_err(|_| BundleError::Name(path.to_owned()))?;
                let name = format!("{folder}/{}", name(below).ok_or_else(|| BundleError::Name(path.to_owned()))?);
                layout.places.insert(name.clone(), path.to_owned());
                Ok(name)
            };
            layout.specs.push(put(&sources.spec)?);
            sources.files.iter().try_for_each(|path| put(path).map(|_| ()))?;
            if let Some(policy) = &sources.policy {
                let is_found = policy.file_name().is_some_and(|name| name == POLICY_FILE);
                if is_found && clean(policy).starts_with(top) {
                    put(policy)?;
                } else {
                    layout.places.insert(format!("{folder}/{POLICY_FILE}"), policy.clone());
                }
            }
        }
        Ok(layout)
    }
}

/// The nearest folder that all lie in.
fn common<'a>(mut files: impl Iterator<Item = &'a PathBuf>) -> PathBuf {
    let folder = |file: &PathBuf| clean(file).parent().map(Path::to_owned).unwrap_or_default();
    let first = files.next().map(folder).unwrap_or_default();
    files.map(folder).fold(first, |common, folder| {
        common.ancestors().find(|above| folder.starts_with(above)).map(Path::to_owned).unwrap_or_default()
    })
}

/// A path from the root of the file system as it is written, without `.` and `..`.
pub(super) fn clean(path: &Path) -> PathBuf {
    let whole = std::path::absolute(path).unwrap_or_else(|_| path.to_owned());
    whole.components().fold(PathBuf::new(), |mut clean, part| {
        match part {
            Component::ParentDir => drop(clean.pop()),
            Component::CurDir => {}
            part => clean.push(part),
        }
        clean
    })
}

/// A relative path as the bundle's lists have it; `None` where a list could not hold it.
pub(super) fn name(path: &Path) -> Option<String> {
    let part = |part: Component<'_>| match part {
        Component::Normal(part) => {
            let part = part.to_str()?;
            let is_plain = !part.contains('\\') && !part.chars().any(is_unprintable);
            is_plain.then(|| part.to_owned())
        }
        _ => None,
    };
    let parts = path.components().map(part).collect::<Option<Vec<_>>>()?;
    (!parts.is_empty()).then(|| parts.join("/"))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sources(spec: &str, files: &[&str], policy: Option<&str>) -> Sources {
        let files = files.iter().map(PathBuf::from).collect();
        Sources { spec: spec.into(), files, policy: policy.map(PathBuf::from) }
    }

    fn names(all: &[Sources]) -> Vec<String> {
        Layout::of(all).unwrap().places.into_keys().collect()
    }

    #[test]
    fn inputs_keep_their_places_to_one_another_and_nothing_above_them_is_told() {
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
}
