//! The real renderer against closed forms and the converged values of case S1, and what happens when it fails.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

use glam::DVec3;
use luminaire::geometry::{Reflectances, Room};
use luminaire::photometry::{LuminousIntensityDistribution, Photometry, direction};
use luminaire::scene::{Bounces, Luminaire, LuminaireModel, Meter, Obstacle, Scene, Shape, Transport, orientation};

use super::*;
use crate::engines::{Budget, Station};
use crate::record::MeterId;

mod failures;
mod scenes;

const CONVERGED: Transport = Transport::Indirect(Bounces::Converged);
const S1_DIRECT_LX: [f64; 4] = [0.852757462813, 2.230931614869, 2.230931614869, 13.559183673469];
const S1_INDIRECT_LX: [f64; 4] = [0.94314714, 1.15551735, 1.15551735, 1.42062868];
/// Indirect light cut at seven reflections.
const S1_SEVEN_LX: [f64; 4] = [0.93537, 1.14730, 1.14730, 1.41182];

fn photometry(distribution: LuminousIntensityDistribution) -> Arc<Photometry> {
    Arc::new(Photometry::of(distribution))
}

fn luminaire(id: &str, at_m: DVec3, distribution: LuminousIntensityDistribution) -> Luminaire {
    Luminaire {
        id: id.into(),
        photometry: photometry(distribution),
        position_m: at_m,
        orientation: orientation(0.0, 0.0, 0.0),
        flux_scale: 1.0,
        model: LuminaireModel::Point,
    }
}

fn axial_uplight() -> LuminousIntensityDistribution {
    let gamma = vec![0.0, 89.0, 90.0, 95.0, 115.0, 135.0, 155.0, 175.0, 180.0];
    let candela = vec![0.0, 0.0, 4.5, 35.7, 218.3, 421.6, 576.4, 662.3, 664.4];
    LuminousIntensityDistribution::axial(gamma, candela).unwrap()
}

/// No symmetry at all, uneven planes; every plane meets at the poles.
fn lopsided() -> LuminousIntensityDistribution {
    let c = vec![0.0, 20.0, 90.0, 135.0, 250.0, 360.0];
    let gamma = vec![0.0, 15.0, 40.0, 70.0, 90.0, 130.0, 180.0];
    let value = |c: f64, g: f64| {
        let swing = (g.to_radians().sin()) * (0.6 * c.to_radians().cos() + 0.3 * (2.0 * c.to_radians()).sin());
        500.0 + 300.0 * g.to_radians().cos() + 250.0 * swing
    };
    let candela = c.iter().flat_map(|&c| gamma.iter().map(move |&g| value(c % 360.0, g))).collect();
    LuminousIntensityDistribution::new(c, gamma, candela).unwrap()
}

fn quadrant() -> LuminousIntensityDistribution {
    let c = vec![0.0, 30.0, 90.0];
    let candela = [[900.0, 700.0, 80.0, 0.0], [900.0, 820.0, 150.0, 0.0], [900.0, 1000.0, 400.0, 0.0]].concat();
    LuminousIntensityDistribution::new(c, vec![0.0, 30.0, 60.0, 90.0], candela).unwrap()
}

fn room(size_m: DVec3, floor: f64, walls: f64, ceiling: f64) -> Room {
    Room { size_m, reflectance: Reflectances::with_equal_walls(floor, walls, ceiling) }
}

fn stations(points_m: &[[f64; 3]], normal: DVec3) -> Vec<Station> {
    let station = |(k, p): (usize, &[f64; 3])| {
        let meter = Meter { position_m: DVec3::from_array(*p), normal };
        Station { id: MeterId::new("m", k), meter, expected_lx: None }
    };
    points_m.iter().enumerate().map(station).collect()
}

fn job(scene: Scene, stations: Vec<Station>, transport: Transport) -> Job {
    Job {
        case: "test case".into(),
        procedure: crate::engines::fixtures::procedure_of(transport),
        scene,
        stations,
        transport,
        budget: Budget { relative_error: 1e-3, seconds: 20.0 },
        seed: 1,
        settings: BTreeMap::new(),
    }
}

fn s1(transport: Transport) -> Job {
    let scene = Scene {
        room: Some(room(DVec3::splat(20.0), 0.2, 0.5, 0.8)),
        obstacles: vec![],
        luminaires: vec![luminaire("axial", DVec3::splat(10.0), axial_uplight())],
    };
    let (z, normal) = if transport == Transport::Direct { (17.0, DVec3::NEG_Z) } else { (2.0, DVec3::Z) };
    job(scene, stations(&[[2.0, 2.0, z], [2.0, 10.0, z], [10.0, 2.0, z], [10.0, 10.0, z]], normal), transport)
}

/// Every (C, gamma) of a grid, read at `distance_m` in free field.
fn goniometer(luminaire: &Luminaire, distance_m: f64, c_deg: &[f64], gamma_deg: &[f64]) -> Job {
    let towards = |c: f64, g: f64| luminaire.orientation * direction(c, g);
    let station = |(k, d): (usize, DVec3)| {
        let meter = Meter { position_m: luminaire.position_m + distance_m * d, normal: -d };
        Station { id: MeterId::new("g", k), meter, expected_lx: None }
    };
    let directions = c_deg.iter().flat_map(|&c| gamma_deg.iter().map(move |&g| towards(c, g)));
    let stations = directions.enumerate().map(station).collect();
    job(Scene { luminaires: vec![luminaire.clone()], ..Scene::default() }, stations, Transport::Direct)
}

/// Inverse-square law in an empty convex room or free field.
fn exact_direct_lx(job: &Job) -> Vec<f64> {
    let at = |station: &Station| {
        let from = |l: &Luminaire| {
            let ray = station.meter.position_m - l.position_m;
            let cosine = (-ray.normalize().dot(station.meter.normal)).max(0.0);
            l.intensity_towards(ray).value() * cosine / ray.length_squared()
        };
        job.scene.luminaires.iter().map(from).sum()
    };
    job.stations.iter().map(at).collect()
}

fn workbench(folder: &Path) -> Workbench {
    let site = Site::of_user().unwrap();
    let limit = Duration::from_secs(120);
    Workbench {
        site,
        scene_dir: folder.to_owned(),
        log: folder.join("log"),
        jobs: 2,
        limit,
        peak: crate::system::process::PeakMemory::default(),
    }
}

fn read(job: &Job) -> Measurement {
    read_tampered(job, |_, text| text)
}

/// Reads after every text file went through `tamper(name, text)`.
fn read_tampered(job: &Job, tamper: impl Fn(&str, String) -> String) -> Measurement {
    let engine = Mitsuba::default();
    let folder = tempfile::tempdir().unwrap();
    let bench = workbench(folder.path());
    if let Err(absent) = engine.probe(&bench.site) {
        panic!("Mitsuba is needed for this test: {absent}");
    }
    let settings = Settings::of(job).unwrap();
    let edited = |f: SceneFile| match String::from_utf8(f.bytes.clone()) {
        Ok(text) => SceneFile::text(&f.name, tamper(&f.name, text)),
        Err(_) => f,
    };
    let files: Vec<_> = export::files(job, &settings).unwrap().into_iter().map(edited).collect();
    engine.read_files(&files, job, &settings, &bench).unwrap()
}

fn relative_deviations(measurement: &Measurement, exact: &[f64]) -> Vec<f64> {
    measurement.estimates.iter().zip(exact).map(|(e, x)| e.value / x - 1.0).collect()
}

fn worst(deviations: &[f64]) -> f64 {
    deviations.iter().fold(0.0, |w: f64, d| if d.is_nan() { f64::INFINITY } else { w.max(d.abs()) })
}

/// The largest deviation in standard errors.
fn worst_z(measurement: &Measurement, exact: &[f64]) -> f64 {
    let z = |(e, x): (&crate::record::Estimate, &f64)| (e.value - x) / e.uncertainty.standard_error().unwrap();
    worst(&measurement.estimates.iter().zip(exact).map(z).collect::<Vec<_>>())
}

#[test]
fn direct_light_follows_the_inverse_square_law_in_single_precision() {
    let job = s1(Transport::Direct);
    let found = read(&job);
    let deviations = relative_deviations(&found, &S1_DIRECT_LX);
    assert!(worst(&deviations) < 1e-5, "{deviations:?}");
    for (estimate, exact) in found.estimates.iter().zip(S1_DIRECT_LX) {
        let bound = estimate.uncertainty.bound();
        assert!((estimate.value - exact).abs() <= bound && bound < 1e-4 * exact, "{estimate:?} for {exact}");
    }
}

#[test]
fn indirect_light_is_the_converged_value_within_its_standard_error() {
    let found = read(&s1(CONVERGED));
    let deviations = relative_deviations(&found, &S1_INDIRECT_LX);
    assert!(worst(&deviations) < 4e-3 && worst_z(&found, &S1_INDIRECT_LX) < 4.0, "{found:?}");
    assert!(found.estimates.iter().all(|e| e.uncertainty.standard_error().unwrap() < 1.05e-3 * e.value), "{found:?}");
}

#[test]
fn n_bounces_are_n_diffuse_reflections() {
    let mut seven = s1(Transport::Indirect(Bounces::AtMost(7)));
    // The difference to the converged value is .6 %.
    seven.budget.relative_error = 5e-4;
    let found = read(&seven);
    assert!(worst_z(&found, &S1_SEVEN_LX) < 4.0, "{found:?}");
    assert!(worst_z(&found, &S1_INDIRECT_LX) > 8.0, "{found:?}");
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
    let (total, indirect) = (read(&total), read(&indirect));
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
    let deviation = |from: &'static str, to: &'static str| {
        let tampered = |name: &str, text: String| {
            if name != "scene.xml" {
                return text;
            }
            assert!(text.contains(from), "{text}");
            text.replace(from, to)
        };
        worst(&relative_deviations(&read_tampered(&job, tampered), &exact))
    };
    assert!(deviation("<scene", "<scene") < 1e-5);
    let factor_pi = deviation(r#"value="0.7""#, r#"value="2.19911""#);
    let multiplier_dropped = deviation(r#"<float name="scale" value="0.7"/>"#, "");
    let turned_by_90 = deviation("1 0 0 0  0 1 0 0", "0 -1 0 0  1 0 0 0");
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
    let files = Mitsuba::default().export(&job).unwrap();
    let golden = files.iter().filter(|f| !f.name.starts_with("mitsuba_") && !f.name.starts_with("opacity-"));
    let texts = golden.map(|f| format!("==== {}\n{}\n", f.name, String::from_utf8_lossy(&f.bytes)));
    insta::assert_snapshot!(texts.collect::<Vec<_>>().concat());
}
