//! Known deviations: where an engine is known to differ, by how much and why, read from `reference/known_deviations.yaml`.

use serde::{Deserialize, Serialize};

use super::verdict::Verdict;
use crate::record::{EngineName, ProcedureId, ReadingKey};

const ON_RECORD: &str = include_str!("../../../reference/known_deviations.yaml");

#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct KnownDeviations {
    known_deviations: Vec<KnownDeviation>,
    #[serde(default)]
    known_breaks: Vec<KnownBreak>,
}

#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct KnownDeviation {
    engine: EngineName,
    procedure: ProcedureId,
    basis: super::Basis,
    /// Only in this case, where one is named; the name of a spec stands for all its cases.
    #[serde(default)]
    case: Option<String>,
    /// Only with this luminaire model, where one is named.
    #[serde(default)]
    model: Option<String>,
    relative: [f64; 2],
    /// Whether every reading is expected to deviate, so that a pass is news.
    always: bool,
    cause: String,
    source: String,
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

#[derive(Debug, thiserror::Error)]
#[error("reference/known_deviations.yaml: {0}")]
pub struct KnownDeviationError(String);

impl KnownDeviations {
    pub fn built_in() -> Result<Self, KnownDeviationError> {
        let record: Self = crate::spec::from_yaml(ON_RECORD).map_err(KnownDeviationError)?;
        let deviations = record.known_deviations.iter().map(|k| (&k.engine, &k.cause, &k.source));
        let breaks = record.known_breaks.iter().map(|k| (&k.engine, &k.cause, &k.source));
        let lacks = |(_, cause, source): &(_, &String, &String)| cause.trim().is_empty() || source.trim().is_empty();
        match deviations.chain(breaks).find(lacks) {
            Some((engine, ..)) => Err(KnownDeviationError(format!("a deviation of {engine} lacks cause or source"))),
            None => Ok(record),
        }
    }

    pub fn breaks(&self) -> &[KnownBreak] {
        &self.known_breaks
    }

    /// The verdict in the light of the record, with the cause where it applies.
    pub fn revise(&self, verdict: Verdict, of: &Subject<'_>) -> (Verdict, Option<String>) {
        let applies = |k: &&KnownDeviation| {
            k.engine == of.key.engine
                && k.procedure == of.key.procedure
                && k.basis == of.basis
                && k.case.as_deref().is_none_or(|c| of.is_of(c))
                && k.model.as_deref().is_none_or(|m| m == of.model)
        };
        let Some(known) = self.known_deviations.iter().find(applies) else { return (verdict, None) };
        let within = of.relative_deviation.is_some_and(|d| (known.relative[0]..=known.relative[1]).contains(&d));
        match verdict {
            Verdict::Fail | Verdict::Inconclusive if within => (Verdict::KnownDeviation, Some(known.cause.clone())),
            Verdict::Pass if known.always => {
                (Verdict::UnexpectedPass, Some(format!("a deviation is on record: {}", known.cause)))
            }
            other => (other, None),
        }
    }
}

#[derive(Clone, Copy, Debug)]
pub struct Subject<'a> {
    pub key: &'a ReadingKey,
    pub model: &'a str,
    pub basis: super::Basis,
    /// Deviation over reference, where that is defined.
    pub relative_deviation: Option<f64>,
}

impl Subject<'_> {
    fn is_of(&self, name: &str) -> bool {
        self.key.case.strip_prefix(name).is_some_and(|rest| rest.is_empty() || rest.starts_with('/'))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::LazyLock;

    use crate::judge::Basis;

    fn record(further: &str) -> KnownDeviations {
        let text = format!(
            "known_deviations:\n  - {{engine: iesna, procedure: indirect_illuminance, basis: exact, relative: [-0.2, 0.1], \
             cause: three surfaces, source: us, {further}}}\n"
        );
        crate::spec::from_yaml(&text).unwrap()
    }

    fn subject(relative_deviation: f64) -> Subject<'static> {
        static KEY: LazyLock<ReadingKey> =
            LazyLock::new(|| ReadingKey::new("c", ProcedureId::IndirectIlluminance, "iesna"));
        Subject { key: &KEY, model: "point", basis: Basis::Exact, relative_deviation: Some(relative_deviation) }
    }

    #[test]
    fn a_failure_within_the_recorded_range_is_known_and_one_outside_is_not() {
        let record = record("always: false");
        assert_eq!(record.revise(Verdict::Fail, &subject(-0.15)).0, Verdict::KnownDeviation);
        assert_eq!(record.revise(Verdict::Fail, &subject(-0.25)).0, Verdict::Fail);
        assert_eq!(record.revise(Verdict::Pass, &subject(-0.01)).0, Verdict::Pass);
        assert_eq!(record.revise(Verdict::Missing, &subject(-0.15)).0, Verdict::Missing);
    }

    #[test]
    fn a_record_for_one_model_excuses_no_other() {
        let record = record("always: false, model: impostor");
        assert_eq!(record.revise(Verdict::Fail, &subject(-0.15)).0, Verdict::Fail);
        let impostor = Subject { model: "impostor", ..subject(-0.15) };
        assert_eq!(record.revise(Verdict::Fail, &impostor).0, Verdict::KnownDeviation);
    }

    #[test]
    fn a_deviation_that_is_gone_is_reported() {
        assert_eq!(record("always: true").revise(Verdict::Pass, &subject(0.0)).0, Verdict::UnexpectedPass);
    }

    #[test]
    fn the_record_of_the_program_is_sound() {
        KnownDeviations::built_in().unwrap();
    }
}
