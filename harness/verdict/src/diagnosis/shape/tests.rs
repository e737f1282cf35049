//! Shapes of readings, by hand.

use glam::DVec3;
use luxproof_engines::fixtures;
use luxproof_model::{Estimate, MeterId, ProcedureId, Quantity, Uncertainty};
use luxproof_scene::{Bounces, Meter, Scene};
use luxproof_spec::procedures::Aspect;

use super::*;
use crate::diagnosis::Model;
use crate::fixtures::{built_in, recording, task};

/// The sheet of readings with a standard uncertainty of a thousandth, where others are right.
fn sheet(read: &[f64], right: &[f64]) -> EngineReadings {
    let task = task(read.len());
    let exact: Vec<Estimate> = right.iter().map(|value| Estimate::exact(*value)).collect();
    let sampled = |value: &f64| Estimate { value: *value, uncertainty: Uncertainty::sampled(1e-3 * value, None) };
    let recordings =
        [recording("simulator", &exact), recording("radiance", &read.iter().map(sampled).collect::<Vec<_>>())];
    let comparisons = built_in().compare(&task, &[&recordings[0], &recordings[1]]);
    let members: Vec<_> = comparisons.iter().filter(|c| c.key.engine == "radiance").collect();
    EngineReadings::of(0, &Model::new(0, &task, right.to_vec()), &members, true).unwrap()
}

/// Four meters around a luminaire 2 m above them: two at 45 degrees and two at a distance of 4 m from its axis, each a quarter turn
/// from the other. Those of the second pair weigh twice as much.
fn around() -> Task {
    let places = [(2.0, 0.0, 1.0), (0.0, 2.0, 1.0), (4.0, 0.0, 2.0), (0.0, 4.0, 2.0)];
    let mut targets = vec![];
    for (k, (x, y, weight)) in places.into_iter().enumerate() {
        let meter = Meter { position_m: DVec3::new(x, y, 0.0), normal: DVec3::Z };
        targets.push(Target::of_one(MeterId::new("m", k), meter, weight));
    }
    let lamp = fixtures::luminaire("lamp", DVec3::new(0.0, 0.0, 2.0), fixtures::lopsided());
    Task {
        procedure: ProcedureId::DirectIlluminance,
        scene: Scene { luminaires: vec![lamp], ..Scene::default() },
        transport: Transport::Direct,
        quantity: Quantity::Illuminance,
        targets,
    }
}

#[test]
fn a_place_has_the_angle_from_the_nadir_and_candela_for_its_reading() {
    let task = around();
    let all = places(&task, &sheet(&[1.0; 4], &[1.0; 4])).unwrap();
    // atan(2/2) and atan(4/2); 8/cos 45 and 20/cos 63.4 with a cosine of 2/root 20, over a weight of 2.
    let expected = [(45.0, 8.0 * 2f64.sqrt()), (63.43494882, 20.0 / (2.0 / 20f64.sqrt()) / 2.0)];
    for (k, place) in all.iter().enumerate() {
        let (gamma_deg, scale) = expected[k / 2];
        assert!((place.gamma_deg - gamma_deg).abs() < 1e-6 && place.k == k, "{k}: {}", place.gamma_deg);
        assert!((place.scale / scale - 1.0).abs() < 1e-12, "{k}: {}", place.scale);
    }
    // A meter that faces away has no place, nor has one without information.
    let mut away = task.clone();
    away.targets[1].aspects[0].meter.normal = DVec3::NEG_Z;
    let mut blind = sheet(&[1.0; 4], &[1.0; 4]);
    blind.uncertainty[3] = f64::INFINITY;
    let left: Vec<usize> = places(&away, &blind).unwrap().iter().map(|place| place.k).collect();
    assert_eq!(left, [0, 2]);
    // The plain case alone has places.
    let mut others = vec![task.clone(); 5];
    others[0].scene.luminaires[0].model = LuminaireModel::Area;
    others[1].scene.obstacles = fixtures::s2(vec![], Transport::Direct).scene.obstacles;
    others[2].transport = Transport::Total(Bounces::Converged);
    others[3].targets[0].aspects.push(Aspect { weight: 0.5, ..task.targets[0].aspects[0] });
    others[4].scene.luminaires.push(task.scene.luminaires[0].clone());
    assert!(others.iter().all(|other| places(other, &blind).is_none()));
}

#[test]
fn one_plane_is_found_where_readings_depend_on_gamma_and_right_values_do_not() {
    let task = around();
    // The quotients to the right values: 10/11, 10/9, 6/5 and 1, in candela a factor by pair.
    let (read, right) = ([10.0, 10.0, 6.0, 6.0], [11.0, 9.0, 5.0, 6.0]);
    let (cause, parameters) = find_one_plane(&task, &sheet(&read, &right)).unwrap();
    assert_eq!((cause.id, &cause.about[..], parameters), ("one-plane", "planes", 2));
    assert_eq!(cause.evidence.readings, 4);
    assert!(cause.evidence.left < 1e-9 && (cause.evidence.before - 20.0).abs() < 1e-9, "{:?}", cause.evidence);
    assert!(cause.score < 1e-9);
    // Readings a thousandth of themselves from their mean: 4 / 1.25, with an uncertainty of a thousandth and half of that for biases.
    let scattered = sheet(&[10.0, 10.02, 6.0, 6.012], &right);
    let (cause, _) = find_one_plane(&task, &scattered).unwrap();
    assert!((cause.score - 3.2).abs() < 0.02 && (cause.evidence.left - 0.1).abs() < 1e-3, "{cause:?}");
    // A pair that differs by a per cent is none, nor are right values that differ as little in one of both pairs.
    assert!(find_one_plane(&task, &sheet(&[10.0, 10.1, 6.0, 6.0], &right)).is_none());
    assert!(find_one_plane(&task, &sheet(&read, &[11.0, 9.0, 6.1, 6.0])).is_none());
    assert!(find_one_plane(&task, &sheet(&read, &[11.0, 9.0, 6.2, 6.0])).is_some());
}

#[test]
fn readings_are_the_same_everywhere_where_at_least_two_of_three_should_differ() {
    let (cause, parameters) = find_same_everywhere(&sheet(&[8.0; 3], &[10.0, 8.0, 6.0])).unwrap();
    assert_eq!((cause.id, cause.evidence.readings, parameters), ("same", 3, 1));
    assert!((cause.evidence.before - 100.0 / 3.0).abs() < 1e-9 && cause.evidence.left == 0.0, "{:?}", cause.evidence);
    assert_eq!(cause.what, "every meter reads the same, 8.0000, wherever it is");
    // One thousandth up and one down.
    let (cause, _) = find_same_everywhere(&sheet(&[8.008, 8.0, 7.992], &[10.0, 8.0, 6.0])).unwrap();
    assert!((cause.score - 1.6).abs() < 0.01, "{}", cause.score);
    assert!(find_same_everywhere(&sheet(&[8.3, 8.0, 7.7], &[10.0, 8.0, 6.0])).is_none());
    assert!(find_same_everywhere(&sheet(&[8.0; 2], &[10.0, 6.0])).is_none());
    // 2 % of the mean: one of the three differs by more, or two do.
    assert!(find_same_everywhere(&sheet(&[8.0; 3], &[10.25, 9.9, 9.85])).is_none());
    assert!(find_same_everywhere(&sheet(&[8.0; 3], &[10.25, 9.95, 9.7])).is_some());
    // A right reading of nothing is off by no part of itself.
    let (cause, _) = find_same_everywhere(&sheet(&[8.0; 3], &[0.0, 10.0, 20.0])).unwrap();
    assert!((cause.evidence.before - 60.0).abs() < 1e-9, "{:?}", cause.evidence);
}

#[test]
fn means_are_weighted_by_variances() {
    // Weights of 1 and 1/4: (3 + 8/4) / 1.25.
    assert_eq!(weighted_mean(&[3.0, 8.0], &[1.0, 2.0]), 4.0);
    assert!((largest_percent([1.02, 0.95, f64::INFINITY].into_iter()) - 5.0).abs() < 1e-9);
    assert_eq!(largest_percent([].into_iter()), 0.0);
}
