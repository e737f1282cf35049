//! The functions of direction that the tables of the pack contain.
//!
//! `x` points to C 0, `y` to C 90 and `z` up. Each function is smooth and has one value at each pole, so that a file is right
//! exactly where it says the function, and every wrong orientation gives other values.

use glam::DVec3;

/// Luminous intensity as a function of the unit direction.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ClosedForm {
    /// No symmetry.
    Skew,
    /// Equal on both sides of the plane C 0 - C 180.
    MirroredInC0,
    /// Equal on both sides of the plane C 90 - C 270.
    MirroredInC90,
    /// Equal on both sides of both planes.
    MirroredInBoth,
    /// Equal in every C plane.
    Axial,
}

impl ClosedForm {
    /// The intensity in candela towards a unit vector.
    pub fn intensity_cd(self, DVec3 { x, y, z }: DVec3) -> f64 {
        match self {
            Self::Skew => 500.0 + 200.0 * x + 120.0 * y - 150.0 * z + 60.0 * x * y,
            Self::MirroredInC0 => 500.0 + 200.0 * x + 120.0 * y * y - 150.0 * z,
            Self::MirroredInC90 => 500.0 + 200.0 * y + 120.0 * x * x - 150.0 * z,
            Self::MirroredInBoth => 400.0 + 250.0 * x * x - 150.0 * z,
            Self::Axial => 500.0 - 150.0 * z - 200.0 * z * z,
        }
    }

    /// The function as a formula in x, y and z.
    pub const fn formula(self) -> &'static str {
        match self {
            Self::Skew => "500 + 200 x + 120 y - 150 z + 60 x y",
            Self::MirroredInC0 => "500 + 200 x + 120 y^2 - 150 z",
            Self::MirroredInC90 => "500 + 200 y + 120 x^2 - 150 z",
            Self::MirroredInBoth => "400 + 250 x^2 - 150 z",
            Self::Axial => "500 - 150 z - 200 z^2",
        }
    }
}
