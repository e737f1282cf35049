//! Known deviations: where an engine differs from its reference, by how much, how certainly and why.
//!
//! An entry claims a relative deviation with its standard uncertainty, at the meters where it was measured. A reading
//! that agrees with it is a known deviation. One that passes although it should not is an unexpected pass. All other
//! readings keep their verdict. Our entries are in `reference/known_deviations.yaml`, a project's in its
//! `luxproof.yaml`.

use std::time::SystemTime;

use luxproof_model::KnownDeviation;
use luxproof_model::KnownDeviationOutcome;
use luxproof_model::State;
use luxproof_process::clock::timestamp;
use std::path::PathBuf;

use serde::Deserialize;

use luxproof_model::Comparison;
use luxproof_model::Day;
use luxproof_model::EngineName;
use luxproof_model::Verdict;
use luxproof_spec::{Source, SpecError};

const ON_RECORD: &str = include_str!("../data/known_deviations.yaml");

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

/// A law of `luxproof stress` that an engine is known to break from some magnitude on.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct KnownBreak {
    pub engine: EngineName,
    /// The case of the measurement.
    pub case: String,
    pub law: String,
    pub how: LawBreach,
    /// The mildest magnitude that breaks the law.
    pub from: f64,
    /// The largest deviation measured, relative; none where nothing is read.
    #[serde(default)]
    pub relative: Option<f64>,
    pub cause: String,
    pub source: String,
}

use luxproof_model::LawBreach;

/// The day (UTC) by the clock of this machine.
fn today() -> Day {
    let now = timestamp(SystemTime::now());
    Day::of_timestamp(&now).unwrap_or_else(|_| unreachable!("a timestamp begins with a day"))
}

impl KnownDeviations {
    pub fn built_in() -> Result<Self, SpecError> {
        let source = Source::new(PathBuf::from("reference/known_deviations.yaml"), ON_RECORD.to_owned());
        let OurRecord { known_deviations: deviations, known_breaks: breaks } = source.parse()?;
        faults(&source, &deviations).into_iter().next().map_or(Ok(()), Err)?;
        let are_complete = breaks.iter().all(|b| !b.cause.trim().is_empty() && !b.source.trim().is_empty());
        source.require(are_complete, "known_breaks", "one lacks cause or source", "give both")?;
        Ok(Self { deviations, breaks, today: today() })
    }

    /// Adds a project's entries.
    #[must_use]
    pub(super) fn with(mut self, further: &[KnownDeviation]) -> Self {
        self.deviations.extend_from_slice(further);
        self
    }

    pub fn breaks(&self) -> &[KnownBreak] {
        &self.breaks
    }

    /// Revises a verdict by the record; `content` identifies the measured case, `coverage` is the factor of intervals.
    pub(super) fn revise(&self, comparison: &mut Comparison, content: &str, coverage: f64) {
        let in_force = self.deviations.iter().filter(|k| !k.is_expired(&self.today));
        let found = in_force.filter(|k| k.is_about(comparison, content) && k.is_at(comparison));
        let Some((_, verdict, why)) =
            found.filter_map(|k| revision(k, comparison, coverage)).min_by_key(|(rank, ..)| *rank)
        else {
            return;
        };
        comparison.verdict = verdict;
        comparison.diagnosis = Some(why);
    }

    /// The state of every entry about these comparisons of one task.
    pub(super) fn on_record(&self, comparisons: &[&Comparison], content: &str) -> Vec<KnownDeviationOutcome> {
        self.deviations.iter().filter_map(|entry| self.entry_state(entry, comparisons, content)).collect()
    }

    /// The state of an entry; `None` where it is about none of the comparisons.
    fn entry_state(
        &self,
        entry: &KnownDeviation,
        comparisons: &[&Comparison],
        content: &str,
    ) -> Option<KnownDeviationOutcome> {
        let comparisons = comparisons.iter().copied();
        let mut concerned =
            comparisons.filter(|c| c.verdict != Verdict::Missing && entry.is_about(c, content)).peekable();
        let key = concerned.peek()?.key.clone();
        let why = entry.summary();
        // Another entry may have excused a comparison: the reason tells which.
        let readings = concerned
            .filter(|c| c.verdict == Verdict::KnownDeviation && entry.is_at(c) && c.diagnosis.as_ref() == Some(&why))
            .count();
        let state = match readings {
            _ if entry.is_expired(&self.today) => State::Expired,
            0 => State::NotSeen,
            _ => State::Seen,
        };
        Some(KnownDeviationOutcome { key, state, readings, entry: entry.clone() })
    }
}

/// Finds entries without a valid claim.
pub(super) fn faults(source: &Source, entries: &[KnownDeviation]) -> Vec<SpecError> {
    let mut faults = vec![];
    for (k, entry) in entries.iter().enumerate() {
        let is_deviation = entry.expected.is_finite() && entry.expected >= -1.0 && entry.expected != 0.0;
        let place = format!("known_deviations[{k}].expected");
        let help = "give it relative to the reference: -0.012 is 1.2 % too little";
        faults.extend(source.require(is_deviation, &place, "this is no deviation", help).err());
        let is_certain = entry.uncertainty >= 0.0 && entry.uncertainty < 0.5 * entry.expected.abs();
        let place = format!("known_deviations[{k}].uncertainty");
        let what = "this is no uncertainty of a known deviation";
        let help =
            "give the standard uncertainty, less than half of the expected deviation: what may be none is not known";
        // No uncertainty fits an invalid deviation: one error is enough.
        faults.extend(source.require(is_certain || !is_deviation, &place, what, help).err());
        for (field, text) in [("cause", &entry.cause), ("source", &entry.source)] {
            let place = format!("known_deviations[{k}].{field}");
            let help = "say why, and how it is known";
            faults.extend(source.require(!text.trim().is_empty(), &place, "this says nothing", help).err());
        }
    }
    faults
}

/// The verdict of a comparison by an entry, with the reason and a rank of which the least counts.
///
/// An entry excuses a reading under two conditions. The deviation agrees with the expected one within the combined
/// interval of both (the score `E_n` of ISO/IEC 17043 is at most 1). And the reading's interval ends within the
/// tolerance about the expected deviation, so that noise excuses nothing. `None` where the verdict stands.
fn revision(entry: &KnownDeviation, c: &Comparison, coverage: f64) -> Option<(u8, Verdict, String)> {
    let scale = c.reference.as_ref()?.value.abs();
    let (expanded, allowed) = (c.budget.as_ref()?.expanded / scale, c.allowed() / scale);
    let expected_expanded = coverage * entry.uncertainty;
    let distance = (c.relative_deviation? - entry.expected).abs();
    let agrees = distance <= expanded.hypot(expected_expanded);
    let is_close = distance + expanded <= allowed + expected_expanded;
    match c.verdict {
        Verdict::Fail | Verdict::Undecided if agrees && is_close => Some((0, Verdict::KnownDeviation, entry.summary())),
        Verdict::Fail if agrees => {
            let why = format!("undecided whether it is the deviation on record: {}", entry.summary());
            Some((1, Verdict::Undecided, why))
        }
        Verdict::Pass if entry.expected.abs() - expected_expanded > allowed => {
            let why = format!("a deviation of {:+.2} % is on record: {}", 100.0 * entry.expected, entry.summary());
            Some((2, Verdict::UnexpectedPass, why))
        }
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::{recording, task};
    use crate::{Judge, Policy};
    use luxproof_model::{Estimate, Uncertainty};

    const ENTRY: &str = "engine: radiance, procedure: indirect_illuminance, cause: a cache, source: us";

    fn record(entries: &[&str]) -> KnownDeviations {
        let entries = entries.iter().map(|e| format!("  - {{{ENTRY}, {e}}}")).collect::<Vec<_>>().join("\n");
        let source = Source::new("record.yaml".into(), format!("known_breaks: []\nknown_deviations:\n{entries}"));
        let OurRecord { known_deviations: deviations, known_breaks: breaks } = source.parse().unwrap();
        assert_eq!(faults(&source, &deviations), []);
        KnownDeviations { deviations, breaks, today: Day::try_from("2027-06-30".to_owned()).unwrap() }
    }

    /// The comparison of a reading that lies so far off, at the tolerance of 2 %, and what the entries came to.
    fn judged(entries: &[&str], deviation: f64, error: f64) -> (Comparison, Vec<KnownDeviationOutcome>) {
        let policy = Policy { known: record(entries), ..Policy::built_in().unwrap() };
        let (case, exact) = (luxproof_spec::Case::default(), recording("simulator", &[Estimate::exact(1.0)]));
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
        assert_eq!(verdict(&[LESS], -0.065, 0.012), Verdict::Undecided);
        assert_eq!(verdict(&[LESS], -0.065, 0.001), Verdict::Fail);
        // Undecided by itself, and no closer to what is expected than to nothing.
        let (undecided, _) = judged(&["expected: -0.03, uncertainty: 0.001"], -0.02, 0.02);
        assert_eq!((undecided.verdict, undecided.diagnosis), (Verdict::Undecided, None));
        assert_eq!(verdict(&["expected: -0.021, uncertainty: 0.001"], -0.0205, 0.001), Verdict::KnownDeviation);
    }

    #[test]
    fn an_entry_within_the_tolerance_expects_nothing_of_a_pass() {
        assert_eq!(verdict(&["expected: -0.021, uncertainty: 0.001"], -0.019, 0.0), Verdict::Pass);
        assert_eq!(verdict(&["expected: -0.023, uncertainty: 0.001"], -0.019, 0.0), Verdict::UnexpectedPass);
    }

    #[test]
    fn an_entry_holds_where_it_says_and_what_it_comes_to_is_reported() {
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
            ("basis: simulator", true, true),
            ("basis: published", false, false),
            ("content: [ab]", false, false),
            ("expires: 2027-06-30", true, true),
        ] {
            let (comparison, on_record) = judged(&[&format!("{LESS}, {place}")], -0.05, 0.0);
            assert_eq!(comparison.verdict == Verdict::KnownDeviation, is_at, "{place}");
            let state = if is_at { State::Seen } else { State::NotSeen };
            let found: Vec<_> = on_record.iter().map(|t| (t.state, t.readings)).collect();
            assert_eq!(found, Vec::from_iter(is_about.then_some((state, usize::from(is_at)))), "{place}");
        }
    }

    #[test]
    fn past_its_last_day_an_entry_excuses_nothing_and_is_reported() {
        let (comparison, on_record) = judged(&[&format!("{LESS}, expires: 2027-06-29")], -0.05, 0.0);
        assert_eq!((comparison.verdict, on_record[0].state), (Verdict::Fail, State::Expired));
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

    #[test]
    fn of_two_entries_about_a_reading_the_one_that_excuses_it_counts() {
        const MORE: &str = "expected: -0.065, uncertainty: 0.01";
        // The first entry alone leaves it open, see above.
        assert_eq!(verdict(&[LESS], -0.065, 0.012), Verdict::Undecided);
        for entries in [[LESS, MORE], [MORE, LESS]] {
            assert_eq!(verdict(&entries, -0.065, 0.012), Verdict::KnownDeviation, "{entries:?}");
        }
    }

    #[test]
    fn intervals_add_in_quadrature_and_the_tolerance_is_extended_by_the_whole_interval() {
        // Intervals of .002 and .004 combine to .00447, not to .006.
        assert_eq!(verdict(&[LESS], -0.0544, 0.001), Verdict::KnownDeviation);
        assert_eq!(verdict(&[LESS], -0.0550, 0.001), Verdict::Fail);
        assert_eq!(verdict(&[LESS], -0.0456, 0.001), Verdict::KnownDeviation);
        assert_eq!(verdict(&[LESS], -0.0450, 0.001), Verdict::Fail);
        // The reading's interval of .018 may end up to .02 + .004 from what is expected.
        assert_eq!(verdict(&[LESS], -0.0559, 0.009), Verdict::KnownDeviation);
        assert_eq!(verdict(&[LESS], -0.0561, 0.009), Verdict::Undecided);
    }

    /// The fields of one entry that are faulty.
    fn faulty_fields(expected: &str, uncertainty: &str, texts: &str) -> Vec<String> {
        let entry = format!(
            "engine: radiance, procedure: indirect_illuminance, expected: {expected}, uncertainty: {uncertainty}, {texts}"
        );
        let text = format!("known_breaks: []\nknown_deviations:\n  - {{{entry}}}");
        let source = Source::new("record.yaml".into(), text);
        let record: OurRecord = source.parse().unwrap();
        let faults = faults(&source, &record.known_deviations).into_iter();
        // A message begins with its place.
        faults.filter_map(|fault| Some(fault.message.split_once("].")?.1.split_once(": ")?.0.to_owned())).collect()
    }

    #[test]
    fn an_entry_is_a_deviation_of_more_than_twice_its_uncertainty_with_cause_and_source() {
        const TEXTS: &str = "cause: a cache, source: us";
        for (expected, uncertainty, texts, fields) in [
            ("-0.05", "0.0249", TEXTS, &[][..]),
            ("-0.05", "0.025", TEXTS, &["uncertainty"]),
            ("0.05", "0.026", TEXTS, &["uncertainty"]),
            ("0.05", "0", TEXTS, &[]),
            ("0.05", "-0.001", TEXTS, &["uncertainty"]),
            ("-1", "0.1", TEXTS, &[]),
            ("-1.01", "0.1", TEXTS, &["expected"]),
            ("0", "0", TEXTS, &["expected"]),
            (".inf", "0.1", TEXTS, &["expected"]),
            ("0.05", "0.01", "cause: \" \", source: us", &["cause"]),
            ("0.05", "0.01", "cause: a cache, source: \"\"", &["source"]),
        ] {
            assert_eq!(faulty_fields(expected, uncertainty, texts), fields, "{expected} {uncertainty} {texts}");
        }
    }

    #[test]
    fn a_reading_is_counted_for_the_entry_that_excuses_it() {
        // Both are about the reading, and the first explains it.
        let (comparison, on_record) = judged(&[LESS, "expected: -0.09, uncertainty: 0.002, owner: me"], -0.05, 0.0);
        assert_eq!(comparison.verdict, Verdict::KnownDeviation);
        let states: Vec<_> = on_record.iter().map(|outcome| (outcome.state, outcome.readings)).collect();
        assert_eq!(states, [(State::Seen, 1), (State::NotSeen, 0)]);
        // Nothing is known of a reading that is missing.
        assert!(judged(&[LESS], f64::NAN, 0.0).1.is_empty());
    }
}
