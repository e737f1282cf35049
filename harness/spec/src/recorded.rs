//! Recorded readings: values that somebody published or measured, in a CSV file, which are judged like those of an engine.
//!
//! `engines: {iray-2016: {readings: iray.csv, version: "2016", source: "..."}}`. The program that made them need not exist any more.

use std::collections::{BTreeMap, BTreeSet};

use luxproof_model::{Estimate, MeterId, ProcedureId, Uncertainty};
use luxproof_process::printable;

use super::model::EngineSettings;

/// The setting that makes an engine one of recorded readings.
pub const READINGS: &str = "readings";

/// All settings of an engine of recorded readings.
const SETTINGS: [&str; 4] = [READINGS, "version", "rounding", "source"];

/// The columns of the file. `case` may be absent where every case has the same values, `uncertainty` where none is stated.
const COLUMNS: [&str; 5] = ["case", "procedure", "meter", "value", "uncertainty"];

/// The longest version and source, in characters.
const MAX_TEXT: usize = 1000;

/// The readings of a file, and what is known of their origin.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RecordedReadings {
    /// The version of the program or instrument, as the source states it.
    pub version: String,
    /// Where the values were published.
    pub source: String,
    rows: BTreeMap<RowKey, Estimate>,
}

/// The place of a value; without a case it holds for every case.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct RowKey {
    procedure: ProcedureId,
    meter: String,
    case: Option<String>,
}

/// What is wrong with a file of recorded readings, and where.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct RecordedError {
    /// Line of the CSV file, counted from 1.
    pub(super) line: Option<usize>,
    pub(super) message: String,
    pub(super) help: String,
}

/// What is wrong with the settings of such an engine.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct SettingError {
    pub(super) key: String,
    pub(super) message: String,
}

/// The settings of an engine of recorded readings, but for the file.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct RecordedSettings {
    pub(super) file: String,
    version: String,
    source: String,
    /// The step of the printed values in their unit; `None` for one unit of the last printed digit.
    rounding: Option<f64>,
}

impl RecordedSettings {
    /// Reads the settings of an engine; `None` where they are not those of recorded readings.
    pub(super) fn from_settings(settings: &EngineSettings) -> Option<Result<Self, SettingError>> {
        settings.0.contains_key(READINGS).then(|| Self::parse(settings))
    }

    fn parse(EngineSettings(settings): &EngineSettings) -> Result<Self, SettingError> {
        if let Some(key) = settings.keys().find(|key| !SETTINGS.contains(&key.as_str())) {
            let message = format!("recorded readings have no such setting; they have {}", SETTINGS.join(", "));
            return Err(SettingError { key: key.clone(), message });
        }
        let rounding = match settings.get("rounding").map(serde_json::Value::as_f64) {
            None => None,
            Some(Some(step)) if step.is_finite() && step >= 0.0 => Some(step),
            Some(_) => return Err(SettingError::new("rounding", "must be the step of the printed values, 0 or more")),
        };
        let file = text_of(settings, READINGS)?;
        if file.is_empty() {
            return Err(SettingError::new(READINGS, "must be the name of a CSV file, relative to the spec"));
        }
        Ok(Self { file, version: text_of(settings, "version")?, source: text_of(settings, "source")?, rounding })
    }
}

impl SettingError {
    fn new(key: &str, message: &str) -> Self {
        Self { key: key.to_owned(), message: message.to_owned() }
    }
}

/// A setting as one line of text; empty where it is absent.
fn text_of(settings: &BTreeMap<String, serde_json::Value>, key: &str) -> Result<String, SettingError> {
    match settings.get(key).map(|value| value.as_str()) {
        None => Ok(String::new()),
        Some(Some(text)) if text.chars().count() <= MAX_TEXT && !text.chars().any(printable::is_unprintable) => {
            Ok(text.to_owned())
        }
        Some(_) => Err(SettingError::new(key, &format!("must be a line of at most {MAX_TEXT} printable characters"))),
    }
}

impl RecordedReadings {
    /// Reads a CSV file with a header line.
    pub(super) fn parse(bytes: &[u8], settings: RecordedSettings) -> Result<Self, RecordedError> {
        let mut reader = csv::ReaderBuilder::new().trim(csv::Trim::All).comment(Some(b'#')).from_reader(bytes);
        let header = reader.headers().map_err(|error| misread(&error))?.clone();
        let columns = Columns::from_header(&header)?;
        let mut rows = BTreeMap::new();
        for record in reader.records() {
            let record = record.map_err(|error| misread(&error))?;
            let line = record.position().map(|position| position.line() as usize);
            let (key, estimate) = columns.row(&record, settings.rounding).map_err(|(message, help)| RecordedError {
                line,
                message,
                help: help.to_owned(),
            })?;
            let message = format!("a second value of {} at `{}`", key.procedure, printable::line(&key.meter, 60));
            if rows.insert(key, estimate).is_some() {
                return Err(RecordedError { line, message, help: "give each value once".to_owned() });
            }
        }
        Ok(Self { version: settings.version, source: settings.source, rows })
    }

    /// The value at a meter with its uncertainty, in the unit of the procedure.
    pub fn value(&self, case: &str, procedure: ProcedureId, meter: &MeterId) -> Option<Estimate> {
        let first = RowKey { procedure, meter: meter.0.clone(), case: None };
        let mut own =
            self.rows.range(first..).take_while(|(key, _)| key.procedure == procedure && key.meter == meter.0);
        let of_all = own.clone().find(|(key, _)| key.case.is_none());
        own.find(|(key, _)| key.case.is_some() && key.is_of(case)).or(of_all).map(|(_, estimate)| *estimate)
    }

    /// Whether there is any value of a procedure of a case.
    pub fn has_any(&self, case: &str, procedure: ProcedureId) -> bool {
        self.rows.keys().any(|key| key.procedure == procedure && key.is_of(case))
    }

    /// The first meter that a row names for a case and that is not among `known`, with its procedure.
    pub fn unknown_meter(&self, case: &str, known: &BTreeSet<(ProcedureId, MeterId)>) -> Option<(ProcedureId, &str)> {
        let mut named = self.rows.keys().filter(|key| key.is_of(case));
        let unknown = named.find(|key| !known.contains(&(key.procedure, MeterId(key.meter.clone()))))?;
        Some((unknown.procedure, &unknown.meter))
    }
}

impl RowKey {
    /// Whether the row holds for a case: a file names it in full, `room/dark`, or as the spec does, `dark`.
    fn is_of(&self, case: &str) -> bool {
        let short = case.rsplit_once('/').map(|(_, name)| name);
        self.case.as_ref().is_none_or(|own| own == case || Some(own.as_str()) == short)
    }
}

/// The place of each column.
struct Columns {
    case: Option<usize>,
    procedure: usize,
    meter: usize,
    value: usize,
    uncertainty: Option<usize>,
}

impl Columns {
    fn from_header(header: &csv::StringRecord) -> Result<Self, RecordedError> {
        let error = |message: String| {
            let help = "begin with a line `case,procedure,meter,value,uncertainty`; case and uncertainty may be absent";
            RecordedError { line: Some(1), message, help: help.to_owned() }
        };
        if let Some(other) = header.iter().find(|name| !COLUMNS.contains(name)) {
            return Err(error(format!("there is no column `{}`", printable::line(other, 60))));
        }
        let place = |name: &str| header.iter().position(|column| column == name);
        let needed = |name: &str| place(name).ok_or_else(|| error(format!("the column `{name}` is missing")));
        if COLUMNS.iter().any(|name| header.iter().filter(|column| column == name).count() > 1) {
            return Err(error("a column is there twice".to_owned()));
        }
        Ok(Self {
            case: place("case"),
            procedure: needed("procedure")?,
            meter: needed("meter")?,
            value: needed("value")?,
            uncertainty: place("uncertainty"),
        })
    }

    /// A row as its place and its value, or what is wrong and what to do.
    fn row(
        &self,
        record: &csv::StringRecord,
        rounding: Option<f64>,
    ) -> Result<(RowKey, Estimate), (String, &'static str)> {
        let field = |k: usize| record.get(k).unwrap_or("");
        let procedure = field(self.procedure);
        let procedure: ProcedureId = procedure.parse().map_err(|unknown: luxproof_model::UnknownProcedure| {
            (unknown.to_string(), "name a procedure of the spec")
        })?;
        let text = field(self.value);
        let value = number(text).ok_or_else(|| {
            (
                format!("`{}` is no number", printable::line(text, 60)),
                "write numbers like 104.17; leave out a row without one",
            )
        })?;
        let stated = self.uncertainty.map(field).filter(|text| !text.is_empty());
        let stated = stated.map(|text| number(text).filter(|u| *u >= 0.0).ok_or(text)).transpose().map_err(|text| {
            (
                format!("`{}` is no uncertainty", printable::line(text, 60)),
                "give a standard uncertainty in the unit of the value",
            )
        })?;
        let bound = 0.5 * rounding.unwrap_or_else(|| last_digit(text));
        let uncertainty = match stated {
            Some(value) if value > 0.0 => Uncertainty::StandardError { value, degrees_of_freedom: None, bound },
            _ => Uncertainty::Bound(bound),
        };
        let case = self.case.map(field).filter(|name| !name.is_empty()).map(str::to_owned);
        Ok((RowKey { procedure, meter: field(self.meter).to_owned(), case }, Estimate { value, uncertainty }))
    }
}

fn number(text: &str) -> Option<f64> {
    text.parse().ok().filter(|value: &f64| value.is_finite())
}

/// One unit of the last digit of a printed number: .01 of `104.17`, 1 of `937`, 100 of `1.2e3`.
fn last_digit(text: &str) -> f64 {
    let (digits, exponent) = text.split_once(['e', 'E']).unwrap_or((text, "0"));
    let decimals = digits.split_once('.').map_or(0, |(_, decimals)| decimals.len() as i32);
    10f64.powi(exponent.parse::<i32>().unwrap_or(0).saturating_sub(decimals))
}

fn misread(error: &csv::Error) -> RecordedError {
    let line = error.position().map(|position| position.line() as usize);
    let help = "write one row a line, with as many fields as the first line has".to_owned();
    RecordedError { line, message: format!("this is no CSV file: {error}"), help }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(text: &str) -> Result<RecordedReadings, RecordedError> {
        RecordedReadings::parse(text.as_bytes(), RecordedSettings::default())
    }

    fn meter(name: &str, k: usize) -> MeterId {
        MeterId::new(name, k)
    }

    #[test]
    fn a_value_is_known_within_half_a_unit_of_its_last_printed_digit() {
        let read =
            parse("procedure,meter,value\ndirect_illuminance,p[0],104.17\ndirect_illuminance,p[1],937\n").unwrap();
        let value = |k| read.value("room", ProcedureId::DirectIlluminance, &meter("p", k)).unwrap();
        assert_eq!((value(0).value, value(0).uncertainty), (104.17, Uncertainty::Bound(0.005)));
        assert_eq!((value(1).value, value(1).uncertainty), (937.0, Uncertainty::Bound(0.5)));
        assert_eq!(last_digit("1.2e3"), 100.0);
        assert_eq!(last_digit("1.5e-2147483648"), 0.0);
    }

    #[test]
    fn a_stated_uncertainty_and_rounding_count_both() {
        let text = "procedure,meter,value,uncertainty\ndirect_illuminance,p[0],100,2\n";
        let settings = RecordedSettings { rounding: Some(0.1), ..RecordedSettings::default() };
        let read = RecordedReadings::parse(text.as_bytes(), settings).unwrap();
        let estimate = read.value("room", ProcedureId::DirectIlluminance, &meter("p", 0)).unwrap();
        let expected = Uncertainty::StandardError { value: 2.0, degrees_of_freedom: None, bound: 0.05 };
        assert_eq!(estimate.uncertainty, expected);
    }

    #[test]
    fn a_row_of_a_case_holds_for_that_case_and_one_without_for_all() {
        let text = "case,procedure,meter,value\na,direct_illuminance,p[0],1.0\n,direct_illuminance,p[0],2.0\n";
        let read = parse(text).unwrap();
        let value = |case| read.value(case, ProcedureId::DirectIlluminance, &meter("p", 0)).unwrap().value;
        assert_eq!(["a", "room/a", "b", "room"].map(value), [1.0, 1.0, 2.0, 2.0]);
        assert!(!read.has_any("a", ProcedureId::IndirectIlluminance));
    }

    fn wrong(text: &str) -> RecordedError {
        parse(text).unwrap_err()
    }

    #[test]
    fn what_is_wrong_in_a_file_is_named_with_its_line() {
        let named = wrong("procedure,meter,value\ndirect_illuminance,p[0],1\ndirect_illuminance,p[1],bright\n");
        assert_eq!((named.line, named.message.as_str()), (Some(3), "`bright` is no number"));
        let twice = wrong("procedure,meter,value\ndirect_illuminance,p[0],1\ndirect_illuminance,p[0],2\n");
        assert_eq!(twice.line, Some(3));
        assert!(wrong("procedure,meter,lux\n").message.contains("no column `lux`"));
        assert!(wrong("procedure,value\n").message.contains("`meter` is missing"));
        assert!(wrong("procedure,meter,value\ndirekt,p[0],1\n").message.contains("direkt"));
        assert_eq!(wrong("procedure,meter,value\ndirect_illuminance,p[0]\n").line, Some(2));
        assert!(wrong("procedure,meter,value\ndirect_illuminance,p[0],NaN\n").message.contains("no number"));
    }

    #[test]
    fn a_spec_gives_no_other_setting() {
        let read = |text: &str| RecordedSettings::from_settings(&EngineSettings(serde_json::from_str(text).unwrap()));
        assert_eq!(read(r#"{"command": ["x"]}"#), None);
        let error = read(r#"{"readings": "a.csv", "command": ["x"]}"#).unwrap().unwrap_err();
        assert_eq!(error.key, "command");
        assert_eq!(read(r#"{"readings": "a.csv", "rounding": -1}"#).unwrap().unwrap_err().key, "rounding");
        assert_eq!(read(r#"{"readings": 3}"#).unwrap().unwrap_err().key, "readings");
    }
}
