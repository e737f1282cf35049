//! The history as series over nights: one a comparison that repeats from night to night.
//!
//! A year of 2000 comparisons a night is some 200 MB of lines. They are read by as many threads as there are cores, each a
//! part of the file; only what trends need is taken from a line, and what a line only repeats is not parsed again (`repeat.rs`).

use std::borrow::Cow;
use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::fs;
use std::path::Path;

use serde::Deserialize;

use super::entry::HistoryError;
use super::repeat::{Head, Numbers};
use crate::judge::{Basis, Verdict};
use crate::system::process;

/// What tells one comparison from another within a night.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Key {
    pub engine: String,
    pub procedure: String,
    pub case: String,
    /// The luminaire model.
    pub model: String,
    pub meter: String,
    /// What the reference rests on.
    pub basis: Option<Basis>,
    /// Formula, solver or paper of the reference.
    pub source: String,
}

/// One comparison over the nights; a night without it, or without a reading, is NaN.
#[derive(Clone, Debug)]
pub struct Series {
    /// Which.
    pub key: Key,
    /// Reading minus reference, a night each, in the quantity's unit.
    pub deviation: Vec<f64>,
    /// Standard error of the reading, likewise; 0 where it has none.
    pub std_error: Vec<f64>,
    pub reference: Vec<f64>,
    /// The verdicts; none on a night without the comparison.
    pub verdicts: Vec<Option<Verdict>>,
}

/// An engine's version differs from that of the night before.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct VersionChange {
    pub engine: String,
    /// The first night of the new version.
    pub night: usize,
    /// The version before.
    pub from: String,
    /// The version since.
    pub to: String,
}

/// All nights.
#[derive(Clone, Debug, Default)]
pub struct History {
    /// The nights, by date.
    pub nights: Vec<String>,
    /// The series, by key.
    pub series: Vec<Series>,
    /// Where engines changed their version.
    pub version_changes: Vec<VersionChange>,
    /// Whether the last line was cut short and left out.
    pub is_cut_short: bool,
}

impl History {
    /// Reads a history.
    pub fn read(path: &Path) -> Result<Self, HistoryError> {
        let bytes = fs::read(path).map_err(|e| HistoryError::file(path, e))?;
        Self::parse(&bytes, process::cores(), path)
    }

    /// Reads a history's text with some threads; `path` is for messages.
    pub(super) fn parse(bytes: &[u8], threads: usize, path: &Path) -> Result<Self, HistoryError> {
        let whole = bytes.iter().rposition(|b| *b == b'\n').map_or(0, |end| end + 1);
        let parts = parts(&bytes[..whole], threads);
        let read: Vec<Result<Part<'_>, (usize, String)>> = std::thread::scope(|scope| {
            let started: Vec<_> = parts.iter().map(|part| scope.spawn(|| Part::read(part))).collect();
            let lost = |_| Err((0, "the thread that read it gave up".to_owned()));
            started.into_iter().map(|thread| thread.join().unwrap_or_else(lost)).collect()
        });
        let mut found = vec![];
        for (k, read) in read.into_iter().enumerate() {
            // Lines are counted only where one is wrong.
            let before = || parts[..k].iter().map(|part| lines(part).count()).sum::<usize>();
            let path = || path.display().to_string();
            found.push(read.map_err(|(line, what)| HistoryError::Line {
                path: path(),
                line: before() + line,
                what,
            })?);
        }
        Ok(Self { is_cut_short: whole < bytes.len(), ..Self::joined(&found) })
    }

    fn joined(parts: &[Part<'_>]) -> Self {
        let nights: BTreeSet<&str> = parts.iter().flat_map(|p| p.nights.iter().map(AsRef::as_ref)).collect();
        let nights: Vec<String> = nights.into_iter().map(str::to_owned).collect();
        let night_of = |name: &str| nights.binary_search_by(|n| n.as_str().cmp(name)).unwrap_or_default();
        let keys: BTreeSet<Key> = parts.iter().flat_map(|p| p.keys.iter().map(RawKey::key)).collect();
        let place: BTreeMap<Key, usize> = keys.into_iter().enumerate().map(|(k, key)| (key, k)).collect();
        let nothing = vec![f64::NAN; nights.len()];
        let empty = |key: &Key| Series {
            key: key.clone(),
            deviation: nothing.clone(),
            std_error: nothing.clone(),
            reference: nothing.clone(),
            verdicts: vec![None; nights.len()],
        };
        let mut series: Vec<Series> = place.keys().map(empty).collect();
        let mut versions: BTreeMap<(String, usize), String> = BTreeMap::new();
        for part in parts {
            let night_of: Vec<usize> = part.nights.iter().map(|n| night_of(n)).collect();
            let series_of: Vec<usize> = part.keys.iter().map(|k| place[&k.key()]).collect();
            for point in &part.points {
                let (one, night) = (&mut series[series_of[point.key]], night_of[point.night]);
                one.deviation[night] = point.numbers.deviation;
                one.std_error[night] = point.numbers.std_error;
                one.reference[night] = point.numbers.reference;
                one.verdicts[night] = Some(point.numbers.verdict);
            }
            for (engine, night, version) in &part.versions {
                versions.insert((engine.clone(), night_of[*night]), version.clone());
            }
        }
        Self { nights, series, version_changes: version_changes(&versions), is_cut_short: false }
    }

    /// The engines with their procedures.
    pub fn engines_and_procedures(&self) -> BTreeSet<(&str, &str)> {
        self.series.iter().map(|s| (s.key.engine.as_str(), s.key.procedure.as_str())).collect()
    }
}

/// Versions by engine and night; a night on which an engine failed has none.
fn version_changes(versions: &BTreeMap<(String, usize), String>) -> Vec<VersionChange> {
    let mut changes = vec![];
    let mut last: Option<(&str, &str)> = None;
    for ((engine, night), version) in versions.iter().filter(|(_, version)| !version.is_empty()) {
        if let Some((of, from)) = last
            && of == engine
            && from != version
        {
            let (engine, from, to) = (engine.clone(), from.to_owned(), version.clone());
            changes.push(VersionChange { engine, night: *night, from, to });
        }
        last = Some((engine, version));
    }
    changes
}

/// Splits a text into about equal parts at line ends.
fn parts(bytes: &[u8], count: usize) -> Vec<&[u8]> {
    let mut parts = vec![];
    let mut rest = bytes;
    for left in (1..=count.max(1)).rev() {
        let from = rest.len() / left;
        let end = rest[from..].iter().position(|b| *b == b'\n').map_or(rest.len(), |k| from + k + 1);
        let (part, after) = rest.split_at(if left == 1 { rest.len() } else { end });
        parts.push(part);
        rest = after;
    }
    parts
}

/// The lines of a text.
fn lines(mut rest: &[u8]) -> impl Iterator<Item = &[u8]> {
    std::iter::from_fn(move || {
        let end = memchr::memchr(b'\n', rest).unwrap_or(rest.len());
        let line = (!rest.is_empty()).then(|| &rest[..end]);
        rest = rest.get(end + 1..).unwrap_or_default();
        line
    })
}

/// What is taken from a line. The text is borrowed from the file unless it holds escapes.
#[derive(Deserialize)]
struct Row<'a> {
    #[serde(borrow)]
    night: Cow<'a, str>,
    #[serde(borrow)]
    engine: Cow<'a, str>,
    #[serde(borrow)]
    procedure: Cow<'a, str>,
    #[serde(borrow)]
    case: Cow<'a, str>,
    #[serde(borrow)]
    model: Cow<'a, str>,
    #[serde(borrow)]
    meter: Cow<'a, str>,
    basis: Option<Basis>,
    #[serde(borrow)]
    source: Cow<'a, str>,
    #[serde(borrow)]
    version: Cow<'a, str>,
    deviation: Option<f64>,
    std_error: Option<f64>,
    reference: Option<f64>,
    verdict: Verdict,
}

/// A key whose text still lies in the file.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
struct RawKey<'a> {
    engine: Cow<'a, str>,
    procedure: Cow<'a, str>,
    case: Cow<'a, str>,
    model: Cow<'a, str>,
    meter: Cow<'a, str>,
    basis: Option<Basis>,
    source: Cow<'a, str>,
}

impl RawKey<'_> {
    fn key(&self) -> Key {
        Key {
            engine: self.engine.clone().into_owned(),
            procedure: self.procedure.clone().into_owned(),
            case: self.case.clone().into_owned(),
            model: self.model.clone().into_owned(),
            meter: self.meter.clone().into_owned(),
            basis: self.basis,
            source: self.source.clone().into_owned(),
        }
    }
}

/// One comparison of one night, by places in the lists of its part.
struct Point {
    key: usize,
    night: usize,
    numbers: Numbers,
}

/// A part of the file, read by one thread.
#[derive(Default)]
struct Part<'a> {
    nights: Vec<Cow<'a, str>>,
    keys: Vec<RawKey<'a>>,
    /// Engine, night and version, wherever that differs from the line before.
    versions: Vec<(String, usize, String)>,
    points: Vec<Point>,
}

impl<'a> Part<'a> {
    /// Reads the lines of a part; the error names the line, from 1.
    fn read(bytes: &'a [u8]) -> Result<Self, (usize, String)> {
        let mut part = Self::default();
        let mut known: HashMap<RawKey<'a>, usize> = HashMap::new();
        // Nights repeat the order of the night before: the key that follows is the one that followed then.
        let mut follower: Vec<usize> = vec![];
        let mut heads: Vec<Option<Head<'a>>> = vec![];
        let mut before = 0;
        for (k, line) in lines(bytes).enumerate().filter(|(_, line)| !line.is_empty()) {
            let guess = follower.get(before).copied().filter(|g| *g < part.keys.len());
            if let Some((key, night)) = guess.zip(part.nights.len().checked_sub(1))
                && let Some(head) = &heads[key]
                && let Some(numbers) = head.numbers(line, &part.nights[night])
            {
                part.version(night, &head.engine, &head.version);
                part.points.push(Point { key, night, numbers });
                before = key;
                continue;
            }
            let row: Row<'a> = serde_json::from_slice(line).map_err(|e| (k + 1, e.to_string()))?;
            let numbers = row.numbers();
            let head = Head::of(line, &row.night, row.engine.clone(), row.version.clone());
            if part.nights.last() != Some(&row.night) {
                part.nights.push(row.night);
            }
            let night = part.nights.len() - 1;
            part.version(night, &row.engine, &row.version);
            let Row { engine, procedure, case, model, meter, basis, source, .. } = row;
            let raw = RawKey { engine, procedure, case, model, meter, basis, source };
            let key = *known.entry(raw).or_insert_with_key(|raw| {
                part.keys.push(raw.clone());
                part.keys.len() - 1
            });
            follower.resize(part.keys.len(), usize::MAX);
            heads.resize_with(part.keys.len(), || None);
            (follower[before], heads[key]) = (key, head);
            before = key;
            part.points.push(Point { key, night, numbers });
        }
        Ok(part)
    }

    /// Keeps the version of an engine on a night, unless the line before told it.
    fn version(&mut self, night: usize, engine: &str, version: &str) {
        if self.versions.last().is_none_or(|(e, n, v)| (e.as_str(), *n, v.as_str()) != (engine, night, version)) {
            self.versions.push((engine.to_owned(), night, version.to_owned()));
        }
    }
}

impl Row<'_> {
    fn numbers(&self) -> Numbers {
        Numbers {
            deviation: self.deviation.unwrap_or(f64::NAN),
            std_error: self.std_error.unwrap_or(0.0),
            reference: self.reference.unwrap_or(f64::NAN),
            verdict: self.verdict,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trend::history::synthetic::Synthetic;

    fn parse(text: &str, threads: usize) -> Result<History, HistoryError> {
        History::parse(text.as_bytes(), threads, Path::new("history.jsonl"))
    }

    #[test]
    fn a_history_read_in_parts_is_the_one_read_at_once() {
        let text = Synthetic { nights: 12, cases: 3, meters: 4, ..Synthetic::default() }.text();
        let one = parse(&text, 1).unwrap();
        assert_eq!(one.nights.len(), 12);
        assert_eq!(one.series.len(), text.lines().count() / 12);
        for threads in [2, 3, 7, 64] {
            let several = parse(&text, threads).unwrap();
            assert_eq!(several.nights, one.nights);
            assert!(several.series.iter().zip(&one.series).all(|(a, b)| a.key == b.key && a.deviation == b.deviation));
        }
        // Every value is where its line says.
        for line in text.lines() {
            let entry: super::super::Entry<'_> = serde_json::from_str(line).unwrap();
            let night = one.nights.iter().position(|n| *n == entry.night).unwrap();
            let mine = |s: &&Series| {
                (s.key.engine.as_str(), s.key.procedure.as_str()) == (&*entry.engine, &*entry.procedure)
                    && (s.key.case.as_str(), s.key.meter.as_str()) == (&*entry.case, &*entry.meter)
            };
            assert_eq!(Some(one.series.iter().find(mine).unwrap().deviation[night]), entry.deviation);
        }
    }

    #[test]
    fn nights_are_sorted_absent_readings_are_no_numbers_and_the_last_line_of_a_night_counts() {
        let line = |night: &str, deviation: &str| {
            format!(
                r#"{{"night":"{night}","case":"a\"b","procedure":"p","engine":"e","version":"1","model":"point","meter":"m[0]","quantity":"illuminance_lx","basis":"exact","source":"","value":1,"std_error":null,"reference":1,"deviation":{deviation},"u":1,"verdict":"pass"}}"#
            ) + "\n"
        };
        let text =
            line("2026-01-02", "0.5") + &line("2026-01-01", "null") + &line("2026-01-02", "0.25") + "{\"night\":";
        let history = parse(&text, 1).unwrap();
        assert!(history.is_cut_short);
        assert_eq!(history.nights, ["2026-01-01", "2026-01-02"]);
        assert_eq!((history.series.len(), history.series[0].key.case.as_str()), (1, "a\"b"));
        assert!(history.series[0].deviation[0].is_nan());
        assert_eq!(history.series[0].deviation[1], 0.25);
    }

    #[test]
    fn a_line_that_is_no_entry_is_named() {
        let text = Synthetic { nights: 2, cases: 1, meters: 2, ..Synthetic::default() }.text();
        let count = text.lines().count();
        let error = parse(&format!("{text}{{}}\n{text}"), 3).unwrap_err().to_string();
        assert!(error.starts_with(&format!("history.jsonl:{}: missing field", count + 1)), "{error}");
    }

    #[test]
    fn a_new_version_is_placed_at_its_first_night() {
        let text = Synthetic { nights: 6, cases: 1, meters: 2, new_version: Some(4), ..Synthetic::default() }.text();
        let history = parse(&text, 2).unwrap();
        let changes: Vec<_> = history.version_changes.iter().map(|c| (c.engine.as_str(), c.night)).collect();
        assert_eq!(changes, [("mitsuba", 4)]);
        assert_eq!((history.version_changes[0].from.as_str(), history.version_changes[0].to.as_str()), ("1.0", "1.1"));
    }
}
