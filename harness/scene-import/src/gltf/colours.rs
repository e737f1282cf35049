//! Colours of points (`COLOR_0`), by which a material's base colour is multiplied: glTF 2.0, 3.9.2.

use std::collections::BTreeMap;

use crate::raw::{Kind, Raw};

/// Colours that are no farther apart are one: 8 bits have steps of .004.
const SAME: f64 = 1e-6;
/// More colours of a file than these are a picture, and none of its surfaces' reflectances.
const MAX_COLOURS: usize = 500;

/// What a triangle of a material is by the colours of its corners.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Paint {
    /// One colour, in millionths.
    Plain([i64; 3]),
    /// Colours that differ from corner to corner, or too many of them.
    Varying,
    /// Light goes through it.
    Transparent,
}

/// Materials that are made of a material and a colour.
#[derive(Debug, Default)]
pub(super) struct Painted(BTreeMap<(u32, Paint), u32>);

impl Painted {
    /// The material of a triangle whose diffuse material has such colours at its corners.
    pub(super) fn material(
        &mut self,
        raw: &mut Raw<'_>,
        material: u32,
        corners: [[f64; 4]; 3],
        is_blended: bool,
    ) -> u32 {
        let mut paint = paint(corners, is_blended);
        if paint == Paint::Plain([1_000_000; 3]) {
            return material;
        }
        if matches!(paint, Paint::Plain(_)) && self.0.len() >= MAX_COLOURS && !self.0.contains_key(&(material, paint)) {
            paint = Paint::Varying;
        }
        *self.0.entry((material, paint)).or_insert_with(|| make(raw, material, paint))
    }
}

fn paint([a, b, c]: [[f64; 4]; 3], is_blended: bool) -> Paint {
    if is_blended && [a, b, c].iter().any(|colour| colour[3] < 1.0 - SAME) {
        return Paint::Transparent;
    }
    let varies = [b, c].iter().any(|other| (0..3).any(|k| (a[k] - other[k]).abs() > SAME));
    let is_colour = a[..3].iter().all(|part| (-SAME..=1.0 + SAME).contains(part));
    if varies || !is_colour {
        return Paint::Varying;
    }
    Paint::Plain([0, 1, 2].map(|k| (a[k].clamp(0.0, 1.0) * 1e6).round() as i64))
}

/// Adds the material that a material becomes by a colour.
fn make(raw: &mut Raw<'_>, material: u32, paint: Paint) -> u32 {
    let of = raw.materials[material as usize].clone();
    let (name, kind) = match (paint, &of.kind) {
        (Paint::Plain(colour), Kind::Diffuse { rgb }) => {
            let colour = colour.map(|part| part as f64 / 1e6);
            let [red, green, blue] = colour;
            let name = format!("{} (COLOR_0 {red} {green} {blue})", of.name);
            (name, Kind::Diffuse { rgb: [0, 1, 2].map(|k| rgb[k] * colour[k]) })
        }
        (Paint::Transparent, _) => {
            (format!("{} (COLOR_0)", of.name), Kind::Other("transparent (alpha of COLOR_0)".to_owned()))
        }
        (Paint::Plain(_) | Paint::Varying, _) => {
            let what = "of colours that vary over its triangles (COLOR_0)".to_owned();
            (format!("{} (COLOR_0)", of.name), Kind::Other(what))
        }
    };
    raw.material(&name, kind, &of.file, of.line)
}
