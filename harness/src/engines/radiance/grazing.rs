//! Light that grazes a flat source: rtrace leaves out each of its parts whose share of the source times the cosine of its emission is no
//! more than 1e-4 (`nextssamp` of `srcsamp.c`), and so the finer it divides the source, the more of what comes from near its plane.

use glam::DVec3;
use luminaire::photometry::{HorizontalAxis, LuminousOpening, angles_deg};
use luminaire::scene::{Luminaire, LuminaireModel, Meter};

use super::route::{Route, route};
use super::settings::Settings;
use crate::engines::Job;

/// What a part's cosine times its share must be.
const SEEN: f64 = 1e-4;
/// Parts of a source at most (`MAXSPART`).
const MOST_PARTS: f64 = 64.0;
/// The nearest that a meter is taken to be, in radii of a luminaire's opening.
const CLOSEST: f64 = 0.1;
/// Ratios of a part's size to its distance (`-ds`), the finest first; 0: a source is one part.
pub(super) const RATIOS: [f64; 6] = [0.02, 0.04, 0.08, 0.16, 0.32, 0.0];

/// The finest division of the sources that leaves out nothing at a meter but what any division does.
pub(super) fn ratio(job: &Job, settings: &Settings, meter: &Meter) -> f64 {
    let is_opening = |l: &&Luminaire| route(l, settings) == Route::Opening;
    let is_seen = |ratio: f64| {
        let mut openings = job.scene.luminaires.iter().filter(is_opening);
        openings.all(|l| is_whole(l, meter, ratio) || !is_whole(l, meter, 0.0))
    };
    RATIOS.into_iter().find(|ratio| is_seen(*ratio)).unwrap_or(0.0)
}

/// The same for all of a job's meters: the coarsest of theirs.
pub(super) fn ratio_of_all(job: &Job, settings: &Settings) -> f64 {
    let coarseness = |ratio: &f64| RATIOS.iter().position(|r| r == ratio);
    let all = job.stations.iter().map(|s| ratio(job, settings, &s.meter));
    all.max_by_key(coarseness).unwrap_or(RATIOS[0])
}

/// What direct light at a meter lacks at most, in lux: all of that of luminaires in whose planes it nearly lies.
pub(super) fn lost_lx(job: &Job, meter: &Meter, ratio: f64) -> f64 {
    let grazing = |l: &&Luminaire| l.model == LuminaireModel::Area && !is_whole(l, meter, ratio);
    job.scene.luminaires.iter().filter(grazing).map(|l| largest_lx(l, meter)).sum()
}

/// What a luminaire gives at a meter in its plane, were all of it at its nearest.
fn largest_lx(luminaire: &Luminaire, meter: &Meter) -> f64 {
    let ray = meter.position_m - luminaire.position_m;
    let (c, gamma) = angles_deg(luminaire.orientation.transpose() * ray);
    let candela =
        luminaire.flux_scale * luminaire.photometry.distribution.intensity(c, gamma.clamp(0.0, 180.0)).value();
    let radius = radius_m(luminaire);
    let nearest = (ray.length() - radius).max(CLOSEST * radius);
    candela * (-ray.normalize_or_zero().dot(meter.normal)).max(0.0) / (nearest * nearest)
}

fn radius_m(luminaire: &Luminaire) -> f64 {
    0.5 * DVec3::from(luminaire.photometry.opening.bounding_box_m()).length()
}

/// Whether no part of a luminaire's faces that a meter sees from in front is left out at this division.
fn is_whole(luminaire: &Luminaire, meter: &Meter, ratio: f64) -> bool {
    let opening = luminaire.photometry.opening;
    let [y_m, x_m, z_m] = opening.bounding_box_m();
    let size = [x_m, y_m, z_m];
    let from = luminaire.orientation.transpose() * (meter.position_m - luminaire.position_m);
    let radius = radius_m(luminaire);
    let (nearest, farthest) = ((from.length() - radius).max(0.0), from.length() + radius);
    let axes = match opening {
        LuminousOpening::Box { height_m, .. } if height_m > 0.0 => 0..3,
        LuminousOpening::Box { .. } | LuminousOpening::Ellipse { .. } => 2..3,
        LuminousOpening::LyingCylinder { axis: HorizontalAxis::X, .. } => 0..1,
        LuminousOpening::LyingCylinder { axis: HorizontalAxis::Y, .. } => 1..2,
        LuminousOpening::Point | LuminousOpening::Ellipsoid { .. } => 0..0,
    };
    axes.into_iter().all(|axis| {
        let above = from[axis].abs() - 0.5 * size[axis];
        let parts: f64 = (0..3).filter(|k| *k != axis).map(|k| halvings(size[k], ratio, nearest)).sum::<f64>().exp2();
        // A face that is seen from behind gives nothing.
        above <= 0.0 && size[axis] > 0.0 || above / farthest > 2.0 * SEEN * parts.min(MOST_PARTS)
    })
}

/// How often an edge is halved at this division.
fn halvings(edge_m: f64, ratio: f64, distance_m: f64) -> f64 {
    if ratio > 0.0 { (edge_m / (ratio * distance_m)).log2().ceil().clamp(0.0, MOST_PARTS.log2()) } else { 0.0 }
}
