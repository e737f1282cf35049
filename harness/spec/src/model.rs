//! The spec's shape: one type a part of the file, unknown keys refused.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::time::Duration;

use luxproof_scene::geometry::{Reflectances, Surface};
use schemars::JsonSchema;
use serde::de::{Deserializer, IgnoredAny};
use serde::{Deserialize, Serialize};

pub use crate::length_unit::LengthUnit;
use crate::procedures::Procedures;
use luxproof_model::HiddenVariant;
use luxproof_model::shapes::{ShapedValue, Shapes};

/// The version of a format that this program reads, reported with all other errors of form.
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
    /// The unit of all lengths, those of keys that end with `_m`; metres by default.
    #[serde(default, skip_serializing_if = "is_default")]
    pub unit: LengthUnit,
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
    /// What the spec was drawn from, where it is a hidden variant of a public case.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub hidden_variant: Option<HiddenVariant>,
    /// Overrides that make a suite of the spec, each a case of its own: a list, each with a `name`, or a matrix.
    #[serde(default, skip_serializing)]
    #[schemars(with = "Option<CasesSchema>")]
    pub cases: Option<IgnoredAny>,
    /// Cases that are held against each other by their ratios: `[before, after]`, or a list of such pairs.
    #[serde(default, skip_serializing)]
    #[schemars(with = "Option<CompareSchema>")]
    pub compare: Option<IgnoredAny>,
}

/// The shape of `compare`; it is read and checked beside the cases that it names.
#[derive(JsonSchema)]
#[schemars(rename = "Compare", untagged)]
#[allow(dead_code, reason = "the shape of pairs in the schema")]
enum CompareSchema {
    /// Before and after.
    Pair([String; 2]),
    /// Several pairs.
    Pairs(Vec<[String; 2]>),
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

/// A closed room, z up: exactly one of a box (`size_m`), upright walls over a polygon (`floor_m` and `height_m`) and a `mesh`.
#[derive(Clone, Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RoomSpec {
    /// Extents of a box along x, y, z in metres, one corner at the origin.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub size_m: Option<[f64; 3]>,
    /// Corners of the floor in metres, in order; none of their coordinates is negative.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub floor_m: Option<Vec<[f64; 2]>>,
    /// Height over such a floor in metres.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub height_m: Option<f64>,
    /// A Wavefront OBJ file whose faces close the room, in metres, relative to the spec.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub mesh: Option<PathBuf>,
    /// Diffuse reflectance of each group (`g` or `o`) of the mesh.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub groups: Option<BTreeMap<String, Fraction>>,
    /// Diffuse reflectances of a box, or of a room over a polygon.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reflectance: Option<ReflectanceSpec>,
}

impl RoomSpec {
    /// A box.
    pub fn cuboid(size_m: [f64; 3], reflectance: ReflectanceSpec) -> Self {
        Self { size_m: Some(size_m), reflectance: Some(reflectance), ..Self::default() }
    }
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
    /// The six reflectances of a box; `None` where its walls are listed as those over a polygon are.
    pub fn build(&self) -> Option<Reflectances> {
        let (floor, ceiling) = (self.floor.0, self.ceiling.0);
        match &self.walls {
            Walls::All(rho) => Some(Reflectances::with_equal_walls(floor, rho.0, ceiling)),
            Walls::Each(walls) => Some(Reflectances {
                floor,
                ceiling,
                wall_x_min: walls.x_min.0,
                wall_x_max: walls.x_max.0,
                wall_y_min: walls.y_min.0,
                wall_y_max: walls.y_max.0,
            }),
            Walls::Listed(_) => None,
        }
    }

    /// Those of so many walls over a polygon; `None` where they are those of a box.
    pub fn of_walls(&self, walls: usize) -> Option<Vec<f64>> {
        match &self.walls {
            Walls::All(rho) => Some(vec![rho.0; walls]),
            Walls::Listed(listed) => Some(listed.iter().map(|rho| rho.0).collect()),
            Walls::Each(_) => None,
        }
    }
}

/// A number from 0 to 1.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, JsonSchema)]
#[serde(transparent)]
pub struct Fraction(#[schemars(range(min = 0, max = 1))] pub f64);

impl<'de> Deserialize<'de> for Fraction {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let expected = "a number between 0 and 1";
        deserializer
            .deserialize_any(Shapes { expected, read: |found: ShapedValue<'_>| found.number().map(Self::checked) })
    }
}

impl Fraction {
    const fn zero() -> Self {
        Self(0.0)
    }

    #[allow(clippy::trivially_copy_pass_by_ref, reason = "serde asks for it")]
    fn is_zero(&self) -> bool {
        self.0 == 0.0
    }

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
    /// One a wall of a box.
    Each(FourWalls),
    /// One a wall over a polygon: the first runs from its first corner to the second.
    Listed(Vec<Fraction>),
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
        let expected = "one number for all walls, {x-: , x+: , y-: , y+: } of a box, or a list over a polygon";
        deserializer.deserialize_any(Shapes { expected, read: Self::of_found })
    }
}

impl Walls {
    fn of_found(found: ShapedValue<'_, Vec<Fraction>, FourWalls>) -> Option<Result<Self, String>> {
        match found {
            ShapedValue::Keys(walls) => Some(Ok(Self::Each(walls))),
            ShapedValue::List(walls) => Some(Ok(Self::Listed(walls))),
            _ => found.number().map(|rho| Fraction::checked(rho).map(Self::All)),
        }
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
    /// Photometric centre in metres; or else it is an array.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub at_m: Option<[f64; 3]>,
    /// Many like it in rows: `bay` is then `bay[0,0]`, `bay[1,0]` and so on.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub array: Option<ArraySpec>,
    /// Azimuth about z, then tilt about the turned y axis, then roll about the luminaire's own axis.
    #[serde(default, skip_serializing_if = "is_default")]
    pub rotate_deg: RotationSpec,
    /// Dimming or maintenance factor.
    #[serde(default = "one", skip_serializing_if = "is_one")]
    pub flux_scale: f64,
    /// How its extent is modelled.
    #[serde(default, skip_serializing_if = "is_default")]
    pub model: ModelSpec,
    /// Diffuse reflectance of the opening's face where it lies on a surface.
    #[serde(default = "Fraction::zero", skip_serializing_if = "Fraction::is_zero")]
    pub face_reflectance: Fraction,
}

/// Luminaires in rows: origin + (i dx, j dy), i fastest.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ArraySpec {
    /// Luminaires along x and y.
    pub counts: [usize; 2],
    /// Photometric centre of the first, in metres.
    pub origin_m: [f64; 3],
    /// From one to the next along x and y, in metres.
    pub step_m: [f64; 2],
}

impl ArraySpec {
    /// Which of the array, and where.
    pub fn places(&self) -> impl Iterator<Item = ([usize; 2], [f64; 3])> + '_ {
        let ([nx, ny], [x, y, z], [dx, dy]) = (self.counts, self.origin_m, self.step_m);
        (0..ny).flat_map(move |j| (0..nx).map(move |i| ([i, j], [x + dx * i as f64, y + dy * j as f64, z])))
    }

    fn len(&self) -> usize {
        self.counts[0].saturating_mul(self.counts[1])
    }
}

impl LuminaireSpec {
    /// How many it stands for.
    pub fn count(&self) -> usize {
        self.array.map_or(1, |array| array.len())
    }

    /// The names and places of all that it stands for.
    pub fn each(&self) -> Vec<(String, [f64; 3])> {
        let one = self.at_m.map(|at_m| (self.id.clone(), at_m));
        let of_array = self.array.iter().flat_map(ArraySpec::places);
        one.into_iter().chain(of_array.map(|([i, j], at_m)| (format!("{}[{i},{j}]", self.id), at_m))).collect()
    }

    /// The same, each as a luminaire of its own.
    pub fn split(&self) -> Vec<Self> {
        let each = self.each().into_iter();
        each.map(|(id, at_m)| Self { id, at_m: Some(at_m), array: None, ..self.clone() }).collect()
    }
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
    /// Area where the file has an opening and a point or lit surface is nearer than five times its largest dimension, else point.
    #[default]
    Auto,
    /// All light from the photometric centre.
    Point,
    /// Light from the file's luminous opening.
    Area,
    /// An impostor surface (Radiance's illum).
    Impostor,
}

/// A named set of measuring points: exactly one of `points_m`, `grid`, `line` and `surface`, facing `normal` or all `around`.
#[derive(Clone, Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MeterSet {
    /// Points in metres.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub points_m: Option<Vec<[f64; 3]>>,
    /// A regular grid of points.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub grid: Option<GridSpec>,
    /// Points along a line.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub line: Option<LineSpec>,
    /// A grid over a surface of the room, by itself as fine as EN 12464-1 asks.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub surface: Option<SurfaceGridSpec>,
    /// The normal of all of them, any length; of a surface's grid the surface's own where it is left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub normal: Option<[f64; 3]>,
    /// Meters in many directions about an axis at each point, in place of a normal.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub around: Option<AroundSpec>,
}

/// Points along a line, both ends included.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LineSpec {
    /// First point in metres.
    pub from_m: [f64; 3],
    /// Last point in metres.
    pub to_m: [f64; 3],
    /// How many, two at least.
    pub count: usize,
}

/// Points in the middles of equal cells over a surface of the room, less a margin at its edges.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SurfaceGridSpec {
    /// Which surface.
    pub of: SurfaceName,
    /// How far off the surface, into the room, in metres: .75 over a floor is a working plane.
    pub distance_m: f64,
    /// What is left out along the surface's edges, in metres; EN 12464-1 leaves out .5.
    #[serde(default, skip_serializing_if = "is_default")]
    pub margin_m: f64,
    /// Cells along the surface's two axes (x and y; along a wall and z); by EN 12464-1 where it is left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub counts: Option<[usize; 2]>,
}

/// A surface of the room.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub enum SurfaceName {
    /// z = 0.
    #[serde(rename = "floor")]
    Floor,
    /// z = height.
    #[serde(rename = "ceiling")]
    Ceiling,
    /// The wall at x = 0.
    #[serde(rename = "x-")]
    XMin,
    /// The wall at x = length.
    #[serde(rename = "x+")]
    XMax,
    /// The wall at y = 0.
    #[serde(rename = "y-")]
    YMin,
    /// The wall at y = width.
    #[serde(rename = "y+")]
    YMax,
}

impl From<SurfaceName> for Surface {
    fn from(name: SurfaceName) -> Self {
        match name {
            SurfaceName::Floor => Self::Floor,
            SurfaceName::Ceiling => Self::Ceiling,
            SurfaceName::XMin => Self::WallXMin,
            SurfaceName::XMax => Self::WallXMax,
            SurfaceName::YMin => Self::WallYMin,
            SurfaceName::YMax => Self::WallYMax,
        }
    }
}

/// Normals perpendicular to an axis, at even steps about it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct AroundSpec {
    /// Of any length; upright where it is left out.
    #[serde(default = "upright", skip_serializing_if = "is_upright")]
    pub axis: [f64; 3],
    /// How many directions.
    pub count: usize,
}

fn upright() -> [f64; 3] {
    [0.0, 0.0, 1.0]
}

fn is_upright(axis: &[f64; 3]) -> bool {
    *axis == upright()
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
    /// Seconds of work an engine and procedure: engines plan with three fifths of them, as they count, and begin no sample after four times
    /// as many by the clock; a program of the user's keeps to its clock.
    pub seconds: f64,
}

/// No engine is cut short before: starting one takes some seconds whatever is asked of it, more on a busy machine.
pub const SHORTEST_PATIENCE: Duration = Duration::from_secs(15);

/// The time limit by the clock, as a multiple of the seconds of work.
///
/// Engines count three fifths of the seconds, so a machine that others use may be six times slower without any change of a value.
const TIME_LIMIT_FACTOR: f64 = 4.0;

impl Budget {
    /// By the clock, how long an engine may sample. Only a machine that is much slower than counted meets this limit.
    pub fn patience(&self) -> Duration {
        // A budget of more than a century has no end.
        Duration::from_secs_f64(TIME_LIMIT_FACTOR * self.seconds.clamp(0.0, 3e9)).max(SHORTEST_PATIENCE)
    }
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
    /// Absolute, in candela per square metre.
    pub absolute_cd_m2: f64,
    /// Absolute, of a glare rating.
    pub absolute_ugr: f64,
}
