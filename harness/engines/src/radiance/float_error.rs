//! Error bounds of 32-bit candela tables. Radiance stores the angles of a table in single precision, too.

use luxproof_photometry::{LuminousIntensityDistribution, angles_deg};
use luxproof_scene::{Luminaire, Meter, Scene};

use super::export::EDGE_DEG;

/// Half the spacing of 32-bit floats between 128 and 256 degrees.
const GAMMA_DEG: f64 = 8e-6;
/// Half the spacing of 32-bit floats between 256 and 512 degrees.
const C_DEG: f64 = 1.6e-5;

/// Returns a bound in lux on the error that rounding of the tables' angles makes of direct illuminance.
///
/// It is the change of intensity within the rounding. At an edge of a table it is the change within the ramp that replaces the edge.
pub(super) fn of_tables_lx(scene: &Scene, meter: &Meter) -> f64 {
    scene.luminaires.iter().map(|luminaire| of_table_lx(luminaire, meter)).sum()
}

/// Returns the bound for one luminaire.
fn of_table_lx(luminaire: &Luminaire, meter: &Meter) -> f64 {
    let ray = meter.position_m - luminaire.position_m;
    let cosine = -ray.normalize().dot(meter.normal);
    if cosine <= 0.0 {
        return 0.0;
    }
    let (c, gamma) = angles_deg(luminaire.orientation.transpose() * ray);
    let table = &luminaire.photometry.distribution;
    let angles = table.gamma_deg();
    let (first, last) = (angles[0], angles[angles.len() - 1]);
    let near_edge = (first > 0.0 && (gamma - first).abs() < 2.0 * EDGE_DEG)
        || (last < 180.0 && (gamma - last).abs() < 2.0 * EDGE_DEG);
    let gamma_step = if near_edge { 2.0 * EDGE_DEG } else { GAMMA_DEG };
    let candela = largest_change_cd(table, [c, gamma], [C_DEG, gamma_step]);
    luminaire.flux_scale * candela * cosine / ray.length_squared()
}

/// Returns the sum of the largest changes of intensity along gamma and C within steps of C and gamma.
fn largest_change_cd(table: &LuminousIntensityDistribution, at: [f64; 2], [c_step, gamma_step]: [f64; 2]) -> f64 {
    let along_gamma = change_cd(table, at, [0.0, gamma_step]).max(change_cd(table, at, [0.0, -gamma_step]));
    along_gamma + change_cd(table, at, [c_step, 0.0]).max(change_cd(table, at, [-c_step, 0.0]))
}

/// Returns the change of intensity by a step in C and gamma.
fn change_cd(table: &LuminousIntensityDistribution, [c, gamma]: [f64; 2], [d_c, d_gamma]: [f64; 2]) -> f64 {
    let centre = table.intensity(c, gamma.clamp(0.0, 180.0)).value();
    (table.intensity(c + d_c, (gamma + d_gamma).clamp(0.0, 180.0)).value() - centre).abs()
}
