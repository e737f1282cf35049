//! Known deviations: where an engine is known to differ, by how much and why, read from `reference/known_deviations.yaml`.

use serde::{Deserialize, Serialize};

use sha2::{Digest, Sha256};

use super::verdict::Verdict;
use crate::engines::{ExternalJob, Job};
use crate::procedures::Task;
use crate::record::{EngineName, ProcedureId, ReadingKey};
use crate::spec::{Case, hexadecimal};

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
    /// Only in the tasks of these contents, where any are named, whatever their spec is called.
    #[serde(default)]
    contents: Vec<String>,
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
                && (k.contents.is_empty() || k.contents.iter().any(|c| c == of.content))
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
    /// What is measured, as a hash.
    pub content: &'a str,
    pub model: &'a str,
    pub basis: super::Basis,
    /// Deviation over reference, where that is defined.
    pub relative_deviation: Option<f64>,
}

/// What a task is: a hash over what an adapter would be asked, less the names of spec and case, budget and seed.
pub(super) fn content(task: &Task) -> String {
    let asked = ExternalJob::of(&Job::of_task(&Case::default(), task)).to_json().unwrap_or_default();
    hexadecimal(&Sha256::digest(asked))[..16].to_owned()
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
        Subject {
            key: &KEY,
            content: "a room",
            model: "point",
            basis: Basis::Exact,
            relative_deviation: Some(relative_deviation),
        }
    }

    #[test]
    fn a_record_excuses_what_it_is_about_within_its_range_and_tells_what_is_gone() {
        use Verdict::{Fail, KnownDeviation, Missing, Pass, UnexpectedPass};
        for (about, verdict, deviation, revised) in [
            ("always: false", Fail, -0.15, KnownDeviation),
            ("always: false", Fail, -0.25, Fail),
            ("always: false", Pass, -0.01, Pass),
            ("always: false", Missing, -0.15, Missing),
            ("always: true", Pass, 0.0, UnexpectedPass),
            ("always: false, model: point", Fail, -0.15, KnownDeviation),
            ("always: false, model: impostor", Fail, -0.15, Fail),
            ("always: false, contents: [a room]", Fail, -0.15, KnownDeviation),
            ("always: false, contents: [a hall]", Fail, -0.15, Fail),
        ] {
            assert_eq!(record(about).revise(verdict, &subject(deviation)).0, revised, "{about}");
        }
    }

    #[test]
    fn the_record_of_the_program_is_about_tasks_of_the_reference() {
        let reference = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../reference");
        let cases = crate::spec::suite(&["specs", "analytic"].map(|folder| reference.join(folder))).unwrap();
        let tasks = |case| Case::tasks(case).map(|t| (t.procedure, content(&t), &case.name));
        let known: Vec<_> = cases.iter().flat_map(tasks).collect();
        for entry in KnownDeviations::built_in().unwrap().known_deviations {
            let is_there = |of: &String| known.iter().any(|(procedure, c, _)| *procedure == entry.procedure && c == of);
            assert!(entry.contents.iter().all(is_there), "{}: {known:#?}", entry.cause);
        }
    }
}
