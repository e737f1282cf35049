//! What renderers take for direct light: by measurement, since each light and meter is looked at once, or so many times as the error needs.

use luxproof_scene::{LuminaireModel, Transport};

use super::Job;

/// Processor seconds of one core (`benchmarks/planning.md`).
pub(super) struct DirectCost {
    /// To start, and to read a scene.
    pub(super) start: f64,
    /// For each meter and luminaire that is a point.
    pub(super) a_point: f64,
    /// For each that is an opening; `None` where it is sampled until its error is small enough.
    pub(super) an_opening: Option<f64>,
}

impl DirectCost {
    /// Nothing where light is reflected: nobody knows how soon its error is small.
    pub(super) fn of(&self, job: &Job) -> Option<f64> {
        if job.transport != Transport::Direct {
            return None;
        }
        let luminaires = job.scene.luminaires.iter().map(|luminaire| match luminaire.model {
            LuminaireModel::Point => Some(self.a_point),
            LuminaireModel::Area | LuminaireModel::Impostor => self.an_opening,
        });
        let a_meter: f64 = luminaires.sum::<Option<f64>>()?;
        Some(self.start + job.sensors.len() as f64 * a_meter)
    }
}
