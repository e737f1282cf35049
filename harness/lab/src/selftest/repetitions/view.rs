//! The view of the findings on stated errors: a Markdown table, which a terminal also shows.

use std::fmt;

use itertools::Itertools;

use super::group::{Finding, Group, TOLERATED_RATIOS, WorstMeter};
use super::honesty::{EngineHonesty, FALSE_CLAIM_P, Honesty};
use crate::tables;
use luxproof_model::ReadingKey;
use luxproof_statistics::Agreement;

/// The head of the table.
const HEAD: [&str; 9] =
    ["engine", "case", "procedure", "meters", "scatter over stated", "95 %", "p", "worst meter", ""];

/// The row of an engine.
fn engine_row(e: &EngineHonesty) -> Vec<String> {
    let what = [format!("{} {}", e.engine, e.version), "all".to_owned(), "all".to_owned(), e.counted.to_string()];
    format_row(what, e.all, String::new(), e.finding)
}

/// The row of an engine in a procedure of a case.
fn group_row(g: &Group) -> Vec<String> {
    let ReadingKey { case, procedure, engine } = &g.key;
    let meters = match g.not_counted {
        0 => g.counted.to_string(),
        not_counted => format!("{} of {}", g.counted, g.counted + not_counted),
    };
    let worst = g.worst.as_ref().map_or(String::new(), format_worst);
    let what = [engine.to_string(), case.clone(), procedure.to_string(), meters];
    format_row(what, g.all, worst, g.finding)
}

/// The cell of the worst meter.
fn format_worst(worst: &WorstMeter) -> String {
    format!("{} {:.2} (p {:.1e})", worst.meter, worst.agreement.ratio, worst.p_value)
}

/// A row from its first four cells, the agreement, the worst meter and the finding.
fn format_row(what: [String; 4], all: Option<Agreement>, worst: String, finding: Finding) -> Vec<String> {
    let all = match all {
        Some(a) => [format!("{:.2}", a.ratio), format!("{:.2} to {:.2}", a.low, a.high), format!("{:.1e}", a.p_value)],
        None => ["-", "", ""].map(str::to_owned),
    };
    what.into_iter().chain(all).chain([worst, finding.label().to_owned()]).collect()
}

impl fmt::Display for Honesty {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (unsampled, sampled): (Vec<&Group>, Vec<&Group>) =
            self.groups.iter().partition(|g| g.finding == Finding::NotSampled);
        let rows = self.engines.iter().map(engine_row).chain(sampled.iter().copied().map(group_row)).collect();
        writeln!(f, "{}", tables::format_escaped_markdown(HEAD.map(str::to_owned).into(), rows))?;
        for Group { key, failure, moving, .. } in &self.groups {
            if let Some(failure) = failure {
                writeln!(f, "{key}: {failure}")?;
            }
            if !moving.is_empty() {
                writeln!(f, "{key}: claimed to be determined, and is not: {}", moving.iter().join(", "))?;
            }
        }
        for ((engine, reason), count) in
            self.skips.iter().counts_by(|s| (&s.key.engine, &s.reason)).into_iter().sorted()
        {
            writeln!(f, "not read by {engine}: {count} procedure(s): {reason}")?;
        }
        let dishonest = sampled.iter().filter(|g| g.finding.is_dishonest()).count();
        let honest = sampled.iter().filter(|g| g.finding == Finding::Honest).count();
        let (seeds, all, percent, (low, high)) = (self.seeds, sampled.len(), 100.0 * FALSE_CLAIM_P, TOLERATED_RATIOS);
        writeln!(
            f,
            "{seeds} seeds; {dishonest} of {all} dishonest (Holm, {percent} % for all together), {honest} between {low} and {high} for certain"
        )?;
        let (none, of_others) = (unsampled.len(), sampled.iter().map(|g| g.not_counted).sum::<usize>());
        writeln!(
            f,
            "no error of sampling is stated, nothing is counted: {none} procedures, and {of_others} meters of others"
        )
    }
}
