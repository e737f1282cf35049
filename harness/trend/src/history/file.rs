//! The file of a history: appending and replacing lines.

use std::collections::BTreeSet;
use std::fs;
use std::io::Write;
use std::path::Path;

use super::line::{HistoryError, Line};
use luxproof_process::files::{self, FileError};

/// What an addition did to the lines that were there.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Addition {
    /// Replaced lines of the same night and case.
    pub replaced: usize,
    /// The number of an incomplete last line, counted from 1.
    pub cut_short: Option<usize>,
}

/// The complete lines of a text, and the number of an incomplete last one.
pub(super) fn whole_lines(text: &[u8]) -> (&[u8], Option<usize>) {
    let (whole, rest) = text.split_at(text.iter().rposition(|b| *b == b'\n').map_or(0, |end| end + 1));
    (whole, (!rest.is_empty()).then(|| whole.split(|b| *b == b'\n').count()))
}

/// Adds lines to a history, which is created if there is none.
///
/// The file is appended to, or replaced as a whole, and never half written. Lines of a repeated night replace those of the same
/// case, so that repeating a night is harmless.
pub fn add(path: &Path, lines: &[Line<'_>]) -> Result<Addition, HistoryError> {
    let old = match files::read_stored(path) {
        Err(error) if error.source.kind() == std::io::ErrorKind::NotFound => vec![],
        read => read?,
    };
    let mut new = vec![];
    for line in lines {
        new.extend(line.text().map_err(|e| FileError::of(path, std::io::Error::from(e)))?.into_bytes());
        new.push(b'\n');
    }
    let (whole, cut_short) = whole_lines(&old);
    let heads: BTreeSet<String> = lines.iter().map(Line::head).collect();
    let (replaced, remaining): (Vec<&[u8]>, Vec<&[u8]>) = whole
        .split_inclusive(|b| *b == b'\n')
        .partition(|line| heads.iter().any(|head| line.starts_with(head.as_bytes())));
    let added = Addition { replaced: replaced.len(), cut_short };
    if added == Addition::default() {
        append(path, &new).map_err(|source| FileError::of(path, source))?;
        files::sweep(path.parent().unwrap_or(Path::new("")));
    } else {
        let text = [remaining.concat(), new].concat();
        files::replace_lastingly(path, &text).map_err(|source| FileError::of(path, source))?;
    }
    Ok(added)
}

/// Appends text to a file, which is created if there is none.
fn append(path: &Path, text: &[u8]) -> std::io::Result<()> {
    let mut file = fs::OpenOptions::new().create(true).append(true).open(path)?;
    file.write_all(text)?;
    file.sync_all()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::history::{History, Numbers};
    use luxproof_model::Verdict;
    use luxproof_model::{MeterId, ProcedureId, Quantity, ReadingKey};

    fn add_one(path: &Path, night: &str, case: &str, deviation: f64) -> Addition {
        let (key, meter) = (ReadingKey::new(case, ProcedureId::DirectIlluminance, "radiance"), MeterId::new("m", 0));
        let mut line = Line::new(night, &key, Quantity::Illuminance, Verdict::Pass);
        line.push(&meter, Numbers { reference: 2.0, deviation, std_error: 0.01, u: 0.01 });
        add(path, &[line]).unwrap()
    }

    #[test]
    fn whole_lines_end_with_a_line_feed() {
        for (text, whole, cut_short) in [
            ("", "", None),
            ("a", "", Some(1)),
            ("ab\n", "ab\n", None),
            ("ab\nc", "ab\n", Some(2)),
            ("ab\ncd\n\nef", "ab\ncd\n\n", Some(4)),
        ] {
            assert_eq!(whole_lines(text.as_bytes()), (whole.as_bytes(), cut_short), "{text:?}");
        }
    }

    #[test]
    fn a_history_that_cannot_be_read_is_not_replaced() {
        // A folder is there, but is no file.
        let folder = tempfile::tempdir().unwrap();
        let key = ReadingKey::new("room", ProcedureId::DirectIlluminance, "radiance");
        let line = Line::new("2026-01-01", &key, Quantity::Illuminance, Verdict::Pass);
        assert!(matches!(add(folder.path(), &[line]), Err(HistoryError::File(_))));
        assert!(folder.path().is_dir());
    }

    #[test]
    fn a_night_run_again_takes_the_place_of_its_lines_and_of_no_others() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("history.jsonl");
        add_one(&path, "2026-01-01", "one", 3.0);
        for (night, case, deviation, replaced) in [
            ("2026-01-01", "one", 0.125, 1),
            ("2026-01-01", "one-more", 0.5, 0),
            ("2026-01-02", "one", 1.0, 0),
            ("2026-01-01", "one", 0.25, 1),
        ] {
            assert_eq!(add_one(&path, night, case, deviation), Addition { replaced, cut_short: None });
        }
        let history = History::read(&path).unwrap();
        assert_eq!(history.nights, ["2026-01-01", "2026-01-02"]);
        assert_eq!(history.series.len(), 2);
        assert_eq!(history.series[0].deviation, [0.25, 1.0]);
        assert!(history.series[1].deviation[0] == 0.5 && history.series[1].deviation[1].is_nan());
    }

    #[test]
    fn a_line_cut_short_by_a_crash_is_reported_and_dropped_when_the_next_night_is_added() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("history.jsonl");
        add_one(&path, "2026-01-01", "one", 2.0);
        let whole = fs::read_to_string(&path).unwrap();
        fs::write(&path, format!("{whole}{}", &whole[..30])).unwrap();
        assert_eq!(History::read(&path).unwrap().cut_short, Some(2));
        assert_eq!(add_one(&path, "2026-01-02", "one", 2.0), Addition { replaced: 0, cut_short: Some(2) });
        let text = fs::read_to_string(&path).unwrap();
        assert_eq!(text.lines().count(), 2);
        assert!(text.starts_with(&whole));
    }

    #[test]
    fn a_line_that_was_edited_or_put_under_another_night_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("history.jsonl");
        add_one(&path, "2026-01-01", "one", 2.0);
        add_one(&path, "2026-01-02", "one", 2.0);
        let sound = fs::read_to_string(&path).unwrap();
        for (from, to, says) in [
            ("\"deviation\":[2.0]", "\"deviation\":[1.0]", "was edited"),
            ("\"key\":\"2026-01-02", "\"key\":\"2026-01-03", "is about `2026-01-03 one` where `2026-01-02 one`"),
            ("history line 4", "history line 5", "is a `luxproof history line 5`"),
        ] {
            let at = sound.rfind(from).unwrap();
            fs::write(&path, format!("{}{to}{}", &sound[..at], &sound[at + from.len()..])).unwrap();
            let error = History::read(&path).unwrap_err().to_string();
            assert!(error.contains("history.jsonl:2: the line") && error.contains(says), "{error}");
            assert!(error.contains("take the line out or restore the file"), "{error}");
        }
    }
}
