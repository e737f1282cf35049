//! What readers should answer to a file, and what they answer with a mistake: the JSON next to each file.

use itertools::Itertools as _;
use luxproof_photometry::Goniometer;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use strum::IntoEnumIterator as _;

use crate::catalogue::PACK_VERSION;
use crate::interpolation;
use crate::mistake::{Mistake, Variant};
use crate::model_reader::{ModelReader, Prediction};
use crate::pack_file::{AskedDirection, PackFile, Place};
use crate::submission::MAX_RELATIVE_UNCERTAINTY;
use crate::table::round_to;

/// The answers that a file expects.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Expected {
    /// Version of the pack.
    pub pack: String,
    /// The photometric file in the folder `files`.
    pub file: String,
    /// Its format and edition.
    pub format: String,
    /// What it provokes.
    pub feature: String,
    /// The function of direction that its table contains at its nodes, in candela, to three decimals of a number.
    pub closed_form: String,
    /// The frame of all directions.
    pub axes: Axes,
    /// The directions in which a reader is asked; answers follow their order.
    pub directions: Vec<Direction>,
    /// Luminous intensity in each direction; null between nodes, where interpolations differ.
    pub candela: Vec<Option<f64>>,
    /// How far an answer may be off.
    pub tolerance_cd: f64,
    /// Luminous flux.
    pub flux_lm: Flux,
    /// Rated lumens of all lamps together; null for absolute photometry.
    pub lamp_lumens: Option<f64>,
    /// The luminous opening in metres along C 90, along C 0 and upwards; null where the format does not say.
    pub opening_m: Option<[f64; 3]>,
    /// What readers with a mistake answer.
    pub mistakes: Vec<MistakeAnswer>,
    /// What readers answer that choose otherwise where no standard decides; none of these is a fault.
    pub variants: Vec<VariantAnswer>,
}

/// The frame of directions.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Axes {
    /// Towards C 0, gamma 90.
    pub x: String,
    /// Towards C 90, gamma 90.
    pub y: String,
    /// Up, gamma 180.
    pub z: String,
    /// How the angles of the table give a direction.
    pub table: String,
}

/// A direction.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Direction {
    /// Azimuth from x towards y in degrees.
    pub c_deg: f64,
    /// Angle from the nadir in degrees.
    pub gamma_deg: f64,
    /// The same as a unit vector.
    pub towards: [f64; 3],
    /// Horizontal angle of a node of a table of type A or B.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub h_deg: Option<f64>,
    /// Vertical angle of a node of a table of type A or B.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub v_deg: Option<f64>,
    /// Whether one answer is right.
    pub place: Place,
}

/// The luminous flux of a table.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Flux {
    /// Of intensities that are linear in both angles.
    pub linear: f64,
    /// If every cell had its least node's intensity.
    pub least: f64,
    /// If every cell had its largest node's intensity.
    pub most: f64,
}

/// The answers of a reader with a mistake.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MistakeAnswer {
    /// The mistake.
    pub mistake: Mistake,
    /// What is wrong, in one sentence.
    pub sentence: String,
    /// The answers; null where none follows from the mistake.
    pub candela: Vec<Option<f64>>,
}

/// The answers of a reader that chooses a variant.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct VariantAnswer {
    /// The variant.
    pub variant: Variant,
    /// What is done, in one sentence.
    pub sentence: String,
    /// The answers; null where they are those of `candela`, or where none follows.
    pub candela: Vec<Option<f64>>,
}

impl Expected {
    /// What a file expects.
    pub fn of(file: &PackFile) -> Self {
        let right = ModelReader::RIGHT.predict(file);
        let mistakes = mistakes_that_show(file).into_iter().map(|mistake| MistakeAnswer {
            mistake,
            sentence: mistake.sentence().into(),
            candela: rounded(&ModelReader { mistakes: &[mistake], variant: None }.predict(file)),
        });
        let variants = file.variants.iter().map(|variant| VariantAnswer {
            variant: *variant,
            sentence: variant.sentence().into(),
            candela: rounded(&ModelReader { mistakes: &[], variant: Some(*variant) }.predict(file)),
        });
        let interpolations = interpolation::METHODS.iter().map(|variant| VariantAnswer {
            variant: *variant,
            sentence: variant.sentence().into(),
            candela: interpolation::answers_between(file, *variant)
                .into_iter()
                .map(|answer| answer.map(|candela| round_to(candela, DECIMALS)))
                .collect(),
        });
        let has_between = file.directions.iter().any(|asked| asked.place == Place::Between);
        let variants = variants.chain(interpolations.filter(|_| has_between)).collect();
        Self {
            pack: PACK_VERSION.into(),
            file: file.name.into(),
            format: file.document.format().into(),
            feature: file.feature.into(),
            closed_form: file.form.formula().into(),
            axes: Axes::of(file.table.goniometer),
            directions: file.directions.iter().map(Direction::of).collect(),
            candela: rounded(&right),
            tolerance_cd: round_to(file.tolerance_cd(), DECIMALS),
            flux_lm: Flux::of(file),
            lamp_lumens: file.document.lamp_lumens(),
            opening_m: file.document.opening_m().map(|extents| extents.map(|extent| round_to(extent, DECIMALS))),
            mistakes: mistakes.collect(),
            variants,
        }
    }
}

/// Decimals of the numbers of the JSON files.
const DECIMALS: i32 = 6;

/// The answers that are the same for every interpolation.
fn rounded(predictions: &[Prediction]) -> Vec<Option<f64>> {
    predictions.iter().map(|prediction| prediction.exact().map(|candela| round_to(candela, DECIMALS))).collect()
}

/// The mistakes that change an answer of a file by more than submissions may be off.
pub(crate) fn mistakes_that_show(file: &PackFile) -> Vec<Mistake> {
    let right = ModelReader::RIGHT.predict(file);
    let allowed = Mistake::iter().filter(|mistake| file.document.allows(*mistake));
    let shows = |mistake: &Mistake| {
        let wrong = ModelReader { mistakes: &[*mistake], variant: None }.predict(file);
        right.iter().zip_eq(&wrong).any(|(right, wrong)| differs(file, *right, *wrong))
    };
    allowed.filter(shows).collect()
}

/// Whether two answers are different whatever the uncertainty of a submission is.
fn differs(file: &PackFile, right: Prediction, wrong: Prediction) -> bool {
    let (Some(right), Some(wrong)) = (right.exact(), wrong.exact()) else { return false };
    (right - wrong).abs() > 2.0 * (file.tolerance_cd() + 2.0 * MAX_RELATIVE_UNCERTAINTY * right.abs().max(wrong.abs()))
}

impl Axes {
    fn of(goniometer: Goniometer) -> Self {
        let table = match goniometer {
            Goniometer::C => {
                "C is the azimuth, gamma the angle from the nadir: x = sin(gamma) cos(C), y = sin(gamma) sin(C), z = -cos(gamma)"
            }
            Goniometer::A => "type A: C = -H, gamma = 90 + V",
            Goniometer::B => "type B: x = cos(H) sin(V), y = -sin(H), z = -cos(H) cos(V)",
        };
        let [x, y, z] = ["C 0, gamma 90", "C 90, gamma 90", "up, gamma 180"].map(String::from);
        Self { x, y, z, table: table.into() }
    }
}

impl Direction {
    fn of(asked: &AskedDirection) -> Self {
        let (h_deg, v_deg) = asked.own_deg.unzip();
        let towards = asked.vector().to_array().map(|component| round_to(component, 12));
        Self { c_deg: asked.c_deg, gamma_deg: asked.gamma_deg, towards, h_deg, v_deg, place: asked.place }
    }
}

impl Flux {
    /// The flux of the right reading.
    pub(crate) fn of(file: &PackFile) -> Self {
        let integral = file.table.solid_integral();
        let lumens = |steradians: f64| round_to(steradians * integral.copies * file.factor(), DECIMALS);
        Self { linear: lumens(integral.linear), least: lumens(integral.least), most: lumens(integral.most) }
    }

    /// Least, linear and most.
    pub(crate) const fn bounds(&self) -> [f64; 3] {
        [self.least, self.linear, self.most]
    }
}
