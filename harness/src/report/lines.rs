//! `comparisons.jsonl` beside a long report: its comparisons, one a line, for programs that cannot hold them all.
//!
//! The first line says whose they are, how many follow, and the SHA-256 of all that follows: a file that ends early is told from a whole one.

use std::io::{self, BufWriter, Seek, SeekFrom, Write};
use std::path::Path;

use serde::Serialize;
use sha2::{Digest, Sha256};

use super::Report;
use crate::system::digest::hexadecimal;
use crate::system::envelope::Schema;
use crate::system::files::{self, Care, FileError};

/// What it is called in the folder of a run.
const FILE: &str = "comparisons.jsonl";
const SCHEMA: Schema = Schema { of: "comparisons", version: 1 };

#[derive(Serialize)]
struct Head<'a> {
    schema: String,
    /// Checksum of the report that they are of.
    report: &'a str,
    /// How many lines follow.
    comparisons: usize,
    /// Of the lines that follow, line feeds included.
    sha256: &'a str,
}

/// Writes those of a long report into a run's folder, and takes those of an earlier one away where there are to be none.
pub(super) fn keep(report: &Report, folder: &Path, care: Care) -> Result<(), FileError> {
    let path = folder.join(FILE);
    let kept = if report.is_long() {
        files::replace_through(&path, care, |file| write(report, file))
    } else {
        std::fs::remove_file(&path).or_else(files::ignore_absence)
    };
    kept.map_err(|source| FileError::of(&path, source))
}

fn write(report: &Report, file: &mut (impl Write + Seek)) -> io::Result<()> {
    let mut sum = Sha256::new();
    let mut writer = BufWriter::new(file);
    let head = |sha256: &str| {
        let (schema, comparisons) = (SCHEMA.to_string(), report.comparisons.len());
        serde_json::to_string(&Head { schema, report: &report.checksum, comparisons, sha256 })
    };
    // As long as the sum that takes its place.
    writeln!(writer, "{}", head(&hexadecimal(&Sha256::digest("")))?)?;
    let mut line = vec![];
    for comparison in &report.comparisons {
        line.clear();
        serde_json::to_writer(&mut line, comparison)?;
        line.push(b'\n');
        sum.update(&line);
        writer.write_all(&line)?;
    }
    writer.seek(SeekFrom::Start(0))?;
    writer.write_all(head(&hexadecimal(&sum.finalize()))?.as_bytes())?;
    writer.flush()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_line_tells_what_follows() {
        let mut report: Report = crate::report::html::tests::long(300);
        report.seal().unwrap();
        let mut file = io::Cursor::new(vec![]);
        write(&report, &mut file).unwrap();
        let text = String::from_utf8(file.into_inner()).unwrap();
        let (head, lines) = text.split_once('\n').unwrap();
        let head: serde_json::Value = serde_json::from_str(head).unwrap();
        assert_eq!(head["schema"], "luxproof comparisons 1");
        assert_eq!((&head["report"], &head["comparisons"]), (&report.checksum.into(), &300.into()));
        assert_eq!(head["sha256"], hexadecimal(&Sha256::digest(lines)));
        let read: Result<Vec<crate::judge::Comparison>, _> = lines.lines().map(serde_json::from_str).collect();
        assert!(read.unwrap() == report.comparisons);
    }

    #[test]
    fn a_short_report_leaves_none_of_an_earlier_one() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join(FILE), "{}").unwrap();
        for _ in 0..2 {
            keep(&crate::report::html::tests::long(3), folder.path(), Care::Usual).unwrap();
            assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
        }
    }
}
