//! The real renderer against closed forms and the converged values of case S1, and what happens when it fails.

use super::*;
use crate::fixtures::*;
use crate::shared_tests;
use std::f64::consts::PI;

pub(crate) fn read(job: &Job) -> Measurement {
    read_tampered(job, |_, text| text)
}

fn read_tampered(job: &Job, tamper: impl Fn(&str, String) -> String) -> Measurement {
    shared_tests::read_tampered(&Radiance, job, tamper, |files, bench| read_files(files, job, bench))
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
        let found = read(&scaled(s1(Transport::Direct), size, size * size));
        assert!(worst(&relative_deviations(&found, &S1_DIRECT_LX)) < 1e-6, "{size}: {found:?}");
    }
}

#[test]
fn the_fast_preset_is_right_and_the_defaults_are_off_by_far_more_than_their_standard_error() {
    let mut job = s1(CONVERGED);
    job.budget.seconds = 1.0;
    job.sensors.truncate(1);
    let [fast, defaults] = ["fast", "default"].map(|preset| read(&with_preset(job.clone(), preset)));
    assert!(fast.effort["blocks"] == "8" && worst_z(&fast, &S1_INDIRECT_LX) < 5.0, "{fast:?}");
    let off = worst(&relative_deviations(&defaults, &S1_INDIRECT_LX));
    assert!((0.2..0.35).contains(&off) && worst_z(&defaults, &S1_INDIRECT_LX) > 5.0, "{defaults:?}");
}

#[test]
fn free_field_has_no_indirect_light() {
    let mut job = s1(CONVERGED);
    job.scene.room = None;
    assert!(read(&job).estimates.iter().all(|e| e.value == 0.0 && e.uncertainty.standard_error() == Some(0.0)));
}
