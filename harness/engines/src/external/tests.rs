//! The forms as text, and every way in which an adapter can fail: with small shell scripts in its place.

use std::time::Duration;

use glam::DVec3;
use luxproof_scene::{Luminaire, LuminaireModel, Obstacle, Shape, Transport, orientation};
use serde_json::json;

use super::readings::job_name;
use super::*;
use crate::fixtures::{CONVERGED, cuboid, job_dir, lopsided, luminaire, s1};
use crate::shared_tests;

/// An adapter without settings but its command.
fn started(command: serde_json::Value, folder: &Path) -> External {
    External::new("mine", &BTreeMap::from([("command".to_owned(), command)]), folder).unwrap()
}

fn adapter(script: &str, folder: &Path) -> External {
    started(json!(["sh", "-c", script]), folder)
}

fn read_within(script: &str, limit: Duration) -> Result<Measurement, EngineError> {
    let folder = tempfile::tempdir().unwrap();
    let bench = JobDir { limit, ..job_dir(EngineRoot::at(folder.path()), folder.path()) };
    adapter(script, folder.path()).read(&s1(Transport::Direct), &bench)
}

fn read(script: &str) -> Result<Measurement, EngineError> {
    read_within(script, Duration::from_secs(20))
}

/// A script that reads its request and prints an answer with these fields to the only job.
fn answers(fields: &str) -> String {
    let name = job_name(&s1(Transport::Direct), 0);
    format!(r#"cat > /dev/null; echo '{{"answers": [{{"job": "{name}", {fields}}}]}}'"#)
}

/// A script that reads its request and prints these readings.
fn prints(rows: &[(&str, &str)]) -> String {
    let rows = rows.iter().map(|(meter, lux)| format!(r#"{{"meter": "{meter}", "illuminance_lx": {lux}}}"#));
    answers(&format!(r#""readings": [{}]"#, rows.collect::<Vec<_>>().join(", ")))
}

/// The answer to a probe.
const PROBE_ANSWER: &str = r#"{"protocol": 2, "name": "mine", "version": "1"}"#;

/// A shell script that answers a probe. Its text contains a mark, so that scripts can differ.
fn probed_sh(mark: &str) -> String {
    format!("#!/bin/sh\necho '{PROBE_ANSWER}' # {mark}\n")
}

/// A Python program that runs some lines before it answers a probe.
fn probed_python(lines: &str) -> String {
    format!("#!/usr/bin/env python3\n{lines}\nprint('{PROBE_ANSWER}')\n")
}

/// Makes a file a program that can be started by its name.
fn make_executable(file: &Path) {
    use std::os::unix::fs::PermissionsExt;
    std::fs::set_permissions(file, std::fs::Permissions::from_mode(0o755)).unwrap();
}

#[test]
fn what_an_adapter_prints_is_what_is_read() {
    let found = read(&prints(&[("m[0]", "1"), ("m[1]", "2.5"), ("m[2]", "0"), ("m[3]", "4")])).unwrap();
    assert_eq!(found.estimates.iter().map(|e| e.value).collect::<Vec<_>>(), [1.0, 2.5, 0.0, 4.0]);
    assert!(found.effort["command"].starts_with('/'), "{:?}", found.effort);
}

#[test]
fn rows_that_are_missing_swapped_or_not_a_number_are_no_readings() {
    let three = [("m[0]", "1"), ("m[1]", "1"), ("m[2]", "1")];
    for (fourth, says) in [
        (None, "3 readings for 4 meters"),
        (Some(("m[2]", "1")), "gave `m[2]` where `m[3]`"),
        (Some(("m[3]", "1e308")), "read 1e308 lx (Unstated) at m[3]: beyond 1e30 lx nothing is light"),
        (Some(("m[3]", "NaN")), "read NaN lx (Unstated) at m[3]; the readings of the other meters are kept"),
        (Some(("m[3]", "-Infinity")), "read NaN lx (Unstated) at m[3]"),
        (Some(("m[3]", "null")), "read NaN lx (Unstated) at m[3]"),
        (Some(("m[3]", "1, \"std_error_lx\": NaN")), "read 1 lx (StandardError"),
        (Some(("m[3]", "1e999")), "no JSON of readings"),
        (Some(("m[3]", "\"dark\"")), "no JSON of readings"),
        (Some(("m[3]", "nan")), "no JSON of readings"),
    ] {
        let rows: Vec<_> = three.into_iter().chain(fourth).collect();
        let error = read(&prints(&rows)).unwrap_err();
        assert!(error.to_string().contains(says), "{says}: {error}");
        if let EngineError::AtMeters { rest, .. } = error {
            let values: Vec<f64> = rest.estimates.iter().map(|e| e.value).collect();
            assert!(values[..3] == [1.0; 3] && values[3].is_nan(), "{values:?}");
        }
    }
    assert!(matches!(read(&prints(&[("m[0]", "NaN"); 4])), Err(EngineError::Output { .. })), "named wrongly");
    // Beside others that scatter, too, what is no error is not one of samples that agree.
    for error in ["NaN", "-Infinity", "-0.01"] {
        let rows = [(0, "0.01"), (1, "0.01"), (2, "0.01"), (3, error)]
            .map(|(k, error)| (format!("m[{k}]"), format!("1, \"std_error_lx\": {error}")));
        let rows: Vec<(&str, &str)> = rows.iter().map(|(meter, text)| (meter.as_str(), text.as_str())).collect();
        let Err(EngineError::AtMeters { rest, .. }) = read(&prints(&rows)) else { panic!("{error} is an error") };
        assert!(rest.estimates[..3].iter().all(|e| e.value == 1.0) && rest.estimates[3].value.is_nan(), "{error}");
    }
    for (last, says) in [
        (r#""std_error_lx": 1e300"#, "nothing is light"),
        (r#""std_error_lx": 1, "degrees_of_freedom": 0.5"#, "`degrees_of_freedom: 0.5` at m[3]: two samples have one"),
    ] {
        let error = read(&prints(&[&three[..], &[("m[3]", &format!("1, {last}"))]].concat())).unwrap_err().to_string();
        assert!(error.contains(says), "{error}");
    }
    let error = read("cat > /dev/null; echo Segmentation fault").unwrap_err().to_string();
    assert!(error.contains("Segmentation fault"), "{error}");
}

#[test]
fn a_crash_a_hang_and_an_out_of_memory_kill_are_distinguished() {
    shared_tests::crashes_hangs_and_kills_are_distinguished(|script, limit_s| {
        read_within(script, Duration::from_secs_f64(limit_s)).unwrap_err()
    });
}

#[test]
fn declining_is_no_failure() {
    let error = read(&answers(r#""declined": "no such light""#)).unwrap_err();
    assert!(matches!(&error, EngineError::Declined { why, .. } if why == "no such light"), "{error}");
}

#[test]
fn the_version_changes_with_the_command_and_with_the_files_that_it_names() {
    let folder = tempfile::tempdir().unwrap();
    let site = EngineRoot::at(folder.path());
    std::fs::write(folder.path().join("mine.sh"), probed_sh("one")).unwrap();
    let version = |words| started(words, folder.path()).probe(&site).unwrap().text;
    let before = version(json!(["sh", "mine.sh"]));
    assert_eq!(before, version(json!(["sh", "mine.sh"])));
    assert_ne!(before, version(json!(["sh", "mine.sh", "-v"])));
    std::fs::write(folder.path().join("mine.sh"), probed_sh("two")).unwrap();
    assert_ne!(before, version(json!(["sh", "mine.sh"])));
    let absent = started(json!(["./gone"]), folder.path()).probe(&site).unwrap_err();
    assert!(absent.to_string().contains("./gone"), "{absent}");
}

#[test]
fn the_fingerprint_changes_with_sources_beside_the_adapter_and_with_what_it_depends_on() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).unwrap();
    std::fs::create_dir(folder.path().join("package")).unwrap();
    for name in ["mine.py", "module.py", "package/part.py", "table.txt", "notes.txt", "a.json", "b.json", "sh", "tool"]
    {
        write(name, "one");
    }
    write("mine.py", &probed_sh("one"));
    let settings = json!({"command": ["sh", "mine.py", "a.json"], "depends_on": ["table.txt"]});
    let settings: BTreeMap<_, _> = serde_json::from_value(settings).unwrap();
    let site = EngineRoot::at(folder.path().join("engines"));
    let now = || External::new("mine", &settings, folder.path()).unwrap().probe(&site).unwrap().fingerprint;
    let mut before = now();
    for name in ["mine.py", "module.py", "package/part.py", "table.txt", "a.json"] {
        write(name, &probed_sh("another"));
        assert_ne!(before, now(), "{name}");
        before = now();
    }
    for name in ["notes.txt", "b.json", "sh", "tool"] {
        write(name, "another");
        assert_eq!(before, now(), "{name}");
    }
    std::fs::remove_file(folder.path().join("table.txt")).unwrap();
    assert!(External::new("mine", &settings, folder.path()).unwrap().probe(&site).is_err());
}

#[test]
fn the_fingerprint_changes_with_what_a_command_starts_or_loads_without_naming_it() {
    for (command, edited) in [
        (json!(["./run.sh"]), "adapter.py"),
        (json!(["python3", "-B", "-m", "adapter"]), "adapter.py"),
        (json!(["python3", "-B", "-m", "adapter"]), "package/deep/module.py"),
        (json!(["sh", "adapter.py"]), "package/deep/module.py"),
        (json!(["sh", "adapter.py"]), "package/deep/libfast.so"),
        (json!(["../other/tool.py"]), "../other/lib/helper.js"),
        (json!(["bin/link.py"]), "../other/lib/helper.js"),
    ] {
        let kept = tempfile::tempdir().unwrap();
        let folder = kept.path().join("spec");
        for inner in ["spec/package/deep", "spec/bin", "other/lib"] {
            std::fs::create_dir_all(kept.path().join(inner)).unwrap();
        }
        let write = |name: &str, text: &str| std::fs::write(folder.join(name), text).unwrap();
        for name in ["run.sh", "adapter.py", "package/deep/module.py", "package/deep/libfast.so", "../other/tool.py"] {
            write(name, "one");
        }
        write("../other/lib/helper.js", "one");
        let text = if command[0] == "python3" { probed_python("") } else { probed_sh("one") };
        for program in ["run.sh", "adapter.py", "../other/tool.py"] {
            write(program, &text);
            make_executable(&folder.join(program));
        }
        std::os::unix::fs::symlink("../../other/tool.py", folder.join("bin/link.py")).unwrap();
        let site = EngineRoot::at(kept.path().join("engines"));
        let now = || started(command.clone(), &folder).probe(&site).unwrap();
        write("out", "of a run");
        let before = now();
        write("out", "of another run");
        assert_eq!(before, now());
        write(edited, &(text + "# another\n"));
        assert_ne!(before.fingerprint, now().fingerprint, "{command}: {edited}");
    }
}

#[test]
fn the_fingerprint_changes_with_python_imports_from_elsewhere_and_missing_ones_are_reported() {
    let kept = tempfile::tempdir().unwrap();
    for inner in ["spec", "elsewhere/package", "other"] {
        std::fs::create_dir_all(kept.path().join(inner)).unwrap();
    }
    let write = |name: &str, text: &str| std::fs::write(kept.path().join(name), text).unwrap();
    let set = "import os, sys\nsys.path.insert(0, os.path.join(os.path.dirname(__file__), '..', 'elsewhere'))\n";
    write("spec/adapter.py", &probed_python(&format!("{set}import json, package\n")));
    write("elsewhere/package/__init__.py", "import deep");
    for name in ["elsewhere/package/part.py", "elsewhere/deep.py", "other/mine.py"] {
        write(name, "# one");
    }
    let site = EngineRoot::at(kept.path().join("engines"));
    let now = |command| started(command, &kept.path().join("spec")).probe(&site).unwrap();
    let plain = || now(json!(["python3", "-B", "adapter.py"]));
    let mut before = plain();
    for name in ["elsewhere/package/part.py", "elsewhere/deep.py"] {
        write(name, "# another");
        assert_ne!(before, plain(), "{name}");
        before = plain();
    }
    assert!(!before.text.contains("imports"), "{}", before.text);
    // It ends before the import that would fail.
    let answer = format!("import os\nprint('{PROBE_ANSWER}', flush=True)\nos._exit(0)\n");
    write("spec/adapter.py", &(answer + "import mine\ntry:\n    import perhaps\nexcept ImportError: pass\n"));
    assert!(plain().text.ends_with("(not all of its imports)"));
    let place = format!("PYTHONPATH={}", kept.path().join("other").display());
    let set = || now(json!(["env", place, "python3", "-B", "adapter.py"]));
    let before = set();
    assert!(before.text.starts_with("mine 1, sha256:") && !before.text.contains("imports"), "{}", before.text);
    write("other/mine.py", "# another");
    assert_ne!(before.fingerprint, set().fingerprint);
}

#[test]
fn a_program_of_which_nothing_is_known_says_so_in_its_version() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("table.txt"), "one").unwrap();
    let program = format!("BEGIN {{ print \"{}\" }}", PROBE_ANSWER.replace('"', "\\\""));
    let [unknown, named] =
        [json!({"command": ["awk", program]}), json!({"command": ["awk", program], "depends_on": ["table.txt"]})].map(
            |settings| {
                let settings: BTreeMap<_, _> = serde_json::from_value(settings).unwrap();
                let site = EngineRoot::at(folder.path().join("engines"));
                External::new("mine", &settings, folder.path()).unwrap().probe(&site).unwrap().text
            },
        );
    assert!(unknown.starts_with("mine 1, sha256:") && unknown.ends_with("(its files are not known)"), "{unknown}");
    assert!(unknown.starts_with(&named) && named.len() < unknown.len(), "{named}");
}

#[test]
fn one_script_is_one_component_however_it_is_started() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("a.py"), "one").unwrap();
    std::fs::write(folder.path().join("b.py"), "two").unwrap();
    let of = |words| started(words, folder.path()).components(&s1(Transport::Direct));
    let plain = of(json!(["python3", "a.py"]));
    assert_eq!(plain, of(json!(["python3", "-u", "a.py"])));
    assert_eq!(plain, of(json!(["python3", "-B", "a.py", "--quick"])));
    assert_ne!(plain, of(json!(["python3", "b.py"])));
}

#[test]
fn settings_that_make_no_sense_are_named() {
    for (settings, key) in [
        (json!({"command": "mine.py"}), "engines.mine.command"),
        (json!({"command": []}), "engines.mine.command"),
        (json!({"command": ["x"], "procedures": ["glare"]}), "engines.mine.procedures"),
        (json!({"command": ["x"], "protocol": 1}), "engines.mine.protocol"),
    ] {
        let settings: BTreeMap<_, _> = serde_json::from_value(settings).unwrap();
        let error = External::new("mine", &settings, Path::new(".")).unwrap_err().to_string();
        assert!(error.contains(key), "{error}");
    }
    let command = BTreeMap::from([("command".to_owned(), json!(["x"]))]);
    assert!(External::new("../mine", &command, Path::new(".")).is_err());
}

#[test]
fn procedures_left_out_are_not_run() {
    let settings: BTreeMap<_, _> =
        serde_json::from_value(json!({"command": ["x"], "procedures": ["direct_illuminance"]})).unwrap();
    let engine = External::new("mine", &settings, Path::new(".")).unwrap();
    let mut job = s1(Transport::Direct);
    job.procedure = ProcedureId::DirectIlluminance;
    assert_eq!(engine.supports(&job), Support::Yes);
    job.procedure = ProcedureId::IndirectIlluminance;
    assert!(matches!(engine.supports(&job), Support::No(_)));
}

#[test]
fn the_job_of_a_furnished_room_is_as_reviewed() {
    let mut job = s1(CONVERGED);
    job.settings.insert("command".into(), json!(["x"]));
    job.settings.insert("quality".into(), json!("high"));
    let mut panel: Luminaire = luminaire("panel", DVec3::new(2.0, 1.5, 2.5), lopsided());
    panel.orientation = orientation(90.0, 0.0, 0.0);
    panel.model = LuminaireModel::Area;
    panel.flux_scale = 0.5;
    job.scene.luminaires.push(panel);
    job.scene.obstacles = vec![
        cuboid([1.0; 3], [2.0; 3], 0.5),
        Obstacle {
            shape: Shape::Mesh { vertices_m: vec![DVec3::X, DVec3::Y, DVec3::Z], triangles: vec![[0, 1, 2]] },
            reflectance: 0.3,
        },
    ];
    job.sensors.truncate(1);
    let folder = Path::new("/");
    let text = String::from_utf8(adapter("x", folder).export(&job).unwrap().remove(0).bytes).unwrap();
    // Numbers one a line make 200 lines of it: compact for the reviewer.
    let value: serde_json::Value = serde_json::from_str(&text).unwrap();
    let lines: Vec<String> = value.as_object().unwrap().iter().map(|(k, v)| format!("{k}: {v}")).collect();
    insta::assert_snapshot!(lines.join("\n"));
}

#[test]
fn who_declines_says_why_and_reads_nothing() {
    let answer = |fields: &str| read(&answers(fields)).unwrap_err();
    assert!(matches!(answer(r#""declined": "no shadows""#), EngineError::Declined { .. }));
    for (fields, says) in [
        (r#""declined": """#, "declined for no reason"),
        (r#""declined": " ""#, "declined for no reason"),
        (
            r#""declined": "no", "readings": [{"meter": "m[0]", "illuminance_lx": 1}]"#,
            "either `declined` or `readings`",
        ),
    ] {
        let error = answer(fields);
        assert!(matches!(error, EngineError::Output { .. }) && error.to_string().contains(says), "{error}");
    }
}
