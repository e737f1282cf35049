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
    // Back again: the same luminaire in the same room, with the same photometric file.
    folder
        .luxproof(&["import", "gltf/scene.gltf", "--out", "back"])
        .exits(0)
        .prints("luminaire: lamp, luminaire-0.ies");
    let back = folder.read("back/spec.yaml");
    for line in ["id: \"lamp\"", "at_m: [3, 2, 2.5]", "flux_scale: 0.8", "luminaire: \"lamp\",", "size_m: [6, 4, 3]"] {
        assert!(back.contains(line), "{line}: {back}");
    }
    assert_eq!(folder.read("back/luminaire-0.ies"), LAMP);
    folder.luxproof(&["check", "back/spec.yaml"]).exits(0);
    // From USD, too.
    folder
        .luxproof(&["import", "usd/scene.usda", "--out", "again"])
        .exits(0)
        .prints("luminaire: lamp, luminaire-0.ies");
    let again = folder.read("again/spec.yaml");
    for line in ["id: \"lamp\"", "at_m: [3, 2, 2.5]", "flux_scale: 0.8", "size_m: [6, 4, 3]"] {
        assert!(again.contains(line), "{line}: {again}");
    }
    assert_eq!(folder.read("again/luminaire-0.ies"), LAMP);
    folder.luxproof(&["check", "again/spec.yaml"]).exits(0);
    let usd = folder.read("usd/scene.usda");
    folder.write("usd/binary.usdc", "PXR-USDC");
    folder.luxproof(&["import", "usd/binary.usdc"]).exits(2).complains("usdcat");
    assert!(usd.contains("def SphereLight \"lamp\"") && usd.contains("float inputs:intensity = 3.2"), "{usd}");
}

/// A panel that shines up and down: two lights, and their files give the luminaire's candela after the cosine.
#[test]
fn a_panel_goes_to_usd_and_comes_back_with_its_readings() {
    let panel = "IESNA:LM-63-2002\nTILT=NONE\n1 -1 1 5 1 1 2 .3 1.2 0\n1 1 0\n0 45 90 135 180\n0\n300 200 40 90 50\n";
    let spec = SKEW_ROOM.replace("lamp.ies", "panel.ies").replace("flux_scale: 0.8", "flux_scale: 0.8, model: area");
    let folder = Folder::new(&[("spec.yaml", &spec), ("panel.ies", panel)]);
    folder
        .luxproof(&["export", "spec.yaml", "--engine", "usd", "--out", "usd"])
        .exits(0)
        .complains("the intensity there, up to 40.0000 cd, becomes 0");
    folder
        .luxproof(&["import", "usd/scene.usda", "--out", "back"])
        .exits(0)
        .prints("luminaire: lamp_up, luminaire-1.ies")
        .prints("of flat lights the cosine of gamma");
    // The points and procedures of the spec, with the luminaires of the scene.
    let back = folder.read("back/spec.yaml");
    let (_, rest) = back.split_once("\nluminaires:\n").unwrap();
    let (luminaires, _) = rest.split_once("\nmeters:").unwrap();
    assert_eq!(luminaires.matches("model: area").count(), 2, "{luminaires}");
    let head = spec.split_once("luminaires:").unwrap().0;
    let tail = spec.split_once("\nmeters:").unwrap().1;
    folder.write("back/again.yaml", &format!("{head}luminaires:\n{luminaires}\nmeters:{tail}"));
    let [before, after] = [("spec.yaml", "a"), ("back/again.yaml", "b")].map(|(spec, out)| {
        folder.luxproof(&[
            "run",
            spec,
            "--engines",
            "simulator",
            "--no-calibration",
            "--procedures",
            "direct_illuminance",
            "--out",
            out,
        ]);
        folder.json(&format!("{out}/report.json"))["readings"].as_array().unwrap().clone()
    });
    assert!(!before.is_empty() && before.len() == after.len());
    for (a, b) in before.iter().zip(&after) {
        let [a, b] = [a, b].map(|reading| reading["value"].as_f64().unwrap());
        assert!(a > 0.0 && (b / a - 1.0).abs() < 1e-6, "{a} {b}");
    }
}

#[test]
fn a_scene_without_a_usable_light_is_imported_with_a_warning() {
    let folder = Folder::new(&[("spec.yaml", SKEW_ROOM), ("lamp.ies", LAMP)]);
    folder.luxproof(&["export", "spec.yaml", "--engine", "usd", "--out", "usd"]).exits(0);
    let text = folder.read("usd/scene.usda").replace("angleScale = 0", "angleScale = 0.5");
    folder.write("usd/scaled.usda", &text);
    folder
        .luxproof(&["import", "usd/scaled.usda", "--out", "back"])
        .exits(0)
        .prints("lights with scaled profiles")
        .complains("warning: no light of the scene became a luminaire");
}

#[test]
fn a_strangers_scene_names_a_profile_no_more_often_than_a_spec_has_luminaires() {
    let spec = SKEW_ROOM.replace("rotate_deg: {azimuth: 30, tilt: 20}, ", "");
    let folder = Folder::new(&[("spec.yaml", &spec), ("lamp.ies", LAMP)]);
    folder.luxproof(&["export", "spec.yaml", "--engine", "gltf", "--out", "gltf"]).exits(0);
    let mut document = folder.json("gltf/scene.gltf");
    let nodes = document["nodes"].as_array_mut().unwrap();
    let light = nodes.iter().find(|node| node["name"] == "lamp").unwrap().clone();
    let first = nodes.len();
    nodes.extend(std::iter::repeat_n(light, 600));
    let children = nodes[0]["children"].as_array_mut().unwrap();
    children.extend((first..first + 600).map(serde_json::Value::from));
    folder.write("gltf/many.gltf", &document.to_string());
    folder.luxproof(&["import", "--untrusted", "gltf/many.gltf"]).exits(2).complains("more than 500 lights");
    assert!(!folder.path("many").exists());
}
