//! The real renderer against closed forms and the converged values of case S1, and what happens when it fails.

use std::f64::consts::PI;

use glam::DVec3;
use luxproof_photometry::LuminousOpening;
use luxproof_scene::Transport;

use super::*;
use crate::fixtures::*;
use crate::shared_tests;

mod failures;

pub(crate) fn read(job: &Job) -> Measurement {
    read_tampered(job, |_, text| text)
}

fn read_tampered(job: &Job, tamper: impl Fn(&str, String) -> String) -> Measurement {
    shared_tests::read_tampered(&LuxCore, job, tamper, |files, bench| {
        read_files(files, job, Settings::of(job, &ID)?, bench)
    })
}

#[test]
fn a_wrong_export_is_seen() {
    let replaced = [
        (".efficiency = 1\n", ".efficiency = 1\n"),
        (".efficiency = 1\n", ".efficiency = 3.141592653589793\n"),
        (".efficiency = 1\n", ".efficiency = 1.4285714285714286\n"),
        (
            ".efficiency = 1\n",
            ".efficiency = 1\nscene.lights.luminaire0.transformation = 0 1 0 0 -1 0 0 0 0 0 1 0 0 0 0 1\n",
        ),
    ];
    shared_tests::wrong_exports_are_seen("scene.scn", 1e-4, replaced, |job, tamper| read_tampered(job, tamper));
}

#[test]
fn exported_files_are_these() {
    let mut job = shared_tests::furnished();
    job.scene.luminaires.push(with_opening(
        luminaire("panel", DVec3::new(1.0, 1.0, 2.5), quadrant()),
        LuminousOpening::Box { x_m: 0.6, y_m: 0.3, height_m: 0.0 },
    ));
    let files = LuxCore.export(&job).unwrap();
    insta::assert_snapshot!(shared_tests::golden(&files, &["luxcore_", "blocks.py", "table-"]));
}

patches::tests::hold_for_patches!(LuxCore, read);

/// What users get who change nothing: the candela are dropped and power is taken for 4 pi times what it is; on the axis upwards there is
/// half of what goes down.
#[test]
fn the_stock_scene_shows_what_luxcore_makes_of_an_ies_file() {
    let lamp = luminaire("lamp", DVec3::ZERO, lopsided());
    let job = goniometer(&lamp, 10.0, &[30.0], &[20.0, 60.0, 90.0]);
    let exact: Vec<f64> = exact_direct_lx(&job).into_iter().map(|lx| 0.25 / PI * lx).collect();
    let stock = read(&with_preset(job, "default"));
    assert!(worst_relative(&stock, &exact) < 0.01, "{stock:?} {exact:?}");
    let axial = read(&with_preset(s1(Transport::Direct), "default"));
    let of_them = relative_deviations(&axial, &S1_DIRECT_LX.map(|lx| 0.25 / PI * lx));
    assert!(of_them[..3].iter().all(|d| d.abs() < 0.01) && (of_them[3] + 0.5).abs() < 0.01, "{of_them:?}");
    // A patch as narrow as where rays begin by LuxCore's own settings was looked through now and then (found by a hunt).
    let small = read(&with_preset(goniometer(&lamp, 0.3, &[30.0], &[20.0, 60.0]), "default"));
    assert!(small.estimates.iter().all(|e| e.value > 0.0), "{small:?}");
}

#[test]
fn bounds_of_direct_light_hold_in_random_rooms_and_are_each_meters_own() {
    shared_tests::bounds_hold_and_decide(read, false, by_night(6, 2));
}

#[test]
fn light_of_openings_past_a_box_is_within_its_error_in_random_rooms() {
    // A room with openings is a quarter of a minute.
    shared_tests::bounds_hold_and_decide(read, true, by_night(6, 1));
}
