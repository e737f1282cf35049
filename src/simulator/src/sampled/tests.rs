//! The sampled solvers against the certifier's values of case S2, against themselves, and by laws.

use glam::DVec3;

use super::replicates::mean_and_error;
use crate::path_tracing::test_scenes::luminaire;
use crate::path_tracing::test_scenes::{S2_VALUES, panel, s2, s2_meters, up, uplight};
use crate::{Accuracy, Prepared, Solution, Uncertainty, illuminance};
use luxproof_photometry::LuminousOpening;
use luxproof_scene::{Bounces, Meter, Obstacle, Scene, Shape, Transport};

const CONVERGED: Transport = Transport::Indirect(Bounces::Converged);

/// Beyond this many standard uncertainties Student's t with 15 degrees of freedom goes once in 5,000 times.
const FAR: f64 = 4.9;

fn solve(scene: &Scene, meters: &[Meter], relative_error: f64, seed: u64) -> Solution {
    illuminance(scene, meters, CONVERGED, &Accuracy { relative_error, seed }).unwrap()
}

fn value_and_error(solution: &Solution) -> Vec<(f64, f64)> {
    let error = |u| match u {
        Uncertainty::Bound(bound) => bound,
        Uncertainty::StandardError { value, .. } => value,
    };
    solution.estimates.iter().map(|e| (e.illuminance.value(), error(e.uncertainty))).collect()
}

/// A grid so fine that meters share surface points.
fn many_meters() -> Vec<Meter> {
    (0..80).map(|k| up(0.45 + 0.78 * f64::from(k % 10), 0.35 + 0.7 * f64::from(k / 10), 2.4)).collect()
}

#[test]
fn stated_errors_of_s2_hold_and_meet_what_was_asked() {
    let mut squares = 0.0;
    for seed in 0..8 {
        for ((value, error), known) in value_and_error(&solve(&s2(), &s2_meters(), 1e-2, seed)).iter().zip(S2_VALUES) {
            let z = (value - known[3]) / error.hypot(known[4]);
            assert!(z.abs() < FAR && *error <= 1e-2 * value, "seed {seed}: {value} +- {error} for {}", known[3]);
            squares += z * z / 48.0;
        }
    }
    // 48 readings of 1.07 and less: the mean square scatters by a third.
    assert!((0.5..1.4).contains(&squares.sqrt()), "root mean square {}", squares.sqrt());
}

#[test]
fn many_meters_share_points_and_agree_with_paths_of_few() {
    let meters = many_meters();
    let shared = solve(&s2(), &meters, 5e-3, 1);
    assert!(shared.solver.contains("shared surface points (by"), "{}", shared.solver);
    let few = [3, 41, 77].map(|k| meters[k]);
    let paths = solve(&s2(), &few, 5e-3, 2);
    let found = value_and_error(&shared);
    for (k, (value, error)) in [3, 41, 77].into_iter().zip(value_and_error(&paths)) {
        let (other, its_error) = found[k];
        assert!((value - other).abs() < FAR * error.hypot(its_error), "meter {k}: {value} and {other}");
    }
}

#[test]
fn replicates_scatter_as_the_stated_errors_say_and_give_sets_theirs() {
    let solution = solve(&s2(), &many_meters(), 1e-2, 3);
    for (replicates, (value, error)) in solution.replicates.iter().zip(value_and_error(&solution)) {
        let (mean, scatter) = mean_and_error(replicates);
        assert!((mean - value).abs() < 1e-9 * value && (scatter - error).abs() < 1e-3 * error);
    }
    let mean = solution.weighted_sum(&vec![1.0 / 80.0; 80]);
    let Uncertainty::StandardError { value: error, degrees_of_freedom: 15 } = mean.uncertainty else {
        panic!("{mean:?}")
    };
    let most = value_and_error(&solution).iter().map(|(_, e)| e / 80.0).sum::<f64>();
    assert!(error > 0.0 && error <= most * (1.0 + 1e-9), "{error} of {most} if all erred alike");
}

#[test]
fn light_of_points_and_openings_adds() {
    let lamps = [
        panel(DVec3::new(2.0, 1.5, 2.6)),
        luminaire(uplight(), LuminousOpening::Point, DVec3::new(5.0, 3.0, 2.2)),
        luminaire(uplight(), LuminousOpening::Ellipse { x_m: 0.3, y_m: 0.3, height_m: 0.1 }, DVec3::new(6.5, 4.5, 1.9)),
    ];
    let lit_by = |lamps: &[luxproof_scene::Luminaire]| {
        let scene = Scene { luminaires: lamps.to_vec(), ..s2() };
        value_and_error(&solve(&scene, &s2_meters(), 1e-2, 7 + lamps.len() as u64))
    };
    let together = lit_by(&lamps);
    let alone: Vec<_> = lamps.iter().map(|lamp| lit_by(std::slice::from_ref(lamp))).collect();
    for (k, (value, error)) in together.iter().enumerate() {
        let sum: f64 = alone.iter().map(|found| found[k].0).sum();
        let errors: f64 = alone.iter().map(|found| found[k].1.powi(2)).sum();
        assert!((value - sum).abs() < FAR * errors.sqrt().hypot(*error), "meter {k}: {value} and {sum}");
    }
}

#[test]
fn nothing_that_paths_meet_is_lost_when_reflections_are_counted() {
    let of = |bounces| {
        let accuracy = Accuracy { relative_error: 5e-3, seed: 1 };
        let mut prepared = Prepared::new(&s2(), Transport::Indirect(bounces), &accuracy).unwrap();
        value_and_error(&prepared.illuminance(&s2_meters()).unwrap())
    };
    let (none, first, third, all) =
        (of(Bounces::AtMost(0)), of(Bounces::AtMost(1)), of(Bounces::AtMost(3)), of(Bounces::Converged));
    for k in 0..6 {
        assert_eq!(none[k].0, 0.0);
        assert!(first[k].0 < third[k].0 && third[k].0 < all[k].0, "meter {k}");
    }
}

/// A cupboard 7 mm off the wall: few paths of a meter behind it find the way out, and those that do bring all the light.
#[test]
fn stated_errors_hold_in_a_slit_behind_a_body() {
    let cupboard = Shape::Box { min_m: DVec3::new(0.007, 3.0, 0.0), max_m: DVec3::new(0.6, 4.5, 1.8) };
    let mut scene = s2();
    scene.obstacles = vec![Obstacle { shape: cupboard, reflectance: 0.5 }];
    let behind = |y, z| Meter { position_m: DVec3::new(0.0035, y, z), normal: DVec3::NEG_X };
    // Two bright meters make the others dim.
    let meters = [behind(3.75, 0.9), behind(3.5, 1.3), up(2.0, 1.5, 0.8), up(4.0, 3.0, 0.8)];
    // The means of runs of two million paths a point. A few thousand may miss the way out, scatter by 2 %, and be wrong by a factor of four.
    let known = [(0.00264, 0.00003), (0.00546, 0.00006)];
    for seed in 0..6 {
        for ((value, error), (truth, its_error)) in
            value_and_error(&solve(&scene, &meters, 3e-2, seed)).iter().zip(&known)
        {
            let z = (value - truth) / error.hypot(*its_error);
            assert!(z.abs() < FAR, "seed {seed}: {value} +- {error} for {truth} +- {its_error}");
        }
    }
}
