//! The answers of luxproof's own readers: the first submission.

use std::path::Path;

use luxproof_photometry::{Photometry, ReadError, read_by};

use crate::catalogue::{PACK_VERSION, pack_files};
use crate::pack_file::PackFile;
use crate::submission::{FileAnswer, ReaderName, Scale, Submission};

/// Reads all files of the pack with luxproof's readers.
pub fn own_submission(version: &str) -> Submission {
    let files = pack_files();
    Submission {
        pack: PACK_VERSION.into(),
        reader: ReaderName { name: "luxproof".into(), version: Some(version.into()) },
        scale: Scale::Candela,
        relative_uncertainty: 0.0,
        files: files.iter().map(|file| (file.name.to_owned(), answer(file))).collect(),
    }
}

/// The answer to a file.
fn answer(file: &PackFile) -> FileAnswer {
    let bytes = match file.bytes() {
        Ok(bytes) => bytes,
        Err(error) => return FileAnswer { refused: Some(error.to_string()), ..FileAnswer::default() },
    };
    match read(file.name, &bytes) {
        Ok(photometry) => answer_from(file, &photometry),
        Err(error) => FileAnswer { refused: Some(error.to_string()), ..FileAnswer::default() },
    }
}

fn read(name: &str, bytes: &[u8]) -> Result<Photometry, ReadError> {
    let path = Path::new(name);
    read_by(path, &|asked| {
        if asked == path { Ok(bytes.to_vec()) } else { Err(std::io::ErrorKind::NotFound.into()) }
    })
}

fn answer_from(file: &PackFile, photometry: &Photometry) -> FileAnswer {
    let distribution = &photometry.distribution;
    let towards = file.directions.iter().map(|asked| distribution.intensity(asked.c_deg, asked.gamma_deg).value());
    FileAnswer {
        candela: Some(towards.map(Some).collect()),
        refused: None,
        flux_lm: Some(distribution.flux().value()),
        lamp_lumens: photometry.lamp_lumens,
        // TM-33 has no opening, and luxproof takes a point.
        opening_m: file.document.opening_m().map(|_| photometry.opening.bounding_box_m()),
    }
}
