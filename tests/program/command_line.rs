//! The command line as a user meets it: errors with their place before any engine starts, exit codes, views, schemas.

use std::fs;

use itertools::Itertools;
use serde_json::Value;

use crate::support::{Answer, Folder, LAMP, OWN, ROOM, TWO_METERS, root};

fn spec() -> String {
    let procedures = "procedures:
  luminous_intensity: {luminaire: lamp, distance_m: 5, angles: photometry}
  direct_illuminance: {meters: plane}
  indirect_illuminance: {meters: plane}
";
    [ROOM, TWO_METERS, procedures].concat()
}

fn room() -> Folder {
    Folder::new(&[("spec.yaml", &spec()), ("lamp.ies", LAMP)])
}

fn own_run(room: &Folder) -> Answer {
    room.run(&["--engines", OWN, "--format", "json"])
}

/// The spec with one replacement must be refused with exit 2, name the place and leave no run behind.
#[track_caller]
fn refused(from: &str, to: &str, place: &str, says: &str) {
    assert!(spec().contains(from), "the replacement must change the spec");
    refused_files(&spec().replace(from, to), LAMP, place, says);
}

#[track_caller]
fn refused_files(spec: &str, lamp: &str, place: &str, says: &str) {
    let room = Folder::new(&[("spec.yaml", spec), ("lamp.ies", lamp)]);
    let error = own_run(&room).exits(2).message();
    assert!(error.contains(place), "no place `{place}` in: {error}");
    assert!(error.contains(says), "no `{says}` in: {error}");
    assert!(!room.path("out").exists(), "a run was begun");
}

#[test]
fn a_report_keeps_to_the_width_of_its_terminal() {
    let long = "a-plane-of-meters-at-the-height-of-a-desk";
    let grid =
        "{grid: {origin_m: [0.5, 0.5, 0.75], u_m: [1, 0, 0], v_m: [0, 1, 0], counts: [5, 3]}, normal: [0, 0, 1]}";
    let procedures =
        ["direct", "indirect", "total"].map(|of| format!("  {of}_illuminance: {{meters: {long}}}\n")).concat();
    let title = "title: a title that does not fit where a line has eighty letters, and meters whose name hardly does";
    let room = ROOM.replace("title: a test room", title);
    let spec = format!("{room}meters:\n  {long}: {grid}\nprocedures:\n{procedures}");
    let room = Folder::new(&[("spec.yaml", &spec), ("lamp.ies", LAMP)]);
    room.run(&["--engines", OWN]);
    for columns in [80, 100, 160] {
        let view = Answer::of(room.command(&["report", "out"]).env("COLUMNS", columns.to_string())).stdout;
        let widest = view.lines().max_by_key(|line| line.chars().count()).unwrap();
        assert!(view.contains(long) && widest.chars().count() <= columns, "{columns}: {widest}");
    }
}

#[test]
fn an_unknown_key_is_answered_with_the_nearest_one() {
    refused("size_m", "sise_m", "spec.yaml:4:3", "did you mean `size_m`?");
}

#[test]
fn broken_yaml_is_placed() {
    refused("size_m: [6, 4, 3]", "size_m: [6, 4, [3]", "spec.yaml:4:18", "expected a number");
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
fn an_opening_that_sticks_out_of_the_room_is_refused_and_one_flush_with_the_ceiling_is_not() {
    // 1.2 m x 0.6 m x 0.1 m, tilted by 90 degrees as high as it is wide.
    let panel = LAMP.replace("1 1 2 0 0 0", "1 1 2 0.6 1.2 0.1");
    let at = |place: &str| spec().replace("at_m: [3, 2, 2.5]", &format!("model: area, {place}"));
    for (place, says) in [
        ("at_m: [3, 2, 2.97]", "sticks out of the room by 0.02 m through the ceiling"),
        ("at_m: [0.5, 2, 2]", "by 0.1 m through the wall x-"),
        ("at_m: [3, 2, 0.4], rotate_deg: {tilt: 90}", "by 0.2 m through the floor"),
    ] {
        refused_files(&at(place), &panel, "spec.yaml:7:", says);
    }
    for place in ["at_m: [0.6, 2, 2.95]", "at_m: [3, 2, 0.6], rotate_deg: {tilt: 90}"] {
        let room = Folder::new(&[("spec.yaml", &at(place)), ("lamp.ies", &panel)]);
        room.luxproof(&["check", "spec.yaml"]).exits(0);
    }
}

#[test]
fn a_name_that_is_more_than_a_line_is_refused() {
    refused("id: lamp,", r#"id: "a\n!touch pwned\n#","#, "spec.yaml:7:", "is no name");
    refused("id: lamp,", "id: ' ',", "spec.yaml:7:", "is no name");
    refused("id: lamp,", &format!("id: {},", "a".repeat(101)), "spec.yaml:7:", "1 to 100 printable characters");
    refused("title: a test room", r#"title: "a\nb""#, "spec.yaml:2:", "is no title");
    refused("title: a test room", r#"title: "a\u2028b""#, "spec.yaml:2:", "U+2028, which shows nothing");
}

#[test]
fn what_never_ends_is_not_opened() {
    for (from, to) in [("photometry: lamp.ies", "photometry: pipe"), ("photometry: lamp.ies", "photometry: /dev/zero")]
    {
        let room = Folder::new(&[("spec.yaml", &spec().replace(from, to)), ("lamp.ies", LAMP)]);
        let made = std::process::Command::new("mkfifo").arg(room.path("pipe")).status();
        assert!(made.is_ok_and(|status| status.success()));
        for spec in ["spec.yaml", "pipe", "/dev/zero"] {
            let refused = room.luxproof(&["check", spec]).exits(2).message();
            assert!(refused.contains("no regular file"), "{refused}");
        }
        for photometry in ["pipe", "/dev/zero"] {
            room.luxproof(&["photometry", photometry]).exits(2).complains("no regular file");
        }
    }
}

#[test]
fn a_matrix_beyond_counting_is_refused_at_once() {
    let choices = (0..10).map(|k| format!("c{k}: ")).join(", ");
    let axes = (0..9).map(|k| format!("  axis{k}: {{{choices}}}")).join("\n");
    refused_files(&format!("{}cases:\n{axes}\n", spec()), LAMP, "spec.yaml:", "10000 cases at most");
}

#[test]
fn a_luminaire_brighter_than_all_is_refused() {
    refused("at_m: [3, 2, 2.5]", "at_m: [3, 2, 2.5], flux_scale: 1e300", "spec.yaml:7:", "nothing is so bright");
}

#[test]
fn settings_that_an_engine_of_ours_does_not_know_are_refused_before_anything_starts() {
    for (engine, says) in [
        ("iesna: {command: [x]}", "give a program of your own another name"),
        ("iesna: {speed: 2}", "settings of iesna: none"),
        ("povray: {cuont: 3}", "settings of povray: preset, count, error_bound"),
        ("povray: {count: many}", "a whole number from 5"),
        ("radiance: {preset: best}", "audit, fast or default"),
        ("simulator: {relative_error: 2}", "must be a number from"),
    ] {
        // Also where the engine takes no part.
        refused_files(&format!("{}engines:\n  {engine}\n", spec()), LAMP, "spec.yaml:15:", says);
    }
}

#[test]
fn who_reads_no_further_is_no_error() {
    let room = room();
    own_run(&room).exits(0);
    for args in [
        &["engines", "list"][..],
        &["schema", "report"],
        &["photometry", "lamp.ies"],
        &["check", "spec.yaml"],
        &["cache", "info"],
        &["report", "out/report.json", "--format", "html"],
    ] {
        let (unread, end) = std::io::pipe().unwrap();
        drop(unread);
        let mut program = room.command(args);
        program.stdout(end.try_clone().unwrap()).stderr(end);
        assert!(program.status().unwrap().success(), "{args:?}");
    }
}

#[test]
fn a_missing_photometric_file_is_named() {
    refused("photometry: lamp.ies", "photometry: lmap.ies", "spec.yaml:7:28", "lmap.ies cannot be read");
}

#[test]
fn malformed_photometry_is_placed_in_its_own_file() {
    refused_files(&spec(), &LAMP.replace("100 80 0", "100 eighty 0"), "lamp.ies:8:5", "eighty");
}

#[test]
fn unknown_meters_luminaires_and_engines_are_answered_with_the_nearest() {
    refused("direct_illuminance: {meters: plane}", "direct_illuminance: {meters: plain}", "spec.yaml:12:", "`plane`?");
    refused("luminaire: lamp", "luminaire: lmap", "spec.yaml:11:", "`lamp`?");
    let with_engine = spec() + "engines: {radianse: {}}\n";
    refused_files(&with_engine, LAMP, "spec.yaml:14:", "did you mean `radiance`?");
}

#[test]
fn an_absent_engine_that_was_asked_for_is_exit_3_and_the_others_run() {
    let room = room();
    let report = room.run(&["--engines", "radiance", "--engines-dir", "nowhere", "--format", "json"]).exits(3).json();
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
    let room = room();
    // Renderers were wanted and none is there: a run that audits nothing is no success.
    let args = ["run", "spec.yaml", "--out", "out", "--no-calibration", "--engines-dir", "nowhere", "--format", "json"];
    // Nor is a system's own, which POV-Ray may be.
    let report = Answer::of(room.command(&args).env("PATH", "")).exits(3).json();
    let count = |key: &str| report[key].as_array().unwrap().len();
    // Meters and light paths that are left out have readings that follow from others.
    let whole = |s: &&Value| s["scope"] == "engine" || s["scope"] == "procedure";
    let all = report["skips"].as_array().unwrap().iter().filter(whole);
    let (known, skipped): (Vec<&Value>, Vec<&Value>) = all.partition(|s| s["case"] == "calibration");
    assert_eq!(count("recordings") + skipped.len(), 3 * count("engines"));
    assert_eq!(report["summary"]["skipped"], skipped.len() + known.len());
    assert!(report["skips"].as_array().unwrap().iter().all(|s| !s["reason"].as_str().unwrap().is_empty()));
}

#[test]
fn our_own_witnesses_agree_and_every_view_of_the_run_says_so() {
    let room = room();
    let printed = own_run(&room).exits(0).json();
    assert_eq!(printed, room.report());
    assert!(room.path("out/readings/simulator.json").exists());
    for (format, says) in
        [("terminal", "luminous_intensity"), ("markdown", "| direct_illuminance |"), ("junit", "<testsuite ")]
    {
        room.luxproof(&["report", "out/report.json", "--format", format]).exits(0).prints(says);
    }
}

#[test]
fn check_prints_the_plan_and_starts_nothing() {
    let room = room();
    room.luxproof(&["check", "spec.yaml"]).exits(0).prints("direct_illuminance at 2 points");
    assert!(!room.path("luxproof-out").exists());
}

#[test]
fn the_schema_knows_every_key_of_the_reference_specs() {
    let room = room();
    let schema = room.luxproof(&["schema", "spec"]).json();
    let properties = schema["properties"].as_object().unwrap();
    for name in ["cachet", "axial"] {
        let text = fs::read_to_string(root().join(format!("reference/specs/{name}.yaml"))).unwrap();
        for key in text.lines().filter_map(|l| l.split_once(':')).map(|(k, _)| k) {
            if key.chars().all(|c| c.is_ascii_alphanumeric() || c == '_') {
                assert!(properties.contains_key(key), "{name}: {key}");
            }
        }
    }
    room.luxproof(&["schema", "report"]).prints("relative_deviation");
}

#[test]
fn a_usage_error_is_exit_2() {
    let room = room();
    room.luxproof(&["run"]).exits(2);
    room.luxproof(&["run", "no-such-spec.yaml"]).exits(2);
    room.luxproof(&["run", "spec.yaml", "--engines", "blender"]).exits(2);
}

#[test]
fn the_citation_names_the_version_that_the_program_prints() {
    let citation = fs::read_to_string(root().join("CITATION.cff")).unwrap();
    let version = citation.lines().find_map(|line| line.strip_prefix("version: ")).unwrap();
    let printed = Folder::new(&[]).luxproof(&["--version"]).exits(0);
    printed.prints(&format!("luxproof {version}"));
}
