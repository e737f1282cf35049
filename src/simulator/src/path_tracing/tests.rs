//! Laws of the path tracer: it agrees with converged values within its own interval, and no more often than it should.

use std::sync::Arc;

use approx::assert_relative_eq;
use glam::DVec3;

use super::test_scenes::*;
use super::*;
use luxproof_photometry::{LuminousIntensityDistribution, LuminousOpening};
use luxproof_scene::geometry::{Mesh, Reflectances, Room};
use luxproof_scene::{Luminaire, Obstacle, Shape, orientation};

/// Value and standard error in lux, at a fixed effort.
pub(super) fn solve(scene: &Scene, meters: &[Meter], transport: Transport, seed: u64, log2: u32) -> Vec<(f64, f64)> {
    let accuracy = Accuracy { relative_error: 0.0, seed };
    let solution =
        PathTracer::new(scene).unwrap().solve(meters, transport, &accuracy, log2..=log2, &Stop::NEVER).unwrap();
    solution.estimates.iter().map(value_and_error).collect()
}

fn value_and_error(estimate: &Estimate) -> (f64, f64) {
    match estimate.uncertainty {
        Uncertainty::StandardError { value, degrees_of_freedom: 7 } => (estimate.illuminance.value(), value),
        other => panic!("{other:?}"),
    }
}

pub(super) const CONVERGED: Transport = Transport::Indirect(Bounces::Converged);

#[test]
fn s1_agrees_with_the_converged_values() {
    for ((value, error), exact) in solve(&s1(), &s1_meters(), CONVERGED, 1, 14).iter().zip(S1_INDIRECT) {
        assert!((value - exact).abs() < 4.0 * error && *error < 2e-3 * exact, "{value} +- {error}, exact {exact}");
    }
}

#[test]
fn s2_agrees_with_the_converged_values() {
    let direct = solve(&s2(), &s2_meters(), Transport::Direct, 1, 12);
    let indirect = solve(&s2(), &s2_meters(), CONVERGED, 1, 12);
    for (v, (direct, indirect)) in S2_VALUES.iter().zip(direct.iter().zip(&indirect)) {
        assert!(
            (direct.0 - v[2]).abs() <= 4.0 * direct.1.hypot(3e-5 * v[2]),
            "direct at {} {}: {direct:?}",
            v[0],
            v[1]
        );
        assert!(
            (indirect.0 - v[3]).abs() <= 4.0 * indirect.1.hypot(v[4]),
            "indirect at {} {}: {indirect:?}",
            v[0],
            v[1]
        );
    }
}

/// How many of 200 seeded trials lie within half and within all of their own 95 % interval.
fn covered(trials: &[Vec<(f64, f64)>], meter: usize, exact: f64) -> [usize; 2] {
    [0.5, 1.0].map(|part| {
        let within = |t: &&Vec<(f64, f64)>| (t[meter].0 - exact).abs() <= part * STUDENT_T * t[meter].1;
        trials.iter().filter(within).count()
    })
}

/// Student's t with 7 degrees of freedom lies within half of its 95 % interval in 72 % of all cases.
fn assert_calibrated(trials: &[Vec<(f64, f64)>], exact: &[f64]) {
    for (meter, exact) in exact.iter().enumerate() {
        let [half, whole] = covered(trials, meter, *exact);
        assert!(whole >= 180, "meter {meter}: {whole} of 200 within the interval, {half} within half of it");
        assert!((120..=170).contains(&half), "meter {meter}: {half} of 200 within half the interval");
    }
}

#[test]
fn intervals_cover_the_converged_value_as_often_as_they_say() {
    let trials = |scene: &Scene, meters: &[Meter]| -> Vec<_> {
        (0..200).map(|seed| solve(scene, meters, CONVERGED, seed, 6)).collect()
    };
    assert_calibrated(&trials(&s1(), &s1_meters()), &S1_INDIRECT);
    assert_calibrated(&trials(&s2(), &s2_meters()), &S2_VALUES.map(|v| v[3]));
}

#[test]
fn intervals_still_cover_when_their_width_decides_where_to_stop() {
    let (scene, meters) = (s1(), s1_meters());
    let tracer = PathTracer::new(&scene).unwrap();
    let trial = |seed| {
        let solution =
            tracer.solve(&meters, CONVERGED, &Accuracy { relative_error: 0.02, seed }, 4..=12, &Stop::NEVER).unwrap();
        solution.estimates.iter().map(value_and_error).collect()
    };
    let trials: Vec<Vec<_>> = (0..200).map(trial).collect();
    for (meter, exact) in S1_INDIRECT.iter().enumerate() {
        let [_, whole] = covered(&trials, meter, *exact);
        assert!(whole >= 180, "meter {meter}: {whole} of 200");
        assert!(trials.iter().all(|t| STUDENT_T * t[meter].1 <= 0.02 * t[meter].0));
    }
}

#[test]
fn light_cut_after_n_reflections_is_what_a_renderer_that_stops_there_finds() {
    for (n, exact) in [(7, [0.93537, 1.14730, 1.14730, 1.41182]), (5, [0.91170, 1.12222, 1.12222, 1.38492])] {
        let found = solve(&s1(), &s1_meters(), Transport::Indirect(Bounces::AtMost(n)), 3, 12);
        for ((value, error), exact) in found.iter().zip(exact) {
            assert!((value - exact).abs() < 4.0 * error && *error < 3e-3 * exact, "{n}: {value} +- {error}, {exact}");
        }
    }
    let accuracy = Accuracy { relative_error: 0.1, seed: 1 };
    let none =
        illuminance(&s1(), &s1_meters(), Transport::Indirect(Bounces::AtMost(0)), &accuracy, &Stop::NEVER).unwrap();
    assert!(none.estimates.iter().all(|e| e.illuminance.value() == 0.0));
}

#[test]
fn light_straight_from_points_is_exact_and_triangles_hide_it() {
    let mut scene = s1();
    let Mesh { vertices_m, triangles } = Mesh::cuboid(DVec3::new(4.0, 4.0, 12.0), DVec3::new(8.0, 8.0, 12.5));
    scene.obstacles.push(Obstacle { shape: Shape::Mesh { vertices_m, triangles }, reflectance: 0.5 });
    let down = |x: f64, y: f64| Meter { position_m: DVec3::new(x, y, 17.0), normal: DVec3::NEG_Z };
    let meters = [down(2.0, 2.0), down(2.0, 10.0), down(10.0, 10.0)];
    let accuracy = Accuracy { relative_error: 0.1, seed: 1 };
    let found = illuminance(&scene, &meters, Transport::Direct, &accuracy, &Stop::NEVER).unwrap();
    for (estimate, exact) in found.estimates.iter().zip([0.0, 2.230931614869, 13.559183673469]) {
        assert!((estimate.illuminance.value() - exact).abs() <= 1e-12 * (1.0 + exact), "{estimate:?}");
        assert!(matches!(estimate.uncertainty, Uncertainty::Bound(bound) if bound < 1e-11), "{estimate:?}");
    }
}

#[test]
fn every_bit_is_the_same_on_any_number_of_threads() {
    let run = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| solve(&s2(), &s2_meters(), Transport::Total(Bounces::Converged), 5, 9))
    };
    let one = run(1);
    assert_eq!(one, run(3));
    assert_ne!(one, solve(&s2(), &s2_meters(), Transport::Total(Bounces::Converged), 6, 9));
}

/// The same scene with boxes as meshes and, in free field, the room as a mesh around it.
fn meshed(scene: &Scene) -> Scene {
    let mesh = |min_m, max_m| {
        let Mesh { vertices_m, triangles } = Mesh::cuboid(min_m, max_m);
        Shape::Mesh { vertices_m, triangles }
    };
    let mut obstacles = scene.obstacles.clone();
    for obstacle in &mut obstacles {
        if let Shape::Box { min_m, max_m } = obstacle.shape {
            obstacle.shape = mesh(min_m, max_m);
        }
    }
    let room = scene.room.filter(|r| room_mean(r) != r.reflectance.floor);
    if let (Some(hull), None) = (scene.room, room) {
        obstacles.push(Obstacle { shape: mesh(DVec3::ZERO, hull.size_m), reflectance: hull.reflectance.floor });
    }
    Scene { room, obstacles, luminaires: scene.luminaires.clone() }
}

#[test]
fn a_box_as_a_mesh_is_the_same_box() {
    let analytic = solve(&s2(), &s2_meters(), Transport::Total(Bounces::Converged), 1, 8);
    let triangles = solve(&meshed(&s2()), &s2_meters(), Transport::Total(Bounces::Converged), 1, 8);
    for ((a, _), (b, _)) in analytic.iter().zip(triangles) {
        assert_relative_eq!(*a, b, max_relative = 1e-6);
    }
}

#[test]
fn no_light_leaks_from_a_room_made_of_triangles() {
    let mut grey = s1();
    grey.room = grey.room.map(|r| Room { reflectance: Reflectances::with_equal_walls(0.9, 0.9, 0.9), ..r });
    let meshed = meshed(&grey);
    assert!(meshed.room.is_none());
    let (room, mesh) = (solve(&grey, &s1_meters(), CONVERGED, 1, 8), solve(&meshed, &s1_meters(), CONVERGED, 1, 8));
    for ((a, ea), (b, eb)) in room.iter().zip(mesh) {
        assert!((a - b).abs() < 4.0 * ea.hypot(eb), "{a} +- {ea}, {b} +- {eb}");
    }
}

/// Random places on every surface of a furnace, evenly by area, facing the light.
fn furnace_meters(scene: &Scene, count: u32) -> (Vec<Meter>, f64) {
    let mut faces: Vec<([DVec3; 3], DVec3)> = vec![];
    let mut add = |mesh: Mesh, side: f64| {
        for t in &mesh.triangles {
            let [a, b, c] = t.map(|v| mesh.vertices_m[v as usize]);
            faces.push(([a, b - a, c - a], side * (b - a).cross(c - a).normalize()));
        }
    };
    add(Mesh::cuboid(DVec3::ZERO, scene.room.unwrap().size_m), -1.0);
    for obstacle in &scene.obstacles {
        match obstacle.shape.clone() {
            Shape::Box { min_m, max_m } => add(Mesh::cuboid(min_m, max_m), 1.0),
            Shape::Mesh { vertices_m, triangles } => add(Mesh { vertices_m, triangles }, 1.0),
        }
    }
    let areas = faces.iter().map(|([_, b, c], _)| 0.5 * b.cross(*c).length());
    let cumulative: Vec<f64> = areas
        .scan(0.0, |sum, a| {
            *sum += a;
            Some(*sum)
        })
        .collect();
    let area_m2 = cumulative[cumulative.len() - 1];
    let meter = |index| {
        let mut sampler = Sampler::new(11, index);
        let at = sampler.next() * area_m2;
        let ([a, b, c], normal) = faces[cumulative.partition_point(|s| *s <= at)];
        let [u, v] = sampler.next_pair();
        let (u, v) = if u + v > 1.0 { (1.0 - u, 1.0 - v) } else { (u, v) };
        Meter { position_m: a + u * b + v * c, normal }
    };
    ((0..count).map(meter).collect(), area_m2)
}

#[test]
fn the_mean_illuminance_of_a_furnace_is_its_flux_over_its_absorption() {
    let isotropic = LuminousIntensityDistribution::axial(vec![0.0, 180.0], vec![50.0, 50.0]).unwrap();
    let sphere = LuminousOpening::Ellipsoid { x_m: 0.3, y_m: 0.3, z_m: 0.3 };
    let rho = 0.7;
    let Mesh { vertices_m, triangles } = Mesh::cuboid(DVec3::new(2.2, 1.0, 0.5), DVec3::new(3.0, 2.0, 1.5));
    let turn = orientation(20.0, 30.0, 0.0);
    let scene = Scene {
        room: Some(Room {
            size_m: DVec3::new(4.0, 3.0, 2.5),
            reflectance: Reflectances::with_equal_walls(rho, rho, rho),
        }),
        obstacles: vec![
            Obstacle {
                shape: Shape::Box { min_m: DVec3::new(0.5, 0.5, 0.3), max_m: DVec3::new(1.2, 2.0, 1.1) },
                reflectance: rho,
            },
            Obstacle {
                shape: Shape::Mesh {
                    vertices_m: vertices_m
                        .iter()
                        .map(|v| turn * (*v - 2.0) * 0.6 + DVec3::new(2.6, 1.4, 1.4))
                        .collect(),
                    triangles,
                },
                reflectance: rho,
            },
        ],
        luminaires: vec![
            luminaire(isotropic.clone(), LuminousOpening::Point, DVec3::new(1.7, 2.4, 1.9)),
            luminaire(isotropic, sphere, DVec3::new(3.5, 0.4, 0.5)),
        ],
    };
    let (meters, area_m2) = furnace_meters(&scene, 2048);
    let found = solve(&scene, &meters, Transport::Total(Bounces::Converged), 1, 3);
    let n = found.len() as f64;
    let mean = found.iter().map(|f| f.0).sum::<f64>() / n;
    let error = (found.iter().map(|f| (f.0 - mean).powi(2)).sum::<f64>() / n / (n - 1.0)).sqrt();
    let exact = 2.0 * 4.0 * std::f64::consts::PI * 50.0 / (area_m2 * (1.0 - rho));
    assert!((mean - exact).abs() < 4.0 * error && error < 0.015 * exact, "{mean} +- {error}, exact {exact}");
}

/// Light of an isotropic point of 1 cd, `h` below a reflecting ceiling, on the floor beneath it after one reflection.
///
/// In polar coordinates about the point, with E = h / (r^2 + h^2)^(3/2) and the factor d^2 / (pi (r^2 + d^2)^2).
fn one_reflection(h: f64, d: f64) -> f64 {
    let steps = 200_000;
    let inner = |k: i32| {
        // r = h tan a spreads the peak evenly.
        let a = std::f64::consts::FRAC_PI_2 * (f64::from(k) + 0.5) / f64::from(steps);
        let r2 = (h * a.tan()).powi(2);
        h / (r2 + h * h).powf(1.5) * d * d / (r2 + d * d).powi(2) * 2.0 * h * a.tan() * h / a.cos().powi(2)
    };
    (0..steps).map(inner).sum::<f64>() * std::f64::consts::FRAC_PI_2 / f64::from(steps)
}

#[test]
fn a_luminaire_a_centimetre_below_the_ceiling_keeps_its_interval_honest() {
    let isotropic = LuminousIntensityDistribution::axial(vec![0.0, 180.0], vec![1.0, 1.0]).unwrap();
    for h in [0.01, 1e-4] {
        let size = 400.0;
        let scene = Scene {
            room: Some(Room {
                size_m: DVec3::new(size, size, 3.0),
                reflectance: Reflectances { ceiling: 1.0, ..Reflectances::with_equal_walls(0.0, 0.0, 0.0) },
            }),
            obstacles: vec![],
            luminaires: vec![luminaire(isotropic.clone(), LuminousOpening::Point, DVec3::new(200.0, 200.0, 3.0 - h))],
        };
        let exact = one_reflection(h, 3.0);
        let meter = [up(200.0, 200.0, 0.0)];
        let tracer = PathTracer::new(&scene).unwrap();
        assert_eq!(tracer.close, [true]);
        let trials: Vec<_> = (0..200).map(|seed| solve(&scene, &meter, CONVERGED, seed, FIRST_LOG2)).collect();
        let [_, whole] = covered(&trials, 0, exact);
        assert!(whole >= 180, "{whole} of 200 within the interval at {h} m");
        assert!(trials.iter().all(|t| t[0].1 < 0.01 * exact));
    }
}

#[test]
fn relative_results_do_not_depend_on_the_scale() {
    let reference = solve(&s2(), &s2_meters(), Transport::Total(Bounces::Converged), 1, 6);
    for scale in [1e-6, 1e-3, 1e6] {
        let mut scene = s2();
        scene.room = scene.room.map(|r| Room { size_m: r.size_m * scale, ..r });
        for obstacle in &mut scene.obstacles {
            match &mut obstacle.shape {
                Shape::Box { min_m, max_m } => (*min_m, *max_m) = (*min_m * scale, *max_m * scale),
                Shape::Mesh { vertices_m, .. } => *vertices_m = vertices_m.iter().map(|v| *v * scale).collect(),
            }
        }
        for luminaire in &mut scene.luminaires {
            let mut photometry = (*luminaire.photometry).clone();
            photometry.opening = LuminousOpening::Box { x_m: 0.6 * scale, y_m: 0.6 * scale, height_m: 0.0 };
            luminaire.photometry = Arc::new(photometry);
            luminaire.position_m *= scale;
            luminaire.flux_scale = scale * scale;
        }
        let meters: Vec<_> = s2_meters().iter().map(|m| Meter { position_m: m.position_m * scale, ..*m }).collect();
        for (a, b) in reference.iter().zip(solve(&scene, &meters, Transport::Total(Bounces::Converged), 1, 6)) {
            assert_relative_eq!(a.0, b.0, max_relative = 1e-9);
        }
    }
}

#[test]
fn turned_asymmetric_luminaires_agree_with_the_deterministic_solver() {
    let planes = vec![0.0, 45.0, 90.0, 135.0, 180.0];
    let gamma = vec![0.0, 30.0, 60.0, 90.0, 150.0];
    let candela = (0..25).map(|k| [400.0, 300.0, 150.0, 20.0, 0.0][k % 5] * (1.0 + 0.3 * (k / 5) as f64)).collect();
    let lamp = LuminousIntensityDistribution::new(planes, gamma, candela).unwrap();
    let mut scene = s1();
    scene.room = Some(Room {
        size_m: DVec3::new(7.0, 4.0, 3.0),
        reflectance: Reflectances {
            floor: 0.3,
            ceiling: 0.85,
            wall_x_min: 0.1,
            wall_x_max: 0.6,
            wall_y_min: 0.5,
            wall_y_max: 0.0,
        },
    });
    scene.luminaires = [([2.0, 1.0, 2.2], 30.0, 15.0), ([5.5, 2.5, 1.6], 200.0, 130.0)]
        .map(|(at, azimuth, tilt)| {
            let upright = luminaire(lamp.clone(), LuminousOpening::Point, DVec3::from(at));
            Luminaire { orientation: orientation(azimuth, tilt, 70.0), ..upright }
        })
        .to_vec();
    let meters = [up(1.0, 3.0, 0.8), Meter { position_m: DVec3::new(6.9, 2.0, 1.2), normal: DVec3::NEG_X }];
    let accuracy = Accuracy { relative_error: 1e-4, seed: 1 };
    for transport in [CONVERGED, Transport::Total(Bounces::AtMost(2))] {
        let exact = crate::illuminance(&scene, &meters, transport, &accuracy).unwrap();
        assert!(exact.estimates.iter().all(|e| matches!(e.uncertainty, Uncertainty::Bound(_))));
        let exact: Vec<f64> = exact.estimates.iter().map(|e| e.illuminance.value()).collect();
        let trials: Vec<_> = (0..200).map(|seed| solve(&scene, &meters, transport, seed, 6)).collect();
        assert_calibrated(&trials, &exact);
    }
}

#[test]
fn what_cannot_be_traced_is_refused_with_the_reason() {
    let accuracy = Accuracy { relative_error: 0.1, seed: 1 };
    let refusal = |scene: &Scene, meter: Meter| {
        illuminance(scene, &[meter], CONVERGED, &accuracy, &Stop::NEVER).unwrap_err().to_string()
    };
    let inside = up(2.0, 2.0, 2.0);
    for (meter, expected) in [
        (up(2.0, 2.0, -1.0), "outside the room"),
        (Meter { position_m: DVec3::new(2.0, 2.0, 0.0), normal: DVec3::X }, "right angle"),
        (up(f64::NAN, 2.0, 2.0), "finite"),
        (Meter { normal: DVec3::ZERO, ..inside }, "unit normal"),
        (up(10.0, 10.0, 10.0), "centre of a luminaire"),
    ] {
        let message = refusal(&s1(), meter);
        assert!(message.contains(expected) && message.contains("meter 0"), "{message}");
    }
    let mut bright = s1();
    bright.room = bright.room.map(|r| Room { reflectance: Reflectances::with_equal_walls(1.0, 1.0, 1.0), ..r });
    assert!(refusal(&bright, inside).contains("mean reflectance"));
    let mut beyond = s1();
    beyond.room = beyond.room.map(|r| Room { reflectance: Reflectances::with_equal_walls(1.5, 0.5, 0.5), ..r });
    assert!(refusal(&beyond, inside).contains("reflectance of 1.5"));
    let mut broken = s2();
    broken.obstacles.push(Obstacle {
        shape: Shape::Mesh { vertices_m: vec![DVec3::ZERO; 3], triangles: vec![[0, 1, 7]] },
        reflectance: 0.5,
    });
    assert!(refusal(&broken, inside).contains("mesh"));
}

#[test]
fn what_a_flush_opening_sends_into_its_own_surface_is_lost() {
    let at_m = DVec3::new(2.0, 2.0, 3.0);
    let gamma_deg = vec![0.0, 89.0, 91.0, 180.0];
    let reflected = |above: f64| {
        let candela = vec![500.0, 500.0, above, above];
        let opening = LuminousOpening::Box { x_m: 0.6, y_m: 0.6, height_m: 0.0 };
        let lamp = luminaire(LuminousIntensityDistribution::axial(gamma_deg.clone(), candela).unwrap(), opening, at_m);
        let room =
            Room { size_m: DVec3::new(5.0, 4.0, 3.0), reflectance: Reflectances::with_equal_walls(0.5, 0.5, 0.8) };
        let scene = Scene { room: Some(room), obstacles: vec![back(at_m)], luminaires: vec![lamp] };
        solve(&scene, &[up(2.0, 2.0, 1.0)], CONVERGED, 1, 12)[0]
    };
    let ([(dark, a), (bright, b)], allowed) = ([0.0, 500.0].map(reflected), 5.4);
    // Near the horizon both shine into the room alike but for a degree.
    assert!((dark - bright).abs() < allowed * a.hypot(b) + 0.01 * dark, "{dark} +- {a}, {bright} +- {b}");
}
