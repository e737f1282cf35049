//! The reason of a run's exit code in one sentence.

use itertools::Itertools as _;

use super::words::plural;
use luxproof_model::{BaselineCheck, EngineStatus, Exit, Report, Status, Summary};

/// The exit code of a run with its reason: `exit 4: 3 comparisons are undecided`.
pub(super) fn exit_reason(report: &Report) -> String {
    let exit = report.exit();
    let reasons = match exit {
        Exit::Passed => vec![describe_success(&report.summary)],
        Exit::Undecided => vec![plural_are(report.summary.undecided, "comparison", "undecided")],
        Exit::Failed => failures(report),
        Exit::Engine | Exit::Usage => engine_problems(report),
    };
    format!("exit {}: {}", exit.code(), reasons.join(", "))
}

fn describe_success(summary: &Summary) -> String {
    let mut text = match summary.pass {
        1 => "the only comparison passed".to_owned(),
        count => format!("all {count} comparisons passed"),
    };
    let others = [(summary.known_deviation, "known deviations"), (summary.not_judged, "not judged")];
    for (count, what) in others.into_iter().filter(|(count, _)| *count > 0) {
        text += &format!(", {count} {what}");
    }
    text
}

/// What failed: comparisons, records of deviations, biases, stated errors, the baseline.
fn failures(report: &Report) -> Vec<String> {
    let summary = &report.summary;
    let mut reasons = vec![];
    let kinds = [
        (summary.fail, "comparison", "outside the tolerance"),
        (summary.missing, "comparison", "without a value"),
        (summary.unexpected_pass, "known deviation", "no longer there"),
        (summary.failed_biases, "procedure", "outside the tolerance by the bias"),
        (summary.failed_claims, "stated error", "refuted by repetition"),
    ];
    for (count, noun, what) in kinds.into_iter().filter(|(count, ..)| *count > 0) {
        reasons.push(plural_are(count, noun, what));
    }
    reasons.extend(report.baseline.as_ref().and_then(BaselineCheck::reason));
    reasons
}

/// Which engines failed, are not installed or have no value.
fn engine_problems(report: &Report) -> Vec<String> {
    let mut reasons = vec![];
    let statuses = [(Status::Failed, "failed"), (Status::Absent, "not installed")];
    for (status, what) in statuses {
        let is_such =
            |engine: &&EngineStatus| engine.status == status && (status == Status::Failed || engine.is_required);
        let names = report.engines.iter().filter(is_such).map(|engine| engine.id.as_str()).collect_vec();
        if !names.is_empty() {
            reasons.push(format!("{} {what}", names.join(" and ")));
        }
    }
    for (policy, engine) in report.lacking() {
        reasons.push(format!("{} requires {engine}, which has no value", policy.file));
    }
    if !report.has_audited() {
        reasons.push("no renderer computed a value".to_owned());
    }
    reasons
}

/// `1 comparison is undecided`, `3 comparisons are undecided`.
fn plural_are(count: usize, noun: &str, what: &str) -> String {
    let verb = if count == 1 { "is" } else { "are" };
    format!("{} {verb} {what}", plural(count, noun))
}
