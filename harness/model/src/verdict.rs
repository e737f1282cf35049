//! The verdict of a comparison.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The verdict of a comparison, the best first.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// The whole interval of the deviation lies within the tolerance.
    Pass,
    /// It is outside, but the method claims no accuracy there, or is a hand method: it is reported and decides no run.
    NotJudged,
    /// It is outside, as a known deviation explains.
    KnownDeviation,
    /// It contains an end of the tolerance: more samples would decide.
    Undecided,
    /// The whole interval lies outside the tolerance.
    Fail,
    /// It is within the tolerance, but a deviation is on record: the record is out of date.
    UnexpectedPass,
    /// There is no usable reading or no usable reference.
    Missing,
}

impl Verdict {
    /// Whether it needs attention.
    pub const fn is_bad(self) -> bool {
        matches!(self, Self::Fail | Self::UnexpectedPass | Self::Missing)
    }

    /// Its name in views.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Pass => "pass",
            Self::NotJudged => "not judged",
            Self::KnownDeviation => "known deviation",
            Self::Undecided => "undecided",
            Self::Fail => "fail",
            Self::UnexpectedPass => "unexpected pass",
            Self::Missing => "missing",
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    #[test]
    fn verdicts_have_their_names_and_three_of_them_are_bad() {
        let all = [
            (Verdict::Pass, "pass", false),
            (Verdict::NotJudged, "not judged", false),
            (Verdict::KnownDeviation, "known deviation", false),
            (Verdict::Undecided, "undecided", false),
            (Verdict::Fail, "fail", true),
            (Verdict::UnexpectedPass, "unexpected pass", true),
            (Verdict::Missing, "missing", true),
        ];
        for (verdict, name, is_bad) in all {
            assert_eq!((verdict.name(), verdict.is_bad()), (name, is_bad));
        }
    }
}
