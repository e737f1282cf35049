//! Bisect: the release of an engine at which a verdict changed.
//!
//! The two ends say which comparisons are meant: those that pass at the good one and fail at the bad one. A release is bad where
//! any of these fails, good where all pass, and else it says nothing: undecided, missing, crashed. A release looked at may show
//! that the change is no single one; that is told.

mod search;
#[cfg(test)]
mod tests;
mod view;

use std::collections::{BTreeMap, BTreeSet};

use serde::Serialize;

use self::search::{Like, Search};
use crate::judge::Verdict;
use crate::record::{MeterId, ProcedureId, Release};
use crate::report::Report;

/// What is compared, whichever release reads it: its case, procedure, meter, and what kind of reference it is held against.
pub type Place = (String, ProcedureId, MeterId, String);

/// The verdicts on a release, or why there are none.
pub type Look = Result<BTreeMap<Place, Verdict>, String>;

/// What a report says of one engine.
pub fn look(report: &Report, engine: &str) -> Look {
    let own = report.comparisons.iter().filter(|c| c.key.engine == *engine);
    let place = |c: &crate::judge::Comparison| {
        let basis = c.reference.as_ref().map_or("nothing", |r| r.basis.name());
        (c.key.case.clone(), c.key.procedure, c.meter.clone(), basis.to_owned())
    };
    let verdicts: BTreeMap<Place, Verdict> = own.map(|c| (place(c), c.verdict)).collect();
    let is_read = verdicts.values().any(|v| *v != Verdict::Missing);
    if is_read {
        return Ok(verdicts);
    }
    let status = report.engines.iter().find(|e| e.id == *engine);
    let skipped = || report.skips.iter().find(|s| s.key.engine == *engine).map(|s| s.reason.clone());
    let why = status.and_then(|e| e.reason.clone()).or_else(skipped);
    Err(why.unwrap_or_else(|| "nothing was read and compared".to_owned()))
}

/// Whether a verdict is that of a sound reading; `None` where it decides nothing.
const fn passes(verdict: Verdict) -> Option<bool> {
    match verdict {
        Verdict::Pass | Verdict::KnownDeviation => Some(true),
        Verdict::Fail => Some(false),
        Verdict::NotJudged | Verdict::Inconclusive | Verdict::UnexpectedPass | Verdict::Missing => None,
    }
}

/// Why there is nothing to be found between the ends.
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

/// What was found.
#[derive(Clone, Debug, Serialize)]
pub struct Found {
    pub engine: String,
    /// The last that is known to be good, and the first that is known to be bad.
    pub good: String,
    pub bad: String,
    /// Those between them that say nothing: the change is at one of these or at the bad one.
    pub unclear: Vec<Silent>,
    /// What changed there.
    pub changed: Vec<Change>,
    /// What passes at the good end, fails at the bad end, and had not changed yet.
    pub later: Vec<Change>,
    /// What speaks against one change for good.
    pub remarks: Vec<String>,
    /// How many releases were run, the two ends among them.
    pub runs: usize,
}

#[derive(Clone, Debug, Serialize)]
pub struct Silent {
    pub release: String,
    pub why: String,
}

/// Comparisons of a procedure that have another verdict.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Change {
    pub case: String,
    pub procedure: ProcedureId,
    pub meters: Vec<MeterId>,
}

impl Found {
    /// Whether it is one release.
    pub fn is_one(&self) -> bool {
        self.unclear.is_empty()
    }
}

/// Finds where verdicts changed among releases, the good end first and the bad one last. `absent` says why one cannot be asked, which
/// costs no run.
pub fn bisect<E: From<Refused>>(
    engine: &str,
    releases: &[Release],
    absent: impl Fn(&Release) -> Option<String>,
    mut ask: impl FnMut(&Release) -> Result<Look, E>,
) -> Result<Found, E> {
    let [first, .., last] = releases else { unreachable!("two ends are no fewer than two releases") };
    let mut looks: BTreeMap<usize, BTreeMap<Place, Verdict>> = BTreeMap::new();
    for (k, end) in [(0, first), (releases.len() - 1, last)] {
        let silent = |why| Refused::Silent { release: end.clone(), why };
        looks.insert(k, ask(end)?.map_err(silent)?);
    }
    let meant = meant(first, last, &looks[&0], &looks[&(releases.len() - 1)])?;
    let (mut search, mut runs) = (Search::between(releases.len()), 2);
    while let Some(k) = search.next() {
        if let Some(why) = absent(&releases[k]) {
            search.told(k, Like::Nothing(why));
            continue;
        }
        runs += 1;
        let like = match ask(&releases[k])? {
            Ok(look) => {
                let like = like(&meant, &look);
                looks.insert(k, look);
                like
            }
            Err(why) => Like::Nothing(why),
        };
        search.told(k, like);
    }
    let (good, bad) = search.bounds();
    let silent = |k: usize| match search.known(k) {
        Some(Like::Nothing(why)) => Some(Silent { release: releases[k].to_string(), why: why.clone() }),
        _ => None,
    };
    let (now, later): (Vec<&Place>, Vec<&Place>) = meant.iter().partition(|p| is_at(&looks[&bad], p) == Some(false));
    Ok(Found {
        engine: engine.to_owned(),
        good: releases[good].to_string(),
        bad: releases[bad].to_string(),
        unclear: (good + 1..bad).filter_map(silent).collect(),
        changed: changes(now.into_iter()),
        later: changes(later.into_iter()),
        remarks: back_and_forth(releases, &looks),
        runs,
    })
}

/// Whether a comparison passes in a look; `None` where that is not decided.
fn is_at(look: &BTreeMap<Place, Verdict>, place: &Place) -> Option<bool> {
    look.get(place).and_then(|verdict| passes(*verdict))
}

/// The comparisons that pass at one end and fail at the other.
fn meant(
    good: &Release,
    bad: &Release,
    at_good: &BTreeMap<Place, Verdict>,
    at_bad: &BTreeMap<Place, Verdict>,
) -> Result<BTreeSet<Place>, Refused> {
    let both = || at_good.keys().map(|place| (place, is_at(at_good, place), is_at(at_bad, place)));
    let of = |from, to| both().filter(move |(_, g, b)| (*g, *b) == (Some(from), Some(to)));
    let meant: BTreeSet<Place> = of(true, false).map(|(place, ..)| place.clone()).collect();
    if !meant.is_empty() {
        return Ok(meant);
    }
    let (good, bad) = (good.clone(), bad.clone());
    match of(false, true).count() {
        0 => {
            let open = both().filter(|(_, g, b)| g.is_none() || b.is_none()).count();
            let undecided = if open == 0 { String::new() } else { format!("; {open} are not decided at both") };
            Err(Refused::Alike { good, bad, compared: at_good.len(), undecided })
        }
        count => Err(Refused::Swapped { good, bad, count }),
    }
}

fn like(meant: &BTreeSet<Place>, look: &BTreeMap<Place, Verdict>) -> Like {
    let all: Vec<Option<bool>> = meant.iter().map(|place| is_at(look, place)).collect();
    if all.contains(&Some(false)) {
        return Like::Bad;
    }
    match all.iter().filter(|passes| passes.is_none()).count() {
        0 => Like::Good,
        open => Like::Nothing(format!("{open} of {} comparisons are undecided or missing", all.len())),
    }
}

/// By case and procedure.
fn changes<'a>(places: impl Iterator<Item = &'a Place>) -> Vec<Change> {
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

/// What passes, fails and passes again, or the other way round, as far as releases were looked at: bisection finds one of several changes.
fn back_and_forth(releases: &[Release], looks: &BTreeMap<usize, BTreeMap<Place, Verdict>>) -> Vec<String> {
    let places: BTreeSet<&Place> = looks.values().flat_map(BTreeMap::keys).collect();
    let mut courses: BTreeMap<(&str, ProcedureId, String), usize> = BTreeMap::new();
    for place in places {
        let mut course: Vec<(bool, &Release)> = vec![];
        for (k, look) in looks {
            let Some(passes) = is_at(look, place) else { continue };
            if course.last().is_none_or(|(last, _)| *last != passes) {
                course.push((passes, &releases[*k]));
            }
        }
        if course.len() > 2 {
            let word = |passes: bool| if passes { "passes" } else { "fails" };
            let told: Vec<String> = course.iter().map(|(p, release)| format!("{} at {release}", word(*p))).collect();
            *courses.entry((&place.0, place.1, told.join(", "))).or_default() += 1;
        }
    }
    let told = |((case, procedure, course), n): (&(&str, ProcedureId, String), &usize)| {
        format!(
            "{case} {procedure}: {n} {} back and forth: {course}",
            if *n == 1 { "comparison goes" } else { "comparisons go" }
        )
    };
    courses.iter().map(told).collect()
}
