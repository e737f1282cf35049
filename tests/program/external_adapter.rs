//! A program of the user's as an engine: the example adapter joins a run, its crash is a failure, what it declines a skip.

use std::process::Command;

use serde_json::Value;

use crate::support::{Answer, Folder, MINE, SKEW_LAMP, SKEW_ROOM, adapter, among};

fn folder(adapter: &str) -> Folder {
    let spec = [SKEW_ROOM, "  indirect_illuminance: {meters: plane}\n", MINE].concat();
    Folder::new(&[("spec.yaml", &spec), ("lamp.ies", SKEW_LAMP), ("adapter.py", adapter)])
}

/// Runs luxproof on the folder's spec elsewhere: paths of the adapter's command count from the spec.
fn elsewhere(folder: &Folder, verb: &str, more: &[&str]) -> Answer {
    let (spec, out) = (folder.path("spec.yaml"), folder.path("out"));
    let args = [&[verb, spec.to_str().unwrap(), "--out", out.to_str().unwrap()], more].concat();
    Answer::of(folder.command(&args).current_dir("/"))
}

fn run(folder: &Folder) -> (Value, Option<i32>) {
    elsewhere(folder, "run", &["--no-calibration", "--format", "json"]).report()
}

fn of_adapter<'a>(report: &'a Value, list: &str, id: &str) -> Vec<&'a Value> {
    among(report, list, &[(id, "mine")])
}

#[test]
fn the_example_adapter_of_sixty_lines_agrees_with_inverse_square() {
    assert!(adapter().lines().count() <= 60);
    let folder = folder(&adapter());
    let (report, code) = run(&folder);
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
    assert!(recording["method"]["python"].as_str().unwrap().starts_with('3'), "{recording}");
}

#[test]
fn an_adapter_that_crashes_is_a_failed_engine_and_the_others_go_on() {
    let folder = folder("import sys\nsys.exit('out of lamps')\n");
    let (report, code) = run(&folder);
    assert_eq!(code, Some(3));
    let engine = of_adapter(&report, "engines", "id")[0];
    assert_eq!(engine["status"], "failed");
    assert!(engine["reason"].as_str().unwrap().contains("out of lamps"), "{engine}");
    assert!(report["readings"].as_array().unwrap().iter().any(|r| r["engine"] == "simulator"));
}

#[test]
fn an_exported_job_runs_by_hand() {
    let folder = folder(&adapter());
    let printed = elsewhere(&folder, "export", &["--engine", "mine"]).stdout;
    let command = printed.lines().find(|l| l.contains("direct_illuminance") && l.contains("&&")).unwrap();
    let answer = Answer::of(Command::new("sh").args(["-c", command])).json();
    assert_eq!(answer["readings"].as_array().unwrap().len(), 3);
    assert_eq!(answer["readings"][1]["meter"], "plane[1]");
}

#[test]
fn an_engine_without_a_command_is_answered_with_what_to_do() {
    let folder = folder(&adapter());
    folder.edit("spec.yaml", "{command: ", "{comand: ");
    folder.luxproof(&["check", "spec.yaml"]).exits(2).complains("there is no engine `mine`").complains("command");
}

#[test]
fn the_forms_have_schemas() {
    let folder = folder(&adapter());
    for (name, key) in [("job", "candela"), ("readings", "illuminance_lx")] {
        let schema = folder.luxproof(&["schema", name]).json();
        assert!(schema.to_string().contains(key), "{schema}");
    }
}

#[test]
fn zero_hits_are_not_seen_and_fail_only_where_samples_are_many() {
    let unlucky = |error: f64| {
        let stated = format!("\"std_error_lx\": {error} * lux, \"degrees_of_freedom\": 7");
        let sampled = adapter().replace("\"error_bound_lx\": 1e-12 * lux", &stated);
        let noise = format!("(1 + {error} * noise.gauss(0, 1))");
        let unlucky = sampled.replace(
            "    for meter in job[\"meters\"]:\n        lux =",
            &format!(
                "    import random\n    noise = random.Random(job[\"seed\"])\n    for meter in job[\"meters\"]:\n        \
                 lux = 0.0 if meter[\"id\"] == \"plane[1]\" else {noise} *"
            ),
        );
        assert!(unlucky != sampled && sampled != adapter());
        let (report, code) = run(&folder(&unlucky));
        let of = |meter: &str| among(&report, "comparisons", &[("engine", "mine"), ("meter", meter)])[0].clone();
        assert_ne!(of("plane[0]")["verdict"], "fail");
        (of("plane[1]"), code)
    };
    let (unseen, code) = unlucky(2e-1);
    assert_eq!(code, Some(4));
    assert_eq!((&unseen["verdict"], &unseen["uncertainty"]["kind"]), (&"inconclusive".into(), &"not_seen".into()));
    assert!(unseen["diagnosis"].as_str().unwrap().starts_with("not seen"), "{unseen}");
    // Where samples are so many, light that comes here would have been met: it is lost.
    let (unseen, code) = unlucky(1e-4);
    assert_eq!((&unseen["verdict"], code), (&"fail".into(), Some(1)), "{unseen}");
}

#[test]
fn whatever_numbers_an_adapter_says_its_report_is_read_back_in_every_view() {
    let folder = folder(&adapter());
    for (lux, error) in [
        ("1e308", "\"exact\": True"),
        ("1e29", "\"std_error_lx\": 1e29, \"degrees_of_freedom\": 1"),
        ("1e-300", "\"std_error_lx\": 5e-324, \"degrees_of_freedom\": 1e300"),
        ("5e-324", "\"error_bound_lx\": 1e30"),
        ("0.0 if meter[\"id\"] == \"plane[1]\" else 1e29", "\"std_error_lx\": 1e-200, \"degrees_of_freedom\": 7"),
    ] {
        let absurd = adapter().replace("\"error_bound_lx\": 1e-12 * lux", error);
        let absurd = absurd.replace(
            "    for meter in job[\"meters\"]:\n        lux =",
            &format!("    for meter in job[\"meters\"]:\n        lux = {lux}\n        other ="),
        );
        assert!(absurd.contains("other =") && absurd.contains(error));
        folder.write("adapter.py", &absurd);
        let (report, _) = run(&folder);
        let status = &of_adapter(&report, "engines", "id")[0]["status"];
        assert_eq!(status, if lux == "1e308" { "failed" } else { "ran" }, "{lux}");
        for format in ["terminal", "markdown", "junit", "csv", "html"] {
            let view = folder.luxproof(&["report", "out/report.json", "--format", format]);
            assert!(view.code != Some(2) && !view.stdout.is_empty(), "{lux} {format}: {}", view.stderr);
        }
        folder.luxproof(&["diff", "out", "out"]).exits(0);
    }
}
