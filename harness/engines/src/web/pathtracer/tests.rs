//! What is exported and declined, and the real renderer against closed forms and the simulator.

use std::time::Duration;

use luxproof_photometry::LuminousIntensityDistribution;
use luxproof_process::process::ProcessPool;
use luxproof_scene::Transport;

use super::*;
use crate::fixtures::{
    CONVERGED, S1_DIRECT_LX, exact_direct_lx, job_dir, lopsided, room, s1, simulated_lx, test_root_of, with_preset,
    within, worst_relative, worst_z,
};
use crate::shared_tests::furnished;

fn exported(job: &Job) -> serde_json::Value {
    let files = PathTracer.export(job).unwrap();
    let file = files.iter().find(|file| file.name == JOB_FILE).unwrap();
    serde_json::from_slice(&file.bytes).unwrap()
}

#[test]
fn the_page_gets_every_surface_luminaire_and_meter() {
    let job = furnished();
    let page_job = exported(&job);
    let surfaces = page_job["surfaces"].as_array().unwrap();
    assert_eq!(surfaces.len(), 6 + job.scene.obstacles.len());
    let triangles: usize = job.scene.obstacles.iter().map(|o| o.shape.triangles()).sum();
    let found: usize = surfaces.iter().map(|surface| surface["corners"].as_array().unwrap().len()).sum();
    assert_eq!(found, 12 + triangles);
    assert_eq!(page_job["lamps"].as_array().unwrap().len(), job.scene.luminaires.len());
    assert_eq!(page_job["sensors"].as_array().unwrap().len(), job.sensors.len());
    // A room of a centimetre is drawn larger, by a power of two, and the light with it.
    let mut small = s1(Transport::Direct);
    small.scene.room = Some(room(DVec3::splat(0.01), 0.2, 0.5, 0.8));
    small.scene.luminaires[0].position_m = DVec3::splat(0.005);
    small.sensors.truncate(1);
    small.sensors[0].meter.position_m = DVec3::splat(0.002);
    let page_job = exported(&small);
    // The largest intensity of the table, 664.4 cd, times the square of 1024.
    assert_eq!(page_job["lamps"][0]["candela"], 664.4 * 1024.0 * 1024.0);
    assert_eq!(page_job["lamps"][0]["position"][0], 0.005 * 1024.0);
}

#[test]
fn a_meter_on_a_surface_stands_before_it_and_others_stay_where_they_are() {
    let mut job = s1(CONVERGED);
    job.sensors[0].meter.position_m.z = 1e-6;
    let page_job = exported(&job);
    let free: Vec<bool> = (0..4).map(|k| page_job["sensors"][k]["free"].as_bool().unwrap()).collect();
    assert_eq!(free, [false, true, true, true]);
}

#[test]
fn openings_are_declined_and_a_stock_scene_is_approximate() {
    let mut area = s1(Transport::Direct);
    area.scene.luminaires[0].model = LuminaireModel::Area;
    let Support::No(why) = PathTracer.supports(&area) else { panic!("it has no such source") };
    assert!(why.contains("no source of the model `area`; use `point`"), "{why}");
    for job in [s1(Transport::Direct), s1(CONVERGED), furnished()] {
        assert_eq!(PathTracer.supports(&job), Support::Yes);
    }
    let stock = with_preset(s1(CONVERGED), "default");
    assert!(matches!(PathTracer.supports(&stock), Support::Approximate { .. }));
    assert_eq!((exported(&stock)["stock"].as_bool(), exported(&stock)["side"].as_u64()), (Some(true), Some(64)));
}

/// Reads jobs one after the other in one page, whose shader takes a minute to compile.
fn read_in_one_page(jobs: &[Job]) -> Vec<Measurement> {
    let idle = ProcessPool::default();
    let mut found = vec![];
    for job in jobs {
        let folder = tempfile::tempdir().unwrap();
        let bench = job_dir(test_root_of(&PathTracer), folder.path());
        let bench = JobDir { idle: Some(idle.clone()), limit: Duration::from_secs(900), ..bench };
        found.push(PathTracer.read(job, &bench).unwrap());
    }
    assert_eq!(idle.count(), 1);
    found
}

/// S1 with a luminaire that sends the same light everywhere, which any table says.
fn evenly_lit(transport: Transport) -> Job {
    let mut job = s1(transport);
    let even = LuminousIntensityDistribution::axial(vec![0.0, 180.0], vec![100.0, 100.0]).unwrap();
    job.scene.luminaires[0].photometry = job.scene.luminaires[0].photometry.with_distribution(even).into();
    within(0.005, job)
}

/// Its paths, its reflections and its light past bodies are right. Of a table it reads the first plane, half a degree off, and
/// a table that it has drawn once is not taken for another luminaire's of a later job. One page for all, because it takes a
/// minute to start.
#[test]
fn reflected_light_is_right_and_one_plane_of_each_job_is_read_half_a_degree_off() {
    let first = evenly_lit(Transport::Indirect(Bounces::AtMost(1)));
    let converged = evenly_lit(CONVERGED);
    let total = evenly_lit(Transport::Total(Bounces::Converged));
    let mut turned = s1(Transport::Direct);
    turned.scene.luminaires[0].photometry = turned.scene.luminaires[0].photometry.with_distribution(lopsided()).into();
    let mut dim = s1(Transport::Direct);
    let narrow = LuminousIntensityDistribution::axial(vec![0.0, 90.0, 180.0], vec![300.0, 10.0, 20.0]).unwrap();
    dim.scene.luminaires[0].photometry = dim.scene.luminaires[0].photometry.with_distribution(narrow).into();
    let jobs = [first, converged, total, s1(Transport::Direct), turned, dim, s1(Transport::Direct)];
    let found = read_in_one_page(&jobs);
    for (job, found) in jobs[..3].iter().zip(&found) {
        let exact = simulated_lx(job, 1e-3);
        assert!(worst_relative(found, &exact) < 0.03 && worst_z(found, &exact) < 4.5, "{found:?} for {exact:?}");
    }
    let [first, converged, ..] = &found[..] else { panic!("each job has an answer") };
    assert!(worst_z(first, &converged.estimates.iter().map(|e| e.value).collect::<Vec<_>>()) > 10.0);
    // The first light of the axial luminaire, whose table changes by up to 3 % a degree.
    let off = worst_relative(&found[3], &S1_DIRECT_LX);
    assert!(off > 1e-3 && off < 0.03, "{:?}", found[3]);
    // Without its planes, a table without symmetry is off by much more.
    assert!(worst_relative(&found[4], &exact_direct_lx(&jobs[4])) > 0.05, "{:?}", found[4]);
    // Tables of earlier jobs are gone.
    assert!(worst_relative(&found[5], &exact_direct_lx(&jobs[5])) < 0.03, "{:?}", found[5]);
    assert_eq!(found[6].estimates, found[3].estimates);
}
