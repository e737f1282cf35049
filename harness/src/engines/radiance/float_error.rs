//! What 32-bit candela tables can cost: Radiance keeps the angles of a table, too, in single precision.

use luminaire::photometry::angles_deg;
use luminaire::scene::{Luminaire, Meter, Scene};

use super::export::EDGE_DEG;

/// Half the spacing of 32-bit floats between 128 and 256, and between 256 and 512 degrees.
const GAMMA_DEG: f64 = 8e-6;
const C_DEG: f64 = 1.6e-5;

/// Bound on the error in direct illuminance that the tables' angles cause, in lux: how much the intensity changes
/// within their rounding, and at an edge of the table within the ramp that stands for it.
pub(super) fn of_tables_lx(scene: &Scene, meter: &Meter) -> f64 {
    scene.luminaires.iter().map(|luminaire| of_table_lx(luminaire, meter)).sum()
}

fn of_table_lx(luminaire: &Luminaire, meter: &Meter) -> f64 {
    let ray = meter.position_m - luminaire.position_m;
    let cosine = -ray.normalize().dot(meter.normal);
    if cosine <= 0.0 {
        return 0.0;
    }
    let (c, gamma) = angles_deg(luminaire.orientation.transpose() * ray);
    let table = &luminaire.photometry.distribution;
    let at = |c: f64, gamma: f64| table.intensity(c, gamma.clamp(0.0, 180.0)).value();
    let centre = at(c, gamma);
    let change = |d_c: f64, d_gamma: f64| (at(c + d_c, gamma + d_gamma) - centre).abs();
    let larger = |step: f64, c_step: f64| {
        let gammas = change(0.0, step).max(change(0.0, -step));
        gammas + change(c_step, 0.0).max(change(-c_step, 0.0))
    };
    let angles = table.gamma_deg();
    let (first, last) = (angles[0], angles[angles.len() - 1]);
    let near_edge = (first > 0.0 && (gamma - first).abs() < 2.0 * EDGE_DEG)
        || (last < 180.0 && (gamma - last).abs() < 2.0 * EDGE_DEG);
    let candela = if near_edge { larger(2.0 * EDGE_DEG, C_DEG) } else { larger(GAMMA_DEG, C_DEG) };
    luminaire.flux_scale * candela * cosine / ray.length_squared()
}
