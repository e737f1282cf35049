//! A paper's tables with our readings beside them: one row a column of the paper or an engine of ours, one column a place.

mod cells;
mod shares;

use std::collections::BTreeMap;

use itertools::Itertools;

use super::Report;
use super::words::{largest, percent, published_column, value};
use crate::judge::{Basis, Misfit, PublishedTable};
use crate::record::{EngineName, MeterId, Quantity, Reading, ReadingKey, Recording};

pub use cells::{Cell, Standing, cells};
pub(super) use shares::splits;

/// A drawn table: a heading, and rows of as many cells.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Grid {
    pub(super) title: String,
    pub(super) head: Vec<String>,
    pub(super) rows: Vec<Vec<String>>,
}

/// One grid a published table, in the order of the procedures, then the shares.
pub(super) fn grids(report: &Report) -> Vec<Grid> {
    let tables = report.published.iter().sorted_by_key(|t| t.procedure);
    tables.map(|table| grid(report, table)).chain(shares::grid(report)).collect()
}

pub(super) fn grid(report: &Report, table: &PublishedTable) -> Grid {
    let sign = if table.quantity == Quantity::LuminousIntensity { "gamma " } else { "" };
    let mut head = vec![format!("{} [{}]", table.name, table.quantity.unit())];
    head.extend(table.rows.iter().map(|r| format!("{sign}{}", r.place)));
    head.push("furthest from the paper".to_owned());
    let mut rows: Vec<Vec<String>> = vec![];
    for column in &table.columns {
        let cells = table.rows.iter().map(|r| r.cells.get(&column.name).cloned().unwrap_or_else(|| "-".to_owned()));
        let note = column.reference.then(|| "its reference".to_owned());
        let misfits =
            table.misfits.iter().filter(|m| m.column == column.name && table.rows.iter().any(|r| r.row == m.row));
        let note = note.into_iter().chain(misfits.map(Misfit::to_string)).join("; ");
        rows.push(std::iter::once(format!("paper {}", column.name)).chain(cells).chain([note]).collect());
    }
    let mine = |r: &&Recording| r.key.procedure == table.procedure && table.cases.contains(&r.key.case);
    let place = |r: &&Recording| report.engines.iter().position(|e| e.id == r.key.engine);
    let mut seen: Vec<(String, Vec<String>)> = vec![];
    for recording in report.recordings.iter().filter(mine).sorted_by_key(place) {
        let cell = |meter| reading(report, &recording.key, meter).map_or_else(|| "-".to_owned(), value);
        let cells: Vec<String> = table.rows.iter().map(|r| cell(&r.meter)).collect();
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
    if recording.key.engine == EngineName::IESNA {
        let method = recording.method.get("method").map(|m| format!(", {m}"));
        return format!("{}{}", EngineName::IESNA, method.unwrap_or_default());
    }
    let light = recording.light.to_string();
    let bounces = light.split_once(", ").map(|(_, bounces)| format!(", {bounces}"));
    format!("{}, {}{}", recording.key.engine, recording.model, bounces.unwrap_or_default())
}

fn reading<'a>(report: &'a Report, key: &ReadingKey, meter: &MeterId) -> Option<&'a Reading> {
    report.readings.iter().find(|r| r.reading.meter == *meter && r.key == *key).map(|r| &r.reading)
}

/// The largest relative deviation from each column of the paper that the recording is held against.
fn furthest(report: &Report, recording: &Recording) -> String {
    let mut columns: BTreeMap<&str, Vec<f64>> = BTreeMap::new();
    for c in report.comparisons.iter().filter(|c| c.key == recording.key) {
        let reference = c.reference.as_ref().filter(|r| r.basis == Basis::Published);
        if let Some((reference, deviation)) = reference.zip(c.relative_deviation) {
            columns.entry(published_column(&reference.source)).or_default().push(deviation);
        }
    }
    let words = columns.into_iter().filter_map(|(column, all)| Some((column, largest(all.into_iter())?)));
    words.map(|(column, deviation)| format!("{column} {}", percent(deviation))).collect::<Vec<_>>().join(", ")
}
