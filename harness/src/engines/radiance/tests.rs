//! The real renderer against closed forms and the converged values of case S1, and what happens when it fails.

use super::*;
use crate::engines::Budget;
use crate::engines::fixtures::*;
use crate::engines::shared_tests;
use std::f64::consts::PI;

pub(super) fn read(job: &Job) -> Measurement {
    read_tampered(job, |_, text| text)
}

pub(super) fn within(relative_error: f64, job: Job) -> Job {
    Job { budget: Budget { relative_error, seconds: 60.0 }, ..job }
}

fn read_tampered(job: &Job, tamper: impl Fn(&str, String) -> String) -> Measurement {
    let folder = tempfile::tempdir().unwrap();
    let bench = workbench(Site::of_user().unwrap(), folder.path());
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
    shared_tests::bounds_are_small_and_hold(&found, 1e-6);
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
    shared_tests::n_bounces_are_n_reflections(read, 8e-4, 5.0);
}

#[test]
fn total_is_direct_plus_indirect() {
    shared_tests::total_is_direct_plus_indirect(|job| read(&within(2e-3, job)));
}

#[test]
fn asymmetric_and_turned_luminaires_read_their_own_table() {
    shared_tests::turned_luminaires_read_their_own_table(read);
}

#[test]
fn several_luminaires_add_up_and_obstacles_throw_shadows() {
    shared_tests::luminaires_add_up_and_obstacles_throw_shadows(read);
}

#[test]
fn a_wrong_export_is_seen() {
    let factor = |flux_scale: f64| format!("{:e}", flux_scale / (export::EFFICACY * PI * 1e-3 * 1e-3));
    let replaced = [
        ("light", "light"),
        (&*factor(0.7), &*factor(0.7 * PI)),
        (&*factor(0.7), &*factor(1.0)),
        (
            "5 corr luminaire-0.dat source.cal src_phi src_theta",
            "7 corr luminaire-0.dat source.cal src_phi src_theta -rz 90",
        ),
    ];
    shared_tests::wrong_exports_are_seen("scene.rad", 1e-6, replaced, |job, tamper| read_tampered(job, tamper));
}

#[test]
fn exported_files_are_these() {
    let files = Radiance.export(&shared_tests::furnished()).unwrap();
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
