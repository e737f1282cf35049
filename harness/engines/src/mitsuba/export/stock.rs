//! `stock.xml`: the same scene for Mitsuba as it is installed, without Python.
//!
//! Mitsuba has no goniometric emitter. A `point` inside a sphere that lets through I / Imax in every direction is one:
//! the sphere is a `mask` whose opacity is a latitude-longitude image, around a dielectric without refraction, so that
//! paths go straight through it and only connections to the light are dimmed.

use glam::DVec3;
use itertools::Itertools;
use luxproof_photometry::{LuminousIntensityDistribution, Symmetry};
use luxproof_scene::{Bounces, Luminaire, LuminaireModel, Transport};

use super::surfaces::list;
use super::{has_surfaces, header, integrator, placing};
use crate::comment::Comment;
use crate::frame::Frame;
use crate::mitsuba::settings::{Integrator, Settings};
use crate::settings::Preset;
use crate::tables::Tables;
use crate::{Job, SceneFile, Sensor};

/// Pixels along a side of a meter's tile, each of Mitsuba's own four samples: more samples in one pixel would drown in its 32-bit sum.
pub(super) const TILE: usize = 16;
/// Meters that fit side by side on a film.
const MAX_METERS: usize = 256;
/// Radius of the filter sphere in parts of the scene's size ...
const RADIUS: f64 = 7e-3;
/// ... and where it is lost: Mitsuba ends shadow rays 8.9e-4 of their length before the light.
const MIN_RADIUS: f64 = 1.8e-3;
/// Radius of a meter's patch in parts of the scene's size.
const PATCH: f64 = 3e-4;
/// Nearer to one another than so many of these radii patches, and what looks at them from two off, hide each other.
const NEAR: f64 = 4.0;
/// Two patches are in one plane that are no farther off it, in parts of their radius, and whose normals have this cosine between them.
const IN_PLANE: f64 = 1e-3;
const PARALLEL: f64 = 1.0 - 1e-9;
/// Rows of an opacity image: a quarter of a degree.
const ROWS: usize = 721;
/// Its columns, if the luminaire is not axially symmetric: a degree.
const COLUMNS: usize = 360;

/// A sensor of a batch shows its tile of the batch's film but insists on a film of its own.
const ONE_PIXEL: &str = r#"<film type="hdrfilm"> <integer name="width" value="1"/> <integer name="height" value="1"/> <rfilter type="box"/> </film>"#;

/// Why the stock scene cannot be had, if so.
pub(in crate::mitsuba) fn obstacle_to_stock(job: &Job) -> Option<String> {
    if job.scene.luminaires.iter().any(|l| l.model != LuminaireModel::Point) {
        return Some("a stock Mitsuba scene has goniometric light from points only".into());
    }
    if job.sensors.len() > MAX_METERS {
        return Some(format!("a stock Mitsuba scene reads {MAX_METERS} meters at most"));
    }
    let size_m = size_m(job);
    let patch_m = PATCH * size_m;
    if let Some([a, b]) = job.sensors.iter().array_combinations().find(|[a, b]| hide_each_other(a, b, patch_m)) {
        return Some(format!(
            "the patches on which a stock Mitsuba scene reads `{}` and `{}` would hide each other",
            a.id.0, b.id.0
        ));
    }
    job.scene.luminaires.iter().find(|l| radius_m(job, l) < MIN_RADIUS * size_m).map(|l| {
        format!("`{}` is so close to something else that the sphere which shapes its light would be lost", l.id)
    })
}

/// Whether of the patches of two meters one stands before the other; those that lie in one plane do not.
fn hide_each_other(a: &Sensor, b: &Sensor, patch_m: f64) -> bool {
    let apart = b.meter.position_m - a.meter.position_m;
    let is_in_plane =
        apart.dot(a.meter.normal).abs() < IN_PLANE * patch_m && a.meter.normal.dot(b.meter.normal) > PARALLEL;
    apart.length() < NEAR * patch_m && !is_in_plane
}

/// The scene and its images; nothing where it cannot be had.
pub(super) fn files(job: &Job, settings: &Settings, frame: &Frame, tables: &Tables) -> Vec<SceneFile> {
    if obstacle_to_stock(job).is_some() {
        return vec![];
    }
    let images =
        tables.distinct.iter().enumerate().map(|(k, d)| SceneFile { name: image_name(k), bytes: opacity_pfm(d) });
    let mut files = vec![SceneFile::text("stock.xml", xml(job, settings, frame, tables))];
    files.extend(images);
    files
}

/// What a pixel is multiplied with to be an illuminance: a white patch's radiance or an irradiance.
pub(super) fn pixel_factor(job: &Job) -> f64 {
    if reads_patches(job) { std::f64::consts::PI } else { 1.0 }
}

/// An irradiancemeter never meets a point light: it reads indirect light, and a white patch the rest.
fn reads_patches(job: &Job) -> bool {
    !matches!(job.transport, Transport::Indirect(_))
}

fn xml(job: &Job, settings: &Settings, frame: &Frame, tables: &Tables) -> String {
    let what = format!(
        "For Mitsuba without Python; render with\n         mitsuba -m {} stock.xml\n     Every meter is a tile of {TILE} x {TILE} \
         pixels, in the order of job.json: illuminance is the mean of its pixels{}.",
        settings.variant,
        if reads_patches(job) { " times pi" } else { "" }
    );
    let mut xml = header(job, &what) + &placing::comment(frame) + &integrator(&patched(job), Integrator::VolumePath);
    if has_surfaces(job) {
        xml += "    <include filename=\"room.xml\"/>\n";
    }
    let luminaires = job.scene.luminaires.iter().zip(&tables.of_luminaire);
    xml.extend(luminaires.map(|(luminaire, table)| filtered_point(job, luminaire, *table, frame)));
    xml + &meters(job, settings, frame) + "</scene>\n"
}

/// The job with a path that also reflects from a white patch.
fn patched(job: &Job) -> Job {
    let transport = match job.transport {
        Transport::Direct => Transport::Total(Bounces::AtMost(1)),
        Transport::Total(Bounces::AtMost(n)) => Transport::Total(Bounces::AtMost(n + 1)),
        other => other,
    };
    Job { transport, ..job.clone() }
}

fn filtered_point(job: &Job, luminaire: &Luminaire, table: usize, frame: &Frame) -> String {
    let peak_cd = luminaire.photometry.distribution.max_intensity().value();
    let rows = ROWS as f64;
    let columns = columns(&luminaire.photometry.distribution) as f64;
    format!(
        r#"
    <!-- {id} -->
    <emitter type="point">
        <point name="position" value="{at}"/>
        <rgb name="intensity" value="{intensity}"/>
    </emitter>
    <shape type="sphere">
        <float name="radius" value="{radius}"/>
        <transform name="to_world">
            <matrix value="{matrix}"/>
        </transform>
        <bsdf type="mask">
            <texture type="bitmap" name="opacity">
                <string name="filename" value="{image}"/>
                <boolean name="raw" value="true"/>
                <string name="format" value="variant"/>
                <!-- first and last row at the poles, column k at C = k x {step} degrees -->
                <transform name="to_uv">
                    <scale x="1" y="{scale_y}"/>
                    <translate x="{shift_x}" y="{shift_y}"/>
                </transform>
            </texture>
            <bsdf type="dielectric"> <float name="int_ior" value="1"/> <float name="ext_ior" value="1"/> </bsdf>
        </bsdf>
    </shape>
"#,
        id = Comment(&luminaire.id),
        at = list(frame.to_scene(luminaire.position_m)),
        intensity = peak_cd * luminaire.flux_scale * frame.scale * frame.scale,
        radius = radius_m(job, luminaire) * frame.scale,
        matrix = placing::matrix(frame, luminaire.position_m, luminaire.orientation),
        image = image_name(table),
        step = 360.0 / columns,
        scale_y = (rows - 1.0) / rows,
        shift_x = 0.5 / columns,
        shift_y = 0.5 / rows,
    )
}

fn meters(job: &Job, settings: &Settings, frame: &Frame) -> String {
    let (component, samples) = match settings.preset {
        // Mitsuba's default film stores 16 bits.
        Preset::Default => ("", ""),
        Preset::Audit | Preset::Fast => (
            "\n            <string name=\"component_format\" value=\"float32\"/>",
            " <integer name=\"sample_count\" value=\"256\"/> ",
        ),
    };
    let size = size_m(job) * frame.scale;
    let meter = if reads_patches(job) { patch_and_eye } else { irradiance_meter };
    let (sensors, patches): (Vec<_>, Vec<_>) = job.sensors.iter().map(|s| meter(s, frame, size)).unzip();
    format!(
        r#"
    <!-- the meters, side by side; a box filter keeps them apart -->
    <sensor type="batch">
        <film type="hdrfilm">
            <integer name="width" value="{width}"/>
            <integer name="height" value="{TILE}"/>
            <rfilter type="box"/>
            <string name="pixel_format" value="luminance"/>{component}
        </film>
        <sampler type="independent">{samples}</sampler>
{sensors}    </sensor>
{patches}"#,
        width = TILE * job.sensors.len(),
        sensors = sensors.concat(),
        patches = patches.concat(),
    )
}

fn patch_and_eye(sensor: &Sensor, frame: &Frame, size: f64) -> (String, String) {
    let (at, normal) = (frame.to_scene(sensor.meter.position_m), sensor.meter.normal);
    let radius = PATCH * size;
    let id = Comment(&sensor.id.0);
    let eye = format!(
        r#"        <sensor type="radiancemeter"> <!-- {id} -->
            <point name="origin" value="{}"/>
            <vector name="direction" value="{}"/>
            {ONE_PIXEL}
        </sensor>
"#,
        list(at + 2.0 * radius * normal),
        list(-normal)
    );
    let patch = format!(
        r#"    <shape type="disk"> <!-- {id} -->
        {}
        <bsdf type="diffuse"> <rgb name="reflectance" value="1"/> </bsdf>
    </shape>
"#,
        disk_transform(at, normal, radius)
    );
    (eye, patch)
}

fn irradiance_meter(sensor: &Sensor, frame: &Frame, size: f64) -> (String, String) {
    let (at, normal) = (frame.to_scene(sensor.meter.position_m), sensor.meter.normal);
    let meter = format!(
        r#"        <shape type="disk"> <!-- {} -->
            {}
            <sensor type="irradiancemeter"> {ONE_PIXEL} </sensor>
        </shape>
"#,
        Comment(&sensor.id.0),
        disk_transform(at, normal, PATCH * size)
    );
    (meter, String::new())
}

fn disk_transform(at: DVec3, normal: DVec3, radius: f64) -> String {
    let up = if normal.z.abs() > 0.5 { DVec3::Y } else { DVec3::Z };
    format!(
        r#"<transform name="to_world"> <scale value="{radius}"/> <lookat origin="{}" target="{}" up="{}"/> </transform>"#,
        list(at),
        list(at + normal),
        list(up)
    )
}

/// Returns the filter sphere's radius. No meter, luminaire, box or surface may lie within it.
fn radius_m(job: &Job, luminaire: &Luminaire) -> f64 {
    let at = luminaire.position_m;
    let others = job.scene.luminaires.iter().map(|l| l.position_m.distance(at)).filter(|d| *d > 0.0);
    let nearest = job.distances_m(at).chain(others).fold(f64::INFINITY, f64::min);
    (RADIUS * size_m(job)).min(0.5 * nearest)
}

/// Returns the longest straight way of light in metres.
fn size_m(job: &Job) -> f64 {
    let mut reach = 0.0_f64;
    for luminaire in &job.scene.luminaires {
        for sensor in &job.sensors {
            reach = reach.max(sensor.meter.position_m.distance(luminaire.position_m));
        }
    }
    job.scene.room.map_or(reach, |r| r.size_m.length())
}

fn image_name(table: usize) -> String {
    format!("opacity-{table}.pfm")
}

fn columns(distribution: &LuminousIntensityDistribution) -> usize {
    if distribution.symmetry() == Symmetry::Axial { 2 } else { COLUMNS }
}

/// Writes 1 - I / Imax over gamma (zenith first) and C as a portable float map, which begins with the lowest row.
fn opacity_pfm(distribution: &LuminousIntensityDistribution) -> Vec<u8> {
    let columns = columns(distribution);
    let peak = distribution.max_intensity().value();
    let mut bytes = format!("Pf\n{columns} {ROWS}\n-1.0\n").into_bytes();
    let c_deg: Vec<f64> = (0..columns).map(|column| 360.0 * column as f64 / columns as f64).collect();
    let gamma_deg: Vec<f64> = (0..ROWS).map(|row| 180.0 * row as f64 / (ROWS - 1) as f64).collect();
    for intensity in distribution.intensities(&c_deg, &gamma_deg) {
        let opacity = if peak > 0.0 { 1.0 - intensity / peak } else { 1.0 };
        bytes.extend((opacity as f32).to_le_bytes());
    }
    bytes
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::s1;

    /// Why S1 with another meter near its first makes no stock scene.
    fn objection(off: DVec3, normal: DVec3) -> Option<String> {
        let mut job = s1(Transport::Direct);
        let mut other = job.sensors[0].clone();
        (other.meter.position_m, other.meter.normal) = (other.meter.position_m + off, normal.normalize());
        job.sensors.push(other);
        obstacle_to_stock(&job)
    }

    #[test]
    fn patches_that_hide_each_other_make_no_stock_scene_and_those_in_one_plane_do() {
        let up = s1(Transport::Direct).sensors[0].meter.normal;
        // A mean over directions is read of meters all about one point.
        for (off, normal) in [(DVec3::ZERO, DVec3::X), (DVec3::ZERO, -up), (0.005 * up, up)] {
            assert!(objection(off, normal).is_some_and(|why| why.contains("hide each other")), "{off} {normal}");
        }
        // Planes of a table meet at the nadir.
        for (off, normal) in [(DVec3::ZERO, up), (0.005 * DVec3::X, up), (0.2 * DVec3::X, DVec3::X)] {
            assert_eq!(objection(off, normal), None, "{off} {normal}");
        }
    }
}
