//! A program of the user's as an engine: the example adapter joins a run, its crash is a failure, what it declines a skip.

use std::process::Command;

use serde_json::Value;

use sha2::{Digest, Sha256};

use crate::support::{Answer, Folder, MINE, SKEW_LAMP, SKEW_ROOM, adapter, adapter_with_lines_before_readings, among};

fn folder(adapter: &str) -> Folder {
    let spec = [SKEW_ROOM, "  indirect_illuminance: {meters: plane}\n", MINE].concat();
    Folder::new(&[("spec.yaml", &spec), ("lamp.ies", SKEW_LAMP), ("adapter.py", adapter)])
}

/// Runs luxproof on the folder's spec elsewhere: paths of the adapter's command count from the spec.
fn elsewhere(folder: &Folder, verb: &str, more: &[&str]) -> Answer {
    let (spec, out) = (folder.path("spec.yaml"), folder.path("out"));
    let args = [&[verb, spec.to_str().unwrap(), "--out", out.to_str().unwrap()], more].concat();
    Answer::of(folder.command(&args).current_dir("/"))
}

fn run(folder: &Folder) -> (Value, Option<i32>) {
    elsewhere(folder, "run", &["--no-calibration", "--format", "json"]).report()
}

fn of_adapter<'a>(report: &'a Value, list: &str, id: &str) -> Vec<&'a Value> {
    among(report, list, &[(id, "mine")])
}

#[test]
fn the_example_adapter_of_sixty_lines_agrees_with_inverse_square() {
    assert!(adapter().lines().count() <= 60);
    let folder = folder(&adapter());
    let (report, code) = run(&folder);
    assert_eq!(code, Some(0), "{}", report["engines"]);
    let comparisons = of_adapter(&report, "comparisons", "engine");
    // 20 directions of procedure 1 and three meters, each against a closed form.
    assert_eq!(comparisons.len(), 23);
    for comparison in comparisons {
        let off = comparison["relative_deviation"].as_f64().unwrap();
        assert!(off.abs() < 1e-12 && comparison["verdict"] == "pass", "{comparison}");
    }
    let skips = of_adapter(&report, "skips", "engine");
    assert_eq!(skips.len(), 1);
    assert_eq!(skips[0]["procedure"], "indirect_illuminance");
    assert!(skips[0]["reason"].as_str().unwrap().contains("its capabilities have no `bounces`"), "{skips:?}");
    let recording = of_adapter(&report, "recordings", "engine")[0];
    assert!(recording["version"].as_str().unwrap().starts_with("inverse square 1, sha256:"), "{recording}");
    assert_eq!(recording["effort"]["jobs_at_once"], "2", "{recording}");
    assert!(recording["method"]["python"].as_str().unwrap().starts_with('3'), "{recording}");
}

#[test]
fn an_adapter_that_crashes_is_a_failed_engine_and_the_others_go_on() {
    let folder = folder(&adapter_with_lines_before_readings("sys.exit('out of lamps')\n"));
    let (report, code) = run(&folder);
    assert_eq!(code, Some(3));
    let engine = of_adapter(&report, "engines", "id")[0];
    assert_eq!(engine["status"], "failed");
    assert!(engine["reason"].as_str().unwrap().contains("out of lamps"), "{engine}");
    assert!(report["readings"].as_array().unwrap().iter().any(|r| r["engine"] == "simulator"));
}

#[test]
fn an_exported_job_runs_by_hand() {
    let folder = folder(&adapter());
    let printed = elsewhere(&folder, "export", &["--engine", "mine"]).stdout;
    let command = printed.lines().find(|l| l.contains("direct_illuminance") && l.contains("&&")).unwrap();
    let answer = Answer::of(Command::new("sh").args(["-c", command])).json();
    let answer = &answer["answers"][0];
    assert_eq!(answer["readings"].as_array().unwrap().len(), 3);
    assert_eq!(
        (&answer["job"], &answer["readings"][1]["meter"]),
        (&"spec/direct_illuminance/1".into(), &"plane[1]".into())
    );
}

#[test]
fn an_engine_without_a_command_is_answered_with_what_to_do() {
    let folder = folder(&adapter());
    folder.edit("spec.yaml", "{command: ", "{comand: ");
    folder.luxproof(&["check", "spec.yaml"]).exits(2).complains("there is no engine `mine`").complains("command");
}

#[test]
fn the_forms_have_schemas() {
    let folder = folder(&adapter());
    for (name, key) in [
        ("request", "verb"),
        ("request", "candela"),
        ("probe", "capabilities"),
        ("answers", "illuminance_lx"),
        ("answers", "blocks_lx"),
    ] {
        let schema = folder.luxproof(&["schema", name]).json();
        assert!(schema.to_string().contains(key), "{schema}");
    }
}

#[test]
fn zero_hits_are_not_seen_and_fail_only_where_samples_are_many() {
    let unlucky = |error: f64| {
        let stated = format!("\"std_error_lx\": {error} * lux, \"degrees_of_freedom\": 7");
        let sampled = adapter().replace("\"error_bound_lx\": 1e-12 * lux", &stated);
        let noise = format!("(1 + {error} * noise.gauss(0, 1))");
        let unlucky = sampled.replace(
            "    for meter in job[\"meters\"]:\n        lux =",
            &format!(
                "    import random\n    noise = random.Random(job[\"seed\"])\n    for meter in job[\"meters\"]:\n        \
                 lux = 0.0 if meter[\"id\"] == \"plane[1]\" else {noise} *"
            ),
        );
        assert!(unlucky != sampled && sampled != adapter());
        let (report, code) = run(&folder(&unlucky));
        let of = |meter: &str| among(&report, "comparisons", &[("engine", "mine"), ("meter", meter)])[0].clone();
        assert_ne!(of("plane[0]")["verdict"], "fail");
        (of("plane[1]"), code)
    };
    let (unseen, code) = unlucky(2e-1);
    assert_eq!(code, Some(4));
    assert_eq!((&unseen["verdict"], &unseen["uncertainty"]["kind"]), (&"undecided".into(), &"not_seen".into()));
    assert!(unseen["diagnosis"].as_str().unwrap().starts_with("not seen"), "{unseen}");
    // Where samples are so many, light that comes here would have been met: it is lost.
    let (unseen, code) = unlucky(1e-4);
    assert_eq!((&unseen["verdict"], code), (&"fail".into(), Some(1)), "{unseen}");
}

#[test]
fn whatever_numbers_an_adapter_says_its_report_is_read_back_in_every_view() {
    let folder = folder(&adapter());
    for (lux, error) in [
        ("1e308", "\"exact\": True"),
        ("1e29", "\"std_error_lx\": 1e29, \"degrees_of_freedom\": 1"),
        ("1e-300", "\"std_error_lx\": 5e-324, \"degrees_of_freedom\": 1e300"),
        ("5e-324", "\"error_bound_lx\": 1e30"),
        ("0.0 if meter[\"id\"] == \"plane[1]\" else 1e29", "\"std_error_lx\": 1e-200, \"degrees_of_freedom\": 7"),
    ] {
        let absurd = adapter().replace("\"error_bound_lx\": 1e-12 * lux", error);
        let absurd = absurd.replace(
            "    for meter in job[\"meters\"]:\n        lux =",
            &format!("    for meter in job[\"meters\"]:\n        lux = {lux}\n        other ="),
        );
        assert!(absurd.contains("other =") && absurd.contains(error));
        folder.write("adapter.py", &absurd);
        let (report, _) = run(&folder);
        let status = &of_adapter(&report, "engines", "id")[0]["status"];
        assert_eq!(status, if lux == "1e308" { "failed" } else { "ran" }, "{lux}");
        for format in ["terminal", "markdown", "junit", "csv", "html"] {
            let view = folder.luxproof(&["report", "out/report.json", "--format", format]);
            assert!(view.code != Some(2) && !view.stdout.is_empty(), "{lux} {format}: {}", view.stderr);
        }
        folder.luxproof(&["diff", "out", "out"]).exits(0);
    }
}

/// The example adapter with some of its text replaced.
fn changed(changes: &[(&str, &str)]) -> String {
    changes.iter().fold(adapter(), |text, (from, to)| {
        assert!(text.contains(from), "no `{from}` in the example");
        text.replace(from, to)
    })
}

const PROBED: &str =
    "{\"protocol\": 2, \"name\": \"inverse square\", \"version\": \"1\", \"capabilities\": [\"batch\"]}";
const BOUND: &str = "\"error_bound_lx\": 1e-12 * lux";

/// One job per process on standard input, no verbs: what adapters were before the probe.
#[test]
fn an_adapter_of_protocol_1_is_absent_and_its_user_learns_what_to_do() {
    let example = adapter();
    let (answers, _) = example.split_once("\n\ndef reply(").unwrap();
    let folder = folder(&format!("{answers}\n\njson.dump(answer(json.load(sys.stdin)), sys.stdout)\n"));
    let (report, code) = run(&folder);
    assert_eq!(code, Some(3));
    let engine = of_adapter(&report, "engines", "id")[0];
    let reason = engine["reason"].as_str().unwrap();
    assert_eq!(engine["status"], "absent");
    for part in ["no valid answer to the request `{\"verb\": \"probe\"}`", "KeyError", "speaks protocol 2 alone"] {
        assert!(reason.contains(part), "no `{part}` in {reason}");
    }
    folder.edit("spec.yaml", "adapter.py]", "adapter.py], protocol: 1");
    folder.luxproof(&["check", "spec.yaml"]).exits(2).complains("engines.mine.protocol: is not a setting");
}

#[test]
fn the_users_own_bytes_lie_beside_the_table_with_what_they_name() {
    let folder = folder(&changed(&[
        ("    readings = []\n", "    readings = []\n    check(job)\n"),
        (
            "def answer(",
            "import hashlib, os


def check(job):
    for lamp in job[\"luminaires\"]:
        file = lamp[\"photometry\"]
        data = open(os.path.join(os.environ[\"LUXPROOF_SCENE_DIR\"], file[\"file\"]), \"rb\").read()
        assert hashlib.sha256(data).hexdigest() == file[\"sha256\"], file
        tilt = os.path.join(os.path.dirname(file[\"file\"]), \"tilt.dat\")
        beside = open(tilt).read() if os.path.exists(tilt) else \"\"
        with open(\"seen\", \"a\") as seen:
            print(file[\"format\"], file[\"sha256\"], file[\"by\"], lamp[\"flux_scale\"], beside.split(), file=seen)


def answer(",
        ),
    ]));
    let tilted = SKEW_LAMP.replace("TILT=NONE", "TILT=tilt.dat").replace("LM-63-2002", "LM-63-1995");
    folder.write("lamp.ies", &tilted);
    folder.write("tilt.dat", "1\n3\n0 90 180\n1 1 1\n");
    let (report, code) = elsewhere(&folder, "run", &["--format", "json"]).report();
    assert_eq!(code, Some(0), "{}", report["engines"]);
    let hash = Sha256::digest(&tilted).iter().fold(String::new(), |hash, byte| hash + &format!("{byte:02x}"));
    let seen = folder.read("seen");
    let own = format!("LM-63-1995 {hash} user 0.8 ['1', '3', '0', '90', '180', '1', '1', '1']\n");
    assert!(seen.contains(&own), "{own} {seen}");
    // Of scenes that no file says one is written.
    assert!(seen.lines().any(|line| line.starts_with("LM-63-2002 ") && line.ends_with(" luxproof 1.0 []")), "{seen}");
    // Other bytes that say the same are another question.
    folder.write("seen", "");
    folder.write("lamp.ies", &tilted.replacen("\nTILT", "\n[TEST] other\nTILT", 1));
    run(&folder);
    assert!(folder.read("seen").lines().filter(|line| line.contains(" user ")).count() >= 2, "{}", folder.read("seen"));
}

#[test]
fn blocks_tell_the_standard_error_and_one_that_they_belie_does_not_count() {
    let blocks = "\"blocks_lx\": blocks";
    let noise = "        blocks = noisy(lux, meter); lux = sum(blocks) / len(blocks)\n        readings.append";
    let noisy = "import random


def noisy(lux, meter):
    chance = random.Random(f\"{SEED} {meter['id']}\")
    return [lux * (1 + 3e-3 * chance.gauss(0, 1)) for _ in range(16)]


def answer(job):
    global SEED
    SEED = job[\"seed\"]";
    let report = |stated: &str| {
        let adapter = changed(&[(BOUND, stated), ("        readings.append", noise), ("def answer(job):", noisy)]);
        run(&folder(&adapter)).0
    };
    let reported = |stated: &str| {
        let report = report(stated);
        let of =
            |list: &str| among(&report, list, &[("engine", "mine"), ("procedure", "direct_illuminance")])[0].clone();
        (of("readings"), of("recordings"))
    };
    let (reading, recording) = reported(blocks);
    let relative = reading["std_error"].as_f64().unwrap() / reading["value"].as_f64().unwrap();
    assert!((2e-4..2e-3).contains(&relative), "{reading}");
    assert!((5.0..15.0).contains(&reading["uncertainty"]["degrees_of_freedom"].as_f64().unwrap()), "{reading}");
    assert!(recording["skewness"].is_number(), "{recording}");
    let (stated, ..) = reported(&format!("{blocks}, \"std_error_lx\": 8e-4 * lux, \"degrees_of_freedom\": 900"));
    let freedom = stated["uncertainty"]["degrees_of_freedom"].as_f64().unwrap();
    assert!((freedom - 900.0).abs() < 1e-6, "{stated}");
    let (belied, recording) = reported(&format!("{blocks}, \"std_error_lx\": 1e-6 * lux"));
    assert!(belied["std_error"].as_f64().unwrap() > 1e-4 * belied["value"].as_f64().unwrap(), "{belied}");
    assert!(recording["notes"].to_string().contains("the blocks count there"), "{recording}");
    for (wrong, says) in [
        ("\"blocks_lx\": [lux]", "one tells no error"),
        ("\"blocks_lx\": [lux, 2 * lux]", "where the mean of `blocks_lx` is"),
        ("\"exact\": True, \"std_error_lx\": 0.1", "what is exact has none"),
        ("\"degrees_of_freedom\": 7", "without `std_error_lx`"),
    ] {
        let report = report(wrong);
        let engine = of_adapter(&report, "engines", "id")[0];
        assert!(engine["status"] == "failed" && engine["reason"].as_str().unwrap().contains(says), "{wrong}: {engine}");
    }
}

#[test]
fn what_a_probe_says_ties_witnesses_and_is_part_of_what_runs() {
    let reported = "{\"protocol\": 2, \"name\": \"inverse square\", \"version\": \"1\", \"capabilities\": [\"batch\"], \"shares\": [\"a kernel\"], \"depends_on\": [\"table.txt\"]}";
    let folder = folder(&changed(&[(PROBED, reported)]));
    let mine = || {
        let (report, code) = run(&folder);
        (of_adapter(&report, "engines", "id")[0].clone(), report, code)
    };
    let (absent, _, code) = mine();
    assert!(absent["reason"].as_str().unwrap().contains("table.txt, which it depends on, is not there"), "{absent}");
    assert_eq!(code, Some(3));
    folder.write("table.txt", "1");
    let (before, report, _) = mine();
    let components = &of_adapter(&report, "recordings", "engine")[0]["components"];
    assert!(components.as_array().unwrap().contains(&"a kernel".into()), "{components}");
    folder.write("table.txt", "2");
    assert_ne!(before["fingerprint"], mine().0["fingerprint"]);
}

#[test]
fn an_adapter_whose_probe_fails_is_absent_with_the_reason() {
    let patient = MINE.replace("adapter.py]", "adapter.py], start_seconds: 2");
    let verb = "    if request[\"verb\"] == \"probe\":\n";
    for (engine, to, says) in [
        (MINE, "        sys.exit('no probes here')\n", "it ends with exit code 1: no probes here"),
        (MINE, "        return {\"name\": \"mine\"}\n", "it has no `protocol`"),
        (&patient, "        import time; time.sleep(60)\n", "`start_seconds` gives it more time"),
        (MINE, "        return {\"protocol\": 3}\n", "`protocol: 3` is not supported"),
        (MINE, "        return {\"protocol\": 2, \"version\": \"1\"}\n", "missing field `name`"),
        (MINE, "        return {\"protocol\": 2, \"name\": \" \", \"version\": \"1\"}\n", "must not be empty"),
    ] {
        let spec = [SKEW_ROOM, engine].concat();
        let adapter = changed(&[(verb, &format!("{verb}{to}"))]);
        let folder = Folder::new(&[("spec.yaml", &spec), ("lamp.ies", SKEW_LAMP), ("adapter.py", &adapter)]);
        let (report, code) = run(&folder);
        let engine = of_adapter(&report, "engines", "id")[0];
        assert!(engine["status"] == "absent" && engine["reason"].as_str().unwrap().contains(says), "{to}: {engine}");
        assert_eq!(code, Some(3));
    }
}

#[test]
fn one_job_of_a_batch_that_breaks_takes_no_other_with_it() {
    let bad = "    if job[\"procedure\"] == \"luminous_intensity\":\n        ";
    for (how, says) in [
        ("sys.exit('too many angles')\n", "too many angles"),
        ("return {\"failed\": \"too many angles\"}\n", "failed at this job: too many angles"),
        ("return {\"job\": \"other\"}\n", "gave no answer to the job `spec/luminous_intensity/1`"),
    ] {
        let (report, code) =
            run(&folder(&changed(&[("def answer(job):\n", &format!("def answer(job):\n{bad}{how}"))])));
        assert_eq!(code, Some(3));
        let engine = of_adapter(&report, "engines", "id")[0];
        assert!(engine["reason"].as_str().unwrap().contains(says), "{engine}");
        let read = among(&report, "readings", &[("engine", "mine"), ("procedure", "direct_illuminance")]);
        assert_eq!(read.len(), 3, "{how}");
    }
}

#[test]
fn a_log_that_is_named_is_there() {
    let folder = folder(&adapter_with_lines_before_readings("sys.exit('out of lamps')\n"));
    let named = |text: &str| {
        let at = text.find("messages are in ").unwrap_or_else(|| panic!("{text}")) + "messages are in ".len();
        let log = text[at..].split(['"', '\n', ' ', ';']).next().unwrap().trim_end_matches("\\n");
        assert!(std::fs::read_to_string(log).is_ok_and(|log| log.contains("out of lamps")), "`{log}` of {text}");
    };
    let (report, _) = run(&folder);
    named(of_adapter(&report, "engines", "id")[0]["reason"].as_str().unwrap());
    named(&folder.luxproof(&["engines", "doctor", "mine", "--spec", "spec.yaml"]).exits(3).stderr);
}
