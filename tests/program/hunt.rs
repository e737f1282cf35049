//! Hunting and shrinking: planted bugs are found and made small, sound adapters accused of nothing, and one seed gives one sequence.

use serde_json::Value;

use crate::support::{Folder, is_night, root};

/// A folder whose spec names the planted adapter with a bug, or with none.
fn planted(bug: &str) -> Folder {
    let adapter = root().join("ci/benchmarks/planted.py");
    let spec = format!(
        "luxproof: 1
room: {{size_m: [6, 4, 3], reflectance: {{floor: 0.2, walls: 0.5, ceiling: 0.7}}}}
luminaires:
  - {{id: a, photometry: lamp.ies, at_m: [2, 2, 2.5], rotate_deg: {{azimuth: 30, tilt: 20}}, flux_scale: 0.8}}
  - {{id: b, photometry: lamp.ies, at_m: [4.5, 1, 2.75]}}
obstacles:
  - {{box: {{min_m: [1, 1, 0], max_m: [1.5, 1.5, 0.5], reflectance: 0.3}}}}
meters:
  plane: {{points_m: [[0.7, 1, 0.8], [3, 2.2, 0.8], [5, 3.5, 0.1]], normal: [0, 0, 1]}}
  wall: {{grid: {{origin_m: [0.01, 0.5, 0.5], u_m: [0, 0.7, 0], v_m: [0, 0, 0.6], counts: [4, 3]}}, normal: [1, 0, 0]}}
procedures:
  direct_illuminance: {{meters: [plane, wall]}}
engines: {{mine: {{command: [python3, -S, {}, {bug}]}}}}
",
        adapter.display()
    );
    Folder::new(&[("adapters.yaml", &spec), ("lamp.ies", crate::support::SKEW_LAMP)])
}

fn hunt(folder: &Folder, more: &[&str]) -> (Value, Option<i32>) {
    let args = ["hunt", "--engines", "mine", "--out", "out", "--format", "json", "--procedures", "direct_illuminance"];
    folder.luxproof(&[&args[..], more].concat()).report()
}

#[test]
fn planted_bugs_are_found_made_small_and_handed_over() {
    // `ci/benchmarks/hunt` hunts all that are written.
    let bugs = [("gamma_nearest", "verdict"), ("nan_axis", "failure"), ("abs_cosine", "too_much")];
    for (bug, says) in bugs.into_iter().take(if is_night() { 3 } else { 1 }) {
        let folder = planted(bug);
        let (found, code) = hunt(&folder, &["--findings", "1", "--specs", "160", "--minutes", "5", "--seed", "2"]);
        assert_eq!(code, Some(1), "{bug}: {found}");
        let finding = &found["findings"][0];
        assert!(finding["oracle"].to_string().contains(says), "{bug}: {finding}");
        assert!(finding["lines"].as_u64().unwrap() <= 12, "{bug}: {finding}");
        let values = finding["table"][0].as_u64().unwrap() * finding["table"][1].as_u64().unwrap();
        assert!(values <= 6, "{bug}: {finding}");
        let own = |file: &str| folder.read(&format!("out/mine-1/{file}"));
        let issue = own("issue.md");
        for part in ["## What", "## Expected and actual", "## Cause", "## How to reproduce", "luxproof run spec.yaml"] {
            assert!(issue.contains(part), "{bug}: no {part} in {issue}");
        }
        assert!(
            own("scene/by-hand.sh").contains("planted.py") && own("original/spec.yaml").contains("luminaires"),
            "{bug}"
        );
        assert!(folder.read("out/index.md").contains("mine-1/issue.md"));
        // The minimal spec fails by itself, in a folder of its own.
        let run =
            folder.luxproof(&["run", "out/mine-1/spec.yaml", "--engines", "mine", "--no-calibration", "--out", "run"]);
        let expected = if says == "failure" { 3 } else { 1 };
        run.exits(expected);
    }
}

#[test]
fn sound_adapters_are_accused_of_nothing_noisy_ones_included() {
    for sound in if is_night() { &["noisy", "none"][..] } else { &["noisy"] } {
        let specs = if is_night() { 48 } else { 24 };
        let (found, code) = hunt(&planted(sound), &["--specs", &specs.to_string(), "--minutes", "5"]);
        assert_eq!((code, found["findings"].as_array().map(Vec::len)), (Some(0), Some(0)), "{sound}: {found}");
        assert!(
            6 * found["specs"].as_u64().unwrap() >= 5 * specs && found["comparisons"].as_u64().unwrap() > 100,
            "{found}"
        );
        assert!(found["coverage"]["features"].as_object().unwrap().len() > 30, "{found}");
    }
}

#[test]
fn a_hunt_goes_on_where_it_stopped_and_one_seed_gives_one_sequence() {
    let (halves, whole) = (planted("none"), planted("none"));
    let [half, all] = if is_night() { ["8", "16"] } else { ["4", "8"] };
    hunt(&halves, &["--specs", half]);
    let (halves, _) = hunt(&halves, &["--specs", all]);
    let (whole, _) = hunt(&whole, &["--specs", all]);
    for key in ["next", "specs", "comparisons", "coverage"] {
        assert_eq!(halves[key], whole[key], "{key}");
    }
    let folder = planted("none");
    hunt(&folder, &["--specs", "1"]);
    folder.luxproof(&["hunt", "--engines", "mine", "--out", "out", "--seed", "2"]).exits(2).complains("seed 1");
}

#[test]
fn a_users_own_spec_is_shrunk_to_the_failure_it_shows() {
    let folder = planted("no_cosine");
    let found = folder.luxproof(&["shrink", "adapters.yaml", "--engine", "mine", "--out", "small", "--format", "json"]);
    let (finding, code) = found.report();
    assert_eq!(code, Some(1));
    assert_eq!(finding["oracle"]["verdict"], "too_much", "{finding}");
    let spec = folder.read("small/spec.yaml");
    let lines = spec.lines().count();
    assert!(lines <= 12 && !spec.contains("obstacles") && spec.matches("id: ").count() == 1, "{spec}");
    assert!(finding["table"][0] == 1 && finding["table"][1] == 2, "{finding}");
    folder.luxproof(&["run", "small/spec.yaml", "--engines", "mine", "--no-calibration"]).exits(1);
    let sound = planted("none");
    sound.luxproof(&["shrink", "adapters.yaml", "--engine", "mine"]).exits(0).complains("nothing is wrong with mine");
}

#[test]
fn an_engine_that_nobody_names_is_an_error_with_what_to_do() {
    let folder = Folder::new(&[]);
    folder.luxproof(&["hunt", "--engines", "mine"]).exits(2).complains("--spec FILE");
    folder.luxproof(&["hunt", "--engines", "radiance", "--minutes", "0"]).exits(3).complains("radiance");
}

#[test]
fn a_hunt_of_named_engines_leaves_out_what_a_spec_declares_besides() {
    let folder = planted("none");
    let spec = folder.read("adapters.yaml");
    let mine = spec.trim_end().rsplit_once("{mine: ").unwrap().1.trim_end_matches('}').to_owned() + "}";
    folder.write("adapters.yaml", &spec.replace("{mine: ", &format!("{{other: {mine}, mine: ")));
    let (found, code) = hunt(&folder, &["--specs", "1"]);
    assert_eq!((&found["engines"], code), (&serde_json::json!(["mine"]), Some(0)), "{found}");
}
