//! What sampling costs, by rule: no clock, and so no load of the machine, says how much is sampled.
//!
//! Engines count seconds at a fixed rate each, measured with two cores of a usual server. A budget's seconds are meant so; by the
//! clock a job takes what the machine makes of them.

use luxproof_scene::geometry::{Room, Surface};
use luxproof_scene::{Bounces, LuminaireModel};

use super::Job;

/// Of the last of the light's reflections little is left after so many, whatever the reflectance.
const LONGEST: f64 = 100.0;
/// Triangles of an empty room.
const ROOM: f64 = 12.0;

/// Reflections that a path is followed for, in the mean and at most.
pub(super) fn path_length(job: &Job) -> f64 {
    let all = (1.0 - job.scene.largest_reflectance()).recip().min(LONGEST);
    match job.reflections() {
        None => 0.0,
        Some(Bounces::AtMost(n)) => all.min(f64::from(n)),
        Some(Bounces::Converged) => all,
    }
}

/// Of all surfaces of a room, by their areas.
pub(super) fn mean_reflectance(room: &Room) -> f64 {
    by_area(room, |s| room.reflectance.of(s))
}

/// How much of a room's surfaces is not black, by area.
pub(super) fn reflecting_share(room: &Room) -> f64 {
    by_area(room, |s| if room.reflectance.of(s) > 0.0 { 1.0 } else { 0.0 })
}

fn by_area(room: &Room, of: impl Fn(Surface) -> f64) -> f64 {
    Surface::ALL.iter().map(|&s| room.area_m2(s) * of(s)).sum::<f64>() / room.whole_area_m2()
}

/// What a ray takes against one in an empty room: as many more steps as the tree of triangles is deeper.
pub(super) fn a_ray(job: &Job) -> f64 {
    let all: usize = job.scene.obstacles.iter().map(|o| o.shape.triangles()).sum();
    (ROOM + all as f64).log2() / ROOM.log2()
}

/// Shadow rays to all luminaires, so many of them to an opening.
pub(super) fn shadow_rays(job: &Job, to_an_opening: f64) -> f64 {
    let luminaires = job.scene.luminaires.iter();
    luminaires.map(|l| if l.model == LuminaireModel::Point { 1.0 } else { to_an_opening }).sum()
}

/// Reflections after which at most `share` of the light is left where every surface reflects `reflectance`.
pub(super) fn reflections_until(reflectance: f64, share: f64) -> i64 {
    const MAX: f64 = 1e5;
    (share.max(1e-9).ln() / reflectance.ln()).clamp(1.0, MAX).ceil() as i64
}
