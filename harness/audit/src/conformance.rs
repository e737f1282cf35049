//! Examines a user's adapter: it reads the scenes of known answer, and each topic gets a standing and findings.

use std::collections::BTreeMap;
use std::fmt;
use std::path::Path;

use itertools::Itertools;
use serde_json::{Value, json};

use super::{AuditError, Diagnosis, Options, Subjects, examine};
use luxproof_engines::Introduction;
use luxproof_model::{Comparison, Verdict};
use luxproof_model::{ErrorFinding, FailureKind, ProcedureId, Recording, Status, Uncertainty};
use luxproof_model::{Exit, Report};
use luxproof_spec::procedures::known;
use luxproof_spec::{Case, EngineSettings, SpecError};
use luxproof_verdict::diagnosis::{self, Aspect, Cause, Examined, Explained};

/// The adapter's name while it is examined.
const ADAPTER: &str = "adapter";

/// The largest relative error of a reading that is called exact and computed in 32-bit floats.
const MAX_FLOAT_ERROR: f64 = 1e-5;
/// The largest relative error of a sum in 64-bit floats.
const MAX_DOUBLE_ERROR: f64 = 1e-9;

/// A topic of the examination.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Topic {
    Protocol,
    /// Each meter has one finite reading, in the order of the meters.
    Meters,
    Units,
    /// The orientation of tables, luminaires and meters.
    Orientation,
    Shadows,
    ReflectedLight,
    /// Standard errors, compared with readings of other seeds.
    Noise,
    /// Readings that the adapter calls exact or bounded.
    Claims,
}

/// The result for a topic; later ones are worse.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Standing {
    Sound,
    NotExamined,
    Undecided,
    Wrong,
}

/// A topic and its findings.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Section {
    pub topic: Topic,
    pub standing: Standing,
    pub findings: Vec<String>,
}

/// The result of an examination.
#[derive(Clone, Debug)]
pub struct Conformance {
    /// How the adapter introduces itself.
    pub said: String,
    /// All topics, in their order.
    pub sections: Vec<Section>,
}

/// Lets a program read the scenes of known answer and examines its readings.
///
/// Paths in its command are relative to `folder`.
pub fn examine_adapter(
    command: &[String],
    folder: &Path,
    options: Options<'_>,
) -> Result<(Report, Conformance), AuditError> {
    let settings: BTreeMap<String, Value> = BTreeMap::from([("command".to_owned(), json!(command))]);
    let introduction = luxproof_engines::introduction(ADAPTER, &settings, folder, &options.site)
        .map_err(|error| SpecError::of("--adapter", error.to_string(), "give a program and its arguments"))?;
    let case = Case {
        path: folder.join("--adapter"),
        engines: Some(BTreeMap::from([(ADAPTER.to_owned(), EngineSettings(settings))])),
        ..Case::default()
    };
    let mut options = Options { diagnosis: Diagnosis::LeftOut, ..options };
    options.selection.engines = vec![ADAPTER.to_owned()];
    let mut report = examine(Subjects::Of(case.into()), &options)?;
    let tasks = known::tasks();
    let mut examined = Examined::new(&tasks, &mut report.comparisons);
    examined.is_lenient = true;
    examined.silent =
        report.recordings.iter().filter(|r| r.states_heavy_tail()).map(|r| r.key.engine.clone()).collect();
    let explained = diagnosis::explained(&mut [examined]);
    let conformance = Conformance::from_report(&introduction, &report, &explained);
    Ok((report, conformance))
}

impl Conformance {
    /// Sorts what the report shows of the adapter by topic.
    fn from_report(introduction: &Introduction, report: &Report, explained: &[Explained]) -> Self {
        let recordings: Vec<&Recording> = report.recordings.iter().filter(|r| r.key.engine == *ADAPTER).collect();
        let comparisons: Vec<&Comparison> = report.comparisons.iter().filter(|c| c.key.engine == *ADAPTER).collect();
        let mut findings = Findings::default();
        findings.add_protocol(introduction, report, &recordings);
        let mut exchanged = diagnosis::exchanges(&known::tasks(), &comparisons);
        exchanged.retain(|(procedure, _)| causes_of(explained, *procedure).next().is_none());
        findings.add_readings(&comparisons, explained, &exchanged);
        findings.add_errors(&recordings, &comparisons);
        let sections = Topic::ALL.map(|topic| section(topic, &findings, report, &comparisons));
        Self { said: introduction.to_string(), sections: sections.to_vec() }
    }

    /// The exit code; what an adapter declares that it cannot do is no fault.
    pub fn exit(&self, report: &Report) -> Exit {
        let worst = self.sections.iter().map(|s| s.standing).max();
        let exit = match worst {
            Some(Standing::Wrong) => Exit::Failed,
            Some(Standing::Undecided) => Exit::Undecided,
            _ => Exit::Passed,
        };
        let has_failed = report
            .engines
            .iter()
            .filter(|e| e.id == *ADAPTER)
            .any(|e| matches!(e.status, Status::Failed | Status::Absent | Status::Skipped));
        if has_failed { exit.max(Exit::Engine) } else { exit }
    }
}

impl Topic {
    const ALL: [Self; 8] = [
        Self::Protocol,
        Self::Meters,
        Self::Units,
        Self::Orientation,
        Self::Shadows,
        Self::ReflectedLight,
        Self::Noise,
        Self::Claims,
    ];

    /// Whether a scene of known answer is about the topic.
    const fn is_of(self, procedure: ProcedureId) -> bool {
        match self {
            Self::Protocol | Self::Meters | Self::Noise | Self::Claims => true,
            Self::Units => matches!(procedure, ProcedureId::Point),
            Self::Orientation => matches!(procedure, ProcedureId::Asymmetric | ProcedureId::Luminaires),
            Self::Shadows => matches!(procedure, ProcedureId::Shadow),
            Self::ReflectedLight => matches!(procedure, ProcedureId::Furnace | ProcedureId::Reflectances),
        }
    }

    /// The topic that a scene of known answer is mainly about.
    fn by_scene(procedure: ProcedureId) -> Self {
        let topics = [Self::Units, Self::Orientation, Self::Shadows, Self::ReflectedLight];
        topics.into_iter().find(|topic| topic.is_of(procedure)).unwrap_or(Self::Units)
    }
}

/// The findings of each topic so far.
#[derive(Default)]
struct Findings(BTreeMap<Topic, Vec<(Standing, String)>>);

impl Findings {
    /// Adds a finding, unless an earlier one begins with the same text.
    fn add(&mut self, topic: Topic, standing: Standing, text: String) {
        let all = self.0.entry(topic).or_default();
        // Of two texts about one fault the longer one stays.
        match all.iter_mut().find(|(_, known)| known.starts_with(&text) || text.starts_with(known.as_str())) {
            Some((_, known)) if text.len() > known.len() => *known = text,
            Some(_) => {}
            None => all.push((standing, text)),
        }
    }

    /// Adds what is wrong with the adapter's introduction and its answers.
    fn add_protocol(&mut self, introduction: &Introduction, report: &Report, recordings: &[&Recording]) {
        if let Some(text) = introduction.fault() {
            self.add(Topic::Protocol, Standing::Wrong, text);
        }
        for engine in report.engines.iter().filter(|e| e.id == *ADAPTER && e.status == Status::Absent) {
            self.add(Topic::Protocol, Standing::Wrong, engine.reason.clone().unwrap_or_default());
        }
        // A fault of several scenes appears once; the first of their logs is enough.
        let mut failures: Vec<(Topic, String, Vec<ProcedureId>, &str)> = vec![];
        for recording in recordings {
            let Some(why) = &recording.failure else { continue };
            let topic = match recording.failure_kind {
                Some(FailureKind::Nan | FailureKind::SilentLoss) => Topic::Meters,
                _ => Topic::Protocol,
            };
            let message: String = why.lines().take_while(|line| !line.starts_with("all its messages are in")).collect();
            match failures.iter_mut().find(|(of, known, ..)| *of == topic && *known == message) {
                Some((.., scenes, _)) => scenes.push(recording.key.procedure),
                None => failures.push((topic, message, vec![recording.key.procedure], why)),
            }
        }
        for (topic, _, scenes, why) in failures {
            self.add(topic, Standing::Wrong, format!("{}: {why}", scenes.iter().join(", ")));
        }
        let mut answered = recordings.iter().filter(|r| r.failure.is_none()).peekable();
        if introduction.can_batch()
            && recordings.len() > 1
            && answered.peek().is_some()
            && !answered.any(|r| r.effort.contains_key("jobs_at_once"))
        {
            let text =
                "its capabilities have `batch`, but several jobs at once gave nothing: they were asked one by one";
            self.add(Topic::Protocol, Standing::Wrong, text.to_owned());
        }
    }

    /// Adds what is wrong with the readings, scene by scene.
    fn add_readings(
        &mut self,
        comparisons: &[&Comparison],
        explained: &[Explained],
        exchanged: &[(ProcedureId, String)],
    ) {
        let mut by_procedure: BTreeMap<ProcedureId, Vec<&Comparison>> = BTreeMap::new();
        for comparison in comparisons {
            by_procedure.entry(comparison.key.procedure).or_default().push(comparison);
        }
        let is_any_named = !exchanged.is_empty() || explained.iter().any(|e| !e.causes.is_empty());
        for (procedure, all) in by_procedure {
            let causes: Vec<&Cause> = causes_of(explained, procedure).collect();
            let exchanged = exchanged.iter().find(|(of, _)| *of == procedure);
            let failing = count(&all, Verdict::Fail);
            let failures = format!("{failing} of {} meters of the scene `{procedure}` fail", all.len());
            if let Some((_, what)) = exchanged {
                self.add(Topic::Meters, Standing::Wrong, what.clone());
                self.add(Topic::by_scene(procedure), Standing::Undecided, format!("{failures}, for that reason"));
            } else if failing > 0 && causes.is_empty() {
                let (standing, why) = if is_any_named {
                    (Standing::Undecided, "what is named of another scene may be why, or something else that it hides")
                } else {
                    (Standing::Wrong, "nothing that is known explains it")
                };
                let dark = dark(&all).map(|dark| format!("; {dark}")).unwrap_or_default();
                self.add(Topic::by_scene(procedure), standing, format!("{failures}, {}; {why}{dark}", worst(&all)));
            }
            for cause in causes {
                let topic = topic_of(cause, procedure);
                self.add(topic, Standing::Wrong, cause.what.clone());
                if topic != Topic::by_scene(procedure) {
                    self.add(Topic::by_scene(procedure), Standing::Undecided, format!("{failures}, for that reason"));
                }
            }
            let undecided = count(&all, Verdict::Undecided);
            if undecided > 0 && exchanged.is_none() {
                let text = format!("{undecided} of {} meters of the scene `{procedure}` are undecided", all.len());
                self.add(Topic::by_scene(procedure), Standing::Undecided, text);
            }
        }
    }

    /// Adds what is wrong with the errors that the adapter states.
    fn add_errors(&mut self, recordings: &[&Recording], comparisons: &[&Comparison]) {
        for recording in recordings {
            for stated in recording.stated_errors.iter().filter(|s| s.finding.is_some()) {
                let topic = match stated.finding {
                    Some(ErrorFinding::Scatters | ErrorFinding::BeyondTolerance | ErrorFinding::Refuted) => {
                        Topic::Claims
                    }
                    _ => Topic::Noise,
                };
                self.add(topic, Standing::Wrong, format!("{}: {stated}", recording.key.procedure));
            }
        }
        // A failure has its reason in another section, and its repair also repairs the claims.
        if !comparisons.iter().any(|c| c.verdict == Verdict::Fail)
            && let Some(text) = beyond_bounds(comparisons)
        {
            self.add(Topic::Claims, Standing::Wrong, text);
        }
        if comparisons.iter().any(|c| c.value.is_some() && c.uncertainty == Uncertainty::Unstated) {
            let text = "values come without `std_error_lx`, `error_bound_lx` or `exact`: luxproof assumes nothing about their accuracy";
            self.add(Topic::Claims, Standing::Sound, text.to_owned());
        }
    }
}

/// The section of a topic: its findings, or why it was not examined.
fn section(topic: Topic, findings: &Findings, report: &Report, comparisons: &[&Comparison]) -> Section {
    let found = findings.0.get(&topic).map_or(&[][..], Vec::as_slice);
    let worst = found.iter().map(|(standing, _)| *standing).max();
    let texts = found.iter().map(|(_, text)| text.clone()).collect();
    let is_examined = comparisons.iter().any(|c| c.value.is_some() && topic.is_of(c.key.procedure));
    match worst {
        Some(standing) if standing > Standing::Sound => Section { topic, standing, findings: texts },
        _ if is_examined => Section { topic, standing: Standing::Sound, findings: texts },
        _ => Section { topic, standing: Standing::NotExamined, findings: vec![skip_reason(topic, report)] },
    }
}

/// Why no scene of a topic was read.
fn skip_reason(topic: Topic, report: &Report) -> String {
    let mut skips = report.skips.iter().filter(|s| s.key.engine == *ADAPTER && topic.is_of(s.key.procedure));
    skips.next().map_or_else(|| "nothing of it was read".to_owned(), |skip| skip.reason.clone())
}

/// The causes that the diagnosis names for a scene.
fn causes_of(explained: &[Explained], procedure: ProcedureId) -> impl Iterator<Item = &Cause> {
    explained.iter().filter(move |e| e.key.procedure == procedure).flat_map(|e| &e.causes)
}

/// The topic that a cause belongs to.
fn topic_of(cause: &Cause, procedure: ProcedureId) -> Topic {
    match cause.aspect() {
        Aspect::Units => Topic::Units,
        Aspect::Orientation => Topic::Orientation,
        Aspect::Meters => Topic::Meters,
        Aspect::Light | Aspect::Several => Topic::by_scene(procedure),
    }
}

/// The number of comparisons with a verdict.
fn count(comparisons: &[&Comparison], verdict: Verdict) -> usize {
    comparisons.iter().filter(|c| c.verdict == verdict).count()
}

/// Describes readings within the tolerance that do not lie within what the adapter claims of them.
fn beyond_bounds(comparisons: &[&Comparison]) -> Option<String> {
    let beyond: Vec<f64> = comparisons.iter().filter_map(|c| deviation_beyond_claim(c, comparisons)).collect();
    if beyond.is_empty() {
        return None;
    }
    let largest = beyond.iter().copied().filter(|d| d.is_finite()).fold(0.0, f64::max);
    let claimed = comparisons.iter().filter(|c| matches!(c.uncertainty, Uncertainty::Exact | Uncertainty::Bound(_)));
    Some(format!(
        "{} of {} readings that it calls exact or bounded are off by more than that, by {largest:.1e} of the known value at most, \
         although within the tolerance",
        beyond.len(),
        claimed.count()
    ))
}

/// The relative deviation of a reading that lies beyond its claim; `None` where it lies within, or claims nothing.
fn deviation_beyond_claim(c: &Comparison, all: &[&Comparison]) -> Option<f64> {
    let reference = c.reference.as_ref()?;
    // A dark meter is a sum of terms that cancel, and these are rounded like the scene's other readings.
    let scale = if reference.value == 0.0 { brightest(all, c.key.procedure) } else { reference.value.abs() };
    let claimed = match c.uncertainty {
        Uncertainty::Exact => MAX_FLOAT_ERROR * scale,
        Uncertainty::Bound(bound) => bound,
        _ => return None,
    };
    let known = reference.coverage_factor.unwrap_or(1.0) * reference.uncertainty + MAX_DOUBLE_ERROR * scale;
    let deviation = c.deviation?.abs();
    (deviation > claimed + known).then(|| deviation / scale)
}

/// The largest known value of a scene.
fn brightest(comparisons: &[&Comparison], procedure: ProcedureId) -> f64 {
    let of_scene = comparisons.iter().filter(|c| c.key.procedure == procedure);
    of_scene.filter_map(|c| c.reference.as_ref()).map(|r| r.value.abs()).fold(0.0, f64::max)
}

/// The largest deviation of the failing comparisons: relative to the known value, or in lux where that is zero.
fn worst(comparisons: &[&Comparison]) -> String {
    let relative = largest_of_failures(comparisons, |c| c.relative_deviation);
    let absolute = largest_of_failures(comparisons, |c| c.deviation);
    match (relative, absolute) {
        (Some(relative), _) => format!("by {:+.2} % at most", 100.0 * relative),
        (None, Some(lux)) => format!("by {lux:+.3} lx at most where there should be none"),
        (None, None) => "which have no reading".to_owned(),
    }
}

/// More dark meters than this are counted instead of listed.
const LISTED_METERS: usize = 3;

/// Which meters read nothing where there is light, and where they face.
fn dark(comparisons: &[&Comparison]) -> Option<String> {
    let dark = comparisons.iter().filter(|c| c.verdict == Verdict::Fail && c.value == Some(0.0)).collect::<Vec<_>>();
    let mut listed = vec![];
    for c in dark.iter().take(LISTED_METERS) {
        let [x, y, z] = c.normal.map(|n| (1e3 * n).round() / 1e3);
        listed.push(format!("{} (normal [{x}, {y}, {z}])", c.meter));
    }
    let more = dark.len().saturating_sub(LISTED_METERS);
    let more = if more > 0 { format!(" and {more} more") } else { String::new() };
    (!listed.is_empty()).then(|| format!("0 is read at {}{more}", listed.join(", ")))
}

/// The value of largest magnitude among the failing comparisons.
fn largest_of_failures(comparisons: &[&Comparison], value: fn(&Comparison) -> Option<f64>) -> Option<f64> {
    let failing = comparisons.iter().filter(|c| c.verdict == Verdict::Fail);
    failing.filter_map(|c| value(c)).filter(|d| d.is_finite()).max_by(|a, b| a.abs().total_cmp(&b.abs()))
}

impl fmt::Display for Topic {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Self::Protocol => "protocol",
            Self::Meters => "meters",
            Self::Units => "units",
            Self::Orientation => "orientation",
            Self::Shadows => "shadows",
            Self::ReflectedLight => "reflected light",
            Self::Noise => "noise",
            Self::Claims => "claims",
        })
    }
}

impl fmt::Display for Standing {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Self::Sound => "sound",
            Self::NotExamined => "not examined",
            Self::Undecided => "undecided",
            Self::Wrong => "WRONG",
        })
    }
}

impl fmt::Display for Conformance {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "conformance: {}", self.said)?;
        for Section { topic, standing, findings } in &self.sections {
            let mut findings = findings.iter().flat_map(|text| text.lines());
            let first = findings.next().unwrap_or_default();
            writeln!(f, "{}", format!("  {topic:<16} {standing:<13} {first}").trim_end())?;
            for text in findings {
                writeln!(f, "{:33}{text}", "")?;
            }
        }
        Ok(())
    }
}
