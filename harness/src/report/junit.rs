//! JUnit XML: a test case is case x procedure x engine, for continuous integration.

use quick_junit::{NonSuccessKind, Report as JUnit, TestCase, TestCaseStatus, TestSuite};

use super::Report;
use crate::diff::{Comparison, Verdict};

/// The report as JUnit XML.
pub fn junit(report: &Report) -> String {
    let mut junit = JUnit::new("luxproof");
    let mut suite = TestSuite::new(report.spec.title.clone());
    for recording in &report.recordings {
        let of_run = |c: &&Comparison| {
            c.case == recording.case && c.procedure == recording.procedure && c.engine == recording.engine
        };
        let comparisons: Vec<&Comparison> = report.comparisons.iter().filter(of_run).collect();
        let mut case = TestCase::new(format!("{} {}", recording.procedure, recording.engine), status(&comparisons));
        case.set_classname(recording.case.clone());
        case.set_time(std::time::Duration::from_secs_f64(recording.wall_s));
        suite.add_test_case(case);
    }
    for skip in &report.skips {
        let mut status = TestCaseStatus::skipped();
        status.set_message(skip.reason.clone());
        let mut case = TestCase::new(format!("{} {}", skip.procedure, skip.engine), status);
        case.set_classname(skip.case.clone());
        suite.add_test_case(case);
    }
    junit.add_test_suite(suite);
    // Writing to a string fails on no condition that a report can meet; an empty document would be noticed at once.
    junit.to_string().unwrap_or_default()
}

fn status(comparisons: &[&Comparison]) -> TestCaseStatus {
    let bad: Vec<&&Comparison> = comparisons.iter().filter(|c| c.verdict.is_bad()).collect();
    let undecided: Vec<&&Comparison> = comparisons.iter().filter(|c| c.verdict == Verdict::Inconclusive).collect();
    if !bad.is_empty() {
        let mut status = TestCaseStatus::non_success(NonSuccessKind::Failure);
        status.set_message(format!("{} of {} comparisons failed", bad.len(), comparisons.len()));
        status.set_description(bad.iter().map(|c| line(c)).collect::<Vec<_>>().join("\n"));
        status
    } else if !undecided.is_empty() {
        let mut status = TestCaseStatus::non_success(NonSuccessKind::Error);
        status.set_message(format!("{} of {} comparisons undecided within budget", undecided.len(), comparisons.len()));
        status
    } else {
        TestCaseStatus::success()
    }
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
