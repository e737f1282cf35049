//! What an import took and what it left out, for people and for programs.

use std::fmt;

use glam::DVec3;
use luxproof_process::printable::Quoted;
use serde::Serialize;

use crate::luminaires::LuminaireSummary;

/// The summary of an import.
#[derive(Debug, Serialize)]
pub struct ImportSummary {
    pub scene: String,
    /// `radiance`, `obj`, `gltf` or `usd`.
    pub format: &'static str,
    /// Which of the scene's axes is up.
    pub up: &'static str,
    /// Metres a unit of the scene.
    pub unit_m: f64,
    pub triangles: usize,
    pub materials: Vec<UsedMaterial>,
    /// Around what was taken, in metres, in the scene's own place.
    pub min_m: [f64; 3],
    pub max_m: [f64; 3],
    pub room: RoomSummary,
    pub meshes: Vec<MeshSummary>,
    pub luminaires: Vec<LuminaireSummary>,
    /// Lights, and materials that shine, of which no luminaire was made.
    pub lights_left_out: usize,
    pub left_out: Vec<LeftOut>,
    pub notes: Vec<String>,
}

/// A material that was taken.
#[derive(Debug, Serialize)]
pub struct UsedMaterial {
    pub name: String,
    pub triangles: usize,
    /// Of one side.
    pub area_m2: f64,
    pub reflectance: f64,
    /// Red, green and blue, where the reflectance is made of them.
    pub rgb: Option<[f64; 3]>,
    /// Whether the command line gave it.
    pub is_given: bool,
}

/// What the room is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum RoomKind {
    /// The scene's own surfaces, an axis-aligned box.
    Box,
    /// The scene's own surfaces, which close.
    Mesh,
    /// A black box around the scene.
    Black,
}

/// The room.
#[derive(Debug, Serialize)]
pub struct RoomSummary {
    pub kind: RoomKind,
    /// Of the box around it.
    pub size_m: [f64; 3],
    /// Of its mesh, and the groups in that.
    pub file: Option<&'static str>,
    pub groups: Vec<GroupSummary>,
    /// Why it is not the scene's own box.
    pub why: Option<String>,
    /// Why no other surfaces of the scene are it.
    pub why_not_closed: Option<String>,
    /// How far it stands off the scene's surfaces, in metres.
    pub margin_m: f64,
}

impl RoomSummary {
    pub(super) fn of(kind: RoomKind, size_m: DVec3) -> Self {
        let (size_m, groups) = (size_m.to_array(), vec![]);
        Self { kind, size_m, file: None, groups, why: None, why_not_closed: None, margin_m: 0.0 }
    }
}

/// The triangles of a room of one material.
#[derive(Debug, Serialize)]
pub struct GroupSummary {
    pub name: String,
    pub reflectance: f64,
    pub triangles: usize,
}

/// A file of triangles.
#[derive(Debug, Serialize)]
pub struct MeshSummary {
    pub file: String,
    pub reflectance: f64,
    pub triangles: usize,
    pub vertices: usize,
}

/// Surfaces or other things that were not taken.
#[derive(Debug, Serialize)]
pub struct LeftOut {
    pub what: String,
    pub count: usize,
    /// Where the scene says what it is, or where the first stands.
    pub place: Option<String>,
}

/// So many lines of a kind; the JSON has them all.
const MAX_LINES: usize = 40;

impl fmt::Display for ImportSummary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { scene, format, up, unit_m, triangles, .. } = self;
        let unit = if *unit_m == 1.0 { "in metres".to_owned() } else { format!("a unit is {unit_m} m") };
        writeln!(f, "{scene} ({format}, {up} up, {unit}): {triangles} triangles taken")?;
        let width = self.materials.iter().map(|m| m.name.chars().count()).max().unwrap_or(0).clamp(8, 40);
        writeln!(f, "  {:width$} {:>9} {:>10} {:>11}", "material", "triangles", "area m2", "reflectance")?;
        for m in self.materials.iter().take(MAX_LINES) {
            let from = match m.rgb {
                _ if m.is_given => "  by --reflectance".to_owned(),
                Some([r, g, b]) if g != r || b != r => format!("  of {r} {g} {b}"),
                _ => String::new(),
            };
            writeln!(
                f,
                "  {:width$} {:>9} {:>10.4} {:>11}{from}",
                Quoted(&m.name),
                m.triangles,
                m.area_m2,
                m.reflectance
            )?;
        }
        more(f, self.materials.len())?;
        writeln!(f, "bounding box: {} to {} m in the scene", box_of(self.min_m), box_of(self.max_m))?;
        write!(f, "{}", self.room)?;
        for m in self.meshes.iter().take(MAX_LINES) {
            let MeshSummary { file, reflectance, triangles, vertices } = m;
            writeln!(f, "mesh: {file}, reflectance {reflectance}, {triangles} triangles, {vertices} vertices")?;
        }
        more(f, self.meshes.len())?;
        for l in self.luminaires.iter().take(MAX_LINES) {
            writeln!(f, "luminaire: {}, {}, at {} m", l.id, l.photometry, box_of(l.at_m))?;
        }
        more(f, self.luminaires.len())?;
        for l in self.left_out.iter().take(MAX_LINES) {
            let place = l.place.as_ref().map(|place| format!(" ({place})")).unwrap_or_default();
            writeln!(f, "left out: {} {}{place}", l.count, l.what)?;
        }
        more(f, self.left_out.len())?;
        self.notes.iter().try_for_each(|note| writeln!(f, "note: {note}"))
    }
}

impl fmt::Display for RoomSummary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let size = box_of(self.size_m);
        let no_box = self.why.as_deref().unwrap_or_default();
        match self.kind {
            RoomKind::Box => writeln!(f, "room: {size} m, the scene's outermost surfaces, which are a box"),
            RoomKind::Mesh => {
                let file = self.file.unwrap_or_default();
                writeln!(f, "room: {file} in {size} m, the scene's outermost surfaces, which close; no box: {no_box}")?;
                for g in self.groups.iter().take(MAX_LINES) {
                    let GroupSummary { name, reflectance, triangles } = g;
                    let name = Quoted(name);
                    writeln!(f, "  group {name}, reflectance {reflectance}, {triangles} triangles")?;
                }
                more(f, self.groups.len())
            }
            RoomKind::Black => {
                let not_closed = self.why_not_closed.as_deref().unwrap_or_default();
                let margin_m = self.margin_m;
                writeln!(f, "room: {size} m, black, {margin_m} m around everything")?;
                writeln!(f, "  the outermost surfaces are no box: {no_box}")?;
                writeln!(f, "  and no surfaces close around the others: {not_closed}")
            }
        }
    }
}

fn box_of([x, y, z]: [f64; 3]) -> String {
    format!("[{x}, {y}, {z}]")
}

fn more(f: &mut fmt::Formatter<'_>, count: usize) -> fmt::Result {
    if count > MAX_LINES { writeln!(f, "  and {} more: --format json", count - MAX_LINES) } else { Ok(()) }
}
