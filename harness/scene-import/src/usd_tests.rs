//! Lights, meshes, transforms and materials of USD layers, and layers that are none.

use std::f64::consts::PI;

use luxproof_photometry::{LuminousOpening, Photometry, lm63};

use super::tests::{BOX, cuboid, notes, read, read_with};
use super::*;

/// A layer in metres with z up: a box room of one colour, and prims.
fn layer(prims: &str) -> String {
    let points = BOX.iter().flatten().map(|[x, y, z]| format!("({x}, {y}, {z})")).join(", ");
    let indices = (0..24).join(", ");
    format!(
        r#"#usda 1.0
(
    "A comment"
    defaultPrim = "World"
    metersPerUnit = 1
    upAxis = "Z"
)

def Xform "World" (kind = "component")
{{
    def Mesh "Room" (prepend apiSchemas = ["MaterialBindingAPI"])
    {{
        int[] faceVertexCounts = [4, 4, 4, 4, 4, 4]
        int[] faceVertexIndices = [{indices}]
        point3f[] points = [{points}] (interpolation = "vertex")
        color3f[] primvars:displayColor = [(0.5, 0.5, 0.5)]
        uniform token subdivisionScheme = "none"
    }}
{prims}
}}
"#
    )
}

/// The luminaires of a layer with such prims, and what was left out.
fn lights(prims: &str) -> (Vec<ImportedLuminaire>, String) {
    let table = b"IESNA:LM-63-2002\nTILT=NONE\n1 -1 1 3 1 1 2 0 0 0\n1 1 0\n0 60 180\n0\n200 200 100\n";
    let imported = read(&[("a.usda", layer(prims).as_bytes()), ("a.ies", table)]).unwrap();
    let left_out = imported.summary.left_out.iter().map(|l| format!("{} {}", l.count, l.what)).join("\n");
    (imported.luminaires, left_out + "\n" + &imported.summary.notes.join("\n"))
}

/// The photometry of the only luminaire, and its candela in a direction.
fn only(prims: &str) -> (ImportedLuminaire, Photometry) {
    let (mut luminaires, left_out) = lights(prims);
    assert_eq!(luminaires.len(), 1, "{left_out}");
    let luminaire = luminaires.remove(0);
    let photometry = lm63::parse(&luminaire.bytes).unwrap();
    (luminaire, photometry)
}

fn candela((luminaire, photometry): &(ImportedLuminaire, Photometry), c: f64, gamma: f64) -> f64 {
    luminaire.flux_scale * photometry.distribution.intensity(c, gamma).value()
}

fn assert_near(found: f64, expected: f64, relative: f64) {
    assert!((found - expected).abs() <= relative * expected.abs(), "{found} {expected}");
}

/// Luminance times projected area, by the formulas of `UsdLux`.
#[test]
fn lights_have_the_intensity_of_their_luminance_and_shape() {
    // Without `normalize`: 1000 nits times pi r^2, doubled by each step of exposure.
    let sphere = only(
        r#"def SphereLight "S" { float inputs:intensity = 500
        float inputs:exposure = 1
        float inputs:radius = 0.1 }"#,
    );
    for (c, gamma) in [(0.0, 0.0), (77.0, 90.0), (10.0, 170.0)] {
        assert_near(candela(&sphere, c, gamma), 1000.0 * PI * 0.01, 1e-6);
    }
    assert!(matches!(sphere.1.opening, LuminousOpening::Ellipsoid { x_m, .. } if (x_m - 0.2).abs() < 1e-9));
    let disk = only(
        r#"def DiskLight "D" { float inputs:intensity = 100
        float inputs:radius = 0.5 }"#,
    );
    let rectangle = only(
        r#"def RectLight "R" { float inputs:intensity = 300
        float inputs:width = 0.5
        float inputs:height = 2
        bool inputs:normalize = 1 }"#,
    );
    for (light, normal) in [(&disk, 100.0 * PI * 0.25), (&rectangle, 300.0)] {
        for gamma in [0.0, 30.0, 60.0, 84.5] {
            assert_near(candela(light, 123.0, gamma), normal * f64::cos(gamma.to_radians()), 2e-4);
        }
        assert_eq!(candela(light, 0.0, 100.0), 0.0);
    }
    assert_eq!(rectangle.1.opening, LuminousOpening::Box { x_m: 0.5, y_m: 2.0, height_m: 0.0 });
    // A cylinder along x: dark along its axis, 2 r l L across.
    let cylinder = only(
        r#"def CylinderLight "C" { float inputs:intensity = 50
        float inputs:radius = 0.02
        float inputs:length = 1.5 }"#,
    );
    for (c, gamma) in [(90.0, 90.0), (0.0, 0.0), (0.0, 180.0), (0.0, 60.0), (0.0, 90.0), (45.0, 90.0)] {
        let along = f64::sin(f64::to_radians(gamma)) * f64::cos(f64::to_radians(c));
        let expected = 2.0 * 0.02 * 1.5 * 50.0 * (1.0 - along * along).max(0.0).sqrt();
        assert!((candela(&cylinder, c, gamma) - expected).abs() < 2e-4 * 3.0, "{c} {gamma}");
    }
    let point = only(
        r#"def SphereLight "P" { float intensity = 40
        bool treatAsPoint = 1
        bool inputs:normalize = true }"#,
    );
    assert_near(candela(&point, 0.0, 0.0), 10.0, 1e-9);
    assert_eq!(point.1.opening, LuminousOpening::Point);
}

#[test]
fn profiles_multiply_and_flat_lights_add_their_cosine() {
    let point = only(
        r#"def SphereLight "P" { float inputs:intensity = 8
        bool inputs:normalize = 1
        bool treatAsPoint = 1
        color3f inputs:color = (0.5, 0.5, 0.5)
        asset inputs:shaping:ies:file = @./a.ies@ }"#,
    );
    assert_eq!(point.0.flux_scale, 1.0);
    assert_eq!((candela(&point, 0.0, 30.0), candela(&point, 0.0, 180.0)), (200.0, 100.0));
    let flat = only(
        r#"def RectLight "R" { float inputs:intensity = 2
        bool inputs:normalize = 1
        asset inputs:shaping:ies:file = @a.ies@ }"#,
    );
    for (gamma, table) in [(0.0, 200.0), (60.0, 200.0), (80.0, 200.0 - 100.0 / 6.0)] {
        assert_near(candela(&flat, 0.0, gamma), 2.0 * table * f64::cos(f64::to_radians(gamma)), 1e-6);
    }
    assert_eq!(candela(&flat, 0.0, 120.0), 0.0);
}

/// A point with the profile `a.ies`, such metadata and such an input.
fn with_profile(metadata: &str, input: &str) -> (ImportedLuminaire, Photometry) {
    only(&format!(
        r#"def SphereLight "P" {metadata} {{ float inputs:intensity = 4
        bool inputs:normalize = 1
        bool treatAsPoint = 1
        {input}
        asset inputs:shaping:ies:file = @a.ies@ }}"#
    ))
}

/// Without softness a light is full up to the angle of its cone and dark beyond. `ShapingAPI` has a default of 90 degrees.
#[test]
fn cones_cut_tables_off_and_have_the_default_of_their_schema() {
    let isotropic = only(
        r#"def SphereLight "P" { float inputs:intensity = 40
        bool inputs:normalize = 1
        bool treatAsPoint = 1
        float inputs:shaping:cone:angle = 30.5 }"#,
    );
    for (gamma, expected) in [(0.0, 10.0), (30.4, 10.0), (30.6, 0.0), (120.0, 0.0)] {
        assert_eq!(candela(&isotropic, 45.0, gamma), expected, "{gamma}");
    }
    let applied = r#"(prepend apiSchemas = ["ShapingAPI"])"#;
    // The table falls from 200 at 60 degrees to 100 at 180.
    for (light, upwards) in [
        (with_profile(applied, ""), 0.0),
        (with_profile(applied, "float inputs:shaping:cone:angle = 180"), 100.0),
        (with_profile("", ""), 100.0),
    ] {
        assert_near(candela(&light, 0.0, 90.0), 175.0, 1e-12);
        assert_eq!(candela(&light, 0.0, 180.0), upwards);
        assert_eq!(light.0.flux_scale, 1.0);
    }
    assert_eq!(candela(&with_profile(applied, ""), 0.0, 90.001), 0.0);
    // A flat light within a cone: the cosine, and nothing beyond.
    let flat = only(
        r#"def RectLight "R" { float inputs:intensity = 100
        bool inputs:normalize = 1
        float inputs:shaping:cone:angle = 40 }"#,
    );
    assert_near(candela(&flat, 0.0, 39.9), 100.0 * f64::cos(f64::to_radians(39.9)), 2e-4);
    assert_eq!(candela(&flat, 0.0, 40.1), 0.0);
}

/// `OpenUSD`'s colours have the primaries of ITU-R BT.709, its blackbody colours a luminance of 1 by these weights.
#[test]
fn colours_of_lights_count_by_their_luminance_and_odd_inputs_are_noted() {
    let red = only(
        r#"def SphereLight "P" { float inputs:intensity = 4000
        bool inputs:normalize = 1
        bool treatAsPoint = 1
        color3f inputs:color = (1, 0, 0) }"#,
    );
    assert_near(candela(&red, 0.0, 30.0), 212.6, 1e-6);
    let (luminaires, said) = lights(
        r#"def RectLight "dim" { float inputs:diffuse = 0.25
        float inputs:intensity = 4 }"#,
    );
    let photometry = lm63::parse(&luminaires[0].bytes).unwrap();
    assert_near(candela(&(luminaires[0].clone(), photometry), 0.0, 0.0), 1.0, 1e-6);
    assert!(said.contains("`dim`: its intensities are multiplied by its `diffuse` 0.25"), "{said}");
    let centimetres = layer(
        r#"def SphereLight "P" { float inputs:intensity = 4
        bool inputs:normalize = 1
        bool treatAsPoint = 1 }"#,
    )
    .replace("metersPerUnit = 1", "metersPerUnit = 0.01");
    let imported = read(&[("a.usda", centimetres.as_bytes())]).unwrap();
    assert!(notes(&imported).contains("has 1e-4 times the light"), "{}", notes(&imported));
    let photometry = lm63::parse(&imported.luminaires[0].bytes).unwrap();
    assert_near(candela(&(imported.luminaires[0].clone(), photometry), 0.0, 0.0), 1.0, 1e-6);
}

/// Planes of 90 to 270 degrees, and a table that is dark at once beyond its end.
#[test]
fn profiles_of_flat_lights_keep_their_planes_and_ends() {
    let table = b"IESNA:LM-63-2002\nTILT=NONE\n1 -1 1 2 2 1 2 0 0 0\n1 1 0\n0 60\n90 270\n200 200\n200 100\n";
    let text = layer(
        r#"def DiskLight "D" { float inputs:intensity = 1
        bool inputs:normalize = 1
        asset inputs:shaping:ies:file = @b.ies@ }"#,
    );
    let imported = read(&[("a.usda", text.as_bytes()), ("b.ies", table)]).unwrap();
    let photometry = lm63::parse(&imported.luminaires[0].bytes).unwrap();
    let disk = (imported.luminaires[0].clone(), photometry);
    assert_near(candela(&disk, 90.0, 60.0), 100.0, 1e-9);
    assert_near(candela(&disk, 270.0, 60.0), 50.0, 1e-9);
    assert_eq!(candela(&disk, 90.0, 60.01), 0.0);
}

#[test]
fn what_no_photometric_file_says_is_left_out_and_named() {
    let (luminaires, left_out) = lights(
        r#"def DistantLight "a" {}
        def DomeLight "b" {}
        def SphereLight "c" { float inputs:shaping:cone:angle = 30
            float inputs:shaping:cone:softness = 0.1 }
        def SphereLight "d" { float inputs:shaping:focus = 5 }
        def SphereLight "e" { float inputs:intensity = 0 }
        def RectLight "f" { asset inputs:texture:file = @t.png@ }
        def DiskLight "g" { float3 xformOp:scale = (1, 2, 1)
            uniform token[] xformOpOrder = ["xformOp:scale"] }
        def SphereLight "h" { float inputs:shaping:ies:angleScale = 0.5 }
        def SphereLight "i" { bool inputs:shaping:ies:normalize = 1 }
        def RectLight "j" { float3 xformOp:scale = (-1, 1, 1)
            uniform token[] xformOpOrder = ["xformOp:scale"] }
        def SphereLight "k" { token visibility = "invisible" }
        over "World" { def SphereLight "l" {} }
        def SphereLight "m" (active = false) {}
        def Sphere "ball" {}
        def RectLight "kept" { float inputs:shaping:cone:angle = 90 }"#,
    );
    assert_eq!(luminaires.iter().map(|l| l.id.as_str()).collect::<Vec<_>>(), ["kept"]);
    for what in [
        "1 distant lights",
        "1 dome lights",
        "1 lights with a soft cone",
        "1 lights with a focus",
        "1 lights without light",
        "1 lights with a texture",
        "1 round lights that are scaled to ovals",
        "1 lights with scaled profiles",
        "1 lights with normalised profiles",
        "1 lights that are mirrored or sheared",
        "1 prims that are invisible",
        "1 spheres (export them as meshes)",
    ] {
        assert!(left_out.contains(what), "{what}: {left_out}");
    }
}

/// Centimetres with y up: (x, y, z) cm is (x, -z, y) / 100 m.
#[test]
fn units_axes_and_transforms_place_lights_and_meshes() {
    let text = r#"#usda 1.0
(
    upAxis = "Y"
)
def Xform "A"
{
    double3 xformOp:translate = (100, 200, -50)
    float3 xformOp:rotateXYZ = (0, 90, 0)
    float3 xformOp:scale = (2, 2, 2)
    uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateXYZ", "xformOp:scale"]

    def Cube "Body"
    {
        double size = 20
    }
    def SphereLight "Lamp"
    {
        float inputs:radius = 5
        float inputs:intensity = 100
        double3 xformOp:translate:pivot = (10, 0, 0)
        uniform token[] xformOpOrder = ["xformOp:translate:pivot"]
    }
}
"#;
    let options = Options { reflectances: [("default".to_owned(), 0.4)].into(), ..Options::default() };
    let imported = read_with(&[("a.usda", text.as_bytes())], &options).unwrap();
    assert_eq!((imported.summary.up, imported.summary.unit_m), ("y", 0.01));
    // The cube has an edge of 40 cm about (100, 200, -50) cm.
    for (found, expected) in imported.summary.min_m.iter().zip([0.8, 0.3, 1.8]) {
        assert!((found - expected).abs() < 1e-9, "{:?}", imported.summary.min_m);
    }
    // Turned by 90 degrees about y, x is -z: the lamp is 20 cm beyond in -z, which is up's +y.
    let lamp = &imported.luminaires[0];
    let at_m = lamp.at_m - imported.origin_m;
    assert!(at_m.distance(DVec3::new(1.0, 0.7, 2.0)) < 1e-9, "{at_m}");
    // Its radius is 10 cm.
    let photometry = lm63::parse(&lamp.bytes).unwrap();
    assert_near(photometry.distribution.intensity(0.0, 0.0).value(), 100.0 * PI * 0.01, 1e-6);
    // The user's unit goes before the layer's.
    let metres = Options { unit_m: Some(1.0), ..options };
    let imported = read_with(&[("a.usda", text.as_bytes())], &metres).unwrap();
    assert!((imported.summary.min_m[0] - 80.0).abs() < 1e-9);
}

/// A material of a preview surface with such inputs, and a body of it.
fn material(name: &str, inputs: &str) -> String {
    format!(
        r#"def Material "{name}" {{
            token outputs:surface.connect = </World/{name}/S.outputs:surface>
            def Shader "S" {{ uniform token info:id = "UsdPreviewSurface"
                {inputs} }} }}
        def Cube "body_{name}" {{ double size = 0.5
            rel material:binding = </World/{name}>
            double3 xformOp:translate = (2, 2, 1)
            uniform token[] xformOpOrder = ["xformOp:translate"] }}"#
    )
}

#[test]
fn materials_are_what_preview_surfaces_say() {
    let grey = layer(&material("grey", "color3f inputs:diffuseColor = (0.3, 0.3, 0.3)"));
    let imported = read(&[("a.usda", grey.as_bytes())]).unwrap();
    assert_eq!((imported.meshes.len(), imported.meshes[0].reflectance), (1, 0.3));
    assert_eq!(cuboid(&imported).reflectance.floor, 0.5);
    assert!(notes(&imported).contains("gloss of USD's materials"), "{}", notes(&imported));
    for (inputs, what) in [
        ("float inputs:opacity = 0.4", "transparent (opacity 0.4)"),
        ("float inputs:metallic = 1", "metal (metallic 1)"),
        ("color3f inputs:diffuseColor.connect = </World/T.outputs:rgb>", "textured (diffuseColor)"),
    ] {
        let error = read(&[("a.usda", layer(&material("m", inputs)).as_bytes())]).unwrap_err();
        assert!(error.contains(what), "{error}");
    }
    let shining = layer(&material("m", "color3f inputs:emissiveColor = (1, 1, 1)"));
    let imported = read(&[("a.usda", shining.as_bytes())]).unwrap();
    assert!(imported.summary.left_out.iter().any(|l| l.what.contains("emissiveColor")), "{:?}", imported.summary);
}

#[test]
fn layers_that_are_none_or_composed_are_refused_with_a_remedy() {
    for (name, bytes, says) in [
        ("a.usdc", b"PXR-USDC\0\0\0".to_vec(), "usdcat"),
        ("a.usd", b"PXR-USDC\0\0\0".to_vec(), "binary layer (usdc)"),
        ("a.usdz", b"PK\x03\x04".to_vec(), "package (usdz)"),
        ("a.usda", Vec::from("no usda"), "this is no usda"),
        ("a.usda", Vec::from("#usda 1.0\ndef Mesh \"a\" {"), "ends too early"),
        ("a.usda", Vec::from("#usda 1.0\ndef \"a\" (references = @b.usda@) {}"), "it is composed (references)"),
        ("a.usda", Vec::from("#usda 1.0\n(subLayers = [@b.usda@])\n"), "it is composed (subLayers)"),
        (
            "a.usda",
            Vec::from("#usda 1.0\ndef \"a\" { variantSet \"v\" = { \"x\" {} } }"),
            "it is composed (variantSets)",
        ),
        ("a.usda", Vec::from("#usda 1.0\ndef PointInstancer \"a\" {}"), "draws others many times"),
        ("a.usda", Vec::from("#usda 1.0\n(metersPerUnit = 0)\n"), "metersPerUnit is no length"),
        ("a.usda", Vec::from("#usda 1.0\n}"), "`}` is not expected here"),
        ("a.usda", Vec::from("#usda 1.0\ndef \"a\" { float x = 1e999x }"), "this is no number"),
        ("a.usda", Vec::from("#usda 1.0\ndef \"a\" { string x = \"open }"), "a string has no end"),
        ("a.usda", Vec::from("#usda 1.0\n"), "no surface of it was taken"),
        (
            "a.usda",
            Vec::from(
                "#usda 1.0\ndef Mesh \"a\" { point3f[] points = [(0,0,0)]\nint[] faceVertexCounts = [3]\nint[] faceVertexIndices = [0, 1, 2] }",
            ),
            "a corner of it is none of its points",
        ),
        (
            "a.usda",
            Vec::from("#usda 1.0\ndef SphereLight \"a\" { asset inputs:shaping:ies:file = @gone.ies@ }"),
            "gone.ies cannot be read",
        ),
    ] {
        let error = read(&[(name, &bytes)]).unwrap_err();
        assert!(error.contains(says), "{says}: {error}");
    }
    let deep = format!("#usda 1.0\n{}{}", "def \"a\" {".repeat(1000), "}".repeat(1000));
    assert!(read(&[("a.usda", deep.as_bytes())]).unwrap_err().contains("below one another"));
    let nested = format!("#usda 1.0\ndef \"a\" {{ float[] points = {} }}", "[".repeat(100_000));
    assert!(read(&[("a.usda", nested.as_bytes())]).unwrap_err().contains("is not expected here"));
}

#[test]
fn a_layer_of_a_stranger_names_files_below_its_folder_alone_and_few_lights() {
    let stranger = Options { trust: Trust::Stranger, ..Options::default() };
    let light = r#"def SphereLight "a" { asset inputs:shaping:ies:file = @/etc/passwd@ }"#;
    let error = read_with(&[("a.usda", layer(light).as_bytes())], &stranger).unwrap_err();
    assert!(error.contains("does not lie below") && !error.contains("root:"), "{error}");
    let many = (0..501).map(|k| format!("def SphereLight \"l{k}\" {{ bool treatAsPoint = 1 }}\n")).join("");
    let error = read_with(&[("a.usda", layer(&many).as_bytes())], &stranger).unwrap_err();
    assert!(error.contains("more than 500 lights"), "{error}");
}

/// Faces of a mesh by their subsets, comments of all kinds, and time samples that are passed over.
#[test]
fn subsets_comments_and_samples_are_read_as_they_are() {
    let text = layer(
        r#"    # a comment
    // another { one
    /* and { a long
       one */
    def Material "red" { token outputs:surface.connect = </World/red/S.outputs:surface>
        def Shader "S" { uniform token info:id = "UsdPreviewSurface"
            color3f inputs:diffuseColor = (0.2, 0.2, 0.2) } }
    def Mesh "M"
    {
        float3[] points.timeSamples = { 0: [(0, 0, 0)], 1: None }
        point3f[] points = [(2, 1, 1), (3, 1, 1), (3, 2, 1), (2, 2, 1), (2, 1, 1.5), (3, 1, 1.5), (3, 2, 1.5)]
        int[] faceVertexCounts = [4, 3]
        int[] faceVertexIndices = [0, 1, 2, 3, 4, 5, 6]
        color3f[] primvars:displayColor = [(0.6, 0.6, 0.6)]
        custom string note = """several "lines"
            of { text"""
        dictionary about = { string a = "}" }
        def GeomSubset "S" { uniform token elementType = "face"
            int[] indices = [1]
            rel material:binding = </World/red> }
    }"#,
    );
    let imported = read(&[("a.usda", text.as_bytes())]).unwrap();
    let mut rows: Vec<_> = imported.meshes.iter().map(|m| (m.reflectance, m.mesh.triangles.len())).collect();
    rows.sort_by(|a, b| a.0.total_cmp(&b.0));
    assert_eq!(rows, [(0.2, 1), (0.6, 2)]);
    assert!(notes(&imported).contains("control meshes"), "{}", notes(&imported));
}
