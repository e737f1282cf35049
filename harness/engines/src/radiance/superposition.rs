//! Which luminaires are read together. A shadow ray towards one illum ends on the front of another (`wrongsource` of rtrace's `source.c`), while in
//! photometry openings hide nothing; of two points in one spot, whose spheres are one surface, it reads one. Light superposes: luminaires that hide
//! one another are scenes of their own, whose readings add up.

use glam::DVec3;
use luxproof_scene::{Luminaire, Transport};

use super::route::{Route, route};
use super::settings::Settings;
use crate::{Job, recess};

/// Luminaires by their places in the job: scene by scene those that hide no other of it from where light is received.
pub(super) fn scenes(job: &Job, settings: &Settings) -> Vec<Vec<usize>> {
    let job = &*recess::separate(job);
    let all: Vec<Source<'_>> = job.scene.luminaires.iter().map(|l| Source::of(l, settings)).collect();
    let apart =
        |a: usize, b: usize| all[a].is_one_with(&all[b]) || all[a].hides(&all[b], job) || all[b].hides(&all[a], job);
    let mut scenes = vec![vec![]];
    for k in 0..all.len() {
        match scenes.iter_mut().find(|scene| scene.iter().all(|other| !apart(k, *other))) {
            Some(scene) => scene.push(k),
            None => scenes.push(vec![k]),
        }
    }
    scenes
}

/// What reaches less far behind a flat opening, in parts of its size, lies in its plane.
const IN_PLANE: f64 = 1e-6;

/// Points that come closer are one surface to rtrace: their spheres are two millionths in radius at least.
const ONE_SPOT_M: f64 = 1e-5;

/// A luminaire as a body that shadow rays may meet.
struct Source<'a> {
    luminaire: &'a Luminaire,
    route: Route,
    radius_m: f64,
    /// In which directions along its own z axis it stops rays that look at its plane from the other side.
    stops: Vec<f64>,
    is_flat: bool,
}

impl<'a> Source<'a> {
    fn of(luminaire: &'a Luminaire, settings: &Settings) -> Self {
        let (opening, route) = (luminaire.photometry.opening, route(luminaire, settings));
        let extent = DVec3::from(opening.bounding_box_m());
        let height_m = if route == Route::Ies2radIllum { settings.impostor_height_m.max(extent.z) } else { extent.z };
        let table = &luminaire.photometry.distribution;
        let is_lit = |from, to| table.flux_between(from, to).value() > 0.0;
        let stops = match route {
            Route::Point => vec![],
            // The front of its lower face stops what is above it, that of its upper face what is below.
            Route::Opening if height_m == 0.0 => {
                [(is_lit(0.0, 90.0), 1.0), (is_lit(90.0, 180.0), -1.0)].iter().filter(|f| f.0).map(|f| f.1).collect()
            }
            Route::Opening | Route::Ies2radIllum | Route::Ies2radLight => vec![1.0, -1.0],
        };
        Self { luminaire, route, radius_m: 0.5 * extent.with_z(height_m).length(), stops, is_flat: height_m == 0.0 }
    }

    /// Half the angle that it takes of what is seen along a vector to it.
    fn half_angle(&self, to: DVec3) -> f64 {
        (self.radius_m / to.length()).min(1.0).asin()
    }

    /// Whether both are points in one spot.
    fn is_one_with(&self, other: &Self) -> bool {
        let distance_m = self.luminaire.position_m.distance(other.luminaire.position_m);
        (self.route, other.route) == (Route::Point, Route::Point) && distance_m < ONE_SPOT_M
    }

    /// Whether it may stand in another's light towards a meter, or, where light is reflected, towards any point.
    fn hides(&self, other: &Self, job: &Job) -> bool {
        // An illum is passed by rays towards light, a light by none.
        let is_passed = matches!(self.route, Route::Opening | Route::Ies2radIllum)
            && matches!(other.route, Route::Point | Route::Ies2radLight);
        let may = !is_passed && self.stops.iter().any(|side| self.is_behind(other, *side));
        may && (job.transport != Transport::Direct
            || job.sensors.iter().any(|s| self.hides_from(other, s.meter.position_m)))
    }

    /// Whether a part of another lies on one side of its plane, 1 above and -1 below.
    fn is_behind(&self, other: &Self, side: f64) -> bool {
        let axis = side * self.luminaire.orientation.z_axis;
        let reach_m = other.luminaire.photometry.opening.reach_m(other.luminaire.orientation.transpose() * axis);
        let height_m = axis.dot(other.luminaire.position_m - self.luminaire.position_m) + reach_m;
        !self.is_flat || height_m > IN_PLANE * self.radius_m
    }

    /// Whether it comes before another as seen from a point: the cones about both meet.
    fn hides_from(&self, other: &Self, point_m: DVec3) -> bool {
        let (to, to_other) = (self.luminaire.position_m - point_m, other.luminaire.position_m - point_m);
        let above = self.luminaire.orientation.z_axis.dot(to);
        let is_before =
            self.stops.iter().any(|side| !self.is_flat || side * above > 0.0 && self.is_behind(other, *side));
        let meet = to.length() <= self.radius_m
            || to_other.length() <= other.radius_m
            || to.angle_between(to_other) <= self.half_angle(to) + other.half_angle(to_other);
        is_before && meet && to.length() - self.radius_m < to_other.length() + other.radius_m
    }
}
