//! A paper's tables with our readings beside them: one row a column of the paper or an engine of ours, one column a place.

use std::collections::BTreeMap;

use super::terminal::{percent, published_column, value};
use super::{ReadingRecord, Report};
use crate::judge::{Basis, PublishedTable};
use crate::record::Quantity;
use crate::record::Recording;

/// A drawn table: a heading, and rows of as many cells.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Grid {
    /// The paper's title.
    pub(super) title: String,
    /// Headings of the columns.
    pub(super) head: Vec<String>,
    pub(super) rows: Vec<Vec<String>>,
}

/// One grid a published table, in the order of the procedures.
pub(super) fn grids(report: &Report) -> Vec<Grid> {
    let procedures = report.procedures();
    let mut tables: Vec<&PublishedTable> = report.published.iter().collect();
    tables.sort_by_key(|t| procedures.iter().position(|p| *p == t.procedure));
    tables.into_iter().map(|table| grid(report, table)).collect()
}

fn grid(report: &Report, table: &PublishedTable) -> Grid {
    let (unit, sign) =
        (table.quantity.unit(), if table.quantity == Quantity::LuminousIntensity { "gamma " } else { "" });
    let places = table.rows.iter().map(|r| format!("{sign}{}", r.place));
    let mut head = vec![format!("{} [{unit}]", table.name)];
    head.extend(places);
    head.push("furthest from the paper".to_owned());
    let mut rows: Vec<Vec<String>> = vec![];
    for column in &table.columns {
        let cells = table.rows.iter().map(|r| r.cells.get(&column.name).cloned().unwrap_or_else(|| "-".to_owned()));
        let note = if column.reference { "its reference" } else { "" };
        rows.push(std::iter::once(format!("paper {}", column.name)).chain(cells).chain([note.to_owned()]).collect());
    }
    let mine = |r: &&Recording| r.key.procedure == table.procedure && table.cases.contains(&r.key.case);
    let mut recordings: Vec<&Recording> = report.recordings.iter().filter(mine).collect();
    let order = |engine: &str| report.engines.iter().position(|e| e.id == engine);
    recordings.sort_by_key(|r| order(&r.key.engine));
    let mut seen: Vec<(String, Vec<String>)> = vec![];
    for recording in recordings {
        let cells: Vec<String> = table.rows.iter().map(|r| reading(report, recording, &r.meter.0)).collect();
        let label = label(recording);
        // Our own solvers run in every case; what they repeat need not be read twice.
        if cells.iter().all(|c| c == "-") || seen.contains(&(label.clone(), cells.clone())) {
            continue;
        }
        let taken = seen.iter().any(|(other, _)| *other == label);
        let shown = if taken { format!("{label} ({})", recording.key.case) } else { label.clone() };
        seen.push((label, cells.clone()));
        rows.push(std::iter::once(shown).chain(cells).chain([furthest(report, recording)]).collect());
    }
    Grid { title: table.title.clone(), head, rows }
}

fn label(recording: &Recording) -> String {
    if recording.key.engine == "iesna" {
        let method = recording.method.get("method").map(|m| format!(", {m}"));
        return format!("iesna{}", method.unwrap_or_default());
    }
    let light = recording.light.to_string();
    let bounces = light.split_once(", ").map(|(_, bounces)| format!(", {bounces}"));
    format!("{}, {}{}", recording.key.engine, recording.model, bounces.unwrap_or_default())
}

fn reading(report: &Report, recording: &Recording, meter: &str) -> String {
    let is_it = |r: &&ReadingRecord| r.reading.meter.0 == meter && r.key == recording.key;
    report.readings.iter().find(is_it).map_or_else(|| "-".to_owned(), value)
}

/// The largest relative deviation from each column of the paper that the recording is held against.
fn furthest(report: &Report, recording: &Recording) -> String {
    let mut worst: BTreeMap<&str, f64> = BTreeMap::new();
    for c in &report.comparisons {
        let mine = c.key.case == recording.key.case
            && c.key.procedure == recording.key.procedure
            && c.key.engine == recording.key.engine;
        let reference = c.reference.as_ref().filter(|r| mine && r.basis == Basis::Published);
        if let Some((reference, deviation)) = reference.zip(c.relative_deviation) {
            let most = worst.entry(published_column(&reference.source)).or_insert(deviation);
            if deviation.abs() > most.abs() {
                *most = deviation;
            }
        }
    }
    worst.iter().map(|(column, deviation)| format!("{column} {}", percent(*deviation))).collect::<Vec<_>>().join(", ")
}
