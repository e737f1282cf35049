//! Every way in which a renderer fails, played by a false interpreter, ends in an error that says so.

use super::*;

/// Reads S1 through an interpreter that passes the probe and then runs `script`.
fn read_with(script: &str, limit_s: f64) -> EngineError {
    let folder = tempfile::tempdir().unwrap();
    let site = EngineRoot::at(folder.path().join("site"));
    std::fs::create_dir_all(site.venv().join("lib/python3/site-packages/mitsuba")).unwrap();
    let probe = r#"echo '{"mitsuba": "3.9.1", "drjit": "1.5.0", "llvm": null, "variant": "llvm_ad_mono"}'"#;
    let script = format!("if [ \"$1 $2\" = \"-I -\" ]; then cat > /dev/null; {probe}; exit 0; fi\n{script}");
    write_program(&site.venv().join("bin/python"), &script);
    let bench = JobDir { limit: Duration::from_secs_f64(limit_s), ..job_dir(site, folder.path()) };
    Mitsuba::default().read(&s1(Transport::Direct), &bench).unwrap_err()
}

#[test]
fn a_crash_a_hang_and_an_out_of_memory_kill_are_distinguished() {
    shared_tests::crashes_hangs_and_kills_are_distinguished(read_with);
}

#[test]
fn answers_that_are_no_readings_are_errors() {
    let answers = |answer| shared_tests::driver("llvm_ad_mono", &[0, 1, 2, 3], answer);
    for (script, said) in [
        (answers("[[1, 2, 3]]"), "gave 3 readings for 4 meters"),
        (answers("[[1, 2, 3, 4, 5]]"), "gave 5 readings for 4 meters"),
        (answers("[[1, 2, 3, 4], [1, 2, 3, 4]]"), "gave 2 blocks of 1"),
        (answers("[[1, NaN, 3, 4]]"), "no JSON of readings"),
        (answers("[[1, null, 3, 4]]"), "no JSON of readings"),
        (shared_tests::driver("llvm_ad_mono", &[0, 1, 2], "[[1, 2, 3]]"), "gave 3 readings for 4 meters"),
        (shared_tests::driver("llvm_ad_mono", &[0, 2, 1, 3], "[[1, 1, 1, 1]]"), "gave `m[2]`"),
        ("echo warming up".into(), "no JSON of readings"),
        (":".into(), "ended without an answer"),
    ] {
        let error = read_with(&script, 30.0);
        assert!(error.to_string().contains(said), "{script}: {error}");
    }
}

#[test]
fn without_llvm_the_scalar_variant_runs_and_the_report_says_so() {
    let engine = Mitsuba::default();
    let folder = tempfile::tempdir().unwrap();
    let bench = job_dir(test_root_of(&engine), folder.path());
    *engine.backend.lock() = Some(Backend::find(&bench.site).unwrap().without_llvm());
    let job = s1(Transport::Direct);
    let found = engine.read(&job, &bench).unwrap();
    assert!(worst(&relative_deviations(&found, &S1_DIRECT_LX)) < 1e-5, "{found:?}");
    assert_eq!(found.method["variant"], "scalar_rgb");
    assert!(found.notes.iter().any(|n| n.contains("scalar_rgb ran instead of llvm_ad_mono")), "{found:?}");
    let mut indirect = s1(CONVERGED);
    indirect.budget = Budget { relative_error: 1e-3, seconds: 4.0 };
    let found = engine.read(&indirect, &bench).unwrap();
    assert!(worst_z(&found, &S1_INDIRECT_LX) < 5.0, "{found:?}");
    assert!(found.notes.iter().any(|n| n.contains("out of time")), "{found:?}");
}
