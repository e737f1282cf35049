//! glTF 2.0 scenes (.gltf, .glb): the triangles of all nodes where their transforms put them.

mod buffers;
mod colours;
mod document;
mod lights;

use std::collections::BTreeSet;

use glam::{DMat4, DQuat, DVec3};

use super::raw::{Kind, NO_MATERIAL, Primaries, Raw, Scene};
use luxproof_process::foreign_json;
use luxproof_process::printable::{Quoted, quoted};
use luxproof_spec::SpecError;

use buffers::Buffers;
use colours::Painted;
use document::{Document, MaterialOf, Node, Primitive};

/// 32-bit floats have 24 bits.
const PRECISION: f64 = 1e-6;

/// Extensions that change nothing that is taken, or are looked at.
const KNOWN: [&str; 7] = [
    "EXT_lights_ies",
    "KHR_mesh_quantization",
    "KHR_lights_punctual",
    "KHR_texture_transform",
    "KHR_materials_transmission",
    "KHR_materials_pbrSpecularGlossiness",
    "KHR_materials_unlit",
];

/// Extensions that change where geometry is, and that are read nowhere here; where one is used it must not be passed
/// over.
const REFUSED: [&str; 3] = ["KHR_draco_mesh_compression", "EXT_meshopt_compression", "EXT_mesh_gpu_instancing"];

const UNPACK: &str =
    "export it without that extension, or undo it first: `gltf-transform` and Blender read and write such files";

/// Reads a scene.
pub(super) fn read<'a>(scene: &'a Scene<'a>) -> Result<Raw<'a>, SpecError> {
    let bytes = scene.bytes()?;
    let (json, binary) = buffers::chunks(scene, &bytes)?;
    let document: Document =
        foreign_json::from_slice(json).map_err(|error| no_document(scene, &error, binary.is_some()))?;
    if !document.asset.version.starts_with("2.") {
        let message = format!("asset.version is `{}`", Quoted(&document.asset.version));
        return Err(scene.fault(None, message, "export it as glTF 2.0"));
    }
    let mut raw = Raw::new(scene, PRECISION, Primaries::Rec709);
    extensions(&mut raw, &document)?;
    let materials: Vec<u32> =
        document.materials.0.iter().enumerate().map(|(k, of)| material(&mut raw, k, of)).collect::<Result<_, _>>()?;
    let buffers = Buffers::of(scene, &document, binary)?;
    let painted = Painted::default();
    let mut reader = Reader { raw, work: 0, document: &document, buffers, materials, nameless: None, painted };
    reader.nodes()?;
    let Reader { mut raw, .. } = reader;
    if !document.animations.0.is_empty() {
        raw.note("animations are left out: nodes are where they are without them");
    }
    Ok(raw)
}

/// What is wrong with a document, at its place where that is one of the file.
fn no_document(scene: &Scene<'_>, error: &serde_json::Error, is_binary: bool) -> SpecError {
    let message = error.to_string();
    // The message ends with the place.
    let message = message.split(" at line ").next().unwrap_or(&message);
    // In a GLB a line of its JSON is no line of the file.
    let [line, column] = [error.line(), error.column()].map(|n| Some(n).filter(|n| *n > 0 && !is_binary));
    let fault = scene.fault(line, format!("this is no glTF: {}", Quoted(message)), "export it again as glTF 2.0");
    SpecError { column, ..fault }
}

/// Refuses extensions without which the scene is another one, and tells of the others.
fn extensions(raw: &mut Raw<'_>, document: &Document) -> Result<(), SpecError> {
    let required = &document.extensions_required.0;
    let refused = required.iter().find(|name| !KNOWN.contains(&name.as_str()));
    let used = document.extensions_used.0.iter().filter(|name| REFUSED.contains(&name.as_str()));
    if let Some(name) = refused.or_else(|| used.clone().next()) {
        return Err(raw.scene.fault(None, format!("it uses the extension {}", Quoted(name)), UNPACK));
    }
    let others = document.extensions_used.0.iter().filter(|name| !KNOWN.contains(&name.as_str()));
    let others: Vec<String> = others.take(20).map(|name| quoted(name)).collect();
    if !others.is_empty() {
        raw.note(format!("passed over: {}", others.join(", ")));
    }
    Ok(())
}

fn material(raw: &mut Raw<'_>, k: usize, of: &MaterialOf) -> Result<u32, SpecError> {
    let scene = raw.scene;
    let name = of.name.clone().filter(|name| !name.is_empty()).unwrap_or_else(|| format!("materials[{k}]"));
    let kind = kind(of).map_err(|why| scene.fault(None, format!("materials[{k}]: {why}"), "correct the colour"))?;
    if matches!(kind, Kind::Diffuse { .. }) {
        raw.note("gloss of glTF's materials is left out: every surface is diffuse, of its base colour");
        if of.normal_texture.is_some() {
            raw.note("normal maps are left out: surfaces are as flat as their triangles");
        }
    }
    Ok(raw.material(&name, kind, scene.path, None))
}

/// What a material is by its metallic-roughness model; without numbers it is a white metal.
fn kind(of: &MaterialOf) -> Result<Kind, String> {
    let pbr = of.pbr_metallic_roughness.as_ref();
    let [red, green, blue, alpha] = pbr.and_then(|pbr| pbr.base_color_factor).unwrap_or([1.0; 4]);
    let extensions = of.extensions.as_ref();
    let shines = of.emissive_factor.is_some_and(|rgb| rgb.iter().any(|part| *part > 0.0));
    // An emissive texture is multiplied by the factor, which is 0 by default.
    if shines {
        let what = if of.emissive_texture.is_some() { "emissiveTexture" } else { "emissiveFactor" };
        return Ok(Kind::Light(what.to_owned()));
    }
    let transmission = extensions.and_then(|all| all.transmission.as_ref()?.transmission_factor).unwrap_or(0.0);
    if transmission > 0.0 {
        return Ok(Kind::Other("transparent (KHR_materials_transmission)".to_owned()));
    }
    if extensions.is_some_and(|all| all.specular_glossiness.is_some()) {
        return Ok(Kind::Other("of another model (KHR_materials_pbrSpecularGlossiness)".to_owned()));
    }
    if extensions.is_some_and(|all| all.unlit.is_some()) {
        return Ok(Kind::Other("a picture of light (KHR_materials_unlit)".to_owned()));
    }
    match of.alpha_mode.as_deref() {
        Some("MASK") => return Ok(Kind::Other("cut out by a texture (alphaMode MASK)".to_owned())),
        Some("BLEND") if alpha < 1.0 => return Ok(Kind::Other(format!("transparent (alpha {alpha})"))),
        _ => {}
    }
    if pbr.is_some_and(|pbr| pbr.base_color_texture.is_some()) {
        return Ok(Kind::Other("textured (baseColorTexture)".to_owned()));
    }
    match pbr.and_then(|pbr| pbr.metallic_factor).unwrap_or(1.0) {
        0.0 => Kind::of_colour([red, green, blue]),
        metallic => Ok(Kind::Other(format!("metal (metallicFactor {metallic})"))),
    }
}

/// How many points may be read and primitives drawn, a mesh in many places as often as it is there.
const MAX_WORK: usize = 30_000_000;

struct Reader<'s, 'a> {
    raw: Raw<'s>,
    work: usize,
    document: &'a Document,
    buffers: Buffers<'a>,
    /// Their places, by the document's indices.
    materials: Vec<u32>,
    nameless: Option<u32>,
    painted: Painted,
}

impl Reader<'_, '_> {
    /// Walks the nodes of the scene; each is met once, so that a circle ends.
    fn nodes(&mut self) -> Result<(), SpecError> {
        let document = self.document;
        let all = &document.nodes.0;
        let roots = self.roots()?;
        if document.scenes.0.len() > 1 {
            let k = document.scene.unwrap_or(0);
            self.raw.note(format!("of {} scenes scenes[{k}] is taken", document.scenes.0.len()));
        }
        let mut left: Vec<(usize, DMat4)> = roots.into_iter().map(|k| (k, DMat4::IDENTITY)).collect();
        left.reverse();
        let mut is_met = vec![false; all.len()];
        while let Some((k, above)) = left.pop() {
            let node = all.get(k).ok_or_else(|| self.fault(&format!("there is no nodes[{k}]")))?;
            if std::mem::replace(&mut is_met[k], true) {
                return Err(self.fault(&format!("nodes[{k}] is below itself, or in two places")));
            }
            let local = transform(node).filter(DMat4::is_finite);
            let local = local.ok_or_else(|| self.fault(&format!("nodes[{k}]: its transform is none")))?;
            let whole = above * local;
            self.node(k, node, &whole)?;
            left.extend(node.children.0.iter().rev().map(|child| (*child, whole)));
        }
        Ok(())
    }

    /// The nodes of the scene, or those of no other node.
    fn roots(&self) -> Result<Vec<usize>, SpecError> {
        let (scenes, all) = (&self.document.scenes.0, &self.document.nodes.0);
        if let Some(k) = self.document.scene.or((!scenes.is_empty()).then_some(0)) {
            let scene = scenes.get(k).ok_or_else(|| self.fault(&format!("scene: there is no scenes[{k}]")))?;
            return Ok(scene.nodes.0.clone());
        }
        let mut is_child = vec![false; all.len()];
        for k in all.iter().flat_map(|node| &node.children.0).filter(|k| **k < all.len()) {
            is_child[*k] = true;
        }
        Ok((0..all.len()).filter(|k| !is_child[*k]).collect())
    }

    fn fault(&self, message: &str) -> SpecError {
        self.raw.scene.fault(None, message, "the file is broken: export it again")
    }

    fn node(&mut self, k: usize, node: &Node, transform: &DMat4) -> Result<(), SpecError> {
        let extensions = node.extensions.as_ref();
        if extensions.is_some_and(|all| all.instancing.is_some()) {
            return Err(self.raw.scene.fault(None, format!("nodes[{k}] is many (EXT_mesh_gpu_instancing)"), UNPACK));
        }
        self.lights(k, node, transform)?;
        let Some(mesh) = node.mesh else { return Ok(()) };
        let document = self.document;
        let of = document
            .meshes
            .0
            .get(mesh)
            .ok_or_else(|| self.fault(&format!("nodes[{k}]: there is no meshes[{mesh}]")))?;
        let mut weights = node.weights.iter().chain(&of.weights).flat_map(|weights| &weights.0);
        if node.skin.is_some() || weights.any(|weight| *weight != 0.0) {
            let help = "apply skins and shape keys before exporting it";
            return Err(self.raw.scene.fault(None, format!("nodes[{k}]: its mesh is bent by a skin or a morph"), help));
        }
        for (p, primitive) in of.primitives.0.iter().enumerate() {
            self.primitive(&format!("meshes[{mesh}].primitives[{p}]"), primitive, transform)?;
        }
        Ok(())
    }

    fn primitive(&mut self, at: &str, of: &Primitive, transform: &DMat4) -> Result<(), SpecError> {
        if of.extensions.as_ref().is_some_and(|all| all.draco.is_some()) {
            return Err(self.raw.scene.fault(None, format!("{at} is compressed (KHR_draco_mesh_compression)"), UNPACK));
        }
        let count = of.attributes.position.and_then(|k| self.document.accessors.0.get(k)).map_or(0, |all| all.count);
        self.work = self.work.saturating_add(count.saturating_add(1));
        if self.work > MAX_WORK {
            let help = "import a part of it, or have its meshes simplified first";
            return Err(self.raw.scene.fault(None, format!("{at}: the scene draws more than {MAX_WORK} points"), help));
        }
        let mode = of.mode.unwrap_or(4);
        if mode < 4 {
            self.raw.leave_out("points and lines", 1, None);
            return Ok(());
        }
        let Some(positions) = of.attributes.position else { return Ok(()) };
        let points = self.buffers.points(positions)?;
        let indices = match of.indices {
            Some(indices) => self.buffers.indices(indices, points.len())?,
            None => (0..points.len() as u32).collect(),
        };
        if let Some(name) = of.attributes.others.keys().find(|name| name.starts_with("COLOR_")) {
            self.raw.note(format!("passed over: {}", Quoted(name)));
        }
        let raw = &mut self.raw;
        let material = of.material.map(|k| (k, self.materials.get(k)));
        let material = match material {
            Some((_, Some(place))) => *place,
            Some((k, None)) => return Err(self.fault(&format!("{at}: there is no materials[{k}]"))),
            None => {
                *self.nameless.get_or_insert_with(|| raw.material(NO_MATERIAL, Kind::Unknown, raw.scene.path, None))
            }
        };
        let colours = match of.attributes.colour {
            Some(accessor) if matches!(self.raw.materials[material as usize].kind, Kind::Diffuse { .. }) => {
                self.work = self.work.saturating_add(points.len());
                Some(self.buffers.colours(accessor, points.len())?)
            }
            _ => None,
        };
        let is_blended = of.material.and_then(|k| self.document.materials.0.get(k)).is_some_and(is_blended);
        if colours.is_none() {
            self.raw.surface(material, None);
        }
        let triangles = triangles(mode, &indices).ok_or_else(|| self.fault(&format!("{at}: mode {mode} is none")))?;
        // A transform that mirrors turns faces inside out.
        let is_mirrored = transform.determinant() < 0.0;
        let (raw, painted) = (&mut self.raw, &mut self.painted);
        let mut met = BTreeSet::new();
        for [a, b, c] in triangles {
            let corners: [DVec3; 3] =
                if is_mirrored { [a, c, b] } else { [a, b, c] }.map(|v| transform.transform_point3(points[v as usize]));
            let material = match &colours {
                Some(colours) => {
                    let material = painted.material(raw, material, [a, b, c].map(|v| colours[v as usize]), is_blended);
                    if met.insert(material) {
                        raw.surface(material, None);
                    }
                    material
                }
                None => material,
            };
            raw.triangle(material, None, corners)?;
        }
        Ok(())
    }
}

/// The triangles of a list (mode 4), a strip (5) or a fan (6).
fn triangles(mode: u32, indices: &[u32]) -> Option<Vec<[u32; 3]>> {
    match mode {
        4 => Some(indices.as_chunks().0.to_vec()),
        5 => {
            let strip = indices.windows(3).enumerate();
            Some(strip.map(|(k, w)| if k % 2 == 0 { [w[0], w[1], w[2]] } else { [w[1], w[0], w[2]] }).collect())
        }
        6 => Some(indices.windows(2).skip(1).map(|w| [indices[0], w[0], w[1]]).collect()),
        _ => None,
    }
}

/// Whether a material's opacity counts.
fn is_blended(of: &MaterialOf) -> bool {
    of.alpha_mode.as_deref() == Some("BLEND")
}

/// A node's transform, as a matrix or as translation, rotation and scale; `None` where it is none of three dimensions.
fn transform(node: &Node) -> Option<DMat4> {
    let Some(matrix) = node.matrix else {
        let [x, y, z, w] = node.rotation.unwrap_or([0.0, 0.0, 0.0, 1.0]);
        let rotation = DQuat::from_xyzw(x, y, z, w);
        // Exporters write six digits or so.
        let is_unit = (rotation.length() - 1.0).abs() < 1e-2;
        let rotation = rotation.is_finite().then(|| rotation.normalize()).filter(|_| is_unit)?;
        let scale = DVec3::from(node.scale.unwrap_or([1.0; 3]));
        let translation = DVec3::from(node.translation.unwrap_or([0.0; 3]));
        return Some(DMat4::from_scale_rotation_translation(scale, rotation, translation));
    };
    let matrix = DMat4::from_cols_array(&matrix);
    (matrix.row(3) == glam::DVec4::W).then_some(matrix)
}
