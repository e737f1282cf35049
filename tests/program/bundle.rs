//! Bundles: a run is made again from them alone, every byte is verified, and a stranger's do nothing but be read.

use std::fs::{self, File};
use std::io::Write;
use std::os::unix::fs::symlink;
use std::path::{Path, PathBuf};
use std::process::Command;

use serde_json::Value;
use sha2::{Digest, Sha256};
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipWriter};

use crate::support::{Answer, Folder, LAMP, MINE, OWN, ROOM, SKEW_LAMP, SKEW_ROOM, TWO_METERS, adapter, root};

const INDIRECT: &str = "  indirect_illuminance: {meters: plane}\n";
const LAMP_ELSEWHERE: (&str, &str) = ("photometry: lamp.ies", "photometry: ../lamps/tilted lamp.ies");
/// Its tilt factors lie in a file that it names.
const TILT: &str = "1\n2\n0 90\n1 1\n";

/// A project whose spec names a lamp in another folder, under a policy above both, and the bundle of its run.
fn bundled(engines: &str, out: &str) -> Folder {
    let folder = if engines == OWN { Folder::new(&[]) } else { Folder::for_renderers(&[]) };
    for name in ["p/specs", "p/lamps"] {
        fs::create_dir_all(folder.path(name)).unwrap();
    }
    folder.write("p/luxproof.yaml", "profiles: {ci: {budget: {relative_error: 0.01}}}\n");
    let spec = SKEW_ROOM.replace(LAMP_ELSEWHERE.0, LAMP_ELSEWHERE.1) + INDIRECT;
    folder.write(
        "p/specs/spec.yaml",
        &spec.replace("luxproof: 1\n", "luxproof: 1\nbudget: {relative_error: 0.01, seconds: 20}\n"),
    );
    folder.write("p/lamps/tilted lamp.ies", &SKEW_LAMP.replace("TILT=NONE", "TILT=lamp.tlt"));
    folder.write("p/lamps/lamp.tlt", TILT);
    let run = [
        "run",
        "p/specs/spec.yaml",
        "--engines",
        engines,
        "--profile",
        "ci",
        "--out",
        "out",
        "--no-calibration",
        "--seed",
        "3",
    ];
    let code = folder.luxproof(&run).code;
    assert!(matches!(code, Some(0 | 4)), "{code:?}");
    folder.luxproof(&["bundle", "out", "--out", out]).exits(0).prints(out);
    folder
}

/// Every file below a folder, by its place there.
fn files(folder: &Path) -> Vec<PathBuf> {
    let mut found = vec![];
    for entry in fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()) {
        if entry.is_dir() {
            found.extend(files(&entry));
        } else {
            found.push(entry);
        }
    }
    found.sort();
    found
}

/// Makes the list of hashes right again, as nobody does by accident.
fn list_anew(bundle: &Path) {
    let line = |path: &PathBuf| {
        let hash =
            Sha256::digest(fs::read(path).unwrap()).iter().fold(String::new(), |hash, b| hash + &format!("{b:02x}"));
        format!("{hash}  {}\n", path.strip_prefix(bundle).unwrap().display())
    };
    let listed = files(bundle).into_iter().filter(|path| !path.ends_with("SHA256SUMS"));
    let mut lines: Vec<(PathBuf, String)> = listed.map(|path| (path.clone(), line(&path))).collect();
    lines.sort_by_key(|(path, _)| path.strip_prefix(bundle).unwrap().to_str().unwrap().to_owned());
    fs::write(bundle.join("SHA256SUMS"), lines.into_iter().map(|(_, line)| line).collect::<String>()).unwrap();
}

#[test]
fn a_run_is_made_again_from_its_bundle_alone_and_comes_out_to_the_byte() {
    for out in ["bundle", "bundle.zip"] {
        let made = bundled(OWN, out);
        // A fresh place, under a policy that is none of the bundle's.
        let fresh = Folder::new(&[("luxproof.yaml", "required_engines: [radiance]\n")]);
        fs::rename(made.path(out), fresh.path(out)).unwrap();
        let here = made.path("").display().to_string();
        drop(made);
        fresh.luxproof(&["reproduce", out, "--verify"]).exits(0).prints("11 files, whole");
        let answer = fresh.luxproof(&["reproduce", out, "--format", "json"]).exits(0).json();
        let rows = answer["rows"].as_array().unwrap();
        assert_eq!(rows.len(), 6, "{answer}");
        assert!(rows.iter().all(|row| row["outcome"] == "same_bytes"), "{answer}");
        let report = fresh.json(&format!("luxproof-out/{}-again/report.json", out.trim_end_matches(".zip")));
        assert_eq!((&report["request"]["seed"], &report["request"]["profile"]), (&Value::from(3), &Value::from("ci")));
        if out == "bundle" {
            for file in files(&fresh.path(out)) {
                let text = fs::read_to_string(&file).unwrap();
                assert!(!text.contains(&here), "{} tells of {here}", file.display());
            }
            assert_eq!(fs::read_to_string(fresh.path("bundle/inputs/lamps/lamp.tlt")).unwrap(), TILT);
            let sums = Command::new("sha256sum")
                .args(["--check", "--strict", "--quiet", "SHA256SUMS"])
                .current_dir(fresh.path(out))
                .status();
            assert!(sums.unwrap().success());
        }
    }
}

#[test]
fn the_bundle_is_an_ro_crate_by_its_own_reader() {
    let made = bundled(OWN, "bundle");
    let python = root().join("target/crate-tools/bin/python");
    assert!(python.exists(), "run `ci/pinned crate`");
    let mut check = Command::new(python);
    let answer = Answer::of(check.arg(root().join("tests/ro_crate.py")).arg(made.path("bundle")));
    answer.exits(0).prints("10 files");
}

#[test]
fn a_byte_that_is_flipped_missing_or_added_is_found_and_its_file_named() {
    let made = bundled(OWN, "bundle");
    let folder = made.path("bundle");
    let verify = || made.luxproof(&["reproduce", "bundle"]).exits(2);
    let reported = |what: &str| {
        let reported = verify().message();
        assert!(reported.contains(what), "no `{what}` in {reported}");
    };
    for path in files(&folder) {
        let (name, bytes) = (path.strip_prefix(&folder).unwrap().display().to_string(), fs::read(&path).unwrap());
        for at in [0, bytes.len() / 2, bytes.len() - 1] {
            let mut flipped = bytes.clone();
            flipped[at] ^= 1;
            fs::write(&path, flipped).unwrap();
            reported(&format!("{name} has changed"));
        }
        fs::write(&path, &bytes[..bytes.len() - 1]).unwrap();
        reported(&format!("{name} has changed"));
        fs::remove_file(&path).unwrap();
        let missing = format!("{name} is missing");
        reported(if name == "SHA256SUMS" { "it holds no SHA256SUMS" } else { &missing });
        fs::write(&path, bytes).unwrap();
    }
    made.write("bundle/inputs/more", "");
    reported("inputs/more was added");
    fs::remove_file(made.path("bundle/inputs/more")).unwrap();
    symlink("/etc/passwd", made.path("bundle/inputs/more")).unwrap();
    reported("inputs/more was added: it is no regular file");
    fs::remove_file(made.path("bundle/inputs/more")).unwrap();
    made.luxproof(&["reproduce", "bundle", "--verify"]).exits(0);
    assert!(!made.path("luxproof-out").exists());
}

#[test]
fn a_byte_that_is_flipped_anywhere_in_a_zip_is_found() {
    let made = bundled(OWN, "bundle.zip");
    let bytes = fs::read(made.path("bundle.zip")).unwrap();
    // The records at its ends by the byte, where no file's own bytes are; what lies between by steps.
    let ends = (0..40).chain(bytes.len() - 60..bytes.len());
    for at in ends.chain((40..bytes.len() - 60).step_by(bytes.len() / 100)) {
        let mut flipped = bytes.clone();
        flipped[at] ^= 1;
        fs::write(made.path("flipped.zip"), flipped).unwrap();
        let answer = made.luxproof(&["reproduce", "flipped.zip", "--verify"]);
        assert_eq!(answer.code, Some(2), "byte {at}: {answer:?}");
    }
    fs::write(made.path("longer.zip"), [&bytes[..], b"x"].concat()).unwrap();
    made.luxproof(&["reproduce", "longer.zip", "--verify"]).exits(2);
}

#[test]
fn a_zip_leaves_nothing_beside_its_own_place() {
    let folder = Folder::new(&[]);
    let outside = folder.path("outside").display().to_string();
    let stored = SimpleFileOptions::default().compression_method(CompressionMethod::Stored);
    for name in ["../outside", "a/../../outside", &outside, "a\\..\\..\\outside", "./a", "a//b"] {
        let mut archive = ZipWriter::new(File::create(folder.path("evil.zip")).unwrap());
        archive.start_file(name, stored).unwrap();
        archive.write_all(b"evil").unwrap();
        archive.finish().unwrap();
        let reported = folder.luxproof(&["reproduce", "evil.zip"]).exits(2).message();
        assert!(reported.contains("outside of the bundle") || reported.contains("no SHA256SUMS"), "{name}: {reported}");
        assert!(!folder.path("outside").exists(), "{name}");
    }
    let mut archive = ZipWriter::new(File::create(folder.path("evil.zip")).unwrap());
    archive.add_symlink("link", "/etc/passwd", stored).unwrap();
    archive.finish().unwrap();
    assert!(folder.luxproof(&["reproduce", "evil.zip"]).exits(2).message().contains("no regular file"));
    fs::write(folder.path("none.zip"), "PK").unwrap();
    folder.luxproof(&["reproduce", "none.zip"]).exits(2);
}

#[test]
fn a_strangers_bundle_names_no_file_out_of_it_and_another_input_is_another_run() {
    let outside = Folder::new(&[("lamp.ies", LAMP)]);
    let lamp = outside.path("lamp.ies").display().to_string();
    for (to, says) in [
        (lamp.clone(), "does not lie below"),
        (format!("../../../../../../../../{}", lamp.trim_start_matches('/')), "does not lie below"),
    ] {
        let made = bundled(OWN, "bundle");
        made.edit("bundle/inputs/specs/spec.yaml", "../lamps/tilted lamp.ies", &to);
        list_anew(&made.path("bundle"));
        let reported = made.luxproof(&["reproduce", "bundle"]).exits(2).message();
        assert!(reported.contains(says), "{reported}");
    }
    let made = bundled(OWN, "bundle");
    made.edit("bundle/inputs/lamps/tilted lamp.ies", "100 80 10 5", "101 80 10 5");
    list_anew(&made.path("bundle"));
    made.luxproof(&["reproduce", "bundle"]).exits(1).prints("not reproduced").prints("DIFFERS; task: ");
}

#[test]
fn a_program_of_a_bundle_is_packed_and_runs_only_for_who_trusts_it() {
    let text = [ROOM, TWO_METERS, "procedures:\n  direct_illuminance: {meters: plane}\n", MINE].concat();
    let made = Folder::new(&[("spec.yaml", &text), ("lamp.ies", LAMP), ("adapter.py", &adapter())]);
    made.run(&["--engines", "mine"]).exits(0);
    made.luxproof(&["bundle", "out", "--out", "bundle"]).exits(0);
    let reported = made.luxproof(&["reproduce", "bundle"]).exits(2).message();
    assert!(
        reported.contains("engines.mine.command: it would run a program") && reported.contains("--trusted"),
        "{reported}"
    );
    fs::remove_file(made.path("adapter.py")).unwrap();
    made.luxproof(&["reproduce", "bundle", "--trusted"]).exits(0).prints("reproduced");
    made.luxproof(&["reproduce", "bundle", "--trusted", "--untrusted"]).exits(2).complains("contradict");
}

#[test]
fn what_is_no_longer_what_was_run_is_not_bundled() {
    let spec = [ROOM, TWO_METERS, "procedures:\n  direct_illuminance: {meters: plane}\n"].concat();
    let folder = Folder::new(&[("spec.yaml", &spec), ("lamp.ies", LAMP), ("mine", "mine")]);
    folder.run(&["--engines", OWN]).exits(0);
    folder.edit("lamp.ies", "100 80 0", "100 81 0");
    folder.luxproof(&["bundle", "out"]).exits(2).complains("spec.yaml is not what it was");
    folder.edit("lamp.ies", "100 81 0", "100 80 0");
    // A folder of something else stays.
    folder.luxproof(&["bundle", "out", "--out", "."]).exits(2).complains("holds files and no bundle");
    assert_eq!(folder.read("mine"), "mine");
    folder.luxproof(&["bundle", "out"]).exits(0).prints("out-bundle");
    folder.luxproof(&["bundle", "out"]).exits(0);
    // A file that is named from the root would lie elsewhere.
    folder.edit("spec.yaml", "lamp.ies", &folder.path("lamp.ies").display().to_string());
    folder.run(&["--engines", OWN]).exits(0);
    let reported = folder.luxproof(&["bundle", "out"]).exits(2).message();
    assert!(reported.contains("relative to the spec"), "{reported}");
}

#[test]
fn radiance_reads_the_same_bytes_again_and_its_absence_is_reported() {
    let made = bundled("simulator,iesna,radiance", "bundle");
    let answer = made.luxproof(&["reproduce", "bundle", "--format", "json"]).exits(0).json();
    let read = answer["rows"].as_array().unwrap().iter().filter(|row| row["engine"] == "radiance");
    let outcomes: Vec<&Value> = read.map(|row| &row["outcome"]).collect();
    assert_eq!(outcomes, ["same_bytes"; 3], "{answer}");
    let bare = Folder::new(&[]);
    fs::rename(made.path("bundle"), bare.path("bundle")).unwrap();
    bare.luxproof(&["reproduce", "bundle"]).exits(3).prints("absent now").prints("NOT READ").prints("3 not read");
}

/// A paper's table of direct light, whose digits are right but for one cell's.
const TABLE: &str = "luxproof_published: 1
citation: {title: A paper}
spec: spec.yaml
rounding: {units_in_last_digit: 0.5}
tables:
  direct_illuminance:
    name: Table 1
    quantity: illuminance_lx
    columns:
      inverse_square: {reference: true, engine: iesna, model: point, meaning: by hand}
    rows:
      - {at_m: [1, 1, 0.8], normal: [0, 0, 1], cells: {inverse_square: \"FIRST\"}}
      - {at_m: [3, 2, 0.8], normal: [0, 0, 1], cells: {inverse_square: \"34.6\"}}
";

#[test]
fn a_papers_tables_come_out_cell_by_cell_under_their_rounding() {
    let spec =
        [ROOM, TWO_METERS, "procedures:\n  direct_illuminance: {meters: plane}\npublished: table.yaml\n"].concat();
    let folder = Folder::new(&[
        ("spec.yaml", &spec),
        ("lamp.ies", &LAMP.replace("100 80 0", "99.9731 80.0007 0")),
        ("table.yaml", &TABLE.replace("FIRST", "1")),
    ]);
    let cells = folder.luxproof(&["reproduce", "table.yaml", "--format", "json"]).json();
    let first = cells[0]["computed"].as_f64().unwrap();
    assert!((cells[1]["computed"].as_f64().unwrap() - 99.9731 / (1.7 * 1.7)).abs() < 1e-9, "{cells}");
    folder.write("table.yaml", &TABLE.replace("FIRST", &format!("{first:.1}")));
    folder
        .luxproof(&["reproduce", "table.yaml"])
        .exits(0)
        .prints("A paper: 2 of 2 printed cells come out again within their rounding");
    folder.write("table.yaml", &TABLE.replace("FIRST", &format!("{:.1}", first + 0.1)));
    let reported =
        folder.luxproof(&["reproduce", "table.yaml"]).exits(1).prints("1 of 2 printed cells").prints("1 beyond");
    assert_eq!(reported.stdout.lines().filter(|line| line.contains("inverse_square")).count(), 2, "{reported:?}");
    folder.edit("table.yaml", "spec: spec.yaml\n", "");
    folder.luxproof(&["reproduce", "table.yaml"]).exits(2).complains("names no spec");
    folder.edit("table.yaml", "citation", "spec: other.yaml\ncitation");
    folder.write("other.yaml", &spec.replace("published: table.yaml\n", ""));
    folder.luxproof(&["reproduce", "table.yaml"]).exits(2).complains("is not held against");
}
