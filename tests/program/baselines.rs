//! Baselines as a user meets them: accepted for a reason, held against later runs, refused where they do not match.

use std::fs;
use std::os::unix::fs::PermissionsExt;

use sha2::{Digest, Sha256};

use crate::support::{Answer, Folder, LAMP, OWN, ROOM, TWO_METERS};

/// As a baseline has it of the program that is tested.
const VERSION: &str = concat!("\"version\": \"", env!("CARGO_PKG_VERSION"), "\"");
const OTHER_VERSION: &str = "\"version\": \"0.0.1\"";

fn room() -> Folder {
    let procedures = "procedures:
  direct_illuminance: {meters: plane}
  indirect_illuminance: {meters: plane}
";
    Folder::new(&[("spec.yaml", &[ROOM, TWO_METERS, procedures].concat()), ("lamp.ies", LAMP)])
}

fn run(room: &Folder, more: &[&str]) -> Answer {
    room.run(&[&["--engines", OWN, "--no-cache"], more].concat())
}

/// A room whose first run was accepted.
fn accepted() -> Folder {
    let room = room();
    run(&room, &[]).exits(0);
    room.luxproof(&["accept", "out", "--all", "--reason", "first look"]).exits(0);
    room
}

#[test]
fn a_missing_baseline_fails_and_leaves_a_candidate_that_nobody_accepted() {
    let room = room();
    let output = run(&room, &["--baseline", "baselines"]).exits(1);
    let candidate = room.path("out/baseline-candidate.json");
    assert!(candidate.exists(), "{}", output.stderr);
    // Copied into place without a review it is refused.
    fs::create_dir(room.path("baselines")).unwrap();
    fs::copy(candidate, room.path("baselines/spec.json")).unwrap();
    run(&room, &["--baseline", "baselines"]).exits(2).complains("was accepted for no");
}

#[test]
fn an_accepted_run_repeats_and_keeps_its_reason() {
    let room = accepted();
    let baseline = room.read("baselines/spec.json");
    assert!(baseline.contains("\"reason\": \"first look\""), "{baseline}");
    run(&room, &["--baseline", "baselines/spec.json"]).exits(0).prints("4 unchanged");
    assert!(!room.path("out/baseline-candidate.json").exists());
}

#[test]
fn every_view_tells_what_departs_from_the_baseline() {
    let room = accepted();
    room.forge("baselines/spec.json", VERSION, OTHER_VERSION);
    run(&room, &["--baseline", "baselines"]).exits(1);
    for (view, says) in [
        ("terminal", "Baseline baselines/spec.json: 4 REFUSED"),
        ("markdown", "Baseline baselines/spec.json: 4 REFUSED"),
        ("junit", "<failure message=\"REFUSED\">version: 0.0.1 before"),
        ("html", "4 REFUSED"),
        ("json", "\"is_as_accepted\": false"),
    ] {
        // A finished run is judged as when it ran.
        room.luxproof(&["report", "out/report.json", "--format", view]).exits(1).prints(says);
    }
}

#[test]
fn others_may_read_a_baseline_as_they_may_any_new_file() {
    let room = accepted();
    let mode = |name: &str| fs::metadata(room.path(name)).unwrap().permissions().mode() & 0o777;
    assert_eq!(mode("baselines/spec.json"), mode("lamp.ies"));
}

#[test]
fn a_baseline_of_another_spec_or_version_is_refused() {
    let room = accepted();
    room.forge("baselines/spec.json", VERSION, OTHER_VERSION);
    run(&room, &["--baseline", "baselines"]).exits(1).prints("REFUSED").prints("version: 0.0.1 before");

    room.forge("baselines/spec.json", OTHER_VERSION, VERSION);
    room.edit("lamp.ies", "100 80 0", "110 80 0");
    run(&room, &["--baseline", "baselines"]).exits(1).prints("REFUSED").prints("spec: ");
}

#[test]
fn a_baseline_that_was_edited_torn_or_moved_is_refused_before_anything_is_measured_and_accepted_anew() {
    let room = accepted();
    let sound = room.read("baselines/spec.json");
    let refused = |says: &str| {
        fs::remove_dir_all(room.path("out")).unwrap();
        run(&room, &["--baseline", "baselines"]).exits(2).complains("baselines/spec.json").complains(says);
        assert!(!room.path("out").exists(), "it was measured");
        room.write("baselines/spec.json", &sound);
        run(&room, &["--baseline", "baselines"]).exits(0);
    };
    room.edit("baselines/spec.json", "\"value\":", "\"value\":1");
    refused("was edited");
    room.write("baselines/spec.json", &sound[..sound.len() / 2]);
    refused("cut short");
    room.edit("baselines/spec.json", "baseline 2", "baseline 3");
    refused("`luxproof baseline 3`");
    room.edit("baselines/spec.json", "\"key\":\"spec\"", "\"key\":\"other\"");
    refused("`other`");
    // That of another spec under this one's name.
    fs::write(room.path("hall.yaml"), room.read("spec.yaml")).unwrap();
    room.write("baselines/hall.json", &sound);
    let hall = room.luxproof(&["run", "hall.yaml", "--engines", OWN, "--out", "hall", "--baseline", "baselines"]);
    hall.exits(2).complains("is about spec, and").complains("hall");
    // What is refused is reviewed anew, and kept aside.
    room.edit("baselines/spec.json", "first look", "second look");
    let accept = ["accept", "out", "--all", "--reason", "third look"];
    room.luxproof(&accept).exits(0).complains("reviewed as new").prints("4 accepted");
    assert!(room.read("baselines/spec.json.refused").contains("second look"));
    run(&room, &["--baseline", "baselines"]).exits(0).prints("4 unchanged");
}

#[test]
fn a_baseline_that_lacks_meters_accepts_nothing_of_them() {
    let room = accepted();
    let baseline = room.read("baselines/spec.json");
    // The first entry's readings but the last.
    let last = baseline.split("\n        {").nth(2).and_then(|rest| rest.split('\n').next()).unwrap().to_owned();
    room.forge("baselines/spec.json", &format!(",\n        {{{last}\n      ]"), "\n      ]");
    run(&room, &["--baseline", "baselines"]).exits(1).prints("there is nothing to hold plane[1] against");
}

#[test]
fn a_report_of_another_version_is_told_and_one_that_does_not_fit_refused() {
    let room = room();
    run(&room, &[]).exits(0);
    room.edit("out/report.json", "\"luxproof\": 1", "\"luxproof\": 2");
    let told = "is a report of version 2 where this luxproof reads version 1";
    for command in [
        &["report", "out/report.json"][..],
        &["diff", "out", "out"],
        &["accept", "out", "--all", "--reason", "it is right"],
        &["history", "add", "out/report.json", "--history", "nights.jsonl"],
    ] {
        room.luxproof(command).exits(0).complains(told);
    }
    room.edit("out/report.json", "\"readings\"", "\"values\"");
    room.luxproof(&["diff", "out", "out"]).exits(2).complains("version 2").complains("missing field `readings`");
    room.luxproof(&["report", "spec.yaml"]).exits(2).complains("is no report of luxproof");
}

/// A report as luxproof would have written it: times and the checksum itself do not count.
fn sealed(mut report: serde_json::Value) -> String {
    report["checksum"] = "".into();
    let mut counted = report.to_string();
    for name in ["\"checksum\"", "\"started\"", "\"wall_s\""] {
        let mut parts = counted.split(name);
        let first = parts.next().unwrap_or_default().to_owned();
        counted = parts.fold(first, |said, part| said + name + &part[part.find([',', '}']).unwrap()..]);
    }
    let checksum = Sha256::digest(counted);
    report["checksum"] = checksum.iter().map(|byte| format!("{byte:02x}")).collect::<Vec<_>>().concat().into();
    report.to_string()
}

#[test]
fn two_runs_that_agree_differ_in_nothing_and_a_planted_change_exits_1() {
    let room = room();
    run(&room, &[]).exits(0);
    fs::create_dir(room.path("later")).unwrap();
    fs::copy(room.path("out/report.json"), room.path("later/report.json")).unwrap();
    room.luxproof(&["diff", "out", "later"]).exits(0);
    let mut report = room.json("later/report.json");
    let reading = &mut report["readings"].as_array_mut().unwrap()[0];
    reading["value"] = (1.01 * reading["value"].as_f64().unwrap()).into();
    room.write("later/report.json", &report.to_string());
    for command in [
        &["diff", "out", "later/report.json"][..],
        &["report", "later/report.json"],
        &["accept", "later", "--all", "--reason", "as it is today"],
        &["history", "add", "later/report.json", "--history", "nights.jsonl"],
    ] {
        room.luxproof(command).exits(2).complains("was edited");
    }
    assert!(!room.path("baselines").exists() && !room.path("nights.jsonl").exists());
    room.write("later/report.json", &sealed(report));
    room.luxproof(&["diff", "out", "later/report.json"]).exits(1).prints("CHANGED").prints("+1.0000 %");
    let changes = room.luxproof(&["diff", "out", "later", "--format", "json"]).json();
    let changed = changes["entries"].as_array().unwrap().iter().filter(|e| e["state"] == "changed").count();
    assert_eq!(changed, 1, "{changes}");
}

#[test]
fn accepting_everything_needs_a_reason_and_a_review_needs_a_terminal() {
    let room = room();
    run(&room, &[]).exits(0);
    room.luxproof(&["accept", "out", "--all"]).exits(2).complains("--reason");
    room.luxproof(&["accept", "out", "--all", "--reason", "  "]).exits(2).complains("empty reason");
    room.luxproof(&["accept", "out"]).exits(2).complains("no terminal");
    assert!(!room.path("baselines").exists());
}

#[test]
fn what_is_accepted_anew_every_night_is_a_drift_in_the_history_still_and_fails_where_it_is_denied() {
    let room = room();
    run(&room, &[]).exits(0);
    let first = room.report();
    for night in 1..=18 {
        // Ten nights alike, then a ten-thousandth more every night.
        let factor = 1.0 + 1e-4 * f64::from(night - 10).max(0.0);
        let mut report = first.clone();
        for list in ["readings", "comparisons"] {
            for one in report[list].as_array_mut().unwrap().iter_mut().filter(|c| c["engine"] == "iesna") {
                let value = one["value"].as_f64().unwrap();
                one["value"] = (value * factor).into();
                if let Some(deviation) = one["deviation"].as_f64() {
                    one["deviation"] = (deviation + value * (factor - 1.0)).into();
                }
            }
        }
        room.write("out/report.json", &sealed(report));
        room.luxproof(&["accept", "out", "--all", "--reason", "as it is today"]).exits(0);
        let date = format!("2026-01-{night:02}");
        room.luxproof(&["history", "add", "out/report.json", "--history", "nights.jsonl", "--night", &date]).exits(0);
    }
    let latest = room.luxproof(&["accept", "out", "--all", "--reason", "as it is today"]).exits(0);
    assert!(latest.stdout.starts_with("0 accepted"), "{}", latest.stdout);
    let site = ["history", "site", "--history", "nights.jsonl", "--out", "site"];
    let drawn = |more: &[&str]| room.luxproof(&[&site[..], more].concat());
    drawn(&[]).exits(0);
    drawn(&["--deny", "drift", "--since", "8"]).exits(1).prints("drifts by +0.01").prints("since 2026-01-11, noticed");
    drawn(&["--deny", "any", "--since", "8"]).exits(1);
    drawn(&["--deny", "change", "--since", "8"]).exits(0);
    // Nothing new was noticed on the last night.
    drawn(&["--deny", "any"]).exits(0);
    drawn(&["--since", "8"]).exits(2);
    assert!(room.read("site/index.html").contains("since 2026-01-11"));
}

#[test]
fn every_view_of_a_run_is_printed_and_the_page_is_kept() {
    let room = room();
    let page = run(&room, &["--format", "html"]).exits(0).stdout;
    assert!(page.starts_with("<!DOCTYPE html>") && page.contains("a test room"));
    assert_eq!(room.read("out/report.html").trim_end(), page.trim_end());
    let view = |args: &[&str]| room.luxproof(&[&["report", "out/report.json"][..], args].concat());
    let csv = view(&["--format", "csv"]).stdout;
    assert_eq!(csv.lines().count(), 1 + room.report()["comparisons"].as_array().unwrap().len(), "{csv}");
    view(&["--format", "markdown", "--link", "https://ci.example/7"])
        .prints("[The whole report](https://ci.example/7)");
    assert!(!view(&[]).stdout.contains('\u{1b}'), "no colour where NO_COLOR is set and no terminal is");
}
