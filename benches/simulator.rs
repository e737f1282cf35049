//! Error against time for cases S1 and S2, one more meter, direct light, peak memory: `cargo bench -p luxproof-physics-tests --bench simulator`.
//!
//! Prints a table in Markdown, which `ci/benchmarks/error_against_time.py` draws. Times are the best of a few runs, since whatever else a machine
//! does only adds, and those of the processor where the system tells them.

use std::sync::Arc;
use std::time::Instant;

use glam::{DMat3, DVec3};
use luxproof_photometry::{LuminousIntensityDistribution, LuminousOpening, Photometry};
use luxproof_scene::geometry::{Reflectances, Room};
use luxproof_scene::{Bounces, Luminaire, LuminaireModel, Meter, Obstacle, Scene, Shape, Transport};
use luxproof_simulator::{Accuracy, Prepared, SimulatorError, Solution, Uncertainty, certified, illuminance};

/// Converged indirect illuminance of S1's four meters: hp collocation of order 12 with three elements a half side, path tracing agrees.
const S1_INDIRECT: [f64; 4] = [0.943147117, 1.155517316, 1.155517316, 1.420628646];
/// x, y, indirect illuminance and standard error at S2's 184 meters: 8 scrambles of up to 2^19 paths a meter.
const S2_INDIRECT: &str = include_str!("../reference/analytic/values/s2_indirect.txt");

type Failure = Box<dyn std::error::Error>;

const CONVERGED: Transport = Transport::Indirect(Bounces::Converged);

fn main() -> Result<(), Failure> {
    println!("| case | asked | median error | worst error | worst bound | ms | solver |");
    println!("|---|---|---|---|---|---|---|");
    let (scene, meters) = s1()?;
    for asked in [1e-1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7] {
        row(("S1", illuminance), &scene, &meters, asked, &S1_INDIRECT, 3)?;
    }
    for asked in [3e-2, 1e-2, 3e-3, 1e-3] {
        row(("S1, paths", certified), &scene, &meters, asked, &S1_INDIRECT, 1)?;
    }
    more_meters(&scene, &meters)?;
    let (scene, meters, truth) = s2()?;
    let few: Vec<Meter> = meters.iter().step_by(FEW).copied().collect();
    let truth_of_few: Vec<f64> = truth.iter().step_by(FEW).copied().collect();
    for asked in [1e-1, 3e-2, 1e-2, 3e-3] {
        row(("S2", illuminance), &scene, &few, asked, &truth_of_few, 1)?;
    }
    for asked in [3e-2, 1e-2] {
        row(("S2, paths", certified), &scene, &few, asked, &truth_of_few, 1)?;
    }
    let (_, ms) = best(3, || illuminance(&scene, &meters, Transport::Direct, &accuracy(1e-9)))?;
    println!("\nDirect light of S2: {:.2} µs a meter.", 1e3 * ms / meters.len() as f64);
    if let Some(peak) = peak_memory_mib() {
        println!("Peak memory of all of this: {peak:.0} MiB.");
    }
    Ok(())
}

type Solve = fn(&Scene, &[Meter], Transport, &Accuracy) -> Result<Solution, SimulatorError>;

/// Every how many of S2's meters are read.
const FEW: usize = 26;

fn row(
    (case, solve): (&str, Solve),
    scene: &Scene,
    meters: &[Meter],
    asked: f64,
    truth: &[f64],
    runs: u32,
) -> Result<(), SimulatorError> {
    let (solution, ms) = best(runs, || solve(scene, meters, CONVERGED, &accuracy(asked)))?;
    let pairs = || solution.estimates.iter().zip(truth);
    let mut errors: Vec<f64> = pairs().map(|(e, t)| (e.illuminance.value() / t - 1.0).abs()).collect();
    errors.sort_by(f64::total_cmp);
    let bound = pairs().map(|(e, t)| half_width(e.uncertainty) / t).fold(0.0, f64::max);
    let (median, worst) = (errors[errors.len() / 2], errors[errors.len() - 1]);
    println!("| {case} | {asked:e} | {median:.1e} | {worst:.1e} | {bound:.1e} | {ms:.2} | {} |", solution.solver);
    Ok(())
}

fn more_meters(scene: &Scene, meters: &[Meter]) -> Result<(), SimulatorError> {
    let mut prepared = Prepared::new(scene, CONVERGED, &accuracy(1e-3))?;
    prepared.illuminance(meters)?;
    let (_, ms) = best(20, || prepared.illuminance(&meters[..1]))?;
    println!("| S1, one more meter | 1e-3 | | | | {ms:.3} | the same, solved before |");
    let many: Vec<Meter> = (0..10_000).map(|k| up(0.001 + 0.0019 * f64::from(k), 7.0)).collect();
    let (_, ms) = best(3, || illuminance(scene, &many, Transport::Direct, &accuracy(1e-3)))?;
    println!("| S1, direct, a meter | | | | | {:.6} | inverse square |", ms / many.len() as f64);
    Ok(())
}

/// The result and the least time in milliseconds of some runs.
fn best(
    runs: u32,
    mut run: impl FnMut() -> Result<Solution, SimulatorError>,
) -> Result<(Solution, f64), SimulatorError> {
    let mut least = f64::INFINITY;
    let mut time = || {
        let (start, processor_ms) = (Instant::now(), processor_ms());
        let solution = run();
        let wall_ms = 1e3 * start.elapsed().as_secs_f64();
        let processor_ms = processor_ms.zip(self::processor_ms()).filter(|_| wall_ms > TICK_MS);
        least = least.min(processor_ms.map_or(wall_ms, |(from, to)| to - from));
        solution
    };
    let mut solution = time()?;
    for _ in 1..runs {
        solution = time()?;
    }
    Ok((solution, least))
}

/// What takes less is timed by the clock: what a thread has had of a processor is updated only now and then.
const TICK_MS: f64 = 10.0;

/// What all threads of this process have had of the processors so far.
fn processor_ms() -> Option<f64> {
    let of = |thread: std::io::Result<std::fs::DirEntry>| {
        let reported = std::fs::read_to_string(thread.ok()?.path().join("schedstat")).ok()?;
        reported.split(' ').next()?.parse::<f64>().ok()
    };
    let all: Option<f64> = std::fs::read_dir("/proc/self/task").ok()?.map(of).sum();
    all.map(|ns| 1e-6 * ns)
}

/// A bound, or half of a 95 % t-interval with seven degrees of freedom.
fn half_width(uncertainty: Uncertainty) -> f64 {
    match uncertainty {
        Uncertainty::Bound(bound) => bound,
        Uncertainty::StandardError { value, .. } => 2.365 * value,
    }
}

fn accuracy(relative_error: f64) -> Accuracy {
    Accuracy { relative_error, seed: 1 }
}

fn up(x: f64, y: f64) -> Meter {
    Meter { position_m: DVec3::new(x, y, 0.8), normal: DVec3::Z }
}

fn luminaire(distribution: LuminousIntensityDistribution, position_m: DVec3) -> Luminaire {
    Luminaire {
        id: "a".into(),
        photometry: Arc::new(Photometry::of(distribution)),
        position_m,
        orientation: DMat3::IDENTITY,
        flux_scale: 1.0,
        model: LuminaireModel::Point,
    }
}

/// Case S1: a 20 m cube with an axial uplight in its centre.
fn s1() -> Result<(Scene, Vec<Meter>), Failure> {
    let gamma = vec![0.0, 89.0, 90.0, 95.0, 115.0, 135.0, 155.0, 175.0, 180.0];
    let candela = vec![0.0, 0.0, 4.5, 35.7, 218.3, 421.6, 576.4, 662.3, 664.4];
    let uplight = LuminousIntensityDistribution::axial(gamma, candela)?;
    let room = Room { size_m: DVec3::splat(20.0), reflectance: Reflectances::with_equal_walls(0.2, 0.5, 0.8) };
    let luminaires = vec![luminaire(uplight, DVec3::splat(10.0))];
    let at = |[x, y]: [f64; 2]| Meter { position_m: DVec3::new(x, y, 2.0), normal: DVec3::Z };
    let meters = [[2.0, 2.0], [2.0, 10.0], [10.0, 2.0], [10.0, 10.0]].map(at).to_vec();
    Ok((Scene { room: Some(room), obstacles: vec![], luminaires }, meters))
}

/// Case S2: a furnished room with four black-backed panels, its meters and what they read.
fn s2() -> Result<(Scene, Vec<Meter>, Vec<f64>), Failure> {
    let gamma: Vec<f64> = (0..=180).map(|k| 0.5 * f64::from(k)).collect();
    let candela = gamma.iter().map(|g| 1000.0 * g.to_radians().cos().max(0.0)).collect();
    let lambertian = LuminousIntensityDistribution::axial(gamma, candela)?;
    let opening = LuminousOpening::Box { x_m: 0.6, y_m: 0.6, height_m: 0.0 };
    let photometry = Arc::new(Photometry { opening, ..Photometry::of(lambertian.clone()) });
    let centres = [[2.0, 1.5], [6.0, 1.5], [2.0, 4.5], [6.0, 4.5]].map(|[x, y]| DVec3::new(x, y, 3.0));
    let panel = |at: DVec3| {
        let point = luminaire(lambertian.clone(), at);
        Luminaire { photometry: photometry.clone(), model: LuminaireModel::Area, ..point }
    };
    let back = |at: DVec3| {
        let corners = [[-0.3, -0.3], [-0.3, 0.3], [0.3, 0.3], [0.3, -0.3]];
        let vertices_m = corners.map(|[x, y]| at + DVec3::new(x, y, 0.0)).to_vec();
        Obstacle { shape: Shape::Mesh { vertices_m, triangles: vec![[0, 1, 2], [0, 2, 3]] }, reflectance: 0.0 }
    };
    let cabinet = |min: [f64; 3], max: [f64; 3]| Obstacle {
        shape: Shape::Box { min_m: DVec3::from(min), max_m: DVec3::from(max) },
        reflectance: 0.5,
    };
    let cabinets = [
        cabinet([1.0, 1.0, 0.0], [2.6, 1.8, 0.75]),
        cabinet([4.5, 3.5, 0.0], [6.1, 4.3, 0.75]),
        cabinet([5.5, 0.5, 0.0], [7.5, 1.5, 2.2]),
    ];
    let reflectance = Reflectances::with_equal_walls(0.2, 0.5, 0.8);
    let scene = Scene {
        room: Some(Room { size_m: DVec3::new(8.0, 6.0, 3.0), reflectance }),
        obstacles: cabinets.into_iter().chain(centres.map(back)).collect(),
        luminaires: centres.map(panel).to_vec(),
    };
    let (mut meters, mut truth) = (vec![], vec![]);
    for line in S2_INDIRECT.lines().filter(|line| !line.starts_with('#')) {
        let numbers = line.split(' ').map(str::parse).collect::<Result<Vec<f64>, _>>()?;
        meters.push(up(numbers[0], numbers[1]));
        truth.push(numbers[2]);
    }
    Ok((scene, meters, truth))
}

/// The most memory that the process has held, where the system tells.
fn peak_memory_mib() -> Option<f64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    line.trim().strip_suffix("kB")?.trim().parse::<f64>().ok().map(|kib| kib / 1024.0)
}
