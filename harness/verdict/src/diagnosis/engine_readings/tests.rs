//! How well a prediction agrees with readings, by hand.

use luxproof_model::Estimate;
use luxproof_spec::procedures::Task;

use super::*;
use crate::fixtures::{built_in, recording, task};

/// Readings of light that takes long to predict, with standard uncertainties of 3 % and tolerances of 10 %.
fn readings(read: &[f64], right: &[f64]) -> EngineReadings {
    EngineReadings {
        model: 0,
        case: 0,
        is_cheap: false,
        read: read.to_vec(),
        right: right.to_vec(),
        uncertainty: right.iter().map(|x| 0.03 * x).collect(),
        allowed: right.iter().map(|x| 0.1 * x).collect(),
        fails: true,
        design_effect: 1.0,
        slack: 0.0,
        floor: 0.0,
        is_rough: false,
    }
}

#[track_caller]
fn assert_near(found: f64, expected: f64) {
    assert!((found - expected).abs() < 1e-9 * expected.abs().max(1.0), "{found} for {expected}");
}

#[test]
fn a_standard_deviation_is_the_root_of_all_its_squares() {
    let plain = readings(&[90.0], &[100.0]);
    assert_near(plain.sigma(0, 200.0), 3.0);
    // 3, 2 % of 200 and 12: a root of 9 + 16 + 144.
    let wide = EngineReadings { slack: 0.02, floor: 12.0, ..plain.clone() };
    assert_near(wide.sigma(0, 200.0), 13.0);
    // Rough predictions: 1 % of 400 and a quarter of the change from 100, 75: a root of 9 + 16 + 5625.
    let rough = plain.with_rough_slack();
    assert_near(rough.sigma(0, 400.0), 5650f64.sqrt());
    let exact = EngineReadings { uncertainty: vec![0.0], ..plain };
    assert_eq!(exact.sigma(0, 0.0), f64::MIN_POSITIVE);
}

#[test]
fn residuals_are_counted_in_standard_deviations_and_blanks_as_one() {
    // Residuals of 1, 2 and 3 standard deviations.
    let sheet = readings(&[103.0, 188.0, 327.0], &[100.0, 200.0, 300.0]);
    assert_near(sheet.chi_squared(&sheet.right), 14.0);
    assert_eq!(sheet.count(), 3);
    assert_near(sheet.chi_squared(&[100.0, f64::NAN, 300.0]), 11.0);
    assert_near(sheet.chi_squared(&[100.0, f64::NAN, f64::NAN]), 3.0);
    // What has no information does not count at all.
    let blind = EngineReadings { uncertainty: vec![3.0, f64::INFINITY, 9.0], ..sheet };
    assert_near(blind.chi_squared(&blind.right), 10.0);
    assert_eq!(blind.count(), 2);
}

#[test]
fn the_limit_of_chance_is_three_standard_deviations_and_six_beyond_the_mean() {
    // 8 + 3.1 root 16 + 6 = 26.4.
    assert!(is_chance(26.39, 8) && !is_chance(26.41, 8));
    // 2 + 3.1 * 2 + 6 = 14.2.
    assert!(is_chance(14.19, 2) && !is_chance(14.21, 2));
}

#[test]
fn readings_are_explained_tolerated_or_contradicted() {
    let sheet = readings(&[103.0, 188.0], &[100.0, 200.0]);
    assert_eq!(sheet.assess(&[103.0, 188.0]), Agreement::Explained(0.0));
    // 19 from 100 is 6.33 standard deviations and just within 10 + 3 * 3; 39 is beyond 20 + 3 * 6 = 38.
    let edge = readings(&[118.9, 200.0], &[100.0, 200.0]);
    let Agreement::Tolerated(score) = edge.assess(&edge.right) else { panic!("{:?}", edge.assess(&edge.right)) };
    assert_near(score, 14.2 + 18.9 * 18.9 / 109.0);
    assert_near(edge.assess(&edge.right).chi_squared(), score);
    let beyond = readings(&[100.0, 239.0], &[100.0, 200.0]);
    let Agreement::Contradicted(score) = beyond.assess(&beyond.right) else { panic!("not contradicted") };
    assert_near(score, 42.25);
    // At a prediction of twice the right value twice as much is allowed: 20 and 9, where 10 and 9 would contradict.
    let doubled = readings(&[228.0, 400.0], &[100.0, 200.0]);
    assert!(matches!(doubled.assess(&[200.0, 400.0]), Agreement::Tolerated(_)));
    // Nothing scales the tolerance of darkness.
    let dark = EngineReadings { uncertainty: vec![1.0], allowed: vec![5.0], ..readings(&[7.9], &[0.0]) };
    let dark = EngineReadings { read: vec![17.9], ..dark };
    assert!(matches!(dark.assess(&[10.0]), Agreement::Tolerated(_)));
    assert!(matches!(dark.assess(&[9.8]), Agreement::Contradicted(_)));
}

#[test]
fn a_factor_fails_where_it_exceeds_one_tolerance() {
    let sheet = EngineReadings { allowed: vec![10.0, 30.0], ..readings(&[100.0, 200.0], &[100.0, 200.0]) };
    assert!(!sheet.would_fail(1.09) && sheet.would_fail(1.11) && !sheet.would_fail(0.91) && sheet.would_fail(0.89));
    let sheet = EngineReadings { allowed: vec![30.0, 10.0], ..sheet };
    assert!(!sheet.would_fail(1.04) && sheet.would_fail(1.06));
}

#[test]
fn a_lenient_slack_is_half_of_the_smallest_relative_tolerance_of_reflected_light() {
    let sheet = EngineReadings { allowed: vec![10.0, 12.0], ..readings(&[100.0, 200.0], &[100.0, 200.0]) };
    assert_near(sheet.clone().with_lenient_slack().slack, 0.03);
    assert_near(EngineReadings { slack: 0.05, ..sheet.clone() }.with_lenient_slack().slack, 0.05);
    assert_near(EngineReadings { is_cheap: true, ..sheet.clone() }.with_lenient_slack().slack, 0.0);
    let dark = EngineReadings { right: vec![0.0, 0.0], ..sheet };
    assert_near(dark.with_lenient_slack().slack, 0.0);
}

#[test]
fn a_fit_weights_passing_readings_by_their_tolerance_too() {
    // 4 % of 100, and a tolerance of 3.
    let sheet = EngineReadings { uncertainty: vec![4.0], allowed: vec![3.0], ..readings(&[110.0], &[100.0]) };
    assert_near(sheet.width(0), 4.0);
    let passing = EngineReadings { fails: false, ..sheet.clone() };
    assert_near(passing.width(0), 5.0);
    assert_near(sheet.residuals(&[102.0]).next().unwrap(), 2.0);
    assert_near(sheet.residuals(&[f64::NAN]).next().unwrap(), 1.0);
    let (square, product) = sheet.products(&[50.0]);
    assert_near(square, 12.5 * 12.5);
    assert_near(product, 12.5 * 27.5);
    // Readings that share their noise count as a quarter of them.
    let shared = sheet.clone().with_design_effect(Some(4.0));
    assert_near(shared.products(&[50.0]).0, 12.5 * 12.5 / 4.0);
    assert_eq!(sheet.clone().with_design_effect(Some(0.5)).design_effect, 1.0);
    assert_eq!(sheet.with_design_effect(None).design_effect, 1.0);
}

#[test]
fn readings_tell_where_a_prediction_is_three_standard_deviations_from_the_right_values() {
    let sheet = readings(&[100.0; 3], &[100.0; 3]);
    assert_eq!(sheet.count_telling(&[109.1, 108.9, 90.9]), 2);
    assert_eq!(sheet.count_telling(&[f64::NAN, 200.0, 100.0]), 1);
}

#[test]
fn the_largest_distance_is_relative_to_the_prediction() {
    let sheet = readings(&[110.0, 150.0, 90.0], &[100.0; 3]);
    assert_near(sheet.worst_percent(&[100.0, 200.0, 90.0]), 25.0);
    // Darkness counts as a millionth of the brightest prediction.
    assert_near(sheet.worst_percent(&[0.0, 200.0, 90.0]), 100.0 * 110.0 / 2e-4);
}

#[test]
fn some_readings_are_those_at_their_places() {
    let sheet = readings(&[1.0, 2.0, 3.0], &[10.0, 20.0, 30.0]);
    let some = sheet.select(&[2, 0], 5);
    assert_eq!((some.model, some.read, some.right), (5, vec![3.0, 1.0], vec![30.0, 10.0]));
    assert_near(some.uncertainty[0], 0.9);
    assert_near(some.allowed[1], 1.0);
}

/// The sheet of one reading of 2 lx, where 1 lx is right.
fn sheet_of(uncertainty: Uncertainty) -> EngineReadings {
    let task: Task = task(1);
    let right = recording("simulator", &[Estimate::exact(1.0)]);
    let read = recording("radiance", &[Estimate { value: 2.0, uncertainty }]);
    let comparisons = built_in().compare(&task, &[&right, &read]);
    let members: Vec<&Comparison> = comparisons.iter().filter(|c| c.key.engine == "radiance").collect();
    EngineReadings::of(3, &Model::new(4, &task, vec![1.0]), &members, true).unwrap()
}

#[test]
fn the_variance_of_few_samples_is_that_of_students_t() {
    let sheet = sheet_of(Uncertainty::sampled(0.03, None));
    assert_eq!((sheet.model, sheet.case, sheet.is_cheap, sheet.fails), (3, 4, false, true));
    assert_eq!((&sheet.read[..], &sheet.right[..]), (&[2.0][..], &[1.0][..]));
    assert_near(sheet.uncertainty[0], 0.03);
    // A millionth of the smaller maximum.
    assert_near(sheet.floor, 1e-6);
    // nu / (nu - 2): a root of 10 / 8 and of 4 / 2; none with 2.
    assert_near(sheet_of(Uncertainty::sampled(0.03, Some(10.0))).uncertainty[0], 0.03 * 1.25f64.sqrt());
    assert_near(sheet_of(Uncertainty::sampled(0.03, Some(4.0))).uncertainty[0], 0.03 * 2f64.sqrt());
    assert_eq!(sheet_of(Uncertainty::sampled(0.03, Some(2.0))).uncertainty[0], f64::INFINITY);
    assert_eq!(sheet_of(Uncertainty::sampled(0.03, Some(1.0))).uncertainty[0], f64::INFINITY);
    assert_eq!(sheet_of(Uncertainty::NotSeen).uncertainty[0], f64::INFINITY);
}
