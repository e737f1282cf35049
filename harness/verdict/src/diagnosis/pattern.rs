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

    #[test]
    fn equal_values_share_the_mean_of_their_ranks() {
        assert_eq!(ranks(&[5.0, 1.0, 5.0, 3.0, 5.0]), [3.0, 0.0, 3.0, 1.0, 3.0]);
        let falling = rank_correlation(&[1.0, 2.0, 3.0], &[9.0, 4.0, 1.0]).unwrap();
        assert!((falling + 1.0).abs() < 1e-12, "{falling}");
    }

    /// The description of readings with these relative deviations, one above the other.
    fn described(deviations: &[f64]) -> Option<String> {
        use crate::fixtures::{built_in, recording, task};
        use luxproof_model::Estimate;
        let estimates: Vec<Estimate> = deviations.iter().map(|d| Estimate::exact(1.0 + d)).collect();
        let exact = recording("simulator", &vec![Estimate::exact(1.0); deviations.len()]);
        let task = task(deviations.len());
        let mut comparisons = built_in().compare(&task, &[&exact, &recording("radiance", &estimates)]);
        comparisons.retain(|c| c.key.engine == "radiance");
        comparisons.iter_mut().enumerate().for_each(|(k, c)| c.at_m = [0.0, 0.0, k as f64]);
        describe(&task, &comparisons.iter().collect_vec())
    }

    #[test]
    fn deviations_have_their_range_and_what_they_go_along_with() {
        let rising = described(&[0.05, 0.06, 0.07, 0.08, 0.1]).unwrap();
        let text = "+5.0 to +10.0 % at 5 of 5 readings; the deviation rises with the height (rank correlation +1.00)";
        assert_eq!(rising, format!("no known cause: {text}"));
        let falling = described(&[-0.05, -0.06, -0.07, -0.08, -0.1]).unwrap();
        assert!(falling.contains("-10.0 to -5.0 %") && falling.contains("falls with the height"), "{falling}");
        // Four readings show no rule, and neither do those without order.
        let few = described(&[0.05, 0.06, 0.07, 0.08]).unwrap();
        assert!(few.ends_with("; the deviation goes along with no distance, angle, height or wall"), "{few}");
        let none = described(&[0.05, 0.1, 0.04, 0.09, 0.07]).unwrap();
        assert!(none.contains("+4.0 to +10.0 % at 5 of 5") && none.contains("along with no"), "{none}");
        // Those within a twentieth are one; readings that pass are not among the failing ones.
        let same = described(&[0.1, 0.098, 0.1, 0.099, 0.1, 0.0]).unwrap();
        assert!(same.starts_with("no known cause: +9.9 % at 5 of 6 readings"), "{same}");
        assert_eq!(described(&[0.0, 0.0]), None);
    }

    #[test]
    fn features_are_distances_and_angles_of_the_nearest_luminaire_and_wall() {
        use luxproof_engines::fixtures;
        use luxproof_scene::geometry::{Reflectances, Room};
        let mut scene = fixtures::s1(luxproof_scene::Transport::Direct).scene;
        let near = fixtures::luminaire("near", DVec3::new(1.0, 2.0, 3.0), fixtures::quadrant());
        let far = fixtures::luminaire("far", DVec3::new(9.0, 2.0, 3.0), fixtures::quadrant());
        scene.luminaires = vec![far, near];
        let reflectance = Reflectances::with_equal_walls(0.2, 0.5, 0.7);
        scene.room = Some(Room { size_m: DVec3::new(10.0, 4.5, 4.0), reflectance });
        // Two meters beside and two below the near one; the nearest wall is that beyond y.
        let (at, normal) = (DVec3::new(3.0, 2.0, 1.0), DVec3::Z);
        let found: Vec<f64> = FEATURES.iter().map(|(_, of)| of(&scene, at, normal).unwrap()).collect();
        let quarter = std::f64::consts::FRAC_PI_4;
        let expected = [8f64.sqrt(), quarter, 0.0, quarter, 2.0, 1.0];
        assert!(found.iter().zip(expected).all(|(f, e)| (f - e).abs() < 1e-9), "{found:?}");
        let wall = FEATURES[4].1;
        for (at, distance) in [
            (DVec3::new(0.5, 2.0, 1.0), 0.5),
            (DVec3::new(9.3, 2.0, 1.0), 0.7),
            (DVec3::new(5.0, 0.3, 1.0), 0.3),
            (DVec3::new(5.0, 4.1, 1.0), 0.4),
        ] {
            assert!((wall(&scene, at, normal).unwrap() - distance).abs() < 1e-9, "{at}");
        }
        scene.room = None;
        assert_eq!(wall(&scene, at, normal), None);
    }
}
