//! Jobs with known answers that the tests of every engine share.

#![allow(clippy::unwrap_used, reason = "only tests call this")]

use std::collections::BTreeMap;
use std::os::unix::fs::PermissionsExt;
use std::path::Path;
use std::sync::{Arc, LazyLock};
use std::time::Duration;

use glam::DVec3;
use luxproof_photometry::{LuminousIntensityDistribution, LuminousOpening, Photometry, direction};
use luxproof_scene::geometry::{Reflectances, Room};
use luxproof_scene::{
    Bounces, Luminaire, LuminaireModel, Meter, Obstacle, Scene, Shape, Transport, flush, orientation,
};
use luxproof_simulator::Accuracy;

use super::{
    Absent, Budget, Engine, EngineError, EngineRoot, Job, JobDir, Measurement, Sensor, Setting, SharedPrecompute,
    Support, Version,
};
use luxproof_model::{EngineName, MeterId, ProcedureId};
use luxproof_process::process::{PeakMemory, ProcessPool};

pub const CONVERGED: Transport = Transport::Indirect(Bounces::Converged);
pub const S1_DIRECT_LX: [f64; 4] = [0.852757462813, 2.230931614869, 2.230931614869, 13.559183673469];
pub const S1_INDIRECT_LX: [f64; 4] = [0.94314714, 1.15551735, 1.15551735, 1.42062868];
/// Indirect light cut at seven reflections.
pub const S1_SEVEN_LX: [f64; 4] = [0.93537, 1.14730, 1.14730, 1.41182];
pub const S1_FIRST_LX: [f64; 4] = [0.4827964416, 0.6295558520, 0.6295558520, 0.8360829517];

pub fn photometry(distribution: LuminousIntensityDistribution) -> Arc<Photometry> {
    Arc::new(Photometry::of(distribution))
}

pub fn luminaire(id: &str, at_m: DVec3, distribution: LuminousIntensityDistribution) -> Luminaire {
    Luminaire {
        id: id.into(),
        photometry: photometry(distribution),
        position_m: at_m,
        orientation: orientation(0.0, 0.0, 0.0),
        flux_scale: 1.0,
        model: LuminaireModel::Point,
    }
}

pub fn axial_uplight() -> LuminousIntensityDistribution {
    let gamma = vec![0.0, 89.0, 90.0, 95.0, 115.0, 135.0, 155.0, 175.0, 180.0];
    let candela = vec![0.0, 0.0, 4.5, 35.7, 218.3, 421.6, 576.4, 662.3, 664.4];
    LuminousIntensityDistribution::axial(gamma, candela).unwrap()
}

/// No symmetry at all, uneven planes; every plane meets at the poles.
pub fn lopsided() -> LuminousIntensityDistribution {
    let c = vec![0.0, 20.0, 90.0, 135.0, 250.0, 360.0];
    let gamma = vec![0.0, 15.0, 40.0, 70.0, 90.0, 130.0, 180.0];
    let candela = c.iter().flat_map(|&c| gamma.iter().map(move |&g| lopsided_cd(c % 360.0, g))).collect();
    LuminousIntensityDistribution::new(c, gamma, candela).unwrap()
}

fn lopsided_cd(c: f64, g: f64) -> f64 {
    let swing = (g.to_radians().sin()) * (0.6 * c.to_radians().cos() + 0.3 * (2.0 * c.to_radians()).sin());
    500.0 + 300.0 * g.to_radians().cos() + 250.0 * swing
}

pub fn quadrant() -> LuminousIntensityDistribution {
    let c = vec![0.0, 30.0, 90.0];
    let candela = [[900.0, 700.0, 80.0, 0.0], [900.0, 820.0, 150.0, 0.0], [900.0, 1000.0, 400.0, 0.0]].concat();
    LuminousIntensityDistribution::new(c, vec![0.0, 30.0, 60.0, 90.0], candela).unwrap()
}

/// Random angles, C 90 to 270 and a part of gamma, and random values, half of them dark.
pub fn random_table(random: &mut fastrand::Rng) -> LuminousIntensityDistribution {
    let c: Vec<f64> = [vec![90.0], random_angles(random, 91.0, 269.0, 3), vec![270.0]].concat();
    let gamma = random_angles(random, 0.0, 180.0, 5);
    let candela = (0..c.len() * gamma.len()).map(|_| (1000.0 * random.f64() - 500.0).max(0.0)).collect();
    LuminousIntensityDistribution::new(c, gamma, candela).unwrap()
}

/// So many numbers between two, in order.
fn random_angles(random: &mut fastrand::Rng, low: f64, high: f64, count: usize) -> Vec<f64> {
    let mut all: Vec<f64> = (0..count).map(|_| low + (high - low) * random.f64()).collect();
    all.sort_by(f64::total_cmp);
    all
}

/// A point in a box.
fn random_point(random: &mut fastrand::Rng, low: DVec3, high: DVec3) -> DVec3 {
    low + (high - low) * DVec3::from_array([(); 3].map(|()| random.f64()))
}

/// Direct light of luminaires with random tables, turned anyhow and a thousand times as bright as one another, at twelve meters, of which
/// four lie nearly in the plane of one; where `openings` is given, from flat openings past a box.
pub fn random_room(random: &mut fastrand::Rng, openings: bool) -> Job {
    let size_m = DVec3::new(8.0, 6.0, 3.5);
    let luminaires: Vec<Luminaire> = (0..3)
        .map(|k| {
            let at_m = random_point(random, DVec3::new(0.8, 0.8, 2.0), size_m - DVec3::splat(0.8));
            let mut lamp = luminaire(&format!("l{k}"), at_m, random_table(random));
            if k > 0 {
                lamp.orientation = orientation(360.0 * random.f64(), 180.0 * random.f64(), 360.0 * random.f64());
            }
            lamp.flux_scale = [1.0, 1000.0, 0.001][k];
            let shape = match k {
                0 => LuminousOpening::Box { x_m: 0.6, y_m: 0.3, height_m: 0.0 },
                1 => LuminousOpening::Ellipse { x_m: 0.2, y_m: 0.2, height_m: 0.0 },
                _ => LuminousOpening::Point,
            };
            if openings { with_opening(lamp, shape) } else { lamp }
        })
        .collect();
    let low = [[1.0, 2.0, 0.0], [3.0, 3.0, 0.9]];
    let obstacles = if openings { vec![cuboid(low[0], low[1], 0.0)] } else { vec![] };
    let beside = luminaires[0].position_m.z;
    let points: Vec<[f64; 3]> = (0..12)
        .map(|k| {
            let mut p = random_point(random, DVec3::new(3.2, 0.1, 0.1), size_m - DVec3::new(0.1, 0.1, 1.6));
            if k < 4 {
                p = DVec3::new(0.02, p.y, beside + [0.3, 0.02, -0.02, -0.2][k]);
            }
            p.to_array()
        })
        .collect();
    let mut sensors = sensors(&points, DVec3::Z);
    sensors[..4].iter_mut().for_each(|s| s.meter.normal = DVec3::X);
    let scene = Scene { room: Some(room(size_m, 0.0, 0.0, 0.0)), obstacles, luminaires };
    within(5e-3, job(scene, sensors, Transport::Direct))
}

pub fn room(size_m: DVec3, floor: f64, walls: f64, ceiling: f64) -> Room {
    Room { size_m, reflectance: Reflectances::with_equal_walls(floor, walls, ceiling) }
}

pub fn sensors(points_m: &[[f64; 3]], normal: DVec3) -> Vec<Sensor> {
    let meters = points_m.iter().map(|p| Meter { position_m: DVec3::from_array(*p), normal });
    meters.enumerate().map(|(k, meter)| Sensor { id: MeterId::new("m", k), meter }).collect()
}

pub const fn procedure_of(transport: Transport) -> ProcedureId {
    match transport {
        Transport::Direct => ProcedureId::DirectIlluminance,
        Transport::Indirect(_) => ProcedureId::IndirectIlluminance,
        Transport::Total(_) => ProcedureId::TotalIlluminance,
    }
}

pub fn job(scene: Scene, sensors: Vec<Sensor>, transport: Transport) -> Job {
    Job {
        case: "test case".into(),
        procedure: procedure_of(transport),
        scene,
        sensors,
        transport,
        budget: Budget { relative_error: 1e-3, seconds: 20.0 },
        seed: 1,
        settings: BTreeMap::new(),
    }
}

pub fn s1(transport: Transport) -> Job {
    let scene = Scene {
        room: Some(room(DVec3::splat(20.0), 0.2, 0.5, 0.8)),
        obstacles: vec![],
        luminaires: vec![luminaire("axial", DVec3::splat(10.0), axial_uplight())],
    };
    let (z, normal) = if transport == Transport::Direct { (17.0, DVec3::NEG_Z) } else { (2.0, DVec3::Z) };
    job(scene, sensors(&[[2.0, 2.0, z], [2.0, 10.0, z], [10.0, 2.0, z], [10.0, 10.0, z]], normal), transport)
}

pub const S2_PANELS_M: [[f64; 2]; 4] = [[2.0, 1.5], [6.0, 1.5], [2.0, 4.5], [6.0, 4.5]];
/// Of the first five points of S2; the sixth is in the shadow.
pub const S2_DIRECT_LX: [f64; 5] = [66.24407, 226.03927, 161.02976, 123.15923, 210.12365];
pub const S2_INDIRECT_LX: [f64; 6] = [51.0232, 53.0644, 48.966, 53.512, 50.245, 18.788];

/// Case S2 of the reference, whose luminaires are Lambertian panels of .6 m flush with the ceiling at `S2_PANELS_M`.
pub fn s2(luminaires: Vec<Luminaire>, transport: Transport) -> Job {
    let boxes =
        [([1.0, 1.0, 0.0], [2.6, 1.8, 0.75]), ([4.5, 3.5, 0.0], [6.1, 4.3, 0.75]), ([5.5, 0.5, 0.0], [7.5, 1.5, 2.2])];
    let scene = Scene {
        room: Some(room(DVec3::new(8.0, 6.0, 3.0), 0.2, 0.5, 0.8)),
        obstacles: boxes.map(|(min, max)| cuboid(min, max, 0.5)).to_vec(),
        luminaires,
    };
    let points = [[0.25, 0.25], [1.75, 1.25], [3.75, 2.75], [4.25, 0.75], [5.25, 3.75], [7.25, 0.25]];
    job(scene, sensors(&points.map(|[x, y]| [x, y, 0.8]), DVec3::Z), transport)
}

/// The same with panels that are let into the ceiling, each black where it is.
pub fn s2_with_panels(transport: Transport) -> Job {
    let opening = LuminousOpening::Box { x_m: 0.6, y_m: 0.6, height_m: 0.0 };
    let panels = S2_PANELS_M.map(|[x, y]| luminaire("panel", DVec3::new(x, y, 3.0), lambertian()));
    let mut job = s2(panels.map(|panel| with_opening(panel, opening)).to_vec(), transport);
    let room = job.scene.room.unwrap();
    job.scene.obstacles.extend(job.scene.luminaires.iter().map(|panel| flush::plate(&room, panel).unwrap()));
    job.budget.relative_error = by_night(4e-3, 8e-3);
    job
}

pub fn with_preset(mut job: Job, preset: &str) -> Job {
    job.settings.insert("preset".into(), preset.into());
    job
}

pub fn cuboid(min: [f64; 3], max: [f64; 3], reflectance: f64) -> Obstacle {
    let (min_m, max_m) = (DVec3::from_array(min), DVec3::from_array(max));
    Obstacle { shape: Shape::Box { min_m, max_m }, reflectance }
}

/// Turned about every axis and dimmed, so that what is mirrored, turned back or left out shows.
pub fn turned(distribution: LuminousIntensityDistribution) -> Luminaire {
    let lamp = luminaire("turned", DVec3::new(1.0, 2.0, 3.0), distribution);
    Luminaire { orientation: orientation(30.0, 20.0, 10.0), flux_scale: 0.7, ..lamp }
}

/// The same scene with all lengths and all light times so much.
pub fn scaled(mut job: Job, size: f64, flux: f64) -> Job {
    if let Some(room) = &mut job.scene.room {
        room.size_m *= size;
    }
    for lamp in &mut job.scene.luminaires {
        lamp.flux_scale *= flux;
        lamp.position_m *= size;
    }
    job.sensors.iter_mut().for_each(|s| s.meter.position_m *= size);
    job
}

/// What a study that renders for long takes in every test run, and what it takes where `LUXPROOF_NIGHTLY` is set, as `ci/nightly` does:
/// the same assertions on more or finer samples.
pub fn by_night<T>(night: T, day: T) -> T {
    if std::env::var_os("LUXPROOF_NIGHTLY").is_some() { night } else { day }
}

pub fn within(relative_error: f64, job: Job) -> Job {
    Job { budget: Budget { relative_error, seconds: 60.0 }, ..job }
}

/// 1000 cd downwards, and the cosine elsewhere, straight between quarter degrees.
pub fn lambertian() -> LuminousIntensityDistribution {
    let gamma: Vec<f64> = (0..=360).map(|k| 0.25 * f64::from(k)).collect();
    let candela = gamma.iter().map(|g| 1000.0 * g.to_radians().cos().max(0.0)).collect();
    LuminousIntensityDistribution::axial(gamma, candela).unwrap()
}

/// A luminaire that sends out its light from an opening.
pub fn with_opening(lamp: Luminaire, opening: LuminousOpening) -> Luminaire {
    let photometry = Arc::new(Photometry { opening, ..(*lamp.photometry).clone() });
    Luminaire { photometry, model: LuminaireModel::Area, ..lamp }
}

/// Every (C, gamma) of a grid, read at `distance_m` in free field.
pub fn goniometer(luminaire: &Luminaire, distance_m: f64, c_deg: &[f64], gamma_deg: &[f64]) -> Job {
    let own = c_deg.iter().flat_map(|&c| gamma_deg.iter().map(move |&g| direction(c, g)));
    let directions = own.map(|own| luminaire.orientation * own);
    let meters = directions.map(|d| Meter { position_m: luminaire.position_m + distance_m * d, normal: -d });
    let sensors = meters.enumerate().map(|(k, meter)| Sensor { id: MeterId::new("g", k), meter }).collect();
    job(Scene { luminaires: vec![luminaire.clone()], ..Scene::default() }, sensors, Transport::Direct)
}

/// Inverse-square law in an empty convex room or free field.
pub fn exact_direct_lx(job: &Job) -> Vec<f64> {
    let luminaires = &job.scene.luminaires;
    job.sensors.iter().map(|s| luminaires.iter().map(|l| point_source_lx(l, &s.meter)).sum()).collect()
}

fn point_source_lx(luminaire: &Luminaire, meter: &Meter) -> f64 {
    let ray = meter.position_m - luminaire.position_m;
    let cosine = (-ray.normalize().dot(meter.normal)).max(0.0);
    luminaire.intensity_towards(ray).value() * cosine / ray.length_squared()
}

pub fn relative_deviations(measurement: &Measurement, exact: &[f64]) -> Vec<f64> {
    measurement.estimates.iter().zip(exact).map(|(e, x)| e.value / x - 1.0).collect()
}

pub fn worst(deviations: &[f64]) -> f64 {
    deviations.iter().fold(0.0, |w: f64, d| if d.is_nan() { f64::INFINITY } else { w.max(d.abs()) })
}

pub fn worst_relative(measurement: &Measurement, exact: &[f64]) -> f64 {
    worst(&relative_deviations(measurement, exact))
}

pub fn simulated_lx(job: &Job, relative_error: f64) -> Vec<f64> {
    let meters: Vec<_> = job.sensors.iter().map(|s| s.meter).collect();
    let accuracy = Accuracy { relative_error, seed: 1 };
    let solution = luxproof_simulator::illuminance(&job.scene, &meters, job.transport, &accuracy).unwrap();
    solution.estimates.iter().map(|e| e.illuminance.value()).collect()
}

/// The folder of engines that tests use: `LUXPROOF_ENGINES`, as for the program, or else that of the user.
pub fn test_root() -> EngineRoot {
    let named = std::env::var_os("LUXPROOF_ENGINES").filter(|folder| !folder.is_empty());
    named.map_or_else(|| EngineRoot::of_user().unwrap(), |folder| EngineRoot::at(std::path::absolute(folder).unwrap()))
}

/// The same for tests of one engine.
///
/// # Panics
///
/// Where the engine is not installed, with the command that installs it.
#[track_caller]
pub fn test_root_of(engine: &dyn Engine) -> EngineRoot {
    let (root, name) = (test_root(), engine.name());
    if let Err(absent) = engine.probe(&root) {
        let folder = root.root().display();
        panic!(
            "this test needs {name} in {folder}; run `luxproof engines install {name} --engines-dir {folder}` ({absent})"
        );
    }
    root
}

/// A job's bench in a folder, with more time than a test takes.
pub fn job_dir(site: EngineRoot, folder: &Path) -> JobDir {
    JobDir {
        site,
        scene_dir: folder.to_owned(),
        log: folder.join("log"),
        jobs: 2,
        patience: Duration::from_secs(120),
        limit: Duration::from_secs(120),
        peak: PeakMemory::default(),
        shared_precompute: SharedPrecompute::default(),
        idle: None,
        hidden: [].into(),
    }
}

/// The same with drivers that wait for the next job, of whichever test, as those of a run do.
pub fn warm(bench: JobDir) -> JobDir {
    static WAITING: LazyLock<ProcessPool> = LazyLock::new(ProcessPool::default);
    JobDir { idle: Some(WAITING.clone()), ..bench }
}

/// Puts a shell script in a program's place.
pub fn write_program(path: &Path, script: &str) {
    std::fs::create_dir_all(path.parent().unwrap()).unwrap();
    // Written under another name: a script that another thread's child still holds open cannot be run.
    let draft = path.with_extension("draft");
    std::fs::write(&draft, format!("#!/bin/sh\n{script}\n")).unwrap();
    std::fs::set_permissions(&draft, std::fs::Permissions::from_mode(0o755)).unwrap();
    std::fs::rename(draft, path).unwrap();
}

/// The largest deviation in standard errors.
pub fn worst_z(measurement: &Measurement, exact: &[f64]) -> f64 {
    let pairs = measurement.estimates.iter().zip(exact);
    worst(&pairs.map(|(e, x)| (e.value - x) / e.uncertainty.standard_error().unwrap()).collect::<Vec<_>>())
}

/// An engine whose readings a test makes up.
pub struct Fake<R> {
    pub name: &'static str,
    pub supports: fn(&Job) -> Support,
    pub settings: &'static [Setting],
    pub reads_meters_independently: bool,
    pub read: R,
}

impl<R: Fn(&Job) -> Result<Measurement, EngineError> + Send + Sync> Fake<R> {
    pub fn new(name: &'static str, read: R) -> Self {
        Self { name, supports: |_| Support::Yes, settings: &[], reads_meters_independently: false, read }
    }
}

impl<R: Fn(&Job) -> Result<Measurement, EngineError> + Send + Sync> Engine for Fake<R> {
    fn name(&self) -> EngineName {
        EngineName::new(self.name)
    }

    fn reads_meters_independently(&self) -> bool {
        self.reads_meters_independently
    }

    fn probe(&self, _site: &EngineRoot) -> Result<Version, Absent> {
        Ok(Version::without_fingerprint("1"))
    }

    fn supports(&self, job: &Job) -> Support {
        (self.supports)(job)
    }

    fn settings(&self) -> &'static [Setting] {
        self.settings
    }

    fn read(&self, job: &Job, _workbench: &JobDir) -> Result<Measurement, EngineError> {
        (self.read)(job)
    }
}
