//! What a run comes to: comparisons by verdict, and the exit code.

use std::fmt;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::judge::{Comparison, Verdict};
use crate::plan::Skip;

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct Summary {
    pub pass: usize,
    pub fail: usize,
    /// Undecided within the budget.
    pub inconclusive: usize,
    /// Beyond the tolerance, where a method claims nothing.
    #[serde(default)]
    pub not_judged: usize,
    /// Deviations on record.
    pub known_deviation: usize,
    /// Deviations on record that are gone.
    pub unexpected_pass: usize,
    pub missing: usize,
    /// Procedures of engines without a reading; what was read without rendering is among the skips, but not here.
    pub skipped: usize,
}

impl Summary {
    pub(super) fn of(comparisons: &[Comparison], skips: &[Skip]) -> Self {
        let count = |verdict| comparisons.iter().filter(|c| c.verdict == verdict).count();
        Self {
            pass: count(Verdict::Pass),
            fail: count(Verdict::Fail),
            inconclusive: count(Verdict::Inconclusive),
            not_judged: count(Verdict::NotJudged),
            known_deviation: count(Verdict::KnownDeviation),
            unexpected_pass: count(Verdict::UnexpectedPass),
            missing: count(Verdict::Missing),
            skipped: skips.iter().filter(|s| s.scope.leaves_no_reading()).count(),
        }
    }
}

impl fmt::Display for Summary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { pass, fail, inconclusive, not_judged, known_deviation, unexpected_pass, missing, skipped } = self;
        write!(
            f,
            "{pass} passed, {fail} failed, {inconclusive} undecided, {known_deviation} known deviations, \
             {unexpected_pass} unexpected passes, {missing} missing, {not_judged} not judged, {skipped} skipped"
        )
    }
}

/// The exit code of a run, by the worst that happened: each is worse than those before it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Exit {
    /// 0: everything passed, known deviations included.
    Passed,
    /// 4: undecided within the budget.
    Undecided,
    /// 1: a tolerance failed.
    Failed,
    /// 3: an engine that was asked for failed or is absent.
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

    pub(super) const fn of(verdict: Verdict) -> Self {
        match verdict {
            Verdict::Pass | Verdict::NotJudged | Verdict::KnownDeviation => Self::Passed,
            Verdict::Inconclusive => Self::Undecided,
            Verdict::Fail | Verdict::UnexpectedPass | Verdict::Missing => Self::Failed,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_worst_exit_wins() {
        let worse_and_worse = [Exit::Passed, Exit::Undecided, Exit::Failed, Exit::Engine, Exit::Usage];
        assert!(worse_and_worse.is_sorted());
        assert_eq!(worse_and_worse.map(Exit::code), [0, 4, 1, 3, 2]);
    }
}
