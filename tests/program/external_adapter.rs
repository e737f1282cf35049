//! A program of the user's as an engine: the example adapter joins a run, its crash is a failure, what it declines a skip.

#![allow(clippy::unwrap_used, missing_docs, reason = "a test that cannot go on has failed")]

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use serde_json::Value;

const SPEC: &str = "luxproof: 1
room:
  size_m: [6, 4, 3]
  reflectance: {floor: 0.2, walls: 0.5, ceiling: 0.7}
luminaires:
  - {id: lamp, photometry: lamp.ies, at_m: [3, 2, 2.5], rotate_deg: {azimuth: 30, tilt: 20}, flux_scale: 0.8}
meters:
  plane: {points_m: [[1, 1, 0.8], [3, 2, 0.8], [5, 3.5, 0.1]], normal: [0, 0, 1]}
procedures:
  luminous_intensity: {luminaire: lamp, distance_m: 5, angles: photometry}
  direct_illuminance: {meters: plane}
  indirect_illuminance: {meters: plane}
engines:
  mine: {command: [python3, adapter.py]}
";

/// Without any symmetry.
const LAMP: &str = "IESNA:LM-63-2002
TILT=NONE
1 -1 1 4 5 1 2 0 0 0
1 1 0
0 60 90 180
0 45 90 180 360
100 80 10 5
100 70 20 5
100 40 30 5
100 90 12 5
100 80 10 5
";

fn folder(adapter: &str) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    for (name, text) in [("spec.yaml", SPEC), ("lamp.ies", LAMP), ("adapter.py", adapter)] {
        fs::write(folder.path().join(name), text).unwrap();
    }
    folder
}

fn luxproof(folder: &Path, args: &[&str]) -> Output {
    let mut program = Command::new(env!("CARGO_BIN_EXE_luxproof"));
    // Elsewhere than the spec's folder: paths of the command count from the spec.
    program.args(args).current_dir("/").env("NO_COLOR", "1").env("LUXPROOF_ENGINES", folder.join("engines"));
    program.env("LUXPROOF_CACHE", folder.join("cache"));
    program.output().unwrap()
}

fn run(folder: &Path) -> (Value, Option<i32>) {
    let (spec, out) = (folder.join("spec.yaml"), folder.join("out"));
    let output = luxproof(folder, &["run", spec.to_str().unwrap(), "--out", out.to_str().unwrap(), "--format", "json"]);
    let report = serde_json::from_slice(&output.stdout);
    (report.unwrap_or_else(|e| panic!("{e}: {}", String::from_utf8_lossy(&output.stderr))), output.status.code())
}

fn example() -> String {
    let path: PathBuf = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/examples/inverse_square.py");
    fs::read_to_string(path).unwrap()
}

fn of_adapter<'a>(report: &'a Value, list: &str, id: &str) -> Vec<&'a Value> {
    report[list].as_array().unwrap().iter().filter(|e| e[id] == "mine").collect()
}

#[test]
fn the_example_adapter_is_at_most_sixty_lines_and_agrees_with_the_inverse_square_method() {
    assert!(example().lines().count() <= 60);
    let folder = folder(&example());
    let (report, code) = run(folder.path());
    assert_eq!(code, Some(0), "{}", report["engines"]);
    let comparisons = of_adapter(&report, "comparisons", "engine");
    // 20 directions of procedure 1 and three meters, each against a closed form.
    assert_eq!(comparisons.len(), 23);
    for comparison in comparisons {
        let off = comparison["relative_deviation"].as_f64().unwrap();
        assert!(off.abs() < 1e-12 && comparison["verdict"] == "pass", "{comparison}");
    }
    let skips = of_adapter(&report, "skips", "engine");
    assert_eq!(skips.len(), 1);
    assert_eq!(skips[0]["procedure"], "indirect_illuminance");
    assert!(skips[0]["reason"].as_str().unwrap().contains("direct light only"));
    let recording = of_adapter(&report, "recordings", "engine")[0];
    assert!(recording["version"].as_str().unwrap().starts_with("sha256:"), "{recording}");
    assert!(recording["settings"]["python"].as_str().unwrap().starts_with('3'), "{recording}");
}

#[test]
fn an_adapter_that_reads_a_known_scene_wrong_is_a_failed_engine() {
    let wrong = example().replace("math.atan2(y, x)", "math.atan2(x, y)");
    assert_ne!(wrong, example());
    let folder = folder(&wrong);
    let (report, code) = run(folder.path());
    assert_eq!(code, Some(3));
    let engine = of_adapter(&report, "engines", "id")[0];
    assert_eq!(engine["status"], "failed");
    assert!(engine["reason"].as_str().unwrap().contains("scene `asymmetric`"), "{engine}");
    assert!(of_adapter(&report, "readings", "engine").is_empty());
}

#[test]
fn an_adapter_that_crashes_is_a_failed_engine_and_the_others_go_on() {
    let folder = folder("import sys\nsys.exit('out of lamps')\n");
    let (report, code) = run(folder.path());
    assert_eq!(code, Some(3));
    let engine = of_adapter(&report, "engines", "id")[0];
    assert_eq!(engine["status"], "failed");
    assert!(engine["reason"].as_str().unwrap().contains("out of lamps"), "{engine}");
    assert!(report["readings"].as_array().unwrap().iter().any(|r| r["engine"] == "simulator"));
}

#[test]
fn an_exported_job_runs_by_hand() {
    let folder = folder(&example());
    let (spec, out) = (folder.path().join("spec.yaml"), folder.path().join("exported"));
    let args = ["export", spec.to_str().unwrap(), "--engine", "mine", "--out", out.to_str().unwrap()];
    let output = luxproof(folder.path(), &args);
    let printed = String::from_utf8(output.stdout).unwrap();
    let command = printed.lines().find(|l| l.contains("direct_illuminance") && l.contains("&&")).unwrap();
    let by_hand = Command::new("sh").args(["-c", command]).output().unwrap();
    let answer: Value = serde_json::from_slice(&by_hand.stdout)
        .unwrap_or_else(|e| panic!("{e}: {command}: {}", String::from_utf8_lossy(&by_hand.stderr)));
    assert_eq!(answer["readings"].as_array().unwrap().len(), 3);
    assert_eq!(answer["readings"][1]["meter"], "plane[1]");
}

#[test]
fn an_engine_without_a_command_is_answered_with_what_to_do() {
    let folder = folder(&example());
    let spec = SPEC.replace("{command: [python3, adapter.py]}", "{comand: [python3, adapter.py]}");
    fs::write(folder.path().join("spec.yaml"), spec).unwrap();
    let output = luxproof(folder.path(), &["check", folder.path().join("spec.yaml").to_str().unwrap()]);
    assert_eq!(output.status.code(), Some(2));
    let error = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(error.contains("there is no engine `mine`") && error.contains("command"), "{error}");
}

#[test]
fn the_forms_have_schemas() {
    let folder = folder(&example());
    for (name, key) in [("job", "candela"), ("readings", "illuminance_lx")] {
        let output = luxproof(folder.path(), &["schema", name]);
        let schema: Value = serde_json::from_slice(&output.stdout).unwrap();
        assert!(schema.to_string().contains(key), "{schema}");
    }
}
