//! A paper's deviations split into shares: the readings of all cases that lie between its printed values, and the table of shares.

use luminaire::scene::Bounces;

use super::{Grid, Report, reading};
use crate::judge::{PaperSplit, PublishedColumn, PublishedRow, PublishedTable, Share, Stages, shares};
use crate::record::{EngineName, Estimate, Reading, Recording, Uncertainty};

/// The coverage factor of the intervals: JCGM 100:2008, 6.3.3.
const COVERAGE: f64 = 2.0;

/// Every split that the cases of a report hold the readings for.
pub(in crate::report) fn splits(report: &Report) -> Vec<PaperSplit> {
    let mut splits = vec![];
    for table in report.published.iter().filter(|t| t.bounces.is_some()) {
        let Some(method) = table.columns.iter().find(|c| c.reference) else { continue };
        for column in table.columns.iter().filter(|c| !c.reference) {
            splits.extend(table.rows.iter().filter_map(|row| split(report, table, method, column, row)));
        }
    }
    splits
}

fn split(
    report: &Report,
    table: &PublishedTable,
    method: &PublishedColumn,
    column: &PublishedColumn,
    row: &PublishedRow,
) -> Option<PaperSplit> {
    let cut = Some(Bounces::AtMost(table.bounces?));
    let read = |engine: &str, model: &str, bounces: Option<Bounces>| {
        let is_it = |r: &&Recording| {
            table.cases.contains(&r.key.case)
                && r.key.procedure == table.procedure
                && r.key.engine == *engine
                && (model.is_empty() || r.model == model)
                && (bounces.is_none() || r.light.bounces() == bounces)
        };
        let mut recordings = report.recordings.iter().filter(is_it);
        recordings.find_map(|recording| reading(report, &recording.key, &row.meter).map(stage))
    };
    let (all, paper) = (Some(Bounces::Converged), &column.model);
    let stages = Stages {
        printed_method: table.printed(row, &method.name)?,
        method: read(&method.engine, "", None)?,
        exact: read(&EngineName::SIMULATOR, &method.model, all)?,
        exact_cut: read(&EngineName::SIMULATOR, &method.model, cut)?,
        exact_model: read(&EngineName::SIMULATOR, paper, cut)?,
        rendered: read(&column.engine, paper, cut)?,
        printed: table.printed(row, &column.name)?,
    };
    let [whole, of_method, photometry, renderer, remainder] = shares(&stages, table.flux.as_ref(), COVERAGE);
    Some(PaperSplit {
        table: table.name.clone(),
        meter: row.meter.clone(),
        place: row.place.clone(),
        column: column.name.clone(),
        whole,
        method: of_method,
        photometry,
        renderer,
        remainder,
    })
}

/// A reading with all that is uncertain of it as one standard uncertainty.
fn stage(reading: &Reading) -> Estimate {
    Estimate { value: reading.value, uncertainty: Uncertainty::sampled(reading.uncertainty.standard(), None) }
}

/// The splits as a table; `None` of none.
pub(super) fn grid(report: &Report) -> Option<Grid> {
    let first = report.paper_splits.first()?;
    let head = ["", "whole", "method", "photometry", "renderer", "remainder"];
    let cell = |s: &Share| format!("{:+.1} ± {:.1} %", 100.0 * s.value, 100.0 * s.uncertainty);
    let row = |s: &PaperSplit| {
        let shares = [&s.whole, &s.method, &s.photometry, &s.renderer, &s.remainder].map(cell);
        std::iter::once(format!("{} {}", s.column, s.place)).chain(shares).collect::<Vec<_>>()
    };
    Some(Grid {
        title: format!(
            "{}: the paper's renderings against its calculation, and whose shares these are (method and photometry are off \
             together, in opposite directions)",
            first.table
        ),
        head: head.map(str::to_owned).to_vec(),
        rows: report.paper_splits.iter().map(row).collect(),
    })
}
