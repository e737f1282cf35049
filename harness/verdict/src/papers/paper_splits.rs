//! Splits a paper's deviations into shares, by the readings of all cases that lie between its printed values.

use luxproof_scene::Bounces;

use super::{Stages, shares};
use luxproof_model::Report;
use luxproof_model::{EngineName, Estimate, Reading, Uncertainty};
use luxproof_model::{PaperSplit, PublishedColumn, PublishedRow, PublishedTable};

/// The coverage factor of the intervals: JCGM 100:2008, 6.3.3.
const COVERAGE_FACTOR: f64 = 2.0;

/// Every split for which the cases of a report have the readings.
pub fn paper_splits(report: &Report) -> Vec<PaperSplit> {
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
    let place = TablePlace { report, table, row };
    let (all, cut) = (Some(Bounces::Converged), Some(Bounces::AtMost(table.bounces?)));
    let model = &column.model;
    let stages = Stages {
        printed_method: table.printed(row, &method.name)?,
        method: place.find_reading(&method.engine, "", None)?,
        exact: place.find_reading(&EngineName::SIMULATOR, &method.model, all)?,
        exact_cut: place.find_reading(&EngineName::SIMULATOR, &method.model, cut)?,
        exact_model: place.find_reading(&EngineName::SIMULATOR, model, cut)?,
        rendered: place.find_reading(&column.engine, model, cut)?,
        printed: table.printed(row, &column.name)?,
    };
    let [whole, of_method, photometry, renderer, remainder] = shares(&stages, table.flux.as_ref(), COVERAGE_FACTOR);
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

/// A row of a paper's table, with the report that has the readings.
struct TablePlace<'a> {
    report: &'a Report,
    table: &'a PublishedTable,
    row: &'a PublishedRow,
}

impl TablePlace<'_> {
    /// Finds an engine's reading, of a luminaire model unless that is empty, and of a number of bounces if given.
    fn find_reading(&self, engine: &str, model: &str, bounces: Option<Bounces>) -> Option<Estimate> {
        let matching = self.report.recordings.iter().filter(|r| {
            self.table.cases.contains(&r.key.case)
                && r.key.procedure == self.table.procedure
                && r.key.engine == *engine
                && (model.is_empty() || r.model == model)
                && (bounces.is_none() || r.light.bounces() == bounces)
        });
        let mut readings = matching.filter_map(|recording| self.report.reading(&recording.key, &self.row.meter));
        readings.next().map(to_estimate)
    }
}

/// A reading with one standard uncertainty.
fn to_estimate(reading: &Reading) -> Estimate {
    Estimate { value: reading.value, uncertainty: Uncertainty::sampled(reading.uncertainty.standard(), None) }
}
