//! Published tables together with our readings: a row for each column of the paper and each engine, a column for each place.

use luxproof_model::PaperSplit;
use luxproof_model::Share;
use std::collections::BTreeMap;

use itertools::Itertools;

use super::words::{largest, percent, value};
use luxproof_model::Report;
use luxproof_model::published_column;
use luxproof_model::{Basis, Misfit, PublishedColumn, PublishedTable};
use luxproof_model::{EngineName, Quantity, Recording};

/// A table to draw: a heading, and rows of as many cells.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Grid {
    pub(super) title: String,
    pub(super) head: Vec<String>,
    pub(super) rows: Vec<Vec<String>>,
}

/// One grid for each published table, in the order of the procedures, then the shares.
pub(super) fn grids(report: &Report) -> Vec<Grid> {
    let tables = report.published.iter().sorted_by_key(|t| t.procedure);
    tables.map(|table| grid(report, table)).chain(grid_of_splits(report)).collect()
}

pub(super) fn grid(report: &Report, table: &PublishedTable) -> Grid {
    let sign = if table.quantity == Quantity::LuminousIntensity { "gamma " } else { "" };
    let mut head = vec![format!("{} [{}]", table.name, table.quantity.unit())];
    head.extend(table.rows.iter().map(|r| format!("{sign}{}", r.place)));
    head.push("furthest from the paper".to_owned());
    let mut rows: Vec<Vec<String>> = table.columns.iter().map(|column| paper_row(table, column)).collect();
    rows.extend(our_rows(report, table));
    Grid { title: table.title.clone(), head, rows }
}

/// The row of a column of the paper, with its misfits at the end.
fn paper_row(table: &PublishedTable, column: &PublishedColumn) -> Vec<String> {
    let mut row = vec![format!("paper {}", column.name)];
    row.extend(table.rows.iter().map(|r| r.cells.get(&column.name).cloned().unwrap_or_else(|| "-".to_owned())));
    let mut notes: Vec<String> = vec![];
    if column.reference {
        notes.push("its reference".to_owned());
    }
    let misfits = table.misfits.iter().filter(|m| m.column == column.name);
    notes.extend(misfits.filter(|m| table.rows.iter().any(|r| r.row == m.row)).map(Misfit::to_string));
    row.push(notes.join("; "));
    row
}

/// The rows of our readings, in the order of the engines, each different row once.
fn our_rows(report: &Report, table: &PublishedTable) -> Vec<Vec<String>> {
    let recordings = report
        .recordings
        .iter()
        .filter(|r| r.key.procedure == table.procedure && table.cases.contains(&r.key.case))
        .sorted_by_key(|r| report.engines.iter().position(|e| e.id == r.key.engine));
    let mut listed: Vec<(String, Vec<String>)> = vec![];
    let mut rows = vec![];
    for recording in recordings {
        let readings = table.rows.iter().map(|r| report.reading(&recording.key, &r.meter));
        let cells: Vec<String> = readings.map(|reading| reading.map_or_else(|| "-".to_owned(), value)).collect();
        let label = recording_label(recording);
        // Our solvers run in every case and often repeat the same row.
        if cells.iter().all(|c| c == "-") || listed.contains(&(label.clone(), cells.clone())) {
            continue;
        }
        let is_ambiguous = listed.iter().any(|(other, _)| *other == label);
        let shown = if is_ambiguous { format!("{label} ({})", recording.key.case) } else { label.clone() };
        listed.push((label, cells.clone()));
        rows.push(std::iter::once(shown).chain(cells).chain([largest_deviations(report, recording)]).collect());
    }
    rows
}

/// The engine with its model and bounces, or with its method.
fn recording_label(recording: &Recording) -> String {
    if recording.key.engine == EngineName::IESNA {
        let method = recording.method.get("method").map(|m| format!(", {m}"));
        return format!("{}{}", EngineName::IESNA, method.unwrap_or_default());
    }
    let light = recording.light.to_string();
    let bounces = light.split_once(", ").map(|(_, bounces)| format!(", {bounces}"));
    format!("{}, {}{}", recording.key.engine, recording.model, bounces.unwrap_or_default())
}

/// The largest relative deviation of a recording from each column of the paper that it is compared with.
fn largest_deviations(report: &Report, recording: &Recording) -> String {
    let mut columns: BTreeMap<&str, Vec<f64>> = BTreeMap::new();
    for c in report.comparisons.iter().filter(|c| c.key == recording.key) {
        let reference = c.reference.as_ref().filter(|r| r.basis == Basis::Published);
        if let Some((reference, deviation)) = reference.zip(c.relative_deviation) {
            columns.entry(published_column(&reference.source)).or_default().push(deviation);
        }
    }
    let largest = columns.into_iter().filter_map(|(column, all)| Some((column, largest(all.into_iter())?)));
    largest.map(|(column, deviation)| format!("{column} {}", percent(deviation))).collect::<Vec<_>>().join(", ")
}

/// The splits as a table; `None` where there are none.
pub(super) fn grid_of_splits(report: &Report) -> Option<Grid> {
    let first = report.paper_splits.first()?;
    let head = ["", "whole", "method", "photometry", "renderer", "remainder"];
    Some(Grid {
        title: format!(
            "{}: the paper's renderings against its calculation, and the shares of each cause (errors of method and photometry are \
             equal and opposite)",
            first.table
        ),
        head: head.map(str::to_owned).to_vec(),
        rows: report.paper_splits.iter().map(split_row).collect(),
    })
}

fn split_row(s: &PaperSplit) -> Vec<String> {
    let mut row = vec![format!("{} {}", s.column, s.place)];
    row.extend([&s.whole, &s.method, &s.photometry, &s.renderer, &s.remainder].map(describe_share));
    row
}

fn describe_share(s: &Share) -> String {
    format!("{:+.1} ± {:.1} %", 100.0 * s.value, 100.0 * s.uncertainty)
}
