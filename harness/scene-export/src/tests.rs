//! Exported scenes against what was exported.

use std::sync::Arc;

use glam::{DMat4, DQuat, DVec3};
use luxproof_photometry::{LuminousIntensityDistribution, LuminousOpening, Photometry};
use luxproof_scene::geometry::{Reflectances, Room};
use luxproof_scene::{Obstacle, Shape, orientation};
use serde_json::Value;

use super::*;

/// A room with a box and a turned luminaire.
fn scene() -> Scene {
    let table = LuminousIntensityDistribution::axial(vec![0.0, 60.0, 90.0], vec![300.0, 200.0, 0.0]).unwrap();
    let reflectance =
        Reflectances { floor: 0.2, ceiling: 0.7, wall_x_min: 0.5, wall_x_max: 0.5, wall_y_min: 0.5, wall_y_max: 0.5 };
    Scene {
        room: Some(Room { size_m: DVec3::new(6.0, 4.0, 3.0), reflectance }),
        obstacles: vec![Obstacle {
            shape: Shape::Box { min_m: DVec3::new(1.0, 1.0, 0.0), max_m: DVec3::new(2.0, 1.5, 0.75) },
            reflectance: 0.4,
        }],
        luminaires: vec![Luminaire {
            id: "desk \"left\"".into(),
            photometry: Arc::new(Photometry::of(table)),
            position_m: DVec3::new(1.5, 2.0, 2.5),
            orientation: orientation(30.0, 20.0, 10.0),
            flux_scale: 0.8,
            model: LuminaireModel::Point,
        }],
    }
}

fn file(exported: &ExportedScene, name: &str) -> String {
    let found = exported.files.iter().find(|file| file.name == name).unwrap();
    String::from_utf8(found.bytes.clone()).unwrap()
}

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(|n| n.as_f64().unwrap()).collect()
}

/// glTF's y is up: (x, y, z) is (x, z, -y) there.
fn to_gltf(v: DVec3) -> DVec3 {
    DVec3::new(v.x, v.z, -v.y)
}

#[test]
fn every_face_of_a_scene_looks_where_light_is() {
    for mesh in soup::meshes(&scene()) {
        let centre =
            if mesh.name.starts_with("obstacle") { DVec3::new(1.5, 1.25, 0.375) } else { DVec3::new(3.0, 2.0, 1.5) };
        let is_body = mesh.name.starts_with("obstacle");
        for [a, b, c] in mesh.triangles.iter().map(|t| t.map(|k| mesh.vertices_m[k as usize])) {
            let inwards = (b - a).cross(c - a).dot(centre - a);
            assert!(if is_body { inwards < 0.0 } else { inwards > 0.0 }, "{} {a} {b} {c}", mesh.name);
        }
    }
}

#[test]
fn a_gltf_light_is_where_the_luminaire_is() {
    let scene = scene();
    let exported = export_scene(&scene, "a room", SceneFormat::Gltf);
    let document: Value = serde_json::from_str(&file(&exported, "scene.gltf")).unwrap();
    let nodes = document["nodes"].as_array().unwrap();
    let light = nodes.last().unwrap();
    let root = DMat4::from_cols_slice(&numbers(&nodes[0]["matrix"]));
    let local = DMat4::from_rotation_translation(
        DQuat::from_slice(&numbers(&light["rotation"])),
        DVec3::from_slice(&numbers(&light["translation"])),
    );
    let world = root * local;
    let luminaire = &scene.luminaires[0];
    assert!(world.transform_point3(DVec3::ZERO).distance(to_gltf(luminaire.position_m)) < 1e-12);
    for axis in [DVec3::X, DVec3::Y, DVec3::NEG_Z] {
        let expected = to_gltf(luminaire.orientation * axis);
        assert!(world.transform_vector3(axis).distance(expected) < 1e-12, "{axis}");
    }
    assert_eq!(light["extensions"]["EXT_lights_ies"]["multiplier"], 0.8);
    assert_eq!(document["extensions"]["EXT_lights_ies"]["lights"][0]["uri"], "luminaire-0.ies");
    let profile = lm63::parse(file(&exported, "luminaire-0.ies").as_bytes()).unwrap();
    assert_eq!(profile.distribution, luminaire.photometry.distribution);
    // Six surfaces and a box of four reflectances.
    assert_eq!(document["meshes"].as_array().unwrap().len(), 7);
    assert_eq!(document["materials"].as_array().unwrap().len(), 4);
}

#[test]
fn a_usd_light_has_the_candela_of_its_profile() {
    let scene = scene();
    let text = file(&export_scene(&scene, "a \"room\"", SceneFormat::Usd), "scene.usda");
    // pi r^2 of the 4 pi r^2 by which `normalize` divides: four times the scale gives the candela of the file.
    for part in [
        "metersPerUnit = 1\n",
        "upAxis = \"Z\"",
        "def SphereLight \"desk__left_\"",
        "float inputs:intensity = 3.2\n",
        "asset inputs:shaping:ies:file = @luminaire-0.ies@",
        "a \\\"room\\\". Metres",
        "(1.5, 2, 2.5, 1) )",
    ] {
        assert!(text.contains(part), "{part}: {text}");
    }
    assert_eq!(text.matches("def Mesh").count(), 7);
    assert_eq!(text.matches('{').count(), text.matches('}').count());
}

#[test]
fn a_usd_light_takes_no_name_of_another_prim() {
    let mut scene = scene();
    let mut other = scene.luminaires[0].clone();
    scene.luminaires[0].id = "Materials".into();
    other.id = "floor".into();
    scene.luminaires.push(other);
    let exported = export_scene(&scene, "names", SceneFormat::Usd);
    let text = file(&exported, "scene.usda");
    // The prims below the world, indented by four.
    let names: Vec<&str> =
        text.lines().filter(|l| l.starts_with("    def ")).map(|l| l.split('"').nth(1).unwrap()).collect();
    assert_eq!(names.len(), 1 + 7 + 2);
    let distinct: std::collections::BTreeSet<&str> = names.iter().copied().collect();
    assert_eq!(distinct.len(), names.len(), "{names:?}");
}

/// What `UsdLux` makes of a flat light: luminance, which is `intensity` divided by the area, times area, cosine and profile.
#[test]
fn a_flat_usd_light_has_the_candela_of_its_luminaire() {
    let mut scene = scene();
    let table = LuminousIntensityDistribution::new(
        vec![0.0, 45.0, 90.0],
        vec![0.0, 40.0, 90.0, 130.0, 180.0],
        vec![300.0, 250.0, 0.0, 80.0, 50.0, 300.0, 100.0, 0.0, 20.0, 50.0, 300.0, 200.0, 0.0, 90.0, 50.0],
    );
    let opening = LuminousOpening::Box { x_m: 1.2, y_m: 0.3, height_m: 0.0 };
    scene.luminaires[0].photometry = Arc::new(Photometry { opening, ..Photometry::of(table.unwrap()) });
    scene.luminaires[0].model = LuminaireModel::Area;
    let exported = export_scene(&scene, "a room", SceneFormat::Usd);
    let text = file(&exported, "scene.usda");
    for part in ["def RectLight \"desk__left_\"", "def RectLight \"desk__left__up\"", "float inputs:width = 1.2\n"] {
        assert!(text.contains(part), "{part}: {text}");
    }
    assert_eq!(text.matches("float inputs:intensity = 0.8\n").count(), 2);
    assert_eq!(exported.losses.len(), 1, "{:?}", exported.losses);
    // The matrix of the light that shines up has the luminaire's x as it is, and its y and z turned over.
    let own = scene.luminaires[0].orientation;
    let matrix = text.split("matrix4d xformOp:transform = ").nth(2).unwrap().lines().next().unwrap();
    let numbers: Vec<f64> =
        matrix.split(['(', ')', ',', ' ']).filter(|word| !word.is_empty()).map(|word| word.parse().unwrap()).collect();
    let rows: Vec<DVec3> = numbers.chunks(4).map(DVec3::from_slice).collect();
    for (row, axis) in rows.iter().zip([own.x_axis, -own.y_axis, -own.z_axis]) {
        assert!(row.distance(axis) < 1e-12, "{rows:?}");
    }
    let distribution = &scene.luminaires[0].photometry.distribution;
    for (name, is_up) in [("luminaire-0.ies", false), ("luminaire-0-up.ies", true)] {
        let profile = lm63::parse(file(&exported, name).as_bytes()).unwrap();
        for k in 0..900 {
            let (c, gamma) = (f64::from(37 * k % 360), 0.0999 * f64::from(k));
            let found = profile.distribution.intensity(c, gamma).value() * gamma.to_radians().cos();
            let (own_c, own_gamma) = if is_up { (-c, 180.0 - gamma) } else { (c, gamma) };
            let expected = distribution.intensity(own_c, own_gamma).value();
            assert!((found - expected).abs() <= 3e-4 * expected + 1e-9, "{name} {c} {gamma}: {found} {expected}");
        }
    }
}
