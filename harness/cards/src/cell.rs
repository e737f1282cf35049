//! The rule: evidence of cases to a cell of the matrix. The worst case counts.

use std::collections::{BTreeSet, HashSet};
use std::fmt;

use itertools::Itertools;
use luxproof_model::numbers::plural;
use luxproof_model::{FailureKind, ProcedureId};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::{Capability, CaseEvidence, Deviation, Measurement, Outcome, Remark, StatedTolerance};

/// Cases that a text lists by name.
const LISTED_CASES: usize = 3;

/// A cell: what a release of a renderer can be trusted for in one capability.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Cell {
    pub standing: Standing,
    /// Public cases with values, and all that the capability names.
    pub tested_cases: usize,
    pub all_cases: usize,
    /// Hidden variants with values.
    pub hidden_variants: usize,
    /// Comparisons behind the cell.
    pub points: usize,
    /// The first cases of the capability that no run has, at most 20.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub missing: Vec<String>,
    /// How far its points may be from their references, each limit once, the narrowest first.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub tolerances: Vec<StatedTolerance>,
    /// Public against hidden cases; null without hidden ones.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub spread: Option<Spread>,
}

/// What the evidence shows, the best first.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "state", rename_all = "snake_case")]
pub enum Standing {
    /// Every point of every case passes.
    Accurate {
        /// The deviation with the largest bound; null where no reference is above zero.
        worst: Option<WorstPoint>,
    },
    /// It is right within limits, or not decided.
    Limited {
        what: String,
        /// Where: cases and points.
        from: String,
        worst: Option<WorstPoint>,
    },
    /// One point is enough.
    Wrong {
        fault: String,
        from: String,
        worst: Option<WorstPoint>,
    },
    /// It gives no values where it should: it crashes, gives no answer in time, or an unreadable one.
    Failed {
        failure: FailureKind,
        reason: String,
        from: String,
        at: Place,
    },
    NotSupported {
        reason: String,
    },
    NotTested {
        reason: String,
    },
}

/// Where the worst of a cell was found.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct Place {
    /// The public case; of a hidden variant the case that it is drawn from.
    pub case: String,
    /// Null for a public case.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub seed: Option<u64>,
    /// Null where no single point shows it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub meter: Option<String>,
    /// The scene of known answer, where the case is `calibration`: all of them have this name.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub scene: Option<ProcedureId>,
}

impl Place {
    fn of(evidence: &CaseEvidence, meter: Option<String>) -> Self {
        Self {
            case: evidence.case.clone(),
            seed: evidence.hidden.as_ref().map(|variant| variant.seed),
            meter,
            scene: Some(evidence.procedure).filter(|procedure| procedure.is_calibration()),
        }
    }

    /// The case in one or two words.
    pub fn case_text(&self) -> String {
        match self.seed {
            Some(_) => format!("{}, hidden", self.case),
            None => self.case.clone(),
        }
    }
}

/// `floor[1] of 5.2-point (hidden, seed 7)`.
impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(meter) = &self.meter {
            write!(f, "{meter} of ")?;
        }
        f.write_str(&self.case)?;
        if let Some(scene) = self.scene {
            write!(f, " ({})", scene.name())?;
        }
        self.seed.map_or(Ok(()), |seed| write!(f, " (hidden, seed {seed})"))
    }
}

/// A deviation and where it is.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct WorstPoint {
    pub deviation: Deviation,
    pub at: Place,
}

/// How an engine fails, in one or two words.
const fn failure_words(failure: FailureKind) -> &'static str {
    match failure {
        FailureKind::Crash => "crashes",
        FailureKind::Hang => "no answer in time",
        FailureKind::Garbled => "unreadable output",
        FailureKind::SilentLoss => "values missing",
        FailureKind::Nan => "not a number",
        FailureKind::ErrorExit => "ends with an error",
        FailureKind::Declined
        | FailureKind::Refused
        | FailureKind::Interrupted
        | FailureKind::TimeUp
        | FailureKind::Unread => "fails",
    }
}

/// The largest bounds of public cases and of their hidden variants.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Spread {
    pub public: Option<WorstPoint>,
    pub hidden: Option<WorstPoint>,
    /// The seeds of the hidden variants.
    pub seeds: Vec<u64>,
    /// Whether no public case shows a fault, and a variant of one that is right does.
    pub is_public_only: bool,
}

impl Standing {
    /// The state in one or two words.
    pub const fn word(&self) -> &'static str {
        match self {
            Self::Accurate { .. } => "accurate",
            Self::Limited { .. } => "limited",
            Self::Wrong { .. } => "wrong",
            Self::Failed { .. } => "fails",
            Self::NotSupported { .. } => "not supported",
            Self::NotTested { .. } => "not tested",
        }
    }

    /// The state as a part of a class or an attribute.
    pub const fn key(&self) -> &'static str {
        match self {
            Self::Accurate { .. } => "accurate",
            Self::Limited { .. } => "limited",
            Self::Wrong { .. } => "wrong",
            Self::Failed { .. } => "failed",
            Self::NotSupported { .. } => "unsupported",
            Self::NotTested { .. } => "untested",
        }
    }

    /// A sign for readers who do not see its colour.
    pub const fn sign(&self) -> &'static str {
        match self {
            Self::Accurate { .. } => "✓",
            Self::Limited { .. } => "≈",
            Self::Wrong { .. } => "✕",
            Self::Failed { .. } => "!",
            Self::NotSupported { .. } => "–",
            Self::NotTested { .. } => "·",
        }
    }

    /// Whether nothing is known.
    pub const fn is_untested(&self) -> bool {
        matches!(self, Self::NotTested { .. })
    }

    /// The deviation with the largest bound behind it.
    pub fn worst(&self) -> Option<Deviation> {
        self.worst_point().map(|worst| worst.deviation)
    }

    const fn worst_point(&self) -> Option<&WorstPoint> {
        match self {
            Self::Accurate { worst } | Self::Limited { worst, .. } | Self::Wrong { worst, .. } => worst.as_ref(),
            Self::Failed { .. } | Self::NotSupported { .. } | Self::NotTested { .. } => None,
        }
    }

    /// Where its worst is.
    pub fn place(&self) -> Option<&Place> {
        match self {
            Self::Failed { at, .. } => Some(at),
            other => other.worst_point().map(|worst| &worst.at),
        }
    }

    /// The cell in a few words: `within 0.84 %`, `wrong, off by up to 12 %`, `crashes`, `not tested`.
    pub fn headline(&self) -> String {
        let bound = self.worst().map(|worst| worst.bound_text());
        match (self, bound) {
            (Self::Accurate { .. }, Some(bound)) => format!("within {bound}"),
            (Self::Limited { .. }, Some(bound)) => format!("limited, up to {bound}"),
            (Self::Wrong { .. }, Some(bound)) => format!("wrong, off by up to {bound}"),
            (Self::Failed { failure, .. }, _) => failure_words(*failure).to_owned(),
            _ => self.word().to_owned(),
        }
    }

    /// What stands behind the headline: the fault, the limit or the reason, and where.
    pub fn explanation(&self) -> String {
        match self {
            Self::Accurate { worst: Some(worst) } => {
                format!("every point of every case passes; the worst deviates by {}, at {}", worst.deviation, worst.at)
            }
            Self::Accurate { worst: None } => "every point of every case passes".to_owned(),
            Self::Limited { what: text, from, .. }
            | Self::Wrong { fault: text, from, .. }
            | Self::Failed { reason: text, from, .. } => format!("{text} ({from})"),
            Self::NotSupported { reason } | Self::NotTested { reason } => reason.clone(),
        }
    }
}

/// The cell of a capability by the evidence of one release, public and hidden.
///
/// Faults come first: one is enough, in whatever case. Then come cases without values, which are no wrong light but no answer either.
/// Then too few cases are `not tested`. Everything that is neither a pass nor a fault limits the cell. Only what passes everywhere is
/// accurate.
pub fn judge(capability: &Capability, evidence: &[CaseEvidence]) -> Cell {
    let (public, hidden): (Vec<_>, Vec<_>) = evidence.iter().partition(|e| e.hidden.is_none());
    let tested: BTreeSet<&str> = public.iter().filter(|e| e.measurement().is_some()).map(|e| e.case.as_str()).collect();
    let there: HashSet<&str> = public.iter().map(|e| e.case.as_str()).collect();
    let named = capability.cases.iter().map(|selector| selector.case.as_str()).unique();
    let missing = named.filter(|case| !there.contains(case)).take(LISTED_MISSING);
    let missing: Vec<String> = missing.map(str::to_owned).collect();
    let spread = spread(&public, &hidden);
    let standing = wrong(evidence, spread.as_ref())
        .or_else(|| without_answer(evidence, spread.as_ref()))
        .or_else(|| without_values(capability, &public, tested.len(), &missing))
        .or_else(|| limited(evidence))
        .unwrap_or_else(|| Standing::Accurate { worst: worst_of(evidence.iter()) });
    Cell {
        standing,
        tested_cases: tested.len(),
        all_cases: capability.case_count(),
        hidden_variants: hidden.iter().filter(|e| e.measurement().is_some()).count(),
        points: evidence.iter().filter_map(CaseEvidence::measurement).map(|m| m.verdicts.all).sum(),
        missing,
        tolerances: StatedTolerance::all_of(
            evidence.iter().filter_map(CaseEvidence::measurement).flat_map(|m| m.tolerances.iter().cloned()),
        ),
        spread,
    }
}

impl Cell {
    /// Its worst point, if hidden variants exist and none is of the case of that point: then the page of hidden variants lacks it.
    pub fn worst_without_variant(&self) -> Option<&WorstPoint> {
        let spread = self.spread.as_ref()?;
        let worst = self.standing.worst_point()?;
        let compared = [&spread.public, &spread.hidden].into_iter().flatten().map(|of| of.deviation.bound());
        (worst.at.seed.is_none() && worst.deviation.bound() > compared.fold(0.0, f64::max)).then_some(worst)
    }
}

/// Missing cases that a cell lists: each cell would list all of a long file of capabilities.
const LISTED_MISSING: usize = 20;

impl CaseEvidence {
    /// Its values, where there are any.
    pub const fn measurement(&self) -> Option<&Measurement> {
        match &self.outcome {
            Outcome::Measured(measurement) => Some(measurement),
            Outcome::Unsupported { .. } | Outcome::NotRun { .. } | Outcome::Failed { .. } => None,
        }
    }

    /// The faults that its values show: text, worst deviation and place.
    fn faults(&self) -> Vec<Flaw<'_>> {
        let remarks = self.measurement().into_iter().flat_map(|measurement| &measurement.remarks);
        remarks.filter_map(|remark| Flaw::of_fault(self, remark)).collect()
    }

    /// Whether it gives wrong values, or none where it should.
    fn is_faulty(&self) -> bool {
        !self.faults().is_empty() || self.failure().is_some()
    }

    /// How it fails, where it does.
    fn failure(&self) -> Option<(FailureKind, Flaw<'_>)> {
        let Outcome::Failed { failure, reason } = &self.outcome else { return None };
        Some((*failure, Flaw { case: self, text: reason.clone(), worst: None, at: None }))
    }

    /// What limits it.
    fn limits(&self) -> Vec<Flaw<'_>> {
        match &self.outcome {
            Outcome::Unsupported { reason } => {
                vec![Flaw { case: self, text: format!("it declines: {reason}"), worst: None, at: None }]
            }
            Outcome::Measured(measurement) => {
                let remarks = measurement.remarks.iter();
                remarks.filter_map(|remark| Flaw::of_limit(self, remark)).collect()
            }
            Outcome::Failed { .. } | Outcome::NotRun { .. } => vec![],
        }
    }
}

/// A fault or a limit of a case.
struct Flaw<'a> {
    case: &'a CaseEvidence,
    text: String,
    worst: Option<Deviation>,
    at: Option<String>,
}

impl<'a> Flaw<'a> {
    fn of_fault(case: &'a CaseEvidence, remark: &Remark) -> Option<Self> {
        let Remark::Fault { text, worst, at, .. } = remark else { return None };
        let text = if text.is_empty() { "no known cause".to_owned() } else { text.clone() };
        Some(Self { case, text, worst: *worst, at: at.clone() })
    }

    /// A limit by its name; undecided points have none.
    fn of_limit(case: &'a CaseEvidence, remark: &Remark) -> Option<Self> {
        let (text, worst, at) = match remark {
            Remark::Fault { .. } => return None,
            Remark::Limit { text, worst, at, .. } => (text.clone(), worst, at),
            Remark::Undecided { worst, at, .. } => (String::new(), worst, at),
        };
        Some(Self { case, text, worst: *worst, at: at.clone() })
    }

    fn bound(&self) -> f64 {
        self.worst.map_or(0.0, |worst| worst.bound())
    }

    fn place(&self) -> Place {
        Place::of(self.case, self.at.clone())
    }

    fn worst_point(&self) -> Option<WorstPoint> {
        Some(WorstPoint { deviation: self.worst?, at: self.place() })
    }
}

/// The flaw with the largest bound, and where all of them are.
fn gravest<'a>(flaws: Vec<Flaw<'a>>, evidence: &[CaseEvidence]) -> Option<(Flaw<'a>, String)> {
    let cases: Vec<&str> = flaws.iter().map(|flaw| flaw.case.case.as_str()).unique().collect();
    let run = evidence.iter().filter(|e| !matches!(e.outcome, Outcome::NotRun { .. }));
    let run = run.map(|e| e.case.as_str()).unique().count();
    let [public, hidden] =
        [false, true].map(|is_hidden| flaws.iter().any(|flaw| flaw.case.hidden.is_some() == is_hidden));
    let variants = match (public, hidden) {
        (true, true) => ", hidden variants too",
        (false, true) => ", in hidden variants only",
        (_, false) => "",
    };
    let worst = flaws.iter().map(Flaw::bound).position_max_by(f64::total_cmp);
    let listed = cases.iter().take(LISTED_CASES).join(", ");
    let more = cases.len().saturating_sub(LISTED_CASES);
    let more = if more > 0 { format!(" and {more} more") } else { String::new() };
    let count = cases.len();
    let worst = flaws.into_iter().nth(worst?)?;
    let at = worst.at.as_ref().map(|_| format!("; worst at {}", worst.place())).unwrap_or_default();
    Some((worst, format!("in {count} of {}: {listed}{more}{variants}{at}", plural(run, "case"))))
}

fn wrong(evidence: &[CaseEvidence], spread: Option<&Spread>) -> Option<Standing> {
    let faults = evidence.iter().flat_map(CaseEvidence::faults).collect();
    let (worst, from) = gravest(faults, evidence)?;
    let point = worst.worst_point();
    let fault = if spread.is_some_and(|spread| spread.is_public_only) {
        format!("right in the public cases only, wrong in their hidden variants: {}", worst.text)
    } else {
        match public_limit(worst.case, evidence) {
            Some(limit) => format!("{}; the known limit of the public case does not cover it: {limit}", worst.text),
            None => worst.text,
        }
    };
    let from = from + &also_failing(evidence);
    Some(Standing::Wrong { fault, from, worst: point })
}

/// The cases of a wrong cell that give no values, as a part of where it is wrong.
fn also_failing(evidence: &[CaseEvidence]) -> String {
    let failures: Vec<(FailureKind, Flaw<'_>)> = evidence.iter().filter_map(CaseEvidence::failure).collect();
    let Some((failure, _)) = failures.first() else { return String::new() };
    let cases = failures.iter().map(|(_, flaw)| flaw.case.case.as_str()).unique().take(LISTED_CASES).join(", ");
    format!("; {} in {cases}", failure_words(*failure))
}

/// The known limit of the public case of a hidden variant. It counts for the case that declares it and for no other.
fn public_limit(variant: &CaseEvidence, evidence: &[CaseEvidence]) -> Option<String> {
    variant.hidden.as_ref()?;
    let public =
        evidence.iter().filter(|e| e.hidden.is_none() && e.case == variant.case && e.procedure == variant.procedure);
    public
        .filter(|e| !e.is_faulty())
        .find_map(|e| e.limits().into_iter().map(|limit| limit.text).find(|text| !text.is_empty()))
}

/// A cell with cases that give no values and are not refused either.
fn without_answer(evidence: &[CaseEvidence], spread: Option<&Spread>) -> Option<Standing> {
    let (kinds, flaws): (Vec<FailureKind>, Vec<Flaw<'_>>) = evidence.iter().filter_map(CaseEvidence::failure).unzip();
    let failure = *kinds.first()?;
    // All that fail the same way, and where.
    let same = kinds.iter().zip(flaws).filter(|(kind, _)| **kind == failure).map(|(_, flaw)| flaw).collect();
    let (flaw, from) = gravest(same, evidence)?;
    let at = flaw.place();
    let reason = if spread.is_some_and(|spread| spread.is_public_only) {
        format!("right in the public cases only, fails in their hidden variants: {}", flaw.text)
    } else {
        flaw.text
    };
    Some(Standing::Failed { failure, reason, from, at })
}

/// A cell with too few values for a claim.
///
/// What the renderer declines is known: without any values it does not support the capability, and next to enough values and
/// declined cases together it is limited. Only what was not run is not tested.
fn without_values(
    capability: &Capability,
    public: &[&CaseEvidence],
    tested: usize,
    missing: &[String],
) -> Option<Standing> {
    let answered = public.iter().filter(|e| !matches!(e.outcome, Outcome::NotRun { .. }));
    let answered = answered.map(|e| e.case.as_str()).unique().count();
    if tested >= capability.minimum_cases || (tested > 0 && answered >= capability.minimum_cases) {
        return None;
    }
    let declined = public.iter().filter_map(|e| match &e.outcome {
        Outcome::Unsupported { reason } => Some(reason.as_str()),
        Outcome::Measured(_) | Outcome::NotRun { .. } | Outcome::Failed { .. } => None,
    });
    let declined: Vec<&str> = declined.unique().collect();
    if tested == 0 && !declined.is_empty() {
        return Some(Standing::NotSupported { reason: declined.join("; ") });
    }
    let not_run = public.iter().filter_map(|e| match &e.outcome {
        Outcome::NotRun { reason } => Some(format!("{}: {reason}", e.case)),
        Outcome::Unsupported { reason } => Some(format!("{}: declined, {reason}", e.case)),
        Outcome::Measured(_) | Outcome::Failed { .. } => None,
    });
    let absent = missing.iter().map(|case| format!("{case}: in no run"));
    let reasons: Vec<String> = not_run.chain(absent).unique().take(LISTED_CASES).collect();
    let count = format!("{tested} of at least {} have values", plural(capability.minimum_cases, "case"));
    Some(Standing::NotTested { reason: [vec![count], reasons].concat().join("; ") })
}

/// A cell that something limits. What has a name comes before points that more samples would decide.
fn limited(evidence: &[CaseEvidence]) -> Option<Standing> {
    let undecided = evidence.iter().filter_map(CaseEvidence::measurement).map(|m| m.verdicts.undecided).sum::<usize>();
    let all = evidence.iter().filter_map(CaseEvidence::measurement).map(|m| m.verdicts.all).sum::<usize>();
    let undecided = (undecided > 0).then(|| format!("{undecided} of {} undecided", plural(all, "point")));
    let (named, open): (Vec<_>, Vec<_>) =
        evidence.iter().flat_map(CaseEvidence::limits).partition(|flaw| !flaw.text.is_empty());
    let (what, from) = match gravest(named, evidence) {
        // Where it declines there is no deviation: a bound would say something about other cases.
        Some((worst, from)) if worst.worst.is_none() && undecided.is_none() => {
            let elsewhere =
                worst_of(evidence.iter()).map(|worst| format!("; elsewhere within {}", worst.deviation.bound_text()));
            return Some(Standing::Limited {
                what: worst.text,
                from: from + &elsewhere.unwrap_or_default(),
                worst: None,
            });
        }
        Some((worst, from)) => ([Some(worst.text), undecided].into_iter().flatten().join("; "), from),
        None => (undecided.unwrap_or_default(), gravest(open, evidence)?.1),
    };
    Some(Standing::Limited { what, from, worst: worst_of(evidence.iter()) })
}

/// The deviation with the largest bound, and where it is.
fn worst_of<'a>(evidence: impl Iterator<Item = &'a CaseEvidence>) -> Option<WorstPoint> {
    let all = evidence.filter_map(|e| Some((e, e.measurement()?)));
    let all = all.filter_map(|(e, measurement)| {
        let meter = measurement.points.first().map(|point| point.meter.clone());
        Some(WorstPoint { deviation: measurement.worst?, at: Place::of(e, meter) })
    });
    all.max_by(|a, b| a.deviation.bound().total_cmp(&b.deviation.bound()))
}

/// Public against hidden cases, of the same procedures; `None` without hidden ones.
fn spread(public: &[&CaseEvidence], hidden: &[&CaseEvidence]) -> Option<Spread> {
    let seeds: BTreeSet<u64> = hidden.iter().filter_map(|e| e.hidden.as_ref()).map(|variant| variant.seed).collect();
    if seeds.is_empty() {
        return None;
    }
    let is_varied = |e: &&&CaseEvidence| hidden.iter().any(|h| h.case == e.case && h.procedure == e.procedure);
    let paired: Vec<&CaseEvidence> = public.iter().filter(is_varied).copied().collect();
    let has_public_fault = public.iter().any(|e| e.is_faulty());
    Some(Spread {
        public: worst_of(paired.iter().copied()),
        hidden: worst_of(hidden.iter().copied()),
        seeds: seeds.into_iter().collect(),
        is_public_only: !has_public_fault && hidden.iter().any(|e| is_exposed(e, &paired)),
    })
}

/// Whether a hidden variant shows a fault, and its public case nothing.
fn is_exposed(variant: &CaseEvidence, public: &[&CaseEvidence]) -> bool {
    let mut of_public = public.iter().filter(|e| e.case == variant.case && e.procedure == variant.procedure);
    variant.is_faulty() && of_public.any(|e| e.measurement().is_some() && !e.is_faulty() && e.limits().is_empty())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Capabilities;
    use crate::evidence::ReportIndex;
    use crate::fixtures::{ENGINE, MadeCase, capabilities, report};
    use crate::{Measure, RunId};
    use luxproof_model::{Basis, EngineName, KnownDeviationOutcome, ProcedureId, ReadingKey, Report, Verdict};
    use serde_json::json;

    fn cell_of(report: &Report, minimum: usize) -> Cell {
        let capabilities = capabilities(minimum);
        judge(&capabilities.capabilities[0], &evidence_of(report, &capabilities))
    }

    /// The evidence about the one engine for the one capability.
    fn evidence_of(report: &Report, capabilities: &Capabilities) -> Vec<CaseEvidence> {
        let index = ReportIndex::new(report, capabilities);
        let evidence = index.evidence(&EngineName::from(ENGINE), &RunId::of(report));
        evidence.into_values().next().unwrap_or_default()
    }

    fn cell(given: &[MadeCase], minimum: usize) -> Cell {
        cell_of(&report(ENGINE, "1.0", given), minimum)
    }

    fn three(a: MadeCase) -> [MadeCase; 3] {
        [a, MadeCase::new("b").off(0.0, 0.0), MadeCase::new("c").off(0.0, 0.0)]
    }

    fn bound(cell: &Cell) -> f64 {
        cell.standing.worst().unwrap().bound()
    }

    #[test]
    fn accurate_is_the_largest_deviation_with_its_uncertainty_over_all_points_and_cases() {
        let a = MadeCase::new("a").off(0.001, 0.002).off(-0.004, 0.003);
        let found = cell(&[a, MadeCase::new("b").off(0.006, 0.0005), MadeCase::new("c").off(0.0, 0.0)], 3);
        assert!(matches!(found.standing, Standing::Accurate { .. }), "{found:?}");
        // .004 + .003 is more than .006 + .0005.
        assert!((bound(&found) - 0.007).abs() < 1e-12);
        assert_eq!((found.points, found.tested_cases, found.all_cases), (4, 3, 3));
        assert_eq!(found.standing.headline(), "within 0.70 %");
    }

    #[test]
    fn no_mean_hides_a_single_wrong_point() {
        let many = (0..99).fold(MadeCase::new("a"), |given, _| given.off(0.0, 0.0001));
        let found = cell(&three(many.off(0.05, 0.001)), 3);
        let Standing::Wrong { from, worst, .. } = &found.standing else { panic!("{found:?}") };
        assert_eq!(worst.as_ref().map(|w| w.deviation.value), Some(0.05));
        assert_eq!(found.standing.place().unwrap().to_string(), "floor[99] of a");
        assert!(from.contains("in 1 of 3 cases: a") && from.contains("floor[99] of a"), "{from}");
    }

    #[test]
    fn two_faults_of_opposite_sign_do_not_cancel() {
        let found = cell(&three(MadeCase::new("a").off(0.05, 0.0).off(-0.05, 0.0)), 3);
        assert!(matches!(found.standing, Standing::Wrong { .. }));
    }

    #[test]
    fn an_undecided_point_is_never_accurate() {
        let found = cell(&three(MadeCase::new("a").off(0.0, 0.0).off(0.008, 0.005)), 3);
        let Standing::Limited { what, .. } = &found.standing else { panic!("{found:?}") };
        assert_eq!(what, "1 of 4 points undecided");
        assert!((bound(&found) - 0.013).abs() < 1e-12);
    }

    #[test]
    fn a_cell_is_never_better_than_the_uncertainty_of_the_reference() {
        // An engine that states no error, exactly on a reference that is known to .6 %.
        let a = MadeCase::new("a").judged(0.0, 0.0, Verdict::Pass, None).with_reference(0.006, Basis::Simulator);
        let found = cell(&three(a), 3);
        assert!((bound(&found) - 0.006).abs() < 1e-12, "{found:?}");
    }

    #[test]
    fn a_missing_case_is_not_tested_whatever_the_others_say() {
        let two = [MadeCase::new("a").off(0.0, 0.0), MadeCase::new("b").off(0.0, 0.0)];
        let found = cell(&two, 3);
        let Standing::NotTested { reason } = &found.standing else { panic!("{found:?}") };
        assert_eq!(reason, "2 of at least 3 cases have values; c: in no run");
        assert_eq!(found.missing, ["c"]);
        // Where two are enough, the cell says how many there are.
        let found = cell(&two, 2);
        assert!(matches!(found.standing, Standing::Accurate { .. }));
        assert_eq!((found.tested_cases, found.all_cases, found.missing), (2, 3, vec!["c".to_owned()]));
        let nothing = cell(&[], 1);
        assert!(matches!(nothing.standing, Standing::NotTested { .. }));
    }

    #[test]
    fn one_fault_needs_no_minimum_of_cases() {
        let found = cell(&[MadeCase::new("a").off(0.2, 0.0)], 3);
        assert!(matches!(found.standing, Standing::Wrong { .. }));
    }

    /// A report in which a known deviation of this kind explains case `a`.
    fn known(kind: &str) -> Report {
        let a = MadeCase::new("a").judged(-0.12, 0.001, Verdict::KnownDeviation, Some("20 reflections at most"));
        let mut report = report(ENGINE, "1.0", &three(a));
        let entry = json!({"engine": ENGINE, "procedure": "direct_illuminance", "expected": -0.12, "uncertainty": 0.001,
            "cause": "20 reflections at most", "source": "its manual", "kind": kind});
        let key = ReadingKey::new("a", ProcedureId::DirectIlluminance, ENGINE);
        report.known_deviations.push(KnownDeviationOutcome {
            key,
            state: luxproof_model::State::Seen,
            readings: 1,
            entry: serde_json::from_value(entry).unwrap(),
        });
        report
    }

    #[test]
    fn a_known_deviation_is_limited_or_wrong_by_its_cause() {
        let limited = cell_of(&known("limit"), 3);
        let Standing::Limited { what, from, worst } = &limited.standing else { panic!("{limited:?}") };
        assert_eq!(
            (what.as_str(), from.as_str()),
            ("20 reflections at most", "in 1 of 3 cases: a; worst at floor[0] of a")
        );
        assert!((worst.as_ref().unwrap().deviation.bound() - 0.121).abs() < 1e-12);
        let wrong = cell_of(&known("fault"), 3);
        let Standing::Wrong { fault, .. } = &wrong.standing else { panic!("{wrong:?}") };
        assert_eq!(fault, "20 reflections at most");
        // An entry without a kind is a fault.
        let mut unknown = known("limit");
        unknown.known_deviations.clear();
        assert!(matches!(cell_of(&unknown, 3).standing, Standing::Wrong { .. }));
    }

    #[test]
    fn a_named_cause_is_the_fault_of_the_cell() {
        let a = MadeCase::new("a").judged(0.5, 0.0, Verdict::Fail, Some("C is turned by 180 degrees"));
        let found = cell(&three(a), 3);
        assert!(found.standing.explanation().starts_with("C is turned by 180 degrees (in 1 of 3 cases: a"));
        assert_eq!(found.standing.headline(), "wrong, off by up to 50 %");
    }

    #[test]
    fn what_an_engine_declines_is_not_supported_and_a_crash_is_a_failure() {
        let all = ["a", "b", "c"].map(|case| MadeCase::new(case).unsupported());
        assert_eq!(cell(&all, 2).standing, Standing::NotSupported { reason: "only boxes".to_owned() });
        let some =
            [MadeCase::new("a").off(0.0, 0.0), MadeCase::new("b").off(0.0, 0.0), MadeCase::new("c").unsupported()];
        let found = cell(&some, 2);
        let Standing::Limited { what, from, .. } = &found.standing else { panic!("{found:?}") };
        assert_eq!(what, "it declines: only boxes");
        assert_eq!(from, "in 1 of 3 cases: c; elsewhere within 0.0001 %");
        assert_eq!(found.standing.headline(), "limited");
        let crash = cell(&three(MadeCase::new("a").failing("crash", "signal 11")), 2);
        assert_eq!(crash.standing.headline(), "crashes");
        assert_eq!(crash.standing.explanation(), "signal 11 (in 1 of 3 cases: a)");
        let declined = cell(&three(MadeCase::new("a").failing("declined", "no bodies")), 2);
        assert!(matches!(declined.standing, Standing::Limited { .. }), "{declined:?}");
        let refused = cell(&three(MadeCase::new("a").failing("refused", "no such setting")), 2);
        assert!(matches!(refused.standing, Standing::Limited { .. }), "{refused:?}");
        // What had no time says nothing about the engine.
        let late = cell(&three(MadeCase::new("a").failing("time_up", "no time was left")), 3);
        assert!(matches!(late.standing, Standing::NotTested { .. }), "{late:?}");
    }

    #[test]
    fn what_is_declined_is_not_supported_and_what_was_not_run_is_not_tested_whatever_other_cases_are() {
        // Some cases were declined, and no run has the others.
        let found = cell(&[MadeCase::new("a").unsupported()], 2);
        assert_eq!(found.standing, Standing::NotSupported { reason: "only boxes".to_owned() });
        // Nothing was run.
        let found = cell(&[MadeCase::new("a").not_run(), MadeCase::new("b").not_run()], 2);
        assert!(matches!(found.standing, Standing::NotTested { .. }), "{found:?}");
        // The clock left no time for one, and the other is declined.
        let found = cell(&[MadeCase::new("a").unsupported(), MadeCase::new("b").not_run()], 2);
        assert!(matches!(found.standing, Standing::NotSupported { .. }), "{found:?}");
        // Values of one case and two declined ones are no lack of runs.
        let found = cell(
            &[MadeCase::new("a").off(0.0, 0.0), MadeCase::new("b").unsupported(), MadeCase::new("c").unsupported()],
            3,
        );
        let Standing::Limited { what, .. } = &found.standing else { panic!("{found:?}") };
        assert_eq!(what, "it declines: only boxes");
        // One of the two was not run: two answers of at least three are too few.
        let found = cell(
            &[MadeCase::new("a").off(0.0, 0.0), MadeCase::new("b").unsupported(), MadeCase::new("c").not_run()],
            3,
        );
        assert!(matches!(found.standing, Standing::NotTested { .. }), "{found:?}");
    }

    #[test]
    fn a_run_that_the_clock_cut_short_decides_nothing_where_its_values_would_be_wrong() {
        let found = cell(&three(MadeCase::new("a").off(2.54, 0.01).cut_to(0.031)), 3);
        assert_eq!(found.standing.headline(), "no answer in time");
        assert_eq!(
            found.standing.explanation(),
            "the time limit cut it to 3.1 % of its samples, so its values decide nothing (in 1 of 3 cases: a)"
        );
        // Values that pass in spite of it do pass, and a fault of a whole run stays one.
        assert!(matches!(
            cell(&three(MadeCase::new("a").off(0.0, 0.0).cut_to(0.5)), 3).standing,
            Standing::Accurate { .. }
        ));
        let [a, _, c] = three(MadeCase::new("a").off(2.54, 0.01).cut_to(0.031));
        let found = cell(&[a, MadeCase::new("b").off(0.5, 0.0), c], 3);
        assert_eq!(found.standing.headline(), "wrong, off by up to 50 %");
    }

    #[test]
    fn a_cell_has_the_stated_tolerances_of_its_points() {
        let mut report = report(ENGINE, "1.0", &three(MadeCase::new("a").off(0.0, 0.0)));
        report.comparisons[1].tolerance = luxproof_model::Tolerance { relative: 0.1, absolute: 0.001 };
        let found = cell_of(&report, 3);
        let texts: Vec<String> = found.tolerances.iter().map(ToString::to_string).collect();
        assert_eq!(texts, ["1 %", "10 % or 0.001 lx"]);
    }

    /// The worst point is in a scene that has no variant: the page says which.
    #[test]
    fn a_fault_in_a_case_without_a_variant_is_named() {
        let given = [
            MadeCase::new("a").off(0.001, 0.0),
            MadeCase::new("a").hidden(7).off(0.002, 0.0),
            MadeCase::new("b").off(0.91, 0.0),
        ];
        let found = cell(&given, 2);
        let worst = found.worst_without_variant().unwrap();
        assert_eq!((worst.at.to_string().as_str(), worst.deviation.value), ("floor[0] of b", 0.91));
        let even = [MadeCase::new("a").off(0.001, 0.0), MadeCase::new("a").hidden(7).off(0.002, 0.0)];
        assert_eq!(cell(&even, 1).worst_without_variant(), None);
        let scene = Place { scene: Some(ProcedureId::Asymmetric), ..worst.at.clone() };
        assert_eq!(
            Place { case: "calibration".to_owned(), ..scene }.to_string(),
            "floor[0] of calibration (asymmetric)"
        );
    }

    /// The cell of a capability that right values of the engine do not show.
    fn not_shown(given: &[MadeCase]) -> Standing {
        let mut capability = capabilities(2).capabilities[0].clone();
        let why = "luxproof gives it the scale".to_owned();
        capability.not_shown_by = vec![crate::NotShown { engine: ENGINE.to_owned(), why }];
        let all = Capabilities { version: 1, capabilities: vec![capability.clone()] };
        judge(&capability, &evidence_of(&report(ENGINE, "1.0", given), &all)).standing
    }

    #[test]
    fn right_values_of_an_engine_that_was_given_the_answer_show_nothing_and_wrong_ones_do() {
        let right = not_shown(&three(MadeCase::new("a").off(0.0, 0.0)));
        assert_eq!(right, Standing::NotSupported { reason: "luxproof gives it the scale".to_owned() });
        assert!(matches!(not_shown(&three(MadeCase::new("a").off(0.3, 0.0))), Standing::Wrong { .. }));
    }

    #[test]
    fn who_reads_files_is_judged_by_its_own_parser_and_not_by_that_of_luxproof() {
        let mut capability = capabilities(2).capabilities[0].clone();
        capability.reads_files = true;
        let judged = |report: &Report| {
            let capabilities = Capabilities { version: 1, capabilities: vec![capability.clone()] };
            judge(&capability, &evidence_of(report, &capabilities)).standing
        };
        let mut report = report(ENGINE, "1.0", &three(MadeCase::new("a").off(0.0, 0.0)));
        let Standing::NotSupported { reason } = judged(&report) else { panic!("{:?}", judged(&report)) };
        assert!(reason.contains("luxproof reads it"), "{reason}");
        report.recordings.iter_mut().for_each(|recording| recording.reads_files = true);
        assert!(matches!(judged(&report), Standing::Accurate { .. }));
        // A file that it rejects with a reason is not supported; the place of its log is not published.
        for recording in &mut report.recordings {
            recording.failure =
                Some("ies2rad failed:   - /home/me/lib.so\n  - /home/me/b.so\nunsupported type\nall its messages are in /home/me/log".to_owned());
            recording.failure_kind = Some(FailureKind::ErrorExit);
        }
        let rejected = Standing::NotSupported {
            reason: "it does not read the file: unsupported type; before that: ies2rad failed".to_owned(),
        };
        assert_eq!(judged(&report), rejected);
        for recording in &mut report.recordings {
            recording.failure =
                Some("  ^^^^\nloading \u{fffd}\"/tmp/me/stock.xml\" (near line 26): unreferenced property".to_owned());
        }
        let Standing::NotSupported { reason } = judged(&report) else { panic!("{:?}", judged(&report)) };
        assert_eq!(reason, "it does not read the file: loading \"stock.xml\" (near line 26): unreferenced property");
        // A parser that crashes on a file refuses nothing.
        report.recordings.iter_mut().for_each(|recording| recording.failure_kind = Some(FailureKind::Crash));
        assert_eq!(judged(&report).headline(), "crashes");
    }

    #[test]
    fn a_reference_by_another_engine_or_a_hand_method_judges_nothing() {
        for basis in [Basis::Engine, Basis::Iesna] {
            let a = MadeCase::new("a").judged(0.3, 0.0, Verdict::Fail, None).with_reference(0.0, basis);
            let found = cell(&three(a), 3);
            assert!(matches!(found.standing, Standing::NotTested { .. }), "{found:?}");
        }
    }

    #[test]
    fn a_fault_in_hidden_variants_alone_is_wrong_and_says_that_the_public_cases_are_right() {
        let given = [
            MadeCase::new("a").off(0.0, 0.001),
            MadeCase::new("b").off(0.0, 0.001),
            MadeCase::new("c").off(0.0, 0.001),
            MadeCase::new("a").hidden(7).off(0.05, 0.001),
        ];
        let found = cell(&given, 3);
        let Standing::Wrong { fault, from, .. } = &found.standing else { panic!("{found:?}") };
        assert!(fault.starts_with("right in the public cases only"), "{fault}");
        assert_eq!(from, "in 1 of 3 cases: a, in hidden variants only; worst at floor[0] of a (hidden, seed 7)");
        let spread = found.spread.unwrap();
        assert!(spread.is_public_only);
        assert_eq!(spread.seeds, [7]);
        assert_eq!(spread.public.map(|w| w.deviation.value), Some(0.0));
        let worst = spread.hidden.unwrap();
        assert_eq!((worst.deviation.value, worst.deviation.measure), (0.05, Measure::Relative));
        assert_eq!(worst.at.to_string(), "floor[0] of a (hidden, seed 7)");
        assert_eq!((found.tested_cases, found.hidden_variants), (3, 1));
    }

    #[test]
    fn every_way_to_give_no_values_has_its_words_and_is_never_not_supported() {
        for (kind, words) in [
            ("crash", "crashes"),
            ("hang", "no answer in time"),
            ("garbled", "unreadable output"),
            ("silent_loss", "values missing"),
            ("nan", "not a number"),
            ("error_exit", "ends with an error"),
        ] {
            let all = ["a", "b", "c"].map(|case| MadeCase::new(case).failing(kind, "why"));
            let found = cell(&all, 2);
            assert!(matches!(found.standing, Standing::Failed { .. }), "{kind}: {found:?}");
            assert_eq!(found.standing.headline(), words);
        }
        // Wrong light is worse than none.
        let both = [MadeCase::new("a").off(0.5, 0.0), MadeCase::new("b").failing("crash", "signal 11")];
        let Standing::Wrong { from, .. } = cell(&both, 1).standing else { panic!("{both:?}") };
        assert_eq!(from, "in 1 of 2 cases: a; worst at floor[0] of a; crashes in b");
    }

    #[test]
    fn a_known_tolerance_covers_its_own_case_and_no_hidden_variant() {
        let mut report = known("limit");
        let with_variant =
            super::super::fixtures::report(ENGINE, "1.0", &[MadeCase::new("a").hidden(7).off(-0.15, 0.001)]);
        report.cases.extend(with_variant.cases);
        report.recordings.extend(with_variant.recordings);
        report.comparisons.extend(with_variant.comparisons);
        let found = cell_of(&report, 3);
        let Standing::Wrong { fault, .. } = &found.standing else { panic!("{found:?}") };
        assert_eq!(
            fault,
            "no known cause; the known limit of the public case does not cover it: 20 reflections at most"
        );
        // The public case is not right, so nothing is tuned to it.
        assert!(!found.spread.unwrap().is_public_only);
    }

    #[test]
    fn a_crash_in_hidden_variants_alone_shows_tuning_too() {
        let hidden = MadeCase::new("a").hidden(7).failing("crash", "signal 11");
        let found = cell(&[&three(MadeCase::new("a").off(0.0, 0.001))[..], &[hidden]].concat(), 3);
        assert!(found.spread.as_ref().unwrap().is_public_only);
        assert!(found.standing.explanation().starts_with("right in the public cases only, fails"), "{found:?}");
        assert_eq!(found.standing.place().unwrap().to_string(), "a (hidden, seed 7)");
    }

    #[test]
    fn hidden_variants_count_for_the_bound_and_not_for_the_minimum() {
        let public = MadeCase::new("a").off(0.001, 0.0);
        let hidden = MadeCase::new("a").hidden(7).off(0.004, 0.001);
        let found = cell(&[public.clone(), hidden.clone()], 1);
        assert!(matches!(found.standing, Standing::Accurate { .. }) && !found.spread.as_ref().unwrap().is_public_only);
        assert!((bound(&found) - 0.005).abs() < 1e-12);
        assert!(matches!(cell(&[public, hidden], 2).standing, Standing::NotTested { .. }));
    }

    #[test]
    fn near_zero_the_deviation_counts_in_parts_of_what_the_tolerance_begins_at() {
        let mut report = report(ENGINE, "1.0", &three(MadeCase::new("a").off(0.0, 0.0)));
        let c = &mut report.comparisons[0];
        // .05 lx off a reference of 1e-6 lx, where 1 % or .1 lx is allowed: a tenth of that is .5 % of 10 lx.
        c.tolerance.absolute = 0.1;
        c.deviation = Some(0.05);
        c.reference.as_mut().unwrap().value = 1e-6;
        assert!((bound(&cell_of(&report, 3)) - 0.005).abs() < 1e-12);
    }
}
