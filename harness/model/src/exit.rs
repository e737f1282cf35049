//! The result of a run: comparisons by verdict, and the exit code.

use std::fmt;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::{Report, Verdict};

/// The number of comparisons with each verdict.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct Summary {
    pub pass: usize,
    pub fail: usize,
    /// Undecided within the budget.
    pub undecided: usize,
    /// Beyond the tolerance, where the method claims no accuracy.
    #[serde(default)]
    pub not_judged: usize,
    /// Deviations on record.
    pub known_deviation: usize,
    /// Deviations on record that no longer occur.
    pub unexpected_pass: usize,
    pub missing: usize,
    /// Procedures of engines without a reading. Readings without rendering are among the skips, but not here.
    pub skipped: usize,
    /// Procedures of engines that fail by their bias, where no single reading fails.
    #[serde(default)]
    pub failed_biases: usize,
    /// Stated errors that repeated readings refute.
    #[serde(default)]
    pub failed_claims: usize,
}

impl Summary {
    /// Counts what a report contains.
    pub fn of(report: &Report) -> Self {
        let mut summary = Self::default();
        for comparison in &report.comparisons {
            *summary.count_mut(comparison.verdict) += 1;
        }
        summary.skipped = report.skips.iter().filter(|s| s.scope.leaves_no_reading()).count();
        summary.failed_biases = report.failed_biases().count();
        summary.failed_claims = report.failed_claims().count();
        summary
    }

    /// The count of a verdict.
    const fn count_mut(&mut self, verdict: Verdict) -> &mut usize {
        match verdict {
            Verdict::Pass => &mut self.pass,
            Verdict::Fail => &mut self.fail,
            Verdict::Undecided => &mut self.undecided,
            Verdict::NotJudged => &mut self.not_judged,
            Verdict::KnownDeviation => &mut self.known_deviation,
            Verdict::UnexpectedPass => &mut self.unexpected_pass,
            Verdict::Missing => &mut self.missing,
        }
    }
}

impl fmt::Display for Summary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { pass, fail, undecided, not_judged, known_deviation, unexpected_pass, missing, skipped, .. } = self;
        write!(
            f,
            "{pass} passed, {fail} failed, {undecided} undecided, {known_deviation} known deviations, \
             {unexpected_pass} unexpected passes, {missing} missing, {not_judged} not judged, {skipped} skipped"
        )?;
        // They are rare, and a line without them is the usual one.
        for (count, what) in [(self.failed_biases, "failed by bias"), (self.failed_claims, "claims failed")] {
            if count > 0 {
                write!(f, ", {count} {what}")?;
            }
        }
        Ok(())
    }
}

/// The exit code of a run: the worst of all that apply. Each variant is worse than those before it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Exit {
    /// 0: everything passed, known deviations included.
    Passed,
    /// 4: undecided within the budget.
    Undecided,
    /// 1: a tolerance failed.
    Failed,
    /// 3: a requested engine failed or is absent.
    Engine,
    /// 2: usage or input error.
    Usage,
}

impl Exit {
    pub const fn code(self) -> u8 {
        match self {
            Self::Passed => 0,
            Self::Failed => 1,
            Self::Usage => 2,
            Self::Engine => 3,
            Self::Undecided => 4,
        }
    }

    /// The exit code of a single verdict.
    pub const fn of(verdict: Verdict) -> Self {
        match verdict {
            Verdict::Pass | Verdict::NotJudged | Verdict::KnownDeviation => Self::Passed,
            Verdict::Undecided => Self::Undecided,
            Verdict::Fail | Verdict::UnexpectedPass | Verdict::Missing => Self::Failed,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::{comparison, recording};
    use crate::{Basis, Bias, Comparison, ErrorFinding, ReadingKey, Recording, Scope, Skip, StatedErrors};

    #[test]
    fn the_worst_exit_wins() {
        let worse_and_worse = [Exit::Passed, Exit::Undecided, Exit::Failed, Exit::Engine, Exit::Usage];
        assert!(worse_and_worse.is_sorted());
        assert_eq!(worse_and_worse.map(Exit::code), [0, 4, 1, 3, 2]);
    }

    #[test]
    fn every_verdict_has_its_exit() {
        for (verdict, exit) in [
            (Verdict::Pass, Exit::Passed),
            (Verdict::NotJudged, Exit::Passed),
            (Verdict::KnownDeviation, Exit::Passed),
            (Verdict::Undecided, Exit::Undecided),
            (Verdict::Fail, Exit::Failed),
            (Verdict::UnexpectedPass, Exit::Failed),
            (Verdict::Missing, Exit::Failed),
        ] {
            assert_eq!(Exit::of(verdict), exit, "{verdict:?}");
        }
    }

    #[test]
    fn a_summary_counts_each_verdict_and_what_was_skipped() {
        let counts = [
            (Verdict::Pass, 2),
            (Verdict::Fail, 3),
            (Verdict::Undecided, 4),
            (Verdict::KnownDeviation, 5),
            (Verdict::UnexpectedPass, 6),
            (Verdict::Missing, 7),
            (Verdict::NotJudged, 8),
        ];
        let mut report = Report::default();
        for (verdict, count) in counts {
            report.comparisons.extend(vec![Comparison { verdict, ..comparison() }; count]);
        }
        let key = comparison().key;
        for scope in [Scope::Procedure, Scope::Engine, Scope::Meter, Scope::LightPath] {
            report.skips.push(Skip::new(key.clone(), scope, "absent"));
        }
        let found = Summary::of(&report);
        let text = "2 passed, 3 failed, 4 undecided, 5 known deviations, 6 unexpected passes, 7 missing, 8 not judged, 2 skipped";
        assert_eq!(found.to_string(), text);
        // A claim that repetition refutes, and a bias of another engine than those that fail.
        let scatters = StatedErrors::from_finding(ErrorFinding::Scatters);
        report.recordings = vec![Recording { stated_errors: vec![scatters], ..recording() }];
        let key = ReadingKey { engine: "mine".into(), ..key };
        let (mean, low, high) = (0.05, 0.04, 0.06);
        let basis = Basis::Simulator;
        report.bias =
            vec![Bias { key, basis, readings: 9, mean, low, high, p_value: None, fails: true, scatter: None }];
        let found = Summary::of(&report);
        assert_eq!((found.failed_biases, found.failed_claims), (1, 1));
        assert_eq!(found.to_string(), format!("{text}, 1 failed by bias, 1 claims failed"));
    }
}
