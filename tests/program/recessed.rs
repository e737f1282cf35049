//! Luminaires in the plane of the ceiling: every renderer reads them as the simulator does, and what cannot be mounted is refused.

use std::fs;

use serde_json::Value;

use crate::support::{Folder, LAMP, OWN, among, root};

const OFFICE: &str = "luxproof: 1
room:
  size_m: [6, 4, 3]
  reflectance: {floor: 0.2, walls: 0.5, ceiling: 0.8}
luminaires:
  - {id: a, photometry: lamp.ies, at_m: [1.5, 1, 3], model: area}
  - {id: b, photometry: lamp.ies, at_m: [4.5, 1, 3], model: area}
  - {id: c, photometry: lamp.ies, at_m: [1.5, 3, 3], model: area}
  - {id: d, photometry: lamp.ies, at_m: [4.5, 3, 3], model: area}
meters:
  desk: {points_m: [[0.6, 0.5, 0.8], [1.7, 1.2, 0.8], [3.1, 2.2, 0.8], [5.1, 3.4, 0.8]], normal: [0, 0, 1]}
procedures:
  direct_illuminance: {meters: desk}
  indirect_illuminance: {meters: desk}
budget: {relative_error: 0.01, seconds: 10}
";

fn office_with(panel: &str) -> Folder {
    Folder::for_renderers(&[("spec.yaml", OFFICE), ("lamp.ies", panel)])
}

fn panel() -> String {
    fs::read_to_string(root().join("reference/luminaires/lambertian-06m.ies")).unwrap()
}

/// Every renderer's reading within so much of the simulator's, relative.
#[track_caller]
fn agree_with_the_simulator(report: &Value, [direct, indirect]: [f64; 2]) {
    for (procedure, allowed) in [("direct_illuminance", direct), ("indirect_illuminance", indirect)] {
        let read = |engine: &str| -> Vec<f64> {
            let found = among(report, "readings", &[("procedure", procedure), ("engine", engine)]);
            assert_eq!(found.len(), 4, "{engine} {procedure}: {}", report["skips"]);
            found.iter().map(|r| r["value"].as_f64().unwrap()).collect()
        };
        let exact = read("simulator");
        for engine in ["radiance", "mitsuba", "povray"] {
            let found = read(engine);
            let off = found.iter().zip(&exact).map(|(f, e)| (f / e - 1.0).abs()).fold(0.0, f64::max);
            assert!(off <= allowed, "{engine} {procedure}: {found:?} for {exact:?}");
        }
    }
}

const ALL: [&str; 4] = ["--engines", "simulator,iesna,radiance,mitsuba,povray", "--format", "json"];

#[test]
fn recessed_panels_are_read_as_the_simulator_says_by_every_renderer() {
    let answer = office_with(&panel()).run(&ALL);
    agree_with_the_simulator(&answer.json(), [0.01, 0.03]);
}

#[test]
fn a_point_in_the_ceiling_is_read_as_the_simulator_says_by_every_renderer() {
    let folder = office_with(LAMP);
    for other in ["b", "c", "d"] {
        let line = OFFICE.lines().find(|l| l.contains(&format!("id: {other},"))).unwrap();
        folder.edit("spec.yaml", &format!("{line}\n"), "");
    }
    folder.edit("spec.yaml", ", model: area", "");
    agree_with_the_simulator(&folder.run(&ALL).json(), [1e-3, 0.03]);
}

#[test]
fn a_ceiling_that_reflects_under_its_panels_would_be_noticed() {
    let mean = |folder: Folder| {
        let report = folder.run(&["--engines", OWN, "--sampling", "accurate", "--format", "json"]).json();
        let found = among(&report, "readings", &[("procedure", "indirect_illuminance"), ("engine", "simulator")]);
        found.iter().map(|r| r["value"].as_f64().unwrap()).sum::<f64>()
    };
    let hung = office_with(&panel());
    // A centimetre lower they are no part of the ceiling.
    hung.edit("spec.yaml", "at_m: [1.5, 1, 3]", "at_m: [1.5, 1, 2.99]");
    hung.edit("spec.yaml", "at_m: [4.5, 1, 3]", "at_m: [4.5, 1, 2.99]");
    hung.edit("spec.yaml", "at_m: [1.5, 3, 3]", "at_m: [1.5, 3, 2.99]");
    hung.edit("spec.yaml", "at_m: [4.5, 3, 3]", "at_m: [4.5, 3, 2.99]");
    let (recessed, hung) = (mean(office_with(&panel())), mean(hung));
    // It is 3.2 %, and 2 % are allowed.
    assert!(hung / recessed - 1.0 > 0.02, "{recessed} {hung}");
}

#[test]
fn what_cannot_be_mounted_is_refused_with_its_place_and_a_remedy() {
    let boxed = panel().replace("0.6 0.6 0", "0.6 0.6 0.1");
    let flat = panel();
    for (panel, to, says) in [
        (&boxed, "at_m: [1.5, 1, 3]", "lower it by 0.05 m"),
        (&flat, "at_m: [0.2, 1, 3]", "sticks out of the room by 0.1 m through the wall x-"),
        (&flat, "at_m: [1.5, 1, 3], rotate_deg: {tilt: 10}", "through the ceiling"),
        (&flat, "at_m: [1.5, 1, 3], rotate_deg: {tilt: 180}", "sends all its light out of the room"),
        (&flat, "at_m: [1.5, 1, 3.1]", "outside the room"),
    ] {
        let folder = office_with(panel);
        folder.edit("spec.yaml", "at_m: [1.5, 1, 3]", to);
        let said = folder.luxproof(&["check", "spec.yaml"]).exits(2).message();
        assert!(said.contains("spec.yaml:6:") && said.contains(says), "no `{says}` in {said}");
    }
    let overlapping = office_with(&flat);
    overlapping.edit("spec.yaml", "at_m: [4.5, 1, 3]", "at_m: [2.09, 1, 3]");
    overlapping
        .luxproof(&["check", "spec.yaml"])
        .exits(2)
        .complains("its luminous opening overlaps that of")
        .complains("spec.yaml:7:");
    // Side by side, and a nanometre off the ceiling by rounding.
    let touching = office_with(&flat);
    touching.edit("spec.yaml", "at_m: [4.5, 1, 3]", "at_m: [2.1, 1, 2.999999999]");
    touching.luxproof(&["check", "spec.yaml"]).exits(0);
    // A box whose top touches the ceiling hangs below it.
    let below = office_with(&boxed);
    for place in ["[1.5, 1, 3]", "[4.5, 1, 3]", "[1.5, 3, 3]", "[4.5, 3, 3]"] {
        below.edit("spec.yaml", place, &place.replace(", 3]", ", 2.95]"));
    }
    below.luxproof(&["check", "spec.yaml"]).exits(0);
}
