//! Specs of a stranger: what they may not name, start or ask for, and what they say that no engine, view or log must obey.

use std::fs;
use std::os::unix::fs::symlink;
use std::process::Command;

use crate::support::{Answer, Folder, LAMP, MINE, ROOM, TWO_METERS, root, sealed};

const DIRECT: &str = "procedures:\n  direct_illuminance: {meters: plane}\n";

fn spec() -> String {
    [ROOM, TWO_METERS, DIRECT].concat()
}

fn room(spec: &str) -> Folder {
    Folder::new(&[("spec.yaml", spec), ("lamp.ies", LAMP)])
}

/// What is said of a spec with one replacement, as a line; it must be refused, and as a user's own not for this reason.
#[track_caller]
fn refused(from: &str, to: &str, says: &str) -> String {
    assert!(spec().contains(from), "the replacement must change the spec");
    refusal_of(&room(&spec().replace(from, to)), says)
}

#[track_caller]
fn refusal_of(room: &Folder, says: &str) -> String {
    let answer = room.luxproof(&["check", "--untrusted", "spec.yaml", "--engines", "simulator"]).exits(2);
    let line = answer.message();
    assert!(line.contains(says), "no `{says}` in {line}");
    line
}

#[test]
fn files_lie_below_the_folder_wherever_links_lead_and_other_contents_stay_secret() {
    let secret = "TILT of a secret";
    let outside = Folder::new(&[("secret", secret), ("lamp.ies", LAMP)]);
    let place = outside.path("secret");
    for (from, to) in [
        ("photometry: lamp.ies", format!("photometry: {}", place.display())),
        ("photometry: lamp.ies", "photometry: link.ies".to_owned()),
        ("photometry: lamp.ies", "photometry: tilted.ies".to_owned()),
        ("procedures:", format!("published: {}\nprocedures:", place.display())),
        ("meters:\n", format!("obstacles:\n  - mesh: {{file: {}, reflectance: 0.5}}\nmeters:\n", place.display())),
    ] {
        let room = room(&spec().replace(from, &to));
        symlink(&place, room.path("link.ies")).unwrap();
        // An LM-63 file names a file of tilt factors beside it, which is a link.
        room.write("tilted.ies", &LAMP.replace("TILT=NONE", "TILT=link.ies"));
        let reported = refusal_of(&room, "below the spec's folder");
        assert!(!reported.contains(secret), "{reported}");
    }
    // The spec itself, and a policy beside it.
    let room = room(&spec());
    symlink(&place, room.path("link.ies")).unwrap();
    room.write("tilted.ies", &LAMP.replace("TILT=NONE", "TILT=link.ies"));
    let reported = room.luxproof(&["photometry", "tilted.ies", "--untrusted"]).exits(2).complains("cannot be followed");
    assert!(!reported.stderr.contains(secret), "{reported:?}");
    fs::rename(room.path("spec.yaml"), room.path("away")).unwrap();
    symlink(&place, room.path("spec.yaml")).unwrap();
    assert!(!refusal_of(&room, "it is a link").contains(secret));
    fs::remove_file(room.path("spec.yaml")).unwrap();
    fs::rename(room.path("away"), room.path("spec.yaml")).unwrap();
    symlink(&place, room.path("luxproof.yaml")).unwrap();
    assert!(!refusal_of(&room, "it is a link").contains(secret));
}

#[test]
fn no_program_is_started_and_the_users_own_are_listed() {
    let room = Folder::new(&[("spec.yaml", &[&spec(), MINE].concat()), ("lamp.ies", LAMP)]);
    refusal_of(&room, "engines.mine.command: it would run a program");
    let as_set = |value: &str| Answer::of(room.command(&["check", "spec.yaml"]).env("LUXPROOF_UNTRUSTED", value));
    as_set("1").exits(2).complains("not trusted");
    assert_ne!(as_set("0").code, Some(2));
    // In a case of a suite likewise.
    let cases = "cases:\n  - {name: a, engines: {mine: {command: [touch, pwned]}}}\n";
    refusal_of(&self::room(&(spec() + cases)), "it would run a program");
    let answer = room.run(&["--engines", "mine"]);
    assert!(answer.stderr.contains("engines.mine runs `python3"), "{}", answer.stderr);
    // The doctor would have engines of a spec read scenes of known answer.
    room.luxproof(&["engines", "doctor", "--spec", "spec.yaml", "--untrusted"]).exits(2).complains("not trusted");
    for command in ["hunt", "selftest"] {
        Answer::of(room.command(&[command]).env("LUXPROOF_UNTRUSTED", "1"))
            .exits(2)
            .complains("does not run untrusted specs");
    }
}

#[test]
fn what_it_asks_for_is_bounded() {
    let meters = spec().lines().find(|line| line.contains("points_m")).unwrap().to_owned();
    let grid = "  plane: {grid: {origin_m: [1, 1, 1], u_m: [0.01, 0, 0], v_m: [0, 0.01, 0], counts: [101, 100]}, normal: [0, 0, 1]}";
    refused(&meters, grid, "10100 meters are more than the 10000");
    let lamp = spec().lines().find(|line| line.contains("id: lamp")).unwrap().to_owned();
    let many = (0..501).map(|k| lamp.replace("id: lamp", &format!("id: lamp{k}"))).collect::<Vec<_>>().join("\n");
    refused(&lamp, &many, "501 luminaires are more than the 500");
    // Each within its limit, and together beyond what is planned in a second.
    let grid = grid.replace("[101, 100]", "[10, 10]");
    let crowd = many.lines().skip(1).collect::<Vec<_>>().join("\n");
    refusal_of(&room(&spec().replace(&meters, &grid).replace(&lamp, &crowd)), "25000000 pairs of luminaires");
    let long = LAMP.replacen("[TEST]", &("[OTHER] much said\n".repeat(60_000) + "[TEST]"), 1);
    let two = room(&spec().replace(&lamp, &format!("{lamp}\n{}", lamp.replace("lamp", "lamq"))));
    two.write("lamp.ies", &long);
    two.write("lamq.ies", &long);
    refusal_of(&two, "bytes of files are more than");
    let listed = (0..200).map(|k| (f64::from(k) * 0.9).to_string()).collect::<Vec<_>>().join(", ");
    let angles = format!(
        "procedures:\n  luminous_intensity: {{luminaire: lamp, distance_m: 5, angles: {{gamma_deg: [{listed}], c_deg: [{listed}]}}}}\n"
    );
    refused(DIRECT, &angles, "40000 angles are more than the 9998");
    let cases: Vec<String> = (0..101).map(|k| format!("  - {{name: c{k}}}\n")).collect();
    refusal_of(&room(&(spec() + "cases:\n" + &cases.concat())), "a spec holds 100 cases at most");
    refused("title: a test room", &format!("title: {}", "a".repeat(1 << 20)), "more than 1 MB");
    refused("meters: plane", "meters: [plane, plane]", "stands there twice");
}

#[test]
fn depth_and_length_are_refused_in_a_few_lines() {
    for text in [
        "title: ".to_owned() + &"[".repeat(100_000),
        "title: ".to_owned() + &"[".repeat(100_000) + &"]".repeat(100_000),
        "title: ".to_owned() + &"{a: ".repeat(10_000),
        "k".repeat(900_000) + ": 1",
        "title: \"".to_owned() + &"\\".repeat(900_001) + "\"",
    ] {
        let answer = room(&format!("luxproof: 1\n{text}\n")).luxproof(&["check", "spec.yaml"]).exits(2);
        assert!(answer.stderr.len() < 10_000, "{} bytes", answer.stderr.len());
    }
}

#[test]
fn aliases_attributes_and_cases_multiply_nothing() {
    let long = format!("[{}]", "0,".repeat(150_000));
    let bomb = |place: &str| place.replace("LONG", &long).replace("MANY", &"*a,".repeat(100));
    for (more, says) in [
        ("engines: {simulator: {a: &a LONG, b: [MANY]}}\n", "aliases add more than"),
        ("cases:\n  - &a {name: a, x: LONG}\n  - [MANY]\n", "aliases add more than"),
    ] {
        let room = room(&(spec() + &bomb(more)));
        // Whosever it is, and without the gigabyte that it would fill: a refusal looks for no better words in it.
        for trust in [&["--untrusted"][..], &[]] {
            let check = room.command(&[&["check", "spec.yaml", "--engines", "simulator"], trust].concat());
            let mut small = Command::new("sh");
            small
                .args(["-c", "ulimit -v 600000 && exec \"$0\" \"$@\""])
                .arg(check.get_program())
                .args(check.get_args());
            let answer = Answer::of(small.current_dir(room.path("")).env("NO_COLOR", "1")).exits(2);
            assert!(answer.message().contains(says), "{answer:?}");
        }
    }
    // A spec of many values has few cases.
    let cases = (0..50).map(|k| format!("  - {{name: c{k}}}\n")).collect::<Vec<_>>().concat();
    let points = "[1, 1, 0.8]";
    let many = spec().replace(points, &(format!("{points}, ").repeat(9_000) + points)) + "cases:\n" + &cases;
    refusal_of(&room(&many), "cases at most");
    let boxes = "  - {box: {min_m: [0, 0, 0], max_m: [1, 1, 0.1], reflectance: 0}}\n".repeat(4_500);
    refusal_of(
        &room(&spec().replace("meters:\n", &format!("obstacles:\n{boxes}meters:\n"))),
        "triangles are more than",
    );
    let engines = (0..6_000).map(|k| format!("  e{k}: {{}}\n")).collect::<Vec<_>>().concat();
    let reported = refusal_of(&room(&(spec() + "engines:\n" + &engines)), "50 faults, and no more are listed");
    assert!(reported.contains("no engine `e0`") && reported.len() < 20_000, "{reported}");
    let attributes = (0..100_000).map(|k| format!(" a{k}=''")).collect::<Vec<_>>().concat();
    let room = room(&spec().replace("lamp.ies", "lamp.xml"));
    room.write("lamp.xml", &format!("<IESTM33-22{attributes}/>"));
    refusal_of(&room, "more than 64 attributes");
}

#[test]
fn what_does_something_to_a_terminal_is_refused_or_shown_as_what_it_is_not() {
    let esc = "\\e]0;x\\a";
    let is_quiet = |answer: &Answer| {
        let both = answer.stdout.clone() + &answer.stderr;
        assert!(!both.contains(['\u{1b}', '\u{7}', '\u{9b}', '\u{202e}']), "{both:?}");
    };
    for (from, to) in [
        ("title: a test room".to_owned(), format!("title: \"{esc}\"")),
        ("title:".to_owned(), format!("\"{esc}\": 1\ntitle:")),
        ("photometry: lamp.ies".to_owned(), format!("photometry: \"{esc}\"")),
        ("meters: plane".to_owned(), format!("meters: \"{esc}\"")),
        ("procedures:".to_owned(), format!("engines: {{\"{esc}\": {{}}}}\nprocedures:")),
        ("procedures:".to_owned(), format!("tolerances: {{\"{esc}\": {{relative: 1}}}}\nprocedures:")),
    ] {
        let room = room(&spec().replace(&from, &to));
        let answer = room.luxproof(&["check", "spec.yaml", "--engines", "simulator"]).exits(2).complains("U+001B");
        is_quiet(&answer);
    }
    // What is no YAML: photometric files, and the line that a message shows.
    let room = room(&(spec() + "# \u{202e}\nunknown: 1\n"));
    is_quiet(&room.luxproof(&["check", "spec.yaml"]).exits(2));
    for (from, to) in [
        ("TILT=NONE", "TILT=\u{1b}]0;x\u{7}"),
        ("1 -1 1 3", "1 \u{1b}]0;x 1 3"),
        ("[TEST] made", "[LUMCAT] \u{1b}[31m\u{9b}"),
    ] {
        room.write("lamp.ies", &LAMP.replace(from, to));
        let answer = room.luxproof(&["photometry", "lamp.ies"]);
        is_quiet(&answer);
        assert!(answer.code == Some(2) || answer.stdout.contains('\u{fffd}'), "{answer:?}");
    }
    // A report from elsewhere.
    room.write("lamp.ies", LAMP);
    room.write("spec.yaml", &spec());
    room.run(&["--engines", "simulator"]);
    let mut report = room.report();
    report["spec"]["title"] = "\u{1b}]0;x\u{7}\u{202e}".into();
    room.write("other.json", &sealed(report));
    for format in ["terminal", "markdown", "junit", "csv", "html", "json"] {
        is_quiet(&room.luxproof(&["report", "other.json", "--format", format]));
    }
}

/// Every text of spec, policy, published table, mesh and photometric files is hostile; all engines, all views, under strace.
#[test]
fn no_engine_view_or_log_obeys_what_a_text_says() {
    let mut hostile = Command::new("python3");
    hostile.arg(root().join("ci/hostile")).args(["--specs", "0", "--flips", "0", "--scenes", "1"]);
    let answer = Answer::of(hostile.env("LUXPROOF", env!("CARGO_BIN_EXE_luxproof"))).exits(0);
    answer.prints("1 scenes of mitsuba, radiance, povray, cycles");
}

#[test]
fn random_hostile_specs_and_damaged_files_are_refused_or_without_effect() {
    let script = root().join("ci/hostile");
    let mut hostile = Command::new("python3");
    hostile.arg(script).args(["--specs", "200", "--traced", "0", "--scenes", "0", "--flips", "10", "--seconds", "20"]);
    Answer::of(hostile.env("LUXPROOF", env!("CARGO_BIN_EXE_luxproof"))).exits(0).prints("200 specs");
}
