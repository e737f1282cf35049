//! Programs run as a library runs them, without a supervisor; tests/program/supervision.rs runs them under one.

use std::fs;
use std::path::Path;
use std::thread;
use std::time::{Duration, Instant};

use super::*;

fn shell(script: &str, limit_s: f64, folder: &Path) -> Result<Finished, ProcessError> {
    Invocation::new("sh", folder, Duration::from_secs_f64(limit_s), folder.join("log")).args(["-c", script]).run()
}

#[test]
fn output_and_messages_are_kept_apart_and_stderr_is_logged() {
    let folder = tempfile::tempdir().unwrap();
    let done = shell("echo out; echo err >&2", 10.0, folder.path()).unwrap();
    assert_eq!(done.stdout, b"out\n");
    assert_eq!(done.stderr, "err\n");
    assert!(fs::read_to_string(folder.path().join("log")).unwrap().ends_with("err\n\n"));
}

#[test]
fn programs_side_by_side_share_a_log_and_no_line_of_it() {
    let folder = tempfile::tempdir().unwrap();
    let said = "what it said ".repeat(9);
    thread::scope(|scope| {
        for _ in 0..8 {
            scope.spawn(|| {
                let program = Invocation::new("sh", folder.path(), Duration::from_secs(10), folder.path().join("log"));
                (0..200).for_each(|_| program.keep_log(&said).unwrap());
            });
        }
    });
    let log = fs::read_to_string(folder.path().join("log")).unwrap();
    let entries: Vec<&str> = log.split_inclusive(&*format!("{said}\n")).collect();
    assert!(entries.len() == 1600 && entries.iter().all(|entry| *entry == entries[0]), "{}", entries.len());
}

#[test]
fn a_failing_program_is_an_error_with_its_last_words() {
    let folder = tempfile::tempdir().unwrap();
    let error = shell("echo no such lamp >&2; exit 3", 10.0, folder.path()).unwrap_err();
    let text = error.to_string();
    assert!(matches!(error, ProcessError::Failed { end: FailedEnd::ExitCode(3), .. }) && error.has_stated_reason());
    assert!(text.contains("exit code 3") && text.contains("no such lamp"), "{text}");
}

#[test]
fn a_program_states_no_reason_where_a_signal_kills_it_or_it_says_nothing() {
    let folder = tempfile::tempdir().unwrap();
    for script in ["echo about to crash >&2; kill -SEGV $$", "echo a shell tells of a signal >&2; exit 139", "exit 1"] {
        let error = shell(script, 10.0, folder.path()).unwrap_err();
        assert!(!error.has_stated_reason(), "{script}: {error}");
    }
}

#[test]
fn a_timeout_kills_the_grandchildren_too() {
    let folder = tempfile::tempdir().unwrap();
    // The grandchild would write the file after 1 s if it lived.
    let script = "(sleep 1; touch survivor) & sleep 30";
    let error = shell(script, 0.2, folder.path()).unwrap_err();
    assert!(matches!(error, ProcessError::TimedOut { .. }), "{error}");
    thread::sleep(Duration::from_millis(1300));
    assert!(!folder.path().join("survivor").exists());
}

#[test]
fn what_a_program_leaves_behind_does_not_hold_its_answer() {
    let folder = tempfile::tempdir().unwrap();
    let start = Instant::now();
    // A session of its own is out of the group's reach.
    let done = shell("setsid sleep 60 & echo answer", 30.0, folder.path()).unwrap();
    assert_eq!(done.stdout, b"answer\n");
    assert!(start.elapsed() < Duration::from_secs(30), "{:?}", start.elapsed());
}

fn conversation(script: &str, limit_s: f64, folder: &Path) -> Conversation {
    let limit = Duration::from_secs_f64(limit_s);
    Invocation::new("sh", folder, limit, folder.join("log")).args(["-c", script]).converse(None).unwrap()
}

#[test]
fn a_conversation_answers_line_by_line_and_its_messages_are_logged() {
    let folder = tempfile::tempdir().unwrap();
    let mut echo = conversation("echo ready; while read x; do echo \"<$x>\"; done; echo bye >&2", 10.0, folder.path());
    assert_eq!(echo.listen().unwrap(), "ready");
    assert_eq!([echo.ask("one").unwrap(), echo.ask("two").unwrap()], ["<one>", "<two>"]);
    echo.end().unwrap();
    assert!(echo.peak_mib().is_some());
    assert!(fs::read_to_string(folder.path().join("log")).unwrap().ends_with("bye\n\n"));
}

#[test]
fn a_conversation_with_no_answer_says_why() {
    let folder = tempfile::tempdir().unwrap();
    let error = |script, limit_s| conversation(script, limit_s, folder.path()).ask("?").unwrap_err();
    let failed = error("read x; echo no such lamp >&2; exit 3", 10.0).to_string();
    assert!(failed.contains("exit code 3") && failed.contains("no such lamp"), "{failed}");
    assert!(matches!(error("read x", 10.0), ProcessError::Silent { .. }));
    assert!(matches!(error("(sleep 1; touch survivor) & sleep 30", 0.2), ProcessError::TimedOut { .. }));
    thread::sleep(Duration::from_millis(1300));
    assert!(!folder.path().join("survivor").exists());
}

/// A script with its log in a folder.
fn logged(script: &str, folder: &Path, log: &str) -> Invocation {
    Invocation::new("sh", folder, Duration::from_secs(20), folder.join(log)).args(["-c", script])
}

/// The answer to a line that ends a conversation.
fn asked(mut talk: Conversation, line: &str) -> String {
    let answer = talk.ask(line).unwrap();
    assert!(talk.peak_mib().is_some());
    talk.end().unwrap();
    answer
}

#[test]
fn a_program_that_waits_goes_on_with_the_next_of_its_words_and_their_log() {
    let folder = tempfile::tempdir().unwrap();
    let idle = ProcessPool::default();
    let of = |script: &str, log: &str| logged(script, folder.path(), log).converse(Some(&idle)).unwrap();
    // What it says with its answer may be heard after it.
    let script = "while read x; do echo \"about $x\" >&2; sleep 0.3; echo \"$$ <$x>\"; done";
    let one = asked(of(script, "one"), "1");
    let process = one.split(' ').next().unwrap();
    assert_eq!(asked(of(script, "two"), "2"), format!("{process} <2>"));
    let log = |name| fs::read_to_string(folder.path().join(name)).unwrap();
    assert!(
        log("one").ends_with("about 1\n\n") && log("two").ends_with("about 2\n\n"),
        "{} {}",
        log("one"),
        log("two")
    );
    // Two at once are two, as are other words; what has ended meanwhile does not go on.
    let (first, second) = (of(script, "first"), of(script, "second"));
    assert!(asked(first, "1").starts_with(process) && !asked(second, "2").starts_with(process));
    assert!(!asked(of(&format!("{script};"), "other"), "3").starts_with(process));
    // Its memory is seen while it sleeps.
    let once = "read x; sleep 0.3; echo \"$$ <$x>\"";
    let ended = asked(of(once, "once"), "1");
    thread::sleep(Duration::from_secs(1));
    assert_ne!(asked(of(once, "once"), "1"), ended);
    let is_there = || Path::new("/proc").join(process).exists();
    assert!(is_there());
    drop(idle);
    assert!(!is_there());
}

#[test]
fn memory_and_processor_time_of_a_program_are_seen() {
    let folder = tempfile::tempdir().unwrap();
    let before = cpu_time();
    let [small, large] = ["sleep 0.1", "x=$(head -c 50000000 /dev/zero | tr '\\0' a); sleep 0.1"].map(|script| {
        let invocation = logged(script, folder.path(), "log");
        invocation.run().unwrap();
        invocation.peak.mib().unwrap()
    });
    assert!(small > 0.1 && large > small + 40.0, "{small} {large}");
    assert!(cpu_time() > before + Duration::from_millis(5));
}

#[test]
fn a_program_that_is_not_there_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let run = Invocation::new("no-such-renderer", folder.path(), Duration::from_secs(1), folder.path().join("log"));
    assert!(run.run().unwrap_err().to_string().contains("no-such-renderer"));
}

#[test]
fn command_lines_can_be_pasted_into_a_shell() {
    let run = Invocation::new("rtrace", Path::new("."), Duration::ZERO, "log").args(["-ab", "99", "it's.oct"]);
    assert_eq!(run.command_line(), r"rtrace -ab 99 'it'\''s.oct'");
    let run = run.env("RAYPATH", ".:/my lib");
    assert_eq!(run.command_line_with_env(), r"RAYPATH='.:/my lib' rtrace -ab 99 'it'\''s.oct'");
}

#[test]
fn an_engine_gets_the_environment_that_every_program_needs() {
    let folder = tempfile::tempdir().unwrap();
    let env =
        || Invocation::new("env", folder.path(), Duration::from_secs(20), folder.path().join("log")).env("OWN", "x");
    // Cargo sets this one for its tests.
    let (reported, all) = ("PATH".to_owned(), "CARGO_MANIFEST_DIR".to_owned());
    let confined = variables(&env());
    assert!(
        confined.contains(&reported) && confined.contains(&"OWN".to_owned()) && !confined.contains(&all),
        "{confined:?}"
    );
    assert!(variables(&env().of_user()).contains(&all));
}

/// The names that `env` prints.
fn variables(env: &Invocation) -> Vec<String> {
    let text = String::from_utf8(env.run().unwrap().stdout).unwrap();
    text.lines().filter_map(|line| Some(line.split_once('=')?.0.to_owned())).collect()
}

#[test]
fn an_answer_that_is_too_long_ends_its_program() {
    let folder = tempfile::tempdir().unwrap();
    let endless = Invocation::new("cat", folder.path(), Duration::from_secs(60), folder.path().join("log"));
    let error = endless.args(["/dev/zero"]).longest_answer(1 << 20).run().unwrap_err();
    assert!(matches!(error, ProcessError::TooMuch { bytes: 1_048_576, .. }), "{error}");
}
