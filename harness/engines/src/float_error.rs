//! How far a renderer's 32-bit floats may leave direct illuminance from the exact value.

use glam::DVec3;
use luxproof_scene::Luminaire;

use super::Job;
use super::cells::{Cells, LookUp};
use super::frame::Frame;
use super::openings::places_m;

/// Half the spacing of 32-bit floats at 1.
pub(super) const EPSILON: f64 = 5.960_464_477_539_063e-8;
/// Roundings between a table and an illuminance: distance, square, cosine, interpolation, product.
const ROUNDINGS: f64 = 16.0;

/// How a renderer reads, beyond the rounding of its numbers.
#[derive(Clone, Debug, Default)]
pub(super) struct Instrument {
    /// So far outside a table's range a direction counts as its last angle.
    pub(super) edge_deg: f64,
    /// How far off each meter's point it reads, in scene units; none where it reads at the points.
    pub(super) offsets: Vec<f64>,
    /// Whether gamma is the arc cosine of a rounded number, which resolves little at the poles.
    pub(super) by_arc_cosine: bool,
}

/// What rounding may do to light that comes straight from points and openings.
pub(super) struct FloatError<'a> {
    job: &'a Job,
    frame: Frame,
    instrument: Instrument,
    tables: Vec<Cells>,
    /// Where the light of each luminaire comes from.
    places_m: Vec<Vec<DVec3>>,
}

impl<'a> FloatError<'a> {
    pub(super) fn of(job: &'a Job, frame: Frame, instrument: Instrument) -> Self {
        let tables = job.scene.luminaires.iter().map(|l| Cells::of(&l.photometry.distribution)).collect();
        let places_m = job.scene.luminaires.iter().map(places_m).collect();
        Self { job, frame, instrument, tables, places_m }
    }

    /// Bound in lux at sensor `k`.
    pub(super) fn at_lx(&self, k: usize) -> f64 {
        (0..self.tables.len()).map(|luminaire| self.of_one_lx(luminaire, k)).sum()
    }

    fn of_one_lx(&self, luminaire: usize, k: usize) -> f64 {
        let places = &self.places_m[luminaire];
        places.iter().map(|place| self.of_place_lx(luminaire, *place, k)).sum::<f64>() / places.len() as f64
    }

    /// All of a luminaire's light as from one place.
    fn of_place_lx(&self, luminaire: usize, place_m: DVec3, k: usize) -> f64 {
        let (meter, table) = (self.job.sensors[k].meter, &self.tables[luminaire]);
        let luminaire = &self.job.scene.luminaires[luminaire];
        let ray_m = meter.position_m - place_m;
        let angle_rad = self.angle_rad(place_m, k);
        let cosine = -ray_m.normalize_or_zero().dot(meter.normal);
        if cosine < -angle_rad {
            return 0.0;
        }
        let own = luminaire.orientation.transpose() * ray_m;
        let [c_deg, gamma_deg] = self.of_angles_deg(own, angle_rad);
        let look_up = LookUp { gamma_deg, c_deg, edge_deg: self.instrument.edge_deg, relative: ROUNDINGS * EPSILON };
        let error_cd = table.error_cd(own, look_up);
        let intensity_cd = luminaire.photometry.distribution.intensity_towards(own).value();
        let towards =
            error_cd * (cosine.max(0.0) + angle_rad) + intensity_cd * angle_rad * (1.0 + 2.0 * cosine.max(0.0));
        luminaire.flux_scale * towards / ray_m.length_squared()
    }

    /// How far the direction from a place of a luminaire to sensor `k` may be off in C and gamma, in degrees.
    pub(super) fn spread_deg(&self, luminaire: &Luminaire, place_m: DVec3, k: usize) -> [f64; 2] {
        let ray_m = self.job.sensors[k].meter.position_m - place_m;
        self.of_angles_deg(luminaire.orientation.transpose() * ray_m, self.angle_rad(place_m, k))
    }

    /// By how much a direction may be turned.
    fn angle_rad(&self, place_m: DVec3, k: usize) -> f64 {
        let (at, lamp) = (self.frame.to_scene(self.job.sensors[k].meter.position_m), self.frame.to_scene(place_m));
        let offset = self.instrument.offsets.get(k).copied().unwrap_or_default();
        // Both points are rounded before they are subtracted.
        let largest = at.abs().max(lamp.abs()).max_element();
        ROUNDINGS * EPSILON + (4.0 * EPSILON * largest + offset) / at.distance(lamp)
    }

    fn of_angles_deg(&self, own: DVec3, angle_rad: f64) -> [f64; 2] {
        // Near a pole a direction turns by far in C.
        let from_axis = (own.x.hypot(own.y) / own.length()).max(angle_rad);
        let c = (2.0 * angle_rad / from_axis).to_degrees() + 360.0 * EPSILON;
        [c, (angle_rad + self.of_arc_cosine_rad(own)).to_degrees()]
    }

    fn of_arc_cosine_rad(&self, own: DVec3) -> f64 {
        if !self.instrument.by_arc_cosine {
            return 0.0;
        }
        let (off, sine) = (4.0 * EPSILON, own.x.hypot(own.y) / own.length());
        (off / sine.max(f64::MIN_POSITIVE)).min((2.0 * off).sqrt())
    }
}
