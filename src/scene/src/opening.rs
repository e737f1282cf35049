//! The form of a luminous opening: what a luminaire shines from, classified once for every solver.

use std::f64::consts::PI;

use glam::DVec3;

use crate::{Luminaire, LuminaireModel};
use luxproof_photometry::{HorizontalAxis, LuminousOpening};

/// A luminous opening in the luminaire's own frame, with half extents in metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Opening {
    /// No extent.
    Point,
    /// A straight line between two opposite ends.
    Line(DVec3),
    /// A box or, with one extent 0, a flat rectangle.
    Box(DVec3),
    /// An upright elliptical cylinder or, with `z` 0, a flat ellipse.
    Cylinder(DVec3),
    /// A cylinder that lies along an axis: half extents of it standing upright. With `z` 0 it is a flat ellipse that faces along the axis.
    Lying(HorizontalAxis, DVec3),
    /// An ellipsoid of three extents.
    Ellipsoid(DVec3),
}

impl Opening {
    /// The opening that a luminaire's model uses.
    pub fn of_luminaire(luminaire: &Luminaire) -> Self {
        match luminaire.model {
            LuminaireModel::Point => Self::Point,
            LuminaireModel::Area | LuminaireModel::Impostor => Self::from(luminaire.photometry.opening),
        }
    }

    /// An ellipsoid; with one extent 0 it is a flat ellipse, which faces along that axis.
    fn ellipsoid(half_m: DVec3) -> Self {
        match half_m.to_array() {
            [.., 0.0] => Self::Cylinder(half_m),
            [0.0, ..] => Self::Lying(HorizontalAxis::X, lay(HorizontalAxis::X, half_m)),
            [_, 0.0, _] => Self::Lying(HorizontalAxis::Y, lay(HorizontalAxis::Y, half_m)),
            _ => Self::Ellipsoid(half_m),
        }
    }

    /// Projected area in m² along a vector, times its length; of a flat opening, which shines on both sides, that of either.
    pub fn projected_area_m2(&self, along: DVec3) -> f64 {
        let w = along.abs();
        match *self {
            Self::Point | Self::Line(_) => 0.0,
            Self::Box(h) => 4.0 * (h.y * h.z * w.x + h.x * h.z * w.y + h.x * h.y * w.z),
            Self::Cylinder(h) => cylinder_area_m2(h, w),
            Self::Lying(axis, h) => cylinder_area_m2(h, lay(axis, w)),
            Self::Ellipsoid(h) => PI * (DVec3::new(h.y * h.z, h.x * h.z, h.x * h.y) * w).length(),
        }
    }

    /// Half extents along its own axes.
    pub fn half_m(&self) -> DVec3 {
        match *self {
            Self::Point => DVec3::ZERO,
            Self::Line(h) | Self::Box(h) | Self::Cylinder(h) | Self::Ellipsoid(h) => h,
            Self::Lying(axis, h) => lay(axis, h),
        }
    }

    /// Area in m² of one side of a flat opening, both of whose sides shine; `None` for others.
    pub fn flat_area_m2(&self) -> Option<f64> {
        match *self {
            Self::Box(h) if h.min_element() == 0.0 => Some(4.0 * (h.x * h.y).max(h.y * h.z).max(h.x * h.z)),
            Self::Cylinder(h) | Self::Lying(_, h) if h.z == 0.0 => Some(PI * h.x * h.y),
            _ => None,
        }
    }
}

impl From<LuminousOpening> for Opening {
    /// An opening without area is a line or a point.
    fn from(opening: LuminousOpening) -> Self {
        let own = match opening {
            LuminousOpening::Point => Self::Point,
            LuminousOpening::Box { x_m, y_m, height_m } => Self::Box(half(x_m, y_m, height_m)),
            LuminousOpening::Ellipse { x_m, y_m, height_m } => Self::Cylinder(half(x_m, y_m, height_m)),
            LuminousOpening::Ellipsoid { x_m, y_m, z_m } => Self::ellipsoid(half(x_m, y_m, z_m)),
            LuminousOpening::LyingCylinder { axis, length_m, diameter_m } => {
                Self::Lying(axis, half(diameter_m, diameter_m, length_m))
            }
        };
        let half_m = own.half_m();
        if own.projected_area_m2(DVec3::ONE) > 0.0 {
            own
        } else if half_m == DVec3::ZERO {
            Self::Point
        } else {
            Self::Line(half_m)
        }
    }
}

/// Exchanges z with the axis that a cylinder lies along.
pub fn lay(axis: HorizontalAxis, v: DVec3) -> DVec3 {
    match axis {
        HorizontalAxis::X => DVec3::new(v.z, v.y, v.x),
        HorizontalAxis::Y => DVec3::new(v.x, v.z, v.y),
    }
}

fn half(x_m: f64, y_m: f64, z_m: f64) -> DVec3 {
    0.5 * DVec3::new(x_m, y_m, z_m).abs()
}

fn cylinder_area_m2(h: DVec3, w: DVec3) -> f64 {
    PI * h.x * h.y * w.z + 4.0 * h.z * (h.y * w.x).hypot(h.x * w.y)
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    #[test]
    fn an_opening_without_area_is_a_line_or_a_point_and_a_flat_ellipsoid_an_ellipse() {
        let line = DVec3::new(0.0, 0.5, 0.0);
        let rod = LuminousOpening::LyingCylinder { axis: HorizontalAxis::Y, length_m: 1.0, diameter_m: 0.0 };
        let thin = LuminousOpening::Box { x_m: 0.0, y_m: -1.0, height_m: 0.0 };
        let none = LuminousOpening::Ellipse { x_m: 0.0, y_m: 0.0, height_m: 0.0 };
        assert_eq!([rod, thin, none].map(Opening::from), [Opening::Line(line), Opening::Line(line), Opening::Point]);
        for (size, normal) in [([0.0, 2.0, 4.0], DVec3::X), ([2.0, 0.0, 4.0], DVec3::Y), ([2.0, 4.0, 0.0], DVec3::Z)] {
            let [x_m, y_m, z_m] = size;
            let opening = Opening::from(LuminousOpening::Ellipsoid { x_m, y_m, z_m });
            assert_eq!(opening.half_m(), 0.5 * DVec3::from(size));
            assert_relative_eq!(opening.flat_area_m2().unwrap(), 2.0 * PI, max_relative = 1e-15);
            assert_relative_eq!(opening.projected_area_m2(normal), 2.0 * PI, max_relative = 1e-15);
            assert_eq!(opening.projected_area_m2(normal.any_orthogonal_vector()), 0.0);
        }
    }
}
