//! Mistakes of users and their messages: every fault of all files at once, each at its place; suspicious input is a warning.

use std::fmt::Write;

use itertools::Itertools;

use crate::support::{Answer, Folder, LAMP, ROOM, TWO_METERS};

const PROCEDURES: &str = "procedures:
  luminous_intensity: {luminaire: lamp, distance_m: 5, angles: photometry}
  direct_illuminance: {meters: plane}
  indirect_illuminance: {meters: plane}
";

fn spec() -> String {
    [ROOM, TWO_METERS, PROCEDURES].concat()
}

const POLICY: &str = "required_engines: [radiance]
tolerances: [{procedure: direct_illuminance, engine: povray, relative: 0.005, source: decided}]
profiles: {ci: {budget: {relative_error: 0.005}}}
";

/// A mistake: what is done, in which place of the spec, and what is called for.
enum Mistake {
    /// A part of the spec is another.
    In(&'static str, &'static str),
    /// Something is added to the spec.
    Added(&'static str),
    /// A file is this.
    File(&'static str, &'static str),
    /// The command line is this.
    Command(&'static [&'static str]),
}
use Mistake::{Added, Command, File, In};

const MISTAKES: &[(&str, Mistake)] = &[
    ("a misspelt key", In("size_m", "sise_m")),
    ("luminance in mid-air", Added("  luminance: {meters: plane}\n")),
    ("a key that is missing", In("  size_m: [6, 4, 3]\n", "")),
    ("reflectance beside the room", In("  reflectance:", "reflectance:")),
    (
        "walls beside reflectances",
        In("{floor: 0.2, walls: 0.5, ceiling: 0.7}", "{floor: 0.2, ceiling: 0.7}\n  walls: 0.5"),
    ),
    ("luminaires inside the room", In("luminaires:\n  - {id", "  luminaires:\n  - {id")),
    ("a word for a number", In("[6, 4, 3]", "[6, four, 3]")),
    ("per cents", In("walls: 0.5", "walls: 50")),
    ("a number too few", In("[6, 4, 3]", "[6, 4]")),
    ("a decimal comma", In("[3, 2, 2.5]", "[3, 2, 2,5]")),
    ("a byte order mark, and a misspelt key", In("luxproof: 1\ntitle", "\u{feff}luxproof: 1\ntitel")),
    ("a tab", In("  size_m", "\tsize_m")),
    ("a key twice", In("  plane:", "  plane: {points_m: [[1, 1, 1]], normal: [0, 0, 1]}\n  plane:")),
    ("a bracket that stays open", In("[6, 4, 3]", "[6, 4, 3")),
    ("a quote that stays open", In("a test room", "'a test room")),
    ("a list without hyphens", In("  - {id: lamp, photometry: lamp.ies, at_m: [3, 2, 2.5]}", "  id: lamp")),
    ("a version of the future", In("luxproof: 1", "luxproof: 2")),
    ("a photometric file that is not there", In("lamp.ies", "lmap.ies")),
    ("a folder for a photometric file", In("lamp.ies", ".")),
    (
        "photometry that is none",
        File("lamp.ies", "IESNA:LM-63-2002\nTILT=NONE\n1 -1 1 3 1 1 2 0 0 0\n1 1 0\n0 sixty 90\n"),
    ),
    ("a luminaire above the ceiling", In("[3, 2, 2.5]", "[3, 2, 25]")),
    (
        "two luminaires of one name",
        In("luminaires:\n", "luminaires:\n  - {id: lamp, photometry: lamp.ies, at_m: [1, 1, 2]}\n"),
    ),
    ("a negative flux", In("at_m: [3, 2, 2.5]", "at_m: [3, 2, 2.5], flux_scale: -1")),
    ("a model that is none", In("at_m: [3, 2, 2.5]", "at_m: [3, 2, 2.5], model: aera")),
    ("meters outside", In("[[1, 1, 0.8], [3, 2, 0.8]]", "[[1, 1, 0.8], [3, 20, 0.8], [30, 2, 0.8]]")),
    (
        "a grid that leaves the room",
        In(
            "points_m: [[1, 1, 0.8], [3, 2, 0.8]]",
            "grid: {origin_m: [0.5, 0.5, 0.8], u_m: [1, 0, 0], v_m: [0, 1, 0], counts: [7, 4]}",
        ),
    ),
    ("a normal without direction", In("normal: [0, 0, 1]", "normal: [0, 0, 0]")),
    (
        "a grid of points in one place",
        In(
            "points_m: [[1, 1, 0.8], [3, 2, 0.8]]",
            "grid: {origin_m: [0.5, 0.5, 0.8], u_m: [0, 0, 0], v_m: [0, 1, 0], counts: [4, 3]}",
        ),
    ),
    (
        "a grid that is a line",
        In(
            "points_m: [[1, 1, 0.8], [3, 2, 0.8]]",
            "grid: {origin_m: [0.5, 0.5, 0.8], u_m: [0.5, 0, 0], v_m: [1, 0, 0], counts: [2, 3]}",
        ),
    ),
    ("neither points nor grid", In("points_m: [[1, 1, 0.8], [3, 2, 0.8]], ", "")),
    ("a misspelt procedure", In("direct_illuminance:", "direct_iluminance:")),
    ("a meter set that is not there", In("direct_illuminance: {meters: plane}", "direct_illuminance: {meters: plain}")),
    ("a luminaire that is not there", In("luminaire: lamp", "luminaire: lmap")),
    ("a typo in a case", Added("cases:\n  - {name: bright}\n  - {name: dark, room: {reflectance: {wals: 0.1}}}\n")),
    ("a case without a name", Added("cases:\n  - {room: {reflectance: {walls: 0.1}}}\n")),
    ("an override of what is not there", Added("cases:\n  - {name: bright, luminaires: {lmap: {flux_scale: 2}}}\n")),
    (
        "a comparison of no such case, and of none",
        Added("cases: [{name: before}, {name: after}]\ncompare:\n  - [before, aftr]\n  - [before]\n"),
    ),
    ("a comparison without cases", Added("compare: [before, after]\n")),
    ("an unknown engine", Added("engines: {radianse: {}}\n")),
    ("settings of engines", Added("engines:\n  povray: {cuont: 3, preset: best}\n  radiance: {preset: quick}\n")),
    ("a tolerance for no procedure", Added("tolerances: {direct: {relative: 0.01}}\n")),
    (
        "a negative tolerance and no budget",
        Added("tolerances: {direct_illuminance: {relative: -1}}\nbudget: {seconds: 0}\n"),
    ),
    ("a box inside out", Added("obstacles:\n  - box: {min_m: [2, 1, 0], max_m: [1, 2, 1], reflectance: 0.5}\n")),
    ("a mesh that is not there", Added("obstacles:\n  - mesh: {file: desk.obj, reflectance: 0.5}\n")),
    ("a table that is none", Added("published: lamp.ies\n")),
    ("a misspelt key of the policy", File("luxproof.yaml", "required_engine: [radiance]\n")),
    (
        "unknown engines of the policy",
        File(
            "luxproof.yaml",
            "required_engines: [radianse]\ntolerances: [{procedure: direct_illuminance, engine: mitsubba, relative: 0.1, source: ' '}]\n",
        ),
    ),
    ("an unknown engine on the command line", Command(&["check", "spec.yaml", "--engines", "radianse,pov"])),
    ("an unknown procedure on the command line", Command(&["check", "spec.yaml", "--procedures", "direct"])),
    ("a filter that leaves nothing", Command(&["check", "spec.yaml", "--filter", "bright"])),
    ("a profile that is not there", Command(&["check", "spec.yaml", "--profile", "c"])),
    ("a spec that is not there", Command(&["run", "spce.yaml"])),
    ("a folder without specs", Command(&["check", "empty"])),
    ("a run in a file", Command(&["run", "spec.yaml", "--out", "lamp.ies"])),
    ("no thread at all", Command(&["run", "spec.yaml", "--jobs", "0"])),
    ("a folder for a report", Command(&["report", "empty"])),
    ("a spec for a report", Command(&["report", "spec.yaml"])),
    ("an unknown engine to export for", Command(&["export", "spec.yaml", "--engine", "povrya", "--out", "scenes"])),
];

fn folder() -> Folder {
    let folder = Folder::new(&[("spec.yaml", &spec()), ("lamp.ies", LAMP), ("luxproof.yaml", POLICY)]);
    std::fs::create_dir(folder.path("empty")).unwrap();
    folder
}

/// What is said of a mistake: exit code and standard error.
fn provoke(mistake: &Mistake) -> Answer {
    let folder = folder();
    let check = &["check", "spec.yaml"][..];
    let args = match mistake {
        In(from, to) => {
            folder.edit("spec.yaml", from, to);
            check
        }
        Added(text) => {
            folder.write("spec.yaml", &(spec() + text));
            check
        }
        File(name, text) => {
            folder.write(name, text);
            check
        }
        Command(args) => args,
    };
    folder.luxproof(args)
}

#[test]
fn mistakes_of_users_are_reported_with_place_and_remedy() {
    let mut all = String::new();
    for (name, mistake) in MISTAKES {
        let answer = provoke(mistake);
        assert_eq!(answer.code, Some(2), "{name}: {}{}", answer.stdout, answer.stderr);
        writeln!(all, "## {name}\n{}\n", answer.stderr.trim_end()).unwrap();
    }
    assert!(MISTAKES.len() >= 40);
    insta::assert_snapshot!(all);
}

/// The places of faults, in order.
fn places(answer: &Answer) -> Vec<&str> {
    let reported = answer.stderr.lines().filter_map(|line| line.trim_start().strip_prefix("× "));
    reported.filter_map(|line| line.split_once(": ").map(|(place, _)| place)).collect()
}

#[test]
fn ten_faults_of_different_kinds_are_ten_at_their_places() {
    let folder = folder();
    folder.write(
        "spec.yaml",
        "luxproof: 1
title: a test room
room:
  size_m: [6, 4, three]
  reflectance: {floor: 0.2, walls: 1.5, ceiling: 0.7}
luminaires:
  - {id: lamp, photometry: lmap.ies, at_m: [3, 2, 2.5], modle: area}
meters:
  plane: {points_m: [[1, 1, 0.8], [3, 2, 0.8]], normal: [0, 0, 0]}
  desk: {points_m: [], normal: [0, 0, 1]}
procedures:
  luminous_intensity: {luminaire: lamp, angles: photometry}
  direct_illuminance: {meters: plain}
engines: {povray: {cuont: 3}}
tolerances: {direct: {relative: 0.1}}
budget: {seconds: 0}
",
    );
    let answer = folder.luxproof(&["check", "spec.yaml"]).exits(2).complains("11 faults");
    let places = places(&answer).into_iter().filter_map(|p| p.strip_prefix("spec.yaml:")).sorted().collect_vec();
    let expected = ["10:9", "12:23", "13:32", "14:27", "15:14", "16:19", "4:18", "5:36", "7:28", "7:57", "9:57"];
    assert_eq!(places, expected, "{}", answer.stderr);
}

#[test]
fn every_bad_spec_of_a_folder_is_reported_and_so_are_policy_and_options() {
    let folder = folder();
    folder.write("other.yaml", &spec().replace("size_m", "sise_m"));
    folder.edit("spec.yaml", "walls: 0.5", "walls: 2");
    folder.edit("luxproof.yaml", "relative: 0.005", "relative: -1");
    let args = ["run", "spec.yaml", "other.yaml", "--engines", "nobody", "--out", "lamp.ies"];
    let answer = folder.luxproof(&args).exits(2);
    for says in ["spec.yaml:5:36", "other.yaml:4:3", "luxproof.yaml:2:", "no engine `nobody`", "lamp.ies: "] {
        assert!(answer.stderr.contains(says), "no {says} in {}", answer.stderr);
    }
}

#[test]
fn of_many_lints_some_are_shown_and_the_rest_are_counted() {
    let lamp = |k: usize| format!("  - {{id: l{k}, photometry: lamp.ies, at_m: [3, 2, 2.{k:02}5]}}\n");
    let lamps = (0..25).map(lamp).collect::<Vec<_>>().concat();
    let around = "obstacles:\n  - box: {min_m: [2, 1, 1.9], max_m: [4, 3, 2.9], reflectance: 0.5}\n";
    let folder = folder();
    folder.edit("spec.yaml", "luminaires:\n", &format!("{around}luminaires:\n{lamps}"));
    let reported = folder.luxproof(&["check", "spec.yaml"]).complains("6 more lints").stderr;
    assert_eq!(reported.matches("no light").count(), 20, "{reported}");
}

#[test]
fn suspicious_input_is_a_warning_at_its_place_and_no_error() {
    let box_around = "obstacles:\n  - box: {min_m: [2, 1, 2], max_m: [4, 3, 2.9], reflectance: 0.5}\n";
    for (mistake, place, says) in [
        (In("[6, 4, 3]", "[6000, 4000, 3000]"), "4:11", "millimetres"),
        (In("[6, 4, 3]", "[600, 400, 300]"), "4:11", "centimetres"),
        (In("size_m: [6, 4, 3]", "size_m: [20, 13, 9]"), "", ""),
        (Added(box_around), "7:44", "no light leaves"),
        (Added("tolerances: {direct_illuminance: {relative: 1}}\n"), "14:45", "100 %"),
        (
            In("[[1, 1, 0.8], [3, 2, 0.8]], normal: [0, 0, 1]", "[[1, 1, 0.02]], normal: [0, 0, -1]"),
            "9:45",
            "turns its back",
        ),
        (In("normal: [0, 0, 1]", "normal: [0, 0, -1]"), "12:23", "every reading is 0"),
        (In("at_m: [3, 2, 2.5]", "at_m: [3, 2, 2.5], flux_scale: 0"), "12:23", "every reading is 0"),
    ] {
        let answer = provoke(&mistake);
        assert_ne!(answer.code, Some(2), "{}", answer.stderr);
        let reported = answer.message();
        assert!(
            reported.contains(&format!("spec.yaml:{place}")) || place.is_empty(),
            "{place} {says}: {}",
            answer.stderr
        );
        assert!(reported.contains(says) && (place.is_empty() == reported.is_empty()), "{says}: {}", answer.stderr);
    }
    let in_feet = In("[[1, 1, 0.8], [3, 2, 0.8]]", "[[1, 1, 2.5], [3, 2, 2.5]]");
    let folder = folder();
    let In(from, to) = in_feet else { unreachable!() };
    folder.edit("spec.yaml", from, to);
    folder.edit("spec.yaml", "[6, 4, 3]", "[20, 13, 9]");
    folder.edit("spec.yaml", "at_m: [3, 2, 2.5]", "at_m: [3, 2, 8.5]");
    folder.luxproof(&["check", "spec.yaml"]).complains("are these feet?");
    // What many cases have is reported once.
    folder.edit("spec.yaml", "procedures:", "cases: [{name: a}, {name: b}, {name: c}]\nprocedures:");
    let reported = folder.luxproof(&["check", "spec.yaml"]).complains("(in spec/a and 2 more)").stderr;
    assert_eq!(reported.matches("are these feet?").count(), 1, "{reported}");
    // The same where it is run.
    let out = ["run", "spec.yaml", "--engines", "simulator,iesna", "--no-calibration"];
    std::fs::remove_file(folder.path("luxproof.yaml")).unwrap();
    folder.luxproof(&out).exits(0).complains("are these feet?");
}
