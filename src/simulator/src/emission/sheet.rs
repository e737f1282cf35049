//! Luminous openings as smooth images of the unit square: what of their surface a place can see, and nothing else.
//!
//! Only the parts that face the place are mapped, so that what is integrated over the square has no edge within: of an
//! ellipsoid the cap up to its outline, of a cylinder the arc up to its outline and the end that shows.

use std::f64::consts::{PI, TAU};

use glam::DVec3;

use luxproof_photometry::HorizontalAxis;
use luxproof_scene::opening::{Opening, lay};

/// A part of an opening as the image of the unit square, in the luminaire's own frame.
#[derive(Clone, Copy, Debug)]
pub(super) enum OpeningPart {
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
    Lying(HorizontalAxis, LyingPart),
}

/// What a lying cylinder is made of, upright.
#[derive(Clone, Copy, Debug)]
pub(super) enum LyingPart {
    Disc { centre_m: DVec3, half_m: [f64; 2] },
    Arc { half_m: DVec3, middle: f64, width: f64 },
}

/// A point of an opening and the area with which it counts, as a vector along its normal, over that of the unit square.
#[derive(Clone, Copy, Debug)]
pub(super) struct Part {
    pub(super) at_m: DVec3,
    pub(super) area_m2: DVec3,
}

/// The parts of an opening that face a point in its own frame; nothing for a point within.
pub(super) fn facing(opening: &Opening, point_m: DVec3) -> Vec<OpeningPart> {
    match *opening {
        Opening::Point => vec![],
        Opening::Line(half_m) => vec![OpeningPart::Line(half_m)],
        Opening::Box(half_m) => box_faces(half_m, point_m),
        Opening::Cylinder(half_m) => cylinder_parts(half_m, point_m).into_iter().map(OpeningPart::from).collect(),
        Opening::Lying(axis, half_m) => {
            cylinder_parts(half_m, lay(axis, point_m)).into_iter().map(|l| OpeningPart::Lying(axis, l)).collect()
        }
        Opening::Ellipsoid(half_m) => {
            let scaled = point_m / half_m;
            let distance = scaled.length();
            let cap = OpeningPart::Cap { half_m, axis: scaled / distance, height: 1.0 - 1.0 / distance };
            if distance > 1.0 { vec![cap] } else { vec![] }
        }
    }
}

impl From<LyingPart> for OpeningPart {
    /// The same part of an upright cylinder.
    fn from(laid: LyingPart) -> Self {
        match laid {
            LyingPart::Disc { centre_m, half_m } => Self::Disc { centre_m, half_m },
            LyingPart::Arc { half_m, middle, width } => Self::Arc { half_m, middle, width },
        }
    }
}

impl OpeningPart {
    /// Whether the unit square's first coordinate is the area within a circle.
    pub(super) fn is_disc(&self) -> bool {
        matches!(self, Self::Disc { .. } | Self::Cap { .. } | Self::Lying(_, LyingPart::Disc { .. }))
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
            Self::Lying(axis, laid) => {
                let upright = Self::from(laid).part([u, v]);
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
fn box_faces(half_m: DVec3, point_m: DVec3) -> Vec<OpeningPart> {
    let flat = half_m.min_element() == 0.0;
    (0..3)
        .filter(|k| if flat { half_m[*k] == 0.0 } else { point_m[*k].abs() > half_m[*k] })
        .map(|axis| box_face(half_m, axis, if point_m[axis] < 0.0 { -1.0 } else { 1.0 }))
        .collect()
}

/// The face of a box at the `side` (-1 or 1) of an axis.
fn box_face(half_m: DVec3, axis: usize, side: f64) -> OpeningPart {
    let (a, b) = ((axis + 1) % 3, (axis + 2) % 3);
    let mut corner_m = -half_m;
    corner_m[axis] = side * half_m[axis];
    let edges_m = [2.0 * half_m[a] * DVec3::AXES[a], 2.0 * side * half_m[b] * DVec3::AXES[b]];
    corner_m[b] *= side;
    OpeningPart::Face { corner_m, edges_m }
}

fn cylinder_parts(half: DVec3, point_m: DVec3) -> Vec<LyingPart> {
    let mut parts = vec![];
    let across = DVec3::new(point_m.x / half.x, point_m.y / half.y, 0.0);
    let distance = across.length();
    if half.z > 0.0 && distance > 1.0 {
        parts.push(LyingPart::Arc { half_m: half, middle: across.y.atan2(across.x), width: (1.0 / distance).acos() });
    }
    if half.z == 0.0 || point_m.z.abs() > half.z {
        let centre_m = DVec3::Z * half.z * if point_m.z < 0.0 { -1.0 } else { 1.0 };
        parts.push(LyingPart::Disc { centre_m, half_m: [half.x, half.y] });
    }
    parts
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
                for sheet in facing(&shape, 1e6 * toward) {
                    for k in 0..n * n {
                        let part = sheet.part([k % n, k / n].map(|k| (f64::from(k) + 0.5) / f64::from(n)));
                        sum += part.area_m2.dot(toward) / f64::from(n * n);
                    }
                }
                assert_relative_eq!(sum, shape.projected_area_m2(toward), max_relative = 1e-4);
            }
        }
    }
}
