//! How far POV-Ray's direct light at a meter may be off: what its floats make of tables, colours and places, and what the point lights
//! that stand for an opening leave of it.

use std::rc::Rc;

use glam::DVec3;
use luminaire::geometry::Mesh;
use luminaire::geometry::bvh::{BvhError, Ray, TriangleBvh};
use luminaire::scene::{Luminaire, Meter, Shape, Transport};

use super::frame::{self, Frame};
use super::opening::{self, Part};
use super::pigment;
use super::{ID, Ways, distance_to_segment};
use crate::engines::cells::{Cells, LookUp};
use crate::engines::{EngineError, Job};

/// Half the spacing of 32-bit floats at 1: POV-Ray keeps colours and the knots of its maps so (`COLC` and `SNGL` of frame.h).
const EPSILON: f64 = 5.960_464_477_539_063e-8;
/// Knots are angles over 360 and 720 degrees, up to .5, where floats are half as dense as at .25; a value is rounded once as an entry, and
/// thrice in each of two maps.
const LOOK_UP: LookUp = LookUp {
    gamma_deg: 360.0 * 0.25 * EPSILON,
    c_deg: 720.0 * 0.25 * EPSILON,
    edge_deg: pigment::EDGE_DEG,
    relative: 7.0 * EPSILON,
};
/// Roundings of a light's colour on its way to the pixel, besides one for each light that is added.
const ROUNDINGS: f64 = 8.0;
/// How many times as fine the rules are along a side that tell what an opening's point lights leave out, and how many lights these differ by.
const FINER: usize = 5;
const APART: usize = 1;
/// What a rule errs by over its difference from a finer one, where errors fall as its points along a side grow, as at a shadow's edge.
const RICHARDSON: f64 = FINER as f64 / (FINER - 1) as f64;
/// How much wider than a filter what passes it is taken to be.
const FILTER_MARGIN: f64 = 0.05;
/// Point lights along each side of an opening, few first.
const RUNGS: [usize; 4] = [6, 12, 24, opening::MOST_POINTS];
/// What they may leave out, in parts of the relative error that is asked for.
const LEFT_OUT: f64 = 0.25;
/// Seconds that are counted for one of them and a meter in all looks, on a usual server. More than the fewest two rungs take no more of
/// them than a budget has.
const LIGHT_S: f64 = 1e-4;

/// The light of a job's luminaires as exported and as they are.
pub(super) struct DirectError<'a> {
    frame: Frame,
    exported: Lights<'a>,
    /// By two finer rules, where the export is not exact.
    exact: Option<[Lights<'a>; 2]>,
    tables: Vec<Cells>,
}

/// Luminaires as points that nothing but bodies hides.
struct Lights<'a> {
    bodies: Rc<TriangleBvh>,
    luminaires: Vec<(&'a Luminaire, Vec<Part>)>,
}

/// How many point lights along each side of an opening give direct light as well as it is asked for.
pub(super) fn points(job: &Job) -> usize {
    let is_extended = |l: &Luminaire| opening::parts_of(l, 2).len() > 1;
    if matches!(job.transport, Transport::Indirect(_)) || !job.scene.luminaires.iter().any(is_extended) {
        return RUNGS[0];
    }
    let Ok(bodies) = bodies(job).map(Rc::new) else { return opening::MOST_POINTS };
    let enough = |points: &usize| {
        let [few, more, other] = [*points, FINER * points, FINER * points - APART].map(|n| Lights::of(job, &bodies, n));
        let left_out = |meter: &Meter| {
            let [few, more, other] = [&few, &more, &other].map(|lights| lights.illuminance_lx(meter));
            (RICHARDSON * (few - more).abs() + (more - other).abs(), more)
        };
        opening::too_near(job, *points).is_none()
            && job
                .stations
                .iter()
                .map(|s| left_out(&s.meter))
                .all(|(out, lx)| out <= LEFT_OUT * job.budget.relative_error * lx)
    };
    let lights = |points: usize| job.scene.luminaires.iter().map(|l| opening::parts_of(l, points).len()).sum::<usize>();
    let is_affordable = |points: &usize| LIGHT_S * (lights(*points) * job.stations.len()) as f64 <= job.budget.seconds;
    let (fewest, more) = RUNGS.split_at(2);
    let affordable = more.iter().take_while(|points| is_affordable(points));
    let rungs: Vec<usize> = fewest.iter().chain(affordable).copied().collect();
    rungs.iter().copied().find(enough).unwrap_or(rungs[rungs.len() - 1])
}

impl<'a> DirectError<'a> {
    /// `apart` is the job as it is exported, with so many points along each side of an opening.
    pub(super) fn of(job: &'a Job, apart: &'a Job, frame: Frame, points: usize) -> Result<Self, EngineError> {
        let failed = |e: BvhError| EngineError::output(ID, e.to_string());
        let exported = Lights::of(apart, &Rc::new(bodies(apart).map_err(failed)?), points);
        let is_exact = std::ptr::eq(job, apart) && exported.luminaires.iter().all(|(_, parts)| parts.len() == 1);
        let exact = if is_exact {
            None
        } else {
            let bodies = Rc::new(bodies(job).map_err(failed)?);
            Some([FINER * points, FINER * points - APART].map(|n| Lights::of(job, &bodies, n)))
        };
        let tables = exported.luminaires.iter().map(|(l, _)| Cells::of(&l.photometry.distribution)).collect();
        Ok(Self { frame, exported, exact, tables })
    }

    /// Bound in lux for a reading of a meter whose disc sits at a point of the scene.
    pub(super) fn at_lx(&self, meter: &Meter, seat: DVec3, reading_lx: f64) -> f64 {
        let seated = |shift: DVec3| Meter { position_m: self.frame.metres(seat + shift), ..*meter };
        let rendered = |shift: DVec3| self.exported.illuminance_lx(&seated(shift));
        let read = rendered(DVec3::ZERO);
        let exact = self.exact.as_ref().map(|lights| lights.each_ref().map(|l| l.illuminance_lx(meter)));
        let [one, other] = exact.unwrap_or_else(|| [self.exported.illuminance_lx(meter); 2]);
        let (aim, along) = (frame::aim(seat), meter.normal.any_orthonormal_vector());
        let aside =
            |axis: DVec3| [aim, -aim].map(|by| (rendered(by * axis) - read).abs()).into_iter().fold(0.0, f64::max);
        let lights: usize = self.exported.luminaires.iter().map(|(_, parts)| parts.len()).sum();
        RICHARDSON * (read - one).abs()
            + (one - other).abs()
            + aside(along)
            + aside(meter.normal.cross(along))
            + self.of_tables_lx(&seated(DVec3::ZERO))
            + self.of_filters_lx(&seated(DVec3::ZERO))
            + (ROUNDINGS + lights as f64) * EPSILON * reading_lx
    }

    fn of_tables_lx(&self, meter: &Meter) -> f64 {
        let luminaires = self.exported.luminaires.iter().zip(&self.tables);
        let of = |((luminaire, parts), table): (&(&Luminaire, Vec<Part>), &Cells)| {
            self.exported.sum_lx(luminaire, parts, meter, |own| table.error_cd(own, LOOK_UP))
        };
        luminaires.map(of).sum()
    }

    /// Light that passes through the filter round another light on its way, as in the plane of an opening, and may be lost there.
    fn of_filters_lx(&self, meter: &Meter) -> f64 {
        let radius_m = opening::FILTER_RADIUS * (1.0 + FILTER_MARGIN) / self.frame.scale;
        let of = |(luminaire, parts): &(&Luminaire, Vec<Part>)| {
            let filters_m: Vec<Vec<DVec3>> = self.exported.near(luminaire, meter, radius_m);
            if filters_m.is_empty() {
                return 0.0;
            }
            let places_m: Vec<DVec3> = parts.iter().map(|part| place_m(luminaire, part)).collect();
            let ways = Ways::of(&places_m, meter.position_m);
            let mut is_filtered = vec![false; parts.len()];
            for filter_m in filters_m.iter().flatten() {
                let others = ways.past(*filter_m, radius_m).filter(|k| places_m[*k] != *filter_m);
                others.for_each(|k| is_filtered[k] = true);
            }
            let filtered: Vec<Part> =
                parts.iter().zip(is_filtered).filter(|(_, is)| *is).map(|(part, _)| *part).collect();
            let table = &luminaire.photometry.distribution;
            self.exported.sum_lx(luminaire, &filtered, meter, |own| table.intensity_towards(own).value())
        };
        self.exported.luminaires.iter().map(of).sum()
    }
}

fn place_m(luminaire: &Luminaire, part: &Part) -> DVec3 {
    luminaire.position_m + luminaire.orientation * part.offset_m
}

impl<'a> Lights<'a> {
    /// The lights, luminaire by luminaire, that may stand between one and a meter: its own where the meter lies near its plane.
    fn near(&self, luminaire: &Luminaire, meter: &Meter, filter_m: f64) -> Vec<Vec<DVec3>> {
        let reach_m = |l: &Luminaire| 0.5 * DVec3::from(l.photometry.opening.bounding_box_m()).length() + filter_m;
        let may = |(other, parts): &&(&Luminaire, Vec<Part>)| {
            if !std::ptr::eq(*other, luminaire) {
                let cone_m = reach_m(other) + reach_m(luminaire);
                return distance_to_segment(other.position_m, meter.position_m, luminaire.position_m) < cone_m;
            }
            let ray_m = meter.position_m - luminaire.position_m;
            let sine = (luminaire.orientation.z_axis.dot(ray_m).abs() - filter_m).max(0.0)
                / (ray_m.length() + reach_m(luminaire));
            // Points of either rule lie no nearer to one another.
            let [y_m, x_m, _] = luminaire.photometry.opening.bounding_box_m();
            let nearest_m = x_m.min(y_m) / parts.len() as f64;
            parts.len() > 1 && sine * nearest_m < filter_m
        };
        let places = |(l, parts): &(&Luminaire, Vec<Part>)| parts.iter().map(|part| place_m(l, part)).collect();
        self.luminaires.iter().filter(may).map(places).collect()
    }

    fn of(job: &'a Job, bodies: &Rc<TriangleBvh>, points: usize) -> Self {
        let lit = job.scene.luminaires.iter().filter(|l| frame::candela(l) > 0.0);
        Self { bodies: Rc::clone(bodies), luminaires: lit.map(|l| (l, opening::parts_of(l, points))).collect() }
    }

    fn illuminance_lx(&self, meter: &Meter) -> f64 {
        let of = |(luminaire, parts): &(&Luminaire, Vec<Part>)| {
            let table = &luminaire.photometry.distribution;
            self.sum_lx(luminaire, parts, meter, |own| table.intensity_towards(own).value())
        };
        self.luminaires.iter().map(of).sum()
    }

    /// What of a luminaire's parts a meter sees, with the candela of the whole towards a direction of its own frame.
    fn sum_lx(&self, luminaire: &Luminaire, parts: &[Part], meter: &Meter, candela: impl Fn(DVec3) -> f64) -> f64 {
        let to_own = luminaire.orientation.transpose();
        let of = |part: &Part| {
            let ray_m = place_m(luminaire, part) - meter.position_m;
            let cosine = ray_m.normalize_or_zero().dot(meter.normal);
            if cosine <= 0.0 {
                return 0.0;
            }
            let candela = candela(to_own * -ray_m);
            let is_seen = candela > 0.0 && !self.hides(meter, ray_m);
            if is_seen { part.share * candela * cosine / ray_m.length_squared() } else { 0.0 }
        };
        luminaire.flux_scale * parts.iter().map(of).sum::<f64>()
    }

    /// Whether a body stands before the end of a ray; a meter may lie on one, and a light in its plate.
    fn hides(&self, meter: &Meter, ray_m: DVec3) -> bool {
        let origin_m = meter.position_m + CONTACT * ray_m.length() * meter.normal;
        !self.bodies.is_empty() && self.bodies.occluded(&Ray { origin_m, direction: ray_m }, 1.0 - 2.0 * CONTACT)
    }
}

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

/// Of a distance: nearer than this is contact.
const CONTACT: f64 = 1e-9;
