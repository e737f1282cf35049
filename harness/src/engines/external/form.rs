//! The two forms that an external adapter reads and writes: a job and its readings, both JSON; pure.

use std::collections::BTreeMap;

use glam::DVec3;
use luminaire::geometry::Surface;
use luminaire::photometry::{HorizontalAxis, LuminousOpening};
use luminaire::scene::{Bounces, Luminaire, LuminaireModel, Obstacle, Scene, Shape, Transport};
use schemars::JsonSchema;
use serde::{Deserialize, Deserializer, Serialize};

use crate::engines::contract::same_meters;
use crate::engines::{EngineError, Job, Measurement, Station, checked, recess};
use crate::record::{EngineName, Estimate, ProcedureId, Uncertainty};
use crate::spec::Budget;
use crate::system::printable;

const VERSION: u32 = 1;

/// What an adapter reads on its standard input: everything in metres, candela, lux and world coordinates with z up.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct ExternalJob {
    /// Version of the form: 1.
    luxproof_job: u32,
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

/// What an adapter prints on its standard output: one reading a meter in the job's order, or why it declines.
#[derive(Clone, Debug, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ExternalReadings {
    /// One a meter.
    readings: Vec<ReadingForm>,
    /// Instead of readings: why it cannot do this job, which is then skipped for this reason.
    declined: Option<String>,
    /// What was done, for whoever repeats it: versions, solver, options.
    settings: BTreeMap<String, String>,
    /// How much of it: samples, seeds, seconds; a baseline does not ask for the same.
    effort: BTreeMap<String, String>,
    /// What the reader of the report should know.
    notes: Vec<String>,
}

/// One reading.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct ReadingForm {
    /// The meter's name.
    meter: String,
    /// Illuminance, finite; what is negative is judged like any other. Null or `NaN`: this meter has none, which fails the engine, and those
    /// of the others are kept.
    #[serde(deserialize_with = "number")]
    illuminance_lx: f64,
    /// Standard error of a Monte Carlo mean.
    #[serde(default, deserialize_with = "some_number")]
    std_error_lx: Option<f64>,
    /// Distance within which the true value lies, for deterministic methods.
    #[serde(default, deserialize_with = "some_number")]
    error_bound_lx: Option<f64>,
    /// Of the standard error: one less than the independent samples that it was estimated from.
    #[serde(default, deserialize_with = "some_number")]
    degrees_of_freedom: Option<f64>,
    /// Whether the value is claimed to be right to its last digit.
    #[serde(default)]
    exact: bool,
}

/// A number, or what programs write in its place that have none.
#[derive(Deserialize)]
#[serde(untagged, expecting = "a number")]
enum Number {
    Told(f64),
    Word(NoNumber),
    Null(()),
}

/// As Python writes them, in quotes.
#[derive(Deserialize)]
enum NoNumber {
    #[serde(rename = "NaN", alias = "Infinity", alias = "-Infinity")]
    NotFinite,
}

impl From<Number> for f64 {
    fn from(number: Number) -> Self {
        match number {
            Number::Told(value) => value,
            Number::Word(NoNumber::NotFinite) | Number::Null(()) => Self::NAN,
        }
    }
}

fn number<'de, D: Deserializer<'de>>(from: D) -> Result<f64, D::Error> {
    Number::deserialize(from).map(f64::from)
}

fn some_number<'de, D: Deserializer<'de>>(from: D) -> Result<Option<f64>, D::Error> {
    Option::<Number>::deserialize(from).map(|number| number.map(f64::from))
}

/// JSON with `NaN` and infinities, which Python writes and JSON has not, made words in quotes.
fn quoted(text: &str) -> String {
    let (mut quoted, mut is_string, mut is_escaped) = (String::with_capacity(text.len()), false, false);
    let mut rest = text;
    while let Some(c) = rest.chars().next() {
        let word = ["NaN", "Infinity", "-Infinity"].into_iter().find(|word| !is_string && rest.starts_with(word));
        if let Some(word) = word {
            quoted.extend(["\"", word, "\""]);
        } else {
            quoted.push(c);
        }
        is_string ^= c == '"' && !is_escaped;
        is_escaped = is_string && c == '\\' && !is_escaped;
        rest = &rest[word.map_or(c.len_utf8(), str::len)..];
    }
    quoted
}

impl ExternalReadings {
    /// What an adapter printed.
    pub fn from_json(text: &[u8]) -> Result<Self, serde_json::Error> {
        serde_json::from_slice(text).or_else(|error| {
            let quoted = quoted(&String::from_utf8_lossy(text));
            serde_json::from_str(&quoted).map_err(|_| error)
        })
    }

    /// The measurement that an adapter printed for a job, checked like every engine's.
    pub fn measured(text: &[u8], job: &Job, engine: &EngineName) -> Result<Measurement, EngineError> {
        checked(engine, job, measurement(text, job, engine)?)
    }
}

impl ReadingForm {
    fn uncertainty(&self) -> Uncertainty {
        let [error, bound] = [self.std_error_lx, self.error_bound_lx].map(|e| e.map(no_smaller_than_counts));
        match (self.exact, error, bound) {
            (true, ..) => Uncertainty::Exact,
            (_, Some(value), bound) => Uncertainty::StandardError {
                value,
                degrees_of_freedom: self.degrees_of_freedom,
                bound: bound.unwrap_or(0.0),
            },
            (_, None, Some(bound)) => Uncertainty::Bound(bound),
            (_, None, None) => Uncertainty::Unstated,
        }
    }

    /// What is wrong with its degrees of freedom, if anything is.
    fn senseless_freedom(&self) -> Option<String> {
        let freedom = self.degrees_of_freedom.filter(|f| *f < 1.0)?;
        let meter = &self.meter;
        Some(format!("gave `degrees_of_freedom: {freedom}` at {meter}: two samples have one, fewer tell no error"))
    }
}

/// An error that is smaller is as good as this one, of which weights and fourth powers are numbers still.
fn no_smaller_than_counts(error_lx: f64) -> f64 {
    if error_lx > 0.0 { error_lx.max(1e-30) } else { error_lx }
}

impl ExternalJob {
    pub fn of(job: &Job) -> Self {
        let job = &*recess::apart(job);
        let light = match job.transport {
            Transport::Direct => Light::Direct,
            Transport::Indirect(_) => Light::Indirect,
            Transport::Total(_) => Light::Total,
        };
        let bounces = match job.reflections() {
            Some(Bounces::AtMost(n)) => Some(n),
            Some(Bounces::Converged) | None => None,
        };
        let ours = ["command", "procedures", super::RUN_IN];
        let settings = job.settings.iter().filter(|(k, _)| !ours.contains(&k.as_str()));
        Self {
            luxproof_job: VERSION,
            case: job.case.clone(),
            procedure: job.procedure,
            light,
            bounces,
            room: room(&job.scene),
            obstacles: job.scene.obstacles.iter().map(obstacle).collect(),
            luminaires: job.scene.luminaires.iter().map(luminaire).collect(),
            meters: job.stations.iter().map(meter).collect(),
            budget: job.budget,
            seed: job.seed,
            settings: settings.map(|(k, v)| (k.clone(), v.clone())).collect(),
        }
    }

    pub fn to_json(&self) -> Result<Vec<u8>, serde_json::Error> {
        serde_json::to_vec_pretty(self)
    }
}

fn room(scene: &Scene) -> Option<RoomForm> {
    let room = scene.room?;
    let name = |s: Surface| match s {
        Surface::Floor => "floor",
        Surface::Ceiling => "ceiling",
        Surface::WallXMin => "x-",
        Surface::WallXMax => "x+",
        Surface::WallYMin => "y-",
        Surface::WallYMax => "y+",
    };
    let reflectance = Surface::ALL.into_iter().map(|s| (name(s), room.reflectance.of(s))).collect();
    Some(RoomForm { size_m: room.size_m.to_array(), reflectance })
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
    let table = luminaire.photometry.distribution.full_circle().scaled(luminaire.flux_scale);
    LuminaireForm {
        id: luminaire.id.clone(),
        model: luminaire.model.name(),
        position_m: luminaire.position_m.to_array(),
        axes: luminaire.orientation.to_cols_array_2d(),
        opening: (luminaire.model != LuminaireModel::Point).then(|| opening(luminaire.photometry.opening)),
        c_deg: table.c_deg().to_vec(),
        gamma_deg: table.gamma_deg().to_vec(),
        candela: (0..table.c_deg().len()).map(|c| table.plane(c).to_vec()).collect(),
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

fn meter(station: &Station) -> MeterForm {
    MeterForm {
        id: station.id.0.clone(),
        position_m: station.meter.position_m.to_array(),
        normal: station.meter.normal.to_array(),
    }
}

/// Reads what an adapter printed; every meter must be there once, in order.
fn measurement(stdout: &[u8], job: &Job, engine: &EngineName) -> Result<Measurement, EngineError> {
    let answer = ExternalReadings::from_json(stdout)
        .map_err(|e| EngineError::no_readings(engine.clone(), &String::from_utf8_lossy(stdout), &e))?;
    let output = |what: &str| EngineError::output(engine.clone(), what);
    match answer.declined {
        Some(why) if why.trim().is_empty() => {
            return Err(output("declined for no reason: `declined` says what it cannot do"));
        }
        Some(_) if !answer.readings.is_empty() => {
            return Err(output("declined and gave readings: give either `declined` or `readings`"));
        }
        Some(why) => return Err(EngineError::Declined { engine: engine.clone(), why: printable::lines(&why) }),
        None => {}
    }
    if let Some(what) = answer.readings.iter().find_map(ReadingForm::senseless_freedom) {
        return Err(output(&what));
    }
    same_meters(engine, job, answer.readings.iter().map(|reading| reading.meter.as_str()))?;
    let estimate = |r: &ReadingForm| Estimate { value: r.illuminance_lx, uncertainty: r.uncertainty() };
    let mut estimates: Vec<Estimate> = answer.readings.iter().map(estimate).collect();
    Estimate::mark_agreeing(&mut estimates);
    Estimate::mark_unseen(&mut estimates);
    let shown = |said: BTreeMap<String, String>| -> BTreeMap<String, String> {
        said.into_iter().map(|(key, value)| (printable::lines(&key), printable::lines(&value))).collect()
    };
    Ok(Measurement {
        estimates,
        method: shown(answer.settings).into_iter().collect(),
        effort: shown(answer.effort).into_iter().collect(),
        notes: answer.notes.iter().map(|note| printable::lines(note)).collect(),
        ..Measurement::default()
    })
}
