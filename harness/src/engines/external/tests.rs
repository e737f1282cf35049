//! The forms as text, and every way in which an adapter can fail: with small shell scripts in its place.

use std::time::Duration;

use glam::DVec3;
use luminaire::scene::{Luminaire, LuminaireModel, Obstacle, Shape, Transport, orientation};
use serde_json::json;

use super::*;
use crate::engines::fixtures::{CONVERGED, cuboid, lopsided, luminaire, s1, workbench};
use crate::engines::shared_tests;

fn adapter(script: &str, folder: &Path) -> External {
    let settings = BTreeMap::from([("command".to_owned(), json!(["sh", "-c", script]))]);
    External::new("mine", &settings, folder).unwrap()
}

fn read_within(script: &str, limit: Duration) -> Result<Measurement, EngineError> {
    let folder = tempfile::tempdir().unwrap();
    let bench = Workbench { limit, ..workbench(Site::at(folder.path()), folder.path()) };
    adapter(script, folder.path()).read(&s1(Transport::Direct), &bench)
}

fn read(script: &str) -> Result<Measurement, EngineError> {
    read_within(script, Duration::from_secs(20))
}

/// A script that reads its job and prints these readings.
fn prints(rows: &[(&str, &str)]) -> String {
    let row = |(meter, lux): &(&str, &str)| format!(r#"{{"meter": "{meter}", "illuminance_lx": {lux}}}"#);
    let rows = rows.iter().map(row).collect::<Vec<_>>().join(", ");
    format!(r#"cat > /dev/null; echo '{{"readings": [{rows}]}}'"#)
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
        let one = |error: &str| format!("1, \"std_error_lx\": {error}");
        let rows = [0, 1, 2, 3].map(|k| (format!("m[{k}]"), one(if k == 3 { error } else { "0.01" })));
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
fn a_crash_a_hang_and_an_out_of_memory_kill_are_told_apart() {
    let read = |script: &str, limit_s| read_within(script, Duration::from_secs_f64(limit_s)).unwrap_err();
    shared_tests::crashes_hangs_and_kills_are_told_apart(read);
}

#[test]
fn declining_is_no_failure() {
    let error = read(r#"cat > /dev/null; echo '{"declined": "no such light"}'"#).unwrap_err();
    assert!(matches!(&error, EngineError::Declined { why, .. } if why == "no such light"), "{error}");
}

#[test]
fn the_version_changes_with_the_command_and_with_the_files_that_it_names() {
    let folder = tempfile::tempdir().unwrap();
    let site = Site::at(folder.path());
    std::fs::write(folder.path().join("mine.sh"), "one").unwrap();
    let version = |words: serde_json::Value| {
        let settings = BTreeMap::from([("command".to_owned(), words)]);
        External::new("mine", &settings, folder.path()).unwrap().probe(&site).unwrap().text
    };
    let before = version(json!(["sh", "mine.sh"]));
    assert_eq!(before, version(json!(["sh", "mine.sh"])));
    assert_ne!(before, version(json!(["sh", "mine.sh", "-v"])));
    std::fs::write(folder.path().join("mine.sh"), "two").unwrap();
    assert_ne!(before, version(json!(["sh", "mine.sh"])));
    let absent = BTreeMap::from([("command".to_owned(), json!(["./gone"]))]);
    let absent = External::new("mine", &absent, folder.path()).unwrap().probe(&site).unwrap_err();
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
    let settings = json!({"command": ["sh", "mine.py", "a.json"], "depends_on": ["table.txt"]});
    let settings: BTreeMap<_, _> = serde_json::from_value(settings).unwrap();
    let site = Site::at(folder.path().join("engines"));
    let now = || External::new("mine", &settings, folder.path()).unwrap().probe(&site).unwrap().fingerprint;
    let mut before = now();
    for name in ["mine.py", "module.py", "package/part.py", "table.txt", "a.json"] {
        write(name, "another");
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
        (json!(["python3", "-m", "adapter"]), "adapter.py"),
        (json!(["python3", "-m", "adapter"]), "package/deep/module.py"),
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
        std::os::unix::fs::symlink("../../other/tool.py", folder.join("bin/link.py")).unwrap();
        let site = Site::at(kept.path().join("engines"));
        let settings = BTreeMap::from([("command".to_owned(), command.clone())]);
        let now = || {
            write("out", "of a run");
            External::new("mine", &settings, &folder).unwrap().probe(&site).unwrap()
        };
        let before = now();
        assert_eq!(before, now());
        write(edited, "another");
        assert_ne!(before.fingerprint, now().fingerprint, "{command}: {edited}");
    }
}

#[test]
fn the_fingerprint_changes_with_what_python_imports_from_elsewhere_and_what_nobody_finds_is_told() {
    let kept = tempfile::tempdir().unwrap();
    for inner in ["spec", "elsewhere/package", "other"] {
        std::fs::create_dir_all(kept.path().join(inner)).unwrap();
    }
    let write = |name: &str, text: &str| std::fs::write(kept.path().join(name), text).unwrap();
    let set = "import os, sys\nsys.path.insert(0, os.path.join(os.path.dirname(__file__), '..', 'elsewhere'))\n";
    write("spec/adapter.py", &format!("{set}import json, package\n"));
    write("elsewhere/package/__init__.py", "import deep");
    write("elsewhere/package/part.py", "one");
    write("elsewhere/deep.py", "one");
    write("other/mine.py", "one");
    let site = Site::at(kept.path().join("engines"));
    let now = |command: serde_json::Value| {
        let settings = BTreeMap::from([("command".to_owned(), command)]);
        External::new("mine", &settings, &kept.path().join("spec")).unwrap().probe(&site).unwrap()
    };
    let plain = || now(json!(["python3", "-B", "adapter.py"]));
    let mut before = plain();
    for name in ["elsewhere/package/part.py", "elsewhere/deep.py"] {
        write(name, "another");
        assert_ne!(before, plain(), "{name}");
        before = plain();
    }
    assert!(!before.text.contains("imports"), "{}", before.text);
    write("spec/adapter.py", "import mine\ntry:\n    import perhaps\nexcept ImportError: pass\n");
    assert!(plain().text.ends_with("(not all of its imports)"));
    let place = format!("PYTHONPATH={}", kept.path().join("other").display());
    let set = || now(json!(["env", place, "python3", "adapter.py"]));
    let before = set();
    assert!(before.text.starts_with("sha256:") && !before.text.contains("imports"), "{}", before.text);
    write("other/mine.py", "another");
    assert_ne!(before.fingerprint, set().fingerprint);
}

#[test]
fn a_program_of_which_nothing_is_known_says_so_in_its_version() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("table.txt"), "one").unwrap();
    let version = |settings: serde_json::Value| {
        let settings: BTreeMap<_, _> = serde_json::from_value(settings).unwrap();
        let site = Site::at(folder.path().join("engines"));
        External::new("mine", &settings, folder.path()).unwrap().probe(&site).unwrap().text
    };
    let unknown = version(json!({"command": ["sh", "-s", "elsewhere"]}));
    assert!(unknown.starts_with("sha256:") && unknown.ends_with("(its files are not known)"), "{unknown}");
    let named = version(json!({"command": ["sh", "-s", "elsewhere"], "depends_on": ["table.txt"]}));
    assert!(unknown.starts_with(&named) && named.len() < unknown.len(), "{named}");
}

#[test]
fn one_script_is_one_component_however_it_is_started() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("a.py"), "one").unwrap();
    std::fs::write(folder.path().join("b.py"), "two").unwrap();
    let of = |words: serde_json::Value| {
        let settings = BTreeMap::from([("command".to_owned(), words)]);
        External::new("mine", &settings, folder.path()).unwrap().components(&s1(Transport::Direct))
    };
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
    job.stations.truncate(1);
    let folder = Path::new("/");
    let text = String::from_utf8(adapter("x", folder).export(&job).unwrap().remove(0).bytes).unwrap();
    // Numbers one a line make 200 lines of it: compact for the reviewer.
    let value: serde_json::Value = serde_json::from_str(&text).unwrap();
    let lines: Vec<String> = value.as_object().unwrap().iter().map(|(k, v)| format!("{k}: {v}")).collect();
    insta::assert_snapshot!(lines.join("\n"));
}

#[test]
fn who_declines_says_why_and_reads_nothing() {
    let answer = |json: &str| read(&format!("cat > /dev/null; echo '{json}'")).unwrap_err();
    assert!(matches!(answer(r#"{"declined": "no shadows"}"#), EngineError::Declined { .. }));
    for (json, says) in [
        (r#"{"declined": ""}"#, "declined for no reason"),
        (r#"{"declined": " "}"#, "declined for no reason"),
        (
            r#"{"declined": "no", "readings": [{"meter": "m[0]", "illuminance_lx": 1}]}"#,
            "either `declined` or `readings`",
        ),
    ] {
        let error = answer(json);
        assert!(matches!(error, EngineError::Output { .. }) && error.to_string().contains(says), "{error}");
    }
}
