//! Luminous intensity distributions and the files that carry them.

mod distribution;

pub use distribution::{DistributionError, LuminousIntensityDistribution, Symmetry, angles_deg, direction};

/// What a photometric file says of a luminaire: its distribution and the few numbers that go with it.
#[derive(Clone, Debug)]
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
    pub keywords: Vec<(String, String)>,
}

/// The luminous opening of a luminaire, in metres, in its own frame (C0 along +x, nadir along -z).
///
/// Every shape is centred on the photometric centre. `height_m` of a box or an upright cylinder is its luminous side.
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
