//! What is wrong with a newcomer's adapter, aspect by aspect, by how it reads the scenes of known answer.

use std::collections::BTreeMap;
use std::fmt;
use std::path::Path;

use itertools::Itertools;
use serde_json::{Value, json};

use super::{AuditError, Diagnosis, Options, Subjects, examine};
use crate::diagnosis::{self, Aspect, Examined, Explained};
use crate::engines::{self, Introduction};
use crate::judge::{Comparison, Verdict};
use crate::procedures::known;
use crate::record::{Doubt, EngineName, FailureKind, ProcedureId, Recording, Status, Uncertainty};
use crate::report::{Exit, Report};
use crate::spec::{Case, EngineSettings, SpecError};

/// The adapter's name while it is examined.
const ADAPTER: &str = "adapter";

/// To so many parts a reading of 32-bit floats may be off that is called exact, and any that was added up in 64 bits.
const IN_FLOATS: f64 = 1e-5;
const IN_DOUBLES: f64 = 1e-9;

/// What an adapter is examined for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Topic {
    Protocol,
    /// One finite reading each, in their order.
    Meters,
    Units,
    /// Of tables, luminaires and meters.
    Orientation,
    Shadows,
    ReflectedLight,
    /// Standard errors, held against readings of other seeds.
    Noise,
    /// What is claimed to be exact or within a bound.
    Claims,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Standing {
    Sound,
    NotExamined,
    Undecided,
    Wrong,
}

/// A topic with what was found.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Section {
    pub topic: Topic,
    pub standing: Standing,
    pub findings: Vec<String>,
}

/// What an adapter's examination came to, all topics in their order.
#[derive(Clone, Debug)]
pub struct Conformance {
    pub said: String,
    pub sections: Vec<Section>,
}

/// Lets a program read the scenes of known answer and says what is wrong with it; paths of its command count from `folder`.
pub fn examine_adapter(
    command: &[String],
    folder: &Path,
    options: Options<'_>,
) -> Result<(Report, Conformance), AuditError> {
    let settings: BTreeMap<String, Value> = BTreeMap::from([("command".to_owned(), json!(command))]);
    let introduction = engines::introduction(ADAPTER, &settings, folder, &options.site)
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
    let conformance = Conformance::of(&introduction, &report, &explained);
    Ok((report, conformance))
}

impl Conformance {
    fn of(introduction: &Introduction, report: &Report, explained: &[Explained]) -> Self {
        let is_its = |engine: &EngineName| *engine == *ADAPTER;
        let recordings: Vec<&Recording> = report.recordings.iter().filter(|r| is_its(&r.key.engine)).collect();
        let comparisons: Vec<&Comparison> = report.comparisons.iter().filter(|c| is_its(&c.key.engine)).collect();
        let mut findings = Findings::default();
        findings.of_protocol(introduction, report, &recordings);
        let explains = |p: ProcedureId| explained.iter().any(|e| e.key.procedure == p && !e.causes.is_empty());
        let mut exchanged = diagnosis::exchanges(&known::tasks(), &comparisons);
        exchanged.retain(|(procedure, _)| !explains(*procedure));
        findings.of_readings(&comparisons, explained, &exchanged);
        findings.of_errors(&recordings, &comparisons);
        let examined = |topic: Topic| comparisons.iter().any(|c| c.value.is_some() && topic.is_of(c.key.procedure));
        let skipped = |topic: Topic| {
            let of_topic = report.skips.iter().filter(|s| is_its(&s.key.engine) && topic.is_of(s.key.procedure));
            of_topic.map(|s| s.reason.clone()).next().unwrap_or_else(|| "nothing of it was read".to_owned())
        };
        let section = |topic: Topic| {
            let found = findings.0.get(&topic).cloned().unwrap_or_default();
            let standing = found.iter().map(|(standing, _)| *standing).max();
            let texts = found.into_iter().map(|(_, text)| text).collect();
            match standing {
                Some(standing) if standing > Standing::Sound => Section { topic, standing, findings: texts },
                _ if examined(topic) => Section { topic, standing: Standing::Sound, findings: texts },
                _ => Section { topic, standing: Standing::NotExamined, findings: vec![skipped(topic)] },
            }
        };
        Self { said: introduction.to_string(), sections: Topic::ALL.map(section).to_vec() }
    }

    /// Passed where nothing is wrong, whatever it says that it cannot do.
    pub fn exit(&self, report: &Report) -> Exit {
        let worst = self.sections.iter().map(|s| s.standing).max();
        let own = match worst {
            Some(Standing::Wrong) => Exit::Failed,
            Some(Standing::Undecided) => Exit::Undecided,
            _ => Exit::Passed,
        };
        let is_down = |s: Status| matches!(s, Status::Failed | Status::Absent | Status::Skipped);
        let fares = report.engines.iter().any(|e| e.id == *ADAPTER && is_down(e.status));
        if fares { own.max(Exit::Engine) } else { own }
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

    /// Whether a scene of known answer shows it.
    const fn is_of(self, procedure: ProcedureId) -> bool {
        match self {
            Self::Protocol | Self::Meters | Self::Noise | Self::Claims => true,
            Self::Units => matches!(procedure, ProcedureId::Point),
            Self::Orientation => matches!(procedure, ProcedureId::Asymmetric | ProcedureId::Luminaires),
            Self::Shadows => matches!(procedure, ProcedureId::Shadow),
            Self::ReflectedLight => matches!(procedure, ProcedureId::Furnace | ProcedureId::Reflectances),
        }
    }

    fn by_scene(procedure: ProcedureId) -> Self {
        let of = [Self::Units, Self::Orientation, Self::Shadows, Self::ReflectedLight];
        of.into_iter().find(|topic| topic.is_of(procedure)).unwrap_or(Self::Units)
    }
}

#[derive(Default)]
struct Findings(BTreeMap<Topic, Vec<(Standing, String)>>);

impl Findings {
    fn add(&mut self, topic: Topic, standing: Standing, text: String) {
        let all = self.0.entry(topic).or_default();
        // One thing is told once, by whoever says more of it.
        match all.iter_mut().find(|(_, known)| known.starts_with(&text) || text.starts_with(known.as_str())) {
            Some((_, known)) if text.len() > known.len() => *known = text,
            Some(_) => {}
            None => all.push((standing, text)),
        }
    }

    fn of_protocol(&mut self, introduction: &Introduction, report: &Report, recordings: &[&Recording]) {
        for text in introduction.remarks() {
            self.add(Topic::Protocol, Standing::Wrong, text);
        }
        for engine in report.engines.iter().filter(|e| e.id == *ADAPTER && e.status == Status::Absent) {
            self.add(Topic::Protocol, Standing::Wrong, engine.reason.clone().unwrap_or_default());
        }
        // What is wrong with several scenes alike is told once; the first of their logs is enough.
        let mut failures: Vec<(Topic, String, Vec<ProcedureId>, &str)> = vec![];
        for recording in recordings {
            let Some(why) = &recording.failure else { continue };
            let topic = match recording.failure_kind {
                Some(FailureKind::Nan | FailureKind::SilentLoss) => Topic::Meters,
                _ => Topic::Protocol,
            };
            let alike: String = why.lines().take_while(|line| !line.starts_with("all its messages are in")).collect();
            match failures.iter_mut().find(|(of, known, ..)| *of == topic && *known == alike) {
                Some((.., scenes, _)) => scenes.push(recording.key.procedure),
                None => failures.push((topic, alike, vec![recording.key.procedure], why)),
            }
        }
        if failures.iter().any(|(topic, ..)| *topic == Topic::Protocol)
            && let Some(text) = introduction.why_version_one()
        {
            self.add(Topic::Protocol, Standing::Wrong, text);
        }
        for (topic, _, scenes, why) in failures {
            self.add(topic, Standing::Wrong, format!("{}: {why}", scenes.iter().join(", ")));
        }
        let at_once = |r: &&&Recording| r.effort.contains_key("jobs_at_once");
        let answered: Vec<_> = recordings.iter().filter(|r| r.failure.is_none()).collect();
        if introduction.can_batch() && !answered.is_empty() && recordings.len() > 1 && !answered.iter().any(at_once) {
            let text =
                "its capabilities have `batch`, but several jobs at once gave nothing: they were asked one by one";
            self.add(Topic::Protocol, Standing::Wrong, text.to_owned());
        }
    }

    fn of_readings(
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
            let count = |verdict: Verdict| all.iter().filter(|c| c.verdict == verdict).count();
            let (failing, undecided) = (count(Verdict::Fail), count(Verdict::Inconclusive));
            let causes = explained.iter().filter(|e| e.key.procedure == procedure).flat_map(|e| &e.causes);
            let causes: Vec<_> = causes.collect();
            let exchanged = exchanged.iter().find(|(of, _)| *of == procedure);
            let of = format!("{failing} of {} meters of the scene `{procedure}` fail", all.len());
            if let Some((_, what)) = exchanged {
                self.add(Topic::Meters, Standing::Wrong, what.clone());
                self.add(Topic::by_scene(procedure), Standing::Undecided, format!("{of}, for that reason"));
            } else if failing > 0 && causes.is_empty() {
                let (standing, why) = if is_any_named {
                    (Standing::Undecided, "what is named of another scene may be why, or something else that it hides")
                } else {
                    (Standing::Wrong, "nothing that is known explains it")
                };
                self.add(Topic::by_scene(procedure), standing, format!("{of}, {}; {why}", worst(&all)));
            }
            for cause in causes {
                let topic = match cause.aspect() {
                    Aspect::Units => Topic::Units,
                    Aspect::Orientation => Topic::Orientation,
                    Aspect::Meters => Topic::Meters,
                    Aspect::Light | Aspect::Several => Topic::by_scene(procedure),
                };
                self.add(topic, Standing::Wrong, cause.what.clone());
                if topic != Topic::by_scene(procedure) {
                    self.add(Topic::by_scene(procedure), Standing::Undecided, format!("{of}, for that reason"));
                }
            }
            if undecided > 0 && exchanged.is_none() {
                let text = format!("{undecided} of {} meters of the scene `{procedure}` are undecided", all.len());
                self.add(Topic::by_scene(procedure), Standing::Undecided, text);
            }
        }
    }

    fn of_errors(&mut self, recordings: &[&Recording], comparisons: &[&Comparison]) {
        for recording in recordings {
            for stated in recording.stated_errors.iter().filter(|s| s.doubt.is_some()) {
                let topic = match stated.doubt {
                    Some(Doubt::Scatters | Doubt::BeyondTolerance | Doubt::Refuted) => Topic::Claims,
                    _ => Topic::Noise,
                };
                self.add(topic, Standing::Wrong, format!("{}: {stated}", recording.key.procedure));
            }
        }
        // What fails has its reason told elsewhere, and whoever mends that mends its claims.
        if !comparisons.iter().any(|c| c.verdict == Verdict::Fail)
            && let Some(text) = beyond_bounds(comparisons)
        {
            self.add(Topic::Claims, Standing::Wrong, text);
        }
        if comparisons.iter().any(|c| c.value.is_some() && c.uncertainty == Uncertainty::Unstated) {
            let text = "readings come without `std_error_lx`, `error_bound_lx` or `exact`: nothing is claimed of them";
            self.add(Topic::Claims, Standing::Sound, text.to_owned());
        }
    }
}

/// Readings within the tolerance whose known values do not lie within what is claimed of them.
fn beyond_bounds(comparisons: &[&Comparison]) -> Option<String> {
    let brightest = |procedure: ProcedureId| {
        let of_scene = comparisons.iter().filter(|c| c.key.procedure == procedure);
        of_scene.filter_map(|c| c.reference.as_ref()).map(|r| r.value.abs()).fold(0.0, f64::max)
    };
    let beyond = |c: &Comparison| {
        let reference = c.reference.as_ref()?;
        // Where it is dark, what is left of sums is rounded as the scene's other readings are.
        let of = if reference.value == 0.0 { brightest(c.key.procedure) } else { reference.value.abs() };
        let claimed = match c.uncertainty {
            Uncertainty::Exact => IN_FLOATS * of,
            Uncertainty::Bound(bound) => bound,
            _ => return None,
        };
        let known = reference.coverage_factor.unwrap_or(1.0) * reference.uncertainty + IN_DOUBLES * of;
        let deviation = c.deviation?.abs();
        (deviation > claimed + known).then(|| deviation / of)
    };
    let all: Vec<f64> = comparisons.iter().filter_map(|c| beyond(c)).collect();
    let largest = all.iter().copied().filter(|d| d.is_finite()).fold(0.0, f64::max);
    let claimed = comparisons.iter().filter(|c| matches!(c.uncertainty, Uncertainty::Exact | Uncertainty::Bound(_)));
    (!all.is_empty()).then(|| {
        format!(
            "{} of {} readings that it calls exact or bounded are off by more than that, by {largest:.1e} of the known value at most, \
             although within the tolerance",
            all.len(),
            claimed.count()
        )
    })
}

/// How far the worst of what fails is off: in parts of what is right, or in lux where that is dark.
fn worst(comparisons: &[&Comparison]) -> String {
    let failing = || comparisons.iter().filter(|c| c.verdict == Verdict::Fail);
    let largest = |of: fn(&Comparison) -> Option<f64>| {
        failing().filter_map(|c| of(c)).filter(|d| d.is_finite()).max_by(|a, b| a.abs().total_cmp(&b.abs()))
    };
    match (largest(|c| c.relative_deviation), largest(|c| c.deviation)) {
        (Some(relative), _) => format!("by {:+.2} % at most", 100.0 * relative),
        (None, Some(lux)) => format!("by {lux:+.3} lx at most where there should be none"),
        (None, None) => "which have no reading".to_owned(),
    }
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
