//! What holds for every renderer, or for those that follow each reading's light by itself; they run the real ones.

use std::f64::consts::PI;

use glam::DVec3;
use itertools::Itertools;
use luxproof_photometry::LuminousIntensityDistribution;
use luxproof_scene::geometry::{Mesh, Reflectances};
use luxproof_scene::{Bounces, Meter, Obstacle, Shape, Transport, orientation};
use luxproof_simulator::Accuracy;

use super::cycles::tests as cycles;
use super::fixtures::*;
use super::luxcore::tests as luxcore;
use super::mitsuba::tests as mitsuba;
use super::povray::tests as povray;
use super::radiance::tests as radiance;
use super::{Engine, EngineError, Job, JobDir, Measurement, SceneFile};
use luxproof_model::Estimate;
use luxproof_process::process::{ProcessError, ProcessPool};

/// A renderer, and how near the exact values it reads.
#[derive(Clone, Copy)]
struct Renderer {
    read: fn(&Job) -> Measurement,
    /// Direct light of S1: how far it may be off, and how wide its bound may be, relative.
    direct: [f64; 2],
    /// Direct light of turned luminaires: how far it may be off, relative to itself and to the brightest reading.
    turned: [f64; 2],
    /// Direct light of several luminaires that nothing hides: how far it may be off, relative.
    unshaded: f64,
}

const MITSUBA: Renderer = Renderer { read: mitsuba::read, direct: [1e-5, 1e-4], turned: [1e-4, 1e-5], unshaded: 1e-5 };
const CYCLES: Renderer = Renderer { read: cycles::read, direct: [1e-4, 2e-3], turned: [1e-3, 2e-4], unshaded: 1e-3 };
const LUXCORE: Renderer = Renderer { read: luxcore::read, direct: [1e-4, 1e-3], turned: [1e-3, 2e-4], unshaded: 1e-4 };
const RADIANCE: Renderer = Renderer { read: radiance::read, direct: [1e-6; 2], turned: [1e-4, 1e-5], unshaded: 1e-5 };
const POVRAY: Renderer = Renderer { read: povray::read, direct: [1e-6, 1e-4], turned: [0.0, 1e-6], unshaded: 1e-6 };

#[test]
fn direct_light_follows_the_inverse_square_law_within_its_small_bound() {
    for Renderer { read, direct: [off, bound], .. } in [MITSUBA, RADIANCE, POVRAY, CYCLES, LUXCORE] {
        let found = read(&s1(Transport::Direct));
        assert!(worst_relative(&found, &S1_DIRECT_LX) < off, "{found:?}");
        for (estimate, exact) in found.estimates.iter().zip(S1_DIRECT_LX) {
            let stated = estimate.uncertainty.bound();
            assert!((estimate.value - exact).abs() <= stated && stated < bound * exact, "{estimate:?} for {exact}");
        }
    }
}

#[test]
fn indirect_light_is_the_converged_value_within_its_standard_error() {
    for (Renderer { read, .. }, relative_error, stated) in
        [(MITSUBA, 1e-3, 1.05), (RADIANCE, 2e-3, 1.005), (CYCLES, 2e-3, 1.05), (LUXCORE, 2e-3, 1.05)]
    {
        let relative_error = by_night(1.0, 2.0) * relative_error;
        let found = read(&within(relative_error, s1(CONVERGED)));
        let off = worst_relative(&found, &S1_INDIRECT_LX);
        assert!(off < 4.0 * relative_error && worst_z(&found, &S1_INDIRECT_LX) < 4.0, "{found:?}");
        for estimate in &found.estimates {
            let error = estimate.uncertainty.standard_error().unwrap();
            assert!(error < stated * relative_error * estimate.value, "{found:?}");
        }
    }
}

/// A limit that is off by one shows in the first reflection. The difference of seven to the converged value, .6 %, takes long to see.
#[test]
fn n_bounces_are_n_diffuse_reflections() {
    for (Renderer { read, .. }, relative_error, z) in
        [(MITSUBA, 5e-4, 8.0), (RADIANCE, 8e-4, 5.0), (CYCLES, 8e-4, 5.0), (LUXCORE, 8e-4, 5.0)]
    {
        let limits = [(1, S1_FIRST_LX, 1e-2, 20.0), (7, S1_SEVEN_LX, relative_error, z)];
        for (n, exact, relative_error, z) in &limits[..by_night(2, 1)] {
            let found = read(&within(*relative_error, s1(Transport::Indirect(Bounces::AtMost(*n)))));
            assert!(worst_z(&found, exact) < 4.0, "{n}: {found:?}");
            assert!(worst_z(&found, &S1_INDIRECT_LX) > *z, "{n}: {found:?}");
        }
        let none = read(&s1(Transport::Indirect(Bounces::AtMost(0))));
        assert!(none.estimates.iter().all(|e| e.value == 0.0), "{none:?}");
    }
}

#[test]
fn total_is_direct_plus_indirect() {
    let mut total = s1(Transport::Total(Bounces::Converged));
    for sensor in &mut total.sensors {
        sensor.meter.normal = DVec3::NEG_Z;
        sensor.meter.position_m.z = 17.0;
    }
    for (Renderer { read, .. }, relative_error) in [(MITSUBA, 1e-3), (RADIANCE, 2e-3), (CYCLES, 2e-3), (LUXCORE, 2e-3)]
    {
        let total = within(by_night(1.0, 2.5) * relative_error, total.clone());
        let indirect = read(&Job { transport: CONVERGED, ..total.clone() });
        let parts = indirect.estimates.iter().zip(exact_direct_lx(&total));
        for (total, (indirect, direct)) in read(&total).estimates.iter().zip(parts) {
            let sum = direct + indirect.value;
            let [a, b] = [total, indirect].map(|e| e.uncertainty.standard_error().unwrap());
            assert!((total.value - sum).abs() < 4.0 * a.hypot(b) + 1e-5 * sum, "{total:?} {indirect:?} {direct}");
        }
    }
}

#[test]
fn asymmetric_and_turned_luminaires_read_their_own_table() {
    for (Renderer { read, turned: off, .. }, distribution) in
        [MITSUBA, RADIANCE, POVRAY, CYCLES, LUXCORE].into_iter().flat_map(|r| [(r, lopsided()), (r, quadrant())])
    {
        let every = |step: u32, end: u32| (0..=end / step).map(|k| f64::from(k * step)).collect::<Vec<_>>();
        let [c, gamma] = by_night([every(15, 345), every(5, 180)], [every(45, 315), every(15, 180)]);
        let job = goniometer(&turned(distribution), 10.0, &c, &gamma);
        let (found, exact) = (read(&job), exact_direct_lx(&job));
        let scale = exact.iter().copied().fold(0.0, f64::max);
        for (estimate, exact) in found.estimates.iter().zip(exact) {
            let bound = estimate.uncertainty.bound();
            assert!((estimate.value - exact).abs() <= off[0] * exact + off[1] * scale, "{estimate:?} for {exact}");
            assert!((estimate.value - exact).abs() <= bound, "{estimate:?} for {exact}");
        }
    }
}

#[test]
fn where_a_table_begins_to_shine_bounds_hold_within_a_tenth_of_a_degree() {
    let candela = vec![0.0, 0.0, 4.5, 35.7, 664.4, 664.4, 0.0];
    let edges =
        LuminousIntensityDistribution::new(vec![0.0], vec![0.0, 89.9, 90.0, 95.0, 140.0, 141.0, 141.3], candela);
    let gamma = [
        0.0, 80.0, 89.2, 89.6, 89.85, 89.92, 89.95, 90.0, 90.05, 90.4, 92.0, 140.9, 141.05, 141.2, 141.29, 141.5, 180.0,
    ];
    for Renderer { read, .. } in [MITSUBA, RADIANCE, POVRAY, CYCLES, LUXCORE] {
        let job = goniometer(&luminaire("lamp", DVec3::ZERO, edges.clone().unwrap()), 10.0, &[0.0, 70.0], &gamma);
        let found = read(&job);
        for ((estimate, exact), sensor) in found.estimates.iter().zip(exact_direct_lx(&job)).zip(&job.sensors) {
            let bound = estimate.uncertainty.bound();
            assert!((estimate.value - exact).abs() <= bound, "{}: {estimate:?} for {exact}", sensor.id);
        }
    }
}

#[test]
fn panels_over_furniture_give_the_exact_light() {
    for Renderer { read, .. } in [MITSUBA, CYCLES, LUXCORE] {
        let direct = read(&s2_with_panels(Transport::Direct));
        let deviations = relative_deviations(&direct, &S2_DIRECT_LX);
        assert!(worst(&deviations) < 1e-2 && direct.estimates[5].value == 0.0, "{direct:?} {deviations:?}");
        let indirect = read(&s2_with_panels(CONVERGED));
        let deviations = relative_deviations(&indirect, &S2_INDIRECT_LX);
        assert!(worst(&deviations) < 2e-2 && worst_z(&indirect, &S2_INDIRECT_LX) < 4.5, "{indirect:?} {deviations:?}");
    }
}

#[test]
fn far_and_tiny_scenes_are_read_in_coordinates_of_their_own() {
    for (Renderer { read, .. }, off) in [(MITSUBA, 1e-5), (CYCLES, 1e-4), (LUXCORE, 1e-4)] {
        let lamp = luminaire("far", DVec3::new(3e6, 0.0, 10.0), lopsided());
        let mut far = goniometer(&lamp, 10.0, &[40.0], &[20.0, 120.0]);
        assert!(worst(&relative_deviations(&read(&far), &exact_direct_lx(&far))) < off);
        far.settings.insert("recentre".into(), false.into());
        let raw = worst(&relative_deviations(&read(&far), &exact_direct_lx(&far)));
        assert!(raw > 1e-3, "raw 32-bit coordinates would do");

        // S1 a thousand times smaller: a million times the lux, direct and reflected.
        let expected = S1_INDIRECT_LX.map(|lx| 1e6 * lx);
        let tiny = within(by_night(1e-3, 4e-3), scaled(s1(CONVERGED), 1e-3, 1.0));
        assert!(worst_z(&read(&tiny), &expected) < 4.5);
    }
}

#[test]
fn several_luminaires_add_up_and_obstacles_throw_shadows() {
    let mut scene = s1(Transport::Direct).scene;
    scene.luminaires.push(luminaire("lopsided", DVec3::new(4.0, 5.0, 12.0), lopsided()));
    scene.luminaires.push(luminaire("second of its kind", DVec3::new(15.0, 5.0, 12.0), lopsided()));
    let points = [[3.0, 4.0, 5.0], [12.0, 12.0, 6.0], [18.0, 1.0, 1.0]];
    let free = job(scene, sensors(&points, DVec3::Z), Transport::Direct);

    // A plate right above the first meter, once as a box and once as a mesh, hides every luminaire from it alone.
    let (min_m, max_m) = (DVec3::new(2.0, 3.0, 5.5), DVec3::new(4.0, 5.0, 5.6));
    let vertices_m = vec![min_m, max_m.with_y(min_m.y), max_m, min_m.with_y(max_m.y)];
    let plate = Shape::Mesh { vertices_m, triangles: vec![[0, 1, 2], [0, 2, 3]] };
    for Renderer { read, unshaded, .. } in [MITSUBA, RADIANCE, POVRAY, CYCLES, LUXCORE] {
        assert!(worst_relative(&read(&free), &exact_direct_lx(&free)) < unshaded);
        for shape in [Shape::Box { min_m, max_m }, plate.clone(), closed(min_m, max_m)] {
            let mut shaded = free.clone();
            shaded.scene.obstacles = vec![Obstacle { shape, reflectance: 0.3 }];
            shaded.sensors[0].meter.position_m = DVec3::new(3.0, 4.0, 5.4);
            let found = read(&shaded);
            assert_eq!(found.estimates[0].value, 0.0);
            let off = worst(&relative_deviations(&found, &exact_direct_lx(&shaded))[1..]);
            assert!(off < unshaded, "{found:?}");
        }
    }
}

/// A box as twelve triangles.
fn closed(min_m: DVec3, max_m: DVec3) -> Shape {
    Mesh::cuboid(min_m, max_m).into()
}

/// One process is asked for jobs in this order, on one thread and on two by turns, and reads each as one of its own does.
pub(super) fn one_process_that_takes_jobs_one_after_the_other_reads_as_many_do(
    engine: &dyn Engine,
    jobs: &[Job],
    order: impl IntoIterator<Item = usize>,
) {
    let alone: Vec<_> = jobs.iter().map(|job| read_on(engine, job, None, 1)).collect();
    assert!(alone.iter().array_combinations().all(|[a, b]| a != b));
    let idle = ProcessPool::default();
    for (place, k) in order.into_iter().enumerate() {
        let found = read_on(engine, &jobs[k], Some(idle.clone()), 1 + place % 2);
        assert_eq!(found, alone[k], "job {k}, asked at place {place}");
        assert_eq!(idle.count(), 1);
    }
}

fn read_on(engine: &dyn Engine, job: &Job, idle: Option<ProcessPool>, threads: usize) -> Vec<Estimate> {
    let folder = tempfile::tempdir().unwrap();
    let bench = job_dir(test_root_of(engine), folder.path());
    engine.read(job, &JobDir { idle, jobs: threads, ..bench }).unwrap().estimates
}

/// What an engine reads of its own files once they were tampered with.
pub(super) fn read_tampered(
    engine: &dyn Engine,
    job: &Job,
    tamper: impl Fn(&str, String) -> String,
    read: impl Fn(&[SceneFile], &JobDir) -> Result<Measurement, EngineError>,
) -> Measurement {
    let folder = tempfile::tempdir().unwrap();
    let bench = warm(job_dir(test_root_of(engine), folder.path()));
    let mut files = engine.export(job).unwrap();
    for file in &mut files {
        if let Ok(text) = String::from_utf8(file.bytes.clone()) {
            *file = SceneFile::text(&file.name, tamper(&file.name, text));
        }
    }
    read(&files, &bench).unwrap()
}

/// Replaced texts of `file`: one by itself, then what makes a factor pi, drops the multiplier .7 and turns by 90 degrees.
pub(super) fn wrong_exports_are_seen(
    file: &str,
    right: f64,
    replaced: [(&str, &str); 4],
    read: impl Fn(&Job, &dyn Fn(&str, String) -> String) -> Measurement,
) {
    let mut lamp = luminaire("turned", DVec3::ZERO, lopsided());
    lamp.flux_scale = 0.7;
    let job = goniometer(&lamp, 10.0, &[0.0, 60.0, 200.0], &[30.0, 80.0]);
    let exact = exact_direct_lx(&job);
    let [unchanged, factor_pi, multiplier_dropped, turned_by_90] = replaced.map(|(from, to)| {
        let found = read(&job, &|name, text| {
            if name != file {
                return text;
            }
            assert!(text.contains(from), "{text}");
            text.replace(from, to)
        });
        worst_relative(&found, &exact)
    });
    assert!(unchanged < right);
    assert!((factor_pi - (PI - 1.0)).abs() < 1e-4 && (multiplier_dropped - 1.0 / 0.7 + 1.0).abs() < 1e-4);
    assert!(turned_by_90 > 0.1, "{turned_by_90}");
}

/// Every way in which a program ends without readings, played by a script in its place, is an error that says so.
pub(super) fn crashes_hangs_and_kills_are_distinguished(read: impl Fn(&str, f64) -> EngineError) {
    for (script, says) in [
        ("kill -SEGV $$", "signal 11"),
        ("kill -ABRT $$", "signal 6"),
        ("kill -KILL $$", "signal 9, out of memory"),
        ("echo 'no such lamp' >&2; exit 3", "exit code 3"),
        ("echo 'no such lamp' >&2; exit 1", "no such lamp"),
    ] {
        let error = read(script, 20.0);
        assert!(matches!(error, EngineError::Process(ProcessError::Failed { .. })), "{script}: {error}");
        assert!(error.to_string().contains(says), "{script}: {error}");
    }
    let hang = read("sleep 60", 0.4);
    assert!(matches!(hang, EngineError::Process(ProcessError::TimedOut { .. })), "{hang}");
}

/// The text of exported files but for those whose names begin like this.
pub(super) fn golden(files: &[SceneFile], without: &[&str]) -> String {
    let shown = files.iter().filter(|f| !without.iter().any(|start| f.name.starts_with(start)));
    shown.map(|f| format!("==== {}\n{}\n", f.name, String::from_utf8_lossy(&f.bytes))).collect_vec().concat()
}

/// A driver that says it reads these sensors, and answers the one request for direct light with a line.
pub(super) fn driver(variant: &str, sensors: &[usize], answer: &str) -> String {
    let sensors: Vec<_> = sensors.iter().map(|k| format!(r#""m[{k}]""#)).collect();
    let part = r#"{"name": "direct", "rays": 4, "sampled": false}"#;
    let greeting = format!(
        r#"{{"versions": {{}}, "variant": "{variant}", "lanes": 131072, "sensors": [{}], "parts": [{part}]}}"#,
        sensors.join(", ")
    );
    format!("read job; echo '{greeting}'; read request; echo '{answer}'; cat > /dev/null")
}

/// Six reflectances, a turned luminaire whose name would end a comment, a box and a mesh: everything that an export writes.
pub(super) fn furnished() -> Job {
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
    let mesh = Shape::Mesh { vertices_m, triangles: vec![[0, 1, 2]] };
    let desk = cuboid([1.0, 1.0, 0.0], [2.6, 1.8, 0.75], 0.5);
    job.scene.obstacles = vec![desk, Obstacle { shape: mesh, reflectance: 0.25 }];
    job.sensors.truncate(2);
    job
}

/// Readings of random rooms are no farther from the simulator's than both bounds allow, and bounds are small enough to decide: below the
/// verification tolerance of direct light, 1 % or .001 lx.
pub(super) fn bounds_hold_and_decide(read: impl Fn(&Job) -> Measurement, openings: bool, rooms: usize) {
    let mut random = fastrand::Rng::with_seed(18);
    let (mut wide, mut all) = (0, 0);
    for _ in 0..rooms {
        let job = random_room(&mut random, openings);
        let meters: Vec<Meter> = job.sensors.iter().map(|s| s.meter).collect();
        let accuracy = Accuracy { relative_error: 1e-4, seed: 1 };
        let right = luxproof_simulator::illuminance(&job.scene, &meters, job.transport, &accuracy).unwrap();
        for (found, (right, sensor)) in read(&job).estimates.iter().zip(right.estimates.iter().zip(&job.sensors)) {
            let of_reference = match right.uncertainty {
                luxproof_simulator::Uncertainty::Bound(bound) => bound,
                luxproof_simulator::Uncertainty::StandardError { value, .. } => 5.0 * value,
            };
            let of_chance = found.uncertainty.standard_error().map_or(0.0, |error| 5.0 * error);
            let (bound, right) = (found.uncertainty.bound(), right.illuminance.value());
            let off = (found.value - right).abs();
            assert!(
                off <= bound + of_reference + of_chance,
                "{}: {found:?} for {right} within {of_reference}",
                sensor.id
            );
            wide += usize::from(bound > (0.01 * right).max(1e-3));
            all += 1;
        }
    }
    assert!(wide * 20 <= all, "{wide} of {all} bounds decide nothing");
}
