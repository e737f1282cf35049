//! The mean luminance of a luminous opening: one for all eyes where the opening has one, and refused where none shows.

use std::f64::consts::PI;

use crate::support::{Folder, at_meter};

/// A ball of 20 cm, of 100 cd all around, in a room whose light does not count; one eye is 5 cm off it.
const SPEC: &str = "luxproof: 1
room:
  size_m: [4, 4, 3]
  reflectance: {floor: 0.2, walls: 0.5, ceiling: 0.7}
luminaires:
  - {id: ball, photometry: ball.ies, at_m: [2, 2, 1.5], flux_scale: 0.5, model: area}
  - {id: other, photometry: ball.ies, at_m: [1, 1, 1]}
meters:
  eyes: {points_m: [[2.15, 2, 1.5], [0.5, 3.5, 0.4]], normal: [0, 0, 1]}
procedures:
  opening_luminance: {luminaire: ball, meters: eyes}
budget: {relative_error: 0.002, seconds: 10}
";

/// A table that is even, with an opening by its three dimensions.
fn even(opening: &str) -> String {
    format!("IESNA:LM-63-2002\nTILT=NONE\n1 -1 1 3 1 1 2 {opening}\n1 1 0\n0 90 180\n0\n100 100 100\n")
}

#[test]
fn a_ball_is_as_bright_from_near_and_far() {
    let folder = Folder::for_renderers(&[("spec.yaml", SPEC), ("ball.ies", &even("-0.2 -0.2 -0.2"))]);
    let (report, code) = folder.run(&["--engines", "simulator,mitsuba", "--format", "json"]).report();
    assert_eq!(code, Some(0), "{}", report["summary"]);
    let luminance = 50.0 / (PI * 0.01);
    for meter in ["eyes[0]", "eyes[1]"] {
        for (engine, off) in [("simulator", 1e-6), ("mitsuba", 5e-3)] {
            let reading = at_meter(&report, "readings", engine, "opening_luminance", meter);
            assert_eq!(reading["quantity"], "luminance_cd_m2", "{reading}");
            let value = reading["value"].as_f64().unwrap();
            assert!((value / luminance - 1.0).abs() < off, "{engine} {meter}: {value} {luminance}");
        }
    }
    // Of what two eyes see there is no uniformity.
    assert_eq!(report["statistics"], serde_json::json!([]));
}

#[test]
fn an_eye_to_which_no_opening_shows_is_refused() {
    for (from, to, opening, reported) in [
        ("luminaire: ball,", "luminaire: bal,", "-0.2 -0.2 -0.2", "there is no luminaire `bal`"),
        ("meters: eyes", "meters: eye", "-0.2 -0.2 -0.2", "there is no meter set `eye`"),
        ("[2.15, 2, 1.5]", "[2.05, 2, 1.5]", "-0.2 -0.2 -0.2", "eyes[0] at [2.05, 2, 1.5] sees no luminous area"),
        (
            "[0.5, 3.5, 0.4]",
            "[0.5, 3.5, 1.5]",
            "0.3 0.2 0",
            "eyes[0] at [2.15, 2, 1.5] sees no luminous area of `ball`",
        ),
        ("model: area", "model: point", "0 0 0", "a point by its file"),
        (
            "points_m: [[2.15, 2, 1.5], [0.5, 3.5, 0.4]]",
            "grid: {origin_m: [0.1, 0.1, 0.1], u_m: [0.01, 0, 0], v_m: [0, 0.01, 0], counts: [201, 100]}",
            "-0.2 -0.2 -0.2",
            "20100 observers",
        ),
    ] {
        let spec = SPEC.replacen(from, to, 1);
        assert_ne!(spec, SPEC);
        let folder = Folder::new(&[("spec.yaml", &spec), ("ball.ies", &even(opening))]);
        let answer = folder.luxproof(&["check", "spec.yaml"]);
        assert!(answer.message().contains(reported) && answer.code == Some(2), "{reported}: {}", answer.stderr);
    }
}
