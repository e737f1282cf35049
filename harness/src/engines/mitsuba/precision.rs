//! How far Mitsuba's 32-bit floats may leave a direct illuminance from the exact value.

use super::export::Frame;
use super::settings::Settings;
use crate::engines::Job;
use crate::engines::cells::{Cells, LookUp};

/// Half the spacing of 32-bit floats at 1.
const EPSILON: f64 = 5.960_464_477_539_063e-8;
/// Roundings between a table and an illuminance: distance, square, cosine, interpolation, product.
const ROUNDINGS: f64 = 16.0;
/// So far outside a table's range our emitter takes a direction for its last angle (`EDGE_DEG` of `mitsuba_goniometric.py`).
const EDGE_DEG: f64 = 5e-5;

/// What rounding may do to light that comes straight from points.
pub(super) struct FloatError<'a> {
    job: &'a Job,
    frame: Frame,
    tables: Vec<Cells>,
}

impl<'a> FloatError<'a> {
    pub(super) fn of(job: &'a Job, settings: &Settings) -> Self {
        let tables = job.scene.luminaires.iter().map(|l| Cells::of(&l.photometry.distribution)).collect();
        Self { job, frame: Frame::of(job, settings.coordinates), tables }
    }

    /// Bound in lux at station `k`.
    pub(super) fn at_lx(&self, k: usize) -> f64 {
        (0..self.tables.len()).map(|luminaire| self.of_one_lx(luminaire, k)).sum()
    }

    fn of_one_lx(&self, luminaire: usize, k: usize) -> f64 {
        let (meter, table) = (self.job.stations[k].meter, &self.tables[luminaire]);
        let luminaire = &self.job.scene.luminaires[luminaire];
        let ray_m = meter.position_m - luminaire.position_m;
        let (at, lamp) = (self.frame.to_scene(meter.position_m), self.frame.to_scene(luminaire.position_m));
        // Both points are rounded before they are subtracted.
        let largest = at.abs().max(lamp.abs()).max_element();
        let angle_rad = ROUNDINGS * EPSILON + 4.0 * EPSILON * largest / at.distance(lamp);
        let cosine = -ray_m.normalize_or_zero().dot(meter.normal);
        if cosine < -angle_rad {
            return 0.0;
        }
        let own = luminaire.orientation.transpose() * ray_m;
        // Near a pole a direction turns by far in C.
        let from_axis = (own.x.hypot(own.y) / own.length()).max(angle_rad);
        let look_up = LookUp {
            gamma_deg: angle_rad.to_degrees(),
            c_deg: (2.0 * angle_rad / from_axis).to_degrees() + 360.0 * EPSILON,
            edge_deg: EDGE_DEG,
            relative: ROUNDINGS * EPSILON,
        };
        let error_cd = table.error_cd(own, look_up);
        let intensity_cd = luminaire.photometry.distribution.intensity_towards(own).value();
        let towards =
            error_cd * (cosine.max(0.0) + angle_rad) + intensity_cd * angle_rad * (1.0 + 2.0 * cosine.max(0.0));
        luminaire.flux_scale * towards / ray_m.length_squared()
    }
}
