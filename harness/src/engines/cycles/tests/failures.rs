//! Every way in which a renderer fails, played by a false interpreter or a broken file, ends in an error that says so.

use super::*;

/// Reads S1 through an interpreter that runs `script`.
fn read_with(script: &str, limit_s: f64) -> EngineError {
    let folder = tempfile::tempdir().unwrap();
    let site = Site::at(folder.path().join("site"));
    write_program(&site.blender().venv().join("bin/python"), script);
    let bench = Workbench { limit: Duration::from_secs_f64(limit_s), ..workbench(site, folder.path()) };
    Cycles.read(&s1(Transport::Direct), &bench).unwrap_err()
}

#[test]
fn a_crash_a_hang_and_an_out_of_memory_kill_are_told_apart() {
    shared_tests::crashes_hangs_and_kills_are_told_apart(read_with);
}

#[test]
fn answers_that_are_no_readings_are_errors() {
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

/// Left alone, Cycles takes it for an even 1415 cd and says nothing.
#[test]
fn a_table_that_cycles_cannot_read_is_an_error() {
    let (job, folder) = (s1(Transport::Direct), tempfile::tempdir().unwrap());
    let bench = workbench(Site::of_user().unwrap(), folder.path());
    let mut files = Cycles.export(&job).unwrap();
    let table = files.iter_mut().find(|f| f.name == "table-0.ies").unwrap();
    table.bytes = b"IESNA:LM-63-2002\nTILT=NONE\n1 -1 1 2".to_vec();
    let error = read_files(&files, &job, Settings::of(&job).unwrap(), &bench).unwrap_err();
    assert!(error.to_string().contains("Cycles cannot read table-0.ies"), "{error}");
}

#[test]
fn a_site_without_blender_says_what_to_run() {
    let folder = tempfile::tempdir().unwrap();
    let site = Site::at(folder.path());
    let absent = |site: &Site| Cycles.probe(site).unwrap_err().to_string();
    assert!(absent(&site).contains("luxproof engines install cycles"), "{}", absent(&site));
    write_program(&site.blender().venv().join("bin/python"), "exit 1");
    assert!(absent(&site).contains("`bpy` is missing"), "{}", absent(&site));
    std::fs::create_dir_all(site.blender().venv().join("lib/python3/site-packages/bpy")).unwrap();
    write_program(&site.blender().venv().join("bin/python"), "cat > /dev/null; echo no Blender");
    assert!(absent(&site).contains("answered `no Blender`"), "{}", absent(&site));
}
