//! What readings have in common whose values nothing explains: light that is the same in every C plane.

use luminaire::scene::{LuminaireModel, Transport};

use super::cause::{Cause, Evidence};
use super::sheet::{Sheet, is_chance};
use crate::procedures::Task;

/// Directions of one gamma are no farther apart, in degrees.
const SAME_GAMMA: f64 = 1e-4;
/// Parts of a group's mean that its right values must spread over, so that there is something to be seen.
const SPREAD: f64 = 0.02;
/// Groups that must show it.
const MIN_GROUPS: usize = 2;

/// A meter in the frame of the luminaire.
struct Place {
    gamma_deg: f64,
    /// Candela a lux.
    scale: f64,
    k: usize,
}

/// The readings depend on gamma alone, where the table does not: one plane is read for all. How much is read at each gamma is left open, so
/// that it holds whatever is wrong with the plane; with how many parameters that leaves.
pub(super) fn axial(task: &Task, sheet: &Sheet) -> Option<(Cause, usize)> {
    let [luminaire] = &task.scene.luminaires[..] else { return None };
    let is_plain = luminaire.model == LuminaireModel::Point && task.scene.obstacles.is_empty();
    if !is_plain || task.transport != Transport::Direct || task.targets.iter().any(|t| t.aspects.len() != 1) {
        return None;
    }
    let place = |(k, target): (usize, &crate::procedures::Target)| {
        let meter = target.aspects[0].meter;
        let ray = luminaire.orientation.transpose() * (meter.position_m - luminaire.position_m);
        let cosine = -(meter.position_m - luminaire.position_m).normalize().dot(meter.normal);
        let gamma_deg = ray.x.hypot(ray.y).atan2(-ray.z).to_degrees();
        let scale = ray.length_squared() / (cosine * target.aspects[0].weight);
        (cosine > 0.0 && sheet.uncertainty[k].is_finite()).then_some(Place { gamma_deg, scale, k })
    };
    let mut places: Vec<Place> = task.targets.iter().enumerate().filter_map(place).collect();
    places.sort_by(|a, b| a.gamma_deg.total_cmp(&b.gamma_deg));
    let groups: Vec<&[Place]> = places.chunk_by(|a, b| b.gamma_deg - a.gamma_deg < SAME_GAMMA).collect();
    let (mut chi_squared, mut left, mut before, mut telling) = (0.0, 0.0_f64, 0.0_f64, 0);
    for group in groups.iter().filter(|group| group.len() > 1) {
        let candela = |values: &[f64]| -> Vec<f64> { group.iter().map(|p| values[p.k] * p.scale).collect() };
        let (read, right) = (candela(&sheet.read), candela(&sheet.right));
        let sigma = |at: usize| sheet.sigma(group[at].k, sheet.read[group[at].k]) * group[at].scale;
        let weight = |at: usize| sigma(at).powi(-2);
        let sum: f64 = (0..group.len()).map(weight).sum();
        let mean = (0..group.len()).map(|at| weight(at) * read[at]).sum::<f64>() / sum;
        chi_squared += (0..group.len()).map(|at| ((read[at] - mean) / sigma(at)).powi(2)).sum::<f64>();
        let largest = right.iter().copied().fold(0.0, f64::max);
        let least = right.iter().copied().fold(f64::INFINITY, f64::min);
        telling += usize::from(largest - least > SPREAD * largest);
        let off = |of: &[f64], from: &dyn Fn(usize) -> f64| {
            (0..of.len())
                .map(|at| 100.0 * (of[at] / from(at) - 1.0).abs())
                .filter(|x| x.is_finite())
                .fold(0.0, f64::max)
        };
        left = left.max(off(&read, &|_| mean));
        before = before.max(off(&read, &|at| right[at]));
    }
    let freedom = places.len() - groups.len();
    if telling < MIN_GROUPS || !is_chance(chi_squared, freedom) {
        return None;
    }
    let what = "light is the same in every C plane: one plane of the table is read for all, and not as it stands there";
    let evidence = Evidence { readings: places.len(), left, before, factor: None };
    let (about, parameters) = ("planes".to_owned(), vec![]);
    let cause = Cause { id: "one-plane", about, what: what.to_owned(), parameters, evidence, score: chi_squared };
    Some((cause, groups.len()))
}
