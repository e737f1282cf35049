//! Every way in which a renderer fails, played by a false interpreter or a broken file, ends in an error that says so.

use super::*;

fn read_with(script: &str, limit_s: f64) -> EngineError {
    patches::tests::read_with(&LuxCore, PACKAGE.site, script, limit_s)
}

#[test]
fn a_crash_a_hang_and_an_out_of_memory_kill_are_distinguished() {
    shared_tests::crashes_hangs_and_kills_are_distinguished(read_with);
}

#[test]
fn answers_that_are_no_readings_are_errors() {
    patches::tests::answers_that_are_no_readings_are_errors(read_with);
}

/// Between meters and the camera that looks at them.
const VEIL: &str = "scene.objects.veil.material = floor\nscene.objects.veil.vertices = 0 0 16.99995 20 0 16.99995 20 20 16.99995 0 20 16.99995\n\
                    scene.objects.veil.faces = 0 1 2 0 2 3\n";

#[test]
fn a_file_that_luxcore_cannot_read_and_a_meter_that_it_does_not_see_are_errors() {
    let job = s1(Transport::Direct);
    for (file, from, to, says) in [
        ("scene.scn", "table-0.pfm", "none.pfm", "none.pfm"),
        ("job.json", "\"emitters\": 1", "\"emitters\": 2", "the job says 2"),
        ("scene.scn", "# axial\n", VEIL, "does not see the meter"),
    ] {
        let folder = tempfile::tempdir().unwrap();
        let bench = job_dir(test_root_of(&LuxCore), folder.path());
        let mut files = LuxCore.export(&job).unwrap();
        let tampered = files.iter_mut().find(|f| f.name == file).unwrap();
        let text = String::from_utf8(tampered.bytes.clone()).unwrap();
        assert!(text.contains(from), "{text}");
        tampered.bytes = text.replace(from, to).into_bytes();
        let error = read_files(&files, &job, Settings::of(&job, &ID).unwrap(), &bench).unwrap_err();
        assert!(error.to_string().contains(says), "{error}");
    }
}

#[test]
fn a_site_without_luxcore_says_what_to_run() {
    patches::tests::a_site_without_its_package_says_what_to_run(&LuxCore, &PACKAGE);
}
