//! What makes the program at home on a machine: a first spec, completions, manual pages, its version, a run's page.

use std::fs;
use std::process::Command;

use crate::support::{Answer, Folder, LAMP, OWN, ROOM, TWO_METERS, root};

const DIRECT: &str = "procedures:\n  direct_illuminance: {meters: plane}\n";

#[test]
fn a_first_spec_runs_as_it_is_written_and_is_not_replaced() {
    let folder = Folder::new(&[]);
    let args = ["init", "specs/office.yaml", "--size", "5.4,3.6,2.8", "--title", "an office: \"mine\"", "--yes"];
    folder.luxproof(&args).exits(0).prints("specs/office.yaml").complains("next: luxproof run specs/office.yaml");
    let text = folder.read("specs/office.yaml");
    assert!(
        text.contains("size_m: [5.4, 3.6, 2.8]") && text.lines().filter(|l| l.contains('#')).count() > 10,
        "{text}"
    );
    folder.luxproof(&["check", "specs/office.yaml"]).exits(0);
    let run = ["run", "specs/office.yaml", "--engines", OWN, "--no-calibration", "--out", "out"];
    folder.luxproof(&run).exits(0).prints("an office: \"mine\"");
    folder.luxproof(&args).exits(2).complains("is there already");
    folder.luxproof(&[&args[..], &["--force"]].concat()).exits(0);
    // One's own file is taken along; what is none is refused before anything is written.
    folder.write("mine.ies", LAMP);
    folder.luxproof(&["init", "a/first.yaml", "--photometry", "mine.ies", "--yes"]).exits(0).prints("a/mine.ies");
    folder.luxproof(&["check", "a/first.yaml"]).exits(0);
    folder.write("bad.ies", "IESNA:LM-63-2002\nTILT=NONE\nx\n");
    folder.luxproof(&["init", "b/first.yaml", "--photometry", "bad.ies", "--yes"]).exits(2).complains("bad.ies:3");
    assert!(!folder.path("b").exists());
    for size in ["6,4", "6,4,0", "6,x,3", "-1,2,3"] {
        folder.luxproof(&["init", "c.yaml", "--yes", &format!("--size={size}")]).exits(2);
    }
    assert!(!folder.path("c.yaml").exists());
}

/// A panel of 0.6 m; with `upwards`, half of its light goes up.
fn panel(upwards: bool) -> String {
    let angles = if upwards { "0 60 90 120 180" } else { "0 45 60 75 90" };
    let candela = if upwards { "100 80 0 80 100" } else { "100 71 50 26 0" };
    format!("IESNA:LM-63-2002\nTILT=NONE\n1 -1 1 5 1 1 2 0.6 0.6 0\n1 1 0\n{angles}\n0\n{candela}\n")
}

#[test]
fn a_first_spec_takes_mounting_model_and_meters_from_the_file_and_the_room() {
    let folder = Folder::new(&[("panel.ies", &panel(false)), ("pendant.ies", &panel(true)), ("point.ies", LAMP)]);
    let office = |spec: &str, file: &str, size: &str| {
        folder.luxproof(&["init", spec, "--photometry", file, "--size", size, "--yes"]).exits(0);
        let check = folder.luxproof(&["check", spec]).exits(0);
        assert!(check.stderr.is_empty(), "{}", check.stderr);
        (folder.read(spec), check.stdout)
    };
    // EN 12464-1: 4 m x 3 m inside the margin; p = 0.2 x 5^log10(4) = 0.527 m.
    let (text, check) = office("a.yaml", "panel.ies", "5,4,2.8");
    assert!(text.contains("8 x 6 points by EN 12464-1"), "{text}");
    assert!(text.contains("surface: {of: floor, distance_m: 0.75, margin_m: 0.5}"), "{text}");
    assert!(text.contains("at_m: [2.5, 2, 2.7]"), "{text}");
    assert!(text.contains("model: auto ") && text.contains("# area here: desk["), "{text}");
    assert!(check.contains("direct_illuminance at 48 points") && check.contains("model: area (auto)"), "{check}");
    // A luminaire that shines upwards hangs; one without an opening is a point; a corridor has no margin.
    let (text, _) = office("b.yaml", "pendant.ies", "5,4,2.8");
    assert!(text.contains("at_m: [2.5, 2, 2.3]"), "{text}");
    let (text, _) = office("c.yaml", "point.ies", "9,1.8,2.8");
    assert!(text.contains("# point here: the file has no opening") && text.contains("margin_m: 0}"), "{text}");
    // A recessed panel lies in the ceiling; one that shines upwards cannot.
    let recessed = ["--photometry", "panel.ies", "--size", "5,4,2.8", "--yes", "--mounting", "recessed"];
    folder.luxproof(&[&["init", "r.yaml"], &recessed[..]].concat()).exits(0);
    let check = folder.luxproof(&["check", "r.yaml"]).exits(0);
    let text = folder.read("r.yaml");
    assert!(check.stderr.is_empty() && text.contains("at_m: [2.5, 2, 2.8]"), "{}{text}", check.stderr);
    assert!(text.contains("    # face_reflectance: 0.8 "), "{text}");
    // What does not fit is refused, and nothing is written.
    let args = ["init", "d.yaml", "--photometry", "panel.ies", "--size", "0.5,4,3", "--yes"];
    let refusal = folder.luxproof(&args).exits(2).message();
    assert!(refusal.contains("does not fit into a room of 0.5 x 4 x 3 m"), "{refusal}");
    assert!(!folder.path("d.yaml").exists());
}

#[test]
fn a_first_spec_of_any_room_is_sound() {
    for size in ["6,4,3", "1,1,1", "0.3,0.2,0.2", "100,40,12", "3.33,7.77,2.51"] {
        let folder = Folder::new(&[]);
        folder.luxproof(&["init", "--yes", "--size", size]).exits(0);
        let answer = folder.luxproof(&["check", "first.yaml"]).exits(0);
        assert!(answer.stderr.is_empty(), "{size}: {}", answer.stderr);
    }
}

#[test]
fn completions_and_manual_pages_know_every_command() {
    let folder = Folder::new(&[]);
    for shell in ["bash", "elvish", "fish", "powershell", "zsh"] {
        let script = folder.luxproof(&["completions", shell]).exits(0).stdout;
        assert!(script.contains("photometry") && script.contains("engines-dir"), "{shell}");
    }
    let bash = folder.luxproof(&["completions", "bash"]).stdout;
    folder.write("complete.bash", &bash);
    let check = Command::new("bash").args(["-n"]).arg(folder.path("complete.bash")).status();
    assert!(check.unwrap().success());
    folder.luxproof(&["man", "--out", "man"]).exits(0);
    for page in ["luxproof.1", "luxproof-run.1", "luxproof-engines-install.1"] {
        let text = folder.read(&format!("man/{page}"));
        assert!(text.contains(".TH") && text.contains("luxproof"), "{page}");
    }
    assert!(folder.read("man/luxproof-run.1").contains("baseline"));
}

#[test]
fn version_and_report_name_the_commit_of_the_sources() {
    let folder = Folder::new(&[("spec.yaml", &[ROOM, TWO_METERS, DIRECT].concat()), ("lamp.ies", LAMP)]);
    folder.run(&["--engines", OWN]).exits(0);
    let tool = &folder.report()["tool"];
    let version = folder.luxproof(&["--version"]).exits(0).stdout;
    let head = Answer::of(Command::new("git").args(["rev-parse", "HEAD"]).current_dir(root()));
    let is_checkout = head.code == Some(0) && root().join(".git").exists();
    assert_eq!(tool["version"], env!("CARGO_PKG_VERSION"));
    if is_checkout {
        let commit = tool["commit"].as_str().unwrap();
        assert_eq!(commit, head.stdout.trim(), "built of this commit");
        let changes = if tool["dirty"] == true { ", with changes" } else { "" };
        assert_eq!(version.trim(), format!("luxproof {} ({}{changes})", env!("CARGO_PKG_VERSION"), &commit[..12]));
    }
    folder.luxproof(&["report", "out"]).exits(0).prints(version.trim());
}

#[test]
fn every_run_leaves_a_page_and_open_tells_where() {
    let folder = Folder::new(&[("spec.yaml", &[ROOM, TWO_METERS, DIRECT].concat()), ("lamp.ies", LAMP)]);
    folder.run(&["--engines", OWN]).exits(0);
    let page = folder.read("out/report.html");
    folder.luxproof(&["open", "out", "--no-browser"]).exits(0).prints("out/report.html");
    fs::remove_file(folder.path("out/report.html")).unwrap();
    folder.luxproof(&["open", "out/report.json", "--no-browser"]).exits(0).prints("out/report.html");
    assert_eq!(folder.read("out/report.html"), page);
    folder.luxproof(&["open", "cache", "--no-browser"]).exits(2).complains("contains no report.json");
}

#[test]
fn photometric_lint_can_be_denied() {
    let folder = Folder::new(&[("sound.ies", LAMP), ("dark.ies", &LAMP.replace("100 80 0", "0 0 0"))]);
    folder.luxproof(&["photometry", "--deny", "warnings", "sound.ies"]).exits(0);
    folder.luxproof(&["photometry", "--deny", "warnings", "sound.ies", "dark.ies"]).exits(1).prints("warning");
    folder.luxproof(&["photometry", "--deny", "warnings", "dark.ies", "none.ies"]).exits(2);
}
