//! The text of what a bisection found.

use std::fmt;

use super::{Bisection, Change};

/// The number of meters that are named; further ones are only counted.
const NAMED_METERS: usize = 4;

impl fmt::Display for Change {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let named: Vec<&str> = self.meters.iter().take(NAMED_METERS).map(|m| m.0.as_str()).collect();
        let more = self.meters.len().saturating_sub(NAMED_METERS);
        let more = if more == 0 { String::new() } else { format!(" and {more} more") };
        write!(f, "{} {} at {}{more}", self.case, self.procedure, named.join(", "))
    }
}

impl fmt::Display for Bisection {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { engine, good, bad, .. } = self;
        if self.is_one() {
            writeln!(f, "{engine}@{bad} is the first that is bad: {engine}@{good}, the one before it, is good")?;
        } else {
            writeln!(
                f,
                "the change lies behind {engine}@{good} and no later than {engine}@{bad}; between them nothing is known"
            )?;
            for silent in &self.unclear {
                writeln!(f, "  skipped  {engine}@{}: {}", silent.release, silent.why)?;
            }
        }
        for change in &self.changed {
            writeln!(f, "  changed  {change}")?;
        }
        for change in &self.later {
            writeln!(f, "  later    {change}; to find where, bisect again from --good {bad}")?;
        }
        for remark in &self.remarks {
            writeln!(f, "  remark   {remark}")?;
        }
        writeln!(f, "{} runs, the two ends among them", self.runs)
    }
}
