//! Light that leaves a flat source near its plane. rtrace omits each part of a source if the part's share times the cosine of emission is
//! at most 1e-4 (`nextssamp` of `srcsamp.c`). So a finer division omits more light near the source's plane.

use glam::DVec3;
use luxproof_photometry::{HorizontalAxis, LuminousOpening, angles_deg};
use luxproof_scene::{Luminaire, LuminaireModel, Meter};

use super::route::{Route, route};
use super::settings::Settings;
use crate::Job;

/// The smallest product of a part's cosine and its share that rtrace does not omit.
const MIN_SHARE_COSINE: f64 = 1e-4;
/// The most parts of a source (`MAXSPART`).
const MOST_PARTS: f64 = 64.0;
/// The least distance of a meter that bounds use, in radii of a luminaire's opening.
const CLOSEST: f64 = 0.1;
/// Ratios of a part's size to its distance (`-ds`), the finest first. With 0 a source is one part.
pub(super) const RATIOS: [f64; 6] = [0.02, 0.04, 0.08, 0.16, 0.32, 0.0];

/// Returns the finest division of sources that omits only what every division omits at a meter.
pub(super) fn ratio(job: &Job, settings: &Settings, meter: &Meter) -> f64 {
    RATIOS.into_iter().find(|ratio| omits_no_more(job, settings, meter, *ratio)).unwrap_or(0.0)
}

/// Returns whether a division omits only openings that undivided sources omit, too.
fn omits_no_more(job: &Job, settings: &Settings, meter: &Meter, ratio: f64) -> bool {
    let mut openings = job.scene.luminaires.iter().filter(|l| route(l, settings) == Route::Opening);
    openings.all(|l| is_whole(l, meter, ratio) || !is_whole(l, meter, 0.0))
}

/// Returns the coarsest of the divisions of all of a job's meters.
pub(super) fn ratio_of_all(job: &Job, settings: &Settings) -> f64 {
    let ratios = job.sensors.iter().map(|s| ratio(job, settings, &s.meter));
    ratios.max_by_key(|ratio| RATIOS.iter().position(|r| r == ratio)).unwrap_or(RATIOS[0])
}

/// Returns the most direct light in lux that a meter may lack: all light of luminaires with a plane near the meter.
pub(super) fn lost_lx(job: &Job, meter: &Meter, ratio: f64) -> f64 {
    let luminaires = job.scene.luminaires.iter();
    let grazing = luminaires.filter(|l| l.model == LuminaireModel::Area && !is_whole(l, meter, ratio));
    grazing.map(|l| largest_lx(l, meter)).sum()
}

/// Returns the illuminance of a meter in a luminaire's plane if all light came from the luminaire's nearest point.
fn largest_lx(luminaire: &Luminaire, meter: &Meter) -> f64 {
    let ray = meter.position_m - luminaire.position_m;
    let (c, gamma) = angles_deg(luminaire.orientation.transpose() * ray);
    let candela =
        luminaire.flux_scale * luminaire.photometry.distribution.intensity(c, gamma.clamp(0.0, 180.0)).value();
    let radius = radius_m(luminaire);
    let nearest = (ray.length() - radius).max(CLOSEST * radius);
    candela * (-ray.normalize_or_zero().dot(meter.normal)).max(0.0) / (nearest * nearest)
}

/// Returns the radius of the sphere about a luminaire's opening.
fn radius_m(luminaire: &Luminaire) -> f64 {
    0.5 * DVec3::from(luminaire.photometry.opening.bounding_box_m()).length()
}

/// Returns whether this division omits no part of those faces of a luminaire that a meter sees from the front.
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
        // A face that is seen from behind gives no light.
        above <= 0.0 && size[axis] > 0.0 || above / farthest > 2.0 * MIN_SHARE_COSINE * parts.min(MOST_PARTS)
    })
}

/// Returns how many times this division halves an edge.
fn halvings(edge_m: f64, ratio: f64, distance_m: f64) -> f64 {
    if ratio > 0.0 { (edge_m / (ratio * distance_m)).log2().ceil().clamp(0.0, MOST_PARTS.log2()) } else { 0.0 }
}
