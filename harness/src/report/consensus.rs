//! Lines that tell who departs from the other witnesses.

use super::Report;

/// One line for each case and procedure whose witnesses differ by more than their tolerances.
pub(super) fn lines(report: &Report) -> Vec<String> {
    let differing = report.consensus.iter().filter(|c| c.differing > 0);
    let line = |c: &crate::judge::Consensus| {
        let case = if report.is_suite() { format!("{} ", c.case) } else { String::new() };
        format!("{case}{}: {}", c.procedure, c.text)
    };
    differing.map(line).collect()
}
