//! The real renderer against closed forms and the converged values of case S1, and what happens when it fails.

use std::f64::consts::PI;

use glam::DVec3;
use luminaire::geometry::Reflectances;
use luminaire::scene::{Bounces, Obstacle, Shape, orientation};

use super::*;
use crate::engines::Budget;
use crate::engines::fixtures::*;

pub(super) fn read(job: &Job) -> Measurement {
    read_tampered(job, |_, text| text)
}

pub(super) fn within(relative_error: f64, job: Job) -> Job {
    Job { budget: Budget { relative_error, seconds: 60.0 }, ..job }
}

/// Reads after every file went through `tamper(name, text)`.
fn read_tampered(job: &Job, tamper: impl Fn(&str, String) -> String) -> Measurement {
    let folder = tempfile::tempdir().unwrap();
    let bench = workbench(folder.path());
    if let Err(absent) = Radiance.probe(&bench.site) {
        panic!("Radiance is needed for this test: {absent}");
    }
    let edited = |f: SceneFile| SceneFile::text(&f.name, tamper(&f.name, String::from_utf8(f.bytes).unwrap()));
    let files: Vec<_> = Radiance.export(job).unwrap().into_iter().map(edited).collect();
    read_files(&files, job, &bench).unwrap()
}

#[test]
fn direct_light_follows_the_inverse_square_law_in_single_precision() {
    let job = s1(Transport::Direct);
    let found = read(&job);
    let deviations = relative_deviations(&found, &S1_DIRECT_LX);
    assert!(worst(&deviations) < 1e-6, "{deviations:?}");
    for (estimate, exact) in found.estimates.iter().zip(S1_DIRECT_LX) {
        let bound = estimate.uncertainty.bound();
        assert!((estimate.value - exact).abs() <= bound && bound < 1e-6 * exact, "{estimate:?} for {exact}");
    }
}

#[test]
fn indirect_light_is_the_converged_value_within_its_standard_error() {
    let found = read(&within(2e-3, s1(CONVERGED)));
    let deviations = relative_deviations(&found, &S1_INDIRECT_LX);
    assert!(worst(&deviations) < 8e-3 && worst_z(&found, &S1_INDIRECT_LX) < 4.0, "{found:?}");
    assert!(found.estimates.iter().all(|e| e.uncertainty.standard_error().unwrap() < 2.01e-3 * e.value), "{found:?}");
}

#[test]
fn n_bounces_are_n_diffuse_reflections() {
    let mut seven = s1(Transport::Indirect(Bounces::AtMost(7)));
    // The difference to the converged value is .6 %.
    seven.budget.relative_error = 8e-4;
    let found = read(&seven);
    assert!(worst_z(&found, &S1_SEVEN_LX) < 4.0, "{found:?}");
    assert!(worst_z(&found, &S1_INDIRECT_LX) > 5.0, "{found:?}");
    let none = read(&s1(Transport::Indirect(Bounces::AtMost(0))));
    assert!(none.estimates.iter().all(|e| e.value == 0.0), "{none:?}");
}

#[test]
fn total_is_direct_plus_indirect() {
    let mut total = s1(Transport::Total(Bounces::Converged));
    for station in &mut total.stations {
        station.meter.normal = DVec3::NEG_Z;
        station.meter.position_m.z = 17.0;
    }
    let direct = exact_direct_lx(&total);
    let mut indirect = total.clone();
    indirect.transport = CONVERGED;
    let (total, indirect) = (read(&within(2e-3, total)), read(&within(2e-3, indirect)));
    for ((total, indirect), direct) in total.estimates.iter().zip(&indirect.estimates).zip(direct) {
        let sum = direct + indirect.value;
        let error = total.uncertainty.standard_error().unwrap().hypot(indirect.uncertainty.standard_error().unwrap());
        assert!((total.value - sum).abs() < 4.0 * error + 1e-5 * sum, "{total:?} {indirect:?} {direct}");
    }
}

#[test]
fn asymmetric_and_turned_luminaires_read_their_own_table() {
    for distribution in [lopsided(), quadrant()] {
        let mut lamp = luminaire("turned", DVec3::new(1.0, 2.0, 3.0), distribution);
        lamp.orientation = orientation(30.0, 20.0, 10.0);
        lamp.flux_scale = 0.7;
        let every = |step: u32, end: u32| (0..=end / step).map(|k| f64::from(k * step)).collect::<Vec<_>>();
        let job = goniometer(&lamp, 10.0, &every(15, 345), &every(5, 180));
        let (found, exact) = (read(&job), exact_direct_lx(&job));
        let scale = exact.iter().copied().fold(0.0, f64::max);
        for (estimate, exact) in found.estimates.iter().zip(exact) {
            let bound = estimate.uncertainty.bound();
            assert!((estimate.value - exact).abs() < 1e-4 * exact + 1e-5 * scale, "{estimate:?} for {exact}");
            assert!((estimate.value - exact).abs() <= bound, "{estimate:?} for {exact}");
        }
    }
}

#[test]
fn several_luminaires_add_up_and_obstacles_throw_shadows() {
    let mut scene = s1(Transport::Direct).scene;
    scene.luminaires.push(luminaire("lopsided", DVec3::new(4.0, 5.0, 12.0), lopsided()));
    scene.luminaires.push(luminaire("second of its kind", DVec3::new(15.0, 5.0, 12.0), lopsided()));
    let points = [[3.0, 4.0, 5.0], [12.0, 12.0, 6.0], [18.0, 1.0, 1.0]];
    let free = job(scene.clone(), stations(&points, DVec3::Z), Transport::Direct);
    assert!(worst(&relative_deviations(&read(&free), &exact_direct_lx(&free))) < 1e-5);

    // A plate right above the first meter, once as a box and once as a mesh, hides every luminaire from it alone.
    let (min_m, max_m) = (DVec3::new(2.0, 3.0, 5.5), DVec3::new(4.0, 5.0, 5.6));
    let vertices_m = vec![min_m, max_m.with_y(min_m.y), max_m, min_m.with_y(max_m.y)];
    let mesh = Shape::Mesh { vertices_m, triangles: vec![[0, 1, 2], [0, 2, 3]] };
    for shape in [Shape::Box { min_m, max_m }, mesh] {
        let mut shaded = free.clone();
        shaded.scene.obstacles = vec![Obstacle { shape, reflectance: 0.3 }];
        shaded.stations[0].meter.position_m = DVec3::new(3.0, 4.0, 5.4);
        let found = read(&shaded);
        assert_eq!(found.estimates[0].value, 0.0);
        assert!(worst(&relative_deviations(&found, &exact_direct_lx(&shaded))[1..]) < 1e-5, "{found:?}");
    }
}

#[test]
fn a_wrong_export_is_seen() {
    let mut lamp = luminaire("turned", DVec3::ZERO, lopsided());
    lamp.flux_scale = 0.7;
    let job = goniometer(&lamp, 10.0, &[0.0, 60.0, 200.0], &[30.0, 80.0]);
    let exact = exact_direct_lx(&job);
    let factor = |flux_scale: f64| format!("{:e}", flux_scale / (export::EFFICACY * PI * 1e-3 * 1e-3));
    let deviation = |from: &str, to: &str| {
        let tampered = |name: &str, text: String| {
            if name != "scene.rad" {
                return text;
            }
            assert!(text.contains(from), "{text}");
            text.replace(from, to)
        };
        worst(&relative_deviations(&read_tampered(&job, tampered), &exact))
    };
    assert!(deviation("light", "light") < 1e-6);
    let factor_pi = deviation(&factor(0.7), &factor(0.7 * PI));
    let multiplier_dropped = deviation(&factor(0.7), &factor(1.0));
    let turned_by_90 = deviation(
        "5 corr luminaire-0.dat source.cal src_phi src_theta",
        "7 corr luminaire-0.dat source.cal src_phi src_theta -rz 90",
    );
    assert!((factor_pi - 2.14159).abs() < 1e-4 && (multiplier_dropped - 1.0 / 0.7 + 1.0).abs() < 1e-4);
    assert!(turned_by_90 > 0.1, "{turned_by_90}");
}

#[test]
fn exported_files_are_these() {
    let mut job = s1(Transport::Total(Bounces::AtMost(3)));
    let room = job.scene.room.as_mut().unwrap();
    room.size_m = DVec3::new(8.0, 6.0, 3.0);
    room.reflectance =
        Reflectances { floor: 0.2, ceiling: 0.8, wall_x_min: 0.5, wall_x_max: 0.4, wall_y_min: 0.3, wall_y_max: 0.6 };
    let mut turned = luminaire("desk -- left", DVec3::new(2.0, 3.0, 1.5), quadrant());
    turned.orientation = orientation(90.0, 0.0, 0.0);
    turned.flux_scale = 0.5;
    job.scene.luminaires[0].position_m = DVec3::new(4.0, 3.0, 2.0);
    job.scene.luminaires.push(turned);
    let vertices_m = vec![DVec3::new(5.0, 1.0, 0.0), DVec3::new(6.0, 1.0, 0.0), DVec3::new(5.5, 1.0, 1.0)];
    job.scene.obstacles = vec![
        Obstacle {
            shape: Shape::Box { min_m: DVec3::new(1.0, 1.0, 0.0), max_m: DVec3::new(2.6, 1.8, 0.75) },
            reflectance: 0.5,
        },
        Obstacle { shape: Shape::Mesh { vertices_m, triangles: vec![[0, 1, 2]] }, reflectance: 0.25 },
    ];
    job.stations.truncate(2);
    let files = Radiance.export(&job).unwrap();
    let texts = files.iter().map(|f| format!("==== {}\n{}\n", f.name, String::from_utf8_lossy(&f.bytes)));
    insta::assert_snapshot!(texts.collect::<Vec<_>>().concat());
}

#[test]
fn tiny_and_huge_rooms_read_as_their_scale_has_it() {
    for size in [1e-3, 1e5] {
        let mut job = s1(Transport::Direct);
        job.scene.room.as_mut().unwrap().size_m *= size;
        job.scene.luminaires[0].position_m *= size;
        job.scene.luminaires[0].flux_scale *= size * size;
        for station in &mut job.stations {
            station.meter.position_m *= size;
        }
        let found = read(&job);
        assert!(worst(&relative_deviations(&found, &S1_DIRECT_LX)) < 1e-6, "{size}: {found:?}");
    }
}

#[test]
fn the_fast_preset_is_right_and_the_defaults_are_off_by_far_more_than_their_standard_error() {
    let preset = |name: &str| {
        let mut job = s1(CONVERGED);
        job.settings.insert("preset".into(), name.into());
        job.budget.seconds = 1.0;
        job.stations.truncate(1);
        read(&job)
    };
    let fast = preset("fast");
    assert!(fast.effort["blocks"] == "8" && worst_z(&fast, &S1_INDIRECT_LX) < 5.0, "{fast:?}");
    let defaults = preset("default");
    let off = worst(&relative_deviations(&defaults, &S1_INDIRECT_LX));
    assert!((0.2..0.35).contains(&off) && worst_z(&defaults, &S1_INDIRECT_LX) > 5.0, "{defaults:?}");
}

#[test]
fn free_field_has_no_indirect_light() {
    let mut job = s1(CONVERGED);
    job.scene.room = None;
    assert!(read(&job).estimates.iter().all(|e| e.value == 0.0 && e.uncertainty.standard_error() == Some(0.0)));
}
