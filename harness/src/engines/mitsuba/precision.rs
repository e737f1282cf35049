//! How far Mitsuba's 32-bit floats may leave a direct illuminance from the exact value.

use glam::DVec3;
use luminaire::photometry::LuminousIntensityDistribution;
use luminaire::photometry::angles_deg;
use luminaire::scene::Luminaire;

use super::export::Frame;
use super::settings::Settings;
use crate::engines::Job;

/// Half the spacing of 32-bit floats at 1.
const EPSILON: f64 = 5.960_464_477_539_063e-8;
/// Roundings between a table and an illuminance: distance, square, cosine, interpolation, product.
const ROUNDINGS: f64 = 16.0;

/// Bound in lux at station `k`, for light that comes straight from points; steps at a table's edge excepted.
pub(super) fn float_error_lx(job: &Job, settings: &Settings, k: usize) -> f64 {
    let frame = Frame::of(job, settings.coordinates);
    let meter = job.stations[k].meter;
    let at = frame.to_scene(meter.position_m);
    job.scene.luminaires.iter().map(|l| luminaire_error_lx(l, &frame, at, meter.position_m)).sum()
}

fn luminaire_error_lx(luminaire: &Luminaire, frame: &Frame, meter: DVec3, meter_m: DVec3) -> f64 {
    let lamp = frame.to_scene(luminaire.position_m);
    let distance = meter.distance(lamp);
    let distance_m = distance / frame.scale;
    // Both points are rounded before they are subtracted.
    let angle_rad = ROUNDINGS * EPSILON + 2.0 * EPSILON * (meter.abs() + lamp.abs()).max_element() / distance;
    let intensity_cd = luminaire.intensity_towards(meter_m - luminaire.position_m).value();
    let own = luminaire.orientation.transpose() * (meter_m - luminaire.position_m);
    let gamma_deg = angles_deg(own).1;
    let slope = steepest_cd_per_rad(&luminaire.photometry.distribution, gamma_deg) * luminaire.flux_scale;
    (2.0 * angle_rad * intensity_cd + angle_rad * slope) / (distance_m * distance_m)
}

/// Far more than floats turn a direction by.
const NEIGHBOURHOOD_DEG: f64 = 0.01;

/// The largest change of intensity with direction near `gamma_deg`, poles left out where every plane meets.
fn steepest_cd_per_rad(distribution: &LuminousIntensityDistribution, gamma_deg: f64) -> f64 {
    let (c, all) = (distribution.c_deg(), distribution.gamma_deg());
    // The rows of the cells that the direction may fall into.
    let first = all.partition_point(|g| *g < gamma_deg - NEIGHBOURHOOD_DEG).saturating_sub(1);
    let last = all.partition_point(|g| *g <= gamma_deg + NEIGHBOURHOOD_DEG).min(all.len() - 1);
    let gamma = &all[first..=last];
    let mut steepest = 0.0_f64;
    for plane in 0..c.len() {
        let row = &distribution.plane(plane)[first..=last];
        for g in 0..gamma.len() - 1 {
            steepest = steepest.max(((row[g + 1] - row[g]) / (gamma[g + 1] - gamma[g]).to_radians()).abs());
        }
        if plane > 0 {
            let before = &distribution.plane(plane - 1)[first..=last];
            for (g, gamma_deg) in gamma.iter().enumerate() {
                let turn_rad = (c[plane] - c[plane - 1]).to_radians() * gamma_deg.to_radians().sin().max(0.01);
                steepest = steepest.max(((row[g] - before[g]) / turn_rad).abs());
            }
        }
    }
    steepest
}
