//! Materials of a USD layer: the diffuse colour of a `UsdPreviewSurface`.

use std::collections::HashMap;

use super::layer::{Layer, Prim};
use crate::raw::{Kind, Raw};
use luxproof_process::printable::Quoted;
use luxproof_spec::SpecError;

/// The diffuse colour of a shader that states none.
const DEFAULT_COLOUR: [f64; 3] = [0.18; 3];

/// What a shape is bound to.
#[derive(Clone, Copy, Debug)]
pub(super) struct Binding {
    /// Its place among the materials.
    pub(super) material: u32,
}

/// Materials that were met, by their paths and names.
#[derive(Debug, Default)]
pub(super) struct Materials {
    by_prim: HashMap<usize, u32>,
    by_name: HashMap<String, u32>,
}

impl Materials {
    /// The material at a path.
    pub(super) fn bind(&mut self, raw: &mut Raw<'_>, layer: &Layer, path: &str) -> Result<Binding, SpecError> {
        let Some(place) = layer.prim_at(path) else {
            let material = self.named(raw, "a material that is not there", Kind::Unknown, None);
            return Ok(Binding { material });
        };
        if let Some(material) = self.by_prim.get(&place) {
            return Ok(Binding { material: *material });
        }
        let prim = &layer.prims[place];
        let kind = kind(layer, prim).map_err(|why| {
            raw.scene.fault(Some(prim.line), format!("`{}`: {why}", Quoted(&prim.name)), "correct the colour")
        })?;
        if matches!(kind, Kind::Diffuse { .. }) {
            raw.note("gloss of USD's materials is left out: every surface is diffuse, of its diffuse colour");
        }
        let path = raw.scene.path;
        let material = raw.material(&prim.name, kind, path, Some(prim.line));
        self.by_prim.insert(place, material);
        Ok(Binding { material })
    }

    /// The material of a colour that a shape states.
    pub(super) fn of_colour(&mut self, raw: &mut Raw<'_>, colour: [f64; 3], line: usize) -> u32 {
        let [red, green, blue] = colour;
        let kind = Kind::of_colour(colour).unwrap_or_else(Kind::Other);
        self.named(raw, &format!("displayColor {red} {green} {blue}"), kind, Some(line))
    }

    /// The material of a name, made where it is new.
    pub(super) fn named(&mut self, raw: &mut Raw<'_>, name: &str, kind: Kind, line: Option<usize>) -> u32 {
        if let Some(material) = self.by_name.get(name) {
            return *material;
        }
        let path = raw.scene.path;
        let material = raw.material(name, kind, path, line);
        self.by_name.insert(name.to_owned(), material);
        material
    }
}

/// What a material is by its surface shader.
fn kind(layer: &Layer, material: &Prim) -> Result<Kind, String> {
    let connected = material.text("outputs:surface.connect");
    let Some(shader) = connected.and_then(|path| layer.prim_at(path)).map(|k| &layer.prims[k]) else {
        return Ok(Kind::Other("of no surface shader that is in the layer".to_owned()));
    };
    match shader.text("info:id") {
        Some("UsdPreviewSurface") => {}
        Some(id) => {
            return Ok(Kind::Other(format!("of another shader ({})", Quoted(id))));
        }
        None => return Ok(Kind::Other("of a shader without a name (info:id)".to_owned())),
    }
    let emission = shader.numbers("inputs:emissiveColor").unwrap_or_default();
    if emission.iter().any(|part| *part > 0.0) || shader.has("inputs:emissiveColor.connect") {
        return Ok(Kind::Light("emissiveColor".to_owned()));
    }
    if let Some(opacity) = shader.number("inputs:opacity").filter(|opacity| *opacity < 1.0) {
        return Ok(Kind::Other(format!("transparent (opacity {opacity})")));
    }
    if shader.has("inputs:opacity.connect") {
        return Ok(Kind::Other("cut out by a texture (opacity)".to_owned()));
    }
    if shader.has("inputs:diffuseColor.connect") {
        return Ok(Kind::Other("textured (diffuseColor)".to_owned()));
    }
    let metallic = shader.number("inputs:metallic").unwrap_or(0.0);
    if metallic > 0.0 && !shader.is_true("inputs:useSpecularWorkflow") {
        return Ok(Kind::Other(format!("metal (metallic {metallic})")));
    }
    match shader.numbers("inputs:diffuseColor") {
        Some([red, green, blue]) => Kind::of_colour([*red, *green, *blue]),
        Some(_) => Err("its diffuseColor has not three parts".to_owned()),
        None => Kind::of_colour(DEFAULT_COLOUR),
    }
}
