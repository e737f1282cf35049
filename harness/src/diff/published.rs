//! Published tables as references: printed cells with the interval that their rounding leaves.
//!
//! The format is described at the top of `reference/published/cachet.yaml`.

use std::collections::BTreeMap;
use std::path::Path;

use glam::DVec3;
use luminaire::scene::{Bounces, Transport};
use serde::Deserialize;

use super::{Basis, Reference};
use crate::procedures::{Target, Task};

/// The tables of one paper.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Published {
    #[serde(rename = "luxproof_published")]
    version: u32,
    citation: Citation,
    rounding: Rounding,
    tables: BTreeMap<String, Table>,
}

#[derive(Clone, Debug, Deserialize)]
struct Citation {
    title: String,
    /// What the values are, where they are not a paper's.
    #[serde(default = "published")]
    basis: Basis,
}

const fn published() -> Basis {
    Basis::Published
}

#[derive(Clone, Debug, Deserialize)]
struct Rounding {
    units_in_last_digit: f64,
}

#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Table {
    name: String,
    quantity: crate::reading::Quantity,
    #[serde(default)]
    bounces: Option<u32>,
    columns: BTreeMap<String, Column>,
    rows: Vec<Row>,
}

#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Column {
    reference: bool,
    engine: String,
    model: String,
    /// Further luminaire models that the column may be held against.
    #[serde(default)]
    also: Vec<String>,
    #[serde(default, rename = "distance_m")]
    _distance_m: Option<f64>,
    #[serde(default)]
    bounces: Option<u32>,
    meaning: String,
}

#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Row {
    #[serde(default)]
    gamma_deg: Option<f64>,
    #[serde(default)]
    c_deg: Option<f64>,
    #[serde(default)]
    at_m: Option<[f64; 3]>,
    #[serde(default)]
    normal: Option<[f64; 3]>,
    cells: BTreeMap<String, String>,
}

/// A printed value with the interval it stands for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cell {
    /// The printed value.
    pub value: f64,
    /// Half the width of its interval.
    pub half_width: f64,
}

/// Why published tables cannot be used.
#[derive(Debug, thiserror::Error)]
#[error("{file}: {message}")]
pub struct PublishedError {
    /// The file.
    pub file: String,
    /// What is wrong.
    pub message: String,
}

impl Published {
    /// Reads and checks the tables.
    pub fn read(path: &Path) -> Result<Self, PublishedError> {
        let fail = |message: String| PublishedError { file: path.display().to_string(), message };
        let text = std::fs::read_to_string(path).map_err(|e| fail(e.to_string()))?;
        let published: Self = crate::spec::from_yaml(&text).map_err(fail)?;
        if published.version != 1 {
            return Err(fail(format!("format version {} is not known; this program reads 1", published.version)));
        }
        let cells = published.tables.values().flat_map(|t| t.rows.iter().flat_map(|r| r.cells.values()));
        if let Some(bad) = cells.into_iter().find(|c| published.cell(c).is_none()) {
            return Err(fail(format!("the cell \"{bad}\" is no number")));
        }
        Ok(published)
    }

    /// The references that the paper holds for a reading of `engine` at one target.
    ///
    /// The paper's own reference columns of a closed form judge every engine; every other column stands beside the
    /// readings of the engine that it names, of the same luminaire model. A column at a fixed number of bounces is compared with readings at that number.
    pub fn references(&self, task: &Task, target: &Target, engine: &str) -> Vec<Reference> {
        let Some(table) = self.tables.get(task.procedure).filter(|t| t.quantity == task.quantity) else {
            return vec![];
        };
        let Some(row) = table.rows.iter().find(|r| r.is_at(target)) else { return vec![] };
        let model = task.model();
        // Derived values judge every engine, whatever they are of.
        let closed_form = matches!(task.transport, Transport::Direct) || self.citation.basis != Basis::Published;
        let compared = |column: &Column| {
            let same_bounces = match (column.bounces.filter(|_| table.bounces.is_some()), task.transport) {
                (Some(n), Transport::Indirect(b) | Transport::Total(b)) => b == Bounces::AtMost(n),
                _ => true,
            };
            let same_model = column.model == model || column.also.contains(&model);
            same_bounces && ((column.reference && closed_form) || (column.engine == engine && same_model))
        };
        let columns = table.columns.iter().filter(|(_, column)| compared(column));
        let reference = |(name, column): (&String, &Column)| {
            let cell = self.cell(row.cells.get(name)?)?;
            Some(Reference {
                value: cell.value,
                // A rectangular distribution over the rounding interval (GUM 4.3.7).
                uncertainty: cell.half_width / 3f64.sqrt(),
                basis: self.citation.basis,
                source: format!("{}, {}, {name}: {}", self.citation.title, table.name, column.meaning),
            })
        };
        columns.filter_map(reference).collect()
    }

    fn cell(&self, printed: &str) -> Option<Cell> {
        let value: f64 = printed.trim().parse().ok().filter(|v: &f64| v.is_finite())?;
        let decimals = printed.split_once('.').map_or(0, |(_, fraction)| fraction.trim().len());
        let unit = 10f64.powi(-i32::try_from(decimals).ok()?);
        Some(Cell { value, half_width: unit * self.rounding.units_in_last_digit })
    }
}

impl Row {
    /// Within 1e-6 m or 1e-6 degrees, as the format says.
    fn is_at(&self, target: &Target) -> bool {
        const SAME: f64 = 1e-6;
        match (self.gamma_deg, self.c_deg, target.direction) {
            (Some(gamma), Some(c), Some(d)) => (gamma - d.gamma_deg).abs() <= SAME && (c - d.c_deg).abs() <= SAME,
            _ => match (self.at_m, self.normal, target.direction) {
                (Some(at), Some(normal), None) => {
                    DVec3::from(at).distance(target.meter.position_m) <= SAME
                        && DVec3::from(normal).normalize_or_zero().distance(target.meter.normal) <= SAME
                }
                _ => false,
            },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn derived_values_say_what_they_rest_on() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../reference/analytic/values");
        for (name, basis) in [("cie-5.6", Basis::ClosedForm), ("s2", Basis::Exact)] {
            let published = Published::read(&folder.join(format!("{name}.yaml"))).unwrap();
            assert_eq!(published.citation.basis, basis, "{name}");
        }
    }

    #[test]
    fn a_cell_stands_for_the_interval_of_its_printed_digits() {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../reference/published/cachet.yaml");
        let published = Published::read(&path).unwrap();
        assert_eq!(published.cell("2.70"), Some(Cell { value: 2.70, half_width: 0.01 }));
        assert_eq!(published.cell("35.7"), Some(Cell { value: 35.7, half_width: 0.1 }));
        assert_eq!(published.cell("0"), Some(Cell { value: 0.0, half_width: 1.0 }));
        assert_eq!(published.cell("n/a"), None);
    }
}
