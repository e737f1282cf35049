//! The real renderer against closed forms and the converged values of case S1, and what happens when it fails.

use std::time::Duration;

use glam::DVec3;
use luminaire::photometry::LuminousIntensityDistribution;
use luminaire::scene::{Luminaire, LuminaireModel, Scene, Transport, orientation};

use super::*;
use crate::engines::Budget;
use crate::engines::fixtures::*;
use crate::engines::shared_tests;

mod failures;
mod scenes;

fn read(job: &Job) -> Measurement {
    read_tampered(job, |_, text| text)
}

fn read_tampered(job: &Job, tamper: impl Fn(&str, String) -> String) -> Measurement {
    let engine = Mitsuba::default();
    let folder = tempfile::tempdir().unwrap();
    let bench = workbench(Site::of_user().unwrap(), folder.path());
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

#[test]
fn direct_light_follows_the_inverse_square_law_in_single_precision() {
    let job = s1(Transport::Direct);
    let found = read(&job);
    let deviations = relative_deviations(&found, &S1_DIRECT_LX);
    assert!(worst(&deviations) < 1e-5, "{deviations:?}");
    shared_tests::bounds_are_small_and_hold(&found, 1e-4);
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
    shared_tests::n_bounces_are_n_reflections(read, 5e-4, 8.0);
}

#[test]
fn total_is_direct_plus_indirect() {
    shared_tests::total_is_direct_plus_indirect(|job| read(&job));
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
    let replaced = [
        ("<scene", "<scene"),
        (r#"value="0.7""#, r#"value="2.19911""#),
        (r#"<float name="scale" value="0.7"/>"#, ""),
        ("1 0 0 0  0 1 0 0", "0 -1 0 0  1 0 0 0"),
    ];
    shared_tests::wrong_exports_are_seen("scene.xml", 1e-5, replaced, |job, tamper| read_tampered(job, tamper));
}

#[test]
fn exported_files_are_these() {
    let files = Mitsuba::default().export(&shared_tests::furnished()).unwrap();
    let golden = files.iter().filter(|f| !f.name.starts_with("mitsuba_") && !f.name.starts_with("opacity-"));
    let texts = golden.map(|f| format!("==== {}\n{}\n", f.name, String::from_utf8_lossy(&f.bytes)));
    insta::assert_snapshot!(texts.collect::<Vec<_>>().concat());
}
