//! JUnit XML: a test case is case x procedure x engine, for continuous integration.

use std::time::Duration;

use quick_junit::{NonSuccessKind, Report as JUnit, TestCase, TestCaseStatus, TestSuite};

use super::{BaselineCheck, Report, notes};
use crate::judge::{Comparison, PolicyRecord, Verdict};
use crate::plan::Skip;
use crate::record::ReadingKey;

pub fn junit(report: &Report) -> String {
    let mut junit = JUnit::new("luxproof");
    for case in &report.cases {
        junit.add_test_suite(suite(report, &case.name));
    }
    if let Some(check) = &report.baseline {
        junit.add_test_suite(accepted(check));
    }
    for policy in report.policies() {
        junit.add_test_suite(required(report, policy));
    }
    // Writing to a string fails on no condition that a report can meet; an empty document would be noticed at once.
    let text = junit.to_string().unwrap_or_default();
    // The schema of Jenkins' xUnit plug-in counts skips in each suite only, not in all of them together.
    let (head, rest) = text.split_at(text.find("<testsuite ").unwrap_or(text.len()));
    let (before, after) = head.split_once(" skipped=\"").unwrap_or((head, ""));
    let after = after.split_once('"').map_or("", |(_, after)| after);
    format!("{before}{after}{rest}")
}

fn accepted(check: &BaselineCheck) -> TestSuite {
    let mut suite = TestSuite::new(format!("baseline {}", check.file));
    for entry in &check.entries {
        let status = if entry.is_as_accepted {
            TestCaseStatus::success()
        } else {
            failure(entry.state.clone(), entry.details.join("\n"))
        };
        suite.add_test_case(test_case(&entry.key, " baseline", status));
    }
    suite
}

/// The engines that a project requires.
fn required(report: &Report, policy: &PolicyRecord) -> TestSuite {
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

fn suite(report: &Report, name: &str) -> TestSuite {
    let mut suite = TestSuite::new(name);
    for recording in report.recordings.iter().filter(|r| r.key.case == name) {
        let comparisons: Vec<&Comparison> = report.comparisons.iter().filter(|c| c.key == recording.key).collect();
        let mut case = test_case(&recording.key, "", status(&comparisons));
        case.set_time(duration(recording.wall_s));
        // What was left out of a job that ran is told with it: a job is one test case.
        let left_out: Vec<String> = report.skips.iter().filter(|s| s.key == recording.key).map(told).collect();
        if !left_out.is_empty() {
            case.set_system_out(left_out.join("\n"));
        }
        suite.add_test_case(case);
    }
    let is_unread = |s: &&Skip| report.recordings.iter().all(|r| r.key != s.key);
    for skip in report.skips.iter().filter(|s| s.key.case == name).filter(is_unread) {
        let mut status = TestCaseStatus::skipped();
        status.set_message(told(skip));
        suite.add_test_case(test_case(&skip.key, "", status));
    }
    suite
}

/// Of a report that somebody wrote, too: seconds below nothing are none, and beyond every clock the most that there are.
fn duration(wall_s: f64) -> Duration {
    Duration::try_from_secs_f64(wall_s.max(0.0)).unwrap_or(Duration::MAX)
}

fn test_case(key: &ReadingKey, what: &str, status: TestCaseStatus) -> TestCase {
    let mut case = TestCase::new(format!("{} {}{what}", key.procedure, key.engine), status);
    case.set_classname(key.case.clone());
    case
}

fn told(skip: &Skip) -> String {
    format!("{}: {}", notes::kind(skip), notes::reason(skip))
}

fn status(comparisons: &[&Comparison]) -> TestCaseStatus {
    let bad: Vec<&&Comparison> = comparisons.iter().filter(|c| c.verdict.is_bad()).collect();
    let undecided = comparisons.iter().filter(|c| c.verdict == Verdict::Inconclusive).count();
    if !bad.is_empty() {
        let message = format!("{} of {} comparisons failed", bad.len(), comparisons.len());
        failure(message, bad.iter().map(|c| line(c)).collect::<Vec<_>>().join("\n"))
    } else if undecided > 0 {
        let mut status = TestCaseStatus::non_success(NonSuccessKind::Error);
        status.set_message(format!("{undecided} of {} comparisons undecided within budget", comparisons.len()));
        status
    } else {
        TestCaseStatus::success()
    }
}

fn failure(message: String, description: String) -> TestCaseStatus {
    let mut status = TestCaseStatus::non_success(NonSuccessKind::Failure);
    status.set_message(message).set_description(description);
    status
}

fn line(c: &Comparison) -> String {
    let number = |v: Option<f64>| v.map_or("nothing".to_owned(), |v| format!("{v:.6}"));
    format!(
        "{} read {} {}, reference {} ({}): {}",
        c.meter,
        number(c.value),
        c.quantity.unit(),
        number(c.reference.as_ref().map(|r| r.value)),
        c.reference.as_ref().map_or("none", |r| r.source.as_str()),
        c.verdict.name()
    )
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
