//! A job as an external adapter reads it, in JSON; pure.

use std::collections::BTreeMap;

use glam::DVec3;
use luxproof_photometry::{HorizontalAxis, LuminousOpening, TypeCLimits};
use luxproof_scene::geometry::Surface;
use luxproof_scene::{Bounces, Luminaire, LuminaireModel, Obstacle, Scene, Shape, Transport};
use schemars::JsonSchema;
use serde::Serialize;

use super::photometry::PhotometryForm;
use super::protocol::PROTOCOL;
use crate::{Job, Sensor, recess};
use luxproof_model::ProcedureId;
use luxproof_spec::Budget;

/// What an adapter reads on its standard input: everything in metres, candela, lux and world coordinates with z up.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct ExternalJob {
    /// The version of the protocol: 2.
    luxproof_job: u32,
    /// Its name among the jobs of a request.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(required)]
    job: Option<String>,
    /// The case.
    case: String,
    /// The procedure.
    procedure: ProcedureId,
    /// Which light counts: straight from the luminaires, reflected at least once, or both.
    light: Light,
    /// Light reflected more often than this does not count; null: all of it counts.
    bounces: Option<u32>,
    /// The closed room, one corner at the origin; null: free field.
    room: Option<RoomForm>,
    /// Opaque diffuse bodies.
    obstacles: Vec<ObstacleForm>,
    /// The luminaires.
    luminaires: Vec<LuminaireForm>,
    /// Where illuminance is asked for.
    meters: Vec<MeterForm>,
    /// When to stop: at whichever comes first.
    budget: Budget,
    /// Seed of every random choice.
    seed: u64,
    /// The engine's settings from the spec, `command` and `procedures` left out.
    settings: BTreeMap<String, serde_json::Value>,
}

/// Which light counts.
#[derive(Clone, Copy, Debug, Serialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
enum Light {
    /// Straight from the luminaires.
    Direct,
    /// Reflected at least once.
    Indirect,
    /// Both.
    Total,
}

/// A box room.
#[derive(Clone, Debug, Serialize, JsonSchema)]
struct RoomForm {
    /// Extents along x, y, z.
    size_m: [f64; 3],
    /// Diffuse reflectances: `floor`, `ceiling` and the walls `x-`, `x+`, `y-`, `y+`.
    reflectance: BTreeMap<&'static str, f64>,
}

/// A body: `min_m` and `max_m` of a box, or `vertices_m` and `triangles` of a mesh whose both sides reflect.
#[derive(Clone, Debug, Serialize, JsonSchema)]
#[serde(untagged)]
enum ObstacleForm {
    /// An axis-aligned box.
    Box { min_m: [f64; 3], max_m: [f64; 3], reflectance: f64 },
    /// Triangles.
    Mesh { vertices_m: Vec<[f64; 3]>, triangles: Vec<[u32; 3]>, reflectance: f64 },
}

/// A luminaire.
#[derive(Clone, Debug, Serialize, JsonSchema)]
struct LuminaireForm {
    /// Its name.
    id: String,
    /// `point`, `area` or `impostor`.
    model: &'static str,
    /// Photometric centre.
    position_m: [f64; 3],
    /// Where the luminaire's own x (C 0), y (C 90) and z axis (away from the nadir) point.
    axes: [[f64; 3]; 3],
    /// Its luminous opening; null for the model `point`.
    opening: Option<OpeningForm>,
    /// C planes in degrees, rising from 0 to 360.
    c_deg: Vec<f64>,
    /// Angles from the nadir in degrees, rising; beyond the first and the last there is no light.
    gamma_deg: Vec<f64>,
    /// Intensity, one row a C plane, flux scale applied; bilinear in (C, gamma) between.
    candela: Vec<Vec<f64>>,
    /// The factor that is applied to the table but not to the file.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(required)]
    flux_scale: Option<f64>,
    /// The photometric file of the table, byte for byte.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(required)]
    photometry: Option<PhotometryForm>,
}

/// A luminous opening, centred on the photometric centre, extents along the luminaire's own axes.
#[derive(Clone, Debug, Serialize, JsonSchema)]
struct OpeningForm {
    /// `point`, `box`, `upright_cylinder` (`box` and `upright_cylinder` are flat where z is 0), `ellipsoid`, `cylinder_along_x` or
    /// `cylinder_along_y`.
    shape: &'static str,
    /// Extents along x, y and z.
    size_m: [f64; 3],
}

/// A meter.
#[derive(Clone, Debug, Serialize, JsonSchema)]
struct MeterForm {
    /// Its name.
    id: String,
    /// Its position.
    position_m: [f64; 3],
    /// Its unit normal: it reads light that arrives on this side.
    normal: [f64; 3],
}

impl ExternalJob {
    /// Describes a job without a name and without files. This form is part of cache keys.
    pub fn of(job: &Job) -> Self {
        let job = &*recess::separate(job);
        let light = match job.transport {
            Transport::Direct => Light::Direct,
            Transport::Indirect(_) => Light::Indirect,
            Transport::Total(_) => Light::Total,
        };
        let bounces = match job.reflections() {
            Some(Bounces::AtMost(n)) => Some(n),
            Some(Bounces::Converged) | None => None,
        };
        let settings = job.settings.iter().filter(|(k, _)| !super::OWN_SETTINGS.contains(&k.as_str()));
        Self {
            luxproof_job: PROTOCOL,
            job: None,
            case: job.case.clone(),
            procedure: job.procedure,
            light,
            bounces,
            room: room(&job.scene),
            obstacles: job.scene.obstacles.iter().map(obstacle).collect(),
            luminaires: job.scene.luminaires.iter().map(luminaire).collect(),
            meters: job.sensors.iter().map(meter).collect(),
            budget: job.budget,
            seed: job.seed,
            settings: settings.map(|(k, v)| (k.clone(), v.clone())).collect(),
        }
    }

    /// Describes a job of a request, with its name and the photometric file of each luminaire.
    pub(super) fn for_request(name: String, job: &Job, photometry: Vec<PhotometryForm>) -> Self {
        let unnamed = Self::of(job);
        let mut luminaires = unnamed.luminaires;
        for ((form, file), luminaire) in luminaires.iter_mut().zip(photometry).zip(&job.scene.luminaires) {
            (form.flux_scale, form.photometry) = (Some(luminaire.flux_scale), Some(file));
        }
        Self { job: Some(name), luminaires, ..unnamed }
    }

    pub fn to_json(&self) -> Result<Vec<u8>, serde_json::Error> {
        serde_json::to_vec_pretty(self)
    }
}

fn room(scene: &Scene) -> Option<RoomForm> {
    let room = scene.room?;
    let reflectance = Surface::ALL.into_iter().map(|s| (surface_name(s), room.reflectance.of(s))).collect();
    Some(RoomForm { size_m: room.size_m.to_array(), reflectance })
}

const fn surface_name(surface: Surface) -> &'static str {
    match surface {
        Surface::Floor => "floor",
        Surface::Ceiling => "ceiling",
        Surface::WallXMin => "x-",
        Surface::WallXMax => "x+",
        Surface::WallYMin => "y-",
        Surface::WallYMax => "y+",
    }
}

fn obstacle(obstacle: &Obstacle) -> ObstacleForm {
    let reflectance = obstacle.reflectance;
    match &obstacle.shape {
        Shape::Box { min_m, max_m } => {
            ObstacleForm::Box { min_m: min_m.to_array(), max_m: max_m.to_array(), reflectance }
        }
        Shape::Mesh { vertices_m, triangles } => ObstacleForm::Mesh {
            vertices_m: vertices_m.iter().map(DVec3::to_array).collect(),
            triangles: triangles.clone(),
            reflectance,
        },
    }
}

fn luminaire(luminaire: &Luminaire) -> LuminaireForm {
    // Programs get tables of type C alone; this is what our own solvers' jobs of other types are known by.
    let model = luminaire.model;
    let luminaire = &Luminaire { model: LuminaireModel::Point, ..luminaire.clone() }.in_type_c(TypeCLimits::default());
    let table = luminaire.photometry.distribution.full_circle().scaled(luminaire.flux_scale);
    LuminaireForm {
        id: luminaire.id.clone(),
        model: model.name(),
        position_m: luminaire.position_m.to_array(),
        axes: luminaire.orientation.to_cols_array_2d(),
        opening: (model != LuminaireModel::Point).then(|| opening(luminaire.photometry.opening)),
        c_deg: table.c_deg().to_vec(),
        gamma_deg: table.gamma_deg().to_vec(),
        candela: (0..table.c_deg().len()).map(|c| table.plane(c).to_vec()).collect(),
        flux_scale: None,
        photometry: None,
    }
}

fn opening(opening: LuminousOpening) -> OpeningForm {
    let shape = match opening {
        LuminousOpening::Point => "point",
        LuminousOpening::Box { .. } => "box",
        LuminousOpening::Ellipse { .. } => "upright_cylinder",
        LuminousOpening::Ellipsoid { .. } => "ellipsoid",
        LuminousOpening::LyingCylinder { axis: HorizontalAxis::X, .. } => "cylinder_along_x",
        LuminousOpening::LyingCylinder { axis: HorizontalAxis::Y, .. } => "cylinder_along_y",
    };
    let [y, x, z] = opening.bounding_box_m();
    OpeningForm { shape, size_m: [x, y, z] }
}

fn meter(sensor: &Sensor) -> MeterForm {
    MeterForm {
        id: sensor.id.0.clone(),
        position_m: sensor.meter.position_m.to_array(),
        normal: sensor.meter.normal.to_array(),
    }
}
