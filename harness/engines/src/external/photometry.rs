//! The photometric files of a job beside its tables: the user's own bytes, or what our writer makes of a table that no file says.

use std::path::Path;

use luxproof_photometry::{Photometry, lm63};
use schemars::JsonSchema;
use serde::Serialize;
use sha2::{Digest, Sha256};

use crate::{Job, SceneFile};
use luxproof_process::digest::hexadecimal;

/// A photometric file.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub(super) struct PhotometryForm {
    /// Where it is: a path, in exported jobs from the folder that `LUXPROOF_SCENE_DIR` names. What it names itself (`TILT=<file>`) lies beside.
    file: String,
    /// What it is: `LM-63-1995`, `EULUMDAT`, `TM-33-18`.
    format: String,
    /// SHA-256 of its bytes, 64 hexadecimal digits.
    sha256: String,
    /// Whose it is: `user`, or `luxproof` where there is a table alone, of a scene of known answer say.
    by: By,
}

/// Who wrote a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
enum By {
    User,
    Luxproof,
}

/// The files of a job, each once, and of each luminaire which is its own.
pub(super) struct Files {
    pub(super) files: Vec<SceneFile>,
    forms: Vec<PhotometryForm>,
}

impl Files {
    pub(super) fn of(job: &Job) -> Self {
        let mut all = Self { files: vec![], forms: vec![] };
        let mut seen: Vec<&Photometry> = vec![];
        for luminaire in &job.scene.luminaires {
            let photometry: &Photometry = &luminaire.photometry;
            let known = seen.iter().position(|other| std::ptr::eq(*other, photometry) || *other == photometry);
            let place = known.unwrap_or_else(|| {
                seen.push(photometry);
                seen.len() - 1
            });
            let (form, files) = written(photometry, &format!("photometry-{place}"));
            if known.is_none() {
                all.files.extend(files);
            }
            all.forms.push(form);
        }
        all
    }

    /// Where they are, once they lie in a folder.
    pub(super) fn forms(&self, folder: Option<&Path>) -> Vec<PhotometryForm> {
        let Some(folder) = folder else { return self.forms.clone() };
        let places = self.forms.iter().map(|form| folder.join(&form.file).display().to_string());
        self.forms.iter().zip(places).map(|(form, file)| PhotometryForm { file, ..form.clone() }).collect()
    }
}

/// The file of a photometry with those that it names, in a folder of its own.
fn written(photometry: &Photometry, folder: &str) -> (PhotometryForm, Vec<SceneFile>) {
    let sources = photometry.source.iter();
    let mut files: Vec<SceneFile> = sources
        .map(|source| SceneFile { name: format!("{folder}/{}", source.name), bytes: source.bytes.to_vec() })
        .collect();
    let (format, by) =
        if files.is_empty() { ("LM-63-2002", By::Luxproof) } else { (photometry.format.as_str(), By::User) };
    if files.is_empty() {
        let bytes = lm63::write_2002(photometry).text.into_bytes();
        files.push(SceneFile { name: format!("{folder}/luminaire.ies"), bytes });
    }
    let (file, sha256) = (files[0].name.clone(), hexadecimal(&Sha256::digest(&files[0].bytes)));
    (PhotometryForm { file, format: format.to_owned(), sha256, by }, files)
}
