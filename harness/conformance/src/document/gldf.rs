//! GLDF containers of the pack: a zip with `product.xml` and photometric files.

use std::io::{Cursor, Write};

use zip::result::ZipError;
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, DateTime, ZipWriter};

use super::Eulumdat;
use crate::pack_file::PackFile;
use crate::table::Table;

/// The intensities of the file that the product does not refer to, per those of the right one.
pub(super) const UNLISTED_FACTOR: f64 = 0.5;

const PRODUCT: &str = r#"<?xml version="1.0" encoding="UTF-8"?>
<Root>
<Header>
<Manufacturer>luxproof</Manufacturer>
<FormatVersion major="1" minor="0" pre-release="3"/>
<CreatedWithApplication>luxproof</CreatedWithApplication>
<GldfCreationTimeCode>2026-11-30T00:00:00Z</GldfCreationTimeCode>
<UniqueGldfId>00000000-0000-4000-8000-000000000071</UniqueGldfId>
</Header>
<GeneralDefinitions>
<Files>
<File id="earlier" contentType="ldc/eulumdat" type="localFileName">a-earlier-design.ldt</File>
<File id="current" contentType="ldc/eulumdat" type="localFileName">b-current-design.ldt</File>
</Files>
<Photometries>
<Photometry id="photometry">
<PhotometryFileReference fileId="current"/>
</Photometry>
</Photometries>
</GeneralDefinitions>
</Root>
"#;

/// The container: not compressed and of one date, so that its bytes never change.
pub(super) fn container(eulumdat: &Eulumdat, file: &PackFile) -> Result<Vec<u8>, ZipError> {
    let numbers = file.table.numbers.iter().map(|number| number * UNLISTED_FACTOR).collect();
    let unlisted = Table { numbers, ..file.table.clone() };
    let options = SimpleFileOptions::default()
        .compression_method(CompressionMethod::Stored)
        .last_modified_time(DateTime::default())
        .unix_permissions(0o644);
    let mut zip = ZipWriter::new(Cursor::new(vec![]));
    for (name, text) in [
        ("ldc/a-earlier-design.ldt", eulumdat.text(file, &unlisted)),
        ("ldc/b-current-design.ldt", eulumdat.text(file, &file.table)),
        ("product.xml", PRODUCT.to_owned()),
    ] {
        zip.start_file(name, options)?;
        zip.write_all(text.as_bytes())?;
    }
    Ok(zip.finish()?.into_inner())
}
