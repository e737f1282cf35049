//! Luminous intensity curves of the photometric files, kept in the report so that a view can draw readings over them.

use itertools::Itertools;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::procedures::Task;
use crate::record::ProcedureId;

/// What the file says in one half plane, at the angles of its table; straight in between.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Curve {
    pub case: String,
    pub procedure: ProcedureId,
    pub luminaire: String,
    pub c_deg: f64,
    pub gamma_deg: Vec<f64>,
    /// Luminous intensity at them in candela, the luminaire's flux scale included.
    pub intensity_cd: Vec<f64>,
}

/// The half planes that a task reads back, and those across the axis, which complete a polar diagram.
pub fn curves(case: &str, task: &Task) -> Vec<Curve> {
    let directions = task.targets.iter().filter_map(|t| t.direction);
    let planes = directions.flat_map(|d| [d.c_deg, d.c_deg + 180.0]).map(|c| c.rem_euclid(360.0));
    let [luminaire] = &task.scene.luminaires[..] else { return vec![] };
    let distribution = &luminaire.photometry.distribution;
    let gamma_deg = distribution.gammas_of_half_planes();
    let intensity_cd = |c, gamma| distribution.intensity(c, gamma).value() * luminaire.flux_scale;
    let of_plane = |c_deg: f64| Curve {
        case: case.to_owned(),
        procedure: task.procedure,
        luminaire: luminaire.id.clone(),
        c_deg,
        gamma_deg: gamma_deg.clone(),
        intensity_cd: gamma_deg.iter().map(|&gamma| intensity_cd(c_deg, gamma)).collect(),
    };
    planes.sorted_by(f64::total_cmp).dedup().map(of_plane).collect()
}
