//! Runs that end before their last case: a filter, `--fail-fast`, Ctrl-C. What is left out is always said.

use std::fs;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use serde_json::Value;

use crate::support::{Answer, Folder, LAMP, MINE, OWN, ROOM, TWO_METERS, adapter_with_lines_before_readings, among};

const CASES: &str = "procedures:
  direct_illuminance: {meters: plane}
cases:
  - {name: one}
  - {name: two, luminaires: {lamp: {flux_scale: 0.5}}}
  - {name: three, luminaires: {lamp: {flux_scale: 0.25}}}
";

/// Before the example adapter takes readings: it writes down which case it is started for, and does as the test says.
const WATCHED: &str = "import os, time
case = request['jobs'][0]['case']
with open('starts', 'a') as f:
    f.write(case + '\\n')
if case.endswith('two') and os.path.exists('hang'):
    time.sleep(600)
if case.endswith('two') and os.path.exists('fail'):
    sys.exit('made to fail')
";

fn folder() -> Folder {
    let spec = [ROOM, TWO_METERS, CASES, MINE].concat();
    Folder::new(&[
        ("spec.yaml", &spec),
        ("lamp.ies", LAMP),
        ("adapter.py", &adapter_with_lines_before_readings(WATCHED)),
    ])
}

/// How often the adapter was started for each case of the spec: once, and again for a twentieth of what it claims.
fn starts(folder: &Folder) -> [usize; 3] {
    let starts = fs::read_to_string(folder.path("starts")).unwrap_or_default();
    ["one", "two", "three"].map(|name| starts.lines().filter(|l| *l == format!("spec/{name}")).count())
}

fn skipped<'a>(report: &'a Value, case: &str) -> Vec<&'a Value> {
    among(report, "skips", &[("case", case)])
}

fn is_not_run(skip: &Value) -> bool {
    skip["reason"].as_str().unwrap().starts_with("not run")
}

#[test]
fn fail_fast_stops_after_the_first_case_that_fails_and_says_what_was_left() {
    let folder = folder();
    folder.write("fail", "");
    folder.run(&["--fail-fast"]).exits(3);
    assert_eq!(starts(&folder), [2, 1, 0]);
    let report = folder.report();
    // simulator, iesna and mine: all of them were due.
    let left = skipped(&report, "spec/three");
    assert_eq!(left.len(), 3, "{left:?}");
    assert!(left.iter().all(|s| s["reason"] == "not run: spec/two failed, and --fail-fast was asked for"), "{left:?}");
    assert!(!skipped(&report, "spec/one").iter().any(|s| is_not_run(s)));
    // Without it the last case runs all the same.
    folder.run(&[]).exits(3);
    assert_eq!(starts(&folder)[2], 2);
}

#[test]
fn a_filter_runs_the_cases_it_names_and_is_refused_if_it_names_none() {
    let folder = folder();
    let messages = folder.run(&["--filter", "t*o", "--filter", "*/t*o"]).exits(0).stderr;
    assert_eq!(starts(&folder), [0, 2, 0]);
    // No terminal: a line per case and engine, and no bar.
    assert!(messages.contains("[3/3] spec/two: mine: direct_illuminance"), "{messages}");
    assert!(!messages.contains(" left"), "{messages}");
    folder.run(&["--filter", "four"]).exits(2).complains("no case matches `four`");
}

#[test]
fn an_interrupted_run_reports_what_was_done_and_what_was_not() {
    let folder = folder();
    folder.write("hang", "");
    // One case at a time, so that it is certain which have begun.
    let mut program =
        folder.command(&["run", "spec.yaml", "--out", "out", "--no-calibration", "--format", "json", "--jobs", "1"]);
    let child = program.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    let patience = Instant::now();
    while starts(&folder)[1] == 0 {
        assert!(patience.elapsed() < Duration::from_secs(120), "the second case never started");
        std::thread::sleep(Duration::from_millis(20));
    }
    assert!(Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap().success());
    let output = Answer::from(child.wait_with_output().unwrap()).exits(3);
    let report = folder.report();
    assert_eq!(output.json(), report);
    let of = |list: &str, case: &str| among(&report, list, &[("case", case), ("engine", "mine")]);
    assert_eq!(["spec/one", "spec/two", "spec/three"].map(|case| of("readings", case).len()), [2, 0, 0]);
    assert!(of("comparisons", "spec/two").iter().all(|c| c["verdict"] == "missing"));
    let left = skipped(&report, "spec/three");
    assert_eq!(left.len(), 3, "{left:?}");
    assert!(left.iter().all(|s| s["reason"] == "not run: the run was interrupted"), "{left:?}");
    // Viewed again it still is no success.
    folder.luxproof(&["report", "out/report.json"]).exits(3);
    // Run again, it goes on where it stopped: the case that was whole is not rendered a second time.
    fs::remove_file(folder.path("hang")).unwrap();
    folder.run(&["--jobs", "1"]).exits(0);
    assert_eq!(starts(&folder), [2, 3, 2]);
    assert!(!folder.report()["skips"].as_array().unwrap().iter().any(is_not_run));
}

/// Reflected light in a furnished room, finely: our simulator may be stopped long before it is done, and says what it knows by then.
#[test]
fn what_was_known_when_it_was_stopped_answers_no_other_run() {
    let table = "obstacles:\n  - box: {min_m: [2, 1, 0], max_m: [4, 2, 0.7], reflectance: 0.4}\n";
    let asked = "procedures:\n  total_illuminance: {meters: plane}\nbudget: {relative_error: 0.002, seconds: 600}\n";
    let folder = Folder::new(&[("spec.yaml", &[ROOM, table, TWO_METERS, asked].concat()), ("lamp.ies", LAMP)]);
    let own = ["--engines", OWN];
    let began = Instant::now();
    folder.run(&[&own[..], &["--no-cache"]].concat()).exits(0);
    let (whole, whole_s) = (folder.report(), began.elapsed());
    for tenths in [2, 4, 6, 8, 9] {
        let mut program = folder.command(&["run", "spec.yaml", "--out", "out", "--no-calibration", "--engines", OWN]);
        let mut child = program.stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
        std::thread::sleep(whole_s * tenths / 10);
        assert!(Command::new("kill").args(["-TERM", &child.id().to_string()]).status().unwrap().success());
        child.wait().unwrap();
    }
    folder.run(&own).exits(0);
    assert_eq!(folder.report()["readings"], whole["readings"]);
}
