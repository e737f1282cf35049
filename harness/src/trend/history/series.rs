//! The history as series over nights: one a comparison that repeats from night to night.

use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::path::Path;

use rayon::prelude::*;

use super::file::whole_lines;
use super::line::{HistoryError, Line, Meters, Numbers, Subject};
use crate::judge::{Basis, Verdict};
use crate::record::{EngineName, MeterId, ProcedureId, ReadingKey};
use crate::system::files;

#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Key {
    pub reading: ReadingKey,
    pub model: String,
    pub meter: MeterId,
    pub basis: Option<Basis>,
    /// Formula, solver or paper of the reference.
    pub source: String,
}

/// One comparison over the nights; a night without it, or without a reading, is NaN.
#[derive(Clone, Debug)]
pub struct Series {
    pub key: Key,
    /// Reading minus reference, a night each, in the quantity's unit.
    pub deviation: Vec<f64>,
    /// Standard error of the reading, likewise; 0 where it has none.
    pub std_error: Vec<f64>,
    pub reference: Vec<f64>,
    pub verdicts: Vec<Option<Verdict>>,
}

#[derive(Clone, Debug, PartialEq, Eq)]
pub struct VersionChange {
    pub engine: EngineName,
    pub night: usize,
    pub from: String,
    pub to: String,
}

#[derive(Clone, Debug, Default)]
pub struct History {
    pub nights: Vec<String>,
    pub series: Vec<Series>,
    pub version_changes: Vec<VersionChange>,
    /// The last line, from 1, where it was cut short and left out.
    pub cut_short: Option<usize>,
}

impl History {
    pub fn read(path: &Path) -> Result<Self, HistoryError> {
        let bytes = files::read_kept(path)?;
        Self::parse(&bytes, path)
    }

    pub(super) fn parse(bytes: &[u8], path: &Path) -> Result<Self, HistoryError> {
        let (whole, cut_short) = whole_lines(bytes);
        let texts: Vec<(usize, &[u8])> = (1..).zip(whole.split(|b| *b == b'\n')).filter(|t| !t.1.is_empty()).collect();
        let read = |&(line, text): &(usize, _)| Line::parse(text).map_err(|what| (line, what));
        // Of several lines that are wrong the first is told.
        let lines: Vec<Result<_, _>> = texts.par_iter().map(read).collect();
        let lines: Result<Vec<Line<'_>>, _> = lines.into_iter().collect();
        let wrong = |(line, what)| HistoryError::Line { path: path.display().to_string(), line, what };
        Ok(Self { cut_short, ..Self::of(&lines.map_err(wrong)?) })
    }

    fn of(lines: &[Line<'_>]) -> Self {
        let dates: BTreeSet<&str> = lines.iter().map(|line| &*line.night).collect();
        let place_of: HashMap<&str, usize> = dates.iter().copied().zip(0..).collect();
        let mut series: Vec<Series> = vec![];
        let mut known: HashMap<Key, usize> = HashMap::new();
        // Most lines are of the meters of the night before.
        let mut repeated: HashMap<(Subject<'_>, &[Meters<'_>]), Vec<usize>> = HashMap::new();
        let mut versions: BTreeMap<(&str, usize), &str> = BTreeMap::new();
        for line in lines {
            let night = place_of[&*line.night];
            let mut place = |key: Key| {
                *known.entry(key).or_insert_with_key(|key| {
                    series.push(Series::without_readings(key.clone(), dates.len()));
                    series.len() - 1
                })
            };
            let same = repeated.entry((line.subject(), &line.meters[..]));
            for (k, place) in same.or_insert_with(|| keys(line).map(&mut place).collect()).iter().enumerate() {
                series[*place].set(night, line.numbers(k), line.verdict);
            }
            if !line.version.is_empty() {
                versions.insert((&line.engine, night), &line.version);
            }
        }
        series.sort_by(|a, b| a.key.cmp(&b.key));
        let nights = dates.into_iter().map(str::to_owned).collect();
        Self { nights, series, version_changes: version_changes(&versions), cut_short: None }
    }

    pub fn engines_and_procedures(&self) -> BTreeSet<(&EngineName, ProcedureId)> {
        self.series.iter().map(|s| (&s.key.reading.engine, s.key.reading.procedure)).collect()
    }

    pub(super) fn of_engine(&self, engine: &EngineName, procedure: ProcedureId) -> Vec<&Series> {
        let is_of = |s: &&Series| s.key.reading.engine == *engine && s.key.reading.procedure == procedure;
        self.series.iter().filter(is_of).collect()
    }
}

fn keys<'l>(line: &'l Line<'_>) -> impl Iterator<Item = Key> + 'l {
    let (case, procedure, engine, model, basis, source) = line.subject();
    let reading = ReadingKey::new(case, procedure, engine);
    let key = move |meter| {
        let (model, source) = (model.to_owned(), source.to_owned());
        Key { reading: reading.clone(), model, meter, basis, source }
    };
    line.meters.iter().flat_map(Meters::ids).map(key)
}

impl Series {
    fn without_readings(key: Key, nights: usize) -> Self {
        let [deviation, std_error, reference] = [(); 3].map(|()| vec![f64::NAN; nights]);
        Self { key, deviation, std_error, reference, verdicts: vec![None; nights] }
    }

    fn set(&mut self, night: usize, numbers: Numbers, verdict: Verdict) {
        self.deviation[night] = numbers.deviation;
        self.std_error[night] = if numbers.std_error.is_nan() { 0.0 } else { numbers.std_error };
        self.reference[night] = numbers.reference;
        self.verdicts[night] = Some(verdict);
    }
}

/// From versions by engine and night; a night on which an engine failed has none.
fn version_changes(versions: &BTreeMap<(&str, usize), &str>) -> Vec<VersionChange> {
    let known: Vec<_> = versions.iter().collect();
    let change = |pair: &[(&(&str, usize), &&str)]| {
        let [((of, _), from), ((engine, night), to)] = *pair else { return None };
        let (from, to) = ((*from).to_owned(), (*to).to_owned());
        (of == engine && from != to).then(|| VersionChange { engine: (*engine).into(), night: *night, from, to })
    };
    known.windows(2).filter_map(change).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trend::history::synthetic::Synthetic;

    fn parse(text: &str) -> Result<History, HistoryError> {
        History::parse(text.as_bytes(), Path::new("history.jsonl"))
    }

    #[test]
    fn every_value_of_a_history_is_where_its_line_says() {
        let made = Synthetic { nights: 12, cases: 3, meters: 4, ..Synthetic::default() };
        let (text, truth) = (made.text(), made.history());
        let read = parse(&text).unwrap();
        assert_eq!((read.nights.len(), text.lines().count()), (12, 12 * truth.series.len() / 4));
        assert_eq!((&read.nights, read.series.len()), (&truth.nights, truth.series.len()));
        for series in &truth.series {
            let mine = read.series.iter().find(|s| s.key == series.key).unwrap();
            assert_eq!((&mine.deviation, &mine.std_error), (&series.deviation, &series.std_error));
            assert_eq!((&mine.reference, &mine.verdicts), (&series.reference, &series.verdicts));
        }
        assert!(read.series.is_sorted_by_key(|s| &s.key));
    }

    fn of_format_1(night: &str, meter: usize, deviation: &str) -> String {
        format!(
            r#"{{"night":"{night}","case":"suite/case-0","procedure":"direct_illuminance","engine":"iesna","version":"1.0","model":"point","meter":"workplane[{meter}]","quantity":"illuminance_lx","basis":"exact","source":"exact indirect light by radiosity, all bounces","value":1,"std_error":null,"reference":1,"deviation":{deviation},"u":1,"verdict":"pass"}}"#
        ) + "\n"
    }

    #[test]
    fn nights_are_sorted_absent_readings_are_no_numbers_and_the_last_line_of_a_night_counts() {
        let text = of_format_1("2026-01-02", 0, "0.5")
            + &of_format_1("2026-01-01", 0, "null")
            + &of_format_1("2026-01-02", 0, "0.25")
            + "{\"night\":";
        let history = parse(&text).unwrap();
        assert_eq!(history.cut_short, Some(4));
        assert_eq!(history.nights, ["2026-01-01", "2026-01-02"]);
        assert_eq!(history.series.len(), 1);
        assert!(history.series[0].deviation[0].is_nan());
        assert_eq!((history.series[0].deviation[1], history.series[0].std_error[1]), (0.25, 0.0));
    }

    #[test]
    fn nights_of_both_formats_are_one_series() {
        let new = Synthetic { nights: 2, cases: 1, meters: 2, ..Synthetic::default() }.text();
        let old = of_format_1("2025-12-31", 0, "0.5") + &of_format_1("2025-12-31", 1, "0.25");
        let (new, both) = (parse(&new).unwrap(), parse(&(old + &new)).unwrap());
        assert_eq!((both.nights.len(), both.series.len()), (3, new.series.len()));
        let of_both = |history| History::of_engine(history, &"iesna".into(), ProcedureId::DirectIlluminance);
        for ((one, new), deviation) in of_both(&both).into_iter().zip(of_both(&new)).zip([0.5, 0.25]) {
            assert_eq!(one.key, new.key);
            assert_eq!((one.deviation[0], &one.deviation[1..]), (deviation, &new.deviation[..]));
        }
    }

    #[test]
    fn the_first_line_that_is_wrong_is_named() {
        let text = Synthetic { nights: 2, cases: 1, meters: 2, ..Synthetic::default() }.text();
        let count = text.lines().count();
        let error = parse(&format!("{text}{{}}\n{text}nonsense\n")).unwrap_err().to_string();
        assert!(error.starts_with(&format!("history.jsonl:{}: the line is cut short", count + 1)), "{error}");
        let cut = parse(&format!("{}\n{text}", &text[..200])).unwrap_err().to_string();
        assert!(cut.starts_with("history.jsonl:1: the line is cut short"), "{cut}");
    }

    #[test]
    fn a_new_version_is_placed_at_its_first_night() {
        let text = Synthetic { nights: 6, cases: 1, meters: 2, new_version: Some(4), ..Synthetic::default() }.text();
        let (engine, from, to) = ("mitsuba".into(), "1.0".to_owned(), "1.1".to_owned());
        assert_eq!(parse(&text).unwrap().version_changes, [VersionChange { engine, night: 4, from, to }]);
    }
}
