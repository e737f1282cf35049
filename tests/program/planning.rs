//! Planning in whole runs: what follows from other readings is not rendered, is said, is checked, and any number of jobs says the same.

use std::fs;

use serde_json::Value;

use crate::support::{Folder, MINE, ROOM, adapter, among};

/// A symmetric room, the same at half the light, and its uplit twin.
const MEASURED: &str = "meters:
  plane: {grid: {origin_m: [0.5, 0.5, 0.8], u_m: [1, 0, 0], v_m: [0, 1, 0], counts: [6, 4]}, normal: [0, 0, 1]}
procedures:
  direct_illuminance: {meters: plane}
cases:
  - {name: whole}
  - {name: dimmed, luminaires: {lamp: {flux_scale: 0.5}}}
  - {name: above, luminaires: {lamp: {at_m: [3, 2, 0.4]}}}
";

/// Symmetric in both axes.
const LAMP: &str = "IESNA:LM-63-2002
TILT=NONE
1 -1 1 4 3 1 2 0 0 0
1 1 0
0 60 80 90
0 45 90
100 80 10 0
100 70 20 0
100 40 30 0
";

struct Lab(Folder);

impl Lab {
    /// The example adapter with a replacement; it notes how many meters it was asked for.
    fn new(from: &str, to: &str) -> Self {
        let example = adapter();
        let noting = "    open('asked', 'a').write(f\"{job['case']} {len(job['meters'])}\\n\")\n    readings = []\n";
        let noting = example.replace("    readings = []\n", noting);
        assert_ne!(noting, example);
        let changed = noting.replace(from, to);
        assert!(from.is_empty() || changed != noting);
        let spec = [ROOM, MEASURED, MINE].concat();
        Self(Folder::new(&[("spec.yaml", &spec), ("lamp.ies", LAMP), ("adapter.py", &changed)]))
    }

    fn run(&self, more: &[&str]) -> (Value, Option<i32>) {
        self.0.run(&[&["--format", "json", "--no-cache"], more].concat()).report()
    }

    /// The meters that the adapter was asked for in the spec's cases, since the last time.
    fn asked(&self) -> usize {
        let text = fs::read_to_string(self.0.path("asked")).unwrap_or_default();
        fs::remove_file(self.0.path("asked")).ok();
        let of_spec = text.lines().filter(|l| l.starts_with("spec/"));
        of_spec.map(|l| l.split(' ').nth(1).unwrap().parse::<usize>().unwrap()).sum()
    }
}

fn values(report: &Value) -> Vec<(String, f64)> {
    let name = |r: &Value| format!("{} {} {} {}", r["case"], r["procedure"], r["engine"], r["meter"]);
    report["readings"].as_array().unwrap().iter().map(|r| (name(r), r["value"].as_f64().unwrap())).collect()
}

fn verdicts(report: &Value) -> Vec<String> {
    let one = |c: &Value| {
        format!("{} {} {} {} {}", c["case"], c["engine"], c["meter"], c["reference"]["basis"], c["verdict"])
    };
    report["comparisons"].as_array().unwrap().iter().map(one).collect()
}

#[test]
fn what_follows_is_not_rendered_and_reads_and_is_judged_the_same() {
    let spec = [ROOM, MEASURED].concat();
    let folder = Folder::for_renderers(&[("spec.yaml", &spec), ("lamp.ies", LAMP)]);
    let run = |more: &[&str]| {
        let fixed = ["--format", "json", "--no-cache", "--engines", "radiance"];
        folder.run(&[&fixed, more].concat()).report()
    };
    let (whole, code) = run(&["--no-skips"]);
    assert_eq!(code, Some(0), "{}", whole["engines"]);
    let (planned, code) = run(&[]);
    assert_eq!(code, Some(0), "{}", planned["engines"]);
    assert_eq!(verdicts(&whole), verdicts(&planned));
    for ((name, a), (same, b)) in values(&whole).into_iter().zip(values(&planned)) {
        // Coordinates of single precision.
        assert!(name == same && (a - b).abs() <= 1e-5 * a.abs(), "{name}: {a} and {b}");
    }
    let says = |case: &str, engine: &str, what: &str| {
        let skips = among(&planned, "skips", &[("case", case), ("engine", engine)]);
        let found = skips.iter().find(|s| s["reason"].as_str().unwrap().contains(what));
        let found = found.unwrap_or_else(|| panic!("{case}: no `{what}` in {skips:?}"));
        assert!(found["saved"].as_str().unwrap().contains('%'), "{found}");
    };
    says("spec/whole", "radiance", "only 6 of 24 points are rendered");
    says("spec/dimmed", "simulator", "rescaled by 0.5");
    says("spec/above", "radiance", "no luminaire sends light straight to 24 of 24 meters");
    let skips = whole["skips"].as_array().unwrap();
    assert!(skips.iter().all(|s| s["case"] == "calibration" && s["engine"] == "all"), "{skips:?}");
    // A twentieth of what each run leaves out: of 18 meters that mirror others, of 24 that are rescaled, of 24 dark ones.
    for (case, drawn) in [("spec/whole", 1), ("spec/dimmed", 2), ("spec/above", 2)] {
        let effort = &among(&planned, "recordings", &[("case", case), ("engine", "radiance")])[0]["effort"];
        assert_eq!(effort["spot_checked"].as_str().unwrap().split(", ").count(), drawn, "{case}: {effort}");
    }
    let mirrored = &among(&planned, "recordings", &[("engine", "radiance")])[0]["effort"]["mirrored_meters"];
    assert!(mirrored.as_str().unwrap().contains("plane[23] is plane[0] (x -> -x, y -> -y)"), "{mirrored}");
    // What follows does not count as rendered; a spot check does.
    for format in ["markdown", "html"] {
        let report = folder.luxproof(&["report", "out", "--format", format]).stdout;
        assert!(report.contains("rendered, ") && report.contains(" by symmetry"), "{format}: {report}");
    }
    folder.luxproof(&["report", "out"]).prints("points: rendered + by symmetry");
    let check = folder.luxproof(&["check", "spec.yaml", "--engines", "radiance"]);
    check.prints("only 6 of 24 points are rendered");
}

#[test]
fn a_program_of_a_users_is_asked_for_everything() {
    let lab = Lab::new("", "");
    let (whole, code) = lab.run(&["--no-skips"]);
    assert_eq!(code, Some(0), "{}", whole["engines"]);
    let asked = lab.asked();
    // Each meter once, and a part of each case with other seeds.
    assert!(asked > 3 * 24, "{asked}");
    let (planned, code) = lab.run(&[]);
    assert_eq!((lab.asked(), code), (asked, Some(0)), "{}", planned["skips"]);
    assert_eq!(verdicts(&whole), verdicts(&planned));
    let skips = among(&planned, "skips", &[("engine", "mine")]);
    assert!(skips.is_empty(), "{skips:?}");
    for recording in among(&planned, "recordings", &[("engine", "mine")]) {
        assert!(recording["effort"]["mirrored_meters"].is_null(), "{recording}");
    }
}

#[test]
fn what_a_program_reads_wrong_in_symmetric_or_dark_places_fails() {
    let from = "        lux = illuminance_lx(job[\"luminaires\"], meter)\n";
    for (case, wrong, fails) in [
        // A third more in one half of the room, and in one quarter of it.
        ("whole", "lux *= 1.33 if meter['position_m'][0] > 3 else 1.0", 12),
        ("whole", "lux *= 1.33 if min(meter['position_m'][0] - 3, meter['position_m'][1] - 2) > 0 else 1.0", 6),
        // Light where none gets to, at one meter.
        ("above", "lux += 10.0 if meter['id'] == 'plane[7]' else 0.0", 1),
    ] {
        let lab = Lab::new(from, &format!("{from}        {wrong}\n"));
        let (report, code) = lab.run(&["--filter", case]);
        let failed = among(&report, "comparisons", &[("engine", "mine"), ("verdict", "fail")]);
        assert_eq!((failed.len(), code), (fails, Some(1)), "{wrong}: {}", report["engines"]);
    }
}

#[test]
fn any_number_of_jobs_says_the_same_to_the_byte_but_for_times() {
    let lab = Lab::new("", "");
    let said = |jobs: &str| {
        let (mut report, code) = lab.run(&["--jobs", jobs]);
        assert_eq!(code, Some(0));
        timeless(&mut report);
        serde_json::to_string_pretty(&report).unwrap()
    };
    let alone = said("1");
    for jobs in ["2", "3", "16"] {
        assert!(said(jobs) == alone, "--jobs {jobs} says something else");
    }
}

/// Takes out what the clock says.
fn timeless(value: &mut Value) {
    match value {
        Value::Object(map) => {
            map.remove("wall_s");
            map.remove("started");
            map.values_mut().for_each(timeless);
        }
        Value::Array(list) => list.iter_mut().for_each(timeless),
        _ => {}
    }
}
