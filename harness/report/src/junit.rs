//! JUnit XML for continuous integration: a test case is a case, a procedure and an engine.

use std::collections::BTreeSet;
use std::time::Duration;

use itertools::Itertools;
use quick_junit::{NonSuccessKind, Report as JUnit, TestCase, TestCaseStatus, TestSuite};

use super::notes;
use super::words::{off, percent};
use luxproof_model::ReadingKey;
use luxproof_model::Skip;
use luxproof_model::{BaselineCheck, Report};
use luxproof_model::{Comparison, PolicyRecord, Verdict};

pub fn junit(report: &Report) -> String {
    let mut junit = JUnit::new("luxproof");
    for case in &report.cases {
        let mut suite = case_suite(report, &case.name);
        if !case.luminaire_models.is_empty() {
            let models = case.luminaire_models.iter().map(|model| format!("model: {model}"));
            suite.set_system_out(models.collect::<Vec<_>>().join("\n"));
        }
        let lints: Vec<String> =
            report.lints.iter().filter(|lint| lint.file == case.spec.path).map(ToString::to_string).collect();
        if !lints.is_empty() {
            suite.set_system_err(lints.join("\n"));
        }
        junit.add_test_suite(suite);
    }
    if let Some(check) = &report.baseline {
        junit.add_test_suite(baseline_suite(check));
    }
    for policy in report.policies() {
        junit.add_test_suite(policy_suite(report, policy));
    }
    // Writing to a string does not fail on any report, and an empty document would be noticed at once.
    drop_total_of_skips(&junit.to_string().unwrap_or_default())
}

/// Removes the number of skips from the root element: the schema of Jenkins' xUnit plug-in has it in each suite only.
fn drop_total_of_skips(text: &str) -> String {
    let (head, rest) = text.split_at(text.find("<testsuite ").unwrap_or(text.len()));
    let (before, after) = head.split_once(" skipped=\"").unwrap_or((head, ""));
    let after = after.split_once('"').map_or("", |(_, after)| after);
    format!("{before}{after}{rest}")
}

/// A test case for each entry of the baseline.
fn baseline_suite(check: &BaselineCheck) -> TestSuite {
    let mut suite = TestSuite::new(format!("baseline {}", check.file));
    for entry in &check.entries {
        let status = if entry.is_as_accepted {
            TestCaseStatus::success()
        } else {
            failure(entry.state.clone(), entry.lines().join("\n"))
        };
        suite.add_test_case(test_case(&entry.key, " baseline", status));
    }
    suite
}

/// A test case for each engine that a policy requires.
fn policy_suite(report: &Report, policy: &PolicyRecord) -> TestSuite {
    let (mut suite, lacking) = (TestSuite::new(format!("policy {}", policy.file)), report.lacking());
    for engine in &policy.required_engines {
        let status = if lacking.contains(&(policy, engine)) {
            failure("no reading".to_owned(), format!("{engine} is required by {}", policy.file))
        } else {
            TestCaseStatus::success()
        };
        suite.add_test_case(TestCase::new(format!("required engine {engine}"), status));
    }
    suite
}

/// A test case for each recording of a case, and for each skip without a recording.
fn case_suite(report: &Report, name: &str) -> TestSuite {
    let mut suite = TestSuite::new(name);
    for recording in report.recordings.iter().filter(|r| r.key.case == name) {
        let comparisons: Vec<&Comparison> = report.comparisons.iter().filter(|c| c.key == recording.key).collect();
        let mut case = test_case(&recording.key, "", status(report, &recording.key, &comparisons));
        case.set_time(duration(recording.wall_s));
        // A job that ran is one test case, so its skipped parts go into the output of that test case.
        let skips: Vec<String> = report.skips.iter().filter(|s| s.key == recording.key).map(describe_skip).collect();
        if !skips.is_empty() {
            case.set_system_out(skips.join("\n"));
        }
        suite.add_test_case(case);
    }
    for skip in report.skips.iter().filter(|s| s.key.case == name) {
        if report.recordings.iter().any(|r| r.key == skip.key) {
            continue;
        }
        let mut status = TestCaseStatus::skipped();
        status.set_message(describe_skip(skip));
        suite.add_test_case(test_case(&skip.key, "", status));
    }
    suite
}

/// A duration of any number, since a report may come from anywhere: zero below zero, the maximum beyond it.
fn duration(wall_s: f64) -> Duration {
    Duration::try_from_secs_f64(wall_s.max(0.0)).unwrap_or(Duration::MAX)
}

fn test_case(key: &ReadingKey, what: &str, status: TestCaseStatus) -> TestCase {
    let mut case = TestCase::new(format!("{} {}{what}", key.procedure, key.engine), status);
    case.set_classname(key.case.clone());
    case
}

fn describe_skip(skip: &Skip) -> String {
    format!("{}: {}", notes::kind(skip), notes::reason(skip))
}

fn status(report: &Report, key: &ReadingKey, comparisons: &[&Comparison]) -> TestCaseStatus {
    let as_a_whole = whole_failures(report, key);
    let bad: Vec<&&Comparison> = comparisons.iter().filter(|c| c.verdict.is_bad()).collect();
    let undecided = comparisons.iter().filter(|c| c.verdict == Verdict::Undecided).count();
    if !bad.is_empty() {
        let causes: BTreeSet<&str> = bad.iter().filter_map(|c| c.diagnosis.as_deref()).collect();
        let counts = format!("{} of {} comparisons failed", bad.len(), comparisons.len());
        let message = std::iter::once(counts.as_str()).chain(causes).collect::<Vec<_>>().join("; ");
        let lines = bad.iter().map(|c| describe_comparison(c)).chain(as_a_whole);
        failure(message, lines.collect::<Vec<_>>().join("\n"))
    } else if !as_a_whole.is_empty() {
        failure(as_a_whole.join("; "), as_a_whole.join("\n"))
    } else if undecided > 0 {
        let mut status = TestCaseStatus::non_success(NonSuccessKind::Error);
        status.set_message(format!("{undecided} of {} comparisons undecided within budget", comparisons.len()));
        status
    } else {
        TestCaseStatus::success()
    }
}

/// How a recording fails without a single reading that does: by its bias, or by what it states of its errors.
fn whole_failures(report: &Report, key: &ReadingKey) -> Vec<String> {
    let biases = report.failed_biases().filter(|bias| bias.key == *key);
    let biases = biases.map(|bias| format!("the procedure fails by its bias against {}: {bias}", bias.basis.name()));
    let claims = report.failed_claims().filter(|(recording, _)| recording.key == *key);
    biases.chain(claims.map(|(_, stated)| format!("a claim fails: {stated}"))).collect()
}

fn failure(message: String, description: String) -> TestCaseStatus {
    let mut status = TestCaseStatus::non_success(NonSuccessKind::Failure);
    status.set_message(message).set_description(description);
    status
}

fn describe_comparison(c: &Comparison) -> String {
    format!(
        "{} read {} {}, reference {} ({}): {}{}{}",
        c.meter,
        number(c.value),
        c.quantity.unit(),
        number(c.reference.as_ref().map(|r| r.value)),
        c.reference.as_ref().map_or("none", |r| r.source.as_str()),
        c.verdict.name(),
        off(c, percent).map(|size| format!(" {size}")).unwrap_or_default(),
        c.diagnosis.as_ref().map(|cause| format!("; {cause}")).unwrap_or_default()
    )
}

fn number(value: Option<f64>) -> String {
    value.map_or("nothing".to_owned(), |v| format!("{v:.6}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn seconds_beyond_every_clock_and_none_at_all_are_durations() {
        assert_eq!([1e300, f64::INFINITY].map(duration), [Duration::MAX; 2]);
        assert_eq!([-1.0, f64::NAN].map(duration), [Duration::ZERO; 2]);
        assert_eq!(duration(1.5), Duration::from_millis(1500));
    }
}
