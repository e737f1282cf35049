//! The frequent mistakes of implementations, and the variants that are no mistakes.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use strum::{EnumIter, IntoStaticStr};

/// What an implementation of a photometric format does wrong.
#[derive(
    Clone,
    Copy,
    Debug,
    PartialEq,
    Eq,
    PartialOrd,
    Ord,
    Hash,
    EnumIter,
    IntoStaticStr,
    Serialize,
    Deserialize,
    JsonSchema,
)]
#[serde(rename_all = "kebab-case")]
#[strum(serialize_all = "kebab-case")]
#[expect(missing_docs, reason = "`sentence` says what each one is")]
pub enum Mistake {
    MultiplierIgnored,
    BallastFactorIgnored,
    BallastLampFactorIgnored,
    FileGenerationApplied,
    LampsMultiplied,
    LumensScaled,
    MinusOneMultiplied,
    LumensNotScaled,
    ConversionFactorIgnored,
    OutputRatioApplied,
    DownwardFractionApplied,
    FeetApplied,
    TableTransposed,
    EvenStepsAssumed,
    FirstPlaneOnly,
    SinglePlaneOnly,
    #[serde(rename = "planes-90-270-as-0-180")]
    #[strum(serialize = "planes-90-270-as-0-180")]
    PlanesAbout90From0,
    HalfOnOtherSide,
    MirrorRepeated,
    MirrorMissing,
    TypeAsC,
    TypeBAsA,
    AxesSwapped,
    AzimuthReversed,
    #[serde(rename = "turned-by-90")]
    #[strum(serialize = "turned-by-90")]
    TurnedBy90,
    #[serde(rename = "turned-by-180")]
    #[strum(serialize = "turned-by-180")]
    TurnedBy180,
    #[serde(rename = "turned-by-270")]
    #[strum(serialize = "turned-by-270")]
    TurnedBy270,
    UpDownSwapped,
    ClampedBeyondEnd,
    MirroredBeyondEnd,
    AnglesStretched,
    FirstAngleIgnored,
    UnlistedFileRead,
}

impl Mistake {
    /// The name in files: `multiplier-ignored`.
    pub fn id(self) -> &'static str {
        self.into()
    }

    /// What is wrong, in one sentence.
    pub const fn sentence(self) -> &'static str {
        match self {
            Self::MultiplierIgnored => "The multiplier of the file is ignored: multiply every intensity by it.",
            Self::BallastFactorIgnored => "The ballast factor is ignored: multiply every intensity by it.",
            Self::BallastLampFactorIgnored => {
                "The ballast-lamp photometric factor is ignored: in LM-63-1986 and 1991 multiply every intensity by it."
            }
            Self::FileGenerationApplied => {
                "The file generation type is multiplied: in LM-63-2019 the number behind the ballast factor is a code."
            }
            Self::LampsMultiplied => {
                "Intensities are multiplied by the number of lamps: the table is that of the whole luminaire already."
            }
            Self::LumensScaled => {
                "Intensities are multiplied by the lamp kilolumens: LM-63 and TM-33 state candela, not cd/klm."
            }
            Self::MinusOneMultiplied => {
                "The lumens per lamp of -1 are multiplied: -1 marks absolute photometry and is no number of lumens."
            }
            Self::LumensNotScaled => {
                "EULUMDAT's cd/klm are taken as candela: multiply them by the flux of the lamp set in kilolumens."
            }
            Self::ConversionFactorIgnored => {
                "The conversion factor for luminous intensities is ignored: multiply every intensity by it."
            }
            Self::OutputRatioApplied => {
                "Intensities are multiplied by the light output ratio LORL: the table contains the losses already."
            }
            Self::DownwardFractionApplied => {
                "Intensities are multiplied by the downward flux fraction DFF: it only describes the table."
            }
            Self::FeetApplied => {
                "Intensities are converted from feet: the units type concerns the dimensions, candela are candela."
            }
            Self::TableTransposed => {
                "The table is read in the wrong order: all vertical angles of the first horizontal angle come first."
            }
            Self::EvenStepsAssumed => "Even steps between angles are assumed: take the angles that the file lists.",
            Self::FirstPlaneOnly => "Only the first plane is read and is used for every azimuth.",
            Self::SinglePlaneOnly => "A single plane lights only its own azimuth: it stands for every C.",
            Self::PlanesAbout90From0 => {
                "Half planes about C 90 - C 270 are placed at 0 to 180: place them at their own angles and mirror left and right."
            }
            Self::HalfOnOtherSide => {
                "Half planes about C 90 - C 270 are placed on the other side: LM-63 stores 90 to 270, EULUMDAT 270 over 0 to 90."
            }
            Self::MirrorRepeated => {
                "Stored planes are repeated around the circle: they must be mirrored at their first and last plane."
            }
            Self::MirrorMissing => "Planes that the file does not store are dark: mirror the stored ones.",
            Self::TypeAsC => {
                "Angles of type A or B are taken as C and gamma: convert the direction to H and V of the type."
            }
            Self::TypeBAsA => "Angles of type B are taken as those of type A: the axis of type B is horizontal.",
            Self::AxesSwapped => "Horizontal and vertical angles are exchanged: H is taken as V.",
            Self::AzimuthReversed => {
                "The azimuth is counted the other way: C runs counter-clockwise seen from above, H of types A and B clockwise."
            }
            Self::TurnedBy90 => "The luminaire is turned: the answer at C is the intensity at C + 90.",
            Self::TurnedBy180 => "The luminaire is turned: the answer at C is the intensity at C + 180.",
            Self::TurnedBy270 => "The luminaire is turned: the answer at C is the intensity at C - 90.",
            Self::UpDownSwapped => "Up and down are swapped: gamma 0 is the nadir and 180 the zenith.",
            Self::ClampedBeyondEnd => {
                "Beyond the end of the table its last value is continued: the intensity there is 0."
            }
            Self::MirroredBeyondEnd => {
                "A table of one hemisphere is mirrored into the other: the intensity there is 0."
            }
            Self::AnglesStretched => {
                "The vertical angles are stretched over 0 to 180: the table ends where its angles end."
            }
            Self::FirstAngleIgnored => {
                "The first vertical angle is taken as 0: the table begins where its angles begin."
            }
            Self::UnlistedFileRead => {
                "The first photometric file of the container is read: read the one that product.xml refers to."
            }
        }
    }
}

/// What implementations do differently where no standard decides. None of these is a fault.
#[derive(
    Clone,
    Copy,
    Debug,
    PartialEq,
    Eq,
    PartialOrd,
    Ord,
    Hash,
    EnumIter,
    IntoStaticStr,
    Serialize,
    Deserialize,
    JsonSchema,
)]
#[serde(rename_all = "kebab-case")]
#[strum(serialize_all = "kebab-case")]
#[expect(missing_docs, reason = "`sentence` says what each one is")]
pub enum Variant {
    ThirdNumberIgnored,
    ThirdNumberApplied,
    TiltIgnored,
    TiltApplied,
    FirstLampSet,
    LastLampSet,
    LampSetsSummed,
    AimedAtNadir,
    AimedAtHorizon,
    #[serde(rename = "usdlux-angle-scale-0.5")]
    #[strum(serialize = "usdlux-angle-scale-0.5")]
    UsdLuxAngleScale,
    NormalisedToPeak,
    NormalisedToFlux,
    NormalisedToMean,
    RadiantBy683,
    RadiantBy179,
    Linear,
    LinearInCosine,
    Cubic,
    Smoothstep,
    Nearest,
    OtherInterpolation,
}

impl Variant {
    /// The name in files: `tilt-ignored`.
    pub fn id(self) -> &'static str {
        self.into()
    }

    /// What is done, in one sentence.
    pub const fn sentence(self) -> &'static str {
        match self {
            Self::ThirdNumberIgnored => "The number behind the ballast factor is ignored, as LM-63-1995 reserves it.",
            Self::ThirdNumberApplied => {
                "The number behind the ballast factor multiplies the intensities, as in LM-63-1991."
            }
            Self::TiltIgnored => "The tilt factors are not applied: the luminaire hangs as it was measured.",
            Self::TiltApplied => "The tilt factors multiply the intensities.",
            Self::FirstLampSet => "Of several lamp sets the first counts.",
            Self::LastLampSet => "Of several lamp sets the last counts.",
            Self::LampSetsSummed => "The lumens of all lamp sets are added up.",
            Self::AimedAtNadir => "H 0 V 0 of type B points down, as in LM-63-2002.",
            Self::AimedAtHorizon => "H 0 V 0 of type B points to the horizon at C 0, and V 90 up.",
            Self::UsdLuxAngleScale => "UsdLux `shaping:ies:angleScale` is 0.5: the profile is read at twice the angle.",
            Self::NormalisedToPeak => "The largest intensity of the table is 1.",
            Self::NormalisedToFlux => "The flux is 1.",
            Self::NormalisedToMean => "The mean intensity over the sphere is 1: intensity times 4 pi over flux.",
            Self::RadiantBy683 => "Intensities are in W/sr, at 683 lm/W.",
            Self::RadiantBy179 => "Intensities are in W/sr, at Radiance's 179 lm/W.",
            Self::Linear => "Between nodes intensities are linear in both angles.",
            Self::LinearInCosine => "Between nodes intensities are linear in C and in the cosine of gamma.",
            Self::Cubic => "Between nodes intensities are cubic (Catmull-Rom) in both angles.",
            Self::Smoothstep => "Between nodes intensities follow a smooth step (3 t^2 - 2 t^3) in both angles.",
            Self::Nearest => "Between nodes the intensity is that of the nearest one.",
            Self::OtherInterpolation => {
                "Between nodes intensities follow a rule without a name here, and stay near the nodes around them."
            }
        }
    }
}
