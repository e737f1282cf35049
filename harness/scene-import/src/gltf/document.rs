//! What of a glTF 2.0 document is read: scenes, nodes, meshes, materials, accessors and buffers.
//!
//! Format: Khronos Group, *glTF 2.0 Specification* (ISO/IEC 12113:2022).

use std::collections::BTreeMap;
use std::fmt;
use std::marker::PhantomData;

use serde::de::{IgnoredAny, SeqAccess, Visitor};
use serde::{Deserialize, Deserializer};

/// More of a kind are none of a room's; each takes some hundred bytes, of which its text may have two.
const MAX_ITEMS: usize = 200_000;

/// A list of so many at most.
#[derive(Debug)]
pub(super) struct List<T>(pub(super) Vec<T>);

impl<T> Default for List<T> {
    fn default() -> Self {
        Self(vec![])
    }
}

impl<'de, T: Deserialize<'de>> Deserialize<'de> for List<T> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Items<T>(PhantomData<T>);
        impl<'de, T: Deserialize<'de>> Visitor<'de> for Items<T> {
            type Value = List<T>;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a list")
            }

            fn visit_seq<A: SeqAccess<'de>>(self, mut seq: A) -> Result<List<T>, A::Error> {
                let mut items = vec![];
                while let Some(item) = seq.next_element()? {
                    if items.len() >= MAX_ITEMS {
                        return Err(serde::de::Error::custom(format!("a list of more than {MAX_ITEMS}")));
                    }
                    items.push(item);
                }
                Ok(List(items))
            }
        }
        deserializer.deserialize_seq(Items(PhantomData))
    }
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Document {
    pub(super) asset: Asset,
    #[serde(default)]
    pub(super) extensions_used: List<String>,
    #[serde(default)]
    pub(super) extensions_required: List<String>,
    pub(super) scene: Option<usize>,
    #[serde(default)]
    pub(super) scenes: List<SceneOf>,
    #[serde(default)]
    pub(super) nodes: List<Node>,
    #[serde(default)]
    pub(super) meshes: List<MeshOf>,
    #[serde(default)]
    pub(super) materials: List<MaterialOf>,
    #[serde(default)]
    pub(super) accessors: List<Accessor>,
    #[serde(default)]
    pub(super) buffer_views: List<BufferView>,
    #[serde(default)]
    pub(super) buffers: List<Buffer>,
    #[serde(default)]
    pub(super) animations: List<IgnoredAny>,
    pub(super) extensions: Option<DocumentExtensions>,
}

#[derive(Debug, Deserialize)]
pub(super) struct Asset {
    pub(super) version: String,
}

#[derive(Debug, Deserialize)]
pub(super) struct SceneOf {
    #[serde(default)]
    pub(super) nodes: List<usize>,
}

#[derive(Debug, Deserialize)]
pub(super) struct Node {
    pub(super) name: Option<String>,
    #[serde(default)]
    pub(super) children: List<usize>,
    pub(super) mesh: Option<usize>,
    pub(super) skin: Option<usize>,
    /// Column by column.
    pub(super) matrix: Option<[f64; 16]>,
    pub(super) translation: Option<[f64; 3]>,
    /// A unit quaternion x, y, z, w.
    pub(super) rotation: Option<[f64; 4]>,
    pub(super) scale: Option<[f64; 3]>,
    pub(super) weights: Option<List<f64>>,
    pub(super) extensions: Option<NodeExtensions>,
}

#[derive(Debug, Deserialize)]
pub(super) struct NodeExtensions {
    #[serde(rename = "EXT_mesh_gpu_instancing")]
    pub(super) instancing: Option<IgnoredAny>,
    #[serde(rename = "KHR_lights_punctual")]
    pub(super) light: Option<LightOf>,
    #[serde(rename = "EXT_lights_ies")]
    pub(super) profile: Option<LightOf>,
}

/// A light at a node.
#[derive(Debug, Deserialize)]
pub(super) struct LightOf {
    pub(super) light: usize,
    /// Of `EXT_lights_ies`.
    pub(super) multiplier: Option<f64>,
    pub(super) color: Option<[f64; 3]>,
}

#[derive(Debug, Deserialize)]
pub(super) struct DocumentExtensions {
    #[serde(rename = "KHR_lights_punctual")]
    pub(super) punctual: Option<Lights<PunctualLight>>,
    #[serde(rename = "EXT_lights_ies")]
    pub(super) profiles: Option<Lights<LightProfile>>,
}

#[derive(Debug, Deserialize)]
#[serde(bound = "T: Deserialize<'de>")]
pub(super) struct Lights<T> {
    #[serde(default)]
    pub(super) lights: List<T>,
}

#[derive(Debug, Deserialize)]
pub(super) struct PunctualLight {
    #[serde(rename = "type")]
    pub(super) kind: String,
    /// In candela.
    pub(super) intensity: Option<f64>,
    pub(super) color: Option<[f64; 3]>,
    /// Of spots.
    pub(super) spot: Option<Spot>,
}

/// The cone of a spot: angles from its axis, in radians.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Spot {
    pub(super) inner_cone_angle: Option<f64>,
    pub(super) outer_cone_angle: Option<f64>,
}

#[derive(Debug, Deserialize)]
pub(super) struct LightProfile {
    pub(super) uri: Option<String>,
}

#[derive(Debug, Deserialize)]
pub(super) struct MeshOf {
    #[serde(default)]
    pub(super) primitives: List<Primitive>,
    pub(super) weights: Option<List<f64>>,
}

#[derive(Debug, Deserialize)]
pub(super) struct Primitive {
    #[serde(default)]
    pub(super) attributes: Attributes,
    pub(super) indices: Option<usize>,
    pub(super) material: Option<usize>,
    pub(super) mode: Option<u32>,
    pub(super) extensions: Option<PrimitiveExtensions>,
}

/// Accessors by the names of what they are.
#[derive(Debug, Default, Deserialize)]
pub(super) struct Attributes {
    #[serde(rename = "POSITION")]
    pub(super) position: Option<usize>,
    /// What multiplies the material's base colour at each point.
    #[serde(rename = "COLOR_0")]
    pub(super) colour: Option<usize>,
    #[serde(flatten)]
    #[allow(clippy::zero_sized_map_values, reason = "serde's flatten needs a map")]
    pub(super) others: BTreeMap<String, IgnoredAny>,
}

#[derive(Debug, Deserialize)]
pub(super) struct PrimitiveExtensions {
    #[serde(rename = "KHR_draco_mesh_compression")]
    pub(super) draco: Option<IgnoredAny>,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct MaterialOf {
    pub(super) name: Option<String>,
    pub(super) pbr_metallic_roughness: Option<Pbr>,
    pub(super) emissive_factor: Option<[f64; 3]>,
    pub(super) emissive_texture: Option<IgnoredAny>,
    pub(super) normal_texture: Option<IgnoredAny>,
    pub(super) alpha_mode: Option<String>,
    pub(super) extensions: Option<MaterialExtensions>,
}

#[derive(Debug, Deserialize)]
pub(super) struct MaterialExtensions {
    #[serde(rename = "KHR_materials_transmission")]
    pub(super) transmission: Option<Transmission>,
    #[serde(rename = "KHR_materials_pbrSpecularGlossiness")]
    pub(super) specular_glossiness: Option<IgnoredAny>,
    #[serde(rename = "KHR_materials_unlit")]
    pub(super) unlit: Option<IgnoredAny>,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Transmission {
    pub(super) transmission_factor: Option<f64>,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Pbr {
    pub(super) base_color_factor: Option<[f64; 4]>,
    pub(super) base_color_texture: Option<IgnoredAny>,
    pub(super) metallic_factor: Option<f64>,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Accessor {
    pub(super) buffer_view: Option<usize>,
    #[serde(default)]
    pub(super) byte_offset: usize,
    pub(super) component_type: u32,
    #[serde(default)]
    pub(super) normalized: bool,
    pub(super) count: usize,
    #[serde(rename = "type")]
    pub(super) shape: String,
    pub(super) sparse: Option<IgnoredAny>,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct BufferView {
    pub(super) buffer: usize,
    #[serde(default)]
    pub(super) byte_offset: usize,
    pub(super) byte_length: usize,
    pub(super) byte_stride: Option<usize>,
    pub(super) extensions: Option<ViewExtensions>,
}

#[derive(Debug, Deserialize)]
pub(super) struct ViewExtensions {
    #[serde(rename = "EXT_meshopt_compression")]
    pub(super) meshopt: Option<IgnoredAny>,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Buffer {
    pub(super) uri: Option<String>,
    pub(super) byte_length: usize,
}
