//! Scenes beyond the empty cube: extended luminaires, obstacles, bright rooms, far and tiny coordinates.

use luxproof_photometry::{HorizontalAxis, LuminousOpening};
use luxproof_scene::Bounces;

use super::*;

#[test]
fn extended_openings_send_out_their_table_and_are_as_large_as_they_are() {
    let (x_m, y_m, diameter_m, length_m) = (0.6, 0.3, 0.1, 1.2);
    let openings = [
        LuminousOpening::Box { x_m, y_m, height_m: 0.0 },
        LuminousOpening::Box { x_m, y_m, height_m: 0.1 },
        LuminousOpening::Box { x_m, y_m: 0.0, height_m: 0.0 },
        LuminousOpening::Ellipse { x_m, y_m, height_m: 0.0 },
        LuminousOpening::Ellipse { x_m, y_m, height_m: 0.2 },
        LuminousOpening::Ellipsoid { x_m, y_m: 0.6, z_m: 0.2 },
        LuminousOpening::LyingCylinder { axis: HorizontalAxis::X, length_m, diameter_m },
        LuminousOpening::LyingCylinder { axis: HorizontalAxis::Y, length_m, diameter_m },
    ];
    for opening in openings.into_iter().skip(by_night(0, 1)).step_by(by_night(1, 2)) {
        let mut lamp = with_opening(luminaire("area", DVec3::new(1.0, 2.0, 3.0), lopsided()), opening);
        lamp.orientation = orientation(30.0, 20.0, 10.0);
        let angles = (&[10.0, 190.0], &[5.0, 85.0, 165.0]);
        let far = goniometer(&lamp, 300.0, angles.0, angles.1);
        let mut both = goniometer(&lamp, 0.8, angles.0, angles.1);
        // Close by, the simulator's own sampling of the same opening is the witness.
        let near = simulated_lx(&both, 3e-3);
        let as_points = exact_direct_lx(&both);
        assert!(as_points.iter().zip(&near).any(|(point, near)| (point / near - 1.0).abs() > 0.02), "{opening:?}");

        both.sensors.extend(far.sensors.clone());
        let expected = [near, exact_direct_lx(&far)].concat();
        let deviations = relative_deviations(&read(&both), &expected);
        assert!(worst(&deviations) < 6e-3, "{opening:?} {deviations:?}");
    }
}

#[test]
fn bright_rooms_keep_all_their_light() {
    // In a closed room of one reflectance the area-mean indirect illuminance is Phi rho / (A (1 - rho)).
    let rho = by_night(0.97, 0.9);
    let isotropic = LuminousIntensityDistribution::axial(vec![0.0, 180.0], vec![100.0, 100.0]).unwrap();
    let scene = Scene {
        room: Some(room(DVec3::splat(4.0), rho, rho, rho)),
        obstacles: vec![],
        luminaires: vec![luminaire("centre", DVec3::splat(2.0), isotropic)],
    };
    // The mean over a wall, and by symmetry over the room, from 5 x 5 Gauss points.
    let nodes = [-0.906_179_845_938_664, -0.538_469_310_105_683, 0.0, 0.538_469_310_105_683, 0.906_179_845_938_664];
    let weights = [
        0.236_926_885_056_189,
        0.478_628_670_499_366,
        0.568_888_888_888_889,
        0.478_628_670_499_366,
        0.236_926_885_056_189,
    ];
    let points: Vec<_> = nodes.iter().flat_map(|y| nodes.map(|z| [1e-3, 2.0 + 2.0 * y, 2.0 + 2.0 * z])).collect();
    let mut bright = job(scene, sensors(&points, DVec3::X), CONVERGED);
    bright.budget = Budget { relative_error: 1e-2, seconds: 15.0 };
    let found = read(&bright);
    let weight = weights.iter().flat_map(|a| weights.map(|b| 0.25 * a * b));
    let mean_lx: f64 = found.estimates.iter().zip(weight).map(|(e, w)| w * e.value).sum();
    let flux_lm = 400.0 * std::f64::consts::PI;
    let exact_lx = flux_lm * rho / (96.0 * (1.0 - rho));
    assert!((mean_lx / exact_lx - 1.0).abs() < 5e-3, "{mean_lx} for {exact_lx}: {found:?}");
}

#[test]
fn the_stock_scene_reads_the_same_light_within_its_own_errors() {
    let direct = read(&with_preset(s1(Transport::Direct), "default"));
    // 16-bit pixels and shadow rays that end short of the light.
    assert!(worst(&relative_deviations(&direct, &S1_DIRECT_LX)) < 2e-3, "{direct:?}");
    let indirect = read(&with_preset(s1(CONVERGED), "default"));
    assert!(worst_z(&indirect, &S1_INDIRECT_LX) < 6.0, "{indirect:?}");
    assert!(worst(&relative_deviations(&indirect, &S1_INDIRECT_LX)) < 0.08, "{indirect:?}");

    // An image upside down or mirrored would show.
    let angles = [20.0, 90.0, 200.0, 310.0];
    let goniometer = goniometer(&turned(lopsided()), 5.0, &angles, &[0.0, 30.0, 85.0, 120.0, 160.0]);
    let exact = exact_direct_lx(&goniometer);
    let found = read(&with_preset(goniometer, "default"));
    assert!(worst(&relative_deviations(&found, &exact)) < 3e-3, "{found:?} for {exact:?}");
}

#[test]
fn the_fast_preset_takes_a_fixed_number_of_samples() {
    let found = read(&with_preset(s1(CONVERGED), "fast"));
    assert_eq!(found.effort["indirect_blocks"], "8");
    assert_eq!(found.effort["indirect_samples_a_meter_and_block"], "1024");
    assert!(worst_z(&found, &S1_INDIRECT_LX) < 6.0, "{found:?}");
}

#[test]
fn what_cannot_be_read_well_is_said_beforehand() {
    let support = |job: &Job| Mitsuba::default().supports(job);
    assert_eq!(support(&s1(CONVERGED)), Support::Yes);
    // Panels flush with the ceiling light nothing close by.
    assert_eq!(support(&s2_with_panels(CONVERGED)), Support::Yes);
    assert!(matches!(support(&with_preset(s2_with_panels(CONVERGED), "default")), Support::No(_)));
    let mut uplight = s1(CONVERGED);
    uplight.scene.luminaires[0].position_m.z = 19.99;
    assert!(matches!(support(&uplight), Support::Approximate { .. }));
    uplight.transport = Transport::Direct;
    assert_eq!(support(&uplight), Support::Yes);
    let mut impostor = s1(Transport::Direct);
    impostor.scene.luminaires[0].model = LuminaireModel::Impostor;
    assert!(matches!(support(&impostor), Support::No(_)));
}

#[test]
fn bounds_of_direct_light_hold_in_random_rooms_and_are_each_meters_own() {
    crate::shared_tests::bounds_hold_and_decide(read, false, 6);
}

fn with_integrator(mut job: Job, integrator: &str, variant: &str) -> Job {
    job.settings.insert("integrator".into(), integrator.into());
    job.settings.insert("variant".into(), variant.into());
    job
}

#[test]
fn every_integrator_reads_the_same_light() {
    for integrator in ["path", "volpath", "prb", "ptracer"] {
        let mut job = with_integrator(s1(CONVERGED), integrator, "llvm_ad_mono");
        job.budget = Budget { relative_error: 5e-3, seconds: 20.0 };
        let found = read(&job);
        assert!(worst_z(&found, &S1_INDIRECT_LX) < 5.0, "{integrator}: {found:?}");
        assert!(worst(&relative_deviations(&found, &S1_INDIRECT_LX)) < 0.03, "{integrator}: {found:?}");
    }
}

#[test]
fn particles_and_paths_agree_in_furnished_rooms_with_openings() {
    let mut job = shared_tests::furnished();
    job.transport = Transport::Indirect(Bounces::AtMost(3));
    job.budget = Budget { relative_error: 5e-3, seconds: 20.0 };
    let opening = LuminousOpening::Box { x_m: 0.6, y_m: 0.3, height_m: 0.1 };
    job.scene.luminaires[0] = with_opening(job.scene.luminaires[0].clone(), opening);
    let [paths, particles] =
        ["path", "ptracer"].map(|integrator| read(&with_integrator(job.clone(), integrator, "llvm_ad_mono")));
    for (path, particle) in paths.estimates.iter().zip(&particles.estimates) {
        assert!((particle.value - path.value).abs() <= 0.03 * path.value, "{path:?} {particle:?}");
    }
    assert!(paths.estimates.iter().any(|path| path.value > 0.0), "{paths:?}");
}

#[test]
fn particles_are_traced_without_compiled_kernels_too() {
    let mut job = with_integrator(s1(CONVERGED), "ptracer", "scalar_rgb");
    job.budget = Budget { relative_error: 0.1, seconds: 10.0 };
    let found = read(&job);
    assert!(worst_z(&found, &S1_INDIRECT_LX) < 5.0, "{found:?}");
    assert!(worst(&relative_deviations(&found, &S1_INDIRECT_LX)) < 0.3, "{found:?}");
}

#[test]
fn variants_for_a_gpu_are_declined_where_there_is_none() {
    let support = Mitsuba::default().supports(&with_integrator(s1(CONVERGED), "path", "cuda_ad_mono"));
    let is_there = std::path::Path::new("/dev/nvidiactl").exists();
    match support {
        Support::No(why) => assert!(!is_there && why.contains("NVIDIA"), "{why}"),
        other => assert!(is_there, "{other:?}"),
    }
}

#[test]
fn integrators_that_do_not_go_with_other_settings_are_refused() {
    for (integrator, variant, preset, says) in [
        ("prb", "scalar_rgb", "audit", "automatic differentiation"),
        ("ptracer", "llvm_ad_mono", "default", "volpath"),
        ("photonmapper", "llvm_ad_mono", "audit", "path, volpath, prb or ptracer"),
    ] {
        let job = with_preset(with_integrator(s1(CONVERGED), integrator, variant), preset);
        let error = Mitsuba::default().check_settings(&job).unwrap_err().to_string();
        assert!(error.starts_with("engines.mitsuba.integrator: ") && error.contains(says), "{error}");
    }
    let stock = with_preset(with_integrator(s1(CONVERGED), "volpath", "llvm_ad_mono"), "default");
    assert!(Mitsuba::default().check_settings(&stock).is_ok());
}
