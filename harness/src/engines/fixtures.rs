//! Jobs with known answers that the tests of every engine share.

use std::collections::BTreeMap;
use std::os::unix::fs::PermissionsExt;
use std::path::Path;
use std::sync::{Arc, LazyLock};
use std::time::Duration;

use glam::DVec3;
use luminaire::geometry::{Reflectances, Room};
use luminaire::photometry::{LuminousIntensityDistribution, LuminousOpening, Photometry, direction};
use luminaire::scene::{
    Bounces, Luminaire, LuminaireModel, Meter, Obstacle, Scene, Shape, Transport, flush, orientation,
};
use luminaire::simulator::{self, Accuracy};

use super::{
    Absent, Budget, Engine, EngineError, Groundwork, Job, Knob, Measurement, Site, Station, Support, Version, Workbench,
};
use crate::record::{EngineName, Estimate, MeterId, ProcedureId};
use crate::system::process::{Idle, PeakMemory};

pub(crate) const CONVERGED: Transport = Transport::Indirect(Bounces::Converged);
pub(super) const S1_DIRECT_LX: [f64; 4] = [0.852757462813, 2.230931614869, 2.230931614869, 13.559183673469];
pub(crate) const S1_INDIRECT_LX: [f64; 4] = [0.94314714, 1.15551735, 1.15551735, 1.42062868];
/// Indirect light cut at seven reflections.
pub(super) const S1_SEVEN_LX: [f64; 4] = [0.93537, 1.14730, 1.14730, 1.41182];
pub(super) const S1_FIRST_LX: [f64; 4] = [0.4827964416, 0.6295558520, 0.6295558520, 0.8360829517];

pub(crate) fn photometry(distribution: LuminousIntensityDistribution) -> Arc<Photometry> {
    Arc::new(Photometry::of(distribution))
}

pub(crate) fn luminaire(id: &str, at_m: DVec3, distribution: LuminousIntensityDistribution) -> Luminaire {
    Luminaire {
        id: id.into(),
        photometry: photometry(distribution),
        position_m: at_m,
        orientation: orientation(0.0, 0.0, 0.0),
        flux_scale: 1.0,
        model: LuminaireModel::Point,
    }
}

pub(crate) fn axial_uplight() -> LuminousIntensityDistribution {
    let gamma = vec![0.0, 89.0, 90.0, 95.0, 115.0, 135.0, 155.0, 175.0, 180.0];
    let candela = vec![0.0, 0.0, 4.5, 35.7, 218.3, 421.6, 576.4, 662.3, 664.4];
    LuminousIntensityDistribution::axial(gamma, candela).unwrap()
}

/// No symmetry at all, uneven planes; every plane meets at the poles.
pub(crate) fn lopsided() -> LuminousIntensityDistribution {
    let c = vec![0.0, 20.0, 90.0, 135.0, 250.0, 360.0];
    let gamma = vec![0.0, 15.0, 40.0, 70.0, 90.0, 130.0, 180.0];
    let value = |c: f64, g: f64| {
        let swing = (g.to_radians().sin()) * (0.6 * c.to_radians().cos() + 0.3 * (2.0 * c.to_radians()).sin());
        500.0 + 300.0 * g.to_radians().cos() + 250.0 * swing
    };
    let candela = c.iter().flat_map(|&c| gamma.iter().map(move |&g| value(c % 360.0, g))).collect();
    LuminousIntensityDistribution::new(c, gamma, candela).unwrap()
}

pub(crate) fn quadrant() -> LuminousIntensityDistribution {
    let c = vec![0.0, 30.0, 90.0];
    let candela = [[900.0, 700.0, 80.0, 0.0], [900.0, 820.0, 150.0, 0.0], [900.0, 1000.0, 400.0, 0.0]].concat();
    LuminousIntensityDistribution::new(c, vec![0.0, 30.0, 60.0, 90.0], candela).unwrap()
}

/// Random angles, C 90 to 270 and a part of gamma, and random values, half of them dark.
pub(crate) fn random_table(random: &mut fastrand::Rng) -> LuminousIntensityDistribution {
    let mut between = |low: f64, high: f64, count: usize| {
        let mut all: Vec<f64> = (0..count).map(|_| low + (high - low) * random.f64()).collect();
        all.sort_by(f64::total_cmp);
        all
    };
    let c: Vec<f64> = [vec![90.0], between(91.0, 269.0, 3), vec![270.0]].concat();
    let gamma = between(0.0, 180.0, 5);
    let candela = (0..c.len() * gamma.len()).map(|_| (1000.0 * random.f64() - 500.0).max(0.0)).collect();
    LuminousIntensityDistribution::new(c, gamma, candela).unwrap()
}

/// Direct light of luminaires with random tables, turned anyhow and a thousand times as bright as one another, at twelve meters, of which
/// four lie nearly in the plane of one; where `openings` is given, from flat openings past a box.
pub(crate) fn random_room(random: &mut fastrand::Rng, openings: bool) -> Job {
    let size_m = DVec3::new(8.0, 6.0, 3.5);
    let between = |low: DVec3, high: DVec3, random: &mut fastrand::Rng| {
        low + (high - low) * DVec3::from_array([(); 3].map(|()| random.f64()))
    };
    let luminaires: Vec<Luminaire> = (0..3)
        .map(|k| {
            let at_m = between(DVec3::new(0.8, 0.8, 2.0), size_m - DVec3::splat(0.8), random);
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
            let mut p = between(DVec3::new(3.2, 0.1, 0.1), size_m - DVec3::new(0.1, 0.1, 1.6), random);
            if k < 4 {
                p = DVec3::new(0.02, p.y, beside + [0.3, 0.02, -0.02, -0.2][k]);
            }
            p.to_array()
        })
        .collect();
    let mut stations = stations(&points, DVec3::Z);
    stations[..4].iter_mut().for_each(|s| s.meter.normal = DVec3::X);
    let scene = Scene { room: Some(room(size_m, 0.0, 0.0, 0.0)), obstacles, luminaires };
    within(5e-3, job(scene, stations, Transport::Direct))
}

pub(crate) fn room(size_m: DVec3, floor: f64, walls: f64, ceiling: f64) -> Room {
    Room { size_m, reflectance: Reflectances::with_equal_walls(floor, walls, ceiling) }
}

pub(crate) fn stations(points_m: &[[f64; 3]], normal: DVec3) -> Vec<Station> {
    let station = |(k, p): (usize, &[f64; 3])| {
        let meter = Meter { position_m: DVec3::from_array(*p), normal };
        Station { id: MeterId::new("m", k), meter }
    };
    points_m.iter().enumerate().map(station).collect()
}

pub(crate) const fn procedure_of(transport: Transport) -> ProcedureId {
    match transport {
        Transport::Direct => ProcedureId::DirectIlluminance,
        Transport::Indirect(_) => ProcedureId::IndirectIlluminance,
        Transport::Total(_) => ProcedureId::TotalIlluminance,
    }
}

pub(crate) fn job(scene: Scene, stations: Vec<Station>, transport: Transport) -> Job {
    Job {
        case: "test case".into(),
        procedure: procedure_of(transport),
        scene,
        stations,
        transport,
        budget: Budget { relative_error: 1e-3, seconds: 20.0 },
        seed: 1,
        settings: BTreeMap::new(),
    }
}

pub(crate) fn s1(transport: Transport) -> Job {
    let scene = Scene {
        room: Some(room(DVec3::splat(20.0), 0.2, 0.5, 0.8)),
        obstacles: vec![],
        luminaires: vec![luminaire("axial", DVec3::splat(10.0), axial_uplight())],
    };
    let (z, normal) = if transport == Transport::Direct { (17.0, DVec3::NEG_Z) } else { (2.0, DVec3::Z) };
    job(scene, stations(&[[2.0, 2.0, z], [2.0, 10.0, z], [10.0, 2.0, z], [10.0, 10.0, z]], normal), transport)
}

pub(super) const S2_PANELS_M: [[f64; 2]; 4] = [[2.0, 1.5], [6.0, 1.5], [2.0, 4.5], [6.0, 4.5]];
/// Of the first five points of S2; the sixth is in the shadow.
pub(super) const S2_DIRECT_LX: [f64; 5] = [66.24407, 226.03927, 161.02976, 123.15923, 210.12365];
pub(super) const S2_INDIRECT_LX: [f64; 6] = [51.0232, 53.0644, 48.966, 53.512, 50.245, 18.788];

/// Case S2 of the reference, whose luminaires are Lambertian panels of .6 m flush with the ceiling at `S2_PANELS_M`.
pub(super) fn s2(luminaires: Vec<Luminaire>, transport: Transport) -> Job {
    let boxes =
        [([1.0, 1.0, 0.0], [2.6, 1.8, 0.75]), ([4.5, 3.5, 0.0], [6.1, 4.3, 0.75]), ([5.5, 0.5, 0.0], [7.5, 1.5, 2.2])];
    let scene = Scene {
        room: Some(room(DVec3::new(8.0, 6.0, 3.0), 0.2, 0.5, 0.8)),
        obstacles: boxes.map(|(min, max)| cuboid(min, max, 0.5)).to_vec(),
        luminaires,
    };
    let points = [[0.25, 0.25], [1.75, 1.25], [3.75, 2.75], [4.25, 0.75], [5.25, 3.75], [7.25, 0.25]];
    job(scene, stations(&points.map(|[x, y]| [x, y, 0.8]), DVec3::Z), transport)
}

/// The same with panels that are let into the ceiling, each black where it is.
pub(super) fn s2_with_panels(transport: Transport) -> Job {
    let opening = LuminousOpening::Box { x_m: 0.6, y_m: 0.6, height_m: 0.0 };
    let panel = |[x, y]: [f64; 2]| with_opening(luminaire("panel", DVec3::new(x, y, 3.0), lambertian()), opening);
    let mut job = s2(S2_PANELS_M.map(panel).to_vec(), transport);
    let room = job.scene.room.unwrap();
    job.scene.obstacles.extend(job.scene.luminaires.iter().map(|panel| flush::plate(&room, panel).unwrap()));
    job.budget.relative_error = by_night(4e-3, 8e-3);
    job
}

pub(super) fn with_preset(mut job: Job, preset: &str) -> Job {
    job.settings.insert("preset".into(), preset.into());
    job
}

pub(super) fn cuboid(min: [f64; 3], max: [f64; 3], reflectance: f64) -> Obstacle {
    let (min_m, max_m) = (DVec3::from_array(min), DVec3::from_array(max));
    Obstacle { shape: Shape::Box { min_m, max_m }, reflectance }
}

/// Turned about every axis and dimmed, so that what is mirrored, turned back or left out shows.
pub(super) fn turned(distribution: LuminousIntensityDistribution) -> Luminaire {
    let lamp = luminaire("turned", DVec3::new(1.0, 2.0, 3.0), distribution);
    Luminaire { orientation: orientation(30.0, 20.0, 10.0), flux_scale: 0.7, ..lamp }
}

/// The same scene with all lengths and all light times so much.
pub(super) fn scaled(mut job: Job, size: f64, flux: f64) -> Job {
    if let Some(room) = &mut job.scene.room {
        room.size_m *= size;
    }
    for lamp in &mut job.scene.luminaires {
        lamp.flux_scale *= flux;
        lamp.position_m *= size;
    }
    job.stations.iter_mut().for_each(|s| s.meter.position_m *= size);
    job
}

/// What a study that renders for long takes in every test run, and what it takes where `LUXPROOF_NIGHTLY` is set, as `ci/nightly` does:
/// the same assertions on more or finer samples.
pub(crate) fn by_night<T>(night: T, day: T) -> T {
    if std::env::var_os("LUXPROOF_NIGHTLY").is_some() { night } else { day }
}

pub(super) fn within(relative_error: f64, job: Job) -> Job {
    Job { budget: Budget { relative_error, seconds: 60.0 }, ..job }
}

/// 1000 cd downwards, and the cosine elsewhere, straight between quarter degrees.
pub(crate) fn lambertian() -> LuminousIntensityDistribution {
    let gamma: Vec<f64> = (0..=360).map(|k| 0.25 * f64::from(k)).collect();
    let candela = gamma.iter().map(|g| 1000.0 * g.to_radians().cos().max(0.0)).collect();
    LuminousIntensityDistribution::axial(gamma, candela).unwrap()
}

/// A luminaire that sends out its light from an opening.
pub(crate) fn with_opening(lamp: Luminaire, opening: LuminousOpening) -> Luminaire {
    let photometry = Arc::new(Photometry { opening, ..(*lamp.photometry).clone() });
    Luminaire { photometry, model: LuminaireModel::Area, ..lamp }
}

/// Every (C, gamma) of a grid, read at `distance_m` in free field.
pub(crate) fn goniometer(luminaire: &Luminaire, distance_m: f64, c_deg: &[f64], gamma_deg: &[f64]) -> Job {
    let towards = |c: f64, g: f64| luminaire.orientation * direction(c, g);
    let station = |(k, d): (usize, DVec3)| {
        let meter = Meter { position_m: luminaire.position_m + distance_m * d, normal: -d };
        Station { id: MeterId::new("g", k), meter }
    };
    let directions = c_deg.iter().flat_map(|&c| gamma_deg.iter().map(move |&g| towards(c, g)));
    let stations = directions.enumerate().map(station).collect();
    job(Scene { luminaires: vec![luminaire.clone()], ..Scene::default() }, stations, Transport::Direct)
}

/// Inverse-square law in an empty convex room or free field.
pub(crate) fn exact_direct_lx(job: &Job) -> Vec<f64> {
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

pub(crate) fn relative_deviations(measurement: &Measurement, exact: &[f64]) -> Vec<f64> {
    measurement.estimates.iter().zip(exact).map(|(e, x)| e.value / x - 1.0).collect()
}

pub(crate) fn worst(deviations: &[f64]) -> f64 {
    deviations.iter().fold(0.0, |w: f64, d| if d.is_nan() { f64::INFINITY } else { w.max(d.abs()) })
}

pub(crate) fn worst_relative(measurement: &Measurement, exact: &[f64]) -> f64 {
    worst(&relative_deviations(measurement, exact))
}

pub(crate) fn simulated_lx(job: &Job, relative_error: f64) -> Vec<f64> {
    let meters: Vec<_> = job.stations.iter().map(|s| s.meter).collect();
    let accuracy = Accuracy { relative_error, seed: 1 };
    let solution = simulator::illuminance(&job.scene, &meters, job.transport, &accuracy).unwrap();
    solution.estimates.iter().map(|e| e.illuminance.value()).collect()
}

/// A job's bench in a folder, with more time than a test takes.
pub(super) fn workbench(site: Site, folder: &Path) -> Workbench {
    Workbench {
        site,
        scene_dir: folder.to_owned(),
        log: folder.join("log"),
        jobs: 2,
        patience: Duration::from_secs(120),
        limit: Duration::from_secs(120),
        peak: PeakMemory::default(),
        groundwork: Groundwork::default(),
        idle: None,
    }
}

/// The same with drivers that wait for the next job, of whichever test, as those of a run do.
pub(super) fn warm(bench: Workbench) -> Workbench {
    static WAITING: LazyLock<Idle> = LazyLock::new(Idle::default);
    Workbench { idle: Some(WAITING.clone()), ..bench }
}

/// Puts a shell script in a program's place.
pub(super) fn write_program(path: &Path, script: &str) {
    std::fs::create_dir_all(path.parent().unwrap()).unwrap();
    // Written under another name: a script that another thread's child still holds open cannot be run.
    let draft = path.with_extension("draft");
    std::fs::write(&draft, format!("#!/bin/sh\n{script}\n")).unwrap();
    std::fs::set_permissions(&draft, std::fs::Permissions::from_mode(0o755)).unwrap();
    std::fs::rename(draft, path).unwrap();
}

/// The largest deviation in standard errors.
pub(crate) fn worst_z(measurement: &Measurement, exact: &[f64]) -> f64 {
    let z = |(e, x): (&Estimate, &f64)| (e.value - x) / e.uncertainty.standard_error().unwrap();
    worst(&measurement.estimates.iter().zip(exact).map(z).collect::<Vec<_>>())
}

/// An engine whose readings a test makes up.
pub(crate) struct Fake<R> {
    pub(crate) name: &'static str,
    pub(crate) supports: fn(&Job) -> Support,
    pub(crate) knobs: &'static [Knob],
    pub(crate) reads_meters_apart: bool,
    pub(crate) read: R,
}

impl<R: Fn(&Job) -> Result<Measurement, EngineError> + Send + Sync> Fake<R> {
    pub(crate) fn new(name: &'static str, read: R) -> Self {
        Self { name, supports: |_| Support::Yes, knobs: &[], reads_meters_apart: false, read }
    }
}

impl<R: Fn(&Job) -> Result<Measurement, EngineError> + Send + Sync> Engine for Fake<R> {
    fn name(&self) -> EngineName {
        EngineName::new(self.name)
    }

    fn reads_meters_apart(&self) -> bool {
        self.reads_meters_apart
    }

    fn probe(&self, _site: &Site) -> Result<Version, Absent> {
        Ok(Version::told("1"))
    }

    fn supports(&self, job: &Job) -> Support {
        (self.supports)(job)
    }

    fn knobs(&self) -> &'static [Knob] {
        self.knobs
    }

    fn read(&self, job: &Job, _workbench: &Workbench) -> Result<Measurement, EngineError> {
        (self.read)(job)
    }
}
