//! One line of the history: what an engine said in one procedure of one case on one night, the numbers of its meters as lists.
//!
//! A line stands by itself, so that lines can be taken out, reordered, or merged from two histories. All that it says in words
//! holds for all of its meters; comparisons with another verdict or reference have a line of their own. A line lies in an envelope,
//! so that one that was edited is found out. Lines of formats 1 and 2, written until November 2026, have none; one of format 1 is
//! of a single meter with numbers in place of lists.

use std::borrow::Cow;
use std::fmt;

use serde::de::{SeqAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize};

use crate::judge::{Basis, Comparison, Verdict};
use crate::record::{MeterId, ProcedureId, Quantity, ReadingKey};
use crate::report::Report;
use crate::report::words::rounded;
use crate::system::day::Day;
use crate::system::envelope::{self, Schema};
use crate::system::files::FileError;

const SCHEMA: Schema = Schema { of: "history line", version: 3 };

/// The last format of lines without an envelope.
const LAST_BARE: u32 = 2;

/// What an engine said in one procedure of one case on one night. Lists hold NaN, null in the file, where there is no number.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Line<'a> {
    #[serde(borrow)]
    pub(super) night: Cow<'a, str>,
    #[serde(borrow)]
    case: Cow<'a, str>,
    /// Of a line without an envelope.
    #[serde(default = "last_bare", skip_serializing)]
    format: u32,
    pub procedure: ProcedureId,
    #[serde(borrow)]
    pub engine: Cow<'a, str>,
    #[serde(borrow)]
    pub version: Cow<'a, str>,
    #[serde(borrow)]
    pub model: Cow<'a, str>,
    pub quantity: Quantity,
    /// What the reference rests on; null without a reference.
    pub basis: Option<Basis>,
    /// Formula, solver or paper of the reference.
    #[serde(borrow)]
    pub source: Cow<'a, str>,
    pub verdict: Verdict,
    #[serde(borrow, default)]
    pub(super) meters: Vec<Meters<'a>>,
    /// Of format 1.
    #[serde(borrow, default, skip_serializing)]
    meter: Option<Cow<'a, str>>,
    #[serde(default, deserialize_with = "numbers", skip_serializing_if = "is_void")]
    reference: Vec<f64>,
    #[serde(default, deserialize_with = "numbers")]
    deviation: Vec<f64>,
    #[serde(default, deserialize_with = "numbers", skip_serializing_if = "is_void")]
    std_error: Vec<f64>,
    #[serde(default, deserialize_with = "numbers", skip_serializing_if = "is_void")]
    u: Vec<f64>,
}

#[derive(Debug, thiserror::Error)]
pub enum HistoryError {
    #[error(transparent)]
    File(#[from] FileError),
    #[error("{path}:{line}: {what}; take the line out or restore the file")]
    Line { path: String, line: usize, what: String },
    #[error("`{night}` is no date; give the night as YYYY-MM-DD")]
    Night { night: String },
}

#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(untagged)]
pub(super) enum Meters<'a> {
    /// `set[first]` to `set[last]`.
    Run(#[serde(borrow)] Cow<'a, str>, usize, usize),
    One(#[serde(borrow)] Cow<'a, str>),
}

/// The numbers of one meter, in the quantity's unit; NaN where there is none.
#[derive(Clone, Copy, Debug)]
pub struct Numbers {
    pub reference: f64,
    /// The reading is the reference plus this.
    pub deviation: f64,
    /// Of the reading: what repeats differently from night to night.
    pub std_error: f64,
    /// Combined standard uncertainty of the deviation: reading and reference.
    pub u: f64,
}

/// What series are told apart by, save their meters.
pub(super) type Subject<'l> = (&'l str, ProcedureId, &'l str, &'l str, Option<Basis>, &'l str);

impl<'a> Line<'a> {
    pub fn new(night: &'a str, key: &'a ReadingKey, quantity: Quantity, verdict: Verdict) -> Self {
        Self {
            night: night.into(),
            case: key.case.as_str().into(),
            format: LAST_BARE,
            procedure: key.procedure,
            engine: key.engine.as_str().into(),
            version: "".into(),
            model: "".into(),
            quantity,
            basis: None,
            source: "".into(),
            verdict,
            meters: vec![],
            meter: None,
            reference: vec![],
            deviation: vec![],
            std_error: vec![],
            u: vec![],
        }
    }

    pub fn push(&mut self, meter: &'a MeterId, numbers: Numbers) {
        let id = meter.0.as_str();
        let place = id.strip_suffix(']').and_then(|id| id.rsplit_once('['));
        let place = place.and_then(|(set, k)| Some((set, k.parse::<usize>().ok()?)));
        match (place.filter(|(set, k)| MeterId::new(set, *k) == *meter), self.meters.last_mut()) {
            (Some((set, k)), Some(Meters::Run(of, _, last))) if of == set && last.checked_add(1) == Some(k) => {
                *last = k;
            }
            (Some((set, k)), _) => self.meters.push(Meters::Run(set.into(), k, k)),
            (None, _) => self.meters.push(Meters::One(id.into())),
        }
        self.reference.push(numbers.reference);
        self.deviation.push(numbers.deviation);
        self.std_error.push(numbers.std_error);
        self.u.push(numbers.u);
    }

    /// As it stands in a history, without its end.
    pub fn text(&self) -> serde_json::Result<String> {
        envelope::seal(SCHEMA, &self.about(), self)
    }

    pub(super) fn parse(text: &'a [u8]) -> Result<Self, String> {
        let mut line: Self = if text.starts_with(br#"{"night":"#) {
            serde_json::from_slice(text).map_err(|e| e.to_string())?
        } else {
            let opened = envelope::open(SCHEMA, text).and_then(|sealed| sealed.about_what(Self::about));
            opened.map_err(|why| format!("the line {why}"))?
        };
        if !(1..=LAST_BARE).contains(&line.format) {
            return Err(format!("format {}; this luxproof reads formats 1 to {LAST_BARE}", line.format));
        }
        line.meters.extend(line.meter.take().map(Meters::One));
        let count = line.meters.iter().try_fold(0_usize, |count, meters| count.checked_add(meters.count()?));
        let lists = [&line.reference, &line.std_error, &line.u];
        let lists = lists.into_iter().filter(|list| !list.is_empty()).chain([&line.deviation]);
        if let Some(wrong) = lists.map(Vec::len).find(|length| Some(*length) != count) {
            return Err(format!("{wrong} numbers for {} meters", count.unwrap_or(usize::MAX)));
        }
        Ok(line)
    }

    fn about(&self) -> String {
        format!("{} {}", self.night, self.case)
    }

    /// How every line of this night and case begins, in an envelope or without.
    pub(super) fn heads(&self) -> [String; 2] {
        let text = |t: &str| serde_json::Value::from(t).to_string();
        let bare = format!("{{\"night\":{},\"case\":{},", text(&self.night), text(&self.case));
        [envelope::head(SCHEMA, &self.about()), bare]
    }

    pub(super) fn subject(&self) -> Subject<'_> {
        (&self.case, self.procedure, &self.engine, &self.model, self.basis, &self.source)
    }

    pub fn count(&self) -> usize {
        self.deviation.len()
    }

    pub(super) fn numbers(&self, k: usize) -> Numbers {
        let [reference, deviation, std_error, u] = [&self.reference, &self.deviation, &self.std_error, &self.u]
            .map(|numbers| numbers.get(k).copied().unwrap_or(f64::NAN));
        Numbers { reference, deviation, std_error, u }
    }

    fn says_the_same_of_its_meters(&self, other: &Self) -> bool {
        (&self.night, self.subject(), &self.version) == (&other.night, other.subject(), &other.version)
            && (self.quantity, self.verdict) == (other.quantity, other.verdict)
    }
}

impl Meters<'_> {
    /// `None` of a run that ends before it begins.
    fn count(&self) -> Option<usize> {
        match self {
            Self::Run(_, first, last) => last.checked_sub(*first)?.checked_add(1),
            Self::One(_) => Some(1),
        }
    }

    pub(super) fn ids(&self) -> Vec<MeterId> {
        match self {
            Self::Run(set, first, last) => (*first..=*last).map(|k| MeterId::new(set, k)).collect(),
            Self::One(id) => vec![MeterId(id.to_string())],
        }
    }
}

/// The lines of a report, for the night of its start or for the one given.
pub fn lines<'a>(report: &'a Report, night: Option<&'a str>) -> Result<Vec<Line<'a>>, HistoryError> {
    let night = night.or_else(|| report.started.get(..10)).unwrap_or_default();
    if Day::try_from(night.to_owned()).is_err() {
        return Err(HistoryError::Night { night: night.to_owned() });
    }
    let mut lines: Vec<Line<'a>> = vec![];
    for c in &report.comparisons {
        let recording = report.recordings.iter().find(|r| r.key == c.key && r.model == c.model);
        let reference = c.reference.as_ref();
        let new = Line {
            version: recording.map_or("", |r| r.version.as_str()).into(),
            model: c.model.as_str().into(),
            basis: reference.map(|r| r.basis),
            source: reference.map_or("", |r| r.source.as_str()).into(),
            ..Line::new(night, &c.key, c.quantity, c.verdict)
        };
        let place = lines.iter().rposition(|line| line.says_the_same_of_its_meters(&new)).unwrap_or(lines.len());
        if place == lines.len() {
            lines.push(new);
        }
        lines[place].push(&c.meter, Numbers::of(c));
    }
    Ok(lines)
}

impl Numbers {
    /// Rounded to what they are worth: a year of nights stays readable.
    fn of(comparison: &Comparison) -> Self {
        let std_error = comparison.uncertainty.standard_error();
        let reference = comparison.reference.as_ref();
        let number = |value: Option<f64>, digits| value.and_then(|v| rounded(v, digits)).unwrap_or(f64::NAN);
        let u = reference.map(|r| std_error.unwrap_or(0.0).hypot(r.uncertainty));
        Self {
            reference: number(reference.map(|r| r.value), 9),
            deviation: number(comparison.deviation, 6),
            std_error: number(std_error, 4),
            u: number(u, 4),
        }
    }
}

const fn last_bare() -> u32 {
    LAST_BARE
}

fn is_void(numbers: &[f64]) -> bool {
    numbers.iter().all(|n| n.is_nan())
}

/// Reads a list of numbers, or the one number of format 1; null is NaN.
fn numbers<'de, D: Deserializer<'de>>(from: D) -> Result<Vec<f64>, D::Error> {
    from.deserialize_any(List)
}

/// Reads without a copy between, which `#[serde(untagged)]` would make: numbers are most of a history.
struct List;

impl<'de> Visitor<'de> for List {
    type Value = Vec<f64>;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("numbers or null, in a list")
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<Vec<f64>, A::Error> {
        let mut numbers = Vec::with_capacity(32);
        while let Some(number) = list.next_element::<Option<f64>>()? {
            numbers.push(number.unwrap_or(f64::NAN));
        }
        Ok(numbers)
    }

    fn visit_f64<E>(self, number: f64) -> Result<Vec<f64>, E> {
        Ok(vec![number])
    }

    fn visit_i64<E>(self, number: i64) -> Result<Vec<f64>, E> {
        Ok(vec![number as f64])
    }

    fn visit_u64<E>(self, number: u64) -> Result<Vec<f64>, E> {
        Ok(vec![number as f64])
    }

    fn visit_unit<E>(self) -> Result<Vec<f64>, E> {
        Ok(vec![f64::NAN])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::system::envelope::tests::planted;

    const FORMAT_1: &str = r#"{"night":"2026-01-02","case":"a\"b","procedure":"direct_illuminance","engine":"e","version":"1","model":"point","meter":"m[0-3]","quantity":"illuminance_lx","basis":"exact","source":"","value":1.5,"std_error":null,"reference":1,"deviation":0.5,"u":1e-3,"verdict":"pass"}"#;

    fn key() -> ReadingKey {
        ReadingKey::new("room", ProcedureId::DirectIlluminance, "radiance")
    }

    #[test]
    fn meters_in_a_row_are_a_run_and_every_line_reads_back_as_written() {
        let key = key();
        let ids =
            ["m[0]", "m[1]", "m[3]", "n[4]", "n[04]", "odd[5-6]", "n[]", "n[7]", "n[8]"].map(|id| MeterId(id.into()));
        let mut line = Line::new("2026-01-31", &key, Quantity::Illuminance, Verdict::Pass);
        for (k, id) in ids.iter().enumerate() {
            let value = if k == 2 { f64::NAN } else { k as f64 / 3.0 };
            line.push(id, Numbers { reference: 1.0, deviation: value, std_error: f64::NAN, u: 1e-7 });
        }
        let text = line.text().unwrap();
        assert!(text.starts_with(&line.heads()[0]), "{text}");
        assert!(serde_json::to_string(&line).unwrap().starts_with(&line.heads()[1]));
        let meters = r#""meters":[["m",0,1],["m",3,3],["n",4,4],"n[04]","odd[5-6]","n[]",["n",7,8]]"#;
        assert!(text.contains(meters) && !text.contains("std_error"), "{text}");
        let read = Line::parse(text.as_bytes()).unwrap();
        assert_eq!(read.text().unwrap(), text);
        for bytes in planted(text.as_bytes()) {
            assert!(Line::parse(&bytes).is_err(), "{}", String::from_utf8_lossy(&bytes));
        }
        assert_eq!(read.meters.iter().flat_map(Meters::ids).collect::<Vec<_>>(), ids);
        assert!(read.numbers(2).deviation.is_nan() && read.numbers(1).std_error.is_nan());
        assert_eq!((read.numbers(1).deviation, read.numbers(8).u), (1.0 / 3.0, 1e-7));
    }

    #[test]
    fn a_line_of_format_1_is_one_of_a_single_meter() {
        let line = Line::parse(FORMAT_1.as_bytes()).unwrap();
        assert_eq!(line.subject(), ("a\"b", ProcedureId::DirectIlluminance, "e", "point", Some(Basis::Exact), ""));
        assert_eq!(line.meters, [Meters::One("m[0-3]".into())]);
        let Numbers { reference, deviation, std_error, u } = line.numbers(0);
        assert_eq!((reference, deviation, u), (1.0, 0.5, 1e-3));
        assert!(std_error.is_nan());
    }

    #[test]
    fn a_line_whose_lists_do_not_fit_its_meters_or_of_a_later_format_is_refused() {
        let one = r#""meter":"m[0-3]""#;
        for (from, to, says) in [
            (one, r#""meters":[["m",0,1]]"#, "1 numbers for 2 meters"),
            (one, r#""meters":[["m",1,0]]"#, "1 numbers for"),
            (one, r#""meters":[["m",0,18446744073709551615]]"#, "1 numbers for"),
            (one, r#""meters":[["m",0]]"#, "did not match"),
            (one, r#""n":0"#, "1 numbers for 0 meters"),
            ("1e-3", "[1,2]", "2 numbers for 1 meters"),
            ("1e-3", "\"small\"", "expected numbers or null"),
            ("\"deviation\"", "\"drift\"", "0 numbers for 1 meters"),
            ("\"version\"", "\"format\":3,\"version\"", "format 3; this luxproof reads"),
            ("\"pass\"", "\"perhaps\"", "unknown variant"),
        ] {
            let error = Line::parse(FORMAT_1.replace(from, to).as_bytes()).unwrap_err();
            assert!(error.contains(says), "{to}: {error}");
        }
    }

    #[test]
    fn nights_are_dates_and_numbers_keep_what_they_are_worth() {
        let report = Report::default();
        assert!(lines(&report, Some("2024-02-29")).is_ok());
        assert!(matches!(lines(&report, Some("tonight...")), Err(HistoryError::Night { .. })));
        let rounded = [(1.732_05, 4), (-1.23456789e-12, 3), (0.0, 3), (f64::NAN, 3)].map(|(v, n)| rounded(v, n));
        assert_eq!(rounded, [Some(1.732), Some(-1.23e-12), Some(0.0), None]);
    }
}
