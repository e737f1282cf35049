//! Bundles, plans, policies, scenes and archives of strangers: they reach nothing outside of themselves, loosen no verdict, and cost no
//! more than their size.

use std::fs;
use std::io::Write;
use std::os::unix::ffi::OsStrExt;
use std::os::unix::fs::{MetadataExt, PermissionsExt, symlink};
use std::path::Path;
use std::process::Command;

use serde_json::{Value, json};
use sha2::{Digest, Sha256};

use crate::support::{Answer, Folder, LAMP, MINE, OWN, ROOM, TWO_METERS, adapter, root};

const DIRECT: &str = "procedures:\n  direct_illuminance: {meters: plane}\n";
const SECRET: &str = "SECRET-93f1";

/// A published table that no engine agrees with.
const WRONG_TABLE: &str = "luxproof_published: 1
citation: {title: a paper}
rounding: {units_in_last_digit: 1}
tables:
  direct_illuminance:
    name: lux
    quantity: illuminance_lx
    columns: {c: {reference: true, engine: x, model: point, meaning: lux}}
    rows:
      - {at_m: [1, 1, 0.8], normal: [0, 0, 1], cells: {c: \"9.00\"}}
";

fn spec() -> String {
    [ROOM, TWO_METERS, DIRECT].concat()
}

fn room() -> Folder {
    Folder::new(&[("spec.yaml", &spec()), ("lamp.ies", LAMP)])
}

/// A file outside of what a stranger gave, which nothing may show.
fn outside() -> (Folder, String) {
    let folder = Folder::new(&[("secret.yaml", &format!("{SECRET}: {SECRET}\n"))]);
    let path = folder.path("secret.yaml").display().to_string();
    (folder, path)
}

#[track_caller]
fn tells_no_secret(answer: &Answer) {
    let said = answer.stdout.clone() + &answer.stderr;
    assert!(!said.contains(SECRET), "{said}");
}

/// Whether a message has these words, however long its lines are.
#[track_caller]
fn says(answer: &Answer, words: &str) {
    assert!(answer.message().contains(words), "no `{words}` in {answer:?}");
}

/// Makes the hashes of a bundle right again, as nobody does by accident.
pub(crate) fn seal(bundle: &Path) {
    let hash = |name: &str| {
        let bytes = fs::read(bundle.join(name)).unwrap();
        Sha256::digest(bytes).iter().fold(String::new(), |hash, byte| hash + &format!("{byte:02x}"))
    };
    let about = bundle.join("ro-crate-metadata.json");
    let mut described: Value = serde_json::from_slice(&fs::read(&about).unwrap()).unwrap();
    for entity in described["@graph"].as_array_mut().unwrap() {
        if entity.get("sha256").is_some() {
            entity["sha256"] = hash(entity["name"].as_str().unwrap()).into();
        }
    }
    fs::write(&about, format!("{described:#}\n")).unwrap();
    let sums = fs::read_to_string(bundle.join("SHA256SUMS")).unwrap();
    let lines =
        sums.lines().map(|line| line.split_once("  ").unwrap().1).map(|name| format!("{}  {name}\n", hash(name)));
    fs::write(bundle.join("SHA256SUMS"), lines.collect::<Vec<_>>().concat()).unwrap();
}

fn change_json(path: &Path, change: impl FnOnce(&mut Value)) {
    let mut value: Value = serde_json::from_slice(&fs::read(path).unwrap()).unwrap();
    change(&mut value);
    fs::write(path, format!("{value:#}\n")).unwrap();
}

#[test]
fn a_bundle_names_no_policy_outside_of_itself_whoever_trusts_it() {
    let (folder, (_kept, secret)) = (room(), outside());
    folder.run(&["--engines", OWN]).exits(0);
    folder.luxproof(&["bundle", "out", "--out", "evil"]).exits(0);
    for policy in [secret.as_str(), "/proc/self/environ", "../secret.yaml"] {
        change_json(&folder.path("evil/lock.json"), |lock| lock["request"]["policy"] = policy.into());
        seal(&folder.path("evil"));
        for trust in [&[][..], &["--untrusted"], &["--trusted"]] {
            let answer = folder.luxproof(&[&["reproduce", "evil"], trust].concat()).exits(2);
            tells_no_secret(&answer);
            assert!(answer.message().contains("lock.json names a policy, and no bundle does"), "{answer:?}");
            assert!(!answer.stderr.contains("LUXPROOF_CACHE="), "{answer:?}");
        }
    }
    // Its own policy lies among its inputs, and is followed.
    change_json(&folder.path("evil/lock.json"), |lock| lock["request"]["policy"] = Value::Null);
    seal(&folder.path("evil"));
    folder.luxproof(&["reproduce", "evil"]).exits(0).prints("reproduced");
}

#[test]
fn a_plan_that_is_not_trusted_names_files_below_its_folder_alone() {
    let (folder, (_kept, secret)) = (room(), outside());
    let plan = folder.luxproof(&["plan", "--untrusted", "spec.yaml", "--engines", OWN, "--no-calibration", "--json"]);
    folder.write("plan.json", &plan.exits(0).stdout);
    let whole = folder.json("plan.json");
    let job = whole["jobs"][0]["id"].as_str().unwrap().to_owned();
    let read = |more: &[&str]| folder.luxproof(&[&["read", "--untrusted", &job], more].concat());
    read(&[]).exits(0).prints("read ");
    let changed = |key: &str, value: Value| {
        let mut plan = whole.clone();
        plan["asked"][key] = value;
        folder.write("plan.json", &plan.to_string());
    };
    for policy in [secret.as_str(), "/etc/passwd", "luxproof.yaml"] {
        changed("policy", policy.into());
        let answer = read(&[]).exits(2);
        tells_no_secret(&answer);
        assert!(
            answer.message().contains("names the policy") && answer.message().contains("not trusted"),
            "{answer:?}"
        );
    }
    folder.write("own.yaml", "required_engines: [simulator]\n");
    read(&["--policy", "own.yaml"]).exits(0);
    symlink(&secret, folder.path("link.yaml")).unwrap();
    fs::create_dir(folder.path("below")).unwrap();
    for spec in [secret.as_str(), "../*.yaml", "link.yaml", "/etc/passwd", "below/../../x*/secret.yaml"] {
        changed("specs", json!([spec]));
        let answer = read(&[]).exits(2);
        tells_no_secret(&answer);
        assert!(answer.message().contains("is not used"), "{spec}: {answer:?}");
    }
    changed("specs", json!(vec!["spec.yaml"; 101]));
    read(&[]).exits(2).complains("names more than 100 specs");
    // Whoever trusts a plan may name another folder.
    changed("specs", json!([folder.path("spec.yaml")]));
    let there = folder.path("").display().to_string();
    let below = folder.path("below");
    let from_below = |more: &[&str]| {
        let args = [&["read", "--untrusted", &job, "--plan", "../plan.json"], more].concat();
        Answer::of(folder.command(&args).current_dir(&below))
    };
    from_below(&[]).exits(2).complains("is not used");
    from_below(&["--below", &there]).exits(0);
}

#[test]
fn a_report_of_a_stranger_has_no_file_of_elsewhere_bundled_or_quoted() {
    let (folder, (kept, secret)) = (room(), outside());
    folder.run(&["--engines", OWN]).exits(0);
    folder.luxproof(&["--untrusted", "bundle", "out", "--out", "sound"]).exits(0);
    let bundle = |more: &[&str]| folder.luxproof(&[&["bundle", "out", "--out", "b"], more].concat());
    // A stranger makes the checksum right again.
    let mut report: luxproof_model::Report = serde_json::from_value(folder.report()).unwrap();
    report.spec.path.clone_from(&secret);
    for case in &mut report.cases {
        case.spec.path.clone_from(&secret);
    }
    luxproof_report_file::keep(&mut report, &folder.path("out/report.json")).unwrap();
    let answer = bundle(&["--untrusted"]).exits(2);
    tells_no_secret(&answer);
    assert!(answer.message().contains("is not used") && !folder.path("b").exists(), "{answer:?}");
    assert!(bundle(&[]).exits(2).stderr.contains(SECRET), "the user's own report names the user's own files");
    drop(kept);
}

/// The commands of the emitted workflow, as its rules give them to a shell.
fn rule(folder: &Folder, command: &str, key: &str, rest: &str) -> Answer {
    let words = folder.json("flow/config.json")[key].as_str().unwrap().to_owned();
    let line = format!("\"$0\" --cache-dir cache {command} {words} {rest}");
    let mut shell = Command::new("sh");
    shell.args(["-c", &line]).arg(env!("CARGO_BIN_EXE_luxproof")).current_dir(folder.path("flow")).env("NO_COLOR", "1");
    Answer::of(shell.env("LUXPROOF_ENGINES", folder.path("engines")).env_remove("LUXPROOF_UNTRUSTED"))
}

#[test]
fn every_rule_of_an_emitted_workflow_keeps_the_mode() {
    let folder = room();
    let emit = ["plan", "--untrusted", "spec.yaml", "--engines", OWN, "--no-calibration", "--emit", "snakemake"];
    folder.luxproof(&[&emit[..], &["--out", "flow"]].concat()).exits(0);
    // Each rule that starts luxproof takes its words from one of the two lists.
    let workflow = folder.read("flow/Snakefile");
    let started: Vec<&str> = workflow.lines().filter(|line| line.trim().starts_with("luxproof ")).collect();
    assert_eq!(started.len(), 3, "{started:?}");
    for line in started {
        assert!(line.contains("{params.asked}") || line.contains("{params.reading}"), "{line}");
    }
    for list in
        ["params:\n        cache=config[\"cache\"],\n        reading=config[\"reading\"]", "asked=config[\"asked\"]"]
    {
        assert!(workflow.contains(list), "{list}");
    }
    let plan = rule(&folder, "plan", "asked", "--json").exits(0);
    folder.write("flow/plan.json", &plan.stdout);
    let job = folder.json("flow/plan.json")["jobs"][0]["id"].as_str().unwrap().to_owned();
    rule(&folder, "read", "reading", &format!("--plan plan.json {job}")).exits(0);
    // The spec gains a program once the workflow is written.
    let command = "engines:\n  mine: {command: [touch, pwned]}\n";
    folder.write("spec.yaml", &(spec() + command));
    for (word, key, rest) in [
        ("plan", "asked", "--json".to_owned()),
        ("read", "reading", format!("--plan plan.json {job}")),
        ("report --from cache", "asked", "--out report".to_owned()),
    ] {
        let answer = rule(&folder, word, key, &rest).exits(2);
        assert!(answer.message().contains("it would run a program, and the spec is not trusted"), "{word}: {answer:?}");
    }
    assert!(!folder.path("pwned").exists() && !folder.path("flow/pwned").exists());
}

#[test]
fn a_pull_request_turns_no_red_into_green() {
    let folder = Folder::new(&[]);
    fs::create_dir(folder.path("proposed")).unwrap();
    folder.write("proposed/lamp.ies", LAMP);
    folder.write("proposed/table.yaml", WRONG_TABLE);
    let honest = spec() + "published: table.yaml\n";
    let run = |more: &[&str]| {
        let args = ["run", "proposed/spec.yaml", "--engines", OWN, "--no-calibration", "--out", "out"];
        folder.luxproof(&[&args[..], more].concat())
    };
    folder.write("proposed/spec.yaml", &honest);
    run(&["--untrusted"]).exits(1);
    // By its own tolerances, beside a policy of the user's or without.
    folder.write("proposed/spec.yaml", &(honest.clone() + "tolerances: {direct_illuminance: {relative: 1000}}\n"));
    run(&[]).exits(0);
    let answer = run(&["--untrusted"]).exits(1);
    assert!(answer.message().contains("it counts only where it is narrower"), "{answer:?}");
    let rule = |relative: f64| {
        format!(
            "tolerances: [{{procedure: direct_illuminance, basis: published, relative: {relative}, source: decided}}]\n"
        )
    };
    folder.write("strict.yaml", &rule(0.01));
    run(&["--untrusted", "--policy", "strict.yaml"]).exits(1);
    // By a policy beside the spec, which takes the place of the reviewed one above it.
    folder.write("proposed/spec.yaml", &honest);
    folder.write("proposed/luxproof.yaml", &rule(1000.0));
    run(&[]).exits(0);
    let answer = run(&["--untrusted"]).exits(1);
    assert!(answer.message().contains("proposed/luxproof.yaml: is ignored"), "{answer:?}");
    let answer = folder.luxproof(&["check", "--untrusted", "proposed/spec.yaml", "--engines", OWN]).exits(0);
    assert!(answer.message().contains("proposed/luxproof.yaml: is ignored"), "{answer:?}");
    // By one in the folder of the run itself, which only narrows unless it is named.
    fs::rename(folder.path("proposed/luxproof.yaml"), folder.path("luxproof.yaml")).unwrap();
    run(&[]).exits(0);
    let answer = run(&["--untrusted"]).exits(1);
    assert!(answer.message().contains("luxproof.yaml: only narrows tolerances"), "{answer:?}");
    run(&["--untrusted", "--policy", "luxproof.yaml"]).exits(0);
    // A stranger may be stricter.
    let right = WRONG_TABLE.replace("9.00", &lux(&folder));
    folder.write("proposed/table.yaml", &right);
    fs::remove_file(folder.path("luxproof.yaml")).unwrap();
    run(&["--untrusted"]).exits(0);
    folder.write("luxproof.yaml", "required_engines: [mitsuba]\n");
    run(&["--untrusted"]).exits(3);
}

/// What the simulator reads at the meter of the table, in its digits.
fn lux(folder: &Folder) -> String {
    let readings = folder.report()["readings"].as_array().unwrap().clone();
    let value = readings.iter().find_map(|r| r["value"].as_f64()).or_else(|| {
        let report = folder.report();
        report["comparisons"].as_array()?.iter().find_map(|c| c["value"].as_f64())
    });
    format!("{:.2}", value.unwrap())
}

#[test]
fn known_deviations_of_a_stranger_excuse_nothing() {
    let folder = room();
    folder.write("table.yaml", WRONG_TABLE);
    folder.write("spec.yaml", &(spec() + "published: table.yaml\n"));
    folder.run(&["--engines", OWN]).exits(1);
    let report = folder.report();
    let off = report["comparisons"]
        .as_array()
        .unwrap()
        .iter()
        .find_map(|c| c["relative_deviation"].as_f64().filter(|d| d.abs() > 1e-3))
        .unwrap();
    let entry = |engine: &str| {
        format!(
            "  - {{engine: {engine}, procedure: direct_illuminance, basis: published, expected: {off}, uncertainty: {}, cause: x, source: y}}\n",
            off.abs() / 3.0
        )
    };
    folder.write("luxproof.yaml", &format!("known_deviations:\n{}{}", entry("simulator"), entry("iesna")));
    folder.run(&["--engines", OWN]).exits(0);
    folder.run(&["--engines", OWN, "--untrusted"]).exits(1);
    folder.run(&["--engines", OWN, "--untrusted", "--policy", "luxproof.yaml"]).exits(0);
}

#[test]
fn linked_folders_are_not_followed_and_their_files_not_quoted() {
    let secret = Folder::new(&[("spec.yaml", &format!("luxproof: 1\ntoken: {SECRET}\n")), ("lamp.ies", LAMP)]);
    let folder = room();
    fs::create_dir(folder.path("specs")).unwrap();
    symlink(secret.path(""), folder.path("specs/linked")).unwrap();
    fs::create_dir(secret.path("deep")).unwrap();
    fs::copy(secret.path("spec.yaml"), secret.path("deep/spec.yaml")).unwrap();
    fs::create_dir(folder.path("flow")).unwrap();
    // From a folder beside it, too.
    for asked in ["../specs/linked/deep/spec.yaml", "../specs/*/deep/spec.yaml", ".././specs/linked/spec.yaml"] {
        let mut check = folder.command(&["check", "--untrusted", asked, "--engines", OWN]);
        let answer = Answer::of(check.current_dir(folder.path("flow"))).exits(2);
        tells_no_secret(&answer);
        assert!(answer.message().contains("is a link"), "{asked}: {answer:?}");
    }
    for asked in ["specs/linked/spec.yaml", "specs/*/spec.yaml", "specs/linked", "./specs/linked/deep/spec.yaml"] {
        let answer = folder.luxproof(&["check", "--untrusted", asked, "--engines", OWN]).exits(2);
        tells_no_secret(&answer);
        assert!(answer.message().contains("is a link"), "{asked}: {answer:?}");
        // The user's own may lie wherever links lead.
        let own = folder.luxproof(&["check", asked, "--engines", OWN]).exits(2);
        assert!(own.stderr.contains("token"), "{own:?}");
    }
}

#[test]
fn no_message_quotes_a_file_that_is_no_spec() {
    let hidden = |text: &str| text.replace("WORD", SECRET);
    for (file, text, more) in [
        (".env", hidden("IESNA:LM-63-2002\nTILT=NONE\n1 WORD 1 3 1\n"), "photometry"),
        (".env", hidden("TOKEN=WORD\n"), "photometry"),
        (".env", hidden("luxproof_published: 1\nWORD: 1\n"), "published"),
        (".env", hidden("luxproof_published: \"WORD\"\n"), "published"),
        (".env", hidden("v 0 0 WORD\n"), "mesh"),
        (".env", hidden("v 0 0 0\nf 1 2 WORD\n"), "mesh"),
        // What is quoted holds quotes itself, and keys, names and places stand in messages unquoted.
        (".env", hidden("IESNA:LM-63-2002\nTILT=NONE\n1 a`WORD`b 1 3 1\n"), "photometry"),
        (".env", hidden("IESNA:LM-63-2002\nTILT=WORD\n1 1 1 3 1\n"), "photometry"),
        (".env", hidden("luxproof_published: 1\ncitation: {title: x}\ntables: {WORD: {WORD: 1}}\n"), "published"),
        (".env", hidden("a`WORD`b,meter,value\n"), "readings"),
        (".env", hidden("procedure,meter,value\ndirect_illuminance,WORD,1\ndirect_illuminance,WORD,1\n"), "readings"),
        (".env", hidden("procedure,meter,value\ndirect_illuminance,WORD,1\n"), "readings"),
    ] {
        let folder = room();
        folder.write(file, &text);
        let spec = match more {
            "photometry" => spec().replace("lamp.ies", file),
            "mesh" => spec()
                .replace("meters:\n", &format!("obstacles:\n  - mesh: {{file: {file}, reflectance: 0.5}}\nmeters:\n")),
            "readings" => spec() + "engines: {x: {readings: .env}}\n",
            _ => spec() + "published: .env\n",
        };
        folder.write("spec.yaml", &spec);
        let answer = folder.luxproof(&["check", "--untrusted", "spec.yaml", "--engines", OWN]).exits(2);
        tells_no_secret(&answer);
        assert!(answer.stderr.contains(file), "the file is named: {answer:?}");
        // What is quoted are lines of the spec.
        let misspelt = spec.replace("size_m", "sizes_m");
        folder.write("spec.yaml", &misspelt);
        folder
            .luxproof(&["check", "--untrusted", "spec.yaml", "--engines", OWN])
            .exits(2)
            .complains("sizes_m: [6, 4, 3]");
    }
    let folder = Folder::new(&[("a.ies", &format!("IESNA:LM-63-2002\nTILT=NONE\n1 {SECRET} 1 3 1\n"))]);
    for more in [&[][..], &["--json"], &["--lint"], &["--lint", "--format", "sarif"]] {
        let answer = folder.luxproof(&[&["photometry", "a.ies", "--untrusted"], more].concat()).exits(2);
        tells_no_secret(&answer);
    }
    folder.luxproof(&["photometry", "a.ies"]).exits(2).complains(SECRET);
}

#[test]
fn names_that_would_begin_a_line_of_a_log_or_colour_a_terminal_are_refused_and_not_repeated() {
    for name in ["a\n::add-mask::x.yaml", "a\u{1b}[8mb.yaml", "a\r::error::x.yaml"] {
        let folder = room();
        fs::rename(folder.path("spec.yaml"), folder.path(name)).unwrap();
        let answer = folder.luxproof(&["check", "--untrusted", "--engines", OWN, "--", name]).exits(2);
        assert!(answer.message().contains("characters that do not print"), "{answer:?}");
        let said = answer.stdout + &answer.stderr;
        assert!(!said.contains('\u{1b}') && !said.lines().any(|line| line.starts_with("::")), "{said}");
    }
}

#[test]
fn a_folder_of_a_run_that_a_stranger_filled_with_links_is_not_written() {
    for name in [".luxproof.lock", "logs", "scenes", "readings", "report-pages"] {
        let (folder, (kept, secret)) = (room(), outside());
        fs::create_dir(folder.path("out")).unwrap();
        let target = if name == ".luxproof.lock" {
            secret.clone()
        } else {
            Path::new(&secret).parent().unwrap().display().to_string()
        };
        symlink(target, folder.path("out").join(name)).unwrap();
        let answer = folder.run(&["--untrusted", "--engines", OWN]).exits(2);
        assert!(answer.message().contains("it is a link, and the specs are not trusted"), "{answer:?}");
        assert!(fs::read_to_string(&secret).unwrap().contains(SECRET));
        assert_eq!(fs::read_dir(kept.path("")).unwrap().count(), 1, "{name}");
    }
    for command in ["bench", "stress"] {
        let (folder, (kept, secret)) = (room(), outside());
        symlink(Path::new(&secret).parent().unwrap(), folder.path("out")).unwrap();
        let measure = [command, "--untrusted", "spec.yaml", "--engines", "simulator", "--out", "out"];
        says(&folder.luxproof(&measure).exits(2), "it is a link, and the specs are not trusted");
        assert_eq!(fs::read_dir(kept.path("")).unwrap().count(), 1, "{command}");
    }
    // The lock file belongs to the folder, for trusted specs too.
    let (folder, (_kept, secret)) = (room(), outside());
    fs::create_dir(folder.path("out")).unwrap();
    symlink(&secret, folder.path("out/.luxproof.lock")).unwrap();
    folder.run(&["--engines", OWN]).exits(2);
    assert!(fs::read_to_string(&secret).unwrap().contains(SECRET));
    let (folder, (kept, secret)) = (room(), outside());
    symlink(Path::new(&secret).parent().unwrap(), folder.path("out")).unwrap();
    folder.run(&["--untrusted", "--engines", OWN]).exits(2).complains("is a link");
    assert_eq!(fs::read_dir(kept.path("")).unwrap().count(), 1);
}

#[test]
fn recorded_readings_of_a_stranger_satisfy_no_requirement_and_cost_little() {
    let recorded = "engines: {mine: {readings: a.csv}}\n";
    let folder = room();
    folder.write("spec.yaml", &(spec() + recorded));
    let csv = |value: &str| {
        format!("procedure,meter,value\ndirect_illuminance,plane[1],34.60\ndirect_illuminance,plane[0],{value}\n")
    };
    folder.write("a.csv", &csv("6.32"));
    folder.run(&["--untrusted"]).exits(0);
    folder.write("luxproof.yaml", "required_engines: [mine]\n");
    folder.run(&["--untrusted"]).exits(3);
    fs::remove_file(folder.path("luxproof.yaml")).unwrap();
    // A last digit that no number has, and an error that is larger than any.
    for value in ["1.5e-2147483648", "0e2147483647", "0.0e400"] {
        folder.write("a.csv", &csv(value));
        folder.run(&["--untrusted"]).exits(1);
    }
    let many = |count: usize| (0..count).fold(String::new(), |all, k| all + &format!("  e{k}: {{readings: a.csv}}\n"));
    folder.write("a.csv", &csv("6.32"));
    folder.write("spec.yaml", &(spec() + "engines:\n" + &many(50)));
    folder.run(&["--untrusted"]).exits(0);
    folder.write("spec.yaml", &(spec() + "engines:\n" + &many(51)));
    folder.run(&["--untrusted"]).exits(2).complains("51 recorded readings are more");
}

/// A zip all files of which are one stored payload.
fn overlapping(files: u32, bytes: u32) -> Vec<u8> {
    let data = vec![0_u8; bytes as usize];
    let crc = {
        let mut zip = zip::ZipWriter::new(std::io::Cursor::new(vec![]));
        zip.start_file(
            "a",
            zip::write::SimpleFileOptions::default().compression_method(zip::CompressionMethod::Stored),
        )
        .unwrap();
        zip.write_all(&data).unwrap();
        let whole = zip.finish().unwrap().into_inner();
        <[u8; 4]>::try_from(&whole[14..18]).unwrap()
    };
    let (first, mut out) = ("inputs/000000", vec![]);
    let sizes = [crc, bytes.to_le_bytes(), bytes.to_le_bytes()].concat();
    let version = [20_u16.to_le_bytes(), [0; 2], [0; 2], [0; 2], 33_u16.to_le_bytes()].concat();
    out.extend(
        [&b"PK\x03\x04"[..], &version, &sizes, &(first.len() as u16).to_le_bytes(), &[0; 2], first.as_bytes(), &data]
            .concat(),
    );
    let start = out.len() as u32;
    for k in 0..files {
        let name = format!("inputs/{k:06}");
        let mode = (0o100_644_u32 << 16).to_le_bytes();
        let head =
            [&b"PK\x01\x02"[..], &0x031e_u16.to_le_bytes(), &version, &sizes, &(name.len() as u16).to_le_bytes()]
                .concat();
        out.extend(
            [&head[..], &[0; 2], &[0; 2], &[0; 2], &[0; 2], &mode, &0_u32.to_le_bytes(), name.as_bytes()].concat(),
        );
    }
    let (size, count) = (out.len() as u32 - start, (files as u16).to_le_bytes());
    out.extend(
        [&b"PK\x05\x06"[..], &[0; 4], &count, &count, &size.to_le_bytes(), &start.to_le_bytes(), &[0; 2]].concat(),
    );
    out
}

#[test]
fn archives_that_overlap_are_refused_before_anything_is_written() {
    let folder = Folder::new(&[]);
    fs::write(folder.path("o.zip"), overlapping(400, 1 << 18)).unwrap();
    let temporary = folder.path("tmp");
    fs::create_dir(&temporary).unwrap();
    let mut calls = Command::new("sh");
    // No file of the payload's size could be written.
    calls.args(["-c", "ulimit -f 64 && exec \"$0\" reproduce o.zip"]).arg(env!("CARGO_BIN_EXE_luxproof"));
    let answer = Answer::of(calls.current_dir(folder.path("")).env("TMPDIR", &temporary).env("NO_COLOR", "1")).exits(2);
    let said = answer.message();
    assert!(said.contains("files of the archive overlap") && said.contains("is not unpacked"), "{answer:?}");
}

#[test]
fn a_page_that_lies_in_a_bundle_is_not_opened_and_the_bundle_stays_whole() {
    let folder = room();
    folder.run(&["--engines", OWN]).exits(0);
    folder.luxproof(&["bundle", "out", "--out", "theirs"]).exits(0);
    folder.write("theirs/run/report.html", "<script>planted</script>");
    let sums = folder.read("theirs/SHA256SUMS");
    let opened = |what: &str| {
        let answer = folder.luxproof(&["open", what, "--no-browser"]).exits(0);
        answer.stdout.trim().to_owned()
    };
    let page = opened("theirs/run");
    assert!(!Path::new(&page).starts_with(folder.path("theirs")), "{page}");
    let text = fs::read_to_string(folder.path("").join(&page)).unwrap();
    assert!(!text.contains("planted") && text.contains("a test room"));
    fs::remove_dir_all(Path::new(&page).parent().unwrap()).unwrap();
    fs::remove_file(folder.path("theirs/run/report.html")).unwrap();
    assert_eq!(sums, folder.read("theirs/SHA256SUMS"));
    folder.luxproof(&["reproduce", "theirs", "--verify"]).exits(0);
    // A page that is newer than the report is drawn anew, too.
    folder.write("out/report.html", "<script>planted</script>");
    assert_eq!(opened("out"), "out/report.html");
    assert!(!folder.read("out/report.html").contains("planted"));
}

#[test]
fn an_import_writes_into_the_folder_that_it_is_given_alone() {
    let scene = "void plastic m 0 0 5 .5 .5 .5 0 0\nm sphere s 0 0 4 1 1 1 0.5\n";
    let folder = Folder::new(&[]);
    fs::create_dir(folder.path("inner")).unwrap();
    folder.write("inner/...rad", scene);
    let import = |args: &[&str]| {
        let args = [&["import", "...rad"], args].concat();
        Answer::of(folder.command(&args).current_dir(folder.path("inner")))
    };
    let there = |place: &str| {
        let mut names: Vec<String> =
            fs::read_dir(folder.path(place)).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    };
    import(&[]).exits(2).complains("name a folder with --out");
    assert_eq!((there(""), there("inner")), (vec!["inner".to_owned()], vec!["...rad".to_owned()]));
    import(&["--out", "made"]).exits(0);
    assert_eq!((there(""), there("inner")), (vec!["inner".to_owned()], vec!["...rad".to_owned(), "made".to_owned()]));
    // A spec of such a name has its run below luxproof-out, too.
    folder.write("inner/...yaml", &spec());
    folder.write("inner/lamp.ies", LAMP);
    Answer::of(
        folder
            .command(&["run", "...yaml", "--engines", "simulator", "--no-calibration"])
            .current_dir(folder.path("inner")),
    );
    assert!(folder.path("inner/luxproof-out/suite/report.json").is_file());
    // Nor has one of several specs the folder above for its own.
    folder.write("inner/b.yaml", &spec());
    let args = ["run", "...yaml", "b.yaml", "--engines", "simulator", "--no-calibration", "--out", "deep/out"];
    Answer::of(folder.command(&args).current_dir(folder.path("inner")));
    assert_eq!(there("inner/deep"), ["out"]);
    // A link that a stranger left has nothing written elsewhere.
    fs::create_dir(folder.path("elsewhere")).unwrap();
    folder.write("inner/b.rad", scene);
    symlink(folder.path("elsewhere"), folder.path("inner/b")).unwrap();
    let answer =
        folder.command(&["import", "--untrusted", "b.rad"]).current_dir(folder.path("inner")).output().unwrap();
    assert_eq!(answer.status.code(), Some(2));
    assert!(there("elsewhere").is_empty());
}

#[test]
fn a_bundle_keeps_run_bits_and_names_what_it_leaves_out() {
    let mine = MINE.replace("[python3, -S, adapter.py]", "[./start.sh]");
    let folder = Folder::new(&[
        ("spec.yaml", &[&spec(), mine.as_str()].concat()),
        ("lamp.ies", LAMP),
        ("adapter.py", &adapter()),
    ]);
    // It starts a file whose name stands nowhere as one word.
    folder.write("start.sh", "#!/bin/sh\nname=adapter\nexec python3 -S \"$name\".py\n");
    fs::set_permissions(folder.path("start.sh"), fs::Permissions::from_mode(0o755)).unwrap();
    folder.run(&["--engines", "simulator,mine"]);
    let answer = folder.luxproof(&["bundle", "out", "--out", "b"]).exits(0);
    let said = answer.message();
    assert!(said.contains("not bundled, as no command names them") && said.contains("adapter.py"), "{said}");
    assert!(!said.contains("lamp.ies,") && !said.contains("start.sh,"), "{said}");
    let depends = mine.replace("{command", "{depends_on: [adapter.py], command");
    folder.write("spec.yaml", &[&spec(), depends.as_str()].concat());
    folder.run(&["--engines", "simulator,mine"]);
    for out in ["c", "c.zip"] {
        let answer = folder.luxproof(&["bundle", "out", "--out", out]).exits(0);
        assert!(!answer.message().contains("adapter.py"), "{answer:?}");
        folder.luxproof(&["reproduce", out, "--trusted"]).exits(0).prints("reproduced");
    }
    let mode = |name: &str| fs::metadata(folder.path(name)).unwrap().permissions().mode() & 0o111;
    assert!(mode("c/inputs/start.sh") != 0 && mode("c/inputs/spec.yaml") == 0);
}

#[test]
fn a_file_that_may_not_grow_is_an_error_with_its_path() {
    let folder = room();
    let mut small = Command::new("sh");
    small.args([
        "-c",
        "ulimit -f 4 && exec \"$0\" run spec.yaml --engines simulator,iesna --no-calibration --no-cache --out out",
    ]);
    let answer =
        Answer::of(small.arg(env!("CARGO_BIN_EXE_luxproof")).current_dir(folder.path("")).env("NO_COLOR", "1"));
    let answer = answer.exits(2).complains("out");
    assert!(answer.message().contains("File too large") || answer.message().contains("ulimit -f"), "{answer:?}");
}

#[test]
fn names_that_are_no_utf_8_are_run_bundled_and_reproduced() {
    let folder = room();
    let odd = |bytes: &[u8]| folder.path("").join(std::ffi::OsStr::from_bytes(bytes));
    let place = odd(b"caf\xe9");
    fs::create_dir(&place).unwrap();
    for (from, to) in [("spec.yaml", &b"caf\xe9/sp\xe9c.yaml"[..]), ("lamp.ies", b"caf\xe9/lamp.ies")] {
        fs::copy(folder.path(from), odd(to)).unwrap();
    }
    fs::write(odd(b"caf\xe9/p\xe9.yaml"), "required_engines: [simulator]\n").unwrap();
    let mut run = folder.command(&["run", "--engines", OWN, "--no-calibration", "--out", "out", "--policy"]);
    Answer::of(run.arg(odd(b"caf\xe9/p\xe9.yaml")).arg(odd(b"caf\xe9/sp\xe9c.yaml"))).exits(0);
    folder.luxproof(&["bundle", "out", "--out", "b"]).exits(0);
    folder.luxproof(&["reproduce", "b"]).exits(0).prints("reproduced");
}

#[test]
fn tables_and_libraries_that_are_no_specs_are_followed_nowhere_and_not_quoted() {
    let (folder, (_kept, secret)) = (room(), outside());
    symlink(&secret, folder.path("link.yaml")).unwrap();
    folder.write("env.yaml", &format!("TOKEN: {SECRET}\n"));
    for (file, said) in [("link.yaml", "is a link"), ("env.yaml", "no file of published tables")] {
        let answer = folder.luxproof(&["reproduce", "--untrusted", file]).exits(2);
        tells_no_secret(&answer);
        assert!(answer.message().contains(said), "{answer:?}");
    }
    folder.write("s.obj", "mtllib a.mtl\nusemtl m\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    for library in ["newmtl m\nSECRET\nmap_Kd a.png\n", "newmtl m\nKd 1 1 1\nillum 4 SECRET\n", "newmtl m\nKd SECRET\n"]
    {
        folder.write("a.mtl", &library.replace("SECRET", SECRET));
        let answer = folder.luxproof(&["import", "--untrusted", "s.obj", "--out", "made"]).exits(2);
        tells_no_secret(&answer);
        assert!(answer.message().contains("a.mtl:"), "{answer:?}");
    }
}

#[test]
fn a_profile_that_a_scene_names_is_not_quoted() {
    let folder = Folder::new(&[]);
    let scene = json!({
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0, 1, 2]}],
        "nodes": [{"mesh": 0, "scale": [4, 3, 1]}, {"mesh": 0, "scale": [4, 3, 1], "translation": [0, 0, 5]},
                  {"translation": [2, 1, 2], "extensions": {"EXT_lights_ies": {"light": 0}}}],
        "extensions": {"EXT_lights_ies": {"lights": [{"uri": "profile.ies"}]}},
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"}],
        "bufferViews": [{"buffer": 0, "byteLength": 36}],
        "buffers": [{"byteLength": 36, "uri": "data:application/octet-stream;base64,AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAA"}],
    });
    folder.write("s.gltf", &scene.to_string());
    for profile in [
        format!("TOKEN={SECRET}\n"),
        format!("IESNA:LM-63-2002\nTILT=NONE\n1 {SECRET} 1 3 1\n"),
        format!("IESNA:LM-63-2002\nTILT={SECRET}\n1 1 1 3 1\n"),
    ] {
        folder.write("profile.ies", &profile);
        let import = |trust: &[&str]| {
            let import = ["import", "s.gltf", "--reflectance", "default=0.5", "--out", "made", "--force"];
            folder.luxproof(&[&import[..], trust].concat())
        };
        let answer = import(&["--untrusted"]).exits(2);
        tells_no_secret(&answer);
        assert!(answer.stderr.contains("profile") || answer.stderr.contains("luminaire-0.ies"), "{answer:?}");
        // Of the user's own a message quotes the line.
        assert_eq!(import(&[]).stderr.contains(SECRET), !profile.starts_with("TOKEN"));
    }
}

#[test]
fn files_of_an_archive_of_photometry_are_not_listed() {
    let product = format!(
        "<Root><GeneralDefinitions><Files><File id='a' type='localFileName'>{SECRET}.ies</File><File id='b' \
         type='localFileName'>b.ies</File></Files><Photometries>REFERENCES</Photometries></GeneralDefinitions></Root>"
    );
    let reference = |id: &str| format!("<Photometry><PhotometryFileReference fileId='{id}'/></Photometry>");
    for references in [reference("a"), reference("a") + &reference("b")] {
        let folder = Folder::new(&[]);
        let mut zip = zip::ZipWriter::new(fs::File::create(folder.path("lamp.gldf")).unwrap());
        zip.start_file("product.xml", zip::write::SimpleFileOptions::default()).unwrap();
        zip.write_all(product.replace("REFERENCES", &references).as_bytes()).unwrap();
        zip.finish().unwrap();
        for file in ["lamp.gldf", "lamp.gldf#c"] {
            for more in [&[][..], &["--json"]] {
                let answer = folder.luxproof(&[&["photometry", "--untrusted", file], more].concat()).exits(2);
                tells_no_secret(&answer);
            }
            assert!(folder.luxproof(&["photometry", file]).exits(2).message().contains(SECRET));
        }
    }
}

#[test]
fn no_name_is_a_command_to_the_server_that_shows_the_log() {
    let folder = room();
    let name = "::set-output name=report::x";
    let named = spec().replace("plane", &format!("\"{name}\"")).replace("title: a test room", "title: \"##[error]a\"");
    assert!(named.contains("##[error]"));
    folder.write("spec.yaml", &named);
    for more in [&[][..], &["--all"], &["--format", "csv"]] {
        let answer = folder.run(&[&["--untrusted", "--engines", OWN], more].concat()).exits(0);
        let said = answer.stdout + &answer.stderr;
        assert!(said.contains("set-output"), "the name is shown: {said}");
        assert!(!said.contains("##[") && !said.lines().any(|line| line.trim().starts_with("::")), "{said}");
    }
}

#[test]
fn what_a_stranger_asks_for_is_counted_before_it_is_laid_out() {
    let folder = room();
    let check = || folder.luxproof(&["check", "--untrusted", "spec.yaml", "--engines", OWN]);
    let angles = |list: &str| {
        let asked = format!("procedures:\n  luminous_intensity: {{luminaire: lamp, distance_m: 50{list}}}\n");
        [ROOM, TWO_METERS, &asked].concat()
    };
    // As many directions would take 12 GB.
    let many = vec!["1"; 9000].join(", ");
    folder.write("spec.yaml", &angles(&format!(", angles: {{gamma_deg: [{many}], c_deg: [{many}]}}")));
    says(&check().exits(2), "81000000 angles");
    // Those of the photometric file itself.
    let steps = |to: f64| (0..150).map(|k| format!("{:.3}", to * f64::from(k) / 149.0)).collect::<Vec<_>>().join(" ");
    let table = format!(
        "IESNA:LM-63-2002\n[TEST] x\nTILT=NONE\n1 -1 1 150 150 1 2 0 0 0\n1 1 0\n{}\n{}\n{}",
        steps(180.0),
        steps(360.0),
        (vec!["1"; 150].join(" ") + "\n").repeat(150)
    );
    folder.write("lamp.ies", &table);
    folder.write("spec.yaml", &angles(""));
    says(&check().exits(2), "22500 angles are more than the 9998");
    folder.write("lamp.ies", LAMP);
    // Cells of a table, each of which is compared with all others.
    let row = WRONG_TABLE.lines().last().unwrap();
    folder.write("table.yaml", &(WRONG_TABLE.to_owned() + &format!("{row}\n").repeat(5000)));
    folder.write("spec.yaml", &(spec() + "published: table.yaml\n"));
    says(&check().exits(2), "5001 cells");
}

#[test]
fn plans_and_archives_of_strangers_are_bounded() {
    let folder = room();
    let plan = folder.luxproof(&["plan", "--untrusted", "spec.yaml", "--engines", OWN, "--no-calibration", "--json"]);
    folder.write("plan.json", &plan.exits(0).stdout);
    let whole = folder.json("plan.json");
    let job = whole["jobs"][0]["id"].as_str().unwrap();
    let read = |complaint: &str| says(&folder.luxproof(&["read", "--untrusted", job]).exits(2), complaint);
    for key in ["engines", "filter"] {
        let mut plan = whole.clone();
        plan["asked"][key] = json!(vec!["simulator"; 101]);
        folder.write("plan.json", &plan.to_string());
        read("names 101");
        plan["asked"][key] = json!(["*a".repeat(1000)]);
        folder.write("plan.json", &plan.to_string());
        read("has a name of 2000 bytes");
    }
    folder.write("plan.json", &(whole.to_string() + &" ".repeat(16 << 20)));
    read("more than 16 MB");
    let mut zip = zip::ZipWriter::new(fs::File::create(folder.path("many.zip")).unwrap());
    for k in 0..10_001 {
        zip.start_file(format!("inputs/{k}"), zip::write::SimpleFileOptions::default()).unwrap();
    }
    zip.finish().unwrap();
    says(&folder.luxproof(&["reproduce", "many.zip"]).exits(2), "more than 10000 files");
    fs::create_dir(folder.path("large")).unwrap();
    // It takes no room here.
    fs::File::create(folder.path("large/zeros")).unwrap().set_len((256 << 20) + 1).unwrap();
    says(&folder.luxproof(&["reproduce", "large"]).exits(2), "more than 256 MB");
}

#[test]
fn what_a_bundle_lists_is_bounded_before_it_is_used() {
    let folder = room();
    folder.run(&["--engines", OWN]).exits(0);
    folder.luxproof(&["bundle", "out", "--out", "theirs"]).exits(0);
    let reproduce = |complaint: &str| {
        seal(&folder.path("theirs"));
        says(&folder.luxproof(&["reproduce", "theirs", "--out", "again"]).exits(2), complaint);
    };
    let lock = folder.read("theirs/lock.json");
    let change = |key: &str, value: Value| {
        folder.write("theirs/lock.json", &lock);
        change_json(&folder.path("theirs/lock.json"), |lock| lock[key] = value);
    };
    // The same spec again and again: each would be read.
    change("specs", json!(vec!["inputs/spec.yaml"; 101]));
    reproduce("names 101 specs");
    let engine = folder.json("theirs/lock.json")["engines"][0].clone();
    change("engines", json!(vec![engine; 101]));
    reproduce("names 101 engines");
    change("command", "x".repeat(1 << 20).into());
    reproduce("more than 1 MB");
    folder.write("theirs/lock.json", &lock);
    // It takes no room here.
    let report = folder.read("theirs/run/report.json");
    fs::File::create(folder.path("theirs/run/report.json")).unwrap().set_len((32 << 20) + 1).unwrap();
    reproduce("more than 32 MB");
    // More engines than any request may name.
    folder.write("theirs/run/report.json", &report);
    let path = folder.path("theirs/run/report.json");
    let mut report = luxproof_report_file::read(&path).unwrap();
    report.engines = vec![report.engines[0].clone(); 101];
    luxproof_report_file::keep(&mut report, &path).unwrap();
    reproduce("101 engines");
}

#[test]
fn recorded_readings_that_look_like_an_engine_of_ours_are_refused() {
    let folder = room();
    folder.write("a.csv", "procedure,meter,value\ndirect_illuminance,plane[0],6.32\n");
    for (name, said) in [
        ("Mitsuba", "looks like `mitsuba`"),
        ("simulator ", "looks like `simulator`"),
        ("m1tsuba", "looks like `mitsuba`"),
        ("m\u{456}tsuba", "letters that may look like others"),
    ] {
        folder.write("spec.yaml", &(spec() + &format!("engines: {{\"{name}\": {{readings: a.csv}}}}\n")));
        let answer = folder.luxproof(&["check", "--untrusted", "spec.yaml"]).exits(2);
        assert!(answer.message().contains(said), "{name}: {answer:?}");
    }
}

/// What a supervisor of ours lets a script of Python do.
fn confined(folder: &Folder, script: &str) -> Answer {
    folder.write("script.py", script);
    fs::create_dir_all(folder.path("bench")).unwrap();
    let parent = format!("--parent={}", std::process::id());
    let writable = format!("--writable={}", folder.path("bench").display());
    folder.luxproof(&["__supervise", &parent, "--confined", &writable, "--", "python3", "-S", "script.py"])
}

#[test]
fn a_confined_engine_reaches_no_network_no_other_process_and_no_permissions() {
    let folder = Folder::new(&[("read", "light\n")]);
    fs::set_permissions(folder.path("read"), fs::Permissions::from_mode(0o640)).unwrap();
    let refused = |what: &str| format!("try:\n    {what}\nexcept PermissionError:\n    print('refused')\n");
    let attempts = [
        // MPTCP, which Landlock does not know, TCP, UDP, and listening without a port that is named.
        "socket.socket(socket.AF_INET, socket.SOCK_STREAM, 262)",
        "socket.socket(socket.AF_INET).listen()",
        "socket.socket(socket.AF_INET6, socket.SOCK_DGRAM)",
        "resource.prlimit(os.getppid(), resource.RLIMIT_FSIZE, (4096, 4096))",
        // Memory and messages that other processes have by number, and flags of a file that may be read.
        "call(libc.shmget, 0x1234, 4096, 0o1600)",
        "call(libc.shmctl, 1, 0, 0)",
        "call(libc.msgget, 0x1234, 0o1600)",
        "call(libc.semctl, 1, 0, 0)",
        "fcntl.ioctl(open('read'), 0x40086602, bytes(8))",
        // What types into the user's terminal, and into a console.
        "fcntl.ioctl(0, 0x5412, b'x')",
        "fcntl.ioctl(0, 0x541c, bytes([2]))",
    ];
    let script = attempts.map(refused).concat();
    let own = "resource.setrlimit(resource.RLIMIT_CORE, (0, 0)); socket.socket(socket.AF_UNIX); os.chmod('read', 0o777); os.utime('read', (1, 1))\n";
    let call = "import ctypes, fcntl, os, resource, socket
libc = ctypes.CDLL(None, use_errno=True)
def call(function, *words):
    if function(*words) < 0:
        raise OSError(ctypes.get_errno(), 'refused')
";
    let answer = confined(&folder, &format!("{call}{script}{own}print('done')\n")).exits(0);
    assert_eq!(answer.stdout.matches("refused").count(), attempts.len(), "{answer:?}");
    assert!(answer.stdout.ends_with("done\n"), "{answer:?}");
    let mode = fs::metadata(folder.path("read")).unwrap().permissions().mode();
    assert_eq!(mode & 0o777, 0o640, "its permissions stay");
    assert_ne!(fs::metadata(folder.path("read")).unwrap().mtime(), 1, "its time stays");
}

/// The types that JSON is read into hold no path of the file system: those of strangers' files are `ForeignPath`, which a `Trust` resolves.
#[test]
fn no_path_comes_out_of_json_but_through_a_trust() {
    // A spec's own, which are read by `Trust::read_named`; what lies in the folder of the user's engines; what the user's Python says.
    let allowed = ["spec/src/model.rs", "engines/src/mitsuba/backend.rs", "engines/src/external/imports.rs"];
    let sources = root().join("harness");
    let mut looked_at = 0;
    for file in rust_files(&sources) {
        let name = file.strip_prefix(&sources).unwrap().to_str().unwrap().to_owned();
        let text = fs::read_to_string(&file).unwrap();
        for part in text.split("#[derive(").skip(1) {
            let Some((derived, rest)) = part.split_once(")]") else { continue };
            if !derived.contains("Deserialize") {
                continue;
            }
            looked_at += 1;
            let body = rest.split("\n}").next().unwrap();
            let is_foreign = name == "model/src/foreign_path.rs" && body.contains("struct ForeignPath(");
            assert!(is_foreign || allowed.contains(&name.as_str()) || !body.contains("PathBuf"), "{name}: {body}");
        }
    }
    assert!(looked_at > 50, "{looked_at} types");
}

fn rust_files(folder: &Path) -> Vec<std::path::PathBuf> {
    let mut found = vec![];
    for entry in fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()) {
        if entry.is_dir() {
            found.extend(rust_files(&entry));
        } else if entry.extension().is_some_and(|end| end == "rs") {
            found.push(entry);
        }
    }
    found
}

fn strangers(args: &[&str]) -> Answer {
    let mut script = Command::new("python3");
    script.arg(root().join("ci/strangers")).args(args);
    Answer::of(script.env("LUXPROOF", env!("CARGO_BIN_EXE_luxproof")))
}

/// By night `ci/nightly` looks at the limits themselves, with the program that ships.
#[test]
fn twice_as_much_costs_every_reader_twice_as_much() {
    let quick =
        "axes|overrides|sets|mtllib|GLDF|spheres|library|rows|deviations|keywords|boxes|cards|submission|bundle|pack";
    strangers(&["--doublings", "--only", quick, "--size", "0.25", "--cpu", "20", "--mib", "300"])
        .exits(0)
        .prints("sets to 2500");
}

#[test]
fn mutated_bundles_archives_and_plans_reach_nothing_outside() {
    strangers(&["--mutants", "92", "--traced", "3", "--mib", "300"])
        .exits(0)
        .prints("92 bundles, archives, plans and caches");
}
