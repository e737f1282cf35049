//! What holds for Cycles and LuxCore alike: the real renderers, and every way in which one fails.

use approx::assert_relative_eq;
use glam::DVec3;
use luxproof_photometry::LuminousOpening;
use luxproof_scene::{Luminaire, LuminaireModel, Meter, Obstacle, Scene, Shape, Transport, flush, orientation};

use super::*;
use crate::fixtures::*;
use crate::shared_tests::{self, furnished};
use crate::{Budget, Engine};

/// The tests of an engine that hold for both alike.
macro_rules! hold_for_patches {
    ($engine:expr, $read:expr) => {
        $crate::patches::tests::hold_for_patches!(@ $read;
            flat_openings_send_out_their_table_on_both_sides
            meters_in_free_space_are_read_at_their_very_points
            points_on_surfaces_light_their_room
            recessed_openings_lose_no_light_to_what_lies_behind_them
            what_is_off_is_dark
            grazing_light_is_not_lost
        );
        $crate::patches::tests::hold_for_patches!(@ &$engine;
            one_seed_gives_the_same_readings_on_any_number_of_threads
            what_cannot_be_read_well_is_said_beforehand
            its_own_reader_gets_the_users_bytes
            one_process_that_takes_jobs_one_after_the_other_reads_as_many_do
        );
    };
    (@ $with:expr; $($test:ident)+) => {
        $(
            #[test]
            fn $test() {
                $crate::patches::tests::$test($with);
            }
        )+
    };
}
pub(crate) use hold_for_patches;

/// Rooms, bodies from files and tables that differ under the same names.
pub(crate) fn one_process_that_takes_jobs_one_after_the_other_reads_as_many_do(engine: &dyn Engine) {
    let budget = Budget { relative_error: 0.3, seconds: 20.0 };
    let [mut one, mut other] = [Transport::Direct, CONVERGED].map(|transport| Job { budget, ..s1(transport) });
    let furniture = furnished().scene.obstacles;
    one.scene.obstacles = furniture.clone();
    other.scene.room = Some(room(DVec3::new(9.0, 9.0, 4.0), 0.3, 0.6, 0.1));
    other.scene.obstacles = furniture;
    if let Some(Obstacle { shape: Shape::Mesh { vertices_m, .. }, .. }) = other.scene.obstacles.last_mut() {
        vertices_m[2] = DVec3::new(3.0, 3.0, 2.0);
    }
    let photometry = &mut other.scene.luminaires[0].photometry;
    *photometry = photometry.with_distribution(photometry.distribution.scaled(2.0)).into();
    shared_tests::one_process_that_takes_jobs_one_after_the_other_reads_as_many_do(engine, &[one, other], [0, 1, 0]);
}

/// In a large room, far off: where surfaces behind an opening were a 200,000th of the room apart, Cycles read 1 to 2.5 % too little.
pub(crate) fn recessed_openings_lose_no_light_to_what_lies_behind_them(read: fn(&Job) -> Measurement) {
    let room = room(DVec3::splat(8.0), 0.0, 0.0, 0.0);
    let opening = LuminousOpening::Box { x_m: 1.0, y_m: 1.0, height_m: 0.0 };
    let panel = with_opening(luminaire("panel", DVec3::new(4.0, 4.0, 8.0), lambertian()), opening);
    let obstacles = flush::plate(&room, &panel).into_iter().collect();
    let scene = Scene { room: Some(room), obstacles, luminaires: vec![panel] };
    let job = job(scene, sensors(&[[5.25, 4.0, 4.0], [5.0, 5.0, 4.0], [3.25, 3.3, 6.5]], DVec3::Z), Transport::Direct);
    let deviations = relative_deviations(&read(&job), &simulated_lx(&job, 1e-4));
    assert!(worst(&deviations) < 1.5e-3, "{deviations:?}");
}

pub(crate) fn flat_openings_send_out_their_table_on_both_sides(read: fn(&Job) -> Measurement) {
    let (x_m, y_m) = (0.6, 0.3);
    for opening in
        [LuminousOpening::Box { x_m, y_m, height_m: 0.0 }, LuminousOpening::Ellipse { x_m, y_m, height_m: 0.0 }]
    {
        let mut lamp = with_opening(luminaire("area", DVec3::new(1.0, 2.0, 3.0), lopsided()), opening);
        lamp.orientation = orientation(30.0, 20.0, 10.0);
        let near = goniometer(&lamp, 0.8, &[10.0, 190.0], &[5.0, 80.0, 165.0]);
        let deviations = relative_deviations(&read(&near), &simulated_lx(&near, 3e-3));
        assert!(worst(&deviations) < 6e-3, "{opening:?} {deviations:?}");
        let far = goniometer(&lamp, 30.0, &[10.0, 190.0], &[5.0, 80.0, 165.0]);
        let deviations = relative_deviations(&read(&far), &exact_direct_lx(&far));
        assert!(worst(&deviations) < 3e-3, "{opening:?} {deviations:?}");
    }
}

/// Two centimetres from a luminaire in a large room a hundred thousandth of its size is seen.
pub(crate) fn meters_in_free_space_are_read_at_their_very_points(read: fn(&Job) -> Measurement) {
    let lamp = luminaire("near", DVec3::new(8.0, 8.0, 8.0), lambertian());
    let mut job = goniometer(&lamp, 0.02, &[0.0, 120.0, 240.0], &[5.0, 40.0, 70.0]);
    let deviations = relative_deviations(&read(&job), &exact_direct_lx(&job));
    assert!(worst(&deviations) < 2e-4, "{deviations:?}");
    // The same where a mesh is about them, near none.
    let vertices_m = [DVec3::ZERO, 2.0 * DVec3::X, 2.0 * DVec3::Y].map(|p| p + 7.0).to_vec();
    let shape = Shape::Mesh { vertices_m, triangles: vec![[0, 1, 2]] };
    job.scene.obstacles = vec![Obstacle { shape, reflectance: 0.5 }];
    let deviations = relative_deviations(&read(&job), &exact_direct_lx(&job));
    assert!(worst(&deviations) < 2e-4, "{deviations:?}");
}

/// A meter to which light comes nearly along its plane.
pub(crate) fn grazing_light_is_not_lost(read: fn(&Job) -> Measurement) {
    let mut job = s1(Transport::Direct);
    job.scene.room = None;
    job.scene.luminaires = vec![luminaire("lamp", DVec3::new(3.1725, 1.4533, 1.6187), lambertian())];
    let at = DVec3::new(3.870818, 1.268589, 1.489488);
    let ray = (job.scene.luminaires[0].position_m - at).normalize();
    let sensors = job.sensors.clone();
    job.sensors = sensors
        .into_iter()
        .cycle()
        .take(24)
        .enumerate()
        .map(|(k, mut sensor)| {
            let across = glam::DMat3::from_axis_angle(ray, k as f64) * ray.any_orthonormal_vector();
            sensor.meter = Meter { position_m: at, normal: (across + 1e-3 * ray).normalize() };
            sensor.id = luxproof_model::MeterId::new("grazing", k);
            sensor
        })
        .collect();
    let deviations = relative_deviations(&read(&job), &exact_direct_lx(&job));
    assert!(worst(&deviations) < 2e-3, "{deviations:?}");
}

pub(crate) fn points_on_surfaces_light_their_room(read: fn(&Job) -> Measurement) {
    let mut job = furnished();
    job.scene.room = job
        .scene
        .room
        .map(|room| luxproof_scene::geometry::Room { size_m: DVec3::new(5.6229, 5.1221, 4.7706), ..room });
    job.scene.obstacles.truncate(1);
    job.transport = Transport::Direct;
    for (sensor, at) in job.sensors.iter_mut().zip([DVec3::new(2.8, 2.2, 2.0), DVec3::new(4.1, 3.7, 2.9)]) {
        sensor.meter.position_m = at;
    }
    for (at, normal) in [
        (DVec3::new(1.6234, 3.2518, 4.7706), DVec3::Z),
        (DVec3::new(5.6229, 2.1, 3.3), DVec3::X),
        (DVec3::new(0.0, 5.1221, 3.3), DVec3::Y),
        (DVec3::new(1.7, 1.3, 0.75), DVec3::NEG_Z),
    ] {
        job.scene.luminaires = vec![luminaire("on it", at, lambertian())];
        job.scene.luminaires[0].orientation = glam::DMat3::from_quat(glam::DQuat::from_rotation_arc(DVec3::Z, normal));
        for sensor in &mut job.sensors {
            sensor.meter.normal = (at - sensor.meter.position_m).normalize();
        }
        let exact = simulated_lx(&job, 1e-6);
        assert!(exact.iter().any(|lx| *lx > 1.0), "{exact:?}");
        let deviations = relative_deviations(&read(&job), &exact);
        assert!(worst(&deviations) < 1e-4, "{at} {deviations:?}");
    }
}

pub(crate) fn what_is_off_is_dark(read: fn(&Job) -> Measurement) {
    let mut job = s1(Transport::Direct);
    job.scene.luminaires[0].flux_scale = 0.0;
    assert!(read(&job).estimates.iter().all(|e| e.value == 0.0));
    let opening = LuminousOpening::Box { x_m: 0.6, y_m: 0.6, height_m: 0.0 };
    job.scene.luminaires[0] = with_opening(job.scene.luminaires[0].clone(), opening);
    assert!(read(&job).estimates.iter().all(|e| e.value == 0.0));
    // Beside one that is on.
    let shining = Luminaire { id: "on".into(), flux_scale: 1.0, ..job.scene.luminaires[0].clone() };
    job.scene.luminaires.insert(0, shining.clone());
    let both = read(&job);
    job.scene.luminaires = vec![shining];
    assert!(both.estimates[0].value > 0.0 && both.estimates == read(&job).estimates);
}

pub(crate) fn one_seed_gives_the_same_readings_on_any_number_of_threads(engine: &dyn Engine) {
    let job = with_preset(s1(CONVERGED), "fast");
    let [one, two] = [1, 2].map(|jobs| {
        let folder = tempfile::tempdir().unwrap();
        let bench = JobDir { jobs, ..job_dir(test_root_of(engine), folder.path()) };
        engine.read(&job, &bench).unwrap()
    });
    assert_eq!(one.estimates, two.estimates);
    assert_eq!(one.effort["indirect_blocks"], "8");
    assert!(worst_z(&one, &S1_INDIRECT_LX) < 6.0, "{one:?}");
}

pub(crate) fn what_cannot_be_read_well_is_said_beforehand(engine: &dyn Engine) {
    assert_eq!(engine.supports(&s1(CONVERGED)), Support::Yes);
    assert!(matches!(engine.supports(&with_preset(s1(CONVERGED), "default")), Support::Approximate { .. }));
    let solid = LuminousOpening::Box { x_m: 0.6, y_m: 0.6, height_m: 0.1 };
    let mut job = s1(Transport::Direct);
    job.scene.luminaires = vec![with_opening(luminaire("solid", DVec3::splat(10.0), lambertian()), solid)];
    assert!(matches!(engine.supports(&job), Support::No(why) if why.contains("only flat")));
    job.scene = Scene { luminaires: vec![luminaire("impostor", DVec3::ZERO, lambertian())], ..Scene::default() };
    job.scene.luminaires[0].model = LuminaireModel::Impostor;
    assert!(matches!(engine.supports(&job), Support::No(_)));
}

/// At every degree of C and every half of gamma.
pub(crate) fn is_the_table_but_for_little(looked_up: &impl Resampled) {
    let table = looked_up.table();
    let largest = table.max_intensity().value();
    let mut worst = 0.0_f64;
    for k in 0..360 {
        for j in 0..=360 {
            let (c, gamma) = (f64::from(k), 0.5 * f64::from(j));
            worst = worst.max((looked_up.intensity_cd(c, gamma) - table.intensity(c, gamma).value()).abs());
        }
    }
    assert!(worst < 5e-4 * largest, "{worst} of {largest}");
}

/// Reads S1 through an interpreter that runs `script`, which goes wrong.
pub(crate) fn read_with(
    engine: &dyn Engine,
    own: fn(&EngineRoot) -> EngineRoot,
    script: &str,
    limit_s: f64,
) -> EngineError {
    played(engine, own, script, limit_s).unwrap_err()
}

fn played(
    engine: &dyn Engine,
    own: fn(&EngineRoot) -> EngineRoot,
    script: &str,
    limit_s: f64,
) -> Result<Measurement, EngineError> {
    let folder = tempfile::tempdir().unwrap();
    let site = EngineRoot::at(folder.path().join("site"));
    write_program(&own(&site).venv().join("bin/python"), script);
    let bench = JobDir { limit: Duration::from_secs_f64(limit_s), ..job_dir(site, folder.path()) };
    engine.read(&s1(Transport::Direct), &bench)
}

/// A driver whose renderer rounds normals says by how much, and its bounds are wider by what a meter may gain by a turn.
pub(crate) fn normals_that_are_off_widen_bounds(engine: &dyn Engine, own: fn(&EngineRoot) -> EngineRoot) {
    let driver = shared_tests::driver("CPU", &[0, 1, 2, 3], "[[1, 2, 2, 13]]");
    let off = driver.replace("\"parts\"", "\"normals_off\": [0.0, 1e-3, 0.0, 1e-3], \"parts\"");
    let [right, off] = [driver, off]
        .map(|script| played(engine, own, &script, 30.0).unwrap())
        .map(|found| found.estimates.iter().map(|e| e.uncertainty.bound()).collect::<Vec<_>>());
    let job = s1(Transport::Direct);
    for (k, (right, off)) in right.into_iter().zip(off).enumerate() {
        let (meter, lamp) = (&job.sensors[k].meter, &job.scene.luminaires[0]);
        let ray_m = meter.position_m - lamp.position_m;
        let facing = lamp.intensity_towards(ray_m).value() / ray_m.length_squared();
        assert_relative_eq!(off - right, [0.0, 1e-3][k % 2] * facing, epsilon = 1e-12, max_relative = 1e-6);
    }
}

pub(crate) fn answers_that_are_no_readings_are_errors(read_with: impl Fn(&str, f64) -> EngineError) {
    let answers = |answer| shared_tests::driver("CPU", &[0, 1, 2, 3], answer);
    for (script, said) in [
        (answers("[[1, 2, 3]]"), "gave 3 readings for 4 meters"),
        (answers("[[1, 2, 3, 4], [1, 2, 3, 4]]"), "gave 2 blocks of 1"),
        (answers("[[1, NaN, 3, 4]]"), "no JSON of readings"),
        (shared_tests::driver("CPU", &[0, 1, 2], "[[1, 2, 3]]"), "gave 3 readings for 4 meters"),
        (shared_tests::driver("CPU", &[0, 2, 1, 3], "[[1, 1, 1, 1]]"), "gave `m[2]`"),
        ("echo warming up".into(), "no JSON of readings"),
        (":".into(), "ended without an answer"),
    ] {
        let error = read_with(&script, 30.0);
        assert!(error.to_string().contains(said), "{script}: {error}");
    }
}

pub(crate) fn a_site_without_its_package_says_what_to_run(engine: &dyn Engine, package: &Package) {
    let folder = tempfile::tempdir().unwrap();
    let site = EngineRoot::at(folder.path());
    let absent = |site: &EngineRoot| engine.probe(site).unwrap_err().to_string();
    let (own, name) = ((package.site)(&site), package.module);
    assert!(absent(&site).contains(&format!("luxproof engines install {}", package.engine)), "{}", absent(&site));
    write_program(&own.venv().join("bin/python"), "exit 1");
    assert!(absent(&site).contains(&format!("`{name}` is missing")), "{}", absent(&site));
    std::fs::create_dir_all(own.venv().join("lib/python3/site-packages").join(name)).unwrap();
    write_program(&own.venv().join("bin/python"), "cat > /dev/null; echo no renderer");
    assert!(absent(&site).contains("answered `no renderer`"), "{}", absent(&site));
}

/// With `photometry: native` an engine's own reader gets the user's bytes, one file a table, and of other formats a file of ours.
pub(crate) fn its_own_reader_gets_the_users_bytes(engine: &dyn Engine) {
    let bytes: &[u8] = b"IESNA:LM-63-1995\nTILT=NONE\n1 -1 1 2 1 1 2 0 0 0\n1 1 0\n0 90\n0\n7 7\n";
    let mut job = s1(Transport::Direct);
    job.settings.insert("photometry".into(), "native".into());
    assert!(engine.reads_files(&job) && job.written_for_its_reader().is_some());
    assert!(exported_table(engine, &job).starts_with(b"IESNA:LM-63-2002"));
    job.scene.luminaires[0].photometry = parsed(bytes).into();
    assert_eq!((exported_table(engine, &job), job.written_for_its_reader()), (bytes.to_vec(), None));
    // The same table, said in other words.
    let mut other = job.scene.luminaires[0].clone();
    other.id = "other".into();
    other.photometry = parsed(&[bytes, b"\n"].concat()).into();
    job.scene.luminaires.push(other);
    assert!(matches!(engine.supports(&job), Support::No(why) if why.contains("files that differ")));
}

/// A photometry that has its file's bytes.
fn parsed(bytes: &[u8]) -> luxproof_photometry::Photometry {
    let source = vec![luxproof_photometry::SourceFile { name: "a.ies".into(), bytes: bytes.into() }];
    luxproof_photometry::Photometry { source, ..luxproof_photometry::lm63::parse(bytes).unwrap() }
}

fn exported_table(engine: &dyn Engine, job: &Job) -> Vec<u8> {
    let files = engine.export(job).unwrap();
    files.into_iter().find(|file| file.name == "table-0.ies").unwrap().bytes
}
