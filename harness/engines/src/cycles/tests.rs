//! The real renderer against closed forms and the converged values of case S1, and what happens when it fails.

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
    shared_tests::read_tampered(&Cycles, job, tamper, |files, bench| {
        read_files(files, job, Settings::of(job, &ID)?, bench)
    })
}

#[test]
fn a_wrong_export_is_seen() {
    let replaced = [
        ("cycles.start", "cycles.start"),
        (", 0.7, [[", ", 2.19911, [["),
        (", 0.7, [[", ", 1, [["),
        ("[[1, 0, 0, 0], [0, 1, 0, 0]", "[[0, -1, 0, 0], [1, 0, 0, 0]"),
    ];
    shared_tests::wrong_exports_are_seen("scene.py", 1e-4, replaced, |job, tamper| read_tampered(job, tamper));
}

#[test]
fn exported_files_are_these() {
    let mut job = shared_tests::furnished();
    job.scene.luminaires.push(with_opening(
        luminaire("panel", DVec3::new(1.0, 1.0, 2.5), quadrant()),
        LuminousOpening::Ellipse { x_m: 0.6, y_m: 0.3, height_m: 0.0 },
    ));
    let files = Cycles.export(&job).unwrap();
    insta::assert_snapshot!(shared_tests::golden(&files, &["cycles_", "blocks.py", "table-"]));
}

#[test]
fn a_stock_table_is_the_files_own() {
    let files = Cycles.export(&with_preset(shared_tests::furnished(), "default")).unwrap();
    let table = files.iter().find(|f| f.name == "table-1.ies").unwrap();
    insta::assert_snapshot!(String::from_utf8_lossy(&table.bytes));
}

patches::tests::hold_for_patches!(Cycles, read);

/// What users get who change nothing: planes mirrored, up to an eighth too much between the only two planes of an axial table.
#[test]
fn the_stock_scene_shows_what_cycles_makes_of_an_ies_file() {
    let axial = read(&with_preset(s1(Transport::Direct), "default"));
    let off = relative_deviations(&axial, &S1_DIRECT_LX);
    assert!(off[..3].iter().any(|d| *d > 0.05), "{axial:?}");
    let mut lamp = luminaire("lamp", DVec3::ZERO, lopsided());
    lamp.flux_scale = 0.7;
    let job = goniometer(&lamp, 10.0, &[30.0, 60.0], &[60.0]);
    let stock = read(&with_preset(job.clone(), "default"));
    assert!(worst_relative(&stock, &exact_direct_lx(&job)) > 0.1, "{stock:?}");
}

#[test]
fn bounds_of_direct_light_hold_in_random_rooms_and_are_each_meters_own() {
    shared_tests::bounds_hold_and_decide(read, false, 6);
}
