//! Luminance of diffuse surfaces: rho / pi of all light, whoever reads it, and refused where there is no surface.

use std::f64::consts::PI;

use crate::support::{Folder, LAMP, at_meter};

/// A desk in a room of three reflectances; on its top, its side, the floor, a wall and the ceiling lies a meter each.
const SURFACES: &str = "luxproof: 1
room:
  size_m: [4, 3, 2.5]
  reflectance: {floor: 0.2, walls: 0.5, ceiling: 0.7}
obstacles:
  - {box: {min_m: [1, 1, 0], max_m: [2, 2, 0.7], reflectance: 0.35}}
luminaires:
  - {id: lamp, photometry: lamp.ies, at_m: [2.5, 1.5, 2]}
meters:
  top: {points_m: [[1.5, 1.5, 0.701]], normal: [0, 0, 1]}
  side: {points_m: [[2.001, 1.5, 0.4]], normal: [1, 0, 0]}
  floor: {points_m: [[3, 2, 0.001]], normal: [0, 0, 2]}
  wall: {points_m: [[0.001, 2, 1]], normal: [1, 0, 0]}
  ceiling: {surface: {of: ceiling, distance_m: 0.001, counts: [1, 1]}}
procedures:
  luminance: {meters: [top, side, floor, wall, ceiling]}
  total_illuminance: {meters: [top, side, floor, wall, ceiling]}
budget: {relative_error: 0.01, seconds: 10}
";

const REFLECTANCES: [(&str, f64); 5] =
    [("top[0]", 0.35), ("side[0]", 0.35), ("floor[0]", 0.2), ("wall[0]", 0.5), ("ceiling[0]", 0.7)];

#[test]
fn luminance_is_what_each_surface_reflects_of_all_light() {
    let folder = Folder::for_renderers(&[("spec.yaml", SURFACES), ("lamp.ies", LAMP)]);
    let args = ["--engines", "simulator,radiance", "--sampling", "accurate", "--format", "json"];
    let (report, code) = folder.run(&args).report();
    assert!(matches!(code, Some(0 | 2)), "{}", report["summary"]);
    let of = |list, engine, procedure, meter| at_meter(&report, list, engine, procedure, meter);
    for engine in ["simulator", "radiance"] {
        for (meter, rho) in REFLECTANCES {
            let luminance = of("readings", engine, "luminance", meter);
            let lux = of("readings", engine, "total_illuminance", meter);
            assert_eq!(luminance["quantity"], "luminance_cd_m2", "{luminance}");
            for key in ["value", "std_error", "error_bound"] {
                let Some(lux) = lux[key].as_f64() else { continue };
                let right = rho / PI * lux;
                let off = luminance[key].as_f64().unwrap() - right;
                assert!(off.abs() <= 1e-12 * right, "{engine} {meter} {key}: {luminance} {lux}");
            }
        }
    }
    for (meter, _) in REFLECTANCES {
        let compared = of("comparisons", "radiance", "luminance", meter);
        assert!(compared["verdict"] != "fail" && compared["reference"]["basis"] == "simulator", "{compared}");
        assert_eq!(compared["tolerance"], serde_json::json!({"relative": 0.02, "absolute": 0.0003}), "{compared}");
    }
}

#[test]
fn a_luminance_meter_off_its_surface_or_on_two_is_refused_at_its_place() {
    for (from, to, line, reported) in [
        ("[3, 2, 0.001]", "[3, 2, 0.1]", 12, "floor[0] at [3, 2, 0.1] lies on no surface"),
        ("[0, 0, 2]", "[0, 0, -2]", 12, "give it the surface's own `normal: [0, 0, 1]`"),
        ("[3, 2, 0.001]", "[3, 2, 0.001], [2.5, 1, 0.2]", 12, "floor[1] at [2.5, 1, 0.2]"),
        (
            "luminaires:\n",
            "  - {box: {min_m: [1, 0.2, 0], max_m: [2, 1.6, 0.7], reflectance: 0.8}}\nluminaires:\n",
            11,
            "surfaces of reflectance",
        ),
    ] {
        let spec = SURFACES.replacen(from, to, 1);
        assert_ne!(spec, SURFACES);
        let folder = Folder::new(&[("spec.yaml", &spec), ("lamp.ies", LAMP)]);
        let answer = folder.luxproof(&["check", "spec.yaml"]);
        let place = format!("spec.yaml:{line}:");
        assert!(answer.stderr.contains(&place) && answer.message().contains(reported), "{to}: {}", answer.stderr);
        assert_eq!(answer.code, Some(2), "{}", answer.stderr);
    }
}
