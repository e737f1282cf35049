//! Errors of the readers of photometric files: what is wrong, where, and what to do.

use std::fmt;
use std::path::PathBuf;

use super::DistributionError;

/// The largest allowed intensity of a file in candela: the flux of a larger one can overflow.
const MAX_CD: f64 = 1e300;

/// Multiplies a number of a file by its factor and refuses a result that is not finite or too large.
pub(super) fn in_candela(what: impl fmt::Display, value: f64, factor: f64) -> Result<f64, Problem> {
    let candela = value * factor;
    if candela.abs() <= MAX_CD {
        return Ok(candela);
    }
    Err(Problem::NotFinite { what: what.to_string(), found: format!("{value:?} x {factor:?}") })
}

/// The refusal of a file: the problem and its place.
#[derive(Clone, Debug, PartialEq)]
pub struct ReadError {
    /// The path of the file; empty for bytes without a name.
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
        /// The message of the operating system.
        reason: String,
    },
    /// Neither LM-63 nor EULUMDAT nor TM-33 nor GLDF.
    #[error("this is no photometric file: neither LM-63 (no TILT= line), EULUMDAT, TM-33 XML nor GLDF")]
    Unrecognised,
    /// The file ends too early.
    #[error("the file ends where {expected} should follow")]
    UnexpectedEnd {
        /// What should follow.
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
    /// NaN, infinity, or a number too large to compute with.
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
    /// An LM-63 file without the record of ballast factor and input watts.
    #[error("the record of ballast factor, reserved number and input watts is missing: the angles follow at once")]
    MissingBallastRecord,
    /// An LM-63 file without its TILT line.
    #[error("no line begins with TILT=, with which the numbers of an LM-63 file start")]
    MissingTilt,
    /// A TILT line that names something other than NONE, INCLUDE or a readable file.
    #[error("the tilt factors cannot be followed: `TILT={name}`: {reason}")]
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
        /// The message of the XML parser or the schema.
        message: String,
    },
    /// A file with several photometries, where the path names none of them.
    #[error("the file holds several photometries: `{}`", names.join("`, `"))]
    Several {
        /// The names of all photometries.
        names: Vec<String>,
    },
    /// A file without the named photometry.
    #[error("the file holds no photometry `{name}`; it holds `{}`", names.join("`, `"))]
    NoSuchPart {
        /// The requested name.
        name: String,
        /// The names of all photometries.
        names: Vec<String>,
    },
    /// An archive that cannot be opened, or lacks what it lists.
    #[error("{message}")]
    Archive {
        /// What is wrong with it.
        message: String,
    },
    /// A valid file with a feature that no reader supports.
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
            Problem::MissingBallastRecord => "insert its three numbers before the angles: `1 1 WATTS`",
            Problem::MissingTilt => "add the line TILT=NONE after the keywords if the luminaire has no tilt factors",
            Problem::Tilt { .. } => {
                "write TILT=NONE, TILT=INCLUDE with its four records, or place the file in the same folder"
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
