//! Laws that a furnished room must obey.

use std::f64::consts::PI;

use approx::assert_relative_eq;
use glam::DVec3;

use super::*;
use crate::geometry::configuration_factor::element_to_polygon;
use crate::geometry::{Reflectances, Room};
use crate::photometry::{LuminousIntensityDistribution, LuminousOpening};
use crate::scene::{Bounces, Luminaire, Meter, Obstacle, Scene, Shape, Transport};
use crate::simulator::path_tracing::test_scenes::{S2_VALUES, luminaire, s1, s1_meters, s2, s2_meters, up};
use crate::simulator::{Accuracy, Uncertainty, illuminance, path_tracing};

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
    let integrated = (Bounces::AtMost(1), "integrated");
    for (bounces, solver) in [Bounces::Converged, Bounces::AtMost(2), Bounces::AtMost(3)]
        .map(|bounces| (bounces, "radiosity"))
        .into_iter()
        .chain([integrated])
    {
        scene.obstacles.clear();
        let exact = illuminance(&scene, &meters, Transport::Indirect(bounces), &accuracy(1e-4)).unwrap();
        let (min_m, max_m) = (DVec3::new(10.0, 10.0, 0.0), DVec3::new(10.01, 10.01, 0.01));
        let shape = Shape::Box { min_m, max_m };
        scene.obstacles.push(Obstacle { shape, reflectance: 0.2 });
        let solution = illuminance(&scene, &meters, Transport::Indirect(bounces), &accuracy(1.0)).unwrap();
        assert!(solution.solver.contains(solver), "{}", solution.solver);
        for (estimate, exact) in solution.estimates.iter().zip(&exact.estimates) {
            let error = (estimate.illuminance - exact.illuminance).value().abs();
            let bound = bound(estimate.uncertainty) + bound(exact.uncertainty);
            assert!(error <= bound, "{bounces:?}: {error} beyond {bound}");
            assert!(error <= 5e-3 * exact.illuminance.value(), "{bounces:?}: {error}");
        }
    }
}

fn cuboid(min: [f64; 3], max: [f64; 3], reflectance: f64) -> Obstacle {
    Obstacle { shape: Shape::Box { min_m: DVec3::from(min), max_m: DVec3::from(max) }, reflectance }
}

/// CIE 171 case 5.3: a 1 m square of exitance 1000 π centred on the ceiling of a black room, 4 m by 4 m by 3 m.
#[test]
fn an_area_source_lights_walls_and_floor_as_configuration_factors_say() {
    let gamma: Vec<f64> = (0..=9000).map(|k| 0.01 * f64::from(k)).collect();
    let candela = gamma.iter().map(|g| 1000.0 * g.to_radians().cos().max(0.0)).collect();
    let distribution = LuminousIntensityDistribution::axial(gamma, candela).unwrap();
    let opening = LuminousOpening::Box { x_m: 1.0, y_m: 1.0, height_m: 0.0 };
    let source = luminaire(distribution, opening, DVec3::new(2.0, 2.0, 3.0));
    let room = Room { size_m: DVec3::new(4.0, 4.0, 3.0), reflectance: Reflectances::with_equal_walls(0.0, 0.0, 0.0) };
    let scene = Scene { room: Some(room), obstacles: vec![], luminaires: vec![source] };
    let wall = [(2.75, 32.677), (2.25, 75.194), (1.75, 81.323), (1.25, 69.061), (0.75, 53.404), (0.25, 40.002)];
    let floor = [(0.25, 61.424), (0.75, 79.255), (1.25, 95.667), (1.75, 105.778)];
    // A nanometre off the surfaces.
    let on_wall = wall.map(|(z, lux)| (Meter { position_m: DVec3::new(2.0, 1e-9, z), normal: DVec3::Y }, lux));
    let on_floor = floor.map(|(y, lux)| (up(2.0, y, 1e-9), lux));
    let (meters, published): (Vec<_>, Vec<_>) = on_wall.into_iter().chain(on_floor).unzip();
    let found = illuminance(&scene, &meters, Transport::Total(Bounces::Converged), &accuracy(1e-2)).unwrap();
    for ((estimate, meter), published) in found.estimates.iter().zip(&meters).zip(published) {
        let square = [(1.5, 1.5), (2.5, 1.5), (2.5, 2.5), (1.5, 2.5)].map(|(x, y)| DVec3::new(x, y, 3.0));
        let exact = 1000.0 * PI * element_to_polygon(meter.position_m, meter.normal, &square);
        assert_relative_eq!(estimate.illuminance.value(), exact, max_relative = 1e-6);
        assert_relative_eq!(exact, published, epsilon = 1e-3);
    }
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

/// CIE 171 case 5.7 with a luminous surface: what shows of it over a screen is a rectangle.
#[test]
fn a_screen_leaves_the_closed_form_of_what_shows_of_a_luminous_surface() {
    let gamma: Vec<f64> = (0..=9000).map(|k| 0.01 * f64::from(k)).collect();
    let candela = gamma.iter().map(|g| 1000.0 * g.to_radians().cos().max(0.0)).collect();
    let distribution = LuminousIntensityDistribution::axial(gamma, candela).unwrap();
    let opening = LuminousOpening::Box { x_m: 1.0, y_m: 1.0, height_m: 0.0 };
    let source = luminaire(distribution, opening, DVec3::new(1.0, 2.0, 3.0));
    let room = Room { size_m: DVec3::new(4.0, 4.0, 3.5), reflectance: Reflectances::with_equal_walls(0.0, 0.0, 0.0) };
    let obstacles = vec![cuboid([1.99, 0.0, 0.0], [2.01, 4.0, 2.0], 0.0)];
    let scene = Scene { room: Some(room), obstacles, luminaires: vec![source] };
    for meter in [up(3.0, 2.0, 0.8), up(2.7, 3.5, 0.9), up(3.9, 0.3, 0.5)] {
        // Over the nearer edge of the screen's top.
        let p = meter.position_m;
        let from_x = (p.x - (3.0 - p.z) * (p.x - 2.01) / (2.0 - p.z)).max(0.5);
        let shown = [(from_x, 1.5), (1.5, 1.5), (1.5, 2.5), (from_x, 2.5)].map(|(x, y)| DVec3::new(x, y, 3.0));
        let exact = if from_x < 1.5 { 1000.0 * PI * element_to_polygon(p, DVec3::Z, &shown) } else { 0.0 };
        let found = illuminance(&scene, &[meter], Transport::Direct, &accuracy(1e-6)).unwrap().estimates[0];
        assert_relative_eq!(found.illuminance.value(), exact, max_relative = 1e-6);
        assert!((found.illuminance.value() - exact).abs() <= bound(found.uncertainty), "{found:?} for {exact}");
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
    let paths = path_tracing::illuminance(&scene, &meters, once, &asked).unwrap();
    for (exact, path) in exact.estimates.iter().zip(&paths.estimates) {
        let Uncertainty::StandardError { value: error, .. } = path.uncertainty else { panic!("{path:?}") };
        assert!(bound(exact.uncertainty) <= 1e-5 * exact.illuminance.value(), "{exact:?}");
        let difference = (exact.illuminance - path.illuminance).value().abs();
        assert!(difference <= 4.0 * error && error <= 2e-3 * exact.illuminance.value(), "{exact:?}, {path:?}");
    }
}

#[test]
fn more_bodies_than_can_be_meshed_go_to_another_solver() {
    let mut scene = s2();
    for k in 0..60 {
        let (x, y) = (0.1 + 0.12 * f64::from(k % 30), 5.0 + 0.3 * f64::from(k / 30));
        scene.obstacles.push(cuboid([x, y, 0.1], [x + 0.05, y + 0.05, 0.2], 0.5));
    }
    let found =
        illuminance(&scene, &s2_meters()[..1], Transport::Indirect(Bounces::Converged), &accuracy(0.1)).unwrap();
    assert!(found.solver.contains("path tracing"), "{}", found.solver);
}

/// Against path tracing at 184 meters, which `cargo bench --bench simulator` reads too: x, y, lux, standard error.
#[test]
fn bounds_hold_at_every_meter_of_s2() {
    let lines = include_str!("../../../reference/analytic/values/s2_indirect.txt")
        .lines()
        .filter(|line| !line.starts_with('#'));
    let truth: Vec<Vec<f64>> = lines.map(|line| line.split(' ').map(|n| n.parse().unwrap()).collect()).collect();
    assert_eq!(truth.len(), 184);
    let meters: Vec<Meter> = truth.iter().map(|v| up(v[0], v[1], 0.8)).collect();
    let converged = Transport::Indirect(Bounces::Converged);
    let solution = illuminance(&s2(), &meters, converged, &accuracy(0.015)).unwrap();
    assert!(!solution.solver.contains("path tracing"), "{}", solution.solver);
    let mut errors = vec![];
    for (estimate, v) in solution.estimates.iter().zip(&truth) {
        let error = (estimate.illuminance.value() - v[2]).abs();
        let bound = bound(estimate.uncertainty);
        assert!(error <= bound + 3.0 * v[3], "{error} beyond {bound} at {} {}", v[0], v[1]);
        errors.push(error / v[2]);
    }
    errors.sort_by(f64::total_cmp);
    assert!(errors[92] <= 3e-4 && errors[183] <= 2e-3, "median {}, worst {}", errors[92], errors[183]);
}

/// Case S2 with every surface alike.
fn grey_s2(reflectance: f64) -> Scene {
    let mut scene = s2();
    for obstacle in &mut scene.obstacles {
        obstacle.reflectance = reflectance;
    }
    if let Some(room) = &mut scene.room {
        room.reflectance = Reflectances::with_equal_walls(reflectance, reflectance, reflectance);
    }
    scene
}

#[test]
fn every_element_sees_exactly_one_room() {
    let furnished = Furnished::new(&grey_s2(0.5)).unwrap();
    let patches = furnished.mesh(&furnished.room.unwrap(), 1);
    let one: Vec<Exitance> = patches.iter().map(|_| Exitance::project(&|_, _, _| [1.0; 9], 1.0)).collect();
    for patch in &patches {
        for node in patch.nodes_m() {
            let (whole, row) = furnished.seen_from(node, patch.normal, &patches, &one);
            assert_relative_eq!(whole, 1.0, epsilon = 2e-6);
            assert_relative_eq!(row.iter().sum::<f64>(), 1.0, epsilon = 2e-6);
        }
    }
}

#[test]
fn light_is_neither_made_nor_lost_where_all_surfaces_reflect_alike() {
    for (reflectance, flux_lm) in [(0.5, 4000.0 * PI), (0.8, 4000.0 * PI)] {
        let furnished = Furnished::new(&grey_s2(reflectance)).unwrap();
        let field = furnished.solve(furnished.mesh(&furnished.room.unwrap(), 3), Bounces::Converged);
        let (mut once, mut all) = (0.0, 0.0);
        for (k, patch) in field.patches.iter().enumerate() {
            for n in 0..NODES {
                let area = RULE[n / 3].1 * RULE[n % 3].1 * patch.area_m2;
                once += area * field.first[k].at_node(n);
                all += area * (field.first[k].at_node(n) + field.further[NODES * k + n]);
            }
        }
        assert_relative_eq!(once, reflectance * flux_lm, max_relative = 2e-5);
        assert_relative_eq!(all, reflectance * flux_lm / (1.0 - reflectance), max_relative = FLOOR);
    }
}

/// What the rule of a patch makes of surfaces that a meter sees at grazing angles.
#[test]
fn the_first_reflection_of_walls_is_that_of_a_dense_sum() {
    let mut scene = s2();
    scene.obstacles.clear();
    let furnished = Furnished::new(&scene).unwrap();
    let meter = up(3.75, 2.75, 0.8);
    let size = DVec3::new(8.0, 6.0, 3.0);
    let (n, mut exact) = (120, 0.0);
    for (axis, far) in [(0, false), (0, true), (1, false), (1, true)] {
        let normal = DVec3::AXES[axis] * if far { -1.0 } else { 1.0 };
        for (i, j) in (0..n * n).map(|k| (k / n, k % n)) {
            let at = |k: i32| (f64::from(k) + 0.5) / f64::from(n);
            let mut p = DVec3::new(0.0, 0.0, 0.8 + 2.2 * at(j));
            p[axis] = if far { size[axis] } else { 0.0 };
            p[1 - axis] = at(i) * size[1 - axis];
            let area = size[1 - axis] * 2.2 / f64::from(n * n);
            let lux = furnished.direct(&[Meter { position_m: p, normal }], 1e-6)[0].value;
            let d = p - meter.position_m;
            exact += 0.5 * lux / PI * d.z * -d.dot(normal) / d.length_squared().powi(2) * area;
        }
    }
    let once = Transport::Indirect(Bounces::AtMost(1));
    let found = illuminance(&scene, &[meter], once, &accuracy(0.1)).unwrap().estimates[0];
    assert_relative_eq!(found.illuminance.value(), exact, max_relative = 1e-4);
}

#[test]
fn a_cosine_table_with_rounded_figures_lights_like_the_cosine_within_its_bound() {
    let exact = s2();
    let mut rounded = s2();
    for lamp in &mut rounded.luminaires {
        let table = &lamp.photometry.distribution;
        let figures = |i: &f64| (i * 1e6).round() / 1e6;
        let candela = table.plane(0).iter().map(figures).collect();
        let table = LuminousIntensityDistribution::axial(table.gamma_deg().to_vec(), candela).unwrap();
        *lamp = luminaire(table, lamp.photometry.opening, lamp.position_m);
    }
    let direct =
        |scene: &Scene| illuminance(scene, &s2_meters(), Transport::Direct, &accuracy(1e-3)).unwrap().estimates;
    for (a, b) in direct(&exact).iter().zip(direct(&rounded)) {
        let off = (a.illuminance - b.illuminance).value().abs();
        assert!(off <= 1e-6 * a.illuminance.value(), "{a:?} {b:?}");
        if b.illuminance.value() == 0.0 {
            continue;
        }
        // The closed formula's bound, not a quadrature's.
        assert!(bound(b.uncertainty) > 9e-6 * b.illuminance.value(), "{b:?}");
        assert!(bound(b.uncertainty) < 1.1e-5 * b.illuminance.value(), "{b:?}");
    }
}
