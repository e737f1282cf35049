//! Laws that rooms with bodies and luminous openings must obey.

use std::f64::consts::PI;
use std::sync::atomic::AtomicI64;

use approx::assert_relative_eq;
use glam::DVec3;

use super::Enclosure;
use super::bicubic::Bicubic;
use super::given::Given;
use super::lit::{Lights, Lit};
use super::patches::Cover;
use super::seen::Rows;
use super::view::View;
use crate::by_night;
use crate::geometry::configuration_factor::element_to_polygon;
use crate::geometry::{Mesh, Reflectances, Room};
use crate::photometry::{LuminousIntensityDistribution, LuminousOpening};
use crate::scene::{Bounces, Meter, Obstacle, Scene, Shape, Transport};
use crate::simulator::once_reflected::OnceReflected;
use crate::simulator::path_tracing::test_scenes::{S2_VALUES, luminaire, s1, s1_meters, s2, s2_meters, up};
use crate::simulator::sampler::{mix, unit};
use crate::simulator::stop::Stop;
use crate::simulator::{Accuracy, Bounded, Prepared, Uncertainty, certified, illuminance};

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

#[test]
fn direct_light_of_s2_is_exact() {
    let accuracy = Accuracy { relative_error: 1e-6, seed: 1 };
    let solution = illuminance(&s2(), &s2_meters(), Transport::Direct, &accuracy).unwrap();
    for (estimate, v) in solution.estimates.iter().zip(S2_VALUES) {
        assert!((estimate.illuminance.value() - v[2]).abs() <= 5.1e-6, "{estimate:?} at {} {}", v[0], v[1]);
    }
}

#[test]
fn a_round_opening_behind_a_box_is_dark_without_doubt_and_one_that_shows_a_sliver_is_not() {
    let round = LuminousOpening::Ellipse { x_m: 0.5, y_m: 0.5, height_m: 0.0 };
    let even = LuminousIntensityDistribution::axial(vec![0.0, 180.0], vec![1e6, 1e6]).unwrap();
    let at = |x_m: f64| {
        let lamp = luminaire(even.clone(), round, DVec3::new(0.0, 0.0, 3.0));
        let scene =
            Scene { luminaires: vec![lamp], obstacles: vec![cuboid([-1.0; 3], [1.0; 3], 0.5)], ..Scene::default() };
        illuminance(&scene, &[up(x_m, 0.0, -1.5)], Transport::Direct, &accuracy(1e-3)).unwrap().estimates[0]
    };
    // Its edge rises over the box's at 1 + 2.5 / 2 (1 - .25) = 1.9375 m.
    for x_m in [0.0, 0.5, 1.0, 1.5, 1.93] {
        assert_eq!((at(x_m).illuminance.value(), bound(at(x_m).uncertainty)), (0.0, 0.0), "{x_m}");
    }
    for x_m in [1.94, 2.1] {
        let found = at(x_m);
        assert!(bound(found.uncertainty) > 0.0 && (x_m < 2.0 || found.illuminance.value() > 0.0), "{x_m}: {found:?}");
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
fn a_coarse_table_that_is_taken_for_a_cosine_is_off_no_more_than_its_bound() {
    let room = Room { size_m: DVec3::new(4.0, 3.0, 2.8), reflectance: Reflectances::with_equal_walls(0.3, 0.5, 0.7) };
    let coarse: Vec<f64> = (0..=9).map(|k| 10.0 * f64::from(k)).chain([180.0]).collect();
    let candela = |gamma_deg: f64| if gamma_deg < 89.9 { 100.0 * gamma_deg.to_radians().cos() } else { 0.0 };
    let cosines = LuminousIntensityDistribution::axial(coarse.clone(), coarse.iter().map(|g| candela(*g)).collect());
    // The same pieces, whose nodes between are no cosines.
    let fine: Vec<f64> = (0..=18).map(|k| 5.0 * f64::from(k)).chain([180.0]).collect();
    let of_pieces = |g: &f64| if g % 10.0 == 0.0 { candela(*g) } else { 0.5 * (candela(g - 5.0) + candela(g + 5.0)) };
    let pieces = LuminousIntensityDistribution::axial(fine.clone(), fine.iter().map(of_pieces).collect());
    let read = |table: LuminousIntensityDistribution| {
        let panel = LuminousOpening::Box { x_m: 0.6, y_m: 0.6, height_m: 0.0 };
        let lamp = luminaire(table, panel, DVec3::new(1.5, 1.2, 2.5));
        let scene = Scene { room: Some(room), luminaires: vec![lamp], ..Scene::default() };
        let indirect = Transport::Indirect(Bounces::Converged);
        illuminance(&scene, &[up(1.0, 1.0, 0.8), up(3.0, 2.5, 0.8)], indirect, &accuracy(5e-3)).unwrap().estimates
    };
    for (a, b) in read(cosines.unwrap()).iter().zip(read(pieces.unwrap())) {
        let off = a.illuminance.value() - b.illuminance.value();
        assert!(off > 1e-3 * b.illuminance.value(), "{off}: both are cosines");
        assert!(off <= bound(a.uncertainty), "{a:?} {b:?}");
    }
}

#[test]
fn indirect_light_of_s2_lies_within_its_bound() {
    let converged = Transport::Indirect(Bounces::Converged);
    let solution = illuminance(&s2(), &s2_meters(), converged, &accuracy(0.02)).unwrap();
    for (estimate, v) in solution.estimates.iter().zip(S2_VALUES) {
        let error = (estimate.illuminance.value() - v[3]).abs();
        let bound = bound(estimate.uncertainty);
        assert!(error <= bound + 3.0 * v[4], "{error} beyond {bound} at {} {}", v[0], v[1]);
        assert!(error <= 0.01 * v[3], "{error} of {} at {} {}", v[3], v[0], v[1]);
    }
}

/// What nodes are off is measured by the solution before: without that bounds are ten times as wide, and rays would be asked.
#[test]
fn reflected_light_of_s2_is_known_to_a_thousandth() {
    let converged = Transport::Indirect(Bounces::Converged);
    let solution = illuminance(&s2(), &s2_meters(), converged, &accuracy(1e-3)).unwrap();
    assert!(!solution.solver.contains("final gather"), "{}", solution.solver);
    for (estimate, v) in solution.estimates.iter().zip(S2_VALUES) {
        let (value, bound) = (estimate.illuminance.value(), bound(estimate.uncertainty));
        assert!(bound <= 1e-3 * value, "{bound} of {value} at {} {}", v[0], v[1]);
        assert!((value - v[3]).abs() <= bound + 3.0 * v[4], "{value} +- {bound} at {} {}", v[0], v[1]);
    }
}

#[test]
fn an_empty_room_comes_out_as_hp_collocation_says() {
    // A body too small to matter keeps the scene from hp collocation, and one of triangles from the balance, too.
    let mut scene = s1();
    let meters = s1_meters();
    for bounces in [Bounces::Converged, Bounces::AtMost(2), Bounces::AtMost(3), Bounces::AtMost(1)] {
        scene.obstacles.clear();
        let exact = illuminance(&scene, &meters, Transport::Indirect(bounces), &accuracy(1e-4)).unwrap();
        let (min_m, max_m) = (DVec3::new(10.0, 10.0, 0.0), DVec3::new(10.01, 10.01, 0.01));
        let Mesh { vertices_m, triangles, .. } = Mesh::cuboid(min_m, max_m);
        let of_triangles = (Shape::Mesh { vertices_m, triangles }, "final gather");
        for (shape, solver) in [of_triangles, (Shape::Box { min_m, max_m }, "integrated")] {
            scene.obstacles = vec![Obstacle { shape, reflectance: 0.2 }];
            let solution = illuminance(&scene, &meters, Transport::Indirect(bounces), &accuracy(0.02)).unwrap();
            assert!(solution.solver.contains(solver), "{}", solution.solver);
            for (estimate, exact) in solution.estimates.iter().zip(&exact.estimates) {
                let error = (estimate.illuminance - exact.illuminance).value().abs();
                let bound = bound(estimate.uncertainty) + bound(exact.uncertainty);
                assert!(error <= bound, "{bounces:?}: {error} beyond {bound}");
                assert!(error <= 5e-3 * exact.illuminance.value(), "{bounces:?}: {error}");
            }
        }
    }
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
    let solution = illuminance(&s2(), &meters, converged, &accuracy(0.03)).unwrap();
    assert!(!solution.solver.contains("path tracing"), "{}", solution.solver);
    let mut errors = vec![];
    for (estimate, v) in solution.estimates.iter().zip(&truth) {
        let error = (estimate.illuminance.value() - v[2]).abs();
        let bound = bound(estimate.uncertainty);
        assert!(error <= bound + 3.0 * v[3], "{error} beyond {bound} at {} {}", v[0], v[1]);
        errors.push(error / v[2]);
    }
    errors.sort_by(f64::total_cmp);
    assert!(errors[92] <= 3e-3 && errors[183] <= 0.03, "median {}, worst {}", errors[92], errors[183]);
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

/// A dark slot between a wall and a body that stands on the floor, whose face ends within what large rectangles of the floor would cover.
#[test]
fn what_bodies_stand_on_lights_nothing() {
    let room = Room { size_m: DVec3::new(8.4, 5.0, 3.6), reflectance: Reflectances::with_equal_walls(0.5, 0.2, 0.5) };
    let even = LuminousIntensityDistribution::axial(vec![0.0, 90.0], vec![500.0, 500.0]).unwrap();
    let panel = LuminousOpening::Box { x_m: 0.6, y_m: 0.4, height_m: 0.0 };
    let scene = Scene {
        room: Some(room),
        obstacles: vec![cuboid([0.0, 0.205, 0.0], [1.408, 1.174, 1.147], 0.4)],
        luminaires: vec![
            luminaire(even.clone(), panel, DVec3::new(3.64, 3.59, 3.39)),
            luminaire(even, panel, DVec3::new(6.3, 2.07, 3.3)),
        ],
    };
    let meter = Meter { position_m: DVec3::new(0.04, 0.001, 0.17), normal: DVec3::NEG_Z };
    for bounces in [Bounces::AtMost(1), Bounces::Converged] {
        let light = Transport::Indirect(bounces);
        let found = illuminance(&scene, &[meter], light, &accuracy(0.02)).unwrap().estimates[0];
        let truth = certified(&scene, &[meter], light, &accuracy(0.01)).unwrap().estimates[0];
        let Uncertainty::StandardError { value: error, .. } = truth.uncertainty else { panic!("{truth:?}") };
        let off = (found.illuminance.value() - truth.illuminance.value()).abs();
        assert!(off <= bound(found.uncertainty) + 5.4 * error, "{bounces:?}: {found:?} for {truth:?}");
    }
}

/// Random places between two corners, the same for the same number.
fn places(mut drawn: u64) -> impl FnMut(DVec3, DVec3) -> DVec3 {
    move |low, high| {
        let mut next = || {
            drawn += 1;
            unit(mix(drawn))
        };
        low + (high - low) * DVec3::new(next(), next(), next())
    }
}

/// Shadows of luminaires without extent in random rooms of boxes, some of which hover, stand or hang: light reflected once is what the
/// integral over pieces both lit and seen says, which cuts by other planes and knows no polynomial.
#[test]
fn shadows_of_points_are_cut_as_another_cutter_cuts_them() {
    let (mut shaded, mut narrow, mut rooms) = (0, 0, 0);
    let all = by_night(10, 5);
    for k in 0..u64::from(all) {
        let mut place = places(1000 * k);
        let size_m = place(DVec3::new(3.0, 3.0, 2.4), DVec3::new(9.0, 7.0, 5.0));
        let reflectance = Reflectances::with_equal_walls(0.3, 0.5, 0.8);
        let mut scene = Scene { room: Some(Room { size_m, reflectance }), ..Scene::default() };
        for j in 0..=k % 3 {
            let (mut low, mut high) = (place(DVec3::ZERO, 0.7 * size_m), place(DVec3::splat(0.2), DVec3::splat(1.5)));
            high = (low + high).min(size_m - 0.1);
            if j % 2 == 0 {
                low.z = 0.0;
            }
            scene.obstacles.push(cuboid(low.to_array(), high.to_array(), 0.4));
        }
        let table = LuminousIntensityDistribution::axial(vec![0.0, 60.0, 120.0, 180.0], vec![90.0, 300.0, 200.0, 50.0]);
        for _ in 0..2 {
            let at_m = place(DVec3::splat(0.2), size_m - 0.2);
            scene.luminaires.push(luminaire(table.clone().unwrap(), LuminousOpening::Point, at_m));
        }
        let meters: Vec<Meter> = (0..6)
            .map(|j| {
                let near = if j % 3 == 0 { 1e-3 } else { 0.1 };
                let position_m = place(DVec3::splat(near), size_m - near);
                let position_m = if j % 3 == 0 { position_m.with_z(near) } else { position_m };
                Meter { position_m, normal: (place(DVec3::NEG_ONE, DVec3::ONE)).normalize() }
            })
            .collect();
        let holds = |b: &Obstacle, p: DVec3| match b.shape {
            Shape::Box { min_m, max_m } => p.cmpge(min_m).all() && p.cmple(max_m).all(),
            Shape::Mesh { .. } => false,
        };
        let lamps = scene.luminaires.iter().map(|lamp| lamp.position_m);
        let places: Vec<DVec3> = lamps.chain(meters.iter().map(|meter| meter.position_m)).collect();
        let is_inside = scene.obstacles.iter().any(|b| places.iter().any(|p| holds(b, *p)));
        let Some(once) = OnceReflected::new(&scene).filter(|_| !is_inside) else { continue };
        rooms += 1;
        let exact = once.illuminance(&meters, 1e-6, &Stop::NEVER);
        let mut enclosure = Enclosure::new(&scene).unwrap();
        let direct = vec![Bounded::NONE; meters.len()];
        let once = Bounces::AtMost(1);
        let (found, text) = enclosure.indirect(&meters, once, &direct, &accuracy(5e-3), &Stop::NEVER).unwrap();
        assert!(text.contains("balanced"), "{k}: {text}");
        scene.obstacles.clear();
        let bare = Transport::Indirect(once);
        let bare = illuminance(&scene, &meters, bare, &accuracy(1e-3)).unwrap().estimates;
        let all = found.iter().zip(&exact).zip(bare);
        // A hair off a surface the integral itself comes to no end, and says so.
        for ((found, exact), bare) in all.filter(|((_, exact), _)| exact.bound <= 1e-3 * exact.value) {
            let off = (found.value - exact.value).abs();
            assert!(off <= found.bound + exact.bound, "{k}: {found:?} for {exact:?}");
            narrow += u32::from(found.bound <= 5e-3 * found.value);
            shaded += u32::from((bare.illuminance.value() - exact.value).abs() > 0.05 * exact.value);
        }
    }
    assert!(2 * rooms >= all && 5 * shaded >= 6 * all && narrow >= 4 * rooms, "{shaded}, {narrow} in {rooms} rooms");
}

/// A table of kinks, whose light the nodes of large rectangles miss a mean of: light reflected once by the polynomials alone is what the
/// integral in the luminaire's own directions says, within what they are said to leave out, when they were cut short, too.
#[test]
fn what_polynomials_leave_out_of_kinks_has_a_mean_that_is_told() {
    let (mut told, mut all) = (0, 0);
    for k in 0..12_u64 {
        let mut place = places(500 * k);
        let size_m = place(DVec3::new(3.0, 3.0, 2.4), DVec3::new(9.0, 7.0, 5.0));
        let reflectance = Reflectances::with_equal_walls(0.3, 0.5, 0.8);
        let gamma = vec![0.0, 25.0, 26.0, 48.0, 50.0, 70.0, 71.0, 110.0, 111.0, 180.0];
        let candela = vec![100.0, 100.0, 400.0, 400.0, 90.0, 90.0, 700.0, 700.0, 50.0, 50.0];
        let table = LuminousIntensityDistribution::axial(gamma, candela).unwrap();
        let lamp = luminaire(table, LuminousOpening::Point, place(DVec3::splat(0.5), size_m - 0.5));
        let scene = Scene { room: Some(Room { size_m, reflectance }), obstacles: vec![], luminaires: vec![lamp] };
        let meters: Vec<Meter> = (0..6)
            .map(|_| {
                let position_m = place(DVec3::splat(0.3), size_m - 0.3);
                Meter { position_m, normal: place(DVec3::NEG_ONE, DVec3::ONE).normalize() }
            })
            .collect();
        let once = Transport::Indirect(Bounces::AtMost(1));
        let exact = illuminance(&scene, &meters, once, &accuracy(1e-6)).unwrap().estimates;
        let Enclosure { surroundings, emitters, .. } = &Enclosure::new(&scene).unwrap();
        let lights = Lights { surroundings, emitters };
        for looks in [None, Some(0), Some(4), Some(40)] {
            let cut_short = looks.map(|looks| &*Box::leak(Box::new(AtomicI64::new(looks))));
            let until = Stop { looks: cut_short, ..Stop::NEVER };
            let (lit, is_done) = Lit::new(&lights, 2e-2, &until, &Stop::NEVER);
            assert_eq!(is_done, looks.is_none());
            for (meter, exact) in meters.iter().zip(&exact) {
                let view = View { meter, occluders: &[], bicubic: &Bicubic::new() };
                let (lux, left) = lit.shown_of_all(&view, &surroundings.faces, 0.0);
                let off = (lux - exact.illuminance.value()).abs();
                let rounding = bound(exact.uncertainty) + 1e-6 * lux;
                assert!(off <= left.sum + rounding, "{k}, {looks:?}: {lux} is off by {off}, {} told", left.sum);
                if is_done {
                    told += u32::from(off > 0.02 * left.sum);
                    all += 1;
                }
            }
        }
    }
    assert!(told > all / 4, "what is told is fifty times too much at {} of {all}", all - told);
}

/// A panel, two points and two boxes, one of which stands on the floor: leaves of every kind.
fn furnished() -> Scene {
    let reflectance = Reflectances::with_equal_walls(0.2, 0.5, 0.7);
    let panel = LuminousOpening::Box { x_m: 0.6, y_m: 0.6, height_m: 0.0 };
    let table = || LuminousIntensityDistribution::axial(vec![0.0, 90.0, 180.0], vec![500.0, 100.0, 300.0]).unwrap();
    let lamp = |x: f64, opening| luminaire(table(), opening, DVec3::new(x, 2.0, 1.5));
    let luminaires = vec![lamp(1.0, panel), lamp(2.5, LuminousOpening::Point), lamp(4.0, LuminousOpening::Point)];
    let obstacles = vec![cuboid([1.5, 1.0, 0.0], [2.2, 2.5, 0.7], 0.4), cuboid([3.0, 1.0, 1.8], [3.6, 3.0, 2.0], 0.0)];
    Scene { room: Some(Room { size_m: DVec3::new(5.0, 4.0, 3.0), reflectance }), obstacles, luminaires }
}

#[test]
fn light_that_was_found_before_is_as_good_as_found_again() {
    let scene = furnished();
    let meters =
        [[0.5, 0.5, 0.8], [3.3, 2.0, 0.1]].map(|at_m| Meter { position_m: DVec3::from(at_m), normal: DVec3::Z });
    let accuracy = accuracy(2e-2);
    let prepared = |bounces| Prepared::new(&scene, Transport::Total(bounces), &accuracy).unwrap();
    let read = |mut prepared: Prepared| {
        let found = prepared.illuminance(&meters).unwrap().estimates;
        found.iter().map(|e| (e.illuminance.value(), bound(e.uncertainty))).collect::<Vec<_>>()
    };
    let mut first = prepared(Bounces::Converged);
    assert_eq!(first.groundwork(), None);
    first.illuminance(&meters).unwrap();
    let numbers = first.groundwork().unwrap();
    for bounces in [Bounces::Converged, Bounces::AtMost(2)] {
        let mut laid = prepared(bounces);
        assert!(laid.lay(&numbers) && laid.groundwork().is_none());
        assert_eq!(read(laid), read(prepared(bounces)));
    }
    // What is cut, goes on or says what cannot be is refused, and nothing that is taken ends or hangs a reading.
    let mut other = prepared(Bounces::Converged);
    assert!(!other.lay(&[]) && !other.lay(&[&numbers[..], &[0.0]].concat()));
    for k in 0..2000 {
        let at = mix(k) as usize % numbers.len();
        assert!(!other.lay(&numbers[..at]));
        let mut wrong = numbers.clone();
        wrong[at] = [f64::NAN, -1.0, 0.0, 1.0, 4.0, 0.5, 1e300][k as usize % 7];
        assert!(wrong[at].is_finite() || !other.lay(&wrong), "{at}");
        other.lay(&wrong);
    }
    let stopped = Stop { deadline: Some(std::time::Instant::now()), ..Stop::NEVER };
    let mut cut = prepared(Bounces::Converged);
    cut.illuminance_until(&meters, &stopped).ok();
    assert_eq!(cut.groundwork(), None, "light that was cut short is not light as asked");
}

#[test]
fn what_nodes_saw_of_rectangles_before_these_were_halved_is_as_good_as_seen_again() {
    let Enclosure { surroundings, emitters, .. } = Enclosure::new(&furnished()).unwrap();
    let lights = Lights { surroundings: &surroundings, emitters: &emitters };
    let (accuracy, bicubic) = (accuracy(2e-2), Bicubic::new());
    let (lit, _) = Lit::new(&lights, accuracy.relative_error, &Stop::NEVER, &Stop::NEVER);
    let occluders = surroundings.hiding().unwrap();
    let (bounces, stop) = (Bounces::Converged, &Stop::NEVER);
    let given = Given { lights, lit: &lit, occluders, bounces, accuracy, stop, bicubic: &bicubic };
    let cover = Cover::new(&surroundings);
    let coarse = cover.patches(&surroundings);
    let mut fine = coarse.clone();
    for k in (1..coarse.len()).step_by(3) {
        let [low, high] = cover.halves(&coarse[k], k % 2);
        fine[k] = low;
        fine.push(high);
    }
    let rows = |patches, before| Rows::of(&given, patches, before).unwrap();
    let (seen, seen_again) = (rows(&fine, rows(&coarse, Rows::default())), rows(&fine, Rows::default()));
    assert!(fine.len() > coarse.len() && seen.of_nodes.iter().any(|row| row.len() > 1));
    assert_eq!(seen.of_nodes, seen_again.of_nodes);
}
