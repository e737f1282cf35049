//! Score cards of whole runs: hidden variants expose what is tuned, and submissions are run again.

use std::fs;

use luxproof_process::digest::hexadecimal;
use serde_json::Value;
use sha2::{Digest as _, Sha256};

use crate::support::{Answer, Folder, LAMP, MINE, ROOM, TWO_METERS, adapter};

pub(crate) const DIRECT: &str = "procedures:
  direct_illuminance: {meters: plane}
";

pub(crate) const CAPABILITIES: &str = "version: 1
capabilities:
  - id: direct
    group: Light
    title: Direct light
    question: Is it right?
    cases: [{case: spec, procedures: [direct_illuminance]}]
    minimum_cases: 1
";

/// Right where the luminaire and its place are those of the public case, and 5 % off everywhere else.
pub(crate) const TUNED: &str = "
def is_public(job):
    return [(lamp['position_m'], max(map(max, lamp['candela']))) for lamp in job['luminaires']] == [([3, 2, 2.5], 100)]

exact_answer = answer
def answer(job):
    found = exact_answer(job)
    for reading in found.get('readings', []):
        reading['illuminance_lx'] *= 1 if is_public(job) else 1.05
    return found
";

/// Right in a folder with more files than its bundle has, and 5 % off elsewhere: the values of its run come out nowhere else.
const UNREPEATABLE: &str = "
import os
exact_answer = answer
def answer(job):
    found = exact_answer(job)
    is_at_home = len(os.listdir(os.path.dirname(os.path.abspath(__file__)))) > 3
    for reading in found.get('readings', []):
        reading['illuminance_lx'] *= 1 if is_at_home else 1.05
    return found
";

/// 5 % off everywhere.
const BRIGHT: &str = "
exact_answer = answer
def answer(job):
    found = exact_answer(job)
    for reading in found.get('readings', []):
        reading['illuminance_lx'] *= 1.05
    return found
";

/// The example adapter with a part of it replaced.
pub(crate) fn adapter_with(lines: &str) -> String {
    adapter().replace("def reply(request):", &format!("{lines}\n\ndef reply(request):"))
}

/// A public case with an adapter as its engine.
fn folder(adapter: &str) -> Folder {
    let spec = [ROOM, TWO_METERS, DIRECT, MINE].concat();
    Folder::new(&[
        ("spec.yaml", &spec),
        ("lamp.ies", LAMP),
        ("adapter.py", adapter),
        ("capabilities.yaml", CAPABILITIES),
    ])
}

fn cards(folder: &Folder, from: &[&str]) -> Answer {
    folder.luxproof(&[&["cards"][..], from, &["--capabilities", "capabilities.yaml", "--out", "site"]].concat())
}

/// The cell of an engine's newest release.
fn cell(folder: &Folder, engine: &str) -> Value {
    let cards = folder.json("site/cards.json");
    let renderers = cards["renderers"].as_array().unwrap();
    let found = renderers.iter().find(|renderer| renderer["name"] == engine);
    found.unwrap_or_else(|| panic!("no {engine} in {cards}"))["releases"][0]["cells"][0].clone()
}

/// Runs the public case next to its hidden variant.
fn with_variant(adapter: &str, expected: i32) -> Folder {
    let folder = folder(adapter);
    folder.luxproof(&["cards", "vary", "spec.yaml", "--seed", "11", "--out", "hidden"]).exits(0).prints("of spec");
    folder.luxproof(&["run", "spec.yaml", "hidden", "--out", "out", "--no-calibration"]).exits(expected);
    folder
}

#[test]
fn an_adapter_that_recognises_the_public_cases_is_exposed_by_hidden_ones() {
    let tuned = with_variant(&adapter_with(TUNED), 1);
    cards(&tuned, &["out"]).exits(0).prints("3 renderers, 3 releases, 1 capabilities, 1 run");
    let cell = cell(&tuned, "mine");
    assert_eq!(cell["standing"]["state"], "wrong", "{cell}");
    assert!(cell["explanation"].as_str().unwrap().starts_with("right in the public cases only"), "{cell}");
    assert_eq!(
        (&cell["spread"]["is_public_only"], &cell["spread"]["seeds"]),
        (&Value::from(true), &serde_json::json!([11]))
    );
    let public = cell["spread"]["public"]["deviation"]["value"].as_f64().unwrap();
    let hidden = cell["spread"]["hidden"]["deviation"]["value"].as_f64().unwrap();
    assert!(public.abs() < 1e-6 && (hidden - 0.05).abs() < 1e-6, "{public} {hidden}");
    assert!(tuned.read("site/renderers/mine/direct.html").contains("hidden, seed 11"));
    assert!(tuned.read("site/index.html").contains("Seed: 11."));
}

#[test]
fn an_honest_adapter_is_accurate_in_public_and_hidden_cases() {
    let honest = with_variant(&adapter(), 0);
    cards(&honest, &["out"]).exits(0);
    let cell = cell(&honest, "mine");
    assert_eq!(cell["standing"]["state"], "accurate", "{cell}");
    assert_eq!((&cell["tested_cases"], &cell["hidden_variants"]), (&Value::from(1), &Value::from(1)));
    assert!(cell["standing"]["worst"]["deviation"]["value"].as_f64().unwrap().abs() < 1e-6);
    // What the cell leads to.
    let run = honest.json("site/cards.json")["runs"][0].clone();
    for file in ["report", "bundle"] {
        let place = format!("site/{}", run[file].as_str().unwrap());
        assert!(honest.path(&place).is_file(), "no {place}");
    }
    let bundle = format!("site/{}", run["bundle"].as_str().unwrap());
    honest.luxproof(&["reproduce", &bundle, "--trusted"]).exits(0).prints("6 to the byte");
}

/// A site of the public case by another adapter, and a submission as a bundle.
fn submission(adapter: &str) -> Folder {
    submission_that_exits(adapter, 0)
}

fn submission_that_exits(adapter: &str, code: i32) -> Folder {
    let folder = folder(adapter);
    fs::create_dir_all(folder.path("site-run")).unwrap();
    folder.run(&[]).exits(code);
    folder.luxproof(&["bundle", "out", "--out", "mine.zip"]).exits(0);
    folder.write("site-run/spec.yaml", &[ROOM, TWO_METERS, DIRECT].concat());
    folder.write("site-run/lamp.ies", LAMP);
    folder.luxproof(&["run", "site-run/spec.yaml", "--engines", "iesna", "--no-calibration", "--out", "own"]).exits(0);
    cards(&folder, &["own"]).exits(0);
    folder
}

#[test]
fn a_submission_that_reproduces_is_added_with_hidden_variants_by_the_publisher() {
    let folder = submission(&adapter());
    folder
        .luxproof(&["cards", "add", "mine.zip", "--site", "site", "--trusted", "--seed", "5"])
        .exits(0)
        .prints("added");
    let cell = cell(&folder, "mine");
    assert_eq!(cell["standing"]["state"], "accurate", "{cell}");
    assert_eq!((&cell["hidden_variants"], &cell["spread"]["seeds"]), (&Value::from(1), &serde_json::json!([5])));
    let runs = folder.json("site/cards.json")["runs"].to_string();
    assert!(runs.contains("\"verification\":\"reproduced\"") && runs.contains("\"same_bytes\":3"), "{runs}");
    assert_eq!(cell_count(&folder), 3);
}

/// How many renderers the site has.
fn cell_count(folder: &Folder) -> usize {
    folder.json("site/cards.json")["renderers"].as_array().unwrap().len()
}

#[test]
fn a_tuned_submission_is_exposed_by_the_publishers_variants() {
    let folder = submission(&adapter_with(TUNED));
    folder.luxproof(&["cards", "add", "mine.zip", "--site", "site", "--trusted"]).exits(0);
    assert_eq!(cell(&folder, "mine")["standing"]["state"], "wrong");
}

#[test]
fn what_does_not_reproduce_is_refused_with_its_reason_and_changes_nothing() {
    let folder = submission(&adapter_with(UNREPEATABLE));
    let before = folder.read("site/cards.json");
    let refused = folder.luxproof(&["cards", "add", "mine.zip", "--site", "site", "--trusted"]).exits(1);
    assert!(
        refused.message().contains("not added: mine.zip: 1 of 3 procedures do not reproduce; mine direct_illuminance"),
        "{refused:?}"
    );
    assert_eq!(folder.read("site/cards.json"), before);
    // Without trust its program does not run at all.
    folder.luxproof(&["cards", "add", "mine.zip", "--site", "site"]).exits(2);
    assert_eq!(folder.read("site/cards.json"), before);
}

/// Writes `SHA256SUMS` of a bundle anew for its report.
fn seal_report(folder: &Folder, bundle: &str) {
    let report = fs::read(folder.path(&format!("{bundle}/run/report.json"))).unwrap();
    let digest = hexadecimal(&Sha256::digest(report));
    let sums = folder.read(&format!("{bundle}/SHA256SUMS"));
    let line = |line: &str| {
        if line.ends_with("  run/report.json") { format!("{digest}  run/report.json\n") } else { format!("{line}\n") }
    };
    folder.write(&format!("{bundle}/SHA256SUMS"), &sums.lines().map(line).collect::<String>());
}

#[test]
fn what_a_submitted_report_says_beyond_its_readings_is_not_published() {
    let folder = submission_that_exits(&adapter_with(BRIGHT), 1);
    folder.luxproof(&["bundle", "out", "--out", "forged"]).exits(0);
    let path = folder.path("forged/run/report.json");
    let mut report = luxproof_report_file::read(&path).unwrap();
    for comparison in report.comparisons.iter_mut().filter(|c| *c.key.engine == *"mine") {
        comparison.verdict = luxproof_model::Verdict::Undecided;
    }
    luxproof_report_file::keep(&mut report, &path).unwrap();
    seal_report(&folder, "forged");
    folder.luxproof(&["cards", "add", "forged", "--site", "site", "--trusted"]).exits(0);
    assert_eq!(cell(&folder, "mine")["standing"]["state"], "wrong");
}

#[test]
fn a_submission_of_another_case_by_the_same_name_is_refused() {
    let folder = folder(&adapter());
    folder.run(&[]).exits(0);
    cards(&folder, &["out"]).exits(0);
    folder.edit("spec.yaml", "[1, 1, 0.8]", "[1, 1.5, 0.8]");
    folder.luxproof(&["run", "spec.yaml", "--out", "easier", "--no-calibration"]).exits(0);
    folder.luxproof(&["bundle", "easier", "--out", "easier.zip"]).exits(0);
    let refused = folder.luxproof(&["cards", "add", "easier.zip", "--site", "site", "--trusted"]).exits(1);
    assert!(
        refused.message().contains("direct_illuminance of spec measures something else than the public case"),
        "{refused:?}"
    );
}

#[test]
fn recorded_values_are_marked_as_what_cannot_be_run_again() {
    let recorded = "engines: {iray: {readings: iray.csv, version: \"2016\"}}\n";
    let folder = Folder::new(&[
        ("spec.yaml", &[ROOM, TWO_METERS, DIRECT, recorded].concat()),
        ("lamp.ies", LAMP),
        ("capabilities.yaml", CAPABILITIES),
        ("iray.csv", "procedure,meter,value\ndirect_illuminance,plane[0],6.32\ndirect_illuminance,plane[1],34.60\n"),
    ]);
    folder.run(&[]).exits(0);
    cards(&folder, &["out"]).exits(0);
    assert!(folder.read("site/renderers/iray/direct.html").contains("This release cannot be run again"));
    assert!(folder.read("site/index.html").contains("recorded values"));
}

#[test]
fn a_folder_of_other_files_is_not_replaced_and_wrong_input_says_what_to_do() {
    let folder = folder(&adapter());
    folder.run(&[]).exits(0);
    fs::create_dir_all(folder.path("site")).unwrap();
    folder.write("site/thesis.tex", "years of work");
    let answer = cards(&folder, &["out"]).exits(2);
    assert!(answer.message().contains("holds files and no site of score cards"), "{answer:?}");
    assert_eq!(folder.read("site/thesis.tex"), "years of work");
    folder.luxproof(&["cards", "out"]).exits(2).complains("--out");
    folder.luxproof(&["cards", "add", "x.zip", "--site", "nowhere"]).exits(2);
    folder.edit("capabilities.yaml", "minimum_cases: 1", "minimum_cases: 9");
    let answer = folder.luxproof(&["cards", "out", "--capabilities", "capabilities.yaml", "--out", "other"]).exits(2);
    assert!(answer.message().contains("9 of 1 cases are needed"), "{answer:?}");
}

/// The pages of a site: their paths below it, without the reports of runs.
fn pages(folder: &Folder, below: &str) -> Vec<String> {
    let mut found = vec![];
    for entry in fs::read_dir(folder.path(&format!("site/{below}"))).unwrap() {
        let entry = entry.unwrap();
        let name = format!("{below}{}", entry.file_name().to_str().unwrap());
        if entry.path().is_dir() {
            found.extend(pages(folder, &format!("{name}/")));
        } else if entry.path().extension().is_some_and(|extension| extension == "html") && !name.starts_with("runs/") {
            found.push(name);
        }
    }
    found
}

/// The texts between two others in a page.
fn between<'a>(page: &'a str, start: &str, end: &str) -> Vec<&'a str> {
    page.split(start).skip(1).filter_map(|rest| rest.split(end).next()).collect()
}

/// Unpacks a bundle of the site to a folder next to it.
fn unpack(folder: &Folder, zip: &str) {
    let file = fs::File::open(folder.path(zip)).unwrap();
    zip::ZipArchive::new(file).unwrap().extract(folder.path("bundle")).unwrap();
}

/// Runs a line of a page in the unpacked bundle and returns what it prints.
fn run_line(folder: &Folder, line: &str) -> String {
    let words: Vec<&str> = line.split_whitespace().collect();
    let (program, args) = words.split_first().unwrap();
    assert_eq!(*program, "luxproof", "{line}");
    let mut command = folder.command(args);
    let answer = Answer::of(command.current_dir(folder.path("bundle")));
    assert_eq!(answer.code, Some(0), "{line}: {answer:?}");
    answer.stdout
}

#[test]
fn every_link_file_and_command_of_a_site_works_from_the_site_alone() {
    let folder = with_variant(&adapter(), 0);
    cards(&folder, &["out"]).exits(0);
    let bundle = folder.json("site/cards.json")["runs"][0]["bundle"].as_str().unwrap().to_owned();
    unpack(&folder, &format!("site/{bundle}"));
    // Whatever the run was made of is gone: only the site is left.
    for name in ["spec.yaml", "lamp.ies", "adapter.py"] {
        fs::remove_file(folder.path(name)).unwrap();
    }
    for name in ["hidden", "out"] {
        fs::remove_dir_all(folder.path(name)).unwrap();
    }
    let all = pages(&folder, "");
    assert!(all.iter().any(|page| page == "hidden.html") && all.len() >= 6, "{all:?}");
    let (mut links, mut lines) = (0, vec![]);
    for page in &all {
        let text = folder.read(&format!("site/{page}"));
        for link in between(&text, " href=\"", "\"") {
            let path = link.split('#').next().unwrap();
            let target = folder.path(&format!("site/{page}")).parent().unwrap().join(path);
            assert!(path.is_empty() || target.is_file(), "{page}: no {link}");
            links += 1;
        }
        for code in between(&text, "<pre class=\"commands\" tabindex=\"0\"><code>", "</code>") {
            lines.extend(code.lines().map(str::to_owned));
        }
        assert!(!text.contains(folder.path("").to_str().unwrap()), "{page} has a path of the machine that ran it");
    }
    assert!(links > 40, "{links}");
    lines.sort();
    lines.dedup();
    let unpacking: Vec<String> = lines.extract_if(.., |line| line.starts_with("unzip ")).collect();
    assert_eq!(unpacking, ["unzip -q bundle.zip -d bundle &amp;&amp; cd bundle"]);
    let of_adapter: Vec<&String> = lines.iter().filter(|line| line.contains("--engine mine ")).collect();
    assert_eq!(of_adapter.len(), 2, "the public case and its variant: {lines:?}");
    for line in &lines {
        for file in line.split_whitespace().filter(|word| word.starts_with("inputs/")) {
            assert!(folder.path(&format!("bundle/{file}")).is_file(), "{line}");
        }
        let printed = run_line(&folder, line);
        if let Some(by_hand) = printed.lines().find(|line| line.trim_start().starts_with("cd ")) {
            let mut shell = std::process::Command::new("sh");
            let answer = Answer::of(shell.args(["-c", by_hand]).current_dir(folder.path("bundle")));
            assert!(answer.code == Some(0) && answer.stdout.contains("readings"), "{by_hand}: {answer:?}");
        }
    }
}
