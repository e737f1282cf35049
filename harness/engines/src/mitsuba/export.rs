//! A job as a folder of Mitsuba 3 files that anyone can run by hand; pure.
//!
//! `scene.xml` holds the integrator and the luminaires (emitters that the Python file beside it adds to Mitsuba) and
//! includes `room.xml`, the surfaces; `job.json` holds the meters, which are no part of the scene.

mod opening;
mod placing;
mod stock;
mod surfaces;
mod tables;

use luxproof_scene::{Bounces, Luminaire};
use serde::Serialize;

pub(super) use self::stock::obstacle_to_stock;
use super::ID;
use super::settings::{FIXED_BLOCKS, FIXED_SIDE, Integrator, Settings};
use crate::comment::Comment;
use crate::dialogue::{self, JOB_FILE, MeterPlacement};
use crate::frame::Frame;
use crate::settings::Preset;
use crate::tables::Tables;
use crate::{EngineError, Job, SceneFile, effort, meshes, recess};

const READ: &str = include_str!("../../drivers/mitsuba_read.py");
const METERS: &str = include_str!("../../drivers/mitsuba_meters.py");
const GONIOMETRIC: &str = include_str!("../../drivers/mitsuba_goniometric.py");

/// Russian roulette stops a path with 5 % at least, so that above this reflectance rare long paths carry the light.
const HIGH_REFLECTANCE: f64 = 0.95;

pub(super) fn files(job: &Job, settings: &Settings) -> Result<Vec<SceneFile>, EngineError> {
    let frame = Frame::of(job, settings.coordinates);
    let job = &*recess::separate(job);
    let tables = Tables::of(job);
    let mut files = vec![
        SceneFile::text("scene.xml", scene_xml(job, settings, &frame, &tables)),
        SceneFile::text(JOB_FILE, job_json(job, settings, &frame)?),
        SceneFile::text("mitsuba_read.py", READ),
        SceneFile::text("blocks.py", dialogue::BLOCKS),
        SceneFile::text("mitsuba_goniometric.py", GONIOMETRIC),
        SceneFile::text("mitsuba_meters.py", METERS),
    ];
    if has_surfaces(job) {
        files.push(SceneFile::text("room.xml", surfaces::room_xml(job, &frame)));
        files.extend(meshes::files(job, &frame, meshes::Mesh::Obj));
    }
    files.extend(tables::files(&tables)?);
    files.extend(stock::files(job, settings, &frame, &tables));
    Ok(files)
}

fn has_surfaces(job: &Job) -> bool {
    job.scene.room.is_some() || !job.scene.obstacles.is_empty()
}

#[derive(Serialize)]
struct DriverJob<'a> {
    case: &'a str,
    procedure: &'a str,
    scene: &'static str,
    variant: &'a str,
    integrator: &'static str,
    transport: &'static str,
    emitters: usize,
    extended: bool,
    /// How many blocks it reads by itself, and how many samples along the side of each.
    blocks: usize,
    side: usize,
    film: Option<Film>,
    seed: u64,
    sensors: Vec<MeterPlacement<'a>>,
}

#[derive(Serialize)]
struct Film {
    tile: usize,
    factor: f64,
}

fn job_json(job: &Job, settings: &Settings, frame: &Frame) -> Result<String, EngineError> {
    let film = Film { tile: stock::TILE, factor: stock::pixel_factor(job) };
    let (scene, film) = match settings.preset {
        Preset::Audit | Preset::Fast => ("scene.xml", None),
        Preset::Default => ("stock.xml", Some(film)),
    };
    let (blocks, side) = match settings.preset {
        Preset::Audit => (2 * FIXED_BLOCKS, 2 * FIXED_SIDE),
        Preset::Fast | Preset::Default => (FIXED_BLOCKS, FIXED_SIDE),
    };
    let driver_job = DriverJob {
        case: &job.case,
        procedure: job.procedure.name(),
        scene,
        variant: settings.variant,
        integrator: settings.integrator.plugin(),
        transport: dialogue::transport(job),
        emitters: job.scene.luminaires.len(),
        extended: job.scene.luminaires.iter().any(opening::is_extended),
        blocks,
        side,
        film,
        seed: job.seed,
        sensors: dialogue::placements(job, frame).collect(),
    };
    serde_json::to_string_pretty(&driver_job)
        .map_err(|e| EngineError::output(ID, format!("the job cannot be written: {e}")))
}

fn scene_xml(job: &Job, settings: &Settings, frame: &Frame, tables: &Tables) -> String {
    let mut xml =
        header(job, "The luminaires; read the meters of job.json with\n         python mitsuba_read.py job.json");
    xml += &placing::comment(frame);
    xml += &integrator(job, settings.integrator);
    if has_surfaces(job) {
        xml += "    <include filename=\"room.xml\"/>\n";
    }
    let luminaires = job.scene.luminaires.iter().zip(tables.of_luminaire.iter().map(|k| tables::name(*k)));
    xml.extend(luminaires.map(|(luminaire, table)| emitter(luminaire, &table, frame)));
    xml + "</scene>\n"
}

fn emitter(luminaire: &Luminaire, table: &str, frame: &Frame) -> String {
    format!(
        r#"
    <!-- {id} -->
    <emitter type="goniometric">
        <string name="table" value="{table}"/>
        <float name="scale" value="{scale}"/>{opening}
        <transform name="to_world">
            <matrix value="{matrix}"/>
        </transform>
    </emitter>
"#,
        id = Comment(&luminaire.id),
        opening = opening::xml(luminaire, frame),
        scale = luminaire.flux_scale * frame.scale * frame.scale,
        matrix = placing::matrix(frame, luminaire.position_m, luminaire.orientation),
    )
}

fn header(job: &Job, what: &str) -> String {
    let (case, procedure) = (Comment(&job.case), job.procedure);
    format!(
        r#"<?xml version="1.0" encoding="utf-8"?>
<!-- {case}: {procedure}.
     {what}
     Metres, candela and lux: a diffuse surface's irradiance is its illuminance. z is up. -->
<scene version="3.0.0">
"#
    )
}

/// The integrator with the path length that the transport asks for.
///
/// Mitsuba's depth counts the segments of a path from the meter to the luminaire: N reflections are depth N + 1.
fn integrator(job: &Job, kind: Integrator) -> String {
    let highest = job.scene.largest_reflectance();
    let (max_depth, rr_depth, why) = match job.reflections() {
        None => (1, 5, "direct light only".to_owned()),
        Some(Bounces::AtMost(n)) => (i64::from(n) + 1, 5, format!("{n} diffuse reflections")),
        Some(Bounces::Converged) if highest < HIGH_REFLECTANCE => (-1, 5, "all reflections".to_owned()),
        Some(Bounces::Converged) => {
            let n = effort::reflections_until(highest, 0.1 * job.budget.relative_error);
            let why = format!(
                "{n} reflections leave less than a tenth of the relative error asked for; no Russian roulette, which \
                 would let rare long paths carry the light at reflectance {highest}"
            );
            (n + 1, 1_000_000, why)
        }
    };
    // Direct light is read by itself.
    let more =
        if kind == Integrator::Particles { "\n        <boolean name=\"hide_emitters\" value=\"true\"/>" } else { "" };
    format!(
        r#"    <!-- {why} -->
    <integrator type="{plugin}">
        <integer name="max_depth" value="{max_depth}"/>
        <integer name="rr_depth" value="{rr_depth}"/>{more}
    </integrator>
"#,
        plugin = kind.plugin()
    )
}
