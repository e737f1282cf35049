//! A job as a folder of Blender files that anyone can run by hand; pure.
//!
//! `scene.py` builds the scene of what `cycles_scene.py` beside it has to offer; `job.json` holds the meters, which are no part of it.

use std::fmt::Write;

use glam::DVec3;
use itertools::Itertools;
use luminaire::geometry::Surface;
use luminaire::photometry::{LuminousIntensityDistribution, LuminousOpening};
use luminaire::scene::{Bounces, Luminaire, LuminaireModel, Shape};
use serde::Serialize;

use super::ID;
use super::ies::{self, LookedUp};
use super::settings::{Files, Settings};
use crate::engines::comment::Comment;
use crate::engines::dialogue::{self, Seat};
use crate::engines::frame::{Frame, plain};
use crate::engines::settings::Preset;
use crate::engines::tables::Tables;
use crate::engines::{EngineError, Job, SceneFile, effort, meshes, recess};

const READ: &str = include_str!("../../../drivers/cycles_read.py");
const SCENE: &str = include_str!("../../../drivers/cycles_scene.py");

/// More reflections Blender does not let anyone ask for.
pub(super) const MOST_REFLECTIONS: i64 = 1024;
/// Side of a meter's patch, in parts of the largest coordinate: forty times what 32-bit floats resolve there at least.
const PATCH: f64 = 5e-6;

pub(super) fn files(job: &Job, settings: Settings) -> Result<Vec<SceneFile>, EngineError> {
    let frame = Frame::of(job, settings.coordinates);
    let job = &*recess::apart(job);
    let tables = Tables::of(job);
    let mut files = vec![
        SceneFile::text("scene.py", scene(job, settings, &frame, &tables)),
        SceneFile::text("job.json", job_json(job, settings, &frame, &tables)?),
        SceneFile::text("cycles_read.py", READ),
        SceneFile::text("blocks.py", dialogue::BLOCKS),
        SceneFile::text("cycles_scene.py", SCENE),
    ];
    files.extend(meshes::files(job, &frame));
    let own = |k: usize| {
        let of_table =
            tables.of_luminaire.iter().position(|t| *t == k).filter(|_| settings.photometry == Files::Native)?;
        Some(job.scene.luminaires[of_table].photometry.lm63_file()?.bytes.to_vec())
    };
    let file = |(k, d): (usize, &&_)| match own(k) {
        Some(bytes) => SceneFile { name: table(k), bytes },
        None => SceneFile::text(&table(k), ies_file(d, settings)),
    };
    files.extend(tables.distinct.iter().enumerate().map(file));
    Ok(files)
}

fn ies_file(distribution: &LuminousIntensityDistribution, settings: Settings) -> String {
    if settings.has_plain_tables() {
        return ies::plain_file(distribution, "[MORE] the table as it is");
    }
    LookedUp::of(distribution).file("[MORE] resampled for the cubic curves of Cycles' IES texture")
}

/// Luminaires whose own files differ, and say the same.
pub(super) fn two_files_of_a_table(job: &Job) -> Option<(&str, &str)> {
    let all = &job.scene.luminaires;
    let differ = |[a, b]: &[&Luminaire; 2]| {
        a.photometry.distribution == b.photometry.distribution && a.photometry.source != b.photometry.source
    };
    all.iter().array_combinations().find(differ).map(|[a, b]| (a.id.as_str(), b.id.as_str()))
}

fn table(k: usize) -> String {
    format!("table-{k}.ies")
}

#[derive(Serialize)]
struct DriverJob<'a> {
    case: &'a str,
    procedure: &'a str,
    transport: &'static str,
    reflections: i64,
    emitters: usize,
    extended: bool,
    /// Whether direct light is read one luminaire after the other.
    apart: bool,
    tables: Vec<String>,
    /// Side of a meter's patch.
    patch: f64,
    /// How many blocks it reads by itself, and how many samples along the side of each.
    blocks: usize,
    side: usize,
    seed: u64,
    stations: Vec<Seat<'a>>,
}

fn job_json(job: &Job, settings: Settings, frame: &Frame, tables: &Tables<'_>) -> Result<String, EngineError> {
    let (blocks, side) = settings.by_itself();
    let driver_job = DriverJob {
        case: &job.case,
        procedure: job.procedure.name(),
        transport: dialogue::transport(job),
        reflections: reflections(job),
        emitters: job.scene.luminaires.iter().map(lights).sum(),
        extended: job.scene.luminaires.iter().any(|l| Opening::of(l) != Opening::None),
        apart: settings.preset != Preset::Default,
        tables: (0..tables.distinct.len()).map(table).collect(),
        patch: patch(job, frame),
        blocks,
        side,
        seed: job.seed,
        stations: dialogue::seats(job, frame),
    };
    serde_json::to_string_pretty(&driver_job)
        .map_err(|e| EngineError::output(ID, format!("the job cannot be written: {e}")))
}

/// Side of a meter's patch in scene units.
pub(super) fn patch(job: &Job, frame: &Frame) -> f64 {
    let room = job.scene.room.iter().flat_map(|r| [DVec3::ZERO, r.size_m]);
    let points = room.chain(job.scene.luminaires.iter().map(|l| l.position_m));
    let points = points.chain(job.stations.iter().map(|s| s.meter.position_m));
    let largest = points.map(|p| frame.to_scene(p).abs().max_element()).fold(0.0, f64::max);
    PATCH * if largest > 0.0 { largest } else { 1.0 }
}

/// Diffuse reflections that paths are followed for.
pub(super) fn reflections(job: &Job) -> i64 {
    match job.reflections() {
        None => 0,
        Some(Bounces::AtMost(n)) => i64::from(n).min(MOST_REFLECTIONS),
        Some(Bounces::Converged) => {
            let highest = job.largest_reflectance();
            effort::reflections_until(highest, 0.1 * job.budget.relative_error).clamp(8, MOST_REFLECTIONS)
        }
    }
}

/// Why a luminaire cannot be had, if so.
pub(super) fn obstacle(job: &Job, is_stock: bool) -> Option<String> {
    job.scene.luminaires.iter().filter(|l| l.model == LuminaireModel::Area).find_map(|l| match Opening::of(l) {
        Opening::None => None,
        _ if is_stock => Some(format!("{}: a stock scene of Blender has IES tables on points only", l.id)),
        Opening::Flat(..) => None,
        Opening::Solid => Some(format!("{}: only flat luminous openings are area lights in Cycles", l.id)),
    })
}

/// What shines of a luminaire.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Opening {
    /// A point.
    None,
    /// An area light: its shape and both sides in metres.
    Flat(&'static str, [f64; 2]),
    /// Blender has no light for it.
    Solid,
}

impl Opening {
    fn of(luminaire: &Luminaire) -> Self {
        if luminaire.model == LuminaireModel::Point {
            return Self::None;
        }
        let flat = |shape, x_m: f64, y_m: f64| {
            if x_m > 0.0 && y_m > 0.0 { Self::Flat(shape, [x_m, y_m]) } else { Self::Solid }
        };
        match luminaire.photometry.opening {
            LuminousOpening::Point => Self::None,
            other if other.bounding_box_m() == [0.0; 3] => Self::None,
            LuminousOpening::Box { x_m, y_m, height_m: 0.0 } => flat("RECTANGLE", x_m, y_m),
            LuminousOpening::Ellipse { x_m, y_m, height_m: 0.0 } => flat("ELLIPSE", x_m, y_m),
            _ => Self::Solid,
        }
    }
}

/// Blender's lights of a luminaire.
fn lights(luminaire: &Luminaire) -> usize {
    match Opening::of(luminaire) {
        Opening::None => 1,
        Opening::Flat(..) | Opening::Solid => sides(luminaire).count(),
    }
}

/// The sides of an opening that shine: whether upwards.
fn sides(luminaire: &Luminaire) -> impl Iterator<Item = bool> {
    let table = &luminaire.photometry.distribution;
    let shines = |is_upwards: bool| {
        let is_there = |g: f64| if is_upwards { g > 90.0 } else { g < 90.0 };
        let lit = |plane: &[f64]| table.gamma_deg().iter().zip(plane).any(|(g, cd)| is_there(*g) && *cd > 0.0);
        (0..table.c_deg().len()).any(|c| lit(table.plane(c)))
    };
    [false, true].into_iter().filter(move |up| shines(*up))
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
        writeln!(text, "cycles.accurate(reflections={})", reflections(job)).ok();
    }
    text.push('\n');
    surfaces(&mut text, job, frame);
    for (k, (luminaire, of)) in job.scene.luminaires.iter().zip(&tables.of_luminaire).enumerate() {
        writeln!(text, "# {}", Comment(&luminaire.id)).ok();
        let scale = luminaire.flux_scale * frame.scale * frame.scale;
        let rows = frame.placed(luminaire.position_m, luminaire.orientation).map(|row| list(&row)).join(", ");
        let common = format!("\"luminaire {k}\", \"{}\", {scale}, [{rows}]", table(*of));
        let maker = if settings.preset == Preset::Default { "stock" } else { "point" };
        match Opening::of(luminaire) {
            Opening::Flat(shape, size_m) => {
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
        let corners: Vec<String> = room.corners(surface).map(|c| point(frame.to_scene(c))).to_vec();
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
                writeln!(text, "cycles.body(\"obstacle {k}\", {reflectance}, \"{}\")", meshes::name(k)).ok();
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
