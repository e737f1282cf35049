//! The luminous intensity distributions of a job without repetition, and which luminaire has which.

use luxproof_photometry::LuminousIntensityDistribution;

use super::Job;

pub(super) struct Tables<'a> {
    pub(super) distinct: Vec<&'a LuminousIntensityDistribution>,
    pub(super) of_luminaire: Vec<usize>,
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
}
