//! The renderers of the web, as a page of theirs shows a luminaire: what is wrong with each is named, by one command each.

use serde_json::Value;

use crate::support::{Folder, among, root, run_reference};

fn run(spec: &str) -> Value {
    let (report, code) = run_reference(&[root().join("reference/web").join(spec).to_str().unwrap()]);
    assert_eq!(code, Some(1), "{}", report["engines"]);
    report
}

/// What is said of what an engine fails in a procedure, and the worst deviation.
fn reported(report: &Value, engine: &str, procedure: &str) -> (String, f64) {
    let fails = among(report, "comparisons", &[("engine", engine), ("procedure", procedure), ("verdict", "fail")]);
    let off = |c: &&Value| c["relative_deviation"].as_f64().unwrap_or(0.0).abs();
    let first = fails.first().unwrap_or_else(|| panic!("nothing fails in {procedure}"));
    (first["diagnosis"].as_str().unwrap_or_default().to_owned(), fails.iter().map(off).fold(0.0, f64::max))
}

#[test]
fn three_js_0_179_squares_the_candela_of_one_plane() {
    let report = run("three-0.179.yaml");
    for procedure in ["luminous_intensity", "direct_illuminance"] {
        let (said, worst) = reported(&report, "three", procedure);
        assert!(said.contains("only the plane C 0 is read, the candela are squared"), "{procedure}: {said}");
        assert!(worst > 0.3, "{worst}");
    }
}

#[test]
fn three_js_0_187_is_right_but_behind_its_light() {
    let report = run("three-0.187.yaml");
    let (said, _) = reported(&report, "three", "luminous_intensity");
    assert!(said.contains("beyond a gamma of 90 degrees C is turned by 180 degrees"), "{said}");
    let mine = among(&report, "comparisons", &[("engine", "three"), ("procedure", "luminous_intensity")]);
    for c in mine.iter().filter(|c| c["gamma_deg"].as_f64().unwrap() < 90.0) {
        // Half a texel off would be a percent and more.
        assert!(c["relative_deviation"].as_f64().unwrap().abs() < 2e-3, "{c}");
    }
}

#[test]
fn babylon_js_reads_one_plane() {
    let report = run("babylon.yaml");
    let (said, worst) = reported(&report, "babylon", "luminous_intensity");
    assert!(said.contains("light is the same in every C plane"), "{said}");
    assert!(worst > 0.3, "{worst}");
}

/// A path tracer of the web: the light of a plain room, straight and reflected.
#[test]
fn three_gpu_pathtracer_reads_a_plain_room_right() {
    let spec = root().join("reference/web/three-gpu-pathtracer.yaml");
    let (report, code) = run_reference(&[spec.to_str().unwrap()]);
    assert_eq!(code, Some(0), "{}", report["engines"]);
    let engine = [("engine", "three-gpu-pathtracer"), ("verdict", "pass")];
    for procedure in ["direct_illuminance", "indirect_illuminance"] {
        let passed = among(&report, "comparisons", &[engine[0], engine[1], ("procedure", procedure)]);
        assert_eq!(passed.len(), 4, "{procedure}");
    }
    let reflected = among(&report, "comparisons", &[engine[0], ("procedure", "indirect_illuminance")]);
    // Each states what its paths scatter by, below a percent.
    for c in reflected {
        let error = c["std_error"].as_f64().unwrap() / c["value"].as_f64().unwrap();
        assert!(error > 1e-4 && error < 0.012, "{c}");
    }
}

/// What is theirs is on record, with its size at each meter: a release that reads otherwise fails, a right one is an unexpected pass.
#[test]
fn the_doctor_finds_them_as_they_are_on_record() {
    let folder = Folder::for_renderers(&[]);
    let answer = folder.luxproof(&["engines", "doctor", "three", "babylon"]).exits(0);
    let reported = answer.stdout.split_whitespace().collect::<Vec<_>>().join(" ");
    assert!(
        reported.contains("127 passed, 0 failed, 0 undecided, 82 known deviations, 0 unexpected passes"),
        "{reported}"
    );
    assert!(reported.contains("babylon: calibration: asymmetric only as is on record"), "{reported}");
}
