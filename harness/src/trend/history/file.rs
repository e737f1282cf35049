//! The file of a history: how lines come into it.

use std::collections::BTreeSet;
use std::fs;
use std::io::Write;
use std::path::Path;

use super::line::{HistoryError, Line};
use crate::system::files::{self, FileError};

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Added {
    /// Lines of the same night and case.
    pub replaced: usize,
    /// The last line, from 1, where it was cut short.
    pub cut_short: Option<usize>,
}

/// Where the whole lines of a text end, and the number of a last one that is cut short.
pub(super) fn whole_lines(text: &[u8]) -> (&[u8], Option<usize>) {
    let (whole, rest) = text.split_at(text.iter().rposition(|b| *b == b'\n').map_or(0, |end| end + 1));
    (whole, (!rest.is_empty()).then(|| whole.split(|b| *b == b'\n').count()))
}

/// A history is made if there is none, appended to, or replaced as a whole: never half written. A night that is run again
/// takes the place of its earlier lines, case by case, so that repeating a night is harmless.
pub fn add(path: &Path, lines: &[Line<'_>]) -> Result<Added, HistoryError> {
    let fail = |source| FileError::of(path, source);
    let old = match files::read_kept(path) {
        Err(error) if error.source.kind() == std::io::ErrorKind::NotFound => vec![],
        read => read?,
    };
    let mut new = vec![];
    for line in lines {
        new.extend(line.text().map_err(|e| fail(e.into()))?.into_bytes());
        new.push(b'\n');
    }
    let (whole, cut_short) = whole_lines(&old);
    let heads: BTreeSet<String> = lines.iter().flat_map(Line::heads).collect();
    let stays = |line: &&[u8]| !heads.iter().any(|h| line.starts_with(h.as_bytes()));
    let before = || whole.split_inclusive(|b| *b == b'\n');
    let replaced = before().filter(|line| !stays(line)).count();
    let added = Added { replaced, cut_short };
    if added == Added::default() {
        let mut file = fs::OpenOptions::new().create(true).append(true).open(path).map_err(fail)?;
        file.write_all(&new).and_then(|()| file.sync_all()).map_err(fail)?;
        files::sweep(path.parent().unwrap_or(Path::new("")));
    } else {
        let kept: Vec<u8> = before().filter(stays).flatten().copied().chain(new).collect();
        files::replace_lastingly(path, &kept).map_err(fail)?;
    }
    Ok(added)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::judge::Verdict;
    use crate::record::{MeterId, ProcedureId, Quantity, ReadingKey};
    use crate::trend::history::{History, Numbers};

    fn add_one(path: &Path, night: &str, case: &str, deviation: f64) -> Added {
        let (key, meter) = (ReadingKey::new(case, ProcedureId::DirectIlluminance, "radiance"), MeterId::new("m", 0));
        let mut line = Line::new(night, &key, Quantity::Illuminance, Verdict::Pass);
        line.push(&meter, Numbers { reference: 2.0, deviation, std_error: 0.01, u: 0.01 });
        add(path, &[line]).unwrap()
    }

    #[test]
    fn a_night_run_again_takes_the_place_of_its_lines_and_of_no_others() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("history.jsonl");
        let old = r#"{"night":"2026-01-01","case":"one","meter":"of format 1"}"#.to_owned() + "\n";
        fs::write(&path, old).unwrap();
        for (night, case, deviation, replaced) in [
            ("2026-01-01", "one", 0.125, 1),
            ("2026-01-01", "one-more", 0.5, 0),
            ("2026-01-02", "one", 1.0, 0),
            ("2026-01-01", "one", 0.25, 1),
        ] {
            assert_eq!(add_one(&path, night, case, deviation), Added { replaced, cut_short: None });
        }
        let history = History::read(&path).unwrap();
        assert_eq!(history.nights, ["2026-01-01", "2026-01-02"]);
        assert_eq!(history.series.len(), 2);
        assert_eq!(history.series[0].deviation, [0.25, 1.0]);
        assert!(history.series[1].deviation[0] == 0.5 && history.series[1].deviation[1].is_nan());
    }

    #[test]
    fn a_line_cut_short_by_a_crash_is_told_and_dropped_when_the_next_night_is_added() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("history.jsonl");
        add_one(&path, "2026-01-01", "one", 2.0);
        let whole = fs::read_to_string(&path).unwrap();
        fs::write(&path, format!("{whole}{}", &whole[..30])).unwrap();
        assert_eq!(History::read(&path).unwrap().cut_short, Some(2));
        assert_eq!(add_one(&path, "2026-01-02", "one", 2.0), Added { replaced: 0, cut_short: Some(2) });
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
            ("history line 3", "history line 4", "is a `luxproof history line 4`"),
        ] {
            let at = sound.rfind(from).unwrap();
            fs::write(&path, format!("{}{to}{}", &sound[..at], &sound[at + from.len()..])).unwrap();
            let error = History::read(&path).unwrap_err().to_string();
            assert!(error.contains("history.jsonl:2: the line") && error.contains(says), "{error}");
            assert!(error.contains("take the line out or restore the file"), "{error}");
        }
    }
}
