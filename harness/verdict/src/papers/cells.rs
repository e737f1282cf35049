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

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use luxproof_model::{ErrorBudget, Estimate, MeterId, ProcedureId, Quantity, Reference, Uncertainty};

    use super::*;
    use crate::fixtures::{built_in, recording, task};

    /// A reading of the first meter with this bound, compared with a printed column.
    fn comparison(engine: &str, value: f64, bound: f64, column: &str) -> Comparison {
        let exact = recording("simulator", &[Estimate::exact(10.0)]);
        let subject = recording(engine, &[Estimate { value, uncertainty: Uncertainty::Bound(bound) }]);
        let mut comparison = built_in().compare_one(&task(1), &subject, &[&exact, &subject]).remove(0);
        let source = format!("A paper, Table 2, {column}: as rendered");
        comparison.reference = Some(Reference::of(10.0, &Uncertainty::Bound(0.5), Basis::Published, source));
        comparison
    }

    fn column(name: &str, engine: &str) -> PublishedColumn {
        PublishedColumn {
            name: name.to_owned(),
            reference: false,
            meaning: "as rendered".to_owned(),
            engine: engine.to_owned(),
            model: "point".to_owned(),
        }
    }

    fn row(row: usize, cells: &[(&str, &str)]) -> PublishedRow {
        let cells: BTreeMap<String, String> =
            cells.iter().map(|(name, cell)| ((*name).to_owned(), (*cell).to_owned())).collect();
        PublishedRow { meter: MeterId::new("grid", row), place: format!("{row}"), row, cells }
    }

    /// A report with a table of one column, `lum`, whose first cell is 10.0 within .5.
    fn report(comparisons: Vec<Comparison>) -> Report {
        let table = PublishedTable {
            title: "A paper".to_owned(),
            name: "Table 2".to_owned(),
            procedure: ProcedureId::IndirectIlluminance,
            quantity: Quantity::Illuminance,
            cases: vec!["c".to_owned()],
            bounces: None,
            units_in_last_digit: 5.0,
            flux: None,
            columns: vec![column("lum", "radiance")],
            rows: vec![row(0, &[("lum", "10.0")])],
            misfits: vec![],
        };
        Report { published: vec![table], comparisons, ..Report::default() }
    }

    fn first(report: &Report) -> Cell {
        cells(report, 2.0).remove(0)
    }

    #[test]
    fn a_cell_is_reproduced_where_the_whole_interval_is_within_its_rounding() {
        for (value, bound, standing) in [
            (10.4, 0.0, Standing::Reproduced),
            (10.6, 0.0, Standing::NotReproduced),
            (9.4, 0.0, Standing::NotReproduced),
            (10.4, 0.2, Standing::Undecided),
            (f64::NAN, 0.0, Standing::NotRead),
        ] {
            let found = first(&report(vec![comparison("radiance", value, bound, "lum")]));
            assert_eq!(found.standing, standing, "{value} {bound}");
            assert_eq!((found.rounding, found.printed.as_str(), found.unit), (0.5, "10.0", "lx"));
        }
    }

    #[test]
    fn the_interval_of_a_reading_is_without_the_rounding_of_the_cell() {
        let mut compared = comparison("radiance", 10.1, 0.3, "lum");
        let rounding = luxproof_model::Component::within(Source::Rounding, 0.5);
        let budget = compared.budget.clone().unwrap();
        let components = budget.components.iter().copied().chain([rounding]).collect();
        compared.budget = Some(ErrorBudget { components, ..budget });
        let found = first(&report(vec![compared]));
        // 95.45 % of a bound are within two standard deviations of a normal distribution.
        assert!((found.uncertainty.unwrap() - 0.9545 * 0.3).abs() < 1e-4, "{found:?}");
        assert_eq!((found.computed, found.fits_table, found.note), (Some(10.1), true, None));
    }

    #[test]
    fn a_cell_has_the_reading_of_its_engine_meter_case_procedure_and_column() {
        let right = comparison("radiance", 10.1, 0.0, "lum");
        assert_eq!(first(&report(vec![right.clone()])).computed, Some(10.1));
        let mut others = vec![comparison("mitsuba", 10.1, 0.0, "lum"), comparison("radiance", 10.1, 0.0, "other")];
        others.push(Comparison { meter: MeterId::new("grid", 1), ..right.clone() });
        for key in [
            luxproof_model::ReadingKey::new("d", ProcedureId::IndirectIlluminance, "radiance"),
            luxproof_model::ReadingKey::new("c", ProcedureId::DirectIlluminance, "radiance"),
        ] {
            others.push(Comparison { key, ..right.clone() });
        }
        let mut simulated = right.clone();
        simulated.reference.as_mut().unwrap().basis = Basis::Simulator;
        others.extend([simulated, Comparison { reference: None, ..right }]);
        for other in others {
            let found = first(&report(vec![other.clone()]));
            assert_eq!((found.computed, found.standing), (None, Standing::NotRead), "{other:?}");
        }
    }

    #[test]
    fn readings_precede_missing_ones_and_the_model_of_the_column_others() {
        let right = comparison("radiance", 10.1, 0.0, "lum");
        let why = Some("out of memory".to_owned());
        let missing = Comparison { value: None, budget: None, diagnosis: why.clone(), ..right.clone() };
        let of_areas = Comparison { model: "area".to_owned(), value: Some(10.2), ..right.clone() };
        let found = first(&report(vec![missing.clone(), of_areas.clone()]));
        assert_eq!((found.computed, found.model.as_str(), found.note), (Some(10.2), "area", None));
        let found = first(&report(vec![of_areas, right]));
        assert_eq!((found.computed, found.model.as_str()), (Some(10.1), "point"));
        assert_eq!(first(&report(vec![missing])).note, why);
    }

    #[test]
    fn a_misfit_is_noted_at_its_own_cell() {
        for (row, column, fits) in [(0, "lum", false), (1, "lum", true), (0, "other", true)] {
            let mut report = report(vec![comparison("radiance", 10.1, 0.0, "lum")]);
            report.published[0].misfits = vec![Misfit {
                row,
                column: column.to_owned(),
                printed: "10.0".to_owned(),
                expected: 20.0,
                half_width: 0.1,
                by: vec!["lum2".to_owned()],
            }];
            let found = first(&report);
            assert_eq!((found.fits_table, found.note.is_none()), (fits, fits), "{row} {column}");
        }
    }

    #[test]
    fn cells_are_in_the_order_of_the_paper_each_once_and_photometry_is_read_by_hand() {
        let mut report = report(vec![]);
        let table = &mut report.published[0];
        table.columns.push(column("file", PHOTOMETRY));
        let cells_of_row = [("lum", "1"), ("file", "2")];
        table.rows = vec![row(2, &cells_of_row), row(0, &cells_of_row), row(0, &cells_of_row), row(1, &[("lum", "3")])];
        let mut earlier = table.clone();
        earlier.procedure = ProcedureId::LuminousIntensity;
        earlier.rows.truncate(1);
        report.published.push(earlier);
        let found = cells(&report, 2.0);
        let places = found.iter().map(|c| (c.place.as_str(), c.column.as_str(), c.engine.as_str())).collect_vec();
        let [lum, file] = [("lum", "radiance"), ("file", "iesna")];
        let of = |place, (column, engine)| (place, column, engine);
        let expected =
            [of("2", lum), of("2", file), of("0", lum), of("0", file), of("1", lum), of("2", lum), of("2", file)];
        assert_eq!(places, expected);
    }
}
