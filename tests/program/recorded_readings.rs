//! Recorded readings: values of a program that cannot be run here are judged like readings, and never judge others.

use serde_json::Value;

use crate::support::{Folder, LAMP, ROOM, TWO_METERS};

const RECORDED: &str = "engines:
  iray-2016: {readings: iray.csv, version: \"2016\", source: a report}
procedures:
  direct_illuminance: {meters: plane}
  indirect_illuminance: {meters: plane}
";

/// E = I cos(gamma) / d²: 100 cd at 1.7 m; 82.414 cd at 52.76 degrees and 2.809 m, linear between 100 cd and 80 cd at 60 degrees.
const RIGHT: &str = "procedure,meter,value
direct_illuminance,plane[0],6.32
direct_illuminance,plane[1],34.60
";

fn room(csv: &str) -> Folder {
    let folder = Folder::new(&[("spec.yaml", &[ROOM, TWO_METERS, RECORDED].concat()), ("lamp.ies", LAMP)]);
    folder.write("iray.csv", csv);
    folder
}

/// The verdicts of the recorded engine, by meter.
fn verdicts(report: &Value) -> Vec<(String, String)> {
    let comparisons = report["comparisons"].as_array().unwrap().iter();
    let own = comparisons.filter(|c| c["engine"] == "iray-2016");
    own.map(|c| (c["meter"].as_str().unwrap().to_owned(), c["verdict"].as_str().unwrap().to_owned())).collect()
}

fn pairs(expected: [(&str, &str); 2]) -> Vec<(String, String)> {
    expected.map(|(meter, verdict)| (meter.to_owned(), verdict.to_owned())).to_vec()
}

#[test]
fn right_values_pass_and_one_wrong_cell_fails_there_and_nowhere_else() {
    let folder = room(RIGHT);
    folder.run(&["--all"]).exits(0).prints("recorded, 2016");
    assert_eq!(verdicts(&folder.report()), pairs([("plane[0]", "pass"), ("plane[1]", "pass")]));
    let skips = folder.report()["skips"].to_string();
    assert!(skips.contains("no value of this procedure"), "{skips}");

    let folder = room(&RIGHT.replace("6.32", "6.52"));
    folder.run(&[]).exits(1);
    assert_eq!(verdicts(&folder.report()), pairs([("plane[0]", "fail"), ("plane[1]", "pass")]));
}

#[test]
fn rounding_is_part_of_the_error_budget() {
    // 6.3 stands for 6.25 to 6.35, which is within the tolerance of 1 % and its rounding.
    let folder = room(&RIGHT.replace("6.32", "6"));
    folder.run(&[]).exits(4);
    assert_eq!(verdicts(&folder.report())[0].1, "undecided");
}

#[test]
fn a_point_without_a_value_is_missing_and_one_that_the_spec_lacks_is_refused() {
    let folder = room("procedure,meter,value\ndirect_illuminance,plane[1],34.60\n");
    folder.run(&[]).exits(1);
    assert_eq!(verdicts(&folder.report()), pairs([("plane[0]", "missing"), ("plane[1]", "pass")]));

    let folder = room(&[RIGHT, "direct_illuminance,plane[7],1.0\n"].concat());
    folder.run(&[]).exits(2).complains("plane[7]");
    let folder = room(&RIGHT.replace("6.32", "bright"));
    folder.run(&[]).exits(2).complains("iray.csv:2").complains("no number");
}

#[test]
fn recorded_readings_are_no_witness_no_baseline_and_never_stand_for_a_renderer() {
    let folder = room(RIGHT);
    folder.run(&[]).exits(0);
    let consensus = folder.report()["consensus"].to_string();
    assert!(!consensus.contains("iray-2016"), "{consensus}");
    folder.luxproof(&["accept", "out", "--all", "--reason", "test"]).exits(0);
    for file in std::fs::read_dir(folder.path("baselines")).unwrap() {
        let text = std::fs::read_to_string(file.unwrap().path()).unwrap();
        assert!(!text.contains("iray-2016"), "{text}");
    }
    for name in ["simulator", "mitsuba", "mitsuba@3.5.2"] {
        let folder = room(RIGHT);
        folder.edit("spec.yaml", "iray-2016", name);
        folder.run(&[]).exits(2).complains("never stand for it");
    }
}

#[test]
fn a_strangers_recorded_readings_lie_below_the_spec() {
    let folder = room(RIGHT);
    folder.run(&["--untrusted"]).exits(0);
    folder.edit("spec.yaml", "readings: iray.csv", "readings: /etc/passwd");
    let answer = folder.run(&["--untrusted"]).exits(2);
    assert!(!answer.stderr.contains("root:"), "{}", answer.stderr);
}

#[test]
fn a_bundle_takes_the_file_of_recorded_readings_with_it() {
    let folder = room(RIGHT);
    folder.run(&[]).exits(0);
    folder.luxproof(&["bundle", "out", "--out", "whole.zip"]).exits(0);
    std::fs::remove_file(folder.path("iray.csv")).unwrap();
    folder.luxproof(&["reproduce", "whole.zip"]).exits(0);
}

#[test]
fn the_study_of_cycles_finds_the_roof_right_and_the_wall_point_of_the_panel_wrong() {
    let folder = Folder::new(&[]);
    let spec = crate::support::root().join("reference/studies/cycles-cie171-2026/cycles.yaml").display().to_string();
    folder.luxproof(&["run", &spec, "--out", "out", "--no-calibration"]).exits(1);
    let report = folder.report();
    let comparisons = report["comparisons"].as_array().unwrap().iter();
    let failed = comparisons.filter(|c| c["engine"] == "cycles-5-published" && c["verdict"] == "fail");
    let failed: Vec<String> = failed.map(|c| format!("{} {}", c["case"], c["meter"]).replace('"', "")).collect();
    // Lambertian panel, E by quadrature: 32.677, 75.194 and 69.061 lx; point source: E = 1000 cos^4 / 9 m2 = 49.383 lx.
    assert_eq!(
        failed,
        ["cycles/point floor[9]", "cycles/panel wall[0]", "cycles/panel wall[1]", "cycles/panel wall[3]"]
    );
}
