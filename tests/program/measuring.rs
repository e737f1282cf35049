//! `luxproof bench` and `luxproof stress` as a user meets them, on our own solvers and one renderer.

#![allow(clippy::unwrap_used, missing_docs, reason = "a test that cannot go on has failed")]

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

fn axial() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../reference/specs/axial.yaml")
}

fn luxproof(folder: &Path, args: &[&str]) -> Output {
    let output = Command::new(env!("CARGO_BIN_EXE_luxproof"))
        .arg(args[0])
        .arg(axial())
        .args(&args[1..])
        .current_dir(folder)
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    output
}

fn json(output: &Output) -> serde_json::Value {
    serde_json::from_slice(&output.stdout).unwrap()
}

#[test]
fn stress_finds_no_drift_of_exact_light_and_goes_on_where_it_stopped() {
    let folder = tempfile::tempdir().unwrap();
    let args = [
        "stress",
        "--engines",
        "simulator,iesna,radiance",
        "--laws",
        "translation,meter_near_luminaire,dark",
        "--seconds",
        "0.2",
        "--format",
        "json",
    ];
    let report = json(&luxproof(folder.path(), &args));
    let laws = report["laws"].as_array().unwrap();
    assert_eq!(laws.len(), 9);
    for engine in ["simulator", "iesna"] {
        for law in laws.iter().filter(|l| l["engine"] == engine) {
            assert!(law["how"].is_null() && law["untried"] == 0, "{law}");
            assert!(law["breaks_at"].as_object().unwrap().is_empty(), "{law}");
        }
    }
    let read = laws.iter().filter(|l| l["engine"] == "radiance").any(|l| l["worst_deviation"].is_number());
    assert!(read, "{report}");
    let again = json(&luxproof(folder.path(), &[&args[..], &["--minutes", "0"]].concat()));
    assert_eq!(report, again);
}

#[test]
fn bench_reaches_the_exact_values_with_time_memory_and_error_on_record() {
    let folder = tempfile::tempdir().unwrap();
    let args = [
        "bench",
        "--engines",
        "simulator,iesna,radiance",
        "--procedures",
        "direct_illuminance,indirect_illuminance",
        "--repetitions",
        "2",
        "--seconds",
        "0.1,0.3",
        "--format",
        "json",
    ];
    let report = json(&luxproof(folder.path(), &args));
    let curves = report["curves"].as_array().unwrap();
    let of = |engine: &str, procedure: &str| {
        curves.iter().find(|c| c["engine"] == engine && c["procedure"] == procedure).unwrap().clone()
    };
    let exact = of("simulator", "indirect_illuminance");
    assert!(exact["time_to"]["0.001"].as_f64().unwrap() > 0.0, "{exact}");
    for point in exact["points"].as_array().unwrap() {
        assert!(point["wall_s"].as_f64().unwrap() > 0.0 && point["peak_mib"].as_f64().unwrap() > 1.0, "{point}");
        assert!(point["relative_error"].as_f64().unwrap() < 1e-3, "{point}");
    }
    let sampled = &of("radiance", "indirect_illuminance")["points"][0];
    let at = |key: &str| sampled[key].as_f64().unwrap();
    assert!(at("relative_error_low") < at("relative_error") && at("relative_error") < at("relative_error_high"));
    assert!(at("relative_error") < 0.1 && at("cpu_s") > 0.0, "{sampled}");
    assert!(of("radiance", "direct_illuminance")["points"][0]["relative_error"].as_f64().unwrap() < 1e-5);
    assert_eq!(report["pareto"].as_array().unwrap().len(), 2);
}

#[test]
fn a_law_or_an_engine_that_is_not_there_is_a_usage_error_with_the_nearest_name() {
    let output = Command::new(env!("CARGO_BIN_EXE_luxproof"))
        .args(["stress".as_ref(), axial().as_os_str(), "--laws".as_ref(), "mirrors".as_ref()])
        .output()
        .unwrap();
    assert_eq!(output.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&output.stderr).contains("did you mean `mirror`"));
}
