//! Baselines as a user meets them: accepted for a reason, held against later runs, refused where they do not match.

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

struct Room(tempfile::TempDir);

impl Room {
    fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        fs::write(folder.path().join("spec.yaml"), SPEC).unwrap();
        fs::write(folder.path().join("lamp.ies"), LAMP).unwrap();
        Self(folder)
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn luxproof(&self, args: &[&str]) -> Output {
        Command::new(env!("CARGO_BIN_EXE_luxproof"))
            .args(args)
            .current_dir(self.0.path())
            .stdin(std::process::Stdio::null())
            .env("NO_COLOR", "1")
            .env_remove("RUST_BACKTRACE")
            .output()
            .unwrap()
    }

    fn run(&self, more: &[&str]) -> Output {
        self.luxproof(
            &[&["run", "spec.yaml", "--engines", "simulator,iesna", "--out", "out", "--no-cache"][..], more].concat(),
        )
    }

    fn accepted(&self) {
        assert_eq!(self.run(&[]).status.code(), Some(0));
        let output = self.luxproof(&["accept", "out", "--all", "--reason", "first look"]);
        assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    }
}

fn stderr(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

fn stdout(output: &Output) -> String {
    String::from_utf8_lossy(&output.stdout).into_owned()
}

fn edit(path: &Path, from: &str, to: &str) {
    let text = fs::read_to_string(path).unwrap();
    assert!(text.contains(from), "no `{from}` in {text}");
    fs::write(path, text.replace(from, to)).unwrap();
}

#[test]
fn a_missing_baseline_fails_and_leaves_a_candidate_that_nobody_accepted() {
    let room = Room::new();
    let output = room.run(&["--baseline", "baselines"]);
    assert_eq!(output.status.code(), Some(1), "{}", stderr(&output));
    let candidate = room.path("out/baseline-candidate.json");
    assert!(candidate.exists(), "{}", stderr(&output));
    // Copied into place without a review it is refused.
    fs::create_dir(room.path("baselines")).unwrap();
    fs::copy(candidate, room.path("baselines/spec.json")).unwrap();
    let output = room.run(&["--baseline", "baselines"]);
    assert_eq!(output.status.code(), Some(2));
    assert!(stderr(&output).contains("was accepted for no"), "{}", stderr(&output));
}

#[test]
fn an_accepted_run_repeats_and_keeps_its_reason() {
    let room = Room::new();
    room.accepted();
    let baseline = fs::read_to_string(room.path("baselines/spec.json")).unwrap();
    assert!(baseline.contains("\"reason\": \"first look\""), "{baseline}");
    let output = room.run(&["--baseline", "baselines/spec.json"]);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    assert!(stdout(&output).contains("4 unchanged"), "{}", stderr(&output));
    assert!(!room.path("out/baseline-candidate.json").exists());
}

#[test]
fn every_view_tells_what_departs_from_the_baseline() {
    let room = Room::new();
    room.accepted();
    let version = concat!("\"version\": \"", env!("CARGO_PKG_VERSION"), "\"");
    edit(&room.path("baselines/spec.json"), version, "\"version\": \"0.0.1\"");
    assert_eq!(room.run(&["--baseline", "baselines"]).status.code(), Some(1));
    for (view, says) in [
        ("terminal", "Baseline baselines/spec.json: 4 REFUSED"),
        ("markdown", "Baseline `baselines/spec.json`: 4 REFUSED"),
        ("junit", "<failure message=\"REFUSED\">version: 0.0.1 before"),
        ("html", "4 REFUSED"),
        ("json", "\"is_as_accepted\": false"),
    ] {
        let output = room.luxproof(&["report", "out/report.json", "--format", view]);
        assert_eq!(output.status.code(), Some(1), "{view}: a finished run is judged as when it ran");
        assert!(stdout(&output).contains(says), "{view}: {}", stdout(&output));
    }
}

#[test]
fn others_may_read_a_baseline_as_they_may_any_new_file() {
    use std::os::unix::fs::PermissionsExt;
    let room = Room::new();
    room.accepted();
    let mode = |name: &str| fs::metadata(room.path(name)).unwrap().permissions().mode() & 0o777;
    assert_eq!(mode("baselines/spec.json"), mode("lamp.ies"));
}

#[test]
fn a_baseline_of_another_spec_or_version_is_refused_and_a_changed_value_found() {
    let room = Room::new();
    room.accepted();
    let baseline = room.path("baselines/spec.json");
    let kept = fs::read_to_string(&baseline).unwrap();
    let version = concat!("\"version\": \"", env!("CARGO_PKG_VERSION"), "\"");
    edit(&baseline, version, "\"version\": \"0.0.1\"");
    let output = room.run(&["--baseline", "baselines"]);
    assert_eq!(output.status.code(), Some(1));
    assert!(
        stdout(&output).contains("REFUSED") && stdout(&output).contains("version: 0.0.1 before"),
        "{}",
        stderr(&output)
    );

    fs::write(&baseline, &kept).unwrap();
    edit(&room.path("lamp.ies"), "100 80 0", "110 80 0");
    let output = room.run(&["--baseline", "baselines"]);
    assert_eq!(output.status.code(), Some(1));
    assert!(stdout(&output).contains("REFUSED") && stdout(&output).contains("spec: "), "{}", stderr(&output));
}

#[test]
fn two_runs_that_agree_differ_in_nothing_and_a_planted_change_exits_1() {
    let room = Room::new();
    assert_eq!(room.run(&[]).status.code(), Some(0));
    fs::create_dir(room.path("later")).unwrap();
    let later = room.path("later/report.json");
    fs::copy(room.path("out/report.json"), &later).unwrap();
    let output = room.luxproof(&["diff", "out", "later"]);
    assert_eq!(output.status.code(), Some(0), "{}", stdout(&output));
    let mut report: serde_json::Value = serde_json::from_str(&fs::read_to_string(&later).unwrap()).unwrap();
    let reading = &mut report["readings"].as_array_mut().unwrap()[0];
    reading["value"] = (1.01 * reading["value"].as_f64().unwrap()).into();
    fs::write(&later, report.to_string()).unwrap();
    let output = room.luxproof(&["diff", "out", "later/report.json"]);
    assert_eq!(output.status.code(), Some(1), "{}", stdout(&output));
    assert!(stdout(&output).contains("CHANGED") && stdout(&output).contains("+1.0000 %"), "{}", stdout(&output));
    let json = room.luxproof(&["diff", "out", "later", "--format", "json"]);
    let changes: serde_json::Value = serde_json::from_str(&stdout(&json)).unwrap();
    let changed = changes["entries"].as_array().unwrap().iter().filter(|e| e["state"] == "changed").count();
    assert_eq!(changed, 1, "{changes}");
}

#[test]
fn accepting_everything_needs_a_reason_and_a_review_needs_a_terminal() {
    let room = Room::new();
    assert_eq!(room.run(&[]).status.code(), Some(0));
    for (args, says) in [
        (&["accept", "out", "--all"][..], "--reason"),
        (&["accept", "out", "--all", "--reason", "  "][..], "empty reason"),
        (&["accept", "out"][..], "no terminal"),
    ] {
        let output = room.luxproof(args);
        assert_eq!(output.status.code(), Some(2), "{args:?}");
        assert!(stderr(&output).contains(says), "{args:?}: {}", stderr(&output));
    }
    assert!(!room.path("baselines").exists());
}

#[test]
fn every_view_of_a_run_is_printed_and_the_page_is_kept() {
    let room = Room::new();
    let output = room.run(&["--format", "html"]);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let page = stdout(&output);
    assert!(page.starts_with("<!DOCTYPE html>") && page.contains("a test room"));
    assert_eq!(fs::read_to_string(room.path("out/report.html")).unwrap().trim_end(), page.trim_end());
    let view = |args: &[&str]| stdout(&room.luxproof(&[&["report", "out/report.json"][..], args].concat()));
    let csv = view(&["--format", "csv"]);
    let report: serde_json::Value =
        serde_json::from_str(&fs::read_to_string(room.path("out/report.json")).unwrap()).unwrap();
    assert_eq!(csv.lines().count(), 1 + report["comparisons"].as_array().unwrap().len(), "{csv}");
    assert!(
        view(&["--format", "markdown", "--link", "https://ci.example/7"])
            .contains("[The whole report](https://ci.example/7)")
    );
    assert!(!view(&[]).contains('\u{1b}'), "no colour where NO_COLOR is set and no terminal is");
}
