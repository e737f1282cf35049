//! Printed cells of a paper with the readings in their place, and whether they agree within the cell's rounding.

use itertools::Itertools;
use luxproof_statistics::error_budget;
use schemars::JsonSchema;
use serde::Serialize;

use super::PHOTOMETRY;
use crate::judge;
use luxproof_model::EngineName;
use luxproof_model::Report;
use luxproof_model::published_column;
use luxproof_model::{Basis, Comparison, Misfit, PublishedColumn, PublishedRow, PublishedTable, Source, Verdict};

/// Whether a reading reproduces a printed cell.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, JsonSchema, strum::Display)]
#[serde(rename_all = "snake_case")]
pub enum Standing {
    /// What is read lies within the cell's rounding, with all of its interval.
    #[strum(to_string = "within rounding")]
    Reproduced,
    /// It lies beyond, with all of it.
    #[strum(to_string = "beyond")]
    NotReproduced,
    /// It straddles the edge.
    #[strum(to_string = "undecided")]
    Undecided,
    /// Nothing was read.
    #[strum(to_string = "not read")]
    NotRead,
}

/// A printed cell and the reading in its place.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Cell {
    pub table: String,
    pub column: String,
    pub place: String,
    pub printed: String,
    /// Half width of the interval of its last digit.
    pub rounding: f64,
    pub unit: &'static str,
    pub engine: EngineName,
    pub model: String,
    pub computed: Option<f64>,
    /// Half width of its interval, at the coverage of verdicts.
    pub uncertainty: Option<f64>,
    pub standing: Standing,
    /// Whether the cell agrees with the other columns of its table, whatever was computed.
    pub fits_table: bool,
    /// Why the cell does not fit the rest of its table, or why nothing was read.
    pub note: Option<String>,
}

/// The cells of all tables of a report, in the paper's order; `coverage` is the factor of their intervals.
pub fn cells(report: &Report, coverage: f64) -> Vec<Cell> {
    let mut cells = vec![];
    for table in report.published.iter().sorted_by_key(|table| table.procedure) {
        for row in table.rows.iter().sorted_by_key(|row| row.row).dedup_by(|a, b| a.row == b.row) {
            cells.extend(table.columns.iter().filter_map(|column| cell(report, table, row, column, coverage)));
        }
    }
    cells
}

/// Whether a comparison is with a printed column.
fn is_of_column(comparison: &Comparison, column: &PublishedColumn) -> bool {
    let published = comparison.reference.as_ref().filter(|r| r.basis == Basis::Published);
    published.is_some_and(|r| published_column(&r.source) == column.name)
}

fn cell(
    report: &Report,
    table: &PublishedTable,
    row: &PublishedRow,
    column: &PublishedColumn,
    coverage: f64,
) -> Option<Cell> {
    let printed = table.printed(row, &column.name)?;
    let rounding = printed.uncertainty.bound();
    let engine: EngineName =
        if column.engine == PHOTOMETRY { EngineName::IESNA } else { column.engine.as_str().into() };
    let comparisons = report.comparisons.iter().filter(|c| {
        c.key.procedure == table.procedure
            && c.key.engine == engine
            && c.meter == row.meter
            && table.cases.contains(&c.key.case)
            && is_of_column(c, column)
    });
    // Readings come before missing ones, and the column's luminaire model before others.
    let found = comparisons.min_by_key(|c| (c.value.is_none(), c.model != column.model));
    let read = found.and_then(|c| Some((c.value?, c.budget.as_ref()?)));
    let read = read.map(|(value, budget)| (value, error_budget::expanded_without(budget, Source::Rounding, coverage)));
    let verdict = read.map(|(value, expanded)| judge(value - printed.value, expanded, rounding));
    let misfit = table.misfits.iter().find(|m| m.row == row.row && m.column == column.name).map(Misfit::to_string);
    let why_not_read = found.filter(|_| read.is_none()).and_then(|c| c.diagnosis.clone());
    Some(Cell {
        table: table.name.clone(),
        column: column.name.clone(),
        place: row.place.clone(),
        printed: row.cells.get(&column.name)?.clone(),
        rounding,
        unit: table.quantity.unit(),
        model: found.map_or(&column.model, |c| &c.model).clone(),
        engine,
        computed: read.map(|(value, _)| value),
        uncertainty: read.map(|(_, expanded)| expanded),
        standing: match verdict {
            Some(Verdict::Pass) => Standing::Reproduced,
            Some(Verdict::Fail) => Standing::NotReproduced,
            Some(Verdict::Undecided) => Standing::Undecided,
            _ => Standing::NotRead,
        },
        fits_table: misfit.is_none(),
        note: misfit.or(why_not_read),
    })
}
