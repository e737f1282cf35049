//! What engines may do and take: all that they start ends, their output and memory are bounded, and one run at a time has a folder.

use std::fs::{self, File};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use luxproof_process::output_lock::OutputLock;
use luxproof_process::process::sandbox_in_words;
use serde_json::Value;

use crate::support::{Answer, Folder, LAMP, MINE, OWN, ROOM, TWO_METERS, adapter_with_lines_before_readings, among};

/// Nothing here takes nearly as long, on however busy a machine.
const PATIENCE: Duration = Duration::from_secs(120);

/// Starts a process that leaves group and session, ignores the usual signals and writes its number into the file `pid`.
const STRAY: &str = "import os, signal, time
if os.fork() == 0:
    os.setsid()
    if os.fork() == 0:
        signal.signal(signal.SIGTERM, signal.SIG_IGN)
        signal.signal(signal.SIGHUP, signal.SIG_IGN)
        with open('pid.new', 'w') as file:
            file.write(str(os.getpid()))
        os.rename('pid.new', 'pid')
        time.sleep(3600)
    os._exit(0)
while not os.path.exists('pid'):
    time.sleep(0.01)
";

/// A spec with an adapter that does something before it takes readings.
fn folder(before: &str) -> Folder {
    let spec = [ROOM, TWO_METERS, "procedures:\n  direct_illuminance: {meters: plane}\n", MINE].concat();
    Folder::new(&[
        ("spec.yaml", &spec),
        ("lamp.ies", LAMP),
        ("adapter.py", &adapter_with_lines_before_readings(before)),
    ])
}

#[track_caller]
fn until(what: &str, mut holds: impl FnMut() -> bool) {
    let start = Instant::now();
    while !holds() {
        assert!(start.elapsed() < PATIENCE, "{what}");
        std::thread::sleep(Duration::from_millis(10));
    }
}

#[track_caller]
fn stray_ends(folder: &Folder) {
    let stray = folder.read("pid");
    // One that nobody has buried yet is dead all the same.
    let lives = || {
        let status = fs::read_to_string(format!("/proc/{stray}/status")).unwrap_or_default();
        status.lines().any(|line| line.starts_with("State:") && !line.contains('Z'))
    };
    until("what the adapter started lives on", || !lives());
}

fn signal(name: &str, process: u32) {
    assert!(Command::new("kill").args([name, &process.to_string()]).status().unwrap().success());
}

fn readings<'a>(report: &'a Value, engine: &str) -> Vec<&'a Value> {
    among(report, "readings", &[("engine", engine)])
}

#[test]
fn what_an_engine_leaves_behind_ends_with_it_and_its_answer_counts() {
    let folder = folder(STRAY);
    folder.run(&[]).exits(0);
    assert_eq!(readings(&folder.report(), "mine").len(), 2);
    stray_ends(&folder);
}

#[test]
fn nothing_outlives_a_luxproof_that_is_killed() {
    let folder = folder(&(STRAY.to_owned() + "time.sleep(3600)\n"));
    let mut program = folder.command(&["run", "spec.yaml", "--out", "out", "--no-calibration"]);
    let mut child = program.stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
    until("the adapter never started", || folder.path("pid").exists());
    signal("-KILL", child.id());
    child.wait().unwrap();
    stray_ends(&folder);
}

#[test]
fn asked_a_second_time_to_stop_it_ends_at_once() {
    let folder = Folder::new(&[]);
    // It waits for a request that never comes, and so heeds no first wish.
    let mut child = folder.command(&["read-one"]).stdin(Stdio::piped()).spawn().unwrap();
    until("it does not end", || {
        signal("-INT", child.id());
        child.try_wait().unwrap().is_some()
    });
    // The first may come before it is heeded at all.
    let status = child.wait().unwrap();
    assert!(status.code() == Some(130) || status.code().is_none(), "{status}");
}

#[test]
fn an_engine_that_takes_too_much_memory_fails_alone() {
    let folder = folder("hoard = []\nwhile True:\n    hoard.append(bytearray(10 ** 7))\n");
    let mut program = folder.command(&["run", "spec.yaml", "--out", "out", "--no-calibration"]);
    let answer = Answer::of(program.env("LUXPROOF_ENGINE_MEMORY_MIB", "300")).exits(3);
    answer.complains("MiB of memory, where 300 are allowed");
    let report = folder.report();
    assert_eq!(["simulator", "iesna", "mine"].map(|engine| readings(&report, engine).len()), [2, 2, 0]);
}

#[test]
fn of_endless_messages_the_log_keeps_both_ends() {
    let folder = folder(
        "import sys\nsys.stderr.write('the beginning\\n')\nfor _ in range(100):\n    sys.stderr.write('x' * 10 ** 6)\n\
         sys.stderr.write('\\nthe end\\n')\n",
    );
    folder.run(&[]).exits(0);
    let log = folder.read("out/logs/mine.direct_illuminance.log");
    assert!(log.len() < 2_000_000, "{}", log.len());
    for part in ["the beginning", "bytes left out", "the end"] {
        assert!(log.contains(part), "no `{part}`");
    }
}

/// What a supervisor of ours lets a script do, which gets a folder that it may write.
fn confined(folder: &Folder, script: &str) -> Answer {
    let parent = format!("--parent={}", std::process::id());
    let writable = format!("--writable={}", folder.path("bench").display());
    fs::create_dir_all(folder.path("bench")).unwrap();
    folder.luxproof(&["__supervise", &parent, "--confined", &writable, "--", "sh", "-c", script])
}

#[test]
fn a_confined_engine_writes_in_its_own_folders_alone() {
    let folder = Folder::new(&[("read", "light\n")]);
    confined(&folder, "cat read && echo dark > bench/a && echo dark > $TMPDIR/b && echo dark > /dev/null")
        .exits(0)
        .prints("light");
    let code = i32::from(sandbox_in_words().starts_with("on ("));
    for script in ["echo dark 2>/dev/null > read", "mkdir elsewhere 2>/dev/null", "kill -0 $PPID 2>/dev/null"] {
        let is_refused = confined(&folder, &format!("({script}) || exit 1")).exits(code);
        assert!(is_refused.stdout.is_empty(), "{script}");
    }
    confined(&folder, "exit 7").exits(7);
    assert_eq!(confined(&folder, "kill -KILL $$").code, None);
    let parent = format!("--parent={}", std::process::id());
    folder.luxproof(&["__supervise", &parent, "--", "no-such-renderer"]).exits(125).complains("No such file");
}

#[test]
fn one_run_at_a_time_has_a_folder_and_it_is_looked_at_first() {
    let folder = folder("open('started', 'w').close()\n");
    let claim = OutputLock::of(&folder.path("out")).unwrap();
    folder.run(&[]).exits(2).complains("in use by process").complains("--out");
    drop(claim);
    folder.luxproof(&["run", "spec.yaml", "--out", "lamp.ies/out"]).exits(2).complains("no run can be kept there");
    assert!(!folder.path("started").exists());
    folder.run(&[]).exits(0);
    assert!(folder.path("started").exists());
}

#[test]
fn a_run_of_less_leaves_the_report_of_more_beside_its_own() {
    let folder = folder("");
    folder.run(&[]).exits(0);
    let whole = folder.report();
    folder.run(&["--engines", OWN]).exits(0).complains("stays as out/report-");
    assert!(readings(&folder.report(), "mine").is_empty());
    let names =
        fs::read_dir(folder.path("out")).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap());
    let kept: Vec<String> = names.filter(|name| name.starts_with("report-")).collect();
    assert_eq!(kept.len(), 1, "{kept:?}");
    assert_eq!(folder.json(&format!("out/{}", kept[0])), whole);
    // The whole once more takes nothing away.
    folder.run(&[]).exits(0);
    assert_eq!(readings(&folder.report(), "mine").len(), 2);
}

#[test]
fn namesakes_from_two_folders_have_two_folders() {
    let folder = folder("");
    fs::create_dir(folder.path("other")).unwrap();
    for name in ["spec.yaml", "lamp.ies", "adapter.py"] {
        fs::copy(folder.path(name), folder.path("other").join(name)).unwrap();
    }
    for spec in ["spec.yaml", "other/spec.yaml", "spec.yaml", "other/spec.yaml"] {
        folder.luxproof(&["run", spec, "--no-calibration", "--engines", OWN]).exits(0);
    }
    let of = |name: &str| folder.json(&format!("luxproof-out/{name}/report.json"))["spec"]["path"].clone();
    assert_eq!([of("spec"), of("spec-other")], ["spec.yaml", "other/spec.yaml"]);
    assert_eq!(
        fs::read_dir(folder.path("luxproof-out/spec"))
            .unwrap()
            .flatten()
            .filter(|e| e.file_name().to_string_lossy().starts_with("report-"))
            .count(),
        0
    );
}

#[test]
fn where_nobody_reads_it_ends_quietly_and_where_nothing_fits_it_says_so() {
    let folder = folder("");
    folder.run(&["--engines", OWN]).exits(0);
    let commands: [&[&str]; 9] = [
        &["schema"],
        &["--help"],
        &["engines", "list"],
        &["engines", "verify"],
        &["photometry", "lamp.ies", "--json"],
        &["check", "spec.yaml"],
        &["report", "out/report.json"],
        &["cache"],
        &["run", "spec.yaml", "--out", "out", "--no-calibration", "--engines", OWN],
    ];
    for args in commands {
        let full = File::options().write(true).open("/dev/full").unwrap();
        let answer = Answer::from(
            folder.command(args).stdout(full).stderr(Stdio::piped()).spawn().unwrap().wait_with_output().unwrap(),
        );
        assert!(answer.code == Some(2) || args == ["--help"], "{args:?}: {answer:?}");
        assert!(!answer.stderr.contains("panicked"), "{args:?}: {answer:?}");
        let (reader, writer) = std::io::pipe().unwrap();
        drop(reader);
        Answer::of(folder.command(args).stdout(writer)).exits(0);
    }
}
