//! Full and broken disks, kills at every write, runs beside each other, what is no file where one is looked for, and a wish to stop before
//! anything is measured.

use std::fs;
use std::os::unix::process::ExitStatusExt;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use crate::support::{Answer, Folder, LAMP, MINE, OWN, ROOM, TWO_METERS, adapter, among, root};

const DIRECT: &str = "procedures:\n  direct_illuminance: {meters: plane}\n";

fn faults(args: &[&str]) -> Answer {
    let mut faults = Command::new("python3");
    faults.arg(root().join("ci/faults")).args(args).env("LUXPROOF", env!("CARGO_BIN_EXE_luxproof"));
    Answer::of(&mut faults)
}

#[test]
fn a_failing_call_or_a_kill_there_loses_nothing_and_leaves_nothing() {
    faults(&["--every", "29", "--kills", "0", "--together", "0"]).exits(0);
}

#[test]
fn runs_that_are_killed_or_beside_each_other_say_nothing_wrong() {
    faults(&["--every", "0", "--kills", "8", "--together", "1"]).exits(0).prints("8 runs killed").prints("at once");
}

#[test]
fn pipes_devices_and_huge_files_are_refused_in_place_of_what_is_kept() {
    let folder = Folder::new(&[("spec.yaml", &[ROOM, TWO_METERS, DIRECT].concat()), ("lamp.ies", LAMP)]);
    folder.run(&["--engines", OWN]).exits(0);
    assert!(Command::new("mkfifo").arg(folder.path("pipe")).status().unwrap().success());
    // It takes no room on the disk.
    fs::File::create(folder.path("huge")).unwrap().set_len(5 << 30).unwrap();
    for (place, says) in [("pipe", "no regular file"), ("/dev/zero", "no regular file"), ("huge", "has more than")] {
        let path = folder.path(place);
        let path = path.to_str().unwrap();
        let held =
            ["run", "spec.yaml", "--out", "out", "--engines", OWN, "--no-calibration", "--baseline", "held.json"];
        fs::remove_file(folder.path("held.json")).ok();
        std::os::unix::fs::symlink(path, folder.path("held.json")).unwrap();
        let commands: [&[&str]; 8] = [
            &["report", path],
            &["report", "out/report.json", "--beside", path, "--format", "html"],
            &["diff", path, "out"],
            &["accept", path, "--all", "--reason", "none"],
            &["accept", "out", "--all", "--reason", "none", "--baseline", "held.json"],
            &["history", "add", "out/report.json", "--history", path],
            &["history", "site", "--history", path, "--out", "site"],
            &held,
        ];
        for args in commands {
            let answer = folder.luxproof(args).exits(2);
            let line = answer.message();
            assert!(line.contains(says), "{args:?}: no `{says}` in {line}");
        }
    }
    // One that lies where a report is to be written is waited at no more, and gives way.
    fs::rename(folder.path("pipe"), folder.path("out/report.json")).unwrap();
    folder.run(&["--engines", OWN]).exits(0);
    folder.report();
}

#[test]
fn where_nothing_is_measured_yet_the_first_wish_to_stop_is_heeded() {
    // A million meters in a grid: it is read and planned for a while.
    let grid = "meters:\n  plane: {grid: {origin_m: [0.001, 0.001, 0.8], u_m: [0.005, 0, 0], v_m: [0, 0.003, 0], counts: [1000, 1000]}, \
                normal: [0, 0, 1]}\n";
    let folder = Folder::new(&[("spec.yaml", &[ROOM, grid, DIRECT].concat()), ("lamp.ies", LAMP)]);
    for command in [&["check", "spec.yaml"][..], &["run", "spec.yaml", "--out", "out"]] {
        let mut program = folder.command(command);
        let mut child = program.stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
        std::thread::sleep(Duration::from_millis(300));
        let was_running = child.try_wait().unwrap().is_none();
        Command::new("kill").args(["-TERM", &child.id().to_string()]).status().unwrap();
        let patience = Instant::now();
        while child.try_wait().unwrap().is_none() {
            assert!(patience.elapsed() < Duration::from_secs(60), "{command:?} does not end");
            std::thread::sleep(Duration::from_millis(20));
        }
        let status = child.wait().unwrap();
        // Before it is heeded at all it ends the program like any other.
        let is_stopped = matches!(status.code(), Some(130 | 3)) || status.signal() == Some(15);
        assert!(is_stopped || !was_running, "{command:?}: {status}");
    }
}

#[test]
fn a_meter_without_a_number_fails_its_engine_and_no_other_reading() {
    let folder = Folder::new(&[("spec.yaml", &[ROOM, TWO_METERS, DIRECT, MINE].concat()), ("lamp.ies", LAMP)]);
    let from = "    for meter in job[\"meters\"]:\n        lux =";
    for (name, lux) in
        [("NaN", "float('nan')"), ("infinite", "float('inf')"), ("no number", "None"), ("too bright", "1e31")]
    {
        let last = format!("{from} {lux} if meter[\"id\"] == \"plane[0]\" else");
        let adapter =
            adapter().replace(from, &last).replace("\"error_bound_lx\": 1e-12 * lux", "\"error_bound_lx\": 1e-9");
        assert!(adapter.contains(&last), "{name}");
        folder.write("adapter.py", &adapter);
        folder.run(&[]).exits(3).complains("the readings of the other meters are kept");
        let report = folder.report();
        let engine = among(&report, "engines", &[("id", "mine")])[0];
        assert!(
            engine["status"] == "failed" && engine["reason"].as_str().unwrap().contains("plane[0]"),
            "{name}: {engine}"
        );
        let readings = among(&report, "readings", &[("engine", "mine")]);
        assert!(readings.len() == 1 && readings[0]["meter"] == "plane[1]", "{name}: {readings:?}");
        let verdict = |meter: &str| among(&report, "comparisons", &[("engine", "mine"), ("meter", meter)])[0].clone();
        assert_eq!(
            (&verdict("plane[0]")["verdict"], &verdict("plane[1]")["verdict"]),
            (&"missing".into(), &"pass".into())
        );
        assert!(verdict("plane[0]")["diagnosis"].as_str().unwrap().contains("at plane[0]"), "{name}");
        // What is left of it becomes no baseline, and every view can be drawn.
        folder.luxproof(&["accept", "out", "--all", "--reason", "none"]).complains("never accepted");
        for format in ["terminal", "markdown", "junit", "csv", "html"] {
            folder.luxproof(&["report", "out/report.json", "--format", format]).exits(3);
        }
    }
}
