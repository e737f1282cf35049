//! One line of the history: an engine in one procedure of one case on one night, with the numbers of its meters as lists.
//!
//! Lines are independent: they can be removed, reordered, or merged from two histories. The words of a line hold for all of its
//! meters, so comparisons with another verdict or reference have a separate line. A line is in an envelope, which reveals an edited
//! line. Lines that other tools write have no envelope, and `"format": 2`.

use std::borrow::Cow;
use std::fmt;

use serde::de::{SeqAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize};

use luxproof_model::Day;
use luxproof_model::Report;
use luxproof_model::{Basis, Comparison, Role, Verdict};
use luxproof_model::{MeterId, ProcedureId, Quantity, ReadingKey};
use luxproof_process::envelope::{self, Schema};
use luxproof_process::files::FileError;
use luxproof_report::words::rounded;

const SCHEMA: Schema = Schema { of: "history line", version: 4 };
/// How a line without an envelope begins.
const BARE_HEAD: &[u8] = br#"{"night":"#;
/// The format of such a line.
const BARE_FORMAT: u32 = 2;

/// The comparisons of an engine in one procedure of one case on one night. A missing number is NaN, and null in the file.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Line<'a> {
    #[serde(borrow)]
    pub(super) night: Cow<'a, str>,
    #[serde(borrow)]
    case: Cow<'a, str>,
    /// The format of a line without an envelope.
    #[serde(default, skip_serializing)]
    format: Option<u32>,
    pub procedure: ProcedureId,
    #[serde(borrow)]
    pub engine: Cow<'a, str>,
    #[serde(borrow)]
    pub version: Cow<'a, str>,
    #[serde(borrow)]
    pub model: Cow<'a, str>,
    pub quantity: Quantity,
    /// The basis of the reference; null without a reference.
    pub basis: Option<Basis>,
    /// Formula, solver or paper of the reference.
    #[serde(borrow)]
    pub source: Cow<'a, str>,
    pub verdict: Verdict,
    #[serde(borrow)]
    pub(super) meters: Vec<Meters<'a>>,
    #[serde(default, deserialize_with = "numbers", skip_serializing_if = "has_no_number")]
    reference: Vec<f64>,
    #[serde(default, deserialize_with = "numbers")]
    deviation: Vec<f64>,
    #[serde(default, deserialize_with = "numbers", skip_serializing_if = "has_no_number")]
    std_error: Vec<f64>,
    #[serde(default, deserialize_with = "numbers", skip_serializing_if = "has_no_number")]
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

/// Some of the meters of a line.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(untagged)]
pub(super) enum Meters<'a> {
    /// `set[first]` to `set[last]`.
    Run(#[serde(borrow)] Cow<'a, str>, usize, usize),
    Single(#[serde(borrow)] Cow<'a, str>),
}

/// The numbers of one meter, in the quantity's unit; NaN where there is none.
#[derive(Clone, Copy, Debug)]
pub struct Numbers {
    pub reference: f64,
    /// The reading minus the reference.
    pub deviation: f64,
    /// Standard error of the reading, which differs from night to night.
    pub std_error: f64,
    /// Combined standard uncertainty of the deviation: reading and reference.
    pub u: f64,
}

/// What identifies a series, together with its meter: case, procedure, engine, model, basis and source.
pub(super) type Subject<'l> = (&'l str, ProcedureId, &'l str, &'l str, Option<Basis>, &'l str);

impl<'a> Line<'a> {
    pub fn new(night: &'a str, key: &'a ReadingKey, quantity: Quantity, verdict: Verdict) -> Self {
        Self {
            night: night.into(),
            case: key.case.as_str().into(),
            format: None,
            procedure: key.procedure,
            engine: key.engine.as_str().into(),
            version: "".into(),
            model: "".into(),
            quantity,
            basis: None,
            source: "".into(),
            verdict,
            meters: vec![],
            reference: vec![],
            deviation: vec![],
            std_error: vec![],
            u: vec![],
        }
    }

    /// Adds the numbers of a meter; consecutive meters of a set share an entry.
    pub fn push(&mut self, meter: &'a MeterId, numbers: Numbers) {
        match (set_and_index(meter), self.meters.last_mut()) {
            (Some((set, k)), Some(Meters::Run(of, _, last))) if of == set && last.checked_add(1) == Some(k) => {
                *last = k;
            }
            (Some((set, k)), _) => self.meters.push(Meters::Run(set.into(), k, k)),
            (None, _) => self.meters.push(Meters::Single(meter.0.as_str().into())),
        }
        self.reference.push(numbers.reference);
        self.deviation.push(numbers.deviation);
        self.std_error.push(numbers.std_error);
        self.u.push(numbers.u);
    }

    /// The text of the line, without the line feed.
    pub fn text(&self) -> serde_json::Result<String> {
        envelope::seal(SCHEMA, &self.about(), self)
    }

    /// Parses a line in its envelope, or a bare one of another tool.
    pub(super) fn parse(text: &'a [u8]) -> Result<Self, String> {
        let line: Self = if text.starts_with(BARE_HEAD) {
            let line: Self = serde_json::from_slice(text).map_err(|e| e.to_string())?;
            if line.format != Some(BARE_FORMAT) {
                return Err(format!("a line without an envelope is read if it has \"format\": {BARE_FORMAT}"));
            }
            line
        } else {
            let opened = envelope::open(SCHEMA, text).and_then(|sealed| sealed.about_what(Self::about));
            opened.map_err(|why| format!("the line {why}"))?
        };
        line.check_lists()?;
        Ok(line)
    }

    /// Checks that every list has a number for each meter; only lists without any number may be missing.
    fn check_lists(&self) -> Result<(), String> {
        // Untrusted numbers of meters may overflow.
        let count = self.meters.iter().try_fold(0_usize, |count, meters| count.checked_add(meters.count()?));
        let optional = [&self.reference, &self.std_error, &self.u].into_iter().filter(|list| !list.is_empty());
        match optional.chain([&self.deviation]).map(Vec::len).find(|length| Some(*length) != count) {
            Some(wrong) => Err(format!("{wrong} numbers for {} meters", count.unwrap_or(usize::MAX))),
            None => Ok(()),
        }
    }

    /// The key in the line's envelope.
    fn about(&self) -> String {
        format!("{} {}", self.night, self.case)
    }

    /// How every line of this night and case begins.
    pub(super) fn head(&self) -> String {
        envelope::head(SCHEMA, &self.about())
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

    /// Whether both lines hold the same except for their meters.
    fn has_same_head(&self, other: &Self) -> bool {
        (&self.night, self.subject(), &self.version) == (&other.night, other.subject(), &other.version)
            && (self.quantity, self.verdict) == (other.quantity, other.verdict)
    }
}

/// The set and index of a meter with a canonical name: `m` and 3 of `m[3]`.
fn set_and_index(meter: &MeterId) -> Option<(&str, usize)> {
    let (set, index) = meter.0.strip_suffix(']')?.rsplit_once('[')?;
    let index = index.parse::<usize>().ok()?;
    (MeterId::new(set, index) == *meter).then_some((set, index))
}

impl Meters<'_> {
    /// `None` of a run that ends before it begins.
    fn count(&self) -> Option<usize> {
        match self {
            Self::Run(_, first, last) => last.checked_sub(*first)?.checked_add(1),
            Self::Single(_) => Some(1),
        }
    }

    pub(super) fn ids(&self) -> Vec<MeterId> {
        match self {
            Self::Run(set, first, last) => (*first..=*last).map(|k| MeterId::new(set, k)).collect(),
            Self::Single(id) => vec![MeterId(id.to_string())],
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
        if recording.is_some_and(|r| r.role == Role::Recorded) {
            continue;
        }
        let reference = c.reference.as_ref();
        let new = Line {
            version: recording.map_or("", |r| r.version.as_str()).into(),
            model: c.model.as_str().into(),
            basis: reference.map(|r| r.basis),
            source: reference.map_or("", |r| r.source.as_str()).into(),
            ..Line::new(night, &c.key, c.quantity, c.verdict)
        };
        let place = lines.iter().rposition(|line| line.has_same_head(&new)).unwrap_or(lines.len());
        if place == lines.len() {
            lines.push(new);
        }
        lines[place].push(&c.meter, Numbers::from_comparison(c));
    }
    Ok(lines)
}

impl Numbers {
    /// Rounded to the digits that matter, so that a year of nights stays small.
    fn from_comparison(comparison: &Comparison) -> Self {
        let std_error = comparison.uncertainty.standard_error();
        let reference = comparison.reference.as_ref();
        let u = reference.map(|r| std_error.unwrap_or(0.0).hypot(r.uncertainty));
        Self {
            reference: rounded_or_nan(reference.map(|r| r.value), 9),
            deviation: rounded_or_nan(comparison.deviation, 6),
            std_error: rounded_or_nan(std_error, 4),
            u: rounded_or_nan(u, 4),
        }
    }
}

fn rounded_or_nan(value: Option<f64>, digits: usize) -> f64 {
    value.and_then(|v| rounded(v, digits)).unwrap_or(f64::NAN)
}

/// Whether a list has no number at all.
fn has_no_number(numbers: &[f64]) -> bool {
    numbers.iter().all(|n| n.is_nan())
}

/// Reads a list of numbers; null is NaN.
fn numbers<'de, D: Deserializer<'de>>(from: D) -> Result<Vec<f64>, D::Error> {
    from.deserialize_seq(ListVisitor)
}

/// Reads without a list of options in between, because numbers are most of a history.
struct ListVisitor;

impl<'de> Visitor<'de> for ListVisitor {
    type Value = Vec<f64>;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a list of numbers or null")
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<Vec<f64>, A::Error> {
        let mut numbers = Vec::with_capacity(32);
        while let Some(number) = list.next_element::<Option<f64>>()? {
            numbers.push(number.unwrap_or(f64::NAN));
        }
        Ok(numbers)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use luxproof_process::envelope::damaged;

    /// The body of a line of one meter.
    const BODY: &str = r#"{"night":"2026-01-02","case":"a\"b","procedure":"direct_illuminance","engine":"e","version":"1","model":"point","quantity":"illuminance_lx","basis":"simulator","source":"","verdict":"pass","meters":["m[0-3]"],"reference":[1],"deviation":[0.5],"u":[1e-3]}"#;

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
        assert!(text.starts_with(&line.head()), "{text}");
        let meters = r#""meters":[["m",0,1],["m",3,3],["n",4,4],"n[04]","odd[5-6]","n[]",["n",7,8]]"#;
        assert!(text.contains(meters) && !text.contains("std_error"), "{text}");
        let read = Line::parse(text.as_bytes()).unwrap();
        assert_eq!(read.text().unwrap(), text);
        for bytes in damaged(text.as_bytes()) {
            assert!(Line::parse(&bytes).is_err(), "{}", String::from_utf8_lossy(&bytes));
        }
        assert_eq!(read.meters.iter().flat_map(Meters::ids).collect::<Vec<_>>(), ids);
        assert!(read.numbers(2).deviation.is_nan() && read.numbers(1).std_error.is_nan());
        assert_eq!((read.numbers(1).deviation, read.numbers(8).u), (1.0 / 3.0, 1e-7));
    }

    /// Seals a body like a line of the present format.
    fn seal_body(body: &str) -> String {
        let body: serde_json::Value = serde_json::from_str(body).unwrap();
        envelope::seal(SCHEMA, "2026-01-02 a\"b", &body).unwrap()
    }

    #[test]
    fn a_line_has_the_numbers_of_its_meters() {
        let text = seal_body(BODY);
        let line = Line::parse(text.as_bytes()).unwrap();
        assert_eq!(line.subject(), ("a\"b", ProcedureId::DirectIlluminance, "e", "point", Some(Basis::Simulator), ""));
        assert_eq!(line.meters, [Meters::Single("m[0-3]".into())]);
        let Numbers { reference, deviation, std_error, u } = line.numbers(0);
        assert_eq!((reference, deviation, u), (1.0, 0.5, 1e-3));
        assert!(std_error.is_nan());
    }

    #[test]
    fn a_line_whose_lists_do_not_fit_its_meters_is_refused() {
        let meters = r#""meters":["m[0-3]"]"#;
        for (from, to, says) in [
            (meters, r#""meters":[["m",0,1]]"#, "1 numbers for 2 meters"),
            (meters, r#""meters":[["m",1,0]]"#, "1 numbers for"),
            (meters, r#""meters":[["m",0,18446744073709551615]]"#, "1 numbers for"),
            (meters, r#""meters":[["m",0]]"#, "did not match"),
            (meters, r#""meters":[]"#, "1 numbers for 0 meters"),
            (meters, r#""n":0"#, "missing field `meters`"),
            ("[1e-3]", "[1,2]", "2 numbers for 1 meters"),
            ("[1e-3]", "1e-3", "expected a list of numbers or null"),
            ("\"deviation\"", "\"drift\"", "0 numbers for 1 meters"),
            ("\"pass\"", "\"perhaps\"", "unknown variant"),
        ] {
            assert!(BODY.contains(from), "no `{from}` in the body");
            let error = Line::parse(seal_body(&BODY.replace(from, to)).as_bytes()).unwrap_err();
            assert!(error.contains(says), "{to}: {error}");
        }
    }

    #[test]
    fn a_line_of_an_older_or_later_format_is_refused() {
        let of_a_tool = BODY.replacen("\"procedure\"", "\"format\":2,\"procedure\"", 1);
        assert_eq!(Line::parse(of_a_tool.as_bytes()).unwrap().numbers(0).deviation, 0.5);
        let bare = Line::parse(BODY.as_bytes()).unwrap_err();
        assert_eq!(bare, "a line without an envelope is read if it has \"format\": 2");
        for version in [3, 5] {
            let other = seal_body(BODY).replace("history line 4", &format!("history line {version}"));
            let error = Line::parse(other.as_bytes()).unwrap_err();
            assert!(error.contains(&format!("is a `luxproof history line {version}`")), "{error}");
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

    /// A comparison of an engine's reading with a reference of this source.
    fn comparison(engine: &str, meter: &str, source: &str) -> serde_json::Value {
        serde_json::json!({"case": "room", "procedure": "direct_illuminance", "engine": engine, "model": "point",
            "meter": meter, "at_m": [0, 0, 0], "normal": [0, 0, 1], "gamma_deg": null, "c_deg": null,
            "quantity": "illuminance_lx", "value": 104, "std_error": 3.00004,
            "reference": {"value": 100.0000000001, "uncertainty": 4, "basis": "simulator", "source": source},
            "deviation": 4.00000001, "relative_deviation": 0.04, "tolerance": {"relative": 0.01, "absolute": 0},
            "verdict": "fail", "diagnosis": null})
    }

    /// The run of an engine in the room, of this version.
    fn recording(engine: &str, version: &str) -> serde_json::Value {
        serde_json::json!({"case": "room", "procedure": "direct_illuminance", "engine": engine, "version": version,
            "model": "point", "light": "direct", "input_sha256": "", "seed": 1, "method": {}, "approximation": null,
            "notes": [], "wall_s": 1, "failure": null})
    }

    #[test]
    fn a_report_has_a_line_for_each_engine_and_reference_with_the_numbers_of_its_meters() {
        let mut report = Report { started: "2026-01-31T23:00:00Z".to_owned(), ..Report::default() };
        for (engine, meter, source) in [
            ("radiance", "m[0]", "solver"),
            ("mitsuba", "m[0]", "solver"),
            ("radiance", "m[1]", "solver"),
            ("radiance", "m[1]", "paper"),
            ("recorded", "m[0]", "solver"),
        ] {
            report.comparisons.push(serde_json::from_value(comparison(engine, meter, source)).unwrap());
        }
        for (engine, version, role) in
            [("mitsuba", "3.5", Role::Renderer), ("radiance", "6.0", Role::Renderer), ("recorded", "1", Role::Recorded)]
        {
            let recording: luxproof_model::Recording = serde_json::from_value(recording(engine, version)).unwrap();
            report.recordings.push(luxproof_model::Recording { role, ..recording });
        }
        // A run with another model of luminaire has another version, and a run of another engine is none of these.
        let other = report.recordings[1].clone();
        let other = luxproof_model::Recording { model: "area".to_owned(), version: "5.9".to_owned(), ..other };
        report.recordings.insert(0, other);
        report.comparisons[4].model = "point".to_owned();
        let found = lines(&report, None).unwrap();
        let heads: Vec<_> = found.iter().map(|l| (&*l.night, &*l.engine, &*l.version, &*l.source, l.count())).collect();
        let night = "2026-01-31";
        let expected = [
            (night, "radiance", "6.0", "solver", 2),
            (night, "mitsuba", "3.5", "solver", 1),
            (night, "radiance", "6.0", "paper", 1),
        ];
        assert_eq!(heads, expected);
        let Line { case, model, basis, verdict, meters, .. } = &found[0];
        assert_eq!((&**case, &**model, *basis, *verdict), ("room", "point", Some(Basis::Simulator), Verdict::Fail));
        assert_eq!(*meters, [Meters::Run("m".into(), 0, 1)]);
        // Nine digits of the reference, six of the deviation, four of errors; 3 and 4 have the hypotenuse 5.
        let Numbers { reference, deviation, std_error, u } = found[0].numbers(1);
        assert_eq!((reference, deviation, std_error, u), (100.0, 4.0, 3.0, 5.0));
        assert_eq!(&*lines(&report, Some("2026-02-01")).unwrap()[0].night, "2026-02-01");
    }

    #[test]
    fn a_comparison_without_a_reference_has_no_numbers_but_its_error() {
        let mut bare: Comparison = serde_json::from_value(comparison("radiance", "m[0]", "")).unwrap();
        (bare.reference, bare.deviation) = (None, None);
        let Numbers { reference, deviation, std_error, u } = Numbers::from_comparison(&bare);
        assert!(reference.is_nan() && deviation.is_nan() && u.is_nan() && std_error == 3.0);
        let report = Report { started: "2026-01-31".to_owned(), comparisons: vec![bare], ..Report::default() };
        let found = lines(&report, None).unwrap();
        assert_eq!((found[0].basis, &*found[0].source, &*found[0].version), (None, "", ""));
        // An exact reading has the uncertainty of the reference alone.
        let mut exact: Comparison = serde_json::from_value(comparison("radiance", "m[0]", "solver")).unwrap();
        exact.uncertainty = luxproof_model::Uncertainty::Exact;
        let Numbers { std_error, u, .. } = Numbers::from_comparison(&exact);
        assert!(std_error.is_nan() && u == 4.0);
        assert!(matches!(lines(&Report::default(), None), Err(HistoryError::Night { .. })));
    }

    #[test]
    fn lines_are_one_where_all_but_the_meters_is_the_same() {
        let (key, other_key) = (key(), ReadingKey::new("hall", ProcedureId::DirectIlluminance, "radiance"));
        let line = Line { version: "1".into(), ..Line::new("2026-01-31", &key, Quantity::Illuminance, Verdict::Pass) };
        assert!(line.has_same_head(&line.clone()));
        for other in [
            Line { night: "2026-02-01".into(), ..line.clone() },
            Line { version: "2".into(), ..line.clone() },
            Line { basis: Some(Basis::Iesna), ..line.clone() },
            Line { verdict: Verdict::Fail, ..line.clone() },
            Line { quantity: Quantity::Luminance, ..line.clone() },
            Line { version: "1".into(), ..Line::new("2026-01-31", &other_key, line.quantity, line.verdict) },
        ] {
            assert!(!line.has_same_head(&other), "{other:?}");
        }
    }

    #[test]
    fn a_list_without_any_number_is_left_out() {
        assert!(has_no_number(&[]) && has_no_number(&[f64::NAN, f64::NAN]));
        assert!(!has_no_number(&[f64::NAN, 0.0]) && !has_no_number(&[1.0]));
    }
}
