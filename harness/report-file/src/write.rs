//! Writing a report into the folder of its run; a reader sees the whole file or none.

use std::path::{Path, PathBuf};

use luxproof_model::{REPORT_FILE, Report};
use luxproof_process::files::{self, Durability, FileError};

use crate::{comparison_lines, previous_report, read};

/// Writes a report with its checksum to a file, durably.
pub fn keep(report: &mut Report, path: &Path) -> Result<(), FileError> {
    write_sealed(report, Durability::Lasting, path)
}

/// Writes a report to `report.json` of a folder.
///
/// A report there about another spec, or with readings that this one lacks, is renamed. Its new path is returned.
pub fn keep_in(report: &mut Report, folder: &Path, care: Durability) -> Result<Option<PathBuf>, FileError> {
    let path = folder.join(REPORT_FILE);
    let renamed = previous_report::rename_earlier(report, &path).map_err(|e| FileError::of(&path, e))?;
    keep_again(report, folder, care)?;
    Ok(renamed)
}

/// Writes a report into the folder of its run, durably, and replaces the report there.
pub fn keep_anew(report: &mut Report, folder: &Path) -> Result<(), FileError> {
    keep_again(report, folder, Durability::Lasting)
}

/// Writes a report into the folder of its run, and replaces the report there.
pub fn keep_again(report: &mut Report, folder: &Path, care: Durability) -> Result<(), FileError> {
    write_sealed(report, care, &folder.join(REPORT_FILE))?;
    comparison_lines::keep(report, folder, care)
}

/// Writes a report with its checksum; a long report has one line for each row.
fn write_sealed(report: &mut Report, care: Durability, path: &Path) -> Result<(), FileError> {
    read::seal(report).map_err(|source| FileError::of(path, source))?;
    let written = if report.is_long() {
        files::replace_rows(path, report, care)
    } else {
        files::replace_json(path, report, care)
    };
    written.map_err(|source| FileError::of(path, source))
}
