//! The spec: one YAML file of room, luminaires, meters and procedures, read, checked and built into a scene.
//!
//! The only module that knows `serde_yaml`. Every error names file, line and column.

mod bounds;
mod build;
mod cases;
mod compare;
mod content;
mod faults;
mod key_suggestions;
mod length_unit;
mod lints;
mod locate;
pub mod model;
mod mounting;
mod place;
pub mod procedures;
mod recorded;
mod shape;
mod suite;
mod tree;
mod trust;
mod write;

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use schemars::JsonSchema;

use luxproof_process::printable;

pub use build::{Case, en_12464_counts};
pub use content::content;
pub use faults::Faults;
pub use faults::MAX_FAULTS;
pub use lints::find_lints;
pub use locate::PlacePart;
pub use model::{Budget, EngineSettings, SHORTEST_PATIENCE, Spec, ToleranceOverride};
pub use recorded::{READINGS, RecordedReadings};
pub use suite::{Suite, filtered, specs, suite};
pub use trust::{BUNDLE_FILE, Resolve, Trust};
pub use write::yaml;

/// What is wrong with a spec, where, and what to do.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{}", describe(self))]
pub struct SpecError {
    /// The file that holds the error: the spec or a file that it names.
    pub file: PathBuf,
    /// Line, counted from 1, where the error has one.
    pub line: Option<usize>,
    /// Column, counted from 1.
    pub column: Option<usize>,
    pub message: String,
    pub help: Option<String>,
    /// Whether no line of the file is shown: it is no spec, and a stranger's spec names it.
    pub is_withheld: bool,
}

impl SpecError {
    /// One that concerns all of a file, or an option of the command line.
    pub fn of(file: impl Into<PathBuf>, message: impl Into<String>, help: impl Into<String>) -> Self {
        let (file, message, help) = (file.into(), message.into(), Some(help.into()));
        Self { file, line: None, column: None, message, help, is_withheld: false }
    }

    /// The same without the words of the file, unless the spec that names it is trusted: a stranger's spec may name any file below its folder.
    #[must_use]
    pub fn withheld(self, trust: Trust) -> Self {
        if trust == Trust::Own {
            return self;
        }
        let message = printable::without_quotes(&self.message);
        Self { message, help: self.help.map(|help| printable::without_quotes(&help)), is_withheld: true, ..self }
    }
}

/// An error in one printable line, whatever it quotes.
fn describe(error: &SpecError) -> String {
    let [line, column] = [error.line, error.column].map(|number| number.map(|n| format!("{n}:")).unwrap_or_default());
    let help = error.help.as_ref().map(|help| format!("; {help}")).unwrap_or_default();
    printable::line(&format!("{}:{line}{column} {}{help}", error.file.display(), error.message), usize::MAX)
}

/// Whether a line of YAML has nothing but blanks or a comment.
fn is_blank_or_comment(line: &str) -> bool {
    line.trim().is_empty() || line.trim_start().starts_with('#')
}

/// Whether a line has an odd number of single or of double quotes.
fn has_open_quote(line: &str) -> bool {
    ['\'', '"'].iter().any(|quote| line.matches(*quote).count() % 2 == 1)
}

/// The most bytes of a spec or policy; one of 100,000 meters has some 5 MB.
const MAX_SPEC_BYTES: u64 = 64 << 20;

const NO_YAML: &str = "look for a bracket, a quote or a colon that is missing here or in the lines above";

const TOO_DEEP: &str = "lists in lists, too deep to be read";
const DEPTH: &str = "close what is open: a spec is a few brackets deep";

/// A spec or policy file as it was read: its text, kept for the places of errors.
#[derive(Clone, Debug, Default)]
pub struct Source {
    pub path: PathBuf,
    /// Of all cases of a suite the same one.
    pub text: Arc<str>,
    /// Whose it is.
    pub trust: Trust,
    /// How many it has, its aliases followed, at most.
    values: usize,
    /// The places of the overrides that lie over it, such as `cases[1]`; none but in a case of a suite.
    overrides: Vec<String>,
    /// Bytes that places of errors were looked for in, by all cases of a suite together.
    looked_through: Arc<AtomicUsize>,
}

impl Source {
    pub fn read(path: &Path, trust: Trust) -> Result<Self, SpecError> {
        let bytes = trust.read_spec(path).map_err(|error| unreadable(path, trust, &error))?;
        let is_utf_16 = bytes.starts_with(&[0xff, 0xfe]) || bytes.starts_with(&[0xfe, 0xff]);
        let text = String::from_utf8(bytes).map_err(|e| {
            let why = if is_utf_16 { "is UTF-16".to_owned() } else { format!("is not UTF-8: {e}") };
            SpecError::of(path, why, "save it as UTF-8")
        })?;
        // The mark that some editors put before UTF-8 is no part of the text.
        let text = text.strip_prefix('\u{feff}').map(str::to_owned).unwrap_or(text);
        if let Some(line) = bounds::too_deep(&text) {
            return Err(SpecError { line: Some(line), ..SpecError::of(path, TOO_DEEP, DEPTH) });
        }
        let source = Self { trust, ..Self::new(path.to_owned(), text) };
        let values = bounds::values(&source.text).map_err(|error| source.fault(&error))?;
        Ok(Self { values, ..source })
    }

    pub fn new(path: PathBuf, text: String) -> Self {
        Self { path, text: text.into(), ..Self::default() }
    }

    /// Parses the text as a spec or a policy; unknown keys are errors with the nearest known key.
    pub fn parse<T: serde::de::DeserializeOwned>(&self) -> Result<T, SpecError> {
        serde_yaml::from_str(&self.text).map_err(|error| self.misread(&error))
    }

    /// What its parser refused, with the place.
    fn misread(&self, error: &serde_yaml::Error) -> SpecError {
        let fault = self.fault(error);
        if tree::tree(&self.text).is_ok() {
            return SpecError { help: nearest_key(&fault.message), ..fault };
        }
        let fault = SpecError { help: Some(NO_YAML.to_owned()), ..fault };
        self.tab().or_else(|| self.quote(&fault.message)).unwrap_or(fault)
    }

    /// What its parser says, with the place, and nothing that is found by reading it once more.
    fn fault(&self, error: &serde_yaml::Error) -> SpecError {
        let message = error.to_string();
        // serde_yaml ends its message with the place, which the error carries already.
        let message = message.split(" at line ").next().unwrap_or(&message);
        let location = error.location();
        SpecError {
            file: self.path.clone(),
            line: location.as_ref().map(serde_yaml::Location::line),
            column: location.as_ref().map(serde_yaml::Location::column),
            message: shape::plain(message),
            help: None,
            is_withheld: false,
        }
    }

    /// A tab where YAML wants blanks, which its reader calls otherwise.
    fn tab(&self) -> Option<SpecError> {
        let lines = self.text.lines().enumerate().filter(|(_, line)| !is_blank_or_comment(line));
        let mut found = lines.map(|(k, line)| (k, &line[..line.len() - line.trim_start().len()]));
        let (line, column) = found.find_map(|(k, indent)| Some((k, indent.find('\t')?)))?;
        let fault = SpecError::of(
            &self.path,
            "this line is indented with a tab",
            "Use spaces, not tabs: replace the tab by two spaces",
        );
        Some(SpecError { line: Some(line + 1), column: Some(column + 1), ..fault })
    }

    /// A quote that is open at the text's end, where it was noticed.
    fn quote(&self, message: &str) -> Option<SpecError> {
        let (k, line) = self.text.lines().enumerate().find(|(_, line)| has_open_quote(line))?;
        let column = line.chars().position(|c| c == '\'' || c == '"')?;
        let fault = SpecError::of(&self.path, "a quote that stands here is not closed", NO_YAML);
        let is_end = message.contains("unexpected end of stream");
        is_end.then_some(SpecError { line: Some(k + 1), column: Some(column + 1), ..fault })
    }

    /// The same with every fault of its shape, not only the first.
    pub fn parse_whole<T: serde::de::DeserializeOwned + JsonSchema>(&self) -> Result<T, Faults> {
        let shape::Shaped { read, faults, .. } = shape::shaped(self, tree::tree(&self.text).ok().as_ref());
        match (read, Faults::of(faults)) {
            (Some(read), None) => Ok(read),
            (_, Some(faults)) => Err(faults),
            (None, None) => Err(self.error_at("", "this cannot be read", NO_YAML).into()),
        }
    }

    /// An error at a place in the file, given as a path such as `meters.ceiling.points_m[2]`.
    pub fn error_at(&self, path: &str, message: impl Into<String>, help: impl Into<String>) -> SpecError {
        let message = message.into();
        let message = if path.is_empty() { message } else { format!("{path}: {message}") };
        self.error_at_part(PlacePart::Value, path, message, help)
    }

    /// The same, of a key perhaps; the message stands for itself.
    pub fn error_at_part(
        &self,
        spot: PlacePart,
        path: &str,
        message: impl Into<String>,
        help: impl Into<String>,
    ) -> SpecError {
        let place = self.overridden(path, spot).or_else(|| self.locate(path, spot));
        let error = SpecError::of(&self.path, message, help);
        SpecError { line: place.map(|p| p.0), column: place.map(|p| p.1), ..error }
    }

    /// Refuses what stands at a place unless it is sound.
    pub fn require(
        &self,
        sound: bool,
        path: &str,
        message: impl Into<String>,
        help: impl Into<String>,
    ) -> Result<(), SpecError> {
        if sound { Ok(()) } else { Err(self.error_at(path, message, help)) }
    }

    /// The place of a path in the override that sets it or something near it, if one does.
    fn overridden(&self, path: &str, spot: PlacePart) -> Option<(usize, usize)> {
        let first = path.split(['.', '[']).next().filter(|f| !f.is_empty())?;
        self.overrides.iter().rev().find_map(|place| {
            let nearest = self.locate(&format!("{place}.{first}"), PlacePart::Value);
            let found = nearest != self.locate(place, PlacePart::Value);
            if found { self.locate(&format!("{place}.{path}"), spot) } else { None }
        })
    }

    /// Line and column of a path, unless too many were looked for: each is found by a walk through the text, and a stranger's has as many
    /// faults as it likes.
    fn locate(&self, path: &str, spot: PlacePart) -> Option<(usize, usize)> {
        let before = self.looked_through.fetch_add(self.text.len(), Ordering::Relaxed);
        if before < shape::MAX_BYTES_READ_AGAIN { locate::locate(&self.text, path, spot) } else { None }
    }
}

/// Parses one of the project's own YAML tables; the error text carries line and column.
pub fn from_yaml<T: serde::de::DeserializeOwned>(text: &str) -> Result<T, String> {
    if let Some(line) = bounds::too_deep(text) {
        return Err(format!("{TOO_DEEP} at line {line}"));
    }
    bounds::values(text).and_then(|_| serde_yaml::from_str(text)).map_err(|e| {
        let place = e.location().map(|l| format!(" at line {} column {}", l.line(), l.column())).unwrap_or_default();
        let message = e.to_string();
        shape::plain(message.split(" at line ").next().unwrap_or(&message)) + &place
    })
}

/// A help text that names the known key closest to an unknown one, read off serde's message.
fn nearest_key(message: &str) -> Option<String> {
    let (unknown, known) = names_in(message)?;
    ambiguous(unknown, &known).or_else(|| meant_key(message).map(|key| format!("did you mean `{key}`?")))
}

/// The unknown key and the known ones of a message of serde's.
fn names_in(message: &str) -> Option<(&str, Vec<&str>)> {
    let (_, rest) = message.split_once("unknown field `").or_else(|| message.split_once("unknown variant `"))?;
    let mut names = rest.split('`').step_by(2);
    let unknown = names.next()?;
    Some((unknown, names.collect()))
}

/// The known key closest to the unknown one of a message of serde's.
fn meant_key(message: &str) -> Option<&str> {
    let (unknown, known) = names_in(message)?;
    if ambiguous(unknown, &known).is_some() {
        return None;
    }
    synonym(unknown, &known).or_else(|| nearest(unknown, known.iter().copied()))
}

/// Words for keys and procedures that users try first, each with the name in specs.
const SYNONYMS: [(&str, &str); 25] = [
    ("ugr", "unified_glare_rating"),
    ("glare", "unified_glare_rating"),
    ("intensity", "luminous_intensity"),
    ("reflected_illuminance", "indirect_illuminance"),
    ("furniture", "obstacles"),
    ("bodies", "obstacles"),
    ("objects", "obstacles"),
    ("lamps", "luminaires"),
    ("lights", "luminaires"),
    ("points", "meters"),
    ("sensors", "meters"),
    ("renderers", "engines"),
    ("name", "title"),
    ("ies", "photometry"),
    ("position", "at_m"),
    ("rotation", "rotate_deg"),
    ("metres", "m"),
    ("meters", "m"),
    ("millimetres", "mm"),
    ("millimeters", "mm"),
    ("centimetres", "cm"),
    ("centimeters", "cm"),
    ("feet", "ft"),
    ("foot", "ft"),
    ("inches", "in"),
];

/// Words that may mean any of several procedures, with those.
const AMBIGUOUS: [&str; 3] = ["illuminance", "lux", "illuminances"];
const ILLUMINANCES: [&str; 3] = ["direct_illuminance", "indirect_illuminance", "total_illuminance"];

/// A help text for a word that may mean several of the known names.
fn ambiguous(word: &str, known: &[&str]) -> Option<String> {
    let [direct, indirect, total] = ILLUMINANCES;
    let is_ambiguous = AMBIGUOUS.contains(&word.to_lowercase().as_str());
    (is_ambiguous && ILLUMINANCES.iter().all(|name| known.contains(name)))
        .then(|| format!("choose `{direct}`, `{indirect}`, or `{total}` for both"))
}

/// The known name that is another word for this one.
fn synonym<'a>(word: &str, known: &[&'a str]) -> Option<&'a str> {
    let word = word.to_lowercase();
    let (_, name) = SYNONYMS.iter().find(|(other, name)| *other == word && known.contains(name))?;
    known.iter().copied().find(|candidate| candidate == name)
}

/// The largest number of existing names in a message.
const MAX_TOLD: usize = 20;

/// A help text for an unknown name: the known one most like it, or else all of them.
pub fn suggestion<'a>(word: &str, known: impl Iterator<Item = &'a str> + Clone) -> String {
    let names: Vec<&str> = known.clone().collect();
    if let Some(help) = ambiguous(word, &names) {
        return help;
    }
    match synonym(word, &names).or_else(|| nearest(word, known.clone())) {
        Some(name) => format!("did you mean `{name}`?"),
        None if known.clone().next().is_none() => "there is none".to_owned(),
        None => {
            let more = known.clone().count().saturating_sub(MAX_TOLD);
            let more = if more > 0 { format!(" and {more} more") } else { String::new() };
            format!("choose one of: {}{more}", known.take(MAX_TOLD).collect::<Vec<_>>().join(", "))
        }
    }
}

/// The error for a file that cannot be read.
fn unreadable(path: &Path, trust: Trust, error: &std::io::Error) -> SpecError {
    // Names of files next to an untrusted one are not shown.
    let similar = (trust == Trust::Own).then(|| similar_file(path)).flatten();
    let help = similar.map(|name| format!("did you mean `{}`?", path.with_file_name(name).display()));
    SpecError::of(path, format!("cannot be read: {error}"), help.unwrap_or_else(|| "check the path".to_owned()))
}

/// The name of the file in the same folder with the most similar name, if any.
fn similar_file(path: &Path) -> Option<String> {
    let name = path.file_name()?.to_str()?;
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let files = std::fs::read_dir(folder).ok()?.flatten();
    let mut names: Vec<String> = files.filter_map(|file| file.file_name().into_string().ok()).collect();
    names.retain(|file| file != name && Path::new(file).extension() == Path::new(name).extension());
    names.sort();
    nearest(name, names.iter().map(String::as_str)).map(str::to_owned)
}

/// The longest names that are compared letter by letter, which takes the product of their lengths.
const MAX_LIKENED_BYTES: usize = 200;

/// The candidate that `word` misspells: a letter or two are wrong, missing, doubled or swapped.
pub fn misspelt<'a>(word: &str, candidates: impl Iterator<Item = &'a str>) -> Option<&'a str> {
    let candidates = candidates.filter(|c| word.len() <= MAX_LIKENED_BYTES && c.len() <= MAX_LIKENED_BYTES);
    let near = candidates.map(|c| (strsim::damerau_levenshtein(word, c), c)).filter(|(far, _)| (1..=2).contains(far));
    near.filter(|(_, c)| c.len() > 4).min().map(|(_, c)| c)
}

/// The candidate most like `word`, if any is like it at all.
pub fn nearest<'a>(word: &str, candidates: impl Iterator<Item = &'a str>) -> Option<&'a str> {
    candidates
        .filter(|c| word.len() <= MAX_LIKENED_BYTES && c.len() <= MAX_LIKENED_BYTES)
        .map(|c| (strsim::jaro_winkler(word, c), c))
        .filter(|(likeness, _)| *likeness > 0.7)
        .max_by(|a, b| a.0.total_cmp(&b.0))
        .map(|(_, c)| c)
}

#[cfg(test)]
mod tests {
    use super::*;
    use luxproof_model::ProcedureId;

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
            (
                "direct_illuminance",
                "illuminance",
                "illuminance",
                10,
                None,
                Some("choose `direct_illuminance`, `indirect_illuminance`, or `total_illuminance` for both"),
            ),
            ("[1, 1, 1]", "[1, much, 1]", "much", 8, None, None),
        ] {
            let error = parse(&MINIMAL.replace(right, wrong)).unwrap_err();
            assert_eq!((error.line, error.help.as_deref()), (Some(line), help), "{error}");
            assert!(error.message.contains(word) && column.is_none_or(|c| error.column == Some(c)), "{error}");
        }
    }

    #[test]
    fn shares_in_percent_are_answered_with_the_number_to_write() {
        let text = MINIMAL.replace("walls: 0.5, ceiling: 0.8", "walls: 50 %, ceiling: 80%");
        let faults = Source::new("spec.yaml".into(), text).parse_whole::<Spec>().unwrap_err();
        let help: Vec<Option<&str>> = faults.all().iter().map(|fault| fault.help.as_deref()).collect();
        assert_eq!(help, [Some("write 50 % as 0.5"), Some("write 80 % as 0.8")]);
    }

    #[test]
    fn a_minimal_spec_is_read_and_walls_may_differ_and_meter_sets_be_listed() {
        let spec = parse(MINIMAL).unwrap();
        assert_eq!(spec.room.size_m, Some([20.0, 20.0, 20.0]));
        assert!(spec.procedures.0.contains_key(&ProcedureId::DirectIlluminance));
        let text = MINIMAL
            .replace("walls: 0.5", "walls: {x-: 0.1, x+: 0.2, y-: 0.3, y+: 0.4}")
            .replace("meters: plane}", "meters: [plane]}");
        let reflectances = parse(&text).unwrap().room.reflectance.unwrap().build().unwrap();
        assert_eq!((reflectances.wall_x_max, reflectances.wall_y_min), (0.2, 0.3));
    }
}
