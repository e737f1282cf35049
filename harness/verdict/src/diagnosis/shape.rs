//! Shapes that readings share although no known fault explains their values.
//!
//! Light is the same in every C plane, or at every meter.

use luxproof_scene::{Luminaire, LuminaireModel, Transport};

use super::cause::{Cause, Evidence};
use super::engine_readings::{EngineReadings, is_chance};
use luxproof_spec::procedures::{Target, Task};

/// Directions of one gamma differ by less than this, in degrees.
const SAME_GAMMA_DEG: f64 = 1e-4;
/// Right values that differ by less than this part show no shape.
const MIN_SPREAD: f64 = 0.02;
/// Groups of readings that must show a shape.
const MIN_GROUPS: usize = 2;

/// A meter in the frame of the luminaire.
struct Place {
    gamma_deg: f64,
    /// Candela a lux.
    scale: f64,
    k: usize,
}

/// The meters of a task of one luminaire that nothing hides.
fn places(task: &Task, sheet: &EngineReadings) -> Option<Vec<Place>> {
    let [luminaire] = &task.scene.luminaires[..] else { return None };
    let is_plain = luminaire.model == LuminaireModel::Point && task.scene.obstacles.is_empty();
    if !is_plain || task.transport != Transport::Direct || task.targets.iter().any(|t| t.aspects.len() != 1) {
        return None;
    }
    let mut places = vec![];
    for (k, target) in task.targets.iter().enumerate() {
        places.extend(place(luminaire, k, target).filter(|_| sheet.uncertainty[k].is_finite()));
    }
    Some(places)
}

/// The place of a meter; `None` where it faces away from the luminaire.
fn place(luminaire: &Luminaire, k: usize, target: &Target) -> Option<Place> {
    let meter = target.aspects[0].meter;
    let offset = meter.position_m - luminaire.position_m;
    let ray = luminaire.orientation.transpose() * offset;
    let cosine = -offset.normalize().dot(meter.normal);
    let gamma_deg = ray.x.hypot(ray.y).atan2(-ray.z).to_degrees();
    let scale = ray.length_squared() / (cosine * target.aspects[0].weight);
    (cosine > 0.0).then_some(Place { gamma_deg, scale, k })
}

/// Finds readings that are the same at every meter, where the right ones differ.
///
/// Where light is the same everywhere, as in a furnace, such readings show nothing.
pub(super) fn find_same_everywhere(sheet: &EngineReadings) -> Option<(Cause, usize)> {
    let informative: Vec<usize> = (0..sheet.read.len()).filter(|k| sheet.uncertainty[*k].is_finite()).collect();
    let mean = informative.iter().map(|k| sheet.read[*k]).sum::<f64>() / informative.len() as f64;
    let right_mean = informative.iter().map(|k| sheet.right[*k]).sum::<f64>() / informative.len() as f64;
    let (mut chi_squared, mut before, mut differing) = (0.0, 0.0, 0);
    for &k in &informative {
        let (read, right) = (sheet.read[k], sheet.right[k]);
        chi_squared += ((read - mean) / sheet.sigma(k, mean)).powi(2);
        differing += usize::from((right - right_mean).abs() > MIN_SPREAD * right_mean);
        let off = 100.0 * (read / right - 1.0).abs();
        if off.is_finite() {
            before = f64::max(before, off);
        }
    }
    if informative.len() <= MIN_GROUPS || differing < MIN_GROUPS || !is_chance(chi_squared, informative.len() - 1) {
        return None;
    }
    let what = format!("every meter reads the same, {mean:.4}, wherever it is");
    let evidence = Evidence { readings: informative.len(), left: 0.0, before, factor: None };
    Some((shape_cause("same", "same", &what, evidence, chi_squared), 1))
}

/// Finds readings that depend on gamma alone, where the table does not: one plane is read for all.
///
/// The light at each gamma stays open, so that the shape shows whatever else is wrong with the plane. The result
/// comes with the number of these open parameters.
pub(super) fn find_one_plane(task: &Task, sheet: &EngineReadings) -> Option<(Cause, usize)> {
    let mut places = places(task, sheet)?;
    places.sort_by(|a, b| a.gamma_deg.total_cmp(&b.gamma_deg));
    let groups: Vec<&[Place]> = places.chunk_by(|a, b| b.gamma_deg - a.gamma_deg < SAME_GAMMA_DEG).collect();
    let (mut chi_squared, mut left, mut before, mut telling) = (0.0, 0.0_f64, 0.0_f64, 0);
    for group in groups.iter().filter(|group| group.len() > 1) {
        let read: Vec<f64> = group.iter().map(|p| sheet.read[p.k] * p.scale).collect();
        let right: Vec<f64> = group.iter().map(|p| sheet.right[p.k] * p.scale).collect();
        let sigmas: Vec<f64> = group.iter().map(|p| sheet.sigma(p.k, sheet.read[p.k]) * p.scale).collect();
        let mean = weighted_mean(&read, &sigmas);
        chi_squared += read.iter().zip(&sigmas).map(|(read, sigma)| ((read - mean) / sigma).powi(2)).sum::<f64>();
        let largest = right.iter().copied().fold(0.0, f64::max);
        let least = right.iter().copied().fold(f64::INFINITY, f64::min);
        telling += usize::from(largest - least > MIN_SPREAD * largest);
        left = left.max(largest_percent(read.iter().map(|read| read / mean)));
        before = before.max(largest_percent(read.iter().zip(&right).map(|(read, right)| read / right)));
    }
    let freedom = places.len() - groups.len();
    if telling < MIN_GROUPS || !is_chance(chi_squared, freedom) {
        return None;
    }
    let what = "light is the same in every C plane: one plane of the table is read for all, and not as it stands there";
    let evidence = Evidence { readings: places.len(), left, before, factor: None };
    Some((shape_cause("one-plane", "planes", what, evidence, chi_squared), groups.len()))
}

/// The mean with weights of one over the variance.
fn weighted_mean(values: &[f64], sigmas: &[f64]) -> f64 {
    let sum: f64 = sigmas.iter().map(|sigma| sigma.powi(-2)).sum();
    values.iter().zip(sigmas).map(|(value, sigma)| sigma.powi(-2) * value).sum::<f64>() / sum
}

/// The largest finite deviation of quotients from 1, in percent.
fn largest_percent(quotients: impl Iterator<Item = f64>) -> f64 {
    quotients.map(|q| 100.0 * (q - 1.0).abs()).filter(|x| x.is_finite()).fold(0.0, f64::max)
}

/// A cause without parameters in its words.
fn shape_cause(id: &'static str, about: &str, what: &str, evidence: Evidence, score: f64) -> Cause {
    Cause { id, about: about.to_owned(), what: what.to_owned(), parameters: vec![], evidence, score }
}

#[cfg(test)]
mod tests;
