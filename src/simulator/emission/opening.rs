//! Luminous openings as smooth images of the unit square: what of their surface a place can see, and nothing else.
//!
//! Only the parts that face the place are mapped, so that what is integrated over the square has no edge within: of an
//! ellipsoid the cap up to its outline, of a cylinder the arc up to its outline and the end that shows.

use std::f64::consts::{PI, TAU};

use glam::DVec3;

use crate::photometry::{HorizontalAxis, LuminousOpening};
use crate::scene::{Luminaire, LuminaireModel};

/// A luminous opening in the luminaire's own frame, half extents in metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Opening {
    Point,
    /// A straight line between two opposite ends.
    Line(DVec3),
    Box(DVec3),
    /// An upright elliptical cylinder or, with `z` 0, a flat ellipse.
    Cylinder(DVec3),
    /// A cylinder lying along an axis or, with `z` 0, a flat ellipse that faces along it: half extents of it standing upright.
    Lying(HorizontalAxis, DVec3),
    Ellipsoid(DVec3),
}

/// A part of an opening as the image of the unit square, in the luminaire's own frame.
#[derive(Clone, Copy, Debug)]
pub(super) enum Sheet {
    /// A straight line: the second coordinate means nothing.
    Line(DVec3),
    /// A face of a box: corner and edges.
    Face { corner_m: DVec3, edges_m: [DVec3; 2] },
    /// An elliptical disc: centre and half axes along x and y.
    Disc { centre_m: DVec3, half_m: [f64; 2] },
    /// An arc of an upright elliptical cylinder: half extents, middle and half width of the arc.
    Arc { half_m: DVec3, middle: f64, width: f64 },
    /// The cap of an ellipsoid round an axis of the unit sphere, as high as `height`.
    Cap { half_m: DVec3, axis: DVec3, height: f64 },
    /// One of the others of a cylinder that lies along an axis.
    Laid(HorizontalAxis, Laid),
}

/// What a lying cylinder is made of, upright.
#[derive(Clone, Copy, Debug)]
pub(super) enum Laid {
    Disc { centre_m: DVec3, half_m: [f64; 2] },
    Arc { half_m: DVec3, middle: f64, width: f64 },
}

/// A point of an opening and the area with which it counts, as a vector along its normal, over that of the unit square.
#[derive(Clone, Copy, Debug)]
pub(super) struct Part {
    pub(super) at_m: DVec3,
    pub(super) area_m2: DVec3,
}

impl Opening {
    /// What a luminaire shines from, by its model.
    pub(super) fn of_luminaire(luminaire: &Luminaire) -> Self {
        match luminaire.model {
            LuminaireModel::Point => Self::Point,
            LuminaireModel::Area | LuminaireModel::Impostor => Self::of(luminaire.photometry.opening),
        }
    }

    pub(super) fn of(opening: LuminousOpening) -> Self {
        let half = |x: f64, y: f64, z: f64| 0.5 * DVec3::new(x, y, z).abs();
        let own = match opening {
            LuminousOpening::Point => Self::Point,
            LuminousOpening::Box { x_m, y_m, height_m } => Self::Box(half(x_m, y_m, height_m)),
            LuminousOpening::Ellipse { x_m, y_m, height_m } => Self::Cylinder(half(x_m, y_m, height_m)),
            LuminousOpening::Ellipsoid { x_m, y_m, z_m } => Self::ellipsoid(half(x_m, y_m, z_m)),
            LuminousOpening::LyingCylinder { axis, length_m, diameter_m } => {
                Self::Lying(axis, half(diameter_m, diameter_m, length_m))
            }
        };
        let longest = match own {
            _ if own.shadow_m2(DVec3::ONE) > 0.0 => return own,
            Self::Box(half) | Self::Cylinder(half) | Self::Ellipsoid(half) => half,
            Self::Lying(axis, half) => lay(axis, half),
            Self::Point | Self::Line(_) => DVec3::ZERO,
        };
        if longest == DVec3::ZERO { Self::Point } else { Self::Line(longest) }
    }

    /// Without extent along one axis it is a flat ellipse, which faces along that.
    fn ellipsoid(half: DVec3) -> Self {
        match half.to_array() {
            [.., 0.0] => Self::Cylinder(half),
            [0.0, ..] => Self::Lying(HorizontalAxis::X, lay(HorizontalAxis::X, half)),
            [_, 0.0, _] => Self::Lying(HorizontalAxis::Y, lay(HorizontalAxis::Y, half)),
            _ => Self::Ellipsoid(half),
        }
    }

    /// Projected area along a vector, times its length; of a flat opening, which shines on both sides, of either.
    pub(super) fn shadow_m2(&self, own: DVec3) -> f64 {
        let w = own.abs();
        match *self {
            Self::Point | Self::Line(_) => 0.0,
            Self::Box(h) => 4.0 * (h.y * h.z * w.x + h.x * h.z * w.y + h.x * h.y * w.z),
            Self::Cylinder(h) => cylinder_shadow_m2(h, w),
            Self::Lying(axis, h) => cylinder_shadow_m2(h, lay(axis, w)),
            Self::Ellipsoid(h) => PI * (DVec3::new(h.y * h.z, h.x * h.z, h.x * h.y) * w).length(),
        }
    }

    /// Half extents along its own axes.
    pub(super) fn half_m(&self) -> DVec3 {
        match *self {
            Self::Point => DVec3::ZERO,
            Self::Line(h) | Self::Box(h) | Self::Cylinder(h) | Self::Ellipsoid(h) => h,
            Self::Lying(axis, h) => lay(axis, h),
        }
    }

    /// Area of a flat opening, both of whose sides shine.
    pub(super) fn flat_m2(&self) -> Option<f64> {
        match *self {
            Self::Box(h) if h.min_element() == 0.0 => Some(4.0 * (h.x * h.y).max(h.y * h.z).max(h.x * h.z)),
            Self::Cylinder(h) | Self::Lying(_, h) if h.z == 0.0 => Some(PI * h.x * h.y),
            _ => None,
        }
    }

    /// What of it faces a point in its own frame; nothing for a point within.
    pub(super) fn facing(&self, point_m: DVec3) -> Vec<Sheet> {
        match *self {
            Self::Point => vec![],
            Self::Line(half) => vec![Sheet::Line(half)],
            Self::Box(half) => box_faces(half, point_m),
            Self::Cylinder(half) => {
                let laid = |l| match l {
                    Laid::Disc { centre_m, half_m } => Sheet::Disc { centre_m, half_m },
                    Laid::Arc { half_m, middle, width } => Sheet::Arc { half_m, middle, width },
                };
                cylinder_parts(half, point_m).into_iter().map(laid).collect()
            }
            Self::Lying(axis, half) => {
                cylinder_parts(half, lay(axis, point_m)).into_iter().map(|l| Sheet::Laid(axis, l)).collect()
            }
            Self::Ellipsoid(half) => {
                let scaled = point_m / half;
                let distance = scaled.length();
                let cap = Sheet::Cap { half_m: half, axis: scaled / distance, height: 1.0 - 1.0 / distance };
                if distance > 1.0 { vec![cap] } else { vec![] }
            }
        }
    }
}

impl Sheet {
    /// Whether the unit square's first coordinate is the area within a circle.
    pub(super) fn is_disc(&self) -> bool {
        matches!(self, Self::Disc { .. } | Self::Cap { .. } | Self::Laid(_, Laid::Disc { .. }))
    }

    pub(super) fn part(&self, [u, v]: [f64; 2]) -> Part {
        match *self {
            Self::Line(half) => Part { at_m: half * (2.0 * u - 1.0), area_m2: DVec3::ZERO },
            Self::Face { corner_m, edges_m: [a, b] } => Part { at_m: corner_m + u * a + v * b, area_m2: a.cross(b) },
            Self::Disc { centre_m, half_m } => disc_part(centre_m, half_m, u, v),
            Self::Arc { half_m, middle, width } => arc_part(half_m, middle, width, u, v),
            Self::Cap { half_m, axis, height } => {
                let (x, y) = axis.any_orthonormal_pair();
                let cos = 1.0 - u * height;
                let sin = (u * height * (1.0 + cos)).max(0.0).sqrt();
                let (s, c) = (TAU * v).sin_cos();
                let unit = axis * cos + (x * c + y * s) * sin;
                let h = half_m;
                let area_m2 = TAU * height * DVec3::new(h.y * h.z, h.x * h.z, h.x * h.y) * unit;
                Part { at_m: h * unit, area_m2 }
            }
            Self::Laid(axis, laid) => {
                let upright = match laid {
                    Laid::Disc { centre_m, half_m } => disc_part(centre_m, half_m, u, v),
                    Laid::Arc { half_m, middle, width } => arc_part(half_m, middle, width, u, v),
                };
                Part { at_m: lay(axis, upright.at_m), area_m2: lay(axis, upright.area_m2) }
            }
        }
    }
}

fn disc_part(centre_m: DVec3, [a, b]: [f64; 2], u: f64, v: f64) -> Part {
    let r = u.sqrt();
    let (sin, cos) = (TAU * v).sin_cos();
    let up = if centre_m.z < 0.0 { -1.0 } else { 1.0 };
    Part { at_m: centre_m + DVec3::new(a * r * cos, b * r * sin, 0.0), area_m2: DVec3::Z * up * PI * a * b }
}

fn arc_part(h: DVec3, middle: f64, width: f64, u: f64, v: f64) -> Part {
    let (sin, cos) = (middle + width * (2.0 * u - 1.0)).sin_cos();
    let area_m2 = 4.0 * width * h.z * DVec3::new(h.y * cos, h.x * sin, 0.0);
    Part { at_m: DVec3::new(h.x * cos, h.y * sin, h.z * (2.0 * v - 1.0)), area_m2 }
}

/// The faces of a box that look at a point; the one face of a flat box.
fn box_faces(half: DVec3, point_m: DVec3) -> Vec<Sheet> {
    let flat = half.min_element() == 0.0;
    let face = |axis: usize| {
        let (a, b) = ((axis + 1) % 3, (axis + 2) % 3);
        let side = if point_m[axis] < 0.0 { -1.0 } else { 1.0 };
        let mut corner_m = -half;
        corner_m[axis] = side * half[axis];
        let edges_m = [2.0 * half[a] * DVec3::AXES[a], 2.0 * side * half[b] * DVec3::AXES[b]];
        corner_m[b] *= side;
        Sheet::Face { corner_m, edges_m }
    };
    let shows = |axis: &usize| {
        if flat { half[*axis] == 0.0 } else { point_m[*axis].abs() > half[*axis] }
    };
    (0..3).filter(shows).map(face).collect()
}

fn cylinder_parts(half: DVec3, point_m: DVec3) -> Vec<Laid> {
    let mut parts = vec![];
    let across = DVec3::new(point_m.x / half.x, point_m.y / half.y, 0.0);
    let distance = across.length();
    if half.z > 0.0 && distance > 1.0 {
        parts.push(Laid::Arc { half_m: half, middle: across.y.atan2(across.x), width: (1.0 / distance).acos() });
    }
    if half.z == 0.0 || point_m.z.abs() > half.z {
        let centre_m = DVec3::Z * half.z * if point_m.z < 0.0 { -1.0 } else { 1.0 };
        parts.push(Laid::Disc { centre_m, half_m: [half.x, half.y] });
    }
    parts
}

fn cylinder_shadow_m2(h: DVec3, w: DVec3) -> f64 {
    PI * h.x * h.y * w.z + 4.0 * h.z * (h.y * w.x).hypot(h.x * w.y)
}

/// Exchanges z with the axis that a cylinder lies along.
fn lay(axis: HorizontalAxis, v: DVec3) -> DVec3 {
    match axis {
        HorizontalAxis::X => DVec3::new(v.z, v.y, v.x),
        HorizontalAxis::Y => DVec3::new(v.x, v.z, v.y),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    /// The parts that face a far point have together the projected area that the formula says.
    #[test]
    fn what_faces_a_far_place_has_the_projected_area() {
        let half = DVec3::new(0.3, 0.2, 0.5);
        let round = DVec3::new(0.3, 0.3, 0.5);
        let shapes = [
            Opening::Box(half),
            Opening::Cylinder(half),
            Opening::Lying(HorizontalAxis::X, round),
            Opening::Lying(HorizontalAxis::Y, round),
            Opening::Ellipsoid(half),
        ];
        for shape in shapes {
            for toward in [DVec3::new(1.0, 2.0, 3.0), DVec3::new(-2.0, 0.7, -0.4), DVec3::new(0.1, -1.0, 0.3)] {
                let toward = toward.normalize();
                let n = 400;
                let mut sum = 0.0;
                for sheet in shape.facing(1e6 * toward) {
                    for i in 0..n {
                        for j in 0..n {
                            let at = |k: i32| (f64::from(k) + 0.5) / f64::from(n);
                            let part = sheet.part([at(i), at(j)]);
                            sum += part.area_m2.dot(toward) / f64::from(n * n);
                        }
                    }
                }
                assert_relative_eq!(sum, shape.shadow_m2(toward), max_relative = 1e-4);
            }
        }
    }
}
