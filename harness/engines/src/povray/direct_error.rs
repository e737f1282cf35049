//! Error bounds of POV-Ray's direct light at a meter. They cover the rounding of tables, colours and positions, and the point lights
//! that replace an opening.

use std::rc::Rc;

use glam::DVec3;
use luxproof_scene::geometry::Mesh;
use luxproof_scene::geometry::bvh::{BvhError, Ray, TriangleBvh};
use luxproof_scene::{Luminaire, Meter, Shape, Transport};

use super::frame::{self, Frame};
use super::opening::{self, Part};
use super::pigment;
use super::{ID, Ways, distance_to_segment};
use crate::cells::{Cells, LookUp};
use crate::{EngineError, Job};

/// Half the spacing of 32-bit floats at 1. POV-Ray stores colours and the knots of its maps in them (`COLC` and `SNGL` of frame.h).
const EPSILON: f64 = 5.960_464_477_539_063e-8;
/// Rounding of a table's look-up. Knots are angles over 360 and 720 degrees, up to 0.5, where floats are half as dense as at 0.25.
/// POV-Ray rounds a value once as an entry and three times in each of two maps.
const LOOK_UP: LookUp = LookUp {
    gamma_deg: 360.0 * 0.25 * EPSILON,
    c_deg: 720.0 * 0.25 * EPSILON,
    edge_deg: pigment::EDGE_DEG,
    relative: 7.0 * EPSILON,
};
/// Roundings of a light's colour on its way to the pixel, without one for each light that is added.
const ROUNDINGS: f64 = 8.0;
/// Factor of refinement of the finer rule that measures what the point lights of an opening omit.
const FINER: usize = 5;
/// The second finer rule has this many points fewer along a side.
const FINER_STEP: usize = 1;
/// A rule's error over its difference from a finer one. Errors fall with the number of points along a side, as at a shadow's edge.
const RICHARDSON: f64 = FINER as f64 / (FINER - 1) as f64;
/// Relative margin by which a filter is taken to be wider than it is.
const FILTER_MARGIN: f64 = 0.05;
/// Candidate numbers of point lights along each side of an opening, in ascending order.
const POINT_COUNTS: [usize; 4] = [6, 12, 24, opening::MOST_POINTS];
/// The part of the requested relative error that the omitted light may take.
const MAX_OMITTED_SHARE: f64 = 0.25;
/// Counted seconds of one light at one meter over all stages, on a usual server. Only the two smallest counts may exceed the budget.
const LIGHT_S: f64 = 1e-4;

/// The light of a job's luminaires, as exported and as specified.
pub(super) struct DirectError<'a> {
    frame: Frame,
    exported: Lights<'a>,
    /// The light by two finer rules; `None` if the export is exact.
    exact: Option<[Lights<'a>; 2]>,
    tables: Vec<Cells>,
}

/// Luminaires as point lights that only bodies can hide.
struct Lights<'a> {
    bodies: Rc<TriangleBvh>,
    luminaires: Vec<(&'a Luminaire, Vec<Part>)>,
}

/// Returns how many point lights along each side of an opening give direct light as accurately as requested.
pub(super) fn points(job: &Job) -> usize {
    let has_extended = job.scene.luminaires.iter().any(|l| opening::parts_of(l, 2).len() > 1);
    if matches!(job.transport, Transport::Indirect(_)) || !has_extended {
        return POINT_COUNTS[0];
    }
    let Ok(bodies) = bodies(job).map(Rc::new) else { return opening::MOST_POINTS };
    let (smallest, larger) = POINT_COUNTS.split_at(2);
    let affordable = larger.iter().take_while(|points| is_affordable(job, **points));
    let counts: Vec<usize> = smallest.iter().chain(affordable).copied().collect();
    let sufficient = counts.iter().copied().find(|points| is_sufficient(job, &bodies, *points));
    sufficient.unwrap_or(counts[counts.len() - 1])
}

/// Returns whether the counted seconds of this many points along a side are within the budget.
fn is_affordable(job: &Job, points: usize) -> bool {
    let lights = job.scene.luminaires.iter().map(|l| opening::parts_of(l, points).len()).sum::<usize>();
    LIGHT_S * (lights * job.sensors.len()) as f64 <= job.budget.seconds
}

/// Returns whether this many points along a side omit little enough light at every meter.
fn is_sufficient(job: &Job, bodies: &Rc<TriangleBvh>, points: usize) -> bool {
    // The two finer rules differ by one point, so that a regular scene does not hide an error from both.
    let rules = [points, FINER * points, FINER * points - FINER_STEP].map(|n| Lights::of(job, bodies, n));
    opening::too_near(job, points).is_none()
        && job.sensors.iter().all(|sensor| {
            let [coarse, fine, other] = rules.each_ref().map(|lights| lights.illuminance_lx(&sensor.meter));
            let omitted_lx = RICHARDSON * (coarse - fine).abs() + (fine - other).abs();
            omitted_lx <= MAX_OMITTED_SHARE * job.budget.relative_error * fine
        })
}

impl<'a> DirectError<'a> {
    /// Prepares the bound. `exported_job` is the job as exported, with this many points along each side of an opening.
    pub(super) fn of(job: &'a Job, exported_job: &'a Job, frame: Frame, points: usize) -> Result<Self, EngineError> {
        let exported_bodies = bodies(exported_job).map_err(|e| bvh_failure(&e))?;
        let exported = Lights::of(exported_job, &Rc::new(exported_bodies), points);
        let is_exact = std::ptr::eq(job, exported_job) && exported.luminaires.iter().all(|(_, parts)| parts.len() == 1);
        let exact = if is_exact {
            None
        } else {
            let bodies = Rc::new(bodies(job).map_err(|e| bvh_failure(&e))?);
            Some([FINER * points, FINER * points - FINER_STEP].map(|n| Lights::of(job, &bodies, n)))
        };
        let tables = exported.luminaires.iter().map(|(l, _)| Cells::of(&l.photometry.distribution)).collect();
        Ok(Self { frame, exported, exact, tables })
    }

    /// Returns the bound in lux of a meter's reading. `disc` is the meter's disc in the coordinates of the scene.
    pub(super) fn at_lx(&self, meter: &Meter, disc: DVec3, reading_lx: f64) -> f64 {
        let at_disc = self.meter_at(meter, disc);
        let read = self.exported.illuminance_lx(&at_disc);
        let exact = self.exact.as_ref().map(|lights| lights.each_ref().map(|l| l.illuminance_lx(meter)));
        let [one, other] = exact.unwrap_or_else(|| [self.exported.illuminance_lx(meter); 2]);
        let along = meter.normal.any_orthonormal_vector();
        let lights: usize = self.exported.luminaires.iter().map(|(_, parts)| parts.len()).sum();
        RICHARDSON * (read - one).abs()
            + (one - other).abs()
            + self.aim_error_lx(meter, disc, along, read)
            + self.aim_error_lx(meter, disc, meter.normal.cross(along), read)
            + self.table_error_lx(&at_disc)
            + self.filter_loss_lx(&at_disc)
            + (ROUNDINGS + lights as f64) * EPSILON * reading_lx
    }

    /// Returns the meter at a point of the exported scene.
    fn meter_at(&self, meter: &Meter, point: DVec3) -> Meter {
        Meter { position_m: self.frame.metres(point), ..*meter }
    }

    /// Returns how much a reading changes at most if the camera's ray misses the disc's centre along an axis.
    fn aim_error_lx(&self, meter: &Meter, disc: DVec3, axis: DVec3, read_lx: f64) -> f64 {
        let aim = frame::aim(disc);
        [aim, -aim]
            .map(|by| (self.exported.illuminance_lx(&self.meter_at(meter, disc + by * axis)) - read_lx).abs())
            .into_iter()
            .fold(0.0, f64::max)
    }

    /// Returns the error that rounding of tables makes at a meter.
    fn table_error_lx(&self, meter: &Meter) -> f64 {
        let luminaires = self.exported.luminaires.iter().zip(&self.tables);
        luminaires
            .map(|((luminaire, parts), table)| {
                self.exported.sum_lx(luminaire, parts, meter, |direction| table.error_cd(direction, LOOK_UP))
            })
            .sum()
    }

    /// Returns the light that passes through the filter of another light on its way, as in the plane of an opening. Filters may
    /// absorb it.
    fn filter_loss_lx(&self, meter: &Meter) -> f64 {
        let radius_m = opening::FILTER_RADIUS * (1.0 + FILTER_MARGIN) / self.frame.scale;
        let luminaires = self.exported.luminaires.iter();
        luminaires.map(|(luminaire, parts)| self.filtered_lx(luminaire, parts, meter, radius_m)).sum()
    }

    /// Returns the light of one luminaire that passes through filters of this radius on its way to a meter.
    fn filtered_lx(&self, luminaire: &Luminaire, parts: &[Part], meter: &Meter, radius_m: f64) -> f64 {
        let filters_m: Vec<Vec<DVec3>> = self.exported.near(luminaire, meter, radius_m);
        if filters_m.is_empty() {
            return 0.0;
        }
        let places_m: Vec<DVec3> = parts.iter().map(|part| place_m(luminaire, part)).collect();
        let ways = Ways::of(&places_m, meter.position_m);
        let mut is_filtered = vec![false; parts.len()];
        for filter_m in filters_m.iter().flatten() {
            for k in ways.past(*filter_m, radius_m).filter(|k| places_m[*k] != *filter_m) {
                is_filtered[k] = true;
            }
        }
        let filtered: Vec<Part> = parts.iter().zip(is_filtered).filter(|(_, is)| *is).map(|(part, _)| *part).collect();
        let table = &luminaire.photometry.distribution;
        self.exported.sum_lx(luminaire, &filtered, meter, |direction| table.intensity_towards(direction).value())
    }
}

/// Converts a failure to build the tree of bodies.
fn bvh_failure(error: &BvhError) -> EngineError {
    EngineError::output(ID, error.to_string())
}

/// Returns the position of a luminaire's part in the room.
fn place_m(luminaire: &Luminaire, part: &Part) -> DVec3 {
    luminaire.position_m + luminaire.orientation * part.offset_m
}

impl<'a> Lights<'a> {
    /// Returns by luminaire the lights that may stand between a luminaire and a meter. Its own lights may if the meter lies near
    /// their plane.
    fn near(&self, luminaire: &Luminaire, meter: &Meter, filter_m: f64) -> Vec<Vec<DVec3>> {
        self.luminaires
            .iter()
            .filter(|(other, parts)| may_filter(other, parts.len(), luminaire, meter, filter_m))
            .map(|(other, parts)| parts.iter().map(|part| place_m(other, part)).collect())
            .collect()
    }

    fn of(job: &'a Job, bodies: &Rc<TriangleBvh>, points: usize) -> Self {
        let lit = job.scene.luminaires.iter().filter(|l| frame::candela(l) > 0.0);
        Self { bodies: Rc::clone(bodies), luminaires: lit.map(|l| (l, opening::parts_of(l, points))).collect() }
    }

    fn illuminance_lx(&self, meter: &Meter) -> f64 {
        let luminaires = self.luminaires.iter();
        luminaires
            .map(|(luminaire, parts)| {
                let table = &luminaire.photometry.distribution;
                self.sum_lx(luminaire, parts, meter, |direction| table.intensity_towards(direction).value())
            })
            .sum()
    }

    /// Returns the illuminance by those parts of a luminaire that a meter sees. `candela` gives the intensity of the whole
    /// luminaire towards a direction in its frame.
    fn sum_lx(&self, luminaire: &Luminaire, parts: &[Part], meter: &Meter, candela: impl Fn(DVec3) -> f64) -> f64 {
        let to_local = luminaire.orientation.transpose();
        let mut sum_lx = 0.0;
        for part in parts {
            let ray_m = place_m(luminaire, part) - meter.position_m;
            let cosine = ray_m.normalize_or_zero().dot(meter.normal);
            if cosine <= 0.0 {
                continue;
            }
            let candela = candela(to_local * -ray_m);
            if candela > 0.0 && !self.hides(meter, ray_m) {
                sum_lx += part.share * candela * cosine / ray_m.length_squared();
            }
        }
        luminaire.flux_scale * sum_lx
    }

    /// Returns whether a body hides the end of a ray from a meter. A meter may lie on a body, and a light in its plate.
    fn hides(&self, meter: &Meter, ray_m: DVec3) -> bool {
        let origin_m = meter.position_m + CONTACT * ray_m.length() * meter.normal;
        !self.bodies.is_empty() && self.bodies.occluded(&Ray { origin_m, direction: ray_m }, 1.0 - 2.0 * CONTACT)
    }
}

/// Returns whether lights of `other` may stand between a luminaire and a meter, so that their filters may absorb light.
fn may_filter(other: &Luminaire, other_parts: usize, luminaire: &Luminaire, meter: &Meter, filter_m: f64) -> bool {
    let reach_m = filter_reach_m(luminaire, filter_m);
    if !std::ptr::eq(other, luminaire) {
        let cone_m = filter_reach_m(other, filter_m) + reach_m;
        return distance_to_segment(other.position_m, meter.position_m, luminaire.position_m) < cone_m;
    }
    let ray_m = meter.position_m - luminaire.position_m;
    let sine = (luminaire.orientation.z_axis.dot(ray_m).abs() - filter_m).max(0.0) / (ray_m.length() + reach_m);
    // This is a lower bound of the distance between points of either rule.
    let [y_m, x_m, _] = luminaire.photometry.opening.bounding_box_m();
    let nearest_m = x_m.min(y_m) / other_parts as f64;
    other_parts > 1 && sine * nearest_m < filter_m
}

/// Returns the radius about a luminaire's position that holds all its lights with their filters.
fn filter_reach_m(luminaire: &Luminaire, filter_m: f64) -> f64 {
    0.5 * DVec3::from(luminaire.photometry.opening.bounding_box_m()).length() + filter_m
}

/// Builds the tree of all bodies of a job.
fn bodies(job: &Job) -> Result<TriangleBvh, BvhError> {
    let (mut vertices_m, mut triangles) = (vec![], vec![]);
    for obstacle in &job.scene.obstacles {
        let body = match &obstacle.shape {
            Shape::Box { min_m, max_m } => Mesh::cuboid(*min_m, *max_m),
            Shape::Mesh { vertices_m, triangles } => {
                Mesh { vertices_m: vertices_m.clone(), triangles: triangles.clone() }
            }
        };
        let first = vertices_m.len() as u32;
        vertices_m.extend(body.vertices_m);
        triangles.extend(body.triangles.iter().map(|face| face.map(|v| first + v)));
    }
    TriangleBvh::new(&vertices_m, &triangles)
}

/// Relative distance below which a ray touches its own start or end instead of hitting a body.
const CONTACT: f64 = 1e-9;
