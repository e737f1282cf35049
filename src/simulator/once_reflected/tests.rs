//! Light that is reflected once is what closed forms, Simpson's rule and paths say.

use std::f64::consts::PI;

use glam::DVec3;

use crate::geometry::{Reflectances, Room};
use crate::photometry::{LuminousIntensityDistribution, LuminousOpening};
use crate::scene::{Bounces, Luminaire, Meter, Obstacle, Scene, Shape, Transport};
use crate::simulator::path_tracing::test_scenes::{luminaire, up};
use crate::simulator::{Accuracy, Uncertainty, certified, illuminance};

fn bound(uncertainty: Uncertainty) -> f64 {
    match uncertainty {
        Uncertainty::Bound(bound) => bound,
        other @ Uncertainty::StandardError { .. } => panic!("{other:?} is no bound"),
    }
}

fn accuracy(relative_error: f64) -> Accuracy {
    Accuracy { relative_error, seed: 1 }
}

fn cuboid(min: [f64; 3], max: [f64; 3], reflectance: f64) -> Obstacle {
    Obstacle { shape: Shape::Box { min_m: DVec3::from(min), max_m: DVec3::from(max) }, reflectance }
}

/// A lamp over a floor that alone reflects, and the light on a meter that looks down at a strip of it up to `to_x_m`, by
/// Simpson's rule: rho / pi times the integral of the floor's illuminance times cos cos / r^2.
fn lamp_over_a_floor(to_x_m: f64, meter_m: DVec3) -> (Scene, f64) {
    let spot = LuminousIntensityDistribution::axial(vec![0.0, 180.0], vec![100.0, 100.0]).unwrap();
    let reflectance = Reflectances { floor: 0.5, ..Reflectances::with_equal_walls(0.0, 0.0, 0.0) };
    let lamp_m = DVec3::new(1.0, 2.0, 1.0);
    let scene = Scene {
        room: Some(Room { size_m: DVec3::new(4.0, 4.0, 3.0), reflectance }),
        obstacles: vec![],
        luminaires: vec![luminaire(spot, LuminousOpening::Point, lamp_m)],
    };
    let steps = 400;
    let weight = |k: u32| [2.0, 4.0][k as usize % 2] - f64::from(k == 0 || k == steps);
    let mut lux = 0.0;
    for (i, j) in (0..=steps).flat_map(|i| (0..=steps).map(move |j| (i, j))) {
        let at = |k: u32| f64::from(k) / f64::from(steps);
        let p = DVec3::new(to_x_m * at(i), 4.0 * at(j), 0.0);
        let floor = 100.0 * lamp_m.z / (p - lamp_m).length_squared().powf(1.5);
        let seen = (meter_m.z / (p - meter_m).length_squared()).powi(2) / PI;
        lux += weight(i) * weight(j) / 9.0 * 0.5 * floor * seen;
    }
    (scene, lux * to_x_m * 4.0 / f64::from(steps).powi(2))
}

/// CIE 171 case 5.6: light that a surface reflects once, by the solver for empty rooms and by the one for furnished rooms.
#[test]
fn a_surface_reflects_what_lights_it() {
    let meter = Meter { position_m: DVec3::new(3.0, 2.0, 2.5), normal: DVec3::NEG_Z };
    let (mut scene, exact) = lamp_over_a_floor(4.0, meter.position_m);
    for body in [None, Some(cuboid([0.1, 0.1, 2.8], [0.2, 0.2, 2.9], 0.0))] {
        scene.obstacles.extend(body);
        let once = Transport::Indirect(Bounces::AtMost(1));
        let estimate = illuminance(&scene, &[meter], once, &accuracy(1e-7)).unwrap().estimates[0];
        let error = (estimate.illuminance.value() - exact).abs();
        assert!(error <= bound(estimate.uncertainty) + 1e-9 * exact, "{error} beyond {estimate:?}");
        assert!(error <= 1e-6 * exact, "{error} of {exact}");
    }
}

/// CIE 171 case 5.7: an opaque screen between a lit surface and the meter.
#[test]
fn a_screen_hides_the_reflected_light_that_it_should() {
    let meter = |x, z| Meter { position_m: DVec3::new(x, 2.0, z), normal: DVec3::NEG_Z };
    let meters = [meter(3.5, 0.5), meter(3.0, 2.5)];
    // Over the farther edge of the screen's top the second meter sees the floor up to here; all of that is lit.
    let seen_to = 3.0 - 2.5 * (3.0 - 1.99) / (2.5 - 1.2);
    let (mut scene, exact) = lamp_over_a_floor(seen_to, meters[1].position_m);
    scene.obstacles.push(cuboid([1.99, 0.0, 0.0], [2.01, 4.0, 1.2], 0.0));
    let once = Transport::Indirect(Bounces::AtMost(1));
    for relative_error in [1e-2, 1e-5, 1e-8] {
        let found = illuminance(&scene, &meters, once, &accuracy(relative_error)).unwrap();
        // The first meter sees only floor in the screen's shadow: the lamp hangs below its top.
        assert_eq!(found.estimates[0].illuminance.value(), 0.0);
        let error = (found.estimates[1].illuminance.value() - exact).abs();
        let bound = bound(found.estimates[1].uncertainty);
        assert!(error <= bound + 1e-9 * exact && bound <= relative_error * exact, "{error}, {bound} of {exact}");
        assert!(error <= 1e-6 * exact || relative_error > 1e-5, "{error} of {exact}");
    }
}

/// The path tracer knows neither clipping nor quadrature.
#[test]
fn light_reflected_once_between_bodies_is_what_paths_find() {
    let (mut scene, _) = lamp_over_a_floor(4.0, DVec3::new(3.0, 2.0, 2.5));
    scene.room = scene.room.map(|r| Room { reflectance: Reflectances::with_equal_walls(0.3, 0.5, 0.8), ..r });
    scene.luminaires.push(Luminaire { position_m: DVec3::new(3.3, 0.7, 2.6), ..scene.luminaires[0].clone() });
    scene.obstacles = vec![
        cuboid([1.5, 1.0, 0.0], [1.6, 3.0, 1.7], 0.6),
        cuboid([2.5, 2.2, 0.9], [3.5, 3.4, 1.1], 0.4),
        cuboid([0.2, 3.0, 1.5], [1.1, 3.7, 3.0], 0.1),
    ];
    let meters = [up(0.4, 3.2, 0.3), up(2.9, 2.7, 0.1), up(1.7, 2.0, 0.8), up(3.8, 0.2, 1.5)];
    let once = Transport::Indirect(Bounces::AtMost(1));
    let exact = illuminance(&scene, &meters, once, &accuracy(1e-5)).unwrap();
    // What cannot be had is not asked of paths.
    for solution in [&exact, &illuminance(&scene, &meters, once, &accuracy(1e-14)).unwrap()] {
        assert!(solution.solver.contains("integrated"), "{}", solution.solver);
        assert!(!solution.solver.contains("path tracing"), "{}", solution.solver);
    }
    let asked = Accuracy { relative_error: 3e-3, seed: 4 };
    let paths = certified(&scene, &meters, once, &asked).unwrap();
    for (exact, path) in exact.estimates.iter().zip(&paths.estimates) {
        let Uncertainty::StandardError { value: error, .. } = path.uncertainty else { panic!("{path:?}") };
        assert!(bound(exact.uncertainty) <= 1e-5 * exact.illuminance.value(), "{exact:?}");
        let difference = (exact.illuminance - path.illuminance).value().abs();
        assert!(difference <= 4.0 * error && error <= 2e-3 * exact.illuminance.value(), "{exact:?}, {path:?}");
    }
}
