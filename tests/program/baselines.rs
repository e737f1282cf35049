//! Baselines as a user meets them: accepted for a reason, held against later runs, refused where they do not match.

use std::fs;
use std::os::unix::fs::PermissionsExt;

use crate::support::{Answer, Folder, LAMP, MINE, OWN, ROOM, TWO_METERS, adapter, sealed};

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
    room.edit("lamp.ies", "100 80 0", "110 80 0");
    run(&room, &["--baseline", "baselines"]).exits(1);
    for (view, says) in [
        ("terminal", "Baseline baselines/spec.json: 4 REFUSED"),
        ("terminal", "exit 1: the run differs from its baseline baselines/spec.json: 4 REFUSED"),
        ("markdown", "Baseline baselines/spec.json: 4 REFUSED"),
        ("junit", "<failure message=\"REFUSED\">task: "),
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
fn a_baseline_of_another_task_is_refused_and_other_words_or_another_version_are_no_other_task() {
    let room = accepted();
    room.forge("baselines/spec.json", VERSION, OTHER_VERSION);
    room.edit("spec.yaml", "title: a test room", "title: the same room under another title");
    let same = run(&room, &["--baseline", "baselines"]).exits(0).prints("4 unchanged");
    same.prints("within noise: iesna version: 0.0.1 before");

    room.edit("lamp.ies", "100 80 0", "110 80 0");
    run(&room, &["--baseline", "baselines"]).exits(1).prints("REFUSED").prints("task: ");
    // The review shows what was accepted beside what is now.
    let review = room.luxproof(&["accept", "out", "--all", "--reason", "a brighter lamp"]).exits(0);
    assert!(review.stdout.matches(" old ").count() >= 8, "{}", review.stdout);
    run(&room, &["--baseline", "baselines"]).exits(0).prints("4 unchanged");
}

/// A renderer of the user: its version, a factor of its values, and whether obstacles cast shadows.
fn renderer(version: &str, factor: f64, has_shadows: bool) -> String {
    let hidden = if has_shadows { "is_hidden(lamp, meter, box)" } else { "False" };
    let shadows = "
def is_hidden(lamp, meter, box):
    near, far = 0.0, 1.0
    for p, q, a, b in zip(meter[\"position_m\"], lamp[\"position_m\"], box[\"min_m\"], box[\"max_m\"]):
        if abs(q - p) < 1e-12:
            if not a < p < b:
                return False
            continue
        one, two = sorted(((a - p) / (q - p), (b - p) / (q - p)))
        near, far = max(near, one), min(far, two)
    return near < far


def answer(job):";
    let (before, rest) =
        adapter().split_once("    if job[\"obstacles\"]:\n").map(|(a, b)| (a.to_owned(), b.to_owned())).unwrap();
    let (_, rest) = rest.split_once('\n').unwrap();
    (before + rest)
        .replace("\ndef answer(job):", shadows)
        .replace("[\"batch\"]", "[\"batch\", \"obstacles\"]")
        .replace("\"version\": \"1\"", &format!("\"version\": \"{version}\""))
        .replace(
            "illuminance_lx(job[\"luminaires\"], meter)",
            &format!(
                "{factor} * illuminance_lx([lamp for lamp in job[\"luminaires\"] \
                 if not any({hidden} for box in job[\"obstacles\"])], meter)"
            ),
        )
}

#[test]
fn a_renderer_under_development_has_one_baseline_over_its_versions() {
    let spec = "luxproof: 1
room:
  size_m: [6, 4, 3]
  reflectance: {floor: 0.2, walls: 0.5, ceiling: 0.7}
obstacles:
  - box: {min_m: [1.5, 1.5, 1.2], max_m: [2.5, 2.5, 1.4], reflectance: 0.4}
luminaires:
  - {id: one, photometry: lamp.ies, at_m: [2, 2, 2.5]}
  - {id: two, photometry: lamp.ies, at_m: [4.5, 2, 2.5]}
meters:
  plane: {points_m: [[2, 2, 0.8], [2.2, 1.9, 0.8], [4, 2, 0.8], [5, 3, 0.8]], normal: [0, 0, 1]}
tolerances:
  direct_illuminance: {relative: 0.01}
procedures:
  direct_illuminance: {meters: plane}
";
    let program = renderer("1.0", 1.0, true);
    let room = Folder::new(&[("spec.yaml", &[spec, MINE].concat()), ("lamp.ies", LAMP), ("adapter.py", &program)]);
    let run = |more: &[&str]| room.run(&[&["--engines", "simulator,mine", "--no-cache"], more].concat());
    run(&[]).exits(0);
    room.luxproof(&["accept", "out", "--all", "--reason", "release 1.0"]).exits(0).prints("3 accepted");
    // The last version also fails its tolerance, and the run names the cause.
    for (version, factor, has_shadows, code, says) in [
        ("1.0", 1.0, true, 0, &["3 unchanged"][..]),
        ("1.1", 1.0, true, 0, &["3 unchanged", "within noise: mine version: "]),
        ("2.0", 1.004, true, 1, &["2 unchanged, 1 SHIFTED", "mean +0.4000 %", "every reading times 1.00400"]),
        ("2.1", 1.0, false, 1, &["1 SHIFTED", "cause: bodies hide nothing"]),
    ] {
        room.write("adapter.py", &renderer(version, factor, has_shadows));
        let answer = run(&["--baseline", "baselines"]).exits(code);
        // The last line may be wrapped.
        let end = answer.stdout.rsplit("\nexit ").next().unwrap_or_default();
        let last = end.split_whitespace().collect::<Vec<_>>().join(" ");
        let answer = says.iter().fold(answer, |answer, text| answer.prints(text));
        let starts = last.starts_with(&format!("{code}: "));
        let explains = last.contains("differs from its baseline")
            && last.contains("1 SHIFTED (first spec direct_illuminance mine: mean +");
        assert!(starts && explains == (code == 1), "{version}: {last}\n{}", answer.stdout);
    }
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
    room.edit("baselines/spec.json", "baseline 3", "baseline 4");
    refused("`luxproof baseline 4`");
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
    run(&room, &["--baseline", "baselines"]).exits(1).prints("no baseline yet for plane[1]");
}

#[test]
fn a_report_of_another_version_is_refused() {
    let room = room();
    run(&room, &[]).exits(0);
    room.edit("out/report.json", "\"luxproof\": 2", "\"luxproof\": 1");
    let refusal = "is a report of version 1, written by luxproof 0.1.0; this luxproof reads version 2";
    for command in [
        &["report", "out/report.json"][..],
        &["diff", "out", "out"],
        &["accept", "out", "--all", "--reason", "it is right"],
        &["history", "add", "out/report.json", "--history", "nights.jsonl"],
    ] {
        let answer = room.luxproof(command).exits(2);
        assert!(answer.message().contains(refusal), "{answer:?}");
    }
    room.edit("out/report.json", "\"readings\"", "\"values\"");
    let answer = room.luxproof(&["diff", "out", "out"]).exits(2);
    assert!(answer.message().contains(refusal), "{answer:?}");
    room.luxproof(&["report", "spec.yaml"]).exits(2).complains("is no report of luxproof");
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
    assert!(room.read("site/index.html").contains("since 2026-01-11"));
    // A failed verdict is denied by default.
    let mut report = first;
    report["comparisons"][0]["verdict"] = "fail".into();
    room.write("out/report.json", &sealed(report));
    room.luxproof(&["history", "add", "out/report.json", "--history", "nights.jsonl", "--night", "2026-01-19"])
        .exits(0);
    drawn(&[]).exits(1).prints("2026-01-19 ").prints(": 1 failed verdict");
    drawn(&["--deny", "change"]).exits(1).prints(": 1 failed verdict");
    drawn(&["--deny", "none"]).exits(0);
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
