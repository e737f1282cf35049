//! The suite of analytic cases on real renderers, and how a spec's cases make one report.

#![allow(clippy::unwrap_used, missing_docs, reason = "a test that cannot go on has failed")]

use std::path::Path;
use std::process::Command;

use serde_json::Value;

const ENGINES: [&str; 5] = ["simulator", "iesna", "mitsuba", "povray", "radiance"];

fn run(args: &[&str]) -> (Value, Option<i32>) {
    let out = tempfile::tempdir().unwrap();
    let output = Command::new(env!("CARGO_BIN_EXE_luxproof"))
        .arg("run")
        .args(args)
        .args(["--no-cache", "--format", "json", "--out"])
        .arg(out.path())
        .current_dir(Path::new(env!("CARGO_MANIFEST_DIR")).join(".."))
        .output()
        .unwrap();
    let messages = String::from_utf8_lossy(&output.stderr);
    let report: Value =
        serde_json::from_slice(&output.stdout).unwrap_or_else(|e| panic!("no report ({e}): {messages}"));
    let kept = std::fs::read_to_string(out.path().join("report.json")).unwrap();
    assert_eq!(serde_json::from_str::<Value>(&kept).unwrap(), report);
    (report, output.status.code())
}

fn names(report: &Value) -> Vec<&str> {
    report["cases"].as_array().unwrap().iter().map(|c| c["name"].as_str().unwrap()).collect()
}

#[test]
fn direct_light_of_the_analytic_suite_is_read_right_by_every_engine() {
    let (report, code) =
        run(&["reference/analytic", "--procedures", "direct_illuminance", "--engines", &ENGINES.join(",")]);
    assert_eq!(code, Some(0), "{}", report["summary"]);
    assert_eq!(names(&report), ["cie-5.2", "cie-5.3", "cie-5.4", "cie-5.6", "furnace", "s1", "s2/direct"]);
    let comparisons = report["comparisons"].as_array().unwrap();
    for case in names(&report) {
        for engine in ENGINES {
            let is_it = |v: &&Value| v["case"] == case && v["engine"] == engine;
            let ran = report["recordings"].as_array().unwrap().iter().any(|r| is_it(&r));
            let skipped = report["skips"].as_array().unwrap().iter().find(is_it);
            // Inverse square does not apply closer than five times an opening's size, and says so.
            let why = skipped.map_or("", |s| s["reason"].as_str().unwrap());
            assert!(ran || (engine == "iesna" && why.contains("five-times rule")), "{case} {engine}: {why}");
        }
        // The known values stand in the report as references of their own, each with its uncertainty.
        let of_case: Vec<&Value> = comparisons.iter().filter(|c| c["case"] == case).collect();
        let spec = case.split('/').next().unwrap();
        let name = format!(", {spec}, ");
        let derived = of_case.iter().filter(|c| c["reference"]["source"].as_str().unwrap().contains(&name));
        let mut count = 0;
        for c in derived {
            count += 1;
            assert!(c["reference"]["basis"] == "closed_form" || c["reference"]["basis"] == "exact", "{c}");
            assert!(c["reference"]["uncertainty"].as_f64().unwrap() > 0.0, "{c}");
        }
        assert!(count > 0 || case == "cie-5.6", "{case}: no known value among {} comparisons", of_case.len());
    }
}

#[test]
fn reflected_light_behind_a_screen_and_in_a_closed_room_is_read_right() {
    let specs = ["reference/analytic/cie-5.7.yaml", "reference/analytic/cie-5.8.yaml"];
    let (report, code) = run(&[specs[0], specs[1], "--procedures", "indirect_illuminance", "--engines", "radiance"]);
    assert_eq!(code, Some(0), "{}", report["summary"]);
    assert_eq!(names(&report), ["cie-5.7", "cie-5.8/rho-10", "cie-5.8/rho-50", "cie-5.8/rho-90"]);
    // The closed form of case 5.8 is that of the mean: Gauss weights of the meters (i, j), i <= j.
    let w = [0.1739274226, 0.3260725774, 0.3260725774, 0.1739274226];
    let weight = |i: usize, j: usize| if i == j { w[i] * w[j] } else { 2.0 * w[i] * w[j] };
    let weights: Vec<f64> = (0..4).flat_map(|i| (i..4).map(move |j| weight(i, j))).collect();
    for (case, law) in [("rho-10", 11.574), ("rho-50", 104.167), ("rho-90", 937.5)] {
        for (engine, allowed) in [("simulator", 1e-3), ("radiance", 8e-3)] {
            let all = report["readings"].as_array().unwrap();
            let values: Vec<f64> = all
                .iter()
                .filter(|r| r["case"] == format!("cie-5.8/{case}") && r["engine"] == engine)
                .map(|r| r["value"].as_f64().unwrap())
                .collect();
            assert_eq!(values.len(), weights.len(), "{case} {engine}");
            let mean: f64 = values.iter().zip(&weights).map(|(v, w)| v * w).sum();
            assert!((mean / law - 1.0).abs() < allowed, "{case} {engine}: mean {mean} for {law}");
        }
    }
}

#[test]
fn a_case_that_is_for_one_engine_skips_the_others_and_says_so() {
    let (report, code) =
        run(&["reference/specs/cachet.yaml", "--procedures", "direct_illuminance", "--engines", "radiance,povray"]);
    assert_eq!(code, Some(0), "{}", report["summary"]);
    assert_eq!(names(&report), ["cachet/point-seven", "cachet/lum1-seven", "cachet/lum2-seven"]);
    let skips = report["skips"].as_array().unwrap();
    let of_povray: Vec<&str> =
        skips.iter().filter(|s| s["engine"] == "povray").map(|s| s["case"].as_str().unwrap()).collect();
    assert_eq!(of_povray, ["cachet/lum1-seven", "cachet/lum2-seven"], "{skips:?}");
    assert_eq!(report["published"].as_array().unwrap().len(), 1);
    assert_eq!(report["published"][0]["cases"].as_array().unwrap().len(), 3);
}
