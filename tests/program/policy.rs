//! The project policy as a user meets it: where it is found, what it requires, loosens, excuses and expects.

use serde_json::Value;

use crate::support::{Folder, LAMP, MINE, ROOM, TWO_METERS, adapter, among, root};

const DIRECT: &str = "procedures: {direct_illuminance: {meters: plane}}\n";

/// A room with the adapter of the guide as an engine, whose answers are `factor` times what they should be.
fn room(factor: f64, policy: &str) -> Folder {
    let adapter = adapter();
    let honest = "\"illuminance_lx\": ";
    assert!(adapter.contains(honest), "{adapter}");
    let wrong = adapter.replace(honest, &format!("{honest}{factor} * "));
    let files = [("spec.yaml", [ROOM, TWO_METERS, DIRECT, MINE].concat()), ("lamp.ies", LAMP.to_owned())];
    let folder = Folder::new(&[("adapter.py", &wrong), ("luxproof.yaml", policy)]);
    for (name, text) in files {
        folder.write(name, &text);
    }
    folder
}

fn known(more: &str) -> String {
    format!(
        "known_deviations:\n  - {{engine: mine, case: spec, procedure: direct_illuminance, meter: \"plane[*]\", expected: 0.05, \
         uncertainty: 0.002, cause: a wrong glass, source: measured, owner: us, issue: MINE-1{more}}}\n"
    )
}

fn verdicts(report: &Value) -> Vec<&str> {
    let mine = among(report, "comparisons", &[("engine", "mine")]);
    mine.iter().map(|c| c["verdict"].as_str().unwrap()).collect()
}

#[test]
fn a_required_engine_without_a_reading_is_exit_3_by_name() {
    let room = room(1.0, "required_engines: [mine, radiance]\n");
    let answer = room.run(&[]).exits(3).prints("REQUIRED by luxproof.yaml and without any reading: radiance");
    assert!(!answer.stdout.contains("any reading: mine"), "{}", answer.stdout);
    room.luxproof(&["report", "out/report.json"]).exits(3);
    room.luxproof(&["check", "spec.yaml"]).exits(3).prints("REQUIRED by luxproof.yaml and not to run: radiance");
    room.write("luxproof.yaml", "required_engines: [mine]\n");
    room.run(&[]).exits(0);
    room.luxproof(&["check", "spec.yaml"]).exits(0).prints("policy luxproof.yaml");
}

#[test]
fn the_file_and_its_hash_are_in_the_report_and_another_policy_takes_no_reading_anew() {
    let room = room(1.03, "tolerances: []\n");
    assert_eq!(verdicts(&room.run(&["--format", "json"]).exits(1).json()), ["fail"; 2]);
    std::fs::create_dir(room.path("elsewhere")).unwrap();
    let wide = "tolerances: [{procedure: direct_illuminance, engine: mine, relative: 0.04, source: decided in May}]\n";
    room.write("elsewhere/wide.yaml", wide);
    let answer = room.run(&["--policy", "elsewhere/wide.yaml", "--format", "json"]).exits(0);
    assert!(answer.stderr.contains("from the cache"), "{}", answer.stderr);
    let report = answer.json();
    let policy = &report["cases"][0]["policy"];
    assert_eq!(
        (policy["file"].as_str(), policy["sha256"].as_str().map(str::len)),
        (Some("elsewhere/wide.yaml"), Some(64))
    );
    let mine = among(&report, "comparisons", &[("engine", "mine")]);
    assert_eq!(mine[0]["tolerance_source"], "elsewhere/wide.yaml: decided in May");
}

#[test]
fn a_deviation_on_record_is_known_as_long_as_it_is_there_and_counts() {
    let room = room(1.05, &known(""));
    assert_eq!(verdicts(&room.run(&["--format", "json"]).exits(0).json()), ["known_deviation"; 2]);
    room.write("luxproof.yaml", &known(", expires: 2026-01-31"));
    let expired = "the known deviation of +5.00 % at plane[*] has expired on 2026-01-31: a wrong glass (MINE-1, us)";
    room.run(&[]).exits(1).prints(expired);
    room.write("luxproof.yaml", &known("").replace("plane[*]", "desk[*]"));
    room.run(&[]).exits(1).prints("at desk[*] is not seen");
    room.edit("adapter.py", "1.05 * ", "");
    room.write("luxproof.yaml", &known(""));
    assert_eq!(verdicts(&room.run(&["--format", "json"]).exits(1).json()), ["unexpected_pass"; 2]);
}

#[test]
fn what_is_wrong_in_a_policy_is_refused_at_its_place_before_any_engine_starts() {
    let room = room(1.0, "required_engine: [mine]\n");
    room.run(&[]).exits(2).complains("luxproof.yaml:1:1").complains("did you mean `required_engines`?");
    room.luxproof(&["check", "spec.yaml"]).exits(2).complains("luxproof.yaml:1:1");
    room.write("luxproof.yaml", "profiles: {ci: {}}\n");
    room.run(&["--profile", "cii"]).exits(2).complains("did you mean `ci`?");
    room.run(&["--profile", "ci"]).exits(0).prints("profile ci");
    assert!(room.luxproof(&["schema", "policy"]).json()["properties"]["known_deviations"].is_object());
}

#[test]
fn a_reference_case_under_another_name_has_the_same_verdicts() {
    let folder = Folder::new(&[]);
    let text = std::fs::read_to_string(root().join("reference/specs/cachet.yaml")).unwrap();
    let at = root().join("reference");
    folder.write("copy.yaml", &text.replace("../", &format!("{}/", at.display())));
    let own = ["--engines", "simulator,iesna", "--filter", "*-seven", "--no-calibration", "--format", "json"];
    let of = |spec: &str, out: &str| {
        let report = folder.luxproof(&[&["run", spec, "--out", out][..], &own].concat()).exits(0).json();
        let all = report["comparisons"].as_array().unwrap();
        all.iter().map(|c| c["verdict"].as_str().unwrap().to_owned()).collect::<Vec<_>>()
    };
    let original = of(at.join("specs/cachet.yaml").to_str().unwrap(), "one");
    assert!(original.iter().filter(|v| *v == "known_deviation").count() >= 10, "{original:?}");
    assert_eq!(of("copy.yaml", "two"), original);
}
