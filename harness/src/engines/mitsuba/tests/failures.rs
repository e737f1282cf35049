//! Every way in which a renderer fails, played by a false interpreter, ends in an error that says so.

use std::os::unix::fs::PermissionsExt;

use super::*;
use crate::system::process::ProcessError;

/// Reads S1 through an interpreter that passes the probe and then runs `script`.
fn read_with(script: &str, limit_s: f64) -> EngineError {
    let folder = tempfile::tempdir().unwrap();
    let site = Site::at(folder.path().join("site"));
    let (bin, package) = (site.venv().join("bin"), site.venv().join("lib/python3/site-packages/mitsuba"));
    std::fs::create_dir_all(&bin).unwrap();
    std::fs::create_dir_all(&package).unwrap();
    let probe = r#"echo '{"mitsuba": "3.9.1", "drjit": "1.5.0", "llvm": null}'"#;
    let text = format!("#!/bin/sh\nif [ \"$1\" = - ]; then cat > /dev/null; {probe}; exit 0; fi\n{script}\n");
    // Written under another name: a script that another thread's child still holds open cannot be run.
    let draft = bin.join("draft");
    std::fs::write(&draft, text).unwrap();
    std::fs::set_permissions(&draft, std::fs::Permissions::from_mode(0o755)).unwrap();
    std::fs::rename(draft, bin.join("python")).unwrap();
    let bench = Workbench { site, limit: Duration::from_secs_f64(limit_s), ..workbench(folder.path()) };
    Mitsuba::default().read(&s1(Transport::Direct), &bench).unwrap_err()
}

fn answer(rows: &str) -> String {
    format!(r#"echo '{{"versions": {{}}, "settings": {{}}, "notes": [], "readings": [{rows}]}}'"#)
}

fn row(k: usize, value: &str) -> String {
    format!(r#"{{"id": "m[{k}]", "value": {value}, "std_error": 0}}"#)
}

#[test]
fn a_crash_a_hang_and_an_out_of_memory_kill_are_told_apart() {
    let crash = read_with("kill -ABRT $$", 30.0);
    assert!(crash.to_string().contains("signal 6"), "{crash}");
    let memory = read_with("kill -KILL $$", 30.0);
    assert!(memory.to_string().contains("out of memory"), "{memory}");
    let error = read_with("echo 'RuntimeError: no such plugin' >&2; exit 1", 30.0);
    assert!(error.to_string().contains("no such plugin"), "{error}");
    let hang = read_with("sleep 60", 0.5);
    assert!(matches!(hang, EngineError::Process(ProcessError::TimedOut { .. })), "{hang}");
}

#[test]
fn answers_that_are_no_readings_are_errors() {
    let rows = |values: &[&str]| {
        let rows: Vec<_> = values.iter().enumerate().map(|(k, v)| row(k, v)).collect();
        answer(&rows.join(","))
    };
    let good = ["1", "2", "3", "4"];
    for (script, said) in [
        (rows(&good[..3]), "gave 3 readings for 4 meters"),
        (rows(&["1", "2", "3", "4", "5"]), "gave 5 readings for 4 meters"),
        (rows(&["1", "NaN", "3", "4"]), "no JSON of readings"),
        (rows(&["1", "null", "3", "4"]), "no JSON of readings"),
        (rows(&["1", "2", "-3", "4"]), "read -3 lx"),
        (answer(&[row(0, "1"), row(2, "1"), row(1, "1"), row(3, "1")].join(",")), "gave `m[2]`"),
        ("echo warming up".into(), "no JSON of readings"),
        (":".into(), "no JSON of readings"),
    ] {
        let error = read_with(&script, 30.0);
        assert!(error.to_string().contains(said), "{script}: {error}");
    }
}

#[test]
fn settings_that_make_no_sense_are_named() {
    for (key, value, said) in [
        ("variant", "llvm_ad_spectral", "llvm_ad_mono"),
        ("variant", "cycles", "does not read luminance"),
        ("preset", "best", "audit, fast or default"),
        ("samples", "9", "no such setting"),
    ] {
        let mut job = s1(Transport::Direct);
        job.settings.insert(key.into(), value.into());
        let error = Mitsuba::default().export(&job).unwrap_err();
        assert!(error.to_string().contains(said) && error.to_string().contains(key), "{error}");
    }
}

#[test]
fn without_llvm_the_scalar_variant_runs_and_the_report_says_so() {
    let engine = Mitsuba::default();
    let folder = tempfile::tempdir().unwrap();
    let bench = workbench(folder.path());
    *engine.backend.lock().unwrap() = Some(Backend::find(&bench.site).unwrap().without_llvm());
    let job = s1(Transport::Direct);
    let found = engine.read(&job, &bench).unwrap();
    assert!(worst(&relative_deviations(&found, &S1_DIRECT_LX)) < 1e-5, "{found:?}");
    assert_eq!(found.settings["variant"], "scalar_rgb");
    assert!(found.notes.iter().any(|n| n.contains("scalar_rgb ran instead of llvm_ad_mono")), "{found:?}");
    let mut indirect = s1(CONVERGED);
    indirect.budget = Budget { relative_error: 1e-3, seconds: 4.0 };
    let found = engine.read(&indirect, &bench).unwrap();
    assert!(worst_z(&found, &S1_INDIRECT_LX) < 5.0, "{found:?}");
    assert!(found.notes.iter().any(|n| n.contains("out of time")), "{found:?}");
}
