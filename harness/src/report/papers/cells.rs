//! Every printed cell of a paper with what is read in its place now, and whether that is what is printed, within its rounding.

use itertools::Itertools;
use schemars::JsonSchema;
use serde::Serialize;

use crate::judge::{
    Basis, Comparison, Misfit, PHOTOMETRY, PublishedColumn, PublishedRow, PublishedTable, Source, Verdict, judge,
};
use crate::record::EngineName;
use crate::report::Report;
use crate::report::words::published_column;

/// Whether a printed cell comes out again.
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

/// A printed cell and what is read in its place.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Cell {
    pub table: String,
    pub column: String,
    pub place: String,
    pub printed: String,
    /// What its last digit leaves open, either way.
    pub rounding: f64,
    pub unit: &'static str,
    pub engine: EngineName,
    pub model: String,
    pub computed: Option<f64>,
    /// Half width of its interval, at the coverage of verdicts.
    pub uncertainty: Option<f64>,
    pub standing: Standing,
    /// That the cell does not fit the rest of its table, or that nothing was read and why.
    pub note: Option<String>,
}

/// The cells of all tables that a report is held against, in the paper's order; `coverage` is the factor of its intervals.
pub fn cells(report: &Report, coverage: f64) -> Vec<Cell> {
    let tables = report.published.iter().sorted_by_key(|table| table.procedure);
    let of_table = |table: &PublishedTable| {
        let rows = table.rows.iter().sorted_by_key(|row| row.row).dedup_by(|a, b| a.row == b.row);
        let pairs = rows.cartesian_product(table.columns.iter()).collect_vec();
        pairs.into_iter().filter_map(|(row, column)| cell(report, table, row, column, coverage)).collect_vec()
    };
    tables.flat_map(of_table).collect()
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
    let is_its = |c: &&Comparison| {
        let of_paper = c.reference.as_ref().filter(|r| r.basis == Basis::Published);
        c.key.procedure == table.procedure
            && c.key.engine == engine
            && c.meter == row.meter
            && table.cases.contains(&c.key.case)
            && of_paper.is_some_and(|r| published_column(&r.source) == column.name)
    };
    // Of its own luminaire model first, and first what was read.
    let found = report.comparisons.iter().filter(is_its);
    let found = found.min_by_key(|c| (c.value.is_none(), c.model != column.model));
    let read = found.and_then(|c| Some((c.value?, c.budget.as_ref()?)));
    let read = read.map(|(value, budget)| (value, budget.expanded_without(Source::Rounding, coverage)));
    let verdict = read.map(|(value, expanded)| judge(value - printed.value, expanded, rounding));
    let misfit = table.misfits.iter().find(|m| m.row == row.row && m.column == column.name).map(Misfit::to_string);
    let unread = || found.and_then(|c| c.diagnosis.clone()).filter(|_| read.is_none());
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
            Some(Verdict::Inconclusive) => Standing::Undecided,
            _ => Standing::NotRead,
        },
        note: misfit.or_else(unread),
    })
}
