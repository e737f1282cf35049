//! Luminous intensity distributions and their files: LM-63, EULUMDAT, TM-33 and GLDF.

#![warn(missing_docs)]

pub mod units;

mod analysis;
mod beam;
mod bug;
mod details;
mod difference;
mod distribution;
mod error;
pub mod eulumdat;
mod file_table;
mod format;
mod forward;
mod gldf;
mod goniometer;
mod header_lints;
mod lint;
pub mod lm63;
mod losses;
mod luminance;
mod orientation;
mod outdoor;
mod outline;
mod planes;
mod resample;
mod sampler;
mod spacing;
mod text;
pub mod tm33;
mod write;
mod writers;
mod xml;
mod zonal;

#[cfg(test)]
mod header_lints_tests;
#[cfg(test)]
mod native_tests;
#[cfg(test)]
mod round_trip_tests;

use std::cell::RefCell;
use std::fmt;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use glam::DVec3;

pub use beam::{Beam, BeamPlane, BeamWidth, NoBeam, PeakShape};
pub use bug::{BugRating, NoBug};
pub use details::Details;
pub use difference::{Departure, Difference, Likeness};
pub use distribution::{
    DistributionError, LuminousIntensityDistribution, Symmetry, TypeC, TypeCLimits, angles_deg, direction,
};
pub use error::{Problem, ReadError};
pub use format::FileFormat;
pub use forward::{Aimed, ForwardPolicy};
pub use goniometer::Goniometer;
pub use lint::{FORGIVEN, Lint, Severity, Tolerance};
pub use luminance::NoLuminance;
pub use orientation::{Convention, Lean};
pub use outdoor::ClassificationZones;
pub use resample::Resampled;
pub use sampler::{DirectionSampler, SampledDirection};
pub use spacing::{NoSpacing, SpacingCriteria};
pub use text::is_unprintable;
pub use write::Written;
pub use zonal::{MidZoneFlux, NoMidZones};

use lint::Lints;
use text::{Text, without_utf16};

/// The content of a photometric file: the distribution of a luminaire and the numbers that go with it.
#[derive(Clone, Debug, PartialEq)]
pub struct Photometry {
    /// The file's format and version, as printed in reports: `LM-63-2002`, `EULUMDAT`, `TM-33-18`.
    pub format: String,
    /// Intensity in every direction, multipliers applied, in candela.
    pub distribution: LuminousIntensityDistribution,
    /// Rated lumens of all lamps together; `None` for absolute photometry.
    pub lamp_lumens: Option<f64>,
    /// The luminous opening, for luminaire models that are more than a point.
    pub opening: LuminousOpening,
    /// Input power in watts, where the file states it.
    pub input_watts: Option<f64>,
    /// Header keywords in file order, e.g. `("MANUFAC", "Ledalite")`.
    ///
    /// The lines that `[MORE]` joined to a keyword are divided by line feeds; a label line has an empty keyword.
    pub keywords: Vec<(String, String)>,
    /// The fields that only this kind of file has: writing the file again loses nothing.
    pub details: Details,
    /// Remarks of the reader on what it tolerated or found doubtful.
    pub lints: Vec<Lint>,
    /// The files that it was read from, byte for byte. Empty for a computed or changed photometry.
    pub source: Vec<SourceFile>,
}

/// A file with its bytes: the photometric file itself, or the tilt factors that it names.
#[derive(Clone, PartialEq, Eq)]
pub struct SourceFile {
    /// Its name without a folder.
    pub name: String,
    /// All of it.
    pub bytes: Arc<[u8]>,
}

impl fmt::Debug for SourceFile {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} ({} bytes)", self.name, self.bytes.len())
    }
}

/// Reads a photometric file of any kind, or that of a GLDF container.
///
/// The content decides on the kind, then the extension (.ies, .ldt, .xml).
pub fn read_file(path: &Path) -> Result<Photometry, ReadError> {
    read_by(path, &|path| std::fs::read(path))
}

/// Reads a photometric file by way of `open`, which decides on the files that may be opened.
///
/// `open` gets the file and, for LM-63, the file of tilt factors that it names in the same folder.
pub fn read_by(path: &Path, open: &dyn Fn(&Path) -> std::io::Result<Vec<u8>>) -> Result<Photometry, ReadError> {
    read_tolerantly_by(path, open, Tolerance::Strict)
}

/// Splits a path such as `lamp.gldf#a.ldt` into the path of the file and the name of its part.
///
/// Only GLDF containers and TM-33 files have named parts.
pub fn file_and_part(path: &Path) -> (PathBuf, Option<String>) {
    let name = path.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
    let parted = name.split_once('#').filter(|(file, _)| {
        let file = file.to_ascii_lowercase();
        [".gldf", ".xml"].iter().any(|ending| file.ends_with(ending))
    });
    match parted {
        Some((file, part)) => (path.with_file_name(file), Some(part.into())),
        None => (path.to_path_buf(), None),
    }
}

/// Reads a photometric file as [`read_by`] does, with a tolerance for damage.
pub fn read_tolerantly_by(
    path: &Path,
    open: &dyn Fn(&Path) -> std::io::Result<Vec<u8>>,
    tolerance: Tolerance,
) -> Result<Photometry, ReadError> {
    let (file, part) = file_and_part(path);
    let part = part.as_deref();
    let opened = RefCell::new(vec![]);
    let bytes = open_recorded(&file, open, &opened).map_err(|error| {
        let problem = Problem::Io { reason: error.to_string() };
        ReadError { file: file.clone(), line: 0, column: 0, problem }
    })?;
    if gldf::looks_like(&bytes) {
        return read_container(&file, &bytes, part, tolerance);
    }
    let read = read_bytes(&file, &bytes, part, &|path| open_recorded(path, open, &opened), tolerance);
    let photometry = read.map_err(|error| ReadError { file, ..error })?;
    Ok(Photometry { source: opened.into_inner(), ..photometry })
}

/// Opens a file and adds it to the list of opened files.
fn open_recorded(
    path: &Path,
    open: &dyn Fn(&Path) -> std::io::Result<Vec<u8>>,
    opened: &RefCell<Vec<SourceFile>>,
) -> std::io::Result<Vec<u8>> {
    let bytes = open(path)?;
    opened.borrow_mut().push(SourceFile { name: file_name(path), bytes: bytes.as_slice().into() });
    Ok(bytes)
}

/// Reads the photometric file in a GLDF container.
fn read_container(
    container: &Path,
    bytes: &[u8],
    part: Option<&str>,
    tolerance: Tolerance,
) -> Result<Photometry, ReadError> {
    let part = gldf::extract_part(bytes, part).map_err(|error| {
        // An error with a line is one of the product list; any other is one of the archive.
        let file = if error.line > 0 { path_within(container, gldf::PRODUCT) } else { container.to_path_buf() };
        ReadError { file, ..error }
    })?;
    // A file in a container has no neighbours: a file of tilt factors that it names does not exist.
    let read =
        read_bytes(Path::new(&part.name), &part.bytes, None, &|_| Err(std::io::ErrorKind::NotFound.into()), tolerance);
    let photometry = read.map_err(|error| ReadError { file: path_within(container, &part.name), ..error })?;
    let file = SourceFile { name: part.name, bytes: part.bytes.into() };
    Ok(Photometry { source: vec![file], ..photometry })
}

/// The path of a file in a container, as [`file_and_part`] splits it.
fn path_within(container: &Path, name: &str) -> PathBuf {
    container.with_file_name(format!("{}#{name}", file_name(container)))
}

/// The name of a file without its folder.
fn file_name(path: &Path) -> String {
    path.file_name().unwrap_or_default().to_string_lossy().into_owned()
}

/// Reads the bytes of a photometric file, or of the named part of it.
fn read_bytes(
    path: &Path,
    bytes: &[u8],
    part: Option<&str>,
    open: &dyn Fn(&Path) -> std::io::Result<Vec<u8>>,
    tolerance: Tolerance,
) -> Result<Photometry, ReadError> {
    match FileKind::detect(path, bytes) {
        Some(FileKind::Lm63) => lm63::read(bytes, lm63::tilt_file_opener(path, open), tolerance),
        Some(FileKind::Eulumdat) => eulumdat::read(bytes, tolerance),
        Some(FileKind::Tm33) => tm33::read(bytes, part, tolerance),
        None => Err(Text::new(bytes).error(0, Problem::Unrecognised)),
    }
}

/// The kinds of photometric file.
#[derive(Clone, Copy, PartialEq, Eq)]
enum FileKind {
    Lm63,
    Eulumdat,
    Tm33,
}

impl FileKind {
    /// Detects the kind of a file by its content, else by its extension.
    fn detect(path: &Path, bytes: &[u8]) -> Option<Self> {
        let unicode = without_utf16(bytes);
        let text = Text::new(&unicode);
        let has_edition = text.lines().next().is_some_and(|line| lm63::is_edition_line(line.bytes));
        if has_edition || text.lines().any(|line| lm63::is_tilt_line(line.bytes)) {
            return Some(Self::Lm63);
        }
        if tm33::looks_like(&text) {
            return Some(Self::Tm33);
        }
        if eulumdat::looks_like(&text) {
            return Some(Self::Eulumdat);
        }
        let extension = path.extension().and_then(|e| e.to_str()).map(str::to_ascii_lowercase);
        match extension.as_deref() {
            Some("ies") => Some(Self::Lm63),
            Some("ldt") => Some(Self::Eulumdat),
            Some("xml") => Some(Self::Tm33),
            _ => None,
        }
    }
}

impl Photometry {
    /// The photometry of a distribution alone: a point, absolute photometry, no keywords.
    pub fn of(distribution: LuminousIntensityDistribution) -> Self {
        Self {
            format: "none".into(),
            distribution,
            lamp_lumens: None,
            opening: LuminousOpening::Point,
            input_watts: None,
            keywords: vec![],
            details: Details::None,
            lints: vec![],
            source: vec![],
        }
    }

    /// The same photometry with another distribution and without source files.
    #[must_use]
    pub fn with_distribution(&self, distribution: LuminousIntensityDistribution) -> Self {
        Self { distribution, source: vec![], ..self.clone() }
    }

    /// The LM-63 file that it was read from, if any: renderers read that format themselves.
    pub fn lm63_file(&self) -> Option<&SourceFile> {
        self.source.first().filter(|_| matches!(self.details, Details::Lm63(_)))
    }

    /// The candela multiplier, the ballast factor and the number behind it, as the LM-63 file has them that it was read from.
    pub fn lm63_multipliers(&self) -> Option<[f64; 3]> {
        difference::read_multipliers(&self.lm63_file()?.bytes)
    }

    /// The value of the first keyword of this name.
    pub fn keyword(&self, name: &str) -> Option<&str> {
        self.keywords.iter().find(|(key, _)| key.eq_ignore_ascii_case(name)).map(|(_, value)| value.as_str())
    }

    /// Takes over a reader's lints and adds those that concern every kind of file.
    fn with_lints(self, mut lints: Lints) -> Self {
        let flux = self.distribution.flux().value();
        if flux == 0.0 {
            lints.warn("dark", 0, "every intensity is zero");
        }
        if let Some(lamp_lumens) = self.lamp_lumens {
            let ratio = flux / lamp_lumens;
            // A luminaire emits at most what its lamps emit. The hundredth is for rounding and interpolation.
            if ratio > 1.01 {
                let message = format!(
                    "the intensities integrate to {flux:.1} lm, {ratio:.3} times the {lamp_lumens} lm of the lamps; nothing was rescaled"
                );
                lints.warn("flux", 0, message);
            }
        }
        Self { lints: lints.into_sorted(), ..self }
    }
}

/// The luminous opening of a luminaire in metres, in the luminaire's frame (C0 along +x, nadir along -z).
///
/// Every shape is centred on the photometric centre. The sides of a box or upright cylinder of `height_m` are luminous.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LuminousOpening {
    /// No extent.
    Point,
    /// A horizontal rectangle or, with a height, a box.
    Box {
        /// Extent along x (the C0-C180 axis).
        x_m: f64,
        /// Extent along y (the C90-C270 axis).
        y_m: f64,
        /// Extent along z.
        height_m: f64,
    },
    /// A horizontal ellipse or circle or, with a height, an upright cylinder.
    Ellipse {
        /// Diameter along x.
        x_m: f64,
        /// Diameter along y.
        y_m: f64,
        /// Extent along z.
        height_m: f64,
    },
    /// A sphere or an ellipsoid of revolution.
    Ellipsoid {
        /// Diameter along x.
        x_m: f64,
        /// Diameter along y.
        y_m: f64,
        /// Diameter along z.
        z_m: f64,
    },
    /// A cylinder lying along x (`axis_x`) or along y.
    LyingCylinder {
        /// Which horizontal axis it lies along.
        axis: HorizontalAxis,
        /// Extent along that axis.
        length_m: f64,
        /// Its diameter.
        diameter_m: f64,
    },
}

/// A horizontal axis of the luminaire.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum HorizontalAxis {
    /// The C0-C180 axis.
    X,
    /// The C90-C270 axis.
    Y,
}

impl LuminousOpening {
    /// Width (along C90), length (along C0) and height of the box around it, in metres.
    pub fn bounding_box_m(&self) -> [f64; 3] {
        match *self {
            Self::Point => [0.0; 3],
            Self::Box { x_m, y_m, height_m } | Self::Ellipse { x_m, y_m, height_m } => [y_m, x_m, height_m],
            Self::Ellipsoid { x_m, y_m, z_m } => [y_m, x_m, z_m],
            Self::LyingCylinder { axis: HorizontalAxis::X, length_m, diameter_m } => [diameter_m, length_m, diameter_m],
            Self::LyingCylinder { axis: HorizontalAxis::Y, length_m, diameter_m } => [length_m, diameter_m, diameter_m],
        }
    }

    /// The support function in metres: the reach from the photometric centre along a unit vector of the luminaire's frame.
    pub fn reach_m(&self, along: DVec3) -> f64 {
        let [width, length, height] = self.bounding_box_m();
        let reach = 0.5 * DVec3::new(length, width, height) * along.abs();
        match self {
            Self::Point | Self::Box { .. } => reach.element_sum(),
            Self::Ellipse { .. } => reach.x.hypot(reach.y) + reach.z,
            Self::Ellipsoid { .. } => reach.length(),
            Self::LyingCylinder { axis: HorizontalAxis::X, .. } => reach.x + reach.y.hypot(reach.z),
            Self::LyingCylinder { axis: HorizontalAxis::Y, .. } => reach.y + reach.x.hypot(reach.z),
        }
    }
}

/// Chooses the size of a long test: `ci/nightly` sets `LUXPROOF_NIGHTLY`, an ordinary run does not.
#[cfg(test)]
fn choose_by_run<T>(nightly: T, ordinary: T) -> T {
    if std::env::var_os("LUXPROOF_NIGHTLY").is_some() { nightly } else { ordinary }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A lying cylinder of 4 m length and 2 m diameter.
    fn lying(axis: HorizontalAxis) -> LuminousOpening {
        LuminousOpening::LyingCylinder { axis, length_m: 4.0, diameter_m: 2.0 }
    }

    #[test]
    fn an_opening_reaches_as_far_as_its_outermost_point() {
        let (x, y, slanted) = (DVec3::X, DVec3::Y, DVec3::new(0.6, 0.0, 0.8));

        for (opening, reaches) in [
            (LuminousOpening::Point, [0.0; 3]),
            (LuminousOpening::Box { x_m: 4.0, y_m: 2.0, height_m: 1.0 }, [2.0, 1.0, 0.6 * 2.0 + 0.8 * 0.5]),
            (LuminousOpening::Ellipse { x_m: 4.0, y_m: 2.0, height_m: 1.0 }, [2.0, 1.0, 0.6 * 2.0 + 0.8 * 0.5]),
            (LuminousOpening::Ellipsoid { x_m: 4.0, y_m: 2.0, z_m: 4.0 }, [2.0, 1.0, 2.0]),
            (lying(HorizontalAxis::X), [2.0, 1.0, 0.6 * 2.0 + 0.8]),
            (lying(HorizontalAxis::Y), [1.0, 2.0, 1.0]),
        ] {
            for (along, reach_m) in [x, y, slanted].into_iter().zip(reaches) {
                assert!((opening.reach_m(along) - reach_m).abs() < 1e-15, "{opening:?} {along}");
                assert_eq!(opening.reach_m(along), opening.reach_m(-along));
            }
        }
    }
}
