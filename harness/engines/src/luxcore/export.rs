//! A job as a folder of LuxCore files that anyone can run by hand; pure.
//!
//! `scene.scn` holds surfaces and luminaires, `render.cfg` how it is rendered; `job.json` holds the meters, which are no part of either.

use std::borrow::Cow;
use std::fmt::Write;

use glam::{BVec3, DMat3, DVec3};
use luxproof_scene::geometry::Surface;
use luxproof_scene::{Luminaire, Shape};

use super::ID;
use super::map::Map;
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

const READ: &str = include_str!("../../drivers/luxcore_read.py");

/// So far rays start off a surface, in parts of a meter's side: four times what 32-bit floats resolve there at least.
const CLEAR: f64 = 0.1;
/// Corners of what stands for an ellipse, of its area: all moments of second order are off by 2e-6 of them.
const CORNERS: usize = 64;

pub(super) fn files(job: &Job, settings: Settings) -> Result<Vec<SceneFile>, EngineError> {
    let frame = Frame::of(job, settings.coordinates);
    let job = &*recess::behind_luminaires(job, super::PACKAGE.apart);
    let job = &*shining(job);
    let tables = Tables::of(job);
    let mapped = tables.distinct.iter().filter(|_| !settings.has_plain_tables());
    let maps: Vec<Map> = mapped.map(|d| Map::of(d)).collect();
    let scene = Scene { job, settings, frame, tables: &tables, maps: &maps };
    let mut files = vec![
        SceneFile::text("scene.scn", scene.text()),
        SceneFile::text("render.cfg", render_cfg(job, settings, &frame)),
        patches::job_json(ID, job, settings, &frame, job.scene.luminaires.len(), vec![])?,
        SceneFile::text("luxcore_read.py", READ),
        SceneFile::text("blocks.py", dialogue::BLOCKS),
    ];
    files.extend(meshes::files(job, &frame, Mesh::Ply));
    files.extend(maps.iter().enumerate().map(|(k, map)| map.file(&map_name(k))));
    if settings.has_plain_tables() {
        files.extend(patches::plain_files(job, settings, &tables, ies_name));
    }
    Ok(files)
}

/// Without luminaires that are off beside others: LuxCore 2.11 crashes (SIGSEGV) where one whose material emits nothing is the last of several to be read.
fn shining(job: &Job) -> Cow<'_, Job> {
    let all = &job.scene.luminaires;
    let on = all.iter().filter(|l| l.is_on()).count();
    if on == 0 || on == all.len() {
        return Cow::Borrowed(job);
    }
    let mut job = job.clone();
    job.scene.luminaires.retain(Luminaire::is_on);
    Cow::Owned(job)
}

fn map_name(k: usize) -> String {
    format!("table-{k}.pfm")
}

fn ies_name(k: usize) -> String {
    format!("table-{k}.ies")
}

fn header(job: &Job, what: &str) -> String {
    format!(
        "# {case}: {procedure}.\n# {what}\n\
         # For LuxCore 2.11 (Python package pyluxcore); read the meters of job.json with\n\
         #     python luxcore_read.py job.json\n",
        case = Comment(&job.case),
        procedure = job.procedure,
    )
}

/// How it is rendered: in tiles of one pass, the one engine of LuxCore whose samples no clock counts.
fn render_cfg(job: &Job, settings: Settings, frame: &Frame) -> String {
    let mut text = header(
        job,
        "How it is rendered: pyluxcore.RenderConfig(pyluxcore.Properties(\"render.cfg\")) makes a picture of it as it is.",
    );
    text += "scene.file = scene.scn\n\
             film.width = 480\nfilm.height = 360\nfilm.filter.type = NONE\n\
             renderengine.type = TILEPATHCPU\nsampler.type = TILEPATHSAMPLER\n\
             native.threads.count = 1\ntile.multipass.enable = 0\n";
    if settings.preset == Preset::Default {
        return text;
    }
    // A path's length counts its first leg, from the camera to the meter, and its last, to the luminaire: read with limits of 1, 2 and 7.
    let (clear, reflections) = (CLEAR * patches::placement::patch(job, frame, settings.preset), reflections(job));
    let depth = reflections + 2;
    write!(
        text,
        "# Where rays start: what 32-bit floats resolve here.\n\
         scene.epsilon.min = {clear}\nscene.epsilon.max = {clear}\n\
         # {reflections} reflections. Russian roulette by the reflectance alone loses nothing, clamping would.\n\
         path.pathdepth.total = {depth}\npath.pathdepth.diffuse = {depth}\n\
         path.russianroulette.depth = 3\npath.russianroulette.cap = 0.01\n\
         path.clamping.variance.maxvalue = 0\n\
         lightstrategy.type = POWER\n",
    )
    .ok();
    text
}

struct Scene<'a> {
    job: &'a Job,
    settings: Settings,
    frame: Frame,
    tables: &'a Tables<'a>,
    maps: &'a [Map],
}

impl Scene<'_> {
    fn text(&self) -> String {
        let mut text = header(self.job, "Surfaces and luminaires.");
        text += "# Metres, candela and lux: illuminance is pi times the radiance of a white surface. z is up.\n";
        for line in self.frame.remark().iter().flat_map(|remark| remark.lines()) {
            writeln!(text, "# {line}").ok();
        }
        text += &self.camera();
        for (room, surface) in self.job.scene.room.iter().flat_map(|room| Surface::ALL.map(|s| (room, s))) {
            let corners =
                recess::corners_m(self.job, room, surface, super::PACKAGE.apart).map(|c| self.frame.to_scene(c));
            let name = surface.name().replace(' ', "_").replace('-', "_min").replace('+', "_max");
            quads(&mut text, &name, room.reflectance.of(surface), &[corners]);
        }
        for (k, obstacle) in self.job.scene.obstacles.iter().enumerate() {
            let name = format!("obstacle{k}");
            match &obstacle.shape {
                Shape::Box { min_m, max_m } => {
                    let [low, high] = [min_m, max_m].map(|p| self.frame.to_scene(*p));
                    quads(&mut text, &name, obstacle.reflectance, &sides(low, high));
                }
                Shape::Mesh { .. } => {
                    matte(&mut text, &name, obstacle.reflectance);
                    writeln!(text, "scene.objects.{name}.ply = {}", meshes::name(k, Mesh::Ply)).ok();
                }
            }
        }
        for (k, luminaire) in self.job.scene.luminaires.iter().enumerate() {
            writeln!(text, "\n# {}", Comment(&luminaire.id)).ok();
            match Opening::of(luminaire) {
                Opening::Flat(outline, size_m) => self.area(&mut text, k, luminaire, outline, size_m),
                Opening::None | Opening::Solid => self.point(&mut text, k, luminaire),
            }
        }
        text
    }

    /// For a look: from a corner of the room to its middle, or from where a free scene is seen.
    fn camera(&self) -> String {
        let (from, to) = match self.job.scene.room {
            Some(room) => (room.size_m * DVec3::new(0.02, 0.02, 0.6), room.size_m * 0.5),
            None => (DVec3::new(3.0, 3.0, 2.0), DVec3::ZERO),
        };
        let [from, to] = [from, to].map(|p| point(self.frame.to_scene(p)));
        format!(
            "\nscene.camera.type = perspective\nscene.camera.lookat.orig = {from}\nscene.camera.lookat.target = {to}\nscene.camera.fieldofview = 80\n"
        )
    }

    /// A point light with an emission map; LuxCore divides its power by 4 pi times the flux of the map.
    fn point(&self, text: &mut String, k: usize, luminaire: &Luminaire) {
        let (of, light) = (self.tables.of_luminaire[k], format!("scene.lights.luminaire{k}"));
        let scale = luminaire.flux_scale * self.frame.scale * self.frame.scale;
        let four_pi = 4.0 * std::f64::consts::PI;
        let (map, turned_deg, power) = if self.settings.has_plain_tables() {
            let flux = luminaire.photometry.distribution.flux().value();
            // A user of its defaults takes the power for lumens.
            let of_lumen = if self.settings.preset == Preset::Default { 1.0 } else { four_pi };
            (format!("{light}.iesfile = {}\n{light}.flipz = 1\n", ies_name(of)), 0.0, of_lumen * scale * flux)
        } else {
            let map = &self.maps[of];
            let file = format!("{light}.mapfile = {}\n{light}.gamma = 1\n{light}.wrap = clamp\n", map_name(of));
            (file, map.turned_deg(), four_pi * scale * map.flux_lm())
        };
        let axes = turned(luminaire.orientation, turned_deg);
        let placed = self.frame.placed(luminaire.position_m, axes);
        // By columns.
        let matrix: Vec<String> = (0..4).flat_map(|column| placed.map(|row| plain(row[column]).to_string())).collect();
        write!(
            text,
            "{light}.type = mappoint\n{map}{light}.transformation = {}\n{light}.power = {power}\n{light}.efficiency = 1\n",
            matrix.join(" ")
        )
        .ok();
        // Without power it takes the map as it is.
        if power == 0.0 {
            writeln!(text, "{light}.gain = 0 0 0").ok();
        }
    }

    /// An opening whose every point sends out its part of the map's intensities on both sides: LuxCore divides them by the flux of the
    /// map. Its material stops no ray, and no reflected path may hit it, since that would count a cosine that is in them already.
    fn area(&self, text: &mut String, k: usize, luminaire: &Luminaire, outline: Outline, size_m: [f64; 2]) {
        let (of, name) = (self.tables.of_luminaire[k], format!("luminaire{k}"));
        let map = &self.maps[of];
        let [x, y] = size_m.map(|s| 0.5 * s * self.frame.scale);
        let (corners, faces) = match outline {
            Outline::Rectangle => (vec![[-x, -y], [x, -y], [x, y], [-x, y]], vec![[0, 1, 2], [0, 2, 3]]),
            Outline::Ellipse => polygon(x, y),
        };
        let area: f64 = faces.iter().map(|f| area_of(f.map(|i| corners[i]))).sum();
        let scale = luminaire.flux_scale * self.frame.scale * self.frame.scale;
        let radiance = scale * map.flux_lm() / area;
        let at = self.frame.to_scene(luminaire.position_m);
        let placed: Vec<DVec3> =
            corners.iter().map(|[x, y]| at + luminaire.orientation * DVec3::new(*x, *y, 0.0)).collect();
        // The map's azimuth is counted from where u grows.
        let axes = turned(DMat3::IDENTITY, map.turned_deg()).transpose();
        let own = corners.iter().map(|[x, y]| axes * DVec3::new(*x, *y, 0.0));
        let uvs = own.map(|own| format!("{} {}", plain(own.x), plain(own.y))).collect::<Vec<_>>().join(" ");
        let material = format!("scene.materials.{name}");
        write!(
            text,
            "{material}.type = matte\n{material}.kd = 0 0 0\n{material}.transparency = 0\n{material}.emission = {radiance} {radiance} {radiance}\n\
             {material}.emission.mapfile = {file}\n{material}.emission.gamma = 1\n{material}.emission.wrap = clamp\n\
             {material}.visibility.indirect.diffuse.enable = 0\n",
            file = map_name(of),
        )
        .ok();
        let normal = point(luminaire.orientation.z_axis);
        mesh(text, &name, &placed, &faces);
        let normals = vec![normal; corners.len()].join(" ");
        writeln!(text, "scene.objects.{name}.normals = {normals}\nscene.objects.{name}.uvs = {uvs}").ok();
    }
}

/// Axes turned about their own z axis.
fn turned(axes: DMat3, degrees: f64) -> DMat3 {
    axes * DMat3::from_rotation_z(degrees.to_radians())
}

/// The corners of a polygon about an ellipse's middle, which is the last, and its triangles.
fn polygon(x: f64, y: f64) -> (Vec<[f64; 2]>, Vec<[usize; 3]>) {
    let step = 2.0 * std::f64::consts::PI / CORNERS as f64;
    let of_its_area = (step / step.sin()).sqrt();
    let directions = (0..CORNERS).map(|k| (k as f64 * step).sin_cos());
    let corners = directions.map(|(sine, cosine)| [x * of_its_area * cosine, y * of_its_area * sine]);
    (corners.chain([[0.0, 0.0]]).collect(), (0..CORNERS).map(|k| [CORNERS, k, (k + 1) % CORNERS]).collect())
}

fn area_of([a, b, c]: [[f64; 2]; 3]) -> f64 {
    0.5 * ((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])).abs()
}

/// The six sides of a box.
fn sides(low: DVec3, high: DVec3) -> [[DVec3; 4]; 6] {
    let corners =
        [0, 1, 2, 3, 4, 5, 6, 7].map(|k: u32| DVec3::select(BVec3::new(k & 1 > 0, k & 2 > 0, k & 4 > 0), high, low));
    [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]]
        .map(|side| side.map(|k: usize| corners[k]))
}

fn matte(text: &mut String, name: &str, reflectance: f64) {
    write!(
        text,
        "\nscene.materials.{name}.type = matte\nscene.materials.{name}.kd = {reflectance} {reflectance} {reflectance}\n\
         scene.objects.{name}.material = {name}\n"
    )
    .ok();
}

fn quads(text: &mut String, name: &str, reflectance: f64, quads: &[[DVec3; 4]]) {
    matte(text, name, reflectance);
    let faces: Vec<[usize; 3]> =
        (0..quads.len()).map(|k| 4 * k).flat_map(|k| [[k, k + 1, k + 2], [k, k + 2, k + 3]]).collect();
    vertices_and_faces(text, name, quads.as_flattened(), &faces);
}

fn mesh(text: &mut String, name: &str, vertices: &[DVec3], faces: &[[usize; 3]]) {
    writeln!(text, "scene.objects.{name}.material = {name}").ok();
    vertices_and_faces(text, name, vertices, faces);
}

fn vertices_and_faces(text: &mut String, name: &str, vertices: &[DVec3], faces: &[[usize; 3]]) {
    let vertices = vertices.iter().map(|v| point(*v)).collect::<Vec<_>>().join(" ");
    let faces = faces.as_flattened().iter().map(ToString::to_string).collect::<Vec<_>>().join(" ");
    writeln!(text, "scene.objects.{name}.vertices = {vertices}\nscene.objects.{name}.faces = {faces}").ok();
}

fn point(p: DVec3) -> String {
    p.to_array().map(|v| plain(v).to_string()).join(" ")
}
