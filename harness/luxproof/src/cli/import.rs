//! `luxproof import SCENE`: a spec folder of a scene's geometry, and what of it was taken.

use luxproof_process::files;
use std::path::{Path, PathBuf};
use std::str::FromStr;

use clap::Args;
use glam::DVec3;
use luxproof_scene::geometry::{Room, is_inside_closed};
use miette::{IntoDiagnostic, Report as Diagnostic};

use super::TextOrJson;
use super::spec_template::{self, DOWNLIGHT, DeskMeters, First, downlight};
use luxproof_console::{complain, json, print};
use luxproof_console::{diagnose, warn};
use luxproof_model::Exit;
use luxproof_process::files::keep_shared;
use luxproof_process::printable;
use luxproof_scene_import::{Imported, ImportedLuminaire, MeterGrid, Options, RoomMesh, Up, Walls, import};
use luxproof_spec::{Case, Trust, find_lints, suite};

#[derive(Debug, Args)]
pub(super) struct ImportArgs {
    /// A Radiance source (.rad), a Wavefront file (.obj), glTF 2.0 (.gltf, .glb) or USD (.usda)
    #[arg(value_name = "SCENE")]
    scene: PathBuf,
    /// Folder of the spec and its meshes [default: the scene's name]
    #[arg(long, value_name = "FOLDER")]
    out: Option<PathBuf>,
    /// The axis that points up [default: y for glTF, as USD states it, else z]
    #[arg(long, value_enum, value_name = "AXIS")]
    up: Option<Up>,
    /// Metres per unit of the scene [default: as USD states it, else 1]
    #[arg(long, value_name = "M", value_parser = unit)]
    unit: Option<f64>,
    /// Set the diffuse reflectance of a material; may be given several times
    #[arg(long, value_name = "NAME=RHO")]
    reflectance: Vec<ReflectanceOption>,
    /// Leave out glossy, transparent and textured surfaces instead of an error
    #[arg(long)]
    leave_out: bool,
    /// Replace an existing spec
    #[arg(long)]
    force: bool,
    /// Format to print
    #[arg(long, value_enum, value_name = "FORMAT", default_value_t = TextOrJson::Terminal)]
    format: TextOrJson,
}

/// The reflectance of a material.
#[derive(Clone, Debug)]
struct ReflectanceOption {
    name: String,
    reflectance: f64,
}

impl FromStr for ReflectanceOption {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        // The last, since names have such signs, too.
        let (name, number) = text.rsplit_once('=').ok_or("it is NAME=0.5")?;
        let reflectance = number.parse().ok().filter(|rho| (0.0..=1.0).contains(rho));
        let reflectance = reflectance.ok_or_else(|| format!("`{number}` is no number from 0 to 1"))?;
        Ok(Self { name: name.to_owned(), reflectance })
    }
}

fn unit(text: &str) -> Result<f64, String> {
    let unit = text.parse().ok().filter(|unit: &f64| unit.is_finite() && *unit > 0.0);
    unit.ok_or_else(|| format!("`{text}` is no length in metres, such as 0.001"))
}

pub(super) fn run(args: &ImportArgs, trust: Trust) -> Result<Exit, Diagnostic> {
    let options = Options {
        up: args.up,
        unit_m: args.unit,
        reflectances: args.reflectance.iter().map(|given| (given.name.clone(), given.reflectance)).collect(),
        leaves_out: args.leave_out,
        trust,
    };
    let imported = import(&args.scene, &options).map_err(diagnose)?;
    let folder = match (&args.out, files::stem(&args.scene)) {
        (Some(out), _) => out.clone(),
        (None, Some(stem)) => stem.to_owned(),
        (None, None) => {
            let help = "name a folder with --out";
            return Err(miette::miette!(help = help, "{} names no folder to write into", args.scene.display()));
        }
    };
    super::refuse_links(&folder, trust)?;
    let spec = folder.join("spec.yaml");
    if spec.exists() && !args.force {
        return Err(miette::miette!(
            help = "name another folder with --out, or give --force",
            "{} is there already",
            spec.display()
        ));
    }
    if let Walls::Mesh(mesh) = &imported.walls {
        write(&folder, RoomMesh::FILE, &mesh.obj())?;
    }
    for part in &imported.meshes {
        write(&folder, &part.file, &part.obj())?;
    }
    // Nothing says how far walls are from the placeholder, so its opening is small.
    if imported.luminaires.is_empty() {
        let extent_m = imported.place.high_m - imported.place.low_m;
        write(&folder, DOWNLIGHT, &downlight(0.1 * extent_m.min_element()))?;
    }
    for luminaire in &imported.luminaires {
        keep_shared(&folder.join(&luminaire.file), &luminaire.bytes).into_diagnostic()?;
    }
    // The spec comes last: once it exists, all files that it names exist.
    write(&folder, "spec.yaml", &text(&args.scene, &spec, &imported))?;
    match args.format {
        TextOrJson::Terminal => print(&imported.summary.to_string())?,
        TextOrJson::Json => print(&json(&imported.summary)?)?,
    }
    let cases: Vec<Case> = suite(std::slice::from_ref(&spec), trust).map_err(diagnose)?;
    warn(&find_lints(&cases));
    if imported.luminaires.is_empty() && imported.summary.lights_left_out > 0 {
        complain(&format!(
            "warning: no light of the scene became a luminaire (`left out` says why); the one in {} is a placeholder",
            spec.display()
        ));
    }
    let what = if imported.luminaires.is_empty() { "luminaires and meters" } else { "meters" };
    complain(&format!("next: put {what} into {}, then luxproof check it", spec.display()));
    Ok(Exit::Passed)
}

fn text(scene: &Path, spec: &Path, imported: &Imported) -> String {
    let name = scene.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
    let name = printable::line(&name, 80);
    let at = imported.origin_m.to_array().map(|metres| metres.to_string()).join(", ");
    let at = if imported.origin_m == glam::DVec3::ZERO { String::new() } else { format!(" at_m: [{at}],") };
    let meshes = imported
        .meshes
        .iter()
        .map(|part| format!("  - mesh: {{file: {},{at} reflectance: {}}}\n", part.file, part.reflectance))
        .collect::<Vec<_>>()
        .concat();
    let obstacles = if meshes.is_empty() { meshes } else { format!("\nobstacles:\n{meshes}") };
    let placeholders = if imported.luminaires.is_empty() { "luminaire and meters" } else { "meters" };
    let first = First {
        about: &format!(
            "The geometry of {name}, by luxproof import; its {placeholders} are placeholders: put yours there."
        ),
        file: spec,
        title: &name,
        room: &room(&imported.walls),
        obstacles: &obstacles,
        photometry: Path::new(DOWNLIGHT),
        place: imported.place,
        model: None,
        is_recessed: false,
        desk: desk_meters(imported),
    };
    with_luminaires(first.text(), &imported.luminaires)
}

/// The template's text with these luminaires instead of the placeholder.
fn with_luminaires(text: String, luminaires: &[ImportedLuminaire]) -> String {
    let (Some(first), Some((head, rest))) = (luminaires.first(), text.split_once("\nluminaires:\n")) else {
        return text;
    };
    let Some((_, tail)) = rest.split_once("\nmeters:\n") else { return text };
    let mut lines = String::new();
    for ImportedLuminaire { id, file, at_m, rotate_deg: [azimuth, tilt, roll], flux_scale, model, .. } in luminaires {
        let [x, y, z] = at_m.to_array();
        let model = model.map(|model| format!("    model: {}\n", model.name())).unwrap_or_default();
        lines += &format!(
            "  - id: {id}\n    photometry: {file}\n    at_m: [{x}, {y}, {z}]\n    \
             rotate_deg: {{azimuth: {azimuth}, tilt: {tilt}, roll: {roll}}}\n    flux_scale: {flux_scale}\n{model}",
            id = serde_json::Value::from(id.as_str()),
        );
    }
    let tail =
        tail.replacen("luminaire: lamp,", &format!("luminaire: {},", serde_json::Value::from(first.id.as_str())), 1);
    format!("{head}\nluminaires:\n{lines}\nmeters:\n{tail}")
}

/// Triangles times meters that are looked at for meters inside bodies.
const MAX_LOOKS: usize = 10_000_000;

/// Meters at desk height that lie inside no closed body: light reaches none of those that do.
fn desk_meters(imported: &Imported) -> DeskMeters {
    let is_open = |at_m: &DVec3| {
        !imported
            .meshes
            .iter()
            .any(|part| is_inside_closed(&part.mesh.vertices_m, &part.mesh.triangles, *at_m - imported.origin_m))
    };
    let all: Vec<DVec3> = MeterGrid::within(imported.place.low_m, imported.place.high_m).meters().collect();
    let triangles: usize = imported.meshes.iter().map(|part| part.mesh.triangles.len()).sum();
    if triangles.saturating_mul(all.len()) > MAX_LOOKS {
        return DeskMeters::Coarse;
    }
    let open: Vec<DVec3> = all.iter().copied().filter(is_open).collect();
    if open.is_empty() || open.len() == all.len() { DeskMeters::Coarse } else { DeskMeters::Points(open) }
}

/// Writes a file of the imported scene.
fn write(folder: &Path, name: &str, text: &str) -> Result<(), Diagnostic> {
    keep_shared(&folder.join(name), text.as_bytes()).into_diagnostic()
}

/// A number with all its digits.
fn shown(value: f64) -> String {
    value.to_string()
}

/// The lines of the room, with all digits of its numbers.
fn room(walls: &Walls) -> String {
    match walls {
        Walls::Box(Room { size_m, reflectance: rho }) => {
            let each_wall = [rho.wall_x_min, rho.wall_x_max, rho.wall_y_min, rho.wall_y_max];
            let reflectance = [shown(rho.floor), spec_template::walls(each_wall, shown), shown(rho.ceiling)];
            spec_template::box_room(size_m.to_array().map(shown), reflectance)
        }
        Walls::Mesh(mesh) => {
            let groups = mesh.groups.iter().map(|group| (group.name.as_str(), group.reflectance));
            spec_template::mesh_room(RoomMesh::FILE, groups)
        }
    }
}
