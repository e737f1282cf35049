//! Lights of `UsdLux`: spheres, disks, rectangles and cylinders, with `shaping:ies:file` or without.
//!
//! Source: `OpenUSD`, `UsdLux`: intensity times two to the power of exposure is luminance in nits, which `normalize` divides
//! by the area of the light. Lights shine along -z, a cylinder lies along x. A profile multiplies the luminance, so that a
//! light has a luminous intensity of luminance times projected area times profile.

use std::f64::consts::PI;

use glam::{DMat4, DVec3};
use luxproof_photometry::{HorizontalAxis, LuminousIntensityDistribution, LuminousOpening, Photometry, lm63};

use super::Reader;
use super::layer::Prim;
use crate::luminaires::{Profile, RawLight, axes};
use crate::raw::Primaries;
use luxproof_process::printable::{Quoted, quoted_path};
use luxproof_scene::LuminaireModel;
use luxproof_spec::SpecError;

/// Steps of a table in gamma and C, in degrees: a cosine that is straight between them is off by 4e-5 and 2e-4.
const GAMMA_STEP_DEG: f64 = 1.0;
const C_STEP_DEG: f64 = 2.0;
/// How far lengths along the axes may differ in a light that is round, relative.
const SAME_LENGTH: f64 = 1e-6;

/// The default of `shaping:cone:angle`, which hides all light upwards where a layer says nothing.
const DEFAULT_CONE_DEG: f64 = 90.0;

/// What else has the ending of a light, and is none that a spec has.
const OTHER_LIGHTS: [(&str, &str); 9] = [
    ("DistantLight", "distant lights"),
    ("DomeLight", "dome lights"),
    ("DomeLight_1", "dome lights"),
    ("GeometryLight", "lights of a mesh"),
    ("MeshLight", "lights of a mesh"),
    ("PortalLight", "portals of dome lights"),
    ("PluginLight", "lights of another program"),
    ("LightFilter", "light filters"),
    ("PluginLightFilter", "light filters"),
];

/// The shape of a light, in metres.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Shape {
    Sphere { radius_m: f64 },
    Disk { radius_m: f64 },
    Rectangle { x_m: f64, y_m: f64 },
    Cylinder { length_m: f64, radius_m: f64 },
}

impl Shape {
    /// The area by which `normalize` divides.
    fn area_m2(self) -> f64 {
        match self {
            Self::Sphere { radius_m } => 4.0 * PI * radius_m * radius_m,
            Self::Disk { radius_m } => PI * radius_m * radius_m,
            Self::Rectangle { x_m, y_m } => x_m * y_m,
            Self::Cylinder { length_m, radius_m } => 2.0 * PI * radius_m * length_m,
        }
    }

    /// The largest area that is seen from a direction, divided by the whole.
    fn projected_share(self) -> f64 {
        match self {
            Self::Sphere { .. } => 0.25,
            Self::Disk { .. } | Self::Rectangle { .. } => 1.0,
            Self::Cylinder { .. } => PI.recip(),
        }
    }

    /// The share of that which is seen from a direction of the light.
    fn seen_share(self, c_deg: f64, gamma_deg: f64) -> f64 {
        let gamma = gamma_deg.to_radians();
        match self {
            Self::Sphere { .. } => 1.0,
            // The cosine of 90 degrees is not quite zero.
            Self::Disk { .. } | Self::Rectangle { .. } if gamma_deg >= 90.0 => 0.0,
            Self::Disk { .. } | Self::Rectangle { .. } => gamma.cos(),
            Self::Cylinder { .. } => {
                let along = gamma.sin() * c_deg.to_radians().cos();
                (1.0 - along * along).max(0.0).sqrt()
            }
        }
    }

    /// Steps in C and gamma in which that is nearly straight.
    fn steps_deg(self) -> (Vec<f64>, Vec<f64>) {
        let gamma = steps(GAMMA_STEP_DEG, 180.0);
        match self {
            Self::Sphere { .. } => (vec![0.0], vec![0.0, 180.0]),
            Self::Disk { .. } | Self::Rectangle { .. } => (vec![0.0], gamma),
            Self::Cylinder { .. } => (steps(C_STEP_DEG, 360.0), gamma),
        }
    }

    /// Those steps with the nodes of a table, between its ends and within a cone: beyond them it is dark at once.
    fn nodes_with(self, table: &LuminousIntensityDistribution, cone_deg: f64) -> (Vec<f64>, Vec<f64>) {
        let (c_deg, gamma_deg) = self.steps_deg();
        // A shape that looks the same from every plane leaves those of the table as they are.
        let all_c = if c_deg.len() == 1 { table.c_deg().to_vec() } else { joined(&c_deg, table.full_circle().c_deg()) };
        let mut all_gamma = joined(&gamma_deg, table.gamma_deg());
        if let [first, .., last] = *table.gamma_deg() {
            all_gamma.retain(|gamma| (first..=last).contains(gamma));
        }
        (all_c, within(all_gamma, cone_deg))
    }

    fn opening(self) -> LuminousOpening {
        match self {
            Self::Sphere { radius_m } => {
                let [x_m, y_m, z_m] = [2.0 * radius_m; 3];
                LuminousOpening::Ellipsoid { x_m, y_m, z_m }
            }
            Self::Disk { radius_m } => {
                LuminousOpening::Ellipse { x_m: 2.0 * radius_m, y_m: 2.0 * radius_m, height_m: 0.0 }
            }
            Self::Rectangle { x_m, y_m } => LuminousOpening::Box { x_m, y_m, height_m: 0.0 },
            Self::Cylinder { length_m, radius_m } => {
                LuminousOpening::LyingCylinder { axis: HorizontalAxis::X, length_m, diameter_m: 2.0 * radius_m }
            }
        }
    }
}

/// Angles from zero to an end.
fn steps(step_deg: f64, end_deg: f64) -> Vec<f64> {
    (0..=(end_deg / step_deg) as usize).map(|k| step_deg * k as f64).collect()
}

impl Reader<'_, '_> {
    /// Takes a light, or says why not; other prims are passed over.
    pub(super) fn light(&mut self, prim: &Prim, to_world: &DMat4) -> Result<(), SpecError> {
        if let Some((_, what)) = OTHER_LIGHTS.iter().find(|(kind, _)| *kind == prim.kind) {
            self.raw.leave_out_light(what, Some(prim.line));
            return Ok(());
        }
        let Some(shape) = self.shape(prim, to_world)? else { return Ok(()) };
        if let Some(what) = untaken(prim, shape) {
            self.raw.leave_out_light(what, Some(prim.line));
            return Ok(());
        }
        let Some(axes) = axes(to_world) else {
            self.raw.leave_out_light("lights that are mirrored or sheared", Some(prim.line));
            return Ok(());
        };
        let candela = candela_per_profile(prim, shape, self.raw.primaries);
        if !(candela.is_finite() && candela > 0.0) {
            self.raw.leave_out_light("lights without light", Some(prim.line));
            return Ok(());
        }
        self.note_controls(prim);
        let is_sphere = matches!(shape, Shape::Sphere { .. });
        let is_point = is_sphere && prim.is_true("treatAsPoint");
        let opening = if is_point { LuminousOpening::Point } else { shape.opening() };
        let Some((profile, flux_scale)) = self.profile(prim, shape, candela, opening)? else { return Ok(()) };
        let model = if is_point {
            Some(LuminaireModel::Point)
        } else if is_sphere && profile_name(prim).is_some() {
            // The opening is the one of the photometric file, if it has one.
            None
        } else {
            Some(LuminaireModel::Area)
        };
        let position = to_world.transform_point3(DVec3::ZERO);
        let light = RawLight { name: Some(prim.name.clone()), position, axes, profile, flux_scale, model };
        self.raw.light(light, Some(prim.line))
    }

    /// Notes inputs that `UsdLux` leaves open, or that are none of the light itself.
    fn note_controls(&mut self, prim: &Prim) {
        if let Some(diffuse) = input(prim, "diffuse").filter(|diffuse| *diffuse != 1.0) {
            let name = Quoted(&prim.name);
            self.raw.note(format!(
                "`{name}`: its intensities are multiplied by its `diffuse` {diffuse}: all surfaces here are diffuse"
            ));
        }
        if is_input(prim, "normalize") && self.unit_m != 1.0 {
            let factor = self.unit_m * self.unit_m;
            self.raw.note(format!(
                "`normalize` divides by an area in square metres. OpenUSD 26.11 does not name the unit (pull request \
                 3587): a program that takes units of the scene has {factor:e} times the light"
            ));
        }
    }

    /// The shape of a light; `None` where a prim is none, or one that is not round.
    fn shape(&mut self, prim: &Prim, to_world: &DMat4) -> Result<Option<Shape>, SpecError> {
        let lengths = [to_world.x_axis, to_world.y_axis, to_world.z_axis].map(|axis| self.unit_m * axis.length());
        let [x, y, z] = lengths;
        let (shape, round) = match prim.kind.as_str() {
            "SphereLight" => (Shape::Sphere { radius_m: x * size(prim, "radius", 0.5) }, [[x, y], [x, z]].to_vec()),
            "DiskLight" => (Shape::Disk { radius_m: x * size(prim, "radius", 0.5) }, [[x, y]].to_vec()),
            "RectLight" => {
                (Shape::Rectangle { x_m: x * size(prim, "width", 1.0), y_m: y * size(prim, "height", 1.0) }, vec![])
            }
            "CylinderLight" => {
                let (length_m, radius_m) = (x * size(prim, "length", 1.0), y * size(prim, "radius", 0.5));
                (Shape::Cylinder { length_m, radius_m }, [[y, z]].to_vec())
            }
            _ => return Ok(None),
        };
        if !(shape.area_m2().is_finite() && shape.area_m2() > 0.0) {
            return Err(self.fault(prim, "it has no size", "give it one"));
        }
        if round.iter().any(|[a, b]| (a - b).abs() > SAME_LENGTH * a.abs()) {
            self.raw.leave_out_light("round lights that are scaled to ovals", Some(prim.line));
            return Ok(None);
        }
        Ok(Some(shape))
    }

    /// The photometric file of a light, and the factor of its intensities.
    fn profile(
        &mut self,
        prim: &Prim,
        shape: Shape,
        candela: f64,
        opening: LuminousOpening,
    ) -> Result<Option<(Profile, f64)>, SpecError> {
        let cone_deg = cone_deg(prim);
        let Some(name) = profile_name(prim) else {
            if opening == LuminousOpening::Point && cone_deg >= 180.0 {
                return Ok(Some((Profile::Isotropic(candela), 1.0)));
            }
            let (c_deg, gamma_deg) = shape.steps_deg();
            let nodes = (c_deg, within(gamma_deg, cone_deg));
            return Ok(self.drawn(prim, |c, gamma| candela * shape.seen_share(c, gamma), nodes, opening));
        };
        let path = self.raw.scene.path_of(name);
        let read = self.raw.scene.read(&path);
        let bytes = read.map_err(|e| {
            let shown = quoted_path(&path);
            self.fault(prim, &format!("its profile {shown} cannot be read: {e}"), "give it next to the scene")
        })?;
        if matches!(shape, Shape::Sphere { .. }) {
            if opening != LuminousOpening::Point {
                self.raw
                    .note("the extent of sphere lights with a profile is the one that their photometric files state");
            }
            if cone_deg >= 180.0 {
                return Ok(Some((Profile::File(bytes), candela)));
            }
        }
        let Ok(photometry) = lm63::parse(&bytes) else {
            self.raw.leave_out_light("lights with a profile that is no LM-63 file", Some(prim.line));
            return Ok(None);
        };
        if !matches!(shape, Shape::Sphere { .. }) {
            self.raw.note(
                "profiles of flat lights and cylinders are multiplied by the area that is seen from each direction (of \
                 flat lights the cosine of gamma), as UsdLux says: the photometric files here have the product",
            );
        }
        let in_type_c = photometry.distribution.in_type_c();
        if in_type_c.largest_error_cd > 0.0 {
            self.raw.note(format!(
                "the profile of `{}` becomes a table of type C: it differs by up to {:.3} of {:.3} cd",
                Quoted(&prim.name),
                in_type_c.largest_error_cd,
                photometry.distribution.max_intensity().value(),
            ));
        }
        let table = in_type_c.distribution;
        let nodes = shape.nodes_with(&table, cone_deg);
        // The opening of a sphere is the one that its file states.
        let opening = if matches!(shape, Shape::Sphere { .. }) { photometry.opening } else { opening };
        let drawn =
            self.drawn(prim, |c, gamma| shape.seen_share(c, gamma) * table.intensity(c, gamma).value(), nodes, opening);
        Ok(drawn.map(|(profile, _)| (profile, candela)))
    }

    /// A photometric file of intensities at the nodes of a table.
    fn drawn(
        &mut self,
        prim: &Prim,
        intensity: impl Fn(f64, f64) -> f64,
        (c_deg, gamma_deg): (Vec<f64>, Vec<f64>),
        opening: LuminousOpening,
    ) -> Option<(Profile, f64)> {
        let candela = c_deg.iter().flat_map(|c| gamma_deg.iter().map(|gamma| intensity(*c, *gamma))).collect();
        let Ok(distribution) = LuminousIntensityDistribution::new(c_deg, gamma_deg, candela) else {
            self.raw.leave_out_light("lights of intensities that no table has", Some(prim.line));
            return None;
        };
        let photometry = Photometry { opening, ..Photometry::of(distribution) };
        Some((Profile::File(lm63::write_2002(&photometry).text.into_bytes()), 1.0))
    }
}

/// Angles of two tables, in order.
fn joined(a: &[f64], b: &[f64]) -> Vec<f64> {
    let mut all = [a, b].concat();
    all.sort_by(f64::total_cmp);
    all.dedup();
    all
}

/// The name of the photometric file of a light.
fn profile_name(prim: &Prim) -> Option<&str> {
    text_input(prim, "shaping:ies:file").filter(|name| !name.is_empty())
}

/// The luminous intensity per candela of a profile, or in candela without one, where most of the light is seen.
fn candela_per_profile(prim: &Prim, shape: Shape, primaries: Primaries) -> f64 {
    let colour = inputs(prim, "color").and_then(|rgb| <[f64; 3]>::try_from(rgb).ok()).unwrap_or([1.0; 3]);
    let nits = input(prim, "intensity").unwrap_or(1.0) * input(prim, "exposure").unwrap_or(0.0).exp2();
    let area_m2 = if is_input(prim, "normalize") { 1.0 } else { shape.area_m2() };
    nits * primaries.luminous(colour) * input(prim, "diffuse").unwrap_or(1.0) * shape.projected_share() * area_m2
}

/// The angle from its axis beyond which a light is dark. `ShapingAPI` has a default.
fn cone_deg(prim: &Prim) -> f64 {
    let default_deg = if prim.is_shaped { DEFAULT_CONE_DEG } else { 180.0 };
    input(prim, "shaping:cone:angle").unwrap_or(default_deg)
}

/// Angles up to the end of a cone, which is one of them where the angles go on beyond.
fn within(mut gamma_deg: Vec<f64>, cone_deg: f64) -> Vec<f64> {
    let count = gamma_deg.len();
    gamma_deg.retain(|gamma| *gamma <= cone_deg);
    if gamma_deg.len() < count && gamma_deg.last().is_some_and(|last| *last < cone_deg) {
        gamma_deg.push(cone_deg);
    }
    gamma_deg
}

/// What of a light a photometric file cannot say.
fn untaken(prim: &Prim, shape: Shape) -> Option<&'static str> {
    // Flat lights shine to one side anyway.
    let widest_deg = if matches!(shape, Shape::Disk { .. } | Shape::Rectangle { .. }) { 90.0 } else { 180.0 };
    let findings = [
        (
            input(prim, "shaping:ies:angleScale").is_some_and(|scale| scale != 0.0),
            "lights with scaled profiles (angleScale)",
        ),
        (is_input(prim, "shaping:ies:normalize"), "lights with normalised profiles (shaping:ies:normalize)"),
        (
            cone_deg(prim) < widest_deg && input(prim, "shaping:cone:softness").is_some_and(|softness| softness != 0.0),
            "lights with a soft cone (shaping:cone:softness)",
        ),
        (input(prim, "shaping:focus").is_some_and(|focus| focus != 0.0), "lights with a focus (shaping:focus)"),
        (text_input(prim, "texture:file").is_some_and(|file| !file.is_empty()), "lights with a texture (texture:file)"),
    ];
    findings.into_iter().find(|(is_found, _)| *is_found).map(|(_, what)| what)
}

/// The numbers of an input, which layers before 2021 name without `inputs:`.
fn inputs<'p>(prim: &'p Prim, name: &str) -> Option<&'p [f64]> {
    prim.numbers(&format!("inputs:{name}")).or_else(|| prim.numbers(name))
}

fn input(prim: &Prim, name: &str) -> Option<f64> {
    inputs(prim, name)?.first().copied()
}

/// A length of a light in units.
fn size(prim: &Prim, name: &str, default: f64) -> f64 {
    input(prim, name).unwrap_or(default)
}

fn text_input<'p>(prim: &'p Prim, name: &str) -> Option<&'p str> {
    prim.text(&format!("inputs:{name}")).or_else(|| prim.text(name))
}

fn is_input(prim: &Prim, name: &str) -> bool {
    prim.is_true(&format!("inputs:{name}")) || prim.is_true(name)
}
