//! The spec: one YAML file of room, luminaires, meters and procedures, read, checked and built into a scene.
//!
//! The only module that knows `serde_yaml`. Every error names file, line and column.

mod bounds;
mod build;
mod cases;
mod content;
mod locate;
pub mod model;
mod mounting;
mod suite;
mod trust;
mod write;

use std::path::{Path, PathBuf};

pub use build::Case;
pub use content::content;
pub use model::{Budget, EngineSettings, Spec, ToleranceOverride};
pub use suite::{filtered, specs, suite};
pub use trust::Trust;
pub use write::yaml;

/// What is wrong with a spec, where, and what to do.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{}{message}{}", place(.file, *.line, *.column), help.as_ref().map(|h| format!("; {h}")).unwrap_or_default())]
pub struct SpecError {
    /// The file that holds the error: the spec or a file that it names.
    pub file: PathBuf,
    /// Line, counted from 1, where the error has one.
    pub line: Option<usize>,
    /// Column, counted from 1.
    pub column: Option<usize>,
    pub message: String,
    pub help: Option<String>,
}

impl SpecError {
    /// One that concerns all of a file, or an option of the command line.
    pub fn of(file: impl Into<PathBuf>, message: impl Into<String>, help: impl Into<String>) -> Self {
        Self { file: file.into(), line: None, column: None, message: message.into(), help: Some(help.into()) }
    }
}

fn place(file: &Path, line: Option<usize>, column: Option<usize>) -> String {
    let number = |n: Option<usize>| n.map(|n| format!("{n}:")).unwrap_or_default();
    format!("{}:{}{} ", file.display(), number(line), number(column))
}

/// The most bytes of a spec or policy; one of 100,000 meters has some 5 MB.
const MAX_SPEC_BYTES: u64 = 64 << 20;

const TOO_DEEP: &str = "lists in lists, too deep to be read";
const DEPTH: &str = "close what is open: a spec is a few brackets deep";

/// A spec or policy file as it was read: its text, kept for the places of errors.
#[derive(Clone, Debug, Default)]
pub struct Source {
    pub path: PathBuf,
    pub text: String,
    /// Whose it is.
    pub trust: Trust,
    /// How many it has, its aliases followed, at most.
    values: usize,
    /// The places of the overrides that lie over it, such as `cases[1]`; none but in a case of a suite.
    overrides: Vec<String>,
}

impl Source {
    pub fn read(path: &Path, trust: Trust) -> Result<Self, SpecError> {
        let fail = |message: String, help| SpecError::of(path, message, help);
        let bytes = trust.read_spec(path).map_err(|e| fail(format!("cannot be read: {e}"), "check the path"))?;
        let text = String::from_utf8(bytes).map_err(|e| fail(format!("is not UTF-8: {e}"), "save it as UTF-8"))?;
        let error = |line| SpecError { line: Some(line), ..fail(TOO_DEEP.to_owned(), DEPTH) };
        bounds::too_deep(&text).map_or(Ok(()), |line| Err(error(line)))?;
        let source = Self { trust, ..Self::new(path.to_owned(), text) };
        let values = bounds::values(&source.text).map_err(|error| source.misread(&error))?;
        Ok(Self { values, ..source })
    }

    pub fn new(path: PathBuf, text: String) -> Self {
        Self { path, text, trust: Trust::Own, values: 0, overrides: vec![] }
    }

    /// Parses the text as a spec or a policy; unknown keys are errors with the nearest known key.
    pub fn parse<T: serde::de::DeserializeOwned>(&self) -> Result<T, SpecError> {
        serde_yaml::from_str(&self.text).map_err(|error| self.misread(&error))
    }

    /// What its parser refused, with the place.
    fn misread(&self, error: &serde_yaml::Error) -> SpecError {
        let message = error.to_string();
        // serde_yaml ends its message with the place, which the error carries already.
        let message = message.split(" at line ").next().unwrap_or(&message).to_owned();
        let help = nearest_key(&message);
        let location = error.location();
        SpecError {
            file: self.path.clone(),
            line: location.as_ref().map(serde_yaml::Location::line),
            column: location.as_ref().map(serde_yaml::Location::column),
            message,
            help,
        }
    }

    /// An error at a place in the file, given as a path such as `meters.ceiling.points_m[2]`.
    pub fn error_at(&self, path: &str, message: impl Into<String>, help: impl Into<String>) -> SpecError {
        let place = self.overridden(path).or_else(|| locate::locate(&self.text, path));
        let error = SpecError::of(&self.path, format!("{path}: {}", message.into()), help);
        SpecError { line: place.map(|p| p.0), column: place.map(|p| p.1), ..error }
    }

    /// Refuses what stands at a place unless it is sound.
    pub(crate) fn require(
        &self,
        sound: bool,
        path: &str,
        message: impl Into<String>,
        help: impl Into<String>,
    ) -> Result<(), SpecError> {
        if sound { Ok(()) } else { Err(self.error_at(path, message, help)) }
    }

    /// The place of a path in the override that sets it or something near it, if one does.
    fn overridden(&self, path: &str) -> Option<(usize, usize)> {
        let first = path.split(['.', '[']).next().filter(|f| !f.is_empty())?;
        self.overrides.iter().rev().find_map(|place| {
            let nearest = locate::locate(&self.text, &format!("{place}.{first}"));
            let found = nearest != locate::locate(&self.text, place);
            if found { locate::locate(&self.text, &format!("{place}.{path}")) } else { None }
        })
    }
}

/// Parses one of the project's own YAML tables; the error text carries line and column.
pub fn from_yaml<T: serde::de::DeserializeOwned>(text: &str) -> Result<T, String> {
    if let Some(line) = bounds::too_deep(text) {
        return Err(format!("{TOO_DEEP} at line {line}"));
    }
    bounds::values(text).and_then(|_| serde_yaml::from_str(text)).map_err(|e| e.to_string())
}

/// A help text that names the known key closest to an unknown one, read off serde's message.
fn nearest_key(message: &str) -> Option<String> {
    let (_, rest) = message.split_once("unknown field `")?;
    let mut names = rest.split('`').step_by(2);
    let unknown = names.next()?;
    let known: Vec<&str> = names.collect();
    nearest(unknown, known.iter().copied()).map(|k| format!("did you mean `{k}`?"))
}

/// A help text for an unknown name: the known one most like it, or else all of them.
pub fn suggestion<'a>(word: &str, known: impl Iterator<Item = &'a str> + Clone) -> String {
    match nearest(word, known.clone()) {
        Some(name) => format!("did you mean `{name}`?"),
        None => format!("known: {}", known.collect::<Vec<_>>().join(", ")),
    }
}

/// The candidate most like `word`, if any is like it at all.
pub fn nearest<'a>(word: &str, candidates: impl Iterator<Item = &'a str>) -> Option<&'a str> {
    candidates
        .map(|c| (strsim::jaro_winkler(word, c), c))
        .filter(|(likeness, _)| *likeness > 0.7)
        .max_by(|a, b| a.0.total_cmp(&b.0))
        .map(|(_, c)| c)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::record::ProcedureId;

    fn parse(text: &str) -> Result<Spec, SpecError> {
        Source::new("spec.yaml".into(), text.into()).parse()
    }

    pub(super) const MINIMAL: &str = "luxproof: 1
room:
  size_m: [20, 20, 20]
  reflectance: {floor: 0.2, walls: 0.5, ceiling: 0.8}
luminaires:
  - {id: a, photometry: a.ies, at_m: [10, 10, 10]}
meters:
  plane: {points_m: [[1, 1, 1]], normal: [0, 0, 1]}
procedures:
  direct_illuminance: {meters: plane}
";

    #[test]
    fn what_is_wrong_is_refused_at_its_place_and_an_unknown_key_answered_with_the_nearest() {
        for (right, wrong, word, line, column, help) in [
            ("size_m", "sise_m", "sise_m", 3, Some(3), Some("did you mean `size_m`?")),
            ("0.5", "1.5", "1.5", 4, Some(36), None),
            ("[1, 1, 1]", "[1, much, 1]", "much", 8, None, None),
        ] {
            let error = parse(&MINIMAL.replace(right, wrong)).unwrap_err();
            assert_eq!((error.line, error.help.as_deref()), (Some(line), help), "{error}");
            assert!(error.message.contains(word) && column.is_none_or(|c| error.column == Some(c)), "{error}");
        }
    }

    #[test]
    fn a_minimal_spec_is_read_and_walls_may_differ_and_meter_sets_be_listed() {
        let spec = parse(MINIMAL).unwrap();
        assert_eq!(spec.room.size_m, [20.0, 20.0, 20.0]);
        assert!(spec.procedures.0.contains_key(&ProcedureId::DirectIlluminance));
        let text = MINIMAL
            .replace("walls: 0.5", "walls: {x-: 0.1, x+: 0.2, y-: 0.3, y+: 0.4}")
            .replace("meters: plane}", "meters: [plane]}");
        let reflectances = parse(&text).unwrap().room.reflectance.build();
        assert_eq!((reflectances.wall_x_max, reflectances.wall_y_min), (0.2, 0.3));
    }
}
