//! The spec's shape: one type a part of the file, unknown keys refused.

use std::collections::BTreeMap;
use std::path::PathBuf;

use luminaire::geometry::Reflectances;
use schemars::JsonSchema;
use serde::de::{Deserializer, IgnoredAny};
use serde::{Deserialize, Serialize};

use crate::procedures::Procedures;
use crate::procedures::shapes::{Found, Shapes};

/// The version of a format that this program reads, told with all else that is of the wrong form.
fn known_version<'de, D: serde::Deserializer<'de>>(of: D) -> Result<u32, D::Error> {
    let found = u32::deserialize(of)?;
    let unknown =
        || serde::de::Error::custom(format!("format version {found} is not known: this program reads version 1"));
    if found == 1 { Ok(found) } else { Err(unknown()) }
}

/// A luxproof spec: a room, luminaires, measuring points and the procedures to run on them.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Spec {
    /// Version of the format: 1.
    #[serde(deserialize_with = "known_version")]
    pub luxproof: u32,
    /// What the case is, in a line.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub title: Option<String>,
    /// The room.
    pub room: RoomSpec,
    /// Opaque diffuse bodies.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub obstacles: Vec<ObstacleSpec>,
    /// The luminaires, at least one.
    pub luminaires: Vec<LuminaireSpec>,
    /// Named sets of measuring points.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub meters: BTreeMap<String, MeterSet>,
    /// What is measured.
    pub procedures: Procedures,
    /// Engines to run, with settings; all that are there by default.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub engines: Option<BTreeMap<String, EngineSettings>>,
    /// When an engine may stop.
    #[serde(default, skip_serializing_if = "is_default")]
    pub budget: Budget,
    /// Tables of a paper as further references, relative to the spec.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub published: Option<PathBuf>,
    /// Overrides of the default tolerances, by procedure.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub tolerances: BTreeMap<String, ToleranceOverride>,
    /// Overrides that make a suite of the spec, each a case of its own: a list, each with a `name`, or a matrix.
    #[serde(default, skip_serializing)]
    #[schemars(with = "Option<CasesSchema>")]
    pub cases: Option<IgnoredAny>,
}

/// The shape of `cases`; they are read and checked where they are laid over the spec.
#[derive(JsonSchema)]
#[schemars(rename = "Cases", untagged)]
#[allow(dead_code, reason = "the shape of overrides in the schema")]
enum CasesSchema {
    /// Overrides with a `name` each.
    List(Vec<BTreeMap<String, serde_json::Value>>),
    /// Axes of named overrides; every combination is a case.
    Matrix(BTreeMap<String, BTreeMap<String, Option<BTreeMap<String, serde_json::Value>>>>),
}

/// A closed box room with one corner at the origin, z up.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RoomSpec {
    /// Extents along x, y, z in metres.
    pub size_m: [f64; 3],
    /// Diffuse reflectances.
    pub reflectance: ReflectanceSpec,
}

/// Diffuse reflectances of the surfaces, each 0 to 1.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ReflectanceSpec {
    /// Of the floor.
    pub floor: Fraction,
    /// Of the walls: one number, or one a wall.
    pub walls: Walls,
    /// Of the ceiling.
    pub ceiling: Fraction,
}

impl ReflectanceSpec {
    /// The six reflectances.
    pub fn build(&self) -> Reflectances {
        let (floor, ceiling) = (self.floor.0, self.ceiling.0);
        match &self.walls {
            Walls::All(rho) => Reflectances::with_equal_walls(floor, rho.0, ceiling),
            Walls::Each(walls) => Reflectances {
                floor,
                ceiling,
                wall_x_min: walls.x_min.0,
                wall_x_max: walls.x_max.0,
                wall_y_min: walls.y_min.0,
                wall_y_max: walls.y_max.0,
            },
        }
    }
}

/// A number from 0 to 1.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, JsonSchema)]
#[serde(transparent)]
pub struct Fraction(#[schemars(range(min = 0, max = 1))] pub f64);

impl<'de> Deserialize<'de> for Fraction {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let read = |found: Found<'_>| found.number().map(Self::checked);
        deserializer.deserialize_any(Shapes { expected: "a number between 0 and 1", read })
    }
}

impl Fraction {
    fn checked(value: f64) -> Result<Self, String> {
        let sound = (0.0..=1.0).contains(&value);
        sound.then_some(Self(value)).ok_or_else(|| format!("a reflectance lies between 0 and 1, not at {value}"))
    }
}

/// Reflectance of the walls.
#[derive(Clone, Debug, Serialize, JsonSchema)]
#[serde(untagged)]
pub enum Walls {
    /// All four alike.
    All(Fraction),
    /// One a wall.
    Each(FourWalls),
}

/// Reflectance of each wall.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FourWalls {
    /// The wall at x = 0.
    #[serde(rename = "x-")]
    pub x_min: Fraction,
    /// The wall at x = length.
    #[serde(rename = "x+")]
    pub x_max: Fraction,
    /// The wall at y = 0.
    #[serde(rename = "y-")]
    pub y_min: Fraction,
    /// The wall at y = width.
    #[serde(rename = "y+")]
    pub y_max: Fraction,
}

impl<'de> Deserialize<'de> for Walls {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let expected = "one number for all walls, or {x-: , x+: , y-: , y+: }";
        let read = |found: Found<'_, IgnoredAny, FourWalls>| match found {
            Found::Keys(walls) => Some(Ok(Self::Each(walls))),
            _ => found.number().map(|rho| Fraction::checked(rho).map(Self::All)),
        };
        deserializer.deserialize_any(Shapes { expected, read })
    }
}

/// An opaque diffuse body: exactly one of `box` and `mesh`.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ObstacleSpec {
    /// An axis-aligned box.
    #[serde(default, rename = "box", skip_serializing_if = "Option::is_none")]
    pub cuboid: Option<BoxSpec>,
    /// A triangle mesh.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub mesh: Option<MeshSpec>,
}

/// An axis-aligned box.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct BoxSpec {
    /// Lower corner in metres.
    pub min_m: [f64; 3],
    /// Upper corner in metres.
    pub max_m: [f64; 3],
    /// Diffuse reflectance.
    pub reflectance: Fraction,
}

/// A triangle mesh from a Wavefront OBJ file.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MeshSpec {
    /// The file, relative to the spec; its unit is the metre.
    pub file: PathBuf,
    /// Where the file's origin comes to lie, in metres.
    #[serde(default, skip_serializing_if = "is_default")]
    pub at_m: [f64; 3],
    /// Diffuse reflectance.
    pub reflectance: Fraction,
}

/// A luminaire in its place.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LuminaireSpec {
    /// Its name.
    pub id: String,
    /// Photometric file, relative to the spec: .ies, .ldt or .xml (TM-33).
    pub photometry: PathBuf,
    /// Photometric centre in metres.
    pub at_m: [f64; 3],
    /// Azimuth about z, then tilt about the turned y axis, then roll about the luminaire's own axis.
    #[serde(default, skip_serializing_if = "is_default")]
    pub rotate_deg: RotationSpec,
    /// Dimming or maintenance factor.
    #[serde(default = "one", skip_serializing_if = "is_one")]
    pub flux_scale: f64,
    /// How its extent is modelled.
    #[serde(default, skip_serializing_if = "is_default")]
    pub model: ModelSpec,
}

fn one() -> f64 {
    1.0
}

#[allow(clippy::trivially_copy_pass_by_ref, reason = "serde asks for it")]
fn is_one(x: &f64) -> bool {
    *x == 1.0
}

fn is_default<T: Default + PartialEq>(x: &T) -> bool {
    *x == T::default()
}

/// Rotation of a luminaire in degrees.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RotationSpec {
    /// About z.
    #[serde(skip_serializing_if = "is_default")]
    pub azimuth: f64,
    /// About the turned y axis.
    #[serde(skip_serializing_if = "is_default")]
    pub tilt: f64,
    /// About the luminaire's own axis.
    #[serde(skip_serializing_if = "is_default")]
    pub roll: f64,
}

/// How much of a luminaire's body is modelled.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum ModelSpec {
    /// All light from the photometric centre.
    #[default]
    Point,
    /// Light from the file's luminous opening.
    Area,
    /// An impostor surface (Radiance's illum).
    Impostor,
}

/// A named set of measuring points: exactly one of `points_m` and `grid`.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MeterSet {
    /// Points in metres.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub points_m: Option<Vec<[f64; 3]>>,
    /// A regular grid of points.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub grid: Option<GridSpec>,
    /// The normal of all of them, any length.
    pub normal: [f64; 3],
}

/// A regular grid: origin + i u + j v, i fastest.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct GridSpec {
    /// First point.
    pub origin_m: [f64; 3],
    /// Step along the first index.
    pub u_m: [f64; 3],
    /// Step along the second index.
    pub v_m: [f64; 3],
    /// Points along u and v.
    pub counts: [usize; 2],
}

/// When an engine may stop: at whichever comes first.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Budget {
    /// Standard error relative to the reading.
    pub relative_error: f64,
    /// Seconds an engine and procedure, as the engine counts them; a program of the user's keeps to its clock.
    pub seconds: f64,
}

impl Default for Budget {
    fn default() -> Self {
        Self { relative_error: 0.002, seconds: 60.0 }
    }
}

/// Settings of one engine; `null` or `{}` for none.
#[derive(Clone, Debug, Default, PartialEq, Serialize, JsonSchema)]
#[serde(transparent)]
pub struct EngineSettings(pub BTreeMap<String, serde_json::Value>);

impl<'de> Deserialize<'de> for EngineSettings {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        Option::<BTreeMap<String, serde_json::Value>>::deserialize(deserializer).map(|s| Self(s.unwrap_or_default()))
    }
}

/// An override of a default tolerance.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ToleranceOverride {
    /// Relative to the reference.
    pub relative: f64,
    /// Absolute, in lux.
    pub absolute_lx: f64,
    /// Absolute, in candela.
    pub absolute_cd: f64,
}
