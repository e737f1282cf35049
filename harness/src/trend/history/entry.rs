//! One line of the history: what one comparison of one night said; and how lines come into the file.

use std::borrow::Cow;
use std::collections::BTreeSet;
use std::fs;
use std::io::Write;
use std::path::Path;

use serde::{Deserialize, Serialize};

use crate::judge::{Basis, Verdict};
use crate::record::Quantity;
use crate::report::Report;
use crate::system::files;

/// What one comparison of one night said. Numbers are rounded to what they are worth: a year of nights stays readable.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Entry<'a> {
    /// The night, as a date: YYYY-MM-DD.
    pub night: Cow<'a, str>,
    pub case: Cow<'a, str>,
    pub procedure: Cow<'a, str>,
    pub engine: Cow<'a, str>,
    /// The engine's version.
    pub version: Cow<'a, str>,
    /// The luminaire model.
    pub model: Cow<'a, str>,
    pub meter: Cow<'a, str>,
    pub quantity: Quantity,
    /// What the reference rests on; null without a reference.
    pub basis: Option<Basis>,
    /// Formula, solver or paper of the reference.
    pub source: Cow<'a, str>,
    /// The reading, in the quantity's unit; null where it is missing.
    pub value: Option<f64>,
    /// Its standard error: what repeats differently from night to night.
    pub std_error: Option<f64>,
    pub reference: Option<f64>,
    /// Reading minus reference.
    pub deviation: Option<f64>,
    /// Combined standard uncertainty of the deviation: reading, instrument, reference.
    pub u: Option<f64>,
    /// What followed.
    pub verdict: Verdict,
}

/// Why a history cannot be read or written.
#[derive(Debug, thiserror::Error)]
pub enum HistoryError {
    /// The file system refuses.
    #[error("{path}: {source}")]
    File {
        /// The file or folder.
        path: String,
        source: std::io::Error,
    },
    /// A line is no entry.
    #[error("{path}:{line}: {what}; take the line out or restore the file")]
    Line {
        /// The history.
        path: String,
        /// The line, from 1.
        line: usize,
        what: String,
    },
    /// A night is no date.
    #[error("`{night}` is no date; give the night as YYYY-MM-DD")]
    Night {
        /// What was given.
        night: String,
    },
}

impl HistoryError {
    pub(super) fn file(path: &Path, source: std::io::Error) -> Self {
        Self::File { path: path.display().to_string(), source }
    }
}

/// The lines of a report, for the night of its start or for the one given.
pub fn entries<'a>(report: &'a Report, night: Option<&'a str>) -> Result<Vec<Entry<'a>>, HistoryError> {
    let night = night.or_else(|| report.started.get(..10)).unwrap_or_default();
    if !is_date(night) {
        return Err(HistoryError::Night { night: night.to_owned() });
    }
    let entry = |c: &'a crate::judge::Comparison| {
        let of_it = |r: &&crate::record::Recording| {
            r.key.case == c.key.case
                && r.key.procedure == c.key.procedure
                && r.key.engine == c.key.engine
                && r.model == c.model
        };
        let recording = report.recordings.iter().find(of_it);
        let reference = c.reference.as_ref();
        let instrument = recording.map_or(0.0, |r| r.instrument_uncertainty) * c.value.unwrap_or(0.0);
        let u = reference.map(|r| c.uncertainty.standard_error().unwrap_or(0.0).hypot(instrument).hypot(r.uncertainty));
        Entry {
            night: night.into(),
            case: c.key.case.as_str().into(),
            procedure: c.key.procedure.name().into(),
            engine: c.key.engine.as_str().into(),
            version: recording.map_or("", |r| r.version.as_str()).into(),
            model: c.model.as_str().into(),
            meter: c.meter.0.as_str().into(),
            quantity: c.quantity,
            basis: reference.map(|r| r.basis),
            source: reference.map_or("", |r| r.source.as_str()).into(),
            value: rounded(c.value, 9),
            std_error: rounded(c.uncertainty.standard_error(), 4),
            reference: rounded(reference.map(|r| r.value), 9),
            deviation: rounded(c.deviation, 6),
            u: rounded(u, 4),
            verdict: c.verdict,
        }
    };
    Ok(report.comparisons.iter().map(entry).collect())
}

/// Whether a text is a date of the form that sorts by time.
fn is_date(text: &str) -> bool {
    let shape = text.len() == 10 && text.bytes().enumerate().all(|(k, b)| (b == b'-') == (k == 4 || k == 7));
    shape && humantime::parse_rfc3339_weak(&format!("{text} 00:00:00")).is_ok()
}

/// Rounds to significant digits; what is no finite number is none.
fn rounded(value: Option<f64>, digits: usize) -> Option<f64> {
    value.filter(|v| v.is_finite()).and_then(|v| format!("{v:.*e}", digits - 1).parse().ok())
}

/// Adds entries to a history, which is made if there is none; how many lines it took the place of.
///
/// A night that is run again takes the place of its earlier lines, case by case, so that repeating a night is harmless. A
/// last line cut short by a crash is dropped. The file is appended to, or replaced as a whole: never half written.
pub fn add(path: &Path, entries: &[Entry<'_>]) -> Result<usize, HistoryError> {
    let fail = |e| HistoryError::file(path, e);
    let old = match fs::read(path) {
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => vec![],
        read => read.map_err(fail)?,
    };
    let mut new = vec![];
    for entry in entries {
        serde_json::to_writer(&mut new, entry).map_err(|e| fail(e.into()))?;
        new.push(b'\n');
    }
    let whole = old.iter().rposition(|b| *b == b'\n').map_or(0, |end| end + 1);
    let heads: BTreeSet<String> = entries.iter().map(head).collect();
    let stays = |line: &&[u8]| !heads.iter().any(|h| line.starts_with(h.as_bytes()));
    let lines = || old[..whole].split_inclusive(|b| *b == b'\n');
    let replaced = lines().filter(|line| !stays(line)).count();
    if replaced == 0 && whole == old.len() {
        let mut file = fs::OpenOptions::new().create(true).append(true).open(path).map_err(fail)?;
        file.write_all(&new).map_err(fail)?;
        return Ok(0);
    }
    let kept: Vec<u8> = lines().filter(stays).flatten().copied().chain(new).collect();
    files::replace(path, &kept).map_err(fail)?;
    Ok(replaced)
}

/// How every line of an entry's night and case begins, as we write it.
fn head(entry: &Entry<'_>) -> String {
    let text = |t: &str| serde_json::to_string(t).unwrap_or_default();
    format!("{{\"night\":{},\"case\":{},", text(&entry.night), text(&entry.case))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn entry(night: &'static str, case: &'static str, value: f64) -> Entry<'static> {
        Entry {
            night: night.into(),
            case: case.into(),
            procedure: "direct_illuminance".into(),
            engine: "radiance".into(),
            version: "6.0a".into(),
            model: "point".into(),
            meter: "ceiling[0]".into(),
            quantity: Quantity::Illuminance,
            basis: Some(Basis::Exact),
            source: "exact direct light".into(),
            value: Some(value),
            std_error: Some(0.01),
            reference: Some(2.0),
            deviation: Some(value - 2.0),
            u: Some(0.01),
            verdict: Verdict::Pass,
        }
    }

    #[test]
    fn a_night_run_again_takes_the_place_of_its_lines_and_of_no_others() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("history.jsonl");
        let (a, b) = (entry("2026-01-01", "one", 2.0), entry("2026-01-01", "one-more", 2.5));
        let c = entry("2026-01-02", "one", 3.0);
        assert_eq!(add(&path, &[a, b.clone()]).unwrap(), 0);
        assert_eq!(add(&path, std::slice::from_ref(&c)).unwrap(), 0);
        let again = entry("2026-01-01", "one", 2.25);
        assert_eq!(add(&path, std::slice::from_ref(&again)).unwrap(), 1);
        let text = fs::read_to_string(&path).unwrap();
        let read: Vec<Entry<'_>> = text.lines().map(|l| serde_json::from_str(l).unwrap()).collect();
        assert_eq!(read, [b, c, again]);
    }

    #[test]
    fn a_line_cut_short_by_a_crash_is_dropped_when_the_next_night_is_added() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("history.jsonl");
        add(&path, &[entry("2026-01-01", "one", 2.0)]).unwrap();
        let whole = fs::read_to_string(&path).unwrap();
        fs::write(&path, format!("{whole}{}", &whole[..30])).unwrap();
        add(&path, &[entry("2026-01-02", "one", 2.0)]).unwrap();
        let text = fs::read_to_string(&path).unwrap();
        assert_eq!(text.lines().count(), 2);
        assert!(text.starts_with(&whole));
    }

    #[test]
    fn nights_are_dates_and_numbers_keep_what_they_are_worth() {
        let good = ["2026-01-31", "2024-02-29"];
        let bad = ["", "2026-1-31", "2026-13-01", "20260131", "2026-01-31T", "tonight..."];
        assert!(good.iter().all(|n| is_date(n)) && !bad.iter().any(|n| is_date(n)));
        assert_eq!(rounded(Some(1.732_05), 4), Some(1.732));
        assert_eq!(rounded(Some(-1.23456789e-12), 3), Some(-1.23e-12));
        assert_eq!((rounded(Some(f64::NAN), 3), rounded(Some(0.0), 3), rounded(None, 3)), (None, Some(0.0), None));
    }
}
