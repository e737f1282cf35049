//! Laws that an empty box must obey.

use std::f64::consts::PI;
use std::sync::Arc;

use approx::assert_relative_eq;
use glam::{DMat3, DVec3};

use crate::box_room::first_bounce::FirstBounce;
use crate::box_room::grid::Grid;
use crate::box_room::symmetry::Symmetries;
use crate::box_room::{BoxField, EFFORTS, Effort, EmptyRoom, First, Request, error};
use crate::by_night;
use crate::path_tracing::test_scenes;
use crate::quadrature::Gauss;
use crate::{Accuracy, Bounded, Estimate, Prepared, Stop, Uncertainty, illuminance};
use luxproof_photometry::{LuminousIntensityDistribution, Photometry};
use luxproof_scene::geometry::{Reflectances, Room};
use luxproof_scene::{Bounces, Luminaire, LuminaireModel, Meter, Scene, Transport, orientation};

pub(super) fn point(position_m: DVec3, distribution: LuminousIntensityDistribution) -> Luminaire {
    let photometry = Photometry::of(distribution);
    Luminaire {
        id: "a".into(),
        photometry: Arc::new(photometry),
        position_m,
        orientation: DMat3::IDENTITY,
        flux_scale: 1.0,
        model: LuminaireModel::Point,
    }
}

/// 1000 cd on its axis and a power of the cosine downwards, every five degrees.
pub(super) fn downlight(power: f64) -> LuminousIntensityDistribution {
    let gamma: Vec<f64> = (0..=36).map(|k| 5.0 * f64::from(k)).collect();
    let candela = gamma.iter().map(|g| 1000.0 * g.to_radians().cos().max(0.0).powf(power)).collect();
    LuminousIntensityDistribution::axial(gamma, candela).unwrap()
}

pub(super) fn s1() -> (Scene, Vec<Meter>) {
    (test_scenes::s1(), test_scenes::s1_meters())
}

#[test]
fn s1_lies_within_its_bound_at_every_accuracy_and_bounce_count() {
    let (scene, meters) = s1();
    let converged = [0.94314714, 1.15551735, 1.15551735, 1.42062868];
    let first = [0.4827964416, 0.6295558520, 0.6295558520, 0.8360829517];
    let seven = [0.93537, 1.14730, 1.14730, 1.41182];
    let five = [0.91170, 1.12222, 1.12222, 1.38492];
    for (bounces, published, rounding) in [
        (Bounces::Converged, converged, 5e-8),
        (Bounces::AtMost(1), first, 1e-10),
        (Bounces::AtMost(7), seven, 1e-5),
        (Bounces::AtMost(5), five, 1e-5),
        (Bounces::AtMost(0), [0.0; 4], 0.0),
    ] {
        for relative_error in [1e-2, 1e-3, 1e-4, 1e-5] {
            let accuracy = Accuracy { relative_error, seed: 1 };
            let solution = illuminance(&scene, &meters, Transport::Indirect(bounces), &accuracy).unwrap();
            for (estimate, truth) in solution.estimates.iter().zip(published) {
                let Uncertainty::Bound(bound) = estimate.uncertainty else { panic!("no bound") };
                let error = (estimate.illuminance.value() - truth).abs();
                assert!(error <= bound + rounding, "{bounces:?} {relative_error}: {error} beyond {bound}");
                assert!(bound <= relative_error * truth, "{bounces:?} {relative_error}: {bound}");
            }
        }
    }
}

fn accuracy(relative_error: f64) -> Accuracy {
    Accuracy { relative_error, seed: 1 }
}

/// Values and bounds of converged indirect light.
fn indirect(scene: &Scene, meters: &[Meter], relative_error: f64) -> Vec<(f64, f64)> {
    let converged = Transport::Indirect(Bounces::Converged);
    let solution = illuminance(scene, meters, converged, &accuracy(relative_error)).unwrap();
    solution.estimates.iter().map(pair).collect()
}

/// Converged indirect light in a room that keeps what it solves.
pub(super) fn bounded(solved: &mut EmptyRoom, scene: &Scene, meters: &[Meter], relative_error: f64) -> Vec<Bounded> {
    let (room, luminaires) = (scene.room.unwrap(), &scene.luminaires);
    let (bounces, stop) = (Bounces::Converged, &Stop::NEVER);
    solved.indirect(&Request { room: &room, luminaires, bounces, meters, relative_error, stop }).unwrap().0
}

fn pair(estimate: &Estimate) -> (f64, f64) {
    let Uncertainty::Bound(bound) = estimate.uncertainty else { panic!("{estimate:?} has no bound") };
    (estimate.illuminance.value(), bound)
}

/// Random numbers within 0..1, the same on every machine.
pub(super) struct Random(pub(super) u64);

impl Random {
    pub(super) fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (self.0 >> 33) as f64 / (1_u64 << 31) as f64
    }

    fn within(&mut self, low: f64, high: f64) -> DVec3 {
        DVec3::from_array([(); 3].map(|()| low + (high - low) * self.next()))
    }
}

/// A room with six reflectances and a turned luminaire whose table starts and ends with a step.
pub(super) fn random_scene(random: &mut Random) -> (Scene, Vec<Meter>) {
    let size_m = random.within(2.0, 6.0);
    let [floor, ceiling, wall_x_min, wall_x_max, wall_y_min, wall_y_max] = [(); 6].map(|()| 0.9 * random.next());
    let reflectance = Reflectances { floor, ceiling, wall_x_min, wall_x_max, wall_y_min, wall_y_max };
    let c_deg = vec![0.0, 90.0, 180.0, 270.0, 360.0];
    let gamma_deg = vec![10.0, 40.0, 75.0, 110.0];
    let mut candela: Vec<f64> = (0..16).map(|_| 100.0 * random.next()).collect();
    candela.extend_from_within(..4);
    let distribution = LuminousIntensityDistribution::new(c_deg, gamma_deg, candela).unwrap();
    let mut luminaire = point(size_m * random.within(0.1, 0.9), distribution);
    let [azimuth, tilt, roll] = random.within(0.0, 360.0).to_array();
    luminaire.orientation = orientation(azimuth, tilt, roll);
    let meters = (0..6).map(|_| Meter {
        position_m: size_m * random.within(0.01, 0.99),
        normal: (random.within(-1.0, 1.0) + DVec3::splat(1e-3)).normalize(),
    });
    let meters = meters.collect();
    (Scene { room: Some(Room { size_m, reflectance }), obstacles: vec![], luminaires: vec![luminaire] }, meters)
}

#[test]
fn bounds_hold_in_random_rooms_against_higher_orders() {
    let mut random = Random(7);
    let mut tight = 0;
    for case in 0..16 {
        let (scene, meters) = random_scene(&mut random);
        let truths = solve(&scene, &EFFORTS[4]).illuminance(&meters, &Stop::NEVER).unwrap();
        let mut solved = EmptyRoom::default();
        for relative_error in [0.5, 0.03, 0.01] {
            let found = bounded(&mut solved, &scene, &meters, relative_error);
            for (truth, Bounded { value, bound }) in truths.iter().zip(found) {
                // The higher order errs by less than 5e-4 itself.
                let error = (value - truth).abs();
                assert!(error <= bound + 5e-4 * truth, "case {case}: {error} of {truth} beyond {bound}");
                tight += usize::from(error > 0.02 * bound);
            }
        }
    }
    assert!(tight > 60, "bounds are a hundred times too wide: {tight} errors of 288 above a fiftieth");
}

/// Where two surfaces meet, no order helps much, and two may agree on what both are off by.
#[test]
fn bounds_hold_a_millimetre_from_edges_and_in_corners() {
    let mut random = Random(23);
    for case in 0..3 {
        let (mut scene, _) = random_scene(&mut random);
        let size_m = scene.room.unwrap().size_m;
        scene.luminaires = vec![point(size_m * DVec3::new(0.3, 0.6, 0.9), downlight(2.0))];
        let normals = [DVec3::X, DVec3::Y, DVec3::Z, DVec3::ONE.normalize(), DVec3::NEG_X];
        let distances =
            [DVec3::splat(1e-3), DVec3::new(1e-3, 2e-3, 1.0), DVec3::new(0.01, 0.01, 1.4), DVec3::splat(0.03)];
        let meters: Vec<_> =
            distances.into_iter().flat_map(|position_m| normals.map(|normal| Meter { position_m, normal })).collect();
        let finer = Effort { order: 10, ..EFFORTS[7] };
        let truths = solve(&scene, &finer).illuminance(&meters, &Stop::NEVER).unwrap();
        let mut solved = EmptyRoom::default();
        for asked in [1e-2, 1e-3] {
            for (truth, Bounded { value, bound }) in truths.iter().zip(bounded(&mut solved, &scene, &meters, asked)) {
                assert!(
                    (value - truth).abs() <= bound + 2e-6 * truth,
                    "case {case}: {value} of {truth} beyond {bound}"
                );
            }
        }
    }
}

/// Mirrors make one place of several; where there are none, one place has all its images.
#[test]
fn probes_are_as_many_different_places_whatever_the_light() {
    let size_m = DVec3::new(4.0, 6.0, 3.0);
    for mirrors in [&[0][..], &[0, 1], &[0, 3], &[0, 1, 2, 3], &[0, 1, 2, 3, 4, 5, 6, 7]] {
        let all = error::probes(size_m, mirrors);
        assert_eq!(all.len(), 8);
        for (k, a) in all.iter().enumerate() {
            assert!((a.normal.length() - 1.0).abs() < 1e-12 && a.position_m.cmpgt(DVec3::ZERO).all());
            for mirror in mirrors {
                let sign = DVec3::from_array([0, 1, 2].map(|axis| if mirror >> axis & 1 == 1 { -1.0 } else { 1.0 }));
                let image_m = 0.5 * size_m + sign * (a.position_m - 0.5 * size_m);
                assert!(all[k + 1..].iter().all(|b| (image_m - b.position_m).length() > 0.02), "{a:?} {all:?}");
            }
        }
    }
}

#[test]
fn a_meter_reads_the_same_in_any_company() {
    let (scene, meters) = random_scene(&mut Random(19));
    for asked in [1e-1, 1e-2] {
        let together = indirect(&scene, &meters, asked);
        for (meter, with_others) in meters.iter().zip(together) {
            let alone = indirect(&scene, std::slice::from_ref(meter), asked)[0];
            assert_eq!(alone, with_others);
        }
    }
}

#[test]
fn a_mirrored_room_reads_the_same() {
    let (scene, meters) = random_scene(&mut Random(6));
    let Room { size_m, reflectance: r } = scene.room.unwrap();
    let mirror = DVec3::new(-1.0, 1.0, 1.0);
    let far_m = DVec3::new(size_m.x, 0.0, 0.0);
    let mut mirrored = scene.clone();
    let reflectance = Reflectances { wall_x_min: r.wall_x_max, wall_x_max: r.wall_x_min, ..r };
    mirrored.room = Some(Room { size_m, reflectance });
    // A table whose planes run the other way round, turned to face the other way.
    let table = &scene.luminaires[0].photometry.distribution;
    let candela = (0..5).flat_map(|c| table.plane(4 - c).to_vec()).collect();
    let flipped = LuminousIntensityDistribution::new(table.c_deg().to_vec(), table.gamma_deg().to_vec(), candela);
    let orientation = DMat3::from_diagonal(mirror)
        * scene.luminaires[0].orientation
        * DMat3::from_diagonal(DVec3::new(1.0, -1.0, 1.0));
    let at = far_m + mirror * scene.luminaires[0].position_m;
    mirrored.luminaires = vec![Luminaire { orientation, ..point(at, flipped.unwrap()) }];
    let images = meters.iter().map(|m| Meter { position_m: far_m + mirror * m.position_m, normal: mirror * m.normal });
    let images: Vec<_> = images.collect();
    let pairs = indirect(&scene, &meters, 0.03);
    for ((value, _), (expected, _)) in indirect(&mirrored, &images, 0.03).iter().zip(&pairs) {
        assert_relative_eq!(value, expected, max_relative = 1e-9);
    }
}

#[test]
fn scale_changes_lux_by_its_square_alone() {
    let (mut scene, _) = s1();
    let size_m = DVec3::new(4.0, 5.0, 3.0);
    scene.room = scene.room.map(|room| Room { size_m, ..room });
    scene.luminaires[0].position_m = DVec3::new(1.3, 2.1, 1.2);
    scene.luminaires[0].orientation = orientation(30.0, 20.0, 0.0);
    let normal = DVec3::new(0.1, 0.2, 1.0).normalize();
    let meters = [[1.0, 1.0, 0.8], [0.03, 2.0, 1.7], [3.9, 4.9, 0.1]]
        .map(|at_m| Meter { position_m: DVec3::from(at_m), normal });
    let reference = indirect(&scene, &meters, 1e-3);
    for scale in [1e-6, 1e-3, 1e6] {
        let mut scaled = scene.clone();
        scaled.room = scene.room.map(|room| Room { size_m: room.size_m * scale, ..room });
        scaled.luminaires[0].position_m *= scale;
        let meters: Vec<_> = meters.iter().map(|m| Meter { position_m: m.position_m * scale, ..*m }).collect();
        for ((value, _), (expected, _)) in indirect(&scaled, &meters, 1e-3).iter().zip(&reference) {
            assert_relative_eq!(value * scale * scale, *expected, max_relative = 1e-9);
        }
    }
}

/// x to y, y to z, z to x: a room laid on its side.
fn turn(p: DVec3) -> DVec3 {
    DVec3::new(p.z, p.x, p.y)
}

#[test]
fn a_room_turned_as_a_whole_reads_the_same() {
    let (scene, meters) = random_scene(&mut Random(5));
    let mut turned = scene.clone();
    let Room { size_m, reflectance: r } = scene.room.unwrap();
    let reflectance = Reflectances {
        floor: r.wall_y_min,
        ceiling: r.wall_y_max,
        wall_x_min: r.floor,
        wall_x_max: r.ceiling,
        wall_y_min: r.wall_x_min,
        wall_y_max: r.wall_x_max,
    };
    turned.room = Some(Room { size_m: turn(size_m), reflectance });
    let luminaire = &mut turned.luminaires[0];
    luminaire.position_m = turn(luminaire.position_m);
    luminaire.orientation = DMat3::from_cols(DVec3::Y, DVec3::Z, DVec3::X) * luminaire.orientation;
    let turned_meters: Vec<_> =
        meters.iter().map(|m| Meter { position_m: turn(m.position_m), normal: turn(m.normal) }).collect();
    let pairs = indirect(&scene, &meters, 0.03);
    for ((value, _), (expected, _)) in indirect(&turned, &turned_meters, 0.03).iter().zip(&pairs) {
        assert_relative_eq!(value, expected, max_relative = 1e-9);
    }
}

#[test]
fn a_luminaire_turned_against_its_table_turned_back_reads_the_same() {
    let [table, table_turned] = [0, 2].map(|shift| {
        let c_deg = (0..=8).map(|k| 45.0 * f64::from(k)).collect();
        let planes = (0..9).map(|c| (c + shift) % 8);
        let candela = planes.flat_map(|c| [200.0, 100.0 + 10.0 * f64::from(c), 20.0, 0.0]).collect();
        LuminousIntensityDistribution::new(c_deg, vec![0.0, 30.0, 60.0, 90.0], candela).unwrap()
    });
    let room = Room { size_m: DVec3::new(4.0, 5.0, 3.0), reflectance: Reflectances::with_equal_walls(0.2, 0.5, 0.8) };
    let at = DVec3::new(1.5, 2.0, 2.4);
    let plain = Scene { room: Some(room), obstacles: vec![], luminaires: vec![point(at, table)] };
    let mut turned = Scene { luminaires: vec![point(at, table_turned)], ..plain.clone() };
    turned.luminaires[0].orientation = orientation(90.0, 0.0, 0.0);
    let meters = [Meter { position_m: DVec3::new(1.0, 1.0, 0.8), normal: DVec3::Z }];
    let (plain, turned) = (indirect(&plain, &meters, 0.01), indirect(&turned, &meters, 0.01));
    assert_relative_eq!(plain[0].0, turned[0].0, max_relative = 1e-9);
}

pub(super) fn solve(scene: &Scene, effort: &Effort) -> BoxField {
    let (room, luminaires) = (scene.room.unwrap(), &scene.luminaires);
    let first = First::Few(FirstBounce::new(&room, luminaires, effort));
    BoxField::solve(
        &room,
        first,
        &Symmetries::of(&room, luminaires, &Stop::NEVER).unwrap(),
        Bounces::Converged,
        effort,
        &Stop::NEVER,
    )
    .unwrap()
}

/// Area-mean indirect illuminance of a 4 m cube of one reflectance with 10 000 lm at its centre, from the nodes.
fn furnace_mean(rho: f64, effort: &Effort) -> f64 {
    let isotropic = LuminousIntensityDistribution::axial(vec![0.0, 180.0], vec![10_000.0 / (4.0 * PI); 2]).unwrap();
    let room = Room { size_m: DVec3::splat(4.0), reflectance: Reflectances::with_equal_walls(rho, rho, rho) };
    let luminaires = vec![point(DVec3::splat(2.0), isotropic)];
    solve(&Scene { room: Some(room), obstacles: vec![], luminaires }, effort).mean_exitance() / rho
}

#[test]
fn interreflection_in_a_cube_is_phi_rho_over_area_times_absorption() {
    for (rho, published) in [(0.05, 5.482), (0.5, 104.167), (0.95, 1979.17)] {
        assert_relative_eq!(furnace_mean(rho, &EFFORTS[4]), published, max_relative = 1e-4);
    }
    for (rho, tolerance) in [(0.05, 1e-9_f64), (0.5, 1e-9), (0.95, 1e-9), (0.999, 1e-9), (1.0 - 1e-9, 1e-6)] {
        let exact = 10_000.0 / 96.0 * rho / (1.0 - rho);
        // Rules of the first bounce measure its flux the more closely the higher the order.
        for (effort, flux) in EFFORTS[1..6].iter().zip([1e-5, 1e-6, 1e-7, 1e-9, 1e-9]) {
            assert_relative_eq!(furnace_mean(rho, effort), exact, max_relative = tolerance.max(flux));
        }
    }
}

/// Corners lose light at any order; three elements at each edge, which no effort has, know it ten times more closely.
#[test]
fn light_lost_in_corners_is_given_back_where_it_belongs() {
    let (scene, meters) = s1();
    let finer = Effort { at_edge: 3, ..EFFORTS[7] };
    let [finest, finer] =
        [&EFFORTS[7], &finer].map(|effort| solve(&scene, effort).illuminance(&meters, &Stop::NEVER).unwrap());
    for (value, truth) in finest.iter().zip(&finer) {
        assert_relative_eq!(value, truth, max_relative = 2e-8);
    }
}

/// CIE 171 case 5.4: what a black room collects is what is emitted in it.
#[test]
fn a_black_room_collects_the_flux_that_is_emitted_in_it() {
    let isotropic = LuminousIntensityDistribution::axial(vec![0.0, 180.0], vec![10_000.0 / (4.0 * PI); 2]).unwrap();
    let room = Room { size_m: DVec3::new(4.0, 4.0, 3.0), reflectance: Reflectances::with_equal_walls(0.0, 0.0, 0.0) };
    let luminaires = vec![point(DVec3::new(2.0, 2.0, 1.5), isotropic)];
    let scene = Scene { room: Some(room), obstacles: vec![], luminaires };
    let rule = Gauss::new(24);
    let (mut meters, mut areas) = (vec![], vec![]);
    for (axis, far) in (0..3).flat_map(|axis| [(axis, false), (axis, true)]) {
        let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
        for (i, j) in (0..24).flat_map(|i| (0..24).map(move |j| (i, j))) {
            let mut position_m = DVec3::ZERO;
            position_m[u] = rule.nodes[i] * room.size_m[u];
            position_m[v] = rule.nodes[j] * room.size_m[v];
            // A nanometre off the surface.
            position_m[axis] = if far { room.size_m[axis] - 1e-9 } else { 1e-9 };
            meters.push(Meter { position_m, normal: DVec3::AXES[axis] * if far { -1.0 } else { 1.0 } });
            areas.push(rule.weights[i] * rule.weights[j] * room.size_m[u] * room.size_m[v]);
        }
    }
    for transport in [Transport::Direct, Transport::Total(Bounces::Converged)] {
        let found = illuminance(&scene, &meters, transport, &accuracy(1e-6)).unwrap();
        let flux: f64 = found.estimates.iter().zip(&areas).map(|(e, area)| e.illuminance.value() * area).sum();
        assert_relative_eq!(flux, 10_000.0, max_relative = 1e-8);
    }
}

#[test]
fn direct_light_of_a_lambertian_point_is_i0_h2_over_d4() {
    let gamma: Vec<f64> = (0..=9000).map(|k| 0.01 * f64::from(k)).collect();
    let candela = gamma.iter().map(|g| 1000.0 * g.to_radians().cos().max(0.0)).collect();
    let source = point(DVec3::new(0.0, 0.0, 3.0), LuminousIntensityDistribution::axial(gamma, candela).unwrap());
    let scene = Scene { room: None, obstacles: vec![], luminaires: vec![source] };
    let offsets = [(0.0, 0.0), (0.5, 0.0), (1.0, 0.0), (1.5, 0.0), (0.5, 0.5), (1.0, 0.5), (1.5, 1.5)];
    let meters = offsets.map(|(x, y)| Meter { position_m: DVec3::new(x, y, 0.0), normal: DVec3::Z });
    let solution = illuminance(&scene, &meters, Transport::Total(Bounces::Converged), &accuracy(1e-6)).unwrap();
    for ((x, y), estimate) in offsets.into_iter().zip(&solution.estimates) {
        let d2 = x * x + y * y + 9.0;
        // A chord of the cosine over a hundredth of a degree errs by 4e-9.
        assert_relative_eq!(estimate.illuminance.value(), 9000.0 / (d2 * d2), max_relative = 4e-9);
    }
}

/// A meter at a height, off the middle of case S1.
fn near(z: f64) -> [Meter; 1] {
    [Meter { position_m: DVec3::new(3.0, 4.0, z), normal: DVec3::Z }]
}

#[test]
fn light_near_a_surface_or_flush_with_it_is_solved_or_refused() {
    let (mut scene, _) = s1();
    // An uplight closer and closer to the ceiling lights a spot of the same flux.
    scene.luminaires[0].position_m.z = 20.0 - 1e-3;
    let spot = indirect(&scene, &near(1.0), 0.01)[0];
    scene.luminaires[0].position_m.z = 20.0 - 1e-6;
    let tighter = indirect(&scene, &near(1.0), 0.01)[0];
    assert!((spot.0 - tighter.0).abs() <= 1e-3 * spot.0 + spot.1 + tighter.1, "{spot:?} {tighter:?}");
    assert!(spot.0 > 0.5, "{spot:?}");
    // A meter closer and closer to the floor converges.
    let (close, closer) = (indirect(&scene, &near(1e-3), 0.01)[0], indirect(&scene, &near(1e-9), 0.01)[0]);
    assert!((close.0 - closer.0).abs() <= 1e-3 * close.0, "{close:?} {closer:?}");
    for meters in [near(0.0), near(f64::NAN), near(21.0)] {
        let refused = illuminance(&scene, &meters, Transport::Direct, &accuracy(0.01));
        assert!(refused.is_err(), "{refused:?}");
    }
}

#[test]
fn every_bit_is_the_same_on_any_number_of_threads() {
    let (scene, meters) = random_scene(&mut Random(11));
    let [one, three] = [1, 3].map(|threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| indirect(&scene, &meters, 0.05))
    });
    assert_eq!(one, three);
}

#[test]
fn dimming_and_further_meters_solve_nothing_again() {
    let (scene, meters) = s1();
    let mut prepared = Prepared::new(&scene, Transport::Total(Bounces::Converged), &accuracy(1e-3)).unwrap();
    let whole = prepared.illuminance(&meters).unwrap();
    let mut dimmed = prepared.dimmed(0.25);
    for (estimate, whole) in dimmed.illuminance(&meters[..2]).unwrap().estimates.iter().zip(&whole.estimates) {
        assert_relative_eq!(pair(estimate).0, 0.25 * pair(whole).0, max_relative = 1e-6);
    }
}

#[test]
fn a_crowd_of_luminaires_lights_like_its_parts_within_their_bounds() {
    let mut worst = 0.0_f64;
    // A room takes half a minute: the second is the nightly's.
    for case in 0..by_night(2, 1) {
        let mut random = Random(200 + case);
        let (mut scene, meters) = random_scene(&mut random);
        let size_m = scene.room.unwrap().size_m;
        let first = scene.luminaires[0].clone();
        scene.luminaires.resize_with(36, || {
            let [azimuth, tilt, roll] = random.within(0.0, 360.0).to_array();
            let position_m = size_m * random.within(0.02, 0.98);
            Luminaire { position_m, orientation: orientation(azimuth, tilt, roll), ..first.clone() }
        });
        let mut parts = vec![(0.0, 0.0); meters.len()];
        for some in scene.luminaires.chunks(18) {
            let some = Scene { luminaires: some.to_vec(), ..scene.clone() };
            for (sum, (value, bound)) in parts.iter_mut().zip(indirect(&some, &meters, 1e-2)) {
                *sum = (sum.0 + value, sum.1 + bound);
            }
        }
        for asked in [1e-1, 1e-2] {
            for (part, whole) in parts.iter().zip(indirect(&scene, &meters, asked)) {
                let error = (part.0 - whole.0).abs();
                assert!(error <= part.1 + whole.1, "case {case}: {whole:?} differs from {part:?}");
                worst = worst.max(error / whole.0);
            }
        }
    }
    assert!(worst < 1e-2, "light is in the wrong place: {worst}");
}

#[test]
fn what_is_shared_out_among_nodes_is_all_the_flux_at_the_place_where_it_lands() {
    let (scene, _) = random_scene(&mut Random(7));
    let room = Room { reflectance: Reflectances::with_equal_walls(0.5, 0.5, 0.5), ..scene.room.unwrap() };
    let grid = Grid::new(room.size_m, &EFFORTS[2]);
    let light = FirstBounce::new(&room, &scene.luminaires, &EFFORTS[2]);
    let (at_nodes, flux) = (light.at_nodes(&grid), 2.0 * light.reflected_flux());
    assert_relative_eq!(at_nodes.iter().sum::<f64>(), flux, max_relative = 1e-4);
    // First moments: where each lumen lands, by the directions of the luminaire alone.
    let luminaire = &scene.luminaires[0];
    let (mut landed, mut sum) = (DVec3::ZERO, 0.0);
    let mut random = Random(8);
    for _ in 0..400_000 {
        let (z, turn) = (2.0 * random.next() - 1.0, 2.0 * PI * random.next());
        let across = (1.0 - z * z).sqrt();
        let direction = DVec3::new(across * turn.cos(), across * turn.sin(), z);
        let ends = DVec3::select(direction.cmpgt(DVec3::ZERO), room.size_m, DVec3::ZERO);
        let distance = ((ends - luminaire.position_m) / direction).min_element();
        let weight = luminaire.intensity_towards(direction).value();
        landed += weight * (luminaire.position_m + distance * direction);
        sum += weight;
    }
    let mean = (0..grid.len()).map(|k| at_nodes[k] * grid.node(k).0).sum::<DVec3>() / flux;
    assert!((mean - landed / sum).length() < 0.01 * room.size_m.length(), "{mean} {}", landed / sum);
}

#[test]
fn a_raised_flag_ends_it_and_nothing_half_done_is_kept() {
    static RAISED: std::sync::atomic::AtomicBool = std::sync::atomic::AtomicBool::new(true);
    let stop = Stop { flag: Some(&RAISED), ..Stop::NEVER };
    let ((scene, meters), begun) = (s1(), std::time::Instant::now());
    for bounces in [Bounces::AtMost(1_000_000), Bounces::Converged] {
        let mut prepared = Prepared::new(&scene, Transport::Total(bounces), &accuracy(1e-7)).unwrap();
        let stopped = prepared.illuminance_until(&meters, &stop).unwrap();
        assert!(stopped.solver.contains("stopped: of 4 of 4 meters there is what luminaires can give at most"));
        // What was not finished is kept nowhere.
        assert!(prepared.illuminance(&meters).unwrap().estimates[0].illuminance.value() > 0.0);
    }
    let stopped =
        crate::certified_until(&scene, &meters, Transport::Indirect(Bounces::Converged), &accuracy(1e-7), &stop);
    assert!(stopped.is_err() && begun.elapsed().as_secs() < 30);
}
