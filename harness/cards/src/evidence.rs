//! The evidence of reports: how an engine did in each case that shows a capability.

use std::collections::{BTreeMap, BTreeSet, HashMap};

use itertools::Itertools;
use luxproof_model::numbers::trimmed;
use luxproof_model::{
    Basis, Bias, CaseRecord, Comparison, DeviationKind, EngineName, FailureKind, HiddenVariant, KnownDeviationOutcome,
    ProcedureId, ReadingKey, Recording, Report, Role, Skip, SkipCause, Verdict,
};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::{Capabilities, Capability, CapabilityId, Deviation, RunId, StatedTolerance};

/// The name of the scenes of known answer in capabilities.
const CALIBRATION: &str = "calibration";
/// Points of a case that a page lists; the report has all.
const LISTED_POINTS: usize = 8;

/// How an engine did in one procedure of one case.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct CaseEvidence {
    /// The case as capabilities name it: of a hidden variant the public case.
    pub case: String,
    /// The name of the case in its report.
    pub reported_as: String,
    pub title: String,
    /// The path of its spec, as it was given.
    pub spec: String,
    pub procedure: ProcedureId,
    /// Null for a public case.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub hidden: Option<HiddenVariant>,
    pub run: RunId,
    /// The engine's name in its report, such as `mitsuba@3.5.2`.
    pub engine: EngineName,
    /// Hash of what was measured, independent of names.
    pub content_sha256: String,
    /// What the engine remarked about its values.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub notes: Vec<String>,
    /// Whether `luxproof export` writes a scene of it, with the command that runs it by hand.
    #[serde(default)]
    pub is_exportable: bool,
    pub outcome: Outcome,
}

/// What came of a case.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "outcome", rename_all = "snake_case")]
pub enum Outcome {
    Measured(Measurement),
    /// The engine declined it.
    Unsupported {
        reason: String,
    },
    /// It was not run, or nothing could be compared.
    NotRun {
        reason: String,
    },
    /// The engine gave no usable values, and did not refuse the case either.
    Failed {
        failure: FailureKind,
        reason: String,
    },
}

/// The values of a case against their references.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Measurement {
    pub verdicts: VerdictCounts,
    /// The deviation with the largest bound; null where no reference is above zero.
    pub worst: Option<Deviation>,
    /// Why it is not accurate; empty if every point passes.
    pub remarks: Vec<Remark>,
    /// How far its points may be from their references, each limit once.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub tolerances: Vec<StatedTolerance>,
    /// The points with the largest bounds, at most eight.
    pub points: Vec<PointEvidence>,
}

/// The number of comparisons by verdict.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct VerdictCounts {
    pub all: usize,
    pub passed: usize,
    pub failed: usize,
    pub undecided: usize,
    pub known: usize,
    pub not_judged: usize,
}

/// Why a measurement is not accurate.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum Remark {
    /// Something is wrong.
    Fault {
        text: String,
        points: usize,
        /// The deviation with the largest bound among these points.
        worst: Option<Deviation>,
        /// A point with this deviation.
        at: Option<String>,
    },
    /// The method or a setting approximates, or claims nothing here.
    Limit { text: String, points: usize, worst: Option<Deviation>, at: Option<String> },
    /// More samples would decide.
    Undecided { points: usize, worst: Option<Deviation>, at: Option<String> },
}

/// One comparison.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct PointEvidence {
    pub meter: String,
    pub value: f64,
    pub reference: f64,
    pub unit: String,
    pub deviation: Deviation,
    pub verdict: Verdict,
    /// Formula, solver or paper behind the reference.
    pub source: String,
}

/// A report, sorted by what cards look for: each reading is looked up once, however many engines and cases there are.
pub(crate) struct ReportIndex<'a> {
    report: &'a Report,
    comparisons: HashMap<&'a ReadingKey, Vec<&'a Comparison>>,
    recordings: HashMap<&'a ReadingKey, &'a Recording>,
    skips: HashMap<&'a ReadingKey, &'a Skip>,
    known_deviations: HashMap<&'a ReadingKey, Vec<&'a KnownDeviationOutcome>>,
    bias: HashMap<&'a ReadingKey, Vec<&'a Bias>>,
    /// What was asked of each engine: the place of the case in the report, and the procedure.
    jobs: HashMap<&'a EngineName, BTreeSet<(usize, ProcedureId)>>,
    /// The capabilities that a procedure of a case shows.
    shown: HashMap<(&'a str, ProcedureId), Vec<&'a Capability>>,
}

impl<'a> ReportIndex<'a> {
    pub(crate) fn new(report: &'a Report, capabilities: &'a Capabilities) -> Self {
        let mut recordings: HashMap<&ReadingKey, &Recording> = HashMap::new();
        let mut skips: HashMap<&ReadingKey, &Skip> = HashMap::new();
        for recording in &report.recordings {
            recordings.insert(&recording.key, recording);
        }
        for skip in report.skips.iter().filter(|skip| skip.scope.leaves_no_reading()) {
            skips.entry(&skip.key).or_insert(skip);
        }
        let mut places: HashMap<&str, usize> = HashMap::new();
        for (place, record) in report.cases.iter().enumerate() {
            places.entry(&record.name).or_insert(place);
        }
        let mut jobs: HashMap<&EngineName, BTreeSet<(usize, ProcedureId)>> = HashMap::new();
        for key in recordings.keys().chain(skips.keys()) {
            if let Some(place) = places.get(key.case.as_str()) {
                jobs.entry(&key.engine).or_default().insert((*place, key.procedure));
            }
        }
        Self {
            report,
            comparisons: report.comparisons.iter().map(|c| (&c.key, c)).into_group_map(),
            recordings,
            skips,
            known_deviations: report.known_deviations.iter().map(|known| (&known.key, known)).into_group_map(),
            bias: report.bias.iter().map(|bias| (&bias.key, bias)).into_group_map(),
            jobs,
            shown: capabilities.by_procedure(),
        }
    }

    /// The evidence about an engine by capability, each in the order of the report.
    pub(crate) fn evidence(&self, engine: &EngineName, run: &RunId) -> BTreeMap<&'a CapabilityId, Vec<CaseEvidence>> {
        let mut found: BTreeMap<&CapabilityId, Vec<CaseEvidence>> = BTreeMap::new();
        for (place, procedure) in self.jobs.get(engine).into_iter().flatten() {
            let Some(record) = self.report.cases.get(*place) else { continue };
            for capability in self.shown.get(&(case_name(record), *procedure)).into_iter().flatten() {
                found
                    .entry(&capability.id)
                    .or_default()
                    .extend(self.case_evidence(record, *procedure, engine, run, capability));
            }
        }
        found
    }

    fn case_evidence(
        &self,
        record: &CaseRecord,
        procedure: ProcedureId,
        engine: &EngineName,
        run: &RunId,
        capability: &Capability,
    ) -> Option<CaseEvidence> {
        let key = ReadingKey::new(&record.name, procedure, engine.clone());
        let outcome = self.outcome(&key, capability)?;
        let recording = self.recordings.get(&key);
        Some(CaseEvidence {
            case: case_name(record).to_owned(),
            reported_as: record.name.clone(),
            title: record.spec.title.clone(),
            spec: record.spec.path.clone(),
            procedure,
            hidden: record.hidden_variant.clone(),
            run: run.clone(),
            engine: engine.clone(),
            content_sha256: recording.map(|r| r.content_sha256.clone()).unwrap_or_default(),
            notes: recording.map(|r| r.notes.iter().map(|note| public_text(note)).collect()).unwrap_or_default(),
            is_exportable: recording.is_some_and(|r| r.command.is_some()) && !record.is_calibration,
            outcome,
        })
    }

    /// What came of a job; `None` where the run did not ask for it.
    fn outcome(&self, key: &ReadingKey, capability: &Capability) -> Option<Outcome> {
        let Some(recording) = self.recordings.get(key) else { return self.skipped(key) };
        // Somebody ran recorded programs with the files themselves.
        if capability.reads_files && !recording.reads_files && recording.role != Role::Recorded {
            let reason = "it reads no photometric file here: luxproof reads it and passes the table on".to_owned();
            return Some(Outcome::Unsupported { reason });
        }
        if let Some(reason) = &recording.failure {
            return Some(failed(recording.failure_kind, public_text(reason), capability));
        }
        let judged = self.comparisons.get(key).into_iter().flatten().copied().filter(|c| is_judge(c));
        let judged: Vec<&Comparison> = judged.collect();
        if judged.is_empty() {
            return Some(Outcome::NotRun { reason: "there is no independent reference".to_owned() });
        }
        let measurement = self.measurement(recording, &judged);
        // Too few samples show no fault: their errors are too uncertain.
        if let Some(part) = recording.cut_to.filter(|_| measurement.has_fault()) {
            return Some(cut_short(part));
        }
        if let Some(why) = capability.why_not_shown_by(&key.engine).filter(|_| !measurement.has_fault()) {
            return Some(Outcome::Unsupported { reason: why.to_owned() });
        }
        Some(Outcome::Measured(measurement))
    }

    fn skipped(&self, key: &ReadingKey) -> Option<Outcome> {
        let skip = self.skips.get(key)?;
        let reason = skip.reason.clone();
        Some(match skip.cause {
            SkipCause::Unsupported => Outcome::Unsupported { reason },
            SkipCause::Absent | SkipCause::Other => Outcome::NotRun { reason },
        })
    }

    fn measurement(&self, recording: &Recording, judged: &[&Comparison]) -> Measurement {
        let mut remarks: BTreeMap<RemarkKey, Vec<&Comparison>> = BTreeMap::new();
        for c in judged {
            if let Some(key) = self.remark_key(c) {
                remarks.entry(key).or_default().push(c);
            }
        }
        let mut remarks: Vec<Remark> = remarks.into_iter().map(|(key, points)| key.remark(&points)).collect();
        remarks.extend(self.remarks_on_errors(recording, judged));
        let points = judged.iter().filter_map(|c| PointEvidence::of(c));
        let points: Vec<PointEvidence> =
            points.sorted_by(|a, b| b.deviation.bound().total_cmp(&a.deviation.bound())).collect();
        Measurement {
            verdicts: VerdictCounts::of(judged),
            worst: points.first().map(|point| point.deviation),
            remarks,
            tolerances: StatedTolerance::all_of(judged.iter().map(|c| StatedTolerance::of(c))),
            points: points.into_iter().take(LISTED_POINTS).collect(),
        }
    }

    /// Why a comparison is not accurate; `None` if it is.
    fn remark_key(&self, c: &Comparison) -> Option<RemarkKey> {
        let cause = c.diagnosis.clone();
        match c.verdict {
            // An unexpected pass lies within its tolerance: the record of the deviation is out of date.
            Verdict::Pass | Verdict::UnexpectedPass => None,
            Verdict::Undecided => Some(RemarkKey::Undecided),
            Verdict::NotJudged => {
                Some(RemarkKey::Limit(cause.unwrap_or_else(|| "its method claims nothing here".to_owned())))
            }
            Verdict::KnownDeviation => {
                let cause = cause.unwrap_or_else(|| "a known deviation".to_owned());
                Some(if self.is_limit(c) { RemarkKey::Limit(cause) } else { RemarkKey::Fault(cause) })
            }
            Verdict::Fail => match self.recordings.get(&c.key).and_then(|recording| recording.declared(c)) {
                Some(approximation) => Some(RemarkKey::Limit(format!("it declares: {approximation}"))),
                None => Some(RemarkKey::Fault(cause.unwrap_or_default())),
            },
            Verdict::Missing => Some(RemarkKey::Fault("it gave no value".to_owned())),
        }
    }

    /// Whether the known deviation behind a verdict is a limit of the method.
    fn is_limit(&self, c: &Comparison) -> bool {
        let outcomes = self.known_deviations.get(&c.key).into_iter().flatten();
        let mut entries = outcomes.map(|known| &known.entry).filter(|entry| {
            let is_basis = entry.basis.is_none_or(|basis| c.basis() == Some(basis));
            is_basis && entry.is_at(c) && c.diagnosis.as_deref() == Some(entry.summary().as_str())
        });
        entries.next().is_some_and(|entry| entry.kind == DeviationKind::Limit)
    }

    /// Faults of means and of stated errors, which no single point shows.
    fn remarks_on_errors(&self, recording: &Recording, judged: &[&Comparison]) -> Vec<Remark> {
        let mut remarks = vec![];
        let biases = self.bias.get(&recording.key).into_iter().flatten().filter(|bias| bias.fails);
        for bias in
            biases.filter(|bias| !judged.iter().any(|c| c.verdict == Verdict::Fail && c.basis() == Some(bias.basis)))
        {
            let text = format!("the mean of {} points is off by {:+.2} %", bias.readings, 100.0 * bias.mean);
            remarks.push(Remark::Fault { text, points: bias.readings, worst: None, at: None });
        }
        for stated in recording.stated_errors.iter().filter(|stated| stated.is_failed_claim()) {
            let text = format!("the errors that it states are refuted by repetition: {stated}");
            remarks.push(Remark::Fault { text, points: judged.len(), worst: None, at: None });
        }
        remarks
    }
}

/// The outcome of a job without usable values.
///
/// An engine that refuses the job and says why does not support it. A parser that ends with an error and a message refuses its file.
/// Whatever else gives no values fails: a user learns nothing from a crash.
fn failed(kind: Option<FailureKind>, reason: String, capability: &Capability) -> Outcome {
    // Reports of older versions name no kind.
    let kind = kind.unwrap_or(FailureKind::Crash);
    match kind {
        FailureKind::Declined => Outcome::Unsupported { reason },
        FailureKind::Interrupted | FailureKind::TimeUp | FailureKind::Unread => Outcome::NotRun { reason },
        FailureKind::Refused | FailureKind::ErrorExit if capability.reads_files => {
            Outcome::Unsupported { reason: format!("it does not read the file: {reason}") }
        }
        FailureKind::Refused => Outcome::Unsupported { reason: format!("it refuses the case: {reason}") },
        FailureKind::ErrorExit
        | FailureKind::Crash
        | FailureKind::Hang
        | FailureKind::Nan
        | FailureKind::SilentLoss
        | FailureKind::Garbled => Outcome::Failed { failure: kind, reason },
    }
}

/// The outcome of a job that the clock cut to a part of its samples.
fn cut_short(part: f64) -> Outcome {
    let reason = format!(
        "the time limit cut it to {} % of its samples, so its values decide nothing",
        trimmed(100.0 * part.clamp(0.0, 1.0), 1)
    );
    Outcome::Failed { failure: FailureKind::Hang, reason }
}

impl Measurement {
    fn has_fault(&self) -> bool {
        self.remarks.iter().any(|remark| matches!(remark, Remark::Fault { .. }))
    }
}

/// The message of an engine in one line, without the places of files on the machine that ran it.
///
/// The last line comes first: there a program says why it ends. Lines that only underline the one above go, as in Python's tracebacks.
fn public_text(reason: &str) -> String {
    let lines = reason.lines().filter(|line| !line.starts_with("all its messages are in "));
    let lines = lines.filter(|line| line.trim().is_empty() || line.contains(|c: char| !matches!(c, '^' | '~' | ' ')));
    let lines: Vec<String> = lines.map(with_file_names).collect();
    let lines: Vec<&str> = lines.iter().map(|line| without_path(line)).filter(|line| !line.is_empty()).collect();
    match lines.split_last() {
        Some((last, before)) if !before.is_empty() => format!("{last}; before that: {}", before.join("; ")),
        _ => lines.concat(),
    }
}

/// A line with the names of files in place of quoted absolute paths.
fn with_file_names(line: &str) -> String {
    let mut parts = line.split('"').map(|part| match part.rsplit_once('/') {
        Some((_, name)) if part.starts_with('/') => name,
        _ => part,
    });
    // What was no UTF-8 says nothing.
    parts.join("\"").replace(char::REPLACEMENT_CHARACTER, "")
}

/// A line up to the first absolute path in it.
fn without_path(line: &str) -> &str {
    let end = line.find(" /").or_else(|| line.starts_with('/').then_some(0)).unwrap_or(line.len());
    line[..end].trim().trim_end_matches(['-', ':', ' '])
}

/// The name of a case in capabilities.
fn case_name(record: &CaseRecord) -> &str {
    match &record.hidden_variant {
        _ if record.is_calibration => CALIBRATION,
        Some(variant) => &variant.of,
        None => &record.name,
    }
}

/// Whether a comparison judges an engine: other engines and hand methods are no references, nor are unreliable prints.
fn is_judge(c: &Comparison) -> bool {
    match &c.reference {
        None => c.verdict == Verdict::Missing && c.value.is_none(),
        Some(reference) => match reference.basis {
            Basis::ClosedForm | Basis::Simulator => true,
            Basis::Published => reference.caveat.is_none(),
            Basis::Iesna | Basis::Engine => false,
        },
    }
}

/// What comparisons have in common that are not accurate.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum RemarkKey {
    Fault(String),
    Limit(String),
    Undecided,
}

impl RemarkKey {
    fn remark(self, comparisons: &[&Comparison]) -> Remark {
        let with_deviation = comparisons.iter().filter_map(|c| Some((Deviation::of(c)?, c.meter.to_string())));
        let (worst, at) = with_deviation.max_by(|(a, _), (b, _)| a.bound().total_cmp(&b.bound())).unzip();
        let points = comparisons.len();
        match self {
            Self::Fault(text) => Remark::Fault { text, points, worst, at },
            Self::Limit(text) => Remark::Limit { text, points, worst, at },
            Self::Undecided => Remark::Undecided { points, worst, at },
        }
    }
}

impl VerdictCounts {
    fn of(judged: &[&Comparison]) -> Self {
        let mut counts = Self { all: judged.len(), ..Self::default() };
        for c in judged {
            let count = match c.verdict {
                Verdict::Pass | Verdict::UnexpectedPass => &mut counts.passed,
                Verdict::Fail | Verdict::Missing => &mut counts.failed,
                Verdict::Undecided => &mut counts.undecided,
                Verdict::KnownDeviation => &mut counts.known,
                Verdict::NotJudged => &mut counts.not_judged,
            };
            *count += 1;
        }
        counts
    }
}

impl PointEvidence {
    fn of(c: &Comparison) -> Option<Self> {
        let reference = c.reference.as_ref()?;
        Some(Self {
            meter: c.meter.to_string(),
            value: c.value?,
            reference: reference.value,
            unit: c.quantity.unit().to_owned(),
            deviation: Deviation::of(c)?,
            verdict: c.verdict,
            source: reference.source.clone(),
        })
    }
}
