//! `comparisons.jsonl` of a long report: one comparison on each line, for programs that cannot hold them all.
//!
//! The first line has the report's checksum, the number of lines that follow and their SHA-256. So an incomplete file is recognised.

use std::io::{self, BufWriter, Seek, SeekFrom, Write};
use std::path::Path;

use serde::Serialize;
use sha2::{Digest, Sha256};

use luxproof_model::Report;
use luxproof_process::digest::hexadecimal;
use luxproof_process::envelope::Schema;
use luxproof_process::files::{self, Durability, FileError};

/// The name of the file in the folder of a run.
const FILE_NAME: &str = "comparisons.jsonl";
const SCHEMA: Schema = Schema { of: "comparisons", version: 2 };

/// The first line.
#[derive(Serialize)]
struct Head<'a> {
    schema: String,
    /// Checksum of the report.
    report: &'a str,
    /// How many lines follow.
    comparisons: usize,
    /// Checksum of the lines that follow, line feeds included.
    sha256: &'a str,
}

/// Writes the comparisons of a long report into a run's folder; for a short report it removes those of an earlier one.
pub(super) fn keep(report: &Report, folder: &Path, care: Durability) -> Result<(), FileError> {
    let path = folder.join(FILE_NAME);
    let written = if report.is_long() {
        files::replace_through(&path, care, |file| write_lines(report, file))
    } else {
        std::fs::remove_file(&path).or_else(files::ignore_absence)
    };
    written.map_err(|source| FileError::of(&path, source))
}

fn write_lines(report: &Report, file: &mut (impl Write + Seek)) -> io::Result<()> {
    let mut sum = Sha256::new();
    let mut writer = BufWriter::new(file);
    // A placeholder of the same length; the checksum is known only after all lines.
    writeln!(writer, "{}", head_line(report, &hexadecimal(&Sha256::digest("")))?)?;
    let mut line = vec![];
    for comparison in &report.comparisons {
        line.clear();
        serde_json::to_writer(&mut line, comparison)?;
        line.push(b'\n');
        sum.update(&line);
        writer.write_all(&line)?;
    }
    writer.seek(SeekFrom::Start(0))?;
    writer.write_all(head_line(report, &hexadecimal(&sum.finalize()))?.as_bytes())?;
    writer.flush()
}

/// The first line with the checksum of the lines that follow.
fn head_line(report: &Report, sha256: &str) -> serde_json::Result<String> {
    let (schema, comparisons) = (SCHEMA.to_string(), report.comparisons.len());
    serde_json::to_string(&Head { schema, report: &report.checksum, comparisons, sha256 })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_line_tells_what_follows() {
        let mut report: Report = crate::tests::long(300);
        crate::read::seal(&mut report).unwrap();
        let mut file = io::Cursor::new(vec![]);
        write_lines(&report, &mut file).unwrap();
        let text = String::from_utf8(file.into_inner()).unwrap();
        let (head, lines) = text.split_once('\n').unwrap();
        let head: serde_json::Value = serde_json::from_str(head).unwrap();
        assert_eq!(head["schema"], "luxproof comparisons 2");
        assert_eq!((&head["report"], &head["comparisons"]), (&report.checksum.into(), &300.into()));
        assert_eq!(head["sha256"], hexadecimal(&Sha256::digest(lines)));
        let read: Result<Vec<luxproof_model::Comparison>, _> = lines.lines().map(serde_json::from_str).collect();
        assert!(read.unwrap() == report.comparisons);
    }

    #[test]
    fn a_short_report_leaves_none_of_an_earlier_one() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join(FILE_NAME), "{}").unwrap();
        for _ in 0..2 {
            keep(&crate::tests::long(3), folder.path(), Durability::Usual).unwrap();
            assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
        }
    }
}
