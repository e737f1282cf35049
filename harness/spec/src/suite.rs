//! Suites: the cases of spec files, of folders of specs and of patterns, in a fixed order.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use walkdir::WalkDir;

use super::build::{Loaded, name_of, unread};
use super::cases::{Variants, variants};
use super::tree::tree;
use super::trust::fixed_part;
use super::{Case, Faults, Source, Spec, SpecError, Trust};
use crate::procedures::known;

/// The cases of several specs, folders or patterns as far as they can be made, and all that is wrong with them.
#[derive(Debug, Default)]
pub struct Suite {
    /// In the order given; the files of a folder are sorted by name.
    pub cases: Vec<Case>,
    pub faults: Vec<SpecError>,
}

impl Suite {
    pub fn read(asked: &[PathBuf], trust: Trust) -> Self {
        let mut suite = Self::default();
        for path in asked {
            match files(path, trust) {
                Ok(files) => {
                    for Loaded { cases, faults } in files.iter().map(|file| Loaded::of(file, trust)) {
                        suite.cases.extend(cases);
                        suite.faults.extend(faults);
                    }
                }
                Err(fault) => suite.faults.push(fault),
            }
        }
        suite.faults.extend(of_names(&suite.cases));
        suite
    }

    /// The cases where nothing is wrong with any of them.
    pub fn sound(self) -> Result<Vec<Case>, Faults> {
        Faults::of(self.faults).map_or(Ok(self.cases), Err)
    }
}

/// The cases of several specs, folders or patterns.
pub fn suite(asked: &[PathBuf], trust: Trust) -> Result<Vec<Case>, Faults> {
    Suite::read(asked, trust).sound()
}

/// What is wrong with the names of cases: a report tells them apart by these.
fn of_names(cases: &[Case]) -> Vec<SpecError> {
    let mut names: BTreeMap<&str, &Path> = BTreeMap::new();
    let mut faults = vec![];
    for case in cases {
        if let Some(other) = names.insert(&case.name, &case.path) {
            let message = format!("holds a case `{}`, and so does {}", case.name, other.display());
            let help = "run them apart, or rename one: a report tells cases by name";
            faults.push(SpecError::of(&case.path, message, help));
        }
        if Path::new(&case.name).starts_with(known::CASE) {
            let message =
                format!("`{}` is the name of the scenes of known answer, which every engine reads", known::CASE);
            faults.push(SpecError::of(&case.path, message, "give the spec another name"));
        }
    }
    faults
}

/// The specs of a file, each with its name: those of its `cases` with their overrides laid over it, or the one that it is.
pub fn specs(path: &Path) -> Result<Vec<(String, Spec)>, SpecError> {
    let source = Source::read(path, Trust::Own)?;
    let spec: Spec = source.parse()?;
    let stem = name_of(path);
    let variants = tree(&source.text).map(|tree| variants(&source, &tree, &[]));
    let Variants { all, faults, .. } = variants.or_else(|error| unread(&source, Some(&spec), &error))?;
    if let Some(fault) = faults.into_iter().next() {
        return Err(fault);
    }
    if all.is_empty() {
        return Ok(vec![(stem, spec)]);
    }
    Ok(all.into_iter().map(|v| (format!("{stem}/{}", v.name), v.spec)).collect())
}

/// The cases whose names match any of the patterns: a glob where it holds `*`, `?` or `[`, a part of the name otherwise.
///
/// Without a pattern all cases stay. A choice that leaves none is refused: an empty run would pass.
pub fn filtered(cases: Vec<Case>, patterns: &[String]) -> Result<Vec<Case>, SpecError> {
    let option = Path::new("--filter");
    let mut globs = vec![];
    for pattern in patterns.iter().filter(|p| p.contains(['*', '?', '['])) {
        let help = "use *, ? or [...], or a part of the name";
        let glob = glob::Pattern::new(pattern)
            .map_err(|e| SpecError::of(option, format!("`{pattern}` is no pattern: {e}"), help))?;
        globs.push(glob);
    }
    if !cases.iter().any(|case| is_chosen(&case.name, patterns, &globs)) {
        let names: Vec<&str> = cases.iter().map(|case| case.name.as_str()).collect();
        let message = format!("no case matches `{}`", patterns.join("`, `"));
        return Err(SpecError::of(option, message, format!("the cases are {}", names.join(", "))));
    }
    Ok(cases.into_iter().filter(|case| is_chosen(&case.name, patterns, &globs)).collect())
}

/// Whether a case's name matches a glob or has a plain pattern in it; without patterns every case does.
fn is_chosen(name: &str, patterns: &[String], globs: &[glob::Pattern]) -> bool {
    patterns.is_empty()
        || patterns.iter().any(|p| !p.contains(['*', '?', '[']) && name.contains(p.as_str()))
        || globs.iter().any(|glob| glob.matches(name))
}

/// The error for a path that cannot be read.
fn unreadable(path: &Path, error: &std::io::Error) -> SpecError {
    SpecError::of(path, format!("cannot be read: {error}"), "check the path")
}

/// The spec files that a path stands for: itself, the specs of a folder, or what a pattern matches.
fn files(path: &Path, trust: Trust) -> Result<Vec<PathBuf>, SpecError> {
    if path.is_dir() {
        return specs_of(path, trust);
    }
    let Some(pattern) = path.to_str().filter(|p| !path.exists() && p.contains(['*', '?', '['])) else {
        return Ok(vec![path.to_owned()]);
    };
    let found = match trust {
        Trust::Own => glob::glob(pattern).map(|found| found.filter_map(Result::ok).collect()), // in alphabetical order
        Trust::Stranger | Trust::Bundled => matches_without_links(path),
    };
    let found: Vec<PathBuf> = found.map_err(|e| SpecError::of(path, format!("is no pattern: {e}"), "give a file"))?;
    if found.is_empty() {
        return Err(SpecError::of(path, "matches no file", "check the pattern"));
    }
    Ok(found)
}

/// What a pattern matches where no linked folder is followed: links may lead elsewhere, or in circles. If only links
/// match the beginning of the pattern, the first of them is returned, and then refused by its reader.
fn matches_without_links(path: &Path) -> Result<Vec<PathBuf>, glob::PatternError> {
    let (folder, pattern) = fixed_part(path);
    let parts: Vec<String> = pattern.components().map(|part| part.as_os_str().to_string_lossy().into_owned()).collect();
    let whole = glob::Pattern::new(&parts.join("/"))?;
    let beginnings =
        (1..parts.len()).map(|n| glob::Pattern::new(&parts[..n].join("/"))).collect::<Result<Vec<_>, _>>()?;
    let depth = if parts.iter().any(|part| part == "**") { usize::MAX } else { parts.len() };
    let (mut found, mut link) = (vec![], None);
    for entry in WalkDir::new(&folder).min_depth(1).max_depth(depth).sort_by_file_name().into_iter().flatten() {
        let below = entry.path().strip_prefix(&folder).unwrap_or(entry.path());
        // As patterns on the command line are written, without `./`.
        let shown = if folder == Path::new(".") { below } else { entry.path() };
        if whole.matches_path_with(below, BETWEEN_SLASHES) {
            found.push(shown.to_owned());
        } else if link.is_none() && entry.path_is_symlink() {
            let is_on_the_way = beginnings.iter().any(|part| part.matches_path_with(below, BETWEEN_SLASHES));
            link = is_on_the_way.then(|| shown.to_owned());
        }
    }
    Ok(if found.is_empty() { link.into_iter().collect() } else { found })
}

/// A wildcard matches no `/`, as in a shell.
const BETWEEN_SLASHES: glob::MatchOptions =
    glob::MatchOptions { case_sensitive: true, require_literal_separator: true, require_literal_leading_dot: false };

/// The YAML files of a folder that are specs, by name; tables and the like beside them are left alone.
fn specs_of(folder: &Path, trust: Trust) -> Result<Vec<PathBuf>, SpecError> {
    trust.check_given(folder).map_err(|e| unreadable(folder, &e))?;
    let mut specs = vec![];
    for entry in std::fs::read_dir(folder).map_err(|e| unreadable(folder, &e))? {
        let path = entry.map_err(|e| unreadable(folder, &e))?.path();
        if path.extension().is_some_and(|e| e == "yaml" || e == "yml") && path.is_file() {
            let text = trust.read_spec(&path).map_err(|e| unreadable(&path, &e))?;
            if String::from_utf8_lossy(&text).lines().any(|l| l.starts_with("luxproof:")) {
                specs.push(path);
            }
        }
    }
    specs.sort();
    if specs.is_empty() {
        let help = "a folder is run for its *.yaml files that begin a line with `luxproof:`";
        return Err(SpecError::of(folder, "holds no spec", help));
    }
    Ok(specs)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn reference(folder: &str) -> PathBuf {
        Path::new(env!("CARGO_MANIFEST_DIR")).join("../../reference").join(folder)
    }

    fn names(paths: &[PathBuf]) -> Result<Vec<String>, SpecError> {
        suite(paths, Trust::Own).map(|cases| cases.into_iter().map(|c| c.name).collect()).map_err(Faults::first)
    }

    #[test]
    fn a_folder_is_the_suite_of_its_specs_by_name() {
        let found = names(&[reference("analytic")]).unwrap();
        assert!(found.is_sorted() && found.len() >= 8, "{found:?}");
        assert_eq!(names(&[reference("analytic/*.yaml")]).unwrap(), found);
        let two = ["s2.yaml", "s1.yaml"].map(|name| reference("analytic").join(name));
        assert_eq!(names(&two).unwrap(), ["s2/direct", "s2/indirect", "s1"]);
    }

    fn searched() -> [PathBuf; 2] {
        [reference("cie171/5.8-interreflection.yaml"), reference("analytic")]
    }

    /// The names of the cases of reflected light and of the analytic cases that patterns choose.
    fn chosen(patterns: &[&str]) -> Result<Vec<String>, SpecError> {
        let patterns: Vec<String> = patterns.iter().map(|p| (*p).to_owned()).collect();
        let cases = filtered(suite(&searched(), Trust::Own).unwrap(), &patterns)?;
        Ok(cases.into_iter().map(|c| c.name).collect())
    }

    #[test]
    fn a_filter_is_a_glob_or_a_part_of_the_name_and_never_leaves_nothing() {
        assert_eq!(
            chosen(&["rho-"]).unwrap(),
            ["5.8-interreflection/rho-10", "5.8-interreflection/rho-50", "5.8-interreflection/rho-90"]
        );
        assert_eq!(chosen(&["s?", "*direct"]).unwrap(), ["s1", "s2/direct", "s2/indirect"]);
        assert_eq!(chosen(&["*/direct"]).unwrap(), ["s2/direct"]);
        assert_eq!(chosen(&[]).unwrap(), names(&searched()).unwrap());
        let none = chosen(&["cachet"]).unwrap_err();
        assert!(none.message.contains("no case matches `cachet`") && none.help.unwrap().contains("furnace, "));
        assert!(chosen(&["s[", "s1"]).unwrap_err().message.contains("is no pattern"));
    }

    #[test]
    fn what_yields_no_spec_or_one_name_twice_is_refused() {
        assert!(names(&[reference("luminaires")]).unwrap_err().message.contains("no spec"));
        assert!(names(&[reference("analytic/*.yml")]).unwrap_err().message.contains("matches no file"));
        let s1 = reference("analytic/s1.yaml");
        assert!(names(&[s1.clone(), s1]).unwrap_err().message.contains("so does"));
    }
}
