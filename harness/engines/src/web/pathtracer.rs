//! three-gpu-pathtracer: a path tracer of the web, with the IES loader of three.js and its own lights, materials and integrator.
//!
//! Its scenes are as a page makes them: spot lights with IES maps, and a mesh for each surface. The driver reads blocks of paths, as those
//! of other sampling renderers do. Compiling its shader by software takes a minute, so the page stays open for the next job.

#[cfg(test)]
mod tests;

use std::collections::BTreeMap;

use glam::DVec3;
use luxproof_scene::geometry::{Mesh, Surface};
use luxproof_scene::{Bounces, LuminaireModel, Shape};
use serde::Serialize;

use super::{DRIVER, Imports, Lamp, command_by_hand, driver, file_name, native, probe};
use crate::cost::DirectCost;
use crate::dialogue::{self, Cost, Dialogue, JOB_FILE, MeterPlacement};
use crate::float_error::{FloatError, Instrument};
use crate::frame::Frame;
use crate::patches::placement::Space;
use crate::settings::{Coordinates, JobSettings, Preset};
use crate::{
    Absent, Engine, EngineError, EngineRoot, Entry, Job, JobDir, Measurement, SceneFile, Setting, Support, Version,
    checked, effort,
};
use luxproof_model::EngineName;

const ID: EngineName = EngineName::new("three-gpu-pathtracer");

pub(crate) static ENTRY: Entry = Entry {
    name: ID,
    display_name: "three-gpu-pathtracer",
    installs: super::INSTALLS,
    is_on_request: true,
    models: &[LuminaireModel::Point],
    fits_coordinates: Some("recentre"),
    make: || Box::new(PathTracer),
};

const PAGE: (&str, &str) = ("web_pathtracer.js", include_str!("../../drivers/web_pathtracer.js"));
const PACKAGES: [&str; 3] = ["three-gpu-pathtracer", "three", "three-mesh-bvh"];
const IMPORTS: [(&str, &str); 4] = [
    ("three", "/modules/three/build/three.module.js"),
    ("three/examples/jsm/", "/modules/three/examples/jsm/"),
    ("three-mesh-bvh", "/modules/three-mesh-bvh/build/index.module.js"),
    ("three-gpu-pathtracer", "/package/src/index.js"),
];

const SETTINGS: &[Setting] = &[Preset::KNOB, Setting { key: "recentre", values: &["true", "false"] }];

/// Its shader starts rays this far off a surface, times one and the largest coordinate, in scene units. Patches are as wide.
const RAY_OFFSET: f64 = 1e-4;
/// The most reflections that paths are followed for.
const MOST_REFLECTIONS: i64 = 1024;
/// Blocks of the presets with a fixed effort, and the samples along their side.
const FIXED_BLOCKS: usize = 8;
const FAST_SIDE: usize = 32;
const STOCK_SIDE: usize = 64;
/// What its surfaces reflect more than Lambert's, and 32-bit sums of images, in parts of a reading of reflected light.
const RELATIVE_ERROR: f64 = 2e-4;
/// Counted seconds of a ray, on two cores of a usual server.
const RAY_S: f64 = 5e-6;
/// Strata along a side of a trial.
const TRIAL_SIDE: usize = 32;
/// Compiling its shader takes a minute of one core.
const START_S: f64 = 400.0;

/// What becomes of light in a scene without settings.
const STOCK: &str = "as installed, three-gpu-pathtracer follows nine reflections, and a material of which only the color is set \
                     shines at grazing angles";

#[derive(Clone, Copy, Debug, PartialEq)]
struct Settings {
    preset: Preset,
    coordinates: Coordinates,
}

impl Settings {
    fn of(job: &Job) -> Result<Self, EngineError> {
        let given = JobSettings::of(job, ID, SETTINGS)?;
        Ok(Self { preset: given.preset()?, coordinates: given.coordinates("recentre")? })
    }

    /// Blocks and the samples along their side, where these do not follow the budget.
    const fn fixed(self) -> Option<(usize, usize)> {
        match self.preset {
            Preset::Audit => None,
            Preset::Fast => Some((FIXED_BLOCKS, FAST_SIDE)),
            Preset::Default => Some((FIXED_BLOCKS, STOCK_SIDE)),
        }
    }
}

struct PathTracer;

/// What the driver and its page read.
#[derive(Serialize)]
struct PageJob<'a> {
    case: &'a str,
    procedure: &'a str,
    page: &'static str,
    package: &'static str,
    imports: Imports,
    transport: &'static str,
    reflections: i64,
    /// Whether everything is as installed.
    stock: bool,
    lamps: Vec<Lamp>,
    surfaces: Vec<SurfaceTriangles>,
    /// Side of a meter's patch, in scene units.
    patch: f64,
    /// Blocks and the samples along their side, where no others are asked for.
    blocks: usize,
    side: usize,
    seed: u64,
    sensors: Vec<PatchPlacement<'a>>,
}

/// Triangles of one reflectance, by their corners in scene units. They face the light.
#[derive(Serialize)]
struct SurfaceTriangles {
    reflectance: f64,
    corners: Vec<[[f64; 3]; 3]>,
}

#[derive(Serialize)]
struct PatchPlacement<'a> {
    #[serde(flatten)]
    placement: MeterPlacement<'a>,
    /// Whether no surface is near, so that the patch may lie behind the meter, where rays from it start at the meter.
    free: bool,
}

/// Returns the side of a meter's patch in scene units.
fn patch(job: &Job, frame: &Frame) -> f64 {
    let points = job.sensors.iter().map(|s| frame.to_scene(s.meter.position_m).abs().max_element());
    RAY_OFFSET * (1.0 + points.fold(0.0, f64::max))
}

/// Returns how many diffuse reflections paths are followed for.
fn reflections(job: &Job) -> i64 {
    match job.reflections() {
        None => 0,
        Some(Bounces::AtMost(n)) => i64::from(n).min(MOST_REFLECTIONS),
        Some(Bounces::Converged) => {
            let highest = job.scene.largest_reflectance();
            effort::reflections_until(highest, 0.1 * job.budget.relative_error).clamp(8, MOST_REFLECTIONS)
        }
    }
}

/// Returns the room and the obstacles of a job.
fn surfaces(job: &Job, frame: &Frame) -> Vec<SurfaceTriangles> {
    let walls = job.scene.room.iter().flat_map(|room| {
        Surface::ALL.map(|surface| {
            let [a, b, c, d] = room.corners(surface).map(|corner| frame.to_scene(corner).to_array());
            SurfaceTriangles { reflectance: room.reflectance.of(surface), corners: vec![[a, b, c], [a, c, d]] }
        })
    });
    let obstacles = job.scene.obstacles.iter().map(|obstacle| {
        let corners = match &obstacle.shape {
            Shape::Box { min_m, max_m } => {
                let cuboid = Mesh::cuboid(*min_m, *max_m);
                triangles(&cuboid.vertices_m, &cuboid.triangles, frame)
            }
            Shape::Mesh { vertices_m, triangles } => self::triangles(vertices_m, triangles, frame),
        };
        SurfaceTriangles { reflectance: obstacle.reflectance, corners }
    });
    walls.chain(obstacles).collect()
}

fn triangles(vertices_m: &[DVec3], triangles: &[[u32; 3]], frame: &Frame) -> Vec<[[f64; 3]; 3]> {
    triangles.iter().map(|corners| corners.map(|k| frame.to_scene(vertices_m[k as usize]).to_array())).collect()
}

impl Engine for PathTracer {
    fn name(&self) -> EngineName {
        ID
    }

    fn reads_files(&self, _job: &Job) -> bool {
        true
    }

    fn probe(&self, site: &EngineRoot) -> Result<Version, Absent> {
        probe(&ID, site, &PACKAGES.map(str::to_owned))
    }

    fn supports(&self, job: &Job) -> Support {
        if let Some(why) = ENTRY.objection(job) {
            return Support::No(why);
        }
        // `check_settings` reports invalid settings.
        if Settings::of(job).is_ok_and(|settings| settings.preset == Preset::Default) {
            return Support::Approximate { why: STOCK.into(), size: None };
        }
        if reflections(job) == MOST_REFLECTIONS && job.reflections() != Some(Bounces::AtMost(0)) {
            let why = format!("it follows {MOST_REFLECTIONS} reflections here at most");
            return Support::Approximate { why, size: None };
        }
        Support::Yes
    }

    fn export(&self, job: &Job) -> Result<Vec<SceneFile>, EngineError> {
        let settings = Settings::of(job)?;
        let frame = Frame::of(job, settings.coordinates);
        let patch = patch(job, &frame);
        let (blocks, side) = settings.fixed().unwrap_or((2 * FIXED_BLOCKS, STOCK_SIDE));
        let spaces = Space::of(job, patch / frame.scale);
        let luminaires = &job.scene.luminaires;
        let page_job = PageJob {
            case: &job.case,
            procedure: job.procedure.name(),
            page: PAGE.0,
            package: PACKAGES[0],
            imports: BTreeMap::from(IMPORTS),
            transport: dialogue::transport(job),
            reflections: reflections(job),
            stock: settings.preset == Preset::Default,
            lamps: luminaires.iter().enumerate().map(|(k, l)| Lamp::of(k, l).in_frame(&frame)).collect(),
            surfaces: surfaces(job, &frame),
            patch,
            blocks,
            side,
            seed: job.seed,
            sensors: dialogue::placements(job, &frame)
                .zip(spaces)
                .map(|(placement, space)| PatchPlacement { placement, free: space != Space::Tight })
                .collect(),
        };
        let bytes = serde_json::to_vec_pretty(&page_job)
            .map_err(|e| EngineError::output(ID, format!("the job cannot be written: {e}")))?;
        let ours = [
            SceneFile { name: JOB_FILE.to_owned(), bytes },
            SceneFile::text(PAGE.0, PAGE.1),
            SceneFile::text(DRIVER.0, DRIVER.1),
        ];
        let files = luminaires.iter().enumerate();
        let files = files.map(|(k, l)| SceneFile { name: file_name(k), bytes: native(&l.photometry) });
        Ok(ours.into_iter().chain(files).collect())
    }

    fn command_by_hand(&self, _job: &Job, site: &EngineRoot) -> Option<String> {
        Some(command_by_hand(site))
    }

    fn expected_s(&self, job: &Job) -> Option<f64> {
        DirectCost { start: 60.0, a_point: 5e-3, an_opening: None }.of(job)
    }

    fn settings(&self) -> &'static [Setting] {
        SETTINGS
    }

    fn check_settings(&self, job: &Job) -> Result<(), EngineError> {
        Settings::of(job).map(drop)
    }

    /// The estimate covers all of Chromium's processes.
    fn memory_mib(&self, job: &Job, _threads: usize) -> u64 {
        2048 + crate::geometry_mib(job)
    }

    fn start_s(&self) -> f64 {
        START_S
    }

    /// Jobs one after the other share a page, and with it the shader that it compiled.
    fn takes_batches(&self) -> bool {
        true
    }

    fn read(&self, job: &Job, workbench: &JobDir) -> Result<Measurement, EngineError> {
        let settings = Settings::of(job)?;
        workbench.write(&self.export(job)?)?;
        let run = driver(&ID, workbench)?;
        let mut conversation = run.converse(workbench.idle.as_ref())?;
        // The time for sampling begins when its shader is compiled.
        conversation.ask(&serde_json::json!({ "warm": workbench.scene_dir.join(JOB_FILE) }).to_string())?;
        let frame = Frame::of(job, settings.coordinates);
        let patch = patch(job, &frame);
        let is_tight = Space::of(job, patch / frame.scale).into_iter().map(|space| space == Space::Tight);
        // A patch before a surface stands off it, and rays start farther off.
        let offsets = is_tight.map(|is_tight| if is_tight { 1.25 * patch } else { 0.1 * patch }).collect();
        let instrument = Instrument { edge_deg: 0.0, offsets, by_arc_cosine: true };
        let rounding = FloatError::of(job, frame, instrument);
        let dialogue = Dialogue {
            engine: ID,
            job,
            workbench,
            conversation,
            fixed: settings.fixed(),
            until: workbench.until(),
            cost: &|_| Cost { ray_s: RAY_S, trial_side: Some(TRIAL_SIDE) },
            bound_lx: &|k, _| rounding.at_lx(k),
            relative_bound: RELATIVE_ERROR,
            misled: 0.0,
        };
        let mut measurement = dialogue.measurement()?;
        measurement.effort.insert("command".into(), run.command_line());
        measurement.notes.extend(job.written_for_its_reader());
        checked(&ID, job, measurement)
    }
}
