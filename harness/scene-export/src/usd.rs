//! `scene.usda`: meshes with diffuse materials, and the lights of `UsdLux` with `shaping:ies:file`.
//!
//! Source: `OpenUSD`, `UsdLux`: intensity is luminance in nits; `normalize` divides it by the area of the light; the profile
//! multiplies it; lights shine along -z. A sphere that is treated as a point then has a quarter of `intensity` times the
//! profile as its luminous intensity: pi r^2 of 4 pi r^2.

use std::collections::BTreeSet;

use glam::{DMat3, DVec3};
use itertools::Itertools as _;
use luxproof_photometry::LuminousOpening;
use luxproof_scene::{Luminaire, LuminaireModel, Scene};

use crate::flat::{FlatLights, FlatShape, Side, flat_lights};
use crate::soup::{Mesh, meshes};
use crate::{ExportedFile, photometric_file, profile_name};

/// `intensity` of a sphere per candela of its profile.
const SPHERE_INTENSITY: f64 = 4.0;
/// The radius of a sphere that stands for a point, in metres.
const POINT_RADIUS_M: f64 = 1e-3;

/// The scope of all materials.
const MATERIALS: &str = "Materials";

/// The layer.
pub(crate) fn text(scene: &Scene, title: &str, lights: &[Light]) -> String {
    let meshes = meshes(scene);
    let mut names = PrimNames([MATERIALS.to_owned()].into());
    let mut text = format!(
        "#usda 1.0\n(\n    defaultPrim = \"World\"\n    doc = {doc}\n    metersPerUnit = 1\n    upAxis = \"Z\"\n)\n\n\
         def Xform \"World\" (\n    kind = \"component\"\n)\n{{\n",
        doc = quoted(&format!("{title}. Metres; intensities in nits, profiles in candela; z is up. By luxproof."))
    );
    let reflectances: Vec<f64> = meshes.iter().map(|mesh| mesh.reflectance).sorted_by(f64::total_cmp).dedup().collect();
    text += &format!("    def Scope \"{MATERIALS}\"\n    {{\n");
    for (k, rho) in reflectances.iter().enumerate() {
        text += &material(k, *rho);
    }
    text += "    }\n";
    for mesh in &meshes {
        let material = reflectances.iter().position(|rho| *rho == mesh.reflectance).unwrap_or_default();
        text += &mesh_prim(mesh, &names.unique(&mesh.name), material);
    }
    for light in lights {
        text += &light_prim(light, &names.unique(&light.id));
    }
    text + "}\n"
}

/// Names of prims, each once.
struct PrimNames(BTreeSet<String>);

impl PrimNames {
    /// A name of letters, digits and underscores that is not taken yet.
    fn unique(&mut self, text: &str) -> String {
        let plain: String = text.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '_' }).collect();
        let plain = if plain.starts_with(|c: char| c.is_ascii_alphabetic()) { plain } else { format!("_{plain}") };
        let numbered = std::iter::once(plain.clone()).chain((2..).map(|k| format!("{plain}_{k}")));
        let name = numbered.into_iter().find(|name| !self.0.contains(name)).unwrap_or(plain);
        self.0.insert(name.clone());
        name
    }
}

/// A diffuse material.
fn material(k: usize, rho: f64) -> String {
    format!(
        r#"        def Material "reflectance_{k}"
        {{
            token outputs:surface.connect = </World/Materials/reflectance_{k}/Surface.outputs:surface>

            def Shader "Surface"
            {{
                uniform token info:id = "UsdPreviewSurface"
                color3f inputs:diffuseColor = ({rho}, {rho}, {rho})
                float inputs:metallic = 0
                float inputs:roughness = 1
                color3f inputs:specularColor = (0, 0, 0)
                int inputs:useSpecularWorkflow = 1
                token outputs:surface
            }}
        }}
"#
    )
}

/// A mesh with its material.
fn mesh_prim(mesh: &Mesh, name: &str, material: usize) -> String {
    let low = mesh.vertices_m.iter().copied().fold(DVec3::INFINITY, DVec3::min);
    let high = mesh.vertices_m.iter().copied().fold(DVec3::NEG_INFINITY, DVec3::max);
    let rho = mesh.reflectance;
    format!(
        r#"
    def Mesh "{name}" (
        prepend apiSchemas = ["MaterialBindingAPI"]
    )
    {{
        uniform bool doubleSided = 1
        float3[] extent = [{low}, {high}]
        int[] faceVertexCounts = [{counts}]
        int[] faceVertexIndices = [{indices}]
        rel material:binding = </World/Materials/reflectance_{material}>
        point3f[] points = [{points}]
        color3f[] primvars:displayColor = [({rho}, {rho}, {rho})]
        uniform token subdivisionScheme = "none"
    }}
"#,
        low = tuple(low),
        high = tuple(high),
        counts = mesh.triangles.iter().map(|_| "3").join(", "),
        indices = mesh.triangles.iter().flatten().join(", "),
        points = mesh.vertices_m.iter().map(|v| tuple(*v)).join(", "),
    )
}

/// A light with its profile.
pub(crate) struct Light {
    id: String,
    shape: LightShape,
    intensity: f64,
    orientation: DMat3,
    position_m: DVec3,
    /// Its photometric file.
    pub(crate) profile: ExportedFile,
}

/// What a light is in `UsdLux`.
#[derive(Clone, Copy)]
enum LightShape {
    /// A sphere that is treated as a point.
    Point,
    Flat(FlatShape),
}

impl LightShape {
    /// The kind of prim, and the attributes of its extent.
    fn prim(self) -> (&'static str, String) {
        match self {
            Self::Point => {
                let size = format!("float inputs:radius = {POINT_RADIUS_M}\n        bool treatAsPoint = 1");
                ("SphereLight", size)
            }
            Self::Flat(FlatShape::Rectangle { x_m, y_m }) => {
                ("RectLight", format!("float inputs:width = {x_m}\n        float inputs:height = {y_m}"))
            }
            Self::Flat(FlatShape::Disk { radius_m }) => ("DiskLight", format!("float inputs:radius = {radius_m}")),
        }
    }
}

/// The lights of luminaire `k`, and what they lose, one sentence each.
pub(crate) fn lights(luminaire: &Luminaire, k: usize) -> (Vec<Light>, Vec<String>) {
    let Luminaire { position_m, orientation, .. } = *luminaire;
    let Some(shape) = FlatShape::of(luminaire) else {
        let (bytes, mut losses) = photometric_file(luminaire);
        losses.extend(lost_extent(luminaire));
        let light = Light {
            id: luminaire.id.clone(),
            shape: LightShape::Point,
            intensity: SPHERE_INTENSITY * luminaire.flux_scale,
            orientation,
            position_m,
            profile: ExportedFile { name: profile_name(k), bytes },
        };
        return (vec![light], losses);
    };
    let FlatLights { profiles, mut losses } = flat_lights(&luminaire.photometry);
    if luminaire.model == LuminaireModel::Impostor {
        losses.push("UsdLux has no impostor: it becomes an area".into());
    }
    let lights = profiles.into_iter().map(|(side, bytes)| {
        let (id, name) = match side {
            Side::Down => (luminaire.id.clone(), profile_name(k)),
            Side::Up => (format!("{}_up", luminaire.id), format!("luminaire-{k}-up.ies")),
        };
        Light {
            id,
            shape: LightShape::Flat(shape),
            intensity: luminaire.flux_scale,
            orientation: orientation * side.turn(),
            position_m,
            profile: ExportedFile { name, bytes },
        }
    });
    (lights.collect(), losses)
}

/// What is lost of an opening that is not flat.
fn lost_extent(luminaire: &Luminaire) -> Option<String> {
    if luminaire.model == LuminaireModel::Point || luminaire.photometry.opening == LuminousOpening::Point {
        return None;
    }
    let [y_m, x_m, z_m] = luminaire.photometry.opening.bounding_box_m();
    Some(format!(
        "UsdLux has no light for its opening of {x_m} x {y_m} x {z_m} m: all of its light comes from one point"
    ))
}

/// The prim of a light.
fn light_prim(light: &Light, name: &str) -> String {
    let Light { shape, intensity, orientation, position_m, profile, .. } = light;
    let (kind, size) = shape.prim();
    format!(
        r#"
    def {kind} "{name}" (
        prepend apiSchemas = ["ShapingAPI"]
    )
    {{
        float inputs:intensity = {intensity}
        bool inputs:normalize = 1
        {size}
        float inputs:shaping:cone:angle = 180
        float inputs:shaping:ies:angleScale = 0
        asset inputs:shaping:ies:file = @{profile}@
        bool inputs:shaping:ies:normalize = 0
        matrix4d xformOp:transform = {matrix}
        uniform token[] xformOpOrder = ["xformOp:transform"]
    }}
"#,
        profile = profile.name,
        matrix = matrix(*orientation, *position_m),
    )
}

/// A rotation and a translation; USD multiplies rows from the left.
fn matrix(rotation: DMat3, at_m: DVec3) -> String {
    let rows = [(rotation.x_axis, 0), (rotation.y_axis, 0), (rotation.z_axis, 0), (at_m, 1)];
    let rows = rows.map(|(v, last)| format!("({}, {}, {}, {last})", v.x, v.y, v.z));
    format!("( {} )", rows.join(", "))
}

fn tuple(v: DVec3) -> String {
    format!("({}, {}, {})", v.x, v.y, v.z)
}

/// A text in double quotes.
fn quoted(text: &str) -> String {
    let plain: String = text.chars().map(|c| if c.is_control() { ' ' } else { c }).collect();
    format!("\"{}\"", plain.replace('\\', "\\\\").replace('"', "\\\""))
}
