//! Score cards of strangers: no policy of theirs or of the machine judges, and nothing that luxproof did not write is removed.

use std::fs;
use std::os::unix::fs::symlink;

use serde_json::{Value, json};

use crate::cards::{CAPABILITIES, DIRECT, TUNED, adapter_with};
use crate::support::{Answer, Folder, LAMP, MINE, ROOM, TWO_METERS, adapter};

/// Whatever judges by it finds every value of an engine right.
const ALL_PASSES: &str = "tolerances: [{procedure: direct_illuminance, relative: 1000, source: a stranger}]\n";

/// A run of the public case by an adapter in `out`, and a site of it by our own solvers.
fn folder(adapter: &str) -> Folder {
    let folder = Folder::new(&[
        ("spec.yaml", &[ROOM, TWO_METERS, DIRECT, MINE].concat()),
        ("lamp.ies", LAMP),
        ("adapter.py", adapter),
        ("capabilities.yaml", CAPABILITIES),
    ]);
    fs::create_dir(folder.path("own-specs")).unwrap();
    folder.write("own-specs/spec.yaml", &[ROOM, TWO_METERS, DIRECT].concat());
    folder.write("own-specs/lamp.ies", LAMP);
    folder.luxproof(&["run", "own-specs/spec.yaml", "--engines", "iesna", "--no-calibration", "--out", "own"]).exits(0);
    folder.run(&[]).exits(0);
    cards(&folder, &["own"]).exits(0);
    folder
}

fn cards(folder: &Folder, from: &[&str]) -> Answer {
    folder.luxproof(&[&["cards"][..], from, &["--capabilities", "capabilities.yaml", "--out", "site"]].concat())
}

#[test]
fn a_policy_above_the_temporary_folder_judges_no_hidden_variant() {
    let folder = folder(&adapter_with(TUNED));
    folder.luxproof(&["bundle", "out", "--out", "mine.zip"]).exits(0);
    // Others may write there, as into /tmp.
    fs::create_dir_all(folder.path("shared/tmp")).unwrap();
    folder.write("shared/luxproof.yaml", ALL_PASSES);
    let mut add = folder.command(&["cards", "add", "mine.zip", "--site", "site", "--trusted"]);
    Answer::of(add.env("TMPDIR", folder.path("shared/tmp"))).exits(0);
    let site = folder.json("site/cards.json");
    let mine = site["renderers"].as_array().unwrap().iter().find(|renderer| renderer["name"] == "mine").unwrap();
    assert_eq!(mine["releases"][0]["cells"][0]["standing"]["state"], "wrong", "{mine}");
}

#[test]
fn only_the_files_that_a_site_lists_are_removed() {
    let folder = folder(&adapter());
    folder.write("site/CNAME", "cards.example");
    let first = folder.json("site/cards.json")["runs"][0]["id"].as_str().unwrap().to_owned();
    folder.write(&format!("site/runs/{first}/notes.txt"), "mine");
    cards(&folder, &["out"]).exits(0);
    assert_eq!(
        (folder.read("site/CNAME").as_str(), folder.read(&format!("site/runs/{first}/notes.txt")).as_str()),
        ("cards.example", "mine")
    );
    assert!(!folder.path(&format!("site/runs/{first}/report.json")).exists(), "the run is on the site no more");
    // Every file is listed but the list and those that luxproof did not write.
    let list = folder.json("site/luxproof-site.json");
    assert!(
        list["files"].as_array().unwrap().contains(&Value::from("index.html")) && !list.to_string().contains("CNAME"),
        "{list}"
    );
    // A file called like one of a site makes none.
    fs::create_dir(folder.path("theirs")).unwrap();
    folder.write("theirs/cards.json", &folder.read("site/cards.json"));
    folder.write("theirs/thesis.tex", "years of work");
    let args = ["cards", "out", "--capabilities", "capabilities.yaml", "--out", "theirs"];
    let answer = folder.luxproof(&args).exits(2);
    assert!(answer.message().contains("no site of score cards"), "{answer:?}");
    // Nor does a list that leads elsewhere.
    folder.write("theirs/luxproof-site.json", &json!({"luxproof_site": 1, "files": ["../spec.yaml"]}).to_string());
    folder.luxproof(&args).exits(2);
    assert_eq!(folder.read("theirs/thesis.tex"), "years of work");
    assert!(folder.path("spec.yaml").is_file());
}

#[test]
fn a_folder_with_other_files_than_a_bundles_is_not_replaced_by_one() {
    let folder = folder(&adapter());
    fs::create_dir(folder.path("crate")).unwrap();
    // The file that marks research data of any kind.
    folder.write("crate/ro-crate-metadata.json", "{}");
    folder.write("crate/measured.csv", "years of work");
    let answer = folder.luxproof(&["bundle", "out", "--out", "crate"]).exits(2);
    assert!(answer.message().contains("holds files and no bundle, such as"), "{answer:?}");
    assert_eq!(folder.read("crate/measured.csv"), "years of work");
    folder.luxproof(&["bundle", "out", "--out", "b"]).exits(0);
    folder.luxproof(&["bundle", "out", "--out", "b"]).exits(0);
    folder.write("b/notes.txt", "mine");
    folder.luxproof(&["bundle", "out", "--out", "b"]).exits(2).complains("notes.txt");
    assert_eq!(folder.read("b/notes.txt"), "mine");
}

#[test]
fn cards_say_what_was_not_run_again() {
    let folder = folder(&adapter());
    folder.luxproof(&["bundle", "out", "--out", "theirs.zip"]).exits(0);
    cards(&folder, &["theirs.zip"]).exits(0);
    let run = folder.json("site/cards.json")["runs"][0].clone();
    assert_eq!(run["verification"]["verification"], "submitted", "{run}");
    assert!(folder.read("site/renderers/mine/direct.html").contains("not run again by the publisher"));
    let untrusted = ["cards", "--untrusted", "out", "--capabilities", "capabilities.yaml", "--out", "site"];
    folder.luxproof(&untrusted).exits(0);
    assert_eq!(folder.json("site/cards.json")["runs"][0]["verification"]["verification"], "unverified");
    cards(&folder, &["out"]).exits(0);
    assert_eq!(folder.json("site/cards.json")["runs"][0]["verification"]["verification"], "own");
}

#[test]
fn capabilities_that_are_not_trusted_are_no_link() {
    let folder = folder(&adapter());
    let outside = Folder::new(&[("secret.yaml", "SECRET-93f1: 1\n")]);
    symlink(outside.path("secret.yaml"), folder.path("link.yaml")).unwrap();
    for (trust, says) in [(&["--untrusted"][..], "is a link"), (&[], "SECRET-93f1")] {
        let args = [&["cards"][..], trust, &["out", "--capabilities", "link.yaml", "--out", "other"]].concat();
        let answer = folder.luxproof(&args).exits(2);
        assert!(answer.message().contains(says), "{answer:?}");
        assert_eq!(answer.stderr.contains("SECRET-93f1"), trust.is_empty(), "{answer:?}");
    }
}
