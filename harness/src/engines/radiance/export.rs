//! A job as a folder of Radiance files that anyone can run by hand; pure.
//!
//! `scene.rad` holds surfaces and luminaires, `luminaire-<n>.dat` the candela tables, `meters.txt` the meters and
//! `run.sh` the commands. Formats: Ward and Shakespeare, *Rendering with Radiance* (1998); refman of Radiance 6.

use std::fmt::Write;

use glam::{DMat3, DVec3};
use luminaire::geometry::Surface;
use luminaire::photometry::{LuminousIntensityDistribution, Symmetry};
use luminaire::scene::{Luminaire, Obstacle, Shape, Transport};

use super::options::Options;
use super::settings::{Scaling, Settings};
use crate::engines::{Job, SceneFile};

/// Lumens a watt, by which Radiance's radiometric quantities are photometric (`WHTEFFICACY` in its sources).
pub(super) const EFFICACY: f64 = 179.0;
/// Weights of red, green and blue in Radiance's luminance (`CIE_rf`, `CIE_gf`, `CIE_bf` in its sources).
pub(super) const WEIGHTS: [f64; 3] = [0.265, 0.670, 0.065];

/// `rtrace -I` reads this far in front of the point it is given, in Radiance's units, whatever the scene's size.
const READ_AHEAD: f64 = 1e-4;
/// A table that stops with light at its edge falls to zero within this angle; Radiance would extrapolate it.
pub(super) const EDGE_DEG: f64 = 1e-4;
/// Radius of the sphere that stands for a point luminaire, in Radiance's units; 1e-6 and less are refused by Radiance.
const POINT_RADIUS: f64 = 1e-3;
const SMALLEST_RADIUS: f64 = 2e-6;

/// All files of a job.
pub(super) fn files(job: &Job, settings: &Settings, options: &Options) -> Vec<SceneFile> {
    let scale = scale(job, settings.scaling);
    let mut files = vec![
        SceneFile::text("scene.rad", scene_rad(job, scale)),
        SceneFile::text("meters.txt", meters_txt(job, scale)),
        SceneFile::text("run.sh", run_sh(job, options)),
    ];
    let tables = job.scene.luminaires.iter().enumerate();
    files.extend(tables.map(|(k, l)| SceneFile::text(&dat_name(k), dat(&l.photometry.distribution))));
    files
}

/// Radiance's units a metre: 1 for ordinary rooms, a power of ten where its absolute tolerances (1e-6) come near.
pub(super) fn scale(job: &Job, scaling: Scaling) -> f64 {
    let Some(room) = job.scene.room.filter(|_| scaling == Scaling::Fitted) else {
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

fn run_sh(job: &Job, options: &Options) -> String {
    let [r, g, b] = WEIGHTS.map(|w| EFFICACY * w);
    let lux = format!("rcalc -e '$1={r}*$1+{g}*$2+{b}*$3'");
    let mut text = format!(
        "#!/bin/sh\n# {}\n# Prints the illuminance in lux at each line of meters.txt.\n\
         # RAYPATH must name Radiance's library (for source.cal).\nset -e\n\
         export RAYPATH=.:${{RAYPATH:-/usr/local/lib/ray}}\noconv -f scene.rad > scene.oct\n",
        title(job)
    );
    let rtrace = |args: &[String]| format!("rtrace -h {} scene.oct < meters.txt | {lux}", args.join(" "));
    let direct = rtrace(&options.direct);
    let total = rtrace(&options.total);
    match job.transport {
        Transport::Direct => text += &format!("{direct}\n"),
        Transport::Total(_) => text += &format!("{total}\n"),
        Transport::Indirect(_) => {
            text += "# Indirect light is all light less the direct.\n";
            text += &format!("{direct} > direct.txt\n{total} > total.txt\n");
            text += "rlam total.txt direct.txt | rcalc -e '$1=$1-$2'\n";
        }
    }
    text
}

fn title(job: &Job) -> String {
    let line = |s: &str| s.replace(['\n', '\r'], " ");
    format!("luxproof: case {}, procedure {}", line(&job.case), line(&job.procedure))
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
    for (k, luminaire) in job.scene.luminaires.iter().enumerate() {
        text += &point(k, luminaire, point_radius(job, luminaire, scale), scale);
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

/// A sphere so small that only its centre matters: radiance I / (179 pi r^2) towards each direction.
fn point(k: usize, luminaire: &Luminaire, radius: f64, scale: f64) -> String {
    let factor = luminaire.flux_scale * scale * scale / (EFFICACY * std::f64::consts::PI * radius * radius);
    let p = luminaire.position_m * scale;
    let mut text =
        format!("\n# Luminaire {}: a point, as a sphere of radius {radius}; its table is in candela.\n", luminaire.id);
    text += &format!("{}light luminaire-{k}\n0\n0\n3 1 1 1\n", brightdata(k, luminaire, "corr", &[factor]));
    text += &format!("luminaire-{k} sphere luminaire-{k}-body\n0\n0\n4 {} {} {} {radius}\n", p.x, p.y, p.z);
    text
}

/// The table as a pattern, turned as the luminaire is; ends with the modifier's name, ready for a material.
fn brightdata(k: usize, luminaire: &Luminaire, correction: &str, factors: &[f64]) -> String {
    let coordinates = match luminaire.photometry.distribution.symmetry() {
        Symmetry::Axial => "src_theta",
        _ => "src_phi src_theta",
    };
    let mut words = format!("{correction} {} source.cal {coordinates}", dat_name(k));
    for (axis, angle_deg) in euler_deg(luminaire.orientation) {
        // Writing to a string cannot fail.
        write!(words, " -r{axis} {angle_deg}").ok();
    }
    let factors: Vec<String> = factors.iter().map(|f| format!("{f:e}")).collect();
    format!(
        "void brightdata luminaire-{k}-candela\n{} {words}\n0\n{} {}\nluminaire-{k}-candela ",
        words.split(' ').count(),
        factors.len(),
        factors.join(" ")
    )
}

/// Rotations about the fixed axes, in the order xform applies them, that make up the orientation; none for the identity.
fn euler_deg(orientation: DMat3) -> Vec<(char, f64)> {
    // R = Rz(azimuth) Ry(tilt) Rz(roll): the last column is the turned z axis, the last row holds the roll.
    let (x, y, z) = (orientation.x_axis, orientation.y_axis, orientation.z_axis);
    let sin_tilt = z.x.hypot(z.y);
    let (roll, tilt, azimuth) = if sin_tilt > 1e-12 {
        (y.z.atan2(-x.z), sin_tilt.atan2(z.z), z.y.atan2(z.x))
    } else {
        (0.0, if z.z > 0.0 { 0.0 } else { std::f64::consts::PI }, (-y.x).atan2(y.y))
    };
    // 1e-10 degrees are far below what a float table resolves, and spare the reader the rounding of arcs.
    let rounded = |a: f64| (a.to_degrees() * 1e10).round() / 1e10;
    let turned = [('z', roll), ('y', tilt), ('z', azimuth)];
    turned.into_iter().map(|(axis, a)| (axis, rounded(a))).filter(|(_, a)| *a != 0.0).collect()
}

fn dat_name(k: usize) -> String {
    format!("luminaire-{k}.dat")
}

/// The candela table in Radiance's data format: gamma alone, or C (0 to 360) by gamma; zero outside its gamma range.
fn dat(distribution: &LuminousIntensityDistribution) -> String {
    let padded = distribution.padded(EDGE_DEG);
    let axis = |angles: &[f64]| format!("0 0 {}\n{}\n", angles.len(), joined(angles));
    if padded.symmetry() == Symmetry::Axial {
        return format!("1\n{}{}\n", axis(padded.gamma_deg()), joined(padded.plane(0)));
    }
    let full = padded.full_circle();
    let planes: String = (0..full.c_deg().len()).map(|c| joined(full.plane(c)) + "\n").collect();
    format!("2\n{}{}{planes}", axis(full.c_deg()), axis(full.gamma_deg()))
}

fn joined(values: &[f64]) -> String {
    values.iter().map(f64::to_string).collect::<Vec<_>>().join(" ")
}

/// Small against the nearest surface, luminaire and meter, so that the sphere touches none of them.
fn point_radius(job: &Job, luminaire: &Luminaire, scale: f64) -> f64 {
    let at = luminaire.position_m;
    let to_stations = job.stations.iter().map(|s| s.meter.position_m.distance(at));
    let to_room = job.scene.room.iter().flat_map(|r| {
        let far = r.size_m - at;
        at.to_array().into_iter().chain(far.to_array())
    });
    let to_boxes = job.scene.obstacles.iter().filter_map(|o| match &o.shape {
        Shape::Box { min_m, max_m } => Some(at.clamp(*min_m, *max_m).distance(at)),
        Shape::Mesh { .. } => None,
    });
    let nearest = to_stations.chain(to_room).chain(to_boxes).filter(|d| *d > 0.0).fold(f64::INFINITY, f64::min);
    POINT_RADIUS.min(0.01 * nearest * scale).max(SMALLEST_RADIUS)
}
