//! The command line as a user meets it: errors with their place before any engine starts, exit codes, views, schemas.

#![allow(clippy::unwrap_used, missing_docs, reason = "a test that cannot go on has failed")]

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

const SPEC: &str = "luxproof: 1
title: a test room
room:
  size_m: [6, 4, 3]
  reflectance: {floor: 0.2, walls: 0.5, ceiling: 0.7}
luminaires:
  - {id: lamp, photometry: lamp.ies, at_m: [3, 2, 2.5]}
meters:
  plane: {points_m: [[1, 1, 0.8], [3, 2, 0.8]], normal: [0, 0, 1]}
procedures:
  luminous_intensity: {luminaire: lamp, distance_m: 5, angles: photometry}
  direct_illuminance: {meters: plane}
  indirect_illuminance: {meters: plane}
";

const LAMP: &str = "IESNA:LM-63-2002
[TEST] made for this test
TILT=NONE
1 -1 1 3 1 1 2 0 0 0
1 1 0
0 60 90
0
100 80 0
";

struct Room {
    folder: tempfile::TempDir,
}

impl Room {
    fn new(spec: &str, lamp: &str) -> Self {
        let folder = tempfile::tempdir().unwrap();
        fs::write(folder.path().join("spec.yaml"), spec).unwrap();
        fs::write(folder.path().join("lamp.ies"), lamp).unwrap();
        Self { folder }
    }

    fn path(&self) -> &Path {
        self.folder.path()
    }

    fn luxproof(&self, args: &[&str]) -> Output {
        Command::new(env!("CARGO_BIN_EXE_luxproof"))
            .args(args)
            .current_dir(self.path())
            .env("NO_COLOR", "1")
            .env("LUXPROOF_CACHE", self.path().join("cache"))
            .env_remove("RUST_BACKTRACE")
            .output()
            .unwrap()
    }

    fn own_run(&self) -> Output {
        self.luxproof(&["run", "spec.yaml", "--engines", "simulator,iesna", "--out", "out", "--format", "json"])
    }
}

fn reference(path: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../reference").join(path)
}

fn stdout(output: &Output) -> String {
    String::from_utf8(output.stdout.clone()).unwrap()
}

/// The spec with one replacement must be refused with exit 2, name the place and leave no run behind.
#[track_caller]
fn refused(from: &str, to: &str, place: &str, says: &str) {
    let spec = SPEC.replace(from, to);
    assert_ne!(spec, SPEC, "the replacement must change the spec");
    refused_files(&spec, LAMP, place, says);
}

#[track_caller]
fn refused_files(spec: &str, lamp: &str, place: &str, says: &str) {
    let room = Room::new(spec, lamp);
    let output = room.own_run();
    // Line breaks of the drawn message carry no meaning.
    let words: Vec<&str> =
        std::str::from_utf8(&output.stderr).unwrap().split_whitespace().filter(|w| *w != "│").collect();
    let error = words.join(" ");
    assert_eq!(output.status.code(), Some(2), "{error}");
    assert!(error.contains(place), "no place `{place}` in: {error}");
    assert!(error.contains(says), "no `{says}` in: {error}");
    assert!(!room.path().join("out").exists(), "a run was begun");
}

#[test]
fn an_unknown_key_is_answered_with_the_nearest_one() {
    refused("size_m", "sise_m", "spec.yaml:4:3", "did you mean `size_m`?");
}

#[test]
fn broken_yaml_is_placed() {
    refused("size_m: [6, 4, 3]", "size_m: [6, 4, [3]", "spec.yaml:4:18", "expected f64");
    refused("meters:\n", "meters: }\n", "spec.yaml:8:9", "did not find");
}

#[test]
fn a_reflectance_above_one_is_refused() {
    refused("walls: 0.5", "walls: 1.5", "spec.yaml:5:36", "between 0 and 1");
}

#[test]
fn a_reflectance_that_is_not_a_number_is_refused() {
    refused("walls: 0.5", "walls: .nan", "spec.yaml:5:36", "between 0 and 1");
}

#[test]
fn a_meter_outside_the_room_is_refused() {
    refused("[3, 2, 0.8]", "[3, 2, 3.8]", "spec.yaml:9:35", "outside the room");
}

#[test]
fn a_meter_on_a_wall_is_refused() {
    refused("[3, 2, 0.8]", "[3, 0, 0.8]", "spec.yaml:9:35", "on a surface");
}

#[test]
fn a_meter_that_is_not_a_number_is_refused() {
    refused("[3, 2, 0.8]", "[3, .nan, 0.8]", "spec.yaml:9:35", "outside the room");
}

#[test]
fn a_luminaire_outside_the_room_is_refused() {
    refused("at_m: [3, 2, 2.5]", "at_m: [3, 2, 3.5]", "spec.yaml:7:44", "outside the room");
}

#[test]
fn a_missing_photometric_file_is_named() {
    refused("photometry: lamp.ies", "photometry: lmap.ies", "spec.yaml:7:28", "lmap.ies cannot be read");
}

#[test]
fn malformed_photometry_is_placed_in_its_own_file() {
    refused_files(SPEC, &LAMP.replace("100 80 0", "100 eighty 0"), "lamp.ies:8:5", "eighty");
}

#[test]
fn an_unknown_meter_set_luminaire_and_engine_are_answered_with_the_nearest_name() {
    refused("direct_illuminance: {meters: plane}", "direct_illuminance: {meters: plain}", "spec.yaml:12:", "`plane`?");
    refused("luminaire: lamp", "luminaire: lmap", "spec.yaml:11:", "`lamp`?");
    let with_engine = format!("{SPEC}engines: {{radianse: {{}}}}\n");
    refused_files(&with_engine, LAMP, "spec.yaml:14:", "did you mean `radiance`?");
}

#[test]
fn an_engine_that_was_asked_for_and_is_absent_is_exit_3_and_the_others_still_run() {
    let room = Room::new(SPEC, LAMP);
    let args =
        ["run", "spec.yaml", "--engines", "radiance", "--out", "out", "--engines-dir", "nowhere", "--format", "json"];
    let output = room.luxproof(&args);
    assert_eq!(output.status.code(), Some(3), "{}", String::from_utf8_lossy(&output.stderr));
    let report: serde_json::Value = serde_json::from_str(&stdout(&output)).unwrap();
    let statuses: Vec<(&str, &str)> = report["engines"]
        .as_array()
        .unwrap()
        .iter()
        .map(|e| (e["id"].as_str().unwrap(), e["status"].as_str().unwrap()))
        .collect();
    assert_eq!(statuses, [("simulator", "ran"), ("iesna", "ran"), ("radiance", "absent")]);
}

#[test]
fn nothing_vanishes_runs_and_skips_add_up_to_procedures_times_engines() {
    let room = Room::new(SPEC, LAMP);
    let args = ["run", "spec.yaml", "--out", "out", "--engines-dir", "nowhere", "--format", "json"];
    let output = room.luxproof(&args);
    let report: serde_json::Value = serde_json::from_str(&stdout(&output)).unwrap();
    let count = |key: &str| report[key].as_array().unwrap().len();
    // Meters and light paths that are left out have readings that follow from others.
    let whole = |s: &&serde_json::Value| s["scope"] == "engine" || s["scope"] == "procedure";
    let skipped = report["skips"].as_array().unwrap().iter().filter(whole).count();
    assert_eq!(count("recordings") + skipped, 3 * count("engines"));
    assert_eq!(report["summary"]["skipped"], skipped);
    assert!(report["skips"].as_array().unwrap().iter().all(|s| !s["reason"].as_str().unwrap().is_empty()));
}

#[test]
fn our_own_witnesses_agree_and_every_view_of_the_run_says_so() {
    let room = Room::new(SPEC, LAMP);
    let output = room.own_run();
    assert_eq!(output.status.code(), Some(0), "{}", stdout(&output));
    let printed: serde_json::Value = serde_json::from_str(&stdout(&output)).unwrap();
    let kept = fs::read_to_string(room.path().join("out/report.json")).unwrap();
    assert_eq!(printed, serde_json::from_str::<serde_json::Value>(&kept).unwrap());
    assert!(room.path().join("out/readings/simulator.json").exists());
    for (format, says) in
        [("terminal", "luminous_intensity"), ("markdown", "| direct_illuminance |"), ("junit", "<testsuite ")]
    {
        let view = room.luxproof(&["report", "out/report.json", "--format", format]);
        assert_eq!(view.status.code(), Some(0));
        assert!(stdout(&view).contains(says), "{format}: {}", stdout(&view));
    }
}

#[test]
fn check_prints_the_plan_and_starts_nothing() {
    let room = Room::new(SPEC, LAMP);
    let output = room.luxproof(&["check", "spec.yaml"]);
    assert_eq!(output.status.code(), Some(0));
    assert!(stdout(&output).contains("direct_illuminance at 2 meters"), "{}", stdout(&output));
    assert!(!room.path().join("luxproof-out").exists());
}

#[test]
fn the_schema_knows_every_key_of_the_reference_specs() {
    let room = Room::new(SPEC, LAMP);
    let output = room.luxproof(&["schema", "spec"]);
    let schema: serde_json::Value = serde_json::from_str(&stdout(&output)).unwrap();
    let properties = schema["properties"].as_object().unwrap();
    for name in ["cachet", "axial"] {
        let text = fs::read_to_string(reference(&format!("specs/{name}.yaml"))).unwrap();
        for key in text.lines().filter_map(|l| l.split_once(':')).map(|(k, _)| k) {
            if key.chars().all(|c| c.is_ascii_alphanumeric() || c == '_') {
                assert!(properties.contains_key(key), "{name}: {key}");
            }
        }
    }
    let report = room.luxproof(&["schema", "report"]);
    assert!(stdout(&report).contains("relative_deviation"));
}

#[test]
fn a_usage_error_is_exit_2() {
    let room = Room::new(SPEC, LAMP);
    assert_eq!(room.luxproof(&["run"]).status.code(), Some(2));
    assert_eq!(room.luxproof(&["run", "no-such-spec.yaml"]).status.code(), Some(2));
    assert_eq!(room.luxproof(&["run", "spec.yaml", "--engines", "blender"]).status.code(), Some(2));
}
