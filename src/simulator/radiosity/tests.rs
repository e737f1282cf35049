//! Laws that a furnished room must obey.

use glam::DVec3;

use crate::scene::{Bounces, Meter, Transport};
use crate::simulator::path_tracing::test_scenes::{S2_VALUES, s1, s1_meters, s2, s2_meters, up};
use crate::simulator::{Accuracy, Uncertainty, illuminance};

fn bound(uncertainty: Uncertainty) -> f64 {
    match uncertainty {
        Uncertainty::Bound(bound) => bound,
        other @ Uncertainty::StandardError { .. } => panic!("{other:?} is no bound"),
    }
}

#[test]
fn direct_light_of_s2_is_exact() {
    let accuracy = Accuracy { relative_error: 1e-6, seed: 1 };
    let solution = illuminance(&s2(), &s2_meters(), Transport::Direct, &accuracy).unwrap();
    for (estimate, v) in solution.estimates.iter().zip(S2_VALUES) {
        assert!((estimate.illuminance.value() - v[2]).abs() <= 5.1e-6, "{estimate:?} at {} {}", v[0], v[1]);
    }
}

#[test]
fn mean_direct_light_of_s2_over_all_meters_is_exact() {
    let free = |m: &Meter| !matches!((m.position_m.x, m.position_m.y), (5.5..=7.5, 0.5..=1.5));
    let at = |i: i32, j: i32| up(0.5 * f64::from(i) + 0.25, 0.5 * f64::from(j) + 0.25, 0.8);
    let meters: Vec<Meter> = (0..16).flat_map(|i| (0..12).map(move |j| at(i, j))).filter(free).collect();
    assert_eq!(meters.len(), 184);
    let accuracy = Accuracy { relative_error: 1e-6, seed: 1 };
    let solution = illuminance(&s2(), &meters, Transport::Direct, &accuracy).unwrap();
    let mean = solution.estimates.iter().map(|e| e.illuminance.value()).sum::<f64>() / 184.0;
    assert!((mean - 153.848671).abs() < 6e-7, "{mean}");
}

#[test]
fn indirect_light_of_s2_lies_within_its_bound() {
    let converged = Transport::Indirect(Bounces::Converged);
    let solution = illuminance(&s2(), &s2_meters(), converged, &accuracy(1.0)).unwrap();
    for (estimate, v) in solution.estimates.iter().zip(S2_VALUES) {
        let error = (estimate.illuminance.value() - v[3]).abs();
        let bound = bound(estimate.uncertainty);
        assert!(error <= bound + 3.0 * v[4], "{error} beyond {bound} at {} {}", v[0], v[1]);
        assert!(error <= 0.01 * v[3], "{error} of {} at {} {}", v[3], v[0], v[1]);
    }
}

fn accuracy(relative_error: f64) -> Accuracy {
    Accuracy { relative_error, seed: 1 }
}

#[test]
fn an_empty_room_comes_out_as_hp_collocation_says() {
    // A body too small to matter sends the scene to radiosity.
    let mut scene = s1();
    let meters = s1_meters();
    for bounces in [Bounces::Converged, Bounces::AtMost(1), Bounces::AtMost(3)] {
        scene.obstacles.clear();
        let exact = illuminance(&scene, &meters, Transport::Indirect(bounces), &accuracy(1e-4)).unwrap();
        let (min_m, max_m) = (DVec3::new(10.0, 10.0, 0.0), DVec3::new(10.01, 10.01, 0.01));
        let shape = crate::scene::Shape::Box { min_m, max_m };
        scene.obstacles.push(crate::scene::Obstacle { shape, reflectance: 0.2 });
        let solution = illuminance(&scene, &meters, Transport::Indirect(bounces), &accuracy(1.0)).unwrap();
        assert!(solution.solver.contains("radiosity"), "{}", solution.solver);
        for (estimate, exact) in solution.estimates.iter().zip(&exact.estimates) {
            let error = (estimate.illuminance - exact.illuminance).value().abs();
            let bound = bound(estimate.uncertainty) + bound(exact.uncertainty);
            assert!(error <= bound, "{bounces:?}: {error} beyond {bound}");
            assert!(error <= 5e-3 * exact.illuminance.value(), "{bounces:?}: {error}");
        }
    }
}
