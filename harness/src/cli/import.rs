//! `luxproof import SCENE`: a spec folder of a scene's geometry, and what of it was taken.

use std::path::{Path, PathBuf};
use std::str::FromStr;

use clap::Args;
use luminaire::geometry::Room;
use miette::{IntoDiagnostic, Report as Diagnostic};

use super::diagnostic::{diagnose, warn};
use super::first::{self, DOWNLIGHT, First, downlight};
use super::{TextOrJson, complain, json, print};
use crate::import::{Imported, Options, RoomMesh, Up, Walls, import};
use crate::report::Exit;
use crate::spec::{Case, Trust, doubts, suite};
use crate::system::files::keep_shared;
use crate::system::printable;

#[derive(Debug, Args)]
pub(super) struct ImportArgs {
    /// A Radiance source (.rad), a Wavefront file (.obj) or glTF 2.0 (.gltf, .glb)
    #[arg(value_name = "SCENE")]
    scene: PathBuf,
    /// Folder of the spec and its meshes [default: the scene's name]
    #[arg(long, value_name = "FOLDER")]
    out: Option<PathBuf>,
    /// The scene's axis that points up [default: y of glTF, else z]
    #[arg(long, value_enum, value_name = "AXIS")]
    up: Option<Up>,
    /// Metres a unit of the scene
    #[arg(long, value_name = "M", default_value = "1", value_parser = unit)]
    unit: f64,
    /// The diffuse reflectance of a material, whatever the scene says of it; may be given several times
    #[arg(long, value_name = "NAME=RHO")]
    reflectance: Vec<Given>,
    /// Leave out surfaces that are not opaque, diffuse and plain; else the scene is refused
    #[arg(long)]
    leave_out: bool,
    /// Replace a spec that is there
    #[arg(long)]
    force: bool,
    /// How to print what was taken
    #[arg(long, value_enum, value_name = "FORMAT", default_value_t = TextOrJson::Terminal)]
    format: TextOrJson,
}

/// The reflectance of a material.
#[derive(Clone, Debug)]
struct Given {
    name: String,
    reflectance: f64,
}

impl FromStr for Given {
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
    let folder = args.out.clone().or_else(|| args.scene.file_stem().map(PathBuf::from)).unwrap_or_default();
    let spec = folder.join("spec.yaml");
    if spec.exists() && !args.force {
        return Err(miette::miette!(
            help = "name another folder with --out, or give --force",
            "{} is there already",
            spec.display()
        ));
    }
    let write = |name: &str, text: &str| keep_shared(&folder.join(name), text.as_bytes()).into_diagnostic();
    if let Walls::Mesh(mesh) = &imported.walls {
        write(RoomMesh::FILE, &mesh.obj())?;
    }
    for part in &imported.meshes {
        write(&part.file, &part.obj())?;
    }
    write(DOWNLIGHT, &downlight())?;
    // At last, since it is there when it is whole.
    write("spec.yaml", &text(&args.scene, &spec, &imported))?;
    match args.format {
        TextOrJson::Terminal => print(&imported.told.to_string())?,
        TextOrJson::Json => print(&json(&imported.told)?)?,
    }
    let cases: Vec<Case> = suite(std::slice::from_ref(&spec), Trust::Own).map_err(diagnose)?;
    warn(&doubts(&cases));
    complain(&format!("next: put luminaires and meters into {}, then luxproof check it", spec.display()));
    Ok(Exit::Passed)
}

fn text(scene: &Path, spec: &Path, imported: &Imported) -> String {
    let name = scene.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
    let name = printable::line(&name, 80);
    let shown = |value: f64| value.to_string();
    let at = imported.origin_m.to_array().map(shown).join(", ");
    let at = if imported.origin_m == glam::DVec3::ZERO { String::new() } else { format!(" at_m: [{at}],") };
    let mesh = |part: &crate::import::Part| {
        format!("  - mesh: {{file: {},{at} reflectance: {}}}\n", part.file, part.reflectance)
    };
    let meshes: String = imported.meshes.iter().map(mesh).collect();
    let obstacles = if meshes.is_empty() { meshes } else { format!("\nobstacles:\n{meshes}") };
    let first = First {
        about: &format!(
            "The geometry of {name}, by luxproof import; its luminaire and meters are placeholders: put yours there."
        ),
        file: spec,
        title: &name,
        room: &room(&imported.walls),
        obstacles: &obstacles,
        photometry: Path::new(DOWNLIGHT),
        place: imported.place,
    };
    first.text()
}

/// The lines of the room, numbers as they are.
fn room(walls: &Walls) -> String {
    let shown = |value: f64| value.to_string();
    match walls {
        Walls::Box(Room { size_m, reflectance: rho }) => {
            let each_wall = [rho.wall_x_min, rho.wall_x_max, rho.wall_y_min, rho.wall_y_max];
            let reflectance = [shown(rho.floor), first::walls(each_wall, shown), shown(rho.ceiling)];
            first::box_room(size_m.to_array().map(shown), reflectance)
        }
        Walls::Mesh(mesh) => {
            let groups = mesh.groups.iter().map(|group| (group.name.as_str(), group.reflectance));
            first::mesh_room(RoomMesh::FILE, groups)
        }
    }
}
