//! Scenes of other programs as specs: one room in three formats is one spec, and reads what the same room reads that
//! was written by hand.

use std::collections::BTreeMap;

use crate::support::{Folder, LAMP, among};

/// Names and reflectances.
const MATERIALS: [(&str, f64); 5] = [("floor", 0.2), ("walls", 0.5), ("ceiling", 0.7), ("crate", 0.6), ("table", 0.35)];

type Quad = [[f64; 3]; 4];

/// The faces of a box, looking outwards: bottom, top, then its sides.
fn faces([a, b, c]: [f64; 3], [x, y, z]: [f64; 3]) -> [Quad; 6] {
    [
        [[a, b, c], [a, y, c], [x, y, c], [x, b, c]],
        [[a, b, z], [x, b, z], [x, y, z], [a, y, z]],
        [[a, b, c], [x, b, c], [x, b, z], [a, b, z]],
        [[a, y, c], [a, y, z], [x, y, z], [x, y, c]],
        [[a, b, c], [a, b, z], [a, y, z], [a, y, c]],
        [[x, b, c], [x, y, c], [x, y, z], [x, b, z]],
    ]
}

/// A room from an origin, with a crate on its floor, and a table's plate of an L: polygons of materials by number, in
/// their order.
fn polygons(at: [f64; 3]) -> Vec<(usize, Vec<[f64; 3]>)> {
    let [floor, ceiling, walls @ ..] = faces([0.0; 3], [6.1, 4.3, 3.1]).map(|mut face| {
        face.reverse();
        face.to_vec()
    });
    let mut all = vec![(0, floor)];
    all.extend(walls.map(|wall| (1, wall)));
    all.push((2, ceiling));
    all.extend(faces([3.7, 1.5, 0.0], [4.7, 2.3, 0.9]).map(|face| (3, face.to_vec())));
    let corner = [[1.0, 1.0], [2.2, 1.0], [2.2, 1.6], [1.6, 1.6], [1.6, 2.8], [1.0, 2.8]];
    all.push((4, corner.map(|[x, y]| [x, y, 0.7]).to_vec()));
    for (_, polygon) in &mut all {
        for p in polygon {
            *p = [0, 1, 2].map(|k| p[k] + at[k]);
        }
    }
    all
}

fn radiance(polygons: &[(usize, Vec<[f64; 3]>)]) -> String {
    let materials = MATERIALS.iter().map(|(name, rho)| format!("void plastic {name} 0 0 5 {rho} {rho} {rho} 0 0\n"));
    let surfaces = polygons.iter().enumerate().map(|(k, (material, corners))| {
        let numbers: Vec<String> = corners.iter().flatten().map(f64::to_string).collect();
        format!("\n{} polygon p{k}\n0\n0\n{} {}\n", MATERIALS[*material].0, numbers.len(), numbers.join(" "))
    });
    materials.chain(surfaces).collect()
}

/// In millimetres, y up.
fn wavefront(polygons: &[(usize, Vec<[f64; 3]>)]) -> (String, String) {
    let library = MATERIALS.map(|(name, rho)| format!("newmtl {name}\nKd {rho} {rho} {rho}\n")).concat();
    let mut text = "mtllib room.mtl\n".to_owned();
    for (material, corners) in polygons {
        for [x, y, z] in corners.iter().map(|p| p.map(|c| 1000.0 * c)) {
            text += &format!("v {x} {z} {}\n", -y);
        }
        let places: Vec<String> = (1..=corners.len()).rev().map(|k| format!("-{k}")).collect();
        text += &format!("g {material}\nusemtl {}\nf {}\n", MATERIALS[*material].0, places.join(" "));
    }
    (text, library)
}

/// A document and its buffer: a node and a mesh a material, the nodes moved by what their meshes are off. Triangles
/// are those of the meshes
/// that an import wrote, of the table, and fans elsewhere.
fn gltf(polygons: &[(usize, Vec<[f64; 3]>)], table: &[[usize; 3]]) -> (String, Vec<u8>) {
    let (mut bytes, mut nodes, mut meshes, mut accessors, mut views) = (vec![], vec![], vec![], vec![], vec![]);
    for material in 0..MATERIALS.len() {
        let (mut points, mut indices): (Vec<[f64; 3]>, Vec<u16>) = (vec![], vec![]);
        for (_, corners) in polygons.iter().filter(|(of, _)| *of == material) {
            let fan: Vec<[usize; 3]> = (2..corners.len()).map(|k| [0, k - 1, k]).collect();
            let triangles = if material == 4 { table } else { &fan };
            indices.extend(triangles.iter().flatten().map(|k| (points.len() + k) as u16));
            points.extend(corners);
        }
        let mut view = |data: Vec<u8>, component: u32, count: usize, kind: &str| {
            views.push(format!(r#"{{"buffer": 0, "byteOffset": {}, "byteLength": {}}}"#, bytes.len(), data.len()));
            let view = views.len() - 1;
            accessors.push(format!(
                r#"{{"bufferView": {view}, "componentType": {component}, "count": {count}, "type": "{kind}"}}"#
            ));
            bytes.extend(data);
            bytes.resize(bytes.len().next_multiple_of(4), 0);
            view
        };
        // A metre to the left, which the node takes back.
        let floats = points.iter().flat_map(|[x, y, z]| [(x - 1.0) as f32, *z as f32, -*y as f32]);
        let at = view(floats.flat_map(f32::to_le_bytes).collect(), 5126, points.len(), "VEC3");
        let of = view(indices.iter().flat_map(|k| k.to_le_bytes()).collect(), 5123, indices.len(), "SCALAR");
        meshes.push(format!(
            r#"{{"primitives": [{{"attributes": {{"POSITION": {at}}}, "indices": {of}, "material": {material}}}]}}"#
        ));
        nodes.push(format!(r#"{{"mesh": {material}, "translation": [1, 0, 0]}}"#));
    }
    let materials = MATERIALS.map(|(name, rho)| {
        format!(r#"{{"name": "{name}", "pbrMetallicRoughness": {{"baseColorFactor": [{rho}, {rho}, {rho}, 1], "metallicFactor": 0}}}}"#)
    });
    let list = |items: &[String]| items.join(",\n");
    let document = format!(
        r#"{{"asset": {{"version": "2.0"}}, "scene": 0, "scenes": [{{"nodes": [0, 1, 2, 3, 4]}}],
"nodes": [{}], "meshes": [{}], "materials": [{}], "accessors": [{}], "bufferViews": [{}],
"buffers": [{{"uri": "the%20room.bin", "byteLength": {}}}]}}"#,
        list(&nodes),
        list(&meshes),
        list(&materials),
        list(&accessors),
        list(&views),
        bytes.len()
    );
    (document, bytes)
}

/// The triangles of an OBJ file as indices from 0, and its vertices.
fn mesh(text: &str) -> (Vec<[usize; 3]>, Vec<[f64; 3]>) {
    let rows = |keyword: &'static str| text.lines().filter_map(move |line| line.strip_prefix(keyword));
    let three = |row: &str| -> Vec<f64> { row.split(' ').map(|word| word.parse().unwrap()).collect() };
    let triangles = rows("f ").map(|row| <[f64; 3]>::try_from(three(row)).unwrap().map(|k| k as usize - 1)).collect();
    (triangles, rows("v ").map(|row| three(row).try_into().unwrap()).collect())
}

#[test]
fn a_room_in_three_formats_is_one_spec() {
    let folder = Folder::new(&[]);
    let polygons = polygons([0.0; 3]);
    folder.write("room.rad", &radiance(&polygons));
    let answer = folder.luxproof(&["import", "room.rad"]).exits(0).prints("28 triangles taken");
    answer.prints("room: [6.1, 4.3, 3.1] m, the scene's outermost surfaces, which are a box");
    let spec = folder.read("room/spec.yaml");
    for part in [
        "size_m: [6.1, 4.3, 3.1]",
        "{floor: 0.2, walls: 0.5, ceiling: 0.7}",
        "{file: reflectance-0.6.obj, reflectance: 0.6}",
    ] {
        assert!(spec.contains(part), "{spec}");
    }
    // It is a spec as it is, and it has no lints.
    let checked = folder.luxproof(&["check", "room/spec.yaml"]).exits(0);
    assert!(checked.stderr.is_empty(), "{}", checked.stderr);
    folder.luxproof(&["import", "room.rad"]).exits(2).complains("is there already");
    folder.luxproof(&["import", "room.rad", "--force"]).exits(0);

    let (obj, mtl) = wavefront(&polygons);
    folder.write("room.obj", &obj);
    folder.write("room.mtl", &mtl);
    // The same cuts of the concave plate: nothing says which a program makes.
    let (cuts, vertices) = mesh(&folder.read("room/reflectance-0.35.obj"));
    let table = &polygons.last().unwrap().1;
    let place = |v: usize| table.iter().position(|p| *p == vertices[v]).unwrap();
    let (gltf, bytes) = gltf(&polygons, &cuts.iter().map(|t| t.map(place)).collect::<Vec<_>>());
    folder.write("room.gltf", &gltf);
    std::fs::write(folder.path("the room.bin"), &bytes).unwrap();
    let buffer = format!(r#"{{"byteLength": {}}}"#, bytes.len());
    let json = gltf.replace(&format!(r#"{{"uri": "the%20room.bin", "byteLength": {}}}"#, bytes.len()), &buffer);
    let json = format!("{json:width$}", width = json.len().next_multiple_of(4));
    let mut glb = b"glTF".to_vec();
    for (word, kind, chunk) in [(json.len(), &b"JSON"[..], json.as_bytes()), (bytes.len(), &b"BIN\0"[..], &bytes[..])] {
        if glb.len() == 4 {
            glb.extend([2, 28 + json.len() + bytes.len()].iter().flat_map(|word| (*word as u32).to_le_bytes()));
        }
        glb.extend((word as u32).to_le_bytes());
        glb.extend(kind);
        glb.extend(chunk);
    }
    std::fs::write(folder.path("room.glb"), &glb).unwrap();
    for args in [&["room.obj", "--up", "y", "--unit", "0.001"][..], &["room.gltf"], &["room.glb"]] {
        folder.luxproof(&[&["import"][..], args, &["--out", "other"]].concat()).exits(0);
        assert_eq!(folder.read("other/spec.yaml").replace(args[0], "room.rad"), spec, "{args:?}");
        for file in ["reflectance-0.35.obj", "reflectance-0.6.obj"] {
            let read = |text: &str| {
                let (mut triangles, vertices) = mesh(text);
                triangles.sort_unstable();
                let mut corners: Vec<_> = triangles.iter().map(|t| t.map(|v| vertices[v])).collect();
                corners.sort_by(|a, b| a.partial_cmp(b).unwrap());
                corners
            };
            assert_eq!(
                read(&folder.read(&format!("other/{file}"))),
                read(&folder.read(&format!("room/{file}"))),
                "{args:?}"
            );
        }
        std::fs::remove_dir_all(folder.path("other")).unwrap();
    }
    let reported = folder.luxproof(&["import", "room.rad", "--out", "json", "--format", "json"]).exits(0).json();
    assert_eq!((&reported["triangles"], &reported["room"]["kind"]), (&28.into(), &"box".into()), "{reported}");
    assert_eq!(reported["materials"][4]["area_m2"].as_f64().map(|area| (area * 1e6).round()), Some(1.44e6));
}

#[test]
fn a_room_that_is_no_box_is_a_mesh_and_a_spec_as_it_is() {
    let folder = Folder::new(&[]);
    let corners = [[0.0, 0.0], [6.1, 0.0], [6.1, 2.0], [3.0, 2.0], [3.0, 5.0], [0.0, 5.0]];
    let corner = |k: usize, z: f64| [corners[k % 6][0] - 2.5, corners[k % 6][1] + 4.25, z];
    let mut all = vec![(0, (0..6).map(|k| corner(k, 1.0)).collect()), (2, (0..6).map(|k| corner(k, 4.0)).collect())];
    all.extend((0..6).map(|k| (1, vec![corner(k, 1.0), corner(k + 1, 1.0), corner(k + 1, 4.0), corner(k, 4.0)])));
    all.extend(faces([-2.0, 5.0, 1.0], [-1.0, 6.0, 2.0]).map(|face| (3, face.to_vec())));
    folder.write("l.rad", &radiance(&all));
    let answer = folder.luxproof(&["import", "l.rad"]).exits(0).prints("32 triangles taken");
    answer
        .prints("room: room.obj in [6.1, 5, 3] m, the scene's outermost surfaces, which close; no box: the wall at")
        .prints("  group walls, reflectance 0.5, 12 triangles");
    let spec = folder.read("l/spec.yaml");
    assert!(spec.contains("  mesh: room.obj ") && spec.contains("\n    \"ceiling\": 0.7\n"), "{spec}");
    assert!(spec.contains("{file: reflectance-0.6.obj, at_m: [2.5, -4.25, -1], reflectance: 0.6}"), "{spec}");
    let checked = folder.luxproof(&["check", "l/spec.yaml"]).exits(0);
    assert!(checked.stderr.is_empty(), "{}", checked.stderr);
    // The names are the user's to find, and to change.
    folder.write("l/spec.yaml", &spec.replace("\"ceiling\"", "\"ceilin\""));
    folder.luxproof(&["check", "l/spec.yaml"]).exits(2).complains("did you mean `ceiling`?");
}

const MEASURED: &str = "luminaires:
  - {id: lamp, photometry: ../lamp.ies, at_m: AT}
meters:
  desk: {points_m: [METERS], normal: [0, 0, 1]}
procedures:
  direct_illuminance: {meters: desk}
  indirect_illuminance: {meters: desk, bounces: converged}
budget: {relative_error: 0.02, seconds: 30}
";

const HAND: &str = "luxproof: 1
room:
  size_m: [6.1, 4.3, 3.1]
  reflectance: {floor: 0.2, walls: 0.5, ceiling: 0.7}
obstacles:
  - box: {min_m: [3.7, 1.5, 0], max_m: [4.7, 2.3, 0.9], reflectance: 0.6}
  - mesh: {file: table.obj, reflectance: 0.35}
";

/// The plate as two rectangles.
const TABLE: &str =
    "v 1 1 .7\nv 2.2 1 .7\nv 2.2 1.6 .7\nv 1 1.6 .7\nv 1.6 1.6 .7\nv 1.6 2.8 .7\nv 1 2.8 .7\nf 1 2 3 4\nf 4 5 6 7\n";

/// 97.5 % quantile of Student's t with the simulator's seven degrees of freedom.
const STUDENT_T: f64 = 2.365;

/// What the simulator reads of a room that lies somewhere: value and half width by procedure and meter.
fn readings(folder: &Folder, spec: &str, geometry: &str, at: [f64; 3]) -> BTreeMap<String, (f64, f64)> {
    let place = |p: [f64; 3]| format!("{:?}", [0, 1, 2].map(|k| p[k] + at[k]));
    let meters = [[0.5, 0.6, 0.75], [1.3, 1.3, 0.2], [3.0, 3.5, 0.75], [5.2, 2.0, 0.4]].map(place).join(", ");
    let measured = MEASURED.replace("METERS", &meters).replace("AT", &place([3.0, 2.0, 2.6]));
    folder.write(spec, &format!("{geometry}{measured}"));
    let out = format!("out-{}", spec.replace('/', "-"));
    folder.luxproof(&["run", spec, "--out", &out, "--no-calibration", "--engines", "simulator"]);
    let report = folder.json(&format!("{out}/report.json"));
    let read = among(&report, "readings", &[("engine", "simulator")]).into_iter().map(|r| {
        let name = format!("{} {}", r["procedure"].as_str().unwrap(), r["meter"].as_str().unwrap());
        let error = r["std_error"].as_f64();
        let within = error.map_or_else(|| r["error_bound"].as_f64().unwrap_or(0.0), |e| STUDENT_T * e);
        (name, (r["value"].as_f64().unwrap(), within))
    });
    read.collect()
}

#[test]
fn an_imported_room_reads_what_the_same_room_reads_by_hand() {
    let folder = Folder::new(&[("lamp.ies", LAMP)]);
    std::fs::create_dir(folder.path("hand")).unwrap();
    folder.write("hand/table.obj", TABLE);
    let hand = readings(&folder, "hand/spec.yaml", HAND, [0.0; 3]);
    // As a box, from elsewhere; and as surfaces in a black box, which a speck outside of the room makes of it.
    let off = [-10.25, 3.5, 0.75];
    folder.write("boxed.rad", &radiance(&polygons(off)));
    let mut with_speck = polygons(off);
    with_speck.push((0, [[0.0, 10.0, 0.0], [0.1, 10.0, 0.0], [0.0, 10.1, 0.0]].to_vec()));
    folder.write("open.rad", &radiance(&with_speck));
    for (name, kind) in [("boxed", "box"), ("open", "black")] {
        let reported = folder.luxproof(&["import", &format!("{name}.rad"), "--format", "json"]).exits(0).json();
        assert_eq!(reported["room"]["kind"], kind, "{reported}");
        let spec = folder.read(&format!("{name}/spec.yaml"));
        let (geometry, _) = spec.split_once("luminaires:").unwrap();
        // Where the room's corner lies in the spec.
        let low: Vec<f64> = reported["min_m"].as_array().unwrap().iter().map(|c| c.as_f64().unwrap()).collect();
        let margin = reported["room"]["margin_m"].as_f64().unwrap();
        let at = [0, 1, 2].map(|k| off[k] - low[k] + margin);
        let imported = readings(&folder, &format!("{name}/spec.yaml"), geometry, at);
        assert_eq!((hand.len(), imported.len()), (8, 8));
        for (meter, (lux, within)) in &imported {
            let (by_hand, of_hand) = hand[meter];
            let allowed = within + of_hand + 1e-9 * by_hand;
            assert!(
                allowed <= 0.06 * by_hand + 1e-9,
                "{name} {meter}: {lux} within {within}, {by_hand} within {of_hand}"
            );
            assert!((lux - by_hand).abs() <= allowed, "{name} {meter}: {lux} for {by_hand} within {allowed}");
        }
    }
    // The table and the crate hide the lamp, and not from every meter.
    assert_eq!(hand["direct_illuminance desk[1]"].0, 0.0);
    assert!(hand["direct_illuminance desk[0]"].0 > 1.0);
}
