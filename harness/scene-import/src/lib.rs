//! Scenes of other programs -> the geometry of a spec: a room and a mesh a reflectance.
//!
//! Surfaces are opaque and diffuse in a spec; what is not is refused, or left out with a note. Luminaires are the spec's
//! own.

mod closed;
mod gltf;
mod half_edges;
mod hull;
mod luminaires;
mod obj;
mod place;
mod radiance;
mod raw;
mod room_detection;
mod shell;
mod summaries;
mod triangle_soup;
mod usd;

use std::collections::BTreeMap;
use std::path::Path;

use glam::DVec3;
use itertools::Itertools;

pub use luminaires::{ImportedLuminaire, LuminaireSummary};
pub use place::{MeterGrid, Place};
pub use room_detection::{Group, Part, RoomMesh, Walls};
pub use summaries::{GroupSummary, ImportSummary, LeftOut, MeshSummary, RoomKind, RoomSummary, UsedMaterial};

use luxproof_process::printable::Quoted;
use luxproof_spec::{Faults, SpecError, Trust, suggestion};
use raw::{Kind, Raw, Scene};
use room_detection::{Around, around};
use triangle_soup::{Corners, Soup};

/// The farthest that a corner may be off the scene's origin, in metres.
const FAR_M: f64 = 1e6;

/// Which axis of a scene is up.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Up {
    /// y
    Y,
    /// z
    Z,
}

/// What a user says of a scene.
#[derive(Clone, Debug)]
pub struct Options {
    /// Which axis is up; as usual in its format where that is not said.
    pub up: Option<Up>,
    /// Metres a unit; by default what the scene states, else 1.
    pub unit_m: Option<f64>,
    /// Reflectances of materials by name, whatever the scene says of them.
    pub reflectances: BTreeMap<String, f64>,
    /// Whether surfaces that are not opaque, diffuse and plain are left out; else they are refused.
    pub leaves_out: bool,
    pub trust: Trust,
}

impl Default for Options {
    fn default() -> Self {
        Self { up: None, unit_m: None, reflectances: BTreeMap::new(), leaves_out: false, trust: Trust::Own }
    }
}

/// A scene's geometry as a spec has it.
#[derive(Debug)]
pub struct Imported {
    pub walls: Walls,
    /// Where the scene's origin is in the room.
    pub origin_m: DVec3,
    /// Those that the room is not, in the scene's place; files by name.
    pub meshes: Vec<Part>,
    /// The lights of the scene that a spec can have.
    pub luminaires: Vec<ImportedLuminaire>,
    /// Where a luminaire and meters may be.
    pub place: Place,
    pub summary: ImportSummary,
}

/// Formats by the ends of file names.
#[derive(Clone, Copy)]
enum Format {
    Radiance,
    Obj,
    Gltf,
    Usd,
}

impl Format {
    fn of(path: &Path) -> Option<Self> {
        let end = path.extension()?.to_string_lossy().to_lowercase();
        match end.as_str() {
            "rad" => Some(Self::Radiance),
            "obj" => Some(Self::Obj),
            "gltf" | "glb" => Some(Self::Gltf),
            "usda" | "usd" | "usdc" | "usdz" => Some(Self::Usd),
            _ => None,
        }
    }

    fn name(self) -> &'static str {
        match self {
            Self::Radiance => "radiance",
            Self::Obj => "obj",
            Self::Gltf => "gltf",
            Self::Usd => "usd",
        }
    }

    /// glTF says that y is up; in OBJ files, as specs name them, and in Radiance's, z is.
    fn up(self) -> Up {
        if matches!(self, Self::Gltf) { Up::Y } else { Up::Z }
    }
}

/// Reads a scene and makes a spec's geometry of it.
pub fn import(path: &Path, options: &Options) -> Result<Imported, Faults> {
    let scene = Scene { path, trust: options.trust };
    let format = Format::of(path).ok_or_else(|| {
        let help = "give a Radiance source (.rad), a Wavefront file (.obj), glTF 2.0 (.gltf, .glb) or USD (.usda)";
        scene.fault(None, "this is no scene by its name", help)
    })?;
    let mut raw = match format {
        Format::Radiance => radiance::read(&scene)?,
        Format::Obj => obj::read(&scene)?,
        Format::Gltf => gltf::read(&scene)?,
        Format::Usd => usd::read(&scene, options.unit_m)?,
    };
    let chosen = chosen(&raw, options)?;
    let up = options.up.or(raw.up).unwrap_or(format.up());
    let unit_m = options.unit_m.or(raw.unit_m).unwrap_or(1.0);
    let triangles = placed(&raw, &chosen, up, unit_m)?;
    let soup = Soup::of(&triangles, raw.precision);
    if soup.facets.is_empty() {
        let help = "look at what was left out; --reflectance NAME=0.5 takes a material in";
        return Err(scene.fault(None, "no surface of it was taken", help).into());
    }
    note_suspicious(&mut raw, &soup);
    let (low, high) = soup.extent();
    let around = around(&soup, |material| &raw.materials[material as usize].name, low, high);
    around.notes.iter().for_each(|note| raw.note(note));
    let lights = std::mem::take(&mut raw.lights);
    let luminaires = luminaires::luminaires(lights, up, unit_m, around.origin_m);
    let summary = ImportSummary {
        scene: path.display().to_string(),
        format: format.name(),
        up: if up == Up::Y { "y" } else { "z" },
        unit_m,
        triangles: soup.facets.len(),
        materials: taken(&raw, &chosen, &soup, options),
        min_m: low.to_array(),
        max_m: high.to_array(),
        room: around.summary,
        meshes: around.meshes.iter().map(Part::summarize).collect(),
        luminaires: luminaires.iter().map(ImportedLuminaire::summarize).collect(),
        lights_left_out: raw.lights_left_out + shining(&raw),
        left_out: left_out(&raw, &chosen),
        notes: raw.notes,
    };
    let Around { walls, origin_m, meshes, place, .. } = around;
    Ok(Imported { walls, origin_m, meshes, luminaires, place, summary })
}

/// The reflectance of each material that is taken; all that is wrong with the others at once.
fn chosen(raw: &Raw<'_>, options: &Options) -> Result<Vec<Option<f64>>, Faults> {
    let names = raw.materials.iter().filter(|m| m.surfaces > 0).map(|m| m.name.as_str());
    let mut faults: Vec<SpecError> = vec![];
    for name in options.reflectances.keys().filter(|name| !names.clone().any(|known| known == *name)) {
        let message = format!("--reflectance {name}: no surface is of that material");
        faults.push(SpecError::of(raw.scene.path, message, suggestion(name, names.clone())));
    }
    let reflectances = raw.materials.iter().map(|material| reflectance(raw, material, options));
    let (all, wrong): (Vec<_>, Vec<_>) = reflectances.partition_result();
    faults.extend(wrong);
    Faults::of(faults).map_or(Ok(all), Err)
}

/// The reflectance of a material; `None` where its surfaces are left out.
fn reflectance(raw: &Raw<'_>, material: &raw::Material, options: &Options) -> Result<Option<f64>, SpecError> {
    if material.surfaces == 0 {
        return Ok(None);
    }
    let given = options.reflectances.get(&material.name).copied();
    let (what, help) = match (&material.kind, given) {
        (_, Some(rho)) => return Ok(Some(rho)),
        (Kind::Diffuse { rgb }, None) => return Ok(Some(raw.primaries.luminous(*rgb))),
        (Kind::Light(_), None) => return Ok(None),
        (Kind::Other(_) | Kind::Unknown, None) if options.leaves_out => return Ok(None),
        (Kind::Other(what), None) => {
            (what.as_str(), "have it diffuse by --reflectance NAME=0.5, or leave all such surfaces out by --leave-out")
        }
        (Kind::Unknown, None) => (
            "of a reflectance that nothing says",
            "give it by --reflectance NAME=0.5, or leave such surfaces out by --leave-out",
        ),
    };
    let name = Quoted(&material.name);
    let message = format!("`{name}` is {what}, and {} surfaces are of it{}", material.surfaces, first(raw, material));
    let fault = SpecError { line: material.line, ..SpecError::of(&material.file, message, help) };
    // A library is a file that the scene names: no line of it is shown. The name is the scene's own word.
    let is_withheld = options.trust != Trust::Own && material.file != raw.scene.path;
    Err(SpecError { is_withheld, ..fault })
}

/// Where the first surface of a material stands.
fn first(raw: &Raw<'_>, material: &raw::Material) -> String {
    material.first.map(|line| format!(", the first at {}:{line}", raw.scene.path.display())).unwrap_or_default()
}

/// The triangles of the materials that are taken, in metres, z up.
fn placed(raw: &Raw<'_>, chosen: &[Option<f64>], up: Up, unit_m: f64) -> Result<Vec<Corners>, SpecError> {
    let taken = raw.triangles.iter().filter_map(|t| {
        let rho = chosen[t.material as usize]?;
        let corners = t.corners.map(|p| unit_m * if up == Up::Y { DVec3::new(p.x, -p.z, p.y) } else { p });
        Some((corners, t.material, rho))
    });
    let taken: Vec<Corners> = taken.collect();
    let mut corners = taken.iter().flat_map(|(corners, ..)| corners);
    match corners.find(|p| !p.is_finite() || p.abs().max_element() > FAR_M) {
        Some(far) => {
            let [x, y, z] = far.to_array();
            let message = format!("a corner is at [{x:e}, {y:e}, {z:e}] m, and none lies beyond {FAR_M:e} m");
            Err(raw.scene.fault(None, message, "move the scene to its origin, or give its unit by --unit 0.001"))
        }
        None => Ok(taken),
    }
}

/// Notes suspicious triangles.
fn note_suspicious(raw: &mut Raw<'_>, soup: &Soup) {
    if soup.flat > 0 {
        raw.note(format!("{} triangles of no area are left out", soup.flat));
    }
    if soup.twice > 0 {
        raw.note(format!("{} triangles that were there twice are taken once", soup.twice));
    }
    if soup.contrary > 0 {
        raw.note(format!(
            "{} triangles lie on others of another reflectance: renderers differ in which of both they see",
            soup.contrary
        ));
    }
}

fn taken(raw: &Raw<'_>, chosen: &[Option<f64>], soup: &Soup, options: &Options) -> Vec<UsedMaterial> {
    let mut sums = vec![(0, 0.0); raw.materials.len()];
    for facet in &soup.facets {
        let (triangles, area) = &mut sums[facet.material as usize];
        *triangles += 1;
        *area += soup.area(facet);
    }
    let materials = raw.materials.iter().zip(chosen).zip(&sums);
    let rows = materials.filter_map(|((m, rho), (triangles, area))| {
        let is_given = options.reflectances.contains_key(&m.name);
        Some(UsedMaterial {
            name: m.name.clone(),
            triangles: *triangles,
            area_m2: *area,
            reflectance: (*rho)?,
            rgb: if let Kind::Diffuse { rgb } = m.kind { Some(rgb).filter(|_| !is_given) } else { None },
            is_given,
        })
    });
    rows.collect()
}

/// How many materials shine.
fn shining(raw: &Raw<'_>) -> usize {
    raw.materials.iter().filter(|m| m.surfaces > 0 && matches!(m.kind, Kind::Light(_))).count()
}

fn left_out(raw: &Raw<'_>, chosen: &[Option<f64>]) -> Vec<LeftOut> {
    let materials = raw.materials.iter().zip(chosen).filter(|(m, rho)| rho.is_none() && m.surfaces > 0);
    let of_material = materials.map(|(m, _)| {
        let what = match &m.kind {
            Kind::Light(what) => {
                format!("surfaces of `{}`, which shines ({what}): luminaires are the spec's own", Quoted(&m.name))
            }
            Kind::Other(what) => format!("surfaces of `{}`, {what}", Quoted(&m.name)),
            Kind::Unknown | Kind::Diffuse { .. } => {
                format!("surfaces of `{}`, of no known reflectance", Quoted(&m.name))
            }
        };
        let line = m.line.map(|line| format!("{}:{line}", m.file.display()));
        let first = m.first.map(|line| format!("{}:{line}", raw.scene.path.display()));
        LeftOut { what, count: m.surfaces, place: line.or(first) }
    });
    let others = raw.others.iter().map(|(what, (count, line))| LeftOut {
        what: (*what).to_owned(),
        count: *count,
        place: line.map(|line| format!("{}:{line}", raw.scene.path.display())),
    });
    of_material.chain(others).collect()
}

#[cfg(test)]
mod closed_tests;
#[cfg(test)]
mod round_trip_tests;
#[cfg(test)]
mod tests;
#[cfg(test)]
mod usd_tests;
