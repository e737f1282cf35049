//! Mean cylindrical illuminance: direct light against its closed form on every engine, all light against the simulator.

use serde_json::Value;

use crate::support::{ENGINES, Folder, MINE, OWN, SKEW_LAMP, SKEW_ROOM, adapter, among};

const FACES: &str = "  cylindrical_illuminance: {meters: plane, light: direct}\n";

fn faces(report: &Value, engine: &str) -> Vec<Value> {
    let mine = among(report, "comparisons", &[("engine", engine), ("procedure", "cylindrical_illuminance")]);
    mine.into_iter().cloned().collect()
}

#[test]
fn direct_cylindrical_light_is_the_closed_form_within_its_quadrature() {
    let spec = [SKEW_ROOM, FACES].concat();
    let folder = Folder::for_renderers(&[("spec.yaml", &spec), ("lamp.ies", SKEW_LAMP)]);
    let only = ["--procedures", "cylindrical_illuminance", "--engines"];
    let (report, code) = folder.run(&[&only[..], &[&ENGINES.join(","), "--format", "json"]].concat()).report();
    assert_eq!(code, Some(0), "{}", report["summary"]);
    for engine in ENGINES {
        let comparisons = faces(&report, engine);
        assert_eq!(comparisons.len(), 3, "{engine}");
        for c in comparisons {
            assert!(c["verdict"] == "pass" && c["reference"]["basis"] == "closed_form", "{c}");
            // 1 - x cot x with x = pi / 62; renderers add the rounding of single precision.
            let [off, right] = [&c["deviation"], &c["reference"]["value"]].map(|v| v.as_f64().unwrap());
            // Below its lamp a cylinder is dark.
            assert!(off.abs() < (8.6e-4 + 1e-5) * right + 1e-5, "{c}");
            assert_eq!(c["uncertainty"]["kind"], "bound", "{c}");
        }
    }
}

#[test]
fn all_cylindrical_light_is_read_alike_by_our_solvers_and_a_sampler() {
    let procedure = "  cylindrical_illuminance: {meters: plane}\nbudget: {relative_error: 0.02, seconds: 20}\n";
    let spec = [SKEW_ROOM, procedure].concat();
    let folder = Folder::for_renderers(&[("spec.yaml", &spec), ("lamp.ies", SKEW_LAMP)]);
    let args = ["--procedures", "cylindrical_illuminance", "--engines", "mitsuba", "--format", "json"];
    let (report, _) = folder.run(&args).report();
    let comparisons = faces(&report, "mitsuba");
    assert_eq!(comparisons.len(), 3);
    for c in comparisons {
        let (off, error) = (c["relative_deviation"].as_f64().unwrap(), c["std_error"].as_f64().unwrap());
        assert!(off.abs() < 4.0 * error / c["value"].as_f64().unwrap() + 2e-3, "{c}");
        assert!(c["verdict"] != "fail" && c["reference"]["basis"] == "simulator", "{c}");
    }
}

/// The negative control: an adapter whose meters all look up reads no cylinder.
#[test]
fn an_engine_that_takes_a_plane_for_a_cylinder_fails() {
    let flat = adapter().replace("meter[\"normal\"]", "[0, 0, 1]");
    assert!(flat != adapter());
    let spec = [SKEW_ROOM, FACES, MINE].concat();
    let folder = Folder::new(&[("spec.yaml", &spec), ("lamp.ies", SKEW_LAMP), ("adapter.py", &flat)]);
    let args = ["--procedures", "cylindrical_illuminance", "--no-cache", "--no-skips", "--format", "json"];
    let (report, code) = folder.run(&args).report();
    assert_ne!(code, Some(0), "{}", report["summary"]);
    assert!(faces(&report, "mine").iter().all(|c| c["verdict"] != "pass"), "{report}");
    for engine in OWN.split(',') {
        assert!(faces(&report, engine).iter().all(|c| c["verdict"] == "pass"), "{engine}");
    }
}
