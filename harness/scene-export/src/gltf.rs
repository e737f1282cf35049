//! `scene.gltf`: meshes in one buffer, and a node a luminaire with `EXT_lights_ies`.
//!
//! Sources: Khronos Group, *glTF 2.0 Specification* (ISO/IEC 12113:2022) and the extension `EXT_lights_ies`: the point
//! (0, 0) of the photometric web lies along -z of the node, and a multiplier scales the candela of the file.

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use glam::{DQuat, DVec3};
use itertools::Itertools as _;
use luxproof_scene::Scene;
use serde_json::{Value, json};

use crate::profile_name;
use crate::soup::{Mesh, meshes};

/// Turns z up to y up, column by column; a quaternion would round.
const Y_UP: [f64; 16] = [1.0, 0.0, 0.0, 0.0, 0.0, 0.0, -1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0];

const FLOAT: u32 = 5126;
const UNSIGNED_INT: u32 = 5125;

/// The document.
pub(crate) fn text(scene: &Scene, title: &str) -> String {
    let meshes = meshes(scene);
    let reflectances: Vec<f64> = meshes.iter().map(|mesh| mesh.reflectance).sorted_by(f64::total_cmp).dedup().collect();
    let mut buffer = Buffer::default();
    let (mut mesh_list, mut nodes) = (vec![], vec![]);
    for mesh in &meshes {
        let material = reflectances.iter().position(|rho| *rho == mesh.reflectance).unwrap_or_default();
        let (positions, indices) = buffer.push(mesh);
        let primitive = json!({"attributes": {"POSITION": positions}, "indices": indices, "material": material});
        nodes.push(json!({"name": mesh.name, "mesh": mesh_list.len()}));
        mesh_list.push(json!({"name": mesh.name, "primitives": [primitive]}));
    }
    for (k, luminaire) in scene.luminaires.iter().enumerate() {
        let rotation = DQuat::from_mat3(&luminaire.orientation).normalize();
        nodes.push(json!({
            "name": luminaire.id,
            "translation": luminaire.position_m.to_array(),
            "rotation": rotation.to_array(),
            "extensions": {"EXT_lights_ies": {"light": k, "multiplier": luminaire.flux_scale}},
        }));
    }
    let children: Vec<usize> = (1..=nodes.len()).collect();
    let mut all = vec![json!({"name": "z up", "matrix": Y_UP, "children": children})];
    if children.is_empty() {
        all = vec![json!({"name": "z up", "matrix": Y_UP})];
    }
    all.extend(nodes);
    let materials: Vec<Value> = reflectances.iter().map(|rho| material(*rho)).collect();
    let profiles: Vec<Value> = scene
        .luminaires
        .iter()
        .enumerate()
        .map(|(k, luminaire)| json!({"name": luminaire.id, "uri": profile_name(k)}))
        .collect();
    let mut document = json!({
        "asset": {"version": "2.0", "generator": "luxproof", "extras": {"title": title, "units": "metres, candela"}},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": all,
    });
    let members = [
        ("meshes", mesh_list),
        ("materials", materials),
        ("accessors", buffer.accessors),
        ("bufferViews", buffer.views),
    ];
    // Empty lists are not allowed.
    for (name, list) in members.into_iter().filter(|(_, list)| !list.is_empty()) {
        document[name] = Value::Array(list);
    }
    if !buffer.bytes.is_empty() {
        let uri = format!("data:application/octet-stream;base64,{}", STANDARD.encode(&buffer.bytes));
        document["buffers"] = json!([{"byteLength": buffer.bytes.len(), "uri": uri}]);
    }
    if !profiles.is_empty() {
        document["extensionsUsed"] = json!(["EXT_lights_ies"]);
        document["extensions"] = json!({"EXT_lights_ies": {"lights": profiles}});
    }
    format!("{document:#}\n")
}

/// A diffuse material; both sides reflect.
fn material(reflectance: f64) -> Value {
    json!({
        "name": format!("reflectance {reflectance}"),
        "doubleSided": true,
        "pbrMetallicRoughness": {
            "baseColorFactor": [reflectance, reflectance, reflectance, 1.0], "metallicFactor": 0.0, "roughnessFactor": 1.0,
        },
    })
}

/// The numbers of all meshes.
#[derive(Default)]
struct Buffer {
    bytes: Vec<u8>,
    views: Vec<Value>,
    accessors: Vec<Value>,
}

impl Buffer {
    /// Adds a mesh and returns its accessors of positions and indices.
    fn push(&mut self, mesh: &Mesh) -> (usize, usize) {
        let corners: Vec<[f32; 3]> = mesh.vertices_m.iter().map(|v| v.as_vec3().to_array()).collect();
        let vertices = corners.iter().map(|corner| DVec3::from(corner.map(f64::from)));
        let low = vertices.clone().fold(DVec3::INFINITY, DVec3::min).to_array();
        let high = vertices.fold(DVec3::NEG_INFINITY, DVec3::max).to_array();
        let bytes = corners.iter().flatten().flat_map(|x| x.to_le_bytes()).collect();
        let positions = self.push_accessor(bytes, corners.len(), FLOAT, "VEC3", 34962);
        self.accessors[positions]["min"] = json!(low);
        self.accessors[positions]["max"] = json!(high);
        let bytes = mesh.triangles.iter().flatten().flat_map(|k| k.to_le_bytes()).collect();
        let indices = self.push_accessor(bytes, 3 * mesh.triangles.len(), UNSIGNED_INT, "SCALAR", 34963);
        (positions, indices)
    }

    /// Adds numbers of four bytes each.
    fn push_accessor(&mut self, bytes: Vec<u8>, count: usize, component: u32, kind: &str, target: u32) -> usize {
        self.views.push(json!({
            "buffer": 0, "byteOffset": self.bytes.len(), "byteLength": bytes.len(), "target": target,
        }));
        self.bytes.extend(bytes);
        let view = self.views.len() - 1;
        self.accessors.push(json!({"bufferView": view, "componentType": component, "count": count, "type": kind}));
        self.accessors.len() - 1
    }
}
