//! What POV-Ray must read, and what a wrong export would: these run the real renderer.

use std::path::Path;
use std::time::Duration;

use glam::DVec3;
use luminaire::geometry::{Reflectances, Room};
use luminaire::photometry::{LuminousOpening, direction};
use luminaire::scene::{LuminaireModel, Obstacle, Scene, Shape, orientation};

use super::cases::{INDIRECT, S1_DIRECT_LX, S1_INDIRECT_LX, job, lopsided, luminaire, s1, uplight};
use super::*;
use crate::engines::Budget;

/// A fault and how to put it into a job.
type Tamper = (&'static str, fn(&mut Job));

fn site() -> Site {
    let site = std::env::var_os("LUXPROOF_ENGINES").map_or_else(|| Site::of_user().unwrap(), Site::at);
    assert!(PovRay.probe(&site).is_ok(), "povray is not there: run `luxproof engines install`");
    site
}

fn workbench(folder: &Path) -> Workbench {
    let limit = Duration::from_secs(120);
    Workbench { site: site(), scene_dir: folder.to_owned(), log: folder.join("log"), jobs: 2, limit }
}

fn read(job: &Job) -> Measurement {
    let folder = tempfile::tempdir().unwrap();
    let measured = PovRay.read(job, &workbench(folder.path()));
    measured
        .unwrap_or_else(|e| panic!("{e}\n{}", std::fs::read_to_string(folder.path().join("log")).unwrap_or_default()))
}

fn direct_exact(job: &Job) -> Vec<f64> {
    let at = |s: &crate::engines::Station| {
        let from = |l: &Luminaire| {
            let to = l.position_m - s.meter.position_m;
            let cos = to.normalize().dot(s.meter.normal).max(0.0);
            l.intensity_towards(-to).value() * cos / to.length_squared()
        };
        job.scene.luminaires.iter().map(from).sum()
    };
    job.stations.iter().map(at).collect()
}

fn worst_relative(measured: &Measurement, exact: &[f64]) -> f64 {
    let pairs = measured.estimates.iter().zip(exact);
    pairs.map(|(e, x)| (e.value_lx / x - 1.0).abs()).fold(0.0, f64::max)
}

fn exported(job: &Job) -> String {
    String::from_utf8(PovRay.export(job).unwrap().remove(0).bytes).unwrap()
}

#[test]
fn the_scene_of_s1_is_as_reviewed() {
    insta::assert_snapshot!(exported(&s1(INDIRECT)));
}

#[test]
fn a_scene_with_turned_area_luminaires_and_obstacles_is_as_reviewed() {
    let mut lamp = luminaire("panel", lopsided(), DVec3::new(2.0, 1.5, 2.9));
    lamp.orientation = orientation(30.0, 20.0, 0.0);
    lamp.model = LuminaireModel::Area;
    std::sync::Arc::make_mut(&mut lamp.photometry).opening = LuminousOpening::Box { x_m: 0.6, y_m: 0.6, height_m: 0.0 };
    let room = Room { size_m: DVec3::new(8.0, 6.0, 3.0), reflectance: Reflectances::with_equal_walls(0.2, 0.5, 0.8) };
    let vertices_m = vec![DVec3::new(1.0, 1.0, 1.0), DVec3::new(2.0, 1.0, 1.0), DVec3::new(1.0, 2.0, 1.0)];
    let obstacles = vec![
        Obstacle {
            shape: Shape::Box { min_m: DVec3::new(4.0, 3.0, 0.0), max_m: DVec3::new(5.0, 4.0, 0.75) },
            reflectance: 0.5,
        },
        Obstacle { shape: Shape::Mesh { vertices_m, triangles: vec![[0, 1, 2]] }, reflectance: 0.3 },
    ];
    let mut job = job(
        Scene { room: Some(room), obstacles, luminaires: vec![lamp] },
        &[(DVec3::new(0.25, 0.25, 0.8), DVec3::Z)],
        Transport::Total(Bounces::AtMost(7)),
    );
    job.settings.insert("preset".into(), "fast".into());
    insta::assert_snapshot!(exported(&job));
}

#[test]
fn direct_light_of_s1_is_exact_to_1e_6_and_within_its_bound() {
    let measured = read(&s1(Transport::Direct));
    assert!(worst_relative(&measured, &S1_DIRECT_LX) < 1e-6, "{measured:?}");
    for (estimate, exact) in measured.estimates.iter().zip(S1_DIRECT_LX) {
        assert!((estimate.value_lx - exact).abs() <= estimate.error_bound_lx.unwrap(), "{estimate:?} {exact}");
    }
}

#[test]
fn a_turned_asymmetric_luminaire_is_read_back_over_the_full_grid() {
    let mut lamp = luminaire("lopsided", lopsided(), DVec3::new(3.0, -2.0, 5.0));
    lamp.orientation = orientation(30.0, 20.0, 10.0);
    lamp.flux_scale = 0.8;
    let (centre, turn) = (lamp.position_m, lamp.orientation);
    let angles = (0..24).flat_map(|c| (0..=18).map(move |g| (15.0 * f64::from(c), 10.0 * f64::from(g))));
    let meters: Vec<(DVec3, DVec3)> =
        angles.map(|(c, g)| turn * direction(c, g)).map(|out| (centre + 10.0 * out, -out)).collect();
    let job = job(Scene { room: None, obstacles: vec![], luminaires: vec![lamp] }, &meters, Transport::Direct);
    let exact = direct_exact(&job);
    let measured = read(&job);
    let largest = exact.iter().copied().fold(0.0, f64::max);
    for ((estimate, exact), station) in measured.estimates.iter().zip(&exact).zip(&job.stations) {
        let off = (estimate.value_lx - exact).abs();
        assert!(off <= 1e-6 * largest, "{}: {} lx, exact {exact}", station.id, estimate.value_lx);
        assert!(off <= estimate.error_bound_lx.unwrap(), "{}: off {off}, {estimate:?}", station.id);
    }
}

#[test]
fn several_luminaires_add_up_in_scenes_of_any_size() {
    for size in [1e-3, 1.0, 1e3] {
        let room = Room {
            size_m: DVec3::new(8.0, 6.0, 3.0) * size,
            reflectance: Reflectances::with_equal_walls(0.2, 0.5, 0.8),
        };
        let mut turned = luminaire("b", lopsided(), DVec3::new(5.0, 4.0, 2.5) * size);
        turned.orientation = orientation(75.0, -40.0, 0.0);
        let luminaires = vec![luminaire("a", uplight(), DVec3::new(2.0, 2.0, 1.0) * size), turned];
        let meters = [
            (DVec3::new(1.0, 3.0, 0.8) * size, DVec3::Z),
            (DVec3::new(6.0, 1.0, 2.0) * size, DVec3::new(-0.6, 0.0, 0.8)),
            // One on the floor, and three at one point, whose discs cross.
            (DVec3::new(7.0, 5.0, 0.0) * size, DVec3::Z),
            (DVec3::new(3.0, 3.0, 1.5) * size, DVec3::Z),
            (DVec3::new(3.0, 3.0, 1.5) * size, DVec3::NEG_X),
            (DVec3::new(3.0, 3.0, 1.5) * size, DVec3::new(0.6, 0.0, 0.8)),
        ];
        let job = job(Scene { room: Some(room), obstacles: vec![], luminaires }, &meters, Transport::Direct);
        let exact = direct_exact(&job);
        let measured = read(&job);
        for (estimate, exact) in measured.estimates.iter().zip(&exact) {
            assert!(
                (estimate.value_lx - exact).abs() <= 2e-6 * exact,
                "{size}: {} lx, exact {exact}",
                estimate.value_lx
            );
        }
    }
}

#[test]
fn a_meter_that_faces_away_reads_nothing() {
    let mut job = s1(Transport::Direct);
    job.stations[1].meter.normal = DVec3::Z;
    let measured = read(&job);
    assert_eq!(measured.estimates[1].value_lx, 0.0);
    assert!(measured.estimates[0].value_lx > 0.8);
}

#[test]
fn a_box_between_luminaire_and_meter_casts_a_shadow_and_a_mesh_the_same() {
    let corner = |k: u32| {
        let pick = |bit: u32, low: f64, high: f64| if k >> bit & 1 == 0 { low } else { high };
        DVec3::new(pick(0, 9.0, 11.0), pick(1, 9.0, 11.0), pick(2, 13.0, 14.0))
    };
    let faces = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]];
    let triangles = faces.iter().flat_map(|[a, b, c, d]| [[*a, *b, *c], [*a, *c, *d]]).collect();
    let mesh = Shape::Mesh { vertices_m: (0..8).map(corner).collect(), triangles };
    let solid = Shape::Box { min_m: corner(0), max_m: corner(7) };
    for shape in [solid, mesh] {
        let mut job = s1(Transport::Direct);
        job.scene.obstacles = vec![Obstacle { shape, reflectance: 0.5 }];
        let measured = read(&job);
        assert_eq!(measured.estimates[3].value_lx, 0.0);
        assert!((measured.estimates[0].value_lx / S1_DIRECT_LX[0] - 1.0).abs() < 1e-6);
    }
}

#[test]
fn a_flat_opening_is_the_mean_of_its_points() {
    // A Lambertian square of 1 m, read at 2 m below its centre: configuration factor of four corner rectangles.
    let gamma: Vec<f64> = (0..=180).map(|g| 0.5 * f64::from(g)).collect();
    let candela = gamma.iter().map(|g: &f64| 1000.0 * g.to_radians().cos().max(0.0)).collect();
    let lambertian = luminaire::photometry::LuminousIntensityDistribution::axial(gamma, candela).unwrap();
    let mut lamp = luminaire("square", lambertian, DVec3::new(0.0, 0.0, 2.0));
    let photometry = std::sync::Arc::make_mut(&mut lamp.photometry);
    photometry.opening = LuminousOpening::Box { x_m: 1.0, y_m: 1.0, height_m: 0.0 };
    lamp.model = LuminaireModel::Area;
    let scene = Scene { room: None, obstacles: vec![], luminaires: vec![lamp] };
    let measured = read(&job(scene, &[(DVec3::ZERO, DVec3::Z)], Transport::Direct));
    let (x, root) = (0.25_f64, 1.0625_f64.sqrt());
    let factor = 4.0 / std::f64::consts::TAU * 2.0 * (x / root) * (x / root).atan();
    let exact = std::f64::consts::PI * 1000.0 * factor;
    // Half a degree of linear interpolation in gamma costs up to 1e-5.
    assert!(worst_relative(&measured, &[exact]) < 2e-5, "{measured:?} {exact}");
}

#[test]
fn indirect_light_of_s1_is_exact_within_its_errors_and_the_named_bias() {
    let mut job = s1(INDIRECT);
    // No dependence on how busy the machine is: as few blocks as there may be, each in full.
    job.budget = Budget { relative_error: 0.02, seconds: 1e6 };
    let measured = read(&job);
    for (estimate, exact) in measured.estimates.iter().zip(S1_INDIRECT_LX) {
        let allowed = 3.0 * estimate.std_error_lx.unwrap() + AUDIT_BIAS * exact;
        assert!((estimate.value_lx - exact).abs() < allowed, "{estimate:?} {exact}");
        assert!(estimate.std_error_lx.unwrap() < 0.02 * exact, "{estimate:?}");
    }
    assert!(measured.settings["blocks"].parse::<usize>().unwrap() >= 8);
}

#[test]
fn wrong_exports_are_seen_in_the_readings() {
    let mut right = s1(Transport::Direct);
    right.scene.luminaires[0] = luminaire("lopsided", lopsided(), DVec3::splat(10.0));
    let exact = direct_exact(&right);
    let tampers: [Tamper; 3] = [
        ("pi", |j| j.scene.luminaires[0].flux_scale = std::f64::consts::PI),
        ("multiplier dropped", |j| j.scene.luminaires[0].flux_scale = 0.1),
        ("C turned by 90 degrees", |j| j.scene.luminaires[0].orientation = orientation(90.0, 0.0, 0.0)),
    ];
    assert!(worst_relative(&read(&right), &exact) < 2e-6);
    for (name, tamper) in tampers {
        let mut wrong = right.clone();
        tamper(&mut wrong);
        assert!(worst_relative(&read(&wrong), &exact) > 0.05, "{name} was not seen");
    }
}
