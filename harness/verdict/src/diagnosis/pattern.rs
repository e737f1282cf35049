//! What readings without a known cause have in common: how far off they are, and what their deviations go along with.

use glam::DVec3;
use itertools::Itertools;
use luxproof_model::{Comparison, Verdict};
use luxproof_scene::Scene;
use luxproof_spec::procedures::Task;

/// A rank correlation from which deviations go along with a quantity.
const MIN_CORRELATION: f64 = 0.7;
/// The fewest readings that show a correlation: of five, one of thirty orders is as regular by chance.
const MIN_READINGS: usize = 5;
/// Deviations that differ by less than this share of the largest are the same everywhere.
const MIN_SPREAD: f64 = 0.05;

/// A quantity of a meter with the words for it; `None` where a scene has none.
type Feature = (&'static str, fn(&Scene, DVec3, DVec3) -> Option<f64>);

const FEATURES: [Feature; 6] = [
    ("the distance from the nearest luminaire", |scene, at, _| Some(towards_nearest(scene, at)?.1.length())),
    ("gamma at the nearest luminaire", |scene, at, _| {
        let (axis, ray) = towards_nearest(scene, at)?;
        Some((-axis).angle_between(ray))
    }),
    ("C at the nearest luminaire", |scene, at, _| {
        let l = nearest(scene, at)?;
        let ray = l.orientation.transpose() * (at - l.position_m);
        Some(ray.y.atan2(ray.x))
    }),
    ("the angle of incidence", |scene, at, normal| Some((-towards_nearest(scene, at)?.1).angle_between(normal))),
    ("the distance from the nearest wall", |scene, at, _| {
        let size = scene.room?.size_m;
        Some(at.x.min(size.x - at.x).min(at.y).min(size.y - at.y))
    }),
    ("the height", |_, at, _| Some(at.z)),
];

fn nearest(scene: &Scene, at: DVec3) -> Option<&luxproof_scene::Luminaire> {
    scene.luminaires.iter().min_by(|a, b| a.position_m.distance(at).total_cmp(&b.position_m.distance(at)))
}

/// The upward axis of the nearest luminaire, and the ray from it to a meter.
fn towards_nearest(scene: &Scene, at: DVec3) -> Option<(DVec3, DVec3)> {
    let luminaire = nearest(scene, at)?;
    Some((luminaire.orientation.z_axis, at - luminaire.position_m))
}

/// Describes the deviations of one engine in one procedure, of which none has a known cause.
pub(super) fn describe(task: &Task, comparisons: &[&Comparison]) -> Option<String> {
    let mut off: Vec<(f64, &Comparison)> = vec![];
    for comparison in comparisons {
        off.extend(deviation(comparison).map(|deviation| (deviation, *comparison)));
    }
    let failing: Vec<f64> = off.iter().filter(|(_, c)| c.verdict == Verdict::Fail).map(|(d, _)| *d).collect();
    let (low, high) = failing.iter().copied().minmax().into_option()?;
    let unit = if task.quantity.has_zero() { "%" } else { task.quantity.unit() };
    let range = if high - low < MIN_SPREAD * low.abs().max(high.abs()) {
        format!("{:+.1} {unit}", 0.5 * (low + high))
    } else {
        format!("{low:+.1} to {high:+.1} {unit}")
    };
    let place = format!("{range} at {} of {} readings", failing.len(), comparisons.len());
    let text = match strongest_correlation(task, &off) {
        Some((name, correlation)) => {
            let way = if correlation > 0.0 { "rises" } else { "falls" };
            format!("{place}; the deviation {way} with {name} (rank correlation {correlation:+.2})")
        }
        None => format!("{place}; the deviation goes along with no distance, angle, height or wall"),
    };
    Some(format!("no known cause: {text}"))
}

/// A deviation in percent, or in units of a rating.
fn deviation(comparison: &Comparison) -> Option<f64> {
    if comparison.quantity.has_zero() { Some(100.0 * comparison.relative_deviation?) } else { comparison.deviation }
}

fn strongest_correlation(task: &Task, off: &[(f64, &Comparison)]) -> Option<(&'static str, f64)> {
    let deviations: Vec<f64> = off.iter().map(|(deviation, _)| *deviation).collect();
    let mut found: Vec<(&str, f64)> = vec![];
    for (name, feature) in FEATURES {
        let values: Option<Vec<f64>> =
            off.iter().map(|(_, c)| feature(&task.scene, c.at_m.into(), c.normal.into())).collect();
        found.extend(values.and_then(|values| Some((name, rank_correlation(&values, &deviations)?))));
    }
    let strongest = found.into_iter().max_by(|a, b| a.1.abs().total_cmp(&b.1.abs()))?;
    Some(strongest).filter(|(_, correlation)| off.len() >= MIN_READINGS && correlation.abs() >= MIN_CORRELATION)
}

/// Spearman's rank correlation; `None` where either list is the same everywhere.
fn rank_correlation(one: &[f64], other: &[f64]) -> Option<f64> {
    let [one, other] = [ranks(one), ranks(other)];
    let middle = 0.5 * (one.len() as f64 - 1.0);
    let product = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(x, y)| (x - middle) * (y - middle)).sum::<f64>();
    Some(product(&one, &other) / (product(&one, &one) * product(&other, &other)).sqrt()).filter(|c| c.is_finite())
}

/// The rank of each value; equal values share the mean of their ranks.
fn ranks(values: &[f64]) -> Vec<f64> {
    values
        .iter()
        .map(|value| {
            let below = values.iter().filter(|other| *other < value).count() as f64;
            let equal = values.iter().filter(|other| *other == value).count() as f64;
            below + 0.5 * (equal - 1.0)
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rank_correlation_is_spearmans() {
        // Ranks 0 1 2 3 against 1 0 3 2: 1 - 6 x 4 / (4 x 15) = 0.6.
        let found = rank_correlation(&[1.0, 2.0, 3.0, 4.0], &[20.0, 10.0, 40.0, 30.0]).unwrap();
        assert!((found - 0.6).abs() < 1e-12);
        assert_eq!(rank_correlation(&[1.0, 2.0], &[5.0, 5.0]), None);
    }
}
