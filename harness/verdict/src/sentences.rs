//! One sentence for each renderer of a report: how close its readings are where they pass, and what is wrong elsewhere.
//!
//! All of it follows from comparisons and biases.

use std::collections::{BTreeMap, BTreeSet, HashMap};

use itertools::Itertools;

use super::claims::{claim_name, describe_range, describe_reach, describe_sound};
use luxproof_model::Report;
use luxproof_model::numbers::plural;
use luxproof_model::{Basis, Bias, Comparison, Verdict};
use luxproof_model::{EngineName, EngineStatus, ProcedureId, Status};
use luxproof_model::{ProcedureClaim, Sentence};

/// Probability of a mean deviation by chance below which a sentence reports it.
const MAX_BIAS_P_VALUE: f64 = 1e-3;

/// Writes the sentence of each renderer of a report.
pub fn sentences(report: &Report) -> Vec<Sentence> {
    let mut judged = ComparisonsByEngine::new();
    for c in &report.comparisons {
        judged.entry(&c.key.engine).or_default().entry(c.key.procedure).or_default().push(c);
    }
    report.engines.iter().filter(|e| e.role.is_judged()).map(|engine| sentence(report, engine, &judged)).collect()
}

/// Each engine's comparisons by procedure.
type ComparisonsByEngine<'a> = BTreeMap<&'a EngineName, BTreeMap<ProcedureId, Vec<&'a Comparison>>>;

fn sentence(report: &Report, engine: &EngineStatus, judged: &ComparisonsByEngine<'_>) -> Sentence {
    let nothing = BTreeMap::new();
    let by_procedure = judged.get(&engine.id).unwrap_or(&nothing);
    let procedures = report.procedures();
    let mut claims: Vec<ProcedureClaim> = vec![];
    for (procedure, comparisons) in by_procedure.iter().filter(|(p, _)| procedures.contains(p)) {
        claims.push(claim(report, &engine.id, *procedure, comparisons));
    }
    let (known, asked): (Vec<&ProcedureClaim>, Vec<&ProcedureClaim>) =
        claims.iter().partition(|c| c.procedure.is_calibration());
    let mut parts: Vec<String> = vec![];
    let sound = asked.iter().filter(|c| c.is_sound()).map(|c| describe_sound(c)).collect_vec();
    if !sound.is_empty() {
        parts.push(sound.join(", "));
    }
    for claim in asked.iter().copied().chain(known.iter().copied()).filter(|c| !c.is_sound()) {
        parts.push(describe_unsound(claim, report, &by_procedure[&claim.procedure]));
    }
    let (right, on_record): (Vec<&&ProcedureClaim>, Vec<&&ProcedureClaim>) =
        known.iter().filter(|c| c.is_sound()).partition(|c| c.known_deviations == 0);
    parts.extend(on_record.iter().map(|c| describe_sound(c)));
    if asked.is_empty() && !right.is_empty() {
        let which = if parts.is_empty() { "scenes of known answer alone" } else { "other scenes of known answer" };
        parts.push(format!("{which} were read right"));
    }
    parts.extend(report.failed_biases().filter(|b| b.key.engine == engine.id).map(|b| describe_failed_bias(report, b)));
    if report.failed_claims().any(|(recording, _)| recording.key.engine == engine.id) {
        parts.push("repetition refutes the errors that it states".to_owned());
    }
    if declines_calibration(report, &engine.id) && !asked.is_empty() {
        parts
            .insert(0, "not judged, because it declined every scene of known answer; by its other readings".to_owned());
    }
    if parts.is_empty() || matches!(engine.status, Status::Failed | Status::Absent) {
        let why = engine.reason.as_deref().map(|r| format!(": {}", shorten_reason(r))).unwrap_or_default();
        parts.push(match engine.status {
            Status::Absent => format!("not there{why}"),
            Status::Failed => format!("it failed{why}"),
            _ => "nothing of it was judged".to_owned(),
        });
    }
    Sentence { engine: engine.id.clone(), text: format!("{}: {}", engine.id, parts.join("; ")), claims }
}

/// Describes a bias beyond the tolerance where no single reading fails.
fn describe_failed_bias(report: &Report, bias: &Bias) -> String {
    let case = report.of_suite(&bias.key.case, ": ");
    let procedure = bias.key.procedure.short().to_lowercase();
    format!("{case}{procedure}: fails as a whole, {}", describe_range(bias.mean, bias.mean))
}

/// Whether a user's program skipped every scene of known answer that it was asked for.
fn declines_calibration(report: &Report, engine: &EngineName) -> bool {
    let mut read = report.recordings.iter().filter(|r| r.key.engine == *engine && r.key.procedure.is_calibration());
    let mut skipped = report.skips.iter().filter(|s| s.key.engine == *engine && s.key.procedure.is_calibration());
    luxproof_engines::entry(engine).is_none() && read.next().is_none() && skipped.any(|s| s.scope.leaves_no_reading())
}

/// A reason in one line: the last line of a failed program's messages, which names the cause, else the first.
fn shorten_reason(reason: &str) -> String {
    let mut lines = reason.lines().filter(|line| !line.starts_with("all its messages are in "));
    let first = lines.next().unwrap_or_default();
    match (first.split_once(" failed (").and_then(|_| first.split_once("): ")), lines.next_back()) {
        (Some((program, _)), Some(last)) => format!("{program}): {}", last.trim()),
        _ => first.to_owned(),
    }
}

/// Summarizes an engine's comparisons of one procedure.
fn claim(report: &Report, engine: &EngineName, procedure: ProcedureId, comparisons: &[&Comparison]) -> ProcedureClaim {
    let best = best_comparisons(comparisons);
    let within = best.iter().filter(|c| c.verdict == Verdict::Pass).filter_map(|c| reach(c)).reduce(f64::max);
    let mut counts: HashMap<Verdict, usize> = HashMap::new();
    for c in comparisons {
        *counts.entry(c.verdict).or_default() += 1;
    }
    let count = |verdict| counts.get(&verdict).copied().unwrap_or(0);
    ProcedureClaim {
        procedure,
        readings: comparisons.len(),
        within,
        failed: count(Verdict::Fail),
        undecided: count(Verdict::Undecided),
        known_deviations: count(Verdict::KnownDeviation) + count(Verdict::NotJudged),
        missing: count(Verdict::Missing),
        bias: largest_bias(report, engine, procedure, &best),
    }
}

/// The largest bias that is no chance, of cases without a failing reading.
///
/// Known deviations have words of their own, so their bias is left out.
fn largest_bias(report: &Report, engine: &EngineName, procedure: ProcedureId, best: &[&Comparison]) -> Option<f64> {
    let mut passing: HashMap<(&str, Option<Basis>), bool> = HashMap::new();
    for c in best {
        *passing.entry((&c.key.case, basis(c))).or_insert(true) &= c.verdict == Verdict::Pass;
    }
    report
        .bias
        .iter()
        .filter(|b| b.key.engine == *engine && b.key.procedure == procedure && is_significant(b))
        .filter(|b| passing.get(&(b.key.case.as_str(), Some(b.basis))) == Some(&true))
        .map(|b| b.mean)
        .max_by(|a, b| a.abs().total_cmp(&b.abs()))
}

/// Whether a bias is improbable by chance and its interval on one side of zero.
fn is_significant(bias: &Bias) -> bool {
    bias.p_value.is_some_and(|p| p < MAX_BIAS_P_VALUE) && bias.low.signum() == bias.high.signum()
}

/// The comparisons that show best how close readings are.
///
/// Printed cells count only where there is no other reference, because they know no more than their digits.
fn best_comparisons<'a>(comparisons: &[&'a Comparison]) -> Vec<&'a Comparison> {
    let (printed, better): (Vec<_>, Vec<_>) = comparisons.iter().partition(|c| basis(c) == Some(Basis::Published));
    if better.is_empty() { printed } else { better }
}

fn basis(c: &Comparison) -> Option<Basis> {
    c.reference.as_ref().map(|reference| reference.basis)
}

/// The largest deviation of a reading within its interval, relative except for ratings.
///
/// Below the light at which an absolute tolerance equals the relative one, the deviation is relative to that light.
fn reach(c: &Comparison) -> Option<f64> {
    let expanded = c.budget.as_ref().map_or(0.0, |b| b.expanded);
    if !c.quantity.has_zero() {
        return Some(c.deviation?.abs() + expanded);
    }
    let least_light = if c.tolerance.relative > 0.0 { c.tolerance.absolute / c.tolerance.relative } else { 0.0 };
    let scale = c.reference.as_ref()?.value.abs().max(least_light);
    Some((c.deviation?.abs() + expanded) / scale).filter(|r| r.is_finite())
}

/// Describes failures: `direct: reads 2 to 12 % low at 3 of 14 readings with area luminaires, the others within 0.1 %`.
fn describe_unsound(claim: &ProcedureClaim, report: &Report, comparisons: &[&Comparison]) -> String {
    let readings = plural(comparisons.len(), "reading");
    let failing = comparisons.iter().copied().filter(|c| c.verdict == Verdict::Fail).collect_vec();
    let mut parts = vec![];
    if !failing.is_empty() {
        let of = if failing.len() == comparisons.len() { "all" } else { &failing.len().to_string() };
        let place = describe_place(report, &failing, comparisons);
        parts.push(format!("{} at {of} of {readings}{place}", describe_deviations(&failing)));
    }
    for (count, what) in [(claim.undecided, "undecided"), (claim.missing, "not read")] {
        if count > 0 {
            parts.push(format!("{what} at {count} of {readings}"));
        }
    }
    if let Some(within) = claim.within {
        parts.push(format!("the rest within {}", describe_reach(claim, within)));
    }
    format!("{}: {}", claim_name(claim), parts.join(", "))
}

/// The range of the relative deviations of failing readings.
fn describe_deviations(failing: &[&Comparison]) -> String {
    let deviations = failing.iter().filter_map(|c| c.relative_deviation).collect_vec();
    if deviations.is_empty() {
        return describe_rating_deviations(failing);
    }
    let low = deviations.iter().copied().fold(f64::INFINITY, f64::min);
    let high = deviations.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    format!("reads {}", describe_range(low, high))
}

/// The range of the deviations of ratings, which are relative to nothing.
fn describe_rating_deviations(failing: &[&Comparison]) -> String {
    let deviations = failing.iter().filter_map(|c| c.deviation).collect_vec();
    let Some((low, high)) = deviations.iter().copied().minmax().into_option() else { return "is wrong".to_owned() };
    let unit = failing[0].quantity.unit();
    match (low < 0.0, high > 0.0) {
        (true, true) => format!("reads {:.2} low to {high:.2} {unit} high", -low),
        (true, false) => format!("reads {} {unit} low", describe_between(-high, -low)),
        _ => format!("reads {} {unit} high", describe_between(low, high)),
    }
}

/// Two sizes, the smaller first; one where both have the same digits.
fn describe_between(small: f64, large: f64) -> String {
    let [small, large] = [small, large].map(|size| format!("{size:.2}"));
    if small == large { large } else { format!("{small} to {large}") }
}

/// Describes what failing readings have in common and passing ones lack: a luminaire model, bodies, a case, a meter.
fn describe_place(report: &Report, failing: &[&Comparison], all: &[&Comparison]) -> String {
    let passing = all.iter().copied().filter(|c| c.verdict == Verdict::Pass).collect_vec();
    let bodies: BTreeSet<&str> = report.cases.iter().filter(|case| case.has_bodies).map(|case| &*case.name).collect();
    let mut words = String::new();
    let all_have_bodies = failing.iter().all(|c| bodies.contains(&*c.key.case));
    let no_passing_has_bodies = passing.iter().all(|c| !bodies.contains(&*c.key.case));
    if all_have_bodies && no_passing_has_bodies && !passing.is_empty() {
        words += " in rooms with bodies";
    }
    let models: BTreeSet<&str> = failing.iter().map(|c| c.model.as_str()).collect();
    let have_other_models = !passing.is_empty() && passing.iter().all(|c| !models.contains(c.model.as_str()));
    if let ([model], true) = (&models.iter().collect_vec()[..], have_other_models) {
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
mod step_tests;
#[cfg(test)]
mod tests;
