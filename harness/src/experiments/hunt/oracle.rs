//! What is wrong with readings, told without knowing what is right beforehand: verdicts, consensus, failures, needless doubt, laws.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

use std::fmt;

use serde::{Deserialize, Serialize};

use super::draft::Draft;
use super::grammar::Engines;
use crate::audit::{self, AuditError, Calibration, Diagnosis, Options, StatedErrors};
use crate::engines::{self, Coordinates, Site};
use crate::experiments::Progress;
use crate::experiments::stress::{self, Magnitudes};
use crate::judge::{AT_A_JUMP, Comparison, How, KnownDeviations, Sampling, Verdict};
use crate::measure::{Instrument, Machine, Reader};
use crate::plan::Selection;
use crate::record::{EngineName, FailureKind, ProcedureId};
use crate::report::Report;
use crate::spec::{Case, SpecError};
use crate::system::files::FileError;

/// What an engine does wrong, as it is recognised elsewhere.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub struct Symptom {
    pub engine: EngineName,
    pub procedure: ProcedureId,
    pub oracle: Oracle,
}

/// Who says that something is wrong.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Oracle {
    /// A reading lies off its reference, by more than is allowed and than chance brings about.
    Verdict(Sign),
    /// It departs from the other witnesses, as it does not from its reference, or is that itself.
    Consensus,
    /// Nothing was read.
    Failure(FailureKind),
    /// A comparison stays undecided that no sample can decide.
    Undecided,
    /// A law of light is broken by its own readings.
    Law { law: String, how: How },
    /// This program itself did not survive it.
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

/// A symptom in a spec, where it shows most.
#[derive(Clone, Debug)]
pub(super) struct Sighting {
    pub(super) symptom: Symptom,
    /// At the meter where it is worst, where it is one of a meter.
    pub(super) comparison: Option<Comparison>,
    /// How probable that would be by chance.
    pub(super) p_value: f64,
    /// Relative deviation, where there is one.
    pub(super) size: Option<f64>,
    /// What the engine or the law says.
    pub(super) text: Option<String>,
}

impl Sighting {
    /// The fault that explains the failing reading, where one does.
    pub(super) fn diagnosis(&self) -> Option<String> {
        self.comparison.as_ref().filter(|c| c.verdict == Verdict::Fail)?.diagnosis.clone()
    }
}

/// What of a report is about one case.
struct OfCase<'a> {
    report: &'a Report,
    case: &'a str,
}

/// Everything that is wrong in a case of a report, one sighting a symptom, engine by engine and procedure by procedure.
pub(super) fn sightings(report: &Report, case: &str, hunted: &Engines) -> Vec<Sighting> {
    let of = OfCase { report, case };
    let mut found = vec![];
    for engine in hunted.keys() {
        for &procedure in ProcedureId::ALL {
            found.extend(of.verdict(engine, procedure).into_iter().chain(of.failure(engine, procedure)));
            found.extend(of.undecided(engine, procedure).into_iter().chain(of.departure(engine, procedure)));
        }
    }
    found
}

impl OfCase<'_> {
    fn comparisons(&self, engine: &EngineName, procedure: ProcedureId) -> impl Iterator<Item = &Comparison> {
        self.report.comparisons.iter().filter(move |c| c.key.is_of(self.case, procedure) && c.key.engine == *engine)
    }

    fn worst<'a>(all: impl Iterator<Item = &'a Comparison>) -> Option<&'a Comparison> {
        let off = |c: &Comparison| c.normalized_error().map_or(f64::INFINITY, f64::abs);
        all.max_by(|a, b| off(a).total_cmp(&off(b)))
    }

    /// What an engine of ours declares of its method where it reads is no news.
    fn verdict(&self, engine: &EngineName, procedure: ProcedureId) -> Option<Sighting> {
        let is_news = |c: &&Comparison| c.verdict == Verdict::Fail && self.report.declared(c).is_none();
        let failing = self.comparisons(engine, procedure).filter(is_news);
        let worst = Self::worst(failing)?;
        let sign = if worst.deviation? > 0.0 { Sign::TooMuch } else { Sign::TooLittle };
        Some(Self::sighting(engine, procedure, Oracle::Verdict(sign), worst))
    }

    fn sighting(engine: &EngineName, procedure: ProcedureId, oracle: Oracle, worst: &Comparison) -> Sighting {
        Sighting {
            symptom: Symptom { engine: engine.clone(), procedure, oracle },
            comparison: Some(worst.clone()),
            p_value: worst.p_value.unwrap_or(0.0),
            size: worst.relative_deviation,
            text: None,
        }
    }

    fn failure(&self, engine: &EngineName, procedure: ProcedureId) -> Option<Sighting> {
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

    /// What claims no chance and is undecided all the same is so for its bound or that of its reference. A program of a user's may
    /// state what bounds it likes; at the edge of a jump there are two answers, and nobody fails.
    fn undecided(&self, engine: &EngineName, procedure: ProcedureId) -> Option<Sighting> {
        engines::entry(engine)?;
        let has_one_answer = |c: &&Comparison| c.diagnosis.as_deref() != Some(AT_A_JUMP);
        let undecided = |c: &&Comparison| c.verdict == Verdict::Inconclusive && !c.uncertainty.is_sampled();
        let needless = |c: &&Comparison| undecided(c) && has_one_answer(c);
        let worst = Self::worst(self.comparisons(engine, procedure).filter(needless))?;
        Some(Self::sighting(engine, procedure, Oracle::Undecided, worst))
    }

    /// Where its verdict has said so already, the others add nothing.
    fn departure(&self, engine: &EngineName, procedure: ProcedureId) -> Option<Sighting> {
        let of = |c: &&crate::judge::Consensus| c.case == self.case && c.procedure == procedure;
        let consensus = self.report.consensus.iter().find(of)?;
        let is_named = consensus.departs.iter().any(|name| engine == name);
        let has_failed = self.comparisons(engine, procedure).any(|c| c.verdict == Verdict::Fail);
        let odds = consensus.odds.filter(|_| is_named && !has_failed)?;
        let worst = Self::worst(self.comparisons(engine, procedure).filter(|c| c.deviation.is_some()));
        Some(Sighting {
            symptom: Symptom { engine: engine.clone(), procedure, oracle: Oracle::Consensus },
            comparison: worst.cloned(),
            p_value: 1.0 / (1.0 + odds),
            size: worst.and_then(|c| c.relative_deviation),
            text: Some(consensus.text.clone()),
        })
    }
}

/// Laws that every engine must keep, whatever the scene.
const LAWS: [&str; 8] =
    ["dimming", "superposition", "scale_up", "turned_room", "mirror", "turned_luminaire", "fine_table", "reflectance"];

/// Runs engines on drafts and says what is wrong.
pub(super) struct Tribunal<'a> {
    pub(super) site: &'a Site,
    pub(super) engines: &'a Engines,
    pub(super) jobs: usize,
    /// Past this a reading of a law hangs.
    pub(super) limit: Duration,
}

/// What is asked of the engines.
#[derive(Clone, Debug)]
pub(super) struct Question {
    /// Only this symptom, where one is followed up.
    pub(super) symptom: Option<Symptom>,
    pub(super) procedures: Vec<ProcedureId>,
    pub(super) look: Look,
}

/// How closely engines are looked at.
#[derive(Clone, Copy, Debug)]
pub(super) struct Look {
    pub(super) seed: u64,
    pub(super) diagnosis: Diagnosis,
    pub(super) stated_errors: StatedErrors,
}

impl Look {
    /// For a verdict alone.
    pub(super) const fn with(seed: u64) -> Self {
        Self { seed, diagnosis: Diagnosis::LeftOut, stated_errors: StatedErrors::LookedInto }
    }
}

/// What an audit of several specs gave.
pub(super) enum Tried {
    Report(Box<Report>),
    /// One of them is no spec, or says nothing of what is asked.
    NoSpec(SpecError),
    /// This program panicked.
    Panicked,
}

impl Tribunal<'_> {
    pub(super) fn audit(&self, specs: &[PathBuf], question: &Question, out: &Path) -> Result<Tried, AuditError> {
        let engines = match &question.symptom {
            // Whoever departs from others departs from all of them.
            Some(symptom) if symptom.oracle != Oracle::Consensus => vec![symptom.engine.to_string()],
            _ => self.engines.keys().map(ToString::to_string).collect(),
        };
        let procedures = question.symptom.as_ref().map_or_else(|| question.procedures.clone(), |s| vec![s.procedure]);
        let options = Options {
            jobs: self.jobs,
            selection: Selection { engines, procedures, seed: question.look.seed },
            calibration: Calibration::LeftOut,
            diagnosis: question.look.diagnosis,
            stated_errors: question.look.stated_errors,
            sampling: Some(Sampling::Decided),
            ..Options::new(self.site.clone(), out.to_owned())
        };
        match catch_unwind(AssertUnwindSafe(|| audit::run(specs, &options))) {
            Ok(Ok(report)) => Ok(Tried::Report(Box::new(report))),
            Ok(Err(AuditError::Spec(error))) => Ok(Tried::NoSpec(error.first())),
            Ok(Err(other)) => Err(other),
            Err(_) => Ok(Tried::Panicked),
        }
    }

    /// Whether each of several drafts shows a symptom, and how plainly.
    pub(super) fn shows(
        &self,
        drafts: &[&Draft],
        symptom: &Symptom,
        look: Look,
    ) -> Result<Vec<Option<Sighting>>, AuditError> {
        let folder = tempfile::tempdir().map_err(|source| FileError::of(&std::env::temp_dir(), source))?;
        let mut paths: Vec<Option<PathBuf>> = vec![];
        for (k, draft) in drafts.iter().enumerate() {
            let path = draft.write(&folder.path().join(k.to_string()), &format!("c{k}"));
            let path = path.map_err(|source| FileError::of(folder.path(), source))?;
            let sound = Case::load(&path).is_ok_and(|case| case.task(symptom.procedure).is_some());
            paths.push(sound.then_some(path));
        }
        if let Oracle::Law { law, .. } = &symptom.oracle {
            let laws = [law.clone()];
            let broken = |path: &Option<PathBuf>| {
                let case = Case::load(path.as_ref()?).ok()?;
                self.broken(&case, Some(&symptom.engine), &laws, look.seed).into_iter().find(|s| s.symptom == *symptom)
            };
            return Ok(paths.iter().map(broken).collect());
        }
        let sound: Vec<PathBuf> = paths.iter().flatten().cloned().collect();
        let mut found: Vec<Option<Sighting>> = vec![None; drafts.len()];
        if sound.is_empty() {
            return Ok(found);
        }
        let question = Question { symptom: Some(symptom.clone()), procedures: vec![], look };
        match self.audit(&sound, &question, &folder.path().join("out"))? {
            Tried::Report(report) => {
                for (k, _) in paths.iter().enumerate().filter(|(_, path)| path.is_some()) {
                    let all = sightings(&report, &format!("c{k}"), self.engines);
                    found[k] = all.into_iter().find(|s| s.symptom == *symptom);
                }
            }
            Tried::NoSpec(error) => tracing::debug!("{error}"),
            Tried::Panicked if sound.len() == 1 => {
                found.iter_mut().zip(&paths).filter(|(_, path)| path.is_some()).for_each(|(found, _)| {
                    *found = Some(panicked()).filter(|s| s.symptom == *symptom);
                });
            }
            // Who of them it was shows one by one.
            Tried::Panicked => {
                for (k, draft) in drafts.iter().enumerate().filter(|(k, _)| paths[*k].is_some()) {
                    found[k] = self.shows(&[draft], symptom, look)?.pop().flatten();
                }
            }
        }
        Ok(found)
    }

    /// The laws that engines, or one of them, break in a case when they are mildly tried.
    pub(super) fn broken(&self, case: &Case, only: Option<&EngineName>, laws: &[String], seed: u64) -> Vec<Sighting> {
        let subjects: Vec<Instrument> = self
            .engines
            .keys()
            .filter(|name| only.is_none_or(|one| one == *name))
            .filter_map(|name| self.instrument(name, case))
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
        let report = stress::stress(case, &subjects, &options, &Unseen);
        let broken = report.laws.into_iter().filter(|l| l.how.is_some() && l.known.is_empty());
        let sighting = |law: stress::LawReport| {
            let how = law.how?;
            let point = law.points.iter().find(|p| p.how() == Some(how))?;
            let off = law.worst_deviation.map(|d| format!(", off by {:.3} %", 100.0 * d)).unwrap_or_default();
            Some(Sighting {
                symptom: Symptom {
                    engine: law.engine,
                    procedure: point.procedure,
                    oracle: Oracle::Law { law: law.law, how },
                },
                comparison: None,
                p_value: 0.0,
                size: law.worst_deviation,
                text: Some(format!("{}{off}", law.what)),
            })
        };
        broken.filter_map(sighting).collect()
    }

    pub(super) fn instrument(&self, name: &EngineName, case: &Case) -> Option<Instrument> {
        let folder = case.path.parent().unwrap_or(Path::new(""));
        let settings = self.engines.get(name).cloned().unwrap_or_default();
        let engine: Arc<dyn engines::Engine> = Arc::from(engines::named(name, &settings.0, folder).ok()?);
        let version = engine.probe(self.site).ok()?;
        Some(Instrument { engine, version })
    }
}

/// What a panic is told as.
pub(super) fn panicked() -> Sighting {
    let symptom =
        Symptom { engine: EngineName::SIMULATOR, procedure: ProcedureId::DirectIlluminance, oracle: Oracle::Panic };
    Sighting { symptom, comparison: None, p_value: 0.0, size: None, text: None }
}

/// Nobody watches single readings of a hunt.
struct Unseen;

impl Progress for Unseen {
    fn planned(&self, _steps: u64) {}
    fn ended(&self, _what: String, _steps: u64) {}
}
