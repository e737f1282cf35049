//! Radiance scenes (.rad): primitives of a modifier, a type, a name and three lists of arguments; no command is run
//! but plain `genbox`.
//!
//! Format: G. Ward, *The Radiance 5 Synthetic Imaging System*, "Scene Description"; how words are read is
//! `fgetword.c`'s.

mod solids;
mod words;

use std::collections::HashMap;

use glam::DVec3;

use super::raw::{Kind, Primaries, Raw, Scene};
use luxproof_process::printable::Quoted;
use luxproof_spec::{SpecError, suggestion};

use words::{Command, Next, Words};

/// Decimals as they are written.
const PRECISION: f64 = 1e-12;

const SURFACES: [&str; 8] = ["polygon", "ring", "cylinder", "tube", "sphere", "bubble", "cone", "cup"];
/// What has a place and is no surface that is read here.
const ELSEWHERE: [(&str, &str); 2] = [
    ("mesh", "a compiled mesh: export its Wavefront file anew and import that"),
    ("instance", "an octree of its own: import the scene that it was made of"),
];
const LIGHTS: [&str; 4] = ["light", "illum", "glow", "spotlight"];
const MATERIALS: [&str; 31] = [
    "plastic",
    "metal",
    "trans",
    "plastic2",
    "metal2",
    "trans2",
    "ashik2",
    "mirror",
    "prism1",
    "prism2",
    "mist",
    "glass",
    "dielectric",
    "interface",
    "plasfunc",
    "metfunc",
    "transfunc",
    "BRTDfunc",
    "plasdata",
    "metdata",
    "transdata",
    "BSDF",
    "aBSDF",
    "WGMDfunc",
    "antimatter",
    "texfunc",
    "texdata",
    "mixfunc",
    "mixdata",
    "mixpict",
    "mixtext",
];
const PATTERNS: [&str; 11] = [
    "colorfunc",
    "brightfunc",
    "colordata",
    "brightdata",
    "colorpict",
    "colortext",
    "brighttext",
    "spectrum",
    "specfile",
    "specfunc",
    "specdata",
];

/// Reads a scene.
pub(super) fn read<'a>(scene: &'a Scene<'a>) -> Result<Raw<'a>, SpecError> {
    let bytes = scene.bytes()?;
    let text = String::from_utf8_lossy(&bytes);
    let mut reader =
        Reader { raw: Raw::new(scene, PRECISION, Primaries::Radiance), named: HashMap::new(), has_curves: false };
    let mut words = Words::new(scene, &text);
    while let Some(next) = words.next()? {
        match next {
            Next::Command(command) => reader.command(&command)?,
            Next::Primitive { modifier, line } => reader.primitive(modifier, line, &mut words)?,
        }
    }
    let Reader { mut raw, has_curves, .. } = reader;
    if has_curves {
        let around = solids::AROUND;
        raw.note(format!("curved surfaces are flat faces, {around} around, their corners on the surface"));
    }
    Ok(raw)
}

struct Reader<'a> {
    raw: Raw<'a>,
    /// The places of materials, patterns and textures by their names; of one that is defined again the latest.
    named: HashMap<String, u32>,
    /// Whether one of them may be taken.
    has_curves: bool,
}

impl Reader<'_> {
    fn primitive(&mut self, modifier: &str, line: usize, words: &mut Words<'_>) -> Result<(), SpecError> {
        let kind = words.word("a type")?;
        let name = words.word("a name")?;
        if kind == "alias" {
            let of = words.word("the name of what it is an alias of")?;
            let Some(place) = self.named.get(of) else { return Err(self.undefined(of, line)) };
            let kind = self.raw.materials[*place as usize].kind.clone();
            let kind = if modifier == "inherit" { kind } else { self.modified(modifier, kind, line)? };
            self.define(name, kind, line);
            return Ok(());
        }
        let arguments = words.arguments()?;
        if SURFACES.contains(&kind) {
            return self.surface(kind, modifier, line, &arguments);
        }
        if kind == "source" {
            self.raw.leave_out("sources at infinity (sky, sun, ground)", 1, Some(line));
            return Ok(());
        }
        if let Some((_, what)) = ELSEWHERE.iter().find(|(word, _)| *word == kind) {
            return Err(self.raw.scene.fault(
                Some(line),
                format!("`{}` is {kind}", Quoted(name)),
                format!("it is {what}"),
            ));
        }
        let made = if LIGHTS.contains(&kind) {
            Kind::Light(kind.to_owned())
        } else if kind == "plastic" {
            let plain =
                plastic(&arguments).map_err(|why| self.raw.scene.fault(Some(line), why, "correct the numbers"))?;
            self.modified(modifier, plain, line)?
        } else if MATERIALS.contains(&kind) || PATTERNS.contains(&kind) {
            Kind::Other(kind.to_owned())
        } else {
            let known = SURFACES.iter().chain(&MATERIALS).chain(&PATTERNS).chain(&LIGHTS).copied();
            let message = format!("`{}` is no type of Radiance's", Quoted(kind));
            return Err(self.raw.scene.fault(Some(line), message, suggestion(kind, known)));
        };
        self.define(name, made, line);
        Ok(())
    }

    fn define(&mut self, name: &str, kind: Kind, line: usize) {
        let path = self.raw.scene.path;
        let place = self.raw.material(name, kind, path, Some(line));
        self.named.insert(name.to_owned(), place);
    }

    /// What a material is with a modifier of its own: a pattern or texture on it is no plain colour.
    fn modified(&self, modifier: &str, kind: Kind, line: usize) -> Result<Kind, SpecError> {
        match (modifier, kind) {
            ("void", kind) => Ok(kind),
            (_, Kind::Diffuse { .. }) if self.named.contains_key(modifier) => {
                Ok(Kind::Other(format!("plastic with `{}` on it", Quoted(modifier))))
            }
            (_, kind) if self.named.contains_key(modifier) => Ok(kind),
            _ => Err(self.undefined(modifier, line)),
        }
    }

    fn undefined(&self, name: &str, line: usize) -> SpecError {
        let help = "define it before it is used: give its file before this one, as `cat materials.rad scene.rad` does";
        self.raw.scene.fault(Some(line), format!("`{}` is not defined", Quoted(name)), help)
    }

    fn surface(&mut self, kind: &str, modifier: &str, line: usize, numbers: &[f64]) -> Result<(), SpecError> {
        let at = Some(line);
        if modifier == "void" {
            self.raw.leave_out("surfaces of no material (void)", 1, at);
            return Ok(());
        }
        let Some(&material) = self.named.get(modifier) else { return Err(self.undefined(modifier, line)) };
        if kind == "polygon" {
            let corners: Vec<DVec3> = numbers.as_chunks().0.iter().map(|c: &[f64; 3]| DVec3::from(*c)).collect();
            if numbers.len() < 9 || !numbers.len().is_multiple_of(3) {
                let message = format!("a polygon of {} numbers", numbers.len());
                return Err(self.raw.scene.fault(at, message, "give three a corner, and three corners or more"));
            }
            return self.raw.polygon(material, at, &corners);
        }
        let shines = matches!(self.raw.materials[material as usize].kind, Kind::Light(_));
        self.has_curves |= !shines;
        self.raw.surface(material, at);
        let solid = solids::triangles(kind, numbers)
            .map_err(|why| self.raw.scene.fault(at, format!("{kind}: {why}"), "correct the numbers"))?;
        solid.into_iter().try_for_each(|corners| self.raw.triangle(material, at, corners))
    }

    /// The error for a command that is not run.
    fn refused(&self, command: &Command<'_>) -> SpecError {
        let head = Quoted(command.text.trim());
        let help = "run `xform -e scene.rad > flat.rad` where the scene comes from, which writes what its commands draw, and \
                    import flat.rad";
        let message = format!("`!{head}` is a command, and commands of a scene are not run");
        self.raw.scene.fault(Some(command.line), message, help)
    }

    /// Does what `genbox MAT NAME X Y Z [-i]` would; nothing else.
    fn command(&mut self, command: &Command<'_>) -> Result<(), SpecError> {
        let words: Vec<&str> = command.text.split_whitespace().collect();
        let ["genbox", material, name, x, y, z, more @ ..] = &words[..] else {
            return Err(self.refused(command));
        };
        let is_inwards = match more {
            [] => false,
            ["-i"] => true,
            _ => return Err(self.refused(command)),
        };
        let sizes: Result<Vec<f64>, _> = [x, y, z].into_iter().map(|word| word.parse()).collect();
        // A shell would change such words, and luxproof runs none.
        let has_shell_syntax = [material, name]
            .iter()
            .any(|word| word.contains(['$', '`', '|', ';', '&', '<', '>', '(', ')', '\'', '"', '\\']));
        let Some(sizes) = sizes.ok().filter(|_| !has_shell_syntax) else { return Err(self.refused(command)) };
        if !sizes.iter().all(|size| size.is_finite() && *size > 0.0) {
            let help = "give three positive lengths";
            return Err(self.raw.scene.fault(Some(command.line), "genbox: this is no box", help));
        }
        let Some(&material) = self.named.get(*material) else { return Err(self.undefined(material, command.line)) };
        let box_of = luxproof_scene::geometry::Mesh::cuboid(DVec3::ZERO, DVec3::new(sizes[0], sizes[1], sizes[2]));
        for [a, b, c] in &box_of.triangles {
            let corners = if is_inwards { [a, c, b] } else { [a, b, c] }.map(|v| box_of.vertices_m[*v as usize]);
            self.raw.triangle(material, Some(command.line), corners)?;
        }
        for _ in 0..6 {
            self.raw.surface(material, Some(command.line));
        }
        Ok(())
    }
}

/// `plastic` is red, green, blue, specularity and roughness; without specularity nothing of it is rough.
fn plastic(numbers: &[f64]) -> Result<Kind, String> {
    let [red, green, blue, specularity, _] = *numbers else {
        return Err(format!("plastic of {} numbers, not five", numbers.len()));
    };
    if specularity == 0.0 {
        return Kind::of_colour([red, green, blue]);
    }
    Ok(Kind::Other(format!("plastic of specularity {specularity}")))
}
