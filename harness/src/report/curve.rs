//! Luminous intensity curves of the photometric files, kept in the report so that a view can draw readings over them.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::procedures::Task;
use crate::record::ProcedureId;

/// What the file says in one half plane, at the angles of its table; straight in between.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Curve {
    pub case: String,
    /// The procedure that reads it back.
    pub procedure: ProcedureId,
    pub luminaire: String,
    /// C plane in degrees.
    pub c_deg: f64,
    /// Angles from the nadir in degrees.
    pub gamma_deg: Vec<f64>,
    /// Luminous intensity at them in candela, the luminaire's flux scale included.
    pub intensity_cd: Vec<f64>,
}

/// The half planes that a task reads back, and those across the axis, which complete a polar diagram.
pub fn curves(case: &str, task: &Task) -> Vec<Curve> {
    let mut planes: Vec<f64> =
        task.targets.iter().filter_map(|t| t.direction).flat_map(|d| [d.c_deg, d.c_deg + 180.0]).collect();
    for c in &mut planes {
        *c = c.rem_euclid(360.0);
    }
    planes.sort_by(f64::total_cmp);
    planes.dedup();
    let [luminaire] = &task.scene.luminaires[..] else { return vec![] };
    let distribution = &luminaire.photometry.distribution;
    let of_plane = |c_deg: f64| Curve {
        case: case.to_owned(),
        procedure: task.procedure.to_owned(),
        luminaire: luminaire.id.clone(),
        c_deg,
        gamma_deg: distribution.gamma_deg().to_vec(),
        intensity_cd: distribution
            .gamma_deg()
            .iter()
            .map(|&gamma| distribution.intensity(c_deg, gamma).value() * luminaire.flux_scale)
            .collect(),
    };
    planes.into_iter().map(of_plane).collect()
}
