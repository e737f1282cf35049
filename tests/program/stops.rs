//! Runs that end before their last case: a filter, `--fail-fast`, Ctrl-C. What is left out is always said.

#![allow(clippy::unwrap_used, missing_docs, reason = "a test that cannot go on has failed")]

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant};

use serde_json::Value;

const SPEC: &str = "luxproof: 1
room:
  size_m: [6, 4, 3]
  reflectance: {floor: 0.2, walls: 0.5, ceiling: 0.7}
luminaires:
  - {id: lamp, photometry: lamp.ies, at_m: [3, 2, 2.5]}
meters:
  plane: {points_m: [[1, 1, 0.8], [3, 2, 0.8]], normal: [0, 0, 1]}
procedures:
  direct_illuminance: {meters: plane}
engines:
  mine: {command: [python3, adapter.py]}
cases:
  - {name: one}
  - {name: two, luminaires: {lamp: {flux_scale: 0.5}}}
  - {name: three, luminaires: {lamp: {flux_scale: 0.25}}}
";

const LAMP: &str = "IESNA:LM-63-2002
TILT=NONE
1 -1 1 3 1 1 2 0 0 0
1 1 0
0 60 90
0
100 80 0
";

/// Before the example adapter's own lines: it writes down which case it is started for, and does as the test says.
const WATCHED: &str = "import json, os, sys, time
text = sys.stdin.read()
case = json.loads(text)['case']
with open('starts', 'a') as f:
    f.write(case + '\\n')
if case.endswith('two') and os.path.exists('hang'):
    time.sleep(600)
if case.endswith('two') and os.path.exists('fail'):
    sys.exit('made to fail')
import io
sys.stdin = io.StringIO(text)
";

struct Folder(tempfile::TempDir);

impl Folder {
    fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let example = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/examples/inverse_square.py");
        let adapter = format!("{WATCHED}{}", fs::read_to_string(example).unwrap());
        for (name, text) in [("spec.yaml", SPEC), ("lamp.ies", LAMP), ("adapter.py", &adapter)] {
            fs::write(folder.path().join(name), text).unwrap();
        }
        Self(folder)
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn command(&self, args: &[&str]) -> Command {
        let mut program = Command::new(env!("CARGO_BIN_EXE_luxproof"));
        program.args(["run", "spec.yaml", "--out", "out", "--format", "json"]).args(args).current_dir(self.0.path());
        program.env("NO_COLOR", "1").env("LUXPROOF_ENGINES", self.path("engines"));
        program.env("LUXPROOF_CACHE", self.path("cache"));
        program.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
        program
    }

    fn run(&self, args: &[&str]) -> Output {
        self.command(args).output().unwrap()
    }

    fn report(&self) -> Value {
        serde_json::from_str(&fs::read_to_string(self.path("out/report.json")).unwrap()).unwrap()
    }

    /// How often the adapter was started for each case of the spec, calibration apart.
    fn starts(&self) -> [usize; 3] {
        let starts = fs::read_to_string(self.path("starts")).unwrap_or_default();
        ["one", "two", "three"].map(|name| starts.lines().filter(|l| *l == format!("spec/{name}")).count())
    }
}

fn skipped<'a>(report: &'a Value, case: &str) -> Vec<&'a Value> {
    report["skips"].as_array().unwrap().iter().filter(|s| s["case"] == case).collect()
}

fn is_not_run(skip: &Value) -> bool {
    skip["reason"].as_str().unwrap().starts_with("not run")
}

#[test]
fn fail_fast_stops_after_the_first_case_that_fails_and_says_what_was_left() {
    let folder = Folder::new();
    fs::write(folder.path("fail"), "").unwrap();
    let output = folder.run(&["--fail-fast"]);
    assert_eq!(output.status.code(), Some(3), "{}", String::from_utf8_lossy(&output.stderr));
    assert_eq!(folder.starts(), [1, 1, 0]);
    let report = folder.report();
    // simulator, iesna and mine: all of them were due.
    let left = skipped(&report, "spec/three");
    assert_eq!(left.len(), 3, "{left:?}");
    assert!(left.iter().all(|s| s["reason"] == "not run: spec/two failed, and --fail-fast was asked for"), "{left:?}");
    assert!(!skipped(&report, "spec/one").iter().any(|s| is_not_run(s)));
    // Without it the last case runs all the same.
    assert_eq!(folder.run(&[]).status.code(), Some(3));
    assert_eq!(folder.starts()[2], 1);
}

#[test]
fn a_filter_runs_the_cases_it_names_and_is_refused_if_it_names_none() {
    let folder = Folder::new();
    let output = folder.run(&["--filter", "t*o", "--filter", "*/t*o"]);
    let messages = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(0), "{messages}");
    assert_eq!(folder.starts(), [0, 1, 0]);
    // No terminal: a line a job, none of them a bar.
    assert!(messages.contains("[3/3] spec/two: mine: direct_illuminance"), "{messages}");
    assert!(!messages.contains(" left ["), "{messages}");
    let output = folder.run(&["--filter", "four"]);
    assert_eq!(output.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&output.stderr).contains("no case matches `four`"));
}

#[test]
fn an_interrupted_run_leaves_a_valid_report_of_what_was_done_and_of_what_was_not() {
    let folder = Folder::new();
    fs::write(folder.path("hang"), "").unwrap();
    // One case at a time, so that it is certain which have begun.
    let child = folder.command(&["--jobs", "1"]).spawn().unwrap();
    let patience = Instant::now();
    while folder.starts()[1] == 0 {
        assert!(patience.elapsed() < Duration::from_secs(120), "the second case never started");
        std::thread::sleep(Duration::from_millis(20));
    }
    assert!(Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap().success());
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(3), "{}", String::from_utf8_lossy(&output.stderr));
    let report = folder.report();
    assert_eq!(serde_json::from_slice::<Value>(&output.stdout).unwrap(), report);
    let of = |case: &str, list: &str| {
        report[list].as_array().unwrap().iter().filter(|r| r["case"] == case && r["engine"] == "mine").count()
    };
    assert_eq!((of("spec/one", "readings"), of("spec/two", "readings"), of("spec/three", "readings")), (2, 0, 0));
    let missing = report["comparisons"].as_array().unwrap().iter().filter(|c| c["case"] == "spec/two");
    assert!(missing.filter(|c| c["engine"] == "mine").all(|c| c["verdict"] == "missing"));
    let left = skipped(&report, "spec/three");
    assert_eq!(left.len(), 3, "{left:?}");
    assert!(left.iter().all(|s| s["reason"] == "not run: the run was interrupted"), "{left:?}");
    // Viewed again it still is no success.
    let view = Command::new(env!("CARGO_BIN_EXE_luxproof")).arg("report").arg(folder.path("out/report.json")).output();
    assert_eq!(view.unwrap().status.code(), Some(3));
    // Run again, it goes on where it stopped: the case that was whole is not rendered a second time.
    fs::remove_file(folder.path("hang")).unwrap();
    let output = folder.run(&["--jobs", "1"]);
    assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
    assert_eq!(folder.starts(), [1, 2, 1]);
    assert!(!folder.report()["skips"].as_array().unwrap().iter().any(is_not_run));
}
