//! Renderers' own readers of photometric files get the user's own bytes, and what they make of them is judged.

use crate::support::{Folder, among, root};

const SPEC: &str = "luxproof: 1
title: Readers
room: {size_m: [8, 8, 6], reflectance: {floor: 0, walls: 0, ceiling: 0}}
luminaires: [{id: lamp, photometry: plain.ies, at_m: [4, 4, 4]}]
meters:
  floor: {points_m: [[4.3, 4.1, 0.1], [5.8, 4.4, 0.1], [4.5, 6.1, 0.1], [2.1, 4.3, 0.1], [4.2, 1.8, 0.1], [6.5, 6.4, 0.1]], normal: [0, 0, 1]}
procedures: {direct_illuminance: {meters: floor}}
engines: {radiance: {photometry: native}, luxcore: {photometry: native}}
cases:
  - {name: plain}
  - {name: turned, luminaires: {lamp: {photometry: c-90-to-270.ies}}}
";

#[test]
fn ies2rad_and_luxcore_read_a_plain_file_right_and_turn_one_that_begins_at_90_degrees() {
    let read = |name: &str| std::fs::read_to_string(root().join("reference/readers").join(name)).unwrap();
    let files = ["plain.ies", "c-90-to-270.ies"].map(|name| (name, read(name)));
    let folder = Folder::for_renderers(&[("spec.yaml", SPEC)]);
    for (name, text) in &files {
        folder.write(name, text);
    }
    folder.run(&["--format", "json"]).exits(1);
    let report = folder.report();
    for (engine, file) in [("radiance", "luminaire-0.ies"), ("luxcore", "table-0.ies")] {
        let of = |case: &str| among(&report, "comparisons", &[("engine", engine), ("case", &format!("spec/{case}"))]);
        assert!(of("plain").len() == 6 && of("plain").iter().all(|c| c["verdict"] == "pass"), "{engine}");
        let failing: Vec<_> = of("turned").into_iter().filter(|c| c["verdict"] == "fail").collect();
        let said = failing[0]["diagnosis"].as_str().unwrap();
        assert!(said.starts_with("the luminaire is turned by "), "{engine}: {said}");
        let scene = folder.read(&format!("out/spec/turned/scenes/{engine}/direct_illuminance/{file}"));
        assert_eq!(scene, files[1].1, "{engine} was handed other bytes");
    }
}
