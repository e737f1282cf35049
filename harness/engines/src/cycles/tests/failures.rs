//! Every way in which a renderer fails, played by a false interpreter or a broken file, ends in an error that says so.

use super::*;

fn read_with(script: &str, limit_s: f64) -> EngineError {
    patches::tests::read_with(&Cycles, PACKAGE.site, script, limit_s)
}

#[test]
fn a_crash_a_hang_and_an_out_of_memory_kill_are_distinguished() {
    shared_tests::crashes_hangs_and_kills_are_distinguished(read_with);
}

#[test]
fn normals_that_are_off_widen_bounds() {
    patches::tests::normals_that_are_off_widen_bounds(&Cycles, EngineRoot::blender);
}

#[test]
fn answers_that_are_no_readings_are_errors() {
    patches::tests::answers_that_are_no_readings_are_errors(read_with);
}

/// Left alone, Cycles takes it for an even 1415 cd and says nothing.
#[test]
fn a_table_that_cycles_cannot_read_is_an_error() {
    let (job, folder) = (s1(Transport::Direct), tempfile::tempdir().unwrap());
    let bench = job_dir(test_root_of(&Cycles), folder.path());
    let mut files = Cycles.export(&job).unwrap();
    let table = files.iter_mut().find(|f| f.name == "table-0.ies").unwrap();
    table.bytes = b"IESNA:LM-63-2002\nTILT=NONE\n1 -1 1 2".to_vec();
    let error = read_files(&files, &job, Settings::of(&job, &ID).unwrap(), &bench).unwrap_err();
    assert!(error.to_string().contains("Cycles cannot read table-0.ies"), "{error}");
}

#[test]
fn a_site_without_blender_says_what_to_run() {
    patches::tests::a_site_without_its_package_says_what_to_run(&Cycles, &PACKAGE);
}
