//! A scene as its reader found it: triangles by material, in the file's unit and axes, and what is none of that.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use glam::DVec3;
use luxproof_scene::geometry::polygon::Triangulator;

use crate::Up;
use crate::luminaires::RawLight;
use luxproof_process::printable;
use luxproof_spec::{SpecError, Trust};

/// A scene of more triangles is imported in parts.
pub(super) const MAX_TRIANGLES: usize = 2_000_000;

/// More notes say nothing new.
const MAX_NOTES: usize = 200;

/// The name of what has no material.
pub(super) const NO_MATERIAL: &str = "default";

/// The primaries of a format's colours.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Primaries {
    /// Radiance's own, with white of equal energy.
    Radiance,
    /// ITU-R BT.709 with D65: glTF 2.0 (3.9.2), `OpenUSD` (`UsdLux`, its blackbody colours), and programs that write OBJ.
    Rec709,
}

impl Primaries {
    /// Weights by which linear red, green and blue make a luminous value.
    const fn weights(self) -> [f64; 3] {
        match self {
            Self::Radiance => [0.265, 0.670, 0.065],
            Self::Rec709 => [0.2126, 0.7152, 0.0722],
        }
    }

    /// The share of white light that a colour reflects or emits, to six decimals.
    pub(super) fn luminous(self, rgb: [f64; 3]) -> f64 {
        let sum: f64 = if rgb[0] == rgb[1] && rgb[1] == rgb[2] {
            rgb[0]
        } else {
            rgb.iter().zip(self.weights()).map(|(part, weight)| part * weight).sum()
        };
        (sum * 1e6).round() / 1e6
    }
}

/// What a surface is made of.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Kind {
    /// Opaque, diffuse and plain, of such a colour.
    Diffuse { rgb: [f64; 3] },
    /// It shines.
    Light(String),
    /// Anything else, in words.
    Other(String),
    /// The scene does not say.
    Unknown,
}

impl Kind {
    /// A colour, each part from 0 to 1.
    pub(super) fn of_colour(rgb: [f64; 3]) -> Result<Self, String> {
        match rgb.iter().find(|part| !(0.0..=1.0).contains(*part)) {
            Some(part) => Err(format!("a reflectance lies between 0 and 1, not at {part}")),
            None => Ok(Self::Diffuse { rgb }),
        }
    }
}

/// A material of the scene.
#[derive(Clone, Debug)]
pub(super) struct Material {
    pub(super) name: String,
    pub(super) kind: Kind,
    /// The file that says so, and the line.
    pub(super) file: PathBuf,
    pub(super) line: Option<usize>,
    /// Polygons, or whatever the file draws.
    pub(super) surfaces: usize,
    /// The line of the first of them in the scene.
    pub(super) first: Option<usize>,
}

/// A triangle of a material.
#[derive(Clone, Copy, Debug)]
pub(super) struct Triangle {
    pub(super) corners: [DVec3; 3],
    pub(super) material: u32,
}

/// What of a scene is no surface of a material: how many, and the line of the first.
pub(super) type Others = BTreeMap<&'static str, (usize, Option<usize>)>;

/// A scene.
#[derive(Debug)]
pub(super) struct Raw<'a> {
    pub(super) scene: &'a Scene<'a>,
    pub(super) materials: Vec<Material>,
    pub(super) triangles: Vec<Triangle>,
    pub(super) lights: Vec<RawLight>,
    /// Lights that no luminaire can be.
    pub(super) lights_left_out: usize,
    /// Bytes of the profiles of all lights.
    pub(super) profile_bytes: usize,
    pub(super) others: Others,
    /// Further notes, each once.
    pub(super) notes: Vec<String>,
    /// Metres a unit, and which axis is up, where the scene says so.
    pub(super) unit_m: Option<f64>,
    pub(super) up: Option<Up>,
    /// What its coordinates are known to, relative to its extent.
    pub(super) precision: f64,
    pub(super) primaries: Primaries,
    triangulator: Triangulator,
}

/// The file that is imported, and whose it is.
#[derive(Clone, Copy, Debug)]
pub(super) struct Scene<'a> {
    pub(super) path: &'a Path,
    pub(super) trust: Trust,
}

impl Scene<'_> {
    /// An error at a line of the scene.
    pub(super) fn fault(&self, line: Option<usize>, message: impl Into<String>, help: impl Into<String>) -> SpecError {
        SpecError { line, ..SpecError::of(self.path, message, help) }
    }

    pub(super) fn bytes(&self) -> Result<Vec<u8>, SpecError> {
        let read = self.trust.check_given(self.path).and_then(|()| self.trust.read_named(self.folder(), self.path));
        read.map_err(|e| self.fault(None, format!("cannot be read: {e}"), "check the path"))
    }

    pub(super) fn path_of(&self, name: &str) -> PathBuf {
        self.folder().join(name)
    }

    /// The bytes of a file that the scene names.
    pub(super) fn read(&self, path: &Path) -> std::io::Result<Vec<u8>> {
        self.trust.read_named(self.folder(), path)
    }

    fn folder(&self) -> &Path {
        self.path.parent().unwrap_or(Path::new(""))
    }
}

impl<'a> Raw<'a> {
    pub(super) fn new(scene: &'a Scene<'a>, precision: f64, primaries: Primaries) -> Self {
        Self {
            scene,
            materials: vec![],
            triangles: vec![],
            lights: vec![],
            lights_left_out: 0,
            profile_bytes: 0,
            others: Others::new(),
            notes: vec![],
            unit_m: None,
            up: None,
            precision,
            primaries,
            triangulator: Triangulator::default(),
        }
    }

    /// Adds a material and gives its place.
    pub(super) fn material(&mut self, name: &str, kind: Kind, file: &Path, line: Option<usize>) -> u32 {
        let (name, file) = (printable::line(name, usize::MAX), file.to_owned());
        self.materials.push(Material { name, kind, file, line, surfaces: 0, first: None });
        (self.materials.len() - 1) as u32
    }

    pub(super) fn note(&mut self, note: impl Into<String>) {
        let note = note.into();
        if self.notes.len() < MAX_NOTES && !self.notes.contains(&note) {
            self.notes.push(note);
        }
    }

    pub(super) fn leave_out(&mut self, what: &'static str, count: usize, line: Option<usize>) {
        self.others.entry(what).or_insert((0, line)).0 += count;
    }

    /// Leaves out a light.
    pub(super) fn leave_out_light(&mut self, what: &'static str, line: Option<usize>) {
        self.leave_out(what, 1, line);
        self.lights_left_out += 1;
    }

    /// Adds a light. Each becomes a luminaire with its own file, however often a scene names one profile.
    pub(super) fn light(&mut self, light: RawLight, line: Option<usize>) -> Result<(), SpecError> {
        self.profile_bytes = self.profile_bytes.saturating_add(light.profile.bytes());
        self.lights.push(light);
        let (luminaires, bytes) = (self.scene.trust.max_luminaires(), self.scene.trust.max_named_bytes());
        let message = if self.lights.len() > luminaires {
            format!("more than {luminaires} lights")
        } else if self.profile_bytes > bytes {
            format!("the profiles of all lights hold more than {bytes} bytes")
        } else {
            return Ok(());
        };
        Err(self.scene.fault(line, message, "leave lights out, or import it without --untrusted if it is yours"))
    }

    /// Counts a surface of a material.
    pub(super) fn surface(&mut self, material: u32, line: Option<usize>) {
        if let Some(of) = self.materials.get_mut(material as usize) {
            of.surfaces += 1;
            of.first = of.first.or(line);
        }
    }

    pub(super) fn triangle(
        &mut self,
        material: u32,
        line: Option<usize>,
        corners: [DVec3; 3],
    ) -> Result<(), SpecError> {
        let most = MAX_TRIANGLES.min(self.scene.trust.max_triangles());
        if self.triangles.len() >= most {
            let message = format!("the scene has more than {most} triangles");
            return Err(self.scene.fault(line, message, "import a part of it, or have its meshes simplified first"));
        }
        self.triangles.push(Triangle { corners, material });
        Ok(())
    }

    /// Adds a surface that is a polygon.
    pub(super) fn polygon(&mut self, material: u32, line: Option<usize>, corners: &[DVec3]) -> Result<(), SpecError> {
        self.surface(material, line);
        let cut = self.triangulator.triangles(corners).map_err(|why| {
            self.scene.fault(line, format!("this polygon is none: {why}"), "have it cut into triangles first")
        })?;
        cut.into_iter().try_for_each(|t| self.triangle(material, line, t.map(|k| corners[k])))
    }
}
