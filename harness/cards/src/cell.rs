//! The rule: evidence of cases to a cell of the matrix. The worst case counts.

use std::collections::BTreeSet;

use itertools::Itertools;
use luxproof_model::numbers::plural;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::{Capability, CaseEvidence, Deviation, Measurement, Outcome, Remark};

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
    /// Cases of the capability that no run has.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub missing: Vec<String>,
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
        worst: Option<Deviation>,
    },
    /// It is right within limits, or not decided.
    Limited {
        what: String,
        /// Where: cases and points.
        from: String,
        worst: Option<Deviation>,
    },
    /// One point is enough.
    Wrong {
        fault: String,
        from: String,
        worst: Option<Deviation>,
    },
    NotSupported {
        reason: String,
    },
    NotTested {
        reason: String,
    },
}

/// The largest bounds of public cases and of their hidden variants.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Spread {
    pub public: Option<Deviation>,
    pub hidden: Option<Deviation>,
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
            Self::NotSupported { .. } => "–",
            Self::NotTested { .. } => "·",
        }
    }

    /// Whether nothing is known.
    pub const fn is_untested(&self) -> bool {
        matches!(self, Self::NotTested { .. })
    }

    /// The deviation with the largest bound behind it.
    pub const fn worst(&self) -> Option<Deviation> {
        match self {
            Self::Accurate { worst } | Self::Limited { worst, .. } | Self::Wrong { worst, .. } => *worst,
            Self::NotSupported { .. } | Self::NotTested { .. } => None,
        }
    }

    /// The cell in a few words: `within 0.84 %`, `wrong, up to 12 %`, `not tested`.
    pub fn headline(&self) -> String {
        match self {
            Self::Accurate { worst: Some(worst) } => format!("within {}", worst.bound_text()),
            Self::Accurate { worst: None } => "accurate".to_owned(),
            Self::Limited { worst: Some(worst), .. } => format!("limited, up to {}", worst.bound_text()),
            Self::Wrong { worst: Some(worst), .. } => format!("wrong, up to {}", worst.bound_text()),
            Self::Limited { .. } | Self::Wrong { .. } | Self::NotSupported { .. } | Self::NotTested { .. } => {
                self.word().to_owned()
            }
        }
    }

    /// What stands behind the headline: the fault, the limit or the reason, and where.
    pub fn explanation(&self) -> String {
        match self {
            Self::Accurate { worst: Some(worst) } => {
                format!("every point of every case passes; the worst deviates by {worst}")
            }
            Self::Accurate { worst: None } => "every point of every case passes".to_owned(),
            Self::Limited { what: text, from, .. } | Self::Wrong { fault: text, from, .. } => {
                format!("{text} ({from})")
            }
            Self::NotSupported { reason } | Self::NotTested { reason } => reason.clone(),
        }
    }
}

/// The cell of a capability by the evidence of one release, public and hidden.
///
/// Faults come first: one is enough, in whatever case. Then too few cases are `not tested`. Everything that is neither a pass nor a
/// fault limits the cell. Only what passes everywhere is accurate.
pub fn judge(capability: &Capability, evidence: &[CaseEvidence]) -> Cell {
    let (public, hidden): (Vec<_>, Vec<_>) = evidence.iter().partition(|e| e.hidden.is_none());
    let tested: BTreeSet<&str> = public.iter().filter(|e| e.measurement().is_some()).map(|e| e.case.as_str()).collect();
    let is_there = |case: &str| public.iter().any(|e| e.case == case);
    let named = capability.cases.iter().map(|selector| selector.case.as_str()).unique();
    let missing: Vec<String> = named.filter(|case| !is_there(case)).map(str::to_owned).collect();
    let spread = spread(&public, &hidden);
    let standing = wrong(evidence, spread.as_ref())
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
        spread,
    }
}

/// How much larger than that of the public case the bound of a hidden variant may be with the same cause.
const SAME_CAUSE_FACTOR: f64 = 2.0;

/// Gives hidden variants the known limits of their public case.
///
/// Known deviations are on record by content, so that none is about a variant. Where a limit of the method explains the public case,
/// a variant that deviates in the same size shows the same limit, and no fault that the public case lacks.
pub(crate) fn inherit_limits(evidence: &mut [CaseEvidence]) {
    let public = evidence.iter().filter(|e| e.hidden.is_none() && e.faults().is_empty());
    let limits = public.flat_map(|e| {
        let named = e.limits().into_iter().filter(|limit| !limit.text.is_empty());
        named.map(|limit| (e.case.clone(), e.procedure, limit.text.clone(), limit.bound()))
    });
    let limits = limits.into_group_map_by(|(case, procedure, ..)| (case.clone(), *procedure));
    for variant in evidence.iter_mut().filter(|e| e.hidden.is_some()) {
        let (case, procedure) = (variant.case.clone(), variant.procedure);
        let Outcome::Measured(measurement) = &mut variant.outcome else { continue };
        for remark in &mut measurement.remarks {
            let Remark::Fault { points, worst: Some(worst), at, .. } = remark else { continue };
            let mut known = limits.get(&(case.clone(), procedure)).into_iter().flatten();
            let known = known.find(|(_, _, _, bound)| worst.bound() <= SAME_CAUSE_FACTOR * bound);
            if let Some((_, _, text, _)) = known {
                *remark = Remark::Limit {
                    text: format!("as in the public case: {text}"),
                    points: *points,
                    worst: Some(*worst),
                    at: at.clone(),
                };
            }
        }
    }
}

impl CaseEvidence {
    /// Its values, where there are any.
    pub const fn measurement(&self) -> Option<&Measurement> {
        match &self.outcome {
            Outcome::Measured(measurement) => Some(measurement),
            Outcome::Unsupported { .. } | Outcome::NotRun { .. } | Outcome::Failed { .. } => None,
        }
    }

    /// The faults that it shows: text, worst deviation and place.
    fn faults(&self) -> Vec<Flaw<'_>> {
        match &self.outcome {
            Outcome::Failed { reason } => {
                vec![Flaw { case: self, text: format!("it fails: {reason}"), worst: None, at: None }]
            }
            Outcome::Measured(measurement) => {
                let remarks = measurement.remarks.iter();
                remarks.filter_map(|remark| Flaw::of_fault(self, remark)).collect()
            }
            Outcome::Unsupported { .. } | Outcome::NotRun { .. } => vec![],
        }
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
    let at = worst.at.as_ref().map(|at| format!("; worst at {at} of {}", place(worst.case))).unwrap_or_default();
    Some((worst, format!("in {count} of {}: {listed}{more}{variants}{at}", plural(run, "case"))))
}

/// The name of a case; a hidden variant says so.
fn place(evidence: &CaseEvidence) -> String {
    match &evidence.hidden {
        Some(variant) => format!("{} (hidden, seed {})", evidence.case, variant.seed),
        None => evidence.case.clone(),
    }
}

fn wrong(evidence: &[CaseEvidence], spread: Option<&Spread>) -> Option<Standing> {
    let faults = evidence.iter().flat_map(CaseEvidence::faults).collect();
    let (worst, from) = gravest(faults, evidence)?;
    let fault = if spread.is_some_and(|spread| spread.is_public_only) {
        format!("right in the public cases only, wrong in their hidden variants: {}", worst.text)
    } else {
        worst.text
    };
    Some(Standing::Wrong { fault, from, worst: worst.worst })
}

/// A cell with too few values for a claim.
fn without_values(
    capability: &Capability,
    public: &[&CaseEvidence],
    tested: usize,
    missing: &[String],
) -> Option<Standing> {
    if tested >= capability.minimum_cases {
        return None;
    }
    let declined = public.iter().filter_map(|e| match &e.outcome {
        Outcome::Unsupported { reason } => Some(reason.as_str()),
        Outcome::Measured(_) | Outcome::NotRun { .. } | Outcome::Failed { .. } => None,
    });
    let declined: Vec<&str> = declined.unique().collect();
    if tested == 0
        && !declined.is_empty()
        && missing.is_empty()
        && public.iter().all(|e| !matches!(e.outcome, Outcome::NotRun { .. }))
    {
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
            let elsewhere = worst_of(evidence.iter()).map(|worst| format!("; elsewhere within {}", worst.bound_text()));
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

/// The deviation with the largest bound.
fn worst_of<'a>(evidence: impl Iterator<Item = &'a CaseEvidence>) -> Option<Deviation> {
    let all = evidence.filter_map(CaseEvidence::measurement).filter_map(|m| m.worst);
    all.max_by(|a, b| a.bound().total_cmp(&b.bound()))
}

/// Public against hidden cases, of the same procedures; `None` without hidden ones.
fn spread(public: &[&CaseEvidence], hidden: &[&CaseEvidence]) -> Option<Spread> {
    let seeds: BTreeSet<u64> = hidden.iter().filter_map(|e| e.hidden.as_ref()).map(|variant| variant.seed).collect();
    if seeds.is_empty() {
        return None;
    }
    let is_varied = |e: &&&CaseEvidence| hidden.iter().any(|h| h.case == e.case && h.procedure == e.procedure);
    let paired: Vec<&CaseEvidence> = public.iter().filter(is_varied).copied().collect();
    let is_spotless = |e: &&CaseEvidence| e.measurement().is_some() && e.faults().is_empty() && e.limits().is_empty();
    let is_exposed = |e: &CaseEvidence| {
        let of_public = paired.iter().copied().filter(|p| p.case == e.case && p.procedure == e.procedure);
        !e.faults().is_empty() && of_public.into_iter().any(|p| is_spotless(&p))
    };
    let has_public_fault = public.iter().any(|e| !e.faults().is_empty());
    Some(Spread {
        public: worst_of(paired.iter().copied()),
        hidden: worst_of(hidden.iter().copied()),
        seeds: seeds.into_iter().collect(),
        is_public_only: !has_public_fault && hidden.iter().any(|e| is_exposed(e)),
    })
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
        assert_eq!(worst.map(|d| d.value), Some(0.05));
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
        assert!((worst.unwrap().bound() - 0.121).abs() < 1e-12);
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
        assert_eq!(found.standing.headline(), "wrong, up to 50 %");
    }

    #[test]
    fn what_an_engine_declines_is_not_supported_and_a_crash_is_a_fault() {
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
        assert!(crash.standing.explanation().starts_with("it fails: signal 11"), "{crash:?}");
        let declined = cell(&three(MadeCase::new("a").failing("declined", "no bodies")), 2);
        assert!(matches!(declined.standing, Standing::Limited { .. }), "{declined:?}");
        // What had no time says nothing about the engine.
        let late = cell(&three(MadeCase::new("a").failing("time_up", "no time was left")), 3);
        assert!(matches!(late.standing, Standing::NotTested { .. }), "{late:?}");
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
        // A file that it rejects gives no wrong light; the place of its log is not published.
        for recording in &mut report.recordings {
            recording.failure =
                Some("ies2rad failed:   - /home/me/lib.so\n  - /home/me/b.so\nunsupported type\nall its messages are in /home/me/log".to_owned());
            recording.failure_kind = Some(luxproof_model::FailureKind::Crash);
        }
        let rejected =
            Standing::NotSupported { reason: "it does not read the file: ies2rad failed; unsupported type".to_owned() };
        assert_eq!(judged(&report), rejected);
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
        assert_eq!(spread.public.map(|d| d.value), Some(0.0));
        assert_eq!(spread.hidden.map(|d| (d.value, d.measure)), Some((0.05, Measure::Relative)));
        assert_eq!((found.tested_cases, found.hidden_variants), (3, 1));
    }

    #[test]
    fn a_limit_of_a_public_case_explains_its_variant_if_that_deviates_no_more_than_twice_as_much() {
        for (off, is_limited) in [(-0.15, true), (-0.5, false)] {
            let mut report = known("limit");
            let with_variant =
                super::super::fixtures::report(ENGINE, "1.0", &[MadeCase::new("a").hidden(7).off(off, 0.001)]);
            report.cases.extend(with_variant.cases);
            report.recordings.extend(with_variant.recordings);
            report.comparisons.extend(with_variant.comparisons);
            let capabilities = capabilities(3);
            let mut evidence = evidence_of(&report, &capabilities);
            inherit_limits(&mut evidence);
            let found = judge(&capabilities.capabilities[0], &evidence);
            assert_eq!(matches!(found.standing, Standing::Limited { .. }), is_limited, "{found:?}");
            // The public case is not right, so nothing is tuned to it.
            assert!(!found.spread.unwrap().is_public_only);
        }
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
