//! Calibration is evidence: scenes of known answer are judged like any other, excuse nothing and stop nothing.

use serde_json::Value;

use crate::support::{Answer, Folder, LAMP, MINE, ROOM, SKEW_LAMP, SKEW_ROOM, TWO_METERS, adapter, among};

const PROCEDURES: [&str; 5] = ["luminous_intensity", "direct_illuminance", "point", "asymmetric", "luminaires"];

/// The example adapter with a part of it replaced.
fn folder(from: &str, to: &str) -> Folder {
    let adapter = adapter();
    assert!(adapter.contains(from));
    let spec = [SKEW_ROOM, MINE].concat();
    Folder::new(&[("spec.yaml", &spec), ("lamp.ies", SKEW_LAMP), ("adapter.py", &adapter.replace(from, to))])
}

fn run(folder: &Folder) -> Answer {
    folder.luxproof(&["run", "spec.yaml", "--out", "out"])
}

fn verdicts<'a>(report: &'a Value, procedure: &str) -> Vec<&'a str> {
    let mine = among(report, "comparisons", &[("engine", "mine"), ("procedure", procedure)]);
    mine.into_iter().map(|c| c["verdict"].as_str().unwrap()).collect()
}

const LUX: &str = "lux = illuminance_lx(";

#[test]
fn a_right_engine_passes_scenes_of_known_answer_and_says_which_it_declines() {
    let folder = folder(LUX, LUX);
    run(&folder).exits(0).prints("mine passes 3 scenes");
    folder.luxproof(&["report", "out", "--all"]).exits(0).prints("calibration: asymmetric");
    let report = folder.report();
    for procedure in PROCEDURES {
        let verdicts = verdicts(&report, procedure);
        assert!(!verdicts.is_empty() && verdicts.iter().all(|v| *v == "pass"), "{procedure}: {verdicts:?}");
    }
    let declined = among(&report, "skips", &[("case", "calibration"), ("engine", "mine"), ("procedure", "shadow")]);
    assert_eq!(declined.len(), 1, "{}", report["skips"]);
    // The simulator is held to the same closed forms.
    assert_eq!(
        among(&report, "comparisons", &[("case", "calibration"), ("engine", "simulator"), ("verdict", "pass")]).len(),
        70
    );
}

#[test]
fn a_factor_of_two_percent_fails_everywhere_and_is_said_to_be_none_that_is_known() {
    let folder = folder(LUX, "lux = 1.02 * illuminance_lx(");
    run(&folder).exits(1).prints("factor 1.0200, none of those known");
    let report = folder.report();
    for procedure in PROCEDURES {
        // Twice nothing is nothing: of meters that no light reaches none is off.
        let mine = among(&report, "comparisons", &[("engine", "mine"), ("procedure", procedure)]);
        let lit = mine.iter().filter(|c| c["reference"]["value"].as_f64().unwrap() > 0.0);
        let verdicts: Vec<&Value> = lit.map(|c| &c["verdict"]).collect();
        assert!(!verdicts.is_empty() && verdicts.iter().all(|v| *v == "fail"), "{procedure}: {verdicts:?}");
    }
    for c in among(&report, "comparisons", &[("engine", "mine"), ("verdict", "fail")]) {
        assert!(c["value"].is_number(), "a reading was lost: {c}");
        assert!(c["diagnosis"].as_str().unwrap().starts_with("factor 1.0200, none of those known"), "{c}");
    }
}

#[test]
fn faults_that_calibration_shows_too_are_named_on_the_terminal() {
    for (from, to, name) in [
        (LUX, "lux = math.pi * illuminance_lx(", "factor pi"),
        (LUX, "lux = 2 * illuminance_lx(", "factor 2"),
        ("* intensity_cd(lamp, ray) /", "* intensity_cd(lamp, ray) ** 2 /", "the candela are squared"),
        ("max(cosine, 0.0) *", "(cosine > 0.0) *", "the cosine at the meter is left out"),
        ("math.atan2(y, x)", "math.atan2(-y, x)", "C runs the other way round"),
    ] {
        let folder = folder(from, to);
        run(&folder).exits(1).prints(name);
        let report = folder.report();
        let lost = among(&report, "comparisons", &[("engine", "mine"), ("verdict", "missing")]);
        assert!(lost.is_empty(), "{name}: {lost:?}");
        let all = among(&report, "comparisons", &[("engine", "mine"), ("verdict", "undecided")]);
        assert!(all.is_empty(), "{name}: {all:?}");
    }
}

#[test]
fn what_is_left_out_is_said() {
    let folder = folder(LUX, LUX);
    let report = folder.run(&["--format", "json"]).exits(0).json();
    assert!(among(&report, "comparisons", &[("case", "calibration")]).is_empty());
    let skips = among(&report, "skips", &[("case", "calibration")]);
    assert!(skips[0]["reason"].as_str().unwrap().contains("--no-calibration"), "{skips:?}");
}

#[test]
fn the_doctor_examines_adapters_too() {
    let folder = folder(LUX, "lux = 1.02 * illuminance_lx(");
    let answer = folder.luxproof(&["engines", "doctor", "mine", "--spec", "spec.yaml"]).exits(1);
    let scene = answer.stdout.lines().find(|line| line.contains("calibration: asymmetric")).unwrap();
    assert_eq!(
        scene.split_whitespace().collect::<Vec<_>>().join(" "),
        "FAIL mine calibration: asymmetric 54 +2.0 % ±1 %"
    );
    folder
        .luxproof(&["engines", "doctor", "yours", "--spec", "spec.yaml"])
        .exits(2)
        .complains("there is no engine `yours`");
}

#[test]
fn copies_of_an_adapter_do_not_outvote_the_reference() {
    let wrong = adapter().replace(LUX, "lux = 1.06 * illuminance_lx(");
    for words in [["a.py", "b.py", "c.py"], ["a.py", "-u, a.py", "-B, a.py"]] {
        let engine = |(name, words): (char, &str)| format!("  {name}: {{command: [python3, {words}]}}\n");
        let engines: String = ['a', 'b', 'c'].into_iter().zip(words).map(engine).collect();
        let spec = [SKEW_ROOM, "engines:\n", &engines].concat();
        let folder = Folder::new(&[
            ("spec.yaml", &spec),
            ("lamp.ies", SKEW_LAMP),
            ("a.py", &wrong),
            ("b.py", &wrong),
            ("c.py", &wrong),
        ]);
        let report = folder.run(&["--format", "json"]).exits(1).json();
        let all = report["consensus"].as_array().unwrap();
        assert!(!all.is_empty());
        for consensus in all {
            let outliers = consensus["outliers"].as_array().unwrap();
            assert!(!outliers.iter().any(|d| d == "simulator" || d == "iesna"), "{consensus}");
            let (all, independent) = (consensus["witnesses"].as_array().unwrap().len(), &consensus["independent"]);
            assert!(independent.as_u64().unwrap() as usize <= all - 2, "{consensus}");
        }
    }
}

/// What is kept of our simulator is made wrong, as if it had read so: the renderers share nothing with it but our reader of files.
#[test]
fn a_fault_in_our_own_simulator_is_named_by_the_renderers() {
    let procedure =
        "  indirect_illuminance: {meters: plane, bounces: 2}\nbudget: {relative_error: 0.005, seconds: 60}\n";
    // Zonal cavity knows no bodies.
    let table = "obstacles:\n  - box: {min_m: [2, 1, 0], max_m: [4, 2, 0.7], reflectance: 0.4}\n";
    let spec = [ROOM, table, TWO_METERS, "procedures:\n", procedure].concat();
    let folder = Folder::for_renderers(&[("spec.yaml", &spec), ("lamp.ies", LAMP)]);
    let asked = ["--engines", "simulator,mitsuba,povray,radiance", "--format", "json"];
    let right = folder.run(&asked).exits(0).json();
    assert!(right["consensus"][0]["outliers"].as_array().unwrap().is_empty(), "{}", right["consensus"]);
    let kept = std::fs::read_dir(folder.path("cache/simulator")).unwrap().map(|file| file.unwrap().path());
    // Beside answers lie lists of their meters.
    for kept in kept.filter(|path| path.extension().is_some_and(|e| e == "json")) {
        let name = format!("cache/simulator/{}", kept.file_name().unwrap().to_string_lossy());
        let answer: Value = folder.json(&name)["body"]["answer"]["Ok"]["estimates"].clone();
        for estimate in answer.as_array().unwrap() {
            let value = estimate["value"].as_f64().unwrap();
            folder.forge(&name, &format!("\"value\":{value}"), &format!("\"value\":{}", 1.08 * value));
        }
    }
    let wrong = folder.run(&asked).json();
    assert_eq!(wrong["consensus"][0]["outliers"], serde_json::json!(["simulator"]), "{}", wrong["consensus"]);
    assert!(wrong["consensus"][0]["odds"].as_f64().unwrap() > 19.0, "{}", wrong["consensus"]);
}

#[test]
fn an_edited_module_of_an_adapter_is_noticed_at_the_next_run_however_it_is_loaded() {
    for (words, place) in [
        ("python3, adapter.py", "."),
        ("python3, -m, adapter", "."),
        ("sh, run.sh", "."),
        ("python3, adapter.py", "vendor/deep"),
    ] {
        let imports = format!("import sys\nsys.path.insert(0, '{place}')\nfrom scale import FACTOR\n");
        let scaled = imports + &adapter().replace(LUX, "lux = FACTOR * illuminance_lx(");
        let spec = format!("{SKEW_ROOM}engines:\n  mine: {{command: [{words}]}}\n");
        let starter = ("run.sh", "exec python3 adapter.py\n");
        let folder = Folder::new(&[("spec.yaml", &spec), ("lamp.ies", SKEW_LAMP), ("adapter.py", &scaled), starter]);
        std::fs::create_dir_all(folder.path(place)).unwrap();
        let module = format!("{place}/scale.py");
        folder.write(&module, "FACTOR = 1.0\n");
        let first = folder.run(&["--format", "json"]).exits(0).json();
        folder.run(&[]).exits(0).complains("from the cache");
        folder.write(&module, "FACTOR = 1.500\n");
        let second = folder.run(&["--format", "json"]).exits(1).json();
        let of = |report: &Value| among(report, "engines", &[("id", "mine")])[0]["fingerprint"].clone();
        assert!(of(&first).is_string() && of(&first) != of(&second), "{words}: {} {}", of(&first), of(&second));
    }
}

/// The example adapter that knows shadows of boxes, and the reflected light of a furnace from its table's flux.
fn knowing() -> String {
    let declines = "    if job[\"light\"] != \"direct\":\n        return {\"declined\": \"the inverse-square law knows direct light only\"}\n    if job[\"obstacles\"]:\n        return {\"declined\": \"the inverse-square law knows no shadows\"}\n";
    let reads = "lux = illuminance_lx(job[\"luminaires\"], meter)";
    let adapter = adapter();
    assert!(adapter.contains(declines) && adapter.contains(reads));
    let furnace = "    if job[\"light\"] != \"direct\":
        rho = set(job[\"room\"][\"reflectance\"].values())
        if len(rho) > 1:
            return {\"declined\": \"one reflectance only\"}
        rho, (x, y, z) = rho.pop(), job[\"room\"][\"size_m\"]
        steps = [(math.radians(3 * k + 1.5), math.radians(6 * j + 3)) for k in range(60) for j in range(60)]
        flux = sum(intensity_cd(job[\"luminaires\"][0], (math.sin(g) * math.cos(c), math.sin(g) * math.sin(c), -math.cos(g))) * math.sin(g) for g, c in steps) * math.radians(3) * math.radians(6)
        lux = LOSS * rho / (1 - rho) * flux / (2 * (x * y + y * z + z * x))
        return {\"readings\": [{\"meter\": m[\"id\"], \"illuminance_lx\": lux, \"error_bound_lx\": 1e-3 * lux} for m in job[\"meters\"]]}
";
    let hidden = "LOSS = 1.0
def hidden(lamp, meter, job):
    for box in job[\"obstacles\"]:
        low, high = 0.0, 1.0
        for p, q, a, b in zip(lamp[\"position_m\"], meter[\"position_m\"], box[\"min_m\"], box[\"max_m\"]):
            ends = sorted([(a - p) / (q - p), (b - p) / (q - p)]) if p != q else [0.0, 1.0] if a <= p <= b else [1.0, 0.0]
            low, high = max(low, ends[0]), min(high, ends[1])
        if low < high:
            return True
    return False


def answer(";
    let lit = "lux = illuminance_lx([l for l in job[\"luminaires\"] if not hidden(l, meter, job)], meter)";
    let able = adapter.replace("[\"batch\"]", "[\"batch\", \"obstacles\", \"bounces\"]");
    assert_ne!(able, adapter);
    able.replace(declines, furnace).replace(reads, lit).replace("def answer(", hidden)
}

#[test]
fn a_leak_fails_the_shadow_and_lost_reflections_the_furnace_and_nothing_else() {
    let spec = [SKEW_ROOM, "  indirect_illuminance: {meters: plane}\n", MINE].concat();
    for (from, to, fails) in
        [("LOSS", "LOSS", ""), ("if low < high:", "if False:", "shadow"), ("LOSS = 1.0", "LOSS = 0.75", "furnace")]
    {
        let adapter = knowing();
        assert!(adapter.contains(from));
        let folder =
            Folder::new(&[("spec.yaml", &spec), ("lamp.ies", SKEW_LAMP), ("adapter.py", &adapter.replace(from, to))]);
        run(&folder).exits(i32::from(!fails.is_empty()));
        let report = folder.report();
        for procedure in ["direct_illuminance", "point", "asymmetric", "luminaires", "shadow", "furnace"] {
            let verdicts = verdicts(&report, procedure);
            let failed = verdicts.contains(&"fail");
            assert!(!verdicts.is_empty() && failed == (procedure == fails), "{fails}, {procedure}: {verdicts:?}");
            assert!(!verdicts.contains(&"missing"), "{fails}, {procedure}: {verdicts:?}");
        }
    }
}

#[test]
fn scenes_of_known_answer_are_read_once_for_each_setting_of_an_engine_whatever_the_specs() {
    let spec = [SKEW_ROOM, MINE].concat();
    let settings = spec.replace("adapter.py]", "adapter.py], quality: high");
    let adapter = adapter();
    let folder = Folder::new(&[
        ("a.yaml", &spec),
        ("b.yaml", &spec),
        ("c.yaml", &settings),
        ("lamp.ies", SKEW_LAMP),
        ("adapter.py", &adapter),
        ("calibration.yaml", &spec),
    ]);
    let known = |specs: &[&str]| {
        let report =
            folder.luxproof(&[&["run"][..], specs, &["--out", "out", "--format", "json"]].concat()).exits(0).json();
        let all = report["comparisons"].as_array().unwrap().iter();
        let mine = all.filter(|c| c["engine"] == "mine" && c["case"].as_str().unwrap().starts_with("calibration"));
        let cases: Vec<String> = report["cases"].as_array().unwrap().iter().map(|c| c["name"].to_string()).collect();
        (mine.count(), cases.len())
    };
    assert_eq!(known(&["a.yaml"]), (66, 2));
    assert_eq!(known(&["a.yaml", "b.yaml"]), (66, 3));
    assert_eq!(known(&["a.yaml", "b.yaml", "c.yaml"]), (132, 5));
    folder.luxproof(&["run", "calibration.yaml"]).exits(2).complains("give the spec another name");
}

#[test]
fn every_view_shows_scenes_of_known_answer_and_a_baseline_needs_none_of_them() {
    let folder = folder(LUX, LUX);
    run(&folder).exits(0);
    for (view, says) in [
        ("markdown", "| calibration: point | closed form |"),
        ("junit", "<testsuite name=\"calibration\""),
        ("html", "Calibration: point"),
        ("csv", "calibration,point"),
    ] {
        folder.luxproof(&["report", "out/report.json", "--format", view]).exits(0).prints(says);
    }
    folder.luxproof(&["accept", "out", "--all", "--reason", "first look"]).exits(0);
    assert!(!folder.read("baselines/spec.json").contains("calibration"));
    folder.luxproof(&["run", "spec.yaml", "--out", "out", "--baseline", "baselines"]).exits(0);
}
