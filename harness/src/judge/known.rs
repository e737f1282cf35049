//! Known deviations: where an engine is known to differ from its reference, by how much, how certainly and why.
//!
//! An entry is a claim and no licence: an expected relative deviation with its standard uncertainty, at the meters where it was
//! measured. What agrees with it is a known deviation, what passes although it should not is an unexpected pass, and every other
//! reading keeps its own verdict. Ours are in `reference/known_deviations.yaml`, a project's in its `luxproof.yaml`.

use std::path::PathBuf;

use schemars::JsonSchema;
use serde::de::{Deserializer, IgnoredAny};
use serde::{Deserialize, Serialize};

use super::verdict::Verdict;
use super::{Basis, Comparison};
use crate::procedures::shapes::{Found, Shapes};
use crate::record::{EngineName, ProcedureId, ReadingKey};
use crate::spec::{Source, SpecError};
use crate::system::day::Day;

const ON_RECORD: &str = include_str!("../../../reference/known_deviations.yaml");

/// Everything on record, as of a day.
#[derive(Clone, Debug)]
pub struct KnownDeviations {
    deviations: Vec<KnownDeviation>,
    breaks: Vec<KnownBreak>,
    today: Day,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct OurRecord {
    known_deviations: Vec<KnownDeviation>,
    known_breaks: Vec<KnownBreak>,
}

/// By how much an engine is known to differ, where, why and since when that is known.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct KnownDeviation {
    /// Whose readings differ.
    pub engine: EngineName,
    /// In which procedure.
    pub procedure: ProcedureId,
    /// From which references; from all where none is named.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub basis: Option<Basis>,
    /// In which cases: a name with `*` and `?`; that of a spec stands for all its cases.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub case: Option<Glob>,
    /// In which cases by their content, whatever they are called: any of these hashes, `content_sha256` in report.json.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub content: Vec<String>,
    /// With which luminaire model: point, area, impostor or mixed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub model: Option<String>,
    /// At which meters: a name with `*` and `?`, such as `desk[*]`; at all where none is named.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub meter: Option<Glob>,
    /// From and to which angle from the nadir, in degrees, both included.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gamma_deg: Option<[f64; 2]>,
    /// The deviation to expect, relative to the reference.
    pub expected: f64,
    /// Its standard uncertainty, likewise; less than half of it, or nothing would be known.
    pub uncertainty: f64,
    pub cause: String,
    /// How it is known: a measurement, a manual, a paper.
    pub source: String,
    /// Who answers for it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub owner: Option<String>,
    /// Where it is worked on.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub issue: Option<String>,
    /// The last day (UTC) on which it counts, such as 2027-06-30.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(with = "Option<String>")]
    pub expires: Option<Day>,
}

/// A name in which `*` stands for anything and `?` for one letter; brackets are those of meters.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, JsonSchema)]
#[serde(into = "String")]
#[schemars(with = "String")]
pub struct Glob(glob::Pattern);

/// A bracket as a pattern writes it.
const BRACKET: &str = "[[]";

impl From<Glob> for String {
    fn from(Glob(pattern): Glob) -> Self {
        pattern.as_str().replace(BRACKET, "[")
    }
}

impl Glob {
    fn new(text: &str) -> Result<Self, String> {
        let pattern = glob::Pattern::new(&text.replace('[', BRACKET));
        pattern.map(Self).map_err(|e| format!("`{text}` is no pattern: {e}"))
    }

    fn matches(&self, name: &str) -> bool {
        self.0.matches(name)
    }
}

impl<'de> Deserialize<'de> for Glob {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let read = |found: Found<'_, IgnoredAny, IgnoredAny>| match found {
            Found::Word(text) => Some(Self::new(text)),
            _ => None,
        };
        deserializer.deserialize_any(Shapes { expected: "a name, `*` and `?` for parts of it", read })
    }
}

/// A law of `luxproof stress` that an engine is known to break from some magnitude on.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct KnownBreak {
    pub engine: EngineName,
    /// The case that it was measured with.
    pub case: String,
    pub law: String,
    pub how: How,
    /// The mildest magnitude at which it does.
    pub from: f64,
    /// The largest deviation measured, relative; none where nothing is read.
    #[serde(default)]
    pub relative: Option<f64>,
    pub cause: String,
    pub source: String,
}

/// How a law is broken.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, strum::Display)]
#[serde(rename_all = "snake_case")]
#[strum(serialize_all = "snake_case")]
pub enum How {
    Drift,
    /// More than half of the light is gone, or readings are, without an error.
    SilentLoss,
    Nan,
    Crash,
    Hang,
}

/// What an entry came to in a case that it is about.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct OnRecord {
    #[serde(flatten)]
    pub key: ReadingKey,
    pub state: State,
    /// How many comparisons are known deviations by it.
    pub readings: usize,
    pub entry: KnownDeviation,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum State {
    /// Readings deviate as it says.
    Seen,
    /// None does: it matches no meter, or what is there deviates otherwise.
    NotSeen,
    /// Its last day is over, and it counts no more.
    Expired,
}

impl KnownDeviations {
    pub fn built_in() -> Result<Self, SpecError> {
        let source = Source::new(PathBuf::from("reference/known_deviations.yaml"), ON_RECORD.to_owned());
        let OurRecord { known_deviations: deviations, known_breaks: breaks } = source.parse()?;
        check(&source, &deviations)?;
        let is_told = |b: &KnownBreak| !(b.cause.trim().is_empty() || b.source.trim().is_empty());
        source.require(breaks.iter().all(is_told), "known_breaks", "one lacks cause or source", "give both")?;
        Ok(Self { deviations, breaks, today: Day::today() })
    }

    /// The same with what a project has on record besides.
    #[must_use]
    pub(super) fn with(mut self, further: &[KnownDeviation]) -> Self {
        self.deviations.extend_from_slice(further);
        self
    }

    pub fn breaks(&self) -> &[KnownBreak] {
        &self.breaks
    }

    /// Revises a verdict in the light of the record; `content` is what was measured, `coverage` the factor of intervals.
    pub(super) fn revise(&self, comparison: &mut Comparison, content: &str, coverage: f64) {
        let in_force = self.deviations.iter().filter(|k| !k.is_expired(&self.today));
        let found = in_force.filter(|k| k.is_about(comparison, content) && k.is_at(comparison));
        let Some((_, verdict, why)) = found.filter_map(|k| k.says(comparison, coverage)).min_by_key(|(rank, ..)| *rank)
        else {
            return;
        };
        comparison.verdict = verdict;
        comparison.diagnosis = Some(why);
    }

    /// What every entry came to that is about these comparisons of one task.
    pub(super) fn on_record(&self, comparisons: &[&Comparison], content: &str) -> Vec<OnRecord> {
        let one = |entry: &KnownDeviation| {
            let about =
                || comparisons.iter().copied().filter(|c| c.verdict != Verdict::Missing && entry.is_about(c, content));
            let why = entry.told();
            let by_it = |c: &&Comparison| {
                c.verdict == Verdict::KnownDeviation && entry.is_at(c) && c.diagnosis.as_ref() == Some(&why)
            };
            let readings = about().filter(by_it).count();
            let state = match readings {
                _ if entry.is_expired(&self.today) => State::Expired,
                0 => State::NotSeen,
                _ => State::Seen,
            };
            Some(OnRecord { key: about().next()?.key.clone(), state, readings, entry: entry.clone() })
        };
        self.deviations.iter().filter_map(one).collect()
    }
}

/// Refuses entries that claim nothing, or more than can be.
pub(super) fn check(source: &Source, entries: &[KnownDeviation]) -> Result<(), SpecError> {
    for (k, entry) in entries.iter().enumerate() {
        let at = |field: &str| format!("known_deviations[{k}].{field}");
        let sound = entry.expected.is_finite() && entry.expected >= -1.0 && entry.expected != 0.0;
        let help = "give it relative to the reference: -0.012 is 1.2 % too little";
        source.require(sound, &at("expected"), "this is no deviation", help)?;
        let sound = entry.uncertainty >= 0.0 && entry.uncertainty < 0.5 * entry.expected.abs();
        let help =
            "give the standard uncertainty, less than half of the expected deviation: what may be none is not known";
        source.require(sound, &at("uncertainty"), "this is no uncertainty of a known deviation", help)?;
        for (field, text) in [("cause", &entry.cause), ("source", &entry.source)] {
            source.require(!text.trim().is_empty(), &at(field), "this says nothing", "say why, and how it is known")?;
        }
    }
    Ok(())
}

impl KnownDeviation {
    fn is_expired(&self, today: &Day) -> bool {
        self.expires.as_ref().is_some_and(|last| today > last)
    }

    fn is_about(&self, c: &Comparison, content: &str) -> bool {
        let is_case = |glob: &Glob| {
            let whole = |name: &str| glob.matches(name);
            whole(&c.key.case) || c.key.case.rsplit_once('/').is_some_and(|(spec, _)| whole(spec))
        };
        self.engine == c.key.engine
            && self.procedure == c.key.procedure
            && self.basis.map_or(c.reference.is_some(), |basis| c.basis() == Some(basis))
            && self.case.as_ref().is_none_or(is_case)
            && (self.content.is_empty() || self.content.iter().any(|own| own == content))
            && self.model.as_ref().is_none_or(|model| *model == c.model)
    }

    fn is_at(&self, c: &Comparison) -> bool {
        let within = |[from, to]: [f64; 2]| c.gamma_deg.is_some_and(|gamma| (from..=to).contains(&gamma));
        self.meter.as_ref().is_none_or(|glob| glob.matches(&c.meter.0)) && self.gamma_deg.is_none_or(within)
    }

    /// What it makes of a comparison, with the reason, and how little it changes; `None` where the verdict stands.
    ///
    /// A reading is excused where its deviation agrees with the expected one within the combined interval of both (the score `E_n`
    /// of ISO/IEC 17043 is at most 1), and its own interval ends within the tolerance about what is expected, so that noise excuses nothing.
    fn says(&self, c: &Comparison, coverage: f64) -> Option<(u8, Verdict, String)> {
        let scale = c.reference.as_ref()?.value.abs();
        let (expanded, allowed) = (c.budget.as_ref()?.expanded / scale, c.allowed() / scale);
        let (own, apart) = (coverage * self.uncertainty, (c.relative_deviation? - self.expected).abs());
        let (agrees, is_close) = (apart <= expanded.hypot(own), apart + expanded <= allowed + own);
        match c.verdict {
            Verdict::Fail | Verdict::Inconclusive if agrees && is_close => {
                Some((0, Verdict::KnownDeviation, self.told()))
            }
            Verdict::Fail if agrees => {
                let why = format!("undecided whether it is the deviation on record: {}", self.told());
                Some((1, Verdict::Inconclusive, why))
            }
            Verdict::Pass if self.expected.abs() - own > allowed => {
                let why = format!("a deviation of {:+.2} % is on record: {}", 100.0 * self.expected, self.told());
                Some((2, Verdict::UnexpectedPass, why))
            }
            _ => None,
        }
    }

    /// The cause, and who works on it where.
    pub fn told(&self) -> String {
        let who: Vec<&str> = [&self.issue, &self.owner].into_iter().flatten().map(String::as_str).collect();
        if who.is_empty() { self.cause.clone() } else { format!("{} ({})", self.cause, who.join(", ")) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::judge::tests::{recording, task};
    use crate::judge::{Judge, Policy};
    use crate::record::{Estimate, Uncertainty};

    const ENTRY: &str = "engine: radiance, procedure: indirect_illuminance, cause: a cache, source: us";

    fn record(entries: &[&str]) -> KnownDeviations {
        let entries = entries.iter().map(|e| format!("  - {{{ENTRY}, {e}}}")).collect::<Vec<_>>().join("\n");
        let source = Source::new("record.yaml".into(), format!("known_breaks: []\nknown_deviations:\n{entries}"));
        let OurRecord { known_deviations: deviations, known_breaks: breaks } = source.parse().unwrap();
        check(&source, &deviations).unwrap();
        KnownDeviations { deviations, breaks, today: Day::try_from("2027-06-30".to_owned()).unwrap() }
    }

    /// The comparison of a reading that lies so far off, at the tolerance of 2 %, and what the entries came to.
    fn judged(entries: &[&str], deviation: f64, error: f64) -> (Comparison, Vec<OnRecord>) {
        let policy = Policy { known: record(entries), ..Policy::built_in().unwrap() };
        let (case, exact) = (crate::spec::Case::default(), recording("simulator", &[Estimate::exact(1.0)]));
        let uncertainty = Uncertainty::sampled(error, None);
        let subject = recording("radiance", &[Estimate { value: 1.0 + deviation, uncertainty }]);
        let judge: Judge<'_> = policy.judge(&case, None);
        let comparisons = judge.compare(&task(1), &[&exact, &subject]);
        let on_record = judge.on_record(&comparisons, &[&exact, &subject]);
        (comparisons.into_iter().find(|c| c.key.engine == "radiance").unwrap(), on_record)
    }

    fn verdict(entries: &[&str], deviation: f64, error: f64) -> Verdict {
        judged(entries, deviation, error).0.verdict
    }

    const LESS: &str = "expected: -0.05, uncertainty: 0.002";

    #[test]
    fn a_deviation_is_known_where_it_agrees_with_what_is_expected_and_nowhere_else() {
        for (deviation, found) in [
            (-0.05, Verdict::KnownDeviation),
            (-0.0539, Verdict::KnownDeviation),
            (-0.0541, Verdict::Fail),
            (-0.0459, Verdict::Fail),
            (-0.021, Verdict::Fail),
            (0.05, Verdict::Fail),
            (f64::NAN, Verdict::Missing),
            // Gone, whatever else the entry might have excused.
            (-0.019, Verdict::UnexpectedPass),
            (0.0, Verdict::UnexpectedPass),
        ] {
            assert_eq!(verdict(&[LESS], deviation, 0.0), found, "{deviation}");
        }
    }

    #[test]
    fn noise_excuses_nothing() {
        // Within two standard errors of the expected value, but it may as well be 9 % off.
        assert_eq!(verdict(&[LESS], -0.065, 0.012), Verdict::Inconclusive);
        assert_eq!(verdict(&[LESS], -0.065, 0.001), Verdict::Fail);
        // Undecided by itself, and no closer to what is expected than to nothing.
        let (undecided, _) = judged(&["expected: -0.03, uncertainty: 0.001"], -0.02, 0.02);
        assert_eq!((undecided.verdict, undecided.diagnosis), (Verdict::Inconclusive, None));
        assert_eq!(verdict(&["expected: -0.021, uncertainty: 0.001"], -0.0205, 0.001), Verdict::KnownDeviation);
    }

    #[test]
    fn an_entry_within_the_tolerance_expects_nothing_of_a_pass() {
        assert_eq!(verdict(&["expected: -0.021, uncertainty: 0.001"], -0.019, 0.0), Verdict::Pass);
        assert_eq!(verdict(&["expected: -0.023, uncertainty: 0.001"], -0.019, 0.0), Verdict::UnexpectedPass);
    }

    #[test]
    fn an_entry_holds_where_it_says_and_what_it_comes_to_is_told() {
        for (place, is_about, is_at) in [
            ("case: c", true, true),
            ("case: \"*\"", true, true),
            ("case: \"c/*\"", false, false),
            ("case: cc", false, false),
            ("meter: \"grid[0]\"", true, true),
            ("meter: \"grid[*]\"", true, true),
            ("meter: \"grid[1]\"", true, false),
            ("meter: grid0", true, false),
            ("gamma_deg: [0, 180]", true, false),
            ("model: point", true, true),
            ("model: area", false, false),
            ("basis: exact", true, true),
            ("basis: published", false, false),
            ("content: [ab]", false, false),
            ("expires: 2027-06-30", true, true),
        ] {
            let (comparison, told) = judged(&[&format!("{LESS}, {place}")], -0.05, 0.0);
            assert_eq!(comparison.verdict == Verdict::KnownDeviation, is_at, "{place}");
            let state = if is_at { State::Seen } else { State::NotSeen };
            let found: Vec<_> = told.iter().map(|t| (t.state, t.readings)).collect();
            assert_eq!(found, Vec::from_iter(is_about.then_some((state, usize::from(is_at)))), "{place}");
        }
    }

    #[test]
    fn past_its_last_day_an_entry_excuses_nothing_and_is_told() {
        let (comparison, told) = judged(&[&format!("{LESS}, expires: 2027-06-29")], -0.05, 0.0);
        assert_eq!((comparison.verdict, told[0].state), (Verdict::Fail, State::Expired));
        assert_eq!(verdict(&[&format!("{LESS}, expires: 2027-06-29")], 0.0, 0.0), Verdict::Pass);
    }

    #[test]
    fn the_record_of_the_program_is_narrow_and_of_cases_by_their_content() {
        for entry in KnownDeviations::built_in().unwrap().deviations {
            assert!(!entry.content.is_empty() && entry.case.is_none(), "{entry:?}");
            assert!(entry.uncertainty <= 0.01 && entry.basis.is_some(), "{entry:?}");
            assert!(entry.meter.is_some() || entry.gamma_deg.is_some(), "{entry:?}");
        }
    }
}
