//! A job as a folder of Blender files that anyone can run by hand; pure.
//!
//! `scene.py` builds the scene of what `cycles_scene.py` beside it has to offer; `job.json` holds the meters, which are no part of it.

use std::fmt::Write;

use glam::DVec3;
use luxproof_photometry::LuminousIntensityDistribution;
use luxproof_scene::geometry::Surface;
use luxproof_scene::{Luminaire, Shape};

use super::ID;
use super::ies::LookedUp;
use crate::comment::Comment;
use crate::dialogue;
use crate::frame::{Frame, plain};
use crate::meshes::Mesh;
use crate::patches::opening::{Opening, Outline};
use crate::patches::settings::Settings;
use crate::patches::{self, reflections};
use crate::settings::Preset;
use crate::tables::Tables;
use crate::{EngineError, Job, SceneFile, meshes, recess};

const READ: &str = include_str!("../../drivers/cycles_read.py");
const SCENE: &str = include_str!("../../drivers/cycles_scene.py");

pub(super) fn files(job: &Job, settings: Settings) -> Result<Vec<SceneFile>, EngineError> {
    let frame = Frame::of(job, settings.coordinates);
    let job = &*recess::behind_luminaires(job, super::PACKAGE.apart);
    let tables = Tables::of(job);
    let names = (0..tables.distinct.len()).map(table).collect();
    let mut files = vec![
        SceneFile::text("scene.py", scene(job, settings, &frame, &tables)),
        patches::job_json(ID, job, settings, &frame, all_lights(job), names)?,
        SceneFile::text("cycles_read.py", READ),
        SceneFile::text("blocks.py", dialogue::BLOCKS),
        SceneFile::text("cycles_scene.py", SCENE),
    ];
    files.extend(meshes::files(job, &frame, Mesh::Obj));
    if settings.has_plain_tables() {
        files.extend(patches::plain_files(job, settings, &tables, table));
    } else {
        let about = "[MORE] angles beside the table's own make straight lines of Cycles' cubic curves";
        let distinct = tables.distinct.iter().enumerate();
        files.extend(distinct.map(|(k, d)| SceneFile::text(&table(k), LookedUp::of(d).file(about))));
    }
    Ok(files)
}

fn table(k: usize) -> String {
    format!("table-{k}.ies")
}

/// Blender's lights of a luminaire.
fn lights(luminaire: &Luminaire) -> usize {
    match Opening::of(luminaire) {
        Opening::None => 1,
        Opening::Flat(..) | Opening::Solid => sides(luminaire).count(),
    }
}

fn all_lights(job: &Job) -> usize {
    job.scene.luminaires.iter().map(lights).sum()
}

/// The sides of an opening that shine: whether upwards.
fn sides(luminaire: &Luminaire) -> impl Iterator<Item = bool> {
    let table = &luminaire.photometry.distribution;
    [false, true].into_iter().filter(|is_upwards| has_light(table, *is_upwards))
}

/// Whether a table has light above or below the horizontal.
fn has_light(table: &LuminousIntensityDistribution, is_upwards: bool) -> bool {
    let mut planes = (0..table.c_deg().len()).map(|c| table.plane(c));
    planes.any(|plane| {
        let mut lit = table.gamma_deg().iter().zip(plane).filter(|(_, cd)| **cd > 0.0);
        lit.any(|(gamma, _)| if is_upwards { *gamma > 90.0 } else { *gamma < 90.0 })
    })
}

fn scene(job: &Job, settings: Settings, frame: &Frame, tables: &Tables<'_>) -> String {
    let mut text = format!(
        "# {case}: {procedure}.\n\
         # For Blender 4.5 (or its Python package bpy); read the meters of job.json with\n\
         #     python cycles_read.py job.json\n\
         # or save the scene for a look with\n\
         #     python scene.py scene.blend\n\
         # Metres, candela and lux: illuminance is pi times the diffuse light of a white surface. z is up.\n",
        case = Comment(&job.case),
        procedure = job.procedure,
    );
    for line in frame.remark().iter().flat_map(|remark| remark.lines()) {
        writeln!(text, "# {line}").ok();
    }
    text += "import os\nimport sys\n\nimport bpy\n\n\
             sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))\n\
             import cycles_scene as cycles\n\ncycles.start()\n";
    if settings.preset != Preset::Default {
        let light_tree = if all_lights(job) > 1 { "True" } else { "False" };
        // Paths to one light vary by little but where they end (docs/decisions/0017-sampling-plans.md); what is off makes no difference.
        let shining: usize = job.scene.luminaires.iter().filter(|l| l.is_on()).map(lights).sum();
        let roulette_from = if shining > 1 { 0 } else { 4 };
        let reflections = reflections(job);
        writeln!(
            text,
            "cycles.accurate(reflections={reflections}, light_tree={light_tree}, roulette_from={roulette_from})"
        )
        .ok();
    }
    text.push('\n');
    surfaces(&mut text, job, frame);
    for (k, (luminaire, of)) in job.scene.luminaires.iter().zip(&tables.of_luminaire).enumerate() {
        writeln!(text, "# {}", Comment(&luminaire.id)).ok();
        let scale = luminaire.flux_scale * frame.scale * frame.scale;
        let rows = frame.placed(luminaire.position_m, luminaire.orientation).map(|row| list(&row)).join(", ");
        let common = format!("\"luminaire {k}\", \"{}\", {scale}, [{rows}]", table(*of));
        let maker = if settings.has_plain_tables() { "stock" } else { "point" };
        match Opening::of(luminaire) {
            Opening::Flat(outline, size_m) => {
                let shape = match outline {
                    Outline::Rectangle => "RECTANGLE",
                    Outline::Ellipse => "ELLIPSE",
                };
                for up in sides(luminaire) {
                    let (size, up) = (list(&size_m.map(|s| s * frame.scale)), if up { "True" } else { "False" });
                    writeln!(text, "cycles.area_luminaire({common}, \"{shape}\", {size}, upwards={up})").ok();
                }
            }
            _ => {
                writeln!(text, "cycles.{maker}_luminaire({common})").ok();
            }
        }
    }
    text + "\nif __name__ == \"__main__\":\n    bpy.ops.wm.save_as_mainfile(filepath=os.path.abspath(sys.argv[-1]))\n"
}

fn surfaces(text: &mut String, job: &Job, frame: &Frame) {
    for (room, surface) in job.scene.room.iter().flat_map(|room| Surface::ALL.map(|s| (room, s))) {
        let corners: Vec<String> =
            recess::corners_m(job, room, surface, super::PACKAGE.apart).map(|c| point(frame.to_scene(c))).to_vec();
        let (name, reflectance) = (surface.name(), room.reflectance.of(surface));
        let corners = corners.join(", ");
        writeln!(text, "cycles.surface(\"{name}\", {reflectance}, [{corners}], [[0, 1, 2, 3]])").ok();
    }
    for (k, obstacle) in job.scene.obstacles.iter().enumerate() {
        let reflectance = obstacle.reflectance;
        match &obstacle.shape {
            Shape::Box { min_m, max_m } => {
                let [low, high] = [min_m, max_m].map(|p| point(frame.to_scene(*p)));
                writeln!(text, "cycles.cuboid(\"obstacle {k}\", {reflectance}, {low}, {high})").ok();
            }
            Shape::Mesh { .. } => {
                writeln!(text, "cycles.body(\"obstacle {k}\", {reflectance}, \"{}\")", meshes::name(k, Mesh::Obj)).ok();
            }
        }
    }
}

fn point(p: DVec3) -> String {
    list(&p.to_array())
}

fn list(values: &[f64]) -> String {
    let words: Vec<String> = values.iter().map(|v| plain(*v).to_string()).collect();
    format!("[{}]", words.join(", "))
}
