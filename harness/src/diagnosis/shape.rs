//! What readings have in common whose values nothing explains: light that is the same in every C plane, or at every meter, or a node of the
//! table and nothing between nodes.

use luminaire::scene::{Luminaire, LuminaireModel, Transport};

use super::cause::{Cause, Evidence};
use super::sheet::{Sheet, is_chance};
use crate::procedures::{Target, Task};

/// Directions of one gamma are no farther apart, in degrees.
const SAME_GAMMA: f64 = 1e-4;
/// Parts of a group's mean that its right values must spread over, so that there is something to be seen.
const SPREAD: f64 = 0.02;
/// Groups that must show it.
const MIN_GROUPS: usize = 2;

/// Readings that are a node's beside their direction, though what is right lies elsewhere: so many must show it.
const MIN_BETWEEN: usize = 4;

/// A meter in the frame of the luminaire.
struct Place {
    c_deg: f64,
    gamma_deg: f64,
    /// Candela a lux.
    scale: f64,
    k: usize,
}

/// The meters of a task of one luminaire that nothing hides.
fn places<'a>(task: &'a Task, sheet: &Sheet) -> Option<(&'a Luminaire, Vec<Place>)> {
    let [luminaire] = &task.scene.luminaires[..] else { return None };
    let is_plain = luminaire.model == LuminaireModel::Point && task.scene.obstacles.is_empty();
    if !is_plain || task.transport != Transport::Direct || task.targets.iter().any(|t| t.aspects.len() != 1) {
        return None;
    }
    let place = |(k, target): (usize, &Target)| {
        let meter = target.aspects[0].meter;
        let ray = luminaire.orientation.transpose() * (meter.position_m - luminaire.position_m);
        let cosine = -(meter.position_m - luminaire.position_m).normalize().dot(meter.normal);
        let gamma_deg = ray.x.hypot(ray.y).atan2(-ray.z).to_degrees();
        let c_deg = ray.y.atan2(ray.x).to_degrees().rem_euclid(360.0);
        let scale = ray.length_squared() / (cosine * target.aspects[0].weight);
        (cosine > 0.0 && sheet.uncertainty[k].is_finite()).then_some(Place { c_deg, gamma_deg, scale, k })
    };
    Some((luminaire, task.targets.iter().enumerate().filter_map(place).collect()))
}

/// Every reading is what stands in the table beside its direction: nothing is interpolated in C, in gamma, or in both.
pub(super) fn of_nodes(task: &Task, sheet: &Sheet) -> Option<(Cause, usize)> {
    let (luminaire, places) = places(task, sheet)?;
    let table = luminaire.photometry.distribution.full_circle();
    let beside = |angles: &[f64], at: f64| -> Vec<f64> {
        // What lies on a node is that node's, or a neighbour's where it is cut off.
        let above = angles.partition_point(|a| *a <= at - SAME_GAMMA).min(angles.len() - 1);
        let on = angles.iter().position(|a| (a - at).abs() < SAME_GAMMA);
        let range =
            on.map_or(above.saturating_sub(1)..=above, |on| on.saturating_sub(1)..=(on + 1).min(angles.len() - 1));
        angles[range].to_vec()
    };
    for (in_c, in_gamma, what) in [
        (true, false, "the table is not interpolated in C: every reading is of a plane beside its direction"),
        (false, true, "the table is not interpolated in gamma: every reading is of an angle beside its direction"),
        (true, true, "the table is not interpolated: every reading is a node's beside its direction"),
    ] {
        let (mut chi_squared, mut left, mut before, mut between) = (0.0, 0.0_f64, 0.0_f64, 0);
        for place in &places {
            let angles = |is_coarse: bool, all: &[f64], at: f64| if is_coarse { beside(all, at) } else { vec![at] };
            let c = angles(in_c, table.c_deg(), place.c_deg);
            let gamma = angles(in_gamma, table.gamma_deg(), place.gamma_deg);
            let lux = |c: f64, g: f64| table.intensity(c, g).value() * luminaire.flux_scale / place.scale;
            let off = |predicted: &f64| ((sheet.read[place.k] - predicted) / sheet.sigma(place.k, *predicted)).abs();
            let nodes = c.iter().flat_map(|c| gamma.iter().map(|g| lux(*c, *g)));
            let nearest = nodes.min_by(|a, b| off(a).total_cmp(&off(b)))?;
            chi_squared += off(&nearest).powi(2);
            let right = sheet.right[place.k];
            between += usize::from((nearest - right).abs() > SPREAD * right);
            left = left.max(100.0 * (sheet.read[place.k] / nearest - 1.0).abs());
            before = before.max(100.0 * (sheet.read[place.k] / right - 1.0).abs());
        }
        if between >= MIN_BETWEEN && is_chance(chi_squared, places.len()) {
            return Some((cause("nodes", what, places.len(), [left, before], chi_squared), places.len()));
        }
    }
    None
}

/// Every meter reads the same, where it should not.
pub(super) fn same_everywhere(sheet: &Sheet) -> Option<(Cause, usize)> {
    let told: Vec<usize> = (0..sheet.read.len()).filter(|k| sheet.uncertainty[*k].is_finite()).collect();
    let mean = told.iter().map(|k| sheet.read[*k]).sum::<f64>() / told.len() as f64;
    let chi_squared: f64 = told.iter().map(|k| ((sheet.read[*k] - mean) / sheet.sigma(*k, mean)).powi(2)).sum();
    let differ = told.iter().filter(|k| (sheet.right[**k] - mean).abs() > SPREAD * mean.max(sheet.right[**k])).count();
    let before = told.iter().map(|k| 100.0 * (sheet.read[*k] / sheet.right[*k] - 1.0).abs()).filter(|x| x.is_finite());
    let before = before.fold(0.0, f64::max);
    let what = format!("every meter reads the same, {mean:.4}, wherever it is");
    (told.len() > MIN_GROUPS && differ >= MIN_GROUPS && is_chance(chi_squared, told.len() - 1))
        .then(|| (cause("same", &what, told.len(), [0.0, before], chi_squared), 1))
}

fn cause(id: &'static str, what: &str, readings: usize, [left, before]: [f64; 2], score: f64) -> Cause {
    let evidence = Evidence { readings, left, before, factor: None };
    Cause { id, about: id.to_owned(), what: what.to_owned(), parameters: vec![], evidence, score }
}

/// The readings depend on gamma alone, where the table does not: one plane is read for all. How much is read at each gamma is left open, so
/// that it holds whatever is wrong with the plane; with how many parameters that leaves.
pub(super) fn axial(task: &Task, sheet: &Sheet) -> Option<(Cause, usize)> {
    let (_, mut places) = places(task, sheet)?;
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
