use std::fs;
use std::path::Path;

use base64::Engine;
use luxproof_scene::geometry::{Mesh, Reflectances, Room};

use super::*;

/// Six polygons of a material a face, looking inwards: x-, x+, y-, y+, floor, ceiling.
pub(super) const BOX: [[[f64; 3]; 4]; 6] = [
    [[0.0, 0.0, 0.0], [0.0, 4.0, 0.0], [0.0, 4.0, 3.0], [0.0, 0.0, 3.0]],
    [[6.0, 0.0, 0.0], [6.0, 0.0, 3.0], [6.0, 4.0, 3.0], [6.0, 4.0, 0.0]],
    [[0.0, 0.0, 0.0], [0.0, 0.0, 3.0], [6.0, 0.0, 3.0], [6.0, 0.0, 0.0]],
    [[0.0, 4.0, 0.0], [6.0, 4.0, 0.0], [6.0, 4.0, 3.0], [0.0, 4.0, 3.0]],
    [[0.0, 0.0, 0.0], [6.0, 0.0, 0.0], [6.0, 4.0, 0.0], [0.0, 4.0, 0.0]],
    [[0.0, 0.0, 3.0], [0.0, 4.0, 3.0], [6.0, 4.0, 3.0], [6.0, 0.0, 3.0]],
];

pub(super) fn read_with(files: &[(&str, &[u8])], options: &Options) -> Result<Imported, String> {
    let folder = tempfile::tempdir().unwrap();
    for (name, bytes) in files {
        fs::write(folder.path().join(name), bytes).unwrap();
    }
    let path = folder.path().join(files[0].0);
    import(&path, options).map_err(|faults| faults.to_string().replace(&format!("{}/", folder.path().display()), ""))
}

pub(super) fn read(files: &[(&str, &[u8])]) -> Result<Imported, String> {
    read_with(files, &Options::default())
}

pub(super) fn polygon(of: &str, corners: &[[f64; 3]]) -> String {
    let numbers: Vec<String> = corners.iter().flatten().map(f64::to_string).collect();
    format!("{of} polygon p 0 0 {} {}\n", numbers.len(), numbers.join(" "))
}

/// A room of six reflectances, each wall another.
pub(super) fn room() -> String {
    let walls = (1..=6).zip(&BOX);
    let walls = walls.map(|(k, corners)| {
        format!("void plastic m{k} 0 0 5 .{k} .{k} .{k} 0 0\n") + &polygon(&format!("m{k}"), corners)
    });
    walls.collect()
}

/// The unit normal of a mesh's first triangle.
fn normal(mesh: &Mesh) -> DVec3 {
    let [a, b, c] = mesh.triangles[0].map(|v| mesh.vertices_m[v as usize]);
    (b - a).cross(c - a).normalize()
}

pub(super) fn cuboid(imported: &Imported) -> Room {
    match &imported.walls {
        Walls::Box(room) => *room,
        Walls::Mesh(mesh) => panic!("{mesh:?}"),
    }
}

pub(super) fn notes(imported: &Imported) -> String {
    imported.summary.notes.join("\n")
}

#[test]
fn a_box_of_outermost_surfaces_is_the_room_with_what_stands_in_it() {
    let crate_on_floor = "!genbox m1 crate 1 1 1\n";
    let read = read(&[("a.rad", (room() + crate_on_floor).as_bytes())]).unwrap();
    let Room { size_m, reflectance: rho } = cuboid(&read);
    assert_eq!((size_m, read.origin_m), (DVec3::new(6.0, 4.0, 3.0), DVec3::ZERO));
    let walls = [rho.wall_x_min, rho.wall_x_max, rho.wall_y_min, rho.wall_y_max];
    assert_eq!((walls, rho.floor, rho.ceiling), ([0.1, 0.2, 0.3, 0.4], 0.5, 0.6));
    // The crate stands in a corner: its bottom and two sides lie in planes of the room, and are its own.
    assert_eq!(
        (read.meshes.len(), read.meshes[0].mesh.triangles.len(), read.meshes[0].mesh.vertices_m.len()),
        (1, 12, 8)
    );
    assert!((read.meshes[0].mesh.volume_m3() - 1.0).abs() < 1e-12);
    assert!(notes(&read).is_empty(), "{}", notes(&read));
    // A rug in the plane of the floor belongs to no body.
    let rug = polygon("m1", &[[2.0, 2.0, 0.0], [3.0, 2.0, 0.0], [3.0, 3.0, 0.0]]);
    let rug = super::tests::read(&[("a.rad", (room() + &rug).as_bytes())]).unwrap();
    assert!(rug.summary.room.kind == RoomKind::Box && notes(&rug).contains("1 triangles lie free"), "{}", notes(&rug));
}

#[test]
fn what_does_not_close_lies_in_a_black_box_that_touches_nothing() {
    let no_floor = room().replace(&polygon("m5", &BOX[4]), "");
    let half = room().replace(&polygon("m5", &BOX[4]), &polygon("m5", &BOX[4][..3]));
    // As large in sum, but not covering.
    let doubled = half.clone() + &polygon("m5", &[[0.5, 0.0, 0.0], [6.0, 0.0, 0.0], [6.0, 4.0, 0.0], [5.0, 4.0, 0.0]]);
    let plane = "void plastic m 0 0 5 .5 .5 .5 0 0\n".to_owned() + &polygon("m", &BOX[4]);
    for (text, why, why_not_closed) in [
        (no_floor, "the floor is not covered", "open edges: 4, the first from [0, 0, 0] to "),
        (half, "the floor is not covered", "open edges: 3, the first from [0, 0, 0] to "),
        (doubled, "the floor is not covered", "open edges: "),
        (plane, "one plane", "open edges: "),
    ] {
        let read = read(&[("a.rad", text.as_bytes())]).unwrap();
        let summary = &read.summary.room;
        assert!(summary.kind == RoomKind::Black && summary.why.as_ref().unwrap().contains(why), "{summary:?}");
        assert!(summary.why_not_closed.as_ref().unwrap().contains(why_not_closed), "{summary:?}");
        let room = cuboid(&read);
        assert!(room.reflectance == Reflectances::with_equal_walls(0.0, 0.0, 0.0));
        assert_eq!(summary.margin_m, 0.3);
        assert!((read.place.low_m - 0.3).abs().max_element() < 1e-12);
        for v in read.meshes.iter().flat_map(|part| &part.mesh.vertices_m) {
            let at = *v + read.origin_m;
            assert!(at.min_element() > 0.29 && (room.size_m - at).min_element() > 0.29, "{at}");
        }
    }
}

#[test]
fn a_finely_cut_floor_under_coarse_bodies_is_a_floor() {
    let mut text = room().replace(&polygon("m5", &BOX[4]), "");
    for k in 0..12 {
        for j in 0..8 {
            let (x, y) = (f64::from(k) / 2.0, f64::from(j) / 2.0);
            text += &polygon("m5", &[[x, y, 0.0], [x + 0.5, y, 0.0], [x + 0.5, y + 0.5, 0.0], [x, y + 0.5, 0.0]]);
        }
    }
    let read = read(&[("a.rad", (text + "!genbox m5 crate 2 2 1\n").as_bytes())]).unwrap();
    assert_eq!(read.summary.room.kind, RoomKind::Box, "{:?}", read.summary.room);
    assert_eq!(read.meshes[0].mesh.triangles.len(), 12);
}

#[test]
fn colours_become_luminous_reflectances_and_what_shines_is_left_out() {
    let text = room()
        + "void plastic red 0 0 5 .8 .1 .2 0 0\nvoid alias rouge red\nvoid light bulb 0 0 3 100 100 100\nvoid glow sky 0 0 4 1 1 1 0\n"
        + &polygon("rouge", &[[1.0, 1.0, 1.0], [2.0, 1.0, 1.0], [2.0, 2.0, 1.0]])
        + "bulb sphere b 0 0 4 3 2 2 .1\nsky source s 0 0 4 0 0 1 180\nvoid polygon nothing 0 0 9 0 0 0 1 0 0 0 1 0\n";
    let read = read(&[("a.rad", text.as_bytes())]).unwrap();
    assert_eq!(read.meshes.len(), 1);
    assert!((read.meshes[0].reflectance - (0.265 * 0.8 + 0.67 * 0.1 + 0.065 * 0.2)).abs() < 1e-6);
    let left: Vec<_> =
        read.summary.left_out.iter().map(|l| (l.what.as_str(), l.count, l.place.clone().unwrap())).collect();
    assert!(
        left[0].0.starts_with("surfaces of `bulb`, which shines (light)") && left[0].2.ends_with("a.rad:15"),
        "{left:?}"
    );
    assert!(
        left.iter().any(|(what, n, place)| what.contains("infinity") && *n == 1 && place.ends_with("a.rad:19")),
        "{left:?}"
    );
    assert!(left.iter().any(|(what, ..)| what.contains("no material")), "{left:?}");
}

#[test]
fn surfaces_that_are_not_plain_are_refused_left_out_or_given_a_reflectance() {
    let scene = room()
        + "void metal chrome 0 0 5 .9 .9 .9 .9 0\nvoid colorfunc wood 4 r g b f.cal 0 0\nwood plastic oak 0 0 5 .4 .4 .4 0 0\n\
           void plastic shiny 0 0 5 .4 .4 .4 .05 .1\nchrome sphere s 0 0 4 3 2 1 .1\noak sphere s 0 0 4 4 2 1 .1\n\
           shiny sphere s 0 0 4 5 2 1 .1\n";
    let files: [(&str, &[u8]); 1] = [("a.rad", scene.as_bytes())];
    let refused = read(&files).unwrap_err();
    for (line, says) in
        [(13, "`chrome` is metal"), (15, "plastic with `wood` on it"), (16, "plastic of specularity 0.05")]
    {
        assert!(refused.lines().any(|l| l.starts_with(&format!("a.rad:{line}:")) && l.contains(says)), "{refused}");
    }
    assert!(refused.contains("--leave-out") && refused.contains("the first at a.rad:17"), "{refused}");
    let left = read_with(&files, &Options { leaves_out: true, ..Options::default() }).unwrap();
    assert_eq!((left.summary.left_out.len(), left.meshes.len()), (3, 0));
    let given = [("chrome", 0.3), ("oak", 0.4), ("shiny", 0.4)].map(|(name, rho)| (name.to_owned(), rho));
    let given = Options { reflectances: given.into(), ..Options::default() };
    let taken = read_with(&files, &given).unwrap();
    assert_eq!(taken.meshes.iter().map(|part| part.reflectance).collect::<Vec<_>>(), [0.3, 0.4]);
    assert!(
        taken.summary.left_out.is_empty()
            && taken.summary.notes[0].contains("curved surfaces are flat faces, 32 around")
    );
    let given = Options { reflectances: [("chrom".to_owned(), 0.3)].into(), ..Options::default() };
    let wrong = read_with(&files, &given).unwrap_err();
    assert!(wrong.contains("did you mean `chrome`?"), "{wrong}");
}

#[test]
fn radiance_files_that_are_none_are_refused_at_their_line() {
    for (text, says) in [
        (
            "\n!xform -t 1 0 0 desk.rad\n",
            "a.rad:2: `!xform -t 1 0 0 desk.rad` is a command, and commands of a scene are not run; run `xform -e",
        ),
        ("!genbox m b 1 1 1 | xform \\\n -t 0 0 1\n", "is a command"),
        ("!genbox m b 1 1 1 -r .1\n", "is a command"),
        ("!genbox m b `rm` 1 1\n", "is a command"),
        ("!genbox m b 1 1 1\n", "a.rad:1: `m` is not defined"),
        ("void plastic m 0 0 5 1 1 1 0 0\n!genbox m b 1 -1 1\n", "a.rad:2: genbox: this is no box"),
        ("m polygon p 0 0 9 0 0 0 1 0 0 0 1 0\n", "a.rad:1: `m` is not defined"),
        ("void plastic m 0 0 5 1 1 1 0 0\n\nm polygon p 0 0 8 0 0 0 1 0 0 0 1\n", "a.rad:3: a polygon of 8 numbers"),
        (
            "void plastic m 0 0 5 1 1 1 0 0\nm polygon p\n0\n0\n9 0 0 0 1 0 0 0 1 nan\n",
            "a.rad:5: `nan` is not a number",
        ),
        ("void plastic m 0 0 5 1.5 1 1 0 0\n", "not at 1.5"),
        ("void plastic m 0 0 4 1 1 1 0\n", "plastic of 4 numbers"),
        ("void plastic m 0 0 99999999999999999999 1\n", "is not a count"),
        ("void plastic m 0 0 9999999999999 1\n", "a number is missing"),
        ("void plastik m 0 0 5 1 1 1 0 0\n", "did you mean `plastic`?"),
        ("void plastic \"m 0 0", "a quote is not closed"),
        ("void", "a type is missing"),
        ("void alias a b\n", "`b` is not defined"),
        ("void mesh m 1 a.rtm 0 0\n", "`m` is mesh"),
        ("void plastic m 0 0 5 1 1 1 0 0\nm sphere s 0 0 3 0 0 0\n", "a.rad:2: sphere: 3 numbers, not 4"),
        ("void plastic m 0 0 5 1 1 1 0 0\nm polygon p 0 0 9 0 0 0 1e9 0 0 0 1 0\n", "none lies beyond"),
        (
            "void plastic m 0 0 5 1 1 1 0 0\nm polygon p 0 0 12 0 0 0 2 2 0 2 0 0 0 1 0\n",
            "a.rad:2: this polygon is none: its edges cross",
        ),
        ("# nothing\n", "no surface of it was taken"),
    ] {
        let error = read(&[("a.rad", text.as_bytes())]).expect_err(text);
        assert!(error.contains("a.rad") && error.contains(says), "{text}: {error}");
    }
    assert!(read(&[("a.dae", b"")]).unwrap_err().contains("no scene by its name"));
    assert!(import(Path::new("no/such.rad"), &Options::default()).unwrap_err().to_string().contains("no/such.rad"));
}

#[test]
fn wavefront_materials_are_what_their_library_says_of_them() {
    let obj = "mtllib a b.mtl c.mtl missing.mtl\nv 0 0 0\nv 1000 0 0\nv 1000 2000 0\nv 0 2000 0\nv 0 0 500\nl 1 2\n\
               f 1 2 3\nusemtl grey\nf 1 2 3 4\nusemtl glass\nf 1 2 5\nusemtl lamp\nf 2 3 5\nusemtl wood\nf 3 4 5\nusemtl none\nf 4 1 5\n";
    let first = "newmtl grey\n  Kd .5\nKs .1 .1 .1\nnewmtl glass\nKd 1 1 1\nd 0.2\n";
    let second =
        "newmtl lamp\nKd 1 1 1\nKe 2 2 2\nnewmtl wood\nKd 1 1 1\nmap_Kd -o 0 0 wood.png\nnewmtl grey\nKd 1 1 1\n";
    let files: [(&str, &[u8]); 3] =
        [("a.obj", obj.as_bytes()), ("b.mtl", first.as_bytes()), ("c.mtl", second.as_bytes())];
    let refused = read(&files).unwrap_err();
    for says in [
        "b.mtl:4: `glass` is transparent (opacity 0.2)",
        "c.mtl:4: `wood` is textured",
        "`none` is of a reflectance that nothing says, and 1 surfaces are of it, the first at a.obj:18",
        "`default` is of a reflectance that nothing says",
    ] {
        assert!(refused.contains(says), "{refused}");
    }
    let options = Options { unit_m: Some(0.001), leaves_out: true, ..Options::default() };
    let read = read_with(&files, &options).unwrap();
    assert_eq!((read.summary.max_m, read.meshes[0].reflectance, read.meshes.len()), ([1.0, 2.0, 0.0], 0.5, 1));
    assert!(notes(&read).contains("missing.mtl is not read") && notes(&read).contains("gloss (Ks) of 1 materials"));
    assert_eq!(read.summary.left_out.iter().map(|l| l.count).sum::<usize>(), 6);
    let up = Options { up: Some(Up::Y), ..options };
    // What points up stays right-handed.
    let turned = read_with(&files, &up).unwrap();
    assert_eq!((turned.summary.min_m, turned.summary.max_m), ([0.0, 0.0, 0.0], [1.0, 0.0, 2.0]));
    for (text, says) in [
        ("newmtl grey\nKd .5 x .5\n", "b.mtl:2: `x` is no number"),
        ("newmtl grey\nKd 2 2 2\n", "b.mtl:1: material `grey`: a reflectance lies between 0 and 1, not at 2"),
        ("newmtl grey\nKd nan nan nan\n", "b.mtl:2: `nan` is no number"),
    ] {
        let error = super::tests::read(&[files[0], ("b.mtl", text.as_bytes())]).unwrap_err();
        assert!(error.contains(says), "{error}");
    }
    let broken = super::tests::read(&[("a.obj", b"v 0 0 0\nf 1 2 3\n")]).unwrap_err();
    assert!(broken.starts_with("a.obj:2: there is no vertex 2"), "{broken}");
}

/// A triangle, with the rest of a document behind it.
fn gltf(rest: &str) -> String {
    let bytes: Vec<u8> =
        [0.0_f32, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 2.0, 0.0].iter().flat_map(|x| x.to_le_bytes()).collect();
    let data = base64::engine::general_purpose::STANDARD.encode(&bytes);
    let own = [
        ("asset", r#"{"version": "2.0"}"#.to_owned()),
        ("nodes", r#"[{"mesh": 0}]"#.to_owned()),
        ("meshes", r#"[{"primitives": [{"attributes": {"POSITION": 0}, "material": 0}]}]"#.to_owned()),
        ("materials", r#"[{"name": "grey", "pbrMetallicRoughness": {"baseColorFactor": [0.5, 0.5, 0.5, 1], "metallicFactor": 0}}]"#.to_owned()),
        ("accessors", r#"[{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"}]"#.to_owned()),
        ("bufferViews", r#"[{"buffer": 0, "byteLength": 36}]"#.to_owned()),
        ("buffers", format!(r#"[{{"byteLength": 36, "uri": "data:application/octet-stream;base64,{data}"}}]"#)),
    ];
    let own = own.iter().filter(|(key, _)| !rest.contains(&format!("\"{key}\":")));
    let own: Vec<String> = own.map(|(key, value)| format!("\"{key}\": {value}")).chain([rest.to_owned()]).collect();
    format!("{{{}}}", own.join(",\n").trim_end_matches(",\n"))
}

/// The extent of a glTF scene and its first mesh.
fn place(rest: &str) -> ([f64; 3], [f64; 3], Mesh) {
    let read = read(&[("a.gltf", gltf(rest).as_bytes())]).unwrap_or_else(|e| panic!("{rest}: {e}"));
    (read.summary.min_m, read.summary.max_m, read.meshes[0].mesh.clone())
}

#[test]
fn nodes_of_gltf_are_where_their_transforms_put_them() {
    // y is up: the triangle stands in the plane y = 0 of a spec.
    let (low, high, mesh) = place("");
    assert_eq!((low, high), ([0.0, 0.0, 0.0], [1.0, 0.0, 2.0]));
    assert_eq!(normal(&mesh), DVec3::NEG_Y);
    let nested = r#""nodes": [{"children": [1], "translation": [10, 0, 0]}, {"mesh": 0, "rotation": [0, 0.70710678, 0, 0.70710678], "scale": [2, 1, 1]}]"#;
    let (low, high, _) = place(nested);
    assert_eq!((low, high), ([10.0, 0.0, 0.0], [10.0, 2.0, 2.0]));
    let matrix = r#""nodes": [{"mesh": 0, "matrix": [-1,0,0,0, 0,1,0,0, 0,0,1,0, 5,0,0,1]}]"#;
    let (low, high, mesh) = place(matrix);
    assert_eq!((low, high), ([4.0, 0.0, 0.0], [5.0, 0.0, 2.0]));
    assert_eq!(normal(&mesh), DVec3::NEG_Y, "what is mirrored still looks there");
    // Only what is below the scene's nodes.
    let scene = r#""scenes": [{"nodes": [1]}, {"nodes": [0]}], "scene": 0, "nodes": [{"mesh": 0}, {"mesh": 0, "translation": [0, 3, 0]}]"#;
    assert_eq!(place(scene).0, [0.0, 0.0, 3.0]);
}

/// A triangle whose corners have colours, of so many parts each.
fn painted(colours: &[[f32; 4]; 3], parts: usize, rest: &str) -> String {
    let corners = [0.0_f32, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 2.0, 0.0].into_iter();
    let colours = colours.iter().flat_map(|colour| colour[..parts].to_vec());
    let bytes: Vec<u8> = corners.chain(colours).flat_map(f32::to_le_bytes).collect();
    let data = base64::engine::general_purpose::STANDARD.encode(&bytes);
    let (length, kind) = (12 * parts, if parts == 4 { "VEC4" } else { "VEC3" });
    gltf(&format!(
        r#""meshes": [{{"primitives": [{{"attributes": {{"POSITION": 0, "COLOR_0": 1}}, "material": 0}}]}}],
        "accessors": [{{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"}}, {{"bufferView": 1, "componentType": 5126, "count": 3, "type": "{kind}"}}],
        "bufferViews": [{{"buffer": 0, "byteLength": 36}}, {{"buffer": 0, "byteOffset": 36, "byteLength": {length}}}],
        "buffers": [{{"byteLength": {}, "uri": "data:application/octet-stream;base64,{data}"}}]{rest}"#,
        bytes.len()
    ))
}

#[test]
fn colours_of_points_multiply_the_base_colour_of_gltf() {
    let read = |text: String| read(&[("a.gltf", text.as_bytes())]).unwrap_or_else(|e| panic!("{text}: {e}")).summary;
    let grey = [[0.2, 0.2, 0.2, 1.0]; 3];
    for parts in [3, 4] {
        let summary = read(painted(&grey, parts, ""));
        assert_eq!((summary.materials[0].reflectance, summary.triangles), (0.1, 1), "{summary:?}");
    }
    let green = read(painted(&[[0.2, 0.4, 0.6, 1.0]; 3], 3, ""));
    // Linear colours of glTF have the primaries of ITU-R BT.709.
    let luminous = 0.5 * (0.2126 * 0.2 + 0.7152 * 0.4 + 0.0722 * 0.6);
    assert!((green.materials[0].reflectance - luminous).abs() < 1e-6, "{green:?}");
    let white = read(painted(&[[1.0; 4]; 3], 3, ""));
    assert_eq!((white.materials[0].name.as_str(), white.materials[0].reflectance), ("grey", 0.5));
    // Of colours that vary no reflectance is made, and the report says so.
    let blend = r#", "materials": [{"name": "grey", "alphaMode": "BLEND", "pbrMetallicRoughness": {"baseColorFactor": [0.5, 0.5, 0.5, 1], "metallicFactor": 0}}]"#;
    for (text, why) in [
        (painted(&[[0.2, 0.2, 0.2, 1.0], [0.2, 0.2, 0.2, 1.0], [0.9, 0.2, 0.2, 1.0]], 3, ""), "vary"),
        (painted(&[[0.2, 0.2, 0.2, 0.5]; 3], 4, blend), "alpha of COLOR_0"),
    ] {
        let summary = super::tests::read(&[("a.gltf", text.as_bytes())]);
        let error = summary.map_or_else(|error| error, |read| format!("{:?}", read.summary.left_out));
        assert!(error.contains(why) && error.contains("COLOR_0"), "{error}");
    }
}

#[test]
fn gltf_that_is_none_or_more_than_is_read_is_refused() {
    let deep = format!(r#""extras": {}{}"#, "[".repeat(100_000), "]".repeat(100_000));
    for (rest, says) in [
        (
            r#""nodes": [{"children": [1]}, {"children": [0], "mesh": 0}], "scenes": [{"nodes": [0]}]"#,
            "nodes[0] is below itself",
        ),
        (r#""nodes": [{"children": [1, 1]}, {"mesh": 0}]"#, "nodes[1] is below itself, or in two places"),
        (r#""nodes": [{"mesh": 7}]"#, "nodes[0]: there is no meshes[7]"),
        (r#""nodes": [{"children": [9]}]"#, "there is no nodes[9]"),
        (r#""scene": 3"#, "there is no scenes[3]"),
        (r#""nodes": [{"mesh": 0, "scale": [1e308, 1e308, 1e308], "translation": [1e308, 0, 0]}]"#, "beyond"),
        (r#""nodes": [{"mesh": 0, "rotation": [0, 0, 0, 0]}]"#, "nodes[0]: its transform is none"),
        (r#""nodes": [{"mesh": 0, "skin": 0}]"#, "bent by a skin"),
        (
            r#""accessors": [{"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3"}]"#,
            "out of its buffer view",
        ),
        (
            r#""accessors": [{"bufferView": 0, "byteOffset": 18446744073709551615, "componentType": 5126, "count": 3, "type": "VEC3"}]"#,
            "out of its buffer view",
        ),
        (
            r#""accessors": [{"bufferView": 0, "componentType": 5126, "count": 99999999999, "type": "VEC3"}]"#,
            "more than 30000000 points",
        ),
        (r#""accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC2"}]"#, "it is not VEC3"),
        (r#""accessors": [{"bufferView": 0, "componentType": 7, "count": 3, "type": "VEC3"}]"#, "component type"),
        (r#""accessors": [{"componentType": 5126, "count": 3, "type": "VEC3"}]"#, "no buffer view"),
        (
            r#""accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3", "sparse": {}}]"#,
            "sparse",
        ),
        (
            r#""bufferViews": [{"buffer": 0, "byteOffset": 18446744073709551615, "byteLength": 36}]"#,
            "out of its buffer",
        ),
        (r#""bufferViews": [{"buffer": 0, "byteLength": 36, "byteStride": 4}]"#, "overlap"),
        (r#""bufferViews": [{"buffer": 5, "byteLength": 36}]"#, "its buffer is not there"),
        (r#""buffers": [{"byteLength": 36, "uri": "data:;base64,!!!!"}]"#, "buffers[0]: its data URI"),
        (r#""buffers": [{"byteLength": 36, "uri": "https://example.org/a.bin"}]"#, "on a network"),
        (r#""buffers": [{"byteLength": 36, "uri": "../../../../dev/zero"}]"#, "cannot be read"),
        (r#""buffers": [{"byteLength": 36, "uri": "a%20b.bin"}]"#, "a b.bin cannot be read"),
        (r#""buffers": [{"byteLength": 36, "uri": "data:;base64,AAAA"}]"#, "it has 3 bytes, and `byteLength` is 36"),
        (r#""buffers": [{"byteLength": 36}]"#, "it names no file"),
        (r#""extensionsRequired": ["KHR_draco_mesh_compression"]"#, "KHR_draco_mesh_compression; export it without"),
        (r#""extensionsUsed": ["EXT_mesh_gpu_instancing"]"#, "EXT_mesh_gpu_instancing"),
        (r#""materials": [{"name": "x"}]"#, "`x` is metal (metallicFactor 1)"),
        (
            r#""materials": [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}, "metallicFactor": 0}}]"#,
            "`materials[0]` is textured",
        ),
        (
            r#""materials": [{"pbrMetallicRoughness": {"baseColorFactor": [2, 0, 0, 1], "metallicFactor": 0}}]"#,
            "not at 2",
        ),
        (
            r#""materials": [{"alphaMode": "BLEND", "pbrMetallicRoughness": {"baseColorFactor": [1, 0, 0, 0.5]}}]"#,
            "transparent (alpha 0.5)",
        ),
        (r#""materials": [{"emissiveFactor": [1, 1, 1]}]"#, "no surface of it was taken"),
        (r#""materials": []"#, "there is no materials[0]"),
        (
            r#""meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}]"#,
            "`default` is of a reflectance that nothing says",
        ),
        (r#""meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "mode": 9, "material": 0}]}]"#, "mode 9"),
        (r#""asset": {"version": "1.0"}"#, "asset.version is `1.0`"),
        (r#""nodes": {}"#, "a.gltf:7:9: this is no glTF: invalid type: map, expected a list;"),
    ] {
        let error = read(&[("a.gltf", gltf(rest).as_bytes())]).expect_err(rest);
        assert!(error.contains("a.gltf") && error.contains(says), "{rest}: {error}");
    }
    assert_eq!(
        read(&[("a.gltf", gltf(&deep).as_bytes())]).unwrap().summary.triangles,
        1,
        "what is deep is passed over"
    );
    let many = format!(r#""nodes": [{}{{}}]"#, "{},".repeat(300_000));
    assert!(read(&[("a.gltf", gltf(&many).as_bytes())]).unwrap_err().contains("a list of more than 200000"));
    let huge = r#""nodes": [{"mesh": 0, "translation": [1e999, 0, 0]}]"#;
    assert!(read(&[("a.gltf", gltf(huge).as_bytes())]).unwrap_err().contains("number out of range"));
}

#[test]
fn a_glb_is_read_and_one_cut_short_is_refused() {
    let json = gltf("");
    let mut glb = b"glTF".to_vec();
    for word in [2, 20 + json.len(), json.len()] {
        glb.extend((word as u32).to_le_bytes());
    }
    glb.extend(b"JSON");
    glb.extend(json.as_bytes());
    assert_eq!(read(&[("a.glb", &glb)]).unwrap().summary.triangles, 1);
    for length in 4..glb.len() {
        assert!(read(&[("a.glb", &glb[..length])]).is_err(), "{length}");
    }
    let mut other = glb.clone();
    other[4] = 1;
    assert!(read(&[("a.glb", &other)]).unwrap_err().contains("version 1"));
}

#[test]
fn a_file_of_a_stranger_names_files_below_its_folder_alone() {
    let stranger = Options { trust: Trust::Stranger, ..Options::default() };
    let text = gltf(r#""buffers": [{"byteLength": 36, "uri": "/etc/passwd"}]"#);
    let error = read_with(&[("a.gltf", text.as_bytes())], &stranger).unwrap_err();
    assert!(error.contains("does not lie below"), "{error}");
    let obj = "mtllib /etc/passwd\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl a\nf 1 2 3\n";
    let given = Options { reflectances: [("a".to_owned(), 0.5)].into(), ..stranger };
    let read = read_with(&[("a.obj", obj.as_bytes())], &given).unwrap();
    assert!(notes(&read).contains("does not lie below"), "{}", notes(&read));
}

/// A scene of a box room, a body and some luminaires, of random numbers.
pub(super) fn random_scene(random: &mut fastrand::Rng) -> luxproof_scene::Scene {
    use luxproof_photometry::{LuminousIntensityDistribution, Photometry};
    use luxproof_scene::{Luminaire, LuminaireModel, Obstacle, Scene, Shape, orientation};
    let mut between = |low: f64, high: f64| low + (high - low) * random.f64();
    let size_m = DVec3::new(between(3.0, 9.0), between(3.0, 9.0), between(2.4, 4.0));
    let reflectance = Reflectances {
        floor: between(0.1, 0.3),
        ceiling: between(0.6, 0.9),
        wall_x_min: between(0.3, 0.4),
        wall_x_max: between(0.4, 0.5),
        wall_y_min: between(0.5, 0.6),
        wall_y_max: between(0.3, 0.6),
    };
    let low_m = DVec3::new(between(0.3, 0.9), between(0.3, 0.9), between(0.1, 0.3));
    let high_m = low_m + DVec3::new(between(0.2, 1.0), between(0.2, 1.0), between(0.2, 0.8));
    let mut luminaires = vec![];
    for k in 0..3 {
        let c_deg = vec![0.0, 90.0, 180.0, 270.0, 360.0];
        let mut candela: Vec<f64> = (0..20).map(|_| between(1.0, 900.0).round()).collect();
        for gamma in [0, 3] {
            (0..5).for_each(|c| candela[4 * c + gamma] = 300.0);
        }
        candela.copy_within(0..4, 16);
        let table = LuminousIntensityDistribution::new(c_deg, vec![0.0, 50.0, 110.0, 180.0], candela).unwrap();
        luminaires.push(Luminaire {
            id: format!("lamp {k}"),
            photometry: std::sync::Arc::new(Photometry::of(table)),
            position_m: DVec3::new(between(1.0, 2.0), between(1.0, 2.0), between(1.5, 2.2)),
            orientation: orientation(between(-180.0, 180.0), between(0.0, 180.0), between(-180.0, 180.0)),
            flux_scale: between(0.2, 1.5),
            model: LuminaireModel::Point,
        });
    }
    let shape = Shape::Box { min_m: low_m, max_m: high_m };
    Scene {
        room: Some(Room { size_m, reflectance }),
        obstacles: vec![Obstacle { shape, reflectance: between(0.1, 0.8) }],
        luminaires,
    }
}

#[test]
fn ten_random_scenes_come_back_from_gltf_and_usd_with_their_light() {
    use luxproof_scene_export::{SceneFormat, export_scene};
    let mut random = fastrand::Rng::with_seed(71);
    let formats = SceneFormat::ALL.into_iter().cycle();
    for (_, format) in (0..20).zip(formats) {
        let scene = random_scene(&mut random);
        let exported = export_scene(&scene, "random", format);
        let mut files: Vec<(&str, &[u8])> =
            exported.files.iter().map(|f| (f.name.as_str(), f.bytes.as_slice())).collect();
        // The scene is the last of the files, and the first is read.
        files.rotate_right(1);
        let imported = read(&files).unwrap();
        let room = cuboid(&imported);
        let before = scene.room.unwrap();
        // Coordinates of glTF are rounded to 1e-6 of the scene's size.
        assert!(room.size_m.distance(before.size_m) < 1e-5, "{} {}", room.size_m, before.size_m);
        for surface in luxproof_scene::geometry::Surface::ALL {
            assert!((room.reflectance.of(surface) - before.reflectance.of(surface)).abs() < 1e-6);
        }
        assert_eq!(imported.luminaires.len(), 3);
        for (luminaire, found) in scene.luminaires.iter().zip(&imported.luminaires) {
            let [azimuth, tilt, roll] = found.rotate_deg;
            let photometry = luxproof_photometry::lm63::parse(&found.bytes).unwrap();
            let again = luxproof_scene::Luminaire {
                photometry: std::sync::Arc::new(photometry),
                position_m: found.at_m,
                orientation: luxproof_scene::orientation(azimuth, tilt, roll),
                flux_scale: found.flux_scale,
                ..luminaire.clone()
            };
            // Names of USD have no blanks.
            assert_eq!(found.id.replace('_', " "), luminaire.id);
            for target in [[0.1, 0.2, 0.1], [2.5, 0.4, 1.0], [1.0, 2.9, 2.3], [2.9, 2.9, 0.2]].map(DVec3::from) {
                let lux = |lamp: &luxproof_scene::Luminaire| {
                    let path = target - lamp.position_m;
                    lamp.intensity_towards(path).value() / path.length_squared()
                };
                assert!((lux(&again) / lux(luminaire) - 1.0).abs() < 1e-6, "{} {}", lux(&again), lux(luminaire));
            }
        }
    }
}

#[test]
fn points_of_gltf_become_luminaires_and_other_lights_are_left_out() {
    let mut random = fastrand::Rng::with_seed(1);
    let mut scene = random_scene(&mut random);
    scene.luminaires.truncate(1);
    let exported = luxproof_scene_export::export_scene(&scene, "lights", luxproof_scene_export::SceneFormat::Gltf);
    let mut document: serde_json::Value = serde_json::from_slice(&exported.files.last().unwrap().bytes).unwrap();
    let list = document["nodes"].as_array_mut().unwrap();
    let count = list.len();
    for light in 0..2 {
        list.push(
            serde_json::json!({"translation": [1, 2, 2], "extensions": {"KHR_lights_punctual": {"light": light}}}),
        );
    }
    list[0]["children"].as_array_mut().unwrap().extend([count.into(), (count + 1).into()]);
    document["extensions"]["KHR_lights_punctual"] =
        serde_json::json!({"lights": [{"type": "point", "intensity": 40.0}, {"type": "directional"}]});
    let text = document.to_string();
    let files = [("scene.gltf", text.as_bytes()), ("luminaire-0.ies", &exported.files[0].bytes)];
    let imported = read(&files).unwrap();
    assert_eq!(imported.luminaires.len(), 2);
    let point = &imported.luminaires[1];
    assert!(point.id == "light-1" && point.at_m.distance(DVec3::new(1.0, 2.0, 2.0)) < 1e-9, "{point:?}");
    let photometry = luxproof_photometry::lm63::parse(&point.bytes).unwrap();
    assert_eq!(photometry.distribution.intensity(77.0, 120.0).value(), 40.0);
    assert!(imported.summary.left_out.iter().any(|l| l.what.contains("directional") && l.count == 1));
}

/// The formula of the extension: full inside, none outside, the square of a straight line in the cosine between.
#[test]
fn spots_of_gltf_have_the_intensity_of_their_cones() {
    let mut random = fastrand::Rng::with_seed(1);
    let mut scene = random_scene(&mut random);
    scene.luminaires.clear();
    let exported = luxproof_scene_export::export_scene(&scene, "spot", luxproof_scene_export::SceneFormat::Gltf);
    let mut document: serde_json::Value = serde_json::from_slice(&exported.files.last().unwrap().bytes).unwrap();
    let list = document["nodes"].as_array_mut().unwrap();
    let count = list.len();
    for light in 0..4 {
        list.push(
            serde_json::json!({"translation": [1, 2, 2], "extensions": {"KHR_lights_punctual": {"light": light}}}),
        );
    }
    list[0]["children"].as_array_mut().unwrap().extend((count..count + 4).map(serde_json::Value::from));
    document["extensions"]["KHR_lights_punctual"] = serde_json::json!({"lights": [
        {"type": "spot", "intensity": 500.0, "spot": {"innerConeAngle": 0.3, "outerConeAngle": 0.7}},
        {"type": "spot", "intensity": 500.0},
        {"type": "spot", "intensity": 500.0, "spot": {"innerConeAngle": 0.7, "outerConeAngle": 0.3}},
        {"type": "spot", "intensity": 100.0, "spot": {"innerConeAngle": 0.0, "outerConeAngle": 0.01}},
    ]});
    let imported = read(&[("scene.gltf", document.to_string().as_bytes())]).unwrap();
    assert_eq!(imported.luminaires.len(), 3);
    for (luminaire, candela, [inner, outer]) in
        [(0, 500.0, [0.3_f64, 0.7_f64]), (1, 500.0, [0.0, std::f64::consts::FRAC_PI_4]), (2, 100.0, [0.0, 0.01])]
    {
        let photometry = luxproof_photometry::lm63::parse(&imported.luminaires[luminaire].bytes).unwrap();
        for angle in [0.0_f64, 0.004, 0.2, 0.3, 0.4, 0.55, 0.69, 0.75, 1.0, 2.0, 3.0] {
            let scale = 1.0 / (inner.cos() - outer.cos()).max(0.001);
            let expected = candela * ((angle.cos() - outer.cos()) * scale).clamp(0.0, 1.0).powi(2);
            let found = photometry.distribution.intensity(20.0, angle.to_degrees()).value();
            assert!((found - expected).abs() < 3e-4 * candela, "{luminaire} {angle}: {found} {expected}");
        }
    }
    assert!(imported.summary.left_out.iter().any(|l| l.what.contains("spots without a cone") && l.count == 1));
}
