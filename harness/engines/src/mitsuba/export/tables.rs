//! The luminous intensity distributions of a job, one JSON file for each that differs.

use luxproof_photometry::LuminousIntensityDistribution;
use serde::Serialize;

use crate::mitsuba::ID;
use crate::tables::Tables;
use crate::{EngineError, SceneFile};

#[derive(Serialize)]
struct TableFile<'a> {
    c_deg: &'a [f64],
    gamma_deg: &'a [f64],
    candela: Vec<&'a [f64]>,
}

pub(super) fn files(tables: &Tables<'_>) -> Result<Vec<SceneFile>, EngineError> {
    let distinct = tables.distinct.iter().enumerate();
    distinct.map(|(k, table)| Ok(SceneFile::text(&name(k), to_json(table)?))).collect()
}

fn to_json(distribution: &LuminousIntensityDistribution) -> Result<String, EngineError> {
    let full = distribution.full_circle();
    let candela = (0..full.c_deg().len()).map(|c| full.plane(c)).collect();
    let table = TableFile { c_deg: full.c_deg(), gamma_deg: full.gamma_deg(), candela };
    serde_json::to_string(&table).map_err(|e| EngineError::output(ID, format!("a table cannot be written: {e}")))
}

/// The file of table `k`.
pub(super) fn name(k: usize) -> String {
    format!("table-{k}.json")
}
