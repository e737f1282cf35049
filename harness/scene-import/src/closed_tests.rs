//! Rooms of any shape among a scene's surfaces, and scenes that have none.

use std::collections::BTreeSet;
use std::fmt::Write;

use base64::Engine;
use glam::DVec3;
use luxproof_scene::enclosure::{Enclosure, Face};

use super::tests::{BOX, polygon, read, read_with, room};
use super::{Imported, Options, RoomKind, RoomMesh, Up, Walls};

/// A material by its number, and corners.
type Polygon = (usize, Vec<[f64; 3]>);

const NAMES: [(&str, f64); 4] = [("floor", 0.2), ("walls", 0.5), ("ceiling", 0.7), ("crate", 0.4)];

const L: [[f64; 2]; 6] = [[0.0, 0.0], [6.1, 0.0], [6.1, 2.0], [3.0, 2.0], [3.0, 5.2], [0.0, 5.2]];

/// Upright walls over an L from an origin, looking inwards.
fn l_shaped(at: [f64; 3]) -> Vec<Polygon> {
    let corner = |k: usize, z: f64| [L[k % 6][0] + at[0], L[k % 6][1] + at[1], z + at[2]];
    let mut all = vec![(0, (0..6).map(|k| corner(k, 0.0)).collect())];
    all.extend((0..6).map(|k| (1, vec![corner(k + 1, 0.0), corner(k, 0.0), corner(k, 3.1), corner(k + 1, 3.1)])));
    all.push((2, (0..6).rev().map(|k| corner(k, 3.1)).collect()));
    all
}

/// A room 3 m high over a floor plan.
fn upright(floor: &[[f64; 2]]) -> Vec<Polygon> {
    let corner = |k: usize, z: f64| [floor[k % floor.len()][0], floor[k % floor.len()][1], z];
    let n = floor.len();
    let walls = (0..n).map(|k| (1, vec![corner(k + 1, 0.0), corner(k, 0.0), corner(k, 3.0), corner(k + 1, 3.0)]));
    let ends = [(0, (0..n).map(|k| corner(k, 0.0)).collect()), (2, (0..n).rev().map(|k| corner(k, 3.0)).collect())];
    walls.chain(ends).collect()
}

/// The coordinates of a room's vertices, to the bit.
fn corner_bits(imported: &Imported) -> BTreeSet<[u64; 3]> {
    mesh(imported).vertices_m.iter().map(|v| v.to_array().map(f64::to_bits)).collect()
}

/// A box's polygons, looking outwards.
fn cuboid(low: [f64; 3], high: [f64; 3]) -> Vec<Polygon> {
    let outwards = BOX.map(|face| face.map(|p| [0, 1, 2].map(|k| if p[k] == 0.0 { low[k] } else { high[k] })));
    outwards.into_iter().map(|face| (3, face.into_iter().rev().collect())).collect()
}

fn radiance(polygons: &[Polygon]) -> String {
    let materials = NAMES.map(|(name, rho)| format!("void plastic {name} 0 0 5 {rho} {rho} {rho} 0 0\n")).concat();
    let surfaces = polygons.iter().map(|(material, corners)| polygon(NAMES[*material].0, corners));
    surfaces.fold(materials, |text, surface| text + &surface)
}

fn of(polygons: &[Polygon]) -> Imported {
    read(&[("a.rad", radiance(polygons).as_bytes())]).unwrap()
}

fn mesh(imported: &Imported) -> &RoomMesh {
    match &imported.walls {
        Walls::Mesh(mesh) => mesh,
        Walls::Box(_) => panic!("{:?}", imported.summary.room),
    }
}

/// As the spec's own builder makes it.
fn enclosure(imported: &Imported) -> Enclosure {
    let mesh = mesh(imported);
    let faces = mesh.groups.iter().flat_map(|group| {
        group
            .triangles
            .iter()
            .map(|t| Face { corners_m: t.map(|v| mesh.vertices_m[v as usize]), reflectance: group.reflectance })
    });
    Enclosure::of_faces(faces.collect()).unwrap()
}

/// Volume inside, if all triangles look there.
fn volume_m3(imported: &Imported) -> f64 {
    let mesh = mesh(imported);
    let triangles = mesh.groups.iter().flat_map(|group| &group.triangles);
    let volumes = triangles.map(|t| {
        let [a, b, c] = t.map(|v| mesh.vertices_m[v as usize]);
        -a.dot(b.cross(c)) / 6.0
    });
    volumes.sum()
}

/// Reflectance and triangles of each group, by name.
fn groups(imported: &Imported) -> Vec<(&str, f64, usize)> {
    let all = mesh(imported).groups.iter();
    all.map(|group| (group.name.as_str(), group.reflectance, group.triangles.len())).collect()
}

fn why(imported: &Imported) -> [&str; 2] {
    let summary = &imported.summary.room;
    assert_eq!(summary.kind, RoomKind::Black, "{summary:?}");
    [summary.why.as_deref().unwrap(), summary.why_not_closed.as_deref().unwrap()]
}

const L_M3: f64 = (6.1 * 2.0 + 3.0 * 3.2) * 3.1;

#[test]
fn an_l_shaped_room_is_one_in_three_formats() {
    let polygons = l_shaped([0.0; 3]);
    let rad = of(&polygons);
    assert_eq!(groups(&rad), [("floor", 0.2, 4), ("walls", 0.5, 12), ("ceiling", 0.7, 4)]);
    assert!((volume_m3(&rad) - L_M3).abs() < 1e-9, "{}", volume_m3(&rad));
    assert!(rad.meshes.is_empty());
    let mut obj = "mtllib a.mtl\n".to_owned();
    for (material, corners) in &polygons {
        for [x, y, z] in corners {
            writeln!(obj, "v {} {} {}", 1e3 * x, 1e3 * z, -1e3 * y).unwrap();
        }
        let places: Vec<String> = (1..=corners.len()).rev().map(|k| format!("-{k}")).collect();
        writeln!(obj, "usemtl {}\nf {}", NAMES[*material].0, places.join(" ")).unwrap();
    }
    let mtl = NAMES.map(|(name, rho)| format!("newmtl {name}\nKd {rho} {rho} {rho}\n")).concat();
    let options = Options { up: Some(Up::Y), unit_m: Some(0.001), ..Options::default() };
    let obj = read_with(&[("a.obj", obj.as_bytes()), ("a.mtl", mtl.as_bytes())], &options).unwrap();
    let glb = read(&[("a.gltf", gltf(mesh(&rad)).as_bytes())]).unwrap();
    for other in [&obj, &glb] {
        assert_eq!(groups(other), groups(&rad));
        assert_eq!((mesh(other).size_m, other.place), (mesh(&rad).size_m, rad.place));
        assert_eq!(corner_bits(other), corner_bits(&rad));
        assert!((volume_m3(other) - L_M3).abs() < 1e-9);
    }
}

/// A document of a room's own triangles, a primitive a group.
fn gltf(room: &RoomMesh) -> String {
    let floats = room.vertices_m.iter().flat_map(|v| [v.x as f32, v.z as f32, -v.y as f32]);
    let mut bytes: Vec<u8> = floats.flat_map(f32::to_le_bytes).collect();
    let count = room.vertices_m.len();
    let mut views = format!(r#"{{"buffer": 0, "byteLength": {}}}"#, bytes.len());
    let mut accessors = format!(r#"{{"bufferView": 0, "componentType": 5126, "count": {count}, "type": "VEC3"}}"#);
    let (mut primitives, mut materials) = (vec![], vec![]);
    for (k, group) in room.groups.iter().enumerate() {
        let (start, count) = (bytes.len(), 3 * group.triangles.len());
        bytes.extend(group.triangles.iter().flatten().flat_map(|v| v.to_le_bytes()));
        write!(views, r#", {{"buffer": 0, "byteOffset": {start}, "byteLength": {}}}"#, 4 * count).unwrap();
        write!(
            accessors,
            r#", {{"bufferView": {}, "componentType": 5125, "count": {count}, "type": "SCALAR"}}"#,
            k + 1
        )
        .unwrap();
        primitives.push(format!(r#"{{"attributes": {{"POSITION": 0}}, "indices": {}, "material": {k}}}"#, k + 1));
        let (name, rho) = (&group.name, group.reflectance);
        materials.push(format!(
            r#"{{"name": "{name}", "pbrMetallicRoughness": {{"baseColorFactor": [{rho}, {rho}, {rho}, 1], "metallicFactor": 0}}}}"#
        ));
    }
    let data = base64::engine::general_purpose::STANDARD.encode(&bytes);
    format!(
        r#"{{"asset": {{"version": "2.0"}}, "nodes": [{{"mesh": 0}}], "meshes": [{{"primitives": [{}]}}], "materials": [{}],
"accessors": [{accessors}], "bufferViews": [{views}],
"buffers": [{{"byteLength": {}, "uri": "data:application/octet-stream;base64,{data}"}}]}}"#,
        primitives.join(","),
        materials.join(","),
        bytes.len()
    )
}

#[test]
fn windings_do_not_matter_and_a_body_that_closes_within_is_a_body() {
    let mut polygons = l_shaped([-10.5, 300.25, 0.75]);
    polygons.extend(cuboid([-9.5, 301.25, 0.75], [-8.5, 302.25, 1.75]));
    let one = of(&polygons);
    polygons.iter_mut().step_by(3).for_each(|(_, corners)| corners.reverse());
    let mixed = of(&polygons);
    for imported in [&one, &mixed] {
        assert!((volume_m3(imported) - L_M3).abs() < 1e-9, "{}", volume_m3(imported));
        assert_eq!(imported.meshes.iter().map(|part| part.mesh.triangles.len()).collect::<Vec<_>>(), [12]);
        assert_eq!(mesh(imported).vertices_m.iter().copied().reduce(DVec3::min), Some(DVec3::ZERO));
        assert!(imported.summary.notes.is_empty(), "{:?}", imported.summary.notes);
    }
    // What closes around nothing is no room.
    let (open, crates) = (l_shaped([0.0; 3]), cuboid([1.0, 1.0, 0.0], [2.0, 2.0, 1.0]));
    let open = of(&open[..7].iter().cloned().chain(crates).collect::<Vec<_>>());
    assert!(why(&open)[1].starts_with("open edges: 6, the first from "), "{:?}", why(&open));
}

/// The box's floor in two parts, which no wall has a corner between.
fn two_floors() -> String {
    let parts = [("m5", 0.0, 2.5), ("m6", 2.5, 6.0)]
        .map(|(of, from, to)| polygon(of, &[[from, 0.0, 0.0], [to, 0.0, 0.0], [to, 4.0, 0.0], [from, 4.0, 0.0]]));
    room().replace(&polygon("m5", &BOX[4]), "") + &parts.concat()
}

#[test]
fn a_floor_of_two_reflectances_has_two_groups_though_its_corners_lie_on_edges_of_walls() {
    let read = read(&[("a.rad", two_floors().as_bytes())]).unwrap();
    assert_eq!(read.summary.room.why.as_deref(), Some("the floor has several reflectances, from 0.5 to 0.6"));
    // Two of the walls have a triangle more, each cut where the floor's parts meet.
    let expected = [("m1", 0.1, 2), ("m2", 0.2, 2), ("m3", 0.3, 3), ("m4", 0.4, 3), ("m5", 0.5, 2), ("m6", 0.6, 4)];
    assert_eq!(groups(&read), expected);
    assert!((volume_m3(&read) - 72.0).abs() < 1e-9);
    let enclosure = enclosure(&read);
    assert!(enclosure.contains(DVec3::new(2.5, 1e-3, 1e-3), 0.0));
    assert_eq!(enclosure.room.reflectance.floor, 0.6);
}

#[test]
fn sheets_and_crates_that_share_edges_with_the_room_stand_in_it() {
    // The edge at x = 2.5 is of two floors and a sheet; a crate shares corners with floor and walls.
    let sheet = polygon("m1", &[[2.5, 0.0, 0.0], [2.5, 4.0, 0.0], [2.5, 4.0, 1.0], [2.5, 0.0, 1.0]]);
    let with_crate = two_floors() + &sheet + "!genbox m2 crate 2.5 1 1\n";
    let imported = read(&[("a.rad", with_crate.as_bytes())]).unwrap();
    assert!((volume_m3(&imported) - 72.0).abs() < 1e-9);
    let parts: Vec<_> = imported.meshes.iter().map(|part| (part.reflectance, part.mesh.triangles.len())).collect();
    assert_eq!(parts, [(0.1, 2), (0.2, 12)]);
    assert!(imported.summary.notes.is_empty(), "{:?}", imported.summary.notes);
    // A rug lies free, though its edges are those of floor and wall.
    let rug = polygon("m1", &[[0.0, 0.0, 0.0], [2.5, 0.0, 0.0], [2.5, 1.0, 0.0], [0.0, 1.0, 0.0]]);
    let rug = read(&[("a.rad", (two_floors() + &rug).as_bytes())]).unwrap();
    assert!((volume_m3(&rug) - 72.0).abs() < 1e-9);
    assert!(rug.summary.notes[0].contains("2 triangles lie free"), "{:?}", rug.summary.notes);
}

/// A corner of a Moebius strip of 20 parts, at one of its edges.
fn on_moebius_strip(k: i32, s: f64) -> [f64; 3] {
    let turn = f64::from(k) * std::f64::consts::TAU / 20.0;
    let r = 3.0 + s * (turn / 2.0).cos();
    [r * turn.cos(), r * turn.sin(), s * (turn / 2.0).sin()]
}

#[test]
fn what_does_not_close_around_everything_says_where() {
    let no_wall: Vec<Polygon> =
        l_shaped([0.0; 3]).into_iter().enumerate().filter(|(k, _)| *k != 4).map(|(_, p)| p).collect();
    let [no_box, not_closed] = why(&of(&no_wall)).map(str::to_owned);
    assert!(no_box.contains("is not covered once"), "{no_box}");
    assert!(not_closed.starts_with("open edges: 4, the first from [3, "), "{not_closed}");
    // Two rooms that touch nowhere, and one that a speck lies beside.
    let mut two = l_shaped([0.0; 3]);
    two.extend(l_shaped([10.0, 0.0, 0.0]));
    assert!(why(&of(&two))[1].contains("reaches from"), "{:?}", why(&of(&two)));
    let mut speck = l_shaped([0.0; 3]);
    speck.push((3, vec![[5.0, 4.0, 1.0], [5.1, 4.0, 1.0], [5.0, 4.1, 1.0]]));
    assert!(why(&of(&speck))[1].contains("leaves surfaces out of it, the first at [5.0"), "{:?}", why(&of(&speck)));
    // A strip of one side: its edge is open.
    let strip = (0..20).map(|k| {
        let [low, high] = [-1.0, 1.0].map(|s| on_moebius_strip(k, s));
        // The last corners are the first ones, the other way round.
        let end = if k == 19 { [(0, 1.0), (0, -1.0)] } else { [(k + 1, -1.0), (k + 1, 1.0)] };
        let end = end.map(|(k, s)| on_moebius_strip(k, s));
        [(1, vec![low, high, end[1]]), (1, vec![low, end[1], end[0]])]
    });
    let strip: Vec<Polygon> = strip.flatten().collect();
    assert!(why(&of(&strip))[1].contains("open edges: 40,"), "{:?}", why(&of(&strip)));
    // The hemihexahedron closes and has one side: four of an octahedron's faces, and its three squares.
    let corner = |k: usize, sign: f64| std::array::from_fn(|axis| if axis == k { sign } else { 0.0 });
    let faces = [[1.0, 1.0, 1.0], [1.0, -1.0, -1.0], [-1.0, 1.0, -1.0], [-1.0, -1.0, 1.0]];
    let faces = faces.map(|signs| (1, vec![corner(0, signs[0]), corner(1, signs[1]), corner(2, signs[2])]));
    let halves = [(0, 1.0), (0, -1.0), (1, 1.0), (1, -1.0), (2, 1.0), (2, -1.0)];
    let halves = halves.map(|(k, sign)| (1, vec![corner(k, 1.0), corner((k + 1) % 3, sign), corner(k, -1.0)]));
    let single: Vec<Polygon> = faces.into_iter().chain(halves).collect();
    assert!(
        why(&of(&single))[1].starts_with("the outside is at both sides of the triangle"),
        "{:?}",
        why(&of(&single))
    );
}

#[test]
fn a_fine_floor_under_many_pieces_is_looked_at_within_limits() {
    // 20,000 triangles of the floor of an L, and 20,000 pieces that stand on it and touch nothing.
    let mut polygons = l_shaped([0.0; 3]);
    polygons.remove(0);
    let step = [3.0 / 50.0, 2.0 / 50.0, 3.1 / 50.0, 3.2 / 50.0];
    for (from, [dx, dy]) in
        [([0.0, 0.0], [step[0], step[1]]), ([3.0, 0.0], [step[2], step[1]]), ([0.0, 2.0], [step[0], step[3]])]
    {
        for k in 0..2500 {
            let corners = [[0, 0], [1, 0], [1, 1], [0, 1]]
                .map(|[i, j]| [from[0] + dx * f64::from(k % 50 + i), from[1] + dy * f64::from(k / 50 + j), 0.0]);
            polygons.push((0, corners.to_vec()));
        }
    }
    for k in 0..20_000 {
        let [x, y] = [0.1 + 0.014 * f64::from(k % 200), 0.1 + 0.05 * f64::from(k / 200)];
        polygons.push((3, vec![[x, y, 0.01], [x + 0.01, y, 0.01], [x, y, 0.3]]));
    }
    let read = of(&polygons);
    assert_eq!((groups(&read)[0].0, groups(&read)[0].2), ("floor", 15_000));
    assert!((volume_m3(&read) - L_M3).abs() < 1e-6, "{}", volume_m3(&read));
    // Not every piece is held against every triangle.
    assert!(read.summary.notes[0].starts_with("of 20000 bodies one in "), "{:?}", read.summary.notes);
}

#[test]
fn luminaire_and_meters_lie_within_walls_that_are_no_box() {
    let u = [[0.0, 0.0], [20.0, 0.0], [20.0, 9.0], [19.2, 9.0], [19.2, 0.8], [0.8, 0.8], [0.8, 9.0], [0.0, 9.0]];

    for polygons in [l_shaped([0.0; 3]), upright(&u), upright(&[[0.0, 0.0], [9.0, 0.0], [0.5, 0.5], [0.0, 9.0]])] {
        let imported = of(&polygons);
        let enclosure = enclosure(&imported);
        let super::Place { lamp_m, low_m, high_m } = imported.place;
        assert!(enclosure.contains(lamp_m, 0.0), "{lamp_m}");
        let super::MeterGrid { origin_m, step_m, counts } = super::MeterGrid::within(low_m, high_m);
        for k in 0..counts[0] * counts[1] {
            let off = DVec3::new(step_m[0] * (k % counts[0]) as f64, step_m[1] * (k / counts[0]) as f64, 0.0);
            assert!(enclosure.contains(origin_m + off, 0.0), "{} of {:?}", origin_m + off, imported.place);
        }
    }
    // The largest box about the lamp in an L is most of one of its arms.
    let super::Place { low_m, high_m, .. } = of(&l_shaped([0.0; 3])).place;
    assert!((high_m - low_m).truncate().element_product() > 9.0, "{low_m} to {high_m}");
}

#[test]
fn groups_have_names_of_their_own() {
    let scene = radiance(&l_shaped([0.0; 3]));
    let scene = scene.replace("floor", "\"a.b c\"").replace("walls", "a_b_c").replace("ceiling", "{x}");
    let read = read(&[("a.rad", scene.as_bytes())]).unwrap();
    let names: Vec<&str> = groups(&read).into_iter().map(|(name, ..)| name).collect();
    assert_eq!(names, ["a_b_c", "a_b_c-2", "_x_"]);
    let text = mesh(&read).obj();
    let path = std::path::Path::new("room.obj");
    let back = luxproof_scene::geometry::Mesh::groups_of_obj(&mut text.as_bytes(), path).unwrap();
    for (group, (name, mesh_of)) in mesh(&read).groups.iter().zip(&back) {
        let corners: Vec<DVec3> =
            group.triangles.iter().flatten().map(|v| mesh(&read).vertices_m[*v as usize]).collect();
        let read_back: Vec<DVec3> =
            mesh_of.triangles.iter().flatten().map(|v| mesh_of.vertices_m[*v as usize]).collect();
        assert_eq!((&group.name, corners), (name, read_back));
    }
}
