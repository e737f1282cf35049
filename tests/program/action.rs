//! action.yml, its steps run in order as a runner would: inputs and outputs put in, files for outputs, paths and the summary.

use std::collections::BTreeMap;
use std::fs;
use std::os::unix::fs::symlink;
use std::process::Command;

use serde_yaml::Value;

use crate::support::{Folder, LAMP, ROOM, TWO_METERS, root};

const DIRECT: &str = "procedures:\n  direct_illuminance: {meters: plane}\n";

fn action() -> Value {
    serde_yaml::from_str(&fs::read_to_string(root().join("action.yml")).unwrap()).unwrap()
}

/// A text with what the runner puts in for `${{ ... }}`; what it does not know is a mistake of the action.
fn expanded(text: &str, known: &BTreeMap<String, String>) -> String {
    let (mut done, mut rest) = (String::new(), text);
    while let Some((before, after)) = rest.split_once("${{") {
        let (name, after) = after.split_once("}}").expect("an expression ends");
        let value =
            known.get(name.trim()).unwrap_or_else(|| panic!("`{}` is nothing that a runner knows", name.trim()));
        done = done + before + value;
        rest = after;
    }
    done + rest
}

/// What a run of the action came to.
struct Ran {
    code: i32,
    outputs: BTreeMap<String, String>,
    summary: String,
    said: String,
}

/// Runs the steps in a folder whose `bin` is first on the path.
fn ran(folder: &Folder, given: &[(&str, &str)]) -> Ran {
    let action = action();
    let mut known: BTreeMap<String, String> = BTreeMap::new();
    for (name, input) in action["inputs"].as_mapping().unwrap() {
        let name = name.as_str().unwrap();
        let given = given.iter().find(|(n, _)| *n == name).map(|(_, value)| *value);
        let usual = input.get("default").and_then(Value::as_str);
        assert!(given.is_some() || usual.is_some(), "{name} is required");
        known.insert(format!("inputs.{name}"), given.or(usual).unwrap_or_default().to_owned());
    }
    let temp = folder.path("temp");
    fs::create_dir_all(&temp).unwrap();
    for (name, value) in [
        ("runner.temp", temp.to_str().unwrap()),
        ("runner.os", "Linux"),
        ("runner.arch", "X64"),
        ("github.run_id", "1"),
        ("github.run_attempt", "1"),
    ] {
        known.insert(name.to_owned(), value.to_owned());
    }
    let files = ["GITHUB_OUTPUT", "GITHUB_PATH", "GITHUB_STEP_SUMMARY"].map(|name| (name, folder.path(name)));
    let (mut code, mut said) = (0, String::new());
    for step in action["runs"]["steps"].as_sequence().unwrap() {
        for value in step["with"].as_mapping().into_iter().flat_map(|m| m.values()) {
            expanded(value.as_str().unwrap(), &known);
        }
        let Some(script) = step["run"].as_str() else {
            assert!(step["uses"].as_str().unwrap().contains('@'), "a step runs or uses something: {step:?}");
            continue;
        };
        for (_, file) in &files {
            fs::write(file, fs::read(file).unwrap_or_default()).unwrap();
        }
        fs::write(&files[0].1, "").unwrap();
        let mut bash = Command::new("bash");
        bash.args(["--noprofile", "--norc", "-eo", "pipefail", "-c", script]).current_dir(folder.path("."));
        bash.env("PATH", format!("{}:/usr/bin:/bin", folder.path("bin").display()))
            .env("RUNNER_TEMP", &temp)
            .env("NO_COLOR", "1");
        bash.envs(files.iter().map(|(name, file)| (name, file)));
        for (name, value) in step["env"].as_mapping().into_iter().flatten() {
            bash.env(name.as_str().unwrap(), expanded(value.as_str().unwrap(), &known));
        }
        let answer = bash.output().unwrap();
        said += &(String::from_utf8_lossy(&answer.stdout) + String::from_utf8_lossy(&answer.stderr));
        let id = step["id"].as_str().unwrap_or_default();
        for (name, value) in fs::read_to_string(&files[0].1).unwrap().lines().filter_map(|l| l.split_once('=')) {
            known.insert(format!("steps.{id}.outputs.{name}"), value.to_owned());
        }
        code = answer.status.code().unwrap();
        if code != 0 {
            break;
        }
    }
    let outputs = action["outputs"].as_mapping().unwrap().iter().map(|(name, output)| {
        let value = output["value"].as_str().unwrap();
        let inner = value.trim_start_matches("${{").trim_end_matches("}}").trim();
        (name.as_str().unwrap().to_owned(), known.get(inner).cloned().unwrap_or_default())
    });
    let outputs = outputs.collect();
    Ran { code, outputs, summary: fs::read_to_string(&files[2].1).unwrap_or_default(), said }
}

#[test]
fn the_action_audits_tells_its_summary_and_hands_on_the_exit_code() {
    let spec = [ROOM, TWO_METERS, DIRECT].concat();
    let folder = Folder::new(&[("spec.yaml", &spec), ("other.yaml", &spec), ("lamp.ies", LAMP)]);
    fs::create_dir(folder.path("bin")).unwrap();
    symlink(env!("CARGO_BIN_EXE_luxproof"), folder.path("bin/luxproof")).unwrap();
    let given = [
        ("specs", "spec.yaml\nother.yaml"),
        ("engines", "simulator,iesna"),
        ("arguments", "--no-calibration\n--filter\nspec\n"),
    ];
    let done = ran(&folder, &given);
    assert_eq!(done.code, 0, "{}", done.said);
    assert_eq!(done.outputs["exit-code"], "0");
    assert!(folder.path(&done.outputs["report"]).exists(), "{:?}", done.outputs);
    assert!(done.summary.contains("| direct_illuminance |"), "{}", done.summary);
    assert!(folder.path("temp/luxproof-readings").exists(), "readings are kept where the cache looks");
    // A fault is one of the step, too.
    folder.edit("spec.yaml", "walls: 0.5", "walls: 5");
    let done = ran(&folder, &given);
    assert_eq!((done.code, done.outputs["exit-code"].as_str()), (2, "2"), "{}", done.said);
    // The report of the run before, or one that a checkout brings, is not shown as this run's.
    assert!(folder.path("luxproof-out/action/report.json").exists());
    assert_eq!((done.outputs["report"].as_str(), done.summary.matches("## luxproof").count()), ("", 1));
}

#[test]
fn the_hook_lints_photometric_files() {
    let hooks: Value =
        serde_yaml::from_str(&fs::read_to_string(root().join(".pre-commit-hooks.yaml")).unwrap()).unwrap();
    let hook = &hooks[0];
    let entry: Vec<&str> = hook["entry"].as_str().unwrap().split(' ').collect();
    assert_eq!(entry[0], "luxproof");
    let folder = Folder::new(&[("sound.ies", LAMP), ("dark.ies", &LAMP.replace("100 80 0", "0 0 0"))]);
    folder.luxproof(&[&entry[1..], &["sound.ies"]].concat()).exits(0);
    folder.luxproof(&[&entry[1..], &["dark.ies"]].concat()).exits(1);
}

/// Every workflow and the action: their `uses` and their jobs.
fn workflows() -> Vec<(String, String, Value)> {
    let files = ["action.yml", ".github/workflows/ci.yml", ".github/workflows/nightly.yml"];
    let read = |file: &str| {
        let text = fs::read_to_string(root().join(file)).unwrap();
        (file.to_owned(), text.clone(), serde_yaml::from_str(&text).unwrap())
    };
    files.map(read).into()
}

#[test]
fn actions_are_pinned_by_commits_and_engines_run_without_the_right_to_publish() {
    for (file, text, workflow) in workflows() {
        for used in text.lines().filter_map(|line| line.split_once("uses: ")).map(|(_, used)| used) {
            let (commit, tag) = used.split_once('@').unwrap().1.split_once(" # v").unwrap_or_default();
            let is_pinned = commit.len() == 40 && commit.bytes().all(|b| b.is_ascii_hexdigit()) && !tag.is_empty();
            assert!(is_pinned, "{file}: {used}");
        }
        for (name, job) in workflow["jobs"].as_mapping().into_iter().flatten() {
            let runs = job["steps"].as_sequence().unwrap().iter().any(|step| step.get("run").is_some());
            let writes = job["permissions"].as_mapping().into_iter().flatten().any(|(_, right)| right == "write");
            assert!(!(runs && writes), "{file}: {name:?} runs programs and may write");
        }
    }
}

#[test]
fn what_begins_with_a_hyphen_is_no_option_and_strangers_specs_are_read_as_such() {
    let spec = [ROOM, TWO_METERS, DIRECT].concat();
    let folder = Folder::new(&[("spec.yaml", &spec), ("--version", &spec), ("lamp.ies", LAMP)]);
    fs::create_dir(folder.path("bin")).unwrap();
    symlink(env!("CARGO_BIN_EXE_luxproof"), folder.path("bin/luxproof")).unwrap();
    let more = ("arguments", "--no-calibration");
    let done = ran(&folder, &[("specs", "spec.yaml --version"), ("engines", "simulator"), more]);
    assert_eq!(done.code, 0, "{}", done.said);
    assert!(done.summary.contains("--version"), "{}", done.summary);
    // An engine of such a name is none, and no option either.
    let done = ran(&folder, &[("specs", "spec.yaml"), ("engines", "--help"), more]);
    assert_eq!(done.code, 2, "{}", done.said);
    assert!(done.said.contains("no engine `--help`"), "{}", done.said);
    folder.write("spec.yaml", &(spec + "engines:\n  mine: {command: [touch, pwned]}\n"));
    // Every word except `false` means untrusted.
    for word in ["true", "True", "1", "yes"] {
        let done = ran(&folder, &[("specs", "spec.yaml"), ("untrusted", word), more]);
        assert_eq!(done.code, 2, "{}", done.said);
        assert!(done.said.contains("not trusted") && !folder.path("pwned").exists(), "{}", done.said);
    }
}

/// Without a hash pip installs nothing, where hashes are asked for.
#[test]
fn what_pip_installs_for_the_action_has_a_hash_where_requirements_are_given() {
    let install = action()["runs"]["steps"][0]["run"].as_str().unwrap().to_owned();
    let folder = Folder::new(&[]);
    let with_requirements = |file: &str| {
        fs::create_dir_all(folder.path("venv-bin")).unwrap();
        folder.write("venv-bin/python3", "#!/bin/sh\nmkdir -p \"$3/bin\" && cp venv-bin/pip \"$3/bin/pip\"\n");
        folder.write("venv-bin/pip", "#!/bin/sh\necho \"$@\" > asked\n");
        for name in ["python3", "pip"] {
            let mode = std::os::unix::fs::PermissionsExt::from_mode(0o755);
            fs::set_permissions(folder.path("venv-bin").join(name), mode).unwrap();
        }
        let mut bash = Command::new("bash");
        bash.args(["--noprofile", "--norc", "-eo", "pipefail", "-c", &install]).current_dir(folder.path(""));
        bash.env("PATH", format!("{}:/usr/bin:/bin", folder.path("venv-bin").display()));
        bash.envs([("RUNNER_TEMP", "temp"), ("VERSION", "0.1.0"), ("REQUIREMENTS", file)]);
        for name in ["GITHUB_OUTPUT", "GITHUB_PATH"] {
            bash.env(name, folder.path(name));
        }
        bash.output().unwrap();
        folder.read("asked")
    };
    let asked = with_requirements("-r.txt");
    assert!(asked.contains("--require-hashes") && asked.contains("--requirement=-r.txt"), "{asked}");
    let asked = with_requirements("");
    assert!(asked.contains("--only-binary :all:") && asked.trim_end().ends_with("-- luxproof==0.1.0"), "{asked}");
}
