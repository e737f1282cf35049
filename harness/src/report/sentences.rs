//! What a run says that each renderer can be trusted for, a sentence each: how near its readings lie to what they are judged by where
//! they pass, and what is wrong where they do not. Everything follows from comparisons and biases; nothing is taken for granted.

use std::collections::{BTreeMap, BTreeSet, HashMap};

use itertools::Itertools;

use super::Report;
use super::claims::{Claim, Sentence, low_or_high};
use super::words::plural;
use crate::judge::{Basis, Bias, Comparison, Verdict};
use crate::record::{EngineName, EngineStatus, ProcedureId, Role, Status};

/// A mean deviation is told where chance makes one as large in a run of a thousand.
const UNLIKELY: f64 = 1e-3;

/// One for each renderer of a report.
pub(super) fn sentences(report: &Report) -> Vec<Sentence> {
    let mut judged = Judged::new();
    for c in &report.comparisons {
        judged.entry(&c.key.engine).or_default().entry(c.key.procedure).or_default().push(c);
    }
    report.engines.iter().filter(|e| e.role == Role::Renderer).map(|engine| sentence(report, engine, &judged)).collect()
}

/// What sentences rest on, as a heading.
pub(super) const HEADING: &str = "What each renderer can be trusted for, by this run";

/// Each engine's comparisons, procedure by procedure.
type Judged<'a> = BTreeMap<&'a EngineName, BTreeMap<ProcedureId, Vec<&'a Comparison>>>;

fn sentence(report: &Report, engine: &EngineStatus, judged: &Judged<'_>) -> Sentence {
    let nothing = BTreeMap::new();
    let mine = judged.get(&engine.id).unwrap_or(&nothing);
    let told = report.procedures();
    let claims: Vec<Claim> =
        mine.iter().filter(|(p, _)| told.contains(p)).map(|(p, mine)| claim(report, &engine.id, *p, mine)).collect();
    let (known, asked): (Vec<&Claim>, Vec<&Claim>) = claims.iter().partition(|c| c.procedure.is_known());
    let mut parts: Vec<String> = vec![];
    let trusted = asked.iter().filter(|c| c.is_sound()).map(|c| c.trusted()).collect_vec();
    if !trusted.is_empty() {
        parts.push(trusted.join(", "));
    }
    for claim in asked.iter().copied().chain(known.iter().copied()).filter(|c| !c.is_sound()) {
        parts.push(doubted(claim, report, &mine[&claim.procedure]));
    }
    let (right, on_record): (Vec<&&Claim>, Vec<&&Claim>) =
        known.iter().filter(|c| c.is_sound()).partition(|c| c.known_deviations == 0);
    parts.extend(on_record.iter().map(|c| c.trusted()));
    if asked.is_empty() && !right.is_empty() {
        let which = if parts.is_empty() { "scenes of known answer alone" } else { "other scenes of known answer" };
        parts.push(format!("{which} were read right"));
    }
    if parts.is_empty() || matches!(engine.status, Status::Failed | Status::Absent) {
        let why = engine.reason.as_deref().map(|r| format!(": {}", in_a_line(r))).unwrap_or_default();
        parts.push(match engine.status {
            Status::Absent => format!("not there{why}"),
            Status::Failed => format!("it failed{why}"),
            _ => "nothing of it was judged".to_owned(),
        });
    }
    Sentence { engine: engine.id.clone(), text: format!("{}: {}", engine.id, parts.join("; ")), claims }
}

/// A reason in one line: of a program that failed its last words, where it says why; of all else the first.
fn in_a_line(reason: &str) -> String {
    let mut lines = reason.lines().filter(|line| !line.starts_with("all its messages are in "));
    let first = lines.next().unwrap_or_default();
    match (first.split_once(" failed (").and_then(|_| first.split_once("): ")), lines.next_back()) {
        (Some((program, _)), Some(last)) => format!("{program}): {}", last.trim()),
        _ => first.to_owned(),
    }
}

fn claim(report: &Report, engine: &EngineName, procedure: ProcedureId, mine: &[&Comparison]) -> Claim {
    let count = |is: fn(Verdict) -> bool| mine.iter().filter(|c| is(c.verdict)).count();
    let best = best(mine);
    let within = best.iter().filter(|c| c.verdict == Verdict::Pass).filter_map(|c| reach(c)).reduce(f64::max);
    // Of readings that pass: what is on record is told apart.
    let mut passing: HashMap<(&str, Option<Basis>), bool> = HashMap::new();
    for c in &best {
        *passing.entry((&c.key.case, basis(c))).or_insert(true) &= c.verdict == Verdict::Pass;
    }
    let all_pass = |b: &Bias| passing.get(&(b.key.case.as_str(), Some(b.basis))) == Some(&true);
    let is_firm = |b: &&Bias| {
        let is_plain = b.p_value.is_some_and(|p| p < UNLIKELY) && b.low.signum() == b.high.signum();
        b.key.engine == *engine && b.key.procedure == procedure && is_plain && all_pass(b)
    };
    let bias = report.bias.iter().filter(is_firm).map(|b| b.mean).max_by(|a, b| a.abs().total_cmp(&b.abs()));
    Claim {
        procedure,
        readings: mine.len(),
        within,
        failed: count(|v| v == Verdict::Fail),
        undecided: count(|v| v == Verdict::Inconclusive),
        known_deviations: count(|v| matches!(v, Verdict::KnownDeviation | Verdict::NotJudged)),
        missing: count(|v| v == Verdict::Missing),
        bias,
    }
}

/// The comparisons that tell how near readings are: a printed cell knows no more than its digits, and where there is something better to
/// hold readings against, that counts.
fn best<'a>(mine: &[&'a Comparison]) -> Vec<&'a Comparison> {
    let (printed, better): (Vec<_>, Vec<_>) = mine.iter().partition(|c| basis(c) == Some(Basis::Published));
    if better.is_empty() { printed } else { better }
}

fn basis(c: &Comparison) -> Option<Basis> {
    c.reference.as_ref().map(|reference| reference.basis)
}

/// How far a reading may lie off its reference, relative but for ratings: its deviation and the interval about it. Where a tolerance is
/// one of lux, what is relative begins with the light of which that is as much.
fn reach(c: &Comparison) -> Option<f64> {
    let expanded = c.budget.as_ref().map_or(0.0, |b| b.expanded);
    if !c.quantity.has_zero() {
        return Some(c.deviation?.abs() + expanded);
    }
    let governed = if c.tolerance.relative > 0.0 { c.tolerance.absolute / c.tolerance.relative } else { 0.0 };
    let scale = c.reference.as_ref()?.value.abs().max(governed);
    Some((c.deviation?.abs() + expanded) / scale).filter(|r| r.is_finite())
}

/// `direct: reads 2 to 12 % low at 3 of 14 readings with area luminaires, the others within 0.1 %`.
fn doubted(claim: &Claim, report: &Report, mine: &[&Comparison]) -> String {
    let failing = mine.iter().copied().filter(|c| c.verdict == Verdict::Fail).collect_vec();
    let mut parts = vec![];
    if !failing.is_empty() {
        let deviations = failing.iter().filter_map(|c| c.relative_deviation).collect_vec();
        let (low, high) =
            deviations.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), d| (l.min(*d), h.max(*d)));
        let by =
            if deviations.is_empty() { "is wrong".to_owned() } else { format!("reads {}", low_or_high(low, high)) };
        let of = if failing.len() == mine.len() { "all" } else { &failing.len().to_string() };
        parts.push(format!("{by} at {of} of {}{}", plural(mine.len(), "reading"), place(report, &failing, mine)));
    }
    for (count, what) in [(claim.undecided, "undecided"), (claim.missing, "not read")] {
        if count > 0 {
            parts.push(format!("{what} at {count} of {}", plural(mine.len(), "reading")));
        }
    }
    if let Some(within) = claim.within {
        parts.push(format!("the rest within {}", claim.reach(within)));
    }
    format!("{}: {}", claim.name(), parts.join(", "))
}

/// What is common to readings that fail and to none that pass: a model of luminaires, bodies in the room, a case, a meter.
fn place(report: &Report, failing: &[&Comparison], all: &[&Comparison]) -> String {
    let passing = all.iter().copied().filter(|c| c.verdict == Verdict::Pass).collect_vec();
    let bodies: BTreeSet<&str> = report.cases.iter().filter(|case| case.has_bodies).map(|case| &*case.name).collect();
    let has_bodies = |c: &Comparison| bodies.contains(&*c.key.case);
    let mut words = String::new();
    if failing.iter().all(|c| has_bodies(c))
        && passing.iter().any(|c| !has_bodies(c))
        && !passing.iter().any(|c| has_bodies(c))
    {
        words += " in rooms with bodies";
    }
    let models: BTreeSet<&str> = failing.iter().map(|c| c.model.as_str()).collect();
    let is_apart = !passing.is_empty() && passing.iter().all(|c| !models.contains(c.model.as_str()));
    if let ([model], true) = (&models.iter().collect_vec()[..], is_apart) {
        words += &format!(" with {model} luminaires");
    }
    if words.is_empty() && report.is_suite() {
        let cases: BTreeSet<&str> = failing.iter().map(|c| c.key.case.as_str()).collect();
        words = match Vec::from_iter(cases)[..] {
            [one] => format!(" in {one}"),
            ref several if several.len() < report.asked() => format!(" in {}", plural(several.len(), "case")),
            _ => String::new(),
        };
    }
    match failing {
        [one] => format!("{words}, at {}", one.meter),
        _ => words,
    }
}

#[cfg(test)]
mod tests;
