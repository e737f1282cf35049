//! The history as series over nights, one for each comparison.

use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::path::Path;

use rayon::prelude::*;

use super::file::whole_lines;
use super::line::{HistoryError, Line, Meters, Numbers, Subject};
use luxproof_model::{Basis, Exit, Verdict};
use luxproof_model::{EngineName, MeterId, ProcedureId, ReadingKey};
use luxproof_process::files;

/// What identifies a series.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Key {
    pub reading: ReadingKey,
    pub model: String,
    pub meter: MeterId,
    pub basis: Option<Basis>,
    /// Formula, solver or paper of the reference.
    pub source: String,
}

/// One comparison over the nights; NaN on nights without a reading.
#[derive(Clone, Debug)]
pub struct Series {
    pub key: Key,
    /// Reading minus reference on each night, in the quantity's unit.
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
    /// The number of an incomplete last line, counted from 1, which was ignored.
    pub cut_short: Option<usize>,
}

impl History {
    pub fn read(path: &Path) -> Result<Self, HistoryError> {
        let bytes = files::read_stored(path)?;
        Self::parse(&bytes, path)
    }

    pub(super) fn parse(bytes: &[u8], path: &Path) -> Result<Self, HistoryError> {
        let (whole, cut_short) = whole_lines(bytes);
        let texts: Vec<(usize, &[u8])> = (1..).zip(whole.split(|b| *b == b'\n')).filter(|t| !t.1.is_empty()).collect();
        let parsed: Vec<Result<Line<'_>, HistoryError>> = texts
            .par_iter()
            .map(|(line, text)| {
                let path = path.display().to_string();
                Line::parse(text).map_err(|what| HistoryError::Line { path, line: *line, what })
            })
            .collect();
        // The first of several wrong lines is reported, whichever thread finds it.
        let lines: Vec<Line<'_>> = parsed.into_iter().collect::<Result<_, _>>()?;
        Ok(Self { cut_short, ..Self::from_lines(&lines) })
    }

    fn from_lines(lines: &[Line<'_>]) -> Self {
        let dates: BTreeSet<&str> = lines.iter().map(|line| &*line.night).collect();
        let place_of: HashMap<&str, usize> = dates.iter().copied().zip(0..).collect();
        let mut series: Vec<Series> = vec![];
        let mut known: HashMap<Key, usize> = HashMap::new();
        // Most lines repeat the meters of the night before, so their places are looked up once.
        let mut repeated: HashMap<(Subject<'_>, &[Meters<'_>]), Vec<usize>> = HashMap::new();
        let mut versions: BTreeMap<(&str, usize), &str> = BTreeMap::new();
        for line in lines {
            let night = place_of[&*line.night];
            let places = repeated.entry((line.subject(), &line.meters[..])).or_insert_with(|| {
                let mut places = vec![];
                for key in keys(line) {
                    places.push(*known.entry(key).or_insert_with_key(|key| {
                        series.push(Series::without_readings(key.clone(), dates.len()));
                        series.len() - 1
                    }));
                }
                places
            });
            for (k, place) in places.iter().enumerate() {
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

    /// The failed verdicts since a night, a line for each night, engine and procedure: `2026-01-02 mine direct_illuminance: 3 failed
    /// verdicts`.
    pub fn failures(&self, first: usize) -> Vec<String> {
        let mut counts: BTreeMap<(usize, &EngineName, ProcedureId), usize> = BTreeMap::new();
        for series in &self.series {
            let reading = &series.key.reading;
            let verdicts = series.verdicts.iter().enumerate().skip(first);
            for (night, _) in verdicts.filter(|(_, verdict)| verdict.is_some_and(|v| Exit::of(v) == Exit::Failed)) {
                *counts.entry((night, &reading.engine, reading.procedure)).or_default() += 1;
            }
        }
        let lines = counts.into_iter().map(|((night, engine, procedure), count)| {
            let noun = if count == 1 { "verdict" } else { "verdicts" };
            format!("{} {engine} {procedure}: {count} failed {noun}", self.nights[night])
        });
        lines.collect()
    }

    pub fn engines_and_procedures(&self) -> BTreeSet<(&EngineName, ProcedureId)> {
        self.series.iter().map(|s| (&s.key.reading.engine, s.key.reading.procedure)).collect()
    }

    pub(super) fn of_engine(&self, engine: &EngineName, procedure: ProcedureId) -> Vec<&Series> {
        let all = self.series.iter();
        all.filter(|s| s.key.reading.engine == *engine && s.key.reading.procedure == procedure).collect()
    }
}

/// The keys of the series that a line has a night of.
fn keys<'l>(line: &'l Line<'_>) -> impl Iterator<Item = Key> + 'l {
    let (case, procedure, engine, model, basis, source) = line.subject();
    let reading = ReadingKey::new(case, procedure, engine);
    line.meters.iter().flat_map(Meters::ids).map(move |meter| {
        let (model, source) = (model.to_owned(), source.to_owned());
        Key { reading: reading.clone(), model, meter, basis, source }
    })
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

/// Finds version changes in versions by engine and night; a night on which an engine failed has no version.
fn version_changes(versions: &BTreeMap<(&str, usize), &str>) -> Vec<VersionChange> {
    let mut changes = vec![];
    for (((earlier_engine, _), from), ((engine, night), to)) in versions.iter().zip(versions.iter().skip(1)) {
        if earlier_engine == engine && from != to {
            let (from, to) = ((*from).to_owned(), (*to).to_owned());
            changes.push(VersionChange { engine: (*engine).into(), night: *night, from, to });
        }
    }
    changes
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::history::synthetic::Synthetic;
    use luxproof_model::Quantity;

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

    /// The text of a line of one meter without a standard error.
    fn one_meter(night: &str, deviation: f64) -> String {
        let key = ReadingKey::new("suite/case-0", ProcedureId::DirectIlluminance, "iesna");
        let meter = MeterId::new("workplane", 0);
        let mut line = Line::new(night, &key, Quantity::Illuminance, Verdict::Pass);
        line.push(&meter, Numbers { reference: 1.0, deviation, std_error: f64::NAN, u: 1.0 });
        line.text().unwrap() + "\n"
    }

    #[test]
    fn nights_are_sorted_absent_readings_are_no_numbers_and_the_last_line_of_a_night_counts() {
        let text = one_meter("2026-01-02", 0.5)
            + &one_meter("2026-01-01", f64::NAN)
            + &one_meter("2026-01-02", 0.25)
            + "{\"schema\":";
        let history = parse(&text).unwrap();
        assert_eq!(history.cut_short, Some(4));
        assert_eq!(history.nights, ["2026-01-01", "2026-01-02"]);
        assert_eq!(history.series.len(), 1);
        assert!(history.series[0].deviation[0].is_nan());
        assert_eq!((history.series[0].deviation[1], history.series[0].std_error[1]), (0.25, 0.0));
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

    /// A history of three nights with these engines, procedures and verdicts.
    fn with_verdicts(all: &[(&str, ProcedureId, [Verdict; 3])]) -> History {
        let mut history = History { nights: ["n0", "n1", "n2"].map(str::to_owned).to_vec(), ..History::default() };
        for (engine, procedure, verdicts) in all {
            let mut series = crate::history::synthetic::series(100.0, &[1.0; 3], &[0.0; 3]);
            series.key.reading = ReadingKey::new("room", *procedure, *engine);
            series.verdicts = verdicts.map(Some).to_vec();
            history.series.push(series);
        }
        history
    }

    #[test]
    fn failures_are_counted_by_night_engine_and_procedure() {
        use ProcedureId::{DirectIlluminance, TotalIlluminance};
        use Verdict::{Fail, KnownDeviation, Missing, Pass, Undecided, UnexpectedPass};
        let mut history = with_verdicts(&[
            ("mine", DirectIlluminance, [Fail, Fail, Pass]),
            ("mine", DirectIlluminance, [Fail, Missing, KnownDeviation]),
            ("mine", DirectIlluminance, [Pass, UnexpectedPass, Undecided]),
            ("mine", TotalIlluminance, [Pass, Pass, Fail]),
            ("other", DirectIlluminance, [Pass, Fail, Fail]),
        ]);
        let expected = [
            "n1 mine direct_illuminance: 3 failed verdicts",
            "n1 other direct_illuminance: 1 failed verdict",
            "n2 mine total_illuminance: 1 failed verdict",
            "n2 other direct_illuminance: 1 failed verdict",
        ];
        let mut found = history.failures(1);
        found.sort();
        assert_eq!(found, expected);
        assert_eq!(history.failures(0).len(), 5);
        assert!(history.failures(3).is_empty());
        history.series.iter_mut().for_each(|series| series.verdicts[2] = None);
        assert!(history.failures(2).is_empty());
    }

    #[test]
    fn series_are_found_by_engine_and_procedure() {
        use ProcedureId::{DirectIlluminance, TotalIlluminance};
        let passed = [Verdict::Pass; 3];
        let history = with_verdicts(&[
            ("other", DirectIlluminance, passed),
            ("mine", TotalIlluminance, passed),
            ("mine", DirectIlluminance, passed),
            ("mine", DirectIlluminance, passed),
        ]);
        let (mine, other) = (EngineName::from("mine"), EngineName::from("other"));
        for (engine, procedure, count) in [
            (&mine, DirectIlluminance, 2),
            (&mine, TotalIlluminance, 1),
            (&other, DirectIlluminance, 1),
            (&other, TotalIlluminance, 0),
        ] {
            let found = history.of_engine(engine, procedure);
            assert_eq!(found.len(), count, "{engine} {procedure}");
            assert!(found.iter().all(|s| s.key.reading.engine == *engine && s.key.reading.procedure == procedure));
        }
        let all: Vec<_> = history.engines_and_procedures().into_iter().collect();
        assert_eq!(all.len(), 3);
        assert!(all.contains(&(&mine, TotalIlluminance)) && all.contains(&(&other, DirectIlluminance)));
    }

    #[test]
    fn versions_change_within_an_engine_alone() {
        let versions: BTreeMap<(&str, usize), &str> =
            [(("a", 0), "1"), (("a", 3), "1"), (("a", 5), "2"), (("b", 2), "3"), (("b", 6), "4")].into();
        let found = version_changes(&versions);
        let found: Vec<_> = found.iter().map(|c| (c.engine.to_string(), c.night, &*c.from, &*c.to)).collect();
        assert_eq!(found, [("a".to_owned(), 5, "1", "2"), ("b".to_owned(), 6, "3", "4")]);
    }
}
