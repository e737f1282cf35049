//! Known deviations: how much an engine is known to differ, and whether a run shows it.

use schemars::JsonSchema;
use serde::de::{Deserializer, IgnoredAny};
use serde::{Deserialize, Serialize};

use crate::shapes::{ShapeResult, ShapedValue, Shapes};
use crate::{Basis, Comparison, Day, EngineName, ProcedureId, ReadingKey};

/// How much an engine is known to differ, where and why.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct KnownDeviation {
    /// The engine that differs.
    pub engine: EngineName,
    /// The procedure in which it differs.
    pub procedure: ProcedureId,
    /// The basis of the references from which it differs; all where none is named.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub basis: Option<Basis>,
    /// The cases: a name with `*` and `?`. The name of a spec means all its cases.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub case: Option<Glob>,
    /// The cases by content, under any name: any of these hashes, which are `content_sha256` in report.json.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub content: Vec<String>,
    /// The luminaire model: point, area, impostor or mixed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub model: Option<String>,
    /// The meters: a name with `*` and `?`, such as `desk[*]`; all where none is named.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub meter: Option<Glob>,
    /// The range of angles from the nadir, in degrees, both ends included.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gamma_deg: Option<[f64; 2]>,
    /// The expected deviation, relative to the reference.
    pub expected: f64,
    /// Its standard uncertainty, likewise; less than half of the deviation.
    pub uncertainty: f64,
    pub cause: String,
    /// Whether the cause is a fault of the engine or a limit of its method.
    #[serde(default, skip_serializing_if = "DeviationKind::is_fault")]
    pub kind: DeviationKind,
    /// How it is known: a measurement, a manual, a paper.
    pub source: String,
    /// The person who is responsible for it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub owner: Option<String>,
    /// The issue about it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub issue: Option<String>,
    /// The last day (UTC) on which it counts, such as 2027-06-30.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(with = "Option<String>")]
    pub expires: Option<Day>,
}

/// The kind of a known deviation's cause.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum DeviationKind {
    /// The engine computes something else than it should.
    #[default]
    Fault,
    /// The engine's method or a setting approximates here.
    Limit,
}

impl DeviationKind {
    #[allow(clippy::trivially_copy_pass_by_ref, reason = "serde asks for it")]
    fn is_fault(&self) -> bool {
        *self == Self::Fault
    }
}

/// A name in which `*` matches anything and `?` one letter. Brackets are literal, because names of meters have them.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, JsonSchema)]
#[serde(into = "String")]
#[schemars(with = "String")]
pub struct Glob(glob::Pattern);

/// A literal bracket in a pattern.
const BRACKET: &str = "[[]";

impl From<Glob> for String {
    fn from(Glob(pattern): Glob) -> Self {
        pattern.as_str().replace(BRACKET, "[")
    }
}

impl Glob {
    /// Parses a pattern; the error continues a sentence.
    pub fn new(text: &str) -> Result<Self, String> {
        let pattern = glob::Pattern::new(&text.replace('[', BRACKET));
        pattern.map(Self).map_err(|e| format!("`{text}` is no pattern: {e}"))
    }

    pub fn matches(&self, name: &str) -> bool {
        self.0.matches(name)
    }
}

impl<'de> Deserialize<'de> for Glob {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(Shapes { expected: "a name, `*` and `?` for parts of it", read: read_glob })
    }
}

/// A pattern is a word; any other shape is an error.
#[allow(clippy::needless_pass_by_value, reason = "the form of all visitors of shapes")]
fn read_glob(found: ShapedValue<'_, IgnoredAny, IgnoredAny>) -> ShapeResult<Glob> {
    match found {
        ShapedValue::Word(text) => Some(Glob::new(text)),
        _ => None,
    }
}

/// Whether a case shows a known deviation that applies to it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct KnownDeviationOutcome {
    #[serde(flatten)]
    pub key: ReadingKey,
    pub state: State,
    /// The number of comparisons that it explains.
    pub readings: usize,
    pub entry: KnownDeviation,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum State {
    /// Readings deviate as expected.
    Seen,
    /// None does: it matches no meter, or the readings deviate differently.
    NotSeen,
    /// Its last day is past, and it no longer counts.
    Expired,
}

impl KnownDeviation {
    pub fn is_expired(&self, today: &Day) -> bool {
        self.expires.as_ref().is_some_and(|last| today > last)
    }

    /// Whether it applies to a comparison in a case with this content, at any meter.
    pub fn is_about(&self, c: &Comparison, content: &str) -> bool {
        self.engine == c.key.engine
            && self.procedure == c.key.procedure
            && self.basis.map_or(c.reference.is_some(), |basis| c.basis() == Some(basis))
            && self.case.as_ref().is_none_or(|glob| matches_case(glob, &c.key.case))
            && (self.content.is_empty() || self.content.iter().any(|hash| hash == content))
            && self.model.as_ref().is_none_or(|model| *model == c.model)
    }

    /// Whether it applies to the meter of a comparison.
    pub fn is_at(&self, c: &Comparison) -> bool {
        let is_meter = self.meter.as_ref().is_none_or(|glob| glob.matches(&c.meter.0));
        let is_angle = match self.gamma_deg {
            Some([from, to]) => c.gamma_deg.is_some_and(|gamma| (from..=to).contains(&gamma)),
            None => true,
        };
        is_meter && is_angle
    }

    /// The cause, with its issue and owner.
    pub fn summary(&self) -> String {
        let who: Vec<&str> = [&self.issue, &self.owner].into_iter().flatten().map(String::as_str).collect();
        if who.is_empty() { self.cause.clone() } else { format!("{} ({})", self.cause, who.join(", ")) }
    }
}

/// Whether a pattern matches a case, or the spec of the case.
fn matches_case(glob: &Glob, case: &str) -> bool {
    glob.matches(case) || case.rsplit_once('/').is_some_and(|(spec, _)| glob.matches(spec))
}

/// How a law is broken.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, strum::Display)]
#[serde(rename_all = "snake_case")]
#[strum(serialize_all = "snake_case")]
pub enum LawBreach {
    Drift,
    /// More than half of the light or of the readings is missing, without an error.
    SilentLoss,
    Nan,
    Crash,
    Hang,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::comparison;
    use crate::{Reference, Uncertainty};

    /// An entry about everything of Radiance's direct light.
    fn entry() -> KnownDeviation {
        KnownDeviation {
            engine: "radiance".into(),
            procedure: ProcedureId::DirectIlluminance,
            basis: None,
            case: None,
            content: vec![],
            model: None,
            meter: None,
            gamma_deg: None,
            expected: 0.02,
            uncertainty: 0.001,
            cause: "a cache".to_owned(),
            kind: DeviationKind::Fault,
            source: "measured".to_owned(),
            owner: None,
            issue: None,
            expires: None,
        }
    }

    fn glob(text: &str) -> Glob {
        Glob::new(text).unwrap()
    }

    #[test]
    fn an_entry_is_about_what_all_of_its_fields_name() {
        let (c, plain) = (comparison(), entry());
        assert!(plain.is_about(&c, "ab"));
        for named in [
            KnownDeviation { basis: Some(Basis::Simulator), ..entry() },
            KnownDeviation { case: Some(glob("suite/*")), ..entry() },
            // The name of a spec means all its cases.
            KnownDeviation { case: Some(glob("suite")), ..entry() },
            KnownDeviation { content: vec!["cd".to_owned(), "ab".to_owned()], ..entry() },
            KnownDeviation { model: Some("point".to_owned()), ..entry() },
        ] {
            assert!(named.is_about(&c, "ab"), "{named:?}");
        }
        for other in [
            KnownDeviation { engine: "mitsuba".into(), ..entry() },
            KnownDeviation { procedure: ProcedureId::TotalIlluminance, ..entry() },
            KnownDeviation { basis: Some(Basis::Published), ..entry() },
            KnownDeviation { case: Some(glob("room")), ..entry() },
            KnownDeviation { case: Some(glob("suit")), ..entry() },
            KnownDeviation { content: vec!["cd".to_owned()], ..entry() },
            KnownDeviation { model: Some("area".to_owned()), ..entry() },
        ] {
            assert!(!other.is_about(&c, "ab"), "{other:?}");
        }
        let without = Comparison { reference: None, ..comparison() };
        assert!(!plain.is_about(&without, "ab"));
        let source = "a paper".to_owned();
        let printed = Reference::of(100.0, &Uncertainty::Exact, Basis::Published, source);
        assert!(plain.is_about(&Comparison { reference: Some(printed), ..c }, "ab"));
    }

    #[test]
    fn an_entry_is_at_its_meters_and_within_its_angles() {
        let c = Comparison { gamma_deg: Some(60.0), ..comparison() };
        assert!(entry().is_at(&c) && KnownDeviation { meter: Some(glob("desk[*]")), ..entry() }.is_at(&c));
        assert!(!KnownDeviation { meter: Some(glob("desk[4]")), ..entry() }.is_at(&c));
        for (range, is_at) in [([60.0, 90.0], true), ([0.0, 60.0], true), ([0.0, 59.9], false), ([60.1, 90.0], false)] {
            let of_range = KnownDeviation { gamma_deg: Some(range), meter: Some(glob("desk[*]")), ..entry() };
            assert_eq!(of_range.is_at(&c), is_at, "{range:?}");
            // A meter without an angle is within none.
            assert!(!of_range.is_at(&comparison()));
            assert!(!KnownDeviation { meter: Some(glob("wall[*]")), ..of_range }.is_at(&c));
        }
    }

    #[test]
    fn an_entry_counts_up_to_its_last_day() {
        let day = Day::try_from("2027-06-30".to_owned()).unwrap();
        assert!(!entry().is_expired(&day));
        for (last, is_expired) in [("2027-06-29", true), ("2027-06-30", false), ("2027-07-01", false)] {
            let expires = Some(Day::try_from(last.to_owned()).unwrap());
            assert_eq!(KnownDeviation { expires, ..entry() }.is_expired(&day), is_expired, "{last}");
        }
    }

    #[test]
    fn an_entry_reads_back_as_written_and_names_its_cause_issue_and_owner() {
        assert_eq!(entry().summary(), "a cache");
        let (owner, issue) = (Some("us".to_owned()), Some("RAD-41".to_owned()));
        let owned =
            KnownDeviation { owner, issue, meter: Some(glob("desk[?]")), kind: DeviationKind::Limit, ..entry() };
        assert_eq!(owned.summary(), "a cache (RAD-41, us)");
        let text = serde_json::to_string(&owned).unwrap();
        // Brackets of a meter's name are written as they are, and the usual kind is not written.
        assert!(text.contains(r#""meter":"desk[?]""#) && text.contains(r#""kind":"limit""#), "{text}");
        assert_eq!(serde_json::from_str::<KnownDeviation>(&text).unwrap(), owned);
        let plain = serde_json::to_string(&entry()).unwrap();
        assert!(!plain.contains("kind"), "{plain}");
        let error = serde_json::from_str::<Glob>("[1]").unwrap_err().to_string();
        assert!(error.contains("expected a name, `*` and `?` for parts of it"), "{error}");
        assert!(serde_json::from_str::<Glob>("\"a***\"").unwrap_err().to_string().contains("`a***` is no pattern"));
    }
}
