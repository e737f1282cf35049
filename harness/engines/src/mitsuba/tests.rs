//! The real renderer against closed forms and the converged values of case S1, and what happens when it fails.

use std::time::Duration;

use glam::DVec3;
use luxproof_photometry::LuminousIntensityDistribution;
use luxproof_scene::{LuminaireModel, Scene, Transport, orientation};

use super::*;
use crate::Budget;
use crate::fixtures::*;
use crate::shared_tests;

mod failures;
mod scenes;

pub(crate) fn read(job: &Job) -> Measurement {
    read_tampered(job, |_, text| text)
}

fn read_tampered(job: &Job, tamper: impl Fn(&str, String) -> String) -> Measurement {
    let engine = Mitsuba::default();
    shared_tests::read_tampered(&engine, job, tamper, |files, bench| {
        engine.read_files(files, job, &Settings::of(job)?, bench)
    })
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
    insta::assert_snapshot!(shared_tests::golden(&files, &["mitsuba_", "blocks.py", "opacity-"]));
}

#[test]
fn one_process_that_takes_jobs_one_after_the_other_reads_as_many_do() {
    let budget = Budget { relative_error: 0.02, seconds: 20.0 };
    let jobs = [s1(CONVERGED), shared_tests::furnished(), s1(Transport::Direct)].map(|job| Job { budget, ..job });
    shared_tests::one_process_that_takes_jobs_one_after_the_other_reads_as_many_do(
        &Mitsuba::default(),
        &jobs,
        [0, 1, 2, 0],
    );
}
