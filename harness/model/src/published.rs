//! Published tables as they are printed, and cells that contradict the rest of their table.

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::{Estimate, MeterId, ProcedureId, Quantity, Uncertainty};

/// The flux of a paper's luminaire, as far as its tables show it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PublishedFlux {
    pub value_lm: f64,
    /// Half width of its interval.
    pub half_width_lm: f64,
    pub source: String,
}

/// A published table as it is printed, with the meters that its rows belong to.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct PublishedTable {
    pub title: String,
    pub name: String,
    pub procedure: ProcedureId,
    pub quantity: Quantity,
    /// The cases that are compared with it.
    pub cases: Vec<String>,
    /// The number of diffuse reflections in its renderings, where that matters.
    pub bounces: Option<u32>,
    /// The uncertainty of a cell, in units of its last printed digit.
    #[serde(default)]
    pub units_in_last_digit: f64,
    pub flux: Option<PublishedFlux>,
    pub columns: Vec<PublishedColumn>,
    /// The rows, in the order of the meters.
    pub rows: Vec<PublishedRow>,
    /// Cells that contradict the rest of the table.
    #[serde(default)]
    pub misfits: Vec<Misfit>,
}

impl PublishedTable {
    /// Whether both are the same table of the same paper.
    pub fn is_the_same(&self, other: &Self) -> bool {
        (&self.title, &self.name, &self.procedure) == (&other.title, &other.name, &other.procedure)
    }

    /// The cell of a column in a row, with the interval of its digits.
    pub fn printed(&self, row: &PublishedRow, column: &str) -> Option<Estimate> {
        printed_cell(row.cells.get(column)?, 0, self.units_in_last_digit)
    }
}

#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct PublishedColumn {
    pub name: String,
    /// Whether the paper compares its other columns with this one.
    pub reference: bool,
    pub meaning: String,
    /// The engine that it is compared with.
    #[serde(default)]
    pub engine: String,
    #[serde(default)]
    pub model: String,
}

#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct PublishedRow {
    pub meter: MeterId,
    /// The place: gamma in degrees, or the position in metres.
    pub place: String,
    /// The number of the row in the paper, counted from 0.
    #[serde(default)]
    pub row: usize,
    pub cells: BTreeMap<String, String>,
}

/// A printed cell with the interval of its rounding.
///
/// `decimals` are those of its column, which count where the cell has fewer.
pub fn printed_cell(printed: &str, decimals: usize, units_in_last_digit: f64) -> Option<Estimate> {
    let value: f64 = printed.trim().parse().ok().filter(|v: &f64| v.is_finite())?;
    let unit = 10f64.powi(-i32::try_from(decimals_of(printed).max(decimals)).ok()?);
    Some(Estimate { value, uncertainty: Uncertainty::Bound(unit * units_in_last_digit) })
}

/// A printed cell that the rest of its table contradicts. A deviation from it is no engine's fault.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Misfit {
    /// The number of the row in the paper, counted from 0.
    pub row: usize,
    pub column: String,
    pub printed: String,
    /// The value that the rest of the table implies.
    pub expected: f64,
    pub half_width: f64,
    /// The other columns or the law that contradict it.
    pub by: Vec<String>,
}

impl std::fmt::Display for Misfit {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { printed, expected, half_width, by, .. } = self;
        write!(
            f,
            "the printed {printed} does not fit its own table: by {} {expected:.2} ± {half_width:.2}",
            by.join(" and ")
        )
    }
}

/// Digits behind the point of a printed number.
pub fn decimals_of(printed: &str) -> usize {
    printed.split_once('.').map_or(0, |(_, fraction)| fraction.trim().len())
}

/// The name of the column in a published source, "TITLE, TABLE, COLUMN: MEANING"; titles may contain colons.
pub fn published_column(source: &str) -> &str {
    let (head, _) = source.rsplit_once(": ").unwrap_or((source, ""));
    head.rsplit(", ").next().unwrap_or(head)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_published_column_is_found_behind_a_title_with_a_colon() {
        let source = "Simulation of Luminaires in Radiance: Verification Method, Table 2, lum1: Flat polygon, of light";
        assert_eq!(published_column(source), "lum1");
    }

    #[test]
    fn a_printed_cell_has_the_interval_of_its_last_digit() {
        // Half a unit of the last digit of 12.30 is .005.
        for (printed, decimals, half_width) in
            [("12.30", 0, 0.005), ("12.30", 1, 0.005), ("12.3", 2, 0.005), ("12", 0, 0.5)]
        {
            let found = printed_cell(printed, decimals, 0.5).unwrap();
            let Uncertainty::Bound(bound) = found.uncertainty else { panic!("{found:?}") };
            assert!((bound / half_width - 1.0).abs() < 1e-12, "{printed}: {bound}");
        }
        assert_eq!(printed_cell(" 7.5 ", 0, 0.5).map(|e| e.value), Some(7.5));
        assert_eq!([printed_cell("n.a.", 0, 0.5), printed_cell("inf", 0, 0.5)], [None, None]);
        assert_eq!(["1", "1.", "1.25 ", "0.500"].map(decimals_of), [0, 0, 2, 3]);
        assert_eq!(published_column("Title, Table 2, lum1"), "lum1");
    }

    #[test]
    fn a_table_is_the_same_by_title_name_and_procedure() {
        let row = PublishedRow {
            meter: MeterId::new("desk", 0),
            place: "0, 0".to_owned(),
            row: 0,
            cells: BTreeMap::from([("lum1".to_owned(), "12.3".to_owned())]),
        };
        let table = PublishedTable {
            title: "Simulation".to_owned(),
            name: "Table 2".to_owned(),
            procedure: ProcedureId::DirectIlluminance,
            quantity: Quantity::Illuminance,
            cases: vec![],
            bounces: None,
            units_in_last_digit: 1.0,
            flux: None,
            columns: vec![],
            rows: vec![row.clone()],
            misfits: vec![],
        };
        assert!(table.is_the_same(&PublishedTable { rows: vec![], ..table.clone() }));
        assert!(!table.is_the_same(&PublishedTable { title: "Another".to_owned(), ..table.clone() }));
        assert!(!table.is_the_same(&PublishedTable { name: "Table 3".to_owned(), ..table.clone() }));
        assert!(!table.is_the_same(&PublishedTable { procedure: ProcedureId::Luminance, ..table.clone() }));
        assert_eq!(table.printed(&row, "lum1"), Some(Estimate { value: 12.3, uncertainty: Uncertainty::Bound(0.1) }));
        assert_eq!(table.printed(&row, "lum2"), None);
    }

    #[test]
    fn a_misfit_names_what_contradicts_it() {
        let (column, printed) = ("lum1".to_owned(), "12.3".to_owned());
        let by = vec!["lum2".to_owned(), "the law".to_owned()];
        let misfit = Misfit { row: 3, column, printed, expected: 13.257, half_width: 0.051, by };
        let text = "the printed 12.3 does not fit its own table: by lum2 and the law 13.26 ± 0.05";
        assert_eq!(misfit.to_string(), text);
    }
}
