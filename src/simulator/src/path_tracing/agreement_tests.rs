//! Laws of the path tracer between bodies and below openings: its intervals agree with what is known there by clipping, and with
//! what the sampled solvers find.

use glam::DVec3;

use super::test_scenes::{panel, up};
use super::tests::{CONVERGED, solve};
use super::*;
use luxproof_scene::geometry::{Reflectances, Room};
use luxproof_scene::{Obstacle, Shape};

/// How often 200 trials of `2^log2` points agree with the deterministic solver: as often as their intervals say, where
/// these leave its own bound far behind.
fn assert_agreement(scene: &Scene, meters: &[Meter], transport: Transport, log2: u32) {
    let accuracy = Accuracy { relative_error: if transport == Transport::Direct { 1e-6 } else { 2e-3 }, seed: 1 };
    let trials: Vec<_> = (0..200).map(|seed| solve(scene, meters, transport, seed, log2)).collect();
    let solution = crate::illuminance(scene, meters, transport, &accuracy).unwrap();
    for (meter, estimate) in solution.estimates.iter().enumerate() {
        let exact = estimate.illuminance.value();
        let bound = match estimate.uncertainty {
            Uncertainty::Bound(bound) => bound,
            Uncertainty::StandardError { value, .. } => value,
        };
        let usual = (trials.iter().map(|t| t[meter].1.powi(2)).sum::<f64>() / 200.0).sqrt();
        assert!(bound < 0.3 * usual, "meter {meter}: bound {bound}, standard error {usual}");
        let within = |part: f64| {
            let agrees = |t: &&Vec<(f64, f64)>| (t[meter].0 - exact).abs() <= part * STUDENT_T * t[meter].1 + bound;
            trials.iter().filter(agrees).count()
        };
        let (half, whole) = (within(0.5), within(1.0));
        assert!(whole >= 180, "meter {meter}: {whole} of 200 within the interval, {half} within half of it");
        assert!((120..=175).contains(&half), "meter {meter}: {half} of 200 within half the interval");
    }
}

/// A small office with a shelf between a ceiling panel and the desk.
fn shelf_below_a_panel() -> Scene {
    let shelf = Shape::Box { min_m: DVec3::new(1.0, 1.0, 1.0), max_m: DVec3::new(2.0, 2.0, 1.3) };
    let size_m = DVec3::new(4.0, 4.0, 3.0);
    Scene {
        room: Some(Room { size_m, reflectance: Reflectances::with_equal_walls(0.2, 0.5, 0.8) }),
        obstacles: vec![Obstacle { shape: shelf, reflectance: 0.5 }],
        luminaires: vec![panel(DVec3::new(2.1, 1.9, 2.9))],
    }
}

#[test]
fn reflected_light_of_a_furnished_room_agrees_with_the_sampled_solvers() {
    let meters =
        [up(1.5, 1.5, 0.5), up(3.5, 3.0, 0.8), Meter { position_m: DVec3::new(1.0, 3.9, 1.5), normal: DVec3::NEG_Y }];
    assert_agreement(&shelf_below_a_panel(), &meters, CONVERGED, 4);
}

#[test]
fn reflected_light_of_an_area_luminaire_agrees_with_the_sampled_solvers() {
    let mut scene = shelf_below_a_panel();
    scene.obstacles.clear();
    assert_agreement(&scene, &[up(1.5, 1.5, 0.5), up(3.5, 3.0, 0.8)], CONVERGED, 4);
}

/// The edges of such shadows run along the sides of the panel. At the first meter a strip of two strata and a twentieth
/// is lit, of the 64 into which the points part the panel's side.
#[test]
fn penumbras_agree_with_clipped_polygons() {
    let meters = [up(1.9, 1.9, 0.5), up(2.0, 1.9, 0.5), up(2.05, 2.2, 0.5), up(3.5, 3.0, 0.5)];
    for log2 in [5, 6, 7] {
        assert_agreement(&shelf_below_a_panel(), &meters, Transport::Direct, log2);
    }
}
