//! Luminaires as Radiance's light sources: points, luminous openings, and what ies2rad makes of a file.
//!
//! A part of an opening sends out its share of the intensity in every direction, L = I(C, gamma) / projected area, as
//! `flatcorr` and `boxcorr` of Radiance's source.cal have it, and for cylinders `prism.cal`.

use luxproof_scene::contact;
use std::f64::consts::PI;
use std::fmt::Write;

use glam::{DMat3, DVec3, Vec3Swizzles};
use itertools::Itertools;
use luxproof_photometry::{
    Details, HorizontalAxis, LuminousIntensityDistribution, LuminousOpening, Photometry, Symmetry, lm63,
};
use luxproof_scene::{Luminaire, Meter, Transport};

use super::{EFFICACY, Light, box_faces, polygon};
use crate::comment::Comment;
use crate::radiance::options::Sources;
use crate::radiance::route::{Route, route};
use crate::radiance::settings::Settings;
use crate::{Job, SceneFile, recess};

/// A table that stops with light at its edge falls to zero within this angle; Radiance would extrapolate it.
pub(in crate::radiance) const EDGE_DEG: f64 = 1e-4;
/// The same where ies2rad writes the angles, with six digits.
const IES2RAD_EDGE_DEG: f64 = 0.01;
/// Distance of a flat opening's faces from its plane, in Radiance's units: a luminaire may be flush with a surface.
const FACE_OFFSET: f64 = 1e-5;
/// Distance of a veil from its face, in Radiance's units, which takes 1e-6 for none.
const VEIL_OFFSET: f64 = 0.5 * FACE_OFFSET;
/// Radius of the sphere that stands for a point luminaire, in Radiance's units; 1e-6 and less are refused by Radiance.
const POINT_RADIUS: f64 = 1e-3;
const MIN_RADIUS: f64 = 2e-6;
/// One on a surface comes before it by so many radii where sources are sampled: rays to all of it must not end on that.
const CLEAR: f64 = 1.5;
/// Faces that stand for a cylinder's side, a multiple of four: rays that rtrace aims at a cylinder of its own miss it where they enter through an
/// end, 10 % of them seen obliquely (`nextssamp` of srcsamp.c takes points of a box about the axis).
const SIDES: usize = 32;
/// What the side and the ends of such a prism send out, for a light's pattern: `prism_x`, `prism_y` and `prism_z` along each axis.
const PRISM_CAL: &str = include_str!("prism.cal");

/// By what a table becomes radiance: a function of a file of Radiance's.
#[derive(Clone, Copy)]
struct Correction {
    function: &'static str,
    file: &'static str,
}

impl Correction {
    const NONE: Self = Self::of_radiance("corr");
    const FLAT: Self = Self::of_radiance("flatcorr");
    const BOX: Self = Self::of_radiance("boxcorr");

    const fn of_radiance(function: &'static str) -> Self {
        Self { function, file: "source.cal" }
    }

    const fn of_prism(function: &'static str) -> Self {
        Self { function, file: "prism.cal" }
    }
}

/// Why a luminaire's opening cannot be said to Radiance, if it cannot.
pub(in crate::radiance) fn unsupported(luminaire: &Luminaire, settings: &Settings) -> Option<String> {
    let exported = route(luminaire, settings) == Route::Opening;
    let what = match luminaire.photometry.opening {
        LuminousOpening::Ellipse { x_m, y_m, .. } if x_m != y_m => "an elliptic opening",
        LuminousOpening::Ellipsoid { x_m, y_m, z_m } if x_m != y_m || y_m != z_m => "an ellipsoid",
        LuminousOpening::Box { x_m, y_m, height_m } if height_m > 0.0 && x_m * y_m == 0.0 => "an upright plate",
        LuminousOpening::LyingCylinder { length_m: 0.0, .. } => "an upright disc",
        _ => return None,
    };
    exported.then(|| format!("`{}` has {what}, which Radiance's source.cal does not know", luminaire.id))
}

/// How far off round openings leave a meter at most where nothing hides a part of them, relative; `None` without one.
///
/// rtrace takes the parts of a square to a disc by u sqrt(1 - v^2/2), v sqrt(1 - u^2/2) and counts them alike (`nextssamp` of its srcsamp.c),
/// though they are denser towards the diagonals' ends: the mean of r^2 is 5/9 of the disc's R^2 for 1/2, on axis one diameter away -2.4 %.
pub(in crate::radiance) fn disc_error(job: &Job, settings: &Settings) -> Option<f64> {
    job.scene.luminaires.iter().find_map(|l| round_opening(l, settings))?;
    Some(job.sensors.iter().map(|s| disc_error_at(job, settings, &s.meter)).fold(0.0, f64::max))
}

/// Relative error of the light of all luminaires at a meter by the parts of round openings.
fn disc_error_at(job: &Job, settings: &Settings, meter: &Meter) -> f64 {
    let (mut off_lx, mut all_lx) = (0.0, 0.0);
    for l in &job.scene.luminaires {
        let Some(disc) = round_opening(l, settings) else {
            all_lx += from_part(l, DVec3::ZERO, meter);
            continue;
        };
        let (mapped_lx, even_lx) = over_disc(l, &disc, meter);
        off_lx += disc.part_of_ends(l, meter) * (mapped_lx - even_lx).abs();
        all_lx += even_lx;
    }
    if all_lx > 0.0 { off_lx / all_lx } else { 0.0 }
}

/// The disc or cylinder that a luminaire is exported as, if it is one.
fn round_opening(luminaire: &Luminaire, settings: &Settings) -> Option<Cylinder> {
    Cylinder::of(luminaire.photometry.opening).filter(|_| route(luminaire, settings) == Route::Opening)
}

/// Points along the side of a square that stand for a disc's parts.
const DISC_POINTS: usize = 16;
/// Diameters from which on a disc is taken for a point.
const FAR: f64 = 30.0;

/// What a disc, or the end of a cylinder that a meter sees, gives it where its parts are as dense as rtrace's, and where they are even.
fn over_disc(luminaire: &Luminaire, disc: &Cylinder, meter: &Meter) -> (f64, f64) {
    let radius_m = disc.radius_m;
    if meter.position_m.distance(luminaire.position_m) > 2.0 * FAR * radius_m {
        let lx = from_part(luminaire, DVec3::ZERO, meter);
        return (lx, lx);
    }
    let centre_m = disc.end_facing(luminaire, meter);
    let middles = (0..DISC_POINTS).map(|k| (2.0 * k as f64 + 1.0) / DISC_POINTS as f64 - 1.0);
    let (mut mapped_lx, mut even_lx, mut area) = (0.0, 0.0, 0.0);
    for (u, v) in middles.clone().cartesian_product(middles) {
        let (a, b) = ((1.0 - 0.5 * v * v).sqrt(), (1.0 - 0.5 * u * u).sqrt());
        let lx = from_part(luminaire, centre_m + radius_m * (u * a * disc.across[0] + v * b * disc.across[1]), meter);
        // What a part covers of the disc.
        let covered = a * b - (0.5 * u * v).powi(2) / (a * b);
        mapped_lx += lx / (DISC_POINTS * DISC_POINTS) as f64;
        even_lx += covered * lx;
        area += covered;
    }
    (mapped_lx, even_lx / area)
}

/// What a meter gets of a luminaire, were all of it at a place of its own frame.
fn from_part(luminaire: &Luminaire, offset_m: DVec3, meter: &Meter) -> f64 {
    let ray_m = meter.position_m - (luminaire.position_m + luminaire.orientation * offset_m);
    let cosine = (-ray_m.normalize_or_zero().dot(meter.normal)).max(0.0);
    luminaire.intensity_towards(ray_m).value() * cosine / ray_m.length_squared()
}

/// Part of the reflected light that is lost at most because a ray that meets one of ies2rad's sources ends there, light and
/// illum alike, while luminaires otherwise are no obstacles; `None` where nothing is reflected or there are none.
///
/// The configuration factor of the sources for the meter that sees most of them, and their part of the room's surface.
/// Measured: 1.5 % at a meter of case S2 where this says 3 %.
pub(in crate::radiance) fn swallowed(job: &Job, settings: &Settings) -> Option<f64> {
    let room = job.scene.room.filter(|_| job.transport != Transport::Direct)?;
    let of_ies2rad = job.scene.luminaires.iter().filter(|l| route(l, settings).is_ies2rad());
    // What meets a recessed one ends on its black face in any case.
    let extended = of_ies2rad.filter(|l| contact::normal_of(&job.scene.obstacles, l).is_none()).collect_vec();
    if extended.is_empty() {
        return None;
    }
    let factors = job.sensors.iter().map(|s| extended.iter().map(|l| factor(l, &s.meter)).sum::<f64>());
    let most = factors.fold(0.0, f64::max);
    let sections: f64 = extended.iter().map(|l| largest_section_m2(l)).sum();
    Some((most + sections / room.whole_area_m2()).min(1.0))
}

/// Configuration factor of an opening in one piece, far off; one with height is taken face on.
fn factor(luminaire: &Luminaire, meter: &Meter) -> f64 {
    let ray = luminaire.position_m - meter.position_m;
    let direction = ray.normalize_or_zero();
    let is_flat = luminaire.photometry.opening.bounding_box_m()[2] == 0.0;
    let own = if is_flat { direction.dot(luminaire.orientation * DVec3::Z).abs() } else { 1.0 };
    largest_section_m2(luminaire) * own * direction.dot(meter.normal).max(0.0) / (PI * ray.length_squared())
}

fn largest_section_m2(luminaire: &Luminaire) -> f64 {
    let size = luminaire.photometry.opening.bounding_box_m();
    (size[0] * size[1]).max(size[1] * size[2]).max(size[2] * size[0])
}

/// Of the luminaires of a scene, given by their places in the job.
pub(super) fn rad(job: &Job, settings: &Settings, scale: f64, scene: &[usize], light: Light) -> String {
    let mut text = String::new();
    if light == Light::Reflected {
        text += &format!(
            "\n# No light where a meter sees a source itself. Rays that meet a source by chance pass it: to them the veils about it,\n\
             # a hair off its faces, are antimatter that takes it away, and nothing to rays that are aimed at it from afar.\n\
             void brightfunc {SEEN}\n2 if(T-Ts-{NO_PATH},1,0) .\n0\n0\n"
        );
    }
    let is_sampled = Sources::of(job, settings) == Sources::Openings;
    for (k, l) in scene.iter().map(|k| (*k, &job.scene.luminaires[*k])) {
        text += &match route(l, settings) {
            Route::Point => {
                let off = if is_sampled { recess::inwards(job, l) } else { DVec3::ZERO };
                let radius = if off == DVec3::ZERO { point_radius(job, l, scale) } else { MIN_RADIUS };
                point(k, l, radius, CLEAR * radius * off, scale, light)
            }
            Route::Opening => opening(k, l, scale, light),
            Route::Ies2radLight | Route::Ies2radIllum => by_ies2rad(k, l, scale, light),
        };
    }
    text
}

/// The tables beside `scene.rad`: Radiance data, or the photometric file for ies2rad.
pub(super) fn files(job: &Job, settings: &Settings) -> Vec<SceneFile> {
    let luminaires = &job.scene.luminaires;
    // A file and the tilt factors that it names are in one folder.
    let beside = luminaires.iter().filter(|_| settings.is_native()).flat_map(|l| l.photometry.source.iter().skip(1));
    let beside = beside.map(|f| SceneFile { name: f.name.clone(), bytes: f.bytes.to_vec() });
    let has_prism = luminaires.iter().filter_map(|l| round_opening(l, settings)).any(|c| c.length_m > 0.0);
    let prism = has_prism.then(|| SceneFile::text("prism.cal", PRISM_CAL.to_owned()));
    let tables = luminaires.iter().enumerate().map(|(k, l)| table_file(k, l, settings));
    tables.chain(beside).chain(prism).collect()
}

/// The table of a luminaire as its route reads it.
fn table_file(k: usize, luminaire: &Luminaire, settings: &Settings) -> SceneFile {
    let photometry = &luminaire.photometry;
    match route(luminaire, settings) {
        Route::Point | Route::Opening => SceneFile::text(&dat_name(k), dat(&photometry.distribution)),
        Route::Ies2radLight => match photometry.lm63_file().filter(|_| settings.is_native()) {
            Some(file) => SceneFile { name: ies_name(k), bytes: file.bytes.to_vec() },
            None => SceneFile::text(&ies_name(k), ies(photometry, photometry.opening)),
        },
        Route::Ies2radIllum => {
            SceneFile::text(&ies_name(k), ies(photometry, with_height(photometry.opening, settings)))
        }
    }
}

pub(super) fn commands(job: &Job, settings: &Settings) -> String {
    let mut text = String::new();
    for (k, l) in job.scene.luminaires.iter().enumerate() {
        let kind = match route(l, settings) {
            Route::Point | Route::Opening => continue,
            Route::Ies2radLight => "light",
            Route::Ies2radIllum => "illum",
        };
        text += &format!("ies2rad {}\n", ies2rad_options(k, l, settings).join(" "));
        text += &format!("sed \"s/' light '/' {kind} '/\" ies2rad-{k}.rad > luminaire-{k}.rad\n");
    }
    text
}

/// Arguments of ies2rad that make `ies2rad-<k>.rad`. -t default: without it the keyword \[LAMP\] may scale everything, which is how its users
/// call it.
pub(in crate::radiance) fn ies2rad_options(k: usize, luminaire: &Luminaire, settings: &Settings) -> Vec<String> {
    let lamp = if settings.is_native() { &[][..] } else { &["-t", "default"] };
    let (factor, name) = (luminaire.flux_scale.to_string(), format!("ies2rad-{k}"));
    let options = lamp.iter().copied().chain(["-m", &factor, "-o", &name]);
    options.map(str::to_owned).chain([ies_name(k)]).collect()
}

fn by_ies2rad(k: usize, luminaire: &Luminaire, scale: f64, light: Light) -> String {
    let p = luminaire.position_m * scale;
    let turns: Vec<String> =
        euler_deg(luminaire.orientation).iter().map(|(axis, a)| format!(" -r{axis} {a}")).collect();
    let turns = turns.concat();
    let size = if scale == 1.0 { String::new() } else { format!(" -s {scale}") };
    let comment = format!("\n# Luminaire {}: by ies2rad, see run.sh.\n", Comment(&luminaire.id));
    let seen = match light {
        Light::All => String::new(),
        Light::Reflected => format!(" | sed 's/^void brightdata/{SEEN} brightdata/'"),
    };
    format!("{comment}!xform{size}{turns} -t {} {} {} luminaire-{k}.rad{seen}\n", p.x, p.y, p.z)
}

/// A sphere so small that only its centre matters: radiance I / (179 pi r^2) towards each direction.
fn point(k: usize, luminaire: &Luminaire, radius: f64, off: DVec3, scale: f64, of: Light) -> String {
    let factor = luminaire.flux_scale * scale * scale / (EFFICACY * PI * radius * radius);
    let p = luminaire.position_m * scale + off;
    let mut text = format!(
        "\n# Luminaire {}: a point, as a sphere of radius {radius}; its table is in candela.\n",
        Comment(&luminaire.id)
    );
    text += &light(k, luminaire, Source::Solid, Correction::NONE, &[factor], of);
    text += &format!("luminaire-{k} sphere luminaire-{k}-body\n0\n0\n4 {} {} {} {radius}\n", p.x, p.y, p.z);
    text
}

fn opening(k: usize, luminaire: &Luminaire, scale: f64, of: Light) -> String {
    let mut text =
        format!("\n# Luminaire {}: its luminous opening; its table is in candela.\n", Comment(&luminaire.id));
    let body = Body { k, luminaire, scale, of };
    let factor = luminaire.flux_scale / EFFICACY;
    match luminaire.photometry.opening {
        LuminousOpening::Box { x_m, y_m, height_m: 0.0 } => {
            text += &body.light(Correction::FLAT, &[factor / (x_m * y_m)]);
            for (z, turn) in body.lit_faces() {
                let corners = [(-1.0, -turn), (1.0, -turn), (1.0, turn), (-1.0, turn)];
                let corners = corners.map(|(u, v)| DVec3::new(0.5 * u * x_m, 0.5 * v * y_m, z));
                text += &body.polygon(if turn > 0.0 { "up" } else { "down" }, &corners);
            }
        }
        LuminousOpening::Box { x_m, y_m, height_m } => {
            text += &body.light(Correction::BOX, &[factor, x_m, y_m, height_m]);
            let half = 0.5 * DVec3::new(x_m, y_m, height_m);
            for (f, face) in box_faces(-half, half).iter().enumerate() {
                text += &body.polygon(&f.to_string(), face);
            }
        }
        LuminousOpening::Ellipse { x_m, height_m: 0.0, .. } => {
            text += &body.light(Correction::FLAT, &[factor / (0.25 * PI * x_m * x_m)]);
            for (z, turn) in body.lit_faces() {
                text += &body.disc(if turn > 0.0 { "up" } else { "down" }, z * DVec3::Z, turn * DVec3::Z, 0.5 * x_m);
            }
        }
        LuminousOpening::Ellipsoid { x_m, .. } => {
            text += &body.light(Correction::NONE, &[factor / (0.25 * PI * x_m * x_m)]);
            text += &body.sphere(0.5 * x_m);
        }
        round @ (LuminousOpening::Ellipse { .. } | LuminousOpening::LyingCylinder { .. }) => {
            text += &Cylinder::of(round).map(|c| body.cylinder(&c, factor)).unwrap_or_default();
        }
        // It has its own way.
        LuminousOpening::Point => {}
    }
    text
}

/// A round opening: a disc, with a side where it has a length.
struct Cylinder {
    /// Along z, x or y, and the two after it.
    axis: DVec3,
    across: [DVec3; 2],
    radius_m: f64,
    length_m: f64,
}

impl Cylinder {
    fn of(opening: LuminousOpening) -> Option<Self> {
        let (axis, diameter_m, length_m) = match opening {
            LuminousOpening::Ellipse { x_m, height_m, .. } => (DVec3::Z, x_m, height_m),
            LuminousOpening::LyingCylinder { axis: HorizontalAxis::X, length_m, diameter_m } => {
                (DVec3::X, diameter_m, length_m)
            }
            LuminousOpening::LyingCylinder { axis: HorizontalAxis::Y, length_m, diameter_m } => {
                (DVec3::Y, diameter_m, length_m)
            }
            _ => return None,
        };
        Some(Self { axis, across: [axis.zxy(), axis.yzx()], radius_m: 0.5 * diameter_m, length_m })
    }

    /// A vector across the axis, at an angle from the first of `across`.
    fn spoke_m(&self, length_m: f64, angle: f64) -> DVec3 {
        let (sin, cos) = angle.sin_cos();
        length_m * (cos * self.across[0] + sin * self.across[1])
    }

    fn correction(&self) -> Correction {
        Correction::of_prism(match self.axis.to_array() {
            [1.0, _, _] => "prism_x",
            [_, 1.0, _] => "prism_y",
            _ => "prism_z",
        })
    }

    /// The middle of the end that a meter sees, in the luminaire's own frame.
    fn end_facing(&self, luminaire: &Luminaire, meter: &Meter) -> DVec3 {
        let own = luminaire.orientation.transpose() * (meter.position_m - luminaire.position_m);
        (0.5 * self.length_m * own.dot(self.axis).signum()) * self.axis
    }

    /// How much of its projected area towards a meter, taken for far off, is that of its ends; all of it where the meter's own plane cuts it.
    fn part_of_ends(&self, luminaire: &Luminaire, meter: &Meter) -> f64 {
        let above_m = (luminaire.position_m - meter.position_m).dot(meter.normal);
        if above_m.abs() < luminaire.photometry.opening.reach_m(luminaire.orientation.transpose() * meter.normal) {
            return 1.0;
        }
        let own = luminaire.orientation.transpose() * (meter.position_m - luminaire.position_m);
        let along = own.normalize_or_zero().dot(self.axis).abs().min(1.0);
        let ends = PI * self.radius_m * along;
        let side = 2.0 * self.length_m * (1.0 - along * along).sqrt();
        if ends + side > 0.0 { ends / (ends + side) } else { 1.0 }
    }
}

struct Body<'a> {
    k: usize,
    luminaire: &'a Luminaire,
    scale: f64,
    of: Light,
}

/// What lies on a face: how far before it in veils' distances, of which modifier, and whether it looks inwards.
type Layer = (f64, String, bool);

impl Body<'_> {
    /// Height and direction (1 up, -1 down) of the faces of a flat opening that send out light.
    fn lit_faces(&self) -> Vec<(f64, f64)> {
        let table = &self.luminaire.photometry.distribution;
        let (down, up) = (table.flux_between(0.0, 90.0).value(), table.flux_between(90.0, 180.0).value());
        let offset = FACE_OFFSET / self.scale;
        [(down, -1.0), (up, 1.0)].into_iter().filter(|(lm, _)| *lm > 0.0).map(|(_, s)| (s * offset, s)).collect()
    }

    fn placed(&self, own_m: DVec3) -> DVec3 {
        (self.luminaire.position_m + self.luminaire.orientation * own_m) * self.scale
    }

    /// The material of what is not seen by chance: an illum in front of nothing, which the light of points passes as in photometry. One illum
    /// hides another even so, see `superposition`. With the veils about it where reflected light is read.
    fn light(&self, correction: Correction, factors: &[f64]) -> String {
        let k = self.k;
        let text = light(k, self.luminaire, Source::SeenThrough, correction, factors, self.of);
        match self.of {
            Light::All => text,
            Light::Reflected => text + &veil(k),
        }
    }

    /// A face and the veils before and behind it, from its outside inwards.
    fn layers(&self) -> Vec<Layer> {
        let (face, veil) = (format!("luminaire-{}", self.k), format!("luminaire-{}-veil", self.k));
        match self.of {
            Light::All => vec![(0.0, face, false)],
            Light::Reflected => vec![
                (2.0, "void".to_owned(), false),
                (1.0, veil.clone(), false),
                (0.0, face, false),
                (-1.0, veil, true),
            ],
        }
    }

    /// How far a layer is before its face, in metres, and the name of its surface.
    fn place(&self, part: &str, layer: f64) -> (f64, String) {
        let name = format!("luminaire-{}-{part}", self.k);
        (layer * VEIL_OFFSET / self.scale, if layer == 0.0 { name } else { format!("{name}-veil{layer:+}") })
    }

    /// A face, its corners counter-clockwise as seen from outside.
    fn polygon(&self, part: &str, corners_m: &[DVec3]) -> String {
        let normal = (corners_m[1] - corners_m[0]).cross(corners_m[2] - corners_m[1]).normalize();
        let mut text = String::new();
        for (layer, modifier, is_inward) in self.layers() {
            let (before_m, name) = self.place(part, layer);
            let mut corners: Vec<DVec3> = corners_m.iter().map(|p| self.placed(*p + before_m * normal)).collect();
            if is_inward {
                corners.reverse();
            }
            text += &polygon(&modifier, &name, &corners);
        }
        text
    }

    fn disc(&self, part: &str, centre_m: DVec3, normal: DVec3, radius_m: f64) -> String {
        let r = radius_m * self.scale;
        let mut text = String::new();
        for (layer, modifier, is_inward) in self.layers() {
            let (before_m, name) = self.place(part, layer);
            let (p, n) = (self.placed(centre_m + before_m * normal), self.luminaire.orientation * normal);
            let n = if is_inward { -n } else { n };
            text += &format!(
                "{modifier} ring {name}\n0\n0\n8\n    {} {} {}\n    {} {} {}\n    0 {r}\n",
                p.x, p.y, p.z, n.x, n.y, n.z
            );
        }
        text
    }

    fn sphere(&self, radius_m: f64) -> String {
        let p = self.placed(DVec3::ZERO);
        let mut text = String::new();
        for (layer, modifier, is_inward) in self.layers() {
            let (before_m, name) = self.place("body", layer);
            let (kind, r) = (if is_inward { "bubble" } else { "sphere" }, (radius_m + before_m) * self.scale);
            text += &format!("{modifier} {kind} {name}\n0\n0\n4 {} {} {} {r}\n", p.x, p.y, p.z);
        }
        text
    }

    /// A prism whose mean silhouette is the cylinder's, and discs that it holds for its ends.
    fn cylinder(&self, cylinder: &Cylinder, factor: f64) -> String {
        let step = 2.0 * PI / SIDES as f64;
        let corner_m = cylinder.radius_m * (0.5 * step) / (0.5 * step).sin();
        let end_m = corner_m * (0.5 * step).cos();
        let factors = [factor, SIDES as f64, 2.0 * corner_m, cylinder.length_m, PI * end_m * end_m];
        let half = 0.5 * cylinder.length_m * cylinder.axis;
        let mut text = self.light(cylinder.correction(), &factors);
        text += &self.disc("end-0", half, cylinder.axis, end_m);
        text += &self.disc("end-1", -half, -cylinder.axis, end_m);
        for k in 0..SIDES {
            let [a, b] = [k, k + 1].map(|k| cylinder.spoke_m(corner_m, step * k as f64));
            text += &self.polygon(&format!("side-{k}"), &[a - half, b - half, b + half, a + half]);
        }
        text
    }
}

/// What becomes of the light of others that meets a source.
#[derive(Clone, Copy)]
enum Source {
    /// It ends there: one so small that it hides nothing.
    Solid,
    /// That of points passes, as in photometry: an illum in front of nothing. One illum hides another even so, see `superposition`.
    SeenThrough,
}

/// The pattern by which reflected light alone is read, and how long the path before a ray towards a source is where that starts at a meter.
const SEEN: &str = "unseen";
const NO_PATH: f64 = 2e-5;

/// What lets reflected light pass an opening: a ray that meets an illum's front by chance ends there (`badcomponent` of rtrace's source.c), yet goes on
/// where antimatter has taken the illum away. The veil is antimatter to a ray whose last stop, a layer beside it, is as near as that, and
/// nothing to one that comes from farther, as all do that are aimed at the source; the same veil behind the face ends it.
fn veil(k: usize) -> String {
    let near = 1.5 * VEIL_OFFSET;
    format!(
        "void antimatter luminaire-{k}-gone\n2 void luminaire-{k}\n0\n0\n\
         void mixfunc luminaire-{k}-veil\n4 luminaire-{k}-gone void if({near}-Ts*abs(Rdot),1,0) .\n0\n0\n"
    )
}

/// The material: the table as a pattern, turned as the luminaire is.
fn light(
    k: usize,
    luminaire: &Luminaire,
    source: Source,
    correction: Correction,
    factors: &[f64],
    of: Light,
) -> String {
    let coordinates = match luminaire.photometry.distribution.symmetry() {
        Symmetry::Axial => "src_theta",
        _ => "src_phi src_theta",
    };
    let Correction { function, file } = correction;
    let mut words = format!("{function} {} {file} {coordinates}", dat_name(k));
    for (axis, angle_deg) in euler_deg(luminaire.orientation) {
        // Writing to a string cannot fail.
        write!(words, " -r{axis} {angle_deg}").ok();
    }
    let factors: Vec<String> = factors.iter().map(|f| format!("{f:e}")).collect();
    let (kind, behind) = match source {
        Source::Solid => ("light", "0"),
        Source::SeenThrough => ("illum", "1 void"),
    };
    let pattern = if of == Light::Reflected { SEEN } else { "void" };
    format!(
        "{pattern} brightdata luminaire-{k}-candela\n{} {words}\n0\n{} {}\n\
         luminaire-{k}-candela {kind} luminaire-{k}\n{behind}\n0\n3 1 1 1\n",
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
    let turned = [('z', roll), ('y', tilt), ('z', azimuth)];
    let rounded = turned.map(|(axis, a)| (axis, (a.to_degrees() * 1e10).round() / 1e10));
    rounded.into_iter().filter(|(_, a)| *a != 0.0).collect()
}

/// LM-63 for ies2rad: the whole sphere of gamma, the whole circle of C, and the opening.
fn ies(photometry: &Photometry, opening: LuminousOpening) -> String {
    let padded = photometry.distribution.padded(IES2RAD_EDGE_DEG);
    // ies2rad swaps the sides of files over C 90 to 270.
    let distribution = if padded.symmetry() == Symmetry::BilateralC90 { padded.full_circle() } else { padded };
    let keywords = vec![];
    let plain =
        Photometry { distribution, opening, keywords, lamp_lumens: None, details: Details::None, ..photometry.clone() };
    lm63::write_2002(&plain).text
}

/// A flat opening as the box that a published impostor was.
fn with_height(opening: LuminousOpening, settings: &Settings) -> LuminousOpening {
    match opening {
        LuminousOpening::Box { x_m, y_m, height_m: 0.0 } => {
            LuminousOpening::Box { x_m, y_m, height_m: settings.impostor_height_m }
        }
        other => other,
    }
}

fn ies_name(k: usize) -> String {
    format!("luminaire-{k}.ies")
}

fn dat_name(k: usize) -> String {
    format!("luminaire-{k}.dat")
}

/// The candela table in Radiance's data format: gamma alone, or C (0 to 360) by gamma; zero outside its gamma range.
fn dat(distribution: &LuminousIntensityDistribution) -> String {
    let padded = distribution.padded(EDGE_DEG);
    if padded.symmetry() == Symmetry::Axial {
        return format!("1\n{}{}\n", dat_axis(padded.gamma_deg()), joined(padded.plane(0)));
    }
    let full = padded.full_circle();
    let planes: String = (0..full.c_deg().len()).map(|c| joined(full.plane(c)) + "\n").collect();
    format!("2\n{}{}{planes}", dat_axis(full.c_deg()), dat_axis(full.gamma_deg()))
}

/// An axis of unequal steps in that format.
fn dat_axis(angles: &[f64]) -> String {
    format!("0 0 {}\n{}\n", angles.len(), joined(&rising(angles)))
}

/// Angles that rise in single precision, too, in which rtrace holds them: one that would be equal to the one before is the next.
fn rising(angles: &[f64]) -> Vec<f64> {
    let mut last = f32::NEG_INFINITY;
    let mut all = Vec::with_capacity(angles.len());
    for angle in angles {
        let is_rising = *angle as f32 > last;
        last = if is_rising { *angle as f32 } else { last.next_up() };
        all.push(if is_rising { *angle } else { f64::from(last) });
    }
    all
}

/// The most characters of a number written out: rtrace's reader takes words of 63.
const MAX_WORD: usize = 40;

fn joined(values: &[f64]) -> String {
    values.iter().copied().map(word).collect::<Vec<_>>().join(" ")
}

fn word(value: f64) -> String {
    Some(value.to_string()).filter(|w| w.len() <= MAX_WORD).unwrap_or_else(|| format!("{value:e}"))
}

/// Small against the nearest surface, luminaire and meter, so that the sphere touches none of them.
fn point_radius(job: &Job, luminaire: &Luminaire, scale: f64) -> f64 {
    let nearest = job.distances_m(luminaire.position_m).filter(|d| *d > 0.0).fold(f64::INFINITY, f64::min);
    POINT_RADIUS.min(0.01 * nearest * scale).max(MIN_RADIUS)
}
