//! What a user sees on a terminal: the progress display, and the questions of `init`.

use std::process::Command;

use crate::support::{Answer, Folder, LAMP, MINE, ROOM, TWO_METERS, adapter_with_lines_before_readings, root};

/// What a program wrote on a terminal of so many columns, with its standard input there as well.
pub(crate) fn on_terminal(folder: &Folder, columns: usize, answers: &str, args: &[&str]) -> Answer {
    let inner = folder.command(args);
    let mut program = Command::new("python3");
    program.arg("-S").arg(root().join("tests/program/terminal.py")).args([&columns.to_string(), answers]);
    program.arg(inner.get_program()).args(inner.get_args());
    program.current_dir(folder.path(""));
    for (name, value) in inner.get_envs() {
        match value {
            Some(value) => program.env(name, value),
            None => program.env_remove(name),
        };
    }
    program.env("TERM", "xterm");
    Answer::of(&mut program)
}

/// The lines that a terminal of so many columns shows over time, in order.
fn shown_lines(raw: &str, columns: usize) -> Vec<String> {
    let mut text = String::new();
    let mut letters = raw.chars();
    while let Some(letter) = letters.next() {
        match letter {
            // A sequence ends with its first letter; each may begin a new line.
            '\u{1b}' => {
                letters.by_ref().find(char::is_ascii_alphabetic);
                text.push('\n');
            }
            '\r' => text.push('\n'),
            other => text.push(other),
        }
    }
    // A line that is as wide as the terminal continues on the next.
    let letters: Vec<Vec<char>> = text.lines().map(|line| line.chars().collect()).collect();
    let rows = letters.iter().flat_map(|line| line.chunks(columns));
    let rows = rows.map(|row| row.iter().collect::<String>().trim_end().to_owned());
    rows.filter(|row| !row.is_empty()).collect()
}

/// Two cases with names longer than narrow terminals, with an adapter that takes its time.
fn slow_folder() -> Folder {
    let cases = "procedures:
  direct_illuminance: {meters: plane}
cases:
  - {name: a-first-case-with-a-name-of-many-words-that-would-wrap-on-every-usual-terminal}
  - {name: a-second-case, luminaires: {lamp: {flux_scale: 0.5}}}
";
    let spec = [ROOM, TWO_METERS, cases, MINE].concat();
    let adapter = adapter_with_lines_before_readings("import time\ntime.sleep(1.5)\n");
    Folder::new(&[("spec.yaml", &spec), ("lamp.ies", LAMP), ("adapter.py", &adapter)])
}

#[test]
fn progress_shows_a_bar_and_what_runs_and_never_wraps() {
    for columns in [60, 80] {
        let folder = slow_folder();
        let args = ["run", "spec.yaml", "--out", "out", "--no-calibration", "--jobs", "2"];
        let answer = on_terminal(&folder, columns, "", &args).exits(0);
        let lines = shown_lines(&answer.stdout, columns);
        // The rest of a wrapped line of the display would begin otherwise; remarks wrap between words.
        let begins =
            |line: &&String| ["[00:", "  [00:", "  and ", "spec", "    "].iter().any(|start| line.starts_with(start));
        let others: Vec<&String> = lines.iter().filter(|line| !begins(line)).collect();
        assert!(others.is_empty(), "{columns}: {others:#?}");
        let bar = |line: &&String| line.starts_with("[00:0") && line.contains('>');
        assert!(lines.iter().find(bar).is_some_and(|line| line.contains("left")), "{lines:#?}");
        let runs = |line: &String| line.starts_with("  [00:0") && line.contains("spec/a-second-case: mine direct");
        assert!(lines.iter().any(runs), "{lines:#?}");
        assert!(lines.iter().any(|line| line.ends_with("...")), "{lines:#?}");
        // No line per finished case: that is for files.
        assert!(!lines.iter().any(|line| line.starts_with("[1/")), "{lines:#?}");
    }
}

#[test]
fn init_asks_again_for_each_wrong_answer_and_keeps_the_others() {
    let folder = Folder::new(&[("mine.ies", LAMP), ("bad.ies", "IESNA:LM-63-2002\nTILT=NONE\nx\n")]);
    let answers =
        "my office\n5,4\n5,4,0\n5,4,2.8\n20,50,70\n0.2,0.5,0.8\nnone.ies\nbad.ies\nmine.ies\nflush\n2.8\n0.5\n";
    let answer = on_terminal(&folder, 80, answers, &["init", "room/office.yaml"]).exits(0);
    for complaint in [
        "`5,4` is not three numbers, such as 6,4,3",
        "`5,4,0` is no room: each length is greater than 0",
        "reflectances lie between 0 and 1; write 20 % as 0.2",
        "none.ies: the file cannot be read",
        "bad.ies:3",
        "`flush` is neither `recessed` nor metres below the ceiling, such as 0.5",
        "the room is only 2.8 m high",
        "next: luxproof run room/office.yaml",
    ] {
        assert!(answer.stdout.contains(complaint), "no `{complaint}` in {}", answer.stdout);
    }
    let text = folder.read("room/office.yaml");
    for line in
        ["title: \"my office\"", "size_m: [5, 4, 2.8]", "floor: 0.2, walls: 0.5, ceiling: 0.8", "2.3]", "mine.ies"]
    {
        assert!(text.contains(line), "no `{line}` in {text}");
    }
    assert_eq!(folder.read("room/mine.ies"), LAMP);
    // What cannot succeed fails before the first question.
    let answer = on_terminal(&folder, 80, "", &["init", "room/office.yaml"]).exits(2);
    assert!(answer.stdout.contains("is there already") && !answer.stdout.contains('?'), "{}", answer.stdout);
}
