//! A job as a folder of Radiance files that anyone can run by hand; pure.
//!
//! `scene.rad` holds surfaces and luminaires, `luminaire-<n>.dat` the candela tables, `meters.txt` the meters and
//! `run.sh` the commands; luminaires that hide one another are in `luminaires-<n>.rad`, added up scene by scene, and in
//! `reflected-<n>.rad` as they are for reflected light where that is read apart. Formats: Ward and Shakespeare, *Rendering with Radiance* (1998); refman of Radiance 6.

mod luminaires;

use glam::DVec3;
use luminaire::geometry::Surface;
use luminaire::scene::{Obstacle, Shape, Transport};

pub(super) use self::luminaires::{EDGE_DEG, disc_error, ies2rad_options, swallowed, unsupported};
use super::options::{Options, Sources};
use super::settings::Settings;
use super::superposition;
use crate::engines::comment::Comment;
use crate::engines::settings::Coordinates;
use crate::engines::{Job, SceneFile, recess};

/// Lumens a watt, by which Radiance's radiometric quantities are photometric (`WHTEFFICACY` in its sources).
pub(super) const EFFICACY: f64 = 179.0;
/// Weights of red, green and blue in Radiance's luminance (`CIE_rf`, `CIE_gf`, `CIE_bf` in its sources).
pub(super) const WEIGHTS: [f64; 3] = [0.265, 0.670, 0.065];

/// `rtrace -I` reads this far in front of the point it is given, in Radiance's units, whatever the scene's size.
const READ_AHEAD: f64 = 1e-4;

pub(super) fn files(job: &Job, settings: &Settings, options: &Options) -> Vec<SceneFile> {
    let scale = scale(job, settings.coordinates);
    let job = &*recess::apart(job);
    let (scenes, lights) = (superposition::scenes(job, settings), Light::of(job, settings));
    let mut scene = scene_rad(job, scale);
    let mut files = vec![];
    if let ([all], [light]) = (&scenes[..], &lights[..]) {
        scene += &luminaires::rad(job, settings, scale, all, *light);
    } else {
        for light in &lights {
            let rad = |(k, scene): (usize, &Vec<usize>)| {
                let head = format!("# {}\n# Scene {} of {}.\n", title(job), k + 1, scenes.len());
                let text = head + &luminaires::rad(job, settings, scale, scene, *light);
                SceneFile::text(&light.luminaires(k), text)
            };
            files.extend(scenes.iter().enumerate().map(rad));
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

/// What a scene is read for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Light {
    All,
    /// All that does not come straight from a source, where that is an opening.
    Reflected,
}

impl Light {
    /// Those whose scenes differ in a job.
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

    /// The octree of a scene, one of so many.
    pub(super) fn octree(self, scene: usize, scenes: usize) -> String {
        if scenes == 1 { format!("{}.oct", self.name()) } else { format!("{}-{}.oct", self.name(), scene + 1) }
    }

    /// The luminaires of a scene.
    fn luminaires(self, scene: usize) -> String {
        match self {
            Self::All => format!("luminaires-{}.rad", scene + 1),
            Self::Reflected => format!("reflected-{}.rad", scene + 1),
        }
    }

    /// The files that a scene is compiled from, one of so many for all light and reflected.
    pub(super) fn parts(self, scene: usize, of: usize) -> Vec<String> {
        let luminaires = (of > 1).then(|| self.luminaires(scene));
        std::iter::once("scene.rad".to_owned()).chain(luminaires).collect()
    }
}

/// Radiance's units a metre: 1 for ordinary rooms, a power of ten where its absolute tolerances (1e-6) come near.
pub(super) fn scale(job: &Job, coordinates: Coordinates) -> f64 {
    let Some(room) = job.scene.room.filter(|_| coordinates == Coordinates::Fitted) else {
        return 1.0;
    };
    let (least, largest) = (room.size_m.min_element(), room.size_m.max_element());
    if least >= 0.5 && largest <= 1e4 { 1.0 } else { 10_f64.powi((10.0 / largest).log10().round() as i32) }
}

/// The rows that rtrace is given, position and direction: one a station, moved back by what rtrace reads ahead.
pub(super) fn rows(job: &Job, scale: f64) -> Vec<[f64; 6]> {
    let row = |position_m: DVec3, normal: DVec3| {
        let (p, n) = (position_m * scale - READ_AHEAD * normal, normal);
        [p.x, p.y, p.z, n.x, n.y, n.z]
    };
    job.stations.iter().map(|s| row(s.meter.position_m, s.meter.normal)).collect()
}

fn meters_txt(job: &Job, scale: f64) -> String {
    let row = |r: &[f64; 6]| r.map(|x| x.to_string()).join(" ") + "\n";
    rows(job, scale).iter().map(row).collect()
}

fn run_sh(job: &Job, settings: &Settings, options: &Options, scenes: usize) -> String {
    let [r, g, b] = WEIGHTS.map(|w| EFFICACY * w);
    let lux = format!("rcalc -e '$1={r}*$1+{g}*$2+{b}*$3'");
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
    let rtrace = |args: &[String], light: Light, scene: usize| {
        format!("LD_PRELOAD=$CLOCK rtrace -h {} {} < meters.txt | {lux}", args.join(" "), light.octree(scene, scenes))
    };
    // Prints the light of all scenes, or writes it into a file.
    let read = |args: &[String], light: Light, name: &str, into: &str| {
        if scenes == 1 {
            return format!("{}{into}\n", rtrace(args, light, 0));
        }
        let files: Vec<String> = (1..=scenes).map(|scene| format!("{name}-{scene}.txt")).collect();
        let each = files.iter().enumerate().map(|(scene, file)| format!("{} > {file}\n", rtrace(args, light, scene)));
        let sum: Vec<String> = (1..=scenes).map(|scene| format!("${scene}")).collect();
        each.collect::<String>() + &format!("rlam {} | rcalc -e '$1={}'{into}\n", files.join(" "), sum.join("+"))
    };
    match (job.transport, &options.part_of_total) {
        (Transport::Direct, _) => text += &read(&options.direct, Light::All, "direct", ""),
        (Transport::Total(_), Some(_)) => text += &read(&options.total, Light::All, "total", ""),
        (Transport::Indirect(_), Some(part)) => {
            text += "# Indirect light is all light less the direct.\n";
            text += &read(part, Light::All, "direct", " > direct.txt");
            text += &read(&options.total, Light::All, "total", " > total.txt");
            text += "rlam total.txt direct.txt | rcalc -e '$1=$1-$2'\n";
        }
        (Transport::Indirect(_), None) => text += &read(&options.total, Light::Reflected, "reflected", ""),
        (Transport::Total(_), None) => {
            text += &read(&options.direct, Light::All, "direct", " > direct.txt");
            text += &read(&options.total, Light::Reflected, "reflected", " > reflected.txt");
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

/// The six faces of a box, counter-clockwise seen from outside.
fn box_faces(min: DVec3, max: DVec3) -> Vec<Vec<DVec3>> {
    let face = |axis: usize, far: bool| {
        let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
        let corner = |at_u: f64, at_v: f64| {
            let mut p = if far { max } else { min };
            p[u] = at_u;
            p[v] = at_v;
            p
        };
        let mut corners =
            vec![corner(min[u], min[v]), corner(max[u], min[v]), corner(max[u], max[v]), corner(min[u], max[v])];
        if !far {
            corners.reverse();
        }
        corners
    };
    (0..3).flat_map(|axis| [face(axis, false), face(axis, true)]).collect()
}
