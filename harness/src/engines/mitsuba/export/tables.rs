//! The luminous intensity distributions of a job, one JSON file for each that differs.

use luminaire::photometry::LuminousIntensityDistribution;
use serde::Serialize;

use crate::engines::mitsuba::ID;
use crate::engines::{EngineError, Job, SceneFile};

/// Distributions without repetition, and which luminaire has which.
pub(super) struct Tables<'a> {
    pub(super) distinct: Vec<&'a LuminousIntensityDistribution>,
    pub(super) of_luminaire: Vec<usize>,
}

#[derive(Serialize)]
struct TableFile<'a> {
    c_deg: &'a [f64],
    gamma_deg: &'a [f64],
    candela: Vec<&'a [f64]>,
}

impl<'a> Tables<'a> {
    pub(super) fn of(job: &'a Job) -> Self {
        let mut tables = Self { distinct: vec![], of_luminaire: vec![] };
        for luminaire in &job.scene.luminaires {
            let distribution = &luminaire.photometry.distribution;
            let known = tables.distinct.iter().position(|d| *d == distribution);
            tables.of_luminaire.push(known.unwrap_or(tables.distinct.len()));
            if known.is_none() {
                tables.distinct.push(distribution);
            }
        }
        tables
    }

    /// The file of each luminaire's table, in the luminaires' order.
    pub(super) fn of_luminaires(&self) -> impl Iterator<Item = String> {
        self.of_luminaire.iter().map(|k| name(*k))
    }

    pub(super) fn files(&self) -> Result<Vec<SceneFile>, EngineError> {
        let file = |(k, distribution): (usize, &&LuminousIntensityDistribution)| {
            let full = distribution.full_circle();
            let candela = (0..full.c_deg().len()).map(|c| full.plane(c)).collect();
            let table = TableFile { c_deg: full.c_deg(), gamma_deg: full.gamma_deg(), candela };
            let json = serde_json::to_string(&table)
                .map_err(|e| EngineError::output(ID, format!("a table cannot be written: {e}")))?;
            Ok(SceneFile::text(&name(k), json))
        };
        self.distinct.iter().enumerate().map(file).collect()
    }
}

fn name(k: usize) -> String {
    format!("table-{k}.json")
}
