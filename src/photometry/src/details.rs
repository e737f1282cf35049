//! The fields that only one kind of photometric file has. Readers fill them in; writers and the list of losses use them.

use super::goniometer::Goniometer;

/// The fields that only one kind of file has.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum Details {
    /// The photometry was not read from a file.
    #[default]
    None,
    /// An LM-63 file.
    Lm63(Lm63Details),
    /// A EULUMDAT file.
    Eulumdat(Box<EulumdatDetails>),
}

/// The fields of an LM-63 file beyond the common ones of [`Photometry`](super::Photometry).
#[derive(Clone, Debug, PartialEq)]
pub struct Lm63Details {
    /// The edition.
    pub edition: Edition,
    /// The photometric type of the measurement.
    pub goniometer: Goniometer,
    /// Number of lamps.
    pub lamps: u32,
    /// Rated lumens of one lamp, -1 for absolute photometry.
    pub lumens_per_lamp: f64,
    /// The number behind the ballast factor.
    pub third_number: ThirdNumber,
    /// The dependence of the lamp flux on the tilt of the luminaire. No intensity is multiplied by it.
    pub tilt: Option<Tilt>,
}

/// The number between ballast factor and input watts. Its meaning differs between the editions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ThirdNumber {
    /// The ballast-lamp photometric factor of the editions up to 1995: every intensity has been multiplied by it.
    BallastLampFactor(f64),
    /// "Future use", which must be 1. Any other number has no meaning and no effect.
    Reserved(f64),
    /// The file generation type of 2019; 1 where it is unknown.
    FileGeneration(f64),
}

impl ThirdNumber {
    /// The number in a file of this edition for the same photometry, where the intensities contain every factor.
    #[must_use]
    pub fn in_edition(self, edition: Edition) -> Self {
        match (edition, self) {
            (Edition::Lm63_2019, Self::FileGeneration(_)) => self,
            (Edition::Lm63_2019, _) => Self::FileGeneration(1.0),
            (Edition::Lm63_2002, _) => Self::Reserved(1.0),
            (Edition::Lm63_1986 | Edition::Lm63_1991 | Edition::Lm63_1995, _) => Self::BallastLampFactor(1.0),
        }
    }

    /// The number itself.
    pub fn value(self) -> f64 {
        let (Self::BallastLampFactor(value) | Self::Reserved(value) | Self::FileGeneration(value)) = self;
        value
    }
}

/// An edition of LM-63.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Edition {
    /// LM-63-1986: no first line, free labels.
    Lm63_1986,
    /// LM-63-1991: `IESNA91`.
    Lm63_1991,
    /// LM-63-1995.
    Lm63_1995,
    /// ANSI/IESNA LM-63-02.
    Lm63_2002,
    /// ANSI/IES LM-63-19.
    Lm63_2019,
}

impl Edition {
    /// All editions, oldest first.
    pub const ALL: [Self; 5] = [Self::Lm63_1986, Self::Lm63_1991, Self::Lm63_1995, Self::Lm63_2002, Self::Lm63_2019];

    /// The name used in reports, e.g. `LM-63-2002`.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Lm63_1986 => "LM-63-1986",
            Self::Lm63_1991 => "LM-63-1991",
            Self::Lm63_1995 => "LM-63-1995",
            Self::Lm63_2002 => "LM-63-2002",
            Self::Lm63_2019 => "LM-63-2019",
        }
    }

    /// The first line that the edition asks for.
    pub const fn first_line(self) -> Option<&'static str> {
        match self {
            Self::Lm63_1986 => None,
            Self::Lm63_1991 => Some("IESNA91"),
            Self::Lm63_1995 => Some("IESNA:LM-63-1995"),
            Self::Lm63_2002 => Some("IESNA:LM-63-2002"),
            Self::Lm63_2019 => Some("IES:LM-63-2019"),
        }
    }

    /// The largest number of characters of a line without CR LF. With it, LM-63-2002 allows 256, earlier editions 132.
    pub(super) const fn line_limit(self) -> usize {
        match self {
            Self::Lm63_1986 | Self::Lm63_1991 | Self::Lm63_1995 => 130,
            Self::Lm63_2002 | Self::Lm63_2019 => 254,
        }
    }

    /// The keywords that the edition requires.
    pub(super) const fn required_keywords(self) -> &'static [&'static str] {
        match self {
            Self::Lm63_1986 | Self::Lm63_1991 => &[],
            Self::Lm63_1995 => &["TEST", "MANUFAC"],
            Self::Lm63_2002 | Self::Lm63_2019 => &["TEST", "TESTLAB", "ISSUEDATE", "MANUFAC"],
        }
    }

    /// The year, four digits.
    pub(super) fn year(self) -> &'static str {
        &self.name()[6..]
    }
}

/// Relative lamp flux against the tilt of the luminaire.
#[derive(Clone, Debug, PartialEq)]
pub struct Tilt {
    /// Lamp-to-luminaire geometry: 1 lamp vertical, 2 lamp horizontal and turned with the tilt, 3 horizontal, unturned.
    pub geometry: u8,
    /// Tilt angles in degrees.
    pub angles_deg: Vec<f64>,
    /// Multiplying factor at each angle.
    pub factors: Vec<f64>,
}

/// The fields of a EULUMDAT file beyond the common ones of [`Photometry`](super::Photometry), in the units of the file.
#[derive(Clone, Debug, PartialEq)]
pub struct EulumdatDetails {
    /// Type indicator `Ityp`: 1 point source with axial symmetry, 2 linear, 3 other point source (0 in some files).
    pub kind: u8,
    /// Length or diameter, width (0 where round) and height of the luminaire in millimetres.
    pub luminaire_mm: [f64; 3],
    /// Height of the luminous area seen from C0, C90, C180 and C270 in millimetres.
    pub luminous_heights_mm: [f64; 4],
    /// Declared downward flux fraction in percent of the luminaire's flux; 0 where blank.
    pub downward_flux_percent: f64,
    /// Declared light output ratio of the luminaire in percent; 0 where blank.
    pub output_ratio_percent: f64,
    /// Conversion factor for luminous intensities.
    pub conversion_factor: f64,
    /// Tilt of the luminaire during measurement in degrees.
    pub measured_tilt_deg: f64,
    /// The lamp sets: alternatives. The photometry uses the first.
    pub lamp_sets: Vec<LampSet>,
    /// Direct ratios for the room indices 0.6, 0.8, 1, 1.25, 1.5, 2, 2.5, 3, 4 and 5.
    pub direct_ratios: [f64; 10],
}

/// One set of lamps.
#[derive(Clone, Debug, PartialEq)]
pub struct LampSet {
    /// Number of lamps; negative for absolute photometry.
    pub lamps: i32,
    /// Type of lamps.
    pub kind: String,
    /// Flux of all lamps of the set together in lumens.
    pub lumens: f64,
    /// Colour appearance or colour temperature.
    pub colour: String,
    /// Colour rendering group or index.
    pub rendering: String,
    /// Watts including ballast; 0 where blank.
    pub watts: f64,
}
