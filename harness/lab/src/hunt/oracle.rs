//! Oracles: what finds a fault in readings without knowing the right value. Verdicts, consensus,
//! failures, undecided comparisons and laws.

use std::fmt;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

use serde::{Deserialize, Serialize};

use super::draft::Draft;
use super::grammar::Engines;
use crate::Progress;
use crate::stress::{self, Magnitudes};
use luxproof_audit::measure::{Instrument, Machine, Reader};
use luxproof_audit::plan::Selection;
use luxproof_audit::{AuditError, Calibration, Diagnosis, Options, Repetition};
use luxproof_engines::{Coordinates, EngineRoot};
use luxproof_model::{Comparison, EngineName, FailureKind, LawBreach, ProcedureId, Report, Sampling, Verdict};
use luxproof_process::files::FileError;
use luxproof_spec::{Case, SpecError};
use luxproof_verdict::{AT_A_JUMP, KnownDeviations};

/// A fault of an engine, as it is recognised in other specs.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub struct Symptom {
    pub engine: EngineName,
    pub procedure: ProcedureId,
    pub oracle: Oracle,
}

/// What found a fault.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Oracle {
    /// A reading deviates from its reference by more than tolerance and chance allow.
    Verdict(Sign),
    /// A reading deviates from those of the other engines, but not from its reference, or is itself
    /// the reference.
    Consensus,
    /// The engine gave no reading.
    Failure(FailureKind),
    /// A comparison stays undecided that no further sample can decide.
    Undecided,
    /// The engine's own readings break a law of light.
    Law { law: String, how: LawBreach },
    /// luxproof itself panicked.
    Panic,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Sign {
    TooMuch,
    TooLittle,
}

impl fmt::Display for Symptom {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {} ({})", self.engine, self.oracle, self.procedure)
    }
}

impl fmt::Display for Oracle {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Verdict(Sign::TooMuch) => f.write_str("reads too much"),
            Self::Verdict(Sign::TooLittle) => f.write_str("reads too little"),
            Self::Consensus => f.write_str("departs from the other witnesses"),
            Self::Failure(kind) => write!(f, "fails: {kind}"),
            Self::Undecided => f.write_str("stays undecided without need"),
            Self::Law { law, how } => write!(f, "breaks the law `{law}`: {how}"),
            Self::Panic => f.write_str("luxproof panics"),
        }
    }
}

/// A symptom in a spec, at the meter where it is largest.
#[derive(Clone, Debug)]
pub(super) struct Sighting {
    pub(super) symptom: Symptom,
    /// The comparison at that meter, where the symptom has a meter.
    pub(super) comparison: Option<Comparison>,
    /// The probability of the symptom by chance.
    pub(super) p_value: f64,
    /// The relative deviation, where there is one.
    pub(super) size: Option<f64>,
    /// The message of the engine or the law.
    pub(super) text: Option<String>,
}

impl Sighting {
    /// The fault that explains the failing reading, where there is one.
    pub(super) fn diagnosis(&self) -> Option<String> {
        self.comparison.as_ref().filter(|c| c.verdict == Verdict::Fail)?.diagnosis.clone()
    }
}

/// The part of a report that is about one case.
struct CaseReport<'a> {
    report: &'a Report,
    case: &'a str,
}

/// Finds all faults in one case of a report: one sighting per symptom, by engine and procedure.
pub(super) fn find_sightings(report: &Report, case: &str, hunted: &Engines) -> Vec<Sighting> {
    let case = CaseReport { report, case };
    let mut found = vec![];
    for engine in hunted.keys() {
        for &procedure in ProcedureId::ALL {
            found.extend(case.find_failing_verdict(engine, procedure));
            found.extend(case.find_failure(engine, procedure));
            found.extend(case.find_undecided(engine, procedure));
            found.extend(case.find_outlier(engine, procedure));
        }
    }
    found
}

/// The absolute normalised error of a comparison, infinite where it has none.
fn normalized_size(comparison: &Comparison) -> f64 {
    comparison.normalized_error().map_or(f64::INFINITY, f64::abs)
}

/// The comparison with the largest normalised error.
fn worst_of<'a>(all: impl Iterator<Item = &'a Comparison>) -> Option<&'a Comparison> {
    all.max_by(|a, b| normalized_size(a).total_cmp(&normalized_size(b)))
}

/// A sighting at the worst meter.
fn sighting_at(engine: &EngineName, procedure: ProcedureId, oracle: Oracle, worst: &Comparison) -> Sighting {
    Sighting {
        symptom: Symptom { engine: engine.clone(), procedure, oracle },
        comparison: Some(worst.clone()),
        p_value: worst.p_value.unwrap_or(0.0),
        size: worst.relative_deviation,
        text: None,
    }
}

impl CaseReport<'_> {
    /// The comparisons of an engine in a procedure.
    fn comparisons(&self, engine: &EngineName, procedure: ProcedureId) -> impl Iterator<Item = &Comparison> {
        self.report.comparisons.iter().filter(move |c| c.key.is_of(self.case, procedure) && c.key.engine == *engine)
    }

    /// Finds a failing verdict. A deviation that our own engine declares for its method is not a
    /// fault.
    fn find_failing_verdict(&self, engine: &EngineName, procedure: ProcedureId) -> Option<Sighting> {
        let failing = self.comparisons(engine, procedure).filter(|c| c.verdict == Verdict::Fail);
        let worst = worst_of(failing.filter(|c| self.report.declared(c).is_none()))?;
        let sign = if worst.deviation? > 0.0 { Sign::TooMuch } else { Sign::TooLittle };
        Some(sighting_at(engine, procedure, Oracle::Verdict(sign), worst))
    }

    /// Finds a failure of the engine itself; an interruption is not one, and neither is a declined
    /// task.
    fn find_failure(&self, engine: &EngineName, procedure: ProcedureId) -> Option<Sighting> {
        let mut recordings = self.report.recordings.iter();
        let failed = recordings
            .find(|r| r.key.is_of(self.case, procedure) && r.key.engine == *engine && r.failure_kind.is_some())?;
        let kind = failed.failure_kind?;
        let is_ours = !kind.is_an_answer() || kind == FailureKind::Declined;
        (!is_ours).then(|| Sighting {
            symptom: Symptom { engine: engine.clone(), procedure, oracle: Oracle::Failure(kind) },
            comparison: None,
            p_value: 0.0,
            size: None,
            text: failed.failure.clone(),
        })
    }

    /// Finds a comparison that is undecided although no sampling is involved: a bound of the engine
    /// or its reference is too wide. A user's program may state any bounds, and at the edge of a
    /// jump there are two right answers, so neither counts.
    fn find_undecided(&self, engine: &EngineName, procedure: ProcedureId) -> Option<Sighting> {
        luxproof_engines::entry(engine)?;
        let undecided = self
            .comparisons(engine, procedure)
            .filter(|c| c.verdict == Verdict::Undecided && !c.uncertainty.is_sampled());
        let worst = worst_of(undecided.filter(|c| c.diagnosis.as_deref() != Some(AT_A_JUMP)))?;
        Some(sighting_at(engine, procedure, Oracle::Undecided, worst))
    }

    /// Finds an engine that the consensus names as an outlier. Where a verdict fails already, that
    /// adds nothing.
    fn find_outlier(&self, engine: &EngineName, procedure: ProcedureId) -> Option<Sighting> {
        let mut all = self.report.consensus.iter();
        let consensus = all.find(|c| c.case == self.case && c.procedure == procedure)?;
        let is_named = consensus.outliers.iter().any(|name| engine == name);
        let has_failed = self.comparisons(engine, procedure).any(|c| c.verdict == Verdict::Fail);
        let odds = consensus.odds.filter(|_| is_named && !has_failed)?;
        let worst = worst_of(self.comparisons(engine, procedure).filter(|c| c.deviation.is_some()));
        Some(Sighting {
            symptom: Symptom { engine: engine.clone(), procedure, oracle: Oracle::Consensus },
            comparison: worst.cloned(),
            p_value: 1.0 / (1.0 + odds),
            size: worst.and_then(|c| c.relative_deviation),
            text: Some(consensus.text.clone()),
        })
    }
}

/// The laws that every engine must obey in every scene.
const LAWS: [&str; 9] = [
    "dimming",
    "superposition",
    "mixed_luminaires",
    "scale_up",
    "turned_room",
    "mirror",
    "turned_luminaire",
    "fine_table",
    "reflectance",
];

/// Runs engines on drafts and reports their faults.
pub(super) struct OracleRunner<'a> {
    pub(super) site: &'a EngineRoot,
    pub(super) engines: &'a Engines,
    pub(super) jobs: usize,
    /// A reading of a law that takes longer hangs.
    pub(super) limit: Duration,
}

/// What an audit of drafts measures.
#[derive(Clone, Debug)]
pub(super) struct AuditRequest {
    /// The only symptom of interest, where one is followed up.
    pub(super) symptom: Option<Symptom>,
    pub(super) procedures: Vec<ProcedureId>,
    pub(super) settings: AuditSettings,
}

/// The seed of an audit and how thorough it is.
#[derive(Clone, Copy, Debug)]
pub(super) struct AuditSettings {
    pub(super) seed: u64,
    pub(super) diagnosis: Diagnosis,
    pub(super) stated_errors: Repetition,
}

impl AuditSettings {
    /// The settings for verdicts without a diagnosis.
    pub(super) const fn for_verdict(seed: u64) -> Self {
        Self { seed, diagnosis: Diagnosis::LeftOut, stated_errors: Repetition::Examined }
    }
}

/// The result of an audit of several specs.
pub(super) enum AuditOutcome {
    Report(Box<Report>),
    /// One of them is not a valid spec, or has none of the procedures.
    NoSpec(SpecError),
    /// luxproof panicked.
    Panicked,
}

impl OracleRunner<'_> {
    /// Audits specs; a panic of luxproof is an outcome, because a hunt looks for these, too.
    pub(super) fn audit(
        &self,
        specs: &[PathBuf],
        request: &AuditRequest,
        out: &Path,
    ) -> Result<AuditOutcome, AuditError> {
        let engines = match &request.symptom {
            // An outlier exists only relative to all other engines.
            Some(symptom) if symptom.oracle != Oracle::Consensus => vec![symptom.engine.to_string()],
            _ => self.engines.keys().map(ToString::to_string).collect(),
        };
        let procedures = request.symptom.as_ref().map_or_else(|| request.procedures.clone(), |s| vec![s.procedure]);
        let options = Options {
            jobs: self.jobs,
            selection: Selection { engines, procedures, seed: request.settings.seed },
            calibration: Calibration::LeftOut,
            diagnosis: request.settings.diagnosis,
            stated_errors: request.settings.stated_errors,
            sampling: Some(Sampling::Decided),
            ..Options::new(self.site.clone(), out.to_owned())
        };
        match catch_unwind(AssertUnwindSafe(|| luxproof_audit::run(specs, &options))) {
            Ok(Ok(report)) => Ok(AuditOutcome::Report(Box::new(report))),
            Ok(Err(AuditError::Spec(error))) => Ok(AuditOutcome::NoSpec(error.first())),
            Ok(Err(other)) => Err(other),
            Err(_) => Ok(AuditOutcome::Panicked),
        }
    }

    /// Returns for each of several drafts the sighting of a symptom, where the draft shows it.
    pub(super) fn find_symptom(
        &self,
        drafts: &[&Draft],
        symptom: &Symptom,
        settings: AuditSettings,
    ) -> Result<Vec<Option<Sighting>>, AuditError> {
        let folder = tempfile::tempdir().map_err(|source| FileError::of(&std::env::temp_dir(), source))?;
        let mut paths: Vec<Option<PathBuf>> = vec![];
        for (k, draft) in drafts.iter().enumerate() {
            let path = draft.write(&folder.path().join(k.to_string()), &format!("c{k}"));
            let path = path.map_err(|source| FileError::of(folder.path(), source))?;
            let is_sound = Case::load(&path).is_ok_and(|case| case.task(symptom.procedure).is_some());
            paths.push(is_sound.then_some(path));
        }
        if let Oracle::Law { law, .. } = &symptom.oracle {
            let paths = paths.iter().map(Option::as_deref);
            return Ok(paths.map(|path| self.find_broken_law(path?, symptom, law, settings.seed)).collect());
        }
        let sound: Vec<PathBuf> = paths.iter().flatten().cloned().collect();
        let mut found: Vec<Option<Sighting>> = vec![None; drafts.len()];
        if sound.is_empty() {
            return Ok(found);
        }
        let request = AuditRequest { symptom: Some(symptom.clone()), procedures: vec![], settings };
        match self.audit(&sound, &request, &folder.path().join("out"))? {
            AuditOutcome::Report(report) => {
                for (k, _) in paths.iter().enumerate().filter(|(_, path)| path.is_some()) {
                    let all = find_sightings(&report, &format!("c{k}"), self.engines);
                    found[k] = all.into_iter().find(|s| s.symptom == *symptom);
                }
            }
            AuditOutcome::NoSpec(error) => tracing::debug!("{error}"),
            AuditOutcome::Panicked if sound.len() == 1 => {
                for (found, _) in found.iter_mut().zip(&paths).filter(|(_, path)| path.is_some()) {
                    *found = Some(panic_sighting()).filter(|s| s.symptom == *symptom);
                }
            }
            // The panic ends the audit of all drafts, so each is audited on its own.
            AuditOutcome::Panicked => {
                for (k, draft) in drafts.iter().enumerate().filter(|(k, _)| paths[*k].is_some()) {
                    found[k] = self.find_symptom(&[draft], symptom, settings)?.pop().flatten();
                }
            }
        }
        Ok(found)
    }

    /// Returns the sighting of a symptom that is a broken law, where the spec at a path shows it.
    fn find_broken_law(&self, path: &Path, symptom: &Symptom, law: &str, seed: u64) -> Option<Sighting> {
        let case = Case::load(path).ok()?;
        let all = self.find_broken_laws(&case, Some(&symptom.engine), &[law.to_owned()], seed);
        all.into_iter().find(|s| s.symptom == *symptom)
    }

    /// Finds the laws that all engines, or one of them, break in a case at a mild magnitude.
    pub(super) fn find_broken_laws(
        &self,
        case: &Case,
        only: Option<&EngineName>,
        laws: &[String],
        seed: u64,
    ) -> Vec<Sighting> {
        let subjects: Vec<Instrument> = self
            .engines
            .keys()
            .filter(|name| only.is_none_or(|one| one == *name))
            .filter_map(|name| self.make_instrument(name, case))
            .collect();
        let known = KnownDeviations::built_in().ok();
        let laws = if laws.is_empty() { LAWS.map(str::to_owned).to_vec() } else { laws.to_vec() };
        let options = stress::Options {
            reader: Reader::bare(self.site, Machine::new(self.jobs)),
            time: 4 * self.limit,
            budget: case.budget,
            limit: self.limit,
            laws: &laws,
            magnitudes: Magnitudes::Mild,
            seed,
            coordinates: Coordinates::Fitted,
            known: known.as_ref().map_or(&[], KnownDeviations::breaks),
        };
        let report = stress::stress(case, &subjects, &options, &SilentProgress);
        let broken = report.laws.into_iter().filter(|l| l.how.is_some() && l.known.is_empty());
        broken.filter_map(broken_law_sighting).collect()
    }

    /// Makes an engine with its settings; `None` where it is not installed.
    pub(super) fn make_instrument(&self, name: &EngineName, case: &Case) -> Option<Instrument> {
        let folder = case.path.parent().unwrap_or(Path::new(""));
        let settings = self.engines.get(name).cloned().unwrap_or_default();
        let engine: Arc<dyn luxproof_engines::Engine> =
            Arc::from(luxproof_engines::named(name, &settings.0, folder).ok()?);
        let version = engine.probe(self.site).ok()?;
        Some(Instrument { engine, version })
    }
}

/// The sighting of a broken law.
fn broken_law_sighting(law: stress::LawReport) -> Option<Sighting> {
    let how = law.how?;
    let point = law.points.iter().find(|p| p.how() == Some(how))?;
    let deviation = law.worst_deviation.map(|d| format!(", off by {:.3} %", 100.0 * d)).unwrap_or_default();
    Some(Sighting {
        symptom: Symptom { engine: law.engine, procedure: point.procedure, oracle: Oracle::Law { law: law.law, how } },
        comparison: None,
        p_value: 0.0,
        size: law.worst_deviation,
        text: Some(format!("{}{deviation}", law.what)),
    })
}

/// The sighting of a panic. It counts for our simulator, because luxproof itself is no engine.
pub(super) fn panic_sighting() -> Sighting {
    let symptom =
        Symptom { engine: EngineName::SIMULATOR, procedure: ProcedureId::DirectIlluminance, oracle: Oracle::Panic };
    Sighting { symptom, comparison: None, p_value: 0.0, size: None, text: None }
}

/// Progress that is not shown: single readings of a hunt are too many.
struct SilentProgress;

impl Progress for SilentProgress {
    fn planned(&self, _steps: u64) {}
    fn ended(&self, _what: String, _steps: u64) {}
}
