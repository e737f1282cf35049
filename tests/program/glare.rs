//! The unified glare rating: the formula by what an engine reads at the eye, judged in units, and refused where it rates nothing.

use std::f64::consts::{LN_10, PI};

use crate::support::{Folder, at_meter};

/// A panel of .6 x .6 m and 1000 cd in a room of several reflectances, seen by two.
const SPEC: &str = "luxproof: 1
room:
  size_m: [6, 4, 3]
  reflectance: {floor: 0.2, walls: 0.5, ceiling: 0.7}
luminaires:
  - {id: panel, photometry: panel.ies, at_m: [4, 2, 2.9], model: point}
meters:
  eyes: {points_m: [[0.5, 2, 1.15], [0.5, 1.3, 1.5]], normal: [3, 0, 0]}
procedures:
  unified_glare_rating: {meters: eyes}
  indirect_illuminance: {meters: eyes}
budget: {relative_error: 0.004, seconds: 20}
";

/// Lambertian but for the straight lines between its angles.
fn panel(side_m: f64) -> String {
    let gammas: Vec<String> = (0..=18).map(|k| (5 * k).to_string()).collect();
    let candela: Vec<String> =
        (0..=18).map(|k| (1000.0 * f64::from(5 * k).to_radians().cos().max(0.0)).to_string()).collect();
    format!(
        "IESNA:LM-63-2002\nTILT=NONE\n1 -1 1 19 1 1 2 {side_m} {side_m} 0\n1 1 0\n{}\n0\n{}\n",
        gammas.join(" "),
        candela.join(" ")
    )
}

#[test]
fn a_rating_is_the_formula_of_the_indirect_light_that_each_engine_reads() {
    let folder = Folder::for_renderers(&[("spec.yaml", SPEC), ("panel.ies", &panel(0.6))]);
    let args = ["--engines", "simulator,radiance", "--sampling", "accurate", "--format", "json"];
    let (report, code) = folder.run(&args).report();
    assert!(matches!(code, Some(0 | 2)), "{}", report["summary"]);
    let of = |list, engine, procedure, meter| at_meter(&report, list, engine, procedure, meter);
    // Above and beside over along: (.5, 0) and (.4, .2), entries 2.86 and 2.20 of CIE 117's table.
    for (meter, [ahead, aside, above], index) in
        [("eyes[0]", [3.5, 0.0, 1.75], 2.86), ("eyes[1]", [3.5, 0.7, 1.4], 2.20)]
    {
        let square: f64 = ahead * ahead + aside * aside + above * above;
        let cosine = above / square.sqrt();
        for engine in ["simulator", "radiance"] {
            let rating = of("readings", engine, "unified_glare_rating", meter);
            let lux = of("readings", engine, "indirect_illuminance", meter)["value"].as_f64().unwrap();
            assert_eq!(rating["quantity"], "unified_glare_rating", "{rating}");
            let (luminance, solid) = (1000.0 / 0.36, 0.36 * cosine / square);
            let right = 8.0 * (0.25 * PI / lux * luminance * luminance * solid / (index * index)).log10();
            let value = rating["value"].as_f64().unwrap();
            // A table of 5 degrees is straight where a cosine bends: 1e-3 of the intensity, which counts twice; and each procedure has samples
            // of its own.
            let noise = rating["std_error"].as_f64().unwrap_or(0.0);
            assert!(
                (value - right).abs() < 8.0 / LN_10 * 2e-3 + 4.0 * noise,
                "{engine} {meter}: {value} {right} {noise}"
            );
            let compared = of("comparisons", "radiance", "unified_glare_rating", meter);
            assert!(compared["verdict"] != "fail" && compared["relative_deviation"].is_null(), "{compared}");
            assert_eq!(compared["tolerance"], serde_json::json!({"relative": 0.0, "absolute": 0.1}), "{compared}");
        }
        // Its own error is that of the light, times 8 / ln 10, where first looks decide, as they do at a seventh of the tolerance.
        let read = |procedure| of("readings", "radiance", procedure, meter);
        let [rating, lux] = ["unified_glare_rating", "indirect_illuminance"].map(read);
        let relative = lux["std_error"].as_f64().unwrap() / lux["value"].as_f64().unwrap();
        let ratio = rating["std_error"].as_f64().unwrap() / (8.0 / LN_10 * relative);
        assert!((0.5..2.0).contains(&ratio), "{meter}: {ratio}");
    }
}

#[test]
fn an_eye_that_sees_no_glare_is_refused_and_a_glare_that_is_not_rated_a_warning() {
    for (from, to, side_m, reported) in [
        ("[3, 0, 0]", "[0, 0, 1]", 0.6, "eyes[0] at [0.5, 2, 1.15] looks straight up or down"),
        ("[3, 0, 0]", "[-1, 0, 0]", 0.6, "sees no luminous opening"),
        ("{floor: 0.2, walls: 0.5, ceiling: 0.7}", "{floor: 0, walls: 0, ceiling: 0}", 0.6, "no surface reflects"),
        ("[3, 0, 0]", "[1, 0, 0]", 0.0, "sees `panel`, whose photometric file gives no luminous area"),
    ] {
        let spec = SPEC.replacen(from, to, 1);
        assert_ne!(spec, SPEC);
        let folder = Folder::new(&[("spec.yaml", &spec), ("panel.ies", &panel(side_m))]);
        let answer = folder.luxproof(&["check", "spec.yaml"]);
        assert!(answer.message().contains(reported) && answer.code == Some(2), "{reported}: {}", answer.stderr);
    }
    let folder = Folder::new(&[("spec.yaml", SPEC), ("panel.ies", &panel(0.02))]);
    let answer = folder.luxproof(&["check", "spec.yaml"]);
    assert!(answer.stderr.contains("CIE 117") && answer.code == Some(0), "{}", answer.stderr);
}
