//! `luxproof export --engine usd` and `gltf`: a spec's room and luminaires for other programs.

use crate::support::{Folder, LAMP, SKEW_ROOM};

#[test]
fn a_spec_is_written_as_usd_and_as_gltf_with_its_own_photometric_file() {
    let spec = SKEW_ROOM.replace("rotate_deg: {azimuth: 30, tilt: 20}, ", "");
    let folder = Folder::new(&[("spec.yaml", &spec), ("lamp.ies", LAMP)]);
    for (format, scene) in [("usd", "scene.usda"), ("gltf", "scene.gltf")] {
        let answer = folder.luxproof(&["export", "spec.yaml", "--engine", format, "--out", format]).exits(0);
        answer.prints(scene).complains("points and procedures are no part of the scene");
        assert_eq!(folder.read(&format!("{format}/luminaire-0.ies")), LAMP);
    }
    let document = folder.json("gltf/scene.gltf");
    let light = document["nodes"].as_array().unwrap().iter().find(|node| node["name"] == "lamp").unwrap();
    assert_eq!(light["translation"], serde_json::json!([3.0, 2.0, 2.5]));
    assert_eq!(light["extensions"]["EXT_lights_ies"]["multiplier"], 0.8);
    let usd = folder.read("usd/scene.usda");
    assert!(usd.contains("def SphereLight \"lamp\"") && usd.contains("float inputs:intensity = 3.2"), "{usd}");
}
