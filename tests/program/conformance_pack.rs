//! `luxproof conformance`: the pack is written, and answers of readers are judged.

use serde_json::{Value, json};

use crate::support::Folder;

#[test]
fn a_pack_is_written_once_and_again_with_force() {
    let folder = Folder::new(&[]);
    folder.luxproof(&["conformance", "--emit", "pack"]).exits(0).prints("begin with README.md");
    assert!(folder.read("pack/files/plain.ies").starts_with("IESNA:LM-63-2002\r\n"));
    let expected = folder.json("pack/expected/plain.ies.json");
    // 500 - 150 z at the nadir.
    assert_eq!((&expected["candela"][0], &expected["directions"][0]["gamma_deg"]), (&json!(650.0), &json!(0.0)));
    let again = folder.luxproof(&["conformance", "--emit", "pack"]).exits(2);
    assert!(again.message().contains("pack is not empty") && again.message().contains("--force"), "{again:?}");
    folder.luxproof(&["conformance", "--emit", "pack", "--force"]).exits(0);
    folder.luxproof(&["conformance"]).exits(2).complains("--emit");
}

#[test]
fn answers_are_judged_and_a_mistake_is_named_with_its_remedy() {
    let folder = Folder::new(&[]);
    let own = folder.luxproof(&["conformance", "answer"]).exits(0);
    folder.write("right.json", &own.stdout);
    let right = folder.luxproof(&["conformance", "check", "right.json"]).exits(0);
    right.prints(" 0 wrong, 0 not read, 0 not submitted").prints("aimed-at-nadir (type-b.ies");

    let mut answers: Value = own.json();
    let candela = answers["files"]["multiplier.ies"]["candela"].as_array_mut().unwrap();
    for value in candela.iter_mut() {
        *value = json!(value.as_f64().unwrap() / 2.5);
    }
    folder.write("wrong.json", &answers.to_string());
    let wrong = folder.luxproof(&["conformance", "check", "wrong.json"]).exits(1);
    let wrong = wrong.prints("WRONG: multiplier-ignored").prints("tests: A candela multiplier of 2.5.");
    wrong.prints("The multiplier of the file is ignored: multiply every intensity by it.");
    let report = folder.luxproof(&["conformance", "check", "wrong.json", "--format", "json"]).exits(1).json();
    let file = report["files"].as_array().unwrap().iter().find(|file| file["file"] == "multiplier.ies").unwrap();
    assert_eq!(file["verdict"], json!({"is": "mistakes", "alternatives": [["multiplier-ignored"]]}));

    answers["files"]["multiplier.ies"] = json!({"refused": "no\u{1b}[31m reader"});
    folder.write("refused.json", &answers.to_string());
    let refused = folder.luxproof(&["conformance", "check", "refused.json"]).exits(1).prints("1 not read");
    assert!(!refused.stdout.contains('\u{1b}'), "{refused:?}");
}

#[test]
fn files_that_are_no_submission_are_refused_with_a_place() {
    let folder = Folder::new(&[("broken.json", "{\"pack\": \"1.0.0\",\n \"files\": 3}"), ("other.json", "{}")]);
    folder.luxproof(&["conformance", "check", "none.json"]).exits(2).complains("none.json");
    folder.luxproof(&["conformance", "check", "broken.json"]).exits(2).complains("line 2");
    let other = folder.luxproof(&["conformance", "check", "other.json"]).exits(2);
    assert!(other.message().contains("missing field") && other.message().contains("results.schema.json"), "{other:?}");
}
