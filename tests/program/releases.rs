//! Releases of an engine: their names wherever engines are named, and `bisect`, which finds the one at which a verdict changed.

use serde_json::Value;

use crate::support::{
    Answer, Folder, LAMP, ROOM, SKEW_LAMP, SKEW_ROOM, TWO_METERS, adapter_with_lines_before_readings, among, is_night,
};

const DIRECT: &str = "procedures:\n  direct_illuminance: {meters: plane}\n";

/// An adapter that scales its readings by its second word where its first is this release or a later one, and crashes at those that are
/// named behind.
fn planted() -> String {
    let crash = "if sys.argv[1] in sys.argv[2:]:\n    sys.exit('out of lamps')\n";
    let adapter = adapter_with_lines_before_readings(crash);
    let (exact, scaled) = ("\"illuminance_lx\": lux", "\"illuminance_lx\": lux * factor(int(sys.argv[1]))");
    assert!(adapter.contains(exact));
    adapter.replace(exact, scaled).replace("import json\n", "import json\nfrom factor import factor\n")
}

/// Sixteen releases, 1.1 to 1.16, whose readings are off by what `factor` says in Python; `crashing` give none.
fn sixteen(factor: &str, crashing: &str) -> Folder {
    let release = |k| format!("\"1.{k}\": python3 -S adapter.py {k} {crashing}");
    let releases: Vec<String> = (1..=16).map(release).collect();
    let engines = format!(
        "engines:\n  mine:\n    command: [python3, -S, adapter.py, \"1\"]\n    releases: {{{}}}\n",
        releases.join(", ")
    );
    Folder::new(&[
        ("spec.yaml", &[SKEW_ROOM, &engines].concat()),
        ("lamp.ies", SKEW_LAMP),
        ("adapter.py", &planted()),
        ("factor.py", &format!("def factor(release):\n    return {factor}\n")),
    ])
}

fn bisect(folder: &Folder, good: &str, bad: &str, more: &[&str]) -> Answer {
    let args = ["bisect", "spec.yaml", "--engine", "mine", "--good", good, "--bad", bad, "--out", "out"];
    folder.luxproof(&[&args[..], more].concat())
}

fn found(answer: &Answer) -> Value {
    answer.json()
}

#[test]
fn a_planted_regression_among_sixteen_releases_is_found_in_four_runs_besides_the_ends() {
    let folder = sixteen("1.05 if release >= 11 else 1", "");
    let answer = bisect(&folder, "1.1", "1.16", &["--format", "json"]).exits(0);
    let reported = found(&answer);
    assert_eq!((&reported["good"], &reported["bad"]), (&"1.10".into(), &"1.11".into()), "{reported}");
    assert!(reported["runs"].as_u64().unwrap() <= 6, "{reported}");
    let changed: Vec<&str> =
        reported["changed"].as_array().unwrap().iter().map(|c| c["procedure"].as_str().unwrap()).collect();
    assert_eq!(changed, ["luminous_intensity", "direct_illuminance"]);
    assert_eq!(answer.stderr.lines().filter(|line| line.starts_with("mine@1.")).count() as u64, reported["runs"]);
    // What mended it, the other way round, out of the cache as far as it was read.
    bisect(&folder, "1.16", "1.1", &[]).exits(2).complains("the other way round");
    let mended = sixteen("1 if release >= 11 else 1.05", "");
    bisect(&mended, "1.16", "1.1", &[]).exits(0).prints("mine@1.10 is the first that is bad: mine@1.11");
}

#[test]
fn ends_that_are_alike_are_refused_and_so_are_releases_that_nobody_knows() {
    let folder = sixteen("1", "");
    bisect(&folder, "1.1", "1.16", &[]).exits(2).complains("both ends are alike");
    bisect(&folder, "1.1", "1.1", &[]).exits(2).complains("one release");
    bisect(&folder, "1.1", "2.0", &[]).exits(2).complains("mine has no release 2.0");
    let of_nobody = ["bisect", "spec.yaml", "--engine", "povray", "--good", "3", "--bad", "4"];
    folder.luxproof(&of_nobody).exits(2).complains("no releases are known of `povray`");
    for hostile in ["../1.2", "1.2/..", "", "1..2"] {
        bisect(&folder, hostile, "1.16", &[]).exits(2).complains("a release is of letters and digits");
    }
}

#[test]
fn releases_that_crash_are_skipped_and_named_where_the_change_may_be_theirs() {
    let folder = sixteen("1.05 if release >= 11 else 1", "8 9");
    bisect(&folder, "1.1", "1.16", &[]).exits(0).prints("mine@1.11 is the first that is bad").complains("out of lamps");
    let folder = sixteen("1.05 if release >= 11 else 1", "10");
    let answer = bisect(&folder, "1.1", "1.16", &[]).exits(4);
    answer.prints("behind mine@1.9 and no later than mine@1.11").prints("skipped  mine@1.10");
    let folder = sixteen("1.05 if release >= 11 else 1", "16");
    bisect(&folder, "1.1", "1.16", &[]).exits(3).complains("1.16 says nothing");
    // A range without it.
    bisect(&folder, "1.1", "1.15", &["--releases", "1.5,1.10,1.11"])
        .exits(0)
        .prints("the first that is bad: mine@1.10");
}

#[test]
fn a_release_of_a_program_is_an_engine_of_its_own_on_the_command_line_and_in_the_spec() {
    let folder = sixteen("1.05 if release >= 11 else 1", "");
    let (report, code) = folder.run(&["--engines", "mine@1.16,mine@1.2,mine", "--format", "json"]).report();
    assert_eq!(code, Some(1));
    let verdicts = |id: &str| {
        among(&report, "comparisons", &[("engine", id)]).iter().map(|c| c["verdict"].clone()).collect::<Vec<_>>()
    };
    assert!(verdicts("mine@1.16").iter().any(|v| v == "fail"), "{report}");
    assert!(verdicts("mine@1.2").iter().chain(&verdicts("mine")).all(|v| v == "pass"));
    let [one, other] = ["mine@1.16", "mine@1.2"].map(|id| &among(&report, "engines", &[("id", id)])[0]["version"]);
    assert_ne!(one, other);
    assert!(folder.path("out/readings/mine@1.2.json").is_file());
    // Named in the spec it takes part without being asked for; a baseline and a policy know it by its name.
    folder.edit("spec.yaml", "engines:\n", "engines:\n  mine@1.16: {}\n");
    let policy = "tolerances: [{procedure: direct_illuminance, engine: mine@1.16, relative: 0.1, source: planted}]\n";
    folder.write("luxproof.yaml", policy);
    let (report, _) = folder.run(&["--procedures", "direct_illuminance", "--format", "json"]).report();
    let of_release = among(&report, "comparisons", &[("engine", "mine@1.16")]);
    assert!(!of_release.is_empty() && of_release.iter().all(|c| c["verdict"] == "pass"), "{report}");
    folder.luxproof(&["accept", "out", "--all", "--reason", "planted"]).exits(0);
    let hold = |folder: &Folder| folder.run(&["--procedures", "direct_illuminance", "--baseline", "baselines"]);
    hold(&folder).exits(0);
    // It moves by itself, and is reported by its name.
    folder.edit("factor.py", "1.05 if release >= 11", "1.04 if release >= 11");
    hold(&folder).exits(1).prints("mine@1.16");
}

#[test]
fn names_of_releases_that_lead_anywhere_are_refused_where_they_stand_and_nothing_is_started() {
    for (name, says) in [
        ("mitsuba@3.5.0", "nearest is `mitsuba@3.5.2`"),
        ("mitsuba@../../../tmp", "names no release"),
        ("cycles@", "names no release"),
        ("radiance@1.0.0;id", "names no release"),
        ("povray@3.7", "name it `povray`"),
    ] {
        let engines = format!("engines:\n  \"{name}\": {{}}\n");
        let room = Folder::new(&[("spec.yaml", &[ROOM, TWO_METERS, DIRECT, &engines].concat()), ("lamp.ies", LAMP)]);
        for more in [&[][..], &["--untrusted"]] {
            let answer = room.luxproof(&[&["check", "spec.yaml"][..], more].concat()).exits(2);
            let reported = answer.message();
            assert!(reported.contains(says) && reported.contains("spec.yaml:13"), "{reported}");
        }
        assert!(!room.path("engines/releases").exists());
    }
    // Commands of releases are commands.
    let engines = "engines:\n  mine: {releases: {\"1.0\": [touch, here]}}\n";
    let room = Folder::new(&[("spec.yaml", &[ROOM, TWO_METERS, DIRECT, engines].concat()), ("lamp.ies", LAMP)]);
    let answer = room.luxproof(&["run", "spec.yaml", "--untrusted", "--engines", "mine@1.0"]).exits(2);
    assert!(answer.stderr.contains("it would run a program") && !room.path("here").exists(), "{answer:?}");
}

#[test]
fn a_release_that_is_not_installed_is_an_absent_engine_with_what_to_do() {
    let room = Folder::new(&[("spec.yaml", &[ROOM, TWO_METERS, DIRECT].concat()), ("lamp.ies", LAMP)]);
    let (report, code) = room.run(&["--engines", "mitsuba@3.5.2", "--format", "json"]).report();
    assert_eq!(code, Some(3));
    let engine = among(&report, "engines", &[("id", "mitsuba@3.5.2")])[0];
    assert_eq!(engine["status"], "absent");
    assert!(engine["reason"].as_str().unwrap().contains("luxproof engines install mitsuba@3.5.2"), "{engine}");
    let ends = ["bisect", "spec.yaml", "--engine", "mitsuba", "--good", "3.5.2", "--bad", "3.9.1", "--out", "found"];
    room.luxproof(&ends).exits(3).complains("3.5.2 says nothing");
}

/// Needs the network, and a hundred megabytes.
#[test]
fn a_release_is_installed_beside_its_engine_which_stays_as_it_is() {
    if !is_night() {
        return;
    }
    let room = Folder::for_renderers(&[("spec.yaml", &[ROOM, TWO_METERS, DIRECT].concat()), ("lamp.ies", LAMP)]);
    let fingerprint = |report: &Value, id: &str| among(report, "engines", &[("id", id)])[0]["fingerprint"].clone();
    let before = room.run(&["--engines", "radiance", "--format", "json"]).json();
    room.luxproof(&["engines", "install", "radiance@1.1.5"]).exits(0);
    let (both, code) = room.run(&["--engines", "radiance,radiance@1.1.5", "--format", "json"]).report();
    assert_eq!(code, Some(0));
    assert_eq!(fingerprint(&before, "radiance"), fingerprint(&both, "radiance"));
    assert_ne!(fingerprint(&both, "radiance"), fingerprint(&both, "radiance@1.1.5"));
}
