//! The forms in which a spec asks for a procedure, unknown keys refused.

use luxproof_scene::Bounces;
use schemars::{JsonSchema, Schema, SchemaGenerator};
use serde::de::{Deserializer, IgnoredAny, MapAccess};
use serde::{Deserialize, Serialize};

use luxproof_model::shapes::{ShapedValue, Shapes};

/// The keys that a spec gives a procedure.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Form {
    /// `luminaire`, `distance_m`, `angles`.
    Angles,
    /// `luminaire`, `meters`.
    Opening,
    /// `meters`.
    Meters,
    /// `meters`, `bounces`.
    MetersAndBounces,
    /// `meters`, `bounces`, `light`.
    MetersAndLight,
}

/// What a spec asks of one procedure.
#[derive(Clone, Debug)]
pub enum ProcedureRequest {
    Angles(AtAngles),
    Opening(AtOpening),
    Meters(AtMeters),
}

/// What a spec writes of a procedure.
#[derive(Serialize)]
#[serde(untagged)]
pub(super) enum Written<'a> {
    Angles(&'a AtAngles),
    Opening(&'a AtOpening),
    Meters {
        meters: &'a Names,
        #[serde(skip_serializing_if = "Option::is_none")]
        bounces: Option<u32>,
        #[serde(skip_serializing_if = "Option::is_none")]
        light: Option<AnyLight>,
    },
}

impl ProcedureRequest {
    /// The luminaire that alone is lit, and the meter sets, where it names them.
    pub fn named(&self) -> (Option<&str>, Option<&Names>) {
        match self {
            Self::Angles(asked) => (Some(&asked.luminaire), None),
            Self::Opening(asked) => (Some(&asked.luminaire), Some(&asked.meters)),
            Self::Meters(asked) => (None, Some(&asked.meters)),
        }
    }

    /// The meter sets, to change them.
    pub fn meters_mut(&mut self) -> Option<&mut Names> {
        match self {
            Self::Angles(_) => None,
            Self::Opening(asked) => Some(&mut asked.meters),
            Self::Meters(asked) => Some(&mut asked.meters),
        }
    }

    /// As it stands in a spec of this form; what the form takes for granted is left out.
    pub(super) fn written(&self, form: Option<Form>) -> Written<'_> {
        match self {
            Self::Angles(asked) => Written::Angles(asked),
            Self::Opening(asked) => Written::Opening(asked),
            Self::Meters(AtMeters { meters, bounces, light }) => {
                let counts = matches!(form, Some(Form::MetersAndBounces | Form::MetersAndLight));
                let bounces = match bounces {
                    Bounces::AtMost(n) if counts => Some(*n),
                    _ => None,
                };
                let chosen = form == Some(Form::MetersAndLight) && *light != AnyLight::default();
                Written::Meters { meters, bounces, light: chosen.then_some(*light) }
            }
        }
    }
}

/// Illuminance at meters of the room.
#[derive(Clone, Debug)]
pub struct AtMeters {
    pub meters: Names,
    pub bounces: Bounces,
    pub light: AnyLight,
}

/// The light that a spec chooses, where a procedure leaves the choice.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum AnyLight {
    /// Straight from the luminaires and reflected.
    #[default]
    Total,
    /// Straight from the luminaires.
    Direct,
    /// Reflected at least once.
    Indirect,
}

/// Intensity from illuminance at a distance, the luminaire alone in free field.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(rename = "LuminousIntensity")]
pub struct AtAngles {
    /// Which luminaire.
    pub luminaire: String,
    /// Measuring distance in metres.
    pub distance_m: f64,
    /// Where: the photometric file's own angles, or lists.
    #[serde(default, skip_serializing_if = "Angles::is_all")]
    pub angles: Angles,
}

/// Mean luminance of a luminous opening, the luminaire alone in free field.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(rename = "OpeningLuminance")]
pub struct AtOpening {
    /// Which luminaire.
    pub luminaire: String,
    /// A meter set or a list of sets: where the observers are.
    pub meters: Names,
}

/// Light of a fixed number of reflections at meters.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct Meters {
    /// A meter set or a list of sets.
    meters: Names,
}

/// Light of some reflections at meters.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct MetersAndBounces {
    /// A meter set or a list of sets.
    meters: Names,
    /// How many diffuse reflections count.
    #[serde(default)]
    bounces: BouncesSpec,
}

/// Light of a spec's choice at meters.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct MetersAndLight {
    /// A meter set or a list of sets.
    meters: Names,
    /// How many diffuse reflections count, where any do.
    #[serde(default)]
    bounces: BouncesSpec,
    /// Which light counts.
    #[serde(default)]
    light: AnyLight,
}

impl Form {
    pub(super) fn schema(self, generator: &mut SchemaGenerator) -> Schema {
        match self {
            Self::Angles => generator.subschema_for::<AtAngles>(),
            Self::Opening => generator.subschema_for::<AtOpening>(),
            Self::Meters => generator.subschema_for::<Meters>(),
            Self::MetersAndBounces => generator.subschema_for::<MetersAndBounces>(),
            Self::MetersAndLight => generator.subschema_for::<MetersAndLight>(),
        }
    }

    /// What a spec asks in this form; nothing where it says `null`.
    pub(super) fn read<'de, A: MapAccess<'de>>(self, map: &mut A) -> Result<Option<ProcedureRequest>, A::Error> {
        let at = |meters, bounces: BouncesSpec, light| {
            ProcedureRequest::Meters(AtMeters { meters, bounces: bounces.into(), light })
        };
        Ok(match self {
            Self::Angles => map.next_value::<Option<AtAngles>>()?.map(ProcedureRequest::Angles),
            Self::Opening => map.next_value::<Option<AtOpening>>()?.map(ProcedureRequest::Opening),
            Self::Meters => map
                .next_value::<Option<Meters>>()?
                .map(|Meters { meters }| at(meters, BouncesSpec::default(), AnyLight::Total)),
            Self::MetersAndBounces => map
                .next_value::<Option<MetersAndBounces>>()?
                .map(|MetersAndBounces { meters, bounces }| at(meters, bounces, AnyLight::Total)),
            Self::MetersAndLight => map
                .next_value::<Option<MetersAndLight>>()?
                .map(|MetersAndLight { meters, bounces, light }| at(meters, bounces, light)),
        })
    }
}

/// Directions of an intensity, in the luminaire's own frame.
#[derive(Clone, Debug, Default, Serialize, JsonSchema)]
#[serde(untagged)]
pub enum Angles {
    /// Every node of the file's table.
    #[default]
    #[schemars(with = "PhotometryWord")]
    Photometry,
    /// Every combination of the listed angles.
    Listed(AngleLists),
}

impl Angles {
    /// Whether it is what a spec means that names none.
    fn is_all(&self) -> bool {
        matches!(self, Self::Photometry)
    }
}

#[derive(JsonSchema)]
#[schemars(rename_all = "lowercase")]
#[allow(dead_code, reason = "the shape of a word in the schema")]
enum PhotometryWord {
    Photometry,
}

/// Lists of angles in degrees.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct AngleLists {
    /// From the nadir.
    pub gamma_deg: Vec<f64>,
    /// C planes.
    pub c_deg: Vec<f64>,
}

impl<'de> Deserialize<'de> for Angles {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let expected = "the word `photometry`, or {gamma_deg: [...], c_deg: [...]}";
        deserializer.deserialize_any(Shapes { expected, read: Self::of_found })
    }
}

impl Angles {
    fn of_found(found: ShapedValue<'_, IgnoredAny, AngleLists>) -> Option<Result<Self, String>> {
        match found {
            ShapedValue::Word("photometry") => Some(Ok(Self::Photometry)),
            ShapedValue::Word(other) => Some(Err(format!(
                "`{other}` is no choice of angles; expected `photometry` or {{gamma_deg: [...], c_deg: [...]}}"
            ))),
            ShapedValue::Keys(lists) => Some(Ok(Self::Listed(lists))),
            _ => None,
        }
    }
}

/// One name or a list of names.
#[derive(Clone, Debug, Serialize, JsonSchema)]
#[serde(untagged)]
pub enum Names {
    /// One.
    One(String),
    /// Several.
    Many(Vec<String>),
}

impl Names {
    /// The names in order.
    pub fn iter(&self) -> impl Iterator<Item = &str> {
        match self {
            Self::One(name) => std::slice::from_ref(name).iter().map(String::as_str),
            Self::Many(names) => names.iter().map(String::as_str),
        }
    }
}

impl<'de> Deserialize<'de> for Names {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let expected = "the name of a meter set or a list of names";
        deserializer.deserialize_any(Shapes { expected, read: Self::of_found })
    }
}

impl Names {
    fn of_found(found: ShapedValue<'_, Vec<String>>) -> Option<Result<Self, String>> {
        match found {
            ShapedValue::Word(name) => Some(Ok(Self::One(name.to_owned()))),
            ShapedValue::List(names) => Some(Ok(Self::Many(names))),
            _ => None,
        }
    }
}

/// How many diffuse reflections count: `converged` or a number.
#[derive(Clone, Copy, Debug, Default, JsonSchema)]
#[schemars(untagged)]
enum BouncesSpec {
    /// All of them.
    #[default]
    #[schemars(with = "ConvergedWord")]
    Converged,
    /// At most so many.
    AtMost(u32),
}

#[derive(JsonSchema)]
#[schemars(rename_all = "lowercase")]
#[allow(dead_code, reason = "the shape of a word in the schema")]
enum ConvergedWord {
    Converged,
}

impl From<BouncesSpec> for Bounces {
    fn from(spec: BouncesSpec) -> Self {
        match spec {
            BouncesSpec::Converged => Self::Converged,
            BouncesSpec::AtMost(n) => Self::AtMost(n),
        }
    }
}

impl<'de> Deserialize<'de> for BouncesSpec {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let expected = "the word `converged` or a number of diffuse reflections from 1";
        deserializer.deserialize_any(Shapes {
            expected,
            read: |found: ShapedValue<'_>| match found {
                ShapedValue::Word("converged") => Some(Ok(Self::Converged)),
                ShapedValue::Word(other) => {
                    Some(Err(format!("`{other}` is no number of bounces; expected `converged` or 1, 2, ...")))
                }
                ShapedValue::Count(n) => Some(Self::at_most(n)),
                _ => None,
            },
        })
    }
}

impl BouncesSpec {
    fn at_most(n: u64) -> Result<Self, String> {
        match u32::try_from(n) {
            Ok(n) if n >= 1 => Ok(Self::AtMost(n)),
            _ => Err(format!("bounces: {n} is out of range; give 1 or more, or `converged`")),
        }
    }
}
