//! A paper's deviations split into shares: the readings of all cases that lie between its printed values, and the table of shares.

use luminaire::scene::Bounces;

use super::paper::Grid;
use super::{ReadingRecord, Report};
use crate::judge::{PaperSplit, PublishedColumn, PublishedRow, PublishedTable, Share, Stage, Stages, shares};
use crate::record::Recording;

/// The coverage factor of the intervals: JCGM 100:2008, 6.3.3.
const COVERAGE: f64 = 2.0;

/// Every split that the cases of a report hold the readings for.
pub(super) fn splits(report: &Report) -> Vec<PaperSplit> {
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
            r.key.engine == engine
                && r.key.procedure == table.procedure
                && table.cases.contains(&r.key.case)
                && (model.is_empty() || r.model == model)
                && (bounces.is_none() || r.light.bounces() == bounces)
        };
        report.recordings.iter().filter(is_it).find_map(|recording| {
            let mine = |r: &&ReadingRecord| r.reading.meter == row.meter && r.key == recording.key;
            report.readings.iter().find(mine).map(|r| stage(r, recording))
        })
    };
    let printed = |name: &str| {
        let text = row.cells.get(name)?;
        let decimals = text.split_once('.').map_or(0, |(_, fraction)| fraction.len());
        let half_width = table.units_in_last_digit * 10f64.powi(-i32::try_from(decimals).ok()?);
        Some(Stage { value: text.parse().ok()?, uncertainty: half_width / 3f64.sqrt() })
    };
    let stages = Stages {
        printed_method: printed(&method.name)?,
        method: read(&method.engine, "", None)?,
        exact: read("simulator", &method.model, Some(Bounces::Converged))?,
        exact_cut: read("simulator", &method.model, cut)?,
        exact_model: read("simulator", &column.model, cut)?,
        rendered: read(&column.engine, &column.model, cut)?,
        printed: printed(&column.name)?,
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

fn stage(reading: &ReadingRecord, recording: &Recording) -> Stage {
    let instrument = recording.instrument_uncertainty * reading.reading.value;
    Stage { value: reading.reading.value, uncertainty: reading.reading.uncertainty.standard().hypot(instrument) }
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
