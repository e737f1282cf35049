//! A bundle's folder as one file. It is packed in one way alone, so that no byte of it is free: in order, not compressed, of one date.

use std::fs::File;
use std::io::{Seek, Write};
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
        .last_modified_time(DateTime::default())
        .unix_permissions(0o644);
    let mut archive = ZipWriter::new(to);
    for name in sums.keys().map(String::as_str).chain([SUMS]) {
        let mut file = File::open(folder.join(name))?;
        archive.start_file(name, options.large_file(file.metadata()?.len() > u64::from(u32::MAX)))?;
        std::io::copy(&mut file, &mut archive)?;
    }
    archive.finish()?.flush()?;
    Ok(())
}
