//! A job as a POV-Ray scene: pure, commented, and runnable by hand with the command at its top.
//!
//! Light is in photometric units: a white diffuse surface (`pigment {rgb 1} finish {diffuse 1}`) that receives E lux shows
//! E, since POV-Ray drops pi from both sides; a light of `rgb I/(2 F^2)` with `fade_distance F` and `fade_power 2` gives
//! I / (F^2 + d^2) lux at d metres (POV-Ray 3.7 reference, 2.5.10.8).

use std::fmt::Write;

use glam::DVec3;
use itertools::Itertools;
use luxproof_photometry::LuminousIntensityDistribution;
use luxproof_scene::geometry::Surface;
use luxproof_scene::{Luminaire, LuminaireModel, Obstacle, Shape, Transport};

use crate::comment::Comment;
use crate::effort;
use crate::{Job, SceneFile, recess};

use super::frame::{Frame, candela, disc_positions};
use super::opening::{self, FILTER_RADIUS, Part};
use super::pigment;
use super::pixels::Readout;
use super::settings::{self, MAX_BLANKS, Settings, Term};

pub(super) const SCENE: &str = "scene.pov";

/// Points along each side of a luminous opening for indirect light, which does not see the difference.
const POINTS_INDIRECT: usize = 2;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Light {
    Direct,
    Indirect,
}

/// With so many point lights along each side of an opening.
pub(super) fn scene(job: &Job, settings: &Settings, points: usize) -> SceneFile {
    let frame = Frame::of(job, settings.coordinates);
    let job = &*recess::points_apart(job);
    let mut text = head(job, settings, frame);
    text.push_str(&meters(job, frame));
    text.push_str(&luminaires(job, frame, points));
    text.push_str(&surroundings(job, frame));
    SceneFile::text(SCENE, text)
}

/// The arguments of one run, without the program: `light`, `seed` and `blanks` choose what the scene shows.
pub(super) fn arguments(job: &Job, light: Light, seed: u32, blanks: usize, image: &str) -> Vec<String> {
    let (width, indirect) = (blanks + job.sensors.len(), u8::from(light == Light::Indirect));
    let arguments = format!(
        "+I{SCENE} +O{image} +FP16 File_Gamma=1.0 +W{width} +H1 -A -D +WT1 -GD -GR Declare=Indirect={indirect} \
         Declare=Seed={seed} Declare=Blanks={blanks}"
    );
    arguments.split(' ').map(str::to_owned).collect()
}

/// Blank pixels before the meters': they move the start of radiosity's sequence of directions, which has so many parts.
///
/// POV-Ray takes one part of the sequence after the other, always from its beginning. Without blanks the first meter had
/// the same few hundred inclinations in every block, however the scene was turned, and their error did not average out:
/// up to 2 % at a count of 100.
pub(super) fn blanks(seed: u32, parts: u32) -> usize {
    // Fibonacci hashing (Knuth, The Art of Computer Programming, vol. 3, 6.4): unlike the turn of the scene by the same seed.
    let spread = f64::from(seed.wrapping_mul(2_654_435_769)) / 2_f64.powi(32);
    1 + (spread * f64::from(parts.clamp(1, MAX_BLANKS))) as usize
}

/// What a scene's discs show where no other read-out is given to them.
pub(super) fn first_readouts(job: &Job, part: Light) -> Vec<Readout> {
    job.sensors.iter().map(|s| Readout::Coarse(upper_bound_lx(job, s.meter.position_m, part))).collect()
}

/// The file that gives every disc its read-out, included where it is asked for with `Declare=Readouts=1`.
pub(super) fn readouts(readouts: &[Readout], light: f64) -> String {
    let entries: Vec<String> = readouts.iter().map(|readout| entry(readout, light)).collect();
    format!("#declare Readout = array[{}] {{\n  {}\n}};\n", entries.len(), entries.join(",\n  "))
}

/// The scale of a disc, and whether its read-out is fine.
fn entry(readout: &Readout, light: f64) -> String {
    match readout {
        Readout::Coarse(scale) => format!("<{:e}, 0>", light * scale),
        Readout::Fine(expected) => format!("<{:e}, 1>", light * expected),
    }
}

/// No more than a few times the illuminance to be expected: where it is wrong, a second run finds out.
fn upper_bound_lx(job: &Job, at_m: DVec3, part: Light) -> f64 {
    let bound: f64 = if let (Light::Indirect, Some(room)) = (part, job.scene.room) {
        let area: f64 = Surface::ALL.iter().map(|&s| room.area_m2(s)).sum();
        let mean = effort::mean_reflectance(&room);
        let fluxes = job.scene.luminaires.iter().map(|l| l.photometry.distribution.flux().value() * l.flux_scale);
        8.0 * fluxes.sum::<f64>() / area * mean / (1.0 - mean).max(0.01)
    } else {
        let luminaires = job.scene.luminaires.iter();
        luminaires.map(|l| candela(l) / l.position_m.distance_squared(at_m).max(1e-6)).sum()
    };
    if bound > 0.0 { bound } else { 1.0 }
}

fn head(job: &Job, settings: &Settings, frame: Frame) -> String {
    let count = job.sensors.len();
    let (part, what) = match job.transport {
        Transport::Direct => (Light::Direct, "direct light"),
        Transport::Indirect(_) => (Light::Indirect, "reflected light"),
        Transport::Total(_) => {
            (Light::Direct, "direct light (Indirect=0) and reflected light (Indirect=1), to be added")
        }
    };
    let (case, procedure) = (Comment(&job.case), job.procedure);
    let arguments = arguments(job, part, 0, 0, "scene.ppm").join(" ");
    let (unit_m, origin_m, indirect) = (1.0 / frame.scale, vector(frame.centre_m), u8::from(part == Light::Indirect));
    let light = if (frame.light - 1.0).abs() > f64::EPSILON {
        let light = frame.light;
        format!("// All light, and the illuminances that pixels stand for, are {light:e} times those of the spec.\n")
    } else {
        String::new()
    };
    let (limit, radiosity) = job.reflections().map_or(Default::default(), |bounces| {
        let limit = settings.recursion_limit(bounces);
        let mut limit = format!("#ifndef (Limit) #declare Limit = {limit}; #end\n");
        if settings.is_finer_for_rest() {
            limit.push_str(&format!(
                "// How far samples are used again; less of what is reflected more than twice, since POV-Ray doubles it with every reflection.\n\
                 #declare ErrorBound = {};\n",
                settings.error_bound
            ));
        }
        limit.push_str(&block(&settings.terms(bounces), settings));
        (limit, format!("  #if (Indirect) {} #end\n", settings.radiosity(bounces)))
    });
    let (rays, brightness, pool) = (settings.count, settings.brightness, settings::declared_pool());
    // A ray to one of many discs at one point passes the transparent backs of half of the others.
    format!(
        "// {case}, {procedure}: illuminance at {count} meters, {what}.\n// Run: povray {arguments}\n\
         // One pixel a meter. With x = E / scale of the meter (below): red .25 + x/2, green 16 x, blue 256 x, linear.\n\
         // Seed > 0 turns the whole scene, and Blanks > 0 sets as many pixels (add them to +W) before the meters': either\n\
         // gives radiosity other sample directions and changes nothing else.\n\
         // Scene units are {unit_m} m; the origin is at {origin_m} m of the spec.\n\
         {light}#version 3.7;\n\
         #ifndef (Indirect) #declare Indirect = {indirect}; #end\n\
         #ifndef (Seed) #declare Seed = 0; #end\n#ifndef (Blanks) #declare Blanks = 0; #end\n\n\
         // Reflectances divided and lights multiplied by Brightness carry the same light, and keep the weight of rays above\n\
         // .25, below which POV-Ray would loosen error_bound by up to .25.\n\
         // Rays a sample, reflections, and the length of the pool that rays come from; Limit=1 reads the first reflection alone.\n\
         #ifndef (Count) #declare Count = {rays}; #end\n\
         {limit}{pool}#declare Brightness = #if (Indirect) {brightness}; #else 1; #end\n\
         global_settings {{\n  assumed_gamma 1.0 max_trace_level 100 adc_bailout 1e-9\n{radiosity}}}\n\n{TURN}"
    )
}

/// The terms of a block: one as it is, or several as frames of an animation.
fn block(terms: &[Term], settings: &Settings) -> String {
    let signs: String = terms.iter().map(|term| if term.sign < 0.0 { " -" } else { " +" }).collect();
    let declared = terms.iter().map(|term| declarations(term, settings)).collect_vec();
    let cases = declared.iter().zip(1..).map(|(text, k)| format!("  #case ({k}) {text} #break\n")).join("");
    match terms {
        [Term { limit: None, .. }] | [] => String::new(),
        [_] => format!("// With Block=1 there are the rays of a block.\n#ifdef (Block) {} #end\n", declared[0]),
        [_, ..] => format!(
            "// With Block=1 +KFI1 +KFF{} the frames, added with the signs{signs}, are all light, of which what is reflected once and\n\
             // twice has more rays.\n#ifdef (Block) #switch (frame_number)\n{cases}#end #end\n",
            terms.len()
        ),
    }
}

/// What a term declares in place of the scene's own numbers.
fn declarations(term: &Term, settings: &Settings) -> String {
    let limit = term.limit.map(|limit| format!(" #declare Limit = {limit};")).unwrap_or_default();
    let finer = term.is_rest && settings.is_finer_for_rest();
    let bound = if finer { format!(" #declare ErrorBound = {};", settings.error_bound_of_rest) } else { String::new() };
    format!("#declare Count = {}*Count;{limit}{bound}", term.times)
}

const TURN: &str = "#declare S = seed(Seed);
#declare Turn = transform {
  #if (Seed > 0) rotate 360*rand(S)*z rotate degrees(acos(1 - 2*rand(S)))*y rotate 360*rand(S)*z #end
}
#declare TurnFunction = function { transform { Turn } }
#macro Turned(P) (TurnFunction(P.x, P.y, P.z)) #end
";

fn meters(job: &Job, frame: Frame) -> String {
    let count = job.sensors.len();
    let at_disc = job.sensors.iter().zip(disc_positions(job, frame));
    let rows = at_disc.map(|(s, disc)| format!("  {{{}, {}}}", vector(disc), vector(s.meter.normal))).collect_vec();
    let first = |part| readouts(&first_readouts(job, part), frame.light);
    let readouts = if job.scene.room.is_some() && job.transport != Transport::Direct {
        format!("#if (Indirect)\n{}#else\n{}#end\n", first(Light::Indirect), first(Light::Direct))
    } else {
        first(Light::Direct)
    };
    let blanks = if job.transport == Transport::Direct { "" } else { BLANKS };
    let extent = job.scene.room.map_or(1.0, |r| r.size_m.max_element()) * frame.scale;
    let discs = [AIM, blanks].concat().replace("COUNT", &count.to_string()).replace("EXTENT", &extent.to_string());
    format!(
        "\n// Meters: position, normal.\n#declare Meters = array[{count}][2] {{\n{}\n}};\n\
         // Illuminance that the pixel's scale stands for, in lux.\n\
         #ifdef (Readouts) #include \"readouts.inc\" #else\n{readouts}#end\n{discs}{METERS}",
        rows.join(",\n")
    )
}

/// A mesh camera takes one pixel from each triangle's centre (POV-Ray 3.7 reference, 2.4.1.3.10): a disc 2 mm below.
const AIM: &str = "
#macro BlankSeat(K) <10*EXTENT, (K - Blanks/2)*EXTENT/20, 0> #end
#macro AimAt(P, N)
  #local U = vnormalize(vcross(N, #if (abs(N.x) < .7) x #else y #end));
  #local V = vcross(N, U);
  #local C = P - (U + V)*.1;  // wide, as a mesh is kept in single precision
  triangle { C, C + V*.3, C + U*.3 }  // its normal, (P3 - P1) x (P2 - P1), is the meter's
#end
#declare Aim = mesh {
  #for (K, 1, Blanks) AimAt(BlankSeat(K), z) #end
  #for (K, 0, COUNT - 1) AimAt(Turned(Meters[K][0]), Turned(Meters[K][1])) #end
}
";

/// Discs that are lit by nothing and see nothing, far outside the room.
const BLANKS: &str = "
// Blanks: grey discs in a black tube, each of which uses up one sample's worth of radiosity's directions; black ones use up none, where fewer
// samples go round the pool.
#declare Spent = mod(Blanks, max(1, floor(Pool/Count)));
#for (K, 1, Blanks)
  disc { BlankSeat(K), z, .001 pigment { rgb .5 } finish { ambient 0 diffuse (K > Spent ? 0 : 1) }
    no_shadow no_reflection no_radiosity }
#end
#if (Blanks > 0)
  difference {
    box { BlankSeat(-1) - EXTENT/20, BlankSeat(Blanks + 2) + EXTENT/20 }
    box { BlankSeat(0) - EXTENT/400, BlankSeat(Blanks + 1) + EXTENT/400 }
    pigment { rgb 0 } finish { ambient 0 diffuse 0 } }
#end
";

const METERS: &str = "
camera { mesh_camera { 1 0 mesh { Aim } } location <0, 0, .002> direction <0, 0, -1> }

#macro Disc(K)
  #local E = Readout[K].x*Brightness;
  #if (Readout[K].y = 0)
    #local Gain = <.5, 16, 256>/E;
    #local Offset = <.25, 0, 0>;
  #else
    #local Gain = <.5, 500, 1e-6>/E;
    #local Offset = <.25, .5 - 500, .25>;
  #end
  disc { Turned(Meters[K][0]), Turned(Meters[K][1]), .001
    // POV-Ray multiplies emission by the pigment.
    texture { pigment { rgb Gain } finish { ambient 0 diffuse 1 emission rgb Offset/Gain } }
    interior_texture { pigment { rgbt 1 } finish { ambient 0 diffuse 0 } }  // the back is not there
    no_shadow no_reflection no_radiosity }
#end
";

fn luminaires(job: &Job, frame: Frame, points: usize) -> String {
    let mut text = String::from(
        "\n// Luminaires: a point light behind a small sphere whose pigment filters it to the luminous intensity distribution.\n\
         #declare AngleGamma = function(x, y, z) { degrees(atan2(sqrt(x*x + y*y), -z)) }\n\
         #declare AngleC = function(x, y, z) { degrees(atan2(y, x) + select(atan2(y, x), 2*pi, 0)) }\n\
         #declare F = 1e-6;\n",
    );
    let mut declared: Vec<&LuminousIntensityDistribution> = vec![];
    for luminaire in job.scene.luminaires.iter().filter(|l| candela(l) > 0.0) {
        let distribution = &luminaire.photometry.distribution;
        let known = declared.iter().position(|d| *d == distribution);
        let number = known.unwrap_or(declared.len());
        if known.is_none() {
            declared.push(distribution);
            text.push_str(&pigment::declare(&format!("Distribution{number}"), distribution));
        }
        text.push_str(&one_luminaire(job, luminaire, number, frame, points));
    }
    text
}

fn one_luminaire(job: &Job, luminaire: &Luminaire, number: usize, frame: Frame, points: usize) -> String {
    let (axes, most) = (luminaire.orientation, candela(luminaire));
    let matrix = [axes.x_axis, axes.y_axis, axes.z_axis].map(numbers).join(", ");
    let mut text = format!(
        "// {}: {most} cd at most, {}\n#macro Luminaire(P, Candela)\n  \
         light_source {{ P rgb Brightness*Candela/(2*F*F) fade_distance F fade_power 2 transform {{ Turn }} }}\n  \
         sphere {{ 0, {FILTER_RADIUS} pigment {{ Distribution{number} }} finish {{ ambient 0 diffuse 0 }}\n    \
         hollow no_image no_reflection no_radiosity\n    matrix <{matrix}, 0, 0, 0> translate P transform {{ Turn }} }}\n#end\n",
        Comment(&luminaire.id),
        luminaire.model.name()
    );
    let candela = most * frame.scale * frame.scale * frame.light;
    let lights = point_lights(luminaire, frame, candela, points);
    if luminaire.model == LuminaireModel::Point || job.transport == Transport::Direct {
        text.push_str(&lights);
    } else {
        let indirect = point_lights(luminaire, frame, candela, POINTS_INDIRECT);
        write!(text, "#if (Indirect)\n{indirect}#else\n{lights}#end\n").ok();
    }
    text
}

/// A luminaire of so many candela at most as point lights along each side of its opening.
fn point_lights(luminaire: &Luminaire, frame: Frame, candela: f64, points: usize) -> String {
    let mut text = String::new();
    for Part { offset_m, share } in opening::parts_of(luminaire, points) {
        let place = vector(frame.point(luminaire.position_m + luminaire.orientation * offset_m));
        writeln!(text, "Luminaire({place}, {})", candela * share).ok();
    }
    text
}

fn surroundings(job: &Job, frame: Frame) -> String {
    let discs = format!("#for (K, 0, {} - 1) Disc(K) #end", job.sensors.len());
    let mut text = format!(
        "\n// The discs; those for reflected light stand in a group of their own that no light shines on.\n\
         #if (Indirect) light_group {{ {discs} global_lights off }} #else {discs} #end\n\n\
         #macro Diffuse(Rho) pigment {{ rgb Rho/Brightness }} finish {{ ambient 0 diffuse 1 }} transform {{ Turn }} #end\n"
    );
    if let Some(room) = job.scene.room {
        text.push_str("\n// The room: six slabs around it.\n");
        for surface in Surface::ALL {
            let (min, max) = slab(room.size_m, surface, 1.0 / frame.scale);
            let corners = format!("{}, {}", vector(frame.point(min)), vector(frame.point(max)));
            let rho = room.reflectance.of(surface);
            writeln!(text, "box {{ {corners} Diffuse({rho}) }}  // {}", surface.name()).ok();
        }
    }
    if !job.scene.obstacles.is_empty() {
        text.push_str("\n// Obstacles.\n");
        job.scene.obstacles.iter().for_each(|o| text.push_str(&obstacle(o, frame)));
    }
    text
}

/// A slab outside the room, one scene unit thick, wide enough to close the edges.
fn slab(size_m: DVec3, surface: Surface, thickness_m: f64) -> (DVec3, DVec3) {
    let (mut min, mut max) = (DVec3::splat(-thickness_m), size_m + thickness_m);
    let axis = surface.axis();
    if surface.is_far() {
        min[axis] = size_m[axis];
    } else {
        max[axis] = 0.0;
    }
    (min, max)
}

fn obstacle(obstacle: &Obstacle, frame: Frame) -> String {
    let rho = obstacle.reflectance;
    match &obstacle.shape {
        Shape::Box { min_m, max_m } => {
            format!("box {{ {}, {} Diffuse({rho}) }}\n", vector(frame.point(*min_m)), vector(frame.point(*max_m)))
        }
        Shape::Mesh { vertices_m, triangles } => {
            let vertices: Vec<String> = vertices_m.iter().map(|v| vector(frame.point(*v))).collect();
            let faces: Vec<String> = triangles.iter().map(|[a, b, c]| format!("<{a},{b},{c}>")).collect();
            format!(
                "mesh2 {{\n  vertex_vectors {{ {}, {} }}\n  face_indices {{ {}, {} }}\n  Diffuse({rho}) }}\n",
                vertices.len(),
                vertices.join(", "),
                faces.len(),
                faces.join(", ")
            )
        }
    }
}

fn vector(v: DVec3) -> String {
    format!("<{}>", numbers(v))
}

/// Shortest digits that read back to the same number; no negative zero.
fn numbers(v: DVec3) -> String {
    // -0 and 0 add up to 0.
    let DVec3 { x, y, z } = v + 0.0;
    format!("{x}, {y}, {z}")
}
