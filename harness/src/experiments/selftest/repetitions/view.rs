//! What the self-test prints of repetitions: a Markdown table, which a terminal shows as well.

use std::fmt;

use itertools::Itertools;

use super::group::{Finding, Group, PRACTICAL, Worst};
use super::honesty::{Honesty, LEVEL, OfEngine};
use crate::experiments::tables;
use crate::record::{Agreement, ReadingKey};

const HEAD: [&str; 9] =
    ["engine", "case", "procedure", "meters", "scatter over stated", "95 %", "p", "worst meter", ""];

fn of_engine(e: &OfEngine) -> Vec<String> {
    let what = [format!("{} {}", e.engine, e.version), "all".to_owned(), "all".to_owned(), e.counted.to_string()];
    row(what, e.all, String::new(), e.finding)
}

fn of_group(g: &Group) -> Vec<String> {
    let ReadingKey { case, procedure, engine } = &g.key;
    let meters = match g.not_counted {
        0 => g.counted.to_string(),
        not => format!("{} of {}", g.counted, g.counted + not),
    };
    let worst = |w: &Worst| format!("{} {:.2} (p {:.1e})", w.meter, w.agreement.ratio, w.p_value);
    let what = [engine.to_string(), case.clone(), procedure.to_string(), meters];
    row(what, g.all, g.worst.as_ref().map_or(String::new(), worst), g.finding)
}

fn row(what: [String; 4], all: Option<Agreement>, worst: String, finding: Finding) -> Vec<String> {
    let all = match all {
        Some(a) => [format!("{:.2}", a.ratio), format!("{:.2} to {:.2}", a.low, a.high), format!("{:.1e}", a.p_value)],
        None => ["-", "", ""].map(str::to_owned),
    };
    what.into_iter().chain(all).chain([worst, finding.words().to_owned()]).collect()
}

impl fmt::Display for Honesty {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (none, told): (Vec<&Group>, Vec<&Group>) =
            self.groups.iter().partition(|g| g.finding == Finding::NotSampled);
        let rows = self.engines.iter().map(of_engine).chain(told.iter().copied().map(of_group)).collect();
        writeln!(f, "{}", tables::markdown(HEAD.map(str::to_owned).into(), rows))?;
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
        let count = |is: fn(Finding) -> bool| told.iter().filter(|g| is(g.finding)).count();
        let (all, dishonest, honest) = (told.len(), count(Finding::is_dishonest), count(|f| f == Finding::Honest));
        let (seeds, percent, (low, high)) = (self.seeds, 100.0 * LEVEL, PRACTICAL);
        writeln!(
            f,
            "{seeds} seeds; {dishonest} of {all} dishonest (Holm, {percent} % for all together), {honest} between {low} and {high} for certain"
        )?;
        let (none, of_others) = (none.len(), told.iter().map(|g| g.not_counted).sum::<usize>());
        writeln!(
            f,
            "no error of sampling is stated, nothing is counted: {none} procedures, and {of_others} meters of others"
        )
    }
}
