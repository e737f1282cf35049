//! The first lines: a verdict for each renderer and procedure.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use comfy_table::Cell as TableCell;
use itertools::Itertools as _;

use super::matrix::colour;
use super::screen::{Screen, draw_table};
use crate::symmetry::{PointCounts, point_counts, symmetry_lines};
use crate::verdict_lines::{VerdictLine, error_and_tolerance, verdict_lines};
use crate::words::plural;
use luxproof_model::{Exit, Report};

/// Draws the verdict of each renderer and procedure; empty where nothing was compared.
///
/// Calibration scenes are in it only where they do not pass.
pub(super) fn verdict_table(report: &Report, screen: Screen) -> String {
    let lines = verdict_lines(report);
    let shown = lines.iter().filter(|line| !line.procedure.is_calibration() || !passes(line));
    let counts = point_counts(report);
    let points = |line: &VerdictLine<'_>| counts.get(&(line.engine, line.procedure)).copied().unwrap_or_default();
    let rows = shown.map(|line| verdict_row(line, points(line), screen)).collect_vec();
    if rows.is_empty() {
        return String::new();
    }
    let head = ["verdict", "engine", "procedure", "points", "largest error", "allowed"];
    let table = draw_table(head, rows, 3..6, screen.style);
    if symmetry_lines(report).is_empty() {
        return table;
    }
    format!("{table}\n {}", screen.wrap("points: rendered + by symmetry (--no-skips renders all)"))
}

/// Whether it leaves the exit code at 0.
fn passes(line: &VerdictLine<'_>) -> bool {
    Exit::of(line.verdict) == Exit::Passed
}

fn verdict_row(line: &VerdictLine<'_>, counts: PointCounts, screen: Screen) -> Vec<TableCell> {
    let points = match line.having {
        having if having == line.points && counts.by_symmetry > 0 => {
            format!("{} + {}", counts.rendered, counts.by_symmetry)
        }
        having if having == line.points => line.points.to_string(),
        having => format!("{having} of {}", line.points),
    };
    let (error, allowed) = line.worst.map_or(("-".to_owned(), "-".to_owned()), error_and_tolerance);
    let calibration = if line.procedure.is_calibration() { "calibration: " } else { "" };
    vec![
        TableCell::new(line.verdict.name().to_uppercase()).fg(colour(line.verdict)),
        TableCell::new(line.engine.as_str()),
        TableCell::new(format!("{calibration}{}", line.procedure)),
        TableCell::new(points),
        TableCell::new(screen.spell(&error)),
        TableCell::new(screen.spell(&allowed)),
    ]
}

/// Appends how many calibration scenes each renderer passes, in a line for all.
pub(super) fn append_calibration(report: &Report, screen: Screen, text: &mut String) {
    let mut engines: BTreeMap<usize, Vec<&str>> = BTreeMap::new();
    let passing = verdict_lines(report).into_iter().filter(|line| line.procedure.is_calibration() && passes(line));
    for (engine, scenes) in &passing.chunk_by(|line| line.engine) {
        engines.entry(scenes.count()).or_default().push(engine.as_str());
    }
    let mut parts = vec![];
    for (scenes, names) in engines.iter().rev() {
        let verb = if names.len() == 1 { "passes" } else { "pass" };
        parts.push(format!("{} {verb} {}", names.join(", "), plural(*scenes, "scene")));
    }
    if !parts.is_empty() {
        let line = format!("Calibration (scenes with known results): {}", parts.join("; "));
        writeln!(text, " {}", screen.wrap(&line)).ok();
    }
}
