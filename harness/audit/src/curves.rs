//! Luminous intensity curves of the photometric files, over which a report draws its readings.

use itertools::Itertools;
use luxproof_model::Curve;

use luxproof_spec::procedures::Task;

/// The curves of the half planes that a task reads back, and of the opposite ones, which complete a polar diagram.
pub(crate) fn curves(case: &str, task: &Task) -> Vec<Curve> {
    let directions = task.targets.iter().filter_map(|t| t.direction);
    let planes = directions.flat_map(|d| [d.c_deg, d.c_deg + 180.0]).map(|c| c.rem_euclid(360.0));
    let [luminaire] = &task.scene.luminaires[..] else { return vec![] };
    let distribution = &luminaire.photometry.distribution;
    let gamma_deg = distribution.gammas_of_half_planes();
    let mut curves = vec![];
    for c_deg in planes.sorted_by(f64::total_cmp).dedup() {
        let intensity = gamma_deg.iter().map(|&gamma| distribution.intensity(c_deg, gamma).value());
        curves.push(Curve {
            case: case.to_owned(),
            procedure: task.procedure,
            luminaire: luminaire.id.clone(),
            c_deg,
            gamma_deg: gamma_deg.clone(),
            intensity_cd: intensity.map(|cd| cd * luminaire.flux_scale).collect(),
        });
    }
    curves
}
