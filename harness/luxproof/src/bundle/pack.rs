//! A bundle's folder as one file. It is packed in one way alone, so that no byte of it is free: in order, not compressed, of one date.
//! Of permissions it keeps whether a file may be run.

use std::fs::File;
use std::io::{Seek, Write};
use std::os::unix::fs::PermissionsExt;
use std::path::Path;

use zip::result::ZipResult;
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, DateTime, ZipWriter};

use super::SUMS;
use super::sums::Sums;

/// What a folder with these files makes.
pub(super) fn pack(folder: &Path, sums: &Sums, to: impl Write + Seek) -> ZipResult<()> {
    let options = SimpleFileOptions::default()
        .compression_method(CompressionMethod::Stored)
        .last_modified_time(DateTime::default());
    let mut archive = ZipWriter::new(to);
    for name in sums.keys().map(String::as_str).chain([SUMS]) {
        let mut file = File::open(folder.join(name))?;
        let metadata = file.metadata()?;
        let mode = if is_program(metadata.permissions().mode()) { 0o755 } else { 0o644 };
        let options = options.unix_permissions(mode).large_file(metadata.len() > u64::from(u32::MAX));
        archive.start_file(name, options)?;
        std::io::copy(&mut file, &mut archive)?;
    }
    archive.finish()?.flush()?;
    Ok(())
}

/// Whether the owner of a file of this mode may run it; a bundle keeps no more of the mode.
pub(super) const fn is_program(mode: u32) -> bool {
    mode & 0o100 != 0
}
