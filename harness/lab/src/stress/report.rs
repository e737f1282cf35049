//! Views of a stress report: the matrix of what breaks at which magnitude, for a terminal and as
//! Markdown.

use std::collections::BTreeSet;

use super::findings::{LawReport, PointReport, StressReport};
use crate::tables;
use luxproof_model::{EngineName, LawBreach};
use luxproof_process::printable::markdown;

impl StressReport {
    /// The report for a terminal.
    pub fn terminal(&self) -> String {
        let (head, rows) = self.matrix();
        let table = tables::format_terminal(head, rows);
        let remarks = self.remarks().iter().map(|line| format!("  {line}\n")).collect::<Vec<_>>().concat();
        format!("{}: breaks at\n\n{table}\n{LEGEND}\n{remarks}", self.case)
    }

    /// The report as Markdown.
    pub fn markdown(&self) -> String {
        let (head, rows) = self.matrix();
        let table = tables::format_escaped_markdown(head, rows);
        let remarks = self.remarks().iter().map(|line| format!("- {}\n", markdown(line))).collect::<Vec<_>>().concat();
        format!("## {}\n\n{table}\n{LEGEND}\n\n{remarks}", markdown(&self.case))
    }

    /// The head and the rows of the matrix: one row per law, one column per engine.
    fn matrix(&self) -> (Vec<String>, Vec<Vec<String>>) {
        let engines: Vec<&EngineName> = self.engines.keys().collect();
        let mut head = vec!["law".to_owned(), "magnitude".to_owned()];
        head.extend(engines.iter().map(|e| format!("{e} {}", self.engines[*e].split(' ').next().unwrap_or_default())));
        let mut rows: Vec<Vec<String>> = vec![];
        let mut listed = BTreeSet::new();
        for law in self.laws.iter().filter(|l| listed.insert(&l.law)) {
            let mut row = vec![law.law.clone(), law.unit.to_owned()];
            for engine in &engines {
                let of_engine = self.laws.iter().find(|l| l.law == law.law && l.engine == **engine);
                row.push(of_engine.map_or(String::new(), format_cell));
            }
            rows.push(row);
        }
        (head, rows)
    }

    /// One sentence for each broken law, and for each break on record that no longer occurs.
    fn remarks(&self) -> Vec<String> {
        let mut remarks = vec![];
        for law in self.laws.iter().filter(|l| l.how.is_some()) {
            let broken: Vec<&PointReport> = law.points.iter().filter(|p| p.finding.how.is_some()).collect();
            let magnitudes = broken.chunk_by(|a, b| a.magnitude == b.magnitude);
            let list: Vec<String> = magnitudes.map(describe_magnitude).collect();
            let why = broken.iter().find_map(|p| p.finding.text.as_deref()).map(first_line);
            let why = why.map(|w| format!(" ({w})")).unwrap_or_default();
            let known = law.known.join("; ");
            let known = if known.is_empty() { known } else { format!(" Known: {known}.") };
            let (LawReport { engine, law, what, unit, .. }, list) = (law, list.join("; "));
            remarks.push(format!("{engine} {law}: {what}. At {unit} {list}{why}.{known}"));
        }
        for law in self.laws.iter().filter(|l| !l.gone.is_empty()) {
            let gone = law.gone.join("; ");
            remarks.push(format!("{} {}: on record, but seen no more: {gone}.", law.engine, law.law));
        }
        remarks
    }
}

/// What points of one magnitude show.
fn describe_magnitude(points: &[&PointReport]) -> String {
    let findings: Vec<String> = points.iter().map(|point| describe_point(point)).collect();
    format!("{:e}: {}", points[0].magnitude, findings.join(", "))
}

/// The deviation of a point, or how it breaks, with the first word of its procedure.
fn describe_point(point: &PointReport) -> String {
    let what = match (point.finding.deviation, point.finding.how) {
        (Some(d), Some(LawBreach::SilentLoss)) => format!("{} lost", percent(d)),
        (Some(d), _) => percent(d),
        (None, how) => how.map_or(String::new(), |how| how.to_string()),
    };
    format!("{what} ({})", point.procedure.name().split('_').next().unwrap_or_default())
}

/// The explanation under the matrix.
const LEGEND: &str = "ok: no deviation of .1 % or more beyond the noise at any magnitude (noise of the worst reading in brackets: \
smaller deviations may hide there). Otherwise the first magnitude at which the deviation exceeds .1, 1 and 10 %, or how it breaks. \
known: on record in reference/known_deviations.yaml. refuses: the engine says itself that it cannot. n untried: time was up, or a milder magnitude hung already.";

/// The cell of a law and an engine.
fn format_cell(law: &LawReport) -> String {
    let mut parts = vec![];
    for (threshold, at) in &law.breaks_at {
        let threshold: f64 = threshold.parse().unwrap_or(0.0);
        parts.push(format!("{} @ {at:e}", percent(threshold)));
    }
    match law.how {
        Some(LawBreach::Drift) => {}
        Some(how) => {
            let first = law.points.iter().find(|p| p.finding.how == Some(how)).map_or(0.0, |p| p.magnitude);
            // Where all thresholds are exceeded by the same failure, its name says everything.
            if parts.len() == 3 && law.breaks_at.values().all(|m| *m == first) {
                parts.clear();
            }
            parts.push(format!("{how} @ {first:e}"));
        }
        None if law.worst_deviation.is_some() => {
            parts.push(format!("ok ({})", law.resolution.map_or("?".to_owned(), percent)));
        }
        None => {}
    }
    if !law.known.is_empty() {
        parts.push("known".to_owned());
    }
    if let Some(at) = law.refused_at {
        parts.push(format!("refuses @ {at:e}"));
    }
    if law.untried > 0 {
        parts.push(format!("{} untried", law.untried));
    }
    parts.join(", ")
}

/// A part in percent, with more digits where it is small.
fn percent(x: f64) -> String {
    match 100.0 * x {
        p if p >= 9.95 => format!("{p:.0} %"),
        p if p >= 0.095 => format!("{p:.1} %"),
        p => format!("{p:.1e} %"),
    }
}

/// The first line of a message, without the temporary files that it names.
fn first_line(text: &str) -> String {
    let line = text.lines().next().unwrap_or_default();
    let line: String = line.split("; its messages are in").next().unwrap_or_default().chars().take(120).collect();
    line.trim_end_matches(':').to_owned()
}
