//! The files of the pack as they are written to a folder.

use std::collections::BTreeMap;

use schemars::{JsonSchema, schema_for};
use serde::{Deserialize, Serialize};
use strum::IntoEnumIterator as _;

use crate::catalogue::{PACK_VERSION, pack_files};
use crate::expected::Expected;
use crate::layout::format_json;
use crate::mistake::{Mistake, Variant};
use crate::submission::{FileAnswer, ReaderName, Scale, Submission};

/// The guide for implementers.
const README: &str = include_str!("../pack/README.md");
/// CC0-1.0.
const LICENSE: &str = include_str!("../pack/LICENSE");

/// A file of the pack.
#[derive(Clone, Debug)]
pub struct WrittenFile {
    /// Its path in the folder of the pack, with slashes.
    pub path: String,
    /// All of it.
    pub bytes: Vec<u8>,
}

/// Why the pack cannot be made.
#[derive(Debug, thiserror::Error)]
pub enum PackError {
    /// A value does not become JSON.
    #[error("{path}: {source}")]
    Json {
        /// The file of the pack.
        path: String,
        /// The reason.
        source: serde_json::Error,
    },
    /// The container cannot be made.
    #[error("{path}: {source}")]
    Archive {
        /// The file of the pack.
        path: String,
        /// The reason.
        source: zip::result::ZipError,
    },
}

/// The index of the pack, `pack.json`.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
pub struct PackIndex {
    /// Version of the pack.
    pub pack: String,
    /// SPDX identifier of the licence.
    pub license: String,
    /// The files.
    pub files: Vec<IndexEntry>,
    /// All mistakes with a name.
    pub mistakes: Vec<NamedSentence>,
    /// All variants with a name.
    pub variants: Vec<NamedSentence>,
}

/// A photometric file in the index.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
pub struct IndexEntry {
    /// Its path.
    pub file: String,
    /// The path of the expected answers.
    pub expected: String,
    /// Its format.
    pub format: String,
    /// What it provokes.
    pub feature: String,
}

/// A name and what it says.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
pub struct NamedSentence {
    /// The name.
    pub name: String,
    /// One sentence.
    pub sentence: String,
}

impl NamedSentence {
    fn new(name: &str, sentence: &str) -> Self {
        Self { name: name.into(), sentence: sentence.into() }
    }
}

/// All files of the pack.
pub fn written_files() -> Result<Vec<WrittenFile>, PackError> {
    let mut written = vec![
        WrittenFile { path: "README.md".into(), bytes: README.into() },
        WrittenFile { path: "LICENSE".into(), bytes: LICENSE.into() },
        json("expected.schema.json", &schema_for!(Expected))?,
        json("results.schema.json", &schema_for!(Submission))?,
        json("pack.json", &index())?,
        json("results-template.json", &template())?,
    ];
    for file in pack_files() {
        let path = photometry_path(file.name);
        let bytes = file.bytes().map_err(|source| PackError::Archive { path: path.clone(), source })?;
        written.push(WrittenFile { path, bytes });
        written.push(json(&expected_path(file.name), &Expected::of(&file))?);
    }
    Ok(written)
}

fn photometry_path(name: &str) -> String {
    format!("files/{name}")
}

fn expected_path(name: &str) -> String {
    format!("expected/{name}.json")
}

/// A value as a JSON file.
fn json(path: &str, value: &impl Serialize) -> Result<WrittenFile, PackError> {
    let value = serde_json::to_value(value).map_err(|source| PackError::Json { path: path.into(), source })?;
    Ok(WrittenFile { path: path.into(), bytes: format_json(&value).into_bytes() })
}

fn index() -> PackIndex {
    let files = pack_files().into_iter().map(|file| IndexEntry {
        file: photometry_path(file.name),
        expected: expected_path(file.name),
        format: file.document.format().into(),
        feature: file.feature.into(),
    });
    PackIndex {
        pack: PACK_VERSION.into(),
        license: "CC0-1.0".into(),
        files: files.collect(),
        mistakes: Mistake::iter().map(|mistake| NamedSentence::new(mistake.id(), mistake.sentence())).collect(),
        variants: Variant::iter().map(|variant| NamedSentence::new(variant.id(), variant.sentence())).collect(),
    }
}

/// A submission without answers, to be filled.
fn template() -> Submission {
    let mut files = BTreeMap::new();
    for file in pack_files() {
        let candela = Some(vec![None; file.directions.len()]);
        files.insert(file.name.to_owned(), FileAnswer { candela, ..FileAnswer::default() });
    }
    Submission {
        pack: PACK_VERSION.into(),
        reader: ReaderName { name: "name of your reader".into(), version: Some("its version".into()) },
        scale: Scale::Candela,
        relative_uncertainty: 0.0,
        files,
    }
}
