//! The export of a job as a folder of Radiance files that a user can run by hand. It is a pure function.
//!
//! `scene.rad` has surfaces and luminaires, `luminaire-<n>.dat` the candela tables, `meters.txt` the meters and `run.sh` the commands.
//! Luminaires that hide each other are in `luminaires-<n>.rad`, and the scenes' readings are added. If a job reads reflected light
//! separately, `reflected-<n>.rad` has the luminaires for it.
//!
//! Formats: Ward and Shakespeare, *Rendering with Radiance* (1998); refman of Radiance 6.

mod luminaires;

use glam::DVec3;
use luxproof_scene::geometry::Surface;
use luxproof_scene::{Obstacle, Shape, Transport};

pub(super) use self::luminaires::{EDGE_DEG, disc_error, ies2rad_options, swallowed, unsupported};
use super::options::{Options, Sources};
use super::settings::Settings;
use super::superposition;
use crate::comment::Comment;
use crate::settings::Coordinates;
use crate::{Job, SceneFile, recess};

/// Lumens per watt, which convert Radiance's radiometric quantities to photometric ones (`WHTEFFICACY` in its sources).
pub(super) const EFFICACY: f64 = 179.0;
/// Weights of red, green and blue in Radiance's luminance (`CIE_rf`, `CIE_gf`, `CIE_bf` in its sources).
pub(super) const WEIGHTS: [f64; 3] = [0.265, 0.670, 0.065];

/// `rtrace -I` reads this far in front of the given point, in Radiance's units, whatever the scene's size.
const READ_AHEAD: f64 = 1e-4;

/// Returns all files of the export.
pub(super) fn files(job: &Job, settings: &Settings, options: &Options) -> Vec<SceneFile> {
    let scale = scale(job, settings.coordinates);
    let job = &*recess::separate(job);
    let (scenes, lights) = (superposition::scenes(job, settings), Light::of(job, settings));
    let mut scene = scene_rad(job, scale);
    let mut files = vec![];
    if let ([all], [light]) = (&scenes[..], &lights[..]) {
        scene += &luminaires::rad(job, settings, scale, all, *light);
    } else {
        for light in &lights {
            for (k, scene) in scenes.iter().enumerate() {
                let head = format!("# {}\n# Scene {} of {}.\n", title(job), k + 1, scenes.len());
                let text = head + &luminaires::rad(job, settings, scale, scene, *light);
                files.push(SceneFile::text(&light.luminaires(k), text));
            }
        }
    }
    files.extend([
        SceneFile::text("scene.rad", scene),
        SceneFile::text("meters.txt", meters_txt(job, scale)),
        SceneFile::text("run.sh", run_sh(job, settings, options, scenes.len())),
    ]);
    files.extend(luminaires::files(job, settings));
    files
}

/// The part of the light that a scene is read for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Light {
    All,
    /// Light that does not come straight from an opening.
    Reflected,
}

impl Light {
    /// Returns the parts of the light that need different scenes in a job.
    pub(super) fn of(job: &Job, settings: &Settings) -> Vec<Self> {
        match job.transport {
            Transport::Direct => vec![Self::All],
            _ if Sources::of(job, settings) != Sources::Openings => vec![Self::All],
            Transport::Indirect(_) => vec![Self::Reflected],
            Transport::Total(_) => vec![Self::All, Self::Reflected],
        }
    }

    fn name(self) -> &'static str {
        match self {
            Self::All => "scene",
            Self::Reflected => "reflected",
        }
    }

    /// Returns the file of a scene's octree, for one of `scenes` scenes.
    pub(super) fn octree(self, scene: usize, scenes: usize) -> String {
        if scenes == 1 { format!("{}.oct", self.name()) } else { format!("{}-{}.oct", self.name(), scene + 1) }
    }

    /// Returns the file of a scene's luminaires.
    fn luminaires(self, scene: usize) -> String {
        match self {
            Self::All => format!("luminaires-{}.rad", scene + 1),
            Self::Reflected => format!("reflected-{}.rad", scene + 1),
        }
    }

    /// Returns the files that a scene is compiled from, for one of `scenes` scenes of all parts of the light.
    pub(super) fn parts(self, scene: usize, scenes: usize) -> Vec<String> {
        let luminaires = (scenes > 1).then(|| self.luminaires(scene));
        std::iter::once("scene.rad".to_owned()).chain(luminaires).collect()
    }
}

/// Returns Radiance's units per metre: 1 for ordinary rooms, else a power of ten that makes its absolute tolerances (1e-6) negligible.
pub(super) fn scale(job: &Job, coordinates: Coordinates) -> f64 {
    let Some(room) = job.scene.room.filter(|_| coordinates == Coordinates::Fitted) else {
        return 1.0;
    };
    let (least, largest) = (room.size_m.min_element(), room.size_m.max_element());
    if least >= 0.5 && largest <= 1e4 { 1.0 } else { 10_f64.powi((10.0 / largest).log10().round() as i32) }
}

/// Returns rtrace's input rows of position and direction, one per sensor. Each is moved back by the distance that rtrace reads ahead.
pub(super) fn rows(job: &Job, scale: f64) -> Vec<[f64; 6]> {
    let mut rows = vec![];
    for sensor in &job.sensors {
        let n = sensor.meter.normal;
        let p = sensor.meter.position_m * scale - READ_AHEAD * n;
        rows.push([p.x, p.y, p.z, n.x, n.y, n.z]);
    }
    rows
}

fn meters_txt(job: &Job, scale: f64) -> String {
    rows(job, scale).iter().map(|row| row.map(|x| x.to_string()).join(" ") + "\n").collect()
}

/// Returns the command that converts Radiance's radiances to lux.
fn lux_command() -> String {
    let [r, g, b] = WEIGHTS.map(|w| EFFICACY * w);
    format!("rcalc -e '$1={r}*$1+{g}*$2+{b}*$3'")
}

/// Returns the command that prints the readings of one scene in lux.
fn rtrace_command(args: &[String], light: Light, scene: usize, scenes: usize) -> String {
    let (args, octree, lux) = (args.join(" "), light.octree(scene, scenes), lux_command());
    format!("LD_PRELOAD=$CLOCK rtrace -h {args} {octree} < meters.txt | {lux}")
}

/// One reading of `run.sh`: rtrace's arguments, the light, and the name of its files.
struct Reading<'a> {
    args: &'a [String],
    light: Light,
    name: &'a str,
}

impl Reading<'_> {
    /// Returns the commands that print the sum over all scenes, or write it into a file with `into`, a shell redirection.
    fn commands(&self, scenes: usize, into: &str) -> String {
        if scenes == 1 {
            return format!("{}{into}\n", rtrace_command(self.args, self.light, 0, scenes));
        }
        let files: Vec<String> = (1..=scenes).map(|scene| format!("{}-{scene}.txt", self.name)).collect();
        let mut commands = String::new();
        for (scene, file) in files.iter().enumerate() {
            commands += &format!("{} > {file}\n", rtrace_command(self.args, self.light, scene, scenes));
        }
        let sum: Vec<String> = (1..=scenes).map(|scene| format!("${scene}")).collect();
        commands + &format!("rlam {} | rcalc -e '$1={}'{into}\n", files.join(" "), sum.join("+"))
    }
}

/// Returns the shell script that reads the job by hand.
fn run_sh(job: &Job, settings: &Settings, options: &Options, scenes: usize) -> String {
    let mut text = format!(
        "#!/bin/sh\n# {}\n# Prints the illuminance in lux at each line of meters.txt.\n\
         # RAYPATH must name Radiance's library (for source.cal), CLOCK libfaketime, where rtrace is to start at a seed.\nset -e\n\
         export RAYPATH=.:${{RAYPATH:-/usr/local/lib/ray}}\n",
        title(job)
    );
    text += &luminaires::commands(job, settings);
    if scenes > 1 {
        text += "# Rays towards one illum end on the front of another: luminaires that hide one another are read apart and added up.\n";
    }
    let lights = Light::of(job, settings);
    for (light, scene) in lights.iter().flat_map(|light| (0..scenes).map(move |scene| (light, scene))) {
        let parts = light.parts(scene, scenes * lights.len()).join(" ");
        text += &format!("oconv -f {parts} > {}\n", light.octree(scene, scenes));
    }
    let direct = Reading { args: &options.direct, light: Light::All, name: "direct" };
    let total = Reading { args: &options.total, light: Light::All, name: "total" };
    let reflected = Reading { args: &options.total, light: Light::Reflected, name: "reflected" };
    match (job.transport, &options.part_of_total) {
        (Transport::Direct, _) => text += &direct.commands(scenes, ""),
        (Transport::Total(_), Some(_)) => text += &total.commands(scenes, ""),
        (Transport::Indirect(_), Some(part)) => {
            let direct_part = Reading { args: part, ..direct };
            text += "# Indirect light is all light less the direct.\n";
            text += &direct_part.commands(scenes, " > direct.txt");
            text += &total.commands(scenes, " > total.txt");
            text += "rlam total.txt direct.txt | rcalc -e '$1=$1-$2'\n";
        }
        (Transport::Indirect(_), None) => text += &reflected.commands(scenes, ""),
        (Transport::Total(_), None) => {
            text += &direct.commands(scenes, " > direct.txt");
            text += &reflected.commands(scenes, " > reflected.txt");
            text += "rlam direct.txt reflected.txt | rcalc -e '$1=$1+$2'\n";
        }
    }
    text
}

fn title(job: &Job) -> String {
    format!("luxproof: case {}, procedure {}", Comment(&job.case), job.procedure)
}

fn scene_rad(job: &Job, scale: f64) -> String {
    let mut text = format!("# {}\n# Run by hand: sh run.sh. Units: ", title(job));
    text += &if scale == 1.0 { "metres.\n".to_owned() } else { format!("{scale} to the metre.\n") };
    if let Some(room) = &job.scene.room {
        text += "\n# The room: six diffuse surfaces, each polygon counter-clockwise seen from inside.\n";
        for surface in Surface::ALL {
            let name = surface.name().replace(' ', "_");
            text += &diffuse(&name, room.reflectance.of(surface));
            text += &polygon(&name, &format!("{name}_surface"), &room.corners(surface).map(|p| p * scale));
        }
    }
    for (k, obstacle) in job.scene.obstacles.iter().enumerate() {
        text += &format!("\n# Obstacle {k}.\n");
        text += &obstacle_rad(k, obstacle, scale);
    }
    text
}

fn diffuse(name: &str, reflectance: f64) -> String {
    format!("void plastic {name}\n0\n0\n5 {reflectance} {reflectance} {reflectance} 0 0\n")
}

fn polygon(modifier: &str, name: &str, corners: &[DVec3]) -> String {
    let mut text = format!("{modifier} polygon {name}\n0\n0\n{}\n", 3 * corners.len());
    for p in corners {
        text += &format!("    {} {} {}\n", p.x, p.y, p.z);
    }
    text
}

fn obstacle_rad(k: usize, obstacle: &Obstacle, scale: f64) -> String {
    let material = format!("obstacle-{k}");
    let mut text = diffuse(&material, obstacle.reflectance);
    let faces: Vec<Vec<DVec3>> = match &obstacle.shape {
        Shape::Box { min_m, max_m } => box_faces(*min_m, *max_m),
        Shape::Mesh { vertices_m, triangles } => {
            triangles.iter().map(|t| t.map(|v| vertices_m[v as usize]).to_vec()).collect()
        }
    };
    for (f, face) in faces.iter().enumerate() {
        let corners: Vec<DVec3> = face.iter().map(|p| *p * scale).collect();
        text += &polygon(&material, &format!("{material}-{f}"), &corners);
    }
    text
}

/// Returns the six faces of a box, counter-clockwise seen from outside.
fn box_faces(min: DVec3, max: DVec3) -> Vec<Vec<DVec3>> {
    (0..3).flat_map(|axis| [box_face(min, max, axis, false), box_face(min, max, axis, true)]).collect()
}

/// Returns the face of a box across an axis, counter-clockwise seen from outside.
fn box_face(min: DVec3, max: DVec3, axis: usize, is_far: bool) -> Vec<DVec3> {
    let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
    let mut corners = vec![];
    for (at_u, at_v) in [(min[u], min[v]), (max[u], min[v]), (max[u], max[v]), (min[u], max[v])] {
        let mut corner = if is_far { max } else { min };
        corner[u] = at_u;
        corner[v] = at_v;
        corners.push(corner);
    }
    if !is_far {
        corners.reverse();
    }
    corners
}
