//! Bisect: find the release of an engine at which a verdict changed.
//!
//! The two ends select the comparisons of interest: those that pass at the good end and fail at the
//! bad one. A release is bad where any of them fails, and good where all pass. Otherwise it decides
//! nothing: a comparison is undecided or missing, or the engine crashed. Releases between the ends
//! may show that there are several changes; a remark reports that.

mod search;
#[cfg(test)]
mod tests;
mod view;

use std::collections::{BTreeMap, BTreeSet};

use serde::Serialize;

use self::search::{ReleaseState, Search};
use luxproof_model::{Comparison, MeterId, ProcedureId, Release, Report, Verdict};

/// What identifies a comparison in all releases: its case, procedure, meter, and the basis of its
/// reference.
pub type Place = (String, ProcedureId, MeterId, String);

/// The verdicts on one release by comparison.
type Verdicts = BTreeMap<Place, Verdict>;

/// The verdicts on one release, or why there are none.
pub type ReleaseVerdicts = Result<BTreeMap<Place, Verdict>, String>;

/// The place of a comparison.
fn place_of(comparison: &Comparison) -> Place {
    let basis = comparison.reference.as_ref().map_or("nothing", |r| r.basis.name());
    (comparison.key.case.clone(), comparison.key.procedure, comparison.meter.clone(), basis.to_owned())
}

/// The verdicts of a report on one engine.
pub fn verdicts_on(report: &Report, engine: &str) -> ReleaseVerdicts {
    let of_engine = report.comparisons.iter().filter(|c| c.key.engine == *engine);
    let verdicts: Verdicts = of_engine.map(|c| (place_of(c), c.verdict)).collect();
    if verdicts.values().any(|v| *v != Verdict::Missing) {
        return Ok(verdicts);
    }
    let status = report.engines.iter().find(|e| e.id == *engine);
    let why = status
        .and_then(|e| e.reason.clone())
        .or_else(|| report.skips.iter().find(|s| s.key.engine == *engine).map(|s| s.reason.clone()));
    Err(why.unwrap_or_else(|| "nothing was read and compared".to_owned()))
}

/// Whether a verdict means a right reading; `None` where it decides nothing.
const fn passes(verdict: Verdict) -> Option<bool> {
    match verdict {
        Verdict::Pass | Verdict::KnownDeviation => Some(true),
        Verdict::Fail => Some(false),
        Verdict::NotJudged | Verdict::Undecided | Verdict::UnexpectedPass | Verdict::Missing => None,
    }
}

/// Why there is no change between the ends.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Refused {
    #[error("{release} says nothing: {why}")]
    Silent { release: Release, why: String },
    #[error("both ends are alike: of {compared} comparisons none passes at {good} and fails at {bad}{undecided}")]
    Alike { good: Release, bad: Release, compared: usize, undecided: String },
    #[error(
        "{good} was called good and fails at {count} meters where {bad} passes, and nowhere is it the other way round"
    )]
    Swapped { good: Release, bad: Release, count: usize },
}

/// The release at which verdicts changed.
#[derive(Clone, Debug, Serialize)]
pub struct Bisection {
    pub engine: String,
    /// The last release that is known to be good, and the first that is known to be bad.
    pub good: String,
    pub bad: String,
    /// The releases between them that decide nothing: the change is at one of these or at the bad
    /// one.
    pub unclear: Vec<UndecidedRelease>,
    /// The comparisons that changed there.
    pub changed: Vec<Change>,
    /// The comparisons that changed only later.
    pub later: Vec<Change>,
    /// Signs of more than one change.
    pub remarks: Vec<String>,
    /// The number of releases that were run, including the two ends.
    pub runs: usize,
}

/// A release that decides nothing.
#[derive(Clone, Debug, Serialize)]
pub struct UndecidedRelease {
    pub release: String,
    pub why: String,
}

/// Comparisons of a procedure with another verdict than before.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Change {
    pub case: String,
    pub procedure: ProcedureId,
    pub meters: Vec<MeterId>,
}

impl Bisection {
    /// Whether the change is at one known release.
    pub fn is_one(&self) -> bool {
        self.unclear.is_empty()
    }
}

/// Finds where verdicts changed among releases, the good end first and the bad one last. `absent`
/// returns why a release cannot be run; such a release costs no run.
pub fn bisect<E: From<Refused>>(
    engine: &str,
    releases: &[Release],
    absent: impl Fn(&Release) -> Option<String>,
    mut ask: impl FnMut(&Release) -> Result<ReleaseVerdicts, E>,
) -> Result<Bisection, E> {
    let [first, .., last] = releases else { unreachable!("two ends are no fewer than two releases") };
    let mut verdicts: BTreeMap<usize, Verdicts> = BTreeMap::new();
    for (k, end) in [(0, first), (releases.len() - 1, last)] {
        let answer = ask(end)?.map_err(|why| Refused::Silent { release: end.clone(), why })?;
        verdicts.insert(k, answer);
    }
    let selected = select_places(first, last, &verdicts[&0], &verdicts[&(releases.len() - 1)])?;
    let (mut search, mut runs) = (Search::between(releases.len()), 2);
    while let Some(k) = search.next() {
        if let Some(why) = absent(&releases[k]) {
            search.record(k, ReleaseState::Undecided(why));
            continue;
        }
        runs += 1;
        let state = match ask(&releases[k])? {
            Ok(answer) => {
                let state = judge_release(&selected, &answer);
                verdicts.insert(k, answer);
                state
            }
            Err(why) => ReleaseState::Undecided(why),
        };
        search.record(k, state);
    }
    let (good, bad) = search.bounds();
    let mut unclear = vec![];
    for (k, release) in releases.iter().enumerate().take(bad).skip(good + 1) {
        if let Some(ReleaseState::Undecided(why)) = search.state(k) {
            unclear.push(UndecidedRelease { release: release.to_string(), why: why.clone() });
        }
    }
    let (now, later): (Vec<&Place>, Vec<&Place>) =
        selected.iter().partition(|p| passes_at(&verdicts[&bad], p) == Some(false));
    Ok(Bisection {
        engine: engine.to_owned(),
        good: releases[good].to_string(),
        bad: releases[bad].to_string(),
        unclear,
        changed: group_changes(now.into_iter()),
        later: group_changes(later.into_iter()),
        remarks: find_repeated_changes(releases, &verdicts),
        runs,
    })
}

/// Whether a comparison passes at a release; `None` where that is undecided.
fn passes_at(answer: &Verdicts, place: &Place) -> Option<bool> {
    answer.get(place).and_then(|verdict| passes(*verdict))
}

/// Selects the comparisons that pass at the good end and fail at the bad one.
fn select_places(
    good: &Release,
    bad: &Release,
    at_good: &Verdicts,
    at_bad: &Verdicts,
) -> Result<BTreeSet<Place>, Refused> {
    let mut selected = BTreeSet::new();
    let (mut swapped, mut open) = (0, 0);
    for place in at_good.keys() {
        match (passes_at(at_good, place), passes_at(at_bad, place)) {
            (Some(true), Some(false)) => {
                selected.insert(place.clone());
            }
            (Some(false), Some(true)) => swapped += 1,
            (None, _) | (_, None) => open += 1,
            _ => {}
        }
    }
    if !selected.is_empty() {
        return Ok(selected);
    }
    let (good, bad) = (good.clone(), bad.clone());
    match swapped {
        0 => {
            let undecided = if open == 0 { String::new() } else { format!("; {open} are not decided at both") };
            Err(Refused::Alike { good, bad, compared: at_good.len(), undecided })
        }
        count => Err(Refused::Swapped { good, bad, count }),
    }
}

/// The state of a release from its verdicts on the selected comparisons.
fn judge_release(selected: &BTreeSet<Place>, answer: &Verdicts) -> ReleaseState {
    let all: Vec<Option<bool>> = selected.iter().map(|place| passes_at(answer, place)).collect();
    if all.contains(&Some(false)) {
        return ReleaseState::Bad;
    }
    match all.iter().filter(|passes| passes.is_none()).count() {
        0 => ReleaseState::Good,
        open => ReleaseState::Undecided(format!("{open} of {} comparisons are undecided or missing", all.len())),
    }
}

/// Groups comparisons by case and procedure.
fn group_changes<'a>(places: impl Iterator<Item = &'a Place>) -> Vec<Change> {
    let mut all: Vec<Change> = vec![];
    for (case, procedure, meter, _) in places {
        match all.iter_mut().find(|c| c.case == *case && c.procedure == *procedure) {
            Some(change) if change.meters.contains(meter) => {}
            Some(change) => change.meters.push(meter.clone()),
            None => all.push(Change { case: case.clone(), procedure: *procedure, meters: vec![meter.clone()] }),
        }
    }
    all
}

/// Finds comparisons that change more than once between the releases that were run. Bisection finds
/// only one of several changes.
fn find_repeated_changes(releases: &[Release], verdicts: &BTreeMap<usize, Verdicts>) -> Vec<String> {
    let places: BTreeSet<&Place> = verdicts.values().flat_map(BTreeMap::keys).collect();
    let mut courses: BTreeMap<(&str, ProcedureId, String), usize> = BTreeMap::new();
    for place in places {
        let mut course: Vec<(bool, &Release)> = vec![];
        for (k, answer) in verdicts {
            let Some(passes) = passes_at(answer, place) else { continue };
            if course.last().is_none_or(|(last, _)| *last != passes) {
                course.push((passes, &releases[*k]));
            }
        }
        // Two entries are one change, as bisection expects.
        if course.len() > 2 {
            let parts: Vec<String> = course
                .iter()
                .map(|(passes, release)| format!("{} at {release}", if *passes { "passes" } else { "fails" }))
                .collect();
            *courses.entry((&place.0, place.1, parts.join(", "))).or_default() += 1;
        }
    }
    let mut remarks = vec![];
    for ((case, procedure, course), n) in courses {
        let what = if n == 1 { "comparison goes" } else { "comparisons go" };
        remarks.push(format!("{case} {procedure}: {n} {what} back and forth: {course}"));
    }
    remarks
}
