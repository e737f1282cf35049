//! Why a photometric file was refused: what is wrong, where, and what to do.

use std::fmt;
use std::path::PathBuf;

use super::DistributionError;

/// The most candela that a file may say: the flux of more is no number.
const MOST_CD: f64 = 1e300;

/// What a number of a file and its factor come to, in candela.
pub(super) fn in_candela(what: impl fmt::Display, value: f64, factor: f64) -> Result<f64, Problem> {
    let candela = value * factor;
    let is_one = candela.abs() <= MOST_CD;
    let refused = || Problem::NotFinite { what: what.to_string(), found: format!("{value:?} x {factor:?}") };
    is_one.then_some(candela).ok_or_else(refused)
}

/// A refused file: the place (line and column from 1, column in characters) and the problem found there.
#[derive(Clone, Debug, PartialEq)]
pub struct ReadError {
    /// The file as it was named; empty where bytes were parsed that have no name.
    pub file: PathBuf,
    /// Line, from 1; 0 where the problem has no place.
    pub line: usize,
    /// Column in characters, from 1; 0 where the problem has no place.
    pub column: usize,
    /// What is wrong.
    pub problem: Problem,
}

/// What is wrong with a photometric file.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Problem {
    /// The file could not be read at all.
    #[error("the file cannot be read: {reason}")]
    Io {
        /// The system's words.
        reason: String,
    },
    /// Neither LM-63 nor EULUMDAT nor TM-33 nor GLDF.
    #[error("this is no photometric file: neither LM-63 (no TILT= line), EULUMDAT, TM-33 XML nor GLDF")]
    Unrecognised,
    /// The file ends too early.
    #[error("the file ends where {expected} should follow")]
    UnexpectedEnd {
        /// What should have come.
        expected: String,
    },
    /// Something that is no number where one belongs.
    #[error("{what} should be a number, not `{found}`")]
    NotANumber {
        /// What the number stands for.
        what: String,
        /// What stands there.
        found: String,
    },
    /// NaN, infinity, or too large to reckon with.
    #[error("{what} is `{found}`, which is not finite or beyond 1e300")]
    NotFinite {
        /// What the number stands for.
        what: String,
        /// What stands there.
        found: String,
    },
    /// A number outside what its meaning allows.
    #[error("{what} is {found}; it must be {expected}")]
    OutOfRange {
        /// What the number stands for.
        what: String,
        /// The number.
        found: f64,
        /// What it must be.
        expected: &'static str,
    },
    /// An LM-63 file without its TILT line.
    #[error("no line begins with TILT=, with which the numbers of an LM-63 file start")]
    MissingTilt,
    /// A TILT line that names something other than NONE, INCLUDE or a readable file.
    #[error("TILT={name} cannot be followed: {reason}")]
    Tilt {
        /// What stands behind `TILT=`.
        name: String,
        /// Why it cannot be used.
        reason: String,
    },
    /// More values claimed than the file has bytes for.
    #[error("{what} is {claimed}, but only {room} bytes follow")]
    Implausible {
        /// The count.
        what: String,
        /// Its value.
        claimed: f64,
        /// Bytes left in the file.
        room: usize,
    },
    /// More values than the header announced.
    #[error("the header announces {expected} {what}, but more numbers follow")]
    TooMany {
        /// What was counted.
        what: String,
        /// How many were announced.
        expected: usize,
    },
    /// Angles that do not rise.
    #[error("the {axis} angles must rise strictly: {after} follows {before}")]
    NotRising {
        /// Which angles.
        axis: &'static str,
        /// The earlier angle in degrees.
        before: f64,
        /// The angle after it in degrees.
        after: f64,
    },
    /// Angles over a range that has no meaning.
    #[error("the {axis} angles run from {first} to {last}; {expected}")]
    AngleRange {
        /// Which angles.
        axis: &'static str,
        /// First angle in degrees.
        first: f64,
        /// Last angle in degrees.
        last: f64,
        /// What they may be.
        expected: &'static str,
    },
    /// A table that is no distribution although every number in it is legal.
    #[error(transparent)]
    Distribution(#[from] DistributionError),
    /// XML that is not well formed, or lacks an element.
    #[error("{message}")]
    Xml {
        /// What the XML reader or the schema says.
        message: String,
    },
    /// A file with more than one photometry, of which none is named.
    #[error("the file holds several photometries: {}", names.join(", "))]
    Several {
        /// What each may be named by.
        names: Vec<String>,
    },
    /// A photometry that is named and is not there.
    #[error("the file holds no photometry `{name}`; it holds {}", names.join(", "))]
    NoSuchPart {
        /// What was named.
        name: String,
        /// What may be named.
        names: Vec<String>,
    },
    /// An archive that cannot be opened, or lacks what it lists.
    #[error("{message}")]
    Archive {
        /// What is wrong with it.
        message: String,
    },
    /// A legal file that says nothing of luminous intensity in a form that can be used.
    #[error("{what} is not supported")]
    Unsupported {
        /// The feature.
        what: String,
    },
}

impl ReadError {
    /// What is wrong, without the place.
    pub fn message(&self) -> String {
        self.problem.to_string()
    }

    /// What to do about it.
    pub fn help(&self) -> &'static str {
        match &self.problem {
            Problem::Io { .. } => "check the path and its permissions",
            Problem::Unrecognised => "name a .ies (LM-63), .ldt (EULUMDAT), .xml (TM-33) or .gldf file",
            Problem::UnexpectedEnd { .. } => {
                "the file is cut short or one of its counts is too large; fetch it again or correct the count"
            }
            Problem::NotANumber { .. } => "a count before this place may be wrong, so that text is read as numbers",
            Problem::NotFinite { .. } => "replace it by the measured value; photometry knows no NaN and no infinity",
            Problem::OutOfRange { .. } => "correct the number, or the count before it if the numbers are shifted",
            Problem::MissingTilt => "add the line TILT=NONE after the keywords if the luminaire has no tilt factors",
            Problem::Tilt { .. } => {
                "write TILT=NONE, TILT=INCLUDE with its four records, or place the file beside this one"
            }
            Problem::Implausible { .. } => "correct the count; it is far larger than the rest of the file",
            Problem::TooMany { .. } => "correct the counts of angles in the header, or remove the surplus numbers",
            Problem::NotRising { .. } => {
                "sort the angles with their columns, or correct the count of angles before them"
            }
            Problem::AngleRange { .. } => "add the missing planes or angles, or correct the count of angles",
            Problem::Distribution(_) => "correct the table",
            Problem::Xml { .. } => "correct the XML; TM-33 asks for LuminaireOpticalData with Emitter and LuminousData",
            Problem::Several { .. } | Problem::NoSuchPart { .. } => {
                "name one of them behind the file, as in lamp.gldf#NAME (quoted in a shell)"
            }
            Problem::Archive { .. } => "export the product again, or unpack it and name its .ldt or .ies file",
            Problem::Unsupported { .. } => "export the luminous intensities as LM-63 type C or EULUMDAT",
        }
    }
}

impl fmt::Display for ReadError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if !self.file.as_os_str().is_empty() {
            write!(f, "{}:", self.file.display())?;
        }
        if self.line > 0 {
            write!(f, "{}:{}: ", self.line, self.column)?;
        } else if !self.file.as_os_str().is_empty() {
            f.write_str(" ")?;
        }
        self.problem.fmt(f)
    }
}

impl std::error::Error for ReadError {}
