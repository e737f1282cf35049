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
}
