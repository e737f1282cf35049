//! What a reader answers to the pack: `RESULTS.json`.

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use luxproof_process::printable::Quoted;

use crate::catalogue::PACK_VERSION;
use crate::pack_file::PackFile;

/// The answers of a reader to the files of the pack.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Submission {
    /// Version of the pack, such as 1.0.0.
    pub pack: String,
    /// The reader.
    pub reader: ReaderName,
    /// Whether answers are candela.
    #[serde(default)]
    pub scale: Scale,
    /// Relative standard uncertainty of the answers; 0 for a parser. A renderer may state up to 0.01.
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 0.01))]
    pub relative_uncertainty: f64,
    /// The answers by the name of the file. Files that are not listed are not judged.
    pub files: BTreeMap<String, FileAnswer>,
}

/// The name of a reader.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ReaderName {
    /// The name of the program or library.
    pub name: String,
    /// Its version.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub version: Option<String>,
}

/// The unit of the answers.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Scale {
    /// Candela.
    #[default]
    Candela,
    /// Users set the brightness, so that each file has another factor. Mistakes that only scale do not show.
    Relative,
}

/// The answer to a file: `candela`, or the reason of a refusal.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FileAnswer {
    /// Luminous intensities in the order of `directions`; null for a direction without an answer.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub candela: Option<Vec<Option<f64>>>,
    /// Why the reader did not read the file.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub refused: Option<String>,
    /// Luminous flux of the table.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub flux_lm: Option<f64>,
    /// Rated lumens of all lamps.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub lamp_lumens: Option<f64>,
    /// The luminous opening: extents along C 90, along C 0 and upwards, in metres.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub opening_m: Option<[f64; 3]>,
}

/// The largest relative uncertainty of a submission, so that every mistake still shows.
pub(crate) const MAX_RELATIVE_UNCERTAINTY: f64 = 0.01;

/// Why a submission cannot be judged.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SubmissionError {
    /// Of another version of the pack.
    #[error("the submission answers version {} of the pack, and this program judges {PACK_VERSION}", Quoted(.found))]
    Version {
        /// The version of the submission.
        found: String,
    },
    /// An uncertainty that hides mistakes, or none.
    #[error("relative_uncertainty is {found}; it must be from 0 to {MAX_RELATIVE_UNCERTAINTY}")]
    Uncertainty {
        /// The value of the submission.
        found: f64,
    },
    /// A file that is not in the pack.
    #[error("the pack has no file `{}`", Quoted(.name))]
    UnknownFile {
        /// The name.
        name: String,
    },
    /// Neither an answer nor a refusal, or both.
    #[error("{name}: state either `candela` or `refused`")]
    NoAnswer {
        /// The name of the file.
        name: String,
    },
    /// Another number of answers than of directions.
    #[error("{name}: candela has {found} numbers for {expected} directions")]
    Count {
        /// The name of the file.
        name: String,
        /// Numbers of the submission.
        found: usize,
        /// Directions of the pack.
        expected: usize,
    },
    /// A submission without files.
    #[error("the submission answers no file")]
    Empty,
}

impl SubmissionError {
    /// What to do about it.
    pub const fn help(&self) -> &'static str {
        match self {
            Self::Version { .. } => "write the pack with `luxproof conformance --emit DIR`, and answer its files",
            Self::Uncertainty { .. } => "lower it by more samples, or leave it out for a parser",
            Self::UnknownFile { .. } => "`pack.json` lists all files",
            Self::NoAnswer { .. } => "leave out files that the reader does not support",
            Self::Count { .. } => "answer the `directions` of the file in their order, null for none",
            Self::Empty => "README.md of the pack has an example",
        }
    }
}

impl Submission {
    /// Checks that it answers files of this pack.
    pub(crate) fn check(&self, files: &[PackFile]) -> Result<(), SubmissionError> {
        if major(&self.pack) != major(PACK_VERSION) {
            return Err(SubmissionError::Version { found: self.pack.clone() });
        }
        if !(0.0..=MAX_RELATIVE_UNCERTAINTY).contains(&self.relative_uncertainty) {
            return Err(SubmissionError::Uncertainty { found: self.relative_uncertainty });
        }
        if self.files.is_empty() {
            return Err(SubmissionError::Empty);
        }
        for (name, answer) in &self.files {
            let Some(file) = files.iter().find(|file| file.name == name) else {
                return Err(SubmissionError::UnknownFile { name: name.clone() });
            };
            if answer.candela.is_some() == answer.refused.is_some() {
                return Err(SubmissionError::NoAnswer { name: name.clone() });
            }
            let found = answer.candela.as_ref().map_or(file.directions.len(), Vec::len);
            if found != file.directions.len() {
                return Err(SubmissionError::Count { name: name.clone(), found, expected: file.directions.len() });
            }
        }
        Ok(())
    }
}

/// The first number of a version.
fn major(version: &str) -> &str {
    version.split('.').next().unwrap_or_default()
}
